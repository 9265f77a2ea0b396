# SPDX-License-Identifier: MIT
"""test_python.c, test_python_waves.c and test_python_damage.c ask the Python client by this. Its answers are binary rows
or plain numbers.

    python_client.py FOLDER_OF_THE_CLIENT numpy|plain WHAT ...
        dump SOURCE OUT     points, attributes, poses and times, frame by frame, as test_python.c reads them
        waves FILE OUT      its waveforms and deviations, as test_python_waves.c reads them
        live SOURCE         a session with a running head
        crs POLAR GEO       the same scan in both layouts: the largest differences, m: in the CRS; in the
                            scene; in the CRS with the formula of ANCHOR.md
        count FILE          the parser's counters
        samples PAGE OUT    decodes the frames in hex of PAGE; what is said below each is what it holds
        tables FOLDER FILE  decodes FILE's frames by the tables of FOLDER's pages alone; the client must read the same
        hostile FILE SEED   frames of FILE with wrong contents and good checksums: only ScanheadError comes
        older FILE OUT      rewrites FILE for heads whose telemetry had no counts of the scan
        ends FILE           the frames where scan_over is true, with SCAN_END and without; the pulses lost
        misuse FILE         wrong sources and calls: only ScanheadError comes; a late reply answers nothing else
"""
import glob
import hashlib
import math
import random
import re
import resource
import struct
import sys

sys.path.insert(0, sys.argv[1])
if sys.argv[2] == "plain":
    sys.modules["numpy"] = None
import scanhead  # noqa: E402
from python_pair import chatter, framed, misuse, notices  # noqa: E402,F401

ROW = struct.Struct("<10dqiii")
NAN3 = ([math.nan], [math.nan], [math.nan])


def rows_of(head, points):
    names = "x y z range_m mirror_rad pan_rad reflectance_db"
    plain = [list(getattr(points, name)) for name in names.split()]
    polar = points.layout == scanhead.POLAR
    scene = [list(c) for c in (head.to_scene(points) if polar else [column * len(points) for column in NAN3])]
    for row in zip(*plain, *scene, points.t_ns, points.echo, points.echo_count, points.label):
        yield ROW.pack(*row[:10], *(int(v) for v in row[10:]))


def dump(source, out):
    head = scanhead.open(source)
    with open(out, "wb") as file:
        for frame in head.frames():
            if frame.type == scanhead.POINTS:
                points = head.points(frame)
                file.write(struct.pack("<cI", b"P", len(points)))
                file.writelines(rows_of(head, points))
                pose = head.pose(frame.fields["t0_ns"] + 1000)
                gps_ns = head.gps_time_ns(frame.fields["t0_ns"])
                where = (*pose.position_m, *pose.quat, pose.frame, pose.flags) if pose else (0,) * 8 + (-1,)
                file.write(struct.pack("<q8di", -1 if gps_ns is None else gps_ns, *where))
            elif frame.type == scanhead.ATTRIBUTES:
                columns = head.attributes(frame)
                file.write(struct.pack("<cI", b"A", len(columns[0])))
                file.writelines(struct.pack("<2d", *row) for row in zip(*columns))
        file.write(struct.pack("<cI", b"E", len(head.surfaces)))
    print(head.stream_sha256())


def waves(path, out):
    head = scanhead.open(path)
    with open(out, "wb") as file:
        for frame in head.frames():
            if frame.type == scanhead.ATTRIBUTES:
                deviations = head.deviations(frame)
                file.write(struct.pack("<cI%dd" % len(deviations), b"D", len(deviations), *deviations))
            elif frame.type == scanhead.WAVES:
                windows = head.waves(frame)
                file.write(struct.pack("<cI", b"W", len(windows)))
                for w in windows:
                    signal = w.signal()
                    file.write(struct.pack("<2q4I6d", w.pulse, w.t_ns, w.first, len(signal), w.sample_ps, w.bits, w.range_m(),
                                           w.step_m, *w.direction, w.baseline))
                    file.write(struct.pack("<%dd" % len(signal), *signal))
    print(head.stream_sha256())


def live(source):
    head = scanhead.open(source)
    try:
        head.command("HEAD:PRR 1 S")
    except scanhead.CommandError as error:
        print(error.number)
    while head.command("HEAD:STATe?") != "idle":
        head.next_frame()
    head.command("SCAN:STARt")
    pulses = 0
    for frame in head.frames(timeout_s=30):
        pulses += frame.fields["n_pulses"] if frame.type == scanhead.POINTS else 0
        if frame.is_event(scanhead.EV_SCAN_END):
            break
    print(pulses, head.parser.seq_lost, head.dropped, head.stream_sha256())
    try:
        for _ in range(1000000):
            head.next_frame(0.0)
    except scanhead.Timeout:
        print("timeout")


def columns_of(path):
    head, places = scanhead.open(path), []
    for frame in head.frames():
        if frame.type == scanhead.POINTS:
            points = head.points(frame)
            places += zip(*head.to_crs(points), *head.to_scene(points))
    return head.anchor, places


def by_the_page(anchor, at):
    """ANCHOR.md's formula for UTM and UPS, with the point scale by Snyder's equations."""
    lat, e2 = math.radians(anchor["lat_deg"]), scanhead._E2
    c = e2 / (1 - e2) * math.cos(lat) ** 2
    a = math.radians(anchor["lon_deg"] - (6 * (anchor["epsg"] % 100) - 183)) * math.cos(lat)
    fourth = 5 - 4 * math.tan(lat) ** 2 + 42 * c + 13 * c * c - 28 * e2 / (1 - e2)
    k0 = 0.9996 * (1 + (1 + c) * a**2 / 2 + fourth * a**4 / 24)
    if anchor["epsg"] in (32661, 32761):
        m = math.cos(lat) / math.sqrt(1 - e2 * math.sin(lat) ** 2)
        k0 = math.hypot(anchor["anchor"][0] - 2e6, anchor["anchor"][1] - 2e6) / (6378137.0 * m)
    k = k0 * 6.37e6 / (6.37e6 + anchor["height_m"])
    turned = scanhead._apply(anchor["axes"], [p - s for p, s in zip(at, anchor["station_m"])])
    return [p + f * t for p, f, t in zip(anchor["anchor"], (k, k, 1), turned)]


def crs(polar, geo):
    (anchor, ours), (_, truth) = columns_of(polar), columns_of(geo)
    is_geodetic = anchor["crs"] == scanhead.CRS_GEODETIC
    worst, n = [0.0, 0.0, 0.0], 0
    for a, b in zip(ours, truth):
        if math.isnan(a[0]) or math.isnan(b[0]):
            assert math.isnan(a[0]) and math.isnan(b[0])
            continue
        at = [scanhead.geodetic_to_ecef(*p[:3]) if is_geodetic else p[:3] for p in (a, b)]
        worst[0] = max(worst[0], math.dist(*at))
        worst[1] = max(worst[1], math.dist(a[3:], b[3:]))
        if anchor["crs"] == scanhead.CRS_UTM:
            worst[2] = max(worst[2], math.dist(by_the_page(anchor, a[3:]), b[:3]))
        n += 1
    assert len(ours) == len(truth)
    print(n, *worst)


def count(path):
    """Prints counters, then a hash of all notices, a line each."""
    head, said = scanhead.open(path), hashlib.sha256()
    head.on_notice = lambda n: said.update(f"{n.kind} {n.at_byte} {n.seq} {n.n} {n.t_ns or 0}\n".encode())
    frames = sum(1 for _ in head.frames())
    p = head.parser
    assert frames == p.frames
    print(p.bytes, p.frames, p.bad_payload, p.bad_bytes, p.seq_gaps, p.seq_lost, p.repeated, p.late, p.restarts,
          p.cuts, said.hexdigest())


def hostile(path, seed):
    """Changes up to 8 places of each payload, and the length of a tenth of them. Checksums are made good."""
    resource.setrlimit(resource.RLIMIT_AS, (1 << 30, 1 << 30))
    dice = random.Random(int(seed))
    frames = [f for f in scanhead.open(path).frames()]
    edges = [b"\0" * 8, b"\xff" * 8] + [struct.pack("<d", v) for v in (math.inf, 1e308, 5e-324)]
    with open(path + ".hostile", "wb") as out:
        for _ in range(700):
            frame = dice.choice(frames)
            payload = bytearray(frame.payload)
            for _ in range(dice.randrange(9)):
                at = dice.randrange(len(payload) or 1) & -dice.choice((1, 8))
                piece = dice.choice(edges + [dice.randbytes(4)])
                payload[at:at + len(piece)] = piece[:max(0, len(payload) - at)]
            if dice.randrange(10) == 0:
                payload = payload[:dice.randrange(len(payload) + 1)]
            kind = frame.type if dice.randrange(20) else dice.randrange(256)
            head = struct.pack("<BBBBIIIq", 0xD5, kind, 1, dice.choice((0, 0, 0, 1, 2)), len(payload),
                               dice.randrange(2**32), scanhead.crc32c(bytes(payload)),
                               dice.choice((0, -2**63, 2**63 - 1, frame.t_ns)))
            out.write(head + struct.pack("<I", scanhead.crc32c(head)) + payload)
            out.write(dice.choice((b"", b"\xd5", b"ERR\r\n")))
    head, taken, refused = scanhead.open(path + ".hostile"), 0, 0
    while True:
        try:
            frame = head.next_frame()
            if frame is None:
                break
            taken += 1
            if frame.type == scanhead.POINTS:
                points = head.points(frame)
                head.to_scene(points), head.to_crs(points)
                head.pose(frame.fields["t0_ns"]), head.gps_time_ns(frame.fields["t0_ns"])
            elif frame.type == scanhead.ATTRIBUTES:
                head.attributes(frame), head.deviations(frame)
            elif frame.type == scanhead.COLOURS:
                head.colours(frame)
            elif frame.type == scanhead.WAVES:
                for wave in head.waves(frame) or ():
                    wave.signal(), wave.range_m()
        except scanhead.ScanheadError:
            refused += 1
    assert head.parser.frames == 700
    print(taken, refused)
    bombs(path)
    chatter(framed(200, scanhead.LOCAL, 0, b"") + framed(201, scanhead.LOCAL, 0, b""))
    chatter(b"OK\r\n")
    chatter(b"\x80")


def older(path, out):
    with open(out, "wb") as file:
        for f in scanhead.open(path).frames():
            payload = f.payload[:72] if f.type == scanhead.TELEMETRY else f.payload
            head = struct.pack("<BBBBIIIq", 0xD5, f.type, 1, f.flags, len(payload), f.seq,
                               scanhead.crc32c(payload), f.t_ns)
            file.write(head + struct.pack("<I", scanhead.crc32c(head)) + payload)
    head = scanhead.open(out)
    assert all("scan_cast" not in f.fields for f in head.frames())
    print(head.stream_sha256())


def event(code, *values):
    payload = struct.pack("<II3Q96x", code, 0, *(values + (0, 0, 0))[:3])
    return framed(scanhead.EVENT, 0, len(payload), payload)


def telemetry(state, scan):
    payload = struct.pack("<II88x", state, scan)
    return framed(scanhead.TELEMETRY, 0, len(payload), payload)


def ends_of(path, *frames):
    """Returns the frames after which scan_over is true, and the number of lost pulses."""
    with open(path, "wb") as file:
        file.writelines(framed(f[1], 0, len(f) - 28, f[28:], i) for i, f in enumerate(frames))
    head = scanhead.open(path)
    return [i for i, _ in enumerate(head.frames()) if head.scan_over], head.pulses_lost


def ends(path):
    start, stop = event(scanhead.EV_SCAN_START, 1), event(scanhead.EV_SCAN_END, 1, 100, 7)
    state, spin_down = event(scanhead.EV_STATE, 5, 4), telemetry(5, 1)
    lost = event(scanhead.EV_OVERRUN, 90, 3)
    idle, scanning = telemetry(2, 1), telemetry(4, 1)
    following = event(scanhead.EV_SCAN_START, 2), telemetry(4, 2)
    assert ends_of(path, idle, start, scanning, lost, spin_down, stop, state, idle) == ([5], 7)
    assert ends_of(path, start, lost, scanning, spin_down, state, idle) == ([4], 3)
    assert ends_of(path, start, scanning, idle, idle) == ([2], 0)
    for other in following:
        assert ends_of(path, start, scanning, other, scanning) == ([2, 3] if other == following[0] else [2], 0)
    geo = struct.pack("<128xI128xI8x", 1, 1)  # layout geo, which needs no scales; scan 1
    points = struct.pack("<IIQqqII", 0, 0, 0, 50, 0, 0, 0)  # at the frame's time 0: the scan began at -50 ns
    scan = framed(scanhead.DESCRIPTOR, 0, 272, geo), start, framed(scanhead.POINTS, 0, 40, points)
    late, again = (event(scanhead.EV_SCAN_START, 1, t0_ns % 2**64) for t0_ns in (-50, 60))
    assert ends_of(path, *scan, late, scanning, stop) == ([5], 7)
    assert ends_of(path, *scan, again, scanning, stop) == ([3, 5], 7)  # the head has started again
    print("ends")


def bombs(path):
    """Good headers promise 64 KiB, with small good frames between. To sum each payload anew would be 200 MB and take a
    minute. This must take less than 10 s of processor time."""
    resource.setrlimit(resource.RLIMIT_CPU, (10, 10))
    with open(path + ".bombs", "wb") as out:
        out.write((framed(3, 0, 65536, b"") + framed(200, scanhead.LOCAL, 0, b"") +
                   framed(3, 0, 65536, b"") + framed(201, scanhead.LOCAL, 0, b"")) * 1500)
    head = scanhead.open(path + ".bombs")
    assert sum(1 for _ in head.frames()) == 3000 and head.parser.bad_bytes == 3000 * 28


def words(value):
    if isinstance(value, tuple):
        return " ".join(words(v) for v in value)
    return repr(value + 0.0) if isinstance(value, float) else str(value)


def said_of(head, frame):
    """Returns the words below a sample: fields as `name value;`, then records, one a line."""
    names = ("? descriptor anchor points line-end telemetry event surfaces poses attributes emitter colours "
             "waveforms").split()
    flags = "".join(f" {name}" for bit, name in ((1, "REPEAT"), (2, "LOCAL")) if frame.flags & bit)
    text = [f"{names[frame.type]}{flags}; seq {frame.seq}; t_ns {frame.t_ns}"]
    text += [f"{name} {words(value)}" for name, value in frame.fields.items()]
    if frame.type == scanhead.POINTS:
        p = head.points(frame)
        for i, place in enumerate(zip(p.x, p.y, p.z, *head.to_scene(p))):
            x, y, z, *scene = (f"{v:.4f}" for v in place)
            text += [f"echo {p.echo[i]} of {p.echo_count[i]}, label {p.label[i]}, "
                     f"{p.reflectance_db[i]:.2f} dB, t_ns {p.t_ns[i]}, "
                     f"head's frame {x} {y} {z}, scene {' '.join(scene)}"]
    if frame.type == scanhead.ATTRIBUTES:
        rows = zip(*head.attributes(frame), head.deviations(frame))
        text += [f"amplitude {a:.2f} dB, width {w:.2f} ns, deviation {d:.3f}" for a, w, d in rows]
    if frame.type == scanhead.COLOURS:
        text += [f"rgb {r} {g} {b}" for r, g, b in zip(*head.colours(frame))]
    if frame.type == scanhead.WAVES:
        text += [f"window of pulse {w.pulse}, t_ns {w.t_ns}, first {w.first}, direction "
                 f"{' '.join(f'{v + 0.0:.4f}' for v in w.direction)}, counts {' '.join(map(str, w.counts))}"
                 for w in head.waves(frame)]
    if frame.type == scanhead.EMITTER:
        text += [f"beam elevation {words(e)} deg, azimuth {words(a)} deg, {t} ns"
                 for e, a, t in head.emitter["beams"]]
    if frame.type == scanhead.SURFACES:
        text += [f"label {label}: {names[0]} of {names[1]}" for label, names in head.surfaces.items()]
    if frame.type == scanhead.POSES:
        for t_ns, flags in struct.iter_unpack("<q64xI4x", frame.payload[8:]):
            pose = head.pose(t_ns)._replace(flags=flags)  # the client has the flags of both ends of a leg
            text += ["pose " + "; ".join(f"{n} {words(v)}" for n, v in pose._asdict().items())]
    return "; ".join(text)


def samples(page, out):
    blocks = re.findall(r"```text\n(d5 [0-9a-f \n]*)```\n\n```text\n(.*?)```", open(page).read(), re.S)
    with open(out, "wb") as file:
        file.writelines(bytes.fromhex(frame) for frame, _ in blocks)
    head, types = scanhead.open(out), []
    for frame, (_, said) in zip(head.frames(), blocks):
        ours = said_of(head, frame)
        assert said.split() == ours.split(), f"the page says\n{said}\nthe frame holds\n{ours}"
        types.append(frame.type)
    assert head.parser.bad_bytes == 0
    print(*types, head.stream_sha256())


CODES = {"u8": "B", "u16": "H", "u32": "I", "u64": "Q", "i32": "i", "i64": "q", "f32": "f", "f64": "d", "char": "s"}


def tables_of(folder):
    """For each type of frame, the struct format that the first table of its section gives. A type has one section."""
    found = {}
    pages = "".join(open(page).read() for page in sorted(glob.glob(folder + "/*.md")))
    for kind, section in re.findall(r"\n## ([1-9]|1[0-2]) [a-z ]+\n(.*?)(?=\n##|\n# |\Z)", pages, re.S):
        assert int(kind) not in found, f"type {kind}: two sections"
        form = "<"
        for line in section[section.index("| ---"):].split("\n")[1:]:
            row = re.match(r"\| (\d+) \| ([a-z]+\d*)(?:\[(\d+)\])? \|", line)
            if row is None:
                break
            assert struct.calcsize(form) == int(row[1]), f"type {kind}: a gap before offset {row[1]}"
            form += (row[3] or "") + CODES[row[2]]
        found[int(kind)] = struct.Struct(form)
    return found


def flat(fields):
    for value in fields.values():
        yield from value if isinstance(value, tuple) else (value,)


def tables(folder, path):
    forms, seen = tables_of(folder), []
    assert sorted(forms) == list(range(1, 13)), sorted(forms)
    for frame in scanhead.open(path).frames():
        if not frame.fields:
            continue
        theirs = [v.split(b"\0")[0].decode() if isinstance(v, bytes) else v
                  for v in forms[frame.type].unpack_from(frame.payload)]
        ours = list(flat(frame.fields))[:len(theirs)]  # what is sent only at times is in tables of its own
        assert theirs == ours, (frame.type, theirs, frame.fields)
        seen.append(frame.type)
    print(*seen)


if __name__ == "__main__":
    globals()[sys.argv[3]](*sys.argv[4:])
