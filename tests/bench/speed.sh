#!/bin/bash
# SPDX-License-Identifier: MIT
# This prints what a pulse costs on its way to a file or a client, as ratios and beside the aims:
#   bash tests/bench/speed.sh [--turns N] [--rounds N] [--only LIST] BUILD [AVX2_BUILD]
# A turn runs each program for N rounds, first of BUILD, then of AVX2_BUILD. Figures are medians of the rounds of all
# turns, by default 3 times 5. LIST names parts of panorama, decode, live, loop, realtime, with commas between. Panorama,
# decode and loop run on one processor, the last one that this script may use.
set -euo pipefail
turns=3 rounds=5 only=panorama,decode,live,loop,realtime
while [ $# -gt 0 ]; do
    case $1 in
    --turns) turns=$2; shift 2 ;;
    --rounds) rounds=$2; shift 2 ;;
    --only) only=$2; shift 2 ;;
    -*) echo "speed.sh: $1: allowed are --turns N, --rounds N, --only LIST" >&2; exit 2 ;;
    *) break ;;
    esac
done
case $turns:$rounds in
*[!0-9:]* | :* | *: | 0* | *:0*) echo "speed.sh: --turns $turns --rounds $rounds: whole numbers from 1 on are allowed" >&2; exit 2 ;;
esac
[ $# -ge 1 ] || { echo "speed.sh: the folder of a build is missing" >&2; exit 2; }
declare -A folder=([native]=$1 [avx2]=${2:-})
sets=native${2:+ avx2}
here=$(cd "$(dirname "$0")" && pwd)
out=$(mktemp -d /tmp/scanhead-speed-XXXXXX)
trap 'rm -rf "$out"' EXIT
processor=$(taskset -cp $$ | sed 's/.*[-, ]//')

# ---- the loop: the house from its living room at 2.2 MHz, as config/speed.yaml has it; links are the caller's
loop_config() {
    sed -n '/^head:/,/^links:/p' "$here/../../config/speed.yaml"
    echo "$1"
    echo "loop: {queue_ms: 1000, late_ms: 2000}"
}
loop_config '  - {type: "null"}' >"$out/null.yaml"
loop_config "  - {type: pty, path: $out/pty}
  - {type: tcp, port: 0}
  - {type: file, path: $out/stream.shs}" >"$out/links.yaml"

# keep_loop PREFIX: turns what `loop_cost` prints into lines of set, name, value. The order of programs is that of loop_programs.
keep_loop() {
    awk -v prefix="$1" -v sets="$sets" '
        BEGIN { n_sets = split(sets, set, " ") }
        /^ *[0-9.]+ +[0-9.]+ +[0-9.]+ +[0-9.]+ / {
            i = row++; name = int(i / n_sets)
            print set[i % n_sets + 1], prefix name "_ns", $1
            print set[i % n_sets + 1], prefix name "_core", $5
        }'
}

# loop_programs OPTIONS...: sets programs to each OPTIONS with the program of each set.
loop_programs() {
    local options s
    programs=()
    for options; do
        for s in $sets; do
            programs+=("${folder[$s]}/scanhead $options")
        done
    done
}

is_wanted() {
    case ,$only, in *",$1,"*) return 0 ;; esac
    return 1
}

pinned() {
    taskset -c "$processor" "$@"
}

# part NAME COMMAND...: keeps the raw figures of one program of one set.
part() {
    is_wanted "$1" || return 0
    shift
    "$@" | sed "s/^/$set /" >>"$out/figures"
}

turn=1
while [ "$turn" -le "$turns" ]; do
    for set in $sets; do
        bench=${folder[$set]}/tests/bench
        part panorama pinned "$bench/panorama" --set loop.threads=1 --rounds "$rounds" --ending none,.las,.ply,.e57 --raw
        part panorama pinned "$bench/panorama" --set loop.threads=1 --rounds "$rounds" --lines --ending none,.las --raw
        part decode pinned "$bench/decode" --rounds "$rounds" --raw
        part live "$bench/live" --rounds "$rounds" --raw
    done
    cost="pinned ${folder[native]}/tests/bench/loop_cost --rounds $rounds"
    if is_wanted loop; then
        loop_programs "--no-hash --set cast.sight=on" "--no-hash --set cast.sight=off" ""
        $cost --config "$out/null.yaml" "${programs[@]}" | keep_loop fast >>"$out/figures"
    fi
    if is_wanted realtime; then
        loop_programs "--no-hash"
        ${cost#pinned } --seconds 8 --config "$out/null.yaml" --pace realtime "${programs[@]}" | keep_loop null >>"$out/figures"
        loop_programs ""
        ${cost#pinned } --seconds 8 --config "$out/links.yaml" --pace realtime --clients "${programs[@]}" | keep_loop read >>"$out/figures"
    fi
    turn=$((turn + 1))
done

engine=$("${folder[native]}/tests/bench/decode" --rounds 1 | head -n 1)
echo "$(sed -n 's/^model name[^:]*: *//p' /proc/cpuinfo | head -n 1); $engine; $((turns * rounds)) rounds, processor $processor"
awk -f "$here/speed.awk" "$out/figures"
