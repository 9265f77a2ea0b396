#!/bin/sh
# The head as a gadget of the kernel, on a device controller that dummy_hcd makes up, at high and super speed.
. tests/guest/lib.sh
guest_prepare
guest_add_head
guest_boot tests/guest/in_functionfs.sh 240
