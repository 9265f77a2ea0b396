/* SPDX-License-Identifier: MIT */
// A Session has the present state of the head for the panels: connection, state, control. It sends 'change' events.
import {STATES} from './native.js';
import {kept} from './page.js';

const WORDS = {
  'off': 'Off', 'boot': 'Self test', 'idle': 'Idle', 'spin-up': 'Spinning up', 'scanning': 'Scanning',
  'spin-down': 'Spinning down', 'fault': 'Fault',
};

// Turns the number of a state into its word. A word is returned as it is.
export const stateName = (state) => STATES[Number(state)] ?? String(state);
// In the pace step a head that was granted no time yet stays in its self test.
export const stateWord = (state, pace) => (pace === 'step' && state === 'boot' ? 'Waits for time steps' : WORDS[state] ?? state);

// Names a session by kind of link and address, "tcp 127.0.0.1:40312", or by its number if these are not known.
export const sessionWords = (session, who) => who || `Session ${session}`;

// Turns a promise's ERR into a sentence: the words after the semicolon say exactly what was wrong.
export function why(error) {
  const text = String(error?.text ?? error?.message ?? error);
  return text.includes('; ') ? text.slice(text.indexOf('; ') + 2) : text;
}

export class Session extends EventTarget {
  link = 'opening'; // 'opening', 'open' or 'closed'
  state = null;     // a word of the protocol
  scan = 0;
  pace = '';        // of the configuration; '': not known
  owner = 0;        // the session that has control; 0: nobody has it
  who = '';         // that session in words, for a sentence's beginning
  mine = false;     // this page has control
  since = null;     // the time at which the connection ended
  words = '';       // why it ended
  wasOpen = false;  // there was a connection

  constructor(head) {
    super();
    this.head = head;
    head.addEventListener('open', () => this.#opened());
    head.addEventListener('close', ({detail}) => this.#closed(detail));
    head.addEventListener('state', ({detail}) => this.#become(detail?.state ?? detail));
    head.addEventListener('control', ({detail}) => this.#controlled(detail));
    head.addEventListener('event', ({detail}) => {
      if (detail.name !== 'SCAN_START') return;
      this.scan = Number(detail.scan);
      this.#changed();
    });
    head.addEventListener('telemetry', ({detail}) => {
      this.#become(detail.state);
      const scan = Number(detail.scan);
      if (scan === this.scan) return;
      this.scan = scan;
      this.#changed();
    });
  }

  // Says why a setting can't be made now, in words; '' if it can. states has the states in which it can, or 'all'.
  whyNot(states = 'all') {
    if (this.link !== 'open') return 'The head is not connected.';
    if (!this.mine) return this.owner ? `${this.who} has control and has to give it back first.` : 'Take control first.';
    if (states === 'all' || states.split(' ').includes(this.state)) return '';
    return `Not in the state ${stateWord(this.state ?? 'off')}.`;
  }

  command(line, options) {
    return this.head.command(line, options);
  }

  paced(pace = '') {
    if (pace === this.pace) return;
    this.pace = pace;
    this.#changed();
  }

  #opened() {
    this.link = 'open';
    this.since = null;
    this.#changed();
  }

  // words say why the connection ended.
  #closed({words = '', wasOpen = true} = {}) {
    if (wasOpen || this.link === 'opening') this.since = new Date();
    if (wasOpen || this.words === '') this.words = words;
    this.wasOpen ||= wasOpen;
    this.link = 'closed';
    this.state = null;
    this.mine = false;
    this.owner = 0;
    this.#changed();
  }

  #become(state) {
    const name = stateName(state);
    if (name === this.state || state === null) return;
    this.state = name;
    this.#changed();
  }

  #controlled({session, who, mine}) {
    this.owner = session;
    this.who = sessionWords(session, who);
    this.mine = mine;
    this.#changed();
  }

  #changed() {
    this.dispatchEvent(new Event('change'));
  }
}

// The browser stores the theme: light, dark, or that of the system.
export function startTheme(button) {
  const system = matchMedia('(prefers-color-scheme: dark)');
  const show = () => {
    const theme = kept.get('theme') ?? (system.matches ? 'dark' : 'light');
    document.documentElement.dataset.theme = theme;
    button.textContent = theme === 'dark' ? 'Light' : 'Dark';
    button.setAttribute('aria-label', `${button.textContent} colours`);
    document.dispatchEvent(new CustomEvent('theme', {detail: theme}));
  };
  button.addEventListener('click', () => {
    const next = document.documentElement.dataset.theme === 'dark' ? 'light' : 'dark';
    kept.set('theme', next);
    show();
  });
  system.addEventListener('change', show);
  show();
}
