# SPDX-License-Identifier: MIT
"""This prints the hash of points of a recording, as drivers/link/web/README.md defines it: point_hash.py FILE.shs"""
import os
import struct
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../drivers/host/python"))
import scanhead  # noqa: E402

MASK = 0xFFFFFFFF


def mix(h, k, words):
    for w in words:
        h = (h ^ w) * k & MASK
        last, h = h, h ^ h >> 13
    return (last ^ last >> 16) * 0xC2B2AE35 & MASK


def point_hash(path):
    high = low = 0
    for frame in scanhead.open(path).frames():
        if frame.type != scanhead.POINTS:
            continue
        pulse, begun = frame.fields["pulse0"], False
        for i in range(frame.fields["n_points"]):
            record = struct.unpack_from("<5I", frame.payload, 40 + 20 * i)
            pulse += begun and record[4] >> 24 & 15 < 2
            begun = True
            words = (pulse & MASK, pulse >> 32 & MASK) + record
            high = high + mix(0x9E3779B9, 0xCC9E2D51, words) & MASK
            low = low + mix(0, 0x85EBCA6B, words) & MASK
    return f"{high:08x}{low:08x}"


if __name__ == "__main__":
    print(point_hash(sys.argv[1]))
