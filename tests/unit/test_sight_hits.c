/* SPDX-License-Identifier: MIT */
/* A sight's hits are those of the BVH, bit by bit. Random scenes have surfaces that are hard to order, and rays are
 * aimed at edges, corners and the borders of the map's cells. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/sight.h"
#include "core/vec3.h"
#include "tests/common/cases.h"
#include "tests/common/thorough.h"
#include "tests/unit/soups.h"

#ifndef SCENES
#define SCENES (SANITIZED ? 2 : 24) /* of each kind */
#endif
enum { RAYS = 6001, SHOWN = 5 };

struct hits {
    double range_m[RAYS];
    uint32_t triangle[RAYS], label[RAYS];
    float steep[RAYS];
};

struct rig {
    struct soup soup;
    struct scene *scene;
    struct bvh *bvh;
    struct sight *sight;
    struct bvh_work *work;
    struct sight_work *sight_work;
    double station_m[3], off_m[3];
    double x[RAYS], y[RAYS], z[RAYS];
    struct hits want, got;
    uint64_t differ, few, asked;
};

static void check(int rc, const struct sh_err *err)
{
    if (rc != SH_OK) fail_msg("%s", err->text);
}

static struct sight *make_sight(const struct rig *r, double rays)
{
    struct sh_err err;
    struct sight *sight;
    const struct sight_spec spec = {.bvh = r->bvh,
                                    .station_m = {r->station_m[0], r->station_m[1], r->station_m[2]},
                                    .rays = rays,
                                    .memory_bytes = 16 << 20};
    check(sight_create(&spec, 1, NULL, &sight, &err), &err);
    return sight;
}

static void open_rig(struct rig *r, double rays)
{
    struct sh_err err;
    for (uint32_t i = 0; i < r->soup.n_vertices; i++)
        vec3_add(r->soup.vertex[i], r->off_m, r->soup.vertex[i]);
    vec3_add(r->station_m, r->off_m, r->station_m);
    const struct scene_surface surface[5] = {
        {.object = "a"}, {.object = "b"}, {.object = "c"}, {.object = "d"}, {.object = "e"}};
    const struct scene_arrays arrays = {(const double(*)[3])r->soup.vertex,
                                        r->soup.n_vertices,
                                        (const uint32_t(*)[3])r->soup.triangle,
                                        r->soup.n,
                                        r->soup.label,
                                        surface,
                                        5};
    check(scene_from_arrays(&arrays, &r->scene, &err), &err);
    check(bvh_create(r->scene, 1, NULL, &r->bvh, &err), &err);
    r->sight = make_sight(r, rays);
    check(bvh_work_create(&r->work, &err), &err);
    check(sight_work_create(&r->sight_work, &err), &err);
}

static void close_rig(struct rig *r)
{
    r->few += sight_work_counters(r->sight_work)->few;
    r->asked += sight_work_counters(r->sight_work)->asked;
    sight_work_free(r->sight_work);
    bvh_work_free(r->work);
    sight_free(r->sight);
    bvh_free(r->bvh);
    scene_free(r->scene);
}

static void aim(struct rig *r, uint32_t i, const double d[3])
{
    const double length = vec3_length(d);
    if (!(length > 0.0)) { /* the station itself */
        aim(r, i, (const double[3]){0.0, 0.0, 1.0});
        return;
    }
    r->x[i] = d[0] / length;
    r->y[i] = d[1] / length;
    r->z[i] = d[2] / length;
}

/* Moves a number by some units of the last place. */
static double shaken(double x, uint64_t *state)
{
    for (int64_t k = case_between(state, -4, 4); k != 0; k += k < 0 ? 1 : -1)
        x = nextafter(x, k < 0 ? -INFINITY : INFINITY);
    return x;
}

/* Aims at the border of a cell, for any number of cells up to 2,048, and on the borders of faces, too. */
static void aim_at_cell(struct rig *r, uint32_t i, uint64_t *state)
{
    const int axis = (int)case_between(state, 0, 2), both = (int)case_between(state, 0, 1);
    double d[3], u = (double)case_between(state, -64, 64) / 64.0;
    d[axis] = case_between(state, 0, 1) ? 1.0 : -1.0;
    d[(axis + 1) % 3] = shaken(u, state);
    d[(axis + 2) % 3] = both ? shaken((double)case_between(state, -1024, 1024) / 1024.0, state) : between(state, -1, 1);
    aim(r, i, d); /* divides by the length, which shifts it by a last place or not at all */
}

/* Aims at a corner, an edge or the inside of a triangle, to the last places. */
static void aim_at_triangle(struct rig *r, uint32_t i, uint64_t *state)
{
    const struct soup *s = &r->soup;
    const uint32_t *t = s->triangle[case_between(state, 0, (int64_t)s->n - 1)], k = (uint32_t)case_between(state, 0, 2);
    const double *a = s->vertex[t[k]], *b = s->vertex[t[(k + 1) % 3]], *c = s->vertex[t[(k + 2) % 3]];
    const int64_t how = case_between(state, 0, 2);
    const double p = how == 0 ? 0.0 : case_unit(state), q = how == 2 ? (1.0 - p) * case_unit(state) : 0.0;
    double d[3];
    for (int j = 0; j < 3; j++)
        d[j] = shaken(a[j] + p * (b[j] - a[j]) + q * (c[j] - a[j]) - r->station_m[j], state);
    aim(r, i, d);
}

static void aim_all(struct rig *r, uint64_t *state)
{
    for (uint32_t i = 0; i < RAYS; i++) {
        double d[3];
        any_point(state, 1.0, d);
        aim(r, i, d);
        if (i % 4 == 1) aim_at_cell(r, i, state);
        if (i % 4 >= 2) aim_at_triangle(r, i, state);
    }
}

static struct bvh_rays rays_of(struct rig *r, struct hits *hits, uint32_t n)
{
    memset(hits, 0xee, sizeof *hits);
    return (struct bvh_rays){.n = n,
                             .from.at_m = {r->station_m[0], r->station_m[1], r->station_m[2]},
                             .dir = {r->x, r->y, r->z},
                             .range_max_m = 1000.0,
                             .range_m = hits->range_m,
                             .triangle = hits->triangle,
                             .label = hits->label,
                             .steep = hits->steep};
}

static int same_double(double a, double b)
{
    return memcmp(&a, &b, sizeof a) == 0 || (isnan(a) && isnan(b));
}

static void compare(struct rig *r, const char *what, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++) {
        const struct hits *w = &r->want, *g = &r->got;
        if (same_double(w->range_m[i], g->range_m[i]) && w->triangle[i] == g->triangle[i] &&
            w->label[i] == g->label[i] && same_double((double)w->steep[i], (double)g->steep[i]))
            continue;
        if (r->differ++ < SHOWN)
            print_message("%s, ray %u (%.17g %.17g %.17g): triangle %u at %.17g, label %u, steep %.9g; by sight %u at "
                          "%.17g, %u, %.9g\n",
                          what, i, r->x[i], r->y[i], r->z[i], w->triangle[i], w->range_m[i], w->label[i],
                          (double)w->steep[i], g->triangle[i], g->range_m[i], g->label[i], (double)g->steep[i]);
    }
}

/* Casts all rays, at once, in both ways. */
static void cast_both(struct rig *r, const char *what, uint32_t n)
{
    const struct bvh_rays want = rays_of(r, &r->want, n), got = rays_of(r, &r->got, n);
    bvh_hits(r->work, r->bvh, &want);
    sight_hits(r->sight_work, r->work, r->sight, &got);
    compare(r, what, n);
}

/* Opens a scene of a kind, with a station in it, and places both. */
static void open_kind(struct rig *r, uint32_t kind, uint64_t *state)
{
    static const double far_m[3] = {512345.678, 5412345.678, 321.5};
    r->soup.n = r->soup.n_vertices = 0;
    while (r->soup.n == 0)
        SOUPS[kind](&r->soup, state);
    any_point(state, case_between(state, 0, 1) ? 2.0 : 12.0, r->station_m);
    if (case_between(state, 0, 3) == 0)
        for (int k = 0; k < 3; k++)
            r->station_m[k] = 0.5 * round(2.0 * r->station_m[k]); /* in planes and edges of boxes */
    for (int k = 0; k < 3; k++)
        r->off_m[k] = case_between(state, 0, 3) == 0 ? far_m[k] : 0.0;
    open_rig(r, exp(between(state, 5.0, 17.0)));
}

static void run_kind(struct rig *r, uint32_t kind, uint64_t seed)
{
    uint64_t state = seed * 2 + 1;
    for (int k = 0; k < 8; k++)
        case_u64(&state);
    open_kind(r, kind, &state);
    aim_all(r, &state);
    const uint64_t before = r->differ;
    cast_both(r, "all at once", RAYS);
    if (r->differ != before) print_message("kind %u, seed %llu\n", kind, (unsigned long long)seed);
    close_rig(r);
}

static void hits_are_those_of_the_bvh(void **state)
{
    (void)state;
    static struct rig r;
    for (uint32_t kind = 0; kind < N_SOUPS; kind++) {
        r.few = r.asked = 0;
        for (uint64_t seed = 0; seed < SCENES; seed++)
            run_kind(&r, kind, 1000 * kind + seed);
        print_message("kind %u: %.2f %% of the rays met few triangles, %.2f %% the BVH\n", kind,
                      100.0 * (double)r.few / (1.0 * SCENES * RAYS), 100.0 * (double)r.asked / (1.0 * SCENES * RAYS));
    }
    assert_int_equal(r.differ, 0);
}

/* Packets may have any width, and there may be any number of rays, in chunks or not. */
static void packets_and_numbers_make_no_difference(void **state)
{
    (void)state;
    static const uint32_t width[] = {1, 4, 8, 16}, number[] = {1, 3, 17, 1023, 1024, 1025, 2049, 5000};
    static struct rig r;
    uint64_t seed = 4711;
    for (uint32_t kind = 0; kind < N_SOUPS; kind++) {
        open_kind(&r, kind, &seed);
        for (uint32_t k = 0; k < sizeof width / sizeof *width; k++) {
            bvh_set_packet(r.bvh, width[k]);
            for (uint32_t i = 0; i < sizeof number / sizeof *number; i++) {
                if ((i + k) % (uint32_t)thorough(1, 3) != 0) continue; /* each number with one width, or two */
                aim_all(&r, &seed);
                cast_both(&r, "in parts", number[i]);
            }
        }
        close_rig(&r);
    }
    assert_int_equal(r.differ, 0);
}

/* Labels and steepness that are left out change no range. Nothing is written beyond the last ray. */
static void what_is_not_asked_for_is_left_alone(void **state)
{
    (void)state;
    enum { N = 1500 };
    static struct rig r;
    uint64_t seed = 815;
    for (uint32_t kind = 0; kind < N_SOUPS; kind++) {
        open_kind(&r, kind, &seed);
        aim_all(&r, &seed);
        struct bvh_rays rays = rays_of(&r, &r.want, N);
        sight_hits(r.sight_work, r.work, r.sight, &rays);
        rays = rays_of(&r, &r.got, N);
        rays.label = NULL;
        rays.steep = NULL;
        sight_hits(r.sight_work, r.work, r.sight, &rays);
        for (uint32_t i = 0; i < RAYS; i++) {
            assert_true(same_double(r.got.range_m[i], r.want.range_m[i]));
            assert_int_equal(r.got.triangle[i], r.want.triangle[i]);
            assert_int_equal(r.got.label[i], 0xeeeeeeee);
            assert_true(i < N || r.want.label[i] == 0xeeeeeeee);
        }
        close_rig(&r);
    }
}

/* In an earlier version, doubt was counted in other units when steepness was asked for: at edges of large triangles
 * float alone decided. */
static void steepness_decides_nothing(void **state)
{
    (void)state;
    static struct rig r;
    uint64_t seed = 99;
    for (uint32_t kind = 0; kind < N_SOUPS; kind++) {
        open_kind(&r, kind, &seed);
        aim_all(&r, &seed);
        struct bvh_rays rays = rays_of(&r, &r.want, RAYS);
        bvh_hits(r.work, r.bvh, &rays);
        rays = rays_of(&r, &r.got, RAYS);
        rays.steep = NULL;
        bvh_hits(r.work, r.bvh, &rays);
        memcpy(r.got.steep, r.want.steep, sizeof r.got.steep);
        compare(&r, "without steepness", RAYS);
        close_rig(&r);
    }
    assert_int_equal(r.differ, 0);
}

static void a_face_that_stands_twice_is_a_twin(void **state)
{
    (void)state;
    static const double p[4][3] = {{5, -1, -1}, {5, 2, -1}, {5, 0, 3}, {5, 2, 3}};
    static struct rig r;
    add(&r.soup, p[0], p[1], p[2]);
    add(&r.soup, p[1], p[3], p[2]);
    add(&r.soup, p[2], p[0], p[1]);
    add(&r.soup, p[1], p[0], p[2]);
    open_rig(&r, 1e5);
    uint64_t *twin;
    struct sh_err err;
    check(scene_find_duplicate_faces(r.scene, NULL, &twin, &err), &err);
    assert_int_equal(twin[0], 4 | 8);
    free(twin);
    close_rig(&r);
}

/* No ray meets anything. Some directions have components of nearly nothing. */
static void nothing_to_be_seen(void **state)
{
    (void)state;
    static const double p[3][3] = {{5, -1, -1}, {5, 2, -1}, {5, 0, 3}};
    static struct rig r;
    uint64_t seed = 3;
    add(&r.soup, p[0], p[1], p[2]);
    open_rig(&r, 1e5);
    aim_all(&r, &seed);
    for (uint32_t i = 0; i < RAYS; i++)
        r.x[i] = -fabs(r.x[i]) - 1e-3;
    cast_both(&r, "behind", RAYS);
    for (uint32_t i = 0; i < RAYS; i++)
        assert_int_equal(r.got.triangle[i], BVH_NO_TRIANGLE);
    for (uint32_t i = 0; i < RAYS; i++) { /* along axes and the cube's edges, all but exactly */
        const double odd[] = {0.0, -0.0, 1.0, -1.0, 1e-20, -1e-20, 1e-310};
        const double d[3] = {odd[case_between(&seed, 0, 6)], odd[case_between(&seed, 0, 6)], odd[2 + i % 2]};
        aim(&r, i, d);
    }
    cast_both(&r, "axes", RAYS);
    close_rig(&r);
    assert_int_equal(r.differ, 0);
}

/* Two sheets are folded at a common edge. Rays pass beside the edge, some so near that float can't tell the sheets
 * apart. The nearer one is met. */
static void folded_sheets_are_ordered(void **state)
{
    (void)state;
    enum { FOLDS = 60 };
    static struct rig r;
    uint64_t seed = 12, wrong = 0, met = 0;
    for (int fold = 0; fold < thorough(FOLDS, FOLDS / 4); fold++) {
        const double angle = exp(between(&seed, -7.0, 0.0)), turn = between(&seed, 0.3, 2.0);
        const double p[4][3] = {{10, -5, 0},
                                {10, 5, 0.3},
                                {10 + 4 * cos(turn), 0.1, 4 * sin(turn)},
                                {10 + 4 * cos(turn + angle), -0.2, 4 * sin(turn + angle)}};
        memset(r.station_m, 0, sizeof r.station_m);
        r.soup.n = r.soup.n_vertices = 0;
        add(&r.soup, p[0], p[1], p[2]);
        add(&r.soup, p[1], p[0], p[3]);
        open_rig(&r, 1e5);
        for (uint32_t i = 0; i < RAYS; i++) {
            const double along = case_unit(&seed), beside = exp(between(&seed, -11.0, -3.0));
            const double d[3] = {10, -5 + 10 * along, 0.3 * along + beside};
            aim(&r, i, d);
        }
        const struct bvh_rays rays = rays_of(&r, &r.got, RAYS);
        bvh_hits(r.work, r.bvh, &rays);
        for (uint32_t i = 0; i < RAYS; i++) {
            if (r.got.triangle[i] == BVH_NO_TRIANGLE) continue;
            /* Near the middle of the edge both are met, and the planes decide which is nearer. */
            const double d[3] = {r.x[i], r.y[i], r.z[i]};
            const double in_a = bvh_range_of(r.bvh, 0, r.station_m, d), in_b = bvh_range_of(r.bvh, 1, r.station_m, d);
            const double mid = d[1] / d[0];
            if (fabs(mid) > 0.3 || !(in_a > 0.0) || !(in_b > 0.0)) continue;
            if (in_a * d[2] > 1.0 || in_b * d[2] > 1.0 || fabs(in_a - in_b) < 1e-10) continue;
            met++;
            wrong += fabs(r.got.range_m[i] - fmin(in_a, in_b)) > 1e-10;
        }
        close_rig(&r);
    }
    assert_true(met > FOLDS * RAYS / 10);
    assert_int_equal(wrong, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(hits_are_those_of_the_bvh),           cmocka_unit_test(packets_and_numbers_make_no_difference),
        cmocka_unit_test(what_is_not_asked_for_is_left_alone), cmocka_unit_test(steepness_decides_nothing),
        cmocka_unit_test(a_face_that_stands_twice_is_a_twin),  cmocka_unit_test(nothing_to_be_seen),
        cmocka_unit_test(folded_sheets_are_ordered),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
