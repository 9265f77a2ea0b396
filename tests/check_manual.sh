#!/bin/bash
# SPDX-License-Identifier: MIT
# Manual pages and the completion for bash have every command, option and key that the help has; man reads the pages without
# a warning, and bash completes commands, options, words, keys, files. Prints TAP. $SCANHEAD: the program.
set -u
program=$(realpath "${SCANHEAD:-build/scanhead}")
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
. tests/tap.sh
pages=$work/pages

make_pages() {
    mkdir "$pages"
    for page in $("$program" help --man list); do
        "$program" help --man "$page" >"$pages/$page" || { echo "no $page"; return 1; }
    done
}

no_warnings() {
    for page in "$pages"/*; do
        # The page as it is read: without marks, and with its lines joined.
        LC_ALL=C.UTF-8 groff -man -Tutf8 -P-c -rLL=1000n -rHY=0 -ww "$page" 2>"$work/said" | col -bx >"$page.txt"
        said=$(cat "$work/said")
        [ -z "$said" ] || { echo "$page: $said"; return 1; }
        grep -q '^NAME' "$page.txt" || { echo "$page: no NAME"; return 1; }
    done
    ls "$pages" | grep -q . # there are pages
}

# Names of options in a help: "  -o, --output FILE".
options_of() {
    "$program" "$@" --help | sed -n 's/^  \(-[a-zA-Z]\)\{0,1\}[, ]* *\(--[a-z0-9-]*\) .*/\1 \2/p'
}
commands_of() {
    "$program" --help | sed -n 's/^  scanhead \([a-z]*\) .*/\1/p'
}

options_are_there() {
    n=0
    for command in $(commands_of) "record --raw"; do
        page=$'\n'$(cat "$pages/scanhead-${command/ --/-}.1.txt")$'\n'
        offered=$(_scanhead_options "${command% *}")
        grep -q "^ *${command% *} .*$" "$pages/scanhead.1.txt" || { echo "scanhead.1: no $command"; return 1; }
        for option in $(options_of $command); do
            n=$((n + 1))
            [[ $page =~ $'\n'\ *(-., )?$option[$' ,\n'] ]] || { echo "$command.1: no $option"; return 1; }
            [[ $command == *raw || " $offered " == *" $option "* ]] ||
                { echo "completion of $command: no $option"; return 1; }
        done
    done
    twice=$(grep ') echo' "$work/completion" | sort | uniq -d)
    [ -z "$twice" ] || { echo "twice in the completion: $twice"; return 1; }
    # There are more than 200 options. With far fewer the help was read wrongly.
    [ $n -gt 150 ] || { echo "only $n options were found"; return 1; }
}

# The texts of options are in the pages, too: the words of the help in their order, whatever the line breaks. The pages
# have no hyphenation (-rHY=0).
texts_are_there() {
    for command in $(commands_of); do
        "$program" "$command" --help | sed '/^Configuration keys:/,$d' | sed -n '/^  /,$p' | tr -s ' \n' '\n\n' |
            grep -v '^$' >"$work/words"
        tr -s ' \n' '\n\n' <"$pages/scanhead-$command.1.txt" | grep -v '^$' >"$work/page"
        missing=$(diff "$work/words" "$work/page" | sed -n 's/^< //p' | tr '\n' ' ')
        # The row of --help itself has other words in the page.
        left=$(echo "$missing" | tr ' ' '\n' | grep . |
            grep -vx 'this\|text\|text,\|or\|only\|that\|part\|-h,\|--help\|\[SECTION\]')
        [ -z "$left" ] || { echo "scanhead-$command.1 lacks: $left"; return 1; }
    done
}

keys_are_there() {
    "$program" check --help | sed -n '/^Configuration keys:/,$p' |
        grep '^[a-z_]*\(\[\]\)\{0,1\}\([.][a-z_]*\(\[\]\)\{0,1\}\)*$' >"$work/keys"
    [ "$(wc -l <"$work/keys")" -gt 200 ] || { echo "only $(wc -l <"$work/keys") keys were found"; return 1; }
    awk 'NR == FNR { page = page $0 "\n"; next }
        !index(page, "       " $0) { print "scanhead.yaml.5: no " $0; bad = 1 }
        END { exit bad }' "$pages/scanhead.yaml.5.txt" "$work/keys"
}

# completes "WORDS BEFORE" WORD EXPECTED...: bash offers these for the last word. Words are split as bash does it.
completes() {
    COMP_WORDS=($1 "$2")
    COMP_CWORD=$((${#COMP_WORDS[@]} - 1))
    shift 2
    _scanhead
    local got="${COMPREPLY[*]-}" want="$*"
    [ "$got" = "$want" ] || { echo "${COMP_WORDS[*]}: got \"$got\", not \"$want\""; return 1; }
}
completions() {
    mkdir -p "$work/files/sub folder" && cd "$work/files" && touch "a b.yaml" c.yaml || return
    completes scanhead re record report && completes scanhead --v --version && completes "scanhead run" --st --start --stats &&
        completes "scanhead run c.yaml --pace" "" realtime fast step && completes "scanhead run --pace =" f fast &&
        completes "scanhead run --pace" = realtime fast step &&
        completes "scanhead record c.yaml --ply-names" c cloudcompare && completes "scanhead batch --crs" u utm &&
        completes "scanhead init --up" "" y z && completes "scanhead map --from" south- south-east south-west &&
        completes "scanhead run --set" loop.p loop.pace= && completes "scanhead run --set loop.pace =" f fast &&
        completes "scanhead run --set head.start =" "" off on &&
        completes "scanhead run --set loop.pace" = realtime fast step &&
        completes "scanhead run --set = loop.pace =" f fast && completes "scanhead batch --sweep" loop.p loop.pace= &&
        completes "scanhead run --set links[3].type =" p pty && completes "scanhead run --set" "links[3].prot" "links[3].protocol=" &&
        completes "scanhead run --set links.3.type =" p pty && completes "scanhead run --set" links.3.prot links.3.protocol= &&
        completes "scanhead run" a "a b.yaml" && completes "scanhead run --stats" c c.yaml &&
        completes "scanhead batch -o" "" "sub folder" && completes "scanhead run --duration" "" &&
        completes "scanhead help" vi view && completes "scanhead check --help" output output &&
        completes "scanhead help --completion" "" bash
}

# The program takes every word that is offered for an option. If it fails, it fails for another reason.
words_are_known() {
    ! "$program" record none.yaml -o x.ply --colour nothing 2>&1 | grep -qv -e "--colour nothing: allowed are" || return
    for pair in run:--pace record:--colour record:--crs record:--ply-names; do
        command=${pair%:*} option=${pair#*:}
        for word in $(_scanhead_value "$command" "$option" | sed 's/^words//'); do
            "$program" "$command" none.yaml -o x.ply "$option" "$word" 2>&1 | grep -e "$option $word: \|: allowed" && return 1
        done
    done
    true
}

help_command() {
    "$program" help >"$work/all" && "$program" --help | cmp - "$work/all" &&
        "$program" help run >"$work/run" && "$program" run --help | cmp - "$work/run" || return
    "$program" help -- | cmp - "$work/all" || return
    for wrong in "help rnu:did you mean run" "help run check:one COMMAND is allowed; check is one too many" "help --man run.1:--man list" "help --completion zsh:allowed is bash" \
        "help --man list --completion bash:one of them" "help --men list:did you mean --man"; do
        said=$("$program" ${wrong%%:*} 2>&1 >/dev/null)
        [ $? = 2 ] && [[ $said == *"${wrong#*:}"* ]] || { echo "${wrong%%:*}: $said"; return 1; }
    done
}

"$program" help --completion bash >"$work/completion" && . "$work/completion"
check "a page for each name of --man list" make_pages
check "help COMMAND, and what is wrong with it" help_command
check "the completion is a script that bash reads" bash -n "$work/completion"
if command -v groff >/dev/null && command -v col >/dev/null; then
    check "groff has no warning" no_warnings
    check "every command and option of the help is in its page and in the completion" options_are_there
    check "and every word of the help" texts_are_there
    check "every key is in scanhead.yaml.5" keys_are_there
else
    tests=$((tests + 1))
    echo "ok $tests - pages are read # SKIP no groff, or no col"
fi
check "bash completes commands, options, words, keys and files" completions
check "the program takes the words that are offered" words_are_known
echo "1..$tests"
