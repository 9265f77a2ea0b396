#!/bin/bash
# SPDX-License-Identifier: MIT
# Puts one small fault after the other into a copy of the tree, and looks whether the tests see it.
#
#   run.sh [-j JOBS] [-a] BUILD [PATTERN]
#
# -a: all tests run against a fault that its own tests miss. PATTERN: of the patches' names, such as 'record-*'.
# The copy is BUILD/mutants/tree. What is known of a fault is kept beside it while the patch, the tree and the tests that it
# names stay as they are; so a run that was killed goes on where it was.
# Exit status: 0 at least 95 % found; 1 fewer, or a patch or a test that is of no use; 2 wrong usage.
set -u
jobs=1 all=no
while getopts j:a option; do
    case $option in
    j) jobs=$OPTARG ;;
    a) all=yes ;;
    *) exit 2 ;;
    esac
done
shift $((OPTIND - 1))
[ $# -ge 1 ] && [[ $jobs =~ ^[1-9][0-9]*$ ]] || { echo "usage: $0 [-j JOBS] [-a] BUILD [PATTERN]" >&2; exit 2; }
cd "$(dirname "$0")/../.." || exit 1
. tests/mutants/list.sh
pattern=${2:-*}
mkdir -p "$1/mutants/results" "$1/mutants/clean" "$1/mutants/logs" || exit 1
build=$(cd "$1" && pwd) || exit 1
work=$build/mutants tree=$build/mutants/tree
least_percent=95 longest_s=300
parts=$(ls -d Makefile README.md LICENSE config core drivers firmware_sim tests 2>/dev/null)

exec 9>"$work/lock"
flock -n 9 || { echo "$work is in use by another run" >&2; exit 1; }
child=
trap '[ -z "$child" ] || kill "$child" 2>/dev/null; exit 130' INT TERM

# ---- the copy

# Only what differs is copied, with a new date: so make builds what it depends on, also after a run that was killed.
same_tree() {
    local line from to
    if [ ! -e "$tree/Makefile" ]; then
        rm -rf "$tree" "$work/new"
        mkdir -p "$work/new/build" && cp -a $parts "$work/new/" && rm -r "$work/new/tests/mutants" && take_objects "$work/new" &&
            mv "$work/new" "$tree"
        return
    fi
    for part in $parts; do
        diff -rq -x mutants "$part" "$tree/$part"
    done >"$work/differs"
    while IFS= read -r line; do
        case $line in
        "Files "*) from=${line#Files } from=${from%% and *} && cp "$from" "$tree/$from" || return 1 ;;
        "Only in $tree"*) from=${line#Only in } && rm -r "${from%%: *}/${from#*: }" || return 1 ;;
        "Only in "*) from=${line#Only in } to=${from%%: *} && cp -r "$to/${from#*: }" "$tree/$to/" || return 1 ;;
        *) echo "$line" >&2 && return 1 ;;
        esac
    done <"$work/differs"
}

# take_objects TREE: what `make test` has built need not be built again; programs are linked anew.
take_objects() {
    [ -d "$build/test" ] || return 0
    (cd "$build" && find test -type f ! -perm -100 -print0 | tar --null -T - -cf -) | tar -xf - -C "$1/build"
}

# put_in PATCH: what it changes is kept beside the tree.
put_in() {
    local file
    rm -rf "$work/before"
    for file in $(mutants_touched "$work/patches/$1"); do
        mkdir -p "$work/before/$(dirname "$file")" && cp "$tree/$file" "$work/before/$file" || return 1
    done
    (cd "$tree" && patch -p1 --fuzz=0 --no-backup-if-mismatch --force) <"$work/patches/$1" >"$log" 2>&1
}

# take_back: with a new date, as above.
take_back() {
    cp -r "$work/before/." "$tree/" || exit 1
}

# ---- building and running in it; what they print goes to $log

in_tree() {
    (cd "$tree" && exec env -u MAKEFLAGS -u MFLAGS -u MAKELEVEL SCANHEAD=build/test/scanhead READERS="$build/readers" BUILD=build \
        "$@") >>"$log" 2>&1 </dev/null 9>&- &
    child=$!
    wait "$child"
    local status=$?
    child=
    return $status
}

# build_it TARGET...
build_it() {
    in_tree make --no-print-directory -j"$jobs" DEPS=no WERROR= CFLAGS="-g1 ${CFLAGS:-}" CXXFLAGS="-g1 ${CXXFLAGS:-}" \
        BUILD=build/test "$@"
}

# targets_of NAME...: what make has to build for these tests.
targets_of() {
    local source
    for source in $(for_each_source "$@"); do
        case $source in
        tests/unit/*.c) echo "build/test/${source%.c}" ;;
        *.c) echo "build/test/${source%.c} all build/test/bench" ;;
        tests/guest/*.sh) echo "all build/test/bench" && (cd tests && ls guest/test_*.c | sed 's|\(.*\)\.c|build/test/tests/\1|') ;;
        *) echo "all build/test/bench" ;;
        esac
    done | tr ' ' '\n' | sort -u
}

for_each_source() {
    local name
    for name; do mutants_test "$name"; done
}

# run_test NAME LIMIT_S: 0 passes, 1 fails, else it could not be run.
run_test() {
    local programs
    programs=$(mutants_test "$1" | sed 's|^\(.*\)\.c$|build/test/\1|')
    in_tree bash tests/run_tap.sh -t "$2" $programs
}

# ---- what results depend on

# A hash of each source, once. What the page's scripts use is theirs alone.
hash_sources() {
    find $parts -type f ! -path 'tests/mutants/*' -print0 | LC_ALL=C sort -z | xargs -0 sha256sum >"$work/sources"
    grep -v -E ' tests/([a-z]+/test_[^/]*\.c|check_[^/]*\.sh|unit/page_.*|page/.*)$' "$work/sources" >"$work/shared"
    everything=$(sha256sum <"$work/sources")
}

# key_of FILE NAME...: of a patch (or /dev/null), all that is no test, and the tests of these names.
key_of() {
    local file=$1 source
    shift
    {
        cat "$file" "$work/shared"
        for source in $(for_each_source "$@"); do
            grep -F "  $source" "$work/sources"
            case $source in *.sh) grep -E ' tests/(unit/page_.*|page/.*)$' "$work/sources" ;; esac
        done
    } | sha256sum
}

# ---- the tests without a fault

declare -A clean_ms=() clean_why=()

# clean_test NAME: whether it passes, how long it takes; from the last run where nothing has changed.
clean_test() {
    local name=$1 key start passed
    key=$(key_of /dev/null "$name")
    if [ -e "$work/clean/$name" ] && { read -r was ms passed <"$work/clean/$name"; } && [ "$was" = "${key%% *}" ]; then
        clean_ms[$name]=$ms
    else
        log=$work/logs/clean_$name.log
        : >"$log"
        start=$(date +%s%3N)
        run_test "$name" $longest_s || { clean_why[$name]="$name fails without the fault, too: $log" && return; }
        clean_ms[$name]=$(($(date +%s%3N) - start))
        passed=$(sed -n '$s/ passed,.*//p' "$log")
        echo "${key%% *} ${clean_ms[$name]} $passed" >"$work/clean/$name"
    fi
    [ "$passed" -gt 0 ] || clean_why[$name]="skipped"
}

# Those of the faults of which nothing is known yet.
clean_tests() {
    local name i names
    names=$(for ((i = 0; i < ${#files[@]}; i++)); do [ -n "${states[i]}" ] || printf '%s\n' ${tests_of[i]}; done | sort -u)
    log=$work/logs/clean.log
    : >"$log"
    echo "the tree without a fault: $(echo $names | wc -w) tests"
    build_it all $(targets_of $names) || { tail -n 20 "$log" >&2 && echo "the tree without a fault does not build: $log" >&2 && exit 1; }
    for name in $names; do
        clean_test "$name"
        [ -z "${clean_why[$name]:-}" ] || echo "    $name: ${clean_why[$name]}"
    done
}

# ---- the faults

# Whether the test that ran last failed in nothing but that it did not end.
only_late() {
    grep -q 'did not end within' "$log" && ! grep -q '^ *not ok' "$log"
}

# judge FILE TESTS ARGUED: sets state and detail. found, argued, missed, skipped, broken.
judge() {
    local name limit_s ran=0
    state=broken
    put_in "$1" || { detail="it does not apply: $log" && return; }
    build_it $([ -n "$2" ] && targets_of $2 || echo all) || { detail="it does not compile: $log" && return; }
    if [ -n "$3" ]; then state=argued detail=$3 && return; fi
    for name in $2; do
        [ -z "${clean_why[$name]:-}" ] || continue
        ran=$((ran + 1))
        # A test that hangs is a find: this is ten times what it took, and half a minute.
        limit_s=$((clean_ms[$name] / 100 + 30))
        run_test "$name" $limit_s
        case $? in
        0) ;;
        1)
            state=found detail=$name
            only_late || return
            # Beside other work a test may only have been slow: once more, with four times the time.
            run_test "$name" $((4 * limit_s)) || return
            state=broken
            ;;
        *) detail="$name could not be run: $log" && return ;;
        esac
    done
    if [ $ran -eq 0 ]; then without_tests $2 && return; fi
    state=missed detail="$2 pass"
    [ $all = no ] || judge_by_all
}

# None of the named tests could be run: here it can't be told, or it never could.
without_tests() {
    local name
    state=skipped detail="its tests are skipped here: $*"
    for name; do
        if [ "${clean_why[$name]}" != skipped ]; then state=broken detail=${clean_why[$name]}; fi
    done
}

# By all tests but the guests'. One that fails counts if it passes without the fault: that is seen after.
judge_by_all() {
    local part
    build_it test-programs || { state=broken detail="with it, not all tests compile: $log" && return; }
    for part in unit accuracy stability wire; do
        in_tree sh tests/run_all.sh build $part || { state=suspected detail=$(sed -n 's/^FAIL \([^ ]*\).*/\1/p' "$log" | tr '\n' ' ') && return; }
    done
    detail="all tests pass"
}

# Those that failed, in the tree without the fault.
confirm() {
    local name
    build_it $(targets_of ${detail//.sh/}) || return
    for name in ${detail//.sh/}; do
        run_test "$name" $longest_s && state=found detail="$name, which its patch does not name" && return
    done
    state=missed detail="$detail fail without the fault, too"
}

# known FILE TESTS: sets state and detail as the last run left them, where nothing has changed since.
known() {
    local key was whole
    key=$(key_of "$work/patches/$1" $2)
    state= detail=
    [ -e "$work/results/${1%.patch}" ] || return
    read -r was whole state detail <"$work/results/${1%.patch}"
    [ "$was" = "${key%% *}" ] && { [ $state != missed ] || [ $all = no ] || [ "$whole" = "${everything%% *}" ]; } || state=
}

# one FILE TESTS ARGUED: by trying.
one() {
    local key short
    short=${1%.patch}
    log=$work/logs/$short.log
    key=$(key_of "$work/patches/$1" $2)
    judge "$@"
    take_back
    [ $state != suspected ] || confirm
    case $state in
    found | argued | missed)
        echo "${key%% *} $([ $all = yes ] && echo "${everything%% *}" || echo -) $state $detail" >"$work/results/$short"
        ;;
    esac
}

files=() tests_of=() faults=() argued_of=() wrong_of=()
read_list() {
    local file fault tests argued wrong name
    while IFS=$'\037' read -r file fault tests argued wrong; do
        for name in $tests; do
            [ -n "$wrong" ] || mutants_test "$name" >/dev/null || wrong="no test $name"
        done
        [ -z "$wrong" ] || tests=
        files+=("$file") faults+=("$fault") tests_of+=("$tests") argued_of+=("$argued") wrong_of+=("$wrong")
    done < <(cd "$work/patches" && mutants_list $pattern.patch)
}

# ---- the end

table='
    { sub(/-.*/, "", $2); n[$2]++; of[$2, $1]++; total++; all[$1]++; if (!($2 in seen)) { seen[$2] = 1; area[++areas] = $2 } }
    END {
        row = "%-12s %6s %6s %6s %9s %7s %7s\n"
        printf row, "area", "faults", "found", "argued", "not found", "skipped", "broken"
        for (i = 1; i <= areas; i++) { a = area[i]
            printf row, a, n[a], of[a, "found"] + 0, of[a, "argued"] + 0, of[a, "missed"] + 0, of[a, "skipped"] + 0, of[a, "broken"] + 0 }
        printf row, "all", total, all["found"] + 0, all["argued"] + 0, all["missed"] + 0, all["skipped"] + 0, all["broken"] + 0
        judged = all["found"] + all["argued"] + all["missed"]
        percent = judged ? 100 * all["found"] / judged : 0
        printf "%.1f %% of %d are found; at least %d %% are needed\n", percent, judged, least
        exit percent < least || all["broken"] > 0
    }'

finish() {
    local status i
    for state in missed broken skipped; do
        for ((i = 0; i < ${#files[@]}; i++)); do
            [ "${states[i]}" != $state ] || echo "${state/missed/not found}: ${files[i]%.patch}: ${faults[i]} (${details[i]})"
        done
    done
    for ((i = 0; i < ${#files[@]}; i++)); do echo "${states[i]} ${files[i]}"; done | awk -v least=$least_percent "$table"
}

# As they are now: nobody waits with changes until this ends.
rm -rf "$work/patches"
cp -r tests/mutants "$work/patches" || exit 1
read_list
[ -e "$work/patches/${files[0]}" ] || { echo "no patch tests/mutants/$pattern.patch" >&2; exit 2; }
same_tree || { echo "no copy of the tree in $tree" >&2; exit 1; }
hash_sources
states=() details=() unknown=0
for ((i = 0; i < ${#files[@]}; i++)); do
    if [ -n "${wrong_of[i]}" ]; then state=broken detail=${wrong_of[i]}; else known "${files[i]}" "${tests_of[i]}"; fi
    states+=("$state") details+=("$detail")
    [ -n "$state" ] || unknown=$((unknown + 1))
done
echo "${#files[@]} faults; of $((${#files[@]} - unknown)) the result is known"
[ $unknown -eq 0 ] || clean_tests
n=0
for ((i = 0; i < ${#files[@]}; i++)); do
    [ -z "${states[i]}" ] || continue
    start=$(date +%s%3N) n=$((n + 1))
    one "${files[i]}" "${tests_of[i]}" "${argued_of[i]}"
    states[i]=$state details[i]=$detail
    took_ms=$(($(date +%s%3N) - start))
    printf '[%3d/%d] %-9s %s: %s, %d.%d s\n' $n $unknown "${state/missed/not found}" "${files[i]%.patch}" "$detail" \
        $((took_ms / 1000)) $((took_ms % 1000 / 100))
done
finish
