# SPDX-License-Identifier: MIT
# This runs inside the guest: it tests a head on the host that usbredir plugs into the guest. init sources it.
. /in_usb.sh
. /hashes.sh
export CONSOLE=/dev/ttyACM0
load xhci-pci
load cdc-acm
check "nothing is plugged in" is_unplugged
ask_host start --pace fast >/dev/null
check_enumeration "usbredir" 512
check_record "usbredir"
note "recorded at $(uptime_s) s"
records_only && return
check_chapter9 "usbredir"
note "chapter 9 at $(uptime_s) s"
ask_host stop >/dev/null
check "usbredir: gone with the head" wait_for 10 is_unplugged
ask_host start_super --pace fast >/dev/null
check_enumeration "usbredir, super" 1024
record_again "usbredir, super"
ask_host stop >/dev/null
note "super at $(uptime_s) s"
ask_host start_sick >/dev/null
PATIENT=1 tap "usbredir" test_cola
ask_host stop >/dev/null
note "TiM at $(uptime_s) s"
# Each time the process is killed while the stream flows, and another process takes its place.
ask_host start --set head.prr_hz=4000 --set loop.tick_hz=100 >/dev/null
check "usbredir: plugged in again" wait_for 10 is_plugged
echo ". /in_lib.sh; ask_host kill >/dev/null" >unplug.sh
echo ". /in_lib.sh; ask_host start --set head.prr_hz=4000 --set loop.tick_hz=100 >/dev/null" >plug.sh
REPLUGS=$often UNPLUG="sh unplug.sh" PLUG="sh plug.sh" tap "usbredir killed" test_stream
note "killed at $(uptime_s) s"
