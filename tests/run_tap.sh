#!/bin/bash
# Runs test programs that print TAP (cmocka programs, scripts) one after the other and adds up.
#
#   run_tap.sh [-t SECONDS] PROGRAM...        SECONDS per program; default $TAP_LIMIT_S, or 300
#
# One line per program, and the tables of the stability and accuracy programs; of one that fails all it printed but its passed
# tests. The reasons of skips follow, and
# the last line is `N passed, N failed, N skipped`. Exit status 1 when anything failed, 2 for wrong usage.
# What counts as a failure beside `not ok`: fewer results than planned; a status other than 0, a signal or no end
# within the limit, where no failure says so already; and a program without any result.
set -u

limit_s=${TAP_LIMIT_S:-300}
while getopts t: option; do
    case $option in
    t) limit_s=$OPTARG ;;
    *) exit 2 ;;
    esac
done
shift $((OPTIND - 1))
if [ $# -eq 0 ] || ! [[ $limit_s =~ ^[1-9][0-9]*$ ]]; then
    echo "usage: $0 [-t SECONDS] PROGRAM..." >&2
    exit 2
fi

work=$(mktemp -d) || exit 1
running=
# timeout has made a process group of the program and passes the signal on to all of it.
trap '[ -n "$running" ] && kill "$running" 2>/dev/null; rm -rf "$work"' EXIT
trap 'exit 130' INT TERM

# Reads the TAP on standard input; prints `planned passed failed skipped`, and the skips to the file `skips`.
# cmocka 1.1.5 writes a skip as `not ok N # SKIP name`, its reason at most in the comment before, and one plan per
# group; a group whose set-up fails is `not ok 0`. A skipped program is a plan `1..0 # SKIP reason`.
count='
    function skip(reason) { print reason (note == "" ? "" : ": " note) > skips; skipped++ }
    { sub(/\r$/, "") }
    /^1\.\.[0-9]+/ {
        split($1, range, /\.\./); planned += range[2]
        if (range[2] == 0 && match($0, /# *[Ss][Kk][Ii][Pp][A-Za-z]*[: ]*/)) skip(substr($0, RSTART + RLENGTH))
    }
    /^(not )?ok([ \t]|$)/ {
        if (match($0, /# *[Ss][Kk][Ii][Pp][A-Za-z]*[: ]*/)) {
            name = substr($0, 1, RSTART - 1); reason = substr($0, RSTART + RLENGTH)
            sub(/^(not )?ok *[0-9]* *-? */, "", name); sub(/ *$/, "", name)
            skip(name (name == "" || reason == "" ? "" : ": ") reason)
        } else if ($1 == "ok") passed++
        else failed++
    }
    /^Bail out!/ { failed++ }
    { note = ""; if (/^# /) note = substr($0, 3) }
    END { print planned + 0, passed + 0, failed + 0, skipped + 0 }'

total_passed=0 total_failed=0 total_skipped=0
: >"$work/reasons"

run_one() {
    local program=$1 name status start_ms end_ms planned passed failed skipped results missing why=""
    name=$(basename "$program")
    start_ms=$(date +%s%3N)
    # The streams apart: a line of one must not fall into a line of the other.
    case $program in
    */*) ;;
    *) program=./$program ;;
    esac
    CMOCKA_MESSAGE_OUTPUT=TAP timeout -k 5 "$limit_s" "$program" >"$work/out" 2>"$work/err" </dev/null &
    running=$!
    wait "$running" 2>/dev/null # in the background, so that an interrupt needs no wait for the program
    status=$?
    running=
    end_ms=$(date +%s%3N)
    # Who ignores SIGTERM is killed, which timeout tells as 137 and not as 124.
    [ $status -eq 137 ] && [ $((end_ms - start_ms)) -ge $((limit_s * 1000)) ] && status=124
    : >"$work/skips"
    read -r planned passed failed skipped < <(LC_ALL=C awk -v skips="$work/skips" "$count" "$work/out")
    results=$((passed + failed + skipped))
    missing=$((planned - results))
    [ $status -ge 124 ] && why="; $(ending $status)"
    if [ "$missing" -gt 0 ]; then
        failed=$((failed + missing))
        why="$why; $missing of $planned planned tests gave no result"
    elif [ $results -eq 0 ]; then
        failed=1
        why="$why; no test at all"
    fi
    if [ $status -ne 0 ] && { [ "$failed" -eq 0 ] || { [ $status -eq 124 ] && [ "$missing" -le 0 ]; }; }; then
        failed=$((failed + 1))
        [ $status -lt 124 ] && why="$why; $(ending $status)"
    fi
    sed "s|^|$name: |" "$work/skips" >>"$work/reasons"
    total_passed=$((total_passed + passed))
    total_failed=$((total_failed + failed))
    total_skipped=$((total_skipped + skipped))
    printf '%-4s %-32s %4d ok %4d not ok %4d skip  %d.%03d s%s\n' "$([ "$failed" -eq 0 ] && echo ok || echo FAIL)" \
        "$name" "$passed" "$failed" "$skipped" $(((end_ms - start_ms) / 1000)) $(((end_ms - start_ms) % 1000)) "$why"
    if [ "$failed" -eq 0 ]; then
        case $program in # their tables are what they are for
        */stability/* | */accuracy/*) grep -a '^# ' "$work/out" | grep -a -v -E '^# (not )?ok' | sed 's/^# /    /' ;;
        esac
        return
    fi
    grep -a -v -i -E '^ok([[:space:]]|$)|^not ok .*# *skip|^1\.\.[0-9]' "$work/out" | sed 's/^/    /'
    sed 's/^/    /' "$work/err"
}

ending() {
    case $1 in
    124) echo "did not end within $limit_s s" ;;
    126 | 127) echo "could not be run" ;;
    *) [ "$1" -gt 128 ] && echo "killed by signal $(kill -l $(($1 - 128)) 2>/dev/null || echo $(($1 - 128)))" ||
        echo "exit status $1" ;;
    esac
}

for program; do run_one "$program"; done
if [ -s "$work/reasons" ]; then
    echo "skipped:"
    sed 's/^/    /' "$work/reasons"
fi
echo "$total_passed passed, $total_failed failed, $total_skipped skipped"
[ $total_failed -eq 0 ]
