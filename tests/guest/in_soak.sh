# SPDX-License-Identifier: MIT
# This runs inside the guest: it calls `scanhead soak`, scenario by scenario, with a head on the virtual host
# controller.
. /soak_of.sh
load vhci-hcd
# Seven of its eight controllers only cost time, because each look at the bus reads their hubs too.
for i in 1 2 3 4 5 6 7; do echo vhci_hcd.$i >/sys/bus/platform/drivers/vhci_hcd/unbind; done
cp /room.obj /usb.yaml .
[ -n "$scenarios" ] || scenarios=$(ls /config/faults | sed -n 's/\.yaml$//p')
for name in $scenarios; do
    if grep -q ntp_ "/config/faults/$name.yaml"; then continue; fi # a head of this kind asks no time server
    scanhead soak usb.yaml --scenario /config/faults/$name.yaml --duration "$seconds" --quiet >soak.txt 2>soak.err
    echo $? >soak.code
    for file in txt err code; do sed "s/^/# FILE $name-usb.$file /" soak.$file >&3; done
    check "usb: $name" test "$(cat soak.code)" = 0
    note "$name at $(uptime_s) s"
done
