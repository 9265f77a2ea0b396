#!/bin/sh
# Runs the tests that make has built: sh tests/run_all.sh BUILD [unit|wire|accuracy|stability|guest]. Without a part all of them,
# and the unit tests once more with the sanitizers in. Ends with one line of counts.
# As many at a time as there are processors; those that drive a head at its limits, and the guests, have the machine to themselves.
set -eu
build=$1
part=${2:-}

# programs FOLDER [BUILD]: the test programs of a folder, if its part is wanted.
programs() {
    [ -z "$part" ] || [ "$part" = "$1" ] || return 0
    for source in tests/"$1"/test_*.c; do
        case " $busy " in *" $(basename "$source" .c) "*) continue ;; esac
        [ ! -e "$source" ] || echo "${2:-$build/test}/${source%.c}"
    done
}
busy=
for name in bench_cli clients join latency overrun same_stream signals slow_reader; do busy="$busy test_$name"; done

set -- $(programs accuracy) $(programs stability)
if [ -z "$part" ] || [ "$part" = unit ]; then set -- "$@" tests/check_includes.sh tests/check_recipes.sh $(programs unit); fi
if [ -z "$part" ]; then set -- "$@" $(programs unit "$build/asan"); fi
if [ -z "$part" ] || [ "$part" = wire ]; then
    set -- "$@" tests/check_install.sh $(programs wire) --
    for name in $busy; do set -- "$@" "$build/test/tests/wire/$name"; done
fi
if [ -z "$part" ] || [ "$part" = guest ]; then
    export BUILD="$build"
    set -- "$@" tests/guest/guest.sh # it takes the programs of tests/guest with it
fi
exec bash tests/run_tap.sh -j "$(getconf _NPROCESSORS_ONLN)" "$@"
