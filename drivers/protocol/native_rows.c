/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/native_rows.h"

#include "core/bytes.h"
#include "drivers/protocol/native.h"

/* The cost depends on the number of stores, so each row takes three wide ones. */
uint32_t native_put_rows_plain(uint8_t *restrict dst, const struct line_block *block, uint32_t first, uint32_t n,
                               uint32_t dt0_ns)
{
    const uint32_t *restrict a = block->a + first, *restrict b = block->b + first, *restrict c = block->c + first;
    const uint32_t *restrict dt_ns = block->dt_ns + first;
    const int16_t *restrict refl = block->refl_cdb + first;
    const uint16_t *restrict label = block->label + first;
    const uint8_t *restrict echo = block->echo + first;
    uint32_t bits = 0;
    for (uint32_t i = 0; i < n; i++, dst += NATIVE_POINT_LEN) {
        uint32_t dt = dt_ns[i] - dt0_ns;
        bits |= dt;
        uint64_t surface = (uint16_t)refl[i] | (uint32_t)label[i] << 16;
        le_put64(dst, a[i] | (uint64_t)b[i] << 32);
        le_put64(dst + 8, c[i] | surface << 32);
        le_put32(dst + 16, dt | (uint32_t)echo[i] << 24);
    }
    return bits >> 24;
}

enum { LANES = 16 };

#if defined(__x86_64__) && !defined(VEC_ONE) /* VEC_ONE: for measuring one instruction set (core/vecmath.h) */
#include <immintrin.h>

/* Sixteen rows are 80 words, in five vectors. Word l of vector v belongs to row ROW, and is its word WORD. */
#define ROW(v, l)  ((16 * (v) + (l)) / 5)
#define WORD(v, l) ((16 * (v) + (l)) % 5)
/* Two vectors of a pair (a and b, c and surface) are numbered as one array of 32 words. These macros give the number of
 * the word that goes to place l of vector v. Places of other words get any number, and masks fill them in later. */
#define FIRST_PAIR(v, l)  (ROW(v, l) + (WORD(v, l) == 1 ? LANES : 0))
#define SECOND_PAIR(v, l) (ROW(v, l) + (WORD(v, l) == 3 ? LANES : 0))
#define ALL(of, v)                                                                                                     \
    {                                                                                                                  \
        of(v, 0), of(v, 1), of(v, 2), of(v, 3), of(v, 4), of(v, 5), of(v, 6), of(v, 7), of(v, 8), of(v, 9), of(v, 10), \
            of(v, 11), of(v, 12), of(v, 13), of(v, 14), of(v, 15)                                                      \
    }
#define BIT(test, l)    ((unsigned)(test) << (l))
#define BITS4(w, v, l)  (BIT(w(v, l), l) | BIT(w(v, l + 1), l + 1) | BIT(w(v, l + 2), l + 2) | BIT(w(v, l + 3), l + 3))
#define MASK(w, v)      ((uint16_t)(BITS4(w, v, 0) | BITS4(w, v, 4) | BITS4(w, v, 8) | BITS4(w, v, 12)))
#define IN_SECOND(v, l) (WORD(v, l) == 2 || WORD(v, l) == 3)
#define IN_TIME(v, l)   (WORD(v, l) == 4)

static const uint32_t first_pair[5][LANES] = {ALL(FIRST_PAIR, 0), ALL(FIRST_PAIR, 1), ALL(FIRST_PAIR, 2),
                                              ALL(FIRST_PAIR, 3), ALL(FIRST_PAIR, 4)};
static const uint32_t second_pair[5][LANES] = {ALL(SECOND_PAIR, 0), ALL(SECOND_PAIR, 1), ALL(SECOND_PAIR, 2),
                                               ALL(SECOND_PAIR, 3), ALL(SECOND_PAIR, 4)};
static const uint32_t row_of[5][LANES] = {ALL(ROW, 0), ALL(ROW, 1), ALL(ROW, 2), ALL(ROW, 3), ALL(ROW, 4)};
static const uint16_t in_second[5] = {MASK(IN_SECOND, 0), MASK(IN_SECOND, 1), MASK(IN_SECOND, 2), MASK(IN_SECOND, 3),
                                      MASK(IN_SECOND, 4)};
static const uint16_t in_time[5] = {MASK(IN_TIME, 0), MASK(IN_TIME, 1), MASK(IN_TIME, 2), MASK(IN_TIME, 3),
                                    MASK(IN_TIME, 4)};

/* Writes n rows, a multiple of LANES. */
__attribute__((target("avx512f,avx512bw,avx512vl"))) static uint32_t
put_wide(uint8_t *restrict dst, const struct line_block *block, uint32_t first, uint32_t n, uint32_t dt0_ns)
{
    const __m512i dt0 = _mm512_set1_epi32((int)dt0_ns);
    __m512i bits = _mm512_setzero_si512();
    for (uint32_t i = first; i < first + n; i += LANES) {
        const __m512i a = _mm512_loadu_si512(block->a + i), b = _mm512_loadu_si512(block->b + i);
        const __m512i c = _mm512_loadu_si512(block->c + i);
        const __m512i dt = _mm512_sub_epi32(_mm512_loadu_si512(block->dt_ns + i), dt0);
        const __m512i refl = _mm512_cvtepu16_epi32(_mm256_loadu_si256((const __m256i *)(block->refl_cdb + i)));
        const __m512i label = _mm512_cvtepu16_epi32(_mm256_loadu_si256((const __m256i *)(block->label + i)));
        const __m512i echo = _mm512_cvtepu8_epi32(_mm_loadu_si128((const __m128i *)(block->echo + i)));
        const __m512i surface = _mm512_or_si512(refl, _mm512_slli_epi32(label, 16));
        const __m512i time = _mm512_or_si512(dt, _mm512_slli_epi32(echo, 24));
        bits = _mm512_or_si512(bits, dt);
        for (int v = 0; v < 5; v++, dst += sizeof a) {
            const __m512i second = _mm512_permutex2var_epi32(c, _mm512_loadu_si512(second_pair[v]), surface);
            __m512i out = _mm512_permutex2var_epi32(a, _mm512_loadu_si512(first_pair[v]), b);
            out = _mm512_mask_mov_epi32(out, in_second[v], second);
            out = _mm512_mask_permutexvar_epi32(out, in_time[v], _mm512_loadu_si512(row_of[v]), time);
            _mm512_storeu_si512(dst, out);
        }
    }
    return (uint32_t)_mm512_reduce_or_epi32(bits) >> 24;
}

static int has_wide(void)
{
    return __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512vl");
}

#else

static uint32_t put_wide(uint8_t *dst, const struct line_block *block, uint32_t first, uint32_t n, uint32_t dt0_ns)
{
    return native_put_rows_plain(dst, block, first, n, dt0_ns);
}

static int has_wide(void)
{
    return 0;
}

#endif

uint32_t native_put_rows(uint8_t *dst, const struct line_block *block, uint32_t first, uint32_t n, uint32_t dt0_ns)
{
    const uint32_t wide = has_wide() ? n / LANES * LANES : 0;
    const uint32_t bits = wide != 0 ? put_wide(dst, block, first, wide, dt0_ns) : 0;
    return bits | native_put_rows_plain(dst + (size_t)wide * NATIVE_POINT_LEN, block, first + wide, n - wide, dt0_ns);
}
