/* SPDX-License-Identifier: MIT */
// This panel shows the point under the pointer, in figures. Its area stays also without a point, so nothing jumps.
import {byId, grouped, make, say, NONE} from './page.js';

const CELLS = [['place', 'x, y, z', 'wide'], ['range', 'Range'], ['reflectance', 'Reflectance'],
  ['amplitude', 'Amplitude'], ['echo', 'Echo'], ['surface', 'Surface', 'wide'], ['station', 'Station'], ['time', 'Time'],
  ['pulse', 'Pulse'], ['rgb', 'Colour']];

const fixed = (value, digits, unit) => (Number.isFinite(value) ? `${value.toFixed(digits).replace('-', '−')}\u00a0${unit}` : NONE);

export class Point {
  #cells = {};
  #names;
  #next = null;
  #timer = 0;
  t0_s = 0; // times count from this

  constructor(view, names, rename = {}) {
    this.#names = names;
    const list = make('dl');
    for (const [key, name, kind] of CELLS) {
      this.#cells[key] = make('dd', {}, NONE);
      list.append(make('div', {class: kind}, make('dt', {}, rename[key] ?? name), this.#cells[key]));
    }
    byId('point').append(list);
    view?.addEventListener('pick', ({detail}) => {
      this.#next = detail?.point ?? null;
      this.#timer ||= setTimeout(() => this.#show(), 60);
    });
  }

  #show() {
    this.#timer = 0;
    const p = this.#next ?? {};
    const texts = {
      place: Number.isFinite(p.x) ? `${[p.x, p.y, p.z].map((v) => fixed(v, 3, '')).join(' ')} m` : NONE, range: fixed(p.range, 4, 'm'),
      reflectance: fixed(p.reflectance, 2, 'dB'), amplitude: fixed(p.amplitude, 2, 'dB'),
      echo: p.echo ? `${p.echo} of ${p.echoes}` : NONE,
      surface: p.label === undefined || p.label === 0xffff ? NONE : this.#names('label', p.label) ?? String(p.label),
      station: p.station === undefined ? NONE : this.#names('station', p.station) ?? String(p.station),
      time: fixed(p.t + this.t0_s, 6, 's'),
      pulse: p.pulse === undefined ? NONE : grouped(p.pulse),
      rgb: p.rgb?.length === 3 ? Array.from(p.rgb).join(' ') : NONE,
    };
    for (const [key, text] of Object.entries(texts)) say(this.#cells[key], text);
  }
}
