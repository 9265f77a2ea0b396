#!/bin/sh
# SPDX-License-Identifier: MIT
# This moves files that are staged to their places, or removes them again:
#   sh install.sh STAGE DEST LIST   moves each file of STAGE below DEST. LIST, a file below DEST, gets their names
#   sh install.sh --remove DEST LIST
# Files of an older LIST that STAGE lacks are removed. Folders are removed only below LIST's own, where they are empty.
set -eu
umask 022
stage=$1 dest=$2 list=$3
names=$(mktemp)
trap 'rm -f "$names"; [ "$stage" = --remove ] || rm -rf -- "$stage"' EXIT

remove_others() {
    [ -f "$dest$list" ] || return 0
    while IFS= read -r name; do
        grep -qxF -e "$name" "$names" || rm -f -- "$dest$name"
    done <"$dest$list"
    [ ! -d "$dest${list%/*}" ] || find "$dest${list%/*}" -depth -type d -empty -delete
}

if [ "$stage" = --remove ]; then
    [ -f "$dest$list" ] || { echo "make uninstall: no $dest$list, the list that make install writes" >&2; exit 1; }
    remove_others
    exit
fi
(cd "$stage" && find . ! -type d) | sed 's/^\.//' >"$names"
echo "$list" >>"$names"
remove_others
while IFS= read -r name; do
    mkdir -p -- "$dest${name%/*}"
    [ "$name" = "$list" ] || cp -P --remove-destination -- "$stage$name" "$dest$name"
done <"$names"
rm -f -- "$dest$list"
cp -- "$names" "$dest$list"
chmod 644 -- "$dest$list"
