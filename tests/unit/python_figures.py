# SPDX-License-Identifier: MIT
"""This checks figures of the Python client that few streams show: python_figures.py numpy|plain prints "same" or "no numpy"."""
import math
import os
import struct
import sys

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), "../../drivers/host/python"))
if sys.argv[1] == "plain":
    sys.modules["numpy"] = None
import scanhead  # noqa: E402


def geodetic(lon_deg, count, echo=1, echoes=1, moving=0):
    """Returns a point of the geo layout, count steps of 1e-8 degrees east of the anchor."""
    record = struct.pack("<IIIhHI", 0, count & 0xFFFFFFFF, 0, -1234, 40000, echoes << 28 | echo << 24 | 7)
    raw = scanhead._raw_columns(bytes(40) + record, 1)
    points = scanhead._common(raw, 1000, scanhead.GEO)
    scanhead._geo_points(points, raw, {"crs": scanhead.CRS_GEODETIC, "anchor": (10.0, lon_deg, 100.0),
                                       "scale": (1e-8, 1e-8, 1e-3), "heights": 0, "moving": moving})
    return points


def points():
    """Longitudes stay within 180 degrees. Counts of echoes have four bits, and labels have sixteen."""
    for lon_deg, count, want in ((179.9999, 30000, -179.9998), (-179.9999, -30000, 179.9998), (9.0, -5, 9 - 5e-8)):
        p = geodetic(lon_deg, count, 14, 15)
        assert abs(p.y[0] - want) < 1e-12, (lon_deg, p.y)
        assert (p.echo[0], p.echo_count[0], p.label[0], p.t_ns[0]) == (14, 15, 40000, 1007)
        assert abs(p.reflectance_db[0] + 12.34) < 1e-12
        assert p.range_m[0] > 0 and math.isnan(geodetic(lon_deg, count, moving=1).range_m[0])


def not_finite():
    """Each double of each frame is refused if it is infinite or NaN."""
    for kind in (scanhead.DESCRIPTOR, scanhead.ANCHOR):
        form = scanhead._UNPACK[kind][0]
        plain = list(form.unpack(bytes(form.size)))
        for i in [k for k, v in enumerate(plain) if isinstance(v, float)]:
            for wrong in (math.inf, -math.inf, math.nan):
                values = plain[:i] + [wrong] + plain[i + 1:]
                try:
                    scanhead._decode(kind, form.pack(*values))
                    assert False, (kind, i, wrong)
                except scanhead.ScanheadError:
                    pass


def turns():
    """The turn between two poses is the short one, 0.2 rad about z, whatever the signs of their quaternions."""
    for sign in (1, -1):
        a = scanhead.Pose(0, (0, 0, 0), (1, 0, 0, 0), 0, 0)
        b = scanhead.Pose(10, (0, 0, 0), (sign * math.cos(0.1), 0, 0, sign * math.sin(0.1)), 0, 0)
        leg = scanhead._leg(a, b)
        assert abs(leg.angle_rad - 0.2) < 1e-12 and abs(leg.axis[2] - 1) < 1e-12, leg


def rings():
    """On the wire an elevation is rounded to 1e-6 degrees. The client makes it a multiple of the step again."""
    e = scanhead._rings({"gaps": 7, "rings": 6, "first_ring_udeg": round(1e6 * (-90 + 180 / 7))})
    assert abs(e["first_ring_deg"] - (-90 + 180 / 7)) < 1e-12 and e["ring_step_deg"] == 180 / 7, e


if sys.argv[1] == "numpy" and scanhead.np is None:
    print("no numpy")
else:
    points()
    not_finite()
    turns()
    rings()
    print("same")
