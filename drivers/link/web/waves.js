/* SPDX-License-Identifier: MIT */
// This part of the point's panel shows the waveform of its pulse: samples over range, with its echoes marked. The part
// is there only where the stream has waveforms, and asks for one pulse at a time.
import {make, makeSvg, say, short} from './page.js';

const HAS_WAVEFORMS = 4; // of a descriptor's content
const WIDTH = 280, TOP = 4, BASE = 62, GAP = 8; // GAP is between two windows, whose ranges may be far apart

// Returns the places of windows side by side: {scale: pixels per metre, at: [the x of each]}.
function layOut(windows) {
  const lengths = windows.map(({stepM, samples}) => stepM * Math.max(1, samples.length - 1));
  const scale = (WIDTH - GAP * (windows.length - 1)) / lengths.reduce((a, b) => a + b, 0);
  let x = 0;
  return {scale, at: lengths.map((length) => {
    const here = x;
    x += length * scale + GAP;
    return here;
  })};
}

// Returns the x of a range, or null if no window has it.
function placeOf(range_m, windows, {scale, at}) {
  const i = windows.findIndex(({rangeM0, stepM, samples}) =>
    range_m >= rangeM0 - 0.5 * stepM && range_m <= rangeM0 + stepM * (samples.length - 0.5));
  return i < 0 ? null : at[i] + scale * Math.max(0, range_m - windows[i].rangeM0);
}

// Returns the ranges of all echoes of a point's pulse, as far as they are held.
function rangesOf(cloud, {pulse, scan, station}) {
  const found = [];
  for (const block of cloud.blocks) {
    if (block.scan !== scan || block.station !== station) continue;
    for (let i = 0; i < block.n; i++) if (block.pulse0 + block.pulse[i] === pulse) found.push(block.range[i]);
  }
  return found.sort((a, b) => a - b);
}

export class WavePlot {
  #cloud; // the head's points; those of a trial have no pulses of the head
  #point = null;
  #svg = makeSvg('svg', {class: 'wave', viewBox: `0 0 ${WIDTH} 78`, role: 'img'});
  #title = make('p', {class: 'note'});
  #box = make('div', {class: 'wave-box', hidden: true}, this.#title, this.#svg);

  // The waveform stands in `parent`, at the parent's end.
  constructor(head, view, parent) {
    this.#cloud = view.cloud;
    parent.append(this.#box);
    view.addEventListener('pick', ({detail}) => {
      const point = detail?.point ?? null, {descriptor} = head;
      const has = point !== null && view.cloud === this.#cloud && (descriptor?.content & HAS_WAVEFORMS) !== 0;
      this.#point = has ? point : null;
      if (has) head.askWaves(point.pulse, point.scan);
      else this.#box.hidden = true;
    });
    head.addEventListener('waves', ({detail: {pulse, scan, windows}}) => {
      if (pulse === this.#point?.pulse && scan === this.#point.scan) this.#show(windows);
    });
  }

  #show(windows) {
    this.#box.hidden = windows.length === 0;
    if (windows.length === 0) return;
    const place = layOut(windows), ranges = rangesOf(this.#cloud, this.#point);
    const highest = Math.max(...windows.map(({samples}) => Math.max(...samples)));
    const most = Math.max(1.2, highest); // of the drawing: the threshold is always in it
    const least = Math.min(0, ...windows.map(({samples}) => Math.min(...samples)));
    const y = (value) => BASE - (value - least) / (most - least) * (BASE - TOP);
    const parts = [makeSvg('line', {class: 'axis', x1: 0, x2: WIDTH, y1: y(0), y2: y(0)}),
      makeSvg('line', {class: 'bound', x1: 0, x2: WIDTH, y1: y(1), y2: y(1)})];
    windows.forEach(({rangeM0, stepM, samples}, i) => {
      const x = (k) => place.at[i] + place.scale * stepM * k;
      parts.push(makeSvg('path', {class: 'samples', d: Array.from(samples, (v, k) => `${k ? 'L' : 'M'}${x(k).toFixed(1)} ${y(v).toFixed(1)}`).join('')}));
      parts.push(makeSvg('text', {x: x(0), y: 75, 'text-anchor': 'start'}, `${rangeM0.toFixed(2)} m`));
      if (i === windows.length - 1) parts.push(makeSvg('text', {x: WIDTH, y: 75, 'text-anchor': 'end'}, (rangeM0 + stepM * (samples.length - 1)).toFixed(2)));
    });
    const marks = ranges.map((range_m) => placeOf(range_m, windows, place)).filter((x) => x !== null);
    for (const x of marks) parts.push(makeSvg('line', {class: 'echo', x1: x, x2: x, y1: TOP, y2: BASE}));
    this.#svg.replaceChildren(...parts);
    this.#svg.setAttribute('aria-label', `Waveform over range, ${windows.length} part${windows.length === 1 ? '' : 's'}; `
      + `echoes at ${ranges.map((range_m) => `${range_m.toFixed(3)} m`).join(', ')}; highest ${short(highest)} detection thresholds`);
    say(this.#title, `Waveform, up to ${short(highest)} thresholds`);
  }
}
