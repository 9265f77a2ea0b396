/* SPDX-License-Identifier: MIT */
/* rawlog-grabber reads the ready configuration of a VLP-16, which needs no other key. Each packet of some turns comes,
 * at its time and azimuth, with the ranges of the house, and the receiver's time dates the turns. Then a head loses
 * packets on request. The grabber takes two fixed ports of this machine. */
#include "core/bytes.h"
#include "tests/wire/grabber.h"
#include "tests/wire/house.h"
#include "tests/wire/room.h"
#include "tests/wire/unit_faults.h"

enum { TURNS = 25, BLOCKS = 12, SHOTS = 32, PACKET = RAWLOG_PACKET_LEN };

/* This is the elevation of each laser of a firing sequence, in the layout's order; times in us. */
static const double ELEVATION_DEG[16] = {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};
static const double LASER_US = 2.304, SEQUENCE_US = 55.296, PACKET_US = 24 * 55.296, DEG_PER_US = 3600e-6; /* 600 rpm */
static const double MIN_M = 0.1, MAX_M = 100.0; /* the room has nothing outside of that */

static const int64_t HOUR_US = 3600000000;

/* The turns of a log, and all their packets, one after the other. */
struct packets {
    const struct rawlog_item **turn;
    uint32_t n_turns;
    struct {
        const uint8_t *bytes;
        uint32_t number; /* of this packet among those that the head sent since the first, by their time */
    } * packet;
    uint32_t n;
    double azimuth0_deg; /* of the first packet's first firing, finer than the packets say it */
};

/* Returns the microseconds from one packet to another, by their own time, which begins anew with each hour. */
static int64_t later_us(const uint8_t *packet, const uint8_t *first)
{
    const int64_t us = (int64_t)le_get32(packet + 1200) - le_get32(first + 1200);
    return us > HOUR_US / 2 ? us - HOUR_US : us < -HOUR_US / 2 ? us + HOUR_US : us;
}

static int by_device_time(const void *a, const void *b)
{
    const struct rawlog_item *const *one = a, *const *other = b;
    const int64_t us = later_us((*one)->packets, (*other)->packets);
    return (us > 0) - (us < 0);
}

/* The log is in the order of its own dates. Turns before the first fix have the host's date, which is late on a busy
 * machine, so they may stand behind younger ones. order: by_device_time, or NULL: as in the log. */
static void collect(const struct rawlog *log, int (*order)(const void *, const void *), struct packets *all)
{
    *all = (struct packets){0};
    all->turn = malloc((log->n_items + 1) * sizeof *all->turn);
    assert_non_null(all->turn);
    for (uint32_t i = 0; i < log->n_items; i++)
        if (log->item[i].kind == RAWLOG_TURN) all->turn[all->n_turns++] = &log->item[i];
    if (order != NULL) qsort(all->turn, all->n_turns, sizeof *all->turn, order);
    for (uint32_t i = 0; i < all->n_turns; i++) {
        all->packet = realloc(all->packet, (all->n + all->turn[i]->n) * sizeof *all->packet);
        assert_non_null(all->packet);
        for (uint32_t k = 0; k < all->turn[i]->n; k++)
            all->packet[all->n++].bytes = all->turn[i]->packets + (size_t)PACKET * k;
    }
    assert_true(all->n > 0);
}

/* Packets come at the device's rate: packet n comes n * 1327.104 us after the first, by its own time. None is missing
 * but those that the client did not read. */
static void check_times(struct packets *all, uint32_t dropped)
{
    for (uint32_t i = 0; i < all->n; i++) {
        const uint8_t *packet = all->packet[i].bytes;
        const double us = (double)later_us(packet, all->packet[0].bytes);
        const uint32_t number = (uint32_t)lround(us / PACKET_US);
        /* each time is rounded down to a microsecond */
        if (fabs(us - number * PACKET_US) >= 1.0) fail_msg("packet %u at %.0f us", i, us);
        if (number < i || number > i + dropped) fail_msg("packet %u is number %u; %u not read", i, number, dropped);
        all->packet[i].number = number;
        assert_int_equal(packet[1204], 0x37); /* strongest return */
        assert_int_equal(packet[1205], 0x22); /* VLP-16 */
    }
}

static double turned_deg(uint32_t n, int sequence, int laser)
{
    return DEG_PER_US * (n * PACKET_US + sequence * SEQUENCE_US + laser * LASER_US);
}

/* Checks how far each block's azimuth, rounded to 0.01 degrees, differs from the expected one. The first block's
 * azimuth is then corrected by the mean difference. */
static void check_azimuths(struct packets *all)
{
    const double begin_deg = 0.01 * le_get16(all->packet[0].bytes + 2);
    double sum = 0.0, least = INFINITY, most = -INFINITY;
    for (uint32_t n = 0; n < all->n; n++)
        for (int b = 0; b < BLOCKS; b++) {
            const uint8_t *block = all->packet[n].bytes + 100 * b;
            assert_int_equal(le_get16(block), 0xeeff);
            assert_true(le_get16(block + 2) < 36000);
            double off =
                remainder(0.01 * le_get16(block + 2) - begin_deg - turned_deg(all->packet[n].number, 2 * b, 0), 360.0);
            sum += off;
            least = fmin(least, off);
            most = fmax(most, off);
        }
    /* rounding to 0.01, and of the sum of doubles */
    if (most - least > 0.01 + 1e-6) fail_msg("azimuths are up to %.4f degrees apart", most - least);
    all->azimuth0_deg = begin_deg + sum / (all->n * BLOCKS);
}

static void check_ranges(const struct house *house, const struct packets *all, uint32_t n)
{
    for (int b = 0; b < BLOCKS; b++)
        for (int shot = 0; shot < SHOTS; shot++) {
            const uint8_t *at = all->packet[n].bytes + 100 * b + 4 + 3 * shot;
            const double azimuth =
                (all->azimuth0_deg + turned_deg(all->packet[n].number, 2 * b + shot / 16, shot % 16)) * M_PI / 180.0;
            const double elevation = ELEVATION_DEG[shot % 16] * M_PI / 180.0, range_m = 0.002 * le_get16(at);
            /* The bound is half of 2 mm. The mean of azimuths that are rounded in a regular pattern is good to a tenth
             * of 0.01 degrees: 2e-5 rad. */
            if (!house_agrees(house, azimuth, elevation, 2e-5, range_m, 0.00101, MIN_M, MAX_M))
                fail_msg("packet %u block %d shot %d: %.3f m instead of %.4f", n, b, shot, range_m,
                         house_range_m(house, azimuth, elevation));
        }
}

/* From the first fix on, turns have the device's date: day and hour by the receiver, the rest by the packet. */
static void check_dates(const struct rawlog *log, const struct packets *all)
{
    int fixes = 0, dated = 0;
    for (uint32_t i = 0; i < log->n_items; i++)
        fixes += log->item[i].kind == RAWLOG_GPS;
    for (uint32_t i = 0; i < all->n_turns; i++) {
        const struct rawlog_item *turn = all->turn[i];
        const int64_t us = turn->t_100ns / 10 % HOUR_US, is = le_get32(turn->packets + 1200);
        /* 1: rounding of seconds in double. The first turns may have begun before the first fix. */
        if (llabs(us - is) <= 1)
            dated++;
        else if (dated > 0)
            fail_msg("a turn at %lld us is dated %lld us", (long long)is, (long long)us);
    }
    assert_true(fixes > 0 && dated > 5);
}

static int is_free(int type, int port)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)port)};
    at.sin_addr.s_addr = htonl(INADDR_ANY);
    int fd = socket(AF_INET, type | SOCK_CLOEXEC, 0), one = 1;
    if (type == SOCK_STREAM) setsockopt(fd, SOL_SOCKET, SO_REUSEADDR, &one, sizeof one);
    int rc = bind(fd, (struct sockaddr *)&at, sizeof at);
    close(fd);
    return rc == 0;
}

static void ports_or_skip(void)
{
    if (is_free(SOCK_DGRAM, 2368) && is_free(SOCK_DGRAM, 8308) && is_free(SOCK_STREAM, 8080)) return;
    print_message("UDP ports 2368 and 8308 and TCP port 8080 of this machine are not free\n");
    skip();
}

/* Reads so many turns, and ends head and client. Returns how many packets the kernel threw away meanwhile. */
static uint32_t read_turns(struct grabber *grabber, int n, struct head *head, struct rawlog *log)
{
    if (!grabber_wait(grabber, n)) fail_msg("rawlog-grabber complains:\n%s", grabber->said);
    head_end(head, SIGTERM);
    const uint32_t dropped = grabber_dropped_at(2368);
    grabber_end(grabber);
    rawlog_read(grabber, log);
    return dropped;
}

static void test_turns(void **state)
{
    struct wire *wire = *state;
    static struct grabber grabber;
    struct rawlog log;
    struct packets all;
    grabber_or_skip();
    ports_or_skip();
    const double mark = atan2(1.1, 0.5);
    grabber_start(wire, "VLP", "driver = CVelodyneScanner\nmodel = VLP16\n", &grabber);
    struct head head = head_start(wire, "config/velodyne.yaml", house_options(wire, "4", NULL));
    struct house *house = house_load(wire);
    assert_true(house_is_mark(house, mark, 0.0) && !house_is_mark(house, -mark, 0.0));
    const uint32_t dropped = read_turns(&grabber, TURNS + 2, &head, &log);
    collect(&log, by_device_time, &all);
    check_times(&all, dropped);
    check_azimuths(&all);
    for (uint32_t n = 80; n < 80 + 76; n++) /* more than a turn */
        check_ranges(house, &all, n);
    check_dates(&log, &all);
    free(all.turn);
    free(all.packet);
    rawlog_free(&log);
    house_free(house);
}

/* ---- config/faults/lossy-udp.yaml on the link of the data packets; the clean ones go to a file */

static const char LOSSY_CONFIG[] =
    "head: {profile: velodyne-vlp16, start: on, frames: 0}\n"
    "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
    "stations: [{position_m: [0.31, -0.42, 0.17]}]\n"
    "beam: {echoes: strongest}\n"
    "links: [{type: udp, protocol: velodyne, port: 2368}, {type: file, protocol: velodyne, path: clean}]\n"
    "loop: {late_ms: 10000, queue_ms: 10000}\n";

/* Writes the scenario with each fault on link 1. */
static const char *lossy_scenario(const struct wire *wire)
{
    char *text = wire_read("config/faults/lossy-udp.yaml", NULL);
    FILE *f = fopen(wire_path(wire, "lossy.yaml"), "w");
    assert_non_null(f);
    for (char *at = text, *next; at != NULL; at = next) {
        next = strstr(at + 1, "{kind:");
        fprintf(f, "%.*s%s", next != NULL ? (int)(next - at) : (int)strlen(at), at, next != NULL ? "{link: 1, " : "");
        if (next != NULL) next++;
    }
    assert_int_equal(fclose(f), 0);
    free(text);
    return wire_path(wire, "lossy.yaml");
}

static size_t packet_whole(const uint8_t *bytes, size_t len)
{
    (void)bytes;
    return len >= PACKET ? PACKET : 0;
}

static struct head start_lossy(struct wire *wire)
{
    static char scenario[352], truth[352];
    room_write(wire);
    snprintf(scenario, sizeof scenario, "%s", lossy_scenario(wire));
    snprintf(truth, sizeof truth, "%s", wire_path(wire, "truth.json"));
    const char *const args[] = {"--scenario", scenario, "--truth", truth, NULL};
    return head_start(wire, wire_write_text(wire, "config.yaml", LOSSY_CONFIG), args);
}

/* Applies the truth to the clean packets. */
static void read_truth(struct wire *wire, struct unit_list *sent)
{
    static const char *const kinds[] = {"drop", "duplicate", "reorder", "jitter"};
    struct unit_list clean = {0};
    size_t len;
    uint32_t n;
    char *bytes = wire_read(wire_path(wire, "clean"), &len);
    units_add(&clean, bytes, len);
    free(bytes);
    units_cut(&clean, packet_whole);
    struct truth_note *note = truth_read(wire_path(wire, "truth.json"), 1, &n);
    for (size_t i = 0; i < sizeof kinds / sizeof kinds[0]; i++)
        assert_true(truth_count(note, n, kinds[i]) > 0);
    units_expect(&clean, note, n, sent);
    free(note);
    units_free(&clean);
}

/* Follows the packets of the log from one of the sent ones on. The client leaves out shorter ones, and as many may be
 * missing as it did not read. Returns how many packets fit. */
static uint32_t follow(const struct packets *all, const struct unit_list *sent, uint32_t from, uint32_t dropped)
{
    uint32_t n = 0, missing = 0;
    for (uint32_t i = from; n < all->n && i < sent->n; i++) {
        size_t len;
        const uint8_t *packet = units_get(sent, i, &len);
        if (len != PACKET) continue;
        if (memcmp(packet, all->packet[n].bytes, PACKET) == 0)
            n++;
        else if (missing++ == dropped)
            break;
    }
    return n;
}

/* Each whole packet that was sent is read in the order in which it came, and twice where it came twice. */
static void check_lossy(const struct packets *all, const struct unit_list *sent, uint32_t dropped)
{
    uint32_t best = 0;
    for (uint32_t i = 0; i < sent->n && best < all->n; i++) {
        size_t len;
        const uint8_t *packet = units_get(sent, i, &len);
        if (len != PACKET || memcmp(packet, all->packet[0].bytes, PACKET) != 0) continue;
        const uint32_t n = follow(all, sent, i, dropped);
        if (n > best) best = n;
    }
    if (best < all->n) fail_msg("%u of %u packets fit; %u were not read", best, all->n, dropped);
}

/* The client ends a turn where the azimuth falls: with each turn of the head, and at each packet that comes too
 * late. */
static void check_cuts(const struct rawlog *log)
{
    int before = -1;
    for (uint32_t i = 0; i < log->n_items; i++) {
        const struct rawlog_item *turn = &log->item[i];
        for (uint32_t k = 0; turn->kind == RAWLOG_TURN && k < turn->n; k++) {
            const int azimuth = (int)le_get16(turn->packets + (size_t)PACKET * k + 2);
            if (before >= 0 && (azimuth < before) != (k == 0))
                fail_msg("turn %u, packet %u: azimuth %d after %d", i, k, azimuth, before);
            before = azimuth;
        }
    }
}

static void test_lossy(void **state)
{
    struct wire *wire = *state;
    static struct grabber grabber;
    struct rawlog log;
    struct packets all;
    struct unit_list sent = {0};
    grabber_or_skip();
    ports_or_skip();
    grabber_start(wire, "LOSSY", "driver = CVelodyneScanner\nmodel = VLP16\n", &grabber);
    struct head head = start_lossy(wire);
    const uint32_t dropped = read_turns(&grabber, TURNS, &head, &log);
    collect(&log, NULL, &all);
    read_truth(wire, &sent);
    check_lossy(&all, &sent, dropped);
    check_cuts(&log);
    free(all.turn);
    free(all.packet);
    rawlog_free(&log);
    units_free(&sent);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_turns, wire_setup, wire_teardown),
                                       cmocka_unit_test_setup_teardown(test_lossy, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
