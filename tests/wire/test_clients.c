/* SPDX-License-Identifier: MIT */
/* Clients die, send garbage, crowd or go quiet. The head carries on, reports what happened, and serves the next one. */
#include "tests/wire/room.h"

#include <termios.h>

static const struct room_config ENDLESS = {.prr_hz = 100000,
                                           .lines_hz = 50,
                                           .pan_deg_s = 20,
                                           .pan_stop_deg = 360,
                                           .frames = 0,
                                           .links = "links: [{type: tcp, port: 0, max_sessions: 4}, "
                                                    "{type: pty, path: port}]\n",
                                           .more = "loop: {queue_ms: 10000, late_ms: 10000}\n"};

static struct head start_endless(struct wire *wire)
{
    room_write(wire);
    return head_start(wire, room_config_write(wire, &ENDLESS), NULL);
}

static void start_scan(struct scanhead *sh)
{
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    client_wait_state(sh, "scanning");
}

/* Points still come, in order and without gaps. */
static void expect_points(struct scanhead *sh, int n)
{
    struct scanhead_frame frame;
    uint64_t next = 0;
    for (int64_t since_ns = 0; n > 0;) {
        client_next(sh, &frame);
        wire_soon(&since_ns, frame.t_ns, "points");
        if (frame.type != SCANHEAD_POINTS) continue;
        if (next != 0) assert_int_equal(frame.pulse0, next);
        next = frame.pulse0 + frame.n_pulses;
        n--;
    }
}

/* The frames that a killed client did not read from a terminal may come first. The frames are older than the head's
 * answer to us. */
static void pass_frames_before(struct scanhead *sh, int64_t t_ns)
{
    struct scanhead_frame frame;
    do
        client_next(sh, &frame);
    while (frame.t_ns < t_ns);
}

static int is_among(int number, const int *list)
{
    while (*list != 0 && *list != number)
        list++;
    return *list != 0;
}

/* Takes errors off the queue until one of this number comes. Errors before it must be among the allowed ones (0 ends
 * the list). */
static void expect_error(struct scanhead *sh, int number, const int *allowed)
{
    struct scanhead_frame frame;
    for (int64_t since_ns = 0;;) {
        int got = atoi(client_ask(sh, "SYST:ERR?"));
        if (got != 0 && got != number && !is_among(got, allowed)) fail_msg("error %d instead of %d", got, number);
        if (got == number) return;
        wire_soon(&since_ns, client_time_ns(sh), "an error in the queue");
        if (got == 0) scanhead_next(sh, &frame, 10); /* not told yet: frames take the time */
    }
}

static const int NONE[] = {0};

/* Starts a child that connects, reports that, and reads until it is killed. Returns once it has received points. */
static pid_t start_reader(struct wire *wire, const char *source)
{
    char at[256];
    int told[2];
    snprintf(at, sizeof at, "%s", source);
    assert_int_equal(pipe2(told, O_CLOEXEC), 0);
    pid_t pid = wire_fork(wire);
    if (pid == 0) {
        struct scanhead *sh;
        struct scanhead_frame frame;
        char reply[600];
        if (scanhead_open(at, &sh, NULL, 0) != SCANHEAD_OK) _exit(1);
        do
            scanhead_command(sh, "HEAD:STAT?", reply, sizeof reply, DEADLINE_MS);
        while (strcmp(reply, "idle") != 0 && strcmp(reply, "scanning") != 0);
        scanhead_command(sh, "SCAN:STAR", reply, sizeof reply, DEADLINE_MS);
        for (int seen = 0; scanhead_next(sh, &frame, DEADLINE_MS) == SCANHEAD_OK;)
            if (frame.type == SCANHEAD_POINTS && !seen++ && write(told[1], "p", 1) != 1) _exit(1);
        _exit(1);
    }
    close(told[1]);
    struct pollfd slot = {.fd = told[0], .events = POLLIN};
    char byte;
    assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
    assert_int_equal(read(told[0], &byte, 1), 1);
    close(told[0]);
    return pid;
}

/* The child must have been alive, in the middle of reading. */
static void kill_hard(struct wire *wire, pid_t pid)
{
    kill(pid, SIGKILL);
    assert_int_equal(wire_wait(wire, pid), 256 + SIGKILL);
}

static void killed_client(struct wire *wire, const char *link)
{
    struct head head = start_endless(wire);
    for (int round = 0; round < 3; round++) {
        kill_hard(wire, start_reader(wire, head_endpoint(&head, link)));
        struct scanhead *sh = client_open(head_endpoint(&head, link));
        expect_error(sh, 101, NONE);
        assert_string_equal(client_ask(sh, "SYST:CONT?"), "0"); /* the killed client has no control any more */
        pass_frames_before(sh, atoll(client_ask(sh, "TIME?")));
        expect_points(sh, 20);
        client_tell(sh, "SCAN:STOP");
        client_wait_state(sh, "idle");
        scanhead_close(sh);
        struct scanhead *other = client_open(head_endpoint(&head, strcmp(link, "tcp") == 0 ? "pty" : "tcp"));
        expect_error(other, 101, NONE); /* also after the client in control has hung up */
        scanhead_close(other);
    }
    head_end(&head, SIGTERM);
    assert_int_equal(stats_uint(wire, "scans"), 3);
    assert_int_equal(stats_uint(wire, "lost_pulses"), 0);
}

static void test_killed_tcp_client(void **state)
{
    killed_client(*state, "tcp");
}

static void test_killed_pty_client(void **state)
{
    killed_client(*state, "pty");
}

/* Returns a descriptor to the link that takes any bytes. */
static int raw_open(const struct head *head, const char *link)
{
    if (strcmp(link, "tcp") == 0) return raw_connect(head_endpoint(head, "tcp"));
    int fd = open(head_endpoint(head, "pty") + strlen("tty:"), O_RDWR | O_NOCTTY | O_CLOEXEC);
    assert_true(fd >= 0);
    struct termios raw;
    assert_int_equal(tcgetattr(fd, &raw), 0);
    cfmakeraw(&raw);
    assert_int_equal(tcsetattr(fd, TCSANOW, &raw), 0);
    return fd;
}

static void raw_expect(struct scanhead *sh, const char *ask, const char *begins)
{
    const char *reply = client_ask(sh, ask);
    if (strncmp(reply, begins, strlen(begins)) != 0) fail_msg("%.40s: %s", ask, reply);
}

static void babbling_client(struct wire *wire, const char *link)
{
    static const int text_errors[] = {-102, -113, -363, 0};
    struct head head = start_endless(wire);
    struct scanhead *watch = client_open(head_endpoint(&head, "tcp"));
    start_scan(watch);

    int fd = raw_open(&head, link);
    struct scanhead *sh = client_from_fd(fd);
    raw_expect(sh, "BEAM:ME:UP", "ERR -113,\"Undefined header");
    raw_expect(sh, "BEAM:ME:UP?", "ERR -113");
    raw_expect(sh, "HEAD:PRR ten", "ERR -104");
    raw_expect(sh, "HEAD:PRR?;*IDN?", "ERR -102");
    raw_expect(sh, "HEAD:PRR", "ERR -109");
    raw_expect(sh, "SCAN:STAR 1", "ERR -108");
    raw_expect(sh, "HEAD:PRR 100 MM", "ERR -131");
    for (const char *const *code =
             (const char *const[]){"-113", "-113", "-104", "-102", "-109", "-108", "-131", "0", NULL};
         *code != NULL; code++)
        assert_int_equal(atoi(client_ask(watch, "SYST:ERR?")), atoi(*code));

    /* A line of 1000 characters is refused whole. The line after it is accepted. The client takes up to 256 at once. */
    char line[257], before[744];
    memset(before, 'A', sizeof before);
    memset(line, 'A', 256);
    line[256] = '\0';
    raw_send(fd, before, sizeof before);
    raw_expect(sh, line, "ERR -363,\"Input buffer overrun");
    raw_expect(sh, "*OPC?", "1");
    expect_error(watch, -363, NONE);
    scanhead_close(sh);
    expect_error(watch, 101, NONE);

    /* Sends bytes of all values and leaves without a line's end. The bytes give fewer errors than the queue holds. */
    fd = raw_open(&head, link);
    unsigned char garbage[2500];
    uint32_t x = 12345;
    for (size_t i = 0; i < sizeof garbage; i++) {
        x = x * 1664525u + 1013904223u;
        garbage[i] = (unsigned char)(x >> 24);
    }
    garbage[sizeof garbage - 1] = 'G';
    fcntl(fd, F_SETFL, O_NONBLOCK);
    const int64_t end_ms = wire_now_ms() + SOON_MS;
    for (size_t done = 0; done < sizeof garbage;) {
        char sink[65536];
        if (wire_now_ms() > end_ms) fail_msg("the head took %zu of %zu bytes of garbage", done, sizeof garbage);
        struct pollfd slot = {.fd = fd, .events = POLLIN | POLLOUT};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        if ((slot.revents & POLLIN) != 0 && read(fd, sink, sizeof sink) < 0) assert_int_equal(errno, EAGAIN);
        ssize_t n = (slot.revents & POLLOUT) != 0 ? write(fd, garbage + done, sizeof garbage - done) : 0;
        if (n > 0) done += (size_t)n;
    }
    close(fd);
    expect_error(watch, 105, text_errors);
    expect_error(watch, 101, NONE);
    expect_points(watch, 20);

    /* Half a command is not carried out, even when the next client completes it. */
    fd = raw_open(&head, link);
    raw_send(fd, "SCAN:ST", 7);
    close(fd);
    expect_error(watch, 105, NONE);
    fd = raw_open(&head, link);
    raw_send(fd, "OP\n", 3);
    close(fd);
    expect_error(watch, -113, (const int[]){101, 0});
    expect_error(watch, 101, NONE);
    assert_string_equal(client_ask(watch, "HEAD:STAT?"), "scanning");
    expect_points(watch, 20);
    scanhead_close(watch);
    head_end(&head, SIGTERM);
}

static void test_babbling_tcp_client(void **state)
{
    babbling_client(*state, "tcp");
}

static void test_babbling_pty_client(void **state)
{
    babbling_client(*state, "pty");
}

static void test_two_clients(void **state)
{
    struct wire *wire = *state;
    struct scanhead_frame frame;
    struct head head = start_endless(wire);
    struct scanhead *first = client_open(head_endpoint(&head, "tcp"));
    struct scanhead *second = client_open(head_endpoint(&head, "tcp"));
    start_scan(first); /* that takes control */
    static const char *const changing[] = {
        "HEAD:PRR 200000", "HEAD:LIN 10",      "HEAD:PAN 5",      "SCAN:STOP",      "*RST",
        "SCAN:FRAM 3",     "SCAN:LINE:STOP 9", "SCAN:PAN:STAR 3", "HEAD:STATION 1", "SYST:CONT:REL"};
    for (size_t i = 0; i < sizeof changing / sizeof changing[0]; i++) {
        raw_expect(second, changing[i], "ERR -203,\"Command protected");
        expect_error(second, -203, NONE);
    }
    raw_expect(second, "*IDN?", "scanhead,full sweep,");
    raw_expect(second, "HEAD:PRR?", "100000");
    raw_expect(second, "HEAD:STAT?", "scanning");
    raw_expect(second, "SYST:CONT?", "1");
    raw_expect(second, "SYST:ERR?", "0,");
    expect_points(second, 20);
    expect_points(first, 20);
    scanhead_close(first);
    expect_error(second, 101, NONE);
    do
        client_until_soon(second, SCANHEAD_EV_CONTROL, &frame);
    while (frame.event_value[0] != 0);
    client_tell(second, "HEAD:PRR 200000");
    client_until_soon(second, SCANHEAD_EV_CONTROL, &frame);
    assert_int_equal(frame.event_value[0], 2);
    client_tell(second, "SYST:CONT:REL");
    struct scanhead *third = client_open(head_endpoint(&head, "tcp"));
    client_tell(third, "SCAN:STOP");
    client_until_soon(second, SCANHEAD_EV_SCAN_END, &frame); /* frames reach all */
    client_until_soon(third, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_close(second);
    scanhead_close(third);
    head_end(&head, SIGTERM);
}

static void test_fifth_client_is_refused(void **state)
{
    struct wire *wire = *state;
    struct scanhead *client[4];
    struct scanhead_frame frame;
    struct head head = start_endless(wire);
    for (int i = 0; i < 4; i++) {
        client[i] = client_open(head_endpoint(&head, "tcp"));
        raw_expect(client[i], "*OPC?", "1"); /* it has its session now */
    }
    start_scan(client[0]);
    struct scanhead *fifth = client_open(head_endpoint(&head, "tcp"));
    assert_int_equal(scanhead_next(fifth, &frame, SOON_MS), SCANHEAD_ECLOSED);
    scanhead_close(fifth);
    expect_error(client[1], 104, NONE);
    for (int i = 0; i < 4; i++)
        expect_points(client[i], 10);
    scanhead_close(client[3]);
    expect_error(client[1], 101, NONE);
    client[3] = client_open(head_endpoint(&head, "tcp"));
    raw_expect(client[3], "*OPC?", "1"); /* there is room again */
    expect_points(client[3], 10);
    for (int i = 0; i < 4; i++)
        scanhead_close(client[i]);
    head_end(&head, SIGTERM);
}

/* 200 clients come and go while one watches. Every fourth asks something, and every eighth leaves with a reset. */
static void test_many_short_clients(void **state)
{
    struct wire *wire = *state;
    struct head head = start_endless(wire);
    struct scanhead *watch = client_open(head_endpoint(&head, "pty"));
    char endpoint[256];
    snprintf(endpoint, sizeof endpoint, "%s", head_endpoint(&head, "tcp"));
    start_scan(watch);
    for (int i = 0; i < 200; i++) {
        int fd = raw_connect(endpoint);
        if (i % 4 == 0) raw_send(fd, "*IDN?\nHEAD:PRR?\n", 16);
        if (i % 8 == 0) setsockopt(fd, SOL_SOCKET, SO_LINGER, &(struct linger){1, 0}, sizeof(struct linger));
        close(fd);
        if (i % 20 == 0) expect_points(watch, 1);
    }
    expect_points(watch, 50);
    struct scanhead *last = client_open(endpoint);
    struct scanhead_frame frame;
    int64_t since_ns = 0;
    while (scanhead_next(last, &frame, DEADLINE_MS) == SCANHEAD_ECLOSED) { /* the head still ends earlier sessions */
        wire_soon(&since_ns, client_time_ns(watch), "room for a client");
        scanhead_close(last);
        last = client_open(endpoint);
    }
    expect_points(last, 10);
    client_tell(watch, "SCAN:STOP");
    client_wait_state(watch, "idle");
    scanhead_close(last);
    scanhead_close(watch);
    head_end(&head, SIGTERM);
    assert_int_equal(stats_uint(wire, "lost_pulses"), 0);
}

/* In the pace `fast` a client that does not read holds the run back. When it dies, the run goes on. */
static void test_dead_weight_at_pace_fast(void **state)
{
    struct wire *wire = *state;
    struct room_config config = ENDLESS;
    struct scanhead_frame frame;
    config.prr_hz = 2000000;
    config.frames = 1;
    config.pan_deg_s = 40; /* 9 s of device time, 360 MB: more than any buffers on the way */
    config.more = "loop: {pace: fast, queue_ms: 50}\n";
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    int idle = raw_connect(head_endpoint(&head, "tcp")); /* never reads, never writes */
    start_scan(sh);
    uint64_t got = 0;
    /* 1.5 s without a frame can only mean that the run is held back, since the next one would take milliseconds. */
    while (scanhead_next(sh, &frame, 1500) == SCANHEAD_OK) {
        got += frame.type == SCANHEAD_POINTS ? frame.n_pulses : 0;
        assert_false(is_event(&frame, SCANHEAD_EV_SCAN_END));
    }
    assert_true(got > 0);
    close(idle);
    do {
        client_next(sh, &frame);
        got += frame.type == SCANHEAD_POINTS ? frame.n_pulses : 0;
    } while (got < 5000000 && !is_event(&frame, SCANHEAD_EV_SCAN_END));
    client_tell(sh, "SCAN:STOP");
    scanhead_close(sh); /* unread, it would hold the run back from here on */
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_killed_tcp_client, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_killed_pty_client, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_babbling_tcp_client, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_babbling_pty_client, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_two_clients, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_fifth_client_is_refused, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_many_short_clients, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_dead_weight_at_pace_fast, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
