/* SPDX-License-Identifier: MIT */
// This class sends command lines and assigns the replies, by COMMANDS.md: each line has one reply, in the order of the
// lines. A reply that did not come in time may still come. So the head is then asked *IDN?, and all replies before the
// answer to that are dropped (*Old replies on a serial line*).

/** A command that the head refused. number: SCPI's, text: the head's words. */
export class CommandError extends Error {
  constructor(line, number, text) {
    super(`${line}: ${text} (${number})`);
    this.name = 'CommandError';
    this.number = number;
    this.text = text;
  }
}

const isIdentity = (reply) => reply.slice(reply.lastIndexOf(',') + 1).startsWith('scanhead native ');
const LATER_MS = 200; // where several *IDN? have no answer yet, each further answer may take this long

export class Replies {
  #send;
  #asked = []; // these lines, {line, timeout_s, resolve, reject, timer}, are sent; only the timer of the first one runs
  #waiting = []; // these are not sent yet, since the order of replies isn't known at the moment; all timers run
  #settling = null; // its {left} counts answers to *IDN? that have not come yet
  #isOpen = false;
  #timer = 0;

  /** send(line) sends to the head. */
  constructor(send) {
    this.#send = send;
  }

  open() {
    this.#isOpen = true;
    this.#settling = null;
  }

  /** The connection is gone: all open commands fail with these words. */
  close(words) {
    this.#isOpen = false;
    this.#settling = null;
    clearTimeout(this.#timer);
    const all = [...this.#asked.splice(0), ...this.#waiting.splice(0)];
    for (const one of all) this.#fail(one, new CommandError(one.line, 0, words));
  }

  /** Returns a promise of the reply to one line. The head answers one line after the other, so the time counts from
   * when all lines before it have their replies. A line that can't be sent yet may also wait for timeout_s at most. The
   * promise is rejected with CommandError; number 0: no reply came, the line is no command, or the head is not
   * connected. */
  ask(line, timeout_s) {
    return new Promise((resolve, reject) => {
      if (!/^[ -~]{1,256}$/.test(line) || line.trim() === '') {
        reject(new CommandError(String(line), 0, 'a command is one line of 1 to 256 printable ASCII characters'));
        return;
      }
      if (!this.#isOpen) {
        reject(new CommandError(line, 0, 'the head is not connected'));
        return;
      }
      const one = {line, timeout_s, resolve, reject, timer: 0};
      if (this.#settling === null) this.#sendOne(one);
      else {
        this.#waiting.push(one);
        this.#startTimer(one);
      }
    });
  }

  /** A reply line came. */
  take(reply) {
    if (this.#settling !== null) {
      if (isIdentity(reply)) this.#settled();
      return;
    }
    const one = this.#asked.shift();
    if (one === undefined) return;
    clearTimeout(one.timer);
    if (this.#asked.length > 0) this.#startTimer(this.#asked[0]);
    const refusal = /^ERR (-?\d+),"(.*)"$/.exec(reply);
    if (refusal) one.reject(new CommandError(one.line, Number(refusal[1]), refusal[2]));
    else one.resolve(reply);
  }

  #sendOne(one) {
    this.#asked.push(one);
    if (this.#asked.length === 1) this.#startTimer(one);
    this.#send(one.line);
  }

  #startTimer(one) {
    clearTimeout(one.timer);
    one.timer = setTimeout(() => this.#late(one), 1000 * one.timeout_s);
  }

  #fail(one, error) {
    clearTimeout(one.timer);
    one.reject(error);
  }

  // Lines that were sent after the late one are given up, too, since their replies can no longer be told apart.
  #late(one) {
    const waits = this.#waiting.indexOf(one);
    const words = `no reply within ${one.timeout_s} s`;
    if (waits >= 0) {
      this.#waiting.splice(waits, 1);
      this.#settling.left++; // the answer may have been lost, too
      this.#send('*IDN?');
      this.#fail(one, new CommandError(one.line, 0, words));
      return;
    }
    const given = this.#asked.splice(0), names = given.filter(({line}) => /^\s*:?\*idn\?\s*$/i.test(line)).length;
    for (const other of given) {
      const why = other === one ? words : `given up, as ${one.line} had no reply`;
      this.#fail(other, new CommandError(other.line, 0, why));
    }
    this.#settling = {left: names + 1};
    this.#send('*IDN?');
  }

  // Answers to an earlier *IDN? may have been lost. So after each answer the next one has only LATER_MS to come.
  #settled() {
    clearTimeout(this.#timer);
    this.#settling.left--;
    if (this.#settling.left > 0) this.#timer = setTimeout(() => this.#goOn(), LATER_MS);
    else this.#goOn();
  }

  #goOn() {
    this.#settling = null;
    for (const one of this.#waiting.splice(0)) {
      clearTimeout(one.timer);
      this.#sendOne(one);
    }
  }
}
