#!/bin/bash
# SPDX-License-Identifier: MIT
# The page takes the texts of a head as text, never as HTML or as a program, and loads nothing from elsewhere. A hostile
# head may send any name of a surface, error or reply. Prints TAP.
set -u
cd "$(dirname "$0")/.." || exit 1
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
. tests/tap.sh

# none PATTERN FILE...: prints each place where it is found.
none() {
    ! grep -n -E -- "$@"
}
html='innerHTML|outerHTML|insertAdjacentHTML|document\.write|createContextualFragment|DOMParser|srcdoc|setHTML'
program='\beval\(|new Function|set(Timeout|Interval)\( *['"'\"\`"']|javascript:|\bon[a-z]+ *= *"|setAttribute\( *['"'\"\`"']on'
elsewhere='(src|href|import|from|fetch|url)[ =("'"'"']*(https?:)?//'
files=$(ls drivers/link/web/*.js drivers/link/web/*.html drivers/link/web/*.css)

echo 'row.innerHTML = name; setTimeout("x()", 1); <script src="https://a.example/x.js">' >"$work/bad.js"
finds() { ! none "$1" "$work/bad.js"; }
check "HTML would be seen" finds "$html"
check "a program made of text would be seen" finds "$program"
check "what is loaded from elsewhere would be seen" finds "$elsewhere"
check "no text becomes HTML" none "$html" $files
check "no text becomes a program" none "$program" $files
check "nothing is loaded from elsewhere" none "$elsewhere" $files
echo "1..$tests"
