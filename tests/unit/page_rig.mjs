/* SPDX-License-Identifier: MIT */
// This file has what the tests of the page's pure parts share: comparing, samples of the protocol, points, a camera.
import {readFileSync} from 'node:fs';
import {Camera} from '../../drivers/link/web/view_camera.js';

export function near(ours, theirs, tolerance, what) {
  if (!(Math.abs(ours - theirs) <= tolerance)) throw new Error(`${what}: ${ours}, and not ${theirs}, by more than ${tolerance}`);
}
export const same = (ours, theirs, what = '') => {
  const [a, b] = [ours, theirs].map((v) => JSON.stringify(v));
  if (a !== b) throw new Error(`${what}: ${a}, and not ${b}`);
};

export function equal(ours, theirs, what) {
  if (!Object.is(ours, theirs)) throw new Error(`${what}: ${ours}, and not ${theirs}`);
}

export function throws(run, words) {
  try {
    run();
  } catch (error) {
    if (!error.message.includes(words)) throw new Error(`"${error.message}" has no "${words}"`);
    return;
  }
  throw new Error(`no error: ${words}`);
}

// Reads the frames of SAMPLES.md.
export function readSamples() {
  const page = readFileSync(new URL('../../drivers/protocol/SAMPLES.md', import.meta.url), 'utf8');
  return [...page.matchAll(/```text\n(d5 [0-9a-f \n]*)```/g)].map(([, hex]) => Buffer.from(hex.replace(/\s/g, ''), 'hex'));
}

// Makes n points; place(i) gives x, y, z.
export function batch(n, place, {scan = 1, station = 1, pulse0 = 0, t = new Float32Array(n)} = {}) {
  const f64 = () => new Float64Array(n), f32 = () => new Float32Array(n);
  const b = {n, shots: n, scan, station, frame: 0, line: 0, pulse0, x: f64(), y: f64(), z: f64(), pulse: f64(), t, range: f32(),
    reflectance: f32().fill(NaN), amplitude: f32().fill(NaN), label: new Uint16Array(n), echo: new Uint8Array(n).fill(1),
    echoes: new Uint8Array(n).fill(1), rgb: null};
  for (let i = 0; i < n; i++) {
    [b.x[i], b.y[i], b.z[i]] = place(i);
    b.pulse[i] = pulse0 + i;
    b.range[i] = i;
  }
  return b;
}

export function camera(change = {}) {
  return Object.assign(new Camera(), {width: 800, height: 600, target: [0, 0, 0], distance: 10, azimuth: 0, elevation: 0}, change);
}
