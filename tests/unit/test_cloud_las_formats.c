/* SPDX-License-Identifier: MIT */
/* All point formats of LAS, by files that are made here after ASPRS's LAS 1.4 R15, tables 7 to 17. */
#include <math.h>

#include "core/bytes.h"
#include "core/studio/cloud.h"
#include "tests/unit/scene_files.h"

enum {
    HEADER_12 = 227,
    HEADER_14 = 375,
    VLR = 54,
    EXTRA = 192,
    N = 2,
    ALL = 1 << CLOUD_TIME | 1 << CLOUD_RGB | 1 << CLOUD_ECHO_COUNT
};

/* Lengths of records, and where GPS time and the colours are; 0: the format has none. */
static const struct {
    unsigned len, time_at, rgb_at;
} format[11] = {{20, 0, 0},  {28, 20, 0},  {26, 0, 20},  {34, 20, 28}, {57, 20, 0}, {63, 20, 28},
                {30, 22, 0}, {36, 22, 30}, {38, 22, 30}, {59, 22, 0},  {67, 22, 30}};

struct made {
    uint8_t byte[4096];
    size_t points_at, len; /* of a record */
    unsigned format;
};

static struct sh_err err;

static void put_double(uint8_t *to, double v)
{
    memcpy(to, &v, sizeof v);
}

/* Two points with the extra bytes that entries describe; `extra` bytes a point. */
static void make(struct made *m, unsigned of, const uint8_t (*entry)[EXTRA], size_t n_entries, size_t extra)
{
    const int is_new = of >= 6;
    const size_t head = is_new ? HEADER_14 : HEADER_12;
    *m = (struct made){.format = of, .len = format[of].len + extra};
    m->points_at = head + (n_entries > 0 ? VLR + EXTRA * n_entries : 0);
    uint8_t *b = m->byte;
    memcpy(b, "LASF", 4);
    b[24] = 1;
    b[25] = (uint8_t)(is_new ? 4 : of >= 4 ? 3 : 2);
    le_put16(b + 94, (uint16_t)head);
    le_put32(b + 96, (uint32_t)m->points_at);
    le_put32(b + 100, n_entries > 0);
    b[104] = (uint8_t)of;
    le_put16(b + 105, (uint16_t)m->len);
    if (is_new)
        le_put64(b + 247, N);
    else
        le_put32(b + 107, N);
    for (int k = 0; k < 3; k++) {
        put_double(b + 131 + 8 * k, 0.25 * (k + 1));
        put_double(b + 155 + 8 * k, 100.0 * (k + 1));
    }
    if (n_entries > 0) {
        memcpy(b + head + 2, "LASF_Spec", 9);
        le_put16(b + head + 18, 4);
        le_put16(b + head + 20, (uint16_t)(EXTRA * n_entries));
        memcpy(b + head + VLR, entry, EXTRA * n_entries);
    }
    for (size_t i = 0; i < N; i++) {
        uint8_t *p = b + m->points_at + i * m->len;
        for (uint32_t k = 0; k < 3; k++)
            le_put32(p + 4 * k, (uint32_t)(int32_t)((i == 0 ? 1 : -8) * (int32_t)(k + 1)));
        /* number and count of returns: 2 of 3, and 4 of 5; of the newer ones 9 of 10, and 11 of 12 */
        p[14] = (uint8_t)(is_new ? (9 + 2 * i) | (10 + 2 * i) << 4 : (2 + 2 * i) | (3 + 2 * i) << 3);
        le_put16(p + (is_new ? 20 : 18), (uint16_t)(0x0102 * (i + 1)));
        if (format[of].time_at > 0) put_double(p + format[of].time_at, 1234.5 + (double)i);
        for (unsigned k = 0; format[of].rgb_at > 0 && k < 3; k++)
            le_put16(p + format[of].rgb_at + 2 * k, (uint16_t)((10 * (i + 1) + k) << 8 | 0x7f));
    }
}

static int read_made(const struct made *m, struct cloud *cloud)
{
    const int rc = cloud_read_columns(write_file("a.las", m->byte, m->points_at + N * m->len),
                                      ALL | 1u << CLOUD_REFLECTANCE, NULL, cloud, &err);
    unlink(path);
    return rc;
}

static void read_ok(const struct made *m, struct cloud *cloud)
{
    if (read_made(m, cloud) != SH_OK) fail_msg("%s", err.text);
}

static void each_format_has_its_places(void **state)
{
    (void)state;
    for (unsigned of = 0; of <= 10; of++) {
        struct made m;
        struct cloud c;
        const unsigned first = of >= 6 ? 9 : 2;
        make(&m, of, NULL, 0, 0);
        read_ok(&m, &c);
        assert_int_equal(c.n, N);
        assert_int_equal(c.time_s != NULL, format[of].time_at > 0);
        assert_int_equal(c.rgb != NULL, format[of].rgb_at > 0);
        /* The intensity of others is no reflectance. The step is the coarsest of the scales. */
        assert_true(c.reflectance_db == NULL && c.label == NULL && !c.has_own_counts && !c.is_text && !c.is_single);
        assert_true(c.count_m == 0.75 && c.epsg == CLOUD_EPSG_UNKNOWN);
        for (unsigned i = 0; i < N; i++) {
            for (int k = 0; k < 3; k++)
                assert_true(c.xyz_m[i][k] == 100.0 * (k + 1) + (i == 0 ? 1 : -8) * (k + 1) * 0.25 * (k + 1));
            assert_int_equal(c.station[i], 0x0102 * (i + 1));
            assert_int_equal(c.echo[i], first + 2 * i);
            assert_int_equal(c.echo_count[i], first + 1 + 2 * i);
            assert_true(c.time_s == NULL || c.time_s[i] == 1234.5 + i);
            for (unsigned k = 0; c.rgb != NULL && k < 3; k++)
                assert_int_equal(c.rgb[i][k], 10 * (i + 1) + k);
        }
        cloud_free(&c);
        m.len--; /* a record shorter than its format */
        le_put16(m.byte + 105, (uint16_t)m.len);
        assert_int_equal(read_made(&m, &c), SH_EINPUT);
        assert_non_null(strstr(err.text, "point records shorter than their format"));
    }
}

/* Types of extra bytes are 1 to 10, with these sizes; type 0 has the size that its options say. */
static void labels_are_found_behind_each_type(void **state)
{
    (void)state;
    static const unsigned size[11] = {5, 1, 1, 2, 2, 4, 4, 8, 8, 4, 8};
    for (unsigned type = 0; type <= 11; type++) {
        uint8_t entry[2][EXTRA] = {{0}};
        struct made m;
        struct cloud c;
        const unsigned before = type <= 10 ? size[type] : 2;
        entry[0][2] = (uint8_t)type;
        entry[0][3] = 5;
        strcpy((char *)entry[0] + 4, "labels"); /* another name */
        entry[1][2] = 3;
        strcpy((char *)entry[1] + 4, "label");
        make(&m, type % 2 ? 7 : 1, (const uint8_t(*)[EXTRA])entry, 2, before + 2);
        for (size_t i = 0; i < N; i++)
            le_put16(m.byte + m.points_at + (i + 1) * m.len - 2, (uint16_t)(40000 + i));
        read_ok(&m, &c);
        assert_int_equal(c.label != NULL, type <= 10); /* of the arrays after them nothing is known */
        assert_true(c.label == NULL || (c.label[0] == 40000 && c.label[1] == 40001));
        cloud_free(&c);
    }
}

/* A label of another type is no label. A label that begins within the record and ends beyond it isn't there. */
static void what_is_no_label(void **state)
{
    (void)state;
    for (int k = 0; k < 3; k++) {
        uint8_t entry[1][EXTRA] = {{0}};
        struct made m;
        struct cloud c;
        entry[0][2] = k == 0 ? 4 : 3;
        strcpy((char *)entry[0] + 4, "label");
        make(&m, 6, (const uint8_t(*)[EXTRA])entry, 1, k == 1 ? 1 : 2);
        read_ok(&m, &c);
        assert_int_equal(c.label != NULL, k == 2);
        cloud_free(&c);
    }
}

/* Point source IDs of 0 are no stations: if all are 0 there are none, and some are an error. */
static void stations_of_zero(void **state)
{
    (void)state;
    struct made m;
    struct cloud c;
    make(&m, 3, NULL, 0, 0);
    le_put16(m.byte + m.points_at + 18, 0);
    assert_int_equal(read_made(&m, &c), SH_EINPUT);
    assert_non_null(strstr(err.text, "some points have the point source ID 0"));
    le_put16(m.byte + m.points_at + m.len + 18, 0);
    read_ok(&m, &c);
    assert_true(c.station == NULL && c.n == N);
    cloud_free(&c);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_format_has_its_places),
        cmocka_unit_test(labels_are_found_behind_each_type),
        cmocka_unit_test(what_is_no_label),
        cmocka_unit_test(stations_of_zero),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
