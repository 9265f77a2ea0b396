# SPDX-License-Identifier: MIT
"""This finds out which test reaches which line: all tests run once, with clang's marks of coverage in the product.

Each test's lines are kept in BUILD/mutants/lines/ as long as the product and the test's own sources stay as they are.
"""
import concurrent.futures
import glob
import hashlib
import json
import os
import shlex
import shutil

import tree as trees
from build import LIBRARY, Build

LONGEST_S = 900
START_S = 0.02  # to start any test
MARKS = "-fprofile-instr-generate -fcoverage-mapping -fcoverage-compilation-dir=."  # so that a copy of BUILD stays valid
SETTINGS = f"WERROR= CC='ccache clang' CXX='ccache clang++' SAN='{MARKS}' OPT=-O0 CORE_OPT=-O1 CFLAGS='-g1 -w' CXXFLAGS='-g1 -w'"


def hash_of(folder, names):
    total = hashlib.sha256()
    for name in names:
        total.update(name.encode() + b"\0" + trees.read(f"{folder}/{name}") + b"\0")
    return total.hexdigest()


class Reach:
    """`tests` has the seconds of each program, and `sizes` the number of lines that it reaches."""

    def __init__(self, shipped, say):
        self.shipped, self.tree, self.say = shipped, shipped.tree, say
        self.folder, self.tests, self.sizes, self.lines, self.code, self.files = f"{self.tree.work}/lines", {}, {}, {}, set(), {}
        os.makedirs(self.folder, exist_ok=True)
        product = hash_of(self.tree.path, [name for name in sorted(shipped.deps) if name.startswith(trees.PRODUCT)] + self.tree.common())
        keys = {program: product + hash_of(self.tree.path, self.tree.sources_of(program)) for program in self.tree.programs()}
        missing = [program for program in keys if self.known(program, keys[program]) is None]
        if missing:
            self.run(missing, keys)
        for program in keys:
            self.add(program, self.known(program, keys[program]))
        with open(f"{self.folder}/code", encoding="utf-8") as file:
            self.code = {(name, int(line)) for name, line in (place.rsplit(":", 1) for place in file.read().split())}

    def name_of(self, program):
        return f"{self.folder}/{program.replace('/', '-')}.json"

    def known(self, program, key):
        try:
            with open(self.name_of(program), encoding="utf-8") as file:
                found = json.load(file)
            return found if found["key"] == key else None
        except (FileNotFoundError, ValueError, KeyError):
            return None

    def add(self, program, found):
        self.tests[program], self.sizes[program] = found["took_s"], sum(map(len, found["lines"].values()))
        for name, lines in found["lines"].items():
            self.files.setdefault(name, set()).add(program)
            for line in lines:
                self.lines.setdefault((name, line), set()).add(program)

    def tests_of(self, name, line):
        """Returns the tests that reach a line. A test of few lines is likelier to look at this one, so quick tests of few lines come
        first. A line without code of its own, such as one of a table, counts as reached by the tests that reach its file, or its
        folder where the file is all tables. A line of a header counts as reached by those that reach a file with it."""
        if (name, line) in self.code:
            found = self.lines.get((name, line), set())
        else:
            users = [name] if not name.endswith(".h") else [name, *self.shipped.deps.get(name, ())]
            if all(user not in self.files for user in users):
                users = [user for user in self.files if os.path.dirname(user) == os.path.dirname(name)]
            found = set().union(*(self.files.get(user, set()) for user in users))
        return sorted(found, key=lambda test: (START_S + self.tests[test]) * self.sizes[test])

    # ---- the run

    def run(self, missing, keys):
        self.say(f"which test reaches which line: {len(missing)} of {len(keys)} test programs run once")
        lld = " -fuse-ld=lld" if shutil.which("ld.lld") else ""
        at_exit = os.path.join(os.path.dirname(os.path.abspath(__file__)), "exit.c")
        marked = Build(self.tree, "reach", SETTINGS, f"clang -fPIC {MARKS}{lld} {shlex.quote(at_exit)}")
        with concurrent.futures.ThreadPoolExecutor(self.tree.jobs) as pool:
            try:
                for i, (program, status, took_s) in enumerate(pool.map(lambda program: self.run_one(marked, program, keys[program]), missing)):
                    self.say(f"[{i + 1:3}/{len(missing)}] {program} {took_s:.1f} s{'' if status == 0 else ', fails there'}")
            except BaseException:
                self.tree.children.end_all()  # tests that wait for a thread end at once, too
                raise

    def run_one(self, marked, program, key):
        work = f"{self.folder}/{program.replace('/', '-')}"
        shutil.rmtree(work, ignore_errors=True)
        os.makedirs(work)
        status, took_s = self.tree.run_test(self.shipped.program(program), LONGEST_S, f"{work}/log", **marked.environment(),
                                            SCANHEAD=f"{marked.work}/scanhead", LLVM_PROFILE_FILE=f"{work}/%m.profraw")
        found = {"key": key, "took_s": round(took_s, 3), "status": status, "lines": self.lines_of(marked, work)}
        with open(f"{self.name_of(program)}.new", "w", encoding="utf-8") as file:
            json.dump(found, file)
        os.replace(f"{self.name_of(program)}.new", self.name_of(program))
        shutil.rmtree(work)
        return program, status, took_s

    def lines_of(self, marked, work):
        """Returns {FILE: lines that were reached}. The file `code` gets all lines that have code, as FILE:LINE."""
        profiles = glob.glob(f"{work}/*.profraw")
        if not profiles:
            return {}
        merged, library = f"{work}/all.profdata", f"{marked.work}/{LIBRARY}"
        self.tree.call(["llvm-profdata", "merge", "-sparse", "-o", merged, *profiles])
        said = self.tree.call(["llvm-cov", "export", "-format=lcov", f"-instr-profile={merged}", library,
                               f"-object={marked.work}/scanhead"])
        lines, code, name = {}, [], None
        for line in said.splitlines():
            if line.startswith("SF:"):
                name = os.path.relpath(os.path.join(self.tree.path, line[3:]), self.tree.path)
            elif line.startswith("DA:") and name.startswith(trees.PRODUCT):
                number, count = line[3:].split(",")[:2]
                code.append(f"{name}:{number}\n")
                if count != "0":
                    lines.setdefault(name, []).append(int(number))
        if not self.code:
            self.code = set(code)
            with open(f"{self.folder}/code", "w", encoding="utf-8") as file:
                file.writelines(code)
        return lines
