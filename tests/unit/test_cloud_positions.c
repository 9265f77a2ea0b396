/* SPDX-License-Identifier: MIT */
/* Points of software that is not ours: PCD as the Point Cloud Library documents it, and text. The expected bytes follow
 * the library's page "The PCD file format", and for LZF the format of liblzf: both are packed here by hand. */
#include <math.h>

#include "core/bytes.h"
#include "core/studio/cloud.h"
#include "tests/unit/scene_files.h"

static int try(const void *data, size_t len, struct cloud *cloud, struct sh_err *err)
{
    const struct sh_report report = {.warn = keep_warning};
    warnings[0] = '\0';
    const int rc = cloud_read_positions(write_file("points", data, len), &report, cloud, err);
    unlink(path);
    return rc;
}

static void expect(const void *data, size_t len, size_t n, const double (*xyz)[3], int is_text)
{
    struct cloud cloud;
    struct sh_err err;
    if (try(data, len, &cloud, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(cloud.n, n);
    assert_int_equal(cloud.is_text, is_text);
    for (size_t i = 0; i < n; i++)
        for (int k = 0; k < 3; k++)
            if (!(isnan(xyz[i][k]) && isnan(cloud.xyz_m[i][k])))
                assert_true(fabs(cloud.xyz_m[i][k] - xyz[i][k]) <= 0.0);
    cloud_free(&cloud);
}

static void expect_error(const void *data, size_t len, const char *says)
{
    struct cloud cloud;
    struct sh_err err;
    assert_int_equal(try(data, len, &cloud, &err), SH_EINPUT);
    if (strstr(err.text, says) == NULL) fail_msg("'%s' is not in: %s", says, err.text);
}

static const double TWO[2][3] = {{1.5, -2.25, 3.125}, {-0.5, 8.0, 0.0}};

static void test_text(void **state)
{
    (void)state;
    static const char *const same[] = {
        "1.5 -2.25 3.125\n-0.5 8 0\n",
        "1.5,-2.25,3.125,77\r\n-0.5,8.0,0,78",
        "1.5;-2.25;3.125\n\n-0.5;8;0\n",
        "\t1.5\t-2.25\t3.125\n# a remark\n-0.5\t8\t0\n",
        "x,y,z\n1.5,-2.25,3.125\n-0.5,8,0\n",
        "t,Z,intensity,X,Y\n9,3.125,1,1.5,-2.25\n10,0,1,-0.5,8\n",
        "# x y z\n1.5 -2.25 3.125\n-0.5 8 0\n",
        "#t x y z\n7 1.5 -2.25 3.125\n7 -0.5 8 0\n",
        "t,label,x,y,z,i\n1,,1.5,-2.25,3.125,9\n1,wall north,-0.5,8,0,\n",
        "label x y z\nwall 1.5 -2.25 3.125\nfloor -0.5 8 0\n",
        "1,5;-2,25;3,125\n-0,5 ; 8 ; 0\n",
        "x;y;z\n1,5;-2,25;3,125\n-0,5;8;0;\n",
        "connected to 127.0.0.1\n2 scans\n1.5 -2.25 3.125\n-0.5 8 0\nbye\n",
    };
    for (size_t i = 0; i < sizeof same / sizeof same[0]; i++)
        expect(same[i], strlen(same[i]), 2, TWO, 1);
    const double empty[1][3] = {{NAN, NAN, NAN}};
    expect("nan nan nan\n", 12, 1, empty, 1);
    expect_error("", 0, "no line of it is a point");
    expect_error("hello\n", 6, "no line of it is a point");
    expect_error("x,y,z\n1,,3\n4,5\n", 16, "2: no line has numbers in the columns");
    expect_error("1 2 inf\n", 8, "is not a position");
    expect_error("1 2 3\nnan 2 3\n", 14, "line 2");
    struct cloud cloud;
    struct sh_err err;
    assert_int_equal(cloud_read_positions("/nowhere/a.PTX", NULL, &cloud, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "PTX is not read"));
}

/* The last three of 64 columns are read, and a line of names may have 64, too. The names begin with a # or
 * don't, and a column may be called #. */
static void test_many_columns(void **state)
{
    (void)state;
    static const double one[1][3] = {{1, 2, 3}};
    for (int form = 0; form < 3; form++) {
        char text[1024], *p = text;
        for (int line = 0; line < 2; line++)
            for (int k = 0; k < 64; k++) {
                static const char *const names[] = {"x", "y", "z"};
                const int axis = k >= 61 ? k - 61 : -1;
                if (line == 0)
                    p += sprintf(p, "%s%s", form == 1 && k == 0 ? "#" : "", axis >= 0 ? names[axis] : "c");
                else
                    p += sprintf(p, "%d", axis >= 0 ? axis + 1 : 9);
                *p++ = k == 63 ? '\n' : form == 2 ? ',' : ' ';
            }
        expect(text, (size_t)(p - text), 1, one, 1);
        assert_string_equal(warnings, "");
    }
    /* Any of x, y and z may come first. A # before its name only marks the line. */
    expect("#x y z\n1 2 3\n", 13, 1, one, 1);
    expect("#z y x\n3 2 1\n", 13, 1, one, 1);
    expect("#y z x\n2 3 1\n", 13, 1, one, 1);
    expect("# z y x\n3 2 1\n", 14, 1, one, 1);
    /* One name is no line of names, nor are two. */
    expect("x\n1 2 3\n", 8, 1, one, 1);
    expect("z x\n1 2 3\n", 10, 1, one, 1);
    expect("y z\n1 2 3\n", 10, 1, one, 1);
}

/* One line that is no point may be a title. More such lines are reported, with the first one's number. */
static void test_lines_left_out(void **state)
{
    (void)state;
    expect("title\n1.5 -2.25 3.125\n-0.5 8 0\n", 31, 2, TWO, 1);
    assert_string_equal(warnings, "");
    expect("1.5 -2.25 3.125\n\nwall\n-0.5 8 0\n1 2\n", 35, 2, TWO, 1);
    assert_non_null(strstr(warnings, "2 lines are no points, and are left out; the first is line 3"));
    struct cloud cloud;
    struct sh_err err;
    assert_int_equal(try("hello\nyou\n", 10, &cloud, &err), SH_EINPUT);
    assert_null(strstr(err.text, "line 1")); /* no line is to blame */
}

static size_t put_header(char *to, const char *fields, unsigned n, const char *data)
{
    return (size_t)sprintf(to,
                           "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n%sWIDTH %u\nHEIGHT 1\n"
                           "VIEWPOINT 0 0 0 1 0 0 0\nPOINTS %u\nDATA %s\n",
                           fields, n, n, data);
}

static const char XYZ[] = "FIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n";
/* Another field between them, and doubles. */
static const char MIXED[] = "FIELDS x i y z\nSIZE 8 2 8 8\nTYPE F U F F\nCOUNT 1 2 1 1\n";

static void test_pcd_as_text_and_binary(void **state)
{
    (void)state;
    char text[512];
    size_t len = put_header(text, XYZ, 2, "ascii");
    len += (size_t)sprintf(text + len, "1.5 -2.25 3.125\n-0.5 8 0\n");
    expect(text, len, 2, TWO, 1);
    len = put_header(text, MIXED, 2, "ascii");
    len += (size_t)sprintf(text + len, "1.5 7 7 -2.25 3.125\n-0.5 7 7 8 0\n");
    expect(text, len, 2, TWO, 1);
    len = put_header(text, XYZ, 2, "binary");
    for (int i = 0; i < 6; i++, len += 4)
        memcpy(text + len, &(float){(float)TWO[i / 3][i % 3]}, 4);
    expect(text, len, 2, TWO, 0);
    expect_error(text, len - 1, "cut off");
    len = put_header(text, MIXED, 2, "binary");
    for (int i = 0; i < 2; i++, len += 28) {
        memcpy(text + len, &TWO[i][0], 8);
        memset(text + len + 8, 7, 4);
        memcpy(text + len + 12, &TWO[i][1], 16);
    }
    expect(text, len, 2, TWO, 0);
}

/* Two points: x x y y z z, 24 bytes. All are literals first; then the second pair is taken from the first. */
static void test_pcd_compressed(void **state)
{
    (void)state;
    static const double SAME[2][3] = {{1.5, 1.5, 1.5}, {1.5, 1.5, 1.5}};
    char text[512];
    size_t len = put_header(text, XYZ, 2, "binary_compressed");
    const uint32_t packed = 25, plain = 24;
    memcpy(text + len, &packed, 4);
    memcpy(text + len + 4, &plain, 4);
    text[len + 8] = 23;         /* 24 literals */
    for (int i = 0; i < 6; i++) /* by field */
        memcpy(text + len + 9 + 4 * i, &(float){(float)TWO[i % 2][i / 2]}, 4);
    expect(text, len + 8 + packed, 2, TWO, 0);
    expect_error(text, len + 8 + packed - 1, "cut off");
    text[len + 8] = 24;
    expect_error(text, len + 8 + packed, "damaged");
    /* 4 literals; then 20 bytes from 4 bytes back: length 2 + 7 + 11, distance 1 + 3. */
    const unsigned char back[] = {8, 0, 0, 0, 24, 0, 0, 0, 3, 0, 0, 0xc0, 0x3f, 0xe0, 11, 3};
    memcpy(text + len, back, sizeof back);
    expect(text, len + sizeof back, 2, SAME, 0);
    text[len + 15] = 4; /* before the first byte */
    expect_error(text, len + sizeof back, "damaged");
}

/* The longest run of literals has 32 bytes, and a control of 32 is the shortest copy, of three. The three points of
 * this test have 36 bytes: 32 literals, one more, and a copy of the last three. */
static void test_pcd_runs(void **state)
{
    (void)state;
    static float value[9] = {1, 2, 3, 4, 5, 6, 7, 8, 0}; /* x x x y y y z z z */
    char text[512], big[2048];
    uint8_t bytes[36], packed[64] = {0};
    memset(bytes, 0, sizeof bytes);
    memcpy(bytes, value, sizeof value);
    bytes[32] = 0x40;
    size_t n = 8, len = put_header(text, XYZ, 3, "binary_compressed");
    packed[n++] = 31;
    memcpy(packed + n, bytes, 32);
    n += 32;
    packed[n++] = 0; /* one literal */
    packed[n++] = 0x40;
    packed[n++] = 32; /* three bytes, from 3 back */
    packed[n++] = 3 - 1;
    le_put32(packed, (uint32_t)n - 8);
    le_put32(packed + 4, 36);
    memcpy(bytes + 33, bytes + 30, 3);
    memcpy(text + len, packed, n);
    float last;
    memcpy(&last, bytes + 32, 4);
    const double three[3][3] = {{1, 4, 7}, {2, 5, 8}, {3, 6, (double)last}};
    expect(text, len + n, 3, three, 0);
    /* The x of 80 points are literals. y and z are copies from 320 bytes back, each of up to 264 bytes, the most. */
    static double same[80][3];
    len = put_header(big, XYZ, 80, "binary_compressed");
    n = len + 8;
    for (int i = 0; i < 80; i++) {
        const float x = 1.5f + (float)i;
        if (i % 8 == 0) big[n++] = 31;
        memcpy(big + n, &x, 4);
        n += 4;
        same[i][0] = same[i][1] = same[i][2] = (double)x;
    }
    for (int left = 640; left > 0; left -= 264) {
        big[n++] = (char)(0xe0 | 319 >> 8);
        big[n++] = (char)((left < 264 ? left : 264) - 9);
        big[n++] = 319 & 255;
    }
    le_put32((uint8_t *)big + len, (uint32_t)(n - len - 8));
    le_put32((uint8_t *)big + len + 4, 960);
    expect(big, n, 80, same, 0);
}

/* A point with an infinite x, y or z is no position, as text and in binary. */
static void test_pcd_that_is_no_position(void **state)
{
    (void)state;
    char text[512];
    for (int point = 0; point < 2; point++)
        for (int k = 0; k < 3; k++)
            for (int form = 0; form < 2; form++) {
                size_t len = put_header(text, XYZ, 2, form ? "binary" : "ascii");
                for (int i = 0; i < 6; i++) {
                    const float v = i == 3 * point + k ? INFINITY : 1.0f;
                    if (form)
                        memcpy(text + len, &v, 4), len += 4;
                    else
                        len += (size_t)sprintf(text + len, "%g%c", (double)v, i % 3 == 2 ? '\n' : ' ');
                }
                expect_error(text, len, "is not a position");
            }
    /* Any one of the three axes may be missing. */
    static const char *const two[] = {"FIELDS y z\n", "FIELDS x z\n", "FIELDS x y\n"};
    for (int k = 0; k < 3; k++) {
        char fields[96];
        snprintf(fields, sizeof fields, "%sSIZE 4 4\nTYPE F F\nCOUNT 1 1\n", two[k]);
        size_t len = put_header(text, fields, 1, "ascii");
        len += (size_t)sprintf(text + len, "1 2\n");
        expect_error(text, len, "no fields x, y and z");
    }
}

/* Coordinates in single precision are rounded, by up to 6e-8 of the largest one, and that is said from 0.1 mm on. As
 * text, or in double, they are as they stand. One of the three in single precision is enough. */
static void test_pcd_precision(void **state)
{
    (void)state;
    static const struct {
        const char *fields, *data;
        int size[3], is_single;
        float far;
    } row[] = {{XYZ, "binary", {4, 4, 4}, 1, -5000},
               {XYZ, "binary", {4, 4, 4}, 1, 1000},
               {XYZ, "ascii", {0}, 0, 5000},
               {"FIELDS x y z\nSIZE 8 8 8\nTYPE F F F\nCOUNT 1 1 1\n", "binary", {8, 8, 8}, 0, 5000},
               {"FIELDS x y z\nSIZE 4 8 8\nTYPE F F F\nCOUNT 1 1 1\n", "binary", {4, 8, 8}, 1, 1000},
               {"FIELDS x y z\nSIZE 8 8 4\nTYPE F F F\nCOUNT 1 1 1\n", "binary", {8, 8, 4}, 1, 1000}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        char text[512];
        struct cloud cloud;
        struct sh_err err;
        size_t len = put_header(text, row[i].fields, 1, row[i].data);
        for (int k = 0; k < 3; k++) {
            const double v = k == 1 ? (double)row[i].far : 1;
            if (row[i].size[k] == 4)
                memcpy(text + len, &(float){(float)v}, 4);
            else if (row[i].size[k] == 8)
                memcpy(text + len, &v, 8);
            len += (size_t)(row[i].size[k] > 0 ? row[i].size[k] : sprintf(text + len, "%g ", v));
        }
        assert_int_equal(try(text, len, &cloud, &err), SH_OK);
        assert_int_equal(cloud.is_single, row[i].is_single);
        assert_int_equal(strstr(warnings, "stored in single precision, with errors up to 0.0003 m") != NULL, i == 0);
        /* two units in the last place of a float; a unit is at most 2^-23 of the number */
        if (row[i].is_single) assert_true(fabs(cloud.count_m - 1.2e-7 * fabs((double)row[i].far)) < 1e-12);
        cloud_free(&cloud);
    }
}

/* Without POINTS the sides of the grid count. More after the points is left out with a warning, blank lines without. */
static void test_pcd_counts(void **state)
{
    (void)state;
    static const char old[] = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 1\nHEIGHT 2\nDATA ascii\n"
                              "1.5 -2.25 3.125\n-0.5 8 0\n";
    char text[512];
    expect(old, sizeof old - 1, 2, TWO, 1);
    assert_string_equal(warnings, "");
    size_t len = put_header(text, XYZ, 2, "ascii");
    len += (size_t)sprintf(text + len, "1.5 -2.25 3.125\n-0.5 8 0\n \n\n");
    expect(text, len, 2, TWO, 1);
    assert_string_equal(warnings, "");
    len += (size_t)sprintf(text + len, "1 2 3\n");
    expect(text, len, 2, TWO, 1);
    assert_non_null(strstr(warnings, "goes on after the 2 points"));
    len = put_header(text, XYZ, 2, "binary");
    for (int i = 0; i < 6; i++, len += 4)
        memcpy(text + len, &(float){(float)TWO[i / 3][i % 3]}, 4);
    expect(text, len, 2, TWO, 0);
    assert_string_equal(warnings, "");
    expect(text, len + 1, 2, TWO, 0);
    assert_non_null(strstr(warnings, "goes on after the 2 points"));
    static const char NO_COUNT[] = "VERSION .7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nDATA ascii\n1 2 3\n";
    expect_error(NO_COUNT, sizeof NO_COUNT - 1, "no line POINTS");
}

/* POINTS counts, whatever the sides of the grid are. */
static void test_pcd_points_count_first(void **state)
{
    (void)state;
    static const struct {
        const char *counts, *error;
    } row[] = {{"POINTS 2\n", NULL},
               {"WIDTH 5\nHEIGHT 7\nPOINTS 2\n", NULL},
               {"POINTS 2\nWIDTH 1\nHEIGHT 1\n", NULL},
               {"WIDTH 2\nHEIGHT 1\n", NULL},
               {"WIDTH 0\nHEIGHT 2\n", "no WIDTH and HEIGHT"},
               {"WIDTH 2\nHEIGHT 0\n", "no WIDTH and HEIGHT"},
               {"WIDTH 2\n", "no WIDTH and HEIGHT"},
               {"WIDTH 6000000000\nHEIGHT 6000000000\n", "cut off"},
               {"WIDTH 4294967296\nHEIGHT 4294967296\n", "cut off"}, /* 2^64 */
               {"POINTS -1\n", "POINTS, WIDTH or HEIGHT is not a whole number"},
               {"WIDTH two\n", "POINTS, WIDTH or HEIGHT is not a whole number"}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        char text[512];
        const int len =
            snprintf(text, sizeof text, "VERSION .7\n%s%sDATA ascii\n1.5 -2.25 3.125\n-0.5 8 0\n", XYZ, row[i].counts);
        if (row[i].error != NULL)
            expect_error(text, (size_t)len, row[i].error);
        else
            expect(text, (size_t)len, 2, TWO, 1);
        assert_string_equal(warnings, "");
    }
}

/* Writes a header with n fields, of which the last three are x, y and z, and the first one has this count. */
static size_t put_fields(char *to, int n, int count)
{
    static const char *const key[] = {"FIELDS", "SIZE", "TYPE", "COUNT"};
    char *p = to + sprintf(to, "VERSION .7\n");
    for (int line = 0; line < 4; line++) {
        p += sprintf(p, "%s", key[line]);
        for (int i = 0; i < n; i++) {
            const int axis = i - (n - 3);
            if (line == 0)
                p += sprintf(p, " %s", axis == 0 ? "x" : axis == 1 ? "y" : axis == 2 ? "z" : "c");
            else if (line == 2)
                p += sprintf(p, " %c", axis >= 0 ? 'F' : 'U');
            else
                p += sprintf(p, " %d", line == 3 ? (i == 0 ? count : 1) : axis >= 0 ? 4 : 1);
        }
        *p++ = '\n';
    }
    return (size_t)(p - to) + (size_t)sprintf(p, "POINTS 1\nDATA binary\n");
}

/* There are up to 64 fields, with up to 4096 values. */
static void test_pcd_limits(void **state)
{
    (void)state;
    static const struct {
        int fields, count;
        const char *error;
    } row[] = {{64, 1, NULL},
               {65, 1, "more than 64 fields"},
               {4, 4096, NULL},
               {4, 4097, "a size or count is not a number from 1 to 4096"},
               {4, 0, "a size or count is not a number from 1 to 4096"},
               {3, 2, "x, y and z are not TYPE F of SIZE 4 or 8 and COUNT 1"}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        static char text[8192];
        size_t len = put_fields(text, row[i].fields, row[i].count);
        const size_t others = row[i].fields == 3 ? 4 : (size_t)(row[i].fields - 4 + row[i].count);
        memset(text + len, 7, others);
        len += others;
        for (int k = 0; k < 3; k++, len += 4)
            memcpy(text + len, &(float){(float)TWO[0][k]}, 4);
        if (row[i].error != NULL)
            expect_error(text, len, row[i].error);
        else
            expect(text, len, 1, TWO, 0);
        assert_string_equal(warnings, "");
    }
}

static void test_pcd_that_is_wrong(void **state)
{
    (void)state;
    char text[512];
    expect_error("# .PCD v0.7\nVERSION 0.7\n", 24, "no line DATA");
    size_t len = put_header(text, "FIELDS x y\nSIZE 4 4\nTYPE F F\nCOUNT 1 1\n", 1, "ascii");
    expect_error(text, len, "no fields x, y and z");
    len = put_header(text, "FIELDS x y z\nSIZE 2 2 2\nTYPE I I I\nCOUNT 1 1 1\n", 1, "ascii");
    expect_error(text, len, "TYPE F");
    len = put_header(text, "FIELDS x y z i\nSIZE 4 4 4\nTYPE F F F F\nCOUNT 1 1 1 1\n", 1, "binary");
    memset(text + len, 0, 16);
    expect_error(text, len + 16, "fewer numbers in SIZE");
    len = put_header(text, XYZ, 1, "zip");
    expect_error(text, len, "neither ascii");
    len = put_header(text, XYZ, 2, "ascii");
    len += (size_t)sprintf(text + len, "1 2 3\n");
    expect_error(text, len, "not as many numbers");
    len = put_header(text, XYZ, 4000000000u, "binary_compressed");
    memset(text + len, 0, 8);
    expect_error(text, len + 8, "fewer points");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_text),
        cmocka_unit_test(test_many_columns),
        cmocka_unit_test(test_lines_left_out),
        cmocka_unit_test(test_pcd_as_text_and_binary),
        cmocka_unit_test(test_pcd_compressed),
        cmocka_unit_test(test_pcd_runs),
        cmocka_unit_test(test_pcd_that_is_no_position),
        cmocka_unit_test(test_pcd_precision),
        cmocka_unit_test(test_pcd_counts),
        cmocka_unit_test(test_pcd_points_count_first),
        cmocka_unit_test(test_pcd_limits),
        cmocka_unit_test(test_pcd_that_is_wrong),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
