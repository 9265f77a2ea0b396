. /in_usbip.sh
head_start "{type: usb, attach: on}" --pace fast
check_enumeration "socket pair" 512
check_record "socket pair"
note "recorded at $(uptime_s) s"
if ! records_only; then
    tap "socket pair" test_chapter9
    note "chapter 9 at $(uptime_s) s"
fi
head_stop
check "socket pair: gone with the head" wait_for 10 is_unplugged
records_only && return
head_start "{type: usb, attach: on, speed: super}" --pace fast
check_enumeration "socket pair, super" 1024
record_again "socket pair, super"
head_stop
note "super at $(uptime_s) s"
# Only the head's own process holds the other end of the pair: killed is unplugged, started again is plugged in.
cat >plug.sh <<'END'
. /in_lib.sh
. /in_usb.sh
head_start "{type: usb, attach: on}" --set head.prr_hz=4000 --set loop.tick_hz=100
END
echo 'kill -9 $(cat /tmp/head.pid)' >unplug.sh
sh plug.sh
REPLUGS=20 UNPLUG="sh unplug.sh" PLUG="sh plug.sh" tap "socket pair" test_stream
note "replugged at $(uptime_s) s"
sh unplug.sh
check "socket pair: gone with the killed head" wait_for 10 is_unplugged
