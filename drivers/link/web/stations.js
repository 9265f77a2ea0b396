/* SPDX-License-Identifier: MIT */
// This panel shows the places of the stations. With control, and while the head is idle, they can be moved.
import {asSent, bodyOf, fetchJson, make, numberField, placeText, say} from './page.js';
import {why} from './session.js';

export const PARTS = [['x_m', 'East x', 'm'], ['y_m', 'North y', 'm'], ['z_m', 'Height z', 'm'],
  ['heading_deg', 'Heading', '°'], ['pitch_deg', 'Pitch', '°'], ['roll_deg', 'Roll', '°']];

const PLAN_TIMEOUT_S = 120; // a visibility map of a station may take long

// The head gives exact places; a field shows no more figures than the number has, and at most six decimals.
const shown = (value) => (value === null ? '' : String(Math.round(value * 1e6) / 1e6));

export class Stations extends EventTarget {
  list = [];
  trial = null; // while stations are tried, it has them in the picture: {moved(move), name(number)}
  #session;
  #knobs;
  #view;
  #items = new Map(); // it maps a number to {item, place, fields, says, time, buttons}
  #ol = make('ol', {class: 'stations'});
  #note = make('p', {class: 'note'});
  #asks = null; // it says whether the head has SITE:POSE

  constructor(session, knobs, view) {
    super();
    this.#session = session;
    this.#knobs = knobs;
    this.#view = view;
    bodyOf('stations').append(this.#note, this.#ol);
    session?.addEventListener('change', () => this.#allow());
    session?.head.addEventListener('close', () => {
      this.#asks = null;
    });
    session?.head.addEventListener('event', ({detail}) => detail.code === 12 && this.reload());
    knobs?.addEventListener('values', () => this.#allow());
    view?.addEventListener('move', ({detail}) => this.#moved(detail));
    this.#allow();
  }

  // list is as /head has it
  show(list) {
    const same = list.length === this.list.length && list.every((s, i) => s.number === this.list[i].number);
    this.list = list;
    if (!same) {
      this.#items.clear();
      this.#ol.replaceChildren(...list.map((station) => this.#make(station)));
    }
    for (const station of list) this.#fill(station);
    this.#place();
    this.#allow();
  }

  #place() {
    if (!this.trial) this.#view?.setStations(this.list.filter((s) => s.x_m !== null));
  }

  // From now on `trial` has the stations in the picture, where the user tries places. null: the trial is over.
  setTrial(trial) {
    this.trial = trial;
    this.#place();
    this.#allow();
  }

  // A head that can move stations reports their present places; for another head /head has them.
  async reload(list = null) {
    const stations = list ?? (await fetchJson('/head'))?.stations;
    if (!stations) return;
    this.#asks ??= / SITE:POSE/i.test(await this.#session.command('HELP?').catch(() => ''));
    if (!this.#asks) return this.show(stations);
    const places = await Promise.all(stations.map(({number}) => this.#session.command(`SITE:POSE? ${number}`).catch(() => '')));
    return this.show(stations.map((station, i) => {
      const numbers = places[i].split(',').map(Number);
      return numbers.length === PARTS.length ? {...station, ...Object.fromEntries(PARTS.map(([key], k) => [key, numbers[k]]))} : station;
    }));
  }

  name(number) {
    if (this.trial) return this.trial.name(number);
    const station = this.list.find((s) => s.number === number);
    return station?.name ? `${number} ${station.name}` : String(number);
  }

  #make(station) {
    const {number} = station;
    const fields = PARTS.map(([key, name, unit]) =>
      ({key, ...numberField(`station-${number}-${key}`, `${name}, ${unit}`, {input: () => this.#allow()})}));
    const button = (name, click, title) => make('button', {type: 'button', click, title}, name);
    const buttons = {
      move: make('button', {type: 'submit', class: 'main'}, 'Move'),
      back: button('As it was', () => this.#fill(this.#of(number), true), 'Writes the present place into the fields again'),
      home: button('Power-up place', () => this.#send(number, `${number}, DEF`)),
      use: button('Put the head here', () => this.#use(number), 'Its next scan is from here: press Start'),
      look: button('Look from here', () => this.#view?.lookFrom(number)),
    };
    buttons.look.hidden = !this.#view;
    const says = make('p', {class: 'note', role: 'status'}), time = make('p', {class: 'note'});
    const form = make('form', {submit: (event) => {
      event.preventDefault();
      this.#send(number, [number, ...fields.map(({field}) => asSent(field.value))].join(', '));
    }}, make('div', {class: 'place-fields'}, ...fields.map(({box}) => box)), says, time,
    make('div', {class: 'actions'}, ...(this.#session ? [buttons.move, buttons.back, buttons.home, buttons.use] : []), buttons.look));
    const place = make('span', {class: 'place'});
    const item = make('li', {}, make('details', {name: 'station'},
      make('summary', {}, make('span', {class: 'number'}, String(number)), make('span', {class: 'name'}, station.name ?? ''), place), form));
    this.#items.set(number, {item, place, fields, says, time, buttons, error: '', began: 0});
    return item;
  }

  #of(number) {
    return this.list.find((station) => station.number === number);
  }

  // Numbers that the user is typing stay, unless `anyway`.
  #fill(station, anyway = false) {
    const {place, fields, item} = this.#items.get(station.number);
    say(place, station.x_m === null ? 'not in the file' : placeText(station));
    for (const {key, field} of fields) {
      if (anyway || field.value === (field.dataset.holds ?? '')) field.value = shown(station[key]);
      field.dataset.holds = shown(station[key]);
    }
    item.classList.toggle('unserved', station.served === false);
    if (anyway) this.#items.get(station.number).error = '';
    this.#allow();
  }

  async #send(number, parameters) {
    const entry = this.#items.get(number);
    entry.error = '';
    entry.busy = true;
    entry.began = performance.now();
    const ticks = setInterval(() => this.#allow(), 1000);
    this.#allow();
    try {
      await this.#session.command(`SITE:POSE ${parameters}`, {timeout_s: PLAN_TIMEOUT_S});
      for (const {field} of entry.fields) field.dataset.holds = field.value;
      await this.reload();
      this.#fill(this.#of(number), true);
    } catch (error) {
      entry.error = `Refused: ${why(error)}`;
      this.#place();
    }
    clearInterval(ticks);
    entry.busy = false;
    this.#allow();
    return entry.error;
  }

  async #use(number) {
    const entry = this.#items.get(number);
    try {
      await this.#session.command(`HEAD:STATION ${number}`);
      entry.error = '';
      this.#knobs.askAgain();
    } catch (error) {
      entry.error = `Refused: ${why(error)}`;
    }
    this.#allow();
  }

  // A station was dragged or turned in the picture.
  async #moved(move) {
    if (this.trial) return this.trial.moved(move);
    const {station: number, x, y, z, heading_deg} = move;
    const station = this.#of(number);
    const not = this.#session ? this.#session.whyNot('idle') : 'A recording’s stations stay where they were.';
    if (!station || not) {
      this.#place();
      if (not) this.#tell(`Station ${number} stays where it is: ${not}`);
      return;
    }
    const turned = ((heading_deg + 180) % 360 + 360) % 360 - 180;
    const numbers = [x, y, z, turned].map((v) => String(Math.round(v * 1e4) / 1e4));
    const place = [...numbers, station.pitch_deg, station.roll_deg];
    this.#items.get(number).fields.forEach(({field}, k) => {
      field.value = shown(Number(place[k]));
    });
    const slow = setTimeout(() => this.#tell(`Station ${number} is being moved; what depends on it is planned again.`, ''), 1000);
    const error = await this.#send(number, [number, ...place].join(', '));
    clearTimeout(slow);
    if (!error) return;
    const entry = this.#items.get(number);
    this.#fill(this.#of(number), true);
    entry.error = error;
    this.#allow();
    this.#tell(`Station ${number} stays where it is. ${error}`);
  }

  #tell(text, kind = 'warn') {
    this.dispatchEvent(new CustomEvent('tell', {detail: {text, kind}}));
  }

  #allow() {
    const not = this.#session ? this.#session.whyNot('idle') : '';
    say(this.#note, !this.#session ? 'Places are those of the recording.'
      : not ? `${not.replace('control first', 'control to move stations')}${not.startsWith('Not') ? ' Stations are moved while the head is idle.' : ''}` : 'Edit the numbers and press Move, or drag a station in the picture.');
    if (this.#view) this.#view.movable = this.trial !== null || (this.#session !== null && not === '');
    const now = Number(this.#knobs?.value('HEAD:STATION'));
    for (const [number, {item, fields, says, time, buttons, error, busy, began}] of this.#items) {
      const changed = fields.some(({field}) => field.value !== field.dataset.holds);
      for (const {field} of fields) field.disabled = not !== '';
      buttons.move.disabled = not !== '' || !changed || busy;
      buttons.back.disabled = !changed || busy;
      buttons.home.disabled = not !== '' || busy;
      buttons.use.disabled = !this.#session || this.#session.whyNot('off boot idle spin-down fault') !== '' || number === now;
      item.classList.toggle('now', number === now);
      item.querySelector('summary').setAttribute('aria-label',
        `Station ${this.name(number)}${number === now ? ', where the head stands' : ''}`);
      says.className = error ? 'refusal' : 'note';
      says.hidden = !error && !busy;
      say(says, error || (busy ? 'Moving; what depends on it is planned again.' : ''));
      time.hidden = !busy; // it is not in `says`, since a screen reader would read out each second
      say(time, busy ? `${Math.floor((performance.now() - began) / 1000)}\u00a0s so far` : '');
    }
  }
}
