/* Private to loop*.c and pump.c. */
#ifndef FIRMWARE_SIM_LOOP_LOOP_INSIDE_H
#define FIRMWARE_SIM_LOOP_LOOP_INSIDE_H

#include <pthread.h>
#include <semaphore.h>

#include "firmware_sim/loop/loop.h"
#include "firmware_sim/loop/pose_feed.h"
#include "firmware_sim/loop/ring.h"
#include "firmware_sim/loop/work.h"

enum { LOOP_MAX_THREADS = 64, LOOP_MAX_LINKS = CONFIG_MAX_LINKS + 1, LOOP_HASH_READER = RING_MAX_READERS - 1 };
enum { LATE_BUCKETS = 64 * 8 };

struct loop;
struct loop_caster {
    struct loop *loop;
    struct worker *worker;
};

/* A reader of the ring as the pacing thread sees it (in the paces that wait for readers). */
struct loop_reader {
    _Atomic int active;
    _Atomic uint64_t cursor; /* next tick it will read */
};

struct pump;
struct hasher;

struct loop {
    const struct site *site;
    const struct config *cfg;
    struct device *device;
    struct loop_options options;
    struct device_counters *counters;
    struct ring ring;
    int64_t tick_ns;
    uint64_t ahead_ticks;
    uint32_t slot_bytes;

    uint32_t n_threads;
    pthread_t caster_thread[LOOP_MAX_THREADS];
    struct worker *worker[LOOP_MAX_THREADS];
    struct loop_caster caster_arg[LOOP_MAX_THREADS];
    uint32_t n_casters_running;
    pthread_mutex_t claim_lock;
    uint64_t next_tick;           /* under claim_lock */
    _Atomic uint32_t n_computing; /* claimed ticks, neither ready nor told lost yet */
    sem_t work;                   /* a tick may be claimed */
    sem_t ready;                  /* a tick is ready; only in the paces that wait */
    sem_t progress;               /* a reader went on, or time was granted; likewise */

    _Atomic uint64_t drop_until; /* ticks before this one are not worth computing any more */

    pthread_t pacer_thread;
    int pacer_running;
    int64_t epoch_ns;            /* clock_now_ns() of device time 0 */
    _Atomic uint64_t granted;    /* step: ticks that may pass */
    _Atomic uint64_t granted_ns; /* step: the sum of all grants */
    _Atomic uint64_t final_tick; /* first tick that will never be; UINT64_MAX while unknown */
    _Atomic int ending;          /* the run was told to end: no patience with readers who stand still */
    _Atomic int stopping;        /* give up waiting for anything */
    _Atomic int pacer_done;
    _Atomic uint32_t pumps_busy; /* pumps that still have something to bring out */
    uint32_t seq;                /* of the pacing thread */
    struct ring_hits line;       /* of the line so far; likewise */
    int line_broken;             /* likewise: a tick was lost since the last line end */
    _Atomic uint64_t late[LATE_BUCKETS];
    _Atomic int64_t first_pulse_ns, last_pulse_ns; /* when released; 0: not yet */

    struct loop_reader reader[RING_MAX_READERS];
    _Atomic int link_failed;
    struct sh_err link_error; /* of the first link that failed, once link_failed is 1 */
    struct pump *pump[LOOP_MAX_LINKS];
    uint32_t n_pumps;
    struct hasher *hasher;
    struct pose_feed *feed; /* of a live platform in real time; NULL: none */
};

static inline int loop_waits(const struct loop *loop)
{
    return loop->cfg->loop.pace != PACE_REALTIME;
}

/* The pacing thread and the casters (loop_threads.c). */
void *loop_pacer_main(void *arg);
void *loop_caster_main(void *arg);
/* Something happened that casters or the pacing thread may wait for: a command, a grant, the end. */
void loop_poke(struct loop *loop);

/* A link with its thread (pump.c, pump_nmea.c). */
int pump_open(struct loop *loop, uint32_t index, const struct link_spec *spec, struct pump **out, struct sh_err *err);
int pump_start(struct pump *pump, struct sh_err *err);
void pump_wake(struct pump *pump); /* real-time safe */
void pump_join(struct pump *pump);
void pump_close(struct pump *pump);
void pump_endpoint(const struct pump *pump, char *buf, size_t len);
double pump_capacity(const struct pump *pump); /* bytes per second; 0: no fixed limit */
const char *pump_type(const struct pump *pump);
int pump_is_nmea(const struct pump *pump);

/* The hash of the stream, a reader of its own (hash.c). */
int hasher_start(struct loop *loop, struct hasher **out, struct sh_err *err);
void hasher_wake(struct hasher *hasher); /* real-time safe */
/* Waits for the end of the stream. 1: hex is the hash; 0: the hasher itself could not follow. */
int hasher_join(struct hasher *hasher, char hex[65]);

#endif
