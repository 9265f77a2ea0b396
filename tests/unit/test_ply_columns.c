/* SPDX-License-Identifier: MIT */
/* The columns of the PLY recorder: those left out, floats, names for CloudCompare, colours. */
#include <math.h>

#include "tests/unit/ply_rig.h"

/* The rows are those of the whole file, without the columns that are left out: byte for byte the same, and as float. */
static void test_columns(void **state)
{
    (void)state;
    enum { ROW = 8 + 2 + 2, FLOAT_ROW = 4 * 4 }; /* range, echo and its count, station; xyz and range as float */
    struct sh_err err;
    unsigned columns;
    uint8_t all[4 * RECORD];
    assert_true(ply_columns_read("range,echo,station", &columns));
    begin_stream();
    put_descriptor(0, 1, 0); /* polar: in the scene's frame, near its origin */
    put_anchor(NATIVE_CRS_UTM, 32632, 1);
    put_points(0);
    assert_int_equal(record(out_path, (struct recorder_options){0}, 1, &err), 0);
    slurp(out_path);
    memcpy(all, text + text_len - sizeof all, sizeof all);
    assert_int_equal(record(out_path, (struct recorder_options){.columns = columns}, 1, &err), 0);
    slurp(out_path);
    assert_non_null(strstr(text, "property double z\nproperty double range\nproperty uchar echo\n"
                                 "property uchar echo_count\nproperty ushort station\nend_header\n"));
    for (int i = 0; i < 4; i++) {
        const uint8_t *row = (const uint8_t *)text + text_len - (size_t)(4 - i) * (24 + ROW), *whole = all + i * RECORD;
        assert_memory_equal(row, whole, 32);          /* x, y, z, range */
        assert_memory_equal(row + 32, whole + 44, 2); /* after reflectance and time */
        assert_memory_equal(row + 34, whole + 48, 2);
    }
    assert_true(ply_columns_read("float,range", &columns));
    assert_int_equal(record(out_path, (struct recorder_options){.columns = columns}, 1, &err), 0);
    slurp(out_path);
    for (int i = 0; i < 4; i++)
        for (int k = 0; k < 4; k++) {
            double want;
            float got;
            memcpy(&want, all + i * RECORD + 8 * k, 8);
            memcpy(&got, text + text_len - (size_t)(4 - i) * FLOAT_ROW + 4 * k, 4);
            assert_true(got == (float)want);
        }
}

/* Far from the origin a float is too coarse. */
static void test_float_far_away(void **state)
{
    (void)state;
    struct sh_err err;
    unsigned columns;
    assert_false(ply_columns_read("range,", &columns));
    assert_false(ply_columns_read("range,range", &columns));
    assert_false(ply_columns_read("", &columns));
    assert_true(ply_columns_read("xyz,float", &columns));
    begin_stream();
    put_surfaces(0, 3, NULL);
    put_descriptor(1, 1, 3);
    put_anchor(NATIVE_CRS_UTM, 32632, 2);
    put_points(0);
    assert_int_equal(record(out_path, (struct recorder_options){.columns = columns}, 1, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "leave out float"));

    /* The head starts at the origin and moves: INT32_MAX counts of 10 micrometres. */
    const struct native_anchor origin = {
        .scale_m = 1e-5, .moving = NATIVE_MOVING, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1}};
    begin_stream();
    put_descriptor(1, 1, 0);
    put(native_encode_anchor(out, sizeof out, &origin, 0, 0));
    put_points(0);
    assert_int_equal(record(out_path, (struct recorder_options){.columns = columns}, 1, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "coordinates of 21475 m as float would be wrong by up to 0.0013 m"));

    /* One far point is enough, the first of its frame or the last. */
    for (int far = 0; far < N; far += N - 1) {
        begin_stream();
        put_descriptor(1, 1, 0);
        put(native_encode_anchor(out, sizeof out, &origin, 0, 0));
        for (int i = 0; i < N; i++)
            a[i] = b[i] = c[i] = i == far ? 200000000 : 0;
        put_points(0);
        assert_int_equal(record(out_path, (struct recorder_options){.columns = columns}, 1, &err), SH_EINPUT);
        assert_non_null(strstr(err.text, "coordinates of 2000 m as float"));
    }
}

static void test_cloudcompare(void **state)
{
    (void)state;
    struct sh_err err;
    uint8_t rgb[3];
    begin_stream();
    put_surfaces(0, 3, NULL);
    put_descriptor(1, 1, 3);
    put_anchor(NATIVE_CRS_UTM, 32632, 2);
    put_points(0);
    struct recorder_options options = {.scalar_names = 1, .colour = {.given = 1, .scale.mode = COLOUR_LABEL}};
    assert_int_equal(record(out_path, options, 1, &err), 0);
    slurp(out_path);
    const char *header = strstr(text, "element vertex 4\n");
    static const char want[] =
        "property double x\nproperty double y\nproperty double z\nproperty double scalar_range\n"
        "property float scalar_reflectance\nproperty double scalar_time\nproperty uchar scalar_echo\n"
        "property uchar scalar_echo_count\nproperty ushort scalar_label\nproperty ushort scalar_station\n"
        "property uchar red\nproperty uchar green\nproperty uchar blue\nend_header\n";
    assert_non_null(header);
    header = strchr(header, '\n') + 1;
    assert_memory_equal(header, want, sizeof want - 1);
    size_t at = (size_t)(header - text) + sizeof want - 1;
    assert_int_equal(text_len, at + 4 * (RECORD + 3));
    for (int i = 0; i < 4; i++) {
        colour_number(label[i < 3 ? i : 4], rgb);
        assert_memory_equal(text + at + (size_t)i * (RECORD + 3) + RECORD, rgb, 3);
    }
}

/* Black is -30 dB and white 0, with even steps between. A reflectance that is not modelled has no grey. */
static void test_colours(void **state)
{
    (void)state;
    static const struct {
        double db;
        uint8_t grey;
    } cases[] = {{-40, 0}, {-30, 0}, {-15, 128}, {0, 255}, {20, 255}};
    uint8_t rgb[3], other[3];
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        colour_reflectance(cases[i].db, rgb);
        for (int k = 0; k < 3; k++)
            assert_int_equal(rgb[k], cases[i].grey);
    }
    colour_reflectance((double)NAN, rgb);
    assert_true(rgb[2] > rgb[0]);
    for (uint16_t i = 0; i < 1000; i++) { /* neighbours in number differ: 137 degrees of hue apart */
        int most = 0;
        colour_number(i, rgb);
        colour_number(i + 1u, other);
        for (int k = 0; k < 3; k++)
            most = abs(rgb[k] - other[k]) > most ? abs(rgb[k] - other[k]) : most;
        assert_true(most > 100);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_columns),
        cmocka_unit_test(test_float_far_away),
        cmocka_unit_test(test_cloudcompare),
        cmocka_unit_test(test_colours),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
