/* SPDX-License-Identifier: MIT */
/* LAS files as clouds: recorded ones, which other people's readers check elsewhere, and broken ones. */
#include "core/studio/cloud.h"
#include "tests/unit/recorder_rig.h"

static const struct rig_point points[] = {{3000, -4000, 12000, -1234, 7, 1, 2},
                                          {3001, -4001, 12001, INT16_MIN, 40008, 2, 2},
                                          {0, 0, 0, INT16_MIN, 0xffff, 0, 0}};

static void write_las(uint32_t crs, uint32_t epsg, int geo)
{
    struct sh_err err = {0};
    struct native_anchor a = rig_anchor_of(crs, epsg, 1), b = rig_anchor_of(crs, epsg, 2);
    rig_begin();
    rig_descriptor(geo, 1);
    rig_anchor(&a);
    rig_points(0, 0, 0, points, 3);
    rig_descriptor(geo, 2);
    rig_anchor(&b);
    rig_points(0, 0, 0, points, 1);
    if (rig_record(rig_path("a.las"), (struct recorder_options){0}, 1, &err) != 0) fail_msg("%s", err.text);
}

static void write_bytes(const uint8_t *las, size_t len)
{
    FILE *f = fopen(rig_path("a.las"), "wb");
    assert_non_null(f);
    assert_int_equal(fwrite(las, 1, len, f), len);
    assert_int_equal(fclose(f), 0);
}

static void test_read(void **state)
{
    (void)state;
    static const int codes[][3] = {{NATIVE_CRS_UTM, 32632, 32632},
                                   {NATIVE_CRS_UTM, 32761, 32761},
                                   {NATIVE_CRS_UTM, 32661, 32661},
                                   {NATIVE_CRS_ECEF, 4978, 4978},
                                   {NATIVE_CRS_LOCAL, 0, CLOUD_EPSG_UNKNOWN}};
    for (size_t i = 0; i < sizeof codes / sizeof codes[0]; i++) {
        struct cloud cloud;
        struct sh_err err = {0};
        write_las((uint32_t)codes[i][0], (uint32_t)codes[i][1], 1);
        if (cloud_read_columns(rig_path("a.las"), 0, NULL, &cloud, &err) != 0) fail_msg("%s", err.text);
        assert_int_equal(cloud.epsg, codes[i][2]);
        assert_int_equal(cloud.n, 3);
        static const unsigned want[3][3] = {{1, 1, 7}, {1, 2, 40008}, {2, 1, 7}};
        for (int k = 0; k < 3; k++) {
            assert_int_equal(cloud.station[k], want[k][0]);
            assert_int_equal(cloud.echo[k], want[k][1]);
            assert_int_equal(cloud.label[k], want[k][2]);
        }
        assert_true(fabs(cloud.xyz_m[1][0] - 500003.251) < 1e-9 && fabs(cloud.xyz_m[1][1] - 4999995.999) < 2e-9);
        assert_true(fabs(cloud.xyz_m[1][2] - 412.126) < 1e-12);
        assert_true(cloud.time_s == NULL && cloud.reflectance_db == NULL && cloud.has_own_counts);
        cloud_free(&cloud);
        const unsigned columns =
            1u << CLOUD_TIME | 1u << CLOUD_REFLECTANCE | 1u << CLOUD_ECHO_COUNT | 1u << CLOUD_RANGE;
        assert_int_equal(cloud_read_columns(rig_path("a.las"), columns, NULL, &cloud, &err), 0);
        assert_true(fabs((double)cloud.reflectance_db[0] + 12.34) < 1e-5 && isnan(cloud.reflectance_db[1]));
        assert_true(cloud.echo_count[0] == 2 && cloud.range_m == NULL && cloud.time_s[1] >= cloud.time_s[0]);
        cloud_free(&cloud);
        unlink(rig_path("a.las"));
    }
}

/* The returns of a point are a byte, which some writers leave 0. The point is an echo all the same. */
static void test_without_returns(void **state)
{
    (void)state;
    size_t len;
    struct cloud cloud;
    struct sh_err err = {0};
    uint32_t at;
    write_las(NATIVE_CRS_UTM, 32632, 1);
    uint8_t *las = rig_read(rig_path("a.las"), &len);
    memcpy(&at, las + 96, sizeof at);
    las[at + 14] = 0; /* of the first point */
    write_bytes(las, len);
    free(las);
    if (cloud_read_columns(rig_path("a.las"), 1u << CLOUD_ECHO_COUNT, NULL, &cloud, &err) != 0)
        fail_msg("%s", err.text);
    assert_true(cloud.echo[0] == 1 && cloud.echo_count[0] == 1);
    assert_true(cloud.echo[1] == 2 && cloud.echo_count[1] == 2);
    cloud_free(&cloud);
    unlink(rig_path("a.las"));
}

static int n_warned;
static char warned[512];

static void take_warning(void *ctx, const char *text)
{
    (void)ctx;
    n_warned++;
    snprintf(warned, sizeof warned, "%s", text);
}

static void expect_warnings(const uint8_t *las, size_t len, int n)
{
    static const struct sh_report report = {.warn = take_warning};
    struct cloud cloud;
    struct sh_err err = {0};
    write_bytes(las, len);
    n_warned = 0;
    if (cloud_read_columns(rig_path("a.las"), 0, &report, &cloud, &err) != 0) fail_msg("%s", err.text);
    assert_int_equal(n_warned, n);
    cloud_free(&cloud);
}

/* A file that holds another one after its points is judged by its first part, with a warning. Extended records after
 * the points belong to the file: as many as version 1.4 counts, or the one of waveforms. Places are those of LAS 1.4
 * R15: the start of waveforms at 227, the start of extended records at 235, their number at 243, and a record's length
 * at 20 of its 60 bytes. */
static void a_rest_is_warned_of(void **state)
{
    (void)state;
    enum { RECORD = 60 + 7 };
    size_t len;
    write_las(NATIVE_CRS_UTM, 32632, 1);
    uint8_t *one = rig_read(rig_path("a.las"), &len);
    uint8_t *las = calloc(1, 2 * len + 2 * RECORD);
    assert_non_null(las);
    const uint64_t start = len;
    memcpy(las, one, len);
    assert_int_equal(las[25], 4);
    expect_warnings(las, len, 0);
    memcpy(las + len, one, len);
    expect_warnings(las, 2 * len, 1);
    snprintf(warned, sizeof warned, "%s", strchr(warned, ':'));
    char want[64];
    snprintf(want, sizeof want, ": %zu bytes after the last point ignored", len);
    assert_string_equal(warned, want);
    memset(las + len, 0, len + 2 * RECORD);
    las[len + 20] = las[len + RECORD + 20] = 7;
    memcpy(las + 235, &start, sizeof start);
    las[243] = 2;
    expect_warnings(las, len + 2 * RECORD, 0);
    expect_warnings(las, len + 2 * RECORD + 1, 1);
    las[243] = 0;
    expect_warnings(las, len + RECORD, 1);
    memcpy(las + 227, &start, sizeof start);
    expect_warnings(las, len + RECORD, 0);
    expect_warnings(las, len + 2 * RECORD, 1);
    free(las);
    free(one);
    unlink(rig_path("a.las"));
}

/* Coordinates are degrees. The file's x is longitude, the cloud's first is latitude, as in a stream, and within
 * -180..180. */
static void test_degrees(void **state)
{
    (void)state;
    static const double lon_deg[] = {9, 179.998, -179.998};
    for (int i = 0; i < 3; i++) {
        struct native_anchor a = rig_anchor_of(NATIVE_CRS_GEODETIC, 4979, 1);
        struct cloud cloud;
        struct sh_err err = {0};
        a.anchor[0] = 45;
        a.anchor[1] = lon_deg[i];
        a.scale[0] = a.scale[1] = 1e-9;
        a.scale[2] = 1e-3;
        rig_begin();
        rig_descriptor(1, 1);
        rig_anchor(&a);
        rig_points(0, 0, 0, (struct rig_point[]){{3000000, 4000000, 12000, 0, 7, 1, 1}, {0, -4000000, 0, 0, 7, 1, 1}},
                   2);
        if (rig_record(rig_path("a.las"), (struct recorder_options){0}, 1, &err) != 0) fail_msg("%s", err.text);
        if (cloud_read_columns(rig_path("a.las"), 0, NULL, &cloud, &err) != 0) fail_msg("%s", err.text);
        const double want[2] = {remainder(lon_deg[i] + 0.004, 360), remainder(lon_deg[i] - 0.004, 360)};
        assert_int_equal(cloud.epsg, 4979);
        assert_true(fabs(cloud.xyz_m[0][0] - 45.003) < 1e-13 && fabs(cloud.xyz_m[0][2] - 412.125) < 1e-12);
        assert_true(fabs(cloud.xyz_m[0][1] - want[0]) < 1e-12 && fabs(cloud.xyz_m[1][1] - want[1]) < 1e-12);
        assert_true(fabs(cloud.count_m - 1e-3) < 1e-9); /* heights are the coarsest: a degree's count is 0.1 mm */
        cloud_free(&cloud);
        unlink(rig_path("a.las"));
    }
}

/* One byte is changed, or the end cut off. The error names the file. */
static void test_broken(void **state)
{
    (void)state;
    static const struct {
        int at, value; /* at -1: cut to `value` bytes, counted from the end if negative */
        const char *says;
    } broken[] = {{-1, 100, "shorter than a LAS header"},
                  {-1, -1, "cut off"},
                  {25, 1, "version 1.2 to 1.4"},
                  {104, 6 | 0x80, "compressed"},
                  {104, 11, "format"},
                  {105, 29, "shorter than their format"},
                  {250, 1, "cut off"},
                  {254, 255, "cut off"},
                  {99, 1, "cut off"},
                  {102, 1, "variable length records"},
                  {375 + 21, 255, "variable length records"},
                  {138, 0xff, "no position"}};
    for (size_t i = 0; i < sizeof broken / sizeof broken[0]; i++) {
        size_t len;
        struct cloud cloud;
        struct sh_err err = {0};
        write_las(NATIVE_CRS_UTM, 32632, 1);
        uint8_t *las = rig_read(rig_path("a.las"), &len);
        if (broken[i].at >= 0)
            las[broken[i].at] = (uint8_t)broken[i].value;
        else
            len = broken[i].value < 0 ? len - 1 : (size_t)broken[i].value;
        if (broken[i].at == 138) las[137] = 0xf0; /* the scale is NaN or infinite */
        write_bytes(las, len);
        free(las);
        assert_int_equal(cloud_read_columns(rig_path("a.las"), 0, NULL, &cloud, &err), SH_EINPUT);
        if (strstr(err.text, broken[i].says) == NULL) fail_msg("case %zu: %s", i, err.text);
        assert_non_null(strstr(err.text, "a.las"));
        unlink(rig_path("a.las"));
    }
}

/* A WKT whose brackets do not close ends where its record does, and says nothing for certain. */
static void test_wkt_without_end(void **state)
{
    (void)state;
    size_t len;
    struct cloud cloud;
    struct sh_err err = {0};
    write_las(NATIVE_CRS_UTM, 32632, 1);
    uint8_t *las = rig_read(rig_path("a.las"), &len), *wkt = memmem(las, len, "PROJCS[", 7);
    assert_non_null(wkt);
    for (; *wkt != 0; wkt++)
        if (*wkt == ']') *wkt = ' ';
    write_bytes(las, len);
    free(las);
    if (cloud_read_columns(rig_path("a.las"), 0, NULL, &cloud, &err) != 0) fail_msg("%s", err.text);
    assert_int_equal(cloud.epsg, CLOUD_EPSG_UNKNOWN);
    cloud_free(&cloud);
    unlink(rig_path("a.las"));
}

static void put(uint8_t *to, int bytes, uint64_t v)
{
    for (int i = 0; i < bytes; i++)
        to[i] = (uint8_t)(v >> 8 * i);
}

/* Another program's file: a byte of its own stands before the label. */
static void test_label_behind_others(void **state)
{
    (void)state;
    enum { VLR = 375, ENTRIES = VLR + 54, POINTS = ENTRIES + 2 * 192, LEN = 33 };
    static uint8_t file[POINTS + LEN];
    struct cloud cloud;
    struct sh_err err = {0};
    const double one = 1;
    memcpy(file, "LASF", 4);
    file[24] = 1;
    file[25] = 4;
    put(file + 94, 2, VLR);
    put(file + 96, 4, POINTS);
    put(file + 100, 4, 1);
    file[104] = 6;
    put(file + 105, 2, LEN);
    for (int k = 0; k < 3; k++)
        memcpy(file + 131 + 8 * k, &one, 8);
    put(file + 247, 8, 1);
    memcpy(file + VLR + 2, "LASF_Spec", 9);
    put(file + VLR + 18, 2, 4);
    put(file + VLR + 20, 2, 2 * 192);
    file[ENTRIES + 2] = 1; /* a byte */
    memcpy(file + ENTRIES + 4, "quality", 7);
    file[ENTRIES + 192 + 2] = 3; /* two bytes */
    memcpy(file + ENTRIES + 192 + 4, "label", 5);
    file[POINTS + 14] = 0x11;
    put(file + POINTS + 20, 2, 1);
    file[POINTS + 30] = 99;
    put(file + POINTS + 31, 2, 40123);
    write_bytes(file, sizeof file);
    if (cloud_read_columns(rig_path("a.las"), 0, NULL, &cloud, &err) != 0) fail_msg("%s", err.text);
    assert_int_equal(cloud.label[0], 40123);
    cloud_free(&cloud);
    unlink(rig_path("a.las"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_read),
                                       cmocka_unit_test(test_degrees),
                                       cmocka_unit_test(test_label_behind_others),
                                       cmocka_unit_test(test_broken),
                                       cmocka_unit_test(test_without_returns),
                                       cmocka_unit_test(a_rest_is_warned_of),
                                       cmocka_unit_test(test_wkt_without_end)};
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
