/* SPDX-License-Identifier: MIT */
/* A recording as the source of the loop. */
#include "firmware_sim/replay/replay.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/protocol/native.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/replay/replay_state.h"

enum { USUAL_MOST_BYTES = 1 << 17, NATIVE_RATE_BYTES = 2 * NATIVE_POINT_LEN };

/* ---- the source */

struct wishes {
    int over, starts, idle; /* idle: nothing is played, and time need not pass */
    int paces, paused;      /* paces: another speed holds from now on */
};

/* is_late: frames of the tick before are still to be sent. A new round, and the run's end, wait for them. */
static struct wishes take_wishes(struct replay *r, uint64_t tick, int is_late)
{
    struct wishes wishes;
    pthread_mutex_lock(&r->lock);
    const int stops = r->wants_stop && r->playing, ready = r->n_clients >= (int)r->options.clients;
    if (r->wants_stop) r->wants_again = r->wants_seek = 0;
    r->wants_stop = 0;
    if (stops) r->stopped = r->n_changes + 1;
    wishes.starts = !is_late && ((r->wants_start && ready) || r->wants_again || r->wants_seek);
    if (wishes.starts) {
        if (!r->wants_again) r->begun = r->n_changes + 1; /* replay_begin adds a change */
        r->begin_s = r->wants_seek ? r->seek_s : r->options.from_s;
        r->wants_start = r->wants_again = r->wants_seek = 0;
        r->playing = 1;
    }
    wishes.paces = r->speed_changed && r->playing && !wishes.starts;
    wishes.paused = r->speed == 0.0;
    r->speed_changed = 0;
    const int waits = !r->ends_then || r->wants_start, plays = r->playing;
    wishes.over = !is_late && (r->ending || tick >= r->end_tick || (!waits && !plays));
    wishes.idle =
        !is_late && !stops && !wishes.starts && (wishes.paused || (waits && !plays)) && r->end_tick == UINT64_MAX;
    pthread_mutex_unlock(&r->lock);
    if (stops) replay_stop(r, tick, 0);
    return wishes;
}

static void replay_count(struct replay *r)
{
    atomic_fetch_add(&r->counters.fired, r->tick.n_fired);
    atomic_fetch_add(&r->counters.cast, r->tick.n_cast);
}

static enum loop_source_tick next(void *self, uint64_t tick, int may_idle, int again, struct ring_tick *out)
{
    struct replay *r = self;
    if (!again) {
        r->len = 0;
        r->tick = (struct ring_tick){.scan = r->tick.scan};
    }
    const struct wishes wishes = take_wishes(r, tick, again);
    if (wishes.over) return LOOP_SOURCE_OVER;
    if (wishes.idle && may_idle) return LOOP_SOURCE_IDLE;
    if (wishes.starts) replay_begin(r, tick);
    if (wishes.paces && !wishes.paused) replay_pace(r, tick);
    if (r->playing && !wishes.paused) {
        const struct ring_tick before = r->tick;
        r->tick = (struct ring_tick){.scan = before.scan};
        /* Time without frames passes at once only where nobody counts it. --duration and the protocols of devices
         * count it. */
        replay_fill(r, tick, may_idle && r->end_tick == UINT64_MAX && !r->is_device);
        replay_count(r);
        r->tick.n_cast += before.n_cast;
        r->tick.n_fired += before.n_fired;
        r->tick.n_lines += before.n_lines;
        ring_hits_add(&r->tick.hits, &before.hits);
    }
    *out = r->tick;
    out->bytes = r->bytes;
    out->len = r->len;
    out->shift_ns = r->shift_ns;
    return LOOP_SOURCE_TICK;
}

static void replay_describe(void *self, struct ring_tick *tick)
{
    struct replay *r = self;
    uint32_t len = 0;
    for (int i = 0; i < REPLAY_FRONT; i++) {
        memcpy(r->bytes + len, r->front.bytes[i], r->front.len[i]);
        len += r->front.len[i];
    }
    *tick = (struct ring_tick){.bytes = r->bytes, .len = len};
}

static uint32_t most_bytes(const void *self)
{
    (void)self;
    return REPLAY_MOST_BYTES + REPLAY_FRONT * REPLAY_FRONT_ROOM;
}

static uint32_t usual_bytes(const void *self)
{
    const struct replay *r = self;
    const double pulses = 1e-6 * (double)r->cfg->head.settings.prr_uhz * 1e-9 * (double)r->tick_ns;
    const double bytes = 4096.0 + NATIVE_RATE_BYTES * pulses;
    return bytes < USUAL_MOST_BYTES ? (uint32_t)bytes : USUAL_MOST_BYTES;
}

static struct fault_board *faults(const void *self)
{
    return ((const struct replay *)self)->faults;
}

static uint64_t rests_from(void *self)
{
    struct replay *r = self;
    pthread_mutex_lock(&r->lock);
    const int plays = r->playing || r->wants_start || r->wants_again || r->wants_seek;
    const uint64_t tick = r->n_changes == 0 ? 0 : r->change[(r->n_changes - 1) % REPLAY_CHANGES].tick + 1;
    pthread_mutex_unlock(&r->lock);
    return plays ? UINT64_MAX : tick;
}

static struct device_power_up last_power(void *self, int64_t t_ns)
{
    (void)self, (void)t_ns;
    return (struct device_power_up){.ons = 1};
}

static int64_t tick_ns(const void *self)
{
    return ((const struct replay *)self)->tick_ns;
}

static int files_fill(const void *self)
{
    return fault_board_is_filling(((const struct replay *)self)->faults);
}

static int close_files(void *self, struct sh_err *err)
{
    return fault_board_close(((struct replay *)self)->faults, err);
}

static struct device_counters *counters(void *self)
{
    return &((struct replay *)self)->counters;
}

static uint64_t scans(void *self)
{
    struct replay *r = self;
    pthread_mutex_lock(&r->lock);
    const uint64_t n = r->scans;
    pthread_mutex_unlock(&r->lock);
    return n;
}

static const struct talk *talk(const void *self, uint32_t link, const struct talk_options **options)
{
    const struct replay *r = self;
    *options = &r->options.talk_options;
    return r->options.talk != NULL && link < r->cfg->n_links ? r->options.talk[link] : NULL;
}

static void replay_end(void *self)
{
    struct replay *r = self;
    pthread_mutex_lock(&r->lock);
    r->ending = 1;
    pthread_mutex_unlock(&r->lock);
}

const struct loop_source_ops replay_source = {
    .command = replay_command,
    .overlong = replay_overlong,
    .command_once = replay_command_once,
    .date_ns = replay_date_ns,
    .next_fix_ns = replay_next_fix_ns,
    .fix = replay_fix,
    .pps = replay_pps,
    .session_opened = replay_session_opened,
    .session_closed = replay_session_closed,
    .session_over = replay_session_over,
    .report = replay_report,
    .faults = faults,
    .rests_from = rests_from,
    .last_power = last_power,
    .talk = talk,
    .tick_ns = tick_ns,
    .counters = counters,
    .scans = scans,
    .end = replay_end,
    .files_fill = files_fill,
    .close_files = close_files,
    .most_bytes = most_bytes,
    .usual_bytes = usual_bytes,
    .describe = replay_describe,
    .next = next,
};

/* ---- open and close */

int replay_open(struct config *cfg, const struct replay_options *options, struct replay **out, struct sh_err *err)
{
    *out = NULL;
    struct replay *r = calloc(1, sizeof *r);
    if (r == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    pthread_mutex_init(&r->lock, NULL);
    r->cfg = cfg;
    r->options = *options;
    r->tick_ns = llround(1e9 / cfg->loop.tick_hz);
    r->n_ticks = (uint64_t)ceil(options->duration_s * cfg->loop.tick_hz);
    r->end_tick = options->duration_s > 0.0 && !options->start ? r->n_ticks : UINT64_MAX;
    r->wants_start = options->start;
    r->speed = options->speed > 0.0 ? options->speed : 1.0;
    r->loop = options->loop;
    for (uint32_t i = 0; i < cfg->n_links; i++)
        r->n_clients -= !replay_has_clients(&cfg->link[i]);
    r->ends_then = options->start && !options->loop;
    r->bytes = malloc(REPLAY_MOST_BYTES + REPLAY_FRONT * REPLAY_FRONT_ROOM);
    int rc = r->bytes != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory");
    if (rc == SH_OK) rc = replay_open_recording(r, err);
    if (rc == SH_OK)
        rc = fault_board_create(&cfg->faults, options->truth, &r->counters.lost_truth_lines, &r->faults, err);
    r->desk = (struct fault_desk){.cfg = cfg, .board = r->faults, .no_head = 1};
    if (rc != SH_OK) {
        replay_free(r);
        return rc;
    }
    *out = r;
    return SH_OK;
}

void replay_free(struct replay *r)
{
    if (r == NULL) return;
    recording_close(&r->recording);
    fault_board_free(r->faults);
    pthread_mutex_destroy(&r->lock);
    free(r->bytes);
    free(r);
}

void replay_get_summary(struct replay *r, struct replay_summary *summary)
{
    struct scanhead_stats stats = {0};
    if (r->recording.stream != NULL) recording_stats(&r->recording, &stats);
    pthread_mutex_lock(&r->lock);
    *summary = (struct replay_summary){.times = r->times,
                                       .frames = r->frames,
                                       .bad_bytes = stats.bad_bytes,
                                       .repeated = stats.repeated,
                                       .late = stats.late,
                                       .refused = stats.refused,
                                       .cut = stats.cuts != 0};
    snprintf(summary->idn, sizeof summary->idn, "%s", r->idn);
    pthread_mutex_unlock(&r->lock);
}

int replay_check(struct replay *r, struct sh_err *err)
{
    return r->failure.code != 0 ? sh_fail(err, r->failure.code, "%s", r->failure.text) : SH_OK;
}
