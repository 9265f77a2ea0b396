/* SPDX-License-Identifier: MIT */
// This module measures between picked points. Each figure has its expected error (one sigma). The module
// is pure: it needs no page and no network.
//
// The expected error of a point follows from the noise and the counts that the head reports (`expected` in /quality),
// as in core/studio/deviation.h. Along the beam it is the error of the range; across the beam it is the error of the
// angles times the range. The error of a figure follows from its points to first order, by differences.

import {isOutside, isPointOutside} from './cloud.js';
import {add, cross, dot, sub, unit} from './view_camera.js';
import {headAxes} from './view_stations.js';
import {fixed} from './page.js';
import {isWithin} from './section.js';

const STEP_M = 1e-4; // of the differences; figures are smooth over it
// A point's distance from its station may differ from its range by this share and 0.1 m. Beyond that the station was
// moved after the scan.
const PLACED = 0.01;

const length = (v) => Math.hypot(...v);
export const placeOf = ({x, y, z}) => [x, y, z];

function rangeVariance(t, range_m, amplitude_db) {
  let sigma_m = t.range_sigma_m;
  if (t.range_jitter_m !== null) { // the noise depends on the signal; a: the amplitude in units of the threshold
    const a = 10 ** (amplitude_db / 10);
    sigma_m = Math.hypot(t.range_floor_m, t.range_jitter_m / a);
  }
  return (sigma_m + t.range_sigma_per_m * range_m) ** 2 + t.range_step_m ** 2 / 12;
}

// Returns the terms [variance, direction] of a point's error; null where it is not known.
function errorTerms(point, station, t) {
  if (!t || !station || station.x_m === null) return null;
  const beam = sub(placeOf(point), [station.x_m, station.y_m, station.z_m]);
  const range_m = length(beam);
  if (Number.isFinite(point.range) && Math.abs(point.range - range_m) > PLACED * range_m + 0.1) return null;
  const u = unit(beam), [, , up] = headAxes(station);
  const byPan = cross(up, u); // its length is the cosine of the elevation
  const right = unit(length(byPan) > 1e-9 ? byPan : headAxes(station)[0]);
  const higher = cross(u, right);
  const angle = (k) => t.angle_sigma_rad[k] ** 2 + t.angle_step_rad[k] ** 2 / 12;
  const ball = (t.ball_m * (1 + t.ball_per_m * range_m)) ** 2 / 5;
  const ballAxes = t.ball_local ? [u, right, higher] : [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  const terms = [[rangeVariance(t, range_m, point.amplitude), u], [range_m ** 2 * angle(0), higher],
    [(range_m * length(byPan)) ** 2 * angle(1), right],
    ...ballAxes.map((axis, k) => [ball * t.ball_factor[k] ** 2 + t.place_step_m ** 2 / 12, axis])];
  return terms.every(([variance]) => Number.isFinite(variance)) ? terms : null;
}

// Returns a point with its error: {...point, error}. expected and station are those of its scan.
export const withError = (point, station, expected) => ({...point, error: errorTerms(point, station, expected)});

// Returns the sigma of a point along a direction; NaN: not known.
export const sigmaAlong = ({error}, direction) =>
  (error ? Math.sqrt(error.reduce((sum, [variance, axis]) => sum + variance * dot(axis, direction) ** 2, 0)) : NaN);

// Returns {value, error} of a function of places. The error is NaN where the error of any point is.
function figureOf(f, points) {
  const places = points.map(placeOf);
  let variance = 0;
  points.forEach((point, i) => {
    for (const [v, axis] of point.error ?? [[NaN, [1, 0, 0]]]) {
      const moved = (k) => f(...places.map((p, j) => (j === i ? add(p, axis, k * STEP_M) : p)));
      variance += v * ((moved(1) - moved(-1)) / (2 * STEP_M)) ** 2;
    }
  });
  return {value: f(...places), error: Math.sqrt(variance)};
}

const DEG = 180 / Math.PI;
const corner = (a, b, c) => {
  const [u, v] = [sub(a, b), sub(c, b)];
  return DEG * Math.atan2(length(cross(u, v)), dot(u, v));
};

// Each kind of measurement takes a number of points; 0: three or more, until the user picks the first or last one
// again. The kind's figures are [name, unit, {value, error}]. The flatness has none here: flatnessOf() computes it.
export const KINDS = {
  distance: {title: 'Distance', points: 2, figures: (p) => [
    ['Distance', 'm', figureOf((a, b) => length(sub(b, a)), p)],
    ['Horizontal', 'm', figureOf((a, b) => Math.hypot(b[0] - a[0], b[1] - a[1]), p)],
    ['Vertical', 'm', figureOf((a, b) => b[2] - a[2], p)]]},
  height: {title: 'Height', points: 2, figures: (p) => [
    ['Height', 'm', figureOf((a, b) => b[2] - a[2], p)],
    ['From z', 'm', figureOf((a) => a[2], p.slice(0, 1))],
    ['To z', 'm', figureOf((b) => b[2], p.slice(1))]]},
  angle: {title: 'Angle', points: 3, figures: (p) => [['Angle', '°', figureOf(corner, p)]]},
  flatness: {title: 'Flatness', points: 0},
};

// ---- a plane

// Returns the eigenvector of the smallest eigenvalue of a symmetric matrix [xx, xy, xz, yy, yz, zz], by Jacobi's turns.
function smallestAxis([xx, xy, xz, yy, yz, zz]) {
  const a = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
  const v = [[1, 0, 0], [0, 1, 0], [0, 0, 1]];
  for (let sweep = 0; sweep < 12; sweep++) {
    for (const [p, q] of [[0, 1], [0, 2], [1, 2]]) {
      if (Math.abs(a[p][q]) < 1e-300) continue;
      const theta = (a[q][q] - a[p][p]) / (2 * a[p][q]);
      const t = (theta < 0 ? -1 : 1) / (Math.abs(theta) + Math.hypot(theta, 1));
      const c = 1 / Math.hypot(t, 1), s = t * c;
      for (let k = 0; k < 3; k++) [a[k][p], a[k][q]] = [c * a[k][p] - s * a[k][q], s * a[k][p] + c * a[k][q]];
      for (let k = 0; k < 3; k++) [a[p][k], a[q][k]] = [c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]];
      for (let k = 0; k < 3; k++) [v[k][p], v[k][q]] = [c * v[k][p] - s * v[k][q], s * v[k][p] + c * v[k][q]];
    }
  }
  const least = [0, 1, 2].reduce((b, k) => (a[k][k] < a[b][b] ? k : b), 0);
  return v.map((row) => row[least]);
}

// Returns {middle, normal} of the plane with the least squares through places x, y, z, x, y, z ...
export function planeThrough(places) {
  const n = places.length / 3;
  const middle = [0, 0, 0], sums = [0, 0, 0, 0, 0, 0];
  for (let i = 0; i < places.length; i += 3) for (let a = 0; a < 3; a++) middle[a] += places[i + a] / n;
  for (let i = 0; i < places.length; i += 3) {
    const x = places[i] - middle[0], y = places[i + 1] - middle[1], z = places[i + 2] - middle[2];
    sums[0] += x * x;
    sums[1] += x * y;
    sums[2] += x * z;
    sums[3] += y * y;
    sums[4] += y * z;
    sums[5] += z * z;
  }
  return {middle, normal: smallestAxis(sums)};
}

// Returns whether a place of the plane is in a polygon [[u, v], ...]: a ray from it then crosses an odd number of
// sides.
function isInPolygon(polygon, u, v) {
  let inside = false;
  for (let i = 0, j = polygon.length - 1; i < polygon.length; j = i++) {
    const [a, b] = [polygon[i], polygon[j]];
    if ((a[1] > v) !== (b[1] > v) && u < (b[0] - a[0]) * (v - a[1]) / (b[1] - a[1]) + a[0]) inside = !inside;
  }
  return inside;
}

const FURTHER = 4; // points further than depth_m from the plane, up to this many times depth_m, count as left out

// Steps through the points within `depth_m` of the plane through the corners, and within their outline. The last value
// is {places (relative to the cloud's origin), plane, beyond}; `beyond` counts points a little further from the plane.
// There are no places if the cloud has no points, or was cleared meanwhile.
export function* pointsOnFace(cloud, camera, corners, depth_m) {
  const {origin, window} = cloud;
  if (origin === null) return {plane: null, beyond: 0, places: new Float32Array(0)};
  const own = corners.map((p) => sub(placeOf(p), origin));
  const plane = planeThrough(own.flat());
  const across = unit(cross(Math.abs(plane.normal[2]) < 0.9 ? [0, 0, 1] : [1, 0, 0], plane.normal)), up = cross(plane.normal, across);
  const flat = (p) => [dot(sub(p, plane.middle), across), dot(sub(p, plane.middle), up)];
  const polygon = own.map(flat);
  const reach = Math.max(...own.map((p) => length(sub(p, plane.middle)))) + FURTHER * depth_m;
  const section = camera.section?.relativeTo(origin) ?? null;
  const found = {places: new Float32Array(3000), n: 0, plane, beyond: 0};
  for (const block of [...cloud.blocks]) {
    if (isOutside(window, block) || [0, 1, 2].some((a) => block.lo[a] > plane.middle[a] + reach || block.hi[a] < plane.middle[a] - reach)) continue;
    takeOnFace(block, {plane, polygon, flat, section, window, depth_m, reach}, found);
    yield;
    if (cloud.origin !== origin) return {plane, beyond: 0, places: new Float32Array(0)};
  }
  return {plane, beyond: found.beyond, places: found.places.subarray(0, 3 * found.n)};
}

function takeOnFace(block, {plane, polygon, flat, section, window, depth_m, reach}, found) {
  const {position, n} = block;
  const [nx, ny, nz] = plane.normal, [mx, my, mz] = plane.middle;
  for (let i = 0; i < 3 * n; i += 3) {
    const x = position[i] - mx, y = position[i + 1] - my, z = position[i + 2] - mz;
    const away = Math.abs(x * nx + y * ny + z * nz);
    if (!(away <= FURTHER * depth_m) || x * x + y * y + z * z > reach * reach) continue;
    if (isPointOutside(window, block, i / 3)) continue;
    const p = position.subarray(i, i + 3);
    if (!isInPolygon(polygon, ...flat(p)) || (section !== null && !isWithin(section, ...p))) continue;
    if (away > depth_m) {
      found.beyond++;
      continue;
    }
    if (3 * found.n === found.places.length) {
      const more = new Float32Array(2 * found.places.length);
      more.set(found.places);
      found.places = more;
    }
    found.places.set(p, 3 * found.n++);
  }
}

// Returns the mean of the largest of n deviations of sigma 1 to either side (Gumbel's limit for normal numbers).
export function largestOf(n) {
  const l = Math.log(2 * n), a = Math.sqrt(2 * l);
  return n < 2 ? 0.8 : a - (Math.log(l) + Math.log(4 * Math.PI)) / (2 * a) + 0.5772 / a;
}

// Returns the flatness of places relative to `origin`: {n, rms, largest (positive towards `eye`), at (its place),
// sigma}. sigma is the RMS that the corners' errors give.
export function flatnessOf(places, corners, origin, eye) {
  const n = places.length / 3;
  if (n < 4) return null;
  const {middle, normal} = planeThrough(places);
  const towards = dot(normal, sub(sub(eye, origin), middle)) < 0 ? -1 : 1;
  let squares = 0, largest = 0, at = 0;
  for (let i = 0; i < places.length; i += 3) {
    const d = towards * ((places[i] - middle[0]) * normal[0] + (places[i + 1] - middle[1]) * normal[1] + (places[i + 2] - middle[2]) * normal[2]);
    squares += d * d;
    if (Math.abs(d) > Math.abs(largest)) [largest, at] = [d, i];
  }
  const sigma = Math.sqrt(corners.reduce((sum, p) => sum + sigmaAlong(p, normal) ** 2, 0) / corners.length);
  return {n, rms: Math.sqrt(squares / (n - 3)), largest, sigma, normal,
    at: [0, 1, 2].map((a) => places[at + a] + origin[a])};
}

// ---- how far apart points are

const NEIGHBOURS = 8;

// A generator, whose last value is the mean distance of the points around a place. The distance follows from the area
// of the k nearest points, which has (k - 1) points in the mean if they lie evenly at random. NaN: fewer than nine
// points lie within the largest radius, which is 2 to 6 m, or the cloud was cleared.
export function* spacingAround(cloud, place, first_m) {
  const {window, origin} = cloud;
  if (origin === null) return NaN;
  const p = sub(place, origin);
  for (let r = Math.max(1e-4, first_m); r < 6; r *= 3) {
    const near = [];
    for (const block of [...cloud.blocks]) {
      const {lo, hi, n, position} = block;
      if (isOutside(window, block) || [0, 1, 2].some((a) => lo[a] > p[a] + r || hi[a] < p[a] - r)) continue;
      for (let i = 0; i < 3 * n; i += 3) {
        const d2 = (position[i] - p[0]) ** 2 + (position[i + 1] - p[1]) ** 2 + (position[i + 2] - p[2]) ** 2;
        if (d2 <= r * r && !isPointOutside(window, block, i / 3)) near.push(d2);
      }
      yield;
      if (cloud.origin !== origin) return NaN;
    }
    if (near.length > NEIGHBOURS) return Math.sqrt(near.sort((a, b) => a - b)[NEIGHBOURS] * Math.PI / (NEIGHBOURS - 1));
  }
  return NaN;
}

// ---- in words

// Returns how many decimals a figure has, by its error: the error gets two digits if it begins with 1, else one.
export function decimalsOf(error) {
  if (!(error > 0)) return 3;
  const power = Math.floor(Math.log10(error));
  return Math.max(0, Math.min(6, (error / 10 ** power < 1.95 ? 1 : 0) - power));
}

// Returns a figure in words, rounded by its error: "2.104 m ± 2 mm", "90.02° ± 0.11°"; "2.104 m" without an error.
export function figureText(unitName, {value, error}) {
  const isKnown = Number.isFinite(error), decimals = decimalsOf(isKnown ? error : unitName === '°' ? 0.05 : NaN);
  const gap = unitName === '°' ? '' : '\u00a0';
  const own = `${fixed(value, decimals)}${gap}${unitName}`;
  if (!isKnown) return own;
  const small = unitName === 'm' && error < 0.9995;
  return `${own} ± ${small ? (1e3 * Number(error.toFixed(decimals))).toFixed(Math.max(0, decimals - 3)) : error.toFixed(decimals)}${gap}${small ? 'mm' : unitName}`;
}

const COLUMNS = [['measurement', (p) => p.of], ['point', (p) => p.number], ['x_m', (p) => p.x.toFixed(4)], ['y_m', (p) => p.y.toFixed(4)],
  ['z_m', (p) => p.z.toFixed(4)], ['sigma_x_m', (p) => sigmaText(p, [1, 0, 0])], ['sigma_y_m', (p) => sigmaText(p, [0, 1, 0])],
  ['sigma_z_m', (p) => sigmaText(p, [0, 0, 1])], ['spacing_m', (p) => known(p.spacing, 4)], ['range_m', (p) => known(p.range, 4)],
  ['reflectance_db', (p) => known(p.reflectance, 2)], ['amplitude_db', (p) => known(p.amplitude, 2)],
  ['surface', (p) => p.surface], ['station', (p) => p.station], ['scan', (p) => p.scan], ['echo', (p) => p.echo],
  ['echoes', (p) => p.echoes], ['pulse', (p) => p.pulse], ['time_s', (p) => known(p.t, 6)]];
const known = (value, decimals) => (Number.isFinite(value) ? value.toFixed(decimals) : '');
const sigmaText = (p, axis) => known(sigmaAlong(p, axis), 5);

// A text with a comma, a quote or a line's end stands in quotes (RFC 4180).
const cell = (value) => (/[",\r\n]/.test(String(value)) ? `"${String(value).replaceAll('"', '""')}"` : String(value ?? ''));

// Returns the CSV of points, each with `of`, `number`, `surface`, `spacing` besides what pointOf() has.
export const csvOf = (points) => [COLUMNS.map(([name]) => name), ...points.map((p) => COLUMNS.map(([, of]) => cell(of(p))))]
  .map((row) => `${row.join(',')}\r\n`).join('');
