/* SPDX-License-Identifier: MIT */
/* Several scans of one recording, in one file and each in its own. */
#include "tests/wire/room.h"

static const char CONFIG[] = "head: {profile: full-sweep, prr_hz: 10000, lines_hz: 40, pan_deg_s: 180, frames: 1}\n"
                             "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
                             "stations:\n"
                             "  - {position_m: [0, 0, 0]}\n"
                             "  - {position_m: [1, 1, 0]}\n"
                             "links: [{type: \"null\"}]\n";

static void copy_path(const struct wire *wire, const char *name, char path[352])
{
    snprintf(path, 352, "%s", wire_path(wire, name));
}

static void expect_same(const struct wire *wire, const char *a, const char *b)
{
    size_t a_len, b_len;
    char *a_text = wire_read(wire_path(wire, a), &a_len), *b_text = wire_read(wire_path(wire, b), &b_len);
    assert_int_equal(a_len, b_len);
    assert_memory_equal(a_text, b_text, a_len);
    free(a_text);
    free(b_text);
}

/* Runs `record IN -o OUT` in the folder. */
static void convert(struct wire *wire, const char *in, const char *out)
{
    char from[352], to[352];
    copy_path(wire, in, from);
    copy_path(wire, out, to);
    wire_run(wire, (const char *const[]){"record", from, "-o", to, "--quiet", NULL}, 0);
}

/* The raw streams one after the other give the LAS of the whole recording. Each by itself gives the LAS file beside
 * it. */
static void test_split(void **state)
{
    struct wire *wire = *state;
    char config[352], shs[352], las[352], csv[352];
    size_t len[2];
    room_write(wire);
    snprintf(config, sizeof config, "%s", wire_write_text(wire, "config.yaml", CONFIG));
    copy_path(wire, "s.shs", shs);
    copy_path(wire, "s.las", las);
    copy_path(wire, "s.poses.csv", csv);
    wire_run(wire,
             (const char *const[]){"record", config, "--station", "all", "--split", "-o", shs, "-o", las, "-o", csv,
                                   "--quiet", NULL},
             0);
    assert_int_equal(access(las, F_OK), -1);
    wire_run(wire, (const char *const[]){"record", config, "--station", "all", "-o", shs, "-o", las, "--quiet", NULL},
             0);
    char *first = wire_read(wire_path(wire, "s-1.shs"), &len[0]),
         *second = wire_read(wire_path(wire, "s-2.shs"), &len[1]);
    assert_true(len[0] > 100000 && len[1] > 100000);
    first = realloc(first, len[0] + len[1]);
    memcpy(first + len[0], second, len[1]);
    wire_write(wire, "both.shs", first, len[0] + len[1]);
    convert(wire, "both.shs", "both.las");
    expect_same(wire, "both.las", "s.las");
    convert(wire, "s-1.shs", "1.las");
    expect_same(wire, "1.las", "s-1.las");
    convert(wire, "s-2.shs", "2.las");
    expect_same(wire, "2.las", "s-2.las");
    char *rows = wire_read(wire_path(wire, "s-2.poses.csv"), NULL);
    assert_non_null(
        strstr(rows, "\n1,2,0,1,1,0,1,0,0,0,")); /* scan 1 of this file: station 2, at (1 1 0), not turned */
    free(rows);
    free(first);
    free(second);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_split, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
