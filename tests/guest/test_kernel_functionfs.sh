#!/bin/sh
# SPDX-License-Identifier: MIT
# This tests the head as a gadget of the kernel, at high and then at super speed. dummy_hcd makes up the device
# controller.
. tests/guest/lib.sh
guest_prepare
guest_add_head
guest_add tests/guest/in_functionfs_at.sh
guest_boot tests/guest/in_functionfs.sh 600
