#!/bin/bash
# SPDX-License-Identifier: MIT
# The examples of lock-step: a car in a simulator of its own, in C and in Python, with numpy and without. The examples
# check themselves. Prints TAP. $SCANHEAD: the program of the build, with the library beside it.
set -u
program=${SCANHEAD:-build/scanhead}
work=$(mktemp -d) || exit 1
head=
trap '[ -z "$head" ] || kill "$head" 2>/dev/null; rm -rf "$work"' EXIT
. tests/tap.sh
export PYTHONPATH=drivers/host/python

compile() {
    ${CC:-cc} -std=c11 -O2 -Wall -Wextra -Wconversion -Wshadow -Werror -Idrivers/host drivers/host/examples/lockstep.c \
        "$(dirname "$program")/libscanhead.a" -lnettle -lusb-1.0 -lm -o "$work/lockstep"
}

# start SETTING...: a head of the example's configuration; its TCP endpoint is in $source.
start() {
    local ready set=()
    for setting; do set+=(--set "$setting"); done
    [ -e "$work/ready" ] || mkfifo "$work/ready"
    "$program" run config/lockstep.yaml --quiet --set links[0].path="$work/tty" "${set[@]}" --ready-fd 9 9>"$work/ready" &
    head=$!
    read -r ready <"$work/ready" || return
    source=$(sed 's/.*"\(tcp:[^"]*\)".*/\1/' <<<"$ready")
}

stop() {
    kill "$head"
    wait "$head"
    head=
}

# wrong SAYS COMMAND...: it must fail, and say that.
wrong() {
    local says=$1
    shift
    "$@" && return 1
    grep -q "$says" "$work/out"
}

python() {
    timeout 120 python3 -B "$@"
}

check "the example in C is C11 without warnings" compile
start || exit 1
check "C: each pulse comes once and in its step, each point is in its place" timeout 120 "$work/lockstep" "$source" 1000
check "the same over a terminal" timeout 120 "$work/lockstep" "tty:$work/tty" 200
check "Python, too" python drivers/host/examples/lockstep.py "$source" 200
check "Python without site packages, so without numpy" python -S drivers/host/examples/lockstep.py "$source" 100
stop

# The examples' checks can fail: frames that are dropped, a head that is mounted 2 um higher than the simulator thinks.
start faults[0].kind=drop faults[0].from=40 faults[0].every=25 || exit 1
check "C: missing pulses are seen" wrong 'pulses: some are missing' timeout 120 "$work/lockstep" "$source" 200
check "Python: missing pulses are seen" wrong 'pulses: some are missing' python drivers/host/examples/lockstep.py "$source" 100
stop
start 'platform.mount_m=[0, 0.5, 1.800002]' || exit 1
check "C: a wrong place is seen" wrong 'farther than 1 um' timeout 120 "$work/lockstep" "$source" 200
check "Python: a wrong place is seen" wrong 'farther than 1 um' python drivers/host/examples/lockstep.py "$source" 100
stop
echo "1..$tests"
