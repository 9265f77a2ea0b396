/* SPDX-License-Identifier: MIT */
/* Points of software that is not ours: PCD as the Point Cloud Library documents it, and text. The expected bytes follow
 * the library's page "The PCD file format", and for LZF the format of liblzf: both are packed here by hand. */
#include <math.h>

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

/* Without POINTS the sides of the grid count. What follows the points is left out with a word, but blank lines. */
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
        cmocka_unit_test(test_pcd_as_text_and_binary),
        cmocka_unit_test(test_pcd_compressed),
        cmocka_unit_test(test_pcd_counts),
        cmocka_unit_test(test_pcd_that_is_wrong),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
