/* SPDX-License-Identifier: MIT */
// This panel shows the figures of the point under the pointer. The panel lies over the picture, and only while there is
// a point, so that nothing else moves.
import {byId, fixed, grouped, make, metres, say, NONE} from './page.js';

const CELLS = [['place', 'x, y, z', 'wide'], ['deviation', 'Deviation'], ['range', 'Range'], ['reflectance', 'Reflectance'],
  ['amplitude', 'Amplitude'], ['echo', 'Echo'], ['surface', 'Surface', 'wide'], ['station', 'Station'], ['time', 'Time'],
  ['pulse', 'Pulse'], ['rgb', 'Colour']];

const withUnit = (value, digits, unit) => (Number.isFinite(value) ? `${fixed(value, digits)}\u00a0${unit}` : NONE);

export class Point {
  #cells = {};
  #names;
  #next = null;
  #timer = 0;
  #isAsked = false;
  t0_s = 0; // times count from this

  constructor(view, names, rename = {}) {
    this.#names = names;
    const list = make('dl');
    for (const [key, name, kind] of CELLS) {
      const cell = make('dd', {}, NONE);
      const row = make('div', {class: kind}, make('dt', {}, rename[key] ?? name), cell);
      this.#cells[key] = {row, cell};
      list.append(row);
    }
    byId('point').append(list);
    view?.addEventListener('pick', ({detail}) => {
      this.#next = detail?.point ?? null;
      this.#isAsked ||= detail?.isAsked ?? false;
      if (this.#isAsked) say(byId('point-says'), ''); // a screen reader doesn't read a text that stays as it was
      this.#timer ||= setTimeout(() => this.#show(), 60);
    });
  }

  // A figure that the point does not have takes no room.
  #show() {
    this.#timer = 0;
    const p = this.#next;
    byId('point').hidden = p === null;
    const texts = p === null ? {} : this.#texts(p);
    for (const [key, text] of Object.entries(texts)) {
      const {row, cell} = this.#cells[key];
      say(cell, text);
      row.hidden = text === NONE;
    }
    if (this.#isAsked) this.#speak(texts);
    this.#isAsked = false;
  }

  // A screen reader reads a point that a key has asked for. It doesn't read points that the pointer passes over.
  #speak({place, range, surface}) {
    say(byId('point-says'), place === undefined ? 'No point in the middle of the picture'
      : [`x, y, z: ${place}`, range !== NONE && `range ${range}`, surface !== NONE && surface].filter(Boolean).join('; '));
  }

  #texts(p) {
    return {
      place: Number.isFinite(p.x) ? `${[p.x, p.y, p.z].map((v) => fixed(v, 3)).join(' ')}\u00a0m` : NONE,
      deviation: metres(p.deviation_m), range: withUnit(p.range, 3, 'm'),
      reflectance: withUnit(p.reflectance, 1, 'dB'), amplitude: withUnit(p.amplitude, 1, 'dB'),
      echo: p.echo ? `${p.echo} of ${p.echoes}` : NONE,
      surface: p.label === undefined || p.label === 0xffff ? NONE : this.#names('label', p.label) ?? String(p.label),
      station: p.station === undefined ? NONE : this.#names('station', p.station) ?? String(p.station),
      time: withUnit(p.t + this.t0_s, 3, 's'),
      pulse: p.pulse === undefined ? NONE : grouped(p.pulse),
      rgb: p.rgb?.length === 3 ? Array.from(p.rgb).join(' ') : NONE,
    };
  }
}
