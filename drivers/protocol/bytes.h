/* SPDX-License-Identifier: MIT */
/* Little-endian loads and stores at any alignment. One instruction each on little-endian machines. */
#ifndef DRIVERS_PROTOCOL_BYTES_H
#define DRIVERS_PROTOCOL_BYTES_H

#include <stdint.h>
#include <string.h>

#if __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
#define LE16(v) __builtin_bswap16(v)
#define LE32(v) __builtin_bswap32(v)
#define LE64(v) __builtin_bswap64(v)
#else
#define LE16(v) (v)
#define LE32(v) (v)
#define LE64(v) (v)
#endif

static inline void le_put16(void *dst, uint16_t v)
{
    v = LE16(v);
    memcpy(dst, &v, sizeof v);
}

static inline void le_put32(void *dst, uint32_t v)
{
    v = LE32(v);
    memcpy(dst, &v, sizeof v);
}

static inline void le_put64(void *dst, uint64_t v)
{
    v = LE64(v);
    memcpy(dst, &v, sizeof v);
}

static inline void le_put_double(void *dst, double d)
{
    uint64_t v;
    memcpy(&v, &d, sizeof v);
    le_put64(dst, v);
}

static inline void le_put_float(void *dst, float f)
{
    uint32_t v;
    memcpy(&v, &f, sizeof v);
    le_put32(dst, v);
}

static inline uint16_t le_get16(const void *src)
{
    uint16_t v;
    memcpy(&v, src, sizeof v);
    return LE16(v);
}

static inline uint32_t le_get32(const void *src)
{
    uint32_t v;
    memcpy(&v, src, sizeof v);
    return LE32(v);
}

static inline uint64_t le_get64(const void *src)
{
    uint64_t v;
    memcpy(&v, src, sizeof v);
    return LE64(v);
}

static inline double le_get_double(const void *src)
{
    const uint64_t v = le_get64(src);
    double d;
    memcpy(&d, &v, sizeof d);
    return d;
}

#endif
