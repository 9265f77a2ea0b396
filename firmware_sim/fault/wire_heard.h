/* SPDX-License-Identifier: MIT */
/* The bytes that a client sent and that are not answered yet: an echo sends them back.
 *
 * In: the client's bytes, in pieces of any size. Out: the lines that get an answer, one after the other; or, for a
 * protocol without lines, all bytes since the last answer. Thread: one. Allocates as it grows. Up to HEARD_MAX
 * bytes wait for an answer. If more come, the waiting ones are dropped and get no echo. */
#ifndef FIRMWARE_SIM_FAULT_WIRE_HEARD_H
#define FIRMWARE_SIM_FAULT_WIRE_HEARD_H

#include <stddef.h>
#include <stdint.h>

struct wire_heard {
    int has_lines;
    uint8_t *bytes;
    size_t len, room;
    size_t first;           /* begin of the oldest line that is not answered */
    size_t begin, line_len; /* begin and length of the line that has no end yet; only its first part is kept */
    int is_blank;
};

void wire_heard_add(struct wire_heard *heard, const void *bytes, size_t len);
/* Returns the oldest line without its line end, or all bytes; NULL: none. Valid until the next call. */
const uint8_t *wire_heard_first(const struct wire_heard *heard, size_t *len);
/* The oldest line is answered: drops it. In a protocol without lines, drops all bytes. */
void wire_heard_answered(struct wire_heard *heard);
void wire_heard_free(struct wire_heard *heard);

#endif
