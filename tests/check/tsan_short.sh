#!/bin/bash
# SPDX-License-Identifier: MIT
# ThreadSanitizer over one head with all kinds of links and their clients, faults on, knobs turned: the short form of
# `make check-tsan`, for `make test`. Prints TAP. TSAN_HEAD: the program, which `make check-tsan-short` builds.
set -u
head=${TSAN_HEAD:-build/tsan_short/tsan_head}
[ -x "$head" ] || { echo "1..0 # SKIP $head is not built; it needs clang and its sanitizers"; exit 0; }
command -v python3 >/dev/null || { echo "1..0 # SKIP python3 is missing"; exit 0; }
# Where the kernel scatters addresses more widely than the sanitizer expects, it says so and ends.
"$head" --version >/dev/null 2>&1 || { echo "1..0 # SKIP ThreadSanitizer does not run on this machine"; exit 0; }
work=$(mktemp -d /tmp/scanhead-tsan-XXXXXX) || exit 1
trap 'rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
python3 tests/check/tsan.py --scanhead "$head" --out "$work" --short
