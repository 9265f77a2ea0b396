/* SPDX-License-Identifier: MIT */
// Waveforms of pulses (WAVEFORMS.md). The newest frames are kept as they came, up to a limit in bytes; windows are
// decoded when somebody asks for those of a pulse.
import {readWavesHead, refuse} from './native_fields.js';

const HEAD = 32, RECORD = 28, MAX_SAMPLES = 4096, M_PER_NS = 0.5 * 0.299792458;
const KEPT_BYTES = 64 * 2 ** 20; // at 300,000 pulses per second of 64 samples each, the last 1.4 s

// Calls each(at, n) for each window: `at` is where its record begins, n is the number of its samples.
function walk(view, n_windows, each) {
  let at = HEAD;
  for (let i = 0; i < n_windows; i++) {
    if (view.byteLength - at < RECORD) refuse('fewer waveforms than the header says');
    const n = view.getUint16(at + 12, true), end = at + RECORD + 2 * (n + (n & 1));
    if (n === 0 || n > MAX_SAMPLES || end > view.byteLength) refuse('a window without samples, or longer than its frame');
    each(at, n);
    at = end;
  }
}

/** This class keeps the waveforms of the last pulses of a scan. */
export class Waves {
  #frames = []; // {view, from, to}: number of the first and of the last pulse, rising; #frames[#begin] is the oldest
  #begin = 0;
  #bytes = 0;
  #most;
  #scan = null;

  constructor(most = KEPT_BYTES) {
    this.#most = most;
  }

  /** Copies the payload. Returns how many samples the head has lost; throws Refused. */
  add(view, scan) {
    const head = readWavesHead(view);
    let from = Infinity, to = -1;
    walk(view, head.n_windows, (at) => {
      const pulse = Number(head.pulse0) + view.getUint32(at, true);
      from = Math.min(from, pulse);
      to = Math.max(to, pulse);
    });
    if (scan !== this.#scan || from < (this.#frames.at(-1)?.from ?? 0)) this.clear(); // another scan has begun
    this.#scan = scan;
    if (to >= 0) this.#keep({view: new DataView(view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength)), from, to});
    return head.n_lost;
  }

  clear() {
    this.#frames = [];
    this.#begin = this.#bytes = 0;
  }

  #keep(frame) {
    this.#frames.push(frame);
    this.#bytes += frame.view.byteLength;
    while (this.#bytes > this.#most && this.#begin < this.#frames.length - 1) {
      this.#bytes -= this.#frames[this.#begin].view.byteLength;
      this.#frames[this.#begin++] = null;
    }
    if (this.#begin > 1024 && 2 * this.#begin > this.#frames.length) {
      this.#frames.splice(0, this.#begin);
      this.#begin = 0;
    }
  }

  /** Returns the windows of a pulse of the last scan, or of `scan`, in order of range: [{rangeM0, stepM, samples:
   * Float32Array in units of the detection threshold, without the baseline}]. The list is empty if the head kept none,
   * or the windows are no longer here. */
  of(pulse, scan = this.#scan) {
    const found = [], frames = scan === this.#scan ? this.#frames : [];
    let low = Math.min(this.#begin, frames.length), high = frames.length; // the first frame that ends with this pulse or later
    while (low < high) {
      const middle = (low + high) >> 1;
      if (frames[middle].to < pulse) low = middle + 1;
      else high = middle;
    }
    for (; low < frames.length && frames[low].from <= pulse; low++) {
      const {view} = frames[low], head = readWavesHead(view), stepM = 1e-3 * head.sample_ps * M_PER_NS;
      const offset = pulse - Number(head.pulse0), base = head.baseline_16 / 16;
      walk(view, head.n_windows, (at, n) => {
        if (view.getUint32(at, true) !== offset) return;
        found.push({rangeM0: view.getUint32(at + 8, true) * stepM, stepM, samples: Float32Array.from({length: n},
          (_, k) => (view.getUint16(at + RECORD + 2 * k, true) - base) * head.count_signal)});
      });
    }
    return found;
  }
}
