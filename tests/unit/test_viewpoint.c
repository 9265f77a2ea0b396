/* SPDX-License-Identifier: MIT */
/* Viewpoints: in rooms, on land, before objects. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/angle.h"
#include "core/studio/viewpoint.h"

enum { MAX_BOXES = 8, LAND = 20, PLATES = 150 };

static double vertex_m[(LAND + 1) * (LAND + 1) + 8 * MAX_BOXES + 4 * PLATES][3];
static uint32_t triangle[2 * LAND * LAND + 12 * MAX_BOXES + 2 * PLATES][3];
static uint32_t n_vertices, n_triangles;
static struct viewpoint at;

/* A head of -40 to 60 degrees, 0.5 to 500 m. */
static const struct viewpoint_view VIEW = {0.5, 500, -40 * M_PI / 180, 60 * M_PI / 180};

static void clear(void)
{
    n_vertices = n_triangles = 0;
}

static void add_triangle(uint32_t a, uint32_t b, uint32_t c, int turned)
{
    triangle[n_triangles][0] = a;
    triangle[n_triangles][1] = turned ? c : b;
    triangle[n_triangles++][2] = turned ? b : c;
}

/* inward: the faces are seen from within, as those of a room. */
static void add_box(const double lo[3], const double hi[3], int inward)
{
    static const uint32_t quad[6][4] = {{0, 2, 3, 1}, {4, 5, 7, 6}, {0, 1, 5, 4},
                                        {2, 6, 7, 3}, {0, 4, 6, 2}, {1, 3, 7, 5}};
    uint32_t first = n_vertices;
    for (int i = 0; i < 8; i++, n_vertices++)
        for (int k = 0; k < 3; k++)
            vertex_m[n_vertices][k] = i >> k & 1 ? hi[k] : lo[k];
    for (int w = 0; w < 6; w++) {
        const uint32_t *q = quad[w];
        add_triangle(first + q[0], first + q[1], first + q[2], inward);
        add_triangle(first + q[0], first + q[2], first + q[3], inward);
    }
}

/* n level plates from z on, 1 cm apart: the leaves of a tree, say. */
static void add_plates(int n, double size_m, double z_m)
{
    for (int i = 0; i < n; i++) {
        const double z = z_m + 0.01 * i,
                     corner[4][3] = {{0, 0, z}, {size_m, 0, z}, {size_m, size_m, z}, {0, size_m, z}};
        memcpy(vertex_m[n_vertices], corner, sizeof corner);
        add_triangle(n_vertices, n_vertices + 1, n_vertices + 2, 0);
        add_triangle(n_vertices, n_vertices + 2, n_vertices + 3, 0);
        n_vertices += 4;
    }
}

static void add_land(double size_m, double height_m)
{
    uint32_t first = n_vertices;
    for (int i = 0; i <= LAND; i++)
        for (int j = 0; j <= LAND; j++, n_vertices++) {
            vertex_m[n_vertices][0] = size_m * i / LAND;
            vertex_m[n_vertices][1] = size_m * j / LAND;
            vertex_m[n_vertices][2] = height_m * sin(0.7 * i) * cos(0.5 * j);
        }
    for (uint32_t i = 0; i < LAND; i++)
        for (uint32_t j = 0; j < LAND; j++) {
            uint32_t v = first + i * (LAND + 1) + j;
            add_triangle(v, v + LAND + 1, v + LAND + 2, 0);
            add_triangle(v, v + LAND + 2, v + 1, 0);
        }
}

static void find_in(const struct viewpoint_view *view)
{
    struct sh_err err;
    struct scene *scene = NULL;
    const struct scene_arrays arrays = {
        (const double(*)[3])vertex_m, n_vertices, (const uint32_t(*)[3])triangle, n_triangles, NULL, NULL, 0};
    int rc = scene_from_arrays(&arrays, &scene, &err);
    if (rc == SH_OK) rc = viewpoint_find(scene, view, NULL, &at, &err);
    if (rc != SH_OK) fail_msg("%s", err.text);
    scene_free(scene);
}

static void find(void)
{
    find_in(&VIEW);
}

static void assert_near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("%.15g instead of %.15g", got, want);
}

static void a_room_is_entered(void **state)
{
    (void)state;
    clear();
    add_box((const double[3]){-4, 2, 1}, (const double[3]){4, 8, 4}, 1);
    find();
    assert_int_equal(at.kind, VIEWPOINT_INSIDE);
    assert_near(at.position_m[2], 1 + 1.6, 1e-6);
    assert_near(at.floor_m, 1.6, 0);
    assert_true(fabs(at.position_m[0]) < 3 && at.position_m[1] > 3 && at.position_m[1] < 7); /* a metre from walls */
    assert_near(at.seen, 1, 0.02); /* all of it, but what is nearer than half a metre */
    assert_near(at.pan_rad, 2 * M_PI, 1e-12);
}

/* The room is 2 m high. The head stands at three fifths of that. */
static void under_a_low_ceiling_the_head_stands_lower(void **state)
{
    (void)state;
    clear();
    add_box((const double[3]){0, 0, 0}, (const double[3]){8, 8, 2}, 1);
    find();
    assert_int_equal(at.kind, VIEWPOINT_INSIDE);
    assert_near(at.floor_m, 1.2, 1e-6);
}

static void of_two_storeys_the_lower_one(void **state)
{
    (void)state;
    clear();
    add_box((const double[3]){0, 0, 0}, (const double[3]){8, 8, 3}, 1);
    add_box((const double[3]){0, 0, 3.3}, (const double[3]){8, 8, 6.3}, 1);
    find();
    assert_int_equal(at.kind, VIEWPOINT_INSIDE);
    assert_near(at.position_m[2], 1.6, 1e-6);
}

/* However many surfaces lie above it, a floor is found. */
static void a_floor_below_many_surfaces_is_found(void **state)
{
    (void)state;
    clear();
    add_box((const double[3]){0, 0, 0}, (const double[3]){8, 8, 3}, 1);
    add_plates(PLATES, 8, 3.1);
    find();
    assert_int_equal(at.kind, VIEWPOINT_INSIDE);
    assert_near(at.position_m[2], 1.6, 1e-6);
}

static void places_below_many_surfaces_are_found(void **state)
{
    (void)state;
    const struct viewpoint_grid grid = {1.0, 1.2, {0, 0, -1}, {6, 6, 1}};
    struct scene *scene = NULL;
    struct bvh *bvh = NULL;
    struct viewpoint_place *place;
    uint32_t n;
    struct sh_err err;
    clear();
    add_plates(1, 6, 0);
    add_plates(PLATES - 1, 6, 3);
    const struct scene_arrays arrays = {
        (const double(*)[3])vertex_m, n_vertices, (const uint32_t(*)[3])triangle, n_triangles, NULL, NULL, 0};
    assert_int_equal(scene_from_arrays(&arrays, &scene, &err), SH_OK);
    assert_int_equal(bvh_create(scene, 0, NULL, &bvh, &err), SH_OK);
    assert_int_equal(viewpoint_places(bvh, &grid, NULL, &place, &n, &err), SH_OK);
    assert_int_equal(n, 36); /* all cells of 1 m */
    for (uint32_t i = 0; i < n; i++)
        assert_near(place[i].position_m[2], 1.2, 1e-9);
    free(place);
    bvh_free(bvh);
    scene_free(scene);
}

/* The step that the message names is accepted. To two digits it is the least one: a step shorter by a tenth is refused.
 * The last grid is shorter along x than a step. */
static void the_step_that_a_large_grid_is_told_to_use_is_enough(void **state)
{
    (void)state;
    static const double sides_m[][2] = {{6, 6}, {6.1, 5.3}, {100, 0.3}, {1000, 1e-6}};
    struct scene *scene = NULL;
    struct bvh *bvh = NULL;
    struct viewpoint_place *place;
    uint32_t n;
    struct sh_err err;
    clear();
    add_plates(1, 6, 0);
    const struct scene_arrays arrays = {
        (const double(*)[3])vertex_m, n_vertices, (const uint32_t(*)[3])triangle, n_triangles, NULL, NULL, 0};
    assert_int_equal(scene_from_arrays(&arrays, &scene, &err), SH_OK);
    assert_int_equal(bvh_create(scene, 0, NULL, &bvh, &err), SH_OK);
    for (size_t i = 0; i < sizeof sides_m / sizeof sides_m[0]; i++) {
        /* The area is far away from the surface, so that its columns cost next to nothing. */
        struct viewpoint_grid grid = {1e-5, 1.2, {50, 50, -1}, {50 + sides_m[i][1], 50 + sides_m[i][0], 1}};
        assert_int_equal(viewpoint_places(bvh, &grid, NULL, &place, &n, &err), SH_EINPUT);
        const char *figure = strstr(err.text, "use a step of at least ");
        assert_non_null(figure);
        const double named_m = strtod(figure + strlen("use a step of at least "), NULL);
        grid.step_m = 0.9 * named_m;
        assert_int_equal(viewpoint_places(bvh, &grid, NULL, &place, &n, &err), SH_EINPUT);
        grid.step_m = named_m;
        if (viewpoint_places(bvh, &grid, NULL, &place, &n, &err) != SH_OK) fail_msg("%zu: %s", i, err.text);
        free(place);
    }
    bvh_free(bvh);
    scene_free(scene);
}

/* All eight corners are within the scanned view, and nothing is nearer than the head can see. */
static void assert_all_in_view(const double lo[3], const double hi[3])
{
    for (int i = 0; i < 8; i++) {
        double d[3];
        for (int k = 0; k < 3; k++)
            d[k] = (i >> k & 1 ? hi[k] : lo[k]) - at.position_m[k];
        double pan = fmod(atan2(d[0], d[1]) - at.heading_rad + 4 * M_PI, 2 * M_PI),
               line = atan2(d[2], hypot(d[0], d[1]));
        assert_true(d[0] * d[0] + d[1] * d[1] + d[2] * d[2] >= VIEW.range_min_m * VIEW.range_min_m);
        assert_true(pan <= at.pan_rad);
        assert_true(line >= at.line0_rad && line <= at.line1_rad);
    }
}

/* Boxes of 1 cm to 200 m are in view whole, from the front or from a corner beside it. */
static void an_object_is_looked_at_from_the_front(void **state)
{
    (void)state;
    static const double size_m[] = {0.01, 0.1, 1, 10, 200};
    for (int i = 0; i < 5; i++) {
        const double s = size_m[i], lo[3] = {100, 50, 7}, hi[3] = {100 + s, 50 + s, 7 + s};
        clear();
        add_box(lo, hi, 0);
        find();
        assert_int_equal(at.kind, VIEWPOINT_OUTSIDE);
        assert_true(isnan(at.floor_m));
        assert_true(at.position_m[1] < 50); /* before it; a corner that shows two sides will do */
        assert_all_in_view(lo, hi);
        assert_true(at.seen > 0.1);
    }
    assert_true(at.faces_out); /* a head has room in the last box, but would see the faces' backs */
}

/* A plate across x is not visible from a place before it in y. */
static void a_plate_is_looked_at_from_its_side(void **state)
{
    (void)state;
    clear();
    static const double corner[4][3] = {{0, 0, 0}, {0, 2, 0}, {0, 2, 2}, {0, 0, 2}};
    memcpy(vertex_m, corner, sizeof corner);
    n_vertices = 4;
    add_triangle(0, 1, 2, 0);
    add_triangle(0, 2, 3, 0);
    find();
    assert_int_equal(at.kind, VIEWPOINT_OUTSIDE);
    assert_true(fabs(at.position_m[0]) > 2);
    assert_true(at.seen > 0.5);
}

/* The front of a plate decides, though the plate is as large from behind. */
static void a_plate_is_looked_at_from_its_front(void **state)
{
    (void)state;
    static const double corner[4][3] = {{0, 0, 0}, {2, 0, 0}, {2, 0, 2}, {0, 0, 2}};
    for (int turned = 0; turned < 2; turned++) {
        clear();
        memcpy(vertex_m, corner, sizeof corner);
        n_vertices = 4;
        add_triangle(0, 1, 2, turned); /* counter-clockwise from -y */
        add_triangle(0, 2, 3, turned);
        find();
        assert_int_equal(at.kind, VIEWPOINT_OUTSIDE);
        assert_true(turned ? at.position_m[1] > 2 : at.position_m[1] < -2);
    }
}

/* Little bodies lie a kilometre apart. The one with the most surface is looked at; among equals the one in the
 * middle. */
static void a_part_of_a_sparse_scene_is_looked_at(void **state)
{
    (void)state;
    static const struct viewpoint_view near = {0.5, 40, -40 * M_PI / 180, 60 * M_PI / 180};
    static const struct {
        double x_m, y_m, side_m[2];
    } row[] = {{0, 0, {0.1, 0.1}}, {510, 480, {0.1, 0.1}}, {700, 200, {0.1, 0.2}}, {1000, 1000, {0.1, 0.1}}};
    for (int larger = 0; larger < 2; larger++) {
        const int want = larger ? 2 : 1;
        clear();
        for (int i = 0; i < 4; i++) {
            const double x = row[i].x_m, y = row[i].y_m, side = row[i].side_m[larger];
            add_box((const double[3]){x, y, 0}, (const double[3]){x + side, y + side, side}, 0);
        }
        find_in(&near);
        assert_int_equal(at.kind, VIEWPOINT_OUTSIDE);
        assert_true(hypot(at.position_m[0] - row[want].x_m, at.position_m[1] - row[want].y_m) < 2);
        assert_true(at.seen > 0.1);
    }
}

/* The land has 2 km of hills. The head is a two-hundredth of that above the ground, 10 m. */
static void land_is_stood_on(void **state)
{
    (void)state;
    clear();
    add_land(2000, 20);
    find();
    assert_int_equal(at.kind, VIEWPOINT_GROUND);
    assert_near(at.floor_m, 10, 1e-9);
    assert_true(at.position_m[0] > 100 && at.position_m[0] < 1900);
}

/* The head is on the ground between the houses, not on a roof and not within a house, whose walls face outward. */
static void between_houses(void **state)
{
    (void)state;
    clear();
    add_box((const double[3]){-30, -30, -0.3}, (const double[3]){30, 30, 0}, 0);
    for (int i = 0; i < 6; i++) {
        const double turn = i * M_PI / 3, x = 17 * cos(turn), y = 17 * sin(turn);
        add_box((const double[3]){x - 7, y - 7, 0}, (const double[3]){x + 7, y + 7, 12}, 0);
    }
    find();
    assert_int_equal(at.kind, VIEWPOINT_GROUND);
    assert_near(at.position_m[2], 1.6, 1e-6);
}

static int stop(void *ctx)
{
    (void)ctx;
    return 1;
}

static void the_search_can_be_stopped(void **state)
{
    (void)state;
    static const struct sh_report report = {.stop = stop};
    struct scene *scene = NULL;
    struct sh_err err;
    clear();
    add_box((const double[3]){-4, 2, 1}, (const double[3]){4, 8, 4}, 1);
    const struct scene_arrays arrays = {
        (const double(*)[3])vertex_m, n_vertices, (const uint32_t(*)[3])triangle, n_triangles, NULL, NULL, 0};
    assert_int_equal(scene_from_arrays(&arrays, &scene, &err), SH_OK);
    assert_int_equal(viewpoint_find(scene, &VIEW, &report, &at, &err), SH_ESTOPPED);
    scene_free(scene);
}

static void a_view_without_room_is_refused(void **state)
{
    (void)state;
    struct sh_err err;
    const struct viewpoint_view none = {5, 5, 0, 1};
    assert_int_equal(viewpoint_find(NULL, &none, NULL, &at, &err), SH_EINPUT);
}

/* A head that sees the box from the front or from above has it below 45 degrees of elevation, outside this view. */
static void a_view_that_holds_nothing_is_refused(void **state)
{
    (void)state;
    const struct viewpoint_view up = {0.5, 500, angle_rad(70), angle_rad(85)};
    struct scene *scene = NULL;
    struct sh_err err;
    clear();
    add_box((const double[3]){0, 0, 0}, (const double[3]){1, 1, 1}, 0);
    const struct scene_arrays arrays = {
        (const double(*)[3])vertex_m, n_vertices, (const uint32_t(*)[3])triangle, n_triangles, NULL, NULL, 0};
    assert_int_equal(scene_from_arrays(&arrays, &scene, &err), SH_OK);
    assert_int_equal(viewpoint_find(scene, &up, NULL, &at, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "a view of 70 to 85 deg holds nothing of the scene"));
    scene_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_room_is_entered),
        cmocka_unit_test(under_a_low_ceiling_the_head_stands_lower),
        cmocka_unit_test(of_two_storeys_the_lower_one),
        cmocka_unit_test(a_floor_below_many_surfaces_is_found),
        cmocka_unit_test(places_below_many_surfaces_are_found),
        cmocka_unit_test(the_step_that_a_large_grid_is_told_to_use_is_enough),
        cmocka_unit_test(an_object_is_looked_at_from_the_front),
        cmocka_unit_test(a_plate_is_looked_at_from_its_side),
        cmocka_unit_test(a_plate_is_looked_at_from_its_front),
        cmocka_unit_test(a_part_of_a_sparse_scene_is_looked_at),
        cmocka_unit_test(land_is_stood_on),
        cmocka_unit_test(between_houses),
        cmocka_unit_test(the_search_can_be_stopped),
        cmocka_unit_test(a_view_without_room_is_refused),
        cmocka_unit_test(a_view_that_holds_nothing_is_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
