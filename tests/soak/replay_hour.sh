#!/bin/sh
# SPDX-License-Identifier: MIT
# This records an hour of device time at 10 kHz, replays it at pace fast over TCP, and records it again: sh
# tests/soak/replay_hour.sh SECONDS BUILD. Both files must be the same bytes, with the same hash and as many pulses. For
# an hour they have 880 MB each.
set -eu
[ $# -eq 2 ] || { echo "usage: $0 SECONDS BUILD" >&2; exit 2; }
seconds=$1
build=$2
case $seconds in
'' | . | *[!0-9.]* | *.*.*) echo "$seconds: seconds are a number, such as 30 or 0.5" >&2; exit 2 ;;
esac
[ -x "$build/scanhead" ] || { echo "no $build/scanhead: make" >&2; exit 2; }
out=$build/replay_hour
mkdir -p "$out"
rm -f "$out"/*
run=
trap 'if [ -n "$run" ]; then kill "$run" 2>/dev/null; fi; rm -rf "$out"' EXIT
trap 'exit 1' HUP INT TERM

now() {
    date +%s.%N
}
value() { # value FILE KEY: prints the first value of the key in a JSON file.
    sed -n "s/^ *\"$2\": \"*\([^\",]*\)\"*,*$/\1/p" "$1" | head -n 1
}

begin=$(now)
"$build/scanhead" record tests/soak/replay_hour.yaml --duration "$seconds" -o "$out/head.shs" --stats "$out/head.json" --quiet
recorded=$(now)
mkfifo "$out/ready"
"$build/scanhead" run "$out/head.shs" --link 'type: tcp, port: 0' --pace fast --ready-fd 3 --stats "$out/run.json" \
    --quiet 3>"$out/ready" &
run=$!
endpoint=$(sed -n 's/.*"endpoint":"\(tcp:[^"]*\)".*/\1/p' "$out/ready")
"$build/scanhead" record "$endpoint" -o "$out/replay.shs" --stats "$out/replay.json" --quiet
replayed=$(now)
kill "$run"
wait "$run"
run=

size=$(wc -c <"$out/head.shs")
hash=$(value "$out/head.json" stream_sha256)
pulses=$(value "$out/head.json" pulses)
awk -v device="$seconds" -v begin="$begin" -v recorded="$recorded" -v replayed="$replayed" -v size="$size" \
    -v pulses="$pulses" 'BEGIN {
        printf "%d pulses, %.1f MB\n", pulses, size / 1e6
        printf "recorded in %.1f s, %.0f times as fast as the head\n", recorded - begin, device / (recorded - begin)
        printf "replayed and recorded again in %.1f s, %.0f times, %.0f MB/s\n", replayed - recorded,
               device / (replayed - recorded), size / 1e6 / (replayed - recorded)
    }'
status=0
for file in run replay; do
    for key in stream_sha256 pulses; do
        if [ "$(value "$out/$file.json" $key)" != "$(value "$out/head.json" $key)" ]; then
            echo "$file: $key is $(value "$out/$file.json" $key), of the head $(value "$out/head.json" $key)"
            status=1
        fi
    done
done
cmp "$out/head.shs" "$out/replay.shs" || status=1
[ $status != 0 ] || echo "the same bytes, $hash"
exit $status
