/* SPDX-License-Identifier: MIT */
// This class gets the points from before this page came, or while it was away: the head stores the last ones, and
// gives them in pieces (GET /past, firmware_sim/app/studio/watch/README.md). The pieces hold frames of the stream with
// their own numbers. So each points frame is taken once, either from /past or from the connection.
//
// A live frame that can't be placed yet is left to /past. Frames of /past are left out if this connection brings them,
// or an earlier connection with the same run of the head brought them.
import {BESIDE_POINTS, Decoder, isBefore, LOCAL, Parser, POINTS} from './native.js';

const HEAD = 56, VERSION = 1;
const REST_MS = 20; // it waits so long between two pieces, since a scanning head has other work
// The head's observer reads the stream a little later than this page, or much later on a busy machine.
const AGAIN_MS = 100, NEWS_MS = 300, SELDOM_MS = 1000, PATIENCE_MS = 10000;

const sleep = (ms) => new Promise((done) => setTimeout(done, ms));

function readHead(bytes) {
  const view = new DataView(bytes);
  if (bytes.byteLength < HEAD || view.getUint32(0, false) !== 0x53485041 || view.getUint32(4, true) !== VERSION) return null;
  const u64 = (at) => Number(view.getBigUint64(at, true));
  return {run: view.getBigUint64(8, true), next: u64(16), end: u64(24), gone: u64(32), lost_frames: u64(40),
    next_seq: view.getUint32(48, true)};
}

export class Past {
  stats = {past_points: 0, past_pulses: 0, past_gone: 0, past_lost_frames: 0};
  unplaced = {points: 0, shots: 0}; // of live frames that were left to /past, where the head has no /past
  #left = {points: 0, shots: 0}; // of live frames that are left to /past
  #give;
  #hasRoom;
  #get;
  #url = null;
  #connection = 0;
  #isReading = false;
  #run = null;
  #at = 0; // it is the position in /past
  #last = null; // it is the number of the newest points frame that was taken
  #seen = null; // it is the same, from earlier connections only
  #first = null; // it is the number of the first live points frame that was taken
  #need = null; // it is the number of the newest frame that only /past brings
  #until_ms = 0; // after this time the page asks more seldom for frames that /past has not brought
  #news_ms = 0; // it is the time of the last piece with frames
  #wake = () => {}; // it ends the present rest between two pieces
  #takesLive = true;
  #takesPast = true;

  /** give(batch) takes points of the past. hasRoom() is false while the owner is late. get(url) returns a promise of
   * the bytes, or of null if the head has no /past. It fails where the head does not answer now. */
  constructor({give, hasRoom = () => true, get = getBytes}) {
    this.#give = give;
    this.#hasRoom = hasRoom;
    this.#get = get;
    this.#fresh();
  }

  get pointHash() {
    return this.decoder.pointHash;
  }

  #fresh() {
    this.#at = 0;
    this.#seen = null;
    if (this.#first === null) this.#last = null;
    this.decoder = new Decoder({points: (batch) => this.#give(Object.assign(batch, {past: true}))});
    this.parser = new Parser({frame: (frame) => this.#take(frame), notice: (notice) => this.decoder.notice(notice)});
  }

  /** A connection has begun; url is that of its /past. */
  start(url) {
    this.stop();
    this.#url = url;
    this.#seen = this.#last;
    this.#first = this.#need = null;
    this.#left = {points: 0, shots: 0};
    this.#read();
  }

  stop() {
    this.#connection++;
    this.#url = null;
    this.#isReading = false;
  }

  /** Returns whether a live frame goes to the decoder of live frames. canPlace: whether that decoder can place
   * points. */
  takes(frame, canPlace) {
    if (this.#url === null || frame.flags & LOCAL) return true;
    const {seq} = frame;
    if (this.#need === null) this.#wants((seq - 1) >>> 0);
    if (!BESIDE_POINTS.includes(frame.type)) return true;
    if (frame.type !== POINTS) return this.#takesLive; // it follows the points before
    const hasCome = this.#first === null && this.#last !== null && this.#last !== this.#seen && !isBefore(this.#last, seq);
    this.#takesLive = canPlace && !hasCome;
    if (this.#takesLive) {
      this.#first ??= seq;
      this.#last = seq;
    } else if (!hasCome) this.#leave(frame);
    return this.#takesLive;
  }

  #leave({seq, payload}) {
    const view = new DataView(payload.buffer, payload.byteOffset, payload.length);
    if (payload.length >= 40) {
      this.#left.shots += view.getUint32(32, true);
      this.#left.points += view.getUint32(36, true);
    }
    this.#wants(seq);
  }

  #wants(seq) {
    if (this.#need === null) {
      this.#until_ms = performance.now() + PATIENCE_MS;
      this.#wake();
    }
    this.#need = seq;
    this.#read();
  }

  #take(frame) {
    if (frame.type === POINTS) {
      const {seq} = frame;
      const isLive = this.#first !== null && !isBefore(seq, this.#first);
      this.#takesPast = !isLive && (this.#seen === null || isBefore(this.#seen, seq));
      if (this.#takesPast && (this.#last === null || isBefore(this.#last, seq))) this.#last = seq;
    }
    if (this.#takesPast || !BESIDE_POINTS.includes(frame.type)) this.decoder.take(frame);
  }

  // Reads /past up to the live frames that were left to it. Before the first live frame nothing says how much there is,
  // and a head at rest at the pace `fast` sends none. Then the page goes on asking as long as there is patience: the
  // head's observer may be late.
  async #read() {
    if (this.#isReading || this.#url === null) return;
    this.#isReading = true;
    const connection = this.#connection;
    try {
      await this.#readAll(() => connection === this.#connection);
    } catch {
      // A piece could not be taken. The next live frame that is left to /past begins anew.
    }
    if (connection === this.#connection) this.#isReading = false;
  }

  // Asks for the piece at #at, again while the head has no room for a request. A head that is gone ends the connection.
  async #piece(goesOn) {
    for (let wait_ms = AGAIN_MS; goesOn(); wait_ms = Math.min(2 * wait_ms, SELDOM_MS)) {
      try {
        return await this.#get(`${this.#url}?from=${this.#at}`);
      } catch {
        await sleep(wait_ms);
        this.#until_ms = performance.now() + PATIENCE_MS; // nobody can say yet that the head's keeper is late
      }
    }
    return null;
  }

  async #readAll(goesOn) {
    this.#until_ms = performance.now() + PATIENCE_MS;
    for (let atEnd = false; ;) {
      const bytes = await this.#piece(goesOn);
      // What comes after the end may be a new scan, and then the live frames go first.
      if (atEnd && this.#need === null && bytes !== null && bytes.byteLength > HEAD) await this.#rest(NEWS_MS);
      if (!goesOn()) return;
      const head = bytes === null ? null : readHead(bytes);
      if (head === null) return this.#hasNone();
      if (this.#run !== head.run) {
        const isOther = this.#run !== null;
        this.#run = head.run;
        if (isOther) { // these positions and numbers come from another run
          this.#fresh();
          continue;
        }
      }
      this.#push(bytes, head);
      const isAtEnd = head.next === head.end, isQuiet = this.#need === null;
      const hasNews = bytes.byteLength > HEAD;
      if (!isAtEnd || (isQuiet && hasNews)) this.#until_ms = performance.now() + PATIENCE_MS;
      else if (!isQuiet && isBefore(this.#need, head.next_seq)) return this.decoder.flush(true);
      if (hasNews) this.#news_ms = performance.now();
      const isLate = performance.now() > this.#until_ms, hasNoNews = performance.now() > this.#news_ms + NEWS_MS;
      if (isLate || (isQuiet && hasNoNews)) this.decoder.flush(true); // nothing follows the last frame, it seems
      if (isLate && isQuiet) return;
      atEnd = isAtEnd;
      await this.#rest(!isAtEnd ? REST_MS : isLate ? SELDOM_MS : AGAIN_MS);
      while (goesOn() && !this.#hasRoom()) await sleep(REST_MS);
      if (!goesOn()) return;
    }
  }

  #rest(ms) {
    return new Promise((done) => {
      this.#wake = done;
      setTimeout(done, ms);
    });
  }

  #push(bytes, head) {
    const {stats: d} = this.decoder;
    this.parser.push(new Uint8Array(bytes, HEAD));
    this.decoder.flush();
    this.#at = head.next;
    Object.assign(this.stats, {past_points: d.points, past_pulses: d.shots, past_gone: head.gone,
      past_lost_frames: head.lost_frames});
  }

  // The head has no /past, like all older heads: live frames that were left to /past stay without a place.
  #hasNone() {
    this.unplaced.points += this.#left.points;
    this.unplaced.shots += this.#left.shots;
    this.stop();
  }
}

async function getBytes(url) {
  const answer = await fetch(url);
  if (answer.status === 408 || answer.status === 503) throw new Error(`${url}: ${answer.status}`);
  return answer.ok ? answer.arrayBuffer() : null;
}
