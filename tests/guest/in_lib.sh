# SPDX-License-Identifier: MIT
# This runs inside the guest: it reports results to the host, as TAP on descriptor 3. init sources it before the test's
# script.
tests=0

# load MODULE [OPTION...]: loads the module with the modules that it needs.
load() {
    module=$1
    shift
    while read -r part; do
        [ ! -e "/sys/module/$(echo "$part" | tr - _)" ] || continue
        if [ "$part" = "$module" ]; then insmod "/modules/$part.ko" "$@"; else insmod "/modules/$part.ko"; fi ||
            note "cannot load $part"
    done <"/modules/$module.order"
}

note() {
    echo "# $*" >&3
}

uptime_s() {
    cut -d' ' -f1 /proc/uptime
}

# pass NAME / fail NAME [WHY]
pass() {
    tests=$((tests + 1))
    echo "ok $tests - $1" >&3
}

fail() {
    tests=$((tests + 1))
    [ $# -lt 2 ] || note "$2"
    echo "not ok $tests - $1" >&3
}

# check NAME COMMAND...: passes when the command succeeds. Otherwise it shows what the command wrote.
check() {
    name=$1
    shift
    if "$@" >/tmp/check.out 2>&1; then
        pass "$name"
    else
        fail "$name" "exit status $?: $*"
        tail -n 20 /tmp/check.out | sed 's/^/#   /' >&3
    fi
}

# wait_for SECONDS COMMAND...: waits until the command succeeds, and returns 1 if it never did. wait_for allows ten
# times as long, because a guest shares its processor with other tests. Only a command that never succeeds takes that
# long. Each look starts two processes, which are slow here, so it looks only ten times a second.
wait_for() {
    left=$(($1 * 100))
    shift
    while ! "$@" >/dev/null 2>&1; do
        left=$((left - 1))
        [ $left -gt 0 ] || return 1
        usleep 100000
    done
}

# Sends words to the host and prints the line that comes back.
ask_host() {
    echo "HOST $*" >&3
    read -r answer <&3
    echo "$answer"
}

# tap PREFIX PROGRAM...: runs a cmocka program and gives its results numbers of ours. Results that it skips are left
# out.
tap() {
    prefix=$1
    shift
    CMOCKA_MESSAGE_OUTPUT=TAP "$@" >/tmp/tap.out 2>/tmp/tap.err
    status=$?
    planned=$(sed -n 's/^1\.\.\([0-9]*\).*/\1/p' /tmp/tap.out)
    seen=0 failed=0
    while read -r line; do
        case $line in
        "ok "*) pass "$prefix: ${line#ok * - }" ;;
        "not ok "*"# SKIP"*) ;;
        "not ok "*) failed=1; fail "$prefix: ${line#not ok * - }" ;;
        "1.."* | "# ok - "* | "# not ok - "*) continue ;;
        *) note "${line#\# }"; continue ;;
        esac
        seen=$((seen + 1))
    done </tmp/tap.out
    [ $failed = 0 ] || { tail -n 10 /tmp/tap.err /tmp/head.err; dmesg | tail -n 10; } 2>&1 | sed 's/^/#   /' >&3
    [ "$seen" = "$planned" ] && [ $((status != 0)) = $failed ] && return
    fail "$prefix: $1" "planned ${planned:-none}, seen $seen, exit status $status"
    cat /tmp/tap.out /tmp/tap.err | tail -n 20 | sed 's/^/#   /' >&3
}
