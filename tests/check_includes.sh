#!/bin/bash
# SPDX-License-Identifier: MIT
# The order of the rooms: which folder may use which, by #include and by call; a README in each; C++ in one file; no file
# has the marks of an unfinished merge; few files include a private header.
# Prints TAP.
#
#   check_includes.sh [ROOT [OBJECTS]]      ROOT: default the tree this script is in
#                                           OBJECTS: where make has put the objects; default ROOT/build/test
#
# Two floors: the studio is what people do with scans, the head is everything else. Nothing of the head uses the studio.
studio='^(core/studio/|drivers/record/|firmware_sim/app/studio/|firmware_sim/main[.]c$)'
#
# In core and in firmware_sim a room may use itself and the rooms before it in this list, so that no rooms form a circle.
# Files that lie in core itself are the first room, `core`: errors, lines, vectors, angles, random numbers.
core_order='core texture georef scene import schedule pose surface instrument detect waveform bvh sight footprint cast plan
    studio/picture studio/mesh studio/analysis studio/viewpoint studio/coverage'
firmware_order='base command fault config site device loop replay app app/help app/run app/studio app/studio/record app/studio/report
    app/studio/map app/studio/coverage app/studio/init app/studio/batch app/studio/verdict app/studio/soak app/studio/view app/studio/preview app/studio/watch'
# The folders of core/import are one room, as they and its own files call each other. So is firmware_sim/config.
# Headers in core/ and core/studio/ that belong to a room with another name, as HEADER:ROOM.
core_headers='distance:bvh geoframe:georef locate:georef crs:georef scene_copies:scene scene_objects:scene body:scene embree:bvh
    ifc_site:import geotiff:import ply:import studio/scan_mesh:studio/mesh studio/decimate:studio/mesh studio/cloud:studio/analysis
    studio/cloud_picture:studio/analysis studio/deviation:studio/analysis studio/figures:studio/analysis studio/map:studio/analysis
    studio/view:studio/analysis'
# On the way of a pulse core has no clock, no thread and no other process. Importing and the studio may have them. So may
# these files, which prepare a scene before the first pulse: they measure how long that takes, and share it among threads.
prepares='core/scene/build.c core/bvh/bvh.c core/sight/sight.c'
# Everything in firmware_sim may use core and drivers. core uses nothing else. In drivers all may use core/err.h,
# bytes.h, date.h and monotonic.h, and besides:
#   protocol       itself, core/line.h
#   socket         itself
#   usb            itself, protocol (its data), socket
#   link           itself, usb, socket, protocol's lines of HTTP, core/late.h, core/newfile.h
#   host           itself, protocol, core's headers without a source (vectors, matrices, arithmetic, growing arrays)
#   record         the same, host's public header, core/newfile.h, core/infile.h, core/colour.h, core/decimal.h, core/digits.h, core/direct.h, the studio's rooms mesh and picture
# The arrows that run upward, one a line as FROM TO REASON: room FROM includes header TO, or calls what that header declares.
# There is at most one arrow in core, one in firmware_sim and one in drivers.
upward='
'
#
# A header that only files of its own folder include, and tests, is private. In these folders at most 8 files include one.
divided='core' # an expression: core|drivers/link
#
# By call: nm on the objects. A symbol that one room's object lacks and a higher room's object defines is an arrow upward.
# First the check is tried on trees with one violation each, which it must find.
set -u

# The rules, for includes and for calls.
rules='
    BEGIN {
        n = split(core_order, list, " "); for (i = 1; i <= n; i++) rank["core/" list[i]] = i
        n = split(firmware_order, list, " "); for (i = 1; i <= n; i++) rank["firmware_sim/" list[i]] = i
        n = split(core_headers, list, " "); for (i = 1; i <= n; i++) { split(list[i], pair, ":"); at["core/" pair[1]] = "core/" pair[2] }
        n = split(prepares, list, " "); for (i = 1; i <= n; i++) preparing[list[i]] = 1
        n = split(upward, list, "\n")
        for (i = 1; i <= n; i++) if (split(list[i], word, " ") > 1) exception[word[1], word[2]] = 1
    }
    # The room that a file lies in. A header in core/ or core/studio/ itself belongs to the room that it declares.
    function room(path,   part, n, name, folder) {
        n = split(path, part, "/")
        name = folder = path; sub(/\.[a-z]*$/, "", name); sub(/\/[^\/]*$/, "", folder)
        if (name in at) return at[name]
        if (folder == "core" || folder == "core/studio") return name in rank ? name : folder == "core" ? "core/core" : folder
        if (folder ~ /^core\/import\//) return "core/import"
        if (folder ~ /^firmware_sim\/config\//) return "firmware_sim/config"
        if (folder in rank || n == 2) return n == 2 ? part[1] "/" part[1] : folder
        return part[1] == "drivers" ? part[1] "/" part[2] : folder
    }
    function may_use(from, to,   a, b, top) {
        a = room(from); b = room(to)
        if (to ~ studio && from !~ studio) return 0
        if (a == b) return 1
        if ((a, to) in exception) return 1
        split(a, top, "/")
        if (top[1] == "core") return b in rank && b ~ /^core\// && rank[b] < rank[a]
        if (top[1] == "firmware_sim") {
            if (a == "firmware_sim/firmware_sim") return to ~ /^(core|drivers|firmware_sim)\//
            return b ~ /^(core|drivers)\// || (b in rank && b ~ /^firmware_sim\// && rank[b] < rank[a])
        }
        if (to ~ /^core\/(err|bytes|date|monotonic)\.h$/) return 1
        if (to ~ /^core\/(colour|infile|decimal|digits|direct)\.h$/ || b == "core/studio/mesh" || b == "core/studio/picture") return a == "drivers/record"
        if (to == "core/late.h") return a == "drivers/link"
        if (to == "core/newfile.h") return a == "drivers/record" || a == "drivers/link"
        if (a == "drivers/host" || a == "drivers/record")
            return b == "drivers/protocol" || to ~ /^core\/(vec3|mat3|quat|vecmath|wide|grow)\.h$/ || \
                (a == "drivers/record" && to == "drivers/host/scanhead.h")
        if (a == "drivers/protocol") return to == "core/line.h"
        if (a == "drivers/link") return b == "drivers/usb" || b == "drivers/socket" || to == "drivers/protocol/http_head.h"
        return a == "drivers/usb" && (b == "drivers/protocol" || b == "drivers/socket")
    }'

include_rules='
    FNR == 1 {
        if (FILENAME ~ /^firmware_sim\/[^\/]*$/ && FILENAME != "firmware_sim/main.c") print FILENAME ": only main.c lies here"
        else if (FILENAME !~ /^drivers\/[^\/]+\// && FILENAME != "firmware_sim/main.c" && !(room(FILENAME) in rank))
            print FILENAME ": a room that the order does not name"
    }
    /^[ \t]*#[ \t]*include/ {
        text = $0
        sub(/^[ \t]*#[ \t]*include(_next)?[ \t]*/, "", text)
        mark = substr(text, 1, 1)
        close_at = index(substr(text, 2), mark == "<" ? ">" : "\"")
        to = substr(text, 2, close_at - 1)
        if (mark != "<" && mark != "\"") print FILENAME ":" FNR ": the include of a macro can not be checked: " text
        else if (to ~ /(^|\/)\.\.?\//) print FILENAME ":" FNR ": not from the root of the tree: " to
        else if (mark == "<" && to !~ /^(core|drivers|firmware_sim|tests)\//) next
        else if (mark == "\"" && to !~ /^(core|drivers|firmware_sim|tests)\//)
            print FILENAME ":" FNR ": not from the root of the tree: " to
        else if (!may_use(FILENAME, to)) print FILENAME ":" FNR ": must not include " to
    }'

# Reads the lines of nm -A -P: the symbols that an object lacks, and the object that defines each. The client library is
# called by its public names.
call_rules='
    BEGIN { system_call = "^(clock_.*|gettimeofday|time|nanosleep|usleep|pthread_.*|thrd_.*|fork|vfork|exec.*|posix_spawn.*|wait.*|system|popen|socket.*)$" }
    { path = $1; sub(/\.o(\[.*\])?:$/, "", path) }
    $3 == "U" { needs[path] = needs[path] " " $2; next }
    $3 ~ /^[TDBRCVWi]$/ { home[$2] = path }
    END {
        for (path in needs) {
            n = split(needs[path], symbol, " ")
            for (i = 1; i <= n; i++) {
                if (path ~ /^core\// && room(path) != "core/import" && path !~ studio && !(path in preparing) && symbol[i] ~ system_call)
                    print path ": must not call " symbol[i]
                if (!(symbol[i] in home)) continue
                to = home[symbol[i]]
                sub(/\.(c|cpp)$/, ".h", to)
                if (match(to, /^core\/studio\/(mesh|picture)\//) && path !~ /^core\//) to = substr(to, 1, RLENGTH - 1) ".h"
                if (to ~ /^drivers\/host\// && symbol[i] ~ /^scanhead_/) to = "drivers/host/scanhead.h"
                if (!may_use(path, to)) print path ": must not call " symbol[i] " of " home[symbol[i]]
            }
        }
    }'

run_rules() { # awk's program, then its arguments
    awk -v core_order="$core_order" -v firmware_order="$firmware_order" -v core_headers="$core_headers" -v upward="$upward" \
        -v studio="$studio" -v prepares="$prepares" \
        "$rules $1" "${@:2}"
}

# Prints `FILE:LINE: what is wrong` for each violation below the folder $1.
include_violations() {
    (
        cd "$1" || exit 1
        readarray -t sources < <(find core drivers firmware_sim -name '*.[ch]' -o -name '*.cpp' -o -name '*.inc' 2>/dev/null | LC_ALL=C sort)
        [ ${#sources[@]} -eq 0 ] || run_rules "$include_rules" "${sources[@]}"
        find . \( -name .git -o -name 'build*' -o -name node_modules \) -prune -o -type f \
            \( -name '*.cpp' -o -name '*.cc' -o -name '*.cxx' -o -name '*.c++' -o -name '*.C' -o -name '*.hpp' \
            -o -name '*.hh' -o -name '*.hxx' -o -name '*.H' \) -print |
            sed 's|^\./||; /^core\/georef\/geographiclib_shim\.cpp$/d; s|$|: C++ outside core/georef/geographiclib_shim.cpp|'
    )
}

# The objects below the folder $1 whose sources are below $2.
objects() {
    (cd "$1" && find core drivers firmware_sim -name '*.o' 2>/dev/null) | LC_ALL=C sort |
        while read -r object; do [ ! -e "$2/${object%.o}" ] || echo "$object"; done
}

# Prints `FILE: must not call SYMBOL of FILE` for the objects below the folder $1 of the tree $2.
call_violations() {
    local root
    root=$(cd "$2" && pwd) || return
    (
        cd "$1" || exit 1
        readarray -t found < <(objects . "$root")
        [ ${#found[@]} -eq 0 ] || nm -A -P "${found[@]}" | run_rules "$call_rules" | LC_ALL=C sort
    )
}

# A README says in its first paragraph what belongs into the folder, and what doesn't: two sentences at least, and a word
# like "not" or "only" in them. The folders with inputs of fuzzing, one for each target, are described in
# tests/fuzz/README.md.
readme_violations() {
    (
        cd "$1" || exit 1
        find core drivers firmware_sim tests config -type d ! -path 'tests/fuzz/*/*' 2>/dev/null | LC_ALL=C sort | while read -r folder; do
            [ -n "$(find "$folder" -maxdepth 1 -type f ! -name README.md -print -quit)" ] || continue
            if [ ! -e "$folder/README.md" ]; then
                echo "$folder: no README.md"
                continue
            fi
            awk '/^#/ && text == "" { next } NF == 0 { if (text != "") exit; next } { text = text " " $0 } END { print text }' \
                "$folder/README.md" | awk -v folder="$folder" '
                { sentences = gsub(/[.;:]([ )]|$)/, "&") }
                sentences < 2 || tolower($0) !~ /(^|[^a-z])(not|no|only|nothing|never|elsewhere)([^a-z]|$)|n.t([^a-z]|$)/ {
                    print folder "/README.md: the first paragraph does not say what belongs here and what does not" }'
        done
    )
}

# Prints `FILE:LINE: what is there` for each mark of a merge that was not finished, below the folder $1.
conflict_violations() {
    (
        cd "$1" || exit 1
        grep -r -n -I -E '^(<{7}|>{7}|\|{7})( |$)' --exclude-dir=.git --exclude-dir='build*' --exclude-dir=node_modules . |
            sed 's|^\./||'
    )
}

# Prints `HEADER: how many files include it` for each private header with too many, below the folder $1.
crowd_violations() {
    (
        cd "$1" || exit 1
        grep -r -o -E --include='*.[ch]' --include='*.cpp' '^[[:space:]]*#[[:space:]]*include[[:space:]]*"[^"]*' \
            core drivers firmware_sim tests 2>/dev/null | sed 's|:[^"]*"| |' | awk -v divided="^($divided)/.*/" '
            { folder = $2; sub(/[^\/]*$/, "", folder); includers[$2]++; if ($1 !~ /^tests\// && index($1, folder) != 1) public[$2] = 1 }
            END { for (to in includers) if (to ~ divided && !(to in public) && includers[to] > 8) print to ": " includers[to] " files include it" }'
    )
}

root=${1:-$(dirname "$0")/..}
built=${2:-$root/build/test}
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
n=0 failed=0

report() { # ok? name [diagnostics]
    n=$((n + 1))
    if [ "$1" = 0 ]; then
        echo "ok $n - $2"
    else
        echo "not ok $n - $2"
        [ -n "$3" ] && printf '%s\n' "$3" | sed 's/^/# /'
        failed=1
    fi
}

plant() { # file line...
    mkdir -p "$work/tree/${1%/*}"
    printf '%s\n' "${@:2}" >"$work/tree/$1"
}

clean_tree() {
    rm -rf "$work/tree"
    plant core/scene/load.c '#include "core/scene.h"' '#include <embree3/rtcore.h>' '#include <stdio.h>' '#include "core/err.h"'
    plant core/plan/plan.c '#include "core/plan.h"' '#include "core/cast.h"' '#include "core/geoframe.h"'
    plant core/studio/cloud.h '#include "core/bvh/bvh.h"' '#include "core/distance.h"'
    plant core/import/load.c '#include "core/scene/build.h"' '#include "core/import/gltf/gltf_read.h"'
    plant core/georef/geographiclib_shim.cpp '#include "core/georef/shim.h"' '#include <GeographicLib/UTMUPS.hpp>'
    plant drivers/protocol/native.c '#include "drivers/protocol/native.h"' '#include "core/line.h"' '#include "core/err.h"'
    plant drivers/link/tcp.c '#include "drivers/link/link.h"' '#include "core/err.h"' '#include <sys/socket.h>'
    plant drivers/usb/usb_core.c '#include "drivers/usb/device.h"' '#include "drivers/protocol/native.h"' '#include "drivers/socket/socket.h"'
    plant drivers/record/ply.c '#include "drivers/host/scanhead.h"' '#include "drivers/protocol/native.h"'
    plant drivers/host/open.c '#include "drivers/host/scanhead.h"' '#include "drivers/protocol/native.h"' '#include "core/err.h"'
    plant firmware_sim/main.c '#include "firmware_sim/app/app.h"' '#include "firmware_sim/app/studio/watch/watch.h"'
    plant firmware_sim/app/studio/watch/watch.c '#include "firmware_sim/app/run/page.h"' '#include "core/studio/figures.h"'
    plant firmware_sim/loop/loop.c '#include "firmware_sim/device/device.h"' '#include "core/scene.h"' '#include "drivers/link/link.h"' '#include "drivers/host/scanhead.h"' \
        '/* #include "tests/nothing.h" */' '// #include "../core/err.h"'
    plant build-asan/generated.cpp 'int built;'
}

# The clean tree with one more file must give just this one violation.
expect_violation() { # file line
    local found
    plant "$@"
    found=$(include_violations "$work/tree")
    rm "$work/tree/$1"
    [ "$(printf '%s' "$found" | grep -c '')" = 1 ] && [[ $found == "$1:"* ]]
    report $? "finds $1${2:+ with $2}" "found: ${found:-nothing}"
}

clean_tree
found=$(include_violations "$work/tree")
[ -z "$found" ]
report $? "a clean tree passes" "$found"

expect_violation core/scene/bad.c '#include "drivers/link/link.h"'
expect_violation core/bad.h '#include "firmware_sim/command/head.h"'
expect_violation core/scene/bad.h '  #  include   "drivers/protocol/native.h" /* why */'
expect_violation core/bad.c '#include <drivers/link/link.h>'
expect_violation core/bad.c '#include "../drivers/link/link.h"'
expect_violation core/bad.c '#include "scene.h"'
expect_violation core/bad.c '#include "tests/unit/command_device.h"'
expect_violation core/bad.c '#include HEADER'
expect_violation core/georef/other.cpp 'int other;'
expect_violation drivers/record/bad.h '#include "core/scene.h"'
expect_violation drivers/bad.h 'int bad;'
expect_violation drivers/socket/bad.c '#include "drivers/usb/usb.h"'
expect_violation drivers/usb/bad.c '#include "core/line.h"'
expect_violation drivers/usb/bad.c '#include "core/georef.h"'
expect_violation drivers/usb/bad.c '#include "firmware_sim/command/head.h"'
expect_violation drivers/usb/bad.c '#include "drivers/host/scanhead.h"'
expect_violation drivers/link/bad.c '#include "core/scene.h"'
expect_violation drivers/link/bad.c '#include "drivers/protocol/native.h"'
expect_violation drivers/link/bad.c '#include "drivers/host/scanhead.h"'
expect_violation drivers/link/bad.c '#include "firmware_sim/config/config.h"'
expect_violation drivers/protocol/bad.c '#include "core/scene.h"'
expect_violation drivers/protocol/bad.c '#include "drivers/link/link.h"'
expect_violation drivers/protocol/bad.c '#include "drivers/host/scanhead.h"'
expect_violation drivers/protocol/bad.c '#include "firmware_sim/command/head.h"'
expect_violation drivers/host/bad.c '#include "core/line.h"'
expect_violation drivers/host/bad.c '#include "core/scene.h"'
expect_violation drivers/host/bad.c '#include "drivers/link/link.h"'
expect_violation drivers/host/bad.c '#include "firmware_sim/command/head.h"'
expect_violation core/err.c '#include "core/scene.h"'
expect_violation core/line.h '#include "core/georef.h"'
expect_violation core/scene/bad.c '#include "core/cast/caster.h"'
expect_violation core/georef/bad.h '#include "core/studio/map.h"'
expect_violation core/cast/bad.c '#include "core/plan.h"'
expect_violation core/attic/bad.c 'int bad;'
expect_violation core/studio/bad.h 'int bad;'
expect_violation core/scene/bad.c '#include "core/import/readers.h"'
expect_violation core/plan/bad.c '#include "core/studio/map.h"'
expect_violation core/studio/picture/bad.c '#include "core/studio/mesh.h"'
expect_violation drivers/host/bad.c '#include "core/studio/mesh.h"'
expect_violation drivers/record/bad.c '#include "core/studio/map.h"'
expect_violation drivers/link/bad.c '#include "drivers/record/recorder.h"'
expect_violation drivers/usb/bad.c '#include "drivers/link/link.h"'
expect_violation drivers/record/bad.c '#include "drivers/host/session.h"'
expect_violation drivers/protocol/bad.c '#include "drivers/usb/usb.h"'
expect_violation firmware_sim/base/bad.c '#include "firmware_sim/command/command.h"'
expect_violation firmware_sim/command/bad.c '#include "firmware_sim/config/config.h"'
expect_violation firmware_sim/config/bad.c '#include "firmware_sim/site/site.h"'
expect_violation firmware_sim/site/bad.c '#include "firmware_sim/device/device.h"'
expect_violation firmware_sim/device/bad.c '#include "firmware_sim/loop/loop.h"'
expect_violation firmware_sim/loop/bad.c '#include "firmware_sim/app/app.h"'
expect_violation firmware_sim/app/bad.c '#include "tests/unit/command_device.h"'
expect_violation firmware_sim/loop/bad.c '#include "drivers/record/recorder.h"'
expect_violation firmware_sim/site/bad.c '#include "core/studio/cloud.h"'
expect_violation firmware_sim/app/bad.c '#include "firmware_sim/app/run/run.h"'
expect_violation firmware_sim/app/bad.c '#include "firmware_sim/main.h"'
expect_violation firmware_sim/app/run/bad.c '#include "firmware_sim/app/studio/watch/watch.h"'
expect_violation firmware_sim/app/studio/record/bad.c '#include "firmware_sim/app/studio/map/view.h"'
expect_violation firmware_sim/app/bad.c '#include "firmware_sim/app/studio/watch/watch.h"'
expect_violation firmware_sim/attic/bad.c '#include "core/err.h"'
expect_violation firmware_sim/bad.c '#include "core/err.h"'
expect_violation firmware_sim/app/bad.cpp 'int bad;'
expect_violation tests/accuracy/bad.cc 'int bad;'
expect_violation core/bad.hpp 'int bad;'

# Two objects, the first calling the second: whether that is found.
expect_call() { # violations caller callee [symbol]
    local found symbol=${4:-called}
    rm -rf "$work/tree"
    plant "$2" "void $symbol(void); void calls(void); void calls(void) { $symbol(); }"
    plant "$3" "void $symbol(void); void $symbol(void) {}"
    for source in "$2" "$3"; do
        mkdir -p "$work/tree/built/$(dirname "$source")"
        ${CC:-cc} -c "$work/tree/$source" -o "$work/tree/built/$source.o" || return
    done
    found=$(call_violations "$work/tree/built" "$work/tree")
    [ "$(printf '%s' "$found" | grep -c '')" = "$1" ] && [[ $1 = 0 || $found == "$2:"*"$symbol of $3" ]]
    report $? "$([ "$1" = 0 ] && echo passes || echo finds) a call from $2 to $3" "found: ${found:-nothing}"
}
expect_call 0 core/cast/caster.c core/bvh/cast.c
expect_call 0 firmware_sim/app/run.c firmware_sim/loop/loop.c
expect_call 0 drivers/record/ply.c drivers/host/open.c scanhead_open
expect_call 1 core/scene/load.c core/cast/caster.c
expect_call 1 core/err.c core/scene/load.c
expect_call 1 firmware_sim/site/site.c firmware_sim/device/device.c
expect_call 1 firmware_sim/base/json.c firmware_sim/config/config.c
expect_call 1 drivers/protocol/native.c drivers/link/tcp.c
expect_call 1 drivers/record/ply.c drivers/host/open.c session_open
expect_call 1 core/cast/caster.c firmware_sim/loop/loop.c
expect_call 0 drivers/record/mesh.c core/studio/mesh/file.c
expect_call 0 firmware_sim/main.c firmware_sim/app/studio/map/map.c
expect_call 1 firmware_sim/scanheadd.c firmware_sim/app/studio/map/map.c
expect_call 1 firmware_sim/app/run/run.c firmware_sim/app/studio/watch/watch.c
expect_call 1 firmware_sim/site/plausibility.c core/studio/analysis/distance.c
expect_call 1 firmware_sim/loop/loop.c drivers/record/shs.c

expect_system() { # violations caller symbol
    local found
    rm -rf "$work/tree"
    plant "$2" "void $3(void); void calls(void); void calls(void) { $3(); }"
    mkdir -p "$work/tree/built/$(dirname "$2")"
    ${CC:-cc} -fno-builtin -c "$work/tree/$2" -o "$work/tree/built/$2.o" || return
    found=$(call_violations "$work/tree/built" "$work/tree")
    [ "$(printf '%s' "$found" | grep -c '')" = "$1" ]
    report $? "$([ "$1" = 0 ] && echo passes || echo finds) a call from $2 to $3" "found: ${found:-nothing}"
}
expect_system 1 core/cast/caster.c clock_gettime
expect_system 1 core/bvh/packet.c pthread_create
expect_system 1 core/scene/body.c fork
expect_system 0 core/import/ifc/ifc_apart.c fork
expect_system 0 core/bvh/bvh.c clock_gettime
expect_system 0 core/studio/coverage/look.c pthread_create
expect_system 0 firmware_sim/loop/loop.c clock_gettime

expect_readme() { # violations line...
    local found
    rm -rf "$work/tree"
    plant core/cast/cast.c 'int cast;'
    [ $# -eq 1 ] || plant core/cast/README.md "${@:2}"
    found=$(readme_violations "$work/tree")
    [ "$(printf '%s' "$found" | grep -c '')" = "$1" ]
    report $? "$([ "$1" = 0 ] && echo passes || echo finds) ${2:-no README} ${4:-}" "found: ${found:-nothing}"
}
expect_readme 0 '# cast' '' 'The stages of a pulse in their order. What one stage does alone' 'does not belong here.' '' 'More.'
expect_readme 1
expect_readme 1 '# cast' '' 'The stages of a pulse.'
expect_readme 1 '# cast' '' 'The stages of a pulse. They have an order.' '' 'What does not belong here: all else. It is elsewhere.'

expect_conflict() { # violations line...
    local found
    rm -rf "$work/tree"
    plant core/README.md "${@:2}"
    found=$(conflict_violations "$work/tree")
    [ "$(printf '%s' "$found" | grep -c '')" = "$1" ]
    report $? "$([ "$1" = 0 ] && echo passes || echo finds) the marks of a merge: $1 in $2" "found: ${found:-nothing}"
}
expect_conflict 0 '# A title' '=======' 'a <<<<<<< b' '<<<<<<<<< c'
expect_conflict 2 '<<<<<<< HEAD' 'a' '=======' 'b' '>>>>>>> other'

expect_crowd() { # violations includers [includer]
    local found
    rm -rf "$work/tree"
    for i in $(seq "$2"); do plant "core/cast/part$i.c" '#include "core/cast/inside.h"'; done
    [ $# -eq 2 ] || plant "$3" '#include "core/cast/inside.h"'
    found=$(crowd_violations "$work/tree")
    [ "$(printf '%s' "$found" | grep -c '')" = "$1" ] && [[ $1 = 0 || $found == "core/cast/inside.h:"* ]]
    report $? "$([ "$1" = 0 ] && echo passes || echo finds) a header that $2 files of its folder include${3:+, and $3}" "found: ${found:-nothing}"
}
expect_crowd 0 8
expect_crowd 1 9
expect_crowd 1 8 tests/unit/test_inside.c
expect_crowd 0 9 core/plan/plan.c

upward_of() { printf '%s\n' "$upward" | grep -c "^$1/"; }
for folder in core drivers firmware_sim; do
    [ -n "$(find "$root/$folder" -name '*.[ch]' -print -quit 2>/dev/null)" ]
    report $? "there are sources in $folder" "no .c or .h below $root/$folder"
    [ "$(upward_of $folder)" -le 1 ]
    report $? "at most one arrow runs upward in $folder" "$upward"
    printf '%s\n' "$upward" | sed -n "s|^$folder/|# upward, by name: $folder/|p"
done
needless=$(upward= include_violations "$root" | sed 's|/[^/]*:[0-9]*: must not include | |')
while read -r from to why; do
    [ -z "$from" ] || grep -q -x "$from $to" <<<"$needless"
    report $? "the arrow upward from $from to $to is there and has a reason" "nobody needs it any more"
done < <(sed '/^$/d' <<<"$upward")
found=$(include_violations "$root")
[ -z "$found" ]
report $? "no include breaks the order of the rooms" "$found"
if [ -n "$(objects "$built" "$root" 2>/dev/null | head -n 1)" ]; then
    found=$(call_violations "$built" "$root")
    [ -z "$found" ]
    report $? "no call breaks the order of the rooms" "$found"
else
    n=$((n + 1))
    echo "ok $n - no call breaks the order of the rooms # SKIP no objects in $built: make"
fi
found=$(readme_violations "$root")
[ -z "$found" ]
report $? "each folder has a README that says what belongs into it" "$found"
found=$(conflict_violations "$root")
[ -z "$found" ]
report $? "no file has the marks of a merge" "$found"
[ -z "$(crowd_violations "$root")" ]
report $? "no private header of $divided has more than 8 includers" "$(crowd_violations "$root")"
echo "1..$n"
exit $failed
