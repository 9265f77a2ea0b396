/* SPDX-License-Identifier: MIT */
// This module has the parts that are drawn into the stored picture (view_draw.js): blocks of points with their buffers
// on the GPU, and meshes.

import {MODES, GREY, tableOf, valuesOf} from './view_colours.js';
import {tableTexture} from './view_gl.js';
import {isOutside} from './cloud.js';

const STRIDE_MOST = 21; // every 21st point at most: a point has 12 bytes, and the largest stride is 255

// This is one block of a cloud: positions, and one number a point for the colour mode.
class BlockPart {
  weight = 1;
  drawn = 0;
  skip = false;
  #held = 0; // so many of its positions are on the GPU
  #timed = 0; // so many of its times
  #valued = 0; // so many of its numbers, those of #mode
  #mode = null;
  #closed = false;
  #capacity = 0;

  constructor(points, block) {
    this.points = points;
    this.block = block;
    const {gl} = points;
    this.vertices = gl.createVertexArray();
    this.position = gl.createBuffer();
    this.value = gl.createBuffer();
  }

  // Shows only points of the cloud's time window. The times of points go to the GPU only when a window is set.
  #times(stride) {
    const {gl, cloud: {window}} = this.points, {block} = this;
    if (window === null) {
      gl.disableVertexAttribArray(3);
      return;
    }
    this.time ??= gl.createBuffer();
    gl.bindBuffer(gl.ARRAY_BUFFER, this.time);
    if (this.#timed === 0) gl.bufferData(gl.ARRAY_BUFFER, 4 * this.#capacity, gl.STATIC_DRAW);
    if (this.#timed < block.n) {
      gl.bufferSubData(gl.ARRAY_BUFFER, 4 * this.#timed, block.t, this.#timed, block.n - this.#timed);
      this.#timed = block.n;
    }
    gl.enableVertexAttribArray(3);
    gl.vertexAttribPointer(3, 1, gl.FLOAT, false, 4 * stride, 0);
    gl.uniform2f(this.points.program.u_times, Math.max(-1e38, window.from - block.began_s), Math.min(1e38, window.to - block.began_s));
  }

  get n() { return this.block.n; }
  get whole() { return !this.block.closed; }

  #layout(stride) {
    const {gl} = this.points;
    gl.bindVertexArray(this.vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.position);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 12 * stride, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.value);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribPointer(1, 1, gl.FLOAT, false, 4 * stride, 0);
    gl.enableVertexAttribArray(2);
    gl.vertexAttribPointer(2, 4, gl.UNSIGNED_BYTE, true, 4 * stride, 0);
  }

  #upload() {
    const {gl, mode} = this.points;
    const {block} = this;
    if (block.closed && !this.#closed) { // its points are in another order now
      this.#closed = true;
      this.#capacity = this.#held = this.#valued = this.#timed = 0;
    }
    if (this.#mode !== mode) this.#valued = 0;
    this.#mode = mode;
    if (this.#capacity === 0) {
      this.#capacity = block.closed ? block.n : block.position.length / 3;
      for (const [buffer, size] of [[this.position, 12], [this.value, 4]]) {
        gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
        gl.bufferData(gl.ARRAY_BUFFER, size * this.#capacity, gl.STATIC_DRAW);
      }
      this.#layout(1);
    }
    if (this.#held < block.n) {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.position);
      gl.bufferSubData(gl.ARRAY_BUFFER, 12 * this.#held, block.position, 3 * this.#held, 3 * (block.n - this.#held));
      this.#held = block.n;
    }
    if (this.#valued < block.n) {
      gl.bindBuffer(gl.ARRAY_BUFFER, this.value);
      gl.bufferSubData(gl.ARRAY_BUFFER, 4 * this.#valued, valuesOf(block, mode, this.#valued, block.n));
      this.#valued = block.n;
    }
  }

  draw(from, to) {
    const {gl} = this.points;
    this.points.use();
    this.#upload();
    // The block that is still filled is in the order of the scan, so every k-th point is drawn.
    const k = !this.block.closed && from === 0 ? Math.min(STRIDE_MOST, Math.floor(this.n / to)) : 1;
    if (k > 1) {
      this.#layout(k);
      this.#times(k);
      gl.drawArrays(gl.POINTS, 0, Math.floor(this.n / k));
      this.#layout(1);
      this.thinned = true;
    } else {
      gl.bindVertexArray(this.vertices);
      this.#times(1);
      gl.drawArrays(gl.POINTS, from, to - from);
    }
  }

  // After the block was closed, or every k-th point was drawn, `drawn` does not say which points are in the picture.
  settle() {
    if (this.thinned || (this.block.closed && !this.#closed && this.drawn > 0 && this.drawn < this.n)) this.drawn = 0;
    this.thinned = false;
  }

  free() {
    const {gl} = this.points;
    gl.deleteVertexArray(this.vertices);
    gl.deleteBuffer(this.position);
    gl.deleteBuffer(this.value);
    if (this.time) gl.deleteBuffer(this.time);
  }
}

// This class has the cloud's blocks as parts.
export class Points {
  parts = [];
  mode = 'height';
  limits = [0, 1];
  size = 2; // pixels
  scale = 1; // it is the ratio of the target's pixels to those of the page
  #using = null; // it is the program
  #table = null;
  #known = new Map();

  constructor(gl, programs, cloud) {
    Object.assign(this, {gl, programs, cloud});
  }

  setMode(mode, scale) {
    this.mode = mode;
    if (this.#table) this.gl.deleteTexture(this.#table);
    this.#table = tableTexture(this.gl, tableOf(mode, scale));
  }

  // Takes over the blocks of the cloud. Returns true if drawn blocks are gone.
  follow() {
    let gone = false;
    const {blocks} = this.cloud;
    if (this.parts.some((part, i) => part.block !== blocks[i])) {
      const held = new Set(blocks);
      for (const [block, part] of this.#known) {
        if (held.has(block)) continue;
        gone ||= part.drawn > 0;
        part.free();
        this.#known.delete(block);
      }
      this.parts = this.parts.filter((part) => held.has(part.block));
    }
    for (let i = this.parts.length; i < blocks.length; i++) {
      const part = new BlockPart(this, blocks[i]);
      this.#known.set(blocks[i], part);
      this.parts.push(part);
    }
    for (const part of this.parts) part.settle();
    return gone;
  }

  // Takes the camera before each step; parts out of sight are left out.
  aim(camera) {
    this.camera = camera;
    this.#using = null;
    const {origin, window} = this.cloud, {section} = camera;
    for (const part of this.parts) {
      const {lo, hi} = part.block;
      part.skip = !camera.sees(lo, hi, origin) || (section !== null && !section.meets(lo, hi, origin)) || isOutside(window, part.block);
    }
  }

  use() {
    const {gl, camera} = this;
    if (this.#using && gl.getParameter(gl.CURRENT_PROGRAM) === this.#using.program) return;
    const program = this.program = this.#using = this.programs.use('points', camera, this.cloud.origin);
    gl.uniform1i(program.u_kind, ['ramp', 'list', 'rgb'].indexOf(MODES[this.mode].kind));
    gl.uniform2f(program.u_limits, this.limits[0], 1 / Math.max(1e-30, this.limits[1] - this.limits[0]));
    gl.uniform2f(program.u_times, -1e38, 1e38);
    gl.uniform3fv(program.u_grey, GREY.map((c) => c / 255));
    const size = Math.max(1, this.size * this.scale);
    gl.uniform1f(program.u_size, size);
    gl.uniform1f(program.u_size_most, 2.5 * size + 1);
    gl.uniform1f(program.u_near_w, 0.35 * camera.distance);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.#table);
    gl.uniform1i(program.u_table, 0);
  }
}

// Makes the mesh program current. The program's uniforms have the defaults that are listed here. With `section: null`,
// the camera's section does not cut the mesh.
export function useMesh(gl, programs, camera, origin, {colour, edge = 0, push = 1, faint = 1, flat = false, behind = null,
  shift = [0, 0, 0], heading = 0, section}) {
  const program = programs.use('mesh', camera, origin, section);
  gl.uniform3fv(program.u_shift, shift);
  gl.uniform2f(program.u_turn, Math.cos(heading), Math.sin(heading));
  gl.uniform4fv(program.u_colour, colour);
  gl.uniform1f(program.u_edge, edge);
  gl.uniform1f(program.u_push, push);
  gl.uniform1f(program.u_faint, faint);
  gl.uniform1i(program.u_flat, flat ? 1 : 0);
  gl.uniform1i(program.u_tests, behind ? 1 : 0);
  gl.activeTexture(gl.TEXTURE1);
  gl.bindTexture(gl.TEXTURE_2D, behind);
  gl.uniform1i(program.u_behind, 1);
  gl.activeTexture(gl.TEXTURE0);
}

// This is a mesh on the GPU: {origin (scene frame), positions Float32 relative to origin, triangles Uint32, lines
// Uint32 or none}
export class Mesh {
  weight = 2;
  drawn = 0;
  skip = false;
  n = 0; // so many triangles are drawn, from the first on

  constructor(gl, programs, {origin, positions, triangles, lines = null, drawTriangles = null}) {
    Object.assign(this, {gl, programs, origin});
    this.all = Math.floor(triangles.length / 3);
    this.n = Math.min(this.all, drawTriangles ?? this.all);
    this.buffers = [];
    this.faces = this.#array(positions, triangles);
    this.edges = lines && this.#array(null, lines);
    this.nLines = lines?.length ?? 0;
  }

  #array(positions, indices) {
    const {gl} = this;
    const array = gl.createVertexArray();
    gl.bindVertexArray(array);
    if (positions) {
      this.vertices = gl.createBuffer();
      this.buffers.push(this.vertices);
      gl.bindBuffer(gl.ARRAY_BUFFER, this.vertices);
      gl.bufferData(gl.ARRAY_BUFFER, positions, gl.STATIC_DRAW);
    } else gl.bindBuffer(gl.ARRAY_BUFFER, this.vertices);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 12, 0);
    const elements = gl.createBuffer();
    this.buffers.push(elements);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, elements);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, indices, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
    return array;
  }

  // Draws some triangles into the stored picture; `look` and `camera` are set before.
  draw(from, to) {
    useMesh(this.gl, this.programs, this.camera, this.origin, this.look);
    this.triangles(from, to);
  }

  triangles(from = 0, to = this.n) {
    this.gl.bindVertexArray(this.faces);
    this.gl.drawElements(this.gl.TRIANGLES, 3 * (to - from), this.gl.UNSIGNED_INT, 12 * from);
  }

  // Draws at most so many, from the first on.
  lines(most = Infinity) {
    if (this.nLines === 0) return;
    this.gl.bindVertexArray(this.edges);
    this.gl.drawElements(this.gl.LINES, Math.min(this.nLines, 2 * most), this.gl.UNSIGNED_INT, 0);
  }

  free() {
    for (const buffer of this.buffers) this.gl.deleteBuffer(buffer);
    this.gl.deleteVertexArray(this.faces);
    if (this.edges) this.gl.deleteVertexArray(this.edges);
  }
}
