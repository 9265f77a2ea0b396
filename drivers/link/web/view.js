/* SPDX-License-Identifier: MIT */
// The view draws the picture of a cloud: WebGL 2 points, the scene, the stations, and the point under the pointer.
// README.md has its interface. While the view moves it draws a level of detail, as much as a picture's time allows. At
// rest the other points are added, a slice at a time; so are points that come.

import {Camera, radians} from './view_camera.js';
import {MODES} from './view_colours.js';
import {Scale, boxOf} from './view_limits.js';
import {Painter, progress, shares} from './view_draw.js';
import {Points} from './view_parts.js';
import {Solids} from './view_scene.js';
import {Stations} from './view_stations.js';
import {Hover} from './view_hover.js';
import {Input, KEYS} from './view_input.js';
import {Overlay} from './view_overlay.js';
import {drawShaded, Programs} from './view_gl.js';
import {lookAt} from './view_pick.js';
import {readTheme} from './view_theme.js';
import {copyOf} from './picture.js';
import {listenTo} from './view_events.js';

const REST_MS = 120; // after so long without a movement the view rests
const SHOW_MS = 160; // updates of a growing picture are so far apart, and twice the time of one
const GONE_SHARE = 0.04; // if more than this share of the capacity is gone from the picture, it is drawn again
const PLAIN = 150_000; // with fewer points per frame, a frame is drawn plain
const COARSE = 0.5; // this is the scale of such a frame
const SHADING = 260; // eye-dome lighting counts per unit of logarithmic depth

export class View extends EventTarget {
  static keys = KEYS; // these are [[keys, their effect]], for a help text
  static modes = MODES;
  movable = true; // stations can be dragged
  camera = new Camera();
  tool = null; // it takes clicks and keys on the picture: {tap(p), key(e)}, each returns whether it has used it
  once = null; // it takes them before the tool does, as {tap, key}
  shading = true;
  #gl;
  #painter;
  #points;
  #solids = new Solids();
  #want = {camera: true, restart: null, show: true, resize: true, overlay: true};
  #moving = false;
  #movedAt = -Infinity;
  #shownAt = -Infinity;
  #lastFrame = 0;
  #fps = 0;
  #toldAt = -Infinity;
  #scheduled = false;
  #lost = false;
  #touched = false;
  #fitted = 0; // there were so many points when the view was fitted
  #pointSize = 2;
  #waiting = [];
  #goneDrawn = 0;
  #lastGone = 0;
  #replaced = 0; // scans, as the cloud counts them
  #origin = null; // it is that of the points that are drawn
  #scale;
  #pointsOn = true;
  #size = null; // it is the size of the picture, in its pixels
  #made = null; // it is {target, camera} of a frame that is not on the page yet
  #grown = false; // more is drawn than on the page
  #showEvery = SHOW_MS;
  #photo = null; // it takes the next picture on the page
  #seen = this.camera; // it is the camera of the picture on the page

  constructor(canvas, cloud) {
    super();
    this.canvas = canvas;
    this.cloud = cloud;
    this.#gl = canvas.getContext('webgl2', {alpha: false, antialias: false, powerPreference: 'high-performance'});
    if (!this.#gl) throw new Error('no WebGL 2');
    this.overlay = new Overlay(canvas);
    this.#scale = new Scale(cloud);
    this.pointed = new Hover(this, (point, isAsked) => {
      this.#emit('pick', point || isAsked ? {point, isAsked} : null);
      this.redraw();
    });
    this.stations = new Stations(() => this.#ask('show'), (detail) => this.#emit('move', detail));
    this.#attach();
    this.#listen();
    new Input(this);
    cloud.changed = () => this.#schedule();
    this.#schedule();
  }

  #emit(type, detail) { this.dispatchEvent(new CustomEvent(type, {detail})); }

  #listen() {
    listenTo(this.canvas, {
      lost: () => {
        [this.#lost, this.#made] = [true, null];
        this.#painter.forget();
      },
      restored: () => {
        this.#lost = false;
        this.#attach();
        this.#want.resize = true;
        this.cameraMoved();
      },
      resized: () => this.#ask('resize'),
      themed: () => {
        this.colours = null;
        this.#ask('restart');
      },
    });
  }

  // Makes everything on the GPU, also after a lost context.
  #attach() {
    const gl = this.#gl;
    this.programs = new Programs(gl);
    this.#painter = new Painter(gl);
    this.#points = new Points(gl, this.programs, this.cloud);
    this.#paint();
    this.#solids.attach(gl, this.programs);
    this.empty = gl.createVertexArray();
    this.#bare();
  }

  // The page's ground is shown until there is a picture, since an empty canvas is black.
  #bare() {
    const gl = this.#gl;
    this.colours ??= readTheme(this.canvas);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.clearColor(...this.colours.ground, 1);
    gl.clear(gl.COLOR_BUFFER_BIT);
  }

  // ---- what the page asks for

  setScene(bytes) {
    this.#solids.setScene(bytes);
    this.#fitUntouched();
    this.#ask('restart');
  }

  setStations(list) {
    this.stations.set(list);
    this.#fitUntouched();
  }

  // It takes {origin, positions, triangles, drawTriangles} or null.
  setMesh(mesh) {
    this.#solids.setMesh(mesh);
    this.#fitUntouched();
    this.#ask('restart');
  }

  // Shows the points of another cloud from now on, of the same times. The one before keeps its own.
  useCloud(cloud) {
    cloud.window = this.cloud.window;
    this.cloud.changed = null;
    this.cloud = this.#points.cloud = cloud;
    this.#scale.use(cloud);
    cloud.changed = () => this.#schedule();
    this.#ask('restart');
  }

  // cells is as parseCells() in previews.js returns it, or null; seen is {counts, isTurned, showsUnseen}.
  paint(cells, seen) {
    if (cells || this.#solids.isPainted) this.#ask('restart');
    this.#solids.paint(cells, seen);
  }

  // Each of {points, scene, mesh, stations} is true or false; scene also 'glass' or 'solid'. Members that are not
  // given stay.
  show(what) {
    const s = this.#solids;
    if (what.points !== undefined) this.#pointsOn = Boolean(what.points);
    if (what.mesh !== undefined) s.meshOn = Boolean(what.mesh);
    if (what.stations !== undefined) s.stationsOn = Boolean(what.stations);
    if (what.scene !== undefined) s.sceneMode = what.scene === 'solid' ? 'solid' : what.scene && what.scene !== 'off' ? 'glass' : 'off';
    this.#ask('restart');
  }

  colour(mode) {
    if (!(mode in MODES)) throw new RangeError(`colour ${mode}: one of ${Object.keys(MODES).join(', ')}`);
    this.#scale.colour(mode);
    this.#paint();
  }

  // Takes one of SCALES in view_ramps.js, and the share of the points that may lie beyond each end of a ramp.
  ramp({scale = this.#scale.scale, share = this.#scale.share}) {
    this.#scale.choose(scale, share);
    this.#paint();
  }

  #paint() {
    this.#points.setMode(this.#scale.mode, this.#scale.scale);
    this.#ask('restart');
  }

  // Sets the ramp's ends; without arguments: finds them from the present points.
  limits(lo, hi) {
    this.#scale.fix(lo, hi);
    this.#ask('restart');
  }

  // Shows only points of these times, {from, to} in seconds as `latest_s` of the cloud; null shows all. While the times
  // change from picture to picture (isMoving), each picture has a level of detail, like that of a view that moves.
  times(window, isMoving = false) {
    this.cloud.window = window;
    this.#want.restart ??= 'later';
    if (isMoving) this.#want.camera = true;
    this.#schedule();
  }

  // It returns the legend; see legendOf in view_colours.js.
  legend() { return this.#scale.legend(); }

  pointSize(px) {
    this.#pointSize = Math.min(20, Math.max(0.5, Number(px)));
    this.#ask('restart');
  }

  select(number) { this.stations.select(number); }

  // Looks from a station's head; the station is a number, or as setStations() has it. Without one it is the first.
  lookFrom(station = this.stations.list[0]) {
    const s = typeof station === 'object' && station !== null ? station : this.stations.get(Number(station));
    if (!s) return;
    const {at, heading_deg} = this.stations.placeOf(s);
    this.touched();
    this.camera.lookFrom(at, radians(heading_deg));
    this.cameraMoved();
  }

  // Returns {min, max} of the scene, or of the points without their far ends; null: there is nothing.
  bounds() { return boxOf(this.cloud, this.stations.list, this.#solids, true); }

  fit() {
    const box = boxOf(this.cloud, this.stations.list, this.#solids);
    if (box) this.camera.fit(this.camera.section?.within(box) ?? box);
    this.cameraMoved();
  }

  // Turns about the point at a place of the canvas from now on, and goes half the distance to it.
  lookAt(p) { lookAt(this, p); }

  // Resolves with a 2D canvas of the picture and what stands over it, once all present points are on the page.
  async picture() {
    await this.screenshotReady();
    return new Promise((resolve) => {
      this.#photo = resolve;
      this.#ask('show');
    });
  }

  // Resolves once all present points are on the page.
  screenshotReady() {
    this.#ask('show');
    return new Promise((resolve) => this.#waiting.push(resolve));
  }

  get state() {
    const {drawn, left} = progress(this.#parts());
    return {drawn, left, moving: this.#moving, frames_per_s: this.#fps, budget: this.#painter.moving.points, lost: this.#lost};
  }

  // ---- for the modules of the picture

  cameraMoved() {
    this.#want.camera = true;
    this.#schedule();
  }

  touched() { this.#touched = true; }

  hover(p) { this.pointed.at(p); }

  // Looks for the point in the middle of the picture.
  pickMiddle() { this.pointed.middle(); }

  get showsStations() { return this.#solids.stationsOn; }

  // Draws again only the layers over the picture.
  redraw() { this.#ask('overlay'); }

  // ---- drawing

  #ask(what) {
    this.#want[what] = what === 'restart' ? 'now' : true;
    this.#schedule();
  }

  #schedule() {
    if (this.#scheduled || this.#lost) return;
    this.#scheduled = true;
    requestAnimationFrame((now) => {
      this.#scheduled = false;
      this.#frame(now);
    });
  }

  #frame(now) {
    if (this.#lost) return;
    if (this.#painter.busy()) { // the GPU is still at it
      this.#scheduled = true;
      setTimeout(() => {
        this.#scheduled = false;
        this.#frame(performance.now());
      }, 4);
      return;
    }
    if (this.#made) {
      this.#put(now);
      return;
    }
    const want = this.#want;
    if (want.resize) this.#resize();
    if (this.#size === null) return;
    this.colours ??= readTheme(this.canvas);
    if (this.#follow()) want.restart ??= 'later';
    const parts = this.#parts();
    if (want.camera) this.#move(parts, now);
    else this.#rest(parts, now);
    if (want.overlay && !this.#made) this.#over();
    this.#tell(now);
    this.#next(parts);
  }

  #parts() {
    if (!this.colours) return [];
    return [...this.#solids.parts(this.camera, this.colours), ...(this.#pointsOn ? this.#points.parts : [])];
  }

  #aim(scale) {
    this.#points.scale = scale;
    this.#points.aim(this.camera);
  }

  #move(parts, now) {
    const want = this.#want;
    const painter = this.#painter;
    Object.assign(want, {camera: false, restart: null, show: false});
    this.#moving = true;
    this.#movedAt = now;
    this.#goneDrawn = 0;
    const scale = this.#plain ? COARSE : 1;
    this.#aim(scale);
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
    this.#aim(1);
    if (want.restart) {
      const {drawn} = progress(parts);
      painter.begin(parts, want.restart === 'later' ? drawn : Math.min(drawn, 300_000));
      painter.draw(parts, 0);
      this.#goneDrawn = 0;
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

  // Draws the shown picture, shaded and with its overlay, into a target that is put onto the page once it is done.
  #present() {
    const {shown} = this.#painter;
    const target = this.#painter.pageTarget();
    target.bind();
    drawShaded(this.#gl, this.programs.shade, this.empty, shown, {ground: this.colours.ground,
      strength: this.shading && shown.scale === 1 ? SHADING : 0, step: Math.max(1, Math.round(this.ratio))});
    this.#solids.overlay(this.camera, this.colours, this.stations, shown.depth, shown.scale !== 1);
    this.#made = {target, camera: Object.assign(new Camera(), this.camera), moving: this.#moving};
  }

  // Puts it onto the page, now that the GPU has it.
  #put(now) {
    const {target, camera, moving} = this.#made;
    this.#made = null;
    this.#shownAt = now;
    const [width, height] = this.#size;
    if (this.canvas.width !== width || this.canvas.height !== height) {
      Object.assign(this.canvas, {width, height});
      this.#bare(); // Chromium drops a blit that is the first thing drawn
    }
    target.toPage(width, height);
    this.#seen = camera;
    this.#over();
    this.#photo?.(copyOf(this.canvas, this.overlay.canvas)); // a WebGL canvas can be read in the task that drew it
    this.#photo = null;
    if (moving) {
      if (this.#lastFrame > 0 && now - this.#lastFrame < 1000) {
        const fps = 1000 / Math.max(1, now - this.#lastFrame);
        this.#fps = this.#fps ? 0.8 * this.#fps + 0.2 * fps : fps;
      }
      this.#lastFrame = now;
    }
    this.#schedule();
  }

  #over() {
    this.#want.overlay = false;
    this.overlay.draw({camera: this.#seen, colours: this.colours.css, stations: this.#solids.stationsOn ? this.stations : null,
      marked: this.pointed.point});
  }

  #next(parts) {
    const {left} = progress(parts);
    const want = this.#want;
    const open = this.#moving || left > 0 || this.#made || this.#grown || want.show;
    if (open || want.camera || want.restart || want.resize || this.#painter.busy()) this.#schedule();
    else {
      for (const resolve of this.#waiting.splice(0)) resolve();
      this.#tell(performance.now(), true);
    }
  }

  #tell(now, done = false) {
    if (now - this.#toldAt < (done ? 250 : 500)) return;
    this.#toldAt = now;
    this.#emit('drawn', {frames_per_s: this.#fps, points: progress(this.#parts()).drawn});
  }

  #resize() {
    const {canvas, camera} = this;
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
    Object.assign(camera, {width, height});
    this.ratio = ratio;
    this.#fitUntouched();
    this.overlay.resize(width, height, ratio);
    this.#want.overlay = true;
  }

  // Where the GPU is slow, a frame of a moving view is half as wide and high, and without effects that take time per
  // pixel.
  get #plain() { return this.#painter.moving.points < PLAIN; }

  // ---- what follows from the cloud

  // True: too many drawn points are gone, or the colours' limits have changed.
  #follow() {
    const {cloud} = this;
    const gone = cloud.gone;
    if (cloud.origin !== this.#origin) { // the cloud was cleared, and perhaps filled again
      this.#origin = cloud.origin;
      this.#lastGone = this.#goneDrawn = 0;
      this.#scale.forget();
      this.#fitted = 0;
      this.#want.restart = 'now';
    }
    if (cloud.replaced !== this.#replaced) { // it is done at once, since the old points are elsewhere
      this.#replaced = cloud.replaced;
      this.#want.restart = 'now';
    }
    if (this.#points.follow()) this.#goneDrawn += gone - this.#lastGone;
    this.#lastGone = gone;
    this.#points.size = this.#pointSize * this.ratio;
    const {first, changed} = this.#scale.follow();
    this.#points.limits = this.#scale.limits ?? [0, 1];
    if (first) this.#want.restart = 'now';
    if (cloud.total >= 2 * this.#fitted && cloud.total > 1000 && this.#solids.scene === null) this.#fitUntouched();
    if (this.#goneDrawn <= GONE_SHARE * cloud.capacity) return changed;
    this.#goneDrawn = 0;
    return true;
  }

  // Until the user has moved the view, it shows everything: the scene, or the points so far if there is none.
  #fitUntouched() {
    if (this.#touched) return;
    this.#fitted = this.cloud.total;
    const box = boxOf(this.cloud, this.stations.list, this.#solids, true);
    if (box === null) return;
    this.camera.fit(box);
    this.cameraMoved();
  }
}
