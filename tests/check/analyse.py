# SPDX-License-Identifier: MIT
"""clang-tidy's analyzer and cppcheck over the code: python3 tests/check/analyse.py --out FOLDER [--jobs N] FILE... -- FLAGS...

This prints their findings, except those that tests/check/answered.txt has an answer to. A line there that answers nothing any
more is a finding, too. The counts come last. The exit status is 1 if there was a finding, and 2 if a tool could not be run.
"""
import argparse
import collections
import concurrent.futures
import pathlib
import re
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
ROW = re.compile(r"(\S+?):(\d+): (.*) \[([\w.,-]+)\]$")


def answers(path):
    """Reads lines `CHECK FILE COUNT REASON` into {(check, file): count}. FILE `*` means each file where that check finds something."""
    found = {}
    for number, line in enumerate(path.read_text().splitlines(), 1):
        if not line.strip() or line.startswith("#"):
            continue
        words = line.split(None, 3)
        if len(words) != 4 or not (words[2].isdigit() or words[2] == "*"):
            sys.exit(f"{path}:{number}: allowed is CHECK FILE COUNT REASON")
        found[words[0], words[1]] = words[2]
    return found


def run(command):
    done = subprocess.run(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    rows = [ROW.match(line) for line in done.stdout.splitlines()]
    return done.returncode, done.stdout, [(r[4], r[1], int(r[2]), r[3]) for r in rows if r]


def is_cxx(file):
    return file.endswith(".cpp")


def cppcheck(files, flags, out, jobs, standard, language):
    cache = out / f"cppcheck-{language}"
    cache.mkdir(parents=True, exist_ok=True)
    wanted = [f for f in flags if f.startswith(("-D", "-I"))]
    status, text, rows = run(["cppcheck", "--enable=warning,performance,portability", "--inline-suppr", f"--std={standard}",
                              f"--language={language}", "--library=posix,gnu", f"-j{jobs}", f"--cppcheck-build-dir={cache}", "--quiet", "-D__linux__",
                              "-D__x86_64__", "--template={file}:{line}: {message} [{id}]", *wanted, *files])
    if status != 0:
        sys.exit(f"cppcheck failed: {text[-2000:]}")
    return rows


def tidy(files, flags, out, jobs):
    cache = out / "tidy"
    cache.mkdir(parents=True, exist_ok=True)
    rows, done = [], 0
    def one(file):
        own = [flag.replace("-std=c11", "-std=c++17") for flag in flags] if is_cxx(file) else flags
        return run(["sh", str(HERE / "tidy_one.sh"), file, str(cache), *own])

    with concurrent.futures.ThreadPoolExecutor(jobs) as pool:
        for status, text, found in pool.map(one, files):
            if status != 0 and not found:
                sys.exit(f"clang-tidy failed: {text[-2000:]}")
            rows += found
            done += 1
            if done % 50 == 0 or done == len(files):
                print(f"clang-tidy: {done} of {len(files)} files", flush=True)
    return rows


def main():
    words = sys.argv[1:]
    split = words.index("--") if "--" in words else len(words)
    options = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    options.add_argument("--out", type=pathlib.Path, required=True)
    options.add_argument("--jobs", type=int, default=2)
    options.add_argument("files", nargs="+")
    args, flags = options.parse_args(words[:split]), words[split + 1:]
    known = answers(HERE / "answered.txt")

    print(f"{len(args.files)} files", flush=True)
    cxx, c = [f for f in args.files if is_cxx(f)], [f for f in args.files if not is_cxx(f)]
    rows = set(tidy(args.files, flags, args.out, args.jobs))
    for files, standard, language in ((c, "c11", "c"), (cxx, "c++17", "c++")):
        if files:
            rows |= set(cppcheck(files, flags, args.out, args.jobs, standard, language))
    count = collections.Counter((check, file) for check, file, _, _ in rows)
    wrong = 0
    for check, file, line, text in sorted(rows, key=lambda row: row[1:]):
        if (check, "*") not in known and known.get((check, file)) != str(count[check, file]):
            print(f"{file}:{line}: {text} [{check}]")
            wrong += 1
    for (check, file), n in known.items():
        if file != "*" and file in args.files and count[check, file] == 0:
            print(f"tests/check/answered.txt: {check} {file}: there is no such finding any more; take the line out")
            wrong += 1
    print(f"analysers: {len(args.files)} files, {len(rows)} findings, {len(rows) - wrong} answered, {wrong} not")
    return wrong != 0


sys.exit(main())
