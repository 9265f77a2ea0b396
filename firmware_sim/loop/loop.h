/* SPDX-License-Identifier: MIT */
/* The fixed-rate loop: casters that compute ahead, one pacing thread, one thread per link.
 *
 * In: the site, the device and the links of the configuration. Out: the stream on the links, and statistics.
 *
 * Casters claim ticks up to ahead_ms before their time and fill slots. In real time the pacing thread sleeps on an
 * absolute clock, and releases each tick when its last pulse has fired. To release is to number the frames,
 * to publish the slot with one store, and to wake each link. A tick that is not ready late_ms after its time
 * is given up: it is announced on the wire and counted, and its pulse numbers are missing. In the paces fast
 * and step the head loses nothing: release waits for casters, and for readers of links that wait (enum link_waits).
 *
 * In real time the pacing thread runs at SCHED_FIFO where that is permitted. It touches no lock, allocator or log. */
#ifndef FIRMWARE_SIM_LOOP_LOOP_H
#define FIRMWARE_SIM_LOOP_LOOP_H

#include "firmware_sim/base/json.h"
#include "firmware_sim/device/device.h"
#include "firmware_sim/loop/lateness.h"
#include "firmware_sim/loop/links.h"
#include "firmware_sim/loop/source.h"

struct loop;
struct config;

struct loop_options {
    int hash;                              /* keep stream_sha256 */
    const struct link_spec *extra;         /* one more link than the configuration has; NULL: none */
    const struct web_source *web;          /* what links of type web serve beside the page; NULL: nothing */
    const struct sh_report *report;        /* warnings while running (from any thread); NULL: none */
    const struct links_observer *observer; /* NULL: none; it must outlive the loop */
    double planned_ns; /* processor time for a pulse: ten times that gives a warning. 0: the time of the site's plan */
};

struct loop_stats {
    struct device_counters counters;
    uint64_t scans;
    double wall_s;               /* from the release of the first pulse to that of the last */
    const struct lateness *late; /* of releases in real time; until loop_free */
    const struct lateness *wake; /* of the pacing thread's wake-ups; likewise */
    int have_hash;
    char sha256[65];
};

/* Opens all links; nothing runs yet. On failure everything opened is closed again. */
int loop_create(const struct site *site, struct device *device, const struct loop_options *options, struct loop **out,
                struct sh_err *err);

/* The same for a source that makes its ticks itself. loop_create_of uses links, loop, monitored fields and the head's
 * identity of cfg alone. */
int loop_create_of(const struct config *cfg, const struct loop_source *source, const struct loop_options *options,
                   struct loop **out, struct sh_err *err);

/* {"endpoints": [...]}: type, endpoint and protocol of each link that another program can open (not fd); type and
 * endpoint of the socket for poses. */
void loop_put_endpoints(const struct loop *loop, struct json *json);
/* After loop_join: an array of the links, each with its endpoint and what its readers got and lost. */
void loop_put_links(const struct loop *loop, struct json *json);
/* Link i; after the links the socket for poses. 0: there is no such link. */
int loop_get_place(const struct loop *loop, uint32_t i, struct link_place *place);

/* After loop_join: what the readers of link i got and lost. 0: there is no such link. */
int loop_get_counts(const struct loop *loop, uint32_t i, struct link_counts *counts);

/* Starts the threads. */
int loop_start(struct loop *loop, struct sh_err *err);
/* True once the run is over and its readers have what they can take. */
int loop_is_over(const struct loop *loop);
/* For a head that computes, at the pace `fast`: true where the head will be at rest once the next ticks are released. A
 * command that waits until then has the same effect in each run. Any thread. */
int loop_settles(struct loop *loop);
/* Ends the run early. Any thread. */
void loop_end(struct loop *loop);
/* Waits for the end, stops the threads, fills stats. loop_free closes the links. */
void loop_join(struct loop *loop, struct loop_stats *stats);
/* After loop_join: completes the files that the source writes; stats then counts the lines that they lack. Returns the
 * first error in writing them. */
int loop_close_files(struct loop *loop, struct loop_stats *stats, struct sh_err *err);
/* After loop_join: 0, or the error that kept a link from getting all that it should. */
int loop_check_links(const struct loop *loop, struct sh_err *err);
void loop_free(struct loop *loop);

#endif
