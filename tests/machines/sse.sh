#!/bin/sh
# SPDX-License-Identifier: MIT
# This tests x86 without AVX (Westmere, SSE4.2): it runs the programs of this machine under qemu-x86_64.
exec sh "$(dirname "$0")/x86.sh" "$1" "$2" Westmere
