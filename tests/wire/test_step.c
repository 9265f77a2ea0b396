/* SPDX-License-Identifier: MIT */
/* Pace `step`: time passes as a client grants it, and the stream is that of every other pace. */
#include "tests/wire/room.h"

#include "drivers/protocol/native.h"

static const struct room_config SHORT = {.profile = "any-rate",
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

/* Takes the frames that came before the last reply. All must be of granted time. Returns 1 once the scan was over. */
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
    /* All frames came before the reply, and no more will come. In real time 150 ms would be 50,000 pulses. */
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

/* Lines sent ahead are carried out and answered one after the other: each reply was true in its turn. */
static void test_commands_sent_ahead(void **state)
{
    struct head head = start(*state, "step");
    static const char lines[] = "TIME:STEP 40 MS\nTIME?\nTIME:STEP 60 MS\nTIME?\nTIME:STEP 900 MS\nHEAD:STAT?\nTIME?\n";
    static const char *const want[] = {"OK", "40000000", "OK", "100000000", "OK", "idle", "1000000000"};
    int fd = raw_connect(head_endpoint(&head, "tcp"));
    raw_send(fd, lines, strlen(lines));
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

/* ---- a pose with each grant */

static const struct room_config LIVE = {.profile = NULL,
                                        .prr_hz = 100000,
                                        .lines_hz = 100,
                                        .pan_deg_s = 100,
                                        .pan_stop_deg = 360,
                                        .frames = 0,
                                        .links = LINK_YAML_TCP,
                                        .more = "platform: {kind: live, reach_m: 5, extrapolate_ms: 20}\n"};

/* This is the vehicle of the other simulator, t seconds after power-up. The vehicle moves back and forth and turns,
 * heading clockwise. */
static void vehicle(double t, double p[6])
{
    p[0] = 0.3 + 1.2 * sin(2 * t);
    p[1] = -0.4 - 0.7 * t;
    p[2] = 0.1 * t;
    p[3] = 4 * sin(9 * t);
    p[4] = -6 * t;
    p[5] = 20 + 90 * t;
}

static void step_with_pose(struct scanhead *sh, int64_t *granted_ns, int64_t step_ns, double at[6])
{
    char line[200];
    *granted_ns += step_ns;
    vehicle(1e-9 * (double)*granted_ns, at);
    snprintf(line, sizeof line, "TIME:STEP %lld NS, %.12g, %.12g,%.12g , %.12g, %.12g, %.12g", (long long)step_ns,
             at[0], at[1], at[2], at[3], at[4], at[5]);
    client_tell(sh, line);
}

/* Takes frames up to the reply. Points must lie on the walls (encoders: 1e-4 m, see test_moving.c), and flags are
 * counted. */
static void take_live(struct scanhead *sh, int64_t *scan_t0_ns, uint64_t *points, uint32_t flags[4], int *late_events)
{
    struct scanhead_frame frame;
    struct scanhead_point point[256];
    struct scanhead_pose pose[64];
    int n;
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        if (is_event(&frame, SCANHEAD_EV_SCAN_START)) *scan_t0_ns = (int64_t)frame.event_value[1];
        *late_events += is_event(&frame, SCANHEAD_EV_POSE_LATE);
        for (uint32_t first = 0;
             frame.type == SCANHEAD_POINTS && (n = scanhead_points(sh, &frame, first, point, 256)) > 0;
             first += (uint32_t)n) {
            assert_int_equal(scanhead_to_scene(sh, point, (uint32_t)n, NULL), 0);
            for (int i = 0; i < n; i++) {
                const double at[3] = {point[i].x, point[i].y, point[i].z};
                int wall = point[i].label;
                assert_true(fabs(at[wall / 2] - (wall & 1 ? ROOM_MAX : ROOM_MIN)[wall / 2]) < 1e-4);
            }
            *points += (uint64_t)n;
        }
        for (n = frame.type == SCANHEAD_POSES ? scanhead_poses(sh, &frame, 0, pose, 64) : 0; n > 0; n--)
            for (int bit = 0; bit < 4; bit++)
                flags[bit] += (uint32_t)pose[n - 1].flags >> bit & 1;
    }
}

static void test_pose_with_each_grant(void **state)
{
    struct wire *wire = *state;
    struct scanhead_pose pose;
    const char *const more[] = {"--pace", "step", NULL};
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &LIVE), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    int64_t granted_ns = 0, t0_ns = 0;
    uint64_t points = 0;
    uint32_t flags[4] = {0};
    int late_events = 0;
    double at[6];
    while (strcmp(client_ask(sh, "HEAD:STAT?"), "idle") != 0)
        step_with_pose(sh, &granted_ns, 50000000, at);
    client_tell(sh, "SCAN:STAR");
    while (strcmp(client_ask(sh, "HEAD:STAT?"), "scanning") != 0)
        step_with_pose(sh, &granted_ns, 10000000, at);
    for (int i = 0; i < 30; i++) {
        int64_t step_ns = i % 3 == 0 ? 10000000 : i % 3 == 1 ? 3000000 : 17000000;
        step_with_pose(sh, &granted_ns, step_ns, at);
        take_live(sh, &t0_ns, &points, flags, &late_events);
        /* At the grant's end the head was where the grant said: each pose is right to the digits sent. The heading has
         * a quaternion (cos, 0, 0, -sin) of its half; pitch and roll are added. */
        assert_int_equal(scanhead_pose(sh, granted_ns - t0_ns, &pose), SCANHEAD_OK);
        for (int k = 0; k < 3; k++)
            assert_true(fabs(pose.position_m[k] - at[k]) < 1e-10);
        const double *q = pose.quat;
        double forward[3] = {2 * (q[1] * q[2] - q[0] * q[3]), 1 - 2 * (q[1] * q[1] + q[3] * q[3]),
                             2 * (q[2] * q[3] + q[0] * q[1])};
        double heading = at[5] * M_PI / 180, pitch = at[4] * M_PI / 180, roll = at[3] * M_PI / 180;
        assert_true(fabs(forward[0] - sin(heading) * cos(pitch)) < 1e-10 && fabs(forward[2] - sin(pitch)) < 1e-10);
        double right_z = 2 * (q[1] * q[3] - q[0] * q[2]);
        assert_true(fabs(right_z + sin(roll) * cos(pitch)) < 1e-10);
    }
    assert_true(points > 25000); /* 100,000 a second, 300 ms */
    assert_int_equal(flags[0] + flags[1] + flags[2] + (uint32_t)late_events, 0);
    /* Grants come without a pose. The motion goes on for 20 ms, then the platform stands, which is reported and
     * counted. */
    client_tell(sh, "TIME:STEP 20 MS");
    take_live(sh, &t0_ns, &points, flags, &late_events);
    assert_true(flags[0] > 10 && flags[1] == 0 && late_events == 0);
    client_tell(sh, "TIME:STEP 30 MS");
    take_live(sh, &t0_ns, &points, flags, &late_events);
    assert_true(flags[1] > 10);
    assert_int_equal(late_events, 1);
    static const char *const wrong[][2] = {
        {"TIME:STEP 1 MS, 1, 2, 3", "ERR -109"},          {"TIME:STEP 1 MS, 1, 2, 3, 4, 5, 6, 7", "ERR -108"},
        {"TIME:STEP 1 MS, 1, 2, x, 4, 5, 6", "ERR -104"}, {"TIME:STEP 1 MS, 1, 2, 3, 4, 95, 6", "ERR -222"},
        {"TIME:STEP 1 MS, 9, 2, 3, 4, 5, 6", "ERR -222"}, {"TIME:STEP 1 MS, 1, , 3, 4, 5, 6", "ERR -104"},
        {"TIME:STEP , 1, 2, 3, 4, 5, 6", "ERR -104"}};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        const char *reply = client_ask(sh, wrong[i][0]);
        if (strncmp(reply, wrong[i][1], 8) != 0) fail_msg("%s: %s", wrong[i][0], reply);
    }
    granted_ns += 50000000;
    assert_int_equal(time_ns(sh), granted_ns); /* a refused command grants nothing */
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    assert_true(stats_uint(wire, "late_poses") >= 10);
    /* A head that stands still takes no pose. */
    head = start(wire, "step");
    sh = client_open(head_endpoint(&head, "tcp"));
    assert_int_equal(strncmp(client_ask(sh, "TIME:STEP 1 MS, 1, 2, 3, 4, 5, 6"), "ERR -221", 8), 0);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* Returns the processor time of a process so far. */
static int64_t taken_ms(pid_t pid)
{
    char name[64], text[1024];
    unsigned long user, kernel;
    snprintf(name, sizeof name, "/proc/%d/stat", (int)pid);
    FILE *f = fopen(name, "r");
    assert_non_null(f);
    assert_non_null(fgets(text, sizeof text, f));
    fclose(f);
    assert_int_equal(
        sscanf(strrchr(text, ')'), ") %*c %*d %*d %*d %*d %*d %*u %*u %*u %*u %*u %lu %lu", &user, &kernel), 2);
    return (int64_t)(user + kernel) * 1000 / sysconf(_SC_CLK_TCK);
}

/* A client that reads nothing holds back a step, and its further lines fill the head's buffer for them. The head then
 * waits without using a processor: it rests 2 ms between two looks, so a tenth of the time is far more than it needs.
 */
static void test_lines_that_wait_for_a_step(void **state)
{
    enum { WINDOW_MS = 500, WINDOWS = 40, MOST_MS = WINDOW_MS / 10 };
    struct wire *wire = *state;
    static char lines[1 << 18];
    struct room_config config = SHORT;
    const char *const more[] = {"--pace", "step", NULL};
    config.prr_hz = 1000000;
    config.frames = 0;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), more);
    const int fd = raw_connect(head_endpoint(&head, "tcp"));
    raw_send(fd, "TIME:STEP 1 S\nSCAN:STAR\nTIME:STEP 100 S\n", 40);
    memset(lines, '\n', sizeof lines);
    struct pollfd slot = {.fd = fd, .events = POLLOUT};
    while (poll(&slot, 1, 300) == 1)
        send(fd, lines, sizeof lines, MSG_DONTWAIT);
    int64_t took_ms = WINDOW_MS;
    for (int i = 0; i < WINDOWS && took_ms > MOST_MS; i++) { /* at first it still scans */
        const int64_t before_ms = taken_ms(head.pid);
        poll(NULL, 0, WINDOW_MS);
        took_ms = taken_ms(head.pid) - before_ms;
    }
    assert_in_range(took_ms, 0, MOST_MS);
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
        cmocka_unit_test_setup_teardown(test_pose_with_each_grant, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_lines_that_wait_for_a_step, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
