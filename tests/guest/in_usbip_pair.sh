# SPDX-License-Identifier: MIT
# This runs inside the guest: it tests a head that plugs itself in. in_usbip.sh sources it.
head_start "{type: usb, attach: on}" --pace fast
check_enumeration "socket pair" 512
check_record "socket pair"
note "recorded at $(uptime_s) s"
if ! records_only; then
    check_chapter9 "socket pair"
    note "chapter 9 at $(uptime_s) s"
fi
head_stop
check "socket pair: gone with the head" wait_for 10 is_unplugged
records_only && return
head_start "{type: usb, attach: on}" --set head.prr_hz=4000 --set loop.tick_hz=100
wait_for 10 is_plugged
echo "echo 0 >$vhci/detach" >unplug.sh
# The head plugs itself in again, so PLUG has nothing to do.
REPLUGS=$often UNPLUG="sh unplug.sh" PLUG=: tap "socket pair" test_stream
check "socket pair: says that it is back" grep 'plugged in again' /tmp/head.err
note "replugged at $(uptime_s) s"
head_kill
check "socket pair: gone with the killed head" wait_for 10 is_unplugged
cp /usb.yaml .
check "socket pair: a client notices the faults of a bad cable" \
    scanhead soak usb.yaml --scenario /config/faults/flaky-usb.yaml --duration 2 --quiet
note "soaked at $(uptime_s) s"
