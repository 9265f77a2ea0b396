# SPDX-License-Identifier: MIT
# This runs inside the guest: it tests a gadget at the speed $speed. in_functionfs.sh sources it.
packet=512 replugs=$often
[ $speed = high ] || packet=1024 replugs=2 # at the second speed the tests only show that a replug works
if [ $speed = high ]; then
    sed "\$alinks: [{type: usb, backend: functionfs, speed: super}]" /head.yaml >fast.yaml
    scanhead run fast.yaml --duration 0.01 2>fast.err
    check "$speed: a controller that is too slow is refused" test $? = 2
    check "$speed: and it says what is allowed" grep 'does not reach super speed; allowed full, high$' fast.err
    check "$speed: nothing left of that" test -z "$(ls $gadgets)"
fi
head_start "{type: usb, backend: functionfs, speed: $speed}" --pace fast
check_enumeration "$speed" $packet
if [ $speed = high ]; then # a head of another container doesn't see this one's process
    sed "\$alinks: [{type: usb, backend: functionfs}]" /head.yaml >other.yaml
    in_use=$(ls $gadgets)
    unshare -m -p -f sh -c 'mount -t proc none /proc && scanhead run other.yaml --duration 0.01' 2>other.err
    check "$speed: a head of another container finds no free controller" grep 'Device or resource busy$' other.err
    check "$speed: and leaves this head its gadget" test "$(ls $gadgets)" = "$in_use"
fi
check_record "$speed"
head_stop
check "$speed: gone with the head" wait_for 10 is_unplugged
check "$speed: nothing left" test -z "$(ls $gadgets)"
note "recorded at $(uptime_s) s"
records_only && return
head_start "{type: usb, backend: functionfs, speed: $speed}" --set head.prr_hz=4000 --set loop.tick_hz=100
wait_for 10 is_plugged
REPLUGS=$replugs UNPLUG="sh unplug.sh" PLUG="sh plug.sh" tap "$speed" test_stream
note "streamed at $(uptime_s) s"
head_stop
if [ $speed = high ]; then # a reset is the same, but without a pause
    printf 'faults:\n  - {kind: unplug, at: 100, count: 1, for_ms: 200}\n  - {kind: usb_reset, at: 200, count: 1}\n' >faults.yaml
    head_start "{type: usb, backend: functionfs, speed: high}" --set head.prr_hz=4000 --set loop.tick_hz=100 \
        --scenario faults.yaml --truth truth.json
    wait_for 10 is_plugged
    scanhead record usb --wait 1200 --frames 0 --replug 600 -o faults.ply --stats faults.json 2>faults.err &
    client=$!
    check "$speed: the recorder goes on after it was unplugged twice on request" \
        wait_for 40 sh -c "test \$(grep -c 'is back' faults.err) = 2"
    kill -INT $client
    wait $client
    check "$speed: with the count" grep '"replugs": 2,' faults.json
    check "$speed: both are in the truth" wait_for 10 sh -c "test \$(wc -l <truth.json) = 2"
    head_stop
fi
head_start "{type: usb, backend: functionfs, speed: $speed}" --set head.prr_hz=4000 --set loop.tick_hz=100
wait_for 10 is_plugged
# Without a configuration a head has nothing to do on its bus. The head rests then, and is there again with the next
# configuration.
cpu_ticks() {
    awk '{print $14 + $15}' /proc/$head_pid/stat
}
# One second has 100 ticks. A busy loop takes all of them in each of five seconds. The head's ticks without a scan stay
# below 10, and are more only while the emulated machine itself stands still.
rests() {
    for second in 1 2 3 4 5; do
        before=$(cpu_ticks)
        sleep 1
        used=$(($(cpu_ticks) - before))
        [ $used -ge 50 ] || return 0
    done
    return 1
}
device=$(dirname "$(grep -l 1209 /sys/bus/usb/devices/*/idVendor)")
for file in bConfigurationValue authorized; do
    echo 0 >$device/$file
    check "$speed: $file 0: the head rests" rests
    echo 1 >$device/$file
    check "$speed: $file 1: records again" scanhead record usb --wait 1200 --quiet --stats again.json
done
note "rested at $(uptime_s) s"
check_chapter9 "$speed"
note "chapter 9 at $(uptime_s) s"
device=$(dirname "$(grep -l 1209 /sys/bus/usb/devices/*/idVendor)")
echo 0 >$device/bConfigurationValue
check "$speed: ends without a configuration" ends_soon
[ $speed = high ] || return 0 # one speed is enough for the rest
check_hokuyo "$speed" "backend: functionfs, speed: $speed"
check_sick "$speed" "backend: functionfs, speed: $speed"
head_start "{type: usb, backend: functionfs, speed: $speed}" --pace fast
wait_for 10 is_plugged
head_kill
check "$speed: a killed head leaves its gadget" test "$(ls $gadgets | wc -l)" = 1
mkdir $gadgets/scanhead-1-123456789-0 # the gadget of a head whose process number, 1, now belongs to another process
head_start "{type: usb, backend: functionfs, speed: $speed}" --pace fast
check "$speed: the next one takes it away" test "$(ls $gadgets | wc -l)" = 1
check "$speed: and is there" wait_for 10 is_plugged
head_stop
