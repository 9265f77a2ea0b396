/* SPDX-License-Identifier: MIT */
/* Footprints with a detection that changes nothing, and the choice of the echoes that are sent. Neither changes an
 * echo. */
#include "tests/common/generate.h"
#include "core/rng.h"
#include "tests/accuracy/block_copy.h"
#include "tests/accuracy/lit_plates.h"

static void same_block(const struct line_block *b, const struct copy *c)
{
    assert_int_equal(b->n_points, c->n);
    assert_memory_equal(b->echo, c->echo, c->n);
    assert_memory_equal(b->label, c->label, c->n * sizeof *c->label);
    assert_memory_equal(b->dt_ns, c->dt_ns, c->n * sizeof *c->dt_ns);
    assert_memory_equal(b->refl_cdb, c->refl_cdb, c->n * sizeof *c->refl_cdb);
    assert_memory_equal(b->b, c->b, c->n * sizeof *c->b);
    assert_memory_equal(b->c, c->c, c->n * sizeof *c->c);
    assert_memory_equal(b->a, c->a, c->n * sizeof *c->a);
}

/* Bars and wires in a box that is partly out of range. Pulses have no, one and several echoes. */
static struct scene *railing(void)
{
    struct generate_bar bar[48];
    struct scene *scene;
    struct sh_err err;
    uint32_t n = 0;
    for (uint16_t k = 0; k < 48; k++) {
        double x = -4.7 + 0.2 * k, y = 6.0 + 0.3 * (k % 12);
        bar[n++] = (struct generate_bar){
            .a = {x, y, -2.0}, .b = {x + 0.3, y + 1.0, 2.0}, .diameter_m = k % 3 == 0 ? 0.003 : 0.02, .label = 1};
    }
    if (generate_bars(bar, n, 20.0, &scene, &err) != 0) fail_msg("%s", err.text);
    return scene;
}

/* With a detection that changes nothing, the beam's blocks are the same, entry by entry: noise, numbers, order. */
static void nothing_asked_for_changes_nothing(void **state)
{
    (void)state;
    const struct beam_view view = {-20.0, 20.0, -45.0, 45.0, 12, 3000};
    const struct cast_detect nothing = {.max_echoes = LINE_MAX_ECHOES};
    static const enum beam_mode modes[] = {BEAM_ADAPTIVE, BEAM_RINGS, BEAM_RINGS};
    struct pose_knot knots[2] = {{.t_ns = 0, .pose = {.quat = {1.0, 0.0, 0.0, 0.0}}},
                                 {.t_ns = 120000000,
                                  .pose = {.position_m = {0.003, 0.004, 0.002},
                                           .quat = {cos(0.1), 0.0, 0.0, sin(0.1)}}}}; /* the last mode's head moves */
    uint64_t several = 0, none = 0;
    struct beam_rig rig;
    made_beam_rig(&rig, railing(), &view);
    rig.setup.range_max_m = 22.0;
    rig.setup.noise_on = 1;
    rig.setup.range_sigma_m = 0.003;
    rig.setup.range_sigma_ppm = 10.0;
    rig.setup.noise_key = rng_key(7, RNG_RANGE);
    rig.setup.knot = knots;
    for (int m = 0; m < 3; m++)
        for (int geo = 0; geo < 2; geo++)
            for (int select = BEAM_ALL; select <= BEAM_STRONGEST; select++) {
                beam_rig_mode(&rig, modes[m], 3);
                rig.setup.n_knots = m == 2 ? 2 : 0;
                rig.setup.layout = geo ? LINE_GEO : LINE_POLAR;
                rig.setup.echoes = (enum beam_select)select;
                for (uint32_t l = 0; l < view.lines; l += 3) {
                    struct copy own;
                    rig.setup.detect = NULL;
                    uint32_t echoes = beam_rig_line(&rig, l);
                    copy_block(&rig.block, &own);
                    rig.setup.detect = &nothing;
                    assert_int_equal(beam_rig_line(&rig, l), echoes);
                    same_block(&rig.block, &own);
                    for (uint32_t i = 0; i < own.n; i++) {
                        several += own.echo[i] >> 4 > 1;
                        none += own.echo[i] == 0;
                    }
                    free_copy(&own);
                }
            }
    assert_true(several > 1000 && none > 1000);
    beam_rig_close(&rig);
}

/* The noise of an echo is its own, whichever of the pulse's echoes are sent. So the first and the last echo are as they
 * are among all. */
static void selection_keeps_the_noise(void **state)
{
    (void)state;
    const struct beam_view view = {-20.0, 20.0, -45.0, 45.0, 4, 3000};
    uint64_t several = 0;
    struct beam_rig rig;
    made_beam_rig(&rig, railing(), &view);
    rig.setup.noise_on = 1;
    rig.setup.range_sigma_m = 0.003;
    rig.setup.noise_key = rng_key(7, RNG_RANGE);
    beam_rig_mode(&rig, BEAM_ADAPTIVE, 3);
    for (uint32_t l = 0; l < view.lines; l++) {
        struct copy all;
        rig.setup.echoes = BEAM_ALL;
        beam_rig_line(&rig, l);
        copy_block(&rig.block, &all);
        for (int select = BEAM_FIRST; select <= BEAM_LAST; select++) {
            rig.setup.echoes = (enum beam_select)select;
            beam_rig_line(&rig, l);
            assert_int_equal(rig.block.n_points, view.pulses);
            for (uint32_t p = 0, i = 0; p < view.pulses; p++) {
                uint32_t n = all.echo[i] == 0 ? 1 : all.echo[i] >> 4;
                assert_int_equal(rig.block.a[p], all.a[select == BEAM_FIRST ? i : i + n - 1]);
                several += n > 1;
                i += n;
            }
        }
        free_copy(&all);
    }
    assert_true(several > 100);
    beam_rig_close(&rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(nothing_asked_for_changes_nothing),
        cmocka_unit_test(selection_keeps_the_noise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
