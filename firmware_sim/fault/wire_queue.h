/* SPDX-License-Identifier: MIT */
/* What a session will write, in order: pieces with the time before which they must not go out, and acts and pauses in
 * between; and beside the queue the pieces that are held back, until frames have overtaken them or their time has come.
 *
 * A piece of text, of frames or of a unit is one write. Thread: one. Allocates as it grows. Times are of the owner's
 * clock, ns, but for t_ns, which is device time. */
#ifndef FIRMWARE_SIM_FAULT_WIRE_QUEUE_H
#define FIRMWARE_SIM_FAULT_WIRE_QUEUE_H

#include <stddef.h>
#include <stdint.h>

enum wire_piece_kind { WIRE_TEXT, WIRE_FRAMES, WIRE_UNIT, WIRE_ACT, WIRE_PAUSE };

struct wire_piece {
    struct wire_piece *next;
    enum wire_piece_kind kind;
    int64_t not_before_ns; /* held by its time: until then */
    int alone;             /* nothing goes into its write, and it into no other's */
    int open;              /* frames after it still go into its write: it waits for them */
    uint32_t act;          /* of WIRE_ACT: enum fault_kind; n and for_ms go with it */
    uint32_t n;
    double for_ms; /* of WIRE_PAUSE: how long, from when it is the first */
    int started;   /* it is, and not_before_ns says until when */
    int of;        /* held: until the frame of this number in this counting has come; number 0: by its time */
    uint64_t after;
    int64_t t_ns; /* device time of the frame */
    /* What is written once all of it is: */
    uint32_t frames;
    uint64_t pulses;
    size_t len, room, out;
    uint8_t *bytes;
};

struct wire_queue {
    struct wire_piece *first, *last;
    struct wire_piece *held; /* in the order in which they came */
    size_t n_bytes; /* of memory for what waits; without what is held until frames have come, which comes by itself */
};

/* A new piece with a copy of the bytes; NULL: no memory. */
struct wire_piece *wire_piece_new(enum wire_piece_kind kind, const void *bytes, size_t len);
void wire_piece_free(struct wire_piece *piece);
/* Puts it at the end, or into the last one's write, if that is open; takes it over. 0, or SH_ENOMEM: it is gone. */
int wire_queue_put(struct wire_queue *queue, struct wire_piece *piece);
/* Keeps it back; takes it over. */
void wire_queue_hold(struct wire_queue *queue, struct wire_piece *piece);
/* The last one no longer waits for more frames. */
void wire_queue_close(struct wire_queue *queue);
/* The frame of that number has come: those held until then go to the end, and those whose frame is from before t_ns. */
int wire_queue_pass(struct wire_queue *queue, int of, uint64_t number, int64_t t_ns);
/* Those whose time has come go to the end. */
int wire_queue_let_go(struct wire_queue *queue, int64_t now_ns);
/* The first piece if it may go out now; NULL: none may. Pauses that are over are taken out. */
struct wire_piece *wire_queue_due(struct wire_queue *queue, int64_t now_ns);
/* When the next one may; INT64_MAX: there is none that only time keeps back. */
int64_t wire_queue_next_ns(const struct wire_queue *queue);
/* The first one is done with. */
void wire_queue_pop(struct wire_queue *queue);
/* Adds up what is written once the whole queue is. */
void wire_queue_count(const struct wire_queue *queue, uint64_t *frames, uint64_t *pulses);
void wire_queue_clear(struct wire_queue *queue);

#endif
