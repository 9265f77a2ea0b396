/* SPDX-License-Identifier: MIT */
/* A LAS 1.4 file may have waveforms (ASPRS LAS 1.4 R15). Windows of samples go in, packets come out in a file of their
 * own, X.wdp beside X.las. Without --wdp the packets are copied to the end of X.las when all points are there.
 *
 * A packet has as many samples as its descriptor says, and there are at most 255 descriptors. The first 128 lengths of
 * windows each get a descriptor. Later lengths are rounded up. Packets of these lengths are filled up with samples
 * without light, which are counted. Samples have 8 bits, or 16 where the digitiser has more than 8. One thread. */
#ifndef DRIVERS_RECORD_LAS_WAVES_H
#define DRIVERS_RECORD_LAS_WAVES_H

#include <stdint.h>

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "drivers/record/outfile.h"

enum {
    LAS_KINDS = 255,
    LAS_WAVES_HEAD_LEN = 60,     /* of the record of packets, inside or in a .wdp */
    LAS_WAVES_LEN_AT = 20,       /* in it: the bytes that follow it, u64 */
    LAS_KIND_FIRST_RECORD = 100, /* record id of the first descriptor */
    LAS_WAVES_RECORD = 65535,
};

/* This is a wave packet descriptor. */
struct las_kind {
    uint32_t bits, n, sample_ps; /* of a sample in the file; samples; time between them */
    double gain, offset;         /* signal in units of the detection threshold = offset + gain * count */
};

/* A point refers to its waveform by this; zeros: the point has none. */
struct las_packet {
    uint8_t kind; /* from 1 on */
    uint64_t at;  /* bytes from the beginning of the record of packets */
    uint32_t len;
};

struct las_waves {
    struct outfile file; /* X.wdp */
    char *las_part;      /* X.las.part: as long as it is there, a repair needs the packets */
    int is_open;
    struct las_kind kind[LAS_KINDS];
    uint32_t n_kinds;
    uint64_t n_filled, n_fill, n_kindless; /* packets that were filled up, with so many samples; windows left out */
    /* of the window that was written last: points in it share its packet */
    uint64_t pulse;
    uint32_t scan, first;
    struct las_packet last;
};

/* Checks before the first scan whether X.wdp of a recording at `path` can be written. Errors are those of
 * newfile_check. */
int las_waves_check(const char *path, struct sh_err *err);
/* Opens the file of packets of a recording at `path`, and sets is_open. Errors are those of outfile_open. */
int las_waves_open(struct las_waves *waves, const char *path, struct sh_err *err);
/* The file has to be flushed before points that refer to its packets. */
int las_waves_flush(struct las_waves *waves, struct sh_err *err);
/* Writes the packet of a window, in the recording's `scan`. *is_new: there is a new descriptor. */
int las_waves_put(struct las_waves *waves, uint32_t scan, const struct scanhead_wave *wave, struct las_packet *packet,
                  int *is_new, struct sh_err *err);
/* Completes the file of packets. */
int las_waves_end(struct las_waves *waves, struct sh_err *err);
/* Copies the completed file to the end of another. SH_ESTOPPED where the report's stop says so. */
int las_waves_copy(const struct las_waves *waves, struct outfile *to, const struct sh_report *report,
                   struct sh_err *err);
/* Gives the file its name X.wdp. */
int las_waves_keep(struct las_waves *waves, struct sh_err *err);
/* Removes the file, unless it was kept, or X.las.part exists: then it stays as X.wdp.part, for a repair. */
void las_waves_close(struct las_waves *waves);

/* Writes the head of a record of packets, with the length 0. */
void las_waves_head(uint8_t head[LAS_WAVES_HEAD_LEN]);
/* Returns the name X.wdp for X.las, which the caller frees. NULL: no memory. */
char *las_waves_path(const char *path);

#endif
