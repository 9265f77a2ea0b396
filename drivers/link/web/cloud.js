/* SPDX-License-Identifier: MIT */
// The cloud stores points in blocks of typed arrays: the newest `capacity` points and less than a block more. The
// oldest blocks are dropped.
//
// Positions are Float32, relative to `origin` (Float64, scene frame), which is the place of the first point. So a
// cloud at UTM coordinates keeps 0.03 mm within 500 m of that place, where Float32 of the coordinates themselves would
// have 0.5 m.
//
// In a closed block the first k points are spread evenly over the block, for any k: one point at random from each k-th
// part of it. So a level of detail is a prefix of each block. Every k-th point would not do, since k may be the length
// of a line. The block that is still filled has the points in the order in which they came.

export const BLOCK = 65536;

// This is nested scrambling (Owen 1995) of the numbers below 2^16 with their bits reversed. At each level a random bit
// decides which half comes first.
let evenly = null;
export function evenOrder(n) {
  if (evenly === null) {
    evenly = new Uint16Array(BLOCK);
    for (let i = 0; i < BLOCK; i++) {
      let out = 0;
      let prefix = 1; // it has the bits decided so far, under a leading one
      for (let bit = 0; bit < 16; bit++) {
        const taken = ((i >> bit) & 1) ^ (mix(prefix) & 1);
        out = (out << 1) | taken;
        prefix = (prefix << 1) | taken;
      }
      evenly[i] = out;
    }
  }
  return n === BLOCK ? evenly : evenly.filter((i) => i < n);
}

// Returns the numbers of up to `most` points of a block, spread evenly over it, also while the block is filled.
export function spreadOver({n, closed}, most) {
  if (closed || n <= most) return Array.from({length: Math.min(n, most)}, (_, i) => i);
  const order = evenOrder(BLOCK), out = [];
  for (let k = 0; out.length < most; k++) if (order[k] < n) out.push(order[k]);
  return out;
}

// This is the finalizer of MurmurHash3 (Appleby, public domain).
export function mix(h) {
  h = Math.imul(h ^ (h >>> 16), 0x85ebca6b);
  h = Math.imul(h ^ (h >>> 13), 0xc2b2ae35);
  return (h ^ (h >>> 16)) >>> 8;
}

const MODELLED = ['reflectance', 'amplitude']; // a block whose values are all NaN, not modelled, has no array
const ARRAYS = ['position', 't', 'range', 'label', 'echo', 'pulse', ...MODELLED, 'rgb'];

class Block {
  n = 0;
  closed = false;
  order = null; // in a closed block it gives the arrival number of the point at each place
  lo = [Infinity, Infinity, Infinity]; // it is relative to the origin
  hi = [-Infinity, -Infinity, -Infinity];
  position = new Float32Array(3 * BLOCK);
  t = new Float32Array(BLOCK);
  range = new Float32Array(BLOCK);
  label = new Uint16Array(BLOCK);
  echo = new Uint8Array(BLOCK); // it is the echo's number plus 16 times the pulse's number of echoes
  pulse = new Uint32Array(BLOCK); // it counts from pulse0 on
  reflectance = null;
  amplitude = null;
  rgb = null; // each point has three values

  #span = {n: 0, from: Infinity, to: -Infinity};

  constructor(first, batch, from, began_s) {
    this.first = first; // this is the number of its first point since the cloud was cleared
    this.began_s = began_s; // its scan's start; times of points count from there
    this.scan = batch.scan;
    this.station = batch.station;
    this.pulse0 = batch.pulse[from];
  }

  takes(batch, from) {
    const pulses = batch.pulse[from] - this.pulse0;
    return !this.closed && batch.scan === this.scan && batch.station === this.station && pulses >= 0 &&
      batch.pulse[batch.n - 1] - this.pulse0 < 2 ** 32;
  }

  // Returns how many points of the batch the block took, from `from` on.
  append(batch, from, origin) {
    const k = Math.min(batch.n - from, BLOCK - this.n);
    const {lo, hi, position, pulse, echo, pulse0} = this;
    const {x, y, z} = batch;
    let at = 3 * this.n;
    for (let i = from; i < from + k; i++, at += 3) {
      const px = x[i] - origin[0], py = y[i] - origin[1], pz = z[i] - origin[2];
      position[at] = px;
      position[at + 1] = py;
      position[at + 2] = pz;
      if (px < lo[0]) lo[0] = px;
      if (px > hi[0]) hi[0] = px;
      if (py < lo[1]) lo[1] = py;
      if (py > hi[1]) hi[1] = py;
      if (pz < lo[2]) lo[2] = pz;
      if (pz > hi[2]) hi[2] = pz;
    }
    for (let i = 0, to = this.n; i < k; i++, to++) {
      pulse[to] = batch.pulse[from + i] - pulse0;
      echo[to] = batch.echo[from + i] | (batch.echoes[from + i] << 4);
    }
    const part = (array, size = 1) => array.subarray(size * from, size * (from + k));
    this.t.set(part(batch.t), this.n);
    this.range.set(part(batch.range), this.n);
    this.label.set(part(batch.label), this.n);
    for (const name of MODELLED) {
      const values = batch[name];
      if (this[name] === null && values && part(values).some((v) => v === v)) this[name] = new Float32Array(BLOCK).fill(NaN);
      if (this[name] !== null && values) this[name].set(part(values), this.n);
    }
    if (this.rgb === null && batch.rgb) this.rgb = new Uint8Array(3 * BLOCK);
    if (this.rgb !== null && batch.rgb) this.rgb.set(part(batch.rgb, 3), 3 * this.n);
    this.n += k;
    return k;
  }

  // No more points come, so the block gets the even order, and only the memory that it needs.
  close() {
    const order = evenOrder(this.n);
    this.closed = true;
    this.order = order;
    for (const name of ARRAYS) {
      const from = this[name];
      if (from === null) continue;
      const size = from.length / BLOCK;
      const to = new from.constructor(size * this.n);
      if (size === 1) for (let i = 0; i < order.length; i++) to[i] = from[order[i]];
      else {
        for (let i = 0, at = 0; i < order.length; i++, at += 3) {
          const k = 3 * order[i];
          to[at] = from[k];
          to[at + 1] = from[k + 1];
          to[at + 2] = from[k + 2];
        }
      }
      this[name] = to;
    }
  }

  // Returns the first and the last time of the block's points, which are looked for only when somebody asks.
  get span() {
    const {n, t} = this, s = this.#span;
    for (; s.n < n; s.n++) {
      if (t[s.n] < s.from) s.from = t[s.n];
      if (t[s.n] > s.to) s.to = t[s.n];
    }
    return s;
  }

  bytes() { return ARRAYS.reduce((sum, name) => sum + (this[name]?.byteLength ?? 0), 0); }
}

export class Cloud {
  total = 0; // so many points came since it was cleared
  gone = 0; // so many of them are no longer stored
  replaced = 0; // so often points were dropped because a newer scan of their station came
  origin = null;
  blocks = [];
  changed = null; // it is called after each change
  window = null; // {from, to}: views and tools show and find only points of these times; times are as `latest_s`
  latest_s = -Infinity; // the time of the point that came last: device time, or that of a recording
  #scans = new Map(); // it has the newest scan of each station
  #outdated = 0; // the points before this one come from another run of the head

  constructor({capacity = 10_000_000} = {}) {
    if (!(capacity >= 1)) throw new RangeError(`a cloud of ${capacity} points: at least 1`);
    this.capacity = capacity;
  }

  get count() { return this.total - this.gone; }
  get bytes() { return this.blocks.reduce((sum, block) => sum + block.bytes(), 0); }

  add(batch) {
    if (batch.n === 0) return;
    this.origin ??= Float64Array.of(batch.x[0], batch.y[0], batch.z[0]).map((v) => (Number.isFinite(v) ? v : 0));
    for (let from = 0; from < batch.n;) {
      let block = this.blocks.at(-1);
      if (!block?.takes(batch, from)) {
        if (block && !block.closed) block.close();
        block = new Block(this.total, batch, from, this.#began(batch));
        this.blocks.push(block);
      }
      const k = block.append(batch, from, this.origin);
      from += k;
      this.total += k;
      if (block.n === BLOCK) block.close();
    }
    if (!batch.past && batch.t[batch.n - 1] >= 0) this.latest_s = this.blocks.at(-1).began_s + batch.t[batch.n - 1];
    this.#dropOldest();
    this.changed?.();
  }

  // All blocks of a scan have one start, so that differences between times of its points stay right.
  #began({scan, station, began_s = 0}) {
    return this.blocks.findLast((block) => block.scan === scan && block.station === station)?.began_s ?? began_s;
  }

  // Drops whole blocks, as long as the rest has at least the capacity.
  #dropOldest() {
    let n = 0;
    let over = this.count - this.capacity;
    while (over > 0 && this.blocks[n].n <= over) over -= this.blocks[n++].n;
    this.#countGone(this.blocks.splice(0, n));
  }

  #countGone(blocks) {
    for (const block of blocks) this.gone += block.n;
  }

  /** A scan replaces the earlier scans of its station, which may be from another place. Call replace() before add().
   * replace() returns false for a batch of such an older scan, which comes late (`past`). */
  replace({station, scan, past = false}) {
    const now = this.#scans.get(station);
    if (past && now !== undefined && scan < now) return false;
    if (now === scan) return true;
    this.#scans.set(station, scan);
    this.#drop((block) => block.station === station && (block.scan !== scan || block.first < this.#outdated));
    return true;
  }

  /** Closes the last block, and returns how many points came so far. */
  cut() {
    const last = this.blocks.at(-1);
    if (last && !last.closed) last.close();
    return this.total;
  }

  /** The first `total` points come from an earlier run of the head. The present run counts its scans from 1 again. So
   * the next scan of a station replaces its earlier points, whatever the scan's number is. */
  outdate(total) {
    this.#outdated = total;
    this.#scans.clear();
  }

  #drop(isOut) {
    const out = this.blocks.filter(isOut);
    if (out.length === 0) return;
    this.blocks = this.blocks.filter((block) => !isOut(block));
    this.#countGone(out);
    this.replaced++;
    if (this.blocks.length === 0) this.clear();
    else this.changed?.();
  }

  clear() {
    this.blocks = [];
    this.#outdated = 0;
    this.total = this.gone = 0;
    this.latest_s = -Infinity;
    this.origin = null;
    this.changed?.();
  }

  // Returns {min, max} of the stored points in the scene frame; null without points.
  get bounds() {
    const lo = [Infinity, Infinity, Infinity], hi = [-Infinity, -Infinity, -Infinity];
    for (const block of this.blocks) {
      for (let a = 0; a < 3; a++) {
        lo[a] = Math.min(lo[a], block.lo[a]);
        hi[a] = Math.max(hi[a], block.hi[a]);
      }
    }
    if (!(lo[0] <= hi[0])) return null;
    return {min: lo.map((v, a) => v + this.origin[a]), max: hi.map((v, a) => v + this.origin[a])};
  }
}

// Returns whether a block's times are all outside of a window of times. A block without times is within every window.
// The window null has all times in it.
export const isOutside = (window, block) => window !== null && block.span.from <= block.span.to &&
  (block.span.to < window.from - block.began_s || block.span.from > window.to - block.began_s);

export const isPointOutside = (window, block, i) => window !== null &&
  (block.t[i] < window.from - block.began_s || block.t[i] > window.to - block.began_s);

// Returns the point nearest to a place, up to reach_m away in each axis, as pointOf() does; null: there is none. The
// window of times does not matter.
export function nearestTo(cloud, place, reach_m) {
  if (cloud.origin === null) return null;
  const p = place.map((v, a) => v - cloud.origin[a]);
  let best = Infinity, found = null;
  for (const block of cloud.blocks) {
    if ([0, 1, 2].some((a) => block.lo[a] > p[a] + reach_m || block.hi[a] < p[a] - reach_m)) continue;
    for (let i = 0; i < block.n; i++) {
      const d = Math.max(...[0, 1, 2].map((a) => Math.abs(block.position[3 * i + a] - p[a])));
      if (d <= reach_m && d < best) [best, found] = [d, {block, i}];
    }
  }
  return found && pointOf(cloud, found.block, found.i);
}

// Returns all figures of point i of a block.
export function pointOf(cloud, block, i) {
  const at = (axis) => block.position[3 * i + axis] + cloud.origin[axis];
  return {
    x: at(0), y: at(1), z: at(2), range: block.range[i], t: block.t[i],
    reflectance: block.reflectance ? block.reflectance[i] : NaN,
    amplitude: block.amplitude ? block.amplitude[i] : NaN,
    label: block.label[i], echo: block.echo[i] & 15, echoes: block.echo[i] >> 4,
    pulse: block.pulse0 + block.pulse[i], scan: block.scan, station: block.station,
    rgb: block.rgb ? [...block.rgb.subarray(3 * i, 3 * i + 3)] : null,
  };
}
