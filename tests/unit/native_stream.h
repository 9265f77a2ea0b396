/* SPDX-License-Identifier: MIT */
/* For tests of the parser: a stream of frames and reply lines whose pieces are known, and the pieces that the parser
 * finds in it. */
#ifndef TESTS_UNIT_NATIVE_STREAM_H
#define TESTS_UNIT_NATIVE_STREAM_H

#include "tests/unit/native_rig.h"

enum { STREAM_MAX = 8192, ITEMS_MAX = 40 };

struct piece {
    size_t at, len;
    int is_text;
};

extern uint8_t stream[STREAM_MAX];
extern size_t stream_len;
extern struct piece piece[ITEMS_MAX];
extern int n_pieces;

/* Makes 13 frames of seven types, one of them LOCAL, with reply lines between. Their seq runs over 2^32. */
void make_stream(void);

extern struct native_parser parser;
struct got {
    size_t len;
    uint8_t bytes[512];
};
extern struct got got[ITEMS_MAX];
extern int n_got, n_texts;

void feed(const uint8_t *data, size_t len, size_t chunk);

void begin(void);

void finish(void);

/* The parser must find exactly the frames that [hurt_from, hurt_to) of the stream does not touch, byte by byte, in
 * order. */
void check_got(size_t hurt_from, size_t hurt_to);

#endif
