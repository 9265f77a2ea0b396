/* SPDX-License-Identifier: MIT */
/* The virtual serial port with clients that know nothing of it. The clients open it with any settings, and close it in
 * the middle of a frame. The next client never gets frames that were meant for the one before. */
#include "tests/wire/room.h"

#include <termios.h>

#include "drivers/protocol/native.h"

static const struct room_config ENDLESS = {.prr_hz = 200000,
                                           .lines_hz = 100,
                                           .pan_deg_s = 20,
                                           .pan_stop_deg = 360,
                                           .frames = 0,
                                           .links = LINK_YAML_BOTH,
                                           .more = "loop: {queue_ms: 10000, late_ms: 10000}\n"};

static int port_open(const struct wire *wire)
{
    int fd = open(wire_path(wire, "port"), O_RDWR | O_NOCTTY | O_CLOEXEC);
    if (fd < 0) fail_msg("open: %s", strerror(errno));
    return fd;
}

/* Closes the port and waits until the head tells another client that this one is gone. A client that opens the port in
 * the moment before that gets the kernel's old bytes. No program on the other side can prevent that. */
static void close_seen(int fd, struct scanhead *watch)
{
    struct scanhead_frame frame;
    int64_t since_ns = 0;
    close(fd); /* with whatever is on its way */
    while (atoi(client_ask(watch, "SYST:ERR?")) != 101) {
        wire_soon(&since_ns, client_time_ns(watch), "word that the client is gone");
        scanhead_next(watch, &frame, 1);
    }
}

/* The frames that a client got at its place in the stream. */
struct look {
    struct native_parser parser;
    uint64_t texts;
    int64_t first_ns;
    uint32_t first_seq, last_seq;
    int n;
};

/* Reads as cat would, until `frames` frames have come. The test fails where they are not among the bytes of
 * two frames more of the largest size. */
static void look_at(struct look *look, int fd, int frames)
{
    native_parser_init(&look->parser);
    look->n = 0;
    look->first_seq = 0;
    look->texts = 0;
    for (size_t bytes = 0; look->n < frames;) {
        size_t room;
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        uint8_t *to = native_parser_room(&look->parser, &room);
        if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("nothing to read");
        ssize_t got = read(fd, to, room);
        assert_true(got > 0);
        native_parser_added(&look->parser, (size_t)got);
        bytes += (size_t)got;
        if (bytes > (size_t)(frames + 2) * NATIVE_MAX_FRAME)
            fail_msg("%d of %d frames in %zu bytes", look->n, frames, bytes);
        for (enum native_item item; (item = native_parser_next(&look->parser)) != NATIVE_MORE;) {
            if (item == NATIVE_TEXT) {
                look->texts++;
                continue;
            }
            look->n++;
            if ((look->parser.header.flags & (NATIVE_REPEAT | NATIVE_LOCAL)) != 0)
                continue; /* said again to this one */
            if (look->first_seq == 0) {
                look->first_ns = look->parser.header.t_ns;
                look->first_seq = look->parser.header.seq;
            } else {
                assert_true(look->parser.header.seq > look->last_seq);
            }
            look->last_seq = look->parser.header.seq;
        }
    }
}

static void expect_clean(const struct look *look)
{
    assert_int_equal(look->parser.stats.bad_payload, 0);
    assert_int_equal(look->parser.stats.bad_bytes, 0); /* it begins with a frame, and every byte belongs to one */
    assert_int_equal(look->parser.stats.seq_lost, 0);
}

static void test_clients_with_default_settings(void **state)
{
    struct wire *wire = *state;
    static struct look look;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &ENDLESS), (const char *const[]){"--start", NULL});
    struct scanhead *watch = client_open(head_endpoint(&head, "tcp"));
    client_wait_state(watch, "scanning");
    uint32_t next_seq = 0;
    for (int i = 0; i < 20; i++) {
        int64_t now_ns = atoll(client_ask(watch, "TIME?"));
        int fd = port_open(wire); /* no tcsetattr: as cat, dd or a shell's redirection do */
        look_at(&look, fd, 5 + i);
        expect_clean(&look);
        assert_int_equal(look.texts, 0);
        assert_true(look.first_seq >= next_seq);
        assert_true(look.first_ns + 2000000 >= now_ns); /* nothing of before it was opened, to a tick or two */
        next_seq = look.last_seq + 1;
        close_seen(fd, watch);
    }
    scanhead_close(watch);
    head_end(&head, SIGTERM);
}

/* A client leaves with a full pipe behind and a reply that it never read. Another leaves a terminal in cooked mode. */
static void test_nothing_stale(void **state)
{
    struct wire *wire = *state;
    static struct look look;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &ENDLESS), (const char *const[]){"--start", NULL});
    struct scanhead *watch = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    client_wait_state(watch, "scanning");
    for (int i = 0; i < 6; i++) {
        int fd = port_open(wire);
        raw_send(fd, "*IDN?\nHEAD:PRR?\n", 16);
        /* 50 frames later the terminal's buffer is full. */
        for (int n = 0; n < 50; n++)
            client_next(watch, &frame);
        raw_send(fd, "nonsense\n", 9); /* the head has read it, and keeps its reply until there is room */
        for (int64_t end_ms = wire_now_ms() + DEADLINE_MS; atoi(client_ask(watch, "SYST:ERR?")) != -113;) {
            if (wire_now_ms() > end_ms) fail_msg("the head has not read the command");
            scanhead_next(watch, &frame, 1);
        }
        if (i % 2 == 0) {
            struct termios cooked;
            assert_int_equal(tcgetattr(fd, &cooked), 0);
            cooked.c_lflag |= ICANON | ECHO | ISIG;
            cooked.c_iflag |= ICRNL | IXON | IXOFF;
            cooked.c_oflag |= OPOST | ONLCR;
            assert_int_equal(tcsetattr(fd, TCSANOW, &cooked), 0);
        }
        close_seen(fd, watch);
        int64_t now_ns = atoll(client_ask(watch, "TIME?"));
        fd = port_open(wire);
        look_at(&look, fd, 20);
        expect_clean(&look);
        assert_int_equal(look.texts, 0); /* the replies were for the one before */
        assert_true(look.first_ns + 2000000 >= now_ns);
        struct termios now;
        assert_int_equal(tcgetattr(fd, &now), 0);
        assert_int_equal(now.c_lflag & (ICANON | ECHO | ISIG), 0);
        assert_int_equal(now.c_oflag & OPOST, 0);
        close_seen(fd, watch);
    }
    assert_string_equal(client_ask(watch, "SYST:ERR?"), "0,\"No error\"");
    scanhead_close(watch);
    head_end(&head, SIGTERM);
    assert_int_equal(stats_uint(wire, "lost_pulses"), 0);
}

/* Taken over at once, the stream may begin with frames for the client before. Even then frames are whole and in
 * order. */
static void test_taken_over_at_once(void **state)
{
    struct wire *wire = *state;
    static struct look look;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &ENDLESS), (const char *const[]){"--start", NULL});
    int fd = port_open(wire);
    look_at(&look, fd, 30);
    for (int i = 0; i < 30; i++) {
        uint32_t seen = look.last_seq;
        close(fd);
        fd = port_open(wire);
        look_at(&look, fd, 10);
        assert_true(look.first_seq > seen);
        assert_true(look.parser.stats.bad_bytes < NATIVE_MAX_FRAME);
    }
    close(fd);
    head_end(&head, SIGTERM);
}

/* The kernel throws away the bytes that wait in a terminal when its master is closed. So the head waits for a reader
 * who is slow to take the end. Here the reader reads nothing for 0.3 s after the end is asked for, when the kernel has
 * the whole scan. */
static void test_a_slow_reader_has_the_end(void **state)
{
    struct wire *wire = *state;
    struct room_config scan = ENDLESS;
    struct scanhead_frame frame;
    static struct native_parser parser;
    uint32_t last = 0;
    ssize_t got;
    scan.prr_hz = 1000;
    scan.frames = 1;
    scan.pan_stop_deg = 2; /* 100 ms */
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &scan), NULL);
    struct scanhead *watch = client_open(head_endpoint(&head, "tcp"));
    int fd = port_open(wire);
    client_wait_state(watch, "idle");
    raw_send(fd, "SCAN:STAR\n", 10);
    client_until(watch, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_close(watch);
    assert_int_equal(kill(head.pid, SIGTERM), 0);
    struct pollfd gone = {.fd = pidfd_open(head.pid, 0), .events = POLLIN};
    assert_int_equal(poll(&gone, 1, 300), 0);
    close(gone.fd);
    native_parser_init(&parser);
    do {
        size_t room;
        uint8_t *to = native_parser_room(&parser, &room);
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        got = read(fd, to, room);
        native_parser_added(&parser, got > 0 ? (size_t)got : 0);
        for (enum native_item item; (item = native_parser_next(&parser)) != NATIVE_MORE;)
            if (item == NATIVE_FRAME) last = parser.header.seq;
    } while (got > 0);
    close(fd);
    head_end(&head, 0);
    assert_true(last >= frame.seq);
    assert_int_equal(parser.stats.seq_lost, 0);
}

/* The port is opened and closed as fast as possible, with a command or without. The client that stays is served. */
static void test_fast_open_and_close(void **state)
{
    struct wire *wire = *state;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &ENDLESS), NULL);
    for (int i = 0; i < 200; i++) {
        int fd = port_open(wire);
        if (i % 3 == 0) raw_send(fd, "*OPC?\n", 6);
        if (i % 7 == 0) raw_send(fd, "HEAD:PR", 7);
        close(fd);
    }
    struct scanhead *sh = client_open(head_endpoint(&head, "pty"));
    struct scanhead_frame frame;
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    int64_t since_ns = 0;
    for (int n = 0; n < 50; n += frame.type == SCANHEAD_POINTS) {
        client_next(sh, &frame);
        wire_soon(&since_ns, frame.t_ns, "50 frames of points");
    }
    client_tell(sh, "SCAN:STOP");
    client_until_soon(sh, SCANHEAD_EV_SCAN_END, &frame);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* A command by a shell's redirection is carried out, though its client is gone before the head looks. */
static void test_command_by_redirection(void **state)
{
    struct wire *wire = *state;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &ENDLESS), NULL);
    struct scanhead *watch = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    client_wait_state(watch, "idle");
    int fd = port_open(wire);
    raw_send(fd, "HEAD:PRR 54321\nSCAN:STAR\n", 25);
    close(fd);
    client_until_soon(watch, SCANHEAD_EV_SCAN_START, &frame);
    assert_string_equal(client_ask(watch, "HEAD:PRR?"), "54321");
    scanhead_close(watch);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_clients_with_default_settings, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_nothing_stale, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_taken_over_at_once, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_a_slow_reader_has_the_end, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_fast_open_and_close, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_command_by_redirection, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
