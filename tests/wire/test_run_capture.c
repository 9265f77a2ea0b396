/* SPDX-License-Identifier: MIT */
/* A head is captured with `record --raw`; the capture then answers in its place. A client that says the same gets the
 * same bytes, over TCP and UDP. */
#include "drivers/protocol/ethernet.h"
#include "tests/wire/capture_rig.h"
#include "tests/wire/captured.h"
#include "tests/wire/replay_rig.h"
#include "tests/wire/room.h"

enum { PACKET = 1206, ROOM = 1 << 20 };

static const char CONFIG[] = "head: {profile: %s, start: on, frames: 0}\n"
                             "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
                             "stations: [{position_m: [0.31, -0.42, 0.17]}]\n"
                             "links: [{%s}]\n"
                             "loop: {late_ms: 10000, queue_ms: 10000}\n";

static struct head start(struct wire *wire, const char *profile, const char *link)
{
    char text[sizeof CONFIG + 200];
    const char *const more[] = {"--start", "--quiet", NULL};
    room_write(wire);
    snprintf(text, sizeof text, CONFIG, profile, link);
    return head_start(wire, wire_write_text(wire, "c.yaml", text), more);
}

/* Reads n bytes of a stream. */
static void read_all(int fd, uint8_t *to, size_t n)
{
    for (size_t at = 0; at < n;) {
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        if (poll(&slot, 1, SOON_MS) != 1) fail_msg("%zu of %zu bytes came", at, n);
        const ssize_t got = read(fd, to + at, n - at);
        assert_true(got > 0);
        at += (size_t)got;
    }
}

static size_t first_telegram(const uint8_t *bytes, size_t len)
{
    const uint8_t *end = memchr(bytes, 3, len);
    assert_non_null(end);
    return (size_t)(end - bytes) + 1;
}

static void test_tcp(void **state)
{
    struct wire *wire = *state;
    static const char ident[] = "\x02sRN DeviceIdent\x03", scans[] = "\x02sEN LMDscandata 1\x03",
                      odd[] = "\x02sRN Odd\x03";
    static uint8_t got[ROOM];
    struct captured captured;
    size_t len;
    struct head head = start(wire, "sick-tim571", "type: tcp, protocol: cola");
    const char *const talk[] = {
        "--duration", "0.6", "--send", "\\x02sRN DeviceIdent\\x03", "--send", "\\x02sEN LMDscandata 1\\x03", NULL};
    const int port = endpoint_port(head_endpoint(&head, "tcp"));
    struct raw_recorder recorder = raw_recorder_start(wire, head_endpoint(&head, "tcp"), talk);
    raw_recorder_end(&recorder, 0, 0, NULL);
    head_end(&head, SIGTERM);
    captured_read(wire, &captured);
    uint8_t *said = captured_stream(&captured, (uint16_t)port, &len);
    captured_free(&captured);
    assert_true(len < sizeof got && len > 1000);
    const char *const more[] = {"--quiet", "--link", "type: tcp", NULL};
    head = head_start(wire, wire_path(wire, "cap.pcapng"), more);
    const int fd = raw_connect(head_endpoint(&head, "tcp"));
    const size_t first = first_telegram(said, len);
    raw_send(fd, odd, sizeof odd - 1); /* has no answer, and does no harm */
    raw_send(fd, ident, sizeof ident - 1);
    read_all(fd, got, first);
    raw_send(fd, scans, sizeof scans - 1);
    read_all(fd, got + first, len - first);
    assert_memory_equal(got, said, len);
    close(fd);
    head_end(&head, SIGTERM);
    assert_int_equal(stats_link_uint(wire, "wrong_requests"), 1);
    free(said);
}

static int open_receiver(int *port)
{
    const int fd = wire_bind(SOCK_DGRAM, port), room = 1 << 22;
    setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
    return fd;
}

static void test_udp(void **state)
{
    struct wire *wire = *state;
    static uint8_t got[ROOM];
    struct captured captured;
    char link[120];
    int port;
    const char *const some[] = {"--duration", "0.1", "--wait", "60", NULL};
    struct raw_recorder recorder = raw_recorder_start(wire, "udp:127.0.0.1:0", some);
    assert_int_equal(sscanf(recorder.endpoint, "udp:127.0.0.1:%d", &port), 1);
    snprintf(link, sizeof link, "type: udp, protocol: velodyne, port: %d", port);
    struct head head = start(wire, "velodyne-vlp16", link);
    raw_recorder_end(&recorder, 0, 0, NULL);
    head_end(&head, SIGTERM);
    captured_read(wire, &captured);
    assert_true(captured.n > 20 && captured.n < ROOM / PACKET);
    const int fd = open_receiver(&port);
    snprintf(link, sizeof link, "type: udp, port: %d", port);
    const char *const more[] = {"--quiet", "--link", link, NULL};
    head = head_start(wire, wire_path(wire, "cap.pcapng"), more);
    for (uint32_t i = 0; i < captured.n; i++) {
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, SOON_MS), 1);
        assert_int_equal(recv(fd, got, sizeof got, 0), captured.packet[i].len);
        assert_memory_equal(got, captured.packet[i].data, captured.packet[i].len);
    }
    close(fd);
    head_end(&head, SIGTERM);
    captured_free(&captured);
}

/* A capture of one answer over TCP, and of one datagram. */
static const char *make_capture(struct wire *wire, int is_tcp)
{
    const struct ethernet_end client = {.address = {10, 0, 0, 2}, .port = 40000},
                              device = {.address = {10, 0, 0, 1}, .port = 2112};
    struct tcp_talk talk = {.end = {client, device}};
    uint8_t frame[ETHERNET_MAX_FRAME];
    struct capture capture = {0};
    capture_begin(&capture);
    const uint32_t at = capture_interface(&capture, CAPTURE_ETHERNET);
    if (is_tcp) {
        capture_packet(&capture, at, frame, tcp_put_syn(&talk, 0, frame));
        capture_packet(&capture, at, frame, tcp_put_data(&talk, 0, "a\n", 2, frame));
        capture_packet(&capture, at, frame, tcp_put_data(&talk, 1, "b\n", 2, frame));
    } else {
        capture_packet(&capture, at, frame, ethernet_put_udp(frame, &device, &client, "b", 1));
    }
    /* The name of the file says nothing. */
    const char *path = wire_write(wire, is_tcp ? "tcp" : "udp.pcapng", capture.bytes, capture.len);
    free(capture.bytes);
    return path;
}

/* Two datagrams, 0.4 s apart. */
static const char *make_two(struct wire *wire)
{
    enum { APART_US = 400000 };
    const struct ethernet_end client = {.address = {10, 0, 0, 2}, .port = 40000},
                              device = {.address = {10, 0, 0, 1}, .port = 2368};
    uint8_t frame[ETHERNET_MAX_FRAME];
    struct capture capture = {0};
    capture_begin(&capture);
    const uint32_t at = capture_interface(&capture, CAPTURE_ETHERNET);
    capture_packet(&capture, at, frame, ethernet_put_udp(frame, &device, &client, "a", 1));
    capture.n_packets += APART_US - 1; /* its clock: a packet is a microsecond */
    capture_packet(&capture, at, frame, ethernet_put_udp(frame, &device, &client, "b", 1));
    const char *path = wire_write(wire, "two.pcapng", capture.bytes, capture.len);
    free(capture.bytes);
    return path;
}

/* With --start the run ends by itself, once both datagrams are out. With --loop the capture has no end, and so --start
 * does not end it, either: a run that ended with its capture would end 1 s after it, and the fifth datagram comes at
 * 1.6 s. */
static void test_loop_has_no_end(void **state)
{
    enum { WANTED = 5 };
    struct wire *wire = *state;
    uint8_t got[8];
    char link[64];
    int port;
    const char *path = make_two(wire);
    const int fd = open_receiver(&port);
    snprintf(link, sizeof link, "type: udp, port: %d", port);
    assert_int_equal(replay_call(wire, (const char *const[]){"run", path, "--quiet", "--start", "--link", link, NULL}),
                     0);
    for (int i = 0; i < 2; i++) {
        assert_int_equal(recv(fd, got, sizeof got, MSG_DONTWAIT), 1);
        assert_int_equal(got[0], "ab"[i]);
    }
    assert_int_equal(recv(fd, got, sizeof got, MSG_DONTWAIT), -1);
    const char *const more[] = {"--quiet", "--start", "--loop", "--link", link, NULL};
    struct head head = head_start(wire, path, more);
    for (int i = 0; i < WANTED; i++) {
        struct pollfd slot[2] = {{.fd = fd, .events = POLLIN}, {.fd = pidfd_open(head.pid, 0), .events = POLLIN}};
        assert_int_equal(poll(slot, 2, SOON_MS), 1);
        close(slot[1].fd);
        if (slot[0].revents == 0) fail_msg("the run ended after %d datagrams", i);
        assert_int_equal(recv(fd, got, sizeof got, 0), 1);
        assert_int_equal(got[0], i % 2 == 0 ? 'a' : 'b');
    }
    close(fd);
    head_end(&head, SIGTERM);
}

/* Counts the lines of the head's messages that have a text. */
static int lines_with(const char *text, const char *part)
{
    int n = 0;
    while ((text = strstr(text, part)) != NULL) {
        n++;
        text += strcspn(text, "\n");
    }
    return n;
}

/* Writes a capture of two ports and of packets that can't be served: two requests and an answer over TCP, three
 * datagrams, a packet of link type 147, one without an IP header, one fragment (RFC 791: an offset of 1), and a
 * datagram 2 s earlier than the others. A segment of 5 bytes is missing. */
static const char *make_mixed(struct wire *wire)
{
    const struct ethernet_end client = {.address = {10, 0, 0, 2}, .port = 40000},
                              device = {.address = {10, 0, 0, 1}, .port = 2112},
                              sender = {.address = {10, 0, 0, 1}, .port = 2368};
    struct tcp_talk talk = {.end = {client, device}};
    uint8_t frame[ETHERNET_MAX_FRAME];
    struct capture capture = {.n_packets = 3000000}; /* its clock: a packet is a microsecond */
    capture_begin(&capture);
    const uint32_t at = capture_interface(&capture, CAPTURE_ETHERNET),
                   other = capture_interface(&capture, CAPTURE_USER0);
    capture_packet(&capture, at, frame, tcp_put_syn(&talk, 0, frame));
    capture_packet(&capture, at, frame, tcp_put_data(&talk, 0, "a\n", 2, frame));
    capture_packet(&capture, at, frame, tcp_put_data(&talk, 1, "b\n", 2, frame));
    tcp_put_data(&talk, 0, "lost\n", 5, frame);
    capture_packet(&capture, at, frame, tcp_put_data(&talk, 0, "c\n", 2, frame));
    for (int i = 0; i < 3; i++)
        capture_packet(&capture, at, frame, ethernet_put_udp(frame, &sender, &client, "d", 1));
    capture_packet(&capture, other, "e", 1);
    capture_packet(&capture, at, frame, 14);
    const size_t len = ethernet_put_udp(frame, &sender, &client, "f", 1);
    frame[14 + 7] = 1;
    capture_packet(&capture, at, frame, len);
    capture.n_packets -= 2000000;
    capture_packet(&capture, at, frame, ethernet_put_udp(frame, &sender, &client, "g", 1));
    const char *path = wire_write(wire, "mixed.pcapng", capture.bytes, capture.len);
    free(capture.bytes);
    return path;
}

static void test_messages(void **state)
{
    static const char *const says[] = {
        "tcp port 2112 of 10.0.0.1: lines, 2 different requests, 1 messages\n",
        "udp port 40000 of 10.0.0.1: datagrams, 0 different requests, 4 messages\n",
        "udp port 40000 of 10.0.0.1 is not served: no link is left for it\n",
        ": 5 bytes are missing in it; ",
        ": the times of 1 packets go back, and 0 packets have none; ",
        ": left out 1 packets of other link types, such as 147\n",
        ": left out 1 fragments of datagrams, and 1 packets with damaged headers\n",
    };
    struct wire *wire = *state;
    struct head head = head_start(wire, make_mixed(wire), (const char *const[]){"--link", "type: tcp", NULL});
    head_end(&head, SIGTERM);
    char *text = wire_read(wire_path(wire, "head.err"), NULL);
    for (size_t i = 0; i < sizeof says / sizeof *says; i++)
        if (lines_with(text, says[i]) != 1) fail_msg("not once '%s' in: %s", says[i], text);
    assert_int_equal(lines_with(text, " port "), 3); /* no other port is named */
    free(text);
}

/* A link has a port of its own kind, though the other one comes first in the capture: datagrams go to the client of the
 * udp link, and nothing of the tcp port does. With --device-port it has that port or none. */
static void test_kinds(void **state)
{
    struct wire *wire = *state;
    char link[60], byte;
    int port;
    const int fd = open_receiver(&port);
    snprintf(link, sizeof link, "type: udp, port: %d", port);
    struct head head = head_start(wire, make_mixed(wire), (const char *const[]){"--link", link, NULL});
    struct pollfd slot = {.fd = fd, .events = POLLIN};
    assert_int_equal(poll(&slot, 1, SOON_MS), 1);
    assert_int_equal(recv(fd, &byte, 1, MSG_TRUNC), 1);
    assert_true(byte == 'g' || byte == 'd');
    close(fd);
    head_end(&head, SIGTERM);
    char *text = wire_read(wire_path(wire, "head.err"), NULL);
    assert_int_equal(lines_with(text, "tcp port 2112 of 10.0.0.1 is not served: no link is left for it\n"), 1);
    free(text);
    const char *const none[] = {"run", make_mixed(wire), "--device-port", "2112", "--link", link, NULL};
    assert_int_equal(replay_call(wire, none), 2);
    replay_said(wire, ": no port of ");
    replay_said(wire, "is left for it with --device-port; it has tcp 2112 of 10.0.0.1, udp 40000 of 10.0.0.1\n");
}

/* Each unknown request is said once. After 63 different ones the head says that it says no more: it remembers 64. */
static void test_unknown_requests(void **state)
{
    enum { SAID = 63, ASKED = 70 };
    struct wire *wire = *state;
    uint8_t got[2];
    char request[16];
    struct head head = head_start(wire, make_capture(wire, 1), (const char *const[]){"--link", "type: tcp", NULL});
    const int fd = raw_connect(head_endpoint(&head, "tcp"));
    for (int i = 0; i < 2 * ASKED; i++)
        raw_send(fd, request, (size_t)snprintf(request, sizeof request, "x%d\n", i / 2));
    raw_send(fd, "a\n", 2);
    read_all(fd, got, 2); /* all are answered */
    close(fd);
    head_end(&head, SIGTERM);
    assert_int_equal(stats_link_uint(wire, "wrong_requests"), 2 * ASKED);
    char *text = wire_read(wire_path(wire, "head.err"), NULL);
    assert_int_equal(lines_with(text, "the capture has no such request: x"), SAID);
    assert_int_equal(lines_with(text, "further messages of its protocol are not shown"), 1);
    free(text);
}

static void test_refused(void **state)
{
    struct wire *wire = *state;
    static const struct {
        int is_tcp;
        const char *option, *value, *said;
    } cases[] = {
        {1, "--device-port", "1", "no such port; it has tcp 2112 of 10.0.0.1\n"},
        {1, "--link", "usb", "allowed pty, tcp, udp"},
        {1, "--link", "null", "allowed pty, tcp, udp"},
        {1, "--link", "web", "allowed pty, tcp, udp"},
        {0, "--unknown", "close", "which has no connection to end"},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const char *const args[] = {"run", make_capture(wire, cases[i].is_tcp), cases[i].option, cases[i].value, NULL};
        assert_int_equal(replay_call(wire, args), 2);
        replay_said(wire, cases[i].said);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_tcp, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_udp, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_loop_has_no_end, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_messages, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_kinds, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_unknown_requests, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_refused, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
