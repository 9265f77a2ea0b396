#!/bin/bash
# SPDX-License-Identifier: MIT
# Runs fuzz targets for long, and prints a table of them. `make fuzz` calls it.
#
#   S=600 N=0 JOBS=2 FUZZ_BUILD=build/fuzz bash tests/fuzz/fuzz_run.sh NAME...
#
# S gives seconds a target, and N executions a target, counted over all runs. With both, the first to be reached ends a
# target. JOBS targets run at a time. New inputs stay in $FUZZ_RUNS/NAME/corpus, and the next run goes on from there. An
# input that fails is copied to tests/fuzz/found/NAME and named, and then the exit status is 1.
set -u
build=${FUZZ_BUILD:-build/fuzz}
runs=${FUZZ_RUNS:-$build/runs}
jobs=${JOBS:-$(getconf _NPROCESSORS_ONLN)}
S=${S:-} N=${N:-}
[ -n "$S$N" ] || S=60
for number in "${S:-1}" "${N:-1}" "$jobs"; do
    [[ $number =~ ^[1-9][0-9]*$ ]] || { echo "S=$S N=$N JOBS=$jobs: whole numbers from 1 on are allowed, of seconds, executions, targets" >&2; exit 2; }
done
[ $# -gt 0 ] || { echo "usage: S=SECONDS N=EXECUTIONS $0 NAME..." >&2; exit 2; }
for name; do
    [ -x "$build/tests/fuzz/fuzz_$name" ] || { echo "no $build/tests/fuzz/fuzz_$name: make fuzz F=$name builds it from tests/fuzz/fuzz_$name.c" >&2; exit 2; }
done
. tests/fuzz/fuzz_one.sh
declare -A running=()
# This ends the round of each target, and its program.
stop_all() {
    local round
    for round in "${!running[@]}"; do kill "$round" $(ps -o pid= --ppid "$round") 2>/dev/null; done
}
trap stop_all EXIT
trap 'exit 130' INT TERM

# Rounds go on until S or N is reached. libFuzzer holds all its finds in memory, and a restart gives that memory back.
run_target() {
    local to=$runs/$1 end=$((SECONDS + ${S:-100000000})) left done_now
    mkdir -p "$to"
    [ -f "$to/executions" ] || echo 0 >"$to/executions"
    rm -f "$to/status"
    while :; do
        left=$((end - SECONDS))
        [ $left -gt 0 ] || break
        # Inputs that take longer are tried less often, which gives up to ten times as many executions.
        set -- "$1" "$to" -entropic_scale_per_exec_time=1 -max_total_time=$((left < 3600 ? left : 3600))
        if [ -n "$N" ]; then
            done_now=$((N - $(cat "$to/executions")))
            [ $done_now -gt 0 ] || break
            set -- "$@" -runs="$done_now"
        fi
        fuzz_one "$@"
        done_now=$(fuzz_stat "$to" number_of_executed_units)
        echo $(($(cat "$to/executions") + ${done_now:-0})) >"$to/executions"
        [ "$(cat "$to/status")" = 0 ] || break
    done
}

# edges FOLDER NAME: prints how many edges and functions the corpus covers, of all in the source files that it reaches.
# Each check of the undefined behaviour sanitizer is an edge, too, which sound code never takes.
edges() {
    local dirs="$1/corpus" d
    for d in tests/fuzz/seeds/$2 tests/fuzz/found/$2; do [ ! -d "$d" ] || dirs="$dirs $d"; done
    TMPDIR=$1 "$build/tests/fuzz/fuzz_$2" -runs=0 -print_coverage=1 $dirs 2>&1 | LC_ALL=C awk '
        $1 == "COVERED_FUNC:" || $1 == "UNCOVERED_FUNC:" {
            file = $NF; sub(/:[0-9]+$/, "", file)
            if (file ~ /\/tests\//) next
            for (i = 2; i < NF; i++) if ($i == "edges:") split($(i + 1), n, "/")
            covered[file] += n[1]; all[file] += n[2]; functions[file]++
            if ($1 == "COVERED_FUNC:") hit[file]++
        }
        END {
            for (f in hit) { c += covered[f]; a += all[f]; h += hit[f]; n_f += functions[f] }
            printf "%d/%d %d/%d", c, a, h, n_f
        }'
}

for name; do
    while [ ${#running[@]} -ge "$jobs" ]; do
        wait -n -p ended "${!running[@]}"
        unset "running[$ended]"
    done
    run_target "$name" &
    running[$!]=$name
done
wait
running=()

status=0
printf '%-12s %14s %9s %13s %11s  %s\n' target executions exec/s edges functions found
for name; do
    to=$runs/$name found=none
    if [ -f "$to/status" ] && [ "$(cat "$to/status")" != 0 ]; then
        status=1 found=
        for input in "$to"/crash/*; do
            [ ! -f "$input" ] || { mkdir -p "tests/fuzz/found/$name" && mv "$input" "tests/fuzz/found/$name/" && found="$found tests/fuzz/found/$name/${input##*/}"; }
        done
        found=${found:-see $to/log}
    fi
    read -r covered functions < <(edges "$to" "$name")
    printf '%-12s %14s %9s %13s %11s  %s\n' "$name" "$(cat "$to/executions")" \
        "$(fuzz_stat "$to" average_exec_per_sec)" "${covered:-?}" "${functions:-?}" "$found"
    [ "$found" = none ] || fuzz_say "$to" | sed 's/^/    /'
done
exit $status
