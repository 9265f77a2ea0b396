/* SPDX-License-Identifier: MIT */
// This module has the colours of points: each mode with its values, ramp, limits and legend. The module is pure.
//
// A point has one number, which the shader turns into a colour: `ramp` by a table of 256 colours between the limits,
// `list` by a table of colours by number, `rgb` as it is. An unknown value is GREY, not the end of a ramp.

import {spreadOver} from './cloud.js';
import {parse, rampAt} from './view_ramps.js';

export {rampAt};
export const NONE = Math.fround(-1e30); // it replaces NaN in shaders, and is exact as a float
export const GREY = [128, 132, 138];

// These are the modes, in the order of the menu. least is the smallest difference of a ramp's limits, so that it does
// not show rounding.
export const MODES = {
  height: {title: 'Height', unit: 'm', kind: 'ramp', ramp: 'spectrum', least: 0.01},
  range: {title: 'Range', unit: 'm', kind: 'ramp', ramp: 'spectrum', least: 0.01},
  reflectance: {title: 'Reflectance', unit: 'dB', kind: 'ramp', ramp: 'steel', least: 0.1},
  amplitude: {title: 'Amplitude', unit: 'dB', kind: 'ramp', ramp: 'steel', least: 0.1},
  label: {title: 'Surface', unit: '', kind: 'list'},
  echo: {title: 'Echo', unit: '', kind: 'list'},
  station: {title: 'Station', unit: '', kind: 'list'},
  age: {title: 'Age', unit: '', kind: 'ramp', ramp: 'ember'},
  rgb: {title: 'Colour', unit: '', kind: 'rgb'},
};

const ECHOES = [['only echo', '#5aa9e6'], ['first of several', '#f4a259'], ['between', '#b07bd6'], ['last of several', '#5fbf77']];

// Hues are a golden angle apart, with lightness in four steps, so that neighbouring numbers differ most.
function listColour(k) {
  const hue = (k * 137.508 + 210) % 360, light = [0.58, 0.48, 0.68, 0.54][k & 3], sat = [0.62, 0.7, 0.55, 0.42][(k >> 2) & 3];
  return [0, 8, 4].map((n) => { // this is the usual HSL to RGB, by its closed form
    const h = (n + hue / 30) % 12;
    return 255 * (light - sat * Math.min(light, 1 - light) * Math.max(-1, Math.min(h - 3, 9 - h, 1)));
  });
}

// Returns the scale of a mode's ramp: the chosen one, or its own.
const rampOf = (mode, scale) => (scale === 'usual' ? MODES[mode].ramp : scale);

// Returns 256 colours, four bytes each.
export function tableOf(mode, scale = 'usual') {
  const table = new Uint8Array(4 * 256);
  const {kind} = MODES[mode], ramp = rampOf(mode, scale);
  for (let i = 0; i < 256; i++) {
    const c = kind === 'ramp' ? rampAt(ramp, i / 255) : mode === 'echo' ? parse((ECHOES[i] ?? ECHOES[0])[1]) : listColour(i);
    table.set([...c.map(Math.round), 255], 4 * i);
  }
  return table;
}

// Returns the index into ECHOES of a packed echo number and count.
const echoClass = (packed) => {
  const echo = packed & 15, echoes = packed >> 4;
  return echoes <= 1 ? 0 : echo === 1 ? 1 : echo === echoes ? 3 : 2;
};

// Returns the numbers of points from..to of a block; for rgb four bytes a point in the same buffer.
export function valuesOf(block, mode, from, to) {
  const n = to - from;
  const out = new Float32Array(n);
  const numbers = {range: block.range, reflectance: block.reflectance, amplitude: block.amplitude}[mode];
  if (mode === 'rgb') {
    const bytes = new Uint8Array(out.buffer);
    for (let i = 0; i < n; i++) {
      const c = block.rgb ? block.rgb.subarray(3 * (from + i), 3 * (from + i) + 3) : GREY;
      bytes[4 * i] = c[0];
      bytes[4 * i + 1] = c[1];
      bytes[4 * i + 2] = c[2];
      bytes[4 * i + 3] = 255;
    }
  } else if (mode === 'height') for (let i = 0; i < n; i++) out[i] = block.position[3 * (from + i) + 2];
  else if (mode === 'label') for (let i = 0; i < n; i++) out[i] = block.label[from + i] === 0xffff ? NONE : block.label[from + i];
  else if (mode === 'echo') for (let i = 0; i < n; i++) out[i] = echoClass(block.echo[from + i]);
  else if (mode === 'station') out.fill(block.station ?? NONE);
  else if (mode === 'age') for (let i = 0; i < n; i++) out[i] = block.first + (block.order ? block.order[from + i] : from + i);
  else if (numbers) for (let i = 0; i < n; i++) out[i] = Number.isNaN(numbers[from + i]) ? NONE : numbers[from + i];
  else out.fill(NONE);
  return out;
}

// Returns a few known numbers of each block, spread evenly.
export function sampleOf(cloud, mode, most = 20000) {
  const each = Math.max(16, Math.floor(most / Math.max(1, cloud.blocks.length)));
  const all = [];
  for (const block of cloud.blocks) {
    if (block.closed) all.push(...valuesOf(block, mode, 0, Math.min(block.n, each)));
    else for (const i of spreadOver(block, each)) all.push(valuesOf(block, mode, i, i + 1)[0]);
  }
  return all.filter((v) => v !== NONE && v === v);
}

// Returns limits that leave out a share of the values at each end, a little wider, so that single far points don't use
// up all colours. The limits are at least `least` apart; null without values.
export function robustLimits(values, least = 0, share = 0.01) {
  if (values.length === 0) return null;
  const sorted = Float64Array.from(values).sort();
  const at = (f) => sorted[Math.round(f * (sorted.length - 1))];
  const lo = at(share), hi = at(1 - share);
  const margin = Math.max(0.02 * (hi - lo) || Math.max(1e-6, Math.abs(lo) * 1e-6), 0.5 * (least - (hi - lo)));
  return [lo - margin, hi + margin];
}

// Returns the limits after more points, widened if the new points exceed them by more than a tenth of their range.
export function widened(old, fresh) {
  if (old === null || fresh === null) return fresh ?? old;
  const slack = 0.1 * (old[1] - old[0]);
  return [fresh[0] < old[0] - slack ? fresh[0] : old[0], fresh[1] > old[1] + slack ? fresh[1] : old[1]];
}

// Returns round values within the limits: {value, text}. Their distance is 1, 2 or 5 times a power of ten. The limits
// are at most `most` such distances apart, so there are up to `most` + 1 values.
export function ticks([lo, hi], most = 6) {
  const raw = (hi - lo) / most;
  const power = 10 ** Math.floor(Math.log10(raw));
  const step = [1, 2, 5, 10].map((k) => k * power).find((s) => s >= raw * (1 - 1e-9));
  const places = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const out = [];
  const first = Math.ceil(lo / step - 1e-9);
  for (let i = 0; i <= most && (first + i) * step <= hi + 1e-9 * step; i++) {
    const value = (first + i) * step;
    out.push({value, text: value.toFixed(Math.min(places, 100))}); // toFixed() takes no more
  }
  return out;
}

// Returns the legend for panels: {mode, title, unit}. A ramp adds {stops: colours, from, to, ticks: [{at,
// text}]}. A list adds {items: [{label, name, colour}]}, the most frequent first; if name is undefined, the page names
// the item. A colour is [r, g, b] of 255. null for rgb, which needs no legend unless the points have no colours of
// their own.
export function legendOf(mode, {limits, offset = 0, sample = [], hasColours = true, scale = 'usual', oldest_s = NaN}) {
  const {title, unit, kind} = MODES[mode], ramp = rampOf(mode, scale);
  const legend = {mode, title, unit};
  const unknown = {stops: [GREY, GREY], from: 'not known', to: '', ticks: []};
  if (kind === 'rgb') return hasColours ? null : {...legend, ...unknown};
  if (kind === 'list' && sample.length === 0) return {...legend, ...unknown};
  if (kind === 'list') return {...legend, items: itemsOf(mode, sample)};
  legend.stops = Array.from({length: 17}, (_, i) => rampAt(ramp, i / 16).map(Math.round));
  if (mode === 'age') return {...legend, from: oldest_s > 0 ? `${oldest_s.toPrecision(3)} s before` : 'oldest', to: 'newest', ticks: []};
  if (limits === null) return {...legend, ...unknown};
  const [from, to] = limits.map((v) => v + offset);
  return {...legend, from, to, ticks: ticks([from, to]).map((t) => ({...t, at: (t.value - from) / (to - from)}))};
}

function itemsOf(mode, sample) {
  const counts = new Map();
  for (const v of sample) counts.set(v, (counts.get(v) ?? 0) + 1);
  return [...counts].sort((a, b) => b[1] - a[1] || a[0] - b[0]).map(([label]) => (mode === 'echo' ?
    {label, name: ECHOES[label][0], colour: parse(ECHOES[label][1])} : {label, colour: listColour(label & 255).map(Math.round)}));
}
