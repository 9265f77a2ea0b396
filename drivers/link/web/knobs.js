/* SPDX-License-Identifier: MIT */
// This panel has a field for each of the head's settings, with the limits, the unit and the refusals that the head
// gives.
import {asSent, bodyOf, byId, fixed, make, markField, numberOf, say, atMostEvery} from './page.js';
import {describeSettings} from './describe.js';
import {why} from './session.js';

// These are the names of the settings for people, in the order of the page. A setting that is not here stands under
// "More" with its header.
const GROUPS = [
  ['Rates', [['HEAD:PRR', 'Pulses'], ['HEAD:LINes', 'Lines'], ['HEAD:PAN', 'Pan']]],
  ['Angular step', [['SCAN:STEP', 'Both ways'], ['SCAN:STEP:LINE', 'In the line'], ['SCAN:STEP:PAN', 'Line to line']]],
  ['Field of view', [['SCAN:LINE:STARt', 'Line from'], ['SCAN:LINE:STOP', 'Line to'],
    ['SCAN:PAN:STARt', 'Pan from'], ['SCAN:PAN:STOP', 'Pan to']]],
  ['Range', [['HEAD:RANGe:MIN', 'Nearest'], ['HEAD:RANGe:MAX', 'Farthest']]],
  ['Scan', [['SCAN:FRAMes', 'Frames'], ['SCAN:ECHoes', 'Echoes'], ['HEAD:STATION', 'Station']]],
  ['Noise', [['HEAD:NOISe', 'Of ranges'], ['HEAD:NOISe:SIGMa', 'One sigma'], ['HEAD:NOISe:BALL', 'Ball, its radius'],
    ['HEAD:NOISe:ANGLe', 'Of angles']]],
];
const MORE = 'More';
const NOTES = {'SCAN:FRAMes': '0: endless'};
const ELSEWHERE = ['SITE:POSE']; // the stations' panel has it

const CHOICES = {ALL: 'All', FIRST: 'First', LAST: 'Last', STRONGEST: 'Strongest', OFF: 'Off', ON: 'On',
  SIGNAL: 'By signal'};
const choice = (word) => CHOICES[word.toUpperCase()] ?? word;
const sameWord = (a, b) => a.toUpperCase() === b.toUpperCase()
  || a.toUpperCase().startsWith(b.replace(/[a-z]+$/, '').toUpperCase()) && b.toUpperCase().startsWith(a.toUpperCase());

// Turns '1200000' into '1 200 000'; the digits stay those of the head.
function readable(text) {
  const [whole, part] = text.split('.');
  const grouped = whole.length > 5 ? whole.replace(/\B(?=(\d{3})+$)/g, '\u2009') : whole;
  return (part ? `${grouped}.${part}` : grouped).replace('-', '−');
}

const decimals = (text) => (/^\d*\.(\d*)$/.exec(text)?.[1] ?? '').length;

// Writes a limit in few digits: 1200000 becomes '1.2 M'. If a limit is one step from a round number that is not
// allowed, it is shown by that number: 59.999999 becomes '< 60'. The tooltip has all digits.
export function limit(text, step = '', isUpper = false) {
  const round = Number(Number(text).toFixed(Math.max(0, decimals(step) - 2)));
  const off = Math.abs(round - Number(text));
  if (decimals(step) > 3 && off > 0 && off <= 1.5 * Number(step)) {
    return `${round > Number(text) ? '<' : '>'}\u2009${readable(String(round))}`;
  }
  const value = Number(text);
  for (const [scale, prefix] of [[1e6, 'M'], [1e3, 'k']]) {
    if (Math.abs(value) >= Math.max(scale, 1e4)) {
      const scaled = value / scale;
      if (Number(scaled.toPrecision(4)) === scaled) return `${String(scaled).replace('-', '−')}\u00a0${prefix}`;
    }
  }
  return readable(text.replace(/^-?\d*\.\d+$/, (all) => inward(all, isUpper)));
}

// Rounds a number to four decimals or, below 0.1, to four significant digits (at most 12 decimals).
function rounded(text, round) {
  const value = Number(text), places = Math.min(12, 3 - Math.min(-1, Math.floor(Math.log10(Math.abs(value) || 1))));
  if ((text.split('.')[1] ?? '').length <= places) return text;
  const scale = 10 ** places;
  return String(Number((round(value * scale) / scale).toFixed(places)));
}

// Returns a value with few digits; a word stays as it is.
export const shortened = (text) => (/^-?\d*\.\d+$/.test(text) ? rounded(text, Math.round) : text);

// A lower limit is rounded up, an upper one down, so that the shown number is allowed.
const inward = (text, isUpper) => rounded(text, isUpper ? Math.floor : Math.ceil);

// Returns whether no other value can be set now: only one is allowed or, as with a pan that stands still, only the
// present one.
const isFixed = ({min, max}) => Boolean(min) && Boolean(max) && Number(min) >= Number(max);

const unitName = (unit) => unit.replace('deg', '°');

export class Knobs extends EventTarget {
  #session;
  #knobs = new Map(); // it maps a header to {field, hint, box, setting, value}
  #note = make('p', {class: 'note'});
  #form = make('div', {class: 'groups'});
  askAgain = atMostEvery(500, () => this.#ask().catch(() => {}));

  constructor(session) {
    super();
    this.#session = session;
    const reset = make('button', {type: 'button', id: 'reset', click: () => this.#reset()}, 'Settings of power-up');
    this.reset = reset;
    bodyOf('knobs').append(this.#note, this.#form, make('div', {class: 'actions'}, reset));
    session.addEventListener('change', () => {
      if (session.link === 'open' && this.#knobs.size === 0) this.load();
      this.#allow();
    });
    session.head.addEventListener('open', () => this.load());
    session.head.addEventListener('event', ({detail}) => {
      if (['SETTINGS', 'SITE', 'SCAN_START', 'CONTROL'].includes(detail.name)) this.askAgain();
    });
    session.head.addEventListener('descriptor', ({detail}) => this.#described(detail));
    setInterval(() => this.#watchOthers(), 2000);
    this.#allow();
  }

  // A client in control may change a setting between scans, which no event reports. So the settings are read every two
  // seconds.
  #watchOthers() {
    const {link, mine, owner} = this.#session;
    if (link === 'open' && !mine && owner && !document.hidden && byId('panel-knobs').open) this.askAgain();
  }

  #lastDescriptor = '';
  #described(d) {
    const now = [d.prr_uhz, d.lines_uhz, d.pan_udeg_s, d.line_start_udeg, d.line_stop_udeg, d.range_max_m, d.frames].join();
    if (now !== this.#lastDescriptor) this.askAgain();
    this.#lastDescriptor = now;
  }

  #loading = false;
  async load() {
    if (this.#loading) return;
    this.#loading = true;
    try {
      this.#build(await describeSettings(this.#session));
      await this.#read();
    } catch { /* the head is gone; it comes again with 'open' */ }
    this.#loading = false;
  }

  #build(settings) {
    const has = new Map(settings.filter((s) => s.states && !ELSEWHERE.includes(s.header)).map((s) => [s.header, s]));
    const known = new Set(GROUPS.flatMap(([, rows]) => rows.map(([header]) => header)));
    const more = [...has.keys()].filter((header) => !known.has(header)).map((header) => [header, header]);
    const groups = [...GROUPS, [MORE, more]];
    const same = [...has.keys()].join() === [...this.#knobs.keys()].sort((a, b) =>
      [...has.keys()].indexOf(a) - [...has.keys()].indexOf(b)).join();
    if (same) {
      for (const [header, setting] of has) this.#describe(this.#knobs.get(header), setting);
    } else {
      this.#knobs.clear();
      this.#form.replaceChildren(...groups.map(([title, rows]) => [title, rows.filter(([header]) => has.has(header))])
        .filter(([, own]) => own.length > 0).map(([title, own]) => this.#makeGroup(title, own, has)));
    }
    this.#allow(); // fields that can't be set are disabled already before their values come
  }

  // The title of a group has the unit if all its settings have the same one.
  #makeGroup(title, rows, has) {
    const units = new Set(rows.map(([header]) => unitName(has.get(header).unit)));
    const common = units.size === 1 ? [...units][0] : '';
    const says = make('p', {class: 'refusal', role: 'status', id: `says-${title.replaceAll(' ', '-').toLowerCase()}`});
    const knobs = rows.map(([header, name]) => {
      const unit = common ? '' : unitName(has.get(header).unit);
      return this.#makeKnob(has.get(header), unit ? `${name}, ${unit}` : name, says);
    });
    const columns = title === MORE ? 'two headers' : knobs.length % 3 === 0 || knobs.length > 4 ? 'three' : 'two';
    return make('fieldset', {}, make('legend', {class: 'group'}, common ? `${title}, ${common}` : title),
      make('div', {class: `knobs ${columns}`}, ...knobs), says);
  }

  #makeKnob(setting, name, says) {
    const id = `knob-${setting.header.replaceAll(':', '-').toLowerCase()}`;
    const knob = {setting, value: '', shown: '', says}; // shown is the last text that came from the head, or was sent
    const attributes = {id, name: setting.header, 'aria-describedby': `${id}-hint ${says.id}`, autocomplete: 'off'};
    const isChoice = setting.kind === 'word' || setting.values.length > 0;
    knob.field = isChoice ? make('select', attributes) : make('input', {...attributes, type: 'text', inputmode: 'decimal', spellcheck: 'false'});
    // A browser tells no `change` of a text that the arrow keys have set.
    for (const type of ['change', 'blur']) knob.field.addEventListener(type, () => this.#set(knob));
    knob.field.addEventListener('keydown', (event) => {
      if (event.key === 'Enter') this.#set(knob);
      if (event.key === 'Escape') this.#showValue(knob, knob.value);
      if (event.key === 'ArrowUp' || event.key === 'ArrowDown') this.#nudge(knob, event);
    });
    knob.hint = make('span', {class: 'hint', id: `${id}-hint`});
    knob.box = make('div', {class: 'knob', title: setting.header}, make('label', {for: id}, name), knob.field, knob.hint);
    this.#knobs.set(setting.header, knob);
    this.#describe(knob, setting);
    return knob.box;
  }

  #describe(knob, setting) {
    knob.setting = setting;
    if (knob.field.tagName === 'SELECT' && knob.options !== setting.values.join()) {
      knob.options = setting.values.join();
      const name = (value) => (setting.kind === 'word' ? choice(value) : readable(value));
      knob.field.replaceChildren(...setting.values.map((value) => make('option', {value}, name(value))));
      if (knob.value) this.#showValue(knob, knob.value);
    }
    this.#hint(knob);
  }

  // Shows the head's refusal, in the head's words.
  #refuse(knob, text) {
    for (const other of this.#knobs.values()) if (other.says === knob.says) markField(other.field, true);
    markField(knob.field, text === '');
    say(knob.says, text);
  }

  #hint(knob) {
    const {min, max, step, header} = knob.setting;
    knob.hint.title = min ? `${min} to ${max}` : '';
    if (knob.field.tagName === 'SELECT') return say(knob.hint, '');
    if (isFixed(knob.setting)) return say(knob.hint, 'fixed');
    return say(knob.hint, NOTES[header] ?? (min ? `${limit(min, step)}\u2009…\u2009${limit(max, step, true)}` : ''));
  }

  #showValue(knob, value) {
    knob.value = value;
    const option = knob.setting.values.find((word) => (knob.setting.kind === 'word' ? sameWord(word, value) : Number(word) === Number(value)));
    knob.shown = knob.field.value = option ?? shortened(value);
    knob.field.title = knob.shown === value || option ? '' : value; // it has all figures
  }

  // While the user types, the text stays. Escape brings the present value.
  #take(knob, value) {
    if (knob.field !== document.activeElement || knob.field.value === knob.shown) this.#showValue(knob, value);
    else knob.value = value;
  }

  async #read() {
    await Promise.all([...this.#knobs.values()].map(async (knob) => {
      const value = await this.#session.command(`${knob.setting.header}?`);
      if (!('waiting' in knob.box.dataset)) this.#take(knob, value);
    }));
    this.dispatchEvent(new Event('values'));
  }

  value(header) {
    return this.#knobs.get(header)?.value;
  }

  async #ask() {
    if (this.#session.link !== 'open' || this.#loading) return;
    const before = [...this.#knobs.values()].map((knob) => knob.value).join();
    await this.#read();
    if (before === [...this.#knobs.values()].map((knob) => knob.value).join()) return;
    this.#build(await describeSettings(this.#session)); // limits depend on other settings
  }

  async #set(knob) {
    const text = knob.field.value;
    if (text === knob.shown) return;
    if (text.trim() === '') return this.#showValue(knob, knob.value);
    knob.shown = text;
    knob.box.dataset.waiting = '';
    try {
      await this.#session.command(`${knob.setting.header} ${asSent(text)}`);
      this.#refuse(knob, '');
      knob.value = asSent(text); // until the head says it, for Escape
    } catch (error) {
      this.#refuse(knob, why(error));
      if (knob.shown === text && knob.field.value !== text) knob.shown = null; // the user may come back to this text
      this.#take(knob, knob.value);
    }
    delete knob.box.dataset.waiting;
    try {
      await this.#read();
      this.#build(await describeSettings(this.#session));
    } catch { /* gone */ }
  }

  // An arrow key adds or subtracts one in the last digit of the shown number, with Shift ten. The head may still refuse
  // the value.
  #nudge(knob, event) {
    if (knob.field.tagName === 'SELECT' || knob.field.readOnly) return;
    const number = numberOf(knob.field.value);
    if (Number.isNaN(number)) return;
    event.preventDefault();
    const decimals = (asSent(knob.field.value).split('.')[1] ?? '').length;
    const by = 10 ** -decimals * (event.shiftKey ? 10 : 1) * (event.key === 'ArrowUp' ? 1 : -1);
    knob.field.value = fixed(number + by, decimals).replace('−', '-');
  }

  async #reset() {
    try {
      await this.#session.command('*RST');
      for (const knob of this.#knobs.values()) this.#refuse(knob, '');
      await this.load();
    } catch (error) {
      say(this.#note, why(error));
    }
  }

  // Settings are shown only to the session that has control, and a field is disabled if it can't be set now.
  #allow() {
    const common = this.#session.whyNot();
    byId('panel-knobs').hidden = !this.#session.mine;
    say(this.#note, this.#knobs.size === 0 ? 'The head has not yet said what can be set.'
      : common || 'Sent on Enter, or when you leave a field.');
    this.reset.disabled = common !== '';
    this.reset.title = 'Sends *RST: all settings as at power-up. A scan is stopped.';
    for (const knob of this.#knobs.values()) {
      const not = this.#session.whyNot(knob.setting.states);
      const isOne = isFixed(knob.setting) && knob.field.tagName !== 'SELECT';
      knob.field.disabled = common !== '' || not !== '';
      knob.field.readOnly = isOne;
      knob.box.title = not && !common ? `${knob.setting.header}: ${not}` : knob.setting.header;
    }
  }
}
