/* SPDX-License-Identifier: MIT */
/* Injected faults that change what is measured: the pulses of a scan at which they strike, and their common
 * disturbance.
 *
 * A fault strikes at the pulses of a scan between from_pulse and until_pulse that fire at from_s or later, and before
 * until_s. These limits are exact, whatever the tick rate is: a tick ends where a fault begins or ends (claim_pulses),
 * and the rest of its pulses come with the next ones. So all pulses of a tick have the same faults. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "firmware_sim/config/profile.h"
#include "firmware_sim/device/beam_faults.h"
#include "firmware_sim/device/head_faults.h"

static const double TURN_DEG = 360.0;

static int is_of_beam(enum fault_kind kind)
{
    return (HEAD_FAULT(kind) & HEAD_FAULTS_BEAM) != 0;
}

static void note(const struct device_beam *beam, const struct device_beam_fault *f, uint64_t pulse, int64_t t_ns)
{
    const struct device_scan *scan = beam->scan;
    struct fault_note note = {.fault = f->entry.number,
                              .kind = f->entry.fault.kind,
                              .t_ns = (int64_t)scan->tick0 * beam->tick_ns + t_ns,
                              .has_pulse = 1,
                              .pulse = pulse,
                              .byte = -1,
                              .ended = !f->strikes};
    if (f->strikes && note.kind == FAULT_MIRROR_SLOW)
        snprintf(note.text, sizeof note.text, "scan %u, %.6f lines per second", scan->number,
                 1e-6 * (double)scan->segment.spec.lines_uhz);
    else if (f->strikes && note.kind == FAULT_MIRROR_STUCK)
        snprintf(note.text, sizeof note.text, "scan %u, at %.6f deg", scan->number, TURN_DEG * f->turn);
    else
        snprintf(note.text, sizeof note.text, "scan %u", scan->number);
    fault_board_note(beam->board, &note);
}

/* ---- when faults strike */

/* Finds the pulses at which the fault strikes: from *begin up to the one before *end, by the segment's times. Pulses
 * before the segment don't matter. */
static void find_window(const struct device_beam *beam, const struct fault_entry *entry, uint64_t *begin, uint64_t *end)
{
    const struct fault *f = &entry->fault;
    const struct schedule_segment *seg = &beam->scan->segment;
    const int64_t zero_ns = entry->since_ns - (int64_t)beam->scan->tick0 * beam->tick_ns;
    *begin = schedule_pulse_at(seg, zero_ns + llround(1e9 * f->from_s));
    if (*begin < f->from_pulse) *begin = f->from_pulse;
    *end = f->until_s > 0.0 ? schedule_pulse_at(seg, zero_ns + llround(1e9 * f->until_s)) : UINT64_MAX;
    if (f->until_pulse < *end) *end = f->until_pulse + 1;
}

/* Takes over the present list. A fault that was taken out while it struck ends at this pulse. */
static void renew(struct device_beam *beam, uint64_t pulse, int64_t t_ns)
{
    struct fault_entry entry[FAULT_MAX];
    struct device_beam_fault was[FAULT_MAX];
    const uint32_t n_was = beam->n;
    uint32_t n;
    memcpy(was, beam->fault, n_was * sizeof was[0]);
    beam->version = fault_board_copy(beam->board, entry, &n);
    beam->n = 0;
    for (uint32_t i = 0; i < n; i++) {
        if (!is_of_beam(entry[i].fault.kind)) continue;
        const struct device_beam_fault *old = fault_find(was, n_was, sizeof *was, entry[i].number);
        beam->fault[beam->n++] = old != NULL ? *old : (struct device_beam_fault){.entry = entry[i]};
    }
    for (uint32_t k = 0; k < n_was; k++) {
        if (!was[k].strikes || fault_find(beam->fault, beam->n, sizeof *was, was[k].entry.number) != NULL) continue;
        was[k].strikes = 0;
        note(beam, &was[k], pulse, t_ns);
    }
}

/* ---- what they do */

static double slowness(const struct device_beam *beam)
{
    double factor = 1.0;
    for (uint32_t i = 0; i < beam->n; i++)
        if (beam->fault[i].strikes && beam->fault[i].entry.fault.kind == FAULT_MIRROR_SLOW)
            factor *= beam->fault[i].entry.fault.factor;
    return factor;
}

/* A head whose lines have a fixed number of pulses fires at steps of its mirror, so its pulse rate falls, too. */
static void slow_down(const struct device_beam *beam, const struct site *site, struct schedule_spec *spec)
{
    const int64_t most = site_profile(site)->lines_max_uhz;
    const uint32_t steps = emitter_line_pulses(&site_profile(site)->emitter);
    const double factor = slowness(beam);
    if (factor == 1.0) return;
    spec->lines_uhz = llround((double)spec->lines_uhz * factor);
    if (spec->lines_uhz < 1) spec->lines_uhz = 1;
    if (spec->lines_uhz > most) spec->lines_uhz = most;
    if (steps != 0)
        spec->prr_uhz = spec->lines_uhz * steps;
    else if (spec->lines_uhz > spec->prr_uhz)
        spec->lines_uhz = spec->prr_uhz;
}

void device_fill_spec(struct device_beam *beam, const struct site *site, struct schedule_spec *spec)
{
    site_fill_spec(site, &beam->scan->settings, spec);
    beam->scan->prr_uhz = spec->prr_uhz;
    beam->scan->lines_uhz = spec->lines_uhz;
    spec->lines_uhz =
        beam->held_uhz != 0 ? beam->held_uhz : spec->lines_uhz + config_motor_uhz(beam->free_ppm, spec->lines_uhz);
    slow_down(beam, site, spec);
}

void device_set_rates(struct device_beam *beam, uint64_t pulse)
{
    struct schedule_segment *seg = &beam->scan->segment;
    struct schedule_spec spec;
    device_fill_spec(beam, beam->scan->site, &spec);
    if (spec.lines_uhz == seg->spec.lines_uhz && spec.prr_uhz == seg->spec.prr_uhz) return;
    schedule_change(seg, seg, &spec, pulse);
}

static void add_wobble(const struct device_beam *beam, const struct device_beam_fault *f, struct cast_disturbance *to)
{
    _Static_assert((int)FAULT_MAX <= (int)CAST_MAX_WOBBLES, "room for all");
    const double turn = f->entry.fault.deg / TURN_DEG;
    const int is_rotor = site_profile(beam->scan->site)->emitter.kind == EMITTER_BEAMS;
    to->wobble[to->n_wobbles++] = (struct cast_wobble){.mirror_turn = is_rotor ? 0.0 : turn,
                                                       .pan_turn = is_rotor ? turn : 0.0,
                                                       .hz = f->entry.fault.hz,
                                                       .begin_ns = f->begin_ns};
}

/* Adds up the faults that strike. A stuck mirror does not wobble. If several stuck faults strike, the first counts. */
static void add_up(struct device_beam *beam)
{
    struct device_disturbance *now = &beam->now;
    struct cast_disturbance *cast = &now->cast;
    *now = (struct device_disturbance){.cast.share = 1.0};
    for (uint32_t i = 0; i < beam->n; i++) {
        const struct device_beam_fault *f = &beam->fault[i];
        if (!f->strikes) continue;
        now->on = 1;
        if (f->entry.fault.kind == FAULT_LASER_OFF) cast->dark = 1;
        if (f->entry.fault.kind == FAULT_PAN_SLIP) cast->slip_turn += f->entry.fault.deg / TURN_DEG;
        if (f->entry.fault.kind == FAULT_WINDOW_SOILED) cast->share *= pow(10.0, -0.1 * f->entry.fault.loss_db);
        if (f->entry.fault.kind == FAULT_MIRROR_WOBBLE) add_wobble(beam, f, cast);
        if (f->entry.fault.kind != FAULT_MIRROR_STUCK || now->stuck) continue;
        now->stuck = 1;
        now->stuck_turn = f->turn;
    }
    if (now->stuck) cast->n_wobbles = 0;
}

/* Returns the angle of the mirror, or of the rotor, at a pulse, in turns. */
static double find_turn(const struct device_beam *beam, uint64_t pulse, int64_t t_ns)
{
    const struct device_disturbance *now = &beam->now;
    double mirror_turn = 0.0, pan_turn = 0.0;
    if (now->on && now->stuck) return now->stuck_turn;
    if (now->on) cast_wobble(&now->cast, t_ns, &mirror_turn, &pan_turn);
    return schedule_sweep_turn(&beam->scan->segment, pulse) + mirror_turn + pan_turn;
}

/* ---- a pulse */

static void begin_or_end(struct device_beam *beam, uint64_t pulse, int64_t t_ns)
{
    int turned[FAULT_MAX] = {0};
    for (uint32_t i = 0; i < beam->n; i++) {
        struct device_beam_fault *f = &beam->fault[i];
        uint64_t begin, end;
        find_window(beam, &f->entry, &begin, &end);
        turned[i] = (begin <= pulse && pulse < end) != f->strikes;
        if (!turned[i]) continue;
        f->strikes = !f->strikes;
        f->begin_ns = t_ns;
        if (f->strikes) f->turn = find_turn(beam, pulse, t_ns);
    }
    device_set_rates(beam, pulse);
    add_up(beam);
    for (uint32_t i = 0; i < beam->n; i++)
        if (turned[i]) note(beam, &beam->fault[i], pulse, t_ns);
}

static uint64_t find_edge(const struct device_beam *beam, uint64_t pulse)
{
    uint64_t edge = UINT64_MAX;
    for (uint32_t i = 0; i < beam->n; i++) {
        uint64_t begin, end;
        find_window(beam, &beam->fault[i].entry, &begin, &end);
        if (begin >= end) continue;
        if (begin > pulse && begin < edge) edge = begin;
        if (end > pulse && end < edge) edge = end;
    }
    return edge;
}

void device_turn_beam(struct device_beam *beam, int64_t until_ns)
{
    const uint32_t version = fault_board_version(beam->board);
    if (version == beam->version && beam->n == 0) return;
    const uint64_t pulse = beam->scan->pulse_next;
    const int64_t t_ns = schedule_time_ns(&beam->scan->segment, pulse);
    beam->edge = UINT64_MAX;
    if (pulse >= beam->scan->segment.end_pulse || t_ns >= until_ns) return;
    if (version != beam->version) renew(beam, pulse, t_ns);
    begin_or_end(beam, pulse, t_ns);
    beam->edge = find_edge(beam, pulse);
}

double device_beam_loss_db(const struct device_beam *beam)
{
    double loss_db = 0.0;
    for (uint32_t i = 0; i < beam->n; i++)
        if (beam->fault[i].strikes && beam->fault[i].entry.fault.kind == FAULT_WINDOW_SOILED)
            loss_db += beam->fault[i].entry.fault.loss_db;
    return loss_db;
}

void device_end_beam(struct device_beam *beam, int64_t t_ns)
{
    for (uint32_t i = 0; i < beam->n; i++) {
        if (!beam->fault[i].strikes) continue;
        beam->fault[i].strikes = 0;
        note(beam, &beam->fault[i], beam->scan->pulse_next, t_ns);
    }
    beam->now.on = 0;
    beam->edge = UINT64_MAX;
}
