/* SPDX-License-Identifier: MIT */
// This module splits bytes into frames and reply lines, by PROTOCOL.md (*Frames*) and LOSSES.md (*Resynchronisation*).
// The module is pure: it needs no page and no network.
import {crc32c} from './crc32c.js';
import {Sequence} from './native_sequence.js';

const SYNC = 0xd5, HEADER = 28, MAX_PAYLOAD = 65536, MAX_TEXT = 512;
export const REPEAT = 1, LOCAL = 2;
const GOOD = 1, WAIT = 2, BAD = 3;

/** A frame. `payload` and `t_ns` (BigInt, device time) read the parser's bytes: they are good until the parser's
 * callback for the frame returns. */
class Frame {
  #view;
  #at;
  constructor(view, at, length) {
    this.#view = view;
    this.#at = at;
    this.type = view.getUint8(at + 1);
    this.version = view.getUint8(at + 2);
    this.flags = view.getUint8(at + 3);
    this.length = length;
    this.seq = view.getUint32(at + 8, true);
    this.payload_crc = view.getUint32(at + 12, true);
    this.payload = new Uint8Array(view.buffer, view.byteOffset + at + HEADER, length);
  }
  get t_ns() {
    return this.#view.getBigInt64(this.#at + 16, true);
  }
}

const isPrintable = (byte) => byte >= 0x20 && byte <= 0x7e;

/** A Parser takes bytes as they come. It keeps the bytes of a frame or line that is not whole yet. These are fewer than
 * the longest frame has: a header, and 64 KiB of payload. */
export class Parser {
  /** Callbacks, each of which may be left out: frame(frame), text(line without its end), notice({kind, at_byte, seq,
   * n, t_ns}). A notice comes before the frame or text that follows the damage. kind is gap, repeated, late, restarted,
   * bad payload, bad bytes or cut; drivers/host/scanhead.h explains the rest. t_ns is a BigInt, or null before the
   * first frame. */
  constructor({frame, text, notice} = {}) {
    this.onFrame = frame ?? (() => {});
    this.onText = text ?? (() => {});
    this.onNotice = notice ?? (() => {});
    this.stats = {bytes: 0, frames: 0, texts: 0, bad_bytes: 0, bad_payloads: 0, jumps: 0, jumps_back: 0,
      lost_frames: 0, repeated_frames: 0, late_frames: 0, cuts: 0};
    this.kept = new Uint8Array(0); // room
    this.n = 0; // bytes kept in it
    this.inStep = true;
    this.sequence = new Sequence();
    this.bad = null; // bytes that belong to nothing, and for which there is no notice yet
    this.last_t_ns = null; // of the last whole frame
  }

  /** Takes a Uint8Array (or Buffer), of any size. The array is read only within this call. */
  push(bytes) {
    this.stats.bytes += bytes.length;
    if (this.n === 0) {
      this.#keep(bytes, this.#parse(bytes, bytes.length, false));
      return;
    }
    const all = this.#append(bytes);
    const used = this.#parse(all, this.n, false);
    if (used > 0) all.copyWithin(0, used, this.n);
    this.n -= used;
  }

  /** Nothing more will come, as at the end of a recording: what is kept is searched for frames. */
  end() {
    const n = this.n;
    this.n = 0;
    this.#parse(this.kept, n, true);
    this.#endBad(true);
    this.inStep = true;
  }

  #append(bytes) {
    const need = this.n + bytes.length;
    if (need > this.kept.length) {
      const larger = new Uint8Array(Math.max(need, 2 * this.kept.length));
      larger.set(this.kept.subarray(0, this.n));
      this.kept = larger;
    }
    this.kept.set(bytes, this.n);
    this.n = need;
    return this.kept;
  }

  #keep(bytes, from) {
    if (from === bytes.length) return;
    this.n = 0;
    this.#append(bytes.subarray(from));
  }

  // Returns how many of the n bytes are done with.
  #parse(bytes, n, last) {
    const view = new DataView(bytes.buffer, bytes.byteOffset, n);
    this.from = this.stats.bytes - n; // where the first of them stands in all bytes
    let at = 0;
    while (at < n) {
      let look = BAD, length = 0;
      if (bytes[at] === SYNC) {
        look = this.#lookFrame(view, at, n);
        length = look === GOOD ? HEADER + view.getUint32(at + 4, true) : 0;
        if (look === GOOD) this.#takeFrame(view, at, length);
      } else if (this.inStep && isPrintable(bytes[at])) {
        [look, length] = this.#lookText(bytes, at, n);
        if (look === GOOD) this.#takeText(bytes, at, length - 2);
      }
      if (look === WAIT && !last) return at;
      if (look === WAIT) this.#beginCut(view, at, n);
      at = look === GOOD ? at + length : this.#skip(bytes, at, n);
    }
    return n;
  }

  #lookFrame(view, at, n) {
    if (n - at < HEADER) return WAIT;
    const length = view.getUint32(at + 4, true), begin = at + HEADER;
    if (length > MAX_PAYLOAD || crc32c(view, at, at + 24) !== view.getUint32(at + 24, true)) return BAD;
    if (n - begin < length) return WAIT;
    if (crc32c(view, begin, begin + length) === view.getUint32(at + 12, true)) return GOOD;
    this.stats.bad_payloads++;
    this.#beginBadFrame('bad payload', view, at);
    return BAD;
  }

  #takeFrame(view, at, length) {
    const frame = new Frame(view, at, length - HEADER);
    this.#endBad(false);
    this.inStep = true;
    this.last_t_ns = frame.t_ns;
    const kind = this.sequence.take(frame);
    if (kind !== '') this.#noticeNumber(kind, at);
    if (kind === 'repeated' || kind === 'late') return;
    this.stats.frames++;
    this.onFrame(frame);
  }

  #noticeNumber(kind, at) {
    const {first: seq, n} = this.sequence, s = this.stats;
    s.jumps += kind === 'gap' || kind === 'restarted' ? 1 : 0;
    s.jumps_back += kind === 'restarted' ? 1 : 0; // the head has started again: how much is missing isn't known
    s.lost_frames += kind === 'gap' ? n : 0;
    s.repeated_frames += kind === 'repeated' ? 1 : 0;
    s.late_frames += kind === 'late' ? 1 : 0;
    this.onNotice({kind, at_byte: this.from + at, seq, n, t_ns: this.last_t_ns});
  }

  // ---- bytes that belong to nothing

  #beginBad(kind, at_byte, t_ns = this.last_t_ns, seq = -1, most = Infinity) {
    this.#endBad(false);
    this.bad = {kind, at_byte, t_ns, seq, most, n: 0};
  }

  // The header at hand is right, but its payload is wrong, or is cut off by the end.
  #beginBadFrame(kind, view, at) {
    this.#beginBad(kind, this.from + at, view.getBigInt64(at + 16, true), view.getUint32(at + 8, true),
      HEADER + view.getUint32(at + 4, true));
  }

  // No more bytes will come, and what is at hand is not whole.
  #beginCut(view, at, n) {
    if (view.getUint8(at) === SYNC && n - at >= HEADER) this.#beginBadFrame('cut', view, at);
    else if (!this.bad || this.bad.n === this.bad.most) this.#beginBad('cut', this.from + at);
  }

  // Bytes beyond the length of a broken frame give a notice of their own.
  #addBad(at_byte, n) {
    this.stats.bad_bytes += n;
    const own = this.bad ? Math.min(n, this.bad.most - this.bad.n) : 0;
    if (own > 0) this.bad.n += own;
    if (own === n) return;
    this.#beginBad('bad bytes', at_byte + own);
    this.bad.n = n - own;
  }

  // Gives the notice of the bad bytes at hand. A frame, a line or bad bytes of another notice follow them; with atEnd
  // no more bytes follow. A frame that seemed to be cut by the end is a broken one if anything else stood within its
  // length.
  #endBad(atEnd) {
    if (!this.bad) return;
    const {at_byte, n, seq, t_ns} = this.bad;
    let {kind} = this.bad;
    this.bad = null;
    if (kind === 'cut' && !atEnd) {
      kind = seq < 0 ? 'bad bytes' : 'bad payload';
      this.stats.bad_payloads += seq < 0 ? 0 : 1;
    }
    this.stats.cuts += kind === 'cut' ? 1 : 0;
    this.onNotice({kind, at_byte, seq: Math.max(0, seq), n, t_ns});
  }

  #lookText(bytes, at, n) {
    let end = at;
    while (end < n && end - at < MAX_TEXT - 2 && isPrintable(bytes[end])) end++;
    if (end < n && bytes[end] !== 0x0d) return [BAD, 0];
    if (end + 1 < n) return [bytes[end + 1] === 0x0a ? GOOD : BAD, end + 2 - at];
    return [WAIT, 0];
  }

  #takeText(bytes, at, length) {
    this.#endBad(false);
    this.stats.texts++;
    this.onText(String.fromCharCode(...bytes.subarray(at, at + length)));
  }

  // Counts bytes as bad up to the next sync byte, and returns its place.
  #skip(bytes, at, n) {
    const sync = bytes.indexOf(SYNC, at + 1);
    const to = sync < 0 || sync > n ? n : sync;
    this.inStep = false;
    this.#addBad(this.from + at, to - at);
    return to;
  }
}
