# SPDX-License-Identifier: MIT
"""This counts a recording (.shs), so that a page can be compared with it: counts.py FILE.shs. It prints JSON with the
number of echoes and shots, the bounds of all echoes in the scene's frame, and the hash over all records of the points
frames.

The Python client (drivers/host/python) gives the frames and positions, and tests/unit/point_hash.py the hash.
"""
import json
import os
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../unit"))
sys.modules["numpy"] = None  # not needed
from point_hash import point_hash, scanhead  # noqa: E402


def main(file):
    out, low, high = {"points": 0, "shots": 0}, [float("inf")] * 3, [float("-inf")] * 3
    with scanhead.open(file) as head:
        for frame in head.frames():
            if frame.type != scanhead.POINTS:
                continue
            points = head.points(frame)
            echoes = [place for place, echo in zip(zip(*head.to_scene(points)), points.echo) if echo > 0]
            out["points"] += len(echoes)
            out["shots"] += frame.fields["n_pulses"]
            for k, values in enumerate(zip(*echoes)):
                low[k], high[k] = min(low[k], *values), max(high[k], *values)
    print(json.dumps({**out, "min": low, "max": high, "hash": point_hash(file)}))


main(sys.argv[1])
