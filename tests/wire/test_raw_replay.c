/* SPDX-License-Identifier: MIT */
/* A capture of a VLP-16, replayed by tcpreplay onto loopback, is read by rawlog-grabber as the live sensor was. So is
 * the file itself. The head is started twice, and sends the same bytes both times: to the grabber, and to the recorder.
 *
 * All runs in a network namespace of the test's own. The namespace has the sensor's ports, and a loopback that takes
 * packets with its own addresses from outside. Without the right to that, or without the two programs, the test is
 * skipped. */
#include <sched.h>

#include <net/if.h>
#include <sys/ioctl.h>

#include "core/bytes.h"
#include "tests/wire/captured.h"
#include "tests/wire/grabber.h"
#include "tests/wire/room.h"

enum { OBJECTS = 9, DATA_PORT = 2368, POSITION_PORT = 8308, PACKET = RAWLOG_PACKET_LEN };

#define TCPREPLAY "/usr/bin/tcpreplay"

static const char CONFIG[] =
    "head: {profile: velodyne-vlp16, start: on, frames: 0}\n"
    "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
    "stations: [{position_m: [0.31, -0.42, 0.17], lat_deg: 48.1, lon_deg: 11.6, height_m: 500}]\n"
    "beam: {echoes: strongest}\n"
    "time: {epoch: 2026-05-04T03:02:01Z}\n"
    "links: [{type: udp, protocol: velodyne, port: 2368}, {type: udp, protocol: velodyne-position, port: 8308}]\n"
    "loop: {late_ms: 10000, queue_ms: 10000}\n";

/* Live and captured it sends the same packets, however slow the machine is. */
static const char *const FOR_A_WHILE[] = {"--duration", "0.8", NULL};

/* ---- the namespace */

static int put_line(const char *path, const char *text)
{
    const int fd = open(path, O_WRONLY | O_CLOEXEC);
    if (fd < 0) return 0;
    const int good = write(fd, text, strlen(text)) == (ssize_t)strlen(text);
    close(fd);
    return good;
}

/* Leaves the network directly as root, else as the root of a user namespace. */
static int leave_network(void)
{
    char map[32];
    if (unshare(CLONE_NEWNET) == 0) return 1;
    snprintf(map, sizeof map, "0 %u 1", (unsigned)getuid());
    return unshare(CLONE_NEWUSER | CLONE_NEWNET) == 0 && put_line("/proc/self/uid_map", map);
}

static int raise_loopback(void)
{
    struct ifreq lo = {.ifr_name = "lo", .ifr_flags = IFF_UP | IFF_LOOPBACK | IFF_RUNNING};
    const int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    const int good = ioctl(fd, SIOCSIFFLAGS, &lo) == 0;
    close(fd);
    return good && put_line("/proc/sys/net/ipv4/conf/lo/route_localnet", "1") &&
           put_line("/proc/sys/net/ipv4/conf/lo/accept_local", "1");
}

static void network_or_skip(void)
{
    grabber_or_skip();
    if (access(TCPREPLAY, X_OK) != 0) {
        print_message("%s is not there: package tcpreplay\n", TCPREPLAY);
        skip();
    }
    if (leave_network() && raise_loopback()) return;
    print_message("no network namespace of the test's own: %s\n", strerror(errno));
    skip();
}

/* ---- what came */

/* The data packets of a log, with the times of their turns. */
struct read_packets {
    struct rawlog log;
    struct {
        const uint8_t *bytes;
        int64_t turn_100ns; /* of its turn, where it is that one's first; else 0 */
    } packet[4000];
    uint32_t n, n_turns, n_fixes;
};

/* Sorts by the sensor's own time, which is within one hour here. The log is in the order of its dates, and a turn
 * before the first fix has the host's. */
static int by_sensor_time(const void *a, const void *b)
{
    const struct rawlog_item *one = a, *other = b;
    const int are_turns = (one->kind == RAWLOG_TURN) - (other->kind == RAWLOG_TURN);
    if (are_turns != 0 || one->kind != RAWLOG_TURN) return -are_turns;
    const uint32_t us = le_get32(one->packets + 1200), other_us = le_get32(other->packets + 1200);
    return (us > other_us) - (us < other_us);
}

static void collect(const struct grabber *grabber, struct read_packets *all)
{
    rawlog_read(grabber, &all->log);
    qsort(all->log.item, all->log.n_items, sizeof *all->log.item, by_sensor_time);
    all->n = all->n_turns = all->n_fixes = 0;
    for (uint32_t i = 0; i < all->log.n_items; i++) {
        const struct rawlog_item *item = &all->log.item[i];
        all->n_fixes += item->kind == RAWLOG_GPS;
        all->n_turns += item->kind == RAWLOG_TURN;
        for (uint32_t k = 0; item->kind == RAWLOG_TURN && k < item->n; k++) {
            assert_true(all->n < sizeof all->packet / sizeof all->packet[0]);
            all->packet[all->n].bytes = item->packets + (size_t)PACKET * k;
            all->packet[all->n++].turn_100ns = k == 0 ? item->t_100ns : 0;
        }
    }
}

/* Returns the first data packet of the capture from `i` on that has these bytes (NULL: any); captured->n: none. */
static uint32_t find_packet(const struct captured *captured, uint32_t i, const uint8_t *bytes)
{
    for (; i < captured->n; i++)
        if (captured->packet[i].to_port == DATA_PORT &&
            (bytes == NULL || memcmp(captured->packet[i].data, bytes, PACKET) == 0))
            break;
    return i;
}

/* Each packet of the log is the next one of the capture, from its first one on; `dropped` may be missing. */
static void check_packets(const char *what, const struct read_packets *all, const struct captured *captured,
                          uint32_t dropped)
{
    uint32_t missing = 0, at = find_packet(captured, 0, NULL);
    if (all->n_turns < 5 || all->n_fixes < 1) fail_msg("%s: %u turns, %u fixes", what, all->n_turns, all->n_fixes);
    for (uint32_t n = 0; n < all->n; n++, at = find_packet(captured, at + 1, NULL)) {
        const uint32_t same = find_packet(captured, at, all->packet[n].bytes);
        if (same == captured->n) fail_msg("%s: packet %u of %u is not in the capture", what, n, all->n);
        for (; at != same; at = find_packet(captured, at + 1, NULL))
            missing++;
    }
    if (missing > dropped) fail_msg("%s: %u packets are missing, and %u were not read", what, missing, dropped);
}

/* From the first fix on a turn's date is the sensor's: that hour, and its first packet's time in it. Before, the date
 * is the host's. The first turn alone, at most, has such a date, since fixes come while the sensor spins up. */
static void check_dates(const char *what, const struct read_packets *all)
{
    struct tm hour = {.tm_year = 126, .tm_mon = 4, .tm_mday = 4, .tm_hour = 3}; /* as CONFIG has it */
    const int64_t hour_100ns = (timegm(&hour) + INT64_C(11644473600)) * 10000000;
    uint32_t dated = 0;
    for (uint32_t i = 0; i < all->n; i++) {
        if (all->packet[i].turn_100ns == 0) continue;
        const int64_t off_100ns =
            all->packet[i].turn_100ns - hour_100ns - INT64_C(10) * le_get32(all->packet[i].bytes + 1200);
        /* 1 us: rounding of seconds in double */
        if (llabs(off_100ns) <= 10)
            dated++;
        else if (i > 0)
            fail_msg("%s: the turn of packet %u is dated wrongly by %lld us", what, i, (long long)off_100ns / 10);
    }
    assert_true(dated + 1 >= all->n_turns);
}

/* ---- the runs */

static int is_bound(int port)
{
    char line[256];
    unsigned local;
    int found = 0;
    FILE *f = fopen("/proc/net/udp", "r");
    assert_non_null(f);
    while (fgets(line, sizeof line, f) != NULL)
        found |= sscanf(line, "%*d: %*x:%x", &local) == 1 && (int)local == port;
    fclose(f);
    return found;
}

/* The grabber's ports are open when this returns, so each packet is read, or counted as dropped. */
static void start_grabber(struct wire *wire, const char *name, struct grabber *grabber)
{
    const int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    grabber_start(wire, name, "driver = CVelodyneScanner\nmodel = VLP16\n", grabber);
    while (!is_bound(DATA_PORT) || !is_bound(POSITION_PORT)) {
        if (wire_now_ms() > end_ms) fail_msg("rawlog-grabber opens no ports");
        poll(NULL, 0, 5);
    }
}

static void read_live(struct wire *wire, const char *config, struct read_packets *out, uint32_t *dropped)
{
    static struct grabber grabber;
    start_grabber(wire, "LIVE", &grabber);
    struct head head = head_start(wire, config, FOR_A_WHILE);
    head_end(&head, 0);
    if (!grabber_wait(&grabber, OBJECTS)) fail_msg("rawlog-grabber complains:\n%s", grabber.said);
    *dropped = grabber_dropped_at(DATA_PORT);
    grabber_end(&grabber);
    collect(&grabber, out);
}

static void capture(struct wire *wire, const char *config)
{
    struct raw_recorder recorder = raw_recorder_start(wire, "udp:127.0.0.1:2368,8308", NULL);
    struct head head = head_start(wire, config, FOR_A_WHILE);
    head_end(&head, 0);
    raw_recorder_end(&recorder, SIGINT, 0, NULL);
}

static void read_replay(struct wire *wire, struct read_packets *out, uint32_t *dropped)
{
    static struct grabber grabber;
    static char file[352];
    snprintf(file, sizeof file, "%s", wire_path(wire, "cap.pcapng"));
    start_grabber(wire, "REPLAY", &grabber);
    const char *const args[] = {"-q", "-i", "lo", file, NULL};
    wire_run_program(wire, TCPREPLAY, args, 0);
    if (!grabber_wait(&grabber, OBJECTS)) fail_msg("rawlog-grabber complains:\n%s", grabber.said);
    *dropped = grabber_dropped_at(DATA_PORT);
    grabber_end(&grabber);
    collect(&grabber, out);
}

static void read_file(struct wire *wire, struct read_packets *out)
{
    static struct grabber grabber;
    char sensor[512];
    snprintf(
        sensor, sizeof sensor,
        "driver = CVelodyneScanner\nmodel = VLP16\npcap_input = %s\npcap_read_once = true\npcap_read_fast = true\n",
        wire_path(wire, "cap.pcapng"));
    grabber_start(wire, "FILE", sensor, &grabber);
    if (!grabber_wait(&grabber, OBJECTS)) fail_msg("rawlog-grabber complains:\n%s", grabber.said);
    grabber_end(&grabber);
    collect(&grabber, out);
}

static void test_replay(void **state)
{
    struct wire *wire = *state;
    static struct read_packets live, replay, file;
    struct captured captured;
    uint32_t not_read[2];
    char config[352];
    network_or_skip();
    room_write(wire);
    snprintf(config, sizeof config, "%s", wire_write_text(wire, "config.yaml", CONFIG));
    read_live(wire, config, &live, &not_read[0]);
    capture(wire, config);
    captured_read(wire, &captured);
    captured_check_order(&captured);
    check_packets("live", &live, &captured, not_read[0]);
    read_replay(wire, &replay, &not_read[1]);
    check_packets("replayed", &replay, &captured, not_read[1]);
    read_file(wire, &file);
    check_packets("file", &file, &captured, 0);
    check_dates("live", &live);
    check_dates("replayed", &replay);
    check_dates("file", &file);
    rawlog_free(&live.log);
    rawlog_free(&replay.log);
    rawlog_free(&file.log);
    captured_free(&captured);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_setup_teardown(test_replay, wire_setup, wire_teardown)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
