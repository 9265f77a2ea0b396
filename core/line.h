/* SPDX-License-Identifier: MIT */
/* A block is the result of casting: a part of one scan line, as arrays. The points of a scan leave core in no other
 * form.
 *
 * A line is one mirror sweep. A line leaves in blocks, so that packets are not late where the mirror is slow;
 * each block is a run of consecutive cast pulses of one line, with one entry per echo, and one entry for a
 * shot without echo. Entries are in order of pulse, then of range. Times and pulse numbers count from the
 * scan's start.
 *
 * Ownership: line_block_alloc makes the arrays for `capacity` entries. Each other line_block_alloc_... adds some that
 * are optional. line_block_free releases them all. A block belongs to one thread. Nothing else allocates. */
#ifndef CORE_LINE_H
#define CORE_LINE_H

#include <stdint.h>

#include "core/err.h"

enum {
    LINE_REFL_NONE = INT16_MIN,      /* reflectance is not modelled, or there is no echo */
    LINE_XYZ_NONE = INT32_MIN,       /* coordinate of a shot without echo */
    LINE_LABEL_NONE = 0xffff,        /* label of a shot without echo */
    LINE_MAX_ECHOES = 15,            /* echo number and count are four bits each on the wire */
    LINE_AMPLITUDE_NONE = INT16_MIN, /* amplitude is not modelled, or there is no echo */
    LINE_WIDTH_NONE = 0,             /* width of a shot without echo */
    LINE_WIDTH_MOST = UINT16_MAX,    /* that much or more */
};

/* The meaning of a point's three numbers; chosen per stream. */
enum line_layout { LINE_POLAR, LINE_GEO };

/* A window of a pulse's waveform (waveform.h). */
struct line_wave {
    uint32_t pulse; /* after the block's pulse0 */
    uint32_t dt_ns; /* firing time after t0_ns */
    uint32_t first; /* number of its first sample on the pulse's grid */
    uint32_t n;     /* samples */
    uint32_t at;    /* of its first sample in line_waves.sample */
    /* The beam. polar: 0, mirror counts, pan counts; geo: the change of x, y, z along a metre of range, as bit patterns
     * of floats, in the CRS's units (not in scale_m). */
    uint32_t a, b, c;
};

/* The waveforms of a block's pulses, in order of pulse, then of range. */
struct line_waves {
    uint32_t n, capacity, n_samples, sample_capacity;
    struct line_wave *wave;
    uint16_t *sample;
    uint32_t n_left_out; /* samples that found no room */
    /* The digitiser: its figures are set when the block is made, and are the same for all blocks of a scan. */
    uint32_t sample_ps;   /* time between samples */
    uint16_t baseline_16; /* the count without light, in 1/16 counts */
    uint8_t bits;         /* of a sample */
    float count_signal;   /* signal of one count, in thresholds */
};

struct line_block {
    /* place in the scan */
    uint32_t frame;     /* number of the pan sweep, from 0 */
    uint32_t line;      /* line number in the scan, from 0 */
    uint64_t pulse0;    /* number of the block's first pulse in the scan */
    uint32_t n_pulses;  /* consecutive pulses covered, all of them cast */
    int64_t t0_ns;      /* firing time of pulse0 since the scan's start */
    int64_t line_t0_ns; /* time of the line's first pulse since the scan's start */
    /* content */
    enum line_layout layout;
    uint32_t n_points, capacity;
    uint32_t *dt_ns;     /* firing time after t0_ns; below 2^24 */
    uint32_t *a, *b, *c; /* polar: range in range_scale_m, mirror counts, pan counts;
                          * geo: x, y, z as int32 bit patterns, in scale_m from the anchor */
    int16_t *refl_cdb;   /* 0.01 dB relative to a white Lambertian target; LINE_REFL_NONE */
    uint8_t *echo;       /* number (1..15) in the low nibble, count in the high one; 0: shot without echo */
    uint16_t *label;     /* surface label; LINE_LABEL_NONE */
    /* The two attributes. Where they were not asked for, both are NULL and are not computed. */
    int16_t *amplitude_cdb; /* 0.01 dB above the detection threshold, with the detector's noise; LINE_AMPLITUDE_NONE */
    uint16_t *width_cns;    /* width of the echo, full at half maximum, 0.01 ns; LINE_WIDTH_NONE, LINE_WIDTH_MOST */
    uint8_t (*rgb)[3];      /* colour, sRGB; NULL: not asked for */
    uint16_t *deviation;    /* of the echo's shape from the pulse's, 1/1000 of its amplitude; 0: a shot without echo;
                             * NULL: echoes are not found in waveforms, or attributes are not asked for */
    struct line_waves *waves; /* NULL: not asked for */
};

/* The end of a line. */
struct line_end {
    uint32_t frame, line;
    uint64_t pulse0;                  /* the line's first pulse in the scan */
    uint32_t n_fired;                 /* pulses of the whole sweep, the blind part included */
    uint32_t n_cast;                  /* the ones of these that were cast */
    uint32_t n_echoes;                /* echoes sent; 0 also where blocks of the line were lost */
    int64_t t0_ns, t1_ns;             /* first pulse of this line, first pulse of the next, since the scan's start */
    uint32_t mirror_count, pan_count; /* encoder readings at the last pulse of this line */
    uint32_t status;                  /* LINE_LAST_OF_FRAME, LINE_PARTIAL */
    /* hits that are no echo of the line, see struct cast_counters; 0 also where blocks of the line were
     * lost */
    uint32_t n_crowded, n_faint, n_unfit;
};
enum {
    LINE_LAST_OF_FRAME = 1u << 0,
    LINE_PARTIAL = 1u << 1, /* the scan was stopped within the line */
};

int line_block_alloc(struct line_block *block, uint32_t capacity, struct sh_err *err);
/* These four functions add optional arrays to a block that line_block_alloc has made. After an error line_block_free
 * releases the block as usual. */
int line_block_alloc_attributes(struct line_block *block, struct sh_err *err);
int line_block_alloc_colours(struct line_block *block, struct sh_err *err);
int line_block_alloc_deviations(struct line_block *block, struct sh_err *err);
int line_block_alloc_waves(struct line_block *block, uint32_t waves, uint32_t samples, struct sh_err *err);
void line_block_free(struct line_block *block);

#endif
