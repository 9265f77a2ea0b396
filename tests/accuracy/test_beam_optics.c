/* SPDX-License-Identifier: MIT */
/* Footprints on glass, on mirrors, and on surfaces that mix within one plane, against values worked out by hand. */
#include "tests/accuracy/lit_plates.h"

/* A pane with a free border is on the left, and a wall lies behind all of it. A part of the wall's echo has passed the
 * pane there and back. The number of echoes is the same without a signal (m >= 2). */
static void a_footprint_on_the_border_of_glass(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 23.0, .rho = {0.1, 0.5}};
    static const enum beam_mode modes[] = {BEAM_ADAPTIVE, BEAM_RINGS};
    open_lit(&l, plates(l.near_m, l.far_m, 1), &ACROSS, 0.0);
    l.table.surface[FRONT].glass = 0.8;
    l.table.has_optics = 1;
    l.detect.depth = 2;
    for (int m = 0; m < 4; m++) {
        uint32_t several = 0, pure = 0;
        l.detect.signal = m < 2 ? &l.signal : NULL;
        beam_rig_mode(&l.rig, modes[m % 2], BEAM_MAX_RINGS);
        for (uint32_t line = 0; line < ACROSS.lines; line++) {
            const struct line_block *b = lit_line(&l, line);
            for (uint32_t p = 0, i = 0; p < ACROSS.pulses; p++) {
                struct edge e = at_edge(&l, l.d[0][p], l.d[1][p]);
                uint32_t n = b->echo[i] >> 4, first = i;
                i += n;
                if (fabs(e.front - 0.01) > 0.002) assert_int_equal(n, e.front > 0.01 ? 2 : 1);
                assert_int_equal(b->label[i - 1], BACK);
                double wall = (1.0 - e.front + 0.64 * e.front) * 0.5 * l.d[1][p];
                several += n == 2;
                pure += e.front > 0.999;
                if (m >= 2) continue;
                near_energy(linear(b, i - 1), wall, 0.5, RINGS_OFF);
                if (n == 2) near_energy(linear(b, first), e.back[FRONT], 0.1, RINGS_OFF);
            }
        }
        assert_true(several > 100 && pure > 100);
    }
    close_lit(&l);
}

/* Outlines where one kind of surface ends. */
static void outline_kinds(struct lit *l)
{
    uint16_t kind[2];
    struct sh_err err;
    const struct beam_outlines_spec spec = {l->rig.scene, STATION, &l->rig.beam.beam, l->rig.setup.range_max_m,
                                            kind,         NULL};
    beam_outlines_free(l->rig.outlines);
    if (surface_kinds(&l->table, kind, &err) != 0 || cast_outlines(&spec, l->rig.bvh, &l->rig.outlines, &err) != 0)
        fail_msg("%s", err.text);
    l->rig.beam.outlines = l->rig.outlines;
}

/* Two surfaces in one plane, with corners in common (a part of a wall) or without (a foil on it). A footprint on both
 * returns the sum, with the label of the brighter one. Surfaces without a difference have no outline. */
static void surfaces_mix_within_a_plane(void **state)
{
    (void)state;
    static const double gap_m[] = {0.0, 1e-7};
    for (int free_edge = 0; free_edge < 2; free_edge++)
        for (int same = 0; same < 2; same++) {
            struct lit l = {.near_m = 20.0, .far_m = 20.0 + gap_m[free_edge], .rho = {0.1, same ? 0.1 : 0.8}};
            struct cast_counters counters;
            uint32_t mixed = 0;
            open_lit(&l, plates(l.near_m, l.far_m, 0), &ACROSS, 0.0);
            outline_kinds(&l);
            beam_rig_mode(&l.rig, BEAM_ADAPTIVE, 4);
            for (uint32_t line = 0; line < ACROSS.lines; line++) {
                const struct line_block *b = lit_line(&l, line);
                assert_int_equal(b->n_points, ACROSS.pulses);
                for (uint32_t p = 0; p < ACROSS.pulses; p++) {
                    struct edge e = at_edge(&l, l.d[0][p], l.d[1][p]);
                    near_energy(linear(b, p), e.back[FRONT] + e.back[BACK], 0.8, PARTS_OFF);
                    mixed += e.front > 0.05 && e.front < 0.95;
                }
            }
            caster_get_counters(l.rig.caster, &counters);
            assert_true(mixed > 100);
            assert_true(same ? counters.outlined == 0 : counters.outlined > 100);
            close_lit(&l);
        }
}

/* This is the same with a mirror in place of the pane. It shows the wall that is 12 m behind the head as a ghost, at
 * 40 m + 12 m. */
static struct scene *mirror_and_two_walls(void)
{
    double vertex[12][3];
    uint32_t triangle[6][3];
    static const uint16_t label[6] = {FRONT, FRONT, BACK, BACK, BACK, BACK};
    static const struct scene_surface surface[2] = {{.object = "front"}, {.object = "back"}};
    static const double y[] = {20.0, 23.0, -12.0};
    for (int v = 0; v < 12; v++) {
        int right = v % 4 == 1 || v % 4 == 2;
        vertex[v][0] = right ? (v < 4 ? 0.0 : 5.0) : -5.0;
        vertex[v][1] = y[v / 4];
        vertex[v][2] = v % 4 >= 2 ? 5.0 : -5.0;
    }
    for (uint32_t t = 0; t < 6; t++)
        for (uint32_t v = 0; v < 3; v++)
            triangle[t][v] = t / 2 * 4 + (v == 0 ? 0 : v + t % 2);
    return made_scene(
        &(struct scene_arrays){(const double(*)[3])vertex, 12, (const uint32_t(*)[3])triangle, 6, label, surface, 2});
}

/* All light of a footprint that lies on surfaces comes back. Pulse 0 of line 30 goes along an axis of the scene, to the
 * digit. Some of its sub-rays have a component of about -1e-22, which must not harm those that are packed with them
 * (embree_direction in core/embree.h). */
static void no_light_is_lost(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 23.0, .rho = {0.5, 0.5}};
    open_lit(&l, mirror_and_two_walls(), &ACROSS, 0.0);
    beam_rig_mode(&l.rig, BEAM_RINGS, BEAM_MAX_RINGS);
    for (uint32_t line = 0; line < ACROSS.lines; line++) {
        const struct line_block *b = &l.rig.block;
        beam_rig_line(&l.rig, line);
        for (uint32_t p = 0, i = 0; p < ACROSS.pulses; p++) {
            double sum = 0.0;
            for (uint32_t end = i + (b->echo[i] >> 4); i < end; i++)
                sum += linear(b, i);
            assert_true(fabs(sum - 0.5) < 0.01 * 0.5); /* 1 %: returns that are too weak for an echo */
        }
    }
    close_lit(&l);
}

static void a_footprint_on_the_border_of_a_mirror(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 23.0, .rho = {0.0, 0.5}};
    uint32_t several = 0, pure = 0;
    open_lit(&l, mirror_and_two_walls(), &ACROSS, 0.0);
    l.table.surface[FRONT].mirror = 0.8;
    l.table.has_optics = 1;
    l.detect.depth = 2;
    beam_rig_mode(&l.rig, BEAM_ADAPTIVE, BEAM_MAX_RINGS);
    for (uint32_t line = 0; line < ACROSS.lines; line++) {
        const struct line_block *b = lit_line(&l, line);
        for (uint32_t p = 0, i = 0; p < ACROSS.pulses; p++) {
            struct edge e = at_edge(&l, l.d[0][p], l.d[1][p]);
            uint32_t n = b->echo[i] >> 4;
            for (uint32_t end = i + n; i < end; i++) {
                int ghost = b->label[i] == 2 + BACK;
                assert_true(ghost || b->label[i] == BACK);
                near_energy(linear(b, i), ghost ? 0.64 * e.front * 0.5 * l.d[1][p] : e.back[BACK], 0.5, RINGS_OFF);
                assert_true(fabs(1e-6 * b->a[i] - (ghost ? 52.0 : 23.0) / l.d[1][p]) < 5e-4);
            }
            several += n == 2;
            pure += n == 1 && b->label[i - 1] == 2 + BACK;
        }
    }
    assert_true(several > 100 && pure > 100);
    close_lit(&l);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_footprint_on_the_border_of_glass),
        cmocka_unit_test(surfaces_mix_within_a_plane),
        cmocka_unit_test(no_light_is_lost),
        cmocka_unit_test(a_footprint_on_the_border_of_a_mirror),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
