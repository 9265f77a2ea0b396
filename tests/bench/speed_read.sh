#!/bin/bash
# SPDX-License-Identifier: MIT
# This runs a head whose links are read: bash tests/bench/speed_read.sh SCANHEAD run CONFIG OPTIONS... Readers of its
# terminal and of its TCP port take all bytes and do nothing with them. The status is the head's.
set -eu
ready=$(mktemp -u /tmp/scanhead-ready-XXXXXX)
mkfifo "$ready"
"$@" --ready-fd 4 4>"$ready" &
head=$!
read -r line <"$ready" || true
rm "$ready"
readers=
for endpoint in $(grep -o '"endpoint":"[^"]*"' <<<"$line" | cut -d '"' -f 4); do
    case $endpoint in
    tty:*) cat "${endpoint#tty:}" >/dev/null 2>&1 & ;;
    tcp:*) host=${endpoint#tcp:}; (exec cat <"/dev/tcp/${host%:*}/${host##*:}" >/dev/null) 2>/dev/null & ;;
    *) continue ;;
    esac
    readers="$readers $!"
done
status=0
wait "$head" || status=$?
# shellcheck disable=SC2086
kill $readers 2>/dev/null || true
exit "$status"
