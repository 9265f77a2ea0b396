/* SPDX-License-Identifier: MIT */
/* Two VLP-16 and two LMS111 behind one interface, at the same ports. One client tells them apart by their addresses,
 * and gets each one's own ranges. Each head stands in a square room of its own. */
#include <arpa/inet.h>
#include <math.h>

#include "tests/wire/wire.h"

enum { N = 2, TURN_PACKETS = 80 /* 75.4 a turn at 10 Hz */ };
static const int HALF_M[2 * N] = {4, 6, 5, 7}; /* from the head to the walls: VLP-16s, LMS111s */

static struct sockaddr_in place(int host, int port)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK + (uint32_t)host);
    return at;
}

/* The room has only walls, so the nearest point is half a side away. */
static struct head start(struct wire *wire, int i, const char *profile, const char *link)
{
    char name[16], text[1024];
    const int h = HALF_M[i];
    snprintf(name, sizeof name, "room%d.obj", i);
    snprintf(text, sizeof text,
             "v -%d -%d -9\nv %d -%d -9\nv %d %d -9\nv -%d %d -9\nv -%d -%d 9\nv %d -%d 9\nv %d %d 9\nv -%d %d 9\n"
             "f 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n",
             h, h, h, h, h, h, h, h, h, h, h, h, h, h, h, h);
    wire_write_text(wire, name, text);
    snprintf(text, sizeof text,
             "head: {profile: %s, start: on, frames: 0}\n"
             "scene: {meshes: [{file: room%d.obj, up: z, scale: 1}]}\n"
             "stations: [{name: a, position_m: [0, 0, 0]}]\n"
             "links: [%s]\n",
             profile, i, link);
    snprintf(name, sizeof name, "head%d.yaml", i);
    return head_start(wire, wire_write_text(wire, name, text), NULL);
}

/* Checks each head's nearest range, by the source of its packets. Every azimuth occurs to 0.1 degrees, and two beams
 * are 1 degree from the horizon: cos(1 deg) cos(0.1 deg) is 1 - 1.6e-4. The wire has steps of 2 mm. */
static void expect_velodynes(int fd, int port)
{
    double nearest_m[N] = {INFINITY, INFINITY};
    int n[N] = {0};
    while (n[0] < TURN_PACKETS || n[1] < TURN_PACKETS) {
        uint8_t packet[1300];
        struct sockaddr_in from;
        socklen_t len = sizeof from;
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        assert_int_equal(recvfrom(fd, packet, sizeof packet, 0, (struct sockaddr *)&from, &len), 1206);
        const int i = (int)(ntohl(from.sin_addr.s_addr) - INADDR_LOOPBACK) - 1;
        assert_in_range(i, 0, N - 1);
        assert_int_equal(ntohs(from.sin_port), port);
        n[i]++;
        for (int at = 0; at < 12 * 32; at++) {
            const uint8_t *entry = packet + at / 32 * 100 + 4 + at % 32 * 3;
            const double m = 2e-3 * (entry[0] | entry[1] << 8);
            if (m > 0.0 && m < nearest_m[i]) nearest_m[i] = m;
        }
    }
    for (int i = 0; i < N; i++)
        if (nearest_m[i] < HALF_M[i] - 2e-3 || nearest_m[i] > HALF_M[i] * (1 + 1.7e-4) + 2e-3)
            fail_msg("VLP-16 %d: %.3f m to a wall that is %d m away", i, nearest_m[i], HALF_M[i]);
}

/* Reads all until the head ends the session. The request is all that the client sends: its sending side is shut down
 * before the answer can be there. */
static void ask_last_scan(int i, int port, char *got, size_t cap)
{
    static const char request[] = "\2sRN LMDscandata\3";
    const struct sockaddr_in at = place(i + 1, port);
    const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
    size_t n = 0;
    ssize_t more = 1;
    assert_int_equal(connect(fd, (const struct sockaddr *)&at, sizeof at), 0);
    raw_send(fd, request, sizeof request - 1);
    assert_int_equal(shutdown(fd, SHUT_WR), 0);
    while (more > 0) {
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        more = read(fd, got + n, cap - 1 - n);
        if (more > 0) n += (size_t)more;
    }
    got[n] = '\0';
    close(fd);
}

/* Checks the nearest distance, to a count of 1 mm. Beams are 0.25 or 0.5 degrees apart: one is within 0.25 degrees of
 * the wall's foot, 1e-5 farther. */
static void expect_sick(int i, int port)
{
    static char got[65536];
    const char *at = NULL;
    long n, nearest_mm = 1 << 30;
    for (const int64_t end_ms = wire_now_ms() + DEADLINE_MS;
         at == NULL && wire_now_ms() < end_ms;) { /* refused at boot */
        ask_last_scan(i, port, got, sizeof got);
        at = strstr(got, "DIST1 ");
    }
    if (at == NULL) fail_msg("no scan: %.80s", got);
    for (int skip = 0; skip < 5; skip++)
        at = strchr(at, ' ') + 1;
    for (n = strtol(at, (char **)&at, 16); n > 0; n--) {
        const long mm = strtol(at, (char **)&at, 16);
        if (mm > 0 && mm < nearest_mm) nearest_mm = mm;
    }
    if (labs(nearest_mm - 1000L * HALF_M[N + i]) > 1)
        fail_msg("LMS111 %d: %ld mm to a wall that is %d m away", i, nearest_mm, HALF_M[N + i]);
}

static void one_client_reads_four_heads(void **state)
{
    struct wire *wire = *state;
    struct head head[2 * N];
    char link[200];
    int udp_port, tcp_port; /* of 127.0.0.1; they are free on the addresses after it, too */
    const int fd = wire_bind(SOCK_DGRAM, &udp_port), reserve = wire_bind(SOCK_STREAM, &tcp_port);
    for (int i = 0; i < N; i++) {
        snprintf(link, sizeof link, "{type: udp, protocol: velodyne, port: %d, source: 127.0.0.%d, source_port: %d}",
                 udp_port, i + 2, udp_port);
        head[i] = start(wire, i, "velodyne-vlp16", link);
        snprintf(link, sizeof link, "{type: tcp, protocol: cola, address: 127.0.0.%d, port: %d}", i + 2, tcp_port);
        head[N + i] = start(wire, N + i, "sick-lms111", link);
    }
    expect_velodynes(fd, udp_port);
    for (int i = 0; i < N; i++)
        expect_sick(i, tcp_port);
    for (int i = 0; i < 2 * N; i++)
        head_end(&head[i], SIGTERM);
    close(reserve);
    close(fd);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(one_client_reads_four_heads, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
