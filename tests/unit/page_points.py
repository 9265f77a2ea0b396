# SPDX-License-Identifier: MIT
"""page_native.mjs compares its points with the files of this program: page_points.py NAME... For each NAME.shs it writes
NAME.points, which has for each echo x, y, z (scene, m), t (s), range (m), reflectance, amplitude (dB), label, echo, echoes
and pulse as doubles. It also writes NAME.said, with the hash of points and the number of shots."""
import array
import math
import os
import sys

root = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../..")
sys.path.insert(0, os.path.join(root, "drivers/host/python"))
sys.modules["numpy"] = None  # its start takes longer than these recordings
import scanhead  # noqa: E402
from point_hash import point_hash  # noqa: E402


def pulses(first, echoes):
    pulse, begun = first, False
    for echo in echoes:
        pulse += begun and echo < 2
        begun = True
        yield pulse


def rows_of(head, frame):
    p = head.points(frame)
    nan = [math.nan] * len(p.x)
    return [list(row) for row in zip(*head.to_scene(p), (1e-9 * t for t in p.t_ns), p.range_m, p.reflectance_db, nan,
                                     p.label, p.echo, p.echo_count, pulses(frame.fields["pulse0"], p.echo))]


def main(names):
    for name in names:
        out, shots, rows = array.array("d"), 0, []
        head = scanhead.open(name + ".shs")

        def write():
            for row in rows:
                if row[9]:
                    out.extend(row)

        for frame in head.frames():
            if frame.type == scanhead.POINTS:
                write()
                rows = rows_of(head, frame)
                shots += frame.fields["n_pulses"]
            elif frame.type == scanhead.ATTRIBUTES:
                for row, amplitude in zip(rows, head.attributes(frame)[0]):
                    row[6] = amplitude
        write()
        with open(name + ".points", "wb") as file:
            out.tofile(file)
        with open(name + ".said", "w") as file:
            print(point_hash(name + ".shs"), shots, file=file)


main(sys.argv[1:])
