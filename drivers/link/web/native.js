/* SPDX-License-Identifier: MIT */
// This module reads the native protocol, by PROTOCOL.md and its pages alone. A Parser turns bytes into frames; a
// Decoder turns frames into values and batches of points in the scene frame. The module is pure: it runs in a page, a
// worker and node.
import {LOCAL, Parser, REPEAT} from './native_parser.js';
import {readAnchor, readBeside, readDescriptor, readEmitter, readEvent, readLineEnd, readNames, readPoses,
  readTelemetry, refuse, Refused} from './native_fields.js';
import {Columns, geoPlacer, PointHash, polarPlacer} from './native_points.js';
import {Poses} from './native_poses.js';
import {isBefore} from './native_sequence.js';
import {Waves} from './native_waves.js';

export {isBefore, LOCAL, Parser, REPEAT};
export {crc32c} from './crc32c.js';
const VERSION = 1;
export const TYPES = ['', 'descriptor', 'anchor', 'points', 'line-end', 'telemetry', 'event', 'surfaces', 'poses',
  'attributes', 'emitter', 'colours', 'waveforms'];
export const STATES = ['off', 'boot', 'idle', 'spin-up', 'scanning', 'spin-down', 'fault'];
const [, DESCRIPTOR, ANCHOR, POINTS, LINE_END, TELEMETRY, EVENT, SURFACES, POSES, ATTRIBUTES, EMITTER, COLOURS,
  WAVES] = TYPES.keys();
export {POINTS};
export const BESIDE_POINTS = [POINTS, ATTRIBUTES, COLOURS]; // points, and the frames that add to them
const HEAD = 40, RECORD = 20, MAX_POINTS = 3274, ROOM = 32768, NO_AMPLITUDE = -32768, HAS_DEVIATIONS = 8;

/** Turns frames into values. State that PROTOCOL.md calls void is forgotten. A frame that the protocol tells readers to
 * refuse is counted, and otherwise ignored. Only callbacks may throw. */
export class Decoder {
  /** Each callback may be left out: points(batch), descriptor(d), anchor(a), emitter(e), names(list), lineEnd(l),
   * telemetry(t), event(e), poses(list), refused(why, frame), restarted({}). Values of frames have the header's `t_ns`
   * (BigInt), and `repeat` and `local` from its flags; lists don't. */
  constructor(callbacks = {}) {
    this.on = callbacks;
    this.descriptor = this.anchor = null;
    this.emitter = null; // null: a line head
    this.toldAlone = false; // since the last numbered frame a descriptor came for this reader alone
    this.stats = {points: 0, shots: 0, empty: 0, unplaced_points: 0, unplaced_shots: 0, refused: 0, unknown: 0, lost_samples: 0};
    this.hash = new PointHash();
    this.poses = new Poses();
    this.waves = new Waves();
    this.columns = new Columns(ROOM);
    this.lastPulse0 = -1;
    this.scanT0_ns = 0n; // with lastPulse0: device time of the scan's pulse 0
    this.shots = 0;
    this.batch = null; // what the points in the columns have in common
    this.last = null; // the last points frame, until its attributes and colours have come
    this.placer = null;
  }

  /** Returns the hash of all records of all points frames so far, as 16 hexadecimal digits. */
  get pointHash() {
    return this.hash.toString();
  }

  /** Returns whether points can be placed. */
  get canPlace() {
    return this.descriptor !== null && this.anchor !== null;
  }

  take(frame) {
    if (frame.version !== VERSION) {
      this.stats.unknown++;
      return;
    }
    try {
      this.#take(frame, new DataView(frame.payload.buffer, frame.payload.byteOffset, frame.payload.length));
    } catch (error) {
      if (!(error instanceof Refused)) throw error;
      this.stats.refused++;
      this.on.refused?.(error.message, frame);
    }
  }

  /** Takes a notice of the parser. When another sequence begins, all that the stream has said is void. But a descriptor
   *  that came just before for this reader alone belongs to the new sequence, and stays. */
  notice({kind}) {
    if (kind !== 'restarted') return;
    if (!this.toldAlone) this.#forget();
    this.lastPulse0 = -1; // lower pulses, and a scan's start, say nothing of the new sequence
    this.waves.clear(); // pulses and scans may have the numbers of earlier ones
    this.on.restarted?.({});
  }

  /** Returns the windows of a pulse, as Waves.of does. */
  wavesOf(pulse, scan) {
    return this.waves.of(pulse, scan);
  }

  /** Hands on the points that are there. A frame whose attributes or colours are still to come stays, unless `all`. */
  flush(all = false) {
    const {columns: c, batch} = this;
    const waits = this.last !== null && !all; // the last frame waits for its attributes or colours
    const to = waits ? this.last.from : c.n, held = waits ? this.last.shots : 0;
    if (batch === null || (to === 0 && this.shots === held)) return;
    const copy = c.copy(0, to, batch.rgb);
    const {scan, frame, line, station, pulse0, began_s} = batch;
    const out = {n: to, shots: this.shots - held, scan, frame, line, station, pulse0, began_s, ...copy};
    c.drop(to);
    this.shots = held;
    if (waits) {
      this.last.from = 0;
      batch.pulse0 = this.last.pulse0;
    } else {
      this.batch = this.last = null;
    }
    this.on.points?.(out);
  }

  #take(frame, view) {
    const isOwn = (frame.flags & LOCAL) !== 0;
    this.toldAlone = isOwn && (this.toldAlone || frame.type === DESCRIPTOR);
    if (frame.type === POINTS) return this.#points(frame, view);
    if (!isOwn && frame.type !== ATTRIBUTES && frame.type !== COLOURS) this.last = null;
    const own = {t_ns: frame.t_ns, repeat: (frame.flags & REPEAT) !== 0, local: isOwn};
    switch (frame.type) {
      case DESCRIPTOR: return this.#descriptor(Object.assign(readDescriptor(view), own));
      case ANCHOR: return this.#anchor(Object.assign(readAnchor(view), own));
      case EMITTER: return this.#emitter(Object.assign(readEmitter(view), own));
      case ATTRIBUTES: return this.#attributes(frame, view);
      case COLOURS: return this.#colours(frame, view);
      case WAVES: return this.#waves(view);
      case LINE_END: return this.on.lineEnd?.(Object.assign(readLineEnd(view), own));
      case TELEMETRY: return this.on.telemetry?.(Object.assign(readTelemetry(view), own));
      case EVENT: return this.#event(Object.assign(readEvent(view), own));
      case SURFACES: return this.on.names?.(readNames(view));
      case POSES: return this.#poses(readPoses(view));
      default: this.stats.unknown++; // a later head may send types that this page doesn't know
    }
    return undefined;
  }

  #forget() {
    this.flush(true);
    this.descriptor = this.anchor = this.emitter = this.placer = null;
    this.lastPulse0 = -1;
    this.poses.forget();
  }

  #descriptor(d) {
    if (!d.repeat || this.descriptor === null || this.descriptor.scan !== d.scan) this.#forget();
    this.descriptor = d;
    this.on.descriptor?.(d);
  }

  // Without the descriptor of its scan an anchor may be one of the scan before.
  #anchor(a) {
    if (this.descriptor === null) return;
    if (this.anchor !== null && !a.repeat) this.flush(true);
    this.anchor = a;
    this.placer = null;
    this.on.anchor?.(a);
  }

  #emitter(e) {
    this.emitter = e;
    this.on.emitter?.(e);
  }

  // A SCAN_START with the descriptor's number is of another scan if that scan has another start: the head has started
  // again. The event of the scan at hand can come after its first points, where the head lost the tick with it.
  #isOfOther(start) {
    if (this.descriptor === null) return false;
    const hasOther = this.lastPulse0 >= 0 && BigInt.asIntN(64, start.at_ns) !== this.scanT0_ns;
    return start.scan !== this.descriptor.scan || hasOther;
  }

  #event(e) {
    if (e.name === 'SCAN_START' && this.#isOfOther(e)) {
      if (e.scan === this.descriptor.scan) this.waves.clear(); // its pulses may have the numbers of earlier ones
      this.#forget();
    }
    this.on.event?.(e);
  }

  #waves(view) {
    const lost = this.waves.add(view, this.descriptor?.scan ?? null);
    this.stats.lost_samples += lost;
  }

  #poses(list) {
    this.poses.add(list);
    this.on.poses?.(list);
  }

  #points(frame, view) {
    this.last = null;
    if (view.byteLength < HEAD) refuse('points shorter than their header');
    const n = view.getUint32(36, true), shots = view.getUint32(32, true);
    if (n > (view.byteLength - HEAD) / RECORD) refuse('fewer points than the header says');
    const low = view.getUint32(8, true), high = view.getUint32(12, true), pulse0 = high * 2 ** 32 + low;
    const t0_ns = view.getInt32(20, true) * 2 ** 32 + view.getUint32(16, true);
    if (pulse0 < this.lastPulse0) this.#forget();
    const until_ms = this.anchor?.until_ms ?? 0;
    if (until_ms !== 0 && t0_ns >= until_ms * 1e6) this.anchor = null; // the next one did not come
    this.lastPulse0 = pulse0;
    this.scanT0_ns = frame.t_ns - BigInt(t0_ns);
    this.hash.add(view, n, low, high);
    this.stats.shots += shots;
    this.stats.points += n;
    if (!this.canPlace) {
      this.stats.unplaced_points += n;
      this.stats.unplaced_shots += shots;
      return;
    }
    this.#place(frame, view, {n, shots, pulse0, t0_ns, low, high});
  }

  #place(frame, view, {n, shots, pulse0, t0_ns, low, high}) {
    const c = this.columns, number = view.getUint32(0, true), line = view.getUint32(4, true);
    const {scan, content} = this.descriptor, {station} = this.anchor, b = this.batch;
    const goesOn = b !== null && b.frame === number && b.line === line && b.scan === scan && b.station === station &&
      c.n + MAX_POINTS <= c.room;
    if (!goesOn) {
      this.flush(true);
      const began_s = (Number(frame.t_ns) - t0_ns) * 1e-9; // the frame's time is that of its first pulse
      this.batch = {scan, frame: number, line, station, pulse0, began_s, rgb: (content & 2) !== 0};
    }
    this.placer ??= (this.descriptor.layout === 0 ? polarPlacer : geoPlacer)(this.descriptor, this.anchor);
    const from = c.n;
    this.placer(c, view, n, pulse0, t0_ns);
    this.shots += shots;
    c.amplitude.fill(NaN, from, c.n);
    if (this.batch.rgb) c.rgb.fill(128, 3 * from, 3 * c.n);
    this.stats.empty += n - (c.n - from);
    if (this.descriptor.layout === 0 && this.anchor.moving & 1) this.#placeMoving(view, from, t0_ns);
    if (content & 3) this.last = {from, shots, pulse0, low, high, line, n, seq: frame.seq, content};
  }

  #placeMoving(view, from, t0_ns) {
    const c = this.columns;
    const time = (i) => t0_ns + (view.getUint32(HEAD + RECORD * c.record[i] + 16, true) & 0xffffff);
    const missing = this.poses.place(c, from, time);
    if (missing === 0) return;
    this.stats.unplaced_points += missing;
    for (let i = from, last = -1; i < c.n; i++) {
      if (!Number.isNaN(c.x[i]) || c.pulse[i] === last) continue; // echoes of a pulse follow each other
      last = c.pulse[i];
      this.stats.unplaced_shots++;
    }
    c.dropNaN(from);
  }

  // Returns the last points frame, if a frame of attributes or colours belongs to it: `after` is how many frames after
  // the points frame this one comes. null: the points frame was lost, or this one belongs to another.
  #besidePoints(frame, beside, after) {
    const l = this.last;
    const isOfIt = l !== null && frame.seq === (l.seq + after) >>> 0 && beside.pulse0_low === l.low &&
      beside.pulse0_high === l.high && beside.line === l.line && beside.n_points === l.n;
    return isOfIt ? l : null;
  }

  #attributes(frame, view) {
    const beside = readBeside(view, (this.descriptor?.content ?? 0) & HAS_DEVIATIONS ? 6 : 4, 'attributes');
    const of = this.#besidePoints(frame, beside, 1), c = this.columns;
    if (of === null) return;
    for (let i = of.from; i < c.n; i++) {
      const amplitude = view.getInt16(16 + 4 * c.record[i], true);
      c.amplitude[i] = amplitude === NO_AMPLITUDE ? NaN : amplitude / 100;
    }
    if (!(of.content & 2)) this.last = null;
  }

  #colours(frame, view) {
    const beside = readBeside(view, 3, 'colours'), c = this.columns;
    const of = this.#besidePoints(frame, beside, this.last?.content & 1 ? 2 : 1);
    if (of === null) return;
    for (let i = of.from; i < c.n; i++) {
      for (let k = 0; k < 3; k++) c.rgb[3 * i + k] = view.getUint8(16 + 3 * c.record[i] + k);
    }
    this.last = null;
  }
}
