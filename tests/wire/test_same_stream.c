/* SPDX-License-Identifier: MIT */
/* stream_sha256 is the same for every pace, number of threads and link, by the head, by a client and by `record` off
 * line. A journal brings back a whole session. */
#include "tests/wire/room.h"

static const struct room_config SHORT = {.profile = "any-rate",
                                         .prr_hz = 399999.9,
                                         .lines_hz = 97.7,
                                         .pan_deg_s = 150,
                                         .pan_stop_deg = 60,
                                         .frames = 1,
                                         .links = LINK_YAML_BOTH,
                                         .more = "loop: {queue_ms: 10000, late_ms: 10000}\n"};

/* The results of a session: the hash of the head and of the client, and the scan's counts. */
struct result {
    char head[65], client[65];
    uint64_t pulses, echoes;
};

static struct scanhead *listen_to(const struct head *head, const char *link)
{
    struct scanhead *sh = client_open(head_endpoint(head, link));
    scanhead_hash_start(sh);
    client_wait_state(sh, "idle");
    return sh;
}

static void finish(struct head *head, struct scanhead *sh, struct result *result)
{
    struct scanhead_stats stats;
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.bad_payload + stats.bad_bytes + stats.seq_lost + stats.dropped, 0);
    scanhead_hash_hex(sh, result->client);
    scanhead_close(sh);
    head_end(head, SIGTERM);
    stats_hash(head->wire, result->head);
    assert_string_equal(result->client, result->head);
    assert_int_equal(stats_uint(head->wire, "lost_pulses"), 0);
    result->pulses = stats_uint(head->wire, "pulses");
    result->echoes = stats_uint(head->wire, "echoes");
}

static void scan(struct wire *wire, const char *config, const char *pace, const char *threads, const char *link,
                 struct result *result)
{
    const char *const more[] = {"--pace", pace, "--threads", threads, NULL};
    struct head head = head_start(wire, config, more);
    struct scanhead *sh = listen_to(&head, link);
    struct scanhead_frame frame;
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    finish(&head, sh, result);
}

static void record(struct wire *wire, const char *config, const char *threads, const char *set, struct result *result)
{
    char stats[352];
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    const char *const args[] = {"record", config,    "--stats", stats, "--threads",
                                threads,  "--quiet", "--set",   set,   NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "head.out", "head.err", -1)), 0);
    stats_hash(wire, result->head);
    result->pulses = stats_uint(wire, "pulses");
    result->echoes = stats_uint(wire, "points");
}

static void test_pace_threads_link(void **state)
{
    static const struct {
        const char *pace, *threads, *link;
    } runs[] = {{"fast", "1", "tcp"},     {"fast", "2", "pty"},     {"realtime", "1", "pty"},
                {"realtime", "2", "tcp"}, {"realtime", "2", "pty"}, {"fast", "3", "tcp"}};
    struct wire *wire = *state;
    struct result first, other;
    char config[352];
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SHORT));
    record(wire, config, "2", "cast.sight=auto", &first);
    struct oracle oracle = oracle_of(&SHORT, -40, 60, 240);
    assert_int_equal(first.pulses, oracle_count_cast(&oracle, 0, oracle_end(&oracle)));
    for (size_t i = 0; i < sizeof runs / sizeof runs[0]; i++) {
        scan(wire, config, runs[i].pace, runs[i].threads, runs[i].link, &other);
        if (strcmp(first.head, other.head) != 0)
            fail_msg("%s, %s threads, %s: another stream", runs[i].pace, runs[i].threads, runs[i].link);
        assert_int_equal(first.pulses, other.pulses);
        assert_int_equal(first.echoes, other.echoes);
    }
    record(wire, config, "1", "cast.sight=auto", &other);
    assert_string_equal(first.head, other.head);
    for (int i = 0; i < 3; i++) { /* off line, without a sight, several lines are cast together */
        record(wire, config, i == 0 ? "1" : i == 1 ? "2" : "3", "cast.sight=off", &other);
        assert_string_equal(first.head, other.head);
        assert_int_equal(first.echoes, other.echoes);
    }
}

/* A tick of 80 kB is more than a pty or a socket takes at once. The rest of it goes out later, and no byte is lost. */
static void test_ticks_longer_than_a_pty(void **state)
{
    static const char *const links[] = {"pty", "tcp"};
    struct wire *wire = *state;
    struct room_config config = SHORT;
    struct result first, other;
    config.more = "loop: {tick_hz: 100, queue_ms: 10000, late_ms: 10000}\n";
    room_write(wire);
    char path[352];
    snprintf(path, sizeof path, "%s", room_config_write(wire, &config));
    record(wire, path, "1", "cast.sight=off", &first);
    for (int i = 0; i < 2; i++) {
        scan(wire, path, "fast", "1", links[i], &other);
        assert_string_equal(first.head, other.head);
        assert_int_equal(first.pulses, other.pulses);
    }
}

/* Different streams have different hashes: noise and its seed, layout and rate all change it. */
static void test_hash_tells_streams_apart(void **state)
{
    static const char *const sets[] = {"noise.seed=1", "noise.range=on", "output.layout=geo", "head.prr_hz=399999.8",
                                       "stations[0].position_m=[0.310001, -0.42, 0.17]"};
    struct wire *wire = *state;
    struct result result;
    char stats[352], config[352], seen[6][65];
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SHORT));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    for (int i = 0; i < 6; i++) {
        const char *set = i < 5 ? sets[i] : "noise.range=on", *seed = i < 5 ? "noise.seed=1" : "noise.seed=2";
        const char *const args[] = {"record", config, "--stats", stats, "--quiet", "--set", set, "--set", seed, NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "head.out", "head.err", -1)), 0);
        stats_hash(wire, result.head);
        strcpy(seen[i], result.head);
        for (int k = 0; k < i; k++)
            assert_string_not_equal(seen[i], seen[k]);
    }
}

/* A head that idles for longer than its queue still has a hash: that of no bytes, as sha256sum prints it. */
static void test_hash_of_an_idle_head(void **state)
{
    struct wire *wire = *state;
    char hash[65];
    room_write(wire);
    const char *const more[] = {"--duration", "1.1", "--set", "loop.queue_ms=50", NULL};
    struct head head = head_start(wire, room_config_write(wire, &SHORT), more);
    head_end(&head, 0);
    stats_hash(wire, hash);
    assert_string_equal(hash, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
}

static void expect_no_hash(const struct wire *wire)
{
    char *text = wire_read(wire_path(wire, "stats.json"), NULL);
    if (strstr(text, "\"stream_sha256\": null") == NULL) fail_msg("a hash, or no key for it, in %s", text);
    free(text);
    assert_true(stats_uint(wire, "pulses") > 0);
}

/* Figures without a hash. */
static void test_no_hash(void **state)
{
    struct wire *wire = *state;
    char stats[352], config[352];
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SHORT));
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    const char *const args[] = {"record", config, "--stats", stats, "--no-hash", "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "head.out", "head.err", -1)), 0);
    expect_no_hash(wire);
    const char *const more[] = {"--start", "--pace", "fast", "--duration", "0.3", "--no-hash", NULL};
    struct head head = head_start(wire, config, more);
    head_end(&head, 0);
    expect_no_hash(wire);
}

static void take_points(struct scanhead *sh, int frames)
{
    struct scanhead_frame frame;
    for (int n = 0; n < frames;) {
        client_next(sh, &frame);
        n += frame.type == SCANHEAD_POINTS;
    }
}

static void replay(struct wire *wire, const char *config, const char *journal, const char *pace, const char *threads,
                   struct result *result)
{
    const char *const more[] = {"--pace", pace, "--threads", threads, "--replay-journal", journal, NULL};
    struct head head = head_start(wire, config, more);
    head_end(&head, 0);
    stats_hash(wire, result->head);
    result->pulses = stats_uint(wire, "pulses");
    result->echoes = stats_uint(wire, "echoes");
}

/* A replayed session ends where the journal's session ended, within a scan, too. A head that was killed left no end. */
static void test_journal_ends_where_its_session_ended(void **state)
{
    struct wire *wire = *state;
    struct result live, again;
    struct room_config endless = SHORT;
    char config[352], journal[352];
    endless.frames = 0;
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &endless));
    snprintf(journal, sizeof journal, "%s", wire_path(wire, "session.journal"));
    const char *const more[] = {"--journal", journal, NULL};
    struct head head = head_start(wire, config, more);
    struct scanhead *sh = listen_to(&head, "tcp");
    client_tell(sh, "SCAN:STAR");
    take_points(sh, 20);
    scanhead_close(sh);
    head_end(&head, SIGTERM); /* the last tick is the clock's choice */
    stats_hash(wire, live.head);
    live.pulses = stats_uint(wire, "pulses");
    replay(wire, config, journal, "fast", "2", &again);
    assert_string_equal(again.head, live.head);
    assert_int_equal(again.pulses, live.pulses);
    char *text = wire_read(journal, NULL), *end = strstr(text, " 0 END\n");
    assert_non_null(end);
    while (end > text && end[-1] != '\n')
        end--;
    wire_write(wire, "killed.journal", text, (size_t)(end - text));
    free(text);
    const char *const killed[] = {"--replay-journal", wire_path(wire, "killed.journal"), NULL};
    head = head_start(wire, config, killed);
    head_end(&head, SIGTERM);
    char *said = wire_read(wire_path(wire, "head.err"), NULL);
    assert_non_null(strstr(said, "killed.journal has no end"));
    free(said);
}

/* The session runs in real time. Settings change in mid-scan, each at a moment that the clock chose. The first scan is
 * stopped, a second one runs to its end, and one command is refused. */
static void live_session(struct wire *wire, const char *config, const char *journal, struct result *result)
{
    static const char *const changes[] = {"HEAD:PRR 250000.5",      "HEAD:LIN 33.3",     "HEAD:PAN 77.7",
                                          "HEAD:PRR 812345.678901", "SCAN:LINE:STOP 41", "SCAN:LINE:STAR -9",
                                          "HEAD:LIN 120",           "SCAN:PAN:STOP 300"};
    const char *const more[] = {"--pace", "realtime", "--threads", "2", "--journal", journal, NULL};
    struct head head = head_start(wire, config, more);
    struct scanhead *sh = listen_to(&head, "tcp");
    struct scanhead_frame frame;
    client_tell(sh, "SCAN:FRAM 0");
    client_tell(sh, "SCAN:STAR");
    for (size_t i = 0; i < sizeof changes / sizeof changes[0]; i++) {
        take_points(sh, 20);
        client_tell(sh, changes[i]);
        if (i == 3) assert_int_equal(strncmp(client_ask(sh, "HEAD:PRR 1"), "ERR -222", 8), 0);
    }
    take_points(sh, 30);
    client_tell(sh, "SCAN:STOP");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    client_wait_state(sh, "idle");
    client_tell(sh, "*RST");
    client_tell(sh, "HEAD:PAN 100");
    client_tell(sh, "SCAN:PAN:STOP 10.5");
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    assert_int_equal(frame.event_value[0], 2);
    client_wait_state(sh, "idle");
    finish(&head, sh, result);
}

static void test_journal_brings_back_a_session(void **state)
{
    struct wire *wire = *state;
    struct result live, again;
    char config[352], journal[352];
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SHORT));
    snprintf(journal, sizeof journal, "%s", wire_path(wire, "session.journal"));
    live_session(wire, config, journal, &live);
    replay(wire, config, journal, "fast", "1", &again);
    assert_string_equal(again.head, live.head);
    assert_int_equal(again.pulses, live.pulses);
    replay(wire, config, journal, "fast", "3", &again);
    assert_string_equal(again.head, live.head);
    replay(wire, config, journal, "realtime", "1", &again);
    assert_string_equal(again.head, live.head);
    assert_int_equal(again.echoes, live.echoes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_pace_threads_link, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_ticks_longer_than_a_pty, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_hash_tells_streams_apart, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_hash_of_an_idle_head, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_no_hash, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_journal_ends_where_its_session_ended, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_journal_brings_back_a_session, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
