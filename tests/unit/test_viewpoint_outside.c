/* SPDX-License-Identifier: MIT */
/* Places outside: their directions, their distance and the part of the view that holds the scene. And the parts of a
 * sparse scene. */
#include <math.h>
#include <string.h>

#include "core/angle.h"
#include "core/studio/viewpoint/survey.h"
#include "tests/common/made.h"
#include "tests/common/thorough.h"

enum { MOST = 16 };

static double vertex_m[4 * MOST][3];
static uint32_t triangle[2 * MOST][3];
static uint32_t n_quads;

/* A head that sees all around, from 0.5 m to 500 m. */
static const struct viewpoint_view VIEW = {0.5, 500, -M_PI_2, M_PI_2};

static void add_quad(const double corner[4][3])
{
    const uint32_t v = 4 * n_quads;
    memcpy(vertex_m[v], corner, 4 * sizeof *vertex_m);
    memcpy(triangle[2 * n_quads], (const uint32_t[3]){v, v + 1, v + 2}, sizeof *triangle);
    memcpy(triangle[2 * n_quads + 1], (const uint32_t[3]){v, v + 2, v + 3}, sizeof *triangle);
    n_quads++;
}

/* A plate of 2 m by 2 m around the origin, whose front is seen from an azimuth and an elevation. */
static void add_plate(double azimuth_deg, double elevation_deg)
{
    const double a = angle_rad(azimuth_deg), e = angle_rad(elevation_deg);
    const double left[3] = {cos(a), -sin(a), 0}, up[3] = {-sin(e) * sin(a), -sin(e) * cos(a), cos(e)};
    double corner[4][3];
    for (int k = 0; k < 3; k++) {
        corner[0][k] = left[k] - up[k];
        corner[1][k] = -left[k] - up[k];
        corner[2][k] = -left[k] + up[k];
        corner[3][k] = left[k] + up[k];
    }
    add_quad((const double(*)[3])corner);
}

static struct scene *scene_of_quads(void)
{
    const struct scene_arrays arrays = {
        (const double(*)[3])vertex_m, 4 * n_quads, (const uint32_t(*)[3])triangle, 2 * n_quads, NULL, NULL, 0};
    n_quads = 0;
    return made_scene(&arrays);
}

static struct viewpoint find_of(const struct viewpoint_view *view, int is_part)
{
    static struct survey s;
    struct sh_err err;
    struct viewpoint at = {0};
    struct scene *scene = scene_of_quads();
    assert_int_equal(survey_open(&s, scene, view, NULL, &err), SH_OK);
    s.is_part = is_part;
    assert_int_equal(survey_outside(&s, &at), 1);
    assert_int_equal(at.kind, VIEWPOINT_OUTSIDE);
    assert_true(isnan(at.floor_m));
    survey_close(&s);
    scene_free(scene);
    return at;
}

static struct viewpoint find(const struct viewpoint_view *view)
{
    return find_of(view, 0);
}

/* Rays are added up over some steps of 1e-16. */
static void expect(const char *what, double got, double want)
{
    if (!(fabs(got - want) <= 1e-9 * fmax(1.0, fabs(want)))) fail_msg("%s: %.12g, not %.12g", what, got, want);
}

static void expect_azimuth(const struct viewpoint *at, double azimuth_deg)
{
    const double turn = angle_deg(atan2(at->position_m[0], at->position_m[1])) - azimuth_deg;
    expect("azimuth", remainder(turn, 360.0), 0.0);
}

/* The place lies in that direction from the origin. */
static void expect_direction(const struct viewpoint *at, double azimuth_deg, double elevation_deg)
{
    const double *p = at->position_m;
    expect_azimuth(at, azimuth_deg);
    expect("elevation", angle_deg(atan2(p[2], hypot(p[0], p[1]))), elevation_deg);
}

/* A plate is seen best from straight before it. Places are tried every 45 degrees, at elevations of 8, 22 and 35
 * degrees. The lower ones count more, so the highest is taken for what looks up by 30 degrees or more. */
static void a_plate_is_looked_at_straight(void **state)
{
    (void)state;
    static const int up_deg[] = {-20, 20, 30, 70};
    for (int k = 0; k < 8; k += SANITIZED ? 3 : 1)
        for (int e = 0; e < 4; e++) {
            add_plate(45 * k, up_deg[e]);
            const struct viewpoint at = find(&VIEW);
            expect_direction(&at, 45 * k, up_deg[e] < 25 ? 8 : 35);
        }
}

/* A head that does not look down steeply has to stand lower. */
static void the_view_limits_the_elevation(void **state)
{
    (void)state;
    static const struct {
        double least_deg, elevation_deg;
    } rows[] = {{-60, 35}, {-42, 22}, {-30, 8}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const struct viewpoint_view view = {0.5, 500, angle_rad(rows[i].least_deg), M_PI_2};
        add_plate(180, 40);
        const struct viewpoint at = find(&view);
        expect_direction(&at, 180, rows[i].elevation_deg);
        assert_true(at.line0_rad >= view.line_min_rad);
    }
}

/* A prism of eight sides looks the same from all: its front is taken. If the front is turned inside out, a place beside
 * is taken, which does not see it. If three sides are, the next place behind is taken. */
static void the_front_is_liked_best(void **state)
{
    (void)state;
    for (int missing = 0; missing < 3; missing++) {
        static const double liked_deg[] = {180, -90, -45};
        for (int k = 0; k < 8; k++) {
            const double a0 = (k - 0.5) * M_PI / 4, a1 = (k + 0.5) * M_PI / 4;
            const int is_turned = (missing > 0 && k == 4) || (missing > 1 && (k == 3 || k == 5));
            const double low = is_turned ? 1 : -1;
            add_quad((const double[4][3]){{2 * sin(a1), 2 * cos(a1), low},
                                          {2 * sin(a0), 2 * cos(a0), low},
                                          {2 * sin(a0), 2 * cos(a0), -low},
                                          {2 * sin(a1), 2 * cos(a1), -low}});
        }
        const struct viewpoint at = find(&VIEW);
        expect_azimuth(&at, liked_deg[missing]);
    }
}

/* A cube shows its backs, and a small plate beside it looks east. The cube fills as much of a view from a side as from
 * a corner, to a hundredth (33 by 33 degrees; 36 degrees by 26 to 37), so the front in the south is liked best. In a
 * part of a scene the share of fronts counts as well. It is 0 in the south, and less in the south-east than in the
 * east: the plate is seen at 45 degrees there, from farther away. */
static void a_part_is_looked_at_from_its_fronts(void **state)
{
    (void)state;
    for (int is_part = 0; is_part < 2; is_part++) {
        static const double way[5][2] = {{-1, -1}, {-1, 1}, {1, 1}, {1, -1}, {-1, -1}};
        for (int k = 0; k < 4; k++) {
            const double *a = way[k], *b = way[k + 1];
            add_quad((const double[4][3]){{b[0], b[1], -1}, {b[0], b[1], 1}, {a[0], a[1], 1}, {a[0], a[1], -1}});
        }
        add_quad((const double[4][3]){{-1, -1, 1}, {-1, 1, 1}, {1, 1, 1}, {1, -1, 1}});
        add_quad((const double[4][3]){{1.1, -0.15, -0.15}, {1.1, 0.15, -0.15}, {1.1, 0.15, 0.15}, {1.1, -0.15, 0.15}});
        const struct viewpoint at = find_of(&VIEW, is_part);
        const double turn_deg = angle_deg(atan2(at.position_m[0] - 0.05, at.position_m[1])); /* from the middle */
        expect("azimuth", remainder(turn_deg - (is_part ? 90 : 180), 360.0), 0.0);
    }
}

/* The sphere around the scene fills 47 degrees, 1 / 2.5 = sin 23.6 deg. Its near side lies at 1.3 times the least range
 * or farther. If that is too far for the head, it stands 0.3 of the range plus the least range from the box. */
static void the_distance_fits_scene_and_head(void **state)
{
    (void)state;
    const double e = angle_rad(8);
    static const struct viewpoint_view near = {5, 500, -M_PI_2, M_PI_2}, small = {0.5, 5, -M_PI_2, M_PI_2};
    const struct {
        const struct viewpoint_view *view;
        double away_m;
    } rows[] = {{&VIEW, 2.5 * M_SQRT2}, {&near, M_SQRT2 + 6.5}, {&small, sin(e) + 1.5 + 0.5}};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        add_plate(180, 0);
        const struct viewpoint at = find(rows[i].view);
        expect("x", at.position_m[0], 0);
        expect("y", at.position_m[1], -rows[i].away_m * cos(e));
        expect("z", at.position_m[2], rows[i].away_m * sin(e));
    }
}

/* Pan and lines hold the scene's bounds, and a margin of 1 degree and 3 % of the width. From above, the far side is the
 * upper end, and the near one the lower. */
static void the_view_holds_the_bounds(void **state)
{
    (void)state;
    const double turn = angle_rad(60), half[3] = {1, sin(turn), cos(turn)};
    const double far_m = 2.5 * M_SQRT2, y = far_m * cos(angle_rad(35)), z = far_m * sin(angle_rad(35));
    const double right = atan2(half[0], y - half[1]), margin = angle_rad(1) + 0.03 * 2 * right;
    add_plate(180, 60);
    struct viewpoint at = find(&VIEW);
    expect("heading", at.heading_rad, -right - margin);
    expect("pan", at.pan_rad, 2 * (right + margin));
    expect("line 0", at.line0_rad, atan2(-half[2] - z, y - half[1]) - margin);
    expect("line 1", at.line1_rad, atan2(half[2] - z, hypot(half[0], y + half[1])) + margin);
    const double low_y = far_m * cos(angle_rad(8)), low_z = far_m * sin(angle_rad(8)), side = atan2(1, low_y);
    const double wide = angle_rad(1) + 0.03 * 2 * side;
    add_plate(90, 0);
    at = find(&VIEW);
    expect("heading", at.heading_rad, -M_PI_2 - side - wide);
    expect("pan", at.pan_rad, 2 * (side + wide));
    expect("line 0", at.line0_rad, atan2(-1 - low_z, low_y) - wide);
    expect("line 1", at.line1_rad, atan2(1 - low_z, low_y) + wide);
    const struct viewpoint_view narrow = {0.5, 500, angle_rad(-20), angle_rad(5)};
    add_plate(90, 0);
    at = find(&narrow);
    expect("least line", at.line0_rad, angle_rad(-20));
    expect("last line", at.line1_rad, angle_rad(5));
}

/* A tile of 0.5 m by `high_m`, whose corner is at x. */
static void add_tile(double x, double y, double high_m)
{
    add_quad((const double[4][3]){{x, y, 0}, {x + 0.5, y, 0}, {x + 0.5, y, high_m}, {x, y, high_m}});
}

/* Returns the part's bounds. */
static void narrow(double range_m, double low[2], double high[2])
{
    static struct survey s;
    const struct viewpoint_view view = {0.5, range_m, -M_PI_2, M_PI_2};
    struct sh_err err;
    struct scene *scene = scene_of_quads();
    assert_int_equal(survey_open(&s, scene, &view, NULL, &err), SH_OK);
    assert_false(s.is_part);
    assert_int_equal(survey_narrow(&s, &err), SH_OK);
    assert_true(s.is_part);
    double square = 0;
    for (int k = 0; k < 3; k++)
        square += s.size_m[k] * s.size_m[k];
    expect("radius", s.radius_m, 0.5 * sqrt(square));
    for (int k = 0; k < 2; k++) {
        low[k] = s.centre_m[k] - 0.5 * s.size_m[k];
        high[k] = s.centre_m[k] + 0.5 * s.size_m[k];
    }
    survey_close(&s);
    scene_free(scene);
}

/* Cells are a quarter of the range, at least a 64th of the scene. Two tiles of one cell have more surface than a larger
 * one of the next. */
static void the_fullest_cell_is_taken(void **state)
{
    (void)state;
    static const struct {
        double range_m, scale_m, far_m;
    } rows[] = {{40, 1, 60}, {40, 10, 6400}};
    double low[2], high[2];
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        for (int axis = 0; axis < 2; axis++) {
            const double u = rows[i].scale_m, place[4] = {0, 9 * u, 11 * u, rows[i].far_m - 0.5};
            static const double high_m[4] = {2, 2, 3, 1};
            for (int k = 0; k < 4; k++)
                add_tile(axis == 0 ? place[k] : 0, axis == 0 ? 0 : place[k], high_m[k]);
            narrow(rows[i].range_m, low, high);
            expect("low", low[axis], 0);
            expect("high", high[axis], 9 * u + (axis == 0 ? 0.5 : 0));
        }
}

/* Cells lie along both axes: 6 by 3 of 10 m here. The tile of the second row is by itself. */
static void cells_lie_along_both_axes(void **state)
{
    (void)state;
    for (int turned = 0; turned < 2; turned++) {
        static const double at[4][2] = {{0, 0}, {31, 2}, {1, 12}, {59.5, 29}}, high_m[4] = {3, 2, 2, 0.1};
        double low[2], high[2];
        for (int k = 0; k < 4; k++)
            add_tile(at[k][turned], at[k][!turned], high_m[k]);
        narrow(40, low, high);
        expect("west", low[0], 0);
        expect("east", high[0], 0.5);
        expect("south", low[1], 0);
        expect("north", high[1], 0);
    }
}

/* The bounds of a part hold each corner of its triangles. Each corner of a rhombus is the only one at its end, and each
 * in turn is the first one of both triangles. */
static void each_corner_counts(void **state)
{
    (void)state;
    static const double rhombus[4][3] = {{4, 1, 0}, {2, 2, 0}, {0, 1, 0}, {2, 0, 0}};
    for (int first = 0; first < 4; first++) {
        double corner[4][3], low[2], high[2];
        for (int c = 0; c < 4; c++)
            memcpy(corner[c], rhombus[(first + c) % 4], sizeof corner[c]);
        add_quad((const double(*)[3])corner);
        narrow(40, low, high);
        for (int k = 0; k < 2; k++) {
            expect("low", low[k], 0);
            expect("high", high[k], k == 0 ? 4 : 2);
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_plate_is_looked_at_straight),
        cmocka_unit_test(the_view_limits_the_elevation),
        cmocka_unit_test(the_front_is_liked_best),
        cmocka_unit_test(the_distance_fits_scene_and_head),
        cmocka_unit_test(the_view_holds_the_bounds),
        cmocka_unit_test(the_fullest_cell_is_taken),
        cmocka_unit_test(cells_lie_along_both_axes),
        cmocka_unit_test(each_corner_counts),
        cmocka_unit_test(a_part_is_looked_at_from_its_fronts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
