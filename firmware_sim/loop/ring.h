/* The slots between casters, the pacing thread and the readers: one per tick, each with the tick's frames as bytes.
 *
 * A tick's slot is claimed by one caster, filled, marked ready, and released by the pacing thread when its time has
 * come; a tick that isn't ready in time is marked lost instead. Readers copy released ticks out at their own speed, as
 * long as a tick is among the last queue_ticks released; what is older is lost to them. Nobody waits for a reader here
 * (the loop does, in the paces fast and step). The slots outnumber the ticks in play twice over, and a reader in the
 * middle of a copy says so (hazard), so that a slot is never written while it is read.
 *
 * Threads: claims are serialised by the caller; ready by the claiming caster; release and lose by the pacing thread
 * alone; read by any number of readers, each with its own hazard number. Lock-free, except that claim may yield to a
 * reader. */
#ifndef FIRMWARE_SIM_LOOP_RING_H
#define FIRMWARE_SIM_LOOP_RING_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "core/line.h"

/* Marks: 10,000 lines a second in ticks of 10 ms, and device_tick_lines' two more, fit. */
enum { RING_MAX_READERS = 72, RING_MAX_MARKS = 104 };

/* What pulses hit: echoes, and what is none (struct cast_counters). */
struct ring_hits {
    uint32_t echoes, crowded, faint, unfit;
};
void ring_hits_add(struct ring_hits *sum, const struct ring_hits *more);

/* A line-end frame that lacks its counts of echoes until the tick is released: blocks before it may come from
 * elsewhere. */
struct ring_mark {
    uint32_t frame_at;       /* offset of the frame in bytes */
    struct ring_hits before; /* of this slot since the mark before */
    int64_t scan_t0_ns;
    struct line_end end;
};

struct ring_slot {
    _Atomic uint64_t state; /* tick << 2 | phase */
    _Atomic int busy;       /* a caster writes in it, be its tick lost or not */
    uint8_t *bytes;
    uint32_t len, n_frames;
    uint32_t first_seq; /* set at release */
    int wake;           /* readers are woken at release though it be empty */
    uint64_t n_fired, n_cast, n_echoes, n_lines, n_crowded, n_faint, n_unfit;
    struct ring_hits tail; /* after the last mark */
    uint32_t n_marks;
    struct ring_mark mark[RING_MAX_MARKS];
};

struct ring {
    struct ring_slot *slot;
    uint64_t n_slots, queue_ticks;
    uint32_t slot_bytes;
    _Atomic uint64_t released;                 /* ticks released or lost so far */
    _Atomic uint64_t hazard[RING_MAX_READERS]; /* tick + 1 being read; 0: none */
};

int ring_create(struct ring *ring, uint64_t ahead_ticks, uint64_t queue_ticks, uint32_t slot_bytes, struct sh_err *err);
void ring_free(struct ring *ring);

/* The slot for `tick`, empty; or NULL when the tick is lost already. */
struct ring_slot *ring_claim(struct ring *ring, uint64_t tick);
/* The slot is filled, or given up by its caster. 0 when the tick was lost meanwhile. */
int ring_ready(struct ring *ring, struct ring_slot *slot, uint64_t tick);
/* Its caster lets the slot go without making it ready: the pacing thread will lose the tick when its time is over. */
void ring_drop(struct ring_slot *slot);

/* The slot of the next tick to release when it is ready, else NULL. */
struct ring_slot *ring_peek(struct ring *ring, uint64_t tick);
/* Publishes the tick that ring_peek gave. */
void ring_release(struct ring *ring, uint64_t tick);
/* Gives the next tick up, and publishes that. 0 when it became ready in the same moment: then release it. */
int ring_lose(struct ring *ring, uint64_t tick);

enum ring_read { RING_READ, RING_NONE, RING_LOST };
/* Copies the frames of `tick` to buf. RING_READ: *len bytes and *n_frames frames, first_seq is the first one's number
 * (0 bytes where the tick had none); RING_NONE: not released yet; RING_LOST: too old, or lost by the head itself.
 * RING_READ with *len > cap means that it did not fit and was not copied. */
enum ring_read ring_read(struct ring *ring, int reader, uint64_t tick, uint8_t *buf, uint32_t cap, uint32_t *len,
                         uint32_t *n_frames, uint32_t *first_seq);

#endif
