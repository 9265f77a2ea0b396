# SPDX-License-Identifier: MIT
"""Clients of the long soak: those that read all, come and go, stall, or misbehave, one class a kind.

Each is a thread. `visits` counts its visits, `good` those that got a right answer, and `turned_away` those whose connection was
closed before. A visit that only sends noise gets nothing and counts as neither. Each thing that must never happen is a line in
`wrong`, and a head that says nothing for half a minute is one, too.
"""
import base64
import os
import random
import re
import select
import socket
import struct
import termios
import threading
import time
import tty

CHUNK = 1 << 16
PATIENCE_S = 30.0  # a loaded machine answers late, and a head that never answers is found all the same


class Client(threading.Thread):
    """Comes again and again until `stop` is set, at most every `pause_s`."""

    pause_s = 0.5

    def __init__(self, name, endpoint, stop, seed):
        super().__init__(name=name, daemon=True)
        self.endpoint, self.stop, self.rng = endpoint, stop, random.Random(seed)
        self.visits = self.good = self.turned_away = self.bytes = 0
        self.wrong = []

    def run(self):
        while not self.stop.is_set():
            self.visits += 1
            try:
                self.good += bool(self.visit())
            except TimeoutError:
                self.wrong.append(f"no answer within {PATIENCE_S:g} s")
            except OSError:  # a full or busy head closes, and its process shows whether the head has ended
                self.turned_away += 1
            except Exception as error:  # the reply has not the form that it must have
                self.wrong.append(f"{type(error).__name__}: {error}")
            self.stop.wait(self.pause_s * self.rng.uniform(0.2, 1.8))

    def visit(self):
        raise NotImplementedError

    # -- sockets

    def connect(self, rcvbuf=None):
        host, port = re.search(r"([\d.]+):(\d+)", self.endpoint).groups()
        sock = socket.socket()
        if rcvbuf:
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, rcvbuf)
        sock.settimeout(PATIENCE_S)
        sock.connect((host, int(port)))
        return sock

    def exactly(self, sock, n):
        data = bytearray()
        while len(data) < n:
            piece = sock.recv(n - len(data))
            if not piece:
                raise OSError("closed")
            data += piece
        self.bytes += n
        return bytes(data)

    def until(self, sock, end, most=1 << 20):
        data, new = bytearray(), 0
        while data.find(end, max(0, new - len(end) + 1)) < 0 and len(data) < most:
            piece, new = sock.recv(CHUNK), len(data)
            if not piece:
                raise OSError("closed")
            data += piece
            self.bytes += len(piece)
        return bytes(data)

    def drink(self, fd, seconds, most=1 << 30):
        """Reads for some seconds. Returns how many bytes came."""
        until_s, n = time.monotonic() + seconds, 0
        while n < most and not self.stop.is_set():
            left_s = until_s - time.monotonic()
            if left_s <= 0 or not select.select([fd], [], [], left_s)[0]:
                break
            piece = os.read(fd, CHUNK)
            if not piece:
                break
            n += len(piece)
        self.bytes += n
        return n

    @staticmethod
    def reset(sock):
        """Closes by RST instead of FIN, as a process does that is killed with bytes unread."""
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        sock.close()


class ComesAndGoes(Client):
    """A native client over TCP. It asks for the identity, reads for a moment, and closes in good order or not."""

    def visit(self):
        with self.connect() as sock:
            sock.sendall(b"*IDN?\n")
            data = self.until(sock, b",scanhead native ", 1 << 24)
            self.drink(sock.fileno(), self.rng.uniform(0, 1.5))
            if self.rng.random() < 0.5:
                self.reset(sock)
            return b",scanhead native " in data


class Stalls(Client):
    """Connects, asks, and reads nothing for a minute."""

    def visit(self):
        with self.connect(rcvbuf=4096) as sock:
            sock.sendall(b"HEAD:STATe?\n")
            self.stop.wait(60)
            return True


class Misbehaves(Client):
    """Sends things that no client should: noise, lines without end, half commands. Each has its own way to close."""

    def visit(self):
        with self.connect() as sock:
            rng = self.rng
            kind = rng.randrange(5)
            if kind == 0:
                sock.sendall(rng.randbytes(rng.randrange(1, 20000)))
            elif kind == 1:
                sock.sendall(b"HEAD:PRR " + b"9" * rng.randrange(1, 200000))
            elif kind == 2:
                sock.sendall(b"\n;;;:*?\n" * rng.randrange(1, 500))
            elif kind == 3:
                sock.sendall(b"FAULt:ADD {kind: drop, every: " + b"-" * 400 + b"\nSCAN:STO")
            else:
                sock.sendall(b"*RST?\n*IDN\nHELP? \x00\xff\nTIME:STEP 1e300 S\n")
            self.drink(sock.fileno(), rng.uniform(0, 0.5))
            if rng.random() < 0.5:
                self.reset(sock)
            return True


class Terminal(Client):
    """A native client at the terminal, sometimes one that reads nothing."""

    def visit(self):
        fd = os.open(self.endpoint.removeprefix("tty:"), os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(fd, termios.TCSANOW)
            os.write(fd, b"HEAD:STATe?\n" if self.rng.random() < 0.8 else self.rng.randbytes(300))
            if self.rng.random() < 0.2:
                self.stop.wait(self.rng.uniform(1, 5))
            return self.drink(fd, self.rng.uniform(0.1, 2)) > 0
        finally:
            os.close(fd)


class Nmea(Client):
    """Reads sentences at the GNSS receiver's terminal, each with its checksum."""

    def visit(self):
        fd = os.open(self.endpoint.removeprefix("tty:"), os.O_RDONLY | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(fd, termios.TCSANOW)
            data, until_s = b"", time.monotonic() + 5
            while time.monotonic() < until_s and not self.stop.is_set():
                if select.select([fd], [], [], 0.5)[0]:
                    data += os.read(fd, 4096)
        finally:
            os.close(fd)
        lines = data.split(b"\r\n")[1:-1]  # the first line may have begun earlier
        for line in lines:
            match = re.fullmatch(rb"\$([^*]*)\*([0-9A-F]{2})", line)
            total = 0
            for byte in match.group(1) if match else b"":
                total ^= byte
            if not match or total != int(match.group(2), 16):
                self.wrong.append(f"no sentence: {line[:80]!r}")
        return len(lines) > 0


class Page(Client):
    """Asks as a browser does for the page, or for messages of a WebSocket. Sometimes it sends noise instead."""

    def visit(self):
        with self.connect() as sock:
            kind = self.rng.randrange(4)
            if kind == 0:
                sock.sendall(self.rng.randbytes(500))
                return False
            host = b"Host: %s:%d\r\n" % (sock.getpeername()[0].encode(), sock.getpeername()[1])
            if kind == 1:
                sock.sendall(b"GET / HTTP/1.1\r\n" + host + b"Connection: close\r\n\r\n")
                self.expect(self.until(sock, b"\r\n"), b"200")
                return False  # the visit is only for the messages
            key = base64.b64encode(self.rng.randbytes(16))
            sock.sendall(b"GET /ws HTTP/1.1\r\n" + host + b"Upgrade: websocket\r\nConnection: Upgrade\r\n"
                         b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: scanhead-native-1\r\n"
                         b"Sec-WebSocket-Key: " + key + b"\r\n\r\n")
            self.expect(self.until(sock, b"\r\n"), b"101")
            return self.drink(sock.fileno(), self.rng.uniform(0.2, 3)) > 0

    def expect(self, answer, code):
        if answer.split(b" ")[1] != code:
            self.wrong.append(f"no {code.decode()}: {answer[:40]!r}")


class UsbIp(Client):
    """A USB/IP host: imports the head, reads its descriptors, opens the stream, takes some of it and goes."""

    def submit(self, sock, endpoint, is_in, length, setup=bytes(8), data=b""):
        self.sequence += 1
        sock.sendall(struct.pack(">IIIIIIiiii", 1, self.sequence, self.device, int(is_in), endpoint, 0, length, 0,
                                 -1, 0) + setup + data)
        while True:
            head = self.exactly(sock, 48)
            command, sequence, _, _, _, status, actual = struct.unpack(">IIIIIii", head[:28])
            body = self.exactly(sock, actual) if is_in and actual > 0 else b""
            if command != 3 or sequence > self.sequence:
                raise ValueError(f"reply {command:#x} to {sequence}")
            if sequence == self.sequence:
                return status, body

    def visit(self):
        with self.connect() as sock:
            if self.rng.random() < 0.2:
                sock.sendall(self.rng.randbytes(self.rng.randrange(1, 400)))
                return False
            sock.sendall(struct.pack(">HHI", 0x0111, 0x8005, 0))
            listing = self.exactly(sock, 12 + 312)
            if struct.unpack(">I", listing[8:12])[0] != 1:
                raise ValueError("not one device")
            bus_id = listing[12 + 256:12 + 288]  # the bus id's number depends on the heads beside it
        with self.connect() as sock:
            sock.sendall(struct.pack(">HHI", 0x0111, 0x8003, 0) + bus_id)
            status = struct.unpack(">HHI", self.exactly(sock, 8))[2]
            if status == 2:
                raise OSError("the other one has it")
            if status:
                raise ValueError(f"import: status {status}")
            bus, device = struct.unpack(">II", self.exactly(sock, 312)[288:296])
            self.sequence, self.device = 0, bus << 16 | device
            status, text = self.submit(sock, 0, True, 4096, bytes.fromhex("8006000200000010"))
            interface, number = None, None
            while len(text) > 1 and text[0] > 1:
                if text[1] == 4:
                    interface = text[2] if text[5:8] == b"\xff\x53\x48" else None
                if text[1] == 5 and interface is not None and text[2] & 0x80 and text[3] & 3 == 2:
                    number = interface, text[2] & 15
                text = text[text[0]:]
            if number is None:
                self.wrong.append("no vendor interface in the descriptors")
                return False
            self.submit(sock, 0, False, 0, bytes.fromhex("0009010000000000"))
            self.submit(sock, 0, False, 0, struct.pack("<BBHHH", 0x41, 0x22, 1, number[0], 0))
            until_s, n = time.monotonic() + self.rng.uniform(0.2, 3), 0
            while time.monotonic() < until_s and not self.stop.is_set():
                status, data = self.submit(sock, number[1], True, CHUNK)
                n += len(data)
            if self.rng.random() < 0.5:
                self.reset(sock)
            return n > 0


class Redir(Client):
    """A virtual machine's usbredir socket. It says hello, or sends bytes that mean nothing."""

    def visit(self):
        with self.connect() as sock:
            is_noise = self.rng.random() < 0.5
            if is_noise:
                sock.sendall(self.rng.randbytes(self.rng.randrange(1, 5000)))
            else:
                sock.sendall(struct.pack("<III", 0, 68, 0) + b"soak".ljust(64, b"\0") + struct.pack("<I", 0))
            return self.drink(sock.fileno(), self.rng.uniform(0.1, 1)) > 0 and not is_noise


class Scip(Client):
    """A client of a Hokuyo. It sends QT, VV and BM, then asks for scans by GD and checks their sums."""

    def visit(self):
        with self.connect() as sock:
            sock.sendall(b"QT\nVV\nBM\n")
            self.until(sock, b"BM\n", 1 << 16)
            scans = 0
            for _ in range(self.rng.randrange(1, 40)):
                sock.sendall(b"GD0000108001\n")
                text = b""
                while b"GD" not in text or not text.endswith(b"\n\n"):  # replies to others may come before
                    text += self.until(sock, b"\n\n", 1 << 16)
                for line in text[text.find(b"GD"):].split(b"\n")[1:-2]:
                    if len(line) > 1 and line[-1] != (sum(line[:-1]) & 0x3f) + 0x30:
                        self.wrong.append(f"sum of {line[:70]!r}")
                scans += 1
            return scans > 0


class Cola(Client):
    """A client of a SICK. It asks for the identity and for telegrams as they come, and sometimes sends noise at the end."""

    def visit(self):
        with self.connect() as sock:
            sock.sendall(b"\x02sRN DeviceIdent\x03\x02sEN LMDscandata 1\x03")
            data, until_s = b"", time.monotonic() + self.rng.uniform(0.5, 3)
            while time.monotonic() < until_s and not self.stop.is_set():
                data += self.until(sock, b"\x03")
            if self.rng.random() < 0.3:
                sock.sendall(self.rng.randbytes(100) + b"\x02sMN x" + b"y" * 10000)
            for telegram in data.split(b"\x03")[:-1]:
                if not telegram.startswith(b"\x02s"):
                    self.wrong.append(f"no telegram: {telegram[:70]!r}")
            return b"LMDscandata" in data


class Datagrams(Client):
    """Takes a VLP-16's data packets. Each must have its size and its twelve blocks."""

    size = 1206

    def is_whole(self, packet):
        return all(packet[100 * i:100 * i + 2] == b"\xff\xee" for i in range(12))

    def visit(self):
        port = int(self.endpoint.rsplit(":", 1)[1])
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.bind(("127.0.0.1", port))
            until_s, n = time.monotonic() + 3, 0
            while time.monotonic() < until_s and not self.stop.is_set():
                if not select.select([sock], [], [], 1)[0]:
                    continue
                packet = sock.recv(2048)
                n += 1
                if len(packet) != self.size or not self.is_whole(packet):
                    self.wrong.append(f"no such packet: {packet[:40]!r}")
            self.bytes += self.size * n
            return n > 0


class Positions(Datagrams):
    """Takes a VLP-16's position packets. Each must have a GPS sentence."""

    size = 512

    def is_whole(self, packet):
        return packet[206:212] == b"$GPRMC"


class Http(Client):
    """Asks a VLP-16 for its pages, sets a value that is set already, or asks for a page that is not there."""

    REQUESTS = [(b"GET /cgi/status.json", b"", b"200"), (b"GET /cgi/info.json", b"", b"200"), (b"GET /nothing", b"", b"404"),
                (b"POST /cgi/setting", b"rpm=600", b"200 409")]  # 409 means that another client has control

    def visit(self):
        with self.connect() as sock:
            request, body, codes = self.rng.choice(self.REQUESTS)
            sock.sendall(request + b" HTTP/1.1\r\nHost: soak\r\nConnection: close\r\nContent-Length: %d\r\n\r\n" % len(body) + body)
            answer = self.until(sock, b"\r\n").split(b" ")
            is_right = len(answer) > 1 and answer[1] in codes.split()
            if not is_right:
                self.wrong.append(f"{request.decode()}: {answer!r}"[:100])
            return is_right
