/* SPDX-License-Identifier: MIT */
// This module tests the tools of the picture on a head that has scanned: what they draw is read back from the screen.
import {readFileSync} from 'node:fs';
import {pixelsOf} from './png8.mjs';
import {choose} from './rig.mjs';
import {equal, folder, is, near, test} from './work.mjs';

const SIZE = [1100, 560]; // the narrowest wide page: its picture has about 500 x 400 pixels
const TOOLS = 'scanhead.tools';

// Takes a picture of the screen once all points are there, and returns a function of the pixel at a place of the
// canvas.
async function drawn(page) {
  await page.eval('scanhead.view.screenshotReady()');
  const {width, size, out} = pixelsOf(await page.picture());
  const box = await page.eval(`(() => { const {left, top, width, height} = scanhead.view.canvas.getBoundingClientRect(); return {left, top, width, height}; })()`);
  const at = (x, y) => size * ((Math.round(box.top) + Math.round(y)) * width + Math.round(box.left) + Math.round(x));
  const ground = [...out.subarray(at(1, box.height / 2), at(1, box.height / 2) + 3)];
  const pixel = (x, y) => [...out.subarray(at(x, y), at(x, y) + 3)];
  const isGround = (x, y) => pixel(x, y).every((v, k) => v === ground[k]);
  return {...box, pixel, isGround};
}

// Counts pixels that are not ground in rows from..to, and returns their first and last columns.
function rows({isGround, width}, from, to) {
  let n = 0, left = Infinity, right = -Infinity;
  for (let y = from; y < to; y++) {
    for (let x = 0; x < width - 1; x++) {
      if (isGround(x, y)) continue;
      n++;
      left = Math.min(left, x);
      right = Math.max(right, x);
    }
  }
  return {n, left, right};
}

const place = (page, p) => page.eval(`(() => { const p = scanhead.view.camera.project([${p}]); return [p.x, p.y]; })()`);
const onPage = (page, [x, y]) => page.eval(`(() => { const {left, top} = scanhead.view.canvas.getBoundingClientRect(); return [left + ${x}, top + ${y}]; })()`);

// Only points are in the picture: no scene, no stations, and nothing that lies over it.
const bare = (is) => `(() => {
  scanhead.view.show({scene: false, stations: false});
  for (const e of document.querySelectorAll('#legend, #tools, #picture + canvas')) e.style.visibility = '${is ? 'hidden' : ''}';
})()`;

export async function testTools(browser, url, points) {
  const page = await browser.open(url, {size: SIZE});
  await page.until(`scanhead.cloud.total === ${points} && scanhead.view.stations.list.length === 2`);
  await page.eval('scanhead.view.colour("station"), scanhead.view.fit()'); // one colour, whatever is shown

  await test('a view from the front is drawn without perspective: the room is as wide as its scale says', async () => {
    await page.click('#tool-sides');
    await page.click('#side-front');
    await page.eval(`document.querySelector('#tool .head button').click(), ${bare(true)}`);
    const picture = await drawn(page);
    const {min, max} = await page.eval('scanhead.cloud.bounds');
    const [left, top] = await place(page, [min[0], min[1], max[2]]), [right, low] = await place(page, [max[0], max[1], min[2]]);
    const all = rows(picture, 0, Math.floor(picture.height));
    // A point has 2 pixels, and its middle is rounded.
    near(all.left, left, 2.5, 'the left wall');
    near(all.right, right, 2.5, 'the right wall');
    is(rows(picture, 0, Math.floor(top) - 2).n === 0 && rows(picture, Math.ceil(low) + 2, Math.floor(picture.height)).n === 0, 'nothing above and below');
    near((right - left) / (low - top), (max[0] - min[0]) / (max[2] - min[2]), 0.01, 'one scale');
  });

  await test('a height cut: what is above it is neither drawn nor picked, what is below stays as it is', async () => {
    const before = await drawn(page);
    await page.eval(`document.querySelector('#tool-section').click(), document.querySelector('#section-height').click()`);
    await page.fill('#section-to', '1.5');
    const [, row] = (await place(page, [0, 0, 1.5])).map(Math.round);
    await page.eval(`document.querySelector('#tool .head button').click()`);
    const cut = await drawn(page);
    is(rows(before, 0, row - 3).n > 1000, 'there was something above');
    equal(rows(cut, 0, row - 3).n, 0, 'pixels above the cut');
    let other = 0;
    const all = rows(before, row + 4, Math.floor(cut.height)).n;
    for (let y = row + 4; y < Math.floor(cut.height); y++) {
      for (let x = 0; x < cut.width - 1; x++) other += before.pixel(x, y).some((v, k) => v !== cut.pixel(x, y)[k]);
    }
    is(all > 1000 && other < 0.01 * all, `below: ${other} of ${all} pixels differ`);
    await page.eval('scanhead.view.show({points: false, scene: "solid"})');
    const mesh = await drawn(page);
    is(rows(mesh, 0, row - 3).n === 0 && rows(mesh, row + 4, Math.floor(mesh.height)).n > 1000, 'a mesh is cut, too');
    await page.eval('scanhead.view.show({points: true, scene: false})');
    const found = await page.eval(`(async () => {
      const {pointed, camera} = scanhead.view, at = (z) => camera.project([0, 0, z]);
      const find = (z) => new Promise((done) => pointed.find(at(z), 6, done));
      return [await find(2.5), await find(0.7)].map((p) => p?.z ?? null);
    })()`);
    is(found[0] === null && found[1] < 1.5, `picked above and below: ${found}`);
  });

  await test('the largest deviation is gone to, and marked', async () => {
    await page.until(`scanhead.head.state === 'idle'`);
    const before = await page.eval('({target: [...scanhead.view.camera.target], distance: scanhead.view.camera.distance})');
    await page.press('#show-largest');
    const {max_at} = (await page.eval("fetch('/quality').then((answer) => answer.json())")).all;
    const {x, y, z} = await page.eval('scanhead.view.pointed.point');
    near(Math.hypot(x - max_at[0], y - max_at[1], z - max_at[2]), 0, 2e-6, 'the point of the page less that of the head, as floats');
    const seen = await place(page, max_at), middle = await page.eval('[scanhead.view.camera.width / 2, scanhead.view.camera.height / 2]');
    near(Math.hypot(...seen.map((v, k) => v - middle[k])), 0, 1, 'pixels from the middle');
    const card = await page.until(`(({hidden, textContent}) => !hidden && textContent)(document.querySelector('#point'))`);
    const largest = await page.eval(`document.querySelector('#figure-dev-max').textContent`);
    is(card.includes('Range') && card.includes(`Deviation${largest}`), `its figures are shown, with ${largest}: ${card}`);
    await page.eval(`Object.assign(scanhead.view.camera, ${JSON.stringify(before)}), scanhead.view.pointed.mark(null), scanhead.view.cameraMoved()`);
  });

  await test('the handles of a section follow pointer and keys', async () => {
    await page.eval(bare(false));
    await page.press('#tool-section');
    const {scale, from, to} = await page.eval(`(() => {
      const {focal, distance, section} = scanhead.view.camera;
      return {scale: focal / distance, from: section.from_m, to: section.to_m};
    })()`);
    const at = await page.where('#handle-top');
    await page.drag(at, [at[0], at[1] - 30]);
    await page.until(`Math.abs(scanhead.view.camera.section.to_m - ${to + 30 / scale}) < 1e-3`, 'its top is 30 pixels higher');
    await page.eval('document.querySelector("#handle-bottom").focus()');
    await page.send('Input.dispatchKeyEvent', {type: 'keyDown', key: 'ArrowUp', windowsVirtualKeyCode: 38});
    await page.until(`Math.abs(scanhead.view.camera.section.from_m - ${from + 0.05}) < 1e-9`, 'its bottom is 5 cm higher');
    near(Number(await page.eval('document.querySelector("#section-from").value')), from + 0.05, 5e-4, 'the field has it');
    await page.until(`Math.abs(document.querySelector("#handle-bottom").getAttribute("aria-valuenow") - ${from + 0.05}) < 1e-3`, 'the handle says it');
    await page.fill('#section-from', -0.5);
    const field = await page.where('#section-from');
    for (const clickCount of [1, 2]) {
      for (const [type, buttons] of [['mousePressed', 1], ['mouseReleased', 0]]) await page.mouse(type, field, buttons, {clickCount});
    }
    await page.send('Input.insertText', {text: '-0.1'});
    await page.key('Enter');
    near(await page.eval('scanhead.view.camera.section.from_m'), -0.1, 1e-9, 'a double click takes the sign, too');
    await page.click('#section-off');
    equal(await page.eval('scanhead.view.camera.section'), null, 'switched off');
    await page.key('Escape');
    equal(await page.eval('document.querySelector("#tool").hidden'), true, 'Escape leaves the tool');
    await page.eval(`document.querySelector('#tool-sides').click(), document.querySelector('#side-deep').click(), scanhead.view.fit()`);
  });

  await test('a distance between points that are picked: real points, their expected error, and a CSV of them', async () => {
    await page.press('#tool-measure');
    await page.eval('scanhead.view.screenshotReady()');
    const wanted = await page.eval(`(() => {
      const {cloud, view} = scanhead, {camera} = view, all = [];
      for (const {position, n} of cloud.blocks) {
        for (let i = 0; i < n; i += 97) {
          const p = [0, 1, 2].map((a) => position[3 * i + a] + cloud.origin[a]), at = camera.project(p);
          if (at.x > 60 && at.y > 90 && at.x < 0.6 * camera.width && at.y < camera.height - 60) all.push([at.x, at.y]);
        }
      }
      return [all[0], all.at(-1)];
    })()`);
    for (const [k, at] of wanted.entries()) {
      await page.clickAt(await onPage(page, at));
      await page.until(`${TOOLS}.measure.points.length === ${k + 1}`);
    }
    const m = await page.eval(`(() => {
      const {points, figures: [[, , {value, error}]]} = ${TOOLS}.measure.done[0];
      const isReal = points.every(({x, y, z}) => scanhead.cloud.blocks.some(({position, n}) => {
        for (let i = 0; i < 3 * n; i += 3) {
          if (position[i] + scanhead.cloud.origin[0] === x && position[i + 1] + scanhead.cloud.origin[1] === y && position[i + 2] + scanhead.cloud.origin[2] === z) return true;
        }
        return false;
      }));
      return {points: points.map(({x, y, z, range}) => [x, y, z, range]), value, error, isReal};
    })()`);
    is(m.isReal, 'points of the cloud');
    const [a, b] = m.points;
    near(m.value, Math.hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]), 1e-9, 'distance');
    // Without noise the counts of encoders and coordinates are left: some micrometres to a millimetre.
    is(m.error > 0 && m.error < 2e-3, `its error: ${m.error}`);
    const {expected} = (await page.eval("fetch('/quality').then((answer) => answer.json())")).stations[0];
    equal(expected.range_sigma_m, 0, 'the head expects no noise');
    await browser.send('Browser.setDownloadBehavior', {behavior: 'allow', downloadPath: folder, eventsEnabled: false});
    await page.press('#measure-csv');
    const csv = await page.eval(`${TOOLS}.measure.csv`);
    let file = '';
    for (let tries = 0; tries < 500 && file === ''; tries++) {
      try {
        file = readFileSync(`${folder}/points.csv`, 'utf8');
      } catch {
        await page.eval('new Promise((done) => setTimeout(done, 20))');
      }
    }
    equal(file, csv, 'the file');
    equal(csv.split('\r\n').length, 4, 'a head, two points, the last end');
    await page.eval(`void (scanhead.view.camera.target = [${a.slice(0, 3)}], scanhead.view.cameraMoved(), scanhead.view.canvas.focus())`);
    await page.key('Enter');
    const byKey = await page.until(`${TOOLS}.measure.points[2]`), seen = await place(page, [byKey.x, byKey.y, byKey.z]);
    const middle = await page.eval('[scanhead.view.camera.width / 2, scanhead.view.camera.height / 2]');
    near(Math.hypot(...seen.map((v, k) => v - middle[k])), 0, 12, 'Enter picks within 12 pixels of the middle');
    await page.click('#measure-flatness');
    const face = await page.eval(`(async () => {
      const {cloud} = scanhead, tool = ${TOOLS}.measure, {pointOf} = await import('/cloud.js');
      const all = cloud.blocks.flatMap((block) => Array.from({length: block.n}, (_, i) => pointOf(cloud, block, i)));
      const corners = [[2.2, 0.3], [3.5, 0.3], [3.5, -1.2], [2.2, -1.2]].map(([x, y]) => all.reduce((best, p) =>
        (Math.hypot(p.x - x, p.y - y, p.z) < Math.hypot(best.x - x, best.y - y, best.z) ? p : best)));
      corners.forEach((p) => tool.pick(p));
      // The corners go clockwise, so a place in the outline is to the right of each side.
      const side = (a, b, p) => (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
      return all.filter((p) => p.z < 0.05 && corners.every((a, k) => side(a, corners[(k + 1) % 4], p) < 0)).length;
    })()`);
    await page.press('#measure-end');
    const {n, rms, sigma} = await page.until(`${TOOLS}.measure.done[1]?.flat`);
    near(n, face, 4, 'points of the floor in the outline'); // its corners may count or not
    is(face > 50 && rms < 1e-4 && sigma < 1e-3, `a floor without noise is flat: ${face} points, RMS ${rms}, expected ${sigma}`);
    await page.key('Escape');
    equal(await page.eval('scanhead.view.tool'), null, 'clicks are those of the picture again');
  });

  await test('a panorama has each point in its direction; pointing shows it in the picture, and back', async () => {
    await page.press('#tool-panorama');
    await page.until(`${TOOLS}.panorama.panorama !== null`);
    const found = await page.eval(`(() => {
      const {panorama} = ${TOOLS}.panorama, {cloud} = scanhead;
      const image = document.querySelector('#panorama canvas'), pixels = image.getContext('2d').getImageData(0, 0, image.width, image.height).data;
      const s = panorama.station, h = s.heading_deg * Math.PI / 180;
      let points = 0, empty = 0, wrong = 0, filled = 0;
      for (let p = 3; p < pixels.length; p += 4) filled += pixels[p] === 255;
      for (const {position, n} of cloud.blocks) {
        for (let i = 0; i < n; i += 31) {
          const [dx, dy, dz] = [s.x_m, s.y_m, s.z_m].map((v, a) => position[3 * i + a] + cloud.origin[a] - v);
          const right = dx * Math.cos(h) - dy * Math.sin(h), ahead = dx * Math.sin(h) + dy * Math.cos(h);
          const range = Math.hypot(dx, dy, dz), share = panorama.shareOf([Math.atan2(right, ahead), Math.asin(dz / range)]);
          const [x, y] = [Math.min(image.width - 1, Math.floor(share[0] * image.width)), Math.min(image.height - 1, Math.floor(share[1] * image.height))];
          points++;
          empty += pixels[4 * (y * image.width + x) + 3] !== 255;
          const seen = ${TOOLS}.panorama.pointAt([x, y]);
          wrong += !seen || Math.hypot(seen.x - s.x_m, seen.y - s.y_m, seen.z - s.z_m) > range + 1e-4;
        }
      }
      return {points, empty, wrong, share: filled / (image.width * image.height)};
    })()`);
    is(found.points > 1000, `points: ${found.points}`);
    equal(found.empty + found.wrong, 0, 'points without a pixel, or with one of something behind them');
    is(found.share > 0.5, `filled: ${found.share}`);
    const at = await page.where('#panorama canvas');
    await page.mouse('mouseMoved', at);
    const {x, y, z} = await page.until('scanhead.view.pointed.point');
    await page.mouse('mouseMoved', [5, 5]);
    await page.until('scanhead.view.pointed.point === null && document.querySelector("#panorama .cross").hidden');
    await page.eval(`void (scanhead.view.camera.target = [${[x, y, z]}], scanhead.view.cameraMoved())`);
    await page.eval('scanhead.view.screenshotReady()');
    await page.mouse('mouseMoved', await onPage(page, await place(page, [x, y, z])));
    const back = await page.until(`scanhead.view.pointed.point && !document.querySelector("#panorama .cross").hidden && (() => {
      const p = scanhead.view.pointed.point, {panorama} = ${TOOLS}.panorama, {left, top} = document.querySelector('#panorama .cross').style;
      return {share: panorama.shareOf(panorama.anglesOf([p.x, p.y, p.z])), at: [parseFloat(left) / 100, parseFloat(top) / 100]};
    })()`);
    back.share.forEach((v, k) => near(back.at[k], v, 1e-4, 'the cross'));
    await page.key('Escape');
    equal(await page.eval('document.querySelector("#panorama").hidden'), true, 'Escape leaves it');
  });

  await test('a trial beside the tools: points of a cloud keep their place, a click does one thing, times go along', async () => {
    await page.eval('scanhead.view.times({from: -1e6, to: 1e6})');
    await page.press('#tool-panorama');
    await page.until(`${TOOLS}.panorama.panorama !== null`);
    const [at, point] = await page.eval(`(() => {
      const tool = ${TOOLS}.panorama, {width, height} = tool.panorama;
      for (let y = height >> 1; y < height; y++) for (let x = 0; x < width; x++) if (tool.pointAt([x, y])) return [[x, y], tool.pointAt([x, y])];
    })()`);
    const before = await page.eval(`(scanhead.view.pointed.mark(${JSON.stringify(point)}), document.querySelector('#try').click(),
      [${TOOLS}.panorama.pointAt([${at}]), scanhead.view.pointed.point])`);
    equal(before.join(), ',', 'a point of what is not shown, in the panorama and marked'); // both are null
    await page.until('!scanhead.trial.isBusy && scanhead.trial.cells && scanhead.trial.stations.every((s) => s.seen)');
    await page.until(`${TOOLS}.panorama.panorama?.cloud === scanhead.view.cloud`, 'it is made again');
    await page.press('#tool-panorama');
    await page.eval(bare(true));
    await choose(page, '#trial-paint', 'off');
    is(await page.eval('scanhead.view.cloud.window !== null') && rows(await drawn(page), 0, 300).n > 500, 'tried points have no time: all are shown');
    await page.eval(bare(false));
    await page.press('#tool-measure');
    await page.press('#trial-target');
    const places = await page.eval(`(() => {
      const {cloud, camera} = scanhead.view, {position, n} = cloud.blocks[0], all = [];
      for (let i = 0; i < n; i++) {
        const p = camera.project([0, 1, 2].map((a) => position[3 * i + a] + cloud.origin[a]));
        if (p.x > 60 && p.y > 90 && p.x < 0.6 * camera.width && p.y < camera.height - 60) all.push([p.x, p.y]);
      }
      return [all[0], all.at(-1)];
    })()`);
    const measured = await page.eval(`${TOOLS}.measure.points.length`);
    await page.clickAt(await onPage(page, places[0]));
    await page.until(`document.querySelector('.targets li')`);
    equal(await page.eval(`${TOOLS}.measure.points.length`), measured, 'picked points');
    await page.clickAt(await onPage(page, places[1]));
    await page.until(`${TOOLS}.measure.points.length === ${measured + 1}`);
    await page.press('#trial-target');
    await page.eval(`(() => { // each search takes more than one slice, as in a large cloud
      const {now} = performance, {once} = scanhead.view, [x, y] = [${places[0]}];
      let slow = 0;
      performance.now = () => now.call(performance) + 100 * slow++;
      for (let k = 0; k < 2; k++) once.tap({x, y});
      performance.now = now;
    })()`);
    await page.until('scanhead.view.once === null');
    equal(await page.eval('new Promise((done) => setTimeout(done)).then(() => scanhead.view.overlay.targets.length)'), 2, 'targets after a double click');
    await choose(page, '#trial-paint', 'seen');
    await choose(page, '#age-limit', '');
    await page.press('#trial-end');
    equal(await page.eval('[scanhead.view.cloud === scanhead.cloud, scanhead.cloud.window]').then(JSON.stringify), '[true,null]', 'no times at its end');
    await page.press('#tool-measure');
  });

  await test('an empty field of a section is no number', async () => {
    await page.press('#tool-section');
    await page.press('#section-box');
    const before = await page.eval('scanhead.view.camera.section.middle');
    await page.fill('#section-x', '');
    is(/^Refused/.test(await page.until(`[...document.querySelectorAll('#tool [role=status]')].map((e) => e.textContent).join('')`)), 'it is refused');
    equal((await page.eval('scanhead.view.camera.section.middle')).join(), before.join(), 'its middle');
    await page.press('#section-off');
    await page.key('Escape');
  });
  equal(page.faults.join('\n'), '', 'errors of its scripts');
  await page.close();
}
