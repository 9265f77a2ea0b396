/* SPDX-License-Identifier: MIT */
#include "tests/unit/checksum_rig.h"

#include "core/rng.h"

enum { MAX_SAID = 1 << 18, RANDOM_SETS = 50 };

static uint8_t *mask_of(const struct protocol_ops *ops, const uint8_t *unit, size_t len)
{
    uint8_t *mask = calloc(len, 1);
    assert_non_null(mask);
    ops->content(unit, len, mask);
    return mask;
}

uint64_t seal_count(const struct protocol_ops *ops, const uint8_t *unit, size_t len)
{
    uint8_t *mask = mask_of(ops, unit, len);
    uint64_t n = 0;
    for (size_t i = 0; i < len; i++)
        n += (uint64_t)__builtin_popcount(mask[i]);
    free(mask);
    return n;
}

/* The contents of a unit, as its reader returns them. */
struct said {
    uint8_t bytes[MAX_SAID];
    size_t size;
};

static void change(const struct protocol_ops *ops, const uint8_t *unit, const uint8_t *bits, size_t len,
                   seal_reader *read, struct said *said)
{
    uint8_t *changed = malloc(len);
    assert_non_null(changed);
    for (size_t i = 0; i < len; i++)
        changed[i] = unit[i] ^ bits[i];
    if (ops->reseal != NULL) ops->reseal(changed, len);
    const void *bytes = read(changed, len, &said->size);
    assert_true(said->size <= sizeof said->bytes);
    memcpy(said->bytes, bytes, said->size);
    free(changed);
}

static int is_same(const struct said *a, const struct said *b)
{
    return a->size == b->size && memcmp(a->bytes, b->bytes, a->size) == 0;
}

static void try_one(const struct protocol_ops *ops, const uint8_t *unit, size_t len)
{
    uint8_t *copy = malloc(len), *mask;
    assert_non_null(copy);
    memcpy(copy, unit, len);
    mask = mask_of(ops, copy, len);
    if (ops->reseal != NULL) ops->reseal(copy, len);
    free(mask);
    free(copy);
}

void seal_check_broken(const struct protocol_ops *ops, const uint8_t *unit, size_t len)
{
    uint8_t *damaged = malloc(len);
    assert_non_null(damaged);
    memcpy(damaged, unit, len);
    for (size_t n = 1; n <= len; n++)
        try_one(ops, unit, n);
    for (size_t i = 0; i < len; i++) {
        damaged[i] = (uint8_t)rng_u64(2, i);
        try_one(ops, damaged, len);
        damaged[i] = unit[i];
    }
    free(damaged);
}

void seal_check(const struct protocol_ops *ops, const uint8_t *unit, size_t len, seal_reader *read)
{
    static struct said clean, other;
    uint8_t *mask = mask_of(ops, unit, len), *bits = calloc(len, 1);
    assert_non_null(bits);
    change(ops, unit, bits, len, read, &clean); /* a unit that is right stays as it is */
    for (size_t i = 0; i < len; i++)
        for (int b = 0; b < 8; b++) {
            if ((mask[i] >> b & 1) == 0) continue;
            bits[i] = (uint8_t)(1U << b);
            change(ops, unit, bits, len, read, &other);
            bits[i] = 0;
            if (is_same(&clean, &other)) fail_msg("bit %d of byte %zu changes nothing", b, i);
        }
    for (uint32_t k = 0; k < RANDOM_SETS; k++) {
        for (size_t i = 0; i < len; i++)
            bits[i] = mask[i] & (uint8_t)rng_u64(1, rng_echo(i, k));
        change(ops, unit, bits, len, read, &other);
        assert_false(is_same(&clean, &other));
    }
    free(bits);
    free(mask);
    seal_check_broken(ops, unit, len);
}
