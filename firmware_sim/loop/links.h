/* SPDX-License-Identifier: MIT */
/* The links of a head: each open link is a pump (pump.h) with a thread of its own.
 *
 * In: the links of the configuration, and the stream. Out: frames and replies to clients, commands to the
 * device. */
#ifndef FIRMWARE_SIM_LOOP_LINKS_H
#define FIRMWARE_SIM_LOOP_LINKS_H

#include "drivers/protocol/cola_field.h"
#include "drivers/protocol/protocol.h"
#include "firmware_sim/loop/mover.h"
#include "firmware_sim/loop/source.h"
#include "firmware_sim/loop/stream.h"

struct pump;

/* A link as users see it. */
struct link_place {
    const char *type;
    char endpoint[512];
    double bytes_s;       /* that it can carry; 0: no fixed limit */
    const char *protocol; /* its name; NULL: none */
};

/* Counts of what the readers of a link got, and of what was left out for them. COUNTS.md defines the
 * words. */
struct link_counts {
    /* Native: pulses in frames that were written out to the link as a whole. Other protocols: pulses that the protocol
     * was given since the client came. */
    uint64_t received_pulses;
    uint64_t left_out_pulses;
    uint64_t left_out_frames;
    /* of all protocols but the native one */
    uint64_t sent_units, lost_units, lost_points, unsent_pulses, wrong_requests, lost_input_bytes;
};

/* An observer of the clients. The threads of the links call each function when its event happens. */
struct links_observer {
    void *ctx;
    /* A session begins (1) or ends (0). t_ns: the device time at which the session's stream begins or ends. */
    void (*session)(void *ctx, uint32_t session, int begins, const char *peer, int64_t t_ns);
    /* The session's client sent these bytes. */
    void (*heard)(void *ctx, uint32_t session, const void *bytes, size_t len);
    /* A request was answered with an error, or could not be read. line and reply: of a native request; NULL in other
     * protocols. */
    void (*refused)(void *ctx, uint32_t session, const char *line, const char *reply);
};

struct links {
    /* set by the caller */
    struct stream *stream;
    const struct loop_source *source;
    double waves_bytes_s; /* of waveforms at power-up; 0: none, or not known */
    struct mover mover;
    const struct sh_report *report;        /* NULL: none */
    const struct web_source *web;          /* of links of type web; NULL: none */
    const struct links_observer *observer; /* NULL: none */
    struct protocol_identity identity;
    struct cola_fields fields;    /* of the identity, where there are some */
    char data_address[64];        /* where the first velodyne link of type udp sends; empty: none */
    int data_port, position_port; /* of the first links velodyne and velodyne-position of type udp; 0: none */

    struct pump *pump[STREAM_MAX_LINKS];
    uint32_t n;
    _Atomic uint32_t n_busy; /* links that still have something to write */
    _Atomic int failed;
    struct sh_err error; /* of the first link that failed, once failed is 1 */
};

/* Opens the links of the configuration, and one more where extra is not NULL. A link of the native protocol that
 * carries less than the stream needs is refused. links_close is needed after a failure, too. */
int links_open(struct links *links, const struct config *cfg, const struct link_spec *extra, struct sh_err *err);
int links_start(struct links *links, struct sh_err *err);
/* Waits until the links have written all that their readers take. */
void links_join(struct links *links);
void links_close(struct links *links);

#endif
