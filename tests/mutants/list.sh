# SPDX-License-Identifier: MIT
# The list of small faults; to be sourced, with the root of the tree as the working folder.

# mutants_list FILE...: a line a patch of five fields, apart by \037: the file, the fault, the tests that find it, why none
# does, and what is wrong with the patch's text.
mutants_list() {
    LC_ALL=C awk '
        function want(file, text) { if (wrong == "") wrong = text }
        function look(file, line) {
            if (line ~ /^(diff --git|---) /) head = 0
            if (head && line ~ /^Fault: ./) { faults++; fault = substr(line, 8) }
            else if (head && line ~ /^Found by: ./) { reasons++; tests = substr(line, 11) }
            else if (head && line ~ /^Argued: ./) { reasons++; argued = substr(line, 9) }
            else if (head && line !~ /^[ \t]*$/) want(file, "before the patch there is \"" line "\"; allowed: Fault:, Found by:, Argued:")
            if (line ~ /^\+\+\+ / && ++changed && line !~ /^\+\+\+ b\/(core|drivers|firmware_sim|config)\//)
                want(file, "it changes " substr(line, 5) "; allowed: b/core, b/drivers, b/firmware_sim, b/config")
        }
        BEGIN {
            for (i = 1; i < ARGC; i++) {
                fault = tests = argued = wrong = ""; faults = reasons = changed = 0; head = 1
                while ((getline line < ARGV[i]) > 0) look(ARGV[i], line)
                close(ARGV[i])
                if (ARGV[i] !~ /(^|\/)[a-z0-9_]+-[a-z0-9_-]+\.patch$/) want(ARGV[i], "its name is not AREA-words.patch")
                if (faults != 1) want(ARGV[i], faults " lines \"Fault: ...\"; one is needed")
                if (reasons != 1) want(ARGV[i], reasons " lines \"Found by: ...\" or \"Argued: ...\"; one is needed")
                if (!changed) want(ARGV[i], "it changes no file")
                printf "%s\037%s\037%s\037%s\037%s\n", ARGV[i], fault, tests, argued, wrong
            }
        }' "$@"
}

# mutants_test NAME: the sources of the test of that name, as `make test T=NAME` understands it; fails where there is none.
mutants_test() {
    local path found=1
    for path in tests/{unit,wire,accuracy,stability,guest}/"$1".c tests/{,guest/,page/}"$1".sh; do
        if [ -e "$path" ]; then echo "$path" && found=0; fi
    done
    return $found
}

# mutants_touched FILE: the sources that a patch changes.
mutants_touched() {
    sed -n 's|^+++ b/\([^[:space:]]*\).*|\1|p' "$1"
}
