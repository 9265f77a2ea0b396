#!/bin/sh
# The head as a gadget of the kernel, on a device controller that dummy_hcd makes up, at high and super speed.
. tests/guest/lib.sh
guest_prepare
guest_add tests/guest/head.yaml
guest_add tests/guest/room.obj
guest_add tests/guest/in_usb.sh
guest_boot tests/guest/in_functionfs.sh 110
