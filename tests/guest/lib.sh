# SPDX-License-Identifier: MIT
# This is the host's side of the guest tests. It boots a real kernel in QEMU and prints its results as TAP.
# tests/guest/test_kernel_*.sh source it.
#
#   guest_prepare                  kernel, modules and libraries into $BUILD/guest; skips the test where that can't be
#   guest_add FILE [TARGET]        a file of this test into the guest (default: the root folder)
#   guest_boot SCRIPT LIMIT_S [QEMU_OPTION...]
#                                  boots, runs SCRIPT in the guest and prints its results as TAP
#
# The kernel is Debian's stock one, taken out of its package and not installed. All that takes time to make is kept in
# $BUILD/guest, named after the package's version and a sum of the libraries. The guest has two serial lines: the
# console, whose log is kept, and one for results (init, in_*.sh). On the second the guest may also ask the host for
# something. `HOST word...` calls the function host_request, and the guest waits for the line that this prints.
set -eu

guest_build=${BUILD:-build}
guest_cache=$guest_build/guest
guest_scanhead=${SCANHEAD:-$guest_build/test/scanhead}
guest_programs=$guest_build/test/tests/guest
guest_name=$(basename "$0" .sh)
guest_work=$guest_cache/run/$guest_name
guest_pid=

# These are the modules that the scripts may load. The modules that they need are taken as well.
GUEST_MODULES="xhci-pci vhci-hcd dummy_hcd usb_f_fs usb_f_acm cdc-acm"
GUEST_TOOLS="busybox qemu-system-x86_64 cpio depmod lsusb usbreset usbip xz dpkg-deb"

guest_skip() {
    echo "1..0 # SKIP $*"
    exit 0
}

guest_quit() {
    echo "Bail out! $*"
    exit 1
}

guest_end() {
    [ -z "$guest_pid" ] || kill "$guest_pid" 2>/dev/null || :
}
trap guest_end EXIT
trap 'exit 130' INT TERM

# Prints name and version of the kernel that the stock package stands for. Without package lists it prints those of the
# kernel that is here already. apt takes a second for an answer, so guest.sh asks it once for all guests.
guest_kernel_name() {
    name=${GUEST_KERNEL:-$(apt-cache show --no-all-versions linux-image-amd64 2>/dev/null |
        sed -n 's/^Depends: \(linux-image-[0-9][^ ,]*-amd64\) (= \([^ )]*\)).*/\1=\2/p')}
    if [ -n "$name" ]; then
        echo "$name"
    else
        ls -t "$guest_cache" 2>/dev/null | sed -n 's/^\(linux-image-.*=.*\)-[0-9]*$/\1/p' | head -n 1
    fi
}

# Puts vmlinux and the modules of the package $1 into the new folder $2.
guest_unpack_kernel() {
    mkdir -p "$2/deb" "$2/tree"
    (cd "$2/deb" && apt-get download -q "$1" >../download.log 2>&1) || return 1
    # Debian 13 has the modules in usr/lib, and compressed.
    dpkg-deb --fsys-tarfile "$2"/deb/*.deb | tar -x -C "$2/tree" --wildcards './boot/*' './*lib/modules/*' || return 1
    [ -e "$2/tree/lib" ] || ln -s usr/lib "$2/tree/lib"
    rm -rf "$2/deb"
    release=$(ls "$2/tree/lib/modules")
    # An xz stream lies inside the image, with other things after it. The uncompressed kernel boots 3 s faster.
    for at in $(LC_ALL=C grep -obUaP '\xfd7zXZ\x00' "$2/tree/boot/vmlinuz-$release" | cut -d: -f1); do
        tail -c +$((at + 1)) "$2/tree/boot/vmlinuz-$release" | xz -dc --single-stream >"$2/vmlinux" 2>/dev/null || :
        [ "$(head -c 4 "$2/vmlinux" | tail -c 3)" != ELF ] || break
    done
    [ "$(head -c 4 "$2/vmlinux" 2>/dev/null | tail -c 3)" = ELF ] || cp "$2/tree/boot/vmlinuz-$release" "$2/vmlinux" || return 1
    PATH=$PATH:/sbin:/usr/sbin depmod -b "$2/tree" "$release"
    mkdir -p "$2/root/modules"
    for module in $GUEST_MODULES; do
        guest_module_order "$2/tree/lib/modules/$release" "$module" >"$2/order" || return 1
        while read -r file; do guest_take_module "$2/tree/lib/modules/$release/$file" "$2/root/modules" || return 1; done <"$2/order"
        sed 's|.*/||; s|\.ko.*||' "$2/order" >"$2/root/modules/$module.order"
    done
    rm -rf "$2/tree" "$2/order"
}

# guest_take_module FILE FOLDER: copies a module, unpacked, because busybox loads only that.
guest_take_module() {
    case $1 in
    *.xz) xz -dc "$1" >"$2/$(basename "$1" .xz)" ;;
    *) cp "$1" "$2/" ;;
    esac
}

# guest_module_order FOLDER MODULE: prints the files of the module and of those that it needs. Each comes after the ones
# that it needs itself.
guest_module_order() {
    awk -v wanted="$2" '
        { file = $1; sub(/:$/, "", file); name = file; sub(/.*\//, "", name); sub(/\.ko.*/, "", name); gsub(/-/, "_", name)
          path[name] = file; needs[file] = ""; for (i = 2; i <= NF; i++) needs[file] = needs[file] " " $i }
        function put(file,   list, n, i) {
            if (done[file]) return
            done[file] = 1
            n = split(needs[file], list, " ")
            for (i = n; i > 0; i--) put(list[i])
            print file
        }
        END { gsub(/-/, "_", wanted)
              if (!(wanted in path)) exit 1
              put(path[wanted]) }' "$1/modules.dep"
}

guest_pack() {
    (cd "$1" && find . | LC_ALL=C sort | cpio -o -H newc -R 0:0 --quiet)
}

# Prints the shared libraries of some programs, and their loader, at the places where the programs look for them.
guest_libraries() {
    for program; do ldd "$program"; done | sed -n 's/.*=> \(\/[^ ]*\).*/\1/p; s/^[[:space:]]*\(\/[^ ]*ld-linux[^ ]*\).*/\1/p' |
        LC_ALL=C sort -u
}

guest_copy() {
    mkdir -p "$2$(dirname "$1")"
    cp -L "$1" "$2$1"
}

guest_prepare_kernel() {
    kernel=$(guest_kernel_name)
    [ -n "$kernel" ] || guest_skip "no package linux-image-amd64: apt-get update, or no network"
    guest_kernel=$guest_cache/$kernel-$(echo "$GUEST_MODULES" | cksum | cut -d" " -f1)
    if [ ! -e "$guest_kernel/vmlinux" ]; then
        rm -rf "$guest_kernel.new"
        mkdir -p "$guest_kernel.new"
        guest_unpack_kernel "$kernel" "$guest_kernel.new" || guest_skip "the kernel package $kernel can't be had or unpacked"
        rm -rf "$guest_kernel"
        mv "$guest_kernel.new" "$guest_kernel"
    fi
}

# Prints the test programs for the guest that make has built (tests/guest/test_*.c).
guest_test_programs() {
    for source in tests/guest/test_*.c; do
        name=$(basename "$source" .c)
        [ ! -x "$guest_programs/$name" ] || echo "$guest_programs/$name"
    done
}

guest_prepare_libraries() {
    libraries=$(guest_libraries "$guest_scanhead" "$(command -v lsusb)" "$(command -v usbreset)" "$(command -v usbip)" $(guest_test_programs))
    key=$( (ls -lL $libraries "$(command -v lsusb)" "$(command -v usbreset)" "$(command -v busybox)" "$(command -v usbip)") | cksum | tr ' ' '-')
    guest_base=$guest_cache/base-$key.cpio
    [ ! -e "$guest_base" ] || return 0
    rm -rf "$guest_cache/base" "$guest_cache"/base-*.cpio
    mkdir -p "$guest_cache/base/bin"
    for file in $libraries; do guest_copy "$file" "$guest_cache/base"; done
    cp -L "$(command -v lsusb)" "$(command -v usbreset)" "$(command -v busybox)" "$(command -v usbip)" "$guest_cache/base/bin/"
    [ ! -e /usr/share/hwdata/usb.ids ] || guest_copy /usr/share/hwdata/usb.ids "$guest_cache/base"
    guest_pack "$guest_cache/base" >"$guest_base.new"
    mv "$guest_base.new" "$guest_base"
    rm -rf "$guest_cache/base"
}

guest_prepare() {
    for tool in $GUEST_TOOLS; do
        PATH=$PATH:/sbin:/usr/sbin command -v "$tool" >/dev/null || guest_skip "no $tool: make deps"
    done
    [ "$(uname -m)" = x86_64 ] || guest_skip "the guest is x86-64, this machine is $(uname -m)"
    mkdir -p "$guest_cache"
    guest_prepare_kernel
    guest_prepare_libraries
    rm -rf "$guest_work"
    mkdir -p "$guest_work/root/bin"
    cp tests/guest/init tests/guest/in_lib.sh "$guest_work/root/"
    cp "$guest_scanhead" $(guest_test_programs) "$guest_work/root/bin/"
    strip --strip-debug "$guest_work"/root/bin/*
    cp -r config "$guest_work/root/config"
    chmod +x "$guest_work/root/init"
}

guest_add() {
    mkdir -p "$guest_work/root/$(dirname "${2:-.}")"
    cp "$1" "$guest_work/root/${2:-}"
}

# Adds the head of the tests and the scripts' settings. GUEST_PAN_DEG_S makes its scan longer (0.4 gives a million
# pulses), and then the tests only record it.
guest_add_head() {
    guest_add tests/guest/in_usb.sh
    guest_add tests/guest/room.obj
    guest_add tests/guest/hokuyo.yaml
    guest_add tests/guest/sick.yaml
    sed "s/pan_deg_s: .*/pan_deg_s: ${GUEST_PAN_DEG_S:-60}/" tests/guest/head.yaml >"$guest_work/root/head.yaml"
    [ -z "${GUEST_PAN_DEG_S:-}" ] || : >"$guest_work/root/records_only"
    echo "often=${GUEST_REPLUGS:-20}" >"$guest_work/root/often.sh" # `often` says how often the head is unplugged
}

host_request() {
    echo "nothing to be had here: $*"
}

# Reads the guest's lines until it is done or gone.
guest_follow() {
    done=
    while [ -z "$done" ] && read -r line <&3; do
        line=$(printf '%s' "$line" | tr -d '\r')
        case $line in
        "ok "* | "not ok "* | "#"*) echo "$line" ;;
        "HOST "*) host_request ${line#HOST } >&4 ;;
        "DONE "*) done=${line#DONE } ;;
        "ENDED "*) break ;;
        esac
    done
    if [ -n "$done" ]; then
        echo "1..$done"
        return 0
    fi
    sed 's/^/# /' "$guest_work/console.log" | tail -n 30
    guest_quit "the guest did not get to its end within its time, or crashed (${line:-}); console: $guest_work/console.log"
}

guest_boot() {
    cp "$1" "$guest_work/root/script.sh"
    limit_s=${GUEST_LIMIT_S:-$((6 * $2))} # a quiet machine needs $2; a busy one is given six times as long
    shift 2
    { cat "$guest_base"; guest_pack "$guest_kernel/root"; guest_pack "$guest_work/root"; } >"$guest_work/initrd"
    mkfifo "$guest_work/results.in" "$guest_work/results.out"
    exec 3<>"$guest_work/results.out" 4<>"$guest_work/results.in"
    # There is no KVM, and one CPU, because a second CPU makes small transfers ten times slower on two host cores.
    (
        exec 3<&- 4<&-
        timeout -k 5 "$limit_s" qemu-system-x86_64 -accel tcg -cpu Nehalem -smp 1 -m 768 -M q35 -nodefaults -no-user-config \
            -display none -no-reboot -monitor none -kernel "$guest_kernel/vmlinux" -initrd "$guest_work/initrd" \
            -append "console=ttyS0 quiet panic=-1 mitigations=off nokaslr norandmaps no_timer_check cryptomgr.notests init_on_alloc=0" -chardev "file,id=console,path=$guest_work/console.log" \
            -serial chardev:console -chardev "pipe,id=results,path=$guest_work/results" -serial chardev:results "$@" \
            >"$guest_work/qemu.log" 2>&1 &
        trap 'kill $!; exit' TERM # a test that is ended leaves no machine behind
        status=0
        wait $! || status=$?
        echo "ENDED $status" >"$guest_work/results.out"
    ) &
    guest_pid=$!
    guest_follow
    wait "$guest_pid" || :
    guest_pid=
}
