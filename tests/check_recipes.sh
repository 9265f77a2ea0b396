#!/bin/bash
# SPDX-License-Identifier: MIT
# The documents' recipes, run as they stand, and their links. Prints TAP. $SCANHEAD: the program of the build under test.
#
#   check_recipes.sh [DOCUMENT...]      default: every .md below the root of the tree
#
# The word after a fenced block's language says what is done with it:
#
#   sh run                      run by `sh -eu`; it must exit 0 within the time limit
#   sh run with PROGRAM         the same, where PROGRAM is installed; else skipped
#   sh run until Ctrl-C         run by `bash -eu`; at its first line on standard output it is interrupted; it must exit 0
#   sh not run: REASON          not run; REASON is for the reader: root, a board, another machine, minutes
#   c as build/NAME.c           saved under that name, and compiled against the library's header
#   yaml as build/NAME.yaml     saved under that name, and checked by `scanhead check`
#
# (c and yaml take `not run: REASON`, too.) A block of these languages without such a word fails, and so does a
# block without a language, or an indented one that begins with a command. Other languages (text, csv) are free.
# The blocks of a document share a folder that looks like the checkout after `make`; each document has a new one. In
# that folder the ready configurations have fewer pulses, and turn faster: the same recipe in a fraction of the time.
# The heads of demo.yaml and glass.yaml have single rays, as the plan would choose (wire/test_plan): the choice takes up
# to 1 s of processor time a run. Only recipes of core/plan make it. Assimp reads the house, except in the top
# README.md: the other readers take 3 s of processor time. With THOROUGH=1 configurations stay as they are.
# First the script is tried on planted documents, whose failures are known.
set -u

limit_s=${RECIPE_LIMIT_S:-180}
root=$(cd "$(dirname "$0")/.." && pwd)
program=$(realpath "${SCANHEAD:-$root/build/scanhead}")
work=$(mktemp -d) || exit 1
block= by_hand=
trap '[ -z "$block" ] || kill -- "-$block" 2>/dev/null; rm -rf "$work"' EXIT
trap 'exit 130' INT TERM
n=0 failed=0

report() { # ok? name [diagnostics]
    n=$((n + 1))
    [ "$1" = 0 ] && echo "ok $n - $2" && return
    echo "not ok $n - $2"
    [ -z "$3" ] || printf '%s\n' "$3" | tail -n 30 | sed 's/^/# /'
    failed=1
}

# Splits the document $1: each fenced block to a file $2/N, and of each a line `N LINE INFO` to standard output. What
# can't be told apart is a line `- LINE what is wrong`.
split='
    function begins_a_command(text) { return text ~ /^(\$ |(build\/|\.\/)[a-z]|(sudo|make|cc|gcc|cp|kill|exec|echo) )/ }
    !open && /^[ \t]*(```|~~~)/ {
        open = NR; fence = $0; sub(/^[ \t]*/, "", fence); info = fence; fence = substr(fence, 1, 3)
        sub(/^[`~]+[ \t]*/, "", info); file = folder "/" ++count; printf "" >file
        if (info == "") print "- " NR " a block without a language; write ```text, or say what is to be run"
        else print count " " NR " " info
        next
    }
    open { text = $0; sub(/^[ \t]*/, "", text); if (index(text, fence) == 1) { open = 0; close(file) } else print >file; next }
    /^(    |\t)/ && blank { text = $0; sub(/^[ \t]*/, "", text); if (begins_a_command(text)) print "- " NR " an indented command; fence it" }
    { blank = /^[ \t]*$/ }
    END { if (open) print "- " open " a block without an end" }'

# lighten DOCUMENT: its configurations cost less. A change that finds no line is an error: the key has a new value.
lighten() {
    replace demo 'prr_hz: 600000' 'prr_hz: 100000'
    replace demo 'pan_deg_s: 80' 'pan_deg_s: 150'
    replace car 'prr_hz: 300000' 'prr_hz: 100000'
    replace foliage 'pan_deg_s: 30' 'pan_deg_s: 90'
    [ "$1" = README.md ] || sed -i 's/^scene:$/&\n  ifc_reader: assimp/' $(grep -l '\.ifc' "$work/tree/config"/*.yaml)
    case $1 in
    core/plan/*) sed -i '/^  - name: north-east$/,/heading_deg: 0$/d' "$work/tree/config/demo.yaml" ;; # a plan of one station
    *) replace demo 'mode: auto' 'mode: single' && replace glass 'mode: auto' 'mode: single' ;;
    esac
}

replace() { # CONFIGURATION LINE LINE
    local file=$work/tree/config/$1.yaml
    if ! grep -q "^  $2\$" "$file"; then
        echo "Bail out! config/$1.yaml has no line \`$2\` to lighten"
        exit 1
    fi
    sed -i "s/^  $2\$/  $3/" "$file"
}

# A folder that looks like the checkout after make; what recipes write stays in it.
checkout() { # document
    rm -rf "$work/tree"
    mkdir -p "$work/tree/build"
    cp -r "$root/config" "$work/tree/"
    [ "${THOROUGH:-}" = 1 ] || lighten "$1"
    ln -s "$root/core" "$root/drivers" "$root/tests" "$work/tree/"
    ln -s "$program" "$(dirname "$program")/libscanhead.a" "$work/tree/build/"
}

# within COMMAND...: runs a command in the checkout, within the limit, in a group of its own that ends with it. The
# command's output goes to $work/out.
within() {
    : >"$work/out"
    set -m
    (cd "$work/tree" && exec timeout -k 5 "$limit_s" "$@") >"$work/out" 2>"$work/err" </dev/null &
    block=$!
    set +m
    [ -z "$by_hand" ] || interrupt "$block"
    wait "$block"
    local status=$?
    kill -- "-$block" 2>/dev/null
    block=
    cat "$work/err" >>"$work/out"
    [ $status -ne 124 ] || echo "did not end within $limit_s s" >>"$work/out"
    return $status
}

# interrupt PID: interrupts the whole group, as Ctrl-C does, once there is a line on standard output. A group that ends,
# or prints nothing within the limit, isn't interrupted.
interrupt() {
    until [ -s "$work/out" ]; do
        kill -0 "$1" 2>/dev/null || return 0
        sleep 0.05
    done
    kill -INT -- "-$1" 2>/dev/null
}

# save FILE WHERE: saves it where a recipe looks for it, which may only be in build/.
save() {
    echo "$2: not a name in build/" >"$work/out"
    [[ $2 =~ ^build/[A-Za-z0-9_.-]+$ ]] && cp "$1" "$work/tree/$2"
}

# do_block FILE INFO: returns 0 when the block does what its mark promises; else the reason is in $work/out.
do_block() {
    local language=${2%% *} mark=${2#* }
    [ "$language" != "$2" ] || mark=
    echo "no mark: write \`$language run\` or \`$language not run: REASON\`" >"$work/out"
    case $language/$mark in
    */"not run: "?*) return 0 ;;
    sh/run) within sh -eu "$1" ;;
    sh/"run until Ctrl-C") by_hand=1 within bash -eu "$1" ;;
    sh/"run with "?*) command -v "${mark#run with }" >/dev/null && within sh -eu "$1" ;;
    c/"as build/"?*) save "$1" "${mark#as }" && within cc -Wall -Wextra -Werror -fsyntax-only -Idrivers/host "${mark#as }" ;;
    yaml/"as build/"?*) save "$1" "${mark#as }" && within build/scanhead check "${mark#as }" ;;
    sh/* | bash/* | shell/* | console/* | c/* | yaml/* | */run | */not*) return 1 ;;
    esac
}

# The anchors of the document $1: its headings in lower case, blanks as hyphens, without other marks.
anchors() {
    awk '/^[ \t]*(```|~~~)/ { fenced = !fenced }
        !fenced && /^#+ / { sub(/^#+ /, ""); text = tolower($0); gsub(/[^a-z0-9 _-]/, "", text); gsub(/ /, "-", text); print text }' "$1"
}

# Links of the document $1 to files that aren't there, and to headings that aren't.
dead_links() {
    local link file
    grep -oE '\]\([^): ]+' "$1" | sed 's/^](//' | while read -r link; do
        file=$1
        [[ $link == '#'* ]] || file=$(dirname "$1")/${link%%#*}
        [ -e "$file" ] && { [[ $link != *'#'* ]] || anchors "$file" | grep -qxF -e "${link#*#}"; } || echo "$link"
    done
}

# runs_here PROGRAM: returns whether it is installed; if not, the reason is in $lacks.
runs_here() {
    lacks="$1 is not installed"
    command -v "$1" >/dev/null || return 1
    lacks="tshark from 4.4 on runs no Lua for root"
    [ "$1" != tshark ] || [ "$(id -u)" != 0 ] || ! tshark -v 2>/dev/null | awk -F'[ .]' '
        NR == 1 { for (i = 1; i < NF; i++) if ($i ~ /^[0-9]+$/) exit !($i > 4 || ($i == 4 && $(i + 1) >= 4)) }'
}

# There is one test for each block with a mark, one that all blocks have a mark, and one of the document's links.
check_document() { # document, as it is called
    local number line info dead unmarked=
    rm -rf "$work/blocks"
    mkdir "$work/blocks"
    checkout "$2"
    while read -r number line info <&3; do
        if [ "$number" = - ]; then
            unmarked+="$2:$line: $info"$'\n'
        elif [[ $info == *' run with '* ]] && ! runs_here "${info#* run with }"; then
            n=$((n + 1))
            echo "ok $n - $2:$line # SKIP $lacks"
        elif [[ $info == *' '* ]]; then
            do_block "$work/blocks/$number" "$info"
            report $? "$2:$line: $info" "$(tr -d "\0" <"$work/out")"
        elif ! do_block "$work/blocks/$number" "$info"; then
            unmarked+="$2:$line: $(cat "$work/out")"$'\n'
        fi
    done 3< <(awk -v folder="$work/blocks" "$split" "$1")
    [ -z "$unmarked" ]
    report $? "$2: each block says what is done with it" "$unmarked"
    dead=$(dead_links "$1")
    [ -z "$dead" ]
    report $? "$2: its links lead to files and headings" "$dead"
}

# expect HOW_MANY_FAIL NAME LINE...: that many tests of a planted document fail.
expect() {
    printf '%s\n' "${@:3}" >"$work/planted.md"
    local found wanted=$1
    found=$(n=0; check_document "$work/planted.md" planted)
    [ "$(grep -c '^not ok' <<<"$found")" = "$wanted" ]
    report $? "planted: $2" "$found"
}

limit_s=60 # 2 s where a command does not end
expect 0 'a good document' '```sh run' 'echo 1 >build/a' '```' '```sh run' 'grep 1 build/a' '```' '```sh not run: root' 'false' '```' \
    '```c as build/a.c' 'int main(void) { return 0; }' '```' '```sh run' 'cc build/a.c -o build/a; build/a' '```' '```text' 'x' '```'
expect 0 'a program that is there' '```sh run with true' 'true' '```'
expect 0 'a program that is not there' '```sh run with no-such-program' 'false' '```'
interrupted="trap 'exit 0' INT; echo here; while :; do sleep 0.1; done"
expect 0 'a command that Ctrl-C ends' '```sh run until Ctrl-C' "$interrupted" '```'
expect 1 'a command that Ctrl-C breaks' '```sh run until Ctrl-C' 'echo here; sleep 60' '```'
limit_s=2 expect 1 'a command that says nothing until Ctrl-C' '```sh run until Ctrl-C' 'sleep 60' '```'
expect 1 'a program that is there, and a command that fails' '```sh run with true' 'false' '```'
expect 1 'a command that fails' '```sh run' 'false' 'true' '```'
limit_s=2 expect 1 'a command that does not end' '```sh run' 'sleep 60' '```'
expect 1 'a variable that nobody sets' '```sh run' 'echo "$nobody"' '```'
expect 1 'shell without a mark' '```sh' 'true' '```'
expect 1 'shell that is not run, without a reason' '```sh not run:' 'true' '```'
expect 1 'shell with a mark that nobody knows' '```sh later' 'true' '```'
expect 1 'a block without a language' '```' 'true' '```'
expect 1 'a command that is indented' 'So:' '' '    build/scanhead list'
expect 1 'a block without an end' '```text' 'x'
expect 1 'C that does not compile' '```c as build/a.c' 'int main(void) { return x; }' '```'
expect 1 'a configuration that is wrong' '```yaml as build/a.yaml' 'head: {profile: none}' '```'
expect 1 'a link to a file that is not there' 'See [here](nothing.md).'
expect 0 'a link to a heading' '## Ports, `tcp` and others' 'See [here](#ports-tcp-and-others).'
expect 1 'a link to a heading that is not there' '```text' '# nothing' '```' 'See [here](#nothing).'
expect 1 'a file outside of build' '```c as ../a.c' 'int a;' '```'
limit_s=${RECIPE_LIMIT_S:-180}

if [ $# -eq 0 ]; then
    while read -r document; do set -- "$@" "$document"; done < <(cd "$root" &&
        find . \( -name .git -o -name 'build*' -o -name node_modules \) -prune -o -name '*.md' -print | sed 's|^\./||' | LC_ALL=C sort)
    cd "$root" || exit 1
fi
for document; do check_document "$document" "$document"; done
echo "1..$n"
exit $failed
