#!/bin/sh
. tests/guest/lib.sh
guest_prepare
guest_boot tests/guest/in_boot.sh 60
