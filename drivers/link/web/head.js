/* SPDX-License-Identifier: MIT */
// This class is the client of one head: connection, commands and replies, control, description, and losses.
import {STATES} from './native.js';
import {Losses} from './losses.js';
import {CommandError, Replies} from './replies.js';
import {Wire} from './wire.js';

export {CommandError};
const TIMEOUT_S = 5, FIRST_DELAY_S = 0.5, MAX_DELAY_S = 5, FULL_DELAY_S = 10, FULL = 1013;

// Says why a connection ended.
function closeWords(code, reason, wasOpen) {
  if (code === FULL) return reason || 'all places of this link are taken';
  if (reason) return reason;
  if (!wasOpen) return 'the head is not there, or does not want this page';
  return code === 1000 || code === 1001 ? 'the head has ended' : 'the connection broke: the head is gone';
}

const unquoted = (text) => text.replace(/^"|"$/g, '');

/** Returns kind of link and address of the client that took control, from a CONTROL event; '' if it names none. */
export const peerOf = ({session, text = ''}) => (session && text.includes(' ') ? text : '');

/**
 * Events, each with its value in `detail`:
 * - `open` {connection}; `close` {code, words, again_s: when it tries again, or null, wasOpen}
 * - `state` {state, before}; `control` {session: 0 nobody, who: kind and address, or '', own, mine}
 * - `lost` {by, frames, pulses}, by 'head' (not computed in time), 'link' (this page was too slow), 'wire' (damaged) or
 *   'page' (dropped here)
 * - `scan` {scan, fired, cast, lost, received, missing} at a scan's end; a count is null if it was lost on the way
 * - `waves` {pulse, scan, windows}: what askWaves asked for
 * - `restarted`: the sequence of frames began anew, so all that the head said before is void
 * - `points`, `descriptor`, `anchor`, `emitter`, `names`, `line-end`, `telemetry`, `event`, `poses` as the Decoder has
 *   them; `refused`, the words for a frame that was refused
 */
export class Head extends EventTarget {
  isOpen = false;
  state = null; // a word of STATES
  session = 0; // this page's; 0: not known
  controller = 0; // the session in control; 0: nobody
  who = ''; // kind of link and address of the session in control; '': not known
  idn = '';
  descriptor = null; // the last frame of each type on this connection
  anchor = null;
  emitter = null;
  telemetry = null;
  names = new Map(); // label: {object, material}

  #url;
  #past;
  #wire;
  #replies;
  #connection = 0; // as the wire numbers them
  #delay_s = FIRST_DELAY_S;
  #timer = 0;
  #isClosed = false;
  #figures = {};
  #losses = null;
  #knowsWho = false; // the head has SYSTem:CONTrol:WHO?
  #told = ''; // who has control, as in the last `control` event

  /** url: "ws://host:port/ws", or "/ws" in a page. worker: false decodes in this thread. past: true also takes the
   * points that the head sent before this connection, where it keeps them; a batch of such points has `past`. This
   * object connects at once, and again and again until close(). */
  constructor(url, {worker = typeof Worker === 'function', past = false} = {}) {
    super();
    this.#past = past;
    this.#url = typeof location === 'undefined' ? url : new URL(url, location.href.replace(/^http/, 'ws')).href;
    this.#replies = new Replies((line) => this.#wire.post({send: line}));
    this.#forget();
    this.#wire = worker ? this.#inWorker() : this.#inPage();
    this.#connect();
  }

  get mine() {
    return this.session !== 0 && this.session === this.controller;
  }

  // ---- commands

  /** Returns a promise of the reply to one command line. The promise is rejected with CommandError {number, text} for
   * an ERR; its number is 0 if no reply came. */
  command(line, {timeout_s = TIMEOUT_S} = {}) {
    return this.#replies.ask(line, timeout_s);
  }

  /** Asks for the waveform of a pulse of a scan; the answer is an event `waves`. Only the newest waveforms of the last
   * scan are kept (native_waves.js). */
  askWaves(pulse, scan) {
    this.#wire.post({wavesOf: pulse, scan});
  }

  /** Takes control and changes nothing else. Throws -203 where another session has control. */
  async takeControl() {
    await this.command('SYSTem:CONTrol:TAKE');
    await this.#askControl();
  }

  async releaseControl() {
    await this.command('SYSTem:CONTrol:RELease');
    await this.#askControl();
  }

  /** Asks for the state, which no frame may have told. */
  async askState() {
    this.#become(await this.command('HEAD:STATe?'));
  }

  async #askControl() {
    this.#controlled(Number(await this.command('SYSTem:CONTrol?')));
  }

  /** true: the frames from now on are kept. false: they are handed on as a `kept` event, whose detail is a Blob. */
  keep(on) {
    this.#wire.post({keep: on});
  }

  /** Ends the connection for good. */
  close() {
    if (this.#isClosed) return;
    this.#isClosed = true;
    clearTimeout(this.#timer);
    this.#wire.post({close: true});
    this.#closed({code: 1000, reason: 'closed by this page'});
    this.#wire.end();
  }

  /** Counts of this connection, by the words of COUNTS.md:
   * - frames, bytes, points (records, shots without echo among them), pulses (received), empty
   * - lost_frames: missing in the sequence
   * - left_out_frames, left_out_pulses: the part of these that the head left out, since this page was too slow
   * - lost_pulses: lost by the head; missing_pulses: those that the head sent and this page did not get, in the scans
   *   whose final counts have come
   * - dropped_points, dropped_pulses: decoded, and dropped by the page itself
   * - unplaced_points, unplaced_pulses: came before their anchor or their pose
   * - past_points, past_pulses, past_hash: from before this connection, and in none of the other counts
   * - past_gone: points that the head keeps no more; past_lost_frames: frames that it could not keep
   * - repeated_frames, late_frames: came twice, or after newer ones, and were dropped
   * - jumps_back: how often the sequence of frames began anew
   * - bad_bytes, bad_payloads, refused; decode_ns_per_point; point_hash */
  figures() {
    const f = this.#figures, l = this.#losses;
    return {...f, pulses: f.shots, dropped_pulses: f.dropped_shots, unplaced_pulses: f.unplaced_shots,
      left_out_frames: l.leftOutFrames, left_out_pulses: l.leftOutPulses, missing_pulses: l.missing,
      lost_pulses: l.byHead};
  }

  // ---- the wire, in a worker or here

  #connect() {
    const past = this.#past ? this.#url.replace(/^ws/, 'http').replace(/\/ws$/, '/past') : null;
    this.#wire.post({connect: this.#url, past});
  }

  #inWorker() {
    const worker = new Worker(new URL('./wire_worker.js', import.meta.url), {type: 'module'});
    worker.onmessage = ({data}) => {
      this.#taken(data);
      worker.postMessage({ack: true});
    };
    worker.onerror = (event) => { // it could not be loaded, or has failed
      event.preventDefault?.();
      worker.terminate();
      this.#wire = this.#inPage();
      // #closed() connects again after a delay
      if (this.isOpen) this.#closed({code: 1006, reason: 'this page failed to read the stream'});
      else this.#connect();
    };
    return {post: (message) => worker.postMessage(message), end: () => worker.terminate()};
  }

  #inPage() {
    const wire = new Wire((message) => queueMicrotask(() => {
      this.#taken(message);
      wire.take({ack: true});
    }));
    return {post: (message) => wire.take(message), end() {}};
  }

  #taken({connection, things, figures}) {
    if (this.#isClosed) return;
    const before = this.#figures;
    this.#figures = figures;
    for (const [name, value] of things) this.#take(name, value, connection);
    const more = (key) => figures[key] - (connection === this.#connection ? before[key] ?? 0 : 0);
    this.#connection = connection;
    if (more('dropped_shots') > 0) this.#say('lost', {by: 'page', frames: 0, pulses: more('dropped_shots')});
  }

  #take(name, value, connection) {
    switch (name) {
      case 'open': this.#opened(connection); return;
      case 'close': this.#closed(value); return;
      case 'text': this.#replies.take(value); return;
      case 'descriptor': this.#described(value); return;
      case 'anchor': this.anchor = value; break;
      case 'emitter': this.emitter = value; break;
      case 'restarted': this.#restarted(value); break;
      case 'names': value.forEach(({label, ...words}) => this.names.set(label, words)); break;
      case 'telemetry': this.#measured(value); break;
      case 'event': this.#happened(value); break;
      case 'points': value.past ? this.#losses.past(value) : this.#losses.points(value); break;
      default:
    }
    this.#say(name, value);
  }

  #say(name, detail) {
    this.dispatchEvent(new CustomEvent(name, {detail}));
  }

  // ---- connection

  #forget() {
    this.state = this.descriptor = this.anchor = this.emitter = this.telemetry = null;
    this.session = this.controller = 0;
    this.who = '';
    this.names.clear();
    this.#figures = {points: 0, shots: 0, bytes: 0, frames: 0, lost_frames: 0, bad_bytes: 0, decode_ns_per_point: 0};
    this.#losses = new Losses((name, detail) => this.#say(name, detail));
  }

  #opened(connection) {
    const figures = this.#figures;
    this.#forget();
    this.#figures = figures;
    this.isOpen = true;
    this.#replies.open();
    this.#say('open', {connection});
    this.#introduce().catch(() => {}); // the head is gone again; a `close` event says so
  }

  // Asks for identity and state. An older head has no session numbers: SYSTem:SESSion? would put an error into its
  // queue. So HELP? is asked before, which shows whether the head has that query.
  async #introduce() {
    const [idn, state, controller, help] = await Promise.all(
      ['*IDN?', 'HEAD:STATe?', 'SYSTem:CONTrol?', 'HELP?'].map((line) => this.command(line)));
    this.#delay_s = FIRST_DELAY_S;
    this.idn = idn;
    this.#become(state);
    this.#knowsWho = /SYSTem:CONTrol:WHO/i.test(help);
    if (/SYSTem:SESSion/i.test(help)) this.session = Number(await this.command('SYSTem:SESSion?'));
    this.#controlled(Number(controller));
    if (this.controller && this.#knowsWho) this.#controlled(this.controller, unquoted(await this.command('SYSTem:CONTrol:WHO?')));
  }

  #closed({code, reason}) {
    const wasOpen = this.isOpen, words = closeWords(code, reason, wasOpen);
    this.isOpen = false;
    this.#replies.close(words);
    const again_s = this.#isClosed ? null : code === FULL ? FULL_DELAY_S : this.#delay_s;
    this.session = this.controller = 0;
    this.who = '';
    this.#told = '';
    this.state = null;
    if (again_s !== null) {
      this.#timer = setTimeout(() => this.#connect(), 1000 * again_s);
      this.#delay_s = Math.min(2 * this.#delay_s, MAX_DELAY_S);
    }
    this.#say('close', {code, words, again_s, wasOpen});
  }

  // ---- the head's description and state

  #become(state) {
    if (state === this.state || state === undefined) return;
    const before = this.state;
    this.state = state;
    this.#say('state', {state, before});
  }

  #controlled(session, who = session === this.controller ? this.who : '') {
    const now = `${session} ${this.session} ${who}`;
    if (now === this.#told) return;
    this.#told = now;
    this.controller = session;
    this.who = who;
    this.#say('control', {session, who, own: this.session, mine: this.mine});
  }

  #described(d) {
    this.descriptor = d;
    if (!d.repeat) this.emitter = null;
    this.#losses.descriptor(d);
    this.#say('descriptor', d);
  }

  #restarted(value) {
    this.descriptor = this.anchor = this.emitter = this.telemetry = null;
    this.names.clear();
    this.#losses.restarted(value);
  }

  #measured(t) {
    this.telemetry = t;
    this.#become(STATES[t.state]);
    this.#losses.telemetry(t, this.#figures.lost_frames);
  }

  #happened(e) {
    this.#losses.event(e);
    if (e.name === 'STATE') this.#become(STATES[e.state]);
    if (e.name === 'CONTROL') this.#controlled(e.session, peerOf(e));
  }
}
