# SPDX-License-Identifier: MIT
# Functions for scripts that print TAP. A script sources it with the folder $work, and ends with the plan: echo
# "1..$tests".
tests=0

# check NAME COMMAND...: passes when the command succeeds; else it shows the command's output.
check() {
    tests=$((tests + 1))
    name=$1
    shift
    if "$@" >"$work/out" 2>&1; then
        echo "ok $tests - $name"
    else
        echo "not ok $tests - $name"
        tail -n 20 "$work/out" | cut -c -300 | sed 's/^/# /'
    fi
}
