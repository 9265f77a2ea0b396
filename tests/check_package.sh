#!/bin/bash
# SPDX-License-Identifier: MIT
# Checks the contents of the packages of `make deb` without building any: symbols, versions, files, the unit, licences.
# `make deb-check` tries the packages themselves. Prints TAP. $SCANHEAD: the program of the build whose library is
# looked at.
set -u
build=$(dirname "${SCANHEAD:-build/scanhead}")
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
. tests/tap.sh
packaging=config/packaging

# The library exports exactly the promised symbols, and no symbol is said to come in a future release.
symbols_agree() {
    nm -D --defined-only --with-symbol-versions "$build/libscanhead.so" | sed -n 's/.* \(scanhead_.*\)@@/\1@/p' | sort >"$work/has"
    sed -n 's/^ \(scanhead_[^ ]*\) [0-9].*/\1/p' $packaging/debian/libscanhead1.symbols | sort >"$work/says"
    [ -s "$work/has" ] && diff "$work/has" "$work/says" || return
    newest=$(sed -n 's/^ [^ ]* \([0-9]\)/\1/p' $packaging/debian/libscanhead1.symbols | sort -V | tail -n 1)
    version=$("${SCANHEAD:-build/scanhead}" --version | sed 's/scanhead //')
    [ "$(printf '%s\n' "$newest" "$version" | sort -V | tail -n 1)" = "$version" ]
}

# All that is installed belongs to a package, and packages have nothing else. (check_install.sh looks at make install.)
files_agree() {
    env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -s install BUILT=yes BUILD="$build" DESTDIR="$work/root" PREFIX=/usr \
        LIB=lib/triplet || return
    for file in $(cd "$work/root" && find . -type f -o -type l | sed 's|^\./||'); do
        found=
        for list in $packaging/debian/*.install $packaging/debian/not-installed; do
            while read -r pattern to; do
                case $file in $pattern | $pattern/*) found=$list ;; esac
            done <"$list"
        done
        [ -n "$found" ] || { echo "$file is in no package"; return 1; }
    done
    cat $packaging/debian/*.install $packaging/debian/not-installed | while read -r pattern to; do
        ls -d "$work/root/"$pattern >"$work/ls" 2>&1 || [ -e "$pattern" ] || { echo "$pattern: no such file"; exit 1; }
    done
}

# A release has at its top all that git tracks there, except names that begin with a dot, and nothing else.
sources_are_all() {
    listed=$(sed -n 's/^DEB_SOURCES = //p' $packaging/packaging.mk)
    for top in $listed; do [ -e "$top" ] || { echo "no $top"; return 1; }; done
    [ "$(git rev-parse -q --show-toplevel 2>/dev/null)" = "$(pwd -P)" ] || return 0 # a release, or one within another tree
    git ls-files | cut -d / -f 1 | grep -v '^\.' | sort -u >"$work/tracked"
    printf '%s\n' $listed | sort | diff "$work/tracked" -
}

# The developers' package has all pages that the protocol's first page names.
pages_agree() {
    for page in PROTOCOL.md $(grep -oE '\]\([A-Z_]+\.md' drivers/protocol/PROTOCOL.md | cut -c 3- | sort -u); do
        grep -qx "drivers/protocol/$page" $packaging/debian/libscanhead-dev.docs || { echo "$page is in no package"; return 1; }
    done
}

# Each library that the program is linked with has a line in the README, with its licence.
licences_are_named() {
    for library in $(readelf -d "${SCANHEAD:-build/scanhead}" | sed -n 's/.*(NEEDED).*\[lib\([A-Za-z]*\).*/\1/p'); do
        case $library in stdc | m | gcc | c | ld) continue ;; esac
        grep -qi "^| .*$library.* | .*[A-Z]" $packaging/README.md || { echo "README.md: no licence of $library"; return 1; }
    done
    sed -n '/^Permission/,$p' LICENSE >"$work/mit"
    sed -n '/^License: Expat$/,$p' $packaging/copyright | sed -n 's/^ \.$//; s/^ //; /^Permission/,$p' | diff "$work/mit" - &&
        grep -q '^Copyright (c) .* the scanhead authors$' LICENSE
}

# systemd rates the unit's exposure 1.5 now. That remains because the head needs the network and real time.
unit_is_sound() {
    sed "s|@PREFIX@|$work/root/usr|" $packaging/scanhead@.service.in >"$work/scanhead@.service"
    systemd-analyze verify --man=no "$work/scanhead@example.service" 2>&1 | grep "$work" && return 1
    systemd-analyze security --offline=yes --threshold=16 "$work/scanhead@.service" >"$work/security" 2>/dev/null ||
        { tail -n 1 "$work/security"; return 1; }
}

# The unit's limits allow all that the pacing thread asks for.
limits_agree() {
    priority=$(sed -n 's/^enum { PACER_PRIORITY = \([0-9]*\) };/\1/p' firmware_sim/loop/pacer.c)
    [ -n "$priority" ] && grep -qx "LimitRTPRIO=$priority" $packaging/scanhead@.service.in &&
        grep -q -e "--ulimit rtprio=$priority " $packaging/README.md
}

scripts_are_sound() {
    for script in $packaging/check.sh $packaging/debian/*.p*rm $packaging/debian/*.post*; do
        bash -n "$script" || return
    done
    sed -n '/^override_dh_makeshlibs:/,/^$/p' $packaging/debian/rules | grep -q -e '-c4'
}

example_passes() {
    sed "s|/usr/share|$PWD/config|; s|config/scanhead|config|; s|5025|0|" $packaging/example.yaml >"$work/example.yaml" &&
        "${SCANHEAD:-build/scanhead}" check "$work/example.yaml"
}

check "symbols of the library: as libscanhead1.symbols has them" symbols_agree
check "each installed file is in a package" files_agree
check "a release has all that stands at the top" sources_are_all
check "the pages of the protocol are in the package of the library's developers" pages_agree
check "licences of the libraries are named; LICENSE and copyright are the same" licences_are_named
check "the service's limits are what real time takes" limits_agree
check "the scripts of the packages" scripts_are_sound
check "the service's example passes its check" example_passes
if command -v systemd-analyze >/dev/null; then
    check "systemd-analyze verify, and an exposure of at most 1.6" unit_is_sound
else
    tests=$((tests + 1))
    echo "ok $tests - systemd-analyze verify # SKIP no systemd-analyze"
fi
echo "1..$tests"
