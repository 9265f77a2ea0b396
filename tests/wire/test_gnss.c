/* SPDX-License-Identifier: MIT */
/* The GNSS receiver on its links. Sentences are whole and in order, and all come or are counted as lost. The PPS of the
 * native stream comes beside them. */
#include "tests/wire/gnss_rig.h"

#include "tests/common/nmea_reader.h"

static const char *const ORDER[5] = {"GNRMC", "GNGGA", "GNGSA", "GNGST", "GNZDA"};

/* A reader's sentences of the receiver: whole ones only, five to a moment, in their order. */
struct tally {
    char rest[256];
    size_t rest_len;
    int sentences, moments, first, last; /* of the first and last moment, twentieths of a second since midnight */
};

static void take_sentence(struct tally *t, const char *text, size_t len)
{
    struct nmea_line line;
    int h, m, s, hundredth;
    read_line(text, len, ORDER[t->sentences % 5], 0, &line);
    if (t->sentences++ % 5 != 1) return;
    assert_int_equal(sscanf(line.field[1], "%2d%2d%2d.%2d", &h, &m, &s, &hundredth), 4);
    int at = ((h * 60 + m) * 60 + s) * 20 + hundredth / 5;
    assert_true(t->moments == 0 || at > t->last);
    if (t->moments++ == 0) t->first = at;
    t->last = at;
}

static void take_bytes(struct tally *t, const char *bytes, size_t len)
{
    for (size_t i = 0; i < len; i++) {
        assert_true(t->rest_len < sizeof t->rest);
        t->rest[t->rest_len++] = bytes[i];
        if (bytes[i] != '\n') continue;
        take_sentence(t, t->rest, t->rest_len);
        t->rest_len = 0;
    }
}

/* Reads once. Returns 0 when the head is gone. */
static int tally_read(struct tally *t, int fd)
{
    char buf[4096];
    struct pollfd slot = {.fd = fd, .events = POLLIN};
    if (poll(&slot, 1, DEADLINE_MS) != 1) fail_msg("no sentence");
    ssize_t n = read(fd, buf, sizeof buf);
    if (n <= 0) return 0;
    take_bytes(t, buf, (size_t)n);
    return 1;
}

/* 2026-01-01 is 16797 days after 1980-01-06 (46 years, 12 leap days, less 5). There were 18 leap seconds since (IERS
 * Bulletin C). */
static const int64_t GPS0_S = INT64_C(16797) * 86400 + 18;

/* Checks the recording of the native stream: each full second, and the GPS time of each pulse by them. */
static void check_recording(const char *path, int seconds)
{
    struct scanhead *sh = client_open(path);
    struct scanhead_frame frame;
    int64_t scan_t0_ns = -1;
    int pps = 0, points = 0;
    while (scanhead_next(sh, &frame, DEADLINE_MS) == SCANHEAD_OK) {
        if (is_event(&frame, SCANHEAD_EV_PPS)) {
            char text[32];
            snprintf(text, sizeof text, "2026-01-01T00:00:%02dZ", pps);
            assert_string_equal(frame.event_text, text);
            assert_true(frame.event_value[0] == (uint64_t)(1767225600 + pps)); /* date -u -d 2026-01-01 +%s */
            assert_true(frame.event_value[1] == (uint64_t)pps * 1000000000u);
            assert_true(frame.event_value[2] == (uint64_t)(GPS0_S + pps));
            pps++;
        }
        if (is_event(&frame, SCANHEAD_EV_SCAN_START)) {
            scan_t0_ns = (int64_t)frame.event_value[1];
            assert_true((int64_t)frame.event_value[2] == GPS0_S * 1000000000 + scan_t0_ns);
        }
        if (frame.type != SCANHEAD_POINTS) continue;
        struct scanhead_point p;
        double gps_s, wanted_s;
        points++;
        assert_int_equal(scanhead_points(sh, &frame, 0, &p, 1), 1);
        assert_int_equal(scanhead_gps_time(sh, p.t_ns, &gps_s), SCANHEAD_OK);
        wanted_s = (double)(GPS0_S - 1000000000) + 1e-9 * (double)(scan_t0_ns + p.t_ns);
        assert_true(fabs(gps_s - wanted_s) <= 0x1p-23); /* two roundings of a number below 2^30, in steps of 2^-23 s */
    }
    assert_true(scan_t0_ns > 0 && points > 100);
    assert_int_equal(pps, seconds);
    scanhead_close(sh);
}

/* In the pace fast, all sentences come into a file, the same in two runs. The stream's hash is that of a head without a
 * receiver. */
static void test_files(void **state)
{
    struct wire *wire = *state;
    static const char *const more[] = {"--start", "--pace", "fast",  "--duration",      "3",     "--frames",
                                       "0",       PLACE,    "--set", "gnss.rate_hz=20", "--set", "gnss.accuracy_m=0.02",
                                       NULL};
    static const char *const plain[] = {"--start", "--pace", "fast",  "--duration",      "3", "--frames",
                                        "0",       PLACE,    "--set", "time.epoch=none", NULL};
    char *text[2], hash[3][65];
    size_t len[2];
    for (int i = 0; i < 2; i++) {
        struct head head = head_start(wire,
                                      write_room(wire, "links: [{type: file, path: all.nmea, protocol: nmea},"
                                                       " {type: file, path: all.shs}]\n"),
                                      more);
        head_end(&head, 0);
        stats_hash(wire, hash[i]);
        text[i] = wire_read(wire_path(wire, "all.nmea"), &len[i]);
    }
    assert_true(len[0] == len[1]);
    assert_memory_equal(text[0], text[1], len[0]);
    struct tally t = {.rest_len = 0};
    take_bytes(&t, text[0], len[0]);
    assert_int_equal(t.rest_len, 0);
    assert_int_equal(t.sentences, 5 * t.moments);
    assert_int_equal(t.first, 0);
    assert_int_equal(t.last - t.first + 1, t.moments);
    check_recording(wire_path(wire, "all.shs"), t.last / 20 + 1);
    struct head head = head_start(wire, write_room(wire, "links: [{type: \"null\"}]\n"), plain);
    head_end(&head, 0);
    stats_hash(wire, hash[2]);
    assert_string_equal(hash[0], hash[1]);
    assert_string_equal(hash[0], hash[2]);
    free(text[0]);
    free(text[1]);
}

/* Bytes that a client sends a receiver are no command, and the receiver goes on. */
static void test_receiver_takes_no_commands(void **state)
{
    struct wire *wire = *state;
    static const char *const more[] = {PLACE, "--set", "gnss.rate_hz=20", NULL};
    static const char noise[] = "SCAN:START\r\nHEAD:PRR 1e9\n$PUBX,00*33\r\n\xb5\x62\x0a\x04 nonsense";
    struct head head = head_start(wire, write_room(wire, NMEA_PTY), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct tally t = {.rest_len = 0};
    assert_non_null(strstr(head.ready, "gnss\",\"protocol\":\"nmea\"}"));
    client_wait_state(sh, "idle");
    int fd = open(wire_path(wire, "gnss"), O_RDWR | O_NOCTTY | O_CLOEXEC);
    raw_send(fd, noise, sizeof noise - 1);
    while (t.moments < 3)
        tally_read(&t, fd);
    assert_string_equal(client_ask(sh, "HEAD:STAT?"), "idle");
    assert_string_equal(client_ask(sh, "SYST:CONT?"), "0");
    close(fd);
    /* Another reader comes, while the head scans. */
    client_tell(sh, "SCAN:START");
    memset(&t, 0, sizeof t);
    fd = open(wire_path(wire, "gnss"), O_RDWR | O_NOCTTY | O_CLOEXEC);
    /* The first ones may be some that the kernel still held for the reader before. A receiver that leaves some out
     * never has three in a row. */
    for (int tries = 0; tries == 0 || (t.last - t.first != 2 && tries < 10); tries++) {
        t.moments = 0;
        while (t.moments < 3)
            tally_read(&t, fd);
    }
    assert_int_equal(t.last - t.first, 2);
    close(fd);
    client_tell(sh, "SCAN:STOP");
    assert_string_equal(client_ask(sh, "SYST:ERR?"), "0,\"No error\"");
    scanhead_close(sh);
    head_end(&head, SIGTERM);
}

/* A port is open but not read. Sentences that the system can't hold are lost, in whole moments, counted and reported.
 * After the reader is back they are whole again. */
static void test_slow_reader(void **state)
{
    struct wire *wire = *state;
    static const char *const more[] = {PLACE, "--set", "gnss.rate_hz=20", "--set", "loop.queue_ms=1000", NULL};
    struct head head = head_start(wire, write_room(wire, NMEA_PTY), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    struct tally t = {.rest_len = 0};
    int fd = open(wire_path(wire, "gnss"), O_RDWR | O_NOCTTY | O_CLOEXEC);
    /* 6.7 kB/s fill a pty, 14 kB or so, and the queue of a second within half of the six seconds. */
    for (int pps = 0; pps < 6; pps++)
        client_until(sh, SCANHEAD_EV_PPS, &frame);
    int back = (int)(frame.event_value[0] - 1767225600) * 20;
    while (t.last < back + 20)
        assert_true(tally_read(&t, fd));
    int missing = t.last - t.first + 1 - t.moments;
    assert_true(missing > 0);
    assert_int_equal(atoi(client_ask(sh, "SYST:ERR?")), 102);
    assert_int_equal(atoi(client_ask(sh, "SYST:ERR?")), 0); /* said once */
    scanhead_close(sh);
    assert_int_equal(kill(head.pid, SIGTERM), 0);
    while (tally_read(&t, fd))
        continue;
    close(fd);
    assert_int_equal(t.last - t.first + 1 - t.moments, missing); /* none any more since it is back */
    assert_int_equal(t.rest_len, 0);
    head_end(&head, 0);
    assert_int_equal(stats_uint(wire, "reader_lost_frames"), missing);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_files, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_receiver_takes_no_commands, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_slow_reader, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
