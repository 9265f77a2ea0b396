# SPDX-License-Identifier: MIT
# This prints each point of a LAS file with its waveform, as the ASPRS specification (LAS 1.4 R15) has them: point
# formats 9 and 10, waveform packet descriptors, packets in the file or in a .wdp beside it. The script doesn't depend
# on the program that wrote the file.
#
# Each point has a line: x y z, the descriptor's index; if that is not 0: x y z of the packet's first sample, the number
# of samples, the time between them in ps, the sum of their values (offset + gain * sample), and the samples.
import struct
import sys

las = open(sys.argv[1], "rb").read()
if las[:4] != b"LASF" or las[24:26] != bytes((1, 4)):
    sys.exit("not LAS 1.4")
(encoding,) = struct.unpack_from("<H", las, 6)
(header_size,) = struct.unpack_from("<H", las, 94)
points_at, n_vlrs = struct.unpack_from("<II", las, 96)
point_format, point_len = struct.unpack_from("<BH", las, 104)
scale = struct.unpack_from("<3d", las, 131)
offset = struct.unpack_from("<3d", las, 155)
packets_at, evlrs_at, n_evlrs, n_points = struct.unpack_from("<QQIQ", las, 227)
if point_format not in (9, 10):
    sys.exit("no point format with waveforms")
inside, outside = encoding & 2, encoding & 4
if bool(inside) == bool(outside):
    sys.exit("waveforms are neither inside nor outside, or both")

descriptors = {}
at = header_size
for _ in range(n_vlrs):
    _, user, record, length, _ = struct.unpack_from("<H16sHH32s", las, at)
    at += 54
    if user.rstrip(b"\0") == b"LASF_Spec" and 99 < record < 355:
        descriptors[record - 99] = struct.unpack_from("<BBIIdd", las, at)
    at += length
if at > points_at:
    sys.exit("records reach into the points")

packets = las if inside else open(sys.argv[1][:-3] + "wdp", "rb").read()
begin = packets_at if inside else 0
_, user, record, length, _ = struct.unpack_from("<H16sHQ32s", packets, begin)
if user.rstrip(b"\0") != b"LASF_Spec" or record != 65535 or begin + 60 + length != len(packets):
    sys.exit("the record of waveform packets is not what the header says")
if inside and (packets_at != points_at + n_points * point_len or evlrs_at != packets_at or n_evlrs != 1):
    sys.exit("the record of waveform packets does not follow the points")

out = open(sys.argv[2], "w")
for i in range(n_points):
    p = points_at + i * point_len
    xyz = [n * s + o for n, s, o in zip(struct.unpack_from("<3i", las, p), scale, offset)]
    wave = p + (30 if point_format == 9 else 38)
    index, start, size, location, dx, dy, dz = struct.unpack_from("<BQIffff", las, wave)
    words = [repr(v) for v in xyz] + [str(index)]
    if index != 0:
        bits, compression, n, spacing_ps, gain, volts = descriptors[index]
        if compression != 0 or size != n * bits // 8 or start + size > 60 + length:
            sys.exit(f"point {i}: a packet of another length, or beyond the record")
        samples = struct.unpack_from(f"<{n}{'B' if bits == 8 else 'H'}", packets, begin + start)
        first = [v + location * d for v, d in zip(xyz, (dx, dy, dz))]
        words += [repr(v) for v in first] + [str(n), str(spacing_ps)]
        words += [repr(sum(volts + gain * s for s in samples))] + [str(s) for s in samples]
    print(*words, file=out)
