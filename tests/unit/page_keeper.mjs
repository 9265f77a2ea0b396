/* SPDX-License-Identifier: MIT */
// This tests the part of the stream that the page keeps for a recording (drivers/link/web/keeper.js). page_picture.mjs
// runs these tests with its own.
import {Keeper} from '../../drivers/link/web/keeper.js';
import {Wire} from '../../drivers/link/web/wire.js';
import {Parser} from '../../drivers/link/web/native_parser.js';
import {crc32c} from '../../drivers/link/web/crc32c.js';
import {same} from './page_rig.mjs';
import {test} from './page_tap.mjs';

const frameOf = (type, flags, seq, text) => {
  const payload = new TextEncoder().encode(text), bytes = new Uint8Array(28 + payload.length), v = new DataView(bytes.buffer);
  bytes.set([0xd5, type, 1, flags]);
  bytes.set(payload, 28);
  v.setUint32(4, payload.length, true);
  v.setUint32(8, seq, true);
  v.setUint32(12, crc32c(v, 28, bytes.length), true);
  v.setUint32(24, crc32c(v, 0, 24), true);
  return bytes;
};

test('a recording begins with what its points need, and has every frame from there on', async () => {
  same((new Keeper()).end().size, 0, 'one that has not begun, as where the worker was started anew');
  const keeper = new Keeper();
  const parser = new Parser({frame: (frame) => keeper.take(frame)});
  [frameOf(1, 0, 0, 'old'), frameOf(10, 0, 1, 'old emitter'), frameOf(2, 0, 2, 'old anchor'), frameOf(1, 0, 3, 'new'),
    frameOf(2, 0, 4, 'anchor'), frameOf(3, 0, 5, 'before')].forEach((bytes) => parser.push(bytes));
  keeper.begin();
  [frameOf(3, 0, 6, 'points'), frameOf(4, 0, 7, 'line')].forEach((bytes) => parser.push(bytes));
  const bytes = new Uint8Array(await keeper.end().arrayBuffer()), got = [];
  parser.push(frameOf(3, 0, 8, 'after'));
  same(keeper.bytes, bytes.length, 'its length');
  const reader = new Parser({frame: ({type, flags, seq, payload}) => got.push([type, flags, seq, new TextDecoder().decode(payload)])});
  reader.push(bytes);
  same(got, [[1, 3, 0, 'new'], [2, 3, 0, 'anchor'], [3, 0, 6, 'points'], [4, 0, 7, 'line']], 'frames'); // 3: REPEAT, LOCAL
  same([reader.stats.bad_bytes, reader.stats.lost_frames], [0, 0], 'bad bytes and lost frames');
});

test('a recording has nothing of the head before, where another one has come at its address', async () => {
  const {WebSocket} = globalThis, things = [];
  let socket = null;
  globalThis.WebSocket = class {
    constructor() { socket = this; }
    close() {}
  };
  const wire = new Wire((message) => things.push(...message.things)), say = (bytes) => socket.onmessage({data: bytes.buffer});
  wire.take({connect: 'ws://head/ws'});
  [frameOf(1, 0, 0, 'before'), frameOf(2, 0, 1, 'its anchor')].forEach(say);
  wire.take({connect: 'ws://head/ws'});
  [frameOf(1, 3, 0, 'now'), frameOf(3, 0, 1, 'points')].forEach(say);
  wire.take({keep: true});
  wire.take({ack: true});
  wire.take({keep: false});
  wire.take({close: true});
  globalThis.WebSocket = WebSocket;
  const [, blob] = things.find(([name]) => name === 'kept'), text = await blob.text();
  same([text.includes('now'), /before|anchor/.test(text)], [true, false], 'the heads in it');
});
