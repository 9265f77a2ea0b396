#!/bin/bash
# SPDX-License-Identifier: MIT
# This tries the packages in a new root of Debian 12: apt installs, removes and purges them, and nothing may be left.
# Where systemd-nspawn is installed, the root is then booted, and the service runs in it. The script is run by make
# deb-check. The script prints TAP, the service's output in the booted root, lintian's output, and systemd's rating of
# the service.
#
#   check.sh DEB_DIR VERSION      DEB_DIR: where the packages are; the root is made in it
#
# MIRROR: where Debian is taken from. SUITE: the release of Debian, bookworm when not given.
set -u
[ $# -eq 2 ] || { echo "usage: $0 DEB_DIR VERSION (make deb-check)" >&2; exit 2; }
debs=$1 version=$2
suite=${SUITE:-bookworm} mirror=${MIRROR:-http://deb.debian.org/debian}
here=$(cd "$(dirname "$0")" && pwd)
project=$(cd "$here/../.." && pwd)
stop() {
    echo "deb-check: $1" >&2
    exit 1
}
[ "$(id -u)" = 0 ] || stop "a root of Debian is made and entered: that needs root; sudo make deb-check"
command -v mmdebstrap >/dev/null || stop "no mmdebstrap; apt-get install mmdebstrap"
debs=$(cd "$debs" && pwd) || exit 1
ls "$debs"/scanhead_"$version"-1_*.changes >/dev/null 2>&1 || stop "no packages of $version in $debs; make deb"
root=$debs/root
work=$debs/check
rm -rf "$work" && mkdir -p "$work" || exit 1
. "$project/tests/tap.sh"
# Mounts below the root belong to this mount namespace, and go with it.
[ -n "${DEB_CHECK_APART:-}" ] || exec env DEB_CHECK_APART=1 unshare --mount --propagation private bash "$0" "$@"

packages="scanhead libscanhead1 libscanhead-dev python3-scanhead"
inside() {
    chroot "$root" env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LC_ALL=C.UTF-8 DEBIAN_FRONTEND=noninteractive "$@"
}
# Runs a command as a user who has no rights, and no file of his own but in /tmp.
as_nobody() {
    inside setpriv --reuid=65534 --regid=65534 --clear-groups --no-new-privs --bounding-set=-all "$@"
}
# Runs a head as that user, with real-time scheduling and locked memory. Where this script may set the service's limits,
# the limits allow both. Elsewhere two capabilities do.
as_head() {
    if [ "$limits" = yes ]; then
        as_nobody "$@"
    else
        inside setpriv --reuid=65534 --regid=65534 --clear-groups --no-new-privs --bounding-set=-all,+sys_nice,+ipc_lock \
            --inh-caps=+sys_nice,+ipc_lock --ambient-caps=+sys_nice,+ipc_lock "$@"
    fi
}

lintian_finds_no_errors() {
    command -v lintian >/dev/null || { echo "no lintian; apt-get install lintian" | tee "$work/lintian"; return 1; }
    lintian --tag-display-limit 0 --show-overrides "$debs"/*.changes >"$work/lintian" 2>&1
    ! grep '^E: ' "$work/lintian"
}

make_root() {
    rm -rf --one-file-system "$root"
    mmdebstrap --quiet --variant=minbase "$suite" "$root" "$mirror" &&
        mount -t proc proc "$root/proc" && mount -t devpts -o newinstance,ptmxmode=0666,mode=0620 devpts "$root/dev/pts" &&
        mkdir "$root/packages" && { for package in $packages; do cp "$debs/${package}_"*.deb "$root/packages/" || return; done; } &&
        cp /etc/resolv.conf "$root/etc/" &&
        printf '#!/bin/sh\nexit 101\n' >"$root/usr/sbin/policy-rc.d" && chmod +x "$root/usr/sbin/policy-rc.d"
}

# Installs Debian's packages that ours ask for, and a compiler, so that all later changes are by ours alone.
install_others() {
    inside apt-get update -qq && inside apt-get install -qq --no-install-recommends gcc libc6-dev pkg-config man-db \
        groff-base bash-completion systemd >/dev/null &&
        inside sh -c 'apt-get install -s --no-install-recommends /packages/*.deb' |
        awk '$1 == "Inst" && $2 !~ /scanhead/ { print $2 }' >"$work/others" &&
        inside apt-get install -qq --no-install-recommends $(cat "$work/others") >/dev/null
}

# Prints every file with its kind, rights and owner, those of /etc with a checksum; users and groups; and packages.
# Caches, and what apt and dpkg write about themselves, are left out.
picture() {
    (cd "$root" && find . -xdev \( -path ./proc -o -path ./sys -o -path ./run -o -path ./packages -o -path ./tmp -o -path ./var/cache \
        -o -path ./var/log -o -path ./var/lib/apt -o -path ./var/lib/dpkg/info/format -o -path './var/lib/dpkg/*-old' \) \
        -prune -o -printf '%y %m %U %G %p %l\n' | sort
    find etc -type f ! -name ld.so.cache -exec sha256sum {} + | sort -k2
    cat etc/passwd etc/group
    inside dpkg-query -W -f='${Package} ${Status}\n')
}

install_ours() {
    inside sh -c 'apt-get install -qq --no-install-recommends /packages/*.deb' || return
    for package in $packages; do
        inside dpkg-query -W -f='${Status} ${Version}\n' "$package" | grep -qx "install ok installed $version-1" || return
    done
    inside apt-get check && [ -z "$(inside dpkg --audit)" ] && [ -z "$(inside dpkg --verify $packages)" ]
}

versions_agree() {
    test "$(inside scanhead --version)" = "scanhead $version" && test "$(inside pkg-config --modversion libscanhead)" = "$version" &&
        grep -q "\"$version\"" "$root/usr/include/scanhead.h"
}

# Checks, records and reports the service's example.
records() {
    few="--set head.pan_stop_deg=40"
    as_nobody scanhead check /etc/scanhead/example.yaml --set 'links[0].port=0' &&
        as_nobody scanhead record /etc/scanhead/example.yaml $few -o /tmp/scan.ply -o /tmp/scan.las --quiet &&
        as_nobody scanhead report /etc/scanhead/example.yaml /tmp/scan.ply $few &&
        as_nobody scanhead list | grep -q riegl-vz400i
}

# Starts a head; its port is then in $port.
start_head() {
    rm -f "$root/tmp/ready" && mkfifo -m 666 "$root/tmp/ready" || return
    as_head sh -c 'exec scanhead run /etc/scanhead/example.yaml --set "links[0].port=0" \
        --set head.pan_stop_deg=40 --ready-fd 3 3>/tmp/ready' 2>"$work/head.err" &
    head=$!
    read -r ready <"$root/tmp/ready" || { cat "$work/head.err"; return 1; }
    port=$(echo "$ready" | sed 's/.*tcp:[^"]*:\([0-9]*\)".*/\1/')
    echo "$ready"
}
no_right_was_missing() {
    ! grep -e SCHED_FIFO -e 'not locked' "$work/head.err"
}

client_in_python() {
    cat >"$root/tmp/client.py" <<'END'
import sys, scanhead
n = 0
with scanhead.open(sys.argv[1]) as head:
    print(head.command("*IDN?"))
    while head.command("HEAD:STATe?") != "idle":
        head.next_frame(timeout_s=5)
    head.command("SCAN:STARt")
    for frame in head.frames(timeout_s=20):
        if frame.type == scanhead.POINTS:
            n += sum(1 for echo in head.points(frame).echo if echo > 0)
        if head.scan_over:
            break
print(n, "echoes,", head.parser.seq_lost, "frames lost, module", scanhead.__file__)
assert n > 1000 and scanhead.__file__.startswith("/usr/lib/python3/dist-packages/")
END
    as_nobody python3 /tmp/client.py "tcp:127.0.0.1:$port"
}

# Builds and runs the README's client with the library of the package: with the shared library, by the flags of
# pkg-config, and with the archive, by flags that are written here.
client_in_c() {
    sed -n '/^```c /,/^```$/p' "$project/README.md" | sed '/^```/d' >"$root/tmp/client.c"
    inside sh -c 'cd /tmp && cc -Wall -Werror client.c $(pkg-config --cflags --libs libscanhead) -o client &&
        cc client.c -o client-static -Wl,-Bstatic -lscanhead -Wl,-Bdynamic -lnettle -lusb-1.0 -lm' || return
    inside ldd /tmp/client | grep -q libscanhead.so.1 || return
    ! inside ldd /tmp/client-static | grep libscanhead || return
    for client in client client-static; do
        left=500 # a head that has just scanned spins down, and refuses for a moment
        until as_nobody "/tmp/$client" "tcp:127.0.0.1:$port" >"$work/points"; do
            left=$((left - 1))
            [ $left -gt 0 ] && grep -q 'in state' "$work/points" || { cat "$work/points"; return 1; }
        done
        [ "$(wc -l <"$work/points")" -gt 1000 ] || { head -n 3 "$work/points"; return 1; }
    done
}

stops() {
    pid=$(pgrep -P "$head" -x scanhead || echo "$head")
    kill -TERM $pid && wait "$head"
}

pages_are_read() {
    for page in scanhead scanhead-run scanhead.yaml libscanhead; do
        inside man "$page" >"$work/page" 2>&1 && [ "$(wc -l <"$work/page")" -gt 20 ] ||
            { echo "$page"; tail -n 3 "$work/page"; return 1; }
    done
    inside bash -c '. /usr/share/bash-completion/bash_completion; _completion_loader scanhead; complete -p scanhead' | grep -q _scanhead
}

unit_is_sound() {
    inside systemd-analyze verify --man=no scanhead@example.service 2>&1 | tee "$work/verify"
    ! grep -i scanhead "$work/verify"
}

# Enables the service, as an administrator does, and makes the folders that its manager makes.
use_like_a_service() {
    mkdir -p "$root/etc/systemd/system/multi-user.target.wants" "$root/var/lib/private/scanhead/example"
    ln -s private/scanhead "$root/var/lib/scanhead" &&
        inside systemctl enable scanhead@example.service &&
        [ -L "$root/etc/systemd/system/multi-user.target.wants/scanhead@example.service" ]
}

# A changed conffile stays on removal, and goes with purge.
remove_ours() {
    echo '# changed' >>"$root/etc/scanhead/example.yaml" && inside apt-get remove -qq $packages &&
        [ -e "$root/etc/scanhead/example.yaml" ] && [ ! -e "$root/usr/bin/scanhead" ] && inside dpkg --purge $packages &&
        [ ! -e "$root/etc/scanhead" ]
}
nothing_is_left() {
    picture >"$work/after"
    diff "$work/before" "$work/after" && ! grep -i scanhead "$work/after"
}

# Boots the same root, and writes down the service's rights and state, what its client gets, and how it ends.
boots() {
    command -v systemd-nspawn >/dev/null || { echo "no systemd-nspawn (package systemd-container)"; return 1; }
    install_ours || return
    cat >"$root/service.sh" <<'END'
systemctl start scanhead@example && echo started
systemctl show scanhead@example -p ActiveState,StatusText,DynamicUser
pid=$(systemctl show scanhead@example -p MainPID --value)
grep -E '^(Uid|CapEff|CapBnd|NoNewPrivs|Seccomp):' "/proc/$pid/status"
grep -E 'realtime priority|locked' "/proc/$pid/limits"
python3 /client.py tcp:127.0.0.1:5025 && echo scanned
systemctl stop scanhead@example && echo stopped
systemctl show scanhead@example -p ActiveState,Result
getent passwd | grep scanhead
journalctl -u scanhead@example --no-pager -o cat
END
    cp "$root/tmp/client.py" "$root/client.py"
    printf '[Unit]\nAfter=multi-user.target\n[Service]\nType=oneshot\nStandardOutput=append:/service.out\nStandardError=inherit\n%s\n%s\n' \
        'ExecStart=/bin/sh /service.sh' 'ExecStartPost=/bin/systemctl --no-block poweroff' >"$root/etc/systemd/system/try.service"
    mkdir -p "$root/etc/systemd/system/multi-user.target.wants"
    ln -sf ../try.service "$root/etc/systemd/system/multi-user.target.wants/try.service"
    umount "$root/dev/pts" "$root/proc"
    timeout 180 systemd-nspawn --register=no --keep-unit --private-network -D "$root" -b >"$work/boot" 2>&1
    [ -s "$root/service.out" ]
}
# The service must run without root and capabilities, and behind a filter of system calls. The service must be ready
# once its link is open, end without an error, and leave no user.
service_is_sound() {
    for line in started ActiveState=active 'StatusText=links open: tcp:127.0.0.1:5025' DynamicUser=yes 'CapEff:.0*' 'CapBnd:.0*' \
        'NoNewPrivs:.1' 'Seccomp:.2' 'Uid:.6[0-9]*.*' scanned stopped ActiveState=inactive Result=success; do
        grep -qx "$line" "$root/service.out" || { echo "no $line in:"; cat "$root/service.out"; return 1; }
    done
    ! grep '^scanhead.*:x:' "$root/service.out"
}

check "lintian has no error" lintian_finds_no_errors
check "a new root: $suite, minbase" make_root
check "all dependencies of the packages come from Debian" install_others
picture >"$work/before"
check "apt installs the packages" install_ours
check "one version: program, library, header" versions_agree
check "check, record, report, list" records
# The service's manager sets two limits before it drops its rights. From here on this script has the same limits.
limits=yes
{ ulimit -r 80 && ulimit -l unlimited; } 2>/dev/null || limits=no
[ $limits = yes ] || echo "# no CAP_SYS_RESOURCE here: CAP_SYS_NICE and CAP_IPC_LOCK stand in for the two limits"
check "a head runs as nobody, with no rights but those for real time" start_head
check "a client in Python" client_in_python
check "a client in C, by pkg-config, shared and static" client_in_c
check "the head ends in good order" stops
check "it had what it needs for real time" no_right_was_missing
check "man reads the pages, bash loads the completion" pages_are_read
check "systemd-analyze verify" unit_is_sound
check "a head is enabled as a service" use_like_a_service
check "remove keeps a changed configuration, purge does not" remove_ours
check "no file, user, unit or package is left" nothing_is_left
if boots >"$work/boots" 2>&1; then
    check "the service under systemd, booted" service_is_sound
else
    tests=$((tests + 1))
    echo "ok $tests - the service under systemd, booted # SKIP $(tail -n 1 "$work/boots" "$work/boot" 2>/dev/null | tail -n 1)"
fi
echo "1..$tests"
[ ! -e "$root/service.out" ] || { echo "== the service"; cat "$root/service.out"; }
echo "== lintian: errors, warnings, notes"
cat "$work/lintian"
echo "== systemd-analyze security"
sed 's|@PREFIX@|/usr|' "$here/scanhead@.service.in" >"$work/scanhead@.service"
systemd-analyze security --offline=yes "$work/scanhead@.service" 2>/dev/null | tail -n 1
