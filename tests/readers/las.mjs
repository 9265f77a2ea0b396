/* SPDX-License-Identifier: MIT */
// This prints a LAS file as @loaders.gl/las reads it: count, bounds by the header (min, max of x, y, z), then the points.
import fs from 'node:fs';
import {parse} from '@loaders.gl/core';
import {LAZRsLoader} from '@loaders.gl/las';

// The loader fetches its WebAssembly by a file: address, which node's fetch does not take.
globalThis.fetch = async (url) =>
  new Response(fs.readFileSync(new URL(url)), {headers: {'content-type': 'application/wasm'}});

const file = fs.readFileSync(process.argv[2]);
const bytes = file.buffer.slice(file.byteOffset, file.byteOffset + file.byteLength);
const mesh = await parse(bytes, LAZRsLoader, {worker: false, las: {fp64: true, skip: 1, colorDepth: 8}});
const {mins, maxs} = mesh.loaderData;
const xyz = mesh.attributes.POSITION.value;
const lines = [`${mesh.header.vertexCount}`, mins.map((m, i) => `${m} ${maxs[i]}`).join(' ')];
for (let i = 0; i < xyz.length; i += 3) lines.push(`${xyz[i]} ${xyz[i + 1]} ${xyz[i + 2]}`);
fs.writeFileSync(process.argv[3], lines.join('\n') + '\n');
