/* SPDX-License-Identifier: MIT */
// The page's decoder (drivers/link/web/native.js): samples of SAMPLES.md value by value, damage, and recordings beside
// the client in Python. This file prints TAP on standard output.
//
//     node page_native.mjs FOLDER    FOLDER: with polar.shs, utm.shs, ... and the points that Python makes of each
import fs from 'node:fs';
import {crc32c, Decoder, Parser, LOCAL, REPEAT, TYPES} from '../../drivers/link/web/native.js';
import {readWavesHead} from '../../drivers/link/web/native_fields.js';
import {equal} from './page_rig.mjs';
import {runTests, test} from './page_tap.mjs';
import './page_native_parts.mjs';

const page = fs.readFileSync(new URL('../../drivers/protocol/SAMPLES.md', import.meta.url), 'utf8');
const samples = [...page.matchAll(/```text\n(d5 [0-9a-f \n]*)```\n\n```text\n([^`]*)```/g)].map(([, hex, words]) =>
  ({bytes: Buffer.from(hex.replace(/\s/g, ''), 'hex'), words: words.replace(/\s+/g, ' ').trim()}));
const stream = Buffer.concat(samples.map(({bytes}) => bytes));

function near(ours, theirs, tolerance, what) {
  const same = Number.isNaN(theirs) ? Number.isNaN(ours) : Math.abs(ours - theirs) <= tolerance;
  if (!same) throw new Error(`${what}: ${ours}, and not ${theirs}, by more than ${tolerance}`);
}

// All that comes out of these pieces, in order.
function readAll(pieces, last = true) {
  const out = {frames: [], texts: [], values: [], batches: [], refused: []};
  const hand = (value) => out.values.push(value);
  const decoder = new Decoder({points: (b) => out.batches.push(b), descriptor: hand, anchor: hand, emitter: hand, names: hand,
    lineEnd: hand, telemetry: hand, event: hand, poses: hand, refused: (why) => out.refused.push(why)});
  const parser = new Parser({text: (t) => out.texts.push(t), notice: (n) => decoder.notice(n), frame(f) {
    out.frames.push({type: f.type, flags: f.flags, seq: f.seq, t_ns: f.t_ns, payload: f.payload.slice()});
    decoder.take(f);
  }});
  for (const piece of pieces) parser.push(piece);
  if (last) parser.end();
  decoder.flush(true);
  return {...out, decoder, parser, stats: parser.stats};
}

const viewOf = (bytes) => new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
const bytesOf = (frames) => frames.map((f) => Buffer.from(f.payload).toString('hex')).join();

// ---- samples

// Compares a value with the words of a line `name value value`: a text, a number, or an array of numbers.
function sameField(value, name, words) {
  if (typeof value === 'string') return equal(value, words, name);
  const theirs = words.split(' '), ours = Array.isArray(value) ? value : [value];
  equal(ours.length, theirs.length, name);
  return ours.forEach((v, i) => equal(typeof v === 'bigint' ? v : v + 0, typeof v === 'bigint' ? BigInt(theirs[i]) : Number(theirs[i]), name));
}

// The entries that are records, by their pattern; r: what came out, k: which record.
const records = [
  [/^echo (\d+) of (\d+), label (\d+), (\S+) dB, t_ns (\d+), head's frame (.*), scene (.*)$/, ({batches: [b]}, k, m) => {
    if (m[1] === '0') return equal(b.n, k, 'a shot without echo is no point');
    equal(b.echo[k], Number(m[1]), 'echo');
    equal(b.echoes[k], Number(m[2]), 'echoes');
    equal(b.label[k], Number(m[3]), 'label');
    equal(b.reflectance[k], Math.fround(Number(m[4])), 'reflectance');
    equal(b.t[k], Math.fround(Number(m[5]) * 1e-9), 't');
    near(b.range[k], Math.hypot(...m[6].split(' ')), 1e-4, 'range'); // the page has four decimals
    return m[7].split(' ').forEach((v, i) => near([b.x, b.y, b.z][i][k], Number(v), 0.51e-4, 'scene'));
  }],
  [/^amplitude (\S+) dB, width/, ({batches: [b]}, k, m) => k < b.n && equal(b.amplitude[k], Math.fround(Number(m[1])), 'amplitude')],
  [/^window of pulse /, ({value}) => equal(value.n_windows, 3, 'windows')], // page_waves.mjs has what is in them
  [/^rgb (\d+) (\d+) (\d+)$/, ({batches: [b]}, k, m) => k < b.n &&
    [0, 1, 2].forEach((i) => equal(b.rgb[3 * k + i], Number(m[1 + i]), 'rgb'))],
  [/^label (\d+): (.*) of (.*)$/, ({value}, k, m) => {
    equal(value[k].label, Number(m[1]), 'label');
    equal(value[k].object, m[2], 'object');
    equal(value[k].material, m[3], 'material');
  }],
  [/^beam elevation (\S+) deg, azimuth (\S+) deg, (\d+) ns$/, ({value}, k, m) => {
    near(value.beams[k].elevation_udeg, 1e6 * Number(m[1]), 1e-3, 'elevation');
    near(value.beams[k].azimuth_udeg, 1e6 * Number(m[2]), 1e-3, 'azimuth');
    equal(value.beams[k].offset_ns, Number(m[3]), 'offset');
  }],
];

function sameAsSaid({words}, frame, value, batches) {
  const flags = (frame.flags & REPEAT ? ' REPEAT' : '') + (frame.flags & LOCAL ? ' LOCAL' : '');
  const [title, seq, t_ns, ...entries] = words.split('; ');
  equal(TYPES[frame.type] + flags, title, 'type');
  sameField(frame.seq, 'seq', seq.replace('seq ', ''));
  sameField(frame.t_ns, 't_ns', t_ns.replace('t_ns ', ''));
  const counts = new Map();
  let pose = -1;
  for (const entry of entries) {
    const record = records.find(([pattern]) => pattern.test(entry));
    const [, name, rest] = /^(\w+) ?(.*)$/.exec(entry);
    if (record) {
      const k = counts.get(record) ?? 0;
      counts.set(record, k + 1);
      record[1]({batches, value}, k, record[0].exec(entry));
    } else if (name === 'pose') {
      sameField(value[++pose].t_ns, 't_ns', rest.replace('t_ns ', ''));
    } else if (pose >= 0) {
      sameField(value[pose][name], name, rest);
    } else if (['points', 'attributes', 'colours'].includes(title)) {
      const [at, big] = {frame: [0], line: [title === 'points' ? 4 : 8], pulse0: [title === 'points' ? 8 : 0, 1], t0_ns: [16, 1],
        line_t0_ns: [24, 1], n_pulses: [32], n_points: [title === 'points' ? 36 : 12]}[name];
      const p = Buffer.from(frame.payload);
      equal(big ? Number(p.readBigInt64LE(at)) : p.readUInt32LE(at), Number(rest), name);
    } else {
      sameField(value[name], name, rest);
    }
  }
  return entries.length;
}

test('crc32c: the check value of RFC 3720, of nothing, and byte by byte', () => {
  const of = (bytes) => crc32c(new DataView(bytes.buffer, bytes.byteOffset, bytes.length), 0, bytes.length);
  equal(of(new TextEncoder().encode('123456789')), 0xe3069283, 'check');
  equal(of(new Uint8Array(0)), 0, 'nothing');
  equal(of(new Uint8Array(32)), 0x8a9136aa, '32 zeros (RFC 3720, B.4)');
});

test('every value of every sample', () => {
  equal(samples.length, 14, 'samples');
  const all = readAll([stream]), values = [...all.values];
  equal(all.frames.length, 14, 'frames');
  equal(all.batches.length, 1, 'batches');
  equal(all.batches[0].shots, 3, 'shots');
  equal([...all.batches[0].pulse].join(), '0,0,1', 'pulse numbers');
  const without = ['points', 'attributes', 'colours', 'waveforms'];
  let n = 0;
  samples.forEach((sample, i) => {
    const isWaves = TYPES[all.frames[i].type] === 'waveforms';
    const value = isWaves ? readWavesHead(viewOf(all.frames[i].payload)) : without.includes(TYPES[all.frames[i].type]) ? null : values.shift();
    n += sameAsSaid(sample, all.frames[i], value, all.batches);
  });
  if (n < 120) throw new Error(`only ${n} values were compared`);
});

test('an event says what a, b and c mean', () => {
  const {values} = readAll([stream]), [start, lost] = [values[0], values.at(-1)];
  equal(start.name, 'SCAN_START', 'name');
  equal(start.scan, 1, 'scan');
  equal(start.at_ns, 2500000000n, 'at_ns');
  equal(`${lost.name} ${lost.frames} ${lost.pulses} ${lost.local}`, 'READER_LOST 12 0 true', 'lost');
});

// ---- damage

test('byte by byte', () => {
  const whole = readAll([stream]), single = readAll([...stream].map((byte) => Uint8Array.of(byte)));
  equal(bytesOf(single.frames), bytesOf(whole.frames), 'frames');
  equal(single.stats.bad_bytes, 0, 'bad bytes');
  equal(single.decoder.pointHash, whole.decoder.pointHash, 'hash');
});

test('reply lines between frames; after garbage text is ignored until the next frame', () => {
  const text = (words) => Buffer.from(words, 'latin1'), [a, b] = samples.map(({bytes}) => bytes);
  const {texts, stats} = readAll([text('OK\r\n'), a, text('1\r'), text('\n2\r\n'), b, text('\xd5\0\0OK\r\n'), a, text('4\r\n')]);
  equal(texts.join(), 'OK,1,2,4', 'texts');
  equal(stats.bad_bytes, 7, 'bad bytes');
  equal(readAll([a, text('\0'), text('OK\r\n'), b, text('1\r\n')]).texts.join(), '1', 'texts after garbage');
  equal(readAll([text('x'.repeat(511) + '\r\n')]).texts.length, 0, 'a line of 513 bytes');
  equal(readAll([text('x'.repeat(510) + '\r\n')]).texts.length, 1, 'a line of 512 bytes');
});

test('garbage between frames, wrong checksums, bytes cut out: every whole frame comes', () => {
  for (let i = 0; i < samples.length; i++) {
    for (const damage of [
      (b) => Buffer.concat([Buffer.from([0xd5, 7, 0xd5, 0xd5]), b]), // garbage before
      (b) => b.subarray(0, b.length - 5), // cut short
      (b) => Buffer.concat([b.subarray(0, 40), b.subarray(41)]), // a byte lost
      (b) => Buffer.from(b.map((v, at) => (at === 33 ? v ^ 1 : v))), // a bit turned in the payload
      (b) => Buffer.from(b.map((v, at) => (at === 20 ? v ^ 1 : v))), // and in the header
    ]) {
      const pieces = samples.map(({bytes}, k) => (k === i ? damage(bytes) : bytes)), keeps = pieces[i].length > samples[i].bytes.length;
      const all = readAll([Buffer.concat(pieces)]), rest = samples.filter((_, k) => k !== i || keeps);
      equal(bytesOf(all.frames), rest.map(({bytes}) => bytes.subarray(28).toString('hex')).join(), `frames without ${i}`);
      const lost = keeps || i === 0 || i === 13 ? 0 : i === 12 ? 0 : 1; // of the last in the sequence nobody knows
      equal(all.stats.lost_frames, lost, `lost frames, ${i}`);
      const taken = all.frames.reduce((sum, f) => sum + 28 + f.payload.length, 0);
      equal(all.stats.bad_bytes, all.stats.bytes - taken, 'bad bytes');
    }
  }
});

test('truncated anywhere: what came whole comes', () => {
  for (let n = 0; n < stream.length; n += 7) {
    let whole = 0;
    for (let end = 0; whole < samples.length && (end += samples[whole].bytes.length) <= n; whole++);
    equal(readAll([stream.subarray(0, n)]).frames.length, whole, `frames of ${n} bytes`);
  }
});

// The header is 28 bytes; the payload says which frame it is.
function numbered(seq, payload = Buffer.from(`frame ${seq}`)) {
  const frame = Buffer.alloc(28 + payload.length);
  frame.set([0xd5, 6, 1, 0]);
  frame.writeUInt32LE(payload.length, 4);
  frame.writeUInt32LE(seq, 8);
  frame.writeBigInt64LE(BigInt(seq % 100), 16);
  payload.copy(frame, 28);
  return signed(frame);
}

test('a frame that came twice, or after newer ones, is dropped; each fault gives one notice at its byte', () => {
  const [a, b, c, d, e] = [2 ** 32 - 2, 2 ** 32 - 1, 0, 1, 2].map((seq) => numbered(seq)), restarted = numbered(2 ** 31 + 9);
  const bad = Buffer.from(d.map((v, at) => (at === d.length - 1 ? v ^ 1 : v)));
  const pieces = [a, c, Buffer.from([0, 0xd5, 0]), c, b, bad, e, restarted, a.subarray(0, 30)];
  const at = pieces.map((_, i) => pieces.slice(0, i).reduce((n, piece) => n + piece.length, 0)), all = Buffer.concat(pieces);
  for (let size = 1; size <= all.length; size++) {
    const notices = [], seqs = [];
    const parser = new Parser({notice: (n) => notices.push(Object.values(n).join()), frame: (f) => seqs.push(f.seq)});
    for (let i = 0; i < all.length; i += size) parser.push(all.subarray(i, i + size));
    parser.end();
    equal(seqs.join(), [2 ** 32 - 2, 0, 2, 2 ** 31 + 9].join(), 'frames');
    equal(notices.join(' '), [`gap,${at[1]},${2 ** 32 - 1},1,0`, `bad bytes,${at[2]},0,3,0`, `repeated,${at[3]},0,1,0`,
      `late,${at[4]},${2 ** 32 - 1},1,95`, `bad payload,${at[5]},1,${bad.length},1`, `gap,${at[6]},1,1,2`,
      `restarted,${at[7]},${2 ** 31 + 9},1,57`, `cut,${at[8]},${2 ** 32 - 2},30,94`].join(' '), `notices, in pieces of ${size}`);
    const {repeated_frames: r, late_frames: l, lost_frames: n, jumps_back: j, cuts, bad_payloads: p} = parser.stats;
    equal(`${r} ${l} ${n} ${j} ${cuts} ${p}`, '1 1 2 1 1 1', 'counts');
  }
});

test('random faults: what is noticed and taken is what the client in Python notices and takes', () => {
  const folder = process.argv[2];
  for (let k = 0; k < 12; k++) {
    const bytes = fs.readFileSync(`${folder}/hurt-${k}.shs`), said = fs.readFileSync(`${folder}/hurt-${k}.notices`, 'utf8');
    const ours = [];
    const parser = new Parser({frame: ({seq, t_ns}) => ours.push(`frame,${seq},${t_ns}\n`), text: () => ours.push('text\n'),
      notice: ({kind, at_byte, seq, n, t_ns}) => ours.push(`${kind},${at_byte},${seq},${n},${t_ns ?? -1}\n`)});
    for (let at = 0, n; at < bytes.length; at += n) {
      n = 1 + random(k === 0 ? bytes.length : 300);
      parser.push(bytes.subarray(at, at + n));
    }
    parser.end();
    said.split(/(?<=\n)/).forEach((line, i) => equal(ours[i], line, `stream ${k}, line ${i}`));
    equal(ours.join(''), said, `stream ${k}`);
  }
});

let seed = 1;
function random(n) { // Numerical Recipes' generator, its upper bits
  seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0;
  return Math.floor((seed / 2 ** 32) * n);
}

// Payload and header get good checksums again.
function signed(frame) {
  const view = new DataView(frame.buffer, frame.byteOffset, frame.length);
  view.setUint32(12, crc32c(view, 28, frame.length), true);
  view.setUint32(24, crc32c(view, 0, 24), true);
  return frame;
}

test('1,000 mutations, half of them with good checksums: nothing is thrown', () => {
  let refused = 0;
  const decoder = new Decoder({refused: () => refused++});
  for (let i = 0; i < 1000; i++) {
    const frames = samples.map(({bytes}) => Buffer.from(bytes));
    for (let k = 0; k < 1 + random(4); k++) {
      const frame = frames[random(13)], at = i % 2 ? 28 + random(frame.length - 28) : random(frame.length);
      frame[at] = random(3) ? random(256) : 255;
      if (i % 2) signed(frame);
    }
    const parser = new Parser({frame: (f) => decoder.take(f)}), all = Buffer.concat(frames);
    for (let at = 0; at < all.length;) at += parser.push(all.subarray(at, at + 1 + i)) ?? 1 + i;
    parser.end();
    decoder.flush(i % 3 === 0);
    if (i % 2) equal(parser.stats.frames, samples.length, `frames of mutation ${i}`);
  }
  if (refused < 50) throw new Error(`only ${refused} frames were refused`);
});

test('payloads shorter than their tables, and longer', () => {
  for (const {bytes} of samples) {
    const resized = (n) => {
      const frame = Buffer.concat([bytes.subarray(0, Math.min(28 + n, bytes.length)), Buffer.alloc(Math.max(0, 28 + n - bytes.length))]);
      frame.writeUInt32LE(n, 4);
      return signed(frame);
    };
    const longer = readAll([stream, resized(bytes.length - 28 + 9)]);
    equal(longer.refused.length, 0, `type ${bytes[1]}, longer`);
    for (const n of [0, 7]) equal(readAll([resized(n)]).refused.length, 1, `type ${bytes[1]} of ${n} bytes`);
  }
});

test('points before their anchor are counted and not placed', () => {
  const {decoder, batches} = readAll([Buffer.concat(samples.filter((_, i) => i !== 2).map(({bytes}) => bytes))]);
  equal(batches.length, 0, 'batches');
  equal(decoder.stats.unplaced_shots, 3, 'unplaced');
});

test('points without a pose are not placed, and are not counted as shots without echo', () => {
  const [descriptor, anchor, points] = [1, 2, 3].map((type) => Buffer.from(samples.find(({bytes}) => bytes[1] === type).bytes));
  const still = readAll([Buffer.concat([descriptor, anchor, points])]).decoder.stats;
  anchor[28 + 12] = 1; // moving
  const moving = readAll([Buffer.concat([descriptor, signed(anchor), points])]).decoder.stats;
  equal(moving.empty, still.empty, 'shots without echo');
  equal(moving.unplaced_points, moving.points - still.empty, 'unplaced');
  equal(moving.unplaced_shots, 2, 'pulses of these');
});

test('another sequence: its points have no place before its own descriptor and anchor', () => {
  const at = (type) => samples.findIndex(({bytes}) => bytes[1] === type);
  const renumbered = ({bytes}, seq, pulses) => {
    const frame = Buffer.from(bytes);
    frame.writeUInt32LE(seq >>> 0, 8);
    if (pulses) frame.writeBigInt64LE(frame.readBigInt64LE(28 + 8) + pulses, 28 + 8);
    return signed(frame);
  };
  const [d, a, p] = [1, 2, 3].map((type) => samples[at(type)]), front = [d, a, p].map((s, i) => renumbered(s, 1000 + i));
  const gone = readAll([...front, renumbered(p, 2000, 1000n)]).decoder.stats;
  equal(gone.unplaced_shots, 0, 'after a gap');
  const first = readAll([...front, renumbered(p, 7, 1000n)]);
  equal(first.stats.jumps_back, 1, 'restarts');
  equal(first.decoder.stats.unplaced_shots, 3, 'after a restart');
  const whole = readAll([...front, ...[d, a].map((s, i) => renumbered(s, 7 + i)), renumbered(p, 9, 1000n)]);
  equal(whole.decoder.stats.unplaced_shots, 0, 'after its anchor');
  const repeated = Object.assign(Buffer.from(d.bytes), {3: REPEAT}); // the descriptor alone says the same scan
  const again = readAll([...front, renumbered({bytes: repeated}, 7), renumbered(p, 8, 1000n)]);
  equal(again.decoder.stats.unplaced_shots, 3, 'after a repeated descriptor without its anchor');
  // A descriptor for this reader alone has named the scan of the next sequence: its pulses and start are other ones.
  const told = signed(Object.assign(Buffer.from(d.bytes), {3: REPEAT | LOCAL}));
  const start = renumbered(samples[at(6)], 7);
  start.writeUInt32LE(2, 28);
  start.writeBigUInt64LE(BigInt(d.bytes.readUInt32LE(28 + 260)), 28 + 8);
  start.writeBigInt64LE(77n, 28 + 16);
  for (const pieces of [[renumbered(p, 7, -1n)], [signed(start), renumbered(p, 8, 1000n)]]) {
    equal(readAll([...front, told, ...pieces]).decoder.stats.unplaced_shots, 0, 'of a scan that was told to this reader alone');
  }
});

test('a SCAN_START of the same number: points have no place before the new anchor, if the scan has another start', () => {
  const [d, a, p] = [1, 2, 3].map((type) => Buffer.from(samples.find(({bytes}) => bytes[1] === type).bytes));
  const event = Buffer.from(samples.find(({bytes}) => bytes[1] === 6).bytes), begin_ns = p.readBigInt64LE(16) - p.readBigInt64LE(28 + 16);
  event.writeUInt32LE(2, 28);
  event.writeBigUInt64LE(BigInt(d.readUInt32LE(28 + 260)), 28 + 8);
  for (const [later_ns, unplaced] of [[0n, 0], [1n, 3], [-1n, 3]]) {
    event.writeBigInt64LE(begin_ns + later_ns, 28 + 16);
    const frames = [d, a, p, event, p].map((frame, seq) => {
      const copy = Buffer.from(frame);
      copy.writeUInt32LE(seq, 8);
      return signed(copy);
    });
    equal(readAll(frames).decoder.stats.unplaced_shots, unplaced, `a start ${later_ns} ns later`);
  }
});

// ---- recordings beside the client in Python

// Tolerances are relative to the length of the place. Polar has the same operations, but sine and cosine of another
// library. On the Earth, places of some metres have the rounding of 6e6 m and the series' 0.1 um.
const TOLERANCES = {polar: 1e-13, moving: 1e-13, beams: 1e-13, ecef: 1e-8, utm: 1e-8, geodetic: 1e-8};
const folder = process.argv[2];
for (const name of Object.keys(TOLERANCES)) {
  test(`the recording ${name} as in Python`, () => {
    const {decoder, batches, stats, refused} = readAll([fs.readFileSync(`${folder}/${name}.shs`)]);
    const raw = fs.readFileSync(`${folder}/${name}.points`), said = fs.readFileSync(`${folder}/${name}.said`, 'utf8').trim().split(' ');
    const rows = new Float64Array(raw.buffer, raw.byteOffset, raw.length / 8);
    equal(`${stats.bad_bytes} ${stats.lost_frames} ${refused.length}`, '0 0 0', 'the stream');
    equal(`${decoder.pointHash}`, said[0], 'hash');
    equal(decoder.stats.shots, Number(said[1]), 'shots');
    equal(batches.reduce((sum, b) => sum + b.shots, 0), decoder.stats.shots, 'shots of batches');
    let at = 0;
    for (const b of batches) {
      for (let i = 0; i < b.n; i++, at += 11) {
        const size = Math.max(1, Math.hypot(rows[at], rows[at + 1], rows[at + 2]));
        ['x', 'y', 'z'].forEach((axis, k) => near(b[axis][i], rows[at + k], TOLERANCES[name] * size, `${name} ${axis}`));
        ['t', 'range', 'reflectance', 'amplitude'].forEach((key, k) =>
          near(b[key][i], Math.fround(rows[at + 3 + k]), 1e-6 * Math.abs(rows[at + 3 + k]), `${name} ${key}`)); // Float32
        ['label', 'echo', 'echoes', 'pulse'].forEach((key, k) => equal(b[key][i], rows[at + 7 + k], `${name} ${key}`));
      }
    }
    equal(at, rows.length, 'points');
    if (at < 11 * 400) throw new Error(`only ${at / 11} points`);
  });
}

await runTests();
