/* SPDX-License-Identifier: MIT */
/* The settings that a replay reports for its head follow from the recording, and so do its counts and states. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <math.h>
#include <stdint.h>
#include <stdlib.h>
#include <cmocka.h>

#include "drivers/protocol/native_encode.h"
#include "firmware_sim/config/config.h"
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

/* Each figure of a descriptor becomes that setting, and where the head has limits, both of them. */
static void a_descriptor_gives_settings_and_limits(void **state)
{
    (void)state;
    struct replay *r = calloc(1, sizeof *r);
    const struct native_descriptor d = {.prr_uhz = 11,
                                        .lines_uhz = 12,
                                        .pan_udeg_s = 13,
                                        .line_start_udeg = -14,
                                        .line_stop_udeg = 15,
                                        .pan_start_udeg = -16,
                                        .pan_stop_udeg = 17,
                                        .frames = 18,
                                        .sweep_udeg = 19,
                                        .range_min_m = 0.5,
                                        .range_max_m = 120.25,
                                        .content = NATIVE_HAS_WAVES};
    assert_non_null(r);
    replay_take_descriptor(r, &d);
    const struct head_settings *s = &r->cmd.settings;
    const struct head_limits *l = &r->cmd.limits;
    assert_true(s->prr_uhz == 11 && l->prr_min_uhz == 11 && l->prr_max_uhz == 11);
    assert_true(s->lines_uhz == 12 && l->lines_min_uhz == 12 && l->lines_max_uhz == 12);
    assert_true(s->pan_udeg_s == 13 && l->pan_max_udeg_s == 13);
    assert_true(s->line_start_udeg == -14 && l->fov_min_udeg == -14);
    assert_true(s->line_stop_udeg == 15 && l->fov_max_udeg == 15);
    assert_true(s->pan_start_udeg == -16 && l->pan_min_udeg == -16);
    assert_true(s->pan_stop_udeg == 17 && l->pan_max_udeg == 17);
    assert_true(s->frames == 18 && l->sweep_udeg == 19);
    assert_true(s->range_min_nm == 500000000 && l->range_min_nm == 500000000 && l->near_most_nm == 500000000);
    assert_true(s->range_max_nm == 120250000000 && l->range_max_nm == 120250000000 && l->far_least_nm == 120250000000);
    assert_true(s->waves == 1 && l->waves_most == 1);
    assert_true(l->emitter == EMITTER_LINE && l->line_pulses == 0);
    assert_memory_equal(&r->cmd.defaults, s, sizeof *s);
    const struct native_descriptor odd = {.range_min_m = NAN, .range_max_m = 1e9};
    replay_take_descriptor(r, &odd); /* a recording may have any numbers */
    assert_true(s->range_min_nm == 0 && s->range_max_nm == 0 && s->waves == 0 && l->waves_most == 0);
    free(r);
}

/* ---- counts of what is sent */

static uint8_t frame[2048];

static void note_event(struct replay *r, enum native_event_code code, uint64_t a, uint64_t tick)
{
    const struct native_event event = {.code = (uint32_t)code, .a = a};
    assert_true(native_encode_event(frame, sizeof frame, &event, 0, 0) > 0);
    replay_note_frame(r, frame, tick);
}

static void note_line(struct replay *r, const struct line_end *end)
{
    assert_true(native_encode_line_end(frame, sizeof frame, end, 0) > 0);
    replay_note_frame(r, frame, 0);
}

/* n pulses with an echo each but for the last n_empty of them. */
static void note_points(struct replay *r, uint32_t n, uint32_t n_empty)
{
    static uint32_t zero[16];
    static int16_t refl_cdb[16];
    static uint16_t label[16];
    uint8_t echo[16];
    for (uint32_t i = 0; i < n; i++)
        echo[i] = i < n - n_empty ? 0x11 : 0;
    const struct line_block block = {.n_pulses = n,
                                     .n_points = n,
                                     .dt_ns = zero,
                                     .a = zero,
                                     .b = zero,
                                     .c = zero,
                                     .refl_cdb = refl_cdb,
                                     .echo = echo,
                                     .label = label};
    assert_true(native_encode_points(frame, sizeof frame, &block, 0) > 0);
    replay_note_frame(r, frame, 0);
}

/* The statistics of a replay are those of its frames: cast and blind pulses, echoes, lines, and what was left out. */
static void frames_are_counted(void **state)
{
    (void)state;
    struct replay *r = calloc(1, sizeof *r);
    assert_non_null(r);
    note_event(r, NATIVE_EV_SCAN_START, 1, 0);
    assert_int_equal(r->tick.scan, 0); /* a tick belongs to the scan of its points */
    note_points(r, 16, 5);
    note_points(r, 10, 0);
    assert_true(r->scans == 1 && r->tick.scan == 1 && r->frames == 3);
    assert_true(r->tick.n_cast == 26 && r->tick.n_fired == 26);
    assert_true(r->tick.hits.echoes == 21 && r->tick.hits.empty == 5);
    note_line(r, &(struct line_end){.n_fired = 30, .n_cast = 26, .n_crowded = 3, .n_faint = 4, .n_unfit = 5});
    assert_true(r->tick.n_lines == 1 && r->tick.n_fired == 30 && r->frames_done == 0);
    note_line(
        r, &(struct line_end){.frame = 6, .status = LINE_LAST_OF_FRAME, .n_crowded = 10, .n_faint = 20, .n_unfit = 30});
    assert_true(r->tick.n_lines == 2 && r->tick.n_fired == 30 && r->frames_done == 7);
    assert_true(r->tick.hits.crowded == 13 && r->tick.hits.faint == 24 && r->tick.hits.unfit == 35);
    note_event(r, NATIVE_EV_SCAN_START, 2, 0);
    note_points(r, 1, 1);
    assert_true(r->scans == 2 && r->tick.scan == 2 && r->frames_done == 0 && r->frames == 7);
    free(r);
}

/* Settings are those of the last descriptor, emitter and anchor that went out. A new descriptor is that of a head whose
 * mirror turns, until an emitter says otherwise. */
static void settings_follow_the_frames(void **state)
{
    (void)state;
    struct replay *r = calloc(1, sizeof *r);
    const struct native_emitter e = {.kind = NATIVE_EMIT_PLANAR, .steps = 1440, .turn = 1, .sequence_ns_den = 1};
    const struct native_anchor a = {.station = 4};
    struct native_descriptor d = {.prr_uhz = 7, .range_scale_m = 1};
    assert_non_null(r);
    d.mirror_counts_per_turn = d.pan_counts_per_turn = 1000;
    assert_true(native_encode_emitter(frame, sizeof frame, &e, NULL, 0, 0) > 0);
    replay_note_frame(r, frame, 0);
    assert_true(r->cmd.limits.emitter == EMITTER_PLANAR && r->cmd.limits.line_pulses == 1440);
    assert_true(native_encode_anchor(frame, sizeof frame, &a, 0, 0) > 0);
    replay_note_frame(r, frame, 0);
    assert_int_equal(r->cmd.settings.station, 4);
    assert_true(native_encode_descriptor(frame, sizeof frame, &d, 0, 0) > 0);
    replay_note_frame(r, frame, 0);
    assert_true(r->cmd.settings.prr_uhz == 7 && r->cmd.limits.emitter == EMITTER_LINE);
    assert_true(r->cmd.limits.line_pulses == 0 && r->cmd.settings.station == 4 && r->frames == 3);
    free(r);
}

/* States go out with their ticks; a device of another protocol scans all the time. An unknown state is ignored. */
static void states_are_taken(void **state)
{
    (void)state;
    for (int is_device = 0; is_device <= 1; is_device++) {
        struct replay *r = calloc(1, sizeof *r);
        assert_non_null(r);
        r->is_device = is_device;
        note_event(r, NATIVE_EV_STATE, HEAD_SCANNING, 40);
        note_event(r, NATIVE_EV_STATE, HEAD_N_STATES, 41);
        note_event(r, NATIVE_EV_CONTROL, HEAD_IDLE, 42);
        assert_int_equal(r->n_changes, is_device ? 0 : 1);
        if (!is_device) assert_true(r->change[0].tick == 40 && r->change[0].state == HEAD_SCANNING);
        free(r);
    }
}

static const char *state_at(struct replay *r, uint64_t released)
{
    static struct command_result result;
    replay_command(r, 1, "HEAD:STATE?", released, &result);
    return result.reply;
}

/* A state holds once the tick that contains it is released. After n ticks, ticks 0 to n - 1 are. */
static void a_state_holds_from_its_tick_on(void **state)
{
    (void)state;
    struct replay *r = calloc(1, sizeof *r);
    struct config *cfg = calloc(1, sizeof *cfg);
    assert_true(r != NULL && cfg != NULL);
    r->cfg = cfg;
    pthread_mutex_init(&r->lock, NULL);
    replay_open_commands(r);
    assert_string_equal(state_at(r, 100), "idle"); /* nothing was said */
    replay_set_state(r, 5, HEAD_SPIN_UP);
    replay_set_state(r, 8, HEAD_SCANNING);
    assert_string_equal(state_at(r, 5), "idle");
    assert_string_equal(state_at(r, 6), "spin-up");
    assert_string_equal(state_at(r, 8), "spin-up");
    assert_string_equal(state_at(r, 9), "scanning");
    for (uint64_t i = 0; i < 3 * REPLAY_CHANGES; i++) /* the oldest are forgotten */
        replay_set_state(r, 10 + i, i % 2 == 0 ? HEAD_SPIN_DOWN : HEAD_IDLE);
    assert_string_equal(state_at(r, 10 + 3 * REPLAY_CHANGES - 1), "spin-down");
    assert_string_equal(state_at(r, 10 + 3 * REPLAY_CHANGES), "idle");
    pthread_mutex_destroy(&r->lock);
    free(cfg);
    free(r);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_settings),      cmocka_unit_test(a_descriptor_gives_settings_and_limits),
        cmocka_unit_test(frames_are_counted), cmocka_unit_test(settings_follow_the_frames),
        cmocka_unit_test(states_are_taken),   cmocka_unit_test(a_state_holds_from_its_tick_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
