/* SPDX-License-Identifier: MIT */
// This class counts the losses of a connection's scans, as COUNTS.md defines them. It also finds the end of a scan
// whose SCAN_END was lost (LOSSES.md). The class is pure.
import {STATES} from './native.js';

const IN_SCAN = ['scanning', 'spin-down'];

export class Losses {
  leftOutFrames = 0; // by the head, since this page was too slow (READER_LOST)
  leftOutPulses = 0;
  missing = 0; // pulses that the head delivered and this page did not receive, of scans whose final counts came
  #byOverruns = 0; // pulses that the head lost, by OVERRUN events
  #byScanEnds = 0; // the same, by the ends of scans; events of either kind may be missing
  #damaged = 0; // missing frames that no READER_LOST explains, and that were reported
  #unexplained = 0; // missing frames that no READER_LOST had explained at the last telemetry
  #scan = null;
  #isRunning = false;
  #t0_s = null; // start of the scan whose points came; null: none came
  #shots = 0; // pulses received before the scan
  #before = {scan: null, shots: 0}; // the pulses of a scan that past() brought
  #counts = null; // the last telemetry
  #due = null; // the scan, and pulses received, where SCAN_END came and the telemetry before it was lost
  #say;

  /** say(name, detail): 'lost' and 'scan', as Head's events. Events given to this class have `shots`, the pulses
   * received before them. */
  constructor(say) {
    this.#say = say;
  }

  /** Pulses that the head says it lost. */
  get byHead() {
    return Math.max(this.#byOverruns, this.#byScanEnds);
  }

  descriptor(d) {
    this.#begin(d.scan, d.shots);
  }

  /** Another sequence of frames begins: its scans may have the numbers of earlier ones. */
  restarted({shots}) {
    this.#begin(null, shots);
    this.#counts = null;
    this.#due = null;
    this.#before = {scan: null, shots: 0};
  }

  points(batch) {
    if (batch.scan !== this.#scan) return;
    this.#isRunning = true;
    this.#t0_s = batch.began_s;
  }

  /** Takes points that the head had kept. In a scan that this page joined late they then don't count as missing. */
  past({scan, shots}) {
    if (scan !== this.#before.scan) this.#before = {scan, shots: 0};
    this.#before.shots += shots;
    if (scan === this.#scan) this.#shots -= shots;
    if (scan === this.#due?.scan) this.#due.received += shots;
  }

  /** lost_frames: missing in the sequence so far. */
  telemetry(t, lost_frames) {
    this.#counts = t;
    if (t.scan === this.#due?.scan && STATES[t.state] !== 'scanning') {
      this.missing += t.scan_cast === null ? 0 : t.scan_cast - t.scan_lost - this.#due.received;
      this.#due = null;
    }
    if (t.scan !== this.#scan) this.#end(this.#scan, null, t.shots);
    else if (!IN_SCAN.includes(STATES[t.state])) this.#end(t.scan, t, t.shots);
    // READER_LOST may come after the jump that it explains. Frames that were unexplained at the telemetry before, and
    // still are, count as damage.
    const now = Math.max(0, lost_frames - this.leftOutFrames), sure = Math.min(now, this.#unexplained);
    if (sure > this.#damaged) this.#say('lost', {by: 'wire', frames: sure - this.#damaged, pulses: 0});
    this.#damaged = Math.max(this.#damaged, sure);
    this.#unexplained = now;
  }

  event(e) {
    switch (e.name) {
      case 'SCAN_START':
        if (this.#isAgain(e)) this.#restart(e);
        this.#begin(e.scan, e.shots);
        this.#isRunning = true;
        break;
      case 'SCAN_END':
        if (!this.#isRunning || e.scan !== this.#scan) this.#byScanEnds += e.lost;
        this.#end(e.scan, this.#final(e.scan) ?? {scan_fired: e.fired, scan_cast: null, scan_lost: e.lost}, e.shots);
        break;
      case 'STATE': // if SCAN_END was lost, the last telemetry has the counts, or else the next one
        if (STATES[e.before] === 'scanning' && this.#final(this.#scan)) this.#end(this.#scan, this.#counts, e.shots);
        break;
      case 'OVERRUN':
        this.#byOverruns += e.lost;
        if (e.lost > 0) this.#say('lost', {by: 'head', frames: 0, pulses: e.lost});
        break;
      case 'READER_LOST':
        this.leftOutFrames += e.frames;
        this.leftOutPulses += e.pulses;
        if (e.frames > 0) this.#say('lost', {by: 'link', frames: e.frames, pulses: e.pulses});
        break;
      default:
    }
  }

  #begin(scan, shots) {
    if (this.#scan === scan) return;
    this.#end(this.#scan, null, shots);
    this.#scan = scan;
    this.#t0_s = null;
    this.#shots = scan === this.#before.scan ? shots - this.#before.shots : shots;
  }

  // Whether a SCAN_START is of another scan with the number of the last one, which has another start: the head has
  // started again. The event of the last scan can come after its first points. Starts of points are rounded by less
  // than a microsecond.
  #isAgain(e) {
    if (this.#scan !== e.scan || this.#t0_s === null) return false;
    return Math.abs(Number(e.at_ns) * 1e-9 - this.#t0_s) > 1e-6;
  }

  #restart({shots}) {
    this.#end(this.#scan, this.#final(this.#scan), shots);
    this.#scan = this.#counts = this.#due = null;
    this.#before = {scan: null, shots: 0};
  }

  // The telemetry directly before SCAN_END, of state spin-down, has the final counts.
  #final(scan) {
    const t = this.#counts;
    return t !== null && t.scan === scan && STATES[t.state] === 'spin-down' ? t : null;
  }

  // counts: those of a telemetry, or of SCAN_END without the pulses cast; null: neither came. If this page joined the
  // scan late, the pulses before that are missing, too.
  #end(scan, counts, shots) {
    if (!this.#isRunning || scan !== this.#scan) return;
    this.#isRunning = false;
    const {scan_fired: fired = null, scan_cast: cast = null, scan_lost: lost = null} = counts ?? {};
    const received = shots - this.#shots, missing = cast === null ? null : cast - lost - received;
    this.#byScanEnds += lost ?? 0;
    this.missing += missing ?? 0;
    this.#due = counts !== null && cast === null ? {scan, received} : null;
    this.#say('scan', {scan, fired, cast, lost, received, missing});
  }
}
