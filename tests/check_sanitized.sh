#!/bin/bash
# SPDX-License-Identifier: MIT
# Wire tests that use each command run once more, with the program that has sanitizers. So an error of memory in a command,
# or a leak, fails here. Prints TAP. SANITIZED_HEAD names the program, BUILD the folder of the tests.
set -u
export SCANHEAD=${SANITIZED_HEAD:-build/asan/scanhead}
programs=${BUILD:-build}/test/tests/wire
for needed in "$SCANHEAD" "$programs/test_status"; do
    [ -x "$needed" ] || { echo "1..0 # SKIP $needed is not built; make test builds it"; exit 0; }
done
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
. tests/tap.sh
for name in status batch coverage init report scan_meshes view_file save surfaces loopback report_tables files colours; do
    check "$name" "$programs/test_$name"
done
echo "1..$tests"
