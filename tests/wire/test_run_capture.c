/* SPDX-License-Identifier: MIT */
/* A head is captured with `record --raw`; the capture then answers in its place. A client that says the same gets the
 * same bytes, over TCP and UDP. */
#include "tests/wire/captured.h"
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
    struct sockaddr_in at = {.sin_family = AF_INET};
    socklen_t len = sizeof at;
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0), room = 1 << 22;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(getsockname(fd, (struct sockaddr *)&at, &len), 0);
    *port = ntohs(at.sin_port);
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

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_tcp, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_udp, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
