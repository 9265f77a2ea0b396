#!/bin/sh
# SPDX-License-Identifier: MIT
# This runs each scenario of config/faults over usb, on the virtual host controller of a guest: sh tests/guest/soak.sh
# SECONDS [SCENARIO...]. The lines "# FILE NAME TEXT" of its output are the sheets, line by line. tests/soak/soak.sh
# takes them.
. tests/guest/lib.sh
guest_prepare
guest_add tests/guest/room.obj
guest_add tests/soak/usb.yaml
seconds=$1
shift
echo "seconds=$seconds scenarios='$*'" >"$guest_work/root/soak_of.sh"
# Beside the faults the guest needs time to boot, and for each scenario to start and end its scan. Others use the
# processor as well.
guest_boot tests/guest/in_soak.sh $((240 + 7 * (${seconds%.*} + 90)))
