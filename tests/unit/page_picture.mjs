/* SPDX-License-Identifier: MIT */
// This file tests the pure parts of the page's picture (drivers/link/web): the stored points and their order, the
// camera, colours and limits, picking, dragging, levels of detail, the scene's bytes. It prints TAP on standard output.
import {isWithin, Section} from '../../drivers/link/web/section.js';
import {boxAround, boxOf} from '../../drivers/link/web/view_limits.js';
import {Cloud, BLOCK, evenOrder, nearestTo, pointOf} from '../../drivers/link/web/cloud.js';
import {FAR_M, NEAR_M, arrowStep, depthOf, headingTo, onPlane, radians, roundBelow, split} from '../../drivers/link/web/view_camera.js';
import {NONE, legendOf, rampAt, robustLimits, sampleOf, ticks, valuesOf, widened} from '../../drivers/link/web/view_colours.js';
import {SCALES} from '../../drivers/link/web/view_ramps.js';
import {nearest} from '../../drivers/link/web/view_pick.js';
import {Budget, restShares, shares} from '../../drivers/link/web/view_draw.js';
import {Stations, inScene} from '../../drivers/link/web/view_stations.js';
import {featureEdges, legsMesh, parseScene} from '../../drivers/link/web/view_mesh.js';
import {runTests, test} from './page_tap.mjs';
import './page_keeper.mjs';
import {batch, camera, near, same, throws} from './page_rig.mjs';

test('the oldest points go, whole blocks, and not below the capacity', () => {
  const cloud = new Cloud({capacity: 100_000});
  for (let k = 0; k < 5; k++) cloud.add(batch(50_000, (i) => [k, i, 0], {pulse0: 50_000 * k}));
  same(cloud.total, 250_000, 'total');
  same([cloud.gone, cloud.count], [131_072, 118_928], 'gone and count'); // two blocks of 65,536 are gone
  same(cloud.bounds.min[0], 2, 'bounds of those held'); // the 131,073rd point is of the third batch
  cloud.clear();
  same([cloud.total, cloud.count, cloud.bounds, cloud.origin], [0, 0, null, null], 'cleared');
});

test('the point nearest to a place is found within reach, in any block', () => {
  const cloud = new Cloud();
  same(nearestTo(cloud, [0, 0, 0], 1), null, 'no points');
  cloud.add(batch(1000, (i) => [500_000 + i / 128, 5_600_000, 110]));
  cloud.add(batch(5, (i) => [500_001, 5_600_000, 200 + i], {station: 2}));
  same(nearestTo(cloud, [500_002 + 1 / 1024, 5_600_000, 110], 1e-3).x, 500_002, 'the nearer one');
  const {station, z} = nearestTo(cloud, [500_001, 5_600_000, 203.0004], 1e-3);
  same([station, z], [2, 203], 'of the other station');
  same(nearestTo(cloud, [500_002 + 1 / 256, 5_600_000, 110], 1e-3), null, 'between two points, out of reach of both');
  same(nearestTo(cloud, [500_002, 5_600_000, 110.002], 1e-3), null, 'beyond all');
});

test('a point keeps its figures through closing, in blocks of their own by station and scan', () => {
  const cloud = new Cloud();
  const b = batch(BLOCK + 10, (i) => [500_000 + i / 4096, 5_600_000 - i / 4096, 110], {pulse0: 2 ** 40});
  b.reflectance[7] = -3.5;
  cloud.add(b);
  cloud.add(batch(5, () => [1, 2, 3], {station: 2}));
  same(cloud.blocks.map((x) => [x.n, x.station, x.closed]), [[BLOCK, 1, true], [10, 1, true], [5, 2, false]], 'blocks');
  const [first] = cloud.blocks;
  same([...first.order].sort((p, q) => p - q).every((v, i) => v === i), true, 'a permutation');
  const at = first.order.indexOf(7);
  const p = pointOf(cloud, first, at);
  same([p.x, p.y, p.z, p.pulse, p.range, p.reflectance, p.echo, p.echoes],
    [500_000 + 7 / 4096, 5_600_000 - 7 / 4096, 110, 2 ** 40 + 7, 7, -3.5, 1, 1], 'point 7');
  same([pointOf(cloud, first, at).amplitude, first.amplitude], [NaN, null], 'not modelled: no array');
});

test('pulses further apart than 32 bits begin a block', () => {
  const cloud = new Cloud();
  cloud.add(batch(1, () => [0, 0, 0], {pulse0: 0}));
  cloud.add(batch(1, () => [0, 0, 0], {pulse0: 2 ** 33}));
  same(cloud.blocks.map((b) => b.pulse0), [0, 2 ** 33], 'blocks');
});

test('a prefix of a block is spread evenly: one point of each stretch', () => {
  for (const k of [64, 512, 4096]) {
    const stretches = new Set(evenOrder(BLOCK).slice(0, k));
    const met = new Set([...stretches].map((i) => Math.floor(i * k / BLOCK)));
    same(met.size, k, `stretches of ${BLOCK / k}`);
  }
  // Every 512th point of lines with 512 points is one column. The places of evenOrder within lines are random: of 128
  // points in 512 places, 512 (1 - (1 - 1/512)^128) = 113.3 differ, sigma 3.4 (occupancy): above 95 by five sigma.
  const columns = new Set([...evenOrder(BLOCK).slice(0, 128)].map((i) => i % 512));
  same(columns.size > 95, true, `${columns.size} columns`);
  same(new Set(evenOrder(1000)).size, 1000, 'a part of a block');
});

test('far from the origin: floats of coordinates jump, the cloud\'s do not', () => {
  const at = [500_000, 5_600_000, 110], step = 0.001;
  const cloud = new Cloud();
  cloud.add(batch(1000, (i) => [at[0] + 300, at[1] + 200 + step * i, at[2]]));
  let ours = 0, naive = 0;
  for (let i = 0; i < 1000; i++) {
    const y = at[1] + 200 + step * i;
    ours = Math.max(ours, Math.abs(cloud.blocks[0].position[3 * i + 1] + cloud.origin[1] - y));
    naive = Math.max(naive, Math.abs(Math.fround(y) - y));
  }
  near(ours, 0, 2 ** -24, 'ours'); // it is an ulp of a float below 1 m
  same(naive > 0.2, true, `naive: ${naive}`); // half an ulp of 5.6e6 is 0.25 m
});

test('the eye in two floats: what it sees moves as it does', () => {
  // The eye is 5 cm before a point, 900 m from the origin, and moves 1,000 times by 1 um. Float's ulp there is 61 um.
  const p = Math.fround(900.05);
  let ours = 0, naive = 0;
  for (let i = 0; i < 1000; i++) {
    const eye = 900 + 1e-6 * i;
    const {hi, lo} = split([eye, 0, 0]);
    ours = Math.max(ours, Math.abs(Math.fround(Math.fround(p - hi[0]) - lo[0]) - (p - eye)));
    naive = Math.max(naive, Math.abs(Math.fround(p - Math.fround(eye)) - (p - eye)));
  }
  near(ours, 0, 4e-9, 'ours'); // an ulp of 0.05 m is 3.7e-9
  same(naive > 2e-5, true, `naive: ${naive}`); // up to half of 61 um
});

test('depth: a millimetre and a kilometre in one picture', () => {
  const step = 2 ** -24; // it is that of the depth buffer
  same([depthOf(NEAR_M), depthOf(FAR_M)], [0, 1], 'ends');
  for (const [w, apart] of [[0.002, 2e-8], [1, 2e-6], [1000, 2e-3]]) {
    same(depthOf(w + apart) - depthOf(w) > step, true, `${apart} m at ${w} m`);
  }
  // The usual depth, f (w - n) / (w (f - n)), with the same ends does not tell 1 km from 10 km.
  const usual = (w) => FAR_M * (w - NEAR_M) / (w * (FAR_M - NEAR_M));
  same(usual(10_000) - usual(1000) < 16 * step, true, 'the usual one');
});

test('projecting and back, at UTM coordinates', () => {
  const c = camera({target: [500_000, 5_600_000, 110], azimuth: 2.2, elevation: -0.7, distance: 35});
  for (const [x, y, w] of [[0, 0, 3], [800, 10, 50], [411, 333, 35]]) {
    const p = c.project(c.at(x, y, w));
    near(p.x, x, 1e-4, 'x'); // 1e-9 m (an ulp at 5.6e6) at 3 m is 2e-7 px
    near(p.y, y, 1e-4, 'y');
    near(p.w, w, 1e-6, 'w');
  }
  const right = camera().project([1, 0, 0]), up = camera().project([0, 0, 1]);
  same([right.x > 400, Math.abs(right.y - 300) < 1e-9, up.y < 300], [true, true, true], 'looking north: east is right, z up');
});

test('what a gesture holds stays under the pointer', () => {
  const c = camera({azimuth: 0.5, elevation: -0.4});
  const held = c.at(200, 150, 7);
  const stays = (x, y, what) => {
    const p = c.project(held);
    near(p.x, x, 1e-6, `${what}, x`);
    near(p.y, y, 1e-6, `${what}, y`);
  };
  c.zoom(0.6, held);
  stays(200, 150, 'zoom');
  c.orbit(held, 0.4, -0.2);
  stays(200, 150, 'orbit');
  c.pan(30, -20, c.project(held).w);
  stays(230, 130, 'pan');
  const {eye} = c;
  c.lookFrom(eye, 1);
  c.turn(0.7, 0.1);
  c.zoom(0.5);
  c.eye.forEach((v, a) => near(v, eye[a], 1e-9, 'looking round: the eye'));
});

test('a box is left out only where nothing of it is in sight', () => {
  const c = camera(); // the eye is at y = -10, looking north
  const sees = (lo, hi) => c.sees(lo, hi, [0, 0, 0]);
  same([sees([-1, -1, -1], [1, 1, 1]), sees([-1, -30, -1], [1, -20, 1]), sees([50, -1, -1], [60, 1, 1]), sees([-99, -99, -99], [99, 99, 99])],
    [true, false, false, true], 'before, behind, beside, around');
});

test('picking: the nearer of two under the pointer, and none beside them', () => {
  const cloud = new Cloud();
  cloud.add(batch(3, (i) => [[0, 20, 0], [0.01, 0, 0], [3, 0, 0]][i])); // they are 30 m, 10 m and 10 m away
  const c = camera();
  same(nearest(cloud, c, 400, 300, 8).i, 1, 'the front one'); // it is 0.6 px beside the pointer
  const third = c.project([3, 0, 0]);
  same(nearest(cloud, c, third.x + 2, third.y, 8).i, 2, 'at the side');
  same(nearest(cloud, c, third.x, third.y + 40, 8), null, 'nothing');
  same(nearest(new Cloud(), c, 1, 1, 8), null, 'an empty cloud');
});

test('limits: robust, and the same while points come unless they miss much', () => {
  const values = Array.from({length: 1001}, (_, i) => i / 100).concat([1e6, -1e6]);
  const [lo, hi] = robustLimits(values); // percentiles 1 and 99: 0.1 and 9.9; 2 % of 9.8 is added
  near(lo, 0.1 - 0.196, 0.03, 'lo');
  near(hi, 9.9 + 0.196, 0.03, 'hi');
  same(robustLimits([]), null, 'of none');
  const [low, high] = robustLimits([2 - 5e-7, 2, 2 + 5e-7], 0.01);
  near(low, 1.995, 1e-6, 'rounding is not shown: limits are apart as far as wanted'); // these are 2 -+ half of 0.01
  near(high, 2.005, 1e-6, 'its other end');
  same(widened([0, 10], [-0.5, 10.9]), [0, 10], 'within a tenth');
  same(widened([0, 10], [3, 15]), [0, 15], 'more');
});

// 16 beams fire in turn, at heights of 0 to 3 m, while their head turns about (0, 0, 0).
const BEAMS = (n) => batch(n, (i) => [5 * Math.cos(i / 999), 5 * Math.sin(i / 999), 0.2 * (i % 16)]);

test('a sample of an open block has all beams, whatever the number of points', () => {
  for (const n of [1003, 16_000, 20_000, 28_939, 48_000]) {
    const cloud = new Cloud();
    cloud.add(BEAMS(n));
    same(new Set(sampleOf(cloud, 'height', 1000)).size, 16, `heights of ${n} points`);
  }
});

test('all points are in the box of a section; a view of everything leaves out stray ones alone', () => {
  const no = {bounds: () => null};
  const boxes = (n, place) => {
    const cloud = new Cloud();
    const all = BEAMS(20_000);
    for (let i = 0; i < n; i++) [all.x[i], all.y[i], all.z[i]] = place(i);
    cloud.add(all);
    return [boxAround(cloud, [], no), boxOf(cloud, [], no)];
  };
  // Without the 1 % the box is 10 m x 10 m x 3 m, with a diagonal of 14.5 m. So a mast of 15 m is no stray point.
  for (const box of boxes(120, (i) => [0, 0, (i + 1) / 8])) near(box.max[2], 15, 1e-6, 'a mast of 120 points');
  const [all, view] = boxes(5, (i) => [0, 0, -100 - i]);
  near(all.min[2], -104, 1e-6, 'five points below the ground are in the box of a section');
  near(view.min[2], 0, 0.1, 'and not in the view'); // the limits are 2 % of the height wider
  const section = Section.around(all, 'box').relativeTo([0, 0, 0]);
  same([-104, 3].map((z) => isWithin(section, 0, 0, z)), [true, true], 'the section around them');
  const cut = Section.around(all, 'height', view).relativeTo([0, 0, 0]); // at two thirds of 3 m
  same([-104, 1.9, 2.1].map((z) => isWithin(cut, 0, 0, z)), [true, true, false], 'a cut of the heights without them');
  near(boxOf({count: 600, bounds: null, blocks: []}, [{x_m: 1, y_m: 2, z_m: 3}], no).max[0], 6, 0, 'no point has a place');
});

test('colours: ends of a ramp, NaN, ticks, legend', () => {
  const [low, high] = [rampAt('spectrum', 0), rampAt('spectrum', 1)]; // low is blue, high is red, as in files (core/colour.h)
  same([low[2] > Math.max(low[0], low[1]), high[0] > Math.max(high[1], high[2])], [true, true], 'blue and red');
  same([rampAt('ember', -1), rampAt('ember', 9)], [[47, 59, 102], [255, 209, 102]], 'ends'); // #2f3b66, #ffd166
  const cloud = new Cloud();
  const b = batch(2, () => [0, 0, 0]);
  b.amplitude[1] = 12;
  cloud.add(b);
  same([...valuesOf(cloud.blocks[0], 'amplitude', 0, 2)], [Math.fround(NONE), 12], 'NaN has a number of its own');
  same([...valuesOf(cloud.blocks[0], 'reflectance', 0, 2)], [NONE, NONE].map(Math.fround), 'not modelled at all');
  same(ticks([-0.13, 3.31]).map((t) => t.text), ['0', '1', '2', '3'], 'ticks');
  same(ticks([0, 2]).map((t) => t.text), ['0.0', '0.5', '1.0', '1.5', '2.0'], 'ticks at both limits');
  same(ticks([5, 5 + 2 ** -50]).length <= 7, true, 'ticks of limits that are almost equal: their numbers are above 2^53');
  same(ticks([0, 1e-200])[0].text, (0).toFixed(100), 'ticks of limits by hand');
  const echoes = {n: 4, echo: Uint8Array.from([0x11, 0x31, 0x32, 0x33])}; // these are count and number
  same([...valuesOf(echoes, 'echo', 0, 4)], [0, 1, 2, 3], 'only echo, first, between, last');
  const legend = legendOf('height', {limits: [-1, 1], offset: 110});
  same([legend.from, legend.to, legend.unit, legend.stops.length], [109, 111, 'm', 17], 'height');
  same(legendOf('label', {limits: null, sample: [3, 5, 5]}).items.map((i) => i.label), [5, 3], 'the most frequent first');
  same(sampleOf(cloud, 'reflectance'), [], 'what is not modelled is no number');
  for (const mode of ['reflectance', 'label']) same(legendOf(mode, {limits: null}).from, 'not known', mode);
  same([legendOf('rgb', {limits: null}), legendOf('rgb', {limits: null, hasColours: false}).from], [null, 'not known'], 'rgb');
});

test('dragging: places on a plane, also where the ray misses it; headings; keys', () => {
  const c = camera({target: [0, 0, 0], elevation: -0.6});
  const p = c.project([1.5, 2, 1]);
  onPlane(c, p.x, p.y, 1, 1000).forEach((v, a) => near(v, [1.5, 2, 1][a], 1e-9, 'on the plane'));
  const sky = onPlane(c, 400, -2000, 1, 50);
  near(Math.hypot(sky[0] - c.eye[0], sky[1] - c.eye[1]), 50, 1e-9, 'above the horizon: the reach');
  near(headingTo([0, 0], [1, 1]), 45, 1e-12, 'north-east');
  near(headingTo([0, 0], [-1, 0]), 270, 1e-12, 'west');
  same([arrowStep(camera(), 'ArrowUp', 0.1), arrowStep(camera({azimuth: radians(100)}), 'ArrowUp', 1)], [[0, 0.1], [1, 0]], 'away from the eye');
  same([1, 0.3, 7, 50].map(roundBelow), [1, 0.2, 5, 50], 'round lengths');
});

test('a station that is dragged tells where it is, once it is let go', () => {
  const told = [];
  const stations = new Stations(() => {}, (m) => told.push(m));
  stations.set([{number: 4, name: 'a', x_m: 0, y_m: 0, z_m: 0, heading_deg: 10, tripod: null}]);
  const c = camera({elevation: -0.6});
  const from = c.project([0, 0, 0]), to = c.project([1, 0.5, 0]);
  const hit = stations.hit(c, from.x + 3, from.y);
  same(hit, {number: 4, what: 'move'}, 'hit');
  stations.grab(hit, from.x, from.y);
  stations.drag(c, from.x + 9, from.y);
  stations.drag(c, to.x, to.y);
  same(told.length, 0, 'not before');
  stations.drop();
  near(told[0].x, 1, 1e-9, 'x');
  near(told[0].y, 0.5, 1e-9, 'y');
  same([told[0].station, told[0].z, told[0].heading_deg, stations.pending], [4, 0, 10, true], 'the rest');
  stations.set(stations.list); // it is refused, so all is as before
  same(stations.placeOf(stations.list[0]).at, [0, 0, 0], 'back');
});

test('Esc takes a drag back, also for whoever follows it, and further moves of the pointer do nothing', () => {
  const told = [], followed = [];
  const stations = new Stations(() => {}, (m) => told.push(m));
  stations.set([{number: 4, name: 'a', x_m: 0, y_m: 0, z_m: 0, heading_deg: 10, tripod: null}]);
  stations.dragged = ({x, y, heading_deg}) => followed.push([x, y, heading_deg]);
  const c = camera({elevation: -0.6});
  const from = c.project([0, 0, 0]), to = c.project([1, 0.5, 0]);
  stations.grab({number: 4, what: 'move'}, from.x, from.y);
  stations.drag(c, to.x, to.y);
  stations.key(c, 'Escape', false);
  stations.drag(c, to.x + 20, to.y);
  stations.drop();
  same([followed.length, followed.at(-1), told, stations.dragging], [2, [0, 0, 10], [], false], 'taken back');
  same(stations.placeOf(stations.list[0]).at, [0, 0, 0], 'where it is drawn');
});

test('outlines of fields: right, forward and up of a head that is turned', () => {
  const place = {at: [10, 20, 1], heading_deg: 90};
  const points = (station, corners) => inScene(place, station, corners).flat();
  points({}, [0, 2, 3, 0]).forEach((v, i) => near(v, [12, 20, 1, 10, 17, 1][i], 1e-12, 'east and south'));
  points({pitch_deg: 90}, [0, 2, 3, 0]).forEach((v, i) => near(v, [10, 20, 3, 10, 17, 1][i], 1e-12, 'forward rises'));
  points({roll_deg: 90}, [0, 2, 3, 0]).forEach((v, i) => near(v, [12, 20, 1, 10, 20, -2][i], 1e-12, 'right sinks'));
  // by the roll the right sinks; by the pitch the head's down points forward, which is east
  points({pitch_deg: 90, roll_deg: 90}, [3, 0]).forEach((v, i) => near(v, [13, 20, 1][i], 1e-12, 'both'));
});

test('a station that is grabbed beside its middle does not jump; keys turn it', () => {
  const stations = new Stations(() => {}, () => {});
  stations.set([{number: 4, name: 'a', x_m: 0, y_m: 0, z_m: 0, heading_deg: 10, tripod: null}]);
  const c = camera({elevation: -0.6});
  const from = c.project([0, 0, 0]), to = c.project([1, 0.5, 0]);
  stations.grab({number: 4, what: 'move'}, from.x + 6, from.y);
  stations.drag(c, from.x + 20, from.y);
  stations.drag(c, to.x + 6, to.y);
  near(stations.moved.x, 1, 0.02, 'x'); // 6 pixels are 0.09 m here; half a metre further on they differ by a tenth
  near(stations.moved.y, 0.5, 0.02, 'y');
  stations.drop(true);
  stations.select(4);
  for (const [key, heading] of [[']', 15], ['[', 10], ['}', 55], ['{', 10]]) {
    stations.key(c, key, false);
    near(stations.moved.heading_deg, heading, 1e-9, `after ${key}`);
  }
  stations.letGo(); // and no timer is left
});

// ---- colour scales

const linear = (v) => (v / 255 <= 0.04045 ? v / 255 / 12.92 : ((v / 255 + 0.055) / 1.055) ** 2.4);
// CIELAB of sRGB (D65), another measure of lightness and differences than the one by which the scales were made.
function lab(rgb) {
  const [r, g, b] = rgb;
  const f = (t) => (t > 216 / 24389 ? Math.cbrt(t) : (24389 / 27 * t + 16) / 116);
  const [x, y, z] = [(0.4124564 * r + 0.3575761 * g + 0.1804375 * b) / 0.95047, 0.2126729 * r + 0.7151522 * g + 0.072175 * b,
    (0.0193339 * r + 0.119192 * g + 0.9503041 * b) / 1.08883].map(f);
  return [116 * y - 16, 500 * (x - y), 200 * (y - z)];
}
// Matrices give the colours as people see them who lack a kind of cones (Machado, Oliveira and Fernandes 2009, severity
// 1, in linear light).
const SIGHTS = {
  all: [1, 0, 0, 0, 1, 0, 0, 0, 1],
  protan: [0.152286, 1.052583, -0.204868, 0.114503, 0.786281, 0.099216, -0.003882, -0.048116, 1.051998],
  deutan: [0.367322, 0.860646, -0.227968, 0.280085, 0.672501, 0.047413, -0.01182, 0.04294, 0.968881],
  tritan: [1.255528, -0.076749, -0.178779, -0.078411, 0.930809, 0.147602, 0.004733, 0.691367, 0.3039],
};
const seenBy = (m, rgb) => [0, 3, 6].map((k) => Math.min(1, Math.max(0, m[k] * rgb[0] + m[k + 1] * rgb[1] + m[k + 2] * rgb[2])));

test('the even scales: every step is brighter, also for the colour-blind, and steps are alike', () => {
  for (const scale of ['even', 'blue', 'grey']) {
    for (const [sight, m] of Object.entries(SIGHTS)) {
      const all = Array.from({length: 17}, (_, i) => lab(seenBy(m, rampAt(scale, i / 16).map(linear))));
      const steps = all.slice(1).map((c, i) => Math.hypot(...c.map((v, k) => v - all[i][k])));
      const rises = all.slice(1).map((c, i) => c[0] - all[i][0]);
      same(rises.every((rise) => rise > 1.5), true, `${scale}, ${sight}: lightness rises by ${rises.map((v) => v.toFixed(1))}`);
      // A difference of 2.3 is just seen (Mahy 1994).
      same(Math.min(...steps) > 2.3, true, `${scale}, ${sight}: steps of ${steps.map((v) => v.toFixed(1))}`);
    }
  }
  // The usual scale of heights fails here: to eyes without the green cones its lightness does not always rise.
  const usual = Array.from({length: 17}, (_, i) => lab(seenBy(SIGHTS.deutan, rampAt('spectrum', i / 16).map(linear)))[0]);
  same(usual.slice(1).every((v, i) => v > usual[i]), false, 'spectrum');
});

test('low is blue or dark and high is red or bright on every scale, and none is cut by the gamut', () => {
  for (const [scale] of SCALES.filter(([name]) => name !== 'usual')) {
    const [low, high] = [0, 1].map((f) => lab(rampAt(scale, f).map(linear))[0]);
    same(low < 40 && high > 85, true, `${scale}: lightness ${low} to ${high}`);
    for (let f = 0.02; f < 0.99; f += 0.02) same(rampAt(scale, f).every((v) => v > 0 && v < 255), true, `${scale} at ${f}`);
  }
  const [r, , b] = rampAt('spectrum', 0), [red, , blue] = rampAt('spectrum', 1);
  same([b > 2 * r, red > 2 * blue], [true, true], 'spectrum');
  same([rampAt('grey', 0), rampAt('grey', 1)], [[0, 0, 0], [255, 255, 255]], 'grey as of files');
});

test('limits leave out the share that is asked for', () => {
  const values = Array.from({length: 1001}, (_, i) => i);
  for (const [share, lo, hi] of [[0, 0, 1000], [0.01, 10, 990], [0.05, 50, 950]]) { // and 2 % of the rest at each end
    same(robustLimits(values, 0, share), [lo - 0.02 * (hi - lo), hi + 0.02 * (hi - lo)], `${share}`);
  }
});

// ---- times

test('only points within the window of times are found, of scans that began at different times', () => {
  const cloud = new Cloud();
  const first = Object.assign(batch(10, (i) => [i, 0, 0]), {began_s: 100});
  const second = Object.assign(batch(10, (i) => [i, 0, 0.01], {scan: 2, station: 2}), {began_s: 200});
  for (const b of [first, second]) b.t.forEach((_, i) => { b.t[i] = i; });
  cloud.add(first);
  cloud.add(second);
  near(cloud.latest_s, 209, 1e-9, 'the newest');
  same(cloud.blocks.map(({span}) => [span.from, span.to]), [[0, 9], [0, 9]], 'spans');
  const c = camera({target: [5, 0, 0], distance: 10});
  const at = c.project([5, 0, 0]);
  const found = (window) => {
    cloud.window = window;
    const it = nearest(cloud, c, at.x, at.y, 8);
    return it && [it.block.station, it.block.t[it.i]];
  };
  same(found({from: 104.5, to: 105.5}), [1, 5], 'a second of the first scan');
  same(found({from: 204.5, to: 205.5}), [2, 5], 'of the second');
  same(found({from: 206, to: Infinity}), null, 'later ones are elsewhere');
  same(found({from: 300, to: Infinity}), null, 'none');
  same(found(null) !== null, true, 'all');
});

test('a batch of the past does not make the newest point', () => {
  const cloud = new Cloud();
  cloud.add(Object.assign(batch(2, () => [0, 0, 0]), {began_s: 100}));
  cloud.add(Object.assign(batch(2, () => [0, 0, 0], {scan: 2}), {began_s: 50, past: true}));
  near(cloud.latest_s, 100, 1e-9, 'the newest');
});

// ---- levels of detail, tripods, the scene

test('levels of detail: equal shares; the budget follows the time', () => {
  const parts = [{n: 1000, drawn: 0, weight: 1}, {n: 100, drawn: 0, weight: 1}, {n: 500, drawn: 0, weight: 1, skip: true}];
  same(shares(parts, 110), [100, 10, 0], 'a tenth of each in sight');
  same(shares(parts, 1e9), [1000, 100, 0], 'all');
  parts[1].whole = true;
  same(restShares(parts, 110), [100, 100, 0], 'at rest: an open block comes at once');
  same(restShares([{n: 500_000, drawn: 450_000, weight: 1}, {n: 9, drawn: 0, weight: 1}], 50_004), [500_000, 4], 'then in turn');
  const budget = new Budget(50, 100_000);
  budget.took(100, 100_000);
  same(budget.points, 50_000, 'twice too slow');
  budget.took(10, 1000);
  same(budget.points, 50_000, 'too few points to say');
});

test('a tripod: its feet stand on the ground, the first towards north', () => {
  // The head 1.6 m above the ground, 0.2 m of it above the tripod's top: legs of 1.8 m reach out sqrt(1.8^2 - 1.4^2).
  const {positions: p} = legsMesh({leg_m: 1.8, foot_radius_m: Math.sqrt(1.8 ** 2 - 1.4 ** 2), height_m: 1.4, head_above_m: 0.2});
  const of = (axis) => Array.from({length: p.length / 3}, (_, i) => p[3 * i + axis]);
  near(Math.min(...of(2)), -1.6, 0.014, 'feet'); // this is half a leg's thickness at its end
  near(Math.max(...of(2)), -0.2, 0.024, 'top');
  near(Math.max(...of(1)), Math.sqrt(1.8 ** 2 - 1.4 ** 2), 0.014, 'the first foot');
});

test('the scene\'s bytes, good and bad; its edges', () => {
  const positions = [0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 0, 0, 1];
  const triangles = [0, 1, 2, 0, 2, 3, 0, 1, 4]; // it is a square of two, and one that stands on its side
  const make = (n = 40 + 60 + 36) => {
    const bytes = new ArrayBuffer(n), v = new DataView(bytes);
    [0x43534853, 1, 5, 3].forEach((u, i) => v.setUint32(4 * i, u, true));
    [5e5, 5.6e6, 9].forEach((d, i) => v.setFloat64(16 + 8 * i, d, true));
    new Float32Array(bytes, 40, 15).set(positions);
    new Uint32Array(bytes, 100, 9).set(triangles);
    return v;
  };
  const scene = parseScene(make().buffer);
  same([scene.origin, [...scene.positions], [...scene.triangles]], [[5e5, 5.6e6, 9], positions, triangles], 'scene');
  throws(() => parseScene(new ArrayBuffer(3)), '3 bytes');
  throws(() => parseScene(make(140)), '136 expected');
  const bad = make();
  bad.setUint32(100, 5, true);
  throws(() => parseScene(bad), 'beyond its 5 vertices');
  bad.setUint32(0, 1, true);
  throws(() => parseScene(bad), 'SHSC');
  const edges = featureEdges(scene.positions, scene.triangles);
  const names = new Set(Array.from({length: edges.length / 2}, (_, k) => [edges[2 * k], edges[2 * k + 1]].sort().join('')));
  same([names.has('02'), names.has('01'), names.has('23')], [false, true, true], 'the diagonal is none; a corner and a border are');
});

await runTests();
