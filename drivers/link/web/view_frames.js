/* SPDX-License-Identifier: MIT */
// This class decides when the parts of a picture are drawn, and when the picture comes onto the page. While the view
// moves, a picture has as many points as its time allows. At rest the other points are added, a slice at a time.

import {Camera} from './view_camera.js';
import {Painter, progress, shares} from './view_draw.js';
import {drawShaded} from './view_gl.js';
import {copyOf} from './picture.js';

const REST_MS = 120; // after so long without a movement the view rests
const SHOW_MS = 160; // least time between updates of a growing picture; it is also at least twice the time of an update
const PLAIN = 150_000; // a GPU that draws fewer points in the time of a frame gets plain frames (#plain)
const COARSE = 0.5; // this is the scale of a plain frame
const SHADING = 260; // the strength of eye-dome lighting: a factor of differences in logarithmic depth (view_gl.js)

export class Frames {
  goneDrawn = 0; // points that are drawn, and are gone from the cloud
  #view;
  #gl;
  #contents;
  #painter;
  #want = {camera: true, restart: null, show: true, resize: true, overlay: true};
  #moving = false;
  #movedAt = -Infinity;
  #shownAt = -Infinity;
  #lastFrame = 0;
  #fps = 0;
  #toldAt = -Infinity;
  #scheduled = false;
  #lost = false;
  #waiting = [];
  #size = null; // it is the size of the picture, in its pixels
  #made = null; // it is {target, camera} of a frame that is not on the page yet
  #grown = false; // more is drawn than on the page
  #showEvery = SHOW_MS;
  #photos = []; // these take the next picture on the page
  #seen; // it is the camera of the picture on the page

  // contents is {parts, aim(scale), follow, fit, under(shown), over(camera)}. parts() are those of the stored picture.
  // Each time that picture is shown, under(shown) draws the stations and the scene over it, and over(camera) draws the
  // 2D canvas that lies above both. follow() returns whether all is to be drawn again.
  constructor(view, gl, contents) {
    this.#view = view;
    this.#gl = gl;
    this.#contents = contents;
    this.#seen = view.camera;
  }

  // Makes everything on the GPU, also after a lost context.
  attach() {
    this.#lost = false;
    this.#painter = new Painter(this.#gl);
    this.#want.resize = true;
  }

  lose() {
    [this.#lost, this.#made] = [true, null];
    this.#painter.forget();
  }

  // The page's ground is shown until there is a picture, since an empty canvas is black.
  bare() {
    const gl = this.#gl, view = this.#view;
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.clearColor(...view.colours.ground, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
  }

  // what: 'camera' has moved, 'restart' draws all again, 'show' brings what is drawn onto the page, 'resize', 'overlay'
  ask(what) {
    this.#want[what] = what === 'restart' ? 'now' : true;
    this.schedule();
  }

  // Draws all again like 'restart', but the old picture stays until the new one has as many points.
  restartLater() {
    this.#want.restart ??= 'later';
    this.schedule();
  }

  // Resolves with a 2D canvas of the picture and what stands over it, once all present points are on the page.
  async picture() {
    await this.ready();
    return new Promise((resolve) => {
      this.#photos.push(resolve);
      this.ask('show');
    });
  }

  // Resolves once all present points are on the page.
  ready() {
    this.ask('show');
    return new Promise((resolve) => this.#waiting.push(resolve));
  }

  get state() {
    const {drawn, left} = progress(this.#contents.parts());
    return {drawn, left, moving: this.#moving, frames_per_s: this.#fps};
  }

  schedule() {
    if (this.#scheduled || this.#lost) return;
    this.#scheduled = true;
    requestAnimationFrame((now) => {
      this.#scheduled = false;
      this.#frame(now);
    });
  }

  #frame(now) {
    if (this.#lost) return;
    if (this.#painter.busy()) { // the GPU has not finished what was drawn before
      this.#scheduled = true;
      setTimeout(() => {
        this.#scheduled = false;
        this.#frame(performance.now());
      }, 4);
      return;
    }
    if (this.#made) {
      this.#showMade(now);
      return;
    }
    const want = this.#want;
    if (want.resize) this.#resize();
    if (this.#size === null) return;
    if (this.#contents.follow()) want.restart ??= 'later';
    const parts = this.#contents.parts();
    if (want.camera) this.#move(parts, now);
    else this.#rest(parts, now);
    if (want.overlay && !this.#made) this.#over();
    this.#tell(now);
    this.#next(parts);
  }

  #move(parts, now) {
    const want = this.#want;
    const painter = this.#painter;
    Object.assign(want, {camera: false, restart: null, show: false});
    this.#moving = true;
    this.#movedAt = now;
    this.goneDrawn = 0;
    const scale = this.#plain ? COARSE : 1;
    this.#contents.aim(scale);
    painter.begin(parts, 0, scale);
    const did = painter.draw(parts, painter.moving.points, shares);
    this.#present();
    painter.fence((ms) => painter.moving.took(ms, did));
  }

  #rest(parts, now) {
    const want = this.#want;
    const painter = this.#painter;
    if (now - this.#movedAt < REST_MS && this.#moving) return;
    if (this.#moving) want.show = true;
    this.#moving = false;
    this.#lastFrame = 0;
    if (painter.swapped && painter.scale !== 1) want.restart ??= 'later';
    this.#contents.aim(1);
    if (want.restart) {
      const {drawn} = progress(parts);
      painter.begin(parts, want.restart === 'later' ? drawn : Math.min(drawn, 300_000));
      painter.draw(parts, 0);
      this.goneDrawn = 0;
      want.restart = null;
      want.show = true;
    }
    const {left} = progress(parts);
    if (painter.swapped && (want.show || (this.#grown && (left === 0 || now - this.#shownAt > this.#showEvery)))) {
      this.#present();
      want.show = this.#grown = false;
      painter.fence((ms) => { this.#showEvery = Math.max(SHOW_MS, 2 * ms); });
    } else if (left > 0) {
      const did = painter.draw(parts, painter.resting.points);
      this.#grown = true;
      painter.fence((ms) => painter.resting.took(ms, did));
    }
  }

  // Draws the shown picture, shaded and with what is drawn over it, into a target that is put onto the page once it is
  // done.
  #present() {
    const {shown} = this.#painter, view = this.#view;
    const target = this.#painter.pageTarget();
    target.bind();
    drawShaded(this.#gl, view.programs.shade, view.empty, shown, {ground: view.colours.ground,
      strength: view.shading && shown.scale === 1 ? SHADING : 0, step: Math.max(1, Math.round(view.ratio))});
    this.#contents.under(shown);
    this.#made = {target, camera: Object.assign(new Camera(), view.camera), moving: this.#moving};
  }

  // Puts the frame in #made onto the page, now that the GPU has drawn it.
  #showMade(now) {
    const {target, camera, moving} = this.#made;
    this.#made = null;
    this.#shownAt = now;
    const [width, height] = this.#size;
    if (this.#view.canvas.width !== width || this.#view.canvas.height !== height) {
      Object.assign(this.#view.canvas, {width, height});
      this.bare(); // Chromium drops a blit that is the first thing drawn
    }
    target.toPage(width, height);
    this.#seen = camera;
    this.#over();
    // A WebGL canvas can be read in the task that drew it.
    for (const photo of this.#photos.splice(0)) photo(copyOf(this.#view.canvas, this.#view.overlay.canvas));
    if (moving) {
      if (this.#lastFrame > 0 && now - this.#lastFrame < 1000) {
        const fps = 1000 / Math.max(1, now - this.#lastFrame);
        this.#fps = this.#fps ? 0.8 * this.#fps + 0.2 * fps : fps;
      }
      this.#lastFrame = now;
    }
    this.schedule();
  }

  #over() {
    this.#want.overlay = false;
    this.#contents.over(this.#seen);
  }

  #next(parts) {
    const {left} = progress(parts);
    const want = this.#want;
    const open = this.#moving || left > 0 || this.#made || this.#grown || want.show;
    if (open || want.camera || want.restart || want.resize || this.#painter.busy()) this.schedule();
    else {
      for (const resolve of this.#waiting.splice(0)) resolve();
      this.#tell(performance.now(), true);
    }
  }

  #tell(now, done = false) {
    if (now - this.#toldAt < (done ? 250 : 500)) return;
    this.#toldAt = now;
    this.#view.dispatchEvent(new CustomEvent('drawn', {detail: {frames_per_s: this.#fps, points: progress(this.#contents.parts()).drawn}}));
  }

  #resize() {
    const view = this.#view, {canvas} = view;
    this.#want.resize = false;
    const width = canvas.clientWidth, height = canvas.clientHeight;
    const ratio = Math.min(2, globalThis.devicePixelRatio || 1);
    const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (w === 0 || h === 0) return;
    if (this.#size?.[0] !== w || this.#size?.[1] !== h || !this.#painter.shown) {
      this.#size = [w, h]; // the canvas gets its size with its picture, since a new size makes it black
      this.#made = null;
      this.#painter.resize(w, h);
      this.#want.camera = true;
    }
    Object.assign(view.camera, {width, height});
    view.ratio = ratio;
    this.#contents.fit();
    view.overlay.resize(width, height, ratio);
    this.#want.overlay = true;
  }

  // Where the GPU is slow, a frame of a moving view is half as wide and high, and without effects that take time per
  // pixel.
  get #plain() { return this.#painter.moving.points < PLAIN; }
}
