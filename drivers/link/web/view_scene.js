/* SPDX-License-Identifier: MIT */
// This class draws everything except the points: the coarse scene, a recording's mesh, the stations. It owns their
// buffers on the GPU.

import {Mesh, useMesh} from './view_parts.js';
import {featureEdges, legsMesh, parseScene, stationMesh} from './view_mesh.js';
import {radians} from './view_camera.js';
import {CellsPart} from './view_paint.js';

// Lines cost 1 us each where there is no GPU, as much as a point.
const EDGES = 16_000, EDGES_MOVING = 3_000;

export class Solids {
  scene = null; // it stores {origin, positions, triangles, lines}, to make buffers again after a lost context
  mesh = null;
  sceneMode = 'glass'; // it is 'off', 'glass' or 'solid'
  meshOn = true;
  stationsOn = true;
  #painted = null; // it is {cells, seen} of the painted surface
  #shapes = new Map(); // it has the body, and legs by the tripod's measures

  attach(gl, programs) {
    this.gl = gl;
    this.programs = programs;
    this.#shapes.clear();
    this.sceneMesh = this.scene && new Mesh(gl, this.programs, this.scene);
    this.meshPart = this.mesh && new Mesh(gl, this.programs, this.mesh);
    this.cellsPart = null;
    if (this.#painted) this.paint(this.#painted.cells, this.#painted.seen);
  }

  get isPainted() { return this.#painted !== null; }

  // view.js describes the arguments. If the cells are the same as before, their buffers are kept.
  paint(cells, seen) {
    if (this.cellsPart && this.#painted?.cells !== cells) {
      this.cellsPart.free();
      this.cellsPart = null;
    }
    this.#painted = cells && {cells, seen};
    if (!cells) return;
    this.cellsPart ??= new CellsPart(this.gl, this.programs, cells);
    this.cellsPart.show(seen);
  }

  // Takes the bytes of /scene; null: there is none.
  setScene(bytes) {
    this.scene = bytes === null || bytes === undefined ? null : parseScene(bytes);
    if (this.scene) this.scene.lines = featureEdges(this.scene.positions, this.scene.triangles);
    this.sceneMesh?.free();
    this.sceneMesh = this.scene && new Mesh(this.gl, this.programs, this.scene);
  }

  // Takes {origin, positions, triangles, drawTriangles}; the same arrays again with another drawTriangles take no
  // time.
  setMesh(mesh) {
    const same = mesh && this.mesh && mesh.triangles === this.mesh.triangles && mesh.positions === this.mesh.positions;
    this.mesh = mesh;
    if (same) this.meshPart.n = Math.min(this.meshPart.all, mesh.drawTriangles ?? this.meshPart.all);
    else {
      this.meshPart?.free();
      this.meshPart = mesh && new Mesh(this.gl, this.programs, mesh);
    }
  }

  bounds() {
    for (const mesh of [this.scene, this.mesh]) {
      if (!mesh || mesh.positions.length === 0) continue;
      const min = [Infinity, Infinity, Infinity], max = [-Infinity, -Infinity, -Infinity];
      mesh.positions.forEach((v, i) => {
        const a = i % 3;
        min[a] = Math.min(min[a], v + mesh.origin[a]);
        max[a] = Math.max(max[a], v + mesh.origin[a]);
      });
      return {min, max};
    }
    return null;
  }

  // Returns the parts of the stored picture, under the points.
  parts(camera, colours) {
    const parts = [];
    if (this.sceneMesh && this.sceneMode === 'solid') {
      parts.push(Object.assign(this.sceneMesh, {camera, look: {colour: [...colours.solid, 1], push: 1.0015}}));
    }
    if (this.meshPart && this.meshOn) parts.push(Object.assign(this.meshPart, {camera, look: {colour: [...colours.mesh, 1], push: 1.0005}}));
    if (this.cellsPart) parts.push(Object.assign(this.cellsPart, {camera}));
    return parts;
  }

  // Draws over the stored picture, each time it is shown. behind is that picture's depth; plain draws only the longest
  // edges of the scene.
  overlay(camera, colours, stations, behind, plain) {
    const {gl} = this;
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LEQUAL);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    // The glass comes last, so that stations are seen through it: its nearest faces hide what is drawn later.
    if (this.stationsOn) for (const station of stations.list) this.#station(camera, colours, stations, station, behind);
    if (this.sceneMesh && this.sceneMode === 'glass') this.#glass(camera, colours, behind, plain);
    gl.bindVertexArray(null);
    gl.activeTexture(gl.TEXTURE1);
    gl.bindTexture(gl.TEXTURE_2D, null);
    gl.activeTexture(gl.TEXTURE0);
    gl.disable(gl.BLEND);
  }

  // Draws only the nearest of the coarse scene's faces, then the scene's edges.
  #glass(camera, colours, behind, plain) {
    const {gl, sceneMesh: mesh} = this;
    const face = {colour: [...colours.scene, 0.07], edge: 0.25, push: 1.002, faint: 0, behind};
    if (!plain) {
      useMesh(gl, this.programs, camera, mesh.origin, face);
      gl.colorMask(false, false, false, false);
      mesh.triangles();
      gl.colorMask(true, true, true, true);
      mesh.triangles();
    }
    useMesh(gl, this.programs, camera, mesh.origin, {...face, colour: [...colours.scene, 0.4], flat: true, push: 0.9995, faint: 0.3});
    mesh.lines(plain ? EDGES_MOVING : EDGES);
  }

  #shape(tripod) {
    const key = tripod ? [tripod.leg_m, tripod.foot_radius_m, tripod.head_above_m].join() : '';
    if (!this.#shapes.has(key)) {
      const mesh = tripod ? legsMesh(tripod) : stationMesh();
      this.#shapes.set(key, new Mesh(this.gl, this.programs, {origin: [0, 0, 0], ...mesh}));
    }
    return this.#shapes.get(key);
  }

  #station(camera, colours, stations, station, behind) {
    const {gl} = this;
    const {tripod} = station;
    const {at, heading_deg, ghost} = stations.placeOf(station);
    const eye = camera.eye;
    if (Math.hypot(...at.map((c, a) => c - eye[a])) < 0.4) return; // the eye is in this station
    const colour = station.number === stations.selected || ghost || station.suggested ? colours.accent : station.colour ?? colours.ink;
    const drawOne = (shape, place, heading, alpha) => {
      useMesh(gl, this.programs, camera, place, {colour: [...colour, alpha], faint: 0.22, behind, heading: radians(heading), section: null});
      shape.triangles();
    };
    const draw = (place, heading, alpha) => { // a tripod doesn't turn with its head
      drawOne(this.#shape(null), place, heading, alpha);
      if (tripod) drawOne(this.#shape(tripod), place, tripod.legs_heading_deg, alpha);
    };
    draw(at, heading_deg, station.suggested ? 0.45 : station.served === false ? 0.65 : 1);
    if (ghost) draw([station.x_m, station.y_m, station.z_m], station.heading_deg, 0.3);
  }
}
