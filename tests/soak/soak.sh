#!/bin/sh
# SPDX-License-Identifier: MIT
# This runs each scenario of config/faults over each kind of link, for $1 seconds: sh tests/soak/soak.sh SECONDS BUILD.
# Two heads run at a time. Then the script runs the same over usb, one by one, in a guest. A table follows at the end.
# The status is 1 if a verdict is bad.
set -u
[ $# -eq 2 ] || { echo "usage: $0 SECONDS BUILD" >&2; exit 2; }
seconds=$1
build=$2
case $seconds in
'' | . | *[!0-9.]* | *.*.* | 0[0-9]*) echo "$seconds: seconds are a number, such as 30 or 0.5" >&2; exit 2 ;;
esac
[ -x "$build/scanhead" ] || { echo "no $build/scanhead: make" >&2; exit 2; }
out=$build/soak
mkdir -p "$out"
rm -f "$out"/*

# soak SCENARIO CONFIG NAME [--set KEY=VALUE]
soak() {
    scenario=$1 config=$2 name=$3
    shift 3
    timeout $((${seconds%.*} + 120)) "$build/scanhead" soak "$config" --scenario "$scenario" --duration "$seconds" --quiet \
        --json "$out/$name.json" --truth "$out/$name.truth" "$@" >"$out/$name.txt" 2>"$out/$name.err"
    echo $? >"$out/$name.code"
}

for file in config/faults/*.yaml; do
    name=$(basename "$file" .yaml)
    echo "soak: $name, $seconds s"
    # The head of udp.yaml has 16 beams, and nobody can command it. So it leaves out the scenarios that it could not go
    # through.
    if ! grep -q 'mirror_\|power_cycle\|unplug\|cable\|self_test\|ntp_' "$file"; then
        soak "$file" tests/soak/udp.yaml "$name-udp" &
    fi
    head=room
    if grep -q ntp_ "$file"; then head=scanner; fi # the others can't ask a time server
    soak "$file" "tests/soak/$head.yaml" "$name" --set "links.1.path=$out/port"
    wait
done

# The lines "# FILE NAME TEXT" are the guest's sheets.
echo "soak: usb, in a guest"
SCANHEAD=$build/scanhead BUILD=$build sh tests/guest/soak.sh "$seconds" >"$out/guest.log" 2>&1
guest=$?
sed -n 's/^# FILE //p' "$out/guest.log" | while read -r name text; do
    : >>"$out/${name%.*}.err" # this makes the file, which may stay empty
    printf '%s\n' "$text" >>"$out/$name"
done
skipped=$(sed -n 's/^1\.\.0 # SKIP //p' "$out/guest.log")

status=0
printf '\n%-18s %-5s %9s %9s %9s %9s  %s\n' scenario link injected noticed lost accepted verdict
for file in "$out"/*.txt; do
    name=$(basename "$file" .txt)
    verdict=good
    if [ "$(cat "$out/$name.code")" != 0 ]; then
        status=1
        verdict=BAD
        cat "$file" "$out/$name.err"
    fi
    # This prints the rows of faults. The kind may have a blank in it, so the figures are taken by their columns.
    awk -v name="$name" -v verdict="$verdict" '
        /^[0-9]+ / && substr($0, 41, 8) ~ /^ *[0-9]+$/ {
            link = $2
            injected[link] += substr($0, 41, 8); noticed[link] += substr($0, 50, 8)
            lost[link] += substr($0, 59, 8); accepted[link] += substr($0, 68, 8)
        }
        END {
            for (link in injected)
                printf "%-18s %-5s %9d %9d %9d %9d  %s\n", name, link, injected[link], noticed[link], lost[link],
                       accepted[link], verdict
        }' "$file"
done
if [ -n "$skipped" ]; then
    echo "usb was skipped: $skipped"
elif [ $guest != 0 ]; then
    status=1
    echo "usb BAD: the guest did not get to its end; $out/guest.log"
fi
echo "accepted are flips whose checksum was made right, which no reader can see; $out has the sheets"
exit $status
