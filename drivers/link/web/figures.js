/* SPDX-License-Identifier: MIT */
// This panel shows the state in figures: data that the head sends, data that arrived, losses, and the page's own work.
import {bodyOf, byId, duration, figureList, grouped, make, makeSvg, say, short, NONE} from './page.js';

const HEAD = [
  ['pulse-rate', 'Pulses a second', 'Delivered by the head, by its own time'],
  ['echo-rate', 'Echoes a second'],
  ['line-rate', 'Lines a second'],
  ['pulses', 'Pulses', 'Delivered since power-up'],
  ['echoes', 'Echoes a pulse', 'Since power-up'],
  ['lost', 'Pulses lost by the head', 'Fired within the field of view, but not computed in time'],
  ['late', 'Late blocks', 'Blocks that were sent late, and by how much at most'],
  ['queued', 'Errors in its queue', 'SYSTem:ERRor? reads and removes them, for all clients'],
  ['time', 'Time', 'UTC as the head’s clock has it, or its time since power-up; its offset from a PTP master'],
];
const PAGE = [
  ['received', 'Points a second', 'Received by this page'],
  ['bytes', 'Bytes a second'],
  ['lost-frames', 'Stream frames lost', 'Missing in the sequence: left out because this page was too slow, or damaged'],
  ['repeated', 'Stream frames repeated', 'Came a second time, and were dropped'],
  ['late-frames', 'Stream frames late', 'Came after newer ones, and were dropped; they are among the lost ones, too'],
  ['restarts', 'Restarts', 'The sequence of stream frames began anew, as when the head has started again'],
  ['lost-pulses', 'Pulses left out', 'In the stream frames that the head left out because this page was too slow'],
  ['dropped', 'Pulses dropped here', 'By the page itself, which could not take them'],
  ['unplaced', 'Pulses without a place', 'Came before their anchor or pose, as when a page joins a scan: counted, not drawn'],
  ['bad', 'Damaged bytes'],
  ['decode', 'To decode a point'],
  ['held', 'Points held'],
  ['gone', 'Points gone', 'The oldest, which had no room any more, and those of scans that were made again'],
  ['past', 'Points from before', 'From before this page was opened: the head keeps the last ones'],
  ['drawn', 'Pictures a second', 'Drawn of late; none are drawn while nothing changes'],
];

// In these rows any count but 0 is bad. Each value is the name of the count in the figures() of a Head.
const LOSSES = {'lost-frames': 'lost_frames', 'repeated': 'repeated_frames', 'late-frames': 'late_frames',
  'restarts': 'jumps_back', 'lost-pulses': 'left_out_pulses', 'dropped': 'dropped_pulses',
  'unplaced': 'unplaced_pulses', 'bad': 'bad_bytes'};

const SPARK_POINTS = 120; // seconds

const number = (value) => (value === null || value === undefined ? NaN : Number(value));

export class Figures {
  #set;
  #last = null;     // it is the previous telemetry, with its device time
  #lastPage = null; // these are the page's own counts before
  #rates = [];
  #texts = {};
  #path = makeSvg('path');
  #peak = make('span', {class: 'note'});

  constructor(head, cloud) {
    this.head = head;
    this.cloud = cloud;
    const body = bodyOf('figures');
    if (head) {
      const spark = makeSvg('svg', {class: 'spark', viewBox: `0 0 ${SPARK_POINTS - 1} 30`, preserveAspectRatio: 'none',
        role: 'img', 'aria-label': 'Pulses a second, of the last two minutes'},
      makeSvg('line', {class: 'axis', x1: 0, x2: SPARK_POINTS, y1: 29.5, y2: 29.5}), this.#path);
      body.append(make('div', {}, make('div', {class: 'spread'}, make('h3', {}, 'Head'), this.#peak), spark));
    }
    const ofHead = head ? figureList(body, HEAD) : () => {};
    body.append(make('h3', {}, 'This page'));
    const ofPage = figureList(body, head ? PAGE : PAGE.filter(([key]) => ['held', 'drawn'].includes(key)));
    this.#set = (texts) => {
      for (const [set, rows] of [[ofHead, HEAD], [ofPage, PAGE]]) {
        set(Object.fromEntries(rows.map(([key]) => [key, texts[key]]).filter(([key, text]) => text !== undefined && byId(`figure-${key}`))));
      }
    };
    head?.addEventListener('telemetry', ({detail}) => this.#telemetry(detail));
    head?.addEventListener('close', () => this.#stopped());
    setInterval(() => this.#page(), 1000);
    setInterval(() => !document.hidden && this.#show(), 250);
  }

  #telemetry(t) {
    const now = {t_s: number(t.t_ns) / 1e9, at: performance.now() / 1e3, pulses: number(t.pulses), echoes: number(t.echoes), lines: number(t.lines)};
    if (!Number.isFinite(now.t_s)) now.t_s = now.at;
    const before = this.#last;
    // Two telemetries at one time, as at a scan's end, give no rate; a restarted head starts again from 0.
    if (before && now.t_s - before.t_s < 0.2 && now.t_s >= before.t_s) return this.#counts(t, now);
    this.#last = now;
    const s = before ? now.t_s - before.t_s : 0;
    if (s > 0 && now.pulses >= before.pulses) {
      const rate = (key) => (now[key] - before[key]) / s;
      Object.assign(this.#texts, {'pulse-rate': short(rate('pulses')), 'echo-rate': short(rate('echoes')),
        'line-rate': short(rate('lines'))});
      this.#spark(rate('pulses'));
    }
    this.#counts(t, now);
  }

  #counts(t, now) {
    const late = number(t.late_blocks);
    Object.assign(this.#texts, {
      'pulses': short(now.pulses),
      'echoes': now.pulses > 0 ? (now.echoes / now.pulses).toFixed(3) : NONE,
      'lost': grouped(number(t.lost_pulses)),
      'late': late > 0 ? `${grouped(late)}, up to ${duration(number(t.late_max_us) / 1e6)}` : '0',
      'queued': grouped(number(t.errors_queued)),
      'time': clockText(t.utc_ns, now.t_s) + ptpText(t),
    });
    mark('lost', number(t.lost_pulses) > 0);
    mark('queued', number(t.errors_queued) > 0);
  }

  #spark(rate) {
    this.#rates.push(rate);
    if (this.#rates.length > SPARK_POINTS) this.#rates.shift();
    const peak = Math.max(...this.#rates);
    const first = SPARK_POINTS - this.#rates.length;
    const y = (value) => (28.5 - (peak > 0 ? value / peak : 0) * 27).toFixed(1);
    this.#path.setAttribute('d', this.#rates.map((value, i) => `${i ? 'L' : 'M'}${first + i} ${y(value)}`).join(''));
    say(this.#peak, peak > 0 ? `peak ${short(peak)} pulses a second` : '');
  }

  #stopped() {
    this.#last = this.#lastPage = null;
    Object.assign(this.#texts, {'pulse-rate': NONE, 'echo-rate': NONE, 'line-rate': NONE, 'received': NONE, 'bytes': NONE});
  }

  #page() {
    if (this.cloud) Object.assign(this.#texts, {held: short(this.cloud.count), gone: short(this.cloud.gone)});
    if (!this.head) return;
    const f = this.head.figures();
    const now = {at: performance.now() / 1e3, points: number(f.points), bytes: number(f.bytes)};
    const before = this.#lastPage;
    this.#lastPage = now;
    if (before) {
      const rate = (key) => Math.max(0, (now[key] - before[key]) / (now.at - before.at));
      Object.assign(this.#texts, {received: short(rate('points')), bytes: short(rate('bytes'), 'B')});
    }
    Object.assign(this.#texts, {
      'past': pastText(f),
      'decode': number(f.decode_ns_per_point) > 0 ? duration(number(f.decode_ns_per_point) / 1e9) : NONE,
    });
    for (const [key, name] of Object.entries(LOSSES)) {
      this.#texts[key] = grouped(number(f[name]));
      mark(key, number(f[name]) > 0);
    }
  }

  drawn({frames_per_s: rate, points}) {
    this.#texts.drawn = `${short(Math.round(rate * 10) / 10)}${!points || this.cloud.count === 0 ? '' : `, ${short(points)} points`}`;
  }

  #show() {
    this.#set(this.#texts);
  }
}

const mark = (key, bad) => byId(`figure-${key}`)?.classList.toggle('bad', bad);

// Says what came from before, by a head's figures.
function pastText({past_points: points, past_gone: gone, past_lost_frames: lost}) {
  if (!points && !gone && !lost) return NONE;
  return [short(number(points)), gone > 0 && `${short(gone)} older ones are gone`,
    lost > 0 && `${grouped(lost)} stream frames not kept`].filter(Boolean).join(', ');
}

// These are the names of a port's states, by their numbers (drivers/protocol/EVENTS.md).
const PTP_PORTS = {1: 'INITIALIZING', 2: 'FAULTY', 4: 'LISTENING', 8: 'UNCALIBRATED', 9: 'SLAVE'};

/** Returns the port, the servo and the offset in words; '' if the head follows no master. */
export function ptpText(t) {
  if (!t.ptp_port) return '';
  return `, PTP ${PTP_PORTS[t.ptp_port] ?? t.ptp_port}, s${t.ptp_servo}, ${grouped(number(t.ptp_offset_ns))} ns`;
}

function clockText(utc_ns, t_s) {
  const utc = number(utc_ns);
  if (utc > 0) return new Date(utc / 1e6).toISOString().slice(11, 19) + ' UTC';
  if (!Number.isFinite(t_s)) return NONE;
  const s = Math.floor(t_s), two = (n) => String(n).padStart(2, '0');
  return `${Math.floor(s / 3600)}:${two(Math.floor(s / 60) % 60)}:${two(s % 60)} since power-up`;
}

