/* SPDX-License-Identifier: MIT */
// These tests are about stations that are tried in the page. They compare what is shown and painted with the words of
// `coverage` about the same scans. The head must not notice any of it.
import {run} from './head.mjs';
import {CONFIG, placesToDrag} from './rig.mjs';
import {pixelsOf} from './png8.mjs';
import {equal, is, near, test} from './work.mjs';
import {SEEN_COLOURS} from '../../drivers/link/web/view_paint.js';

// A line head's rates for a step: lines = step * pulses / sweep, pan = step * lines. The sweep of this one is 240
// degrees.
const STEP_DEG = 0.25, LINES_HZ = STEP_DEG * 100000 / 240;
const micro = (v) => v.toFixed(6);
const M2 = 1e-3; // areas come as floats; their sum over 20,000 cells of 0.02 m2 has errors below 20000 * 2^-30

const share = (page, i) => page.eval(`parseFloat(document.querySelector('#trial-seen-${i}').textContent)`);
const RESTS = `scanhead.trial && !scanhead.trial.isBusy && scanhead.trial.sum && scanhead.trial.stations.every((s) => s.seen)`;

// Asks the command for the same stations, with the finest of the steps by which the page looks for cells.
function covered(cell_m, stations) {
  const sets = [`coverage.cell_m=${cell_m}`, `head.lines_hz=${micro(LINES_HZ)}`, `head.pan_deg_s=${micro(STEP_DEG * LINES_HZ)}`, ...stations];
  return JSON.parse(run('coverage', CONFIG, '--json', '--quiet', ...sets.flatMap((s) => ['--set', s])));
}

async function asCommand(page, stations) {
  const {cell_m, sum} = await page.eval(`(() => { const {none_m2, one_m2, several_m2} = scanhead.trial.sum;
    return {cell_m: scanhead.trial.cells.cell_m, sum: {none_m2, one_m2, several_m2}}; })()`);
  const wanted = covered(cell_m, stations);
  for (const key of ['none_m2', 'one_m2', 'several_m2']) near(sum[key], wanted[key], M2, key);
  const hidden_m2 = await page.until('scanhead.trial.reach && scanhead.trial.sum.hidden_m2 + 1e-9');
  near(await share(page, 0), 100 * (wanted.none_m2 - hidden_m2) / (wanted.area_m2 - hidden_m2), 0.05001, 'per cent seen by none, as shown');
}

// Returns the middles of pieces of the floor on the screen, with the number of stations that see them.
const FLOOR = `(() => {
  const {trial: {cells, sum}, view} = scanhead, {left, top} = document.querySelector('#picture').getBoundingClientRect();
  const found = [], over = ['#legend', '#banner'].map((at) => document.querySelector(at).getBoundingClientRect());
  const covered = (x, y) => y > document.querySelector('#picture').getBoundingClientRect().bottom - 90 // scale bar, axes
    || over.some((r) => x > r.left - 2 && x < r.right + 2 && y > r.top - 2 && y < r.bottom + 2);
  for (let i = 0; i < cells.pieces; i++) {
    const c = [...cells.corners.subarray(12 * i, 12 * i + 12)], mean = [0, 1, 2].map((a) => (c[a] + c[a + 3] + c[a + 6] + c[a + 9]) / 4 + cells.origin[a]);
    const {x, y} = view.camera.project(mean);
    const ends = [0, 3, 6, 9].map((k) => view.camera.project([0, 1, 2].map((a) => c[k + a] + cells.origin[a])));
    // A pixel's middle is at most 0.71 px from the middle of the piece, and has to lie within it.
    const within = ends.every((p, k) => { const q = ends[(k + 1) % 4], along = Math.hypot(q.x - p.x, q.y - p.y);
      return along > 0 && Math.abs((q.x - p.x) * (p.y - y) - (p.x - x) * (q.y - p.y)) / along > 0.8; });
    if (Math.abs(mean[2]) > 1e-3 || !within || covered(left + x, top + y)) continue;
    found.push([Math.floor(left + x), Math.floor(top + y), Math.min(2, sum.counts[cells.cell[i]])]);
  }
  return found;
})()`;

// Compares the hue of each of these places with the colour of its number. Colours differ by at least 0.3 in hue as a
// vector.
async function sameColours(page) {
  const floor = await page.eval(FLOOR), {out, width, size} = pixelsOf(await page.picture());
  const unit = (c) => c.map((v) => v / Math.hypot(...c));
  const right = floor.filter(([x, y, n]) => {
    const at = size * (y * width + x), hue = unit([...out.subarray(at, at + 3)].map((v) => v + 0.01));
    const off = SEEN_COLOURS.map((c) => Math.hypot(...unit(c).map((v, k) => v - hue[k])));
    const is = off.indexOf(Math.min(...off));
    return n === 0 ? off[0] > 0.15 || is === 0 : is === n && off[n] < 0.1;
  });
  return {all: floor.length, right: right.length, seen: [0, 1, 2].map((n) => floor.filter((f) => f[2] === n).length)};
}

export async function trialTests(page, other, SIZE) {
  await test('stations are tried without control: their points are there, and are where their ranges say', async () => {
    await page.click('#try');
    await page.until(RESTS);
    const has = await page.eval(`(() => {
      const {view: {cloud}, trial} = scanhead;
      let worst = 0;
      for (const b of cloud.blocks) {
        const s = trial.get(b.station), at = [s.x_m, s.y_m, s.z_m].map((v, a) => v - cloud.origin[a]);
        for (let i = 0; i < b.n; i++) worst = Math.max(worst, Math.abs(Math.hypot(...at.map((v, a) => b.position[3 * i + a] - v)) - b.range[i]));
      }
      return {worst, own: cloud !== scanhead.cloud, stations: cloud.blocks.map((b) => b.station).sort().join(), n: cloud.count,
        of: trial.stations.reduce((sum, s) => sum + s.points, 0)};
    })()`);
    equal(has.stations, '1,2', 'stations with points');
    is(has.own, 'the points of the scans are kept apart');
    equal(has.n, has.of, 'points held');
    near(has.worst, 0, 16 * 2 ** -21, 'a range less the distance from the station, in floats of up to 16 m');
  });

  await test('what the stations see is as `coverage` says', () => asCommand(page, []));

  await test('a setting of one station changes its points alone', async () => {
    const points = 'scanhead.trial.stations.map((s) => s.points).join()';
    const before = (await page.eval(points)).split(',').map(Number);
    await page.fill('#trial-2-pan1_deg', 360);
    await page.until(`scanhead.trial.get(2).shown === 2 && ${RESTS}`);
    const [one, two] = (await page.eval(points)).split(',').map(Number);
    equal(one, before[0], 'points of the other');
    is(two > 1.9 * before[1], `twice the pan gives twice the points: ${before[1]}, ${two}`);
    await page.fill('#trial-2-pan1_deg', 400);
    const words = await page.until(`document.querySelector('#trial-2-pan1_deg').form.querySelector('.refusal').textContent`);
    equal(words, 'pan from 0 to 400 deg: allowed is a part of 0 to 360 deg, at most a turn, the lower one first', 'a refusal');
    await page.fill('#trial-2-pan1_deg', 'wide');
    equal(await page.until(`document.querySelector('#trial-2-pan1_deg').getAttribute('aria-invalid')`), 'true', 'a word is refused by the page');
    await page.fill('#trial-2-pan1_deg', 360);
    await page.until(`scanhead.trial.get(2).error === '' && ${RESTS}`);
  });

  await test('the surface is painted by the number of stations that see it', async () => {
    await page.resize(1000, 900);
    await page.eval(`scanhead.view.show({points: false, scene: false, stations: false})`);
    await page.eval(`(() => { const {view} = scanhead, {camera} = view; view.fit(); camera.orbit(camera.target, 0, -Math.PI - camera.elevation); view.cameraMoved(); })()`);
    await page.where('#picture');
    await page.eval('scanhead.view.screenshotReady()');
    const {all, right, seen} = await sameColours(page);
    is(seen[1] > 500 && seen[2] > 500, `floor seen by none, one, two: ${seen}`);
    equal(right, all, 'pieces of the floor in the colour of their number');
    await page.resize(...SIZE);
  });

  await test('a station that is dragged has other points and cells soon; the head stands where it stood', async () => {
    await page.eval(`scanhead.view.show({points: true, scene: true, stations: true})`);
    const places = await placesToDrag(page);
    await page.eval(`document.querySelector('#picture').addEventListener('pointerup', () => {
      const t0 = performance.now(), {trial, view} = scanhead, station = trial.get(1);
      window.took = null;
      const look = async () => {
        if (station.shown !== station.wanted) return setTimeout(look, 1);
        await view.screenshotReady();
        window.took = performance.now() - t0;
      };
      look();
    }, {once: true})`);
    await page.drag(...places);
    const took = await page.until('window.took');
    await page.until(RESTS);
    const at = await page.eval(`(() => { const s = scanhead.trial.get(1); return [s.x_m, s.y_m, s.z_m].map((v) => Math.round(v * 1e4) / 1e4); })()`);
    console.log(`# from letting go of a station to all its points on the page: ${took.toFixed(0)} ms, ${await page.eval('scanhead.trial.get(1).points')} points`);
    is(await page.eval('scanhead.trial.get(1).wanted') > 3, 'its points were asked for while it was dragged');
    is(Math.hypot(at[0] - 1.5, at[1] - 2) < 0.05 && at[2] === 1.6, `it is where it was let go: ${at}`);
    await page.fill('#trial-2-pan1_deg', 180);
    await page.until(`scanhead.trial.get(2).pan1_deg === 180 && ${RESTS}`);
    await asCommand(page, [`stations.0.position_m=[${at}]`]);
    equal((await other.ask('SITE:POSE? 1')).split(',').slice(0, 2).map(Number).join(), '0,0', 'where the head stands');
  });

  await test('the share of one room is that of the cells in the section', async () => {
    const said = `document.querySelector('#trial-section').textContent`;
    equal(await page.eval(said), 'For one room alone: put a Section around it.', 'without a section');
    await page.eval(`document.querySelector('#tool-section').click(), document.querySelector('#section-height').click()`);
    await page.fill('#section-from', '-0.13');
    await page.fill('#section-to', '0.13'); // no cell has its middle there
    const [seen, all, whole] = await page.eval(`(() => {
      const {cells, sum, reach} = scanhead.trial, heights = new Map(), m2 = [0, 0, 0];
      for (let i = 0; i < cells.pieces; i++) {
        const of = heights.get(cells.cell[i]) ?? [];
        heights.set(cells.cell[i], of);
        for (let k = 2; k < 12; k += 3) of.push(cells.corners[12 * i + k] + cells.origin[2]);
      }
      for (const [c, of] of heights) {
        if (Math.abs(of.reduce((a, b) => a + b) / of.length) > 0.13) continue;
        m2[2] += cells.area[c];
        if (sum.counts[c] === 0 && reach && !(reach[c >>> 5] >>> (c & 31) & 1)) continue;
        m2[1] += cells.area[c];
        if (sum.counts[c] > 0) m2[0] += cells.area[c];
      }
      return m2;
    })()`);
    const words = (await page.eval(said)).match(/^In the section: ([\d.]+).% of (\d+).m²$/);
    is(words !== null && all > 10, `what is said: ${words}`);
    near(Number(words[1]), 100 * seen / all, 0.05001, 'per cent of the cells around the floor');
    await page.click('#trial-suggest');
    const next = await page.until('scanhead.trial.next');
    is(next.gain_m2 > 0 && next.gain_m2 + next.none_m2 <= whole - seen + M2, `a suggestion is about the section: ${next.gain_m2} m2 and ${next.none_m2} m2 of ${whole - seen}`);
    is((await page.eval(`document.querySelector('#trial').textContent`)).includes('more of the section'), 'and says so');
    await page.click('#trial-suggest');
    await page.eval(`document.querySelector('#section-off').click(), document.querySelector('#tool-section').click()`);
    equal(await page.eval(said), 'For one room alone: put a Section around it.', 'after it');
  });

  await test('the best next place is shown, and a click takes it', async () => {
    const before = await page.eval('scanhead.trial.sum.none_m2');
    await page.click('#trial-suggest');
    const next = await page.until('scanhead.view.stations.list.some((s) => s.suggested) && scanhead.trial.next');
    is(next.gain_m2 > 0 && next.none_m2 < before, `it adds ${next.gain_m2} m2`);
    await page.where('#picture');
    await page.eval(`(() => { // it comes into the middle, where no button lies over it
      const {view, trial: {next}} = scanhead;
      view.camera.target = [next.x_m, next.y_m, next.z_m];
      view.cameraMoved();
    })()`);
    await page.eval('scanhead.view.screenshotReady()');
    await page.clickAt(await page.eval(`(() => {
      const {left, top} = document.querySelector('#picture').getBoundingClientRect();
      const {next, stations} = scanhead.trial, p = scanhead.view.camera.project([next.x_m, next.y_m, next.z_m]);
      return [left + p.x, top + p.y];
    })()`));
    await page.until(`scanhead.trial.stations.length === 3 && ${RESTS}`);
    // The added station's cells are looked for by finer pulses than the suggestion's, so no more floor is left unseen.
    is(await page.eval('scanhead.trial.sum.none_m2') <= next.none_m2 + M2, 'no more is left than was said');
    await page.eval(`document.querySelector('#trial .as-text').open = true`);
    is(/^stations:\n(  - \{name: "[^"]+", position_m: \[[^\]]+\], heading_deg: [-\d.]+\}\n){3}$/.test(await page.until(`document.querySelector('#trial-text').value`)),
      'the text for a configuration');
    await page.eval(`document.querySelector('#trial .as-text').open = false`);
  });

  await test('a target is seen by the stations whose points lie there', async () => {
    await page.press('#trial-target');
    await page.where('#picture');
    await page.eval('scanhead.view.screenshotReady()');
    // This takes a point of the first station on the floor. The camera looks from above, so nothing lies in front of
    // it.
    const [x, y, number, at] = await page.eval(`(() => {
      const {left, top, width, height} = document.querySelector('#picture').getBoundingClientRect(), {view, trial} = scanhead;
      const block = view.cloud.blocks.find((b) => b.station === 1), o = view.cloud.origin;
      for (let i = 0; i < block.n; i++) {
        const at = [0, 1, 2].map((a) => block.position[3 * i + a] + o[a]), p = view.camera.project(at);
        if (Math.abs(at[2]) > 1e-4 || p.x < 20 || p.y < 90 || p.x > width - 60 || p.y > height - 60) continue;
        return [left + p.x, top + p.y, block.station, at];
      }
    })()`);
    await page.clickAt([x, y]);
    const text = await page.until(`document.querySelector('.targets li span')?.textContent`);
    is(new RegExp(`^T1: seen by .*\\b${number}\\b`).test(text), `at ${at}: ${text}`);
    equal(await page.eval(`document.querySelector('#trial-targets').textContent`), 'No two stations have 3 targets in common.', 'what is said');
    const drawn = await page.eval(`scanhead.view.overlay.targets.map((t) => t.name).join()`);
    equal(drawn, 'T1', 'marks in the picture');
    await page.eval(`document.querySelector('.targets li button').click()`);
    equal(await page.eval('scanhead.view.overlay.targets.length'), 0, 'marks after it is removed');
  });

  await test('at the end of a trial the page shows the head again', async () => {
    await page.click('#trial-end');
    equal(await page.eval('scanhead.view.cloud === scanhead.cloud && scanhead.trial === null'), true, 'the points of the scans are back');
    equal(await page.eval(`scanhead.view.stations.list.map((s) => [s.number, s.x_m, s.y_m].join()).join(' ')`), '1,0,0 2,-3,5', 'the stations');
    is(await page.eval(`document.querySelector('#trial').hidden && !scanhead.view.movable`), 'its tools are gone');
  });
}

// The page has control. Afterwards station 2 stands elsewhere.
export async function appliedTest(page, other) {
  await test('with control, the places that were tried can be sent to the head', async () => {
    await page.press('#try');
    await page.until(RESTS);
    equal(await page.eval(`document.querySelector('#trial-apply').disabled`), true, 'nothing has moved yet');
    await page.fill('#trial-2-x_m', -2.5);
    await page.until(RESTS);
    await page.press('#trial-apply');
    await other.until('SITE:POSE? 2', (reply) => reply.startsWith('-2.5,'));
    await page.until(`document.querySelector('#trial-apply').disabled`);
    await page.press('#trial-end');
    await page.until('scanhead.view.stations.get(2).x_m === -2.5');
  });
}
