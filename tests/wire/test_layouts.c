/* SPDX-License-Identifier: MIT */
/* Personalities are read twice at once: by a parser written from the published layout alone, and by libscanhead from
 * the native link beside it. Both readers get the same points, to half a unit of the protocol's last digit. Range noise
 * makes all scans differ, so they are matched by their contents. */
#include "tests/wire/wire.h"

#include <math.h>

enum { MAX_POINTS = 1081, MAX_LINES = 16, SCANS = 6, PACKETS = 40, PER_PACKET = 384, MAX_SHOTS = 300000 };

/* This is one scan of a planar head, in the order of its steps. */
struct scan {
    int n;
    double range_m[MAX_POINTS]; /* 0: none */
    double azimuth_rad[MAX_POINTS];
    double t_ms; /* of its first step, by any clock */
};

static struct scan native[MAX_LINES], spoken[SCANS];

/* Reads the native stream's scans. The first may have been joined in its middle, and then equals no other. */
static void read_native(struct scanhead *sh, int n_lines)
{
    static struct scanhead_point point[4096];
    struct scanhead_frame frame;
    int line = -1;
    for (uint32_t number = UINT32_MAX; line < n_lines;) {
        client_next(sh, &frame);
        if (frame.type != SCANHEAD_POINTS) continue;
        if (frame.scan_line != number && ++line < n_lines)
            native[line] = (struct scan){.t_ms = 1e-6 * (double)frame.line_t0_ns};
        number = frame.scan_line;
        int n = scanhead_points(sh, &frame, 0, point, 4096);
        assert_true(n > 0);
        for (int i = 0; i < n && line < n_lines; i++) {
            struct scan *s = &native[line];
            assert_true(s->n < MAX_POINTS && point[i].echo <= 1);
            s->range_m[s->n] = point[i].echo_count != 0 ? point[i].range_m : 0.0;
            s->azimuth_rad[s->n++] = point[i].pan_rad;
        }
    }
}

/* Returns whether two scans are one, to half a unit of 1 mm (and the native unit of a micrometre). */
static int is_same(const struct scan *a, const struct scan *b)
{
    for (int i = 0; i < a->n; i++)
        if (fabs(a->range_m[i] - b->range_m[i]) > 0.000501) return 0;
    return a->n == b->n;
}

/* Each scan of the protocol is one of the native ones. The scans follow each other, and their angles and times agree.
 * The two clocks begin at different times; unit_ms: a time is rounded down to it. */
static void compare(int lines, int scans, double unit_ms)
{
    int first = -1;
    for (int l = 0; l < lines; l++)
        if (is_same(&native[l], &spoken[0])) first = l;
    if (first < 0) fail_msg("the first scan is none of %d native ones", lines);
    for (int s = 0; s < scans; s++) {
        const struct scan *ours = &native[first + s], *theirs = &spoken[s];
        assert_true(first + s < lines);
        if (!is_same(ours, theirs)) fail_msg("scan %d is not the native one", s);
        double passed_ms = theirs->t_ms - spoken[0].t_ms - (ours->t_ms - native[first].t_ms);
        if (fabs(passed_ms) >= unit_ms) fail_msg("scan %d is %.6f ms off", s, passed_ms);
        for (int i = 0; i < ours->n; i++)
            assert_true(fabs(remainder(theirs->azimuth_rad[i] - ours->azimuth_rad[i], 2.0 * M_PI)) < 1e-8);
    }
}

/* Starts the ready configuration with noise. The configuration's terminals are moved to the test's folder. Lists end
 * with NULL. */
static struct head start(struct wire *wire, const char *config, const char *const *ptys, const char *const *sets)
{
    static char path[4][400];
    const char *more[WIRE_MAX_ARGS] = {"--set", "noise.range=on", "--set", IFC_BY_ASSIMP};
    int n = 4;
    for (int i = 0; ptys[i] != NULL; i++) {
        char name[16];
        snprintf(name, sizeof name, "pty%d", i);
        snprintf(path[i], sizeof path[i], "%s=%s", ptys[i], wire_path(wire, name));
        more[n++] = "--set";
        more[n++] = path[i];
    }
    for (; *sets != NULL; sets++) {
        more[n++] = "--set";
        more[n++] = *sets;
    }
    return head_start(wire, config, more);
}

/* A client's socket, and the bytes that came from it. */
struct reader {
    int fd;
    size_t n, used;
    char bytes[1 << 16];
};

static struct reader reader;

static void reader_open(const char *endpoint)
{
    reader.fd = raw_connect(endpoint);
    reader.n = reader.used = 0;
}

/* Returns the text up to and with `end`, NUL-terminated and good until the next call. */
static char *read_until(const char *end)
{
    static char piece[sizeof reader.bytes];
    memmove(reader.bytes, reader.bytes + reader.used, reader.n -= reader.used);
    for (;;) {
        reader.bytes[reader.n] = '\0';
        const char *at = strstr(reader.bytes, end);
        if (at != NULL) {
            reader.used = (size_t)(at - reader.bytes) + strlen(end);
            memcpy(piece, reader.bytes, reader.used);
            piece[reader.used] = '\0';
            return piece;
        }
        reader.used = 0;
        struct pollfd slot = {.fd = reader.fd, .events = POLLIN};
        if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("no more comes after: %s", reader.bytes);
        ssize_t got = read(reader.fd, reader.bytes + reader.n, sizeof reader.bytes - 1 - reader.n);
        if (got <= 0) fail_msg("the head hung up after: %s", reader.bytes);
        reader.n += (size_t)got;
    }
}

/* ---- SCIP: lines that end in a sum; values are characters with six bits each */

static long scip_value(const char *at, int chars)
{
    long value = 0;
    while (chars-- > 0)
        value = value << 6 | (*at++ - 0x30);
    return value;
}

/* Returns the length of a line without its sum, which must be right. */
static size_t scip_line(const char *line, size_t len)
{
    unsigned sum = 0;
    for (size_t i = 0; i + 1 < len; i++)
        sum += (unsigned char)line[i];
    assert_true(len > 1 && line[len - 1] == (char)((sum & 0x3f) + 0x30));
    return len - 1;
}

/* echo, status, time and data of one scan, each line with its end. */
static void scip_scan(char *text, struct scan *scan)
{
    static char data[4 * MAX_POINTS];
    size_t n = 0;
    char *rest, *line = strtok_r(text, "\n", &rest);
    assert_int_equal(strncmp(line, "MD", 2), 0);
    assert_string_equal(strtok_r(NULL, "\n", &rest), "99b");
    line = strtok_r(NULL, "\n", &rest);
    assert_int_equal(scip_line(line, strlen(line)), 4);
    *scan = (struct scan){.t_ms = (double)scip_value(line, 4), .n = 1081};
    while ((line = strtok_r(NULL, "\n", &rest)) != NULL) {
        size_t len = scip_line(line, strlen(line));
        assert_true(len <= 64 && n + len <= sizeof data);
        memcpy(data + n, line, len);
        n += len;
    }
    assert_int_equal(n, 3 * 1081);
    for (int i = 0; i < scan->n; i++) {
        long mm = scip_value(data + 3 * i, 3);
        scan->range_m[i] = mm < 20 ? 0.0 : 1e-3 * (double)mm;  /* less is an error's number */
        scan->azimuth_rad[i] = -2.0 * M_PI * (i - 540) / 1440; /* counter-clockwise from the front */
    }
}

static void test_scip(void **state)
{
    struct wire *wire = *state;
    const char *const ptys[] = {"links.1.path", "links.3.path", NULL}, *const sets[] = {"links.0.port=0", NULL};
    struct head head = start(wire, "config/hokuyo.yaml", ptys, sets);
    struct scanhead *sh = client_open(head_link(&head, 2));
    reader_open(head_link(&head, 0));
    raw_send(reader.fd, "BM\n", 3);
    while (strstr(read_until("\n\n"), "BM\n00P\n") == NULL) /* not yet, while it boots */
        raw_send(reader.fd, "BM\n", 3);
    raw_send(reader.fd, "MD0000108001000\n", 16);
    assert_non_null(strstr(read_until("\n\n"), "00P\n"));
    for (int i = 0; i < SCANS; i++)
        scip_scan(read_until("\n\n"), &spoken[i]);
    read_native(sh, MAX_LINES);
    compare(MAX_LINES, SCANS, 1.0);
    scanhead_close(sh);
    close(reader.fd);
    head_end(&head, SIGTERM);
}

/* ---- CoLa-A: fields between blanks, numbers in hexadecimal */

static void cola_scan(char *text, struct scan *scan)
{
    static char *field[26 + 811];
    int n = 0;
    char *rest;
    for (char *word = strtok_r(strchr(text, 2) + 1, " \3", &rest); word != NULL && n < 26 + 811;
         word = strtok_r(NULL, " \3", &rest))
        field[n++] = word;
    assert_int_equal(n, 26 + 811);
    assert_string_equal(field[1], "LMDscandata");
    assert_string_equal(field[20], "DIST1");
    assert_string_equal(field[21], "3F800000"); /* 1 */
    *scan = (struct scan){.t_ms = 1e-3 * (double)strtoul(field[9], NULL, 16), .n = (int)strtoul(field[25], NULL, 16)};
    assert_int_equal(scan->n, 811);
    const double first_deg = 1e-4 * (int32_t)strtoul(field[23], NULL, 16);
    assert_true(first_deg == -45.0 && strtoul(field[24], NULL, 16) == 3333); /* a third of a degree */
    for (int i = 0; i < scan->n; i++) {
        scan->range_m[i] = 1e-3 * (double)strtoul(field[26 + i], NULL, 16);
        scan->azimuth_rad[i] = (90.0 - first_deg - i / 3.0) * M_PI / 180.0; /* 90 is the front */
    }
}

static void test_cola(void **state)
{
    struct wire *wire = *state;
    const char *const ptys[] = {"links.1.path", "links.3.path", NULL}, *const sets[] = {"links.0.port=0", NULL};
    struct head head = start(wire, "config/sick.yaml", ptys, sets);
    struct scanhead *sh = client_open(head_link(&head, 2));
    reader_open(head_link(&head, 0));
    raw_send(reader.fd, "\2sEN LMDscandata 1\3", 19);
    assert_string_equal(read_until("\3"), "\2sEA LMDscandata 1\3");
    for (int i = 0; i < SCANS; i++)
        cola_scan(read_until("\3"), &spoken[i]);
    read_native(sh, MAX_LINES);
    compare(MAX_LINES, SCANS, 1e-3);
    scanhead_close(sh);
    close(reader.fd);
    head_end(&head, SIGTERM);
}

/* ---- VLP-16: packets of 12 blocks of 2 sequences of 16 lasers */

static const double ELEVATION_DEG[16] = {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};

static struct shot {
    double range_m, azimuth_rad, elevation_rad;
    int64_t t_ns;
} shots[MAX_SHOTS];

static double packet_range_m(const uint8_t *packet, int i)
{
    const uint8_t *at = packet + 100 * (i / 32) + 4 + 3 * (i % 32);
    return 0.002 * (at[0] | at[1] << 8);
}

static uint32_t packet_us(const uint8_t *packet)
{
    return packet[1200] | (uint32_t)packet[1201] << 8 | (uint32_t)packet[1202] << 16 | (uint32_t)packet[1203] << 24;
}

static int is_packet(const struct shot *shot, const uint8_t *packet)
{
    for (int i = 0; i < PER_PACKET; i++)
        if (fabs(packet_range_m(packet, i) - shot[i].range_m) > 0.001001) return 0; /* half of 2 mm; 1 um */
    return 1;
}

static void check_packet(const struct shot *shot, const uint8_t *packet)
{
    assert_true(is_packet(shot, packet));
    for (int i = 0; i < PER_PACKET; i++) {
        const uint8_t *block = packet + 100 * (i / 32);
        assert_true(fabs(shot[i].elevation_rad - ELEVATION_DEG[i % 16] * M_PI / 180.0) < 1e-8);
        if (i % 32 != 0) continue;
        assert_true(block[0] == 0xff && block[1] == 0xee);
        /* half of 0.01 degrees */
        const double azimuth_rad = 0.01 * (block[2] | block[3] << 8) * M_PI / 180.0;
        assert_true(fabs(remainder(azimuth_rad - shot[i].azimuth_rad, 2.0 * M_PI)) < 0.005001 * M_PI / 180.0);
    }
}

static int read_shots(struct scanhead *sh)
{
    static struct scanhead_point point[4096];
    struct scanhead_frame frame;
    int n = 0;
    while (n + 4096 < MAX_SHOTS) {
        client_next(sh, &frame);
        if (frame.type != SCANHEAD_POINTS) continue;
        int got = scanhead_points(sh, &frame, 0, point, 4096);
        assert_true(got > 0);
        for (int i = 0; i < got; i++)
            shots[n++] = (struct shot){point[i].echo_count != 0 ? point[i].range_m : 0.0, point[i].pan_rad,
                                       point[i].mirror_rad, point[i].t_ns};
    }
    return n;
}

static void test_velodyne(void **state)
{
    struct wire *wire = *state;
    static uint8_t packet[PACKETS][1206 + 1];
    char port[2][64];
    int number[2], fd = wire_bind(SOCK_DGRAM, &number[0]), position = wire_bind(SOCK_DGRAM, &number[1]);
    for (int i = 0; i < 2; i++)
        snprintf(port[i], sizeof port[i], "links.%d.port=%d", i, number[i]);
    const char *const ptys[] = {"links.4.path", NULL}, *const sets[] = {port[0], port[1], "links.2.port=0", NULL};
    struct head head = start(wire, "config/velodyne.yaml", ptys, sets);
    struct scanhead *sh = client_open(head_link(&head, 3));
    for (int i = 0; i < PACKETS; i++) {
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        assert_int_equal(recv(fd, packet[i], sizeof packet[i], 0), 1206);
    }
    int n = read_shots(sh), first = 0;
    while (first + PER_PACKET <= n && !is_packet(&shots[first], packet[PACKETS / 2]))
        first++;
    first -= PACKETS / 2 * PER_PACKET;
    for (int i = 0; i < PACKETS; i++) {
        assert_in_range(first + i * PER_PACKET, 0, n - PER_PACKET);
        const struct shot *shot = &shots[first + i * PER_PACKET];
        check_packet(shot, packet[i]);
        const uint32_t us = (packet_us(packet[i]) + 3600000000u - packet_us(packet[0])) % 3600000000u;
        assert_true(fabs(us - 1e-3 * (double)(shot->t_ns - shots[first].t_ns)) < 1.0);
    }
    scanhead_close(sh);
    close(fd);
    close(position);
    head_end(&head, SIGTERM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_scip, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_cola, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_velodyne, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
