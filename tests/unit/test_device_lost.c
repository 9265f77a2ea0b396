/* SPDX-License-Identifier: MIT */
/* Events of ticks that the head could not compute in time are reported again. Changes before power goes are refused. */
#include "tests/unit/device_rig.h"

static void a_lost_tick_says_its_events_again(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, 300);
    rig_tell(rig, "SCAN:START", 300);
    rig_wait(rig, NATIVE_EV_SCAN_START, 100);
    assert_true(rig->work.describe && rig->work.describe_flags == 0);
    struct device_work lost = rig->work;
    struct command_result result;
    uint64_t n_cast = lost.n_cast;
    assert_true(n_cast > 0);
    device_command(rig->device, 1, "nonsense", rig->next, &result); /* a later event, which waits */
    device_lost(rig->device, &lost);
    assert_true(rig_claim(rig));
    assert_true(rig->work.describe && rig->work.describe_flags == 0);
    const struct native_event *again = rig_event(rig, NATIVE_EV_SCAN_START);
    assert_true(again != NULL && again->a == 1 && again->b == (uint64_t)lost.scan_t0_ns);
    assert_non_null(rig_event(rig, NATIVE_EV_STATE));
    assert_true(rig_event(rig, NATIVE_EV_ERROR) > again); /* they stay in order */
    rig_tell(rig, "SYST:ERR?", rig->next);
    const struct native_event *overrun = rig_event(rig, NATIVE_EV_OVERRUN);
    assert_true(overrun != NULL && overrun->b == n_cast && overrun->c == 1);
    assert_true(rig->work.pulse0 == lost.pulse_end); /* the pulses themselves are gone */
    assert_non_null(strstr(rig_tell(rig, "SYST:ERR?", rig->next), "103,"));
    const struct native_event *end = rig_wait(rig, NATIVE_EV_SCAN_END, 600);
    assert_true(end->b == 150000 && end->c == atomic_load(&device_counters(rig->device)->cast));
    assert_true(atomic_load(&device_counters(rig->device)->lost_pulses) == n_cast);
    rig_close(rig);
}

/* Ticks are lost one after the other, each with the event about those before. */
static void a_lost_overrun_is_said_with_the_next(void **state)
{
    (void)state;
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, NULL, 0);
    rig_wait(rig, NATIVE_EV_SCAN_START, 1000);
    assert_true(rig_claim(rig));
    struct device_work lost = rig->work;
    const uint64_t first = lost.cast0;
    uint64_t n_cast = lost.n_cast;
    device_lost(rig->device, &lost);
    for (uint64_t ticks = 1; ticks <= 3; ticks++) {
        assert_true(rig_claim(rig));
        const struct native_event *overrun = rig_event(rig, NATIVE_EV_OVERRUN);
        assert_non_null(overrun);
        assert_true(overrun->a == first && overrun->b == n_cast && overrun->c == ticks);
        lost = rig->work;
        n_cast += lost.n_cast;
        device_lost(rig->device, &lost);
    }
    rig_close(rig);
}

/* A tick from before a power cycle is lost late. While power is off, and after that, no event of it comes; its loss is
 * still counted. */
static void a_head_without_power_forgets_what_it_had_to_say(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, 300);
    rig_tell(rig, "SCAN:START", 300);
    rig_wait(rig, NATIVE_EV_SCAN_START, 100);
    struct device_work lost = rig->work;
    rig_tell(rig, "HEAD:REBOOT", rig->next);
    assert_true(rig_claim(rig));
    assert_true(rig->work.power == DEVICE_POWER_GOES);
    device_lost(rig->device, &lost);
    for (int i = 0; i < 300; i++) { /* boot_s is 0.2 s */
        assert_true(rig_claim(rig));
        assert_null(rig_event(rig, NATIVE_EV_SCAN_START));
    }
    assert_true(atomic_load(&device_counters(rig->device)->lost_pulses) == lost.n_cast);
    assert_non_null(strstr(rig_tell(rig, "SYST:ERR?", rig->next), "103,"));
    rig_close(rig);
}

static void expect_error(const struct command_result *result, int error, const char *reply)
{
    if (result->error != error || strcmp(result->reply, reply) != 0) fail_msg("%d: %s", result->error, result->reply);
    if (error != 0) assert_int_equal(result->effect, COMMAND_NONE);
}

/* Power takes each change away that comes after HEAD:REBoot has been answered, so none is answered OK. The claim that
 * turns power off may be far ahead of what clients have seen: sessions of other protocols still have to answer then. */
static void refuses_changes_once_it_reboots(void **state)
{
    (void)state;
    static const char *const changes[] = {"HEAD:LINES 40",          "SCAN:START",     "*RST",         "HEAD:REBOOT",
                                          "SITE:POSE 1, DEF",       "HEAD:STORE",     "TIME:SHIFT 1", "SYST:CONT:TAKE",
                                          "FAULt:ADD {kind: drop}", "FAULt:CLEar ALL"};
    struct command_result result;
    struct rig *rig = rig_open(NULL, NULL, 0);
    rig_go_to(rig, 300);
    assert_string_equal(rig_tell(rig, "HEAD:REBOOT", 290), "OK");
    for (int claimed = 0; claimed < 2; claimed++) {
        for (size_t i = 0; i < sizeof changes / sizeof changes[0]; i++) {
            device_command_once(rig->device, 1, changes[i], 290, &result);
            if (strncmp(result.reply, "ERR -221,", 9) != 0) fail_msg("%s: %s", changes[i], result.reply);
            assert_int_equal(result.effect, COMMAND_NONE);
            device_command(rig->device, 1, changes[i], 290, &result);
            if (claimed) expect_error(&result, 0, ""); /* this session is about to be cut off */
            if (!claimed && strncmp(result.reply, "ERR -221,", 9) != 0) fail_msg("%s: %s", changes[i], result.reply);
        }
        device_command_once(rig->device, 1, "HEAD:LINES 40", 290, &result);
        expect_error(&result, CMD_E_SETTINGS,
                     claimed ? "ERR -221,\"Settings conflict; the head has no power\""
                             : "ERR -221,\"Settings conflict; the head reboots\"");
        device_command_once(rig->device, 1, "HEAD:LINES?", 290, &result);
        expect_error(&result, 0, "100");
        assert_true(rig_claim(rig));
    }
    rig_close(rig);
}

/* Returns the answer, which may be an error. */
static const char *answer(struct rig *rig, const char *line)
{
    static struct command_result result;
    device_command(rig->device, 1, line, 290, &result);
    return result.reply;
}

/* Commands that change no setting work until power goes: errors are queued and taken out, control is given back. */
static void empties_its_queue_until_power_goes(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    struct command_result result;
    rig_go_to(rig, 300);
    assert_string_equal(answer(rig, "SYST:CONT:TAKE"), "OK");
    assert_string_equal(answer(rig, "HEAD:REBOOT"), "OK");
    answer(rig, "HEAD:LINES 40");
    answer(rig, "nonsense");
    assert_string_equal(answer(rig, "SYST:ERR:COUN?"), "2");
    assert_string_equal(answer(rig, "SYST:ERR?"), "-221,\"Settings conflict; the head reboots\"");
    assert_memory_equal(answer(rig, "SYST:ERR?"), "-113,", 5);
    assert_string_equal(answer(rig, "SYST:ERR?"), "0,\"No error\"");
    answer(rig, "nonsense");
    assert_string_equal(answer(rig, "*CLS"), "OK");
    assert_string_equal(answer(rig, "SYST:ERR:COUN?"), "0");
    assert_string_equal(answer(rig, "SYST:CONT:TAKE"), "ERR -221,\"Settings conflict; the head reboots\"");
    assert_string_not_equal(answer(rig, "SYST:CONT?"), "0");
    assert_string_equal(answer(rig, "SYST:CONT:REL"), "OK");
    assert_string_equal(answer(rig, "SYST:CONT?"), "0");
    assert_string_equal(answer(rig, "HEAD:LINES?"), "100");
    /* Without power the queue holds nothing, so that a client that empties it comes to an end. */
    assert_true(rig_claim(rig));
    for (int i = 0; i < 2; i++) {
        device_command_once(rig->device, 1, "SYST:ERR?", 290, &result);
        assert_string_equal(result.reply, "0,\"No error\"");
        device_command_once(rig->device, 1, "HEAD:LINES 40", 290, &result);
    }
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_lost_tick_says_its_events_again),
        cmocka_unit_test(a_lost_overrun_is_said_with_the_next),
        cmocka_unit_test(a_head_without_power_forgets_what_it_had_to_say),
        cmocka_unit_test(refuses_changes_once_it_reboots),
        cmocka_unit_test(empties_its_queue_until_power_goes),
    };
    return cmocka_run_group_tests_name("device lost", tests, make_folder, remove_folder);
}
