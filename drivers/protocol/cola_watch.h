/* SPDX-License-Identifier: MIT */
/* Watches fields: whole turns of a planar head go in, results of fields and states of outputs come out.
 *
 * An object is an echo that lies in a field's shape (cola_shape.h). A shot without echo is none, and neither is an echo
 * nearer than the head's least range or farther than COLA_SHAPE_REACH_UM. The echo filter chooses which echoes of a
 * beam count: the first, the last, or each of them.
 *
 * Response time: it is rounded to a whole number of scans, at least one. A beam counts once it has seen an object in so
 * many scans in a row. It no longer counts with the first scan in which it sees none.
 *
 * Blanking: neighbouring beams that count are one object, as wide as their number times the step times the least of
 * their ranges. The field is infringed where an object is at least as wide as its blanking size.
 *
 * A result is invalid where a field has no shape, and before the first scan. Pure; real-time safe. */
#ifndef DRIVERS_PROTOCOL_COLA_WATCH_H
#define DRIVERS_PROTOCOL_COLA_WATCH_H

#include "drivers/protocol/cola_field.h"

enum { COLA_WATCH_SLOTS = 10, COLA_WATCH_OUTPUTS = 4 };
enum cola_result { COLA_RESULT_INVALID, COLA_RESULT_FREE, COLA_RESULT_INFRINGED };
enum cola_echoes { COLA_ECHOES_FIRST, COLA_ECHOES_ALL, COLA_ECHOES_LAST }; /* as FREchoFilter numbers them */
/* Bits of news. */
enum { COLA_NEW_RESULT = 1, COLA_NEW_OUTPUT = 2 };

/* All 0: nothing is watched. */
struct cola_watch {
    uint32_t n;              /* slots */
    int on;                  /* a slot's field has a shape, or `other` */
    int other;               /* other fields were chosen while results or outputs were there: the next scan is news */
    uint32_t steps, n_beams; /* of the turns so far */
    struct cola_slot {
        uint32_t field;
        uint8_t result, output;
        int64_t changed_ns;                /* device time of the scan in which the result changed */
        uint32_t need;                     /* scans in a row */
        uint32_t run;                      /* neighbouring beams that count, up to the beam at hand */
        int32_t run_um;                    /* the least of their ranges */
        int is_hit;                        /* an object is wide enough */
        uint16_t in_row[PLANAR_MAX_STEPS]; /* scans in a row in which the beam saw an object */
    } slot[COLA_WATCH_SLOTS];
    struct cola_output {
        uint8_t active;
        uint32_t count; /* how often it became active */
    } output[COLA_WATCH_OUTPUTS];
};

/* Forgets what was seen, and watches these fields; n at most COLA_WATCH_SLOTS. outputs: that of each field, from 1; 0:
 * none. Outputs keep their state until the next scan. Where there were valid results or active outputs before, that
 * scan reports COLA_NEW_RESULT in any case. */
void cola_watch_select(struct cola_watch *watch, const struct cola_fields *fields, const uint32_t *numbers,
                       const uint8_t *outputs, uint32_t n);
/* One scan. Returns the news. */
unsigned cola_watch_scan(struct cola_watch *watch, const struct cola_fields *fields, const struct planar_head *head,
                         const struct planar_turn *turn, enum cola_echoes echoes);

#endif
