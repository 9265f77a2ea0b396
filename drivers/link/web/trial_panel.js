/* SPDX-License-Identifier: MIT */
// This part of the stations' panel is for trying places. It has stations that are moved, added and set in this page
// alone, the surface that they see together, and the best next place. The part takes the place of the list of stations
// while it is open.

import {bodyOf, grouped, kept, make, markField, numberField, numberOf, percent, placeText, say} from './page.js';
import {why} from './session.js';
import {Cloud} from './cloud.js';
import {PARTS} from './stations.js';
import {SETTINGS, Trial} from './trial.js';
import {hasBit, seenWithin} from './previews.js';
import {TargetList} from './trial_targets.js';
import {css} from './picture.js';
import {SEEN_COLOURS} from './view_paint.js';
import {tableOf} from './view_colours.js';

const STEPS = [4, 2, 1, 0.5];
const PAINTS = [['seen', 'What is seen'], ['all', 'Also what is left'], ['off', 'Nothing']];
const SEEN = ['Seen by no station', 'By one', 'By several'];
const PLACE = PARTS.map(([key, name, unit]) => [key, `${name}, ${unit}`]);
const NAMES = {step_deg: 'Step, °', far_m: 'Farthest, m', line0_deg: 'Line from, °', line1_deg: 'Line to, °',
  pan0_deg: 'Pan from, °', pan1_deg: 'Pan to, °'};
const GHOST = 0; // the number of the suggested station in the picture; others begin at 1
const SUGGEST_MS = 250; // a suggestion waits so long for another change

const shown = (value) => (value === null ? '' : String(Math.round(value * 1e4) / 1e4));
const patch = (colour) => {
  const i = make('i', {class: 'patch'});
  i.style.background = css(colour);
  return i;
};

export class TrialPanel {
  #session;
  #stations;
  #view;
  #trial = null;
  #cloud = null;
  #body = bodyOf('stations');
  #box = make('div', {id: 'trial', class: 'trial'});
  #open = make('button', {type: 'button', id: 'try', hidden: true, click: () => this.begin(),
    title: 'Moves stations in this page alone, and shows at once what they see'}, 'Try places');
  #items = new Map(); // it maps a number to {item, fields, place, says, mark}
  #timer = 0;
  #isApplying = false;
  #run = '';
  #targets;
  #colours = tableOf('station');

  constructor(session, stations, view) {
    this.#session = session;
    this.#stations = stations;
    this.#view = view;
    this.#targets = new TargetList(view);
    this.#box.hidden = true;
    this.#body.prepend(make('div', {class: 'actions'}, this.#open), this.#box);
    this.#make();
    session.addEventListener('change', () => this.#trial && this.#allow());
    view?.addEventListener('section', () => this.#trial && this.#cut());
  }

  // A head that has no previews offers no trial. A trial ends when another run of the head begins, since that may have
  // another scene.
  offer(hasPreviews, run) {
    if (this.#trial && run !== this.#run) this.end();
    this.#run = run;
    this.#open.hidden = !hasPreviews || this.#view === null || this.#trial !== null;
  }

  // ---- the elements, made once

  #make() {
    const button = (id, name, click, more = {}) => make('button', {type: 'button', id, click, ...more}, name);
    const option = (value, name) => make('option', {value}, name);
    this.note = make('p', {class: 'note'}, 'Stations move in this page alone; the head stays as it is. Drag them in the picture, or edit their numbers.');
    this.covered = make('div');
    this.coverage = make('p', {class: 'figure-line', id: 'trial-coverage', role: 'status'});
    this.inSection = make('p', {class: 'figure-line', id: 'trial-section', role: 'status',
      title: 'Cells of the surface with their middle in the section box, or between the heights of the cut'});
    this.shares = SEEN.map((_, i) => make('dd', {id: `trial-seen-${i}`}, '–'));
    this.step = make('select', {id: 'trial-step', change: () => this.#trial.setStep(Number(this.step.value))},
      ...STEPS.map((deg) => option(deg, `${deg}°`)));
    this.paint = make('select', {id: 'trial-paint', change: () => {
      kept.set('trial-paint', this.paint.value);
      this.#painted();
    }}, ...PAINTS.map(([value, name]) => option(value, name)));
    this.suggests = make('input', {type: 'checkbox', id: 'trial-suggest', change: () => this.#suggestSoon()});
    this.list = make('ol', {class: 'stations'});
    this.says = make('p', {class: 'note', role: 'status', id: 'trial-says'});
    this.take = button('trial-take', 'Add it', () => this.#takeNext());
    this.add = button('trial-add', 'Add a station', () => this.#add());
    this.apply = button('trial-apply', 'Move the head’s stations', () => this.#apply());
    this.text = make('textarea', {id: 'trial-text', readonly: true, rows: 6, 'aria-label': 'Stations for a configuration', spellcheck: 'false'});
    this.#box.append(this.note,
      make('div', {class: 'coverage'}, make('div', {class: 'track'}, this.covered), this.coverage),
      make('dl', {class: 'figures'}, ...SEEN.map((name, i) => make('div', {}, make('dt', {}, patch(SEEN_COLOURS[i]), name), this.shares[i]))),
      this.inSection,
      make('div', {class: 'row'}, make('label', {for: 'trial-paint'}, 'Painted'), this.paint),
      make('div', {class: 'row'}, make('label', {for: 'trial-step'}, 'Points every'), this.step),
      this.list,
      make('div', {class: 'actions'}, this.add),
      make('label', {class: 'tick'}, this.suggests, 'Show the best next place'), this.says,
      make('div', {class: 'actions'}, this.take), this.#targets.element,
      make('details', {class: 'as-text', toggle: (e) => e.target.open && this.#write()}, make('summary', {}, 'As a configuration'), this.text),
      make('div', {class: 'actions'}, this.apply, button('trial-end', 'End', () => this.end(), {class: 'main'})));
    this.step.value = '2';
    this.paint.value = PAINTS.some(([value]) => value === kept.get('trial-paint')) ? kept.get('trial-paint') : 'seen';
  }

  // ---- begin and end

  begin() {
    const view = this.#view;
    const list = this.#stations.list.filter((s) => s.x_m !== null);
    this.#cloud = new Cloud({capacity: 4e6});
    this.before = view.cloud;
    view.useCloud(this.#cloud);
    this.#trial = new Trial(this.#cloud, list, Number(this.step.value));
    this.#trial.section = view.camera.section;
    this.#stations.setTrial(this);
    this.#targets.begin(this.#trial);
    window.scanhead.trial = this.#trial;
    this.#items.clear();
    view.stations.dragged = ({number, x, y, z, heading_deg}) => this.#trial.change(number, {x_m: x, y_m: y, z_m: z, heading_deg});
    this.#trial.addEventListener('change', () => this.#show());
    this.#trial.addEventListener('seen', () => {
      this.#painted();
      this.#targets.show();
      this.#suggestSoon();
    });
    this.#body.classList.add('trying');
    this.#box.hidden = false;
    this.#open.hidden = true;
    this.#show();
    (this.add.disabled ? this.#box.querySelector('#trial-end') : this.add).focus();
  }

  end() {
    const view = this.#view;
    clearTimeout(this.#timer);
    this.#trial.end();
    this.#targets.begin(null);
    this.#trial = this.#cloud = window.scanhead.trial = null;
    view.stations.dragged = null;
    view.paint(null);
    view.useCloud(this.before);
    this.#stations.setTrial(null);
    this.#body.classList.remove('trying');
    this.list.replaceChildren();
    this.#box.hidden = true;
    this.#open.hidden = false;
    this.#open.focus();
  }

  // ---- for the stations' panel

  name(number) {
    const station = this.#trial.get(number);
    return station?.name ? `${number} ${station.name}` : String(number);
  }

  // A station was dragged, turned or moved by keys, or the suggestion was clicked.
  moved({station, taken, x, y, z, heading_deg}) {
    if (taken) return this.#takeNext();
    return this.#trial.change(station, {x_m: x, y_m: y, z_m: z, heading_deg});
  }

  // ---- showing

  #show() {
    const trial = this.#trial;
    if (!trial) return;
    const colour = (number) => [...this.#colours.subarray(4 * (number & 255), 4 * (number & 255) + 3)];
    if (trial.stations.map((s) => s.number).join() !== [...this.#items.keys()].join()) this.#relist(colour);
    for (const station of trial.stations) this.#fill(station);
    const ghost = trial.next ? [{...trial.next, number: GHOST, name: 'Best next place', suggested: true}] : [];
    // A station that is moved in the picture has its newest place there. The picture's list is then not replaced.
    const {dragging, moved, pending} = this.#view.stations;
    if (!dragging && (!moved || pending)) {
      this.#view.setStations([...trial.stations.map((s) => ({...s, colour: colour(s.number).map((c) => c / 255)})), ...ghost]);
    }
    this.#sums();
    this.#allow();
  }

  #relist(colour) {
    for (const number of [...this.#items.keys()]) if (!this.#trial.get(number)) this.#items.delete(number);
    for (const station of this.#trial.stations) {
      if (!this.#items.has(station.number)) this.#items.set(station.number, this.#item(station, colour(station.number)));
    }
    this.list.replaceChildren(...[...this.#items.values()].map(({item}) => item));
  }

  #item({number, name, isAdded}, colour) {
    const fields = [...PLACE, ...SETTINGS.map((key) => [key, NAMES[key]])].map(([key, label]) =>
      ({key, ...numberField(`trial-${number}-${key}`, label,
        {change: ({target}) => this.#edit(number, key, target), placeholder: key in NAMES ? 'as set' : ''})}));
    const place = make('span', {class: 'place'}), mark = make('span', {class: 'refusal'}), says = make('p', {class: 'refusal', role: 'status'});
    const actions = make('div', {class: 'actions'},
      make('button', {type: 'button', click: () => this.#view.lookFrom(number)}, 'Look from here'),
      make('button', {type: 'button', click: () => this.#back(number)}, isAdded ? 'Remove' : 'As it was'));
    const form = make('form', {submit: (e) => e.preventDefault()}, make('div', {class: 'place-fields'}, ...fields.map(({box}) => box)), says, actions);
    const badge = make('span', {class: 'number'}, String(number));
    badge.style.boxShadow = `inset 0 -0.25rem ${css(colour)}`;
    const item = make('li', {}, make('details', {name: 'trial-station'},
      make('summary', {}, badge, make('span', {class: 'name'}, isAdded ? 'added' : name ?? ''), place, mark), form));
    return {item, fields, place, says, mark};
  }

  #fill(station) {
    const {fields, place, says, mark} = this.#items.get(station.number);
    say(place, placeText(station));
    for (const {key, field} of fields) {
      if (document.activeElement !== field) field.value = shown(station[key]);
    }
    says.hidden = station.error === '';
    say(says, station.error);
    say(mark, station.error && (station.seen || station.points > 0 ? 'Open to see the error' : 'Nothing is seen from here'));
  }

  #edit(number, key, input) {
    const value = input.value.trim() === '' && SETTINGS.includes(key) ? null : numberOf(input.value);
    const isNumber = value === null || Number.isFinite(value);
    markField(input, isNumber);
    if (isNumber) return this.#trial.change(number, {[key]: value});
    this.#trial.get(number).error = `${input.value.trim() || 'An empty field'} is no number.`;
    return this.#fill(this.#trial.get(number));
  }

  #back(number) {
    const {isAdded, was} = this.#trial.get(number);
    if (isAdded) this.#trial.remove(number);
    else this.#trial.change(number, {...was, ...Object.fromEntries(SETTINGS.map((key) => [key, null]))});
  }

  #sums() {
    const {sum, cells, reach} = this.#trial;
    const parts = this.#shares();
    this.shares.forEach((dd, i) => say(dd, percent(parts[i])));
    this.covered.style.width = sum ? `${(100 * (1 - parts[0])).toFixed(2)}%` : '0';
    say(this.coverage, sum ? `${percent(1 - parts[0])} of ${grouped(this.#all())}\u00a0m² ${reach ? 'that can be seen' : 'of all surfaces'}`
      : this.#trial.error || (cells ? '' : 'The surface is being cut into cells.'));
    this.coverage.title = reach ? `Seen from anywhere that a tripod can stand, or by a station; ${grouped(sum.hidden_m2)} m² more can't be seen`
      : 'All surfaces, also those within walls';
    this.#within();
  }

  // A suggestion counts only what is in the section.
  #cut() {
    this.#trial.section = this.#view.camera.section;
    this.#trial.next = null;
    this.#suggestSoon();
    this.#show();
  }

  // Says how much of what is in the section is seen, so that one room can be judged.
  #within() {
    const {sum, cells, reach, section} = this.#trial;
    if (!sum || !section) return say(this.inSection, sum ? 'For one room alone: put a Section around it.' : '');
    const {seen_m2, all_m2} = seenWithin(cells, sum.counts, reach, section);
    return say(this.inSection, all_m2 > 0 ? `In the section: ${percent(seen_m2 / all_m2)} of ${grouped(all_m2)}\u00a0m²` : 'No part of the surface is in the section.');
  }

  // Returns the area that can be seen, or all of it as long as that is not known.
  #all() {
    const {sum} = this.#trial;
    return sum ? sum.none_m2 + sum.one_m2 + sum.several_m2 - sum.hidden_m2 : 0;
  }

  #shares() {
    const {sum} = this.#trial;
    return sum ? [sum.none_m2 - sum.hidden_m2, sum.one_m2, sum.several_m2].map((m2) => m2 / this.#all()) : [];
  }

  #painted() {
    const trial = this.#trial;
    if (!trial?.cells) return;
    const paints = this.paint.value;
    if (paints === 'off' || !trial.sum) this.#view.paint(null);
    else {
      const showsUnseen = paints === 'all' && ((cell) => trial.reach === null || hasBit(trial.reach, cell));
      this.#view.paint(trial.cells, {counts: trial.sum.counts, isTurned: trial.seesBacks, showsUnseen});
    }
  }

  #allow() {
    const {next, stations, nextError} = this.#trial;
    const moved = stations.filter((s) => !s.isAdded && PLACE.some(([key]) => Math.abs(s[key] - s.was[key]) > 1e-9));
    const not = this.#session.whyNot('idle');
    this.add.disabled = stations.length === 0;
    this.add.title = stations.length === 0 ? 'No station has a known place' : '';
    this.apply.disabled = not !== '' || this.#isApplying || moved.length === 0;
    this.apply.title = not || (this.#isApplying && 'Their places are being sent') || (moved.length === 0 ? 'None of them has moved' : 'Sends their places to the head');
    this.take.disabled = !next;
    for (const field of [this.paint, this.suggests]) field.disabled = this.#trial.isBlind;
    say(this.says, next ? `At ${placeText(next)}: ${this.#gain()}.`
      : this.suggests.checked ? nextError || 'Looking for it.' : 'It can be clicked in the picture.');
  }

  // Says what the suggested place adds, of the section if there is one.
  #gain() {
    const {next, sum, cells, reach, section} = this.#trial;
    if (!section) return `${percent(next.gain_m2 / this.#all())} more, ${percent(1 - (next.none_m2 - sum.hidden_m2) / this.#all())} in all`;
    const {seen_m2, all_m2} = seenWithin(cells, sum.counts, reach, section);
    return `${percent(next.gain_m2 / all_m2)} more of the section, ${percent((seen_m2 + next.gain_m2) / all_m2)} in all`;
  }

  // ---- actions

  #suggestSoon() {
    clearTimeout(this.#timer);
    this.#trial.nextError = '';
    if (!this.suggests.checked) {
      this.#trial.next = null;
      return this.#show();
    }
    this.#allow();
    this.#timer = setTimeout(() => this.#trial?.suggest(), SUGGEST_MS);
  }

  #takeNext() {
    const {next} = this.#trial;
    if (next) this.#trial.add(next);
  }

  #add() {
    const last = this.#trial.stations.at(-1);
    const number = this.#trial.add(this.#trial.next ?? {x_m: last.x_m + 1}, last);
    this.#view.select(number);
  }

  #write() {
    this.text.value = this.#trial.text;
    this.text.select();
  }

  // Sends the tried places to the head. The head's stations then stand there for everybody.
  async #apply() {
    this.#isApplying = true;
    this.#allow();
    for (const s of this.#trial.stations.filter((s) => !s.isAdded)) {
      const place = PLACE.map(([key]) => Math.round(s[key] * 1e4) / 1e4);
      if (PLACE.every(([key]) => Math.abs(s[key] - s.was[key]) <= 1e-9)) continue;
      try {
        await this.#session.command(`SITE:POSE ${[s.of, ...place].join(', ')}`, {timeout_s: 120});
        s.was = Object.fromEntries(PLACE.map(([key]) => [key, s[key]]));
      } catch (error) {
        s.error = `Refused: ${why(error)}`;
      }
    }
    this.#isApplying = false;
    if (this.#trial) this.#show();
  }
}
