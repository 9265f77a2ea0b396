/* SPDX-License-Identifier: MIT */
/* Colours, ranges and reflectances of recorded clouds. */
#include <math.h>

#include "core/studio/cloud.h"
#include "tests/unit/scene_files.h"

static struct cloud read_cloud(const char *name, const void *data, size_t len)
{
    struct cloud c;
    struct sh_err err = {0, ""};
    if (cloud_read_columns(write_file(name, data, len), 1u << CLOUD_RANGE | 1u << CLOUD_REFLECTANCE | 1u << CLOUD_RGB,
                           NULL, &c, &err) != SH_OK)
        fail_msg("%s", err.text);
    unlink(path);
    return c;
}

static void test_ply(void **state)
{
    (void)state;
    static const char text[] = "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty uchar blue\n"
                               "property double y\nproperty uchar red\nproperty double z\nproperty double range\n"
                               "property uchar green\nproperty float scalar_reflectance\nend_header\n"
                               "1 30 2 10 3 12.5 20 -7.25\n4 255 5 0 6 nan 1 nan\n";
    struct cloud c = read_cloud("a.ply", text, sizeof text - 1);
    assert_int_equal(c.n, 2);
    assert_memory_equal(c.rgb[0], ((const uint8_t[3]){10, 20, 30}), 3);
    assert_memory_equal(c.rgb[1], ((const uint8_t[3]){0, 1, 255}), 3);
    assert_true(c.range_m[0] == 12.5f && isnan(c.range_m[1]));
    assert_true(c.reflectance_db[0] == -7.25f && isnan(c.reflectance_db[1]));
    assert_true(c.xyz_m[1][0] == 4 && c.xyz_m[1][1] == 5 && c.xyz_m[1][2] == 6);
    cloud_free(&c);
    assert_null(c.rgb);
}

/* Colours that are not bytes, or not three, are ignored. */
static void test_no_colours(void **state)
{
    (void)state;
    static const char *const types[] = {"property float red\nproperty float green\nproperty float blue\n",
                                        "property uchar red\nproperty uchar green\nproperty uchar alpha\n"};
    for (int i = 0; i < 2; i++) {
        char text[400];
        snprintf(text, sizeof text,
                 "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\nproperty double z\n"
                 "%send_header\n1 2 3 0 0 0\n",
                 types[i]);
        struct cloud c = read_cloud("b.ply", text, strlen(text));
        assert_null(c.rgb);
        assert_null(c.range_m);
        assert_null(c.reflectance_db);
        cloud_free(&c);
    }
}

static void put(uint8_t *at, uint64_t v, int bytes)
{
    for (int i = 0; i < bytes; i++)
        at[i] = (uint8_t)(v >> 8 * i);
}

/* LAS 1.4, formats with colours and two without: offsets as in tables of the ASPRS specification. */
static void test_las(void **state)
{
    (void)state;
    const struct {
        int format, length, rgb_at;
    } formats[] = {{0, 20, 0}, {2, 26, 20}, {3, 34, 28}, {5, 63, 28},
                   {6, 30, 0}, {7, 36, 30}, {8, 38, 30}, {10, 67, 30}};
    for (size_t i = 0; i < sizeof formats / sizeof formats[0]; i++) {
        uint8_t las[375 + 67] = "LASF";
        const double scale = 0.5;
        las[24] = 1;
        las[25] = 4;
        put(las + 94, 375, 2);
        put(las + 96, 375, 4);
        las[104] = (uint8_t)formats[i].format;
        put(las + 105, (uint64_t)formats[i].length, 2);
        put(las + 247, 1, 8);
        for (int k = 0; k < 3; k++) {
            memcpy(las + 131 + 8 * k, &scale, 8);
            put(las + 375 + 4 * k, (uint64_t)(10 + k), 4);
            if (formats[i].rgb_at) put(las + 375 + formats[i].rgb_at + 2 * k, (uint64_t)(0x1234 + 0x1100 * k), 2);
        }
        struct cloud c = read_cloud("c.las", las, 375 + (size_t)formats[i].length);
        assert_int_equal(c.n, 1);
        assert_true(c.xyz_m[0][0] == 5 && c.xyz_m[0][1] == 5.5 && c.xyz_m[0][2] == 6);
        assert_int_equal(c.rgb != NULL, formats[i].rgb_at != 0);
        if (c.rgb != NULL) assert_memory_equal(c.rgb[0], ((const uint8_t[3]){0x12, 0x23, 0x34}), 3);
        cloud_free(&c);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ply),
        cmocka_unit_test(test_no_colours),
        cmocka_unit_test(test_las),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
