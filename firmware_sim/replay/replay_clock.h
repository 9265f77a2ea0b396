/* SPDX-License-Identifier: MIT */
/* The times of day of a recording that is played. A head has two: its own clock's, which may drift and jump, and that
 * of its GNSS receiver, which does not.
 *
 * In: telemetry and PPS events of the stream. Out: UTC at device times of the run. Telemetry has the head's clock to
 * the nanosecond, each second. A PPS event has the second of that clock that begins, and its text says whether it is a
 * leap second. The event's own time may be late (fault pps_jitter), so only whole seconds are taken from it: a jump
 * counts at once, and not only with the next telemetry.
 *
 * The receiver's time is not in the stream. It is taken to be that of the head's clock at the first telemetry, and goes
 * on with device time. Leap seconds are those that are known, and those that PPS events show. Where the head's clock has
 * fallen behind its receiver by half a second or more, its PPS event comes too late: the receiver's time has passed that
 * leap second, and goes on without it.
 *
 * A recording may have any numbers: times wrap instead of overflowing. Pure; the caller has the lock. */
#ifndef FIRMWARE_SIM_REPLAY_REPLAY_CLOCK_H
#define FIRMWARE_SIM_REPLAY_REPLAY_CLOCK_H

#include "core/utc.h"

/* The last pieces are kept. A drifting clock has a new one each second, and no session is so many seconds behind. */
enum { REPLAY_CLOCK_KEPT = 64 };

/* All 0: the time of day is not known. */
struct replay_clock {
    int64_t tai0_ns; /* of the receiver at device time 0 */
    struct utc_table table;
    uint64_t n; /* pieces of the head's clock so far; number i is at i % REPLAY_CLOCK_KEPT */
    struct replay_clock_piece {
        int64_t from_ns; /* device time */
        int64_t utc0_ns; /* at device time 0 */
    } piece[REPLAY_CLOCK_KEPT];
};

/* Sets both clocks by the first telemetry. A time of day that no calendar has is not known. */
void replay_clock_begin(struct replay_clock *clock, int64_t t_ns, int64_t utc_ns);
/* Renews clocks that have begun, by a frame that is played shift_ns later than it was recorded. */
void replay_clock_take(struct replay_clock *clock, const uint8_t *frame, int64_t shift_ns);
/* Shows the same times shift_ns later. */
void replay_clock_shift(struct replay_clock *clock, int64_t shift_ns);

/* UTC by the head's clock and by the receiver, ns since 1970 as POSIX counts. INT64_MIN: it is not known, or not within
 * 1970 to 2199 (core/utc.h). */
int64_t replay_clock_head_ns(const struct replay_clock *clock, int64_t t_ns);
int64_t replay_clock_receiver_ns(const struct replay_clock *clock, int64_t t_ns);
/* The receiver's UTC with seconds 60. Only where replay_clock_receiver_ns knows it. */
void replay_clock_receiver_utc(const struct replay_clock *clock, int64_t t_ns, struct utc_time *utc);

#endif
