/* SPDX-License-Identifier: MIT */
/* Private to pump*.c, session.c and lost_frames.c: a link with its sessions. */
#ifndef FIRMWARE_SIM_LOOP_PUMP_INSIDE_H
#define FIRMWARE_SIM_LOOP_PUMP_INSIDE_H

#include <pthread.h>

#include "firmware_sim/fault/faulty_link.h"
#include "firmware_sim/loop/pump.h"
#include "firmware_sim/loop/unit_queue.h"

enum {
    REPLY_ROOM = 8192,
    BATCH_BYTES = 131072, /* small ticks are written together up to this */
    QUEUE_UNITS = 16,     /* a session has room for so many of a protocol's longest units */
    READ_BYTES = 65536,
    WRONG_AT_ONCE = 128, /* after this many wrong lines of a session its link rests */
    REST_NS = 2000000,   /* for this long */
    MAX_TOLD = 64,
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
    int left;            /* session_closed was called: control is given back, an incomplete line is reported */
    uint32_t id;         /* from 1, over all links */
    int reader;          /* of the stream */
    uint64_t cursor;     /* next tick to take */
    uint64_t power_from; /* only a power cycle at this tick or later ends it */
    uint64_t came_at;    /* ticks before it only prepare the protocol, and don't count as received (look_back) */
    struct {
        int have_seq; /* next_seq and next_pulse are known */
        uint32_t next_seq;
        uint64_t next_pulse; /* pulses delivered before the frame of that number */
        uint64_t frames;
        int lagging; /* a loss was reported to the error queue; 0 again once the reader has caught up */
    } lost;          /* lost_frames.c */
    uint8_t *out;
    uint32_t out_len, out_pos;       /* bytes from out_pos on are not written yet */
    uint32_t frames_from, frames_to; /* the part of `out` with frames; replies are before and after it */
    struct session_commands commands;
    /* of a protocol that is not native */
    struct pump *pump;
    void *protocol; /* NULL while is_off */
    int is_off;     /* the head has no power: ticks pass, and nothing is sent or heard */
    struct unit_queue units;
    int answering; /* input() is being called */
    int hang_up;   /* the session ends once its units are out */
    char peer[64];
    int64_t moved_ns; /* clock_now_ns() when it began, a byte last went out or, at the end, was taken by the reader */
    int unread;       /* at the end: bytes that wait in the system for the reader */
};

struct pump {
    struct link_counts counts; /* of all its sessions so far */
    struct links *links;
    struct stream *stream;
    const struct link_ops *ops;
    struct faulty_link *link;
    const struct protocol_ops *protocol;
    int dialect;             /* of the protocol */
    _Atomic uint32_t shared; /* by its sessions: protocol_spec.shared */
    uint8_t *tick;           /* frames of the tick at hand, for a protocol; NULL: it is native */
    int wake_fd;
    struct stream_listener *listener;
    uint32_t index;                  /* of the link, from 0 */
    uint32_t n_told, told[MAX_TOLD]; /* checksums of the lines that the user got from a protocol */
    uint32_t out_cap;                /* of each session */
    int holds;                       /* its readers hold back the paces fast and step */
    int is_own;                      /* its reader is a part of this program */
    int is_clean;                    /* its readers see nothing of faults, power cycles included */
    int can_unplug;                  /* its endpoint goes when power goes */
    uint32_t power_seen;             /* changes of power that were done here */
    int is_off;                      /* the head has no power */
    struct session session[LINK_MAX_SESSIONS];
    struct link_memory *client; /* in memory: its thread does this link's work; NULL: the link has a thread */
    pthread_t thread;
    int running;         /* it has begun, and has not been joined */
    int is_done;         /* it has ended */
    uint32_t want_write; /* a bit for each session whose link took no more */
    int at_once;         /* there is something to do without waiting for events */
    int64_t over_ns;     /* clock: when it was first seen that the run is over; 0: it is not */
    int failed;          /* a write failed; the reason is still to come */
};

/* pump.c: warns the user, with the link's name. */
void pump_say(void *pump, const char *text);

/* session.c */
void session_open(struct pump *pump, struct session *s, const char *peer);
void session_close(struct pump *pump, struct session *s);
/* The session's client sends nothing more. The client still gets answers to what it sent, and the stream. */
void session_shut(struct pump *pump, struct session *s);
/* As session_close, but when power goes. Neither the protocol is told that the client went, nor does the session give
 * back its control: the device does that itself. */
void session_cut(struct pump *pump, struct session *s);
/* Returns the first tick that the session does not take until pump_power has done what is due: power goes with it, or
 * comes where is_off. UINT64_MAX: none. */
uint64_t session_power_tick(const struct pump *pump, const struct session *s);
/* For sessions that outlast a loss of power, such as that of a file: power goes with a tick, and comes with one. A
 * protocol that is not native ends with power, and begins anew when power comes. */
void session_power_off(struct pump *pump, struct session *s, uint64_t tick);
void session_power_on(struct pump *pump, struct session *s, uint64_t tick);
/* Takes released ticks and replies, and writes until the link is full (1) or nothing is left (0). index: of the session
 * on its link. */
int session_write(struct pump *pump, struct session *s, int index);
/* Whether a session whose bytes are all written is over. A session is over when its protocol ends it, or when its
 * client sends nothing more and nothing is due to it. */
int session_is_done(const struct pump *pump, const struct session *s);

/* Lets the link know that all before the session's cursor was written, so that it passes on what is due. is_last:
 * nothing follows, as at a power cycle. Returns what faulty_pass returns. */
int session_pass(struct pump *pump, struct session *s, int is_last);
/* Whether bytes that were written wait in the link. */
int session_waits(const struct pump *pump, const struct session *s);
/* In the paces that wait, sessions with faults take no frames while files of the source are behind (files_fill). Their
 * clients still get their replies. */
int session_waits_for_files(const struct pump *pump);
/* Returns the number of the session on its link. */
static inline int session_index(const struct pump *pump, const struct session *s)
{
    return (int)(s - pump->session);
}

/* pump_power.c: the links of a head that loses power, and has it again. */
/* Does what is due. full: a bit for each session whose link takes no more. 1: there is more to do at once. */
int pump_power(struct pump *pump, uint32_t full);

/* lost_frames.c: the one place that counts what a reader got and what it lost. */
/* Learns the number of the next frame from the tick before the cursor, if the ring still has it. So a loss shows even
 * if it is that of the session's first frames. */
void session_know_next(struct pump *pump, struct session *s);
/* Moves the cursor on, since the ring no longer has its tick. The cursor goes to the oldest tick of the queue if no
 * frame is lost before that, else to the middle of the queue, so that the reader has time to recover. The cursor does
 * not go beyond power_tick. */
void session_catch_up(struct pump *pump, struct session *s, uint64_t released, uint64_t power_tick);
/* Compares the number of a tick's first frame with the expected one, and counts a gap. A native reader gets an event
 * frame before the tick's frames. The tick's frames lie at the end of the session's buffer, with REPLY_ROOM / 8 bytes
 * free after them. `released`: ticks released when the tick was read. Returns how many frames are missing. */
uint32_t session_check_lost(struct pump *pump, struct session *s, const struct ring_copy *tick, uint64_t released);
/* Counts n units of a protocol as lost. */
void session_count_units(struct pump *pump, struct session *s, uint64_t n);
/* The client went away. Bytes that were not written to it count neither as received nor as lost. */
void session_gone(struct pump *pump, struct session *s);
/* At the end of the run: counts what the reader did not get as lost. */
void session_leave(struct pump *pump, struct session *s);

/* pump_commands.c */
/* Adds a reply line after those that wait already; counts it as dropped where there is no room. */
void pump_add_reply(struct session *s, const char *text);
/* Adds the reply to SITE:POSE, once it is there. */
void pump_end_move(struct pump *pump, struct session *s);
/* Carries out the lines that were read. Each one is carried out and answered after the one before. Lines wait
 * while a step or a move goes on, and while there is no room for their replies. Replies are lost only to a client that
 * sends on and on without reading. */
void pump_take_lines(struct pump *pump, struct session *s);
/* A client that floods the link with wrong lines would cost a processor. So a link rests when one of its sessions had
 * WRONG_AT_ONCE of them, or when its input has no room. 1: the link rested, and more lines may wait. */
int pump_rest(struct pump *pump);
/* Reads what the client sent. */
void pump_read(struct pump *pump, struct session *s, int index);
/* The same; then carries out its lines. */
void pump_read_commands(struct pump *pump, struct session *s, int index);

/* pump_protocol.c: a session of a protocol that is not native. The session has everything before the tick at its
 * cursor. */
/* Returns 0 or a negative SH_E. */
int session_open_protocol(struct pump *pump, struct session *s, struct sh_err *err);
void session_close_protocol(struct pump *pump, struct session *s);
/* Opens a session that was closed when power went, again at the cursor. Returns as session_open_protocol. */
int session_reopen_protocol(struct pump *pump, struct session *s);
/* As session_write. */
int session_write_protocol(struct pump *pump, struct session *s, int index);
/* Reads bytes of a client, for the protocol. */
void session_read_protocol(struct pump *pump, struct session *s, int index);
/* Whether something is still due to a client that sends nothing more. */
int session_owes_protocol(const struct pump *pump, const struct session *s);
/* Returns the first tick from the cursor on that must wake the protocol although it has no frames. */
uint64_t session_wake_tick(const struct pump *pump, const struct session *s);

#endif
