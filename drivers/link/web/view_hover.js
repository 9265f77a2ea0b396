/* SPDX-License-Identifier: MIT */
// This module finds the point under the pointer, once the pointer stays, and marks a point that another part of the
// page points at.

import {searchSlowly} from './view_pick.js';
import {pointOf} from './cloud.js';

const HOVER_MS = 70, RADIUS_PX = 8, MIDDLE_PX = 40; // it is hard to aim with the middle of a picture

export class Hover {
  point = null; // its figures, as pointOf() returns them
  #view;
  #told;
  #timer = 0;
  #stop = null;

  // Calls told(point or null, isAsked) when the point changes; isAsked: a key has asked for it
  constructor(view, told) {
    this.#view = view;
    this.#told = told;
  }

  // The pointer is at a place, or nowhere.
  at(p) {
    this.#end();
    if (p === null) return this.mark(null);
    const {stations, camera, canvas, movable, tool} = this.#view;
    const hit = this.#view.showsStations && !tool ? stations.hit(camera, p.x, p.y) : null;
    canvas.style.cursor = tool ? 'crosshair' : hit && movable ? (hit.what === 'turn' ? 'crosshair' : 'move') : 'default';
    this.#timer = setTimeout(() => {
      this.#stop = this.find(p, RADIUS_PX, (point) => {
        this.#stop = null;
        this.mark(point);
      });
    }, HOVER_MS);
  }

  // The middle of the picture is for those who have no pointer.
  middle() {
    this.#end();
    const {width, height} = this.#view.camera;
    this.#stop = this.find({x: 0.5 * width, y: 0.5 * height}, MIDDLE_PX, (point) => {
      this.#stop = null;
      this.mark(point, true);
    });
  }

  #end() {
    clearTimeout(this.#timer);
    this.#stop?.();
    this.#stop = null;
  }

  // Calls then(point) with the point at a place of the canvas, or with null. The function returned stops it.
  find(p, radius_px, then) {
    const {cloud, camera} = this.#view;
    return searchSlowly(cloud, camera, p.x, p.y, radius_px, (found) => then(found && pointOf(cloud, found.block, found.i)));
  }

  mark(point, isAsked = false) {
    if (point === null && this.point === null && !isAsked) return;
    this.point = point;
    this.#told(point, isAsked);
  }
}
