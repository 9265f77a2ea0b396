note "script starts at $(uptime_s) s"
check "the program runs" scanhead --help
check "vhci is there" test -e /sys/devices/platform/vhci_hcd.0/attach
check "a UDC is there" test -n "$(ls /sys/class/udc)"
check "lsusb lists the root hubs" lsusb
note "$(wc -l </tmp/check.out) root hubs"
check "talks to the host" test "$(ask_host hello)" = "nothing to be had here: hello"
note "script ends at $(uptime_s) s"
