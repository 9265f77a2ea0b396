/* SPDX-License-Identifier: MIT */
/* Clients of tcp that shut down their sending side, as `nc -N` does. Each gets all that is due to it, and then its
 * session ends. Clients that read nothing hold up nobody. Many that ask at once are each answered. */
#include <errno.h>

#include "drivers/protocol/native.h"
#include "tests/wire/room.h"

/* Ten lines: a scan of 0.4 s. */
static struct head start(struct wire *wire, const char *links, const char *pace)
{
    const struct room_config config = {
        .prr_hz = 10000, .lines_hz = 25, .pan_deg_s = 100, .pan_stop_deg = 40, .frames = 1, .links = links};
    const char *const more[] = {"--pace", pace, NULL};
    room_write(wire);
    return head_start(wire, room_config_write(wire, &config), more);
}

static void wait_idle(const char *endpoint)
{
    struct scanhead *sh = client_open(endpoint);
    client_wait_state(sh, "idle");
    scanhead_close(sh);
}

/* Sends the text and nothing more. */
static int say_all(const char *endpoint, const char *text)
{
    const int fd = raw_connect(endpoint);
    raw_send(fd, text, strlen(text));
    assert_int_equal(shutdown(fd, SHUT_WR), 0);
    return fd;
}

static ssize_t read_some(int fd, void *to, size_t room)
{
    struct pollfd slot = {.fd = fd, .events = POLLIN};
    if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("%s", "neither bytes nor an end");
    const ssize_t n = read(fd, to, room);
    if (n < 0) fail_msg("read: %s", strerror(errno));
    return n;
}

/* All lines and frames that come until the head ends the session. */
struct got {
    char lines[4000];
    int n_frames, has_ended; /* the scan */
};

static void read_native(int fd, struct got *got)
{
    static struct native_parser parser;
    size_t n_lines = 0, room;
    native_parser_init(&parser);
    *got = (struct got){.n_frames = 0};
    for (ssize_t n = 1; n > 0;) {
        uint8_t *to = native_parser_room(&parser, &room);
        n = read_some(fd, to, room);
        native_parser_added(&parser, (size_t)n);
        for (enum native_item item; (item = native_parser_next(&parser)) != NATIVE_MORE;) {
            struct native_event event;
            if (item == NATIVE_FRAME) got->n_frames++;
            if (item == NATIVE_FRAME && parser.header.type == NATIVE_EVENT &&
                native_decode_event(parser.payload, parser.header.length, &event) == 0)
                got->has_ended |= event.code == NATIVE_EV_SCAN_END;
            if (item != NATIVE_TEXT) continue;
            n_lines += (size_t)snprintf(got->lines + n_lines, sizeof got->lines - n_lines, "%s\n", parser.text);
            assert_true(n_lines < sizeof got->lines);
        }
    }
    close(fd);
}

static void a_question_and_no_more(void **state)
{
    static struct got got;
    struct head head = start(*state, LINK_YAML_TCP, "realtime");
    const char *at = head_endpoint(&head, "tcp");
    wait_idle(at);
    read_native(say_all(at, "HEAD:STAT?\nSCAN:FRAM?\n"), &got);
    assert_non_null(strstr(got.lines, "idle\n"));
    assert_non_null(strstr(got.lines, "\n1\n"));
    assert_false(got.has_ended);
    head_end(&head, SIGTERM);
}

/* A client that has sent all takes the whole scan, though control went back to others. The scan is whole at any
 * pace. */
static void a_scan_and_no_more(void **state)
{
    static const char *const paces[] = {"realtime", "fast"};
    static struct got got;
    for (size_t i = 0; i < sizeof paces / sizeof paces[0]; i++) {
        struct head head = start(*state, LINK_YAML_TCP, paces[i]);
        const char *at = head_endpoint(&head, "tcp");
        wait_idle(at);
        read_native(say_all(at, "SCAN:STAR\n"), &got);
        assert_non_null(strstr(got.lines, "OK\n"));
        assert_true(got.has_ended);
        assert_true(got.n_frames > 10); /* ten lines, each with points and an end */
        head_end(&head, SIGTERM);
    }
}

/* Exactly two units of a stream with an end come, and the session ends after them. */
static void two_scans_of_scip(void **state)
{
    static char got[1 << 16];
    const struct room_config config = {.profile = "hokuyo-utm-30lx",
                                       .prr_hz = 57600,
                                       .lines_hz = 40,
                                       .links =
                                           "links: [{type: tcp, protocol: scip, port: 0}, {type: tcp, port: 0}]\n"};
    struct wire *wire = *state;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    size_t n = 0;
    wait_idle(head_link(&head, 1));
    const int fd = say_all(head_link(&head, 0), "BM\nMD0000108001002\n");
    for (ssize_t more = 1; more > 0; n += (size_t)more)
        more = read_some(fd, got + n, sizeof got - 1 - n);
    got[n] = '\0';
    const char *one = strstr(got, "MD0000108001001\n99b\n"), *none = strstr(got, "MD0000108001000\n99b\n");
    assert_true(one != NULL && none != NULL && one < none);
    close(fd);
    head_end(&head, SIGTERM);
}

/* One client asks for a scan and reads nothing. One has sent all and reads nothing. One goes on sending. Another one
 * has its answers and its whole scan, and the head ends. */
static void nobody_waits_for_who_does_not_read(void **state)
{
    struct wire *wire = *state;
    struct scanhead_frame frame;
    static char garbage[1 << 16];
    memset(garbage, 'x', sizeof garbage);
    struct head head = start(wire, LINK_YAML_TCP, "realtime");
    const char *at = head_endpoint(&head, "tcp");
    wait_idle(at);
    const int silent = raw_connect(at), shut = say_all(at, "*IDN?\n"), flood = raw_connect(at);
    const int size = 1 << 12;
    setsockopt(silent, SOL_SOCKET, SO_RCVBUF, &size, sizeof size);
    for (ssize_t n = 1; n > 0;)
        n = send(flood, garbage, sizeof garbage, MSG_DONTWAIT | MSG_NOSIGNAL);
    assert_int_equal(errno, EAGAIN);
    struct scanhead *sh = client_open(at);
    client_tell(sh, "SCAN:STAR");
    client_until(sh, SCANHEAD_EV_SCAN_END, &frame);
    assert_string_equal(client_ask(sh, "SCAN:FRAM?"), "1");
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    assert_true(stats_uint(wire, "pulses") > 0);
    close(silent);
    close(shut);
    close(flood);
}

/* The page of settings has four places. Eight clients that ask at once are all answered, and the fifth waits for a
 * place. */
static void a_crowd_that_asks(void **state)
{
    enum { CLIENTS = 8, ROUNDS = 20 };
    static const char ask[] = "GET /cgi/status.json HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n";
    struct wire *wire = *state;
    const struct room_config config = {.profile = "velodyne-vlp16",
                                       .prr_hz = 289351.851852,
                                       .lines_hz = 10,
                                       .links = "links: [{type: tcp, protocol: velodyne-http, port: 0}]\n"};
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &config), NULL);
    for (int round = 0; round < ROUNDS; round++) {
        int fd[CLIENTS];
        for (int i = 0; i < CLIENTS; i++) {
            fd[i] = raw_connect(head_link(&head, 0));
            raw_send(fd[i], ask, sizeof ask - 1);
        }
        for (int i = 0; i < CLIENTS; i++) {
            char got[4096] = "";
            size_t n = 0;
            for (ssize_t more = 1; more > 0 && strstr(got, "\r\n\r\n") == NULL; n += (size_t)more) {
                more = read_some(fd[i], got + n, sizeof got - 1 - n);
                got[n + (size_t)more] = '\0';
            }
            assert_memory_equal(got, "HTTP/1.1 200", 12);
        }
        for (int i = 0; i < CLIENTS; i++)
            close(fd[i]);
    }
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_question_and_no_more, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_scan_and_no_more, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(two_scans_of_scip, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(a_crowd_that_asks, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(nobody_waits_for_who_does_not_read, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
