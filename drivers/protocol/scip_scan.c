#include "drivers/protocol/scip_scan.h"

#include <math.h>
#include <string.h>

#include "core/line.h"

void scip_scan_init(struct scip_scan *s)
{
    memset(s, 0, sizeof *s);
}

static uint32_t millimetres(double range_m)
{
    return range_m > 0 && range_m < 4e6 ? (uint32_t)lround(range_m * 1e3) : 0;
}

static void take_descriptor(struct scip_scan *s, const struct native_descriptor *d)
{
    if (d->scan != s->scan) s->in_turn = 0;
    s->scan = d->scan;
    s->lines_uhz = d->lines_uhz;
    s->min_mm = millimetres(d->range_min_m);
    s->max_mm = millimetres(d->range_max_m);
    s->amplitudes = (d->content & NATIVE_HAS_ATTRIBUTES) != 0;
    s->pan_counts = d->pan_counts_per_turn;
    s->range_scale_mm = d->range_scale_m * 1e3;
}

static int same_steps(const struct native_emitter *a, const struct native_emitter *b)
{
    return a->kind == b->kind && a->steps == b->steps && a->first_step == b->first_step &&
           a->last_step == b->last_step && a->front_step == b->front_step && a->turn == b->turn;
}

/* Another speed leaves the turn at hand as it is. */
static void take_emitter(struct scip_scan *s, const struct native_emitter *e)
{
    if (same_steps(e, &s->emitter)) return;
    s->emitter = *e;
    s->in_turn = 0;
    s->known = e->kind == NATIVE_EMIT_PLANAR && e->first_step >= 0 && e->first_step <= e->last_step &&
               e->last_step < SCIP_MAX_STEPS && e->steps > 0 && e->steps <= INT32_MAX / 2 && e->front_step >= 0 &&
               (uint32_t)e->front_step < e->steps;
    s->first = e->first_step;
    s->last = e->last_step;
    s->steps = e->steps;
    s->front = e->turn < 0 ? e->front_step : e->first_step + e->last_step - e->front_step;
}

/* SCIP's number of the step that looks at a pan count; -1: none of first..last. */
static int32_t step_of(const struct scip_scan *s, uint32_t pan)
{
    const double angle = (double)pan / s->pan_counts * s->steps; /* clockwise from y, in steps */
    int64_t step = s->emitter.front_step + s->emitter.turn * (int64_t)llround(angle);
    step = (step - s->first) % (int64_t)s->steps;
    if (step < 0) step += s->steps;
    step += s->first;
    if (step > s->last) return -1;
    return (int32_t)(s->emitter.turn < 0 ? step : s->first + s->last - step);
}

/* The turn that a frame belongs to, by the time of its step 0. Returns how many before it are broken. */
static uint32_t turn_to(struct scip_scan *s, uint32_t line, int64_t t0_ns, int from_start)
{
    uint32_t broken = 0;
    if (s->in_turn && t0_ns == s->t0_ns) return 0;
    if (s->in_turn && !s->done) broken++;
    if (s->in_turn && t0_ns > s->t0_ns && line > s->line) broken += line - s->line - 1;
    s->done = !s->in_turn && !from_start; /* a client that joins within a turn has not lost it */
    s->in_turn = 1;
    s->line = line;
    s->t0_ns = t0_ns;
    s->n_seen = s->n_points = 0;
    for (int32_t i = s->first; i <= s->last; i++)
        s->step[i].n = SCIP_UNSEEN;
    return broken;
}

/* Whether the points begin with the step that is fired first. */
static int from_start(const struct scip_scan *s, const uint8_t *payload, const struct native_points *points)
{
    struct native_point p;
    if (points->n_points == 0) return 0;
    native_decode_point(payload, 0, &p);
    return step_of(s, p.c) == (s->emitter.turn < 0 ? s->first : s->last);
}

static uint16_t add_point(struct scip_scan *s, const struct native_point *p)
{
    const int32_t number = step_of(s, p->c);
    if (number < 0) return UINT16_MAX;
    struct scip_step *step = &s->step[number];
    const int begins = p->echo <= 1;
    if (begins && step->n != SCIP_UNSEEN) return UINT16_MAX;
    if (begins) {
        step->n = 0;
        s->n_seen++;
    }
    if (p->echo == 0 || step->n >= SCIP_MAX_ECHOES) return UINT16_MAX;
    const double range_mm = p->a * s->range_scale_mm;
    step->range_mm[step->n] = range_mm < 4e9 ? (uint32_t)llround(range_mm) : UINT32_MAX;
    step->level_cdb[step->n] = p->refl_cdb == LINE_REFL_NONE ? (int16_t)SCIP_LEVEL_NONE : p->refl_cdb;
    return (uint16_t)(number * 4 + step->n++);
}

static int is_whole(struct scip_scan *s)
{
    if (s->done || s->n_points != 0 || s->n_seen != (uint32_t)(s->last - s->first) + 1) return 0;
    return s->done = 1;
}

static struct scip_turns take_points(struct scip_scan *s, const struct native_header *header, const uint8_t *payload,
                                     const struct native_points *points)
{
    const int64_t t0_ns = header->t_ns - points->t0_ns + points->line_t0_ns;
    struct scip_turns turns = {.broken = turn_to(s, points->line, t0_ns, from_start(s, payload, points))};
    if (s->n_points != 0) { /* the attributes of the points before are missing */
        s->done = 1;
        turns.broken++;
    }
    s->n_points = 0;
    s->pulse0 = points->pulse0;
    if (s->done) return turns;
    for (uint32_t i = 0; i < points->n_points; i++) {
        struct native_point p;
        native_decode_point(payload, i, &p);
        s->at[i] = add_point(s, &p);
    }
    s->n_points = s->amplitudes ? points->n_points : 0;
    turns.whole = is_whole(s);
    return turns;
}

static struct scip_turns take_attributes(struct scip_scan *s, const uint8_t *payload,
                                         const struct native_attributes *head)
{
    struct scip_turns turns = {0, 0};
    if (!s->in_turn || s->done || head->pulse0 != s->pulse0 || head->line != s->line || head->n_points != s->n_points)
        return turns;
    for (uint32_t i = 0; i < head->n_points; i++) {
        struct native_attribute a;
        if (s->at[i] == UINT16_MAX) continue;
        native_decode_attribute(payload, i, &a);
        s->step[s->at[i] / 4].level_cdb[s->at[i] % 4] =
            a.amplitude_cdb == NATIVE_AMPLITUDE_NONE ? (int16_t)SCIP_LEVEL_NONE : a.amplitude_cdb;
    }
    s->n_points = 0;
    turns.whole = is_whole(s);
    return turns;
}

static struct scip_turns take_line_end(struct scip_scan *s, const struct native_header *header,
                                       const struct line_end *end)
{
    struct scip_turns turns = {.broken = turn_to(s, end->line, header->t_ns - end->t1_ns + end->t0_ns, 0)};
    if (!s->done && (end->status & LINE_PARTIAL) == 0) turns.broken++;
    s->done = 1;
    return turns;
}

struct scip_turns scip_scan_frame(struct scip_scan *s, const uint8_t *frame)
{
    const uint8_t *payload = frame + NATIVE_HEADER_LEN;
    union {
        struct native_descriptor descriptor;
        struct native_emitter emitter;
        struct native_points points;
        struct native_attributes attributes;
        struct line_end end;
    } u;
    struct native_header header;
    native_read_header(frame, &header);
    memset(&u, 0, sizeof u);
    if (header.type == NATIVE_DESCRIPTOR) {
        if (native_decode_descriptor(payload, header.length, &u.descriptor) == 0) take_descriptor(s, &u.descriptor);
    } else if (header.type == NATIVE_EMITTER) {
        if (native_decode_emitter(payload, header.length, &u.emitter) == 0) take_emitter(s, &u.emitter);
    } else if (s->known && s->pan_counts > 0) {
        if (header.type == NATIVE_POINTS && native_decode_points(payload, header.length, &u.points) == 0)
            return take_points(s, &header, payload, &u.points);
        if (header.type == NATIVE_ATTRIBUTES && native_decode_attributes(payload, header.length, &u.attributes) == 0)
            return take_attributes(s, payload, &u.attributes);
        if (header.type == NATIVE_LINE_END && native_decode_line_end(payload, header.length, &u.end) == 0)
            return take_line_end(s, &header, &u.end);
    }
    return (struct scip_turns){0, 0};
}
