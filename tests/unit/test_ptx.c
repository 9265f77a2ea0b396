/* SPDX-License-Identifier: MIT */
/* PTX grids, line by line, and the files of true poses. */
#include "drivers/record/ptx_grid.h"
#include "tests/unit/recorder_rig.h"

static char *text, *at;

static void record_text(const char *name)
{
    free(text);
    text = at = rig_record_bytes(name, (struct recorder_options){0}, NULL);
}

static void expect_line(const char *want)
{
    size_t len = strcspn(at, "\n");
    char line[256];
    snprintf(line, sizeof line, "%.*s", (int)len, at);
    assert_string_equal(line, want);
    at += len + 1;
}

/* The head of a grid: size, and the pose twice; a quarter turn clockwise, with vectors as rows. */
static void expect_head(int columns, int rows, const char *shift)
{
    char line[256];
    static const char *const axis[3] = {"0.000000000000000 -1.000000000000000 0.000000000000000",
                                        "1.000000000000000 0.000000000000000 0.000000000000000",
                                        "0.000000000000000 0.000000000000000 1.000000000000000"};
    snprintf(line, sizeof line, "%d", columns);
    expect_line(line);
    snprintf(line, sizeof line, "%d", rows);
    expect_line(line);
    expect_line(shift);
    for (int i = 0; i < 3; i++)
        expect_line(axis[i]);
    for (int i = 0; i < 3; i++) {
        snprintf(line, sizeof line, "%s 0", axis[i]);
        expect_line(line);
    }
    snprintf(line, sizeof line, "%s 1", shift);
    expect_line(line);
}

static const struct rig_point none = {0, 0, 0, INT16_MIN, 0xffff, 0, 0};

/* Lines have three, two and four shots, and one was lost: a grid of four columns and four rows. */
static void test_grid(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    memcpy(a.anchor, a.station_m, sizeof a.anchor);
    const struct rig_point wall = {1000, -2000, 3000, INT16_MIN, 0, 1, 1}, dark = {1, 0, 0, -1000, 0, 1, 1},
                           bright = {0, 1, 0, 500, 0, 1, 1}, near = {0, 0, 1000, 0, 0, 1, 2},
                           far = {0, 0, 2000, 0, 0, 2, 2};
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(5, 0, 4, (struct rig_point[]){wall, none, dark}, 3);
    rig_points(6, 10, 15, (struct rig_point[]){bright, none}, 2);
    rig_points(8, 30, 33, (struct rig_point[]){none, near, far, none, wall}, 5);
    record_text("a.ptx");
    expect_head(4, 4, "10.000000000 20.000000000 30.000000000");
    static const char *const want[16] = {
        "0 0 0 0.5",
        "2.000000 1.000000 3.000000 0.500000", /* not modelled */
        "0 0 0 0.5",
        "0.000000 0.001000 0.000000 0.100000", /* -10 dB */
        "0 0 0 0.5",
        "0 0 0 0.5",
        "-0.001000 0.000000 0.000000 1.000000", /* 5 dB */
        "0 0 0 0.5",
        "0 0 0 0.5", /* the line that was lost */
        "0 0 0 0.5",
        "0 0 0 0.5",
        "0 0 0 0.5",
        "0 0 0 0.5",
        "0.000000 0.000000 1.000000 1.000000", /* the first of two */
        "0 0 0 0.5",
        "2.000000 1.000000 3.000000 0.500000",
    };
    for (int i = 0; i < 16; i++)
        expect_line(want[i]);
    assert_int_equal(*at, 0);
    assert_non_null(strstr(rig_notes, "1 echoes left out"));
    assert_non_null(strstr(rig_notes, "1 echoes brighter"));
    assert_non_null(strstr(rig_notes, "7 places of the grid without a shot")); /* 16 places, 9 shots */
}

/* A stream that is joined within a shot, after its first echo: the later ones have no place, and begin no grid. */
static void test_begins_with_later_echoes(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    const struct rig_point second = {0, 0, 1000, 0, 0, 2, 3}, third = {0, 0, 2000, 0, 0, 3, 3},
                           next = {0, 0, 3000, 0, 0, 1, 1};
    memcpy(a.anchor, a.station_m, sizeof a.anchor);
    for (int n = 2; n <= 3; n++) { /* 2: the frame has nothing else */
        rig_begin();
        rig_descriptor(1, 1);
        rig_anchor(&a);
        rig_points(5, 0, 4, (struct rig_point[]){second, third, next}, (uint32_t)n);
        if (n == 2) rig_points(5, 0, 6, &next, 1);
        record_text("a.ptx");
        expect_head(1, 1, "10.000000000 20.000000000 30.000000000");
        expect_line("0.000000 0.000000 3.000000 1.000000");
        assert_int_equal(*at, 0);
        assert_non_null(strstr(rig_notes, "2 echoes left out"));
    }
}

static void test_scans(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1), b = rig_anchor_of(NATIVE_CRS_UTM, 32632, 2);
    const struct rig_point wall = {1000, -2000, 3000, INT16_MIN, 0, 1, 1};
    b.anchor[0] += 0.125;
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 4, (struct rig_point[]){wall, none}, 2);
    rig_descriptor(1, 2);
    rig_anchor(&b);
    rig_points(0, 0, 4, &wall, 1);
    record_text("a.ptx");
    expect_head(1, 2, "500000.250000000 5000000.000000000 400.125000000");
    expect_line("2.000000 1.000000 3.000000 0.500000");
    expect_line("0 0 0 0.5");
    expect_head(1, 1, "500000.375000000 5000000.000000000 400.125000000");
    expect_line("2.000000 1.000000 3.000000 0.500000");
    assert_int_equal(*at, 0);
    assert_string_equal(rig_notes, "");
}

/* The head's measurements are unchanged; the pose is that in the scene. */
static void test_polar(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    const struct rig_point up = {5000, 900, 0, INT16_MIN, 0, 1, 1}, right = {5000, 0, 900, INT16_MIN, 0, 1, 1};
    rig_begin();
    rig_descriptor(0, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, (struct rig_point[]){right, up}, 2);
    record_text("a.ptx");
    expect_head(1, 2, "10.000000000 20.000000000 30.000000000");
    expect_line("5.000000 0.000000 0.000000 0.500000");
    expect_line("0.000000 0.000000 5.000000 0.500000");
}

static void test_poses(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 7), b = rig_anchor_of(NATIVE_CRS_UTM, 32632, 3);
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, &none, 1);
    rig_descriptor(1, 2);
    rig_anchor(&b);
    rig_points(0, 0, 0, &none, 1);
    record_text("a.poses.csv");
    expect_line("scan,station,epsg,x_m,y_m,z_m,qw,qx,qy,qz,lat_deg,lon_deg,height_m");
    static const double want[10] = {500000.25, 5e6, 400.125, M_SQRT1_2, 0, 0, -M_SQRT1_2, 45, 9, 400.125};
    for (int i = 0; i < 2; i++) {
        char *end;
        assert_int_equal(strtol(at, &end, 10), i + 1);
        assert_int_equal(strtol(end + 1, &end, 10), i == 0 ? 7 : 3);
        assert_int_equal(strtol(end + 1, &end, 10), 32632);
        for (int k = 0; k < 10; k++)
            assert_true(fabs(strtod(end + 1, &end) - want[k]) < 1e-15);
        assert_int_equal(*end, '\n');
        at = end + 1;
    }
    assert_int_equal(*at, 0);
}

static const struct rig_point wall = {1000, -2000, 3000, INT16_MIN, 0, 1, 1};
static const char WALL[] = "2.000000 1.000000 3.000000 0.500000";

/* A scan of so many frames, each 100 degrees at 10 degrees and 1 line per second, with 20 pulses a second. */
static void put_descriptor(uint32_t frames)
{
    static uint8_t out[1024];
    struct native_descriptor d = {.idn = "Maker,Model,SN1,1.0",
                                  .profile = "model",
                                  .scan = 1,
                                  .layout = NATIVE_GEO,
                                  .prr_uhz = 20000000,
                                  .lines_uhz = 1000000,
                                  .pan_udeg_s = 10000000,
                                  .pan_stop_udeg = 100000000,
                                  .frames = frames};
    rig_put(out, native_encode_descriptor(out, sizeof out, &d, 0, 0));
}

static struct native_anchor local_anchor(void)
{
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    memcpy(a.anchor, a.station_m, sizeof a.anchor);
    return a;
}

static void put_shots(uint32_t frames, const uint32_t *line, const uint32_t *row, int n)
{
    struct native_anchor a = local_anchor();
    rig_begin();
    put_descriptor(frames);
    rig_anchor(&a);
    for (int i = 0; i < n; i++) /* the rig's pulse is a millisecond, the descriptor's 50 */
        rig_points(line[i], 100000 * (uint64_t)i, 100000 * (uint64_t)i + 50 * row[i], &wall, 1);
}

/* No grid is filled up to a line or a pulse that no scan of this descriptor has. Another grid begins, and no point is
 * lost. A scan has 2 x (10 + 1) lines and 20 + 1 pulses in each, by the descriptor. */
static void test_far(void **state)
{
    (void)state;
    static const struct {
        uint32_t frames, line[2], row[2];
        int columns, rows; /* of the one grid; 0: there are two of one place */
    } cases[] = {
        {2, {0, 0xffffffff}, {0, 0}, 0, 0}, {2, {0, 22}, {0, 0}, 0, 0},  {2, {0, 21}, {0, 20}, 22, 21},
        {2, {0, 1}, {0, 21}, 0, 0},         {0, {0, 40}, {0, 0}, 41, 1}, /* a scan without end has no last line ... */
        {0, {0, 0xffffffff}, {0, 0}, 0, 0}, /* ... but grids are filled up by 2^24 places at most */
        {0, {5, 4}, {0, 0}, 0, 0},          {2, {3, 3}, {7, 7}, 0, 0},
    };
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const int columns = cases[i].columns, rows = cases[i].rows, two = columns == 0;
        put_shots(cases[i].frames, cases[i].line, cases[i].row, 2);
        record_text("a.ptx");
        expect_head(two ? 1 : columns, two ? 1 : rows, "10.000000000 20.000000000 30.000000000");
        expect_line(WALL);
        for (int k = 2; k < columns * rows; k++)
            expect_line("0 0 0 0.5");
        if (two) expect_head(1, 1, "10.000000000 20.000000000 30.000000000");
        expect_line(WALL);
        assert_int_equal(*at, 0);
        assert_int_equal(strstr(rig_notes, "1 additional grids begun within a scan") != NULL, two);
    }
}

/* The files of a recording share 2^24 places of padding, and 8 more for each shot. Two shots in a grid of 18 lines need
 * 16 places. */
static void test_shared_padding(void **state)
{
    (void)state;
    static const struct {
        uint64_t places, shots; /* of earlier files */
        uint32_t last_line;
        int two;
    } rows[] = {{0, 0, 40, 0},       {1 << 24, 0, 40, 1}, {1 << 24, 0, 18, 1},       {1 << 24, 0, 17, 0},
                {1 << 24, 3, 42, 1}, {1 << 24, 3, 41, 0}, {(1 << 24) - 5, 0, 23, 1}, {(1 << 24) - 5, 0, 22, 0}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct sh_err err = {0};
        struct recorder_padding padding = {.n_places = rows[i].places, .n_shots = rows[i].shots};
        put_shots(0, (const uint32_t[]){0, rows[i].last_line}, (const uint32_t[]){0, 0}, 2);
        const struct recorder_options options = {.padding = i == 0 ? NULL : &padding};
        assert_int_equal(rig_record(rig_path("a.ptx"), options, RIG_KEEP, &err), SH_OK);
        assert_int_equal(strstr(rig_notes, "1 additional grids begun within a scan") != NULL, rows[i].two);
        unlink(rig_path("a.ptx"));
        if (i == 0) continue; /* its padding is its own */
        assert_int_equal(padding.n_shots, rows[i].shots + 2);
        assert_int_equal(padding.n_places, rows[i].places + (rows[i].two ? 0 : rows[i].last_line - 1));
    }
}

/* FILE.grid is what a repair needs of a grid that is not in FILE.part yet. FILE.grid goes where there is no such grid,
 * or no FILE.part. */
static void test_grid_stays_for_a_repair(void **state)
{
    (void)state;
    for (int i = 0; i < 4; i++) {
        const int is_empty = i & 1, has_part = i >> 1;
        struct sh_err err = {0};
        struct ptx_grid grid;
        struct station_pose pose = {0};
        char path[128], part[140], spool[140];
        snprintf(path, sizeof path, "%s", rig_path("b.ptx"));
        snprintf(part, sizeof part, "%s.part", path);
        snprintf(spool, sizeof spool, "%s.grid", path);
        assert_int_equal(ptx_grid_open(&grid, path, &err), SH_OK);
        if (!is_empty) assert_int_equal(ptx_grid_begin(&grid, 0, &pose, 0, &err), SH_OK);
        if (has_part) fclose(fopen(part, "w"));
        ptx_grid_close(&grid);
        assert_int_equal(access(spool, F_OK) == 0, !is_empty && has_part);
        unlink(part);
        unlink(spool);
    }
}

/* Each shot of a line comes to its own place, also in a line that the recorder writes in several pieces. */
static void test_long_line(void **state)
{
    enum { ROWS = 200 };
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    struct rig_point p[ROWS];
    for (int i = 0; i < ROWS; i++)
        p[i] = (struct rig_point){0, i + 1, 0, INT16_MIN, 0, 1, 1};
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, p, ROWS);
    record_text("a.ptx");
    expect_head(1, ROWS, "500000.250000000 5000000.000000000 400.125000000");
    for (int i = 0; i < ROWS; i++) {
        char line[64];
        snprintf(line, sizeof line, "%s0.%03d000 0.000000 0.000000 0.500000", "-", i + 1);
        expect_line(line);
    }
    assert_int_equal(*at, 0);
}

/* A line of text has room for 511 bytes. Coordinates that need more are refused, and no cell is left out. */
static void test_huge(void **state)
{
    (void)state;
    for (int i = 0; i < 2; i++) {
        struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
        struct sh_err err = {0};
        for (int k = 0; k < 3; k++)
            *(i == 0 ? &a.scale[k] : &a.anchor[k]) = 1e200;
        rig_begin();
        rig_descriptor(1, 1);
        rig_anchor(&a);
        rig_points(0, 0, 0, &wall, 1);
        assert_int_equal(rig_record(rig_path("a.ptx"), (struct recorder_options){0}, RIG_KEEP, &err), SH_EFORMAT);
        assert_non_null(strstr(err.text, i == 0 ? "more digits than this format allows: 2e+203 1e+203 3e+203"
                                                : "more digits than this format allows: 1e+200 1e+200 1e+200"));
        assert_int_equal(access(rig_path("a.ptx"), F_OK), -1);
        unlink(rig_path("a.ptx.part"));
        unlink(rig_path("a.ptx.grid"));
    }
}

static int asked, stop_at;

static int stop(void *ctx)
{
    (void)ctx;
    return ++asked >= stop_at;
}

/* The pass at the end asks for a stop at each column. It gives the file up at the first one, or at the third one. */
static void test_stop(void **state)
{
    (void)state;
    struct sh_err err = {0};
    const char *path = rig_path("a.ptx");
    for (stop_at = 1; stop_at <= 3; stop_at += 2) {
        put_shots(0, (const uint32_t[]){0, 3}, (const uint32_t[]){0, 0}, 2);
        asked = 0;
        rig_stop = stop;
        assert_int_equal(rig_record(path, (struct recorder_options){0}, RIG_KEEP, &err), SH_ESTOPPED);
        rig_stop = NULL;
        assert_non_null(strstr(err.text, "interrupted"));
        assert_int_equal(asked, stop_at);
        assert_int_equal(access(path, F_OK), -1);
    }
}

/* Scans of one shot each, of a recorder whose keeper keeps all that came. Where the text of the first scan's grid can't
 * be completed as the second scan begins, a file of that name would end within the grid. What came stays for a repair,
 * which needs the grid's file, and makes the same bytes as a recording of the first scan alone. */
static void test_a_scan_that_is_not_completed(void **state)
{
    (void)state;
    struct native_anchor a = local_anchor();
    struct sh_err err = {0};
    const char *path = rig_path("a.ptx");
    size_t len, is;
    put_shots(0, (const uint32_t[]){0, 3}, (const uint32_t[]){0, 1}, 2);
    char *whole = rig_record_bytes("b.ptx", (struct recorder_options){0}, &len);
    for (stop_at = 1; stop_at <= 3; stop_at += 2) {
        put_shots(0, (const uint32_t[]){0, 3}, (const uint32_t[]){0, 1}, 2);
        put_descriptor(0);
        rig_anchor(&a);
        rig_points(0, 0, 0, &wall, 1);
        asked = 0;
        rig_stop = stop;
        assert_int_equal(rig_record(path, (struct recorder_options){0}, RIG_KEEP_ALWAYS, &err), SH_ESTOPPED);
        rig_stop = NULL;
        assert_int_equal(asked, stop_at);
        assert_int_equal(access(path, F_OK), -1);
        struct repaired file;
        if (repair_file(path, NULL, &file, &err) != SH_OK) fail_msg("%s", err.text);
        repair_free(&file);
        char *repaired = rig_take("a.ptx", &is);
        assert_int_equal(is, len);
        assert_memory_equal(repaired, whole, len);
        free(repaired);
    }
    free(whole);
}

static void test_disk_full(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, 1);
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    for (uint32_t i = 0; i < 300; i++)
        rig_points(i, 10 * i, 10 * i, &(struct rig_point){1000, -2000, 3000, INT16_MIN, 0, 1, 1}, 1);
    rig_check_disk_full(rig_path("full.ptx"), 4000);
}

static int tear_down(void **state)
{
    free(text);
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_begins_with_later_echoes),
        cmocka_unit_test(test_grid),
        cmocka_unit_test(test_scans),
        cmocka_unit_test(test_polar),
        cmocka_unit_test(test_poses),
        cmocka_unit_test(test_far),
        cmocka_unit_test(test_stop),
        cmocka_unit_test(test_a_scan_that_is_not_completed),
        cmocka_unit_test(test_shared_padding),
        cmocka_unit_test(test_grid_stays_for_a_repair),
        cmocka_unit_test(test_disk_full),
        cmocka_unit_test(test_long_line),
        cmocka_unit_test(test_huge),
    };
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
