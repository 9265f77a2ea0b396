/* SPDX-License-Identifier: MIT */
/* These tests run TIME:STEP over every protocol at once. When OK is there, all units that fell due in the granted time
 * are in each client's socket. Each client is emptied once after OK, without waiting. A unit that comes later must be
 * due later: each one contains the time at which the device could send it.
 *
 * Clock here: device time, ns. */
#include "tests/wire/room.h"

enum { STEPS = 1000, MAX_CLIENTS = 6, ROOM = 1 << 20 };
static const int64_t TICK_NS = 1000000, MS = 1000000, US = 1000;

struct client {
    const char *name, *request; /* sent once the head scans; NULL: none */
    int fd;
    /* Takes the first whole unit of `len` bytes. Returns its length, 0: none is whole. *due_ns: the unit was due at
     * this time or before; INT64_MIN: it has no time. */
    size_t (*unit)(const uint8_t *bytes, size_t len, int64_t *due_ns);
    struct scanhead *native; /* instead of fd and unit */
    uint8_t bytes[ROOM];
    size_t len;
    uint64_t units, late;
};

/* ---- when a unit was due */

/* CoLa-A: field 10 is the time of sending in us. */
static size_t cola_unit(const uint8_t *bytes, size_t len, int64_t *due_ns)
{
    const uint8_t *end = memchr(bytes, 3, len);
    const char *at = (const char *)bytes;
    if (end == NULL) return 0;
    if (memcmp(at + 1, "sSN LMDscandata ", 16) == 0) {
        for (int i = 0; i < 10; i++)
            at = strchr(at, ' ') + 1;
        *due_ns = (int64_t)strtoul(at, NULL, 16) * US;
    }
    return (size_t)(end - bytes) + 1;
}

/* SCIP: a reply ends with an empty line. The stamp of a scan, whole ms rounded down, is the time of step 0. An LMS111's
 * last step, 540 of 720, comes 3/4 of 20 ms later. */
static size_t scip_unit(const uint8_t *bytes, size_t len, int64_t *due_ns)
{
    const uint8_t *end = memmem(bytes, len, "\n\n", 2), *status = memchr(bytes, '\n', len);
    if (end == NULL) return 0;
    if (memcmp(status + 1, "99b\n", 4) == 0) {
        int64_t stamp_ms = 0;
        for (int i = 0; i < 4; i++)
            stamp_ms = stamp_ms << 6 | (status[5 + i] - 0x30);
        *due_ns = (stamp_ms + 1 + 15) * MS;
    }
    return (size_t)(end - bytes) + 2;
}

/* NMEA: RMC has the time of its fix. Power-up is at midnight. */
static size_t nmea_unit(const uint8_t *bytes, size_t len, int64_t *due_ns)
{
    const uint8_t *end = memchr(bytes, '\n', len);
    int h, min;
    double s;
    if (end == NULL) return 0;
    if (sscanf((const char *)bytes, "$GNRMC,%2d%2d%lf", &h, &min, &s) == 3)
        *due_ns = ((h * 60 + min) * INT64_C(60) * 1000 + llround(s * 1000)) * MS;
    return (size_t)(end - bytes) + 1;
}

static uint32_t little_endian(const uint8_t *at)
{
    return at[0] | (uint32_t)at[1] << 8 | (uint32_t)at[2] << 16 | (uint32_t)at[3] << 24;
}

/* VLP-16: a packet's stamp, whole us rounded down, is its first firing. The packet is complete at most 1.327104 ms
 * later. */
static size_t data_unit(const uint8_t *bytes, size_t len, int64_t *due_ns)
{
    if (len == 0) return 0;
    assert_int_equal(len, 1206);
    *due_ns = (little_endian(bytes + 1200) + INT64_C(1) + 1328) * US;
    return len;
}

static size_t position_unit(const uint8_t *bytes, size_t len, int64_t *due_ns)
{
    if (len == 0) return 0;
    assert_int_equal(len, 512);
    *due_ns = (little_endian(bytes + 0xc6) + INT64_C(1)) * US;
    return len;
}

/* ---- clients */

static void note(struct client *c, int64_t due_ns, int64_t before_ns)
{
    c->units += due_ns != INT64_MIN;
    /* A unit that was due in a tick that had been granted whole should have been there. */
    if (due_ns == INT64_MIN || due_ns + TICK_NS > before_ns) return;
    if (c->late++ == 0)
        print_message("%s: a unit due at %" PRId64 " ns came after OK of %" PRId64 " ns\n", c->name, due_ns, before_ns);
}

static void take_units(struct client *c, int64_t before_ns)
{
    size_t at = 0, n;
    do {
        int64_t due_ns = INT64_MIN;
        n = c->unit(c->bytes + at, c->len - at, &due_ns);
        if (n != 0) note(c, due_ns, before_ns);
        at += n;
    } while (n != 0);
    memmove(c->bytes, c->bytes + at, c->len -= at);
}

/* Takes all units that are there. The client was last emptied after the OK of the step up to before_ns. */
static void empty(struct client *c, int64_t before_ns)
{
    if (c->native != NULL) {
        struct scanhead_frame frame;
        int rc;
        /* A descriptor or anchor that is repeated for readers that join has the time of the first one. */
        while ((rc = scanhead_next(c->native, &frame, 0)) == SCANHEAD_OK)
            note(c, frame.type == SCANHEAD_POINTS ? frame.t_ns : INT64_MIN, before_ns);
        assert_int_equal(rc, SCANHEAD_ETIMEOUT);
        return;
    }
    for (ssize_t n; (n = recv(c->fd, c->bytes + c->len, sizeof c->bytes - 1 - c->len, MSG_DONTWAIT)) > 0;) {
        c->len += (size_t)n;
        c->bytes[c->len] = 0;
        take_units(c, before_ns);
    }
    assert_int_equal(errno, EAGAIN);
}

static int udp_socket(int *port)
{
    const int fd = wire_bind(SOCK_DGRAM, port), room = 1 << 22;
    setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
    return fd;
}

/* ---- the test */

struct bench {
    const char *profile, *links;
    struct client client[MAX_CLIENTS];
    int n;
};

static struct head start(struct wire *wire, const struct bench *bench)
{
    const char *const more[] = {"--pace", "step", NULL};
    char text[1500];
    room_write(wire);
    snprintf(
        text, sizeof text,
        "head: {profile: %s, frames: 0}\nscene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
        "stations: [{position_m: [0.31, -0.42, 0.17], heading_deg: 30, lat_deg: 48, lon_deg: 9, height_m: 300}]\nnoise: {range: off}\n"
        "beam: {mode: single}\ntime: {epoch: \"2026-01-01T00:00:00Z\"}\ngnss: {rate_hz: 20}\n%s",
        bench->profile, bench->links);
    return head_start(wire, wire_write_text(wire, "config.yaml", text), more);
}

/* Steps are 1 to 20 ms, in a fixed order. */
static void run_steps(struct bench *bench, struct scanhead *stepper)
{
    char line[32];
    int64_t granted_ns = 0;
    uint32_t draw = 12345;
    while (strcmp(client_ask(stepper, "HEAD:STAT?"), "idle") != 0) {
        client_tell(stepper, "TIME:STEP 50 MS");
        granted_ns += 50 * MS;
    }
    client_tell(stepper, "SCAN:STAR");
    for (int i = 0; i < bench->n; i++)
        if (bench->client[i].request != NULL)
            raw_send(bench->client[i].fd, bench->client[i].request, strlen(bench->client[i].request));
    for (int step = 0; step < STEPS; step++) {
        draw = draw * 1664525u + 1013904223u;
        const int ms = 1 + (int)(draw >> 16) % 20;
        snprintf(line, sizeof line, "TIME:STEP %d MS", ms);
        client_tell(stepper, line);
        const int64_t before_ns = granted_ns;
        granted_ns += ms * MS;
        for (int i = 0; i < bench->n; i++)
            empty(&bench->client[i], step == 0 ? INT64_MIN : before_ns);
    }
    struct scanhead_frame frame;
    while (scanhead_next(stepper, &frame, 0) == SCANHEAD_OK)
        continue;
}

static void check(struct bench *bench)
{
    int late = 0;
    for (int i = 0; i < bench->n; i++) {
        struct client *c = &bench->client[i];
        print_message("%s: %" PRIu64 " units, %" PRIu64 " late\n", c->name, c->units, c->late);
        late |= c->late != 0;
        /* 1,000 steps are 10 s: 100 turns at 10 Hz or 500 at 50 Hz, 200 fixes, thousands of packets. */
        assert_true(c->units > 80);
    }
    assert_false(late);
}

static void close_all(struct bench *bench)
{
    for (int i = 0; i < bench->n; i++)
        if (bench->client[i].native != NULL)
            scanhead_close(bench->client[i].native);
        else
            close(bench->client[i].fd);
}

static void test_planar(void **state)
{
    static struct bench bench = {
        .profile = "sick-lms111",
        .links = "links: [{type: tcp, port: 0}, {type: tcp, protocol: cola, port: 0}, {type: tcp, protocol: scip, "
                 "port: 0}, {type: tcp, protocol: nmea, port: 0}]\n"};
    struct head head = start(*state, &bench);
    struct scanhead *stepper = client_open(head_link(&head, 0));
    bench.client[0] = (struct client){.name = "native", .native = client_open(head_link(&head, 0))};
    bench.client[1] = (struct client){.name = "CoLa", .fd = raw_connect(head_link(&head, 1)), .unit = cola_unit};
    bench.client[2] = (struct client){.name = "SCIP", .fd = raw_connect(head_link(&head, 2)), .unit = scip_unit};
    bench.client[3] = (struct client){.name = "NMEA", .fd = raw_connect(head_link(&head, 3)), .unit = nmea_unit};
    bench.n = 4;
    bench.client[1].request = "\2sEN LMDscandata 1\3";
    bench.client[2].request = "MD0000054000000\n";
    run_steps(&bench, stepper);
    close_all(&bench);
    scanhead_close(stepper);
    head_end(&head, SIGTERM);
    check(&bench);
}

static void test_beams(void **state)
{
    static struct bench bench = {.profile = "velodyne-vlp16"};
    char links[400];
    int data_port, position_port;
    bench.client[0] = (struct client){.name = "VLP-16", .fd = udp_socket(&data_port), .unit = data_unit};
    bench.client[1] = (struct client){.name = "position", .fd = udp_socket(&position_port), .unit = position_unit};
    snprintf(links, sizeof links,
             "links: [{type: tcp, port: 0}, {type: udp, protocol: velodyne, address: 127.0.0.1, port: %d}, {type: udp, "
             "protocol: velodyne-position, address: 127.0.0.1, port: %d}, {type: tcp, protocol: nmea, port: 0}]\n",
             data_port, position_port);
    bench.links = links;
    struct head head = start(*state, &bench);
    struct scanhead *stepper = client_open(head_link(&head, 0));
    bench.client[2] = (struct client){.name = "native", .native = client_open(head_link(&head, 0))};
    bench.client[3] = (struct client){.name = "NMEA", .fd = raw_connect(head_link(&head, 3)), .unit = nmea_unit};
    bench.n = 4;
    run_steps(&bench, stepper);
    close_all(&bench);
    scanhead_close(stepper);
    head_end(&head, SIGTERM);
    check(&bench);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_planar, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_beams, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
