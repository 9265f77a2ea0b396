#!/bin/sh
# SPDX-License-Identifier: MIT
# This tests 64-bit ARM: the programs are cross-built with the libraries of an arm64 Debian and run under qemu-aarch64.
here=$(dirname "$0") build=$1 at=$2
. "$here/lib.sh"
case $PWD/$at in *[[:space:]]*) leave "there is a blank in the path of $at, which the compiler's options can't have" ;; esac
need aarch64-linux-gnu-gcc gcc-aarch64-linux-gnu
need aarch64-linux-gnu-g++ g++-aarch64-linux-gnu
need qemu-aarch64-static qemu-user-static
# Packages are only unpacked, so nothing of ARM runs while the root is made. The compilers of this machine link with the
# libraries of the root, so its Debian has to be the same.
. /etc/os-release
make_root "${VERSION_CODENAME:-bookworm}" --variant=extract --arch=arm64 --include=libc6-dev,libstdc++-$(aarch64-linux-gnu-gcc -dumpversion)-dev,libembree-dev,libassimp-dev,libgeographiclib-dev,libproj-dev,libyaml-dev,libpng-dev,libstb-dev,nettle-dev,libusb-1.0-0-dev,libusbredirparser-dev,libwebsockets-dev,libjansson-dev,libwebp-dev,libtiff-dev,libmeshoptimizer-dev,libcmocka-dev
root=$(cd "$at/root" && pwd)
# Links that begin at the root lead into this machine from here, and the linker would take static libraries instead.
find "$root/usr/lib" "$root/lib" -type l -lname '/*' | while read -r link; do
    to=$(readlink "$link")
    case $to in "$root"/*) ;; *) ln -sfn "$root$to" "$link" ;; esac
done
# The emulator looks for every path in the root first, but the devices must be those of this machine.
rm -rf "$root/dev"
pc=$root/usr/lib/aarch64-linux-gnu/pkgconfig:$root/usr/share/pkgconfig
echo "    building for ARM"
$nicely ${MAKE:-make} -k -j"${JOBS:-2}" DEPS=no BUILD="$at/build" CROSS_COMPILE=aarch64-linux-gnu- \
    CC="${CCACHE:-} aarch64-linux-gnu-gcc --sysroot=$root" CXX="${CCACHE:-} aarch64-linux-gnu-g++ --sysroot=$root" \
    PKG_CONFIG="env PKG_CONFIG_SYSROOT_DIR=$root PKG_CONFIG_LIBDIR=$pc pkg-config" \
    WERROR=-Werror CFLAGS=-g1 CXXFLAGS=-g1 $(emulated_programs "$at/build") all >"$at/build.txt" 2>&1 || exit 1
built "$(aarch64-linux-gnu-gcc -dumpversion | sed 's/^/gcc /'), Embree $(sed -n 's/.*-DSH_EMBREE=\([0-9]\).*/\1/p' "$at/build/flags")" "$at/build.txt"
emulate="qemu-aarch64-static -L $root"
build_here all "$at/here.txt" || exit 1
$nicely $emulate "$at/build/scanhead" $RECORD -o "$at/record.ply" 2>"$at/record.log" && compare_record "$at/record.ply"
# A board would have the head alone.
$nicely $emulate "$at/build/scanheadd" check config/glass.yaml >"$at/scanheadd.txt" 2>&1 || exit 1
aarch64-linux-gnu-strip -o "$at/scanheadd" "$at/build/scanheadd"
echo "    scanheadd: $(stat -c %s "$at/scanheadd") bytes; it needs$(readelf -d "$at/scanheadd" | sed -n 's/.*(NEEDED).*\[lib\([^.]*\).*/ \1/p' | tr -d '\n')"
test_emulated "$at/build"
