#!/bin/sh
# SPDX-License-Identifier: MIT
# This runs one test program under an emulator, for run_tap.sh: sh tests/machines/emulated.sh PROGRAM EMULATOR... A
# program that isn't done within $LIMIT_S seconds of processor time, and had no failure until then, is skipped and says
# so.
# The lines below name programs that can't run under an emulator, each with the reason:
# not emulated: test_functionfs QEMU's user mode has none of the kernel's asynchronous I/O (io_setup)
# not emulated: test_functionfs_whole QEMU's user mode has none of the kernel's asynchronous I/O (io_setup)
# not emulated: test_ifc_stubs QEMU's user mode keeps limits of address space from the kernel (RLIMIT_AS)
# not emulated: test_import_apart QEMU's user mode keeps limits of address space from the kernel (RLIMIT_AS)
# not emulated: test_late QEMU's user mode keeps limits of address space from the kernel (RLIMIT_AS)
# not emulated: test_link_baud QEMU's user mode has no rates of a terminal but the old ones (TCGETS2)
# not emulated: test_link_cable QEMU's user mode has no IP_MINTTL, by which a cable is drawn
# not emulated: test_link_udp QEMU's user mode takes the number of an interface for another one (IP_ADD_MEMBERSHIP)
# not emulated: test_stamped QEMU's user mode takes the number of an interface for another one (IP_ADD_MEMBERSHIP)
# not emulated: test_web_socket QEMU's user mode has no IP_MINTTL, by which a cable is drawn
# not emulated: test_verdict_client the processes that its client leaves are those of QEMU
# not emulated: test_limit it starts itself again, and nothing here starts QEMU for it
# not emulated: test_config_shared /proc/self/exe is QEMU there
program=$1
shift
why=$(sed -n "s/^# not emulated: $(basename "$program") //p" "$0")
[ -z "$why" ] || { echo "1..0 # SKIP $why"; exit 0; }
out=$(mktemp) || exit 1
trap 'rm -f "$out"' EXIT
(ulimit -S -t "$LIMIT_S" && exec "$@" "$program") >"$out"
status=$?
# The program was ended by SIGXCPU, or killed.
if { [ $status -eq 152 ] || [ $status -eq 137 ]; } && ! grep -q '^not ok' "$out"; then
    echo "1..0 # SKIP more than $LIMIT_S s under the emulator; $(grep -c '^ok' "$out") of its tests passed until then"
    exit 0
fi
cat "$out"
exit $status
