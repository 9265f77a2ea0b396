/* SPDX-License-Identifier: MIT */
// This module finds the point under the pointer, once the pointer stays, and marks a point that another part of the page
// points at.

import {searchSlowly} from './view_pick.js';
import {pointOf} from './cloud.js';

const HOVER_MS = 70;

export class Hover {
  point = null; // its figures, as pointOf() returns them
  #view;
  #told;
  #timer = 0;
  #stop = null;

  // told(point) is called with each other point, or null
  constructor(view, told) {
    this.#view = view;
    this.#told = told;
  }

  // The pointer is at a place, or nowhere.
  at(p) {
    clearTimeout(this.#timer);
    this.#stop?.();
    this.#stop = null;
    if (p === null) return this.mark(null);
    const {stations, camera, canvas, movable, tool} = this.#view;
    const hit = this.#view.showsStations && !tool ? stations.hit(camera, p.x, p.y) : null;
    canvas.style.cursor = tool ? 'crosshair' : hit && movable ? (hit.what === 'turn' ? 'crosshair' : 'move') : 'default';
    this.#timer = setTimeout(() => {
      this.#stop = this.find(p, 8, (point) => {
        this.#stop = null;
        this.mark(point);
      });
    }, HOVER_MS);
  }

  // Calls then(point) with the point at a place of the canvas, or with null. The function returned stops it.
  find(p, radius_px, then) {
    const {cloud, camera} = this.#view;
    return searchSlowly(cloud, camera, p.x, p.y, radius_px, (found) =>
      then(found && cloud.origin ? pointOf(cloud, found.block, found.i) : null));
  }

  mark(point) {
    if (point === null && this.point === null) return;
    this.point = point;
    this.#told(point);
  }
}
