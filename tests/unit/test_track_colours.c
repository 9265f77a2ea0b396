/* SPDX-License-Identifier: MIT */
/* Recordings with colours: as the head sends them, where points wait for them, and as computed from the points. */
#include "tests/unit/recorder_rig.h"

#include <errno.h>
#include <fcntl.h>
#include <stdarg.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "core/colour.h"
#include "firmware_sim/app/studio/record/colour_spool.h"

enum { SHOTS = 10, ATTRIBUTES = NATIVE_HAS_ATTRIBUTES, COLOURS = NATIVE_HAS_COLOURS };

static uint8_t out[1 << 16];
static uint32_t seq;
static int without_tmpfile; /* as on NFS */

int open(const char *path, int flags, ...)
{
    va_list args;
    va_start(args, flags);
    const mode_t mode = flags & (O_CREAT | O_TMPFILE) ? va_arg(args, mode_t) : 0;
    va_end(args);
    if (without_tmpfile && (flags & O_TMPFILE) == O_TMPFILE) return errno = EOPNOTSUPP, -1;
    return (int)syscall(SYS_openat, AT_FDCWD, path, flags, mode);
}

/* Numbers the frames at `out`. Frames whose bit (1 << number) is in `lost` are only counted. */
static void put(size_t len, unsigned lost)
{
    int n = 0;
    for (size_t at = 0, frame_len; at < len; at += frame_len, n++) {
        frame_len = native_finish_frame(out + at, seq++);
        if ((lost >> n & 1) == 0) rig_put(out + at, frame_len);
    }
}

static void put_head(uint32_t scan, uint32_t content, const struct native_anchor *anchor)
{
    const struct native_descriptor d = {.idn = "a,b,c,d",
                                        .profile = "model",
                                        .scan = scan,
                                        .layout = NATIVE_POLAR,
                                        .prr_uhz = 1000000000,
                                        .lines_uhz = 1000000,
                                        .mirror_counts_per_turn = 3600,
                                        .pan_counts_per_turn = 3600,
                                        .range_scale_m = 1e-3,
                                        .content = content};
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    put(native_encode_descriptor(out, sizeof out, &d, 0, 0), 0);
    put(native_encode_anchor(out, sizeof out, anchor != NULL ? anchor : &a, 0, 0), 0);
}

/* Shot k of a line has the range 1 + k metres, 9 degrees of line angle a shot, and the colour pulse0 + k, k, 7. The
 * fourth one is empty, and grey. */
static void put_points(uint32_t line, uint64_t pulse0, uint32_t content, unsigned lost)
{
    uint32_t a[SHOTS], b[SHOTS], zero[SHOTS] = {0}, dt[SHOTS];
    int16_t refl[SHOTS], amplitude[SHOTS] = {0};
    uint16_t label[SHOTS], width[SHOTS] = {0};
    uint8_t echo[SHOTS], rgb[SHOTS][3];
    for (uint32_t i = 0; i < SHOTS; i++) {
        a[i] = i == 3 ? 0 : 1000 + 1000 * i;
        b[i] = 90 * i;
        echo[i] = i == 3 ? 0 : 0x11;
        label[i] = i == 3 ? 0xffff : (uint16_t)i;
        refl[i] = (int16_t)(i == 3 ? INT16_MIN : -300 * (int)i);
        dt[i] = i * 1000000;
        rgb[i][0] = i == 3 ? 128 : (uint8_t)(pulse0 + i);
        rgb[i][1] = i == 3 ? 128 : (uint8_t)i;
        rgb[i][2] = i == 3 ? 128 : 7;
    }
    const struct line_block block = {.line = line,
                                     .pulse0 = pulse0,
                                     .n_pulses = SHOTS,
                                     .t0_ns = (int64_t)pulse0 * 1000000,
                                     .line_t0_ns = (int64_t)pulse0 * 1000000,
                                     .n_points = SHOTS,
                                     .dt_ns = dt,
                                     .a = a,
                                     .b = b,
                                     .c = zero,
                                     .refl_cdb = refl,
                                     .echo = echo,
                                     .label = label,
                                     .amplitude_cdb = content & ATTRIBUTES ? amplitude : NULL,
                                     .width_cns = content & ATTRIBUTES ? width : NULL,
                                     .rgb = content & COLOURS ? rgb : NULL};
    put(native_encode_points(out, sizeof out, &block, 0), lost);
}

/* Reads the colour at the end of a line of text. Returns the text after it. */
static char *expect(char *at, const uint8_t want[3])
{
    int rgb[3];
    char *end = strchr(at, '\n'), *from = end;
    assert_non_null(end);
    for (int i = 0; i < 3; i++)
        while (*--from != ' ')
            ;
    assert_int_equal(sscanf(from, "%d %d %d", &rgb[0], &rgb[1], &rgb[2]), 3);
    for (int i = 0; i < 3; i++)
        if (rgb[i] != want[i]) fail_msg("%.*s, not %d %d %d", (int)(end - at), at, want[0], want[1], want[2]);
    return end + 1;
}

static char *body_of(char *ply)
{
    char *at = strstr(ply, "end_header\n");
    assert_non_null(at);
    return at + 11;
}

/* Attributes come between points and colours, or not. If colours, attributes or points are lost, each point has its own
 * colour or grey. */
static void test_as_sent(void **state)
{
    (void)state;
    for (unsigned content = COLOURS; content <= (COLOURS | ATTRIBUTES); content++) {
        const unsigned colours = content & ATTRIBUTES ? 4 : 2; /* the bit of their frame */
        rig_begin();
        seq = UINT32_MAX - 2;
        put_head(1, content, NULL);
        put_points(0, 0, content, 0);
        put_points(1, 20, content, colours);
        put_points(2, 40, content, content & ATTRIBUTES ? 2 : 0);
        put_points(3, 60, content, 1);
        put_points(4, 80, content, 0);
        put_points(5, 100, content, colours);
        char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1, .empty_shots = 1}, NULL), *at;
        assert_non_null(strstr(text, "comment red green blue as the head sent them"));
        assert_non_null(strstr(text, "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n"));
        assert_non_null(strstr(rig_notes, "18 points that are grey, since their colours were lost"));
        at = body_of(text);
        static const int lines[] = {0, 20, 40, 80, 100};
        for (int l = 0; l < 5; l++)
            for (int i = 0; i < SHOTS; i++) {
                const uint8_t own[3] = {(uint8_t)(lines[l] + i), (uint8_t)i, 7};
                at = expect(at, i == 3 || l == 1 || l == 4 ? colour_grey : own);
            }
        assert_int_equal(*at, 0);
        free(text);
    }
}

/* The requested colours replace the sent ones; `none` leaves them out. */
static void test_another_choice(void **state)
{
    (void)state;
    rig_begin();
    put_head(1, COLOURS, NULL);
    put_points(0, 0, COLOURS, 0);
    char *text = rig_record_bytes("a.ply", (struct recorder_options){.ascii = 1, .colour = {.given = 1}}, NULL);
    assert_null(strstr(text, "red"));
    free(text);
    const struct recorder_options solid = {.ascii = 1,
                                           .colour = {.given = 1, .scale = {COLOUR_SOLID, {9, 8, 7}, 0, 0}}};
    text = rig_record_bytes("a.ply", solid, NULL);
    char *at = body_of(text);
    for (int i = 0; i < SHOTS - 1; i++)
        at = expect(at, (const uint8_t[]){9, 8, 7});
    free(text);
}

/* LAS 1.2 format 3, LAS 1.4 format 7 (16 bits: each value times 257), PTX with its empty places. */
static void test_formats(void **state)
{
    (void)state;
    rig_begin();
    put_head(1, COLOURS, NULL);
    put_points(0, 30, COLOURS, 0);
    for (int minor = 2; minor <= 4; minor += 2) {
        uint8_t *las = rig_record_bytes("a.las", (struct recorder_options){.las_minor = minor}, NULL);
        const uint8_t *p = las + rig_uint(las + 96, 4);
        assert_int_equal(las[104], minor == 2 ? 3 : 7);
        for (int i = 0; i < SHOTS; i++) {
            if (i == 3) continue;
            const uint8_t *rgb = p + (minor == 2 ? 28 : 30);
            assert_int_equal(rig_uint(rgb, 2), 257 * (30 + i));
            assert_int_equal(rig_uint(rgb + 2, 2), 257 * i);
            assert_int_equal(rig_uint(rgb + 4, 2), 257 * 7);
            p += rig_uint(las + 105, 2);
        }
        free(las);
    }
    char *ptx = rig_record_bytes("a.ptx", (struct recorder_options){0}, NULL), *at = ptx;
    for (int i = 0; i < 10; i++)
        at = strchr(at, '\n') + 1;
    for (int i = 0; i < SHOTS; i++)
        at = expect(at, i == 3 ? (const uint8_t[]){0, 0, 0} : (const uint8_t[]){(uint8_t)(30 + i), (uint8_t)i, 7});
    assert_non_null(strstr(ptx, "\n0 0 0 0.5 0 0 0\n"));
    free(ptx);
}

/* The ramp is blue, green, yellow, red from 1.5 to 9 m. At 1 m it is blue, at 4 m, a third of the way, green, at 10 m
 * red. Beyond the limits it is as at them. */
static void test_range(void **state)
{
    (void)state;
    rig_begin();
    put_head(1, 0, NULL);
    put_points(0, 0, 0, 0);
    struct recorder_options options = {.ascii = 1, .colour = {.given = 1, .scale = {COLOUR_RANGE, {0}, 1.5, 9.0}}};
    char *text = rig_record_bytes("a.ply", options, NULL), *at = body_of(text);
    assert_non_null(strstr(text, "comment red green blue show the range, blue is 1.5, red 9 m\n"));
    for (int i = 0; i < SHOTS; i++) {
        const double part = fmin(1.0, fmax(0.0, (1.0 + i - 1.5) / 7.5)), blue = 1.0 - 3.0 * part,
                     red = 3.0 * part - 1.0;
        const double green = part < 1.0 / 3.0 ? 3.0 * part : 3.0 - 3.0 * part;
        const double want[3] = {red, green, blue};
        uint8_t rgb[3];
        for (int c = 0; c < 3; c++)
            rgb[c] = (uint8_t)lrint(255.0 * fmin(1.0, fmax(0.0, want[c])));
        if (i != 3) at = expect(at, rgb);
    }
    free(text);
}

/* The station and the lower limit are at z = 5 m. So a point's height above the station gives its place on the ramp. */
static void test_height(void **state)
{
    (void)state;
    rig_begin();
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    a.station_m[2] = 5.0;
    put_head(1, 0, &a);
    put_points(0, 0, 0, 0);
    struct recorder_options options = {.ascii = 1, .colour = {.given = 1, .scale = {COLOUR_HEIGHT, {0}, 5.0, 15.0}}};
    char *text = rig_record_bytes("a.ply", options, NULL), *at = body_of(text);
    for (int i = 0; i < SHOTS; i++) {
        uint8_t rgb[3];
        colour_ramp((1.0 + i) * sin(9.0 * i * M_PI / 180.0) / 10.0, rgb);
        if (i != 3) at = expect(at, rgb);
    }
    free(text);
}

/* A stop of a trajectory has its scalar. Without a trajectory there is none, and that is an error. */
static void test_frame(void **state)
{
    (void)state;
    struct sh_err err = {0};
    const struct recorder_options options = {.ascii = 1,
                                             .colour = {.given = 1, .scale = {COLOUR_FRAME, {0}, 100.0, 103.0}}};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    a.moving = NATIVE_STOP;
    a.frame = 101.0;
    rig_begin();
    put_head(1, 0, &a);
    put_points(0, 0, 0, 0);
    char *text = rig_record_bytes("a.ply", options, NULL), *at = body_of(text);
    for (int i = 0; i < SHOTS - 1; i++)
        at = expect(at, (const uint8_t[]){0, 255, 0});
    free(text);
    rig_begin();
    put_head(1, 0, NULL);
    put_points(0, 0, 0, 0);
    const char *path = rig_path("a.ply");
    assert_int_equal(rig_record(path, options, 1, &err), SH_EFORMAT);
    assert_non_null(strstr(err.text, "points have no frame scalar"));
    unlink(path);
    free(rig_record_bytes("a.poses.csv", options, NULL)); /* a file without colours needs none */
}

/* If a head moves, each point has its own frame scalar and place, also where more than a batch of points waits for
 * colours. The scalar rises by 1 a millisecond, and the head by 1 m; points are 0.05 ms apart, at 1 m along y. */
static void test_frames_of_points(void **state)
{
    (void)state;
    enum { N = 300 };
    static uint32_t range[N], zero[N], dt[N];
    static int16_t refl[N], amplitude[N];
    static uint16_t label[N], width[N];
    static uint8_t echo[N], rgb[N][3];
    const struct native_pose pose[2] = {
        {.quat = {1, 0, 0, 0}, .frame = 100},
        {.t_ns = 1000000000, .position_m = {0, 0, 1000}, .quat = {1, 0, 0, 0}, .frame = 1100}};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    a.moving = NATIVE_MOVING;
    for (uint32_t i = 0; i < N; i++) {
        range[i] = 1000;
        echo[i] = 0x11;
        dt[i] = 50000 * i;
    }
    for (unsigned content = 0; content <= (COLOURS | ATTRIBUTES); content++) {
        const struct line_block block = {.n_pulses = N,
                                         .n_points = N,
                                         .dt_ns = dt,
                                         .a = range,
                                         .b = zero,
                                         .c = zero,
                                         .refl_cdb = refl,
                                         .echo = echo,
                                         .label = label,
                                         .amplitude_cdb = content & ATTRIBUTES ? amplitude : NULL,
                                         .width_cns = content & ATTRIBUTES ? width : NULL,
                                         .rgb = content & COLOURS ? rgb : NULL};
        rig_begin();
        put_head(1, content, &a);
        put(native_encode_poses(out, sizeof out, pose, 2, 0, 0), 0);
        put(native_encode_points(out, sizeof out, &block, 0), 0);
        const struct recorder_options options = {.ascii = 1, .columns = PLY_XYZ | PLY_FRAME};
        char *text = rig_record_bytes("a.ply", options, NULL), *at = body_of(text);
        for (int k = 0; k < N; k++) {
            double x, y, z, frame;
            assert_int_equal(sscanf(at, "%lf %lf %lf %lf", &x, &y, &z, &frame), 4);
            assert_true(fabs(frame - (100 + 0.05 * k)) < 1e-9);
            assert_true(fabs(x) < 1e-6 && fabs(y - 1) < 1e-6 && fabs(z - 0.05 * k) < 1e-6);
            at = strchr(at, '\n') + 1;
        }
        free(text);
    }
}

/* A file holds points with colours or without, not both, unless the recorder computes the colours. */
static void test_kinds(void **state)
{
    (void)state;
    for (int made = 0; made < 2; made++) {
        struct sh_err err = {0};
        const char *path = rig_path("a.ply");
        const struct recorder_options options = {.colour = {.given = made, .scale.mode = COLOUR_LABEL}};
        rig_begin();
        put_head(1, COLOURS, NULL);
        put_points(0, 0, COLOURS, 0);
        put_head(2, 0, NULL);
        put_points(0, 0, 0, 0);
        assert_int_equal(rig_record(path, options, 1, &err), made ? 0 : SH_EFORMAT);
        if (!made) assert_non_null(strstr(err.text, "the stream continued without colours; a file holds one kind"));
        unlink(path);
    }
}

/* The library: colours belong to the last points and to no others. */
static void test_library(void **state)
{
    (void)state;
    for (unsigned content = COLOURS; content <= (COLOURS | ATTRIBUTES); content++) {
        struct scanhead *sh;
        struct scanhead_frame frame;
        struct scanhead_colour c[SHOTS];
        int given = 0, refused = 0;
        rig_begin();
        put_head(1, content, NULL);
        put_points(0, 0, content, 0);
        put_points(1, 20, content, 1); /* no points */
        put_points(2, 40, content, 0);
        fclose(rig_stream);
        rig_stream = NULL;
        assert_int_equal(scanhead_open(rig_shs, &sh, NULL, 0), 0);
        assert_int_equal(scanhead_has_colours(sh), SCANHEAD_ESTATE);
        while (scanhead_next(sh, &frame, 0) == 0) {
            if (frame.type != SCANHEAD_COLOURS) {
                assert_int_equal(scanhead_colours(sh, &frame, 0, c, SHOTS), SCANHEAD_EINPUT);
                continue;
            }
            assert_int_equal(scanhead_has_colours(sh), 1);
            assert_int_equal(frame.n_points, SHOTS);
            assert_int_equal(frame.pulse0, 20 * frame.scan_line);
            const int n = scanhead_colours(sh, &frame, 2, c, 5);
            refused += n == SCANHEAD_ESTATE;
            if (frame.scan_line == 1) continue;
            assert_int_equal(n, 5);
            assert_true(c[0].red == frame.pulse0 + 2 && c[0].green == 2 && c[0].blue == 7 && c[1].red == 128);
            assert_int_equal(scanhead_colours(sh, &frame, SHOTS, c, 5), 0);
            given++;
        }
        scanhead_close(sh);
        assert_int_equal(given, 2);
        assert_int_equal(refused, 1);
    }
}

/* Stores the stream's frames, and keeps them as a file with this name. most: bytes that a file may have. */
static int keep_frames(const char *path, rlim_t most, struct sh_err *err)
{
    struct colour_spool spool;
    struct scanhead_frame frame;
    struct scanhead *sh;
    struct rlimit old;
    void (*was)(int) = signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(scanhead_open(rig_shs, &sh, NULL, 0), 0);
    assert_int_equal(colour_spool_open(&spool, rig_path("a.ply"), COLOUR_RANGE, err), SH_OK);
    while (scanhead_next(sh, &frame, 0) == 0)
        assert_int_equal(colour_spool_frame(&spool, sh, &frame, err), SH_OK);
    getrlimit(RLIMIT_FSIZE, &old);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &(struct rlimit){most, old.rlim_max}), 0);
    const int rc = colour_spool_keep(&spool, path, err);
    setrlimit(RLIMIT_FSIZE, &old);
    signal(SIGXFSZ, was);
    colour_spool_close(&spool);
    scanhead_close(sh);
    return rc;
}

/* Frames that waited for the limits of colours can be kept as a .shs, in no other file's place. Where the disk is full,
 * their beginning is kept as the part of one. */
static void test_frames_kept(void **state)
{
    (void)state;
    struct sh_err err = {0};
    char path[160];
    size_t len, kept;
    snprintf(path, sizeof path, "%s", rig_path("a.ply.frames.shs"));
    const int probe = open(rig_path(""), O_TMPFILE | O_RDWR | O_CLOEXEC, 0600);
    if (probe < 0) skip(); /* a file system that can't name such a file */
    close(probe);
    rig_begin();
    put_head(1, 0, NULL);
    put_points(0, 0, 0, 0);
    fclose(rig_stream);
    rig_stream = NULL;
    uint8_t *stream = rig_read(rig_shs, &len);
    if (keep_frames(path, RLIM_INFINITY, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(keep_frames(path, RLIM_INFINITY, &err), SH_ESTATE);
    assert_non_null(strstr(err.text, "a.ply.frames.shs: cannot keep the frames: File exists"));
    uint8_t *frames = rig_take("a.ply.frames.shs", &kept);
    assert_int_equal(kept, len);
    assert_memory_equal(frames, stream, len);
    free(frames);
    assert_int_equal(keep_frames(path, 100, &err), SH_EIO);
    frames = rig_take("a.ply.frames.shs.part", &kept);
    assert_int_equal(kept, 100);
    assert_memory_equal(frames, stream, kept);
    free(frames);
    free(stream);
    without_tmpfile = 1; /* the file had a name at first, and linkat's ENOENT would blame the folder */
    snprintf(path, sizeof path, "%s", rig_path("b.ply.frames.shs"));
    assert_int_equal(keep_frames(path, RLIM_INFINITY, &err), SH_ESTATE);
    without_tmpfile = 0;
    assert_non_null(strstr(err.text, "b.ply.frames.shs: cannot keep the frames: a file without a name can't get one"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_as_sent),          cmocka_unit_test(test_another_choice),
        cmocka_unit_test(test_formats),          cmocka_unit_test(test_range),
        cmocka_unit_test(test_height),           cmocka_unit_test(test_frame),
        cmocka_unit_test(test_frames_of_points), cmocka_unit_test(test_kinds),
        cmocka_unit_test(test_library),          cmocka_unit_test(test_frames_kept),
    };
    return cmocka_run_group_tests_name("track_colours", tests, rig_set_up, rig_tear_down);
}
