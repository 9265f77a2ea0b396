#!/bin/sh
# SPDX-License-Identifier: MIT
# Finds the rigs that a test program is linked with: those whose headers it includes, directly or not. Prints
# PROGRAM:SOURCE for each. `#include "tests/unit/cast_rig.h"` links tests/unit/cast_rig.c, if there is one. The Makefile
# calls this. The sources of tests/common and tests/bench are libraries and not listed.
cd "$(dirname "$0")/.." || exit 1
{
    for source in tests/*/*.c; do echo "$source"; done
    grep -H -o '^#include "tests/[^"]*' tests/*/*.[ch] | sed 's/:#include "/ /'
} | awk '
    NF == 1 { source[$1] = 1; next }
    { includes[$1] = includes[$1] " " $2 }
    function follow(file,   list, n, i, rig) {
        if (seen[file]) return
        seen[file] = 1
        n = split(includes[file], list, " ")
        for (i = 1; i <= n; i++) {
            rig = list[i]
            sub(/\.h$/, ".c", rig)
            if (!seen[rig] && (rig in source) && rig !~ /^tests\/(common|bench)\//) print program ":" rig
            follow(list[i])
            if (rig in source) follow(rig)
        }
    }
    END {
        for (file in source) {
            if (file !~ /\/(test|fuzz)_[^\/]*$/) continue
            program = file
            sub(/\.c$/, "", program)
            split("", seen)
            follow(file)
        }
    }'
