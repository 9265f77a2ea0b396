#!/bin/bash
# SPDX-License-Identifier: MIT
# The page's decoder in node: samples, damage, and recordings of the built program beside the client in Python.
# tests/unit/page_native.mjs says what is compared.
set -eu
cd "$(dirname "$0")/.."
head=${SCANHEAD:-build/scanhead}
for need in node python3; do
    command -v "$need" >/dev/null || { echo "1..0 # SKIP $need is missing"; exit 0; }
done
node=$(node -p 'process.versions.node.split(".")[0]')
[ "$node" -ge 18 ] || { echo "1..0 # SKIP node $node is too old: 18 or later"; exit 0; }
[ -x "$head" ] || { echo "1..0 # SKIP $head is not built"; exit 0; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT

cat >"$work/ride.csv" <<'END'
t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg
0,0.1,-0.5,0,0,0,10
0.05,0.3,-0.4,0,4,0,40
0.1,0.4,-0.2,0.1,4,-5,80
0.15,0.2,0,0.1,0,-3,60
0.2,0,0.2,0,0,0,10
END
config() { # FILE, HEAD'S KEYS, MORE
    cat >"$work/$1.yaml" <<END
head: {$2}
scene:
  meshes: [{file: $PWD/config/scenes/glass_room.obj, up: z, scale: 1}]
stations: [{position_m: [0.3, 0.2, 1.5], heading_deg: 30}]
links: [{type: tcp, port: 0}]
$3
END
}
record() { # NAME, CONFIG, KEYS
    local name=$1 from=$2 set=()
    shift 2
    for key; do set+=(--set "$key"); done
    "$head" record "$work/$from.yaml" -o "$work/$name.shs" --quiet "${set[@]}" 2>"$work/said" || { cat "$work/said" >&2; exit 1; }
}
sweep='profile: full-sweep, prr_hz: 20000, lines_hz: 50, pan_deg_s: 100, pan_stop_deg: 8, frames: 1'
config still "$sweep" ''
config ride "$sweep" 'platform: {kind: trajectory, file: ride.csv}'
config beams 'profile: velodyne-vlp16, frames: 1' ''
earth="scene.anchor.source=explicit scene.anchor.lat_deg=52.3 scene.anchor.lon_deg=13.1 scene.anchor.height_m=80 scene.anchor.north_deg=17"
record polar still output.attributes=on output.colour=height signal.model=on waveform.send=on waveform.echoes=fraction noise.range=off
record moving ride
record beams beams
record track ride output.layout=geo
# shellcheck disable=SC2086
for crs in ecef utm geodetic; do record $crs still output.layout=geo output.crs=$crs $earth; done
python3 tests/unit/page_points.py "$work"/{polar,moving,beams,track,ecef,utm,geodetic}
python3 tests/unit/page_hurt.py "$work/hurt"
node tests/unit/page_native.mjs "$work"
