/* SPDX-License-Identifier: MIT */
/* Pulses near outlines, by geometry alone. A pulse whose footprint reaches an edge is found, in any direction, and
 * among any other pulses. */
#include "tests/common/thorough.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/footprint.h"
#include "tests/common/beam_reference.h"
#include "tests/common/made.h"

static const double STATION[3] = {0.0, 0.0, 0.0};

/* A triangle whose edge 0 - 1 is tested. All three are outlines. */
static struct beam_outlines *outlines_of(const double corner[3][3], const struct beam *beam)
{
    static const uint32_t triangle[1][3] = {{0, 1, 2}};
    struct beam_outlines *outlines;
    struct sh_err err;
    const struct scene_arrays arrays = {corner, 3, triangle, 1, NULL, NULL, 0};
    struct scene *scene = made_scene(&arrays);
    const struct beam_outlines_spec spec = {scene, STATION, beam, 1000.0, NULL, NULL};
    if (beam_outlines_create(&spec, NULL, &outlines, &err) != SH_OK) fail_msg("%s", err.text);
    scene_free(scene);
    return outlines;
}

struct pulses {
    uint32_t n;
    float x[BEAM_NEAR_MOST], y[BEAM_NEAR_MOST], z[BEAM_NEAR_MOST];
};

static void add(struct pulses *p, const double d[3])
{
    const double length = vec3_length(d);
    assert_true(p->n < BEAM_NEAR_MOST);
    p->x[p->n] = (float)(d[0] / length);
    p->y[p->n] = (float)(d[1] / length);
    p->z[p->n++] = (float)(d[2] / length);
}

/* found[i]: whether pulse i is near to an outline. */
static void look_up(const struct beam_outlines *o, const struct beam *beam, const struct pulses *p, uint8_t *found)
{
    static struct beam_near near[BEAM_NEAR_MOST];
    const uint32_t n = beam_near_outlines(o, beam, &(struct vec3_floats){p->x, p->y, p->z}, p->n, near);
    memset(found, 0, p->n);
    for (uint32_t i = 0; i < n; i++)
        found[near[i].pulse] = 1;
}

/* Aims towards a point of a - b, and beside it by an angle across the edge. */
static void beside(const double a[3], const double b[3], double at, double angle_rad, double d[3])
{
    double p[3], across[3];
    for (int k = 0; k < 3; k++)
        p[k] = a[k] + at * (b[k] - a[k]);
    vec3_cross(a, b, across);
    const double range_m = vec3_length(p), length = vec3_length(across);
    for (int k = 0; k < 3; k++)
        d[k] = p[k] / range_m + tan(angle_rad) * across[k] / length;
}

/* Makes an edge of 2 m at 10 m from the station, around a direction and at an angle to it. The third corner is 2 m
 * aside. */
static void make_edge(const double around[3], double turn_rad, double corner[3][3])
{
    double e1[3], e2[3], dir[3];
    for (int k = 0; k < 3; k++)
        dir[k] = around[k] / vec3_length(around);
    beam_axes(dir, e1, e2);
    for (int k = 0; k < 3; k++) {
        const double along = cos(turn_rad) * e1[k] + sin(turn_rad) * e2[k];
        const double across = cos(turn_rad) * e2[k] - sin(turn_rad) * e1[k];
        corner[0][k] = 10.0 * dir[k] - along;
        corner[1][k] = 10.0 * dir[k] + along;
        corner[2][k] = 10.0 * dir[k] + 2.0 * across;
    }
}

/* Directions go to corners, edges and middles of a cube: where its faces meet, and where cells are the most oblique.
 * The beam has a half-width of 10 mrad, many cells. Pulses pass the edge at 0.99 of that, so their footprints surely
 * reach it: rounding to floats changes directions only by 1e-7. */
static void edges_are_found_in_any_direction(void **state)
{
    (void)state;
    static uint8_t found[BEAM_NEAR_MOST];
    static struct pulses pulses;
    struct beam beam;
    uint64_t x = 20261128;
    beam_init(&beam, 0.0, 0.02, 4e-9);
    for (int where = 0; where < 26; where++) {
        const int w = where < 13 ? where : where + 1; /* 13 is (0, 0, 0) */
        const double around[3] = {w % 3 - 1, w / 3 % 3 - 1, w / 9 - 1};
        for (int turn = 0; turn < fewer(8); turn++) {
            double corner[3][3], d[3];
            make_edge(around, turn * M_PI / 8 + 0.1, corner);
            struct beam_outlines *outlines = outlines_of((const double(*)[3])corner, &beam);
            pulses.n = 0;
            while (pulses.n < BEAM_NEAR_MOST) {
                const double part = case_unit(&x), side = case_unit(&x) < 0.5 ? -0.0099 : 0.0099;
                beside(corner[0], corner[1], part, side, d);
                add(&pulses, d);
            }
            look_up(outlines, &beam, &pulses, found);
            for (uint32_t i = 0; i < pulses.n; i++)
                if (!found[i]) fail_msg("around %g %g %g: pulse %u is lost", around[0], around[1], around[2], i);
            beam_outlines_free(outlines);
        }
    }
}

/* Pulses go in steps towards an edge and over it. In groups of any size, each that reaches it is found. */
static void groups_are_looked_up_to_their_ends(void **state)
{
    (void)state;
    static uint8_t found[BEAM_NEAR_MOST];
    static struct pulses pulses;
    static const double steps_rad[] = {1e-4, 3e-4, 4.9e-4, 6e-4, 1e-3, 1.9e-3, 3.9e-3, 5e-3};
    double corner[3][3], d[3];
    struct beam beam;
    uint32_t reached = 0;
    beam_init(&beam, 0.0, 0.0004, 4e-9);
    make_edge((const double[3]){0.3, 1.0, 0.2}, 0.3, corner);
    struct beam_outlines *outlines = outlines_of((const double(*)[3])corner, &beam);
    for (size_t s = 0; s < sizeof steps_rad / sizeof steps_rad[0]; s++)
        for (uint32_t n = 1; n < 60; n++)
            for (uint32_t over = 0; over < n; over++) { /* this pulse meets the edge, later ones are beyond it */
                pulses.n = 0;
                for (uint32_t i = 0; i < n; i++) {
                    beside(corner[0], corner[1], 0.5, ((double)i - over) * steps_rad[s], d);
                    add(&pulses, d);
                }
                look_up(outlines, &beam, &pulses, found);
                if (!found[over]) fail_msg("steps of %g rad: pulse %u of %u is lost", steps_rad[s], over, n);
                reached++;
            }
    assert_int_equal(reached, 8 * 59 * 60 / 2);
    beam_outlines_free(outlines);
}

/* A mirror turns back, or a pan has gone on: one step is larger than all others, and leads to the edge. */
static void a_step_may_lead_to_an_edge(void **state)
{
    (void)state;
    static uint8_t found[BEAM_NEAR_MOST];
    static struct pulses pulses;
    double corner[3][3], d[3];
    struct beam beam;
    beam_init(&beam, 0.0, 0.0004, 4e-9);
    make_edge((const double[3]){0.3, 1.0, 0.2}, 0.3, corner);
    struct beam_outlines *outlines = outlines_of((const double(*)[3])corner, &beam);
    for (uint32_t n = 1; n < 60; n++)
        for (uint32_t leap = 0; leap < n; leap++) { /* pulses from this one on are at the edge */
            pulses.n = 0;
            for (uint32_t i = 0; i < n; i++) {
                beside(corner[0], corner[1], 0.4 + 1e-3 * i, i < leap ? 0.03 : 0.0, d);
                add(&pulses, d);
            }
            look_up(outlines, &beam, &pulses, found);
            for (uint32_t i = 0; i < n; i++)
                if (found[i] != (i >= leap)) fail_msg("pulse %u of %u, edge from %u on: %d", i, n, leap, found[i]);
        }
    beam_outlines_free(outlines);
}

/* Two lines through the middle that take a half each leave nothing: the disc's centre is in no part. */
static void halves_leave_no_centre(void **state)
{
    (void)state;
    static const struct beam_line line[2] = {{.n = {0.6, 0.8}}, {.n = {-0.6, -0.8}}};
    struct beam_parts parts = {.centre = 0};
    struct beam_pattern fine;
    struct beam beam;
    beam_init(&beam, 0.0, 0.0004, 4e-9);
    beam_rings(BEAM_FINE_RINGS, &fine);
    assert_int_equal(beam_cut(&beam, &fine, line, 2, 0, &parts), 0);
    assert_true(parts.n == 2 && parts.centre >= parts.n);
    for (int i = 0; i < 2; i++) {
        assert_true(fabs(parts.part[i].energy - 0.5) < 1e-9);
        assert_true(parts.part[i].x * line[i].n[0] > 0.0 && parts.part[i].y * line[i].n[1] > 0.0);
    }
    assert_int_equal(beam_cut(&beam, &fine, line, 1, 0, &parts), 0);
    assert_true(parts.n == 2 && parts.centre == 1 && parts.part[1].x < 0.0);
}

/* A plate ends at x = 0, 10 m ahead, and the sky is beside it. The part with the centre needs no ray of its own, on
 * the plate as in the sky: an outlined pulse costs one sub-ray, for its other part. */
static void the_centres_part_needs_no_ray(void **state)
{
    (void)state;
    static const double corner_m[4][3] = {{0, 10, -5}, {5, 10, -5}, {5, 10, 5}, {0, 10, 5}};
    static const uint32_t triangle[2][3] = {{0, 1, 2}, {0, 2, 3}};
    for (int side = -1; side <= 1; side += 2) { /* 0.5 to 2 mm from the edge, in a footprint of 7.8 mm */
        const double from_deg = side < 0 ? -0.0115 : 0.003;
        const struct beam_view view = {-0.02, 0.02, from_deg, from_deg + 0.0085, 4, 64};
        struct beam_rig rig;
        struct cast_counters counters;
        uint32_t echoes = 0;
        made_beam_rig(&rig, made_scene(&(struct scene_arrays){corner_m, 4, triangle, 2, NULL, NULL, 0}), &view);
        beam_rig_mode(&rig, BEAM_ADAPTIVE, 4);
        for (uint32_t l = 0; l < view.lines; l++)
            echoes += beam_rig_line(&rig, l);
        caster_get_counters(rig.caster, &counters);
        assert_int_equal(counters.outlined, view.lines * view.pulses);
        assert_int_equal(counters.sub_rays, counters.outlined);
        assert_int_equal(echoes, counters.outlined);
        beam_rig_close(&rig);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(edges_are_found_in_any_direction), cmocka_unit_test(groups_are_looked_up_to_their_ends),
        cmocka_unit_test(a_step_may_lead_to_an_edge),       cmocka_unit_test(halves_leave_no_centre),
        cmocka_unit_test(the_centres_part_needs_no_ray),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
