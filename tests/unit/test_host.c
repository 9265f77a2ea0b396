/* libscanhead over socket pairs, a pty, TCP and files. */
#include <arpa/inet.h>
#include <fcntl.h>
#include <math.h>
#include <nettle/sha2.h>
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>
#include <cmocka.h>

#include "drivers/host/scanhead.h"
#include "drivers/protocol/native_encode.h"

enum { MAX_POINTS = NATIVE_MAX_POINTS };

static uint8_t out[1 << 18];
static uint32_t a[MAX_POINTS], b[MAX_POINTS], c[MAX_POINTS], dt[MAX_POINTS];
static int16_t refl[MAX_POINTS];
static uint16_t label[MAX_POINTS];
static uint8_t echo[MAX_POINTS];

static struct native_descriptor make_descriptor(int geo, uint32_t scan)
{
    struct native_descriptor d = {
        .idn = "Maker,Model,SN1,1.0",
        .profile = "model",
        .layout = geo ? NATIVE_GEO : NATIVE_POLAR,
        .prr_uhz = 300000000000,
        .lines_uhz = 100500000,
        .pan_udeg_s = 18000000,
        .line_start_udeg = -40000000,
        .line_stop_udeg = 220000000,
        .mirror_counts_per_turn = 3600000,
        .pan_counts_per_turn = 7200000,
        .range_scale_m = 1e-4,
        .range_min_m = 1.5,
        .range_max_m = 600,
        .n_surfaces = 2,
        .frames = 9,
        .scan = scan,
    };
    return d;
}

static struct native_anchor make_anchor(void)
{
    struct native_anchor anchor = {.crs = 1,
                                   .epsg = 4978,
                                   .station = 2,
                                   .anchor = {4e6, 8e5, 4.8e6},
                                   .scale_m = 1e-5,
                                   .lat_deg = 49,
                                   .lon_deg = 11,
                                   .height_m = 400,
                                   .station_m = {1, 2, 3},
                                   .rotation = {0, 1, 0, -1, 0, 0, 0, 0, 1}};
    return anchor;
}

static struct line_block make_block(uint32_t n, uint64_t pulse0)
{
    struct line_block block = {.frame = 4,
                               .line = 5,
                               .pulse0 = pulse0,
                               .n_pulses = n,
                               .t0_ns = 1000000,
                               .line_t0_ns = 900000,
                               .n_points = n,
                               .dt_ns = dt,
                               .a = a,
                               .b = b,
                               .c = c,
                               .refl_cdb = refl,
                               .echo = echo,
                               .label = label};
    return block;
}

static void put_all(int fd, const void *data, size_t len)
{
    const char *p = data;
    while (len > 0) {
        ssize_t n = write(fd, p, len);
        assert_true(n > 0);
        p += n;
        len -= (size_t)n;
    }
}

static void put_descriptor(int fd, int geo, uint32_t scan, int flags)
{
    struct native_descriptor d = make_descriptor(geo, scan);
    put_all(fd, out, native_encode_descriptor(out, sizeof out, &d, 1, flags));
}

static void put_anchor(int fd, int flags)
{
    struct native_anchor anchor = make_anchor();
    put_all(fd, out, native_encode_anchor(out, sizeof out, &anchor, 1, flags));
}

static void put_points(int fd, uint32_t n, uint64_t pulse0)
{
    struct line_block block = make_block(n, pulse0);
    put_all(fd, out, native_encode_points(out, sizeof out, &block, 500));
}

static void put_event(int fd, uint32_t code, uint64_t va, uint64_t vb, uint64_t vc, int flags)
{
    struct native_event e = {.code = code, .a = va, .b = vb, .c = vc, .text = "why"};
    put_all(fd, out, native_encode_event(out, sizeof out, &e, 1, flags));
}

static struct scanhead *open_fd(int fd)
{
    char source[32], err[256];
    struct scanhead *sh;
    snprintf(source, sizeof source, "fd:%d", fd);
    assert_int_equal(scanhead_open(source, &sh, err, sizeof err), 0);
    return sh;
}

/* A handle, and the head's end of its socket pair. */
static struct scanhead *open_pair(int *head)
{
    int fd[2];
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, fd), 0);
    *head = fd[0];
    return open_fd(fd[1]);
}

static void expect_frame(struct scanhead *sh, int type, struct scanhead_frame *frame)
{
    assert_int_equal(scanhead_next(sh, frame, 5000), 0);
    assert_int_equal(frame->type, type);
}

static void test_open_refused(void **state)
{
    (void)state;
    static const struct {
        const char *source;
        int code;
    } bad[] = {
        {"fd:999", SCANHEAD_EINPUT},
        {"fd:x", SCANHEAD_EINPUT},
        {"fd:", SCANHEAD_EINPUT},
        {"/nonexistent.shs", SCANHEAD_EINPUT},
        {"/", SCANHEAD_EINPUT},
        {"tty:/dev/null", SCANHEAD_EINPUT},
        {"tty:/nonexistent", SCANHEAD_EINPUT},
        {"tcp:localhost", SCANHEAD_EINPUT},
        {"tcp::4000", SCANHEAD_EINPUT},
        {"tcp:h:", SCANHEAD_EINPUT},
        {"tcp:h:70000", SCANHEAD_EINPUT},
        {"tcp:h:0", SCANHEAD_EINPUT},
        {"tcp:::1:4000", SCANHEAD_EINPUT},
        {"tcp:[::1]4000", SCANHEAD_EINPUT},
        {"tcp:[::1", SCANHEAD_EINPUT},
        {"tcp:h:12x", SCANHEAD_EINPUT},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct scanhead *sh = (struct scanhead *)&bad;
        char err[256] = "";
        assert_int_equal(scanhead_open(bad[i].source, &sh, err, sizeof err), bad[i].code);
        assert_null(sh);
        assert_non_null(strstr(err, bad[i].source));
        assert_int_equal(scanhead_open(bad[i].source, &sh, NULL, 0), bad[i].code);
    }
}

static void test_frames(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_info info;
    struct scanhead_point p;
    assert_int_equal(scanhead_next(sh, &f, 0), SCANHEAD_ETIMEOUT);
    assert_int_equal(scanhead_next(sh, &f, 1), SCANHEAD_ETIMEOUT);
    put_points(head, 1, 7);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(scanhead_points(sh, &f, 0, &p, 1), SCANHEAD_ESTATE);
    assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_ESTATE);
    put_descriptor(head, 1, 3, NATIVE_REPEAT);
    put_anchor(head, NATIVE_REPEAT);
    put_points(head, 3, 8);
    put_event(head, NATIVE_EV_STATE, 1, 2, 3, 0);
    expect_frame(sh, SCANHEAD_DESCRIPTOR, &f);
    assert_int_equal(f.flags, SCANHEAD_REPEAT);
    assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_ESTATE);
    assert_int_equal(scanhead_points(sh, &f, 0, &p, 1), SCANHEAD_EINPUT);
    expect_frame(sh, SCANHEAD_ANCHOR, &f);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(f.scan_frame, 4);
    assert_int_equal(f.scan_line, 5);
    assert_int_equal(f.pulse0, 8);
    assert_int_equal(f.n_points, 3);
    assert_int_equal(f.n_pulses, 3);
    assert_int_equal(f.scan_t0_ns, 1000000);
    assert_int_equal(f.line_t0_ns, 900000);
    assert_int_equal(f.t_ns, 1000500);
    assert_int_equal(f.raw_len, 28 + 40 + 60);
    assert_ptr_equal(f.raw + 28, f.payload);
    assert_int_equal(scanhead_points(sh, &f, 2, &p, 5), 1);
    assert_int_equal(scanhead_points(sh, &f, 3, &p, 5), 0);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(f.event, SCANHEAD_EV_STATE);
    assert_int_equal(f.event_value[2], 3);
    assert_string_equal(f.event_text, "why");
    assert_int_equal(scanhead_get_info(sh, &info), 0);
    assert_string_equal(info.idn, "Maker,Model,SN1,1.0");
    assert_string_equal(info.profile, "model");
    assert_true(info.geo == 1 && info.crs == 1 && info.epsg == 4978 && info.station == 2 && info.scan == 3);
    assert_true(info.prr_hz == 300000 && info.lines_hz == 100.5 && info.pan_deg_s == 18);
    assert_true(info.anchor[2] == 4.8e6 && info.station_m[1] == 2 && info.rotation[3] == -1 && info.scale_m == 1e-5);
    assert_true(info.range_min_m == 1.5 && info.range_max_m == 600 && info.n_surfaces == 2 && info.frames == 9);
    close(head);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
    scanhead_close(sh);
}

/* A scan whose beginning did not reach us must not be placed with the anchor of the one before. */
static void test_new_scan_forgets(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_point p;
    struct scanhead_info info;
    put_descriptor(head, 1, 1, 0);
    put_anchor(head, 0);
    put_points(head, 1, 100);
    put_points(head, 1, 101);
    put_points(head, 1, 0); /* pulse numbers begin anew: another scan */
    for (int i = 0; i < 4; i++) {
        assert_int_equal(scanhead_next(sh, &f, 5000), 0);
        if (i > 1) assert_int_equal(scanhead_points(sh, &f, 0, &p, 1), 1);
    }
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(scanhead_points(sh, &f, 0, &p, 1), SCANHEAD_ESTATE);
    put_descriptor(head, 1, 2, NATIVE_REPEAT);
    put_anchor(head, NATIVE_REPEAT);
    put_points(head, 1, 1);
    for (int i = 0; i < 3; i++)
        assert_int_equal(scanhead_next(sh, &f, 5000), 0);
    assert_int_equal(scanhead_points(sh, &f, 0, &p, 1), 1);
    put_event(head, NATIVE_EV_SCAN_START, 2, 0, 0, 0); /* the same scan: nothing new */
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(scanhead_get_info(sh, &info), 0);
    put_event(head, NATIVE_EV_SCAN_START, 3, 0, 0, 0);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_ESTATE);
    put_anchor(head, 0); /* of whichever scan: the descriptor must come first */
    expect_frame(sh, SCANHEAD_ANCHOR, &f);
    assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_ESTATE);
    put_descriptor(head, 1, 4, 0);
    expect_frame(sh, SCANHEAD_DESCRIPTOR, &f);
    assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_ESTATE);
    put_anchor(head, 0);
    expect_frame(sh, SCANHEAD_ANCHOR, &f);
    assert_int_equal(scanhead_get_info(sh, &info), 0);
    close(head);
    scanhead_close(sh);
}

static void name_of(void *ctx, uint32_t i, const char **object, const char **material)
{
    const char *const(*names)[2] = ctx;
    *object = names[i][0];
    *material = names[i][1];
}

static void put_surfaces(int fd, const char *const (*names)[2], uint32_t first, uint32_t n)
{
    uint32_t done;
    size_t len =
        native_encode_surfaces(out, sizeof out, first, n, 4096, name_of, (void *)(uintptr_t)names, 1, 0, &done);
    assert_int_equal(done, n);
    put_all(fd, out, len);
}

static void test_surfaces(void **state)
{
    (void)state;
    static const char *const names[][2] = {{"wall", "brick"}, {"door", ""}, {"roof", "tile"}};
    static const char *const other[][2] = {{"wall", "brick"}, {"gate", "iron"}, {"roof", "tile"}};
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    const char *object, *material, *wall;
    put_surfaces(head, names, 1, 2);
    put_surfaces(head, names, 0, 1);
    assert_int_equal(scanhead_surface(sh, 1, &object, &material), 0);
    expect_frame(sh, SCANHEAD_SURFACES, &f);
    assert_int_equal(scanhead_surface(sh, 0, &object, &material), 0);
    assert_int_equal(scanhead_surface(sh, 1, &object, &material), 1);
    assert_string_equal(object, "door");
    assert_string_equal(material, "");
    expect_frame(sh, SCANHEAD_SURFACES, &f);
    assert_int_equal(scanhead_surface(sh, 0, &wall, &material), 1);
    assert_string_equal(material, "brick");
    assert_int_equal(scanhead_surface(sh, 3, &object, &material), 0);
    assert_int_equal(scanhead_surface(sh, SCANHEAD_NO_LABEL, &object, &material), 0);
    put_surfaces(head, other, 0, 3);
    expect_frame(sh, SCANHEAD_SURFACES, &f);
    assert_int_equal(scanhead_surface(sh, 0, &object, &material), 1);
    assert_ptr_equal(object, wall); /* names that stay keep their place */
    assert_int_equal(scanhead_surface(sh, 1, &object, &material), 1);
    assert_string_equal(object, "gate");
    close(head);
    scanhead_close(sh);
}

static int decode(int geo, uint32_t n, struct scanhead_point *points)
{
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    put_descriptor(head, geo, 1, 0);
    put_anchor(head, 0);
    put_points(head, n, 0);
    for (int i = 0; i < 3; i++)
        assert_int_equal(scanhead_next(sh, &f, 5000), 0);
    int rc = scanhead_points(sh, &f, 0, points, n);
    close(head);
    scanhead_close(sh);
    return rc;
}

static void test_polar_points(void **state)
{
    (void)state;
    static struct scanhead_point p[MAX_POINTS];
    const uint32_t n = 3000;
    uint32_t x = 5;
    for (uint32_t i = 0; i < n; i++) {
        x = x * 1664525u + 1013904223u;
        a[i] = 15000 + (x >> 8) % 6000000;
        x = x * 1664525u + 1013904223u;
        b[i] = (x >> 4) % 3600000;
        x = x * 1664525u + 1013904223u;
        c[i] = (x >> 4) % 7200000;
        dt[i] = i;
        refl[i] = (int16_t)(i * 3);
        label[i] = (uint16_t)i;
        echo[i] = 0x21;
    }
    echo[7] = 0;
    refl[8] = INT16_MIN;
    assert_int_equal(decode(0, n, p), n);
    for (uint32_t i = 0; i < n; i++) {
        long double m = 2 * acosl(-1.0L) * b[i] / 3600000, pan = 2 * acosl(-1.0L) * c[i] / 7200000, r = a[i] * 1e-4L;
        /* the turn around the middle of -40..220 degrees is -90..270 */
        long double shown = b[i] >= 2700000 ? m - 2 * acosl(-1.0L) : m;
        /* count * (1 / counts_per_turn) rounds twice, 2^-52 of a turn: 1.4e-15 rad for each angle; sine,
         * cosine and the products add 5 roundings of 1.1e-16: 3.4e-15 at most */
        long double tol = 4e-15L * r;
        assert_true(fabsl(p[i].mirror_rad - shown) < 4e-15L && fabsl(p[i].pan_rad - pan) < 4e-15L);
        assert_int_equal(p[i].t_ns, 1000000 + i);
        assert_int_equal(p[i].label, i);
        if (i == 7) {
            assert_true(isnan(p[i].x) && isnan(p[i].y) && isnan(p[i].z) && isnan(p[i].range_m));
            assert_true(p[i].echo == 0 && p[i].echo_count == 0);
            continue;
        }
        assert_true(p[i].echo == 1 && p[i].echo_count == 2);
        assert_true(fabsl(p[i].range_m - r) < tol);
        assert_true(fabsl(p[i].x - r * sinl(pan) * cosl(m)) < tol);
        assert_true(fabsl(p[i].y - r * cosl(pan) * cosl(m)) < tol);
        assert_true(fabsl(p[i].z - r * sinl(m)) < tol);
        if (i == 8)
            assert_true(isnan(p[i].reflectance_db));
        else
            assert_true(p[i].reflectance_db == (int16_t)(i * 3) / 100.0);
    }
}

/* The frame of the head: forward, right, up, backward over the zenith. */
static void test_polar_directions(void **state)
{
    (void)state;
    static const struct {
        uint32_t mirror, pan;
        double x, y, z;
    } want[] = {{0, 0, 0, 1, 0},        {0, 1800000, 1, 0, 0}, {900000, 1234567, 0, 0, 1}, {1800000, 0, 0, -1, 0},
                {2700000, 0, 0, 0, -1}, {3600000, 0, 0, 1, 0}, {0, 3600000, 0, -1, 0}};
    struct scanhead_point p[7];
    for (int i = 0; i < 7; i++) {
        a[i] = 10000;
        b[i] = want[i].mirror;
        c[i] = want[i].pan;
        echo[i] = 0x11;
    }
    assert_int_equal(decode(0, 7, p), 7);
    for (int i = 0; i < 7; i++) { /* cos(pi/2) as a double is 6e-17 */
        assert_true(fabs(p[i].x - want[i].x) < 1e-15);
        assert_true(fabs(p[i].y - want[i].y) < 1e-15);
        assert_true(fabs(p[i].z - want[i].z) < 1e-15);
    }
}

static void test_geo_points(void **state)
{
    (void)state;
    static const int32_t xyz[3][3] = {{300000, -400000, 1200000}, {INT32_MAX, -INT32_MAX, 0}, {1, 2, 3}};
    struct scanhead_point p[3];
    for (int i = 0; i < 3; i++) {
        a[i] = (uint32_t)xyz[i][0];
        b[i] = (uint32_t)xyz[i][1];
        c[i] = (uint32_t)xyz[i][2];
        echo[i] = 0x11;
    }
    echo[2] = 0;
    dt[0] = 0xffffff;
    label[0] = 0xffff;
    assert_int_equal(decode(1, 3, p), 3);
    for (int i = 0; i < 2; i++) {
        assert_true(p[i].x == 4e6 + 1e-5 * xyz[i][0]);
        assert_true(p[i].y == 8e5 + 1e-5 * xyz[i][1]);
        assert_true(p[i].z == 4.8e6 + 1e-5 * xyz[i][2]);
        assert_true(isnan(p[i].mirror_rad) && isnan(p[i].pan_rad));
    }
    assert_true(fabs(p[0].range_m - 13) < 1e-14); /* 3, 4, 12 */
    assert_true(isnan(p[2].x) && isnan(p[2].y) && isnan(p[2].z) && isnan(p[2].range_m));
    assert_int_equal(p[0].t_ns, 1000000 + 0xffffff);
    assert_int_equal(p[0].label, SCANHEAD_NO_LABEL);
}

/* ---- commands: a thread plays the head, by script */

struct script {
    int fd;
    const char *expect; /* line the client must send */
    int frames_before, frames_after, big;
    const char *reply; /* NULL: hang up */
    int ok;
    const char *identity; /* not NULL: the client asks for it first, after an empty line */
};

static int came(int fd, const char *expect)
{
    char line[600];
    size_t n = 0;
    while (n < sizeof line - 1 && read(fd, line + n, 1) == 1 && line[n] != '\n')
        n++;
    line[n] = 0;
    return strcmp(line, expect) == 0;
}

static void *play(void *arg)
{
    struct script *s = arg;
    s->ok = 1;
    if (s->identity != NULL)
        s->ok = came(s->fd, "") && came(s->fd, "*IDN?") && write(s->fd, s->identity, strlen(s->identity)) > 0;
    s->ok = came(s->fd, s->expect) && s->ok;
    static uint8_t frame[NATIVE_MAX_FRAME];
    for (int i = 0; i < s->frames_before + s->frames_after; i++) {
        if (i == s->frames_before) s->ok &= write(s->fd, s->reply, strlen(s->reply)) > 0;
        struct line_block block = make_block(s->big ? MAX_POINTS : 1, (uint64_t)i);
        size_t len = native_encode_points(frame, sizeof frame, &block, 0), at = 0;
        while (at < len) {
            ssize_t w = write(s->fd, frame + at, len - at);
            if (w <= 0) return NULL;
            at += (size_t)w;
        }
    }
    if (s->frames_after == 0 && s->reply != NULL) s->ok &= write(s->fd, s->reply, strlen(s->reply)) > 0;
    if (s->reply == NULL) shutdown(s->fd, SHUT_RDWR);
    return NULL;
}

static int run_command(struct scanhead *sh, struct script *s, char *reply, size_t reply_len)
{
    pthread_t thread;
    assert_int_equal(pthread_create(&thread, NULL, play, s), 0);
    int rc = scanhead_command(sh, s->expect, reply, reply_len, 20000);
    pthread_join(thread, NULL);
    assert_true(s->ok);
    return rc;
}

static void test_command(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    char reply[512];
    memset(echo, 0x11, sizeof echo);
    memset(dt, 0, sizeof dt);
    put_points(head, 1, 1000);
    put_all(head, "LATE\r\n", 6); /* the reply to a command given up: never taken for a new one's */
    struct script s = {
        .fd = head, .expect = "*IDN?", .frames_before = 5, .frames_after = 3, .reply = "Maker,Model,SN1,1.0\r\n"};
    assert_int_equal(run_command(sh, &s, reply, sizeof reply), 0);
    assert_string_equal(reply, "Maker,Model,SN1,1.0");
    struct script e = {
        .fd = head, .expect = "HEAD:PRR 5000000", .frames_before = 1, .reply = "ERR -222,\"Data out of range\"\r\n"};
    assert_int_equal(run_command(sh, &e, reply, sizeof reply), 0);
    assert_string_equal(reply, "ERR -222,\"Data out of range\"");
    static const uint64_t pulses[] = {1000, 0, 1, 2, 3, 4, 5, 6, 7, 0};
    for (size_t i = 0; i < sizeof pulses / sizeof pulses[0]; i++) {
        expect_frame(sh, SCANHEAD_POINTS, &f);
        assert_int_equal(f.pulse0, pulses[i]);
    }
    assert_int_equal(scanhead_next(sh, &f, 0), SCANHEAD_ETIMEOUT);
    struct script h = {.fd = head, .expect = "SCAN:STOP", .frames_before = 1, .reply = NULL};
    assert_int_equal(run_command(sh, &h, reply, sizeof reply), SCANHEAD_ECLOSED);
    expect_frame(sh, SCANHEAD_POINTS, &f); /* what came before the end is not lost */
    assert_int_equal(scanhead_next(sh, &f, 0), SCANHEAD_ECLOSED);
    assert_int_equal(scanhead_command(sh, "*IDN?", reply, sizeof reply, 10), SCANHEAD_ECLOSED);
    close(head);
    scanhead_close(sh);
}

static void test_command_refused(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    char reply[512], back[32];
    assert_int_equal(scanhead_command(sh, "", reply, sizeof reply, 10), SCANHEAD_EINPUT);
    assert_int_equal(scanhead_command(sh, "  ", reply, sizeof reply, 10), SCANHEAD_EINPUT);
    assert_int_equal(scanhead_command(sh, "A\nB", reply, sizeof reply, 10), SCANHEAD_EINPUT);
    assert_int_equal(scanhead_command(sh, "\xc3\xa4", reply, sizeof reply, 10), SCANHEAD_EINPUT);
    assert_int_equal(recv(head, back, sizeof back, MSG_DONTWAIT), -1);
    assert_int_equal(scanhead_command(sh, "TIME?", reply, sizeof reply, 1), SCANHEAD_ETIMEOUT);
    assert_non_null(strstr(scanhead_error(sh), "TIME?"));
    assert_int_equal(recv(head, back, sizeof back, 0), 6);
    struct script s = {.fd = head, .expect = "*IDN?", .reply = "12345678\r\n"};
    assert_int_equal(run_command(sh, &s, reply, 8), SCANHEAD_EINPUT); /* not cut */
    close(head);
    scanhead_close(sh);
}

/* More than 64 MiB before the reply: the oldest go, counted, and what they said is not forgotten. */
static void test_command_queue_bound(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_info info;
    struct scanhead_stats stats;
    char reply[32];
    memset(echo, 0x11, sizeof echo);
    put_descriptor(head, 1, 1, 0);
    put_anchor(head, 0);
    struct script s = {.fd = head, .expect = "TIME?", .frames_before = 1100, .big = 1, .reply = "0\r\n"};
    assert_int_equal(run_command(sh, &s, reply, sizeof reply), 0);
    scanhead_get_stats(sh, &stats);
    assert_int_equal(stats.frames, 1102);
    /* a full frame is 65548 bytes and its entry a few more, so 64 MiB hold 1023 of them */
    assert_int_equal(stats.dropped, 1102 - 1023);
    assert_int_equal(scanhead_get_info(sh, &info), 0);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(f.pulse0, 1100 - 1023);
    close(head);
    scanhead_close(sh);
}

static void test_stats(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct scanhead_stats s;
    put_event(head, NATIVE_EV_READER_LOST, 5, 500, 5, NATIVE_LOCAL);
    put_event(head, NATIVE_EV_READER_LOST, 3, 300, 8, NATIVE_LOCAL);
    put_event(head, NATIVE_EV_OVERRUN, 1000, 20, 1, 0);
    struct native_event e = {.code = NATIVE_EV_OVERRUN, .b = 22};
    size_t len = native_encode_event(out, sizeof out, &e, 1, 0);
    native_seal(out, 4); /* after 0: three are missing */
    put_all(head, out, len);
    out[30] ^= 1;
    put_all(head, out, len);
    close(head);
    for (int i = 0; i < 4; i++)
        expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
    scanhead_get_stats(sh, &s);
    assert_int_equal(s.bytes, 5 * 156);
    assert_int_equal(s.frames, 4);
    assert_int_equal(s.bad_payload, 1);
    assert_int_equal(s.bad_bytes, 156);
    assert_int_equal(s.seq_gaps, 1);
    assert_int_equal(s.seq_lost, 3);
    assert_int_equal(s.reader_lost, 8);
    assert_int_equal(s.pulses_lost, 42);
    scanhead_close(sh);
}

static void test_version_and_types(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    struct native_event e = {.code = 1};
    size_t len = native_encode_event(out, sizeof out, &e, 1, 0);
    out[2] = 2;
    native_seal(out, 0);
    put_all(head, out, len);
    out[2] = 1;
    out[1] = 99; /* a type of later times is handed out as it is */
    native_seal(out, 1);
    put_all(head, out, len);
    assert_int_equal(scanhead_next(sh, &f, 5000), SCANHEAD_EFORMAT);
    assert_non_null(strstr(scanhead_error(sh), "version 2"));
    expect_frame(sh, 99, &f);
    close(head);
    scanhead_close(sh);
}

static void hash_frame(struct sha256_ctx *ctx, const uint8_t *frame, size_t len)
{
    sha256_update(ctx, 1, frame + 1);
    sha256_update(ctx, 4, frame + 4);
    sha256_update(ctx, len - 28, frame + 28);
}

static void test_hash(void **state)
{
    (void)state;
    int head;
    struct scanhead *sh = open_pair(&head);
    struct scanhead_frame f;
    char hex[65], want[65];
    struct sha256_ctx ctx;
    sha256_init(&ctx);
    scanhead_hash_start(sh);
    scanhead_hash_hex(sh, hex);
    /* FIPS 180: the digest of nothing */
    assert_string_equal(hex, "e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855");
    struct native_descriptor d = make_descriptor(1, 1);
    struct native_anchor anchor = make_anchor();
    struct line_end end = {.line = 3};
    struct line_block block = make_block(9, 0);
    size_t len;
    for (int part = 0; part < 4; part++) {
        if (part == 0) len = native_encode_descriptor(out, sizeof out, &d, 5, 0);
        if (part == 1) len = native_encode_anchor(out, sizeof out, &anchor, 5, 0);
        if (part == 2) len = native_encode_points(out, sizeof out, &block, 5);
        if (part == 3) len = native_encode_line_end(out, sizeof out, &end, 5);
        hash_frame(&ctx, out, len);
        put_all(head, out, len);
        put_event(head, 1, 2, 3, 4, 0);            /* outside */
        put_descriptor(head, 1, 1, NATIVE_REPEAT); /* outside */
    }
    close(head);
    int n = 0;
    while (scanhead_next(sh, &f, 5000) == 0)
        n++;
    assert_int_equal(n, 12);
    uint8_t digest[32];
    sha256_digest(&ctx, sizeof digest, digest);
    for (int i = 0; i < 32; i++)
        snprintf(want + 2 * i, 3, "%02x", digest[i]);
    for (int i = 0; i < 2; i++) { /* asking does not end it */
        scanhead_hash_hex(sh, hex);
        assert_string_equal(hex, want);
    }
    scanhead_close(sh);
}

static void test_file(void **state)
{
    (void)state;
    char path[] = "/tmp/test_host_XXXXXX", err[256], reply[32];
    int fd = mkstemp(path);
    struct scanhead *sh;
    struct scanhead_frame f;
    put_descriptor(fd, 1, 1, 0);
    put_anchor(fd, 0);
    put_points(fd, 1, 0);
    /* a frame cut at its end, and a whole one hidden behind its length */
    struct line_block block = make_block(100, 1);
    native_encode_points(out, sizeof out, &block, 0);
    put_all(fd, out, 200);
    put_points(fd, 2, 1);
    close(fd);
    assert_int_equal(scanhead_open(path, &sh, err, sizeof err), 0);
    for (int i = 0; i < 3; i++)
        assert_int_equal(scanhead_next(sh, &f, -1), 0);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(f.n_points, 2);
    assert_int_equal(scanhead_command(sh, "*IDN?", reply, sizeof reply, 10), SCANHEAD_ESTATE);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
    scanhead_close(sh);
    assert_int_equal(truncate(path, 0), 0);
    fd = open(path, O_WRONLY);
    put_all(fd, "PK\x03\x04 something else", 18);
    close(fd);
    assert_int_equal(scanhead_open(path, &sh, err, sizeof err), 0);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_EFORMAT);
    scanhead_close(sh);
    unlink(path);
}

static void test_pty(void **state)
{
    (void)state;
    int master = posix_openpt(O_RDWR | O_NOCTTY);
    char source[64], err[256], reply[32];
    if (master < 0 || grantpt(master) != 0 || unlockpt(master) != 0) skip();
    snprintf(source, sizeof source, "tty:%s", ptsname(master));
    struct scanhead *sh;
    struct scanhead_frame f;
    assert_int_equal(scanhead_open(source, &sh, err, sizeof err), 0);
    /* bytes a terminal in its usual mode would change: ^C ^D CR ^S ^V DEL */
    struct native_event e = {.code = 1, .text = "\x03\x04\r\n\x11\x13\x16\x7f"};
    put_all(master, out, native_encode_event(out, sizeof out, &e, 1, 0));
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_string_equal(f.event_text, e.text);
    struct script s = {.fd = master, .expect = "TIME?", .reply = "12\r\n", .identity = "Maker,Model,SN1,1.0\r\n"};
    assert_int_equal(run_command(sh, &s, reply, sizeof reply), 0);
    assert_string_equal(reply, "12");
    close(master);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
    scanhead_close(sh);
}

static void check_tcp(int family, const char *host)
{
    struct sockaddr_storage address = {.ss_family = (sa_family_t)family};
    struct sockaddr_in6 *v6 = (struct sockaddr_in6 *)&address;
    struct sockaddr_in *v4 = (struct sockaddr_in *)&address;
    if (family == AF_INET)
        v4->sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    else
        v6->sin6_addr = in6addr_loopback;
    socklen_t len = family == AF_INET ? sizeof *v4 : sizeof *v6;
    int fd = socket(family, SOCK_STREAM, 0);
    if (fd < 0 || bind(fd, (struct sockaddr *)&address, len) != 0) skip();
    assert_int_equal(listen(fd, 1), 0);
    getsockname(fd, (struct sockaddr *)&address, &len);
    char source[64], err[256], reply[32];
    snprintf(source, sizeof source, "tcp:%s:%d", host, ntohs(family == AF_INET ? v4->sin_port : v6->sin6_port));
    struct scanhead *sh;
    struct scanhead_frame f;
    assert_int_equal(scanhead_open(source, &sh, err, sizeof err), 0);
    int head = accept(fd, NULL, NULL);
    put_points(head, 2, 3);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    struct script s = {.fd = head, .expect = "TIME?", .frames_before = 2, .reply = "12\r\n"};
    assert_int_equal(run_command(sh, &s, reply, sizeof reply), 0);
    close(head);
    close(fd);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(scanhead_next(sh, &f, -1), SCANHEAD_ECLOSED);
    scanhead_close(sh);
    /* nobody listens there any more */
    assert_int_equal(scanhead_open(source, &sh, err, sizeof err), SCANHEAD_EIO);
    assert_non_null(strstr(err, source));
}

static void test_tcp(void **state)
{
    (void)state;
    check_tcp(AF_INET, "127.0.0.1");
}

static void test_tcp6(void **state)
{
    (void)state;
    check_tcp(AF_INET6, "[::1]");
}

/* 2011-09-14T01:46:25Z is GPS 1e9 s (published by LIGO's tconvert), so its adjusted standard time is 0. */
static void test_gps_time(void **state)
{
    (void)state;
    struct scanhead_frame f;
    double t_s = -1.0;
    int head;
    struct scanhead *sh = open_pair(&head);
    assert_int_equal(scanhead_gps_time(sh, 0, &t_s), SCANHEAD_ESTATE);
    put_event(head, NATIVE_EV_SCAN_START, 1, 5000000000, 1000000000000000000, 0);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(scanhead_gps_time(sh, 0, &t_s), 0);
    assert_true(t_s == 0.0);
    assert_int_equal(scanhead_gps_time(sh, 1234567890, &t_s), 0);
    assert_true(fabs(t_s - 1.23456789) < 1e-15); /* seconds and fraction are rounded apart */
    assert_int_equal(scanhead_gps_time(sh, -2500000000, &t_s), 0);
    assert_true(t_s == -2.5);
    /* The head's clock was set 3.75 s on between: the second of GPS 1e9 + 5 began 1.25 s after the scan. */
    put_event(head, NATIVE_EV_PPS, 1315964790, 6250000000, 1000000005, 0);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(f.event, SCANHEAD_EV_PPS);
    assert_int_equal(scanhead_gps_time(sh, 1250000001, &t_s), 0);
    assert_true(fabs(t_s - 5.000000001) < 1e-15);
    /* A scan of which the start was not seen: its points tell when that was, here 500 ns after power-up. */
    put_points(head, 3, 0);
    expect_frame(sh, SCANHEAD_POINTS, &f);
    assert_int_equal(scanhead_gps_time(sh, 7000000000 - 500, &t_s), 0);
    assert_true(t_s == 5.75);
    /* A head that doesn't know the time. */
    put_event(head, NATIVE_EV_SCAN_START, 2, 9000000000, 0, 0);
    expect_frame(sh, SCANHEAD_EVENT, &f);
    assert_int_equal(scanhead_gps_time(sh, 0, &t_s), SCANHEAD_ESTATE);
    close(head);
    scanhead_close(sh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_open_refused),
        cmocka_unit_test(test_frames),
        cmocka_unit_test(test_new_scan_forgets),
        cmocka_unit_test(test_surfaces),
        cmocka_unit_test(test_polar_points),
        cmocka_unit_test(test_polar_directions),
        cmocka_unit_test(test_geo_points),
        cmocka_unit_test(test_command),
        cmocka_unit_test(test_command_refused),
        cmocka_unit_test(test_command_queue_bound),
        cmocka_unit_test(test_stats),
        cmocka_unit_test(test_version_and_types),
        cmocka_unit_test(test_hash),
        cmocka_unit_test(test_file),
        cmocka_unit_test(test_pty),
        cmocka_unit_test(test_tcp),
        cmocka_unit_test(test_tcp6),
        cmocka_unit_test(test_gps_time),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
