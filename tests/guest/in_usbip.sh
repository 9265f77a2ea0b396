# SPDX-License-Identifier: MIT
# This runs inside the guest: it tests the kernel's virtual host controller, without a tool and with the stock tool.
# init sources it.
. /in_usb.sh
export CONSOLE=/dev/ttyACM0
load vhci-hcd
load cdc-acm
vhci=/sys/devices/platform/vhci_hcd.0
# Seven of its eight controllers only cost time, because each look at the bus reads their hubs too.
for i in 1 2 3 4 5 6 7; do echo vhci_hcd.$i >/sys/bus/platform/drivers/vhci_hcd/unbind; done
head_start "" --pace fast
record_reference
head_stop
note "reference at $(uptime_s) s"
. /in_usbip_pair.sh
. /in_usbip_tcp.sh
