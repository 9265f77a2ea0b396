/* SPDX-License-Identifier: MIT */
/* Replies of SCIP: status, key lines, time stamps and blocks of data go in, the bytes of one unit come out.
 *
 *   echo LF  status(2) sum LF  [KEY:VALUE ; sum LF]...  [time(4 or 11) sum LF]  [to 64 characters, sum LF]...  LF
 *
 * The sum is 0x30 plus the low six bits of the sum of the line's bytes; the sum of a key line leaves out the
 * ';'. A value of n characters is 6 n bits, the most significant six first, each plus 0x30. Pure. */
#ifndef DRIVERS_PROTOCOL_SCIP_REPLY_H
#define DRIVERS_PROTOCOL_SCIP_REPLY_H

#include <stddef.h>
#include <stdint.h>

enum {
    SCIP_MAX_STEPS = 2880,       /* steps of a turn, at 0.125 degrees; the last one has number 2879 */
    SCIP_MAX_ECHOES = 3,         /* of a step */
    SCIP_MAX_LINE = 64,          /* of a command; the longest that is defined has 32 characters */
    SCIP_BLOCK = 64,             /* characters of data in a line */
    SCIP_STEP_CHARS = 3 * 6 + 2, /* most of a step: three ranges with intensity, two marks */
    SCIP_MAX_BLOCKS = (SCIP_MAX_STEPS * SCIP_STEP_CHARS + SCIP_BLOCK - 1) / SCIP_BLOCK,
    SCIP_MAX_UNIT = SCIP_MAX_LINE + 1 + 4 + 13 + SCIP_MAX_BLOCKS * (SCIP_BLOCK + 2) + 1,
    SCIP_MAX_TEXT = 70, /* a key line with its sum: clients have room for 72 bytes */
};

struct scip_reply {
    size_t len;
    size_t block; /* characters in the block at hand */
    uint32_t sum; /* of these */
    char bytes[SCIP_MAX_UNIT];
};

/* Echo and status; status has two characters. */
void scip_reply_begin(struct scip_reply *r, const char *echo, size_t len, const char *status);
/* A line of its own with its sum. */
void scip_reply_line(struct scip_reply *r, const char *text, size_t len);
/* A value longer than a client's line is cut. */
void scip_reply_key(struct scip_reply *r, const char *key, const char *fmt, ...) __attribute__((format(printf, 3, 4)));
/* ms: the low 24 bits. */
void scip_reply_time(struct scip_reply *r, uint32_t ms);
/* The same in 11 characters. */
void scip_reply_time_us(struct scip_reply *r, uint64_t us);
/* Data: a value in 2 or 3 characters, or one character as it is. For a value that does not fit, the largest one that
 * fits is written. */
void scip_reply_value(struct scip_reply *r, uint32_t value, int n_chars);
void scip_reply_mark(struct scip_reply *r, char mark);
/* Ends the last block with its sum, and puts the empty line. */
void scip_reply_end(struct scip_reply *r);

/* The sum of a line, as the character that ends it. */
char scip_sum(const void *text, size_t len);

/* The members content and reseal of struct protocol_ops: content marks ranges and intensities of scans, reseal corrects
 * the sums of all replies. */
void scip_content(const uint8_t *unit, size_t len, uint8_t *mask);
void scip_reseal(uint8_t *unit, size_t len);

/* Four characters of the low 24 bits. */
void scip_encode4(char dst[4], uint32_t value);

#endif
