/* SPDX-License-Identifier: MIT */
/* Ticks that the head could not compute in time: their events are reported again. */
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_lost_tick_says_its_events_again),
        cmocka_unit_test(a_lost_overrun_is_said_with_the_next),
        cmocka_unit_test(a_head_without_power_forgets_what_it_had_to_say),
    };
    return cmocka_run_group_tests_name("device lost", tests, make_folder, remove_folder);
}
