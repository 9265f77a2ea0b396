# SPDX-License-Identifier: MIT
"""This is the copy of the sources that mutants are tried in, with its processes. The copy itself is never changed."""
import contextlib
import fcntl
import glob
import os
import re
import shutil
import signal
import subprocess
import threading
import time

FOLDERS = ("unit", "accuracy", "stability", "wire")
PRODUCT = ("core", "drivers", "firmware_sim")
PARTS = ("Makefile", "README.md", "LICENSE", ".clang-format", "config", *PRODUCT, "tests")
MAIN = "firmware_sim/main.c"
MOST_MEMORY, MOST_FILE = 8 << 30, 2 << 30  # for one process of a test, because a mutant may ask without end


class Failed(Exception):
    """An error that ends the run, in one line."""


class Children:
    """The running processes. Each has a group of its own, so that it can be ended with all that it started."""

    def __init__(self):
        self.lock, self.groups, self.is_over = threading.Lock(), set(), False

    def run(self, command, limit_s=None, output=subprocess.PIPE, **more):
        """Returns (status, output). The status is None if the process did not end in time."""
        with self.lock:
            if self.is_over:
                raise Failed("interrupted")
            child = subprocess.Popen(["setpriv", "--pdeathsig", "KILL", *command], stdin=subprocess.DEVNULL, stdout=output,
                                     stderr=subprocess.STDOUT, start_new_session=True, errors="replace", text=True, **more)
            self.groups.add(child.pid)
        status, said = None, ""
        try:
            said = child.communicate(timeout=limit_s)[0]
            status = child.returncode
        except subprocess.TimeoutExpired:
            pass
        finally:
            self.kill(child.pid)
            child.wait()
            with self.lock:
                self.groups.discard(child.pid)
        return status, said

    @staticmethod
    def kill(group):
        try:
            os.killpg(group, signal.SIGKILL)
        except ProcessLookupError:
            pass

    def end_all(self):
        with self.lock:
            self.is_over = True
            for group in self.groups:
                self.kill(group)


def read(name):
    with open(name, "rb") as file:
        return file.read()


def files_below(part):
    if os.path.isfile(part):
        yield part
    for folder, _, names in os.walk(part):
        yield from (f"{folder}/{name}" for name in names if not name.endswith(".pyc"))


def sources():
    """Returns the sources of the product, in order."""
    return sorted(name for part in PRODUCT for name in files_below(part) if name.endswith((".c", ".h", ".cpp")))


def tests_of_commands():
    """Returns the tests whose head `make test` also runs with sanitizers. The script has the list."""
    try:
        found = re.search(r"^for name in (.*); do$", read("tests/check_sanitized.sh").decode(), re.M)
    except FileNotFoundError:
        return []
    return [f"wire/test_{name}" for name in found.group(1).split()]


class Tree:
    def __init__(self, build, jobs):
        self.work, self.jobs = os.path.abspath(f"{build}/mutants"), jobs
        self.path, self.children = f"{self.work}/tree", Children()
        self.env = {name: value for name, value in os.environ.items() if not name.startswith(("MAKE", "MFLAGS"))}
        self.env["CCACHE_BASEDIR"], self.env["CCACHE_NOHASHDIR"] = self.path, "1"
        os.makedirs(self.work, exist_ok=True)
        self.held = open(f"{self.work}/lock", "w", encoding="utf-8")
        try:
            fcntl.flock(self.held, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise Failed(f"{self.work} is in use by another run") from None
        self.copy()
        self.link_readers(os.path.abspath(build))
        self.rigs = {}
        for line in self.call(["sh", "tests/rigs.sh"]).splitlines():
            program, rig = line.split(":")
            self.rigs.setdefault(program.removeprefix("tests/"), []).append(rig)

    def copy(self):
        """Writes only files that differ, so that make builds no more than those."""
        wanted = {name for part in PARTS if os.path.exists(part) for name in files_below(part)}
        for part in PARTS:
            for name in files_below(f"{self.path}/{part}"):
                if os.path.relpath(name, self.path) not in wanted:
                    os.remove(name)
        for name in wanted:
            target = f"{self.path}/{name}"
            if not os.path.exists(target) or read(name) != read(target):
                os.makedirs(os.path.dirname(target), exist_ok=True)
                shutil.copy(name, target)

    def link_readers(self, build):
        os.makedirs(f"{self.path}/build", exist_ok=True)
        for folder in ("readers", "ifc"):
            target = f"{self.path}/build/{folder}"
            if not os.path.lexists(target) and os.path.isdir(f"{build}/{folder}"):
                os.symlink(f"{build}/{folder}", target)

    def remove_strays(self):
        """Removes what a test with a mutant has written into the top folder, such as a file named -; other tests would fail by it."""
        for name in set(os.listdir(self.path)) - {part.split("/")[0] for part in PARTS} - {"build"}:
            shutil.rmtree(f"{self.path}/{name}", ignore_errors=True)
            with contextlib.suppress(FileNotFoundError):  # another worker was faster, or it was a folder
                os.remove(f"{self.path}/{name}")

    # ---- what is in it

    def programs(self):
        """Returns FOLDER/test_NAME of all test programs."""
        return [os.path.relpath(name, f"{self.path}/tests")[:-2]
                for folder in FOLDERS for name in sorted(glob.glob(f"{self.path}/tests/{folder}/test_*.c"))]

    def sources_of(self, program):
        return [f"tests/{program}.c", *self.rigs.get(program, [])]

    def common(self):
        return [os.path.relpath(name, self.path) for name in sorted(glob.glob(f"{self.path}/tests/common/*.c"))]

    # ---- running

    def attempt(self, command):
        return self.children.run(command, cwd=self.path, env=self.env)

    def call(self, command):
        """Runs a command and returns its output. A command that fails ends everything."""
        status, said = self.attempt(command)
        if status != 0:
            raise Failed(f"{' '.join(command)[:200]}: {said.strip()[-2000:]}")
        return said

    def make(self, *words):
        return self.call(["make", "--no-print-directory", f"-j{self.jobs}", "DEPS=no", *words])

    def run_test(self, program, limit_s, log, **env):
        """Returns (status, seconds). Status 0 means that the test passed, and None that it did not end in time."""
        data = "unlimited" if "ASAN_OPTIONS" in env else MOST_MEMORY  # a sanitizer maps more than any machine has
        begin = time.monotonic()
        with open(log, "w", encoding="utf-8") as file:
            status, _ = self.children.run(
                ["prlimit", "--core=0", f"--data={data}", f"--fsize={MOST_FILE}:", program], limit_s, file, cwd=self.path,
                env={**self.env, "SCANHEAD": "build/test/scanhead", "READERS": "build/readers", "CMOCKA_MESSAGE_OUTPUT": "TAP",
                     "TEST_LIMIT_S": "0", **env})
        return status, time.monotonic() - begin
