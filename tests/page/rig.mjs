/* SPDX-License-Identifier: MIT */
// This module has the scene of the page's tests, and the figures that the page must show of it.
import {execFileSync} from 'node:child_process';
import {resolve} from 'node:path';
import {run} from './head.mjs';
import {folder, write} from './work.mjs';

const ROOT = new URL('../..', import.meta.url).pathname;

/** It is a room with glass and a mirror, several echoes a pulse, 50,000 points and two stations. */
export const CONFIG = write('page.yaml', `head: {profile: riegl-vz400i, prr_hz: 100000, lines_hz: 100, pan_deg_s: 150, pan_stop_deg: 180, frames: 1}
scene: {meshes: [{file: ${resolve(ROOT, 'config/scenes/glass_room.obj')}, up: z, scale: 1}]}
stations:
  - {name: middle, position_m: [0, 0, 1.6], heading_deg: 30}
  - {name: corner, position_m: [-3, 5, 1.4], heading_deg: 200}
output: {crs: local}
beam: {mode: adaptive}
links: [{type: web, waits: yes}, {type: tcp}]
`);

/** What \`record\` makes of the same scan: {points, shots, min, max, hash, file}, counted by code that the page has not. */
export function recorded(name, settings, ...options) {
  const file = `${folder}/${name}.shs`;
  run('record', CONFIG, '-o', file, '--quiet', ...options, ...settings.flatMap((s) => ['--set', s]));
  const text = execFileSync('/usr/bin/python3', [`${ROOT}tests/page/counts.py`, file], {encoding: 'utf8'});
  return {...JSON.parse(text), file};
}

/** Returns the sum of two hashes, those of the records of both scans. */
export function both(a, b) {
  const half = (at) => ((parseInt(a.slice(at, at + 8), 16) + parseInt(b.slice(at, at + 8), 16)) >>> 0).toString(16).padStart(8, '0');
  return half(0) + half(8);
}
