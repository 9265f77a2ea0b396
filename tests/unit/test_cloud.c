/* SPDX-License-Identifier: MIT */
/* Reading recorded point clouds. */
#include <math.h>

#include "core/studio/cloud.h"
#include "tests/unit/scene_files.h"

#define LENGTH(a) (sizeof(a) / sizeof *(a))

static const struct sh_report report = {.warn = keep_warning};

static int read_cloud(const char *name, const void *data, size_t len, struct cloud *c, struct sh_err *err)
{
    n_warnings = 0;
    warnings[0] = err->text[0] = '\0';
    int rc = cloud_read_columns(write_file(name, data, len), 0, &report, c, err);
    unlink(path);
    return rc;
}

static struct cloud must_read(const char *name, const void *data, size_t len)
{
    struct cloud c;
    struct sh_err err;
    if (read_cloud(name, data, len, &c, &err) != SH_OK) fail_msg("%s", err.text);
    return c;
}

static void must_refuse(const void *data, size_t len, const char *expected)
{
    struct cloud c;
    struct sh_err err;
    int rc = read_cloud("bad.ply", data, len, &c, &err);
    if (rc != SH_EINPUT || c.xyz_m != NULL || c.n != 0) fail_msg("for '%s': returned %d", expected, rc);
    if (!strstr(err.text, "bad.ply") || !strstr(err.text, expected) || strchr(err.text, '\n'))
        fail_msg("'%s' doesn't say '%s' in one line", err.text, expected);
}

/* The same three points in every encoding: properties out of order, some unknown ones, an element before and after. */
#define BODY                                                                                       \
    "comment made by a test\ncomment epsg 32633\nelement camera 1\nproperty float f\n"             \
    "element vertex 3\nproperty ushort label\nproperty double z\nproperty list uchar short tags\n" \
    "property uchar echo\nproperty double x\nproperty float reflectance\nproperty double y\n"      \
    "property int station\nelement face 1\nproperty list uchar int any\nend_header\n"

static const struct {
    double x, y, z;
    int station, label, echo, n_tags;
} POINT[3] = {
    {391438.3219301, 5819725.4599562, 114.6983941, 2, 300, 1, 2},
    {-0.1, 1e-300, 1.0 / 3.0, 65535, 0, 15, 0},
    {NAN, NAN, NAN, 1, 65535, 0, 1},
};

struct bytes {
    char data[2048];
    size_t n;
    bool big;
};

static void put(struct bytes *b, const void *value, size_t size)
{
    for (size_t i = 0; i < size; i++)
        b->data[b->n++] = ((const char *)value)[b->big ? size - 1 - i : i]; /* the host is little-endian */
}

#define PUT(b, type, value) put(b, &(type){(type)(value)}, sizeof(type))

static void make_binary(struct bytes *b, bool big)
{
    b->big = big;
    b->n = (size_t)sprintf(b->data, "ply\nformat binary_%s_endian 1.0\n" BODY, big ? "big" : "little");
    PUT(b, float, 1.5);
    for (int i = 0; i < 3; i++) {
        PUT(b, uint16_t, POINT[i].label);
        PUT(b, double, POINT[i].z);
        PUT(b, uint8_t, POINT[i].n_tags);
        for (int k = 0; k < POINT[i].n_tags; k++)
            PUT(b, int16_t, -7);
        PUT(b, uint8_t, POINT[i].echo);
        PUT(b, double, POINT[i].x);
        PUT(b, float, -12.5);
        PUT(b, double, POINT[i].y);
        PUT(b, int32_t, POINT[i].station);
    }
    PUT(b, uint8_t, 1);
    PUT(b, int32_t, 99);
}

static void make_text(struct bytes *b)
{
    b->n = (size_t)sprintf(b->data, "ply\nformat ascii 1.0\n" BODY "1.5\n");
    for (int i = 0; i < 3; i++) {
        b->n += (size_t)sprintf(b->data + b->n, "%d %.17g %d ", POINT[i].label, POINT[i].z, POINT[i].n_tags);
        for (int k = 0; k < POINT[i].n_tags; k++)
            b->n += (size_t)sprintf(b->data + b->n, "-7 ");
        b->n += (size_t)sprintf(b->data + b->n, "%d %.17g -12.5 %.17g %d\r\n", POINT[i].echo, POINT[i].x, POINT[i].y,
                                POINT[i].station);
    }
    b->n += (size_t)sprintf(b->data + b->n, "1 99\n\n");
}

static void check_points(struct cloud c)
{
    assert_int_equal(c.n, 3);
    assert_int_equal(c.epsg, 32633);
    for (int i = 0; i < 3; i++) {
        const double expected[3] = {POINT[i].x, POINT[i].y, POINT[i].z};
        for (int k = 0; k < 3; k++)
            assert_true(c.xyz_m[i][k] == expected[k] || (isnan(c.xyz_m[i][k]) && isnan(expected[k])));
        assert_int_equal(c.station[i], POINT[i].station);
        assert_int_equal(c.label[i], POINT[i].label);
        assert_int_equal(c.echo[i], POINT[i].echo);
    }
    assert_int_equal(n_warnings, 2);
    assert_non_null(strstr(warnings, "element 'camera' (1 of them) is not used"));
    assert_non_null(strstr(warnings, "element 'face' (1 of them) is not used"));
    cloud_free(&c);
}

static void all_encodings_are_read(void **state)
{
    (void)state;
    struct bytes b;
    for (int big = 0; big < 2; big++) {
        make_binary(&b, big);
        check_points(must_read("points.ply", b.data, b.n));
        for (size_t len = 0; len < b.n; len++)
            must_refuse(b.data, len, "");
    }
    make_text(&b);
    check_points(must_read("points.ply", b.data, b.n));
}

#define TEXT "ply\nformat ascii 1.0\n"
#define XYZ  "property float x\nproperty float y\nproperty float z\n"

static void what_is_missing_is_told_apart(void **state)
{
    (void)state;
    static const char bare[] = TEXT "comment epsg none\nelement vertex 2\n" XYZ "end_header\n1 2 3\n4 5 6";
    struct cloud c = must_read("bare.ply", bare, sizeof bare - 1);
    assert_int_equal(c.n, 2);
    assert_null(c.station);
    assert_null(c.label);
    assert_null(c.echo);
    assert_int_equal(c.epsg, CLOUD_EPSG_UNKNOWN);
    assert_true(c.xyz_m[1][2] == 6);
    assert_int_equal(n_warnings, 0);
    cloud_free(&c);
    static const char none[] = TEXT "element vertex 0\n" XYZ "end_header\n";
    c = must_read("none.ply", none, sizeof none - 1);
    assert_int_equal(c.n, 0);
    cloud_free(&c);
}

/* Columns are read only where they are asked for. A second column of a name doesn't count. */
static void columns_are_read_where_asked_for(void **state)
{
    (void)state;
    static const char text[] =
        TEXT "element vertex 2\n" XYZ "property double scalar_time\nproperty double time\nproperty double range\n"
             "property float reflectance\nproperty uchar echo_count\nend_header\n"
             "1 2 3 4.5 9 3.75 -6.5 2\n1 2 3 5.5 9 nan nan 0\n";
    struct cloud c = must_read("columns.ply", text, sizeof text - 1);
    assert_true(c.time_s == NULL && c.range_m == NULL && c.reflectance_db == NULL && c.echo_count == NULL);
    cloud_free(&c);
    struct sh_err err;
    const unsigned all = 1u << CLOUD_TIME | 1u << CLOUD_RANGE | 1u << CLOUD_REFLECTANCE | 1u << CLOUD_ECHO_COUNT;
    assert_int_equal(cloud_read_columns(write_file("columns.ply", text, sizeof text - 1), all, &report, &c, &err),
                     SH_OK);
    unlink(path);
    assert_true(c.time_s[0] == 4.5 && c.time_s[1] == 5.5);
    assert_true(c.range_m[0] == 3.75f && isnan(c.range_m[1]) && c.reflectance_db[0] == -6.5f);
    assert_true(c.echo_count[0] == 2 && c.echo_count[1] == 0);
    assert_true(c.count_m == 1e-6); /* six decimals; floats of 3 m are finer */
    cloud_free(&c);
}

static void malformed_files_are_refused(void **state)
{
    (void)state;
    static const struct {
        const char *text, *expected;
    } table[] = {
        {"", "not a PLY file"},
        {"solid ply", "not a PLY file and not a LAS file"},
        {"ply2\n", "not a PLY file: the first line"},
        {TEXT, "ends in the header"},
        {TEXT "element face 0\nproperty list uchar int vertex_indices\nend_header\n", "no element vertex"},
        {TEXT "element vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n",
         "lacks one of the properties x, y, z"},
        {TEXT "element vertex 1\nproperty list uchar float x\nproperty float y\nproperty float "
              "z\nend_header\n1 1 2 3\n",
         "lacks one of the properties x, y, z"},
        {TEXT "element vertex 0\n" XYZ "property int label\nproperty int label\nend_header\n", "twice: 'label'"},
        {TEXT "element vertex 0\n" XYZ "element vertex 0\n" XYZ "end_header\n", "vertex is given twice"},
        {TEXT "element vertex 100000000000000000\n" XYZ "end_header\n1 2 3\n", "100000000000000000 elements vertex"},
        {TEXT "element vertex 3\n" XYZ "end_header\n1 2 3\n4 5 6\n", "3 elements vertex need"},
        {TEXT "element vertex 2\n" XYZ "end_header\n1 2 3000000\n", "line 9: vertex 2 of 2: the file ends before it"},
        {TEXT "element vertex 1\n" XYZ "end_header\n1 2\n3\n", "line 8: vertex 1 of 1: a value is missing"},
        {TEXT "element vertex 1\n" XYZ "end_header\n1 2 3 4\n", "there are more values"},
        {TEXT "element vertex 1\n" XYZ "end_header\n1 2 3m\n", "not a number"},
        {TEXT "element vertex 1\n" XYZ "end_header\n1 inf 3\n", "line 8: vertex 1 of 1: (1 inf 3) is not a position"},
        {TEXT "element vertex 1\n" XYZ "end_header\nnan nan 3\n", "(nan nan 3) is not a position"},
        {TEXT "element vertex 1\n" XYZ "property int station\nend_header\n1 2 3 0\n", "station 0; allowed are whole"},
        {TEXT "element vertex 1\n" XYZ "property int station\nend_header\n1 2 3 65536\n", "from 1 to 65535"},
        {TEXT "element vertex 1\n" XYZ "property float label\nend_header\n1 2 3 0.5\n", "label 0.5; allowed"},
        {TEXT "element vertex 1\n" XYZ "property float label\nend_header\n1 2 3 nan\n", "label nan; allowed"},
        {TEXT "element vertex 1\n" XYZ "property char echo\nend_header\n1 2 3 -1\n", "echo -1; allowed"},
    };
    for (size_t i = 0; i < LENGTH(table); i++)
        must_refuse(table[i].text, strlen(table[i].text), table[i].expected);
    struct cloud c;
    struct sh_err err;
    assert_int_equal(cloud_read_columns("/nowhere/at all.ply", 0, NULL, &c, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "/nowhere/at all.ply"));
    assert_int_equal(cloud_read_columns(folder, 0, NULL, &c, &err), SH_EINPUT);
}

/* A few bytes of a good file are changed. The result is points or one line of error, for any bytes. The sanitizers
 * judge the rest. */
static void broken_bytes_do_no_harm(void **state)
{
    (void)state;
    int n_refused = 0;
    srand(3);
    for (int i = 0; i < 3000; i++) {
        struct bytes b;
        struct cloud c;
        struct sh_err err;
        if (i % 3 == 0)
            make_text(&b);
        else
            make_binary(&b, i % 3 == 2);
        for (int k = rand() % 4; k >= 0; k--)
            b.data[(size_t)rand() % b.n] = (char)(rand() % 2 ? rand() : "0123456789 -\n"[rand() % 13]);
        int rc = read_cloud("broken.ply", b.data, b.n, &c, &err);
        if (rc != SH_OK && (rc != SH_EINPUT || c.xyz_m != NULL || err.text[0] == '\0' || strchr(err.text, '\n')))
            fail_msg("round %d: returned %d, '%s'", i, rc, err.text);
        n_refused += rc != SH_OK;
        cloud_free(&c);
    }
    assert_in_range(n_refused, 300, 2700); /* both results occurred */
}

static void losses_of_the_file_are_told(void **state)
{
    (void)state;
    struct bytes b = {.big = true};
    b.n = (size_t)sprintf(b.data, "ply\nformat binary_big_endian 1.0\nelement vertex 1\n" XYZ "end_header\n");
    PUT(&b, float, 391438.25);
    PUT(&b, float, 5819725.5);
    PUT(&b, float, 1);
    PUT(&b, char, 'x');
    struct cloud c = must_read("float.ply", b.data, b.n);
    assert_int_equal(n_warnings, 2);
    assert_non_null(strstr(warnings, "1 bytes after the last element"));
    assert_non_null(strstr(warnings, "single precision, with errors up to 0.35 m")); /* 5819725.5 * 6e-8 */
    cloud_free(&c);
}

/* Degrees as float: 179 degrees of 111,320 m, with a relative error of 6e-8. */
static void test_degrees_as_float(void **state)
{
    (void)state;
    static const char head[] = "ply\nformat binary_little_endian 1.0\ncomment epsg 4979\nelement vertex 1\n"
                               "property float x\nproperty float y\nproperty float z\nend_header\n";
    struct bytes b = {.n = 0};
    memcpy(b.data, head, sizeof head - 1);
    b.n = sizeof head - 1;
    PUT(&b, float, 47);
    PUT(&b, float, 179);
    PUT(&b, float, 100);
    struct cloud c = must_read("a.ply", b.data, b.n);
    assert_non_null(strstr(warnings, "single precision, with errors up to 1.2 m"));
    assert_true(fabs(c.count_m - 2.39) < 0.01);
    cloud_free(&c);
}

/* The names are CloudCompare's for scalar fields, which our recorder writes on request. */
static void test_scalar_names(void **state)
{
    (void)state;
    static const char text[] = "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\n"
                               "property double z\nproperty uchar scalar_echo\nproperty ushort scalar_label\n"
                               "property ushort scalar_station\nproperty uchar red\nend_header\n1 2 3 4 5 6 7\n";
    struct cloud c = must_read("a.ply", text, sizeof text - 1);
    assert_non_null(c.station);
    assert_non_null(c.label);
    assert_non_null(c.echo);
    assert_true(c.station[0] == 6 && c.label[0] == 5 && c.echo[0] == 4);
    cloud_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_scalar_names),
        cmocka_unit_test(test_degrees_as_float),
        cmocka_unit_test(all_encodings_are_read),
        cmocka_unit_test(what_is_missing_is_told_apart),
        cmocka_unit_test(columns_are_read_where_asked_for),
        cmocka_unit_test(malformed_files_are_refused),
        cmocka_unit_test(broken_bytes_do_no_harm),
        cmocka_unit_test(losses_of_the_file_are_told),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
