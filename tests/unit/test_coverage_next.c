/* SPDX-License-Identifier: MIT */
/* The next station: places where a tripod can stand, and the gain of each. */
#include "tests/unit/coverage_rig.h"

#include "core/studio/viewpoint.h"

static const double RIGHT[3] = {5.0, 1.0, 1.2};
static const double HEIGHT_M = 1.2;

/* ---- places */

/* The roof does not count. */
static uint32_t find_places(const struct cover *c, double step_m, double height_m, struct viewpoint_place **place)
{
    const struct viewpoint_grid grid = {
        step_m, height_m, {0.0, 0.0, -INFINITY}, {c->scene->max_m[0], c->scene->max_m[1], 1.5}};
    uint32_t n;
    struct sh_err err;
    if (viewpoint_places(c->bvh, &grid, NULL, place, &n, &err) != 0) fail_msg("%s", err.text);
    return n;
}

/* The L on a grid of 0.5 m: x, y = 0.25, 0.75, ... Places 0.25 m from a wall are too near. The right leg keeps 10 by 2:
 * x from 0.75 to 5.25 and y = 0.75, 1.25. The row y = 1.75 has the three with x < 2. The upper leg has 2 by 5: x =
 * 0.75, 1.25 and y from 2.25 to 4.25. */
static void test_places(void **state)
{
    (void)state;
    struct cover *c = cover_open(cover_l_room(), 0.5, 1);
    struct viewpoint_place *place;
    const uint32_t n = find_places(c, 0.5, HEIGHT_M, &place);
    assert_int_equal(n, 20 + 3 + 10);
    for (uint32_t i = 0; i < n; i++) {
        const double *p = place[i].position_m;
        assert_true(p[2] == HEIGHT_M && place[i].floor_m == 0.0);
        assert_true(p[0] > 0.3 && p[1] > 0.3 && p[0] < 5.7 && p[1] < 4.7 && !(p[0] > 1.7 && p[1] > 1.75));
        if (i > 0) assert_true(p[0] > p[-4] || (p[0] == p[-4] && p[1] > p[-3])); /* in order; a place is 4 doubles */
    }
    free(place);
    /* 0.2 m above the head are needed, and the room is 2.4 m high. */
    assert_int_equal(find_places(c, 0.5, 2.19, &place), 33);
    free(place);
    assert_int_equal(find_places(c, 0.5, 2.21, &place), 0);
    free(place);
    cover_close(c);
}

/* A table of 1 m by 0.1 m is no floor: most of the 8 spots around lie beside it. A plate of 3 m is one, and there is
 * too little room under it. */
static void test_no_floors(void **state)
{
    (void)state;
    static const struct {
        double half_m[2], z_m;
        uint32_t n; /* on a grid of 1 m over 10 m by 10 m */
        uint32_t high;
    } cases[] = {{{0.5, 0.05}, 1.0, 100 - 1, 0}, {{1.5, 1.5}, 1.0, 100, 9}};
    for (size_t i = 0; i < 2; i++) {
        const double x = cases[i].half_m[0], y = cases[i].half_m[1], z = cases[i].z_m;
        const double vertex[8][3] = {{0, 0, 0},
                                     {10, 0, 0},
                                     {10, 10, 0},
                                     {0, 10, 0},
                                     {4.5 - x, 4.5 - y, z},
                                     {4.5 + x, 4.5 - y, z},
                                     {4.5 + x, 4.5 + y, z},
                                     {4.5 - x, 4.5 + y, z}};
        static const uint32_t triangle[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
        struct scene *scene;
        struct viewpoint_place *place;
        struct sh_err err;
        uint32_t high = 0;
        assert_int_equal(scene_from_arrays(&(struct scene_arrays){vertex, 8, triangle, 4, NULL, NULL, 0}, &scene, &err),
                         0);
        struct cover *c = cover_open(scene, 1.0, 1);
        const uint32_t n = find_places(c, 1.0, 1.6, &place);
        for (uint32_t k = 0; k < n; k++)
            high += place[k].floor_m == z;
        if (n != cases[i].n || high != cases[i].high) fail_msg("case %zu: %u places, %u of them high", i, n, high);
        free(place);
        cover_close(c);
    }
}

static void test_too_many(void **state)
{
    (void)state;
    struct cover *c = cover_open(cover_l_room(), 0.5, 1);
    const struct viewpoint_grid grid = {1e-3, 1.6, {0, 0, 0}, {6, 5, 1}};
    struct viewpoint_place *place;
    uint32_t n;
    struct sh_err err;
    assert_int_equal(viewpoint_places(c->bvh, &grid, NULL, &place, &n, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "6000 by 5000"));
    assert_null(place);
    cover_close(c);
}

/* ---- gains */

/* Directions of a whole sphere, in n_rings rings. */
struct rays {
    uint32_t n;
    double dir[20000][3], sr[20000];
};

static struct rays *make_rays(uint32_t n_rings, int whole)
{
    struct rays *r = calloc(1, sizeof *r);
    assert_non_null(r);
    for (uint32_t i = 0; i < n_rings; i++) {
        const double low = -M_PI_2 + M_PI * i / n_rings, high = low + M_PI / n_rings;
        const double z = 0.5 * (sin(low) + sin(high));
        const uint32_t n = (uint32_t)fmax(3.0, 2.0 * n_rings * sqrt(1.0 - z * z));
        for (uint32_t k = 0; k < n; k++, r->n++) {
            const double turn = 2.0 * M_PI * (k + 0.37) / n;
            assert_true(r->n < 20000);
            r->dir[r->n][0] = sqrt(1.0 - z * z) * sin(turn);
            r->dir[r->n][1] = sqrt(1.0 - z * z) * cos(turn);
            r->dir[r->n][2] = z;
            r->sr[r->n] = whole ? INFINITY : 2.0 * M_PI * (sin(high) - sin(low)) / n;
        }
    }
    return r;
}

static void gains_of(const struct cover *c, const struct rays *rays, const double (*place_m)[3], uint32_t n,
                     struct coverage_gain *gain)
{
    const struct coverage_directions d = {rays->n, rays->dir, rays->sr, 0.0, 1000.0};
    struct sh_err err;
    if (coverage_gains(c->coverage, &d, &(struct coverage_places){n, place_m, NULL}, NULL, gain, &err) != 0)
        fail_msg("%s", err.text);
}

/* Finds the cells that rays meet in the slow way: each piece is asked whether the ray passes through it. */
struct search {
    const double *from, *dir;
    double range_m;
    uint32_t cell;
};

static void try_piece(void *ctx, uint32_t cell, int n, const double corner[4][3])
{
    struct search *s = ctx;
    double a[3], b[3], normal[3], to[3], p[3];
    vec3_sub(corner[1], corner[0], a);
    vec3_sub(corner[2], corner[0], b);
    vec3_cross(a, b, normal);
    vec3_sub(corner[0], s->from, to);
    const double along = vec3_dot(normal, s->dir), range_m = vec3_dot(normal, to) / along;
    if (!(range_m > 0.0) || !(range_m < s->range_m)) return;
    for (int i = 0; i < 3; i++)
        p[i] = s->from[i] + range_m * s->dir[i];
    for (int i = 0; i < n; i++) {
        vec3_sub(corner[(i + 1) % n], corner[i], a);
        vec3_sub(p, corner[i], b);
        vec3_cross(a, b, to);
        if (vec3_dot(to, normal) < 0.0) return;
    }
    s->range_m = range_m;
    s->cell = cell;
}

/* With whole cells the gain is the sum of the cells that are met and that no station has seen. */
static void test_brute_force(void **state)
{
    (void)state;
    static const double places_m[][3] = {{1.0, 4.0, 1.2}, {1.3, 2.6, 0.7}, {3.1, 0.6, 2.0}};
    struct cover *c = cover_open(cover_l_room(), 0.5, 3);
    const struct cover_sweep coarse = {2.0, -90.0, 90.0, 0.0, 360.0, 1000.0};
    struct rays *rays = make_rays(24, 1);
    struct coverage_pulses pulses;
    struct coverage_gain gain[3];
    char *met = malloc(coverage_cells(c->coverage));
    assert_non_null(met);
    cover_look(c, RIGHT, &coarse, &pulses);
    gains_of(c, rays, places_m, 3, gain);
    for (int k = 0; k < 3; k++) {
        double want_m2 = 0.0;
        memset(met, 0, coverage_cells(c->coverage));
        for (uint32_t i = 0; i < rays->n; i++) {
            struct search s = {places_m[k], rays->dir[i], INFINITY, 0};
            coverage_pieces(c->coverage, try_piece, &s);
            assert_true(isfinite(s.range_m));
            struct coverage_cell cell;
            coverage_get(c->coverage, s.cell, &cell);
            if (!met[s.cell] && cell.stations == 0) want_m2 += cell.area_m2;
            met[s.cell] = 1;
        }
        if (!(fabs(gain[k].gain_m2 - want_m2) <= 1e-9))
            fail_msg("place %d: %.9f m2, %.9f the long way", k, gain[k].gain_m2, want_m2);
        assert_true(gain[k].front == 1.0 && want_m2 > 1.0);
    }
    free(met);
    free(rays);
    cover_close(c);
}

/* Returns the cell that a ray meets, and writes its area. */
static uint32_t cell_towards(const struct cover *c, const double from_m[3], const double dir[3], double *area_m2)
{
    struct search s = {from_m, dir, INFINITY, 0};
    struct coverage_cell cell;
    coverage_pieces(c->coverage, try_piece, &s);
    coverage_get(c->coverage, s.cell, &cell);
    *area_m2 = cell.area_m2;
    return s.cell;
}

/* All directions but the last meet one wall, and the last one the opposite wall: each counts, whatever their number.
 * The cells that are met have their bits, and no other. */
static void test_every_direction(void **state)
{
    (void)state;
    static const double lo[3] = {-2, -2, -2}, hi[3] = {2, 2, 2}, at[1][3] = {{0.1, 0.2, 0.3}};
    static const uint32_t n[] = {1, 2, 1024, 1025, 2048, 2049};
    struct cover *c = cover_open(cover_box(lo, hi), 3.0, 1);
    const uint32_t n_words = (coverage_cells(c->coverage) + 63) / 64;
    _Atomic uint64_t *cells = calloc(n_words, sizeof *cells);
    struct rays *rays = calloc(1, sizeof *rays);
    static const double ahead[3] = {1, 0, 0}, back[3] = {-1, 0, 0};
    assert_true(cells != NULL && rays != NULL);
    for (size_t i = 0; i < sizeof n / sizeof n[0]; i++) {
        double area_m2[2] = {0.0, 0.0};
        uint32_t cell[2] = {0, cell_towards(c, at[0], back, &area_m2[1])};
        cell[0] = n[i] > 1 ? cell_towards(c, at[0], ahead, &area_m2[0]) : cell[1];
        for (uint32_t k = 0; k < n[i]; k++) {
            memcpy(rays->dir[k], k + 1 < n[i] ? ahead : back, sizeof rays->dir[k]);
            rays->sr[k] = INFINITY;
        }
        for (uint32_t k = 0; k < n_words; k++)
            atomic_store(&cells[k], 0);
        const struct coverage_directions d = {n[i], rays->dir, rays->sr, 0.0, 1000.0};
        struct coverage_gain gain;
        struct sh_err err;
        assert_int_equal(coverage_gains(c->coverage, &d, &(struct coverage_places){1, at, cells}, NULL, &gain, &err),
                         0);
        assert_true(fabs(gain.gain_m2 - area_m2[0] - area_m2[1]) < 1e-9 && gain.front == 1.0);
        for (uint32_t k = 0; k < coverage_cells(c->coverage); k++)
            assert_int_equal(atomic_load(&cells[k / 64]) >> k % 64 & 1, k == cell[0] || k == cell[1]);
    }
    free(cells);
    free(rays);
    cover_close(c);
}

/* A ray stands for range^2 sr / cosine, and the cosine is at least 0.02. The ray counts within the range of the head,
 * both ends included. From outside, walls are met from behind. */
static void test_one_ray(void **state)
{
    (void)state;
    static const double lo[3] = {-2, -2, -2}, hi[3] = {2, 2, 2};
    static const struct {
        double at[3], dir[3], min_m, max_m, gain_m2, front;
    } row[] = {{{0, 0.1, 0.1}, {1, 0, 0}, 0, 1000, 4.0 * 0.5, 1},
               {{0, 0.1, 0.1}, {0.8, 0.6, 0}, 0, 1000, 6.25 * 0.5 / 0.8, 1},
               {{0, 0.1, 0.1}, {1, 0, 0}, 2, 1000, 4.0 * 0.5, 1},
               {{0, 0.1, 0.1}, {1, 0, 0}, 2.001, 1000, 0, NAN},
               {{0, 0.1, 0.1}, {1, 0, 0}, 0, 1.999, 0, NAN},
               {{0, 0.1, 0.1}, {1, 0, 0}, 0, 2, 4.0 * 0.5, 1},
               {{-4, 0.1, 0.1}, {1, 0, 0}, 0, 1000, 4.0 * 0.5, 0},
               {{-4, 0.1, 0.1}, {-1, 0, 0}, 0, 1000, 0, NAN},
               {{1.99, 0.1, 0.1}, {0.01, 0.99994999874993751, 0}, 0, 1000, 1.0 * 0.5 / 0.02, 1}};
    struct cover *c = cover_open(cover_box(lo, hi), 0.3, 1);
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        const double sr[1] = {0.5}; /* more than a cell, so that the ray's area counts */
        const struct coverage_directions d = {1, &row[i].dir, sr, row[i].min_m, row[i].max_m};
        struct coverage_gain gain;
        struct sh_err err;
        assert_int_equal(
            coverage_gains(c->coverage, &d, &(struct coverage_places){1, &row[i].at, NULL}, NULL, &gain, &err), 0);
        if (fabs(gain.gain_m2 - row[i].gain_m2) > 1e-6 * row[i].gain_m2) fail_msg("%zu: %g m2", i, gain.gain_m2);
        assert_true(isnan(row[i].front) ? isnan(gain.front) : gain.front == row[i].front);
    }
    cover_close(c);
}

/* The six sides of a box are of one surface, and in one cube. Each is a cell of its own, since it faces elsewhere. */
static void test_sides_are_cells(void **state)
{
    (void)state;
    static const double vertex[8][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0},
                                        {0, 0, 1}, {1, 0, 1}, {0, 1, 1}, {1, 1, 1}};
    static const uint32_t face[12][3] = {{0, 2, 6}, {0, 6, 4}, {1, 5, 7}, {1, 7, 3}, {0, 4, 5}, {0, 5, 1},
                                         {2, 3, 7}, {2, 7, 6}, {0, 1, 3}, {0, 3, 2}, {4, 6, 7}, {4, 7, 5}};
    struct scene *scene;
    struct sh_err err;
    assert_int_equal(scene_from_arrays(&(struct scene_arrays){vertex, 8, face, 12, NULL, NULL, 0}, &scene, &err), 0);
    struct cover *c = cover_open(scene, 10.0, 1);
    assert_int_equal(coverage_cells(c->coverage), 6);
    for (uint32_t i = 0; i < 6; i++) {
        struct coverage_cell cell;
        coverage_get(c->coverage, i, &cell);
        assert_true(fabs(cell.area_m2 - 1.0) < 1e-6);
    }
    cover_close(c);
}

/* Cells are much smaller than a ray. The gain is the sum of the rays' areas, which is the area of the box. At each of
 * its 12 edges, rays reach too far or not far enough: by half a ray's width on average. */
static void test_coarse_rays(void **state)
{
    (void)state;
    static const double lo[3] = {-1.9, -1.4, -1.1}, hi[3] = {2.2, 1.7, 1.3}, at[1][3] = {{0.1, 0.2, 0.05}};
    struct cover *c = cover_open(cover_box(lo, hi), 0.05, 1);
    struct rays *rays = make_rays(45, 0); /* 4 degrees: 0.08 m at the nearest wall */
    struct coverage_gain gain;
    const double area_m2 = cover_area(c->scene), edges_m = 4.0 * (4.1 + 3.1 + 2.4);
    gains_of(c, rays, at, 1, &gain);
    print_message("%.3f m2 of %.3f m2\n", gain.gain_m2, area_m2);
    if (!(fabs(gain.gain_m2 - area_m2) <= 0.5 * edges_m * 0.08)) fail_msg("%.6f m2 of %.6f m2", gain.gain_m2, area_m2);
    free(rays);
    cover_close(c);
}

/* After a station in the right leg of the L, the best place lies in the upper one, which reaches down to y = 0. The
 * estimate by rays agrees with whole scans within the cells that outlines cut. */
static void test_the_other_leg(void **state)
{
    (void)state;
    struct cover *c = cover_open(cover_l_room(), 0.5, 3);
    const struct cover_sweep sweep = {0.5, -90.0, 90.0, 0.0, 360.0, 1000.0};
    struct viewpoint_place *place;
    struct coverage_pulses pulses;
    struct coverage_gain gain[33];
    struct coverage_scan scan;
    struct sh_err err;
    double at[33][3], seen_m2, gain_m2;
    struct rays *rays = make_rays(90, 0);
    uint32_t best = 0;
    cover_look(c, RIGHT, &sweep, &pulses);
    assert_int_equal(find_places(c, 0.5, HEIGHT_M, &place), 33);
    for (int i = 0; i < 33; i++)
        memcpy(at[i], place[i].position_m, sizeof at[i]);
    gains_of(c, rays, (const double(*)[3])at, 33, gain);
    for (uint32_t i = 0; i < 33; i++)
        if (gain[i].gain_m2 > gain[best].gain_m2) best = i;
    assert_true(at[best][0] < 2.0);
    /* All of the hidden part is seen from there: 2 (6 - 2/3) of floor and ceiling, 22/3 m of walls. The cells that the
     * station's shadow line cuts are seen already: within 2.5 cells of 0.5 m along 6.6 m. */
    const double hidden_m2 = 2.0 * (6.0 - 2.0 / 3.0) + 22.0 / 3.0 * L_HEIGHT_M;
    assert_true(gain[best].gain_m2 <= hidden_m2 + 1e-9 && gain[best].gain_m2 >= hidden_m2 - 6.6 * 2.5 * 0.5);
    for (uint32_t i = 0; i < 33; i += 8) {
        cover_scan(c, at[i], &sweep, &scan);
        assert_int_equal(coverage_look(c->coverage, &scan, "scan", NULL, &pulses, &err), 0);
        coverage_waiting(c->coverage, &seen_m2, &gain_m2);
        /* Only cells on a shadow's line, at most some 7 m long, may count in one gain and not in the other. */
        print_message("%.2f %.2f: %.3f m2 by rays, %.3f m2 by a scan\n", at[i][0], at[i][1], gain[i].gain_m2, gain_m2);
        assert_true(fabs(gain[i].gain_m2 - gain_m2) <= 7.0 * 0.5);
        assert_true(seen_m2 >= gain_m2);
    }
    coverage_drop(c->coverage);
    free(place);
    free(rays);
    cover_close(c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_places),          cmocka_unit_test(test_no_floors),       cmocka_unit_test(test_too_many),
#ifndef SH_SANITIZE /* millions of polygons, and of pulses */
        cmocka_unit_test(test_brute_force),     cmocka_unit_test(test_the_other_leg),
#endif
        cmocka_unit_test(test_coarse_rays),     cmocka_unit_test(test_every_direction), cmocka_unit_test(test_one_ray),
        cmocka_unit_test(test_sides_are_cells),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
