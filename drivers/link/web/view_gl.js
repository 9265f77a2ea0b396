/* SPDX-License-Identifier: MIT */
// This module has shaders, programs and targets of the picture in WebGL 2, but not their use.
//
// All positions are relative to an origin of their own; the eye relative to it comes as the sum of two floats. The
// depth (view_camera.js) is logarithmic in a perspective view, but not in a flat one. The target's texture has the
// depth; shading and hiding read it there.

import {FAR_M, FLAT_REACH, NEAR_M, split, sub} from './view_camera.js';

const OCTAVES = Math.log2(FAR_M / NEAR_M);

export const PLACE = `
uniform vec3 u_eye_hi, u_eye_lo;
uniform mat3 u_axes; // columns: right, up, forward
uniform vec2 u_lens; // clip units per slope, or per metre in a flat view
vec3 seen(vec3 p) { return ((p - u_eye_hi) - u_eye_lo) * u_axes; }
#ifdef FLAT
vec4 placed(vec3 s) { return vec4(s.xy * u_lens, 2.0 * depth_of(s.z, 1.0) - 1.0, 1.0); }
vec4 placed_face(vec3 s) { return vec4(s.xy * u_lens, 0.0, 1.0); } // depth is the fragment's
#else
vec4 placed(vec3 s) {
  return s.z <= NEAR ? OUT : vec4(s.xy * u_lens, (2.0 * depth_of(s.z, 1.0) - 1.0) * s.z, s.z);
}
vec4 placed_face(vec3 s) { return vec4(s.xy * u_lens, s.z - 2.0 * NEAR, s.z); }
#endif
`;

// These give the normal of a face, and the cosine between it and the line of sight, in a fragment of it.
export const FACING = `
vec3 normal_of(vec3 s) { return normalize(cross(dFdx(s), dFdy(s))); }
#ifdef FLAT
float facing_of(vec3 s, vec3 n) { return abs(n.z); }
#else
float facing_of(vec3 s, vec3 n) { return abs(dot(n, normalize(s))); }
#endif
`;

// These give the depth at a distance along the line of sight, pushed away by a factor, as view_camera.js does.
export const DEPTH = `
const float NEAR = ${NEAR_M};
const vec4 OUT = vec4(0.0, 0.0, 2.0, 1.0);
#ifdef FLAT
uniform float u_distance;
float depth_of(float w, float push) {
  float x = (w + (push - 2.0) * u_distance) / (${FLAT_REACH}.0 * u_distance);
  return 0.5 + 0.5 * x / (1.0 + abs(x));
}
#else
float depth_of(float w, float push) { return log2(max(w * push, NEAR) / NEAR) / ${OCTAVES}; }
#endif
`;

// A section (section.js) leaves out what is beyond it.
export const CUT = `
#ifdef CUT
uniform vec3 u_cut_middle, u_cut_half;
uniform vec2 u_cut_turn; // cos, sin of its heading
bool is_cut(vec3 p) {
  vec3 d = p - u_cut_middle;
  d.xy = vec2(u_cut_turn.x * d.x - u_cut_turn.y * d.y, u_cut_turn.y * d.x + u_cut_turn.x * d.y);
  return any(greaterThan(abs(d), u_cut_half));
}
#endif
`;

export const HEAD = `#version 300 es
precision highp float;
precision highp int;
`;

const POINTS = {
  vertex: `${HEAD}${DEPTH}${PLACE}${CUT}
layout(location = 0) in vec3 a_position;
layout(location = 1) in float a_value;
layout(location = 2) in vec4 a_rgb;
layout(location = 3) in float a_time;
uniform int u_kind; // 0 ramp, 1 list, 2 rgb
uniform vec2 u_limits; // lowest, 1 / (highest - lowest)
uniform vec2 u_times; // points of other times are not shown
uniform vec3 u_grey;
uniform float u_size, u_near_w, u_size_most;
uniform sampler2D u_table;
flat out vec3 v_colour;
void main() {
  vec3 s = seen(a_position);
  gl_Position = a_time < u_times.x || a_time > u_times.y ? OUT : placed(s);
#ifdef CUT
  if (is_cut(a_position)) gl_Position = OUT;
#endif
#ifdef FLAT
  gl_PointSize = u_size;
#else
  gl_PointSize = clamp(u_size * sqrt(u_near_w / max(s.z, NEAR)), u_size, u_size_most);
#endif
  if (u_kind == 2) v_colour = a_rgb.rgb;
  else if (a_value < -1e29) v_colour = u_grey;
  else if (u_kind == 1) v_colour = texelFetch(u_table, ivec2(int(a_value + 0.5) & 255, 0), 0).rgb;
  else v_colour = texelFetch(u_table, ivec2(int(clamp((a_value - u_limits.x) * u_limits.y, 0.0, 1.0) * 255.0 + 0.5), 0), 0).rgb;
}`,
  fragment: `${HEAD}
flat in vec3 v_colour;
out vec4 colour;
void main() { colour = vec4(v_colour, 1.0); }`,
};

// These draw triangles and lines. Hidden ones are left out, or faint, by the depth texture of the earlier drawing
// (u_behind).
const MESH = {
  vertex: `${HEAD}${DEPTH}${PLACE}
layout(location = 0) in vec3 a_position;
uniform vec3 u_shift;
uniform vec2 u_turn; // cos, sin of the heading
out vec3 v_seen;
#ifdef CUT
out vec3 v_place;
#endif
void main() {
  vec3 p = vec3(u_turn.x * a_position.x + u_turn.y * a_position.y, u_turn.x * a_position.y - u_turn.y * a_position.x, a_position.z);
  v_seen = seen(p + u_shift);
#ifdef CUT
  v_place = p + u_shift;
#endif
  gl_Position = placed_face(v_seen);
}`,
  fragment: `${HEAD}${DEPTH}${CUT}${FACING}
in vec3 v_seen;
#ifdef CUT
in vec3 v_place;
#endif
uniform vec4 u_colour;
uniform float u_edge;   // more alpha where seen at a grazing angle
uniform float u_push;   // > 1: a little behind, so that points on it stay visible
uniform float u_faint;  // alpha's factor where hidden
uniform bool u_flat, u_tests;
uniform sampler2D u_behind;
out vec4 colour;
void main() {
#ifdef CUT
  if (is_cut(v_place)) discard;
#endif
  float depth = depth_of(v_seen.z, u_push);
  gl_FragDepth = depth;
  float light = 1.0, alpha = u_colour.a;
  if (!u_flat) {
    vec3 n = normal_of(v_seen);
    float facing = facing_of(v_seen, n);
    light = 0.45 + 0.42 * facing + 0.13 * abs(n.y);
    alpha = min(1.0, alpha + u_edge * pow(1.0 - facing, 3.0));
  }
  if (u_tests && depth > texelFetch(u_behind, ivec2(gl_FragCoord.xy), 0).r + 1e-6) alpha *= u_faint;
  if (alpha <= 0.0) discard;
  colour = vec4(u_colour.rgb * light, alpha);
}`,
};

// Puts the picture onto the page. Empty pixels get the page's background (u_ground), and pixels beside nearer things
// become darker (eye-dome lighting, Boucheny 2009). With logarithmic depth the shading is the same at all scales.
const SHADE = {
  vertex: `${HEAD}
void main() { gl_Position = vec4(vec2(gl_VertexID & 1, gl_VertexID >> 1) * 4.0 - 1.0, 0.0, 1.0); }`,
  fragment: `${HEAD}
uniform sampler2D u_picture, u_depth;
uniform vec3 u_ground;
uniform float u_strength;
uniform int u_step;
out vec4 colour;
void main() {
  ivec2 at = ivec2(gl_FragCoord.xy);
  float d = texelFetch(u_depth, at, 0).r;
  vec3 c = d >= 1.0 ? u_ground : texelFetch(u_picture, at, 0).rgb;
  if (u_strength > 0.0) {
    ivec2 last = textureSize(u_depth, 0) - 1;
    vec4 n = vec4(texelFetch(u_depth, clamp(at + ivec2(u_step, 0), ivec2(0), last), 0).r,
                  texelFetch(u_depth, clamp(at - ivec2(u_step, 0), ivec2(0), last), 0).r,
                  texelFetch(u_depth, clamp(at + ivec2(0, u_step), ivec2(0), last), 0).r,
                  texelFetch(u_depth, clamp(at - ivec2(0, u_step), ivec2(0), last), 0).r);
    if (d < 1.0) {
      vec4 over = clamp(d - n - 2e-5, 0.0, 0.01);
      c *= max(0.35, exp(-u_strength * dot(over, vec4(1.0))));
    }
  }
  colour = vec4(c, 1.0);
}`,
};

function compile(gl, type, text) {
  const shader = gl.createShader(type);
  gl.shaderSource(shader, text);
  gl.compileShader(shader);
  return shader;
}

// Returns {program, <uniform's name>: location}.
export function link(gl, {vertex, fragment}) {
  const program = gl.createProgram();
  const shaders = [compile(gl, gl.VERTEX_SHADER, vertex), compile(gl, gl.FRAGMENT_SHADER, fragment)];
  for (const shader of shaders) gl.attachShader(program, shader);
  gl.linkProgram(program);
  if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
    throw new Error(`shader: ${gl.getProgramInfoLog(program)} ${shaders.map((s) => gl.getShaderInfoLog(s)).join(' ')}`);
  }
  const out = {program};
  const n = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS) ?? 0;
  for (let i = 0; i < n; i++) {
    const {name} = gl.getActiveUniform(program, i);
    out[name] = gl.getUniformLocation(program, name);
  }
  return out;
}

// These are the programs of a context. A flat view and a section have variants of their own, which are compiled when
// they are first needed; so a plain view costs nothing more.
export class Programs {
  #gl;
  #made = new Map();
  #sources = {points: POINTS, mesh: MESH};

  constructor(gl) {
    this.#gl = gl;
    this.shade = link(gl, SHADE);
    for (const kind of ['points', 'mesh']) this.#of(kind, []);
  }

  // Adds a kind of program, which is compiled when it is first used.
  add(kind, source) { this.#sources[kind] = source; }

  #of(kind, defines) {
    const key = [kind, ...defines].join();
    if (!this.#made.has(key)) {
      const words = defines.map((name) => `#define ${name}\n`).join('');
      const {vertex, fragment} = this.#sources[kind];
      this.#made.set(key, link(this.#gl, {vertex: vertex.replace('\n', `\n${words}`), fragment: fragment.replace('\n', `\n${words}`)}));
    }
    return this.#made.get(key);
  }

  // Makes a program of this kind current, and returns it. The program draws with this camera. Positions of the things
  // that it draws are relative to `origin`.
  use(kind, camera, origin, section = camera.section) {
    const gl = this.#gl;
    const program = this.#of(kind, [camera.flat && 'FLAT', section && 'CUT'].filter(Boolean));
    gl.useProgram(program.program);
    setPlace(gl, program, camera, origin);
    if (section) {
      const {middle, half, turn} = section.relativeTo(origin);
      gl.uniform3fv(program.u_cut_middle, middle);
      gl.uniform3fv(program.u_cut_half, half);
      gl.uniform2fv(program.u_cut_turn, turn);
    }
    return program;
  }
}

export function texture(gl, internal, format, type, width, height, data = null) {
  const t = gl.createTexture();
  gl.bindTexture(gl.TEXTURE_2D, t);
  gl.texImage2D(gl.TEXTURE_2D, 0, internal, width, height, 0, format, type, data);
  for (const name of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER]) gl.texParameteri(gl.TEXTURE_2D, name, gl.NEAREST);
  for (const name of [gl.TEXTURE_WRAP_S, gl.TEXTURE_WRAP_T]) gl.texParameteri(gl.TEXTURE_2D, name, gl.CLAMP_TO_EDGE);
  return t;
}

export const tableTexture = (gl, table) => texture(gl, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, 256, 1, table);

// This is a picture that is stored between frames, so that points can be added to it. scale is the ratio of its pixels
// to those of the page.
export class Target {
  constructor(gl, width, height, scale = 1) {
    this.gl = gl;
    this.scale = scale;
    this.width = width;
    this.height = height;
    this.colour = texture(gl, gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE, width, height);
    this.depth = texture(gl, gl.DEPTH_COMPONENT24, gl.DEPTH_COMPONENT, gl.UNSIGNED_INT, width, height);
    this.buffer = gl.createFramebuffer();
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.buffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.colour, 0);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.DEPTH_ATTACHMENT, gl.TEXTURE_2D, this.depth, 0);
  }

  bind() {
    const {gl} = this;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.buffer);
    gl.viewport(0, 0, this.width, this.height);
    gl.disable(gl.BLEND);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LESS);
  }

  clear() {
    const {gl} = this;
    gl.clearColor(0, 0, 0, 0);
    gl.clearDepth(1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
  }

  // Puts the picture onto the canvas, which is `width` by `height` pixels large.
  toPage(width, height) {
    const {gl} = this;
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, this.buffer);
    gl.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    gl.blitFramebuffer(0, 0, this.width, this.height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, this.scale === 1 ? gl.NEAREST : gl.LINEAR);
    gl.bindFramebuffer(gl.READ_FRAMEBUFFER, null);
  }

  free() {
    this.gl.deleteFramebuffer(this.buffer);
    this.gl.deleteTexture(this.colour);
    this.gl.deleteTexture(this.depth);
  }
}

// Draws a stored picture with its shading over the bound target. `empty` is a vertex array without attributes.
export function drawShaded(gl, shade, empty, {colour, depth}, {ground, strength, step}) {
  gl.clearDepth(1);
  gl.clear(gl.DEPTH_BUFFER_BIT);
  gl.disable(gl.DEPTH_TEST);
  gl.useProgram(shade.program);
  gl.bindVertexArray(empty);
  gl.activeTexture(gl.TEXTURE0);
  gl.bindTexture(gl.TEXTURE_2D, colour);
  gl.activeTexture(gl.TEXTURE1);
  gl.bindTexture(gl.TEXTURE_2D, depth);
  gl.uniform1i(shade.u_picture, 0);
  gl.uniform1i(shade.u_depth, 1);
  gl.uniform3fv(shade.u_ground, ground);
  gl.uniform1f(shade.u_strength, strength);
  gl.uniform1i(shade.u_step, step);
  gl.drawArrays(gl.TRIANGLES, 0, 3);
}

// Sets the uniforms by which a program places things; the eye relative to their origin is split.
function setPlace(gl, program, camera, origin) {
  const [right, up, forward] = camera.rotation;
  const eye = split(sub(camera.eye, origin));
  const k = 2 * camera.focal / (camera.flat ? camera.distance : 1);
  gl.uniform3fv(program.u_eye_hi, eye.hi);
  gl.uniform3fv(program.u_eye_lo, eye.lo);
  gl.uniformMatrix3fv(program.u_axes, false, [...right, ...up, ...forward]);
  gl.uniform2f(program.u_lens, k / camera.width, k / camera.height);
  if (camera.flat) gl.uniform1f(program.u_distance, camera.distance);
}
