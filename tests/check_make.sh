#!/bin/sh
# SPDX-License-Identifier: MIT
# Checks the commands of make for builds that this machine can't do: for another machine, with both Embrees or with the
# one that is asked for. Checks the names that the archive of the library exports. Scripts stand in for compilers and
# headers that aren't here. Only the commands of those builds are checked. Prints TAP.
set -u
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
. tests/tap.sh

# would TARGET [VARIABLE=...]: prints the commands that make would run for it in a new folder. The variables of a make
# above are not passed on.
would() {
    target=$1
    shift
    env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL -u CC -u CXX PATH="$work/bin:$PATH" make -n V=1 DEPS=no BUILD="$work/build" \
        "$@" "$work/build/$target" 2>&1
}

# says FILE WORD... / lacks FILE WORD...: all of these are in it / none of them.
says() {
    file=$1
    shift
    for word; do grep -q -e "$word" "$file" || { echo "no $word in:"; cat "$file"; return 1; }; done
}
lacks() {
    file=$1
    shift
    for word; do ! grep -e "$word" "$file" || return 1; done
}

# ---- one name, one default: make reads all its files as one, so a second default would have no effect
one_default_each() {
    twice=$(grep -hoE '^[A-Z_]+ *\?=' Makefile tests/*/*.mk config/*/*.mk | sed 's/[ ?=]*$//' | sort | uniq -d)
    [ "$twice" = CROSS_COMPILE ] || { echo "defaults at two places:" $twice; return 1; } # its two stand in branches of an if
}
check "no variable of make has two defaults" one_default_each
runs_all_of() {
    env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -n DEPS=no BUILD="$work/build" "$1" >"$work/all" 2>&1 && says "$work/all" "$2"
}
check "make mutants alone draws from all of the product" runs_all_of mutants "-n 200 --seed '1' --only ''"
check "make machines alone runs all machines" runs_all_of machines " 'trixie' 'avx' 'sse' 'aarch64'\$"

# Each line of the help names a target that exists.
help_is_true() {
    make -s help >"$work/help" && [ "$(wc -l <"$work/help")" -gt 20 ] || return
    for target in $(awk '{ print $2 }' "$work/help"); do
        grep -qE "^([a-z-]+ )*$target( [a-z-]+)*:" Makefile tests/*/*.mk config/*/*.mk || { echo "no target $target"; return 1; }
    done
}
check "make help" help_is_true

# ---- a cross compiler for ARM, its pkg-config, and both Embrees where it looks
mkdir -p "$work/bin" "$work/include/embree3" "$work/include/embree4"
: >"$work/include/embree3/rtcore.h"
: >"$work/include/embree4/rtcore.h"
cat >"$work/bin/arm64-test-gcc" <<END
#!/bin/sh
[ "\$1" != -dumpmachine ] || { echo arm64-test; exit; }
exec ${CC:-cc} -nostdinc -I$work/include "\$@"
END
printf '#!/bin/sh\n[ "$1" = --exists ] || echo "-I/arm64/include"\n' >"$work/bin/arm64-test-pkg-config"
chmod +x "$work/bin/arm64-test-gcc" "$work/bin/arm64-test-pkg-config"

cross_is_whole() {
    would scanhead "$@" >"$work/cross"
    says "$work/cross" '^arm64-test-gcc .*-I/arm64/include .*main\.c' '^arm64-test-g++ ' 'arm64-test-ar rcs' &&
        lacks "$work/cross" -mprefer-vector-width '/usr/include'
}
check "CROSS_COMPILE=: compilers, pkg-config and ar with the prefix, no flag of this machine" cross_is_whole CROSS_COMPILE=arm64-test-
check "the same by the name of CC" cross_is_whole CC=arm64-test-gcc
archive_is_whole() {
    would libscanhead.a CC=arm64-test-gcc >"$work/cross" && says "$work/cross" '^arm64-test-objcopy'
}
check "and the library by its objcopy" archive_is_whole
own_tools() {
    would scanhead CROSS_COMPILE=arm64-test- PKG_CONFIG="$work/bin/arm64-test-pkg-config" AR=other-ar >"$work/cross"
    says "$work/cross" 'other-ar rcs' '-I/arm64/include'
}
check "what is given stays" own_tools
without_pkg_config() {
    rm "$work/bin/arm64-test-pkg-config"
    ! would scanhead CROSS_COMPILE=arm64-test- >"$work/cross" && says "$work/cross" 'arm64-test-pkg-config does not *find'
}
check "without its pkg-config there is one error that says so" without_pkg_config

# ---- Embree
# embree_is N [VARIABLE=...]: headers and library of version N.
embree_is() {
    version=$1
    shift
    would scanhead CPPFLAGS="-I$work/include" "$@" >"$work/embree"
    says "$work/embree" "-DSH_EMBREE=$version .*core/bvh/bvh\.c" "-lembree$version " &&
        lacks "$work/embree" "SH_EMBREE=$((7 - version))" "lembree$((7 - version))"
}
check "both Embrees: headers and library of 3" embree_is 3
check "EMBREE=4: of 4" embree_is 4 EMBREE=4
check "EMBREE=3: of 3" embree_is 3 EMBREE=3
# The cross compiler finds nothing but these two.
refuses_embree() {
    ! would scanhead CC=arm64-test-gcc ${1:+EMBREE="$1"} >"$work/embree" &&
        says "$work/embree" "no *Embree ${1:-3 or 4} for arm64-test-gcc; allowed 3 and 4"
}
alone_is_taken() {
    would scanhead CC=arm64-test-gcc >"$work/embree" && says "$work/embree" "-DSH_EMBREE=4 .*core/bvh/bvh\.c" "-lembree4 " &&
        lacks "$work/embree" SH_EMBREE=3 lembree3
}
printf '#!/bin/sh\necho "-I/arm64/include"\n' >"$work/bin/arm64-test-pkg-config"
chmod +x "$work/bin/arm64-test-pkg-config"
check "EMBREE=5 is refused" refuses_embree 5
rm -r "$work/include/embree3"
check "Embree 4 alone: headers and library of 4" alone_is_taken
check "EMBREE=3 without it is refused" refuses_embree 3
rm -r "$work/include/embree4"
check "without either there is one error that says so" refuses_embree ""

# ---- one test by its name: unit tests need no program, but a test of the same name in another folder needs it
one_makes_the_program() {
    env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -n DEPS=no BUILD="$work/one" T="$1" test 2>&1 |
        grep -c "BUILD=$work/one/test .*all $work/one/test/bench"
}
programs_of() {
    [ "$(one_makes_the_program test_ring)" = 0 ] && [ "$(one_makes_the_program test_gnss)" = 1 ] &&
        [ "$(one_makes_the_program test_pty)" = 1 ] && [ "$(one_makes_the_program check_includes)" = 1 ]
}
check "T=NAME makes the program where a test of that name runs it" programs_of

# ---- what is built again: in a small tree with the same Makefile, by compilers that only note what they are asked for
toy=$work/toy
mkdir -p "$toy/tools" && cp Makefile "$toy/"
for file in core/err.c core/one.c core/sub/two.c core/georef/geographiclib_shim.cpp drivers/protocol/three.c drivers/host/four.c \
    drivers/host/libscanhead.map firmware_sim/main.c \
    tests/bench/bench.c tests/common/limit.c tests/common/five.c \
    tests/unit/test_toy.c tests/wire/test_other.c; do
    mkdir -p "$toy/${file%/*}" && : >"$toy/$file"
done
for file in rigs.sh shipped.sh; do cp "tests/$file" "$toy/tests/"; done
printf '#!/bin/bash\n' >"$toy/tests/run_tap.sh"
cat >"$toy/tools/gcc" <<'END'
#!/bin/sh
# Writes its arguments to the output, and the name of the source to the log.
case $1 in -dumpmachine) echo toy; exit ;; esac
all=$*
compiled= out=
while [ $# -gt 0 ]; do
    case $1 in -c) compiled=$2 ;; -o) out=$2 ;; esac
    shift
done
[ -z "$compiled" ] || echo "$compiled" >>"$LOG"
[ -z "$out" ] || echo "$all" >"$out"
END
printf '#!/bin/sh\nshift; out=$1; shift; echo "$@" >"$out"\n' >"$toy/tools/ar"
printf '#!/bin/sh\n' >"$toy/tools/objcopy"
printf '#!/bin/sh\n' >"$toy/tools/pkg-config"
for name in g++ clang clang++ ccache; do cp "$toy/tools/gcc" "$toy/tools/$name"; done
printf '#!/bin/sh\nexec "$@"\n' >"$toy/tools/ccache"
chmod +x "$toy"/tools/*
# toy ARGUMENT...: make in that tree. compiles N ARGUMENT...: make compiles N sources.
toy() {
    : >"$work/log"
    (cd "$toy" && env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL -u CC -u CXX -u BUILD LOG="$work/log" PATH="$toy/tools:$PATH" \
        make DEPS=no READERS=readers "$@") >"$work/toy_out" 2>&1 || { cat "$work/toy_out"; return 1; }
}
compiles() {
    n=$1
    shift
    toy "$@" || return
    [ "$(wc -l <"$work/log")" = "$n" ] || { echo "make $*: compiled, and not $n:"; cat "$work/log"; return 1; }
}
mkdir -p "$toy/readers" && touch -d 2100-01-01 "$toy/readers/installed" "$toy/readers/pcl_vlp16"
flags_build_again() {
    compiles 8 && compiles 0 && compiles 8 OPT=-O0 && says "$toy/build/scanhead" ' ' && says "$toy/build/core/one.c.o" -O0 &&
        compiles 0 OPT=-O0 && compiles 8 OPT=-O0 CFLAGS="-DX='\"it is\"'" && compiles 0 OPT=-O0 CFLAGS="-DX='\"it is\"'" && compiles 8 &&
        compiles 0
}
check "OPT= and CFLAGS= build again, once" flags_build_again
tools_build_again() {
    for change in CXX=clang++ CPPFLAGS=-DY CXXFLAGS=-g0 LDFLAGS=-s SAN=-fsanitize=address EMBREE=4 AR=./tools/ar OBJCOPY=true \
        PKG_CONFIG=echo CC=clang; do
        compiles 8 $change && compiles 0 $change || return
    done
    compiles 8
}
check "so do other tools and what they find, and other flags of the linker" tools_build_again
none_in_turns() {
    compiles 0 all && toy build/bench && toy test T=test_other && toy test T=test_toy && compiles 0 all && compiles 0 build/bench &&
        compiles 0 test T=test_other && compiles 0 test T=test_toy && compiles 0 all WERROR=-Werror && compiles 0 all CC="ccache gcc"
}
check "make, make bench and make test in turns build nothing twice" none_in_turns
installs_as_built() {
    toy CFLAGS=-DMINE && : >"$work/log" && (cd "$toy" && make -n DEPS=no BUILT=yes install) >"$work/toy_out" 2>&1 &&
        lacks "$work/toy_out" ' -c ' && compiles 8
}
check "make install BUILT=yes installs what is there" installs_as_built
# The archives and the library lose the members whose sources are gone, and nothing is compiled.
removed_leaves() {
    says "$toy/build/modules.a" core/sub/two && says "$toy/build/test/common.a" common/five || return
    says "$toy/build/libscanhead.so" host/four || return
    rm "$toy/core/sub/two.c" "$toy/tests/common/five.c" "$toy/drivers/host/four.c"
    compiles 0 && compiles 0 test T=test_other || return
    lacks "$toy/build/modules.a" core/sub/two && lacks "$toy/build/test/common.a" common/five &&
        lacks "$toy/build/libscanhead.so" host/four && lacks "$toy/build/libscanhead.o" host/four
}
check "a source that is removed leaves the archives" removed_leaves
# The program of a test that is removed stays in the folder, but make does not ask for it.
removed_test() {
    [ -e "$toy/build/test/tests/unit/test_toy" ] && rm "$toy/tests/unit/test_toy.c" && ! toy test T=test_toy >"$work/gone" &&
        says "$work/gone" "no tests/\*/test_toy.c"
}
check "a test that is removed is not run" removed_test

# ---- the archive, made of the objects of both compilers; the program's archive is there, too
only_the_interface() {
    folder=$1 archive=$1/libscanhead.a
    shift
    if [ $# -gt 0 ]; then
        env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL make -s BUILD="$folder" DEPS=no "$@" "$archive" || return
    fi
    nm -g --defined-only "$archive" | awk 'NF == 3 && $3 !~ /^scanhead_/ { print; bad = 1 } NF == 3 { n++ }
        END { exit bad || n < 20 }'
}
check "the archive defines scanhead_... and nothing else for others" only_the_interface "$(dirname "${SCANHEAD:-build/scanhead}")"
if command -v clang >/dev/null; then
    check "the same of clang's objects" only_the_interface "${BUILD:-build}/clang" OPT=-O0 "CC=$(command -v ccache) clang" CFLAGS=-g0
fi
# A client may have functions with the names of internal ones of the library.
cat >"$work/client.c" <<END
#include <scanhead.h>
#include <stdio.h>
int crc32c(void);
int crc32c(void) { return 7; }
int sh_fail(void);
int sh_fail(void) { return 8; }
int main(void)
{
    char err[200];
    struct scanhead *head;
    printf("%d %d %d %s\n", crc32c(), sh_fail(), scanhead_open("none:", &head, err, sizeof err), scanhead_version());
    return 0;
}
END
own_names() {
    ${CC:-cc} -Idrivers/host "$work/client.c" "$(dirname "${SCANHEAD:-build/scanhead}")/libscanhead.a" -lnettle -lusb-1.0 -lm \
        -o "$work/client" && "$work/client" | grep "^7 8 -[0-9]* [0-9.]*$"
}
check "a client with a crc32c and an sh_fail of its own links and runs" own_names
echo "1..$tests"
