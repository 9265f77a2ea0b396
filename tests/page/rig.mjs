/* SPDX-License-Identifier: MIT */
// This has the scene of the page's tests, and the figures that the page must show of it.
import {execFileSync} from 'node:child_process';
import {resolve} from 'node:path';
import {run} from './head.mjs';
import {folder, write} from './work.mjs';

const ROOT = new URL('../..', import.meta.url).pathname;

/** A room with glass and a mirror gives several echoes a pulse and 50,000 points. There are two stations. */
export const CONFIG = write('page.yaml', `head: {profile: riegl-vz400i, prr_hz: 100000, lines_hz: 100, pan_deg_s: 150, pan_stop_deg: 180, frames: 1}
scene: {meshes: [{file: ${resolve(ROOT, 'config/scenes/glass_room.obj')}, up: z, scale: 1}]}
stations:
  - {name: middle, position_m: [0, 0, 1.6], heading_deg: 30}
  - {name: corner, position_m: [-3, 5, 1.4], heading_deg: 200}
output: {crs: local}
beam: {mode: adaptive}
links: [{type: web, waits: yes}, {type: tcp}]
`);

/** Records the same scan and returns {points, shots, min, max, hash, file}. Code apart from the page's counts them. */
export function recorded(name, settings, ...options) {
  const file = `${folder}/${name}.shs`;
  run('record', CONFIG, '-o', file, '--quiet', ...options, ...settings.flatMap((s) => ['--set', s]));
  const text = execFileSync('/usr/bin/python3', [`${ROOT}tests/page/counts.py`, file], {encoding: 'utf8'});
  return {...JSON.parse(text), file};
}

// Waits until the element is where it was two frames before: a page that has just got another size moves it.
async function standsStill(page, selector) {
  const place = () => page.eval(`new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => {
    const {left, top, width, height} = document.querySelector('${selector}').getBoundingClientRect();
    done([left, top, width, height].join());
  })))`);
  for (let was = '', now = await place(); now !== was;) [was, now] = [now, await place()];
}

/** Returns two places on the screen: where station 1 stands, at the origin, and (1.5, 2) of the scene at its height. */
export async function placesToDrag(page) {
  await page.click('#fit');
  await page.where('#picture');
  await standsStill(page, '#picture');
  return page.eval(`(() => {
    const {left, top} = document.querySelector('#picture').getBoundingClientRect();
    const at = (x, y) => { const p = scanhead.view.camera.project([x, y, 1.6]); return [left + p.x, top + p.y]; };
    return [at(0, 0), at(1.5, 2)];
  })()`);
}

/** Gives a field another value, as its user does. */
export const choose = (page, selector, value) => page.eval(`(() => {
  const field = document.querySelector(${JSON.stringify(selector)});
  field.value = ${JSON.stringify(value)};
  field.dispatchEvent(new Event('input', {bubbles: true}));
  field.dispatchEvent(new Event('change', {bubbles: true}));
})()`);

/** Returns the sum of two hashes, which is the hash of the records of both scans. */
export function both(a, b) {
  const half = (at) => ((parseInt(a.slice(at, at + 8), 16) + parseInt(b.slice(at, at + 8), 16)) >>> 0).toString(16).padStart(8, '0');
  return half(0) + half(8);
}
