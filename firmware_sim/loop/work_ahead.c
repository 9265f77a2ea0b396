/* SPDX-License-Identifier: MIT */
/* Lines ahead of the tick at hand: a caster that has claimed several ticks casts their lines together. */
#include <string.h>

#include "firmware_sim/loop/work_inside.h"

enum {
    LINES = 4,       /* Pulses of so many lines are cast together. More lines save little. */
    PULSES = 1 << 17 /* Hits of so many pulses are 2.6 MB, which is about a second-level cache. */
};

int worker_add_ahead(struct worker *worker, struct sh_err *err)
{
    return caster_add_ahead(worker->caster, PULSES, err);
}

/* Returns the pulses of a line, rounded down, but at least one. */
static uint64_t line_pulses(const struct schedule_segment *segment)
{
    const uint64_t n = segment->den / segment->num;
    return n > 1 ? n : 1;
}

uint64_t worker_end_ahead(struct worker *worker, const struct device_work *work)
{
    const struct schedule_segment *segment = &work->segment;
    if (!work->scanning || work->pulse_end == work->pulse0) return 0;
    worker_take_setup(worker, work);
    if (worker->site->moving) return 0; /* the setup gets its poses later */
    const uint64_t room = caster_room_ahead(worker->caster, &worker->setup, segment->spec.emitter),
                   fit = room / line_pulses(segment), lines = fit < LINES ? fit : LINES;
    return lines > 1 ? work->pulse0 + lines * line_pulses(segment) : 0;
}

/* Whether a tick goes on with the scan as it was. Padding may differ: then the lines are not cast together. */
static int goes_on(const struct device_work *work, const struct device_work *first, uint64_t pulse)
{
    return work->scanning && work->scan == first->scan && work->pulse0 == pulse && work->site == first->site &&
           work->version == first->version && work->prr_uhz == first->prr_uhz && !work->disturbance.on &&
           memcmp(&work->segment, &first->segment, sizeof work->segment) == 0;
}

/* Does nothing for less than two lines: their pulses have hardly any neighbours. */
void worker_look_ahead(struct worker *worker, const struct device_work *work, uint32_t n)
{
    struct schedule_run run[CAST_AHEAD_RUNS];
    struct worker_part part;
    uint32_t n_runs = 0;
    uint64_t end = work->pulse0;
    for (uint32_t i = 0; i < n && goes_on(&work[i], work, end); i++)
        end = work[i].pulse_end;
    if (end - work->pulse0 < 2 * line_pulses(&work->segment)) return;
    for (uint64_t k = work->pulse0; k < end && n_runs < CAST_AHEAD_RUNS; k = part.end) {
        worker_get_part(&work->segment, k, end, &part);
        if (part.cast0 >= part.cast_end) continue;
        schedule_get_run(&work->segment, &part.line, part.cast0, (uint32_t)(part.cast_end - part.cast0),
                         &run[n_runs++]);
    }
    caster_look_ahead(worker->caster, &worker->setup, run, n_runs);
}

void worker_forget(struct worker *worker)
{
    caster_forget(worker->caster);
}
