#!/bin/bash
# SPDX-License-Identifier: MIT
# The tool of `make mutants`: draws are the same for a seed, each operator makes valid C, and in an example of few lines
# each mutant is judged as it should be. `make mutants` shows whether the tests find mutants of the product. Prints TAP.
set -u
cd "$(dirname "$0")/.." || exit 1
top=$PWD
work=$(mktemp -d) || exit 1
trap 'rm -rf "$work"' EXIT
. tests/tap.sh
for program in clang llvm-cov llvm-profdata ccache python3 setpriv prlimit; do
    command -v $program >/dev/null || { echo "1..0 # SKIP $program is missing"; exit 0; }
done

draws_repeat() {
    python3 -B - <<'END'
import itertools, sys
sys.path.insert(0, "tests/mutants")
import draw, tree
places = [(name, 1 + i) for name in tree.sources() for i in range(tree.read(name).count(b"\n"))]
one, same, other = (list(map(str, itertools.islice(draw.draw(places, seed), 30))) for seed in ("7", "7", "8"))
sys.exit(0 if one == same and one != other and len(set(one)) == 30 else "\n".join(one + same + other))
END
}
check "a seed has the same draws each time, none twice, and another seed has others" draws_repeat

# ---- operators
cat >"$work/lines.c" <<'END'
#include <pthread.h>
static pthread_mutex_t mutex = PTHREAD_MUTEX_INITIALIZER;
static int add(int a, int b) { return a + b; }
int lines(int n)
{
    int sum = 0;
    for (int i = 0; i < n; i++)
        sum += add(i, n);
    if (sum > 3 && n != 2)
        sum = (int)(2.5 * sum);
    pthread_mutex_lock(&mutex);
    n = 0;
    pthread_mutex_unlock(&mutex);
    return sum;
}
END
operators_make_c() {
    python3 -B - "$work/lines.c" <<'END'
import subprocess, sys
sys.path.insert(0, "tests/mutants")
import draw
source, met = draw.Source(sys.argv[1]), {}
for number in range(len(source.lines)):
    for name, edits in draw.mutants_of(source, number):
        met.setdefault(name, edits)
missing = {*draw.OPERATORS, "lock"} - set(met)
bad = [name for name, edits in met.items() if subprocess.run(
    ["cc", "-fsyntax-only", "-w", "-x", "c", "-"], text=True, check=False,
    input="\n".join(edits.get(i, line) for i, line in enumerate(source.lines))).returncode != 0]
sys.exit(f"no mutant of {sorted(missing)}; not C: {bad}" if missing or bad else 0)
END
}
check "each operator makes something, and it is C" operators_make_c

# ---- an example with one mutant of each kind
mkdir -p "$work/tiny/core/tiny" "$work/tiny/firmware_sim" "$work/tiny/tests/unit" "$work/tiny/tests/wire"
cd "$work/tiny" || exit 1
cp "$top/tests/rigs.sh" tests/
cat >Makefile <<'END'
objects: $(BUILD)/core/tiny/tiny.c.o $(BUILD)/core/tiny/text.c.o $(BUILD)/firmware_sim/main.c.o
$(BUILD)/%.c.o: %.c
	@mkdir -p $(@D)
	$(CC) $(SAN) -O2 -I. -MMD -MP -fPIC -c $< -o $@
END
cat >core/tiny/tiny.c <<'END'
int tiny_most(int a, int b);
int tiny_is_of_age(int years);
int tiny_negative(int a);
int tiny_most(int a, int b)
{
    a |= a;
    return a < b ? b : a;
}
int tiny_is_of_age(int years)
{
    return years >= 20;
}
int tiny_negative(int a)
{
    return -a;
}
END
cat >core/tiny/text.c <<'END'
#include <stdlib.h>
int tiny_text(void);
int tiny_text(void)
{
    char *volatile text = malloc(3);
    if (text == NULL) return 1;
    text[2] = 0;
    free(text);
    return 0;
}
END
cat >firmware_sim/main.c <<'END'
int tiny_text(void);
int main(void) { return tiny_text(); }
END
cat >tests/wire/test_tiny.c <<'END'
#include <stdlib.h>
int main(void)
{
    return system("$SCANHEAD || { echo >./-; false; }") != 0;
}
END
echo 'for name in tiny; do' >tests/check_sanitized.sh
cat >tests/unit/test_tiny.c <<'END'
int tiny_most(int a, int b);
int tiny_is_of_age(int years);
int main(void)
{
    return tiny_most(1, 2) != 2 || tiny_is_of_age(10) || !tiny_is_of_age(30);
}
END
cp -r "$work/tiny" "$work/before"
asan=-fsanitize=address
tiny() { LINK=cc LIBS='' SHIPPED=CC=cc LINK_SANITIZED="clang $asan" SANITIZED="CC=clang SAN=$asan" python3 -B "$top/tests/mutants/run.py" -n 100 -j 2 build >"$work/tiny.out" 2>&1; }
whole() {
    tiny
    [ $? = 1 ] || { cat "$work/tiny.out"; return 1; }
}
said() { grep -e "$1" "$work/tiny.out" || { cat "$work/tiny.out"; return 1; }; }
check "the example is tried to its end" whole
check "what a test sees is found" said '] found .*relation: return a < b ? b : a;  ->  return a > b ? b : a;  by unit/test_tiny'
check "an error of memory in a command is found by its test with a sanitized head" \
    said '] found .*bound: char .volatile text = malloc(3);  ->  char .volatile text = malloc(2);  by wire/test_tiny, sanitized'
check "what is the same code is equivalent" said '] equivalent .*dropped: a |= a;'
check "what no test sees survives" said '^survived .*relation: return years >= 20;  ->  return years > 20;'
check "what no test calls is unreached" said '^unreached .*sign: return -a;  ->  return a;'
unchanged() { [ ! -e build/mutants/tree/- ] && diff -r -x build "$work/before" . && [ -z "$(find build -name 'worker-*')" ]; }
check "no source has changed, and no worker's folder is left, nor a file of a test" unchanged
echo "1..$tests"
