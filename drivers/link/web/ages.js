/* SPDX-License-Identifier: MIT */
// This row limits the points' age: only the last seconds before the newest point are shown. Ages count in device time,
// so a head that rests keeps its last points on the picture.
import {make} from './page.js';

const AGES_S = [0.1, 0.5, 1, 2, 5, 10, 30, 60];
const FOLLOW_MS = 200, PATIENCE_MS = 1500;

// Returns the row for the display's panel.
export function ageRow(view) {
  let timer = 0, latest_s = NaN, since_ms = 0;
  // Moves the limit on to the newest point. Before that the limit waits until most of the picture is drawn, for
  // PATIENCE_MS at most.
  const follow = () => {
    const {drawn, left} = view.state;
    const isSoon = left > 0.2 * drawn && performance.now() - since_ms < PATIENCE_MS;
    if (view.cloud.latest_s === latest_s || view.cloud.latest_s === -Infinity || isSoon) return; // trial points have no time
    since_ms = performance.now();
    latest_s = view.cloud.latest_s;
    // A head that was restarted counts its time from 0 again. So points with later times are from before the restart.
    view.times({from: latest_s - Number(select.value), to: latest_s + 1});
  };
  const choose = () => {
    clearInterval(timer);
    latest_s = NaN;
    since_ms = 0;
    if (select.value === '') return view.times(null);
    timer = setInterval(follow, FOLLOW_MS);
    return follow();
  };
  const select = make('select', {id: 'age-limit', change: choose}, make('option', {value: ''}, 'All points'),
    ...AGES_S.map((s) => make('option', {value: s}, `The last ${s} s`)));
  return make('div', {class: 'row'}, make('label', {for: 'age-limit'}, 'Age limit'), select);
}
