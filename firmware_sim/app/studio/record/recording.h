/* SPDX-License-Identifier: MIT */
/* Following scans through libscanhead: start a scan, pass on its frames until it ends, stop it on time.
 *
 * In: a client's handle of a head (on a wire, or of offline.h) and what to scan. Out: each frame, to a callback;
 * figures of the recording. One recording at a time per handle; not real-time safe. */
#ifndef FIRMWARE_SIM_APP_STUDIO_RECORD_RECORDING_H
#define FIRMWARE_SIM_APP_STUDIO_RECORD_RECORDING_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "firmware_sim/app/studio/record/recording_counts.h"
#include "firmware_sim/base/json.h"

struct recording_options {
    int listen; /* take the frames that come until the stream or the time ends; send nothing, unless replug_s is set */
    uint32_t first_station, last_station; /* scanned one after the other, from 1; 0: as the head is set */
    /* Where several heads make one recording: first and last station of the whole recording, for progress and for
     * naming what is missing. 0: this head makes the whole recording. */
    uint32_t begin_station, end_station;
    long frames;           /* per scan; -1: as the head is set */
    double duration_s;     /* > 0: stop each scan after this device time ... */
    int head_ends;         /* ... which the head does by itself: no command is needed */
    double replug_s;       /* > 0: how long to wait for a head that was unplugged, to go on then */
    int hash;              /* keep stream_sha256 */
    int progress;          /* 1: to the report, about once a second */
    const char *file;      /* path of the recording that is the source; NULL: the source is a head */
    uint64_t source_bytes; /* of a stream in a file, for progress; 0: not known */
    const struct sh_report *report;
    /* Before each scan, while the head is idle; station as above. NULL: there is nothing to do. */
    int (*prepare)(void *ctx, uint32_t station, struct sh_err *err);
    /* Gets each frame, in order. A negative SH_E ends the recording with it. */
    int (*frame)(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err);
    /* About once a second, also while no frames come; but not while a command waits for its reply, or while the head is
     * away. Where several heads make one recording, also after each part. NULL: not called. A negative SH_E ends the
     * recording. */
    int (*second)(void *ctx, struct sh_err *err);
    void *ctx;
    /* Asked often: non-zero ends the recording in good order. NULL: never. */
    int (*interrupted)(void);
};

struct recording_result {
    /* These are counts alone (recording_add). */
    uint64_t points, empty, frames; /* received; empty: shots without echo */
    uint64_t with_reflectance;      /* points whose reflectance is modelled */
    uint64_t unplaced;              /* points and empty shots that came before the descriptor and the anchor */
    uint64_t crowded, faint, unfit; /* hits that are no echoes, as the line ends count them */
    uint64_t lost_samples;          /* of waveforms: no room in the head */
    uint64_t replugs, broken_scans; /* how often the head was away and came back; scans in which it was away */
    uint64_t bus_resets;            /* how often its USB bus was reset, which ended the session */
    struct recording_counts counts; /* of pulses and scans */
    char missing[128];              /* what was asked for and left out because of `interrupted`; empty: nothing */
    double wall_s;                  /* how long the recording took */
    struct scanhead_stats stream;   /* as the client counts */
    int is_file;                    /* the stream was read from a file */
    char sha256[65];                /* of the stream; empty where none was kept */
};

/* SH_OK, or the first failure. result is filled in both cases. */
int recording_run(struct scanhead *sh, const struct recording_options *options, struct recording_result *result,
                  struct sh_err *err);

/* Adds the counts in `more` to those in `sum`: `bytes` of each, which hold numbers of 64 bits alone. */
static inline void recording_add_counts(void *sum, const void *more, size_t bytes)
{
    for (size_t i = 0; i < bytes / sizeof(uint64_t); i++)
        ((uint64_t *)sum)[i] += ((const uint64_t *)more)[i];
}
/* Adds the figures of another part of the recording; not its wall_s, those of its stream, nor its hash. `missing`
 * becomes that of the other part. */
void recording_add(struct recording_result *sum, const struct recording_result *more);
/* Writes the result as one JSON object; ctx is the struct recording_result. */
void recording_put(struct json *json, const void *ctx);
/* 1: frames came twice or too late, or the head started again; the text says how often. 0: none of these. Frames that
 * came too late, or a second time, are in no file. */
int recording_describe_order(const struct recording_result *result, char *text, size_t len);
/* SH_OK, or what is missing: frames, pulses, parts of scans. Echoes that the head left out do not count. Pulses from
 * before the recording began count only in a file, since a recorder may join a live stream within a scan. */
int recording_check_complete(const struct recording_result *result, struct sh_err *err);

#endif
