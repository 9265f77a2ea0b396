/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/crc32c.h"

#include <pthread.h>

#include "core/bytes.h"

static uint32_t table[8][256];
static pthread_once_t table_once = PTHREAD_ONCE_INIT;

/* table[k][v]: CRC register of byte v followed by k zero bytes. */
static void make_table(void)
{
    for (uint32_t v = 0; v < 256; v++) {
        uint32_t crc = v;
        for (int bit = 0; bit < 8; bit++)
            crc = crc >> 1 ^ (0x82f63b78u & (0u - (crc & 1u)));
        table[0][v] = crc;
    }
    for (int k = 1; k < 8; k++)
        for (uint32_t v = 0; v < 256; v++)
            table[k][v] = table[k - 1][v] >> 8 ^ table[0][table[k - 1][v] & 255u];
}

uint32_t crc32c_table(uint32_t crc, const void *data, size_t len)
{
    const uint8_t *p = data;
    pthread_once(&table_once, make_table);
    crc = ~crc;
    for (; len >= 8; len -= 8, p += 8) {
        uint32_t lo = le_get32(p) ^ crc, hi = le_get32(p + 4);
        crc = table[7][lo & 255u] ^ table[6][lo >> 8 & 255u] ^ table[5][lo >> 16 & 255u] ^ table[4][lo >> 24] ^
              table[3][hi & 255u] ^ table[2][hi >> 8 & 255u] ^ table[1][hi >> 16 & 255u] ^ table[0][hi >> 24];
    }
    for (; len > 0; len--, p++)
        crc = crc >> 8 ^ table[0][(crc ^ *p) & 255u];
    return ~crc;
}

#if defined(__x86_64__)
#include <immintrin.h>

/* The instruction takes a word per cycle but answers after three, so long data go through three lanes at
 * once. The lanes are joined by carry-less products with x^(8n-33) mod P, bits reflected, for n = LANE and 2
 * LANE bytes. The missing x^33 comes from two places: the product of two reflected 32-bit words is one bit
 * short, which is x, and the crc32 instruction gives x^32. */
enum { LANE = 336, LANES = 3 * LANE };
#define SHIFT_ONE_LANE  0xa60ce07bu
#define SHIFT_TWO_LANES 0xcec3662eu

__attribute__((target("sse4.2,pclmul"))) static uint32_t three_lanes(uint32_t crc, const uint8_t *p)
{
    uint64_t a = crc, b = 0, c = 0;
    for (size_t i = 0; i < LANE; i += 8) {
        a = _mm_crc32_u64(a, le_get64(p + i));
        b = _mm_crc32_u64(b, le_get64(p + LANE + i));
        c = _mm_crc32_u64(c, le_get64(p + 2 * LANE + i));
    }
    __m128i wa = _mm_clmulepi64_si128(_mm_cvtsi64_si128((long long)a), _mm_cvtsi64_si128(SHIFT_TWO_LANES), 0);
    __m128i wb = _mm_clmulepi64_si128(_mm_cvtsi64_si128((long long)b), _mm_cvtsi64_si128(SHIFT_ONE_LANE), 0);
    uint64_t joined = (uint64_t)_mm_cvtsi128_si64(_mm_xor_si128(wa, wb));
    return (uint32_t)(_mm_crc32_u64(0, joined) ^ c);
}

int crc32c_has_hw(void)
{
    return __builtin_cpu_supports("sse4.2") && __builtin_cpu_supports("pclmul");
}

__attribute__((target("sse4.2"))) uint32_t crc32c_hw(uint32_t crc, const void *data, size_t len)
{
    const uint8_t *p = data;
    crc = ~crc;
    for (; len >= LANES; len -= LANES, p += LANES)
        crc = three_lanes(crc, p);
    uint64_t wide = crc;
    for (; len >= 8; len -= 8, p += 8)
        wide = _mm_crc32_u64(wide, le_get64(p));
    crc = (uint32_t)wide;
    for (; len > 0; len--, p++)
        crc = _mm_crc32_u8(crc, *p);
    return ~crc;
}

/* Folding replaces a piece of 128 bits by a piece N bits further on. The new piece is the sum of two products: those of
 * the old piece's halves with x^(N+63) and x^(N-1) mod P, bits reflected. Here each vector has four pieces, and four
 * vectors go on at once. */
enum { FOLD = 64, FOLDS = 4 * FOLD, FOLD_LEAST = 2 * FOLDS };
#define FOLD_ONE_LO  0x1c19243b00000000
#define FOLD_ONE_HI  0x75bba45b00000000
#define FOLD_FOUR_LO ((long long)0xe9a5d8be00000000)
#define FOLD_FOUR_HI 0x1426a81500000000
#define TARGET_WIDE  __attribute__((target("avx512f,avx512vl,vpclmulqdq,sse4.2")))

TARGET_WIDE static inline __m512i fold(__m512i x, __m512i by, __m512i next)
{
    const __m512i lo = _mm512_clmulepi64_epi128(x, by, 0x00), hi = _mm512_clmulepi64_epi128(x, by, 0x11);
    return _mm512_xor_si512(_mm512_xor_si512(lo, hi), next);
}

int crc32c_has_wide(void)
{
#ifdef VEC_ONE /* measuring one instruction set: core/vecmath.h */
    return 0;
#endif
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512vl") &&
           __builtin_cpu_supports("vpclmulqdq") && crc32c_has_hw();
}

TARGET_WIDE uint32_t crc32c_wide(uint32_t crc, const void *data, size_t len)
{
    const __m512i by_one = _mm512_broadcast_i32x4(_mm_set_epi64x(FOLD_ONE_HI, FOLD_ONE_LO));
    const __m512i by_four = _mm512_broadcast_i32x4(_mm_set_epi64x(FOLD_FOUR_HI, FOLD_FOUR_LO));
    const uint8_t *p = data;
    uint8_t rest[FOLD];
    if (len < FOLD_LEAST) return crc32c_hw(crc, data, len);
    __m512i a = _mm512_loadu_si512(p), b = _mm512_loadu_si512(p + FOLD);
    __m512i c = _mm512_loadu_si512(p + 2 * FOLD), d = _mm512_loadu_si512(p + 3 * FOLD);
    a = _mm512_xor_si512(a, _mm512_zextsi128_si512(_mm_cvtsi32_si128((int)~crc)));
    for (len -= FOLDS, p += FOLDS; len >= FOLDS; len -= FOLDS, p += FOLDS) {
        a = fold(a, by_four, _mm512_loadu_si512(p));
        b = fold(b, by_four, _mm512_loadu_si512(p + FOLD));
        c = fold(c, by_four, _mm512_loadu_si512(p + 2 * FOLD));
        d = fold(d, by_four, _mm512_loadu_si512(p + 3 * FOLD));
    }
    d = fold(fold(fold(a, by_one, b), by_one, c), by_one, d);
    for (; len >= FOLD; len -= FOLD, p += FOLD)
        d = fold(d, by_one, _mm512_loadu_si512(p));
    _mm512_storeu_si512(rest, d);
    return crc32c_hw(crc32c_hw(~0U, rest, sizeof rest), p, len);
}

#elif defined(__aarch64__) && defined(__ARM_FEATURE_CRC32)
#include <arm_acle.h>

int crc32c_has_hw(void)
{
    return 1;
}

uint32_t crc32c_hw(uint32_t crc, const void *data, size_t len)
{
    const uint8_t *p = data;
    crc = ~crc;
    for (; len >= 8; len -= 8, p += 8)
        crc = __crc32cd(crc, le_get64(p));
    for (; len > 0; len--, p++)
        crc = __crc32cb(crc, *p);
    return ~crc;
}

#else

int crc32c_has_hw(void)
{
    return 0;
}

uint32_t crc32c_hw(uint32_t crc, const void *data, size_t len)
{
    return crc32c_table(crc, data, len);
}

#endif

#if !defined(__x86_64__)
int crc32c_has_wide(void)
{
    return 0;
}

uint32_t crc32c_wide(uint32_t crc, const void *data, size_t len)
{
    return crc32c_table(crc, data, len);
}
#endif

uint32_t crc32c(uint32_t crc, const void *data, size_t len)
{
    /* the processor's features were found before main, so that this needs no lock */
    if (crc32c_has_wide()) return crc32c_wide(crc, data, len);
    return crc32c_has_hw() ? crc32c_hw(crc, data, len) : crc32c_table(crc, data, len);
}
