#!/bin/sh
# Runs the tests that `make test` has built: sh tests/run_all.sh BUILD [unit|wire]. Ends with one line of counts.
set -eu
build=$1
part=${2:-all}
set --
if [ "$part" != wire ]; then
    set -- "$@" tests/check_includes.sh "$build"/test/tests/unit/test_*[!.d]
fi
if [ "$part" != unit ]; then
    set -- "$@" "$build"/test/tests/wire/test_*[!.d]
fi
# The same unit tests with the sanitizers in.
if [ "$part" = all ]; then
    set -- "$@" "$build"/asan/tests/unit/test_*[!.d]
fi
exec bash tests/run_tap.sh "$@"
