/* SPDX-License-Identifier: MIT */
// Waveforms in the page (drivers/link/web/native_waves.js), from the frame of SAMPLES.md. This file prints TAP on
// standard output.
import {Decoder, Parser} from '../../drivers/link/web/native.js';
import {Waves} from '../../drivers/link/web/native_waves.js';
import {Wire} from '../../drivers/link/web/wire.js';
import {equal, readSamples} from './page_rig.mjs';
import {runTests, test} from './page_tap.mjs';

const samples = readSamples();
const stream = Buffer.concat(samples), viewOf = (bytes) => new DataView(bytes.buffer, bytes.byteOffset, bytes.length);

function decoded() {
  const decoder = new Decoder(), parser = new Parser({frame: (f) => decoder.take(f)});
  parser.push(stream);
  parser.end();
  return decoder;
}

const wavesSample = samples.find((bytes) => bytes[1] === 12).subarray(28);

test('the windows of a pulse: ranges, and samples in thresholds', () => {
  const decoder = decoded(), [near, far, ...more] = decoder.wavesOf(0);
  const step_m = 0.5 * 0.299792458; // of 1 ns
  equal(more.length, 0, 'windows');
  [[near, 18, [201, 388, 1623, 702, 211]], [far, 28, [203, 529, 598, 207]],
    [decoder.wavesOf(1)[0], 11, [200, 212, 446, 451, 205, 201]]].forEach(([w, first, counts]) => {
    equal(w.stepM, step_m, 'step');
    equal(w.rangeM0, first * step_m, 'range');
    equal([...w.samples].join(), counts.map((c) => (c - 200.5) * 0.125).join(), 'samples');
  });
  equal(decoder.wavesOf(2).length, 0, 'of a shot without echo');
  equal(decoder.stats.lost_samples, 7, 'lost');
});

test('waveforms that do not fit into their frame are refused', () => {
  const whole = new Waves(), bytes = Buffer.from(wavesSample);
  const isRefused = (part) => {
    try {
      whole.add(viewOf(part), 1);
      return false;
    } catch {
      return true;
    }
  };
  for (let n = 0; n < bytes.length; n++) equal(isRefused(Buffer.from(bytes.subarray(0, n))), true, `${n} bytes`);
  equal(isRefused(bytes), false, 'whole');
  for (const [at, value] of [[12, 4], [15, 255], [16 + 28 + 12, 0], [32 + 13, 16], [22, 7], [22, 15], [27, 191]]) {
    const hurt = Buffer.from(bytes);
    hurt[at] = value;
    if (at === 56) hurt.writeUInt16LE(0, 32 + 12);
    equal(isRefused(hurt), true, `byte ${at} is ${value}`);
  }
  const noStep = Buffer.from(bytes);
  noStep.writeUInt32LE(0, 16);
  equal(isRefused(noStep), true, 'no time between samples');
});

test('the last waveforms of a scan are kept, up to a limit', () => {
  const waves = new Waves(2100 * wavesSample.length);
  const at = (pulse0) => {
    const frame = Buffer.from(wavesSample);
    frame.writeBigUInt64LE(BigInt(pulse0));
    return viewOf(frame);
  };
  const high = 2 ** 32; // pulse numbers of more than 32 bits
  for (let i = 0; i < 5000; i++) waves.add(at(high + 2 * i), 1);
  equal(waves.of(high + 2 * 2899).length, 0, 'gone');
  for (const i of [2900, 3000, 4999]) equal(`${waves.of(high + 2 * i).length} ${waves.of(high + 2 * i + 1).length}`, '2 1', `frame ${i}`);
  waves.add(at(high + 9998), 1); // one more of the same points
  equal(waves.of(high + 9998).length, 4, 'in two frames');
  waves.add(at(0), 2);
  equal(`${waves.of(high + 9998).length} ${waves.of(0).length}`, '0 2', 'another scan');
  equal(`${waves.of(0, 1).length} ${waves.of(0, 2).length}`, '0 2', 'of a scan');
});

// Calls use(wire, socket, sent) with a wire that is connected by a socket of ours, and the messages that it sends.
function withWire(use) {
  const real = globalThis.WebSocket, sent = [];
  let socket;
  globalThis.WebSocket = class {
    constructor() { socket = this; }
    close() {}
  };
  try {
    const wire = new Wire((message) => sent.push(message));
    wire.take({connect: 'ws://head/ws'});
    socket.onopen();
    use(wire, socket, sent);
    wire.take({close: true});
  } finally {
    globalThis.WebSocket = real;
  }
}

test('a page asks its wire for the waveform of a pulse', () => withWire((wire, socket, sent) => {
  socket.onmessage({data: new Uint8Array(stream).buffer});
  wire.take({wavesOf: 1, scan: 1});
  const [, answer] = sent.flatMap(({things}) => things).find(([name]) => name === 'waves');
  equal(`${answer.pulse} ${answer.scan} ${answer.windows.length} ${answer.windows[0].samples.length}`, '1 1 1 6', 'answer');
}));

test('a page that takes nothing for long still gets its recording and the end of its connection', () => withWire((wire, socket, sent) => {
  wire.take({keep: true});
  for (let i = 0; i < 20000; i++) socket.onmessage({data: 'OK'});
  socket.onmessage({data: new Uint8Array(stream).buffer});
  wire.take({keep: false});
  socket.onclose({code: 1006, reason: ''});
  const before = sent.length;
  wire.take({ack: true});
  equal(sent.length, before + 1, 'messages after it takes one');
  const names = sent.flatMap(({things}) => things.map(([name]) => name));
  equal(`${names.filter((name) => name === 'text').length} ${names.slice(-2).join(' ')}`, '20000 kept close', 'things');
  equal([...new Set(sent.map(({connection}) => connection))].join(), '1', 'connections');
  equal(sent.at(-1).figures.dropped_things > 0, true, 'others are dropped, and counted');
}));

await runTests();
