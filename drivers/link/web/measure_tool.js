/* SPDX-License-Identifier: MIT */
// This tool measures between points that are picked in the picture or the panorama. A click takes the point nearest to
// it; with keys, Enter takes the point in the middle of the picture.
import {grouped, make, markField, numberOf, say} from './page.js';
import {csvOf, figureText, flatnessOf, KINDS, largestOf, placeOf, pointsOnFace, spacingAround, withError} from './measure.js';
import {download} from './picture.js';
import {runSlowly} from './view_pick.js';

const PICK_PX = 12;
const NAMES = ['first', 'second', 'third'];

export class MeasureTool {
  id = 'measure';
  name = 'Measure';
  title = 'Measure';
  done = []; // each is {kind, name, points, rows, figures}
  #view;
  #names;
  #expected;
  #kind = 'distance';
  #picked = [];
  #kinds = new Map();
  #stop = null;
  #says = make('p', {class: 'note', role: 'status'});
  #depth = make('input', {type: 'text', inputmode: 'decimal', id: 'measure-depth', value: '0.05'});
  #list = make('ol', {class: 'measured'});
  #edges = make('p', {class: 'note', id: 'measure-edges'}, '± is the error of the points, not the distance from a point to an edge. Click faces, not edges.');
  #table = make('div', {class: 'picked', tabindex: 0, role: 'region', 'aria-label': 'Picked points'});
  #layer = (pen, camera) => this.#draw(pen, camera);

  // expected.ask() asks the head for the expected errors of its points. expected.of(station) returns those of a
  // station, or null.
  constructor(view, names, expected) {
    this.#view = view;
    this.#names = names;
    this.#expected = expected;
    const kinds = Object.entries(KINDS).map(([kind, {title}]) => {
      const button = make('button', {type: 'button', id: `measure-${kind}`, click: () => this.#choose(kind)}, title);
      this.#kinds.set(kind, button);
      return button;
    });
    const action = (id, name, title, click) => make('button', {type: 'button', id, title, click}, name);
    this.buttons = {
      end: action('measure-end', 'End outline', 'A click on the first corner, or Enter on the last one, does the same', () => this.#endOutline()),
      undo: action('measure-undo', 'Undo', 'Takes the last point back (key Backspace)', () => this.#undo()),
      clear: action('measure-clear', 'Clear', 'Removes all measurements', () => this.#clear()),
      csv: action('measure-csv', 'Points as CSV', 'Downloads the table of the picked points', () =>
        download(new Blob([this.csv], {type: 'text/csv'}), 'points.csv')),
    };
    this.depthRow = make('div', {class: 'row'}, make('label', {for: 'measure-depth'}, 'Depth to each side'), this.#depth, make('span', {class: 'unit'}, 'm'));
    this.body = make('div', {}, make('div', {class: 'kinds', role: 'group', 'aria-label': 'Kind of measurement'}, ...kinds), this.depthRow,
      this.#says, this.#list, this.#edges, make('div', {class: 'actions'}, ...Object.values(this.buttons)), this.#table);
    this.#choose('distance');
  }

  start() {
    this.#expected.ask();
    this.#view.tool = this;
    this.#view.overlay.layers.add(this.#layer);
    this.#show();
  }

  stop() {
    this.#stop?.();
    this.#view.tool = null;
    this.#picked = [];
    this.#view.overlay.layers.delete(this.#layer);
    this.#view.pointed.at(null);
    this.#show();
  }

  // ---- picking

  // The view calls tap() for a click on the picture, and key() for a key.
  tap(p) {
    this.#expected.ask(); // a newer scan may have other errors
    this.#stop?.();
    if (this.#kind === 'flatness' && this.#picked.length >= 3 && this.#isAt(this.#picked[0], p)) {
      this.#endOutline();
      return true;
    }
    this.#stop = this.#view.pointed.find(p, PICK_PX, (point) => {
      this.#stop = null;
      if (point === null) say(this.#says, 'There is no point within 12 pixels of the click.');
      else this.pick(point);
    });
    return true;
  }

  key({key}) {
    const {width, height} = this.#view.camera;
    const middle = {x: 0.5 * width, y: 0.5 * height};
    const isLast = this.#kind === 'flatness' && this.#picked.length >= 3 && this.#isAt(this.#picked.at(-1), middle);
    if (key === 'Enter' && isLast) this.#endOutline();
    else if (key === 'Enter' || key === ' ') this.tap(middle);
    else if (key === 'Backspace') this.#undo();
    else if (key === 'Escape') this.leave();
    else return false;
    return true;
  }

  // A click on the first corner ends an outline, and so does Enter on the last one.
  #isAt(point, {x, y}) {
    const p = this.#view.camera.project(placeOf(point));
    return Math.hypot(p.x - x, p.y - y) < PICK_PX;
  }

  // point: as pointOf() returns it
  pick(point) {
    const station = this.#view.stations.get(point.station);
    const surface = point.label === 0xffff ? '' : this.#names('label', point.label) ?? String(point.label);
    const full = Object.assign(withError(point, station, this.#expected.of(point.station)), {surface, spacing: NaN});
    this.#picked.push(full);
    const {points} = KINDS[this.#kind];
    runSlowly(spacingAround(this.#view.cloud, placeOf(point), 0.002 * (point.range || 5)), (spacing) => {
      full.spacing = spacing;
      this.#show();
    });
    if (points > 0 && this.#picked.length === points) this.#finish(this.#kind, this.#picked.splice(0));
    this.#show();
  }

  #finish(kind, points, rest = {}) {
    const number = this.done.filter((m) => m.kind === kind).length + 1;
    const of = `${KINDS[kind].title.toLowerCase()} ${number}`;
    points.forEach((p, i) => Object.assign(p, {of, number: i + 1}));
    this.done.push({kind, of, points, figures: KINDS[kind].figures?.(points) ?? [], ...rest});
  }

  #endOutline() {
    const depth_m = numberOf(this.#depth.value);
    if (this.#picked.length < 3) return say(this.#says, 'An outline has at least three corners.');
    markField(this.#depth, depth_m > 0 && depth_m <= 10);
    if (!(depth_m > 0 && depth_m <= 10)) return say(this.#says, 'Refused: the depth is a number from above 0 to 10 m.');
    const corners = this.#picked.splice(0), {cloud, camera} = this.#view;
    say(this.#says, 'Looking through the points.');
    return runSlowly(pointsOnFace(cloud, camera, corners, depth_m), ({places, beyond}) => {
      const station = this.#view.stations.get(corners[0].station);
      const eye = station ? [station.x_m, station.y_m, station.z_m] : camera.eye;
      const flat = flatnessOf(places, corners, cloud.origin, eye);
      if (flat === null) {
        if (this.#kind === 'flatness' && this.#picked.length === 0 && this.#view.tool === this) this.#picked = corners;
        this.#show();
        return say(this.#says, 'There are fewer than four points in this outline, at that depth.');
      }
      this.#finish('flatness', corners, {flat, beyond, depth_m});
      return this.#show();
    });
  }

  #undo() {
    if (this.#picked.length > 0) this.#picked.pop();
    else this.done.pop();
    this.#show();
  }

  #clear() {
    this.#picked = [];
    this.done = [];
    this.#show();
  }

  // ---- showing

  #choose(kind) {
    this.#kind = kind;
    this.#picked = [];
    for (const [name, button] of this.#kinds) button.setAttribute('aria-pressed', String(name === kind));
    this.#show();
  }

  get points() { return [...this.done.flatMap((m) => m.points), ...this.#picked.map((p, i) => ({...p, of: '', number: i + 1}))]; }
  get csv() { return csvOf(this.points); }

  #show() {
    const isOutline = this.#kind === 'flatness', n = this.#picked.length, {points} = this;
    this.depthRow.hidden = this.buttons.end.hidden = !isOutline;
    this.buttons.end.disabled = n < 3;
    this.buttons.undo.disabled = this.buttons.clear.disabled = this.buttons.csv.disabled = points.length === 0;
    const last = n === 0 ? this.done.at(-1) : null;
    say(this.#says, (last ? `${this.#rowsOf(last)[0].slice(0, 2).join(' ')}. ` : '') + (isOutline ? `Click the corners of a face, then end the outline: ${n} so far.`
      : `Click the ${NAMES[n]} point${this.#kind === 'angle' && n === 1 ? ', the angle’s corner' : ''}. Enter takes the point in the middle.`));
    this.#list.replaceChildren(...this.done.map((m) => make('li', {}, make('h3', {}, m.of), this.#figuresOf(m))));
    this.#edges.hidden = !this.done.some((m) => m.kind === 'distance' || m.kind === 'height');
    this.#showTable(points);
    this.#view.redraw();
  }

  #rowsOf(m) {
    const rows = m.flat ? flatRows(m) : m.figures.map(([name, unit, figure]) => [name, figureText(unit, figure)]);
    const spacing = Math.max(...m.points.map((p) => p.spacing));
    const isKnown = m.flat ? m.flat.sigma > 0 : Number.isFinite(m.figures[0][2].error);
    if (!isKnown) rows.push(['Expected error', 'not known']);
    if (!m.flat && Number.isFinite(spacing)) rows.push(['Mean spacing', millimetres(spacing),
      'The real edge may lie further out than the picked point, by up to the distance between scan lines, which may be several times this figure']);
    return rows;
  }

  #figuresOf(m) {
    return make('dl', {class: 'figures'}, ...this.#rowsOf(m).map(([name, text, title]) => make('div', {title}, make('dt', {}, name), make('dd', {}, text))));
  }

  #showTable(points) {
    const cells = (tag, all) => make('tr', {}, ...all.map((text) => make(tag, tag === 'th' ? {scope: 'col'} : {}, text)));
    this.#table.hidden = points.length === 0;
    this.#table.replaceChildren(make('table', {}, make('thead', {}, cells('th', ['Of', 'x, m', 'y, m', 'z, m', 'Surface'])),
      make('tbody', {}, ...points.map((p) => cells('td', [p.of ? `${p.of},\u00a0${p.number}` : String(p.number),
        ...[p.x, p.y, p.z].map((v) => grouped(v, 3)), p.surface])))));
  }

  // ---- the picture

  #draw(pen, camera) {
    const hover = this.#view.pointed.point;
    for (const m of this.done) this.#path(pen, camera, m.points, m);
    if (this.#picked.length > 0) this.#path(pen, camera, hover ? [...this.#picked, hover] : this.#picked, null);
    if (this.#view.canvas.matches(':focus-visible')) this.#cross(pen, camera);
  }

  #path(pen, camera, points, m) {
    const seen = points.map((p) => camera.project(placeOf(p))), {accent} = pen.colours;
    const isClosed = m?.flat || (m === null && this.#kind === 'flatness' && points.length > 2);
    const before = (p) => p.w > 0.01;
    for (let i = 1; i < seen.length + (isClosed ? 1 : 0); i++) {
      const [a, b] = [seen[i - 1], seen[i % seen.length]];
      if (before(a) && before(b)) pen.line([[a.x, a.y], [b.x, b.y]], 1.5, accent, m ? [] : [5, 5]);
    }
    seen.filter(before).forEach(({x, y}) => pen.dot(x, y, 3.5, accent));
    if (m === null || !seen.every(before)) return;
    const at = m.flat ? camera.project(m.flat.at) : m.kind === 'angle' ? seen[1] :
      {x: 0.5 * (seen[0].x + seen[1].x), y: 0.5 * (seen[0].y + seen[1].y)};
    if (m.flat) pen.dot(at.x, at.y, 5, pen.colours.ink);
    pen.text(m.flat ? `largest ${millimetres(m.flat.largest)}` : figureText(m.figures[0][1], m.figures[0][2]),
      at.x, at.y - 14, {bold: true, inside: camera.width});
  }

  #cross(pen, {width, height}) {
    const [x, y] = [0.5 * width, 0.5 * height];
    for (const [dx, dy] of [[1, 0], [0, 1]]) {
      pen.line([[x - 12 * dx, y - 12 * dy], [x - 4 * dx, y - 4 * dy]], 1.5, pen.colours.ink);
      pen.line([[x + 4 * dx, y + 4 * dy], [x + 12 * dx, y + 12 * dy]], 1.5, pen.colours.ink);
    }
  }
}

// Writes a length in millimetres, with two significant digits.
const millimetres = (v) => `${Number((1e3 * v).toPrecision(2))}\u00a0mm`.replace('-', '−');

// Returns the rows of a flatness figure. Each figure is shown with the one that noise alone would give.
function flatRows({flat, beyond, depth_m}) {
  const {n, rms, largest, sigma} = flat, isKnown = sigma > 0;
  const beside = (v, expected) => (isKnown ? `${millimetres(v)}; noise gives ${millimetres(expected)}` : millimetres(v));
  const rows = [['RMS', beside(rms, sigma)], ['Largest', beside(largest, sigma * largestOf(n)), 'More than 0 is towards the head'],
    ['Points', grouped(n)]];
  if (beyond > 0) rows.push(['Left out', `${grouped(beyond)} beyond ${depth_m}\u00a0m`, `Points up to ${4 * depth_m} m from the plane; points further away are ignored`]);
  return rows;
}
