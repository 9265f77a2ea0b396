/* SPDX-License-Identifier: MIT */
/* The header of a recorded mesh says what its colours show, and the recorder says where no point is spread over it. */
#include "tests/unit/grid_rig.h"

/* Two lines of two shots, whose hits are the corners of a square metre at 10 m. */
static void put_square(void)
{
    rig_begin();
    grid_rig_begin_scan(1, 3);
    for (int line = 0; line < 2; line++)
        grid_rig_put_line((uint32_t)line, 20,
                          (const struct rig_point[]){grid_rig_hit(line, 10, 0, 0), grid_rig_hit(line, 10, 1, 0)}, 2);
}

static char *record(struct recorder_options options)
{
    put_square();
    return rig_record_bytes("a.ply", options, NULL);
}

/* The header says what colours show, with their limits; not where the file has none. */
static void colours_are_explained(void **state)
{
    (void)state;
    static const char line[] = "comment red green blue show the range, blue is 9, red 12.5 m\n";
    struct recorder_options options = {.ascii = 1, .colour = {.given = 1}};
    options.colour.scale.mode = COLOUR_RANGE;
    options.colour.scale.low = 9;
    options.colour.scale.high = 12.5;
    for (int i = 0; i < 3; i++) {
        options.mesh = i != 1;
        options.sparse_per_m2 = i == 1 ? 1 : 0;
        options.columns = i == 2 ? PLY_RANGE : 0;
        char *text = record(options);
        assert_int_equal(rig_count(text, line), i < 2);
        assert_int_equal(rig_count(text, "property uchar red\n"), i < 2);
        free(text);
    }
}

static void a_density_without_points(void **state)
{
    (void)state;
    char *text = record((struct recorder_options){.sparse_per_m2 = 1e-6});
    assert_int_equal(rig_count(text, "element vertex 0\n"), 1);
    assert_int_equal(rig_count(rig_notes, "a.ply: --sparse 1e-06: no point on 1 m2 of mesh\n"), 1);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(colours_are_explained),
        cmocka_unit_test(a_density_without_points),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
