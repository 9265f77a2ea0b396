/* SPDX-License-Identifier: MIT */
// This module asks a head what stations would see from other places, and reads its answers. The answers' formats stand
// in firmware_sim/app/studio/preview/README.md. Reading is pure.

import {fetchOrThrow} from './page.js';
import {isWithin} from './section.js';

const AGAIN_MS = 15, AGAIN_MOST_MS = 200; // an answer is asked for again, ever less often

// Returns the bytes of an answer, once the head has it. Throws an Error with the head's words, or once `signal` aborts.
export async function ask(path, signal) {
  for (let wait_ms = AGAIN_MS; ; wait_ms = Math.min(AGAIN_MOST_MS, 1.5 * wait_ms)) {
    const bytes = await (await fetchOrThrow(path, {cache: 'no-store', signal})).arrayBuffer();
    if (bytes.byteLength > 0) return bytes;
    await new Promise((done) => setTimeout(done, wait_ms));
  }
}

// Joins names and numbers to a path. Numbers that are null are left out; the head then uses its defaults.
export function pathOf(name, values) {
  const words = Object.entries(values).filter(([, value]) => value !== null && value !== undefined);
  return `/${name}?${words.map(([key, value]) => `${key}=${value}`).join('&')}`;
}

function begin(bytes, magic, least) {
  const view = new DataView(bytes);
  const has = bytes.byteLength >= least ? String.fromCharCode(...new Uint8Array(bytes, 0, 4)) : '';
  if (has !== magic) throw new Error(`an answer of ${bytes.byteLength} bytes that does not begin with ${magic}`);
  if (view.getUint32(4, true) !== 1) throw new Error(`${magic} of version ${view.getUint32(4, true)}: 1 is known`);
  return view;
}

const origin = (view, at) => [at, at + 8, at + 16].map((k) => view.getFloat64(k, true));

// Returns {number, cells, n, pulses, hits, front, origin, above_m, hides_m, feet_m, seen, xyz, range, label} of the
// bytes of /preview. seen has a bit for each cell, 32 in a word.
export function parsePreview(bytes) {
  const view = begin(bytes, 'SHPV', 72);
  const [number, cells, n, pulses, hits, front] = [8, 12, 16, 20, 24, 28].map((at) => view.getUint32(at, true));
  const words = 2 * Math.ceil(cells / 64), at = 72 + 4 * words;
  const need = at + 18 * n;
  if (bytes.byteLength !== need) throw new Error(`a preview of ${bytes.byteLength} bytes: ${need} expected`);
  return {number, cells, n, pulses, hits, front, origin: origin(view, 32), above_m: view.getFloat32(56, true),
    hides_m: view.getFloat32(60, true), feet_m: view.getFloat32(64, true), seen: new Uint32Array(bytes, 72, words),
    xyz: new Float32Array(bytes, at, 3 * n), range: new Float32Array(bytes, at + 12 * n, n),
    label: new Uint16Array(bytes, at + 16 * n, n)};
}

// Returns {n, pieces, origin, cell_m, area, cell, corners} of the bytes of /cells.
export function parseCells(bytes) {
  const view = begin(bytes, 'SHCE', 48);
  const n = view.getUint32(8, true), pieces = view.getUint32(12, true);
  const need = 48 + 4 * n + 52 * pieces;
  if (bytes.byteLength !== need) throw new Error(`cells of ${bytes.byteLength} bytes: ${need} expected`);
  const cell = new Uint32Array(bytes, 48 + 4 * n, pieces);
  if (cell.some((k) => k >= n)) throw new Error(`a piece beyond the ${n} cells`);
  return {n, pieces, origin: origin(view, 16), cell_m: view.getFloat64(40, true), area: new Float32Array(bytes, 48, n), cell,
    corners: new Float32Array(bytes, 48 + 4 * n + 4 * pieces, 12 * pieces)};
}

// Returns a bit for each cell that can be seen from anywhere, 32 in a word, of the bytes of /reach.
export function parseReach(bytes) {
  const words = 2 * Math.ceil(begin(bytes, 'SHRE', 16).getUint32(8, true) / 64);
  if (bytes.byteLength !== 16 + 4 * words) throw new Error(`reach of ${bytes.byteLength} bytes: ${16 + 4 * words} expected`);
  return new Uint32Array(bytes, 16, words);
}

// Returns the points of a preview as a batch of a cloud.
export function batchOf(preview, station, scan) {
  const {n, xyz} = preview;
  const axis = (a) => Float64Array.from({length: n}, (_, i) => xyz[3 * i + a] + preview.origin[a]);
  return {n, shots: preview.pulses, scan, frame: 0, line: 0, station, pulse0: 0, x: axis(0), y: axis(1), z: axis(2),
    t: new Float32Array(n).fill(NaN), range: preview.range, label: preview.label, reflectance: null, amplitude: null,
    echo: new Uint8Array(n).fill(1), echoes: new Uint8Array(n).fill(1), rgb: null,
    pulse: Float64Array.from({length: n}, (_, i) => i)};
}

export const hasBit = (bits, i) => ((bits[i >>> 5] >>> (i & 31)) & 1) === 1;

// Returns for each cell by how many of the stations it is seen, and the area seen by none, by one and by several.
// hidden_m2 is the part seen by none that can't be seen from anywhere. reach says which cells can be seen; null: this
// is not known.
export function countSeen(cells, seen, reach = null) {
  const counts = new Uint8Array(cells.n);
  for (const bits of seen) {
    for (let i = 0; i < cells.n; i++) counts[i] += (bits[i >>> 5] >>> (i & 31)) & 1;
  }
  const area = [0, 0, 0];
  let hidden_m2 = 0;
  for (let i = 0; i < cells.n; i++) {
    area[Math.min(2, counts[i])] += cells.area[i];
    if (reach !== null && counts[i] === 0 && !hasBit(reach, i)) hidden_m2 += cells.area[i];
  }
  return {counts, none_m2: area[0], one_m2: area[1], several_m2: area[2], hidden_m2};
}

// Returns the middle of each cell, which is the mean of its pieces' middles: x, y, z, x, y, z ..., relative to the
// cells' origin.
function middlesOf({n, pieces, cell, corners}) {
  const middles = new Float32Array(3 * n), parts = new Uint32Array(n);
  for (let i = 0; i < pieces; i++) {
    parts[cell[i]]++;
    for (let k = 0; k < 12; k++) middles[3 * cell[i] + k % 3] += corners[12 * i + k] / 4;
  }
  return middles.map((sum, k) => sum / parts[Math.floor(k / 3)]);
}

// Returns {seen_m2, all_m2} of the cells that have their middles in a section. Cells that can't be seen don't count.
export function seenWithin(cells, counts, reach, section) {
  cells.middles ??= middlesOf(cells);
  const box = section.relativeTo(cells.origin);
  let seen_m2 = 0, all_m2 = 0;
  for (let i = 0; i < cells.n; i++) {
    if (counts[i] === 0 && reach !== null && !hasBit(reach, i)) continue;
    if (!isWithin(box, cells.middles[3 * i], cells.middles[3 * i + 1], cells.middles[3 * i + 2])) continue;
    all_m2 += cells.area[i];
    if (counts[i] > 0) seen_m2 += cells.area[i];
  }
  return {seen_m2, all_m2};
}
