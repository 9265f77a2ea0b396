/* SPDX-License-Identifier: MIT */
// This class makes the rows in which a user chooses the colour scale and its limits. Limits leave out a share of the
// points, or are set by hand.
import {kept, make, markField, numberOf, say} from './page.js';
import {MODES} from './view_colours.js';
import {SCALES} from './view_ramps.js';

const SHARES = [['0.01', '1 % to 99 %'], ['0.05', '5 % to 95 %'], ['0', 'All points'], ['hand', 'By hand']];

// Writes a limit with as many digits as tell a hundredth of the limits' distance.
export function limitText(value, distance) {
  const digits = Math.floor(Math.log10(Math.abs(value))) - Math.floor(Math.log10(distance)) + 3;
  return digits > 0 ? String(Number(value.toPrecision(Math.min(digits, 17)))) : '0';
}

// Returns the limits of two fields, {limits, words}. Two empty fields have none (null), and the page finds them. Where
// the fields are wrong, words say why.
export function limitsOf(...texts) {
  if (texts.every((text) => text.trim() === '')) return {limits: null, words: ''};
  const [low, high] = texts.map(numberOf);
  return {limits: [low, high], words: low < high ? '' : 'Two numbers; the first has to be the lower one.'};
}

export class Limits {
  #view;
  #mode = '';
  #chosenOf = new Map(); // it maps a mode to {share, low, high} as the fields had them
  #parts = {};

  constructor(view) {
    this.#view = view;
    const select = (id, options, change) => make('select', {id, change}, ...options.map(([value, name]) => make('option', {value}, name)));
    const field = (id, name) => make('input', {id, type: 'text', inputmode: 'decimal', autocomplete: 'off', 'aria-label': name,
      'aria-describedby': 'limit-says', change: () => this.#byHand()});
    const p = this.#parts;
    p.scale = select('scale', SCALES, () => this.#scale());
    p.share = select('limits', SHARES, () => this.#chosen());
    p.low = field('limit-low', 'Lowest');
    p.high = field('limit-high', 'Highest');
    p.unit = make('span', {class: 'unit'});
    p.says = make('p', {class: 'refusal', id: 'limit-says', role: 'status'});
    p.hand = make('div', {class: 'row limits'}, make('span', {}, 'From, to'), p.low, p.high, p.unit);
    this.rows = make('div', {class: 'ramp-rows'}, make('div', {class: 'row'}, make('label', {for: 'scale'}, 'Scale'), p.scale),
      make('div', {class: 'row'}, make('label', {for: 'limits', title: 'From the lowest to the highest of this share of the points'}, 'Limits'), p.share), p.hand, p.says);
    p.scale.value = SCALES.some(([name]) => name === kept.get('scale')) ? kept.get('scale') : 'usual';
    view.ramp({scale: p.scale.value});
  }

  // When another figure is shown, it gets the limits that it had last on this page. The browser does not keep them,
  // since another scene has other limits.
  show(mode) {
    const p = this.#parts, {kind, unit} = MODES[mode];
    this.#mode = mode;
    this.rows.hidden = kind !== 'ramp';
    p.share.closest('.row').hidden = mode === 'age'; // all ages are shown
    const {share, low, high} = this.#chosenOf.get(mode) ?? {share: SHARES[0][0], low: '', high: ''};
    [p.share.value, p.low.value, p.high.value] = [share, low, high];
    say(p.unit, unit);
    this.#apply();
  }

  #scale() {
    kept.set('scale', this.#parts.scale.value);
    this.#view.ramp({scale: this.#parts.scale.value});
  }

  // Limits by hand begin with the limits that are shown.
  #chosen() {
    const p = this.#parts, legend = this.#view.legend();
    if (p.share.value === 'hand' && typeof legend?.from === 'number') {
      for (const [field, value] of [[p.low, legend.from], [p.high, legend.to]]) field.value = limitText(value, legend.to - legend.from);
    }
    this.#apply();
    this.#keep();
    if (p.share.value === 'hand') p.low.focus();
  }

  #byHand() {
    if (this.#apply()) this.#keep();
  }

  #keep() {
    const {share, low, high} = this.#parts;
    this.#chosenOf.set(this.#mode, {share: share.value, low: low.value, high: high.value});
  }

  // Returns whether the limits are valid.
  #apply() {
    const p = this.#parts, isByHand = p.share.value === 'hand' && this.#mode !== 'age';
    const {limits, words} = isByHand ? limitsOf(p.low.value, p.high.value) : {limits: null, words: ''};
    p.hand.hidden = !isByHand;
    say(p.says, words);
    for (const field of [p.low, p.high]) markField(field, words === '');
    if (!isByHand) this.#view.ramp({share: Number(p.share.value)});
    if (words === '') this.#view.limits(...limits ?? []);
    return words === '';
  }
}
