/* SPDX-License-Identifier: MIT */
// The camera has the place and direction of the eye, and converts between scene and screen. The module is pure; lengths
// are in metres, angles in radians, in the scene frame (x east, y north, z up) in doubles. Screen places are CSS pixels
// from the top left corner.
//
// Depth is logarithmic: from NEAR_M to FAR_M each doubling of the distance has the same share of the 24 bits, so two
// points 1.2 um apart at 1 m, or 1.2 mm at 1 km, have different depths. The shaders have the formula of depthOf().
//
// A flat (orthographic) view has the scale that a perspective one has at the target. A flat view has neither a near nor
// a far end: places behind its eye are drawn, too (flatDepthOf).

export const NEAR_M = 1e-3;
export const FAR_M = 1e6;
const TURN = 2 * Math.PI;
const STEEPEST = Math.PI / 2 - 1e-3;
const FILLED = 0.97; // a fitted box fills this share of the picture's width or height

export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const add = (a, b, k = 1) => [a[0] + k * b[0], a[1] + k * b[1], a[2] + k * b[2]];
export const sub = (a, b) => [a[0] - b[0], a[1] - b[1], a[2] - b[2]];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
export const unit = (v) => v.map((c) => c / Math.hypot(...v));
export const clamp = (v, lo, hi) => Math.min(hi, Math.max(lo, v));
export const degrees = (rad) => ((rad * 180 / Math.PI) % 360 + 360) % 360;
export const radians = (deg) => deg * Math.PI / 180;

// Returns the depth of a distance along the line of sight: 0 at NEAR_M, 1 at FAR_M.
export const depthOf = (w) => Math.log2(w / NEAR_M) / Math.log2(FAR_M / NEAR_M);

// In a flat view the depth is 0.5 at the target, and grows there about as fast as depthOf at that distance.
export const FLAT_REACH = 10; // the depth is 0.25 or 0.75 at so many times the target's distance before or behind it
export function flatDepthOf(w, distance) {
  const x = (w - distance) / (FLAT_REACH * distance);
  return 0.5 + 0.5 * x / (1 + Math.abs(x));
}

// Returns a double as the sum of two floats. Near the eye the difference between a float coordinate and hi is exact; lo
// is subtracted from that difference.
export function split(v) {
  const hi = v.map(Math.fround);
  return {hi, lo: v.map((c, a) => Math.fround(c - hi[a]))};
}

export class Camera {
  target = [0, 0, 0];
  distance = 10;
  azimuth = radians(-35); // it is the heading of the line of sight, clockwise from north
  elevation = radians(-25);
  fov = radians(50); // it is the angle across the shorter side
  inside = false; // the eye is in the place of a head: it stays there when the camera turns
  flat = false; // it is orthographic
  before = null; // the direction that the camera had before the flat views (view_sides.js)
  section = null; // only what is in this Section (section.js) is seen
  width = 1;
  height = 1;

  get forward() {
    const c = Math.cos(this.elevation);
    return [Math.sin(this.azimuth) * c, Math.cos(this.azimuth) * c, Math.sin(this.elevation)];
  }
  get right() { return [Math.cos(this.azimuth), -Math.sin(this.azimuth), 0]; }
  get up() {
    const s = -Math.sin(this.elevation);
    return [Math.sin(this.azimuth) * s, Math.cos(this.azimuth) * s, Math.cos(this.elevation)];
  }
  get eye() { return add(this.target, this.forward, -this.distance); }

  // Returns the pixels of one metre at the distance of one metre.
  get focal() { return 0.5 * Math.min(this.width, this.height) / Math.tan(0.5 * this.fov); }

  // The matrix's rows are right, up and forward.
  get rotation() { return [this.right, this.up, this.forward]; }

  // Returns {x, y, w}: focal / w is the pixels of a metre there. w is the distance along the line of sight, which is at
  // most 0 behind the eye; in a flat view it is that of the target everywhere.
  project(p) {
    const d = sub(p, this.eye);
    const w = this.flat ? this.distance : dot(d, this.forward);
    const k = this.focal / w;
    return {x: 0.5 * this.width + k * dot(d, this.right), y: 0.5 * this.height - k * dot(d, this.up), w};
  }

  // Returns `from`, moved across the line of sight by so many pixels at the distance w.
  #across(from, x, y, w) {
    const k = w / this.focal;
    return add(add(from, this.right, (x - 0.5 * this.width) * k), this.up, (0.5 * this.height - y) * k);
  }

  // Returns the direction of the ray through a place of the screen, with a length of 1 along the line of sight.
  ray(x, y) { return this.flat ? this.forward : this.#across(this.forward, x, y, 1); }

  // Returns the place where that ray begins.
  from(x, y) { return this.flat ? this.#across(this.eye, x, y, this.distance) : this.eye; }

  at(x, y, w) { return add(this.from(x, y), this.ray(x, y), w); }

  turn(dAzimuth, dElevation) {
    const {eye} = this;
    this.azimuth = (this.azimuth + dAzimuth) % TURN;
    this.elevation = clamp(this.elevation + dElevation, -STEEPEST, STEEPEST);
    if (this.inside) this.target = add(eye, this.forward, this.distance);
  }

  // Turns about any place, which stays where it is on the screen.
  orbit(pivot, dAzimuth, dElevation) {
    const d = sub(this.eye, pivot);
    const seen = this.rotation.map((axis) => dot(axis, d));
    this.azimuth = (this.azimuth + dAzimuth) % TURN;
    this.elevation = clamp(this.elevation + dElevation, -STEEPEST, STEEPEST);
    const axes = this.rotation;
    let eye = pivot;
    axes.forEach((axis, i) => { eye = add(eye, axis, seen[i]); });
    this.target = add(eye, this.forward, this.distance);
  }

  // A point at distance w follows the pointer.
  pan(dx, dy, w) {
    const k = w / this.focal;
    this.inside = false;
    this.target = add(add(this.target, this.right, -dx * k), this.up, dy * k);
  }

  // With factor < 1 the eye comes nearer; the place p stays where it is on the screen. Where `inside` is set, the
  // field of view changes instead.
  zoom(factor, p) {
    if (this.inside) {
      this.fov = clamp(this.fov * factor, radians(2), radians(110));
      return;
    }
    const distance = clamp(this.distance * factor, 2 * NEAR_M, 0.02 * FAR_M);
    const k = distance / this.distance;
    if (p) this.target = add(p, sub(this.target, p), k);
    this.distance = distance;
  }

  // Looks in a direction without perspective. The scale at the target stays, unless the eye was in the place of a head:
  // then the field of view is 50 degrees again, and the target at least 10 m away.
  lookFlat(azimuth, elevation) {
    if (this.inside) this.distance = Math.max(this.distance, 10);
    Object.assign(this, {inside: false, flat: true, fov: radians(50), azimuth, elevation});
  }

  // Brings all of a box into sight.
  fit({min, max}) {
    if (this.inside) this.elevation = radians(-25);
    this.inside = false;
    this.fov = radians(50);
    this.target = min.map((v, a) => 0.5 * (v + max[a]));
    this.distance = 0.05;
    const [right, up, forward] = this.rotation;
    const across = 0.5 * FILLED * this.width / this.focal, along = 0.5 * FILLED * this.height / this.focal;
    for (let k = 0; k < 8; k++) { // the eye goes back until each corner is in sight
      const d = [0, 1, 2].map((a) => (k >> a & 1 ? max : min)[a] - this.target[a]);
      const least = Math.max(Math.abs(dot(d, right)) / across, Math.abs(dot(d, up)) / along) - (this.flat ? 0 : dot(d, forward));
      this.distance = Math.max(this.distance, least);
    }
  }

  lookFrom(eye, heading, elevation = 0) {
    this.inside = true;
    this.flat = false;
    this.fov = radians(80);
    this.azimuth = heading;
    this.elevation = elevation;
    this.distance = 3;
    this.target = add(eye, this.forward, this.distance);
  }

  // Returns whether any part of a box is in sight; lo and hi are relative to origin. The answer may be true for a box
  // out of sight, but never false for one in sight.
  sees(lo, hi, origin) {
    const eye = sub(this.eye, origin);
    const [right, up, forward] = this.rotation;
    const tx = 0.5 * this.width / this.focal, ty = 0.5 * this.height / this.focal;
    const [ahead, k] = this.flat ? [[0, 0, 0], this.distance] : [forward, 0]; // a flat view's sides are parallel
    const planes = [ahead, add(right, ahead, tx), add(right.map((c) => -c), ahead, tx),
      add(up, ahead, ty), add(up.map((c) => -c), ahead, ty)];
    return planes.every((n, i) => {
      let most = k * [0, tx, tx, ty, ty][i];
      for (let a = 0; a < 3; a++) most += n[a] * ((n[a] > 0 ? hi[a] : lo[a]) - eye[a]);
      return most >= -1e-3;
    });
  }
}

// Returns the place where the ray through a place of the screen hits the plane z = height. Beyond `reach` from the
// eye, or without a hit, it is the place at that reach in the ray's direction, on the plane.
export function onPlane(camera, x, y, height, reach) {
  const eye = camera.from(x, y);
  const ray = camera.ray(x, y);
  const t = (height - eye[2]) / ray[2];
  const along = Math.hypot(ray[0], ray[1]);
  const isHit = (t > 0 || camera.flat) && Math.abs(t) * along < reach;
  const d = isHit ? t * along : reach;
  if (along < 1e-12) return [eye[0], eye[1], height];
  return [eye[0] + d * ray[0] / along, eye[1] + d * ray[1] / along, height];
}

// Returns the heading from one place to another, in degrees clockwise from north.
export const headingTo = (from, to) => degrees(Math.atan2(to[0] - from[0], to[1] - from[1]));

// Returns a step of an arrow key along the scene axis that is closest to the arrow's direction on the screen.
export function arrowStep(camera, key, step) {
  const turns = {ArrowUp: 0, ArrowRight: 1, ArrowDown: 2, ArrowLeft: 3}[key];
  const quarter = (Math.round(camera.azimuth / (Math.PI / 2)) + turns) & 3;
  return [[0, step], [step, 0], [0, -step], [-step, 0]][quarter];
}

// Returns the largest of 1, 2, 5 times a power of ten that is at most v.
export function roundBelow(v) {
  const power = 10 ** Math.floor(Math.log10(v));
  for (const k of [5, 2]) if (k * power <= v * (1 + 1e-12)) return k * power;
  return power;
}
