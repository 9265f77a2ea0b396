/* SPDX-License-Identifier: MIT */
/* These are tests of `record --raw` of TCP. They cover the exchange of the recorder and a device, and a Hokuyo with its
 * client over the relay. Others are a SICK scanner and the native protocol asked by --send, and connections that end in
 * odd ways. */
#include <linux/sockios.h>
#include <sys/ioctl.h>

#include "drivers/socket/socket.h"
#include "drivers/socket/stamped.h"
#include "tests/wire/captured.h"
#include "tests/wire/room.h"

enum { ROOM = 1 << 24 };

static int port_of(int fd)
{
    struct sockaddr_in at;
    socklen_t len = sizeof at;
    assert_int_equal(getsockname(fd, (struct sockaddr *)&at, &len), 0);
    return ntohs(at.sin_port);
}

/* Opens a listening device of the test's own. port 0: the system chooses. source: the recorder's SOURCE. */
static int device_open_at(int port, char source[64])
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0), one = 1;
    setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    assert_int_equal(bind(fd, (struct sockaddr *)&at, sizeof at), 0);
    assert_int_equal(listen(fd, 8), 0);
    snprintf(source, 64, "tcp:127.0.0.1:%d", port_of(fd));
    return fd;
}

static int device_open(char source[64])
{
    return device_open_at(0, source);
}

static int take_connection(int fd)
{
    struct pollfd slot = {.fd = fd, .events = POLLIN};
    assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
    const int connection = accept4(fd, NULL, NULL, SOCK_CLOEXEC);
    assert_true(connection >= 0);
    return connection;
}

/* Reads exactly so many bytes; len 0: until the end. Returns how many. */
static size_t read_all(int fd, uint8_t *bytes, size_t len)
{
    const size_t most = len != 0 ? len : ROOM;
    size_t have = 0;
    while (have < most) {
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        const ssize_t n = read(fd, bytes + have, most - have);
        if (n <= 0) break;
        have += (size_t)n;
    }
    if (len != 0) assert_int_equal(have, len);
    return have;
}

static void expect_stream(const struct captured *captured, int from_port, const void *bytes, size_t len)
{
    size_t n;
    uint8_t *stream = captured_stream(captured, (uint16_t)from_port, &n);
    assert_int_equal(n, len);
    if (memcmp(stream, bytes, len) != 0) fail_msg("other bytes from port %d", from_port);
    free(stream);
}

/* Returns the place in the file of the first data from a port. */
static uint32_t first_from(const struct captured *captured, int from_port)
{
    uint32_t i = 0;
    while (i < captured->n && (captured->packet[i].from_port != from_port || captured->packet[i].len == 0))
        i++;
    assert_true(i < captured->n);
    return i;
}

/* ---- this program and a device */

/* The second text is sent when the first one was answered. Large answers come whole, and the device ends the
 * connection. */
static void test_send(void **state)
{
    struct wire *wire = *state;
    static uint8_t answer[200000], got[64];
    struct captured captured;
    char source[64];
    const int device = device_open(source);
    for (size_t i = 0; i < sizeof answer; i++)
        answer[i] = (uint8_t)(i * i >> 7);
    struct raw_recorder recorder =
        raw_recorder_start(wire, source, (const char *const[]){"--send", "\\x02one\\x03", "--send", "two\\n\\0", NULL});
    const int fd = take_connection(device);
    struct sockaddr_in peer;
    socklen_t len = sizeof peer;
    assert_int_equal(getpeername(fd, (struct sockaddr *)&peer, &len), 0);
    read_all(fd, got, 5);
    assert_memory_equal(got, "\2one\3", 5);
    raw_send(fd, answer, sizeof answer);
    read_all(fd, got, 5);
    assert_memory_equal(got, "two\n\0", 5);
    raw_send(fd, "end", 3);
    close(fd);
    close(device);
    raw_recorder_end(&recorder, 0, 0, NULL);
    captured_read(wire, &captured);
    captured_check_order(&captured);
    const int device_port = atoi(strrchr(source, ':') + 1);
    captured_check_talk(&captured, ntohs(peer.sin_port), (uint16_t)device_port, 0);
    expect_stream(&captured, ntohs(peer.sin_port), "\2one\3two\n\0", 10);
    static uint8_t all[sizeof answer + 3];
    memcpy(all, answer, sizeof answer);
    memcpy(all + sizeof answer, "end", 3);
    expect_stream(&captured, device_port, all, sizeof all);
    assert_true(stats_uint(wire, "received_bytes") == sizeof all && stats_uint(wire, "sent_bytes") == 10);
    captured_check_tshark(wire);
    captured_free(&captured);
}

static void test_reset(void **state)
{
    struct wire *wire = *state;
    struct captured captured;
    char source[64];
    uint8_t byte;
    const int device = device_open(source);
    struct raw_recorder recorder = raw_recorder_start(wire, source, (const char *const[]){"--send", "a", NULL});
    const int fd = take_connection(device);
    read_all(fd, &byte, 1);
    socket_break(fd);
    close(fd);
    close(device);
    raw_recorder_end(&recorder, 0, 1, "the device broke the connection");
    captured_read(wire, &captured);
    captured_check_talk(&captured, captured.packet[0].from_port, captured.packet[0].to_port, 1);
    captured_free(&captured);
}

/* Returns how many bytes the other end of a connection has not read yet. */
static unsigned unread(int fd)
{
    struct sockaddr_in peer;
    socklen_t len = sizeof peer;
    char line[256];
    unsigned local, rest, found = 1;
    assert_int_equal(getpeername(fd, (struct sockaddr *)&peer, &len), 0);
    FILE *table = fopen("/proc/net/tcp", "r");
    assert_non_null(table);
    while (fgets(line, sizeof line, table) != NULL)
        if (sscanf(line, " %*d: %*8x:%4x %*8x:%*4x %*2x %*8x:%8x", &local, &rest) == 2 && local == ntohs(peer.sin_port))
            found = rest;
    fclose(table);
    return found;
}

/* Bytes that come while the recorder stands still have the time at which they came. No more may come before they are
 * read: the kernel would join the two, and keep the later time. */
static void test_times(void **state)
{
    struct wire *wire = *state;
    struct captured captured;
    char source[64];
    const int device = device_open(source);
    struct raw_recorder recorder = raw_recorder_start(wire, source, NULL);
    const int fd = take_connection(device);
    raw_recorder_stop(&recorder);
    raw_send(fd, "a", 1);
    for (int unsent = 1; unsent != 0;) /* until it has arrived */
        assert_int_equal(ioctl(fd, SIOCOUTQ, &unsent), 0);
    const int64_t standing_ns = raw_recorder_go_on(&recorder);
    while (unread(fd) != 0)
        poll(NULL, 0, 1);
    close(fd);
    close(device);
    raw_recorder_end(&recorder, 0, 0, NULL);
    captured_read(wire, &captured);
    const uint32_t i = first_from(&captured, atoi(strrchr(source, ':') + 1));
    assert_true(captured.packet[i].t_ns < standing_ns);
    captured_free(&captured);
}

static void test_silence(void **state)
{
    struct wire *wire = *state;
    char source[64];
    const int device = device_open(source);
    struct raw_recorder recorder = raw_recorder_start(wire, source, NULL);
    const int fd = take_connection(device);
    raw_recorder_end(&recorder, SIGINT, 1, "the device sent nothing; most devices send only after");
    close(fd);
    close(device);
}

/* ---- real heads */

static struct head start_head(struct wire *wire, const char *profile, const char *links)
{
    char text[1024];
    snprintf(text, sizeof text,
             "head: {profile: %s, start: on, frames: 0}\n"
             "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
             "stations: [{position_m: [0.31, -0.42, 0.17], lat_deg: 48.1, lon_deg: 11.6, height_m: 500}]\n"
             "time: {epoch: utc}\n"
             "links: [%s]\n"
             "gnss: {rate_hz: 20}\nloop: {late_ms: 10000, queue_ms: 10000}\n",
             profile, links);
    room_write(wire);
    return head_start(wire, wire_write_text(wire, "config.yaml", text), NULL);
}

struct exchange {
    int fd;
    char said[1 << 16];
    uint8_t *heard;
    size_t n_said, n; /* n: heard */
};

/* An answer of SCIP ends with an empty line. */
static void ask(struct exchange *x, const char *text, int ends)
{
    raw_send(x->fd, text, strlen(text));
    assert_true(x->n_said + strlen(text) < sizeof x->said);
    memcpy(x->said + x->n_said, text, strlen(text));
    x->n_said += strlen(text);
    for (; ends > 0; x->n++) {
        assert_true(x->n < ROOM);
        read_all(x->fd, x->heard + x->n, 1);
        ends -= x->n > 0 && x->heard[x->n] == '\n' && x->heard[x->n - 1] == '\n';
    }
}

/* A driver's exchange: both sides are captured byte by byte, and each question is before its answer. */
static void test_relay_of_scip(void **state)
{
    struct wire *wire = *state;
    static uint8_t heard[ROOM];
    struct captured captured;
    struct head head = start_head(wire, "hokuyo-utm-30lx", "{type: tcp, protocol: scip, port: 0}");
    char source[64];
    snprintf(source, sizeof source, "%s", head_link(&head, 0));
    struct raw_recorder recorder = raw_recorder_start(wire, source, (const char *const[]){"--relay", "0", NULL});
    static struct exchange x;
    x = (struct exchange){.fd = raw_connect(recorder.endpoint), .heard = heard};
    ask(&x, "VV\n", 1);
    ask(&x, "PP\n", 1);
    do
        ask(&x, "BM\n", 1);
    while (memcmp(heard + x.n - 5, "10Q", 3) == 0); /* it spins up */
    ask(&x, "MD0000108000003\n", 4);                /* an echo, and three scans */
    shutdown(x.fd, SHUT_WR);                        /* the sensor ends its side then */
    x.n += read_all(x.fd, heard + x.n, 0);
    close(x.fd);
    raw_recorder_end(&recorder, SIGINT, 0, NULL);
    captured_read(wire, &captured);
    captured_check_order(&captured);
    const int device_port = endpoint_port(source), client_port = captured.packet[0].from_port;
    assert_int_equal(captured.packet[0].to_port, device_port);
    captured_check_talk(&captured, (uint16_t)client_port, (uint16_t)device_port, 0);
    expect_stream(&captured, client_port, x.said, x.n_said);
    expect_stream(&captured, device_port, heard, x.n);
    assert_true(first_from(&captured, client_port) < first_from(&captured, device_port));
    assert_int_equal(stats_uint(wire, "connections"), 1);
    captured_check_tshark(wire);
    captured_free(&captured);
    head_end(&head, SIGTERM);
}

/* Returns whether a recording of that length has the link's answer to `text`. */
static int is_answered(struct wire *wire, const char *source, const char *text, const char *answer,
                       const char *length_s)
{
    struct captured captured;
    size_t len;
    const char *const more[] = {"--duration", length_s, text != NULL ? "--send" : NULL, text, NULL};
    struct raw_recorder recorder = raw_recorder_start(wire, source, more);
    wire_wait(wire, recorder.pid);
    captured_read(wire, &captured);
    captured_check_talk(&captured, captured.packet[0].from_port, captured.packet[0].to_port, 0);
    uint8_t *stream = captured_stream(&captured, (uint16_t)endpoint_port(source), &len);
    const int found = memmem(stream, len, answer, strlen(answer)) != NULL;
    free(stream);
    captured_free(&captured);
    return found;
}

/* The recording gets longer until it has the answer, as a busy machine takes longer. */
static void check_asked(struct wire *wire, const char *source, const char *text, const char *answer)
{
    if (!is_answered(wire, source, text, answer, "0.1") && !is_answered(wire, source, text, answer, "1") &&
        !is_answered(wire, source, text, answer, "10"))
        fail_msg("%s: no %s within 10 s", source, answer);
}

/* CoLa, the native protocol with its frames, and NMEA, which needs no question. */
static void test_others(void **state)
{
    struct wire *wire = *state;
    char source[3][64];
    struct head head = start_head(wire, "sick-tim571",
                                  "{type: tcp, protocol: cola, port: 0}, {type: tcp, port: 0}, "
                                  "{type: tcp, protocol: nmea, port: 0}");
    for (int i = 0; i < 3; i++)
        snprintf(source[i], sizeof source[i], "%s", head_link(&head, i));
    check_asked(wire, source[0], "\\x02sRN DeviceIdent\\x03", "\2sRA DeviceIdent ");
    check_asked(wire, source[1], "*IDN?\\n", "scanhead");
    check_asked(wire, source[2], NULL, "$GN");
    head_end(&head, SIGTERM);
}

/* ---- odd ends of clients */

/* One client breaks off, one comes while the device is away, and one is served after that. */
static void test_clients(void **state)
{
    struct wire *wire = *state;
    struct captured captured;
    char source[64];
    uint8_t byte;
    int device = device_open(source);
    const int device_port = port_of(device);
    struct raw_recorder recorder = raw_recorder_start(wire, source, (const char *const[]){"--relay", "0", NULL});
    int client = raw_connect(recorder.endpoint), fd = take_connection(device);
    raw_send(client, "a", 1);
    read_all(fd, &byte, 1);
    socket_break(client);
    close(client);
    assert_int_equal(read_all(fd, &byte, 0), 0); /* broken, too */
    close(fd);
    close(device);
    client = raw_connect(recorder.endpoint);
    assert_int_equal(read_all(client, &byte, 0), 0);
    close(client);
    device = device_open_at(device_port, source);
    client = raw_connect(recorder.endpoint);
    fd = take_connection(device);
    raw_send(client, "b", 1);
    read_all(fd, &byte, 1);
    assert_int_equal(byte, 'b');
    raw_send(fd, "c", 1);
    close(fd); /* the device dies */
    assert_int_equal(read_all(client, &byte, 1), 1);
    assert_int_equal(read_all(client, &byte, 0), 0);
    close(client);
    close(device);
    raw_recorder_end(&recorder, SIGINT, 0, "Connection refused");
    captured_read(wire, &captured);
    captured_check_order(&captured);
    expect_stream(&captured, device_port, "c", 1);
    assert_int_equal(stats_uint(wire, "connections"), 2);
    assert_int_equal(stats_uint(wire, "refused_connections"), 1);
    captured_check_talk(&captured, captured.packet[0].from_port, (uint16_t)device_port, 1);
    captured_check_talk(&captured,
                        captured.packet[captured.n - 1].from_port == device_port
                            ? captured.packet[captured.n - 1].to_port
                            : captured.packet[captured.n - 1].from_port,
                        (uint16_t)device_port, 0);
    captured_free(&captured);
}

/* A client that does not read holds its device back, and no byte is lost. The system's buffers fill up until nothing
 * moves any more. */
static void test_slow_client(void **state)
{
    struct wire *wire = *state;
    static uint8_t sent[ROOM], got[ROOM];
    struct captured captured;
    char source[64];
    size_t n = 0;
    const int device = device_open(source);
    for (size_t i = 0; i < sizeof sent; i++)
        sent[i] = (uint8_t)(i * 31 >> 3);
    struct raw_recorder recorder = raw_recorder_start(wire, source, (const char *const[]){"--relay", "0", NULL});
    const int small = 65536, client = raw_connect(recorder.endpoint), fd = take_connection(device);
    setsockopt(client, SOL_SOCKET, SO_RCVBUF, &small, sizeof small);
    struct pollfd slot = {.fd = fd, .events = POLLOUT};
    while (n < sizeof sent && poll(&slot, 1, 100) == 1) {
        const ssize_t now = send(fd, sent + n, sizeof sent - n, MSG_DONTWAIT | MSG_NOSIGNAL);
        assert_true(now > 0);
        n += (size_t)now;
    }
    close(fd);
    if (n == sizeof sent) print_message("the system holds %zu bytes\n", n);
    assert_int_equal(read_all(client, got, 0), n);
    assert_memory_equal(got, sent, n);
    close(client);
    close(device);
    raw_recorder_end(&recorder, SIGINT, 0, NULL);
    captured_read(wire, &captured);
    captured_check_order(&captured);
    expect_stream(&captured, atoi(strrchr(source, ':') + 1), sent, n);
    captured_free(&captured);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_send, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_reset, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_times, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_silence, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_relay_of_scip, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_others, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_clients, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_slow_client, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
