#!/bin/sh
# Each scenario of config/faults over each kind of link, for $1 seconds: sh tests/soak.sh SECONDS BUILD. At the end a
# table. Status 1 when a verdict is bad.
set -u
seconds=$1
build=$2
out=$build/soak
mkdir -p "$out"
rm -f "$out"/*
status=0
for file in config/faults/*.yaml; do
    name=$(basename "$file" .yaml)
    echo "soak: $name, $seconds s"
    timeout $((${seconds%.*} + 120)) "$build/scanhead" soak tests/soak.yaml --scenario "$file" --duration "$seconds" --quiet \
        --set "links.1.path=$out/port" \
        --json "$out/$name.json" --truth "$out/$name.truth" >"$out/$name.txt" 2>"$out/$name.err"
    code=$?
    echo $code >"$out/$name.code"
    [ $code = 0 ] || status=1
    [ $code = 0 ] || cat "$out/$name.txt" "$out/$name.err"
done
printf '\n%-14s %-5s %9s %9s %9s %9s  %s\n' scenario link injected noticed lost accepted verdict
for file in "$out"/*.txt; do
    name=$(basename "$file" .txt)
    verdict=good
    [ "$(cat "$out/$name.code")" = 0 ] || verdict=BAD
    # Of the rows of faults: the kind may have a blank in it, so the figures are taken by their columns.
    awk -v name="$name" -v verdict="$verdict" '
        /^[0-9]+ / && substr($0, 41, 8) ~ /^ *[0-9]+$/ {
            link = $2
            injected[link] += substr($0, 41, 8); noticed[link] += substr($0, 50, 8)
            lost[link] += substr($0, 59, 8); accepted[link] += substr($0, 68, 8)
        }
        END {
            for (link in injected)
                printf "%-14s %-5s %9d %9d %9d %9d  %s\n", name, link, injected[link], noticed[link], lost[link],
                       accepted[link], verdict
        }' "$file"
done
echo "accepted are resealed flips, which no reader can see; $out has the sheets"
exit $status
