/* The head's clock: device time -> time of day.
 *
 * In: device time, ns from power-up. Out: TAI, ns (core/utc.h).
 *
 * Device time is exact: it is the simulation's own. Pulses, poses, moving things and the GNSS receiver go by
 * it. The key time.epoch says what the true time of day is at power-up. The head's clock is what the head
 * believes. It is the sum of the true time, time.offset_s, time.drift_ppm of the time since power-up, and,
 * from time.jump_at_s on, time.jump_s. While all of them are 0, the head's clock shows the true time.
 *
 *   by the head's clock  PPS events, the GPS time of SCAN_START (and with them scanhead_gps_time), UTC in telemetry,
 *                        TIME:UTC?, TIME:GPS?
 *   by the true time     GNSS sentences
 *   neither              device times and pulse times on the wire: they count from power-up and from the scan's start
 *
 * The system's clock (utc, tai) is read once, at power-up. Device time then runs with CLOCK_MONOTONIC. That
 * clock follows what PTP or NTP do to the rate of the system's clocks, but not their steps. Constant after
 * head_clock_power_up; then any thread. */
#ifndef FIRMWARE_SIM_DEVICE_HEAD_CLOCK_H
#define FIRMWARE_SIM_DEVICE_HEAD_CLOCK_H

#include "core/utc.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/config/epoch.h"

struct head_clock {
    enum epoch_source source; /* EPOCH_NONE: the head does not know the time */
    int64_t tai0_ns;          /* true TAI at power-up */
    int64_t offset_ns, drift_ppt, jump_ns, jump_at_ns;
    struct utc_table table;
    char warning[160]; /* something the user should know; empty: nothing */
};

/* Takes the table of leap seconds that is known longer: the built-in one, or the system's. */
int head_clock_create(const struct config *cfg, struct head_clock *clock, struct sh_err *err);
/* Device time 0 is at this time of clock_now_ns(): sets the true time by the system's clock where that is the
 * source.
 */
int head_clock_power_up(struct head_clock *clock, int64_t now_ns, struct sh_err *err);

/* TAI at a device time: the true one, and the head's. Real-time safe. */
int64_t head_clock_true_ns(const struct head_clock *clock, int64_t t_ns);
int64_t head_clock_ns(const struct head_clock *clock, int64_t t_ns);

/* The full second of the head's clock that begins at a device time in [from_ns, to_ns), at most a second
 * apart: 1, the first nanosecond of it and the TAI second, or 0. A jump is no edge; of two edges in the
 * interval, which only a jump can make, the later is given. */
int head_clock_edge(const struct head_clock *clock, int64_t from_ns, int64_t to_ns, int64_t *edge_ns, int64_t *tai_s);

#endif
