/* SPDX-License-Identifier: MIT */
/* The ring of slots between casters, the pacing thread and readers: one slot per tick, with the tick's
 * frames.
 *
 * A caster claims the slot of a tick, writes the tick's frames in place, and marks it ready. The pacing thread
 * releases the tick when its time has come. A tick that is not ready in time is marked lost instead. Readers
 * look at released ticks, or copy them, at their own speed. A tick is there for them as long as it is among the
 * last queue_ticks released.
 *
 * Nobody waits for a slow reader here (stream.h does, in the paces fast and step). A reader announces the slot that it
 * copies or looks at (hazard). That slot is not claimed until the reader is done.
 *
 * Memory: each slot has room for a usual tick from the start, and more while its tick needs more. The caster
 * makes that room while the slot is its own, so that the pacing thread never allocates.
 *
 * Threads: any caster claims, and the callers make sure that they do so one at a time. From begin to ready the slot
 * belongs to the caster that claimed it. The pacing thread alone releases and loses. Any number of readers read, each
 * with its own hazard number. There are no locks. A claim may yield to a reader. */
#ifndef FIRMWARE_SIM_LOOP_RING_H
#define FIRMWARE_SIM_LOOP_RING_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include "core/err.h"
#include "core/line.h"

/* Readers: eight sessions of each of nine links, and the hash. Marks: 10,000 lines per second in ticks of 10 ms, the
 * two that device_tick_lines adds, and two to spare. */
enum { RING_MAX_READERS = 73, RING_MAX_MARKS = 104 };

/* The members count echoes, shots without echo, hits that gave none, and samples of waveforms without room (struct
 * cast_counters). */
struct ring_hits {
    uint32_t echoes, empty, crowded, faint, unfit, lost_samples;
};
void ring_hits_add(struct ring_hits *sum, const struct ring_hits *more);

/* A line-end frame. The frame's counts of echoes are known at release: blocks before it may come from other ticks. */
struct ring_mark {
    uint32_t frame_at;       /* offset of the frame in bytes */
    struct ring_hits before; /* of this tick since the mark before */
    int64_t scan_t0_ns;
    struct line_end end;
};

/* The frames and counts that a caster made of a tick. */
struct ring_tick {
    uint8_t *bytes; /* whole frames */
    uint32_t len;
    int broken; /* there was no memory for the frames, so their line has a gap */
    uint32_t n_marks;
    struct ring_mark *mark;
    uint32_t scan; /* number of the scan that its pulses are of */
    uint64_t n_fired, n_cast, n_lines;
    struct ring_hits hits; /* of the whole tick */
    struct ring_hits tail; /* after the last mark */
    int64_t shift_ns;      /* the run's device time minus that of the frames; only a recording's differ */
};

struct ring_slot {
    _Atomic uint64_t state;         /* tick << 2 | phase */
    _Atomic int busy;               /* a caster uses it, even if its tick is lost already */
    struct ring_tick tick;          /* its arrays lie in store, or in longer */
    uint32_t n_frames, first_seq;   /* set at release */
    uint64_t pulses_before;         /* set at release: delivered before this tick, since power-up */
    uint8_t *store;                 /* room for a usual tick */
    uint8_t *longer;                /* room for a tick that needs more, until the slot's next tick; else NULL */
    size_t store_room, longer_room; /* in bytes */
};

struct ring {
    struct ring_slot *slot;
    uint64_t n_slots, queue_ticks;
    _Atomic uint64_t released;                 /* ticks released or lost so far */
    _Atomic uint64_t hazard[RING_MAX_READERS]; /* tick + 1 being read; 0: none */
};

struct ring_size {
    uint64_t ahead_ticks; /* most ticks that are claimed and not released yet */
    uint64_t queue_ticks; /* released ticks that are still there for readers */
    uint64_t spare_ticks; /* time for an interrupted reader to finish its copy before a claim waits for it */
    uint32_t usual_bytes; /* of a usual tick */
};

int ring_create(struct ring *ring, const struct ring_size *size, struct sh_err *err);
void ring_free(struct ring *ring);

/* Returns the slot for `tick`, empty; or NULL when the tick is lost already. */
struct ring_slot *ring_claim(struct ring *ring, uint64_t tick);
/* Begins a claimed slot's tick, empty: its bytes are written to tick.bytes + tick.len, after ring_grow. */
void ring_begin(struct ring_slot *slot);
/* Makes room for tick.len + `more` bytes: *room counts those after tick.len. tick.bytes may move. A tick longer than
 * usual gets memory for itself alone. If slots kept that memory, all of them would in time be as large as the longest
 * tick. SH_ENOMEM: there is no memory; nothing has changed. */
int ring_grow(struct ring_slot *slot, size_t more, size_t *room);
/* Ends the tick: its marks, which lay anywhere, get their place in the slot. SH_ENOMEM: there is no memory; the slot
 * then holds no frame, and is marked broken. */
int ring_end(struct ring_slot *slot);
/* The tick is broken: its slot holds no frame. Returns SH_ENOMEM. */
int ring_break(struct ring_slot *slot);
/* Does all of this, from ring_begin to ring_end, with a copy of a tick that lies elsewhere. */
int ring_put(struct ring_slot *slot, const struct ring_tick *tick);
/* The caster is done with the slot. 0 when the tick was lost meanwhile. */
int ring_ready(struct ring_slot *slot, uint64_t tick);
/* The caster gives the slot up. The pacing thread loses the tick when its time is over. */
void ring_drop(struct ring_slot *slot);

/* Returns the slot of the next tick to release when it is ready, else NULL. */
struct ring_slot *ring_peek(struct ring *ring, uint64_t tick);
/* Publishes the tick that ring_peek gave. */
void ring_release(struct ring *ring, uint64_t tick);
/* Marks the next tick lost, and publishes that. 0: it became ready in the same moment, and is to be released. */
int ring_lose(struct ring *ring, uint64_t tick);

/* A reader's copy of a tick. */
struct ring_copy {
    uint8_t *buf;
    uint32_t cap;                      /* of buf; the reader sets both */
    uint32_t len, n_frames, first_seq; /* first_seq: number of the first frame; without frames, of the next one */
    uint64_t n_cast, pulses_before;    /* pulses in the frames, and those that were delivered before */
    int64_t shift_ns;                  /* as struct ring_tick has it */
};
enum ring_read { RING_READ, RING_NONE, RING_LOST };
/* Copies the frames of `tick`. RING_NONE: it is not released yet. RING_LOST: it is too old, or the head
 * itself lost it. RING_READ with len > cap: it did not fit, and nothing was copied. */
enum ring_read ring_read(struct ring *ring, int reader, uint64_t tick, struct ring_copy *copy);
/* The same without a copy, for readers that never wait: buf is the slot's own, until ring_leave. cap is not looked at.
 * ring_leave may follow any result. */
enum ring_read ring_look(struct ring *ring, int reader, uint64_t tick, struct ring_copy *copy);
void ring_leave(struct ring *ring, int reader);

#endif
