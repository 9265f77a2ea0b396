#!/bin/sh
# SPDX-License-Identifier: MIT
# Runs the tests that make has built: sh tests/run_all.sh BUILD [unit|wire|accuracy|stability|guest]. Without a part it
# runs all: the unit tests with sanitizers, and once more those that make built as shipped. The script ends with one
# line of counts.
#
# As many at a time as there are processors, those that take longest first in each folder:
#   1. accuracy, stability, unit: they compute; beside them those that take longest and so begin first: the guests, the
#      recipes, the page and the heads with sanitizers
#   2. wire, which mostly waits; beside it two tests that wait for other people's clients
#   3. those that drive a head at its limits, or that spin: each has the machine to itself
set -eu
build=$1
part=${2:-}
alone="bench_cli latency overrun ring_threads"
beside="grabber_sick gpsd" # other people's clients take their time
longest="beside leaks meshes beam_reference range sight_cast coordinates plan beam georef_default attributes moving travel ticks"
longest="$longest verdict soak time_server models python slow_reader sight_recipes head_faults fault_times"

wanted() {
    [ -z "$part" ] || [ "$part" = "$1" ]
}

# These unit tests run as shipped beside those with sanitizers. All unit tests do so when they run alone.
if [ -z "$part" ]; then shipped=$(sh tests/shipped.sh | sed 's|.*/test_||; s/\.c$//' | tr '\n' ' '); else shipped=all; fi
runs() { # FOLDER NAME [BUILD]
    [ -e "tests/$1/test_$2.c" ] || return 1
    [ "$1" = unit ] && [ -z "${3:-}" ] && [ "$shipped" != all ] || return 0
    case " $shipped " in *" $2 "*) ;; *) return 1 ;; esac
}

# programs FOLDER [BUILD]: the test programs of a folder, the longest first, without those that run apart.
programs() {
    for name in $longest $(cd "tests/$1" && ls test_*.c | sed 's/^test_//; s/\.c$//'); do
        case " $beside $alone $seen " in *" $name "*) continue ;; esac
        seen="$seen $name"
        ! runs "$1" "$name" "${2:-}" || echo "${2:-$build/test}/tests/$1/test_$name"
    done
}
seen=

set --
if wanted guest; then
    export BUILD="$build"
    [ -n "$part" ] || export GUEST_REPLUGS="${GUEST_REPLUGS:-3}" # `make test-guest`: 20
    set -- "$@" +tests/guest/guest.sh # it takes the programs of tests/guest with it
fi
if wanted unit; then set -- "$@" +tests/check_recipes.sh; fi
if wanted accuracy; then set -- "$@" $(programs accuracy); fi
if wanted stability; then set -- "$@" $(programs stability); fi
if wanted unit; then set -- "$@" tests/check_includes.sh tests/check_format.sh tests/check_make.sh tests/check_mutants.sh tests/check_security.sh tests/check_manual.sh $(ls tests/check_page_*.sh) $(programs unit); fi
if wanted wire; then set -- "$@" +tests/page/page.sh; fi # a browser
if [ -z "$part" ]; then
    export FUZZ_BUILD="$build/asan" JOBS=1
    export TSAN_HEAD="$build/tsan_short/tsan_head"
    export SANITIZED_HEAD="$build/asan/scanhead"
    set -- "$@" +tests/check_sanitized.sh +tests/fuzz/fuzz_short.sh $(programs unit "$build/asan") tests/check/tsan_short.sh
fi
if wanted wire; then for name in $beside; do set -- "$@" "+$build/test/tests/wire/test_$name"; done; fi
if wanted wire; then set -- "$@" $(programs wire) tests/check_install.sh tests/check_lockstep.sh tests/check_scanheadd.sh tests/check_package.sh; fi

# apart NAME...: prints those programs of the wanted folders, and those of unit with sanitizers.
apart() {
    for name; do
        for folder in accuracy stability unit wire; do
            if wanted $folder && runs $folder "$name"; then echo "$build/test/tests/$folder/test_$name"; fi
        done
        if [ -z "$part" ] && [ -e "tests/unit/test_$name.c" ]; then echo "$build/asan/tests/unit/test_$name"; fi
    done
}
set -- "$@" -- $(apart $alone)
exec bash tests/run_tap.sh -t 1200 -j "$(getconf _NPROCESSORS_ONLN)" "$@"
