/* SPDX-License-Identifier: MIT */
// This file tests the pure parts of the tools of the page's picture (drivers/link/web): flat views, sections, measuring
// with its expected errors, panoramas. It prints TAP on standard output.
import {Cloud, pointOf} from '../../drivers/link/web/cloud.js';
import {flatDepthOf, onPlane, radians} from '../../drivers/link/web/view_camera.js';
import {nearest, search} from '../../drivers/link/web/view_pick.js';
import {Input} from '../../drivers/link/web/view_input.js';
import {Stations} from '../../drivers/link/web/view_stations.js';
import {lookDeep, lookFromSide} from '../../drivers/link/web/view_sides.js';
import {alongLine, isWithin, Section} from '../../drivers/link/web/section.js';
import {csvOf, decimalsOf, figureText, flatnessOf, KINDS, largestOf, placeOf, planeThrough, pointsOnFace, sigmaAlong, spacingAround, withError}
  from '../../drivers/link/web/measure.js';
import {Panorama} from '../../drivers/link/web/panorama.js';
import {batch, camera, near, same} from './page_rig.mjs';
import {runTests, test} from './page_tap.mjs';

const ended = (steps) => {
  for (;;) {
    const {done, value} = steps.next();
    if (done) return value;
  }
};

// This gives numbers of a fixed seed, uniform and normal (mulberry32; Box and Muller).
function randomOf(seed) {
  const uniform = () => {
    seed = (seed + 0x6d2b79f5) | 0;
    let t = Math.imul(seed ^ (seed >>> 15), 1 | seed);
    t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
  return {uniform, normal: () => Math.sqrt(-2 * Math.log(1 - uniform())) * Math.cos(2 * Math.PI * uniform())};
}

// ---- flat views

test('a flat view: one scale at each depth, there and back, and nothing is behind it', () => {
  const c = camera({flat: true, target: [500_000, 5_600_000, 110], azimuth: 2.2, elevation: -0.7, distance: 35});
  const px = [-300, 0, 80].map((w) => c.project(c.at(100, 50, w)).x - c.project(c.at(90, 50, w)).x);
  px.forEach((v) => near(v, 10, 1e-5, 'ten pixels')); // an ulp of 5.6e6 is 1e-9 m, and 18 pixels a metre here
  for (const [x, y, w] of [[0, 0, -100], [800, 10, 50], [411, 333, 35]]) {
    const p = c.project(c.at(x, y, w));
    near(p.x, x, 1e-4, 'x');
    near(p.y, y, 1e-4, 'y');
    same(p.w, 35, 'the scale is that of the target');
  }
});

test('a flat view shows at the target what perspective shows there, and T, F, S and O go there and back', () => {
  const c = camera({azimuth: 0.4, elevation: -0.3});
  const metre = (of) => of.project([0, 0, 1]).y - of.project([0, 0, 0]).y;
  lookFromSide(c, 'front');
  near(metre(c), -c.focal / 10, 1e-9, 'a metre in front');
  lookFromSide(c, 'top');
  same([c.forward.map(Math.round), c.right.map(Math.round), c.up.map(Math.round)], [[0, 0, -1], [1, 0, 0], [0, 1, 0]], 'axes of the top');
  near(c.forward[2], -1, 0, 'exactly down'); // a milliradian would move a roof of 10 m by 1 cm
  lookDeep(c);
  same([c.flat, c.azimuth, c.elevation], [false, 0.4, -0.3], 'back');
  const turned = camera({section: new Section({heading_deg: 30})});
  lookFromSide(turned, 'front');
  near(turned.azimuth, radians(30), 1e-12, 'the front of a turned box');
});

test('depth of a flat view: it rises everywhere, with the step of perspective at the target', () => {
  const step = 2 ** -24;
  let last = -1;
  for (const w of [-1e6, -50, 0, 9.9, 10, 10.1, 60, 1e6]) {
    const d = flatDepthOf(w, 10);
    same(d > last && d > 0 && d < 1, true, `at ${w}`);
    last = d;
  }
  same(flatDepthOf(10 + 2e-5, 10) - flatDepthOf(10, 10) > step, true, '20 um at 10 m'); // 2 um a metre, as at 1 m with perspective
});

test('a flat view: gestures hold, boxes out of sight are left out, a box fits', () => {
  const c = camera({flat: true, azimuth: 0.5, elevation: -0.4});
  const held = c.at(200, 150, -7);
  c.zoom(0.6, held);
  c.orbit(held, 0.4, -0.2);
  const p = c.project(held);
  near(p.x, 200, 1e-6, 'x');
  near(p.y, 150, 1e-6, 'y');
  const down = camera({flat: true});
  const sees = (lo, hi) => down.sees(lo, hi, [0, 0, 0]);
  same([sees([-1, -1, -1], [1, 1, 1]), sees([-1, -90, -1], [1, -80, 1]), sees([50, -1, -1], [60, 1, 1])], [true, true, false], 'behind the eye is in sight');
  down.fit({min: [-4, -1, -2], max: [4, 9, 2]});
  near(down.project([4, 9, 0]).x, 0.985 * 800, 1e-6, 'its right end'); // it fills 97 % of the width
  onPlane(camera({flat: true, elevation: -Math.PI / 2}), 400, 300, 3, 99).forEach((v, a) => near(v, [0, 0, 3][a], 1e-9, 'below the pointer'));
});

// ---- sections

test('a section: what is in it, turned; heights; faces that are pushed', () => {
  const s = new Section({middle: [10, 20, 1], half: [3, 1, 2], heading_deg: 90}); // its right is south, its far side east
  const within = (...p) => isWithin(s.relativeTo([0, 0, 0]), ...p);
  same([within(10, 20, 1), within(10, 17.1, 1), within(11.1, 20, 1), within(10, 20, 3.1)], [true, true, false, false], 'in it');
  s.push('right', 0.5);
  same([within(10, 16.6, 1), within(10, 23.1, 1)], [true, false], 'the right face is pushed, the left one stays');
  s.push('top', -99);
  near(s.to_m - s.from_m, 0.02, 1e-12, 'it stays 2 cm thick');
  near(s.from_m, -1, 1e-12, 'and its bottom where it was');
  const cut = Section.around({min: [0, 0, 0], max: [9, 9, 3]}, 'height');
  near(cut.to_m, 2, 1e-12, 'a height cut takes the upper third');
  same([isWithin(cut.relativeTo([5, 5, 5]), 1e4, -1e4, -5), isWithin(cut.relativeTo([5, 5, 5]), 0, 0, -2.9)], [true, false], 'relative to an origin');
  same([cut.between(1, 0.5), cut.between(0.5, 1), cut.to_m], [false, true, 1], 'between heights');
  same(cut.within({min: [-9, -9, -9], max: [9, 9, 9]}), {min: [-9, -9, cut.from_m], max: [9, 9, 1]}, 'what of a box is in a height cut');
  same(new Section({middle: [1, 1, 1], half: [1, 2, 30]}).within({min: [-9, -9, -9], max: [9, 9, 9]}), {min: [0, -1, -9], max: [2, 3, 9]}, 'and in a box');
  same(cut.within({min: [0, 0, 5], max: [9, 9, 6]}), {min: [0, 0, 5], max: [9, 9, 6]}, 'nothing is in it');
  same(s.handles.map((h) => h.id).join(), 'right,left,ahead,back,top,bottom,turn,move', 'handles of a box');
  same(cut.handles.map((h) => h.id).join(), 'top,bottom', 'of a height cut');
});

test('a section leaves out only boxes that have nothing of it', () => {
  const s = new Section({middle: [0, 0, 0], half: [5, 0.1, 1], heading_deg: 45});
  const {uniform} = randomOf(3);
  let out = 0;
  for (let k = 0; k < 2000; k++) {
    const lo = [0, 1, 2].map(() => 16 * uniform() - 8), hi = lo.map((v) => v + 2 * uniform());
    if (s.meets(lo, hi, [0, 0, 0])) continue;
    out++;
    for (let j = 0; j < 20; j++) {
      const p = lo.map((v, a) => v + uniform() * (hi[a] - v));
      same(isWithin(s.relativeTo([0, 0, 0]), ...p), false, `place ${p}`);
    }
  }
  same(out > 1000, true, `${out} boxes`);
});

test('picking, in perspective and flat: the front point, and none that a section has cut', () => {
  for (const flat of [false, true]) {
    const cloud = new Cloud();
    cloud.add(batch(3, (i) => [[0, 20, 0], [0.01, -30 * flat, 0], [3, 0, 0]][i])); // flat: the second one is behind the eye
    const c = camera({flat});
    same(nearest(cloud, c, 400, 300, 8).i, 1, 'the front one');
    c.section = new Section({middle: [0, 20, 0], half: [50, 5, 50]});
    same(nearest(cloud, c, 400, 300, 8).i, 0, 'the one within the section');
    const third = c.project([3, 0, 0]);
    same(nearest(cloud, c, third.x, third.y, 8), null, 'one that is cut');
  }
});

test('a search that takes long: its point is right though its block is closed meanwhile, and none is of a cloud that was cleared', () => {
  for (const flat of [false, true]) {
    const cloud = new Cloud();
    cloud.add(batch(1000, (i) => [0.125 * (i - 500), 0, 0]));
    const steps = search(cloud, camera({flat}), 400, 300, 8);
    steps.next();
    cloud.cut(); // which changes the order of its points
    const {block, i} = ended(steps);
    same(pointOf(cloud, block, i).x, 0, 'the point in the middle');
    const again = search(cloud, camera({flat}), 400, 300, 8);
    again.next();
    cloud.clear();
    cloud.add(batch(1, () => [900, 0, 0]));
    same(ended(again), null, 'after the cloud was cleared');
  }
});

test('a turn of the wheel during a drag of a station zooms, and the station is let go all the same', () => {
  const on = {}, told = [], view = {camera: camera({elevation: -0.6}), cloud: new Cloud(), movable: true, tool: null, once: null,
    stations: new Stations(() => {}, (move) => told.push(move))};
  for (const name of ['touched', 'cameraMoved']) view[name] = () => {};
  view.pointed = {at() {}};
  view.canvas = {style: {}, tabIndex: 0, focus() {}, setPointerCapture() {}, getBoundingClientRect: () => ({left: 0, top: 0}),
    addEventListener(type, f) { on[type] = f; }};
  view.stations.set([{number: 4, x_m: 0, y_m: 0, z_m: 0, heading_deg: 0, tripod: null}]);
  new Input(view);
  const {x, y} = view.camera.project([0, 0, 0]);
  const send = (type, dx, more = {}) => on[type]({pointerId: 1, button: 0, clientX: x + dx, clientY: y, preventDefault() {}, ...more});
  send('pointerdown', 0);
  send('pointermove', 30);
  send('wheel', 30, {deltaY: -100, deltaMode: 0});
  send('pointermove', 60);
  send('pointerup', 60);
  same([view.camera.distance < 10, told.length, view.stations.dragging], [true, 1, false], 'nearer; let go');
  same(told[0].x > 0, true, 'to the right');
});

test('a handle follows the pointer along its line, and not where the line points at the eye', () => {
  const c = camera({azimuth: 0.3, elevation: -0.5});
  const p = c.project([1, 2, 2.5]);
  near(alongLine(c, [1, 2, 0.5], [0, 0, 1], p.x, p.y), 2, 1e-9, 'up by 2 m');
  const top = camera({flat: true, elevation: -Math.PI / 2});
  same(alongLine(top, [0, 0, 0], [0, 0, 1], 400, 300), null, 'up, from above');
});

// ---- measuring

const NOISE = {range_sigma_m: 0.004, range_sigma_per_m: 1e-5, range_floor_m: null, range_jitter_m: null, range_step_m: 0, place_step_m: 0,
  angle_sigma_rad: [4e-4, 7e-4], angle_step_rad: [0, 0], ball_m: 0, ball_per_m: 0, ball_factor: [1, 1, 1], ball_local: false};
const STATION = {number: 1, x_m: 100, y_m: -50, z_m: 2, heading_deg: 40, pitch_deg: 8, roll_deg: -5};

// This goes from a head's angles to the scene, by one turn after the other: roll about forward, pitch about right,
// heading about up.
function toScene(station, range, mirror, pan) {
  let [x, y, z] = [range * Math.cos(mirror) * Math.sin(pan), range * Math.cos(mirror) * Math.cos(pan), range * Math.sin(mirror)];
  const [h, p, r] = [station.heading_deg, station.pitch_deg, station.roll_deg].map(radians);
  [x, z] = [x * Math.cos(r) + z * Math.sin(r), z * Math.cos(r) - x * Math.sin(r)];
  [y, z] = [y * Math.cos(p) - z * Math.sin(p), y * Math.sin(p) + z * Math.cos(p)];
  [x, y] = [x * Math.cos(h) + y * Math.sin(h), y * Math.cos(h) - x * Math.sin(h)];
  return {x: x + station.x_m, y: y + station.y_m, z: z + station.z_m};
}
const POLAR = [[12, 0.3, 0.2], [9, -0.6, 1.4], [15, 0.9, -2]];
const pointAt = ([range, mirror, pan]) => ({...toScene(STATION, range, mirror, pan), range, amplitude: NaN, station: 1});

test('expected errors are those of points with that noise, tried 4000 times', () => {
  const {normal} = randomOf(11);
  const exact = POLAR.map((polar) => withError(pointAt(polar), STATION, NOISE));
  const tries = Array.from({length: 4000}, () => POLAR.map(([range, mirror, pan]) => ({...toScene(STATION,
    range + (NOISE.range_sigma_m + NOISE.range_sigma_per_m * range) * normal(), mirror + 4e-4 * normal(), pan + 7e-4 * normal()), error: null})));
  for (const kind of ['distance', 'height', 'angle']) {
    const {points, figures} = KINDS[kind];
    figures(exact.slice(0, points)).forEach(([name, , {error}], k) => {
      const values = tries.map((all) => figures(all.slice(0, points))[k][2].value);
      const mean = values.reduce((sum, v) => sum + v, 0) / values.length;
      const found = Math.sqrt(values.reduce((sum, v) => sum + (v - mean) ** 2, 0) / (values.length - 1));
      // The sigma of a sigma from n values is 1 / sqrt(2 n) of it, 1.1 %: five of them.
      near(found / error, 1, 0.056, `${kind}, ${name}`);
    });
  }
});

test('errors by the signal, of counts, of a ball; not known where they are not', () => {
  const along = (t, more = {}) => {
    const p = withError({...pointAt(POLAR[0]), ...more}, STATION, {...NOISE, angle_sigma_rad: [0, 0], range_sigma_m: 0, range_sigma_per_m: 0, ...t});
    const beam = [p.x - 100, p.y + 50, p.z - 2];
    return sigmaAlong(p, beam.map((v) => v / 12));
  };
  near(along({range_floor_m: 0.003, range_jitter_m: 0.04}, {amplitude: 10}), 0.005, 1e-12, 'amplitude 10: 3 mm and 4 mm');
  near(along({range_step_m: 0.001, place_step_m: 0.002}), 0.001 * Math.sqrt(5 / 12), 1e-12, 'counts, uniform');
  near(along({ball_m: 0.01, ball_per_m: 0.5}), 0.07 / Math.sqrt(5), 1e-12, 'a ball of 7 cm at 12 m');
  near(along({ball_m: 0.01, ball_factor: [2, 1, 1], ball_local: true}), 0.02 / Math.sqrt(5), 1e-12, 'a ball that is long along the beam');
  same(Number.isNaN(along({range_floor_m: 0.003, range_jitter_m: 0.04})), true, 'no amplitude');
  same(withError(pointAt(POLAR[0]), STATION, null).error, null, 'the head expects nothing');
  same(withError(pointAt(POLAR[0]), {...STATION, x_m: 103}, NOISE).error, null, 'a station that was moved since');
  same(Number.isNaN(KINDS.distance.figures([withError(pointAt(POLAR[0]), STATION, NOISE), {...pointAt(POLAR[1]), error: null}])[0][2].error), true, 'one point of two');
});

test('distances, heights and angles by hand', () => {
  const at = (x, y, z) => ({x, y, z, error: null});
  const values = (kind, ...points) => KINDS[kind].figures(points).map(([, , {value}]) => value);
  same(values('distance', at(1, 2, 3), at(4, 6, -9)), [13, 5, -12], 'distance, horizontal, vertical');
  same(values('height', at(0, 0, 1), at(5, 5, 3.5)), [2.5, 1, 3.5], 'height, from, to');
  near(values('angle', at(2, 0, 0), at(0, 0, 0), at(0, 0, 3))[0], 90, 1e-12, 'a right angle at the second point');
  near(values('angle', at(1, 0, 0), at(0, 0, 0), at(1, 1e-9, 0))[0], 5.729577951308232e-8, 1e-15, 'a small one'); // 1e-9 rad
});

test('a face: its plane, RMS and largest deviation, within its outline only', () => {
  const {uniform, normal} = randomOf(5);
  const axis = [2, -1, 2].map((v) => v / 3), u = [1, 2, 0].map((v) => v / Math.sqrt(5)), v = [-4, 2, 5].map((w) => w / Math.sqrt(45));
  const on = (a, b, d) => [0, 1, 2].map((k) => 1000 * (k + 1) + a * u[k] + b * v[k] + d * axis[k]);
  const deviations = Array.from({length: 5000}, () => 0.002 * normal());
  const cloud = new Cloud();
  const places = deviations.map((d) => on(4 * uniform() - 2, 4 * uniform() - 2, d));
  places.push(on(0.5, 0.5, -0.03), on(0.1, 0.1, 0.12), on(1.9, 1.9, 0.04)); // a dent; a thing before it; outside of the outline
  cloud.add(batch(places.length, (i) => places[i]));
  const corners = [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([a, b]) => ({...Object.fromEntries(on(a, b, 0).map((c, k) => ['xyz'[k], c])), error: [[4e-6, axis]]}));
  const found = ended(pointsOnFace(cloud, camera(), corners, 0.05));
  same(found.beyond, 1, 'the thing before it is counted, not taken');
  const flat = flatnessOf(found.places, corners, cloud.origin, on(0, 0, 5));
  near(flat.n / 5000, 0.25, 0.031, 'a quarter of the points'); // sigma sqrt(0.25 * 0.75 / 5000) = 0.0061: five of them
  near(flat.largest, -0.03, 2e-4, 'the dent, away from the head'); // the plane's own error is 2 mm / sqrt(1250)
  flat.at.forEach((c, k) => near(c, on(0.5, 0.5, -0.03)[k], 1e-4, 'its place'));
  near(flat.rms, 0.002, 3e-4, 'RMS'); // 1 / sqrt(2 * 1250) is 2 %; the dent adds 0.2 mm
  near(flat.sigma, 0.002, 1e-7, 'what the corners expect'); // the plane leans by 1e-4
  const {normal: n} = planeThrough(found.places);
  near(Math.abs(n.reduce((sum, c, k) => sum + c * axis[k], 0)), 1, 1e-6, 'its direction');
  same(flatnessOf(new Float32Array(9), corners, [0, 0, 0], [0, 0, 1]), null, 'three points are always flat');
});

test('the largest of n normal numbers', () => {
  const {normal} = randomOf(9);
  for (const n of [10, 1000]) {
    let sum = 0;
    for (let k = 0; k < 300; k++) sum += Math.max(...Array.from({length: n}, () => Math.abs(normal())));
    near(sum / 300 / largestOf(n), 1, 0.06, `of ${n}`); // the largest scatters by 0.5 / sqrt(300), 2 %; the limit is good to 3 % here
  }
});

test('how far apart points are: a grid, also where its scans are two, and none', () => {
  const cloud = new Cloud();
  cloud.add(batch(10_000, (i) => [0.01 * (i % 100), 0.01 * Math.floor(i / 100), 3]));
  near(ended(spacingAround(cloud, [0.5, 0.5, 3], 0.001)), 0.01, 0.0011, 'a grid of 10 mm'); // it takes sqrt(2 pi / 7) steps, 0.947
  same(Number.isNaN(ended(spacingAround(cloud, [90, 0, 0], 0.001))), true, 'nothing near');
});

test('figures are rounded by their errors', () => {
  same([0.0021, 0.0014, 0.02, 1.2, 30, NaN].map(decimalsOf), [3, 4, 2, 1, 0, 3], 'decimals');
  const text = (value, error, unit = 'm') => figureText(unit, {value, error}).replaceAll('\u00a0', ' ');
  same([text(-0.0001, NaN), text(-0.0004, 0.002)], ['0.000 m', '0.000 m ± 2 mm'], 'what is rounded to 0 has no sign');
  same(text(2.10432, 0.0021), '2.104 m ± 2 mm');
  same(text(2.10432, 0.00141), '2.1043 m ± 1.4 mm');
  same(text(-2.10432, 0.023), '−2.10 m ± 20 mm'); // as many figures as its error
  same(text(90.0213, 0.11, '°'), '90.02° ± 0.11°');
  same([text(2.10432, NaN), text(90.0213, NaN, '°')], ['2.104 m', '90.02°'], 'not known');
});

test('the table of points as CSV', () => {
  const p = {...pointAt(POLAR[0]), of: 'distance 1', number: 2, surface: 'Wall, "north"', spacing: 0.0123, reflectance: -3.456, scan: 4, echo: 1,
    echoes: 2, pulse: 77, t: 1.5, error: null};
  const [head, row, end] = csvOf([p]).split('\r\n');
  same(head, 'measurement,point,x_m,y_m,z_m,sigma_x_m,sigma_y_m,sigma_z_m,spacing_m,range_m,reflectance_db,amplitude_db,surface,station,scan,echo,echoes,pulse,time_s');
  same(row, `distance 1,2,${p.x.toFixed(4)},${p.y.toFixed(4)},${p.z.toFixed(4)},,,,0.0123,12.0000,-3.46,,"Wall, ""north""",1,4,1,2,77,1.500000`);
  same(end, '', 'the last line ends');
});

// ---- panoramas

test('a panorama: points at their angles, the nearest of each direction, other stations left out', () => {
  const cloud = new Cloud();
  const polar = [];
  for (let e = -30; e <= 40; e += 2) for (let a = -180; a < 180; a += 2) polar.push([7, radians(e), radians(a)]);
  polar.push([3, radians(10), radians(50)], [9, radians(10), radians(50)]); // before and behind the one at 7 m
  const places = polar.map((p) => placeOf(toScene(STATION, ...p)));
  cloud.add(batch(places.length, (i) => places[i]));
  cloud.add(batch(5, () => placeOf(toScene(STATION, 1, 0, 0)), {station: 2}));
  const panorama = ended(new Panorama(cloud, STATION).make());
  same(panorama.n, polar.length, 'points');
  for (const [range, e, a] of [[7, 0, 0], [3, 10, 50], [7, -30, -180], [7, 40, 178]]) {
    const angles = panorama.anglesOf(placeOf(toScene(STATION, range, radians(e), radians(a))));
    near(angles[0], radians(a), 1e-9, 'azimuth'); // -180 degrees are found as such
    near(angles[1], radians(e), 1e-9, 'elevation');
    const [x, y] = panorama.shareOf(angles);
    const {block, i} = panorama.pointAt(Math.min(panorama.width - 1, Math.floor(x * panorama.width)), Math.min(panorama.height - 1, Math.floor(y * panorama.height)));
    const p = pointOf(cloud, block, i);
    // A pixel is 360 degrees / width: the point is in that pixel, or the one beside it (rounding at its edge).
    const [az, el, r] = panorama.anglesOf(placeOf(p));
    near(r, range, 1e-5, `range at ${a}`);
    near(az, radians(a), panorama.span[0] / panorama.width, 'its azimuth');
    near(el, radians(e), panorama.span[1] / panorama.height, 'its elevation');
  }
  const {pixels, limits} = panorama.colours('label');
  same([pixels.length, limits], [4 * panorama.width * panorama.height, null], 'colours of labels');
  near(panorama.colours('range').limits[0], 7, 0.2, 'limits of the range');
  const filled = pixels.filter((v, i) => i % 4 === 3 && v === 255).length;
  same(filled > 0.95 * pixels.length / 4, true, `${filled} of ${pixels.length / 4} pixels have a colour`);
  same(panorama.isOld(cloud, null), false, 'nothing has come');
  cloud.add(batch(1, () => placeOf(toScene(STATION, 5, 0, 0)), {scan: 2}));
  same(panorama.isOld(cloud, null), true, 'a point has come');
});

test('a panorama and the time line, a section, another cloud: only what is shown, and no point of what was cleared', () => {
  const cloud = new Cloud();
  const places = Array.from({length: 90}, (_, i) => placeOf(toScene(STATION, 7, 0, radians(i))));
  cloud.add(batch(places.length, (i) => places[i], {t: Float32Array.from(places, (_, i) => i)}));
  const all = ended(new Panorama(cloud, STATION).make());
  const low = new Section({kind: 'height', middle: [0, 0, -1e3], half: [1, 1, 1]});
  same(ended(new Panorama(cloud, STATION, low).make()).n, 0, 'nothing is in the section');
  same([all.isOld(cloud, null), all.isOld(cloud, low), all.isOld(new Cloud(), null)], [false, true, true], 'a section, another cloud');
  cloud.window = {from: 10, to: 19.5};
  same(all.isOld(cloud, null), true, 'other times');
  same(ended(new Panorama(cloud, STATION).make()).n, 10, 'points of these times');
  cloud.clear();
  cloud.add(batch(1, () => [900, 0, 0]));
  same([all.isOld(cloud, null), all.pointAt(0, 0)], [true, null], 'the cloud was cleared');
});

test('flatness and spacing are of the points that the time line shows', () => {
  const cloud = new Cloud();
  const grid = (z, t, scan) => batch(900, (i) => [0.1 * (i % 30), 0.1 * Math.floor(i / 30), z], {t: new Float32Array(900).fill(t), scan});
  cloud.add(grid(0, 1, 1));
  cloud.add(grid(0.004, 5, 1));
  const corners = [[0.45, 0.45], [2.45, 0.45], [2.45, 2.45], [0.45, 2.45]].map(([x, y]) => ({x, y, z: 0, error: null}));
  const both = ended(pointsOnFace(cloud, camera(), corners, 0.05)).places.length / 3;
  const near2 = ended(spacingAround(cloud, [1.5, 1.5, 0], 0.5));
  cloud.window = {from: 0, to: 2};
  same(ended(pointsOnFace(cloud, camera(), corners, 0.05)).places.length / 3, both / 2, 'half of the points');
  same(ended(spacingAround(cloud, [1.5, 1.5, 0], 0.5)) > 1.2 * near2, true, 'points are further apart'); // by the root of 2
});

test('a cloud that is cleared while it is measured gives no figures', () => {
  const cleared = (steps) => {
    const cloud = new Cloud();
    for (const station of [1, 2]) cloud.add(batch(900, (i) => [0.1 * (i % 30), 0.1 * Math.floor(i / 30), 0], {station}));
    const own = steps(cloud);
    own.next();
    cloud.clear();
    cloud.add(batch(900, (i) => [900 + 0.1 * (i % 30), 0.1 * Math.floor(i / 30), 0]));
    return ended(own);
  };
  const corners = [[0.45, 0.45], [2.45, 0.45], [2.45, 2.45], [0.45, 2.45]].map(([x, y]) => ({x, y, z: 0, error: null}));
  same(cleared((cloud) => pointsOnFace(cloud, camera(), corners, 0.05)).places.length, 0, 'points on a face');
  same(Number.isNaN(cleared((cloud) => spacingAround(cloud, [1.5, 1.5, 0], 0.001))), true, 'distance of points');
  same(ended(pointsOnFace(new Cloud(), camera(), corners, 0.05)).places.length, 0, 'no points at all');
  same(Number.isNaN(ended(spacingAround(new Cloud(), [0, 0, 0], 0.001))), true, 'distance of none');
});

test('a pixel at the side of a panorama has no neighbour at the other side', () => {
  const cloud = new Cloud();
  const places = [];
  for (let a = -60; a <= 60; a += 0.5) {
    for (let e = -30; e <= 30; e += 0.5) if (a > -59.3 || Math.abs(e) > 2) places.push(placeOf(toScene(STATION, 7, radians(e), radians(a))));
  }
  cloud.add(batch(places.length, (i) => places[i]));
  const panorama = ended(new Panorama(cloud, STATION).make()), {width, height} = panorama;
  same(120 / width > 0.71 && 120 / width < 1.2, true, `${width} pixels: only the first one of a row has none of the points left out`);
  const [, share] = panorama.shareOf([0, 0]), y = Math.floor(share * height);
  same([panorama.pointAt(0, y), panorama.pointAt(1, y) !== null, panorama.pointAt(width - 1, y - 1) !== null], [null, true, true], 'pixels');
});

test('pixels of a panorama are wider where lines are further apart than the points in them', () => {
  const cloud = new Cloud();
  const places = [];
  for (let a = -60; a < 60; a += 3) for (let e = -30; e <= 30; e += 0.25) places.push(placeOf(toScene(STATION, 7, radians(e), radians(a))));
  cloud.add(batch(places.length, (i) => places[i]));
  const panorama = ended(new Panorama(cloud, STATION).make());
  const degrees = panorama.span.map((v, k) => v * 180 / Math.PI / [panorama.width, panorama.height][k]);
  same(degrees[0] / degrees[1] > 3.9, true, `pixels of ${degrees} degrees`); // 3 and 0.25 degrees: 12 times; the shapes are 1, 2, 4, 8
});

await runTests();
