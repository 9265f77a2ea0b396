# SPDX-License-Identifier: MIT
# The machines share this file. Their scripts source it with $build, and with $at, the folder of this machine, which is
# kept.
set -u
nicely="nice -n 5"

# leave WHY: ends the script because nothing can be done here.
leave() {
    echo "$*" >"$at/skipped.txt"
    echo "    skipped: $*"
    exit 0
}

# need PROGRAM PACKAGE: leaves if the program is missing.
need() {
    command -v "$1" >/dev/null || leave "no $1 (package $2)"
}

# The first prints the address of the Debian archive that apt uses here. The second prints apt's settings for the way
# there.
debian_archive() {
    apt-get indextargets --format '$(REPO_URI) $(LABEL)' 'Created-By: Packages' 2>/dev/null |
        sed -n 's/ Debian$//p' | head -n 1
}
apt_ways() {
    apt-config dump | grep -i -E '^Acquire::.*(proxy|Check-|Verify|CaInfo|Retries).* ".+";$'
}

# make_root SUITE [OPTION...]: makes a Debian in $at/root by mmdebstrap, once. Another suite or other options make it
# anew.
make_root() {
    asked="$*"
    [ "$(cat "$at/root.is" 2>/dev/null)" != "$asked" ] || return 0
    [ "$(id -u)" = 0 ] || leave "a root is made by root alone: run make machines as root"
    need mmdebstrap mmdebstrap
    archive=$(debian_archive)
    [ -n "$archive" ] || leave "apt knows no Debian archive: apt-get update"
    suite=$1
    shift
    echo "    root: $suite, a minute or two"
    rm -rf "$at/root" "$at/root.is"
    apt_ways >"$at/apt.conf"
    if ! $nicely mmdebstrap --aptopt="$at/apt.conf" "$@" "$suite" "$at/root" "$archive" >"$at/root.txt" 2>&1; then
        leave "mmdebstrap could not make it ($at/root.txt): $(grep '^E: ' "$at/root.txt" | head -n 1)"
    fi
    echo "$asked" >"$at/root.is"
}

# in_root COMMAND...: runs a command in the root, with its own processes and mounts, which end with it. The root trusts
# the certificates that this machine trusts, and npm there does, too.
in_root() {
    $nicely unshare -m -p -f --kill-child --propagation private sh -c '
        root=$1
        shift
        mount -t proc proc "$root/proc" && mount --rbind /dev "$root/dev" && mount --rbind /sys "$root/sys" &&
            mount -t tmpfs tmpfs "$root/run" || exit 1
        cp /etc/resolv.conf "$root/etc/resolv.conf" 2>/dev/null
        trusted=etc/ssl/certs/ca-certificates.crt
        [ ! -e "/$trusted" ] || [ ! -d "$root/etc/ssl/certs" ] || cp "/$trusted" "$root/$trusted"
        exec chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 \
            NODE_EXTRA_CA_CERTS="/$trusted" "$@"' sh "$at/root" "$@"
}

# Copies the project's files into the folder $1, with their times. Results of a build there stay.
copy_tree() {
    mkdir -p "$1"
    find "$1" -mindepth 1 -maxdepth 1 ! -name build -exec rm -rf {} +
    tar -c $(ls -d Makefile README.md CHANGELOG.md LICENSE config core drivers firmware_sim tests 2>/dev/null) | tar -x -C "$1"
}

# built HOW FILE: notes a build that went well. FILE has the text that make printed.
built() {
    echo "$1, $(grep -c '^[^ ]*: warning:' "$2") warnings" >"$at/built.txt"
}

# build_here TARGET LOG: builds the programs of this machine with the options of `make test`. Files that are built
# already stay.
build_here() {
    echo "    building for this machine"
    $nicely ${MAKE:-make} -j"${JOBS:-2}" DEPS=no BUILD="$build/test" WERROR=-Werror CFLAGS=-g1 CXXFLAGS=-g1 "$1" >"$2" 2>&1 ||
        { echo "    it does not build: $2"; return 1; }
}

# ---- tests under an emulator, whose command is $emulate

# emulated_programs BUILD: prints the paths there of the programs of unit, accuracy and stability.
emulated_programs() {
    ls tests/accuracy/test_*.c tests/stability/test_*.c tests/unit/test_*.c | sed "s|^|$1/|; s|\\.c\$||"
}

# test_emulated BUILD: runs its programs of unit, accuracy and stability, for $LIMIT_S seconds of processor time each.
# Beside other work that may take twenty times as long by the clock.
test_emulated() {
    rm -rf "$at/run"
    from=$1/tests
    set -- $(emulated_programs "$1")
    for program; do
        script=$at/run/${program#"$from"/}
        mkdir -p "$(dirname "$script")"
        printf '#!/bin/sh\nexec sh %s/emulated.sh %s %s\n' "$here" "$program" "$emulate" >"$script"
        chmod +x "$script"
    done
    echo "    tests, ${LIMIT_S:=300} s of processor time each at most"
    export LIMIT_S
    $nicely bash tests/run_tap.sh -t $((20 * LIMIT_S + 600)) -j "${JOBS:-2}" "$at"/run/accuracy/* "$at"/run/stability/* \
        "$at"/run/unit/* >"$at/tests.txt"
    grep -v -E '^(ok|    )' "$at/tests.txt" | sed 's/^/    /'
}

# ---- the short record: 30,000 pulses go into the room with glass and a mirror, with noise, and each shot has its range

RECORD="record config/glass.yaml --crs local --duration 0.1 --ascii --empty-shots --ply-columns range,time,echo
    --quiet --no-hash"

# compare_record FILE: compares it with the record of this machine. The same arithmetic gives the same ranges. But a ray
# along an edge may meet the other side of it if packets of rays are narrower. So the comparison allows 24 other
# shots, two for each of a dozen edges.
compare_record() {
    ref=$build/machines/record.ply
    rm -f "$ref"
    $nicely "$build/test/scanhead" $RECORD -o "$ref" || { echo "not made here" >"$at/record.txt"; return 1; }
    LC_ALL=C awk -v most=24 -v bound_m=1e-6 '
        /^element vertex/ { n[FILENAME] = $3 }
        /^property/ && FNR == NR { column[$3] = ++columns }
        /^end_header/ { row[FILENAME] = 1; next }
        !row[FILENAME] { next }
        { key = $column["time"] " " $column["echo"]; range = $column["range"] }
        FNR == NR { here[key] = range; next }
        !(key in here) { other++; next }
        here[key] == range { same++; next }
        { d = here[key] - range; if (d < 0) d = -d; if (d <= bound_m) { near++; if (d > worst) worst = d } else other++ }
        END {
            good = n[ARGV[1]] == n[ARGV[2]] && same > 0 && other + 0 <= most
            printf("%s: %d of %d shots have the same range, %d within %.1g m, %d another\n", good ? "as here" : "NOT as here", same,
                n[ARGV[1]], near, bound_m, other)
        }' "$ref" "$1" >"$at/record.txt"
    cat "$at/record.txt" | sed 's/^/    record: /'
}
