#!/bin/sh
# SPDX-License-Identifier: MIT
# This puts files that are staged in their places, or removes them again:
#   sh install.sh STAGE DEST LIST   each file of STAGE goes below DEST. LIST, a file below DEST, gets their names
#   sh install.sh --remove DEST LIST
# Files of an older LIST that STAGE lacks are removed, and folders named scanhead, or below one, that are empty then. A
# LIST that does not name itself is of another place, and is not followed.
set -eu
umask 022
stage=${1:?} dest=$2 list=$(printf '%s\n' "${3:?}" | sed 's://*:/:g')
names=$(mktemp)
trap 'rm -f "$names"' EXIT
trap 'exit 1' HUP INT TERM

is_ours() {
    [ -f "$dest$list" ] && grep -qxF -e "$list" "$dest$list"
}

remove_others() {
    while IFS= read -r name; do
        ! grep -qxF -e "$name" "$names" || continue
        rm -f -- "$dest$name"
        folder=${name%/*}
        while case $folder in */scanhead | */scanhead/*) ;; *) false ;; esac && rmdir -- "$dest$folder" 2>/dev/null; do
            folder=${folder%/*}
        done
    done
}

if [ "$stage" = --remove ]; then
    is_ours || { echo "make uninstall: no $dest$list, which make install writes there" >&2; exit 1; }
    all=$(cat "$dest$list")
    printf '%s\n' "$all" | remove_others
    exit
fi
all=$(cd "$stage" && find . ! -type d)
printf '%s\n' "$all" | sed 's/^\.//' >"$names"
echo "$list" >>"$names"
old=
if is_ours; then old=$(cat "$dest$list"); fi
# Until all are there, the list has the older files, too: a failure can be taken back.
mkdir -p -- "$dest${list%/*}"
rm -f -- "$dest$list"
{ printf '%s\n' "$old" | grep -v '^$' || :; cat "$names"; } >"$dest$list"
while IFS= read -r name; do
    mkdir -p -- "$dest${name%/*}"
    [ "$name" = "$list" ] || cp -P -T --remove-destination -- "$stage$name" "$dest$name"
done <"$names"
if [ -n "$old" ]; then printf '%s\n' "$old" | remove_others; fi
cat -- "$names" >"$dest$list"
