/* SPDX-License-Identifier: MIT */
// This button records: the frames that come while it is pressed become a file, which the user saves.
import {byId, say, short} from './page.js';
import {download, fileName} from './picture.js';

export function startRecorder(head, bar) {
  const button = byId('record');
  let isOn = false;
  const show = () => {
    say(button, isOn ? 'Save' : 'Record');
    button.setAttribute('aria-pressed', isOn);
    button.disabled = !isOn && !head.isOpen;
  };
  const turn = (on) => {
    isOn = on;
    head.keep(on);
    bar.recording(on ? 'recording' : '');
    show();
  };
  button.addEventListener('click', () => turn(!isOn));
  head.addEventListener('open', show);
  head.addEventListener('close', show);
  head.addEventListener('kept', ({detail: blob}) => {
    const name = fileName('shs');
    download(blob, name);
    bar.notice(`${name}, ${short(blob.size, 'B')}. Other formats: scanhead record ${name} -o scan.las (or .ply, .e57, .ptx, .pcapng)`, 12000);
  });
  setInterval(() => {
    if (!isOn) return;
    const {kept_bytes: bytes, kept_full: isFull} = head.figures();
    bar.recording(`recording ${short(bytes ?? 0, 'B')}`);
    if (isFull) turn(false);
  }, 500);
  show();
}
