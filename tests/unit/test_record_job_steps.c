/* SPDX-License-Identifier: MIT */
/* The steps of a job of `record`: how it waits for its source, which files it keeps, what it says, and what ends it. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <cmocka.h>

#include "firmware_sim/app/options.h"
#include "tests/unit/record_job_rig.h"

static int stream(void)
{
    return record_job_stream(&job, &err);
}

static int off_line(void)
{
    return record_job_off_line(&job, cfg, &err);
}

static void again(void)
{
    end_job(NULL);
    make_job(NULL);
}

#define FRAMES "frame_files save_files "
#define GOOD   "left_out:0,0,0 empty:9,2,0 close"

static void a_stream(void **state)
{
    (void)state;
    run_job(stream, SH_OK);
    assert_string_equal(trace, "open:0 open_files run:0-0 " FRAMES "keep_files " GOOD);
    assert_true(job.result.points == 7);
    assert_string_equal(said, "");
    again();
    job.stats = "j.json";
    job.each = 1;
    run_job(stream, SH_OK);
    assert_string_equal(trace,
                        "open:0 open_files open_parts run:0-0,hash frame_files frame_parts save_files save_parts "
                        "keep_parts keep_files j.json " GOOD);
    static const int hashes[][3] = {{0, 0, 0}, {1, 0, 1}, {1, 1, 0}, {0, 1, 0}}; /* hash, no_hash: is hashed */
    for (int i = 0; i < 4; i++) {
        again();
        job.hash = hashes[i][0];
        job.no_hash = hashes[i][1];
        run_job(stream, SH_OK);
        assert_int_equal(strstr(trace, ",hash") != NULL, hashes[i][2]);
    }
}

/* It waits in parts of a second at most, so that a signal ends the wait soon. */
static void a_late_source(void **state)
{
    static const struct {
        const char *source;
        int open_rc, appears_ms, stop_ms, rc;
        const char *tries;
    } rows[] = {{"tcp:there", SCANHEAD_EIO, 9000, 0, SH_EIO, "open:1000 open:1000 open:500 "},
                {"tcp:there", SCANHEAD_EIO, 1500, 0, SH_OK, "open:1000 open:1000 "},
                {"tcp:there", SCANHEAD_EIO, 9000, 700, SH_EIO, "open:1000 "},
                {"tcp:there", SCANHEAD_ENOMEM, 9000, 0, SH_ENOMEM, "open:1000 "},
                {"tcp:there", SCANHEAD_EINPUT, 9000, 0, SH_EINPUT, "open:1000 "},
                {"tty:there", SCANHEAD_EINPUT, 9000, 0, SH_EINPUT, "open:1000 open:1000 open:500 "}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        again();
        job.source = rows[i].source;
        job.wait_s = 2.5;
        open_rc = rows[i].open_rc;
        appears_ms = rows[i].appears_ms;
        stop_ms = rows[i].stop_ms;
        run_job(stream, rows[i].rc);
        assert_int_equal(strncmp(trace, rows[i].tries, strlen(rows[i].tries)), 0);
        assert_int_equal(trace[strlen(rows[i].tries)] == '\0', rows[i].rc != SH_OK);
        if (rows[i].rc != SH_OK) assert_string_equal(err.text, "it is not there");
    }
}

/* A file is only listened to, and its size is known. */
static void a_file(void **state)
{
    char path[] = "/tmp/scanhead-job-XXXXXX";
    const int fd = mkstemp(path);
    (void)state;
    assert_true(fd >= 0 && write(fd, "12345", 5) == 5);
    close(fd);
    job.source = path;
    job.station = APP_WORD; /* it can't be asked */
    is_recording = 1;
    run_job(stream, SH_OK);
    assert_string_equal(trace, "open:0 open_files run:0-0,listen " FRAMES "keep_files " GOOD);
    assert_true(job.recording.source_bytes == 5 && job.files.recorder.may_wait == 1);
    again();
    job.source = path;
    run_job(stream, SH_OK);
    assert_true(job.recording.source_bytes == 0 && job.files.recorder.may_wait == 0);
    unlink(path);
}

static void all_stations(void **state)
{
    (void)state;
    job.station = APP_WORD;
    run_job(stream, SH_OK);
    assert_string_equal(trace, "open:0 HEAD:STATION? MAX open_files run:1-4 " FRAMES "keep_files " GOOD);
    stations = "ERR -113";
    run_job(stream, SH_EIO);
    assert_string_equal(err.text, "tcp:there: no number of stations: ERR -113");
    assert_string_equal(trace, "open:0 HEAD:STATION? MAX close");
    stations = NULL;
    run_job(stream, SH_EIO);
    assert_string_equal(err.text, "tcp:there: no number of stations: it broke");
}

/* Files are kept where they have points, or where a recording came to its end and nothing is missing. With only_whole
 * they are kept where the recording is complete. */
static void files_that_are_kept(void **state)
{
    static const struct {
        int rc, only_whole, points, has_points, missing, is_complete, is_stopped, keep;
    } rows[] = {{SH_OK, 0, 1, 1, 0, 1, 0, 1},  {SH_OK, 0, 0, 0, 0, 1, 0, 1},  {SH_OK, 0, 0, 0, 1, 1, 0, 0},
                {SH_OK, 0, 1, 1, 1, 1, 0, 1},  {SH_OK, 0, 1, 0, 1, 1, 0, 0},  {SH_EIO, 0, 1, 1, 0, 1, 0, 1},
                {SH_EIO, 0, 0, 0, 0, 1, 0, 0}, {SH_EIO, 0, 1, 0, 0, 1, 0, 0}, {SH_OK, 1, 1, 1, 0, 1, 0, 1},
                {SH_OK, 1, 1, 1, 0, 0, 0, 0},  {SH_EIO, 1, 1, 1, 0, 1, 0, 0}, {SH_ESTOPPED, 0, 1, 1, 0, 1, 1, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        again();
        recording_rc = rows[i].rc;
        job.only_whole = rows[i].only_whole;
        gets.points = (uint64_t)rows[i].points;
        job.files.has_points = rows[i].has_points;
        if (rows[i].missing) strcpy(gets.missing, "the scan");
        is_complete = rows[i].is_complete;
        is_stopped = rows[i].is_stopped;
        run_job(stream, rows[i].is_complete ? rows[i].rc : SH_ELOST);
        assert_int_equal(strstr(trace, "keep_files ") != NULL, rows[i].keep);
        assert_int_equal(strstr(trace, "drop_files ") != NULL, !rows[i].keep);
    }
}

/* Statistics are written after the failures that leave figures. */
static void statistics(void **state)
{
    static const struct {
        int rc, has_stats;
    } rows[] = {{SH_OK, 1}, {SH_ELOST, 1}, {SH_ERESET, 1}, {SH_ECLOSED, 1}, {SH_EIO, 0}, {SH_ETIMEOUT, 0}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        again();
        job.stats = "j.json";
        recording_rc = rows[i].rc;
        run_job(stream, rows[i].rc);
        assert_int_equal(strstr(trace, "j.json ") != NULL, rows[i].has_stats);
    }
}

/* Where the stream may end within a scan, its end is no failure, and nothing is missing. */
static void a_stream_that_may_end(void **state)
{
    (void)state;
    job.may_end = 1;
    recording_rc = SH_ECLOSED;
    is_complete = 0;
    run_job(stream, SH_OK);
    again();
    job.may_end = 1;
    recording_rc = SH_ECLOSED;
    gets.points = 0;
    run_job(stream, SH_ECLOSED);
    again();
    is_complete = 0;
    run_job(stream, SH_ELOST);
    assert_string_equal(err.text, "some is missing");
}

/* A signal that ended the recording lets the files be completed; another one, or a stop, gives up. While frames come a
 * signal gives nothing up: then a format completes the scans before (PTX), and files of earlier scans are completed. */
static void what_gives_up(void **state)
{
    (void)state;
    run_job(stream, SH_OK);
    assert_int_equal(gave_up, 0);
    again();
    stop_ms = -1; /* it is there */
    run_job(stream, SH_OK);
    assert_true(job.interrupted == 1 && gave_up == 0 && gave_up_early == 0);
    job.interrupted = 0;
    assert_int_equal(job.notes.stop(&job), 1);
    stop_ms = 0;
    assert_int_equal(job.notes.stop(&job), 0);
    is_stopped = 1;
    assert_int_equal(job.notes.stop(&job), 1);
    run_job(stream, SH_ESTOPPED); /* with its first frame */
    assert_string_equal(err.text, "the recording was stopped");
    assert_string_equal(trace, "open:0 open_files run:0-0 drop_files left_out:0,0,0 close");
    job.stop = NULL;
    run_job(stream, SH_OK);
}

static void each_step_may_fail(void **state)
{
    static const struct {
        const char *step, *trace;
    } rows[] = {{"open_files", "open:0 open_files drop_parts drop_files close"},
                {"open_parts", "open:0 open_files open_parts drop_parts drop_files close"},
                {"frame_files", "open:0 open_files open_parts run:0-0 frame_files keep_parts keep_files left_out:0,0,0 "
                                "close"},
                {"save_files", "open:0 open_files open_parts run:0-0 frame_files frame_parts save_files keep_parts "
                               "keep_files left_out:0,0,0 close"},
                {"keep_parts", "open:0 open_files open_parts run:0-0 frame_files frame_parts save_files save_parts "
                               "keep_parts keep_files left_out:0,0,0 close"},
                {"keep_files", "open:0 open_files open_parts run:0-0 frame_files frame_parts save_files save_parts "
                               "keep_parts keep_files left_out:0,0,0 close"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char text[64];
        again();
        job.each = 1;
        fails = rows[i].step;
        run_job(stream, SH_EIO);
        assert_string_equal(trace, rows[i].trace);
        snprintf(text, sizeof text, "%s failed", rows[i].step);
        assert_string_equal(err.text, text);
    }
}

static void what_it_says(void **state)
{
    (void)state;
    job.recording.progress = 1;
    gets.crowded = 4;
    gets.unfit = 5;
    gets.lost_samples = 6;
    order = "2 frames came twice";
    run_job(stream, SH_OK);
    assert_string_equal(said, "scanhead: 7 points, 2 shots without echo, 3 scans\n");
    assert_string_equal(warned, "the stream was not in order: 2 frames came twice\n");
    assert_non_null(strstr(trace, "left_out:4,5,6 empty:9,2,0 "));
    gets.faint = 8;
    run_job(stream, SH_OK);
    assert_string_equal(said, "scanhead: 7 points, 2 shots without echo, 8 hits not detected, 3 scans\n");
    job.has_silent = 1;
    run_job(stream, SH_OK);
    assert_string_equal(said,
                        "scanhead: 7 points, 2 shots without echo, 8 hits not detected, or on surfaces that are no "
                        "target, 3 scans\n");
    job.brief = 1;
    run_job(stream, SH_OK);
    assert_string_equal(said, "");
    again();
    job.recording.progress = 1;
    recording_rc = SH_EIO;
    run_job(stream, SH_EIO); /* it has points */
    assert_string_equal(said, "scanhead: 7 points, 2 shots without echo, 3 scans\n");
    gets.points = 0;
    run_job(stream, SH_EIO);
    assert_string_equal(said, "");
    again();
    job.files.recorder.colour.scale.mode = COLOUR_REFLECTANCE;
    run_job(stream, SH_OK);
    assert_string_equal(warned,
                        "--colour reflectance: none of 7 points has a reflectance, so all have the colour for a "
                        "missing one; it needs the head's signal.model: on\n");
    warned[0] = '\0';
    gets.with_reflectance = 1;
    run_job(stream, SH_OK);
    assert_string_equal(warned, "");
}

/* ---- off line */

#define CHECKED "check_emitter load config0:0-0 check_emitter config1:0-0 "

static void heads_off_line(void **state)
{
    (void)state;
    run_job(off_line, SH_OK);
    assert_string_equal(trace,
                        CHECKED "heads:0 open_files run:0-0,ends " FRAMES "keep_files left_out:0,0,0 empty:9,2,0 "
                                "close_heads");
    assert_true(job.heads == NULL && job.files.recorder.n_heads == 0);
    again();
    job.station = APP_WORD;
    job.truth = "t.jsonl";
    job.surfaces = "s.csv";
    job.recording.duration_s = 2.5;
    run_job(off_line, SH_OK);
    assert_string_equal(
        trace, "check_emitter load config0:1-5 check_emitter config1:1-5 truth_heads:2.5 surfaces:s.csv "
               "open_files fits_files run:1-3,ends " FRAMES "keep_files left_out:0,0,0 empty:9,2,0 finish close_heads");
    assert_int_equal(job.files.recorder.n_heads, 15); /* as many turns as the rig says */
    again();
    job.station = APP_WORD;
    job.files.split = job.each = 1;
    job.recording.duration_s = 1;
    run_job(off_line, SH_OK);
    assert_int_equal(job.files.recorder.n_heads, 1);
    assert_non_null(strstr(trace, "open_parts fits_files fits_parts run:"));
    fails = "fits_files"; /* the parts are not asked then */
    run_job(off_line, SH_EIO);
    assert_non_null(strstr(trace, "open_parts fits_files drop_parts "));
}

/* Files are told how many shots a scan has at most. A sweep of the rig has 100 lines of 25 cast pulses. A scan without
 * end that ends with the vehicle's way has any number, whether the command asks for it or the configuration. */
static void shots_of_a_scan(void **state)
{
    static const struct {
        long option;
        uint32_t configured;
        double duration_s, shots;
    } rows[] = {{-1, 3, 0, 7500},
                {2, 3, 0, 5000},
                {1, 0, 0, 2500},
                {2, 3, 9, (double)INFINITY},
                {0, 3, 0, (double)INFINITY},
                {-1, 0, 0, (double)INFINITY}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        again();
        cfg->platform.kind = PLATFORM_TRAJECTORY;
        cfg->platform.at_end = PLATFORM_STOP;
        cfg->head.settings.frames = rows[i].configured;
        job.recording.frames = rows[i].option;
        job.recording.duration_s = rows[i].duration_s;
        asks_fit = 1;
        fits_shots = -1;
        run_job(off_line, SH_OK);
        if (fits_shots != rows[i].shots) fail_msg("row %zu: %.17g shots", i, fits_shots);
    }
}

static void off_line_failures(void **state)
{
    static const struct {
        const char *step, *trace;
    } rows[] = {{"load", "check_emitter load close_heads"},
                {"heads:0", CHECKED "truth_heads:0 finish close_heads"},
                {"surfaces:s.csv", CHECKED "truth_heads:0 surfaces:s.csv finish close_heads"},
                {"finish",
                 CHECKED "truth_heads:0 surfaces:s.csv open_files run:0-0,ends " FRAMES "keep_files left_out:0,0,0 "
                         "empty:9,2,0 finish close_heads"}};
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        again();
        job.truth = "t.jsonl";
        job.surfaces = "s.csv";
        fails = rows[i].step;
        run_job(off_line, SH_EIO);
        assert_string_equal(trace, rows[i].trace);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(a_stream, make_job, end_job),
        cmocka_unit_test_setup_teardown(a_late_source, make_job, end_job),
        cmocka_unit_test_setup_teardown(a_file, make_job, end_job),
        cmocka_unit_test_setup_teardown(all_stations, make_job, end_job),
        cmocka_unit_test_setup_teardown(files_that_are_kept, make_job, end_job),
        cmocka_unit_test_setup_teardown(statistics, make_job, end_job),
        cmocka_unit_test_setup_teardown(a_stream_that_may_end, make_job, end_job),
        cmocka_unit_test_setup_teardown(what_gives_up, make_job, end_job),
        cmocka_unit_test_setup_teardown(each_step_may_fail, make_job, end_job),
        cmocka_unit_test_setup_teardown(what_it_says, make_job, end_job),
        cmocka_unit_test_setup_teardown(heads_off_line, make_job, end_job),
        cmocka_unit_test_setup_teardown(shots_of_a_scan, make_job, end_job),
        cmocka_unit_test_setup_teardown(off_line_failures, make_job, end_job),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
