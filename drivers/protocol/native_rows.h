/* SPDX-License-Identifier: MIT */
/* The rows of a points frame, 20 bytes a point (POINTS.md), from the arrays of a block.
 *
 * Pure; writes n * NATIVE_POINT_LEN bytes; any thread; real-time safe. */
#ifndef DRIVERS_PROTOCOL_NATIVE_ROWS_H
#define DRIVERS_PROTOCOL_NATIVE_ROWS_H

#include "core/line.h"

/* Writes entries first .. first + n of the block, with times after dt0_ns. Returns the bits of times beyond the 24 that
 * a row holds; 0: all fit. */
uint32_t native_put_rows(uint8_t *dst, const struct line_block *block, uint32_t first, uint32_t n, uint32_t dt0_ns);

/* The same without vectors. Tests compare both. */
uint32_t native_put_rows_plain(uint8_t *dst, const struct line_block *block, uint32_t first, uint32_t n,
                               uint32_t dt0_ns);

#endif
