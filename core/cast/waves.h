/* SPDX-License-Identifier: MIT */
/* This stage samples the light that comes back of pulses (core/waveform.h). Where a head is set so, the stage finds the
 * echoes in these samples. Only chunks with waveforms have this stage. The header is private to core/cast. */
#ifndef CORE_CAST_WAVES_H
#define CORE_CAST_WAVES_H

#include "core/cast/echoes.h"
#include "core/waveform.h"

enum {
    WAVES_PARTS = 64, /* of a pulse: returns that are told apart */
    WAVES_ROOM = 4 * WAVEFORM_MAX_SAMPLES,
};

/* A return of a pulse before it is merged with others. */
struct wave_part {
    double range_m, back, extent_m; /* back: as in struct beam_return */
    uint32_t label, colour;
    enum waveform_spread spread;
};

/* Each thread has this working memory. */
struct wave_work {
    /* A pulse with own = 1 has n returns, from part[first] on. Any other pulse has one: its entry of the list. */
    struct {
        uint32_t first, n;
        int own;
    } of[CHUNK];
    struct wave_part part[CHUNK * WAVES_PARTS];
    uint32_t n_parts;
    uint8_t merged[CHUNK]; /* where echoes are found in samples: the number of echoes of a pulse's merged returns */
    /* of the pulse at hand: */
    struct waveform_return returns[WAVES_PARTS];
    struct waveform_record record;
    uint16_t sample[WAVES_ROOM];
};

struct caster;
struct chunk;

/* Begins a chunk, before its returns are taken. */
void waves_begin(struct caster *c, const struct chunk *k);
/* Takes the returns of a pulse with sub-rays, in any order. The function sorts and shortens the caller's array. */
void waves_take_returns(struct caster *c, const struct chunk *k, uint32_t pulse, struct beam_return *returns,
                        uint32_t n);
/* Takes the returns of single rays through glass and off mirrors, before the list merges them. */
void waves_take_paths(struct caster *c, const struct chunk *k);
/* Puts the samples into the block, if it has room for waveforms. Echoes that are found in them replace those of the
 * list. */
void caster_waves(struct caster *c, const struct chunk *k);

#endif
