/* SPDX-License-Identifier: MIT */
// This module draws parts piece by piece into a stored picture: a prefix of each part while the view moves, the rest
// once it rests, and only new points as they come.
//
// A part is {n, drawn, weight, skip, whole, draw(from, to)}. `drawn` of its elements are in the picture being worked
// on. The amount per step follows from the time that the last steps took on the GPU (by fences). So a step takes
// STEP_MS, and MOVE_MS while the view moves.

import {Target} from './view_gl.js';

const STEP_MS = 40; // a step may take so long while the view rests
const MOVE_MS = 55; // a frame may take so long while it moves
const LEAST = 25_000;
const MOST = 20_000_000;

// This many points of a resting view are spread over all parts before the rest comes part by part, since each call to
// draw takes as long as 1000 points.
const EVENLY = 400_000;

export class Budget {
  constructor(goal_ms, points) {
    this.goal_ms = goal_ms;
    this.points = points;
  }

  // A step of `points` took `ms`. A step well below the budget doesn't show that more points would be fast
  // enough, so it doesn't raise the budget.
  took(ms, points) {
    const factor = Math.min(1.6, Math.max(0.4, this.goal_ms / Math.max(1, ms)));
    if (factor < 1 || points > 0.7 * this.points) this.points = Math.min(MOST, Math.max(LEAST, this.points * factor));
  }
}

// Returns for each part how many of its elements are to be in the picture after `more` further points were drawn. The
// share is the same in each part. The function is pure.
export function shares(parts, more) {
  let all = 0, done = 0;
  for (const part of parts) {
    if (part.skip) continue;
    all += part.n * part.weight;
    done += part.drawn * part.weight;
  }
  const f = all === 0 ? 1 : Math.min(1, (done + more) / all);
  return parts.map((part) => (part.skip ? part.drawn : Math.max(part.drawn, f === 1 ? part.n : Math.ceil(f * part.n))));
}

// Does the same for a view that rests: first a share of each, then one part after the other. A part that is `whole` is
// drawn at once. If a share of it were drawn, nobody would know later which of its elements are still missing.
export function restShares(parts, more) {
  if (progress(parts).drawn < EVENLY) {
    return shares(parts, more).map((upTo, i) => (parts[i].whole && !parts[i].skip && more > 0 ? parts[i].n : upTo));
  }
  let left = more;
  return parts.map((part) => {
    if (part.skip || left <= 0) return part.drawn;
    const k = part.whole ? part.n - part.drawn : Math.min(part.n - part.drawn, Math.ceil(left / part.weight));
    left -= k * part.weight;
    return part.drawn + k;
  });
}

// There are three targets: one with the picture that is shown, one that is drawn into (the same, or one that replaces
// it once it has enough points), and one for the page, into which the shown picture is drawn with its shading. Targets
// of a moving view may be smaller. The page's target is put onto the canvas only once the GPU has finished it: a
// browser that composes in software waits for the canvas, and the page waits, too.
export class Painter {
  moving = new Budget(MOVE_MS, 150_000);
  resting = new Budget(STEP_MS, 150_000);
  #gl;
  #width = 0;
  #height = 0;
  #shown = null;
  #work = null;
  #spare = [];
  #enough = 0;
  #fence = null;
  #began = 0;
  #then = null;

  constructor(gl) { this.#gl = gl; }

  get shown() { return this.#shown; }
  get scale() { return this.#work.scale; } // the scale of the target that is drawn into
  get swapped() { return this.#work === this.#shown; } // true if the target that is drawn into is also shown

  resize(width, height) {
    for (const target of new Set([this.#shown, this.#work, ...this.#spare])) target?.free();
    this.#spare = [];
    [this.#width, this.#height] = [width, height];
    this.#shown = this.#work = this.#take(1);
    this.#work.bind();
    this.#work.clear();
  }

  #take(scale) {
    const at = this.#spare.findIndex((target) => target.scale === scale);
    if (at >= 0) return this.#spare.splice(at, 1)[0];
    return new Target(this.#gl, Math.max(1, Math.round(this.#width * scale)), Math.max(1, Math.round(this.#height * scale)), scale);
  }

  // Returns a target for the page, of the same scale as the shown one.
  pageTarget() {
    const target = this.#take(this.#shown.scale);
    this.#spare.push(target); // it counts as free already: no target is taken before this one is on the page
    return target;
  }

  // Starts again with an empty picture. The old one stays on the page until the new one has `enough` points.
  begin(parts, enough = 0, scale = 1) {
    if (this.#work !== this.#shown) this.#spare.push(this.#work);
    this.#work = this.#shown;
    if (enough > 0 || this.#shown.scale !== scale) this.#work = this.#take(scale);
    if (enough === 0 && this.#work !== this.#shown) this.#swap();
    this.#enough = enough;
    this.#work.bind();
    this.#work.clear();
    for (const part of parts) part.drawn = 0;
  }

  #swap() {
    this.#spare.push(this.#shown);
    this.#shown = this.#work;
  }

  // Draws about `points` more points, and returns how many it drew: shares are rounded up, and a part that is `whole`
  // is drawn whole. The function `of` is shares or restShares.
  draw(parts, points, of = restShares) {
    const upTo = of(parts, points);
    let did = 0;
    this.#work.bind();
    parts.forEach((part, i) => {
      if (upTo[i] <= part.drawn) return;
      part.draw(part.drawn, upTo[i]);
      did += (upTo[i] - part.drawn) * part.weight;
      part.drawn = upTo[i];
    });
    if (!this.swapped) {
      const {drawn, left} = progress(parts);
      if (drawn >= this.#enough || left === 0) this.#swap();
    }
    return did;
  }

  // Call fence() after a step's last command. Once the GPU has done the step, busy() calls then(ms).
  fence(then) {
    const gl = this.#gl;
    this.#fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    gl.flush();
    this.#began = performance.now();
    this.#then = then;
  }

  // Returns whether the GPU still does the last step. Call busy() between tasks of the page.
  busy() {
    const gl = this.#gl;
    if (this.#fence === null) return false;
    if (!gl.isContextLost() && gl.getSyncParameter(this.#fence, gl.SYNC_STATUS) !== gl.SIGNALED) return true;
    gl.deleteSync(this.#fence);
    this.#fence = null;
    this.#then?.(performance.now() - this.#began);
    return false;
  }

  forget() { // the context is gone
    this.#shown = this.#work = this.#fence = this.#then = null;
    this.#spare = [];
  }
}

export function progress(parts) {
  let drawn = 0, left = 0;
  for (const part of parts) {
    drawn += part.drawn * part.weight;
    if (!part.skip) left += (part.n - part.drawn) * part.weight;
  }
  return {drawn, left};
}
