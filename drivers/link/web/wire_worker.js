/* SPDX-License-Identifier: MIT */
// This is the page's worker: it reads and decodes the connection, so that drawing and reading don't delay each other.
import {Wire} from './wire.js';

const wire = new Wire((message, transfer) => postMessage(message, transfer));
onmessage = ({data}) => wire.take(data);
