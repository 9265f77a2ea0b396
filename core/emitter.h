/* Emitters: how the pulses of a head are arranged, as data. In: figures of a head profile. Out: tables that
 * the schedule (schedule.h) reads, constant from then on.
 *
 * Angles are those of a line head: elevation (mirror) and azimuth (pan, clockwise from y seen from above);
 * direction = (sin pan cos mirror, cos pan cos mirror, sin mirror).
 *
 *   kind        a line is                        a frame is            pulses
 *   line        a sweep of the mirror            a sweep of the pan    at an even rate
 *   planar      a turn, from step 0 on           a line                `steps` a turn, those of first..last cast
 *   beams       a turn, from azimuth 0 on        a line                a firing sequence of up to 128 beams, over
 *                                                                      and over, while the azimuth turns
 *   sphere      a ring: one elevation            all rings, -90 up     `steps` a ring; of the first and the last
 *                                                to 90 deg             ring, which are poles, only one is cast
 *   directions  the list once                    a line                one each
 *
 * Time is counted in ticks. A tick of a beams head is the largest time that all its firing times are multiples
 * of: an exact ratio of nanoseconds. For all others a tick is the pulse period. */
#ifndef CORE_EMITTER_H
#define CORE_EMITTER_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"

enum emitter_kind { EMITTER_LINE, EMITTER_PLANAR, EMITTER_BEAMS, EMITTER_SPHERE, EMITTER_DIRECTIONS };
extern const char *const emitter_names[]; /* by kind; NULL at the end */
enum { EMITTER_MAX_BEAMS = 128, EMITTER_MAX_STEPS = 1000000 };

/* Firing time after the sequence's first; azimuth against that of the turning head at its firing time. */
struct emitter_beam {
    int64_t elevation_udeg, azimuth_udeg;
    uint32_t offset_ns;
};

/* A row of a firing table. */
struct emitter_firing {
    uint64_t tick; /* after the table's begin */
    double mirror_turn, pan_turn;
};

struct emitter {
    enum emitter_kind kind;
    uint32_t steps;                             /* pulses of a line; line and beams: 0 */
    uint32_t first_step, last_step, front_step; /* planar: cast, both included; looks along y */
    int turn;                                   /* +1: clockwise seen from above; -1: the other way */
    uint32_t rings;                             /* sphere */
    int64_t asked_udeg;                         /* sphere: the step that was asked for */
    /* beams */
    uint32_t n_beams;
    uint64_t tick_num, tick_den; /* of a tick, nanoseconds */
    uint64_t sequence_ticks;
    struct emitter_beam beam[EMITTER_MAX_BEAMS];
    struct emitter_firing firing[EMITTER_MAX_BEAMS];
    /* directions: [steps], the owner's; a row each, tick i for row i */
    const struct emitter_firing *direction;
};

/* A planar head; figures must be checked: first <= last < steps, front < steps. */
void emitter_set_planar(struct emitter *emitter, uint32_t steps, uint32_t first, uint32_t last, uint32_t front,
                        int turn);
/* A firing sequence of sequence_ps picoseconds. SH_EINPUT says what does not fit: no beam, offsets that don't
 * rise from 0, a sequence that ends before its last firing. */
int emitter_set_beams(struct emitter *emitter, const struct emitter_beam *beam, uint32_t n, uint64_t sequence_ps,
                      int turn, struct sh_err *err);
/* Steps and rings nearest to step_udeg (0.01 to 90 deg). */
void emitter_set_sphere(struct emitter *emitter, int64_t step_udeg);
/* A list, which stays the owner's. */
void emitter_set_directions(struct emitter *emitter, const struct emitter_firing *direction, uint32_t n);

/* Reads such a list: a row each, "x y z" in the head's frame (of any length), or "azimuth elevation" in degrees,
 * all rows alike; what follows a # is left out. *direction: [*n], the caller's to free. SH_EINPUT names file and
 * line. */
int emitter_read_directions(const char *path, struct emitter_firing **direction, uint32_t *n, struct sh_err *err);
/* "planar, steps 0..1080 of 1440 a turn, ..."; empty for a line head. */
void emitter_describe(const struct emitter *emitter, char *buf, size_t len);

/* Pulses of a line where that is fixed, so that the pulse rate is that many times the line rate; else 0. */
static inline uint32_t emitter_line_pulses(const struct emitter *emitter)
{
    return emitter->steps;
}
/* Beams: pulses per second, in micro-hertz, rounded. */
int64_t emitter_rate_uhz(const struct emitter *emitter);
/* The line angle of a step of a planar head, rounded: from the front, in the direction of the steps. */
int64_t emitter_step_udeg(const struct emitter *emitter, int64_t step);

#endif
