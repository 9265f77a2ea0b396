/* SPDX-License-Identifier: MIT */
// This tool shows the panorama of a station under the picture, by range, intensity or surface. Pointing at it shows the
// point in the picture. Pointing at the picture shows the point in the panorama. A click turns the picture to the
// point, or picks it while something is measured.
import {atMostEvery, byId, fixed, make, say, short} from './page.js';
import {MODES} from './view_colours.js';
import {Panorama} from './panorama.js';
import {runSlowly} from './view_pick.js';
import {pointOf} from './cloud.js';

// While points come, the panorama is made again after this time. Making it takes a quarter of the time at most.
const AGAIN_MS = 1000;
const DEG = 180 / Math.PI;

export class PanoramaTool {
  id = 'panorama';
  name = 'Panorama';
  title = 'Panorama from the head';
  isApart = true;
  panorama = null;
  #view;
  #names;
  #stop = null;
  #timer = 0;
  #began = 0;
  #rests_until = 0;
  #cursor = null; // the pixel that arrow keys move; null before the first key
  #box = byId('panorama');
  #canvas = make('canvas', {tabindex: 0, role: 'application', 'aria-roledescription': 'panorama', 'aria-label':
    'The points as seen from the head. Arrow keys move a cursor, Enter turns the picture to its point.'});
  #cross = make('i', {class: 'cross', 'aria-hidden': 'true'});
  #says = make('p', {class: 'note', role: 'status'});
  #scale = make('span', {class: 'note'});
  #station = make('select', {id: 'panorama-station', 'aria-label': 'Station', change: () => this.#make()});
  #mode = make('select', {id: 'panorama-mode', 'aria-label': 'Colours', change: () => this.#paint()},
    ...[['range', 'Range'], ['intensity', 'Intensity'], ['label', 'Surface']].map(([value, name]) => make('option', {value}, name)));
  #marked = ({detail}) => this.#markPoint(detail?.point ?? null);

  constructor(view, names) {
    this.#view = view;
    this.#names = names;
    const on = (type, call) => this.#canvas.addEventListener(type, call);
    on('pointermove', (e) => this.#point(this.#pixelOf(e)));
    on('pointerleave', () => this.#view.pointed.mark(null));
    on('click', (e) => this.#take(this.#pixelOf(e)));
    on('keydown', (e) => this.#key(e));
    this.#box.append(make('div', {class: 'head'}, make('h2', {}, 'Panorama'), this.#station, this.#mode, this.#scale,
      make('button', {type: 'button', class: 'quiet', click: () => this.leave()}, 'Close')),
    make('div', {class: 'image'}, this.#canvas, this.#cross), this.#says);
  }

  start() {
    this.#box.hidden = false;
    this.#view.addEventListener('pick', this.#marked);
    this.#markPoint(null);
    this.#fillStations();
    this.#make();
    this.#timer = setInterval(() => {
      this.#fillStations();
      const isDue = !document.hidden && this.#stop === null && performance.now() > this.#rests_until;
      if (isDue && (this.panorama === null || this.isOld)) this.#make();
    }, AGAIN_MS);
  }

  stop() {
    clearInterval(this.#timer);
    this.#stop?.();
    this.#stop = this.panorama = null;
    this.#view.removeEventListener('pick', this.#marked);
    this.#view.pointed.mark(null);
    this.#box.hidden = true;
  }

  #fillStations() {
    const {list} = this.#view.stations;
    const key = list.map((s) => `${s.number} ${s.name ?? ''}`).join('\n');
    if (key === this.#station.dataset.list) return;
    const was = this.#station.value;
    this.#station.dataset.list = key;
    this.#station.replaceChildren(...list.map((s) => make('option', {value: s.number}, `From ${s.name || `station ${s.number}`}`)));
    const withPoints = list.find((s) => this.#view.cloud.blocks.some((block) => block.station === s.number));
    this.#station.value = list.some((s) => String(s.number) === was) ? was : withPoints?.number ?? list[0]?.number ?? '';
  }

  #make() {
    this.#stop?.();
    this.#stop = null;
    const station = this.#view.stations.get(Number(this.#station.value)), {cloud} = this.#view;
    if (!station || cloud.origin === null) return this.#empty(station);
    this.#began = performance.now();
    this.#stop = runSlowly(new Panorama(cloud, station, this.#view.camera.section).make(), (panorama) => {
      this.#stop = null;
      this.#rests_until = performance.now() + 3 * (performance.now() - this.#began);
      if (panorama.n === 0) return this.#empty(station);
      this.panorama = panorama;
      this.#size(panorama.width, panorama.height, panorama.span[0] / panorama.span[1]);
      return this.#paint();
    });
    return undefined;
  }

  // Pixels need not be square.
  #size(width, height, aspect) {
    Object.assign(this.#canvas, {width, height});
    this.#canvas.parentElement.style.setProperty('--aspect', aspect);
  }

  #empty(station) {
    this.panorama = null;
    this.#size(360, 90, 4);
    this.#cross.hidden = true;
    say(this.#says, station ? 'This station has no points yet.' : 'No station has a known place.');
  }

  // Intensity is the reflectance; where that is not known, it is the amplitude.
  get mode() {
    if (this.#mode.value !== 'intensity') return this.#mode.value;
    return (this.panorama ?? this.#view).cloud.blocks.some((block) => block.reflectance !== null) ? 'reflectance' : 'amplitude';
  }

  #paint() {
    const {panorama, mode} = this;
    if (panorama === null) return;
    const {pixels, limits} = panorama.colours(mode);
    this.#canvas.getContext('2d').putImageData(new ImageData(pixels, panorama.width), 0, 0);
    const {title, unit} = MODES[mode];
    say(this.#scale, limits ? `${limits.map((v) => short(v)).join(' to ').replaceAll('-', '−')}\u00a0${unit}` : mode === 'label' ? '' : `${title} not known`);
    this.#tell(null);
  }

  // ---- pointing

  #pixelOf(e) {
    const {left, top, width, height} = this.#canvas.getBoundingClientRect();
    return [Math.floor((e.clientX - left) / width * this.#canvas.width), Math.floor((e.clientY - top) / height * this.#canvas.height)];
  }

  // Returns whether the picture shows other points now.
  get isOld() { return this.panorama.isOld(this.#view.cloud, this.#view.camera.section); }

  // Returns the figures of the point of a pixel. null: the pixel has none, or the picture shows another cloud now.
  pointAt([x, y]) {
    const {panorama} = this;
    const found = panorama?.cloud === this.#view.cloud ? panorama.pointAt(x, y) : null;
    return found && pointOf(panorama.cloud, found.block, found.i);
  }

  #point(pixel) {
    this.#view.pointed.mark(this.pointAt(pixel));
  }

  #take(pixel) {
    const point = this.pointAt(pixel), {tool, camera} = this.#view;
    if (point === null) return;
    if (tool?.pick) {
      tool.pick(point);
      return;
    }
    camera.inside = false;
    camera.target = [point.x, point.y, point.z];
    this.#view.touched();
    this.#view.cameraMoved();
  }

  #key(e) {
    const step = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]}[e.key];
    const {width, height} = this.#canvas;
    this.#cursor ??= [width >> 1, height >> 1];
    if (e.key === 'Enter') this.#take(this.#cursor);
    else if (!step) return;
    else {
      const k = e.shiftKey ? 10 : 1;
      this.#cursor = this.#cursor.map((v, a) => Math.min([width, height][a] - 1, Math.max(0, v + k * step[a])));
      this.#point(this.#cursor);
      if (this.pointAt(this.#cursor) === null) this.#placeCross([(this.#cursor[0] + 0.5) / width, (this.#cursor[1] + 0.5) / height]);
    }
    e.preventDefault();
  }

  // Shows the point at which the user points, here or in the picture.
  #markPoint(point) {
    const {panorama} = this;
    this.#placeCross(point && panorama ? panorama.shareOf(panorama.anglesOf([point.x, point.y, point.z])) : null);
    this.#tell(point);
  }

  // Shows the cross at a share of width and height, or hides it.
  #placeCross(share) {
    this.#cross.hidden = share === null || share.some((v) => v < 0 || v > 1);
    if (this.#cross.hidden) return;
    this.#cross.style.left = `${(100 * share[0]).toFixed(2)}%`;
    this.#cross.style.top = `${(100 * share[1]).toFixed(2)}%`;
  }

  #tell(point) {
    this.#next = point;
    this.#tellSoon();
  }

  #next = null;
  #tellSoon = atMostEvery(60, () => {
    const point = this.#next, {panorama} = this;
    if (panorama === null) return;
    if (point === null) return say(this.#says, 'Point at the panorama to see the point in the picture, or at the picture to see the point here.');
    const [azimuth, elevation, range] = panorama.anglesOf([point.x, point.y, point.z]);
    const deg = (rad) => `${fixed(DEG * rad, 2)}°`;
    const surface = point.label === 0xffff ? '' : this.#names('label', point.label) ?? '';
    say(this.#says, [`Azimuth ${deg(azimuth)}, elevation ${deg(elevation)}, ${range.toFixed(3)}\u00a0m`, surface].filter(Boolean).join(' · '));
  });
}
