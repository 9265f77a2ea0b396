/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/cola_field.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "drivers/protocol/cola_units.h"

enum { MM_UM = 1000, MOST_COUNT = 65534 };

uint32_t cola_inputs_at(const struct cola_fields *fields, int64_t t_ns, int64_t *next_ns)
{
    uint32_t active = 0;
    *next_ns = INT64_MAX;
    for (uint32_t i = 0; i < fields->n_windows; i++) {
        const struct cola_input_window *w = &fields->window[i];
        const int64_t edge_ns = t_ns < w->from_ns ? w->from_ns : t_ns < w->until_ns ? w->until_ns : INT64_MAX;
        if (w->from_ns <= t_ns && t_ns < w->until_ns) active |= 1U << w->input;
        if (edge_ns < *next_ns) *next_ns = edge_ns;
    }
    return active;
}

/* ---- telegrams */

/* u16 flag of a part: 0 or 1. After the first error every value is 0. */
static int take_flag(struct cola_args *args)
{
    const uint32_t flag = cola_arg_u(args, 2);
    if (flag > 1) args->error = COLA_INVALID_DATA;
    return flag == 1;
}

static void take_points(struct cola_args *args, struct cola_record *r)
{
    const uint32_t n = cola_arg_u(args, 2);
    if (n > COLA_SHAPE_LINKS) args->error = COLA_INVALID_DATA;
    for (uint32_t i = 0; i < n && args->error == COLA_OK; i++) {
        r->point[i].angle = (uint16_t)cola_arg_u(args, 2);
        r->point[i].start = (uint16_t)cola_arg_u(args, 2);
        r->point[i].stop = (uint16_t)cola_arg_u(args, 2);
    }
    r->n = (uint16_t)n;
}

static void take_rectangle(struct cola_args *args, struct cola_record *r)
{
    r->angle_e4 = cola_arg_i(args, 4);
    r->distance = (uint16_t)cola_arg_u(args, 2);
    r->turn_e4 = cola_arg_i(args, 4);
    r->width_mm = cola_arg_u(args, 4);
    r->length_mm = cola_arg_u(args, 4);
}

/* Reads the flag of a part whose content is not known. A record that has the part is refused. */
static void take_no_part(struct cola_args *args)
{
    if (take_flag(args)) args->error = COLA_INVALID_DATA;
}

/* A record without the part of its type erases its field. Real scanners describe an empty field by such a record. */
static int has_part_of_type(const struct cola_record *r)
{
    if (r->type == COLA_FIELD_RECTANGLE) return !r->is_segmented;
    return r->type == COLA_FIELD_SEGMENTED && !r->is_rectangle;
}

enum cola_error cola_record_take(struct cola_args *args, struct cola_record *r)
{
    memset(r, 0, sizeof *r);
    r->scale = cola_arg_float(args);
    r->offset = cola_arg_float(args);
    r->step_e4 = cola_arg_u(args, 4);
    r->first_e4 = cola_arg_i(args, 4);
    r->type = (uint8_t)cola_arg_u(args, 1);
    r->number = (uint8_t)cola_arg_u(args, 1);
    r->is_segmented = (uint8_t)take_flag(args);
    if (r->is_segmented) take_points(args, r);
    r->is_rectangle = (uint8_t)take_flag(args);
    if (r->is_rectangle) take_rectangle(args, r);
    take_no_part(args); /* radial */
    take_no_part(args); /* dynamic */
    if (take_flag(args)) cola_arg_text(args, r->name, sizeof r->name);
    take_no_part(args); /* comment */
    if (args->error == COLA_OK && !has_part_of_type(r)) args->error = COLA_INVALID_DATA;
    return cola_args_end(args);
}

void cola_record_put(const struct cola_record *r, struct cola_out *out)
{
    cola_put_float(out, r->scale);
    cola_put_float(out, r->offset);
    cola_put_u(out, 4, r->step_e4);
    cola_put_i(out, 4, r->first_e4);
    cola_put_u(out, 1, r->type);
    cola_put_u(out, 1, r->number);
    cola_put_u(out, 2, r->is_segmented);
    if (r->is_segmented) cola_put_u(out, 2, r->n);
    for (uint32_t i = 0; i < r->n; i++) {
        cola_put_u(out, 2, r->point[i].angle);
        cola_put_u(out, 2, r->point[i].start);
        cola_put_u(out, 2, r->point[i].stop);
    }
    cola_put_u(out, 2, r->is_rectangle);
    if (r->is_rectangle) {
        cola_put_i(out, 4, r->angle_e4);
        cola_put_u(out, 2, r->distance);
        cola_put_i(out, 4, r->turn_e4);
        cola_put_u(out, 4, r->width_mm);
        cola_put_u(out, 4, r->length_mm);
    }
    cola_put_u(out, 2, 0); /* radial, dynamic: they can't be given */
    cola_put_u(out, 2, 0);
    cola_put_u(out, 2, 1);
    cola_put_text(out, r->name);
    cola_put_u(out, 2, 0);
}

/* ---- a record as a shape */

static int is_on_beams(const struct cola_record *r, const struct planar_head *head)
{
    return r->step_e4 == cola_step_angle(head) && r->first_e4 == cola_beam_angle(head, 0);
}

static int32_t length_um(const struct cola_record *r, uint32_t counts)
{
    const double um = (counts * (double)r->scale + (double)r->offset) * MM_UM;
    return um >= 0.0 && um <= COLA_SHAPE_REACH_UM ? (int32_t)lround(um) : INT32_MAX;
}

static enum cola_error chain(const struct cola_record *r, const struct planar_head *head, struct cola_shape *shape)
{
    /* A quarter of a turn lies between SICK's 0 and the front. With four times the steps that quarter is a whole
     * number. */
    const int on_beams = is_on_beams(r, head);
    const int32_t steps = on_beams ? 4 * (int32_t)head->steps : COLA_TURN_E4;
    for (uint32_t i = 0; i < r->n; i++) {
        const int64_t angle = r->point[i].angle;
        const int64_t step =
            on_beams ? cola_beam_quarters(head, (uint32_t)angle) : (int64_t)r->first_e4 + angle * (int64_t)r->step_e4;
        const int32_t near = r->point[i].start == COLA_FROM_HEAD ? 0 : length_um(r, r->point[i].start);
        if (step < -2 * COLA_TURN_E4 || step > 2 * COLA_TURN_E4) return COLA_INVALID_DATA;
        if (cola_shape_link(shape, (int32_t)step, steps, near, length_um(r, r->point[i].stop)) != 0)
            return COLA_INVALID_DATA;
    }
    return COLA_OK;
}

enum cola_error cola_record_shape(const struct cola_record *r, const struct planar_head *head, int from_first,
                                  struct cola_shape *shape)
{
    memset(shape, 0, sizeof *shape);
    if (r->is_segmented) return chain(r, head, shape);
    if (!r->is_rectangle) return COLA_OK;
    const double turns = ((double)r->angle_e4 + (from_first ? r->first_e4 : 0)) / COLA_TURN_E4;
    const double d_um = length_um(r, r->distance);
    const double corner[2] = {d_um * cos(COLA_TURN_RAD * turns), d_um * sin(COLA_TURN_RAD * turns)};
    const double size[2] = {(double)r->width_mm * MM_UM, (double)r->length_mm * MM_UM};
    return cola_shape_rectangle(shape, corner, size, (double)r->turn_e4 / COLA_TURN_E4) == 0 ? COLA_OK
                                                                                             : COLA_INVALID_DATA;
}

/* ---- a shape as a record */

/* A length in counts of the record's scale. The farthest place of the shape still fits (scale_of). */
static uint16_t counts_of(const struct cola_record *r, double um)
{
    return (uint16_t)lround(um / MM_UM / (double)r->scale);
}

/* Adds a direction of the shape at a beam. Several points of one beam become one. */
static void add_point(struct cola_record *r, uint32_t beam, int32_t near_um, int32_t far_um)
{
    uint32_t i = r->n;
    const uint16_t start = near_um == 0 ? COLA_FROM_HEAD : counts_of(r, near_um), stop = counts_of(r, far_um);
    while (i > 0 && r->point[i - 1].angle > beam)
        i--;
    if (i > 0 && r->point[i - 1].angle == beam) {
        if (start == COLA_FROM_HEAD || (start < r->point[i - 1].start && r->point[i - 1].start != COLA_FROM_HEAD))
            r->point[i - 1].start = start;
        if (stop > r->point[i - 1].stop) r->point[i - 1].stop = stop;
        return;
    }
    if (r->n == COLA_SHAPE_LINKS) return; /* only for shapes with more corners than the configuration allows */
    memmove(&r->point[i + 1], &r->point[i], (r->n - i) * sizeof r->point[0]);
    r->point[i].angle = (uint16_t)beam;
    r->point[i].start = start;
    r->point[i].stop = stop;
    r->n++;
}

/* Adds the direction of a beam or a corner, at the beam that is nearest to it; none where the head has no such beam. */
static void add_direction(struct cola_record *r, const struct cola_shape *shape, const struct planar_head *head,
                          double turns)
{
    const int64_t place = cola_beam_near(head, turns);
    int32_t near_um, far_um;
    if (place < 0 || place >= head->n || !cola_shape_cut(shape, turns, &near_um, &far_um) || far_um == 0) return;
    add_point(r, (uint32_t)place, near_um, far_um);
}

static double beam_turns(const struct planar_head *head, uint32_t beam)
{
    return (double)cola_beam_quarters(head, beam) / (4.0 * head->steps);
}

/* Adds the first and the last beam: a shape that is wider than the head's view ends there. */
static void add_ends(struct cola_record *r, const struct cola_shape *shape, const struct planar_head *head)
{
    add_direction(r, shape, head, beam_turns(head, 0));
    add_direction(r, shape, head, beam_turns(head, head->n - 1));
}

static void describe_sector(struct cola_record *r, const struct cola_shape *shape, const struct planar_head *head)
{
    enum { SPREAD = COLA_SHAPE_LINKS - 2 };
    add_ends(r, shape, head);
    for (uint32_t i = 0; i < SPREAD; i++)
        add_direction(r, shape, head,
                      (shape->sector.start_e4 + shape->sector.span_e4 * (i / (SPREAD - 1.0))) / COLA_TURN_E4);
}

static void describe_polygon(struct cola_record *r, const struct cola_shape *shape, const struct planar_head *head)
{
    add_ends(r, shape, head);
    for (uint32_t i = 0; i < shape->n; i++)
        if (shape->corner[i].x_um != 0 || shape->corner[i].y_um != 0)
            add_direction(r, shape, head, atan2(shape->corner[i].y_um, shape->corner[i].x_um) / COLA_TURN_RAD);
}

static double farthest_um(const struct cola_shape *shape)
{
    double far_um = 0.0;
    if (shape->kind == COLA_SHAPE_SECTOR) return shape->sector.outer_um;
    for (uint32_t i = 0; i < shape->n; i++)
        far_um = fmax(far_um, hypot(shape->corner[i].x_um, shape->corner[i].y_um));
    return far_um;
}

/* Returns millimetres per count: the least whole number with which counts of 16 bits reach as far as the shape. */
static float scale_of(const struct cola_shape *shape)
{
    return (float)fmax(1.0, ceil(farthest_um(shape) / MM_UM / MOST_COUNT));
}

static void describe_rectangle(const struct cola_field *field, struct cola_record *r, int from_first)
{
    const double turns = atan2(field->corner_um[1], field->corner_um[0]) / COLA_TURN_RAD;
    r->type = COLA_FIELD_RECTANGLE;
    r->is_segmented = 0;
    r->is_rectangle = 1;
    r->angle_e4 = (int32_t)lround(turns * COLA_TURN_E4) - (from_first ? r->first_e4 : 0);
    r->distance = counts_of(r, hypot(field->corner_um[0], field->corner_um[1]));
    r->turn_e4 = (int32_t)lround(field->turns * COLA_TURN_E4);
    r->width_mm = (uint32_t)lround(field->size_um[0] / MM_UM);
    r->length_mm = (uint32_t)lround(field->size_um[1] / MM_UM);
}

void cola_field_describe(const struct cola_field *field, const struct planar_head *head, int from_first,
                         struct cola_record *out)
{
    *out = (struct cola_record){.scale = scale_of(&field->shape),
                                .step_e4 = cola_step_angle(head),
                                .first_e4 = cola_beam_angle(head, 0),
                                .type = COLA_FIELD_SEGMENTED,
                                .is_segmented = 1};
    memcpy(out->name, field->name, sizeof out->name);
    if (field->is_rectangle)
        describe_rectangle(field, out, from_first);
    else if (field->shape.kind == COLA_SHAPE_SECTOR)
        describe_sector(out, &field->shape, head);
    else
        describe_polygon(out, &field->shape, head);
}
