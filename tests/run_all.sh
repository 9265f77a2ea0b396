#!/bin/sh
# Runs the tests that make has built: sh tests/run_all.sh BUILD [unit|wire|accuracy|stability|guest]. Without a part all of
# them, and the unit tests once more with the sanitizers in. Ends with one line of counts.
#
# As many at a time as there are processors, those that take longest first in each folder:
#   1. accuracy, stability, unit: they compute; the recipes beside them, which mostly wait
#   2. wire, which mostly waits; the guests beside it, which compute
#   3. those that drive a head at its limits, or that spin: each has the machine to itself
set -eu
build=$1
part=${2:-}
alone="bench_cli clients join latency overrun ring_threads same_stream signals slow_reader"
longest="leaks meshes beam_reference range beam plan coordinates georef_default gpsd attributes moving travel ticks"

wanted() {
    [ -z "$part" ] || [ "$part" = "$1" ]
}

# programs FOLDER [BUILD]: the test programs of a folder, the longest first, without those that run alone.
programs() {
    for name in $longest $(cd "tests/$1" && ls test_*.c | sed 's/^test_//; s/\.c$//'); do
        case " $alone $seen " in *" $name "*) continue ;; esac
        seen="$seen $name"
        [ ! -e "tests/$1/test_$name.c" ] || echo "${2:-$build/test}/tests/$1/test_$name"
    done
}
seen=

set --
if wanted unit; then set -- "$@" +tests/check_recipes.sh; fi
if wanted accuracy; then set -- "$@" $(programs accuracy); fi
if wanted stability; then set -- "$@" $(programs stability); fi
if wanted unit; then set -- "$@" tests/check_includes.sh tests/check_make.sh $(programs unit); fi
if [ -z "$part" ]; then set -- "$@" $(programs unit "$build/asan"); fi
if wanted guest; then
    export BUILD="$build"
    set -- "$@" +tests/guest/guest.sh # it takes the programs of tests/guest with it
fi
if wanted wire; then set -- "$@" $(programs wire) tests/check_install.sh; fi
set -- "$@" --
for name in $alone; do
    for folder in accuracy stability unit wire; do
        if wanted $folder && [ -e "tests/$folder/test_$name.c" ]; then set -- "$@" "$build/test/tests/$folder/test_$name"; fi
    done
    if [ -z "$part" ] && [ -e "tests/unit/test_$name.c" ]; then set -- "$@" "$build/asan/tests/unit/test_$name"; fi
done
exec bash tests/run_tap.sh -j "$(getconf _NPROCESSORS_ONLN)" "$@"
