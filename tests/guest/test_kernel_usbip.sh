#!/bin/sh
# SPDX-License-Identifier: MIT
# This tests the head on the guest's virtual host controller: first by socket pair and without any tool, then as a
# USB/IP server, by TCP with the stock tool.
. tests/guest/lib.sh
guest_prepare
guest_add_head
guest_add tests/guest/in_usbip_pair.sh
guest_add tests/guest/in_usbip_tcp.sh
guest_add tests/soak/usb.yaml
guest_boot tests/guest/in_usbip.sh 600
