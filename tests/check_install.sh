#!/bin/sh
# SPDX-License-Identifier: MIT
# The files that `make install` installs are enough for a client: the README's example, compiled with them alone, reads
# a scan. Prints TAP. $SCANHEAD: the program of the build that is installed.
set -u
program=${SCANHEAD:-build/scanhead}
work=$(mktemp -d) || exit 1
head=
trap '[ -z "$head" ] || kill "$head"; rm -rf "$work"' EXIT
prefix=/opt/scanhead
. tests/tap.sh

# The variables of the make above are not for this one.
install_it() {
    env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -s install BUILT=yes BUILD="$(dirname "$program")" DESTDIR="$1" \
        PREFIX="$2"
}

# All is below DESTDIR and PREFIX, and pkg-config escapes the blank.
blanks_stay() {
    mkdir "$work/none" && install_it "$work/none/a root" "/opt/scan head" && test "$(ls "$work/none")" = "a root" &&
        test "$(ls "$work/none/a root")" = opt && "$work/none/a root/opt/scan head/bin/scanhead" --version &&
        PKG_CONFIG_PATH="$work/none/a root/opt/scan head/lib/pkgconfig" pkg-config --cflags libscanhead |
        grep -qF -e '-I/opt/scan\ head/include'
}

# systemd takes %h for the user's home, and %% for a percent sign. What the shell, sed or pkg-config would take for
# something else is refused at once.
odd_prefixes() {
    mkdir "$work/odd" && install_it "$work/odd" "/opt/100%h" &&
        grep -qxF 'ExecStart="/opt/100%%h/bin/scanhead" run /etc/scanhead/%i.yaml' \
            "$work/odd/opt/100%h/lib/systemd/system/scanhead@.service" || return
    for odd in '|' '&' '"' '`' '#' '\' '$$' "$(printf '\t')"; do
        install_it "$work/refused" "/opt/a${odd}b" 2>"$work/said" && { echo "$odd is taken"; return 1; }
        grep -qF 'make install: PREFIX or DESTDIR has a character of "$`\|&#' "$work/said" && test ! -e "$work/refused" ||
            { cat "$work/said"; return 1; }
    done
    install_it "$work/refused" opt/a 2>"$work/said" && { echo "a relative one is taken"; return 1; }
    grep -qF 'PREFIX=opt/a is relative' "$work/said" && test ! -e "$work/refused"
}

# With the strictest umask all can read what is there, and run what runs for its owner.
all_can_read() {
    mkdir "$work/strict" && (umask 077 && install_it "$work/strict" /opt/a) || return
    find "$work/strict/opt/a" ! -type l \( -type d ! -perm 755 -o -type f ! -perm 644 ! -perm 755 \) | grep . && return 1
    test -x "$work/strict/opt/a/bin/scanheadd"
}

# `make uninstall` leaves what others have put beside the files. A file of an older release goes with the next one.
uninstalls() {
    root=$work/strict/opt/a list=$work/strict/opt/a/share/scanhead/installed.txt
    : >"$root/bin/other" && : >"$root/share/scanhead/heads/old.yaml" && : >"$root/share/scanhead/heads/mine.yaml" &&
        echo /opt/a/share/scanhead/heads/old.yaml >>"$list" && install_it "$work/strict" /opt/a &&
        test ! -e "$root/share/scanhead/heads/old.yaml" || { echo "an older file stays"; return 1; }
    uninstall_it || return
    left=$(cd "$root" && find . ! -type d | sort | tr '\n' ' ')
    test "$left" = "./bin/other ./share/scanhead/heads/mine.yaml " || { echo "left: $left"; return 1; }
    ! uninstall_it 2>"$work/said" && grep -qF "make uninstall: no $list" "$work/said"
}
uninstall_it() {
    env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -s uninstall DESTDIR="$work/strict" PREFIX=/opt/a
}

# Where a file is missing, nothing is installed.
all_or_nothing() {
    mkdir "$work/part" && cp "$(dirname "$program")/scanhead" "$work/part/" && mkdir "$work/nothing" &&
        ! env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -s install BUILT=yes BUILD="$work/part" DESTDIR="$work/nothing" \
            2>"$work/said" && test -z "$(ls "$work/nothing")" || return
    # Nothing goes elsewhere where there is no folder for the stage.
    ! TMPDIR=$work/none/at/all env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -s install BUILT=yes BUILD="$(dirname "$program")" \
        DESTDIR="$work/nothing" PREFIX="$work/elsewhere" 2>"$work/said" && test ! -e "$work/elsewhere" -a -z "$(ls "$work/nothing")"
}

# A copy of an installation has a list of the original's files. What is not yet complete can be taken back.
copies_stay_apart() {
    at=$work/apart
    env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -s install BUILT=yes BUILD="$(dirname "$program")" PREFIX="$at/a" && cp -a "$at/a" "$at/b" &&
        ! make_uninstall "$at/b" 2>"$work/said" && test -x "$at/a/bin/scanhead" -a -x "$at/b/bin/scanhead" || return
    rm "$at/a/bin/scanheadd" && mkdir -p "$at/a/bin/scanheadd/in" || return
    ! env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -s install BUILT=yes BUILD="$(dirname "$program")" PREFIX="$at/a" 2>"$work/said" || return
    rmdir "$at/a/bin/scanheadd/in" "$at/a/bin/scanheadd" && make_uninstall "$at//a/" && test -z "$(find "$at/a" ! -type d)"
}
make_uninstall() {
    env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -s uninstall PREFIX="$1"
}

config() {
    PKG_CONFIG_PATH=$work/root$prefix/lib/pkgconfig pkg-config --define-variable=prefix="$work/root$prefix" "$@" libscanhead
}

compile() {
    out=$1
    shift
    (cd "$work" && ${CC:-cc} -Wall -Werror client.c $(config --cflags) "$@" -o "$out")
}

# The client reads a scan of the guest tests' head as points, in lines of three numbers.
reads_a_scan() {
    sed "\$alinks: [{type: pty, path: port}]" tests/guest/head.yaml >"$work/config.yaml"
    cp tests/guest/room.obj "$work/"
    mkfifo "$work/ready"
    "$work/root$prefix/bin/scanhead" run "$work/config.yaml" --pace fast --ready-fd 9 9>"$work/ready" 2>"$work/head.err" &
    head=$!
    read -r ready <"$work/ready" || { cat "$work/head.err"; return 1; }
    left=500 # so many tries: a head that is asked at once may still boot
    until LD_LIBRARY_PATH=$work/root$prefix/lib timeout 60 "$work/client" "tty:$work/port" >"$work/points"; do
        left=$((left - 1))
        if [ $left = 0 ] || ! grep -q 'in state boot' "$work/points"; then
            cat "$work/points"
            return 1
        fi
    done
    test "$(grep -c '^-\{0,1\}[0-9.]* -\{0,1\}[0-9.]* -\{0,1\}[0-9.]*$' "$work/points")" -gt 1000
}

# Program, library, header and libscanhead.pc have the same version.
versions_agree() {
    version=$(config --modversion)
    expr "$version" : '[0-9][0-9]*\.[0-9]' >/dev/null || { echo "no version in libscanhead.pc: $version"; return 1; }
    cat >"$work/version.c" <<END
#include <scanhead.h>
#include <stdio.h>
#include <string.h>
int main(void) { return puts(scanhead_version()) < 0 || strcmp(scanhead_version(), SCANHEAD_VERSION) != 0; }
END
    (cd "$work" && ${CC:-cc} version.c $(config --cflags) $(config --libs) -o version) || return
    test "$(LD_LIBRARY_PATH=$work/root$prefix/lib "$work/version")" = "$version" &&
        test "$("$work/root$prefix/bin/scanhead" --version)" = "scanhead $version"
}

# README.md has only one example in C, which is compiled here.
sed -n '/^```c /,/^```$/p' README.md | sed "/^\`\`\`/d" >"$work/client.c"
check "make install" install_it "$work/root" "$prefix"
check "make install into folders with blanks in their names" blanks_stay
check "a prefix with a percent sign, and prefixes that are refused" odd_prefixes
check "all can read it, whatever the umask" all_can_read
check "make uninstall" uninstalls
check "where a file is missing, nothing is installed" all_or_nothing
check "copies stay apart, and a part can be taken back" copies_stay_apart
check "the udev rule is where udev looks below a prefix" test -s "$work/root$prefix/lib/udev/rules.d/70-scanhead.rules"
check "the dissector for Wireshark is where its README says" cmp drivers/protocol/wireshark/scanhead.lua \
    "$work/root$prefix/share/scanhead/wireshark/scanhead.lua"
# A profile and a mesh come with the program.
example_passes() {
    "$work/root$prefix/bin/scanhead" check --example >"$work/example.yaml" && grep "file: $work/root" "$work/example.yaml" &&
        "$work/root$prefix/bin/scanhead" check "$work/example.yaml"
}
check "the installed program's example passes its check" example_passes
# There are a page for each command, the library's page with all that its header declares, the completion, and the unit
# of the service.
has_pages() {
    share=$work/root$prefix/share
    for name in scanhead scanheadd; do
        for page in $("$work/root$prefix/bin/$name" help --man list | grep "^$name[.-][^y]"); do
            "$work/root$prefix/bin/$name" help --man "$page" | cmp - "$share/man/man${page##*.}/$page" || return
        done
        "$work/root$prefix/bin/$name" help --completion bash | cmp - "$share/bash-completion/completions/$name" || return
    done
    for function in $(sed -n 's/^[a-z].*[ *]\(scanhead_[a-z_]*\)(.*/\1/p' drivers/host/scanhead.h); do
        grep -q "$function(" "$share/man/man3/libscanhead.3" || { echo "libscanhead.3: no $function"; return 1; }
    done
    "$work/root$prefix/bin/scanhead" help --man scanhead.yaml.5 | cmp - "$share/man/man5/scanhead.yaml.5" || return
    ! command -v groff >/dev/null || test -z "$(groff -man -Tutf8 -ww -z "$share/man/man3/libscanhead.3" 2>&1)" || return
    grep -qxF "ExecStart=\"$prefix/bin/scanhead\" run /etc/scanhead/%i.yaml" "$work/root$prefix/lib/systemd/system/scanhead@.service"
}
check "manual pages, a completion and a unit for the service" has_pages
# The modules are there where npm has installed them.
has_ifc_readers() {
    ifc=$work/root$prefix/share/scanhead/ifc
    for file in core/import/ifc/*.mjs; do cmp "$file" "$ifc/${file##*/}" || return; done
    ls "$(dirname "$program")/ifc/installed" "$(dirname "$program")/../ifc/installed" >"$work/ls" 2>/dev/null
    [ ! -s "$work/ls" ] || test -s "$ifc/node_modules/web-ifc/web-ifc-node.wasm" -a -s "$ifc/node_modules/@ifc-lite/wasm/pkg/ifc-lite_bg.wasm"
}
check "scanheadd comes with it" test "$("$work/root$prefix/bin/scanheadd" --version)" = \
    "$("$work/root$prefix/bin/scanhead" --version | sed 's/^scanhead /scanheadd /')"
check "the readers of IFC come with it" has_ifc_readers
check "scripts for campaigns come with it" test -x "$work/root$prefix/share/scanhead/campaign/slurm.sh" -a \
    -x "$work/root$prefix/share/scanhead/campaign/parallel.sh"
check "the README's client, with the archive" compile client-static "$work/root$prefix/lib/libscanhead.a" -lnettle -lusb-1.0 -lm
check "the README's client, with the shared library" compile client $(config --libs)
check "and it reads a scan" reads_a_scan
check "the client in Python asks the same head" timeout 60 python3 "$work/root$prefix/share/scanhead/python/scanhead.py" \
    "tty:$work/port" TIME?
check "one version: program, library, header and pkg-config" versions_agree
echo "1..$tests"
