/* SPDX-License-Identifier: MIT */
/* The queue of what a session will write, in order: pieces with the time before which they must not go out, with acts
 * and pauses between them. Beside the queue are pieces that are held back, until frames have overtaken them or their
 * time has come.
 *
 * A piece of a reply, or of frames or units, is one write. Thread: one. Allocates as it grows. Times are of the owner's
 * clock, ns; only t_ns is device time. */
#ifndef FIRMWARE_SIM_FAULT_WIRE_QUEUE_H
#define FIRMWARE_SIM_FAULT_WIRE_QUEUE_H

#include <stddef.h>
#include <stdint.h>

enum wire_piece_kind { WIRE_REPLY, WIRE_FRAMES, WIRE_ACT, WIRE_PAUSE };

struct wire_piece {
    struct wire_piece *next;
    enum wire_piece_kind kind;
    int64_t not_before_ns; /* it must not go out before */
    int alone;             /* its write has no other piece */
    int open;              /* it waits for frames that go into its write */
    uint32_t act;          /* of WIRE_ACT: enum fault_kind; n and for_ms go with it */
    uint32_t n;
    double for_ms;  /* of WIRE_PAUSE: its length, from when it is the first */
    int started;    /* of WIRE_PAUSE: it has begun, and lasts until not_before_ns */
    int of;         /* enum fault_of: the counting in which `after` is a number */
    uint64_t after; /* held until that frame has come; 0: held until not_before_ns */
    int64_t t_ns;   /* device time of the frame */
    /* counted as written once the whole piece is: */
    uint32_t frames;
    uint64_t pulses;
    size_t len, room, out;
    uint8_t *bytes;
};

struct wire_queue {
    struct wire_piece *first, *last;
    struct wire_piece *held; /* in the order in which they came */
    size_t n_bytes;          /* memory of the pieces that wait, without those that are held until frames have come */
};

/* Returns a new piece with a copy of the bytes; NULL: no memory. */
struct wire_piece *wire_piece_new(enum wire_piece_kind kind, const void *bytes, size_t len);
void wire_piece_free(struct wire_piece *piece);
/* Puts a piece at the end, or into the last one's write if that is open and of the same kind, and the piece is not
 * alone; takes it over. SH_ENOMEM: it is lost. */
int wire_queue_put(struct wire_queue *queue, struct wire_piece *piece);
/* Holds a piece back; takes it over. */
void wire_queue_hold(struct wire_queue *queue, struct wire_piece *piece);
/* The last piece no longer waits for more frames. */
void wire_queue_close(struct wire_queue *queue);
/* A frame has come, with its number in the counting `of`. Pieces that were held for this frame or an earlier one go to
 * the end, and so do held pieces of frames from before t_ns (device time). */
int wire_queue_pass(struct wire_queue *queue, int of, uint64_t number, int64_t t_ns);
/* Held pieces whose time has come go to the end. */
int wire_queue_let_go(struct wire_queue *queue, int64_t now_ns);
/* Returns the first piece if it may go out now; NULL: none may. Pauses that are over are taken out. */
struct wire_piece *wire_queue_due(struct wire_queue *queue, int64_t now_ns);
/* Returns when the next piece may go out; INT64_MAX: there is none that waits for a time. */
int64_t wire_queue_next_ns(const struct wire_queue *queue);
/* Removes the first piece. */
void wire_queue_pop(struct wire_queue *queue);
/* Adds the frames and pulses in the queue to *frames and *pulses. */
void wire_queue_count(const struct wire_queue *queue, uint64_t *frames, uint64_t *pulses);
void wire_queue_clear(struct wire_queue *queue);

#endif
