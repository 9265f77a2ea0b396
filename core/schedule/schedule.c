#include "core/schedule.h"

#include <string.h>

__extension__ typedef unsigned __int128 u128;

static const int64_t TURN_UDEG = 360000000;
static const uint64_t NS_TIMES_UHZ = 1000000000000000; /* ns per second x micro-hertz per hertz */

static uint64_t gcd_u64(uint64_t a, uint64_t b)
{
    while (b != 0) {
        uint64_t r = a % b;
        a = b;
        b = r;
    }
    return a;
}

static uint64_t ceil_div(u128 a, u128 b)
{
    return (uint64_t)((a + b - 1) / b);
}

/* Lines that the pan needs for span_fine (2^-24 micro-degrees), the first of them from r0/den on; at least
 * one. */
static uint64_t lines_for_span(const struct schedule_segment *seg, int64_t span_fine)
{
    const struct schedule_spec *spec = &seg->spec;
    if (spec->pan_udeg_s <= 0 || span_fine <= 0) return 1;
    u128 lines = (u128)(uint64_t)span_fine * (uint64_t)spec->lines_uhz;
    u128 unit = ((u128)(uint64_t)spec->pan_udeg_s * 1000000) << 24;
    /* Whole lines apart, so that the rest times den stays within 128 bits. */
    return (uint64_t)(lines / unit) + ceil_div(lines % unit * seg->den + seg->r0 * unit, unit * seg->den);
}

static int pan_is_still(const struct schedule_spec *spec)
{
    return spec->pan_udeg_s <= 0 || spec->pan_stop_udeg <= spec->pan_start_udeg;
}

static void set_rates(struct schedule_segment *seg, const struct schedule_spec *spec)
{
    seg->spec = *spec;
    if (pan_is_still(spec)) seg->spec.pan_udeg_s = 0;
    uint64_t prr = (uint64_t)spec->prr_uhz, lines = (uint64_t)spec->lines_uhz;
    uint64_t g = gcd_u64(lines, prr);
    seg->num = lines / g;
    seg->den = prr / g;
    seg->ns_quot = (int64_t)(NS_TIMES_UHZ / prr);
    seg->ns_rem = NS_TIMES_UHZ % prr;
    uint64_t sweep = (uint64_t)spec->sweep_udeg;
    seg->r_first = ceil_div((u128)(uint64_t)(spec->line_start_udeg - spec->fov_min_udeg) * seg->den, sweep);
    seg->r_last = (uint64_t)((u128)(uint64_t)(spec->line_stop_udeg - spec->fov_min_udeg) * seg->den / sweep);
    seg->frame_lines = lines_for_span(seg, (spec->pan_stop_udeg - spec->pan_start_udeg) * (1 << 24));
}

/* First pulse of line n in the scan: the smallest i with r0 + i*num >= (n - line0)*den. */
static uint64_t line_first_pulse(const struct schedule_segment *seg, uint64_t n)
{
    if (n <= seg->line0) return seg->k0;
    u128 need = (u128)(n - seg->line0) * seg->den - seg->r0;
    return seg->k0 + ceil_div(need, seg->num);
}

/* More pulses than 64 bits can count are without end. */
static void set_end(struct schedule_segment *seg)
{
    if (seg->spec.frames == 0) {
        seg->end_pulse = UINT64_MAX;
        return;
    }
    uint64_t frames = seg->spec.frames > seg->frame0 ? seg->spec.frames : (uint64_t)seg->frame0 + 1;
    u128 line = seg->frame0_end + (u128)(frames - seg->frame0 - 1) * seg->frame_lines;
    u128 pulses = line > UINT64_MAX ? line : seg->k0 + (line - seg->line0) * seg->den / seg->num;
    seg->end_pulse = pulses < UINT64_MAX ? line_first_pulse(seg, (uint64_t)line) : UINT64_MAX;
}

void schedule_start(struct schedule_segment *seg, const struct schedule_spec *spec)
{
    memset(seg, 0, sizeof *seg);
    set_rates(seg, spec);
    seg->pan0_fine = spec->pan_start_udeg * (1 << 24);
    seg->frame0_end = seg->frame_lines;
    set_end(seg);
}

static uint32_t frame_of_line(const struct schedule_segment *seg, uint64_t n, uint64_t *first_line)
{
    if (n < seg->frame0_end) {
        *first_line = seg->line0;
        return seg->frame0;
    }
    uint64_t f = (n - seg->frame0_end) / seg->frame_lines;
    *first_line = seg->frame0_end + f * seg->frame_lines;
    return seg->frame0 + 1 + (uint32_t)f;
}

/* Pan at pulse k, which belongs to the frame that begins with first_line: whole micro-degrees and 2^-24
 * parts, rounded up, so that a frame that a change cuts in two never needs a line more for what was rounded
 * off. */
static int64_t pan_fine(const struct schedule_segment *seg, uint64_t k, uint64_t first_line)
{
    int64_t base = first_line == seg->line0 ? seg->pan0_fine : seg->spec.pan_start_udeg * (1 << 24);
    uint64_t i = k - line_first_pulse(seg, first_line);
    u128 turned = (u128)i * (uint64_t)seg->spec.pan_udeg_s * 1000000;
    uint64_t prr = (uint64_t)seg->spec.prr_uhz;
    uint64_t whole = (uint64_t)(turned / prr), rest = (uint64_t)(turned % prr);
    uint64_t fine = ceil_div((u128)rest << 24, prr);
    return base + (int64_t)((whole << 24) + fine);
}

/* Place of pulse k in the sweep of its line n, in 1/den of a line. */
static uint64_t place_in_sweep(const struct schedule_segment *seg, uint64_t k, uint64_t n)
{
    return (uint64_t)((u128)seg->r0 + (u128)(k - seg->k0) * seg->num - (u128)(n - seg->line0) * seg->den);
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
    set_rates(&next, spec);
    next.k0 = k;
    next.t0_ns = schedule_time_ns(before, k);
    /* The rest of a nanosecond goes over to the new rate, cut to a part of 1 / prr_uhz: it does not add
     * up. */
    u128 rest = (before->t0_acc + (u128)(k - before->k0) * before->ns_rem) % (uint64_t)before->spec.prr_uhz;
    next.t0_acc = (uint64_t)(rest * (uint64_t)spec->prr_uhz / (uint64_t)before->spec.prr_uhz);
    next.line0 = n;
    next.r0 = (uint64_t)(r * next.den / before->den);
    next.frame0 = frame;
    next.pan0_fine = pan_fine(before, k, first_line);
    next.frame0_end = n + lines_for_span(&next, spec->pan_stop_udeg * (1 << 24) - next.pan0_fine);
    next.line0_begin = was.begin;
    next.line0_begin_ns = was.begin_ns;
    uint64_t cast_end = k < was.cast_end ? k : was.cast_end;
    next.line0_cast = was.cast_before + (cast_end > was.cast0 ? cast_end - was.cast0 : 0);
    set_end(&next);
    *seg = next;
}

int64_t schedule_time_ns(const struct schedule_segment *seg, uint64_t k)
{
    uint64_t i = k - seg->k0;
    uint64_t part = (uint64_t)((seg->t0_acc + (u128)i * seg->ns_rem) / (uint64_t)seg->spec.prr_uhz);
    return seg->t0_ns + (int64_t)(i * (uint64_t)seg->ns_quot + part);
}

uint64_t schedule_pulse_at(const struct schedule_segment *seg, int64_t t_ns)
{
    if (t_ns <= seg->t0_ns) return seg->k0;
    /* floor(i*1e15/prr) >= x  <=>  i >= x*prr/1e15, x whole */
    u128 since = (u128)(uint64_t)(t_ns - seg->t0_ns) * (uint64_t)seg->spec.prr_uhz;
    return seg->k0 + ceil_div(since - seg->t0_acc, NS_TIMES_UHZ);
}

uint64_t schedule_line_of(const struct schedule_segment *seg, uint64_t k)
{
    return seg->line0 + (uint64_t)(((u128)seg->r0 + (u128)(k - seg->k0) * seg->num) / seg->den);
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
    line->cast0 = line->pulse0 + skip;
    line->cast_end = line->pulse0 + upto;
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

void schedule_get_run(const struct schedule_segment *seg, const struct schedule_line *line, uint64_t k, uint32_t n,
                      struct schedule_run *run)
{
    uint64_t prr = (uint64_t)seg->spec.prr_uhz;
    uint64_t first_line, in_line = k - line->pulse0;
    frame_of_line(seg, line->line, &first_line);
    memset(run, 0, sizeof *run);
    run->pulse0 = k;
    run->n = n;
    run->in_line = (uint32_t)in_line;
    run->frame = line->frame;
    run->line = (uint32_t)line->line;
    run->t0_ns = schedule_time_ns(seg, k);
    run->line_t0_ns = line->begin_ns;
    run->mirror0_turn = (double)seg->spec.fov_min_udeg / (double)TURN_UDEG;
    run->mirror_turn_per_r = (double)seg->spec.sweep_udeg / (double)TURN_UDEG / (double)seg->den;
    run->r = line->r_first_pulse + in_line * seg->num;
    run->num = seg->num;
    double fine_per_turn = (double)TURN_UDEG * (double)(1 << 24);
    run->pan0_turn = (double)pan_fine(seg, line->pulse0, first_line) / fine_per_turn;
    run->pan_step_turn = (double)seg->spec.pan_udeg_s * 1e6 / (double)prr / (double)TURN_UDEG;
    run->ns_quot = seg->ns_quot;
    run->ns_rem = seg->ns_rem;
    run->ns_den = prr;
    run->ns_acc = (uint64_t)((seg->t0_acc + (u128)(k - seg->k0) * seg->ns_rem) % prr);
}

double schedule_pan_turn(const struct schedule_segment *seg, uint64_t k)
{
    uint64_t first_line;
    frame_of_line(seg, schedule_line_of(seg, k), &first_line);
    return (double)pan_fine(seg, k, first_line) / ((double)TURN_UDEG * (double)(1 << 24));
}

double schedule_mirror_turn(const struct schedule_segment *seg, uint64_t k)
{
    uint64_t r = place_in_sweep(seg, k, schedule_line_of(seg, k));
    return (double)seg->spec.fov_min_udeg / (double)TURN_UDEG +
           (double)r * ((double)seg->spec.sweep_udeg / (double)TURN_UDEG / (double)seg->den);
}
