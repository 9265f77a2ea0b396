/* SPDX-License-Identifier: MIT */
/* Deviations of echoes, which attributes have where the head finds them in waveforms (WAVEFORMS.md): in LAS as extra
 * bytes, in PLY as a column. */
#include "tests/unit/waves_rig.h"

enum { ATTRIBUTES = 1, DEVIATIONS = 8 };

static const struct rig_point points[] = {{5000, 0, 0, -1000, 1, 1, 1},
                                          {6000, 0, 0, -1000, 2, 1, 1},
                                          {7000, 0, 0, -1000, 3, 1, 1},
                                          {8000, 0, 0, -1000, 4, 1, 1}};
static const uint16_t deviation[] = {0, 1234, 65534, 65535}; /* in 1/1000 */
enum { N = 4 };

/* Frame 9: pulse0, line, n; amplitude and width of each; their deviations. */
static void put_attributes(int has_deviations)
{
    static uint8_t out[28 + 16 + 6 * N];
    const size_t len = 16 + (has_deviations ? 6 : 4) * (size_t)N;
    memset(out, 0, sizeof out);
    out[0] = 0xd5;
    out[1] = 9;
    out[2] = 1;
    le_put32(out + 4, (uint32_t)len);
    le_put32(out + 28 + 12, N);
    for (size_t i = 0; i < N; i++) {
        le_put16(out + 28 + 16 + 4 * i, 1000);
        le_put16(out + 28 + 16 + 4 * i + 2, 500);
        if (has_deviations) le_put16(out + 28 + 16 + 4 * N + 2 * i, deviation[i]);
    }
    native_reseal(out, 28 + len);
    rig_put(out, 28 + len);
}

/* Records a stream; lost: the frame of attributes does not come. */
static uint8_t *record(const char *name, uint32_t content, int lost, int ascii)
{
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    rig_begin();
    rig_wave_descriptor(0, 1, content);
    rig_anchor(&a);
    rig_points(0, 0, 0, points, N);
    if (!lost) put_attributes((content & DEVIATIONS) != 0);
    return rig_record_bytes(name, (struct recorder_options){.ascii = ascii}, NULL);
}

/* The extra bytes after format 6 are label, amplitude, width, deviation. 65535 says that it is lost, so the largest one
 * is 65534. */
static void test_las(void **state)
{
    (void)state;
    for (int lost = 0; lost < 2; lost++) {
        uint8_t *las = record("a.las", ATTRIBUTES | DEVIATIONS, lost, 0);
        const uint8_t *extra = las + 375 + 54 + 3 * 192, *p = las + rig_uint(las + 96, 4) + 36;
        assert_int_equal(rig_uint(las + 375 + 20, 2), 4 * 192);
        assert_int_equal(extra[2], 3); /* unsigned short */
        assert_int_equal(extra[3], 1 << 0 | 1 << 3);
        assert_string_equal((const char *)extra + 4, "deviation");
        assert_int_equal(rig_uint(extra + 40, 8), 65535);
        assert_true(rig_double(extra + 112) == 0.001);
        assert_int_equal(rig_uint(las + 105, 2), 30 + 2 + 4 + 2);
        for (int i = 0; i < N; i++)
            assert_int_equal(rig_uint(p + 38 * i, 2), lost ? 65535 : i == 3 ? 65534 : deviation[i]);
        free(las);
    }
}

static void test_ply(void **state)
{
    (void)state;
    uint8_t *ply = record("a.ply", ATTRIBUTES | DEVIATIONS, 0, 1);
    const char *text = (const char *)ply;
    assert_non_null(strstr(text, "property float width\nproperty float deviation\nend_header"));
    assert_non_null(strstr(text, " 10.00 5.00 0.000\n"));
    assert_non_null(strstr(text, " 10.00 5.00 1.234\n"));
    assert_non_null(strstr(text, " 10.00 5.00 65.535\n"));
    free(ply);
    ply = record("a.ply", ATTRIBUTES | DEVIATIONS, 0, 0);
    const uint8_t *end = (const uint8_t *)strstr((const char *)ply, "end_header\n") + 11;
    const size_t row = 8 * 3 + 8 + 4 + 8 + 2 + 2 + 2 + 12;
    assert_true(rig_float(end + 2 * row - 4) == 1.234f);
    free(ply);
    ply = record("a.ply", ATTRIBUTES, 0, 1);
    assert_null(strstr((const char *)ply, "deviation"));
    free(ply);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_las),
        cmocka_unit_test(test_ply),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
