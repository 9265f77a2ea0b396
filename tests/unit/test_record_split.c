/* SPDX-License-Identifier: MIT */
/* The files of a recording: what each frame does to them, files of each scan, frames that wait for the limits of their
 * colours, remains of earlier recordings, and failures. Recorders and spools are the test's; each call is written to
 * `trace`. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "core/newfile.h"
#include "core/studio/mesh.h"
#include "drivers/record/outfile.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/record/files.h"
#include "tests/unit/trace_rig.h"

static struct record_files files;
static struct sh_err err;
static char warned[256];
static const char *left; /* the file that an earlier recording left */
static int n_spools;
static double lows[4], highs[4];

static int is_repaired(struct repair *repair, struct sh_err *e)
{
    (void)repair;
    (void)e;
    return SH_OK;
}

static const struct recorder_ops OPS[] = {{.ending = ".ply", .track = {.wants_colours = 1}, .repair = is_repaired},
                                          {.ending = ".shs", .repair = is_repaired},
                                          {.ending = ".obj"},
                                          {.ending = ".las", .repair = is_repaired},
                                          {.ending = ".ptx", .repair = is_repaired}};

const struct recorder_ops *recorder_find(const char *path, struct sh_err *e)
{
    for (size_t i = 0; i < sizeof OPS / sizeof OPS[0]; i++)
        if (strcmp(strrchr(path, '.'), OPS[i].ending) == 0) return &OPS[i];
    sh_fail(e, SH_EINPUT, "unknown");
    return NULL;
}

const struct recorder_ops *recorder_shape(const struct recorder_ops *ops, const struct recorder_options *options)
{
    (void)options;
    return ops;
}

int recorder_open(const struct recorder_ops *ops, const char *path, const struct recorder_options *options,
                  struct recorder **rec, struct sh_err *e)
{
    for (int i = 0; i < files.n; i++)
        if (files.file[i].now == path) *rec = (struct recorder *)&files.file[i];
    if (options != &files.recorder || options->padding != &files.padding) say("OPTIONS ");
    if (strstr(path, ops->ending) == NULL) say("OPS ");
    const int rc = call(e, "open:%s", path);
    if (rc != SH_OK) *rec = NULL;
    return rc;
}

/* The place of a file in the list. */
static int of(const struct recorder *rec)
{
    return (int)((const struct record_file *)(const void *)rec - files.file);
}

void recorder_set_limits(struct recorder *rec, double low, double high)
{
    say("limits%d:%g-%g ", of(rec), low, high);
}

int recorder_frame(struct recorder *rec, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *e)
{
    (void)sh;
    return call(e, "%d<%u", of(rec), frame->seq);
}

int recorder_save(struct recorder *rec, struct sh_err *e)
{
    return call(e, "save%d", of(rec));
}

int recorder_close(struct recorder *rec, int keep, struct sh_err *e)
{
    return call(e, "%s%d", keep ? "keep" : "drop", of(rec));
}

int colour_spool_open(struct colour_spool *spool, const char *path, enum colour_mode mode, struct sh_err *e)
{
    if (mode != COLOUR_RANGE) say("MODE ");
    spool->bytes = (uint64_t)n_spools++;
    spool->low = lows[spool->bytes];
    spool->high = highs[spool->bytes];
    spool->has_points = spool->low < spool->high;
    return call(e, "spool:%s", path);
}

int colour_spool_frame(struct colour_spool *spool, struct scanhead *sh, const struct scanhead_frame *frame,
                       struct sh_err *e)
{
    (void)sh;
    return call(e, "s%u<%u", (unsigned)spool->bytes, frame->seq);
}

int colour_spool_drain(struct colour_spool *spool,
                       int (*fn)(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *e),
                       void *ctx, const struct sh_report *report, struct sh_err *e)
{
    const struct scanhead_frame frame = {.seq = 90 + (uint32_t)spool->bytes};
    if (report != files.recorder.report) say("REPORT ");
    const int rc = call(e, "drain%u", (unsigned)spool->bytes);
    return rc == SH_OK ? fn(ctx, NULL, &frame, e) : rc;
}

void colour_spool_close(struct colour_spool *spool)
{
    say("close_spool%u ", (unsigned)spool->bytes);
}

int outfile_check_left(const char *part, const char *path, struct sh_err *e)
{
    return call(e, "part:%s:%s", part, path);
}

/* Returns whether the path is a name of one scan: that of all scans with -NUMBER before its ending. */
int app_is_name_of_scan(const char *of_all, size_t ending, const char *path)
{
    const size_t stem = strlen(of_all) - ending;
    const size_t digits =
        strncmp(path, of_all, stem) == 0 && path[stem] == '-' ? strspn(path + stem + 1, "0123456789") : 0;
    return digits != 0 && strcmp(path + stem + 1 + digits, of_all + stem) == 0;
}

int mesh_is_float(const char *path)
{
    (void)path;
    return 0;
}

long long newfile_left_len(const char *part)
{
    say("second:%s ", part);
    return left != NULL && strcmp(part, left) == 0 ? 12 : 0;
}

static void warn(void *ctx, const char *text)
{
    (void)ctx;
    snprintf(warned, sizeof warned, "%s", text);
}

static const struct sh_report REPORT = {.warn = warn};

static int make(void **state)
{
    (void)state;
    memset(&files, 0, sizeof files);
    files.recorder.report = &REPORT;
    files.recorder.colour.scale.mode = COLOUR_RANGE;
    files.takes_over = 1;
    trace[0] = warned[0] = '\0';
    fails = fails_too = left = NULL;
    n_spools = 0;
    return 0;
}

static void add(const char *path)
{
    assert_int_equal(record_files_add(&files, path, &err), SH_OK);
}

static void expect(const char *expected)
{
    assert_string_equal(trace, expected);
    trace[0] = '\0';
}

enum { HEAD_A = 1, HEAD_B = 2 };

static int frame(int head, uint32_t seq, int type, uint32_t event, int flags)
{
    const struct scanhead_frame it = {.type = type, .seq = seq, .event = event, .flags = flags};
    return record_files_frame(&files, (struct scanhead *)(trace + head), &it, &err);
}

static void points(int head, uint32_t seq)
{
    assert_int_equal(frame(head, seq, SCANHEAD_POINTS, 0, 0), SH_OK);
}

static void open_all(void)
{
    assert_int_equal(record_files_open(&files, &err), SH_OK);
}

static void close_all(int keep, int rc)
{
    assert_int_equal(record_files_close(&files, keep, &err), rc);
    for (int i = 0; i < files.n; i++)
        assert_true(files.file[i].now == NULL && files.file[i].rec == NULL);
    assert_true(files.spool == NULL && files.n_spools == 0);
}

static void a_list_of_files(void **state)
{
    static const char *const paths[] = {"1.ply", "2.ply", "3.ply", "4.ply", "5.ply", "6.ply", "7.ply", "8.shs"};
    (void)state;
    for (int i = 0; i < 8; i++) {
        assert_int_equal(record_files_add(&files, i == 7 ? "1.ply" : paths[i], &err), i == 7 ? SH_EINPUT : SH_OK);
        if (i == 7) assert_string_equal(err.text, "record: -o 1.ply: given twice");
    }
    assert_int_equal(record_files_add(&files, "8.xyz", &err), SH_EINPUT);
    assert_string_equal(err.text, "unknown");
    add(paths[7]);
    assert_true(record_files_have(&files, ".shs") && record_files_have(&files, ".ply"));
    assert_false(record_files_have(&files, ".las"));
    assert_int_equal(record_files_add(&files, "9.ply", &err), SH_EINPUT);
    assert_string_equal(err.text, "record: at most 8 files");
}

static void frames_go_to_all(void **state)
{
    (void)state;
    add("a.ply");
    add("b.shs");
    open_all();
    expect("open:a.ply open:b.shs ");
    points(HEAD_A, 5);
    assert_int_equal(record_files_save(&files, &err), SH_OK);
    frame(HEAD_A, 6, SCANHEAD_EVENT, SCANHEAD_EV_SCAN_START, 0); /* without --split it is a frame as others */
    points(HEAD_B, 7);
    expect("0<5 1<5 save0 save1 0<6 1<6 0<7 1<7 ");
    close_all(1, SH_OK);
    expect("keep0 keep1 ");
}

/* A scan begins with its event, with a descriptor that is no repetition, or with another head. It gets new files where
 * points came before. */
static void files_of_each_scan(void **state)
{
    (void)state;
    add("folder.d/a.ply");
    files.split = 1;
    open_all();
    expect("open:folder.d/a-1.ply ");
    frame(HEAD_A, 1, SCANHEAD_EVENT, SCANHEAD_EV_SCAN_START, 0);
    frame(HEAD_A, 2, SCANHEAD_DESCRIPTOR, 0, 0);
    points(HEAD_A, 3);
    assert_int_equal(files.has_points, 1);
    frame(HEAD_A, 4, SCANHEAD_DESCRIPTOR, 0, SCANHEAD_REPEAT);
    frame(HEAD_A, 5, SCANHEAD_EVENT, SCANHEAD_EV_TIME, 0);
    frame(HEAD_A, 6, SCANHEAD_LINE_END, SCANHEAD_EV_SCAN_START, 0);
    expect("0<1 0<2 0<3 0<4 0<5 0<6 ");
    frame(HEAD_A, 7, SCANHEAD_EVENT, SCANHEAD_EV_SCAN_START, 0);
    expect("keep0 open:folder.d/a-2.ply 0<7 ");
    points(HEAD_A, 8);
    frame(HEAD_A, 9, SCANHEAD_DESCRIPTOR, 0, 0);
    expect("0<8 keep0 open:folder.d/a-3.ply 0<9 ");
    points(HEAD_A, 10);
    frame(HEAD_B, 11, SCANHEAD_LINE_END, 0, 0);
    expect("0<10 keep0 open:folder.d/a-4.ply 0<11 ");
    frame(HEAD_A, 12, SCANHEAD_LINE_END, 0, 0); /* no points came yet */
    expect("0<12 ");
    points(HEAD_A, 13);
    fails = "keep0";
    assert_int_equal(frame(HEAD_A, 14, SCANHEAD_DESCRIPTOR, 0, 0), SH_EIO);
    expect("0<13 keep0 ");
}

/* Frames of files with colours wait for the limits: those of all heads' points. */
static void frames_that_wait(void **state)
{
    (void)state;
    add("a.ply");
    add("b.shs");
    files.own_limits = 1;
    memcpy(lows, (const double[]){3, 0, 1}, sizeof(double[3]));
    memcpy(highs, (const double[]){5, 0, 4}, sizeof(double[3])); /* the second head has no points */
    open_all();
    expect("open:a.ply open:b.shs spool:a.ply ");
    points(HEAD_A, 1);
    points(HEAD_B, 2);
    points(HEAD_A, 3);
    expect("s0<1 1<1 spool:a.ply s1<2 1<2 spool:a.ply s2<3 1<3 ");
    close_all(1, SH_OK);
    expect("limits0:1-5 limits1:1-5 drain0 0<90 drain1 0<91 drain2 0<92 keep0 keep1 close_spool0 close_spool1 "
           "close_spool2 ");
    make(NULL);
    add("b.shs"); /* no file has colours */
    files.own_limits = 1;
    open_all();
    points(HEAD_A, 1);
    close_all(1, SH_OK);
    expect("open:b.shs 0<1 keep0 ");
    make(NULL);
    add("a.ply");
    files.own_limits = 1;
    memset(lows, 0, sizeof lows);
    memset(highs, 0, sizeof highs);
    open_all();
    close_all(1, SH_OK); /* without points there are no limits */
    expect("open:a.ply spool:a.ply drain0 0<90 keep0 close_spool0 ");
    make(NULL);
    add("a.ply");
    files.own_limits = 1;
    open_all();
    close_all(0, SH_OK);
    expect("open:a.ply spool:a.ply drop0 close_spool0 ");
}

static void failures(void **state)
{
    (void)state;
    add("a.ply");
    add("b.shs");
    files.own_limits = 1;
    fails = "open:b.shs";
    assert_int_equal(record_files_open(&files, &err), SH_EIO);
    close_all(0, SH_OK);
    expect("open:a.ply open:b.shs drop0 ");
    make(NULL);
    add("a.ply");
    add("b.shs");
    files.own_limits = 1;
    open_all();
    trace[0] = '\0';
    fails = "s0<1";
    assert_int_equal(frame(HEAD_A, 1, SCANHEAD_POINTS, 0, 0), SH_EIO);
    assert_int_equal(files.has_points, 0);
    fails = "drain0"; /* a file without its colours is not kept */
    close_all(1, SH_EIO);
    expect("s0<1 drain0 drop0 keep1 close_spool0 ");
    assert_string_equal(err.text, "drain0 failed");
    assert_string_equal(warned, "a.ply: its points could not be coloured; it is not written");
    make(NULL);
    add("a.ply");
    add("b.shs");
    open_all();
    fails = "save0";
    assert_int_equal(record_files_save(&files, &err), SH_EIO);
    fails = "0<1";
    assert_int_equal(frame(HEAD_A, 1, SCANHEAD_POINTS, 0, 0), SH_EIO);
    fails = "keep0";
    fails_too = "keep1";
    close_all(1, SH_EIO);
    expect("open:a.ply open:b.shs save0 0<1 keep0 keep1 ");
    assert_string_equal(err.text, "keep0 failed"); /* the first one */
    assert_string_equal(warned, "keep1 failed");
}

/* ---- remains of an earlier recording */

static void remains(void **state)
{
    (void)state;
    files.takes_over = 0;
    add("a.ply");
    add("b.obj"); /* it can't be repaired, so it leaves nothing of use */
    add("c.las");
    add("d.ptx");
    open_all();
    expect("part:a.ply.part:a.ply part:c.las.part:c.las second:c.wdp.part part:d.ptx.part:d.ptx second:d.ptx.grid "
           "open:a.ply open:b.obj open:c.las open:d.ptx ");
    close_all(1, SH_OK);
    files.part = 0;
    files.recorder.las_minor = 2; /* it has no waveforms beside it */
    left = "d.ptx.grid";
    trace[0] = '\0';
    assert_int_equal(record_files_open(&files, &err), SH_EINPUT);
    expect("part:a.ply.part:a.ply part:c.las.part:c.las part:d.ptx.part:d.ptx second:d.ptx.grid ");
    assert_string_equal(err.text, "d.ptx.grid: an earlier recording left 12 bytes there, which the repair of its "
                                  "d.ptx.part needs; move it beside that file, or remove it");
    files.part = 0;
    fails = "part:a.ply.part:a.ply";
    assert_int_equal(record_files_open(&files, &err), SH_EIO);
    expect("part:a.ply.part:a.ply ");
}

/* With --split any scan's file may be there; what only looks like it does not count. */
static void remains_of_scans(void **state)
{
    static const char *const names[] = {"a-12.las.part", "a.las.part", "a-.las.part",
                                        "b-1.las.part",  "a-1.las",    "a-3.wdp.part"};
    char folder[] = "/tmp/scanhead-split-XXXXXX", path[64], expected[512];
    (void)state;
    assert_non_null(mkdtemp(folder));
    for (int i = 0; i < 6; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        close(open(path, O_CREAT | O_WRONLY, 0600));
    }
    files.takes_over = 0;
    files.split = 1;
    char file[64], second[64];
    snprintf(file, sizeof file, "%s/a.las", folder);
    snprintf(second, sizeof second, "%s/a-3.wdp.part", folder);
    add(file);
    open_all();
    snprintf(expected, sizeof expected, "part:%s/a-12.las.part:%s/a-12.las second:%s/a-3.wdp.part open:%s/a-1.las ",
             folder, folder, folder, folder);
    expect(expected);
    close_all(1, SH_OK);
    files.part = 0;
    left = second;
    assert_int_equal(record_files_open(&files, &err), SH_EINPUT);
    for (int i = 0; i < 6; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        unlink(path);
    }
    rmdir(folder);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(a_list_of_files, make),    cmocka_unit_test_setup(frames_go_to_all, make),
        cmocka_unit_test_setup(files_of_each_scan, make), cmocka_unit_test_setup(frames_that_wait, make),
        cmocka_unit_test_setup(failures, make),           cmocka_unit_test_setup(remains, make),
        cmocka_unit_test_setup(remains_of_scans, make),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
