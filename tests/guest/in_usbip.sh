. /in_usb.sh
export CONSOLE=/dev/ttyACM0
load vhci-hcd
load cdc-acm
vhci=/sys/devices/platform/vhci_hcd.0
# Seven of its eight controllers only cost time: each look at the bus reads their hubs too.
for i in 1 2 3 4 5 6 7; do echo vhci_hcd.$i >/sys/bus/platform/drivers/vhci_hcd/unbind; done
note "starts at $(uptime_s) s"
head_start "" --pace fast
record_reference
head_stop
note "reference at $(uptime_s) s"

head_start "{type: usb, attach: on}" --pace fast
check_enumeration "socket pair" 512
check_record "socket pair"
note "recorded at $(uptime_s) s"
if ! records_only; then
    tap "socket pair" test_stream
    note "streamed at $(uptime_s) s"
    tap "socket pair" test_chapter9
    note "chapter 9 at $(uptime_s) s"
fi
head_stop
check "socket pair: gone with the head" wait_for 10 is_unplugged

head_start "{type: usb}" --pace fast
check "usbip list shows it" sh -c "usbip list -r 127.0.0.1 2>/dev/null | grep 1209:0001"
check "usbip attach" usbip attach -r 127.0.0.1 -b 1-1
check_enumeration "TCP" 512
check_record "TCP"
note "recorded at $(uptime_s) s"
head_stop
check "TCP: gone with the recorded head" wait_for 10 is_unplugged
records_only && return
head_start "{type: usb}" --set head.prr_hz=4000
echo "echo 0 >$vhci/detach" >unplug.sh
echo "usbip attach -r 127.0.0.1 -b 1-1" >plug.sh
sh plug.sh
note "plugged at $(uptime_s) s"
check_cut_records "TCP"
note "cut at $(uptime_s) s"
REPLUGS=20 UNPLUG="sh unplug.sh" PLUG="sh plug.sh" tap "TCP" test_stream
note "replugged at $(uptime_s) s"
head_stop
check "TCP: gone with the head" wait_for 10 is_unplugged
