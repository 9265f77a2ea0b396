/* SPDX-License-Identifier: MIT */
/* Private to the files of this folder: what the device holds, each part with one owner. */
#ifndef FIRMWARE_SIM_DEVICE_DEVICE_STATE_H
#define FIRMWARE_SIM_DEVICE_DEVICE_STATE_H

#include <pthread.h>

#include "drivers/link/link.h"
#include "firmware_sim/device/device.h"
#include "firmware_sim/device/fault_desk.h"
#include "firmware_sim/device/gnss.h"
#include "firmware_sim/device/pps.h"
#include "firmware_sim/device/head_clock.h"
#include "firmware_sim/device/head_faults.h"

/* Poses of a live platform. Each tick begins with a pose of the head, made once from the poses that had
 * come. */
struct device_live {
    struct device_sample {
        int64_t t_ns;     /* device time */
        struct pose pose; /* of the platform */
    } sample[64];
    uint64_t n; /* that came; number i at i % 64 */
    struct pose_knot knot[2 * DEVICE_MAX_POSES];
    int64_t next;       /* knots of this scan that are made; number i, at i ticks of the scan, at i % LEN(knot) */
    uint64_t said_tick; /* of the last event about late poses */
};

enum { DEVICE_MAX_PENDING = 256, DEVICE_MAX_CHANGES = 32, DEVICE_SURFACES_A_FRAME = 64 };

/* The state machine of the head. */
struct device_machine {
    enum head_state state; /* as of the next tick to be claimed */
    uint64_t due_tick;     /* of the next timed transition; UINT64_MAX: none */
    /* The last ones: readers see the state of the last released tick. Number i is at i %
     * DEVICE_MAX_CHANGES. */
    struct device_state_change {
        uint64_t tick;
        enum head_state state;
    } change[DEVICE_MAX_CHANGES];
    uint32_t n_changes; /* since power-up */
};

/* The site, planned for settings that commands have given (site_vary). It is kept while a scan or its works use it. */
struct device_variant {
    struct device_variant *next;
    struct device_version *version; /* that it is made of, and holds */
    struct site *site;
    struct head_settings settings;
    uint32_t station; /* from 0 */
    _Atomic uint32_t users;
};

/* The scan at hand, or the last one. */
struct device_scan {
    int on;
    const struct site *site;        /* that it is made with */
    struct device_variant *variant; /* NULL: that is the device's */
    uint32_t number;                /* from 1 */
    uint64_t tick0;                 /* its first */
    uint64_t end_tick;              /* the first one after it, when none is on */
    uint64_t pulse_next;            /* next pulse to be claimed */
    uint64_t cast;                  /* of the pulses before, those that are cast */
    struct schedule_segment segment;
    int64_t prr_uhz, lines_uhz; /* as they are set; a mirror that turns slowly has others in the segment */
    uint32_t station;           /* from 0 */
    uint32_t station_scan;      /* which of its scans */
    size_t stretch;             /* of a trajectory: the one of the last pulse that is claimed */
    int describe;               /* descriptor and anchor are due, as news */
    int anchor_lost;            /* they are due as a repetition: a new anchor was in a tick that was lost */
    int stop_requested;
};

/* Events that wait for a tick. */
struct device_events {
    struct native_event event[DEVICE_MAX_PENDING];
    uint32_t n, dropped;
};

/* Errors of a session, or of the head itself, as far as events say them. */
struct device_errors {
    uint64_t until_tick; /* of the second at hand */
    uint32_t said;       /* events in it */
    uint32_t held;       /* errors since that no event has said */
    int last;            /* number of the last one of those */
};
enum { DEVICE_ERRORS_A_SECOND = 10, DEVICE_MAX_SESSIONS = (CONFIG_MAX_LINKS + 1) * LINK_MAX_SESSIONS };

/* When power went last, and when it came, or will. */
struct device_power {
    uint64_t off_tick, on_tick; /* 0: it has always been on */
    int boot_begins;            /* in the tick at hand */
    int reboots;                /* a command asked for it: power goes with the next tick, for one tick */
    uint32_t again;             /* how often power has come back */
    uint32_t near_wrap;         /* counters begin so many below their wrap */
};

/* What the head could not compute in time, as far as events have said so. */
struct device_overrun {
    uint64_t ticks_said, pulses_said;
    uint64_t first; /* first lost pulse that no event has named; UINT64_MAX: none */
    uint64_t tick;  /* of the last event */
};

/* Faults that change what is measured (beam_faults.c). They strike at pulses of the scan that is on. */
struct device_beam {
    uint32_t version; /* of the board, that the list is of */
    uint32_t n;
    struct device_beam_fault {
        struct fault_entry entry;
        int strikes;      /* at the scan's next pulse */
        int64_t begin_ns; /* its first pulse, since the scan's start */
        double turn;      /* mirror_stuck: where the mirror, or the rotor, stands */
    } fault[FAULT_MAX];
    uint64_t edge;           /* the next pulse at which one begins or ends; UINT64_MAX: none */
    struct device_upset now; /* what all that strike do together */
};

/* Lines that files of the head lack (device_files_fill), as far as events have said so. */
struct device_lost_lines {
    uint64_t said;
    uint64_t tick; /* of the last event; 0: there was none */
};

/* The journal that is written, and the one that is replayed. */
struct device_journal {
    struct journal *out; /* NULL: none */
    struct journal_entry *replay;
    size_t n_replay, at; /* next entry to carry out */
    int ends;            /* the replayed one has an end */
    uint64_t end_tick;   /* where the run at hand ended, once it is over */
};

/* A site as long as somebody uses it: the device, and ticks that were claimed while it was the device's. */
struct device_version {
    const struct site *site;
    struct site *own;       /* NULL: the one the device was made with, which is its caller's */
    _Atomic uint32_t users; /* but the device */
    struct device_version *next;
};

/* Stations that are moved, one at a time (moves.c). Who plans has plan, made, ahead and err to itself, without the lock. */
struct device_moves {
    const struct site *first;       /* the site of power-up */
    struct device_version *current; /* of device->site */
    struct device_version *old;     /* those before that are not freed yet */
    struct command_place *place, *first_place;
    _Atomic int stops; /* the run ends: planning, too */
    struct device_move {
        uint32_t station, session;
        int to_first, took_control;
        int stays; /* it stands there already: nothing to plan, nothing to tell */
        struct site_place to;
        int64_t t_ns; /* of a replayed journal: when it was done; else -1 */
        char line[COMMAND_MAX_LINE + 1];
    } plan;
    struct device_version *made;  /* NULL: err says why */
    struct device_version *ahead; /* planned before they are due, in order (device_plan_ahead) */
    struct sh_err err;
};

struct device {
    pthread_mutex_t lock;
    const struct site *site; /* as of now */
    struct device_moves moves;
    struct device_options options;
    struct device_counters counters;
    struct command_device cmd;
    struct head_clock clock;
    struct gnss gnss;
    struct pps pps;
    char plan[160]; /* site_plan_text */
    char idn[96];
    uint64_t tick_hz;
    int64_t tick_ns;
    uint64_t next_tick; /* to be claimed */
    uint64_t end_tick;  /* of the run; UINT64_MAX: none */
    int ending, over;
    struct device_machine machine;
    struct device_power power;
    struct device_scan scan;
    uint32_t *station_scans; /* [n_stations] since power-up */
    struct device_events events;
    struct device_errors errors[DEVICE_MAX_SESSIONS + 1]; /* of session i; 0: the head */
    uint64_t held;                                        /* errors in all that no event has said */
    struct device_overrun overrun;
    struct device_lost_lines lost_lines;
    struct device_live live;
    struct device_journal journal;
    struct fault_board *faults;
    struct fault_desk desk;
    struct head_faults head_faults; /* those of the board that are in the head */
    struct device_beam beam;
    struct device_variant *variants;
};

/* ---- all with the lock held */

/* events.c */
void device_push_event(struct device *device, enum native_event_code code, uint64_t a, uint64_t b, uint64_t c,
                       const char *text);
/* As many events into the work as fit. */
void device_take_events(struct device *device, struct device_work *work);
/* An event for an error of a session, or of the head (0). Of the errors of each, DEVICE_ERRORS_A_SECOND in a second
 * of device time have one. The others are held back. */
void device_push_error(struct device *device, uint32_t session, int number, const char *text);
/* An event for each session that says how many were held back in a second that is over. */
void device_say_held(struct device *device, uint64_t tick);

/* states.c */
/* Applies a state event at a tick; does nothing where the machine refuses it. */
void device_transition(struct device *device, enum head_event event, uint64_t tick);
/* Timed transitions that are due at the tick. */
void device_run_timers(struct device *device, uint64_t tick);
enum head_state device_visible_state(const struct device *device, uint64_t released);
/* Ticks of a time, rounded up. */
uint64_t device_ticks_of(const struct device *device, double s);

/* variant.c */
/* For scans from a station, from 0, with these settings; NULL: the device's site will do. */
int device_find_variant(struct device *device, const struct head_settings *settings, uint32_t station,
                        struct device_variant **out, struct sh_err *err);
/* The same as command_device.can_plan; owner: the device. */
int device_can_plan(void *owner, const struct head_settings *settings, char *why, size_t len);
/* Those that no work and no scan uses. */
void device_free_unused_variants(struct device *device);
void device_free_variants(struct device *device);

/* scan.c */
void device_begin_scan(struct device *device, uint64_t tick);
/* What the tick has of the scan that is on: descriptor, names, pulses; and the scan's end. */
void device_claim_scan(struct device *device, uint64_t tick, struct device_work *work);
/* Descriptor and anchor go out in this tick, for readers that join late or because they were lost. Between scans
 * they are those of the last one; before the first, of scan 0 with the settings of power-up. */
int device_is_repeated(const struct device *device, uint64_t tick);
void device_before_scans(struct device *device);
void device_describe(struct device *device, struct device_work *work);

/* overrun.c: an event for what was lost since the last one. */
void device_say_overrun(struct device *device, uint64_t tick);
/* Likewise for lines, once a second at most. */
void device_say_lost_lines(struct device *device, uint64_t tick);

/* carry_out.c */
/* Commands of the replayed journal that are due at the tick. Returns 1 when one of them moves a station: that has to be
 * planned and finished before the others. */
int device_run_replay(struct device *device, uint64_t tick);

/* versions.c */
/* own: freed with it; NULL: it is its caller's. NULL: no memory. */
struct device_version *device_make_version(const struct site *site, struct site *own);
void device_free_version(struct device_version *version);
void device_free_versions(struct device_version **list);
/* Those before that nobody uses. Without the lock; by who plans moves. */
void device_free_unused_sites(struct device_moves *moves);
void device_set_places(const struct site *site, struct command_place *place);
int device_open_moves(struct device *device, struct sh_err *err);
void device_close_moves(struct device *device);
/* The work's tick holds the site of now. */
void device_use_site(struct device *device, struct device_work *work);

/* moves.c */
/* A move was commanded, and is to be planned (device_plan_move) by the thread that commanded it or one it has. */
void device_begin_move(struct device *device, uint32_t session, const char *line, int64_t t_ns,
                       const struct command_result *command);
/* The moves of the journal to be replayed, before time begins: in real time nobody waits for them later. */
void device_plan_ahead(struct device *device);
/* It is planned: the first half of device_finish_move; then the second, without the lock. */
void device_take_move(struct device *device, int64_t t_ns, struct command_result *out);
void device_end_move(struct device *device);

/* live_pose.c */
/* The end of the head's path, since the scan's start; INT64_MAX: there is none. */
int64_t device_path_end_ns(const struct device *device);
/* Where the head is at a device time; 0: it stands at its station. A trajectory runs from the start of the
 * last scan to its end, and the platform stands there until the next one begins. */
int device_head_pose(struct device *device, int64_t t_ns, struct pose *head);
/* Poses of a live head for the pulses that the work holds. */
void device_take_poses(struct device *device, struct device_work *work);

/* beam_faults.c */
/* The schedule of a site's head as it is set, with the rates of its scan; and with what slows its mirror. */
void device_fill_spec(struct device *device, const struct site *site, struct schedule_spec *spec);
/* Faults that begin or end at the scan's next pulse do so, where it fires before until_ns of the scan: the segment has
 * the rates from there on, and the board has notes of it. Sets the next edge. */
void device_turn_beam(struct device *device, int64_t until_ns);
/* A scan begins, or is over at a time since its start: none strikes any more. */
void device_end_beam(struct device *device, int64_t t_ns);

/* device_faults.c */
int device_open_faults(struct device *device, struct sh_err *err);
/* Faults of the tick, but those of the beam: what of them begins and ends, and does so at once. */
void device_run_faults(struct device *device, uint64_t tick, struct device_work *work);

/* power.c */
void device_first_power(struct device *device);
/* Power that goes or comes with the tick, and boots that begin with it. */
void device_run_power(struct device *device, uint64_t tick, struct device_work *work);
/* The end of a boot is due. 1: the self-test failed, and that is done. */
int device_end_boot(struct device *device, uint64_t tick);
/* For who asks as of `released`: power has gone since, or will go before an answer could come, and is not back. */
int device_is_dead(const struct device *device, uint64_t released);

/* clock_faults.c */
void device_run_clock_faults(struct device *device, uint64_t tick);
/* Whether pulses are lost at a device time. */
int device_has_no_pps(const struct device *device, int64_t t_ns);
/* The PPS event of a full second is not to be. */
int device_loses_pps(struct device *device, int64_t edge_ns);

/* time_of_day.c: the head's clock and the receiver. */
/* GPS time, ns, of a device time by the head's clock; 0: unknown. */
int64_t device_gps_ns(const struct device *device, int64_t t_ns);
/* An event for the full second that begins in the tick, if one does. */
void device_say_pps(struct device *device, uint64_t tick);
void device_say_time(struct device *device, uint64_t tick);
/* What TIME:UTC? and TIME:GPS? answer at cmd.t_ns. */
void device_set_time_texts(struct device *device);

/* frames.c: what the frames say. */
void device_fill_descriptor(const struct device *device, struct native_descriptor *d);
/* Kind NATIVE_EMIT_LINE for a line head, which has no such frame. beam: [NATIVE_MAX_BEAMS]. */
void device_fill_emitter(const struct device *device, struct native_emitter *e, struct native_beam *beam);
void device_fill_telemetry(const struct device *device, uint64_t tick, struct native_telemetry *t);

#endif
