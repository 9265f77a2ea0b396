/* SPDX-License-Identifier: MIT */
// Reads a recording from the link: clouds in columns, meshes with sorted triangles. The module is pure except for
// fetch.

import {fetchOrThrow} from './page.js';

const KINDS = {1: Uint8Array, 2: Uint16Array, 3: Uint32Array, 4: Float32Array};
const POINTS_AT_A_TIME = 200000, TRIANGLES_AT_A_TIME = 1 << 20;

const fetchBytes = async (path, signal) => (await fetchOrThrow(path, {signal})).arrayBuffer();

// Reads the bytes of /cloud or /sparse: {n, first, every, total, origin, columns: {name: typed array}}
function readCloud(bytes) {
  const view = new DataView(bytes), u32 = (at) => view.getUint32(at, true);
  if (bytes.byteLength < 56 || u32(0) !== 0x4c434853 || u32(4) !== 1) throw new Error('not a cloud of version 1');
  const cloud = {n: u32(8), first: u32(16), every: u32(20), total: u32(24),
    origin: [32, 40, 48].map((at) => view.getFloat64(at, true)), columns: {}};
  for (let i = 0, at = 56; i < u32(12); i++, at += 32) {
    const name = String.fromCharCode(...new Uint8Array(bytes, at, 20)).replace(/\0.*$/s, '');
    const Kind = KINDS[u32(at + 20)];
    if (Kind) cloud.columns[name] = new Kind(bytes, u32(at + 28), cloud.n * u32(at + 24));
  }
  return cloud;
}

// Reads the bytes of /mesh: {n, first, total, first_point, n_points, mean_edge_m, triangles, ratio}
export function readMesh(bytes) {
  const view = new DataView(bytes), u32 = (at) => view.getUint32(at, true);
  if (bytes.byteLength < 40 || u32(0) !== 0x534d4853 || u32(4) !== 1) throw new Error('not a mesh of version 1');
  const n = u32(8);
  return {n, first: u32(12), total: u32(16), first_point: u32(20), n_points: u32(24), mean_edge_m: view.getFloat64(32, true),
    triangles: new Uint32Array(bytes, 40, 3 * n), ratio: new Float32Array(bytes, 40 + 12 * n, n)};
}

// Reads all pieces of a cloud, one after the other, and calls take(piece) for each. path is '/cloud?...' without first
// and count.
export async function fetchCloud(path, {first = 0, end = Infinity, every = 1, signal, take}) {
  for (let at = first, total = end; at < Math.min(end, total);) {
    const count = Math.min(POINTS_AT_A_TIME, Math.ceil((Math.min(end, total) - at) / every));
    const piece = readCloud(await fetchBytes(`${path}first=${at}&count=${count}`, signal));
    total = piece.total;
    if (piece.n === 0) return;
    take(piece);
    at += piece.n * every;
  }
}

// Reads a complete mesh: {triangles, ratio, ...} as readMesh returns it.
export async function fetchMesh(scan, signal, progress = () => {}) {
  let mesh = null;
  for (let at = 0; mesh === null || at < mesh.total;) {
    const piece = readMesh(await fetchBytes(`/mesh?scan=${scan}&first=${at}&count=${TRIANGLES_AT_A_TIME}`, signal));
    mesh ??= {...piece, triangles: new Uint32Array(3 * piece.total), ratio: new Float32Array(piece.total)};
    mesh.triangles.set(piece.triangles, 3 * at);
    mesh.ratio.set(piece.ratio, at);
    at += piece.n;
    progress(at, mesh.total);
    if (piece.n === 0) break;
  }
  return mesh;
}

// Returns how many of the sorted ratios are at most the factor; factor 0 means all.
export function countWithin(ratio, factor) {
  if (factor === 0) return ratio.length;
  const most = Math.fround(factor);
  let lo = 0, hi = ratio.length;
  while (lo < hi) {
    const middle = (lo + hi) >> 1;
    if (ratio[middle] <= most) lo = middle + 1;
    else hi = middle;
  }
  return lo;
}

const filled = (Kind, n, value) => new Kind(n).fill(value);

// Returns a piece as batches for the Cloud: one for each run of points of one station. Where the piece has no stations,
// all points have the given one, or none (undefined). Pulses are not known; the number of the point in the file is used
// instead.
export function batchesOf(piece, station) {
  const {n, origin, columns: c} = piece;
  const axis = (k) => Float64Array.from({length: n}, (_, i) => c.xyz[3 * i + k] + origin[k]);
  const all = {
    x: axis(0), y: axis(1), z: axis(2),
    t: c.t ?? filled(Float32Array, n, NaN), range: c.range ?? filled(Float32Array, n, NaN),
    reflectance: c.reflectance ?? filled(Float32Array, n, NaN), amplitude: c.amplitude ?? filled(Float32Array, n, NaN),
    label: c.label ?? filled(Uint16Array, n, 0xffff), echo: c.echo ?? new Uint8Array(n), echoes: c.echoes ?? new Uint8Array(n),
    pulse: Float64Array.from({length: n}, (_, i) => piece.first + i * piece.every),
  };
  const batches = [];
  for (let from = 0, to; from < n; from = to) {
    const of = c.station ? c.station[from] : station;
    for (to = from + 1; to < n && (!c.station || c.station[to] === of);) to++;
    const part = Object.fromEntries(Object.entries(all).map(([key, values]) => [key, values.subarray(from, to)]));
    batches.push({n: to - from, shots: to - from, scan: 1, frame: 0, line: 0, station: of, pulse0: piece.first + from,
      rgb: c.rgb ? c.rgb.subarray(3 * from, 3 * to) : null, ...part});
  }
  return batches;
}
