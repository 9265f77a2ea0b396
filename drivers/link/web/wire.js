/* SPDX-License-Identifier: MIT */
// A Wire decodes one connection with a head. It runs in the page's worker (wire_worker.js), or in the page itself if
// that has no workers. It passes on frames and replies, many in one message, and reads no further until its owner has
// taken these (`ack`).
//
// There are two ways to read. A WebSocketStream is read when there is room. The rest stays with the head, which leaves
// out whole frames for this reader and says how many, or waits, as its link is set. A plain WebSocket can't be told to
// wait: the bytes would pile up in the browser. So it is always decoded at once, and batches that have no room are
// dropped here, and counted (dropped_points, dropped_shots).
import {Decoder, Parser} from './native.js';
import {Keeper} from './keeper.js';
import {Past} from './past.js';

const SUBPROTOCOL = 'scanhead-native-1';
const MAX_UNTAKEN = 3; // so many messages may be without the owner's `ack`
const MESSAGE_POINTS = 65536, MESSAGE_THINGS = 4096; // a message goes out once it has so many
const MESSAGE_MS = 30; // or after so long
const ANSWER_S = 10; // a head may take so long to answer
const OPENING_MS = 100; // a link may take so long to refuse a connection that it has accepted
const MAX_POINTS = 1 << 20; // so many wait for a message, if the reading can't stop
const ALWAYS = ['open', 'close', 'text', 'waves', 'kept']; // somebody waits for these: they are never dropped

export class Wire {
  #post;
  #socket = null;
  #things = []; // these are [name, value], in the order in which they came
  #points = 0;
  #transfer = [];
  #timer = 0;
  #untaken = 0;
  #room = null; // it resolves when the owner has taken enough
  #opening = 0; // the timer after which a connection counts as open; 0: it is open, or there is none
  #limit = 0; // the timer of ANSWER_S
  #number = 0; // it numbers the connection, so that late events of an older one are ignored
  #past = new Past({give: (batch) => this.#addPast(batch), hasRoom: () => this.#untaken < MAX_UNTAKEN});
  #pastUrl = null;
  #keeper = new Keeper();

  /** post(message, transfer) sends {connection, things, figures} to the owner. */
  constructor(post) {
    this.#post = post;
    this.#fresh();
  }

  /** The owner sends {connect: url, past: url of earlier points, or null}, {send: line}, {close: true}, {ack: true},
   * {keep: true or false}, or {wavesOf: pulse, scan}, which is answered by a thing `waves` {pulse, scan, windows}. */
  take(message) {
    if (message.connect !== undefined) this.#connect(message.connect, message.past ?? null);
    if (message.send !== undefined) this.#socket?.send(message.send);
    if (message.wavesOf !== undefined) this.#answerWaves(message.wavesOf, message.scan);
    if (message.close) this.#close();
    if (message.keep) this.#keeper.begin();
    if (message.keep === false) this.#addNow('kept', this.#keeper.end());
    if (message.ack) this.#taken();
  }

  // ---- connecting

  #fresh() {
    const hand = (name) => (value) => this.#add(name, value);
    // handCounted adds `shots`, the pulses received so far.
    const handCounted = (name) => (value) => this.#add(name, Object.assign(value, {shots: this.decoder.stats.shots}));
    this.decoder = new Decoder({points: (batch) => this.#addPoints(batch), descriptor: handCounted('descriptor'),
      anchor: hand('anchor'), emitter: hand('emitter'), names: hand('names'), lineEnd: hand('line-end'),
      telemetry: handCounted('telemetry'), event: handCounted('event'), poses: hand('poses'),
      refused: hand('refused'), restarted: handCounted('restarted')});
    this.parser = new Parser({text: hand('text'), notice: (notice) => this.decoder.notice(notice), frame: (frame) => {
      this.#keeper.take(frame);
      if (this.#past.takes(frame, this.decoder.canPlace)) this.decoder.take(frame);
    }});
    this.busy_ms = 0;
    this.dropped = {dropped_points: 0, dropped_shots: 0, dropped_things: 0};
  }

  #connect(url, past) {
    this.#close();
    this.#fresh();
    this.#keeper.connect();
    this.#pastUrl = past;
    this.#number++;
    const number = this.#number;
    const mine = (act) => (...values) => number === this.#number && this.#socket !== null && act(...values);
    const on = {
      open: mine(() => {
        clearTimeout(this.#limit);
        this.#opening = setTimeout(() => this.#open(), OPENING_MS);
      }),
      bytes: mine((bytes) => this.#bytes(bytes)),
      text: mine((text) => this.#text(text)),
      close: mine((code, reason) => this.#ended(code, reason)),
      room: () => this.#hasRoom(),
    };
    this.#limit = setTimeout(mine(() => {
      this.#close();
      this.#ended(1006, `no answer within ${ANSWER_S} s`);
    }), 1000 * ANSWER_S);
    this.#socket = typeof WebSocketStream === 'function' ? readStream(url, on) : readSocket(url, on);
  }

  // A connection counts as open once it has not been refused for a while: a link whose places are taken says so only
  // after connecting, and its reason would be lost if something were sent before.
  #open() {
    if (this.#opening === 0) return;
    clearTimeout(this.#opening);
    this.#opening = 0;
    this.#addNow('open', null);
    if (this.#pastUrl !== null) this.#past.start(this.#pastUrl);
  }

  #close() {
    this.#stopTimers();
    this.#past.stop();
    this.#socket?.close();
    this.#socket = null;
  }

  #stopTimers() {
    clearTimeout(this.#limit);
    clearTimeout(this.#opening);
    this.#opening = 0;
  }

  #ended(code, reason) {
    this.#stopTimers();
    this.#past.stop();
    this.#socket = null;
    this.parser.end();
    this.decoder.flush(true);
    this.#addNow('close', {code, reason});
  }

  // ---- receiving

  #bytes(bytes) {
    this.#open();
    const from_ms = performance.now();
    this.parser.push(bytes);
    this.busy_ms += performance.now() - from_ms;
    const held = this.decoder.columns.n;
    if (this.#points + held >= MESSAGE_POINTS || this.#things.length >= MESSAGE_THINGS) this.#send();
    else if (held > 0 || this.decoder.shots > 0) this.#later();
  }

  #answerWaves(pulse, scan) {
    this.#addNow('waves', {pulse, scan, windows: this.decoder.wavesOf(pulse, scan)});
  }

  // Takes one or more reply lines, with or without CR LF.
  #text(text) {
    this.#open();
    for (const line of text.split(/\r?\n/)) if (line !== '') this.#add('text', line);
    this.#send();
  }

  // Queues a thing after the points that came before it.
  #add(name, value) {
    this.decoder.flush();
    if (this.#things.length >= 4 * MESSAGE_THINGS && !ALWAYS.includes(name)) this.dropped.dropped_things++;
    else this.#things.push([name, value]);
    this.#later();
  }

  #addNow(name, value) {
    this.#add(name, value);
    this.#send();
  }

  #addPoints(batch) {
    if (this.#points + batch.n > MAX_POINTS) {
      this.dropped.dropped_points += batch.n;
      this.dropped.dropped_shots += batch.shots;
      return;
    }
    this.#things.push(['points', batch]);
    this.#points += batch.n;
    this.#transfer.push(batch.x.buffer);
  }

  // Live points that the decoder still holds came before this batch, so they are passed on first.
  #addPast(batch) {
    this.decoder.flush();
    this.#addPoints(batch);
    if (this.#points >= MESSAGE_POINTS) this.#send();
    else this.#later();
  }

  // ---- handing on

  #later() {
    if (this.#timer === 0) this.#timer = setTimeout(() => this.#send(), MESSAGE_MS);
  }

  #send() {
    clearTimeout(this.#timer);
    this.#timer = 0;
    if (this.#untaken >= MAX_UNTAKEN) return; // #taken sends
    const from_ms = performance.now();
    this.decoder.flush();
    this.busy_ms += performance.now() - from_ms;
    const message = {connection: this.#number, things: this.#things, figures: this.figures()};
    const transfer = this.#transfer;
    this.#things = [];
    this.#transfer = [];
    this.#points = 0;
    this.#untaken++;
    this.#post(message, transfer);
  }

  #taken() {
    this.#untaken--;
    if (this.#things.length > 0 || this.decoder.columns.n > 0) this.#send();
    if (this.#untaken < MAX_UNTAKEN && this.#room !== null) {
      this.#room();
      this.#room = null;
    }
  }

  // Returns null where there is room, else a promise that resolves once there is.
  #hasRoom() {
    if (this.#untaken < MAX_UNTAKEN) return null;
    return new Promise((resolve) => {
      this.#room = resolve;
    });
  }

  figures() {
    const {stats: p} = this.parser, {stats: d} = this.decoder;
    const {stats: past, unplaced} = this.#past;
    return {...p, ...d, ...this.dropped, ...past, past_hash: this.#past.pointHash,
      unplaced_points: d.unplaced_points + unplaced.points, unplaced_shots: d.unplaced_shots + unplaced.shots,
      kept_bytes: this.#keeper.bytes, kept_full: this.#keeper.isFull, point_hash: this.decoder.pointHash, waiting_points: this.#points,
      decode_ns_per_point: d.points > 0 ? (1e6 * this.busy_ms) / d.points : 0};
  }
}

// ---- the two ways to read; on: {open(), bytes(Uint8Array), text(string), close(code, reason), room()}

function readStream(url, on) {
  let writer = null, done = false;
  const stream = new WebSocketStream(url, {protocols: [SUBPROTOCOL]});
  const finish = (code, reason) => {
    if (!done) on.close(code, reason);
    done = true;
  };
  const read = async () => {
    const {readable, writable} = await stream.opened;
    writer = writable.getWriter();
    on.open();
    const reader = readable.getReader();
    for (;;) {
      const wait = on.room();
      if (wait !== null) await wait;
      const {value, done: isOver} = await reader.read();
      if (isOver) return;
      if (typeof value === 'string') on.text(value);
      else on.bytes(value instanceof ArrayBuffer ? new Uint8Array(value) : value);
    }
  };
  const failed = (error) => finish(error?.closeCode ?? 1006, error?.reason ?? '');
  const ended = () => stream.closed.then((info) => finish(info.closeCode ?? 1005, info.reason ?? ''), failed);
  read().catch(() => {}).finally(ended);
  return {
    send: (line) => writer?.write(line).catch(() => {}),
    close() {
      done = true;
      stream.close?.({closeCode: 1000});
    },
  };
}

function readSocket(url, on) {
  const socket = new WebSocket(url, [SUBPROTOCOL]);
  let done = false;
  const finish = (code, reason) => {
    if (!done) on.close(code, reason);
    done = true;
  };
  socket.binaryType = 'arraybuffer';
  socket.onopen = () => on.open();
  socket.onmessage = ({data}) => (typeof data === 'string' ? on.text(data) : on.bytes(new Uint8Array(data)));
  socket.onclose = ({code, reason}) => finish(code, reason);
  socket.onerror = () => setTimeout(() => finish(1006, ''), 100); // node 20 has no close event where nobody listens
  return {
    send: (line) => socket.readyState === 1 && socket.send(line),
    close() {
      done = true;
      socket.onopen = socket.onmessage = null;
      socket.close(1000);
    },
  };
}
