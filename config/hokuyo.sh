#!/bin/sh
# SPDX-License-Identifier: MIT
# Records scans of the head of hokuyo.yaml with rawlog-grabber, which runs until it has saved some.
#   sh config/hokuyo.sh INI PREFIX        PREFIX: the rawlog_prefix that INI names
# The grabber gives up where an answer takes more than 0.1 s (TCP) or 0.2 s (serial), as on a busy machine, or where the
# head is still booting. Where it has saved nothing in 10 s it is started again, for up to ten minutes.
set -eu
ini=$1
prefix=$2
end_s=$(($(date +%s) + 600))
while [ "$(date +%s)" -lt $end_s ]; do
    rm -f "$prefix"_*.rawlog "$prefix.said"
    # The loop waits until the grabber has saved scans or failed. The grabber takes the pipe's end for a key, and ends.
    for _ in 1 2 3 4 5 6 7 8 9 10; do
        sleep 1
        ! grep -qs 'Saved\|Error in response' "$prefix.said" || break
    done | timeout 40 stdbuf -oL rawlog-grabber "$ini" | tee "$prefix.said"
    ! grep -q Saved "$prefix.said" || exit 0
    echo "no scans were saved; rawlog-grabber is started again" >&2
done
exit 1
