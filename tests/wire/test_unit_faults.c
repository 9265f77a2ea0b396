/* SPDX-License-Identifier: MIT */
/* Faults on the units of SCIP, CoLa, NMEA and Velodyne. The truth, applied to the units of a clean session, gives the
 * faulty session's units, byte by byte. Answers of a client go wrong as the scenario says. */
#include "tests/wire/room.h"
#include "tests/wire/unit_faults.h"

/* Faults have numbers up to 60. The faults of the datagrams stay within 150 packets, of which 20 are sent as
 * several. */
static const char FAULTS[] = "faults:\n"
                             "  - {kind: drop, link: 1, from: 3, until: 60, every: 7}\n"
                             "  - {kind: duplicate, link: 1, at: 4, n: 2}\n"
                             "  - {kind: reorder, link: 1, from: 5, until: 60, every: 9, n: 4}\n"
                             "  - {kind: truncate, link: 1, from: 8, until: 60, probability: 0.1}\n"
                             "  - {kind: flip, link: 1, at: 9, n: 3}\n"
                             "  - {kind: flip, link: 1, at: 11, n: 1, reseal: on}\n"
                             "  - {kind: flip, link: 1, at: 18, n: 8, reseal: on}\n"
                             "  - {kind: garbage, link: 1, from: 12, until: 60, every: 11, n: 40}\n"
                             "  - {kind: split, link: 1, at: 13, n: 5}\n"
                             "  - {kind: merge, link: 1, at: 15, n: 3}\n"
                             "  - {kind: delay, link: 1, at: 19, for_ms: 5}\n"
                             "  - {kind: jitter, link: 1, at: 20, for_ms: 5}\n"
                             "  - {kind: stall, link: 1, at: 21, for_ms: 5}\n"
                             "  - {kind: flip, link: 1, from: 40, until: 60, every: 8, n: 2}\n";
enum { UNITS = 70 };

static const char CONFIG[] =
    "head: {profile: %s, start: on, frames: 0}\n"
    "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
    "stations: [{position_m: [0.31, -0.42, 0.17], heading_deg: 30, lat_deg: -33.8567844, lon_deg: 151.2152967, "
    "height_m: 87.6543}]\n"
    "noise: {range: off}\n"
    "time: {epoch: 2026-01-01T00:00:00Z}\n"
    "gnss: {rate_hz: 10}\n"
    "%s";

/* Starts a head in pace fast, where readers hold it back. links: YAML. */
static struct head start(struct wire *wire, const char *profile, const char *links, const char *faults,
                         const char *const *more)
{
    static char scenario[352], truth[352];
    char config[2048];
    const char *args[16] = {"--pace", "fast", "--scenario", scenario, "--truth", truth};
    int n = 6;
    room_write(wire);
    snprintf(config, sizeof config, CONFIG, profile, links);
    snprintf(scenario, sizeof scenario, "%s", wire_write_text(wire, "faults.yaml", faults));
    snprintf(truth, sizeof truth, "%s", wire_path(wire, "truth.json"));
    while (more != NULL && *more != NULL)
        args[n++] = *more++;
    args[n] = NULL;
    return head_start(wire, wire_write_text(wire, "config.yaml", config), args);
}

/* Each kind has struck, and the units are its results. */
static void check(struct wire *wire, const struct unit_kind *kind, const struct unit_list *clean,
                  const struct unit_list *got)
{
    static const char *const kinds[] = {"drop",  "duplicate", "reorder", "truncate", "flip", "garbage",
                                        "split", "merge",     "delay",   "jitter",   "stall"};
    uint32_t n;
    struct truth_note *note = truth_read(wire_path(wire, "truth.json"), 1, &n);
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++)
        if (truth_count(note, n, kinds[i]) == 0) fail_msg("no %s", kinds[i]);
    units_check(kind, clean, got, note, n, UNITS);
    free(note);
}

/* Returns the next so many bytes, which are good until the next call. */
static const char *take(int fd, size_t len)
{
    static char got[4096];
    assert_true(len <= sizeof got);
    for (size_t n = 0; n < len;) {
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        const ssize_t more = read(fd, got + n, len - n);
        assert_true(more > 0);
        n += (size_t)more;
    }
    return got;
}

static void expect(int fd, const void *bytes, size_t len)
{
    const char *got = take(fd, len);
    if (memcmp(got, bytes, len) != 0)
        fail_msg("\"%.*s\" instead of \"%.*s\"", (int)len, got, (int)len, (const char *)bytes);
}

/* Two sessions on two links have each asked for a stream. */
static void check_two_streams(struct wire *wire, struct head *head, const struct unit_kind *kind, int faulty, int clean,
                              size_t least)
{
    struct unit_list got = {0}, want = {0};
    units_read_both(faulty, &got, clean, &want, least);
    /* The clean one goes on until it has all of the other's units, which are known by their time stamps. */
    units_cut(&want, kind->whole);
    units_read_both(faulty, &got, clean, &want, got.len + least);
    units_cut(&want, kind->whole);
    close(faulty);
    close(clean);
    head_end(head, SIGTERM);
    got.len = least; /* all these bytes have their clean units */
    check(wire, kind, &want, &got);
    units_free(&got);
    units_free(&want);
}

/* ---- SCIP */

static size_t scip_whole(const uint8_t *bytes, size_t len)
{
    const uint8_t *end = memmem(bytes, len, "\n\n", 2);
    return end != NULL ? (size_t)(end - bytes) + 2 : 0;
}

/* After the echo each line ends with the sum of its characters: 0x30 and the low six bits. */
static int scip_is_sound(const uint8_t *unit, size_t len)
{
    const uint8_t *at = memchr(unit, '\n', len), *end = at;
    while (at != NULL && (at = end + 1) < unit + len && *at != '\n') {
        uint32_t sum = 0;
        if ((end = memchr(at, '\n', len - (size_t)(at - unit))) == NULL) return 0;
        for (const uint8_t *c = at; c + 1 < end; c++)
            sum += *c;
        if (end[-1] != 0x30 + (sum & 0x3f)) return 0;
    }
    return at != NULL && at + 1 == unit + len;
}

/* Until the head has booted the request is refused: status 10. */
static void scip_start(int fd)
{
    static const char request[] = "ME0000010001000\n", refused[] = "10Q\n\n", begins[] = "00P\n\n";
    const char *status;
    do {
        raw_send(fd, request, strlen(request));
        expect(fd, request, strlen(request));
        status = take(fd, strlen(begins));
    } while (memcmp(status, refused, strlen(refused)) == 0);
    assert_memory_equal(status, begins, strlen(begins));
}

static void test_scip(void **state)
{
    static const struct unit_kind kind = {.whole = scip_whole, .is_sound = scip_is_sound};
    struct wire *wire = *state;
    struct head head =
        start(wire, "hokuyo-utm-30lx",
              "links: [{type: tcp, protocol: scip, port: 0}, {type: tcp, protocol: scip, port: 0}]\n", FAULTS, NULL);
    const int clean = raw_connect(head_link(&head, 1));
    scip_start(clean);
    const int faulty = raw_connect(head_link(&head, 0)); /* its session begins later, so the clean one has all of it */
    scip_start(faulty);
    check_two_streams(wire, &head, &kind, faulty, clean, UNITS * 700);
}

/* ---- CoLa-B */

static size_t cola_whole(const uint8_t *bytes, size_t len)
{
    if (len < 9) return 0;
    assert_memory_equal(bytes, "\2\2\2\2\0\0", 6);
    const size_t n = 9 + ((size_t)bytes[6] << 8 | bytes[7]);
    return n <= len ? n : 0;
}

static uint8_t cola_xor(const uint8_t *unit, size_t len)
{
    uint8_t check = 0;
    for (size_t i = 8; i + 1 < len; i++)
        check ^= unit[i];
    return check;
}

static int cola_is_sound(const uint8_t *unit, size_t len)
{
    return cola_whole(unit, len) == len && unit[len - 1] == cola_xor(unit, len);
}

/* Telegrams are counted by each session, from 0. */
static void cola_count(uint8_t *unit, size_t len, uint64_t number)
{
    unit[34] = (uint8_t)((number - 1) >> 8);
    unit[35] = (uint8_t)(number - 1);
    unit[len - 1] = cola_xor(unit, len);
}

#define COLA_START  "\2\2\2\2\0\0\0\x11sEN LMDscandata \1\x33"
#define COLA_BEGINS "\2\2\2\2\0\0\0\x11sEA LMDscandata \1\x3c"

static void cola_start(int fd)
{
    raw_send(fd, COLA_START, sizeof COLA_START - 1);
    expect(fd, COLA_BEGINS, sizeof COLA_BEGINS - 1);
}

static void test_cola(void **state)
{
    static const struct unit_kind kind = {.whole = cola_whole, .adapt = cola_count, .is_sound = cola_is_sound};
    struct wire *wire = *state;
    struct head head =
        start(wire, "sick-tim571",
              "links: [{type: tcp, protocol: cola, port: 0}, {type: tcp, protocol: cola, port: 0}]\n", FAULTS, NULL);
    const int clean = raw_connect(head_link(&head, 1));
    cola_start(clean);
    const int faulty = raw_connect(head_link(&head, 0)); /* its session begins later, so the clean one has all of it */
    cola_start(faulty);
    check_two_streams(wire, &head, &kind, faulty, clean, UNITS * 2552);
}

/* ---- NMEA: the clean units are in a file */

/* Returns the length of a burst, from RMC up to the end of ZDA, or 0. */
static size_t nmea_whole(const uint8_t *bytes, size_t len)
{
    const uint8_t *last = memmem(bytes, len, "$GNZDA", 6);
    if (last == NULL) return 0;
    const uint8_t *end = memchr(last, '\n', len - (size_t)(last - bytes));
    return end != NULL ? (size_t)(end + 1 - bytes) : 0;
}

static int nmea_is_sound(const uint8_t *unit, size_t len)
{
    const char *at = (const char *)unit, *const end = at + len;
    for (unsigned sum, said; at < end; at += 5) {
        if (*at++ != '$') return 0;
        for (sum = 0; at < end && *at != '*'; at++)
            sum ^= (uint8_t)*at;
        if (end - at < 5 || sscanf(at, "*%2X\r\n", &said) != 1 || said != sum) return 0;
    }
    return 1;
}

static void test_nmea(void **state)
{
    static const struct unit_kind kind = {.whole = nmea_whole, .is_sound = nmea_is_sound};
    struct wire *wire = *state;
    struct unit_list got = {0}, clean = {0};
    struct head head = start(
        wire, "full-sweep",
        "links: [{type: tcp, protocol: nmea, port: 0}, {type: file, protocol: nmea, path: clean}]\n", FAULTS, NULL);
    const int faulty = raw_connect(head_link(&head, 0));
    units_read_both(faulty, &got, -1, NULL, UNITS * 400);
    close(faulty);
    head_end(&head, SIGTERM);
    size_t len;
    char *bytes = wire_read(wire_path(wire, "clean"), &len);
    units_add(&clean, bytes, len);
    free(bytes);
    units_cut(&clean, nmea_whole);
    check(wire, &kind, &clean, &got);
    units_free(&got);
    units_free(&clean);
}

/* ---- Velodyne over UDP: two turns are 150 packets, which a socket that nobody reads has room for */

static size_t packet_whole(const uint8_t *bytes, size_t len)
{
    (void)bytes;
    return len >= 1206 ? 1206 : 0;
}

static void test_velodyne(void **state)
{
    static const struct unit_kind kind = {.whole = packet_whole, .datagrams = 1};
    static uint8_t datagram[1 << 16];
    struct wire *wire = *state;
    struct unit_list got = {0}, clean = {0};
    char links[256];
    int port;
    const int fd = wire_bind(SOCK_DGRAM, &port), room = 1 << 22;
    setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
    snprintf(links, sizeof links,
             "links: [{type: udp, protocol: velodyne, port: %d}, {type: file, protocol: velodyne, path: clean}]\n"
             "beam: {echoes: strongest}\n",
             port);
    const char *const more[] = {"--start", "--duration", "0.2", NULL};
    struct head head = start(wire, "velodyne-vlp16", links, FAULTS, more);
    head_end(&head, 0);
    for (ssize_t n; (n = recv(fd, datagram, sizeof datagram, MSG_DONTWAIT)) > 0;) {
        units_add(&got, datagram, (size_t)n);
        units_end(&got);
    }
    close(fd);
    size_t len;
    char *bytes = wire_read(wire_path(wire, "clean"), &len);
    units_add(&clean, bytes, len);
    free(bytes);
    units_cut(&clean, packet_whole);
    assert_int_equal(clean.n, 150); /* 0.2 s of 1.327104 ms, less the packet that was not full */
    check(wire, &kind, &clean, &got);
    units_free(&got);
    units_free(&clean);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_scip, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_cola, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_nmea, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_velodyne, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
