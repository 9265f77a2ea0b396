/* SPDX-License-Identifier: MIT */
// This module has the list of keys: a dialog that the button in the bar and the key ? open.
import {byId, make} from './page.js';

const EVERYWHERE = [['?', 'this list'], ['Tab, Shift + Tab', 'the next, the previous control'], ['Space, Enter', 'press it'],
  ['Esc', 'close this list']];

// rows: [[keys, their effect]] of the picture, or none.
export function startKeys(rows) {
  const dialog = byId('keys');
  const list = (title, all) => [make('h3', {}, title), make('dl', {class: 'keys'},
    ...all.map(([keys, effect]) => make('div', {}, make('dt', {}, make('kbd', {}, keys)), make('dd', {}, effect))))];
  dialog.append(make('h2', {}, 'Keys'), ...(rows.length > 0 ? list('In the picture', rows) : []), ...list('Everywhere', EVERYWHERE),
    make('form', {method: 'dialog'}, make('button', {type: 'submit'}, 'Close')));
  byId('help').addEventListener('click', () => dialog.showModal());
  document.addEventListener('keydown', (event) => {
    const isTyped = event.target.matches('input[type=text], select, textarea');
    if (event.key !== '?' || isTyped || dialog.open) return;
    event.preventDefault();
    dialog.showModal();
  });
}
