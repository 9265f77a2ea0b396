/* SPDX-License-Identifier: MIT */
// This module finds the point under the pointer: the nearest one on the screen, where points near the eye win over
// points behind them. The search is pure; searchSlowly, runSlowly and lookAt use timers, and lookAt moves the view.
//
// Only blocks whose box meets the cone around the ray are looked through, 10 ns a point.

import {isOutside, isPointOutside} from './cloud.js';
import {dot, sub} from './view_camera.js';
import {isWithin} from './section.js';

// Four pixels beside the pointer count as much as lying a tenth further away.
const PIXELS_PER_DEPTH = 4 / Math.log(1.1);

// Returns whether a box may reach into the cone around a ray. The cone's radius is beside_m at its begin, and grows by
// `slope` per length. The test takes the sphere around the box, so the answer may be true for a box outside the cone.
// The box and the ray's begin have one origin.
function meets(block, eye, forward, slope, beside_m) {
  const c = [0, 1, 2].map((a) => 0.5 * (block.lo[a] + block.hi[a]) - eye[a]);
  const r = 0.5 * Math.hypot(...[0, 1, 2].map((a) => block.hi[a] - block.lo[a]));
  const along = dot(c, forward);
  if (slope > 0 && along < -r) return false;
  const square = dot(c, c);
  const across = Math.sqrt(Math.max(0, square - along * along));
  return across <= r * Math.hypot(1, slope) + Math.max(0, along) * slope + beside_m;
}

// Steps through blocks; each next() looks through one of them. The last value is {block, i, w, px} or null. The value
// is null, too, if the cloud was cleared meanwhile: places in its blocks would be relative to another origin.
// limit is the number of points of each block that search() tests. In a flat view the rays are parallel, and w may be
// less than 0. There four pixels beside the pointer count as much as a depth of a tenth of the target's distance.
export function* search(cloud, camera, x, y, radius_px, limit = Infinity) {
  const {origin} = cloud, {flat, distance} = camera;
  if (origin === null) return null;
  const from = sub(camera.from(x, y), origin), ray = camera.ray(x, y), length = Math.hypot(...ray);
  const f = ray.map((c) => c / length);
  const k = flat ? camera.focal / distance : camera.focal * length; // pixels per metre; with perspective per slope
  const reach = radius_px / k; // a length; with perspective a slope
  const section = camera.section?.relativeTo(origin) ?? null;
  let best = null;
  let least = Infinity;
  for (const block of [...cloud.blocks]) {
    const {window} = cloud;
    if (!meets(block, from, f, flat ? 0 : reach, flat ? reach : 0) || isOutside(window, block)) continue;
    yield; // never after the last block: points that come meanwhile may close it, which changes the order of its points
    const p = block.position;
    const n = Math.min(block.n, limit);
    for (let i = 0, at = 0; i < n; i++, at += 3) {
      const dx = p[at] - from[0], dy = p[at + 1] - from[1], dz = p[at + 2] - from[2];
      const w = dx * f[0] + dy * f[1] + dz * f[2];
      if (!flat && w <= 1e-3) continue;
      const off2 = dx * dx + dy * dy + dz * dz - w * w, most = flat ? reach : reach * w;
      if (off2 > most * most || isPointOutside(window, block, i)) continue;
      if (section !== null && !isWithin(section, p[at], p[at + 1], p[at + 2])) continue;
      const px = Math.sqrt(Math.max(0, off2)) * k / (flat ? 1 : w);
      const score = px + PIXELS_PER_DEPTH * (flat ? w / distance : Math.log(w));
      if (score < least) {
        least = score;
        best = {block, i, w: w / length, px};
      }
    }
  }
  return cloud.origin === origin ? best : null;
}

export function nearest(cloud, camera, x, y, radius_px, limit) {
  const steps = search(cloud, camera, x, y, radius_px, limit);
  for (;;) {
    const {done, value} = steps.next();
    if (done) return value;
  }
}

// Returns the place that a gesture keeps at (x, y). The place is as far away as the point found there, or else as the
// target. The search looks at the first 4096 points of each block: in a closed block these are spread evenly
// (cloud.js).
export function grip(cloud, camera, x, y) {
  const found = nearest(cloud, camera, x, y, 14, 4096);
  return camera.at(x, y, found ? found.w : camera.distance);
}

// Searches in slices, so that the page goes on. The function returned stops it.
export const searchSlowly = (cloud, camera, x, y, radius_px, then) => runSlowly(search(cloud, camera, x, y, radius_px), then);

// Takes the steps of a generator in slices of a few milliseconds. The callback gets the generator's result; the
// function returned stops it.
export function runSlowly(steps, then, slice_ms = 6) {
  let timer = 0;
  const slice = () => {
    const end = performance.now() + slice_ms;
    do {
      const {done, value} = steps.next();
      if (done) {
        then(value);
        return;
      }
    } while (performance.now() < end);
    timer = setTimeout(slice, 0);
  };
  slice();
  return () => clearTimeout(timer);
}

// Returns the distance from a place of the screen to a line between two, in pixels.
export function toSegment(x, y, a, b) {
  const dx = b.x - a.x, dy = b.y - a.y;
  const t = Math.min(1, Math.max(0, ((x - a.x) * dx + (y - a.y) * dy) / (dx * dx + dy * dy || 1)));
  return Math.hypot(a.x + t * dx - x, a.y + t * dy - y);
}

// Makes a view turn about the point at a place of its canvas, and go half the distance to it.
export function lookAt(view, {x, y}) {
  const {cloud, camera} = view;
  searchSlowly(cloud, camera, x, y, 12, (found) => {
    if (!found) return;
    const target = camera.at(x, y, found.w), {w} = camera.project(target);
    Object.assign(camera, {inside: false, target, distance: Math.max(0.05, 0.5 * w)});
    view.cameraMoved();
  });
}
