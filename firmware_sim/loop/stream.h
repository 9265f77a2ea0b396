/* The stream: what casters, the pacing thread and readers share while the loop runs.
 *
 * In: ticks that casters filled (ring.h). Out: the native frames of each released tick, numbered, for every
 * reader at its own speed. Readers are the sessions of links (pump.h) and the hash of the stream (hash.c).
 *
 * The stream holds the ring, how far each reader is, the number of the next frame, what is counted at
 * release, the time that a peer granted (pace step), and all wake-ups. It knows nothing of casting, of links
 * or of commands.
 *
 * Units: ticks from power-up, device time in ns. */
#ifndef FIRMWARE_SIM_LOOP_STREAM_H
#define FIRMWARE_SIM_LOOP_STREAM_H

#include <semaphore.h>

#include "drivers/link/link.h"
#include "firmware_sim/device/device.h"
#include "firmware_sim/loop/kept.h"
#include "firmware_sim/loop/ring.h"

enum {
    STREAM_MAX_LINKS = CONFIG_MAX_LINKS + 1,
    STREAM_HASH_READER = STREAM_MAX_LINKS * LINK_MAX_SESSIONS, /* below it: sessions */
    STREAM_MAX_LISTENERS = STREAM_MAX_LINKS + 1,
    STREAM_SCANS = 8
};
_Static_assert((int)STREAM_HASH_READER < (int)RING_MAX_READERS, "each session is a reader, and so is the hash");

/* A reader as the pacing thread sees it, in the paces that wait for readers. */
struct stream_reader {
    _Atomic int active;
    _Atomic uint64_t cursor; /* next tick it will read */
};

/* An eventfd that is written to when something was released: a tick with frames, and any tick from wake_tick on. */
struct stream_listener {
    int fd;
    _Atomic uint64_t wake_tick; /* UINT64_MAX: frames are all it wants */
};

struct stream {
    struct ring ring;
    struct kept kept; /* what a client that joins needs first */
    int64_t tick_ns;
    uint32_t tick_bytes; /* no tick is longer */
    int waits;           /* paces fast and step: release waits for casters and readers, and nothing is lost */
    struct device_counters *counters;
    struct stream_reader reader[RING_MAX_READERS];

    /* of the pacing thread alone until the stream is over */
    uint32_t seq;          /* of the next frame */
    struct ring_hits line; /* of the line so far */
    int line_broken;       /* a tick was lost since the last line end */
    struct stream_scan {
        uint32_t number;
        uint64_t delivered; /* pulses */
    } scan[STREAM_SCANS];   /* the last ones, at number % STREAM_SCANS: an end may be said when the next one is on */
    _Atomic int64_t first_pulse_ns, last_pulse_ns; /* when released; 0: not yet */

    _Atomic uint64_t granted;    /* step: ticks that may pass */
    _Atomic uint64_t granted_ns; /* step: the sum of all grants */
    _Atomic int ending;          /* the run is to end: readers that stand still are not waited for any longer */
    _Atomic int over;            /* nothing will be released any more */

    sem_t work;     /* a tick may be claimed */
    sem_t ready;    /* a tick is ready; only in the paces that wait */
    sem_t progress; /* a reader went on, or time was granted; likewise */
    uint32_t n_casters;
    struct stream_listener listener[STREAM_MAX_LISTENERS];
    uint32_t n_listeners;
};

/* A stream as long as `size`, in ticks of tick_ns. tick_bytes, waits, counters and n_casters are the caller's
 * to set, before any thread starts. */
int stream_create(struct stream *stream, const struct ring_size *size, int64_t tick_ns, struct sh_err *err);
void stream_free(struct stream *stream);

/* ---- the pacing thread; real-time safe */
/* Completes the slot's line ends and the counts of its telemetry and of a scan's end, numbers its frames, counts
 * it, publishes it and wakes readers and casters. */
void stream_release(struct stream *stream, struct ring_slot *slot, uint64_t tick, int64_t now_ns);
/* Gives a tick up. 0 when it became ready in the same moment. */
int stream_lose(struct stream *stream, uint64_t tick);
/* True when every active reader has gone on so far that this tick may be released. */
int stream_has_room(const struct stream *stream, uint64_t tick);
/* Waits until a reader went on. Once the run is to end, readers that stand still for 2 s hold back nothing
 * any more. */
void stream_wait_for_readers(struct stream *stream, uint64_t tick);
/* Nothing more will be released. */
void stream_end(struct stream *stream);

/* ---- readers */
/* An eventfd to be written to at each release of frames. Returns its listener. Before the pacing thread starts. */
struct stream_listener *stream_listen(struct stream *stream, int fd);
/* From this tick on it is written to at every tick's release, until it is told otherwise. Returns 1 when that tick was
 * released already: nobody may have written. */
int stream_wake_at(struct stream *stream, struct stream_listener *listener, uint64_t tick);
/* A reader begins (active) or ends, and has read everything before a tick. */
void stream_set_reader(struct stream *stream, int reader, uint64_t cursor, int active);
/* It has read everything before a tick. */
void stream_move_reader(struct stream *stream, int reader, uint64_t cursor);
uint64_t stream_released(const struct stream *stream);
/* A peer grants time. Returns the sum of all grants, ns. */
uint64_t stream_grant(struct stream *stream, uint64_t ns);
/* Lets device time pass up to that sum. Returns the tick before which all may pass. */
uint64_t stream_pass(struct stream *stream, uint64_t total_ns);
/* Something happened that casters or the pacing thread may wait for: a command, a grant, the end. Any
 * thread. */
void stream_poke(struct stream *stream);

#endif
