/* SPDX-License-Identifier: MIT */
#include "firmware_sim/loop/loop.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/loop/loop_inside.h"
#include "firmware_sim/loop/pump.h"
#include "firmware_sim/site/waves.h"

/* A reader may be interrupted while it copies a tick. It has this time to go on, before a caster that claims the tick's
 * slot has to wait for the reader. */
static const double SPARE_MS = 250.0;

static int create_stream(struct loop *loop, struct sh_err *err)
{
    const struct config *cfg = loop->cfg;
    const struct loop_source *source = &loop->source;
    const int64_t tick_ns = source->ops->tick_ns(source->self);
    const int makes = source->ops->next != NULL;
    const double ticks_per_ms = 1e6 / (double)tick_ns;
    struct ring_size size = {.ahead_ticks = (uint64_t)(cfg->loop.ahead_ms * ticks_per_ms) + 1,
                             .queue_ticks = (uint64_t)(cfg->loop.queue_ms * ticks_per_ms) + 1,
                             .usual_bytes =
                                 makes ? source->ops->usual_bytes(source->self) : worker_usual_bytes(loop->site)};
    size.spare_ticks = (uint64_t)(fmin(SPARE_MS, cfg->loop.queue_ms) * ticks_per_ms);
    loop->casters.ahead_ticks = size.ahead_ticks;
    loop->stream.tick_bytes = makes ? source->ops->most_bytes(source->self) : worker_tick_bytes(loop->site);
    loop->stream.as_they_are = makes;
    loop->stream.waits = cfg->loop.pace != PACE_REALTIME;
    loop->stream.steps = cfg->loop.pace == PACE_STEP;
    loop->stream.seq = loop->stream.first_seq = makes ? 0 : UINT32_C(0) - device_last_power(loop->device, 0).near_wrap;
    loop->stream.counters = source->ops->counters(source->self);
    return stream_create(&loop->stream, &size, tick_ns, err);
}

/* A client that joins before the first tick finds the head's description. */
static int keep_description(struct loop *loop, struct sh_err *err)
{
    struct device_work work;
    struct ring_slot slot = {0}; /* of its own: the first tick is still to come */
    struct ring_tick *tick = &slot.tick;
    int rc = SH_OK;
    if (loop->device == NULL) {
        loop->source.ops->describe(loop->source.self, tick);
    } else {
        device_describe_now(loop->device, &work);
        rc = worker_fill(loop->casters.caster[0].worker, &work, &slot);
    }
    for (uint32_t at = 0; at < tick->len; at += (uint32_t)native_frame_len(tick->bytes + at))
        latched_put(&loop->stream.latched, tick->bytes + at);
    free(slot.longer);
    return rc == SH_OK ? SH_OK : sh_fail(err, rc, "no memory");
}

/* Makes a new loop, with nothing open. */
static struct loop *loop_begin(const struct config *cfg, const struct loop_source *source,
                               const struct loop_options *options)
{
    struct loop *loop = calloc(1, sizeof *loop);
    if (loop == NULL) return NULL;
    loop->cfg = cfg;
    loop->source = *source;
    loop->options = *options;
    loop->links.stream = &loop->stream;
    loop->links.source = &loop->source;
    loop->links.report = options->report;
    loop->links.observer = options->observer;
    return loop;
}

static int open_all(struct loop *loop, struct loop **out, struct sh_err *err)
{
    const struct config *cfg = loop->cfg;
    const int computes = loop->device != NULL;
    mover_create(&loop->links.mover, loop->device, &loop->stream);
    loop->links.web = loop->options.web;
    atomic_store(&loop->final_tick, UINT64_MAX);
    int rc = create_stream(loop, err);
    if (rc == SH_OK) rc = casters_create(loop, computes ? config_threads(cfg) : 0, err);
    if (!computes) loop->stream.n_casters = 1; /* the player */
    if (rc == SH_OK) rc = keep_description(loop, err);
    if (rc == SH_OK) rc = links_open(&loop->links, cfg, loop->options.extra, err);
    if (rc == SH_OK && computes && cfg->platform.kind == PLATFORM_LIVE && cfg->loop.pace == PACE_REALTIME)
        rc = pose_feed_open(loop->device, cfg, &loop->feed, err);
    if (rc != SH_OK) {
        loop_free(loop);
        return rc;
    }
    *out = loop;
    return SH_OK;
}

int loop_create(const struct site *site, struct device *device, const struct loop_options *options, struct loop **out,
                struct sh_err *err)
{
    const struct loop_source source = {&loop_device_source, device};
    struct loop *loop = loop_begin(site->cfg, &source, options);
    *out = NULL;
    if (loop == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    loop->site = site;
    loop->device = device;
    loop->links.waves_bytes_s = site_wave_bytes_s(site);
    return open_all(loop, out, err);
}

int loop_create_of(const struct config *cfg, const struct loop_source *source, const struct loop_options *options,
                   struct loop **out, struct sh_err *err)
{
    struct loop *loop = loop_begin(cfg, source, options);
    *out = NULL;
    if (loop == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    return open_all(loop, out, err);
}

void loop_free(struct loop *loop)
{
    if (loop == NULL) return;
    pose_feed_close(loop->feed);
    links_close(&loop->links);
    casters_free(loop);
    stream_free(&loop->stream);
    free(loop);
}

int loop_get_place(const struct loop *loop, uint32_t i, struct link_place *place)
{
    if (i < loop->links.n) {
        pump_get_place(loop->links.pump[i], place);
        return 1;
    }
    if (i > loop->links.n || loop->feed == NULL) return 0;
    *place = (struct link_place){.type = "pose"};
    pose_feed_endpoint(loop->feed, place->endpoint, sizeof place->endpoint);
    return 1;
}

int loop_get_counts(const struct loop *loop, uint32_t i, struct link_counts *counts)
{
    if (i >= loop->links.n) return 0;
    pump_get_counts(loop->links.pump[i], counts);
    return 1;
}

void loop_put_endpoints(const struct loop *loop, struct json *json)
{
    struct link_place place;
    json_open_object(json, NULL);
    json_open_array(json, "endpoints");
    for (uint32_t i = 0; loop_get_place(loop, i, &place); i++) {
        if (strcmp(place.type, link_ops_get(LINK_FD)->name) == 0) continue; /* no other program can open it */
        json_open_object(json, NULL);
        json_string(json, "type", place.type);
        json_string(json, "endpoint", place.endpoint);
        if (place.protocol != NULL) json_string(json, "protocol", place.protocol);
        json_close_object(json);
    }
    json_close_array(json);
    json_close_object(json);
}

void loop_put_links(const struct loop *loop, struct json *json)
{
    json_open_array(json, "links");
    for (uint32_t i = 0; i < loop->links.n; i++) {
        struct link_place place;
        struct link_counts counts;
        pump_get_place(loop->links.pump[i], &place);
        pump_get_counts(loop->links.pump[i], &counts);
        json_open_object(json, NULL);
        json_string(json, "endpoint", place.endpoint);
        json_string(json, "protocol", place.protocol);
        json_uint(json, "received_pulses", counts.received_pulses);
        json_uint(json, "left_out_pulses", counts.left_out_pulses);
        json_uint(json, "left_out_frames", counts.left_out_frames);
        json_uint(json, "sent_units", counts.sent_units);
        json_uint(json, "lost_units", counts.lost_units);
        json_uint(json, "lost_points", counts.lost_points);
        json_uint(json, "unsent_pulses", counts.unsent_pulses);
        json_uint(json, "wrong_requests", counts.wrong_requests);
        json_uint(json, "lost_input_bytes", counts.lost_input_bytes);
        json_close_object(json);
    }
    json_close_array(json);
}

/* Locks the memory that is allocated now, so that nothing the pacing thread touches is paged out or in. The function is
 * called before the threads start, since else their whole stacks would be locked. */
static void lock_memory(const struct loop *loop)
{
    if (loop->stream.waits || mlockall(MCL_CURRENT) == 0) return;
    sh_warn(loop->options.report, "memory not locked (%s): paging may delay the loop; raise RLIMIT_MEMLOCK",
            strerror(errno));
}

/* Only a SICK scanner in real time asks a time server. While a journal is replayed, the scanner does not: the journal
 * has the effects of the server's answers. */
static int asks_time(const struct loop *loop)
{
    const int asks = config_speaks(loop->cfg, PROTOCOL_COLA);
    return asks && loop->device != NULL && !loop->stream.waits && !device_replays(loop->device);
}

int loop_start(struct loop *loop, struct sh_err *err)
{
    lock_memory(loop);
    int rc = loop->options.hash ? hasher_start(&loop->stream, &loop->hasher, err) : SH_OK;
    if (rc == SH_OK && loop->feed != NULL) rc = pose_feed_start(loop->feed, err);
    if (rc == SH_OK) rc = links_start(&loop->links, err);
    if (rc == SH_OK) rc = pacer_start(loop, err);
    if (rc == SH_OK) rc = loop->device != NULL ? casters_start(loop, err) : player_start(loop, err);
    if (rc == SH_OK && asks_time(loop))
        rc = time_client_start(loop->device, loop->pacer.pace.epoch_ns, &loop->client, err);
    if (rc == SH_OK && loop->device != NULL) loop->cost = cost_watch_start(loop);
    return rc;
}

int loop_is_over(const struct loop *loop)
{
    return atomic_load(&loop->stream.over) && atomic_load(&loop->links.n_busy) == 0;
}

void loop_end(struct loop *loop)
{
    loop->source.ops->end(loop->source.self);
    atomic_store(&loop->stream.ending, 1);
    if (loop->cfg->loop.pace == PACE_STEP) atomic_store(&loop->stream.granted, UINT64_MAX);
    stream_poke(&loop->stream);
}

int loop_check_links(const struct loop *loop, struct sh_err *err)
{
    const struct links *links = &loop->links;
    if (!atomic_load(&links->failed)) return SH_OK;
    return sh_fail(err, links->error.code, "%s", links->error.text);
}

int loop_close_files(struct loop *loop, struct loop_stats *stats, struct sh_err *err)
{
    const int rc = loop->source.ops->close_files(loop->source.self, err);
    stats->counters = *loop->stream.counters;
    return rc;
}

void loop_join(struct loop *loop, struct loop_stats *stats)
{
    struct stream *stream = &loop->stream;
    memset(stats, 0, sizeof *stats);
    const int made = loop->device != NULL ? loop->casters.n_running == loop->casters.n : loop->player.running;
    if (!made || !loop->pacer.running) { /* the start failed half-way */
        atomic_store(&loop->stopping, 1);
        if (!loop->pacer.running) stream_end(stream);
        stream_poke(stream);
    }
    casters_join(loop);
    cost_watch_join(loop->cost);
    loop->cost = NULL;
    player_join(loop);
    pacer_join(loop);
    mover_join(&loop->links.mover);
    time_client_join(loop->client);
    loop->client = NULL;
    links_join(&loop->links);
    pose_feed_close(loop->feed);
    loop->feed = NULL;
    if (loop->hasher != NULL) stats->have_hash = hasher_join(loop->hasher, stats->sha256);
    loop->hasher = NULL;
    stats->counters = *stream->counters;
    stats->scans = loop->source.ops->scans(loop->source.self);
    stats->wall_s = 1e-9 * (double)(atomic_load(&stream->last_pulse_ns) - atomic_load(&stream->first_pulse_ns));
    stats->late = &loop->pacer.pace.late;
    stats->wake = &loop->pacer.pace.wake;
}
