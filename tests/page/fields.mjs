/* SPDX-License-Identifier: MIT */
// These tests take the fields of the page as their user does, key by key, and compare what stands in a field with what
// the head says. They also switch the theme while the picture moves, and look at the page after a replay's end.
import {end, endpoint, start} from './head.mjs';
import {CONFIG} from './rig.mjs';
import {equal, test} from './work.mjs';

const SIZE = [600, 480];

/** Runs all of them in a browser. */
export async function testFields(browser) {
  const head = await start(['run', CONFIG, '--quiet', '--pace', 'fast']);
  const page = await browser.open(endpoint(head, 'web'), {size: SIZE});
  await page.until('scanhead.head.isOpen && scanhead.head.state === "idle"');

  await test('the theme may be switched while the picture moves', async () => {
    // A frame waits for the GPU in most of these turns. So a page that lost its colours then fails in one of them.
    await page.eval(`(async () => {
      for (let k = 0; k < 24; k++) {
        scanhead.view.cameraMoved();
        await new Promise(requestAnimationFrame);
        document.querySelector('#theme').click();
      }
    })()`);
    await page.eval('scanhead.view.screenshotReady()');
    equal(page.faults.join('\n'), '', 'errors of its scripts');
    const [css, drawn] = await page.eval(`scanhead.view.picture().then((copy) => {
      const theme = scanhead.view.colours.ground.map((v) => Math.round(255 * v)).join();
      const probe = document.body.appendChild(document.createElement('i'));
      probe.style.color = 'var(--ground)';
      const css = getComputedStyle(probe).color.match(/\\d+/g).join();
      probe.remove();
      return [css, theme];
    })`);
    equal(drawn, css, 'the ground of the picture, and that of the style sheet');
  });

  await page.close();
  await end(head);
}
