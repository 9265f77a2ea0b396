# SPDX-License-Identifier: MIT
"""The long soak: python3 tests/soak/long.py --seconds S --scanhead PROGRAM --out FOLDER

One head of 2.2 million pulses a second runs on every kind of link, and one head for each maker whose protocol we speak.
Clients come, go, stall and misbehave, and faults strike. At the end this shows, for each head, that memory and
descriptors are flat, that each due pulse was fired and counted, and that pulses and clock did not drift apart. The status
is 1 if one of these does not hold.
"""
import argparse
import atexit
import json
import os
import pathlib
import shutil
import signal
import subprocess
import sys
import threading
import time

import clients

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parents[1] / "drivers/host/python"))
import scanhead  # noqa: E402

SETTLE = 0.25  # share of the time before memory is looked at, because buffers are then as full as they get
RSS_GROWTH_KIB = 4096  # the arenas of malloc for sessions' threads come and go by so much
PATIENCE_S = 120  # a loaded machine answers late
TICK_NS, PRR_HZ = 1000000, 2200000  # values of long.yaml


class Head:
    """A head's process: its endpoints, and samples of memory, descriptors and threads."""

    def __init__(self, name, program, config, out, options=()):
        self.name, self.samples, self.out = name, [], out
        self.rest = None  # the last sample, when all clients have gone
        self.stats_path = out / f"{name}.json"
        self.stats_path.unlink(missing_ok=True)
        read_fd, write_fd = os.pipe()
        with open(out / f"{name}.err", "wb") as err:
            self.process = subprocess.Popen(
                [program, "run", str(config), "--quiet", "--stats", str(self.stats_path), "--ready-fd", str(write_fd),
                 *options], pass_fds=[write_fd], stderr=err)
        atexit.register(lambda: self.process.poll() is None and self.process.kill())
        os.close(write_fd)
        with os.fdopen(read_fd) as ready:
            line = ready.readline()
        if not line:
            said = (out / f"{name}.err").read_text().strip() or f"{program} ends without a word"
            sys.exit(f"{name}: no head: {said}")
        self.endpoints = [e["endpoint"] for e in json.loads(line)["endpoints"]]

    def sample(self, at_s):
        self.samples.append(self.look(at_s))
        return self.samples[-1]

    def look(self, at_s=0):
        if self.process.poll() is not None:
            sys.exit(f"{self.name}: ended by itself, status {self.process.returncode}: {self.out / self.name}.err")
        status = dict(line.split(":", 1) for line in open(f"/proc/{self.process.pid}/status") if ":" in line)
        return (at_s, int(status["VmRSS"].split()[0]), len(os.listdir(f"/proc/{self.process.pid}/fd")),
                int(status["Threads"]))

    def end(self):
        self.process.send_signal(signal.SIGINT)
        code = self.process.wait(60)
        self.stats = json.loads(self.stats_path.read_text())
        return code


class Clock:
    """This compares device time with the clock of this machine, while the head rests. The answer to TIME? is the time of
    the last tick. So it was right at some moment between a tick before the question and the arrival of the answer. The
    length of that interval bounds the error. Many questions are asked over seconds, in which a head that was held up
    catches up, and the answer that is furthest ahead counts. The class also keeps the times of the scan's events, in device
    time."""

    def __init__(self, endpoint):
        self.endpoint, self.marks, self.scan_ns = endpoint, [], {}

    def mark(self, head):
        best = None
        for _ in range(100):
            time.sleep(0.02)
            before = time.clock_gettime_ns(time.CLOCK_MONOTONIC)
            t_ns = int(head.query("TIME?", PATIENCE_S))
            after = time.clock_gettime_ns(time.CLOCK_MONOTONIC)
            if best is None or t_ns - after > best[0]:
                best = (t_ns - after, after - before + TICK_NS)
        self.marks.append((best[0] + best[1] // 2, best[1]))

    def command(self, line, event, is_before):
        """Sends a command by a client that closes after the event. Frames that it does not read count as left out."""
        with scanhead.open(self.endpoint, PATIENCE_S) as head:
            if is_before:
                while head.query("HEAD:STATe?", PATIENCE_S) == "boot":
                    pass
                self.mark(head)
            head.command(line, PATIENCE_S)
            for frame in head.frames(PATIENCE_S):
                if frame.is_event(event):
                    self.scan_ns[event] = frame.t_ns
                    break
            while not is_before and head.query("HEAD:STATe?", PATIENCE_S) != "idle":
                pass
            if not is_before:
                self.mark(head)

    def ppm(self, seconds):
        (first, width0), (last, width1) = self.marks
        return 1e-3 * (last - first) / seconds, 1e-3 * (width0 + width1) / 2 / seconds


class Sheet:
    """Prints the checks, one a line. `bad` counts those that do not hold."""

    def __init__(self):
        self.bad = 0

    def line(self, holds, what, figure):
        self.bad += not holds
        print(f"{'ok ' if holds else 'BAD'}  {what:46s} {figure}", flush=True)


def flat(sheet, head):
    """Compares memory, by medians of the first and last third after settling, and descriptors and threads at rest."""
    kept = head.samples[int(SETTLE * len(head.samples)):]
    third = max(1, len(kept) // 3)
    middle = [[sorted(s[k] for s in part)[len(part) // 2] for part in (kept[:third], kept[-third:])] for k in (1, 2, 3)]
    (rss0, rss1), (fd0, fd1), (threads0, threads1) = middle
    most = max(s[1] for s in kept)
    sheet.line(rss1 - rss0 <= RSS_GROWTH_KIB, f"{head.name}: memory", f"{rss0} KiB, then {rss1}; most {most}")
    rest = head.rest
    first = head.samples[0]  # before any client came
    sheet.line(rest[2] <= first[2], f"{head.name}: descriptors at rest", f"{first[2]} before, {rest[2]} after; "
               f"in between {fd0}, then {fd1}")
    sheet.line(rest[3] <= first[3], f"{head.name}: threads at rest", f"{first[3]} before, {rest[3]} after; "
               f"in between {threads0}, then {threads1}")


def sums(sheet, head):
    s = head.stats
    sheet.line(s["cast_pulses"] + s["blind_pulses"] == s["fired_pulses"], f"{head.name}: cast + blind = fired",
               f"{s['cast_pulses']} + {s['blind_pulses']} = {s['fired_pulses']}")
    print(f"     {head.name}: {s['lost_pulses']} lost (announced); late: p50 {s['late_p50_us']:.0f} us, most "
          f"{s['late_max_us'] / 1000:.1f} ms")


def wait_gone(head, first, deadline_s=60):
    """Waits until the head has noticed that its clients are gone."""
    until_s = time.monotonic() + deadline_s
    while True:
        head.rest = head.look()
        if head.rest[2] <= first[2] and head.rest[3] <= first[3] or time.monotonic() > until_s:
            return
        time.sleep(0.2)


def start_clients(main, others, stop):
    tcp, pty, web, hurt, nmea, usbip, redir = main.endpoints[:7]
    kinds = [(clients.ComesAndGoes, "tcp", tcp), (clients.Stalls, "stalled", hurt), (clients.Misbehaves, "hostile", hurt),
             (clients.Misbehaves, "hostile 2", tcp), (clients.ComesAndGoes, "hurt", hurt), (clients.Terminal, "pty", pty),
             (clients.Page, "page", web), (clients.Page, "page 2", web), (clients.Nmea, "nmea", nmea),
             (clients.UsbIp, "usbip", usbip), (clients.UsbIp, "usbip 2", usbip), (clients.Redir, "usbredir", redir),
             (clients.Scip, "scip", others["hokuyo"].endpoints[0]), (clients.Misbehaves, "scip hostile", others["hokuyo"].endpoints[0]),
             (clients.Cola, "cola", others["sick"].endpoints[0]), (clients.Misbehaves, "cola hostile", others["sick"].endpoints[0]),
             (clients.Datagrams, "velodyne", others["velodyne"].endpoints[0]),
             (clients.Positions, "velodyne place", others["velodyne"].endpoints[1]),
             (clients.Http, "velodyne http", others["velodyne"].endpoints[2])]
    for name, native in (("hokuyo", 2), ("sick", 2), ("velodyne", 3)):
        kinds.append((clients.ComesAndGoes, f"{name} native", others[name].endpoints[native]))
        kinds.append((clients.Nmea, f"{name} nmea", others[name].endpoints[native + 1]))
        if name != "velodyne":
            kinds.append((clients.Stalls, f"{name} stalled", others[name].endpoints[0]))
    threads = [kind(name, endpoint, stop, seed) for seed, (kind, name, endpoint) in enumerate(kinds)]
    for thread in threads:
        thread.start()
    return threads


def udp_port():
    import socket
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return sock.getsockname()[1]


def seconds_of(text):
    seconds = float(text)
    if not 10 <= seconds <= 1e6:
        raise ValueError
    return seconds


seconds_of.__name__ = "number of seconds (allowed: 10 to 1e6)"


def main():
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--seconds", type=seconds_of, default=600)
    options.add_argument("--scanhead", default="build/scanhead")
    options.add_argument("--out", type=pathlib.Path, default=pathlib.Path("build/soak-long"))
    args = options.parse_args()
    if shutil.which(args.scanhead) is None:
        options.error(f"--scanhead {args.scanhead}: no program; make builds it")
    try:
        args.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        options.error(f"--out {args.out}: {error.strerror}; it is a folder that is there, or can be made")
    sheet, stop = Sheet(), threading.Event()

    main_head = Head("head", args.scanhead, HERE / "long.yaml", args.out, ["--scenario", str(HERE / "long_faults.yaml")])
    others = {}
    for name, sets in (("hokuyo", ["links.0.port=0", f"links.1.path={args.out}/hokuyo0", f"links.3.path={args.out}/hokuyo-gnss0"]),
                       ("sick", ["links.0.port=0", f"links.1.path={args.out}/sick0", f"links.3.path={args.out}/sick-gnss0"]),
                       ("velodyne", [f"links.0.port={udp_port()}", f"links.1.port={udp_port()}", "links.2.port=0",
                                     f"links.4.path={args.out}/velodyne-gnss0"])):
        more = [word for text in sets for word in ("--set", text)]
        others[name] = Head(name, args.scanhead, HERE.parents[1] / f"config/{name}.yaml", args.out, more)
    heads = [main_head, *others.values()]

    for head in heads:
        head.sample(0)
    first = {head.name: head.samples[0] for head in heads}
    (args.out / "record.json").unlink(missing_ok=True)
    recorder = subprocess.Popen([args.scanhead, "record", main_head.endpoints[0], "--listen", "--quiet", "--no-hash",
                                 "--stats", str(args.out / "record.json")], stderr=open(args.out / "record.err", "wb"))
    atexit.register(lambda: recorder.poll() is None and recorder.kill())
    while main_head.look()[2] <= first["head"][2]:  # until the recorder has come
        if recorder.poll() is not None:
            sys.exit(f"no recorder: {(args.out / 'record.err').read_text()}")
        time.sleep(0.1)
    clock = Clock(main_head.endpoints[0])
    began_s = time.monotonic()
    clock.command("SCAN:STARt", scanhead.EV_SCAN_START, True)
    threads = start_clients(main_head, others, stop)
    while (at_s := time.monotonic() - began_s) < args.seconds:
        for head in heads:
            head.sample(at_s)
        if sys.stderr.isatty() or int(at_s) % 60 == 0:
            print(f"\r{at_s:6.0f} s  {main_head.samples[-1][1]} KiB, {main_head.samples[-1][2]} descriptors, "
                  f"{sum(t.visits for t in threads)} visits", end="\r" if sys.stderr.isatty() else "\n", file=sys.stderr)
        time.sleep(1)
    stop.set()
    for thread in threads:
        thread.join(90)
        if thread.is_alive():
            thread.wrong.append("does not end")
    clock.command("SCAN:STOP", scanhead.EV_SCAN_END, False)
    seconds = time.monotonic() - began_s
    recorder.send_signal(signal.SIGINT)
    recorder.wait(PATIENCE_S)
    for head in heads:
        wait_gone(head, first[head.name])
    return report(sheet, args, heads, threads, recorder, clock, seconds)


def report(sheet, args, heads, threads, recorder, clock, seconds):
    main_head = heads[0]
    for head in heads:
        flat(sheet, head)
    for head in heads:
        sheet.line(head.end() == 0, f"{head.name}: ends in good order", "")
        sums(sheet, head)
    record = json.loads((args.out / "record.json").read_text())
    s = main_head.stats
    fired, got = s["fired_pulses"], record["pulses"]  # pulses that the head lost were fired, too
    lost, missing = record["lost_pulses"], record["missing_pulses"]
    sheet.line(missing is not None and got + lost + missing == fired, "recorder: got + lost by head + left out for it = due",
               f"{got} + {lost} + {missing} = {fired}")
    due = (clock.scan_ns[scanhead.EV_SCAN_END] - clock.scan_ns[scanhead.EV_SCAN_START]) * PRR_HZ // 10**9
    tick = TICK_NS * PRR_HZ // 10**9
    sheet.line(abs(fired - due) <= tick, "head: pulses due beside device time, within a tick", f"{fired - due:+d} of {due}")
    ppm, bound = clock.ppm(seconds)
    sheet.line(abs(ppm) <= bound, "head: device time beside the machine's clock", f"{ppm:+.5f} ppm, +- {bound:.5f}")
    for thread in threads:
        sheet.line(thread.good > 0 and not thread.wrong, f"client {thread.name}", f"{thread.visits} visits, {thread.good} "
                   f"good, {thread.turned_away} turned away, {thread.bytes / 1e6:.1f} MB"
                   f"{', ' + thread.wrong[0] if thread.wrong else ''}")
    print(f"{seconds:.0f} s, {fired} pulses, {sheet.bad} bad")
    return sheet.bad != 0


if __name__ == "__main__":
    sys.exit(main())
