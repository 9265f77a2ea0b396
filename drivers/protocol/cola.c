/* SPDX-License-Identifier: MIT */
/* SICK CoLa-A and CoLa-B (SOPAS): TiM5xx, TiM7xx, LMS1xx. COLA.md is the protocol's page. */
#include <stdio.h>
#include <stdlib.h>

#include "drivers/protocol/cola.h"

enum { TRY_NS = 100000000, COLA_MIN_STEPS = 55 };

int cola_power_up(struct cola *self, struct sh_err *err)
{
    cola_settings_reset(self);
    cola_ports_reset(self);
    self->level = COLA_RUN;
    self->measures = 1;
    self->streams = self->started = self->reboots = self->next.is_due = 0;
    scan_wish_reset(&self->wish, self->spec.identity);
    self->n_waiting = self->since_sent = 0;
    self->telegrams = (uint16_t)(0U - self->spec.near_wrap);
    const int rc = cola_restore(self, err);
    self->power_framing = self->set.framing;
    return rc;
}

uint32_t cola_time_us(const struct cola *self, int64_t t_ns)
{
    return (uint32_t)((uint64_t)(t_ns - self->spec.power_ns) / 1000U) - self->spec.near_wrap;
}

static int cola_create(const struct protocol_spec *spec, void **protocol, struct sh_err *err)
{
    struct cola *self = calloc(1, sizeof *self);
    if (self == NULL) return sh_fail(err, SH_ENOMEM, "protocol cola: no memory for %zu bytes", sizeof *self);
    self->spec = *spec;
    self->model = cola_model_find(spec->identity->model);
    if (spec->stored != NULL) snprintf(self->stored, sizeof self->stored, "%s", spec->stored);
    planar_scan_init(&self->scan);
    const int rc = cola_power_up(self, err);
    if (rc != SH_OK)
        free(self);
    else
        *protocol = self;
    return rc;
}

static void open_at(void *protocol, int64_t t_ns)
{
    struct cola *self = protocol;
    self->now_ns = t_ns;
    cola_ports_time(self);
}

static void send_scan(struct cola *self, const char *head, enum cola_form form)
{
    struct cola_out out = {.buf = self->unit, .cap = sizeof self->unit};
    cola_begin(&out, form, head);
    cola_put_scan(self, &out);
    const size_t len = cola_end(&out);
    if (len == 0) {
        self->spec.host.count(self->spec.host.ctx, PROTOCOL_UNITS_LOST, 1);
        return;
    }
    if (self->spec.host.send(self->spec.host.ctx, self->unit, len) == 0) self->telegrams++;
}

static void deliver_scan(struct cola *self)
{
    for (uint32_t i = 0; i < self->n_waiting; i++)
        send_scan(self, "sRA LMDscandata", (enum cola_form)self->waiting_form[i]);
    self->n_waiting = 0;
    if (!self->streams || !self->measures || ++self->since_sent < self->set.every) return;
    self->since_sent = 0;
    send_scan(self, "sSN LMDscandata", self->stream_form);
}

void cola_deliver(struct cola *self)
{
    if (!self->pending) return;
    cola_follow_dialect(self);
    self->pending = 0;
    scan_wish_take_turn(&self->wish, &self->scan, &self->spec.host);
    if (!cola_is_measuring(self)) self->wish.lasts = 0; /* polls are answered with any scan */
    const unsigned news = self->watch.on && self->measures ? cola_ports_scan(self) : 0;
    deliver_scan(self);
    cola_ports_report(self, news);
}

static void take_frame(void *protocol, const uint8_t *frame, size_t len)
{
    struct cola *self = protocol;
    struct native_header h;
    (void)len;
    native_read_header(frame, &h);
    if (h.type == NATIVE_POINTS) {
        if (h.t_ns > self->now_ns) self->now_ns = h.t_ns;
        cola_deliver(self); /* the points may overwrite the scan that waits to be sent */
    }
    struct native_event event;
    if (h.type == NATIVE_EVENT && native_decode_event(frame + NATIVE_HEADER_LEN, h.length, &event) == SH_OK)
        cola_geometry_event(self, &event);
    const struct planar_news news = planar_scan_frame(&self->scan, frame);
    if (h.type == NATIVE_POSES) cola_way_add(&self->way, self->scan.scan, frame + NATIVE_HEADER_LEN, h.length);
    if (news.begun)
        self->encoder_now = cola_way_at(&self->way, self->scan.scan, native_since_ns(h.t_ns, self->scan.scan_t0_ns));
    if (news.whole) self->encoder = self->encoder_now;
    if (news.whole) self->pending = 1;
    if (self->scan.whole == NULL) self->pending = 0;
    if (news.broken != 0 && self->streams && self->measures)
        self->spec.host.count(self->spec.host.ctx, PROTOCOL_UNITS_LOST, news.broken);
}

/* A scan shows by itself what it lacks; an event does not. */
static void take_gap(void *protocol, uint32_t n_frames)
{
    (void)n_frames;
    cola_geometry_event(protocol, NULL);
}

static void pass_time(void *protocol, int64_t t_ns)
{
    struct cola *self = protocol;
    if (t_ns > self->now_ns) self->now_ns = t_ns;
    cola_deliver(self);
    cola_geometry_time(self);
    if (t_ns >= self->ports.next_ns) cola_ports_time(self);
    if (!self->wish.lasts || t_ns < self->try_ns) return;
    self->try_ns = t_ns + TRY_NS;
    cola_start_scan(self);
}

/* 1: the last scan has the geometry that the head is set to. */
static int is_as_set(const struct cola *self)
{
    const struct planar_head *had = &self->scan.head, *set = cola_head(self);
    return self->scan.whole != NULL && had->steps == set->steps && had->lines_uhz == set->lines_uhz;
}

enum cola_error cola_read_scan(struct cola *self, struct cola_args *args, struct cola_out *out)
{
    (void)args;
    if (is_as_set(self)) {
        cola_put_scan(self, out);
        self->telegrams++;
        return COLA_OK;
    }
    if (self->n_waiting == COLA_MOST_WAITING || cola_start_scan(self) != 0) return COLA_CONDITION;
    self->waiting_form[self->n_waiting++] = (uint8_t)out->form;
    return COLA_LATER;
}

static int owes(const void *protocol)
{
    const struct cola *self = protocol;
    return self->streams || self->n_waiting != 0 || self->reboots || self->next.is_due || self->outputs_due ||
           self->ports.results || self->ports.outputs || self->ports.inputs;
}

static int64_t next_time(const void *protocol)
{
    const struct cola *self = protocol;
    const int64_t next_ns = self->wish.lasts && self->try_ns < self->ports.next_ns ? self->try_ns : self->ports.next_ns;
    return self->pending || self->next.is_due ? self->now_ns : next_ns;
}

static void take_input(void *protocol, const uint8_t *bytes, size_t len)
{
    struct cola *self = protocol;
    struct cola_request request;
    uint64_t lost = 0;
    while (len != 0) {
        const size_t n = cola_input_add(&self->input, bytes, len);
        bytes += n;
        len -= n;
        for (int found; (found = cola_input_next(&self->input, &request, &lost)) != 0;)
            if (!cola_understands(self, found < 0 ? COLA_A : request.form))
                lost += self->input.used; /* 0 for a telegram that is too long: its bytes are counted already */
            else if (found < 0)
                cola_refuse(self, COLA_A, COLA_TOO_LONG);
            else
                cola_carry_out(self, &request);
    }
    if (lost != 0) self->spec.host.count(self->spec.host.ctx, PROTOCOL_INPUT_LOST, lost);
}

/* Telegrams have the angle of a step as u16, 1/10000 degree. */
static int check_head(const struct native_descriptor *d, const struct native_emitter *e, const uint8_t *beams,
                      struct sh_err *err)
{
    (void)beams;
    if (e->steps < COLA_MIN_STEPS)
        return sh_fail(err, SH_EINPUT, "%u steps a turn; allowed are %d and more, of 6.5535 degrees at most", e->steps,
                       (int)COLA_MIN_STEPS);
    return planar_scan_check(d->pan_counts_per_turn, e, PLANAR_MAX_TURN, err);
}

const struct protocol_ops protocol_cola = {
    .name = "cola",
    .needs = PROTOCOL_NEEDS_POLAR,
    .emitters = 1u << NATIVE_EMIT_PLANAR,
    .max_unit = COLA_MAX_UNIT,
    .content = cola_content,
    .reseal = cola_reseal,
    .check_head = check_head,
    .create = cola_create,
    .destroy = free,
    .open = open_at,
    .frame = take_frame,
    .gap = take_gap,
    .time = pass_time,
    .input = take_input,
    .owes = owes,
    .next_ns = next_time,
};
