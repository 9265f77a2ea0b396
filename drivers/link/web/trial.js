/* SPDX-License-Identifier: MIT */
// A trial has stations that stand, in this page alone, where its user wants to try them. Each has the points of a
// coarse scan from there, and the cells of the surface that it sees. The head computes these and stays as it is, so a
// trial needs no control.

import {ask, batchOf, countSeen, parseCells, parsePreview, parseReach, pathOf} from './previews.js';

// Points are shown with the angular step of the station. The cells that the station sees are found with these finer
// steps: the first at once, the second once the station rests. Surfaces at grazing incidence need the second.
const COVER_STEPS_DEG = [0.5, 0.25];
const REST_MS = 300; // a station must rest for this time before the second step
const COVER_MS = 500; // while a station is dragged, its cells are asked for at most once in this time
const MOST_STATIONS = 16; // so many stations may be in a request for a suggestion
const MOST_RENEWED = 3; // how often in a row all stations are asked for again, where the head has dropped their answers

// These are settings of a station that a preview takes; null: as at power-up.
export const SETTINGS = ['step_deg', 'far_m', 'line0_deg', 'line1_deg', 'pan0_deg', 'pan1_deg'];
const PLACE = ['x_m', 'y_m', 'z_m', 'heading_deg', 'pitch_deg', 'roll_deg'];

const pick = (from, keys) => Object.fromEntries(keys.map((key) => [key, from[key]]));
const round = (value) => (typeof value === 'number' ? Math.round(value * 1e4) / 1e4 : value);
const turned = (deg) => ((deg + 180) % 360 + 360) % 360 - 180;

// A Trial sends `change` whenever something is to be shown again, and `seen` once what the stations see has changed.
export class Trial extends EventTarget {
  stations = [];
  cells = null; // null: not there yet, or there are none
  isBlind = false; // true: the head gave no cells, so only points are shown; `error` says why
  reach = null; // the cells that can be seen from anywhere; null: not known yet
  sum = null;   // it has counts, none_m2, one_m2, several_m2, hidden_m2 of all stations
  step_deg; // of stations without a step of their own
  error = ''; // it says why there are no cells
  nextError = ''; // it says why there is no suggestion
  section = null; // only what is in it counts for a suggestion
  next = null;  // the suggestion: {x_m, y_m, z_m, heading_deg, gain_m2, none_m2}
  #cloud;
  #scans = 0;
  #ended = new AbortController();
  #asksReach = false;
  #renewed = 0; // how often the stations were asked for again, for one suggestion

  // cloud gets the points; list has the stations as /head has them.
  constructor(cloud, list, step_deg = 2) {
    super();
    this.#cloud = cloud;
    this.step_deg = step_deg;
    for (const s of list) this.#enter({...s, of: s.number, was: pick(s, PLACE), isAdded: false});
    this.#learnCells();
  }

  #enter(station) {
    Object.assign(station, {served: true, seen: null, answer: 0, covered_ms: -Infinity, wanted: 0, shown: 0, isBusy: false, points: 0, error: '',
      ...Object.fromEntries(SETTINGS.map((key) => [key, station[key] ?? null]))});
    this.stations.push(station);
    this.renew(station);
    return station;
  }

  async #learnCells() {
    try {
      this.cells = parseCells(await ask('/cells', this.#ended.signal));
    } catch (error) {
      if (!this.#on) return;
      this.isBlind = true;
      this.error = error.message;
    }
    if (this.#on) this.#count();
  }

  // Nothing is asked for any more, and nothing changes.
  end() { this.#ended.abort(); }

  get #on() { return !this.#ended.signal.aborted; }

  get(number) { return this.stations.find((s) => s.number === number); }

  get isBusy() { return this.stations.some((s) => s.isBusy); }

  // Moves a station, or changes its settings: values has some of PLACE and SETTINGS.
  change(number, values) {
    const station = this.get(number);
    if (!station) return;
    Object.assign(station, values, 'heading_deg' in values ? {heading_deg: turned(values.heading_deg)} : {});
    this.renew(station);
  }

  // Adds a station like another one at a place.
  add(place, like = this.stations[0]) {
    const number = Math.max(0, ...this.stations.map((s) => s.number)) + 1;
    const {of, tripod} = like;
    return this.#enter({...pick({...like, ...place}, [...PLACE, ...SETTINGS]), number, of, tripod, name: '',
      isAdded: true, was: null}).number;
  }

  remove(number) {
    this.stations = this.stations.filter((s) => s.number !== number);
    this.#cloud.replace({station: number, scan: ++this.#scans});
    this.next = null;
    this.#count();
  }

  setStep(deg) {
    this.step_deg = deg;
    for (const station of this.stations) this.renew(station);
  }

  #tell(type) { this.dispatchEvent(new Event(type)); }

  // Gets the points, then the cells, for the present place of the station. A station has only one request under way:
  // while it is dragged, each answer is followed by the request for its newest place.
  async renew(station) {
    station.wanted++;
    this.next = null;
    this.#tell('change');
    if (station.isBusy) return;
    station.isBusy = true;
    for (let asked = 0; asked !== station.wanted && this.#has(station);) {
      asked = station.wanted;
      await this.#look(station, asked);
    }
    station.isBusy = false;
    if (this.#has(station)) this.#count();
  }

  #has(station) { return this.#on && this.stations.includes(station); }

  async #ask(station, more) {
    const settings = pick(station, SETTINGS);
    const place = Object.fromEntries(PLACE.map((key) => [key, round(station[key])]));
    return parsePreview(await ask(pathOf('preview', {station: station.of, ...place, ...settings, ...more}), this.#ended.signal));
  }

  // Asks for the points and cells of the station as it is after `asked` changes. station.wanted counts its changes.
  async #look(station, asked) {
    try {
      const shown = await this.#ask(station, {step_deg: station.step_deg ?? this.step_deg});
      if (!this.#has(station)) return;
      this.#take(station, shown, asked);
    } catch (error) {
      if (!this.#has(station)) return;
      Object.assign(station, {seen: null, points: 0, error: error.message});
      this.#cloud.replace({station: station.number, scan: ++this.#scans}); // its points are from another place
      return;
    }
    for (const step_deg of COVER_STEPS_DEG) {
      const isFirst = step_deg === COVER_STEPS_DEG[0];
      if (this.isBlind) return;
      if (!isFirst) await new Promise((done) => setTimeout(done, REST_MS));
      const isDue = isFirst && performance.now() - station.covered_ms > COVER_MS;
      if ((asked !== station.wanted && !isDue) || !this.#has(station)) return;
      try {
        const {seen, number, hits, front} = await this.#ask(station, {step_deg, points: 0});
        Object.assign(station, {seen, answer: number, hits, front, error: '', covered_ms: performance.now()});
      } catch (error) {
        if (isFirst) station.error = error.message;
        return; // so fine a scan may have more pulses than the head computes for a page
      }
      if (this.#has(station)) this.#count();
    }
  }

  #take(station, shown, asked) {
    const scan = ++this.#scans;
    const {above_m, hides_m, feet_m, n} = shown;
    Object.assign(station, {above_m, hides_m, points: n, shown: asked, error: ''});
    if (station.tripod) station.tripod = {...station.tripod, foot_radius_m: feet_m};
    this.#cloud.replace({station: station.number, scan});
    this.#cloud.add(batchOf(shown, station.number, scan));
    this.#tell('change');
  }

  #count() {
    const seen = this.stations.filter((s) => s.seen);
    if (this.cells) this.sum = countSeen(this.cells, seen.map((s) => s.seen), this.reach);
    if (seen.length > 0 && this.cells && !this.isBusy) this.#learnReach();
    this.#tell('seen');
    this.#tell('change');
  }

  // Asks once which cells can be seen at all.
  async #learnReach() {
    if (this.#asksReach) return;
    this.#asksReach = true;
    try {
      this.reach = parseReach(await ask(this.#about('reach'), this.#ended.signal));
      if (this.#on) this.#count();
    } catch { /* shares are then shares of all surfaces */ }
  }

  // Returns the path of a request about the cells that the stations see.
  #about(name) {
    const like = this.stations[0], seen = this.stations.filter((s) => s.seen).slice(0, MOST_STATIONS);
    const height_m = like.above_m > 0 ? round(like.above_m) : null;
    return pathOf(name, {station: like.of, height_m, ...Object.fromEntries(seen.map((s, i) => [`p${i + 1}`, s.answer])),
      ...(name === 'next' ? this.#box() : {})});
  }

  // Returns the section as a request has it.
  #box() {
    if (!this.section) return {};
    const {middle, limits, heading_deg} = this.section;
    return Object.fromEntries(['x', 'y', 'z'].flatMap((axis, a) => [[`middle_${axis}_m`, round(middle[a])], [`half_${axis}_m`, round(limits[a])]])
      .concat([['turn_deg', turned(round(heading_deg))]]));
  }

  // Returns whether the stations see mostly the backs of faces. The mesh then has its faces turned the other way.
  get seesBacks() {
    const all = this.stations.filter((s) => s.seen);
    return all.length > 0 && 2 * all.reduce((sum, s) => sum + s.front, 0) < all.reduce((sum, s) => sum + s.hits, 0);
  }

  // Asks where one more station would add most; the result is in `next`.
  async suggest() {
    if (this.stations.length === 0 || this.isBusy) return undefined;
    const all = this.stations.filter((s) => s.seen), before = this.#stamp();
    if (all.length > MOST_STATIONS) {
      this.nextError = `The head can suggest a place only for up to ${MOST_STATIONS} stations; there are ${all.length}.`;
      return this.#tell('change');
    }
    try {
      const found = JSON.parse(new TextDecoder().decode(await ask(this.#about('next'), this.#ended.signal)));
      if (!this.#on || before !== this.#stamp()) return undefined; // something has moved meanwhile
      this.next = found.place ? {...found.place, pitch_deg: 0, roll_deg: 0, gain_m2: found.gain_m2, none_m2: found.none_m2} : null;
      this.nextError = found.place ? '' : found.places ? 'No place would add anything.' : 'All places see mostly the backs of faces.';
      this.#renewed = 0;
    } catch (error) {
      if (!this.#on || before !== this.#stamp()) return undefined;
      const isGone = error.status === 400 && /is kept no more/.test(error.message) && this.#renewed++ < MOST_RENEWED;
      this.nextError = isGone ? 'Places are looked at again.' : error.message;
      if (isGone) all.forEach((s) => this.renew(s));
      else this.#renewed = 0;
    }
    return this.#tell('change');
  }

  #stamp() { return JSON.stringify([this.stations.map((s) => [s.number, s.wanted]), this.#box()]); }

  // Returns the stations as a configuration has them.
  get text() {
    const lines = this.stations.map((s) => {
      const tilt = ['pitch_deg', 'roll_deg'].filter((key) => s[key]).map((key) => `, ${key}: ${round(s[key])}`).join('');
      const name = JSON.stringify(s.name || `station ${s.number}`);
      return `  - {name: ${name}, position_m: [${round(s.x_m)}, ${round(s.y_m)}, ${round(s.z_m)}], heading_deg: ${round(s.heading_deg)}${tilt}}`;
    });
    return `stations:\n${lines.join('\n')}\n`;
  }
}
