/* SPDX-License-Identifier: MIT */
/* Fields, inputs and outputs. None is active; the answers say so, in the form of the real scanner. COLA.md draws it. */
#include <stdio.h>
#include <string.h>

#include "drivers/protocol/cola.h"

enum { N_INPUTS = 4, N_OUTPUTS_OF_LMS = 3, FREE = 0, NOT_USED = 2, SEGMENTED = 2, RESULT_INVALID = 0 };

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

/* float scale, float offset, u32 step, i32 first angle: how a field counts distances and angles */
static void put_grid(const struct cola *self, struct cola_out *out)
{
    cola_put_float(out, 1.0f);
    cola_put_float(out, 0.0f);
    cola_put_u(out, 4, cola_step_angle(cola_head(self)));
    cola_put_i(out, 4, cola_beam_angle(cola_head(self), 0));
}

/* grid, u8 type, u8 number, u16 segmented (and u16 points), u16 rectangular, radial, dynamic, u16 1 and text name,
 * u16 no comment */
enum cola_error cola_read_field(struct cola *self, uint32_t field, struct cola_args *args, struct cola_out *out)
{
    const struct cola_model *model = self->model;
    char name[16] = "";
    if (field >= model->n_records) {
        cola_put_u(out, 1, 0);
        return cola_args_end(args);
    }
    if (!cola_head(self)->known) return COLA_CONDITION;
    put_grid(self, out);
    cola_put_u(out, 1, SEGMENTED);
    cola_put_u(out, 1, model->named ? field + 1 : 0);
    cola_put_u(out, 2, model->named);
    if (model->named) cola_put_u(out, 2, 0);
    for (int i = 0; i < 3; i++)
        cola_put_u(out, 2, 0);
    cola_put_u(out, 2, 1);
    if (model->named) snprintf(name, sizeof name, "Field%03u", (unsigned)field + 1);
    cola_put_text(out, name);
    cola_put_u(out, 2, 0);
    return cola_args_end(args);
}

/* u16 fields, each: u16 version, u8 number, u32 count, grid, u8 result, 3 x u16 0, u16 1 and time of day */
enum cola_error cola_read_field_results(struct cola *self, struct cola_args *args, struct cola_out *out)
{
    if (self->model->n_results != 0 && !cola_head(self)->known) return COLA_CONDITION;
    cola_put_u(out, 2, self->model->n_results);
    for (uint32_t i = 1; i <= self->model->n_results; i++) {
        cola_put_u(out, 2, 1);
        cola_put_u(out, 1, i);
        cola_put_u(out, 4, 0);
        put_grid(self, out);
        cola_put_u(out, 1, RESULT_INVALID);
        for (int k = 0; k < 3; k++)
            cola_put_u(out, 2, 0);
        cola_put_u(out, 2, 1);
        cola_put_time(self, self->now_ns, out);
    }
    return cola_args_end(args);
}

/* ---- inputs and outputs */

/* u16 version, u32 time of the last change, 4 x u8 input, u16 no time of day */
enum cola_error cola_read_inputs(struct cola *self, struct cola_args *args, struct cola_out *out)
{
    const int lms = self->model->ports == COLA_PORTS_LMS;
    cola_put_u(out, 2, (uint32_t)lms);
    cola_put_u(out, 4, 0);
    for (int i = 0; i < N_INPUTS; i++)
        cola_put_u(out, 1, lms ? NOT_USED : FREE);
    cola_put_u(out, 2, 0);
    return cola_args_end(args);
}

/* u16 version, u32 time, outputs of u8 state, u32 changes, u16 time of day: 0, or 1 and that */
static void put_outputs(const struct cola *self, struct cola_out *out)
{
    const int lms = self->model->ports == COLA_PORTS_LMS;
    cola_put_u(out, 2, (uint32_t)lms);
    cola_put_u(out, 4, cola_time_us(self, self->now_ns));
    for (int i = 0; i < self->model->n_outputs; i++) {
        cola_put_u(out, 1, lms && i >= N_OUTPUTS_OF_LMS ? NOT_USED : FREE);
        cola_put_u(out, 4, 0);
    }
    cola_put_u(out, 2, (uint32_t)lms);
    if (lms) cola_put_time(self, self->now_ns, out);
}

enum cola_error cola_read_outputs(struct cola *self, struct cola_args *args, struct cola_out *out)
{
    put_outputs(self, out);
    return cola_args_end(args);
}

void cola_send_outputs(struct cola *self)
{
    struct cola_out out = {.buf = self->unit, .cap = sizeof self->unit};
    self->outputs_due = 0;
    cola_begin(&out, self->stream_form, "sSN LIDoutputstate");
    put_outputs(self, &out);
    self->host.send(self->host.ctx, self->unit, cola_end(&out));
}
