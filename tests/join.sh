#!/bin/bash
# SPDX-License-Identifier: MIT
# Joins test programs: twenty of a folder become one file, and test_NAME a link to it, which runs the one of its name.
# Linking some 500 one by one takes as much processor time as compiling them. (More than twenty take longer to run: at
# the end of a program the sanitizer of leaks looks through the variables of all of them.)
#   LINK='cc ...' LIBS='-l...' LD=ld OBJCOPY=objcopy JOBS=2 join.sh BUILD PROGRAM...     PROGRAM: BUILD/tests/FOLDER/test_NAME
#
# Only a program's main is visible from outside, under the program's name. So programs and their rigs may use the same
# names. A program is linked by itself where it replaces a function of a library or of the head: in the joined file all
# programs would call that function.
set -euo pipefail
build=$1
shift
archives="$build/common.a $build/modules.a"
limit=$build/tests/common/limit.c.o
work=$build/tests/joining AT_ONCE=20
mkdir -p "$work"

# Each line is a program and its objects, its own object first.
sh tests/rigs.sh | awk -v build="$build" -v programs="$*" '
    { split($0, pair, ":"); rigs[build "/" pair[1]] = rigs[build "/" pair[1]] " " build "/" pair[2] ".o" }
    END { n = split(programs, list, " "); for (i = 1; i <= n; i++) print list[i], list[i] ".c.o" rigs[list[i]] }' >"$work/list"

# A program is linked by itself when the archives define or lack a symbol of it.
nm -P -g $archives "$limit" | awk 'NF >= 2 { print $1 }' | sort -u >"$work/theirs"
cut -d ' ' -f 2- "$work/list" | tr ' ' '\n' | sort -u | xargs nm -P -g -A --defined-only |
    awk 'NR == FNR { theirs[$1] = 1; next }
        $2 in theirs && $2 != "main" && $2 !~ /^__/ { sub(/:$/, "", $1); print $1 }' "$work/theirs" - | sort -u >"$work/own"
awk 'NR == FNR { own[$1] = 1; next } { for (i = 2; i <= NF; i++) if ($i in own) { print; next } }' "$work/own" "$work/list" >"$work/apart"
grep -v -x -F -f "$work/apart" "$work/list" >"$work/together" || : # none

# one FOLDER/NAME OBJECT...: makes an object in which main has the program's name. The object is kept until one of its
# own objects, or this script, is newer. Section groups (COMDAT) are dissolved here. If two programs had a group of the
# same name, the linker would keep only one, and clang 19 makes a group of each variable.
one() {
    local program=$1 name=${1##*/}
    local out=$work/${program%/*}-$name.o object
    shift
    for object in "$@" tests/join.sh; do [ "$out" -nt "$object" ] || break; done
    [ -e "$out" ] && [ "$out" -nt "$object" ] && return
    "$LD" -r --force-group-allocation -o "$out.new" "$@"
    "$OBJCOPY" --redefine-sym main="$name" --keep-global-symbol="$name" "$out.new"
    mv "$out.new" "$out"
}
by_itself() {
    local program=$1
    shift
    rm -f "$program"
    $LINK -o "$program" "$@" "$limit" $archives $LIBS
}
export work limit archives
export -f one by_itself
sed "s|^$build/tests/||" "$work/together" | xargs -r -P "$JOBS" -L 1 bash -c 'set -eu; one "$@"' -
xargs -r -P "$JOBS" -L 1 bash -c 'set -eu; by_itself "$@"' - <"$work/apart"

# join FILE OBJECTS-PREFIX NAME...: makes one file of these programs.
join() {
    local file=$1 folder=${1%/*} prefix=$2 name
    shift 2
    {
        printf '#include <stdio.h>\n#include <string.h>\n'
        for name; do echo "int $name(int argc, char **argv);"; done
        echo 'static const struct { const char *name; int (*main)(int argc, char **argv); } all[] = {'
        for name; do echo "{\"$name\", $name},"; done
        echo '};
/* Programs whose main takes no arguments are called like the others. */
#ifdef __clang__
__attribute__((no_sanitize("function")))
#endif
int main(int argc, char **argv)
{
    const char *slash = strrchr(argv[0], 47), *name = slash != NULL ? slash + 1 : argv[0];
    for (size_t i = 0; i < sizeof all / sizeof all[0]; i++)
        if (strcmp(all[i].name, name) == 0) return all[i].main(argc, argv);
    fprintf(stderr, "%s: not one of the joined programs\n", name);
    return 2;
}'
    } >"$file.c"
    $LINK -o "$file" "$file.c" $(printf "$prefix%s.o " "$@") "$limit" $archives $LIBS
    rm "$file.c"
    for name; do ln -sf "${file##*/}" "$folder/$name"; done
}
export -f join

rm -f "$build"/tests/*/joined-*
for folder in $(cut -d ' ' -f 1 "$work/together" | sed 's|/[^/]*$||' | sort -u); do
    sed -n "s|^$folder/\([^ ]*\) .*|\1|p" "$work/together" | xargs -n "$AT_ONCE" | awk -v folder="$folder" '{ print folder "/joined-" NR, $0 }' |
        xargs -P "$JOBS" -L 1 bash -c 'set -eu; file=$1; shift; join "$file" "$work/$(basename "${file%/*}")-" "$@"' -
done
