/* SPDX-License-Identifier: MIT */
// A limit of the points' age: only the last seconds before the newest point are shown. Ages count in device time, so a
// head that rests keeps its last points on the picture.
import {make} from './page.js';

const AGES_S = [0.1, 0.5, 1, 2, 5, 10, 30, 60];
const FOLLOW_MS = 200;

// Returns the row for the display's panel.
export function ageRow(view) {
  let timer = 0, latest_s = NaN;
  const follow = () => {
    if (view.cloud.latest_s === latest_s) return;
    latest_s = view.cloud.latest_s;
    view.times({from: latest_s - Number(select.value), to: latest_s + 1}); // later ones are of a head that was restarted
  };
  const choose = () => {
    clearInterval(timer);
    latest_s = NaN;
    if (select.value === '') return view.times(null);
    timer = setInterval(follow, FOLLOW_MS);
    return follow();
  };
  const select = make('select', {id: 'age-limit', change: choose}, make('option', {value: ''}, 'All points'),
    ...AGES_S.map((s) => make('option', {value: s}, `The last ${s} s`)));
  return make('div', {class: 'row'}, make('label', {for: 'age-limit'}, 'Age limit'), select);
}
