# SPDX-License-Identifier: MIT
# The same client as faulty_client.c, in Python's standard library alone: HOST PORT FILE FAULTS.
# FAULTS has these letters, or is `none`: c takes frames with a wrong checksum; s stays away once its connection has
# ended; t takes a repeated frame again. Offsets are those of PROTOCOL.md, ANCHOR.md and POINTS.md.
import socket
import struct

import faulty_run

SYNC, HEADER, ANCHOR, POINTS, LOCAL = 0xD5, 28, 2, 3, 2

TABLE = []
for byte in range(256):
    for _ in range(8):
        byte = byte >> 1 ^ (0x82F63B78 if byte & 1 else 0)
    TABLE.append(byte)


def crc32c(data):
    crc = 0xFFFFFFFF
    for byte in data:
        crc = crc >> 8 ^ TABLE[(crc ^ byte) & 0xFF]
    return crc ^ 0xFFFFFFFF


class Client:
    def __init__(self, faults, out):
        self.faults, self.out = "" if faults == "none" else faults, out
        self.seq = self.anchor = None
        self.scans = False

    def take_anchor(self, payload):
        scale_m, = struct.unpack_from("<d", payload, 40)
        scale = struct.unpack_from("<3d", payload, 168)
        self.anchor = struct.unpack_from("<3d", payload, 16), [s if s > 0 else scale_m for s in scale]

    def take_points(self, payload):
        n, = struct.unpack_from("<I", payload, 36)
        if self.anchor is None or 40 + 20 * n > len(payload):
            return
        for x, y, z, _, echo in struct.iter_unpack("<iiiII", payload[40:40 + 20 * n]):
            if echo >> 28:
                at = [a + s * v for a, s, v in zip(*self.anchor, (x, y, z))]
                self.out.write("%.6f,%.6f,%.6f\n" % tuple(at))

    def take_frame(self, header, payload):
        kind, flags, seq, crc = header[1], header[3], *struct.unpack_from("<II", header, 8)
        if crc32c(payload) != crc and "c" not in self.faults:
            return
        if not flags & LOCAL:
            if self.seq is not None and (seq - self.seq - 1) % 2**32 >= 2**31 and "t" not in self.faults:
                return
            self.seq = seq
        if kind == ANCHOR:
            self.take_anchor(payload)
        if kind == POINTS:
            self.take_points(payload)

    # Replies are printable. Any other byte is skipped.
    def take_line(self, data, at):
        end = at
        while end < len(data) and 0x20 <= data[end] <= 0x7E:
            end += 1
        if end == len(data):
            return 0
        self.scans |= data[at:at + 8] == b"scanning"
        return max(end - at, 1)

    # Returns how many bytes the piece at `at` takes; 0: it is not whole.
    def take_piece(self, data, at):
        if data[at] != SYNC:
            return self.take_line(data, at)
        if len(data) - at < HEADER:
            return 0
        length, = struct.unpack_from("<I", data, at + 4)
        if crc32c(data[at:at + 24]) != struct.unpack_from("<I", data, at + 24)[0]:
            return 1
        if len(data) - at < HEADER + length:
            return 0
        self.take_frame(data[at:at + HEADER], data[at + HEADER:at + HEADER + length])
        return HEADER + length

    # Reads until the connection ends. Asks until the head scans; a command that the state does not allow changes nothing.
    def follow(self, head):
        data = bytearray()
        self.seq = self.anchor = None
        self.scans = False
        head.settimeout(0.05)
        head.sendall(b"SCAN:STARt\nHEAD:STATe?\n")
        while True:
            try:
                got = head.recv(65536)
            except socket.timeout:
                if not self.scans:
                    head.sendall(b"SCAN:STARt\nHEAD:STATe?\n")
                continue
            if not got:
                return
            data += got
            at = 0
            while at < len(data):
                piece = self.take_piece(data, at)
                if piece == 0:
                    break
                at += piece
            del data[:at]


faulty_run.serve(Client, "x,y,z\n")
