/* SPDX-License-Identifier: MIT */
/* The head's memory follows its settings. Slots have room for usual ticks of the settings at power-up, and grow when a
 * command sets more. The stream is the same as from a head that was set to more from the start. */
#include "tests/wire/room.h"

/* The head scans for a second at slow rates, at the profile's fastest, at slow ones, and at the fastest again. The
 * start is at slow rates in any configuration. */
static const char JOURNAL[] = "# scanhead journal 1\n"
                              "300 300000000 1 HEAD:PRR 20000\n"
                              "300 300000000 1 HEAD:LINES 20\n"
                              "300 300000000 1 SCAN:START\n"
                              "600 600000000 1 HEAD:PRR MAX\n"
                              "600 600000000 1 HEAD:LINES MAX\n"
                              "900 900000000 1 HEAD:PRR 20000\n"
                              "900 900000000 1 HEAD:LINES 20\n"
                              "1100 1100000000 1 HEAD:PRR MAX\n"
                              "1300 1300000000 1 SCAN:STOP\n";

static struct room_config at_rates(double prr_hz, double lines_hz, const char *loop)
{
    return (struct room_config){.prr_hz = prr_hz,
                                .lines_hz = lines_hz,
                                .pan_deg_s = 90,
                                .pan_stop_deg = 360,
                                .links = LINK_YAML_TCP,
                                .more = loop};
}

struct result {
    char head[65], client[65];
    uint64_t pulses, rss_kib;
};

static void replay(struct wire *wire, const struct room_config *config, const char *pace, struct result *result)
{
    char journal[352], path[352];
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    snprintf(journal, sizeof journal, "%s", wire_write_text(wire, "journal", JOURNAL));
    snprintf(path, sizeof path, "%s", room_config_write(wire, config));
    const char *const more[] = {"--pace", pace, "--replay-journal", journal, "--duration", "1.5", NULL};
    struct head head = head_start(wire, path, more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    scanhead_hash_start(sh);
    while (scanhead_next(sh, &frame, DEADLINE_MS) == SCANHEAD_OK)
        continue;
    scanhead_get_stats(sh, &stats);
    scanhead_hash_hex(sh, result->client);
    scanhead_close(sh);
    head_end(&head, 0);
    assert_int_equal(stats.bad_payload + stats.bad_bytes + stats.seq_lost + stats.dropped, 0);
    assert_int_equal(stats_uint(wire, "lost_pulses"), 0);
    assert_int_equal(stats_uint(wire, "reader_lost_frames"), 0);
    stats_hash(wire, result->head);
    result->pulses = stats_uint(wire, "pulses");
    result->rss_kib = stats_uint(wire, "rss_peak_kib");
}

static void check_grows(struct wire *wire, const char *pace, const char *loop)
{
    struct result grown, from_start;
    struct room_config slow = at_rates(20000, 20, loop), fast = at_rates(2200000, 1000, loop);
    room_write(wire);
    replay(wire, &slow, pace, &grown);
    replay(wire, &fast, pace, &from_start);
    assert_true(grown.pulses > 500000); /* half a second at 2.2 MHz, of which most are cast */
    assert_int_equal(grown.pulses, from_start.pulses);
    assert_string_equal(grown.head, from_start.head);
    if (strcmp(pace, "realtime") == 0) assert_string_equal(grown.client, grown.head);
}

/* The queue of 20 ms goes round many times, and each slot grows. */
static void test_slots_grow_at_the_pace_fast(void **state)
{
    check_grows(*state, "fast", "loop: {queue_ms: 20}\n");
}

static void test_slots_grow_in_real_time(void **state)
{
    check_grows(*state, "realtime", "loop: {queue_ms: 5000, late_ms: 10000}\n");
}

/* A queue of 4 s at 20 kHz and 1 kHz ticks is 4,251 slots of 1.1 KB at most, 5 MB. A head needs 105 MB, with libraries
 * (Embree's alone are 40 MB, locked as a whole), the scene and casters' memory. Slots for 2.2 MHz would need 190 MB
 * more, and 4,251 of them at 15 echoes a pulse far more. */
static void test_a_slow_head_is_small(void **state)
{
    struct wire *wire = *state;
    struct room_config slow = at_rates(20000, 20, "loop: {queue_ms: 4000}\n");
    room_write(wire);
    /* The station's visibility map has a limit of its own, cast.sight_mib. */
    const char *const more[] = {"--start", "--duration", "0.5", "--set", "cast.sight=off", NULL};
    struct head head = head_start(wire, room_config_write(wire, &slow), more);
    head_end(&head, 0);
    print_message("# %u KiB\n", (unsigned)stats_uint(wire, "rss_peak_kib"));
    assert_in_range(stats_uint(wire, "rss_peak_kib"), 1, 160 << 10);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_slots_grow_at_the_pace_fast, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_slots_grow_in_real_time, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_slow_head_is_small, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
