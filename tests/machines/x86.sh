#!/bin/sh
# SPDX-License-Identifier: MIT
# This tests another x86 processor, by QEMU's name of it, with the programs of this machine: sh x86.sh BUILD FOLDER CPU
here=$(dirname "$0") build=$1 at=$2
. "$here/lib.sh"
[ "$(uname -m)" = x86_64 ] || leave "this machine is no x86_64, so its programs are others"
need qemu-x86_64-static qemu-user-static
build_here test-programs "$at/build.txt" || exit 1
built "the same binaries" "$at/build.txt"
emulate="qemu-x86_64-static -cpu $3"
# If Embree or the head had chosen instructions that this processor lacks, the record would fail.
$nicely $emulate "$build/test/scanhead" $RECORD -o "$at/record.ply" 2>"$at/record.log" && compare_record "$at/record.ply"
test_emulated "$build/test"
