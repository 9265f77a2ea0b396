#!/bin/bash
# SPDX-License-Identifier: MIT
# This is the short form of fuzzing, for `make test`. Each target runs its seeds and the inputs that were found before,
# then new inputs made of them for some seconds. The script prints TAP, one test a target.
#
#   FUZZ_BUILD=build/fuzz sh tests/fuzz/fuzz_short.sh [NAME...]      without names: all targets
#
# FUZZ_SHORT_S gives the seconds a target, 1 by default. The seed of the random numbers is fixed, but the machine
# decides how many inputs are tried. JOBS targets run at a time.
set -u
build=${FUZZ_BUILD:-build/fuzz}
seconds=${FUZZ_SHORT_S:-1}
jobs=${JOBS:-$(getconf _NPROCESSORS_ONLN)}
work=$(mktemp -d /tmp/scanhead-fuzzing-XXXXXX) || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
[ $# -gt 0 ] || set -- $(ls tests/fuzz/fuzz_*.c | sed 's|.*/fuzz_||; s|\.c$||')
if [ ! -x "$build/tests/fuzz/fuzz_$1" ]; then
    echo "1..0 # SKIP the fuzz targets are not built: make fuzz-programs, which needs clang"
    exit 0
fi
. tests/fuzz/fuzz_one.sh

n=0
for name; do
    while [ "$(jobs -r 2>/dev/null | grep -c .)" -ge "$jobs" ]; do wait -n 2>/dev/null || sleep 0.1; done
    fuzz_one "$name" "$work/$name" -max_total_time="$seconds" -seed=1 &
done
wait
for name; do
    n=$((n + 1))
    if [ "$(cat "$work/$name/status")" = 0 ]; then
        echo "ok $n - $name: $(fuzz_stat "$work/$name" number_of_executed_units) executions"
    else
        echo "not ok $n - $name"
        fuzz_say "$work/$name" | sed 's/^/# /'
    fi
done
echo "1..$n"
