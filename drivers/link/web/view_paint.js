/* SPDX-License-Identifier: MIT */
// This module paints the surface by how many stations see each of its cells. A face is painted on the side that faces
// the stations, and left out from behind, so that one looks into a house through its roof and its near walls.

import {CUT, DEPTH, FACING, HEAD, PLACE, texture} from './view_gl.js';

const WIDE = 1024; // cells in a row of the texture

// These colours differ for people who are blind to red or green, and by lightness alone (Okabe and Ito 2002).
export const SEEN_COLOURS = [[213, 94, 0], [240, 228, 66], [0, 158, 115]];

const CELLS = {
  vertex: `${HEAD}${DEPTH}${PLACE}
layout(location = 0) in vec3 a_position;
layout(location = 1) in uint a_cell;
uniform sampler2D u_counts;
uniform vec3 u_colours[3];
out vec3 v_seen;
#ifdef CUT
out vec3 v_place;
#endif
flat out vec4 v_colour; // alpha 0: seen by none
void main() {
  v_seen = seen(a_position);
#ifdef CUT
  v_place = a_position;
#endif
  gl_Position = placed_face(v_seen);
  int n = int(texelFetch(u_counts, ivec2(a_cell % ${WIDE}u, a_cell / ${WIDE}u), 0).r * 255.0 + 0.5);
  v_colour = vec4(u_colours[min(n, 2)], n == 0 ? 0.0 : 1.0);
}`,
  fragment: `${HEAD}${DEPTH}${CUT}${FACING}
in vec3 v_seen;
#ifdef CUT
in vec3 v_place;
#endif
flat in vec4 v_colour;
uniform bool u_turned;
out vec4 colour;
void main() {
#ifdef CUT
  if (is_cut(v_place)) discard;
#endif
  gl_FragDepth = depth_of(v_seen.z, 1.001);
  if (gl_FrontFacing == u_turned) discard;
  // Every other pixel of a cell that nobody sees is drawn.
  bool odd = ((int(gl_FragCoord.x) ^ int(gl_FragCoord.y)) & 1) == 1;
  if (v_colour.a == 0.0 && odd) discard;
  colour = vec4(v_colour.rgb * (0.6 + 0.4 * facing_of(v_seen, normal_of(v_seen))), 1.0);
}`,
};

// This is a part of the stored picture (view_draw.js). cells is as parseCells() in previews.js returns it.
export class CellsPart {
  weight = 2;
  drawn = 0;
  skip = false;
  n = 0; // triangles
  #counts = null;

  constructor(gl, programs, cells) {
    Object.assign(this, {gl, programs});
    programs.add('cells', CELLS);
    this.origin = cells.origin;
    this.all = cells.n;
    this.cell = cells.cell;
    this.vertices = gl.createVertexArray();
    gl.bindVertexArray(this.vertices);
    this.buffers = [cells.corners, cells.cell.reduce((to, cell, i) => to.fill(cell, 4 * i, 4 * i + 4), new Uint32Array(4 * cells.pieces))]
      .map((data) => {
        const buffer = gl.createBuffer();
        gl.bindBuffer(gl.ARRAY_BUFFER, buffer);
        gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
        return buffer;
      });
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[0]);
    gl.enableVertexAttribArray(0);
    gl.vertexAttribPointer(0, 3, gl.FLOAT, false, 12, 0);
    gl.bindBuffer(gl.ARRAY_BUFFER, this.buffers[1]);
    gl.enableVertexAttribArray(1);
    gl.vertexAttribIPointer(1, 1, gl.UNSIGNED_INT, 4, 0);
    this.buffers.push(gl.createBuffer());
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, this.buffers[2]);
    gl.bindVertexArray(null);
  }

  // Chooses the pieces to draw: those of cells for which isDrawn(cell) holds. All would cost too much: without a GPU
  // each triangle costs as much as two points.
  #choose(isDrawn) {
    const {gl, cell} = this;
    const corners = new Uint32Array(6 * cell.length);
    let n = 0;
    for (let i = 0; i < cell.length; i++) {
      if (!isDrawn(cell[i])) continue;
      for (const k of [0, 1, 2, 0, 2, 3]) corners[n++] = 4 * i + k;
    }
    gl.bindVertexArray(this.vertices);
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners.subarray(0, n), gl.DYNAMIC_DRAW);
    gl.bindVertexArray(null);
    this.n = n / 3;
  }

  // counts has the number of stations that see each cell. isTurned: the stations see the backs of the faces.
  // showsUnseen(cell) says whether a cell that no station sees is painted; without showsUnseen no such cell is.
  show({counts, isTurned, showsUnseen}) {
    const {gl} = this;
    this.isTurned = isTurned;
    this.#choose((cell) => counts[cell] > 0 || (showsUnseen && showsUnseen(cell)));
    const rows = Math.max(1, Math.ceil(this.all / WIDE));
    const texels = new Uint8Array(WIDE * rows);
    texels.set(counts);
    gl.deleteTexture(this.#counts);
    this.#counts = texture(gl, gl.R8, gl.RED, gl.UNSIGNED_BYTE, WIDE, rows, texels);
  }

  draw(from, to) {
    const {gl} = this, program = this.programs.use('cells', this.camera, this.origin);
    gl.uniform3fv(program['u_colours[0]'], SEEN_COLOURS.flat().map((c) => c / 255));
    gl.uniform1i(program.u_turned, this.isTurned ? 1 : 0);
    gl.activeTexture(gl.TEXTURE0);
    gl.bindTexture(gl.TEXTURE_2D, this.#counts);
    gl.uniform1i(program.u_counts, 0);
    gl.bindVertexArray(this.vertices);
    gl.drawElements(gl.TRIANGLES, 3 * (to - from), gl.UNSIGNED_INT, 12 * from);
    gl.bindVertexArray(null);
  }

  free() {
    const {gl} = this;
    for (const buffer of this.buffers) gl.deleteBuffer(buffer);
    gl.deleteVertexArray(this.vertices);
    gl.deleteTexture(this.#counts);
  }
}
