#!/bin/sh
# Records scans of the head of hokuyo.yaml with rawlog-grabber, which runs until it has saved some.
#   sh config/hokuyo.sh INI PREFIX        PREFIX: the rawlog_prefix that INI names
# It gives up where an answer takes more than 0.1 s (TCP) or 0.2 s (serial), as on a busy machine. Then it is started
# again, up to three times, as also where it has saved nothing in 40 s.
set -eu
ini=$1
prefix=$2
for try in 1 2 3; do
    rm -f "$prefix"_*.rawlog "$prefix.said"
    # What it reads is a key that ends it, and comes once it has said how it goes.
    until grep -qs 'Saved\|Error in response' "$prefix.said"; do sleep 2; done |
        timeout 40 stdbuf -oL rawlog-grabber "$ini" | tee "$prefix.said"
    ! grep -q Saved "$prefix.said" || exit 0
    echo "try $try: no scans" >&2
done
exit 1
