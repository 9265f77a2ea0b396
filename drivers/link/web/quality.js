/* SPDX-License-Identifier: MIT */
// This panel shows the quality of the scan so far. The head, which knows the true values, reports it at /quality.
import {bodyOf, byId, fetchJson, figureList, grouped, make, makeSvg, metres, percent, say, short, NONE} from './page.js';

const ROWS = [
  ['sampled', 'Points looked at', 'Of those measured; the head looks at as many as it has time for'],
  ['empty', 'Pulses without echo'],
  ['density', 'Density, median', 'Points per square metre of the surfaces that are seen'],
  ['density-range', '5 % to 95 %'],
];
const DEVIATION = [
  ['dev-mean', 'Mean'],
  ['dev-rms', 'RMS'],
  ['dev-p95', 'p95', '95 % are smaller'],
  ['dev-max', 'Largest'],
  ['dev-bound', 'Bound', 'What the methods and the noise allow'],
  ['dev-far', 'Far', 'Points with no surface within 10 m, which are in no other figure'],
  ['dev-along', 'In range', 'RMS along the beam, of points on smooth faces'],
  ['dev-sigma', 'Expected', 'RMS along the beam that noise and counts give'],
];
const WIDTH = 300, HEIGHT = 92, BASE = 74;

export class Quality {
  #set;
  #svg = makeSvg('svg', {class: 'histogram', viewBox: `0 0 ${WIDTH} ${HEIGHT}`, role: 'img'});
  #verdict = make('p', {class: 'note verdict'});
  #covered = make('div');
  #coverage = make('p', {class: 'figure-line'});
  #aside = byId('panel-quality').querySelector('summary').appendChild(make('span', {class: 'aside'}));

  constructor(isOpen) {
    const body = bodyOf('quality');
    const general = figureList(body, ROWS);
    body.append(make('p', {class: 'note'}, 'The head judges the whole scan, also what did not come to this page.'),
      make('h3', {}, 'Coverage of all surfaces'),
      make('div', {class: 'coverage'}, make('div', {class: 'track'}, this.#covered), this.#coverage));
    body.append(make('h3', {}, 'Deviation from the scene'), this.#svg);
    const deviation = figureList(body, DEVIATION, 'two');
    body.append(this.#verdict);
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
    const d = q.deviation_m ?? {}, density = q.points ? q.density_per_m2 ?? {} : {};
    say(this.#aside, q.scan ? `scan ${q.scan}${q.station ? `, station ${q.station}` : ''}` : '');
    this.#set({
      'sampled': q.points ? `${short(q.sampled_points)} of ${short(q.points)}` : NONE,
      'empty': percent(q.empty_share),
      'density': perSquare(density.p50),
      'density-range': Number.isFinite(density.p5) ? `${count(density.p5)} to ${count(density.p95)}` : NONE,
    }, {
      'dev-mean': metres(d.mean), 'dev-rms': metres(d.rms), 'dev-p95': metres(d.p95), 'dev-max': metres(d.max),
      'dev-bound': metres(d.bound), 'dev-sigma': metres(d.sigma_expected),
      'dev-far': d.far === undefined ? NONE : short(d.far), 'dev-along': metres(d.along_beam?.judged_rms),
    });
    byId('figure-dev-max').classList.toggle('bad', Number.isFinite(d.bound) && d.max > d.bound && q.verdict?.judgement === 'beyond');
    this.#histogram(d);
    const verdict = q.verdict?.text ?? '';
    say(this.#verdict, verdict.split(/(?<=\.) /)[0]);
    this.#verdict.title = verdict;
    this.#verdict.classList.toggle('refusal', q.verdict?.judgement === 'beyond');
    this.#cover(q.coverage);
  }

  #cover(c) {
    this.#covered.style.width = percent(c?.share ?? 0, 2).replace('\u00a0', '');
    say(this.#coverage, c ? `${percent(c.share)} seen, of ${short(c.cells)} cells of ${metres(c.cell_m)}` : NONE);
  }

  #histogram({histogram: h, bound}) {
    const parts = [];
    const text = (x, anchor, words) => makeSvg('text', {x, y: HEIGHT - 4, 'text-anchor': anchor}, words);
    const sum = h?.counts?.reduce((a, b) => a + b, 0) ?? 0;
    if (sum > 0) {
      const most = Math.max(...h.counts), wide = WIDTH / h.counts.length;
      const x = (m) => ((m - h.from_m) / (h.to_m - h.from_m)) * WIDTH;
      h.counts.forEach((n, i) => n > 0 && parts.push(makeSvg('rect', {class: 'count', x: i * wide + 0.25,
        width: Math.max(0.5, wide - 0.5), y: BASE - (n / most) * (BASE - 6), height: (n / most) * (BASE - 6)})));
      for (const at of Number.isFinite(bound) ? [-bound, bound] : []) {
        if (x(at) > 0 && x(at) < WIDTH) parts.push(makeSvg('line', {class: 'bound', x1: x(at), x2: x(at), y1: 2, y2: BASE}));
      }
      if (x(0) > 40 && x(0) < WIDTH - 40) parts.push(text(x(0), 'middle', '0'));
      parts.push(text(0, 'start', metres(h.from_m)), text(WIDTH, 'end', metres(h.to_m)));
    } else {
      parts.push(makeSvg('text', {x: WIDTH / 2, y: BASE / 2 + 4, 'text-anchor': 'middle'}, 'No points yet'));
    }
    parts.push(makeSvg('line', {class: 'axis', x1: 0, x2: WIDTH, y1: BASE + 0.5, y2: BASE + 0.5}));
    this.#svg.replaceChildren(...parts);
    const along = h?.of === 'along_beam' ? ' along the beam' : '';
    this.#svg.setAttribute('aria-label', sum > 0
      ? `Histogram of the deviation${along}, ${metres(h.from_m)} to ${metres(h.to_m)}, ${grouped(sum)} points, `
        + `${grouped(h.below ?? 0)} below, ${grouped(h.above ?? 0)} above` : 'Histogram of the deviation: no points yet');
  }
}

const count = (value) => (value < 100 ? short(value) : grouped(value));
const perSquare = (value) => (Number.isFinite(value) ? `${count(value)}\u00a0/m²` : NONE);
