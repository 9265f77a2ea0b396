/* SPDX-License-Identifier: MIT */
#include "drivers/protocol/planar_scan.h"

#include <stddef.h>
#include <string.h>

enum { NOWHERE = UINT16_MAX };

void planar_scan_init(struct planar_scan *s)
{
    memset(s, 0, offsetof(struct planar_scan, at));
    s->now = &s->turn[0];
    s->t0_ns = INT64_MIN;
    s->fresh = s->done = 1;
}

/* ---- the head */

int planar_scan_check(double pan_counts, const struct native_emitter *e, uint32_t max_steps, struct sh_err *err)
{
    const int64_t n = (int64_t)e->last_step - e->first_step + 1;
    if (e->steps == 0 || e->steps > max_steps || e->last_step < 0 || (uint32_t)e->last_step >= e->steps)
        return sh_fail(err, SH_EINPUT, "steps up to %d of %u a turn; allowed are %u a turn at most", e->last_step,
                       e->steps, max_steps);
    if (e->first_step < 0 || n < 1 || n > PLANAR_MAX_STEPS)
        return sh_fail(err, SH_EINPUT, "a field of view of steps %d to %d; allowed are 1 to %d steps of a turn",
                       e->first_step, e->last_step, (int)PLANAR_MAX_STEPS);
    if (e->front_step < 0 || (uint32_t)e->front_step >= e->steps || !(pan_counts >= 1))
        return sh_fail(err, SH_EINPUT,
                       "step %d in front, and %.10g encoder counts a turn; allowed are a step of the "
                       "turn, and 1 count and more",
                       e->front_step, pan_counts);
    return SH_OK;
}

static void take_head(struct planar_scan *s)
{
    const struct native_emitter *e = &s->emitter;
    struct planar_head *h = &s->head;
    h->known = e->kind == NATIVE_EMIT_PLANAR && planar_scan_check(s->pan_counts, e, PLANAR_MAX_TURN, NULL) == SH_OK;
    if (!h->known) return;
    h->steps = e->steps;
    h->n = (uint32_t)(e->last_step - e->first_step) + 1;
    h->first = e->first_step;
    h->last = e->last_step;
    h->front = e->turn < 0 ? e->front_step : e->first_step + e->last_step - e->front_step;
    s->steps_per_count = e->steps / s->pan_counts;
    s->pan0_place = (uint32_t)(h->front - h->first + (int32_t)e->steps) % e->steps;
}

/* The descriptor of a new scan ends the turn at hand. A repeated one doesn't: the turn may belong to its scan. */
static void take_descriptor(struct planar_scan *s, const struct native_descriptor *d, uint8_t flags)
{
    struct planar_head *h = &s->head;
    const int repeated = (flags & NATIVE_REPEAT) != 0;
    if (d->scan != s->scan && !repeated) {
        s->done = 1;
        s->scan_t0_ns = INT64_MIN;
    }
    /* A new local descriptor says that a replayed recording jumps within the scan: the turns between are no loss. */
    if ((flags & NATIVE_LOCAL) != 0 && !repeated) s->fresh = s->done = 1;
    s->scan = d->scan;
    s->pan_counts = d->pan_counts_per_turn;
    h->lines_uhz = d->lines_uhz;
    h->prr_uhz = d->prr_uhz;
    h->range_min_m = d->range_min_m;
    h->range_max_m = d->range_max_m;
    h->m_per_count = d->range_scale_m;
    h->attributes = (d->content & NATIVE_HAS_ATTRIBUTES) != 0;
    take_head(s);
}

static int same_steps(const struct native_emitter *a, const struct native_emitter *b)
{
    return a->kind == b->kind && a->steps == b->steps && a->first_step == b->first_step &&
           a->last_step == b->last_step && a->front_step == b->front_step && a->turn == b->turn;
}

/* An emitter frame that comes with another speed has the same steps, and leaves the turn at hand as it is. */
static void take_emitter(struct planar_scan *s, const struct native_emitter *e)
{
    if (same_steps(e, &s->emitter)) return;
    s->emitter = *e;
    s->whole = NULL;
    s->fresh = s->done = 1;
    take_head(s);
}

/* Returns the place of the step at a pan count. Pan counts grow clockwise, places counter-clockwise. */
static uint32_t planar_scan_place_of(const struct planar_scan *s, uint32_t pan)
{
    const uint64_t turned = (uint64_t)(pan * s->steps_per_count + 0.5);
    uint32_t place =
        s->pan0_place + s->head.steps - (uint32_t)(turned < s->head.steps ? turned : turned % s->head.steps);
    if (place >= s->head.steps) place -= s->head.steps;
    return place < s->head.n ? place : (uint32_t)NOWHERE;
}

/* ---- turns */

/* Begins the turn that a frame of time t_ns belongs to, unless it is the one at hand. from_start: the frame has the
 * first pulse of its turn. */
static void turn_to(struct planar_scan *s, int64_t t_ns, int64_t scan_t0_ns, uint32_t line, int64_t line_t0_ns,
                    int from_start, struct planar_news *news)
{
    const int same_scan = s->seen && scan_t0_ns == s->scan_t0_ns;
    if (same_scan && line == s->line && !s->fresh) return;
    if (!s->fresh) {
        const uint32_t next = same_scan ? s->line + 1 : 0;
        if (!s->done) news->broken++;
        if (line > next) news->broken += line - next;
    }
    /* Where the first turns of a scan are missing and are no loss (fresh), they get no numbers. */
    if (s->seen && !same_scan) s->number0 += s->line + 1 - (s->fresh ? line : 0);
    s->done = s->fresh && !from_start;
    s->fresh = 0;
    s->seen = news->begun = 1;
    if (!same_scan) s->scan_came_ns = t_ns;
    s->scan_t0_ns = scan_t0_ns;
    s->line = line;
    s->now->scan_t0_ns = scan_t0_ns;
    s->now->scan_came_ns = s->scan_came_ns;
    s->now->t0_ns = s->t0_ns = native_after_ns(scan_t0_ns, line_t0_ns);
    s->now->number = s->number0 + line;
    s->n_seen = s->n_waiting = 0;
    memset(s->now->n, PLANAR_UNSEEN, s->head.n);
}

static void break_turn(struct planar_scan *s, struct planar_news *news)
{
    s->done = 1;
    s->n_waiting = 0;
    news->broken++;
}

static void end_if_whole(struct planar_scan *s, struct planar_news *news)
{
    if (s->n_waiting != 0 || s->n_seen != s->head.n) return;
    s->whole = s->now;
    s->now = s->now == &s->turn[0] ? &s->turn[1] : &s->turn[0];
    s->done = news->whole = 1;
}

static int from_start(const struct planar_scan *s, const uint8_t *payload, const struct native_points *points)
{
    struct native_point p;
    if (points->n_points == 0) return 0;
    native_decode_point(payload, 0, &p);
    return planar_scan_place_of(s, p.c) == (s->emitter.turn < 0 ? 0 : s->head.n - 1);
}

/* ---- points and attributes */

static uint16_t add_echo(struct planar_turn *turn, uint32_t place, const struct native_point *p)
{
    if (turn->n[place] < PLANAR_ECHOES) turn->n[place]++;
    const uint32_t k = turn->n[place] - 1u;
    turn->echo[place][k] = (struct planar_echo){p->a, p->refl_cdb, NATIVE_AMPLITUDE_NONE};
    return (uint16_t)(place * PLANAR_ECHOES + k);
}

static void add_points(struct planar_scan *s, const uint8_t *payload, uint32_t n)
{
    struct planar_turn *turn = s->now;
    uint32_t place = NOWHERE;
    for (uint32_t i = 0; i < n; i++) {
        struct native_point p;
        native_decode_point(payload, i, &p);
        if (p.echo <= 1) { /* a pulse begins; all of it is in this frame */
            place = planar_scan_place_of(s, p.c);
            if (place != NOWHERE && turn->n[place] != PLANAR_UNSEEN) place = NOWHERE; /* it came before */
            if (place != NOWHERE) turn->n[place] = 0;
            s->n_seen += place != NOWHERE;
        }
        s->at[i] = place == NOWHERE || p.echo == 0 ? (uint16_t)NOWHERE : add_echo(turn, place, &p);
    }
}

static void planar_scan_take_points(struct planar_scan *s, const struct native_header *header, const uint8_t *payload,
                                    const struct native_points *points, struct planar_news *news)
{
    turn_to(s, header->t_ns, native_since_ns(header->t_ns, points->t0_ns), points->line, points->line_t0_ns,
            from_start(s, payload, points), news);
    if (s->n_waiting != 0) break_turn(s, news); /* the attributes of the points before are missing */
    if (s->done) return;
    add_points(s, payload, points->n_points);
    s->pulse0 = points->pulse0;
    s->n_waiting = s->head.attributes ? points->n_points : 0;
    end_if_whole(s, news);
}

/* Ignores attributes that belong to other points than the last ones. The last points then still lack their attributes,
 * so the next points or the end of the line break the turn. */
static void take_attributes(struct planar_scan *s, const uint8_t *payload, const struct native_attributes *head,
                            struct planar_news *news)
{
    if (s->done || s->n_waiting == 0) return;
    if (head->pulse0 != s->pulse0 || head->line != s->line || head->n_points != s->n_waiting) return;
    for (uint32_t i = 0; i < head->n_points; i++) {
        struct native_attribute a;
        if (s->at[i] == NOWHERE) continue;
        native_decode_attribute(payload, i, &a);
        s->now->echo[s->at[i] / PLANAR_ECHOES][s->at[i] % PLANAR_ECHOES].amplitude_cdb = a.amplitude_cdb;
    }
    s->n_waiting = 0;
    end_if_whole(s, news);
}

static void take_line_end(struct planar_scan *s, const struct native_header *header, const struct line_end *end,
                          struct planar_news *news)
{
    turn_to(s, header->t_ns, native_since_ns(header->t_ns, end->t1_ns), end->line, end->t0_ns, 0, news);
    if (!s->done && (end->status & LINE_PARTIAL) == 0) break_turn(s, news);
    s->done = 1;
}

struct planar_news planar_scan_frame(struct planar_scan *s, const uint8_t *frame)
{
    const uint8_t *payload = frame + NATIVE_HEADER_LEN;
    struct planar_news news = {0, 0, 0};
    union {
        struct native_descriptor descriptor;
        struct native_emitter emitter;
        struct native_points points;
        struct native_attributes attributes;
        struct line_end end;
    } u;
    struct native_header h;
    native_read_header(frame, &h);
    if (h.type == NATIVE_DESCRIPTOR) {
        if (native_decode_descriptor(payload, h.length, &u.descriptor) == 0) take_descriptor(s, &u.descriptor, h.flags);
    } else if (h.type == NATIVE_EMITTER) {
        if (native_decode_emitter(payload, h.length, &u.emitter) == 0) take_emitter(s, &u.emitter);
    } else if (s->head.known) {
        if (h.type == NATIVE_POINTS && native_decode_points(payload, h.length, &u.points) == 0)
            planar_scan_take_points(s, &h, payload, &u.points, &news);
        if (h.type == NATIVE_ATTRIBUTES && native_decode_attributes(payload, h.length, &u.attributes) == 0)
            take_attributes(s, payload, &u.attributes, &news);
        if (h.type == NATIVE_LINE_END && native_decode_line_end(payload, h.length, &u.end) == 0)
            take_line_end(s, &h, &u.end, &news);
    }
    return news;
}
