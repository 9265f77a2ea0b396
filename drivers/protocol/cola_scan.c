#include "drivers/protocol/cola_scan.h"

#include <math.h>
#include <string.h>

enum { TURN_E4 = 3600000, FORWARD_E4 = 900000, MOST_DISTANCE = 65535, NO_BEAM = 0xffff };

void cola_collect_init(struct cola_collector *c)
{
    memset(c, 0, sizeof *c);
    c->now = &c->scan[0];
}

/* ---- geometry */

/* a / b to the nearest, b > 0. */
static int64_t nearest(int64_t a, int64_t b)
{
    return a >= 0 ? (a + b / 2) / b : -((-a + b / 2) / b);
}

int32_t cola_beam_angle(const struct cola_geometry *g, uint32_t beam)
{
    const int64_t last = (int64_t)g->first + g->n - 1;
    const int64_t from_front = (g->turn < 0 ? g->first - (int64_t)g->front : g->front - last) + beam;
    return (int32_t)(FORWARD_E4 + nearest(from_front * TURN_E4, g->steps));
}

static void set_descriptor(struct cola_geometry *g, const struct native_descriptor *d)
{
    const double reach_mm = d->range_max_m * 1000.0;
    g->known = 1;
    g->counts_per_turn = d->pan_counts_per_turn;
    g->mm_per_count = d->range_scale_m * 1000.0;
    g->scale = reach_mm > MOST_DISTANCE ? 2 : 1;
    g->scan_chz = (uint32_t)((d->lines_uhz + 5000) / 10000);
    g->meas_100hz = (uint32_t)((d->prr_uhz + 50000000) / 100000000);
}

static void set_emitter(struct cola_geometry *g, const struct native_emitter *e)
{
    const int64_t n = (int64_t)e->last_step - e->first_step + 1;
    g->fits = e->kind == NATIVE_EMIT_PLANAR && e->steps != 0 && n > 0 && n <= COLA_MAX_POINTS && e->first_step >= 0 &&
              (uint32_t)e->last_step < e->steps;
    if (!g->fits) return;
    g->steps = e->steps;
    g->n = (uint32_t)n;
    g->first = e->first_step;
    g->front = e->front_step;
    g->turn = e->turn;
    g->start_e4 = cola_beam_angle(g, 0);
}

/* The beam that looks along this pan count; NO_BEAM: none. */
static uint32_t beam_of_pan(const struct cola_geometry *g, uint32_t pan)
{
    const int64_t turned = llround(pan / g->counts_per_turn * g->steps);
    int64_t step = (g->front + g->turn * turned) % g->steps;
    if (step < 0) step += g->steps;
    const int64_t i = step - g->first;
    if (i < 0 || i >= g->n) return NO_BEAM;
    return (uint32_t)(g->turn < 0 ? i : g->n - 1 - i);
}

/* ---- signals: 1024 counts a dB, that is 0.25 dB for each count of the upper byte */

static uint16_t signal_of(int32_t cdb)
{
    const int32_t v = (cdb * 1024 + 50) / 100;
    return (uint16_t)(v < 1 ? 1 : v > 65535 ? 65535 : v);
}

static uint16_t signal_of_reflectance(int16_t refl_cdb)
{
    return refl_cdb == LINE_REFL_NONE ? 0 : signal_of(refl_cdb + 6400);
}

static void set_echo(struct cola_scan *s, uint32_t beam, uint8_t echo, uint32_t range, uint16_t signal)
{
    const enum cola_echo to = echo == 1 ? COLA_FIRST : COLA_SECOND;
    s->range[COLA_LAST][beam] = range;
    s->signal[COLA_LAST][beam] = signal;
    if (echo > 2) return;
    s->range[to][beam] = range;
    s->signal[to][beam] = signal;
}

/* ---- how far a moving head has come; taken as even from one frame of poses to the next */

static void take_poses(struct cola_collector *c, const uint8_t *payload, size_t len)
{
    struct native_pose p;
    uint32_t n;
    if (native_decode_poses(payload, len, &n) != 0) return;
    for (uint32_t i = 0; i < n; i++) {
        native_decode_pose(payload, i, &p);
        const double *a = c->pose_m, *b = p.position_m;
        if (!c->have_pose) c->pose_t0_ns = c->pose_t1_ns = p.t_ns;
        if (i == 0 && c->have_pose) {
            c->pose_t0_ns = c->pose_t1_ns;
            c->path0_m = c->path1_m;
        }
        if (c->have_pose && p.t_ns > c->pose_t1_ns) {
            c->path1_m += hypot(hypot(b[0] - a[0], b[1] - a[1]), b[2] - a[2]);
            c->pose_t1_ns = p.t_ns;
        }
        memcpy(c->pose_m, b, sizeof c->pose_m);
        c->have_pose = 1;
    }
}

static void set_path(const struct cola_collector *c, struct cola_scan *s, int64_t t_ns)
{
    const double span_ns = (double)(c->pose_t1_ns - c->pose_t0_ns), way_m = c->path1_m - c->path0_m;
    double part = span_ns > 0 ? (double)(t_ns - c->pose_t0_ns) / span_ns : 1.0;
    double speed_mm_s = span_ns > 0 ? way_m * 1e12 / span_ns : 0.0;
    if (part < 0.0) part = 0.0;
    if (part > 1.0) part = 1.0;
    if (speed_mm_s > INT16_MAX) speed_mm_s = INT16_MAX;
    s->path_mm = (int32_t)(uint32_t)(uint64_t)llround((c->path0_m + part * way_m) * 1000.0);
    s->speed_mm_s = (int16_t)lround(speed_mm_s);
}

/* ---- lines */

static void drop_line(struct cola_collector *c, int count)
{
    if (!c->line_is_open) return;
    c->line_is_open = 0;
    c->points_wait = 0;
    if (count && !c->line_joined) c->lost++;
}

static void open_line(struct cola_collector *c, const struct native_points *p, int64_t scan_t0_ns)
{
    struct cola_scan *s = c->now;
    drop_line(c, 1);
    const uint32_t next = c->have_line ? c->line + 1 : 0;
    if (c->present && p->line > next) c->lost += p->line - next;
    for (int k = 0; k < COLA_N_ECHOES; k++) {
        memset(s->range[k], 0, c->geometry.n * sizeof s->range[k][0]);
        memset(s->signal[k], 0, c->geometry.n * sizeof s->signal[k][0]);
    }
    memset(s->got, 0, c->geometry.n);
    s->t0_ns = scan_t0_ns + p->line_t0_ns;
    s->counter = (uint16_t)(c->counter0 + p->line);
    set_path(c, s, p->t0_ns);
    c->line_joined = !c->present; /* maybe its beginning was before our time */
    c->have_line = c->present = c->line_is_open = 1;
    c->line = p->line;
    c->n_got = c->n_points = c->n_attributes = 0;
}

static int is_done(struct cola_collector *c)
{
    if (!c->line_is_open || c->n_got != c->geometry.n || c->points_wait) return 0;
    if (c->has_attributes && c->n_attributes != c->n_points) return 0;
    c->last = c->now;
    c->now = c->last == &c->scan[0] ? &c->scan[1] : &c->scan[0];
    c->line_is_open = 0;
    return 1;
}

static int take_points(struct cola_collector *c, const uint8_t *payload, size_t len, int64_t t_ns)
{
    struct native_points p;
    struct native_point point;
    uint32_t beam = NO_BEAM;
    if (!c->geometry.fits || !(c->geometry.counts_per_turn > 0.0) || native_decode_points(payload, len, &p) != 0)
        return 0;
    if (!c->have_line || p.line != c->line) open_line(c, &p, t_ns - p.t0_ns);
    if (!c->line_is_open) return 0;
    for (uint32_t i = 0; i < p.n_points; i++) {
        native_decode_point(payload, i, &point);
        if (point.echo <= 1) {
            beam = beam_of_pan(&c->geometry, point.c);
            if (beam != NO_BEAM && !c->now->got[beam]) c->n_got += c->now->got[beam] = 1;
        }
        if (beam != NO_BEAM && point.echo != 0)
            set_echo(c->now, beam, point.echo, point.a, signal_of_reflectance(point.refl_cdb));
        c->beam_of[i] = (uint16_t)beam;
        c->echo_of[i] = point.echo;
    }
    c->n_points += p.n_points;
    c->points = p;
    c->points_wait = c->has_attributes;
    return is_done(c);
}

static int take_attributes(struct cola_collector *c, const uint8_t *payload, size_t len)
{
    struct native_attributes a;
    struct native_attribute v;
    if (!c->points_wait || native_decode_attributes(payload, len, &a) != 0) return 0;
    c->points_wait = 0;
    if (a.pulse0 != c->points.pulse0 || a.line != c->points.line || a.n_points != c->points.n_points) return 0;
    for (uint32_t i = 0; i < a.n_points; i++) {
        native_decode_attribute(payload, i, &v);
        const uint32_t beam = c->beam_of[i];
        if (beam == NO_BEAM || c->echo_of[i] == 0 || v.amplitude_cdb == NATIVE_AMPLITUDE_NONE) continue;
        const uint16_t signal = signal_of(v.amplitude_cdb);
        if (c->echo_of[i] <= 2) c->now->signal[c->echo_of[i] == 1 ? COLA_FIRST : COLA_SECOND][beam] = signal;
        c->now->signal[COLA_LAST][beam] = signal;
    }
    c->n_attributes += a.n_points;
    return is_done(c);
}

static void take_line_end(struct cola_collector *c, const uint8_t *payload, size_t len)
{
    struct line_end end;
    if (native_decode_line_end(payload, len, &end) != 0 || !c->have_line) return;
    if (end.line == c->line) drop_line(c, !(end.status & LINE_PARTIAL));
}

static void take_descriptor(struct cola_collector *c, const uint8_t *payload, size_t len)
{
    struct native_descriptor d;
    if (native_decode_descriptor(payload, len, &d) != 0) return;
    if (d.scan != c->scan_number) {
        drop_line(c, 0);
        if (c->have_line) c->counter0 += c->line + 1;
        c->have_line = c->have_pose = 0;
        c->path0_m = c->path1_m = 0.0;
        c->pose_t0_ns = c->pose_t1_ns = 0;
    }
    c->scan_number = d.scan;
    c->has_attributes = (d.content & NATIVE_HAS_ATTRIBUTES) != 0;
    set_descriptor(&c->geometry, &d);
}

static void take_emitter(struct cola_collector *c, const uint8_t *payload, size_t len)
{
    struct native_emitter e;
    struct cola_geometry g = c->geometry;
    if (native_decode_emitter(payload, len, &e) != 0) return;
    set_emitter(&g, &e);
    if (g.fits != c->geometry.fits || g.steps != c->geometry.steps || g.first != c->geometry.first ||
        g.n != c->geometry.n || g.front != c->geometry.front || g.turn != c->geometry.turn) {
        drop_line(c, 0);
        c->last = NULL; /* it has other beams */
    }
    c->geometry = g;
}

int cola_collect(struct cola_collector *c, const uint8_t *frame)
{
    const uint8_t *payload = frame + NATIVE_HEADER_LEN;
    struct native_header h;
    native_read_header(frame, &h);
    switch (h.type) {
    case NATIVE_DESCRIPTOR:
        take_descriptor(c, payload, h.length);
        return 0;
    case NATIVE_EMITTER:
        take_emitter(c, payload, h.length);
        return 0;
    case NATIVE_POSES:
        take_poses(c, payload, h.length);
        return 0;
    case NATIVE_POINTS:
        return take_points(c, payload, h.length, h.t_ns);
    case NATIVE_ATTRIBUTES:
        return take_attributes(c, payload, h.length);
    case NATIVE_LINE_END:
        take_line_end(c, payload, h.length);
        return 0;
    default:
        return 0;
    }
}
