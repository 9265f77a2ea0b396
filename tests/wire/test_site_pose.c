/* SPDX-License-Identifier: MIT */
/* These are tests of SITE:POSE on the wire. The scan after it is that of `record` with a configuration of that place,
 * in the paces fast and step. The journal brings the session back. SITE:POSE is refused at the wrong time. */
#include "tests/wire/room.h"

static const struct room_config SHORT = {.profile = "any-rate",
                                         .prr_hz = 333333.3,
                                         .lines_hz = 97.7,
                                         .pan_deg_s = 150,
                                         .pan_stop_deg = 15,
                                         .frames = 1,
                                         .links = LINK_YAML_TCP,
                                         .more = "loop: {queue_ms: 1000}\n"};

/* The place is within the room, and turned. No other text has these digits. */
#define PLACE   "0.3,-0.2,0.15,77.5,3,-2"
#define MOVE    "SITE:POSE 1," PLACE
#define THERE_1 "stations[0].position_m=[0.3, -0.2, 0.15]"
#define THERE_2 "stations[0].heading_deg=77.5"
#define THERE_3 "stations[0].pitch_deg=3"
#define THERE_4 "stations[0].roll_deg=-2"

static void record_there(struct wire *wire, const char *config, char hash[65])
{
    char stats[352];
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    const char *const args[] = {"record", config,  "--stats", stats,   "--quiet", "--set", THERE_1,
                                "--set",  THERE_2, "--set",   THERE_3, "--set",   THERE_4, NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "head.out", "head.err", -1)), 0);
    stats_hash(wire, hash);
}

static void expect_error(struct scanhead *sh, const char *line, const char *begin)
{
    const char *reply = client_ask(sh, line);
    if (strncmp(reply, begin, strlen(begin)) != 0) fail_msg("%s: %s", line, reply);
}

/* Waits for the event of the move, and for the new anchor with it. */
static void hear_of_it(struct scanhead *sh)
{
    static const double there[3] = {0.3, -0.2, 0.15};
    struct scanhead_frame frame;
    client_until(sh, SCANHEAD_EV_SITE, &frame);
    assert_int_equal(frame.event_value[0], 1);
    do
        client_next(sh, &frame);
    while (frame.type != SCANHEAD_ANCHOR);
    struct scanhead_info info;
    assert_int_equal(scanhead_get_info(sh, &info), 0);
    assert_memory_equal(info.station_m, there, sizeof there);
    assert_true((frame.flags & SCANHEAD_REPEAT) != 0);
}

static void fast(struct wire *wire, const char *config, char hash[65])
{
    const char *const more[] = {"--pace", "fast", "--journal", wire_path(wire, "journal"), NULL};
    struct head head = head_start(wire, config, more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp")), *other = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    client_wait_state(sh, "idle");
    expect_error(sh, "SITE:POSE 2,0,0,0,0,0,0", "ERR -222");
    client_tell(sh, MOVE);
    expect_error(other, "SITE:POSE 1,DEF", "ERR -203");
    assert_string_equal(client_ask(other, "SITE:POSE? 1"), PLACE);
    hear_of_it(other);
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_close(other);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    stats_hash(wire, hash);
}

static void replay(struct wire *wire, const char *config, char hash[65])
{
    const char *const more[] = {"--pace", "fast", "--replay-journal", wire_path(wire, "journal"), NULL};
    struct head head = head_start(wire, config, more);
    head_end(&head, 0);
    stats_hash(wire, hash);
}

/* Only granted time passes, and a station moves in no time. */
static void stepped(struct wire *wire, const char *config, char hash[65])
{
    const char *const more[] = {"--pace", "step", NULL};
    struct head head = head_start(wire, config, more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    expect_error(sh, MOVE, "ERR -221"); /* it boots */
    while (strcmp(client_ask(sh, "HEAD:STAT?"), "idle") != 0)
        client_tell(sh, "TIME:STEP 50 MS");
    client_tell(sh, MOVE);
    client_tell(sh, "SCAN:STAR");
    while (strcmp(client_ask(sh, "HEAD:STAT?"), "scanning") != 0)
        client_tell(sh, "TIME:STEP 10 MS");
    expect_error(sh, "SITE:POSE 1,DEF", "ERR -221");
    client_tell(sh, "TIME:STEP 2 S");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    stats_hash(wire, hash);
}

static void test_the_next_scan_is_from_there(void **state)
{
    struct wire *wire = *state;
    char config[352], first[65], hash[65];
    room_write(wire);
    snprintf(config, sizeof config, "%s", room_config_write(wire, &SHORT));
    record_there(wire, config, first);
    fast(wire, config, hash);
    assert_string_equal(hash, first);
    replay(wire, config, hash);
    assert_string_equal(hash, first);
    stepped(wire, config, hash);
    assert_string_equal(hash, first);
}

/* Lines sent ahead wait for the move, and so does the scan. */
static void test_lines_sent_ahead(void **state)
{
    static const char lines[] = "SITE:POSE 1," PLACE "\nSCAN:STAR\n";
    struct wire *wire = *state;
    room_write(wire);
    const char *const more[] = {"--pace", "fast", NULL};
    struct head head = head_start(wire, room_config_write(wire, &SHORT), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    client_wait_state(sh, "idle");
    int fd = raw_connect(head_endpoint(&head, "tcp"));
    raw_send(fd, lines, sizeof lines - 1);
    hear_of_it(sh);
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    close(fd);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_the_next_scan_is_from_there, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_lines_sent_ahead, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
