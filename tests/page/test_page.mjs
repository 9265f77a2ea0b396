/* SPDX-License-Identifier: MIT */
// This tests the page of a head, of a recording, and of a head that goes, in one browser. Other programs compute the
// expected values: `record`, the Python client, and a client by TCP.
import {createServer} from 'node:http';
import {connect} from 'node:net';
import {readFileSync} from 'node:fs';
import {Browser} from './browser.mjs';
import {Client, end, endpoint, start} from './head.mjs';
import {testFields} from './fields.mjs';
import {testInstrument} from './instrument.mjs';
import {both, CONFIG, placesToDrag, recorded} from './rig.mjs';
import {testTools} from './tools.mjs';
import {appliedTest, trialTests} from './trial.mjs';
import {equal, finish, folder, giveUpAfter, is, near, test, whenFailed} from './work.mjs';

const SIZE = [600, 480], SMALL = [360, 300]; // drawing in software takes most of the time
giveUpAfter(1100); // run_tap.sh would give up later

// Opens a head, its page, and another client that asks the head.
async function open(browser, ...more) {
  const head = await start(['run', CONFIG, '--quiet', '--pace', 'fast', ...more]);
  const page = await browser.open(endpoint(head, 'web'), {size: SIZE});
  await page.until('scanhead.head.isOpen && scanhead.head.state === "idle" && document.querySelector("#knob-head-lines")?.value');
  await page.until('document.querySelector("#model").textContent && document.querySelector("#station-2-x_m")?.value'); // all is in place
  return {head, page, other: new Client(endpoint(head, 'tcp'))};
}

// Presses Start and waits until the page has the whole scan. The scan's end comes after its points.
async function scan(page) {
  const before = await page.eval('scanhead.head.figures().pulses');
  await page.press('#start');
  await page.until(`scanhead.head.state === "idle" && scanhead.head.figures().pulses > ${before}`);
}

const counts = (page) => page.eval(`(() => {
  const {points, empty, pulses, point_hash: hash, lost_frames, dropped_points} = scanhead.head.figures();
  return {echoes: points - empty, pulses, hash, lost: lost_frames + dropped_points, total: scanhead.cloud.total,
    bounds: scanhead.cloud.bounds};
})()`);

// The page holds positions as floats relative to the first point. So the tolerance is half a unit in the last place of
// the room's diagonal.
function sameBounds(bounds, {min, max}) {
  const tolerance = Math.hypot(...max.map((v, k) => v - min[k])) * 2 ** -24;
  min.forEach((v, k) => near(bounds.min[k], v, tolerance, `lower bound ${k}`));
  max.forEach((v, k) => near(bounds.max[k], v, tolerance, `upper bound ${k}`));
}

// This is the event that the picture sends when the user drops a station.
const dragged = ([x, y, z]) => `scanhead.view.dispatchEvent(new CustomEvent('move', {detail: {station: 1, x: ${x}, y: ${y}, z: ${z}, heading_deg: 30}}))`;
const IS_RED = `getComputedStyle(document.querySelector('#banner')).color === (() => {
  const probe = document.body.appendChild(document.createElement('i'));
  probe.style.color = 'var(--bad)';
  const {color} = getComputedStyle(probe);
  probe.remove();
  return color;
})()`;

// This runs in a page before its scripts. It notes a pixel of each WebGL canvas at the end of the task that made it, or
// changed its size. The browser shows the canvas as it is then.
function seesBlack() {
  window.seen = [];
  const look = (canvas) => queueMicrotask(() => {
    const gl = canvas.gl, pixel = new Uint8Array(4);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, null);
    gl.readPixels(1, 1, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
    window.seen.push([...pixel]);
  });
  const {getContext} = HTMLCanvasElement.prototype;
  HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
    const context = getContext.call(this, kind, ...more);
    if (kind === 'webgl2' && !this.gl) look(Object.assign(this, {gl: context}));
    return context;
  };
  for (const side of ['width', 'height']) {
    const {get, set} = Object.getOwnPropertyDescriptor(HTMLCanvasElement.prototype, side);
    Object.defineProperty(HTMLCanvasElement.prototype, side, {get, set(value) {
      set.call(this, value);
      if (this.gl) look(this);
    }});
  }
}

const browser = new Browser({size: SIZE});
const {head, page, other} = await open(browser, '--journal', `${folder}/journal`);
whenFailed(async () => `head: ${await other.ask('HEAD:STATE?')}, ${await other.ask('TIME?')} ns\n${await page.knows()}`);

await test('without control nothing that the user does reaches the head', async () => {
  for (const at of ['#knob-head-lines', '#reset']) {
    is(await page.eval(`document.querySelector("${at}").disabled`), `${at} is disabled`);
    equal(await page.eval(`document.querySelector("${at}").getClientRects().length`), 0, `${at} as it is shown`);
  }
  await page.eval(dragged([1, 1, 1.6]));
  const banner = await page.until('!document.querySelector("#banner").hidden && document.querySelector("#banner").textContent');
  is(banner.startsWith('Station 1 stays where it is'), `the banner says so: ${banner}`);
  is(await page.eval(IS_RED) === false, 'a notice is not shown as an error');
  equal(await other.ask('HEAD:LIN?'), '100', 'lines a second');
  equal(await other.ask('SYST:CONT?'), '0', 'the session in control');
  equal(await other.ask('SYST:ERR:COUN?'), '0', 'refused commands');
});

await trialTests(page, other, SIZE);

const wanted = recorded('first', ['head.lines_hz=60']);

await test('its user takes control by a button, and a knob changes the setting of the head', async () => {
  await page.press('#control');
  await page.until('scanhead.head.mine && !document.querySelector("#knob-head-lines").disabled');
  is(await other.ask('SYST:CONT?') !== '0', 'another client sees that a session has control');
  await page.fill('#knob-head-lines', 60);
  equal(await other.until('HEAD:LIN?', (reply) => reply !== '100'), '60', 'lines a second');
  is((await other.ask('HEAD:LIN 70')).startsWith('ERR -203'), 'another client is refused');
});

await test('a scan: points, bounds and hash are those of the recording', async () => {
  await scan(page);
  const has = await counts(page);
  equal(has.lost, 0, 'lost frames and dropped points');
  equal(has.pulses, wanted.shots, 'pulses');
  equal(has.echoes, wanted.points, 'echoes');
  equal(has.total, wanted.points, 'points of the cloud');
  equal(has.hash, wanted.hash, 'hash over all records');
  sameBounds(has.bounds, wanted);
  await page.eval('scanhead.view.show({points: false})'); // counts are enough for the rest
});

await test('a page that is opened later, or again, has the same points', async () => {
  const late = await browser.open(endpoint(head, 'web'), {size: SMALL});
  for (const times of [1, 2]) {
    await late.until(`scanhead.cloud.total === ${wanted.points} && scanhead.head.figures().past_pulses === ${wanted.shots}`);
    const has = await late.eval(`(() => {
      const {points, past_points, past_pulses, past_hash: hash, lost_frames, missing_pulses, unplaced_points} = scanhead.head.figures();
      return {points, past_points, past_pulses, hash, amiss: lost_frames + missing_pulses + unplaced_points, bounds: scanhead.cloud.bounds};
    })()`);
    equal(has.points, 0, 'points by its connection');
    equal(has.past_pulses, wanted.shots, 'pulses from before');
    equal(has.hash, wanted.hash, 'hash of these');
    equal(has.amiss, 0, 'lost, missing, without a place');
    sameBounds(has.bounds, wanted);
    if (times === 1) await late.go(endpoint(head, 'web'));
  }
  await late.close();
});

await testTools(browser, endpoint(head, 'web'), wanted.points);

await test('a station dragged in the picture is where the next scan is made', async () => {
  await page.until('scanhead.view.movable');
  await page.drag(...await placesToDrag(page));
  const pose = (await other.until('SITE:POSE? 1', (reply) => /^[^E]*[1-9]/.test(reply.split(',').slice(0, 2).join()))).split(',').map(Number);
  is(Math.hypot(pose[0] - 1.5, pose[1] - 2) < 0.05, `the station is where it was let go: ${pose}`);
  equal(pose[2], 1.6, 'its height');
  const moved = recorded('moved', ['head.lines_hz=60', `stations.0.position_m=[${pose.slice(0, 3)}]`]);
  is(moved.hash !== wanted.hash, 'another place gives another scan');
  await scan(page);
  const has = await counts(page);
  equal(has.echoes, wanted.points + moved.points, 'echoes of both scans');
  equal(has.hash, both(wanted.hash, moved.hash), 'hash of both scans');
  equal(await page.eval('scanhead.cloud.count'), moved.points, 'points held: those from its old place are gone');
});

await test('the fields have the place of a station as soon as it is let go, and the old one when the head refuses it', async () => {
  const fields = '["x_m", "y_m"].map((key) => document.querySelector(`#station-1-${key}`).value).join()';
  const [was, put] = await page.eval(`(() => { const was = ${fields}; ${dragged([0.25, -0.5, 1.6])}; return [was, ${fields}]; })()`);
  equal(put, '0.25,-0.5', 'as it is let go');
  await other.until('SITE:POSE? 1', (reply) => reply.startsWith('0.25,-0.5,'));
  await page.until(`document.querySelector('#panel-stations .place').textContent.startsWith('0.25')`);
  equal(await page.eval(`${dragged([2e9, 0, 1.6])}; ${fields}`), '2000000000,0', 'where no station may be');
  await page.until('!document.querySelector("#banner").hidden');
  equal(await page.eval(fields), '0.25,-0.5', `the place that holds; at first it was ${was}`);
});

await appliedTest(page, other);

await test('the picture is never black: not before the first one, and not when its size changes', async () => {
  const other = await browser.open(endpoint(head, 'web'), {size: SMALL, before: `(${seesBlack})()`});
  await other.until('scanhead.view.state.drawn > 0');
  await other.eval('scanhead.view.screenshotReady()');
  const sizes = await other.eval('seen.length');
  await other.resize(300, 420);
  await other.until(`seen.length > ${sizes}`);
  equal(await other.eval('JSON.stringify(seen.filter((pixel) => pixel.slice(0, 3).join() === "0,0,0"))'), '[]', 'black pixels');
  await other.close();
});

await test('control is given back by the button, and then anybody may have it', async () => {
  await page.press('#control');
  await other.until('SYST:CONT?', (reply) => reply === '0');
  equal(await other.ask('HEAD:LIN 70'), 'OK', 'a setting of another client');
  await page.until('scanhead.head.controller !== 0 && document.querySelector("#control").disabled');
  const wanted = `${other.name} has control`; // the name has its kind of link and its address
  await page.until(`document.querySelector("#owner").textContent === ${JSON.stringify(wanted)}`);
  const late = await browser.open(endpoint(head, 'web'), {size: SMALL});
  await late.until(`document.querySelector("#owner").textContent === ${JSON.stringify(wanted)}`);
  await late.close();
});

await test('another site gets no byte of it', async () => {
  const site = createServer((_, answer) => answer.setHeader('content-type', 'text/html').end('<title>other</title>'));
  await new Promise((done) => site.listen(0, '127.0.0.1', done));
  const foreign = await browser.open(`http://127.0.0.1:${site.address().port}/`, {size: [300, 200]});
  const url = endpoint(head, 'web'), {host} = new URL(url);
  const refused = (init) => foreign.eval(`fetch("${url}head", ${JSON.stringify(init)}).then(() => false, () => true)`);
  is(await refused({}), 'fetch fails');
  is(await refused({mode: 'cors', headers: {'x-any': '1'}}), 'fetch with a field of its own fails');
  is(await foreign.eval(`new Promise((done) => {
    const socket = new WebSocket("ws://${host}/ws");
    socket.onopen = () => done(false);
    socket.onerror = () => done(true);
  })`), 'its WebSocket does not open');
  await foreign.close();
  site.close();
  const bytes = await new Promise((done) => {
    let n = 0;
    connect(Number(host.split(':')[1]), '127.0.0.1', function () {
      this.write(`GET /head HTTP/1.1\r\nHost: ${host}\r\nOrigin: http://127.0.0.1:9\r\n\r\n`);
    }).on('data', (more) => (n += more.length)).on('close', () => done(n)).on('error', () => {});
  });
  equal(bytes, 0, 'bytes that came for such a request');
});

await test('when the head goes, the page says so; it finds the next one at that place', async () => {
  const port = new URL(endpoint(head, 'web')).port;
  await end(head);
  // A notice of an earlier test may still be there.
  const words = await page.until('!document.querySelector("#banner").hidden && /^Not/.test(document.querySelector("#banner").textContent) && document.querySelector("#banner").textContent');
  is(/Not connected .*(the head has ended|the head is gone)/.test(words), `the banner says so: ${words}`);
  equal(await page.eval(IS_RED), true, 'as an error');
  equal(await page.eval('scanhead.cloud.total > 0'), true, 'what came stays');
  const next = await start(['run', CONFIG, '--quiet', '--pace', 'fast', '--set', `links.0.port=${port}`]);
  await page.until('scanhead.head.state === "idle" && document.querySelector("#banner").hidden');
  await end(next);
  equal(page.faults.join('\n'), '', 'errors of its scripts');
});

await test('nothing but what was done by hand had an effect on the head', () => {
  const commands = readFileSync(`${folder}/journal`, 'latin1').split('\n').filter((line) => /^\d/.test(line))
    .map((line) => line.split(' ').slice(3).join(' ').toUpperCase().replace(/(SITE:POSE \d),.*/, '$1'));
  const wanted = ['HEAD:LINES 60', 'SCAN:START', 'SITE:POSE 1', 'SCAN:START', 'SITE:POSE 1', 'SITE:POSE 2', 'HEAD:LIN 70', 'END'];
  equal(commands.join('; '), wanted.join('; '), 'the journal');
});

await test('a recording: its page has as many points', async () => {
  const view = await start(['view', wanted.file]);
  const page = await browser.open(view.ready.endpoints[0].endpoint, {size: SMALL});
  await page.until(`scanhead.cloud.total === ${wanted.points}`);
  sameBounds(await page.eval('scanhead.cloud.bounds'), wanted);
  equal(page.faults.join('\n'), '', 'errors of its scripts');
  await end(view);
});

await testFields(browser);
await testInstrument(browser);

await browser.end();
finish();
