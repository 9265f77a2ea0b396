/* SPDX-License-Identifier: MIT */
/* LMPscancfg and mLMPsetscancfg: line rate and step. Rate and step belong to the head, so all the head's readers see a
 * change. */
#include <stdio.h>
#include <stdlib.h>

#include "drivers/protocol/cola.h"

/* These are the statuses that mLMPsetscancfg answers. */
enum { OK, FREQUENCY_ERROR, RESOLUTION_ERROR, RESOLUTION_AND_AREA_ERROR, AREA_ERROR, OTHER_ERROR };

/* ---- the head as it is set */

const struct planar_head *cola_head(const struct cola *self)
{
    return self->spec.identity->n_geometries != 0 ? &self->head : &self->scan.head;
}

/* Gives a head another line rate and step at the same angles: one number of steps divides the other, so ends stay. */
static void take_geometry(struct planar_head *h, int64_t lines_uhz, uint32_t steps)
{
    const int64_t had = h->steps;
    h->first = (int32_t)(h->first * (int64_t)steps / had);
    h->last = (int32_t)(h->last * (int64_t)steps / had);
    h->front = (int32_t)(h->front * (int64_t)steps / had);
    h->steps = steps;
    h->n = (uint32_t)(h->last - h->first + 1);
    h->lines_uhz = (uint64_t)lines_uhz;
    h->prr_uhz = (uint64_t)lines_uhz * steps;
    h->known = h->n <= PLANAR_MAX_STEPS;
}

static double ask(struct cola *self, const char *query)
{
    char reply[PROTOCOL_REPLY];
    return self->spec.host.command(self->spec.host.ctx, query, reply, sizeof reply) == 0 ? strtod(reply, NULL) : 0.0;
}

/* A head that scans reports its settings in the stream. A head at rest does not, so it is asked for them. */
void cola_look_at_head(struct cola *self)
{
    if (self->spec.identity->n_geometries == 0) return;
    self->head = self->scan.head;
    if (!self->head.known || protocol_ask_state(&self->spec.host) == PROTOCOL_HEAD_SCANNING) return;
    const double lines_hz = ask(self, "HEAD:LINes?"), step_deg = ask(self, "SCAN:STEP?");
    if (lines_hz > 0.0 && step_deg > 0.0)
        take_geometry(&self->head, (int64_t)(lines_hz * 1e6 + 0.5), (uint32_t)(360.0 / step_deg + 0.5));
}

/* ---- LMPscancfg: u32 1/100 Hz, i16 sectors, u32 step, i32 start, i32 stop */

static void put_scan_cfg(const struct planar_head *head, struct cola_out *out)
{
    cola_put_u(out, 4, cola_scan_chz(head));
    cola_put_i(out, 2, 1);
    cola_put_u(out, 4, cola_step_angle(head));
    cola_put_i(out, 4, cola_beam_angle(head, 0));
    cola_put_i(out, 4, cola_beam_angle(head, head->n - 1));
}

enum cola_error cola_read_scan_cfg(struct cola *self)
{
    if (!cola_head(self)->known) return COLA_CONDITION;
    put_scan_cfg(cola_head(self), &self->out);
    return COLA_OK;
}

/* ---- mLMPsetscancfg: as LMPscancfg; u8 status before it in the answer */

struct scan_cfg {
    uint32_t scan_chz, step;
    int32_t sectors, start_e4, stop_e4;
};

/* Whether the beams nearest to the two ends are the head's first and last. LMPoutputRange takes nearest beams, too. */
static int area_fits(const struct planar_head *head, const struct scan_cfg *asked)
{
    return cola_beam_at(head, asked->start_e4) == 0 && cola_beam_at(head, asked->stop_e4) == head->n - 1;
}

/* Finds the geometry that is asked for. Returns the status. */
static uint32_t cola_geometry_find(const struct cola *self, const struct scan_cfg *asked, struct planar_head *found)
{
    const struct planar_head *head = cola_head(self);
    const struct protocol_identity *id = self->spec.identity;
    int rate_fits = 0, fits = 0;
    for (uint32_t i = 0; i == 0 || i < id->n_geometries; i++) {
        struct planar_head h = *head;
        if (id->n_geometries != 0) take_geometry(&h, id->geometry[i].lines_uhz, id->geometry[i].steps);
        if (!h.known || cola_scan_chz(&h) != asked->scan_chz) continue;
        rate_fits = 1;
        if (cola_step_angle(&h) != asked->step) continue;
        fits = 1;
        *found = h;
    }
    if (!rate_fits) return FREQUENCY_ERROR;
    if (!fits) return area_fits(head, asked) ? RESOLUTION_ERROR : RESOLUTION_AND_AREA_ERROR;
    if (!area_fits(found, asked)) return AREA_ERROR;
    return asked->sectors == 1 ? OK : OTHER_ERROR;
}

static int set_lines(struct cola *self)
{
    char line[48];
    snprintf(line, sizeof line, "HEAD:LINes %.6f", (double)self->next.lines_uhz / 1e6);
    return self->spec.host.command(self->spec.host.ctx, line, NULL, 0);
}

/* The order of the two commands depends on the geometry before: each step must lead to a geometry that the head has. */
static enum cola_error set_head(struct cola *self)
{
    char line[48];
    const int lines = set_lines(self);
    snprintf(line, sizeof line, "SCAN:STEP %.9f", 360.0 / self->next.steps);
    if (self->spec.host.command(self->spec.host.ctx, line, NULL, 0) != 0) return COLA_CONDITION;
    if (lines != 0 && set_lines(self) != 0) return COLA_CONDITION;
    cola_look_at_head(self);
    return COLA_OK;
}

/* Stops the head where it scans. Scans that it had made by then still come while it spins down. Returns 1 once there
 * are none; 0: not yet; -1: it may not be stopped. */
static int come_to_rest(struct cola *self)
{
    const enum protocol_head_state state = protocol_ask_state(&self->spec.host);
    if (state == PROTOCOL_HEAD_SPIN_UP || state == PROTOCOL_HEAD_SCANNING)
        return self->spec.host.command(self->spec.host.ctx, "SCAN:STOP", NULL, 0) != 0 ? -1 : 0;
    return state != PROTOCOL_HEAD_SPIN_DOWN || self->rests;
}

enum cola_error cola_set_scan_cfg(struct cola *self)
{
    struct planar_head wanted = *cola_head(self);
    const struct scan_cfg asked = {.scan_chz = self->arg[0],
                                   .sectors = (int32_t)self->arg[1],
                                   .step = self->arg[2],
                                   .start_e4 = (int32_t)self->arg[3],
                                   .stop_e4 = (int32_t)self->arg[4]};
    enum cola_error error = COLA_OK;
    if (!cola_head(self)->known || self->next.is_due) return COLA_CONDITION;
    uint32_t status = cola_geometry_find(self, &asked, &wanted);
    const int other =
        status == OK && (wanted.steps != cola_head(self)->steps || wanted.lines_uhz != cola_head(self)->lines_uhz);
    /* A scanner takes another geometry only before it was told to measure, or after it was stopped. */
    if (other && cola_is_measuring(self)) status = OTHER_ERROR;
    if (other && status == OK) {
        self->next.lines_uhz = (int64_t)wanted.lines_uhz;
        self->next.steps = wanted.steps;
        self->next.form = self->out.form;
        const int rests = come_to_rest(self);
        self->next.is_due = rests == 0;
        if (rests <= 0) return rests < 0 ? COLA_CONDITION : COLA_LATER;
        error = set_head(self);
    }
    cola_put_u(&self->out, 1, status);
    put_scan_cfg(cola_head(self), &self->out);
    return error;
}

void cola_geometry_event(struct cola *self, const struct native_event *event)
{
    if (event == NULL ? !self->next.is_due : event->code != NATIVE_EV_STATE) return;
    self->rests = event == NULL || (event->a != PROTOCOL_HEAD_SPIN_UP && event->a != PROTOCOL_HEAD_SCANNING);
}

void cola_geometry_time(struct cola *self)
{
    struct cola_out out = {.buf = self->unit, .cap = sizeof self->unit};
    const int rests = self->next.is_due ? come_to_rest(self) : 0; /* another session may have started it again */
    if (rests == 0) return;
    self->next.is_due = 0;
    const enum cola_error error = rests < 0 ? COLA_CONDITION : set_head(self);
    if (error != COLA_OK) {
        cola_refuse(self, self->next.form, error);
        return;
    }
    cola_begin(&out, self->next.form, "sAN mLMPsetscancfg");
    cola_put_u(&out, 1, OK);
    put_scan_cfg(cola_head(self), &out);
    self->spec.host.send(self->spec.host.ctx, self->unit, cola_end(&out));
}
