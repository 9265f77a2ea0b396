/* SPDX-License-Identifier: MIT */
// The records of a points frame become columns in the scene frame. The module is the hot path: it makes no BigInt for a
// point, and objects for a point only with geodetic coordinates.
import {fitCubic, geodeticToEcef, geoidHeight, toScene} from './native_earth.js';

const TWO_PI = 6.283185307179586476925, PARTS = 256, HEAD = 40, RECORD = 20, NO_REFLECTANCE = -32768;
const sinPart = Float64Array.from({length: PARTS}, (_, i) => Math.sin((TWO_PI * i) / PARTS));
const cosPart = Float64Array.from({length: PARTS}, (_, i) => Math.cos((TWO_PI * i) / PARTS));

const NAMES = ['x', 'y', 'z', 'pulse', 't', 'range', 'reflectance', 'amplitude', 'label', 'echo', 'echoes', 'record'];

/** This is room for the points of some frames. */
export class Columns {
  constructor(room) {
    this.room = room;
    this.n = 0;
    for (const name of ['x', 'y', 'z', 'pulse']) this[name] = new Float64Array(room);
    for (const name of ['t', 'range', 'reflectance', 'amplitude']) this[name] = new Float32Array(room);
    this.label = new Uint16Array(room);
    this.echo = new Uint8Array(room);
    this.echoes = new Uint8Array(room);
    this.record = new Uint16Array(room); // each is the record of a point in its frame
    this.rgb = new Uint8Array(3 * room);
  }

  /** Returns the points from..to in their own arrays, which share one buffer. */
  copy(from, to, hasColours) {
    const n = to - from, buffer = new ArrayBuffer(n * (hasColours ? 55 : 52)), out = {};
    let at = 0;
    const part = (name, Type, each = 1) => {
      out[name] = new Type(buffer, at, n * each);
      out[name].set(this[name].subarray(from * each, to * each));
      at += out[name].byteLength;
    };
    for (const name of ['x', 'y', 'z', 'pulse']) part(name, Float64Array);
    for (const name of ['t', 'range', 'reflectance', 'amplitude']) part(name, Float32Array);
    part('label', Uint16Array);
    part('echo', Uint8Array);
    part('echoes', Uint8Array);
    out.rgb = null;
    if (hasColours) part('rgb', Uint8Array, 3);
    return out;
  }

  // Moves points from..this.n to `to`.
  #move(to, from) {
    for (const name of NAMES) this[name].copyWithin(to, from, this.n);
    this.rgb.copyWithin(3 * to, 3 * from, 3 * this.n);
    this.n -= from - to;
  }

  /** Moves points from `from` on to the front. */
  drop(from) {
    this.#move(0, from);
  }

  /** Removes points from `from` on that have no place. */
  dropNaN(from) {
    for (let i = this.n - 1; i >= from; i--) if (Number.isNaN(this.x[i])) this.#move(i, i + 1);
  }
}

// Sets the columns that both layouts share, from record i at `at` to point number `to`.
function common(c, to, i, view, at, pulse, t0_ns, tail) {
  const reflectance = view.getInt16(at + 12, true);
  c.reflectance[to] = reflectance === NO_REFLECTANCE ? NaN : reflectance / 100;
  c.label[to] = view.getUint16(at + 14, true);
  c.t[to] = (t0_ns + (tail & 0xffffff)) * 1e-9;
  c.echo[to] = (tail >>> 24) & 15;
  c.echoes[to] = tail >>> 28;
  c.pulse[to] = pulse;
  c.record[to] = i;
}

/** Makes the function that places the points of a polar stream, from its descriptor and anchor. */
export function polarPlacer(descriptor, anchor) {
  const m = Float64Array.from(anchor.rotation), [x0, y0, z0] = anchor.station_m, scale = descriptor.range_scale_m;
  const lineTurn = 1 / descriptor.mirror_counts_per_turn, panTurn = 1 / descriptor.pan_counts_per_turn;
  const turned = !(anchor.moving & 1);
  // The sine and the cosine of an angle come from the table for whole 1/256 turns, and from a series for the rest. The
  // next terms of the series are below 2^-56. The operations and their order are those of libscanhead
  // (drivers/host/decode_points.c).
  return (c, view, n, pulse0, t0_ns) => {
    const {x, y, z, range} = c;
    let to = c.n, pulse = pulse0 - 1, atStart = true;
    for (let i = 0, at = HEAD; i < n; i++, at += RECORD) {
      const tail = view.getUint32(at + 16, true);
      if (atStart || ((tail >>> 24) & 15) < 2) pulse++;
      atStart = false;
      if (tail >>> 28 === 0) continue;
      const lp = view.getUint32(at + 4, true) * lineTurn * PARTS, lk = Math.floor(lp + 0.5);
      const pp = view.getUint32(at + 8, true) * panTurn * PARTS, pk = Math.floor(pp + 0.5);
      const lr = (lp - lk) * (TWO_PI / PARTS), l2 = lr * lr, pr = (pp - pk) * (TWO_PI / PARTS), p2 = pr * pr;
      const ls = lr + lr * l2 * (-1 / 6 + l2 * (1 / 120)), lc = l2 * (-0.5 + l2 * (1 / 24 - l2 * (1 / 720)));
      const ps = pr + pr * p2 * (-1 / 6 + p2 * (1 / 120)), pc = p2 * (-0.5 + p2 * (1 / 24 - p2 * (1 / 720)));
      const lsk = sinPart[lk & 255], lck = cosPart[lk & 255], psk = sinPart[pk & 255], pck = cosPart[pk & 255];
      const r = scale * view.getUint32(at, true), flat = r * (lck + (lck * lc - lsk * ls));
      const dx = flat * (psk + (pck * ps + psk * pc)), dy = flat * (pck + (pck * pc - psk * ps));
      const dz = r * (lsk + (lck * ls + lsk * lc));
      range[to] = r;
      if (turned) {
        x[to] = x0 + (m[0] * dx + m[1] * dy + m[2] * dz);
        y[to] = y0 + (m[3] * dx + m[4] * dy + m[5] * dz);
        z[to] = z0 + (m[6] * dx + m[7] * dy + m[8] * dz);
      } else {
        x[to] = dx; // it is in the head's frame: poses move it to the scene
        y[to] = dy;
        z[to] = dz;
      }
      common(c, to, i, view, at, pulse, t0_ns, tail);
      to++;
    }
    c.n = to;
  };
}

/** Does the same for a geo stream. The range is the distance from the anchor, in the CRS or, if that is geodetic,
 * straight through space. The range is NaN where the head moves, since the anchor is not the head's place. */
export function geoPlacer(descriptor, anchor) {
  const {at: exactAt, isFlat} = toScene(anchor), [sx, sy, sz] = anchor.scale, isGeodetic = anchor.crs === 3;
  let place = isFlat ? placeFlat(exactAt, anchor) : isGeodetic ? placeExactly(exactAt) : null;
  place ??= placeByCubic(exactAt, anchor, descriptor);
  const [ax, ay, az] = anchor.anchor, moves = anchor.moving & 1, az_m = az + geoidHeight(anchor);
  const home = isGeodetic ? geodeticToEcef(ax, ay, az_m) : null;
  const rangeOf = (dx, dy, dz) => {
    if (moves) return NaN;
    if (!isGeodetic) return Math.sqrt(dx * dx + dy * dy + dz * dz);
    const e = geodeticToEcef(ax + dx, ay + dy, az_m + dz);
    return Math.sqrt((e[0] - home[0]) ** 2 + (e[1] - home[1]) ** 2 + (e[2] - home[2]) ** 2);
  };
  return (c, view, n, pulse0, t0_ns) => {
    let to = c.n, pulse = pulse0 - 1, atStart = true;
    for (let i = 0, at = HEAD; i < n; i++, at += RECORD) {
      const tail = view.getUint32(at + 16, true);
      if (atStart || ((tail >>> 24) & 15) < 2) pulse++;
      atStart = false;
      if (tail >>> 28 === 0) continue;
      const dx = sx * view.getInt32(at, true), dy = sy * view.getInt32(at + 4, true);
      const dz = sz * view.getInt32(at + 8, true);
      place(c, to, ax, ay, az, dx, dy, dz);
      c.range[to] = rangeOf(dx, dy, dz);
      common(c, to, i, view, at, pulse, t0_ns, tail);
      to++;
    }
    c.n = to;
  };
}

// Local coordinates need a rotation and a shift. So do ECEF coordinates where the scene frame is no grid.
function placeFlat(exactAt, anchor) {
  const [ox, oy, oz] = exactAt(anchor.anchor), m = anchor.axes;
  return (c, to, _x, _y, _z, dx, dy, dz) => {
    c.x[to] = ox + (m[0] * dx + m[3] * dy + m[6] * dz);
    c.y[to] = oy + (m[1] * dx + m[4] * dy + m[7] * dz);
    c.z[to] = oz + (m[2] * dx + m[5] * dy + m[8] * dz);
  };
}

function placeExactly(exactAt) {
  return (c, to, ax, ay, az, dx, dy, dz) => {
    [c.x[to], c.y[to], c.z[to]] = exactAt([ax + dx, ay + dy, az + dz]);
  };
}

// For coordinates of a projection, such as UTM, a polynomial of order 3 takes the place of the exact formula within the
// head's reach d. The polynomial's error is about d^4 / R^3 with the Earth's radius R: 0.1 um at 2 km.
function placeByCubic(exactAt, anchor, descriptor) {
  const reach_m = Math.min(Math.max(1.1 * descriptor.range_max_m, 10), 20000), [ax, ay, az] = anchor.anchor;
  const k = fitCubic((u, v, w) => exactAt([ax + reach_m * u, ay + reach_m * v, az + reach_m * w]));
  const sum = (at, u, v, w) =>
    k[at] + w * (k[at + 1] + w * (k[at + 2] + w * k[at + 3])) + v * (k[at + 4] + w * (k[at + 5] + w * k[at + 6]) +
    v * (k[at + 7] + w * k[at + 8] + v * k[at + 9])) + u * (k[at + 10] + w * (k[at + 11] + w * k[at + 12]) +
    v * (k[at + 13] + w * k[at + 14] + v * k[at + 15]) +
    u * (k[at + 16] + w * k[at + 17] + v * k[at + 18] + u * k[at + 19]));
  return (c, to, _x, _y, _z, dx, dy, dz) => {
    const u = dx / reach_m, v = dy / reach_m, w = dz / reach_m;
    c.x[to] = sum(0, u, v, w);
    c.y[to] = sum(20, u, v, w);
    c.z[to] = sum(40, u, v, w);
  };
}

/** This is the hash of points (README.md): it has two sums over all records, modulo 2^32, of mixed words. */
export class PointHash {
  constructor() {
    this.a = 0;
    this.b = 0;
  }

  add(view, n, low, high) {
    let {a, b} = this, begun = false;
    for (let i = 0, at = HEAD; i < n; i++, at += RECORD) {
      const tail = view.getUint32(at + 16, true);
      if (begun && ((tail >>> 24) & 15) < 2) {
        low = (low + 1) | 0;
        if (low === 0) high = (high + 1) | 0;
      }
      begun = true;
      const w0 = view.getInt32(at, true), w1 = view.getInt32(at + 4, true), w2 = view.getInt32(at + 8, true);
      const w3 = view.getInt32(at + 12, true);
      a = (a + mix(0, 0x85ebca6b, low, high, w0, w1, w2, w3, tail)) | 0;
      b = (b + mix(0x9e3779b9, 0xcc9e2d51, low, high, w0, w1, w2, w3, tail)) | 0;
    }
    this.a = a;
    this.b = b;
  }

  toString() {
    return [this.b, this.a].map((v) => (v >>> 0).toString(16).padStart(8, '0')).join('');
  }
}

function mix(h, k, p, q, w0, w1, w2, w3, w4) {
  h = Math.imul(h ^ p, k);
  h = Math.imul(h ^ (h >>> 13) ^ q, k);
  h = Math.imul(h ^ (h >>> 13) ^ w0, k);
  h = Math.imul(h ^ (h >>> 13) ^ w1, k);
  h = Math.imul(h ^ (h >>> 13) ^ w2, k);
  h = Math.imul(h ^ (h >>> 13) ^ w3, k);
  h = Math.imul(h ^ (h >>> 13) ^ w4, k);
  return Math.imul(h ^ (h >>> 16), 0xc2b2ae35);
}
