/* SPDX-License-Identifier: MIT */
// This panel sets the look of the picture: colours with their legend, point size, the things drawn besides points, and
// the viewpoint.
import {bodyOf, byId, kept, make, say} from './page.js';
import {ageRow} from './ages.js';
import {Limits} from './limits.js';
import {MODES} from './view_colours.js';
import {css, download, drawLegend, fileName, MOST_ITEMS, moreItems} from './picture.js';

export class Display {
  #view;
  #names;
  #legend = byId('legend');
  #shown = '';
  #limits;

  // names(mode, label) returns the name of a surface or a station for people
  constructor(view, names, isRecording = false) {
    this.#view = view;
    this.#names = names;
    const body = bodyOf('display');
    if (!view) {
      body.append(make('p', {class: 'note'}, 'There is no picture in this browser.'));
      return;
    }
    const mode = make('select', {id: 'colour', change: () => this.#colour(mode.value)},
      ...Object.entries(MODES).map(([value, {title}]) => make('option', {value}, value === 'rgb' ? 'Colours of the points' : title)));
    const size = make('input', {id: 'size', type: 'range', min: 1, max: 8, step: 0.5, input: () => this.#size(size)});
    this.sizeText = make('output', {for: 'size', class: 'unit'});
    this.#limits = new Limits(view);
    const rows = [
      make('div', {class: 'row'}, make('label', {for: 'colour'}, 'Colours by'), mode), this.#limits.rows,
      make('div', {class: 'row'}, make('label', {for: 'size'}, 'Point size'), size, this.sizeText),
      isRecording ? null : ageRow(view),
      make('div', {class: 'ticks'}, isRecording ? null : this.#tick('scene', 'Scene'), this.#tick('stations', 'Stations'), this.#tick('legend', 'Legend')),
      make('div', {class: 'actions'}, make('button', {type: 'button', id: 'fit', click: () => view.fit()}, 'Show all'),
        make('button', {type: 'button', id: 'look', title: 'Look from where the head stands',
          click: () => view.lookFrom(this.station?.())}, 'From the head'),
        isRecording ? null : make('button', {type: 'button', id: 'clear', title: 'Forgets the points that are held',
          click: () => view.cloud.clear()}, 'Clear points'),
        make('button', {type: 'button', id: 'screenshot', title: 'The picture with its legend, as a PNG file',
          click: () => this.#save()}, 'Save picture'))];
    body.append(...rows.filter(Boolean));
    mode.value = Object.hasOwn(MODES, kept.get('colour')) ? kept.get('colour') : 'height';
    size.value = kept.get('size') ?? 2;
    this.#colour(mode.value);
    this.#size(size);
    this.#apply();
    setInterval(() => !document.hidden && this.#showLegend(), 500);
  }

  #tick(key, name) {
    const box = make('input', {type: 'checkbox', id: `show-${key}`});
    box.checked = kept.get(`show-${key}`) !== 'false';
    box.addEventListener('change', () => {
      kept.set(`show-${key}`, box.checked);
      this.#apply();
    });
    return make('label', {class: 'tick'}, box, name);
  }

  #is(key) {
    return byId(`show-${key}`)?.checked ?? true;
  }

  #apply() {
    this.#view.show({scene: this.#is('scene'), stations: this.#is('stations')});
    this.#showLegend();
  }

  #colour(mode) {
    kept.set('colour', mode);
    this.mode = mode;
    this.#view.colour(mode);
    this.#limits.show(mode);
    this.#showLegend();
  }

  // Returns a PNG of the picture, with the legend where it is shown.
  async picture() {
    const canvas = await this.#view.picture(), legend = this.#is('legend') ? this.#view.legend() : null;
    if (legend) drawLegend(canvas, legend, this.#view.colours.css, (item) => this.#itemName(item), this.#view.ratio);
    return new Promise((resolve) => canvas.toBlob(resolve, 'image/png'));
  }

  async #save() {
    download(await this.picture(), fileName('png'));
  }

  #size(field) {
    kept.set('size', field.value);
    say(this.sizeText, `${Number(field.value).toFixed(1)} px`);
    this.#view.pointSize(Number(field.value));
  }

  #showLegend() {
    const l = this.#is('legend') && this.#view.cloud?.count !== 0 ? this.#view.legend() : null;
    const key = JSON.stringify(l) + (l?.items ?? []).map((item) => this.#itemName(item)).join();
    if (key === this.#shown) return;
    this.#shown = key;
    if (!l) return this.#legend.replaceChildren();
    const title = make('div', {class: 'title'}, l.unit ? `${l.title}, ${l.unit}` : l.title);
    if (l.items) this.#legend.replaceChildren(title, this.#items(l.items));
    else this.#legend.replaceChildren(title, this.#ramp(l.stops), this.#ticks(l));
  }

  #itemName({label, name}) {
    return name ?? this.#names(this.mode, label) ?? String(label);
  }

  #items(items) {
    const rows = items.slice(0, MOST_ITEMS).map((item) => {
      const patch = make('i');
      patch.style.background = css(item.colour);
      return make('li', {}, patch, make('span', {}, this.#itemName(item)));
    });
    if (items.length > MOST_ITEMS) rows.push(make('li', {}, moreItems(items.length - MOST_ITEMS)));
    return make('ul', {}, ...rows);
  }

  #ramp(stops) {
    const ramp = make('div', {class: 'ramp'});
    ramp.style.background = `linear-gradient(90deg, ${stops.map(css).join(', ')})`;
    return ramp;
  }

  // Shows round values at their places, or the ends in words if there are none.
  #ticks({ticks, from, to}) {
    const all = ticks.length > 0 ? ticks : [{at: 0, text: String(from)}, {at: 1, text: String(to)}];
    return make('div', {class: 'scale'}, ...all.map(({at, text}) => {
      const tick = make('span', {}, text.replace('-', '−'));
      tick.style.left = `${(100 * at).toFixed(2)}%`;
      if (at < 0.05) tick.classList.add('first');
      if (at > 0.95) tick.classList.add('last');
      return tick;
    }));
  }
}
