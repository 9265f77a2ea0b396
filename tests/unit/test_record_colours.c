/* SPDX-License-Identifier: MIT */
/* The files of a recording whose frames wait for the limits of their colours. */
#include "tests/unit/record_files_rig.h"

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

static void open_coloured(void)
{
    make(NULL);
    files.takes_over = 0;
    files.own_limits = 1;
    add("a.ply");
    add("b.ply");
    add("c.shs");
    open_all();
    points(HEAD_A, 1);
    points(HEAD_B, 2);
    trace[0] = '\0';
}

/* A disk that fills while points are coloured leaves the frames, and the other files with all their points. */
static void colours_without_room(void **state)
{
    (void)state;
    static const char kept[] =
        "a.ply.frames.shs keeps all frames of the points; scanhead record a.ply.frames.shs -o FILE makes files of "
        "them\na.ply.frames-2.shs keeps all frames of the points; scanhead record a.ply.frames-2.shs -o FILE makes "
        "files of them\n";
    char with_file[1024];
    snprintf(with_file, sizeof with_file, "%sa.ply: its points could not be coloured; it is not written\n", kept);
    open_coloured();
    fails = "0<90";
    close_all(1, SH_EIO);
    expect("drain0 0<90 1<90 drain1 1<91 frames0:a.ply.frames.shs frames1:a.ply.frames-2.shs failed0 drop0 keep1 "
           "keep2 close_spool0 close_spool1 ");
    assert_string_equal(err.text, "0<90 failed");
    assert_string_equal(warned, with_file);
    open_coloured();
    fails = "keep1"; /* it is written at its end */
    close_all(1, SH_EIO);
    expect("drain0 0<90 1<90 drain1 0<91 1<91 keep0 keep1 keep2 frames0:a.ply.frames.shs frames1:a.ply.frames-2.shs "
           "close_spool0 close_spool1 ");
    assert_string_equal(warned, kept);
    open_coloured();
    fails = "drain0";
    fails_too = "frames1:a.ply.frames-2.shs";
    spool_rc = SH_ESTATE; /* then the points stay that the files have */
    close_all(1, SH_EIO);
    expect("drain0 frames0:a.ply.frames.shs frames1:a.ply.frames-2.shs failed0 keep0 failed1 keep1 keep2 close_spool0 "
           "close_spool1 ");
    open_coloured();
    fails = "0<91";
    fails_too = "frames1:a.ply.frames-2.shs";
    spool_rc = SH_EIO; /* the last frames are missing */
    close_all(1, SH_EIO);
    expect("drain0 0<90 1<90 drain1 0<91 1<91 frames0:a.ply.frames.shs frames1:a.ply.frames-2.shs "
           "left:a.ply.frames-2.shs failed0 drop0 keep1 keep2 close_spool0 close_spool1 ");
}

/* Each file that fails has its reason printed: the first error is returned, and the others are warnings. */
static void each_reason_is_said(void **state)
{
    (void)state;
    open_coloured();
    fails = "0<90";
    fails_too = "drain1";
    close_all(1, SH_EIO);
    assert_string_equal(err.text, "drain1 failed");
    assert_ptr_equal(strstr(warned, "0<90 failed\n"), warned);
    open_coloured();
    fails = "0<90";
    fails_too = "1<91";
    close_all(1, SH_EIO);
    assert_string_equal(err.text, "0<90 failed");
    assert_ptr_equal(strstr(warned, "1<91 failed\n"), warned);
    assert_null(strstr(warned, "0<90"));
}

/* A spool that has no file gives no frames back: the files get those of the other spools, and no frames have a name. */
static void spools_without_a_file(void **state)
{
    (void)state;
    fails = "spool:a.ply";
    add("a.ply");
    files.own_limits = 1;
    assert_int_equal(record_files_open(&files, &err), SH_EIO);
    expect("open:a.ply spool:a.ply close_spool0 drop0 ");
    close_all(1, SH_OK);
    expect("");
    make(NULL); /* the second head's */
    add("a.ply");
    files.own_limits = 1;
    open_all();
    points(HEAD_A, 1);
    fails = "spool:a.ply";
    assert_int_equal(frame(HEAD_B, 2, SCANHEAD_POINTS, 0, 0), SH_EIO);
    expect("open:a.ply spool:a.ply s0<1 spool:a.ply close_spool1 ");
    close_all(1, SH_OK);
    expect("drain0 0<90 keep0 close_spool0 ");
    make(NULL); /* the second scan's */
    add("a.ply");
    files.own_limits = files.split = 1;
    open_all();
    points(HEAD_A, 1);
    fails = "spool:a-2.ply";
    assert_int_equal(frame(HEAD_A, 2, SCANHEAD_EVENT, SCANHEAD_EV_SCAN_START, 0), SH_EIO);
    expect("open:a-1.ply spool:a-1.ply s0<1 drain0 0<90 keep0 close_spool0 open:a-2.ply spool:a-2.ply close_spool1 "
           "drop0 ");
    close_all(1, SH_OK);
    expect("");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup(frames_that_wait, make),
        cmocka_unit_test_setup(colours_without_room, make),
        cmocka_unit_test_setup(each_reason_is_said, make),
        cmocka_unit_test_setup(spools_without_a_file, make),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
