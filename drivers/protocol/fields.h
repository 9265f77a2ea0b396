/* SPDX-License-Identifier: MIT */
/* Payloads of fixed length as tables: a row for each struct member, in wire order without gaps.
 *
 * The same table encodes and decodes, so the two can't differ. The protocol's pages give the offsets, and
 * tests/unit/test_native.c checks them. Pure; any thread; real-time safe. */
#ifndef DRIVERS_PROTOCOL_FIELDS_H
#define DRIVERS_PROTOCOL_FIELDS_H

#include <stddef.h>
#include <stdint.h>

enum field_kind {
    FIELD_8,     /* uint8_t */
    FIELD_16,    /* uint16_t */
    FIELD_32,    /* uint32_t */
    FIELD_64,    /* uint64_t, int64_t */
    FIELD_FLOAT, /* float; decoding refuses NaN and infinities, here and in the next kind */
    FIELD_REAL,  /* double */
    FIELD_TEXT,  /* char array: NUL-terminated, padded with NUL */
};

struct field {
    uint16_t offset;           /* in the struct */
    uint8_t kind, count, unit; /* unit: bytes of each */
};

struct field_table {
    const struct field *field;
    size_t n_fields, wire_len, struct_len;
    uint8_t type; /* enum native_type of the frame whose payload is such a struct, or begins with one */
};

/* The descriptor has two lengths: its last two fields are sent only where content is not 0. Telemetry has three:
 * the state of a PTP follower comes last, and is sent only where the head has one. Before this state
 * is the number of lines that journal and truth have lost. The number is sent where it is not 0, or where the state
 * follows. */
extern const struct field_table fields_descriptor, fields_descriptor_content, fields_anchor, fields_emitter,
    fields_points, fields_attributes, fields_waves, fields_line_end, fields_telemetry, fields_telemetry_lines,
    fields_telemetry_ptp, fields_event, fields_pose;

/* Writes exactly table->wire_len bytes. */
void fields_encode(const struct field_table *table, const void *from, uint8_t *wire);

/* 0, or SH_EFORMAT for a payload too short, a text without NUL, or a number that is not finite. Members
 * without a row become 0. A payload may be longer than the table: later versions grow at the end. */
int fields_decode(const struct field_table *table, const uint8_t *wire, size_t len, void *to);

#endif
