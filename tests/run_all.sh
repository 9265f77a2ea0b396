#!/bin/sh
# Runs the tests that make has built: sh tests/run_all.sh BUILD [unit|wire|accuracy|stability|guest]. Without a part all of them,
# and the unit tests once more with the sanitizers in. Ends with one line of counts.
set -eu
build=$1
part=${2:-}
set --
for folder in unit accuracy stability wire; do
    [ -z "$part" ] || [ "$part" = $folder ] || continue
    [ $folder != unit ] || set -- "$@" tests/check_includes.sh
    [ $folder != wire ] || set -- "$@" tests/check_install.sh
    for source in tests/$folder/test_*.c; do
        [ ! -e "$source" ] || set -- "$@" "$build/test/${source%.c}"
    done
done
if [ -z "$part" ] || [ "$part" = guest ]; then
    export BUILD="$build"
    set -- "$@" tests/guest/guest.sh # it takes the programs of tests/guest with it
fi
if [ -z "$part" ]; then
    for source in tests/unit/test_*.c; do
        set -- "$@" "$build/asan/${source%.c}"
    done
fi
exec bash tests/run_tap.sh "$@"
