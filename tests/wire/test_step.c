/* Pace `step`: time is what a client grants, and the stream is the one of every other pace. */
#include "tests/wire/room.h"

#include "drivers/protocol/native.h"

static const struct room_config SHORT = {.profile = "riegl-vz400i",
                                         .prr_hz = 333333.3,
                                         .lines_hz = 97.7,
                                         .pan_deg_s = 150,
                                         .pan_stop_deg = 30,
                                         .frames = 1,
                                         .links = LINK_YAML_BOTH,
                                         .more = "loop: {queue_ms: 100}\n"};

static int64_t time_ns(struct scanhead *sh)
{
    return atoll(client_ask(sh, "TIME?"));
}

/* Takes the frames that came before the last reply; all must be of granted time. Returns 1 once the scan was
 * over. */
static int take_frames(struct scanhead *sh, int64_t granted_ns, uint64_t *pulses)
{
    struct scanhead_frame frame;
    int over = 0, rc;
    while ((rc = scanhead_next(sh, &frame, 0)) == SCANHEAD_OK) {
        assert_true(frame.t_ns < granted_ns);
        *pulses += frame.type == SCANHEAD_POINTS ? frame.n_pulses : 0;
        over |= is_event(&frame, SCANHEAD_EV_SCAN_END);
    }
    assert_int_equal(rc, SCANHEAD_ETIMEOUT);
    return over;
}

static struct head start(struct wire *wire, const char *pace)
{
    const char *const more[] = {"--pace", pace, NULL};
    room_write(wire);
    return head_start(wire, room_config_write(wire, &SHORT), more);
}

static void step_to_idle(struct scanhead *sh, int64_t *granted_ns)
{
    for (; strcmp(client_ask(sh, "HEAD:STAT?"), "idle") != 0; *granted_ns += 50000000)
        client_tell(sh, "TIME:STEP 50 MS");
}

static void stepped(struct wire *wire, const char *link, char hash[65])
{
    static const int steps_ms[] = {1, 7, 2, 30, 1, 1, 100, 13}; /* longer than the queue, too */
    struct head head = start(wire, "step");
    struct scanhead *sh = client_open(head_endpoint(&head, link));
    char line[32], client[65];
    int64_t granted_ns = 0;
    uint64_t pulses = 0;
    scanhead_hash_start(sh);
    step_to_idle(sh, &granted_ns);
    client_tell(sh, "SCAN:STAR");
    for (int i = 0, over = 0; !over; i = (i + 1) % 8) {
        snprintf(line, sizeof line, "TIME:STEP %d MS", steps_ms[i]);
        client_tell(sh, line);
        granted_ns += steps_ms[i] * INT64_C(1000000);
        assert_int_equal(time_ns(sh), granted_ns); /* the reply came when the time had passed */
        over = take_frames(sh, granted_ns, &pulses);
    }
    scanhead_hash_hex(sh, client);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    stats_hash(wire, hash);
    assert_string_equal(client, hash);
    struct oracle oracle = oracle_of(&SHORT, -40, 60, 240);
    assert_int_equal(pulses, oracle_count_cast(&oracle, 0, oracle_end(&oracle)));
}

static void test_same_stream_as_fast(void **state)
{
    struct wire *wire = *state;
    struct scanhead_frame frame;
    char fast[65], tcp[65], pty[65];
    struct head head = start(wire, "fast");
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    stats_hash(wire, fast);
    stepped(wire, "tcp", tcp);
    stepped(wire, "pty", pty);
    assert_string_equal(tcp, fast);
    assert_string_equal(pty, fast);
}

static void test_nothing_moves_by_itself(void **state)
{
    struct head head = start(*state, "step");
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    uint64_t pulses = 0;
    int64_t granted_ns = 0;
    assert_int_equal(time_ns(sh), 0);
    assert_string_equal(client_ask(sh, "HEAD:STAT?"), "boot");
    step_to_idle(sh, &granted_ns);
    client_tell(sh, "SCAN:STAR");
    client_tell(sh, "TIME:STEP 100 MS");
    granted_ns += 100000000;
    assert_int_equal(take_frames(sh, granted_ns, &pulses), 0);
    assert_true(pulses > 0);
    /* All frames came before the reply, and no more will. In real time 150 ms would be 50,000 pulses. */
    struct scanhead_frame frame;
    assert_int_equal(scanhead_next(sh, &frame, 150), SCANHEAD_ETIMEOUT);
    assert_int_equal(time_ns(sh), granted_ns);
    /* Steps below a tick add up. */
    for (int i = 0; i < 10; i++) {
        assert_int_equal(time_ns(sh), granted_ns);
        client_tell(sh, "TIME:STEP 100000");
    }
    assert_int_equal(time_ns(sh), granted_ns + 1000000);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

static void test_refusals(void **state)
{
    struct head head = start(*state, "step");
    struct scanhead *first = client_open(head_endpoint(&head, "tcp")),
                    *second = client_open(head_endpoint(&head, "tcp"));
    client_tell(first, "TIME:STEP 1 MS");
    static const char *const wrong[][2] = {{"TIME:STEP 0", "ERR -222"},   {"TIME:STEP -5", "ERR -222"},
                                           {"TIME:STEP", "ERR -109"},     {"TIME:STEP 1 HZ", "ERR -131"},
                                           {"TIME:STEP 0.5", "ERR -222"}, {"TIME:STEP 1E30", "ERR -222"},
                                           {"TIME:STEP soon", "ERR -104"}};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        const char *reply = client_ask(first, wrong[i][0]);
        if (strncmp(reply, wrong[i][1], 8) != 0) fail_msg("%s: %s", wrong[i][0], reply);
    }
    assert_int_equal(strncmp(client_ask(second, "TIME:STEP 1 MS"), "ERR -203", 8), 0);
    assert_int_equal(time_ns(second), 1000000);
    scanhead_close(first);
    scanhead_close(second);
    head_end(&head, SIGTERM);
}

/* Lines sent ahead are carried out and answered one after the other: each reply says what was true in its
 * turn. */
static void test_commands_sent_ahead(void **state)
{
    struct head head = start(*state, "step");
    static const char lines[] = "TIME:STEP 40 MS\nTIME?\nTIME:STEP 60 MS\nTIME?\nTIME:STEP 900 MS\nHEAD:STAT?\nTIME?\n";
    static const char *const want[] = {"OK", "40000000", "OK", "100000000", "OK", "idle", "1000000000"};
    int fd = raw_connect(head_endpoint(&head, "tcp"));
    raw_write(fd, lines, strlen(lines));
    static struct native_parser parser;
    native_parser_init(&parser);
    for (int n = 0; n < 7;) {
        size_t room;
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        uint8_t *to = native_parser_room(&parser, &room);
        if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("no reply %d", n);
        ssize_t got = read(fd, to, room);
        assert_true(got > 0);
        native_parser_added(&parser, (size_t)got);
        for (enum native_item item; n < 7 && (item = native_parser_next(&parser)) != NATIVE_MORE;)
            if (item == NATIVE_TEXT) assert_string_equal(parser.text, want[n++]);
    }
    close(fd);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_same_stream_as_fast, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_nothing_moves_by_itself, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_refusals, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_commands_sent_ahead, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
