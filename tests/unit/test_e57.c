/* SPDX-License-Identifier: MIT */
/* E57 files, by a reader of the test's own. */
#include "tests/unit/e57_rig.h"

static int coloured; /* by label */

static void record_e57(int empty_shots)
{
    const struct colour_choice colour = {.given = coloured, .scale.mode = COLOUR_LABEL};
    e57rig_record_one((struct recorder_options){.empty_shots = empty_shots, .colour = colour});
}

static const struct rig_point points[] = {
    {3000, -4000, 12000, -1234, 7, 1, 2},
    {3001, -4001, 12001, INT16_MIN, 8, 2, 2},
    {0, 0, 0, INT16_MIN, 0xffff, 0, 0},
    {0, 0, -5000, 32767, 40009, 1, 1},
    {5, 0, 0, 0, 1, 1, 1},
};

/* On the central meridian the grid's axes are the scene's. The head is turned by a quarter: its x is -b, and its y is
 * a. */
static void check_points(size_t first, int empty_shots, uint32_t column, uint32_t row)
{
    for (int i = 0, pulse = -1; i < 5; i++) {
        const struct rig_point *want = &points[i];
        if (want->echo <= 1) pulse++;
        if (want->count == 0 && !empty_shots) continue;
        const struct e57rig_record *r = &e57rig_record[first++];
        assert_int_equal(r->invalid, want->count == 0 ? 2 : 0);
        assert_true(fabs(r->x - -1e-3 * want->b) < 1e-9 || want->count == 0);
        assert_true(fabs(r->y - 1e-3 * want->a) < 1e-9 || want->count == 0);
        assert_true(fabs(r->z - 1e-3 * want->c) < 1e-9 || want->count == 0);
        assert_int_equal(r->no_intensity, want->refl_cdb == INT16_MIN);
        if (!r->no_intensity) assert_true(fabs(r->intensity - want->refl_cdb / 100.0) < 1e-9);
        assert_int_equal(r->echo, want->echo > 0 ? want->echo - 1 : 0); /* counted from 0 */
        assert_int_equal(r->echoes, want->count);
        assert_int_equal(r->column, column);
        assert_int_equal(r->label, want->label);
        assert_int_equal(r->row, row + (uint32_t)pulse);
    }
}

static void test_scans(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 2), b = rig_anchor_of(NATIVE_CRS_UTM, 32632, 3);
    b.anchor[0] += 7;
    for (int empty_shots = 0; empty_shots < 2; empty_shots++) {
        size_t each = empty_shots ? 5 : 4;
        rig_begin();
        rig_descriptor(1, 1);
        rig_anchor(&a);
        rig_points(0, 0, 6, points, 5);
        rig_points(1, 20, 27, points, 5);
        rig_descriptor(1, 2);
        rig_anchor(&b);
        rig_points(0, 0, 9, points, 5);
        record_e57(empty_shots);
        e57rig_scan(0, empty_shots, coloured);
        assert_int_equal(e57rig_n_records, 2 * each);
        check_points(0, empty_shots, 0, 6);
        check_points(each, empty_shots, 1, 7);
        assert_true(fabs(e57rig_record[each].t_s - 0.027) < 1e-12);
        e57rig_scan(1, empty_shots, coloured);
        assert_int_equal(e57rig_n_records, each);
        check_points(0, empty_shots, 0, 9);
    }
}

static void test_xml(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 2);
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(3, 0, 6, points, 5);
    record_e57(0);
    assert_non_null(strstr(e57rig_xml, "AUTHORITY[\"EPSG\",\"32632\"]"));
    assert_non_null(strstr(e57rig_xml, "Maker,&#60;Model&#62; &#38; Co,SN1,1.0"));
    assert_non_null(strstr(e57rig_xml, "scan 1, station 2"));
    /* a quarter turn clockwise about z, seen from above: minus 90 degrees */
    static const double want[4] = {M_SQRT1_2, 0, 0, -M_SQRT1_2};
    static const char *const name[4] = {"w", "x", "y", "z"};
    const char *shift = strstr(e57rig_xml, "<translation"), *turn = strstr(e57rig_xml, "<rotation");
    for (int i = 0; i < 4; i++)
        assert_true(fabs(e57rig_number(turn, name[i]) - want[i]) < 1e-15);
    for (int i = 0; i < 3; i++)
        assert_true(e57rig_number(shift, name[i + 1]) == a.anchor[i]);
    assert_true(fabs(e57rig_number(e57rig_xml, "xMinimum")) < 1e-9 &&
                fabs(e57rig_number(e57rig_xml, "xMaximum") - 4.001) < 1e-9);
    assert_true(fabs(e57rig_number(e57rig_xml, "yMinimum")) < 1e-9 &&
                fabs(e57rig_number(e57rig_xml, "yMaximum") - 3.001) < 1e-9);
    assert_true(fabs(e57rig_number(e57rig_xml, "zMinimum") + 5) < 1e-9 &&
                fabs(e57rig_number(e57rig_xml, "zMaximum") - 12.001) < 1e-9);
    assert_true(e57rig_number(e57rig_xml, "intensityMinimum") == -12.34 &&
                e57rig_number(e57rig_xml, "intensityMaximum") == 327.67);
    assert_true(e57rig_number(e57rig_xml, "rowMinimum") == 6 && e57rig_number(e57rig_xml, "rowMaximum") == 9);
    assert_true(e57rig_number(e57rig_xml, "columnMinimum") == 3 && e57rig_number(e57rig_xml, "columnMaximum") == 3);
    assert_true(e57rig_number(e57rig_xml, "returnMaximum") == 1);
    assert_non_null(strstr(e57rig_xml, "<sh:label type=\"Integer\" minimum=\"0\" maximum=\"65535\">"));
    assert_null(strstr(e57rig_xml, "creationDateTime")); /* no clock in this stream */
}

/* Shots whose reflectance is not modelled do not count for the limits. If there are no others, there are no
 * limits. */
static void test_intensity_limits(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 2);
    const struct rig_point faint = {1, 1, 1, -1234, 7, 1, 1}, fainter = {1, 1, 1, -2345, 7, 1, 1},
                           none = {1, 1, 1, INT16_MIN, 7, 1, 1};
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, (struct rig_point[]){none, faint, fainter, faint, none}, 5);
    rig_descriptor(1, 2);
    rig_anchor(&a);
    rig_points(0, 0, 0, &none, 1);
    record_e57(0);
    assert_true(e57rig_number(e57rig_xml, "intensityMinimum") == -23.45 &&
                e57rig_number(e57rig_xml, "intensityMaximum") == -12.34);
    assert_null(strstr(strstr(e57rig_xml, "scan 2, station 2"), "intensityLimits"));
}

/* A shot without echo is at 0 0 0, which does not count for the bounds. */
static void test_bounds_of_empty_shots(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 2);
    const struct rig_point far = {3000, -4000, 12000, 0, 7, 1, 1}, empty = {0, 0, 0, INT16_MIN, 0xffff, 0, 0};
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, (struct rig_point[]){empty, far, empty}, 3);
    record_e57(1);
    assert_true(fabs(e57rig_number(e57rig_xml, "xMinimum") - 4) < 1e-9 &&
                fabs(e57rig_number(e57rig_xml, "zMinimum") - 12) < 1e-9);
}

/* There are more records than a packet holds, with streams of one, two and four bits across its edge. */
static void test_packets(void **state)
{
    (void)state;
    static struct rig_point many[3000];
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    for (int i = 0; i < 3000; i++)
        many[i] = i % 7 == 3 ? (struct rig_point){0, 0, 0, INT16_MIN, 0xffff, 0, 0}
                             : (struct rig_point){i, -i, 2 * i, (int16_t)(i % 5 ? i : INT16_MIN), 1, 1, 1};
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, many, 3000);
    rig_points(1, 3000, 3000, many, 1001);
    record_e57(1);
    e57rig_scan(0, 1, coloured);
    assert_int_equal(e57rig_n_records, 4001);
    for (int i = 0; i < 4001; i++) {
        int k = i % 3000;
        const struct e57rig_record *r = &e57rig_record[i];
        assert_int_equal(r->invalid, k % 7 == 3 ? 2 : 0);
        assert_int_equal(r->row, k);
        assert_int_equal(r->column, i / 3000);
        assert_int_equal(r->echoes, k % 7 != 3);
        if (r->invalid) continue;
        assert_int_equal(r->no_intensity, k % 5 == 0);
        assert_true(fabs(r->z - 2e-3 * k) < 1e-9);
    }
}

/* A packet spans 0.1 s, up to the next multiple of 8 records. So the file never lacks much, and a packet that ended
 * late does not shorten the next one. */
static void test_span_of_packets(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    static const struct {
        uint32_t ms;
        size_t n_packets; /* 100 records: packets of 8, of 16 (10 take 0.1 s), or one of all within 0.1 s */
    } cases[] = {{20, 13}, {50, 13}, {10, 7}, {1, 1}};
    for (size_t c = 0; c < sizeof cases / sizeof cases[0]; c++) {
        rig_begin();
        rig_descriptor(1, 1);
        rig_anchor(&a);
        for (uint32_t line = 0; line < 100; line++)
            rig_points(line, 500 + line * cases[c].ms, 500 + line * cases[c].ms, &points[0], 1);
        record_e57(0);
        e57rig_scan(0, 0, coloured);
        assert_int_equal(e57rig_n_records, 100);
        assert_int_equal(e57rig_n_packets, cases[c].n_packets);
    }
}

/* Records are a millisecond apart, 16 in a frame. Each packet has 104, the first multiple of 8 from 100 on. */
static void test_packets_begin_within_frames(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    static struct rig_point many[16];
    for (int i = 0; i < 16; i++)
        many[i] = (struct rig_point){3000, -4000, 12000, -1234, 7, 1, 1};
    for (uint32_t n = 20 * 104; n <= 20 * 104 + 1; n++) {
        rig_begin();
        rig_descriptor(1, 1);
        rig_anchor(&a);
        for (uint32_t i = 0; i < n; i += 16)
            rig_points(i / 16, i, i, many, n - i < 16 ? n - i : 16);
        record_e57(0);
        e57rig_scan(0, 0, coloured);
        assert_int_equal(e57rig_n_records, n);
        assert_int_equal(e57rig_n_packets, (n + 103) / 104);
    }
    for (uint32_t ms = 99; ms <= 100; ms++) { /* after eight records */
        rig_begin();
        rig_descriptor(1, 1);
        rig_anchor(&a);
        rig_points(0, 0, 0, many, 8);
        rig_points(1, ms, ms, many, 1);
        record_e57(0);
        e57rig_scan(0, 0, coloured);
        assert_int_equal(e57rig_n_packets, ms == 99 ? 1 : 2);
    }
}

/* Times of a broken stream may be any: the time from the first record of a packet wraps. Sanitizers see where it
 * overflows. */
static void test_far_times(void **state)
{
    (void)state;
    const uint64_t early = (uint64_t)-9223372036854; /* in ms: near the least time */
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    for (uint32_t line = 0; line < 3; line++)
        rig_points(line, 1000 + 10 * line, 1000 + 10 * line, points, 5);
    rig_points(3, early, early, points, 5);
    record_e57(1);
    e57rig_scan(0, 1, coloured);
    assert_int_equal(e57rig_n_records, 20);
    check_points(15, 1, 3, 0);
}

/* Colours are beside the label in a record, across the edges of packets, and the XML describes them. */
static void test_colours(void **state)
{
    (void)state;
    static struct rig_point many[4000];
    static const char *const name[] = {"<colorRed type=\"Integer\" minimum=\"0\" maximum=\"255\">", "<colorGreen type",
                                       "<colorBlue type"};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    for (int i = 0; i < 4000; i++)
        many[i] = i % 7 == 3 ? (struct rig_point){0, 0, 0, INT16_MIN, 0xffff, 0, 0}
                             : (struct rig_point){i, -i, 2 * i, 0, (uint16_t)(i % 50), 1, 1};
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, many, 3000);
    rig_points(1, 3000, 3000, many + 3000, 1000);
    coloured = 1;
    record_e57(1);
    e57rig_scan(0, 1, coloured);
    coloured = 0;
    assert_int_equal(e57rig_n_records, 4000);
    for (int i = 0; i < 4000; i++) {
        uint8_t rgb[3] = {128, 128, 128};
        assert_int_equal(e57rig_record[i].label, many[i].label);
        if (many[i].count != 0) colour_number(many[i].label, rgb);
        assert_memory_equal(e57rig_record[i].rgb, rgb, 3);
        assert_int_equal(e57rig_record[i].invalid, many[i].count == 0 ? 2 : 0);
    }
    for (int i = 0; i < 3; i++)
        assert_non_null(strstr(e57rig_xml, name[i]));
    assert_true(strstr(e57rig_xml, name[0]) < strstr(e57rig_xml, name[1]) &&
                strstr(e57rig_xml, name[1]) < strstr(e57rig_xml, name[2]));
    assert_true(e57rig_number(e57rig_xml, "colorRedMinimum") == 0 &&
                e57rig_number(e57rig_xml, "colorBlueMaximum") == 255);
}

static void test_no_points(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    static const struct rig_point empty = {0, 0, 0, INT16_MIN, 0xffff, 0, 0};
    rig_begin();
    record_e57(0); /* not even a scan */
    assert_null(strstr(e57rig_xml, "<points"));
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, &empty, 1);
    record_e57(0);
    e57rig_scan(0, 0, coloured);
    assert_int_equal(e57rig_n_records, 0);
    assert_int_equal(e57rig_n_packets, 1); /* an empty one: the standard wants a packet */
    assert_null(strstr(e57rig_xml, "cartesianBounds"));
}

static void test_same_bytes(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    char guid[2][64];
    for (int i = 0; i < 3; i++) {
        rig_begin();
        rig_descriptor(1, 1);
        rig_anchor(&a);
        rig_points(0, 0, 0, points, i < 2 ? 5 : 4);
        record_e57(0);
        char *at = strstr(strstr(e57rig_xml, "<data3D"), "<guid type=\"String\">{") + 21;
        assert_memory_not_equal(strstr(e57rig_xml, "<guid type=\"String\">{") + 21, at, 36); /* the file's own */
        if (i < 2) snprintf(guid[i], sizeof guid[i], "%.36s", at);
        if (i == 2) assert_memory_not_equal(guid[0], at, 36);
    }
    assert_string_equal(guid[0], guid[1]);
}

static void test_disk_full(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    for (uint32_t i = 0; i < 20; i++)
        rig_points(i, 10 * i, 10 * i, points, 5);
    rig_check_disk_full(rig_path("full.e57"), 3000);
}

/* The XML section of a repaired file needs room that a full disk does not have. The points stay, and the error says
 * so. */
static void test_repair_on_a_full_disk(void **state)
{
    (void)state;
    static const char says[] = ": cannot write: File too large; nothing is lost: free some room and repeat the command";
    const char *path = rig_path("full.e57");
    const struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    struct sh_err err;
    struct rlimit old;
    struct repaired file;
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    for (uint32_t i = 0; i < 20; i++)
        rig_points(i, 10 * i, 10 * i, points, 5);
    fclose(rig_stream);
    rig_stream = NULL;
    void (*was)(int) = signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &old);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &(struct rlimit){3000, old.rlim_max}), 0);
    const int recorded = rig_record(path, (struct recorder_options){0}, RIG_KEEP_ALWAYS, &err);
    const int repaired = repair_file(path, NULL, &file, &err);
    setrlimit(RLIMIT_FSIZE, &old);
    signal(SIGXFSZ, was);
    assert_true(recorded == SH_EIO && repaired == SH_EIO);
    if (strstr(err.text, says) == NULL) fail_msg("%s", err.text);
    rig_check_left(path);
}

static int tear_down(void **state)
{
    e57rig_free();
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_scans),
        cmocka_unit_test(test_xml),
        cmocka_unit_test(test_packets),
        cmocka_unit_test(test_far_times),
        cmocka_unit_test(test_span_of_packets),
        cmocka_unit_test(test_packets_begin_within_frames),
        cmocka_unit_test(test_no_points),
        cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_disk_full),
        cmocka_unit_test(test_repair_on_a_full_disk),
        cmocka_unit_test(test_colours),
        cmocka_unit_test(test_intensity_limits),
        cmocka_unit_test(test_bounds_of_empty_shots),
    };
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
