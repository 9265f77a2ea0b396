/* SPDX-License-Identifier: MIT */
/* A recording is served as the device that it was recorded from: a SICK, a Hokuyo, a VLP-16. The ranges that a client
 * reads are those of the recording, which the client library reads beside it, to half a unit of the device. */
#include <math.h>

#include "core/bytes.h"
#include "tests/wire/grabber.h"
#include "tests/wire/replay_rig.h"

enum { MOST = 1 << 14, MM = 1000, VLP_PACKET = 1206 };

static const char CONFIG[] =
    "head: {profile: %s, start: on, frames: 0}\n"
    "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
    "stations: [{position_m: [0.31, -0.42, 0.17], lat_deg: 48.1, lon_deg: 11.6, height_m: 500}]\n"
    "beam: {echoes: strongest}\n"
    "time: {epoch: 2026-05-04T03:02:01Z}\n"
    "links: [{type: file, path: rec.shs}%s]\n";

/* Records a head. more: further links, each after a comma. */
static void record(struct wire *wire, const char *profile, const char *duration_s, const char *more)
{
    char text[sizeof CONFIG + 300];
    room_write(wire);
    snprintf(text, sizeof text, CONFIG, profile, more);
    const char *const args[] = {
        "run", wire_write_text(wire, "c.yaml", text), "--start", "--duration", duration_s, "--pace", "fast", "--quiet",
        NULL};
    const int status = replay_call(wire, args);
    if (status != 0) wire_show(wire, "err");
    assert_int_equal(status, 0);
}

/* Ranges of the recording's shots in their order, 0 without an echo; with `line`, of one line. */
static uint32_t read_ranges(const struct wire *wire, int line, double *range_m)
{
    static struct scanhead_point point[4096];
    struct scanhead *sh = client_open(wire_path(wire, "rec.shs"));
    struct scanhead_frame frame;
    uint32_t n = 0;
    while (scanhead_next(sh, &frame, DEADLINE_MS) == SCANHEAD_OK) {
        if (frame.type != SCANHEAD_POINTS || (line >= 0 && le_get32(frame.payload + 4) != (uint32_t)line)) continue;
        const int got = scanhead_points(sh, &frame, 0, point, 4096);
        for (int i = 0; i < got; i++) {
            assert_true(n < MOST && point[i].echo <= 1);
            range_m[n++] = point[i].echo == 0 ? 0.0 : point[i].range_m;
            if (n == MOST) break;
        }
        if (n == MOST) break;
    }
    scanhead_close(sh);
    return n;
}

static void check_range(uint32_t i, double got_m, double want_m, double unit_m)
{
    /* half a unit is the device's rounding; 1e-6 m is more than that of the recording */
    if (fabs(got_m - want_m) > 0.5 * unit_m + 1e-6) fail_msg("shot %u: %.4f m, recorded %.6f m", i, got_m, want_m);
}

static struct head serve(struct wire *wire, const char *link)
{
    const char *const more[] = {"--link", link, "--quiet", "--loop", NULL};
    return head_start(wire, wire_path(wire, "rec.shs"), more);
}

/* Sends a request and reads until the end of its answer is there. */
static const char *ask(int fd, const char *request, const char *begins, const char *end)
{
    static char got[1 << 17];
    size_t len = 0;
    raw_send(fd, request, strlen(request));
    for (;;) {
        got[len] = '\0';
        const char *at = strstr(got, begins), *to = at != NULL ? strstr(at + strlen(begins), end) : NULL;
        if (to != NULL) return at;
        struct pollfd slot = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&slot, 1, DEADLINE_MS), 1);
        const ssize_t n = read(fd, got + len, sizeof got - 1 - len);
        if (n <= 0) fail_msg("the link ended after: %.80s", got);
        len += (size_t)n;
        assert_true(len < sizeof got - 1);
    }
}

/* COLA.md: the beams of a counter-clockwise head are in the order of firing, and DIST1 counts millimetres. */
static void test_cola(void **state)
{
    struct wire *wire = *state;
    static double range_m[MOST];
    record(wire, "sick-tim571", "0.4", "");
    const uint32_t n = read_ranges(wire, 2, range_m);
    assert_int_equal(n, 811);
    struct head head = serve(wire, "type: tcp, protocol: cola");
    const int fd = raw_connect(head_endpoint(&head, "tcp"));
    assert_non_null(strstr(ask(fd, "\x02sRN DeviceIdent\x03", "sRA DeviceIdent", "\x03"), "TiM571"));
    ask(fd, "\x02sMN SetAccessMode 03 F4724744\x03", "sAN SetAccessMode 1", "\x03");
    /* Another rate is refused with status 1: no such frequency. */
    const char *refused =
        ask(fd, "\x02sMN mLMPsetscancfg +2500 +1 +3333 -450000 +2250000\x03", "sAN mLMPsetscancfg ", "\x03");
    assert_int_equal(refused[strlen("sAN mLMPsetscancfg ")], '1');
    const char *scan = ask(fd, "\x02sEN LMDscandata 1\x03", "sSN LMDscandata", "\x03");
    const char *at = strstr(scan, "DIST1 ");
    assert_non_null(at);
    /* DIST1, scale, offset, first angle, step, then how many */
    for (int i = 0; i < 5; i++)
        at = strchr(at, ' ') + 1;
    char *next;
    assert_int_equal(strtoul(at, &next, 16), n);
    for (uint32_t i = 0; i < n; i++)
        check_range(i, (double)strtoul(next, &next, 16) / MM, range_m[i], 1.0 / MM);
    close(fd);
    head_end(&head, SIGTERM);
}

/* SCIP.md: three characters of six bits a step, millimetres; lines of 64 and a checksum. A UST-10LX turns
 * counter-clockwise. */
static void test_scip(void **state)
{
    struct wire *wire = *state;
    static double range_m[MOST];
    record(wire, "hokuyo-ust-10lx", "0.4", "");
    const uint32_t n = read_ranges(wire, 2, range_m);
    assert_int_equal(n, 1081);
    struct head head = serve(wire, "type: tcp, protocol: scip");
    const int fd = raw_connect(head_endpoint(&head, "tcp"));
    assert_non_null(strstr(ask(fd, "VV\n", "VV\n", "\n\n"), "UST-10LX"));
    ask(fd, "BM\n", "BM\n", "\n\n");
    const char *at = ask(fd, "GD0000108000\n", "GD0000108000\n00P\n", "\n\n");
    at += strlen("GD0000108000\n00P\n") + 6; /* and the line of the time */
    for (uint32_t i = 0, k = 0, value = 0; i < 3 * n; at++) {
        if (k == 64) { /* the checksum and the line's end */
            at += 1;
            k = 0;
            continue;
        }
        value = value << 6 | (uint32_t)(*at - 0x30);
        k++;
        if (++i % 3 != 0) continue;
        check_range(i / 3 - 1, (double)value / MM, range_m[i / 3 - 1], 1.0 / MM);
        value = 0;
    }
    close(fd);
    head_end(&head, SIGTERM);
}

/* Debian's rawlog-grabber reads the recording as it reads a UST-10LX. */
static void test_grabber(void **state)
{
    struct wire *wire = *state;
    enum { SCANS = 12 };
    static double range_m[MOST];
    static struct grabber grabber;
    struct rawlog log;
    char sensor[120];
    grabber_or_skip();
    record(wire, "hokuyo-ust-10lx", "0.6", "");
    const uint32_t n = read_ranges(wire, 2, range_m);
    struct head head = serve(wire, "type: tcp, protocol: scip");
    grabber_hurry(head.pid);
    snprintf(sensor, sizeof sensor, "driver = CHokuyoURG\nIP_DIR = 127.0.0.1\nPORT_DIR = %d\n",
             endpoint_port(head_endpoint(&head, "tcp")));
    grabber_start_and_wait(wire, "REC", sensor, SCANS, &grabber);
    grabber_end(&grabber);
    head_end(&head, SIGTERM);
    rawlog_read(&grabber, &log);
    assert_true(log.n_items >= SCANS && log.item[0].kind == RAWLOG_SCAN && log.item[0].n == n);
    uint32_t n_valid = 0;
    for (uint32_t i = 0; i < n; i++)
        n_valid += log.item[0].valid[i] != 0;
    assert_true(n_valid > n / 2);
    for (uint32_t i = 0; i < n; i++) /* and floats, which are better than 1e-6 m here */
        if (log.item[0].valid[i]) check_range(i, rawlog_range_m(&log.item[0], i), range_m[i], 1.0 / MM + 2e-6);
    rawlog_free(&log);
}

/* VELODYNE.md: 12 blocks of 32 ranges of 2 mm. The recorded head had sent the same packets. */
static void test_velodyne(void **state)
{
    struct wire *wire = *state;
    static double range_m[MOST];
    size_t len, live_len;
    record(wire, "velodyne-vlp16", "0.2", ", {type: file, protocol: velodyne, path: live.bin}");
    const uint32_t n = read_ranges(wire, -1, range_m);
    char link[400];
    snprintf(link, sizeof link, "type: file, protocol: velodyne, path: '%s'", wire_path(wire, "again.bin"));
    const char *const args[] = {
        "run", wire_path(wire, "rec.shs"), "--start", "--pace", "fast", "--quiet", "--link", link, NULL};
    assert_int_equal(replay_call(wire, args), 0);
    uint8_t *live = (uint8_t *)wire_read(wire_path(wire, "live.bin"), &live_len);
    uint8_t *again = (uint8_t *)wire_read(wire_path(wire, "again.bin"), &len);
    assert_true(len == live_len && len > 20 * VLP_PACKET);
    assert_memory_equal(again, live, len);
    for (uint32_t i = 0; i < n && i / 384 < len / VLP_PACKET; i++) {
        const uint8_t *entry = again + VLP_PACKET * (i / 384) + 100 * (i % 384 / 32) + 4 + 3 * (i % 32);
        check_range(i, 0.002 * le_get16(entry), range_m[i], 0.002);
    }
    free(live);
    free(again);
}

static void refuse(struct wire *wire, const char *link, const char *option, const char *value, const char *says)
{
    const char *const args[] = {"run", wire_path(wire, "rec.shs"), "--start", "--link", link, option, value, NULL};
    assert_int_equal(replay_call(wire, args), 2);
    replay_said(wire, says);
}

static void test_refused(void **state)
{
    struct wire *wire = *state;
    record(wire, "sick-tim571", "0.1", "");
    refuse(wire, "type: udp, protocol: velodyne, port: 21599", NULL, NULL, "emitter planar; allowed is beams");
    refuse(wire, "type: tcp, protocol: cola", "--speed", "2", "allowed is --speed 1");
    refuse(wire, "type: tcp, protocol: capture", NULL, NULL, "is a recording, no capture");
    record(wire, "full-sweep", "0.1", "");
    refuse(wire, "type: tcp, protocol: scip", NULL, NULL, "emitter line; allowed is planar");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_cola, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_scip, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_grabber, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_velodyne, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_refused, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
