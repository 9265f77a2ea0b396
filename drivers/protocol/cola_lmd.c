/* SPDX-License-Identifier: MIT */
/* The telegram LMDscandata; COLA.md draws it. CoLa-A and CoLa-B write the same values in the same order. */

#include "drivers/protocol/cola.h"

enum { VERSION = 1, DEVICE = 1 };

static uint32_t serial_number(const char *text)
{
    uint32_t v = 0;
    for (; *text != 0; text++)
        if (*text >= '0' && *text <= '9') v = v * 10 + (uint32_t)(*text - '0');
    return v;
}

static void put_head(const struct cola *self, struct cola_out *out)
{
    const struct planar_head *head = &self->scan.head;
    const struct planar_turn *turn = self->scan.whole;
    cola_put_u(out, 2, VERSION);
    cola_put_u(out, 2, DEVICE);
    cola_put_u(out, 4, serial_number(self->spec.identity->serial));
    cola_put_u(out, 1, 0); /* device status: no error */
    cola_put_u(out, 1, 0);
    cola_put_u(out, 2, self->telegrams);
    cola_put_u(out, 2, (uint16_t)(turn->number - self->spec.near_wrap));
    cola_put_u(out, 4, cola_time_us(self, turn->t0_ns));
    cola_put_u(out, 4, cola_time_us(self, self->now_ns));
    cola_put_u(out, 1, 0); /* two bytes of inputs, two of outputs */
    cola_put_u(out, 1, self->ports.seen);
    cola_put_u(out, 1, 0);
    cola_put_u(out, 1, cola_outputs(self));
    cola_put_i(out, 2, 0); /* layer angle */
    cola_put_u(out, 4, cola_scan_chz(head));
    cola_put_u(out, 4, cola_meas_100hz(head));
}

static void put_encoder(const struct cola *self, struct cola_out *out)
{
    const int on = self->set.encoder[0] != 0 || self->set.encoder[1] != 0;
    cola_put_u(out, 2, on ? 1 : 0);
    if (!on) return;
    cola_put_i(out, 4, self->encoder.path_mm);
    cola_put_i(out, 2, self->encoder.speed_mm_s);
}

static void put_channel_head(const struct planar_head *head, struct cola_out *out, const char *name, uint32_t scale,
                             struct cola_beams beams)
{
    cola_put_word(out, name);
    cola_put_float(out, (float)scale);
    cola_put_float(out, 0.0f);
    cola_put_i(out, 4, cola_beam_angle(head, beams.first));
    cola_put_u(out, 2, cola_step_angle(head));
    cola_put_u(out, 2, beams.n);
}

/* The echo of a beam in channel k (from 0); NULL: none. */
static const struct planar_echo *echo_of(const struct cola *self, unsigned k, uint32_t beam)
{
    const struct planar_echo *echo = self->scan.whole->echo[beam];
    const uint32_t n = self->scan.whole->n[beam];
    if (k == 1) return n > 1 ? &echo[1] : NULL;
    if (n == 0) return NULL;
    return self->set.filter == COLA_ECHOES_LAST ? &echo[n - 1] : &echo[0];
}

static void put_distances(const struct cola *self, unsigned k, struct cola_out *out)
{
    static const char *const names[2] = {"DIST1", "DIST2"};
    const struct planar_head *head = &self->scan.head;
    const uint32_t scale = self->set.scale != 0 ? self->set.scale : cola_head_scale(head);
    const double counts = head->m_per_count * 1000.0 / scale;
    const struct cola_beams beams = cola_sent_beams(self, &self->scan.head);
    uint64_t lost = 0;
    put_channel_head(head, out, names[k], scale, beams);
    for (uint32_t i = beams.first; i < beams.first + beams.n; i++) {
        const struct planar_echo *echo = echo_of(self, k, i);
        const double v = echo != NULL ? echo->range * counts + 0.5 : 0.0;
        const uint32_t distance = v < 65536.0 ? (uint32_t)v : 0;
        if (distance == 0 && v != 0.0) lost++;
        cola_put_u(out, 2, distance);
    }
    if (lost != 0) self->spec.host.count(self->spec.host.ctx, PROTOCOL_POINTS_LOST, lost);
}

static void put_signals(const struct cola *self, unsigned k, struct cola_out *out)
{
    static const char *const names[2] = {"RSSI1", "RSSI2"};
    const unsigned bytes = self->set.rssi_16bit ? 2 : 1;
    const struct cola_beams beams = cola_sent_beams(self, &self->scan.head);
    put_channel_head(&self->scan.head, out, names[k], 1, beams);
    for (uint32_t i = beams.first; i < beams.first + beams.n; i++) {
        const struct planar_echo *echo = echo_of(self, k, i);
        const uint32_t signal = echo != NULL ? cola_echo_signal(echo) : 0;
        const uint32_t upper = signal >> 8 != 0 || signal == 0 ? signal >> 8 : 1;
        cola_put_u(out, bytes, bytes == 2 ? signal : upper);
    }
}

static void put_all_signals(const struct cola *self, struct cola_out *out)
{
    for (unsigned k = 0; k < 2; k++)
        if (self->set.channels[0] >> k & 1u) put_signals(self, k, out);
}

static void put_channels(const struct cola *self, struct cola_out *out)
{
    const uint32_t n = (self->set.channels[0] & 1u) + (self->set.channels[0] >> 1 & 1u);
    const uint32_t n_signals = self->set.rssi ? n : 0;
    cola_put_u(out, 2, n + (self->set.rssi_16bit ? n_signals : 0));
    for (unsigned k = 0; k < 2; k++)
        if (self->set.channels[0] >> k & 1u) put_distances(self, k, out);
    if (n_signals != 0 && self->set.rssi_16bit) put_all_signals(self, out);
    cola_put_u(out, 2, self->set.rssi_16bit ? 0 : n_signals);
    if (n_signals != 0 && !self->set.rssi_16bit) put_all_signals(self, out);
}

static void put_tail(const struct cola *self, struct cola_out *out)
{
    const int named = self->set.name && self->set.location[0] != 0;
    cola_put_u(out, 2, 0); /* position: there is none */
    cola_put_u(out, 2, named ? 1 : 0);
    if (named) cola_put_text(out, self->set.location);
    cola_put_u(out, 2, 0); /* comment: there is none */
    cola_put_u(out, 2, self->set.time ? 1 : 0);
    if (self->set.time) cola_put_time(self, self->scan.whole->t0_ns, out);
    cola_put_u(out, 2, 0); /* event: there is none */
}

void cola_put_scan(const struct cola *self, struct cola_out *out)
{
    put_head(self, out);
    put_encoder(self, out);
    put_channels(self, out);
    put_tail(self, out);
}
