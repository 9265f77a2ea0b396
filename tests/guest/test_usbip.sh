#!/bin/sh
# The head as a USB/IP server: by socket pair to the kernel's virtual host controller, and by TCP with the stock tool.
. tests/guest/lib.sh
guest_prepare
guest_add_head
guest_boot tests/guest/in_usbip.sh 240
