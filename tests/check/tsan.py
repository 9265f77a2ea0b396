# SPDX-License-Identifier: MIT
"""ThreadSanitizer over the built program: python3 tests/check/tsan.py --scanhead PROGRAM --out FOLDER [--short]

Heads run on all kinds of links, with clients that come, go, stall, misbehave and turn knobs. Each round is one head. It fails
if the sanitizer has reported something, if the program does not end with status 0, or if a client never got its answer. This
prints TAP. The reports are in FOLDER/NAME.tsan.*, and tests/check/tsan.supp has the ones of foreign code.
"""
import argparse
import os
import pathlib
import random
import re
import socket
import subprocess
import sys
import threading
import time

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path[:0] = [str(ROOT / "tests/soak"), str(ROOT / "drivers/host/python")]
import clients  # noqa: E402
import scanhead  # noqa: E402
from long import Head  # noqa: E402

PATIENCE_S = 60  # the sanitizer takes ten times the time, and other programs may have the processors
REPLY_S = 2  # after this time a fault has swallowed the reply
SCENE = f"""
scene: {{meshes: [{{file: {ROOT}/config/scenes/glass_room.obj, up: z, scale: 1}}]}}
stations:
  - {{name: room, position_m: [0, 0, 1.6], heading_deg: 30, lat_deg: 48.1, lon_deg: 11.5, height_m: 520}}
time: {{epoch: utc}}
loop: {{queue_ms: 1000, late_ms: 5000, threads: 2}}
"""
LINE_HEAD = "head: {profile: full-sweep, prr_hz: 10000, lines_hz: 40, pan_deg_s: 36, frames: 0, start: on}\n"
NATIVE = """links:
  - {type: tcp, port: 0}
  - {type: pty}
  - {type: web, port: 0}
  - {type: pty, protocol: nmea}
  - {type: usb, port: 0, speed: super}
  - {type: usb, backend: usbredir, port: 0, speed: super}
"""
FAULTS = """faults:
  - {kind: drop, every: 40, link: 1}
  - {kind: flip, every: 50, from: 10, link: 1}
  - {kind: disconnect, every: 400, from: 300, link: 1}
  - {kind: no_reply, every: 9, from: 5, link: 1}
  - {kind: stall, every: 200, for_ms: 20, link: 2}
  - {kind: endpoint_stall, every: 300, from: 100, link: 5}
"""


class Knobs(clients.Client):
    """Takes control, changes settings, starts and stops scans, and gives control back."""

    pause_s = 0.05
    # A command that a head of another kind does not know is an error, which goes its own way through the threads.
    LINES = ["HEAD:PRR 20 KHZ", "HEAD:PRR 5 KHZ", "HEAD:LINes 20", "HEAD:PAN 90", "HEAD:RANGe:MIN 0.5", "HEAD:PRR DEF",
             "SITE:POSE 1, 0.1, 0.2, 1.5, 0, 0, 45", "SITE:POSE? 1", "FAULt:ADD {kind: drop, every: 30}", "FAULt:LIST?",
             "FAULt:INJected?", "FAULt:CLEar ALL", "SYST:ERR?", "HEAD:STATe?", "HELP:SETtings?", "TIME?", "*STB?", "NO:SUCH 1"]

    def visit(self):
        with scanhead.open("tcp:" + re.search(r"([\d.]+:\d+)", self.endpoint).group(1), PATIENCE_S) as head:
            for line in ["SCAN:STOP", *self.rng.sample(self.LINES, 8), "SCAN:STARt", *self.rng.sample(self.LINES, 5), "SYST:CONT:REL"]:
                if self.stop.is_set():
                    break
                try:
                    head.query(line, REPLY_S)
                    self.good += 1  # a refused command was heard, too
                except scanhead.Timeout:
                    pass

    def run(self):
        while not self.stop.is_set():
            self.visits += 1
            try:
                self.visit()
            except (OSError, scanhead.ScanheadError):
                pass  # a fault ends connections, and the next visit is another one
            self.stop.wait(self.pause_s)


def knobs_apart(endpoints, n, stop):
    """Returns Knobs with faults on their own link alone. Other clients would wait for a dropped reply for ever."""
    knobs = Knobs("knobs", endpoints[n], stop, 3)
    knobs.LINES = [line.replace("every: 30", f"every: 30, link: {n + 1}") for line in knobs.LINES]
    return knobs


class Poses(threading.Thread):
    """Sends the poses of a live platform by UDP."""

    def __init__(self, endpoint, stop):
        super().__init__(name="poses", daemon=True)
        self.to, self.stop, self.visits, self.good, self.wrong = endpoint, stop, 0, 1, []

    def run(self):
        host, port = re.search(r"([\d.]+):(\d+)", self.to).groups()
        begun_s = time.monotonic()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            while not self.stop.wait(0.01):
                x = 0.1 * random.random()
                sock.sendto(f"{time.monotonic() - begun_s:.6f} {x:.3f} 0 1.6 0 0 10\n".encode(), (host, int(port)))
                self.visits += 1


class Rounds:
    def __init__(self, args):
        self.program, self.out, self.short, self.only, self.n, self.bad = args.scanhead, args.out, args.short, args.only, 0, 0

    def left_out(self, name):
        return self.only and name not in self.only

    def prepare(self, name):
        """Sets the file that the sanitizer writes to in this round."""
        for old in self.out.glob(f"{name}.tsan.*"):
            old.unlink()
        os.environ["TSAN_OPTIONS"] = f"log_path={self.out}/{name}.tsan exitcode=66 suppressions={HERE}/tsan.supp history_size=4"

    def say(self, name, wrong):
        self.n += 1
        for log in sorted(self.out.glob(f"{name}.tsan.*")):
            text = log.read_text(errors="replace")
            wrong.append(f"{text.count('WARNING: ThreadSanitizer')} reports in {log}")
            wrong += text.splitlines()[:60]
        self.bad += bool(wrong)
        print(f"{'not ok' if wrong else 'ok'} {self.n} - {name}")
        for line in wrong:
            print(f"# {line}")
        sys.stdout.flush()

    def config(self, name, text):
        if isinstance(text, pathlib.Path):
            return text
        path = self.out / f"{name}.yaml"
        path.write_text(text)
        return path

    def serve(self, name, text, who, seconds, options=()):
        """Runs a head with its clients, which who(endpoints, stop) gives. It goes on until each was served, and for `seconds`."""
        if self.left_out(name):
            return
        self.prepare(name)
        stop, wrong = threading.Event(), []
        head = Head(name, self.program, self.config(name, text), self.out, options)
        threads = who(head.endpoints, stop)
        for thread in threads:
            thread.start()
        begun_s = time.monotonic()
        while time.monotonic() < begun_s + PATIENCE_S and head.process.poll() is None:
            if time.monotonic() > begun_s + seconds and all(thread.good > 0 for thread in threads):
                break
            time.sleep(0.05)
        wrong += [f"{t.name}: {line}" for t in threads for line in t.wrong]
        wrong += [f"{t.name}: {t.visits} visits, none of them served" for t in threads if t.good == 0]
        if self.short or random.random() < 0.5:  # the end comes while clients are there
            code = head.end()
            stop.set()
        else:
            stop.set()
            for thread in threads:
                thread.join(PATIENCE_S)
            code = head.end()
        if code != 0:
            wrong += [f"exit status {code}", *(self.out / f"{name}.err").read_text(errors="replace").splitlines()[:20]]
        self.say(name, wrong)

    def run(self, name, *args):
        """Runs a command that ends by itself."""
        if self.left_out(name):
            return
        self.prepare(name)
        with open(self.out / f"{name}.err", "wb") as err:
            code = subprocess.run([self.program, *map(str, args)], stdout=err, stderr=err, timeout=10 * PATIENCE_S).returncode
        self.say(name, [] if code == 0 else [f"exit status {code}", *(self.out / f"{name}.err").read_text(errors="replace").splitlines()[:20]])


def native_clients(endpoints, stop):
    tcp, pty, web, nmea, usbip, redir = endpoints[:6]
    kinds = [(clients.ComesAndGoes, "tcp", tcp), (clients.Misbehaves, "hostile", tcp), (Knobs, "knobs", tcp),
             (clients.Stalls, "stalled", tcp), (clients.Terminal, "pty", pty), (clients.Page, "page", web),
             (clients.Page, "page 2", web), (clients.Nmea, "nmea", nmea), (clients.UsbIp, "usbip", usbip),
             (clients.Redir, "usbredir", redir)]
    made = [kind(name, endpoint, stop, seed) for seed, (kind, name, endpoint) in enumerate(kinds)]
    for client in made:
        if isinstance(client, clients.Stalls):
            client.good = 1  # the head serves it only while nobody else waits
    return made


def free_udp_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return sock.getsockname()[1]


def vlp16():
    return f"""head: {{profile: velodyne-vlp16, lines_hz: 10, start: on, frames: 0}}
{SCENE}links:
  - {{type: udp, protocol: velodyne, address: 127.0.0.1, port: {free_udp_port()}}}
  - {{type: udp, protocol: velodyne-position, address: 127.0.0.1, port: {free_udp_port()}}}
  - {{type: tcp, protocol: velodyne-http, port: 0}}
  - {{type: tcp, port: 0}}
"""


def vlp16_clients(endpoints, stop):
    return [clients.Datagrams("packets", endpoints[0], stop, 1), clients.Http("http", endpoints[2], stop, 2), knobs_apart(endpoints, 3, stop)]


def planar(profile, protocol):
    return f"""head: {{profile: {profile}, start: on, frames: 0}}
{SCENE}links:
  - {{type: tcp, protocol: {protocol}, port: 0}}
  - {{type: pty, protocol: {protocol}}}
  - {{type: tcp, port: 0}}
"""


def planar_clients(kind):
    def who(endpoints, stop):
        return [kind(kind.__name__.lower(), endpoints[0], stop, 1), clients.Misbehaves("hostile", endpoints[0], stop, 2),
                knobs_apart(endpoints, 2, stop)]
    return who


def one_reader(endpoints, stop):
    return [clients.ComesAndGoes("tcp", endpoints[0], stop, 1), Knobs("knobs", endpoints[0], stop, 2)]


class Steps(Knobs):
    """Grants the time that the head runs by."""

    LINES = ["TIME:STEP 20 MS", "TIME?", "HEAD:STATe?", "TIME:STEP 50 MS", "HEAD:PRR 20 KHZ"] * 3


def full(rounds, seconds):
    still = LINE_HEAD + SCENE + NATIVE
    rounds.serve("all-links", still, native_clients, seconds)
    rounds.serve("faults", still + FAULTS, native_clients, seconds)
    rounds.serve("scip", planar("hokuyo-utm-30lx", "scip"), planar_clients(clients.Scip), seconds / 3)
    rounds.serve("cola", planar("sick-tim571", "cola"), planar_clients(clients.Cola), seconds / 3)
    rounds.serve("velodyne", vlp16(), vlp16_clients, seconds / 3)
    for pace, who in (("fast", one_reader), ("step", lambda e, s: [Steps("steps", e[0], s, 1)])):
        rounds.serve(pace, still, who, seconds / 3, ["--pace", pace])
    live = LINE_HEAD + SCENE + "links: [{type: tcp, port: 0}]\nplatform: {kind: live, reach_m: 5}\n"
    rounds.serve("live", live, lambda e, s: [Poses(e[-1], s), *one_reader(e, s)], seconds / 3)
    config = rounds.config("off-line", LINE_HEAD.replace("frames: 0", "frames: 1").replace("36", "360") + SCENE + "links: [{type: tcp, port: 0}]\n")
    files = [word for ending in ("shs", "las", "e57", "ply", "ptx") for word in ("-o", rounds.out / f"scan.{ending}")]
    rounds.run("record", "record", config, *files, "--quiet", "--stats", rounds.out / "record.json")
    rounds.serve("replay", rounds.out / "scan.shs", one_reader, seconds / 3,
                 ["--link", "type: tcp, port: 0", "--link", "type: web, port: 0", "--start", "--loop"])
    rounds.run("report", "report", config, rounds.out / "scan.ply")
    rounds.run("coverage", "coverage", config)
    rounds.run("soak", "soak", rounds.config("soak", still), "--scenario", ROOT / "config/faults/hostile-wire.yaml",
               "--duration", "3", "--quiet")


def main():
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--seconds", type=float, default=15, help="of a round with all links; the others take a third")
    options.add_argument("--scanhead", required=True)
    options.add_argument("--out", type=pathlib.Path, required=True)
    options.add_argument("--short", action="store_true", help="one round")
    options.add_argument("only", nargs="*", metavar="ROUND", help="these rounds alone; those after `record` take what it made")
    args = options.parse_args()
    args.out = args.out.resolve()
    args.out.mkdir(parents=True, exist_ok=True)
    random.seed(1)
    rounds = Rounds(args)
    if args.short:
        rounds.serve("all-links", LINE_HEAD + SCENE + NATIVE + FAULTS, native_clients, 0)
    else:
        full(rounds, args.seconds)
    print(f"1..{rounds.n}")
    return rounds.bad != 0


sys.exit(main())
