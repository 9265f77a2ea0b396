/* SPDX-License-Identifier: MIT */
// A section is the part of the scene that is seen. It is a box that may be turned about the vertical, or all between
// two heights. The module is pure; lengths are metres in the scene's frame, relative to an origin where one is given.

import {add, dot, radians, sub, unit} from './view_camera.js';

const WIDE = 1e9; // half of a height cut's width: its sides lie beyond any scene
const THIN = 0.02; // a box is at least so thick

const FACES = [['right', 0, 1], ['left', 0, -1], ['ahead', 1, 1], ['back', 1, -1], ['top', 2, 1], ['bottom', 2, -1]];

const withAt = (v, axis, value) => v.map((old, a) => (a === axis ? value : old));

export class Section {
  kind = 'box'; // or 'height'
  middle = [0, 0, 0];
  half = [1, 1, 1]; // to the right, ahead and up of the heading
  heading_deg = 0;

  constructor(from = {}) {
    Object.assign(this, from);
  }

  // Returns a section with all of {min, max} in it, a little larger. A height cut takes the upper third of `usual` away,
  // the box without stray points.
  static around({min, max}, kind, usual = {min, max}) {
    const margin = 0.01 * Math.hypot(...sub(max, min)) + THIN;
    const top = kind === 'height' ? usual.min[2] + (usual.max[2] - usual.min[2]) * 2 / 3 : max[2] + margin;
    const from = min.map((v) => v - margin), to = [max[0] + margin, max[1] + margin, top];
    return new Section({kind, middle: from.map((v, a) => 0.5 * (v + to[a])), half: from.map((v, a) => 0.5 * (to[a] - v))});
  }

  get axes() {
    const h = radians(this.heading_deg), c = Math.cos(h), s = Math.sin(h);
    return [[c, -s, 0], [s, c, 0], [0, 0, 1]];
  }

  get limits() { return this.kind === 'height' ? [WIDE, WIDE, this.half[2]] : this.half; }

  // Returns what tests and shaders take: {middle, half, turn: [cos, sin]}, relative to the origin.
  relativeTo(origin) {
    const [right] = this.axes;
    return {middle: sub(this.middle, origin), half: this.limits, turn: [right[0], -right[1]]};
  }

  // Returns whether a box relative to the origin may have a part in the section; the answer is never false for a box
  // that has one.
  meets(lo, hi, origin) {
    const {middle} = this.relativeTo(origin);
    const limits = this.limits;
    return this.axes.every((axis, k) => {
      const at = dot(axis, [0, 1, 2].map((a) => 0.5 * (lo[a] + hi[a]) - middle[a]));
      const reach = [0, 1, 2].reduce((sum, a) => sum + Math.abs(axis[a]) * 0.5 * (hi[a] - lo[a]), 0);
      return Math.abs(at) - reach <= limits[k];
    });
  }

  // Returns the part of {min, max} around the section; all of it, if nothing is in the section.
  within({min, max}) {
    const corners = this.corners, axes = this.kind === 'height' ? [2] : [0, 1, 2];
    const bound = (v, a, least, most) => (axes.includes(a) ? most(v, least(...corners.map((p) => p[a]))) : v);
    const inner = {min: min.map((v, a) => bound(v, a, Math.min, Math.max)), max: max.map((v, a) => bound(v, a, Math.max, Math.min))};
    return inner.min.every((v, a) => v < inner.max[a]) ? inner : {min, max};
  }

  // Returns the eight corners, bit k of the index for axis k. A height cut has the corners of the box from which it was
  // made.
  get corners() {
    const axes = this.axes;
    return Array.from({length: 8}, (_, i) => axes.reduce((p, axis, k) => add(p, axis, (i >> k & 1 ? 1 : -1) * this.half[k]), this.middle));
  }

  // Returns the handles: [{id, at, along}]. A face moves along its direction; other handles move on the ground plan.
  get handles() {
    const axes = this.axes;
    const faces = FACES.filter(([, axis]) => this.kind === 'box' || axis === 2).map(([id, axis, sign]) =>
      ({id, at: add(this.middle, axes[axis], sign * this.half[axis]), along: axes[axis].map((c) => sign * c)}));
    if (this.kind === 'height') return faces;
    const arm = this.half[1] + 0.25 * Math.hypot(this.half[0], this.half[1]);
    return [...faces, {id: 'turn', at: add(this.middle, axes[1], arm), along: null}, {id: 'move', at: [...this.middle], along: null}];
  }

  // Moves a face outward by by_m. Below 0 it moves inward, but the box stays at least THIN thick.
  push(id, by_m) {
    const [, axis, sign] = FACES.find(([name]) => name === id);
    const d = Math.max(by_m, THIN - 2 * this.half[axis]);
    this.half = withAt(this.half, axis, this.half[axis] + 0.5 * d);
    this.middle = add(this.middle, this.axes[axis], 0.5 * d * sign);
  }

  // Sets the heights of bottom and top; returns false for heights that leave nothing.
  between(from_m, to_m) {
    if (!(to_m - from_m >= THIN)) return false;
    this.middle = withAt(this.middle, 2, 0.5 * (from_m + to_m));
    this.half = withAt(this.half, 2, 0.5 * (to_m - from_m));
    return true;
  }

  get from_m() { return this.middle[2] - this.half[2]; }
  get to_m() { return this.middle[2] + this.half[2]; }
}

// Returns whether a place is in what relativeTo() returned.
export function isWithin({middle, half, turn: [c, s]}, x, y, z) {
  const dx = x - middle[0], dy = y - middle[1];
  return Math.abs(c * dx - s * dy) <= half[0] && Math.abs(s * dx + c * dy) <= half[1] && Math.abs(z - middle[2]) <= half[2];
}

// A line goes through `at` in the direction `along`, and a ray from the eye through x, y of the screen. Returns the
// distance from `at` to the line's point that is closest to the ray; null if the line points at the eye.
export function alongLine(camera, at, along, x, y) {
  const o = camera.from(x, y), f = unit(camera.ray(x, y));
  const slant = dot(along, f);
  const square = 1 - slant * slant;
  if (square < 0.02) return null;
  const d = sub(o, at);
  return (dot(along, d) - slant * dot(f, d)) / square;
}
