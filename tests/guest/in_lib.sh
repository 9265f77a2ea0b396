# Inside the guest: results for the host, as TAP on descriptor 3. Sourced by init before the test's script.
tests=0

module_options() {
    case $1 in
    dummy_hcd.ko) echo "is_super_speed=1" ;;
    esac
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

# check NAME COMMAND...: passes when the command does; else what it wrote is shown.
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

# wait_for SECONDS COMMAND...: until the command succeeds; 1 when it never did.
wait_for() {
    left=$(($1 * 20))
    shift
    while ! "$@" >/dev/null 2>&1; do
        left=$((left - 1))
        [ $left -gt 0 ] || return 1
        usleep 50000
    done
}

# A word to the host; its line back.
ask_host() {
    echo "HOST $*" >&3
    read -r answer <&3
    echo "$answer"
}

# programs of cmocka: their results under our numbers.
tap() {
    "$@" >/tmp/tap.out 2>/tmp/tap.err
    status=$?
    planned=$(sed -n 's/^1\.\.\([0-9]*\).*/\1/p' /tmp/tap.out)
    seen=0 failed=0
    while read -r line; do
        case $line in
        "ok "*) pass "${line#ok * - }" ;;
        "not ok "*) failed=1; fail "${line#not ok * - }" ;;
        "#"*) echo "$line" >&3; continue ;;
        *) continue ;;
        esac
        seen=$((seen + 1))
    done </tmp/tap.out
    [ "$seen" = "$planned" ] && [ $((status != 0)) = $failed ] && return
    fail "$1" "planned ${planned:-none}, seen $seen, exit status $status"
    cat /tmp/tap.out /tmp/tap.err | tail -n 20 | sed 's/^/#   /' >&3
}
