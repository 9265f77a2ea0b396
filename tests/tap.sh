# SPDX-License-Identifier: MIT
# For scripts that print TAP; to be sourced, with the folder $work. It ends with the plan: echo "1..$tests".
tests=0

# check NAME COMMAND...: passes when the command does; else what it wrote is shown.
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
