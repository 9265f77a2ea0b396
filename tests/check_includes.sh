#!/bin/bash
# The arrows between the folders, checked on every #include; and C++ stays in one file. Prints TAP.
#
#   check_includes.sh [ROOT]      default: the tree this script is in
#
#   firmware_sim -> drivers -> core/line.h, core/err.h        core -> core
#   drivers/host -> drivers/protocol, core/err.h              drivers/link -> drivers/usb -> drivers/protocol, drivers/socket
#
# First the check is tried on a tree with one violation of each kind: what it can't find there, it can't find here.
set -u

# Prints `FILE:LINE: what is wrong` for each violation below the folder $1.
violations() {
    (
        cd "$1" || exit 1
        sources=$(find core drivers firmware_sim -name '*.[ch]' -o -name '*.cpp' -o -name '*.inc' 2>/dev/null)
        [ -n "$sources" ] && printf '%s\n' "$sources" | LC_ALL=C sort | tr '\n' '\0' | xargs -0 awk "$rules"
        find . \( -name .git -o -name 'build*' -o -name node_modules \) -prune -o -type f \
            \( -name '*.cpp' -o -name '*.cc' -o -name '*.cxx' -o -name '*.c++' -o -name '*.C' -o -name '*.hpp' \
            -o -name '*.hh' -o -name '*.hxx' -o -name '*.H' \) -print |
            sed 's|^\./||; /^core\/georef\/geographiclib_shim\.cpp$/d; s|$|: C++ outside core/georef/geographiclib_shim.cpp|'
    )
}

rules='
    function allowed(from, to) {
        if (from ~ /^core\//) return to ~ /^core\//
        if (from ~ /^drivers\/host\//) return to ~ /^drivers\/(protocol|host)\// || to == "core/err.h"
        if (from ~ /^drivers\/record\//)
            return to ~ /^drivers\/(protocol|record)\// || to == "core/err.h" || to == "drivers/host/scanhead.h"
        if (from ~ /^drivers\/protocol\//) return to ~ /^drivers\/protocol\// || to == "core/line.h" || to == "core/err.h"
        if (from ~ /^drivers\/link\//) return to ~ /^drivers\/(link|usb|socket)\// || to == "core/err.h"
        if (from ~ /^drivers\/usb\//) return to ~ /^drivers\/(protocol|usb|socket)\// || to == "core/err.h"
        if (from ~ /^drivers\//) return to ~ /^drivers\/socket\// || to == "core/err.h"
        return to ~ /^(core|drivers|firmware_sim)\//
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
        else if (!allowed(FILENAME, to)) print FILENAME ":" FNR ": must not include " to
    }'

root=${1:-$(dirname "$0")/..}
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
    mkdir -p "$work/tree/$(dirname "$1")"
    printf '%s\n' "${@:2}" >"$work/tree/$1"
}

clean_tree() {
    rm -rf "$work/tree"
    plant core/scene.c '#include "core/scene.h"' '#include <embree3/rtcore.h>' '#include <stdio.h>'
    plant core/georef/geographiclib_shim.cpp '#include "core/georef/shim.h"' '#include <GeographicLib/UTMUPS.hpp>'
    plant drivers/protocol/native.c '#include "drivers/protocol/native.h"' '#include "core/line.h"' '#include "core/err.h"'
    plant drivers/link/tcp.c '#include "drivers/link/link.h"' '#include "core/err.h"' '#include <sys/socket.h>'
    plant drivers/usb/usb_core.c '#include "drivers/usb/device.h"' '#include "drivers/protocol/native.h"'
    plant drivers/host/open.c '#include "drivers/host/scanhead.h"' '#include "drivers/protocol/native.h"' '#include "core/err.h"'
    plant firmware_sim/loop/loop.c '#include "core/scene.h"' '#include "drivers/link/link.h"' '#include "drivers/host/scanhead.h"' \
        '/* #include "tests/nothing.h" */' '// #include "../core/err.h"'
    plant build-asan/generated.cpp 'int built;'
}

# The tree with one more file must give just this one violation.
expect_violation() { # file line
    clean_tree
    plant "$@"
    local found
    found=$(violations "$work/tree")
    [ "$(printf '%s' "$found" | grep -c '')" = 1 ] && [[ $found == "$1:"* ]]
    report $? "finds $1${2:+ with $2}" "found: ${found:-nothing}"
}

clean_tree
found=$(violations "$work/tree")
[ -z "$found" ]
report $? "a clean tree passes" "$found"

expect_violation core/bad.c '#include "drivers/link/link.h"'
expect_violation core/bad.h '#include "firmware_sim/command/head.h"'
expect_violation core/deep/bad.c '  #  include   "drivers/protocol/native.h" /* why */'
expect_violation core/bad.c '#include <drivers/link/link.h>'
expect_violation core/bad.c '#include "../drivers/link/link.h"'
expect_violation core/bad.c '#include "scene.h"'
expect_violation core/bad.c '#include "tests/unit/command_device.h"'
expect_violation core/bad.c '#include HEADER'
expect_violation core/georef/other.cpp 'int other;'
expect_violation drivers/bad.h '#include "core/scene.h"'
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
expect_violation firmware_sim/bad.c '#include "tests/unit/command_device.h"'
expect_violation firmware_sim/bad.cpp 'int bad;'
expect_violation tests/accuracy/bad.cc 'int bad;'
expect_violation core/bad.hpp 'int bad;'

for folder in core drivers firmware_sim; do
    [ -n "$(find "$root/$folder" -name '*.[ch]' -print -quit 2>/dev/null)" ]
    report $? "there are sources in $folder" "no .c or .h below $root/$folder"
done
found=$(violations "$root")
[ -z "$found" ]
report $? "the arrows hold in this tree" "$found"
echo "1..$n"
exit $failed
