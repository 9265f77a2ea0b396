/* SPDX-License-Identifier: MIT */
/* A scanhead handle's own struct, and what the stream changes in it. Private to libscanhead. */
#ifndef DRIVERS_HOST_HOST_H
#define DRIVERS_HOST_HOST_H

#include <nettle/sha2.h>

#include "drivers/host/scanhead.h"
#include "drivers/host/source.h"
#include "drivers/protocol/native.h"

enum { HOST_QUEUE_BYTES = 64 << 20, HOST_TURN_PARTS = 256, HOST_BLOCK = 128 };

/* A frame kept while a command waits for its reply, or from before a reattach. */
struct host_node {
    struct host_node *next;
    size_t len;
    uint64_t at_byte; /* where it begins in all bytes that were received */
    uint8_t raw[];
};

struct host_turn_part {
    double sine, cosine;
};

struct host_surface {
    char *object, *material; /* NULL: not seen */
};

/* Kept frames, in their order. */
struct host_kept {
    struct host_node *first, *last, *current; /* current was handed out last, and is not in the list any more */
    size_t bytes;
};

/* Times reported by the stream. */
struct host_times {
    int have_scan_t0, have_gps;
    int64_t scan_t0_ns;        /* device time of the scan's start */
    int64_t gps_at_ns, gps_ns; /* a device time, and the GPS time that the head's clock had then */
    uint32_t gps_seq;          /* the event that says so */
};

/* Notices that the parser does not give: about lines that nobody waits for, frames with wrong contents, connections. */
struct host_notices {
    void (*fn)(void *ctx, const struct scanhead_notice *notice); /* NULL: nobody listens */
    void *ctx;
    uint64_t given_up;   /* commands whose reply has not come, so far */
    uint64_t identities; /* of these, how many asked who the head is */
    int close_told;      /* CLOSED was given for this connection */
    uint64_t echoes, late_replies, unasked, closed, reattached, refused;
};

struct scanhead {
    struct host_source source;
    int ended;        /* no more bytes will come */
    int lost;         /* ended, because the device was unplugged */
    int reset;        /* ended, because the bus was reset, with the device still on it */
    int stuck;        /* half a command went out: nothing sensible can follow */
    int has_taken;    /* a frame of this version has come */
    int has_no_limit; /* the present call waits without a time limit, so a signal ends it */
    struct native_parser parser;
    struct host_notices notices;
    struct host_kept kept;
    const uint8_t *payload; /* of the frame that scanhead_next returned last */
    int have_points;        /* a points frame has been handed out: */
    uint32_t points_seq;
    struct native_attributes of_points; /* how its attributes must begin */
    int64_t points_t_ns, points_t0_ns;  /* device time and time in the scan of its first pulse */

    /* state that the stream has reported, up to the frame that was handed out last */
    int have_seq, have_descriptor, have_anchor, have_pulse;
    uint32_t last_seq;                   /* of a frame that is not LOCAL */
    int told_alone;                      /* a descriptor for this reader alone came after last_seq */
    uint32_t descriptor_seq, anchor_seq; /* frames that gave the descriptor and the anchor at hand */
    struct native_descriptor descriptor;
    struct native_emitter emitter; /* kind NATIVE_EMIT_LINE: none came after the descriptor */
    struct native_beam beam[NATIVE_MAX_BEAMS];
    struct native_anchor anchor;
    uint64_t last_pulse0;
    struct host_poses *poses; /* NULL: none came yet */
    struct host_times times;
    struct host_surface *surface;
    size_t surface_room;
    uint32_t n_surfaces;

    uint64_t dropped, reader_lost, reader_lost_before; /* frames; _before: of earlier sessions */
    uint64_t pulses_lost_told, pulses_lost_ended;      /* by OVERRUN events, by SCAN_END events */
    int hashing;
    struct sha256_ctx sha256;
    struct sh_err err;
    struct host_turn_part turn_part[HOST_TURN_PARTS]; /* sines and cosines of whole 1/256 turns */
};

/* notices.c: hands on the parser's notices. To be called once, after native_parser_init. */
void host_listen(struct scanhead *sh);
/* Gives the notice for the parser's present line: nobody waits for it, or it echoes what was just sent. */
void host_note_line(struct scanhead *sh, int is_echo);
/* Gives the notice that the connection is over, once for each connection; for a recording there is none. The parser has
 * given all items by then. */
void host_note_closed(struct scanhead *sh);
void host_note_reattached(struct scanhead *sh);
/* Gives the notice that the frame is not handed out, for the reason in sh->err. */
void host_note_refused(struct scanhead *sh, const struct native_header *header, uint64_t at_byte);

/* Takes a frame into the state: descriptor, anchor, names, counters, hash. To be called once per frame, in stream
 * order. SH_EFORMAT: the frame has wrong contents or another version. */
int host_absorb(struct scanhead *sh, const struct native_header *header, const uint8_t *payload);

/* Takes the number of frames that the session has left out so far. A session begins anew with 0. */
void host_count_reader_lost(struct scanhead *sh, uint64_t n);

/* SCANHEAD_EINPUT, unless frame is the one that scanhead_next returned last, and of this type. */
int host_check_last(struct scanhead *sh, const struct scanhead_frame *frame, enum scanhead_frame_type type);

/* attributes.c: returns whether the descriptor says that the stream has this content; SCANHEAD_ESTATE before a
 * descriptor has come. */
int host_has_content(const struct scanhead *sh, enum native_content content);

/* poses.c: the first takes a poses frame in. The second forgets all poses, as another scan begins. */
int host_absorb_poses(struct scanhead *sh, const uint8_t *payload, size_t len);
void host_forget_poses(struct scanhead *sh);

/* turns.c: host_turn_table fills the table with sines and cosines of whole 1/256 turns. host_sincos_turns computes them
 * for n <= HOST_BLOCK angles of u >= 0 turns, by the table and a series for the rest of each angle. */
void host_turn_table(struct scanhead *sh);
void host_sincos_turns(const struct host_turn_part *table, const double *u, int n, double *s, double *c);
/* Sets rad to the angles of u turns in radians, folded into [lo, lo + 1) turns. */
void host_fold_turns(const double *restrict u, int n, double lo, double *restrict rad);

#endif
