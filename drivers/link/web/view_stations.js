/* SPDX-License-Identifier: MIT */
// This module has the stations in the picture: tripods, the selected one, and its moves. A station is dragged along
// the plane at its height, and turned by its handle or by keys. During a move a ghost stays at its old place.

import {add, arrowStep, degrees, headingTo, onPlane, radians} from './view_camera.js';
import {feetBelow} from './view_mesh.js';
import {toSegment} from './view_pick.js';

const GRAB_PX = 18;
const KEYS_END_MS = 700; // after so long without a key the station is let go

// Returns the directions right, forward and up of a head. The head is turned by its heading, then pitch, then roll.
export function headAxes({heading_deg, pitch_deg, roll_deg}) {
  const [h, p, r] = [heading_deg, pitch_deg, roll_deg].map((deg) => radians(deg ?? 0));
  return [[1, 0, 0], [0, 1, 0], [0, 0, 1]].map(([x, y, z]) => {
    const across = x * Math.cos(r) + z * Math.sin(r), sunk = z * Math.cos(r) - x * Math.sin(r);
    const ahead = y * Math.cos(p) - sunk * Math.sin(p), up = y * Math.sin(p) + sunk * Math.cos(p);
    return [across * Math.cos(h) + ahead * Math.sin(h), ahead * Math.cos(h) - across * Math.sin(h), up];
  });
}

// Returns corners of the head's frame (x right, y forward: x0, y0, x1, y1 ...) as places in the scene. The station has
// pitch_deg and roll_deg; place is what placeOf() returns.
export function inScene(place, station, corners) {
  const [right, forward] = headAxes({...station, heading_deg: place.heading_deg});
  const places = [];
  for (let i = 0; i + 1 < corners.length; i += 2) places.push(add(add(place.at, right, corners[i]), forward, corners[i + 1]));
  return places;
}

export class Stations {
  list = [];
  fields = []; // the head's monitored fields are {number, name, outline_m}
  selected = null; // number
  moved = null; // {number, x, y, z, heading_deg} is the station that is moved, at its new place
  dragged = null; // it is called with the place of a station that is dragged; after a cancel with its old place
  pending = false; // the moved station was let go, but setStations() has not confirmed its place yet
  #changed;
  #tell;
  #timer = 0;
  #hold = null; // a drag is {number, what, x, y, began}, and reach, off, turn, steep once it has begun

  // changed() says that the picture must be drawn again; tell(move) says that a station was let go, or that a suggested
  // one was taken.
  constructor(changed, tell) {
    this.#changed = changed;
    this.#tell = tell;
  }

  set(list) {
    this.list = list ?? [];
    if (!this.list.some((s) => s.number === this.selected)) this.selected = null;
    if (this.#hold === null) this.#forget();
    this.#changed();
  }

  #forget() {
    clearTimeout(this.#timer);
    this.moved = null;
    this.pending = false;
  }

  get(number) { return this.list.find((s) => s.number === number); }

  select(number) {
    if (number !== null && !this.get(number)) return;
    if (this.selected !== number && this.moved && !this.pending) this.letGo();
    this.selected = number;
    this.#changed();
  }

  next(step) {
    if (this.list.length === 0) return;
    const at = this.list.findIndex((s) => s.number === this.selected);
    this.select(this.list[at < 0 ? 0 : (at + step + this.list.length) % this.list.length].number);
  }

  // Returns the place where the station is drawn, moved or not.
  placeOf(station) {
    const m = this.moved?.number === station.number ? this.moved : null;
    return m ? {at: [m.x, m.y, m.z], heading_deg: m.heading_deg, ghost: true} :
      {at: [station.x_m, station.y_m, station.z_m], heading_deg: station.heading_deg, ghost: false};
  }

  // Returns the ring around a station, of 0.75 m or, if that is more, 46 px on the screen; null: the station is less
  // than 5 cm before the eye, or behind it.
  ring(camera, station) {
    const {at, heading_deg} = this.placeOf(station);
    const {w} = camera.project(at);
    if (w < 0.05) return null;
    const radius = Math.max(0.75, 46 * w / camera.focal);
    const heading = radians(heading_deg);
    const place = (angle, r = radius) => [at[0] + r * Math.sin(angle), at[1] + r * Math.cos(angle), at[2]];
    return {at, radius, heading, place, handle: place(heading)};
  }

  // Returns {number, what: 'move' or 'turn'} under a place of the screen, or null.
  hit(camera, x, y) {
    let best = null, least = GRAB_PX;
    for (const station of this.list) {
      const ring = this.ring(camera, station);
      if (ring === null) continue;
      const head = camera.project(ring.at);
      if (station.number === this.selected) {
        const knob = camera.project(ring.handle);
        const d = Math.hypot(knob.x - x, knob.y - y) - 4;
        if (knob.w > 0 && d < least && Math.hypot(knob.x - head.x, knob.y - head.y) > 14) { // they are apart
          least = d;
          best = {number: station.number, what: 'turn'};
        }
      }
      const foot = camera.project([ring.at[0], ring.at[1], ring.at[2] - feetBelow(station.tripod)]);
      const d = foot.w > 0 ? toSegment(x, y, head, foot) : Math.hypot(head.x - x, head.y - y);
      if (d < least) {
        least = d;
        best = {number: station.number, what: 'move'};
      }
    }
    return best;
  }

  #begin(number) {
    const station = this.get(number);
    if (this.moved?.number !== number) {
      const {at, heading_deg} = this.placeOf(station);
      this.moved = {number, x: at[0], y: at[1], z: at[2], heading_deg};
    }
    this.pending = false;
  }

  grab({number, what}, x, y) {
    this.select(number);
    this.#hold = {number, what, x, y, began: false};
  }

  drag(camera, x, y) {
    const hold = this.#hold;
    if (hold === null || !this.get(hold.number) || this.get(hold.number).suggested) return;
    if (!hold.began) {
      if (Math.hypot(x - hold.x, y - hold.y) < 4) return; // it was a click
      this.#begin(hold.number);
      hold.began = true;
      const at = [this.moved.x, this.moved.y, this.moved.z];
      hold.reach = 20 * Math.hypot(...at.map((c, a) => c - camera.eye[a])) + 10;
      const on = onPlane(camera, hold.x, hold.y, at[2], hold.reach);
      hold.off = [at[0] - on[0], at[1] - on[1]];
      hold.turn = this.moved.heading_deg - headingTo(at, on);
      // Seen from the side, places on the station's plane are too close together. The station then moves sideways only.
      hold.steep = Math.abs(camera.ray(hold.x, hold.y)[2]) > 0.04;
    }
    const m = this.moved;
    const on = onPlane(camera, x, y, m.z, hold.reach);
    if (hold.what === 'turn') m.heading_deg = degrees(radians(headingTo([m.x, m.y], on) + hold.turn));
    else if (hold.steep) {
      m.x = on[0] + hold.off[0];
      m.y = on[1] + hold.off[1];
    } else {
      const {w} = camera.project([m.x, m.y, m.z]);
      const side = (x - hold.x) * w / camera.focal;
      m.x += side * camera.right[0];
      m.y += side * camera.right[1];
      hold.x = x;
    }
    this.dragged?.(m);
    this.#changed();
  }

  drop(cancelled = false) {
    const {began, number} = this.#hold ?? {};
    const suggested = this.get(number)?.suggested;
    if (began && cancelled) return this.cancel();
    this.#hold = null;
    if (suggested && !cancelled) this.#tell({station: number, taken: true}); // a click takes it
    if (began) this.letGo();
    return undefined;
  }

  get dragging() { return this.#hold !== null; }

  // Returns true if the key was for the selected station.
  key(camera, key, shift) {
    if (this.selected === null) return false;
    const step = shift ? 1 : 0.1;
    const moves = {PageUp: step, PageDown: -step};
    const turns = {'[': -5, ']': 5, '{': -45, '}': 45};
    const arrow = key.startsWith('Arrow');
    if (key === 'Escape') {
      if (this.moved) this.cancel();
      else this.select(null);
      return true;
    }
    if (this.get(this.selected).suggested || (!arrow && !(key in moves) && !(key in turns))) return false;
    this.#begin(this.selected);
    const m = this.moved;
    if (arrow) {
      const [dx, dy] = arrowStep(camera, key, step);
      m.x += dx;
      m.y += dy;
    } else if (key in moves) m.z += moves[key];
    else m.heading_deg = (m.heading_deg + turns[key] + 360) % 360;
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.letGo(), KEYS_END_MS);
    this.#changed();
    return true;
  }

  letGo() {
    clearTimeout(this.#timer);
    if (!this.moved || this.pending) return;
    const {number, x, y, z, heading_deg} = this.moved;
    this.pending = true;
    this.#tell({station: number, x, y, z, heading_deg});
    this.#changed();
  }

  // The points of a trial (trial.js) followed the dragged station, and go back with it. The pointer may still be down:
  // its further moves do nothing.
  cancel() {
    const station = this.moved && this.get(this.moved.number);
    const wasDragged = this.#hold !== null;
    this.#hold = null;
    this.#forget();
    if (station && wasDragged) this.dragged?.({number: station.number, x: station.x_m, y: station.y_m, z: station.z_m, heading_deg: station.heading_deg});
    this.#changed();
  }
}
