/* SPDX-License-Identifier: MIT */
// The view draws the picture of a cloud: WebGL 2 points, the scene, the stations, and the point under the pointer.
// README.md has its interface.

import {Camera, radians} from './view_camera.js';
import {MODES} from './view_colours.js';
import {Scale, boxAround, boxOf} from './view_limits.js';
import {Frames} from './view_frames.js';
import {Points} from './view_parts.js';
import {Solids} from './view_scene.js';
import {Stations} from './view_stations.js';
import {Hover} from './view_hover.js';
import {Input, KEYS} from './view_input.js';
import {Overlay} from './view_overlay.js';
import {Programs} from './view_gl.js';
import {listenTo} from './view_events.js';
import {readTheme} from './view_theme.js';

// The picture is drawn again once the drawn points that are gone from the cloud exceed this share of its capacity.
const GONE_SHARE = 0.04;

export class View extends EventTarget {
  static keys = KEYS; // these are [[keys, their effect]], for a help text
  movable = true; // stations can be dragged
  camera = new Camera();
  tool = null; // it takes clicks and keys on the picture: {tap(p), key(e)}; both return whether the tool used the event
  once = null; // it takes them before the tool does, as {tap, key}
  shading = true;
  #gl;
  #frames;
  #points;
  #solids = new Solids();
  #touched = false;
  #fitted = 0; // there were so many points when the view was fitted
  #pointSize = 2;
  #lastGone = 0;
  #replaced = 0; // scans, as the cloud counts them
  #origin = null; // it is that of the points that are drawn
  #scale;
  #pointsOn = true;

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
    this.stations = new Stations(() => this.#frames.ask('show'), (detail) => this.#emit('move', detail));
    this.#frames = new Frames(this, this.#gl, {
      parts: () => [...this.#solids.parts(this.camera, this.colours), ...(this.#pointsOn ? this.#points.parts : [])],
      aim: (scale) => {
        this.#points.scale = scale;
        this.#points.aim(this.camera);
      },
      follow: () => this.#follow(),
      fit: () => this.#fitUntouched(),
      under: (shown) => this.#solids.overlay(this.camera, this.colours, this.stations, shown.depth, shown.scale !== 1),
      over: (camera) => this.overlay.draw({camera, colours: this.colours.css, stations: this.#solids.stationsOn ? this.stations : null,
        marked: this.pointed.point}),
    });
    this.#attach();
    this.#listen();
    new Input(this);
    this.#watchCloud();
    this.#frames.schedule();
  }

  #watchCloud() { this.cloud.changed = () => this.#frames.schedule(); }

  #emit(type, detail) { this.dispatchEvent(new CustomEvent(type, {detail})); }

  #listen() {
    listenTo(this.canvas, {
      lost: () => this.#frames.lose(),
      restored: () => {
        this.#attach();
        this.cameraMoved();
      },
      resized: () => this.#frames.ask('resize'),
      themed: () => {
        this.colours = readTheme(this.canvas); // a frame that waits for the GPU is still put onto the page
        this.#frames.ask('restart');
      },
    });
  }

  // Makes everything on the GPU, also after a lost context.
  #attach() {
    const gl = this.#gl;
    this.programs = new Programs(gl);
    this.colours ??= readTheme(this.canvas);
    this.#frames.attach();
    this.#points = new Points(gl, this.programs, this.cloud);
    this.#paint();
    this.#solids.attach(gl, this.programs);
    this.empty = gl.createVertexArray();
    this.#frames.bare();
  }

  // ---- for the page

  setScene(bytes) {
    this.#solids.setScene(bytes);
    this.#fitUntouched();
    this.#frames.ask('restart');
  }

  setStations(list) {
    this.stations.set(list);
    this.#fitUntouched();
  }

  // Takes {origin, positions, triangles, drawTriangles} or null.
  setMesh(mesh) {
    this.#solids.setMesh(mesh);
    this.#fitUntouched();
    this.#frames.ask('restart');
  }

  // From now on shows the points of another cloud, within the same window of times. The earlier cloud keeps its window.
  useCloud(cloud) {
    cloud.window = this.cloud.window;
    this.cloud.changed = null;
    this.pointed.at(null); // a point of the other cloud is not in this one
    this.cloud = this.#points.cloud = cloud;
    this.#scale.use(cloud);
    this.#watchCloud();
    this.#frames.ask('restart');
  }

  // cells is as parseCells() in previews.js returns it, or null; seen is {counts, isTurned, showsUnseen}.
  paint(cells, seen) {
    if (cells || this.#solids.isPainted) this.#frames.ask('restart');
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
    this.#frames.ask('restart');
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
    this.#frames.ask('restart');
  }

  // Sets the ramp's ends; without arguments: finds them from the present points.
  limits(lo, hi) {
    this.#scale.fix(lo, hi);
    this.#frames.ask('restart');
  }

  // Shows only points of these times, {from, to} in seconds as `latest_s` of the cloud; null shows all. While the times
  // change from picture to picture (isMoving), each picture has a level of detail, like that of a view that moves.
  times(window, isMoving = false) {
    this.cloud.window = window;
    this.#frames.restartLater();
    if (isMoving) this.cameraMoved();
  }

  // Returns the legend, as legendOf in view_colours.js makes it.
  legend() { return this.#scale.legend(); }

  pointSize(px) {
    this.#pointSize = Math.min(20, Math.max(0.5, Number(px)));
    this.#frames.ask('restart');
  }

  select(number) { this.stations.select(number); }

  // Looks from a station's head; the station is a number, or as setStations() has it. Without a station, the first one
  // is taken.
  lookFrom(station = this.stations.list[0]) {
    const s = typeof station === 'object' && station !== null ? station : this.stations.get(Number(station));
    if (!s) return;
    const {at, heading_deg} = this.stations.placeOf(s);
    this.touched();
    this.camera.lookFrom(at, radians(heading_deg));
    this.cameraMoved();
  }

  // Returns {min, max} around all points, the stations and the scene. null: there is nothing, not even a station.
  bounds() { return boxAround(this.cloud, this.stations.list, this.#solids); }

  // Returns {min, max} without stray points: around the scene, or around the points where there is none. null: as bounds().
  usualBounds() { return boxOf(this.cloud, this.stations.list, this.#solids, true); }

  // The handles of a section box stand on its sides, so these are shown, too.
  fit() {
    const {section} = this.camera;
    const box = section?.kind === 'box' ? this.bounds() : boxOf(this.cloud, this.stations.list, this.#solids);
    if (box) this.camera.fit(section?.within(box) ?? box);
    this.cameraMoved();
  }

  // Resolves with a 2D canvas of the picture and what stands over it, once all present points are on the page.
  picture() { return this.#frames.picture(); }

  // Resolves once all present points are on the page.
  screenshotReady() { return this.#frames.ready(); }

  get state() { return this.#frames.state; }

  // ---- for the modules of the picture

  cameraMoved() { this.#frames.ask('camera'); }

  touched() { this.#touched = true; }

  // Looks for the point in the middle of the picture.
  pickMiddle() { this.pointed.middle(); }

  get showsStations() { return this.#solids.stationsOn; }

  // Draws again only the layers over the picture.
  redraw() { this.#frames.ask('overlay'); }

  // ---- following the cloud

  // Returns whether too many drawn points are gone, or the colours' limits have changed.
  #follow() {
    const {cloud} = this;
    const gone = cloud.gone;
    if (cloud.origin !== this.#origin) { // the cloud was cleared, and perhaps filled again
      this.#origin = cloud.origin;
      this.#lastGone = this.#frames.goneDrawn = 0;
      this.#scale.forget();
      this.#fitted = 0;
      this.#frames.ask('restart');
    }
    if (cloud.replaced !== this.#replaced) { // drawn anew at once: points of a repeated scan are gone
      this.#replaced = cloud.replaced;
      this.#frames.ask('restart');
    }
    if (this.#points.follow()) this.#frames.goneDrawn += gone - this.#lastGone;
    this.#lastGone = gone;
    this.#points.size = this.#pointSize * this.ratio;
    const {first, changed} = this.#scale.follow();
    this.#points.limits = this.#scale.limits ?? [0, 1];
    if (first) this.#frames.ask('restart');
    if (cloud.total >= 2 * this.#fitted && cloud.total > 1000 && this.#solids.scene === null) this.#fitUntouched();
    if (this.#frames.goneDrawn <= GONE_SHARE * cloud.capacity) return changed;
    this.#frames.goneDrawn = 0;
    return true;
  }

  // Until the user has moved the view, it shows everything: the scene, or the points so far if there is none.
  #fitUntouched() {
    if (this.#touched) return;
    this.#fitted = this.cloud.total;
    const box = this.usualBounds();
    if (box === null) return;
    this.camera.fit(box);
    this.cameraMoved();
  }
}
