/* SPDX-License-Identifier: MIT */
/* Telegrams of fields, inputs and outputs, in the form of the real scanners. FIELDS.md draws the telegrams. */
#include <stdio.h>
#include <string.h>

#include "drivers/protocol/cola.h"

enum { N_OUTPUTS_OF_LMS = 3, NOT_USED = 2, FIELDS_OF_SET = 3, SETS = 16 };

static int cola_ports_is_lms(const struct cola *self)
{
    return self->model->ports == COLA_PORTS_LMS;
}

/* ---- what is watched */

/* A TiM watches the three fields of a set, for an output each. An LMS watches all its fields that have a shape. */
void cola_ports_select(struct cola *self)
{
    uint32_t numbers[COLA_WATCH_SLOTS], n = 0;
    uint8_t outputs[COLA_WATCH_SLOTS];
    if (cola_ports_is_lms(self)) {
        for (uint32_t i = 0; i < self->model->n_records; i++) {
            const struct cola_field *field = &self->fields.field[i];
            if (field->shape.kind == COLA_SHAPE_NONE) continue;
            outputs[n] = field->output;
            numbers[n++] = i;
        }
    } else {
        for (; n < self->model->n_results; n++) {
            outputs[n] = (uint8_t)(n + 1);
            numbers[n] = (self->ports.set - 1U) * FIELDS_OF_SET + n;
        }
    }
    cola_watch_select(&self->watch, &self->fields, numbers, outputs, n);
}

void cola_fields_load(struct cola *self)
{
    if (self->spec.identity->fields != NULL)
        self->fields = *self->spec.identity->fields;
    else
        memset(&self->fields, 0, sizeof self->fields);
    self->ports.by_telegram = 0;
    self->ports.set = (uint16_t)(self->ports.seen + 1);
    cola_ports_select(self);
}

void cola_ports_reset(struct cola *self)
{
    memset(&self->ports, 0, sizeof self->ports);
    memset(&self->watch, 0, sizeof self->watch);
    cola_fields_load(self);
}

unsigned cola_ports_scan(struct cola *self)
{
    return cola_watch_scan(&self->watch, &self->fields, &self->scan.head, self->scan.whole,
                           (enum cola_echoes)self->set.filter);
}

uint32_t cola_outputs(const struct cola *self)
{
    uint32_t bits = 0;
    for (uint32_t i = 0; i < COLA_WATCH_OUTPUTS; i++)
        bits |= (uint32_t)self->watch.output[i].active << i;
    return bits;
}

/* ---- fields */

uint32_t cola_field_number(const char *name)
{
    uint32_t number = 0;
    if (strncmp(name, "field", 5) != 0 || strlen(name) != 8) return UINT32_MAX;
    for (name += 5; *name != 0; name++) {
        if (*name < '0' || *name > '9') return UINT32_MAX;
        number = 10 * number + (uint32_t)(*name - '0');
    }
    return number;
}

/* The record of a field without a shape. */
static void describe_empty(const struct cola *self, struct cola_record *r)
{
    *r = (struct cola_record){.scale = 1.0f,
                              .step_e4 = cola_step_angle(cola_head(self)),
                              .first_e4 = cola_beam_angle(cola_head(self), 0),
                              .type = COLA_FIELD_SEGMENTED,
                              .is_segmented = self->model->named};
    if (self->model->named) snprintf(r->name, sizeof r->name, "Field%03u", (unsigned)self->field + 1);
}

/* The angle of a rectangle's corner counts from the first beam in a TiM, from angle 0 in an LMS1xx. */
enum cola_error cola_read_field(struct cola *self)
{
    const struct cola_field *f = &self->fields.field[self->field];
    struct cola_record record;
    if (self->field >= self->model->n_records) {
        cola_put_u(&self->out, 1, 0);
        return COLA_OK;
    }
    if (!cola_head(self)->known) return COLA_CONDITION;
    if (f->has_record) {
        cola_record_put(&f->record, &self->out);
        return COLA_OK;
    }
    if (f->shape.kind == COLA_SHAPE_NONE)
        describe_empty(self, &record);
    else
        cola_field_describe(f, cola_head(self), !cola_ports_is_lms(self), &record);
    record.number = (uint8_t)(self->model->named || f->shape.kind != COLA_SHAPE_NONE ? self->field + 1 : 0);
    cola_record_put(&record, &self->out);
    return COLA_OK;
}

/* The field keeps the response time and the blanking size of the configuration: no telegram is known that has them. */
enum cola_error cola_write_field(struct cola *self)
{
    struct cola_field *f = &self->fields.field[self->field];
    struct cola_record record;
    struct cola_shape shape;
    enum cola_error error = cola_record_take(&self->args, &record);
    if (error != COLA_OK) return error;
    if (!cola_head(self)->known) return COLA_CONDITION;
    error = cola_record_shape(&record, cola_head(self), !cola_ports_is_lms(self), &shape);
    if (error != COLA_OK) return error;
    f->record = record;
    f->has_record = 1;
    f->shape = shape;
    cola_ports_select(self);
    return COLA_OK;
}

/* ---- results

 * u16 fields, each: u16 version, u8 number, u32 count, grid, u8 result, 3 x u16 0, u16 1 and time of day. The grid is
 * that of records: float scale, float offset, u32 step, i32 first angle. */
static void put_results(const struct cola *self, struct cola_out *out)
{
    cola_put_u(out, 2, self->watch.n);
    for (uint32_t i = 0; i < self->watch.n; i++) {
        const struct cola_slot *slot = &self->watch.slot[i];
        cola_put_u(out, 2, 1);
        cola_put_u(out, 1, cola_ports_is_lms(self) ? slot->field + 1 : i + 1);
        cola_put_u(out, 4, 0);
        cola_put_float(out, 1.0f);
        cola_put_float(out, 0.0f);
        cola_put_u(out, 4, cola_step_angle(cola_head(self)));
        cola_put_i(out, 4, cola_beam_angle(cola_head(self), 0));
        cola_put_u(out, 1, slot->result);
        for (int k = 0; k < 3; k++)
            cola_put_u(out, 2, 0);
        cola_put_u(out, 2, 1);
        cola_put_time(self, slot->changed_ns != 0 ? slot->changed_ns : self->now_ns, out);
    }
}

enum cola_error cola_read_field_results(struct cola *self)
{
    if (self->watch.n != 0 && !cola_head(self)->known) return COLA_CONDITION;
    put_results(self, &self->out);
    return COLA_OK;
}

/* ---- which set of fields a TiM watches. Other models don't have these variables. */

int cola_has_sets(const struct cola *self)
{
    return !cola_ports_is_lms(self) && self->model->n_results != 0;
}

enum cola_error cola_read_set_method(struct cola *self)
{
    cola_put_u(&self->out, 1, self->ports.by_telegram);
    return COLA_OK;
}

static void take_set(struct cola *self, uint32_t set)
{
    if (set == self->ports.set) return;
    self->ports.set = (uint16_t)set;
    cola_ports_select(self);
}

enum cola_error cola_write_set_method(struct cola *self)
{
    self->ports.by_telegram = (uint8_t)self->arg[0];
    if (!self->ports.by_telegram) take_set(self, self->ports.seen + 1);
    return COLA_OK;
}

enum cola_error cola_read_set(struct cola *self)
{
    cola_put_u(&self->out, 2, self->ports.set);
    return COLA_OK;
}

enum cola_error cola_write_set(struct cola *self)
{
    const uint32_t set = self->arg[0];
    if (set < 1 || set > SETS) return COLA_INVALID_DATA;
    if (!self->ports.by_telegram) return COLA_CONDITION;
    take_set(self, set);
    return COLA_OK;
}

/* ---- inputs and outputs */

/* u16 version, u32 time of the last change, 4 x u8 input, u16 no time of day */
static void put_inputs(const struct cola *self, struct cola_out *out)
{
    const int lms = cola_ports_is_lms(self), is_used = self->fields.n_windows != 0;
    cola_put_u(out, 2, (uint32_t)lms);
    cola_put_u(out, 4, self->ports.changed_us);
    for (int i = 0; i < COLA_INPUTS; i++)
        cola_put_u(out, 1, lms && !is_used ? (uint32_t)NOT_USED : self->ports.seen >> i & 1U);
    cola_put_u(out, 2, 0);
}

enum cola_error cola_read_inputs(struct cola *self)
{
    put_inputs(self, &self->out);
    return COLA_OK;
}

/* u16 version, u32 time, for each output u8 state and u32 count, then u16 0, or u16 1 and the time of day */
static void put_outputs(const struct cola *self, struct cola_out *out)
{
    const int lms = cola_ports_is_lms(self);
    cola_put_u(out, 2, (uint32_t)lms);
    cola_put_u(out, 4, cola_time_us(self, self->now_ns));
    for (int i = 0; i < self->model->n_outputs; i++) {
        const struct cola_output none = {0, 0}, *o = i < COLA_WATCH_OUTPUTS ? &self->watch.output[i] : &none;
        cola_put_u(out, 1, lms && i >= N_OUTPUTS_OF_LMS ? (uint32_t)NOT_USED : o->active);
        cola_put_u(out, 4, o->count);
    }
    cola_put_u(out, 2, (uint32_t)lms);
    if (lms) cola_put_time(self, self->now_ns, out);
}

enum cola_error cola_read_outputs(struct cola *self)
{
    put_outputs(self, &self->out);
    return COLA_OK;
}

/* ---- events */

static void send_event(struct cola *self, enum cola_form form, const char *head,
                       void (*put)(const struct cola *self, struct cola_out *out))
{
    struct cola_out out = {.buf = self->unit, .cap = sizeof self->unit};
    cola_begin(&out, form, head);
    put(self, &out);
    self->spec.host.send(self->spec.host.ctx, self->unit, cola_end(&out));
}

void cola_send_outputs(struct cola *self, enum cola_form form)
{
    self->outputs_due = 0;
    send_event(self, form, "sSN LIDoutputstate", put_outputs);
}

void cola_ports_report(struct cola *self, unsigned news)
{
    if ((news & COLA_NEW_RESULT) != 0 && self->ports.results)
        send_event(self, self->stream_form, "sSN LFErec", put_results);
    if ((news & COLA_NEW_OUTPUT) != 0 && self->ports.outputs) cola_send_outputs(self, self->stream_form);
}

/* Inputs choose the set of fields, unless telegrams do. The first input is the lowest bit. */
void cola_ports_time(struct cola *self)
{
    const uint32_t now = cola_inputs_at(&self->fields, self->now_ns, &self->ports.next_ns);
    if (now == self->ports.seen) return;
    self->ports.seen = now;
    self->ports.changed_us = cola_time_us(self, self->now_ns);
    if (!cola_ports_is_lms(self) && !self->ports.by_telegram) take_set(self, now + 1);
    cola_follow_dialect(self);
    if (self->ports.inputs) send_event(self, self->stream_form, "sSN LIDinputstate", put_inputs);
}

enum cola_error cola_set_results_event(struct cola *self)
{
    self->ports.results = (int)self->arg[0];
    return COLA_OK;
}

enum cola_error cola_set_inputs_event(struct cola *self)
{
    self->ports.inputs = (int)self->arg[0];
    return COLA_OK;
}

/* A scanner of the LMS kind sends the state once when it is asked for, though nothing has changed. */
enum cola_error cola_set_outputs_event(struct cola *self)
{
    self->ports.outputs = (int)self->arg[0];
    self->outputs_due = self->ports.outputs && cola_ports_is_lms(self);
    return COLA_OK;
}
