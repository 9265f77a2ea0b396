#!/bin/bash
# SPDX-License-Identifier: MIT
# The list of small faults in tests/mutants is whole: each patch says what is wrong and which tests find it, these tests
# exist, and it applies to the tree as it is. Whether the tests find it: `make mutants`. Prints TAP.
set -u
cd "$(dirname "$0")/.." || exit 1
. tests/mutants/list.sh
command -v patch >/dev/null || { echo "1..0 # SKIP patch is missing (Debian: patch)"; exit 0; }
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
. tests/tap.sh

# lines_whole FILE...: prints what is wrong with the text of patches, and names of tests that are not there.
lines_whole() {
    local file fault tests argued wrong name bad=0
    while IFS=$'\037' read -r file fault tests argued wrong; do
        for name in $tests; do mutants_test "$name" >/dev/null || wrong="no test $name"; done
        if [ -n "$wrong" ]; then echo "$file: $wrong" && bad=1; fi
    done < <(mutants_list "$@")
    return $bad
}

# Nothing is written. A patch that an earlier one has moved still applies; one whose surroundings have changed does not.
all_apply() {
    local file bad=0
    for file; do
        patch -p1 --dry-run --fuzz=0 --force <"$file" >"$work/said" 2>&1 || { echo "$file: $(tail -n 1 "$work/said")" && bad=1; }
    done
    return $bad
}

# finds FUNCTION FILE: what it must object to, it does.
finds() {
    ! "$1" "$2" >"$work/said" 2>&1
}

named() { # FILE, LINE BEFORE, CHANGED FILE: a patch that is wrong in one place
    printf '%s\n--- a/%s\n+++ b/%s\n@@ -1 +1 @@\n-no such line\n+x\n' "$2" "$3" "$3" >"$work/$1"
}
both=$'Fault: x\nFound by: check_mutants'
named no-test.patch $'Fault: x\nFound by: test_that_is_not_there' core/err.c
named no-reason.patch 'Fault: x' core/err.c
named no-fault.patch 'Found by: check_mutants' core/err.c
named a-test.patch "$both" tests/tap.sh
named name.patch "$both" core/err.c
named it-whole.patch "$both" core/err.c
check "a test that is not there is seen" finds lines_whole "$work/no-test.patch"
check "a patch without a reason is seen" finds lines_whole "$work/no-reason.patch"
check "a patch without its fault is seen" finds lines_whole "$work/no-fault.patch"
check "a patch of a test is seen" finds lines_whole "$work/a-test.patch"
check "a name without an area is seen" finds lines_whole "$work/name.patch"
check "one that is whole passes" lines_whole "$work/it-whole.patch"
check "one that does not apply is seen" finds all_apply "$work/it-whole.patch"
check "all patches have their lines, and their tests are there" lines_whole tests/mutants/*.patch
check "all patches apply" all_apply tests/mutants/*.patch
echo "1..$tests"
