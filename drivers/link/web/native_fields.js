/* SPDX-License-Identifier: MIT */
// This module reads payloads of fixed layout into objects, by the tables of the protocol's pages. A payload that
// LOSSES.md tells a reader to refuse throws Refused.
//
// Whole numbers of 64 bits: times (`_ns`), the seed, ptp_grandmaster and an event's a, b, c are BigInt. All others are
// Numbers, or BigInt where a Number can't hold them exactly (beyond 2^53).

export class Refused extends Error {}

export const refuse = (why) => {
  throw new Refused(why);
};

const exact = (v) => (v <= Number.MAX_SAFE_INTEGER && v >= Number.MIN_SAFE_INTEGER ? Number(v) : v);
const finite = (v) => (Number.isFinite(v) ? v : refuse('a number that is not finite'));

const readers = {
  u8: [1, (v, at) => v.getUint8(at)],
  u16: [2, (v, at) => v.getUint16(at, true)],
  u32: [4, (v, at) => v.getUint32(at, true)],
  i32: [4, (v, at) => v.getInt32(at, true)],
  u64: [8, (v, at) => exact(v.getBigUint64(at, true))],
  i64: [8, (v, at) => exact(v.getBigInt64(at, true))],
  U64: [8, (v, at) => v.getBigUint64(at, true)], // always BigInt
  I64: [8, (v, at) => v.getBigInt64(at, true)],
  f32: [4, (v, at) => finite(v.getFloat32(at, true))],
  f64: [8, (v, at) => finite(v.getFloat64(at, true))],
};

function text(view, at, width) {
  let words = '';
  for (let i = 0; i < width; i++) {
    const byte = view.getUint8(at + i);
    if (byte === 0) return words;
    words += byte < 0x80 ? String.fromCharCode(byte) : '\ufffd';
  }
  return refuse('a text without an end');
}

// The table has "name type" or "name type[count]", one after the other.
function layout(table) {
  let at = 0;
  const fields = table.trim().split(/\s*,\s*/).map((row) => {
    const [, name, type, count] = /^(\w+) (\w+)(?:\[(\d+)\])?$/.exec(row);
    const field = {name, type, count: Number(count ?? 0), at};
    at += type === 'char' ? field.count : readers[type][0] * (field.count || 1);
    return field;
  });
  return {fields, bytes: at};
}

function take({fields}, view, from, out) {
  for (const {name, type, count, at} of fields) {
    if (type === 'char') {
      out[name] = text(view, from + at, count);
      continue;
    }
    const [bytes, read] = readers[type];
    const one = (_, i) => read(view, from + at + bytes * i);
    out[name] = count ? Array.from({length: count}, one) : one(null, 0);
  }
  return out;
}

const descriptor = layout(`idn char[96], profile char[32], layout u32, isa u32, prr_uhz u64, lines_uhz u64,
  pan_udeg_s u64, fov_min_udeg i64, sweep_udeg i64, line_start_udeg i64, line_stop_udeg i64, pan_start_udeg i64,
  pan_stop_udeg i64, mirror_counts_per_turn f64, pan_counts_per_turn f64, range_scale_m f64, range_min_m f64,
  range_max_m f64, max_echoes u32, n_surfaces u32, frames u32, scan u32, seed U64`);
const content = layout('content u32, reserved u32');
const anchor = layout(`crs u32, epsg u32, station u32, moving u32, anchor f64[3], scale_m f64, lat_deg f64, lon_deg f64,
  height_m f64, station_m f64[3], rotation f64[9], scale f64[3], heights u32, until_ms u32, axes f64[9], frame f64`);
const lineEnd = layout(`frame u32, line u32, pulse0 u64, t0_ns I64, t1_ns I64, n_fired u32, n_cast u32, n_echoes u32,
  mirror_count u32, pan_count u32, status u32, n_crowded u32, n_faint u32, n_unfit u32`);
const telemetry = layout(`state u32, scan u32, pulses u64, echoes u64, lines u64, lost_pulses u64, late_blocks u64,
  late_max_us u32, errors_queued u32, reader_lost_frames u64, utc_ns I64`);
const scanCounts = layout('scan_fired u64, scan_cast u64, scan_lost u64');
const lostLines = layout('lost_lines u64');
const ptp = layout(`ptp_port u32, ptp_servo u32, ptp_offset_ns I64, ptp_delay_ns I64, ptp_grandmaster U64, ptp_class u32,
  ptp_accuracy u32, ptp_flags u32, ptp_reserved u32`);
const event = layout('code u32, reserved u32, a U64, b U64, c U64, text char[96]');
const emitter = layout(`kind u32, n_beams u32, steps u32, first_step i32, last_step i32, front_step i32, turn i32,
  rings u32, sequence_ns_num u64, sequence_ns_den u64, first_ring_udeg i64, echoes u32, gaps u32`);
const beam = layout('elevation_udeg i32, azimuth_udeg i32, offset_ns u32');
const waves = layout(`pulse0 u64, line u32, n_windows u32, sample_ps u32, baseline_16 u16, bits u8, reserved u8,
  count_signal f32, n_lost u32`);
const pose = layout('t_ns I64, position_m f64[3], quat f64[4], frame f64, flags u32, reserved u32');

function whole(table, view, what) {
  if (view.byteLength < table.bytes) refuse(`${what} of ${view.byteLength} bytes; ${table.bytes} are the least`);
  return take(table, view, 0, {});
}

/** `content` is 0 where the payload ends before it. */
export function readDescriptor(view) {
  const d = whole(descriptor, view, 'a descriptor');
  d.content = d.reserved = 0;
  if (view.byteLength >= descriptor.bytes + content.bytes) take(content, view, descriptor.bytes, d);
  if (d.layout > 1) refuse('a descriptor of an unknown layout');
  if (d.n_surfaces > 65535) refuse('a descriptor with more surfaces than labels');
  const isScaled = d.mirror_counts_per_turn >= 1 && d.pan_counts_per_turn >= 1 && d.range_scale_m > 0;
  if (d.layout === 0 && !isScaled) refuse('a polar descriptor without scales');
  return d;
}

/** Where the frame has zeros, `scale` gets scale_m. `axes` gets the unit matrix if the frame has zeros alone: the axes
 * of the CRS are then those of the scene. */
export function readAnchor(view) {
  const a = whole(anchor, view, 'an anchor');
  if (a.crs > 3 || a.heights > 1) refuse('an anchor in an unknown CRS');
  a.scale = a.scale.map((s) => s || a.scale_m);
  if (a.axes.every((v) => v === 0)) a.axes = [1, 0, 0, 0, 1, 0, 0, 0, 1];
  return a;
}

export const readLineEnd = (view) => whole(lineEnd, view, 'a line end');

/** The scan's counts are null in recordings of older heads, which did not have them. lost_lines is 0 where the payload
 * ends before it. ptp_port is 0, and the rest of ptp is not there, where the head follows no PTP master. */
export function readTelemetry(view) {
  const t = whole(telemetry, view, 'a telemetry');
  t.scan_fired = t.scan_cast = t.scan_lost = null;
  if (view.byteLength >= telemetry.bytes + scanCounts.bytes) take(scanCounts, view, telemetry.bytes, t);
  t.lost_lines = t.ptp_port = 0;
  const at = telemetry.bytes + scanCounts.bytes;
  if (view.byteLength >= at + lostLines.bytes) take(lostLines, view, at, t);
  if (view.byteLength >= at + lostLines.bytes + ptp.bytes) take(ptp, view, at + lostLines.bytes, t);
  return t;
}

// Names of an event's a, b and c, in this order. Values in _ns are BigInt, the others as `exact` returns them.
const EVENTS = {
  1: ['STATE', 'state', 'before'],
  2: ['SCAN_START', 'scan', 'at_ns', 'gps_ns'],
  3: ['SCAN_END', 'scan', 'fired', 'lost'],
  4: ['OVERRUN', 'first_lost', 'lost', 'ticks'],
  5: ['READER_LOST', 'frames', 'pulses', 'frames_in_all'],
  6: ['CONTROL', 'session'],
  7: ['ERROR', 'number', 'session', 'held_back'],
  8: ['SETTINGS', 'first_pulse'],
  9: ['POSE_LATE', 'made_up', '', 'since_ns'],
  10: ['PPS', 'utc_s', 'at_ns', 'gps_s'],
  11: ['TIME', '', 'at_ns', 'gps_ns'],
  12: ['SITE', 'station', 'warnings'],
  13: ['PTP', 'port_and_servo', 'at_ns'],
};

/** Returns code, a, b, c and text, the `name` of the event, and a, b, c again under names that say what they mean. An
 * unknown code has the name ''. */
export function readEvent(view) {
  const e = whole(event, view, 'an event');
  const [name, ...meanings] = EVENTS[e.code] ?? [''];
  e.name = name;
  meanings.forEach((meaning, i) => {
    const value = [e.a, e.b, e.c][i];
    if (meaning.endsWith('_ns')) e[meaning] = value;
    else if (meaning) e[meaning] = exact(meaning === 'number' ? BigInt.asIntN(64, value) : value);
  });
  return e;
}

/** The emitter's `beams` are {elevation_udeg, azimuth_udeg, offset_ns (a Number)} in the order in which they fire. */
export function readEmitter(view) {
  const e = whole(emitter, view, 'an emitter');
  if (e.kind > 4 || e.sequence_ns_den === 0 || Math.abs(e.turn) !== 1) refuse('an emitter of an unknown kind');
  if (e.n_beams > 128 || e.n_beams > (view.byteLength - emitter.bytes) / beam.bytes) {
    refuse('an emitter shorter than its beams');
  }
  e.beams = Array.from({length: e.n_beams}, (_, i) => take(beam, view, emitter.bytes + beam.bytes * i, {}));
  return e;
}

/** Returns [{t_ns, position_m, quat (w, x, y, z), frame, flags}], with rising times. */
export function readPoses(view) {
  const n = view.byteLength >= 8 ? view.getUint32(0, true) : 0;
  if (n < 2 || n > (view.byteLength - 8) / pose.bytes) refuse('a poses frame with a wrong number of poses');
  const poses = Array.from({length: n}, (_, i) => take(pose, view, 8 + pose.bytes * i, {}));
  poses.forEach((p, i) => {
    const norm2 = p.quat.reduce((sum, v) => sum + v * v, 0);
    if (!(Math.abs(norm2 - 1) < 1e-9)) refuse('a pose whose quaternion is not of length one');
    if (i > 0 && p.t_ns <= poses[i - 1].t_ns) refuse('poses whose times do not rise');
  });
  return poses;
}

/** Reads the beginning of a waveforms frame; native_waves.js reads its windows. */
export function readWavesHead(view) {
  const w = whole(waves, view, 'waveforms');
  if (w.sample_ps === 0 || w.bits < 8 || w.bits > 14 || !(w.count_signal > 0)) refuse('waveforms without a scale');
  return w;
}

const utf8 = new TextDecoder();

/** Returns [{label, object, material}]. */
export function readNames(view) {
  const first = view.byteLength >= 8 ? view.getUint32(0, true) : 0;
  const count = view.byteLength >= 8 ? view.getUint32(4, true) : Infinity;
  if (first + count > 65535) refuse('names of labels beyond 65534');
  const bytes = new Uint8Array(view.buffer, view.byteOffset, view.byteLength);
  let at = 8;
  const name = () => {
    const end = at + 1 + (bytes[at] ?? Infinity);
    if (end > bytes.length) refuse('a surfaces frame shorter than its names');
    const own = bytes.subarray(at + 1, end);
    if (own.includes(0)) refuse('a name with NUL');
    at = end;
    return utf8.decode(own);
  };
  return Array.from({length: count}, (_, i) => ({label: first + i, object: name(), material: name()}));
}

/** Reads the beginning of an attributes or colours frame. */
export function readBeside(view, bytes, what) {
  if (view.byteLength < 16) refuse(`${what} shorter than their header`);
  const n_points = view.getUint32(12, true);
  if (n_points > (view.byteLength - 16) / bytes) refuse(`fewer ${what} than the header says`);
  const [pulse0_low, pulse0_high, line] = [0, 4, 8].map((at) => view.getUint32(at, true));
  return {pulse0_low, pulse0_high, line, n_points};
}
