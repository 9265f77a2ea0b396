/* SPDX-License-Identifier: MIT */
/* Little-endian and big-endian loads and stores at any alignment. One or two instructions each. */
#ifndef CORE_BYTES_H
#define CORE_BYTES_H

#include <endian.h>
#include <stdint.h>
#include <string.h>

static inline uint32_t float_bits(float f)
{
    uint32_t bits;
    memcpy(&bits, &f, sizeof bits);
    return bits;
}

static inline float bits_float(uint32_t bits)
{
    float f;
    memcpy(&f, &bits, sizeof f);
    return f;
}

static inline void le_put16(void *dst, uint16_t v)
{
    v = htole16(v);
    memcpy(dst, &v, sizeof v);
}

static inline void le_put32(void *dst, uint32_t v)
{
    v = htole32(v);
    memcpy(dst, &v, sizeof v);
}

static inline void le_put64(void *dst, uint64_t v)
{
    v = htole64(v);
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
    le_put32(dst, float_bits(f));
}

static inline uint16_t le_get16(const void *src)
{
    uint16_t v;
    memcpy(&v, src, sizeof v);
    return le16toh(v);
}

static inline uint32_t le_get32(const void *src)
{
    uint32_t v;
    memcpy(&v, src, sizeof v);
    return le32toh(v);
}

static inline uint64_t le_get64(const void *src)
{
    uint64_t v;
    memcpy(&v, src, sizeof v);
    return le64toh(v);
}

static inline float le_get_float(const void *src)
{
    return bits_float(le_get32(src));
}

static inline double le_get_double(const void *src)
{
    const uint64_t v = le_get64(src);
    double d;
    memcpy(&d, &v, sizeof d);
    return d;
}

/* Types of numbers, in the order that PLY and glTF give them. */
enum number_type { NUMBER_I8, NUMBER_U8, NUMBER_I16, NUMBER_U16, NUMBER_I32, NUMBER_U32, NUMBER_FLOAT, NUMBER_DOUBLE };
/* Bytes, by number_type. */
static const uint8_t number_size[] = {1, 1, 2, 2, 4, 4, 4, 8};

static inline double le_get_number(const uint8_t *src, enum number_type type)
{
    switch (type) {
    case NUMBER_I8:
        return (int8_t)*src;
    case NUMBER_U8:
        return *src;
    case NUMBER_I16:
        return (int16_t)le_get16(src);
    case NUMBER_U16:
        return le_get16(src);
    case NUMBER_I32:
        return (int32_t)le_get32(src);
    case NUMBER_U32:
        return le_get32(src);
    case NUMBER_FLOAT:
        return (double)le_get_float(src);
    case NUMBER_DOUBLE:
        break;
    }
    return le_get_double(src);
}

/* Stores the low 16 bits. */
static inline void be_put16(void *dst, size_t v)
{
    const uint16_t be = htobe16((uint16_t)v);
    memcpy(dst, &be, sizeof be);
}

static inline void be_put32(void *dst, uint32_t v)
{
    v = htobe32(v);
    memcpy(dst, &v, sizeof v);
}

static inline uint16_t be_get16(const void *src)
{
    uint16_t v;
    memcpy(&v, src, sizeof v);
    return be16toh(v);
}

static inline uint32_t be_get32(const void *src)
{
    uint32_t v;
    memcpy(&v, src, sizeof v);
    return be32toh(v);
}

#endif
