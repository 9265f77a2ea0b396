/* SPDX-License-Identifier: MIT */
/* The client in Python: figures that few streams have (python_figures.py), with numpy and without. Run from the top of
 * the source tree. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

static const char PYTHON[] = "/usr/bin/python3";

static void run(const char *flavour)
{
    char command[128], line[64] = "";
    if (access(PYTHON, X_OK) != 0) {
        print_message("# %s is missing\n", PYTHON);
        skip();
    }
    snprintf(command, sizeof command, "%s tests/unit/python_figures.py %s", PYTHON, flavour);
    FILE *in = popen(command, "r");
    assert_non_null(in);
    const int got = fgets(line, sizeof line, in) != NULL;
    assert_int_equal(pclose(in), 0);
    assert_true(got);
    if (strcmp(line, "no numpy\n") == 0) skip();
    assert_string_equal(line, "same\n");
}

static void test_plain(void **state)
{
    (void)state;
    run("plain");
}

static void test_numpy(void **state)
{
    (void)state;
    run("numpy");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_plain), cmocka_unit_test(test_numpy)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
