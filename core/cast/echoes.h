/* SPDX-License-Identifier: MIT */
/* Private to core/cast: this stage turns hits into a list of the echoes that the head reports. */
#ifndef CORE_CAST_ECHOES_H
#define CORE_CAST_ECHOES_H

#include "core/cast/chunk_arrays.h"

/* Echoes of a pulse after its first one: entries at .. at + n of the list. */
struct secondary {
    uint32_t pulse, at, n;
};

/* The echoes of a chunk. Entry i is the first echo of pulse i, or has range NaN where the pulse has none: so hits of
 * single rays need not be moved. After the pulses' entries come secondary echoes, each pulse's together, by range. */
struct echo_list {
    uint32_t n;
    uint32_t n_secondary; /* pulses with secondary echoes, in order */
    struct secondary secondary[CHUNK];
    double range_m[CAST_LIST]; /* NaN: no echo */
    uint32_t label[CAST_LIST];
    double mirror_turn[CAST_LIST], pan_turn[CAST_LIST]; /* as the encoders read them */
    struct list_vectors e; /* direction as the encoders read it, then the position; geo layout */
    struct list_vectors p; /* where the head is, prcs; touched only where it moves */
    /* touched only where something asks for it: */
    uint8_t number[CAST_LIST]; /* among the pulse's echoes, from 0, left-out ones included */
    uint64_t key[CAST_LIST];   /* for random numbers */
    double cosine[CAST_LIST];
    double energy[CAST_LIST]; /* share of the pulse's energy that glass and mirrors on the echo's way leave */
    double rho[CAST_LIST];    /* the part of that energy that comes back; all of it where surfaces are not modelled */
    uint8_t ghost[CAST_LIST];
    double amplitude[CAST_LIST];
    int16_t refl_cdb[CAST_LIST], amplitude_cdb[CAST_LIST];
    uint16_t deviation[CAST_LIST];
    float width_m[CAST_LIST];
    uint32_t colour[CAST_LIST]; /* packed */
};

struct caster;
struct chunk;

/* Makes room for n secondary echoes of a pulse at the end of the list. Returns the first. */
uint32_t echoes_secondary(struct echo_list *list, uint32_t pulse, uint32_t n);
/* Turns the hits in the list, which has a place for each pulse, into the echoes that are sent. */
void caster_echoes(struct caster *c, const struct chunk *k);
/* The second half of caster_echoes decides which returns are detected, their noise, and which are sent. It is called
 * by itself for a list without returns, since noise in waveforms may still make echoes. */
void caster_report(struct caster *c, const struct chunk *k);
/* Returns how many echoes a pulse may send. */
uint32_t caster_max_echoes(const struct cast_setup *s);

#endif
