#!/usr/bin/env python3
# SPDX-License-Identifier: MIT
"""Mutants by rule: small changes of the product, drawn from a seed, and whether the tests see them.

    run.py [options] BUILD

The environment has LINK, the command that links a program, LIBS, and SHIPPED, the settings for make. LINK_SANITIZED and
SANITIZED are the same with sanitizers, and may be missing.
A mutant is found if a test that reaches its line fails, fails again, and passes without it. A mutant that does not compile is
replaced by another one. A mutant whose object code stays the same is equivalent, and is replaced, too. BUILD/mutants/SEED.json
has all results. The exit status is 0 if at least 90 % are found, 1 for fewer, and 2 for wrong usage or no result.
"""
import argparse
import collections
import concurrent.futures
import itertools
import json
import os
import queue
import re
import shutil
import signal
import sys
import time

import draw
import tree as trees
from build import Build
from reach import Reach

LEAST = 0.9
LIMIT_S, LIMIT_TIMES = 30, 10  # for a test, beside and times its usual time, as only an endless one must reach that
JUDGED = ("found", "survived", "unreached")


def say(text):
    print(text, flush=True)


def shown(mutant):
    old, *new = (re.sub(r"\s*/\*.*?(\*/|$)", "", text).strip() for text in (mutant["old"], *mutant["edits"].values()))
    return f"{mutant['file']}:{mutant['line']} {mutant['operator']}: {old}  ->  {' / '.join(new)}"


class Judge:
    """`sanitized` is None without clang. As `make test` does, it runs unit tests, and its head serves the tests of commands."""

    def __init__(self, reach, shipped, sanitized):
        self.tree, self.reach, self.shipped, self.sanitized, self.passing = shipped.tree, reach, shipped, sanitized, {}
        self.commands, self.ended = trees.tests_of_commands(), []
        self.workers = queue.SimpleQueue()
        for i in range(self.tree.jobs):
            self.workers.put(f"{self.tree.path}/build/worker-{i}")

    def __call__(self, mutant):
        worker, begin = self.workers.get(), time.monotonic()
        try:
            shutil.rmtree(worker, ignore_errors=True)
            os.makedirs(worker)
            os.symlink("../ifc", f"{worker}/ifc")  # a program finds the readers of IFC above its own folder
            mutant["is"], mutant["by"] = self.judge(mutant, worker)
            mutant["took_s"] = round(time.monotonic() - begin, 1)
        finally:
            shutil.rmtree(worker, ignore_errors=True)
            self.tree.remove_strays()
            self.workers.put(worker)
        self.ended.append(mutant)
        return mutant

    def judge(self, mutant, worker):
        """Returns the verdict, and the test that found the mutant, or all tests that reach it."""
        name = mutant["file"]
        lines = draw.Source(f"{self.tree.path}/{name}").lines
        for number, text in mutant["edits"].items():
            lines[int(number) - 1] = text
        os.makedirs(os.path.dirname(f"{worker}/changed/{name}"))
        with open(f"{worker}/changed/{name}", "w", encoding="utf-8") as file:
            file.write("\n".join(lines))
        changed = {}
        for user in sorted(self.shipped.deps.get(name, ())):
            if user.startswith(trees.PRODUCT):
                built = self.shipped.compile(user, worker)
                if built is None:
                    return "broken", []
                if self.shipped.code_of(built) != self.shipped.code_before(user):
                    changed[user] = built
        if not changed:
            return "equivalent", []
        tests = self.reach.tests_of(name, mutant["line"])
        if not tests:
            return "unreached", []
        units, others = ([test for test in tests if test.startswith("unit/") == is_unit] for is_unit in (True, False))
        commands = [test for test in others if test in self.commands]
        rounds = [(self.shipped, units), (self.sanitized, units), (self.shipped, others), (self.sanitized, commands)]  # quick ones first
        for build, some in rounds:
            if build is None or not some:
                continue
            objects = changed if build is self.shipped else {user: build.compile(user, worker) for user in changed}
            if None in objects.values():
                continue
            build.link_library(f"{worker}/{build.name}", objects)
            first = self.first_of_commands if some is commands else self.first_that_fails
            by = first(build, name, worker, objects, some)
            if by is not None:
                return "found", [by]
        return "survived", tests

    def first_that_fails(self, build, name, worker, changed, tests):
        env = build.environment(f"{worker}/{build.name}")
        if trees.MAIN in changed:
            env["SCANHEAD"] = f"{worker}/{build.name}/scanhead"
            build.link_program([changed[trees.MAIN]], env["SCANHEAD"])
        for test in tests:
            program = build.program_with(name, worker, test)
            if program is not None and self.fails(test, (program, env), (build.program(test), build.environment()), f"{worker}/log"):
                return test if build is self.shipped else f"{test}, sanitized"
        return None

    def first_of_commands(self, build, _, worker, changed, tests):
        """The tests are as shipped, and only the head that they start has sanitizers and the mutant, as in tests/check_sanitized.sh."""
        env, without = ({**build.environment(), **self.shipped.environment(), "SCANHEAD": build.link_head(folder, objects)}
                        for folder, objects in ((f"{worker}/{build.name}", changed), (build.work, {})))
        for test in tests:
            program = self.shipped.program(test)
            if self.fails(test, (program, env), (program, without), f"{worker}/log"):
                return f"{test}, sanitized"
        return None

    def fails(self, test, mutated, without, log):
        """Tells whether a test fails because of the mutant: it fails twice, and passes without it. A test that hangs is not run again.
        Both `mutated` and `without` are (program, environment)."""
        limit_s = LIMIT_S + LIMIT_TIMES * self.reach.tests[test]

        def status_of(program, env, log):
            return self.tree.run_test(program, limit_s, log, **env)[0]

        status = status_of(*mutated, log)
        if status == 0 or (status is not None and status_of(*mutated, log) == 0):
            return False
        program, env = without
        key = (program, env.get("SCANHEAD"))
        if key not in self.passing:
            self.passing[key] = status_of(program, env, f"{log}-without") == 0
            if not self.passing[key]:
                say(f"{test} fails without a mutant, too, and judges nothing ({program})")
        return self.passing[key]


def judged(judge, mutants, n):
    """Returns the first n of the draws that count, and those before them that don't, in the order of the draws. One that survives
    takes as long as fifty that are found, so draws after it are judged meanwhile."""
    returned, known, todo, running = 0, 0, collections.deque(), set()
    with concurrent.futures.ThreadPoolExecutor(judge.tree.jobs) as pool:
        try:
            while returned < n:
                more = judge.tree.jobs - len(running) if known < n else 0
                new = [pool.submit(judge, mutant) for mutant in itertools.islice(mutants, more)]
                todo.extend(new)
                running.update(new)
                if not todo:
                    return
                ended, running = concurrent.futures.wait(running, return_when=concurrent.futures.FIRST_COMPLETED)
                known += sum(future.result()["is"] in JUDGED for future in ended)
                while todo and todo[0].done() and returned < n:
                    mutant = todo.popleft().result()
                    returned += mutant["is"] in JUDGED
                    yield mutant
        finally:
            judge.tree.children.end_all()


def report(mutants, seed):
    counts = collections.Counter(mutant["is"] for mutant in mutants)
    total = sum(counts[what] for what in JUDGED)
    if total == 0:
        raise trees.Failed("no mutant that counts")
    for mutant in mutants:
        if mutant["is"] in ("survived", "unreached"):
            say(f"{mutant['is']} {shown(mutant)}\n    reached by {len(mutant['by'])} tests {' '.join(mutant['by'][:8])}{' ...' * (len(mutant['by']) > 8)}")
    say(f"{total} mutants of seed {seed}: {counts['found']} found ({100 * counts['found'] // total} %), {counts['survived']} survived, "
        f"{counts['unreached']} unreached; beside them {counts['equivalent']} equivalent, {counts['broken']} did not compile")
    return 0 if counts["found"] >= LEAST * total else 1


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("-n", type=int, default=200, help="how many, those aside that don't count")
    parser.add_argument("--seed", default="1")
    parser.add_argument("--only", default="", metavar="PATH", help="a file of the product, or a folder")
    parser.add_argument("--list", action="store_true", help="show the draws, and build nothing")
    parser.add_argument("-j", "--jobs", type=int, default=os.cpu_count() or 1)
    parser.add_argument("build")
    return parser.parse_args()


def places(only):
    found = [(name, 1 + i) for name in trees.sources() if not only or name == only or name.startswith(f"{only.rstrip('/')}/")
             for i in range(trees.read(name).count(b"\n"))]
    if not found:
        raise trees.Failed(f"{only or '.'}: no source of {', '.join(trees.PRODUCT)}")
    return found


def builds(tree):
    tests = sorted({source for program in tree.programs() for source in tree.sources_of(program)} | set(tree.common()))
    shipped = Build(tree, "test", os.environ["SHIPPED"], os.environ["LINK"], tests)
    if not os.environ.get("SANITIZED"):
        return shipped, None
    units = [source for source in tests if source.startswith(("tests/unit/", "tests/common/"))]
    return shipped, Build(tree, "asan", os.environ["SANITIZED"], os.environ["LINK_SANITIZED"], units)


def run(asked, mutants):
    tree, done, judge = trees.Tree(asked.build, asked.jobs), [], None
    try:
        shipped, sanitized = builds(tree)
        judge = Judge(Reach(shipped, say), shipped, sanitized)
        for mutant in judged(judge, mutants, asked.n):
            done.append(mutant)
            counted = sum(one["is"] in JUDGED for one in done)
            say(f"[{counted:3}/{asked.n}] {mutant['is']:10} {shown(mutant)}{'  by ' + mutant['by'][0] if mutant['is'] == 'found' else ''}")
        return report(done, asked.seed)
    finally:
        tree.children.end_all()
        if judge is not None:  # a run that is stopped also keeps those that were judged out of turn
            with open(f"{tree.work}/{asked.seed}.json", "w", encoding="utf-8") as file:
                json.dump({"seed": asked.seed, "mutants": done + [mutant for mutant in judge.ended if mutant not in done]}, file, indent=1)


def main():
    asked = arguments()
    if asked.n < 1 or asked.jobs < 1:
        raise trees.Failed("-n and -j: at least 1")
    mutants = draw.draw(places(asked.only), asked.seed)
    if not asked.list:
        signal.signal(signal.SIGTERM, lambda *_: sys.exit(130))
        return run(asked, mutants)
    for mutant in itertools.islice(mutants, asked.n):
        say(shown(mutant))
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except trees.Failed as failed:
        print(failed, file=sys.stderr)
        sys.exit(2)
    except KeyboardInterrupt:
        sys.exit(130)
