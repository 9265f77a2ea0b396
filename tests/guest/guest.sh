#!/bin/bash
# SPDX-License-Identifier: MIT
# This runs all guest tests as one TAP program, and prints their results one after the other. `tests/guest/guest.sh
# usbip` runs one of them.
#
# A guest has one processor and waits for its bus half of the time. So one more guest runs at a time than this machine
# has processors, those that take longest first. If all run at once, they only make each other late.
. tests/guest/lib.sh
guest_prepare
export GUEST_KERNEL="$kernel"

at_a_time=$(($(getconf _NPROCESSORS_ONLN) + 1))
longest="usbip functionfs usbredir"
if [ $# -eq 0 ]; then
    set -- $longest
    for script in tests/guest/test_kernel_*.sh; do
        name=$(basename "$script" .sh)
        case " $longest " in *" ${name#test_kernel_} "*) ;; *) set -- "$@" "${name#test_kernel_}" ;; esac
    done
fi
declare -A running=() # maps each process to the name of its guest
trap 'kill "${!running[@]}" 2>/dev/null || :' EXIT
status=0

wait_one() {
    local process
    wait -n -p process "${!running[@]}" || status=$?
    unset "running[$process]"
}

for name; do
    [ ${#running[@]} -lt $at_a_time ] || wait_one
    sh "tests/guest/test_kernel_$name.sh" >"$guest_cache/$name.tap" 2>"$guest_cache/$name.err" &
    running[$!]=$name
done
while [ ${#running[@]} -gt 0 ]; do wait_one; done
for name; do
    echo "# $name"
    cat "$guest_cache/$name.tap"
    sed "s/^/# /" "$guest_cache/$name.err"
done
exit $status
