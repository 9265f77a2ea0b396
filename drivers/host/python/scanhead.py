# SPDX-License-Identifier: MIT
"""Client of a scanhead in one file: commands, frames, points as arrays. Python 3.9, standard library.

    head = scanhead.open("tcp:127.0.0.1:5025")
    head.command("SCAN:STARt")
    for frame in head.frames(timeout_s=10):
        if frame.type == scanhead.POINTS:
            points = head.points(frame)
            x_m, y_m, z_m = head.to_scene(points)
        if head.scan_over:
            break

The wire is described in drivers/protocol/PROTOCOL.md and its pages, section by section. Columns of
points are numpy arrays where numpy is installed, else lists; the numbers are the same, to the last bit those
of libscanhead (range_m of geodetic points: to 2e-8 m). Units are in names: _m metres, _rad radians, _deg degrees,
_ns nanoseconds, _db decibels.
NaN: no value. Errors are exceptions. A Head belongs to one thread at a time.

Memory is bounded: a frame and a chunk of bytes (128 KiB), 64 MiB of frames that came while a reply was awaited,
8192 poses, 65535 names.
"""
import array
import bisect
import collections
import errno
import hashlib
import math
import os
import select
import socket
import stat
import struct
import sys
import time
from typing import Callable, Dict, Iterator, List, NamedTuple, Optional, Tuple, Union

try:
    import numpy as np
except ImportError:  # everything works without, slower
    np = None

(DESCRIPTOR, ANCHOR, POINTS, LINE_END, TELEMETRY, EVENT, SURFACES, POSES, ATTRIBUTES, EMITTER,
 COLOURS, WAVES) = range(1, 13)
REPEAT, LOCAL = 1, 2  # flags of a frame
(EV_STATE, EV_SCAN_START, EV_SCAN_END, EV_OVERRUN, EV_READER_LOST, EV_CONTROL, EV_ERROR, EV_SETTINGS,
 EV_POSE_LATE, EV_PPS, EV_TIME, EV_SITE, EV_PTP) = range(1, 14)
PTP_NONE, PTP_INITIALIZING, PTP_FAULTY, PTP_LISTENING, PTP_UNCALIBRATED, PTP_SLAVE = 0, 1, 2, 4, 8, 9  # ports
PTP_UNLOCKED, PTP_JUMP, PTP_LOCKED = range(3)  # servos
POLAR, GEO = 0, 1  # layouts
EMIT_LINE, EMIT_PLANAR, EMIT_BEAMS, EMIT_SPHERE, EMIT_DIRECTIONS = range(5)
CRS_LOCAL, CRS_ECEF, CRS_UTM, CRS_GEODETIC = range(4)
NO_LABEL = 0xFFFF

HAS_ATTRIBUTES, HAS_COLOURS, HAS_WAVES, HAS_DEVIATIONS = 1, 2, 4, 8  # content of a descriptor

_HASHED = (DESCRIPTOR, ANCHOR, POINTS, LINE_END, POSES, ATTRIBUTES, EMITTER, COLOURS, WAVES)
_HEADER_LEN, _MAX_PAYLOAD, _MAX_TEXT = 28, 65536, 512
_QUEUE_BYTES, _KEEP_POSES, _CHUNK = 64 << 20, 8192, 1 << 16
# As in libscanhead: the latest _SEEN frames and _GAPS gaps are remembered, but no gap of more than _GAP_MOST frames.
# _LATE_RUN late frames in a row are not late: they belong to another sequence.
_SEEN, _GAPS, _GAP_MOST, _LATE_RUN = 256, 64, 65536, 256
_FRAME_BYTES = 512  # memory of a kept frame beside its payload
_POLL_MS = 2**31 - 1  # the longest that poll() waits
_ANSWERS_S = 0.2  # how long further answers to *IDN? may take after the first one
_ASK_AGAIN_S = 1.0  # how long the first one may take before *IDN? is asked again
_SCANNING, _SPIN_DOWN = 4, 5  # states of the head
_NAN = math.nan
_NO_WAIT = -math.inf  # a deadline: all bytes that have come are taken, and nothing is waited for


class ScanheadError(Exception):
    """The source, the stream or a call is wrong; the text says which."""


class Timeout(ScanheadError, TimeoutError):
    """Nothing came in time. Call again."""


class Closed(ScanheadError):
    """The head is gone."""


class CommandError(ScanheadError):
    """The head refused a command. number: SCPI's; text: the head's words."""

    def __init__(self, command: str, number: int, text: str) -> None:
        super().__init__(f"{command}: {number},{text}")
        self.number, self.text = number, text


# ---- CRC-32C

def _crc_tables(n: int) -> List[List[int]]:
    """Table k: what a byte adds to the register when k bytes follow it."""
    first = []
    for byte in range(256):
        for _ in range(8):
            byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
        first.append(byte)
    tables = [first]
    for _ in range(n - 1):
        tables.append([first[crc & 255] ^ crc >> 8 for crc in tables[-1]])
    return tables


_ROW = 256  # bytes that numpy looks up side by side
_crc_table = _crc_tables(_ROW if np is not None else 2)
_crc_pairs = [_crc_table[1][pair & 255] ^ _crc_table[0][pair >> 8] for pair in range(65536)]
if np is not None:
    _crc_rows = np.array(_crc_table[::-1], dtype=np.uint32).ravel()
    _crc_offsets = np.arange(_ROW, dtype=np.intp) * 256


def _crc_pure(data: bytes) -> int:
    """Takes two bytes a step."""
    pairs, crc = _crc_pairs, 0xFFFFFFFF
    for pair in struct.unpack_from("<%dH" % (len(data) // 2), data):
        crc = pairs[(crc ^ pair) & 0xFFFF] ^ crc >> 16
    if len(data) & 1:
        crc = _crc_table[0][(crc ^ data[-1]) & 255] ^ crc >> 8
    return crc ^ 0xFFFFFFFF


def _crc_numpy(data: bytes) -> int:
    """Looks up the share of each byte by its place in a row of 256 bytes. Then it goes through the rows one after the
    other. Zeros before the message add nothing, so the first row is filled up with them. The register's start is
    XORed into the message's first 4 bytes."""
    rows = -(-len(data) // _ROW)
    padded = np.zeros(rows * _ROW, dtype=np.uint8)
    padded[rows * _ROW - len(data):] = np.frombuffer(data, dtype=np.uint8)
    padded[rows * _ROW - len(data):][:4] ^= 255
    shares = _crc_rows[padded.reshape(rows, _ROW) + _crc_offsets]
    a, b, c, d = _crc_table[255], _crc_table[254], _crc_table[253], _crc_table[252]
    crc = 0
    for share in np.bitwise_xor.reduce(shares, axis=1).tolist():
        crc = a[crc & 255] ^ b[crc >> 8 & 255] ^ c[crc >> 16 & 255] ^ d[crc >> 24] ^ share
    return crc ^ 0xFFFFFFFF


def crc32c(data: bytes) -> int:
    """CRC-32C of RFC 3720."""
    return _crc_numpy(data) if np is not None and len(data) >= 512 else _crc_pure(data)


def _shift_tables() -> List[List[List[int]]]:
    """Entry [k][i][v] is the register after 2^k zero bytes, if its byte i was v and the others were 0. The CRC is
    linear: for a whole register the four entries are XORed."""
    levels = [[[_crc_table[0][v << 8 * i & 255] ^ v << 8 * i >> 8 for v in range(256)] for i in range(4)]]
    for _ in range(16):
        a, b, c, d = levels[-1]
        levels.append([[a[v & 255] ^ b[v >> 8 & 255] ^ c[v >> 16 & 255] ^ d[v >> 24] for v in column]
                       for column in levels[-1]])
    return levels


class _RunningCrc:
    """Sums each byte of a buffer once, and gives the CRC of any piece of it. Damaged and hostile streams need this:
    their wrong payloads may overlap, and a byte may lie in 65536 of them."""
    _shifts = None  # type: Optional[List[List[List[int]]]]

    def __init__(self) -> None:
        self._registers = array.array("I", [0])  # before each byte of the buffer, and after the last
        self.until = 0  # where the last wrong payload ends

    def dropped(self, n: int) -> None:
        """The buffer's first n bytes have gone."""
        del self._registers[:n]
        self.until -= n
        if not self._registers:
            self._registers.append(0)

    def crc(self, data: bytearray, begin: int, end: int) -> int:
        table, registers = _crc_table[0], self._registers
        crc = registers[-1]
        for byte in data[len(registers) - 1:end]:
            crc = table[(crc ^ byte) & 255] ^ crc >> 8
            registers.append(crc)
        if _RunningCrc._shifts is None:
            _RunningCrc._shifts = _shift_tables()
        register = registers[begin] ^ 0xFFFFFFFF
        for level, (a, b, c, d) in enumerate(_RunningCrc._shifts):
            if (end - begin) >> level & 1:
                register = (a[register & 255] ^ b[register >> 8 & 255] ^ c[register >> 16 & 255] ^
                            d[register >> 24])
        return register ^ registers[end] ^ 0xFFFFFFFF


# ---- payloads of fixed layout: struct format, then names; NAME:N stands for N numbers

_LAYOUT = {
    DESCRIPTOR: ("<96s32sII3Q6q5dIIIIQ", "idn profile layout isa prr_uhz lines_uhz pan_udeg_s "
                 "fov_min_udeg sweep_udeg line_start_udeg line_stop_udeg pan_start_udeg pan_stop_udeg "
                 "mirror_counts_per_turn pan_counts_per_turn range_scale_m range_min_m range_max_m "
                 "max_echoes n_surfaces frames scan seed"),
    ANCHOR: ("<4I3dd3d3d9d3dII9dd", "crs epsg station moving anchor:3 scale_m lat_deg lon_deg height_m "
             "station_m:3 rotation:9 scale:3 heights until_ms axes:9 frame"),
    POINTS: ("<IIQqqII", "frame line pulse0 t0_ns line_t0_ns n_pulses n_points"),
    LINE_END: ("<IIQqq9I", "frame line pulse0 t0_ns t1_ns n_fired n_cast n_echoes mirror_count pan_count "
               "status n_crowded n_faint n_unfit"),
    TELEMETRY: ("<II5QIIQq", "state scan pulses echoes lines lost_pulses late_blocks late_max_us "
                "errors_queued reader_lost_frames utc_ns"),
    EVENT: ("<IIQQQ96s", "code reserved a b c text"),
    ATTRIBUTES: ("<QII", "pulse0 line n_points"),
    COLOURS: ("<QII", "pulse0 line n_points"),
    WAVES: ("<QIIIHBBfI", "pulse0 line n_windows sample_ps baseline_16 bits reserved count_signal n_lost"),
    EMITTER: ("<3I4iIQQqII", "kind n_beams steps first_step last_step front_step turn rings sequence_ns_num "
              "sequence_ns_den first_ring_udeg echoes gaps"),
}
_MORE = {  # pieces that may follow in a payload, in this order
    DESCRIPTOR: [("<II", "content reserved")],
    TELEMETRY: [("<3Q", "scan_fired scan_cast scan_lost"), ("<Q", "lost_lines"),
                ("<IIqqQ4I", "ptp_port ptp_servo ptp_offset_ns ptp_delay_ns ptp_grandmaster ptp_class "
                 "ptp_accuracy ptp_flags ptp_reserved")],
}


def _unpacker(form: str, names: str) -> Tuple[struct.Struct, List[Tuple[str, int]]]:
    parts = [name.partition(":") for name in names.split()]
    return struct.Struct(form), [(name, int(count or 0)) for name, _, count in parts]


_UNPACK = {kind: _unpacker(*layout) for kind, layout in _LAYOUT.items()}
_UNPACK_MORE = {kind: [_unpacker(*layout) for layout in layouts] for kind, layouts in _MORE.items()}
_POSE = struct.Struct("<q3d4ddII")
_POINT = struct.Struct("<IIIhHI")
_BEAM = struct.Struct("<iiI")
_WAVE, _WAVE_COUNTS, _WAVE_SLOPES, _MAX_SAMPLES = struct.Struct("<3IHH3I"), "<III", "<fff", 4096


def _text(field: bytes) -> str:
    end = field.find(b"\0")
    if end < 0:
        raise ScanheadError("a frame with a good CRC holds a text without an end")
    return field[:end].decode("ascii", "replace")


def _take(layout, payload: bytes, offset: int) -> Dict[str, object]:
    form, names = layout
    values, at, fields = form.unpack_from(payload, offset), 0, {}
    for name, count in names:
        value = values[at:at + count] if count else values[at]
        fields[name] = _text(value) if isinstance(value, bytes) else value
        at += count or 1
    if not all(math.isfinite(v) for v in values if isinstance(v, float)):
        raise ScanheadError("a frame with a good CRC holds a number that is not finite")
    return fields


def _decode(kind: int, payload: bytes) -> Dict[str, object]:
    """Returns the fields of a payload's fixed part. Bytes after the parts that are known are ignored."""
    form = _UNPACK[kind][0]
    if len(payload) < form.size:
        raise ScanheadError(f"a frame of type {kind} with {len(payload)} bytes; {form.size} are the least")
    fields = _take(_UNPACK[kind], payload, 0)
    at = form.size
    for more in _UNPACK_MORE.get(kind, ()):
        if len(payload) < at + more[0].size:
            break
        fields.update(_take(more, payload, at))
        at += more[0].size
    return fields


class Frame(NamedTuple):
    """A frame as it came. t_ns: device time. fields: the fixed part of the payload by its names."""
    type: int
    version: int
    flags: int
    seq: int
    t_ns: int
    payload: bytes
    fields: Dict[str, object]

    def is_event(self, code: int) -> bool:
        return self.type == EVENT and self.fields.get("code") == code


# ---- bytes into frames and reply lines ("Sequence numbers", "Resynchronisation")

class Notice(NamedTuple):
    """Something wrong in the stream; each thing gives one. kind is one of
        gap          n frames are missing, from seq on
        repeated     a frame came once more
        late         a frame that was missing came after newer ones; frames() gives neither this one nor a repeated one
        restarted    another sequence begins with seq: the head started again
        bad payload  a frame whose header is right, and whose payload is not; n bytes of it
        bad bytes    n bytes that belong to nothing
        cut          the stream ended within a frame or a line; n bytes of it
        echo         the command that was sent came back before its reply
        late reply   a reply to a command that was given up; unasked: a reply to no command
        closed       the connection is over
    at_byte: where it begins in all bytes that came; of a gap, the frame that came instead. t_ns: device time of
    the frame that it is about, or else of the last whole frame before; None: none came yet."""
    kind: str
    at_byte: int
    seq: int
    n: int
    t_ns: Optional[int]


class _Sequence:
    """The numbers of frames: what is missing, came already, or too late."""

    def __init__(self) -> None:
        self._next = None  # type: Optional[int]
        self._seen = collections.deque(maxlen=_SEEN)
        self._gaps = collections.deque(maxlen=_GAPS)  # [first number, how many]
        self._local = None  # type: Optional[Tuple]
        self._last_late, self._late_run = 0, 0  # the last late frame; how many came in a row up to it
        self.again, self._again_next = 0, 0  # repeated frames that came last, with numbers up to _again_next - 1

    def take(self, frame: Tuple) -> Tuple[str, int, int]:
        """frame: its number, its flags, and all that tells it from others. Returns the kind of its notice ("": there is
        none), and which frames it concerns: the number of the first one, and how many they are."""
        seq, flags = frame[:2]
        if flags & LOCAL:
            kind = "repeated" if frame == self._local else ""
            self._local = frame
            return kind, seq, 1
        self._local = None
        kind, first, n = ("", seq, 1) if seq == self._next or self._next is None else self._jump(frame)
        if seq != self._again_next:
            self.again = 0
        if kind == "repeated":
            self.again, self._again_next = self.again + 1, (seq + 1) % 2**32
        else:
            self._seen.append(frame)
        if kind not in ("repeated", "late"):
            self._next, self._late_run = (seq + 1) % 2**32, 0
        return kind, first, n

    def _jump(self, frame: Tuple) -> Tuple[str, int, int]:
        seq, expected = frame[0], self._next or 0
        missing = (seq - expected) % 2**32
        if missing < 2**31:
            self._add_gap(expected, missing)
            return "gap", expected, missing
        if frame in self._seen:
            return "repeated", seq, 1
        if self._fills_gap(seq) and not self._is_run(seq):
            return "late", seq, 1
        self._seen.clear()
        self._gaps.clear()
        return "restarted", seq, 1

    def _fills_gap(self, seq: int) -> bool:
        for gap in self._gaps:
            before = (seq - gap[0]) % 2**32
            if before < gap[1]:
                rest, gap[1] = gap[1] - before - 1, before
                if gap is self._gaps[0] and len(self._gaps) == _GAPS:
                    self._gaps.rotate(-1)  # it stays, and the next oldest makes room for its second part
                self._add_gap((seq + 1) % 2**32, rest)
                return True
        return False

    def _is_run(self, seq: int) -> bool:
        """Returns whether this is the _LATE_RUN-th late frame in a row. Then these frames are not late: they belong to
        another sequence, whose numbers happened to be missing ones."""
        follows = self._late_run > 0 and seq == (self._last_late + 1) % 2**32
        self._late_run, self._last_late = self._late_run + 1 if follows else 1, seq
        return self._late_run == _LATE_RUN

    def _add_gap(self, first: int, n: int) -> None:
        if 0 < n <= _GAP_MOST:
            self._gaps.append([first, n])


class _Bad:
    """A run of bytes that belong to no frame or line. most: the length of a broken frame, as its header says."""

    def __init__(self, kind: str, at_byte: int, t_ns: Optional[int], seq: Optional[int] = None,
                 most: float = math.inf) -> None:
        self.kind, self.at_byte, self.t_ns, self.seq, self.most, self.n = kind, at_byte, t_ns, seq, most, 0


class Parser:
    """Takes bytes as they come and gives frames and reply lines. Once next() gives None, it holds less than one frame.
    on_notice gets a Notice of each thing that is wrong, before the item that follows it."""

    def __init__(self, on_notice: Optional[Callable[[Notice], None]] = None) -> None:
        self._bytes, self._at = bytearray(), 0
        self._in_step, self._sequence = True, _Sequence()
        self._bad = None  # type: Optional[_Bad]
        self._running = None  # type: Optional[_RunningCrc]
        self.on_notice = on_notice
        self.last_t_ns = None  # type: Optional[int]  # of the last whole frame
        self.text_at = 0  # of the line given last, in all bytes
        self.bytes = self.frames = self.bad_payload = self.bad_bytes = 0
        self.seq_gaps = self.seq_lost = 0  # jumps of the sequence; frames missing by jumps forward
        self.repeated = self.late = self.restarts = self.cuts = 0  # notices of these kinds

    def feed(self, data: bytes) -> None:
        del self._bytes[:self._at]
        if self._running is not None:
            self._running.dropped(self._at)
        self._at = 0
        self._bytes += data
        self.bytes += len(data)

    def next(self, last: bool = False) -> Union[Frame, str, None]:
        """A frame, a reply line without its end, or None: more bytes are needed. last: none will come."""
        while self._at < len(self._bytes):
            first, item, wait = self._bytes[self._at], None, False
            if first == 0xD5:
                item, wait = self._frame()
            elif self._in_step and 0x20 <= first <= 0x7E:
                item, wait = self._line()
            if isinstance(item, _Dropped):
                continue
            if item is not None:
                return item
            if wait and not last:
                return None
            if wait:
                self._begin_cut()
            self._skip()
        if last:
            self._end_bad(at_end=True)
        return None

    # -- bytes that belong to nothing

    def _at_byte(self) -> int:
        return self.bytes - len(self._bytes) + self._at

    def _notice(self, *fields) -> None:
        if self.on_notice is not None:
            self.on_notice(Notice(*fields))

    def _end_bad(self, at_end: bool = False) -> None:
        """Ends the run of bad bytes: good bytes follow or, at_end, nothing. A frame that seemed to be cut by the end
        was broken if good bytes follow within its length."""
        bad, self._bad = self._bad, None
        if bad is None:
            return
        if bad.kind == "cut" and not at_end:
            bad.kind = "bad bytes" if bad.seq is None else "bad payload"
            self.bad_payload += bad.seq is not None
        self.cuts += bad.kind == "cut"
        self._notice(bad.kind, bad.at_byte, bad.seq or 0, bad.n, bad.t_ns)

    def _begin_bad(self, bad: _Bad) -> None:
        self._end_bad()
        self._bad = bad

    def _begin_cut(self) -> None:
        """No more bytes will come, and what is at hand is not whole."""
        header = self._bytes[self._at:self._at + _HEADER_LEN]
        if header[0] == 0xD5 and len(header) == _HEADER_LEN:
            length, seq, t_ns = struct.unpack("<4xII4xq4x", header)
            self._begin_bad(_Bad("cut", self._at_byte(), t_ns, seq, _HEADER_LEN + length))
        elif self._bad is None or self._bad.n == self._bad.most:
            self._begin_bad(_Bad("cut", self._at_byte(), self.last_t_ns))

    def _skip(self) -> None:
        sync = self._bytes.find(0xD5, self._at + 1)
        end = sync if sync >= 0 else len(self._bytes)
        at_byte, n = self._at_byte(), end - self._at
        self.bad_bytes += n
        if self._bad is not None and self._bad.n + n > self._bad.most:  # bytes beyond the broken frame: another run
            own = int(self._bad.most) - self._bad.n
            self._bad.n += own
            at_byte, n = at_byte + own, n - own
            self._begin_bad(_Bad("bad bytes", at_byte, self.last_t_ns))
        if self._bad is None:
            self._begin_bad(_Bad("bad bytes", at_byte, self.last_t_ns))
        self._bad.n += n
        self._at, self._in_step = end, False

    # -- frames

    def _frame(self) -> Tuple[Union[Frame, "_Dropped", None], bool]:
        header = bytes(self._bytes[self._at:self._at + _HEADER_LEN])
        if len(header) < _HEADER_LEN:
            return None, True
        kind, version, flags, length, seq, crc, t_ns, header_crc = struct.unpack("<xBBBIIIqI", header)
        if length > _MAX_PAYLOAD or _crc_pure(header[:24]) != header_crc:
            return None, False
        begin = self._at + _HEADER_LEN
        if len(self._bytes) < begin + length:
            return None, True
        payload = bytes(self._bytes[begin:begin + length])
        running = self._running
        if (crc32c(payload) if running is None else running.crc(self._bytes, begin, begin + length)) != crc:
            self.bad_payload += 1
            self._begin_bad(_Bad("bad payload", self._at_byte(), t_ns, seq, _HEADER_LEN + length))
            self._running = running or _RunningCrc()
            self._running.until = max(self._running.until, begin + length)
            return None, False
        self._end_bad()
        drop = self._is_dropped((seq, flags, kind, t_ns, length, crc))
        self._at, self._in_step, self.last_t_ns = begin + length, True, t_ns
        if running is not None and running.until <= self._at:
            self._running = None
        if drop:
            return _DROPPED, False
        self.frames += 1
        return Frame(kind, version, flags, seq, t_ns, payload, {}), False

    def frames_again(self) -> int:
        """How many repeated frames came last, with consecutive numbers up to the last whole frame's."""
        return self._sequence.again

    def _is_dropped(self, frame: Tuple) -> bool:
        kind, first, n = self._sequence.take(frame)
        if not kind:
            return False
        self.seq_gaps += kind in ("gap", "restarted")
        self.seq_lost += n if kind == "gap" else 0
        self.restarts += kind == "restarted"
        self.repeated += kind == "repeated"
        self.late += kind == "late"
        self._notice(kind, self._at_byte(), first, n, frame[3])
        return kind in ("repeated", "late")

    def _line(self) -> Tuple[Optional[str], bool]:
        text = bytes(self._bytes[self._at:self._at + _MAX_TEXT])
        end = text.find(b"\r\n")
        line = text if end < 0 else text[:end]
        if end < 0 and line.endswith(b"\r"):
            line = line[:-1]
        if not all(0x20 <= c <= 0x7E for c in line):
            return None, False
        if end < 0:
            return None, len(text) < _MAX_TEXT
        self._end_bad()
        self.text_at = self._at_byte()
        self._at += end + 2
        return line.decode("ascii"), False


class _Dropped:
    """Stands for a frame that is repeated or late, and not given."""


_DROPPED = _Dropped()


# ---- points as columns

class Points:
    """Columns of one points frame, one entry per record, in order of pulse, then of range.

    x, y, z: polar layout: metres in the head's frame; geo layout: in the CRS (geodetic: degrees of latitude,
    degrees of longitude within -180..180, metres). range_m; mirror_rad and pan_rad (polar); reflectance_db;
    t_ns since the scan's start; echo and echo_count (0, 0: a shot without echo, its place is NaN); label."""
    __slots__ = ("x", "y", "z", "range_m", "mirror_rad", "pan_rad", "reflectance_db", "t_ns", "echo",
                 "echo_count", "label", "layout")

    def __len__(self) -> int:
        return len(self.t_ns)


class Wave(NamedTuple):
    """A window of samples of one pulse's waveform. All windows of a pulse have one grid, whose sample 0 is taken when
    the pulse fires.

    pulse: its number in the scan; t_ns since the scan's start. first: number of the first sample on the grid.
    direction: polar layout: the beam in the head's frame, of length one; geo layout: the change of x, y and z in
    the CRS along a metre of range. baseline: the count without light; count_signal: signal of one count, in units
    of the detection threshold."""
    pulse: int
    t_ns: int
    first: int
    counts: Tuple[int, ...]
    direction: Tuple[float, ...]
    sample_ps: int
    bits: int
    baseline: float
    count_signal: float

    @property
    def step_m(self) -> float:
        """The range from one sample to the next."""
        return 1e-3 * self.sample_ps * _M_PER_NS

    def range_m(self, i: int = 0) -> float:
        """The range of sample i of the window."""
        return (self.first + i) * self.step_m

    def signal(self) -> List[float]:
        """The samples in units of the detection threshold, without the baseline."""
        return [(count - self.baseline) * self.count_signal for count in self.counts]


def _wave_records(payload: bytes, n: int) -> Iterator[Tuple]:
    """Yields for each of n windows its record's numbers, and where its samples begin."""
    at = _UNPACK[WAVES][0].size
    for _ in range(n):
        if len(payload) - at < _WAVE.size:
            raise ScanheadError("a waveforms frame shorter than its windows")
        record = _WAVE.unpack_from(payload, at)
        counts_at, samples = at + _WAVE.size, record[3]
        at = counts_at + 2 * (samples + (samples & 1))
        if not 1 <= samples <= _MAX_SAMPLES or at > len(payload):
            raise ScanheadError("a window without samples, or with more than its frame has")
        yield record, counts_at


def _wave_direction(payload: bytes, at: int, d: Dict) -> Tuple[float, ...]:
    """Returns the direction of the beam from the three words at `at`."""
    if d["layout"] == GEO:
        return struct.unpack_from(_WAVE_SLOPES, payload, at)
    _, mirror, pan = struct.unpack_from(_WAVE_COUNTS, payload, at)
    mirror_rad, pan_rad = (_TWO_PI * (count / d[turn]) for count, turn in (
        (mirror, "mirror_counts_per_turn"), (pan, "pan_counts_per_turn")))
    flat = math.cos(mirror_rad)
    return math.sin(pan_rad) * flat, math.cos(pan_rad) * flat, math.sin(mirror_rad)


def _column(values, n: int):
    """An iterable of n numbers as a column."""
    return np.fromiter(values, dtype=np.float64, count=n) if np is not None else list(values)


def _mapped(function, *columns):
    """function of each row, in plain floats: the same numbers with numpy and without."""
    plain = [c.tolist() if np is not None and isinstance(c, np.ndarray) else c for c in columns]
    return _column(map(function, *plain), len(plain[0]))


_PARTS, _TWO_PI = 256, 6.283185307179586476925
_M_PER_NS = 0.5 * 0.299792458  # range of one nanosecond of a pulse's way out and back
_SIN = [math.sin(_TWO_PI * i / _PARTS) for i in range(_PARTS)]
_COS = [math.cos(_TWO_PI * i / _PARTS) for i in range(_PARTS)]
if np is not None:
    _NP_SIN, _NP_COS = np.array(_SIN), np.array(_COS)


def _sincos(turns):
    """sin and cos of turns >= 0, a float or an array. A table has whole 1/256 turns, and a series the rest; its next
    terms are below 2^-56. libscanhead computes the same, in the same order."""
    part = turns * _PARTS
    if np is not None and isinstance(turns, np.ndarray):
        k = (part + 0.5).astype(np.int64)
        sk, ck = _NP_SIN[k & _PARTS - 1], _NP_COS[k & _PARTS - 1]
    else:
        k = int(part + 0.5)
        sk, ck = _SIN[k & _PARTS - 1], _COS[k & _PARTS - 1]
    r = (part - k) * (_TWO_PI / _PARTS)
    r2 = r * r
    sin_r = r + r * r2 * (-1.0 / 6 + r2 * (1.0 / 120))
    cos_r_1 = r2 * (-0.5 + r2 * (1.0 / 24 - r2 * (1.0 / 720)))
    return sk + (ck * sin_r + sk * cos_r_1), ck + (ck * cos_r_1 - sk * sin_r)


def _fold(turns, low: float):
    """Folds turns into low .. low + 1."""
    v = turns - low
    if np is not None and isinstance(v, np.ndarray):
        whole = v.astype(np.int64).astype(np.float64)
        return turns - np.where(whole > v, whole - 1, whole)
    whole = float(int(v))
    return turns - (whole - 1 if whole > v else whole)


def _raw_columns(payload: bytes, n: int):
    """a, b, c, reflectance, label, tail of n records."""
    if np is None:
        rows = _POINT.iter_unpack(payload[40:40 + 20 * n])
        return list(map(list, zip(*rows))) if n else [[] for _ in range(6)]
    kind = np.dtype([("a", "<u4"), ("b", "<u4"), ("c", "<u4"), ("r", "<i2"), ("l", "<u2"), ("t", "<u4")])
    rows = np.frombuffer(payload, dtype=kind, count=n, offset=40)
    return [rows[name] for name in "abcrlt"]


def _common(raw, t0_ns: int, layout: int) -> Points:
    """The columns that both layouts share."""
    p = Points()
    refl, label, tail = raw[3:]
    if np is not None:
        tail = tail.astype(np.int64)
        p.t_ns, p.echo, p.echo_count = t0_ns + (tail & 0xFFFFFF), tail >> 24 & 15, tail >> 28
        p.reflectance_db = np.where(refl == -32768, _NAN, refl / 100.0)
        p.label = label.astype(np.int64)
    else:
        p.t_ns = [t0_ns + (t & 0xFFFFFF) for t in tail]
        p.echo, p.echo_count = [t >> 24 & 15 for t in tail], [t >> 28 for t in tail]
        p.reflectance_db = [_NAN if r == -32768 else r / 100.0 for r in refl]
        p.label = label
    p.layout = layout
    return p


def _empty_as_nan(values, count):
    if np is not None:
        return np.where(count == 0, _NAN, values)
    return [_NAN if n == 0 else v for v, n in zip(values, count)]


def _rings(e: Dict) -> Dict:
    """The rings of a sphere: ring i has the elevation first_ring_deg + i ring_step_deg. On the wire the first one is
    rounded."""
    gaps = e["gaps"] or max(e["rings"], 1) - 1
    first_deg = 1e-6 * e["first_ring_udeg"]
    if gaps == 0:
        return {"first_ring_deg": first_deg, "ring_step_deg": 0.0}
    return {"first_ring_deg": math.floor((first_deg + 90) * gaps / 180 + 0.5) * 180 / gaps - 90,
            "ring_step_deg": 180 / gaps}


def _polar_points(p: Points, raw, d: Dict, is_line_head: bool) -> None:
    mirror_turn, pan_turn = 1 / d["mirror_counts_per_turn"], 1 / d["pan_counts_per_turn"]
    scale = d["range_scale_m"]
    low = (d["line_start_udeg"] + d["line_stop_udeg"]) / 720e6 - 0.5 if is_line_head else -0.5

    def place(a, b, c):
        mirror, pan, range_m = b * mirror_turn, c * pan_turn, scale * a
        sin_m, cos_m = _sincos(mirror)
        sin_pan, cos_pan = _sincos(pan)
        flat = range_m * cos_m
        return (flat * sin_pan, flat * cos_pan, range_m * sin_m, range_m, _TWO_PI * _fold(mirror, low),
                _TWO_PI * _fold(pan, 0.0))

    if np is not None:
        columns = place(*(c.astype(np.float64) for c in raw[:3]))
    else:
        columns = list(map(list, zip(*map(place, *raw[:3])))) or [[] for _ in range(6)]
    p.x, p.y, p.z, p.range_m = (_empty_as_nan(c, p.echo_count) for c in columns[:4])
    p.mirror_rad, p.pan_rad = columns[4:]


def _short_way(lon_deg: float) -> float:
    return lon_deg - 360 if lon_deg > 180 else lon_deg + 360 if lon_deg < -180 else lon_deg


def _signed(column):
    """The coordinates of the geo layout are signed."""
    if np is not None:
        return np.ascontiguousarray(column).view(np.int32).astype(np.float64)
    return [float((v ^ 0x80000000) - 0x80000000) for v in column]


def _scaled(column, scale: float, shift: float = 0.0):
    if np is not None:
        return shift + scale * column
    return [shift + scale * v for v in column]


def _geo_points(p: Points, raw, a: Dict) -> None:
    """Fills in the columns of the geo layout. range_m is the straight distance from the anchor, which is the station. A
    head that moves has no such place, so its range_m is NaN."""
    d = [_scaled(_signed(c), s) for c, s in zip(raw[:3], a["scale"])]
    x, y, z = (_scaled(v, 1.0, shift) for v, shift in zip(d, a["anchor"]))
    if a["crs"] == CRS_GEODETIC:
        y = _mapped(_short_way, y)
    if a["moving"] & 1:
        p.range_m = _column((_NAN for _ in range(len(p))), len(p))
    elif a["crs"] == CRS_GEODETIC:
        lat_deg, lon_deg, height_m = a["anchor"]
        geoid_m = a["height_m"] - height_m if a["heights"] == 1 else 0.0
        home = geodetic_to_ecef(lat_deg, lon_deg, height_m + geoid_m)
        p.range_m = _mapped(lambda lat, lon, h: _distance(geodetic_to_ecef(lat, lon, h + geoid_m), home), x, y, z)
    else:
        p.range_m = _mapped(_length, *d)
    p.x, p.y, p.z, p.range_m = (_empty_as_nan(c, p.echo_count) for c in (x, y, z, p.range_m))
    p.mirror_rad = p.pan_rad = _column((_NAN for _ in range(len(p))), len(p))


def _length(x: float, y: float, z: float) -> float:
    return math.sqrt(x * x + y * y + z * z)


def _distance(a, b) -> float:
    return _length(a[0] - b[0], a[1] - b[1], a[2] - b[2])


# ---- poses of a moving head

def _rotation(q) -> Tuple[float, ...]:
    """The rotation matrix of the unit quaternion w, x, y, z, row by row."""
    w, x, y, z = q
    return (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
            2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
            2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y))


def _apply(m, v):
    return tuple(m[3 * i] * v[0] + m[3 * i + 1] * v[1] + m[3 * i + 2] * v[2] for i in range(3))


def _apply_transposed(m, v):
    return tuple(m[i] * v[0] + m[3 + i] * v[1] + m[6 + i] * v[2] for i in range(3))


def _multiply(a, b):
    return tuple(sum(a[3 * row + k] * b[3 * k + column] for k in range(3))
                 for row in range(3) for column in range(3))


def _cross(a, b):
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


class Pose(NamedTuple):
    """Where the head was: scene frame, metres; quaternion w, x, y, z from the head's frame to the scene's."""
    t_ns: int
    position_m: Tuple[float, float, float]
    quat: Tuple[float, float, float, float]
    frame: float
    flags: int


class _Leg(NamedTuple):
    """The motion from one pose to the next. The turn's axis is in the head's frame."""
    a: Pose
    b: Pose
    rotation: Tuple[float, ...]
    axis: Tuple[float, float, float]
    angle_rad: float

    def fraction(self, t_ns: int) -> float:
        return (t_ns - self.a.t_ns) / (self.b.t_ns - self.a.t_ns)

    def position_m(self, f: float) -> Tuple[float, ...]:
        return tuple(p + f * (q - p) for p, q in zip(self.a.position_m, self.b.position_m))


def _quat_times(a, b):
    return (a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0])


def _leg(a: Pose, b: Pose) -> _Leg:
    d = _quat_times((a.quat[0], -a.quat[1], -a.quat[2], -a.quat[3]), b.quat)
    sign, sine = -1.0 if d[0] < 0 else 1.0, _length(*d[1:])
    axis = tuple(sign * v / sine for v in d[1:]) if sine > 0 else (1.0, 0.0, 0.0)
    return _Leg(a, b, _rotation(a.quat), axis, 2 * math.atan2(sine, sign * d[0]))


class _Poses:
    """Keeps the latest poses frames, newest last."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        self._frames = collections.deque()
        self._n = 0

    def absorb(self, frame: Frame) -> None:
        payload = frame.payload
        n = struct.unpack_from("<I", payload)[0] if len(payload) >= 8 else 0
        if n < 2 or n > (len(payload) - 8) // _POSE.size:
            raise ScanheadError("a poses frame with a wrong number of poses")
        records = _POSE.iter_unpack(payload[8:8 + n * _POSE.size])
        poses = [Pose(p[0], p[1:4], p[4:8], p[8], p[9]) for p in records]
        times = [p.t_ns for p in poses]
        if any(a >= b for a, b in zip(times, times[1:])):
            raise ScanheadError("a poses frame whose times do not rise")
        if not all(abs(sum(v * v for v in p.quat) - 1) < 1e-9 and
                   all(map(math.isfinite, p.position_m + (p.frame,))) for p in poses):
            raise ScanheadError("a poses frame with numbers that are no pose")
        self._frames.append((times, poses))
        self._n += n
        while self._n > _KEEP_POSES:
            self._n -= len(self._frames.popleft()[0])

    def leg(self, t_ns: int) -> Optional[_Leg]:
        for times, poses in reversed(self._frames):
            if times[0] <= t_ns <= times[-1]:
                i = min(bisect.bisect_right(times, t_ns), len(times) - 1)
                return _leg(poses[i - 1], poses[i])
        return None


def _place_moving(leg: _Leg, t_ns: int, v) -> Tuple[float, float, float]:
    """Turns v by Rodrigues' formula in the head's frame, then by the rotation at the leg's begin."""
    f = leg.fraction(t_ns)
    angle = f * leg.angle_rad
    s, versine = math.sin(angle), 1 - math.cos(angle)
    u = _cross(leg.axis, v)
    w = _cross(leg.axis, u)
    turned = _apply(leg.rotation, tuple(v[i] + (s * u[i] + versine * w[i]) for i in range(3)))
    return tuple(p + t for p, t in zip(leg.position_m(f), turned))


# ---- places on the Earth: WGS 84 (NIMA TR8350.2); transverse Mercator as Krueger's series in the form of
# Karney, Journal of Geodesy 85 (2011) 475; polar stereographic as Snyder, USGS Professional Paper 1395
# (1987) 161

class _Plain:
    """The functions of numpy that are used here, for plain floats."""
    sin, cos, tan, sinh, cosh = math.sin, math.cos, math.tan, math.sinh, math.cosh
    sqrt, hypot, exp = math.sqrt, math.hypot, math.exp
    arctan, arctan2, arcsinh, arctanh = math.atan, math.atan2, math.asinh, math.atanh


_A_M, _F, _RAD = 6378137.0, 1 / 298.257223563, math.pi / 180.0
_E2, _N3 = _F * (2 - _F), _F / (2 - _F)
_E = math.sqrt(_E2)
_RADIUS_M = _A_M / (1 + _N3) * (1 + _N3 ** 2 / 4 + _N3 ** 4 / 64)
# Terms up to the fourth power of the third flattening; what is left out is below 0.1 um within a zone.
_ALPHA = (_N3 / 2 - _N3 ** 2 * 2 / 3 + _N3 ** 3 * 5 / 16 + _N3 ** 4 * 41 / 180,
          _N3 ** 2 * 13 / 48 - _N3 ** 3 * 3 / 5 + _N3 ** 4 * 557 / 1440,
          _N3 ** 3 * 61 / 240 - _N3 ** 4 * 103 / 140, _N3 ** 4 * 49561 / 161280)
_BETA = (_N3 / 2 - _N3 ** 2 * 2 / 3 + _N3 ** 3 * 37 / 96 - _N3 ** 4 / 360,
         _N3 ** 2 / 48 + _N3 ** 3 / 15 - _N3 ** 4 * 437 / 1440,
         _N3 ** 3 * 17 / 480 - _N3 ** 4 * 37 / 840, _N3 ** 4 * 4397 / 161280)
_UPS_M = 2 * _A_M * 0.994 / math.sqrt((1 + _E) ** (1 + _E) * (1 - _E) ** (1 - _E))


def geodetic_to_ecef(lat_deg, lon_deg, height_m, m=_Plain):
    """X, Y, Z in metres."""
    s, c = m.sin(lat_deg * _RAD), m.cos(lat_deg * _RAD)
    n = _A_M / m.sqrt(1 - _E2 * s * s)
    return (n + height_m) * c * m.cos(lon_deg * _RAD), (n + height_m) * c * m.sin(lon_deg * _RAD), \
        (n * (1 - _E2) + height_m) * s


def ecef_to_geodetic(x_m, y_m, z_m, m=_Plain):
    """Latitude, longitude in degrees, ellipsoidal height in metres. Bowring's iteration (Survey Review 23,
    1976); near the Earth only rounding errors are left after three steps."""
    p = m.hypot(x_m, y_m)
    beta = m.arctan2(z_m, (1 - _F) * p)
    for _ in range(3):
        s, c = m.sin(beta), m.cos(beta)
        lat = m.arctan2(z_m + _E2 / (1 - _F) * _A_M * s * s * s, p - _E2 * _A_M * c * c * c)
        beta = m.arctan2((1 - _F) * m.sin(lat), m.cos(lat))
    s = m.sin(lat)
    return lat / _RAD, m.arctan2(y_m, x_m) / _RAD, p * m.cos(lat) + z_m * s - _A_M * m.sqrt(1 - _E2 * s * s)


def _conformal(tau, m):
    """tan of the latitude -> tan of the conformal latitude."""
    sec = m.sqrt(1 + tau * tau)
    sigma = m.sinh(_E * m.arctanh(_E * tau / sec))
    return tau * m.sqrt(1 + sigma * sigma) - sigma * sec


def _geographic(tau_c, m):
    """The inverse of _conformal, by Newton's method. Five steps are enough at any latitude (Karney's equations 19 to
    21)."""
    tau = tau_c / (1 - _E2)
    for _ in range(5):
        now = _conformal(tau, m)
        tau = tau + (tau_c - now) / m.sqrt(1 + now * now) * (1 + (1 - _E2) * tau * tau) / \
            ((1 - _E2) * m.sqrt(1 + tau * tau))
    return tau


def _series(coefficients, xi, eta, m):
    """The sums of sin 2j xi cosh 2j eta and cos 2j xi sinh 2j eta."""
    a = b = 0.0
    for j, c in enumerate(coefficients, 1):
        a = a + c * m.sin(2 * j * xi) * m.cosh(2 * j * eta)
        b = b + c * m.cos(2 * j * xi) * m.sinh(2 * j * eta)
    return a, b


class _Grid:
    """UTM or UPS of an EPSG code: degrees <-> easting, northing in metres."""

    def __init__(self, epsg: int) -> None:
        self.ups, self.south = epsg in (32661, 32761), epsg // 100 == 327
        self.lon0_deg = 6 * (epsg % 100) - 183
        if not self.ups and not (epsg // 100 in (326, 327) and 1 <= epsg % 100 <= 60):
            raise ScanheadError(f"EPSG {epsg} is neither UTM nor UPS on WGS 84")

    def forward(self, lat_deg, lon_deg, m):
        tau_c = _conformal(m.tan(lat_deg * _RAD), m)
        if self.ups:
            lon, side = lon_deg * _RAD, -1.0 if self.south else 1.0
            rho = _UPS_M * m.exp(-m.arcsinh(side * tau_c))  # t + sqrt(1 + t^2), which is 0 about the other pole
            return 2e6 + rho * m.sin(lon), 2e6 - side * rho * m.cos(lon)
        lon = (lon_deg - self.lon0_deg) * _RAD
        xi, eta = m.arctan2(tau_c, m.cos(lon)), m.arcsinh(m.sin(lon) / m.hypot(tau_c, m.cos(lon)))
        a, b = _series(_ALPHA, xi, eta, m)
        north0_m, radius_m = 1e7 if self.south else 0.0, 0.9996 * _RADIUS_M
        return 5e5 + radius_m * (eta + b), north0_m + radius_m * (xi + a)

    def inverse(self, easting_m, northing_m, m):
        if self.ups:
            side = -1.0 if self.south else 1.0
            x, y = easting_m - 2e6, side * (2e6 - northing_m)
            t = (m.hypot(x, y) + 1e-30) / _UPS_M
            return m.arctan(_geographic(side * (1 / t - t) / 2, m)) / _RAD, m.arctan2(x, y) / _RAD
        xi = (northing_m - (1e7 if self.south else 0.0)) / (0.9996 * _RADIUS_M)
        eta = (easting_m - 5e5) / (0.9996 * _RADIUS_M)
        a, b = _series(_BETA, xi, eta, m)
        xi, eta = xi - a, eta - b
        tau = _geographic(m.sin(xi) / m.hypot(m.sinh(eta), m.cos(xi)), m)
        return m.arctan(tau) / _RAD, self.lon0_deg + m.arctan2(m.sinh(eta), m.cos(xi)) / _RAD

    def convergence_rad(self, lat_deg: float, lon_deg: float) -> float:
        """Bearing of grid north, clockwise from true north: by differences over 22 m, good to 1e-10 rad."""
        if self.ups:
            return -lon_deg * _RAD if self.south else lon_deg * _RAD
        (e0, n0), (e1, n1) = (self.forward(lat_deg + d, lon_deg, _Plain) for d in (-1e-4, 1e-4))
        return math.atan2(e0 - e1, n1 - n0)


def _grid_of(station_m, lat_deg: float, lon_deg: float) -> Optional[int]:
    """Returns the EPSG code of the scene's grid: the one in which the place has the station's coordinates. None: the
    scene is in no grid."""
    zone = int((lon_deg + 180) // 6)
    codes = [side + (zone + k) % 60 + 1 for side in (32600, 32700) for k in (-1, 0, 1)] + [32661, 32761]
    for epsg in codes:
        at = _Grid(epsg).forward(lat_deg, lon_deg, _Plain)
        if max(abs(at[0] - station_m[0]), abs(at[1] - station_m[1])) < 1e-3:
            return epsg
    return None


class _Earth:
    """Takes places from the scene to the CRS and back, as the anchor says. Errors are those of rounding, 0.1 um of
    the series, and the geoid, which is taken to be as high everywhere as at the station."""

    def __init__(self, anchor: Dict, layout: int) -> None:
        self.crs, self.station_m = anchor["crs"], anchor["station_m"]
        self.same = self.crs == CRS_LOCAL
        self.geoid_m = self.lift_m = 0.0
        if self.same:
            return
        place = anchor["lat_deg"], anchor["lon_deg"], anchor["height_m"]
        if anchor["heights"] == 1:
            if anchor["moving"] & 1 and layout == GEO:
                raise ScanheadError("the stream doesn't say how high the geoid is along the trajectory")
            self.geoid_m = place[2] - anchor["anchor"][2]
        grid = _grid_of(self.station_m, *place[:2])
        self.same = grid is not None and grid == anchor["epsg"]
        self.own = _Grid(grid) if grid is not None else None
        if self.own is not None:
            self.lift_m = self.station_m[2] - place[2]  # a scene in a grid has heights that differ by this
        self.grid = _Grid(anchor["epsg"]) if self.crs == CRS_UTM else None
        self.home = geodetic_to_ecef(*place)
        self.turn = self._rotation(anchor)

    def _rotation(self, anchor: Dict) -> Tuple[float, ...]:
        """Scene frame -> ECEF."""
        turn = anchor["axes"]
        if self.crs == CRS_ECEF:
            return turn
        lat_deg, lon_deg = anchor["anchor"][:2]
        if self.grid is not None:
            lat_deg, lon_deg = self.grid.inverse(*anchor["anchor"][:2], _Plain)
            g = self.grid.convergence_rad(lat_deg, lon_deg)
            turn = _multiply((math.cos(g), math.sin(g), 0, -math.sin(g), math.cos(g), 0, 0, 0, 1), turn)
        s, c = math.sin(lat_deg * _RAD), math.cos(lat_deg * _RAD)
        sl, cl = math.sin(lon_deg * _RAD), math.cos(lon_deg * _RAD)
        return _multiply((-sl, -s * cl, c * cl, cl, -s * sl, c * sl, 0, c, s), turn)

    def forward(self, x_m, y_m, z_m, m):
        if self.same:
            return x_m, y_m, z_m - self.lift_m - self.geoid_m
        if self.own is not None:
            lat_deg, lon_deg = self.own.inverse(x_m, y_m, m)
            height_m = z_m - self.lift_m
            if self.crs == CRS_ECEF:
                return geodetic_to_ecef(lat_deg, lon_deg, height_m, m)
        else:
            d = _apply(self.turn, (x_m - self.station_m[0], y_m - self.station_m[1], z_m - self.station_m[2]))
            at = tuple(h + v for h, v in zip(self.home, d))
            if self.crs == CRS_ECEF:
                return at
            lat_deg, lon_deg, height_m = ecef_to_geodetic(*at, m)
        if self.grid is not None:
            lat_deg, lon_deg = self.grid.forward(lat_deg, lon_deg, m)
        return lat_deg, lon_deg, height_m - self.geoid_m

    def inverse(self, x, y, z, m):
        if self.same:
            return x, y, z + self.lift_m + self.geoid_m
        if self.crs != CRS_ECEF:
            lat_deg, lon_deg = self.grid.inverse(x, y, m) if self.grid is not None else (x, y)
            x, y, z = geodetic_to_ecef(lat_deg, lon_deg, z + self.geoid_m, m)
        if self.own is not None:
            lat_deg, lon_deg, height_m = ecef_to_geodetic(x, y, z, m)
            return (*self.own.forward(lat_deg, lon_deg, m), height_m + self.lift_m)
        d = _apply_transposed(self.turn, (x - self.home[0], y - self.home[1], z - self.home[2]))
        return tuple(s + v for s, v in zip(self.station_m, d))


def _by_row(function, columns):
    """function(x, y, z, m) -> three columns, on whole arrays or row by row."""
    if np is not None:
        with np.errstate(invalid="ignore"):
            return tuple(function(*columns, np))
    rows = (function(*row, _Plain) if row[0] == row[0] else (_NAN, _NAN, _NAN) for row in zip(*columns))
    return tuple(map(list, zip(*rows))) or ([], [], [])


# ---- sources

class _Source:
    """Bytes in and out by a descriptor that does not block. owner: an object to which the descriptor belongs."""

    def __init__(self, name: str, fd: int, owner=None, is_file: bool = False) -> None:
        self.name, self.fd, self.owner, self.is_file = name, fd, owner, is_file
        self.is_tty = os.isatty(fd)

    def close(self) -> None:
        if self.owner is not None:
            self.owner.close()
        elif self.fd >= 0:
            os.close(self.fd)
        self.fd = -1


def _open_tty(path: str) -> int:
    import termios
    import tty
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    try:
        tty.setraw(fd, termios.TCSANOW)
    except termios.error as error:
        os.close(fd)
        raise ScanheadError(f"{path}: not a terminal: {error}") from None
    return fd


def _split_address(name: str, address: str) -> Tuple[str, int]:
    """Splits HOST:PORT or [IPV6]:PORT, as scanhead_open does."""
    host, _, port = address.rpartition(":")
    is_ipv6 = host.startswith("[") and host.endswith("]")
    if is_ipv6:
        host = host[1:-1]
    is_host = 1 <= len(host) <= 255 and "]" not in host and (is_ipv6 or not ("[" in host or ":" in host))
    if not is_host or not (port.isascii() and port.isdigit() and len(port) <= 5 and 1 <= int(port) <= 65535):
        raise ScanheadError(f"{name}: not an address; allowed are tcp:HOST:PORT or tcp:[IPV6]:PORT, port 1 to 65535")
    return host, int(port)


def _open_source(name: str, timeout_s: float) -> _Source:
    kind, _, rest = name.partition(":")
    if kind == "tcp":
        connection = socket.create_connection(_split_address(name, rest), timeout_s)
        if connection.getsockname() == connection.getpeername():  # nobody listens, and the system chose the same port
            connection.close()
            raise ConnectionRefusedError(errno.ECONNREFUSED, os.strerror(errno.ECONNREFUSED))
        connection.setblocking(False)
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)  # a head that vanishes ends the connection
        for option, value in (("TCP_KEEPIDLE", 10), ("TCP_KEEPINTVL", 5), ("TCP_KEEPCNT", 3)):
            if hasattr(socket, option):  # else after the system's own time
                connection.setsockopt(socket.IPPROTO_TCP, getattr(socket, option), value)
        return _Source(name, connection.fileno(), connection)
    if kind == "tty":
        return _Source(name, _open_tty(rest))
    fd = os.open(name, os.O_RDONLY | os.O_NONBLOCK)  # opening a FIFO does not wait
    if not stat.S_ISREG(os.fstat(fd).st_mode):
        os.close(fd)
        raise ScanheadError(f"{name}: not a file; a recording is one")
    return _Source(name, fd, is_file=True)


# ---- the head

def _is_identity_query(line: str) -> bool:
    return line.strip().lstrip(":").upper() == "*IDN?"


def _is_identity(reply: str) -> bool:
    return reply.rpartition(",")[2].startswith("scanhead native ")


class Head:
    """A head or a recording. State (descriptor, anchor, names, poses, clock, hash) is that of the frame that
    frames() gave last; points(), to_scene() and to_crs() belong to that frame. Frames that are dropped while a reply is
    awaited change the state, too."""

    def __init__(self, source: _Source) -> None:
        self._source, self.parser = source, Parser(self._hand_on)
        self.on_notice = None  # type: Optional[Callable[[Notice], None]]  # gets each Notice as it is found
        self.echoes = self.late_replies = self.unasked = 0  # notices of these kinds
        self._given_up = self._given_up_identities = 0  # commands whose reply may come yet; those that asked *IDN?
        self._closed_told = False
        self._queue, self._queued = collections.deque(), 0
        self._unsettled, self._asked = source.is_tty, 0  # _asked: answers to *IDN? that may come yet
        self._ended = self._stuck = False
        self.dropped = 0  # frames dropped here while a reply was awaited
        self._left_out = self._left_out_before = 0  # frames, by the present session and by those before it
        self._lost_told = self._lost_ended = 0  # pulses, by OVERRUN events and by SCAN_END
        self.descriptor, self.anchor = None, None  # type: Optional[Dict], Optional[Dict]
        # None: a line head; "beams": (elevation in degrees, azimuth in degrees, offset in ns) of each
        self.emitter = None  # type: Optional[Dict]
        self.surfaces = {}  # type: Dict[int, Tuple[str, str]]
        self._poses, self._earth = _Poses(), None
        self._sha256 = hashlib.sha256()
        self._scan_t0_ns = self._gps = self._last_pulse0 = self._points_key = self._points_time = None
        self._last_seq = None  # type: Optional[int]  # of a frame that is not LOCAL
        self._descriptor_seq = self._anchor_seq = self._gps_seq = 0  # frames that gave what is at hand
        self._told_alone = False  # whether a descriptor for this reader alone came after _last_seq
        self._scan, self.scan_over = None, False  # the number of the present scan; whether it ends with this frame

    def __enter__(self) -> "Head":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def close(self) -> None:
        self._source.close()

    @property
    def pulses_lost(self) -> int:
        """Pulses that the head says it lost. OVERRUN and SCAN_END both report them. Events of either kind may be
        missing, so the larger sum counts."""
        return max(self._lost_told, self._lost_ended)

    @property
    def reader_lost(self) -> int:
        """Frames that the head says it left out for this reader."""
        return self._left_out_before + self._left_out

    # -- notices

    def _hand_on(self, notice: Notice) -> None:
        if self.on_notice is not None:
            self.on_notice(notice)

    def _note_line(self, text: str, is_echo: bool = False) -> None:
        kind = "echo" if is_echo else "late reply" if self._given_up else "unasked"
        self.echoes += is_echo
        self.late_replies += kind == "late reply"
        self.unasked += kind == "unasked"
        self._given_up -= kind == "late reply"
        self._hand_on(Notice(kind, self.parser.text_at, 0, len(text), self.parser.last_t_ns))

    def _stray(self, text: str) -> None:
        """Takes a line that nobody waits for. The answer to a question of _settle gives no notice."""
        if self._asked and _is_identity(text):
            self._asked -= 1
            if not self._given_up_identities:
                return
            self._given_up_identities -= 1
        self._note_line(text)

    def _gone(self) -> Closed:
        """The error to raise once all items that had come were taken. Gives the notice "closed" before that."""
        if not self._closed_told:
            self._closed_told = True
            self._hand_on(Notice("closed", self.parser.bytes, 0, 1, self.parser.last_t_ns))
        return Closed(f"{self._source.name}: the head is gone")

    # -- bytes

    def _fill(self, deadline_s: Optional[float], write: bool = False) -> bool:
        """Waits for bytes and takes them. write: returns True as soon as the head takes bytes."""
        if self._source.fd < 0:
            raise Closed(f"{self._source.name}: close() was called")
        if not self._source.is_file:
            poll = select.poll()
            poll.register(self._source.fd, select.POLLIN | (select.POLLOUT if write else 0))
            left_ms = None
            if deadline_s is not None:
                left_ms = min(max(0.0, 1000 * (deadline_s - time.monotonic())), _POLL_MS)
            ready = poll.poll(left_ms)
            if not ready:
                raise Timeout(f"{self._source.name}: nothing came in time")
            if write and ready[0][1] & select.POLLOUT and not ready[0][1] & select.POLLIN:
                return True
        try:
            data = os.read(self._source.fd, _CHUNK)
        except BlockingIOError:
            return False
        except OSError as error:
            if self._source.is_file:
                raise ScanheadError(f"{self._source.name}: {error.strerror}") from None
            data = b""  # a pty whose other end is gone, a connection that was reset
        self._ended = not data
        self.parser.feed(data)
        return False

    def _next_item(self, deadline_s: Optional[float]) -> Union[Frame, str, None]:
        """A frame or a line; None at the end."""
        item = self.parser.next(self._ended)
        while item is None and not self._ended:
            self._fill(deadline_s)
            item = self.parser.next(self._ended)
            if item is None:
                self._check(deadline_s)
        return item

    # -- commands

    def query(self, line: str, timeout_s: float = 5.0) -> str:
        """Sends one command line and gives its reply line as it is, also "ERR number,text". Frames that come
        meanwhile are kept for frames()."""
        if self._source.is_file:
            raise ScanheadError(f"{self._source.name}: a recording takes no commands")
        if self._stuck:
            raise ScanheadError(f"{self._source.name}: half a command went out before; open the head again")
        if not line.strip() or len(line) > 256 or not all(" " <= c <= "~" for c in line):
            raise ScanheadError("not a command: one line of 1 to 256 printable ASCII characters")
        deadline_s = time.monotonic() + timeout_s
        if self._unsettled:
            self._settle(deadline_s)
        self._discard_stale()
        self._send(line + "\n", deadline_s)
        try:
            reply = self._reply(deadline_s, line)
            while self._asked and _is_identity(reply) and not _is_identity_query(line):
                self._stray(reply)  # the answer to a question of _settle comes after all
                reply = self._reply(deadline_s, line)
            return reply
        except Closed:
            raise
        except ScanheadError:  # the reply may come yet, and is not that of the next line
            self._unsettled = True
            self._asked += _is_identity_query(line)
            self._given_up += 1
            self._given_up_identities += _is_identity_query(line)
            raise

    def command(self, line: str, timeout_s: float = 5.0) -> str:
        """Does as query(). A reply "ERR ..." becomes a CommandError."""
        reply = self.query(line, timeout_s)
        if reply.startswith("ERR "):
            number, _, text = reply[4:].partition(",")
            raise CommandError(line, int(number) if number.lstrip("+-").isdigit() else 0, text)
        return reply

    def _settle(self, deadline_s: float) -> None:
        """Sends *IDN? and skips all replies up to its answer, so that the next reply is that of the next command. This
        is needed on a terminal, which may have echoed what the head sent, and after a command that was given up. The
        head may have sent half a frame to the program before, and the rest of it may swallow the answer. So the
        question is asked again."""
        while True:
            self._asked += 1
            self._send("\n*IDN?\n", deadline_s)
            if self._pass_over(min(deadline_s, time.monotonic() + _ASK_AGAIN_S)):
                break
            self._check(deadline_s)
        self._unsettled = False

    def _pass_over(self, deadline_s: float) -> bool:
        """Skips replies up to the answers to all questions for the identity, the only replies whose last field names the
        stream. Once one is there, the others have a moment, as they may be lost. Returns whether one came."""
        answered = False
        while self._asked:
            try:
                reply = self._reply(deadline_s, "*IDN?")
            except Timeout:
                return answered  # query() passes over the others, if they come after all
            if _is_identity(reply) and not answered:
                answered, deadline_s = True, time.monotonic() + _ANSWERS_S
            self._stray(reply)
        return True

    def _discard_stale(self) -> None:
        """Skips replies that have come by now: they answer commands that were given up. Frames may come without end,
        so this looks at a few chunks only."""
        for _ in range(32):
            self._keep_frames()
            try:
                self._fill(0.0)
            except Timeout:
                return
            if self._ended:
                return

    def _send(self, text: str, deadline_s: float) -> None:
        data, done = text.encode("ascii"), 0
        try:
            while done < len(data):
                try:
                    done += os.write(self._source.fd, data[done:])
                except BlockingIOError:  # the head may wait to write, too, so its bytes are read meanwhile
                    self._wait_writable(deadline_s)
        except Timeout:
            raise
        except OSError as error:
            raise Closed(f"{self._source.name}: {error.strerror}") from None
        finally:
            self._stuck = 0 < done < len(data)

    def _check(self, deadline_s: Optional[float]) -> None:
        """Raises Timeout after the deadline. A head could keep a loop busy with bytes that nobody waits for."""
        if deadline_s is not None and _NO_WAIT < deadline_s < time.monotonic():
            raise Timeout(f"{self._source.name}: what was waited for did not come in time")

    def _wait_writable(self, deadline_s: float) -> None:
        self._check(deadline_s)
        self._fill(deadline_s, write=True)
        self._keep_frames()
        if self._ended:
            raise self._gone()

    def _reply(self, deadline_s: float, line: str) -> str:
        """The next line that is not an echo of the line that was sent."""
        while True:
            item = self._next_item(deadline_s)
            if item is None:
                raise self._gone()
            if isinstance(item, Frame):
                self._keep(item)
            elif item == line:
                self._note_line(item, is_echo=True)
            else:
                return item
            self._check(deadline_s)

    def _keep_frames(self) -> None:
        """Takes what has come: frames are kept, and nobody waits for the lines any more."""
        while (item := self.parser.next(self._ended)) is not None:
            if isinstance(item, Frame):
                self._keep(item)
            else:
                self._stray(item)

    def _keep(self, frame: Frame) -> None:
        self._queue.append(frame)
        self._queued += len(frame.payload) + _FRAME_BYTES
        while self._queued > _QUEUE_BYTES:
            self.dropped += 1
            self._absorb(self._unqueue())  # so that its facts are not lost, and it stays in the hash

    def _unqueue(self) -> Frame:
        frame = self._queue.popleft()
        self._queued -= len(frame.payload) + _FRAME_BYTES
        return frame

    # -- frames

    def frames(self, timeout_s: Optional[float] = None) -> Iterator[Frame]:
        """Frames in order, up to a recording's end. Closed: the head is gone; Timeout: none in timeout_s."""
        while (frame := self.next_frame(timeout_s)) is not None:
            yield frame

    def next_frame(self, timeout_s: Optional[float] = None) -> Optional[Frame]:
        """The next frame; None at a recording's end. Nobody waits for reply lines here, so each gives a notice,
        except answers to questions of _settle. timeout_s 0: only a frame that has come whole, even if it came in many
        pieces."""
        deadline_s = None if timeout_s is None else _NO_WAIT if timeout_s <= 0 else time.monotonic() + timeout_s
        frame = None  # type: Union[Frame, str, None]
        if self._queue:
            frame = self._unqueue()
        while not isinstance(frame, Frame):
            frame = self._next_item(deadline_s)
            if frame is None:
                if self._source.is_file:
                    return None
                raise self._gone()
            if not isinstance(frame, Frame):
                self._stray(frame)
                self._check(deadline_s)
        return self._absorb(frame)

    def _absorb(self, frame: Frame) -> Frame:
        if not frame.flags & (REPEAT | LOCAL) and frame.type in _HASHED:
            self._sha256.update(struct.pack("<BI", frame.type, len(frame.payload)))
            self._sha256.update(frame.payload)
        self._follow_sequence(frame)
        if frame.version != 1:
            raise ScanheadError(f"the head speaks version {frame.version}; this client reads 1")
        if frame.type in _UNPACK:
            frame = frame._replace(fields=_decode(frame.type, frame.payload))
        act = {DESCRIPTOR: self._absorb_descriptor, ANCHOR: self._absorb_anchor,
               POINTS: self._absorb_points, EVENT: self._absorb_event, SURFACES: self._absorb_surfaces,
               POSES: self._poses.absorb, ATTRIBUTES: self._absorb_attributes, COLOURS: self._absorb_colours,
               WAVES: self._absorb_waves, EMITTER: self._absorb_emitter}.get(frame.type)
        is_again = frame.is_event(EV_SCAN_START) and self._is_same_number_again(frame)
        if act is not None:
            act(frame)
        self._follow_scan(frame, is_again)
        return frame

    def _came_again(self, frame: Frame, seq: int) -> bool:
        """Whether a recording holds a second copy of frame `seq` right before this one. Recordings that were put one
        after the other may begin with the same frames. The parser drops the second copies as repeated, up to the first
        frame that differs. The state that comes from such a frame is that of the new sequence, too."""
        return self._source.is_file and (frame.seq - 1 - seq) % 2**32 < self.parser.frames_again()

    def _follow_sequence(self, frame: Frame) -> None:
        """Forgets the state where the numbers of frames do not go on: the head has started again, or recordings were put
        one after the other. If a descriptor for this reader alone (LOCAL) came just before, the state since then is
        that of the new sequence."""
        if frame.flags & LOCAL:
            return
        back = self._last_seq is not None and (frame.seq - self._last_seq - 1) % 2**32 >= 2**31
        if back:
            self._last_pulse0 = None
        if back and not self._told_alone:
            kept = self.descriptor, self.anchor, self.emitter
            self._forget()
            if self._came_again(frame, self._descriptor_seq):
                self.descriptor, _, self.emitter = kept
                self.anchor = kept[1] if self._came_again(frame, self._anchor_seq) else None
            self._gps = self._gps if self._came_again(frame, self._gps_seq) else None
            self._scan_t0_ns = None
        self._last_seq, self._told_alone = frame.seq, False

    def _follow_scan(self, frame: Frame, is_again: bool) -> None:
        """Sets scan_over. is_again: a scan of the same number begins. SCAN_END may be lost: so the next frame that
        reports another scan, or none, ends it, too."""
        f, now = frame.fields, self._scan
        if frame.is_event(EV_SCAN_START):
            now = None if is_again else f["a"]
        elif frame.type == DESCRIPTOR:
            now = f["scan"]
        elif frame.type == TELEMETRY:
            now = f["scan"] if f["state"] in (_SCANNING, _SPIN_DOWN) else None
        elif frame.is_event(EV_SCAN_END) or frame.is_event(EV_STATE) and f["b"] == _SCANNING:
            now = None
        self.scan_over = self._scan is not None and self._scan != now
        if self.scan_over:
            self._scan = None
        if frame.is_event(EV_SCAN_START):
            self._scan = f["a"]
        elif frame.type == POINTS and self.descriptor is not None:
            self._scan = self.descriptor["scan"]

    def _is_same_number_again(self, start: Frame) -> bool:
        """Whether a SCAN_START with the descriptor's number is of another scan, which has another start: the head has
        started again. The event of the scan at hand can come after its first points, where the head lost the tick with
        it."""
        f = start.fields
        return (self.descriptor is not None and f["a"] == self.descriptor["scan"] and
                self._last_pulse0 is not None and (f["b"] - self._scan_t0_ns) % 2**64 != 0)

    def _forget(self) -> None:
        self.descriptor = self.anchor = self.emitter = self._last_pulse0 = None
        self._poses.forget()

    def _absorb_descriptor(self, frame: Frame) -> None:
        d = frame.fields
        d.setdefault("content", 0)
        turns = d["mirror_counts_per_turn"], d["pan_counts_per_turn"]
        if d["layout"] not in (POLAR, GEO) or d["n_surfaces"] > NO_LABEL:
            raise ScanheadError("a descriptor of an unknown layout, or with more surfaces than labels")
        if d["layout"] == POLAR and not (min(turns) >= 1 and d["range_scale_m"] > 0):
            raise ScanheadError("a polar descriptor without scales")
        if not frame.flags & REPEAT or self.descriptor is None or self.descriptor["scan"] != d["scan"]:
            self._forget()
            self._descriptor_seq = frame.seq
        self.descriptor = d
        self._told_alone |= frame.flags & LOCAL != 0

    def _absorb_emitter(self, frame: Frame) -> None:
        e = frame.fields
        if e["n_beams"] > (len(frame.payload) - 64) // _BEAM.size:
            raise ScanheadError("an emitter frame shorter than its beams")
        beams = (_BEAM.unpack_from(frame.payload, 64 + _BEAM.size * i) for i in range(e["n_beams"]))
        self.emitter = dict(e, beams=[(1e-6 * elevation, 1e-6 * azimuth, offset_ns)
                                      for elevation, azimuth, offset_ns in beams], **_rings(e))

    def _absorb_anchor(self, frame: Frame) -> None:
        a = frame.fields
        a["scale"] = tuple(s or a["scale_m"] for s in a["scale"])
        a["axes"] = a["axes"] if any(a["axes"]) else (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
        if a["crs"] > CRS_GEODETIC or a["heights"] > 1:
            raise ScanheadError("an anchor in a CRS that version 1 doesn't have")
        if self.anchor is None or not frame.flags & REPEAT:
            self._anchor_seq = frame.seq
        if self.descriptor is not None:  # without its scan's descriptor, an anchor may be one of the scan before
            self.anchor, self._earth = a, None

    def _absorb_points(self, frame: Frame) -> None:
        p = frame.fields
        if p["n_points"] > (len(frame.payload) - 40) // 20:
            raise ScanheadError("a points frame shorter than its points")
        if self._last_pulse0 is not None and p["pulse0"] < self._last_pulse0:
            self._forget()
        until_ns = 1000000 * self.anchor["until_ms"] if self.anchor is not None else 0
        if until_ns and p["t0_ns"] >= until_ns:
            self.anchor = None  # the anchor of these points did not reach us
        self._last_pulse0 = p["pulse0"]
        self._scan_t0_ns = frame.t_ns - p["t0_ns"]
        self._points_key = (frame.seq + 1) % 2**32, p["pulse0"], p["line"], p["n_points"]
        self._points_time = frame.t_ns, p["t0_ns"]

    def _absorb_attributes(self, frame: Frame) -> None:
        if frame.fields["n_points"] > (len(frame.payload) - 16) // 4:
            raise ScanheadError("an attributes frame shorter than its attributes")
        if self._has(HAS_DEVIATIONS) and frame.fields["n_points"] > (len(frame.payload) - 16) // 6:
            raise ScanheadError("an attributes frame shorter than its deviations")

    def _absorb_colours(self, frame: Frame) -> None:
        if frame.fields["n_points"] > (len(frame.payload) - 16) // 3:
            raise ScanheadError("a colours frame shorter than its colours")

    def _absorb_waves(self, frame: Frame) -> None:
        f = frame.fields
        if f["sample_ps"] == 0 or not 8 <= f["bits"] <= 14 or not f["count_signal"] > 0:
            raise ScanheadError("a waveforms frame without time between samples, bits or signal of a count")
        for _ in _wave_records(frame.payload, f["n_windows"]):
            pass

    def _has(self, content: int) -> bool:
        return self.descriptor is not None and self.descriptor["content"] & content != 0

    def _absorb_event(self, frame: Frame) -> None:
        code, a, b, c = (frame.fields[k] for k in ("code", "a", "b", "c"))
        if code in (EV_SCAN_START, EV_TIME, EV_PPS):
            self._gps_seq = frame.seq
        if code == EV_READER_LOST:
            self._left_out_before += self._left_out if c < self._left_out else 0  # another session has begun
            self._left_out = c
        elif code == EV_OVERRUN:
            self._lost_told += b
        elif code == EV_SCAN_END:
            self._lost_ended += c
        elif code == EV_SCAN_START:
            if self.descriptor is not None and a != self.descriptor["scan"] or self._is_same_number_again(frame):
                self._forget()
            self._scan_t0_ns, self._gps = b, (b, c) if c else None
        elif code == EV_TIME:
            self._gps = b, c
        elif code == EV_PPS:
            self._gps = b, c * 1000000000

    def _absorb_surfaces(self, frame: Frame) -> None:
        data, names, at = frame.payload, [], 8
        first, count = struct.unpack_from("<II", data) if len(data) >= 8 else (0, NO_LABEL + 1)
        if first + count > NO_LABEL:
            raise ScanheadError("a surfaces frame with labels beyond 65534")
        for _ in range(2 * count):
            end = at + 1 + data[at] if at < len(data) else len(data) + 1
            if end > len(data) or 0 in data[at + 1:end]:
                raise ScanheadError("a surfaces frame shorter than its names, or with NUL in one")
            names.append(data[at + 1:end].decode("utf-8", "replace"))
            at = end
        self.surfaces.update(zip(range(first, first + count), zip(names[::2], names[1::2])))

    # -- what frames mean

    def points(self, frame: Frame) -> Points:
        """The points of a points frame, as columns."""
        if frame.type != POINTS:
            raise ScanheadError("not a points frame")
        if self.descriptor is None or self.anchor is None:
            raise ScanheadError("points before the descriptor and the anchor of their scan")
        raw = _raw_columns(frame.payload, frame.fields["n_points"])
        p = _common(raw, frame.fields["t0_ns"], self.descriptor["layout"])
        if p.layout == POLAR:
            _polar_points(p, raw, self.descriptor, self.emitter is None)
        else:
            _geo_points(p, raw, self.anchor)
        return p

    def can_place(self) -> bool:
        """Whether descriptor and anchor have come, so that points() works."""
        return self.descriptor is not None and self.anchor is not None

    def _is_of_points(self, frame: Frame, after: int) -> bool:
        """Whether the frame's number is that of the last points frame plus `after`, and it belongs to these points."""
        keys = ("pulse0", "line", "n_points")
        return self._points_key == ((frame.seq - after + 1) % 2**32, *(frame.fields[k] for k in keys))

    def colours(self, frame: Frame) -> Optional[Tuple]:
        """Columns red, green and blue, 0 to 255, of the points in the last points frame; None: these were
        lost."""
        after = 2 if self._has(HAS_ATTRIBUTES) else 1
        if not self._is_of_points(frame, after):
            return None
        data = frame.payload[16:16 + 3 * frame.fields["n_points"]]
        if np is not None:
            return tuple(np.frombuffer(data, np.uint8).reshape(-1, 3).T)
        return tuple(list(data[k::3]) for k in range(3))

    def attributes(self, frame: Frame) -> Optional[Tuple]:
        """Columns amplitude_db and width_ns of the points in the frame before; None: those were lost."""
        n = frame.fields["n_points"]
        if not self._is_of_points(frame, 1):
            return None
        if np is not None:
            amplitude_cdb = np.frombuffer(frame.payload, "<i2", 2 * n, 16)[::2]
            width_cns = np.frombuffer(frame.payload, "<u2", 2 * n, 16)[1::2]
            return (np.where(amplitude_cdb == -32768, _NAN, amplitude_cdb / 100.0),
                    np.where(width_cns == 0, _NAN, width_cns / 100.0))
        raw = list(struct.iter_unpack("<hH", frame.payload[16:16 + 4 * n]))
        return (_column((_NAN if a == -32768 else a / 100.0 for a, _ in raw), n),
                _column((w / 100.0 if w else _NAN for _, w in raw), n))

    def deviations(self, frame: Frame) -> Optional[List[float]]:
        """The deviation of each echo's shape from the pulse's, RMS over its amplitude, from a frame of attributes.
        65.535: that or more; 0: a shot without echo. None: the points were lost, or the head sends none."""
        n = frame.fields["n_points"]
        if not self._has(HAS_DEVIATIONS) or not self._is_of_points(frame, 1):
            return None
        return [d / 1000.0 for d in struct.unpack_from("<%dH" % n, frame.payload, 16 + 4 * n)]

    def waves(self, frame: Frame) -> Optional[List[Wave]]:
        """The windows of a waveforms frame, in order of pulse, then of range; None: their points were lost. Several
        such frames may follow a points frame."""
        f, key = frame.fields, self._points_key
        if self.descriptor is None or key is None or key[1:3] != (f["pulse0"], f["line"]) or (
                self._points_time[0] != frame.t_ns):
            return None
        waves = []
        for (pulse, dt_ns, first, n, *_), at in _wave_records(frame.payload, f["n_windows"]):
            waves.append(Wave(f["pulse0"] + pulse, self._points_time[1] + dt_ns, first,
                              struct.unpack_from("<%dH" % n, frame.payload, at),
                              _wave_direction(frame.payload, at - 12, self.descriptor),
                              f["sample_ps"], f["bits"], f["baseline_16"] / 16.0, f["count_signal"]))
        return waves

    def to_scene(self, p: Points) -> Tuple:
        """x, y, z in the scene frame, metres; of a moving head each point with the pose of its time. NaN: no
        echo, or no pose because frames were lost."""
        if p.layout == GEO:
            return _by_row(self._earth_now().inverse, (p.x, p.y, p.z))
        if self.anchor["moving"] & 1:
            return self._to_scene_moving(p)
        turn, at = self.anchor["rotation"], self.anchor["station_m"]
        return _by_row(lambda x, y, z, m: [s + v for s, v in zip(at, _apply(turn, (x, y, z)))],
                       (p.x, p.y, p.z))

    def to_crs(self, p: Points) -> Tuple:
        """x, y, z in the CRS of the anchor: metres, or degrees, degrees, metres. Points of the polar layout are taken
        to the scene frame first."""
        return (p.x, p.y, p.z) if p.layout == GEO else _by_row(self._earth_now().forward, self.to_scene(p))

    def _earth_now(self) -> _Earth:
        if not self.can_place():
            raise ScanheadError("points before the descriptor and the anchor of their scan")
        if self._earth is None:
            self._earth = _Earth(self.anchor, self.descriptor["layout"])
        return self._earth

    def _to_scene_moving(self, p: Points) -> Tuple:
        rows, leg = [], None  # type: List, Optional[_Leg]
        columns = (p.t_ns, p.x, p.y, p.z)
        if np is not None:
            columns = (c.tolist() for c in columns)
        for t_ns, *v in zip(*columns):
            if leg is None or not leg.a.t_ns <= t_ns < leg.b.t_ns:
                leg = self._poses.leg(t_ns)
            rows.append((_NAN, _NAN, _NAN) if leg is None else _place_moving(leg, t_ns, v))
        columns = list(zip(*rows)) or [(), (), ()]
        return tuple(_column(c, len(rows)) for c in columns)

    def pose(self, t_ns: int) -> Optional[Pose]:
        """Where a moving head was t_ns after the scan's start; None: the stream has not reported it."""
        leg = self._poses.leg(t_ns)
        if leg is None:
            return None
        f = leg.fraction(t_ns)
        s = math.sin(0.5 * f * leg.angle_rad)
        turn = (math.cos(0.5 * f * leg.angle_rad), s * leg.axis[0], s * leg.axis[1], s * leg.axis[2])
        return Pose(t_ns, leg.position_m(f), _quat_times(leg.a.quat, turn),
                    leg.a.frame + f * (leg.b.frame - leg.a.frame), leg.a.flags | leg.b.flags)

    def gps_time_ns(self, t_ns: int) -> Optional[int]:
        """GPS time of t_ns after the scan's start: ns since 1980-01-06T00:00:00Z without leap seconds. None:
        the head does not know the time, or has not reported it yet."""
        if self._gps is None or self._scan_t0_ns is None:
            return None
        return self._gps[1] + self._scan_t0_ns + t_ns - self._gps[0]

    def stream_sha256(self) -> str:
        """The hash of all frames so far, as COUNTS.md defines it."""
        return self._sha256.hexdigest()


def open(source: str, timeout_s: float = 5.0) -> Head:  # noqa: A001, the module's name says what is opened
    """A head or a recording: "tcp:HOST:PORT", "tty:PATH", or the path of a .shs file."""
    try:
        return Head(_open_source(source, timeout_s))
    except OSError as error:
        raise ScanheadError(f"{source}: {error.strerror or error}") from None
    except ValueError as error:  # a NUL in a path, a part of a host's name that is too long
        raise ScanheadError(f"{source!r}: {error}") from None


def _summary(head: Head) -> None:
    kinds, echoes = collections.Counter(), 0
    for frame in head.frames():
        kinds[frame.type] += 1
        if frame.type == POINTS and head.can_place():
            count = head.points(frame).echo_count
            echoes += int(np.count_nonzero(count)) if np is not None else sum(n > 0 for n in count)
    if not kinds:
        raise ScanheadError(f"{head._source.name}: no frame in {head.parser.bad_bytes} bytes: "
                            "this is not a scan head's stream")
    names = ("", "descriptors", "anchors", "points frames", "line ends", "telemetry", "events", "names",
             "poses", "attributes", "emitters", "colours", "waveforms")
    print(*(f"{kinds[k]} {names[k]}" for k in sorted(kinds) if k < len(names)), sep=", ")
    p = head.parser
    print(f"{echoes} echoes; frames lost: {p.seq_lost}, bytes skipped: {p.bad_bytes}")
    if p.repeated or p.late or p.restarts:
        print(f"frames that came twice: {p.repeated}, after newer ones: {p.late}; restarts: {p.restarts}")
    print(f"stream_sha256 {head.stream_sha256()}")


def main(arguments: List[str]) -> int:
    if not arguments:
        print("usage: scanhead.py tcp:HOST:PORT|tty:PATH|FILE.shs [COMMAND...]\n"
              "Prints what a recording holds, or who the head is, its state, and the replies to commands.")
        return 2
    try:
        with open(arguments[0]) as head:
            if head._source.is_file:
                _summary(head)
            for line in ([] if head._source.is_file else ["*IDN?", "HEAD:STATe?"]) + arguments[1:]:
                print(f"{line}  {head.query(line)}")
    except ScanheadError as error:
        print(error, file=sys.stderr)
        return 1 if arguments[0].startswith(("tcp:", "tty:")) else 2  # a file that is wrong, as in scanhead
    except KeyboardInterrupt:
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
