/* SPDX-License-Identifier: MIT */
/* The line from the GNSS receiver: the fixes that were sent as sentences, the time at which each sentence arrived, and
 * the faults that the line has.
 *
 * In: each tick, with the faults that are active in it. Out: the last sentence that had arrived by a device time. No
 * sentence overtakes another. The last RECEIVER_KEPT sentences are kept, since sessions ask for past times. For earlier
 * times, and for times that no tick has reached yet, sentences follow from the receiver's fixes, without faults.
 * Thread: with the device's lock. */
#ifndef FIRMWARE_SIM_DEVICE_RECEIVER_LINE_H
#define FIRMWARE_SIM_DEVICE_RECEIVER_LINE_H

#include "firmware_sim/device/gnss.h"
#include "firmware_sim/device/head_faults.h"

/* Sentences under way must fit: 20 a second, late by up to 5 s (gnss.nmea_late_ms) and 10 s (faults). */
enum { RECEIVER_KEPT = 512 };

struct receiver_sentence {
    int64_t t_ns;           /* device time of its arrival */
    uint64_t index;         /* of its fix */
    int is_void, is_spoilt; /* it says that there is no fix; its checksum is wrong */
};

struct receiver_line {
    uint64_t next; /* the first fix that no tick has reached */
    uint64_t n;    /* sentences so far; number i is at i % RECEIVER_KEPT */
    struct receiver_sentence kept[RECEIVER_KEPT];
};

/* Sends the fixes before end_ns that were not reached before. */
void receiver_line_run(struct receiver_line *line, const struct gnss *gnss, struct head_faults *faults, int64_t end_ns);
/* Finds the last sentence that had arrived at t_ns. 0: there is none. */
int receiver_line_last(const struct receiver_line *line, const struct gnss *gnss, int64_t t_ns,
                       struct receiver_sentence *out);
/* Returns the time of the first arrival at t_ns or later, as far as it is known; INT64_MAX: none ever comes. A time
 * that no tick has reached yet may be too early, as a fault may still delay the sentence. So the caller has to ask
 * again at that time. */
int64_t receiver_line_next_ns(const struct receiver_line *line, const struct gnss *gnss, int64_t t_ns);

#endif
