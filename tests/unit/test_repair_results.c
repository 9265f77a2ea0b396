/* SPDX-License-Identifier: MIT */
/* What `repair` says of its files, as lines and as JSON, and its exit status. The repairs are the test's. */
#include "tests/unit/commands_rig.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/record/repair.h"
#include "firmware_sim/app/studio/record/repair.h"
#include "tests/unit/output_rig.h"

static struct repaired results[8];
static int codes[8], n_freed;

/* A path's last letter is the number of its result. */
int repair_file(const char *path, const struct sh_report *report, struct repaired *repaired, struct sh_err *err)
{
    const int i = path[strlen(path) - 1] - '0';
    assert_ptr_equal(report, &app_report_seconds);
    *repaired = results[i];
    return codes[i] == SH_OK ? SH_OK : sh_fail(err, codes[i], "%s: it is broken", path);
}

void repair_free(struct repaired *repaired)
{
    (void)repaired;
    n_freed++;
}

static char path[] = "a.ply", part[] = "a.ply.part";

static void set(int i, struct repaired repaired)
{
    results[i] = repaired;
    results[i].path = path;
    results[i].part = part;
}

static int go_there(void **state)
{
    (void)state;
    set(0, (struct repaired){.n_kept = 5, .unit = "points", .was_whole = 1});
    set(1, (struct repaired){.n_kept = 6, .n_scans = 1, .unit = "points", .cut_bytes = 1, .was_left = 1});
    set(2, (struct repaired){.n_kept = 7, .n_scans = 2, .unit = "packets", .was_left = 1, .was_whole = 1});
    set(3, (struct repaired){.n_kept = 8, .unit = "points", .cut_bytes = 2, .was_left = 1, .is_part = 1});
    codes[4] = SH_EINPUT;
    codes[5] = SH_EIO;
    return commands_begin();
}

static int repair(const char *numbers, const char *stats, int quiet)
{
    static const char *const names[] = {"f0", "f1", "f2", "f3", "f4", "f5"};
    const char *paths[8];
    struct output err;
    int n = 0;
    for (const char *at = numbers; *at != '\0'; at++)
        paths[n++] = names[*at - '0'];
    n_freed = 0;
    free(on_err);
    output_take(&err, stderr);
    const int status = record_repair(paths, n, stats, quiet);
    on_err = output_give(&err);
    assert_int_equal(n_freed, n);
    return status;
}

static void a_line_for_each(void **state)
{
    static const char *const lines[] = {
        "scanhead: a.ply: whole: 5 points, nothing to repair\n",
        "scanhead: a.ply: kept 6 points of 1 scan; 1 byte at the end cut; data after that may be missing\n",
        "scanhead: a.ply: kept 7 packets of 2 scans; 0 bytes at the end cut; nothing else was changed\n",
        ("scanhead: a.ply.part: kept 8 points; 2 bytes at the end cut; data after that may be missing\n"
         "scanhead: a.ply.part keeps its name: a.ply exists, and is not replaced\n"),
        "scanhead: f4: it is broken\n"};
    static const char *const numbers[] = {"0", "1", "2", "3", "4"};
    (void)state;
    for (int i = 0; i < 5; i++) {
        assert_int_equal(repair(numbers[i], NULL, 0), i < 4 ? APP_OK : APP_USAGE);
        assert_string_equal(on_err, lines[i]);
        repair(numbers[i], NULL, 1);
        assert_string_equal(on_err, i < 4 ? "" : lines[i]);
    }
}

/* One that fails does not stop the others, and the worst status counts. */
static void the_worst_status(void **state)
{
    static const struct {
        const char *numbers;
        int status;
    } rows[] = {{"01", APP_OK}, {"50", APP_FAILED}, {"05", APP_FAILED}, {"45", APP_USAGE}, {"54", APP_USAGE}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        assert_int_equal(repair(rows[i].numbers, NULL, 1), rows[i].status);
}

static void json(void **state)
{
    (void)state;
    assert_int_equal(repair("134", "j.json", 1), APP_USAGE);
    char *text = contents("j.json");
    assert_string_equal(
        text, "[\n  {\n    \"file\": \"a.ply\",\n    \"unit\": \"points\",\n    \"kept\": 6,\n    \"scans\": 1,\n"
              "    \"cut_bytes\": 1,\n    \"was_whole\": false,\n    \"was_left\": true\n  },\n"
              "  {\n    \"file\": \"a.ply.part\",\n    \"unit\": \"points\",\n    \"kept\": 8,\n    \"scans\": "
              "0,\n    \"cut_bytes\": 2,\n    \"was_whole\": false,\n    \"was_left\": true\n  },\n"
              "  {\n    \"file\": \"f4\",\n    \"error\": \"f4: it is broken\"\n  }\n]\n");
    free(text);
    assert_int_equal(repair("0", "no/j.json", 1), APP_USAGE); /* there is no such folder */
    has(on_err, "no/j.json");
    assert_int_equal(repair("5", "no/j.json", 1), APP_FAILED); /* the first failure stays */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_line_for_each),
        cmocka_unit_test(the_worst_status),
        cmocka_unit_test(json),
    };
    return cmocka_run_group_tests(tests, go_there, commands_end);
}
