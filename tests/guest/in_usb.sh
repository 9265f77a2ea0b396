# Inside the guest: a head on the bus, and what is asked of it. Sourced by the scripts of the tests.

# head_start YAML [OPTION...]: a head with these links, and TCP on 5025 beside them. head_stop ends it.
head_start() {
    sed "\$alinks: [{type: tcp, port: 5025}, $1]" /head.yaml >/tmp/config.yaml
    shift
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

is_plugged() {
    lsusb -d 1209:0001
}

is_unplugged() {
    ! lsusb -d 1209:0001
}

tty_is_there() {
    test -c /dev/ttyACM0
}

# What lsusb shows of the head is what PROTOCOL.md and the class specifications want. $1: the speed's packet size.
check_enumeration() {
    check "$2: enumerated" wait_for 20 is_plugged
    wait_for 10 tty_is_there
    lsusb -v -d 1209:0001 >/tmp/lsusb.txt 2>/tmp/lsusb.err
    check "$2: serial number, maker and product are strings" test "$(grep -c 'iManufacturer  *[1-9][0-9]* [A-Za-z]\|iProduct  *[1-9][0-9]* [A-Za-z]\|iSerial  *[1-9][0-9]* [A-Za-z0-9]' /tmp/lsusb.txt)" = 3
    check "$2: CDC-ACM by an interface association" grep -A 8 'Interface Association' /tmp/lsusb.txt
    check "$2: abstract control model" grep -q 'bInterfaceSubClass *2 ' /tmp/lsusb.txt
    check "$2: vendor interface FF/53/48" grep -A 2 'bInterfaceClass *255 ' /tmp/lsusb.txt
    check "$2: bulk endpoints of $1 bytes" test "$(grep -A 4 'Transfer Type *Bulk' /tmp/lsusb.txt | grep -c "wMaxPacketSize.* 1x $1 bytes")" = 4
    check "$2: the stock driver has made a tty of it" tty_is_there
}

# The recorder: over USB, and through the plain tty.
check_record() {
    check "$1: scanhead list shows it" sh -c "scanhead list | grep '^usb:1209:0001:'"
    check "$1: scanhead record usb" scanhead record usb --wait 10 -o usb.ply --stats usb.json --quiet
    check "$1: scanhead record tty" scanhead record tty:/dev/ttyACM0 --wait 10 -o tty.ply --stats tty.json --quiet
    check "$1: the same stream" test "$(grep sha256 usb.json)" = "$(grep sha256 tty.json)"
}
