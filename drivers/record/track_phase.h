/* SPDX-License-Identifier: MIT */
/* The mirror's place in its sweep, for rows of a line in which settings changed. In: the rates of the descriptors, the
 * pulse at which each change took effect, and the first pulses of lines. Out: the row of a pulse, by the rates of now.
 *
 * A row stands for one angle in all lines of a grid. After a change the line goes on from the angle that it has reached
 * (core/schedule.h), so its next row is the one that has this angle at the new rates. Ratios of whole numbers, as in
 * the schedule; nothing accumulates. One thread per track. */
#ifndef DRIVERS_RECORD_TRACK_PHASE_H
#define DRIVERS_RECORD_TRACK_PHASE_H

#include <stdint.h>

/* At `pulse` the sweep of `line` has gone on by r / den of the whole, and num / den is added by each later pulse.
 * den 0: no descriptor has come. */
struct track_phase {
    uint64_t pulse, r, num, den;
    uint32_t line;
    int changed; /* the rates changed at `pulse` */
};

/* A scan begins with pulse 0 and these rates. Rates of 0 leave the phase unknown. */
void track_phase_start(struct track_phase *phase, uint64_t prr_uhz, uint64_t lines_uhz);
/* Another scan begins with the rates of before. */
void track_phase_restart(struct track_phase *phase);
/* From `pulse` on the head has these rates. */
void track_phase_change(struct track_phase *phase, uint64_t pulse, uint64_t prr_uhz, uint64_t lines_uhz);
/* The stream says which pulse is the first of a line. Where that disagrees, as after frames that were lost or with a
 * mirror that is slower than its setting, the phase follows the stream. */
void track_phase_line(struct track_phase *phase, uint32_t line, uint64_t pulse0);
/* Sets *row to that of a pulse of `line`, if rates changed within that line. Returns 1, or 0 if they did not: the first
 * pulse of such a line, or its time, is enough. */
int track_phase_row(const struct track_phase *phase, uint32_t line, uint64_t pulse, uint64_t *row);

#endif
