/* SPDX-License-Identifier: MIT */
// The targets of a trial are places on surfaces, such as a mark on a wall, by which scans are put together later. A
// target is seen by a station that sees its cell of the surface. Two scans need three targets that both see.

import {make, say} from './page.js';
import {hasBit} from './previews.js';
import {cross, dot} from './view_camera.js';
import {searchSlowly} from './view_pick.js';

const NEEDED = 3;

// Returns the cell that a place lies on: the cell of the nearest piece of the surface (/cells). The distance to a piece
// is the distance to its middle plus ten times the distance to its plane. null: no piece is near.
export function cellAt(cells, [x, y, z]) {
  const {corners, origin, cell, pieces, cell_m} = cells;
  const p = [x - origin[0], y - origin[1], z - origin[2]];
  let best = null, least = 2.5 * cell_m;
  for (let i = 0; i < pieces; i++) {
    const at = 12 * i, d = [0, 0, 0];
    for (let a = 0; a < 3; a++) d[a] = p[a] - 0.25 * (corners[at + a] + corners[at + 3 + a] + corners[at + 6 + a] + corners[at + 9 + a]);
    const far = Math.hypot(...d);
    if (far >= least) continue;
    const [u, v] = [0, 1].map((k) => [0, 1, 2].map((a) => corners[at + 3 * (k + 1) + a] - corners[at + a]));
    const n = cross(u, v), off = Math.abs(dot(n, d)) / (Math.hypot(...n) || 1);
    if (far + 10 * off >= least) continue;
    least = far + 10 * off;
    best = cell[i];
  }
  return best;
}

// Returns the numbers of the stations that see a cell.
export const seenBy = (stations, cell) => stations.filter((s) => s.seen && hasBit(s.seen, cell)).map((s) => s.number);

// Returns [a, b, n] for each pair of stations a and b; both see n targets. sights: the stations that see each target.
export function pairsOf(stations, sights) {
  return stations.flatMap((a, i) => stations.slice(i + 1).map((b) =>
    [a.number, b.number, sights.filter((s) => s.includes(a.number) && s.includes(b.number)).length]));
}

export class TargetList {
  element = make('div', {class: 'targets'});
  #view;
  #trial = null;
  #targets = []; // {number, at, cell}
  #list = make('ul');
  #says = make('p', {class: 'note', role: 'status', id: 'trial-targets'});
  #put = make('button', {type: 'button', id: 'trial-target', 'aria-pressed': 'false', click: () => this.#arm(!this.#armed),
    title: 'Then click a point of the picture, or press Enter in it for the point in its middle'}, 'Put a target');
  #armed = false;

  constructor(view) {
    this.#view = view;
    this.element.append(make('div', {class: 'actions'}, this.#put), this.#list, this.#says);
  }

  // Until a target is put, this list takes clicks and the keys below, even if a tool is open.
  tap({x, y}) {
    this.#at(x, y);
    return true;
  }

  key({key}) {
    const {width, height} = this.#view.camera;
    if (key === 'Enter') this.#at(width / 2, height / 2);
    else if (key === 'Escape') this.#arm(false);
    else return false;
    return true;
  }

  // From now on targets belong to this trial; null: there is none any more.
  begin(trial) {
    this.#trial = trial;
    this.#targets = [];
    this.#arm(false);
    this.#list.replaceChildren();
    if (trial) this.show();
    else this.#view.overlay.targets = [];
  }

  #arm(on) {
    this.#armed = on;
    if (this.#view) this.#view.once = on ? this : null;
    this.#put.setAttribute('aria-pressed', String(on));
    if (this.#trial) this.show();
  }

  #at(x, y) {
    const {cloud, camera} = this.#view, trial = this.#trial;
    searchSlowly(cloud, camera, x, y, 16, (found) => {
      if (trial !== this.#trial || !trial?.cells || !this.#armed) return; // a second click came before the first was found
      const at = found && camera.at(x, y, found.w), cell = at && cellAt(trial.cells, at);
      this.#arm(false);
      if (cell === null) return say(this.#says, 'There is no surface at that place.');
      this.#targets.push({number: 1 + (this.#targets.at(-1)?.number ?? 0), at, cell});
      this.#relist();
    });
  }

  #relist() {
    this.#list.replaceChildren(...this.#targets.map((target) => {
      target.says = make('span');
      return make('li', {}, target.says, make('button', {type: 'button', class: 'quiet', 'aria-label': `Remove target ${target.number}`,
        click: () => {
          this.#targets = this.#targets.filter((other) => other !== target);
          this.#relist();
          this.#put.focus();
        }}, 'Remove'));
    }));
    this.show();
  }

  // Shows which stations see the targets now.
  show() {
    const {stations} = this.#trial;
    const sights = this.#targets.map(({cell}) => seenBy(stations, cell));
    this.#targets.forEach(({number, says}, i) => say(says, `T${number}: ${sights[i].length > 0 ? `seen by ${sights[i].join(', ')}` : 'seen by none'}`));
    this.#view.overlay.targets = this.#targets.map(({number, at}, i) => ({at, name: `T${number}`, isSeen: sights[i].length > 1}));
    this.#view.select(this.#view.stations.selected); // the marks are drawn again
    const pairs = pairsOf(stations, sights), enough = pairs.filter(([, , n]) => n >= NEEDED).map(([a, b]) => `${a} and ${b}`);
    say(this.#says, this.#armed ? 'Click a point of the picture; Esc leaves it.'
      : this.#targets.length === 0 ? `Two scans are put together by ${NEEDED} targets that both see.`
        : enough.length > 0 ? `Enough for ${enough.join('; ')}.` : `No two stations have ${NEEDED} targets in common.`);
  }
}
