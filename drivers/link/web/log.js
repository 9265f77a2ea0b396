/* SPDX-License-Identifier: MIT */
// This panel shows events and errors in words, the newest on top, and the plan.
import {bodyOf, byId, clock, fetchJson, grouped, make, metres, newest, percent, say} from './page.js';
import {peerOf} from './head.js';
import {sessionWords, stateName, stateWord} from './session.js';

const MOST = 200; // so many entries are stored

// No command causes these errors (COMMANDS.md, *Errors*). The words here stand before the text of the error.
const HEADS_OWN = {101: 'Client lost (101):', 102: 'Reader too slow (102):', 103: 'Pulses lost (103):', 104: 'Client refused (104):',
  105: 'Incomplete command (105):', 106: 'Lines lost (106):', 107: 'Time server (107):'};

const seconds = (ns) => `${(Number(ns) / 1e9).toFixed(3)} s`;

// Returns an event in words, and how bad it is; null: there is nothing to report.
export function eventWords(e) {
  switch (e.name) {
    case 'STATE': return [stateWord(stateName(e.state)), stateName(e.state) === 'fault' ? 'bad' : ''];
    case 'SCAN_START': return [`Scan ${e.scan} begins`, ''];
    case 'SCAN_END': return [`Scan ${e.scan} ends: ${grouped(Number(e.fired))} pulses fired`
      + (Number(e.lost) > 0 ? `, ${grouped(Number(e.lost))} lost by the head` : ''), Number(e.lost) > 0 ? 'warn' : ''];
    case 'OVERRUN': return [`The head could not keep up: ${grouped(Number(e.lost))} pulses lost`, 'warn'];
    case 'READER_LOST': return Number(e.frames) > 0
      ? [`This page could not follow: ${grouped(Number(e.frames))} stream frames with ${grouped(Number(e.pulses))} pulses lost`, 'warn'] : null;
    case 'CONTROL': return [e.session ? `${sessionWords(e.session, peerOf(e))} has control` : 'Nobody has control', ''];
    case 'ERROR': return Number(e.held_back) > 0
      ? [`${grouped(Number(e.held_back))} more errors, the last one ${e.number}`, 'bad']
      : [`${e.session ? `Session ${e.session}: ` : ''}${HEADS_OWN[e.number] ?? e.number}${e.text ? ` ${e.text}` : ''}`, 'bad'];
    case 'SETTINGS': return [`Other settings from pulse ${grouped(Number(e.first_pulse))} on`, ''];
    case 'SITE': return [`Station ${e.a}${e.text ? ` (${e.text})` : ''} was moved`
      + (Number(e.b) > 0 ? `; ${grouped(Number(e.b))} warnings` : ''), Number(e.b) > 0 ? 'warn' : ''];
    case 'PTP': return [`PTP: ${e.text}`, e.text.includes(' on FAULT_DETECTED') ? 'bad' : ''];
    case 'POSE_LATE': return [`No pose of the platform in time, for ${seconds(e.since_ns)}`, 'warn'];
    case 'PPS': case 'TIME': return null; // they come every second; the figures show the time
    default: return [`Event ${e.code}${e.text ? `: ${e.text}` : ''}`, ''];
  }
}

export class Log {
  #list = make('ol', {class: 'log', tabindex: '0', 'aria-label': 'Events, the newest first'});
  #waiting = [];
  #last = null; // the newest entry: {text, times, span, time}
  #timer = 0;
  #aside = byId('panel-log').querySelector('summary').appendChild(make('span', {class: 'aside'}));
  #gone = 0;

  constructor(session) {
    bodyOf('log').append(this.#list);
    session?.head.addEventListener('event', ({detail}) => {
      const words = eventWords(detail);
      if (words) this.add(...words);
    });
    session?.head.addEventListener('open', () => this.add('Connected with the head', ''));
    session?.head.addEventListener('close', ({detail}) => detail.wasOpen && this.add(`Not connected: ${detail.words}`, 'bad'));
  }

  // kind is '', 'warn' or 'bad'
  add(text, kind = '') {
    this.#waiting.push({text, kind, at: new Date()});
    if (this.#waiting.length > MOST) this.#gone += this.#waiting.splice(0, this.#waiting.length - MOST).length;
    if (!this.#timer) this.#timer = setTimeout(() => this.#show(), 250);
  }

  // A user who reads further down keeps the place: a new entry on top moves the view by its height.
  #show() {
    this.#timer = 0;
    const list = this.#list, before = list.scrollHeight, top = list.scrollTop;
    for (const entry of this.#waiting.splice(0)) this.#showEntry(entry);
    while (list.children.length > MOST) {
      list.lastChild.remove();
      this.#gone++;
    }
    if (top > 0) list.scrollTop = top + list.scrollHeight - before;
    say(this.#aside, this.#gone > 0 ? `the last ${MOST}` : '');
  }

  #showEntry({text, kind, at}) {
    if (this.#last?.text === text) {
      this.#last.times++;
      this.#last.span.textContent = `${text} (${this.#last.times} times)`;
      this.#last.time.textContent = clock(at);
      return;
    }
    const span = make('span', {class: kind || null}, text), time = make('time', {datetime: at.toISOString()}, clock(at));
    this.#list.prepend(make('li', {}, time, span));
    this.#last = {text, times: 1, span, time};
  }
}

const rowOf = (row) => make('tr', {},
  make('th', {scope: 'row'}, row.stage),
  make('td', {}, row.method, make('span', {class: 'why'}, row.why)),
  make('td', {}, row.error_m ? metres(row.error_m) : '0', row.echo_share ? make('span', {class: 'why'}, `${percent(row.echo_share, 2)} echoes`) : null));

const table = (caption, heads, rows) => make('table', {class: 'plan'}, make('caption', {}, caption),
  make('thead', {}, make('tr', {}, ...heads.map((name) => make('th', {scope: 'col'}, name)))), make('tbody', {}, ...rows));

const beginPlan = newest();

// /plan has the rows of `scanhead plan --json`, or one text: "stage method; stage method".
export async function showPlan() {
  const isNewest = beginPlan(), plan = await fetchJson('/plan');
  if (!isNewest()) return;
  const rows = Array.isArray(plan) ? plan : plan?.rows;
  const body = bodyOf('plan');
  if (Array.isArray(rows)) {
    body.replaceChildren(table('The method that each stage uses, and the error it may make', ['Stage', 'Method', 'Error'],
      rows.map(rowOf)));
  } else if (plan?.text) {
    const parts = plan.text.split(/;\s*/).filter(Boolean).map((part) => [part.split(' ')[0], part.split(' ').slice(1).join(' ')]);
    body.replaceChildren(table('The method that each stage uses', ['Stage', 'Method'], parts.map(([stage, method]) =>
      make('tr', {}, make('th', {scope: 'row'}, stage), make('td', {}, method)))));
  } else {
    body.replaceChildren(make('p', {class: 'note'}, 'The head does not report its plan.'));
  }
}
