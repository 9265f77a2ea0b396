/* SPDX-License-Identifier: MIT */
/* Images of grids that are larger than a texture may be, and of a grid with loose points. The number of lines and rows
 * that share a texel is reported, for the scan with the largest. */
#include "core/scene.h"
#include "tests/unit/recorder_rig.h"

enum { PULSES = 20000, FULL = 10 }; /* pulses of a line, 1000 a second as in the rig; lines of a turn */

static void begin_scan(uint32_t scan)
{
    static uint8_t out[1024];
    const struct native_descriptor d = {.idn = "Maker,Model,SN1,1.0",
                                        .profile = "model",
                                        .scan = scan,
                                        .layout = NATIVE_GEO,
                                        .prr_uhz = INT64_C(1000000000),
                                        .lines_uhz = INT64_C(1000000000) / PULSES,
                                        .pan_udeg_s = 1800000,
                                        .pan_stop_udeg = 360000000,
                                        .sweep_udeg = 360000000,
                                        .line_stop_udeg = 360000000,
                                        .range_max_m = 100,
                                        .frames = 1,
                                        .mirror_counts_per_turn = 3600,
                                        .pan_counts_per_turn = 3600,
                                        .range_scale_m = 1e-3};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, scan);
    memcpy(a.axes, (const double[9]){1, 0, 0, 0, 1, 0, 0, 0, 1}, sizeof a.axes);
    for (int k = 0; k < 3; k++)
        a.scale[k] = 1e-3;
    rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, 0));
    rig_anchor(&a);
}

/* Two lines of two shots make triangles, and one more shot of each line is in the last of `rows` rows. */
static void put_wall(uint32_t rows)
{
    for (uint32_t line = 0; line < 2; line++) {
        const int32_t x = 1000 * (int32_t)line;
        const struct rig_point p[2] = {{x, 10000, 0, -500, 1, 1, 1}, {x, 10000, 1000, -500, 1, 1, 1}};
        const struct rig_point last = {x, 10000, 50000, -500, 1, 1, 1};
        const uint64_t pulse = (uint64_t)line * PULSES;
        rig_points(line, pulse, pulse, p, 2);
        rig_points(line, pulse, pulse + rows - 1, &last, 1);
    }
}

/* A texture has up to 16384 rows. Two of 16385 share one, whatever scan comes before or after. */
static void the_largest_step_is_said(void **state)
{
    (void)state;
    static const uint32_t rows[][2] = {{16385, 3}, {3, 16385}, {16385, 16384}, {16384, 16384}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct sh_err err;
        rig_begin();
        for (uint32_t scan = 1; scan <= 2; scan++) {
            begin_scan(scan);
            put_wall(rows[i][scan - 1]);
        }
        if (rig_record(rig_path("a.obj"), (struct recorder_options){.long_edge = 0}, RIG_KEEP, &err) != SH_OK)
            fail_msg("%s", err.text);
        const char *said =
            strstr(rig_notes, "2 lines and rows share one texel, since a texture has up to 16384 texels a side");
        if ((said != NULL) != (i < 3)) fail_msg("%u and %u rows: %s", rows[i][0], rows[i][1], rig_notes);
        static const char *const files[] = {"a.obj", "a.mtl", "a.1.png", "a.2.png"};
        for (int k = 0; k < 4; k++)
            assert_int_equal(unlink(rig_path(files[k])), 0);
    }
}

/* Ten lines of two shots are on a tube of 5 m radius. Further up in the first line, 60 shots hit a pole that nothing is
 * beside. */
static void put_tube_and_pole(void)
{
    enum { POLE = 60, GAP = 3 };
    for (uint32_t line = 0; line < FULL; line++) {
        const double angle = 2 * 3.14159265358979323846 * line / FULL;
        const int32_t x = (int32_t)lrint(5000 * sin(angle)), y = (int32_t)lrint(5000 * cos(angle));
        const struct rig_point p[2] = {{x, y, 0, -500, 1, 1, 1}, {x, y, 500, -500, 1, 1, 1}};
        const uint64_t pulse = (uint64_t)line * PULSES;
        rig_points(line, pulse, pulse, p, 2);
        for (uint32_t i = 0; line == 0 && i < POLE; i++) {
            const struct rig_point of_pole = {x, y, 1000 + 100 * (int32_t)i, -500, 1, 1, 1};
            rig_points(line, pulse, pulse + GAP + i, &of_pole, 1);
        }
    }
}

/* Points that no triangle uses do not move the texture of the others: the seam's far side stays at 1.05. */
static void loose_points_ahead_of_the_seam(void **state)
{
    (void)state;
    struct scene *scene;
    struct sh_err err;
    rig_begin();
    begin_scan(1);
    put_tube_and_pole();
    if (rig_record(rig_path("a.obj"), (struct recorder_options){.long_edge = 0}, RIG_KEEP, &err) != SH_OK)
        fail_msg("%s", err.text);
    assert_non_null(strstr(rig_notes, "60 points left out that belong to no triangle"));
    const struct scene_mesh_spec spec = {.file = rig_path("a.obj"), .scale = 1, .textures = 1};
    if (scene_load(&spec, 1, 1e-3, NULL, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    float most = 0;
    for (uint32_t i = 0; i < scene->n_triangles; i++)
        for (int k = 0; k < 3; k++)
            if (scene->uv[i][k][0] > most) most = scene->uv[i][k][0];
    assert_int_equal(scene->n_triangles, 2 * FULL);
    assert_true(fabs((double)most - 1.05) < 1e-6);
    scene_free(scene);
    static const char *const files[] = {"a.obj", "a.mtl", "a.png"};
    for (int k = 0; k < 3; k++)
        assert_int_equal(unlink(rig_path(files[k])), 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(the_largest_step_is_said),
                                       cmocka_unit_test(loose_points_ahead_of_the_seam)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
