# SPDX-License-Identifier: MIT
# Runs a client that has faults: HOST PORT FILE FAULTS on the command line. The client connects again each time that its
# connection ends, unless its fault is `s`, and ends at SIGTERM with a whole file.
import signal
import socket
import sys
import time


class Over(Exception):
    pass


def end(*_):
    raise Over


def run(host, port, client):
    met = False
    while True:
        if met and "s" in client.faults:
            signal.pause()
        try:
            with socket.create_connection((host, int(port))) as head:
                met = True
                client.follow(head)
        except OSError:
            time.sleep(0.02)


def serve(make_client, title=""):
    host, port, path, faults = sys.argv[1:5]
    signal.signal(signal.SIGTERM, end)
    with open(path, "w") as out:
        out.write(title)
        try:
            run(host, port, make_client(faults, out))
        except Over:
            pass
