# SPDX-License-Identifier: MIT
"""page_native.mjs compares its notices with the files of this program. page_hurt.py NAME writes streams with random faults
of every kind, NAME-0.shs and more. For each it writes NAME-0.notices: a line for each notice and item of the Python client."""
import os
import random
import struct
import sys

root = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../..")
sys.path.insert(0, os.path.join(root, "drivers/host/python"))
sys.modules["numpy"] = None
import scanhead  # noqa: E402

FRAMES, STREAMS = 200, 12


def framed(rng, seq, t_ns):
    """Payloads are full of sync bytes, and one frame in 15 is LOCAL."""
    local = rng.random() < 1 / 15
    payload = bytes(rng.choice((0xD5, rng.randrange(256))) for _ in range(rng.randrange(120)))
    head = struct.pack("<BBBBIIIq", 0xD5, 200, 1, scanhead.LOCAL if local else 0, len(payload),
                       0 if local else seq, scanhead.crc32c(payload), t_ns)
    return head + struct.pack("<I", scanhead.crc32c(head)) + payload


def stream(rng):
    seq, late, parts = rng.choice((0, 2**32 - 100, 2**31 - 50, 2**32 - 1)), [], []
    for i in range(FRAMES):
        frame = framed(rng, seq, i)
        seq = (seq + (1 if rng.random() < 0.99 else 2**31 + rng.randrange(2**30))) % 2**32
        fault = rng.randrange(30)
        at = rng.randrange(len(frame))
        if fault == 1:
            parts.append(bytes(rng.randrange(256) for _ in range(rng.randrange(1, 60))))
        if fault == 2:
            parts.append(b"OK\r\n")
        if fault == 3:
            frame = frame[:at] + bytes([frame[at] ^ 1 << rng.randrange(8)]) + frame[at + 1:]
        if fault == 4:
            frame = frame[:at]
        if fault in (5, 6):  # the frame comes once more, or later
            late.append((i + rng.randrange(20), frame))
        if fault not in (0, 6):
            parts.append(frame)
        parts += [f for due, f in late if due <= i]
        late = [(due, f) for due, f in late if due > i]
    return b"".join(parts)[:-rng.randrange(1, 200)]


def late_run(rng):
    """The head starts again: with a number that came already, in another frame, and with numbers that were all
    missing."""
    again = [0, 3, 1, 3, 4]  # 1 is late, of what 2 is missing yet; the second 3 is of another sequence
    return b"".join(framed(rng, seq, seq) for seq in [*again, *range(6), *range(1000, 1011), *range(2, 900)])


def main(name):
    rng, kinds = random.Random(5), set()
    for k in range(STREAMS):
        data, said = stream(rng) if k else late_run(rng), []
        parser = scanhead.Parser(lambda n: said.append(n[:4] + (-1 if n.t_ns is None else n.t_ns,)))
        parser.feed(data)
        while True:
            item = parser.next(True)
            if item is None:
                break
            said.append(("text",) if isinstance(item, str) else ("frame", item.seq, item.t_ns))
        with open(f"{name}-{k}.shs", "wb") as file:
            file.write(data)
        with open(f"{name}-{k}.notices", "w") as file:
            file.writelines(",".join(map(str, line)) + "\n" for line in said)
        kinds |= {line[0] for line in said}
    assert kinds == {"text", "frame", "gap", "repeated", "late", "restarted", "bad payload", "bad bytes", "cut"}, kinds


main(sys.argv[1])
