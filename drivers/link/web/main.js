/* SPDX-License-Identifier: MIT */
// This module connects the page's modules: a head and its points, or a recording.
import {bodyOf, byId, fetchBytes, fetchJson, kept, newest, say} from './page.js';
import {Head} from './head.js';
import {Cloud} from './cloud.js';
import {Session, startTheme, why} from './session.js';
import {Bar} from './bar.js';
import {Knobs} from './knobs.js';
import {Figures} from './figures.js';
import {Quality} from './quality.js';
import {Log, showPlan} from './log.js';
import {Stations} from './stations.js';
import {Display} from './display.js';
import {Point} from './point.js';
import {WavePlot} from './waves.js';
import {TrialPanel} from './trial_panel.js';
import {Recording} from './recording.js';
import {startRecorder} from './recorder.js';
import {saveRow} from './save.js';
import {startKeys} from './keys.js';
import {RecordingPlayer, ReplayPlayer, Timeline} from './timeline.js';
import {startTools} from './all_tools.js';

const CAPACITY = 10e6; // so many points are stored
const LAST_OF_FRAME = 1; // in the status of a line's end
const WIDE = '(min-width: 47rem)';

// The browser remembers which panels are open; at first a small screen has only a few.
function startPanels() {
  const few = ['panel-quality', 'panel-recording'];
  for (const panel of document.querySelectorAll('.panel')) {
    const was = kept.get(panel.id);
    let open = panel.open = was === null ? matchMedia(WIDE).matches || few.includes(panel.id) : was === 'open';
    panel.addEventListener('toggle', () => { // setting panel.open above also fires this once: that is no user's choice
      if (panel.open !== open) kept.set(panel.id, panel.open ? 'open' : 'closed');
      open = panel.open;
    });
  }
}

// A double click selects a number with its sign. A browser alone would leave the sign out of the selection: a negative
// number typed over it would then have two signs.
addEventListener('dblclick', ({target}) => target.matches?.('input[inputmode="decimal"]') && target.select());

// The page works without a picture: figures and settings need none.
async function makeView(cloud) {
  try {
    const {View} = await import('./view.js');
    return new View(byId('picture'), cloud);
  } catch (error) {
    byId('picture').hidden = true;
    say(byId('no-picture'), 'There is no picture: this browser has no WebGL 2, or it is switched off. '
      + `Figures and settings work without it. (${error.message})`);
    byId('no-picture').hidden = false;
    return null;
  }
}

// These are the names of surfaces and stations for people, as /head has them.
class Names {
  surfaces = new Map();
  stations = null;

  // list: [{label, object, material}]. For an object of an IFC model the type before its name and the id after it are
  // left out.
  add(list) {
    for (const {label, object, material} of list) {
      const name = object.replace(/Ifc[A-Z]\w+?_(?=.)/, '').replace(/_[0-9A-Za-z_$]{22}$/, '');
      this.surfaces.set(label, material && material !== object ? `${name} · ${material}` : name);
    }
  }

  of = (mode, label) => {
    if (mode === 'label') return this.surfaces.get(label);
    if (mode === 'station') return this.stations?.name(label);
    return undefined;
  };
}

// Returns how many seconds a pan sweep takes, from a descriptor; 0 if the pan does not turn.
const frameSeconds = ({pan_start_udeg: from, pan_stop_udeg: to, pan_udeg_s: rate}) =>
  (Number(rate) > 0 ? Math.abs(Number(to) - Number(from)) / Number(rate) : 0);

function startHead(cloud, view, names, keepsPast) {
  const head = new Head(`${location.protocol === 'https:' ? 'wss' : 'ws'}://${location.host}/ws`, {past: keepsPast});
  const session = new Session(head);
  const log = new Log(session);
  const bar = new Bar(session, log);
  startRecorder(head, bar);
  const knobs = new Knobs(session);
  const stations = new Stations(session, knobs, view);
  const figures = new Figures(head, cloud);
  const display = new Display(view, names.of);
  if (keepsPast) bodyOf('display').append(saveRow());
  names.stations = stations;
  display.station = () => Number(knobs.value('HEAD:STATION')) || 1;
  new Quality(() => session.link === 'open' && byId('panel-quality').open, view);
  new Point(view, names.of);
  if (view) new WavePlot(head, view, byId('point'));
  const trials = new TrialPanel(session, stations, view);

  const countFrames = () => session.command('SCAN:COUNt?').then((done) => bar.progress({done: Number(done)}), () => {});
  let before = ''; // it says who the head was
  let run = ''; // it says which of the head's runs it was
  let timeline = null;
  const refused = (error) => bar.notice(`The head refused: ${why(error)}`, 6000, 'bad');
  const findReplay = async () => {
    const player = timeline ? null : await ReplayPlayer.of(session, cloud, refused).catch(() => null);
    if (player) timeline = new Timeline(player);
  };
  const begin = newest();
  const learn = async () => {
    const isNewest = begin(), came = cloud.cut();
    countFrames();
    findReplay();
    const info = await fetchJson('/head');
    if (!info || !isNewest()) return;
    const now = [info.config, info.maker, info.model, info.serial].join();
    if (before && now !== before && cloud.count > 0) {
      const words = 'This is another head. The points of the one before are still shown; Clear, under Display, removes them.';
      bar.notice(words, 15000, 'warn');
      log.add(words, 'warn');
    }
    if (run && info.run !== run) cloud.outdate(came);
    run = info.run ?? '';
    before = now;
    names.add(info.surfaces ?? []);
    bar.name(info);
    session.paced(info.pace);
    if (view) view.stations.fields = info.fields ?? [];
    stations.reload(info.stations ?? []).then(() => trials.offer(info.previews === true, info.run)).catch(() => {}); // the head is gone
    showPlan();
    const scene = await fetchBytes('/scene');
    if (isNewest()) view?.setScene(scene);
  };
  stations.addEventListener('tell', ({detail}) => {
    bar.notice(detail.text, 6000, detail.kind);
    log.add(detail.text, detail.kind);
  });
  head.addEventListener('points', ({detail}) => {
    if (!cloud.replace(detail)) return;
    cloud.add(detail);
    if (detail.past) return;
    bar.progress({done: detail.frame});
    if (detail.n > 0) bar.reached(detail.t[detail.n - 1]);
  });
  head.addEventListener('line-end', ({detail}) => detail.status & LAST_OF_FRAME && bar.progress({done: detail.frame + 1}));
  head.addEventListener('descriptor', ({detail}) => bar.progress({frames: detail.frames, frame_s: frameSeconds(detail)}));
  head.addEventListener('event', ({detail}) => {
    if (detail.name === 'SCAN_END' && !timeline) countFrames(); // a replay may be in its next scan already
    if (detail.name === 'SCAN_START') bar.begin();
    if (detail.name === 'SITE') showPlan();
  });
  head.addEventListener('names', ({detail}) => names.add(detail));
  head.addEventListener('open', learn);
  view?.addEventListener('drawn', ({detail}) => figures.drawn(detail));
  return head;
}

function startRecording(info, cloud, view, names) {
  document.body.dataset.kind = 'recording';
  for (const panel of ['knobs', 'quality', 'log', 'plan']) byId(`panel-${panel}`).hidden = true;
  byId('panel-recording').hidden = false;
  byId('left').append(byId('panel-figures'));
  byId('right').hidden = true;
  if (view) view.movable = false;
  names.add(info.surfaces ?? []);
  const figures = new Figures(null, cloud);
  const stations = new Stations(null, null, view);
  const display = new Display(view, names.of, true);
  names.stations = stations;
  display.station = () => stations.list[0]?.number;
  stations.show(info.stations ?? []);
  const point = new Point(view, names.of, {pulse: 'Number'});
  point.t0_s = info.recording.t0_s ?? 0;
  view?.addEventListener('drawn', ({detail}) => figures.drawn(detail));
  const times = info.recording.columns?.find(({name}) => name === 't');
  if (view && times?.max > times?.min) new Timeline(new RecordingPlayer(view, {from_s: times.min, to_s: times.max}));
  return new Recording(info, cloud, view);
}

async function start() {
  startTheme(byId('theme'));
  startPanels();
  const cloud = new Cloud({capacity: CAPACITY});
  const view = await makeView(cloud);
  startKeys(view?.constructor.keys ?? []);
  const names = new Names();
  const info = await fetchJson('/head');
  window.scanhead = {head: null, cloud, view, trial: null};
  if (view) window.scanhead.tools = startTools(view, names.of);
  if (info?.recording) window.scanhead.recording = startRecording(info, cloud, view, names);
  else window.scanhead.head = startHead(cloud, view, names, Boolean(info?.run));
  document.body.dataset.ready = ''; // nothing is shown before, since parts are still filled or removed
}

start();
