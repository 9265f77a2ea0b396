/* SPDX-License-Identifier: MIT */
/* The files of a recording: what each frame does to them, files of each scan, remains of earlier recordings, and
 * failures. */
#include "tests/unit/record_files_rig.h"

#include <fcntl.h>
#include <stdlib.h>
#include <unistd.h>

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

/* The SCAN_START of the scan at hand comes after its first points. One with another start begins another scan, and so
 * does one with the same start that is not later than the points: a recording may be there twice. */
static void a_late_start(void **state)
{
    (void)state;
    static const struct {
        uint64_t begin_ns;
        int64_t t_ns;
        int is_late;
    } start[] = {{1000, 1500, 1}, {1001, 1500, 0}, {999, 1500, 0}, {1000, 1000, 0}};
    for (size_t i = 0; i < sizeof start / sizeof *start; i++) {
        const struct scanhead_frame first = {.type = SCANHEAD_POINTS, .seq = 1, .t_ns = 1200, .scan_t0_ns = 200};
        const struct scanhead_frame event = {.type = SCANHEAD_EVENT,
                                             .seq = 2,
                                             .t_ns = start[i].t_ns,
                                             .event = SCANHEAD_EV_SCAN_START,
                                             .event_value = {1, start[i].begin_ns}};
        make(NULL);
        add("a.ply");
        files.split = 1;
        open_all();
        assert_int_equal(record_files_frame(&files, NULL, &first, &err), SH_OK);
        assert_int_equal(record_files_frame(&files, NULL, &event, &err), SH_OK);
        expect(start[i].is_late ? "open:a-1.ply 0<1 0<2 " : "open:a-1.ply 0<1 keep0 open:a-2.ply 0<2 ");
        close_all(1, SH_OK);
        trace[0] = '\0';
    }
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
    expect("s0<1 drain0 failed0 drop0 keep1 close_spool0 ");
    assert_string_equal(err.text, "drain0 failed");
    assert_string_equal(warned, "a.ply: its points could not be coloured; it is not written\n");
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
    assert_string_equal(warned, "keep1 failed\n");
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
        cmocka_unit_test_setup(files_of_each_scan, make), cmocka_unit_test_setup(a_late_start, make),
        cmocka_unit_test_setup(failures, make),           cmocka_unit_test_setup(remains, make),
        cmocka_unit_test_setup(remains_of_scans, make),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
