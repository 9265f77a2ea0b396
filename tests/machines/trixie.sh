#!/bin/sh
# SPDX-License-Identifier: MIT
# This tests Debian 13 in a root of its own, with Embree 4, gcc 14 and clang 19: it runs all of make test.
here=$(dirname "$0") build=$1 at=$2
. "$here/lib.sh"
make_root trixie --variant=important --include=ca-certificates,make
copy_tree "$at/root/scanhead"
# No service is started in a root.
printf '#!/bin/sh\nexit 101\n' >"$at/root/usr/sbin/policy-rc.d"
chmod +x "$at/root/usr/sbin/policy-rc.d"
echo "    make deps"
in_root sh -c 'cd /scanhead && apt-get update -qq && make deps' >"$at/deps.txt" 2>&1 ||
    leave "its packages could not be installed: $at/deps.txt"
echo "    make test"
in_root sh -c "cd /scanhead && make test JOBS=${JOBS:-2}" >"$at/build.txt" 2>&1
# The output of run_tap.sh begins with its first program.
sed -n '/^\(ok\|FAIL\)  *[a-z]/,$p' "$at/build.txt" >"$at/tests.txt"
[ ! -s "$at/tests.txt" ] || built "make test" "$at/build.txt"
grep -v -E '^(ok|    )' "$at/tests.txt" | sed 's/^/    /'
build_here all "$at/here.txt" || exit 1
in_root sh -c "cd /scanhead && build/test/scanhead $(echo $RECORD) -o build/record.ply" && compare_record "$at/root/scanhead/build/record.ply"
