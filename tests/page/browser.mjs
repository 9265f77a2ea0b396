/* SPDX-License-Identifier: MIT */
// This runs Chromium without a window, by the DevTools protocol over a pipe. So it ends with this program, however that
// ends, and opens no port. The browser's profile is its own, and the browser finds no address but 127.0.0.1.
import {spawn, spawnSync} from 'node:child_process';
import {accessSync, constants, mkdirSync, writeFileSync} from 'node:fs';
import {folder, forget, remember} from './work.mjs';

const NAMES = ['chromium', 'chromium-browser', 'google-chrome'];
const DEADLINE_MS = 300000; // only what waits for ever reaches this, since a busy machine may be many times slower

/** Returns the browser's path, or null. $CHROMIUM names another browser. */
export function findBrowser() {
  if (process.env.CHROMIUM) return process.env.CHROMIUM;
  for (const folder of (process.env.PATH ?? '').split(':')) {
    for (const name of NAMES) {
      try {
        accessSync(`${folder}/${name}`, constants.X_OK);
        return `${folder}/${name}`;
      } catch { /* it is not there */ }
    }
  }
  return null;
}

export class Browser {
  #next = 1;
  #waiting = new Map(); // maps the number of a command to [resolve, reject, its name]
  #pages = new Map(); // maps a session to its page
  #rest = [];

  /** nice applies to all its processes, and size to its window. */
  constructor({nice = 0, size = [1280, 900]} = {}) {
    mkdirSync(`${folder}/profile`, {recursive: true});
    const flags = ['--headless=new', '--remote-debugging-pipe', `--user-data-dir=${folder}/profile`, '--use-angle=swiftshader',
      '--enable-unsafe-swiftshader', '--ignore-gpu-blocklist', `--window-size=${size}`, '--no-first-run', '--no-default-browser-check',
      '--disable-background-networking', '--disable-component-update', '--disable-default-apps', '--disable-extensions',
      '--disable-sync', '--disable-background-timer-throttling', '--disable-renderer-backgrounding',
      '--disable-backgrounding-occluded-windows', '--disable-dev-shm-usage', '--mute-audio', '--hide-scrollbars', '--disable-gpu-compositing', '--enable-precise-memory-info',
      '--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1'];
    if (process.getuid() === 0) flags.push('--no-sandbox');
    this.child = spawn('nice', ['-n', String(nice), 'setpriv', '--pdeathsig', 'KILL', findBrowser(), ...flags, 'about:blank'],
      {stdio: ['ignore', 'ignore', 'ignore', 'pipe', 'pipe'], detached: true, env: {...process.env, HOME: folder}});
    remember(-this.child.pid);
    this.ended = new Promise((done) => this.child.once('close', done).once('error', done));
    this.ended.then(() => this.#fail(new Error('the browser has ended')));
    this.child.stdio[3].on('error', () => {});
    this.child.stdio[4].on('data', (bytes) => this.#read(bytes)).on('error', () => {});
  }

  /** Sends a command of the protocol and returns its result. */
  send(method, params = {}, sessionId = undefined) {
    return new Promise((resolve, reject) => {
      if (this.child.exitCode !== null) throw new Error('the browser has ended');
      const id = this.#next++;
      const timer = setTimeout(() => reject(new Error(`${method}: no answer in ${DEADLINE_MS} ms`)), DEADLINE_MS);
      this.#waiting.set(id, [resolve, reject, method, timer]);
      this.child.stdio[3].write(`${JSON.stringify({id, method, params, sessionId})}\0`);
    });
  }

  /** Opens a page of its own. size is that of the view, in CSS pixels. before is a program that runs before the page's own. */
  async open(url, {size = [1280, 900], dark = false, before = ''} = {}) {
    const {targetId} = await this.send('Target.createTarget', {url: 'about:blank'});
    const {sessionId} = await this.send('Target.attachToTarget', {targetId, flatten: true});
    const page = new Page(this, sessionId, targetId);
    this.#pages.set(sessionId, page);
    await Promise.all([page.send('Page.enable'), page.send('Runtime.enable'), page.send('Network.enable'), page.send('Log.enable'),
      page.resize(...size), page.dark(dark)]);
    if (before) await page.send('Page.addScriptToEvaluateOnNewDocument', {source: before});
    await page.go(url);
    return page;
  }

  /** Ends the browser and everything that it has started. */
  async end() {
    try {
      process.kill(-this.child.pid, 'SIGKILL');
    } catch { /* it has ended already */ }
    await this.ended;
    forget(-this.child.pid);
  }

  #read(bytes) {
    let from = 0;
    for (let end; (end = bytes.indexOf(0, from)) >= 0; from = end + 1) {
      this.#rest.push(bytes.subarray(from, end));
      this.#take(JSON.parse(Buffer.concat(this.#rest).toString()));
      this.#rest = [];
    }
    if (from < bytes.length) this.#rest.push(bytes.subarray(from));
  }

  #take({id, result, error, method, params, sessionId}) {
    if (id === undefined) {
      this.#pages.get(sessionId)?.heard(method, params);
      return;
    }
    const [resolve, reject, name, timer] = this.#waiting.get(id);
    this.#waiting.delete(id);
    clearTimeout(timer);
    if (error) reject(new Error(`${name}: ${error.message}`));
    else resolve(result);
  }

  #fail(error) {
    for (const [, reject, , timer] of this.#waiting.values()) {
      clearTimeout(timer);
      reject(error);
    }
    this.#waiting.clear();
  }
}

class Page {
  sent = []; // text that the page has sent by WebSocket
  faults = []; // errors of its scripts, and error messages on its console
  failed = []; // {url, why} of requests that got no answer
  #urls = new Map();
  #loaded = () => {};

  constructor(browser, session, target) {
    Object.assign(this, {browser, session, target});
  }

  send(method, params) {
    return this.browser.send(method, params, this.session);
  }

  heard(method, params) {
    if (method === 'Page.loadEventFired') this.#loaded();
    else if (method === 'Network.webSocketFrameSent') this.sent.push(params.response.payloadData);
    else if (method === 'Network.requestWillBeSent') this.#urls.set(params.requestId, params.request.url);
    else if (method === 'Network.webSocketCreated') this.#urls.set(params.requestId, params.url);
    else if (method === 'Network.loadingFailed') this.failed.push({url: this.#urls.get(params.requestId), why: params.errorText});
    else if (method === 'Network.webSocketFrameError') this.failed.push({url: this.#urls.get(params.requestId), why: params.errorMessage});
    else if (method === 'Runtime.exceptionThrown') this.faults.push(params.exceptionDetails.exception?.description ?? params.exceptionDetails.text);
    else if (method === 'Runtime.consoleAPICalled' && params.type === 'error') this.faults.push(params.args.map((a) => a.value ?? a.description).join(' '));
  }

  async go(url) {
    const loaded = new Promise((done) => (this.#loaded = done));
    const {errorText} = await this.send('Page.navigate', {url});
    if (errorText) throw new Error(`${url}: ${errorText}`);
    await loaded;
  }

  /** Returns the value of an expression, or the result of its promise. */
  async eval(expression) {
    const {result, exceptionDetails: wrong} = await this.send('Runtime.evaluate', {expression, awaitPromise: true, returnByValue: true});
    if (wrong) throw new Error(`${expression}: ${wrong.exception?.description ?? wrong.text}`);
    return result.value;
  }

  /** Waits until the expression is true and returns its value. The page itself looks every 20 ms. An error has the
   * figures of this page. */
  async until(expression, what = expression) {
    const limit_ms = DEADLINE_MS - 5000; // the page answers before send() gives up
    const answer = await this.send('Runtime.evaluate', {awaitPromise: true, returnByValue: true, expression: `new Promise((done, fail) => {
      const end = performance.now() + ${limit_ms}, ask = () => {
        let value;
        try { value = (${expression}); } catch (error) { value = null; }
        if (value) done(value);
        else if (performance.now() > end) fail(JSON.stringify(window.scanhead?.head?.figures() ?? null));
        else setTimeout(ask, 20);
      };
      ask();
    })`});
    if (answer.exceptionDetails) throw new Error(`${what}: not within ${limit_ms} ms; ${answer.exceptionDetails.exception?.value}`);
    return answer.result.value;
  }

  /** Scrolls the first element that a selector finds into view. Returns its middle once it rests and nothing covers it. */
  where(selector) {
    return this.until(`(() => {
      const e = document.querySelector(${JSON.stringify(selector)});
      for (let up = e; (up = up.parentElement); ) if (up.tagName === 'DETAILS') up.open = true;
      e.scrollIntoView({block: 'center', behavior: 'instant'});
      const {x, y, width, height} = e.getBoundingClientRect(), at = [x + width / 2, y + height / 2];
      const rests = window.restsAt === String(at);
      window.restsAt = String(at);
      return rests && e.contains(document.elementFromPoint(...at)) && at;
    })()`, `${selector} can't be pointed at`);
  }

  mouse(type, [x, y], buttons = 0, more = {}) {
    // A move that does not name its button would lose the pointer's capture.
    const button = type === 'mouseMoved' && buttons === 0 ? 'none' : 'left';
    return this.send('Input.dispatchMouseEvent', {type, x, y, button, buttons, clickCount: 1, pointerType: 'mouse', ...more});
  }

  async clickAt(at) {
    await this.mouse('mouseMoved', at);
    await this.mouse('mousePressed', at, 1);
    await this.mouse('mouseReleased', at);
  }

  /** Clicks the element that a selector finds. The element may have moved meanwhile. If the click hit no control,
   * click() clicks again. */
  async click(selector) {
    for (let tries = 1; ; tries++) {
      const at = await this.where(selector);
      await this.eval(`void addEventListener('pointerdown', ({target}) => (window.pressed = target), {capture: true, once: true})`);
      await this.clickAt(at);
      const [hit, isControl, what] = await this.eval(`[document.querySelector(${JSON.stringify(selector)}).contains(pressed),
        pressed.closest('button, input, select, summary, a, canvas') !== null, pressed.outerHTML.slice(0, 80)]`);
      if (hit) return;
      if (isControl || tries === 5) throw new Error(`a click meant for ${selector} went to ${what}`);
    }
  }

  /** Does the same once the element may be pressed. */
  async press(selector) {
    await this.until(`!document.querySelector(${JSON.stringify(selector)}).disabled`, `${selector} stays disabled`);
    await this.click(selector);
  }

  /** Drags from one place to another in steps, as a hand does. */
  async drag(from, to, steps = 8) {
    await this.mouse('mouseMoved', from);
    await this.mouse('mousePressed', from, 1);
    for (let i = 1; i <= steps; i++) await this.mouse('mouseMoved', from.map((v, k) => v + ((to[k] - v) * i) / steps), 1);
    await this.mouse('mouseReleased', to);
  }

  async key(key, modifiers = 0) {
    const code = {Enter: 13, Tab: 9, Escape: 27}[key] ?? key.toUpperCase().charCodeAt(0);
    const text = key === 'Enter' ? '\r' : key.length === 1 && !modifiers ? key : undefined;
    await this.send('Input.dispatchKeyEvent', {type: 'keyDown', key, text, modifiers, windowsVirtualKeyCode: code});
    await this.send('Input.dispatchKeyEvent', {type: 'keyUp', key, modifiers, windowsVirtualKeyCode: code});
  }

  /** Puts another text into a field and presses Enter. */
  async fill(selector, text) {
    await this.click(selector);
    await this.eval(`document.querySelector(${JSON.stringify(selector)}).select?.()`);
    await this.send('Input.insertText', {text: String(text)});
    await this.key('Enter');
  }

  resize(width, height) {
    return this.send('Emulation.setDeviceMetricsOverride', {width, height, deviceScaleFactor: 1, mobile: width < 500});
  }

  dark(is) {
    return this.send('Emulation.setEmulatedMedia', {features: [{name: 'prefers-color-scheme', value: is ? 'dark' : 'light'}]});
  }

  /** Returns the page as it is shown, as the bytes of a PNG. */
  async picture() {
    const {data} = await this.send('Page.captureScreenshot', {format: 'png'});
    return Buffer.from(data, 'base64');
  }

  async shot(file) {
    writeFileSync(file, await this.picture());
  }

  /** Returns the page's knowledge of its head, the newest events first, and its errors. A failed test shows this. */
  async knows() {
    const words = await this.eval(`(() => {
      const {head, cloud} = window.scanhead ?? {}, all = head?.figures();
      const {pulses, points, lost_frames, dropped_points, bad_bytes, waiting_points} = all ?? {};
      const log = [...document.querySelectorAll('.log li')].slice(0, 8).map((e) => [...e.children].map((part) => part.textContent).join(' '));
      return [JSON.stringify({open: head?.isOpen, state: head?.state, session: head?.session, control: head?.controller, pulses, points,
        lost_frames, dropped_points, bad_bytes, waiting_points, cloud: cloud?.total}),
        'banner: ' + document.querySelector('#banner')?.textContent, ...log].join('\\n');
    })()`);
    return [words, ...this.faults, ...this.failed.map(({url, why}) => `${url}: ${why}`)].join('\n');
  }

  /** A page behind another one draws nothing. */
  toFront() {
    return this.send('Page.bringToFront');
  }

  close() {
    return this.browser.send('Target.closeTarget', {targetId: this.target});
  }
}

/** Returns name and version, for tables. */
export function browserVersion() {
  return spawnSync(findBrowser(), ['--version'], {encoding: 'utf8'}).stdout.trim().replace(/ built on.*/, '');
}
