/* SPDX-License-Identifier: MIT */
/* Angles of mirror and pan at a pulse: for runs that are cast, and for the encoders. */
#include <string.h>

#include "core/schedule/schedule_inside.h"

int64_t pan_fine(const struct schedule_segment *seg, uint64_t k, uint64_t first_line)
{
    int64_t base = first_line == seg->line0 ? seg->pan0_fine : seg->spec.pan_start_udeg * (1 << 24);
    uint64_t i = k - line_first_pulse(seg, first_line);
    u128 turned = (u128)i * (uint64_t)seg->spec.pan_udeg_s * 1000000;
    uint64_t prr = (uint64_t)seg->spec.prr_uhz;
    uint64_t whole = (uint64_t)(turned / prr), rest = (uint64_t)(turned % prr);
    uint64_t fine = ceil_div((u128)rest << 24, prr);
    return base + (int64_t)((whole << 24) + fine);
}

/* The mirror sweeps, the pan turns with time. */
static void set_sweep(const struct schedule_segment *seg, const struct schedule_line *line, struct schedule_run *run)
{
    const double fine_per_turn = (double)TURN_UDEG * (double)(1 << 24);
    uint64_t first_line;
    frame_of_line(seg, line->line, &first_line);
    run->mirror0_turn = (double)seg->spec.fov_min_udeg / (double)TURN_UDEG;
    run->mirror_turn_per_r = (double)seg->spec.sweep_udeg / (double)TURN_UDEG / (double)seg->den;
    run->pan0_turn = (double)pan_fine(seg, line->pulse0, first_line) / fine_per_turn;
    run->pan_step_turn = (double)seg->spec.pan_udeg_s * 1e6 / (double)(uint64_t)seg->spec.prr_uhz / (double)TURN_UDEG;
}

/* A ring has one elevation, and the pan goes step by step. */
static void set_ring(const struct schedule_segment *seg, const struct schedule_line *line, struct schedule_run *run)
{
    const struct emitter *e = seg->spec.emitter;
    const int64_t step = (int64_t)line->r_first_pulse - (int64_t)seg->front_step;
    if (e->kind == EMITTER_SPHERE) run->mirror0_turn = emitter_ring_turn(e, line->line % e->rings);
    run->pan0_turn = (double)(e->turn * step) / (double)e->steps;
    run->pan_step_turn = (double)e->turn / (double)e->steps;
}

/* The table has directions one by one, or beams on a pan that turns with the ticks. */
static void set_table(const struct schedule_segment *seg, struct schedule_run *run)
{
    const struct emitter *e = seg->spec.emitter;
    if (e->kind == EMITTER_DIRECTIONS) {
        run->firing = e->direction;
        run->n_firings = e->steps;
        run->firing_at = (uint32_t)run->r;
    } else {
        run->firing = e->firing;
        run->n_firings = e->n_beams;
        run->firing_at = (uint32_t)(run->pulse0 % e->n_beams);
        run->sequence_ticks = e->sequence_ticks;
        run->pan_turn_per_r = e->turn / (double)seg->den;
    }
}

static void set_angles(const struct schedule_segment *seg, const struct schedule_line *line, struct schedule_run *run)
{
    switch (kind_of(seg)) {
    case EMITTER_LINE:
        set_sweep(seg, line, run);
        break;
    case EMITTER_PLANAR:
    case EMITTER_SPHERE:
        set_ring(seg, line, run);
        break;
    case EMITTER_BEAMS:
    case EMITTER_DIRECTIONS:
        set_table(seg, run);
        break;
    }
}

void schedule_get_run(const struct schedule_segment *seg, const struct schedule_line *line, uint64_t k, uint32_t n,
                      struct schedule_run *run)
{
    memset(run, 0, sizeof *run);
    run->pulse0 = k;
    run->n = n;
    run->in_line = (uint32_t)(k - line->pulse0);
    run->frame = line->frame;
    run->line = (uint32_t)line->line;
    run->t0_ns = schedule_time_ns(seg, k);
    run->line_t0_ns = line->begin_ns;
    run->r = line->r_first_pulse + (firing_ticks(seg, k) - firing_ticks(seg, line->pulse0)) * seg->num;
    run->num = seg->num;
    run->ns_quot = seg->ns_quot;
    run->ns_rem = seg->ns_rem;
    run->ns_den = seg->tick_den;
    run->ns_acc = (uint64_t)((seg->t0_acc + (u128)firing_ticks(seg, k) * seg->ns_rem) % seg->tick_den);
    set_angles(seg, line, run);
}

uint64_t schedule_longest_run(const struct schedule_segment *seg, int64_t max_ns)
{
    uint64_t n = (uint64_t)(max_ns / (seg->ns_quot + 1));
    if (kind_of(seg) == EMITTER_BEAMS) n = n / seg->spec.emitter->sequence_ticks * seg->spec.emitter->n_beams;
    return n > 0 ? n : 1;
}

static void angles_of(const struct schedule_segment *seg, uint64_t k, double *mirror_turn, double *pan_turn)
{
    struct schedule_line line;
    struct schedule_run run;
    schedule_get_line(seg, schedule_line_of(seg, k), &line);
    schedule_get_run(seg, &line, k, 1, &run);
    *mirror_turn = run.mirror0_turn + (double)run.r * run.mirror_turn_per_r;
    *pan_turn = run.pan0_turn + (double)run.in_line * run.pan_step_turn;
    if (run.firing == NULL) return;
    *mirror_turn = run.firing[run.firing_at].mirror_turn;
    *pan_turn = (double)run.r * run.pan_turn_per_r + run.firing[run.firing_at].pan_turn;
}

double schedule_pan_turn(const struct schedule_segment *seg, uint64_t k)
{
    double mirror_turn, pan_turn;
    uint64_t first_line;
    if (kind_of(seg) != EMITTER_LINE) {
        angles_of(seg, k, &mirror_turn, &pan_turn);
        return pan_turn;
    }
    frame_of_line(seg, schedule_line_of(seg, k), &first_line);
    return (double)pan_fine(seg, k, first_line) / ((double)TURN_UDEG * (double)(1 << 24));
}

double schedule_mirror_turn(const struct schedule_segment *seg, uint64_t k)
{
    double mirror_turn, pan_turn;
    angles_of(seg, k, &mirror_turn, &pan_turn);
    return mirror_turn;
}

double schedule_sweep_turn(const struct schedule_segment *seg, uint64_t k)
{
    if (kind_of(seg) != EMITTER_BEAMS) return schedule_mirror_turn(seg, k);
    const uint64_t r = place_in_sweep(seg, k, schedule_line_of(seg, k));
    return (double)r * (seg->spec.emitter->turn / (double)seg->den);
}

void schedule_hold_run(const struct schedule_segment *seg, double sweep_turn, struct schedule_run *run)
{
    run->num = 0;
    if (kind_of(seg) == EMITTER_BEAMS) {
        run->r = 1;
        run->pan_turn_per_r = sweep_turn;
    } else {
        run->r = 0;
        run->mirror0_turn = sweep_turn;
    }
}
