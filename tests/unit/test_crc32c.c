/* SPDX-License-Identifier: MIT */
#include <pthread.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "drivers/protocol/crc32c.h"

/* Each test gets one of them as its state. */
static struct way {
    uint32_t (*crc)(uint32_t crc, const void *data, size_t len);
    int (*is_here)(void); /* NULL: always */
} dispatch = {crc32c, NULL}, table = {crc32c_table, NULL}, hw = {crc32c_hw, crc32c_has_hw},
  wide = {crc32c_wide, crc32c_has_wide};

/* The values of RFC 3720 appendix B.4 (bytes there are the CRC in little-endian order), and the catalogue's check
 * value. */
static void test_published(void **state)
{
    const struct way *way = *state;
    if (way->is_here != NULL && !way->is_here()) skip();
    uint8_t zeros[32] = {0}, ones[32], up[32], down[32];
    for (int i = 0; i < 32; i++) {
        ones[i] = 0xff;
        up[i] = (uint8_t)i;
        down[i] = (uint8_t)(31 - i);
    }
    static const uint8_t scsi_read[48] = {
        0x01, 0xc0, 0, 0,    0, 0, 0, 0,    0,    0, 0, 0, 0, 0, 0, 0, 0x14, 0, 0, 0, 0, 0, 0x04, 0,
        0,    0,    0, 0x14, 0, 0, 0, 0x18, 0x28, 0, 0, 0, 0, 0, 0, 0, 0x02, 0, 0, 0, 0, 0, 0,    0,
    };
    assert_int_equal(way->crc(0, "123456789", 9), 0xe3069283u);
    assert_int_equal(way->crc(0, zeros, 32), 0x8a9136aau);
    assert_int_equal(way->crc(0, ones, 32), 0x62a8ab43u);
    assert_int_equal(way->crc(0, up, 32), 0x46dd794eu);
    assert_int_equal(way->crc(0, down, 32), 0x113fdb5cu);
    assert_int_equal(way->crc(0, scsi_read, 48), 0xd9963a56u);
    assert_int_equal(way->crc(0, "", 0), 0);
}

/* The definition goes one bit at a time. */
static uint32_t bitwise(uint32_t crc, const uint8_t *p, size_t len)
{
    crc = ~crc;
    for (; len > 0; len--, p++) {
        crc ^= *p;
        for (int bit = 0; bit < 8; bit++)
            crc = crc & 1 ? crc >> 1 ^ 0x82f63b78u : crc >> 1;
    }
    return ~crc;
}

/* Lengths are around the blocks of each way (three lanes of 1008 bytes, or 256 and 64 bytes), with every alignment and
 * running CRCs. */
static void test_lengths(void **state)
{
    static uint8_t data[5000];
    const struct way *way = *state;
    if (way->is_here != NULL && !way->is_here()) skip();
    uint32_t x = 12345;
    for (size_t i = 0; i < sizeof data; i++)
        data[i] = (uint8_t)((x = x * 1664525u + 1013904223u) >> 24);
    for (size_t len = 0; len < 1100; len++)
        assert_int_equal(way->crc(0, data + len % 8, len), bitwise(0, data + len % 8, len));
    for (size_t len = 1990; len < 4100; len += 17)
        assert_int_equal(way->crc(7, data + len % 9, len), bitwise(7, data + len % 9, len));
    uint32_t whole = bitwise(0, data, sizeof data);
    for (size_t cut = 0; cut <= sizeof data; cut += 61)
        assert_int_equal(way->crc(way->crc(0, data, cut), data + cut, sizeof data - cut), whole);
}

static void *table_thread(void *arg)
{
    *(uint32_t *)arg = crc32c_table(0, "123456789", 9);
    return NULL;
}

/* This test runs first, so that threads compete for making the table. */
static void test_first_use_from_threads(void **state)
{
    (void)state;
    pthread_t thread[8];
    uint32_t crc[8];
    for (int i = 0; i < 8; i++)
        assert_int_equal(pthread_create(&thread[i], NULL, table_thread, &crc[i]), 0);
    for (int i = 0; i < 8; i++) {
        pthread_join(thread[i], NULL);
        assert_int_equal(crc[i], 0xe3069283u);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_first_use_from_threads),     cmocka_unit_test_prestate(test_published, &dispatch),
        cmocka_unit_test_prestate(test_published, &table), cmocka_unit_test_prestate(test_published, &hw),
        cmocka_unit_test_prestate(test_published, &wide),  cmocka_unit_test_prestate(test_lengths, &table),
        cmocka_unit_test_prestate(test_lengths, &hw),      cmocka_unit_test_prestate(test_lengths, &wide),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
