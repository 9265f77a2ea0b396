# SPDX-License-Identifier: MIT
# This runs inside the guest: it tests the kernel's gadget at high and at super speed. init sources it.
. /in_usb.sh
export CONSOLE=/dev/ttyACM0 CHAPTER9_KERNEL=1
is_gadget=1 # the kernel's gadgets speak Microsoft OS 1.0, not 2.0
load dummy_hcd # at high speed, as most boards have
load usb_f_fs
load usb_f_acm
load cdc-acm
gadgets=/sys/kernel/config/usb_gadget
head_start "" --pace fast
record_reference
head_stop
# A gadget that is unbound from its controller is off the bus. (soft_connect won't do: dummy_hcd of 6.1 answers nothing
# after it.)
echo "echo >\$(echo $gadgets/*/UDC)" >unplug.sh
echo "echo dummy_udc.0 >\$(echo $gadgets/*/UDC)" >plug.sh
ends_soon() {
    kill $head_pid
    wait_for 5 sh -c "! kill -0 $head_pid"
}
speed=high
. /in_functionfs_at.sh
rmmod dummy_hcd
load dummy_hcd is_super_speed=1
speed=super
. /in_functionfs_at.sh
