# SPDX-License-Identifier: MIT
# This runs inside the guest: it tests a head that the stock tool plugs in. in_usbip.sh sources it.
head_start "{type: usb}" --pace fast
check "usbip list shows it" sh -c "usbip list -r 127.0.0.1 2>/dev/null | grep 1209:0001"
check "usbip attach" usbip attach -r 127.0.0.1 -b 1-1
check_enumeration "TCP" 512
check_record "TCP"
note "recorded at $(uptime_s) s"
head_stop
check "TCP: gone with the head" wait_for 10 is_unplugged
records_only && return
head_start "{type: usb}" --set head.prr_hz=4000 --set loop.tick_hz=100
echo "echo 0 >$vhci/detach" >unplug.sh
echo "usbip attach -r 127.0.0.1 -b 1-1" >plug.sh
sh plug.sh
check_reset "TCP"
check_cut_records "TCP"
note "cut at $(uptime_s) s"
REPLUGS=$often UNPLUG="sh unplug.sh" PLUG="sh plug.sh" tap "TCP" test_stream
note "replugged at $(uptime_s) s"
head_stop
check_faults "TCP" "{type: usb}"
note "faults at $(uptime_s) s"
check "TCP: gone with the head" wait_for 10 is_unplugged
head_start "{type: usb, speed: full}" --pace fast
sh plug.sh
check_enumeration "TCP, full" 64
record_again "TCP, full"
head_stop
note "full at $(uptime_s) s"
check "TCP, full: gone with the head" wait_for 10 is_unplugged
head_start "{type: usb, attach: on, speed: super}" --pace fast
check_enumeration "socket pair, super" 1024
record_again "socket pair, super"
head_stop
note "super at $(uptime_s) s"
check "socket pair, super: gone with the head" wait_for 10 is_unplugged
check_hokuyo "socket pair, full" "attach: on, speed: full"
check_sick "socket pair, full" "attach: on, speed: full"
