/* The telegram LMDscandata; COLA.md draws it. Both forms are this one sequence of values. */
#include <math.h>
#include <string.h>

#include "drivers/protocol/cola.h"
#include "drivers/protocol/cola_clock.h"

enum { VERSION = 1, DEVICE = 1 };

/* Device time in us, as 32 bits count it. */
static uint32_t ticks_us(int64_t t_ns)
{
    return (uint32_t)((uint64_t)t_ns / 1000u);
}

static uint32_t serial_number(const char *text)
{
    uint32_t v = 0;
    for (; *text != 0; text++)
        if (*text >= '0' && *text <= '9') v = v * 10 + (uint32_t)(*text - '0');
    return v;
}

static void put_head(const struct cola *self, const struct cola_scan *scan, struct cola_out *out)
{
    const struct cola_geometry *g = &self->collector.geometry;
    cola_put_u(out, 2, VERSION);
    cola_put_u(out, 2, DEVICE);
    cola_put_u(out, 4, serial_number(self->identity->serial));
    cola_put_u(out, 1, 0); /* device status: no error */
    cola_put_u(out, 1, 0);
    cola_put_u(out, 2, self->telegrams);
    cola_put_u(out, 2, scan->counter);
    cola_put_u(out, 4, ticks_us(scan->t0_ns));
    cola_put_u(out, 4, ticks_us(self->now_ns));
    for (int i = 0; i < 4; i++)
        cola_put_u(out, 1, 0); /* two bytes of inputs, two of outputs */
    cola_put_i(out, 2, 0);     /* layer angle */
    cola_put_u(out, 4, g->scan_chz);
    cola_put_u(out, 4, g->meas_100hz);
}

static void put_encoder(const struct cola *self, const struct cola_scan *scan, struct cola_out *out)
{
    const int on = self->set.encoder[0] != 0 || self->set.encoder[1] != 0;
    cola_put_u(out, 2, on ? 1 : 0);
    if (!on) return;
    cola_put_i(out, 4, scan->path_mm);
    cola_put_i(out, 2, scan->speed_mm_s);
}

/* The beams that are sent. */
struct beams {
    uint32_t first, n;
};

static struct beams sent_beams(const struct cola *self)
{
    const struct cola_geometry *g = &self->collector.geometry;
    if (self->set.n_beams == 0 || self->set.first_beam + self->set.n_beams > g->n) return (struct beams){0, g->n};
    return (struct beams){self->set.first_beam, self->set.n_beams};
}

static void put_channel_head(const struct cola_geometry *g, struct cola_out *out, const char *name, uint32_t scale,
                             struct beams beams)
{
    cola_put_word(out, name);
    cola_put_float(out, (float)scale);
    cola_put_float(out, 0.0f);
    cola_put_i(out, 4, cola_beam_angle(g, beams.first));
    cola_put_u(out, 2, (3600000 + g->steps / 2) / g->steps);
    cola_put_u(out, 2, beams.n);
}

static void put_distances(const struct cola *self, const uint32_t *range, struct cola_out *out, const char *name)
{
    const struct cola_geometry *g = &self->collector.geometry;
    const uint32_t scale = self->set.scale != 0 ? self->set.scale : g->scale;
    const double counts = g->mm_per_count / scale;
    const struct beams beams = sent_beams(self);
    uint64_t lost = 0;
    put_channel_head(g, out, name, scale, beams);
    for (uint32_t i = beams.first; i < beams.first + beams.n; i++) {
        const double v = range[i] * counts + 0.5;
        const uint32_t distance = v < 65536.0 ? (uint32_t)v : 0;
        if (distance == 0 && range[i] != 0) lost++;
        cola_put_u(out, 2, distance);
    }
    if (lost != 0) self->host.count(self->host.ctx, PROTOCOL_POINTS_LOST, lost);
}

static void put_signals(const struct cola *self, const uint16_t *signal, struct cola_out *out, const char *name)
{
    const unsigned bytes = self->set.rssi_16bit ? 2 : 1;
    const struct beams beams = sent_beams(self);
    put_channel_head(&self->collector.geometry, out, name, 1, beams);
    for (uint32_t i = beams.first; i < beams.first + beams.n; i++) {
        const uint32_t upper = signal[i] >> 8 != 0 || signal[i] == 0 ? signal[i] >> 8 : 1;
        cola_put_u(out, bytes, bytes == 2 ? signal[i] : upper);
    }
}

/* Which echo is in channel k (from 0). */
static enum cola_echo echo_of(const struct cola *self, unsigned k)
{
    if (k == 1) return COLA_SECOND;
    return self->set.filter == COLA_FILTER_LAST ? COLA_LAST : COLA_FIRST;
}

static void put_all_signals(const struct cola *self, const struct cola_scan *scan, struct cola_out *out)
{
    static const char *const names[2] = {"RSSI1", "RSSI2"};
    for (unsigned k = 0; k < 2; k++)
        if (self->set.channels[0] >> k & 1u) put_signals(self, scan->signal[echo_of(self, k)], out, names[k]);
}

static void put_channels(const struct cola *self, const struct cola_scan *scan, struct cola_out *out)
{
    static const char *const names[2] = {"DIST1", "DIST2"};
    const uint32_t n = (self->set.channels[0] & 1u) + (self->set.channels[0] >> 1 & 1u);
    const uint32_t n_signals = self->set.rssi ? n : 0;
    cola_put_u(out, 2, n + (self->set.rssi_16bit ? n_signals : 0));
    for (unsigned k = 0; k < 2; k++)
        if (self->set.channels[0] >> k & 1u) put_distances(self, scan->range[echo_of(self, k)], out, names[k]);
    if (n_signals != 0 && self->set.rssi_16bit) put_all_signals(self, scan, out);
    cola_put_u(out, 2, self->set.rssi_16bit ? 0 : n_signals);
    if (n_signals != 0 && !self->set.rssi_16bit) put_all_signals(self, scan, out);
}

static void put_time(const struct cola *self, const struct cola_scan *scan, struct cola_out *out)
{
    const struct cola_date d = cola_date_of(cola_clock_ns(self, scan->t0_ns));
    cola_put_u(out, 2, d.year);
    cola_put_u(out, 1, d.month);
    cola_put_u(out, 1, d.day);
    cola_put_u(out, 1, d.hour);
    cola_put_u(out, 1, d.minute);
    cola_put_u(out, 1, d.second);
    cola_put_u(out, 4, d.us);
}

static void put_tail(const struct cola *self, const struct cola_scan *scan, struct cola_out *out)
{
    const int named = self->set.name && self->set.location[0] != 0;
    cola_put_u(out, 2, 0); /* position: there is none */
    cola_put_u(out, 2, named ? 1 : 0);
    if (named) cola_put_text(out, self->set.location);
    cola_put_u(out, 2, 0); /* comment: there is none */
    cola_put_u(out, 2, self->set.time ? 1 : 0);
    if (self->set.time) put_time(self, scan, out);
    cola_put_u(out, 2, 0); /* event: there is none */
}

void cola_put_scan(const struct cola *self, const struct cola_scan *scan, struct cola_out *out)
{
    put_head(self, scan, out);
    put_encoder(self, scan, out);
    put_channels(self, scan, out);
    put_tail(self, scan, out);
}
