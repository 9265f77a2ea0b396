/* SPDX-License-Identifier: MIT */
/* The header of a recorded mesh says what its colours show, and the recorder says where no point is spread over it. */
#include "tests/unit/recorder_rig.h"

/* Two lines of two shots, whose hits are the corners of a square metre at 10 m. */
static void put_square(void)
{
    static uint8_t out[1024];
    const struct native_descriptor d = {.idn = "Maker,Model,SN1,1.0",
                                        .profile = "model",
                                        .scan = 1,
                                        .layout = NATIVE_GEO,
                                        .prr_uhz = 1000000000,
                                        .lines_uhz = 1000000,
                                        .pan_udeg_s = 36000000,
                                        .pan_stop_udeg = 360000000,
                                        .sweep_udeg = 360000000,
                                        .line_stop_udeg = 36000000,
                                        .range_max_m = 100,
                                        .frames = 1};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 3);
    memcpy(a.anchor, a.station_m, sizeof a.anchor);
    memcpy(a.axes, (const double[9]){1, 0, 0, 0, 1, 0, 0, 0, 1}, sizeof a.axes);
    rig_begin();
    rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, 0));
    rig_anchor(&a);
    for (int line = 0; line < 2; line++) {
        const struct rig_point p[2] = {{1000 * line, 10000, 0, -500, 0, 1, 1},
                                       {1000 * line, 10000, 1000, -500, 0, 1, 1}};
        rig_points((uint32_t)line, 1000 * (uint64_t)line, 1000 * (uint64_t)line + 20, p, 2);
    }
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
