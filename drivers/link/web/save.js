/* SPDX-License-Identifier: MIT */
// This row saves the points so far as a file. The head writes it, in the formats of `scanhead record` (GET /save), and
// the page fetches it in pieces.
import {make, say} from './page.js';
import {download, fileName} from './picture.js';

const FORMATS = [['las', 'LAS'], ['ply', 'PLY'], ['e57', 'E57'], ['ptx', 'PTX'], ['pcapng', 'pcapng']];
const ASK_MS = 300;

async function get(path) {
  const answer = await fetch(path, {cache: 'no-store'});
  if (!answer.ok) throw new Error((await answer.text()).trim() || `the head does not give ${path}`);
  return answer;
}

// Returns the file as a Blob.
export async function fetchSaved(as) {
  let status = await (await get(`/save?as=${as}`)).json();
  while (status.state === 'working') {
    await new Promise((done) => setTimeout(done, ASK_MS));
    status = await (await get('/save')).json();
  }
  const parts = [];
  for (let at = 0; at < status.bytes;) {
    const piece = await (await get(`/saved?from=${at}`)).arrayBuffer();
    if (piece.byteLength === 0) throw new Error('the file is gone: another one was begun');
    parts.push(piece);
    at += piece.byteLength;
  }
  return new Blob(parts);
}

// Returns the row for the display's panel.
export function saveRow() {
  const as = make('select', {id: 'save-as'}, ...FORMATS.map(([value, name]) => make('option', {value}, name)));
  const button = make('button', {type: 'button', id: 'save', title: 'The points so far, as the head has them, up to 10 million',
    click: () => save()}, 'Save');
  const says = make('p', {class: 'note', role: 'status'});
  const save = async () => {
    button.disabled = true;
    says.className = 'note';
    try {
      say(says, 'The head writes the file.');
      download(await fetchSaved(as.value), fileName(as.value));
      say(says, 'Saved.');
    } catch (error) {
      says.className = 'refusal';
      say(says, error.message);
    }
    button.disabled = false;
  };
  return make('div', {}, make('div', {class: 'row'}, make('label', {for: 'save-as'}, 'Points as'), as, button), says);
}
