/* SPDX-License-Identifier: MIT */
/* A mesh's note on triangles without area. */
#include "tests/unit/grid_rig.h"

/* Of the first line's four shots two are at one place, and so are two of the second line. One of the three cells has
 * an edge of no length on either side: its two triangles have no area. */
static void flat_triangles_are_noted(void **state)
{
    (void)state;
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    const struct native_descriptor d = grid_rig_descriptor(1);
    struct rig_point p[2][4];
    rig_begin();
    grid_rig_put_descriptor(&d);
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
