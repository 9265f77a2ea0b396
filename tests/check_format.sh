#!/bin/bash
# SPDX-License-Identifier: MIT
# The C sources have the layout of .clang-format, by version 14, as other versions lay some lines out differently. Each
# source names its licence. Prints TAP.
#
#   clang-format -i FILE    mends a file
set -u
cd "$(dirname "$0")/.." || exit 1
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
. tests/tap.sh
VERSION=14

sources() { # SUFFIX...
    find core drivers firmware_sim tests config -regextype posix-egrep -regex ".*\.($(IFS='|' && echo "$*"))" ! -path 'tests/fuzz/seeds/*'
}

# laid_out FILE...: prints those that are not.
laid_out() {
    clang-format --style=file:.clang-format --dry-run --Werror "$@"
}

licensed() {
    ! grep -L 'SPDX-License-Identifier: MIT' "$@" | grep .
}

finds() { # FUNCTION FILE: it objects to a planted file
    ! "$1" "$2" >"$work/said" 2>&1
}

printf 'int  x;\n' >"$work/odd.c"
if clang-format --version 2>/dev/null | grep -q "version $VERSION\."; then
    check "another layout is seen" finds laid_out "$work/odd.c"
    check "layout" laid_out $(sources c h cpp)
else
    tests=1
    echo "ok 1 - layout # SKIP clang-format $VERSION is missing (Debian 12: clang-format)"
fi
check "a source without a licence is seen" finds licensed "$work/odd.c"
check "licences" licensed Makefile $(sources c h cpp js mjs css sh py lua mk)
echo "1..$tests"
