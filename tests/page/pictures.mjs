/* SPDX-License-Identifier: MIT */
// make page-pictures: this makes pictures of the page in three widths and both themes, for people to look at. The
// pictures show a scan in progress and when it is done, stations that are tried, the tools, and a recording.
//   node tests/page/pictures.mjs [--out FOLDER] [--only WORD] [--best FILE]
// --best makes only the picture of the README: config/demo.yaml from its three stations, 1280 x 900.
import {mkdirSync, readFileSync, writeFileSync} from 'node:fs';
import {parseArgs} from 'node:util';
import {Browser} from './browser.mjs';
import {end, endpoint, run, start} from './head.mjs';
import {inFewColours} from './png8.mjs';
import {folder} from './work.mjs';

const SIZES = [[360, 740], [1280, 900], [2560, 1440]];
const {values} = parseArgs({options: {out: {type: 'string', default: 'build/pictures'}, only: {type: 'string', default: ''},
  best: {type: 'string'}}});
const links = ['--set', `links.0.path=${folder}/pty`];
if (values.best === undefined) mkdirSync(values.out, {recursive: true});
const browser = new Browser();

// With pace step the scan stands still as long as the pictures take. The page grants the time, as it has control.
const head = await start(['run', 'config/demo.yaml', '--quiet', '--pace', 'step', '--view', ...links]);

async function shots(name) {
  for (const size of SIZES) {
    for (const dark of [false, true]) {
      const file = `${values.out}/${name}_${size[0]}_${dark ? 'dark' : 'light'}.png`;
      if (!file.includes(values.only)) continue;
      await page.resize(...size);
      await page.dark(dark);
      await settled();
      await page.shot(file);
      console.log(file);
    }
  }
}

// Waits until all points are drawn and the page has its once-a-second answers.
async function settled() {
  await page.eval('new Promise((done) => setTimeout(done, 1500))');
  await page.eval('scanhead.view.screenshotReady()');
  await page.eval('new Promise((done) => setTimeout(done, 300))');
}

// Shows the tools of the picture: a height cut, a distance, the panorama.
async function tools() {
  await page.resize(1600, 900);
  await page.eval('scrollTo(0, 0)');
  await page.click('#tool-section');
  await page.click('#tool-panorama');
  await page.click('#tool-measure');
  await settled();
  for (const share of [0.45, 0.55]) {
    await page.clickAt(await page.eval(`(() => { const {left, top, width, height} = scanhead.view.canvas.getBoundingClientRect();
      return [left + ${share} * width, top + 0.7 * height]; })()`));
    await page.eval('new Promise((done) => setTimeout(done, 500))');
  }
  await shots('tools');
  for (const name of ['measure', 'panorama', 'section']) await page.click(`#tool-${name}`);
  await page.click('#section-off');
  await page.key('Escape');
}

let page = await browser.open(endpoint(head, 'web'));
const grant = async (s) => {
  for (let k = 0; k < 5 * s; k++) await page.eval("scanhead.head.command('TIME:STEP 200 MS')");
};
await page.until('scanhead.head.isOpen && !document.querySelector("#control").disabled');
await page.click('#control');
await page.until('scanhead.head.mine');
await grant(1);
await page.until('!document.querySelector("#start").disabled');
await page.click('#start');
await grant(3);
if (values.best === undefined) await shots('progress');
await grant(4);
await page.until('scanhead.head.state === "idle"');
if (values.best === undefined) {
  await shots('done');
  await page.press('#try');
  await page.until('scanhead.trial.reach && !scanhead.trial.isBusy');
  await page.click('#trial-suggest');
  await page.until('scanhead.trial.next');
  await shots('trial');
  await page.press('#trial-end');
  await tools();
} else {
  for (const station of [2, 3]) {
    await page.eval(`scanhead.head.command('HEAD:STATION ${station}')`);
    await page.click('#start');
    await grant(7);
    await page.until('scanhead.head.state === "idle"');
  }
  await page.eval('scrollTo(0, 0)');
  await page.resize(1280, 900);
  await page.dark(false);
  await page.eval('scanhead.view.screenshotReady()');
  await page.eval('scanhead.view.camera.distance *= 0.84, scanhead.view.camera.target[2] -= 0.5, scanhead.view.cameraMoved()');
  await settled();
  await page.shot(values.best);
  writeFileSync(values.best, inFewColours(readFileSync(values.best)));
}
await end(head);

if (values.best === undefined) {
  const file = `${folder}/demo.shs`;
  run('record', 'config/demo.yaml', '--quiet', '-o', file, '--set', 'head.prr_hz=300000');
  const view = await start(['view', file]);
  page = await browser.open(view.ready.endpoints[0].endpoint);
  const {recording: {points}} = await page.eval("fetch('/head').then((answer) => answer.json())");
  await page.until(`scanhead.cloud.total === ${points}`);
  await shots('recording');
  await end(view);
}
process.exit(0);
