/* SPDX-License-Identifier: MIT */
/* A mesh's note on triangles without area. */
#include "tests/unit/recorder_rig.h"

/* Of the first line's four shots two are at one place, and so are two of the second line. One of the three cells has
 * an edge of no length on either side: its two triangles have no area. */
static void flat_triangles_are_noted(void **state)
{
    (void)state;
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
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
                                        .frames = 1,
                                        .mirror_counts_per_turn = 3600,
                                        .pan_counts_per_turn = 3600,
                                        .range_scale_m = 1e-3};
    static uint8_t out[1024];
    struct rig_point p[2][4];
    rig_begin();
    rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, 0));
    rig_anchor(&a);
    for (uint32_t line = 0; line < 2; line++) {
        for (int k = 0; k < 4; k++)
            p[line][k] = (struct rig_point){1000 * (int32_t)line, 5000, 1000 * (k - (k > 1)), -500, 0, 1, 1};
        rig_points(line, 1000 * line, 1000 * line, p[line], 4);
    }
    free(rig_record_bytes("a.ply", (struct recorder_options){.mesh = 1}, NULL));
    assert_non_null(strstr(rig_notes, "2 triangles left out that have no area or are seen edge-on"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(flat_triangles_are_noted),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
