/* SPDX-License-Identifier: MIT */
/* What a client sent and has no answer to yet: what an echo sends back.
 *
 * In: its bytes, in pieces of any size. Out: the lines among them that get an answer, one after the other; or, of a
 * protocol without lines, all bytes since the last answer. Thread: one. Allocates as it grows, up to HEARD_MAX bytes: a
 * client that sends more without waiting for an answer hears no echo of it. */
#ifndef FIRMWARE_SIM_FAULT_WIRE_HEARD_H
#define FIRMWARE_SIM_FAULT_WIRE_HEARD_H

#include <stddef.h>
#include <stdint.h>

struct wire_heard {
    int has_lines;
    uint8_t *bytes;
    size_t len, room;
    size_t begin, line_len; /* of the line that has no end yet: where it begins, how long it is; not all may be kept */
    int is_blank, last_cr;
    uint32_t unheard; /* answers to come that are to lines from before */
};

void wire_heard_add(struct wire_heard *heard, const void *bytes, size_t len);
/* The oldest line without its end, or all bytes; NULL: none. Good until the next call. */
const uint8_t *wire_heard_first(const struct wire_heard *heard, size_t *len);
/* It is answered. */
void wire_heard_answered(struct wire_heard *heard);
void wire_heard_free(struct wire_heard *heard);

#endif
