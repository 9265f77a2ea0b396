/* Taking a scan through libscanhead: start, follow until it ends, stop on time. Off line the head runs in this process,
 * at the pace `fast`, behind a socket pair; the client side is the same. */
#ifndef FIRMWARE_SIM_APP_RECORDING_H
#define FIRMWARE_SIM_APP_RECORDING_H

#include <stdint.h>

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "firmware_sim/config/config.h"

struct recording_options {
    int listen;                           /* send nothing; take what comes until the stream or the time ends */
    uint32_t first_station, last_station; /* scanned one after the other, from 1; 0: as the head is set */
    long frames;                          /* per scan; -1: as the head is set */
    double duration_s;                    /* > 0: stop each scan after this time of scanning */
    double replug_s;                      /* > 0: how long to wait for a head that was unplugged, to go on then */
    int progress;                         /* to the report, about once a second */
    const struct sh_report *report;
    /* Each frame, in order. A negative SH_E ends the recording with it. */
    int (*frame)(void *ctx, struct scanhead *sh, const struct scanhead_frame *frame, struct sh_err *err);
    void *ctx;
    /* Asked often: non-zero ends the recording in good order. May be NULL. */
    int (*interrupted)(void);
};

struct recording_result {
    uint64_t points, empty, frames, scans, pulses;
    uint64_t lost_pulses;           /* as the head says: cast pulses it could not compute */
    uint64_t crowded, faint, unfit; /* hits that are no echoes, as its line ends say */
    int ended_early;                /* the stream ended before the scan did */
    char missing[128];              /* what was asked for but left out because of `interrupted`; empty: nothing */
    uint64_t replugs, broken_scans; /* how often the head was away and came back; scans in which it was */
};

int recording_run(struct scanhead *sh, const struct recording_options *options, struct recording_result *result,
                  struct sh_err *err);

struct offline;
/* Loads and runs the head of a configuration; its own links are left closed. cfg is changed (pace, links). */
int offline_open(struct config *cfg, const struct sh_report *report, struct offline **out, struct sh_err *err);
struct scanhead *offline_scanhead(struct offline *offline);
const struct site *offline_site(const struct offline *offline);
void offline_close(struct offline *offline);

#endif
