# SPDX-License-Identifier: MIT
"""The Python client at one end of a socket pair, where the test is the head: wrong calls, replies that come late, frames
that are hurt or missing. python_client.py runs these."""
import contextlib
import hashlib
import io
import math
import os
import socket
import struct
import threading

import scanhead


def framed(kind, flags, length, payload, seq=0):
    head = struct.pack("<BBBBIIIq", 0xD5, kind, 1, flags, length, seq, scanhead.crc32c(payload), 0)
    return head + struct.pack("<I", scanhead.crc32c(head)) + payload


def refused(function, *arguments):
    try:
        function(*arguments)
    except scanhead.ScanheadError as error:
        return str(error)
    assert False, f"{arguments} was taken"


def pair():
    ours, theirs = socket.socketpair()
    ours.setblocking(False)
    return scanhead.Head(scanhead._Source("pair", ours.fileno(), ours)), theirs


def misuse(path):
    for source in ("tcp:127.0.0.1:65537", "tcp:127.0.0.1:0", "tcp:127.0.0.1:\xb2", "tcp:5025", "a\0b", "",
                   "tcp:" + 70 * "a" + ".b:1", "tty:" + path):
        refused(scanhead.open, source)
    for address in ("::1:4000", "[::1]4000", "[::1", "[]:4000", ":4000", "[[::1]]:4000", "127.0.0.1:004000"):
        assert "not an address" in refused(scanhead.open, "tcp:" + address), address  # as scanhead_open says
    os.mkfifo(path + ".fifo")
    for source in ("/", "/dev/zero", path + ".fifo"):
        refused(scanhead.open, source)
    with open(path + ".shs", "wb") as recording:
        recording.write(framed(200, 0, 0, b""))  # of a kind that no head sends yet
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()) as said:
        assert scanhead.main([path + ".shs", "*IDN?"]) == 2
    assert "a recording takes no commands" in said.getvalue()
    for head in (scanhead.open(path), pair()[0]):
        head.close()
        head.close()
        refused(head.next_frame)
        refused(head.query, "*IDN?")
    head, theirs = pair()
    threading.Timer(0.05, theirs.close).start()
    refused(head.next_frame, 1e300)  # longer than poll() can wait
    connected_to_itself()
    keeps_alive()
    oldest_gap()
    for lines in (["HEAD:PRR?"], [":*idn?"], ["HEAD:PRR?", "*IDN?"]):
        late_replies(lines)
    late_answer()
    half_a_frame()
    dropped_frames()
    alike(path + ".alike")
    whole_frame()
    print("refused")


def connected_to_itself():
    """Where nobody listens, the system may give a socket the same port that it connects to. TCP then connects it to
    itself. Here the socket asks for that port."""
    connect = socket.create_connection
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    socket.create_connection = lambda at, timeout_s: connect(at, timeout_s, source_address=at)
    try:
        refused(scanhead.open, f"tcp:127.0.0.1:{port}")
    finally:
        socket.create_connection = connect


def keeps_alive():
    """A head that loses power says nothing. After 10 s of silence its client asks three times, 5 s apart."""
    with socket.create_server(("127.0.0.1", 0)) as door:
        with scanhead.open(f"tcp:127.0.0.1:{door.getsockname()[1]}") as head:
            ours = head._source.owner
            assert ours.getsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE) == 1
            idle_s, interval_s, probes = (ours.getsockopt(socket.IPPROTO_TCP, option) for option in (
                socket.TCP_KEEPIDLE, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT))
            assert idle_s + interval_s * probes == 25


def oldest_gap():
    """A late frame cuts the oldest of 64 gaps in two. Both parts stay gaps; the next oldest gap is given up."""
    sequence = scanhead._Sequence()
    assert sequence.take((0, 0, 0)) == ("", 0, 1)
    for i in range(1, 65):
        assert sequence.take((4 * i, 0, i)) == ("gap", 4 * i - 3, 3)
    for seq in (2, 1, 3):
        assert sequence.take((seq, 0, -seq)) == ("late", seq, 1)
    assert sequence.take((6, 0, -6)) == ("restarted", 6, 1)


def late_replies(lines):
    """Replies to commands that were given up come only after the next command."""
    head, theirs = pair()
    for line in lines:
        refused(head.query, line, 0.0)
    replies = {"HEAD:PRR?": "1", "*IDN?": "a,b,c,scanhead native 1", ":*idn?": "a,b,c,scanhead native 1", "HEAD:LINes?": "2"}

    def answer():
        for line in theirs.makefile():
            if line.strip():
                theirs.sendall(replies[line.strip()].encode() + b"\r\n")

    threading.Thread(target=answer, daemon=True).start()
    assert [head.query("HEAD:LINes?") for _ in range(3)] == ["2", "2", "2"]


def late_answer():
    """One of two questions for the identity is answered at once, the other one before the reply to the next command."""
    head, theirs = pair()
    refused(head.query, "*IDN?", 0.0)

    def answer():
        asked = 0
        for line in theirs.makefile():
            asked += line.strip() == "*IDN?"
            if line.strip():
                theirs.sendall({"*IDN?": b"a,b,c,scanhead native 1\r\n" if asked == 2 else b""}.get(line.strip(), b"a,b,c,scanhead native 1\r\n2\r\n"))

    threading.Thread(target=answer, daemon=True).start()
    assert head.query("HEAD:LINes?") == "2"


def half_a_frame():
    """The terminal's last program left in the middle of a frame. The first answer is lost in the rest of that frame."""
    head, theirs = pair()
    head._unsettled = True  # as on a terminal
    frame = framed(scanhead.EVENT, 0, 128, bytes(128))

    def answer():
        asked = 0
        for line in theirs.makefile():
            if line.strip() == "*IDN?":
                asked += 1
                theirs.sendall((frame[:60] if asked == 1 else frame) + b"a,b,c,scanhead native 1\r\n")
            elif line.strip():
                theirs.sendall(b"2\r\n")

    threading.Thread(target=answer, daemon=True).start()
    assert head.query("HEAD:LINes?", 60) == "2"


def whole_frame():
    """A frame that needs two reads is returned even with no time to wait."""
    head, theirs = pair()
    theirs.sendall(framed(200, scanhead.LOCAL, 65536, bytes(65536)))
    assert len(head.next_frame(0).payload) == 65536
    refused(head.next_frame, 0)


def dropped_frames():
    """Frames that find no room while a reply is awaited are counted, and stay in the hash. A wrong one ends the command,
    whose reply does not count for the next one."""
    frames = [framed(scanhead.ATTRIBUTES, 0, 16, struct.pack("<QII", i, 0, 0), i) for i in range(10)]
    wrong = framed(scanhead.DESCRIPTOR, 0, 4, b"abcd") + b"".join(frames[1:4])
    replies = {"TIME?": b"".join(frames) + b"5\r\n", "SCAN:STARt": wrong, "*IDN?": b"6\r\na,b,c,scanhead native 1\r\n",
               "HEAD:PRR?": b"7\r\n", "": b""}

    def answer(theirs):
        for line in theirs.makefile():
            theirs.sendall(replies[line.strip()])

    whole, theirs = pair()
    theirs.sendall(b"".join(frames))
    for _ in frames:
        whole.next_frame(5)
    most, scanhead._QUEUE_BYTES = scanhead._QUEUE_BYTES, 2000  # three such frames
    head, theirs = pair()
    threading.Thread(target=answer, args=(theirs,), daemon=True).start()
    assert head.query("TIME?") == "5" and head.dropped == 7, head.dropped
    for _ in range(3):
        head.next_frame(5)
    assert head.stream_sha256() == whole.stream_sha256()
    head, theirs = pair()
    threading.Thread(target=answer, args=(theirs,), daemon=True).start()
    refused(head.query, "SCAN:STARt")
    assert head.query("HEAD:PRR?") == "7"
    scanhead._QUEUE_BYTES = most


def restarted():
    """The state of a sequence is void for the next one: after a frame that came twice, and where the next one begins
    with the last frame's own number."""
    for kinds_and_numbers in (((200, 6), (200, 6), (201, 5)), ((200, 6), (201, 6))):
        head, theirs = pair()
        theirs.sendall(b"".join(framed(kind, 0, 0, b"", seq) for kind, seq in kinds_and_numbers))
        head.next_frame(5)
        head.descriptor, head.anchor, head._gps = {}, {}, (0, 0)
        assert head.next_frame(5).type == 201 and head.descriptor is None and head.gps_time_ns(0) is None


def later_version():
    """A frame of another version is refused, and the next one comes. The hash is over both, as COUNTS.md says."""
    head, theirs = pair()
    later = bytearray(framed(scanhead.LINE_END, 0, 3, b"abc", 0))
    later[2] = 2
    later[24:28] = struct.pack("<I", scanhead.crc32c(bytes(later[:24])))
    theirs.sendall(bytes(later) + framed(200, 0, 0, b"", 1))
    assert "version 2" in refused(head.next_frame, 5)
    assert head.next_frame(5).seq == 1
    assert head.stream_sha256() == hashlib.sha256(b"\x04\x03\0\0\0abc").hexdigest()


def geoid_range():
    """A range along the meridian, by its radius of curvature and the ellipsoidal height. With heights above the geoid the
    47 m below it count, too: they are 15 mm of the range."""
    record = struct.pack("<iiIhHI", 1800000, 0, 0, 0, 0, 0x11000000)
    e2 = (2 - 1 / 298.257223563) / 298.257223563
    for heights, height_m in ((0, 100.0), (1, 147.0)):
        raw = scanhead._raw_columns(bytes(40) + record, 1)
        points = scanhead._common(raw, 0, scanhead.GEO)
        scanhead._geo_points(points, raw, {"crs": scanhead.CRS_GEODETIC, "moving": 0, "heights": heights,
                                           "height_m": height_m, "anchor": (45.0, 13.0, 100.0),
                                           "scale": (1e-8, 1e-8, 1e-3)})
        radius_m = 6378137.0 * (1 - e2) / (1 - e2 * math.sin(math.radians(45.009))**2)**1.5 + height_m
        assert abs(points.range_m[0] - math.radians(0.018) * radius_m) < 1e-3, (heights, points.range_m[0])


def alike(path):
    """Two recordings are put together. The second begins with two frames of the first, which hold for it, too."""
    with open(path, "wb") as file:
        for kind, seq in ((200, 5), (201, 6), (202, 7), (200, 5), (201, 6), (203, 7), (204, 8)):
            file.write(framed(kind, 0, 0, b"", seq))
    for anchor_seq, has_anchor in ((6, True), (7, False), (4, False)):
        head = scanhead.open(path)
        assert [head.next_frame().type for _ in range(3)] == [200, 201, 202]
        head.descriptor, head.anchor, head._descriptor_seq, head._anchor_seq = {}, {}, 5, anchor_seq
        for kind in (203, 204):
            assert head.next_frame().type == kind
            assert head.descriptor == {} and (head.anchor == {}) == has_anchor, (anchor_seq, kind)


def notices():
    """A live head's faults are noticed once each, at their byte, before the frame that follows them."""
    restarted()
    later_version()
    geoid_range()
    said = []
    head, theirs = pair()
    head.on_notice = lambda n: said.append(tuple(n)[:4])
    frames = [framed(scanhead.EVENT, 0, 128, struct.pack("<Q120x", i), (2**32 - 2 + i) % 2**32) for i in range(9)]
    hurt = frames[5][:99] + b"?" + frames[5][100:]
    theirs.sendall(frames[0] + frames[2] + frames[2] + b"\0\1" + frames[1] + hurt + frames[6] +
                   framed(200, 0, 0, b"", 2**31 + 6))
    assert [head.next_frame(5).seq for _ in range(3)] == [2**32 - 2, 0, 4]
    head.descriptor, head.anchor, head._gps = {}, {}, (0, 0)
    assert head.next_frame(5).seq == 2**31 + 6
    assert head.descriptor is None and not head.can_place() and head.gps_time_ns(0) is None
    size = len(hurt)
    assert said == [("gap", size, 2**32 - 1, 1), ("repeated", 2 * size, 0, 1), ("bad bytes", 3 * size, 0, 2),
                    ("late", 3 * size + 2, 2**32 - 1, 1), ("bad payload", 4 * size + 2, 3, size),
                    ("gap", 5 * size + 2, 1, 3), ("restarted", 6 * size + 2, 2**31 + 6, 1)], said
    at_byte, said[:] = 6 * size + 2 + 28, []
    theirs.sendall(b"9\r\n")
    refused(head.next_frame, 0.0)
    assert said == [("unasked", at_byte, 0, 1)]
    refused(head.query, "TIME?", 0.0)
    theirs.sendall(b"77\r\n")
    refused(head.next_frame, 0.0)
    assert said[1:] == [("late reply", at_byte + 3, 0, 2)] and head.late_replies == 1

    def answer():
        for line in theirs.makefile():
            if line.strip() == "*IDN?":
                theirs.sendall(b"*IDN?\r\na,b,c,scanhead native 1\r\n")
            if line.strip() == "HEAD:PRR?":
                theirs.sendall(b"HEAD:PRR?\r\n5\r\n" + frames[7][:40])
                break

    thread = threading.Thread(target=answer)
    thread.start()
    assert head.query("HEAD:PRR?") == "5"
    thread.join()
    theirs.shutdown(socket.SHUT_WR)
    for _ in range(2):
        refused(head.next_frame, 5)
    assert said[2:] == [("echo", at_byte + 7, 0, 5), ("echo", at_byte + 39, 0, 9), ("cut", at_byte + 53, 5, 40),
                        ("closed", at_byte + 93, 0, 1)], said[2:]
    assert (head.parser.cuts, head.echoes, head.unasked, head.parser.repeated) == (1, 2, 1, 1)
    print("noticed")


def chatter(data):
    """The head sends without end, but never the awaited answer. Calls still end when their time is over."""
    head, theirs = pair()

    def send():
        try:
            while True:
                theirs.sendall(data * 100)
        except OSError:
            theirs.close()

    sender = threading.Thread(target=send)
    sender.start()
    try:
        head.query("*IDN?", 0.05) if data[0] == 0xD5 else head.next_frame(0.05)
        assert False, "something came"
    except scanhead.Timeout:
        pass
    head.close()
    sender.join()
