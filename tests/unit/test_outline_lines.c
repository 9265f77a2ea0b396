/* SPDX-License-Identifier: MIT */
/* Outlines one by one: which stretches of an edge count, by what rays see on both sides of it, and the lines that
 * edges draw across a footprint. Expected figures follow from the geometry (core/footprint.h). */
#include <math.h>
#include <string.h>

#include "core/footprint/outlines.h"
#include "tests/common/made.h"

static const double STATION[3] = {0.0, 0.0, 0.0};
enum { MOST = 16 };

/* ---- both sides of an edge */

/* An edge of 0.5 m along x, 10 m ahead. Rays above it see one range, and rays below it another. */
static const double FROM[3] = {-0.25, 10.0, 0.0}, TO[3] = {0.25, 10.0, 0.0};

struct sides {
    double above_m, below_m;
    uint16_t above, below; /* kinds */
    double from_m, to_m;   /* where along x; elsewhere both sides see the same */
    uint32_t rays;
    double narrow_rad, wide_rad; /* between two rays of a pair */
};

static void see(void *ctx, uint32_t n, const struct vec3_in *dir, double *range_m, uint16_t *kind)
{
    struct sides *s = ctx;
    s->rays += n;
    for (uint32_t i = 0; i < n; i++) {
        const double d[3] = {dir->x[i], dir->y[i], dir->z[i]}, x_m = 10.0 * d[0] / d[1];
        const int above = d[2] > 0.0, here = x_m >= s->from_m && x_m <= s->to_m;
        assert_true(fabs(vec3_length(d) - 1.0) < 1e-12);
        range_m[i] = here && !above ? s->below_m : s->above_m;
        kind[i] = here && !above ? s->below : s->above;
        if (i % 2 == 0) continue;
        const double before[3] = {dir->x[i - 1], dir->y[i - 1], dir->z[i - 1]}, apart = vec3_distance(d, before);
        assert_true(above != (before[2] > 0.0)); /* one on each side */
        s->narrow_rad = fmin(s->narrow_rad, apart);
        s->wide_rad = fmax(s->wide_rad, apart);
    }
}

static uint32_t probe(const struct beam *beam, struct sides *sides, const uint8_t **counts)
{
    static struct outline_prober prober;
    const struct beam_probe how = {see, sides};
    prober.probe = &how;
    prober.beam = beam;
    *counts = prober.counts;
    sides->rays = 0;
    sides->narrow_rad = 1.0;
    sides->wide_rad = 0.0;
    return outline_probe(&prober, FROM, TO, 10.0);
}

static struct sides both(double above_m, double below_m)
{
    return (struct sides){above_m, below_m, 1, 1, -1.0, 1.0, 0, 0.0, 0.0};
}

/* Parts of the edge are about a radius of the footprint long. The strip between two rays has less energy than an echo
 * needs. */
static void each_part_has_a_ray_on_both_sides(void **state)
{
    (void)state;
    static const struct {
        double radius_m;
        uint32_t parts;
    } is[] = {{0.05, 10}, {0.051, 10}, {0.049, 11}, {0.51, 1}, {3.0, 1}, {1e-6, PROBE_MOST}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        struct beam beam;
        struct sides sides = both(10.0, 12.0);
        const uint8_t *counts;
        double beyond, moment;
        beam_init(&beam, 0.0, 2.0 * is[i].radius_m / 10.0 * (1.0 - 1e-9), 4e-9);
        if (i == 0) beam_init(&beam, 0.0, 0.01 * (1.0 + 1e-9), 4e-9); /* ten radii, but for rounding */
        const uint32_t n = probe(&beam, &sides, &counts);
        assert_int_equal(n, is[i].parts);
        assert_int_equal(sides.rays, 2 * n);
        for (uint32_t k = 0; k < n; k++)
            assert_int_equal(counts[k], 1);
        beam_half(&beam, 0.5 * sides.wide_rad * 10.0 / is[i].radius_m, &beyond, &moment);
        assert_true(1.0 - 2.0 * beyond < BEAM_LEAST_ENERGY);
        assert_true(sides.narrow_rad > 0.99 * sides.wide_rad); /* the edge's ends are hardly further away */
    }
}

/* An edge that leads away, from 9 m to 11 m ahead and 1 m aside, has ten parts of 0.2 m. Both sides see something else
 * at 10 m, so parts beyond it are hidden. A part that is y ahead is at hypot(1, y): the one at 9.9 m is 9.95 m away,
 * and the next one 10.15 m. A neighbour of a part that counts also counts. */
static void parts_are_hidden_by_their_own_range(void **state)
{
    (void)state;
    static const double near[3] = {1.0, 9.0, 0.0}, far[3] = {1.0, 11.0, 0.0};
    static struct outline_prober prober;
    static struct beam beam;
    static struct sides sides = {10.0, 10.0, 1, 2, -2.0, 2.0, 0, 0.0, 0.0};
    static const struct beam_probe how = {see, &sides};
    beam_init(&beam, 0.0, 2.0 * 0.2 / 10.0 * (1.0 + 1e-9), 4e-9);
    prober.probe = &how;
    prober.beam = &beam;
    for (int away = 0; away < 2; away++) {
        assert_int_equal(outline_probe(&prober, away ? near : far, away ? far : near, 10.0), 10);
        for (int i = 0; i < 10; i++)
            assert_int_equal(prober.counts[away ? i : 9 - i], i <= 5);
    }
}

static void what_counts_as_a_step(void **state)
{
    (void)state;
    const double nan = (double)NAN;
    struct beam beam;
    const uint8_t *counts;
    beam_init(&beam, 0.0, 0.01, 4e-9); /* 0.05 m at the edge */
    struct sides sides = both(10.0, 10.0);
    probe(&beam, &sides, &counts);
    /* Sides of a plane that is seen at a slope of 20 differ by this much. Less is no step. */
    const double most_m = BEAM_LEAST_STEP_M + 20.0 * sides.wide_rad * 10.0, little_m = 1e-5 * most_m;
    const struct {
        double above_m, below_m;
        int other_kind, counts;
    } is[] = {{10.0, 10.0, 0, 0},
              {10.0, 10.0, 1, 1}, /* one kind of surface ends, without a step */
              {10.0, nan, 0, 1},
              {nan, 10.0, 0, 1},
              {nan, nan, 0, 0},
              {nan, nan, 1, 0},
              {10.0, 10.0 + most_m - little_m, 0, 0},
              {10.0 + most_m - little_m, 10.0, 0, 0},
              {10.0, 10.0 + most_m + little_m, 0, 1},
              {10.0 + most_m + little_m, 10.0, 0, 1},
              {10.0, 5.0, 0, 1}, /* something hides one side, and its own edge is there */
              {5.0, 10.0, 0, 1},
              {5.0, 5.0, 1, 0}, /* both sides are hidden */
              {5.0, 4.0, 0, 0},
              {4.0, 5.0, 0, 0},
              {15.0, 12.0, 0, 1},
              {10.0 - 1.1 * most_m, 10.0 - 1.1 * most_m, 1, 0},
              {10.0 - 0.3 * most_m, 10.0 - 1.1 * most_m, 1, 1},
              {10.0 - 1.1 * most_m, 10.0 - 0.3 * most_m, 1, 1}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        sides = both(is[i].above_m, is[i].below_m);
        sides.below = is[i].other_kind ? 2 : 1;
        const uint32_t n = probe(&beam, &sides, &counts);
        for (uint32_t k = 0; k < n; k++)
            if (counts[k] != is[i].counts) fail_msg("case %zu: part %u counts: %d", i, k, counts[k]);
    }
}

/* A step in the middle of one part of ten counts there and in its neighbours. */
static void neighbours_of_a_step_count(void **state)
{
    (void)state;
    struct beam beam;
    const uint8_t *counts;
    beam_init(&beam, 0.0, 0.01 * (1.0 + 1e-9), 4e-9);
    for (int at = 0; at < 10; at++) {
        struct sides sides = both(10.0, 20.0);
        sides.from_m = -0.25 + 0.05 * at;
        sides.to_m = sides.from_m + 0.05;
        assert_int_equal(probe(&beam, &sides, &counts), 10);
        for (int k = 0; k < 10; k++)
            assert_int_equal(counts[k], k >= at - 1 && k <= at + 1);
    }
}

/* ---- cells and lines */

/* Triangles whose first edges stand upright at x_m[k], y_m[k]; the rest of each lies far to one side. */
static struct beam_outlines *upright(const double *x_m, const double *y_m, uint32_t n, const struct beam *beam,
                                     const struct beam_probe *how, double range_max_m)
{
    double corner[3 * MOST][3];
    uint32_t triangle[MOST][3];
    struct beam_outlines *outlines;
    struct sh_err err;
    for (uint32_t k = 0; k < n; k++) {
        const double of[3][3] = {
            {x_m[k], y_m[k], -0.2 * y_m[k]}, {x_m[k], y_m[k], 0.2 * y_m[k]}, {x_m[k] + y_m[k], y_m[k], 0.0}};
        memcpy(corner[3 * k], of, sizeof of);
        for (uint32_t i = 0; i < 3; i++)
            triangle[k][i] = 3 * k + i;
    }
    const struct scene_arrays arrays = {
        (const double(*)[3])corner, 3 * n, (const uint32_t(*)[3])triangle, n, NULL, NULL, 0};
    struct scene *scene = made_scene(&arrays);
    const struct beam_outlines_spec spec = {scene, STATION, beam, range_max_m, NULL, NULL};
    if (beam_outlines_create(&spec, how, &outlines, &err) != SH_OK) fail_msg("%s", err.text);
    scene_free(scene);
    return outlines;
}

/* Finds the lines across a footprint straight ahead. Returns -1 where the pulse is not near an outline at all. */
static int lines_ahead(const struct beam_outlines *o, const struct beam *beam, double limit_m, struct beam_sight *sight,
                       struct beam_line line[BEAM_MAX_LINES], double *next_m)
{
    const float x = 0.0F, y = 1.0F, z = 0.0F;
    struct beam_near near;
    *sight = (struct beam_sight){.dir = {0.0, 1.0, 0.0}};
    beam_axes(sight->dir, sight->e1, sight->e2);
    if (beam_near_outlines(o, beam, &(struct vec3_floats){&x, &y, &z}, 1, &near) == 0) return -1;
    assert_int_equal(near.pulse, 0);
    const uint32_t n = beam_find_lines(o, beam, &near, sight, limit_m, line);
    *next_m = near.next_m;
    return (int)n;
}

/* A sub-ray's place in the footprint turns with the range, by atan(slope * range / exit radius). The edge is |x_m| from
 * the axis, which line->h has as a share of the footprint's radius. Directions are floats: 1e-7. */
static void expect_line(const struct beam *beam, const struct beam_sight *sight, const struct beam_line *line,
                        double x_m, double y_m)
{
    const double turned = atan2(beam->slope * y_m, beam->exit_radius_m), sign = x_m < 0.0 ? -1.0 : 1.0;
    const double ex = sign * sight->e1[0], ey = sign * sight->e2[0];
    const double n[2] = {ex * cos(turned) + ey * sin(turned), ey * cos(turned) - ex * sin(turned)};
    assert_true(fabs(line->h - fabs(x_m) / beam_radius(beam, y_m)) < 1e-6);
    if (!(fabs(line->n[0] - n[0]) < 1e-6 && fabs(line->n[1] - n[1]) < 1e-6))
        fail_msg("%g %g instead of %g %g", line->n[0], line->n[1], n[0], n[1]);
}

/* Lines come nearest first. Lines beyond the limit are not given, but next_m says where they begin. */
static void lines_across_a_footprint(void **state)
{
    (void)state;
    static const double x_m[3] = {0.06, -0.03, 0.15}, y_m[3] = {10.0, 6.0, 20.0};
    static const int order[3] = {1, 0, 2};
    struct beam beam;
    struct beam_sight sight;
    struct beam_line line[BEAM_MAX_LINES];
    double next_m;
    beam_init(&beam, 0.02, 0.02, 4e-9);
    struct beam_outlines *o = upright(x_m, y_m, 3, &beam, NULL, 100.0);
    for (int most = 1; most <= 3; most++) {
        const double limit_m = most < 3 ? y_m[order[most - 1]] + 0.1 : 90.0;
        assert_int_equal(lines_ahead(o, &beam, limit_m, &sight, line, &next_m), most);
        for (int k = 0; k < most; k++)
            expect_line(&beam, &sight, &line[k], x_m[order[k]], y_m[order[k]]);
        if (most == 3) break;
        /* next_m is the edge's own distance, but for a share of 1e-5. */
        const double next_edge_m = hypot(x_m[order[most]], y_m[order[most]]);
        assert_true(next_m <= next_edge_m && next_m > next_edge_m * 0.99999);
    }
    assert_true(next_m == (double)INFINITY);
    assert_int_equal(lines_ahead(o, &beam, 5.9, &sight, line, &next_m), 0);
    assert_true(next_m == (double)INFINITY); /* nothing crosses the footprint up to there */
    beam_outlines_free(o);
}

/* Edges at one angle draw one line where the beam has no width at its exit. An edge beside the footprint draws none. */
static void lines_that_do_not_count(void **state)
{
    (void)state;
    static const double x_m[4] = {0.05, 0.1, 0.101, 0.11}, y_m[4] = {10.0, 20.0, 10.0, 10.0};
    struct beam beam;
    struct beam_sight sight;
    struct beam_line line[BEAM_MAX_LINES];
    double next_m;
    beam_init(&beam, 0.0, 0.02, 4e-9);
    struct beam_outlines *o = upright(x_m, y_m, 4, &beam, NULL, 100.0);
    assert_int_equal(lines_ahead(o, &beam, 90.0, &sight, line, &next_m), 1);
    expect_line(&beam, &sight, &line[0], 0.05, 10.0);
    beam_outlines_free(o);
    o = upright(&x_m[3], &y_m[3], 1, &beam, NULL, 100.0);
    assert_true(lines_ahead(o, &beam, 90.0, &sight, line, &next_m) <= 0);
    beam_outlines_free(o);
}

/* There is room for BEAM_MAX_LINES; one more is only counted. */
static void as_many_lines_as_there_is_room_for(void **state)
{
    (void)state;
    double x_m[MOST], y_m[MOST], next_m;
    struct beam beam;
    struct beam_sight sight;
    struct beam_line line[BEAM_MAX_LINES];
    beam_init(&beam, 0.0, 0.02, 4e-9);
    for (int k = 0; k < MOST; k++) {
        y_m[k] = 10.0 + k;
        x_m[k] = y_m[k] * 0.01 * (k - 7.5) / 8.0;
    }
    for (uint32_t n = BEAM_MAX_LINES - 1; n < BEAM_MAX_LINES + 3; n++) {
        struct beam_outlines *o = upright(x_m, y_m, n, &beam, NULL, 100.0);
        const uint32_t want = n < BEAM_MAX_LINES ? n : n == BEAM_MAX_LINES ? n : BEAM_MAX_LINES + 1;
        assert_int_equal(lines_ahead(o, &beam, 90.0, &sight, line, &next_m), want);
        for (uint32_t k = 0; k < n && k < BEAM_MAX_LINES; k++)
            expect_line(&beam, &sight, &line[k], x_m[k], y_m[k]);
        beam_outlines_free(o);
    }
}

/* Edges beyond the range, by more than 1 %, are left out. */
static void edges_out_of_reach(void **state)
{
    (void)state;
    static const double x_m = 0.05, y_m = 10.0;
    struct beam beam;
    struct beam_sight sight;
    struct beam_line line[BEAM_MAX_LINES];
    double next_m;
    beam_init(&beam, 0.0, 0.02, 4e-9);
    for (int far = 0; far < 2; far++) {
        struct beam_outlines *o = upright(&x_m, &y_m, 1, &beam, NULL, far ? 9.8 : 10.0);
        assert_int_equal(lines_ahead(o, &beam, 90.0, &sight, line, &next_m), far ? -1 : 1);
        beam_outlines_free(o);
    }
}

/* An edge goes by from the right, 5 m ahead, to the left, 15 m ahead. It crosses the axis at 10 m. From 9.83 to
 * 10.17 m it is in the footprint of 0.1 m. Up to 9.6 m nothing crosses the footprint, though the edge comes nearer. */
static void an_edge_that_crosses_far_away(void **state)
{
    (void)state;
    static const double corner[3][3] = {{3.0, 5.0, 0.0}, {-3.0, 15.0, 0.0}, {0.0, 10.0, 8.0}};
    static const uint32_t triangle[1][3] = {{0, 1, 2}};
    struct beam beam;
    struct beam_sight sight;
    struct beam_line line[BEAM_MAX_LINES];
    struct beam_outlines *o;
    struct sh_err err;
    double next_m;
    beam_init(&beam, 0.0, 0.02, 4e-9);
    struct scene *scene = made_scene(&(struct scene_arrays){corner, 3, triangle, 1, NULL, NULL, 0});
    const struct beam_outlines_spec spec = {scene, STATION, &beam, 100.0, NULL, NULL};
    assert_int_equal(beam_outlines_create(&spec, NULL, &o, &err), SH_OK);
    scene_free(scene);
    assert_int_equal(lines_ahead(o, &beam, 9.6, &sight, line, &next_m), 0);
    assert_int_equal(lines_ahead(o, &beam, 10.1, &sight, line, &next_m), 1);
    assert_true(line[0].h < 1e-6);
    beam_outlines_free(o);
}

/* An edge with a triangle on each side is no outline, unless one kind of surface ends there. An edge with both
 * triangles on one side is an outline: beyond it something else is seen. Corners at the same place are one. */
static void triangles_on_both_sides(void **state)
{
    (void)state;
    static const uint16_t label[2] = {0, 1}, kinds[2][2] = {{3, 3}, {3, 4}};
    static const struct scene_surface surface[2] = {{.object = "a"}, {.object = "b"}};
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {3, 5, 4}};
    static const struct {
        double third_m[3];
        int kind; /* -1: all surfaces are of one kind */
        int lines;
    } is[] = {{{-10, 10, 0}, -1, -1}, {{-10, 10, 0}, 0, -1}, {{-10, 10, 0}, 1, 1},
              {{10, 12, 0}, -1, 1},   {{10, 12, 0}, 0, 1},   {{10, 12, 0}, 1, 1}};
    struct beam beam;
    struct beam_sight sight;
    struct beam_line line[BEAM_MAX_LINES];
    double next_m;
    beam_init(&beam, 0.0, 0.02, 4e-9);
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        const double *t = is[i].third_m;
        const double corner[6][3] = {{0.05, 10, -2}, {0.05, 10, 2}, {10, 10, 0},
                                     {0.05, 10, -2}, {0.05, 10, 2}, {t[0], t[1], t[2]}};
        struct beam_outlines *o;
        struct sh_err err;
        struct scene *scene = made_scene(&(struct scene_arrays){corner, 6, triangle, 2, label, surface, 2});
        const struct beam_outlines_spec spec = {scene, STATION, &beam, 100.0, is[i].kind < 0 ? NULL : kinds[is[i].kind],
                                                NULL};
        assert_int_equal(beam_outlines_create(&spec, NULL, &o, &err), SH_OK);
        scene_free(scene);
        const int found = lines_ahead(o, &beam, 90.0, &sight, line, &next_m);
        if (found != is[i].lines) fail_msg("case %zu: %d", i, found);
        if (found == 1) expect_line(&beam, &sight, &line[0], 0.05, 10.0);
        beam_outlines_free(o);
    }
}

static void see_a_step_or_none(void *ctx, uint32_t n, const struct vec3_in *dir, double *range_m, uint16_t *kind)
{
    const int *is_step = ctx;
    for (uint32_t i = 0; i < n; i++) {
        range_m[i] = *is_step && i % 2 == 0 ? 15.0 : 10.0;
        (void)dir;
        kind[i] = 0;
    }
}

/* Where rays see a step all along the edges, the outlines are the same as without rays. Where rays see no step, there
 * is no outline. The beam is so wide that a piece of an edge is one part, or so narrow that it has many. */
static void a_step_all_along(void **state)
{
    (void)state;
    static const double x_m = 0.05, y_m = 10.0, widths_rad[2] = {0.2, 0.004};
    uint64_t seed = 20261130;
    for (int w = 0; w < 2; w++) {
        struct beam beam;
        int is_step = 1, found = 0;
        const struct beam_probe how = {see_a_step_or_none, &is_step};
        beam_init(&beam, 0.0, widths_rad[w], 4e-9);
        struct beam_outlines *all = upright(&x_m, &y_m, 1, &beam, NULL, 100.0),
                             *seen = upright(&x_m, &y_m, 1, &beam, &how, 100.0);
        is_step = 0;
        struct beam_outlines *none = upright(&x_m, &y_m, 1, &beam, &how, 100.0);
        for (int i = 0; i < 500; i++) {
            const float x = (float)(x_m / y_m + widths_rad[w] * (case_unit(&seed) - 0.8)),
                        z = (float)(0.5 * case_unit(&seed) - 0.25), y = sqrtf(1.0F - x * x - z * z);
            const struct vec3_floats dir = {&x, &y, &z};
            struct beam_near near;
            const uint32_t want = beam_near_outlines(all, &beam, &dir, 1, &near);
            assert_int_equal(beam_near_outlines(seen, &beam, &dir, 1, &near), want);
            assert_int_equal(beam_near_outlines(none, &beam, &dir, 1, &near), 0);
            found += (int)want;
        }
        if (found < 50 || found > 450) fail_msg("%d of 500 pulses are near an edge", found);
        beam_outlines_free(none);
        beam_outlines_free(seen);
        beam_outlines_free(all);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_part_has_a_ray_on_both_sides),
        cmocka_unit_test(parts_are_hidden_by_their_own_range),
        cmocka_unit_test(what_counts_as_a_step),
        cmocka_unit_test(neighbours_of_a_step_count),
        cmocka_unit_test(lines_across_a_footprint),
        cmocka_unit_test(lines_that_do_not_count),
        cmocka_unit_test(as_many_lines_as_there_is_room_for),
        cmocka_unit_test(an_edge_that_crosses_far_away),
        cmocka_unit_test(triangles_on_both_sides),
        cmocka_unit_test(edges_out_of_reach),
        cmocka_unit_test(a_step_all_along),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
