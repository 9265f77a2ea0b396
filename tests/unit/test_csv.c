/* SPDX-License-Identifier: MIT */
/* CSV files of numbers: columns in any order, lines that do not count, and the diagnostics with their lines. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/csv.h"
#include "tests/unit/file_rig.h"
#include "tests/common/cases.h"

#define DIGITS_63 "123456789012345678901234567890123456789012345678901234567890123"

static const char *const known[] = {"t", "x", "y", NULL};
static struct csv csv;
static struct sh_err err;

static int open_text(const char *text)
{
    FILE *f = fopen(file_path, "w");
    assert_non_null(f);
    fputs(text, f);
    assert_int_equal(fclose(f), 0);
    return csv_open(&csv, file_path, known, NULL, &err);
}

/* A value goes to its column's name. A column that the file lacks reads 0. Lines count from 1, with those that hold
 * nothing. */
static void values_go_to_their_columns(void **state)
{
    (void)state;
    assert_int_equal(open_text("# places\n\n y ,t\r\n1.5, -2\n#3,4\n"), SH_OK);
    assert_int_equal(csv.n_columns, 2);
    assert_int_equal(csv.has, 1 << 0 | 1 << 2);
    assert_int_equal(csv.line, 3);
    assert_int_equal(csv_next(&csv, &err), 1);
    assert_true(csv.value[0] == -2.0 && csv.value[1] == 0.0 && csv.value[2] == 1.5);
    assert_int_equal(csv.line, 4);
    csv_close(&csv);
    assert_int_equal(open_text("x\n1e3\n-0.25"), SH_OK);
    assert_true(csv_next(&csv, &err) == 1 && csv.value[1] == 1e3);
    assert_true(csv_next(&csv, &err) == 1 && csv.value[1] == -0.25);
    assert_int_equal(csv_next(&csv, &err), 0);
    csv_close(&csv);
    assert_int_equal(open_text("t,x\n " DIGITS_63 "\t, \t2 \n"), SH_OK); /* blanks don't count */
    assert_true(csv_next(&csv, &err) == 1 && csv.value[1] == 2.0);
    assert_true(csv.value[0] == 123456789012345678901234567890123456789012345678901234567890123.0);
    csv_close(&csv);
}

/* A cell has up to 63 bytes. Each diagnostic has the file, the line, and what is allowed there. */
static void diagnostics_have_lines(void **state)
{
    (void)state;
    static const struct {
        const char *text, *line, *why;
    } bad[] = {{"", "", "empty; the first line must name the columns"},
               {"# t\n", "", "empty; the first line must name the columns"},
               {"t,z\n", ", line 1", "column \"z\" is unknown; allowed t, x, y"},
               {"\nt,x,t\n", ", line 2", "column \"t\" is there twice; allowed t, x, y"},
               {"t,x\n1,2,3\n", ", line 2", "more than the 2 values that the first line names"},
               {"t,x\n\n1\n", ", line 3", "1 values, but the first line names 2"},
               {"t,x\n1,\n", ", line 2", "x is not a finite decimal number: \"\""},
               {"t,x\n1,2m\n", ", line 2", "x is not a finite decimal number: \"2m\""},
               {"t,x\n0x1,2\n", ", line 2", "t is not a finite decimal number: \"0x1\""},
               {"t,x\n1,inf\n", ", line 2", "x is not a finite decimal number: \"inf\""},
               {"t,x\n1,nan\n", ", line 2", "x is not a finite decimal number: \"nan\""},
               {"t,x\n1,1e999\n", ", line 2", "x is not a finite decimal number: \"1e999\""},
               {"t,x\n1,\"2\"\n", ", line 2", "x is not a finite decimal number: \"\"2\"\""},
               {"t," DIGITS_63 "\n", ", line 1", "column \"" DIGITS_63 "\" is unknown; allowed t, x, y"},
               {"t,1" DIGITS_63 "\n", ", line 1", "a column's name is too long"},
               {"t,x\n1,1" DIGITS_63 "\n", ", line 2", "x is not a finite decimal number: \"...\""}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        char want[256];
        int code = open_text(bad[i].text);
        if (code == SH_OK) code = csv_next(&csv, &err);
        snprintf(want, sizeof want, "%s%s: %s", file_path, bad[i].line, bad[i].why);
        assert_int_equal(code, SH_EINPUT);
        assert_string_equal(err.text, want);
        csv_close(&csv);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(values_go_to_their_columns),
        cmocka_unit_test(diagnostics_have_lines),
    };
    return cmocka_run_group_tests(tests, make_file, remove_file);
}
