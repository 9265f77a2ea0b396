/* Private to device*.c. */
#ifndef FIRMWARE_SIM_DEVICE_DEVICE_STATE_H
#define FIRMWARE_SIM_DEVICE_DEVICE_STATE_H

#include <pthread.h>

#include "firmware_sim/device/device.h"
#include "firmware_sim/device/gnss.h"
#include "firmware_sim/device/head_clock.h"

/* Poses of a live platform. Each tick begins with one of the head, made once, from those that had come. */
struct device_live {
    struct {
        int64_t t_ns;     /* device time */
        struct pose pose; /* of the platform */
    } sample[64];
    uint64_t n; /* that came; number i at i % 64 */
    struct pose_knot knot[2 * DEVICE_MAX_POSES];
    int64_t next;       /* knots of this scan that are made; number i, at i ticks of the scan, at i % LEN(knot) */
    uint64_t said_tick; /* of the last event about late poses */
};

enum { DEVICE_MAX_PENDING = 256, DEVICE_MAX_CHANGES = 32, DEVICE_SURFACES_A_FRAME = 64 };

struct device {
    pthread_mutex_t lock;
    const struct site *site;
    struct device_options options;
    struct device_counters counters;
    struct command_device cmd;
    struct head_clock clock;
    struct gnss gnss;
    char plan[160]; /* site_plan_text */
    char idn[96];
    uint64_t tick_hz;
    int64_t tick_ns;

    uint64_t next_tick;    /* to be claimed */
    enum head_state state; /* as of next_tick */
    uint64_t due_tick;     /* of the next timed transition; UINT64_MAX: none */
    struct {
        uint64_t tick;
        enum head_state state;
    } change[DEVICE_MAX_CHANGES]; /* the last changes: what a reader sees lags behind the claims */
    uint32_t n_changes;

    int scanning;
    uint32_t scan; /* number, from 1 */
    uint64_t scan_tick0, pulse_next, scan_lost0;
    uint64_t scan_end_tick; /* of the last scan, when none is on */
    struct schedule_segment segment;
    uint32_t station; /* of the scan at hand, from 0 */
    size_t stretch;   /* of a trajectory: the one of the last pulse that is claimed */
    int describe;     /* descriptor and anchor are due, as news */
    int anchor_lost;  /* they are due as a repetition: a new anchor was in a tick that was lost */
    int stop_requested;

    struct native_event pending[DEVICE_MAX_PENDING];
    uint32_t n_pending, pending_dropped;
    uint64_t lost_said; /* lost ticks that an event has told of */
    uint64_t lost_pulses_said;
    uint64_t lost_first;   /* first lost pulse that no event has told of; UINT64_MAX: none */
    uint64_t overrun_tick; /* of the last overrun event */

    struct device_live live;
    int ending, over;
    uint64_t end_tick; /* UINT64_MAX: none */
    struct journal *journal;
    struct journal_entry *replay;
    size_t n_replay, replay_at;
};

/* With the lock held: */
void device_push_event(struct device *device, enum native_event_code code, uint64_t a, uint64_t b, uint64_t c,
                       const char *text);
/* Applies a state event at a tick; does nothing where the machine refuses it. */
void device_transition(struct device *device, enum head_event event, uint64_t tick);
enum head_state device_visible_state(const struct device *device, uint64_t released);
void device_do_command(struct device *device, uint32_t session, const char *line, uint64_t released,
                       struct command_result *out);

/* device_pose.c: with the lock held. The end of the head's path, since the scan's start; INT64_MAX: there is none. */
int64_t device_path_end_ns(const struct device *device);
/* Where the head is at a device time; 0: it stands at its station. A trajectory runs from the start of the last scan to
 * its end, and the platform stands there until the next one begins. */
int device_head_pose(struct device *device, int64_t t_ns, struct pose *head);
/* Poses of a live head for the pulses that the work holds. */
void device_take_poses(struct device *device, struct device_work *work);
/* device_time.c: the head's clock and the receiver. */
/* GPS time, ns, of a device time by the head's clock; 0: unknown. */
int64_t device_gps_ns(const struct device *device, int64_t t_ns);
/* An event for the full second that begins in the tick, if one does. */
void device_say_pps(struct device *device, uint64_t tick);
void device_say_time(struct device *device, uint64_t tick);
/* What TIME:UTC? and TIME:GPS? answer at cmd.t_ns. */
void device_set_time_texts(struct device *device);

/* device_frames.c: what the frames say. */
void device_fill_descriptor(const struct device *device, struct native_descriptor *d);
void device_fill_telemetry(const struct device *device, uint64_t tick, struct native_telemetry *t);
void device_fill_spec(const struct device *device, struct schedule_spec *spec);

#endif
