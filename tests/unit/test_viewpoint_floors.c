/* SPDX-License-Identifier: MIT */
/* Floors of a scene: which of them a head stands on, how high, and which place is better. */
#include <math.h>
#include <string.h>

#include "core/angle.h"
#include "core/studio/viewpoint/survey.h"
#include "tests/common/made.h"
#include "tests/common/thorough.h"

enum { MOST = 40 };

static double vertex_m[4 * MOST][3];
static uint32_t triangle[2 * MOST][3];
static uint32_t n_quads;

/* A head that sees all around, from 0.1 m to 1 km. */
static const struct viewpoint_view VIEW = {0.1, 1000, -M_PI_2, M_PI_2};

static void add_quad(const double corner[4][3])
{
    const uint32_t v = 4 * n_quads;
    memcpy(vertex_m[v], corner, 4 * sizeof *vertex_m);
    memcpy(triangle[2 * n_quads], (const uint32_t[3]){v, v + 1, v + 2}, sizeof *triangle);
    memcpy(triangle[2 * n_quads + 1], (const uint32_t[3]){v, v + 2, v + 3}, sizeof *triangle);
    n_quads++;
}

static void add_level(double x0, double y0, double x1, double y1, double z)
{
    add_quad((const double[4][3]){{x0, y0, z}, {x1, y0, z}, {x1, y1, z}, {x0, y1, z}});
}

/* A room whose faces look inward. Its floor rises along x by `slope`, and so does its ceiling. */
static void add_room(const double lo[3], const double hi[3], double slope)
{
    static const uint32_t face[6][4] = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1},
                                        {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
    for (int f = 0; f < 6; f++) {
        double corner[4][3];
        for (int c = 0; c < 4; c++)
            for (int k = 0; k < 3; k++)
                corner[c][k] = (face[f][c] >> k & 1 ? hi[k] : lo[k]) + (k == 2 ? slope * (corner[c][0] - lo[0]) : 0);
        add_quad((const double(*)[3])corner);
    }
}

static struct survey_best find_with(const struct viewpoint_view *view)
{
    static struct survey s;
    struct survey_best best = {0};
    struct sh_err err;
    const struct scene_arrays arrays = {
        (const double(*)[3])vertex_m, 4 * n_quads, (const uint32_t(*)[3])triangle, 2 * n_quads, NULL, NULL, 0};
    struct scene *scene = made_scene(&arrays);
    n_quads = 0;
    assert_int_equal(survey_open(&s, scene, view, NULL, &err), SH_OK);
    assert_int_equal(survey_floors(&s, NULL, &best, &err), SH_OK);
    survey_close(&s);
    scene_free(scene);
    return best;
}

static struct survey_best find(void)
{
    return find_with(&VIEW);
}

/* A room of 1.5 m is the lowest one. The head stands at 0.6 of its height, at most at 1.6 m. It sees all of the room.
 */
static void rooms_have_a_height(void **state)
{
    (void)state;
    static const struct {
        double room_m, head_m; /* 0: none */
    } rows[] = {{1.49, 0}, {1.51, 0.6 * 1.51}, {2, 1.2}, {2.6, 1.56}, {2.7, 1.6}, {9, 1.6}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i += SANITIZED ? 2 : 1) {
        add_room((const double[3]){10, 20, 30}, (const double[3]){18, 26, 30 + rows[i].room_m}, 0);
        const struct survey_best best = find();
        assert_int_equal(best.inside_score > 0, rows[i].head_m > 0);
        assert_true(best.ground_score == 0 || best.ground.position_m[2] > 30 + rows[i].room_m); /* on the roof */
        if (rows[i].head_m == 0) continue;
        const struct viewpoint *at = &best.inside;
        assert_int_equal(at->kind, VIEWPOINT_INSIDE);
        assert_true(fabs(at->floor_m - rows[i].head_m) < 1e-9);
        assert_true(fabs(at->position_m[2] - 30 - rows[i].head_m) < 1e-9);
        assert_true(at->seen == 1 && fabs(at->pan_rad - 2 * M_PI) < 1e-12 && at->heading_rad == 0);
        assert_true(at->line0_rad == VIEW.line_min_rad && at->line1_rad == VIEW.line_max_rad);
        assert_true(fabs(at->position_m[0] - 14) < 2 && fabs(at->position_m[1] - 23) < 2); /* near the middle */
    }
}

/* Floors are up to 45 degrees steep: cosines down to 0.7. */
static void floors_are_not_steep(void **state)
{
    (void)state;
    for (int steep = 0; steep < 2; steep++) {
        add_room((const double[3]){0, 0, 0}, (const double[3]){8, 8, 6}, tan(acos(steep ? 0.69 : 0.71)));
        assert_int_equal(find().inside_score > 0, !steep);
    }
}

/* Under the sky the head stands at a 200th of the scene's size, from 1.6 m to 30 m. Level land shows a half of the
 * view, which is enough. */
static void land_has_a_height(void **state)
{
    (void)state;
    static const struct {
        double size_m[2], head_m;
    } rows[] = {{{100, 90}, 1.6}, {{400, 300}, 2}, {{300, 400}, 2}, {{5000, 5000}, 25}, {{7000, 100}, 30}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i += SANITIZED ? 2 : 1) {
        add_level(0, 0, rows[i].size_m[0], rows[i].size_m[1], 5);
        const struct survey_best best = find();
        assert_true(best.ground_score > 0 && best.inside_score == 0);
        assert_int_equal(best.ground.kind, VIEWPOINT_GROUND);
        assert_true(fabs(best.ground.floor_m - rows[i].head_m) < 1e-9);
        assert_true(fabs(best.ground.position_m[2] - 5 - rows[i].head_m) < 1e-9);
    }
}

/* A surface is a roof if another one lies more than a metre below it, and more than a 20th of the scene's radius. Walls
 * around it keep the scene from being land. */
static void a_roof_is_no_ground(void **state)
{
    (void)state;
    static const struct {
        double side_m, below_m;
        int is_ground;
    } rows[] = {{12, 0.9, 1}, {12, 1.2, 0}, {60, 2.2, 1}, {60, 3, 0}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const double s = rows[i].side_m, h = 0.5 * s;
        add_level(0, 0, s, s, 0);
        add_level(0, 0, s, s, -rows[i].below_m);
        for (int k = 0; k < 4; k++) {
            const double x0 = k == 1 ? s : 0, y0 = k == 2 ? s : 0, x1 = k == 0 ? 0 : s, y1 = k == 3 ? 0 : s;
            add_quad((const double[4][3]){{x0, y0, 0}, {x1, y1, 0}, {x1, y1, h}, {x0, y0, h}});
        }
        const double radius_m = 0.5 * sqrt(2 * s * s + (h + rows[i].below_m) * (h + rows[i].below_m));
        assert_int_equal(rows[i].below_m <= fmax(1, 0.05 * radius_m), rows[i].is_ground);
        assert_int_equal(find().ground_score > 0, rows[i].is_ground);
    }
}

/* Land is at most a quarter as high as wide, and fills 0.7 of its bounds: 9 of 12 columns, not 8. It may have a surface
 * below it, 6 m here. A tile of 1 m by 1 m sets the height. */
static void land_may_have_a_surface_below(void **state)
{
    (void)state;
    static const struct {
        double high_m, width_m;
        int is_land;
    } rows[] = {{25, 100, 1}, {26, 100, 0}, {24, 75, 1}, {24, 66, 0}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        for (int turned = 0; turned < (SANITIZED ? 1 : 2); turned++) {
            const double x = turned ? 100 : rows[i].width_m, y = turned ? rows[i].width_m : 100;
            add_level(0, 0, x, y, 0);
            add_level(0, 0, x, y, 6);
            add_level(99, 99, 100, 100, rows[i].high_m);
            assert_int_equal(find().ground_score > 0, rows[i].is_land);
        }
}

/* A scan of 10 lines is tried. Level land shows what lies below the horizon, a share of the lines. Lines in the middles
 * of ten equal parts of the view count that share to the nearest tenth. The lines next to the horizon are 1.6 degrees
 * from it, and hit the land of 1 km within 200 m. */
static void lines_divide_the_view_evenly(void **state)
{
    (void)state;
    static const double rows[][2] = {{0.56, 0.6}, {0.54, 0.5}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct viewpoint_view view = {0.1, 1000, -M_PI_2, M_PI_2 * (1 / rows[i][0] - 1)};
        add_level(0, 0, 1000, 1000, 5);
        const struct survey_best best = find_with(&view);
        assert_true(best.ground_score > 0 && fabs(best.ground.seen - rows[i][1]) < 1e-9);
    }
}

/* A wall on one side of a yard fills an angle from the head. All lines hit it between its foot and its top. The
 * lines' azimuths interleave: 160 of them go evenly round, so their share differs by less than one of 160. */
static void azimuths_go_evenly_round(void **state)
{
    (void)state;
    static const double end[5][2] = {{0, 0}, {100, 0}, {100, 100}, {0, 100}, {0, 0}};
    const struct viewpoint_view view = {0.1, 1000, angle_rad(1), angle_rad(8)};
    for (int side = 0; side < 4; side++) {
        const double *a = end[side], *b = end[side + 1];
        add_level(0, 0, 100, 100, 0);
        add_quad((const double[4][3]){{a[0], a[1], 0}, {b[0], b[1], 0}, {b[0], b[1], 25}, {a[0], a[1], 25}});
        const struct survey_best best = find_with(&view);
        const double *p = best.ground.position_m;
        const double turn = atan2(b[0] - p[0], b[1] - p[1]) - atan2(a[0] - p[0], a[1] - p[1]);
        const double share = fabs(remainder(turn, 2 * M_PI)) / (2 * M_PI);
        assert_true(best.ground_score > 0 && fabs(best.ground.seen - share) < 1.0 / 160);
    }
}

/* Returns which of two rooms the better place is in. */
static int better(const double lo[2][3], const double hi[2][3])
{
    add_room(lo[0], hi[0], 0);
    add_room(lo[1], hi[1], 0);
    const struct survey_best best = find();
    assert_true(best.inside_score > 0);
    for (int i = 0; i < 2; i++) {
        const double *p = best.inside.position_m;
        if (p[0] > lo[i][0] && p[0] < hi[i][0] && p[2] > lo[i][2] && p[2] < hi[i][2]) return i;
    }
    fail_msg("in no room");
    return -1;
}

/* The larger room, the lower one, and the one in the middle of the scene are better. */
static void the_better_room_is_taken(void **state)
{
    (void)state;
    for (int k = 0; k < (SANITIZED ? 1 : 2); k++) {
        const double large_lo[2][3] = {{k == 0 ? 0 : 16, 0, 0}, {k == 0 ? 11 : 0, 0, 0}},
                     large_hi[2][3] = {{k == 0 ? 10 : 26, 10, 8}, {k == 0 ? 26 : 15, 15, 8}};
        assert_int_equal(better(large_lo, large_hi), 1);
        const double low_lo[2][3] = {{0, 0, k * 4}, {0, 0, 4 - k * 4}},
                     low_hi[2][3] = {{8, 8, 3 + k * 4}, {8, 8, 7 - k * 4}};
        assert_int_equal(better(low_lo, low_hi), k);
        const double aside_lo[2][3] = {{0, 0, 0}, {40, 0, 0}}, aside_hi[2][3] = {{20, 20, 3}, {60, 20, 3}};
        add_level(k == 0 ? -60 : 119, 0, k == 0 ? -59 : 120, 1, 0); /* the scene goes on to one side */
        assert_int_equal(better(aside_lo, aside_hi), k == 0 ? 0 : 1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rooms_have_a_height),
        cmocka_unit_test(floors_are_not_steep),
        cmocka_unit_test(land_has_a_height),
        cmocka_unit_test(a_roof_is_no_ground),
        cmocka_unit_test(the_better_room_is_taken),
        cmocka_unit_test(land_may_have_a_surface_below),
        cmocka_unit_test(lines_divide_the_view_evenly),
        cmocka_unit_test(azimuths_go_evenly_round),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
