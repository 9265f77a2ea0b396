#!/bin/sh
# All guest tests as one TAP program: the guests run side by side, as each has one processor; results come one after the
# other. `sh tests/guest/guest.sh usbip` runs one of them.
. tests/guest/lib.sh
guest_prepare

if [ $# -eq 0 ]; then
    set --
    for script in tests/guest/test_*.sh; do
        name=$(basename "$script" .sh)
        set -- "$@" "${name#test_}"
    done
fi
pids=
trap 'for pid in $pids; do kill "$pid" 2>/dev/null || :; done' EXIT
for name; do
    # Some mostly wait, for a reconnection once a second; those that compute give way to them.
    case $name in usbredir | usbip_pair) less=0 ;; *) less=10 ;; esac
    nice -n $less sh "tests/guest/test_$name.sh" >"$guest_cache/$name.tap" 2>"$guest_cache/$name.err" &
    pids="$pids $!"
done
status=0
for name; do
    one=${pids# }
    one=${one%% *}
    wait "$one" || status=$?
    pids=${pids#" $one"}
    echo "# $name"
    cat "$guest_cache/$name.tap"
    sed "s/^/# /" "$guest_cache/$name.err"
done
exit $status
