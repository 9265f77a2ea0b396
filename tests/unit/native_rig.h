/* SPDX-License-Identifier: MIT */
/* For tests of the native protocol: frames to encode, and their bytes apart from the code under test. */
#ifndef TESTS_UNIT_NATIVE_RIG_H
#define TESTS_UNIT_NATIVE_RIG_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <float.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "core/bytes.h"
#include "drivers/protocol/crc32c.h"
#include "drivers/protocol/fields.h"
#include "drivers/protocol/native_encode.h"

enum { BLOCK_MAX = 7000 };

/* Reads the wire by shifts, apart from the code under test. */
uint64_t wire(const uint8_t *p, size_t at, int bytes);

double wire_double(const uint8_t *p, size_t at);

void check_frame(const uint8_t *frame, size_t len, int type, int flags, size_t payload_len, int64_t t_ns);

struct native_descriptor make_descriptor(void);

struct native_anchor make_anchor(void);

extern char names[3][300];

void name_of(void *ctx, uint32_t label, const char **object, const char **material);

extern uint32_t block_a[BLOCK_MAX], block_b[BLOCK_MAX], block_c[BLOCK_MAX], block_dt[BLOCK_MAX];
extern int16_t block_refl[BLOCK_MAX];
extern uint16_t block_label[BLOCK_MAX];
extern uint8_t block_echo[BLOCK_MAX];

struct line_block make_block(uint32_t n_points);
/* A block of line 77, from pulse 0x123456789a and 1000 ns on. The block's pulses are 500 ns apart, with so many echoes
 * each. Column a has the number of the entry. */
struct line_block make_pulses(uint32_t n_points, uint32_t echoes);

#endif
