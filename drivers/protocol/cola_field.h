/* SPDX-License-Identifier: MIT */
/* Monitored fields: what the configuration or a client gives, and the record that telegrams carry.
 *
 * A field that the configuration gives is evaluated as it is given. The field's record is rounded to beams and
 * millimetres, as telegrams have no finer ones. A field that a client writes is evaluated as its record says, and read
 * back as it was written. Lengths of a record are counts of `scale` millimetres; angles are counts of `step_e4` from
 * `first_e4`.
 *
 * FIELDS.md draws the record, with its sources. Pure. */
#ifndef DRIVERS_PROTOCOL_COLA_FIELD_H
#define DRIVERS_PROTOCOL_COLA_FIELD_H

#include "drivers/protocol/cola_shape.h"
#include "drivers/protocol/cola_telegram.h"
#include "drivers/protocol/planar_scan.h"

enum { COLA_FIELDS = 48, COLA_FIELD_NAME = 32, COLA_FROM_HEAD = 0xffff, COLA_INPUTS = 4, COLA_WINDOWS = 64 };

/* The types as records number them. */
enum cola_field_type { COLA_FIELD_RADIAL, COLA_FIELD_RECTANGLE, COLA_FIELD_SEGMENTED, COLA_FIELD_DYNAMIC };

struct cola_record {
    float scale, offset;
    uint32_t step_e4;
    int32_t first_e4;
    uint8_t type, number;
    uint8_t is_segmented, is_rectangle; /* which of the two parts it has */
    uint16_t n;
    struct {
        uint16_t angle, start, stop; /* start COLA_FROM_HEAD: the field begins at the head */
    } point[COLA_SHAPE_LINKS];
    int32_t angle_e4, turn_e4; /* rectangle: direction of its corner; counter-clockwise turn */
    uint16_t distance;
    uint32_t width_mm, length_mm;
    char name[COLA_FIELD_NAME];
};

/* All 0: there is no such field. */
struct cola_field {
    struct cola_shape shape;
    uint32_t response_ms, blanking_um;
    uint8_t output; /* from 1; 0: none */
    uint8_t has_record;
    char name[COLA_FIELD_NAME];
    /* a rectangle of the configuration, for its record */
    uint8_t is_rectangle;
    double corner_um[2], size_um[2], turns;
    struct cola_record record; /* of a field that was written */
};

/* A digital input is active from one device time until another. */
struct cola_input_window {
    uint32_t input; /* from 0 */
    int64_t from_ns, until_ns;
};

/* Fields by number, from 0; and what the inputs do. */
struct cola_fields {
    struct cola_field field[COLA_FIELDS];
    struct cola_input_window window[COLA_WINDOWS];
    uint32_t n_windows;
};

/* The inputs that are active at a device time, a bit each. *next_ns: when they may change next; INT64_MAX: never. */
uint32_t cola_inputs_at(const struct cola_fields *fields, int64_t t_ns, int64_t *next_ns);

/* The record of a field with a shape, on the grid of the head's beams. from_first: the angle of a rectangle's corner
 * counts from the first beam, as in some models; else it counts from 0. */
void cola_field_describe(const struct cola_field *field, const struct planar_head *head, int from_first,
                         struct cola_record *out);
/* Reads a record of a request. COLA_INVALID_DATA: the record is of a radial or dynamic field, has a comment, has the
 * part of another type than its own, has more than COLA_SHAPE_LINKS points, or has a flag other than 0 and 1. */
enum cola_error cola_record_take(struct cola_args *args, struct cola_record *record);
void cola_record_put(const struct cola_record *record, struct cola_out *out);
/* The shape of a record. A record on the head's own grid has the exact directions of beams. COLA_INVALID_DATA:
 * its directions don't ascend, or span more than a turn; a point's start lies beyond its stop; or a length or a
 * direction is too large for a shape. */
enum cola_error cola_record_shape(const struct cola_record *record, const struct planar_head *head, int from_first,
                                  struct cola_shape *shape);

#endif
