/* SPDX-License-Identifier: MIT */
// The overlay has the scale bar, axes with north, stations' names and handles, and the point under the pointer. The
// overlay is a 2D canvas over the picture, so that lines and letters are sharp; each has an edge in the ground's
// colour.

import {fixed} from './page.js';
import {degrees, roundBelow} from './view_camera.js';
import {inScene} from './view_stations.js';

const FONT = '12px system-ui, "Segoe UI", Roboto, "Noto Sans", "DejaVu Sans", sans-serif';
const FIELD = '#1f77b4'; // monitored fields, as in a map
const AXES = [['x', [1, 0, 0], '#e0524d'], ['N', [0, 1, 0], '#4aa651'], ['z', [0, 0, 1], '#4a83e0']];

// "20 mm", "5 m", "2 km"
function lengthText(m) {
  const round = (v) => String(Number(v.toPrecision(6)));
  return m >= 1000 ? `${round(m / 1000)} km` : m >= 1 ? `${round(m)} m` : m >= 0.01 ? `${round(m * 100)} cm` : `${round(m * 1000)} mm`;
}

// Returns the bar at the target's distance: {px, m}, at most `most` pixels.
function scaleBar(camera, most = 150) {
  const m = roundBelow(most * camera.distance / camera.focal);
  return {m, px: m * camera.focal / camera.distance};
}

export class Overlay {
  targets = []; // {at, name, isSeen: by two stations or more}
  constructor(canvas) {
    this.canvas = document.createElement('canvas');
    this.canvas.setAttribute('aria-hidden', 'true');
    this.canvas.style.cssText = 'position:absolute;pointer-events:none';
    canvas.after(this.canvas);
    this.over = canvas;
    this.context = this.canvas.getContext('2d');
    this.layers = new Set(); // tools draw here: layer(pen, camera)
    this.pen = {line: (...all) => this.#line(...all), text: (...all) => this.#text(...all), dot: (...all) => this.#dot(...all)};
  }

  resize(width, height, ratio) {
    const {over, canvas} = this;
    canvas.style.left = `${over.offsetLeft}px`;
    canvas.style.top = `${over.offsetTop}px`;
    canvas.style.width = `${width}px`;
    canvas.style.height = `${height}px`;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    this.ratio = ratio;
  }

  // Takes {camera, colours: {ground, ink, accent}, stations (or null), marked: point or null}.
  draw({camera, colours, stations, marked}) {
    const c = this.context;
    c.setTransform(this.ratio, 0, 0, this.ratio, 0, 0);
    c.clearRect(0, 0, camera.width, camera.height);
    c.font = FONT;
    c.lineJoin = c.lineCap = 'round';
    this.colours = colours;
    if (stations) this.#stations(camera, stations);
    this.pen.colours = colours;
    for (const layer of this.layers) layer(this.pen, camera);
    for (const target of this.targets) this.#target(camera, target);
    if (marked) this.#mark(camera, marked);
    if (camera.inside) this.#looking(camera);
    else this.#scale(camera);
    this.#axes(camera);
  }

  #line(points, width, colour, dash = []) {
    const c = this.context;
    c.beginPath();
    points.forEach(([x, y], i) => (i === 0 ? c.moveTo(x, y) : c.lineTo(x, y)));
    for (const [w, s, d] of [[width + 2.5, this.colours.ground, []], [width, colour, dash]]) {
      c.lineWidth = w;
      c.strokeStyle = s;
      c.globalAlpha = s === colour ? 1 : 0.6;
      c.setLineDash(d);
      c.stroke();
    }
    c.setLineDash([]);
    c.globalAlpha = 1;
  }

  #text(text, x, y, {align = 'center', colour = this.colours.ink, bold = false, inside = 0} = {}) {
    const c = this.context;
    c.font = bold ? `600 ${FONT}` : FONT;
    c.textAlign = align;
    c.textBaseline = 'middle';
    c.lineWidth = 3.5;
    c.strokeStyle = this.colours.ground;
    if (inside) { // a name at the picture's edge is moved, not cut
      const half = 0.5 * c.measureText(text).width + 4;
      if (x > -half && x < inside + half) x = Math.max(half, Math.min(inside - half, x));
    }
    c.strokeText(text, x, y);
    c.fillStyle = colour;
    c.fillText(text, x, y);
  }

  #scale(camera) {
    const {m, px} = scaleBar(camera, Math.min(150, 0.3 * camera.width));
    const x = 16, y = camera.height - 18;
    this.#line([[x, y - 5], [x, y], [x + px, y], [x + px, y - 5]], 1.5, this.colours.ink);
    this.#text(lengthText(m), x + px / 2, y - 10);
  }

  #looking(camera) {
    const deg = (rad) => (rad * 180 / Math.PI);
    this.#text(`${degrees(camera.azimuth).toFixed(0)}° · ${fixed(deg(camera.elevation), 0)}° · field ${deg(camera.fov).toFixed(0)}°`, 16,
      camera.height - 18, {align: 'left'});
  }

  #axes(camera) {
    const x = camera.width - 44, y = camera.height - 44, r = 27;
    const axes = camera.rotation;
    const ends = AXES.map(([name, v, colour]) => {
      const [right, up, forward] = axes.map((a) => a[0] * v[0] + a[1] * v[1] + a[2] * v[2]);
      return {name, colour, right, up, forward};
    }).sort((a, b) => b.forward - a.forward);
    for (const {name, colour, right, up} of ends) {
      this.#line([[x, y], [x + r * right, y - r * up]], 2, colour);
      const away = Math.hypot(right, up) < 0.25 ? 0 : 11 / Math.hypot(right, up);
      this.#text(name, x + r * right + away * right, y - r * up - away * up, {colour, bold: true, inside: camera.width});
    }
  }

  // Draws the outline of a monitored field, as far as it lies before the eye.
  #field(camera, stations, station, {outline_m}) {
    const ends = inScene(stations.placeOf(station), station, outline_m).map((at) => camera.project(at));
    let run = [];
    const show = () => {
      if (run.length > 1) this.#line(run, 1.5, FIELD);
      run = [];
    };
    for (const {x, y, w} of [...ends, ...ends.slice(0, 1)]) {
      if (w > 0.05) run.push([x, y]);
      else show();
    }
    show();
  }

  #stations(camera, stations) {
    for (const station of stations.list) {
      if (station.served !== false) for (const field of stations.fields) this.#field(camera, stations, station, field);
      if (station.hides_m > 0) this.#hidden(camera, stations.placeOf(station).at, station);
      const ring = stations.ring(camera, station);
      if (ring === null) continue;
      const head = camera.project(ring.at);
      const selected = station.number === stations.selected;
      if (selected) this.#ring(camera, ring);
      const {x, y} = head;
      const high = Math.max(12, 0.35 * camera.focal / head.w + 9);
      this.#text(station.name || `Station ${station.number}`, x, y - high, {bold: true, inside: camera.width,
        colour: selected ? this.colours.accent : this.colours.ink});
      if (4 > 0.16 * camera.focal / head.w) this.#dot(x, y, 4, selected ? this.colours.accent : this.colours.ink);
      const {moved} = stations;
      if (moved?.number === station.number) this.#moving(camera, station, moved, head, stations.pending);
    }
  }

  #ring(camera, ring) {
    const points = [];
    for (let k = 0; k <= 72; k++) {
      const p = camera.project(ring.place(k * Math.PI / 36));
      if (p.w <= 0.01) return;
      points.push([p.x, p.y]);
    }
    this.#line(points, 1.5, this.colours.accent);
    const from = camera.project(ring.at), to = camera.project(ring.handle);
    this.#line([[from.x, from.y], [to.x, to.y]], 1.5, this.colours.accent);
    this.#dot(to.x, to.y, 7, this.colours.accent);
  }

  // Draws what the tripod hides on the ground around it.
  #hidden(camera, at, {hides_m, above_m}) {
    const points = Array.from({length: 49}, (_, k) => camera.project([at[0] + hides_m * Math.sin(k * Math.PI / 24),
      at[1] + hides_m * Math.cos(k * Math.PI / 24), at[2] - above_m]));
    if (points.every(({w}) => w > 0.01)) this.#line(points.map(({x, y}) => [x, y]), 1.25, this.colours.ink, [3, 5]);
  }

  // Draws a diamond, filled if two scans have the target in common.
  #target(camera, {at, name, isSeen}) {
    const {x, y, w} = camera.project(at);
    if (w <= 0.05) return;
    const c = this.context, mark = [[x, y - 7], [x + 7, y], [x, y + 7], [x - 7, y]];
    this.#line([...mark, mark[0]], 1.75, this.colours.accent);
    if (isSeen) {
      c.fillStyle = this.colours.accent;
      c.fill();
    }
    this.#text(name, x + 12, y, {align: 'left', bold: true, colour: this.colours.accent});
  }

  #dot(x, y, r, colour) {
    const c = this.context;
    c.beginPath();
    c.arc(x, y, r, 0, 2 * Math.PI);
    c.fillStyle = colour;
    c.fill();
    c.lineWidth = 2;
    c.strokeStyle = this.colours.ground;
    c.stroke();
  }

  // Shows the begin and end of a move, and its length.
  #moving(camera, station, moved, head, pending) {
    const from = camera.project([station.x_m, station.y_m, station.z_m]);
    const d = [moved.x - station.x_m, moved.y - station.y_m, moved.z - station.z_m];
    if (from.w > 0 && Math.hypot(...d) > 1e-3) this.#line([[from.x, from.y], [head.x, head.y]], 1.5, this.colours.accent, [5, 5]);
    const show = (v) => fixed(v, 2);
    const turned = ((moved.heading_deg - station.heading_deg + 540) % 360) - 180;
    const lines = [`x ${show(moved.x)}  y ${show(moved.y)}  z ${show(moved.z)} m`, `${Math.hypot(...d).toFixed(2)} m from where it was`];
    if (Math.abs(turned) > 0.005) lines[1] = `heading ${moved.heading_deg.toFixed(1)}° (${turned > 0 ? '+' : '−'}${Math.abs(turned).toFixed(1)}°)`;
    if (pending) lines[1] = 'asking the head …';
    lines.forEach((text, i) => this.#text(text, head.x, head.y + 22 + 16 * i));
  }

  #mark(camera, point) {
    const p = camera.project([point.x, point.y, point.z]);
    if (p.w <= 0) return;
    const c = this.context;
    for (const [width, colour] of [[4, this.colours.ground], [1.75, this.colours.accent]]) {
      c.beginPath();
      c.arc(p.x, p.y, 7, 0, 2 * Math.PI);
      c.lineWidth = width;
      c.strokeStyle = colour;
      c.stroke();
    }
  }
}
