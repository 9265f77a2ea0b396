/* SPDX-License-Identifier: MIT */
/* Cells of surfaces, and the figures of their densities, for points that can be counted by hand. */
#include <math.h>

#include "core/studio/figures.h"
#include "tests/unit/scene_files.h"

enum { MOST = 20000 };

static double xyz[MOST][3], distance_m[MOST];
static float range_m[MOST];
static uint32_t triangle[MOST];
static struct cloud cloud;
static struct cloud_site site;
static const struct cloud_compared compared = {&cloud, &site, distance_m, triangle};
static struct sh_err err;

static int begin(void **state)
{
    (void)state;
    cloud = (struct cloud){.xyz_m = xyz};
    site = (struct cloud_site){.n_stations = 1, .max_m = 10, .threads = 1};
    return 0;
}

static void add(double x, double y, double z, uint32_t of, double range)
{
    assert_true(cloud.n < MOST);
    memcpy(xyz[cloud.n], (const double[3]){x, y, z}, sizeof xyz[0]);
    distance_m[cloud.n] = 0;
    range_m[cloud.n] = (float)range;
    triangle[cloud.n++] = of;
}

static void density(const struct scene *scene, double cell_m, struct figures_density *d)
{
    const struct figures_on_scene in = {&compared, scene, range_m};
    if (figures_density_of(&in, cell_m, NULL, d, &err) != SH_OK) fail_msg("%s", err.text);
}

static struct figures_density_row all_of(const struct figures_density *d)
{
    struct figures_density_row row;
    figures_density_within(d, 0, 0.0, (double)INFINITY, &row);
    return row;
}

/* 64 x 64 points, 0.25 m apart, are 16 a square metre. Cells of 1 m hold 16. */
static void cells_grow_until_they_hold_sixteen(void **state)
{
    (void)state;
    struct scene *scene = load_text("floor.obj", "v 0 0 0\nv 16 0 0\nv 16 16 0\nv 0 16 0\nf 1 2 3 4\n");
    for (int i = 0; i < 64 * 64; i++) {
        const double x = 0.125 + 0.25 * (i % 64), y = 0.125 + 0.25 * (double)(i / 64);
        add(x, y, 0, y > x, 5);
    }
    for (int k = 0; k < 4; k++) {
        const struct figures_on_scene in = {&compared, scene, range_m};
        struct figures_density d;
        struct figures_density_row row;
        const double first_m = 0.25 * (1 << k); /* the last one is larger than needed, and stays */
        assert_int_equal(figures_density_fit(&in, first_m, NULL, &d, &row, &err), SH_OK);
        const double cell_m = fmax(1.0, first_m);
        assert_true(d.cell_m == cell_m && row.points == 4096);
        assert_int_equal(row.cells, (size_t)(256 / (cell_m * cell_m)));
        assert_true(row.p5 == 16 && row.p50 == 16 && row.p95 == 16);
        figures_density_free(&d);
        assert_true(d.n == 0 && d.cell == NULL);
    }
    scene_free(scene);
}

/* With few points the cell is doubled as long as it stays within 50 m. */
static void cells_of_few_points(void **state)
{
    (void)state;
    static const double row[][2] = {{0.1, 25.6}, {12.5, 50}, {25, 50}, {25.1, 25.1}, {60, 60}}; /* first, last */
    struct scene *scene = load_text("floor.obj", "v 0 0 0\nv 200 0 0\nv 200 200 0\nv 0 200 0\nf 1 2 3 4\n");
    for (int i = 0; i < 4; i++)
        add(30 + 110 * (i % 2), 20 + 110 * (double)(i / 2), 0, 0, 5);
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        const struct figures_on_scene in = {&compared, scene, range_m};
        struct figures_density d;
        struct figures_density_row all;
        assert_int_equal(figures_density_fit(&in, row[i][0], NULL, &d, &all, &err), SH_OK);
        assert_true(d.cell_m == row[i][1] && all.cells == 4 && all.points == 4);
        figures_density_free(&d);
    }
    scene_free(scene);
}

/* Three squares of 4 m face x, y and z. Then two rectangles are turned about z by the angle of 3, 4, 5. The faces'
 * common corner is at 10.5, 20.25, 30.75 m, and cells begin there. A cell has a metre's square, or 1.25 of it on a
 * turned face. */
static void cells_begin_at_the_scene_s_corner(void **state)
{
    (void)state;
    static const char *const faces[2] = {
        "v 10.5 20.25 30.75\nv 10.5 24.25 30.75\nv 10.5 24.25 34.75\nv 10.5 20.25 34.75\n"
        "v 14.5 20.25 30.75\nv 14.5 20.25 34.75\nv 14.5 24.25 30.75\nf 1 2 3 4\nf 1 5 6 4\nf 1 5 7 2\n",
        "v 10.5 20.25 30.75\nv 13.5 24.25 30.75\nv 13.5 24.25 34.75\nv 10.5 20.25 34.75\n"
        "v 14.5 23.25 30.75\nv 14.5 23.25 34.75\nv 10.5 20.25 33.75\nf 1 2 3 4\nf 1 5 6 4\n"};
    for (int tilted = 0; tilted < 2; tilted++) {
        struct scene *scene = load_text("corner.obj", faces[tilted]);
        struct figures_density d;
        cloud.n = 0;
        /* Each of the 4 x 4 cells of a square gets a point near its beginning, and one near its end. */
        for (int i = 0; i < 32 * (tilted ? 2 : 3); i++) {
            const double within = i % 2 ? 0.9 : 0.1, u = within + i / 2 % 4, v = within + (double)(i / 8 % 4);
            const uint32_t face = (uint32_t)(i / 32);
            if (tilted) /* the first faces x more, so its cells are even along y; the second y, so along x */
                add(10.5 + (face == 0 ? 0.75 * u : u), 20.25 + (face == 0 ? u : 0.75 * u), 30.75 + v, 2 * face, 1);
            else
                add(10.5 + (face == 0 ? 0 : u),
                    20.25 + (face == 1   ? 0
                             : face == 0 ? u
                                         : v),
                    30.75 + (face == 2 ? 0 : v), 2 * face, 1);
        }
        density(scene, 1.0, &d);
        assert_int_equal(d.n, cloud.n / 2);
        for (size_t i = 0; i < d.n; i++) {
            const double area_m2 = d.cell[i].area_m2, want_m2 = tilted ? 1.25 : 1.0;
            assert_true(d.cell[i].n == 2 && fabs(area_m2 - want_m2) < 1e-14); /* a double has 53 bits */
        }
        figures_density_free(&d);
        scene_free(scene);
    }
}

/* The density is points / area in double precision, also where the area is no short binary number: 2 / 0.04. */
static void the_density_is_exact(void **state)
{
    (void)state;
    struct scene *scene = load_text("floor.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    struct figures_density d;
    add(0.1, 0.1, 0, 0, 1);
    add(0.1, 0.15, 0, 0, 1);
    density(scene, 0.2, &d);
    assert_true(fabs(all_of(&d).p50 - 50.0) < 1e-13 * 50.0);
    figures_density_free(&d);
    scene_free(scene);
}

/* Planes that are a cell or more apart have cells of their own. */
static void planes_have_their_own_cells(void **state)
{
    (void)state;
    struct scene *scene = load_text("floors.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nv 0 0 9\n"
                                                  "v 1 0 9\nv 0 1 9\nf 1 2 3\nf 4 5 6\nf 7 8 9\n");
    struct figures_density d;
    for (int i = 0; i < 12; i++)
        add(0.1 + 0.05 * i, 0.1, i < 2 ? 0 : i < 5 ? 1 : 9, i < 2 ? 0 : i < 5 ? 1 : 2, 1);
    density(scene, 1.0, &d);
    assert_int_equal(d.n, 3);
    assert_true(d.cell[0].n == 2 && d.cell[1].n == 3 && d.cell[2].n == 7); /* by density */
    figures_density_free(&d);
    scene_free(scene);
}

/* A scene is 10 m wide. Points lie up to `max_m` beside it, but at most as far as its width. Cells have numbers of 15
 * bits. */
static void cells_are_not_too_many(void **state)
{
    (void)state;
    static const struct {
        double max_m, cell_m, want_m; /* (10 + 2 reach) / want is up to 32766; half of want would be too small */
    } row[] = {{10, 1e-4, 16e-4}, {1, 1e-4, 4e-4},  {1000, 1e-4, 16e-4},
               {10, 5e-4, 10e-4}, {5, 5e-4, 10e-4}, {2, 5e-4, 5e-4}};
    struct scene *scene = load_text("floor.obj", "v 0 0 0\nv 10 0 0\nv 0 10 0\nf 1 2 3\n");
    add(1, 1, 0, 0, 1);
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct figures_density d;
        site.max_m = row[i].max_m;
        density(scene, row[i].cell_m, &d);
        if (!(fabs(d.cell_m / row[i].want_m - 1) < 1e-12)) fail_msg("%zu: %g m", i, d.cell_m);
        figures_density_free(&d);
    }
    scene_free(scene);
}

/* 10000 cells are more than a table begins with. The cells have 1, 2 or 3 points, and come back by that number. */
static void many_cells_are_all_kept(void **state)
{
    (void)state;
    struct scene *scene = load_text("floor.obj", "v 0 0 0\nv 200 0 0\nv 0 200 0\nf 1 2 3\n");
    struct figures_density d;
    size_t count[4] = {0}, at = 0;
    for (int i = 0; i < 100 * 100; i++)
        for (int k = 0; k <= i % 7 % 3 && cloud.n < MOST; k++)
            add(i % 100 + 0.25 * (k + 1), (double)(i / 100) + 0.5, 0, 0, 1);
    for (int i = 0; i < 100 * 100; i++)
        count[1 + i % 7 % 3]++;
    density(scene, 1.0, &d);
    assert_int_equal(d.n, 10000);
    for (uint32_t n = 1; n <= 3; n++)
        for (size_t i = 0; i < count[n]; i++)
            assert_int_equal(d.cell[at++].n, n);
    const struct figures_density_row row = all_of(&d);
    assert_true(row.cells == 10000 && row.points == cloud.n);
    /* Points, not cells, make the shares: below p5 are cells of one point. */
    assert_true(row.p5 == 1 && row.p95 == 3 && row.p50 == (2 * (count[1] + 2 * count[2]) >= cloud.n ? 2 : 3));
    figures_density_free(&d);
    scene_free(scene);
}

/* Points without a triangle, and far points, take no part. A cell's range is the mean of its points' ranges. A cell
 * without a known range counts only in the whole, 0 to infinity. */
static void ranges_of_cells(void **state)
{
    (void)state;
    struct scene *scene = load_text("floor.obj", "v 0 0 0\nv 10 0 0\nv 0 10 0\nf 1 2 3\n");
    struct figures_density d;
    static const struct {
        double from_m, to_m;
        size_t cells;
    } row[] = {{0, INFINITY, 3}, {4, 4.5, 1}, {3, 4, 0},          {4.5, INFINITY, 1},
               {0, 6, 1},        {0, 6.5, 2}, {1e-9, INFINITY, 2}};
    add(0.1, 0.5, 0, 0, 3);
    add(0.2, 0.5, 0, 0, 5);
    add(1.5, 0.5, 0, 0, 6);
    add(2.5, 0.5, 0, 0, (double)NAN);
    add(3.5, 0.5, 0, CLOUD_TRIANGLE_NONE, 4);
    add(4.5, 0.5, 0, 0, 4);
    distance_m[cloud.n - 1] = INFINITY;
    add(5.5, 0.5, 0, 0, 4);
    distance_m[cloud.n - 1] = (double)NAN;
    density(scene, 1.0, &d);
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct figures_density_row got;
        figures_density_within(&d, 0, row[i].from_m, row[i].to_m, &got);
        if (got.cells != row[i].cells) fail_msg("%g to %g m: %zu", row[i].from_m, row[i].to_m, got.cells);
    }
    figures_density_free(&d);
    scene_free(scene);
}

static int stop(void *ctx)
{
    (void)ctx;
    return 1;
}

static void a_stop_leaves_nothing(void **state)
{
    (void)state;
    struct scene *scene = load_text("floor.obj", "v 0 0 0\nv 10 0 0\nv 0 10 0\nf 1 2 3\n");
    const struct figures_on_scene in = {&compared, scene, range_m};
    const struct sh_report report = {.stop = stop};
    struct figures_density d;
    struct figures_density_row row;
    add(0.5, 0.5, 0, 0, 3);
    assert_int_equal(figures_density_of(&in, 1.0, &report, &d, &err), SH_ESTOPPED);
    assert_int_equal(figures_density_fit(&in, 1.0, &report, &d, &row, &err), SH_ESTOPPED);
    assert_true(d.n == 0 && d.cell == NULL);
    cloud.n = 0; /* without points there is no cell */
    density(scene, 1.0, &d);
    assert_int_equal(d.n, 0);
    row = all_of(&d);
    assert_true(row.cells == 0 && row.points == 0 && isnan(row.p5) && isnan(row.p50) && isnan(row.p95));
    figures_density_free(&d);
    scene_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(cells_grow_until_they_hold_sixteen, begin),
        cmocka_unit_test_setup(cells_of_few_points, begin),
        cmocka_unit_test_setup(cells_begin_at_the_scene_s_corner, begin),
        cmocka_unit_test_setup(the_density_is_exact, begin),
        cmocka_unit_test_setup(planes_have_their_own_cells, begin),
        cmocka_unit_test_setup(cells_are_not_too_many, begin),
        cmocka_unit_test_setup(many_cells_are_all_kept, begin),
        cmocka_unit_test_setup(ranges_of_cells, begin),
        cmocka_unit_test_setup(a_stop_leaves_nothing, begin),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
