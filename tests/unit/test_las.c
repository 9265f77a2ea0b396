/* SPDX-License-Identifier: MIT */
/* LAS files, field by field at the offsets of the ASPRS specification (LAS 1.4 R15). */
#include "drivers/record/las_inside.h"
#include "tests/unit/recorder_rig.h"

enum { HEADER = 375, VLR = 54, POINT = 32 };

static const struct rig_point points[] = {
    {3000, -4000, 12000, -1234, 7, 1, 2},
    {3001, -4001, 12001, INT16_MIN, 8, 2, 2},
    {0, 0, 0, INT16_MIN, 0xffff, 0, 0},
    {0, 0, -5000, 32767, 40009, 1, 1},
    {5, 0, 0, 0, 1, 1, 1},
};
enum { N = sizeof points / sizeof points[0] };

static uint8_t *las;
static size_t las_len;

static void record_las_with(struct recorder_options options)
{
    free(las);
    las = rig_record_bytes("a.las", options, &las_len);
}

static void record_las(void)
{
    record_las_with((struct recorder_options){0});
}

static void put_scan(int geo, uint32_t scan, const struct native_anchor *anchor)
{
    rig_descriptor(geo, scan);
    rig_anchor(anchor);
    rig_points(0, 0, 0, points, N);
}

static const uint8_t *find_vlr(const char *user, unsigned record)
{
    size_t at = rig_uint(las + 94, 2);
    for (uint64_t i = 0; i < rig_uint(las + 100, 4); i++) {
        assert_int_equal(rig_uint(las + at, 2), 0);
        if (strcmp((char *)las + at + 2, user) == 0 && rig_uint(las + at + 18, 2) == record) return las + at;
        at += VLR + rig_uint(las + at + 20, 2);
    }
    return NULL;
}

static void check_header(const char *profile)
{
    static const uint8_t zeros[24];
    assert_memory_equal(las, "LASF", 4);
    assert_int_equal(rig_uint(las + 4, 2), 0);
    assert_int_equal(rig_uint(las + 6, 2), 1 << 4); /* WKT; not adjusted standard GPS time */
    assert_int_equal(las[24], 1);
    assert_int_equal(las[25], 4);
    assert_string_equal((char *)las + 26, profile);
    assert_string_equal((char *)las + 58, "scanhead");
    assert_int_equal(rig_uint(las + 94, 2), HEADER);
    assert_int_equal(las[104], 6);
    assert_int_equal(rig_uint(las + 105, 2), POINT);
    assert_memory_equal(las + 107, zeros, 24); /* the old counts must be 0 for format 6 */
    assert_memory_equal(las + 227, zeros, 20); /* no waveforms, no extended records */
    assert_int_equal(rig_uint(las + 96, 4) + POINT * rig_uint(las + 247, 8), las_len);
}

static void test_header(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 2);
    rig_begin();
    put_scan(1, 1, &a);
    record_las();
    check_header("model");
    assert_int_equal(rig_uint(las + 247, 8), 4);
    static const int by_return[15] = {3, 1};
    for (int i = 0; i < 15; i++)
        assert_int_equal(rig_uint(las + 255 + 8 * i, 8), by_return[i]);
    for (int i = 0; i < 3; i++) {
        assert_true(rig_double(las + 131 + 8 * i) == 1e-3);
        assert_true(rig_double(las + 155 + 8 * i) == a.anchor[i]);
    }
    static const double max_min[3][2] = {{3.001, 0}, {0, -4.001}, {12.001, -5}};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 2; k++)
            assert_true(fabs(rig_double(las + 179 + 16 * i + 8 * k) - (a.anchor[i] + max_min[i][k])) < 1e-9);
    assert_non_null(strstr(rig_notes, "1 shots without echo left out"));
}

static void test_records(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 65535);
    rig_begin();
    put_scan(1, 1, &a);
    record_las();
    const uint8_t *wkt = find_vlr("LASF_Projection", 2112), *extra = find_vlr("LASF_Spec", 4),
                  *p = las + rig_uint(las + 96, 4);
    assert_non_null(wkt);
    assert_non_null(strstr((char *)wkt + VLR, "AUTHORITY[\"EPSG\",\"32632\"]"));
    assert_int_equal(strlen((char *)wkt + VLR) + 1, rig_uint(wkt + 20, 2));
    assert_non_null(extra);
    assert_int_equal(rig_uint(extra + 20, 2), 192);
    assert_int_equal(extra[VLR + 2], 3); /* unsigned short */
    assert_string_equal((char *)extra + VLR + 4, "label");
    for (int i = 0; i < N; i++) {
        const struct rig_point *want = &points[i];
        if (want->count == 0) continue;
        assert_int_equal(rig_int32(p), want->a); /* the stream's own counts */
        assert_int_equal(rig_int32(p + 4), want->b);
        assert_int_equal(rig_int32(p + 8), want->c);
        assert_int_equal(rig_uint(p + 12, 2), want->refl_cdb + 32768);
        assert_int_equal(p[14], want->count << 4 | want->echo);
        assert_int_equal(p[15], 0);
        assert_int_equal(p[16], 0);
        assert_int_equal(p[17], 0);
        assert_int_equal(rig_uint(p + 20, 2), 65535);
        assert_true(rig_double(p + 22) == (i < 2 ? 0 : i == 3 ? 2e-3 : 3e-3));
        assert_int_equal(rig_uint(p + 30, 2), want->label);
        p += POINT;
    }
    /* Angles are steps of 0.006 degrees from straight down. Points: 12 m up at 5 m aside, 1 mm farther, down, level. */
    p = las + rig_uint(las + 96, 4);
    assert_int_equal(rig_uint(p + 18, 2), lrint((90 + atan2(12, 5) * 180 / M_PI) / 0.006));
    assert_int_equal(rig_uint(p + 2 * POINT + 18, 2), 0);
    assert_int_equal(rig_uint(p + 3 * POINT + 18, 2), 15000);
}

/* A second station counts from the first one's anchor. A station beyond the reach of 32 bits is refused. */
static void test_stations(void **state)
{
    (void)state;
    struct sh_err err = {0};
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1), b = rig_anchor_of(NATIVE_CRS_UTM, 32632, 2);
    b.anchor[0] += 1000.0004;
    rig_begin();
    put_scan(1, 1, &a);
    put_scan(1, 2, &b);
    record_las();
    check_header("model");
    const uint8_t *p = las + rig_uint(las + 96, 4) + 4 * POINT;
    assert_int_equal(rig_uint(las + 247, 8), 8);
    assert_int_equal(rig_int32(p), 1003000); /* 1003.0004 m, half a step at most away */
    assert_int_equal(rig_uint(p - POINT + 20, 2), 1);
    assert_int_equal(rig_uint(p + 20, 2), 2);
    b.anchor[0] = a.anchor[0] - 2147484;
    rig_begin();
    put_scan(1, 1, &a);
    put_scan(1, 2, &b);
    assert_int_equal(rig_record(rig_path("a.las"), (struct recorder_options){0}, 1, &err), SH_EFORMAT);
    assert_non_null(strstr(err.text, "station 2"));
    assert_non_null(strstr(err.text, "output.scale_m"));
    /* The recording is kept all the same: the file holds the points so far, with two of the second station, 3 m
     * nearer. */
    assert_int_equal(rig_record(rig_path("a.las"), (struct recorder_options){0}, RIG_KEEP_ALWAYS, &err), SH_EFORMAT);
    free(las);
    las = rig_take("a.las", &las_len);
    check_header("model");
    assert_int_equal(rig_uint(las + 247, 8), 6);
    assert_true(fabs(rig_double(las + 187) - (a.anchor[0] - 2147481)) < 1e-9);
}

/* In the polar layout the pose places points in the scene, and there is no CRS. */
static void test_polar(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    static const struct rig_point forward = {5000, 0, 0, 0, 1, 1, 1}, right = {5000, 0, 900, 0, 1, 1, 1},
                                  up = {5000, 900, 0, 0, 1, 1, 1};
    rig_begin();
    rig_descriptor(0, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, (struct rig_point[]){forward, right, up}, 3);
    record_las();
    check_header("model");
    static const int32_t want[3][3] = {{5000, 0, 0}, {0, -5000, 0}, {0, 0, 5000}};
    const uint8_t *p = las + rig_uint(las + 96, 4);
    assert_null(find_vlr("LASF_Projection", 2112));
    for (int i = 0; i < 3; i++) {
        assert_true(rig_double(las + 155 + 8 * i) == a.station_m[i]);
        for (int k = 0; k < 3; k++)
            assert_int_equal(rig_int32(p + POINT * i + 4 * k), want[i][k]);
    }
    assert_int_equal(rig_uint(p + 18, 2), 15000);
    assert_int_equal(rig_uint(p + 2 * POINT + 18, 2), 30000);
}

static void test_no_points(void **state)
{
    (void)state;
    rig_begin();
    rig_descriptor(1, 1);
    rig_points(0, 0, 0, points, N); /* without an anchor they have no place */
    record_las();
    check_header("OTHER");
    assert_int_equal(rig_uint(las + 247, 8), 0);
    for (int i = 0; i < 3; i++) {
        assert_true(rig_double(las + 131 + 8 * i) == 1); /* a scale of 0 is none */
        assert_true(rig_double(las + 155 + 8 * i) == 0);
    }
    assert_non_null(strstr(rig_notes, "5 points left out"));
}

static void test_disk_full(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    rig_begin();
    for (uint32_t i = 0; i < 20; i++)
        put_scan(1, i + 1, &a);
    rig_check_disk_full(rig_path("full.las"), 2000);
}

/* There are more points than the buffer holds, so that the header is overwritten in the file. */
static void test_long(void **state)
{
    (void)state;
    static struct rig_point many[3000];
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_ECEF, 4978, 1);
    for (int i = 0; i < 3000; i++)
        many[i] = (struct rig_point){i, -i, 2 * i, 0, 1, 1, 1};
    rig_begin();
    rig_descriptor(1, 1);
    rig_anchor(&a);
    for (uint32_t i = 0; i < 20; i++)
        rig_points(i, 3000 * i, 3000 * i, many, 3000);
    record_las();
    check_header("model");
    assert_int_equal(rig_uint(las + 247, 8), 60000);
    assert_int_equal(rig_int32(las + las_len - POINT), 2999);
    assert_non_null(strstr((char *)find_vlr("LASF_Projection", 2112) + VLR, "GEOCCS["));
}

/* LAS 1.2, format 1 or 3 with colour: offsets of the ASPRS specification, LAS 1.2 of 2008. */
static void check_12(int colour)
{
    const uint8_t *p = las + rig_uint(las + 96, 4);
    const size_t len = colour ? 34 : 28;
    static const uint32_t by_return[5] = {4, 2, 1, 1, 1};
    assert_int_equal(rig_uint(las + 6, 2), 0);
    assert_int_equal(las[24] << 8 | las[25], 1 << 8 | 2);
    assert_int_equal(rig_uint(las + 94, 2), 227);
    assert_int_equal(las[104], colour ? 3 : 1);
    assert_int_equal(rig_uint(las + 105, 2), len);
    assert_int_equal(rig_uint(las + 107, 4), 9);
    assert_int_equal(las_len, rig_uint(las + 96, 4) + 9 * len);
    for (int i = 0; i < 5; i++)
        assert_int_equal(rig_uint(las + 111 + 4 * i, 4), by_return[i]);
    for (int i = 0; i < 3; i++)
        assert_true(rig_double(las + 131 + 8 * i) == 1e-3);
    assert_true(fabs(rig_double(las + 179) - 500003.251) < 1e-9); /* the largest x */
    assert_int_equal(rig_int32(p), 3000);
    assert_int_equal(rig_uint(p + 12, 2), -1234 + 32768);
    assert_int_equal(p[14], 1 | 2 << 3);
    assert_int_equal(p[len + 14], 2 | 2 << 3);
    assert_int_equal(p[15] | p[16] | p[17], 0);
    assert_int_equal(rig_uint(p + 18, 2), 7);
    assert_true(rig_double(p + 2 * len + 20) == 2e-3); /* its pulse is the third: 1 kHz */
    for (int i = 0; i < 5; i++)                        /* five of six echoes, and as many as the format counts */
        assert_int_equal(p[(4 + (size_t)i) * len + 14], (i + 1) | 5 << 3);
    /* -12.34 dB of -30 to 0: 150 of 255, in 16 bits */
    for (int i = 0; i < 3 && colour; i++)
        assert_int_equal(rig_uint(p + 28 + 2 * i, 2), 150 * 257);
    assert_non_null(strstr(rig_notes, "1 echoes left out: the sixth"));
    assert_non_null(strstr(rig_notes, "5 points of pulses with more than 5 echoes"));
    assert_non_null(strstr(rig_notes, "LAS 1.2 has no place for labels and exact scan angles; they are left out"));
}

static void test_las_12(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 7);
    struct rig_point six[6];
    for (int i = 0; i < 6; i++)
        six[i] = (struct rig_point){100 + i, 0, 0, 0, 0, (uint8_t)(i + 1), 6};
    for (int colour = 0; colour < 2; colour++) {
        rig_begin();
        put_scan(1, 1, &a);
        rig_points(1, 10, 10, six, 6);
        record_las_with(
            (struct recorder_options){.las_minor = 2, .colour = {.given = colour, .scale.mode = COLOUR_REFLECTANCE}});
        check_12(colour);
        /* GeoTIFF's directory: a projected CRS, its code, metres */
        const uint8_t *keys = find_vlr("LASF_Projection", 34735);
        assert_non_null(keys);
        assert_null(find_vlr("LASF_Projection", 2112));
        static const uint16_t want[] = {1, 1,     0,    6, 1024, 0,    1,    1, 1025, 0,    1,    1, 3072, 0,
                                        1, 32632, 3076, 0, 1,    9001, 4096, 0, 1,    5030, 4099, 0, 1,    9001};
        assert_int_equal(rig_uint(keys + 20, 2), sizeof want);
        for (size_t i = 0; i < sizeof want / sizeof want[0]; i++)
            assert_int_equal(rig_uint(keys + VLR + 2 * i, 2), want[i]);
    }
}

/* Format 7 has red, green and blue between the time and the extra bytes. */
static void test_colour(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 7);
    rig_begin();
    put_scan(1, 1, &a);
    record_las_with((struct recorder_options){.colour = {.given = 1, .scale.mode = COLOUR_LABEL}});
    const uint8_t *p = las + rig_uint(las + 96, 4);
    uint8_t rgb[3];
    assert_int_equal(las[25], 4);
    assert_int_equal(las[104], 7);
    assert_int_equal(rig_uint(las + 105, 2), POINT + 6);
    colour_number(7, rgb);
    for (int i = 0; i < 3; i++)
        assert_int_equal(rig_uint(p + 30 + 2 * i, 2), rgb[i] * 257);
    assert_int_equal(rig_uint(p + 36, 2), 7);
    assert_true(rgb[0] != rgb[1] || rgb[1] != rgb[2]); /* a hue */
}

/* LAS 1.2 counts points in 32 bits, LAS 1.4 in 64. The stream has 9 points. */
static void test_most_points(void **state)
{
    (void)state;
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 7);
    rig_begin();
    put_scan(1, 1, &a);
    fclose(rig_stream);
    rig_stream = NULL;
    for (int minor = 2; minor <= 4; minor += 2)
        for (uint64_t room = 3; room <= 4; room++) {
            struct scanhead *sh;
            struct scanhead_frame frame;
            struct recorder *rec;
            struct sh_err err = {0};
            const struct recorder_options options = {.las_minor = minor};
            const char *path = rig_path("a.las");
            int rc = SH_OK;
            assert_int_equal(scanhead_open(rig_shs, &sh, NULL, 0), 0);
            assert_int_equal(recorder_open(recorder_find(path, &err), path, &options, &rec, &err), 0);
            struct las_facts *facts = &((struct las *)rec)->facts;
            facts->n_points = UINT32_MAX - room;
            while (rc == SH_OK && scanhead_next(sh, &frame, -1) == 0)
                rc = recorder_frame(rec, sh, &frame, &err);
            assert_int_equal(rc, minor == 2 && room == 3 ? SH_EFORMAT : SH_OK);
            assert_true(facts->n_points == UINT32_MAX - room + (rc == SH_OK ? 4 : 3));
            if (rc != SH_OK)
                assert_non_null(strstr(err.text, "LAS 1.2 holds up to 4294967295 points; use --las-version 1.4"));
            recorder_close(rec, 0, NULL);
            scanhead_close(sh);
        }
}

/* 32 bits hold 2147483.647 m in steps of 1 mm. The first station's place is where they count from. */
static void test_too_far(void **state)
{
    (void)state;
    const struct native_anchor first = rig_anchor_of(NATIVE_CRS_UTM, 32632, 7);
    struct native_anchor a = first;
    struct sh_err err = {0};
    char want[400];
    a.station = 8;
    a.scale[0] = a.scale[1] = a.scale[2] = 1; /* m; the file keeps the first station's steps */
    for (int k = 0; k < 3; k++)
        for (int too_far = 0; too_far < 2; too_far++) {
            struct rig_point p = {10, 20, 30, 0, 0, 1, 1};
            *(k == 0 ? &p.a : k == 1 ? &p.b : &p.c) = -2147483 - too_far;
            rig_begin();
            put_scan(1, 1, &first);
            rig_descriptor(1, 2);
            rig_anchor(&a);
            rig_points(0, 0, 0, &p, 1);
            assert_int_equal(rig_record(rig_path("a.las"), (struct recorder_options){0}, 0, &err),
                             too_far ? SH_EFORMAT : SH_OK);
            if (!too_far) continue;
            snprintf(
                want, sizeof want,
                "%s: a point of station 8 at (%.3f %.3f %.3f) is beyond the 2147484 m from the first station that "
                "LAS can hold in steps of 0.001 m; give the head a coarser output.scale_m, or each station its own "
                "file",
                rig_path("a.las"), a.anchor[0] + p.a, a.anchor[1] + p.b, a.anchor[2] + p.c);
            assert_string_equal(err.text, want);
        }
}

static int tear_down(void **state)
{
    free(las);
    return rig_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_header),      cmocka_unit_test(test_records),   cmocka_unit_test(test_stations),
        cmocka_unit_test(test_polar),       cmocka_unit_test(test_no_points), cmocka_unit_test(test_disk_full),
        cmocka_unit_test(test_long),        cmocka_unit_test(test_las_12),    cmocka_unit_test(test_colour),
        cmocka_unit_test(test_most_points), cmocka_unit_test(test_too_far),
    };
    return cmocka_run_group_tests(tests, rig_set_up, tear_down);
}
