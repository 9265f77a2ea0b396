#!/bin/bash
# SPDX-License-Identifier: MIT
# This is the short form of `make check-tsan`, for `make test`. ThreadSanitizer watches one head with all kinds of links
# and their clients, with faults on and knobs turned. The script prints TAP. TSAN_HEAD names the program, which `make
# check-tsan-short` builds.
set -u
head=${TSAN_HEAD:-build/tsan_short/tsan_head}
[ -x "$head" ] || { echo "1..0 # SKIP $head is not built; it needs clang and its sanitizers"; exit 0; }
command -v python3 >/dev/null || { echo "1..0 # SKIP python3 is missing"; exit 0; }
# On a kernel that scatters addresses more widely than it expects, the sanitizer says so and ends.
"$head" --version >/dev/null 2>&1 || { echo "1..0 # SKIP ThreadSanitizer does not run on this machine"; exit 0; }
work=$(mktemp -d /tmp/scanhead-tsan-XXXXXX) || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
python3 tests/check/tsan.py --scanhead "$head" --out "$work" --short
