/* SPDX-License-Identifier: MIT */
// This module turns pointer, touch, wheel and keys on the picture into turns, shifts and zooms of the camera.
//
//   drag, one finger          orbit about what is under the pointer; look round from inside
//   right or middle button, Shift or Ctrl and drag, two fingers     shift; two fingers also zoom, and from inside they
//                             look round
//   wheel, pinch              zoom, at the pointer
//   double click or tap       look at what is there
//   a station                 drag it; its handle turns it

import {grip, lookAt} from './view_pick.js';
import {lookBy} from './view_sides.js';

export const KEYS = [
  ['arrows', 'orbit; from inside look round'], ['Shift + arrows', 'shift the view'], ['+ −', 'zoom'],
  ['Home', 'show all'], ['T, F, S', 'from the top, the front, the side, without perspective'], ['O', 'perspective again'],
  ['I', 'the point in the middle: its figures'],
  ['C', 'turn about the point in the middle, and go nearer'], ['N, P', 'select the next, the previous station'],
  ['Enter', 'look from the selected station'], ['Esc', 'undo a move; unselect'],
  ['of a selected station: arrows, Page Up, Page Down', '0.1 m; with Shift 1 m'], ['[ ]', 'turn it by 5°; with Shift by 45°'],
];

const TURN_PER_PX = 0.0065;
const TAP_PX = 6;

export class Input {
  #view;
  #down = new Map(); // it maps a pointer's id to {x, y}
  #gesture = null; // of the pointers that are down
  #wheeled = null; // of the wheel, which may turn meanwhile
  #moved = 0;
  #tap = {time: 0, x: 0, y: 0};

  constructor(view) {
    this.#view = view;
    const on = (type, f, options) => view.canvas.addEventListener(type, f, options);
    on('pointerdown', (e) => this.#press(e));
    on('pointermove', (e) => this.#move(e));
    on('pointerup', (e) => this.#release(e, false));
    on('pointercancel', (e) => this.#release(e, true));
    on('pointerleave', () => this.#view.pointed.at(null));
    on('wheel', (e) => this.#wheel(e), {passive: false});
    on('keydown', (e) => this.#key(e));
    on('contextmenu', (e) => e.preventDefault());
  }

  #at(e) {
    const box = this.#view.canvas.getBoundingClientRect();
    return {x: e.clientX - box.left, y: e.clientY - box.top};
  }

  #press(e) {
    const view = this.#view;
    const p = this.#at(e);
    view.canvas.focus({preventScroll: true});
    try {
      view.canvas.setPointerCapture(e.pointerId);
    } catch { /* a script made this pointer */ }
    this.#down.set(e.pointerId, p);
    view.pointed.at(null);
    view.touched();
    if (this.#down.size === 1) {
      this.#moved = 0;
      const hit = e.button === 0 && !view.tool && !view.once ? view.stations.hit(view.camera, p.x, p.y) : null;
      if (hit && view.movable) {
        view.stations.grab(hit, p.x, p.y);
        this.#gesture = {kind: 'station'};
      } else {
        if (hit) view.stations.select(hit.number);
        const pans = e.button !== 0 || e.shiftKey || e.ctrlKey || e.metaKey;
        this.#hold(pans ? 'pan' : 'orbit', p);
      }
    } else if (this.#down.size === 2) {
      if (view.stations.dragging) view.stations.drop(true);
      this.#pinch();
    }
    e.preventDefault();
  }

  #hold(kind, p) {
    const {cloud, camera} = this.#view;
    const place = camera.inside ? null : grip(cloud, camera, p.x, p.y);
    this.#gesture = {kind, place, w: place ? camera.project(place).w : camera.distance};
  }

  #pinch() {
    const [a, b] = [...this.#down.values()];
    const middle = {x: 0.5 * (a.x + b.x), y: 0.5 * (a.y + b.y)};
    this.#hold('pinch', middle);
    Object.assign(this.#gesture, {middle, apart: Math.hypot(a.x - b.x, a.y - b.y)});
  }

  #move(e) {
    const view = this.#view;
    const p = this.#at(e);
    const last = this.#down.get(e.pointerId);
    if (!last) {
      if (e.pointerType !== 'touch') view.pointed.at(p);
      return;
    }
    this.#down.set(e.pointerId, p);
    const dx = p.x - last.x, dy = p.y - last.y;
    this.#moved += Math.abs(dx) + Math.abs(dy);
    const {kind, place, w} = this.#gesture ?? {};
    const {camera} = view;
    if (kind === 'station') view.stations.drag(camera, p.x, p.y);
    else if (kind === 'pinch') this.#pinched();
    else if (kind === 'orbit' && this.#moved > 2) this.#turn(dx, dy, place);
    else if (kind === 'pan' && this.#moved > 2) {
      camera.pan(dx, dy, w);
      view.cameraMoved();
    }
  }

  #turn(dx, dy, place) {
    const {camera} = this.#view;
    if (camera.inside) { // the picture moves with the pointer
      const k = 1 / camera.focal;
      camera.turn(-dx * k, dy * k);
    } else camera.orbit(place, dx * TURN_PER_PX, -dy * TURN_PER_PX);
    this.#view.cameraMoved();
  }

  #pinched() {
    if (this.#down.size < 2) return;
    const {camera} = this.#view;
    const [a, b] = [...this.#down.values()];
    const middle = {x: 0.5 * (a.x + b.x), y: 0.5 * (a.y + b.y)};
    const apart = Math.hypot(a.x - b.x, a.y - b.y);
    const g = this.#gesture;
    if (camera.inside) this.#turn(middle.x - g.middle.x, middle.y - g.middle.y, null);
    else camera.pan(middle.x - g.middle.x, middle.y - g.middle.y, g.w);
    const factor = g.apart / Math.max(8, apart);
    camera.zoom(factor, camera.at(middle.x, middle.y, g.w));
    if (!camera.inside) g.w *= factor;
    Object.assign(g, {middle, apart: Math.max(8, apart)});
    this.#view.cameraMoved();
  }

  #release(e, cancelled) {
    const view = this.#view;
    const p = this.#at(e);
    if (!this.#down.delete(e.pointerId)) return;
    if (this.#gesture?.kind === 'station') view.stations.drop(cancelled);
    if (this.#down.size === 1) this.#hold('orbit', [...this.#down.values()][0]);
    else if (this.#down.size === 0) {
      const kind = this.#gesture?.kind;
      this.#gesture = null;
      if (!cancelled && this.#moved < TAP_PX && e.button === 0) this.#tapped(p, kind);
    }
  }

  #tapped(p, kind) {
    const view = this.#view;
    const now = performance.now();
    const twice = now - this.#tap.time < 350 && Math.hypot(p.x - this.#tap.x, p.y - this.#tap.y) < 20;
    this.#tap = {time: twice ? 0 : now, ...p};
    if ((view.once ?? view.tool)?.tap(p)) return;
    if (twice) lookAt(view, p);
    else if (kind !== 'station' && view.stations.hit(view.camera, p.x, p.y) === null) view.stations.select(null);
    view.pointed.at(p);
  }

  #wheel(e) {
    e.preventDefault();
    const view = this.#view;
    const {cloud, camera} = view;
    const p = this.#at(e);
    const lines = e.deltaMode === 1 ? 30 : e.deltaMode === 2 ? 400 : 1;
    const factor = Math.exp(Math.max(-300, Math.min(300, e.deltaY * lines)) * 0.0016);
    const now = performance.now();
    const w = this.#wheeled;
    // As long as the wheel turns, the view zooms about the same place.
    if (w === null || now - w.time > 400 || Math.hypot(p.x - w.x, p.y - w.y) > 4) {
      this.#wheeled = {...p, place: camera.inside ? null : grip(cloud, camera, p.x, p.y)};
    }
    this.#wheeled.time = now;
    view.touched();
    camera.zoom(factor, this.#wheeled.place);
    view.cameraMoved();
  }

  #key(e) {
    const view = this.#view;
    const {camera, stations} = view;
    if (e.ctrlKey || e.metaKey || e.altKey) return;
    const used = () => {
      e.preventDefault();
      view.touched();
    };
    if ((view.once ?? view.tool)?.key(e)) return used();
    if ((view.movable || e.key === 'Escape') && stations.key(camera, e.key, e.shiftKey)) return used();
    const arrow = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1]}[e.key];
    if (arrow) {
      const [h, v] = arrow;
      if (e.shiftKey) camera.pan(-40 * h, -40 * v, camera.distance);
      else if (camera.inside) camera.turn(0.08 * h, -0.08 * v);
      else camera.orbit(camera.target, -0.1 * h, 0.08 * v);
    } else if (e.key === '+' || e.key === '=') camera.zoom(0.85);
    else if (e.key === '-' || e.key === '_') camera.zoom(1 / 0.85);
    else if (e.key === 'Home') view.fit();
    else if (/^i$/i.test(e.key)) view.pickMiddle();
    else if (/^c$/i.test(e.key)) lookAt(view, {x: 0.5 * camera.width, y: 0.5 * camera.height});
    else if (/^[tfso]$/i.test(e.key)) lookBy(camera, e.key);
    else if (/^[np]$/i.test(e.key)) stations.next(/n/i.test(e.key) ? 1 : -1);
    else if (e.key === 'Enter' && stations.selected !== null) view.lookFrom(stations.selected);
    else return;
    used();
    view.cameraMoved();
  }
}
