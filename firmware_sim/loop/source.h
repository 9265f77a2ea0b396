/* SPDX-License-Identifier: MIT */
/* The contract of a source, which the loop serves: a head that computes, or a recording that is replayed.
 *
 * In: command lines of sessions. Out: their replies; and, where the source makes its ticks itself, the frames of each.
 * The head is device_source.c: casters compute its ticks. A recording is firmware_sim/replay: one thread takes its
 * ticks (player.h). Recorded frames keep their numbers in the stream. */
#ifndef FIRMWARE_SIM_LOOP_SOURCE_H
#define FIRMWARE_SIM_LOOP_SOURCE_H

#include "firmware_sim/device/device.h"
#include "firmware_sim/loop/ring.h"

enum loop_source_tick { LOOP_SOURCE_OVER = -1, LOOP_SOURCE_IDLE, LOOP_SOURCE_TICK };

/* self is the source's own. Any thread, unless a member says otherwise. Members named like a function of device.h do
 * what that function does. */
struct loop_source_ops {
    /* ---- sessions */
    void (*command)(void *self, uint32_t session, const char *line, uint64_t released, struct command_result *out);
    void (*overlong)(void *self, uint32_t session, struct command_result *out);
    void (*session_opened)(void *self, uint32_t session, const char *who);
    void (*session_closed)(void *self, uint32_t session, const char *who, int partial);
    /* A session that was opened is over, whatever its protocol; a client may have sent its last command long before.
     * NULL: the source does not count them. */
    void (*session_over)(void *self);
    void (*report)(void *self, int number, const char *text);
    struct fault_board *(*faults)(const void *self);
    uint64_t (*rests_from)(void *self);
    /* ---- sessions of other protocols than the native one. NULL: there are none. */
    void (*command_once)(void *self, uint32_t session, const char *line, uint64_t released, struct command_result *out);
    int64_t (*date_ns)(void *self, int64_t t_ns); /* UTC where it is known; else the time since power-up */
    int64_t (*next_fix_ns)(void *self, int64_t t_ns);
    int (*fix)(void *self, int64_t t_ns, struct nmea_fix *fix);
    struct device_power_up (*last_power)(void *self, int64_t t_ns);
    enum protocol_pps (*pps)(void *self, int64_t t_ns, int64_t *hour_ns);
    int (*store)(void *self, const char *name, const char *text);
    int (*stored)(const void *self, const char *name, char text[SETTINGS_FILE_TEXT]);
    double (*window_loss_db)(void *self); /* NULL: 0 */
    /* The conversation that a link of the protocol `capture`, counted from 0, has; NULL: the source has none. */
    const struct talk *(*talk)(const void *self, uint32_t link, const struct talk_options **options);

    /* ---- the run */
    int64_t (*tick_ns)(const void *self);
    struct device_counters *(*counters)(void *self);
    uint64_t (*scans)(void *self);
    /* The run begins, with the thread that paces it. NULL: there is nothing to do. */
    int (*power_up)(void *self, int64_t now_ns, const char **warning, struct sh_err *err);
    void (*end)(void *self);
    /* True while the buffer of a file that the source writes is more than a quarter full. At a pace other than
     * `realtime`, the loop waits as long as the function returns true. Takes no lock. */
    int (*files_fill)(const void *self);
    /* After all threads have ended: writes these files to their end. */
    int (*close_files)(void *self, struct sh_err *err);

    /* ---- where the source makes its ticks itself; else NULL. One thread, the player's. */
    /* Returns an upper bound of a tick's bytes. */
    uint32_t (*most_bytes)(const void *self);
    uint32_t (*usual_bytes)(const void *self);
    /* Descriptor, emitter and anchor, for clients that join before the first tick. */
    void (*describe)(void *self, struct ring_tick *tick);
    /* Makes the next tick, number `tick`. The tick's bytes stay until the next call. OVER: the run ends before it.
     * IDLE: nothing happens without a command; returned only where `may_idle`. again: the frames of the tick before
     * could not be sent; they go before those of this one. */
    enum loop_source_tick (*next)(void *self, uint64_t tick, int may_idle, int again, struct ring_tick *out);
};

struct loop_source {
    const struct loop_source_ops *ops;
    void *self;
};

extern const struct loop_source_ops loop_device_source; /* self: the struct device */

static inline void source_report(const struct loop_source *source, int number, const char *text)
{
    source->ops->report(source->self, number, text);
}

#endif
