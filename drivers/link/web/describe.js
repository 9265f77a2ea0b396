/* SPDX-License-Identifier: MIT */
// This module reads descriptions of the head's settings: HELP:SETtings? lists the settings, HELP? describes each one.
// A head without these commands is asked for MIN, MAX and DEF.

// Splits 'number,"Hz",1000,1200000,300000,0.000001,"all",""' into its fields; a field in quotes may hold commas.
export function splitReply(reply) {
  return [...`${reply},`.matchAll(/\s*(?:"((?:[^"]|"")*)"|([^,]*))\s*,/g)]
    .map(([, quoted, plain]) => (quoted !== undefined ? quoted.replaceAll('""', '"') : plain.trim()));
}

const words = (text) => text.split(/\s+/).filter(Boolean);

// the fields are kind, unit, min, max, default, step, states, values
function fromHelp(header, reply) {
  const [kind, unit, min, max, preset, step, states, values] = splitReply(reply);
  return {header, kind, unit, min, max, preset, step, states: states ?? '', values: words(values ?? '')};
}

async function describeOld(head, header) {
  const ask = (what) => head.command(`${header}? ${what}`).catch(() => '');
  if (header === 'SCAN:ECHoes') {
    return {header, kind: 'word', unit: '', states: 'all', values: ['ALL', 'FIRSt', 'LAST', 'STRongest']};
  }
  const [min, max, preset] = await Promise.all(['MIN', 'MAX', 'DEF'].map(ask));
  const states = header === 'HEAD:STATION' ? 'off boot idle spin-down fault' : 'all';
  return {header, kind: 'number', unit: '', min, max, preset, step: '', states, values: []};
}

// Returns all settings, in the head's order: [{header, kind: 'number' | 'word', unit, min, max, preset, step, states,
// values}]. Figures are the head's own texts. A setting that this head does not have has no states.
export async function describeSettings(head) {
  const all = words(await head.command('HELP?'));
  if (!all.some((header) => /^HELP:SET/i.test(header))) {
    const old = all.filter((header) => /^(HEAD|SCAN):(PRR|LINES|PAN|STATION|LINE:|PAN:|FRAM|ECHO)/i.test(header));
    return Promise.all(old.map((header) => describeOld(head, header)));
  }
  const headers = words(await head.command('HELP:SETtings?'));
  return Promise.all(headers.map((header) => describe(head, header)));
}

export async function describe(head, header) {
  return fromHelp(header, await head.command(`HELP? ${header}`));
}
