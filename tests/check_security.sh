#!/bin/bash
# SPDX-License-Identifier: MIT
# Each test that firmware_sim/SECURITY.md names exists, and so does the case in it. Prints TAP.
set -u
cd "$(dirname "$0")/.." || exit 1
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
. tests/tap.sh

# names FILE: `test_x`, `test_x.case`, `fuzz_x`, `check_x`, `tsan_short`, `page.sh`.
names() {
    grep -o '`[^`]*`' "$1" | tr -d '`' | grep -E '^(test_|fuzz_.|check_|tsan_|page\.sh)[a-z0-9_.]*$' | sort -u
}
# is_there NAME: the file exists, and the case is a word in it.
is_there() {
    local file=${1%%.*} word=${1#*.} path
    [ "$1" != page.sh ] || { [ -e tests/page/page.sh ]; return; }
    for path in tests/*/"$file".c tests/"$file".sh tests/check/"$file".sh; do
        [ -e "$path" ] || continue
        [ "$word" = "$1" ] || grep -q -w "$word" "$path" && return
    done
    return 1
}
all_there() {
    local name bad=0
    for name in $(names "$1"); do is_there "$name" || { echo "no $name" && bad=1; }; done
    return $bad
}
# Each row of a table names a test.
rows_have_one() {
    ! grep '^|' "$1" | grep -v '^| ---' | grep -v '| test |$' | grep -v '`\(test_\|fuzz_\|check_\)'
}
printf '| a | b | `test_none` |\n| a | `test_ring.no_case` |\n| a | none |\n' >"$work/bad.md"
finds() { ! "$1" "$work/bad.md"; }
check "a test that is not there would be seen" finds all_there
check "a row without a test would be seen" finds rows_have_one
check "there are many" [ "$(names firmware_sim/SECURITY.md | wc -l)" -gt 50 ]
check "all tests that it names are there" all_there firmware_sim/SECURITY.md
check "each row of it has a test" rows_have_one firmware_sim/SECURITY.md
echo "1..$tests"
