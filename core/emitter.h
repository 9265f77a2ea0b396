/* SPDX-License-Identifier: MIT */
/* Emitters: how the pulses of a head are arranged, as data. In: figures of a head profile. Out: tables that
 * the schedule (schedule.h) reads, constant from then on.
 *
 * Angles are those of a line head: elevation (mirror) and azimuth (pan, clockwise from y seen from above);
 * direction = (sin pan cos mirror, cos pan cos mirror, sin mirror).
 *
 *   kind        a line is                        a pan sweep is        pulses
 *   line        a sweep of the mirror            a sweep of the pan    at an even rate
 *   planar      a turn, from step 0 on           a line                `steps` a turn, those of first..last cast
 *   beams       a turn, from azimuth 0 on        a line                a firing sequence of up to 128 beams, over
 *                                                                      and over, while the azimuth turns
 *   sphere      a ring: one elevation            all rings, -90 up     `steps` a ring; at the poles, -90 and 90 deg,
 *                                                to 90 deg, or some    only one is cast
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

/* A beam fires offset_ns after the sequence's first beam. The beam's azimuth counts from that of the turning head at
 * that time. */
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
    uint32_t first_step, last_step, front_step; /* planar: the first and the last cast; the one that looks along y */
    int turn;                                   /* +1: clockwise seen from above; -1: the other way */
    /* sphere: `rings` of elevations -90 + 180 (first_ring + i) / gaps deg; gaps 0: one, at circle_udeg */
    uint32_t rings, first_ring, gaps;
    int64_t circle_udeg;
    int64_t asked_udeg; /* sphere: the step that was asked for */
    /* beams */
    uint32_t n_beams;
    uint64_t tick_num, tick_den; /* of a tick, nanoseconds */
    uint64_t sequence_ticks;
    struct emitter_beam beam[EMITTER_MAX_BEAMS];
    struct emitter_firing firing[EMITTER_MAX_BEAMS];
    /* directions: [steps], which stay the owner's; row i fires at tick i */
    const struct emitter_firing *direction;
};

/* Makes a planar head of checked figures: first <= last < steps, front < steps. */
void emitter_set_planar(struct emitter *emitter, uint32_t steps, uint32_t first, uint32_t last, uint32_t front,
                        int turn);
/* Makes a head of beams with a firing sequence of sequence_ps picoseconds. SH_EINPUT says what does not fit: no
 * beam, more than EMITTER_MAX_BEAMS, offsets that don't rise from 0, a sequence that ends before its last firing. */
int emitter_set_beams(struct emitter *emitter, const struct emitter_beam *beam, uint32_t n, uint64_t sequence_ps,
                      int turn, struct sh_err *err);
/* Makes a sphere with steps and rings nearest to step_udeg (0.01 to 90 deg). A turn has 360 / step steps, and from
 * pole to pole there are 180 / step gaps between rings, both rounded to whole numbers. */
void emitter_set_sphere(struct emitter *emitter, int64_t step_udeg);
/* Returns the steps of a ring with that step. */
static inline uint32_t emitter_sphere_steps(int64_t step_udeg)
{
    return (uint32_t)((360000000 + step_udeg / 2) / step_udeg);
}
/* Whether a sphere's step divides a turn and half a turn, so that nothing was rounded. */
int emitter_sphere_is_exact(const struct emitter *emitter);
/* Limits a sphere to the rings from start to stop, elevations of -90 to 90 deg, start <= stop. A ring within
 * a micro-degree of a limit counts as inside. Where both limits are the same, the sphere is a circle: one ring, at
 * exactly that elevation. SH_EINPUT: no ring lies there; the text names the nearest ones. */
int emitter_set_rings(struct emitter *emitter, int64_t start_udeg, int64_t stop_udeg, struct sh_err *err);
/* Returns the elevation of ring i (0 .. rings - 1) of a sphere, in turns. */
double emitter_ring_turn(const struct emitter *emitter, uint64_t ring);
/* Whether all steps of that ring look along one line. */
int emitter_ring_is_pole(const struct emitter *emitter, uint64_t ring);
/* Makes a head with a list of directions, which stays the owner's. */
void emitter_set_directions(struct emitter *emitter, const struct emitter_firing *direction, uint32_t n);

/* Reads such a list, a row each: "x y z" in the head's frame (of any length), or "azimuth elevation" in degrees, all
 * rows alike. The rest of a line after a # is left out. *direction: [*n], the caller's to free. SH_EINPUT names file
 * and line. */
int emitter_read_directions(const char *path, struct emitter_firing **direction, uint32_t *n, struct sh_err *err);
/* Writes a text such as "planar, steps 0..1080 of 1440 a turn, ..."; for a line head it is empty. */
void emitter_describe(const struct emitter *emitter, char *buf, size_t len);

/* Returns the pulses of a line where that is fixed, so that the pulse rate is that many times the line rate; else 0. */
static inline uint32_t emitter_line_pulses(const struct emitter *emitter)
{
    return emitter->steps;
}
/* Returns the pulse rate of a head of beams in micro-hertz, rounded. */
int64_t emitter_rate_uhz(const struct emitter *emitter);
/* Returns the highest line rate of a head of beams in micro-hertz, rounded down: at it a turn has one sequence. */
int64_t emitter_most_lines_uhz(const struct emitter *emitter);
/* Returns the line angle of a planar head's step, rounded. The angle counts from the front, along the steps. */
int64_t emitter_step_udeg(const struct emitter *emitter, int64_t step);

#endif
