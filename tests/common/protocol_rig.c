/* SPDX-License-Identifier: MIT */
#include "tests/common/protocol_rig.h"

#include <inttypes.h>
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

#include "drivers/protocol/native_encode.h"

static int keep_unit(void *ctx, const void *unit, size_t len)
{
    struct protocol_rig *rig = ctx;
    assert_true(len != 0 && len <= rig->ops->max_unit);
    if (len > rig->room) return 1;
    if (rig->room != SIZE_MAX) rig->room -= len;
    assert_true(rig->n_units < RIG_UNITS && rig->len + len <= RIG_BYTES);
    while (rig->len + len > rig->cap) {
        rig->cap *= 2;
        rig->bytes = realloc(rig->bytes, rig->cap + 1);
        assert_non_null(rig->bytes);
    }
    memcpy(rig->bytes + rig->len, unit, len);
    rig->len += len;
    rig->end[rig->n_units++] = rig->len;
    return 0;
}

static int answer(void *ctx, const char *line, char *reply, size_t cap)
{
    struct protocol_rig *rig = ctx;
    assert_true(rig->n_lines < RIG_LINES && (reply == NULL ? cap == 0 : cap >= PROTOCOL_REPLY));
    snprintf(rig->line[rig->n_lines++], sizeof rig->line[0], "%s", line);
    for (const struct protocol_rig_reply *r = rig->replies; r != NULL && r->prefix != NULL; r++)
        if (strncmp(line, r->prefix, strlen(r->prefix)) == 0) {
            snprintf(reply, cap, "%s", r->reply);
            return r->error;
        }
    if (strcmp(line, "TIME:SHIFt?") == 0) return snprintf(reply, cap, "%" PRId64, rig->shift_ns), 0;
    sscanf(line, "TIME:SHIFt %" SCNd64, &rig->shift_ns);
    snprintf(reply, cap, "OK");
    return 0;
}

static int64_t date_ns(void *ctx, int64_t t_ns)
{
    const struct protocol_rig *rig = ctx;
    return t_ns + (rig->utc0_ns == INT64_MIN ? -rig->spec.power_ns : rig->utc0_ns) + rig->shift_ns;
}

static int fix(void *ctx, int64_t t_ns, struct nmea_fix *out)
{
    const struct protocol_rig *rig = ctx;
    (void)t_ns;
    *out = rig->fix;
    return rig->fix.quality != 0;
}

static void count(void *ctx, enum protocol_count what, uint64_t n)
{
    ((struct protocol_rig *)ctx)->count[what] += n;
}

static void hang_up(void *ctx)
{
    ((struct protocol_rig *)ctx)->hung_up = 1;
}

/* There is a fix for each full second of device time. */
static int64_t next_fix_ns(void *ctx, int64_t t_ns)
{
    const int64_t second_ns = 1000000000;
    (void)ctx;
    return (t_ns + second_ns - 1) / second_ns * second_ns;
}

static enum protocol_pps pps(void *ctx, int64_t t_ns, int64_t *hour_ns)
{
    const struct protocol_rig *rig = ctx;
    const int is_set = rig->utc0_ns != INT64_MIN && !rig->pps_unset;
    *hour_ns = ((is_set ? rig->utc0_ns : 0) + t_ns) % 3600000000000;
    return rig->utc0_ns == INT64_MIN ? PROTOCOL_PPS_ABSENT : rig->pps;
}

static int store(void *ctx, const char *lines)
{
    struct protocol_rig *rig = ctx;
    snprintf(rig->stored, sizeof rig->stored, "%s", lines);
    return !rig->spec.keeps;
}

const struct nmea_fix protocol_rig_fix = {.talker = {'G', 'N'},
                                          .year = 2026,
                                          .month = 1,
                                          .day = 2,
                                          .hour = 3,
                                          .minute = 4,
                                          .second = 5,
                                          .lat_deg = -33.8567844,
                                          .lon_deg = 151.2152967,
                                          .altitude_m = 87.6543,
                                          .geoid_separation_m = 22.4321,
                                          .quality = 4,
                                          .satellites = 12,
                                          .hdop = 0.9,
                                          .speed_m_s = 1.0,
                                          .course_deg = 90.0,
                                          .sigma_m = {0.01, 0.01, 0.02}};

static struct protocol_rig *opened; /* the last one */

/* A session that does something sooner than its next_ns() said would never be woken for it. */
static void checked_time(void *protocol, int64_t t_ns)
{
    struct protocol_rig *rig = opened;
    const int64_t next_ns = rig->ops->next_ns(protocol);
    const uint32_t n_units = rig->n_units, n_lines = rig->n_lines;
    assert_ptr_equal(protocol, rig->protocol);
    protocol_ops_get(rig->id)->time(protocol, t_ns);
    if (next_ns > t_ns && t_ns >= rig->latest_ns) assert_true(rig->n_units == n_units && rig->n_lines == n_lines);
    rig->latest_ns = t_ns; /* a replayed recording may begin anew, before that */
}

void protocol_rig_open(struct protocol_rig *rig, enum protocol_id id, const char *maker, const char *model)
{
    struct sh_err err;
    memset(rig, 0, sizeof *rig);
    rig->cap = 65536;
    rig->bytes = calloc(1, rig->cap + 1);
    assert_non_null(rig->bytes);
    assert_non_null(protocol_ops_get(id));
    rig->id = id;
    rig->checked = *protocol_ops_get(id);
    if (rig->checked.next_ns != NULL) rig->checked.time = checked_time;
    rig->ops = &rig->checked;
    opened = rig;
    rig->room = SIZE_MAX;
    rig->utc0_ns = INT64_MIN;
    rig->pps = PROTOCOL_PPS_LOCKED;
    snprintf(rig->identity.maker, sizeof rig->identity.maker, "%s", maker);
    snprintf(rig->identity.model, sizeof rig->identity.model, "%s", model);
    snprintf(rig->identity.serial, sizeof rig->identity.serial, "17210001");
    snprintf(rig->identity.firmware, sizeof rig->identity.firmware, "1.2.3");
    snprintf(rig->identity.name, sizeof rig->identity.name, "rig");
    rig->identity.queue_ns = 100000000;
    rig->spec = (struct protocol_spec){
        .identity = &rig->identity,
        .host = {rig, keep_unit, answer, fix, count, hang_up, next_fix_ns, pps, date_ns, store, NULL},
        .power_ons = 1};
    assert_int_equal(protocol_create(rig->ops, &rig->spec, &rig->protocol, &err), SH_OK);
    if (rig->ops->open != NULL) rig->ops->open(rig->protocol, 0);
}

void protocol_rig_close(struct protocol_rig *rig)
{
    protocol_destroy(rig->ops, rig->protocol);
    rig->protocol = NULL;
    free(rig->bytes);
    rig->bytes = NULL;
}

void protocol_rig_clear(struct protocol_rig *rig)
{
    rig->len = 0;
    rig->n_units = rig->n_lines = 0;
}

void protocol_rig_input(struct protocol_rig *rig, const char *text)
{
    rig->ops->input(rig->protocol, (const uint8_t *)text, strlen(text));
}

static void describe_head(struct protocol_rig *rig, uint32_t lines_hz, uint64_t prr_uhz)
{
    struct native_descriptor *d = &rig->descriptor;
    memset(d, 0, sizeof *d);
    snprintf(d->idn, sizeof d->idn, "%s", rig->identity.model);
    d->layout = NATIVE_POLAR;
    d->isa = 8;
    d->prr_uhz = prr_uhz;
    d->lines_uhz = (uint64_t)lines_hz * 1000000;
    d->sweep_udeg = 360000000;
    d->line_stop_udeg = 360000000;
    d->mirror_counts_per_turn = d->pan_counts_per_turn = 4294967296.0;
    d->range_scale_m = 1e-6;
    d->range_min_m = 0.1;
    d->range_max_m = 30.0;
    d->max_echoes = 3;
    d->scan = 1;
}

void protocol_rig_planar(struct protocol_rig *rig, uint32_t steps, int first, int last, int front, int turn,
                         uint32_t lines_hz)
{
    describe_head(rig, lines_hz, (uint64_t)steps * lines_hz * 1000000);
    rig->emitter = (struct native_emitter){.kind = NATIVE_EMIT_PLANAR,
                                           .steps = steps,
                                           .first_step = first,
                                           .last_step = last,
                                           .front_step = front,
                                           .turn = turn,
                                           .sequence_ns_num = 1000000000,
                                           .sequence_ns_den = (uint64_t)steps * lines_hz};
}

void protocol_rig_beams(struct protocol_rig *rig, uint32_t lines_hz)
{
    static const int elevation_deg[16] = {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};
    describe_head(rig, lines_hz, 289351851852);
    rig->descriptor.range_max_m = 100.0;
    rig->emitter = (struct native_emitter){
        .kind = NATIVE_EMIT_BEAMS, .n_beams = 16, .turn = 1, .sequence_ns_num = 55296, .sequence_ns_den = 1};
    for (uint32_t i = 0; i < 16; i++)
        rig->beam[i] = (struct native_beam){elevation_deg[i] * 1000000, 0, 2304 * i};
}

static void give(struct protocol_rig *rig, uint8_t *frame, size_t len)
{
    assert_true(len != 0);
    for (size_t at = 0, n; at < len; at += n) {
        n = native_finish_frame(frame + at, rig->seq++);
        if (rig->ops->frame != NULL) rig->ops->frame(rig->protocol, frame + at, n);
    }
}

void protocol_rig_describe(struct protocol_rig *rig, int64_t t_ns)
{
    uint8_t frame[4096];
    rig->descriptor.content = rig->attributes ? (uint32_t)NATIVE_HAS_ATTRIBUTES : 0;
    give(rig, frame, native_encode_descriptor(frame, sizeof frame, &rig->descriptor, t_ns, 0));
    give(rig, frame, native_encode_emitter(frame, sizeof frame, &rig->emitter, rig->beam, t_ns, 0));
}

static uint32_t counts(double turn)
{
    return (uint32_t)(int64_t)llround((turn - floor(turn)) * 4294967296.0);
}

static void add_point(struct line_block *b, const struct protocol_rig_run *run, uint32_t pulse, uint32_t echo)
{
    const struct protocol_rig_shot *shot = &run->shot[pulse];
    const uint32_t i = b->n_points++;
    const int hit = shot->n != 0;
    b->dt_ns[i] = (uint32_t)run->dt_ns[pulse];
    b->a[i] = hit ? (uint32_t)llround(shot->range_m[echo] * 1e6) : 0;
    b->b[i] = counts(run->mirror_turn[pulse]);
    b->c[i] = counts(run->pan_turn[pulse]);
    b->refl_cdb[i] = hit ? shot->refl_cdb[echo] : (int16_t)LINE_REFL_NONE;
    b->echo[i] = hit ? (uint8_t)((echo + 1) | shot->n << 4) : 0;
    b->label[i] = hit ? 0 : (uint16_t)LINE_LABEL_NONE;
    if (b->amplitude_cdb == NULL) return;
    b->amplitude_cdb[i] = hit ? shot->amplitude_cdb[echo] : (int16_t)LINE_AMPLITUDE_NONE;
    b->width_cns[i] = hit ? 400 : LINE_WIDTH_NONE;
}

void protocol_rig_points(struct protocol_rig *rig, const struct protocol_rig_run *run)
{
    struct line_block b;
    struct sh_err err;
    assert_int_equal(line_block_alloc(&b, 3 * run->n, &err), SH_OK);
    b.frame = run->frame;
    b.line = run->line;
    b.pulse0 = run->pulse0;
    b.n_pulses = run->n;
    b.t0_ns = run->t0_ns;
    b.line_t0_ns = run->line_t0_ns;
    b.layout = LINE_POLAR;
    if (rig->attributes) assert_int_equal(line_block_alloc_attributes(&b, &err), SH_OK);
    for (uint32_t i = 0; i < run->n; i++)
        for (uint32_t k = 0; k == 0 || k < run->shot[i].n; k++)
            add_point(&b, run, i, k);
    const size_t cap = native_points_bound(b.n_points) + native_attributes_bound(b.n_points);
    uint8_t *frames = malloc(cap);
    assert_non_null(frames);
    give(rig, frames, native_encode_points(frames, cap, &b, rig->scan_t0_ns));
    free(frames);
    line_block_free(&b);
}

void protocol_rig_line_end(struct protocol_rig *rig, const struct line_end *end)
{
    uint8_t frame[256];
    give(rig, frame, native_encode_line_end(frame, sizeof frame, end, rig->scan_t0_ns));
}

/* The rig computes it exactly, as the head does. */
static int64_t firing_ns(const struct native_emitter *e, uint64_t pulse)
{
    return (int64_t)(pulse * e->sequence_ns_num / e->sequence_ns_den);
}

void protocol_rig_part(struct protocol_rig *rig, uint32_t line, uint32_t from, uint32_t n,
                       const struct protocol_rig_shot *shot)
{
    enum { MOST = 4096 };
    static const double level[MOST];
    double pan_turn[MOST];
    int64_t dt_ns[MOST];
    const struct native_emitter *e = &rig->emitter;
    const int first = e->first_step + (int)from;
    const uint64_t line0 = (uint64_t)line * e->steps, pulse0 = line0 + (uint32_t)first;
    const int64_t t0_ns = firing_ns(e, pulse0);
    assert_true(n <= MOST);
    for (uint32_t i = 0; i < n; i++) {
        dt_ns[i] = firing_ns(e, pulse0 + i) - t0_ns;
        pan_turn[i] = (double)(e->turn * (first + (int)i - e->front_step)) / e->steps;
    }
    const struct protocol_rig_run run = {line,  line,  pulse0,   n,   t0_ns, firing_ns(e, line0),
                                         dt_ns, level, pan_turn, shot};
    protocol_rig_points(rig, &run);
}

int64_t protocol_rig_turn_end(struct protocol_rig *rig, uint32_t line, uint32_t status)
{
    const struct native_emitter *e = &rig->emitter;
    const uint64_t pulse0 = (uint64_t)line * e->steps;
    const struct line_end end = {.frame = line,
                                 .line = line,
                                 .pulse0 = pulse0,
                                 .n_fired = e->steps,
                                 .n_cast = (uint32_t)(e->last_step - e->first_step) + 1,
                                 .t0_ns = firing_ns(e, pulse0),
                                 .t1_ns = firing_ns(e, pulse0 + e->steps),
                                 .status = status};
    protocol_rig_line_end(rig, &end);
    return rig->scan_t0_ns + end.t1_ns;
}

void protocol_rig_turn(struct protocol_rig *rig, uint32_t line, const struct protocol_rig_shot *shot, uint32_t part)
{
    const uint32_t n = (uint32_t)(rig->emitter.last_step - rig->emitter.first_step) + 1;
    assert_true(part != 0);
    for (uint32_t at = 0; at < n; at += part)
        protocol_rig_part(rig, line, at, n - at < part ? n - at : part, shot + at);
    const int64_t end_ns = protocol_rig_turn_end(rig, line, LINE_LAST_OF_FRAME);
    if (rig->ops->time != NULL) rig->ops->time(rig->protocol, end_ns);
}
