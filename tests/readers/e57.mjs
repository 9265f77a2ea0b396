/* SPDX-License-Identifier: MIT */
// This writes the points of an E57 file as web-e57 reads them, with each scan's pose applied.
import fs from 'node:fs';
import {convertE57} from 'web-e57';

fs.writeFileSync(process.argv[3], convertE57(new Uint8Array(fs.readFileSync(process.argv[2])), 'XYZ'));
