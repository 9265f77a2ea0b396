/* SPDX-License-Identifier: MIT */
// This module finds missing, repeated and late frames by their sequence numbers, as LOSSES.md defines them.
// The limits are libscanhead's: how many frames and gaps are remembered, how many frames such a gap may have, and how
// many late frames in a row count as another sequence.
const SEEN = 256, GAPS = 64, GAP_MOST = 65536, LATE_RUN = 256;
const LOCAL = 2;

/** Returns whether number a comes before b, modulo 2^32. */
export const isBefore = (a, b) => ((a - b) >>> 0) >= 2 ** 31;

/** Takes the headers of whole frames, one after the other. */
export class Sequence {
  #next = -1; // -1: none came yet
  #n = 0; // frames seen
  #seq = new Uint32Array(SEEN);
  #crc = new Uint32Array(SEEN);
  #length = new Uint32Array(SEEN);
  #kind = new Uint32Array(SEEN); // type and flags
  #t_ns = new BigInt64Array(SEEN);
  #gaps = []; // {first, n}
  #local = null; // the frame before, if it was LOCAL
  #lastLate = 0;
  #lateRun = 0; // late frames in a row, up to #lastLate
  first = 0;
  n = 1;

  /** Returns '', or a notice about the frame: 'gap': `n` frames are missing from number `first` on; 'restarted':
   * another sequence begins; 'repeated' or 'late': the frame is to be dropped. Except for a gap, `first` is the frame's
   * own number. */
  take(frame) {
    const {seq} = frame;
    this.first = seq;
    this.n = 1;
    if (frame.flags & LOCAL) return this.#takeLocal(frame);
    this.#local = null;
    const notice = this.#next < 0 || seq === this.#next ? '' : this.#jump(frame);
    if (notice === 'repeated') return notice;
    this.#remember(frame);
    if (notice === 'late') return notice;
    this.#next = (seq + 1) >>> 0;
    this.#lateRun = 0;
    return notice;
  }

  #takeLocal({type, flags, length, payload_crc, t_ns}) {
    const l = this.#local;
    const same = l && l.type === type && l.flags === flags && l.length === length && l.payload_crc === payload_crc && l.t_ns === t_ns;
    this.#local = {type, flags, length, payload_crc, t_ns};
    return same ? 'repeated' : '';
  }

  #jump(frame) {
    const {seq} = frame, missing = (seq - this.#next) >>> 0;
    if (missing < 2 ** 31) {
      this.first = this.#next;
      this.n = missing;
      this.#addGap(this.#next, missing);
      return 'gap';
    }
    if (this.#hasCome(frame)) return 'repeated';
    if (this.#fillsGap(seq) && !this.#isRun(seq)) return 'late';
    this.#n = 0;
    this.#gaps = [];
    return 'restarted';
  }

  #fillsGap(seq) {
    for (const gap of this.#gaps) {
      const before = (seq - gap.first) >>> 0;
      if (before >= gap.n) continue;
      const rest = gap.n - before - 1;
      gap.n = before;
      // A frame within a gap leaves two parts. Adding the second part drops the oldest gap if there is no room. If the
      // oldest gap is the first part, it becomes the newest, so that it stays.
      if (this.#gaps.length === GAPS && gap === this.#gaps[0]) this.#gaps.push(this.#gaps.shift());
      this.#addGap((seq + 1) >>> 0, rest);
      return true;
    }
    return false;
  }

  // Returns whether LATE_RUN late frames came in a row. Such frames are another sequence, whose numbers all lie in
  // gaps.
  #isRun(seq) {
    this.#lateRun = this.#lateRun > 0 && seq === (this.#lastLate + 1) >>> 0 ? this.#lateRun + 1 : 1;
    this.#lastLate = seq;
    return this.#lateRun === LATE_RUN;
  }

  #addGap(first, n) {
    if (n === 0 || n > GAP_MOST) return;
    if (this.#gaps.length === GAPS) this.#gaps.shift();
    this.#gaps.push({first, n});
  }

  #remember(frame) {
    const i = this.#n++ % SEEN;
    this.#seq[i] = frame.seq;
    this.#crc[i] = frame.payload_crc;
    this.#length[i] = frame.length;
    this.#kind[i] = frame.type | frame.flags << 8;
    this.#t_ns[i] = frame.t_ns;
  }

  #hasCome(frame) {
    const kind = frame.type | frame.flags << 8;
    for (let i = 0; i < Math.min(this.#n, SEEN); i++) {
      if (this.#seq[i] === frame.seq && this.#crc[i] === frame.payload_crc && this.#kind[i] === kind &&
          this.#length[i] === frame.length && this.#t_ns[i] === frame.t_ns) return true;
    }
    return false;
  }
}
