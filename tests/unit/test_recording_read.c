/* SPDX-License-Identifier: MIT */
/* A recording, frame by frame: the time at which each frame went out, where another head begins, its last time. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/err.h"
#include "drivers/protocol/native_encode.h"
#include "firmware_sim/replay/recording.h"
#include "tests/unit/event_recording.h"
#include "tests/unit/file_rig.h"

/* ---- times of frames */

enum { PERIOD_NS = 1000 };

/* Writes n pulses of a scan, one each microsecond. The head computes 16 at a time. */
static void put_points(FILE *f, uint32_t from, uint32_t n)
{
    static uint32_t dt_ns[16], zero[16];
    static int16_t refl_cdb[16];
    static uint8_t echo[16], frame[1024];
    static uint16_t label[16];
    for (uint32_t i = 0; i < n; i++)
        dt_ns[i] = i * PERIOD_NS;
    const struct line_block block = {.pulse0 = from,
                                     .n_pulses = n,
                                     .n_points = n,
                                     .dt_ns = dt_ns,
                                     .a = zero,
                                     .b = zero,
                                     .c = zero,
                                     .refl_cdb = refl_cdb,
                                     .echo = echo,
                                     .label = label,
                                     .t0_ns = (int64_t)from * PERIOD_NS};
    recording_put(f, frame, native_encode_points(frame, sizeof frame, &block, 0));
}

static int64_t time_of(struct recording *r, enum native_type type)
{
    struct recording_frame frame;
    struct sh_err err;
    while (recording_next(r, &frame, &err) == 1)
        if (frame.bytes[1] == type) return frame.t_ns;
    fail_msg("no frame of type %d", (int)type);
    return 0;
}

/* Only ten of sixteen pulses come. They went out when the sixteenth was due, or before, with the next frame. */
static void points_go_out_with_what_follows(void **state)
{
    (void)state;
    static const struct {
        int64_t event_ns, want_ns;
    } rows[] = {{12000, 12000}, {15000, 15000}, {20000, 15000}};
    static struct recording r;
    struct sh_err err;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        FILE *f = recording_begin(file_path);
        recording_put_head(f, "", 0);
        recording_put_event(f, NATIVE_EV_SCAN_START, 0);
        put_points(f, 0, 10);
        recording_put_event(f, NATIVE_EV_CONTROL, rows[i].event_ns);
        recording_end(f);
        memset(&r, 0, sizeof r);
        if (recording_open(&r, file_path, &err) != SH_OK) fail_msg("%s", err.text);
        assert_int_equal(time_of(&r, NATIVE_POINTS), rows[i].want_ns);
        assert_int_equal(time_of(&r, NATIVE_EVENT), rows[i].event_ns);
        recording_close(&r);
    }
}

/* A line has 20 pulses. Its last packet has the pulses 16 to 19, each in a frame of its own, as of a slow head that
 * moving meshes split at each tick. So all four went out as the line ended. */
static void a_line_ends_within_a_packet_of_many_frames(void **state)
{
    (void)state;
    static const struct line_end end = {.n_fired = 20, .n_cast = 20, .t1_ns = 20 * PERIOD_NS};
    static struct recording r;
    struct sh_err err;
    uint8_t frame[1024];
    FILE *f = recording_begin(file_path);
    recording_put_head(f, "", 0);
    recording_put_event(f, NATIVE_EV_SCAN_START, 0);
    put_points(f, 0, 10);
    put_points(f, 10, 6);
    for (uint32_t k = 16; k < 20; k++)
        put_points(f, k, 1);
    recording_put(f, frame, native_encode_line_end(frame, sizeof frame, &end, 0));
    recording_end(f);
    memset(&r, 0, sizeof r);
    if (recording_open(&r, file_path, &err) != SH_OK) fail_msg("%s", err.text);
    for (int i = 0; i < 6; i++)
        assert_int_equal(time_of(&r, NATIVE_POINTS), i < 2 ? 15 * PERIOD_NS : 19 * PERIOD_NS);
    assert_int_equal(time_of(&r, NATIVE_LINE_END), 19 * PERIOD_NS);
    recording_close(&r);
}

/* The scan was stopped after ten pulses. Its last line went out with the event or the telemetry that follows, else when
 * its last pulse had fired. */
static void the_last_line_of_a_stopped_scan(void **state)
{
    (void)state;
    static const struct line_end end = {.n_fired = 10, .n_cast = 10, .t1_ns = 10000, .status = LINE_PARTIAL};
    static const int64_t want_ns[] = {12000, 12000, 9000};
    static struct recording r;
    struct sh_err err;
    for (int i = 0; i < 3; i++) {
        uint8_t frame[1024];
        const struct native_telemetry telemetry = {.scan = 1};
        FILE *f = recording_begin(file_path);
        recording_put_head(f, "", 0);
        recording_put_event(f, NATIVE_EV_SCAN_START, 0);
        recording_put(f, frame, native_encode_line_end(frame, sizeof frame, &end, 0));
        if (i == 0) recording_put_event(f, NATIVE_EV_CONTROL, 12000);
        if (i == 1) recording_put(f, frame, native_encode_telemetry(frame, sizeof frame, &telemetry, 12000, 0));
        if (i == 2)
            recording_put(f, frame, native_encode_anchor(frame, sizeof frame, &(struct native_anchor){0}, 12000, 0));
        recording_end(f);
        memset(&r, 0, sizeof r);
        if (recording_open(&r, file_path, &err) != SH_OK) fail_msg("%s", err.text);
        assert_int_equal(time_of(&r, NATIVE_LINE_END), want_ns[i]);
        recording_close(&r);
    }
}

/* Facts at the end of a recording are not known when it begins anew: here the rate. */
static void it_begins_anew_as_it_began(void **state)
{
    (void)state;
    static struct recording r;
    struct sh_err err;
    FILE *f = recording_begin(file_path);
    put_points(f, 0, 10);
    recording_put_event(f, NATIVE_EV_CONTROL, 12000);
    recording_put_head(f, "", 0);
    recording_end(f);
    memset(&r, 0, sizeof r);
    if (recording_open(&r, file_path, &err) != SH_OK) fail_msg("%s", err.text);
    for (int times = 0; times < 3; times++) {
        struct recording_frame frame;
        int n = 1;
        assert_int_equal(time_of(&r, NATIVE_POINTS), 9 * PERIOD_NS);
        while (recording_next(&r, &frame, &err) == 1)
            n++;
        assert_int_equal(n, 3);
        if (recording_rewind(&r, &err) != SH_OK) fail_msg("%s", err.text);
    }
    recording_close(&r);
}

/* ---- heads */

static size_t event_frame(uint8_t frame[256], int64_t t_ns, int flags)
{
    const struct native_event event = {.code = NATIVE_EV_CONTROL, .a = 1};
    return native_encode_event(frame, 256, &event, t_ns, flags);
}

static void put_numbered(FILE *f, uint32_t seq, int64_t t_ns)
{
    uint8_t frame[256];
    const size_t len = event_frame(frame, t_ns, 0);
    native_finish_frame(frame, seq);
    assert_int_equal(fwrite(frame, 1, len, f), len);
}

static void put_local(FILE *f, int64_t t_ns)
{
    uint8_t frame[256];
    const size_t len = event_frame(frame, t_ns, NATIVE_LOCAL);
    native_finish_frame(frame, 0);
    assert_int_equal(fwrite(frame, 1, len, f), len);
}

/* Numbers that go back far are those of another head. The frame that shows it says so, and no other one, also when the
 * recording is read again. A frame for one reader has the time of the frame before it. At the very beginning it has the
 * time of the frame after it, once the recording was read. */
static void another_head_begins(void **state)
{
    (void)state;
    static const struct {
        int64_t t_ns;
        int restarted;
    } frames[] = {{7, 0}, {7000, 0}, {8000, 0}, {8000, 0}, {3000, 1}, {4000, 0}};
    static struct recording r;
    struct recording_frame frame;
    struct sh_err err;
    FILE *f = recording_begin(file_path);
    put_local(f, 99);
    put_numbered(f, 2000000000, 7000);
    put_numbered(f, 2000000001, 8000);
    put_local(f, 99);
    put_numbered(f, 10, 3000);
    put_numbered(f, 11, 4000);
    recording_end(f);
    memset(&r, 0, sizeof r);
    r.last_t_ns = 7;
    if (recording_open(&r, file_path, &err) != SH_OK) fail_msg("%s", err.text);
    for (int times = 0; times < 3; times++) {
        for (size_t i = 0; i < 6; i++) {
            assert_int_equal(recording_next(&r, &frame, &err), 1);
            const int64_t t_ns = times > 0 && i == 0 ? 7000 : frames[i].t_ns;
            if (frame.t_ns != t_ns || frame.restarted != frames[i].restarted)
                fail_msg("frame %zu: %lld, %d", i, (long long)frame.t_ns, frame.restarted);
        }
        assert_int_equal(recording_next(&r, &frame, &err), 0);
        assert_int_equal(recording_next(&r, &frame, &err), 0);
        if (recording_rewind(&r, &err) != SH_OK) fail_msg("%s", err.text);
    }
    recording_close(&r);
    assert_null(r.stream);
}

/* ---- the last time */

static void expect_last(int64_t want_ns)
{
    int64_t t_ns = -1;
    assert_int_equal(recording_last_ns(file_path, &t_ns), 1);
    assert_true(t_ns == want_ns);
}

static void the_last_time_is_that_of_the_last_frame(void **state)
{
    (void)state;
    int64_t t_ns;
    assert_int_equal(recording_last_ns("/nowhere/a.shs", &t_ns), 0);
    FILE *f = recording_begin(file_path);
    recording_end(f);
    assert_int_equal(recording_last_ns(file_path, &t_ns), 0);
    f = recording_begin(file_path);
    put_local(f, 99);
    fputs("no frame", f);
    recording_end(f);
    assert_int_equal(recording_last_ns(file_path, &t_ns), 0);
    f = recording_begin(file_path);
    recording_put_event(f, NATIVE_EV_CONTROL, 5);
    recording_put_event(f, NATIVE_EV_CONTROL, 4); /* the last one, not the latest */
    put_local(f, 99);
    recording_end(f);
    expect_last(4);
}

/* A whole frame lies within the length of a frame that is cut, so it shows only at the end of the file. */
static void a_frame_behind_a_cut_one_counts(void **state)
{
    (void)state;
    enum { CUT_BYTES = 60 };
    FILE *f = recording_begin(file_path);
    recording_put_head(f, "", 0);
    assert_int_equal(fseek(f, CUT_BYTES, SEEK_SET), 0);
    recording_put_event(f, NATIVE_EV_CONTROL, 7);
    fflush(f);
    assert_int_equal(ftruncate(fileno(f), ftell(f)), 0);
    recording_end(f);
    expect_last(7);
}

/* Only the last 4 MiB are read. */
static void the_last_time_is_near_the_end(void **state)
{
    (void)state;
    int64_t t_ns;
    FILE *f = recording_begin(file_path);
    recording_put_event(f, NATIVE_EV_CONTROL, 5);
    assert_int_equal(fseek(f, 4 << 20, SEEK_SET), 0);
    fputc(0, f);
    recording_end(f);
    assert_int_equal(recording_last_ns(file_path, &t_ns), 0);
    f = fopen(file_path, "ab");
    assert_non_null(f);
    recording_put_event(f, NATIVE_EV_CONTROL, 6);
    recording_end(f);
    expect_last(6);
}

/* ---- names */

/* A file may have the name of a connection. */
static void a_name_is_a_file(void **state)
{
    (void)state;
    char folder[] = "/tmp/scanhead-names-XXXXXX", before[4096];
    struct scanhead *stream;
    struct sh_err err;
    assert_non_null(getcwd(before, sizeof before));
    assert_non_null(mkdtemp(folder));
    assert_int_equal(chdir(folder), 0);
    event_recording_write("tcp:1.shs", 1);
    const int rc = recording_open_file("tcp:1.shs", &stream, &err);
    unlink("tcp:1.shs");
    assert_int_equal(chdir(before), 0);
    assert_int_equal(rmdir(folder), 0);
    assert_int_equal(rc, SH_OK);
    scanhead_close(stream);
    assert_true(recording_open_file("/nowhere/tcp:1.shs", &stream, &err) < 0);
    assert_non_null(strstr(err.text, "/nowhere/tcp:1.shs"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_go_out_with_what_follows),
        cmocka_unit_test(a_line_ends_within_a_packet_of_many_frames),
        cmocka_unit_test(the_last_line_of_a_stopped_scan),
        cmocka_unit_test(it_begins_anew_as_it_began),
        cmocka_unit_test(another_head_begins),
        cmocka_unit_test(the_last_time_is_that_of_the_last_frame),
        cmocka_unit_test(a_frame_behind_a_cut_one_counts),
        cmocka_unit_test(the_last_time_is_near_the_end),
        cmocka_unit_test(a_name_is_a_file),
    };
    return cmocka_run_group_tests_name("recording, read", tests, make_file, remove_file);
}
