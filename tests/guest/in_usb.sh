# SPDX-License-Identifier: MIT
# This runs inside the guest: it puts a head on the bus and asks it things. The tests' scripts source it.
. /often.sh

# head_start YAML [OPTION...]: starts a head with these links, and with TCP on 5025 beside them. head_stop ends it.
head_start() {
    links="{type: tcp, port: 5025}${1:+, $1}"
    shift
    head_start_of head "$links" "$@"
}

# head_start_of NAME YAML [OPTION...]: starts the head of NAME.yaml with just these links.
head_start_of() {
    sed "\$alinks: [$2]" "/$1.yaml" >/tmp/config.yaml
    shift 2
    cp /room.obj /tmp/
    rm -f /tmp/ready
    scanhead run /tmp/config.yaml --ready-fd 9 "$@" 9>/tmp/ready 2>/tmp/head.err &
    head_pid=$!
    wait_for 20 test -s /tmp/ready || note "the head is not ready: $(tail -n 3 /tmp/head.err | tr '\n' ' ')"
}

head_stop() {
    kill "$head_pid"
    wait "$head_pid"
}

head_kill() {
    kill -9 "$head_pid"
    wait "$head_pid" 2>/dev/null
}

# This reads what the kernel shows, in the shell, because lsusb costs an emulated processor a tenth of a second each
# time.
is_plugged() {
    for file in /sys/bus/usb/devices/*/idVendor; do
        ! read -r vendor <"$file" || [ "$vendor" != "${1:-1209}" ] || return 0
    done 2>/dev/null
    return 1
}

is_unplugged() {
    ! is_plugged "$@"
}

tty_is_there() {
    test -c /dev/ttyACM0
}

# check_enumeration PREFIX BYTES: checks that lsusb shows of the head what the class specifications want. BYTES is the
# size of a bulk packet.
check_enumeration() {
    check "$1: enumerated" wait_for 20 is_plugged
    check "$1: the stock driver makes a tty of it" wait_for 10 tty_is_there
    lsusb -v -d 1209:0001 >/tmp/lsusb.txt 2>/tmp/lsusb.err
    check "$1: maker, product and serial number are strings" \
        test "$(grep -c 'i\(Manufacturer\|Product\|Serial\)  *[1-9][0-9]* [A-Za-z0-9]' /tmp/lsusb.txt)" = 3
    check "$1: interface association" grep 'Interface Association' /tmp/lsusb.txt
    check "$1: CDC-ACM" grep 'CDC ACM:' /tmp/lsusb.txt
    grep -A 2 'bInterfaceClass  *255' /tmp/lsusb.txt | awk '{ printf "%s ", $2 }' >/tmp/vendor.txt
    check "$1: vendor interface FF/53/48" grep '255 83 72' /tmp/vendor.txt
    check "$1: four bulk endpoints of $2 bytes" \
        test "$(grep -A 4 'Transfer Type *Bulk' /tmp/lsusb.txt | grep -c "wMaxPacketSize.* 1x $2 bytes")" = 4
    check "$1: lsusb has nothing to say against the capabilities" sh -c "! grep -i 'must-be-set\|invalid' /tmp/lsusb.txt"
    [ -z "${is_gadget:-}" ] || return 0
    check "$1: Microsoft OS 2.0 platform capability" grep -i 'd8dd60df-4589-4cc7-9cd2-659d9e648a9f' /tmp/lsusb.txt
    check "$1: the console takes no AT commands" test "$(sed -n '/bFunctionClass *2 /,/bFunctionProtocol/s/.*Protocol *//p
        /bInterfaceClass *2 /,/bInterfaceProtocol/s/.*bInterfaceProtocol *//p' /tmp/lsusb.txt | cut -c1 | tr -d '\n')" = 00
}

# A run for long scans does no more than record them.
records_only() {
    test -e /records_only
}

sha256_of() {
    sed -n 's/.*"stream_sha256": "\([0-9a-f]*\)".*/\1/p' "$1"
}

# This records the head's two scans over TCP. tcp1 and tcp2 are their hashes, and every other wire must give the same.
record_reference() {
    check "the scans over TCP" scanhead record tcp:127.0.0.1:5025 --stats tcp1.json --quiet
    records_only || scanhead record tcp:127.0.0.1:5025 --stats tcp2.json --quiet
    tcp1=$(sha256_of tcp1.json) tcp2=
    records_only || tcp2=$(sha256_of tcp2.json)
}

# The recorder takes a head's first scan over USB and its second through the plain tty.
check_record() {
    rm -f usb.json tty.json
    check "$1: scanhead list shows it" sh -c "scanhead list | grep '^usb:1209:0001:'"
    check "$1: scanhead record usb" scanhead record usb --wait 1200 -o usb.ply --stats usb.json --quiet
    check "$1: the stream is the same as over TCP" test "$(sha256_of usb.json)" = "$tcp1" -a -n "$tcp1"
    # A tty has no flow control. An emulated processor can be too slow for a head as fast as it computes. Then the
    # kernel's tty buffers (640 KiB) run over and bytes are gone. The loss happens with a million pulses, and never
    # happened with a few thousand.
    if ! records_only; then
        check "$1: scanhead record tty" scanhead record tty:/dev/ttyACM0 --wait 1200 -o tty.ply --stats tty.json --quiet
        check "$1: the stream of the tty is the same as over TCP" test "$(sha256_of tty.json)" = "$tcp2" -a -n "$tcp2"
    fi
    note "$1: $(sed -n 's/.*\("pulses": [0-9]*\),.*/\1/p' usb.json), $(sed -n 's/.*\("wall_s": [0-9.]*\),.*/\1/p' usb.json)"
    check "$1: as many points in the file as pulses" grep "element vertex $(sed -n 's/.*"points": \([0-9]*\).*/\1/p' usb.json)\$" usb.ply
}

# Records only the stream of another head's first scan.
record_again() {
    check "$1: scanhead record usb" scanhead record usb --wait 1200 --stats again.json --quiet
    check "$1: the stream is the same as over TCP" test "$(sha256_of again.json)" = "$tcp1" -a -n "$tcp1"
}

# A recorder that follows a scan says about once a second how far it has come.
has_points() {
    grep -q 'recording: 0\.[0-9]*[1-9]' "$1"
}

# Waits until a recorder's points come. Where they don't, it shows the last words of the recorder and of the head.
points_come() {
    wait_for 20 has_points "$1" && return 0
    tail -n 5 "$1" /tmp/head.err | sed 's/^/#   /' >&3
    return 1
}

# The head is back, and more points have come than before it went.
goes_on() {
    awk '/recording: / { if (!back) before = $3; else if ($3 != before) more = 1 } /is back/ { back = 1 }
         END { exit !more }' "$1"
}

# Scans of the recorders below have no end (--frames 0), because nothing says how long an emulated processor takes to
# reset a bus or to find its head again. A scan of 34 s has ended before that.
#
# One recorder is killed in the middle of a scan. Another one loses its head and ends, and a third one was told to wait
# for the head. The check needs a head in real time, plug.sh and unplug.sh.
check_cut_records() {
    scanhead record usb --wait 1200 --frames 0 -o cut.ply 2>killed.err &
    points_come killed.err
    kill -9 $!
    wait $! 2>/dev/null
    scanhead record --repair cut.ply || rm -f cut.ply.part # the recorder may have written too little within a second
    scanhead record usb --wait 1200 --listen -o cut.ply 2>cut.err &
    client=$!
    check "$1: another recorder after one was killed" points_come cut.err
    sh unplug.sh
    wait $client
    check "$1: exit status 1 when unplugged" test $? = 1
    check "$1: and it says so" grep 'unplugged' cut.err
    check "$1: and what had come is in the file" grep -a 'element vertex [1-9]' cut.ply
    sh plug.sh
    scanhead record usb --wait 1200 --listen --replug 600 -o again.ply --stats again.json 2>again.err &
    client=$!
    points_come again.err
    sh unplug.sh
    wait_for 5 is_unplugged
    sh plug.sh
    check "$1: --replug goes on" wait_for 60 goes_on again.err
    kill -INT $client
    wait $client
    check "$1: exit status 1 when the head was away" test $? = 1
    check "$1: and it says so, once" grep 'disconnected within 1 scans' again.err
    check "$1: with the count" grep '"replugs": 1,' again.json
}

# Another program resets the bus of a recorder. The recorder must not call that an unplugging, and goes on with
# --replug.
check_reset() {
    scanhead record usb --wait 1200 --frames 0 --replug 600 -o reset.ply --stats reset.json 2>reset.err &
    client=$!
    points_come reset.err
    check "$1: reset" usbreset 1209:0001
    check "$1: the recorder goes on after a reset" wait_for 60 goes_on reset.err
    goes_on reset.err || tail -n 20 reset.err /tmp/head.err | sed 's/^/#   /' >&3
    check "$1: and calls it one" grep 'bus was reset' reset.err
    check "$1: not an unplugging" sh -c "! grep unplugged reset.err"
    kill -INT $client
    wait $client
    check "$1: with the count" grep '"bus_resets": 1,' reset.json
    check "$1: and no other" grep '"replugs": 0,' reset.json
    check "$1: the head says so, too" grep 'stays plugged in' /tmp/head.err
}

# check_hokuyo PREFIX YAML: checks a head that shows itself as a Hokuyo. YAML is its link, without type and protocol.
check_hokuyo() {
    head_start_of hokuyo "{type: usb, protocol: scip, $2}"
    check "$1: the stock driver makes a tty of a Hokuyo" wait_for 20 tty_is_there
    tap "$1" test_scip
    check "$1: scanhead list takes no other maker's device for a head" sh -c "scanhead list | grep '^heads on USB: none'"
    head_stop
    check "$1: the Hokuyo is gone with the head" wait_for 10 is_unplugged 15d1
    note "$1: Hokuyo at $(uptime_s) s"
}

# check_sick PREFIX YAML: checks a head that shows itself as a SICK TiM561, which libusb finds. YAML is its link,
# without type and protocol.
check_sick() {
    head_start_of sick "{type: usb, protocol: cola, $2}"
    tap "$1" test_cola
    head_stop
    check "$1: the TiM is gone with the head" wait_for 10 is_unplugged 19a2
    note "$1: TiM at $(uptime_s) s"
}

# check_chapter9 PREFIX: asks what the USB specification wants of a device.
check_chapter9() {
    tap "$1" test_chapter9
    tap "$1" test_chapter9_transfers
}

# check_faults PREFIX YAML: checks how the kernel and the recorder take faults on request. YAML is the link.
# check_faults needs plug.sh.
check_faults() {
    cat >/tmp/faults.yaml <<'END'
faults:
  - {kind: slow_enumeration, at: 1, for_ms: 20}
  - {kind: descriptor_length, at: 1, n: 9}
  - {kind: short_packets, at: 20, n: 10}
  - {kind: endpoint_stall, at: 60}
END
    head_start "$2" --pace fast --scenario /tmp/faults.yaml --truth /tmp/truth.json
    dmesg -c >/dev/null
    sh plug.sh
    check "$1: enumerated, slowly and by a wrong descriptor" wait_for 90 is_plugged
    check "$1: the kernel says that the descriptor is too short" sh -c "dmesg | grep 'descriptor too short'"
    record_again "$1, stalled and in short packets" # the recorder clears the halt; no byte is lost
    for kind in slow_enumeration descriptor_length short_packets endpoint_stall; do
        check "$1: $kind was injected once" \
            wait_for 10 sh -c "test \$(grep -c '\"kind\":\"$kind\"' /tmp/truth.json) = 1"
    done
    head_stop
    wait_for 10 is_unplugged
    cat >/tmp/faults.yaml <<'END'
faults:
  - {kind: usb_reset, at: 100, count: 1}
  - {kind: unplug, at: 200, count: 1, for_ms: 200}
END
    head_start "$2" --set head.prr_hz=4000 --set loop.tick_hz=100 --scenario /tmp/faults.yaml --truth /tmp/truth.json
    sh plug.sh
    scanhead record usb --wait 1200 --frames 0 --replug 600 -o faults.ply --stats faults.json 2>faults.err &
    client=$!
    check "$1: the recorder goes on after a reset on request" wait_for 90 grep 'is back' faults.err
    grep -q 'is back' faults.err || tail -n 20 faults.err truth.json /tmp/head.err | sed 's/^/#   /' >&3
    check "$1: unplugged on request" wait_for 90 grep 'unplugged' faults.err
    wait_for 5 is_unplugged
    check "$1: plugged in again" wait_for 60 sh plug.sh
    check "$1: and the recorder goes on" wait_for 90 sh -c "test \$(grep -c 'is back' faults.err) = 2"
    kill -INT $client
    wait $client
    check "$1: with both counts" sh -c "grep '\"bus_resets\": 1,' faults.json && grep '\"replugs\": 1,' faults.json"
    head_stop
}
