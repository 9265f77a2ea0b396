/* SPDX-License-Identifier: MIT */
/* Faults of the head's states, power, time and counters, as a client of the program sees them. --truth has the same
 * counts and times. Most tests run in the pace step, where nothing depends on when a client connects. */
#include "tests/wire/room.h"

#define SECOND_NS INT64_C(1000000000)

static struct room_config config_of(const char *more)
{
    return (struct room_config){.prr_hz = 20000,
                                .lines_hz = 50,
                                .pan_deg_s = 60,
                                .pan_stop_deg = 120,
                                .frames = 1,
                                .links = LINK_YAML_BOTH,
                                .more = more};
}

static const char *write_config(struct wire *wire, const char *more)
{
    const struct room_config config = config_of(more);
    room_write(wire);
    return room_config_write(wire, &config);
}

static struct head start(struct wire *wire, const char *more, const char *pace)
{
    char truth[352];
    snprintf(truth, sizeof truth, "%s", wire_path(wire, "truth.json"));
    const char *const args[] = {"--pace", pace, "--truth", truth, NULL};
    unlink(truth);
    return head_start(wire, write_config(wire, more), args);
}

struct sought {
    const char *kind, *key;
    int ended;
};

/* -1: there is none. */
static int64_t value_in(const char *text, const struct sought *sought)
{
    char name[64], is_kind[64], line[512];
    int64_t value = -1;
    snprintf(name, sizeof name, "\"%s\":", sought->key);
    snprintf(is_kind, sizeof is_kind, "\"kind\":\"%s\"", sought->kind);
    for (const char *end; (end = strchr(text, '\n')) != NULL; text = end + 1) {
        snprintf(line, sizeof line, "%.*s", (int)(end - text), text);
        if (strstr(line, is_kind) == NULL || (strstr(line, "\"ended\":true") != NULL) != sought->ended) continue;
        const char *at = strstr(line, name);
        if (at != NULL) value = atoll(at + strlen(name));
    }
    return value;
}

static int has_value(const char *text, const void *sought)
{
    return value_in(text, sought) >= 0;
}

/* Returns the value of a key in the line of the truth about this kind. With `ended` it is the line about its end. */
static int64_t truth_of(const struct wire *wire, const char *kind, int ended, const char *key)
{
    const struct sought sought = {kind, key, ended};
    char *text = wire_read_with(wire_path(wire, "truth.json"), has_value, &sought);
    const int64_t value = value_in(text, &sought);
    free(text);
    return value;
}

static void step(struct scanhead *sh, int ms)
{
    char line[32];
    snprintf(line, sizeof line, "TIME:STEP %d MS", ms);
    client_tell(sh, line);
}

/* Returns the device time of the STATE event with this text among the frames so far; -1: there is none. */
static int64_t state_at(struct scanhead *sh, const char *name)
{
    struct scanhead_frame frame;
    int64_t t_ns = -1;
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK)
        if (is_event(&frame, SCANHEAD_EV_STATE) && strcmp(frame.event_text, name) == 0) t_ns = frame.t_ns;
    return t_ns;
}

static void test_boot(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "faults: [{kind: slow_boot, for_ms: 700}]\n", "step");
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    step(sh, 1000);
    assert_int_equal(state_at(sh, "idle"), 900000000); /* 0.2 s of the profile, and 0.7 s */
    assert_int_equal(truth_of(wire, "slow_boot", 0, "t_ns"), 0);
    assert_int_equal(truth_of(wire, "slow_boot", 1, "t_ns"), 900000000);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

static void test_self_test(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "faults: [{kind: self_test}]\n", "step");
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    step(sh, 1000);
    assert_int_equal(state_at(sh, "fault"), truth_of(wire, "self_test", 0, "t_ns"));
    assert_non_null(strstr(client_ask(sh, "SCAN:START"), "self-test failed"));
    assert_non_null(strstr(client_ask(sh, "SYST:ERR?"), "-330,\"Self-test failed"));
    client_tell(sh, "*RST");
    client_tell(sh, "SCAN:START");
    step(sh, 100);
    assert_true(state_at(sh, "scanning") >= SECOND_NS);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* The times of PPS events. */
struct edges {
    int n;
    int64_t utc_s[32], t_ns[32], gps_s[32];
    char text[32][32];
};

static void take_edges(struct scanhead *sh, struct edges *e)
{
    struct scanhead_frame frame;
    e->n = 0;
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        if (!is_event(&frame, SCANHEAD_EV_PPS)) continue;
        assert_true(e->n < 32);
        e->utc_s[e->n] = (int64_t)frame.event_value[0];
        e->t_ns[e->n] = (int64_t)frame.event_value[1];
        e->gps_s[e->n] = (int64_t)frame.event_value[2];
        snprintf(e->text[e->n], sizeof e->text[0], "%.31s", frame.event_text);
        e->n++;
    }
}

/* Steps over `seconds` with these faults, and keeps the PPS events. */
static void run_clock(struct wire *wire, const char *faults, int seconds, struct edges *e)
{
    char more[512];
    snprintf(more, sizeof more, "time: {epoch: 2026-03-31T23:59:54.5Z}\nfaults: %s\n", faults);
    struct head head = start(wire, more, "step");
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    for (int i = 0; i < seconds; i++)
        step(sh, 1000);
    take_edges(sh, e);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

static void test_pps_lost(void **state)
{
    struct wire *wire = *state;
    struct edges e;
    run_clock(wire, "[{kind: pps_lost, from_s: 2.5, until_s: 5.5}]", 8, &e);
    const int64_t from_ns = truth_of(wire, "pps_lost", 0, "t_ns"), until_ns = truth_of(wire, "pps_lost", 1, "t_ns");
    assert_true(from_ns == 2500000000 && until_ns == 5500000000);
    int64_t missing = 0;
    assert_true(e.t_ns[0] == 500000000 && e.t_ns[e.n - 1] == 7500000000);
    for (int i = 1; i < e.n; i++) {
        missing += e.utc_s[i] - e.utc_s[i - 1] - 1;
        assert_int_equal(e.t_ns[i] - e.t_ns[0], (e.utc_s[i] - e.utc_s[0]) * SECOND_NS);
        assert_true(e.t_ns[i] < from_ns || e.t_ns[i] >= until_ns);
    }
    assert_int_equal(missing, 3);
    assert_int_equal(truth_of(wire, "pps_lost", 1, "n"), missing);
}

/* Returns the change of the head's clock error from the first edge to edge i. */
static int64_t error_ns(const struct edges *e, int i)
{
    return (e->gps_s[i] - e->gps_s[0]) * SECOND_NS - (e->t_ns[i] - e->t_ns[0]);
}

static void test_clock(void **state)
{
    struct wire *wire = *state;
    struct edges e;
    /* The clock jumps ahead by 2.25 s. */
    run_clock(wire, "[{kind: clock_jump, from_s: 3.1, jump_s: 2.25}]", 6, &e);
    const int64_t jump_ns = truth_of(wire, "clock_jump", 0, "t_ns");
    assert_true(jump_ns == 3100000000 && e.n == 6);
    for (int i = 0; i < e.n; i++)
        assert_int_equal(error_ns(&e, i), e.t_ns[i] < jump_ns ? 0 : 2250000000);
    /* 100 ppm for 2 s are 200 us. An edge is the second's first whole nanosecond, so it is less than 1 ns late. */
    run_clock(wire, "[{kind: clock_drift, from_s: 1, until_s: 3, ppm: 100}]", 6, &e);
    const int64_t from_ns = truth_of(wire, "clock_drift", 0, "t_ns"),
                  until_ns = truth_of(wire, "clock_drift", 1, "t_ns");
    for (int i = 0; i < e.n; i++) {
        const int64_t end_ns = e.t_ns[i] < until_ns ? e.t_ns[i] : until_ns;
        const int64_t gained_ns = end_ns > from_ns ? (end_ns - from_ns) / 10000 : 0;
        assert_true(llabs(error_ns(&e, i) - gained_ns) <= 1);
    }
    assert_true(e.n == 6 && until_ns - from_ns == 2 * SECOND_NS);
    /* The clock stands for 1.75 s. */
    run_clock(wire, "[{kind: clock_stop, from_s: 1.9, until_s: 3.65}]", 7, &e);
    for (int i = 0; i < e.n; i++)
        assert_int_equal(error_ns(&e, i), e.t_ns[i] < 1900000000 ? 0 : -1750000000);
    assert_true(e.n == 5 &&
                truth_of(wire, "clock_stop", 1, "t_ns") - truth_of(wire, "clock_stop", 0, "t_ns") == 1750000000);
}

/* The minute ends at 5.5 s. GPS time goes on, and UTC has one more second. */
static void test_leap_second(void **state)
{
    struct wire *wire = *state;
    struct edges e;
    run_clock(wire, "[{kind: leap_second, from_s: 1}]", 9, &e);
    assert_int_equal(truth_of(wire, "leap_second", 0, "t_ns"), SECOND_NS);
    assert_int_equal(e.n, 9);
    for (int i = 0; i < e.n; i++) {
        assert_int_equal(error_ns(&e, i), 0);
        assert_int_equal(e.utc_s[i] - e.utc_s[0], i <= 5 ? i : i - 1);
    }
    assert_string_equal(e.text[4], "2026-03-31T23:59:59Z");
    assert_string_equal(e.text[5], "2026-03-31T23:59:60Z");
    assert_string_equal(e.text[6], "2026-04-01T00:00:00Z");
}

/* Sequence numbers go through their wrap, and no reader finds a gap. */
static void test_wrap(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "faults: [{kind: counters_high, n: 200}]\n", "step");
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    step(sh, 300);
    client_next(sh, &frame);
    assert_int_equal(frame.seq, UINT32_MAX - 199);
    assert_int_equal(truth_of(wire, "counters_high", 0, "n"), 200);
    uint32_t seq = frame.seq;
    client_tell(sh, "SCAN:START");
    step(sh, 1000);
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        assert_int_equal(frame.seq, seq + 1);
        seq = frame.seq;
    }
    assert_in_range(seq, 300, 100000); /* a frame a tick, at least */
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.seq_gaps + stats.seq_lost + stats.reader_lost + stats.bad_payload + stats.bad_bytes, 0);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    assert_int_equal(stats_uint(wire, "reader_lost_frames"), 0);
}

/* Takes frames until the head hangs up. Returns the device time of the last points, and writes the pulse after them. */
static int64_t until_hung_up(struct scanhead *sh, uint64_t *pulse_end, int *ends)
{
    struct scanhead_frame frame;
    int64_t t_ns = -1;
    int rc;
    while ((rc = scanhead_next(sh, &frame, DEADLINE_MS)) == SCANHEAD_OK) {
        if (frame.type == SCANHEAD_POINTS) {
            t_ns = frame.t_ns;
            *pulse_end = frame.pulse0 + frame.n_pulses;
        }
        *ends += is_event(&frame, SCANHEAD_EV_SCAN_END) || is_event(&frame, SCANHEAD_EV_STATE);
    }
    if (rc != SCANHEAD_ECLOSED && rc != SCANHEAD_ELOST) fail_msg("%s", scanhead_error(sh));
    return t_ns;
}

/* In steps power goes at an exact tick. A step that goes beyond that tick is not answered, and its time passes all
 * the same. */
static void test_power_cycle_in_steps(void **state)
{
    struct wire *wire = *state;
    struct head head = start(wire, "faults: [{kind: power_cycle, from_s: 2, for_ms: 1500}]\n", "step");
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    char reply[64];
    uint64_t pulse_end = 0;
    int ends = 0;
    step(sh, 300);
    client_tell(sh, "HEAD:PRR 30000");
    client_tell(sh, "SCAN:START");
    step(sh, 1000);
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK)
        continue;
    assert_int_not_equal(scanhead_command(sh, "TIME:STEP 1200 MS", reply, sizeof reply, DEADLINE_MS), SCANHEAD_OK);
    const int64_t last_ns = until_hung_up(sh, &pulse_end, &ends);
    assert_true(ends == 0 && last_ns < 2000000000);
    assert_int_equal(scanhead_reattach(sh, DEADLINE_MS), SCANHEAD_OK);
    while (atoll(client_ask(sh, "TIME?")) < 2500000000) /* the granted time passes */
        continue;
    assert_string_equal(client_ask(sh, "HEAD:STATE?"), "off");
    assert_non_null(strstr(client_ask(sh, "SCAN:START"), "ERR -221"));
    step(sh, 1100); /* up to 3.6 s */
    assert_int_equal(state_at(sh, "boot"), 3500000000);
    step(sh, 200);
    assert_int_equal(state_at(sh, "idle"), 3700000000);
    assert_int_equal(truth_of(wire, "power_cycle", 0, "t_ns"), 2000000000);
    assert_int_equal(truth_of(wire, "power_cycle", 1, "t_ns"), 3500000000);
    /* The scan began at 330 ms: 50,100 pulses at 30 kHz, 600 a line, which are cut at packets of 16 from each line's
     * start. Frames on their way are lost with the connection. */
    const uint64_t pulse = (uint64_t)truth_of(wire, "power_cycle", 0, "pulse");
    assert_true(pulse == 83 * 600 + 300 / 16 * 16 && pulse_end <= pulse);
    assert_string_equal(client_ask(sh, "HEAD:PRR?"), "20000");
    assert_string_equal(client_ask(sh, "SYST:ERR:COUN?"), "0");
    client_tell(sh, "SCAN:START");
    step(sh, 300);
    assert_true(state_at(sh, "scanning") > 3700000000);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* In real time, and as fast as it computes, the client is hung up. The client comes back and finds the head idle with
 * an empty queue. */
static void power_cycle_at(struct wire *wire, const char *pace, const char *link)
{
    struct head head = start(wire,
                             "loop: {queue_ms: 10000, late_ms: 10000}\n"
                             "faults: [{kind: power_cycle, from_pulse: 8000, for_ms: 300}]\n",
                             pace);
    struct scanhead *sh = client_open(head_endpoint(&head, link));
    struct scanhead_frame frame;
    uint64_t pulse_end = 0;
    int ends = 0, rc;
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:START");
    while ((rc = scanhead_next(sh, &frame, DEADLINE_MS)) == SCANHEAD_OK && !is_event(&frame, SCANHEAD_EV_SCAN_START))
        continue;
    /* A client that is late is hung up before it has read that. Such a client loses all that it has not read. */
    if (rc != SCANHEAD_OK && rc != SCANHEAD_ECLOSED) fail_msg("%s", scanhead_error(sh));
    ends = -1; /* for the state `scanning` */
    const int64_t last_ns = until_hung_up(sh, &pulse_end, &ends);
    assert_true(ends <= 0);
    while (scanhead_reattach(sh, DEADLINE_MS) != SCANHEAD_OK)
        continue;
    const int64_t off_ns = truth_of(wire, "power_cycle", 0, "t_ns");
    assert_true(last_ns < off_ns);
    const int64_t pulse = truth_of(wire, "power_cycle", 0, "pulse");
    assert_true(pulse >= 8000 && pulse < 8000 + 20 + 16 && pulse_end <= (uint64_t)pulse);
    client_wait_state(sh, "idle");
    assert_string_equal(client_ask(sh, "SYST:ERR:COUN?"), "0");
    client_tell(sh, "SCAN:START");
    client_until(sh, SCANHEAD_EV_SCAN_END, &(struct scanhead_frame){0}); /* the fault came once */
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

static void test_power_cycle(void **state)
{
    power_cycle_at(*state, "fast", "tcp");
    power_cycle_at(*state, "realtime", "tcp");
    power_cycle_at(*state, "realtime", "pty");
}

/* The same faults give the same stream at any pace, with any number of threads. Off line, a power cycle is the end. */
static void test_same_stream(void **state)
{
    struct wire *wire = *state;
    static const char more[] = "time: {epoch: 2026-03-31T23:59:54.5Z}\n"
                               "loop: {queue_ms: 10000, late_ms: 10000}\n"
                               "faults:\n"
                               "  - {kind: slow_boot, for_ms: 33}\n"
                               "  - {kind: counters_high, n: 50}\n"
                               "  - {kind: power_cycle, from_pulse: 5000, for_ms: 120}\n"
                               "  - {kind: clock_drift, ppm: 50}\n"
                               "  - {kind: pps_lost}\n";
    static const char *const runs[][2] = {{"fast", "1"}, {"fast", "3"}, {"realtime", "2"}};
    char hash[3][65], stats[352], config[352];
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    snprintf(config, sizeof config, "%s", write_config(wire, more));
    for (int i = 0; i < 3; i++) { /* scans again after the power cycle */
        const char *const args[] = {"--start", "--frames", "1", "--pace", runs[i][0], "--threads", runs[i][1], NULL};
        struct head head = head_start(wire, config, args);
        head_end(&head, 0);
        stats_hash(wire, hash[i]);
        assert_string_equal(hash[i], hash[0]);
        assert_true(stats_uint(wire, "pulses") > 5000 + 40000); /* 2 s at 20 kHz, and what was before */
    }
    for (int i = 0; i < 3; i++) { /* off line the recorder gives up, with what there is */
        const char *const args[] = {"record", config, "--stats", stats, "--quiet", "--threads", runs[i][1], NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "head.out", "head.err", -1)), 1);
        char *err = wire_read(wire_path(wire, "head.err"), NULL);
        assert_non_null(strstr(err, "the head lost power"));
        free(err);
    }
}

/* A file goes on over a power cycle that is longer than the queue, and loses nothing. */
static void test_file_goes_on(void **state)
{
    struct wire *wire = *state;
    struct room_config config = config_of("loop: {queue_ms: 250, late_ms: 10000}\n"
                                          "faults: [{kind: power_cycle, from_pulse: 2000, for_ms: 600}]\n");
    const char *const more[] = {"--start", "--frames", "1", NULL};
    room_write(wire);
    config.links = "links: [{type: file, path: out.shs}]\n";
    config.pan_stop_deg = 30;
    struct head head = head_start(wire, room_config_write(wire, &config), more);
    head_end(&head, 0);
    assert_int_equal(stats_link_uint(wire, "left_out_frames"), 0);
    struct scanhead *sh = client_open(wire_path(wire, "out.shs"));
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    char states[128] = "";
    int rc;
    while ((rc = scanhead_next(sh, &frame, DEADLINE_MS)) == SCANHEAD_OK)
        if (is_event(&frame, SCANHEAD_EV_STATE)) strcat(strcat(states, frame.event_text), " ");
    assert_int_equal(rc, SCANHEAD_ECLOSED);
    scanhead_get_stats(sh, &stats);
    scanhead_close(sh);
    assert_int_equal(stats.seq_gaps, 0);
    assert_string_equal(states, "boot idle spin-up scanning off boot idle spin-up scanning spin-down ");
}

/* A leap second is refused where the head has no time of day. */
static void test_needs_time(void **state)
{
    struct wire *wire = *state;
    const char *const args[] = {"check", write_config(wire, "faults: [{kind: leap_second}]\n"), NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "head.out", "head.err", -1)), 2);
    char *err = wire_read(wire_path(wire, "head.err"), NULL);
    assert_non_null(strstr(err, "leap_second needs a time of day; allowed where time.epoch is not none"));
    free(err);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_boot, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_self_test, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_pps_lost, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_clock, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_leap_second, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_wrap, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_power_cycle_in_steps, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_power_cycle, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_same_stream, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_file_goes_on, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_needs_time, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
