# SPDX-License-Identifier: MIT
# The scripts of this folder source this. $build is the folder with the built targets.

# fuzz_one NAME FOLDER OPTION...: runs a target, from its seeds, from inputs that were found before, and from
# $FOLDER/corpus. FOLDER gets its `log`, its exit `status`, and in `crash/` the input that made it fail.
fuzz_one() {
    fuzz_name=$1 fuzz_to=$2
    shift 2
    mkdir -p "$fuzz_to/corpus" "$fuzz_to/crash"
    # Files lie in memory, so targets of streams run 1.5 times as many inputs.
    fuzz_tmp=$(mktemp -d /dev/shm/scanhead-fuzz.XXXXXX 2>/dev/null) || { fuzz_tmp=$fuzz_to/tmp && mkdir -p "$fuzz_tmp"; }
    for fuzz_dir in tests/fuzz/seeds/$fuzz_name tests/fuzz/found/$fuzz_name; do
        [ ! -d "$fuzz_dir" ] || set -- "$@" "$fuzz_dir"
    done
    [ ! -f "tests/fuzz/$fuzz_name.dict" ] || set -- "-dict=tests/fuzz/$fuzz_name.dict" "$@"
    TMPDIR="$fuzz_tmp" ASAN_OPTIONS="${ASAN_OPTIONS:-}:detect_leaks=1:allocator_may_return_null=1:handle_abort=1" \
        UBSAN_OPTIONS="${UBSAN_OPTIONS:-}:print_stacktrace=1" \
        "$build/tests/fuzz/fuzz_$fuzz_name" -print_final_stats=1 -timeout=20 -rss_limit_mb=3000 -max_len=16384 \
        -artifact_prefix="$fuzz_to/crash/" "$fuzz_to/corpus" "$@" >"$fuzz_to/out" 2>"$fuzz_to/log" </dev/null
    echo $? >"$fuzz_to/status"
    rm -rf "$fuzz_tmp"
}

# fuzz_stat FOLDER NAME: prints a figure that libFuzzer gives at the end.
fuzz_stat() {
    sed -n "s/^stat::$2: *//p" "$1/log" | tail -n 1
}

# fuzz_say FOLDER: says in short why it failed.
fuzz_say() {
    grep -a -E 'ERROR|SUMMARY|runtime error|claim does not hold|Test unit written|^ *#[0-9]+ ' "$1/log" | head -n 24 | cut -c -200
    ls "$1/crash" | sed 's/^/input: crash\//'
}
