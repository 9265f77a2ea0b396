/* SPDX-License-Identifier: MIT */
// The points from before a page came (drivers/link/web/past.js). Each points frame is shown once, whichever way it
// comes, and whatever the page's connections did meanwhile. This file prints TAP on standard output. The stream is made
// here, with a keeper of it that answers as the head's does.
import {crc32c, LOCAL, Parser, REPEAT} from '../../drivers/link/web/native.js';
import {Cloud} from '../../drivers/link/web/cloud.js';
import {Head} from '../../drivers/link/web/head.js';
import {Losses} from '../../drivers/link/web/losses.js';
import {fetchJson} from '../../drivers/link/web/page.js';
import {Past} from '../../drivers/link/web/past.js';
import {readSamples, same as equal} from './page_rig.mjs';
import {runTests, test} from './page_tap.mjs';

// This makes a descriptor and an anchor of the polar layout, from the samples of the protocol.
const samples = readSamples();
const sampleOf = (type) => samples.find((s) => s[1] === type).subarray(28);
const DESCRIPTOR = 1, ANCHOR = 2, POINTS = 3, TELEMETRY = 5;

function frame(type, payload, seq, flags = 0) {
  const bytes = Buffer.alloc(28 + payload.length), view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  bytes.set([0xd5, type, 1, flags]);
  bytes.writeUInt32LE(payload.length, 4);
  bytes.writeUInt32LE(seq, 8);
  bytes.set(payload, 28);
  bytes.writeUInt32LE(crc32c(view, 28, 28 + payload.length), 12);
  bytes.writeUInt32LE(crc32c(view, 0, 24), 24);
  return bytes;
}

// One shot with one echo, as pulse k of the scan.
function shot(k) {
  const payload = Buffer.alloc(60);
  payload.writeUInt32LE(k, 8); // pulse0
  payload.writeUInt32LE(1, 32); // pulses
  payload.writeUInt32LE(1, 36); // records
  payload.writeInt32LE(100000 + k, 40);
  payload.writeUInt8(0x11, 40 + 19);
  return payload;
}

// A head's stream, from a number on, and the part that its keeper has.
class Stream {
  frames = [];
  kept = [];
  run = 1n;

  constructor(seq = 100) { this.seq = seq; }

  push(type, payload, flags = 0) {
    const bytes = frame(type, payload, this.seq, flags);
    this.frames.push(bytes);
    if (!(flags & REPEAT) && type !== TELEMETRY) this.kept.push(bytes);
    this.seq = (this.seq + 1) >>> 0;
    return bytes;
  }
  places(flags = 0) { return [this.push(DESCRIPTOR, sampleOf(DESCRIPTOR), flags), this.push(ANCHOR, sampleOf(ANCHOR), flags)]; }
  shots(from, to) { return Array.from({length: to - from}, (_, i) => this.push(POINTS, shot(from + i))); }
  telemetry() { return [this.push(TELEMETRY, sampleOf(TELEMETRY))]; }

  // This makes the body of /past, with a frame in each piece.
  get = async (url) => {
    const at = Number(url.split('=')[1]), head = Buffer.alloc(56), end = this.keeps ?? this.kept.length;
    const piece = at < end ? this.kept[at] : Buffer.alloc(0);
    head.write('SHPA', 'latin1');
    head.writeUInt32LE(1, 4);
    head.writeBigUInt64LE(this.run, 8);
    head.writeBigUInt64LE(BigInt(Math.min(end, at + 1)), 16);
    head.writeBigUInt64LE(BigInt(end), 24);
    head.writeUInt32LE(end > 0 ? (this.kept[end - 1].readUInt32LE(8) + 1) >>> 0 : 0, 48);
    if (this.keeps === undefined) head.writeUInt32LE(this.seq, 48);
    const body = Buffer.concat([head, piece]);
    return body.buffer.slice(body.byteOffset, body.byteOffset + body.length);
  };
}

// A page as wire.js makes one. Live frames go through `takes`.
const pages = [];
class Page {
  pulses = []; // shown, in the order in which they came
  live = 0;

  constructor(stream) {
    this.past = new Past({give: ({pulse0, n}) => { for (let i = 0; i < n; i++) this.pulses.push(pulse0 + i); }, get: (url) => this.stream.get(url)});
    this.stream = stream;
    pages.push(this);
    this.connect();
  }
  connect(stream = this.stream) {
    this.stream = stream;
    this.places = {[DESCRIPTOR]: false, [ANCHOR]: false};
    this.parser = new Parser({frame: (f) => {
      if (!this.past.takes(f, this.places[DESCRIPTOR] && this.places[ANCHOR])) return;
      if (f.type in this.places) this.places[f.type] = true;
      if (f.type !== POINTS) return;
      this.live++;
      this.pulses.push(Number(new DataView(f.payload.buffer, f.payload.byteOffset).getBigUint64(8, true)));
    }});
    this.past.start('x');
  }
  take(frames) { for (const bytes of frames) this.parser.push(new Uint8Array(bytes)); }

  // Each of the pulses is shown once, after a while. A pulse more, or one twice, fails at once.
  async shows(from, to, what) {
    const until = Date.now() + 30000;
    while (this.pulses.length < to - from && Date.now() < until) await new Promise((done) => setTimeout(done, 5));
    equal([...this.pulses].sort((a, b) => a - b), Array.from({length: to - from}, (_, i) => from + i), what);
  }
}

test('a page that comes after the scan has all of it, without any live frame', async () => {
  const stream = new Stream();
  stream.places();
  stream.shots(0, 30);
  const page = new Page(stream);
  await page.shows(0, 30, 'pulses');
  equal([page.live, page.past.stats.past_points, page.past.stats.past_pulses], [0, 30, 30], 'live, points, pulses');
});

test('a page that joins within a scan has each pulse once, over the end of the numbers', async () => {
  const stream = new Stream(2 ** 32 - 20);
  stream.places();
  stream.shots(0, 30);
  const page = new Page(stream);
  page.take(stream.shots(30, 40)); // before it can be placed
  page.take(stream.places(REPEAT));
  page.take(stream.shots(40, 50));
  await page.shows(0, 50, 'pulses');
  equal(page.live, 10, 'live ones');
});

test('the keeper may be slower than the connection', async () => {
  const stream = new Stream();
  stream.places();
  stream.shots(0, 20);
  stream.keeps = 8;
  const page = new Page(stream);
  page.take(stream.telemetry());
  await page.shows(0, 5, 'what is kept so far'); // attributes of the last may follow
  stream.keeps = undefined;
  await page.shows(0, 20, 'all');
});

test('the keeper may be slower than a page whose head is at rest, and sends nothing', async () => {
  const stream = new Stream();
  stream.places();
  stream.shots(0, 20);
  stream.keeps = 8;
  const page = new Page(stream);
  await page.shows(0, 6, 'what is kept so far');
  stream.keeps = undefined;
  await page.shows(0, 20, 'all');
});

test('the keeper may be later than anyone waits in patience, on a busy machine', async () => {
  const stream = new Stream(), {now} = performance;
  let later_ms = 0;
  performance.now = () => now.call(performance) + later_ms;
  try {
    stream.places();
    stream.shots(0, 20);
    stream.keeps = 8;
    const page = new Page(stream);
    page.take(stream.telemetry());
    await page.shows(0, 5, 'what is kept so far');
    later_ms = 3600000;
    await page.shows(0, 6, 'the last that is kept, which waits for its attributes until then');
    stream.keeps = undefined;
    await page.shows(0, 20, 'all');
  } finally {
    performance.now = now;
  }
});

test('a head that has no room for a request is asked again', async () => {
  const stream = new Stream(), {get} = stream;
  let refused = 0;
  stream.places();
  stream.shots(0, 20);
  stream.get = async (url) => {
    if (refused < 4 && url.endsWith(`=${refused}`)) throw new Error(`refused ${++refused}`);
    return get(url);
  };
  const page = new Page(stream);
  page.take(stream.telemetry());
  await page.shows(0, 20, 'all');
  equal(refused, 4, 'requests that were refused');
});

test('what /past had already does not count again when it comes live', async () => {
  const stream = new Stream();
  const places = stream.places();
  const live = stream.shots(0, 10);
  const page = new Page(stream);
  await page.shows(0, 10, 'pulses from before');
  page.take(places);
  page.take(live.slice(5));
  page.take(stream.shots(10, 15));
  await page.shows(0, 15, 'all');
  equal(page.live, 5, 'live ones');
});

test('after a break it gets what it missed, and nothing that it had', async () => {
  const stream = new Stream();
  const page = new Page(stream);
  page.take(stream.places());
  page.take(stream.shots(0, 10));
  page.past.stop();
  stream.shots(10, 20);
  page.connect();
  page.take(stream.places(REPEAT));
  page.take(stream.shots(20, 30));
  await page.shows(0, 30, 'pulses');
  equal([page.live, page.past.stats.past_pulses], [20, 10], 'live ones, and from before');
});

test('another run of the head begins anew', async () => {
  const first = new Stream();
  first.places();
  first.shots(0, 10);
  const page = new Page(first);
  await page.shows(0, 10, 'of the first');
  page.past.stop();
  const second = new Stream(3); // its numbers and its pulses are not those of the first
  second.run = 2n;
  second.places();
  second.shots(0, 5);
  page.pulses.length = 0;
  page.connect(second);
  page.take(second.places(REPEAT));
  page.take(second.shots(5, 8));
  await page.shows(0, 8, 'of the second');
});

test('where the head keeps nothing, what can not be placed is counted', async () => {
  const stream = new Stream(), page = new Page(stream);
  stream.get = async () => null;
  page.past.start('x');
  page.take([...stream.shots(0, 4), frame(TELEMETRY, sampleOf(TELEMETRY), 0, LOCAL)]);
  for (let i = 0; i < 100 && page.past.unplaced.points === 0; i++) await new Promise((done) => setTimeout(done, 5));
  equal([page.pulses.length, page.past.unplaced.points, page.past.unplaced.shots], [0, 4, 4], 'shown, and without a place');
});

test('pulses from before are not missing at the end of their scan, whichever comes first', () => {
  for (const early of [true, false]) {
    const said = [], losses = new Losses((name, detail) => said.push([name, detail]));
    if (early) losses.past({scan: 2, shots: 70});
    losses.descriptor({scan: 2, shots: 5});
    losses.points({scan: 2});
    if (!early) losses.past({scan: 2, shots: 70});
    losses.past({scan: 1, shots: 1000});
    losses.telemetry({scan: 2, state: 5, scan_fired: 100, scan_cast: 100, scan_lost: 0, shots: 35}, 0);
    losses.event({name: 'SCAN_END', scan: 2, fired: 100, lost: 0, shots: 35});
    equal(said, [['scan', {scan: 2, fired: 100, cast: 100, lost: 0, received: 100, missing: 0}]], early ? 'before' : 'after');
  }
});

// n points of a scan.
const batch = (n, station, scan, more = {}) => {
  const f = () => new Float64Array(n);
  return {n, shots: n, scan, station, frame: 0, line: 0, pulse0: 0, x: f(), y: f(), z: f(), pulse: f(), t: f(), range: f(), reflectance: f(),
    amplitude: f(), label: new Uint16Array(n), echo: new Uint8Array(n), echoes: new Uint8Array(n), rgb: null, ...more};
};
const take = (cloud, b) => cloud.replace(b) && cloud.add(b);
const held = (cloud) => cloud.blocks.map(({station, scan, n}) => [station, scan, n]);

test('a scan takes the place of those that its station made before, and of no others', () => {
  const cloud = new Cloud();
  take(cloud, batch(3, 1, 1));
  take(cloud, batch(4, 2, 2));
  take(cloud, batch(5, 1, 3));
  take(cloud, batch(6, 1, 3));
  equal([held(cloud), cloud.count, cloud.total, cloud.gone], [[[2, 2, 4], [1, 3, 11]], 15, 18, 3], 'blocks, count, total, gone');
  equal(take(cloud, batch(2, 1, 1, {past: true})), false, 'an older one that comes late');
  take(cloud, batch(2, 3, 1, {past: true}));
  equal(held(cloud), [[2, 2, 4], [1, 3, 11], [3, 1, 2]], 'of another station it is taken');
});

test('of a head that has started again, the same number is another scan', () => {
  const cloud = new Cloud();
  take(cloud, batch(3, 1, 1));
  take(cloud, batch(3, 2, 2));
  const came = cloud.cut();
  take(cloud, batch(4, 1, 1)); // before the page knows
  cloud.outdate(came);
  take(cloud, batch(4, 1, 1));
  equal(held(cloud), [[2, 2, 3], [1, 1, 8]], 'blocks');
});

// ---- a head without room

test('a page asks a busy head for its description again, and takes a refusal for what it is', async () => {
  const {fetch} = globalThis, asked = [];
  const answers = (...list) => {
    asked.length = 0;
    globalThis.fetch = async (path) => {
      asked.push(path);
      const status = list.shift();
      if (status === 0) throw new TypeError('fetch failed');
      const bytes = new TextEncoder().encode(status === 200 ? '{"run": 7}' : 'no');
      return {ok: status === 200, status, arrayBuffer: async () => bytes.buffer};
    };
  };
  try {
    answers(503, 0, 200);
    equal(await fetchJson('/head'), {run: 7}, 'after a refusal and a broken connection');
    equal(asked, ['/head', '/head', '/head'], 'requests');
    answers(404, 200);
    equal(await fetchJson('/plan'), null, 'a head without a plan');
    equal(asked, ['/plan'], 'requests');
  } finally {
    globalThis.fetch = fetch;
  }
});

// ---- the connection's end

test('commands that wait fail when the worker does, since the replies of the next connection are not theirs', async () => {
  let worker;
  globalThis.Worker = class {
    constructor() { worker = this; }
    postMessage() {}
    terminate() {}
  };
  const head = new Head('ws://head/ws', {worker: true}), closed = [];
  delete globalThis.Worker;
  head.addEventListener('close', ({detail}) => closed.push(detail.words));
  worker.onmessage({data: {connection: 1, things: [['open', null]], figures: {}}});
  const answer = head.command('HEAD:PRR?').catch(({text}) => text);
  worker.onerror({});
  equal(closed.join(), 'this page failed to read the stream', 'closed');
  equal(await answer, closed[0], 'the command');
  head.close();
});

await runTests();
for (const {past} of pages) past.stop(); // a page without a live frame asks on and on
