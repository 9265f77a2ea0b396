/* SPDX-License-Identifier: MIT */
/* Faults of the head's states, power, time and counters, as the device carries them out, tick by tick. */
#include "firmware_sim/device/scanner_clock.h"
#include "tests/unit/device_rig.h"

enum { TICK_NS = 1000000, BOOT_TICKS = 200 };

/* Opens a device with these faults in its configuration, one a line. */
static struct rig *open_with(const char *faults, const struct device_options *options, const char *const *sets,
                             int n_sets)
{
    char path[96];
    snprintf(path, sizeof path, "%s/run.yaml", folder);
    FILE *f = fopen(path, "r+");
    assert_non_null(f);
    assert_int_equal(fseek(f, 0, SEEK_END), 0);
    const long len = ftell(f);
    fprintf(f, "faults:\n%s", faults);
    assert_int_equal(fclose(f), 0);
    struct rig *rig = rig_open(options, sets, n_sets);
    assert_int_equal(truncate(path, len), 0);
    return rig;
}

/* Claims ticks up to the next STATE event, and returns its tick. */
static uint64_t next_state(struct rig *rig, const char *name)
{
    const struct native_event *event = rig_wait(rig, NATIVE_EV_STATE, 5000);
    assert_string_equal(event->text, name);
    return rig->work.tick;
}

static void tell_refused(struct rig *rig, const char *line, const char *why)
{
    struct command_result result;
    device_command(rig->device, 1, line, rig->next, &result);
    assert_int_equal(result.error, CMD_E_SETTINGS);
    if (strstr(result.reply, why) == NULL) fail_msg("%s: %s", line, result.reply);
}

/* Two slow boots at once add up. A slow boot whose window has not begun has no effect. */
static void boots_slowly(void **state)
{
    (void)state;
    struct rig *rig = open_with("  - {kind: slow_boot, for_ms: 300}\n  - {kind: slow_boot, for_ms: 50.5}\n"
                                "  - {kind: slow_boot, for_ms: 1000, from_s: 0.1}\n",
                                NULL, NULL, 0);
    assert_int_equal(next_state(rig, "boot"), 0);
    assert_int_equal(next_state(rig, "idle"), BOOT_TICKS + 300 + 51);
    assert_string_equal(rig_tell(rig, "FAULt:INJected?", rig->next), "2");
    rig_close(rig);
}

static void fails_the_self_test(void **state)
{
    (void)state;
    struct rig *rig = open_with("  - {kind: self_test, from_s: 0.2, until_s: 0.201}\n", NULL, NULL, 0);
    assert_int_equal(next_state(rig, "boot"), 0);
    assert_int_equal(next_state(rig, "fault"), BOOT_TICKS);
    const struct native_event *error = rig_event(rig, NATIVE_EV_ERROR);
    assert_non_null(error);
    assert_true((int64_t)error->a == CMD_E_SELF_TEST);
    assert_true(device_is_idle(rig->device));
    assert_string_equal(rig_tell(rig, "SYST:ERR?", rig->next),
                        "-330,\"Self-test failed; at the end of boot; *RST goes on without it\"");
    tell_refused(rig, "SCAN:START", "self-test");
    rig_tell(rig, "*RST", rig->next);
    assert_string_equal(rig_state(rig, rig->next), "idle");
    rig_tell(rig, "SCAN:START", rig->next);
    assert_int_equal(next_state(rig, "idle"), BOOT_TICKS + 1); /* of *RST */
    rig_close(rig);
    /* No boot ends within these windows. */
    rig = open_with("  - {kind: self_test, from_s: 0.201}\n  - {kind: self_test, until_s: 0.2}\n", NULL, NULL, 0);
    next_state(rig, "boot");
    assert_int_equal(next_state(rig, "idle"), BOOT_TICKS);
    rig_close(rig);
}

/* The run's only scan can't be started, so the run is over. */
static void ends_a_run_that_cannot_scan(void **state)
{
    (void)state;
    static const struct device_options options = {.start = 1, .one_scan = 1};
    struct rig *rig = open_with("  - {kind: self_test}\n", &options, NULL, 0);
    for (int i = 0; i < 1000 && rig_claim(rig); i++)
        continue;
    assert_true(rig->over);
    rig_close(rig);
}

/* Without a scan the run's duration counts from the first self-test that failed, also in the paces that wait. A scan
 * that begins after all has its whole duration. */
static void ends_a_run_after_its_duration(void **state)
{
    (void)state;
    static const struct device_options options = {.start = 1, .duration_s = 0.4};
    struct rig *rig =
        open_with("  - {kind: self_test}\n  - {kind: power_cycle, for_ms: 1, from_s: 0.3}\n", &options, NULL, 0);
    rig_go_to(rig, BOOT_TICKS + 1);
    assert_false(device_is_idle(rig->device));
    for (int i = 0; i < 1000 && rig_claim(rig); i++)
        continue;
    assert_in_range(rig->next, BOOT_TICKS + 400, BOOT_TICKS + 402); /* the end, and what is still to be said */
    rig_close(rig);

    rig = open_with("  - {kind: self_test}\n", &options, NULL, 0);
    rig_go_to(rig, 500);
    rig_tell(rig, "*RST", 500);
    rig_tell(rig, "SCAN:START", 500);
    const uint64_t start = rig_wait(rig, NATIVE_EV_SCAN_START, 100)->b / TICK_NS;
    while (rig_claim(rig))
        continue;
    assert_in_range(rig->next, start + 400, start + 402);
    rig_close(rig);
}

/* In this tick the head sends nothing. */
static void assert_silent(struct rig *rig)
{
    const struct device_work *w = &rig->work;
    assert_true(w->n_events == 0 && !w->telemetry && !w->describe && !w->scanning && w->surfaces_n == 0);
}

/* Power goes at 1 s within a scan and is back 0.5 s later. All is as at power-up. */
static void loses_power(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.epoch=2026-01-01T00:00:00.25Z", "head.frames=0"};
    struct rig *rig = open_with("  - {kind: power_cycle, from_s: 0.9996, for_ms: 499.7}\n", NULL, sets, 2);
    struct command_result result;
    rig_go_to(rig, 300);
    rig_tell(rig, "HEAD:PRR 100000", 300);
    rig_tell(rig, "SCAN:START", 300);
    device_report(rig->device, CMD_E_PULSES, "for the test");
    while (rig->next < 1000) {
        assert_true(rig_claim(rig));
        assert_true(rig->work.power == DEVICE_POWER_STAYS);
    }
    assert_true(rig->work.scanning && !rig->work.cut_short);
    assert_true(rig_claim(rig));
    assert_true(rig->work.power == DEVICE_POWER_GOES && !rig->work.scanning && !rig->work.telemetry);
    assert_int_equal(rig->work.n_events, 1); /* no SCAN_END */
    assert_string_equal(rig_event(rig, NATIVE_EV_STATE)->text, "off");
    assert_false(device_is_idle(rig->device));
    /* A client that sends before the power-off is released gets no answer, and changes nothing. */
    device_command(rig->device, 1, "HEAD:PRR 200000", 950, &result);
    assert_true(result.reply[0] == '\0' && result.error == 0 && result.effect == COMMAND_NONE);
    device_command(rig->device, 1, "FAULt:ADD {kind: laser_off}", 1001, &result);
    assert_true(result.error != 0 && strcmp(rig_state(rig, 1001), "off") == 0);
    assert_non_null(strstr(result.reply, "the head has no power"));
    device_command(rig->device, 1, "FAULt:CLEar 1", 1001, &result);
    assert_non_null(strstr(result.reply, "the head has no power"));
    device_command(rig->device, 1, "SYSTem:CONTrol:TAKE", 1001, &result);
    assert_int_equal(result.error, CMD_E_SETTINGS);
    assert_non_null(strstr(result.reply, "the head has no power"));
    assert_string_equal(rig_tell(rig, "FAULt:LIST?", 1001), "1 power_cycle"); /* a query is answered */
    assert_string_equal(rig_tell(rig, "FAULt:INJected? 1", 1001), "1");
    while (rig->next < 1500) {
        assert_true(rig_claim(rig));
        assert_silent(rig);
    }
    assert_true(rig_claim(rig));
    assert_true(rig->work.power == DEVICE_POWER_COMES && rig->work.t_ns == INT64_C(1500) * TICK_NS);
    assert_string_equal(rig_event(rig, NATIVE_EV_STATE)->text, "boot");
    assert_int_equal(next_state(rig, "idle"), 1500 + BOOT_TICKS);
    assert_string_equal(rig_tell(rig, "HEAD:PRR?", rig->next), "300000");
    struct device_work now;
    device_describe_now(rig->device, &now);
    assert_true(now.descriptor.prr_uhz == 300000000000);
    assert_string_equal(rig_tell(rig, "SYST:CONT?", rig->next), "0");
    assert_string_equal(rig_tell(rig, "SYST:ERR:COUN?", rig->next), "0");
    assert_string_equal(rig_tell(rig, "FAULt:INJected? 1", rig->next), "1");
    rig_tell(rig, "SCAN:START", rig->next);
    assert_int_equal(rig_wait(rig, NATIVE_EV_SCAN_START, 100)->a, 2);
    assert_true(rig->work.pulse0 == 0 && rig->work.segment.spec.prr_uhz == 300000000000);
    /* The time of day went on. */
    const struct native_event *pps = rig_wait(rig, NATIVE_EV_PPS, 1000);
    assert_true(pps->a == 1767225602 && pps->b == 1750000000);
    rig_close(rig);
}

/* The fault strikes at a pulse, once: the scan that --start begins again is not cut. A slow boot that power cuts short
 * adds nothing to the next boot. */
static void loses_power_at_a_pulse(void **state)
{
    (void)state;
    static const struct device_options options = {.start = 1};
    struct rig *rig = open_with("  - {kind: power_cycle, from_pulse: 12345, for_ms: 10}\n"
                                "  - {kind: power_cycle, from_s: 1, for_ms: 10}\n"
                                "  - {kind: slow_boot, for_ms: 1000, from_s: 0.1}\n",
                                &options, NULL, 0);
    rig_wait(rig, NATIVE_EV_SCAN_START, 1000);
    uint64_t fired = 0;
    while (rig->work.power == DEVICE_POWER_STAYS) {
        fired = rig->work.scanning ? rig->work.pulse_end : fired;
        assert_true(rig_claim(rig));
    }
    /* The fault strikes at the first tick that begins with the pulse or later. A tick has 300 of them, cut at packets
     * of 16. */
    assert_true(fired >= 12345 && fired < 12345 + 300 + 16);
    next_state(rig, "boot");
    assert_int_equal(next_state(rig, "off"), 1000);
    assert_int_equal(next_state(rig, "boot"), 1010);
    assert_int_equal(next_state(rig, "idle"), 1010 + BOOT_TICKS + 1000);
    assert_int_equal(rig_wait(rig, NATIVE_EV_SCAN_START, 1000)->a, 2);
    for (int i = 0; i < 200; i++) {
        assert_true(rig_claim(rig));
        assert_true(rig->work.power == DEVICE_POWER_STAYS);
    }
    assert_true(rig->work.scanning && rig->work.pulse0 > 12345 + 600);
    rig_close(rig);
}

/* The second power cycle begins with the tick in which power would come back. Power then stays away: readers expect
 * that it goes and comes in turn. */
static void loses_power_as_it_comes(void **state)
{
    (void)state;
    struct rig *rig = open_with("  - {kind: power_cycle, from_s: 0.3, for_ms: 10}\n"
                                "  - {kind: power_cycle, from_s: 0.31, for_ms: 20}\n",
                                NULL, NULL, 0);
    static const struct {
        uint64_t tick;
        int power;
    } rows[] = {{300, DEVICE_POWER_GOES}, {330, DEVICE_POWER_COMES}};
    size_t n = 0;
    while (rig->next < 600) {
        assert_true(rig_claim(rig));
        if (rig->work.power == DEVICE_POWER_STAYS) continue;
        assert_in_range(n, 0, 1);
        assert_int_equal(rig->work.tick, rows[n].tick);
        assert_int_equal(rig->work.power, rows[n].power);
        n++;
    }
    assert_int_equal(n, 2);
    assert_string_equal(rig_tell(rig, "FAULt:INJected?", rig->next), "2");
    rig_close(rig);
}

/* Lost ticks and errors of a head without power are reported when power is back. The end of the run does not wait for
 * it. */
static void ends_without_power(void **state)
{
    (void)state;
    for (int ends = 0; ends < 2; ends++) {
        struct rig *rig = open_with("  - {kind: power_cycle, from_s: 0.3, for_ms: 100}\n", NULL, NULL, 0);
        rig_go_to(rig, 350);
        device_lost(rig->device, &rig->work);
        for (int i = 0; i < 20; i++) /* more than are reported in a second */
            device_report(rig->device, CMD_E_PULSES, "for the test");
        if (ends) device_end(rig->device);
        int more = 4; /* ticks */
        while (more > 0 && rig_claim(rig))
            more--;
        if (ends) assert_true(more > 0);
        if (!ends) assert_int_equal(rig_wait(rig, NATIVE_EV_OVERRUN, 100)->c, 1);
        if (!ends) assert_true(rig->work.tick == 400);
        rig_close(rig);
    }
}

/* Full seconds begin at .7 s. PPS at 1.7 and 2.7 are lost; at 3.2 the clock jumps on by 0.3 s; from 5.1003 to 6.3504 it
 * stands; the minute at hand has a second 60. */
static void tells_a_wrong_time(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.epoch=2026-06-30T11:59:55.3Z"};
    static const struct {
        int64_t at_ns;
        const char *utc;
    } want[] = {{700000000, "2026-06-30T11:59:56Z"},
                {3200000000 + 200000000, "2026-06-30T11:59:59Z"},
                {4400000000, "2026-06-30T11:59:60Z"},
                {6350400000 + 299700000, "2026-06-30T12:00:00Z"},
                {7650100000, "2026-06-30T12:00:01Z"}};
    struct rig *rig = open_with("  - {kind: pps_lost, from_s: 1.7, until_s: 2.700000001}\n"
                                "  - {kind: clock_jump, from_s: 3.2, jump_s: 0.3}\n"
                                "  - {kind: clock_stop, from_s: 5.1003, until_s: 6.3504}\n"
                                "  - {kind: leap_second, from_s: 0.5}\n",
                                NULL, sets, 1);
    int n = 0;
    while (rig->next < 7700) {
        assert_true(rig_claim(rig));
        const struct native_event *pps = rig_event(rig, NATIVE_EV_PPS);
        if (pps == NULL) continue;
        assert_true(n < 5);
        assert_string_equal(pps->text, want[n].utc);
        assert_true((int64_t)pps->b == want[n].at_ns && rig->work.tick == (uint64_t)want[n].at_ns / TICK_NS);
        n++;
    }
    assert_int_equal(n, 5);
    assert_string_equal(rig_tell(rig, "TIME:UTC?", 6000), "2026-06-30T11:59:60.700300000Z");
    assert_true(device_date_ns(rig->device, 5100300000) == device_date_ns(rig->device, 6350399999));
    rig_close(rig);
}

/* The fault's window is right to the nanosecond, within a tick. The second that begins with the fault is lost, and the
 * one at its end is reported. */
static void loses_pps_up_to_the_end(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.epoch=2026-06-30T11:59:55.2995Z"};
    struct rig *rig = open_with("  - {kind: pps_lost, from_s: 0.7005, until_s: 2.7005}\n", NULL, sets, 1);
    const struct native_event *pps = rig_wait(rig, NATIVE_EV_PPS, 3000);
    assert_true(pps->b == 2700500000);
    rig_close(rig);
}

/* A drift that a command clears is over. The head then stays ahead by the time that it gained. */
static void drifts_until_it_is_cleared(void **state)
{
    (void)state;
    static const char *const sets[] = {"time.epoch=2026-01-01T00:00:00Z"};
    struct rig *rig = rig_open(NULL, sets, 1);
    rig_go_to(rig, 1000);
    assert_string_equal(rig_tell(rig, "FAULt:ADD {kind: clock_drift, from_s: 0.5, ppm: 1000}", 1000), "1");
    rig_go_to(rig, 2500);
    rig_tell(rig, "FAULt:CLEar 1", 2500);
    rig_go_to(rig, 4000);
    assert_string_equal(rig_tell(rig, "TIME:UTC?", 1500), "2026-01-01T00:00:01.500000000Z");
    assert_string_equal(rig_tell(rig, "TIME:UTC?", 2000), "2026-01-01T00:00:02.000500000Z");
    assert_string_equal(rig_tell(rig, "TIME:UTC?", 3500), "2026-01-01T00:00:03.501000000Z");
    rig_close(rig);
}

/* A journal has the command, and replaying it does the same at the same tick. In real time a journal is read through
 * before it is replayed. */
static void is_replayed(void **state)
{
    (void)state;
    static const char *const realtime[] = {"loop.pace=realtime"};
    uint64_t off_tick = 0;
    for (int replays = 0; replays < 3; replays++) {
        struct device_options options = {.journal = replays ? NULL : journal_path,
                                         .replay = replays ? journal_path : NULL};
        struct rig *rig = rig_open(&options, realtime, replays == 2);
        rig_go_to(rig, 777);
        if (!replays) rig_tell(rig, "FAULt:ADD {kind: power_cycle, from_s: 0.2, for_ms: 3}", 770);
        while (rig->work.power != DEVICE_POWER_GOES)
            assert_true(rig_claim(rig));
        if (!replays) off_tick = rig->work.tick;
        assert_int_equal(off_tick, 977);
        assert_int_equal(rig->work.tick, off_tick);
        assert_int_equal(fault_board_injected(device_faults(rig->device), 0), 1);
        rig_close(rig);
    }
}

/* HEAD:REBoot: power goes with the next tick and comes with the one after it, in a scan and in the state fault. The
 * journal has it. */
static void reboots_by_command(void **state)
{
    (void)state;
    for (int replays = 0; replays < 2; replays++) {
        const struct device_options options = {.journal = replays ? NULL : journal_path,
                                               .replay = replays ? journal_path : NULL};
        struct rig *rig = rig_open(&options, NULL, 0);
        rig_go_to(rig, 300);
        assert_int_equal(device_last_power(rig->device, INT64_MAX).t_ns, 0);
        if (!replays) rig_tell(rig, "HEAD:PRR 100000", 300);
        if (!replays) rig_tell(rig, "SCAN:START", 300);
        rig_go_to(rig, 500);
        assert_true(rig->work.scanning && rig->work.scan == 1 && rig->work.station_scan == 1);
        if (!replays) assert_string_equal(rig_tell(rig, "HEAD:REBOOT", 495), "OK");
        assert_true(rig_claim(rig));
        assert_true(rig->work.power == DEVICE_POWER_GOES && rig->work.tick == 500 && !rig->work.scanning);
        assert_true(rig_claim(rig));
        assert_true(rig->work.power == DEVICE_POWER_COMES);
        assert_int_equal(device_last_power(rig->device, INT64_MAX).t_ns, 501 * TICK_NS);
        assert_int_equal(next_state(rig, "idle"), 501 + BOOT_TICKS);
        assert_string_equal(rig_tell(rig, "HEAD:PRR?", rig->next), "300000");
        assert_string_equal(rig_tell(rig, "SYST:CONT?", rig->next), "0");
        /* The scan's number goes on. Its noise is that of the station's first scan since power-up. */
        if (!replays) rig_tell(rig, "SCAN:START", rig->next);
        rig_go_to(rig, rig->next + 200);
        assert_true(rig->work.scanning && rig->work.scan == 2 && rig->work.station_scan == 1);
        rig_close(rig);
    }
    struct rig *rig = open_with("  - {kind: self_test, until_s: 0.3}\n", NULL, NULL, 0);
    struct command_result result;
    next_state(rig, "boot");
    next_state(rig, "fault");
    device_command(rig->device, 1, "SYST:CONT:TAKE", rig->next, &result);
    rig_go_to(rig, 250);
    device_command(rig->device, 2, "HEAD:REBOOT", rig->next, &result);
    assert_int_equal(result.error, 0);
    assert_int_equal(next_state(rig, "off"), 250);
    assert_int_equal(next_state(rig, "boot"), 251);
    assert_int_equal(next_state(rig, "idle"), 251 + BOOT_TICKS);
    rig_close(rig);
}

static void counts_from_near_the_wrap(void **state)
{
    (void)state;
    struct rig *rig =
        open_with("  - {kind: counters_high, n: 40, until_s: 0.5}\n  - {kind: power_cycle, from_s: 1, for_ms: 5}\n",
                  NULL, NULL, 0);
    assert_int_equal(device_last_power(rig->device, INT64_MAX).near_wrap, 40);
    rig_go_to(rig, 1000);
    assert_int_equal(device_last_power(rig->device, INT64_MAX).near_wrap, 40);
    rig_go_to(rig, 1010);
    assert_int_equal(device_last_power(rig->device, INT64_MAX).near_wrap, 0);
    assert_string_equal(rig_tell(rig, "FAULt:INJected? 1", rig->next), "1");
    rig_close(rig);
}

static void needs_a_time_of_day(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    static const char *const kinds[] = {"clock_jump", "clock_drift", "clock_stop", "pps_lost", "leap_second"};
    for (int i = 0; i < 5; i++) {
        char line[64];
        struct command_result result;
        snprintf(line, sizeof line, "FAULt:ADD {kind: %s}", kinds[i]);
        device_command(rig->device, 1, line, 0, &result);
        assert_true(result.error != 0);
        assert_non_null(strstr(result.reply, "time.epoch"));
    }
    rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(boots_slowly),
        cmocka_unit_test(fails_the_self_test),
        cmocka_unit_test(ends_a_run_that_cannot_scan),
        cmocka_unit_test(ends_a_run_after_its_duration),
        cmocka_unit_test(loses_power),
        cmocka_unit_test(ends_without_power),
        cmocka_unit_test(loses_power_as_it_comes),
        cmocka_unit_test(loses_power_at_a_pulse),
        cmocka_unit_test(tells_a_wrong_time),
        cmocka_unit_test(loses_pps_up_to_the_end),
        cmocka_unit_test(drifts_until_it_is_cleared),
        cmocka_unit_test(is_replayed),
        cmocka_unit_test(reboots_by_command),
        cmocka_unit_test(counts_from_near_the_wrap),
        cmocka_unit_test(needs_a_time_of_day),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
