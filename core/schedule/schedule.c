/* SPDX-License-Identifier: MIT */
#include "core/schedule/schedule_inside.h"

#include <string.h>

static const uint64_t FINE_DEN = 1ull << 40;

/* Returns how many lines the pan needs for span_fine (2^-24 micro-degrees), at least one. The sweep of the first
 * line has passed by r0/den already. */
static uint64_t lines_for_span(const struct schedule_segment *seg, int64_t span_fine)
{
    const struct schedule_spec *spec = &seg->spec;
    if (spec->pan_udeg_s <= 0 || span_fine <= 0) return 1;
    u128 lines = (u128)(uint64_t)span_fine * (uint64_t)spec->lines_uhz;
    u128 unit = ((u128)(uint64_t)spec->pan_udeg_s * 1000000) << 24;
    /* Whole lines are taken out first, so that the rest times den stays within 128 bits. */
    return (uint64_t)(lines / unit) + ceil_div(lines % unit * seg->den + seg->r0 * unit, unit * seg->den);
}

static int pan_is_still(const struct schedule_spec *spec)
{
    return spec->emitter != NULL || spec->pan_udeg_s <= 0 || spec->pan_stop_udeg <= spec->pan_start_udeg;
}

/* Sets num/den, lines a tick. */
static void set_rates(struct schedule_segment *seg, const struct schedule_spec *spec)
{
    const int table = spec->emitter != NULL && spec->emitter->kind == EMITTER_BEAMS;
    seg->tick_num = table ? spec->emitter->tick_num : NS_TIMES_UHZ;
    seg->tick_den = table ? spec->emitter->tick_den : (uint64_t)spec->prr_uhz;
    u128 num = (u128)(uint64_t)spec->lines_uhz * seg->tick_num, den = (u128)seg->tick_den * NS_TIMES_UHZ;
    u128 g = gcd(num, den);
    seg->num = (uint64_t)(num / g);
    seg->den = (uint64_t)(den / g);
    /* A change keeps the phase to 1/den of a line, and den may be small here. */
    for (; table && seg->den < FINE_DEN; seg->den *= 2)
        seg->num *= 2;
    seg->ns_quot = (int64_t)(seg->tick_num / seg->tick_den);
    seg->ns_rem = seg->tick_num % seg->tick_den;
}

/* Where the window crosses azimuth 0, a ring begins with the window's first step. */
static void set_sector(struct schedule_segment *seg, const struct schedule_spec *spec)
{
    const uint64_t n = spec->emitter->steps, turn = (uint64_t)TURN_UDEG;
    const uint64_t start = (uint64_t)spec->line_start_udeg, stop = (uint64_t)spec->line_stop_udeg + 1;
    const uint64_t first = ceil_div((u128)(start > 0 ? start - 1 : 0) * n, turn),
                   last = (uint64_t)((u128)stop * n / turn);
    const uint64_t ahead = first < n ? n - first : 0; /* before azimuth 0 */
    seg->r_first = first;
    seg->r_last = last < n ? last : n - 1;
    if (spec->line_start_udeg <= spec->line_stop_udeg) return;
    seg->front_step = (uint32_t)ahead;
    seg->r_first = 0;
    seg->r_last = ahead + last < n ? ahead + last : n - 1;
}

/* Steps of a planar head or a sphere need not lie at whole micro-degrees. A step within a micro-degree of a limit
 * counts as inside. */
static void set_window(struct schedule_segment *seg, const struct schedule_spec *spec)
{
    const struct emitter *e = spec->emitter;
    uint64_t sweep = (uint64_t)spec->sweep_udeg;
    int64_t start = spec->line_start_udeg - spec->fov_min_udeg, stop = spec->line_stop_udeg - spec->fov_min_udeg;
    seg->front_step = e != NULL ? e->front_step : 0;
    if (e != NULL && e->kind == EMITTER_SPHERE) {
        set_sector(seg, spec);
        return;
    }
    if (e != NULL && e->kind == EMITTER_PLANAR) {
        start = start > 0 ? start - 1 : 0;
        stop++;
    }
    seg->r_first = ceil_div((u128)(uint64_t)start * seg->den, sweep);
    seg->r_last = (uint64_t)((u128)(uint64_t)stop * seg->den / sweep);
    if (e == NULL || e->kind != EMITTER_PLANAR) return;
    if (seg->r_first < e->first_step) seg->r_first = e->first_step;
    if (seg->r_last > e->last_step) seg->r_last = e->last_step;
}

static void set_spec(struct schedule_segment *seg, const struct schedule_spec *spec)
{
    seg->spec = *spec;
    if (pan_is_still(spec)) seg->spec.pan_udeg_s = 0;
    set_rates(seg, spec);
    set_window(seg, spec);
    seg->frame_lines = lines_for_span(seg, (spec->pan_stop_udeg - spec->pan_start_udeg) * (1 << 24));
    if (kind_of(seg) == EMITTER_SPHERE) seg->frame_lines = spec->emitter->rings;
}

/* A scan of more pulses than 64 bits can count has no end. */
static void set_end(struct schedule_segment *seg)
{
    if (seg->spec.frames == 0) {
        seg->end_pulse = UINT64_MAX;
        return;
    }
    uint64_t frames = seg->spec.frames > seg->frame0 ? seg->spec.frames : (uint64_t)seg->frame0 + 1;
    u128 line = seg->frame0_end + (u128)(frames - seg->frame0 - 1) * seg->frame_lines;
    u128 ticks = line > UINT64_MAX ? line : seg->k0 + (line - seg->line0) * seg->den / seg->num;
    seg->end_pulse = ticks < UINT64_MAX ? line_first_pulse(seg, (uint64_t)line) : UINT64_MAX;
}

void schedule_start(struct schedule_segment *seg, const struct schedule_spec *spec)
{
    memset(seg, 0, sizeof *seg);
    set_spec(seg, spec);
    seg->pan0_fine = spec->pan_start_udeg * (1 << 24);
    seg->frame0_end = seg->frame_lines;
    set_end(seg);
}

void schedule_change(struct schedule_segment *seg, const struct schedule_segment *before,
                     const struct schedule_spec *spec, uint64_t k)
{
    uint64_t first_line, n = schedule_line_of(before, k);
    uint32_t frame = frame_of_line(before, n, &first_line);
    struct schedule_line was;
    schedule_get_line(before, n, &was);
    u128 r = place_in_sweep(before, k, n);

    struct schedule_segment next;
    memset(&next, 0, sizeof next);
    set_spec(&next, spec);
    next.k0 = k;
    next.t0_ns = schedule_time_ns(before, k);
    /* The rest of a nanosecond is carried to the new rate, cut to a multiple of 1 / tick_den. The cuts do not
     * accumulate. */
    u128 rest = (before->t0_acc + (u128)firing_ticks(before, k) * before->ns_rem) % before->tick_den;
    next.t0_acc = (uint64_t)(rest * next.tick_den / before->tick_den);
    next.line0 = n;
    next.r0 = (uint64_t)(r * next.den / before->den);
    next.frame0 = frame;
    next.pan0_fine = pan_fine(before, k, first_line);
    next.frame0_end = n + lines_for_span(&next, spec->pan_stop_udeg * (1 << 24) - next.pan0_fine);
    if (kind_of(&next) == EMITTER_SPHERE) next.frame0_end = n - n % next.frame_lines + next.frame_lines;
    next.line0_begin = was.begin;
    next.line0_begin_ns = was.begin_ns;
    uint64_t cast_end = k < was.cast_end ? k : was.cast_end;
    next.line0_cast = was.cast_before + (cast_end > was.cast0 ? cast_end - was.cast0 : 0);
    set_end(&next);
    *seg = next;
}

void schedule_sequence_ns(const struct schedule_segment *seg, uint64_t *num, uint64_t *den)
{
    const uint64_t ticks = kind_of(seg) == EMITTER_BEAMS ? seg->spec.emitter->sequence_ticks : 1;
    const uint64_t common = (uint64_t)gcd(seg->tick_num, seg->tick_den);
    *num = ticks * (seg->tick_num / common);
    *den = seg->tick_den / common;
}

int64_t schedule_time_ns(const struct schedule_segment *seg, uint64_t k)
{
    uint64_t ticks = firing_ticks(seg, k);
    uint64_t part = (uint64_t)((seg->t0_acc + (u128)ticks * seg->ns_rem) / seg->tick_den);
    return seg->t0_ns + (int64_t)(ticks * (uint64_t)seg->ns_quot + part);
}

uint64_t schedule_pulse_at(const struct schedule_segment *seg, int64_t t_ns)
{
    if (t_ns <= seg->t0_ns) return seg->k0;
    /* floor(i*num/den) >= x  <=>  i >= x*den/num, x whole */
    u128 since = (u128)(uint64_t)(t_ns - seg->t0_ns) * seg->tick_den;
    return firing_after(seg, ceil_div(since - seg->t0_acc, seg->tick_num));
}

uint64_t schedule_line_of(const struct schedule_segment *seg, uint64_t k)
{
    return seg->line0 + (uint64_t)(((u128)seg->r0 + (u128)firing_ticks(seg, k) * seg->num) / seg->den);
}

/* All steps of a ring at a pole look along one line. */
static int is_pole(const struct schedule_segment *seg, uint64_t n)
{
    const struct emitter *e = seg->spec.emitter;
    return kind_of(seg) == EMITTER_SPHERE && emitter_ring_is_pole(e, n % e->rings);
}

void schedule_get_line(const struct schedule_segment *seg, uint64_t n, struct schedule_line *line)
{
    line->line = n;
    line->pulse0 = line_first_pulse(seg, n);
    uint64_t end = line_first_pulse(seg, n + 1);
    line->pulse_end = end < seg->end_pulse ? end : seg->end_pulse;
    uint64_t r = line->r_first_pulse = place_in_sweep(seg, line->pulse0, n);
    uint64_t skip = r >= seg->r_first ? 0 : ceil_div(seg->r_first - r, seg->num);
    uint64_t upto = r > seg->r_last ? 0 : (seg->r_last - r) / seg->num + 1;
    uint64_t tick0 = firing_ticks(seg, line->pulse0);
    line->cast0 = firing_after(seg, tick0 + skip);
    line->cast_end = firing_after(seg, tick0 + upto);
    if (is_pole(seg, n) && line->cast_end > line->cast0) line->cast_end = line->cast0 + (r <= seg->r_first);
    if (line->cast_end > line->pulse_end) line->cast_end = line->pulse_end;
    if (line->cast0 > line->cast_end) line->cast0 = line->cast_end;
    int at_start = n <= seg->line0;
    line->begin = at_start ? seg->line0_begin : line->pulse0;
    line->begin_ns = at_start ? seg->line0_begin_ns : schedule_time_ns(seg, line->pulse0);
    line->cast_before = at_start ? seg->line0_cast : 0;
    uint64_t first_line, first_next;
    line->frame = frame_of_line(seg, n, &first_line);
    line->last_of_frame = frame_of_line(seg, n + 1, &first_next) != line->frame;
}

uint64_t schedule_cut(const struct schedule_segment *seg, uint64_t k)
{
    if (k <= seg->k0) return seg->k0;
    uint64_t first = line_first_pulse(seg, schedule_line_of(seg, k));
    return k - (k - first) % SCHEDULE_PACKET;
}
