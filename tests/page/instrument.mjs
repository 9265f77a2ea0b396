/* SPDX-License-Identifier: MIT */
// These tests take the page as an instrument. They check colours, ages and the time line as they are drawn, the files
// that the page saves, control, keys, screen readers and small screens, and that nothing jumps. They read back the
// pixels of the picture.
import {execFileSync} from 'node:child_process';
import {existsSync, mkdirSync, readdirSync, readFileSync} from 'node:fs';
import {tableOf} from '../../drivers/link/web/view_colours.js';
import {rampAt} from '../../drivers/link/web/view_ramps.js';
import {Client, end, endpoint, run, start} from './head.mjs';
import {pixelsOf} from './png8.mjs';
import {choose, CONFIG} from './rig.mjs';
import {equal, folder, is, near, test} from './work.mjs';

const ROOT = new URL('../..', import.meta.url).pathname;
const SIZE = [600, 480];

// This runs in a page before its scripts. It notes layout shifts that no input has caused, the theme before modules
// run, and changes of texts that a screen reader reads out.
function watches() {
  Object.assign(window, {shifts: [], spoken: 0, firstTheme: null});
  new PerformanceObserver((list) => {
    for (const {value, hadRecentInput, sources} of list.getEntries()) {
      const name = ({node}) => node && (node.id || node.className || node.nodeName);
      if (!hadRecentInput) window.shifts.push({value, of: (sources ?? []).map(name).join(' ')});
    }
  }).observe({type: 'layout-shift', buffered: true});
  document.addEventListener('readystatechange', () => {
    window.firstTheme ??= document.documentElement.dataset.theme ?? 'none'; // at 'interactive' no module has run
    const live = '[role=status], [role=alert], [aria-live=polite], [aria-live=assertive]';
    new MutationObserver((changes) => {
      window.spoken += changes.filter(({target}) => (target.closest ?? target.parentElement?.closest)?.call(target.closest ? target : target.parentElement, live)).length;
    }).observe(document.body, {subtree: true, childList: true, characterData: true});
  }, {once: true});
}

// This finds the colours of the picture that differ from the ground, each with its number of pixels. Rows that an
// overlay covers are left out.
const COLOURS = `(async () => {
  const {view} = scanhead;
  const {width, height} = view.canvas;
  await view.screenshotReady();
  const copy = await view.picture();
  const {data} = copy.getContext('2d').getImageData(0, 0, width, height);
  const ground = view.colours.ground.map((v) => Math.round(255 * v)), found = new Map();
  const [left, top, right, bottom] = [0, 0, width, height - 90]; // below are the scale bar and the axes
  for (let y = top; y < bottom; y++) for (let x = left; x < right; x++) {
    const at = 4 * (y * width + x), c = [data[at], data[at + 1], data[at + 2]];
    if (c.some((v, k) => Math.abs(v - ground[k]) > 1)) found.set(c.join(), (found.get(c.join()) ?? 0) + 1);
  }
  return [...found];
})()`;

// Looks from the first station exactly towards a point. Returns whether something is drawn in the middle of the
// picture.
const towards = (point) => `(async () => {
  const {view} = scanhead, {x, y, z} = ${JSON.stringify(point)}, s = view.stations.list[0], c = view.camera;
  const d = [x - s.x_m, y - s.y_m, z - s.z_m];
  c.lookFrom([s.x_m, s.y_m, s.z_m], Math.atan2(d[0], d[1]), Math.atan2(d[2], Math.hypot(d[0], d[1])));
  c.fov = 0.004;
  view.touched();
  view.cameraMoved();
  const copy = await view.picture(), {width, height} = view.canvas;
  const {data} = copy.getContext('2d').getImageData(width >> 1, height >> 1, 1, 1);
  const ground = view.colours.ground.map((v) => Math.round(255 * v));
  return [...data].slice(0, 3).some((v, k) => Math.abs(v - ground[k]) > 2);
})()`;

// This finds the first and the last time of the cloud's points, and a point after 25 % and one after 90 % of them.
const OLD_AND_YOUNG = `(() => {
  const {cloud} = scanhead, all = [];
  for (const block of cloud.blocks) for (let i = 0; i < block.n; i += 97) {
    const at = (a) => block.position[3 * i + a] + cloud.origin[a];
    if ((block.echo[i] & 15) === 1) all.push({t: block.began_s + block.t[i], x: at(0), y: at(1), z: at(2)});
  }
  all.sort((a, b) => a.t - b.t);
  return {from: all[0].t, to: all.at(-1).t, old: all[Math.floor(0.25 * all.length)], young: all[Math.floor(0.9 * all.length)]};
})()`;

async function saved(ending) {
  const at = `${folder}/saved`;
  for (let tries = 0; tries < 400; tries++) {
    const name = existsSync(at) && readdirSync(at).find((file) => file.endsWith(ending));
    if (name) return `${at}/${name}`;
    await new Promise((done) => setTimeout(done, 25));
  }
  throw new Error(`no file ${ending}`);
}

const shifted = async (page, what) => {
  const shifts = await page.eval('shifts');
  const sum = shifts.reduce((all, {value}) => all + value, 0);
  is(sum <= 0.005, `${what} does not jump: ${JSON.stringify(shifts)}`); // it is 1 where all moves by the window's size
};

/** Runs all of them in a browser. */
export async function testInstrument(browser) {
  const head = await start(['run', CONFIG, '--quiet', '--pace', 'fast']);
  const other = new Client(endpoint(head, 'tcp'));
  mkdirSync(`${folder}/saved`, {recursive: true});
  await browser.send('Browser.setDownloadBehavior', {behavior: 'allow', downloadPath: `${folder}/saved`});
  const page = await browser.open(endpoint(head, 'web'), {size: SIZE, dark: true, before: `(${watches})()`});
  await page.until('scanhead.head.isOpen && scanhead.head.state === "idle" && document.querySelector("#station-2-x_m")?.value');
  await page.until('document.querySelector("#panel-plan td")');

  await test('a dark page is dark from its first picture on, and nothing in it jumps while it is filled', async () => {
    equal(await page.eval('firstTheme'), 'dark', 'theme before any module');
    await shifted(page, 'a page of 600 px');
    for (const size of [[1280, 900], [360, 740]]) {
      const one = await browser.open(endpoint(head, 'web'), {size, before: `(${watches})()`});
      await one.until('scanhead.head.isOpen && document.querySelector("#station-2-x_m")?.value && document.querySelector("#panel-plan td")');
      await shifted(one, `a page of ${size[0]} px`);
      const open = await one.eval('document.querySelectorAll(".panel[open]").length');
      is(size[0] > 360 ? open > 5 : open === 2, `the first small page has few panels open, though a wide one had all: ${open}`);
      const wide = await one.eval(`(() => { // with the longest of its figures
        document.querySelector('#panel-figures').open = true;
        document.querySelector('#figure-past').textContent = '2.31 M, 1.23 M older ones are gone, 12 345 stream frames not kept';
        document.querySelector('#figure-time').textContent = '12:34:56 since power-up, PTP UNCALIBRATED, s0, −37 000 000 123 ns';
        return document.documentElement.scrollWidth;
      })()`);
      is(wide <= size[0], `nothing is wider than ${size[0]} px: ${wide}`);
      await one.close();
    }
    await page.toFront();
  });

  await test('Start takes control where nobody has it; settings are there for who has it', async () => {
    equal(await page.eval('document.querySelector("#panel-knobs").getClientRects().length'), 0, 'settings that are shown');
    equal(await other.ask('SYST:CONT?'), '0', 'the session in control');
    await page.press('#record');
    const spoken = await page.eval('spoken');
    await page.press('#start');
    await page.until('scanhead.head.mine && document.querySelector("#panel-knobs").getClientRects().length > 0');
    await page.until('scanhead.head.state === "idle" && scanhead.cloud.total > 0');
    equal(await other.ask('SYST:CONT?'), String(await page.eval('scanhead.head.session')), 'the session in control');
    const said = await page.eval('spoken') - spoken;
    is(said <= 10, `a scan has four changes of state and one of control to be read out: ${said}`);
    await shifted(page, 'a page with a scan');
  });

  await test('what was recorded from the page is the scan', async () => {
    await page.press('#record');
    const file = await saved('.shs');
    const counts = JSON.parse(execFileSync('/usr/bin/python3', [`${ROOT}tests/page/counts.py`, file], {encoding: 'utf8'}));
    await page.until(`scanhead.head.figures().pulses >= ${counts.shots}`); // they come with the messages from the worker
    const [pulses, hash] = await page.eval('[scanhead.head.figures().pulses, scanhead.head.figures().point_hash]');
    equal(counts.shots, pulses, 'pulses');
    equal(counts.hash, hash, 'hash over all records');
    is(run('record', file, '-o', `${folder}/scan.las`, '--quiet') !== null, 'other formats are made of it');
  });

  await test('the points so far in other formats, as the head writes them', async () => {
    for (const as of ['las', 'ply']) {
      await choose(page, '#save-as', as);
      await page.press('#save');
      const file = await saved(`.${as}`), bytes = readFileSync(file), total = await page.eval('scanhead.cloud.total');
      // LAS 1.4 has the number of its records at byte 247 (ASPRS, R15); a PLY in words.
      const n = as === 'las' ? Number(bytes.readBigUInt64LE(247)) : Number(/element vertex (\d+)/.exec(bytes.toString('latin1', 0, 2000))[1]);
      equal(n, total, `points of ${file}`);
    }
    const refused = await page.eval("fetch('/save?as=../x').then(async (answer) => [answer.status, await answer.text()])");
    equal(refused[0], 400, 'status of another format');
    is(refused[1].includes('las, ply, e57'), `it says what is allowed: ${refused[1]}`);
    equal(await page.eval("fetch('/saved?file=1&from=1e9').then((answer) => answer.status)"), 400, 'status of a wrong position');
  });

  await page.eval('scanhead.view.shading = false, scanhead.view.show({scene: false, stations: false})');

  await test('colours as they are drawn: scale, limits by hand and by shares, and the same meaning as in files', async () => {
    await choose(page, '#colour', 'height');
    for (const scale of ['usual', 'even', 'blue', 'grey']) {
      await choose(page, '#scale', scale);
      const table = tableOf('height', scale), known = new Set();
      for (let i = 0; i < 256; i++) known.add([...table.subarray(4 * i, 4 * i + 3)].join());
      const drawn = await page.eval(COLOURS), wrong = drawn.filter(([colour]) => !known.has(colour));
      is(drawn.length > 50 && wrong.length === 0, `${scale}: ${drawn.length} colours, of these not of the scale: ${wrong.slice(0, 3)}`);
    }
    await choose(page, '#scale', 'even');
    const {min, max} = await page.eval('scanhead.cloud.bounds');
    for (const [from, to, f] of [[max[2] + 1, max[2] + 2, 0], [min[2] - 2, min[2] - 1, 1]]) {
      await choose(page, '#limits', 'hand');
      await page.eval(`document.querySelector('#limit-low').value = ${from}`);
      await choose(page, '#limit-high', String(to));
      equal((await page.eval(COLOURS)).map(([colour]) => colour).join(' '), rampAt('even', f).map(Math.round).join(), `limits ${from} to ${to}`);
    }
    await choose(page, '#limit-high', '-1000');
    is((await page.eval('document.querySelector("#limit-says").textContent')).includes('lower'), 'limits the wrong way round are refused');
    equal(await page.eval('document.querySelector("#limit-high").getAttribute("aria-invalid")'), 'true', 'and marked');
    await choose(page, '#limits', '0');
    const legend = await page.until('typeof scanhead.view.legend().from === "number" && scanhead.view.legend()');
    is(legend.from <= min[2] && legend.to >= max[2] - 1e-6, `all points: ${legend.from} to ${legend.to}`);
    await choose(page, '#limits', '0.05');
    const inner = await page.until(`scanhead.view.legend().from > ${legend.from} && scanhead.view.legend()`);
    is(inner.to - inner.from < legend.to - legend.from, 'fewer points, narrower limits');
    await choose(page, '#limits', '0.01');
    await choose(page, '#scale', 'usual');
  });

  await test('low and high have the same colours in a file', () => sameMeaning());

  await test('an age limit: older points are not drawn and not found', async () => {
    await page.eval('scanhead.view.pointSize(4)');
    const {to, old, young} = await page.eval(OLD_AND_YOUNG);
    equal(JSON.stringify([await page.eval(towards(old)), await page.eval(towards(young))]), '[true,true]', 'all points');
    await choose(page, '#age-limit', '0.5');
    is(old.t < to - 0.5 && young.t > to - 0.5, `the limit is between them: ${old.t}, ${young.t}, ${to}`);
    equal(JSON.stringify([await page.eval(towards(old)), await page.eval(towards(young))]), '[false,true]', 'the last 0.5 s');
    const found = async (point) => {
      await page.eval(towards(point));
      await page.eval('window.picked = undefined, scanhead.view.addEventListener("pick", ({detail}) => (window.picked = detail ?? null), {once: true}), scanhead.view.pickMiddle()');
      return page.until('window.picked !== undefined && (window.picked.point ? "point" : "none")');
    };
    equal(await found(young), 'point', 'a point of the last 0.5 s');
    equal(await found(old), 'none', 'an older one');
    await choose(page, '#age-limit', '');
    equal(await page.eval(towards(old)), true, 'without the limit it is back');
  });

  await test('the picture as a file, with its legend', async () => {
    await page.eval('scanhead.view.fit()');
    equal(await page.eval('Promise.all([scanhead.view.picture(), scanhead.view.picture()]).then((all) => all.length)'), 2, 'pictures, asked for at once');
    await page.press('#screenshot');
    const {width, height, size, out} = pixelsOf(readFileSync(await saved('.png')));
    equal(JSON.stringify([width, height]), JSON.stringify(await page.eval('[scanhead.view.canvas.width, scanhead.view.canvas.height]')), 'its size');
    for (const f of [0.1, 0.5, 0.9]) { // the ramp is 194 px wide from x 20, and 10 px high from y 36
      const at = size * (41 * width + Math.round(20 + 194 * f));
      rampAt('spectrum', f).forEach((v, k) => near(out[at + k], v, 6, `the legend at ${f}`)); // 17 stops, a pixel of 1/194
    }
  });

  await test('by keys alone: turning, the point in the middle, the list of keys', async () => {
    const before = await page.eval('document.querySelector("#picture").focus(), scanhead.view.camera.azimuth');
    await page.key('ArrowLeft');
    is(await page.eval('scanhead.view.camera.azimuth') !== before, 'an arrow turns the view');
    await page.key('Home');
    equal(await page.eval('document.querySelector("#point").hidden'), true, 'no point, no panel');
    await page.eval('document.querySelector("#point-says").textContent = ""'); // an earlier test has asked, too
    await page.key('i');
    const words = await page.until('document.querySelector("#point-says").textContent');
    equal(await page.eval('document.querySelector("#point").hidden'), words.startsWith('No point'), `the panel is there with a point: ${words}`);
    await page.key('?');
    await page.until('document.querySelector("#keys").open');
    await page.key('Escape');
    await page.until('!document.querySelector("#keys").open');
  });

  await test('Tab comes to every control that is shown, and each shows that it has the focus', async () => {
    await page.eval(`(() => {
      document.activeElement.blur();
      for (const panel of document.querySelectorAll('.panel')) panel.open = true;
      window.shown = () => [...document.querySelectorAll('a, button, input, select, summary, [tabindex]')].filter((e) =>
        e.tabIndex >= 0 && !e.disabled && e.getClientRects().length > 0 && e.checkVisibility() && !e.closest('dialog:not([open])'));
      window.visited = new Set();
      window.dim = [];
      window.note = () => {
        const e = document.activeElement, {outlineStyle, outlineWidth} = getComputedStyle(e);
        window.visited.add(e);
        if (e !== document.body && (outlineStyle === 'none' || parseFloat(outlineWidth) < 1)) window.dim.push(e.id || e.outerHTML.slice(0, 60));
        return window.shown().every((one) => window.visited.has(one) || one.type === 'radio');
      };
    })()`);
    const n = await page.eval('shown().length');
    let all = false;
    for (let k = 0; k < 2 * n && !all; k++) {
      await page.key('Tab');
      all = await page.eval('note()');
    }
    const missed = await page.eval('shown().filter((e) => !visited.has(e)).map((e) => e.id || e.outerHTML.slice(0, 80)).join()');
    is(all && n > 40, `${n} controls; not come to: ${missed}`);
    equal(await page.eval('dim.join()'), '', 'without a sign of the focus');
  });

  await test('the waveform of a point: its samples over range, and its echoes', async () => {
    // The head of this scene has no waveforms. So the page is told that its stream has them, and given one: two windows
    // of 0.15 m steps, of which the second one ends at the point's range.
    const got = await page.eval(`(async () => {
      const {head, view, cloud} = scanhead, block = cloud.blocks[0];
      const point = {x: 0, y: 0, z: 0, pulse: block.pulse0 + block.pulse[7], range: block.range[7], scan: block.scan, station: block.station};
      const path = () => [...document.querySelectorAll('#point .samples')].map((e) => e.getAttribute('d'));
      head.askWaves = (pulse, scan) => (window.asked = [pulse, scan].join());
      view.dispatchEvent(new CustomEvent('pick', {detail: {point}}));
      const before = window.asked;
      head.descriptor.content |= 4;
      view.dispatchEvent(new CustomEvent('pick', {detail: {point}}));
      const samples = (...values) => Float32Array.of(...values), last = point.range;
      const windows = [{rangeM0: 1, stepM: 0.15, samples: samples(0, 2, 0)}, {rangeM0: last - 0.6, stepM: 0.15, samples: samples(0, 0, 4, 1, 0)}];
      head.dispatchEvent(new CustomEvent('waves', {detail: {pulse: point.pulse + 1, scan: point.scan, windows}}));
      const other = path().length;
      head.dispatchEvent(new CustomEvent('waves', {detail: {pulse: point.pulse, scan: point.scan, windows}}));
      const echoes = [...document.querySelectorAll('#point .echo')].map((e) => Number(e.getAttribute('x1')));
      head.descriptor.content &= ~4;
      return {before, asked: window.asked === [point.pulse, point.scan].join(), other, paths: path(), echoes, name: document.querySelector('#point .wave').getAttribute('aria-label')};
    })()`);
    equal(got.before, undefined, 'nothing is asked of a stream without waveforms');
    equal(JSON.stringify([got.asked, got.other]), '[true,0]', 'asked for, and that of another pulse is not drawn');
    // The two windows, 0.3 m and 0.6 m, share 272 px, with 8 px between. 4 thresholds are 58 px high, up from y = 62.
    equal(got.paths.join(' '), 'M0.0 62.0L45.3 33.0L90.7 62.0 M98.7 62.0L144.0 62.0L189.3 4.0L234.7 47.5L280.0 62.0', 'samples');
    near(got.echoes.at(-1), 280, 0.01, 'the mark of the point itself');
    is(/2 parts; echoes at .* m; highest 4/.test(got.name), `its name: ${got.name}`);
  });

  await test('each thing that takes the focus has a name for screen readers', async () => {
    const {nodes} = await page.send('Accessibility.getFullAXTree');
    const focusable = nodes.filter((node) => !node.ignored && node.properties?.some(({name, value}) => name === 'focusable' && value.value));
    const nameless = focusable.filter(({name, role}) => role.value !== 'RootWebArea' && !name?.value);
    is(focusable.length > 20, `${focusable.length} of them`);
    equal(nameless.map(({role}) => role.value).join(), '', 'without a name');
  });

  equal(page.faults.join('\n'), '', 'errors of its scripts');
  const file = await saved('.shs');
  await page.close();
  await end(head);
  await testTimeLines(browser, file);
}

// The page's scale for heights and that of files (core/colour.h) have other colours between the ends, and the same hues
// in the same order: blue, green, yellow, red. At each height the hues are within 60 degrees of each other. In the
// reverse order the ends would be 240 degrees apart.
function sameMeaning() {
  const [low, high] = [-0.5, 3.5], file = `${folder}/heights.ply`;
  run('record', CONFIG, '-o', file, '--quiet', '--set', 'output.colour=height', '--set', `output.colour_limits=[${low}, ${high}]`);
  const points = plyOf(file);
  is(points.length > 1000, `${points.length} points`);
  for (const {z, rgb} of points) {
    const f = Math.min(1, Math.max(0, (z - low) / (high - low))), theirs = hue(rgb), ours = hue(rampAt('spectrum', f));
    near(((ours - theirs + 540) % 360) - 180, 0, 60, `hue at ${z} m, file ${theirs}, page ${ours}`);
  }
}

function hue([r, g, b]) {
  return (Math.atan2(Math.sqrt(3) * (g - b), 2 * r - g - b) * 180 / Math.PI + 360) % 360;
}

// Reads z and colours of a binary PLY, by its header.
function plyOf(file) {
  const bytes = readFileSync(file), head = bytes.toString('latin1', 0, bytes.indexOf('end_header\n') + 11);
  const sizes = {char: 1, uchar: 1, int8: 1, uint8: 1, short: 2, ushort: 2, int16: 2, uint16: 2, int: 4, uint: 4, int32: 4, uint32: 4,
    float: 4, float32: 4, double: 8, float64: 8};
  const vertex = head.slice(head.indexOf('element vertex'));
  let size = 0;
  const at = {};
  for (const [, type, name] of vertex.split(/\nelement (?!vertex)/)[0].matchAll(/^property (\w+) (\w+)$/gm)) {
    at[name] = [size, type];
    size += sizes[type];
  }
  const n = Number(/element vertex (\d+)/.exec(head)[1]), out = [];
  for (let i = 0; i < n; i += 23) {
    const from = head.length + i * size;
    const z = at.z[1].startsWith('double') || at.z[1] === 'float64' ? bytes.readDoubleLE(from + at.z[0]) : bytes.readFloatLE(from + at.z[0]);
    out.push({z, rgb: ['red', 'green', 'blue'].map((name) => bytes[from + at[name][0]])});
  }
  return out;
}

async function testTimeLines(browser, file) {
  let points = 0;
  await test('the time line of a recording shows the points up to a time', async () => {
    const view = await start(['view', file]);
    const page = await browser.open(view.ready.endpoints[0].endpoint, {size: [900, 480], before: `(${watches})()`});
    await page.until('scanhead.recording && scanhead.cloud.total > 0 && !document.querySelector("#timeline").hidden');
    points = await page.eval("fetch('/head').then((a) => a.json()).then((h) => h.recording.points)");
    await page.until(`scanhead.cloud.total === ${points}`);
    await shifted(page, 'a recording');
    await page.eval('scanhead.view.show({stations: false}), scanhead.view.pointSize(4)');
    const {from, to, old, young} = await page.eval(OLD_AND_YOUNG);
    const seen = async () => JSON.stringify([await page.eval(towards(old)), await page.eval(towards(young))]);
    equal(await seen(), '[true,true]', 'all points');
    const half = 0.5 * (old.t + young.t) - from;
    await choose(page, '#seek', String(half));
    equal(await seen(), '[true,false]', `up to ${half} s`);
    await choose(page, '#speed', '10');
    await page.press('#play');
    await page.until('document.querySelector("#play").textContent === "Play"'); // it has come to its end
    equal(await seen(), '[true,true]', 'played to its end');
    near(await page.eval('Number(document.querySelector("#seek").value)'), to - from, 0.05, 'the handle is at the end');
    equal(page.faults.join('\n'), '', 'errors of its scripts');
    await page.close();
    await end(view);
  });

  await test('the time line of a head that replays a recording: play, seek, speed, loop', async () => {
    const replay = await start(['run', file, '--quiet', '--link', 'type: web, waits: yes', '--link', 'type: tcp, port: 0',
      '--set', 'loop.queue_ms=10000']); // in real time the head waits for no page, and on a busy machine a page may stand still for long
    const other = new Client(endpoint(replay, 'tcp'));
    const page = await browser.open(endpoint(replay, 'web'), {size: SIZE});
    await page.until('!document.querySelector("#timeline").hidden && !document.querySelector("#play").disabled');
    await choose(page, '#speed', '10');
    await page.press('#play');
    const status = async () => (await other.ask('SCAN:REPL?')).split(',');
    await other.until('SCAN:REPL?', (reply) => reply.startsWith('IDLE') && Number(reply.split(',')[1]) > 0);
    const [, , length, speed] = await status();
    equal(speed, '10', 'its speed');
    await page.until(`scanhead.cloud.total === ${points}`);
    await choose(page, '#seek', String(0.6 * Number(length)));
    await page.until(`scanhead.cloud.total > 0 && scanhead.cloud.total < ${points}`); // from there on there are fewer
    await other.until('SCAN:REPL?', (reply) => reply.startsWith('IDLE'));
    await page.click('#loop');
    await other.until('SCAN:REPL?', (reply) => reply.endsWith('ON'));
    const came = await page.eval('scanhead.head.figures().points');
    await page.press('#play');
    await page.until(`scanhead.head.figures().points > ${came + 3 * points}`);
    is(await page.eval('scanhead.cloud.total') <= points, 'each round is shown once');
    equal(await page.eval('scanhead.head.figures().left_out_frames'), 0, 'frames that the page was too slow for');
    equal(await page.eval('scanhead.head.figures().unplaced_points'), 0, 'points without a place');
    equal(page.faults.join('\n'), '', 'errors of its scripts');
    await page.close();
    await end(replay);
  });
}
