/* SPDX-License-Identifier: MIT */
/* In the pace `fast` a caster claims several ticks, and casts their lines together. The stream is the same for any
 * number of ticks: where scans follow each other within them, where a scan changes, and where the head moves. */
#include "tests/wire/room.h"

/* The head starts and stops at once, so that scans follow each other within the ticks that are claimed together. */
static void write_quick_head(const struct wire *wire)
{
    static const struct {
        const char *from, *to;
    } edits[] = {{"boot_s: { value: 0.2", "boot_s: { value: 0.0"},
                 {"spin_up_s: { value: 0.03", "spin_up_s: { value: 0.00"},
                 {"spin_down_s: { value: 0.2", "spin_down_s: { value: 0.0"}};
    char *text = wire_read("config/heads/any-rate.yaml", NULL);
    assert_non_null(text);
    for (size_t i = 0; i < sizeof edits / sizeof edits[0]; i++) {
        char *at = strstr(text, edits[i].from);
        assert_non_null(at);
        memcpy(at, edits[i].to, strlen(edits[i].to));
    }
    wire_write_text(wire, "quick.yaml", text);
    free(text);
}

/* A line of 1,000 pulses takes 10 ticks. */
static const struct room_config SHORT = {.profile = "quick.yaml",
                                         .prr_hz = 100000,
                                         .lines_hz = 100,
                                         .pan_deg_s = 18,
                                         .pan_stop_deg = 60,
                                         .links = "links: [{type: \"null\"}]\n",
                                         .more = "cast: {sight: \"off\"}\nloop: {queue_ms: 10000}\n"};

struct result {
    char hash[65];
    uint64_t echoes;
};

static void run(struct wire *wire, const char *config, const char *ahead, const char *threads, const char *journal,
                struct result *result)
{
    const char *const alone[] = {"--pace", "fast",       "--set", ahead,     "--threads",
                                 threads,  "--duration", "0.6",   "--start", NULL};
    const char *const replay[] = {"--pace",           "fast",  "--set", ahead, "--threads", threads,
                                  "--replay-journal", journal, NULL};
    struct head head = head_start(wire, config, journal != NULL ? replay : alone);
    head_end(&head, 0);
    stats_hash(wire, result->hash);
    result->echoes = stats_uint(wire, "echoes");
    assert_true(result->echoes > 5000);
    assert_int_equal(stats_uint(wire, "lost_pulses"), 0);
}

/* With 2 ms ahead no lines are cast together. */
static void check_same(struct wire *wire, const struct room_config *c, const char *journal_text)
{
    static const char *const ahead[] = {"loop.ahead_ms=2", "loop.ahead_ms=64", "loop.ahead_ms=90"};
    char config[352], journal[352];
    struct result first = {"", 0}, other;
    room_write(wire);
    write_quick_head(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, c));
    snprintf(journal, sizeof journal, "%s", wire_path(wire, "session.journal"));
    if (journal_text != NULL) wire_write_text(wire, "session.journal", journal_text);
    for (int i = 0; i < 4; i++) {
        run(wire, config, ahead[i % 3], i < 3 ? "1" : "2", journal_text != NULL ? journal : NULL, &other);
        if (i == 0) first = other;
        assert_int_equal(first.echoes, other.echoes);
        assert_string_equal(first.hash, other.hash);
    }
}

/* The second scan has the pulse numbers of the first one, from another place. */
static void test_scans_follow_each_other(void **state)
{
    check_same(*state, &SHORT,
               "# scanhead journal 1\n"
               "100 100000000 1 SCAN:STAR\n"
               "122 122000000 1 SCAN:STOP\n"
               "124 124000000 1 SITE:POSE 1,1,0.2,0.3,40,0,0\n"
               "126 126000000 1 SCAN:STAR\n"
               "300 300000000 1 SCAN:STOP\n"
               "400 400000000 0 END\n");
}

/* The rates of pulses, pan and lines change within lines that could be cast together. */
static void test_a_scan_changes(void **state)
{
    check_same(*state, &SHORT,
               "# scanhead journal 1\n"
               "100 100000000 1 SCAN:STAR\n"
               "117 117000000 1 HEAD:PRR 50000\n"
               "135 135000000 1 HEAD:PAN:SPE 30\n"
               "151 151000000 1 HEAD:LIN 120\n"
               "263 263000000 1 SCAN:STOP\n"
               "400 400000000 0 END\n");
}

/* The poses of a head that moves are known when its ticks are made. */
static void test_a_head_moves(void **state)
{
    struct room_config c = SHORT;
    wire_write_text(*state, "way.csv",
                    "t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg\n"
                    "0,0.3,-0.4,0.2,0,0,30\n1,0.9,0.4,0.1,1,2,50\n");
    c.more = "cast: {sight: \"off\"}\nloop: {queue_ms: 10000}\nplatform: {kind: trajectory, file: way.csv}\n";
    check_same(*state, &c, NULL);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_scans_follow_each_other, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_scan_changes, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_head_moves, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
