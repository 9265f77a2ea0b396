/* SPDX-License-Identifier: MIT */
/* The device: commands, states and the scan program. It does what a head's main processor does.
 *
 * In: command lines, poses of a live platform, and claims of ticks. Out: replies, and what each tick consists
 * of (device_work). All times are device time in ns from power-up, or ticks of it.
 *
 * Casters claim ticks in order, ahead of their release. A claim takes the state machine and the scan program
 * on to that tick. A command takes effect at the first tick that is not claimed yet. A client that asks for
 * the state gets that of the last released tick, not of the last claimed one.
 *
 * Functions with a parameter `self`, the struct device, are also members of struct loop_source_ops (loop/source.h).
 *
 * Thread: any. There is one lock inside, held for microseconds; for milliseconds where a site has to be planned for
 * settings (site_vary). The pacing thread never takes it. */
#ifndef FIRMWARE_SIM_DEVICE_DEVICE_H
#define FIRMWARE_SIM_DEVICE_DEVICE_H

#include <stdatomic.h>
#include <stdint.h>

#include "core/cast.h"
#include "drivers/protocol/native.h"
#include "drivers/protocol/protocol.h"
#include "firmware_sim/command/command.h"
#include "firmware_sim/config/places.h"
#include "firmware_sim/device/journal.h"
#include "firmware_sim/device/settings_file.h"
#include "firmware_sim/fault/board.h"
#include "firmware_sim/site/site.h"

enum { DEVICE_MAX_EVENTS = 24, DEVICE_MAX_POSES = 256, DEVICE_POSE_AHEAD_S = 3600, DEVICE_POSES_KEPT = 1 << 16 };

/* Counters that casters, pacing thread and readers share. COUNTS.md defines the words.
 * Once all claimed ticks are released or lost, cast = pulses + lost_pulses. */
struct device_counters {
    _Atomic uint64_t fired, cast;             /* claimed */
    _Atomic uint64_t pulses, echoes, lines;   /* delivered, so released */
    _Atomic uint64_t empty;                   /* delivered pulses without echo */
    _Atomic uint64_t lost_pulses, lost_ticks; /* not computed in time */
    _Atomic uint64_t crowded, faint, unfit;   /* hits that are not echoes: struct cast_counters */
    _Atomic uint64_t lost_samples;            /* of waveforms: no room in their block */
    _Atomic uint64_t late_blocks, late_max_ns;
    _Atomic uint64_t reader_lost_frames, reader_lost_pulses; /* left out for readers that were too slow */
    /* live: poses of the head that were made up because none came in time, and poses that could not be used */
    _Atomic uint64_t late_poses, bad_poses;
    _Atomic uint64_t lost_journal_lines, lost_truth_lines; /* their files were too slow, or could not be written */
};

/* The change of power in a tick. */
enum device_power_change { DEVICE_POWER_STAYS, DEVICE_POWER_GOES, DEVICE_POWER_COMES };

/* The disturbance of the beam in a tick, by injected faults. */
struct device_disturbance {
    int on;            /* 0: there is none, and the rest is not set */
    int stuck;         /* the mirror, or the rotor, stands at stuck_turn */
    double stuck_turn; /* turns */
    struct cast_disturbance cast;
};

/* The work of one tick. All members are copies, so that no thread waits for another. Stream frames
 * leave in the order of the members. */
struct device_work {
    uint64_t tick;
    struct device_version *version; /* where stations stand: device_site_of, until device_done; NULL: as at power-up */
    int64_t t_ns;                   /* device time at the tick's start */
    uint32_t n_events_before;       /* events of event[] that go before the points; the others go after them */
    uint32_t n_events;
    struct native_event event[DEVICE_MAX_EVENTS];
    int describe, describe_flags; /* descriptor, emitter and anchor frames, with these flags */
    struct native_descriptor descriptor;
    struct native_emitter emitter; /* kind NATIVE_EMIT_LINE: none is sent */
    struct native_beam beam[NATIVE_MAX_BEAMS];
    struct native_anchor anchor;
    uint32_t surfaces_first, surfaces_n; /* names to send; 0: none */
    int scanning;
    /* The site of the scan: that of the version, or one that is planned for its settings. The site is valid until
     * device_done. */
    const struct site *site;
    struct device_version *variant; /* NULL: that of the version */
    int64_t scan_t0_ns;             /* device time of the scan's start */
    struct schedule_segment segment;
    int64_t prr_uhz;                       /* as it is set */
    struct device_disturbance disturbance; /* of all its pulses */
    uint32_t scan;                         /* its number */
    uint64_t pulse0, pulse_end;            /* pulses of this tick */
    uint64_t n_cast, cast0;                /* how many of these are cast, and the first of them; UINT64_MAX: none */
    int cut_short;                         /* the scan stops at pulse_end, within a line */
    uint32_t station;
    uint32_t station_scan; /* number of the scan among that station's since power-up, from 1 */
    size_t stretch;        /* number of the path's stretch that the last anchor is for */
    uint32_t echoes;       /* enum beam_select */
    uint32_t waves;        /* 1: waveforms are sent */
    uint32_t n_poses;      /* live: the head's poses of this tick; 0: the head stands still or follows a trajectory */
    struct pose_knot pose[DEVICE_MAX_POSES];
    enum device_power_change power; /* at the tick's start. While it is off the head reports nothing else */
    int telemetry;                  /* due at the tick's end; it goes before each SCAN_END, too */
    struct native_telemetry telemetry_frame;
};

struct device;
struct device_version;
struct config;

struct device_options {
    int start;    /* scan at once when booted */
    int one_scan; /* end the run when the first scan is over */
    double
        duration_s; /* > 0: end the run after this time, from the first scan's start with `start`, else from power-up */
    double scan_s;  /* > 0: end each scan after this time, to the pulse */
    const char *journal;            /* NULL: none */
    const char *replay;             /* NULL: none */
    struct settings_file *settings; /* what clients have stored; the caller's; NULL: nothing is stored */
    const char *truth;              /* file for the faults that are injected; NULL: none */
    /* Warnings of a station's new place, from the thread that plans it; and of a replayed journal, at the end. NULL:
     * none. */
    const struct sh_report *report;
};

/* site must outlive the device. Sites that the device makes from it when stations move are freed with the device. */
int device_create(const struct site *site, const struct device_options *options, struct device **out,
                  struct sh_err *err);
void device_free(struct device *device);
/* 1: the replayed journal ends the run. 0: it has no end, or there is none. */
int device_replay_ends(const struct device *device);
/* 1: a journal is replayed. */
int device_replays(const struct device *device);
/* Ends and closes the journal and the file of the truth, if there are any; warns where the head refused commands of the
 * journal that was replayed. Returns the first error in writing them; the lines that they lack are counted. A file that
 * takes nothing for 2 s is given up. Call it after the loop is joined. */
int device_close_journal(void *self, struct sh_err *err);
/* 1: the buffer of one of these files is more than a quarter full, and callers that can wait should. Any thread; takes
 * no lock. */
int device_files_fill(const void *self);

/* Returns the board of injected faults, from the configuration and from commands. The board belongs to the device. */
struct fault_board *device_faults(const void *self);

struct device_counters *device_counters(void *self);

/* Claims the next tick: its work. Returns 0, or 1 when the run is over and there is no next tick. */
int device_claim(struct device *device, struct device_work *work);
/* A claimed tick was lost, and with it the pulses that it should have cast. The lost pulses are counted. The tick's
 * other frames go out with a later one. */
void device_lost(struct device *device, const struct device_work *work);
/* Ends the use of a work, delivered or lost. Call it once for each claimed work. Any thread; takes no lock. */
void device_done(struct device_work *work);
/* Holds the site of a scan, by the scan's number, for callers that claim no ticks. NULL: it is neither the scan at hand
 * nor the last one. If stations have moved since the last scan, its site has their present places. The site is valid
 * until device_give_back, which must come before device_free, and soon after the scan's end. Takes the device's lock
 * for a moment. Any thread. */
const struct site *device_hold_scan(struct device *device, uint32_t number, struct device_version **version);
/* True while nothing happens without a command. The pace `fast` waits then. */
int device_is_idle(struct device *device);
/* True where the same will be so after the next ticks, which bring events that wait. */
int device_settles(struct device *device);
/* Ends the run: stops a running scan first. Not for signal handlers. */
void device_end(void *self);

/* Carries out one command line for a session (from 1). released: how many ticks are released, for queries. */
void device_command(void *self, uint32_t session, const char *line, uint64_t released, struct command_result *out);
/* The same for a session of another protocol (drivers/protocol): control is given back at once, without an event. */
void device_command_once(void *self, uint32_t session, const char *line, uint64_t released, struct command_result *out);
/* A line that was too long for the command set has ended. */
void device_overlong(void *self, uint32_t session, struct command_result *out);
/* A session has begun; who: its kind of link and address, for others to read. */
void device_session_opened(void *self, uint32_t session, const char *who);
/* A session has gone; partial: in the middle of a command. Gives control back. */
void device_session_closed(void *self, uint32_t session, const char *who, int partial);
/* Gives the pose of a live platform (not of the head on it) at a device time, from TIME:STEP or the socket. v: x, y, z
 * (m), roll, pitch, heading (degrees). The platform moves evenly from one pose to the next, however far apart they are.
 * Before the first one the head is at its station (POSE_NONE); only in the pace step the first one holds before its
 * time, too. SH_EINPUT: the pose can't be used, which is counted. It is not later than the one before, out of reach,
 * before power-up, or more than DEVICE_POSE_AHEAD_S ahead of device time (not in the pace step). SH_ESTATE: it can't be
 * used now, which is counted, too. There are DEVICE_POSES_KEPT that pulses still need, or a journal with poses is being
 * replayed, up to its END. A pose over 2 s ahead has no room, either, where the receiver's fixes need the poses of the
 * last 2 s. */
int device_pose(struct device *device, int64_t t_ns, const double v[6], struct sh_err *err);

/* A command whose effect is COMMAND_MOVE has moved nothing yet. First call device_plan_move, in any thread.
 * device_plan_move plans the station's new place (maps, beams), which takes milliseconds to seconds, without the
 * device's lock. Then call device_finish_move: the station stands there from the next tick on, journalled, with an
 * event; or the move is refused (-221) and nothing has changed. Either way *out has the reply. No other move and no
 * scan begins in between. */
void device_plan_move(struct device *device);
void device_finish_move(struct device *device, uint64_t released, struct command_result *out);

/* The present places of the stations. Any thread. */
struct device_station {
    char name[CONFIG_STATION_NAME_LEN];
    struct site_place place;
    int served;                        /* 0: it has another scanner */
    int has_tripod;                    /* else the rest is 0 */
    double leg_m;                      /* length of a leg */
    double height_m;                   /* of the tripod's top above the ground; NaN: no ground below */
    double opening_rad, foot_radius_m; /* of a leg from the vertical; distance of its foot from the plumb line */
    double head_above_m;               /* the head's origin above the tripod's top */
    double legs_heading_deg;           /* of the first leg, from the scene's north */
};
void device_get_station(struct device *device, uint32_t station, struct device_station *out); /* 0.. */
/* Holds the present site, for callers that need more of it. The site is constant and valid until it is given back,
 * which must come before device_free, and soon: it may hold maps of hundreds of MiB. */
const struct site *device_hold_site(struct device *device, struct device_version **version);
void device_give_back(struct device_version *version); /* NULL: does nothing */
const struct site *device_site_of(const struct device_version *version);

/* Stored settings of a protocol's sessions (settings_file.h). Both functions return 1 where the head keeps nothing, or
 * the text can't be stored; 0 else. */
int device_store(void *self, const char *name, const char *text);
int device_stored(const void *self, const char *name, char text[SETTINGS_FILE_TEXT]);

/* Adds an error to the error queue (enum command_error), and an event on the wire. */
void device_report(void *self, int number, const char *text);

/* Device time begins now, at this time of clock_now_ns(). The time of day is read from the system where
 * time.epoch says so. Call it before the first tick is claimed. *warning: a warning for the user, or NULL; it
 * belongs to the device. */
int device_power_up(void *self, int64_t now_ns, const char **warning, struct sh_err *err);

/* The GNSS receiver (receiver_line.h). device_next_fix_ns: when its first sentence at or after t_ns arrives; INT64_MAX:
 * none does. device_fix gives the fix of the last sentence that had arrived at t_ns. The fix's place is where the head
 * was at the time of the fix. Returns 0 if there is none. */
int64_t device_next_fix_ns(void *self, int64_t t_ns);
int device_fix(void *self, int64_t t_ns, struct nmea_fix *fix);
/* The pulses per second, and the time since the top of the hour, at a device time that was claimed (pps.h). */
enum protocol_pps device_pps(void *self, int64_t t_ns, int64_t *hour_ns);

/* Returns the tick after the one that reports the head idle, in fault or off; UINT64_MAX: the head boots, scans, or its
 * mirror changes speed. */
uint64_t device_rests_from(void *self);

/* The last power-up as of a device time. While power is off, all members but t_ns are those of the power-up before. */
struct device_power_up {
    int64_t t_ns;       /* device time at which power came, or will come back; 0: it has always been on */
    uint32_t ons;       /* how often power has come, including the first time */
    uint32_t near_wrap; /* since then counters begin this far below their wrap; 0: they begin at 0 */
};
struct device_power_up device_last_power(void *self, int64_t t_ns);

/* Loss of optical power at the window by injected faults, both ways together, dB; 0 without a scan. The loss is that of
 * the last tick that was claimed. */
double device_window_loss_db(void *self);

/* The number of the last scan that began, which is how many have begun; 0: none. *station: where it stands, from 1;
 * NULL: not asked for. */
uint32_t device_last_scan(struct device *device, uint32_t *station);
/* Returns the length of the last scan in ns, whole ticks; 0: there was no scan, or the last one has not ended. */
int64_t device_scan_ns(struct device *device);

int64_t device_tick_ns(const void *self);

/* Fills a work that has only the present descriptor and anchor, as a repetition. */
void device_describe_now(struct device *device, struct device_work *work);
/* The anchor of a station's points; the stretch matters only along a trajectory (site_georef). */
void device_fill_anchor(const struct site *site, uint32_t station, size_t stretch, struct native_anchor *a);

/* Returns the most pulses that one tick consists of, and the most lines that end in it, whatever the settings. */
uint32_t device_tick_pulses(const struct config *cfg);
uint32_t device_tick_lines(const struct config *cfg);

#endif
