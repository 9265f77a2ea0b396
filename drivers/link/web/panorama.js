/* SPDX-License-Identifier: MIT */
// A panorama shows the points of one station as its head sees them. Azimuth goes from the head's forward direction to
// the right, elevation upward. Each pixel has its nearest point. The module is pure.

import {isOutside, isPointOutside, mix} from './cloud.js';
import {isWithin} from './section.js';
import {dot, sub} from './view_camera.js';
import {headAxes} from './view_stations.js';
import {GREY, NONE, robustLimits, tableOf, valuesOf} from './view_colours.js';

const TURN = 2 * Math.PI;
const PER_PIXEL = 2.5; // points, so that few pixels have none
const WIDEST = 1440;
const SAMPLED = 20_000; // pixels for the limits of the colours
const EMPTY = 0xffffffff;
const SHAPES = [1, 0.125, 0.25, 0.5, 2, 4, 8]; // of pixels: height over width
const TRIED = 500_000; // points for choosing one of them

// A station is {number, x_m, y_m, z_m, heading_deg, pitch_deg, roll_deg}. Points outside the cloud's window of times,
// or outside the section, are left out.
export class Panorama {
  width = 0;
  height = 0;
  n = 0; // points
  from = [0, 0]; // azimuth and elevation of the lower left corner, radians
  span = [TURN, 0];
  #axes;
  #blocks = []; // [block, whether it was closed]: closing changes the order of its points
  #block; // per pixel: which of the blocks, and which of its points
  #point;
  #range; // from the head
  #held = 0; // points of the blocks
  #window;
  #origin; // of the cloud; clearing the cloud changes it, and blocks from before would then lie elsewhere
  #section; // as relativeTo() returns it, or null

  constructor(cloud, station, section = null) {
    this.cloud = cloud;
    this.station = station;
    this.#window = cloud.window;
    this.#origin = cloud.origin;
    this.#section = section?.relativeTo(cloud.origin) ?? null;
    this.#axes = headAxes(station);
    this.at = [station.x_m, station.y_m, station.z_m];
  }

  // Returns [azimuth, elevation, range] of a place.
  anglesOf(place) {
    const d = sub(place, this.at);
    const [x, y, z] = this.#axes.map((axis) => dot(axis, d));
    return [Math.atan2(x, y), Math.atan2(z, Math.hypot(x, y)), Math.hypot(x, y, z)];
  }

  // Calls take(i, azimuth, elevation, range) for each point of a block that is shown.
  #each(block, take) {
    const {position, n} = block, window = this.#window, section = this.#section;
    if (isOutside(window, block)) return;
    const [[a, b, c], [d, e, f], [g, h, k]] = this.#axes;
    const [ox, oy, oz] = sub(this.#origin, this.at);
    for (let i = 0, p = 0; i < n; i++, p += 3) {
      if (isPointOutside(window, block, i)) continue;
      if (section !== null && !isWithin(section, position[p], position[p + 1], position[p + 2])) continue;
      const dx = position[p] + ox, dy = position[p + 1] + oy, dz = position[p + 2] + oz;
      const x = a * dx + b * dy + c * dz, y = d * dx + e * dy + f * dz, z = g * dx + h * dy + k * dz;
      const flat = Math.sqrt(x * x + y * y), range = Math.sqrt(x * x + y * y + z * z);
      if (range === range) take(i, Math.atan2(x, y), Math.atan2(z, flat), range);
    }
  }

  // Steps through the points of the station: first for the limits of the angles, then for the pixels. The last value is
  // the panorama; n is 0 without points.
  * make() {
    const blocks = this.cloud.blocks.filter((block) => block.station === this.station.number);
    this.#blocks = blocks.map((block) => [block, block.closed]);
    const lo = [Infinity, Infinity], hi = [-Infinity, -Infinity];
    for (const block of blocks) {
      this.#each(block, (_, azimuth, elevation) => {
        lo[0] = Math.min(lo[0], azimuth);
        hi[0] = Math.max(hi[0], azimuth);
        lo[1] = Math.min(lo[1], elevation);
        hi[1] = Math.max(hi[1], elevation);
        this.n++;
      });
      this.#held += block.n;
      yield;
    }
    if (this.n === 0) return this;
    this.from = lo;
    this.span = lo.map((v, k) => Math.max(0.01, hi[k] - v));
    yield* this.#chooseShape(blocks);
    const nearest = this.#range = new Float32Array(this.width * this.height).fill(Infinity);
    this.#block = new Uint32Array(nearest.length).fill(EMPTY);
    this.#point = new Uint32Array(nearest.length);
    for (const [k, block] of blocks.entries()) {
      this.#each(block, (i, azimuth, elevation, range) => {
        const pixel = this.#pixel(azimuth, elevation);
        if (pixel === null || !(range < nearest[pixel])) return;
        nearest[pixel] = range;
        this.#block[pixel] = k;
        this.#point[pixel] = i;
      });
      yield;
    }
    return this;
  }

  #size(shape) {
    const pixels = this.n / PER_PIXEL, columns = this.span[0] / this.span[1] * shape; // for each row
    this.width = Math.round(Math.min(WIDEST, Math.max(60, Math.sqrt(pixels * columns))));
    this.height = Math.max(1, Math.min(WIDEST, Math.round(this.width / columns)));
  }

  // Points are often closer together along a scan line than from line to line. Pixels that are not square then leave
  // fewer gaps. Chooses the shape with which the most pixels have a point.
  * #chooseShape(blocks) {
    const tries = SHAPES.map((shape) => {
      this.#size(shape);
      return {shape, width: this.width, height: this.height, has: new Uint8Array(this.width * this.height)};
    });
    let n = 0;
    for (const block of blocks) {
      if (n > TRIED) break;
      this.#each(block, (_, azimuth, elevation) => {
        for (const size of tries) size.has[this.#pixel(azimuth, elevation, size) ?? -1] = 1;
      });
      n += block.n;
      yield;
    }
    const share = ({has}) => has.reduce((sum, v) => sum + v, 0) / has.length;
    let best = tries[0], most = 1.1 * share(best); // pixels stay square unless others fill clearly more
    for (const other of tries) if (share(other) > most) [best, most] = [other, share(other)];
    this.#size(best.shape);
  }

  // Returns the column and row of angles, as shares of the width and the height.
  shareOf([azimuth, elevation]) {
    return [(azimuth - this.from[0]) / this.span[0], 1 - (elevation - this.from[1]) / this.span[1]];
  }

  // Returns null for angles outside of the panorama: a point may have come after its limits were found.
  #pixel(azimuth, elevation, {width, height} = this) {
    const [x, y] = this.shareOf([azimuth, elevation]);
    if (!(x >= 0 && x <= 1 && y >= 0 && y <= 1)) return null;
    return Math.min(height - 1, Math.floor(y * height)) * width + Math.min(width - 1, Math.floor(x * width));
  }

  // Returns the pixel whose point a pixel shows: itself, or one beside it if both sides have a point. null: there is
  // none.
  #shown(pixel) {
    if (this.#block[pixel] !== EMPTY) return pixel;
    const column = pixel % this.width, row = Math.floor(pixel / this.width);
    const hasBoth = (step, at, n) => at > 0 && at < n - 1 && this.#block[pixel - step] !== EMPTY && this.#block[pixel + step] !== EMPTY;
    if (hasBoth(1, column, this.width)) return pixel - 1;
    return hasBoth(this.width, row, this.height) ? pixel - this.width : null;
  }

  // Returns {block, i} of the point of a pixel, or null. The answer is null, too, once the block was closed
  // or the cloud was cleared: the panorama has to be made again then.
  pointAt(x, y) {
    if (this.n === 0 || this.cloud.origin !== this.#origin || x < 0 || y < 0 || x >= this.width || y >= this.height) return null;
    const pixel = this.#shown(y * this.width + x);
    if (pixel === null) return null;
    const [block, wasClosed] = this.#blocks[this.#block[pixel]];
    return block.closed === wasClosed ? {block, i: this.#point[pixel]} : null;
  }

  // Returns {pixels: RGBA of each, limits}: mode as in view_colours.js. Pixels without a point are transparent.
  colours(mode) {
    const n = this.width * this.height;
    const values = new Float32Array(n).fill(NaN);
    const all = mode === 'range' ? null : this.#blocks.map(([block]) => valuesOf(block, mode, 0, block.n));
    for (let p = 0; p < n; p++) {
      const from = this.#shown(p);
      if (from !== null) values[p] = all === null ? this.#range[from] : all[this.#block[from]][this.#point[from]];
    }
    const isList = mode === 'label';
    const every = Math.ceil(n / SAMPLED);
    const limits = isList ? null : robustLimits(values.filter((v, p) => mix(p) % every === 0 && v === v && v !== NONE));
    const table = tableOf(mode), pixels = new Uint8ClampedArray(4 * n);
    for (let p = 0; p < n; p++) {
      const v = values[p];
      if (v !== v) continue;
      if (v === NONE || (!isList && limits === null)) pixels.set([...GREY, 255], 4 * p);
      else {
        const at = isList ? v & 255 : Math.round(255 * Math.min(1, Math.max(0, (v - limits[0]) / (limits[1] - limits[0]))));
        for (let c = 0; c < 4; c++) pixels[4 * p + c] = table[4 * at + c];
      }
    }
    return {pixels, limits};
  }

  // Returns whether points came or went since the panorama was made, or others are shown now.
  isOld(cloud, section) {
    if (cloud !== this.cloud || cloud.origin !== this.#origin) return true;
    const cut = section?.relativeTo(cloud.origin) ?? null;
    if (JSON.stringify([cloud.window, cut]) !== JSON.stringify([this.#window, this.#section])) return true;
    const now = this.cloud.blocks.filter((block) => block.station === this.station.number);
    return now.length !== this.#blocks.length || now.reduce((sum, block) => sum + block.n, 0) !== this.#held
      || now.some((block, k) => block !== this.#blocks[k][0] || block.closed !== this.#blocks[k][1]);
  }
}
