#!/bin/sh
# SPDX-License-Identifier: MIT
# This tests the head as a device of a virtual machine. The head's process runs on the host, and usbredir connects the
# two. The guest says when the process is to be killed and started again.
. tests/guest/lib.sh
guest_prepare
guest_add_head

head_pid=
tcp_port=
speed=high
name=head
protocol=native

# head_start [OPTION...]: starts the head on the host and sets tcp_port.
head_start() {
    rm -f "$guest_work/ready"
    sed "\$alinks: [{type: tcp, port: 0}, {type: usb, protocol: $protocol, backend: usbredir, path: usb, serial: SIM-0001, speed: $speed}]" \
        "$guest_work/root/$name.yaml" >"$guest_work/config.yaml"
    cp tests/guest/room.obj "$guest_work/"
    "$guest_scanhead" run "$guest_work/config.yaml" --ready-fd 9 "$@" 9>"$guest_work/ready" 2>>"$guest_work/head.err" \
        3<&- 4<&- </dev/null >/dev/null &
    head_pid=$!
    left=100
    while [ ! -s "$guest_work/ready" ] && [ $left -gt 0 ]; do
        sleep 0.05
        left=$((left - 1))
    done
    tcp_port=$(sed -n 's/.*tcp:127\.0\.0\.1:\([0-9]*\).*/\1/p' "$guest_work/ready")
}

head_end() {
    [ -n "$head_pid" ] || return 0
    kill "$1" "$head_pid" 2>/dev/null || :
    wait "$head_pid" 2>/dev/null || :
    head_pid=
}

hash_over_tcp() {
    "$guest_scanhead" record "tcp:127.0.0.1:$tcp_port" --stats "$guest_work/tcp.json" --quiet &&
        sed -n 's/.*"stream_sha256": "\([0-9a-f]*\)".*/\1/p' "$guest_work/tcp.json"
}

host_request() {
    case $1 in
    kill) head_end -KILL ;;
    stop) head_end -TERM ;;
    start) shift && head_start "$@" ;;
    start_super) shift && speed=super head_start "$@" ;;
    start_sick) name=sick protocol=cola head_start ;;
    esac
    echo done
}

trap 'head_end -TERM; guest_end' EXIT
# A head of its own gives the same two scans over TCP. The guest must get the same.
head_start --pace fast
{
    echo "tcp1=$(hash_over_tcp)"
    echo "tcp2=$(hash_over_tcp)"
} >"$guest_work/root/hashes.sh"
head_end -TERM
# QEMU 9.2 gave the option another name, and will drop the old one.
reconnect=reconnect=1
version=$(qemu-system-x86_64 --version | sed -n 's/.* version \([0-9]*\)\.\([0-9]*\).*/\1 \2/p')
version=${version:-0 0}
[ $((${version% *} * 100 + ${version#* })) -lt 902 ] || reconnect=reconnect-ms=1000
guest_boot tests/guest/in_usbredir.sh 600 -device qemu-xhci,id=x -chardev "socket,id=usb,path=$guest_work/usb,$reconnect" \
    -device usb-redir,chardev=usb,bus=x.0
