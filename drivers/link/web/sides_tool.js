/* SPDX-License-Identifier: MIT */
// This tool looks from the top, the front and the side without perspective, and returns to the view with perspective.
import {make} from './page.js';
import {lookDeep, lookFromSide, SIDES} from './view_sides.js';

export class SidesTool {
  id = 'sides';
  name = 'Views';
  title = 'Views';
  #view;

  constructor(view) {
    this.#view = view;
    const button = (id, name, key, look) => make('button', {type: 'button', id, title: `Key ${key}, in the picture`, click: () => {
      look();
      view.touched();
      view.cameraMoved();
      this.changed();
    }}, name);
    this.body = make('div', {}, make('div', {class: 'actions'},
      ...SIDES.map(([side, name, key]) => button(`side-${side}`, name, key, () => lookFromSide(view.camera, side))),
      button('side-deep', 'Perspective', 'O', () => lookDeep(view.camera))),
    make('p', {class: 'note'}, 'Top, front and side have one scale everywhere, so lengths can be compared. '
      + 'They follow the heading of a section box.'));
  }

  isOn() { return this.#view.camera.flat; }
  start() {}
  stop() {}
}
