. /in_usb.sh
note "starts at $(uptime_s) s"
head_start "{type: usb, attach: on}" --pace fast
check_enumeration 512 "socket pair"
note "enumerated at $(uptime_s) s"
check_record "socket pair"
note "recorded at $(uptime_s) s"
export CONSOLE=/dev/ttyACM0 TCP=tcp:127.0.0.1:5025
tap test_stream
note "streamed at $(uptime_s) s"
tap test_chapter9
note "chapter 9 at $(uptime_s) s"
head_stop
check "gone with the head" wait_for 10 is_unplugged
