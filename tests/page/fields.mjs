/* SPDX-License-Identifier: MIT */
// These tests take the fields of the page as their user does, key by key, and compare what stands in a field with what
// the head says. They also switch the theme while the picture moves, and look at the page after a replay's end.
import {readFileSync} from 'node:fs';
import {Client, end, endpoint, run, start} from './head.mjs';
import {choose, CONFIG} from './rig.mjs';
import {equal, folder, is, test, write} from './work.mjs';

const SIZE = [600, 480];
const LINES = '#knob-head-lines';
const valueOf = (selector) => `document.querySelector("${selector}").value`;

/** Replaces the text of the field that has the focus, and presses Enter. */
async function retype(page, text) {
  await page.eval('document.activeElement.select()');
  await page.send('Input.insertText', {text});
  await page.key('Enter');
}

/** Runs all of them in a browser. */
export async function testFields(browser) {
  const head = await start(['run', CONFIG, '--quiet', '--pace', 'fast']);
  const other = new Client(endpoint(head, 'tcp'));
  const page = await browser.open(endpoint(head, 'web'), {size: SIZE});
  await page.until(`scanhead.head.isOpen && scanhead.head.state === "idle" && ${valueOf(LINES)}`);
  await page.press('#control');
  await page.until(`scanhead.head.mine && !document.querySelector("${LINES}").disabled`);
  const lines = (wanted) => other.until('HEAD:LIN?', (reply) => reply === wanted);
  const hasText = (text, selector = LINES) => page.until(`${valueOf(selector)} === ${JSON.stringify(text)}`);

  await test('arrow keys change a setting: on Enter, and when the field is left; Escape takes them back', async () => {
    equal(await other.ask('HEAD:LIN?'), '100', 'lines a second at first');
    await page.click(LINES);
    for (const key of ['ArrowUp', 'ArrowUp']) await page.key(key);
    await page.key('Enter');
    await lines('102');
    await page.key('ArrowDown');
    await page.key('Tab');
    await lines('101');
    await page.until('!document.querySelector(".knob[data-waiting]")'); // the page has the head's answer, too
    await page.click(LINES);
    await page.key('ArrowUp');
    await page.key('Escape');
    equal(await page.eval(valueOf(LINES)), '101', 'the field after Escape');
    const sets = () => page.sent.filter((text) => text.startsWith('HEAD:LIN') && !text.includes('?')).length, before = sets();
    await page.key('Tab');
    await page.eval('scanhead.head.command("*IDN?")'); // what was sent before it has been seen
    equal(sets(), before, 'settings that are sent after Escape');
  });

  await test('a setting is set there and back in one field, which then has the value that the head says', async () => {
    await page.click(LINES);
    for (const value of ['60', '101', '60']) {
      await retype(page, value);
      await lines(value);
    }
    await retype(page, ' 61 ');
    await hasText('61');
    await retype(page, 'MIN');
    await hasText(await other.until('HEAD:LIN?', (reply) => reply !== '61'));
    await retype(page, '1e2');
    await hasText('100');
    await retype(page, '1e9');
    await page.until(`document.querySelector("${LINES}").getAttribute("aria-invalid")`);
    await hasText('100');
    equal(await other.ask('HEAD:LIN?'), '100', 'lines a second after a refusal');
  });

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
  await testEndOfReplay(browser);
  await testNames(browser);
  await testDensity(browser);
}

// This head has more settings than the page has names for. The panel is as wide as on a large screen.
export async function testNames(browser) {
  await test('names of settings are not cut', async () => {
    const beams = readFileSync(CONFIG, 'utf8').replace(/^head: .*$/m, 'head: {profile: velodyne-vlp16}');
    const head = await start(['run', write('beams.yaml', beams), '--quiet', '--pace', 'fast']);
    const page = await browser.open(endpoint(head, 'web'), {size: [1280, 700]});
    await page.press('#control');
    await page.until('document.querySelector("#knob-head-phase-lock")?.getClientRects().length');
    const cut = await page.eval(`[...document.querySelectorAll('.knob label')]
      .filter((e) => e.scrollWidth > e.clientWidth).map((e) => e.textContent).join()`);
    equal(cut, '', 'names that are cut');
    await page.close();
    await end(head);
  });
}

export async function testDensity(browser) {
  await test('a density that is refused is marked and said, and the points stay', async () => {
    const file = `${folder}/dense.shs`;
    run('record', CONFIG, '-o', file, '--quiet', '--set', 'head.pan_stop_deg=30');
    const view = await start(['view', file]);
    const page = await browser.open(view.ready.endpoints[0].endpoint, {size: SIZE});
    const loaded = 'document.querySelector("#loaded")';
    const isMarked = 'document.querySelector("#density").hasAttribute("aria-invalid")';
    await page.until('scanhead.recording && scanhead.cloud.total > 0');
    await page.click('#what-sparse');
    const count = `Number(/^([\\d\u2009]+) of \\1 points$/.exec(${loaded}.textContent)[1].replaceAll('\u2009', ''))`;
    const first = await page.until(`${loaded}.className === 'note' && scanhead.cloud.total === ${count} && ${count}`);
    for (const text of ['abc', '', '0', '1e9']) {
      await choose(page, '#density', text);
      const words = await page.until(`${loaded}.className === 'refusal' && ${loaded}.textContent`);
      is(/^Density: .*allowed .*\d/.test(words), `it says what is allowed: ${words}`);
      equal(await page.eval(`[${isMarked}, scanhead.cloud.total].join()`), `true,${first}`, `"${text}": marked, points`);
      await choose(page, '#density', '100');
      await page.until(`${loaded}.className === 'note' && !${isMarked}`);
    }
    await choose(page, '#density', '50,0'); // half as many a square metre are half as many, rounded for each part
    const half = await page.until(`scanhead.cloud.total !== ${first} && scanhead.cloud.total === ${count} && ${count}`);
    is(Math.abs(half / first - 0.5) < 0.01, `${half} of ${first} points`);
    equal(page.faults.filter((text) => !/400/.test(text)).join('\n'), '', 'errors of its scripts');
    await page.close();
    await end(view);
  });
}

export async function testEndOfReplay(browser) {
  await test('a replay: each scan is done at its end, and then the page has the state that the head says', async () => {
    // `record` writes a scan and its end; the head that was recorded was not idle again by then.
    const file = `${folder}/ends.shs`;
    run('record', CONFIG, '-o', file, '--quiet', '--station', 'all', '--set', 'head.pan_stop_deg=30');
    const links = ['--link', 'type: web, waits: yes', '--link', 'type: tcp, port: 0'];
    const replay = await start(['run', file, '--quiet', ...links, '--set', 'loop.queue_ms=10000']); // a page may stand still
    const other = new Client(endpoint(replay, 'tcp'));
    const page = await browser.open(endpoint(replay, 'web'), {size: SIZE});
    await page.until('!document.querySelector("#timeline").hidden && !document.querySelector("#play").disabled');
    await page.eval(`void new MutationObserver((all) => { // all texts, also those of one task
      for (const {addedNodes} of all) texts.push(...[...addedNodes].map((node) => node.textContent));
    }).observe(document.querySelector('#progress'), {childList: true}, window.texts = [])`);
    await choose(page, '#speed', '1');
    await page.press('#play');
    await page.until('texts.includes("Scan 2: done")');
    equal(await page.eval('texts.filter((text) => text.includes("ended after")).join()'), '', 'scans that were not whole');
    is(await page.eval('texts.includes("Scan 1: done")'), 'the first scan is done, too');
    await other.until('SCAN:REPL?', (reply) => reply.startsWith('IDLE'));
    await other.until('HEAD:STAT?', (reply) => reply === 'idle');
    const hasWord = 'document.querySelector("#state-word").textContent === "Idle"';
    await page.until(`${hasWord} && !document.querySelector("#start").disabled`);
    equal(page.faults.join('\n'), '', 'errors of its scripts');
    await page.close();
    await end(replay);
  });
}
