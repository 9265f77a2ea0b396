#!/bin/bash
# SPDX-License-Identifier: MIT
# Runs test programs that print TAP (cmocka programs, scripts) and adds up.
#
#   run_tap.sh [-t SECONDS] [-j N] PROGRAM... [-- PROGRAM...]
#
# SECONDS per program; default $TAP_LIMIT_S, or 300; longer by the load, where more want to run than there are processors.
# A test program ends itself then, and says where it was (tests/common/limit.c). A program that goes on for GRACE_S
# more, such as a script, is killed with all that it started. N programs at a time, default 1; a program that begins
# with `+` runs beside these. Programs after `--` begin once all before have ended, one
# after the other.
# Prints one line per program, in the order given, and the tables of those that have some. For one that fails, it
# prints all output but the passed tests. The reasons of skips follow.
# The last line is `N passed, N failed, N skipped`. Exit status 1 when anything failed, 2 for wrong usage.
# These count as failures, too, beside `not ok`: fewer results than planned; a status other than 0, a signal or no end
# within the limit, where no failure says so already; and a program without any result.
set -u

limit_s=${TAP_LIMIT_S:-300} at_a_time=1
while getopts t:j: option; do
    case $option in
    t) limit_s=$OPTARG ;;
    j) at_a_time=$OPTARG ;;
    *) exit 2 ;;
    esac
done
shift $((OPTIND - 1))
if [ $# -eq 0 ] || ! [[ $limit_s =~ ^[1-9][0-9]*$ && $at_a_time =~ ^[1-9][0-9]*$ ]]; then
    echo "usage: $0 [-t SECONDS] [-j N] PROGRAM... [-- PROGRAM...]" >&2
    exit 2
fi

work=$(mktemp -d) || exit 1
GRACE_S=10 TICK_S=5
export TEST_LIMIT_S=$limit_s
processors=$(getconf _NPROCESSORS_ONLN)
declare -A running=() # process: number of its program
declare -A overdue=() # number: its limit, which it has passed
ticker=
# timeout has made a process group of the program, and passes the signal on to the whole group.
trap '[ ${#running[@]} -gt 0 ] && kill "${!running[@]}" 2>/dev/null; [ -z "$ticker" ] || kill "$ticker" 2>/dev/null; rm -rf "$work"' EXIT
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

programs=() started_ms=() ended_ms=() statuses=() reported=0

# start PROGRAM: starts it in the background, so that an interrupt doesn't wait for the program. The program's streams
# go to separate files, as lines of one must not mix with lines of the other.
start() {
    local number=${#programs[@]} program=$1
    programs+=("$program")
    started_ms+=("$(date +%s%3N)")
    case $program in
    */*) ;;
    *) program=./$program ;;
    esac
    CMOCKA_MESSAGE_OUTPUT=TAP timeout 0 "$program" >"$work/$number.out" 2>"$work/$number.err" </dev/null &
    running[$!]=$number
}

# Kills the groups of programs beyond their limit: first with SIGTERM, a tick later with SIGKILL.
end_overdue() {
    local process number now_ms hundredths limit_ms
    now_ms=$(date +%s%3N)
    read -r hundredths _ </proc/loadavg
    hundredths=$((10#${hundredths/./} / processors))
    limit_ms=$((limit_s * 10 * (hundredths > 100 ? hundredths : 100) + GRACE_S * 1000))
    for process in "${!running[@]}"; do
        number=${running[$process]}
        if [ -n "${overdue[$number]:-}" ]; then
            kill -KILL -- "-$process" 2>/dev/null
        elif [ $((now_ms - started_ms[number])) -ge $limit_ms ]; then
            overdue[$number]=yes
            kill -TERM -- "-$process" 2>/dev/null
        fi
    done
}

# Waits until one program has ended. Reports are in order, so it reports programs until one that still runs.
wait_one() {
    local process status number
    while :; do
        if [ -z "$ticker" ]; then
            sleep $TICK_S &
            ticker=$!
        fi
        wait -n -p process "${!running[@]}" "$ticker" 2>/dev/null
        status=$?
        [ "$process" = "$ticker" ] || break
        ticker=
        end_overdue
    done
    number=${running[$process]}
    unset "running[$process]"
    ended_ms[number]=$(date +%s%3N)
    [ -z "${overdue[$number]:-}" ] || status=124
    kill -KILL -- "-$process" 2>/dev/null # kills processes that it has left behind
    statuses[number]=$status
    while [ -n "${statuses[reported]:-}" ]; do
        report $reported
        reported=$((reported + 1))
    done
}

# report NUMBER: reports a program that has ended.
report() {
    local number=$1 program=${programs[$1]} status=${statuses[$1]} name planned passed failed skipped results missing why=""
    local took_ms=$((ended_ms[number] - started_ms[number])) out=$work/$1.out
    name=$(basename "$program")
    : >"$work/skips"
    read -r planned passed failed skipped < <(LC_ALL=C awk -v skips="$work/skips" "$count" "$out")
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
        "$name" "$passed" "$failed" "$skipped" $((took_ms / 1000)) $((took_ms % 1000)) "$why"
    if [ "$failed" -eq 0 ]; then
        case $program in # these programs exist for their tables
        */stability/* | */accuracy/* | */test_models | */test_hostile_files) grep -a '^# ' "$out" | grep -a -v -E '^# (not )?ok' | sed 's/^# /    /' ;;
        esac
    else
        grep -a -v -i -E '^ok([[:space:]]|$)|^not ok .*# *skip|^1\.\.[0-9]' "$out" | sed 's/^/    /'
        sed 's/^/    /' "$work/$number.err"
    fi
    rm -f "$out" "$work/$number.err"
}

ending() {
    case $1 in
    124) echo "did not end within $limit_s s" ;;
    126 | 127) echo "could not be run" ;;
    *) [ "$1" -gt 128 ] && echo "killed by signal $(kill -l $(($1 - 128)) 2>/dev/null || echo $(($1 - 128)))" ||
        echo "exit status $1" ;;
    esac
}

wait_all() {
    while [ ${#running[@]} -gt 0 ]; do wait_one; done
}

beside=0
for program; do
    case $program in
    --)
        wait_all
        at_a_time=1 beside=0
        ;;
    +*)
        beside=$((beside + 1)) # it stays counted once it has ended: one more at a time does no harm
        start "${program#+}"
        ;;
    *)
        [ ${#running[@]} -lt $((at_a_time + beside)) ] || wait_one
        start "$program"
        ;;
    esac
done
wait_all
if [ -s "$work/reasons" ]; then
    echo "skipped:"
    sed 's/^/    /' "$work/reasons"
fi
echo "$total_passed passed, $total_failed failed, $total_skipped skipped"
[ $total_failed -eq 0 ]
