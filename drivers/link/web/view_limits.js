/* SPDX-License-Identifier: MIT */
// From the cloud's points, the class Scale finds the limits of the colours, and boxOf() finds the box of the view. The
// limits change rarely, so that nothing flickers: when the cloud has twice the points, and then only if the new points
// lie far outside. The limits of the mode age change sooner.

import {spreadOver} from './cloud.js';
import {MODES, legendOf, robustLimits, sampleOf, widened} from './view_colours.js';

const AGED = 1.15; // in the mode age the limits follow sooner

export class Scale {
  mode = 'height';
  scale = 'usual'; // of SCALES in view_ramps.js
  share = 0.01; // the limits leave out this share of the points at each end
  limits = null; // heights are relative to the cloud's origin
  #cloud;
  #fixed = null; // the user set these, in the scene frame
  #at = 0; // the points that the cloud had when the limits were found
  #sample = [];
  #legend = null;

  constructor(cloud) { this.#cloud = cloud; }

  use(cloud) {
    this.#cloud = cloud;
    this.forget();
  }

  forget() {
    this.limits = this.#legend = null;
    this.#at = 0;
    this.#sample = [];
  }

  colour(mode) {
    this.mode = mode;
    this.#fixed = null;
    this.forget();
  }

  fix(lo, hi) {
    if (lo !== undefined && !(lo < hi)) throw new RangeError(`limits ${lo} to ${hi}: the first has to be less`);
    this.#fixed = lo === undefined ? null : [lo, hi];
    this.forget();
  }

  choose(scale, share) {
    if (!(share >= 0 && share < 0.5)) throw new RangeError(`a share of ${share} at each end: from 0 to less than 0.5`);
    const isSame = share === this.share;
    Object.assign(this, {scale, share});
    if (isSame) this.#legend = null; // other colours, the same limits
    else this.forget();
  }

  // Returns by how much the oldest point is older than the newest one, where the mode shows ages; else NaN.
  get #oldest() {
    const {blocks, latest_s} = this.#cloud;
    return this.mode === 'age' && blocks.length > 0 ? latest_s - Math.min(...blocks.map(({began_s, span}) => began_s + span.from)) : NaN;
  }

  get #offset() { return this.mode === 'height' && this.#cloud.origin ? this.#cloud.origin[2] : 0; }

  legend() {
    this.#legend ??= legendOf(this.mode, {limits: this.limits, offset: this.#offset, sample: this.#sample, scale: this.scale, oldest_s: this.#oldest,
      hasColours: this.#cloud.blocks.some((block) => block.rgb !== null)});
    return this.#legend;
  }

  // Returns {first, changed}: there are limits for the first time, or other ones than before.
  follow() {
    const {total, blocks} = this.#cloud;
    const due = total > this.#at && (total >= 2 * this.#at || (this.mode === 'age' && total > AGED * this.#at));
    if (!due) return {first: false, changed: false};
    const before = this.limits;
    this.#at = total;
    this.#legend = null;
    this.#sample = sampleOf(this.#cloud, this.mode);
    if (MODES[this.mode].kind !== 'ramp') return {first: false, changed: false};
    if (this.mode === 'age') this.limits = [blocks[0]?.first ?? total, total];
    else this.limits = this.#fixed?.map((v) => v - this.#offset) ?? widened(before, robustLimits(this.#sample, MODES[this.mode].least, this.share));
    const changed = this.limits !== null && (before === null || before.some((v, i) => v !== this.limits[i]));
    return {first: before === null && changed, changed};
  }
}

// Returns {min, max} in the scene frame, without stray points: a single one, far away, would make all others small. The
// outermost 1 % at an end is left out if its last point lies further out of the others' box than its diagonal is long.
function boxWithoutStray({blocks, bounds, origin}) {
  const axes = [[], [], []];
  for (const block of blocks) for (const i of spreadOver(block, 1000)) axes.forEach((v, a) => v.push(block.position[3 * i + a]));
  const limits = axes.map((v) => robustLimits(v.filter((c) => c === c)) ?? [0, 0]);
  const wide = Math.hypot(...limits.map(([lo, hi]) => hi - lo));
  const side = (a, inner, outer) => (Math.abs(outer - inner) > wide ? inner : outer);
  return {min: limits.map(([lo], a) => side(a, lo + origin[a], bounds.min[a])),
    max: limits.map(([, hi], a) => side(a, hi + origin[a], bounds.max[a]))};
}

// Returns the box around boxes and the stations; null without any. A box may be null.
function around(boxes, stations) {
  const places = stations.map((s) => [s.x_m, s.y_m, s.z_m]);
  const corners = [...boxes.filter(Boolean).flatMap(({min, max}) => [min, max]), ...places];
  if (corners.length === 0) return null;
  if (corners.length === places.length) corners.push(places[0].map((c) => c - 5), places[0].map((c) => c + 5));
  const ends = (most) => [0, 1, 2].map((a) => corners.reduce((end, p) => most(end, p[a]), corners[0][a]));
  return {min: ends(Math.min), max: ends(Math.max)};
}

// Returns the box of a view of everything: the points and the stations. As long as there are at most 500 points, the
// scene takes the place of the points. With sceneFirst it always does.
export function boxOf(cloud, stations, solids, sceneFirst = false) {
  const scene = sceneFirst || cloud.count <= 500 ? solids.bounds() : null;
  return around([scene ?? (cloud.count > 500 && cloud.bounds ? boxWithoutStray(cloud) : cloud.bounds)], stations);
}

// Returns the box with all points in it, the scene and the stations.
export const boxAround = (cloud, stations, solids) => around([cloud.bounds, solids.bounds()], stations);
