/* SPDX-License-Identifier: MIT */
// The page's panels without a browser: contrast of its colours, a head's description of its settings, events in words,
// the files of a recording. Expected values are by hand.
import {readFileSync} from 'node:fs';
import {asSent, duration, fixed, metres, grouped, numberOf, placeText, short} from '../../drivers/link/web/page.js';
import {describeSettings, splitReply} from '../../drivers/link/web/describe.js';
import {limit, shortened} from '../../drivers/link/web/knobs.js';
import {Bar} from '../../drivers/link/web/bar.js';
import {limitText, limitsOf} from '../../drivers/link/web/limits.js';
import {ptpText} from '../../drivers/link/web/figures.js';
import {fetchSaved, savedWords} from '../../drivers/link/web/save.js';
import {eventWords} from '../../drivers/link/web/log.js';
import {Session, stateWord} from '../../drivers/link/web/session.js';
import {batchesOf, countWithin, fetchCloud, readMesh} from '../../drivers/link/web/recording_files.js';
import {batchOf, countSeen, parseCells, parsePreview, parseReach, pathOf, seenWithin} from '../../drivers/link/web/previews.js';
import {NONE, sampleOf, valuesOf} from '../../drivers/link/web/view_colours.js';
import {Cloud, pointOf} from '../../drivers/link/web/cloud.js';
import {Trial} from '../../drivers/link/web/trial.js';
import {cellAt, pairsOf, seenBy} from '../../drivers/link/web/trial_targets.js';
import {Section} from '../../drivers/link/web/section.js';
import {drawLegend} from '../../drivers/link/web/picture.js';
import {same as equal} from './page_rig.mjs';
import {runTests, test} from './page_tap.mjs';

const web = new URL('../../drivers/link/web/', import.meta.url);
const page = readFileSync(new URL('index.html', web), 'utf8'), css = readFileSync(new URL('style.css', web), 'utf8');
const tools = readFileSync(new URL('tools.css', web), 'utf8');

// WCAG 2.1, relative luminance and contrast ratio.
const channel = (v) => (v <= 0.03928 ? v / 12.92 : ((v + 0.055) / 1.055) ** 2.4);
const luminance = (hex) => [0.2126, 0.7152, 0.0722].reduce((sum, weight, i) =>
  sum + weight * channel(parseInt(hex.slice(1 + 2 * i, 3 + 2 * i), 16) / 255), 0);
const contrast = (a, b) => {
  const [lo, hi] = [luminance(a), luminance(b)].sort((x, y) => x - y);
  return (hi + 0.05) / (lo + 0.05);
};

const themes = Object.fromEntries([['light', ':root {'], ['dark', ":root[data-theme='dark'] {"]].map(([name, head]) => {
  const block = css.slice(css.indexOf(head), css.indexOf('}', css.indexOf(head)));
  return [name, Object.fromEntries([...block.matchAll(/--([\w-]+): (#[0-9a-f]{6});/g)].map(([, key, value]) => [key, value]))];
}));
const grounds = ['panel', 'field', 'ground'];
const texts = grounds.flatMap((ground) => ['ink', 'soft', 'accent', 'good', 'warn', 'bad'].map((ink) => [ink, ground]))
  .concat([['on-accent', 'accent'], ['bad', 'bad-ground']]);

test('contrast: black on white is 21', () => equal(contrast('#000000', '#ffffff'), 21));
for (const [name, colours] of Object.entries(themes)) {
  test(`contrast of ${name}: text 4.5, edges of controls 3`, () => {
    for (const [ink, ground] of texts) {
      const ratio = contrast(colours[ink], colours[ground]);
      if (!(ratio >= 4.5)) throw new Error(`--${ink} on --${ground}: ${ratio.toFixed(2)}`);
    }
    for (const ground of ['panel', 'field']) {
      const ratio = contrast(colours.edge, colours[ground]);
      if (!(ratio >= 3)) throw new Error(`--edge on --${ground}: ${ratio.toFixed(2)}`);
    }
  });
}

test('a wide page has a place for each part, also with a panorama', () => {
  const places = new Set([...(css + tools).matchAll(/grid-area: ([a-z]+);/g)].map(([, name]) => name));
  const templates = [...(css + tools).matchAll(/grid-template: ('[^;]*);/g)].map(([, text]) => text.match(/'[^']*'/g).join(' ').match(/[a-z]+/g));
  equal(templates.map((names) => [names.includes('stage') && names.includes('time'), names.filter((name) => !places.has(name))]),
    templates.map(() => [true, []]));
  equal(templates.length, 4);
});

test('a saved picture says how many items of a list its legend leaves out', () => {
  for (const [n, last] of [[20, 'and 6 more'], [14, 's13']]) {
    const texts = [], own = {fillText: (text) => texts.push(text)};
    const context = new Proxy(own, {get: (_, name) => own[name] ?? (() => {}), set: () => true});
    const items = Array.from({length: n}, (_, label) => ({label, colour: [1, 2, 3]}));
    drawLegend({getContext: () => context}, {title: 'Surface', unit: '', items}, {ground: '', ink: ''}, ({label}) => `s${label}`);
    equal(texts.at(-1), last, `${n} items`);
  }
});

test('nothing inline, nothing from elsewhere', () => {
  equal(/\sstyle=|\son\w+=|<style|https?:\/\//.test(page), false, 'index.html');
  equal(/<script(?![^>]*\ssrc="(main|theme)\.js")/.test(page), false, 'scripts');
  equal(/url\(|@import|https?:/.test(css), false, 'style.css');
});

test('each button, field and picture of the page has a name', () => {
  for (const [all] of page.matchAll(/<(?:button|input|select|canvas)\b[^>]*>[^<]*/g)) {
    const named = /aria-label="[^"]+"/.test(all) || />[^<]*\S/.test(all) || /id="theme"/.test(all); // session.js names it
    if (!named) throw new Error(all);
  }
});

test('figures in words', () => {
  equal([grouped(1234567), grouped(-0.4), grouped(-1234.5, 1), grouped(NaN), grouped(12n)],
    ['1\u2009234\u2009567', '0', '−1\u2009234.5', '–', '12']);
  equal([fixed(-0.0004, 3), fixed(-0.0005001, 3), fixed(12.345, 1), fixed(-0, 0)], ['0.000', '−0.001', '12.3', '0']);
  equal([short(-0.001), short(-0.5), placeText({x_m: -0.004, y_m: -1, z_m: 0})], ['0.00', '−0.50', '0.00  −1.00  0.00']);
  equal([short(999), short(1000), short(1234567, 'B'), short(0.1234)], ['999', '1.00\u00a0k', '1.23\u00a0MB', '0.12']);
  equal([metres(0), metres(-0.0000031), metres(0.00483), metres(12.5)], ['0 mm', '−3\u00a0µm', '4.83\u00a0mm', '12.5\u00a0m']);
  equal([metres(3e-7), metres(-1e-9)], ['0.30\u00a0µm', '<\u20090.01\u00a0µm']);
  equal([duration(1.44), duration(0.427), duration(8.42e-7), duration(0), duration(600)],
    ['1.44\u00a0s', '427\u00a0ms', '842\u00a0ns', '0\u00a0s', '10\u00a0min']);
});

test('each figure that has a row is given a text, those of faults among them', () => {
  const code = readFileSync(new URL('figures.js', web), 'utf8');
  const keys = [...code.matchAll(/^  \['([\w-]+)', '/gm)].map(([, key]) => key);
  const given = keys.filter((key) => new RegExp(`^ +'${key}':|[{ ,]'?${key}'?:|texts\\.${key} =`, 'm').test(code));
  equal(given, keys);
  equal(['repeated', 'late-frames', 'restarts'].filter((key) => !keys.includes(key)), []);
});

test('limits that can be read, none beyond what the head allows', () => {
  const of = (text, step, isUpper) => limit(text, step, isUpper).replaceAll(/\s/g, ' ');
  equal([of('59.999999', '0.000001', true), of('-39.999999', '0.000001'), of('249.999999999', '0.000000001', true)],
    ['< 60', '> −40', '< 250']);
  equal([of('0.001333333', '0.000000001'), of('0.333333333', '0.000000001', true), of('-0.333333333', '0.000000001')],
    ['0.001334', '0.3333', '−0.3333']);
  equal([of('1200000', '0.000001', true), of('0.096', '0.000001', true), of('360', '', true), of('7', '1')],
    ['1.2 M', '0.096', '360', '7']);
});

test('values in few digits; words and short numbers stay', () => {
  equal(['0.666666667', '-0.0000123456', '1000000.5', '59.999999', 'ALL', '7'].map(shortened), ['0.6667', '-0.00001235', '1000000.5', '60', 'ALL', '7']);
});

test('a reply of fields, with commas in quotes', () => {
  equal(splitReply('number,"Hz",1000,,3,0.000001,"idle fault",""'), ['number', 'Hz', '1000', '', '3', '0.000001', 'idle fault', '']);
  equal(splitReply('word,"a,b",'), ['word', 'a,b', '']);
});

const fakeHead = (replies) => ({command: async (line) => {
  if (!(line in replies)) throw new Error(`asked ${line}`);
  return replies[line];
}});

test('a head that describes its settings', async () => {
  const got = await describeSettings(fakeHead({
    'HELP?': '*IDN? HELP? HELP:SETtings?', 'HELP:SETtings?': 'HEAD:PRR SCAN:ECHoes',
    'HELP? HEAD:PRR': 'number,"Hz",1000,1200000,300000,0.000001,"all","300000 600000"',
    'HELP? SCAN:ECHoes': 'word,"",,,ALL,,"idle","ALL FIRSt"'}));
  equal(got, [
    {header: 'HEAD:PRR', kind: 'number', unit: 'Hz', min: '1000', max: '1200000', preset: '300000', step: '0.000001', states: 'all', values: ['300000', '600000']},
    {header: 'SCAN:ECHoes', kind: 'word', unit: '', min: '', max: '', preset: 'ALL', step: '', states: 'idle', values: ['ALL', 'FIRSt']}]);
});

test('an older head is asked for MIN, MAX and DEF', async () => {
  const got = await describeSettings(fakeHead({'HELP?': '*IDN? HEAD:LINes HEAD:STATe?',
    'HEAD:LINes? MIN': '3', 'HEAD:LINes? MAX': '240', 'HEAD:LINes? DEF': '120'}));
  equal(got.map(({header, min, max, preset}) => [header, min, max, preset]), [['HEAD:LINes', '3', '240', '120']]);
});

test('who has control, in words', () => {
  equal(eventWords({name: 'CONTROL', session: 17, text: 'tcp 127.0.0.1:40312'}), ['tcp 127.0.0.1:40312 has control', '']);
  equal(eventWords({name: 'CONTROL', session: 17, text: 'taken'}), ['Session 17 has control', '']);
  equal(eventWords({name: 'CONTROL', session: 0, text: 'released'}), ['Nobody has control', '']);
});

test('events in words', () => {
  equal(eventWords({name: 'SCAN_END', scan: 2, fired: 1000, lost: 0}), ['Scan 2 ends: 1\u2009000 pulses fired', '']);
  equal(eventWords({name: 'ERROR', number: -222, session: 9, held_back: 0, text: 'Data out of range'}), ['Session 9: -222 Data out of range', 'bad']);
  equal(eventWords({name: 'ERROR', number: 102, session: 0, held_back: 0, text: 'session 17, fd:3'}), ['Reader too slow (102): session 17, fd:3', 'bad']);
  equal(eventWords({name: 'ERROR', number: 107, session: 0, held_back: 0, text: 'no answer'}), ['Time server (107): no answer', 'bad']);
  equal(eventWords({name: 'PPS'}), null);
  equal(eventWords({name: 'PTP', text: 'servo s0 to s1'}), ['PTP: servo s0 to s1', '']);
  equal(eventWords({name: 'PTP', text: 'SLAVE to FAULTY on FAULT_DETECTED'}), ['PTP: SLAVE to FAULTY on FAULT_DETECTED', 'bad']);
  equal(ptpText({ptp_port: 9, ptp_servo: 2, ptp_offset_ns: -1234n}), ', PTP SLAVE, s2, \u22121\u2009234 ns');
  equal(ptpText({ptp_port: 0}), '');
  equal(eventWords({name: '', code: 99, text: 'new'}), ['Event 99: new', '']);
});

test('a head that no time was granted says what it waits for', () => {
  const session = new Session(new EventTarget());
  session.head.dispatchEvent(new CustomEvent('state', {detail: {state: 'boot'}}));
  const words = () => stateWord(session.state, session.pace);
  equal(words(), 'Self test');
  let heard = 0;
  session.addEventListener('change', () => heard++);
  session.paced('step');
  equal([words(), heard], ['Waits for time steps', 1]);
  session.head.dispatchEvent(new CustomEvent('state', {detail: {state: 'idle'}}));
  equal(words(), 'Idle');
});

test('progress follows the scan also where a replay goes back', () => {
  const elements = {};
  globalThis.document = {body: {dataset: {}}, getElementById: (id) => elements[id] ??= {dataset: {}, textContent: '', addEventListener() {}, setAttribute() {}}};
  const session = Object.assign(new EventTarget(), {link: 'open', state: 'scanning', scan: 1});
  const bar = new Bar(session, null);
  const after = (act) => (act(), bar.show(), elements.progress.textContent.replace('\u00a0', ' '));
  equal([() => bar.progress({frames: 2, frame_s: 4}), () => bar.reached(2), () => bar.progress({done: 1}), () => bar.reached(6), () => bar.reached(1), () => bar.begin()]
    .map(after), ['Scan 1: frame 1 of 2', 'Scan 1: 25 %, frame 1 of 2', 'Scan 1: 25 %, frame 2 of 2', 'Scan 1: 75 %, frame 2 of 2',
    'Scan 1: 12 %, frame 2 of 2', 'Scan 1: frame 1 of 2']);
});

test('the long-edge filter is a beginning of the sorted ratios', () => {
  const ratio = Float32Array.of(0.5, 1, 1, 2.2, 7);
  equal([0, 0.4, 1, 2.2, 6, 100].map((factor) => countWithin(ratio, factor)), [5, 0, 3, 4, 4, 5]);
});

function cloudBytes(first, total) {
  const bytes = new ArrayBuffer(56 + 64 + 12 + 4), view = new DataView(bytes);
  [0x4c434853, 1, 1, 2, first, 1, total].forEach((v, i) => view.setUint32(4 * i, v, true));
  [100, 200, 300].forEach((v, i) => view.setFloat64(32 + 8 * i, v, true));
  [['xyz', 4, 3, 120], ['station', 2, 1, 132]].forEach(([name, ...numbers], k) => {
    [...name].forEach((c, i) => view.setUint8(56 + 32 * k + i, c.charCodeAt(0)));
    numbers.forEach((v, i) => view.setUint32(56 + 32 * k + 20 + 4 * i, v, true));
  });
  [0.5, 1.5, -2].forEach((v, i) => view.setFloat32(120 + 4 * i, v, true));
  view.setUint16(132, 1 + first, true);
  return bytes;
}

test('a cloud in pieces, as batches of one station each', async () => {
  const asked = [];
  globalThis.fetch = async (path) => {
    asked.push(path);
    return {ok: true, arrayBuffer: async () => cloudBytes(asked.length - 1, 2)};
  };
  const batches = [];
  await fetchCloud('/cloud?every=1&', {take: (piece) => batches.push(...batchesOf(piece))});
  equal(asked, ['/cloud?every=1&first=0&count=200000', '/cloud?every=1&first=1&count=1']);
  equal(batches.map(({n, station, x, y, z, pulse, label}) => [n, station, x[0], y[0], z[0], pulse[0], label[0]]),
    [[1, 1, 100.5, 201.5, 298, 0, 65535], [1, 2, 100.5, 201.5, 298, 1, 65535]]);
});

test('points of a file without stations have none', () => {
  const cloud = new Cloud();
  for (const batch of batchesOf({n: 1, first: 0, every: 1, origin: [0, 0, 0], columns: {xyz: Float32Array.of(1, 2, 3)}})) cloud.add(batch);
  const [block] = cloud.blocks;
  equal([pointOf(cloud, block, 0).station, valuesOf(block, 'station', 0, 1)[0], sampleOf(cloud, 'station')], [undefined, NONE, []]);
});

test('a refusal of the link is an error with its words', async () => {
  globalThis.fetch = async () => ({ok: false, status: 400, text: async () => 'per_m2: allowed 1 to 2\n'});
  const words = await fetchCloud('/sparse?', {take() {}}).catch((error) => error.message);
  equal(words, 'per_m2: allowed 1 to 2');
});

test('what is no mesh is refused', () => {
  let words = '';
  try {
    readMesh(new ArrayBuffer(48));
  } catch (error) {
    words = error.message;
  }
  equal(words, 'not a mesh of version 1');
});

// ---- stations that are tried

// Writes little-endian values, each as [type, value ...], after a text.
function bytesOf(magic, ...parts) {
  const sizes = {Uint32: 4, Float32: 4, Float64: 8, Uint16: 2};
  const length = magic.length + parts.reduce((sum, [type, ...values]) => sum + sizes[type] * values.length, 0);
  const view = new DataView(new ArrayBuffer(length));
  [...magic].forEach((c, i) => view.setUint8(i, c.charCodeAt(0)));
  let at = magic.length;
  for (const [type, ...values] of parts) for (const value of values) view[`set${type}`](at, value, true), at += sizes[type];
  return view.buffer;
}

// Two squares of 1 m: a floor at z = 0 with cell 0, a wall at x = 1 with cell 1. The origin is (10, 0, 0).
const SQUARES = bytesOf('SHCE', ['Uint32', 1, 2, 2], ['Float64', 10, 0, 0, 1], ['Float32', 1, 1], ['Uint32', 0, 1],
  ['Float32', 0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0, 1, 0, 0, 1, 1, 0, 1, 1, 1, 1, 0, 1]);
const PREVIEW = bytesOf('SHPV', ['Uint32', 1, 7, 2, 2, 9, 8, 6], ['Float64', 10, 20, 1.5], ['Float32', 1.5, 0.5, 0.7], ['Uint32', 0, 2, 0],
  ['Float32', 3, 0, 0, 0, 4, -1], ['Float32', 3, 4.123], ['Uint16', 5, 65535]);

test('previews: bytes by hand become points, and cells that are seen', () => {
  const p = parsePreview(PREVIEW);
  equal([p.number, p.cells, p.n, p.pulses, p.hits, p.front], [7, 2, 2, 9, 8, 6]);
  equal([p.above_m, p.hides_m, Math.fround(0.7) === p.feet_m, p.origin], [1.5, 0.5, true, [10, 20, 1.5]]);
  const b = batchOf(p, 3, 4);
  equal([b.n, b.shots, b.station, b.scan], [2, 9, 3, 4]);
  equal([[...b.x], [...b.y], [...b.z], [...b.label]], [[13, 10], [20, 24], [1.5, 0.5], [5, 65535]]);
  equal([...p.seen], [2, 0], 'cell 1');
});

// Runs a trial whose head gives these answers: answer(path) returns {ok, text} or bytes of a preview.
async function tried(answer, run) {
  const {fetch} = globalThis, asked = [];
  globalThis.fetch = async (path, {signal} = {}) => {
    asked.push(path);
    signal?.throwIfAborted();
    const {status = 400, text, bytes} = answer(path);
    return {ok: bytes !== undefined, status, text: async () => text, arrayBuffer: async () => bytes};
  };
  const cloud = new Cloud(), trial = new Trial(cloud, [{number: 1, x_m: 0, y_m: 0, z_m: 1, heading_deg: 0, pitch_deg: 0, roll_deg: 0}]);
  const rests = async () => {
    while (trial.isBusy) await new Promise((done) => setTimeout(done, 1));
  };
  try {
    await rests();
    await run({trial, cloud, asked, rests});
  } finally {
    trial.end();
    globalThis.fetch = fetch;
  }
}

const onePoint = () => {
  const bytes = new ArrayBuffer(72 + 18), v = new DataView(bytes);
  new Uint8Array(bytes).set(Buffer.from('SHPV'));
  [[4, 1], [16, 1], [20, 1]].forEach(([at, n]) => v.setUint32(at, n, true));
  return bytes;
};

test('a trial: a refused place has no points; the reason stays until one is answered, and points have no time', async () => {
  let isRight = true;
  const answer = (path) => (path === '/cells' ? {text: 'no cells'} : isRight ? {bytes: onePoint()} : {text: 'too far'});
  await tried(answer, async ({trial, cloud, rests}) => {
    const [s] = trial.stations;
    equal([cloud.count, s.error, cloud.latest_s === -Infinity], [1, '', true]);
    isRight = false;
    trial.change(1, {x_m: 1e9});
    await rests();
    equal([cloud.count, s.points, s.error], [0, 0, 'too far']);
    isRight = true;
    trial.change(1, {x_m: 0});
    await rests();
    equal([cloud.count, s.error], [1, '']);
  });
});

test('a trial: a suggestion that is refused is told, not asked for again and again; nor is one beyond 16 stations', async () => {
  let words = 'height_m=9: allowed is less';
  const answer = (path) => (path.startsWith('/next') ? {text: words} : path === '/cells' ? {text: 'no cells'} : {bytes: onePoint()});
  await tried(answer, async ({trial, asked, rests}) => {
    trial.stations[0].seen = new Uint32Array(2);
    await trial.suggest();
    equal([trial.nextError, trial.isBusy], [words, false]);
    words = 'preview 1 is kept no more; ask for its place again';
    const renewed = [];
    for (let i = 0; i < 4; i++) {
      await trial.suggest();
      renewed.push(trial.isBusy);
      await rests();
    }
    equal([renewed, trial.nextError], [[true, true, true, false], words]);
    for (let i = 0; i < 16; i++) trial.add({}, trial.stations[0]);
    await rests();
    for (const s of trial.stations) s.seen = new Uint32Array(2);
    const n = asked.length;
    await trial.suggest();
    equal([trial.nextError, asked.length], ['The head can suggest a place only for up to 16 stations; there are 17.', n]);
  });
});

test('a trial that has ended asks no more for what the head has not worked out yet', async () => {
  const answer = (path) => (path === '/cells' ? {bytes: new ArrayBuffer(0)} : {bytes: onePoint()});
  await tried(answer, async ({trial, asked}) => {
    trial.end();
    await new Promise((done) => setTimeout(done, 0));
    const n = asked.filter((path) => path === '/cells').length;
    await new Promise((done) => setTimeout(done, 60)); // four times the first pause between two questions
    equal(asked.filter((path) => path === '/cells').length <= n + 1 && trial.isBlind === false, true);
  });
});

test('a number that a user has written: an empty text is none', () => {
  equal(['', ' ', '−1,5', ' 2.5 ', 'x', '1e-3', '+.5', '2.'].map(numberOf).map((v) => (Number.isNaN(v) ? null : v)), [null, null, -1.5, 2.5, null, 0.001, 0.5, 2]);
  equal(['0x10', '0b1', '1e400', 'Infinity', '1 2', '1,2,3', '1_0', '.', '--1'].filter((text) => !Number.isNaN(numberOf(text))), []);
  equal(['−1,5', ' 61 ', '60 Hz', 'MIN', '1,2,3', '0x10', ''].map(asSent), ['-1.5', '61', '60 Hz', 'MIN', '1,2,3', '0x10', '']);
});

test('limits by hand: their first texts, and what the fields have', () => {
  const texts = (from, to) => [limitText(from, to - from), limitText(to, to - from)];
  equal([texts(0.006123, 0.014), texts(-1.234567, 3.1), texts(9.999999999999999e29, 2e30), texts(0, 1000), texts(100000.0001, 100000.0002)],
    [['0.00612', '0.014'], ['-1.23', '3.1'], ['1e+30', '2e+30'], ['0', '1000'], ['100000.0001', '100000.0002']]);
  equal([limitsOf('', ' '), limitsOf('−1', '2,5')], [{limits: null, words: ''}, {limits: [-1, 2.5], words: ''}]);
  equal([['', '1'], ['1', ''], ['2', '1'], ['1', '1'], ['0', '1e400'], ['0', 'x']].filter((two) => limitsOf(...two).words === ''), []);
});

test('previews: damage is refused in words', () => {
  for (const [read, bytes, words] of [[parsePreview, PREVIEW.slice(0, -2), 'expected'], [parsePreview, SQUARES, 'SHPV'],
    [parseCells, SQUARES.slice(0, 40), 'SHCE'], [parseReach, bytesOf('SHRE', ['Uint32', 2, 1, 1]), 'version 2']]) {
    let said = '';
    try {
      read(bytes);
    } catch (error) {
      said = error.message;
    }
    equal(said.includes(words), true, said);
  }
  const beyond = SQUARES.slice(0);
  new DataView(beyond).setUint32(60, 2, true);
  let said = '';
  try {
    parseCells(beyond);
  } catch (error) {
    said = error.message;
  }
  equal(said, 'a piece beyond the 2 cells');
});

test('previews: areas seen by none, one and several; what nobody can see counts apart', () => {
  const cells = parseCells(SQUARES), none = new Uint32Array(2), wall = Uint32Array.of(2, 0), both = Uint32Array.of(3, 0);
  const sums = (seen, reach) => (({none_m2, one_m2, several_m2, hidden_m2}) => [none_m2, one_m2, several_m2, hidden_m2])(countSeen(cells, seen, reach));
  equal(sums([]), [2, 0, 0, 0]);
  equal(sums([wall, none]), [1, 1, 0, 0]);
  equal(sums([wall, both]), [0, 1, 1, 0]);
  equal(sums([none], wall), [2, 0, 0, 1]);
  equal([...parseReach(bytesOf('SHRE', ['Uint32', 1, 33, 4, 5, 1]))], [5, 1]);
  equal(pathOf('preview', {station: 1, far_m: null, x_m: -2.5}), '/preview?station=1&x_m=-2.5');
});

test('previews: of one room, only what lies in the section counts, and not what nobody can see', () => {
  const cells = parseCells(SQUARES), counts = Uint8Array.of(1, 0); // the floor is seen; its middle is (10.5, 0.5, 0), the wall's (11, 0.5, 0.5)
  const share = (section, reach = null) => (({seen_m2, all_m2}) => [seen_m2, all_m2])(seenWithin(cells, counts, reach, new Section(section)));
  equal(share({middle: [10.75, 0.5, 0.25], half: [1, 1, 1]}), [1, 2], 'both');
  equal(share({middle: [10.75, 0.5, 0.25], half: [1, 1, 1]}, Uint32Array.of(1, 0)), [1, 1], 'nobody can see the wall');
  equal(share({middle: [11, 0.5, 0.5], half: [0.2, 1, 0.2]}), [0, 1], 'the wall');
  equal(share({kind: 'height', middle: [500, 500, 0], half: [1, 1, 0.1]}), [1, 1], 'a height cut has the floor, however far its middle');
  equal(share({middle: [50, 0, 0], half: [1, 1, 1]}), [0, 0], 'nothing');
});

test('a saved file: its number is in each request, another page\'s file is refused, and what it lacks is said', async () => {
  const asked = [], bytes = Uint8Array.of(7, 8, 9);
  const answers = (status) => (globalThis.fetch = async (path) => {
    asked.push(path);
    return path.startsWith('/saved') ? new Response(bytes) : new Response(JSON.stringify(status(path)));
  });
  answers(() => ({state: 'done', as: 'las', file: 4, bytes: 3, gone: 0, lost_frames: 2}));
  const saved = await fetchSaved('las');
  equal([asked, saved.blob.size, savedWords(saved)], [['/save?as=las', '/saved?file=4&from=0'], 3, 'Saved, without 2 stream frames that were lost.']);
  equal(savedWords({gone: 0, lost_frames: 0}), 'Saved.');
  answers((path) => (path === '/save' ? {state: 'done', as: 'ply', file: 5, bytes: 3} : {state: 'working', as: 'las', file: 4, bytes: 0}));
  let said = '';
  await fetchSaved('las').catch((error) => (said = error.message));
  equal(said, 'The file is gone: another page began one. Save it again.');
  answers((path) => ({state: path === '/save' ? 'idle' : 'working', as: 'las', file: 4, bytes: 0}));
  await fetchSaved('las').catch((error) => (said = error.message));
  equal(said, 'The head could not write the file.');
});

test('targets: the cell of a place, the stations that see it, and what pairs have in common', () => {
  const cells = parseCells(SQUARES);
  equal([cellAt(cells, [10.5, 0.5, 0]), cellAt(cells, [11, 0.5, 0.5]), cellAt(cells, [10.95, 0.5, 0]), cellAt(cells, [11, 0.5, 0.05]),
    cellAt(cells, [20, 0, 0])], [0, 1, 0, 1, null]);
  const stations = [{number: 1, seen: Uint32Array.of(1, 0)}, {number: 4, seen: Uint32Array.of(3, 0)}, {number: 6, seen: null}];
  equal([seenBy(stations, 0), seenBy(stations, 1)], [[1, 4], [4]]);
  equal(pairsOf(stations, [[1, 4], [4], [1, 4]]), [[1, 4, 2], [1, 6, 0], [4, 6, 0]]);
});

await runTests();
