/* SPDX-License-Identifier: MIT */
// This module makes meshes as arrays: the coarse scene from its bytes, its edges, and the shapes of a station. The
// module is pure.

import {cross, dot, sub, unit} from './view_camera.js';

const MAGIC = 0x43534853; // "SHSC"

// Returns {origin, positions, triangles} of the bytes of /scene. Throws an Error that says what is wrong with the
// bytes.
export function parseScene(buffer) {
  const view = ArrayBuffer.isView(buffer) ? new DataView(buffer.buffer, buffer.byteOffset, buffer.byteLength) : new DataView(buffer);
  if (view.byteLength < 40) throw new Error(`scene of ${view.byteLength} bytes: its header has 40`);
  if (view.getUint32(0, true) !== MAGIC) throw new Error('scene: does not begin with SHSC');
  if (view.getUint32(4, true) !== 1) throw new Error(`scene of version ${view.getUint32(4, true)}: 1 is known`);
  const nVertices = view.getUint32(8, true), nTriangles = view.getUint32(12, true);
  const need = 40 + 12 * nVertices + 12 * nTriangles;
  if (view.byteLength !== need) throw new Error(`scene of ${view.byteLength} bytes: ${need} expected`);
  const bytes = view.buffer.slice(view.byteOffset + 40, view.byteOffset + need);
  const triangles = new Uint32Array(bytes, 12 * nVertices, 3 * nTriangles);
  if (triangles.some((v) => v >= nVertices)) throw new Error(`scene: a triangle beyond its ${nVertices} vertices`);
  return {origin: [16, 24, 32].map((at) => view.getFloat64(at, true)), positions: new Float32Array(bytes, 0, 3 * nVertices), triangles};
}

// Returns edges where the planes of faces meet at more than `least` radians, and borders, as pairs of vertices, the
// longest first. Faces that are folded onto each other lie in one plane, so their edge is none.
export function featureEdges(positions, triangles, least = 0.6) {
  const same = new Map(); // vertices at the same place are one
  const id = new Uint32Array(positions.length / 3);
  for (let v = 0; v < id.length; v++) {
    const key = [0, 1, 2].map((a) => Math.round(1000 * positions[3 * v + a])).join();
    if (!same.has(key)) same.set(key, v);
    id[v] = same.get(key);
  }
  const flat = Math.cos(least);
  const edges = new Map();
  for (let t = 0; t < triangles.length; t += 3) {
    const v = [0, 1, 2].map((k) => triangles[t + k]);
    const p = v.map((i) => positions.subarray(3 * i, 3 * i + 3));
    const faces = unit(cross(sub(p[1], p[0]), sub(p[2], p[0])));
    if (faces.some(Number.isNaN)) continue; // it has no area
    for (let k = 0; k < 3; k++) {
      const a = id[v[k]], b = id[v[(k + 1) % 3]];
      if (a === b) continue;
      const key = Math.min(a, b) * id.length + Math.max(a, b);
      const edge = edges.get(key);
      if (edge === undefined) edges.set(key, {a, b, faces, n: 1, sharp: false});
      else {
        edge.n++;
        edge.sharp ||= Math.abs(dot(faces, edge.faces)) < flat;
      }
    }
  }
  const found = [...edges.values()].filter((e) => e.n === 1 || e.sharp);
  for (const e of found) e.length = Math.hypot(...[0, 1, 2].map((i) => positions[3 * e.a + i] - positions[3 * e.b + i]));
  return Uint32Array.from(found.sort((e, f) => f.length - e.length).flatMap((e) => [e.a, e.b]));
}

// Adds a rod of `sides` faces from a to b.
function rod(mesh, a, b, ra, rb = ra, sides = 8) {
  const n = unit(sub(b, a));
  const e = unit(Math.abs(n[2]) < 0.9 ? [n[1], -n[0], 0] : [0, n[2], -n[1]]), f = cross(n, e);
  const first = mesh.positions.length / 3;
  for (let s = 0; s < sides; s++) {
    const c = Math.cos(2 * Math.PI * s / sides), si = Math.sin(2 * Math.PI * s / sides);
    for (const [p, r] of [[a, ra], [b, rb]]) mesh.positions.push(...[0, 1, 2].map((i) => p[i] + r * (c * e[i] + si * f[i])));
  }
  mesh.positions.push(...a, ...b);
  for (let s = 0; s < sides; s++) {
    const p = first + 2 * s, q = first + 2 * ((s + 1) % sides);
    mesh.triangles.push(p, q, p + 1, p + 1, q, q + 1, first + 2 * sides, q, p, first + 2 * sides + 1, p + 1, q + 1);
  }
}

// Makes a station with its head's origin at 0, heading north: a body, its mirror's window, a mark to the front.
export function stationMesh() {
  const mesh = {positions: [], triangles: []};
  rod(mesh, [0, 0, -0.22], [0, 0, -0.1], 0.1, 0.1, 12);
  rod(mesh, [-0.075, 0, -0.1], [-0.075, 0, 0.16], 0.05, 0.045);
  rod(mesh, [0.075, 0, -0.1], [0.075, 0, 0.16], 0.05, 0.045);
  rod(mesh, [-0.05, 0, 0], [0.05, 0, 0], 0.035, 0.035, 10);
  rod(mesh, [0, 0.08, -0.16], [0, 0.42, -0.16], 0.018);
  rod(mesh, [0, 0.42, -0.16], [0, 0.58, -0.16], 0.055, 0.001);
  return packed(mesh);
}

// Returns the depth of a tripod's feet below the head's origin; without a tripod that of the body's lower end.
export const feetBelow = (tripod) => (tripod ?
  tripod.head_above_m + Math.sqrt(Math.max(0, tripod.leg_m ** 2 - tripod.foot_radius_m ** 2)) : 0.22);

// Makes the legs of a tripod, with the head's origin at 0 and the first leg towards north.
export function legsMesh(tripod) {
  const mesh = {positions: [], triangles: []};
  const r = tripod.foot_radius_m;
  for (let k = 0; k < 3; k++) {
    const angle = k * 2 * Math.PI / 3;
    const out = [Math.sin(angle), Math.cos(angle)];
    rod(mesh, [0, 0, -tripod.head_above_m], [r * out[0], r * out[1], -feetBelow(tripod)], 0.024, 0.014, 6);
  }
  return packed(mesh);
}

const packed = (mesh) => ({positions: Float32Array.from(mesh.positions), triangles: Uint32Array.from(mesh.triangles)});
