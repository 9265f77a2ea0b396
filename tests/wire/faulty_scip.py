# SPDX-License-Identifier: MIT
# A client of a Hokuyo UTM-30LX in plain sockets (SCIP 2.0): HOST PORT FILE FAULTS, with the letters of faulty_client.py.
# A scan that comes twice has the same time. Sums, values and the reply's lines are those of SCIP.md.
import math

import faulty_run

FIRST, LAST, FRONT, STEPS = 0, 1080, 540, 1440
REQUEST = b"MD%04d%04d00000\n" % (FIRST, LAST)  # each scan, every step, without end


# The sum leaves out the upper two bits of each character. So each must be a character that the device sends.
def has_sum(line):
    return len(line) > 1 and 0x30 + sum(line[:-1]) % 64 == line[-1] and all(0x30 <= c < 0x70 for c in line)


class Client:
    def __init__(self, faults, out):
        self.faults, self.out, self.time = "" if faults == "none" else faults, out, None

    # The lines of a reply: echo, status, time, data.
    def take_reply(self, lines):
        if len(lines) < 4 or not lines[0].startswith(b"MD") or lines[1][:2] != b"99":
            return
        if not all(map(has_sum, lines[1:])) and "c" not in self.faults:
            return
        if lines[2] == self.time and "t" not in self.faults:
            return
        self.time = lines[2]
        data = b"".join(line[:-1] for line in lines[3:])
        if len(data) != 3 * (LAST - FIRST + 1):
            return
        for step in range(FIRST, LAST + 1):
            a, b, c = (v - 0x30 for v in data[3 * (step - FIRST):3 * (step - FIRST) + 3])
            range_m, angle = 0.001 * (a << 12 | b << 6 | c), math.tau * (step - FRONT) / STEPS
            if range_m != 0:
                self.out.write("%.5f %.5f 0\n" % (range_m * math.cos(angle), range_m * math.sin(angle)))

    def follow(self, head):
        data = b""
        self.time = None
        head.sendall(REQUEST)
        while True:
            got = head.recv(65536)
            if not got:
                return
            *replies, data = (data + got).split(b"\n\n")
            for reply in replies:
                self.take_reply(reply.split(b"\n"))


faulty_run.serve(Client)
