/* SPDX-License-Identifier: MIT */
// The page's worker: the connection is read and decoded here, so that a page which is drawing doesn't hold it up, nor
// the other way round.
import {Wire} from './wire.js';

const wire = new Wire((message, transfer) => postMessage(message, transfer));
onmessage = ({data}) => wire.take(data);
