/* SPDX-License-Identifier: MIT */
/* The settings that a replay reports for its head follow from the recording. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <cmocka.h>

#include "firmware_sim/replay/replay_state.h"

/* A sphere's step is the turn divided by its steps. A firing sequence lasts num / den ns. An anchor gives the
 * station. */
static void test_settings(void **state)
{
    struct replay *r = calloc(1, sizeof *r);
    const struct native_emitter sphere = {
        .kind = NATIVE_EMIT_SPHERE, .steps = 720, .turn = 1, .echoes = NATIVE_ECHOES_LAST};
    const struct native_emitter beams = {
        .kind = NATIVE_EMIT_BEAMS, .turn = 1, .n_beams = 16, .sequence_ns_num = 55296, .sequence_ns_den = 1};
    const struct native_anchor anchor = {.station = 3};
    (void)state;
    assert_non_null(r);
    replay_take_emitter(r, &sphere);
    assert_int_equal(r->cmd.settings.step_udeg, 500000);
    assert_int_equal(r->cmd.settings.echoes, NATIVE_ECHOES_LAST);
    assert_int_equal(r->cmd.limits.emitter, EMITTER_SPHERE);
    assert_int_equal(r->cmd.limits.line_pulses, 720);
    replay_take_emitter(r, &beams);
    assert_int_equal(r->cmd.limits.sequence_ps, 55296000);
    assert_int_equal(r->cmd.limits.emitter, EMITTER_BEAMS);
    replay_take_anchor(r, &anchor);
    assert_true(r->cmd.settings.station == 3 && r->cmd.defaults.station == 3 && r->cmd.limits.n_stations == 3);
    free(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_settings)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
