/* SPDX-License-Identifier: MIT */
/* A PTP follower that disciplines the head's clock. No message of PTP is on any wire: master and path are
 * simulated.
 *
 * In: keys time.ptp, the injected faults of a tick, the head's clock. Out: the port's and the servo's state, the offset
 * from the master as the follower measures it, and the changes of the clock that its servo makes.
 *
 *     head's clock --> measured offset --> servo --> rate, or a step, of the head's clock
 *        ^              + asymmetry + jitter                  |
 *        +----------------------------------------------------+
 *
 * The master has the true time (head_clock.h), plus what faults add to it. Announce and Sync messages come at whole
 * multiples of their interval in device time. The port changes its states as ptp4l of linuxptp does where it is a
 * client only, and the texts of its events are those of ptp4l's log:
 *
 *     INITIALIZING --boot over--> LISTENING --2nd Announce--> UNCALIBRATED <--servo--> SLAVE
 *     UNCALIBRATED, SLAVE --no Announce for 3 intervals--> LISTENING      any state --fault--> FAULTY --> LISTENING
 *
 * The servo is a PI controller. From the offset o, ns, and the Sync interval T it corrects the rate by 0.7 o / T, and
 * its estimate of the oscillator by 0.3 o / T. Both gains are linuxptp's for T = 1 s. The servo's states:
 *     s0 unlocked   an offset is measured
 *     s1 jump       with the second one the rate is known, and the offset was too large: the clock was stepped
 *     s2 locked     each Sync corrects the rate; without a step it follows s0
 *
 * In holdover the rate stays as it was last corrected, and a fault's drift is added (clock_faults.c). Offset, delay and
 * grandmaster stay those of the last master, as ptp4l reports them.
 *
 * All figures are integers of ns and 1e-12, and the clock takes each correction exactly. The random number of a jitter
 * is keyed by noise.seed and the number of the Sync. The last PTP_KEPT changes are kept, since sessions ask for past
 * times.
 *
 * Thread: with the device's lock. A head without a follower costs one comparison a tick. */
#ifndef FIRMWARE_SIM_DEVICE_PTP_H
#define FIRMWARE_SIM_DEVICE_PTP_H

#include <stdint.h>

#include "drivers/protocol/native.h"

struct config_ptp;
struct device_events;
struct head_clock;
struct head_faults;
struct journal;

enum { PTP_KEPT = 64, PTP_ANNOUNCES_TO_SELECT = 2, PTP_INTERVALS_TO_LOSE = 3, PTP_TEXT_LEN = 128 };

struct ptp_status {
    int64_t from_ns; /* device time */
    enum native_ptp_port port;
    enum native_ptp_servo servo;
    int64_t offset_ns, delay_ns; /* at the last Sync; the offset is from before its correction */
    uint64_t grandmaster;        /* 0: there was none yet */
    uint32_t clock_class, clock_accuracy;
    int utc_valid;
};

struct ptp {
    const struct config_ptp *cfg; /* NULL: the head has no follower */
    struct head_faults *faults;
    struct head_clock *clock;
    struct device_events *events;
    struct journal *journal; /* NULL: none */
    uint64_t key;
    int is_up, is_faulty;
    uint32_t n; /* changes so far; the last PTP_KEPT are kept */
    struct ptp_status kept[PTP_KEPT];
    struct ptp_status now;
    uint64_t candidate;  /* the identity of another master, which is better */
    uint32_t n_heard;    /* its Announce messages in a row */
    int64_t announce_ns; /* the last one of the selected master */
    /* servo */
    int n_samples;    /* up to 2 */
    int has_locked;   /* the first step, if any, is over */
    int64_t rate_ppt; /* what it adds to the clock's gain */
    int64_t estimate_ppt;
    int64_t sample_ns, sample_offset_ns; /* the first sample */
};

/* All that *ptp points to must outlive *ptp. seed: noise.seed. */
void ptp_init(struct ptp *ptp, const struct config_ptp *cfg, uint64_t seed);
/* A tick, [t_ns, end_ns) of device time, after the faults of the tick have begun and ended. is_up: the head has power
 * and has booted. */
void ptp_run(struct ptp *ptp, int64_t t_ns, int64_t end_ns, int is_up);
/* Returns the status at a device time that was run. NULL: the head has no follower, or has not had power yet. */
const struct ptp_status *ptp_at(const struct ptp *ptp, int64_t t_ns);
/* "SLAVE,s2,-12,850,00b0ae.fffe.000001,6,0x21,1": port, servo, offset and path delay in ns, grandmaster, its class and
 * accuracy, whether its offset to UTC is valid. */
void ptp_text(const struct ptp_status *status, char text[PTP_TEXT_LEN]);

#endif
