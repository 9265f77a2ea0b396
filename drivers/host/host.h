/* SPDX-License-Identifier: MIT */
/* A scanhead handle's own struct and what the files of this folder share. Private to libscanhead. */
#ifndef DRIVERS_HOST_HOST_H
#define DRIVERS_HOST_HOST_H

#include <nettle/sha2.h>
#include <sys/types.h>

#include "core/err.h"
#include "drivers/host/scanhead.h"
#include "drivers/protocol/native.h"

enum { HOST_QUEUE_BYTES = 64 << 20, HOST_TURN_PARTS = 256 };

/* A frame kept while a command waits for its reply. */
struct host_node {
    struct host_node *next;
    size_t len;
    uint8_t raw[];
};

struct host_surface {
    char *object, *material; /* NULL: not seen */
};

/* How bytes come and go, without blocking; one table for descriptors, one for USB. */
struct host_source;
struct host_source_ops {
    /* Bytes moved; 0 from read: the end; -1 with errno: EAGAIN when none can be now. */
    ssize_t (*read)(struct host_source *source, void *to, size_t len);
    ssize_t (*write)(struct host_source *source, const void *data, size_t len);
    /* poll() for POLLIN and POLLOUT until the deadline (host_deadline_ns): 1, 0 when it is over, -1 with
     * errno. */
    int (*wait)(struct host_source *source, short events, int64_t deadline_ns, short *revents);
    void (*close)(struct host_source *source);
};

struct host_source {
    const struct host_source_ops *ops;
    int fd;
    struct host_usb *usb;
    struct host_capture *capture; /* of a .pcapng; else NULL */
    int is_file, is_socket;
    int unsettled;  /* lines may come that answer no command of ours: on a new terminal, after a time-out */
    int asked;      /* *IDN? that went out to skip such lines, and have no answer yet */
    char name[256]; /* for messages, and to open it again */
};

/* Frames that wait while a command waits for its reply. */
struct host_kept {
    struct host_node *first, *last, *current; /* current: the one that was handed out */
    size_t bytes;
};

/* Times reported by the stream. */
struct host_times {
    int have_scan_t0, have_gps;
    int64_t scan_t0_ns;        /* device time of the scan's start */
    int64_t gps_at_ns, gps_ns; /* a device time, and the GPS time that the head's clock had then */
};

/* Notices of what is not in the bytes themselves: lines that came unasked, connections. */
struct host_notices {
    void (*fn)(void *ctx, const struct scanhead_notice *notice); /* NULL: nobody listens */
    void *ctx;
    uint64_t given_up;   /* commands whose reply has not come, so far */
    uint64_t identities; /* of these, how many asked who the head is */
    int close_told;      /* CLOSED was given for this connection */
    uint64_t echoes, late_replies, unasked, closed, reattached;
};

struct scanhead {
    struct host_source source;
    int ended; /* no more bytes will come */
    int lost;  /* because the device was unplugged */
    int reset; /* because the bus was reset, with the device still on it */
    int stuck; /* half a command went out: nothing sensible can follow */
    struct native_parser parser;
    struct host_notices notices;
    struct host_kept kept;
    const uint8_t *payload; /* of the frame that scanhead_next returned last */
    int have_points;        /* a points frame has been handed out: */
    uint32_t points_seq;
    struct native_attributes of_points; /* how its attributes must begin */

    /* what the stream has said, as of the frame handed out last */
    int have_descriptor, have_anchor, have_pulse;
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

    uint64_t dropped, reader_lost;
    uint64_t pulses_lost_told, pulses_lost_ended; /* by OVERRUN events, by SCAN_END events */
    int hashing;
    struct sha256_ctx sha256;
    struct sh_err err;
    double sin_part[HOST_TURN_PARTS], cos_part[HOST_TURN_PARTS]; /* of whole parts of a turn */
};

/* Opens what `source` names, non-blocking. */
int host_source_open(const char *source, struct host_source *out, struct sh_err *err);
int host_source_is_usb(const char *source);
/* usb_transfers.c: the same for "usb..."; out is zero but for its name. */
int host_usb_open(const char *source, struct host_source *out, struct sh_err *err);
extern const struct host_source_ops host_fd_ops;
/* capture.c: source is an open file of that kind. Where it fails, the descriptor is still the caller's. */
int host_capture_open(struct host_source *source, struct sh_err *err);

/* usb_watch.c: waits between two tries to open a source. NULL where a source is not on USB, or where the
 * system does not report devices that come: then the waits are short. Devices that come after this call are
 * not missed. */
struct host_usb_watch *host_usb_watch_open(const char *source);
void host_usb_watch_close(struct host_usb_watch *watch);
/* rc: why the last try failed. 0: try again, or the deadline is over; -1: a signal came. */
int host_usb_watch_wait(struct host_usb_watch *watch, int rc, int64_t deadline_ns);

/* io.c: whether an errno of the source's read or write means that the other side is gone. */
int host_is_hang_up(const struct scanhead *sh, int error);
/* Notes what that errno means for a head on USB: it was unplugged, or its bus was reset. */
void host_note_loss(struct scanhead *sh, int error);
/* Sets and returns the error for when nothing more will come. */
int host_gone(struct scanhead *sh);
/* The same once all that had come was taken: also gives the notice that the connection is over. */
int host_over(struct scanhead *sh);

/* notices.c: hands on what the parser notices. Called once, after native_parser_init. */
void host_listen(struct scanhead *sh);
/* Gives the notice for the parser's present line: nobody waits for it, or it echoes what was just sent. */
void host_note_line(struct scanhead *sh, int is_echo);
/* The connection is over, and the parser has given all of it. Once for each connection. */
void host_note_closed(struct scanhead *sh);
void host_note_reattached(struct scanhead *sh);

/* exchange.c: the parser is at a line that nobody waits for. */
void host_stray_line(struct scanhead *sh);
/* Nothing more will come: keeps the frames that are in the parser. The rest of it is garbage. */
int host_keep_rest(struct scanhead *sh);

/* Takes a frame into the state: descriptor, anchor, names, counters, hash. Called once per frame, in stream
 * order. */
int host_absorb(struct scanhead *sh, const struct native_header *header, const uint8_t *payload);

/* Nanoseconds of the monotonic clock at which timeout_ms from now is over; INT64_MAX for a negative one. */
int64_t host_deadline_ns(int timeout_ms);
/* Waits for `events` on the source: 0, SH_ETIMEOUT (also for a signal when there is no deadline), SH_EIO. */
int host_wait(struct scanhead *sh, short events, int64_t deadline_ns, short *revents);
/* Reads what is there into the parser, waiting for it until the deadline. 0 also at the end: then sh->ended
 * is set. */
int host_fill(struct scanhead *sh, int64_t deadline_ns);

/* Keeps the frame that the parser is at, for scanhead_next. */
int host_keep(struct scanhead *sh);

/* SCANHEAD_EINPUT, unless frame is the one that scanhead_next returned last, and of this type. */
int host_check_last(struct scanhead *sh, const struct scanhead_frame *frame, enum scanhead_frame_type type);

/* poses.c: takes a poses frame in; forgets all (another scan). */
int host_absorb_poses(struct scanhead *sh, const uint8_t *payload, size_t len);
void host_forget_poses(struct scanhead *sh);

void host_turn_table(struct scanhead *sh);

#endif
