#!/bin/sh
# SPDX-License-Identifier: MIT
# This runs the tests on other machines: sh tests/machines/run.sh BUILD MACHINE... (make machines)
#
# A machine is a script of this folder, MACHINE.sh. The script is given the folder BUILD/machines/MACHINE, which is
# kept, so that its root and its built files make the next run short. The script leaves there
#   tests.txt      what tests/run_tap.sh printed
#   record.txt     what became of the short record, beside that of this machine
#   built.txt      one line: how it was built, and how many warnings that gave; a file that is missing: it was not built
#   skipped.txt    one line: why nothing could be done
# At the end this prints a table of all. The exit status is 1 if anything failed, and 2 for wrong usage.
set -u
here=$(dirname "$0")
[ $# -ge 2 ] || { echo "usage: $0 BUILD MACHINE... (make machines M=...); allowed are trixie, avx, sse, aarch64" >&2; exit 2; }
build=$1
shift
for number in "${LIMIT_S:-300}" "${JOBS:-2}"; do
    case $number in
    0* | *[!0-9]*) echo "LIMIT_S=${LIMIT_S:-} JOBS=${JOBS:-}: whole numbers from 1 on are allowed" >&2; exit 2 ;;
    esac
done
for name; do
    case $name in
    lib | run | emulated | x86 | *[!a-z0-9]*) known= ;;
    *) known=$here/$name.sh ;;
    esac
    [ -n "$known" ] && [ -e "$known" ] || { echo "M=$name: no such machine; allowed are trixie, avx, sse, aarch64" >&2; exit 2; }
done

# row MACHINE: prints its line of the table, and fails if any part of it failed.
row() {
    at=$build/machines/$1
    if [ -e "$at/skipped.txt" ]; then
        printf '%-9s skipped: %s\n' "$1" "$(cat "$at/skipped.txt")"
        return 0
    fi
    built=$(cat "$at/built.txt" 2>/dev/null || echo "not built: see $at/build.txt")
    counts=$(grep '^[0-9]* passed, [0-9]* failed, [0-9]* skipped$' "$at/tests.txt" 2>/dev/null | tail -n 1)
    record=$(cat "$at/record.txt" 2>/dev/null || echo "not made")
    printf '%-9s %s\n          tests: %s\n          record: %s\n' "$1" "$built" "${counts:-not run to the end}" "$record"
    case "$built: $counts: $record" in
    *" 0 warnings: "*" 0 failed, "*": as here"*) return 0 ;;
    esac
    return 1
}

# The settings of the make that called this script must not count in a root.
unset MAKEFLAGS MFLAGS MAKELEVEL MAKEOVERRIDES
for name; do
    at=$build/machines/$name
    mkdir -p "$at" || exit 1
    rm -f "$at/tests.txt" "$at/record.txt" "$at/built.txt" "$at/skipped.txt"
    echo "$name: $(sed -n '3s/^# //p' "$here/$name.sh")"
    sh "$here/$name.sh" "$build" "$at"
    { row "$name"; echo; grep -h '^FAIL' "$at/tests.txt"; sed -n '/^skipped:$/,$p' "$at/tests.txt"; } >"$at.txt" 2>/dev/null
done
status=0
echo
for name; do row "$name" || status=1; done
exit $status
