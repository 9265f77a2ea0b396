/* SPDX-License-Identifier: MIT */
/* Private to the files of this folder: the state of the device, each part with one owner. */
#ifndef FIRMWARE_SIM_DEVICE_DEVICE_STATE_H
#define FIRMWARE_SIM_DEVICE_DEVICE_STATE_H

#include <pthread.h>

#include "drivers/link/link.h"
#include "firmware_sim/config/limits.h"
#include "firmware_sim/device/device.h"
#include "firmware_sim/device/fault_desk.h"
#include "firmware_sim/device/gnss.h"
#include "firmware_sim/device/head_clock.h"
#include "firmware_sim/device/head_faults.h"
#include "firmware_sim/device/pps.h"

/* Poses of a live platform. Each tick begins with a pose of the head, made once from the poses that had
 * come. */
struct device_live {
    struct device_sample {
        int64_t t_ns;     /* device time */
        struct pose pose; /* of the platform */
    } sample[64];
    uint64_t n; /* poses that came; number i is at i % 64 */
    struct pose_knot knot[2 * DEVICE_MAX_POSES];
    int64_t next;       /* knots made in this scan; number i, at i ticks of the scan, is at i % LEN(knot) */
    uint64_t said_tick; /* tick of the last event about late poses */
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

/* The site, planned again for settings that commands gave (site_vary). It is kept while a scan or a work uses it. */
struct device_variant {
    struct device_variant *next;
    struct device_version *version; /* that it is made from, and that it holds */
    struct site *site;
    struct head_settings settings;
    uint32_t station; /* from 0 */
    _Atomic uint32_t users;
};

/* The scan at hand, or the last one. */
struct device_scan {
    int on;
    const struct site *site;        /* that the scan is made with */
    struct device_variant *variant; /* NULL: site is the device's */
    uint32_t number;                /* from 1 */
    uint64_t tick0;                 /* its first */
    uint64_t end_tick;              /* the first tick after it, when no scan is on */
    uint64_t pulse_next;            /* next pulse to be claimed */
    uint64_t cast;                  /* how many of the pulses before are cast */
    struct schedule_segment segment;
    int64_t prr_uhz, lines_uhz; /* as set; with a slow mirror the segment has other rates */
    uint32_t station;           /* from 0 */
    uint32_t station_scan;      /* which of its scans */
    size_t stretch;             /* of a trajectory: the one of the last pulse that is claimed */
    int describe;               /* descriptor and anchor are due, as new ones */
    int anchor_lost;            /* they are due as a repetition: a tick with a new anchor was lost */
    int stop_requested;
};

/* Events that wait for a tick. */
struct device_events {
    struct native_event event[DEVICE_MAX_PENDING];
    uint32_t n, dropped;
};

/* Errors of a session, or of the head itself, and the events for them. */
struct device_errors {
    uint64_t until_tick; /* end of the second at hand */
    uint32_t said;       /* events in that second */
    uint32_t held;       /* errors since then that no event has reported */
    int last;            /* number of the last one of those */
};
enum { DEVICE_ERRORS_A_SECOND = 10, DEVICE_MAX_SESSIONS = (CONFIG_MAX_LINKS + 1) * LINK_MAX_SESSIONS };

/* When power last went, and when it came back or will. */
struct device_power {
    uint64_t off_tick, on_tick; /* 0: it has always been on */
    int boot_begins;            /* a boot begins in the tick at hand */
    int reboots;                /* a command asked for it: power goes with the next tick, for one tick */
    uint32_t again;             /* how often power has come back */
    uint32_t near_wrap;         /* counters begin this far below their wrap */
};

/* Losses that the head could not compute in time, and the events for them. */
struct device_overrun {
    uint64_t ticks_said, pulses_said;
    uint64_t first; /* first lost pulse that no event has named; UINT64_MAX: none */
    uint64_t tick;  /* of the last event */
};

/* Injected faults that change what is measured (beam_faults.c). They strike at pulses of the scan that is on. */
struct device_beam {
    uint32_t version; /* of the board's list that `fault` was taken from */
    uint32_t n;
    struct device_beam_fault {
        struct fault_entry entry;
        int strikes;      /* at the scan's next pulse */
        int64_t begin_ns; /* time of its first pulse, since the scan's start */
        double turn;      /* mirror_stuck: where the mirror, or the rotor, stands */
    } fault[FAULT_MAX];
    uint64_t edge;           /* the next pulse at which one begins or ends; UINT64_MAX: none */
    struct device_upset now; /* the disturbance by all that strike together */
};

/* Lines that files of the head lack (device_files_fill), and the events for them. */
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

/* A site that is kept while it is in use: by the device, and by ticks that were claimed while it was the device's. */
struct device_version {
    const struct site *site;
    struct site *own;       /* NULL: the one the device was made with, which is its caller's */
    _Atomic uint32_t users; /* not counting the device */
    struct device_version *next;
};

/* Stations that are moved, one at a time (moves.c). plan, made, ahead and err belong to the thread that plans, without
 * the lock. */
struct device_moves {
    const struct site *first;       /* the site of power-up */
    struct device_version *current; /* of device->site */
    struct device_version *old;     /* earlier ones that are not freed yet */
    struct command_place *place, *first_place;
    _Atomic int stops; /* the run ends, and planning with it */
    struct device_move {
        uint32_t station, session;
        int to_first, took_control;
        int stays; /* it stands there already: nothing to plan or report */
        struct site_place to;
        int64_t t_ns; /* of a replayed journal: the time of the move; else -1 */
        char line[COMMAND_MAX_LINE + 1];
    } plan;
    struct device_version *made;  /* NULL: err says why */
    struct device_version *ahead; /* versions that are planned before they are due, in order (device_plan_ahead) */
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
    uint64_t held;                                        /* all errors that no event has reported */
    struct device_overrun overrun;
    struct device_lost_lines lost_lines;
    struct device_live live;
    struct device_journal journal;
    struct fault_board *faults;
    struct fault_desk desk;
    struct head_faults head_faults; /* the board's faults in the head */
    struct device_beam beam;
    struct device_variant *variants;
};

/* ---- all with the lock held */

/* events.c */
void device_push_event(struct device *device, enum native_event_code code, uint64_t a, uint64_t b, uint64_t c,
                       const char *text);
/* Puts as many events into the work as fit. */
void device_take_events(struct device *device, struct device_work *work);
/* Adds an event for an error of a session, or of the head (0). Each of these gets at most DEVICE_ERRORS_A_SECOND such
 * events in a second of device time. Further errors are held back. */
void device_push_error(struct device *device, uint32_t session, int number, const char *text);
/* Adds an event for each session with the number of errors that were held back in a second that is over. */
void device_say_held(struct device *device, uint64_t tick);

/* states.c */
/* Applies a state event at a tick; does nothing where the machine refuses it. */
void device_transition(struct device *device, enum head_event event, uint64_t tick);
/* Makes the timed transitions that are due at the tick. */
void device_run_timers(struct device *device, uint64_t tick);
enum head_state device_visible_state(const struct device *device, uint64_t released);
/* Ticks of a time, rounded up. */
uint64_t device_ticks_of(const struct device *device, double s);

/* variant.c */
/* Finds or plans the site for scans from a station, from 0, with these settings; NULL: the device's site will do. */
int device_find_variant(struct device *device, const struct head_settings *settings, uint32_t station,
                        struct device_variant **out, struct sh_err *err);
/* The same as command_device.can_plan; owner: the device. */
int device_can_plan(void *owner, const struct head_settings *settings, char *why, size_t len);
/* Frees the variants that no work and no scan uses. */
void device_free_unused_variants(struct device *device);
void device_free_variants(struct device *device);

/* scan.c */
void device_begin_scan(struct device *device, uint64_t tick);
/* Claims the tick's part of the scan that is on: descriptor, names, pulses; and the scan's end. */
void device_claim_scan(struct device *device, uint64_t tick, struct device_work *work);
/* Whether descriptor and anchor go out again in this tick, for readers that join late or because they were lost.
 * Between scans they are those of the last one; before the first, those of scan 0 with the settings of power-up. */
int device_is_repeated(const struct device *device, uint64_t tick);
void device_before_scans(struct device *device);
void device_describe(struct device *device, struct device_work *work);

/* overrun.c: adds an event for the losses since the last one. */
void device_say_overrun(struct device *device, uint64_t tick);
/* The same for lines, once a second at most. */
void device_say_lost_lines(struct device *device, uint64_t tick);

/* carry_out.c */
/* Carries out commands of the replayed journal that are due at the tick. Returns 1 when one of them moves a station:
 * that has to be planned and finished before the others. */
int device_run_replay(struct device *device, uint64_t tick);

/* versions.c */
/* own: is freed with the version; NULL: site is its caller's. Returns NULL without memory. */
struct device_version *device_make_version(const struct site *site, struct site *own);
void device_free_version(struct device_version *version);
void device_free_versions(struct device_version **list);
/* Frees earlier versions that nobody uses. Without the lock; by the thread that plans moves. */
void device_free_unused_sites(struct device_moves *moves);
void device_set_places(const struct site *site, struct command_place *place);
int device_open_moves(struct device *device, struct sh_err *err);
void device_close_moves(struct device *device);
/* Makes the work's tick hold the present site. */
void device_use_site(struct device *device, struct device_work *work);

/* moves.c */
/* A move was commanded. The thread that commanded it, or one of its own, has to plan it (device_plan_move). */
void device_begin_move(struct device *device, uint32_t session, const char *line, int64_t t_ns,
                       const struct command_result *command);
/* Plans the moves of the journal to be replayed before time begins, since in real time nobody waits for them later. */
void device_plan_ahead(struct device *device);
/* The two halves of device_finish_move, after planning; the second one without the lock. */
void device_take_move(struct device *device, int64_t t_ns, struct command_result *out);
void device_end_move(struct device *device);

/* live_pose.c */
/* The end of the head's path, since the scan's start; INT64_MAX: there is none. */
int64_t device_path_end_ns(const struct device *device);
/* The head's pose at a device time; 0: it stands at its station. A trajectory runs from the start of the
 * last scan to its end; then the platform stands there until the next scan begins. */
int device_head_pose(struct device *device, int64_t t_ns, struct pose *head);
/* Puts the poses of a live head for the work's pulses into it. */
void device_take_poses(struct device *device, struct device_work *work);

/* beam_faults.c */
/* The schedule of a site's head with its present settings, slowed by faults of its mirror. Sets the scan's rates. */
void device_fill_spec(struct device *device, const struct site *site, struct schedule_spec *spec);
/* Begins and ends the faults that do so at the scan's next pulse, if that fires before until_ns of the scan. The
 * segment has the new rates from there on; each change is noted on the board. Sets the next edge. */
void device_turn_beam(struct device *device, int64_t until_ns);
/* A scan begins, or is over at a time since its start: ends all faults that strike. */
void device_end_beam(struct device *device, int64_t t_ns);

/* device_faults.c */
int device_open_faults(struct device *device, struct sh_err *err);
/* Begins and ends the tick's faults in the head, except those of the beam. */
void device_run_faults(struct device *device, uint64_t tick, struct device_work *work);

/* power.c */
void device_first_power(struct device *device);
/* Changes power that goes or comes with the tick, and begins boots. */
void device_run_power(struct device *device, uint64_t tick, struct device_work *work);
/* The end of a boot is due. 1: the self-test failed, and the head is in its fault state. */
int device_end_boot(struct device *device, uint64_t tick);
/* Whether power has gone since `released`, or will go before an answer could come, and is not back. */
int device_is_dead(const struct device *device, uint64_t released);

/* clock_faults.c */
void device_run_clock_faults(struct device *device, uint64_t tick);
/* Whether pulses are lost at a device time. */
int device_has_no_pps(const struct device *device, int64_t t_ns);
/* Whether a fault suppresses the PPS event of a full second. */
int device_loses_pps(struct device *device, int64_t edge_ns);

/* time_of_day.c: the head's clock and the receiver. */
/* GPS time, ns, of a device time by the head's clock; 0: unknown. */
int64_t device_gps_ns(const struct device *device, int64_t t_ns);
/* Adds an event for the full second that begins in the tick, if one does. */
void device_say_pps(struct device *device, uint64_t tick);
void device_say_time(struct device *device, uint64_t tick);
/* Sets the answers to TIME:UTC? and TIME:GPS? at cmd.t_ns. */
void device_set_time_texts(struct device *device);

/* frames.c: the contents of frames. */
void device_fill_descriptor(const struct device *device, struct native_descriptor *d);
/* For a line head, which has no such frame, the kind is NATIVE_EMIT_LINE. beam: [NATIVE_MAX_BEAMS]. */
void device_fill_emitter(const struct device *device, struct native_emitter *e, struct native_beam *beam);
void device_fill_telemetry(const struct device *device, uint64_t tick, struct native_telemetry *t);

#endif
