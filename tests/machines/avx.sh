#!/bin/sh
# SPDX-License-Identifier: MIT
# This tests x86 without AVX2 (Sandy Bridge): it runs the programs of this machine under qemu-x86_64. QEMU warns of two
# features that it lacks, and tests read standard error: these features are left out.
exec sh "$(dirname "$0")/x86.sh" "$1" "$2" SandyBridge,-x2apic,-tsc-deadline
