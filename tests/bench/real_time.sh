#!/bin/sh
# SPDX-License-Identifier: MIT
# This measures how late the pacing thread wakes up, beside cyclictest in turns: sh tests/bench/real_time.sh SCANHEAD
# FOLDER. It runs five pairs. Both programs sleep up to absolute times, 1 ms apart, with the same priority. The priority
# is SCHED_FIFO 80 if both may have it, and otherwise none. The script prints a table, the ratio of the medians of p99,
# and a verdict. The status is 1 if the ratio is above 1.5.
#
# RT_S: seconds of a turn (10). RT_PAIRS: pairs (5). RT_SETS: options for the head, as `--set head.prr_hz=1000`.
set -eu
scanhead=$1
out=$2
seconds=${RT_S:-10}
pairs=${RT_PAIRS:-5}
most=1.5
case $seconds:$pairs in
*[!0-9:]* | :* | *: | 0* | *:0*) echo "RT_S=$seconds RT_PAIRS=$pairs: whole numbers from 1 on are allowed" >&2; exit 2 ;;
esac
mkdir -p "$out"
rm -f "$out"/*

if ! command -v cyclictest >/dev/null; then
    echo "bench-rt: no cyclictest: install rt-tests" >&2
    exit 2
fi
# The head falls back to no priority by itself, and says so.
if chrt -f 80 true 2>/dev/null; then
    policy="--policy=fifo -p 80" said="SCHED_FIFO 80"
else
    policy="--policy=other" said="no priority"
fi

# A head scans a room. The head's links have no clients, as only wake-ups and releases count.
cat >"$out/head.yaml" <<END
head: {profile: $PWD/config/heads/any-rate.yaml, prr_hz: 300000, lines_hz: 100, pan_deg_s: 50, frames: 0}
scene: {meshes: [{file: $PWD/config/scenes/glass_room.obj, up: z, scale: 1}]}
stations: [{position_m: [0, 0, 1.5]}]
links: [{type: "null"}]
loop: {ahead_ms: 2} # with this few ticks ahead, casters and the pacing thread are woken at each tick
END

# cyclic NUMBER: runs cyclictest and prints its p50, p99 and largest, in us. cyclictest tunes nothing that the head does
# not (--default-system).
cyclic() {
    # shellcheck disable=SC2086
    timeout $((seconds + 60)) cyclictest --default-system -m -q -t 1 -i 1000 -l $((seconds * 1000)) $policy -h 100000 \
        >"$out/cyclictest$1" 2>"$out/cyclictest$1.err" || { cat "$out/cyclictest$1.err" >&2; exit 1; }
    awk '/^[0-9]+[ \t]+[0-9]+$/ { at[++rows] = $1 + 0; count[rows] = $2; n += $2 }
        /^# Histogram Overflows:/ { over = $4 + 0; n += over }
        /^# Max Latencies:/ { max = $4 + 0 }
        function share(q, i, seen) {
            for (i = 1; i <= rows; i++) { seen += count[i]; if (seen >= q * n) return at[i] }
            return max
        }
        END { if (n == 0) exit 1; printf "%.0f %.0f %.0f\n", share(0.5), share(0.99), max }' "$out/cyclictest$1"
}

# head NUMBER: runs the head and prints p50, p99 and largest of its wake-ups, then of the release of frames, in us.
head() {
    # shellcheck disable=SC2086
    timeout $((seconds + 60)) "$scanhead" run "$out/head.yaml" --start --duration "$seconds" --quiet --no-hash \
        --stats "$out/head$1.json" ${RT_SETS:-} 2>"$out/head$1.err" || { cat "$out/head$1.err" >&2; exit 1; }
    if [ "$said" != "no priority" ] && grep -q SCHED_FIFO "$out/head$1.err"; then
        echo "bench-rt: cyclictest may have SCHED_FIFO and the head may not: no comparison" >&2
        exit 1
    fi
    awk -F '[:,]' '{ gsub(/[ "]/, ""); value[$1] = $2 }
        END { printf "%.0f %.0f %.0f %.0f %.0f %.0f\n", value["wake_p50_us"], value["wake_p99_us"], value["wake_max_us"],
            value["late_p50_us"], value["late_p99_us"], value["late_max_us"] }' "$out/head$1.json"
}

echo "late by us, of $((seconds * 1000)) sleeps of 1 ms a turn, both with $said; $(uname -r), $(nproc) processors"
row='%-5s %16s %5s %6s %16s %5s %6s %16s %5s %6s\n'
# shellcheck disable=SC2059
printf "$row" pair 'cyclictest: p50' p99 max 'wake-up: p50' p99 max 'release: p50' p99 max
pair=1
while [ "$pair" -le "$pairs" ]; do
    # The two take turns at being first.
    if [ $((pair % 2)) = 1 ]; then
        theirs=$(cyclic $pair)
        ours=$(head $pair)
    else
        ours=$(head $pair)
        theirs=$(cyclic $pair)
    fi
    echo "$theirs $ours" >>"$out/pairs"
    # shellcheck disable=SC2059,SC2086
    printf "$row" $pair $theirs $ours
    pair=$((pair + 1))
done

awk -v most="$most" '
    function median(x, n, i, j, t) {
        for (i = 1; i <= n; i++) for (j = i + 1; j <= n; j++) if (x[j] < x[i]) { t = x[i]; x[i] = x[j]; x[j] = t }
        return n % 2 ? x[(n + 1) / 2] : (x[n / 2] + x[n / 2 + 1]) / 2
    }
    { theirs[NR] = $2; ours[NR] = $5; release[NR] = $8 }
    END {
        a = median(theirs, NR); b = median(ours, NR)
        printf "median of p99: cyclictest %g, wake-up %g, release %g us\n", a, b, median(release, NR)
        printf "ratio %.2f, allowed %g: %s\n", b / a, most, b <= most * a ? "ok" : "too late"
        exit b <= most * a ? 0 : 1
    }' "$out/pairs"
