/* SPDX-License-Identifier: MIT */
// make bench-page: this measures what a browser costs a head at its limit, and how fast the page is. It prints a table
// for each:
//   1. 2.2 million pulses a second of a small room, without a browser, and with one at nice 10 that can't follow
//   2. pictures a second of 2, 5 and 10 million points, drawn in software
//   3. decoding, ns a point, in the page and in node
//   4. memory of the tab while points come and go, --minutes of it
//   5. how soon a station that is tried has its points and cells, also beside a head at its limit
//   6. the same on 100,000 triangles, beside Blender's geometry nodes on the same scene and step
//   node tests/bench/page.mjs [--seconds S] [--minutes M] [--only 1,2,3,4,5,6]
import {spawnSync} from 'node:child_process';
import {readFileSync} from 'node:fs';
import {cpus, loadavg} from 'node:os';
import {dirname, resolve} from 'node:path';
import {parseArgs} from 'node:util';
import {Browser, browserVersion} from '../page/browser.mjs';
import {end, endpoint, PROGRAM, run, start} from '../page/head.mjs';
import {folder, write} from '../page/work.mjs';

const ROOT = new URL('../..', import.meta.url).pathname;
const {values} = parseArgs({options: {seconds: {type: 'string', default: '20'}, minutes: {type: 'string', default: '1'},
  only: {type: 'string', default: '1,2,3,4,5,6'}}});
const seconds = Number(values.seconds), minutes = Number(values.minutes), wanted = values.only.split(',');
if (!(seconds >= 1 && minutes > 0)) {
  console.error('--seconds: a number from 1 on; --minutes: a number above 0');
  process.exit(2);
}

const room = (prr_hz, links, more = '') => `head: {profile: full-sweep, prr_hz: ${prr_hz}, lines_hz: 420, pan_deg_s: 36, frames: 0}
scene: {meshes: [{file: ${resolve(ROOT, 'config/scenes/glass_room.obj')}, up: z, scale: 1}]}
stations: [{name: room, position_m: [0, 0, 1.6]}]
output: {crs: local, layout: polar}
links: ${links}
loop: {queue_ms: 1000, late_ms: 2000}
${more}`;
const sleep = (s) => new Promise((done) => setTimeout(done, 1000 * s));
const figures = (page) => page.eval('(({point_hash, ...f}) => f)(scanhead.head.figures())');

// Makes rows of texts, with numbers to the right. The first row is the head.
function table(rows) {
  const width = rows[0].map((_, k) => Math.max(...rows.map((row) => String(row[k]).length)));
  for (const row of rows) console.log(`  ${row.map((cell, k) => (k === 0 ? String(cell).padEnd(width[k]) : String(cell).padStart(width[k]))).join('  ')}`);
  console.log();
}
const grouped = (n) => Math.round(n).toString().replace(/\B(?=(\d{3})+$)/g, ',');

// ---- 1
async function loadOnce(withBrowser) {
  const config = write('speed.yaml', room(2200000, "[{type: web}]")), stats = `${folder}/stats.json`;
  const browser = withBrowser ? new Browser({nice: 10}) : null;
  const head = await start(['run', config, '--quiet', '--no-hash', '--start', '--duration', String(seconds), '--stats', stats]);
  const page = await browser?.open(endpoint(head, 'web'));
  const code = await head.ended;
  if (code !== 0) throw new Error(`the head ended with ${code}: ${head.errors}`);
  await page?.until('!scanhead.head.isOpen');
  const f = page ? await figures(page) : null;
  await browser?.end();
  return {s: JSON.parse(readFileSync(stats, 'utf8')), f};
}

async function load() {
  console.log(`1. ${seconds} s at 2,200,000 pulses a second, a room, in real time`);
  const alone = await loadOnce(false), beside = await loadOnce(true), {s, f} = beside, link = s.links[0];
  const row = (name, value) => [name, value(alone.s), value(s)];
  table([['', 'no browser', 'browser at nice 10'], row('pulses sent', (v) => grouped(v.pulses)), row('pulses lost by the head', (v) => grouped(v.lost_pulses)),
    row('late, median, us', (v) => grouped(v.late_p50_us)), row('late, 99.9 %, us', (v) => grouped(v.late_p999_us)), row('late, most, us', (v) => grouped(v.late_max_us))]);
  const share = f.pulses / s.pulses;
  table([['', 'head', 'page'], ['pulses that the page got', grouped(link.received_pulses), grouped(f.pulses)],
    ['frames left out for it', grouped(link.left_out_frames), `${grouped(f.left_out_frames)} announced, ${grouped(f.lost_frames)} by their numbers`],
    ['pulses in them', grouped(link.left_out_pulses), grouped(f.left_out_pulses)], ['points that the page dropped', '', grouped(f.dropped_points)]]);
  console.log(`  The page got ${(100 * share).toFixed(1)} % of the pulses; it decoded a point in ${f.decode_ns_per_point.toFixed(0)} ns.\n`);
  if (s.lost_pulses !== 0) console.log('  NOT REACHED: no pulse lost with the browser\n');
  if (link.left_out_frames !== f.left_out_frames || f.left_out_frames !== f.lost_frames) console.log('  NOT REACHED: each frame left out is announced\n');
}

// ---- 2
// The points lie on the walls of a hall, as a scan has them, and all are in sight from outside.
const fill = (n) => `(() => {
  const cloud = scanhead.cloud, N = 50000;
  cloud.clear();
  let seed = 1;
  const random = () => (seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0) / 2 ** 32;
  for (let done = 0, number = 0; done < ${n}; done += N, number++) {
    const b = {n: N, shots: N, scan: 1, frame: 0, line: number, station: 1, pulse0: done, rgb: null};
    for (const key of ['x', 'y', 'z', 'pulse']) b[key] = new Float64Array(N);
    for (const key of ['t', 'range', 'reflectance', 'amplitude']) b[key] = new Float32Array(N);
    b.label = new Uint16Array(N);
    b.echo = new Uint8Array(N).fill(1);
    b.echoes = new Uint8Array(N).fill(1);
    for (let i = 0; i < N; i++) {
      const p = [20 * random(), 14 * random(), 6 * random()], wall = (6 * random()) | 0;
      p[wall >> 1] = wall & 1 ? [20, 14, 6][wall >> 1] : 0;
      [b.x[i], b.y[i], b.z[i]] = p;
      b.range[i] = Math.hypot(...p);
      b.label[i] = wall;
      b.pulse[i] = done + i;
    }
    cloud.add(b);
  }
  scanhead.view.fit();
  return cloud.count;
})()`;

async function drawing() {
  console.log('2. Pictures a second, 1280 x 720, drawn in software');
  const browser = new Browser({size: [1280, 720]});
  const head = await start(['run', write('idle.yaml', room(100000, '[{type: web}]')), '--quiet']);
  const page = await browser.open(endpoint(head, 'web'), {size: [1280, 720]});
  await page.until('scanhead.head.state === "idle"');
  await page.eval(`(() => { // each picture that is shown while the view moves has its overlay drawn anew
    const {overlay} = scanhead.view, draw = overlay.draw;
    scanhead.n = 0;
    overlay.draw = function (...all) { scanhead.n++; return draw.apply(this, all); };
  })()`);
  const still = '!scanhead.view.state.moving && scanhead.view.state.left === 0';
  const rows = [['points', 'pictures/s, moving', 'points in each', 'all drawn after, s', 'a picture of all, s']];
  for (const n of [2e6, 5e6, 10e6]) {
    await page.eval(fill(n));
    await page.until(`${still} && scanhead.view.state.drawn >= ${n}`);
    const [x, y] = await page.where('#picture'), before = await page.eval('scanhead.n'), from = Date.now();
    await page.mouse('mousePressed', [x, y], 1);
    for (let k = 0; Date.now() - from < 5000; k++) await page.mouse('mouseMoved', [x + 80 * Math.sin(k / 20), y + 20 * Math.cos(k / 20)], 1);
    const {count, points} = await page.eval('({count: scanhead.n, points: scanhead.view.state.drawn})'), took = (Date.now() - from) / 1000, rest = Date.now();
    await page.mouse('mouseReleased', [x, y]);
    await page.until(`${still} && scanhead.view.state.drawn >= ${n}`);
    const all = (Date.now() - rest) / 1000, again = Date.now();
    await page.eval('scanhead.view.pointSize(3), scanhead.view.screenshotReady().then(() => 0)');
    rows.push([grouped(n), ((count - before) / took).toFixed(1), grouped(points), all.toFixed(1), ((Date.now() - again) / 1000).toFixed(1)]);
    await page.eval('scanhead.view.pointSize(2)');
  }
  await end(head);
  await browser.end();
  table(rows);
}

// ---- 3
async function decoding() {
  console.log('3. Decoding, ns a point, in node');
  const {Parser, Decoder} = await import(`${ROOT}drivers/link/web/native.js`);
  const rows = [['', 'points', 'ns a point']];
  for (const [name, ...set] of [['polar', 'output.layout=polar'], ['geo, UTM', 'output.layout=geo', 'output.crs=utm'],
    ['polar, attributes and colours', 'output.layout=polar', 'output.attributes=on', 'output.colour=label']]) {
    const file = `${folder}/decode.shs`;
    const anchor = ['scene.anchor.source=explicit', 'scene.anchor.lat_deg=52', 'scene.anchor.lon_deg=13', 'scene.anchor.height_m=100'];
    run('record', write('decode.yaml', room(1000000, '[{type: web}]')), '--frames', '1', '--quiet', '-o', file,
      ...[...set, ...anchor, 'head.pan_stop_deg=72'].flatMap((s) => ['--set', s]));
    const bytes = readFileSync(file);
    let best = Infinity, points = 0;
    for (let turn = 0; turn < 5; turn++) {
      const decoder = new Decoder({points() {}}), parser = new Parser({frame: (frame) => decoder.take(frame)}), from = performance.now();
      for (let at = 0; at < bytes.length; at += 65536) parser.push(bytes.subarray(at, at + 65536)), decoder.flush();
      best = Math.min(best, performance.now() - from);
      ({points} = decoder.stats);
    }
    rows.push([name, grouped(points), (1e6 * best / points).toFixed(0)]);
  }
  table(rows);
}

// ---- 4
const rss_mb = (pid) => Number(/VmRSS:\s*(\d+)/.exec(readFileSync(`/proc/${pid}/status`, 'utf8'))?.[1] ?? 0) / 1024;

async function memory() {
  console.log(`4. Memory, MB, over ${minutes} min of 600,000 pulses a second`);
  const browser = new Browser();
  const head = await start(['run', write('memory.yaml', room(600000, '[{type: web}]')), '--quiet', '--start', '--duration', '1e6']);
  const page = await browser.open(endpoint(head, 'web'));
  const rows = [['s', 'tab', 'drawing', 'its JavaScript', 'points held', 'points gone']], from = Date.now();
  for (let k = 0; k <= 10; k++) {
    await sleep(Math.max(0, 6 * minutes * k + (k === 0 ? 3 : 0) - (Date.now() - from) / 1000));
    const {processInfo} = await browser.send('SystemInfo.getProcessInfo');
    const of = (type) => Math.round(Math.max(...processInfo.filter((p) => p.type === type).map((p) => rss_mb(p.id))));
    const {used, held, gone} = await page.eval('({used: performance.memory.usedJSHeapSize, held: scanhead.cloud.count, gone: scanhead.cloud.gone})');
    rows.push([Math.round((Date.now() - from) / 1000), of('renderer'), of('GPU'), Math.round(used / 2 ** 20), grouped(held), grouped(gone)]);
  }
  await end(head);
  await browser.end();
  table(rows);
}

// ---- 5
// Lets go of a tried station at a place. Returns the times until the page has all its points, until they are drawn, until
// all its cells are known, and until these are painted.
const letGo = (number, [x, y, z]) => `(async () => {
  const {trial, view} = scanhead, station = trial.get(${number}), t0 = performance.now();
  const soon = () => new Promise((done) => setTimeout(done, 1));
  view.dispatchEvent(new CustomEvent('move', {detail: {station: ${number}, x: ${x}, y: ${y}, z: ${z}, heading_deg: 0}}));
  while (station.shown !== station.wanted) await soon();
  const came = performance.now() - t0;
  await view.screenshotReady();
  const points = performance.now() - t0;
  while (trial.isBusy) await soon();
  const cells = performance.now() - t0;
  await view.screenshotReady();
  return [came, points, cells, performance.now() - t0];
})()`;
// Painting restarts the picture, so points are timed without it.
const painted = (what) => `(() => {
  const select = document.querySelector('#trial-paint');
  select.value = '${what}';
  select.dispatchEvent(new Event('change'));
  return scanhead.view.screenshotReady().then(() => 0);
})()`;

async function dropAround(config, number, middle, size, drops) {
  const stats = `${folder}/stats.json`;
  const browser = new Browser({nice: drops.nice});
  const head = await start(['run', config, '--quiet', '--no-hash', '--view', '--stats', stats, ...drops.more]);
  const page = await browser.open(endpoint(head, 'web'));
  await page.until('scanhead.head.isOpen && !document.querySelector("#try").hidden');
  await page.click('#try');
  await page.until('scanhead.trial && !scanhead.trial.isBusy && scanhead.trial.sum');
  const took = {off: [], seen: []};
  for (const paint of ['off', 'seen']) {
    await page.eval(painted(paint));
    for (let k = 0; k < drops.n; k++) {
      const turn = k + (paint === 'seen' ? 0.5 : 0); // the head keeps its answers
      const place = [middle[0] + size * Math.cos(turn), middle[1] + size * Math.sin(turn), middle[2]];
      took[paint].push(await page.eval(letGo(number, place.map((v) => v.toFixed(3)))));
    }
  }
  const points = await page.eval(`scanhead.trial.get(${number}).points`);
  await end(head);
  await browser.end();
  const times = (paint, i) => {
    const sorted = took[paint].map((t) => t[i]).sort((a, b) => a - b);
    return [sorted[sorted.length >> 1], sorted.at(-1)].map(grouped);
  };
  return {points: grouped(points), came: times('off', 0), drawn: times('off', 1), cells: times('off', 2), painted: times('seen', 3),
    stats: JSON.parse(readFileSync(stats, 'utf8'))};
}

async function trials() {
  const n = 15, row = (of) => [of.points, ...of.drawn, ...of.cells, ...of.painted];
  console.log(`5. Stations that are tried, ms, of ${n} times`);
  const house = await dropAround(resolve(ROOT, 'config/demo.yaml'), 3, [5.5, 2.2, 1.6], 0.8, {n, nice: 0, more: ['--set', `links.0.path=${folder}/pty`]});
  const busy = await dropAround(write('busy.yaml', room(2200000, "[{type: web}]")), 1, [0, 0, 1.6], 1.5, {n, nice: 10, more: ['--start']});
  table([['', 'points', 'on the page, median', 'most', 'all cells, median', 'most', 'painted, median', 'most'], ['house of the demo, head idle', ...row(house)],
    ['room, 2,200,000 pulses/s', ...row(busy)]]);
  console.log(`  Pulses lost by the head meanwhile: ${grouped(busy.stats.lost_pulses)} of ${grouped(busy.stats.pulses)}\n`);
}

// ---- 6
const BLENDER = '/usr/bin/blender';

function blenderMoves(scene, middle, size, n) {
  const {status, stdout, stderr, error} = spawnSync(BLENDER, ['-b', '--factory-startup', '-P', `${ROOT}tests/bench/blender_live.py`, '--', scene, '2',
    ...[size, n, ...middle].map(String)], {encoding: 'utf8'});
  if (error) return `${BLENDER} is not there: package blender`;
  if (status === 77) return 'this Blender is too new for tests/readers/blender_scan.py';
  if (status !== 0) throw new Error(stderr);
  return JSON.parse(stdout.split('\n').find((line) => line.startsWith('{')));
}

async function besideBlender() {
  const n = 15, size = 1.5, scene = `${folder}/ground.obj`;
  console.log(`6. A panorama of 2 degrees on 100,000 triangles after its station was moved, ms, of ${n} times`);
  const middle = spawnSync(`${dirname(PROGRAM)}/tests/bench/write_mesh`, ['100k', scene], {encoding: 'utf8'}).stdout.trim().split(' ').map(Number);
  const config = write('ground.yaml', `head: {profile: sphere, step_deg: 2}
scene: {meshes: [{file: ${scene}, up: z, scale: 1}]}
stations: [{name: middle, position_m: [${middle}]}]
links: [{type: web}]
`);
  const blender = blenderMoves(scene, middle, size, n), ours = await dropAround(config, 1, middle, size, {n, nice: 0, more: []});
  const rows = [['', 'points', 'median', 'most'], ['on the page, not drawn', ours.points, ...ours.came], ['on the page, drawn in software', ours.points, ...ours.drawn]];
  if (typeof blender === 'object') {
    const ms = blender.ms.sort((a, b) => a - b);
    rows.push(['in Blender, not drawn', grouped(blender.points), grouped(ms[ms.length >> 1]), grouped(ms.at(-1))]);
  }
  table(rows);
  if (typeof blender === 'string') console.log(`  ${blender}\n`);
}

console.log(`${cpus()[0].model.replace(/\s+/g, ' ')}, ${cpus().length} processors, load ${loadavg()[0].toFixed(1)} before; ${browserVersion()}, node ${process.version}\n`);
for (const [number, measure] of Object.entries({1: load, 2: drawing, 3: decoding, 4: memory, 5: trials, 6: besideBlender})) if (wanted.includes(number)) await measure();
process.exit(0);
