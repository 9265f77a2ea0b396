/* SPDX-License-Identifier: MIT */
// This panel shows the quality of the scan so far. The head, which knows the true values, reports it at /quality.
import {nearestTo} from './cloud.js';
import {bodyOf, byId, fetchJson, figureList, grouped, make, makeSvg, metres, percent, say, short, NONE} from './page.js';

const ROWS = [
  ['sampled', 'Points looked at', 'A part of those measured: the head looks at as many as it has time for'],
  ['empty', 'Pulses without echo'],
  ['density', 'Density, median', 'Points per square metre of the surfaces that are seen'],
  ['density-range', '5 % to 95 %'],
];
const DEVIATION = [
  ['dev-mean', 'Mean'],
  ['dev-rms', 'RMS'],
  ['dev-p95', 'p95', '95 % are smaller'],
  ['dev-max', 'Largest', 'The largest of the points looked at; another point may be farther from its surface'],
  ['dev-bound', 'Bound', 'The largest that the methods and the noise allow'],
  ['dev-far', 'Far', 'Points with no surface within 10 m, which are in no other figure'],
  ['dev-along', 'In range', 'RMS along the beam, of points on smooth faces'],
  ['dev-sigma', 'Expected', 'RMS along the beam that the noise and the rounding to counts give'],
];
const WIDTH = 300, HEIGHT = 92, BASE = 74;

const NEAR_M = 1e-3; // a point of the page that is this near to the head's largest deviation is that point
const LOOK_M = 3;

export class Quality {
  #set;
  #svg = makeSvg('svg', {class: 'histogram', viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img'});
  #verdict = make('p', {class: 'note verdict'});
  #covered = make('div');
  #coverage = make('p', {class: 'figure-line'});
  #aside = byId('panel-quality').querySelector('summary').appendChild(make('span', {class: 'aside'}));

  #view;
  #worst = null; // the place of the largest deviation
  #largest_m = NaN;
  #look = make('button', {type: 'button', id: 'show-largest', disabled: true, click: () => this.#showLargest(),
    title: 'Goes to the point with the largest deviation, of those looked at'}, 'Show the largest');

  // view: null where there is no picture
  constructor(isOpen, view) {
    this.#view = view;
    const body = bodyOf('quality');
    const general = figureList(body, ROWS);
    body.append(make('p', {class: 'note'}, 'The head samples the whole scan, also what did not come to this page.'),
      make('h3', {}, 'Coverage of all surfaces'),
      make('div', {class: 'coverage'}, make('div', {class: 'track'}, this.#covered), this.#coverage));
    body.append(make('h3', {}, 'Deviation from the scene'), this.#svg);
    const deviation = figureList(body, DEVIATION, 'two');
    body.append(make('div', {class: 'actions'}, this.#look), this.#verdict);
    this.#set = (a, b) => {
      general(a);
      deviation(b);
    };
    this.show({});
    const poll = async () => {
      if (!document.hidden && isOpen()) {
        const q = await fetchJson('/quality');
        if (q) this.show(q);
      }
      setTimeout(poll, 1000);
    };
    poll();
  }

  show(q) {
    const d = q.all ?? {}, density = d.density ?? {}, along = d.along_beam ?? {}, verdict = q.verdict ?? {};
    const bound = verdict.judged > 0 && verdict.bound_m > 0 ? verdict.bound_m : null;
    const isBeyond = verdict.judgement === 'beyond';
    say(this.#aside, q.scan ? `scan ${q.scan}${q.station ? `, station ${q.station}` : ''}` : '');
    this.#set({
      'sampled': q.points ? `${short(q.sampled_points)} of ${short(q.points)}` : NONE,
      'empty': percent(q.empty_share),
      'density': perSquare(density.p50_m2),
      'density-range': Number.isFinite(density.p5_m2) ? `${count(density.p5_m2)} to ${count(density.p95_m2)}` : NONE,
    }, {
      'dev-mean': metres(d.mean_m), 'dev-rms': metres(d.rms_m), 'dev-p95': metres(d.p95_m), 'dev-max': metres(d.max_m),
      'dev-bound': metres(bound), 'dev-sigma': along.noisy > 0 ? metres(along.expected_rms_m) : NONE,
      'dev-far': d.far === undefined ? NONE : short(d.far), 'dev-along': metres(along.judged_rms_m),
    });
    this.#worst = d.max_at?.every(Number.isFinite) ? d.max_at : null;
    this.#largest_m = d.max_m ?? NaN;
    this.#look.disabled = this.#worst === null || this.#view === null;
    byId('figure-dev-max').classList.toggle('bad', bound && d.max_m > bound && isBeyond);
    this.#histogram(q.along_beam ?? q.distances, q.along_beam ? ' along the beam' : '', bound);
    const words = verdict.text ?? '';
    say(this.#verdict, words.split(/(?<=\.) /)[0]);
    this.#verdict.title = words;
    this.#verdict.classList.toggle('refusal', isBeyond);
    this.#cover(q.coverage);
  }

  #showLargest() {
    const view = this.#view;
    Object.assign(view.camera, {target: [...this.#worst], distance: Math.min(view.camera.distance, LOOK_M)});
    view.touched();
    view.cameraMoved();
    const point = nearestTo(view.cloud, this.#worst, NEAR_M);
    view.pointed.mark(point && {...point, deviation_m: this.#largest_m}, true);
  }

  #cover(c) {
    this.#covered.style.width = percent(c?.share ?? 0, 2).replace('\u00a0', '');
    say(this.#coverage, c ? `${percent(c.share)} seen, of ${short(c.cells)} cells of ${metres(c.cell_m)}` : NONE);
  }

  #histogram(h, along, bound) {
    const parts = [];
    const text = (x, anchor, words) => makeSvg('text', {x, y: HEIGHT - 4, 'text-anchor': anchor}, words);
    const sum = h?.counts.reduce((a, b) => a + b, 0) ?? 0;
    const to_m = sum > 0 ? h.from_m + h.width_m * h.counts.length : 0;
    if (sum > 0) {
      const most = Math.max(...h.counts), wide = WIDTH / h.counts.length;
      const x = (m) => ((m - h.from_m) / (to_m - h.from_m)) * WIDTH;
      h.counts.forEach((n, i) => n > 0 && parts.push(makeSvg('rect', {class: 'count', x: i * wide + 0.25,
        width: Math.max(0.5, wide - 0.5), y: BASE - (n / most) * (BASE - 6), height: (n / most) * (BASE - 6)})));
      for (const at of bound ? [-bound, bound] : []) {
        if (x(at) > 0 && x(at) < WIDTH) parts.push(makeSvg('line', {class: 'bound', x1: x(at), x2: x(at), y1: 2, y2: BASE}));
      }
      if (x(0) > 40 && x(0) < WIDTH - 40) parts.push(text(x(0), 'middle', '0'));
      parts.push(text(0, 'start', metres(h.from_m)), text(WIDTH, 'end', metres(to_m)));
    } else {
      parts.push(makeSvg('text', {x: WIDTH / 2, y: BASE / 2 + 4, 'text-anchor': 'middle'}, 'No points yet'));
    }
    parts.push(makeSvg('line', {class: 'axis', x1: 0, x2: WIDTH, y1: BASE + 0.5, y2: BASE + 0.5}));
    this.#svg.replaceChildren(...parts);
    this.#svg.setAttribute('aria-label', sum > 0
      ? `Histogram of the deviation${along}, ${metres(h.from_m)} to ${metres(to_m)}, ${grouped(sum)} points, `
        + `${grouped(h.below)} below, ${grouped(h.above)} above` : 'Histogram of the deviation: no points yet');
  }
}

const count = (value) => (value < 100 ? short(value) : grouped(value));
const perSquare = (value) => (Number.isFinite(value) ? `${count(value)}\u00a0/m²` : NONE);
