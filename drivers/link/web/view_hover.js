/* SPDX-License-Identifier: MIT */
// The point under the pointer, or under the middle of the picture for those who have none: it is searched for once the
// pointer stays, in slices of a few milliseconds.
import {pointOf} from './cloud.js';
import {searchSlowly} from './view_pick.js';

const HOVER_MS = 70, RADIUS_PX = 8, MIDDLE_PX = 40; // nobody aims well with the middle of a picture

export class Hover {
  point = null;
  #view;
  #picked;
  #timer = 0;
  #stop = null;

  // picked(point or null, isAsked) says what is found; isAsked: by a key.
  constructor(view, picked) {
    this.#view = view;
    this.#picked = picked;
  }

  // The pointer is at a place of the canvas, or nowhere.
  at(p) {
    this.#end();
    if (p === null) return this.#found(null, false);
    this.#timer = setTimeout(() => this.#search(p, RADIUS_PX, false), HOVER_MS);
  }

  middle() {
    this.#end();
    const {width, height} = this.#view.camera;
    this.#search({x: 0.5 * width, y: 0.5 * height}, MIDDLE_PX, true);
  }

  #end() {
    clearTimeout(this.#timer);
    this.#stop?.();
    this.#stop = null;
  }

  #search(p, radius_px, isAsked) {
    const {cloud, camera} = this.#view;
    this.#stop = searchSlowly(cloud, camera, p.x, p.y, radius_px, (found) => {
      this.#stop = null;
      this.#found(found && cloud.origin ? pointOf(cloud, found.block, found.i) : null, isAsked);
    });
  }

  #found(point, isAsked) {
    if (point === null && this.point === null && !isAsked) return;
    this.point = point;
    this.#picked(point, isAsked);
  }
}
