/* Private to pump*.c: a link with its sessions. */
#ifndef FIRMWARE_SIM_LOOP_PUMP_INSIDE_H
#define FIRMWARE_SIM_LOOP_PUMP_INSIDE_H

#include "firmware_sim/loop/loop_inside.h"

enum {
    REPLY_ROOM = 8192,
    BATCH_BYTES = 131072, /* small ticks are written together up to this */
    READ_BYTES = 65536,
    DRAIN_NS = 2000000000, /* at the end a reader may take this long between two bytes */
};

struct session {
    int open, lagging;
    uint32_t id; /* from 1, over all links */
    int reader;
    uint64_t cursor;
    int have_seq;
    uint32_t next_seq;
    uint64_t lost_frames;
    struct command_lines lines;
    unsigned char in[READ_BYTES]; /* read, and from in_pos on not looked at yet */
    uint32_t in_len, in_pos;
    uint8_t *out;
    uint32_t out_len, out_pos;
    char reply[REPLY_ROOM];
    uint32_t reply_len;
    int replies_dropped;
    int stepping; /* the reply to TIME:STEP waits until all before this tick has gone out */
    uint64_t step_tick;
    char step_reply[COMMAND_MAX_REPLY];
    char peer[64];
    int64_t moved_ns; /* when a byte last went out */
};

struct pump {
    struct loop *loop;
    const struct link_ops *ops;
    void *link;
    int nmea; /* speaks for the GNSS receiver, not for the head */
    int wake_fd;
    uint32_t out_cap;
    struct session session[LINK_MAX_SESSIONS];
    pthread_t thread;
    int running;
    int failed; /* a write failed; why is still to be told */
};

/* Counts what a session lost; the error queue hears of it once per episode. */
void pump_count_lost(struct pump *pump, struct session *s, uint32_t n);

/* pump_commands.c */
/* A reply line, behind those that wait already. */
void pump_add_reply(struct session *s, const char *text);
/* What was read. Lines wait while a step goes on, and until earlier replies are on their way: each is carried out, and
 * answered, after the one before. Only who sends on and on without reading loses replies. */
void pump_take_lines(struct pump *pump, struct session *s);
/* Reads what the client sent, and takes its lines. */
void pump_read_commands(struct pump *pump, struct session *s, int index);

/* pump_nmea.c: a session of the GNSS receiver. Its cursor is the tick up to which it has everything. */
/* Sentences of what was released into the buffer; where the reader is too far behind, those of half a queue are lost.
 */
void pump_take_nmea(struct pump *pump, struct session *s);
/* Throws away what a client sends: a receiver that is asked in another maker's language. */
void pump_skip_nmea(struct pump *pump, int index);
/* Sentences that were released and not taken. */
uint32_t pump_nmea_backlog(const struct pump *pump, const struct session *s);

#endif
