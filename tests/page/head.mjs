/* SPDX-License-Identifier: MIT */
// This runs the program under test: heads with their ready line, and recordings. The TCP client here shares nothing
// with the page.
import {spawn, spawnSync} from 'node:child_process';
import {createConnection} from 'node:net';
import {forget, remember} from './work.mjs';

export const PROGRAM = process.env.SCANHEAD || 'build/scanhead';
const DEADLINE_MS = 300000; // only an endless wait reaches this

/** Starts the program (`run`, `view`) and waits for its ready line. The program is killed when this process ends. */
export async function start(args, {nice = 0} = {}) {
  const child = spawn('nice', ['-n', String(nice), 'setpriv', '--pdeathsig', 'KILL', PROGRAM, ...args, '--ready-fd', '3'],
    {stdio: ['ignore', 'pipe', 'pipe', 'pipe']});
  const head = {child, said: '', errors: '', code: null};
  remember(child.pid);
  head.ended = new Promise((done) => child.once('close', (code, signal) => done(code ?? signal)).once('error', done));
  head.ended.then((code) => (forget(child.pid), head.code = code));
  child.stdout.on('data', (text) => (head.said += text));
  child.stderr.on('data', (text) => (head.errors += text));
  head.ready = await new Promise((done, fail) => {
    let line = '';
    const timer = setTimeout(() => fail(new Error(`no ready line in ${DEADLINE_MS} ms`)), DEADLINE_MS);
    child.stdio[3].on('data', (text) => {
      line += text;
      if (line.includes('\n')) clearTimeout(timer), done(JSON.parse(line));
    });
    head.ended.then(() => (clearTimeout(timer), fail(new Error(`it ended: ${head.errors}`))));
  });
  return head;
}

/** Returns the endpoint of the head's first link of a type. */
export function endpoint(head, type) {
  return head.ready.endpoints.find((link) => link.type === type).endpoint;
}

/** Ends the head with a signal. Returns its exit status, or the signal that ended it. */
export function end(head, signal = 'SIGTERM') {
  head.child.kill(signal);
  return head.ended;
}

/** Runs the program to its end and returns its output. A status other than 0 is an error. */
export function run(...args) {
  const {status, stdout, stderr} = spawnSync(PROGRAM, args, {encoding: 'utf8'});
  if (status !== 0) throw new Error(`${args.join(' ')}: ${stderr}`);
  return stdout;
}

/** A client of the head. It sends command lines and takes their replies, and skips frames by their length. */
export class Client {
  #rest = Buffer.alloc(0);
  #waiting = [];

  constructor(endpoint) {
    const [, host, port] = endpoint.match(/^tcp:(.*):(\d+)$/);
    this.socket = createConnection(Number(port), host);
    this.socket.once('connect', () => (this.name = `tcp ${host}:${this.socket.localPort}`));
    this.socket.on('data', (bytes) => this.#read(bytes)).on('error', () => {});
    this.closed = new Promise((done) => this.socket.once('close', done));
    this.closed.then(() => this.#waiting.splice(0).forEach((done) => done('the head is gone')));
  }

  ask(line) {
    if (this.socket.closed) return Promise.resolve('the head is gone');
    return new Promise((done, fail) => {
      const timer = setTimeout(() => fail(new Error(`${line}: no reply`)), DEADLINE_MS);
      this.#waiting.push((reply) => (clearTimeout(timer), done(reply)));
      this.socket.write(`${line}\n`);
    });
  }

  /** Asks again until the reply satisfies. There is a short pause between two questions. */
  async until(line, satisfies, limit_ms = DEADLINE_MS) {
    const last = Date.now() + limit_ms;
    for (;;) {
      const reply = await this.ask(line);
      if (satisfies(reply)) return reply;
      if (Date.now() > last) throw new Error(`${line}: still ${reply} after ${limit_ms} ms`);
      await new Promise((done) => setTimeout(done, 20));
    }
  }

  close() {
    this.socket.destroy();
  }

  #read(bytes) {
    this.#rest = Buffer.concat([this.#rest, bytes]);
    let at = 0;
    for (const b = this.#rest; at < b.length; ) {
      if (b[at] === 0xd5) {
        if (at + 28 > b.length || at + 28 + b.readUInt32LE(at + 4) > b.length) break;
        at += 28 + b.readUInt32LE(at + 4);
      } else {
        const next = b.indexOf('\r\n', at);
        if (next < 0) break;
        this.#waiting.shift()?.(b.toString('latin1', at, next));
        at = next + 2;
      }
    }
    this.#rest = this.#rest.subarray(at);
  }
}
