#!/bin/sh
# The head as a gadget of the kernel at high speed, on a device controller that dummy_hcd makes up.
. tests/guest/lib.sh
guest_prepare
guest_add_head
echo "speed=high" >"$guest_work/root/speed.sh"
guest_boot tests/guest/in_functionfs.sh 600
