/* SPDX-License-Identifier: MIT */
/* These tests run a Hokuyo, a SICK and a VLP-16 at once. Each has clients of its personality, of the native stream and
 * of the GNSS receiver, for 6 s (THOROUGH=1: 15 s) of device time. Nothing is lost on any number of processors. */
#include "tests/common/thorough.h"
#include "tests/wire/wire.h"

#include <math.h>
#include <pthread.h>
#include <termios.h>

enum { N_HEADS = 3, N_READERS = 9 };
#define SECONDS thorough(15, 6)

/* Each reader runs in a thread of its own. */
struct reader {
    const char *(*read)(struct reader *reader); /* NULL, or what is wrong */
    int fd;
    struct scanhead *sh;
    size_t n;
    char bytes[1 << 16];
    char why[160];
    const char *wrong;
    pthread_t thread;
};

/* Reads more bytes. Returns 0, or -1. */
static int more(struct reader *r)
{
    struct pollfd slot = {.fd = r->fd, .events = POLLIN};
    if (poll(&slot, 1, DEADLINE_MS) != 1 || r->n == sizeof r->bytes - 1) return -1;
    ssize_t got = read(r->fd, r->bytes + r->n, sizeof r->bytes - 1 - r->n);
    if (got <= 0) return -1;
    r->n += (size_t)got;
    r->bytes[r->n] = '\0';
    return 0;
}

/* Moves the bytes up to and with `end` into `piece`. */
static int take(struct reader *r, const char *end, char *piece, size_t cap)
{
    const char *at;
    while ((at = strstr(r->bytes, end)) == NULL)
        if (more(r) != 0) return -1;
    const size_t len = (size_t)(at - r->bytes) + strlen(end);
    snprintf(piece, cap, "%.*s", (int)len, r->bytes);
    memmove(r->bytes, r->bytes + len, r->n - len + 1);
    r->n -= len;
    return 0;
}

static const char *wrong(struct reader *r, const char *what, long n, long got)
{
    snprintf(r->why, sizeof r->why, "%s: number %ld, %ld", what, n, got);
    return r->why;
}

/* Times of scans are ms of 24 bits, 25 apart. */
static const char *read_scip(struct reader *r)
{
    char piece[8192] = "", *at;
    long last = -1;
    do {
        raw_send(r->fd, "BM\n", 3);
        if (take(r, "\n\n", piece, sizeof piece) != 0) return "no answer to BM";
    } while (strncmp(piece, "BM\n00P\n", 7) != 0);
    raw_send(r->fd, "MD0000108001000\n", 16);
    if (take(r, "\n\n", piece, sizeof piece) != 0) return "no answer to MD";
    for (long n = 0; n < 40 * SECONDS; n++) {
        if (take(r, "\n\n", piece, sizeof piece) != 0 || (at = strstr(piece, "\n99b\n")) == NULL) return "no scan";
        long ms = 0;
        for (int i = 0; i < 4; i++)
            ms = ms << 6 | (at[5 + i] - 0x30);
        if (last >= 0 && ((ms - last) & 0xffffff) != 25) return wrong(r, "a scan of the Hokuyo", n, ms - last);
        last = ms;
    }
    return NULL;
}

/* Counts of telegrams are one apart. Times of scans are in us, at 15 Hz. */
static const char *read_cola(struct reader *r)
{
    char piece[16384];
    unsigned long count, us, last_count = 0, first_us = 0;
    raw_send(r->fd, "\2sEN LMDscandata 1\3", 19);
    if (take(r, "\3", piece, sizeof piece) != 0) return "no answer to sEN";
    for (long n = 0; n < 15 * SECONDS; n++) {
        if (take(r, "\3", piece, sizeof piece) != 0) return "no telegram";
        if (sscanf(piece, "\2sSN LMDscandata %*s %*s %*s %*s %*s %*s %lx %lx", &count, &us) != 2) return "not a scan";
        if (n == 0) first_us = us;
        if (n > 0 && count != ((last_count + 1) & 0xffff)) return wrong(r, "a scan of the SICK", n, (long)count);
        if (fabs((double)(us - first_us) - (double)n / 15e-6) > 1.0) return wrong(r, "a time of the SICK", n, (long)us);
        last_count = count;
    }
    return NULL;
}

/* Times of packets are us of an hour, 1327.104 apart, 753.5 a second. */
static const char *read_velodyne(struct reader *r)
{
    uint8_t packet[1207];
    uint32_t first = 0;
    for (long n = 0; n < lround(SECONDS / 1327.104e-6); n++) {
        struct pollfd slot = {.fd = r->fd, .events = POLLIN};
        if (poll(&slot, 1, DEADLINE_MS) != 1 || recv(r->fd, packet, sizeof packet, 0) != 1206) return "no packet";
        const uint32_t us =
            packet[1200] | (uint32_t)packet[1201] << 8 | (uint32_t)packet[1202] << 16 | (uint32_t)packet[1203] << 24;
        if (n == 0) first = us;
        const uint32_t passed = (us + 3600000000u - first) % 3600000000u;
        if (fabs(passed - (double)n * 1327.104) > 1.0) return wrong(r, "a packet of the VLP-16", n, (long)passed);
    }
    return NULL;
}

/* There is one RMC a second at least, and each sentence has its checksum. */
static const char *read_nmea(struct reader *r)
{
    char line[512];
    long last = -1;
    for (int n = 0; n < SECONDS;) {
        if (take(r, "\r\n", line, sizeof line) != 0) return "no sentence";
        const char *star = strchr(line, '*');
        unsigned sum = 0, said = 256;
        for (const char *at = line + 1; star != NULL && at < star; at++)
            sum ^= (unsigned char)*at;
        if (star == NULL || sscanf(star, "*%2X", &said) != 1 || said != sum) return wrong(r, "a sentence", n, 0);
        if (strncmp(line + 3, "RMC", 3) != 0) continue;
        const long hms = atol(line + 7), s = hms / 10000 * 3600 + hms / 100 % 100 * 60 + hms % 100;
        if (last >= 0 && s != last && (s - last + 86400) % 86400 != 1) return wrong(r, "a second", n, s - last);
        n += s != last;
        last = s;
    }
    return NULL;
}

static const char *read_native(struct reader *r)
{
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    int64_t first_ns = -1, last_ns = 0;
    while (last_ns - first_ns < SECONDS * INT64_C(1000000000)) {
        if (scanhead_next(r->sh, &frame, DEADLINE_MS) != SCANHEAD_OK) return scanhead_error(r->sh);
        if (first_ns < 0) first_ns = frame.t_ns;
        last_ns = frame.t_ns;
    }
    scanhead_get_stats(r->sh, &stats);
    if (stats.bad_payload + stats.bad_bytes + stats.seq_lost + stats.dropped != 0)
        return wrong(r, "native frames", (long)stats.frames, (long)stats.seq_lost);
    return NULL;
}

/* A reader that has seen enough closes, so that the head does not wait for it. But a closed port refuses packets, so
 * that of the VLP-16 stays open. */
static void *run(void *arg)
{
    struct reader *r = arg;
    r->wrong = r->read(r);
    if (r->sh != NULL && r->wrong == NULL)
        scanhead_close(r->sh);
    else if (r->fd >= 0 && r->read != read_velodyne)
        close(r->fd);
    return NULL;
}

static int terminal(const char *endpoint)
{
    struct termios raw;
    int fd = open(endpoint + strlen("tty:"), O_RDWR | O_NOCTTY | O_CLOEXEC);
    assert_true(fd >= 0 && tcgetattr(fd, &raw) == 0);
    cfmakeraw(&raw);
    assert_int_equal(tcsetattr(fd, TCSANOW, &raw), 0);
    return fd;
}

/* The packets' socket is as large as possible: this test's threads share the processors with the heads. */
static int udp_socket(int *port)
{
    const int fd = wire_bind(SOCK_DGRAM, port), room = 8 << 20;
    if (setsockopt(fd, SOL_SOCKET, SO_RCVBUFFORCE, &room, sizeof room) != 0)
        setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
    return fd;
}

/* The values of a key in the statistics add up to at most so much. */
static void expect_at_most(const struct wire *wire, const char *key, long long most)
{
    char *text = wire_read(wire_path(wire, "stats.json"), NULL), name[64];
    int n = 0;
    snprintf(name, sizeof name, "\"%s\": ", key);
    for (const char *at = text; (at = strstr(at, name)) != NULL; n++) {
        at += strlen(name);
        most -= atoll(at);
    }
    if (n == 0 || most < 0) fail_msg("%s in %s", key, text);
    free(text);
}

/* Starts a ready configuration on ports of the system's choice. A key that ends in `path` gets a path in the folder. */
static struct head start(struct wire *wire, const char *config, const char *const *sets)
{
    const char *more[WIRE_MAX_ARGS] = {"--set", IFC_BY_ASSIMP};
    char path[4][400];
    int n = 2, n_paths = 0;
    for (; *sets != NULL; sets++) {
        more[n++] = "--set";
        more[n++] = *sets;
        if (strstr(*sets, "path") == NULL) continue;
        snprintf(path[n_paths], sizeof path[0], "%s=%s", *sets, wire_path(wire, *sets));
        more[n - 1] = path[n_paths++];
    }
    more[n] = NULL;
    return head_start(wire, config, more);
}

static void test_nothing_is_lost(void **state)
{
    (void)state;
    static struct reader reader[N_READERS];
    static const char *const zero[] = {"lost_pulses", "lost_ticks", "reader_lost_pulses", "lost_points"};
    struct wire *wire[N_HEADS];
    struct head head[N_HEADS];
    char port[2][64];
    int number[2], data = udp_socket(&number[0]), position = udp_socket(&number[1]);
    for (int i = 0; i < 2; i++)
        snprintf(port[i], sizeof port[i], "links.%d.port=%d", i, number[i]);
    for (int i = 0; i < N_HEADS; i++)
        assert_int_equal(wire_setup((void **)&wire[i]), 0);
    head[0] = start(wire[0], "config/hokuyo.yaml",
                    (const char *const[]){"links.0.port=0", "links.1.path", "links.3.path", NULL});
    head[1] = start(wire[1], "config/sick.yaml",
                    (const char *const[]){"links.0.port=0", "links.1.path", "links.3.path", NULL});
    head[2] = start(wire[2], "config/velodyne.yaml",
                    (const char *const[]){port[0], port[1], "links.2.port=0", "links.4.path", NULL});
    /* The velodyne's client is first, as its packets come from now on. */
    static const int native[N_HEADS] = {2, 2, 3}, nmea[N_HEADS] = {3, 3, 4};
    reader[0] = (struct reader){.read = read_velodyne, .fd = data};
    reader[1] = (struct reader){.read = read_scip, .fd = raw_connect(head_link(&head[0], 0))};
    reader[2] = (struct reader){.read = read_cola, .fd = raw_connect(head_link(&head[1], 0))};
    for (int i = 0; i < N_HEADS; i++) {
        reader[3 + i] =
            (struct reader){.read = read_native, .fd = -1, .sh = client_open(head_link(&head[i], native[i]))};
        reader[6 + i] = (struct reader){.read = read_nmea, .fd = terminal(head_link(&head[i], nmea[i]))};
    }
    for (int i = 0; i < N_READERS; i++)
        assert_int_equal(pthread_create(&reader[i].thread, NULL, run, &reader[i]), 0);
    for (int i = 0; i < N_READERS; i++)
        pthread_join(reader[i].thread, NULL);
    for (int i = 0; i < N_READERS; i++)
        if (reader[i].wrong != NULL) fail_msg("reader %d: %s", i, reader[i].wrong);
    for (int i = 0; i < N_HEADS; i++) {
        head_end(&head[i], SIGTERM);
        for (size_t k = 0; k < sizeof zero / sizeof zero[0]; k++)
            expect_at_most(wire[i], zero[k], 0);
        /* The end of the scan cuts the VLP-16's last packet. No reader was too slow. */
        expect_at_most(wire[i], "lost_units", 0);
        expect_at_most(wire[i], "reader_lost_frames", 0);
        assert_int_equal(wire_teardown((void **)&wire[i]), 0);
    }
    close(data);
    close(position);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_nothing_is_lost)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
