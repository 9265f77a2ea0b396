/* SPDX-License-Identifier: MIT */
/* Widths of echoes against the spread of many sub-rays, worked out from the definition in core/footprint.h. */
#include "tests/accuracy/slanted.h"
#include "tests/common/thorough.h"

/* The closed form has one ray for the footprint. The sub-rays of rings have spreads of their own, so few of them are
 * enough. */
static void a_slanted_wall_widens_the_echo(void **state)
{
    (void)state;
    static const double ranges_m[] = {10.0, 100.0, 800.0}, slants_deg[] = {0.0, 30.0, 60.0, 80.0, 85.0, 89.0, 89.8};
    static const uint32_t rings[] = {0, 0, 1, 4, BEAM_MAX_RINGS};
    double worst = 0.0;
    for (int r = 0; r < 3; r++)
        for (int k = 0; k < 7; k++) {
            struct beam_rig rig;
            struct face face;
            double i = slants_deg[k] * M_PI / 180.0, half = 0.3 * ranges_m[r], mean, variance, d[3][4];
            struct scene *scene =
                slanted(ranges_m[r], i, 0.7, (const double[]){-half, half}, (const double[]){-half, half}, &face);
            open_attributes(&rig, scene, &AHEAD, 0.2e-9);
            for (int m = 0; m < 5; m++) {
                beam_rig_mode(&rig, m == 0 ? BEAM_ADAPTIVE : BEAM_RINGS, rings[m]);
                beam_rig_line(&rig, 1);
                beam_rig_directions(&rig, 1, d[0], d[1], d[2]);
                /* at 89.8 degrees and 10 m the returns of rings lie apart, and are several echoes */
                if (m > 0 && 2.0 * beam_radius(&rig.beam.beam, ranges_m[r]) * tan(i) > 0.03) continue;
                const double dir[3] = {d[0][0], d[1][0], d[2][0]};
                spread(&rig.beam.beam, dir, &face, &mean, &variance);
                double want = width_of(rig.beam.beam.resolution_m, variance);
                check_width(rig.block.width_cns[0], want < 65535.0 ? want : 65535.0, rig.beam.beam.slope * tan(i), 0.0);
                assert_int_equal(rig.block.echo[0], 0x11);
                assert_int_equal(rig.block.amplitude_cdb[0], LINE_AMPLITUDE_NONE);
                worst = fmax(worst, excess(rig.block.width_cns[0], want < 65535.0 ? want : 65535.0));
            }
            beam_rig_close(&rig);
        }
    print_message("# slanted walls, 10 to 800 m, 0 to 89.8 degrees: widths within %.2f %% and half of 0.01 ns\n",
                  1e2 * worst);
}

/* An edge, or a corner, cuts the footprint. The echo is of the rest, and as wide as that. */
static void a_part_has_its_own_width(void **state)
{
    (void)state;
    static const double slants_deg[] = {0.0, 60.0, 80.0}, abouts[] = {0.0, 0.5, 1.2};
    const int step = thorough(1, 2);
    double worst = 0.0;
    uint32_t cut = 0;
    for (int s = 0; s < 3; s++)
        for (int a = 0; a < 3; a++)
            for (int k = (s + a) % step; k < 24; k += step) {
                struct beam_rig rig;
                struct face face;
                const double range_m = 100.0, i = slants_deg[s] * M_PI / 180.0, w = 0.0178;
                /* edges at all places of the footprint: one, or for k >= 12 two that meet in it */
                double u = (k % 12 - 5.7) / 6.5 * w, v = k < 12 ? -9.0 : 0.4 * w / cos(i) * sin(k);
                struct scene *scene =
                    slanted(range_m, i, abouts[a], (const double[]){u, 9.0}, (const double[]){v, 9.0}, &face);
                double mean, variance, d[3][4];
                const double across[3] = {sin(abouts[a]), 0.0, cos(abouts[a])};
                const double up[3] = {cos(abouts[a]) * cos(i), sin(i), -sin(abouts[a]) * cos(i)};
                face.n_cuts = 2;
                for (int x = 0; x < 3; x++) {
                    face.cut[0][x] = across[x];
                    face.cut[1][x] = up[x];
                }
                face.cut[0][3] = u;
                face.cut[1][3] = v + up[1] * range_m;
                open_attributes(&rig, scene, &AHEAD, 0.2e-9);
                beam_rig_mode(&rig, BEAM_ADAPTIVE, 4);
                beam_rig_line(&rig, 1);
                beam_rig_directions(&rig, 1, d[0], d[1], d[2]);
                const double dir[3] = {d[0][0], d[1][0], d[2][0]};
                double share = spread(&rig.beam.beam, dir, &face, &mean, &variance);
                if (share > 0.015) {
                    double want = width_of(rig.beam.beam.resolution_m, variance);
                    assert_int_equal(rig.block.echo[0], 0x11);
                    /* Where lines cross, 469 places stand for the disc. An edge along a part of n places may count half
                     * a row on the wrong side, and a row has about sqrt(n). */
                    check_width(rig.block.width_cns[0], want, 0.0, k < 12 ? 0.003 : 0.4 / sqrt(469.0 * share));
                    worst = fmax(worst, excess(rig.block.width_cns[0], want));
                    cut += share < 0.985;
                }
                beam_rig_close(&rig);
            }
    assert_true(cut > 100 / (uint32_t)step);
    print_message("# parts of footprints on slanted walls: widths within %.2f %% and half of 0.01 ns\n", 1e2 * worst);
}

/* Two plates closer than the pulse: shares e and 1 - e at 0.3 m are one echo, wider by e (1 - e) 0.3^2. With a signal
 * they are shares of the power received, which falls with the square of the range. */
static void a_mixed_pixel_is_wide(void **state)
{
    (void)state;
    struct lit l = {.near_m = 20.0, .far_m = 20.3, .rho = {0.5, 0.5}};
    uint32_t mixed = 0;
    double d[3][16];
    struct sh_err err;
    open_lit(&l, plates(l.near_m, l.far_m, 1), &ACROSS, 0.0);
    l.rig.setup.pulse_m = l.rig.beam.beam.resolution_m;
    if (line_block_alloc_attributes(&l.rig.block, &err) != 0) fail_msg("%s", err.text);
    for (int detect = 0; detect < 2; detect++) {
        if (!detect) l.rig.setup.detect = NULL;
        if (detect) l.rig.setup.detect = &l.detect;
        beam_rig_mode(&l.rig, BEAM_ADAPTIVE, 4);
        for (uint32_t line = 0; line < ACROSS.lines; line++) {
            beam_rig_directions(&l.rig, line, d[0], d[1], d[2]);
            beam_rig_line(&l.rig, line);
            for (uint32_t p = 0; p < ACROSS.pulses; p++) {
                double e = at_edge(&l, d[0][p], d[1][p]).front;
                /* shares are off by a part in 1,000 of the footprint */
                double slack = FULL2 * 0.09 * 1.5e-3 / (2.0 * 0.36);
                if (e < 0.001 || e > 0.999) e = 1.0;
                if (detect) e = e / (e + (1.0 - e) * (l.near_m * l.near_m) / (l.far_m * l.far_m));
                check_width(l.rig.block.width_cns[p], width_of(l.rig.setup.pulse_m, e * (1.0 - e) * 0.09), 0.0, slack);
                mixed += e > 0.05 && e < 0.95;
            }
        }
    }
    assert_true(mixed > 200);
    close_lit(&l);
}

/* A pane 0.2 m in front of a wall gives one echo, with the width of two returns. At 2 m there are two echoes, each a
 * pulse wide. */
static void glass_and_what_is_behind(void **state)
{
    (void)state;
    static const double apart_m[] = {0.2, 2.0};
    for (int k = 0; k < 2; k++)
        for (int mode = 0; mode < 2; mode++) {
            struct lit l = {.near_m = 20.0, .far_m = 20.0 + apart_m[k], .rho = {0.2, 0.5}};
            struct sh_err err;
            double d[3][16], pulse = CNS_PER_M * 0.5 * 299792458.0 * 4e-9;
            open_lit(&l, plates(l.near_m, l.far_m, 1), &(const struct beam_view){0.0, 0.01, -0.5, -0.4, 2, 16}, 1e-9);
            if (line_block_alloc_attributes(&l.rig.block, &err) != 0) fail_msg("%s", err.text);
            l.table.surface[FRONT].glass = 0.7;
            l.table.has_optics = 1;
            l.detect.depth = 1;
            l.rig.setup.pulse_m = l.detect.separation_m = l.rig.beam.beam.resolution_m;
            beam_rig_mode(&l.rig, mode ? BEAM_ADAPTIVE : BEAM_SINGLE, 4);
            beam_rig_line(&l.rig, 0);
            beam_rig_directions(&l.rig, 0, d[0], d[1], d[2]);
            const struct line_block *b = &l.rig.block;
            double near = 0.2 * d[1][0], far = 0.5 * d[1][0] * 0.7 * 0.7, sum = near + far;
            double want = width_of(l.rig.setup.pulse_m, near * far / (sum * sum) * 0.04);
            if (k == 0) {
                assert_int_equal(b->echo[0], 0x11);
                check_width(b->width_cns[0], want, 0.0, 1e-3);
            } else {
                assert_int_equal(b->echo[0], 0x21);
                for (int e = 0; e < 2; e++)
                    check_width(b->width_cns[e], pulse, 0.0, 1e-3);
                double by_db = 10.0 * log10(near / far) + 20.0 * log10(22.0 / 20.0);
                assert_true(fabs(b->amplitude_cdb[0] - b->amplitude_cdb[1] - 100.0 * by_db) < 2.0);
            }
            close_lit(&l);
        }
}

/* Behind a pane, and on a body that moves, only the incidence of a sub-ray is known. A slanted wall's echo is
 * as wide there as in the open. */
static void slanted_behind_glass_and_in_motion(void **state)
{
    (void)state;
    const double range_m = 100.0, slant = 75.0 * M_PI / 180.0;
    for (int moving = 0; moving < 2; moving++) {
        struct lit l = {.near_m = 20.0, .far_m = 20.0, .rho = {0.2, 0.5}};
        struct face face;
        struct sh_err err;
        double d[3][4], mean, variance;
        struct scene *wall =
            slanted(range_m, slant, 0.7, (const double[]){-9.0, 9.0}, (const double[]){-9.0, 9.0}, &face);
        double vertex[8][3];
        static const uint32_t triangle[4][3] = {{0, 1, 2}, {0, 2, 3}, {4, 5, 6}, {4, 6, 7}};
        static const uint16_t label[4] = {BACK, BACK, FRONT, FRONT};
        static const struct scene_surface surface[2] = {{.object = "pane"}, {.object = "wall"}};
        for (int v = 0; v < 8; v++) { /* the pane beside the beam, or in it */
            double side = v % 4 == 1 || v % 4 == 2 ? 1.0 : -1.0, up = v % 4 >= 2 ? 1.0 : -1.0;
            const double pane[3] = {side + (moving ? 8.0 : 0.0), 20.0, up};
            memcpy(vertex[v], v < 4 ? wall->vertex_m[v] : pane, sizeof vertex[v]);
        }
        struct bvh *body = moving ? made_bvh(wall) : NULL;
        struct scene *both =
            made_scene(&(struct scene_arrays){(const double(*)[3])vertex + (moving ? 4 : 0), moving ? 4 : 8, triangle,
                                              moving ? 2 : 4, moving ? label + 2 : label, surface, 2});
        open_lit(&l, both, &AHEAD, 1e-9);
        beam_init(&l.rig.beam.beam, 0.007, 0.35e-3, 0.4e-9);
        if (line_block_alloc_attributes(&l.rig.block, &err) != 0) fail_msg("%s", err.text);
        l.table.surface[FRONT].glass = 0.7;
        l.table.has_optics = 1;
        l.detect.depth = moving ? 0 : 1;
        l.rig.setup.pulse_m = l.detect.separation_m = l.rig.beam.beam.resolution_m;
        if (moving) {
            struct cast_mover *m = &l.rig.setup.mover[0];
            *m = (struct cast_mover){.bvh = body, .centre_m = {0.0, range_m, 0.0}, .radius_m = 20.0};
            pose_heading(0.0, m->rotation);
            l.rig.setup.n_movers = 1;
        }
        beam_rig_mode(&l.rig, moving ? BEAM_RINGS : BEAM_ADAPTIVE, 4);
        beam_rig_line(&l.rig, 1);
        beam_rig_directions(&l.rig, 1, d[0], d[1], d[2]);
        const double dir[3] = {d[0][0], d[1][0], d[2][0]};
        spread(&l.rig.beam.beam, dir, &face, &mean, &variance);
        double want = width_of(l.rig.setup.pulse_m, variance);
        assert_int_equal(l.rig.block.echo[0], moving ? 0x11 : 0x21);
        assert_true(want > 1.4 * width_of(l.rig.setup.pulse_m, 0.0));
        /* with 61 sub-rays that lie the same all around */
        check_width(l.rig.block.width_cns[moving ? 0 : 1], want, 0.0, 1e-3);
        close_lit(&l);
        bvh_free(body);
        scene_free(wall);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_slanted_wall_widens_the_echo),
        cmocka_unit_test(a_part_has_its_own_width),
        cmocka_unit_test(a_mixed_pixel_is_wide),
        cmocka_unit_test(glass_and_what_is_behind),
        cmocka_unit_test(slanted_behind_glass_and_in_motion),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
