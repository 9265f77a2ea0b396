#!/bin/sh
# SPDX-License-Identifier: MIT
# The demo: a head on a virtual serial port scans a house in real time, and a client records it.
#   sh config/demo.sh SCANHEAD OUTDIR
set -eu
scanhead=$1
out=$2
mkdir -p "$out"
# Assimp reads the house where node or the readers of IFC are missing. Assimp names the products that it may get wrong.
reader=auto
if ! command -v node >/dev/null || [ ! -e "$(dirname "$scanhead")/ifc/installed" ]; then
    reader=assimp
    echo "the readers of IFC are not installed: Assimp reads the house" >&2
fi
rm -f "$out/ready" "$out/scan.ply" "$out/scan.ply.part" "$out/map.png" "$out/stats.json"
mkfifo "$out/ready"
link=$(cd "$out" && pwd)/scanhead0

echo "== the head: config/demo.yaml on $link"
"$scanhead" run config/demo.yaml --set "scene.ifc_reader=$reader" --set "links[0].path=$link" --stats "$out/stats.json" --ready-fd 3 3>"$out/ready" &
head=$!
trap 'kill $head 2>/dev/null || true; rm -f "$out/ready"' EXIT
read -r endpoints <"$out/ready" || { echo "the head did not start" >&2; exit 1; }
echo "$endpoints"

echo "== the client: three stations, about 14 s"
"$scanhead" record "tty:$link" --station all -o "$out/scan.ply" --stats "$out/client.json"
kill -TERM $head
wait $head
trap - EXIT
rm -f "$out/ready"

echo "== the map"
"$scanhead" map config/demo.yaml --set "scene.ifc_reader=$reader" -o "$out/map.png" --quiet
echo "== the points against the scene"
"$scanhead" report config/demo.yaml "$out/scan.ply" --set "scene.ifc_reader=$reader" --tolerance-m 0.001

echo "== the head's own account: $out/stats.json"
cat "$out/stats.json"
ours=$(sed -n 's/.*"stream_sha256": "\(.*\)".*/\1/p' "$out/stats.json")
theirs=$(sed -n 's/.*"stream_sha256": "\(.*\)".*/\1/p' "$out/client.json")
[ "$ours" = "$theirs" ] || { echo "client and head disagree on the stream: $theirs, $ours" >&2; exit 1; }
grep -q '"lost_pulses": 0,' "$out/stats.json" || { echo "pulses were lost: this machine can't keep up" >&2; exit 1; }
echo "client and head agree on the stream: $ours"
ls -l "$out/scan.ply" "$out/map.png" "$out/stats.json"
