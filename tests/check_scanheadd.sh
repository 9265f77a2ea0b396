#!/bin/bash
# SPDX-License-Identifier: MIT
# scanheadd is the head alone: it has the head's libraries and commands, and the same stream as scanhead. Prints TAP.
# $SCANHEAD: a program; the two that lie beside it are checked.
set -u
built=$(dirname "${SCANHEAD:-build/scanhead}")
head=$built/scanheadd
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
. tests/tap.sh

needed() {
    readelf -d "$1" | sed -n 's/.*(NEEDED).*\[lib\([^.]*\)\.so.*/\1/p' | sort
}

# The head needs these for casting, packed glTF, the Earth, configurations, hashes, USB, JSON, textures, and usbredir
# where it is installed. Others are loaded when they are asked for (core/late.h). Pictures are the studio's.
ALLOWED='embree[34] meshoptimizer GeographicLib yaml-0 nettle usb-1 jansson webp usbredirparser stdc++ m gcc_s c ld-linux.*'
libraries() {
    needed "$head" | grep -vxE "$(echo $ALLOWED | sed 's/+/\\+/g; s/ /|/g')" && return 1
    needed "$head" | grep -qx yaml-0 && needed "$built/scanhead" | grep -q '^png'
}

# These names are defined by the studio alone, and scanheadd has none of them.
without_studio() {
    (cd "$built" && find core/studio drivers/record firmware_sim/app/studio -name '*.c.o' -exec nm -g --defined-only {} +) |
        awk 'NF == 3 { print $3 }' | sort >"$work/studio"
    nm -g --defined-only "$head" | awk '{ print $3 }' | sort -u >"$work/head"
    [ "$(wc -l <"$work/studio")" -gt 200 ] && grep -qx app_run "$work/head" || return
    ! comm -12 "$work/studio" "$work/head" | grep .
}

commands_of() {
    "$1" --help | sed -n "s/^  ${1##*/} \\([a-z]*\\) .*/\\1/p"
}
commands() {
    [ "$(commands_of "$head" | tr '\n' ' ')" = "run plan check list help " ] || return
    for command in $(commands_of "$built/scanhead"); do
        commands_of "$head" | grep -qx "$command" && continue
        said=$("$head" "$command" --help 2>&1)
        [ $? = 2 ] && [ "$said" = "scanheadd: $command: not in scanheadd; use scanhead" ] || { echo "$command: $said"; return 1; }
        [ "$("$head" help "$command" 2>&1)" = "$said" ] || { echo "help $command"; return 1; }
    done
    said=$("$head" lits 2>&1)
    [ $? = 2 ] && [[ $said == *"did you mean list?"* ]]
}

# scanheadd's messages, help and pages have its own name; there are pages of its own commands alone.
name() {
    pages=$("$head" help --man list | tr '\n' ' ')
    [ "$pages" = "scanheadd.1 scanheadd-run.1 scanheadd-plan.1 scanheadd-check.1 scanheadd-list.1 scanheadd-help.1 scanhead.yaml.5 " ] || { echo "$pages"; return 1; }
    "$head" help --man scanheadd-run.1 | grep -q '^\\fBscanheadd run\\fR' || return
    "$head" run --help | grep -q '^usage: scanheadd run ' || return
    [ "$("$head" --version)" = "$("$built/scanhead" --version | sed 's/^scanhead /scanheadd /')" ] || return
    said=$("$head" check "$work/none.yaml" 2>&1)
    [[ $said == "scanheadd: "* ]] || return
    "$head" help --completion bash >"$work/completion" || return
    grep -q '^complete -F _scanheadd scanheadd$' "$work/completion" && ! grep '_scanhead\>\|_scanhead_' "$work/completion"
}

# Both run with a page (--view), which scanheadd serves without the studio's resources.
same_stream() {
    sed 's|^links:.*||' tests/guest/head.yaml >"$work/config.yaml"
    cp tests/guest/room.obj "$work/"
    for program in scanhead scanheadd; do
        "$built/$program" run "$work/config.yaml" --set 'links[0].type=null' --start --frames 1 --duration 0.2 --pace fast --quiet \
            --view --stats "$work/$program.json" >"$work/$program.url" || return
    done
    sed -n '/stream_sha256/p' "$work/scanhead.json" >"$work/hash"
    grep -q '[0-9a-f]\{64\}' "$work/hash" && grep stream_sha256 "$work/scanheadd.json" | diff "$work/hash" -
}

check "scanheadd is linked with the libraries of the head, and no others" libraries
check "nothing of the studio is in it" without_studio
check "its commands, and what it says to others" commands
check "messages, help and pages have its name" name
check "its stream has the bytes of scanhead's" same_stream
echo "1..$tests"
