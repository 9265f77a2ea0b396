/* SPDX-License-Identifier: MIT */
// This row saves the points so far as a file. The head writes it, in the formats of `scanhead record` (GET /save), and
// the page fetches it in pieces.
import {fetchOrThrow, grouped, make, say} from './page.js';
import {download, fileName} from './picture.js';

const FORMATS = [['las', 'LAS'], ['ply', 'PLY'], ['e57', 'E57'], ['ptx', 'PTX'], ['pcapng', 'pcapng']];
const ASK_MS = 300;

const get = (path) => fetchOrThrow(path, {cache: 'no-store'});

// Returns {blob, gone, lost_frames}: the file, how many points it lacks, and the frames that did not reach the head's
// store. Another page may begin a file of its own as soon as this one is done.
export async function fetchSaved(as) {
  let status = await (await get(`/save?as=${as}`)).json();
  const {file} = status;
  while (status.state === 'working') {
    await new Promise((done) => setTimeout(done, ASK_MS));
    status = await (await get('/save')).json();
    if (status.file !== file || status.as !== as) throw new Error('The file is gone: another page began one. Save it again.');
  }
  // The head says only once why it has no file. Another page may have had that answer.
  if (status.state !== 'done') throw new Error('The head could not write the file.');
  const parts = [];
  for (let at = 0; at < status.bytes;) {
    const piece = await (await get(`/saved?file=${file}&from=${at}`)).arrayBuffer();
    if (piece.byteLength === 0) throw new Error('The file ended too early.');
    parts.push(piece);
    at += piece.byteLength;
  }
  return {blob: new Blob(parts), gone: status.gone, lost_frames: status.lost_frames};
}

// Says what the file lacks.
export function savedWords({gone, lost_frames}) {
  const lacks = [];
  if (gone > 0) lacks.push(`${grouped(gone)} older points, which the head no longer keeps`);
  if (lost_frames > 0) lacks.push(`${grouped(lost_frames)} stream frames that were lost`);
  return lacks.length > 0 ? `Saved, without ${lacks.join(', and ')}.` : 'Saved.';
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
      const ending = as.value, saved = await fetchSaved(ending);
      download(saved.blob, fileName(ending));
      if (saved.gone > 0 || saved.lost_frames > 0) says.className = 'refusal';
      say(says, savedWords(saved));
    } catch (error) {
      says.className = 'refusal';
      say(says, error.message);
    }
    button.disabled = false;
  };
  return make('div', {}, make('div', {class: 'row'}, make('label', {for: 'save-as'}, 'Points as'), as, button), says);
}
