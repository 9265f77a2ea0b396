/* SPDX-License-Identifier: MIT */
// Parts of the page's decoder (drivers/link/web): the hash of points, poses, replies, losses, and places on the Earth.
// page_native.mjs runs these tests with its own.
import {CommandError, Replies} from '../../drivers/link/web/replies.js';
import {Losses} from '../../drivers/link/web/losses.js';
import {Columns, geoPlacer, PointHash} from '../../drivers/link/web/native_points.js';
import {Poses} from '../../drivers/link/web/native_poses.js';
import {Sequence} from '../../drivers/link/web/native_sequence.js';
import {fitCubic, geodeticToEcef, gridOf, toScene} from '../../drivers/link/web/native_earth.js';
import {equal, near} from './page_rig.mjs';
import {test} from './page_tap.mjs';

test('the hash of points: pulse numbers of more than 32 bits go on', () => {
  const of = (n, low, high, from = 0) => {
    const hash = new PointHash(), view = new DataView(new ArrayBuffer(40 + 40));
    for (let i = 0; i < 2; i++) {
      view.setUint32(40 + 20 * i, 1000 + from + i, true);
      view.setUint32(40 + 20 * i + 16, 0x11000000, true); // echo 1 of 1: a pulse of its own
    }
    hash.add(view, n, low, high);
    return [hash.a, hash.b];
  };
  const both = of(2, -1, 0), first = of(1, -1, 0), second = of(1, 0, 1, 1);
  both.forEach((sum, i) => equal(sum, (first[i] + second[i]) | 0, `sum ${i}`));
});

test('the oldest of the 64 gaps that are remembered is cut in two by a late frame, and both parts stay', () => {
  const sequence = new Sequence();
  const take = (seq) => sequence.take({seq, flags: 0, type: 3, length: 0, payload_crc: seq, t_ns: BigInt(seq)});
  equal(take(0), '', 'frame 0');
  for (let k = 0; k < 64; k++) equal(take(4 + 2 * k), 'gap', `gap ${k}`); // 1 to 3 are missing, then 5, 7, ...
  for (const seq of [2, 1, 3]) equal(take(seq), 'late', `frame ${seq}`);
});

test('geodetic points have a range from a station; from a head that moves they have none', () => {
  const view = new DataView(new ArrayBuffer(40 + 20));
  view.setInt32(40 + 8, 25000, true); // 2.5 m above the anchor
  view.setUint32(40 + 16, 0x11000000, true); // echo 1 of 1
  const rangeOf = (moving) => {
    const c = new Columns(1), at = [52.3, 13.1, 80];
    geoPlacer({range_max_m: 100}, {crs: 3, heights: 0, moving, anchor: at, scale: [1e-9, 1e-9, 1e-4], lat_deg: at[0], lon_deg: at[1],
      height_m: at[2], station_m: [0, 0, 0], axes: [1, 0, 0, 0, 1, 0, 0, 0, 1]})(c, view, 1, 0, 0);
    return c.range[0];
  };
  near(rangeOf(0), 2.5, 1e-6, 'range'); // a float near 2.5 m, from coordinates of 6,400 km in double
  equal(rangeOf(1), NaN, 'range of a head that moves');
});

test('a geodetic range, with heights above the geoid: along the meridian, the radius of curvature and the true height', () => {
  const view = new DataView(new ArrayBuffer(40 + 20));
  view.setInt32(40, 18000000, true); // 0.018 degrees to the north
  view.setUint32(40 + 16, 0x11000000, true);
  for (const heights of [0, 1]) {
    const c = new Columns(1), height_m = heights ? 147 : 100; // 47 m are 15 mm of the range
    geoPlacer({range_max_m: 4000}, {crs: 3, heights, moving: 0, anchor: [45, 13.1, 100], scale: [1e-9, 1e-9, 1e-4],
      lat_deg: 45, lon_deg: 13.1, height_m, station_m: [0, 0, 0], axes: [1, 0, 0, 0, 1, 0, 0, 0, 1]})(c, view, 1, 0, 0);
    const e2 = (2 - 1 / 298.257223563) / 298.257223563, s = Math.sin(45.009 * Math.PI / 180);
    const radius_m = 6378137 * (1 - e2) / (1 - e2 * s * s) ** 1.5 + height_m;
    near(c.range[0], 0.018 * Math.PI / 180 * radius_m, 1e-3, 'range'); // a float near 2 km has steps of 1e-4 m
  }
});

test('poses: from the first to the last of a frame, both included', () => {
  const poses = new Poses(), quat = [1, 0, 0, 0];
  poses.add([{t_ns: 0n, position_m: [0, 0, 0], quat}, {t_ns: 1000n, position_m: [2, 0, 0], quat}]);
  const c = {n: 4, x: new Float64Array(4), y: new Float64Array(4), z: new Float64Array(4)};
  equal(poses.place(c, 0, (i) => [0, 500, 1000, 1001][i]), 1, 'points without a pose');
  [0, 1, 2, NaN].forEach((x, i) => equal(c.x[i], x, `x of point ${i}`));
});

test('replies in order; an ERR; out of step after one that did not come', async () => {
  const sent = [], replies = new Replies((line) => sent.push(line));
  const failing = (promise) => promise.then(() => 'no', (e) => (e instanceof CommandError ? `${e.number} ${e.text}` : e));
  equal(await failing(replies.ask('A?', 1)), '0 the head is not connected', 'closed');
  replies.open();
  const [a, b] = [replies.ask('A?', 1), failing(replies.ask('B 7', 1))];
  replies.take('1');
  replies.take('ERR -222,"Data out of range; B 7, allowed 0 to 5"');
  equal(await a, '1', 'A');
  equal(await b, '-222 Data out of range; B 7, allowed 0 to 5', 'B');
  equal(await failing(replies.ask('A\n', 1)), '0 a command is one line of 1 to 256 printable ASCII characters', 'two lines');
  equal(await failing(replies.ask('A?', 0)), '0 no reply within 0 s', 'late');
  const c = replies.ask('C?', 1);
  equal(sent.join(), 'A?,B 7,A?,*IDN?', 'sent');
  for (const line of ['late', '1 a, 2 b, 3 c, 4 d', 'a,b,c,scanhead native 1', '3']) replies.take(line);
  equal(await c, '3', 'C');
  const d = failing(replies.ask('D?', 1));
  replies.close('gone');
  equal(await d, '0 gone', 'D');
});

// The timers are the test's own: what would run out first is seen without waiting for it.
test('the time of a command counts once it is the next to be answered', async () => {
  const real = {setTimeout, clearTimeout}, timers = [];
  globalThis.setTimeout = (run, ms) => timers.push({run, ms});
  globalThis.clearTimeout = (id) => { if (id) timers[id - 1] = null; };
  const left = () => timers.filter((t) => t).map(({ms}) => ms).join(), runOut = () => timers.findLast((t) => t).run();
  try {
    const sent = [], replies = new Replies((line) => sent.push(line));
    const outcome = (promise) => promise.then((text) => text, ({number, text}) => `${number} ${text}`);
    replies.open();
    const plan = outcome(replies.ask('SITE:POSE 1', 60)), [a, b] = ['A?', 'B?'].map((line) => outcome(replies.ask(line, 5)));
    equal(left(), '60000', 'while the plan is made');
    replies.take('OK');
    equal(await plan, 'OK', 'SITE:POSE');
    equal(left(), '5000', 'A is next');
    runOut();
    equal(await a, '0 no reply within 5 s', 'A');
    equal(await b, '0 given up, as A? had no reply', 'B');
    const [c, d] = [replies.ask('C?', 7), replies.ask('D?', 8)]; // the head has not come into step yet
    equal(left(), '7000,8000', 'they wait to be sent');
    for (const line of ['late', 'a,b,c,scanhead native 1']) replies.take(line);
    equal(left(), '7000', 'sent: C is next');
    for (const line of ['3', '4']) replies.take(line);
    equal([await c, await d, left(), sent.join()].join(), '3,4,,SITE:POSE 1,A?,B?,*IDN?,C?,D?', 'in step again');
  } finally {
    Object.assign(globalThis, real);
  }
});

// ---- losses

// Returns what Losses says of these. Each points frame has 100 shots, or as many as stand after it.
function lossesOf(...things) {
  const said = [], losses = new Losses((name, d) => said.push(name === 'scan'
    ? `scan ${d.scan} ${d.fired} ${d.cast} ${d.lost} ${d.received} ${d.missing}` : `${d.by} ${d.frames} ${d.pulses}`));
  let shots = 0;
  for (const [name, value, n] of things) { // n: of points, or the lost frames before telemetry
    losses[name]({shots, ...value}, n);
    if (name === 'points') shots += n ?? 100;
  }
  return said.join('; ');
}

test('where a scan ends, with SCAN_END and without, and what is missing of it', () => {
  const event = (name, values) => ['event', {name, ...values}], points = ['points', {scan: 1}];
  const telemetry = (state, scan, lost = 0) => ['telemetry', {state, scan, scan_fired: 130, scan_cast: 120, scan_lost: 7}, lost];
  const start = event('SCAN_START', {scan: 1}), end = event('SCAN_END', {scan: 1, fired: 130, lost: 7});
  const state = event('STATE', {state: 5, before: 4}), d = (scan) => ['descriptor', {scan}];
  const whole = 'scan 1 130 120 7 100 13';
  equal(lossesOf(d(0), telemetry(2, 0), start, d(1), points, telemetry(4, 1), telemetry(5, 1), end, state, telemetry(2, 1)), whole, 'whole');
  equal(lossesOf(start, d(1), points, telemetry(5, 1), state, telemetry(2, 1)), whole, 'STATE');
  equal(lossesOf(start, d(1), points, state, telemetry(2, 1)), whole, 'telemetry');
  equal(lossesOf(start, d(1), points, end), 'scan 1 130 null 7 100 null', 'telemetry lost');
  equal(lossesOf(d(1), points, telemetry(4, 2)), 'scan 1 null null null 100 null', 'telemetry of another scan');
  equal(lossesOf(d(1), points, d(2)), 'scan 1 null null null 100 null', 'descriptor of another scan');
  equal(lossesOf(d(1), telemetry(2, 1), d(1)), '', 'at rest');
  equal(lossesOf(d(1), points, event('SCAN_START', {scan: 2}), ['points', {scan: 2}], event('SCAN_END', {scan: 2, fired: 9, lost: 0})),
    'scan 1 null null null 100 null; scan 2 9 null 0 100 null', 'the next scan');
  equal(lossesOf(start, d(1), points, ['restarted', {}], start, d(1), points, telemetry(5, 1), end),
    `scan 1 null null null 100 null; ${whole}`, 'another sequence, whose scan has the same number');
  const begun = ['points', {scan: 1, began_s: 2.5}], started = (at_ns) => event('SCAN_START', {scan: 1, at_ns});
  equal(lossesOf(d(1), begun, started(2500000000n), begun, telemetry(5, 1), end), 'scan 1 130 120 7 200 -87', 'the scan at hand, late');
  for (const at_ns of [2400000000n, 2500002000n]) {
    equal(lossesOf(started(2500000000n), d(1), begun, telemetry(4, 1), started(at_ns), d(1), points, telemetry(5, 1), end),
      `scan 1 null null null 100 null; ${whole}`, 'another start: another scan of the same number');
  }
  // Each scan has 120 pulses, and all came. The first one has ended, or the page joined it after 5000 pulses.
  const all = (shots) => Array.from({length: shots / 20}, () => ['points', {scan: 1, began_s: 2.5}, 20]), last = ['telemetry',
    {state: 5, scan: 1, scan_fired: 120, scan_cast: 120, scan_lost: 0}], over = event('SCAN_END', {scan: 1, fired: 120, lost: 0});
  const past = ['past', {scan: 1, shots: 5000}], none = 'scan 1 120 120 0 120 0';
  equal(lossesOf(started(2500000000n), d(1), ...all(120), last, over, started(60000000000n), d(1), ...all(120), last, over),
    `${none}; ${none}`, 'a scan of the same number after the end of one');
  equal(lossesOf(d(1), past, ...all(100), started(60000000000n), d(1), ...all(120), last, over),
    `scan 1 null null null 5100 null; ${none}`, 'pulses that the head had kept are of the scan before');
  // The final counts that were lost come with the next telemetry of the same scan: 120 - 7 - 100 pulses are missing.
  for (const [state, scan, missing] of [[2, 1, 13], [5, 1, 13], [3, 1, 13], [4, 1, 0], [2, 2, 0]]) {
    const late = new Losses(() => {});
    for (const [name, value] of [start, d(1), points]) late[name]({...value, shots: 0});
    late.event({...end[1], shots: 100});
    for (let i = 0; i < 2; i++) late.telemetry({...telemetry(state, scan)[1], shots: 100}, 0);
    equal(late.missing, missing, `telemetry of state ${state} and scan ${scan} after SCAN_END`);
  }
  const counted = new Losses(() => {});
  counted.event({...end[1], shots: 0});
  equal(counted.byHead, 7, 'by SCAN_END, of a scan that was not seen');
  for (const [name, value] of [start, d(1), state, telemetry(2, 1)]) counted[name]({...value, shots: 0});
  equal(counted.byHead, 14, 'by telemetry, where SCAN_END and OVERRUN were lost');
  const left = event('READER_LOST', {frames: 3, pulses: 50});
  equal(lossesOf(telemetry(2, 1, 5), left, telemetry(2, 1, 5), telemetry(2, 1, 5)), 'link 3 50; wire 2 0', 'five frames are missing');
  equal(lossesOf(telemetry(2, 1, 3), left, telemetry(2, 1, 3)), 'link 3 50', 'READER_LOST after the jump');
  equal(lossesOf(event('OVERRUN', {lost: 4}), event('OVERRUN', {lost: 0})), 'head 0 4', 'by the head');
});

// ---- places on the Earth

test('grids: there and back; the cubic is as good as 1 um at 2 km', () => {
  for (const [epsg, lat, lon] of [[32633, 52.5, 13.4], [32733, -33, 17.9], [32661, 88, -70], [32761, -86, 120], [32601, 10, -179]]) {
    const grid = gridOf(epsg), [e, n] = grid.forward(lat, lon), back = grid.inverse(e, n);
    near(back[0], lat, 1e-9, 'latitude'); // 0.1 mm; the series' errors cancel but for 0.1 um
    near(back[1], lon, 1e-9, 'longitude');
    const anchor = {crs: 2, epsg, moving: 0, heights: 0, anchor: [e, n, 100], lat_deg: lat, lon_deg: lon, height_m: 100,
      station_m: [0, 0, 0], axes: [1, 0, 0, 0, 1, 0, 0, 0, 1]};
    const {at} = toScene(anchor), k = fitCubic((u, v, w) => at([e + 2000 * u, n + 2000 * v, 100 + 2000 * w]));
    const powers = (u, v, w) => [1, w, w * w, w ** 3, v, v * w, v * w * w, v * v, v * v * w, v ** 3, u, u * w, u * w * w, u * v,
      u * v * w, u * v * v, u * u, u * u * w, u * u * v, u ** 3];
    for (const [u, v, w] of [[0.3, 0.4, 0.1], [-0.7, 0.6, -0.2], [0.6, -0.75, 0.2]]) {
      const exact = at([e + 2000 * u, n + 2000 * v, 100 + 2000 * w]);
      exact.forEach((x, i) => near(powers(u, v, w).reduce((sum, p, j) => sum + p * k[20 * i + j], 0), x, 1e-6, 'cubic'));
    }
  }
  near(geodeticToEcef(0, 90, 0)[1], 6378137, 1e-6, 'equator');
});
