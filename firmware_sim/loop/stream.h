/* SPDX-License-Identifier: MIT */
/* The stream, which casters, the pacing thread and readers share while the loop runs.
 *
 * In: ticks that casters filled (ring.h). Out: the native frames of each released tick, numbered, for every
 * reader at its own speed. Readers are the sessions of links (pump.h) and the hash of the stream (hash.c).
 *
 * The stream holds the ring, how far each reader is, the number of the next frame, the counts that are made at
 * release, the time that a peer granted (pace step), and all wake-ups. The stream knows nothing of casting, of links
 * or of commands.
 *
 * Wake-ups. In real time a link is woken at each tick that it wants, or once in `every` ticks. Casters are woken once a
 * quarter of the ticks ahead is free, and the hash once an eighth of the queue was released. The work of these threads
 * is not needed at once. The pacing thread sleeps up to the next tick that wakes a link, the casters or the hash. In
 * the paces that wait for readers, nobody waits for a single tick. So wake-ups are saved up, and ticks pass from thread
 * to thread in batches. One rule prevents a deadlock: a thread that is about to sleep first wakes all threads that can
 * go on by its work. Casters announce the ticks that they made, the pacing thread those that it released, readers how
 * far they are. So when all threads sleep, each has seen all work of the others, and there is nothing to do. Batches
 * change when a tick is read, never its bytes.
 *
 * Units: ticks from power-up, device time in ns. */
#ifndef FIRMWARE_SIM_LOOP_STREAM_H
#define FIRMWARE_SIM_LOOP_STREAM_H

#include "drivers/link/link.h"
#include "firmware_sim/config/limits.h"
#include "firmware_sim/device/device.h"
#include "firmware_sim/loop/wakeup.h"
#include "firmware_sim/loop/latched.h"
#include "firmware_sim/loop/ring.h"

enum {
    STREAM_MAX_LINKS = CONFIG_MAX_LINKS + 1,
    STREAM_HASH_READER = STREAM_MAX_LINKS * LINK_MAX_SESSIONS, /* below it: sessions */
    STREAM_MAX_LISTENERS = STREAM_MAX_LINKS + 1,
    STREAM_SCANS = 8,
    STREAM_POWER_TICKS = 64,
    STREAM_FILES_NS = 5000000 /* between two looks at the buffers of files (files_fill) */
};
_Static_assert((int)STREAM_HASH_READER < (int)RING_MAX_READERS, "each session is a reader, and so is the hash");

/* A reader as the pacing thread sees it, in the paces that wait for readers. */
struct stream_reader {
    _Atomic int active;
    _Atomic uint64_t cursor;  /* next tick it will read */
    _Atomic uint64_t written; /* its link has taken all bytes before this tick */
};

/* An eventfd that is written to when a tick with frames was released, or any tick from wake_tick on. */
struct stream_listener {
    int fd;
    _Atomic int wants_frames;
    _Atomic uint64_t wake_tick; /* UINT64_MAX: none */
    _Atomic int wants_written;  /* step: a reply waits until other readers have written what was granted */
    /* of the pacing thread alone */
    uint64_t every, quiet_until; /* least ticks between two writes; the first tick at which the next write may come */
    int pending;                 /* a tick that it wants was released since the last write */
};

struct stream {
    struct ring ring;
    struct latched latched; /* the frames that a client needs first when it joins */
    int64_t tick_ns;
    uint32_t tick_bytes; /* no tick is longer */
    int waits;           /* paces fast and step: release waits for casters and readers, and nothing is lost */
    int as_they_are;     /* frames are recorded: numbered already, and complete */
    int steps;           /* pace step: clients let time pass, also while the head has no power */
    uint32_t first_seq;  /* number of its first frame; an injected fault can put it just below the wrap at 2^32 */
    struct device_counters *counters;
    struct stream_reader reader[RING_MAX_READERS];

    /* of the pacing thread alone until the stream is over */
    uint32_t seq;          /* of the next frame */
    struct ring_hits line; /* of the line so far */
    int line_broken;       /* a tick was lost since the last line end */
    struct stream_scan {
        uint32_t number;
        uint64_t delivered; /* pulses */
    } scan[STREAM_SCANS];   /* the last ones, at number % STREAM_SCANS: an end may be reported during the next scan */
    _Atomic int64_t first_pulse_ns, last_pulse_ns; /* when released; 0: not yet */

    /* A power cycle on request (device_work.power): ticks with which power goes and comes, in turn. Number i is at i %
     * STREAM_POWER_TICKS. */
    _Atomic uint64_t power_tick[STREAM_POWER_TICKS];
    _Atomic uint32_t n_power;
    /* of the pacing thread alone */
    uint32_t power_passed; /* how many of these were released */
    int wakes_all;         /* power changed since the last wake-up: links without clients are woken, too */

    _Atomic uint64_t granted;    /* step: ticks that may pass */
    _Atomic uint64_t granted_ns; /* step: the sum of all grants */
    _Atomic int ending;          /* the run is to end: nobody waits any longer for readers that stand still */
    _Atomic int over;            /* nothing will be released any more */

    struct wakeup work;       /* for casters: a tick may be claimed */
    struct wakeup pace;       /* for the pacing thread: a tick it waits for is ready, or a reader went on */
    _Atomic uint64_t awaited; /* real time: the pacing thread waits for this late tick; UINT64_MAX: for none */
    _Atomic uint64_t wanted; /* the pacing thread sleeps until a reader has come to this tick; UINT64_MAX: it doesn't */
    /* of the pacing thread alone */
    uint64_t held_tick;    /* the tick that readers held back last, once the run is to end; 0: none */
    int64_t held_until_ns; /* clock: from then on readers no longer hold it back */
    uint64_t unsaid;       /* ticks released since casters were woken; in the paces that wait, since any thread was */
    uint64_t say_ticks;    /* casters are woken after so many */
    uint64_t lazy_ticks;   /* an eighth of the queue */
    uint32_t n_casters;
    struct stream_listener listener[STREAM_MAX_LISTENERS];
    uint32_t n_listeners;
};

/* Makes a stream as long as `size`, in ticks of tick_ns. The caller sets `waits` before the call, and tick_bytes,
 * counters and n_casters before any thread starts. */
int stream_create(struct stream *stream, const struct ring_size *size, int64_t tick_ns, struct sh_err *err);
void stream_free(struct stream *stream);

/* ---- the pacing thread; real-time safe */
/* Completes the slot's line ends and the counts of its telemetry and of a scan's end, numbers its frames, counts
 * it, publishes it, and wakes readers and casters when it is time to. */
void stream_release(struct stream *stream, struct ring_slot *slot, uint64_t tick, int64_t now_ns);
/* Gives a tick up. 0 when it became ready in the same moment. */
int stream_lose(struct stream *stream, uint64_t tick);
/* Real time: returns the last tick that may be released together with `tick`, once that last one is due. No link waits
 * longer than it accepts. */
uint64_t stream_next_wake(const struct stream *stream, uint64_t tick);
/* Real time: waits until a tick that is late is ready, up to a time at most. May return before. */
void stream_await(struct stream *stream, uint64_t tick, int64_t until_ns);
/* True when every active reader has gone on so far that this tick may be released. */
int stream_has_room(const struct stream *stream, uint64_t tick);
/* Waits until a tick may be ready. */
void stream_wait_for_casters(struct stream *stream);
/* Waits until a reader went on. Once the run is to end, readers that stand still for 2 s hold back nothing
 * any more. */
void stream_wait_for_readers(struct stream *stream, uint64_t tick);
/* Waits STREAM_FILES_NS for the source's files (files_fill). A disk wakes nobody, so the caller looks again. */
void stream_wait_for_files(struct stream *stream);
/* Nothing more will be released. */
void stream_end(struct stream *stream);

/* ---- readers */
/* Adds an eventfd that is written to when frames were released, in real time at most once in `every` ticks; and at the
 * end. Returns its listener. Before the pacing thread starts. */
struct stream_listener *stream_listen(struct stream *stream, int fd, uint64_t every);
/* Sets what wakes a listener from now on: frames, where `frames` is 1, and the release of each tick from `tick` on.
 * Returns 1 when the listener must look for itself once: that tick was released already, or frames did not wake it
 * before. */
int stream_wake_at(struct stream *stream, struct stream_listener *listener, int frames, uint64_t tick);
/* A reader begins (active) or ends, and has read everything before a tick. */
void stream_set_reader(struct stream *stream, int reader, uint64_t cursor, int active);
/* A reader has read everything before a tick, and goes on. */
void stream_move_reader(struct stream *stream, int reader, uint64_t cursor);
/* A reader's link has taken all bytes before a tick. Wakes listeners that wait for that (stream_has_written). */
void stream_note_written(struct stream *stream, int reader, uint64_t cursor);
/* Pace step: whether all active readers but `reader` have written everything before a tick. If not, the listener is
 * woken once one of them has written what was granted; then the listener asks again. The hash does not count. */
int stream_has_written(struct stream *stream, struct stream_listener *listener, int reader, uint64_t tick);
/* A reader is about to sleep: what it read may let the pacing thread go on. */
void stream_rest_reader(struct stream *stream);
/* ---- casters */
/* Waits until a tick may be claimed. */
void stream_wait_for_work(struct stream *stream);
/* Power goes, or comes, with this tick, which is being claimed. */
void stream_power(struct stream *stream, uint64_t tick);
/* Some ticks are ready: the pacing thread looks again. Not needed in real time. */
void stream_say_ready(struct stream *stream);
/* Real time: this tick is ready. Wakes the pacing thread if it waits for this tick because it is late. */
void stream_say_late(struct stream *stream, uint64_t tick);

/* ---- any thread */
uint64_t stream_released(const struct stream *stream);
/* Returns the first tick from `cursor` on with which power goes; UINT64_MAX: none so far. */
uint64_t stream_off_tick(const struct stream *stream, uint64_t cursor);
/* The same for power that comes. */
uint64_t stream_on_tick(const struct stream *stream, uint64_t cursor);
/* Returns the tick of change number i of power, from 0; UINT64_MAX: there is none so far. */
uint64_t stream_power_tick(const struct stream *stream, uint32_t i);
/* A peer grants time. Returns the sum of all grants, ns. */
uint64_t stream_grant(struct stream *stream, uint64_t ns);
/* Lets device time pass up to a sum of grants, if it may not pass farther already. Returns the first tick that this sum
 * does not let pass. */
uint64_t stream_pass(struct stream *stream, uint64_t total_ns);
/* Something happened that casters or the pacing thread may wait for: a command, a grant, the end. Any
 * thread. */
void stream_poke(struct stream *stream);

#endif
