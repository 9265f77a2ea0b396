/* SPDX-License-Identifier: MIT */
/* A VLP-16 whose GNSS receiver goes wrong: position packets, time stamps and azimuths of data packets, as the program
 * writes them, beside what the manual (63-9243, 9.3.3 and appendix G) says. Power comes at 00:59:57.5 UTC. Position
 * packet i is of device time i * 18.579456 ms. */
#include <math.h>

#include "core/bytes.h"
#include "tests/wire/room.h"

enum { DATA = 1206, POSITION = 512, BLOCKS = 12 };
static const double POSITION_S = 0.018579456, BLOCK_US = 110.592, SECOND_US = 1e6;
enum { ABSENT, SYNC, LOCKED, WRONG };

static const char CONFIG[] =
    "head: {profile: velodyne-vlp16, lines_hz: 10, start: on, frames: 0, phase_lock: on, phase_deg: 123.45,\n"
    "       motor_ppm: 200}\n"
    "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
    "stations: [{position_m: [0.31, -0.42, 0.17], lat_deg: 48.1, lon_deg: 11.5, height_m: 500}]\n"
    "beam: {echoes: strongest}\n"
    "links: [{type: file, protocol: velodyne, path: data}, {type: file, protocol: velodyne-position, path: position},\n"
    "        {type: file, protocol: nmea, path: nmea}]\n"
    "gnss: {cold: on, talker: GP}\n"
    "time: {epoch: 2026-01-01T00:59:57.5Z}\n"
    "faults:\n";
static const char FAULTS[] = "  - {kind: nmea_void, from_s: 3, until_s: 4}\n"
                             "  - {kind: nmea_checksum, from_s: 4, until_s: 5}\n"
                             "  - {kind: nmea_lost, from_s: 5, until_s: 7}\n"
                             "  - {kind: nmea_late, for_ms: 1100, from_s: 7, until_s: 8}\n"
                             "  - {kind: pps_lost, from_s: 9, until_s: 11}\n"
                             "  - {kind: pps_jitter, for_ms: 3, from_s: 13, until_s: 15}\n";

/* Between these device times, a position packet says this. */
static const struct {
    double from_s, until_s;
    int pps;
    double hour_s;        /* at from_s */
    const char *sentence; /* without its checksum; NULL: none */
    int is_spoilt;
} WANT[] = {
    {0, 0.5, SYNC, 0, NULL, 0},
    {0.5, 1.5, SYNC, 0.5, "$GPRMC,005958.00,A,4806.00000,N,01130.00000,E,0.00,000.0,010126,,,A", 0},
    {2.5, 3.5, LOCKED, 0, "$GPRMC,010000.00,A,4806.00000,N,01130.00000,E,0.00,000.0,010126,,,A", 0},
    {3.5, 4.5, LOCKED, 1, "$GPRMC,010001.00,V,,,,,,,010126,,,N", 0},
    {4.5, 5.5, LOCKED, 2, "$GPRMC,010002.00,A,4806.00000,N,01130.00000,E,0.00,000.0,010126,,,A", 1},
    {5.5, 7.5, LOCKED, 3, "$GPRMC,010002.00,A,4806.00000,N,01130.00000,E,0.00,000.0,010126,,,A", 1},
    {7.5, 8.6, LOCKED, 5, "$GPRMC,010002.00,A,4806.00000,N,01130.00000,E,0.00,000.0,010126,,,A", 1},
    {8.6, 9.501, LOCKED, 6.1, "$GPRMC,010006.00,A,4806.00000,N,01130.00000,E,0.00,000.0,010126,,,A", 0},
    {9.501, 10.5, ABSENT, 7.001, "$GPRMC,010007.00,A,4806.00000,N,01130.00000,E,0.00,000.0,010126,,,A", 0},
    {11.5, 12.5, SYNC, 9, "$GPRMC,010009.00,A,4806.00000,N,01130.00000,E,0.00,000.0,010126,,,A", 0},
    {13.503, 14.5, WRONG, 11.003, "$GPRMC,010011.00,A,4806.00000,N,01130.00000,E,0.00,000.0,010126,,,A", 0},
};

static unsigned xor_of(const char *text, size_t len)
{
    unsigned sum = 0;
    for (size_t i = 1; i < len; i++)
        sum ^= (unsigned char)text[i];
    return sum;
}

/* The sentence, its checksum, or the checksum with each bit wrong, CR LF and NUL bytes. */
static void check_sentence(const char *is, const char *want, int is_spoilt)
{
    char whole[POSITION - 206] = "";
    if (want != NULL)
        snprintf(whole, sizeof whole, "%s*%02X\r\n", want, xor_of(want, strlen(want)) ^ (is_spoilt ? 0xffu : 0u));
    if (memcmp(is, whole, sizeof whole) != 0) fail_msg("'%.128s' is not '%s'", is, whole);
}

static void check_positions(const uint8_t *bytes, size_t len)
{
    uint32_t seen = 0;
    for (size_t i = 0; (i + 1) * POSITION <= len; i++) {
        const uint8_t *packet = bytes + i * POSITION;
        const double t_s = (double)i * POSITION_S;
        for (size_t k = 0; k < sizeof WANT / sizeof *WANT; k++) {
            if (t_s < WANT[k].from_s || t_s >= WANT[k].until_s) continue;
            const double hour_s = WANT[k].hour_s + t_s - WANT[k].from_s;
            if (packet[202] != WANT[k].pps || fabs(le_get32(packet + 198) - 1e6 * hour_s) > 1.0) /* rounded down */
                fail_msg("at %.6f s: PPS %d, %u us; not %d, %.6f s", t_s, packet[202], le_get32(packet + 198),
                         WANT[k].pps, hour_s);
            check_sentence((const char *)packet + 206, WANT[k].sentence, WANT[k].is_spoilt);
            seen |= 1u << k;
        }
    }
    assert_int_equal(seen, (1u << sizeof WANT / sizeof *WANT) - 1);
}

/* The azimuth at a moment within a packet, from the blocks before and after. */
static double azimuth_deg(const uint8_t *packet, double us)
{
    double blocks = us / BLOCK_US;
    int b = blocks < BLOCKS - 2 ? (int)blocks : BLOCKS - 2;
    const double here = 0.01 * le_get16(packet + 100 * b + 2), next = 0.01 * le_get16(packet + 100 * b + 102);
    return here + (blocks - b) * fmod(next - here + 360.0, 360.0);
}

/* The tolerance at full seconds of the time stamps. Azimuths are rounded to 0.01 degree. An extrapolation by one block
 * may double that. A time stamp is rounded down to 1 us, in which the rotor turns 0.0036 degree. */
static const double EDGE_DEG = 0.02 + 0.0036 + 0.0002;

/* The PPS is locked from 2.5 s on, so the rotor is where the lock wants it from 3.5 s on, when the device's second 1
 * begins. The rotor is let go 1 ms after 9.5 s, second 7, since that pulse and the next one are lost. From then on the
 * rotor gains 0.72 degree a second. */
static void check_azimuths(const uint8_t *bytes, size_t len)
{
    uint32_t held = 0;
    double free_deg = 0.0;
    for (size_t i = 0; (i + 1) * DATA <= len; i++) {
        const uint8_t *packet = bytes + i * DATA;
        const uint32_t us = le_get32(packet + 1200), second = us / 1000000 + 1;
        const double left_us = second * SECOND_US - us;
        if (left_us >= BLOCKS * BLOCK_US) continue;
        const double beyond_deg = remainder(azimuth_deg(packet, left_us) - 123.45, 360.0);
        if (second == 9) free_deg = beyond_deg;
        if (second == 10) assert_true(fabs(beyond_deg - free_deg - 0.72) <= 2 * EDGE_DEG);
        if (second > 7 || i < 2000) continue; /* 2000 * 1.327 ms is after 2 s, and before 3 s with the boot */
        if (fabs(beyond_deg) > EDGE_DEG) fail_msg("second %u: %.4f degrees beyond", second, beyond_deg);
        held |= 1u << second;
    }
    assert_int_equal(held, 0xfe); /* seconds 1 to 7 */
    assert_true(fabs(free_deg) > 0.5);
}

/* The receiver's own link has a group of sentences for each second, but for two that are lost. */
static void check_receiver(const char *text)
{
    static const char *const seconds[] = {"005958", "005959", "010000", "010001", "010002",
                                          "010005", "010006", "010007", "010008", "010009"};
    const char *at = text;
    for (size_t i = 0; i < sizeof seconds / sizeof *seconds; i++) {
        char begin[32];
        snprintf(begin, sizeof begin, "$GPRMC,%s.00,", seconds[i]);
        at = strstr(at, "$GPRMC");
        assert_non_null(at);
        if (strncmp(at, begin, strlen(begin)) != 0) fail_msg("'%.20s' is not '%s'", at, begin);
        at++;
    }
}

static const char *write_config(struct wire *wire, const char *faults)
{
    char text[4096];
    snprintf(text, sizeof text, "%s%s", CONFIG, faults);
    return wire_write_text(wire, "config.yaml", text);
}

static void test_receiver_goes_wrong(void **state)
{
    struct wire *wire = *state;
    static const char *const more[] = {"--pace", "fast", "--duration", "15.5", NULL};
    size_t len;
    room_write(wire);
    struct head head = head_start(wire, write_config(wire, FAULTS), more);
    head_end(&head, 0);
    char *bytes = wire_read(wire_path(wire, "position"), &len);
    check_positions((const uint8_t *)bytes, len);
    free(bytes);
    bytes = wire_read(wire_path(wire, "data"), &len);
    check_azimuths((const uint8_t *)bytes, len);
    free(bytes);
    bytes = wire_read(wire_path(wire, "nmea"), NULL);
    check_receiver(bytes);
    free(bytes);
}

/* Two power cycles close together, and two that make one outage. A session of a file has packets from each power-up on,
 * with which the time begins at 0, until power goes. Sentences arrive at 0.5 s, 1.5 s and so on, and are forgotten with power. */
static const struct outages {
    const char *faults;
    struct {
        double on_s, off_s, sentence_s; /* sentence_s: the first one since power came */
    } power[4];
} OUTAGES[] = {{"  - {kind: power_cycle, from_s: 1, for_ms: 100}\n"
                "  - {kind: power_cycle, from_s: 1.4, for_ms: 300}\n",
                {{0, 1, 0.5}, {1.1, 1.4, 1.5}, {1.7, 99, 2.5}}},
               {"  - {kind: power_cycle, from_s: 2.2, for_ms: 1400}\n"
                "  - {kind: power_cycle, from_s: 3, for_ms: 2000}\n",
                {{0, 2.2, 0.5}, {5, 99, 5.5}}}};

static void check_outages(const struct outages *outages, const uint8_t *bytes, size_t len)
{
    size_t i = 0;
    for (int k = 0; k < 4 && outages->power[k].off_s > 0; k++) {
        const double on_s = outages->power[k].on_s, off_s = outages->power[k].off_s;
        const int first = (int)ceil(on_s / POSITION_S);
        for (int n = first; n * POSITION_S < off_s && (i + 1) * POSITION <= len; n++, i++) {
            const uint8_t *packet = bytes + i * POSITION;
            const double t_s = n * POSITION_S;
            if (n == first) assert_true(fabs(le_get32(packet + 198) - 1e6 * (t_s - on_s)) <= 1.0); /* rounded down */
            if ((packet[206] == '$') != (t_s >= outages->power[k].sentence_s)) fail_msg("packet %zu, %.6f s", i, t_s);
        }
    }
    assert_true(i * POSITION == len && i > 150); /* 6 s less 2.8 s are 172 packets */
}

static void test_power_cycles(void **state)
{
    struct wire *wire = *state;
    static const char *const more[] = {"--pace", "fast", "--duration", "6", NULL};
    room_write(wire);
    for (size_t k = 0; k < sizeof OUTAGES / sizeof *OUTAGES; k++) {
        size_t len;
        struct head head = head_start(wire, write_config(wire, OUTAGES[k].faults), more);
        head_end(&head, 0);
        char *bytes = wire_read(wire_path(wire, "position"), &len);
        check_outages(&OUTAGES[k], (const uint8_t *)bytes, len);
        free(bytes);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_receiver_goes_wrong, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_power_cycles, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
