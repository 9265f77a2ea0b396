#!/bin/bash
# SPDX-License-Identifier: MIT
# This measures size, memory and start of a head for a board: bash tests/bench/board.sh FOLDER PROGRAM...
#   MiB          the program's file without symbols for debuggers; its libraries come on top
#   idle MiB     memory of a head that waits for a client: all of it, and what is its own (anonymous)
#   start s      processor time from the start until its links are open, of all its threads
# Each is the median of five heads, with the programs in turns. The head scans a room of a dozen triangles.
set -eu
folder=$1
shift
turns=5
mkdir -p "$folder"
cat >"$folder/head.yaml" <<END
head: {profile: $PWD/config/heads/any-rate.yaml, prr_hz: 300000, lines_hz: 100, pan_deg_s: 50}
scene: {meshes: [{file: $PWD/config/scenes/glass_room.obj, up: z, scale: 1}]}
stations: [{position_m: [0, 0, 1.5]}]
links: [{type: tcp, port: 0}]
END

# one PROGRAM: starts a head, waits until its links are open, and ends it. Prints "RSS OWN NANOSECONDS".
one() {
    local ready pid line
    exec {ready}< <("$1" run "$folder/head.yaml" --quiet --ready-fd 9 9>&1 >/dev/null 2>"$folder/said" & echo $! && wait)
    read -r -t 60 pid <&"$ready" && read -r -t 60 line <&"$ready" && [[ $line == *endpoint* ]] ||
        { cat "$folder/said" >&2; return 1; }
    awk '/^VmRSS:/ { all = $2 } /^RssAnon:/ { own = $2 } END { printf "%d %d ", all, own }' "/proc/$pid/status"
    awk '{ n += $1 } END { printf "%.0f\n", n }' "/proc/$pid/task/"*/schedstat
    kill "$pid"
    exec {ready}<&-
}

for turn in $(seq $turns); do
    for program; do one "$program" >>"$folder/${program##*/}.turns.$$"; done
done
median() { # FILE COLUMN
    sort -n -k "$2,$2" "$1" | awk -v at=$(((turns + 1) / 2)) -v column="$2" 'NR == at { print $column }'
}
printf '%-10s %6s %9s %8s %8s\n' program MiB 'idle MiB' own 'start s'
for program; do
    of=$folder/${program##*/}.turns.$$
    strip -o "$folder/stripped" "$program"
    awk -v name="${program##*/}" -v bytes="$(stat -c %s "$folder/stripped")" -v all="$(median "$of" 1)" -v own="$(median "$of" 2)" \
        -v ns="$(median "$of" 3)" 'BEGIN { printf "%-10s %6.1f %9.1f %8.1f %8.2f\n", name, bytes / 1048576, all / 1024, own / 1024, ns / 1e9 }'
    rm "$of"
done
