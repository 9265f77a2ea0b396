/* SPDX-License-Identifier: MIT */
/* Private to the files of this folder: the state of the device, and the functions that need all of it. Parts that don't
 * use struct device have headers of their own. */
#ifndef FIRMWARE_SIM_DEVICE_DEVICE_STATE_H
#define FIRMWARE_SIM_DEVICE_DEVICE_STATE_H

#include <pthread.h>

#include "firmware_sim/device/beam_faults.h"
#include "firmware_sim/device/device.h"
#include "firmware_sim/device/events.h"
#include "firmware_sim/device/fault_desk.h"
#include "firmware_sim/device/gnss.h"
#include "firmware_sim/device/head_clock.h"
#include "firmware_sim/device/head_faults.h"
#include "firmware_sim/device/overrun.h"
#include "firmware_sim/device/pps.h"
#include "firmware_sim/device/receiver_line.h"
#include "firmware_sim/device/ptp.h"
#include "firmware_sim/device/scan_state.h"
#include "firmware_sim/device/scanner_clock.h"
#include "firmware_sim/device/versions.h"

/* Poses of a live platform. Each tick begins with a pose of the head. This pose is made once, from the platform's poses
 * that had come by then. */
struct device_live {
    struct device_sample {
        int64_t t_ns;     /* device time */
        struct pose pose; /* of the platform */
    } * sample;           /* [DEVICE_POSES_KEPT]; NULL: the platform isn't live */
    uint64_t n;           /* poses that came; number i is at i % DEVICE_POSES_KEPT */
    struct pose_knot knot[2 * DEVICE_MAX_POSES];
    int64_t next;       /* knots made in this scan; number i, at i ticks of the scan, is at i % LEN(knot) */
    uint64_t said_tick; /* tick of the last event about late poses */
};

enum { DEVICE_MAX_CHANGES = 32, DEVICE_MAX_POWER_UPS = 64, DEVICE_SURFACES_A_FRAME = 64 };

/* The state machine of the head. */
struct device_machine {
    enum head_state state; /* as of the next tick to be claimed */
    uint64_t due_tick;     /* of the next timed transition; UINT64_MAX: none */
    /* The last changes, since clients see the state of the last released tick. Number i is at i %
     * DEVICE_MAX_CHANGES. */
    struct device_state_change {
        uint64_t tick;
        enum head_state state;
    } change[DEVICE_MAX_CHANGES];
    uint32_t n_changes; /* in the whole run, power cycles included */
    /* A command has ended the movement of changes with a lower number. Clients see that at once, though ticks that are
     * claimed already still have the scan's pulses. */
    uint32_t n_stopped;
};

/* When power last went, and when it came back or will. Sessions lag behind the device, so earlier times are kept. */
struct device_power {
    uint64_t off_tick, on_tick; /* 0: it has always been on */
    int boot_begins;            /* a boot begins in the tick at hand */
    int reboots;                /* a command asked for it: power goes with the next tick, for one tick */
    /* Number i is at i % DEVICE_MAX_POWER_UPS. Number 0 is the first power-up, with 0 and 0. */
    struct device_power_up_at {
        uint64_t off_tick, on_tick; /* power went, and came or will come */
        uint32_t near_wrap;         /* since then counters begin this far below their wrap */
    } up[DEVICE_MAX_POWER_UPS];
    uint32_t n_ups;
};

/* The journal that is written, and the one that is replayed. */
struct device_journal {
    struct journal *out; /* NULL: none */
    struct journal_entry *replay;
    size_t n_replay, at; /* next entry to carry out */
    int ends;            /* the replayed one has an end */
    int has_poses;       /* the replayed one has poses of a live platform */
    uint64_t end_tick;   /* where the run at hand ended, once it is over */
    size_t n_refused;    /* commands of the replayed one; the first of them, and its reply: */
    const struct journal_entry *refused;
    char why[128];
};

struct device {
    pthread_mutex_t lock;
    const struct site *site; /* as of now */
    struct device_moves moves;
    struct device_options options;
    struct settings_file *settings; /* NULL: there is none, or its settings are still being carried out */
    struct device_counters counters;
    struct command_device cmd;
    struct head_clock clock;
    struct gnss gnss;
    struct pps pps;
    struct ptp ptp;
    struct device_late_pulse {
        int waits; /* a pulse of the head's clock, or of the receiver, comes later than its second */
        int64_t t_ns, tai_s;
    } late_own, late_received;
    struct device_edge {
        int waits; /* a pulse has come; the rotor's speed after it is chosen with the scan's next pulse */
        int64_t t_ns;
    } edge;
    struct receiver_line line;
    uint64_t line_taken;                    /* sentences of `line` that pps has been given */
    struct scanner_clock date, date_before; /* since the last power-up, and before it */
    int server_fd;                          /* device_watch_time_server */
    char plan[160];                         /* site_plan_text */
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
    struct device_overrun overrun;
    struct device_live live;
    struct device_journal journal;
    struct fault_board *faults;
    struct fault_desk desk;
    struct head_faults head_faults; /* the board's faults in the head */
    struct device_beam beam;
};

/* ---- all with the lock held */

/* states.c */
/* Applies a state event at a tick; does nothing where the machine refuses it. */
void device_transition(struct device *device, enum head_event event, uint64_t tick);
/* Makes the timed transitions that are due at the tick. */
void device_run_timers(struct device *device, uint64_t tick);
/* Returns the state that clients see at a released tick. *stops: 1 where that is spin-down by a command, while the
 * scan's last pulses are still on their way. */
enum head_state device_visible_state(const struct device *device, uint64_t released, int *stops);
/* Ticks of a time, rounded up. */
uint64_t device_ticks_of(const struct device *device, double s);

/* scan.c */
/* With options.start: options.duration_s counts from this tick. Called where a scan begins, and where a self-test fails
 * before any scan. Only the first scan, and only the first failure, has an effect. */
void device_count_duration(struct device *device, uint64_t tick);
void device_begin_scan(struct device *device, uint64_t tick);
/* Claims the tick's part of the scan that is on: descriptor, names, pulses; and the scan's end. */
void device_claim_scan(struct device *device, uint64_t tick, struct device_work *work);
/* Whether descriptor and anchor go out again in this tick: for readers that join late, or because these frames were
 * lost. Between scans they are those of the last scan; before the first, those of scan 0 with power-up's settings. */
int device_is_repeated(const struct device *device, uint64_t tick);
void device_before_scans(struct device *device);
void device_describe(struct device *device, struct device_work *work);

/* carry_out.c */
/* Carries out commands of the replayed journal that are due at the tick. Returns 1 when one of them moves a station:
 * that has to be planned and finished before the others. */
int device_run_replay(struct device *device, uint64_t tick);
/* Notes the result of the command of the replayed journal that was carried out last. */
void device_note_replayed(struct device *device, const struct command_result *result);

void device_carry_out_line(struct device *device, const char *line);

/* stored.c */
/* HEAD:STORe: the settings are now those of power-up. */
void device_keep_settings(struct device *device);
/* Before the first power-up: carries out what the file has, as commands of the device itself, which the journal
 * gets. */
int device_restore(struct device *device, struct sh_err *err);

/* moves.c */
/* A move was commanded. The thread that commanded it, or one of its own, has to plan it (device_plan_move). */
void device_begin_move(struct device *device, uint32_t session, const char *line, int64_t t_ns,
                       const struct command_result *command);
/* Plans the moves of the journal to be replayed before time begins, since in real time nobody waits for them later. */
void device_plan_ahead(struct device *device);
/* The two halves of device_finish_move, after planning; the second one without the lock. */
void device_take_move(struct device *device, int64_t t_ns, struct command_result *out);
void device_end_move(struct device *device);

/* variant.c: sites that are planned again for settings that commands gave (site_vary). */
/* Finds or plans the site for scans from a station, from 0, with these settings; NULL: the device's site will do. */
int device_find_variant(struct device *device, const struct head_settings *settings, uint32_t station,
                        struct device_version **out, struct sh_err *err);
/* The same as command_device.can_plan; owner: the device. */
int device_can_plan(void *owner, const struct head_settings *settings, char *why, size_t len);

/* live_pose.c */
/* Returns when the head's path ends the scan, since its start; INT64_MAX: no path ends it. */
int64_t device_path_end_ns(const struct device *device);
/* The head's pose at a device time; 0: it stands at its station. A trajectory runs from the start of the
 * last scan to its end; then the platform stands there until the next scan begins. */
int device_head_pose(struct device *device, int64_t t_ns, struct pose *head);
/* The place that a live platform stays within platform.reach_m of: the station of the scan that is on, or of the next
 * one. */
const double *device_reach_centre(const struct device *device);
/* Makes room for the poses of a live platform; does nothing for other ones. device_free frees it. */
int device_open_poses(struct device *device, struct sh_err *err);
/* Takes a pose of the replayed journal. *out has the error. */
void device_replay_pose(struct device *device, const struct journal_entry *entry, struct command_result *out);
/* Whether poses come from the journal that is being replayed, so that no others are taken. */
int device_replays_poses(const struct device *device);
/* Gives the work the poses that a live head has at the work's pulses. */
void device_take_poses(struct device *device, struct device_work *work);

/* power.c */
void device_first_power(struct device *device);
/* Turns power off or on where that is due with the tick, and begins boots. */
void device_run_power(struct device *device, uint64_t tick, struct device_work *work);
/* The end of a boot is due. 1: the self-test failed, and the head is in its fault state. */
int device_end_boot(struct device *device, uint64_t tick);
/* Whether power has gone since `released`, or will go before an answer could come, and is not back. */
int device_is_dead(const struct device *device, uint64_t released);

/* phase_lock.c: the rotor's phase, held to the receiver's pulses per second. */
/* A pulse per second comes in the tick at hand. */
void device_hold_phase(struct device *device, int64_t edge_ns);
/* A tick begins: chooses the rotor's speed after a pulse per second. While the pulses are not locked (pps.h), the rotor
 * runs free. */
void device_check_phase(struct device *device, int64_t t_ns);

/* scanner_clock.c */
/* The settings of power-up, from the configuration. */
void device_init_time_server(struct device *device);
/* Power comes at a device time: the scanner's clock and its time server are as at power-up. */
void device_start_date(struct device *device, int64_t t_ns);
/* Wakes up the client of the time server. The server, or whether it may be asked, has changed. */
void device_say_time_server(const struct device *device);

/* power.c: as device_last_power; the caller has the lock. */
struct device_power_up device_power_at(const struct device *device, int64_t t_ns);

/* time_of_day.c: the head's clock and the receiver. */
/* GPS time, ns, of a device time by the head's clock; 0: unknown. */
int64_t device_gps_ns(const struct device *device, int64_t t_ns);
/* Adds an event for the full second that begins in the tick, if one does. */
void device_say_pps(struct device *device, uint64_t tick);
/* Takes the receiver's pulses and sentences of the tick. */
void device_follow_receiver(struct device *device, uint64_t tick);
void device_say_time(struct device *device, uint64_t tick);
/* Lets the PTP follower, if there is one, take part in a tick. */
void device_follow_ptp(struct device *device, uint64_t tick);
/* Fills in what telemetry of a device time says of the time of day. */
void device_tell_time(const struct device *device, int64_t t_ns, struct native_telemetry *t);
/* Sets the answers to TIME:UTC?, TIME:GPS? and TIME:PTP? at cmd.t_ns. */
void device_set_time_texts(struct device *device);

#endif
