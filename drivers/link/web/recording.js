/* SPDX-License-Identifier: MIT */
// This module shows a recording, without a head: its points, the mesh of a scan, or points spread evenly over that
// mesh.
import {asSent, atMostEvery, bodyOf, byId, figureList, grouped, make, markField, metres, say, short} from './page.js';
import {batchesOf, countWithin, fetchCloud, fetchMesh} from './recording_files.js';

const MOST_POINTS = 10e6;
const SLIDER_OFF = 100; // at this end of the slider there is no filter
const factorOf = (slider) => (slider >= SLIDER_OFF ? 0 : 10 ** (slider / 50));
const sliderOf = (factor) => Math.round(50 * Math.log10(factor));

const FRAMES = {scene: 'The scene’s frame', enu: 'East, north, up of a place', unknown: 'As the file has it'};

export class Recording {
  #info;
  #cloud;
  #view;
  #what = 'points';
  #abort = null;
  #mesh = null; // it is {origin, positions, triangles, ratio} of the chosen scan
  #parts = {};

  constructor(info, cloud, view) {
    this.#info = info;
    this.#cloud = cloud;
    this.#view = view;
    const r = info.recording;
    document.title = `${r.file} · scanhead`;
    say(byId('model'), r.file);
    say(byId('state-word'), 'Recording');
    this.#describe(r);
    this.#makeChoice(r);
    this.load();
  }

  #describe(r) {
    const body = bodyOf('recording');
    figureList(body, [['file', 'Format'], ['frame', 'Coordinates'], ['points', 'Points'], ['shots', 'Pulses without echo'],
      ['left-out', 'Echoes left out', 'Their place is not known, or too far away to be shown']])({
      'file': r.format, 'frame': FRAMES[r.frame] ?? r.frame, 'points': grouped(r.points),
      'shots': grouped(r.shots_without_echo), 'left-out': grouped(r.left_out),
    });
    if (r.complete !== false) return;
    body.append(make('p', {class: 'refusal'},
      'The recording is not complete: it ends within a scan, or something was lost on its way.'));
  }

  #radio(value, name, disabled) {
    const box = make('input', {type: 'radio', name: 'what', value, id: `what-${value}`, disabled,
      change: () => this.#choose(value)});
    box.checked = value === this.#what;
    return make('label', {class: 'tick'}, box, name);
  }

  #makeChoice(r) {
    const p = this.#parts;
    p.scan = make('select', {id: 'mesh-scan', change: () => this.load()}, ...r.meshes.map((m) =>
      make('option', {value: m.scan}, `Station ${m.station}, scan ${m.station_scan}${m.sweep ? `, sweep ${m.sweep + 1}` : ''}`)));
    p.edge = make('input', {id: 'long-edge', type: 'range', min: 0, max: SLIDER_OFF, step: 1, value: sliderOf(10), input: () => this.#edge(),
      change: () => this.#what === 'sparse' && this.load()});
    p.edgeText = make('output', {for: 'long-edge', class: 'unit'});
    p.density = make('input', {id: 'density', type: 'text', inputmode: 'decimal', value: '100', 'aria-describedby': 'loaded', change: () => this.load()});
    p.says = make('p', {class: 'note', id: 'loaded'}); // it shows how much is loaded
    p.done = make('p', {class: 'unseen', role: 'status'}); // a screen reader reads only the result
    p.bar = make('div');
    p.scanRow = make('div', {class: 'row'}, make('label', {for: 'mesh-scan'}, 'Scan'), p.scan);
    p.edgeRow = make('div', {class: 'row'}, make('label', {for: 'long-edge',
      title: 'Triangles with an edge longer than this many mean edges are left out'}, 'Longest edge'), p.edge, p.edgeText);
    p.densityRow = make('div', {class: 'row'}, make('label', {for: 'density'}, 'Density'), p.density, make('span', {class: 'unit'}, 'per m²'));
    bodyOf('recording').append(make('fieldset', {}, make('legend', {class: 'group'}, 'Shown as'), make('div', {class: 'ticks'},
      this.#radio('points', 'Points', false), this.#radio('mesh', 'Mesh', !r.has_mesh), this.#radio('sparse', 'Sparse points', !r.has_mesh))));
    if (!r.has_mesh) bodyOf('recording').append(make('p', {class: 'note'}, r.why_no_mesh ?? 'This recording has no mesh.'));
    bodyOf('recording').append(p.scanRow, p.edgeRow, p.densityRow, make('div', {class: 'coverage'}, make('div', {class: 'track'}, p.bar), p.says, p.done));
    this.#rows();
  }

  #rows() {
    const p = this.#parts;
    byId('timeline').classList.toggle('off', this.#what !== 'points'); // a mesh has no times
    p.scanRow.hidden = this.#what === 'points' || this.#info.recording.meshes.length < 2;
    p.edgeRow.hidden = this.#what === 'points';
    p.densityRow.hidden = this.#what !== 'sparse';
    this.#edgeText();
  }

  #choose(what) {
    this.#what = what;
    this.#rows();
    this.load();
  }

  #scan() {
    return this.#info.recording.meshes.find((m) => m.scan === Number(this.#parts.scan.value));
  }

  #edgeText() {
    const factor = factorOf(Number(this.#parts.edge.value)), mesh = this.#scan();
    const text = factor === 0 ? 'any' : `${short(factor)} ×`;
    say(this.#parts.edgeText, text);
    this.#parts.edge.setAttribute('aria-valuetext', factor === 0 ? 'no filter' : `${short(factor)} mean edges`);
    this.#parts.edgeText.title = mesh && factor > 0
      ? `up to ${metres(factor * mesh.mean_edge_m)}; the mean edge has ${metres(mesh.mean_edge_m)}` : '';
  }

  #progress(done, of, words) {
    this.#parts.bar.style.width = `${of > 0 ? (100 * done) / of : 0}%`;
    this.#parts.says.className = 'note';
    say(this.#parts.says, words);
  }

  async load() {
    this.#abort?.abort();
    const {signal} = (this.#abort = new AbortController());
    markField(this.#parts.density, true);
    try {
      if (this.#what === 'mesh') await this.#loadMesh(signal);
      else if (this.#what === 'sparse') await this.#loadSparse(signal);
      else await this.#loadPoints(signal);
      if (signal.aborted) return;
      this.#view?.fit();
      say(this.#parts.done, this.#parts.says.textContent);
    } catch (error) {
      if (signal.aborted) return;
      const words = error.message.replace(/^per_m2=.*?(?=: (allowed|more) )/, 'Density');
      markField(this.#parts.density, words === error.message);
      this.#parts.says.className = 'refusal';
      say(this.#parts.says, words);
      say(this.#parts.done, words);
    }
  }

  // What is shown stays until something else has come: a request may be refused.
  #empty() {
    this.#cloud.clear();
    this.#mesh = null;
    this.#show();
  }

  async #takeAll(path, options) {
    let done = 0;
    const station = this.#info.stations?.[0]?.number;
    await fetchCloud(path, {...options, take: (piece) => {
      if (options.signal.aborted) return;
      if (done === 0) this.#empty();
      for (const batch of batchesOf(piece, station)) this.#cloud.add(batch);
      if (done === 0) this.#view?.fit();
      done += piece.n;
      const all = Math.ceil(piece.total / piece.every);
      this.#progress(done, all, `${grouped(done)} of ${grouped(all)} points${piece.every > 1 ? `: one in ${piece.every}` : ''}`);
    }});
    if (done === 0 && !options.signal.aborted) this.#empty();
  }

  async #loadPoints(signal) {
    const every = Math.max(1, Math.ceil(this.#info.recording.points / MOST_POINTS));
    await this.#takeAll(`/cloud?every=${every}&`, {every, signal});
  }

  async #loadSparse(signal) {
    const factor = factorOf(Number(this.#parts.edge.value)), {scan} = this.#scan();
    const density = asSent(this.#parts.density.value);
    this.#progress(0, 1, 'Points are spread over the mesh');
    await this.#takeAll(`/sparse?per_m2=${encodeURIComponent(density)}&long_edge=${factor}&scan=${scan}&`, {signal});
  }

  async #loadMesh(signal) {
    const {scan, first_point: first, points} = this.#scan();
    const positions = new Float32Array(3 * points);
    this.#empty();
    let at = 0, origin = [0, 0, 0];
    await fetchCloud('/cloud?every=1&', {first, end: first + points, signal, take: (piece) => {
      ({origin} = piece);
      positions.set(piece.columns.xyz, 3 * at);
      at += piece.n;
      this.#progress(at, 2 * points, `${grouped(at)} of ${grouped(points)} corners`);
    }});
    const mesh = await fetchMesh(scan, signal, (done, of) => this.#progress(of + done, 2 * of, `${grouped(done)} of ${grouped(of)} triangles`));
    if (signal.aborted) return;
    this.#mesh = {origin, positions, triangles: mesh.triangles, ratio: mesh.ratio};
    this.#show();
  }

  #edge() {
    this.#edgeText();
    if (this.#what === 'mesh') this.#later();
  }

  #later = atMostEvery(250, () => this.#show());

  // Shows the triangles within the filter, which are the beginning of the sorted list.
  #show() {
    const m = this.#mesh;
    if (!m) {
      if (this.drawn) this.#draw(null);
      return;
    }
    const n = countWithin(m.ratio, factorOf(Number(this.#parts.edge.value)));
    this.#draw({...m, drawTriangles: n});
    this.#progress(n, m.ratio.length, `${grouped(n)} of ${grouped(m.ratio.length)} triangles`);
  }

  // A mesh is shown instead of the points.
  #draw(mesh) {
    this.drawn = mesh !== null;
    if (!this.#view) return;
    this.#view.setMesh(mesh);
    this.#view.show({points: mesh === null, mesh: mesh !== null});
    byId('legend').hidden = mesh !== null; // a mesh has one colour
  }
}
