/* SPDX-License-Identifier: MIT */
#include "tests/unit/host_rig.h"

uint8_t out[1 << 18];
uint32_t a[MAX_POINTS], b[MAX_POINTS], c[MAX_POINTS], dt[MAX_POINTS];
int16_t refl[MAX_POINTS];
uint16_t label[MAX_POINTS];
uint8_t echo[MAX_POINTS];

struct native_descriptor make_descriptor(int geo, uint32_t scan)
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

struct native_anchor make_anchor(void)
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

struct line_block make_block(uint32_t n, uint64_t pulse0)
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

void put_all(int fd, const void *data, size_t len)
{
    const char *p = data;
    while (len > 0) {
        ssize_t n = write(fd, p, len);
        assert_true(n > 0);
        p += n;
        len -= (size_t)n;
    }
}

static uint32_t rig_seq;

uint32_t rig_next_seq(void)
{
    return rig_seq++;
}

void rig_begin_sequence(void)
{
    rig_seq = 0;
}

/* Sends the frame in `out`, with the next number. */
static void put_frame(int fd, size_t len)
{
    native_finish_frame(out, (out[3] & NATIVE_LOCAL) != 0 ? 0 : rig_next_seq());
    put_all(fd, out, len);
}

void put_descriptor(int fd, int geo, uint32_t scan, int flags)
{
    struct native_descriptor d = make_descriptor(geo, scan);
    put_frame(fd, native_encode_descriptor(out, sizeof out, &d, 1, flags));
}

void put_anchor(int fd, int flags)
{
    struct native_anchor anchor = make_anchor();
    put_frame(fd, native_encode_anchor(out, sizeof out, &anchor, 1, flags));
}

void put_points(int fd, uint32_t n, uint64_t pulse0)
{
    struct line_block block = make_block(n, pulse0);
    put_frame(fd, native_encode_points(out, sizeof out, &block, 500));
}

void put_event(int fd, uint32_t code, uint64_t va, uint64_t vb, uint64_t vc, int flags)
{
    struct native_event e = {.code = code, .a = va, .b = vb, .c = vc, .text = "why"};
    put_frame(fd, native_encode_event(out, sizeof out, &e, 1, flags));
}

static struct scanhead *open_fd(int fd)
{
    char source[32], err[256];
    struct scanhead *sh;
    snprintf(source, sizeof source, "fd:%d", fd);
    assert_int_equal(scanhead_open(source, &sh, err, sizeof err), 0);
    return sh;
}

int rig_write_recording(void)
{
    char path[] = "/tmp/scanhead-rig-XXXXXX";
    const int fd = mkstemp(path);
    assert_true(fd >= 0);
    assert_int_equal(unlink(path), 0);
    rig_begin_sequence();
    return fd;
}

struct scanhead *rig_read_recording(int fd)
{
    assert_int_equal(lseek(fd, 0, SEEK_SET), 0);
    return open_fd(fd);
}

struct scanhead *open_pair(int *head)
{
    int fd[2];
    rig_seq = 0;
    assert_int_equal(socketpair(AF_UNIX, SOCK_STREAM, 0, fd), 0);
    *head = fd[0];
    return open_fd(fd[1]);
}

static char refusal[256];

static void note_refusal(void *ctx, const struct scanhead_notice *notice)
{
    (void)ctx;
    if (notice->kind == SCANHEAD_NOTICE_REFUSED) snprintf(refusal, sizeof refusal, "%s", notice->why);
}

const char *expect_refused_frame(struct scanhead *sh)
{
    struct scanhead_frame f;
    struct scanhead_stats before, after;
    scanhead_get_stats(sh, &before);
    scanhead_on_notice(sh, note_refusal, NULL);
    const int rc = scanhead_next(sh, &f, 0);
    scanhead_on_notice(sh, NULL, NULL);
    scanhead_get_stats(sh, &after);
    assert_true(rc == SCANHEAD_ETIMEOUT || rc == SCANHEAD_ECLOSED);
    assert_int_equal(after.refused - before.refused, 1);
    return refusal;
}

void expect_frame(struct scanhead *sh, int type, struct scanhead_frame *frame)
{
    assert_int_equal(scanhead_next(sh, frame, WAIT_MS), 0);
    assert_int_equal(frame->type, type);
}
