#!/bin/sh
# SPDX-License-Identifier: MIT
# The head as a gadget of the kernel at high and then at super speed, on a device controller that dummy_hcd makes up.
. tests/guest/lib.sh
guest_prepare
guest_add_head
guest_add tests/guest/in_functionfs_at.sh
guest_boot tests/guest/in_functionfs.sh 600
