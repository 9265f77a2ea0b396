/* SPDX-License-Identifier: MIT */
/* Rows of points frames: bytes as drivers/protocol/POINTS.md lays them out, from arrays of random and of extreme
 * entries, of any number and from any entry on. */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
#include <string.h>

#include "core/line.h"
#include "drivers/protocol/native.h"
#include "drivers/protocol/native_rows.h"

enum { MOST = 200, GUARD = 64 };

static struct line_block block;
static uint32_t state_of_random = 1;

static uint32_t next_random(void)
{
    state_of_random = state_of_random * 1664525U + 1013904223U;
    return state_of_random >> 8 ^ state_of_random << 20;
}

static int make_block(void **state)
{
    (void)state;
    struct sh_err err;
    if (line_block_alloc(&block, MOST, &err) != SH_OK) return -1;
    for (uint32_t i = 0; i < MOST; i++) {
        block.a[i] = i % 7 == 0 ? UINT32_MAX : next_random();
        block.b[i] = i % 5 == 0 ? 0x80000000U : next_random();
        block.c[i] = i % 11 == 0 ? 0 : next_random();
        block.dt_ns[i] = 1000 + (i % 13 == 0 ? 0xffffffU : next_random() & 0xffffffU);
        block.refl_cdb[i] = i % 3 == 0 ? (int16_t)LINE_REFL_NONE : (int16_t)(uint16_t)next_random();
        block.label[i] = i % 4 == 0 ? (uint16_t)LINE_LABEL_NONE : (uint16_t)next_random();
        block.echo[i] = (uint8_t)next_random();
    }
    return 0;
}

static int free_block(void **state)
{
    (void)state;
    line_block_free(&block);
    return 0;
}

static void put_le(uint8_t *at, uint32_t value, int bytes)
{
    for (int i = 0; i < bytes; i++)
        at[i] = (uint8_t)(value >> 8 * i);
}

/* Writes a row byte by byte, as the page lays it out. */
static void put_expected(uint8_t *row, uint32_t i, uint32_t dt0_ns)
{
    put_le(row, block.a[i], 4);
    put_le(row + 4, block.b[i], 4);
    put_le(row + 8, block.c[i], 4);
    put_le(row + 12, (uint16_t)block.refl_cdb[i], 2);
    put_le(row + 14, block.label[i], 2);
    put_le(row + 16, block.dt_ns[i] - dt0_ns, 3);
    row[19] = block.echo[i];
}

typedef uint32_t (*rows_fn)(uint8_t *, const struct line_block *, uint32_t, uint32_t, uint32_t);

static void check_rows(rows_fn rows)
{
    uint8_t got[MOST * NATIVE_POINT_LEN + GUARD], expected[sizeof got];
    for (uint32_t first = 0; first < 20; first++)
        for (uint32_t n = 0; first + n <= MOST; n++) {
            memset(got, 0xa5, sizeof got);
            memset(expected, 0xa5, sizeof expected);
            for (uint32_t i = 0; i < n; i++)
                put_expected(expected + (size_t)i * NATIVE_POINT_LEN, first + i, 1000);
            assert_int_equal(rows(got, &block, first, n, 1000), 0);
            assert_memory_equal(got, expected, sizeof got);
        }
}

static void rows_are_as_the_page_says(void **state)
{
    (void)state;
    check_rows(native_put_rows);
}

static void rows_without_vectors_are_the_same(void **state)
{
    (void)state;
    check_rows(native_put_rows_plain);
}

/* A time with a bit too many is reported, at each place of the block. */
static void times_with_too_many_bits_are_reported(void **state)
{
    (void)state;
    uint8_t got[MOST * NATIVE_POINT_LEN];
    for (uint32_t i = 0; i < MOST; i++) {
        const uint32_t was = block.dt_ns[i];
        block.dt_ns[i] = 1000 + (1U << 24);
        assert_int_not_equal(native_put_rows(got, &block, 0, MOST, 1000), 0);
        assert_int_not_equal(native_put_rows_plain(got, &block, 0, MOST, 1000), 0);
        block.dt_ns[i] = was;
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(rows_are_as_the_page_says),
        cmocka_unit_test(rows_without_vectors_are_the_same),
        cmocka_unit_test(times_with_too_many_bits_are_reported),
    };
    return cmocka_run_group_tests(tests, make_block, free_block);
}
