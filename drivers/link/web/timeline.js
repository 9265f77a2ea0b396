/* SPDX-License-Identifier: MIT */
// The time line of a recording has play and pause, seek, speed and loop. A player does the work: RecordingPlayer shows
// the points of a recording up to a time, ReplayPlayer commands a head that replays one.
import {byId, make, say} from './page.js';

const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 50];
const TICK_MS = 50, POLL_MS = 500;

const seconds = (s) => (s >= 3600 ? `${Math.floor(s / 3600)}:` : '') + (s >= 60
  ? `${String(Math.floor(s / 60) % 60).padStart(s >= 3600 ? 2 : 1, '0')}:${String(Math.floor(s % 60)).padStart(2, '0')}` : `${s.toFixed(1)} s`);

export class Timeline {
  #player;
  #isHeld = false; // the user has the handle

  constructor(player) {
    this.#player = player;
    this.play = make('button', {type: 'button', id: 'play', click: () => player.play(!player.isPlaying)}, 'Play');
    this.seek = make('input', {id: 'seek', type: 'range', min: 0, step: 'any', 'aria-label': 'Time of the recording',
      input: () => this.#held(true), change: () => this.#held(false)});
    this.text = make('output', {for: 'seek', class: 'unit'});
    this.speed = make('select', {id: 'speed', 'aria-label': 'Speed', change: () => player.setSpeed(Number(this.speed.value))},
      ...SPEEDS.map((value) => make('option', {value}, `${value} ×`)));
    this.loop = make('input', {id: 'loop', type: 'checkbox', change: () => player.setLoop(this.loop.checked)});
    byId('timeline').replaceChildren(this.play, this.seek, this.text, this.speed, make('label', {class: 'tick'}, this.loop, 'Loop'));
    byId('timeline').hidden = false;
    player.changed = () => this.show();
    this.show();
  }

  // A replay seeks when the user lets the handle go; the points of a recording follow the handle.
  #held(isHeld) {
    this.#isHeld = isHeld;
    if (!isHeld || this.#player.follows) this.#player.seek(Number(this.seek.value));
    this.#says(Number(this.seek.value));
  }

  #says(at_s) {
    const {length_s} = this.#player, words = length_s > 0 ? `${seconds(at_s)} of ${seconds(length_s)}` : seconds(at_s);
    say(this.text, words);
    this.seek.setAttribute('aria-valuetext', words);
  }

  show() {
    const {isPlaying, length_s, position_s, speed, loop, may} = this.#player;
    say(this.play, isPlaying ? 'Pause' : 'Play');
    this.seek.max = length_s > 0 ? length_s : 1;
    if (!SPEEDS.includes(speed) && speed > 0) this.#addSpeed(speed);
    this.speed.value = speed;
    this.loop.checked = loop;
    for (const part of [this.play, this.speed, this.loop]) part.disabled = !may;
    this.seek.disabled = !may || !(length_s > 0);
    if (this.#isHeld) return;
    this.seek.value = Math.min(position_s, Number(this.seek.max));
    this.#says(position_s);
  }

  // The program may have been started with a speed that is not in the list.
  #addSpeed(speed) {
    if ([...this.speed.options].some(({value}) => Number(value) === speed)) return;
    this.speed.append(make('option', {value: speed}, `${speed} ×`));
  }
}

// The points of a recording are all here: the time line shows those up to a time. At its end all are shown, which costs
// nothing.
export class RecordingPlayer {
  changed = () => {};
  follows = true;
  may = true;
  isPlaying = false;
  speed = 1;
  loop = false;
  #view;
  #from_s;
  #timer = 0;
  #last = 0;

  // from_s and to_s: the first and the last time of its points.
  constructor(view, {from_s, to_s}) {
    this.#view = view;
    this.#from_s = from_s;
    this.length_s = this.position_s = to_s - from_s;
  }

  play(on) {
    clearInterval(this.#timer);
    this.isPlaying = on;
    if (on && this.position_s >= this.length_s) this.position_s = 0;
    this.#last = performance.now();
    if (on) this.#timer = setInterval(() => this.#tick(), TICK_MS);
    this.#show();
  }

  seek(at_s) {
    this.position_s = Math.min(this.length_s, Math.max(0, at_s));
    this.#show();
  }

  setSpeed(speed) { this.speed = speed; }

  setLoop(on) { this.loop = on; }

  #tick() {
    const now = performance.now();
    this.position_s += this.speed * (now - this.#last) / 1000;
    this.#last = now;
    if (this.position_s >= this.length_s) {
      this.position_s = this.loop ? this.position_s % this.length_s : this.length_s;
      if (!this.loop) return this.play(false);
    }
    return this.#show();
  }

  #show() {
    const isAll = this.position_s >= this.length_s;
    this.#view.times(isAll ? null : {from: -Infinity, to: this.#from_s + this.position_s}, this.isPlaying);
    this.changed();
  }
}

// This player is for a head that replays a recording (SCAN:REPLay). After a seek the points from before are taken off
// the picture, whichever client asked for it.
export class ReplayPlayer {
  changed = () => {};
  follows = false;
  may = false;
  isPlaying = false;
  position_s = 0;
  length_s = 0;
  speed = 1;
  loop = false;
  #session;
  #cloud;
  #tell;
  #wanted = 1; // the speed while it plays

  // tell(words) says why a command was refused.
  constructor(session, cloud, tell) {
    this.#session = session;
    this.#cloud = cloud;
    this.#tell = tell;
  }

  // Returns the player of a session whose head replays a recording, or null.
  static async of(session, cloud, tell) {
    if (!/ SCAN:REPLay/i.test(await session.command('HELP?'))) return null;
    const player = new ReplayPlayer(session, cloud, tell);
    if (!await player.#ask()) return null;
    session.head.addEventListener('descriptor', ({detail}) => player.#described(detail));
    session.addEventListener('change', () => player.#allow());
    setInterval(() => !document.hidden && session.link === 'open' && player.#ask(), POLL_MS);
    return player;
  }

  play(on) {
    if (!on) return this.#set('', 0);
    const isDone = !this.#plays || (this.length_s > 0 && this.position_s >= this.length_s);
    return this.#set(isDone ? 0 : '', this.#wanted);
  }

  seek(at_s) { return this.#set((Math.floor(1e3 * at_s) / 1e3).toFixed(3), ''); } // never beyond its end

  setSpeed(speed) {
    this.#wanted = speed;
    return this.#plays && !this.isPlaying ? this.changed() : this.#set('', speed);
  }

  setLoop(on) { return this.#set('', '', on ? 'ON' : 'OFF'); }

  #plays = false;
  #described_ns = null; // the time of the last descriptor

  // A seek shows in the stream itself: the recording's first descriptor comes again, or a descriptor marked LOCAL that
  // is no repetition. Points before this descriptor in the stream are from before the seek.
  #described({repeat, local, t_ns}) {
    const jumps = !repeat && (local || (this.#described_ns !== null && t_ns <= this.#described_ns));
    this.#described_ns = t_ns;
    if (jumps) this.#cloud.clear();
  }

  async #set(at, speed, loop = '') {
    try {
      await this.#session.command(`SCAN:REPLay ${at},${speed},${loop}`);
    } catch (error) {
      this.#tell(error);
    }
    await this.#ask();
  }

  async #ask() {
    const reply = await this.#session.command('SCAN:REPLay?').catch(() => 'NONE');
    const [state, position, length, speed, loop] = reply.split(',');
    if (!['PLAYING', 'IDLE'].includes(state)) { // another head is at this place now, or none
      this.may = false;
      this.changed();
      return false;
    }
    this.#plays = state === 'PLAYING';
    // A recording may end before its head is idle again, and no frame tells that the replay is at its end.
    if (!this.#plays && this.#session.state !== 'idle') this.#session.head.askState().catch(() => {});
    Object.assign(this, {position_s: Number(position), length_s: Number(length), loop: loop === 'ON',
      isPlaying: this.#plays && Number(speed) > 0, speed: Number(speed) > 0 ? Number(speed) : this.#wanted});
    this.#wanted = this.speed;
    this.#allow();
    return true;
  }

  #allow() {
    const {link, mine, owner} = this.#session;
    this.may = link === 'open' && (mine || owner === 0);
    this.changed();
  }
}
