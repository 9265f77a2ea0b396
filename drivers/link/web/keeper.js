/* SPDX-License-Identifier: MIT */
// This class keeps the frames of a connection as a recording (.shs): the frames as they came, one after the other. The
// class is pure, and runs in the worker that decodes.
import {LOCAL, REPEAT} from './native_parser.js';
import {crc32c} from './crc32c.js';

const HEADER = 28, PIECE = 4 << 20, MOST = 2 ** 31;
const FRONT = [1, 10, 2]; // descriptor, emitter, anchor: in this order they say what points mean

export class Keeper {
  bytes = 0;
  isOn = false;
  isFull = false; // the file is as long as it may be; further frames are not in it
  #front = new Map(); // it maps a type to the last frame of it
  #parts = [];
  #waiting = 0; // bytes of the parts that are not in the Blob yet
  #blob = new Blob([]);

  /** Takes a frame of the Parser. */
  take(frame) {
    const isFront = FRONT.includes(frame.type);
    if (!isFront && !this.isOn) return;
    const {buffer, byteOffset, length} = frame.payload;
    const bytes = new Uint8Array(buffer, byteOffset - HEADER, HEADER + length).slice();
    if (frame.type === FRONT[0] && !(frame.flags & REPEAT)) this.#front.clear(); // a new scan has another anchor
    if (isFront) this.#front.set(frame.type, bytes);
    if (this.isOn) this.#append(bytes);
  }

  /** Another connection begins, maybe with another head. */
  connect() {
    this.#front.clear();
  }

  /** Keeps frames from now on. A recording begins like the stream of a client that joins late: with the frames that say
   * what its points mean. */
  begin() {
    Object.assign(this, {bytes: 0, isOn: true, isFull: false});
    this.#parts = [];
    this.#waiting = 0;
    this.#blob = new Blob([]);
    for (const type of FRONT) if (this.#front.has(type)) this.#append(repeated(this.#front.get(type)));
  }

  /** Returns the recording as a Blob. */
  end() {
    this.isOn = false;
    const blob = new Blob([this.#blob, ...this.#parts]);
    this.#parts = [];
    this.#blob = new Blob([]);
    return blob;
  }

  // The browser may move what is in a Blob to its disk.
  #append(bytes) {
    if (this.bytes + bytes.length > MOST) this.isFull = true;
    if (this.isFull) return;
    this.#parts.push(bytes);
    this.bytes += bytes.length;
    this.#waiting += bytes.length;
    if (this.#waiting < PIECE) return;
    this.#blob = new Blob([this.#blob, ...this.#parts]);
    this.#parts = [];
    this.#waiting = 0;
  }
}

// Returns the same frame, marked as sent again, to one reader alone. Such a frame has no sequence number.
function repeated(frame) {
  const bytes = frame.slice(), view = new DataView(bytes.buffer);
  bytes[3] |= REPEAT | LOCAL;
  view.setUint32(8, 0, true);
  view.setUint32(24, crc32c(view, 0, 24), true);
  return bytes;
}
