/* SPDX-License-Identifier: MIT */
/* `record --raw` of UDP: each datagram is captured whole and in order, of a test's socket and of a VLP-16. Datagrams
 * that the kernel has no room for are counted. Wrong command lines are refused. */
#include "core/bytes.h"
#include "tests/wire/captured.h"
#include "tests/wire/room.h"
#include "tests/wire/usage_rig.h"

enum { MANY = 300, LARGEST = 65507 };

/* "udp:127.0.0.1:1,2" */
static void read_ports(const struct raw_recorder *recorder, int port[2])
{
    assert_int_equal(sscanf(recorder->endpoint, "udp:127.0.0.1:%d,%d", &port[0], &port[1]), 2);
}

static uint16_t sender_open(int *fd)
{
    int port;
    *fd = wire_bind(SOCK_DGRAM, &port);
    return (uint16_t)port;
}

static void send_to(int fd, int port, const uint8_t *data, size_t len)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    assert_int_equal(sendto(fd, data, len, 0, (struct sockaddr *)&at, sizeof at), len);
}

static size_t length_of(int i)
{
    return i == 5 ? 0 : i == 77 ? LARGEST : (size_t)(i * 7 % 1473);
}

/* Checks the ports one by one; together they have all packets and bytes. */
static void check_sources(const struct wire *wire, uint64_t bytes)
{
    char *text = wire_read(wire_path(wire, "stats.json"), NULL);
    uint64_t packets = 0, sum = 0;
    int n = 0;
    for (const char *at = strstr(text, "\"endpoint\""); at != NULL; at = strstr(at + 1, "\"endpoint\""), n++) {
        packets += strtoull(strstr(at, "\"packets\":") + strlen("\"packets\":"), NULL, 10);
        sum += strtoull(strstr(at, "\"bytes\":") + strlen("\"bytes\":"), NULL, 10);
    }
    free(text);
    assert_true(n == 2 && packets == MANY && sum == bytes);
}

/* One socket sends to two others. The file has the order of sending. */
static void test_datagrams(void **state)
{
    struct wire *wire = *state;
    static uint8_t data[LARGEST];
    struct captured captured;
    int port[2], fd;
    uint64_t bytes = 0;
    struct timespec began, ended;
    struct raw_recorder recorder = raw_recorder_start(wire, "udp:127.0.0.1:0,0", NULL);
    read_ports(&recorder, port);
    const uint16_t own = sender_open(&fd);
    clock_gettime(CLOCK_REALTIME, &began);
    for (int i = 0; i < MANY; i++) {
        memset(data, i, sizeof data);
        send_to(fd, port[i * i % 3 % 2], data, length_of(i));
        bytes += length_of(i);
    }
    clock_gettime(CLOCK_REALTIME, &ended);
    close(fd);
    char said[256];
    snprintf(said, sizeof said, "scanhead: 300 packets, %.3f MB in %s\n", 1e-6 * (double)bytes,
             wire_path(wire, "cap.pcapng"));
    raw_recorder_end(&recorder, SIGINT, 0, said);
    captured_read(wire, &captured);
    captured_check_order(&captured);
    assert_int_equal(captured.n, MANY);
    for (int i = 0; i < MANY; i++) {
        const struct captured_packet *p = &captured.packet[i];
        memset(data, i, sizeof data);
        assert_true(p->is_udp && p->from == 0x7f000001 && p->to == 0x7f000001 && p->from_port == own);
        assert_int_equal(p->to_port, port[i * i % 3 % 2]);
        assert_int_equal(p->len, length_of(i));
        assert_memory_equal(p->data, data, p->len);
    }
    /* The kernel's times are of the same clock. */
    assert_true(captured.packet[0].t_ns >= began.tv_sec * 1000000000 + began.tv_nsec);
    assert_true(captured.packet[MANY - 1].t_ns <= ended.tv_sec * 1000000000 + ended.tv_nsec);
    assert_true(stats_uint(wire, "packets") == MANY && stats_uint(wire, "bytes") == bytes);
    assert_int_equal(stats_uint(wire, "dropped"), 0);
    check_sources(wire, bytes);
    captured_check_tshark(wire);
    captured_free(&captured);
}

/* ---- a VLP-16: the capture has the same packets as another link of the head wrote to files */

static const char *velodyne_config(struct wire *wire, const int port[2])
{
    char text[1024];
    snprintf(text, sizeof text,
             "head: {profile: velodyne-vlp16, start: on, frames: 0}\n"
             "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
             "stations: [{position_m: [0.31, -0.42, 0.17]}]\n"
             "beam: {echoes: strongest}\n"
             "links: [{type: udp, protocol: velodyne, port: %d}, {type: udp, protocol: velodyne-position, port: %d},\n"
             "  {type: file, protocol: velodyne, path: data}]\n"
             "loop: {late_ms: 10000, queue_ms: 10000}\n",
             port[0], port[1]);
    room_write(wire);
    return wire_write_text(wire, "config.yaml", text);
}

static void test_velodyne(void **state)
{
    struct wire *wire = *state;
    struct captured captured;
    int port[2];
    struct raw_recorder recorder = raw_recorder_start(wire, "udp:127.0.0.1:0,0", NULL);
    read_ports(&recorder, port);
    struct head head = head_start(wire, velodyne_config(wire, port), (const char *const[]){"--duration", "0.3", NULL});
    head_end(&head, 0);
    raw_recorder_end(&recorder, SIGTERM, 0, NULL);
    captured_read(wire, &captured);
    captured_check_order(&captured);
    size_t len, at = 0;
    char *data = wire_read(wire_path(wire, "data"), &len);
    uint32_t n[2] = {0};
    for (uint32_t i = 0; i < captured.n; i++) {
        const struct captured_packet *p = &captured.packet[i];
        const int is_position = p->to_port == port[1];
        n[is_position]++;
        assert_int_equal(p->len, is_position ? 512 : 1206);
        if (is_position) continue;
        assert_true(at + p->len <= len);
        assert_memory_equal(p->data, data + at, p->len);
        at += p->len;
    }
    assert_int_equal(at, len);
    /* 0.3 s have 226 data packets, less the spin-up, and a position packet for each 14. */
    assert_true(n[0] > 50 && n[1] > n[0] / 14);
    free(data);
    captured_free(&captured);
}

/* ---- a group, which a driver reads at the same time */

static int driver_open(const struct sockaddr_in *at)
{
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0), one = 1;
    const struct ip_mreqn group = {.imr_multiaddr = at->sin_addr, .imr_address.s_addr = htonl(INADDR_LOOPBACK)};
    assert_int_equal(setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one), 0);
    assert_int_equal(bind(fd, (const struct sockaddr *)at, sizeof *at), 0);
    assert_int_equal(setsockopt(fd, IPPROTO_IP, IP_ADD_MEMBERSHIP, &group, sizeof group), 0);
    return fd;
}

static void test_group(void **state)
{
    struct wire *wire = *state;
    struct captured captured;
    struct sockaddr_in to = {.sin_family = AF_INET};
    const struct in_addr lo = {htonl(INADDR_LOOPBACK)};
    char got[8];
    int port, fd;
    struct raw_recorder recorder = raw_recorder_start(wire, "udp:239.1.2.3%lo:0", NULL);
    assert_int_equal(sscanf(recorder.endpoint, "udp:239.1.2.3:%d", &port), 1);
    to.sin_port = htons((uint16_t)port);
    to.sin_addr.s_addr = htonl(0xef010203);
    const int driver = driver_open(&to);
    sender_open(&fd);
    assert_int_equal(setsockopt(fd, IPPROTO_IP, IP_MULTICAST_IF, &lo, sizeof lo), 0);
    assert_int_equal(sendto(fd, "to all", 6, 0, (struct sockaddr *)&to, sizeof to), 6);
    struct pollfd slot = {.fd = driver, .events = POLLIN};
    assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
    assert_int_equal(read(driver, got, sizeof got), 6);
    close(fd);
    close(driver);
    raw_recorder_end(&recorder, SIGINT, 0, NULL);
    captured_read(wire, &captured);
    assert_int_equal(captured.n, 1);
    assert_true(captured.packet[0].from == 0x7f000001 && captured.packet[0].to == 0xef010203);
    assert_memory_equal(captured.packet[0].data, "to all", 6);
    captured_free(&captured);
}

/* ---- a recorder that stands still while more comes than the kernel takes: the missing datagrams are counted
 * exactly */

/* Returns how many bytes wait in the kernel for the reader of a port. */
static unsigned n_held(int port)
{
    char line[256];
    unsigned local, held, sum = 0;
    FILE *f = fopen("/proc/net/udp", "r");
    assert_non_null(f);
    while (fgets(line, sizeof line, f) != NULL)
        if (sscanf(line, "%*d: %*x:%x %*s %*s %*x:%x", &local, &held) == 2 && (int)local == port) sum += held;
    fclose(f);
    return sum;
}

static void test_dropped(void **state)
{
    struct wire *wire = *state;
    static uint8_t data[LARGEST];
    struct captured captured;
    int port[2], fd;
    const uint32_t n_sent = 800; /* 50 MB; the kernel holds 32 at most */
    struct raw_recorder recorder = raw_recorder_start(wire, "udp:127.0.0.1:0,0", NULL);
    read_ports(&recorder, port);
    sender_open(&fd);
    raw_recorder_stop(&recorder);
    for (uint32_t i = 0; i < n_sent; i++)
        send_to(fd, port[0], data, sizeof data);
    const int64_t standing_ns = raw_recorder_go_on(&recorder);
    while (n_held(port[0]) > 0)
        poll(NULL, 0, 1);
    send_to(fd, port[0], data, 2);
    close(fd);
    raw_recorder_end(&recorder, SIGINT, 1, "the recording is not complete: the system dropped");
    captured_read(wire, &captured);
    const uint64_t dropped = stats_uint(wire, "dropped");
    assert_true(captured.n > 1 && dropped > 0);
    assert_int_equal(captured.n - 1 + dropped, n_sent);
    /* The times are the kernel's, not those of reading. */
    assert_true(captured.packet[captured.n - 2].t_ns < standing_ns);
    /* Behind the last packet of 44 bytes the option with the code 4 has the number of missing ones. */
    const uint8_t *last = captured.packet[captured.n - 1].data;
    assert_int_equal(captured.packet[captured.n - 1].len, 2);
    assert_int_equal(le_get32(last + 2), 4 | 8 << 16);
    assert_int_equal(le_get64(last + 6), dropped);
    captured_free(&captured);
}

/* ---- ends, and command lines */

/* The system chose the port, so it is printed. */
static void test_nothing_came(void **state)
{
    struct wire *wire = *state;
    char says[256];
    struct raw_recorder recorder =
        raw_recorder_start(wire, "udp:127.0.0.1:0", (const char *const[]){"--duration", "0.05", NULL});
    snprintf(says, sizeof says, "scanhead: datagrams are taken at %s\nscanhead: udp:127.0.0.1:0: no packet came",
             recorder.endpoint);
    raw_recorder_end(&recorder, 0, 1, says);
    assert_int_equal(access(wire_path(wire, "cap.pcapng"), F_OK), -1);
    assert_int_equal(access(wire_path(wire, "cap.pcapng.part"), F_OK), -1);
}

/* The recorder ends by itself 100 ms after its first packet. */
static void test_duration(void **state)
{
    struct wire *wire = *state;
    int port, fd;
    struct raw_recorder recorder =
        raw_recorder_start(wire, "udp:127.0.0.1:0", (const char *const[]){"--duration", "0.1", "--wait", "30", NULL});
    assert_int_equal(sscanf(recorder.endpoint, "udp:127.0.0.1:%d", &port), 1);
    sender_open(&fd);
    send_to(fd, port, (const uint8_t *)"abc", 3);
    close(fd);
    raw_recorder_end(&recorder, 0, 0, "1 packets");
}

/* A file may have 8 KiB. A longer capture gives an error, and no half of a file under its name. The written part is
 * repaired. */
static void test_disk_full(void **state)
{
    struct wire *wire = *state;
    uint8_t data[1000];
    char file[352];
    struct captured captured;
    int port, fd;
    struct raw_recorder recorder = raw_recorder_start_limited(wire, "udp:127.0.0.1:0", "16");
    assert_int_equal(sscanf(recorder.endpoint, "udp:127.0.0.1:%d", &port), 1);
    sender_open(&fd);
    for (int i = 0; i < 20; i++) {
        memset(data, i, sizeof data);
        send_to(fd, port, data, sizeof data);
    }
    close(fd);
    raw_recorder_end(&recorder, SIGINT, 1, "cap.pcapng.part: cannot write: File too large");
    snprintf(file, sizeof file, "%s", wire_path(wire, "cap.pcapng"));
    assert_int_equal(access(file, F_OK), -1);
    const char *const again[] = {"record", "udp:127.0.0.1:0", "--raw", "-o", file, NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, again, "out", "err", -1)), 2);
    const char *const repair[] = {"record", "--repair", file, "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, repair, "out", "err", -1)), 0);
    captured_read(wire, &captured);
    /* 8192 bytes hold the front, of 300 bytes at most, and blocks of 28 + 1042 + 2 + 4 bytes. */
    assert_int_equal(captured.n, 7);
    for (uint32_t i = 0; i < captured.n; i++) {
        memset(data, (int)i, sizeof data);
        assert_int_equal(captured.packet[i].len, sizeof data);
        assert_memory_equal(captured.packet[i].data, data, sizeof data);
    }
    captured_free(&captured);
}

#define FILE_OF "-o", file
#define SAYS(...)         \
    (const char *const[]) \
    {                     \
        __VA_ARGS__, NULL \
    }
#define ARGS(...)                   \
    (const char *const[])           \
    {                               \
        "record", __VA_ARGS__, NULL \
    }

static void test_usage(void **state)
{
    struct wire *wire = *state;
    char file[352], taken[64], relay[64];
    int fd, port;
    snprintf(file, sizeof file, "%s", wire_path(wire, "x.pcapng"));
    snprintf(taken, sizeof taken, "udp:127.0.0.1:%d", sender_open(&fd));
    const int tcp = wire_bind(SOCK_STREAM, &port); /* nobody listens there */
    snprintf(relay, sizeof relay, "tcp:127.0.0.1:%d", port);
    usage_complaints = 0;
    const struct {
        const char *const *args;
        int status;
        const char *const *says;
    } cases[] = {
        {ARGS("udp:127.0.0.1:0", "--raw"), 2, SAYS("-o FILE.pcapng is needed")},
        {ARGS("udp:127.0.0.1:0", "--raw", "-o", "x.ply"), 2, SAYS("x.ply", "NAME.pcapng")},
        {ARGS("udp:127.0.0.1:0", "--raw", FILE_OF, FILE_OF), 2, SAYS("one file")},
        {ARGS("udp:127.0.0.1:0", "--raw", FILE_OF, "--stats", file), 2,
         SAYS("--stats", "--output writes the same file")},
        {ARGS("usb", "--raw", FILE_OF), 2, SAYS("SOURCE usb", "udp:ADDRESS:PORT", "tcp:HOST:PORT")},
        {ARGS("udp:127.0.0.1", "--raw", FILE_OF), 2, SAYS("SOURCE udp:127.0.0.1", "PORT")},
        {ARGS("udp:127.0.0.1:5,6,5", "--raw", FILE_OF), 2, SAYS("port 5 is given twice")},
        {ARGS("udp:127.0.0.1:65536", "--raw", FILE_OF), 2, SAYS("udp:127.0.0.1:65536")},
        {ARGS("tcp:127.0.0.1:1,2", "--raw", FILE_OF), 2, SAYS("tcp:127.0.0.1:1,2")},
        {ARGS("udp:192.0.2.1:5", "--raw", FILE_OF), 2, SAYS("udp:192.0.2.1:5:", "this machine's addresses")},
        {ARGS("udp:no.such.host.invalid:1", "--raw", FILE_OF), 2, SAYS("no such address")},
        {ARGS("udp:239.1.2.3%none0:1", "--raw", FILE_OF), 2, SAYS("no interface none0")},
        {ARGS(taken, "--raw", FILE_OF), 2, SAYS(taken, "another program reads it")},
        {ARGS("udp:127.0.0.1:0", "--raw", FILE_OF, "--send", "a"), 2, SAYS("--send and --relay need tcp")},
        {ARGS("tcp:127.0.0.1:1", "--raw", FILE_OF, "--send", "a\\y"), 2, SAYS("--send a\\y", "hexadecimal")},
        {ARGS("tcp:127.0.0.1:1", "--raw", FILE_OF, "--send", ""), 2, SAYS("--send", "empty")},
        {ARGS("tcp:127.0.0.1:1", "--raw", FILE_OF, "--send", "a", "--relay", "0"), 2, SAYS("one of them")},
        {ARGS("tcp:127.0.0.1:1", "--raw", FILE_OF, "--relay", "x"), 2, SAYS("--relay x", "PORT")},
        {ARGS(relay, "--raw", FILE_OF), 1, SAYS(relay, "Connection refused")},
        {ARGS("udp:127.0.0.1:0", "--raw", FILE_OF, "--colour", "range"), 2, SAYS("unknown option --colour")},
        {ARGS("udp:127.0.0.1:0", "--raw", FILE_OF, "--frames", "1"), 2, SAYS("unknown option --frames")},
        {ARGS("tcp:127.0.0.1:1", "-o", "x.ply", "--send", "a"), 2, SAYS("--send", "--raw")},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++)
        usage_expect(wire, cases[i].args[cases[i].args[3] != NULL ? 3 : 1], cases[i].args, cases[i].status,
                     cases[i].says);
    close(fd);
    close(tcp);
    assert_int_equal(usage_complaints, 0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_datagrams, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_velodyne, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_group, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_dropped, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_nothing_came, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_duration, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_disk_full, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_usage, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
