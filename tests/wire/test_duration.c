/* SPDX-License-Identifier: MIT */
/* --duration of `record` off line, and of `run --start` or head.start. Both durations are device time. */
#include "tests/wire/room.h"

/* A frame takes 0.4 s. */
static const struct room_config FRAME = {.prr_hz = 400000.7,
                                         .lines_hz = 97,
                                         .pan_deg_s = 90,
                                         .pan_stop_deg = 36,
                                         .frames = 1,
                                         .links = "links: [{type: null}]\n"};

static uint64_t pulses_before(const struct oracle *oracle, int64_t t_ns)
{
    uint64_t k = 0;
    while (oracle_time_ns(oracle, k) < t_ns)
        k++;
    return k;
}

/* Off line --duration is device time, to the pulse: there are the same pulses and the same hash each time. */
static void test_duration_is_device_time(void **state)
{
    static const char *const threads[] = {"1", "2", "3", "2"};
    struct wire *wire = *state;
    struct oracle oracle = oracle_of(&FRAME, -40, 60, 100);
    char path[352], stats[352], first[65], other[65];
    const uint64_t fired = pulses_before(&oracle, 250000000);
    room_write(wire);
    snprintf(path, sizeof path, "%s", room_config_write(wire, &FRAME));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    for (size_t i = 0; i < sizeof threads / sizeof *threads; i++) {
        const char *const args[] = {"record", path,        "--duration", "0.25",    "--stats",
                                    stats,    "--threads", threads[i],   "--quiet", NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
        assert_int_equal(stats_uint(wire, "fired_pulses"), fired);
        assert_int_equal(stats_uint(wire, "pulses"), oracle_count_cast(&oracle, 0, fired));
        assert_int_equal(stats_uint(wire, "cast_pulses"), stats_uint(wire, "pulses"));
        stats_hash(wire, i == 0 ? first : other);
        if (i != 0) assert_string_equal(other, first);
    }
}

/* Returns the pulses of a run, and its output. */
static uint64_t run(struct wire *wire, const char *const *more, char *said, size_t len)
{
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &FRAME), more);
    head_end(&head, 0);
    char *text = wire_read(wire_path(wire, "head.err"), NULL);
    snprintf(said, len, "%s", text);
    free(text);
    return stats_uint(wire, "fired_pulses");
}

/* A head that has one frame to scan goes on, frame after frame, until the time is over. */
static void test_run_scans_until_the_time_is_over(void **state)
{
    static const char *const more[] = {"--start", "--pace", "fast", "--duration", "1", NULL};
    struct oracle oracle = oracle_of(&FRAME, -40, 60, 100);
    char said[4096];
    assert_int_equal(run(*state, more, said, sizeof said), pulses_before(&oracle, 1000000000));
    assert_int_equal(stats_uint(*state, "scans"), 1);
    assert_null(strstr(said, "was over"));
}

/* Exactly the frames that the user asked for are scanned, and the head says so. */
static void test_frames_end_it_before(void **state)
{
    static const char *const frames[] = {"--start", "--pace", "fast", "--duration", "1", "--frames", "2", NULL};
    static const char *const set[] = {"--start", "--pace", "fast", "--duration", "1", "--set", "head.frames=2", NULL};
    struct room_config two = FRAME;
    two.frames = 2;
    struct oracle oracle = oracle_of(&two, -40, 60, 100);
    char said[4096];
    for (int i = 0; i < 2; i++) {
        assert_int_equal(run(*state, i == 0 ? frames : set, said, sizeof said), oracle_end(&oracle));
        assert_non_null(strstr(said, "before --duration 1: all its frames were scanned"));
    }
}

/* head.start: on is --start: the pulses are the same, with --duration and with --frames. A head without either scans
 * nothing. */
static void test_the_key_is_the_option(void **state)
{
    static const char *const runs[][9] = {
        {"--pace", "fast", "--duration", "0.7", "--start"},
        {"--pace", "fast", "--duration", "0.7", "--set", "head.start=on"},
        {"--pace", "fast", "--frames", "2", "--start"},
        {"--pace", "fast", "--frames", "2", "--set", "head.start=on"},
        {"--pace", "fast", "--duration", "0.7"},
    };
    char said[4096], hash[5][65];
    uint64_t fired[5];
    for (int i = 0; i < 5; i++) {
        fired[i] = run(*state, runs[i], said, sizeof said);
        stats_hash(*state, hash[i]);
    }
    assert_int_equal(fired[0], fired[1]);
    assert_string_equal(hash[0], hash[1]);
    assert_int_equal(fired[2], fired[3]);
    assert_string_equal(hash[2], hash[3]);
    assert_true(fired[0] != fired[2]);
    assert_int_equal(fired[4], 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_duration_is_device_time, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_run_scans_until_the_time_is_over, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_frames_end_it_before, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_the_key_is_the_option, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("duration", tests, NULL, NULL);
}
