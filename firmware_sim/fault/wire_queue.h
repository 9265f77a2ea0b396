/* What a session will write, in order: pieces with the time before which they must not go out, and acts in between.
 *
 * A piece is text, frames or one unit. Pieces of frames or of text that follow each other go out in one write, where
 * nothing keeps them apart. Thread: one. Allocates as it grows. Times are of the owner's clock, ns. */
#ifndef FIRMWARE_SIM_FAULT_WIRE_QUEUE_H
#define FIRMWARE_SIM_FAULT_WIRE_QUEUE_H

#include <stddef.h>
#include <stdint.h>

enum wire_piece_kind { WIRE_TEXT, WIRE_FRAMES, WIRE_UNIT, WIRE_ACT };

struct wire_piece {
    struct wire_piece *next;
    enum wire_piece_kind kind;
    int64_t not_before_ns;
    double quiet_ms; /* once it is the first, it waits for so long */
    int alone;       /* goes out in a write of its own */
    uint32_t joins;  /* so many pieces after it still go out with it: it waits for them */
    uint32_t act;    /* of WIRE_ACT: enum fault_kind; n and for_ms go with it */
    uint32_t n;
    double for_ms;
    uint32_t behind; /* held: so many frames must still overtake it; 0: held by its time */
    size_t len, room, out;
    uint8_t bytes[];
};

struct wire_queue {
    struct wire_piece *first, *last;
    struct wire_piece *held; /* in the order in which they came */
    size_t n_bytes;          /* that wait, held ones included */
};

/* A new piece with a copy of the bytes, and room for so many more; NULL: no memory. */
struct wire_piece *wire_piece_new(enum wire_piece_kind kind, const void *bytes, size_t len, size_t more);
/* Puts it at the end; takes it over. */
void wire_queue_put(struct wire_queue *queue, struct wire_piece *piece);
/* Keeps it back, until `behind` frames have overtaken it or its time has come; takes it over. */
void wire_queue_hold(struct wire_queue *queue, struct wire_piece *piece);
/* A frame was put: held pieces that it was the last to overtake follow it. */
void wire_queue_overtake(struct wire_queue *queue);
/* Held pieces whose time has come go to the end; with `all` those too that wait for frames. */
void wire_queue_let_go(struct wire_queue *queue, int64_t now_ns, int all);
/* The first piece if it may go out now; NULL: none may. all: it waits for no others. */
struct wire_piece *wire_queue_due(struct wire_queue *queue, int64_t now_ns, int all);
/* When the next one may; INT64_MAX: there is none. */
int64_t wire_queue_next_ns(const struct wire_queue *queue);
/* The first one is done with. */
void wire_queue_pop(struct wire_queue *queue);
void wire_queue_clear(struct wire_queue *queue);

#endif
