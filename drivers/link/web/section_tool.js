/* SPDX-License-Identifier: MIT */
// This tool looks into a house, by a section box, or by a cut between two heights. The tool's handles are sliders on
// the picture, for pointer, touch and keys. The section stays after the tool is left, until it is switched off.
import {byId, fixed, make, numberField, numberOf, say} from './page.js';
import {alongLine, Section} from './section.js';
import {arrowStep, degrees, headingTo, onPlane, sub} from './view_camera.js';

const NAMES = {right: 'Right face', left: 'Left face', ahead: 'Far face', back: 'Near face', top: 'Top', bottom: 'Bottom',
  turn: 'Heading', move: 'Place of the box'};
const STEP_M = 0.05, LARGE = 10, TURN_DEG = 1; // steps of the arrow keys; with Shift a step is LARGE times as large
const EDGES = [0, 2, 4, 6, 0, 1, 4, 5, 0, 1, 2, 3]; // corners where an edge along x, y, z begins
const FIELDS = [['from', 'From height, m'], ['to', 'To height, m'], ['wide', 'Width, m'], ['deep', 'Depth, m'],
  ['x', 'Middle x, m'], ['y', 'Middle y, m'], ['heading', 'Heading, °']];

const shown = (value) => String(Math.round(value * 1e3) / 1e3);

export class SectionTool {
  id = 'section';
  name = 'Section';
  title = 'Section';
  #view;
  #kinds = new Map();
  #fields = new Map();
  #says = make('p', {class: 'refusal', role: 'status'});
  #layer = make('div', {class: 'handles', role: 'group', 'aria-label': 'Handles of the section'});
  #handles = new Map(); // it maps an id to its element
  #held = null; // the dragged handle is not hidden: a hidden element would lose the pointer
  #layerOn = (pen, camera) => this.#draw(pen, camera);

  constructor(view) {
    this.#view = view;
    const kind = (value, name) => {
      const box = make('input', {type: 'radio', name: 'section', id: `section-${value}`, value, change: () => this.#choose(value)});
      this.#kinds.set(value, box);
      return make('label', {class: 'tick'}, box, name);
    };
    for (const [id, name] of FIELDS) this.#fields.set(id, numberField(`section-${id}`, name, {change: () => this.#typed()}));
    this.body = make('div', {}, make('div', {class: 'ticks', role: 'radiogroup', 'aria-label': 'Section'},
      kind('off', 'All'), kind('height', 'Height cut'), kind('box', 'Box')),
    make('div', {class: 'place-fields'}, ...[...this.#fields.values()].map(({box}) => box)), this.#says,
    this.fit = make('button', {type: 'button', id: 'section-fit', click: () => this.#choose(this.#section?.kind)}, 'Around everything'));
    byId('stage').append(this.#layer);
    this.#kinds.get('off').checked = true;
    this.#show();
  }

  get #section() { return this.#view.camera.section; }

  isOn() { return this.#section !== null; }

  start() {
    if (!this.#section) this.#choose('height');
    this.#view.overlay.layers.add(this.#layerOn);
    this.#view.redraw();
    this.#layer.hidden = false;
  }

  stop() {
    this.#view.overlay.layers.delete(this.#layerOn);
    this.#layer.hidden = true;
    this.#view.redraw();
  }

  #choose(kind) {
    const box = kind === 'off' ? null : this.#view.bounds();
    if (kind !== 'off' && box === null) {
      this.#kinds.get('off').checked = true;
      return say(this.#says, 'There is nothing to cut yet: no points and no scene.');
    }
    this.#view.camera.section = box && Section.around(box, kind, this.#view.usualBounds());
    this.#kinds.get(kind).checked = true;
    this.#handles.clear();
    this.#layer.replaceChildren();
    this.#changed();
    return undefined;
  }

  // The section has changed.
  #changed() {
    say(this.#says, '');
    this.#view.touched();
    this.#view.cameraMoved();
    this.#view.dispatchEvent(new Event('section'));
    this.#show();
    this.changed?.();
  }

  #show() {
    const s = this.#section;
    const values = s && {from: s.from_m, to: s.to_m, wide: 2 * s.half[0], deep: 2 * s.half[1], x: s.middle[0], y: s.middle[1],
      heading: s.heading_deg};
    for (const [id, {field, box}] of this.#fields) {
      box.hidden = !s || (s.kind === 'height' && !['from', 'to'].includes(id));
      if (s) field.value = shown(values[id]);
    }
    this.fit.hidden = !s;
  }

  #typed() {
    const s = this.#section;
    const v = Object.fromEntries([...this.#fields].map(([id, {field}]) => [id, numberOf(field.value)]));
    const isSound = Object.values(v).every(Number.isFinite) && v.wide > 0 && v.deep > 0;
    if (!isSound || !s.between(v.from, v.to)) {
      this.#show();
      return say(this.#says, 'Refused: all fields are numbers, width and depth are more than 0, and the top is at least 0.02 m above the bottom.');
    }
    s.middle = [v.x, v.y, s.middle[2]];
    s.half = [0.5 * v.wide, 0.5 * v.deep, s.half[2]];
    s.heading_deg = degrees(v.heading * Math.PI / 180);
    return this.#changed();
  }

  // ---- handles

  // Draws the edges, and puts the handles to their places.
  #draw(pen, camera) {
    const s = camera.section;
    this.#layer.hidden = !s;
    if (!s) return;
    const corners = s.corners.map((p) => camera.project(p));
    EDGES.forEach((from, k) => {
      const [a, b] = [corners[from], corners[from + (1 << Math.floor(k / 4))]];
      if (a.w > 0.01 && b.w > 0.01) pen.line([[a.x, a.y], [b.x, b.y]], 1.25, pen.colours.accent);
    });
    for (const {id, at} of s.handles) {
      const {x, y, w} = camera.project(at);
      const element = this.#handleOf(id);
      element.hidden = id !== this.#held && !(w > 0.01 && x > 0 && y > 0 && x < camera.width && y < camera.height);
      element.style.translate = `${x.toFixed(1)}px ${y.toFixed(1)}px`;
      const [value, words] = this.#valueOf(s, id);
      element.setAttribute('aria-valuenow', shown(value));
      element.setAttribute('aria-valuetext', words);
    }
  }

  #valueOf(s, id) {
    if (id === 'turn') return [s.heading_deg, `${s.heading_deg.toFixed(0)} degrees`];
    if (id === 'move') return [0, `x ${fixed(s.middle[0], 2)}, y ${fixed(s.middle[1], 2)} metres`];
    if (id === 'top' || id === 'bottom') {
      const z = id === 'top' ? s.to_m : s.from_m;
      return [z, `height ${fixed(z, 2)} metres`];
    }
    const size = 2 * s.half[id === 'right' || id === 'left' ? 0 : 1];
    return [size, `box of ${size.toFixed(2)} metres`];
  }

  #handleOf(id) {
    if (!this.#handles.has(id)) {
      const element = make('div', {class: `handle ${id}`, role: 'slider', tabindex: 0, 'aria-label': NAMES[id], title: NAMES[id], id: `handle-${id}`,
        pointerdown: (e) => this.#grab(e, id), keydown: (e) => this.#key(e, id)});
      this.#handles.set(id, element);
      this.#layer.append(element);
    }
    return this.#handles.get(id);
  }

  // A handle keeps its distance from the pointer that has grabbed it.
  #grab(e, id) {
    if (e.button !== 0) return;
    const {camera, canvas} = this.#view;
    const element = e.currentTarget;
    const where = (event) => {
      const box = canvas.getBoundingClientRect();
      return [event.clientX - box.left, event.clientY - box.top];
    };
    const {at, along} = this.#section.handles.find((h) => h.id === id);
    const measure = along ? (x, y) => alongLine(camera, at, along, x, y) : (x, y) => onPlane(camera, x, y, at[2], 20 * camera.distance);
    const first = measure(...where(e));
    if (first === null) return;
    const was = new Section(this.#section);
    element.setPointerCapture(e.pointerId);
    this.#held = id;
    const move = (event) => {
      const now = measure(...where(event));
      if (now === null) return;
      const s = this.#view.camera.section = new Section(was);
      if (along) s.push(id, now - first);
      else if (id === 'move') s.middle = [was.middle[0] + now[0] - first[0], was.middle[1] + now[1] - first[1], was.middle[2]];
      else s.heading_deg = degrees((was.heading_deg + headingTo(was.middle, now) - headingTo(was.middle, first)) * Math.PI / 180);
      this.#changed();
    };
    const end = () => {
      this.#held = null;
      element.removeEventListener('pointermove', move);
    };
    element.addEventListener('pointermove', move);
    for (const type of ['pointerup', 'pointercancel', 'lostpointercapture']) element.addEventListener(type, end, {once: true});
    element.focus({preventScroll: true});
    e.preventDefault();
  }

  #key(e, id) {
    const sign = {ArrowUp: 1, ArrowRight: 1, ArrowDown: -1, ArrowLeft: -1}[e.key];
    if (!sign || e.ctrlKey || e.metaKey || e.altKey) return;
    e.preventDefault();
    const s = this.#section, {camera} = this.#view, k = e.shiftKey ? LARGE : 1;
    if (id === 'turn') s.heading_deg = (s.heading_deg + sign * TURN_DEG * k + 360) % 360;
    else if (id === 'move') {
      const [dx, dy] = arrowStep(camera, e.key, STEP_M * k);
      s.middle = sub(s.middle, [-dx, -dy, 0]);
    } else s.push(id, sign * STEP_M * k * (id === 'bottom' ? -1 : 1)); // the key up moves the bottom up, too
    this.#changed();
  }
}
