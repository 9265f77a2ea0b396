#!/bin/sh
# The head as a USB/IP server, by TCP with the stock tool.
. tests/guest/lib.sh
guest_prepare
guest_add_head
guest_add tests/guest/in_usbip.sh
guest_boot tests/guest/in_usbip_tcp.sh 600
