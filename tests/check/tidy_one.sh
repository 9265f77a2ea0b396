#!/bin/sh
# SPDX-License-Identifier: MIT
# This prints the findings of clang-tidy in one file, as lines `FILE:LINE: TEXT [CHECK]`: sh tests/check/tidy_one.sh
# FILE CACHE FLAGS... CACHE is a folder. If a file and everything that it includes are unchanged, it is not looked at
# again.
set -u
file=$1 cache=$2
shift 2
# The analyzer follows all ways through a function. The other checks are those that find faults, not tastes.
checks='-*,clang-analyzer-*,-clang-analyzer-security.insecureAPI.DeprecatedOrUnsafeBufferHandling,-clang-analyzer-optin.performance.*'
checks="$checks,bugprone-infinite-loop,bugprone-not-null-terminated-result,bugprone-posix-return,bugprone-signal-handler"
checks="$checks,bugprone-string-literal-with-embedded-nul,bugprone-suspicious-memset-usage,bugprone-suspicious-semicolon"
checks="$checks,bugprone-suspicious-string-compare,bugprone-terminating-continue,bugprone-too-small-loop-variable"
checks="$checks,bugprone-redundant-branch-condition,bugprone-spuriously-wake-up-functions,bugprone-unused-return-value"
checks="$checks,bugprone-bad-signal-to-kill-thread,bugprone-suspicious-realloc-usage"
for name in sh_fail sh_fail_stopped text_fail build_fail ply_fail; do
    ! grep -q "^int $name(" "$file" || set -- "$@" "-DDEFINES_$name"
done
case $file in core/import/*/*) ;; core/scene/* | core/import/*) set -- "$@" -DIN_SCENE ;; esac
case $file in *.cpp) ;; *) set -- "$@" -include tests/check/analyzer.h ;; esac # the header has C in it
set -- "$@" -w
key=$({ echo "$checks"; clang -E -C "$@" "$file"; } | sha256sum | cut -c 1-40)
if [ ! -e "$cache/$key" ]; then
    clang-tidy --quiet --checks="$checks" "$file" -- "$@" >"$cache/$key.new" 2>"$cache/$key.err"
    status=$?
    grep -q 'error: ' "$cache/$key.new" && status=1 # clang-tidy could not compile the file
    if [ $status != 0 ] && ! grep -q 'warning: ' "$cache/$key.new"; then
        echo "$file:1: clang-tidy failed: $(grep -h -m 1 'error' "$cache/$key.new" "$cache/$key.err") [failed]"
        rm -f "$cache/$key.new" "$cache/$key.err"
        exit 1
    fi
    sed -n "s|^$PWD/||; s|^\([^ :]*:[0-9]*\):[0-9]*: warning: |\1: |p" "$cache/$key.new" | sort -u >"$cache/$key.tmp"
    mv "$cache/$key.tmp" "$cache/$key"
    rm -f "$cache/$key.err" # KEY.new stays, with the way to each finding
fi
cat "$cache/$key"
