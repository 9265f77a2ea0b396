/* SPDX-License-Identifier: MIT */
/* Private to pump*.c, session.c and lost_frames.c: a link with its sessions. */
#ifndef FIRMWARE_SIM_LOOP_PUMP_INSIDE_H
#define FIRMWARE_SIM_LOOP_PUMP_INSIDE_H

#include <pthread.h>

#include "firmware_sim/fault/wire.h"
#include "firmware_sim/loop/pump.h"
#include "firmware_sim/loop/unit_queue.h"

enum {
    REPLY_ROOM = 8192,
    BATCH_BYTES = 131072, /* small ticks are written together up to this */
    QUEUE_UNITS = 16,     /* a session has room for so many of a protocol's longest units */
    READ_BYTES = 65536,
    WRONG_AT_ONCE = 128, /* wrong lines of a session, and then a rest of so long for its link: */
    REST_NS = 2000000,
};

/* Command lines of a client, and the replies to them. */
struct session_commands {
    struct command_lines lines;
    unsigned char in[READ_BYTES]; /* bytes read; those from in_pos on are not looked at yet */
    uint32_t in_len, in_pos;
    char reply[REPLY_ROOM];
    uint32_t reply_len;
    int replies_dropped;
    uint32_t wrong; /* lines since the last rest */
    int stepping;   /* the reply to TIME:STEP waits until all before step_tick has gone out */
    uint64_t step_tick;
    char step_reply[COMMAND_MAX_REPLY];
    int moving; /* the reply to SITE:POSE waits until the station's place is planned (mover.h) */
    struct move_box move;
};

struct session {
    int open;
    int shut;            /* its client sends nothing more */
    int left;            /* the source knows that: control and a half line are gone */
    uint32_t id;         /* from 1, over all links */
    int reader;          /* of the stream */
    uint64_t cursor;     /* next tick to take */
    uint64_t power_from; /* power that goes with a tick before this one does not end it */
    struct {
        int have_seq; /* next_seq and next_pulse are known */
        uint32_t next_seq;
        uint64_t next_pulse; /* pulses delivered before the frame of that number */
        uint64_t frames;
        int lagging; /* the error queue has the loss */
    } lost;          /* lost_frames.c */
    uint8_t *out;
    uint32_t out_len, out_pos;       /* bytes from out_pos on are not written yet */
    uint32_t frames_from, frames_to; /* in out: replies before and after */
    struct session_commands commands;
    /* of a protocol that is not native */
    struct pump *pump;
    void *protocol;
    struct unit_queue units;
    int answering;     /* input() is being called */
    int hang_up;       /* the session ends once its units are out */
    struct wire *wire; /* NULL: no fault so far */
    char peer[64];
    int64_t moved_ns; /* clock_now_ns() when a byte last went out, or, at the end, was taken by the reader */
    int unread;       /* at the end: bytes that wait in the system for the reader */
};

/* Faults at connections (USB: at enumerations); pump_connections.c */
struct pump_connections {
    uint64_t n;       /* connections so far, refused ones too */
    uint32_t version; /* of the list */
    struct pump_fault {
        struct fault_entry entry;
        uint64_t base; /* connections before it was there */
    } fault[FAULT_MAX];
    uint32_t n_faults;
};

struct pump {
    struct link_counts counts; /* of all its sessions so far */
    struct links *links;
    struct stream *stream;
    const struct link_ops *ops;
    void *link;
    const struct protocol_ops *protocol;
    uint8_t *tick; /* frames of the tick at hand, for a protocol; NULL: it is native */
    int wake_fd;
    struct stream_listener *listener;
    uint32_t out_cap;          /* of each session */
    int holds;                 /* its readers hold back the paces fast and step */
    uint32_t number;           /* of the link, from 1 */
    struct fault_board *board; /* NULL: no faults strike here */
    uint32_t can;              /* link_faults() */
    struct fault_tally tally;  /* of what the link does */
    struct pump_connections connections;
    int64_t plug_ns;         /* clock: when an unplugged link is there again; 0: it is */
    int plug_failed;         /* it could not come back so far, and that was reported */
    int64_t refuse_until_ns; /* clock: until then clients are turned away */
    uint32_t power_seen;     /* changes of power that were done here */
    int is_off;              /* the head has no power */
    struct session session[LINK_MAX_SESSIONS];
    pthread_t thread;
    int running;
    int64_t over_ns; /* clock: when it was first seen that the run is over; 0: it is not */
    int failed;      /* a write failed; the reason is still to come */
};

/* session.c */
void session_open(struct pump *pump, struct session *s, const char *peer);
void session_close(struct pump *pump, struct session *s);
/* Its client sends nothing more. It still gets answers to what it sent, and the stream. */
void session_shut(struct pump *pump, struct session *s);
/* The same when power goes: the device knows that already. */
void session_cut(struct pump *pump, struct session *s);
/* The first tick that the session does not take any more, since power goes with it; UINT64_MAX: none. */
uint64_t session_off_tick(const struct pump *pump, const struct session *s);
/* Begins a session anew with a tick: one that no client can end, such as a file's. */
void session_restart(struct pump *pump, struct session *s, uint64_t tick);
/* Takes released ticks and replies, and writes until the link is full (1) or nothing is left (0). index: of the session
 * on its link. */
int session_write(struct pump *pump, struct session *s, int index);
/* Whether a session whose bytes are all written is over. It is when its protocol ends it, or when its client sends
 * nothing more and nothing is due to it. */
int session_is_done(const struct pump *pump, const struct session *s);

/* Puts the next ticks and replies into the buffer, which was written out. */
void session_fill(struct pump *pump, struct session *s);

/* pump_faults.c */
/* Whether the session's bytes go through a wire: there is an injected fault, or there was one. */
int session_has_wire(struct pump *pump, struct session *s);
void session_close_wire(struct session *s);
int session_wire_waits(const struct session *s);
/* Whether a fault holds back bytes in the wire. */
int session_wire_keeps_back(const struct session *s, int64_t now_ns);
/* In the paces that wait, a session with faults takes no frames while the file of the truth is behind. Its client still
 * gets its replies. */
int session_waits_for_files(const struct pump *pump, const struct session *s);
/* As session_write, through the session's wire. */
int session_write_faulty(struct pump *pump, struct session *s, int index);
/* Writes the bytes in the wire. 1: the link is full; 0: nothing may go out now; -1: the session is closed. last: no
 * bytes come after these. */
int session_write_wire(struct pump *pump, struct session *s, int index, int last);
/* Whether the wire has no room for more. */
int session_wire_is_full(const struct pump *pump, const struct session *s);
/* Puts the oldest unit of a protocol, or the rest of it, into the wire. */
void session_put_unit(struct pump *pump, struct session *s);
/* A command line of this session has changed the faults; its reply is still to come. */
void session_faults_changed(struct pump *pump, struct session *s);
/* Takes bytes that the client sent. */
void session_heard(struct session *s, const void *bytes, size_t len);
/* The time at which a wire or the link next has something to do; INT64_MAX: none. */
int64_t pump_next_ns(const struct pump *pump);
/* Brings an unplugged link back when its time is over. */
void pump_plug(struct pump *pump);

/* pump_connections.c */
/* A client has come. 1: it is turned away, by an injected fault. index: of the session. */
int pump_turns_away(struct pump *pump, int index);
/* A host has got the USB device. */
void pump_plugged(struct pump *pump);
/* The link fault that carries out a fault of this kind. */
enum link_fault pump_link_fault(enum fault_kind kind);

/* pump.c: warns the user who runs the head. */
void pump_say(struct pump *pump, const char *text);

/* pump_power.c: the links of a head that loses power, and has it again. */
/* Does what is due. full: a bit for each session whose link takes no more. 1: there is more to do at once. */
int pump_power(struct pump *pump, uint32_t full);

/* lost_frames.c: the one place that counts what a reader got and what it lost. */
/* Compares the number of a tick's first frame with the expected one, and counts a gap. A native reader gets an event
 * frame before the tick's frames. These lie at the end of its buffer, with REPLY_ROOM / 8 bytes free after them.
 * `released`: ticks released when the tick was read. Returns how many frames are missing. */
uint32_t session_check_lost(struct pump *pump, struct session *s, const struct ring_copy *tick, uint64_t released);
/* Counts n units of a protocol. */
void session_count_units(struct pump *pump, struct session *s, uint64_t n);
/* The client went away. Bytes that were not written to it count neither as received nor as lost. */
void session_gone(struct pump *pump, struct session *s);
/* At the end of the run: counts what the reader did not get as lost. */
void session_leave(struct pump *pump, struct session *s);

/* pump_commands.c */
/* Adds a reply line after those that wait already. */
void pump_add_reply(struct session *s, const char *text);
/* Adds the reply to SITE:POSE, once it is there. */
void pump_end_move(struct pump *pump, struct session *s);
/* Carries out the lines that were read. Each one is carried out and answered after the one before. Lines wait
 * while a step or a move goes on, and while there is no room for their replies. Replies are lost only to a client that
 * sends on and on without reading. */
void pump_take_lines(struct pump *pump, struct session *s);
/* A client that floods the link with wrong lines would cost a processor. So a link rests when one of its sessions had
 * WRONG_AT_ONCE of them. 1: it did, and more lines may wait. */
int pump_rest(struct pump *pump);
/* Reads what the client sent. */
void pump_read(struct pump *pump, struct session *s, int index);
/* The same; then carries out its lines. */
void pump_read_commands(struct pump *pump, struct session *s, int index);

/* pump_protocol.c: a session of a protocol that is not native. It has everything before the tick at its cursor. */
/* Returns 0 or a negative SH_E. */
int session_open_protocol(struct pump *pump, struct session *s);
void session_close_protocol(struct pump *pump, struct session *s);
/* Closes it and opens it again at the cursor. */
int session_restart_protocol(struct pump *pump, struct session *s);
/* As session_write. */
int session_write_protocol(struct pump *pump, struct session *s, int index);
/* Whether something is still due to a client that sends nothing more. */
int session_owes_protocol(const struct pump *pump, const struct session *s);
/* The first tick from the cursor on that must wake the protocol although it has no frames. */
uint64_t session_wake_tick(const struct pump *pump, const struct session *s);

#endif
