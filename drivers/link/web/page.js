/* SPDX-License-Identifier: MIT */
// These helpers of all panels make elements, write figures, and do things no more often than needed.

// Makes an element: make('p', {id: 'x', class: 'y'}, 'text', child). A function as a value is a listener.
export function make(name, attributes = {}, ...children) {
  const element = document.createElement(name);
  for (const [key, value] of Object.entries(attributes)) {
    if (typeof value === 'function') element.addEventListener(key, value);
    else if (value === true) element.setAttribute(key, '');
    else if (value !== false && value !== null && value !== undefined) element.setAttribute(key, value);
  }
  element.append(...children.filter((child) => child !== null && child !== undefined));
  return element;
}

const SVG = 'http://www.w3.org/2000/svg';
export function makeSvg(name, attributes = {}, ...children) {
  const element = document.createElementNS(SVG, name);
  for (const [key, value] of Object.entries(attributes)) element.setAttribute(key, value);
  element.append(...children);
  return element;
}

export const byId = (id) => document.getElementById(id);
export const bodyOf = (panel) => byId(`panel-${panel}`).querySelector('.body');

// Writes a text only where it has changed: a reader's selection and a screen reader's place stay.
export function say(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// Makes a field for a number, and a box with the field and its label.
export function numberField(id, label, attributes) {
  const field = make('input', {id, type: 'text', inputmode: 'decimal', autocomplete: 'off', spellcheck: 'false', ...attributes});
  return {field, box: make('div', {}, make('label', {for: id}, label), field)};
}

// Marks a field as valid or not.
export function markField(field, isRight) {
  if (isRight) field.removeAttribute('aria-invalid');
  else field.setAttribute('aria-invalid', 'true'); // an empty value would mark it as valid
}

// Returns the number that a user has written, NaN for none: an empty text is not 0. The sign may be the page's own, and
// the point a comma. All numbers are decimal and finite.
export function numberOf(text) {
  const plain = plainOf(text);
  return /^[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?$/i.test(plain) && Number.isFinite(Number(plain)) ? Number(plain) : NaN;
}

const plainOf = (text) => text.trim().replaceAll('−', '-').replace(',', '.');

// Returns a field's text as the head takes it: a number with the sign - and a point. Other texts stay.
export const asSent = (text) => (Number.isNaN(numberOf(text)) ? text.trim() : plainOf(text));

// Returns a function that runs call() at most once in every `ms`, and once more after its last use in that time.
export function atMostEvery(ms, call) {
  let timer = 0, last = -Infinity;
  return () => {
    if (timer) return;
    timer = setTimeout(() => {
      timer = 0;
      last = performance.now();
      call();
    }, Math.max(0, last + ms - performance.now()));
  };
}

export const NONE = '–';
const known = (value) => typeof value === 'number' && Number.isFinite(value);

// Writes a number with so many digits after the point. What is rounded to 0 has no sign.
export function fixed(value, digits) {
  const text = Math.abs(value).toFixed(digits);
  return value < 0 && Number(text) !== 0 ? `−${text}` : text;
}

// Turns 1234567 into '1 234 567' with thin spaces; `digits` digits stand after the point.
export function grouped(value, digits = 0) {
  if (typeof value === 'bigint') value = Number(value);
  if (!known(value)) return NONE;
  const [whole, part] = fixed(value, digits).split('.');
  return whole.replace(/\B(?=(\d{3})+$)/g, '\u2009') + (part ? `.${part}` : '');
}

// Turns 1234567 into '1.23 M': three digits and a prefix, for rates and counts.
export function short(value, unit = '') {
  if (typeof value === 'bigint') value = Number(value);
  if (!known(value)) return NONE;
  const tail = (prefix) => (prefix || unit ? `\u00a0${prefix}${unit}` : '');
  for (const [scale, prefix] of [[1e9, 'G'], [1e6, 'M'], [1e3, 'k']]) {
    if (Math.abs(value) >= scale * 0.9995) return three(value / scale) + tail(prefix);
  }
  return (Number.isInteger(value) ? String(value) : three(value)) + tail('');
}

function three(value) {
  const size = Math.abs(value);
  return fixed(value, size < 9.995 ? 2 : size < 99.95 ? 1 : 0);
}

// Writes metres for people: micrometres up to metres.
export function metres(value) {
  if (!known(value)) return NONE;
  const size = Math.abs(value), sign = value < 0 ? '−' : '';
  if (size === 0) return '0 mm';
  if (size < 0.995e-8) return '<\u20090.01\u00a0µm';
  if (size < 0.9995e-6) return `${sign}${(size * 1e6).toFixed(2)}\u00a0µm`;
  if (size < 0.99995e-3) return `${sign}${(size * 1e6).toFixed(0)}\u00a0µm`;
  if (size < 0.99995) return `${sign}${three(size * 1e3)}\u00a0mm`;
  return `${sign}${three(size)}\u00a0m`;
}

// Writes the place of a station for people, to a centimetre.
export const placeText = ({x_m, y_m, z_m}) => [x_m, y_m, z_m].map((v) => fixed(v, 2)).join('  ');

// Writes seconds for people: nanoseconds up to minutes.
export function duration(value_s) {
  if (!known(value_s)) return NONE;
  const size = Math.abs(value_s), sign = value_s < 0 ? '−' : '';
  if (size === 0) return '0\u00a0s';
  if (size >= 119.5) return `${sign}${Math.round(size / 60)}\u00a0min`;
  for (const [scale, unit] of [[1, 's'], [1e-3, 'ms'], [1e-6, 'µs']]) {
    if (size >= scale * 0.9995) return `${sign}${three(size / scale)}\u00a0${unit}`;
  }
  return `${sign}${three(size / 1e-9)}\u00a0ns`;
}

export const percent = (share, digits = 1) => (known(share) ? `${(share * 100).toFixed(digits)}\u00a0%` : NONE);

export const clock = (date = new Date()) => date.toTimeString().slice(0, 8);

// Makes a list of names and figures: rows is [[key, name, title], ...]; the result sets them: set({key: text}).
export function figureList(parent, rows, kind = '') {
  const cells = {};
  const list = make('dl', {class: `figures ${kind}`});
  for (const [key, name, title] of rows) {
    cells[key] = make('dd', {id: `figure-${key}`}, NONE);
    list.append(make('div', {title}, make('dt', {}, name), cells[key]));
  }
  parent.append(list);
  return (texts) => {
    for (const [key, text] of Object.entries(texts)) say(cells[key], text);
  };
}

// Stores something small in the browser; a browser that stores nothing is not an error.
export const kept = {
  get(key) {
    try {
      return localStorage.getItem(`scanhead.${key}`);
    } catch {
      return null;
    }
  },
  set(key, value) {
    try {
      localStorage.setItem(`scanhead.${key}`, value);
    } catch { /* private windows store nothing */ }
  },
};

// Fetches one of the link's resources. Throws an Error with the head's words, and with the status.
export async function fetchOrThrow(path, options) {
  const answer = await fetch(path, options);
  if (answer.ok) return answer;
  throw Object.assign(new Error((await answer.text()).trim() || `${path}: ${answer.status}`), {status: answer.status});
}

const AGAIN_MS = 100, AGAIN_MOST_MS = 1600; // a head that has no room for a request is asked again, ever less often

/** Returns the bytes of one of the link's resources; null if there is none or it does not come within some seconds. */
export async function fetchBytes(path, cache = 'default') {
  for (let wait_ms = AGAIN_MS; ; wait_ms *= 2) {
    try {
      const answer = await fetch(path, {cache});
      if (answer.ok) return await answer.arrayBuffer();
      if (answer.status !== 408 && answer.status !== 503) return null;
    } catch { /* the connection broke */ }
    if (wait_ms > AGAIN_MOST_MS) return null;
    await new Promise((done) => setTimeout(done, wait_ms));
  }
}

/** Returns the JSON of one of the link's resources; null if there is none, it does not come, or it is no JSON. */
export async function fetchJson(path) {
  const bytes = await fetchBytes(path, 'no-store');
  try {
    return bytes && JSON.parse(new TextDecoder().decode(bytes));
  } catch {
    return null;
  }
}

/** Returns a function begin(), to be called where something begins that may be overtaken. begin() returns a function
 * that says whether begin() was not called again since. */
export function newest() {
  let last = 0;
  return () => {
    const own = ++last;
    return () => own === last;
  };
}
