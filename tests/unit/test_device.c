/* SPDX-License-Identifier: MIT */
/* These tests run the device in device time. The test claims each tick, with no threads and no clock. */
#include "tests/common/cases.h"
#include "tests/unit/device_rig.h"

#include <math.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/device/device_state.h"
#include "firmware_sim/device/journal.h"

#define HZ INT64_C(1000000)

/* --- states --- */

static uint64_t wait_for_state(struct rig *rig, enum head_state state, uint64_t most)
{
    for (uint64_t i = 0; i < most && rig_claim(rig); i++)
        for (uint32_t e = 0; e < rig->work.n_events; e++)
            if (rig->work.event[e].code == NATIVE_EV_STATE && rig->work.event[e].a == (uint64_t)state)
                return rig->work.tick;
    fail_msg("state %d did not come within %u ticks", (int)state, (unsigned)most);
    return 0;
}

/* Profile: 200 ms boot, 30 ms spin-up, 50 ms spin-down; a frame of 90 degrees takes 500 ms; ticks of 1 ms. */
static void a_scan_goes_through_all_states_in_time(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    assert_true(wait_for_state(rig, HEAD_BOOT, 1) == 0);
    assert_true(wait_for_state(rig, HEAD_IDLE, 1000) == 200);
    rig_go_to(rig, 300);
    assert_string_equal(rig_state(rig, 199), "boot");
    assert_string_equal(rig_state(rig, 300), "idle");
    assert_string_equal(rig_tell(rig, "SCAN:START", 300), "OK");
    assert_string_equal(rig_state(rig, 300), "spin-up");
    assert_true(wait_for_state(rig, HEAD_SPIN_UP, 2) == 300);
    assert_true(wait_for_state(rig, HEAD_SCANNING, 100) == 330);
    assert_true(rig->work.scanning && rig->work.pulse0 == 0 &&
                rig->work.pulse_end == 288); /* 300, in whole packets of 16 */
    assert_true(rig->work.scan_t0_ns == 330000000);
    assert_string_equal(rig_state(rig, 329), "spin-up");
    assert_string_equal(rig_state(rig, 330), "scanning");
    const struct native_event *end = rig_wait(rig, NATIVE_EV_SCAN_END, 600);
    assert_true(rig->work.tick == 829 && end->a == 1 && end->b == 150000 &&
                end->c ==
                    atomic_load(&device_counters(rig->device)->cast)); /* its release takes off what was delivered */
    assert_true(rig->work.pulse_end == 150000 && !rig->work.cut_short);
    assert_string_equal(rig_state(rig, 829), "scanning");
    assert_string_equal(rig_state(rig, 830), "spin-down");
    assert_true(wait_for_state(rig, HEAD_IDLE, 100) == 880);
    assert_string_equal(rig_tell(rig, "SCAN:COUNT?", 880), "1");
    rig_close(rig);
}

/* A reader sees released ticks. The loop claims up to 65 ticks further (64 ms ahead, by default). */
static void a_command_reaches_the_beam_within_100_ms(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    assert_true(rig->cfg->loop.ahead_ms == 64.0 && rig->cfg->loop.tick_hz == 1000.0);
    for (uint64_t scan = 1; scan <= 20; scan++) {
        uint64_t released = rig->next < 300 ? 300 : rig->next;
        rig_go_to(rig, released + 65);
        rig_tell(rig, "SCAN:START", released);
        rig_wait(rig, NATIVE_EV_SCAN_START, 100);
        assert_true(rig->work.pulse_end > 0);
        /* a tick is sent once its last pulse has fired: when the next tick begins */
        assert_true(rig->work.tick + 1 <= released + 100);
        released = rig->next - 65;
        rig_tell(rig, "HEAD:PRR 500000", released + 1);
        rig_wait(rig, NATIVE_EV_SETTINGS, 1);
        assert_true(rig->work.segment.spec.prr_uhz == 500000 * HZ && rig->work.tick + 1 <= released + 100);
        rig_tell(rig, "HEAD:PRR 300000", released + 1);
        rig_tell(rig, "SCAN:STOP", released + 1);
        rig_wait(rig, NATIVE_EV_SCAN_END, 1);
        assert_true(rig->work.tick + 1 <= released + 100);
        rig_go_to(rig, rig->next + 200);
    }
    rig_close(rig);
}

static void no_spin_up_time_starts_with_the_next_tick(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig->cfg->profile.spin_up_s = 0.0;
    rig_go_to(rig, 300);
    rig_tell(rig, "SCAN:START", 250);
    rig_wait(rig, NATIVE_EV_SCAN_START, 1);
    assert_true(rig->work.tick == 300 && rig->work.pulse_end > 0);
    rig_close(rig);
}

static void a_stop_in_spin_up_never_scans(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, 300);
    rig_tell(rig, "SCAN:START", 300);
    rig_go_to(rig, 310);
    rig_tell(rig, "SCAN:STOP", 310);
    while (rig->next < 500 && rig_claim(rig))
        assert_false(rig->work.scanning);
    assert_string_equal(rig_state(rig, 500), "idle");
    assert_true(device_last_scan(rig->device, NULL) == 0);
    /* Claimed ticks can't be changed. A stop from 8 ticks ago takes effect at the next tick, and turns the head down in
     * 50 ms. */
    rig_tell(rig, "SCAN:START", 500);
    rig_go_to(rig, 510);
    rig_tell(rig, "SCAN:STOP", 502);
    rig_go_to(rig, 559);
    assert_string_equal(rig_state(rig, 559), "spin-down");
    rig_go_to(rig, 562);
    assert_string_equal(rig_state(rig, 561), "idle");
    rig_close(rig);
}

static void is_refused(struct rig *rig, const char *line, uint64_t released, const char *reply)
{
    struct command_result result;
    device_command(rig->device, 1, line, released, &result);
    assert_int_equal(result.error, -221);
    assert_string_equal(result.reply, reply);
}

/* Released ticks end 65 before those that are claimed. A client that has its OK reads the state after the stop. */
static void a_stop_is_seen_at_once(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    for (int resets = 0; resets < 2; resets++) {
        const uint64_t start = resets ? 700 : 300, stop = start + 100;
        rig_go_to(rig, start);
        rig_tell(rig, "SCAN:START", start);
        rig_go_to(rig, stop + 65);
        assert_string_equal(rig_state(rig, stop), "scanning");
        rig_tell(rig, resets ? "*RST" : "SCAN:STOP", stop);
        for (int is_claimed = 0; is_claimed < 2; is_claimed++) {
            assert_string_equal(rig_state(rig, stop), "spin-down");
            assert_string_equal(rig_tell(rig, "*STB?", stop), is_claimed ? "4" : resets ? "4" : "0");
            is_refused(rig, "SCAN:START", stop,
                       "ERR -221,\"Settings conflict; SCAN:STARt is not possible in state spin-down\"");
            is_refused(rig, "SCAN:STOP", stop,
                       "ERR -221,\"Settings conflict; SCAN:STOP is not possible in state spin-down\"");
            assert_true(rig_claim(rig));
            assert_int_equal(rig_event(rig, NATIVE_EV_SCAN_END) != NULL, !is_claimed);
        }
        for (uint64_t released = stop + 1; released < rig->next; released++)
            assert_string_equal(rig_state(rig, released), "spin-down");
        rig_go_to(rig, rig->next + 60);
        assert_string_equal(rig_state(rig, rig->next), "idle");
    }
    rig_close(rig);
}

/* A scan of 500 ms that began at 330 has ended by itself in a claimed tick, which is not released. */
static void a_stop_of_a_scan_that_ends_is_seen_at_once(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, 300);
    rig_tell(rig, "SCAN:START", 300);
    rig_go_to(rig, 850);
    assert_string_equal(rig_state(rig, 800), "scanning");
    rig_tell(rig, "SCAN:STOP", 800);
    assert_string_equal(rig_state(rig, 800), "spin-down");
    rig_go_to(rig, 900);
    assert_string_equal(rig_state(rig, 899), "idle");
    rig_close(rig);
}

/* The state allows settings of the next scan. The stopped scan's last pulses keep the settings that they fired with. */
static void a_stopped_scan_keeps_its_settings(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, 300);
    rig_tell(rig, "SCAN:START", 300);
    rig_go_to(rig, 400);
    rig_tell(rig, "SCAN:STOP", 400);
    rig_tell(rig, "HEAD:STATION 2", 400);
    rig_tell(rig, "HEAD:RANGE:MAX 50", 400);
    assert_true(rig_claim(rig) && rig->work.scanning && rig->work.station == 0 && !rig->work.describe);
    assert_null(rig_event(rig, NATIVE_EV_SETTINGS));
    assert_non_null(rig_event(rig, NATIVE_EV_SCAN_END));
    rig_go_to(rig, 500);
    rig_tell(rig, "SCAN:START", 500);
    rig_wait(rig, NATIVE_EV_SCAN_START, 100);
    assert_true(rig->work.station == 1 && rig->work.descriptor.range_max_m == 50.0);
    rig_close(rig);
}

/* A grant of time is no command of the session, and a journal has only commands. */
static void a_journal_has_no_steps(void **state)
{
    (void)state;
    const char *const sets[] = {"loop.pace=step"};
    struct journal_entry *entry;
    struct sh_err err;
    size_t n;
    struct rig *rig = rig_open(&(struct device_options){.journal = journal_path}, sets, 1);
    rig_tell(rig, "TIME:STEP 250 MS", 0);
    rig_go_to(rig, 250);
    rig_tell(rig, "HEAD:LINES 50", 249);
    rig_tell(rig, "TIME:STEP 1 MS", 250);
    rig_close(rig);
    need(journal_read(journal_path, &entry, &n, &err), &err);
    assert_int_equal(n, 1);
    assert_string_equal(entry[0].line, "HEAD:LINES 50");
    free(entry);
}

/* In the second frame SCAN:FRAMES asks for the frames that are done, for the running one too, or for one more. A frame
 * has 150,000 pulses. */
static void frames_are_counted_with_the_one_that_runs(void **state)
{
    (void)state;
    static const uint64_t frames[] = {1, 2, 3}, then_done[] = {2, 2, 3};
    for (int i = 0; i < 3; i++) {
        const char *const sets[] = {"head.frames=0"};
        struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 1);
        char line[32], done[32];
        rig_wait(rig, NATIVE_EV_SCAN_START, 1000);
        rig_go_to(rig, rig->next + 700);
        assert_string_equal(rig_tell(rig, "SCAN:COUNT?", rig->next), "1");
        snprintf(line, sizeof line, "SCAN:FRAMES %u", (unsigned)frames[i]);
        rig_tell(rig, line, rig->next);
        assert_int_equal(rig_wait(rig, NATIVE_EV_SCAN_END, 1000)->b, then_done[i] * 150000);
        snprintf(done, sizeof done, "%u", (unsigned)then_done[i]);
        assert_string_equal(rig_tell(rig, "SCAN:COUNT?", rig->next), done);
        rig_close(rig);
    }
}

/* A reader that joins a head at rest gets descriptor and anchor within a second, too. The two frames begin no scan. */
static void a_head_at_rest_describes_itself_each_second(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    for (int n = 0; n < 2200 && rig_claim(rig); n++) {
        const struct device_work *work = &rig->work;
        assert_int_equal(work->describe, n != 0 && n % 1000 == 0);
        if (!work->describe) continue;
        assert_int_equal(work->describe_flags, NATIVE_REPEAT);
        assert_int_equal(work->descriptor.scan, 0);
        assert_true(work->descriptor.prr_uhz > 0 && work->anchor.station == 1);
        assert_string_equal(work->descriptor.idn, rig_tell(rig, "*IDN?", rig->next));
    }
    rig_close(rig);
}

/* Twenty command lines, right and wrong ones, are sent at random, thousands of times: only power and failures lead to
 * off and fault. */
static void no_command_leads_to_off_or_fault(void **state)
{
    (void)state;
    static const char *const line[] = {"*RST",
                                       "*CLS",
                                       "SCAN:START",
                                       "SCAN:STOP",
                                       "HEAD:PRR MAX",
                                       "HEAD:PRR MIN",
                                       "HEAD:LINES MAX",
                                       "HEAD:PAN 0",
                                       "HEAD:PAN MAX",
                                       "SCAN:FRAMES 2",
                                       "SCAN:FRAMES 0",
                                       "SYST:CONT:REL",
                                       "HEAD:STATION 2",
                                       "SCAN:PAN:STOP 1",
                                       "POWER OFF",
                                       "FAULT 1",
                                       "SCAN:LINE:STOP 10",
                                       "nonsense",
                                       "",
                                       "*IDN?"};
    struct rig *rig = rig_open(NULL, NULL, 0);
    uint64_t seed = 1;
    enum head_state now = HEAD_OFF;
    for (int i = 0; i < 30000 && rig_claim(rig); i++) {
        for (uint32_t e = 0; e < rig->work.n_events; e++) {
            const struct native_event *event = &rig->work.event[e];
            if (event->code != NATIVE_EV_STATE) continue;
            assert_true(event->b == (uint64_t)now && event->a != HEAD_OFF && event->a != HEAD_FAULT);
            now = (enum head_state)event->a;
        }
        struct command_result result;
        if (case_between(&seed, 0, 9) == 0)
            device_command(
                rig->device, (uint32_t)case_between(&seed, 0, 2), line[case_u64(&seed) % (sizeof line / sizeof *line)],
                rig->next - (uint64_t)case_between(&seed, 0, rig->next < 65 ? (int64_t)rig->next : 65), &result);
    }
    assert_true(device_last_scan(rig->device, NULL) > 50);
    rig_close(rig);
}

/* --- repeated frames --- */

static void descriptor_and_anchor_come_first_and_every_second(void **state)
{
    (void)state;
    const char *const sets[] = {"head.frames=0"};
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 1);
    rig_go_to(rig, 230);
    for (uint64_t since = 0; since < 3500; since++) {
        assert_true(rig_claim(rig) && rig->work.scanning);
        assert_int_equal(rig->work.describe, since % 1000 == 0);
        if (since % 1000 == 0) assert_int_equal(rig->work.describe_flags, since == 0 ? 0 : NATIVE_REPEAT);
        assert_int_equal(rig->work.telemetry, rig->work.tick % 1000 == 0);
    }
    assert_true(rig->work.descriptor.scan == 1 && rig->work.anchor.station == 1);
    rig_close(rig);
}

/* 150 objects in chunks of 64 come all at once, then a chunk every quarter of a second. */
static void all_names_are_said_round_and_round(void **state)
{
    (void)state;
    assert_int_equal(write_scene(150), 0);
    const char *const sets[] = {"head.frames=0"};
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 1);
    assert_int_equal(write_scene(2), 0);
    assert_int_equal(rig->site->scene->n_surfaces, 150);
    static const uint32_t first[] = {0, 64, 128}, n[] = {64, 64, 22};
    rig_go_to(rig, 230);
    for (uint64_t since = 0; since < 2500; since++) {
        assert_true(rig_claim(rig));
        int due = since < 3 || since % 250 == 0;
        uint64_t chunk = since < 3 ? since : since / 250 % 3;
        if (due) assert_int_equal(rig->work.surfaces_first, first[chunk]);
        assert_int_equal(rig->work.surfaces_n, due ? n[chunk] : 0);
    }
    rig_close(rig);
}

static void a_reset_ends_the_scan_and_restores_the_defaults(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, 300);
    rig_tell(rig, "HEAD:PRR 1000000", 300);
    rig_tell(rig, "SCAN:START", 300);
    rig_go_to(rig, 350);
    assert_true(rig->work.scanning && rig->work.segment.spec.prr_uhz == 1000000 * HZ);
    rig_tell(rig, "*RST", 350);
    assert_string_equal(rig_tell(rig, "HEAD:PRR?", 350), "300000");
    assert_true(rig_claim(rig) && rig->work.scanning && rig->work.cut_short);
    assert_true(rig->work.segment.spec.prr_uhz == 1000000 * HZ && rig->work.pulse_end == 20000);
    assert_non_null(rig_event(rig, NATIVE_EV_SCAN_END));
    assert_true(rig_claim(rig) && !rig->work.scanning);
    assert_string_equal(rig_state(rig, 351), "spin-down");
    rig_go_to(rig, 450);
    assert_string_equal(rig_state(rig, 450), "idle");
    rig_tell(rig, "SCAN:START", 450);
    rig_wait(rig, NATIVE_EV_SCAN_START, 100);
    assert_true(rig->work.segment.spec.prr_uhz == 300000 * HZ && device_last_scan(rig->device, NULL) == 2);
    rig_close(rig);
}

/* --- journal and replay --- */

enum { SESSION_TICKS = 1500 };
static const struct {
    uint64_t tick, behind; /* given when `tick` is next; the reader is that far behind */
    const char *line;
} session[] = {{50, 10, "HEAD:PRR 500000"}, {300, 65, "SCAN:START"},    {360, 65, "HEAD:PRR 123456.789"},
               {360, 65, "HEAD:LINES 40"},  {377, 65, "SCAN:FRAMES 0"}, {500, 65, "SCAN:STOP"},
               {500, 65, "SCAN:STOP"},      {501, 65, "SCAN:STOP"}, /* journals of earlier heads may stop it again */
               {700, 20, "HEAD:STATION 2"}, {701, 0, "SCAN:START"},     {900, 65, "*RST"},
               {1100, 65, "SCAN:FRAMES 1"}, {1100, 65, "SCAN:START"}};

static struct device_work *run_session(const struct device_options *options, int replay)
{
    struct device_work *works = calloc(SESSION_TICKS, sizeof *works);
    assert_non_null(works);
    struct rig *rig = rig_open(options, NULL, 0);
    size_t at = 0;
    while (rig->next < SESSION_TICKS) {
        for (; !replay && at < sizeof session / sizeof *session && session[at].tick == rig->next; at++) {
            struct command_result result;
            device_command(rig->device, 0, session[at].line, rig->next - session[at].behind, &result);
            if (result.error != 0) fail_msg("%s: %s", session[at].line, result.reply);
        }
        assert_true(rig_claim(rig));
        works[rig->work.tick] = rig->work;
    }
    assert_int_equal(rig->device->journal.n_refused, 0);
    assert_true(device_last_scan(rig->device, NULL) == 3);
    rig_close(rig);
    return works;
}

static void check_same_segment(const struct schedule_segment *a, const struct schedule_segment *b)
{
    /* field by field, since padding may hold any bytes */
    assert_memory_equal(&a->spec, &b->spec, offsetof(struct schedule_spec, frames) + sizeof a->spec.frames);
    assert_true(a->k0 == b->k0 && a->t0_ns == b->t0_ns && a->line0 == b->line0 && a->r0 == b->r0);
    assert_true(a->line0_begin == b->line0_begin && a->line0_cast == b->line0_cast && a->pan0_fine == b->pan0_fine);
    assert_true(a->frame0 == b->frame0 && a->frame0_end == b->frame0_end && a->end_pulse == b->end_pulse);
}

static void a_journal_replayed_gives_the_same_work(void **state)
{
    (void)state;
    struct device_work *once = run_session(&(struct device_options){.journal = journal_path}, 0);
    struct device_work *again = run_session(&(struct device_options){.replay = journal_path}, 1);
    for (int i = 0; i < SESSION_TICKS; i++) {
        const struct device_work *a = &once[i], *b = &again[i];
        assert_int_equal(a->scanning, b->scanning);
        assert_true(a->pulse0 == b->pulse0 && a->pulse_end == b->pulse_end && a->cut_short == b->cut_short);
        assert_true(a->scan_t0_ns == b->scan_t0_ns && a->station == b->station && a->t_ns == b->t_ns);
        if (a->scanning) check_same_segment(&a->segment, &b->segment);
        assert_true(a->describe == b->describe && a->describe_flags == b->describe_flags &&
                    a->surfaces_n == b->surfaces_n);
        if (a->describe) {
            assert_memory_equal(&a->descriptor, &b->descriptor, sizeof a->descriptor);
            assert_memory_equal(&a->anchor, &b->anchor, sizeof a->anchor);
        }
        assert_true(a->n_events == b->n_events && a->n_events_before == b->n_events_before);
        assert_memory_equal(a->event, b->event, a->n_events * sizeof a->event[0]);
    }
    free(once);
    free(again);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_scan_goes_through_all_states_in_time),
        cmocka_unit_test(a_command_reaches_the_beam_within_100_ms),
        cmocka_unit_test(no_spin_up_time_starts_with_the_next_tick),
        cmocka_unit_test(a_stop_in_spin_up_never_scans),
        cmocka_unit_test(a_stop_is_seen_at_once),
        cmocka_unit_test(a_stop_of_a_scan_that_ends_is_seen_at_once),
        cmocka_unit_test(a_stopped_scan_keeps_its_settings),
        cmocka_unit_test(frames_are_counted_with_the_one_that_runs),
        cmocka_unit_test(a_journal_has_no_steps),
        cmocka_unit_test(a_head_at_rest_describes_itself_each_second),
        cmocka_unit_test(no_command_leads_to_off_or_fault),
        cmocka_unit_test(descriptor_and_anchor_come_first_and_every_second),
        cmocka_unit_test(all_names_are_said_round_and_round),
        cmocka_unit_test(a_reset_ends_the_scan_and_restores_the_defaults),
        cmocka_unit_test(a_journal_replayed_gives_the_same_work),
    };
    return cmocka_run_group_tests_name("device", tests, make_folder, remove_folder);
}
