/* SPDX-License-Identifier: MIT */
// The bar shows state and control in words, and has start and stop. A banner shows that the head is gone.
import {atMostEvery, byId, say, clock, grouped} from './page.js';
import {stateWord, why} from './session.js';

export class Bar {
  #session;
  #frames = 0;  // the scan has so many frames; 0: it runs until it is stopped
  #done = 0;
  #share = null; // this part of the scan is done, 0 to 1
  #frame_s = 0;
  #showSoon = atMostEvery(250, () => this.#showProgress(this.#session.scan));
  #busy = false;

  constructor(session, log) {
    this.#session = session;
    const run = (line) => () => this.#do(() => session.command(line), log); // it takes control where nobody has it
    byId('start').addEventListener('click', () => run(session.state === 'fault' ? '*RST' : 'SCAN:STARt')());
    byId('stop').addEventListener('click', run('SCAN:STOP'));
    byId('control').addEventListener('click', () =>
      this.#do(() => (session.mine ? session.head.releaseControl() : session.head.takeControl()), log));
    session.addEventListener('change', () => this.show());
    this.show();
  }

  name(info) {
    const words = [info.maker, info.model].filter(Boolean).join(' ') || info.profile || '';
    say(byId('model'), info.serial ? `${words} · ${info.serial}` : words);
    byId('model').title = info.config ?? '';
    document.title = words ? `${words} · scanhead` : 'scanhead';
  }

  // Takes the frames of the scan, the number of frames done, and the time of one frame (0: not known).
  progress({frames = this.#frames, done = this.#done, frame_s = this.#frame_s}) {
    if (frames === this.#frames && done === this.#done && frame_s === this.#frame_s) return;
    this.#frames = frames;
    this.#done = done;
    this.#frame_s = frame_s;
    this.show();
  }

  // A scan has begun, perhaps a second time in a replay.
  begin() {
    this.#share = null;
    this.#done = 0;
    this.show();
  }

  // Shows the progress of the scan, t_s after its start. The text changes a few times a second at most.
  reached(t_s) {
    if (!(this.#frames > 0 && this.#frame_s > 0 && t_s >= 0)) return;
    const share = Math.min(0.99, t_s / (this.#frame_s * this.#frames), (this.#done + 1) / this.#frames);
    if (share === this.#share) return;
    this.#share = share;
    this.#showSoon();
  }

  async #do(action, log) {
    if (this.#busy) return;
    this.#busy = true;
    this.show();
    try {
      await action();
    } catch (error) {
      log.add(`Refused: ${why(error)}`, 'bad');
      this.notice(`The head refused: ${why(error)}`, 6000, 'bad');
    }
    this.#busy = false;
    this.show();
  }

  #timer = 0;
  #notice = '';
  #kind = '';
  #recording = '';
  // Shows beside the progress what is being recorded; '': nothing.
  recording(words) {
    this.#recording = words;
    this.show();
  }

  // kind is '' for information, 'warn' or 'bad'.
  notice(text, ms, kind = '') {
    clearTimeout(this.#timer);
    this.#notice = text;
    this.#kind = kind;
    this.#timer = setTimeout(() => {
      this.#notice = '';
      this.show();
    }, ms);
    this.show();
  }

  show() {
    const {link, state, pace, mine, owner, who, scan, since} = this.#session;
    const open = link === 'open', may = open && !this.#busy && (mine || owner === 0);
    document.body.dataset.link = link;
    document.body.dataset.owner = mine ? 'page' : owner ? 'other' : 'nobody';
    document.body.dataset.state = open ? state ?? '' : '';
    say(byId('state-word'), open ? stateWord(state ?? '…', pace) : link === 'closed' ? 'Not connected' : 'Connecting');
    this.#showProgress(scan);
    say(byId('owner'), !open ? '' : mine ? 'You have control' : owner ? `${who} has control` : 'Nobody has control');
    byId('owner').title = byId('owner').textContent;
    say(byId('control'), mine ? 'Give back control' : 'Take control');
    byId('control').disabled = !may;
    for (const id of ['control', 'start', 'stop']) byId(id).title = !mine && owner ? `${who} has control. It has to give it back first.` : '';
    say(byId('start'), state === 'fault' ? 'Reset' : 'Start');
    byId('start').disabled = !may || !['idle', 'fault'].includes(state);
    byId('stop').disabled = !may || !['spin-up', 'scanning'].includes(state);
    this.#showBanner(link, since);
  }

  #showProgress(scan) {
    say(byId('progress'), [this.#progressText(scan), this.#recording].filter(Boolean).join(' · '));
  }

  #progressText(scan) {
    if (!scan) return this.#session.link === 'open' ? 'No scan yet' : '';
    const name = `Scan ${grouped(scan)}`, frames = this.#frames, done = this.#done;
    const plural = (n) => `${grouped(n)} frame${n === 1 ? '' : 's'}`;
    if (!frames) return `${name}: ${plural(done)}`;
    if (!['spin-up', 'scanning'].includes(this.#session.state)) {
      return done >= frames ? `${name}: done` : `${name}: ended after ${grouped(done)} of ${plural(frames)}`;
    }
    const percent = this.#share === null ? '' : ` ${Math.floor(100 * this.#share)}\u00a0%`;
    return frames === 1 ? `${name}:${percent || ' 1 frame'}` : `${name}:${percent}${percent && ','} frame ${grouped(Math.min(done + 1, frames))} of ${grouped(frames)}`;
  }

  #showBanner(link, since) {
    const {words, wasOpen} = this.#session;
    const gone = link !== 'closed' ? '' : wasOpen
      ? `Not connected since ${clock(since)}: ${words}. What was received stays. The page connects again by itself.`
      : `No connection: ${words}. The page tries again by itself.`;
    const kind = gone ? 'bad' : this.#kind;
    byId('banner').dataset.kind = kind;
    byId('banner').setAttribute('role', kind === 'bad' ? 'alert' : 'status');
    say(byId('banner'), gone || this.#notice);
    byId('banner').hidden = !(gone || this.#notice);
  }
}
