/* SPDX-License-Identifier: MIT */
/* The head's clock: device time -> time of day.
 *
 * In: device time, ns from power-up. Out: TAI, ns (core/utc.h).
 *
 * Device time is exact: it is the simulation's own. Pulses, poses, moving meshes and the GNSS receiver follow
 * it. The key time.epoch gives the true time of day at power-up. The head's clock may be wrong.
 * It adds to the true time: time.offset_s, time.drift_ppm of the time since power-up, and
 * time.jump_s from time.jump_at_s on. While these three are 0, the head's clock shows the true time. Injected
 * faults add jumps, gains and times in which it stands, and so does the servo of a PTP follower (ptp.h). All of these
 * are changes of one kind, and between two of them the clock runs evenly.
 *
 *   by the head's clock  PPS events, the GPS time of SCAN_START (and with them scanhead_gps_time), UTC in telemetry,
 *                        TIME:UTC?, TIME:GPS?
 *   by the true time     GNSS sentences
 *   neither              device times and pulse times on the wire: they count from power-up and from the scan's start
 *
 * The system's clock (utc, tai) is read once, at power-up. Device time then runs with CLOCK_MONOTONIC. That
 * clock follows what PTP or NTP do to the rate of the system's clocks, but not their steps.
 *
 * An injected leap second is added to the table: UTC has a second 60 and is a second less from then on, TAI and GPS
 * time go on. The receiver has the same table, since the head gets its leap seconds from the receiver.
 *
 * Thread: any for the true time, after head_clock_power_up; all else with the device's lock. */
#ifndef FIRMWARE_SIM_DEVICE_HEAD_CLOCK_H
#define FIRMWARE_SIM_DEVICE_HEAD_CLOCK_H

#include "core/utc.h"
#include "firmware_sim/config/epoch.h"

/* The last changes are kept. With the shortest interval of Syncs, 250 ms, these are 16 s, and no session is further
 * behind. */
enum { HEAD_CLOCK_CHANGES = 64 };

/* A change of the clock at a device time. */
struct head_clock_change {
    int64_t jump_ns;  /* it is set forward by this */
    int64_t gain_ppt; /* its gain rises by this, in 1e-12 */
    int stands;       /* 1: one more reason to stand; -1: one reason is over */
};

__extension__ typedef __int128 head_clock_wide;

/* The clock from a change to the next. */
struct head_clock_piece {
    int64_t from_ns; /* device time. The first piece also covers the time before */
    struct head_clock_change change;
    /* follows from this change and the pieces before: */
    int64_t shift_ns;       /* sum of all jumps */
    int64_t rate_ppt;       /* its gain; -1e12: it stands */
    head_clock_wide gained; /* gained until from_ns, in 1e-12 ns */
    int64_t gain_ppt;       /* the gain that it would have if it didn't stand */
    int stands;             /* number of reasons for which it stands */
};

struct head_clock {
    enum epoch_source source; /* EPOCH_NONE: the head does not know the time */
    int64_t tai0_ns;          /* true TAI at power-up */
    uint32_t n;
    struct head_clock_piece piece[HEAD_CLOCK_CHANGES];
    struct utc_table table;
    char warning[160]; /* for the user; empty: none */
};

/* Takes the table of leap seconds that reaches further: the built-in one, or the system's. */
int head_clock_create(const struct config_time *time, struct head_clock *clock, struct sh_err *err);
/* Device time 0 is at this time of clock_now_ns(). Sets the true time by the system's clock where that is the
 * source. */
int head_clock_power_up(struct head_clock *clock, int64_t now_ns, struct sh_err *err);

/* TAI at a device time: the true one, and the head's. Real-time safe. */
int64_t head_clock_true_ns(const struct head_clock *clock, int64_t t_ns);
int64_t head_clock_ns(const struct head_clock *clock, int64_t t_ns);

/* Changes the clock from a device time on. The clock never runs backwards: a rate that would be negative becomes 0. */
void head_clock_change(struct head_clock *clock, int64_t t_ns, const struct head_clock_change *change);

/* Adds a leap second that no table has, at the end of the UTC minute at a device time: that of the head's clock, or of
 * the true time, whichever is later. So it is ahead of both, and neither goes back. Where that minute has one already,
 * it comes at the end of the next. *posix_s: the second after it, since 1970. 0: the table is full. */
int head_clock_add_leap(struct head_clock *clock, int64_t t_ns, int64_t *posix_s);

/* Finds a full second of the head's clock that begins in [from_ns, to_ns) of device time, an interval of at most a
 * second. Returns 1, its first nanosecond and the TAI second; or 0. A jump is no edge, nor is the time in which the
 * clock stands. If there are two edges, the later one is given. */
int head_clock_edge(const struct head_clock *clock, int64_t from_ns, int64_t to_ns, int64_t *edge_ns, int64_t *tai_s);

#endif
