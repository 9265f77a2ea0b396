#include "firmware_sim/loop/loop.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>

#include "firmware_sim/loop/loop_inside.h"
#include "firmware_sim/loop/pump.h"

static const double SPARE_MS = 250.0; /* that a reader may be interrupted for within a copy, and no claim waits */

static int create_stream(struct loop *loop, struct sh_err *err)
{
    const struct config *cfg = loop->cfg;
    const int64_t tick_ns = device_tick_ns(loop->device);
    const double ticks_per_ms = 1e6 / (double)tick_ns;
    struct ring_size size = {.ahead_ticks = (uint64_t)(cfg->loop.ahead_ms * ticks_per_ms) + 1,
                             .queue_ticks = (uint64_t)(cfg->loop.queue_ms * ticks_per_ms) + 1,
                             .usual_bytes = worker_usual_bytes(loop->site)};
    size.spare_ticks = (uint64_t)(fmin(SPARE_MS, cfg->loop.queue_ms) * ticks_per_ms);
    loop->casters.ahead_ticks = size.ahead_ticks;
    loop->stream.tick_bytes = worker_tick_bytes(loop->site);
    loop->stream.waits = cfg->loop.pace != PACE_REALTIME;
    loop->stream.steps = cfg->loop.pace == PACE_STEP;
    loop->stream.seq = UINT32_C(0) - device_near_wrap(loop->device);
    loop->stream.counters = device_counters(loop->device);
    return stream_create(&loop->stream, &size, tick_ns, err);
}

/* Who joins before the head has said anything finds what it is. */
static void keep_description(struct loop *loop)
{
    struct device_work work;
    device_describe_now(loop->device, &work);
    const struct ring_tick *tick = worker_fill(loop->casters.caster[0].worker, &work);
    for (uint32_t at = 0; at < tick->len; at += (uint32_t)native_frame_len(tick->bytes + at))
        kept_put(&loop->stream.kept, tick->bytes + at);
}

int loop_create(const struct site *site, struct device *device, const struct loop_options *options, struct loop **out,
                struct sh_err *err)
{
    *out = NULL;
    struct loop *loop = calloc(1, sizeof *loop);
    if (loop == NULL) return sh_fail(err, SH_ENOMEM, "no memory");
    const struct config *cfg = site->cfg;
    loop->site = site;
    loop->cfg = cfg;
    loop->device = device;
    loop->options = *options;
    loop->links.stream = &loop->stream;
    loop->links.device = device;
    loop->links.report = options->report;
    mover_create(&loop->links.mover, device, &loop->stream);
    loop->links.web = options->web;
    atomic_store(&loop->final_tick, UINT64_MAX);
    int rc = create_stream(loop, err);
    if (rc == SH_OK) rc = casters_create(loop, config_threads(cfg), err);
    if (rc == SH_OK) keep_description(loop);
    if (rc == SH_OK) rc = links_open(&loop->links, cfg, options->extra, err);
    if (rc == SH_OK && cfg->platform.kind == PLATFORM_LIVE && cfg->loop.pace == PACE_REALTIME)
        rc = pose_feed_open(device, cfg, &loop->feed, err);
    if (rc != SH_OK) {
        loop_free(loop);
        return rc;
    }
    *out = loop;
    return SH_OK;
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

void loop_put_endpoints(const struct loop *loop, struct json *json)
{
    struct link_place place;
    json_open_object(json, NULL);
    json_open_array(json, "endpoints");
    for (uint32_t i = 0; loop_get_place(loop, i, &place); i++) {
        if (strcmp(place.type, link_ops_get(LINK_FD)->name) == 0) continue; /* nobody else reaches it */
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

/* What there is, so that nothing the pacing thread touches is paged out or in. Before the threads, whose
 * stacks would be locked whole. */
static void lock_memory(const struct loop *loop)
{
    if (loop->stream.waits || mlockall(MCL_CURRENT) == 0) return;
    sh_warn(loop->options.report, "memory not locked (%s): paging may delay the loop; raise RLIMIT_MEMLOCK",
            strerror(errno));
}

int loop_start(struct loop *loop, struct sh_err *err)
{
    lock_memory(loop);
    int rc = loop->options.hash ? hasher_start(&loop->stream, &loop->hasher, err) : SH_OK;
    if (rc == SH_OK && loop->feed != NULL) rc = pose_feed_start(loop->feed, err);
    if (rc == SH_OK) rc = links_start(&loop->links, err);
    if (rc == SH_OK) rc = pacer_start(loop, err);
    if (rc == SH_OK) rc = casters_start(loop, err);
    return rc;
}

int loop_is_over(const struct loop *loop)
{
    return atomic_load(&loop->stream.over) && atomic_load(&loop->links.n_busy) == 0;
}

void loop_end(struct loop *loop)
{
    device_end(loop->device);
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

void loop_join(struct loop *loop, struct loop_stats *stats)
{
    struct stream *stream = &loop->stream;
    memset(stats, 0, sizeof *stats);
    if (loop->casters.n_running < loop->casters.n || !loop->pacer.running) { /* a start that failed half-way */
        atomic_store(&loop->stopping, 1);
        if (!loop->pacer.running) stream_end(stream);
        stream_poke(stream);
    }
    casters_join(loop);
    pacer_join(loop);
    mover_join(&loop->links.mover);
    links_join(&loop->links);
    pose_feed_close(loop->feed);
    loop->feed = NULL;
    if (loop->hasher != NULL) stats->have_hash = hasher_join(loop->hasher, stats->sha256);
    loop->hasher = NULL;
    stats->counters = *stream->counters;
    stats->scans = device_scans(loop->device);
    stats->wall_s = 1e-9 * (double)(atomic_load(&stream->last_pulse_ns) - atomic_load(&stream->first_pulse_ns));
    stats->late_p50_us = pacer_late_us(loop, 0.5);
    stats->late_p999_us = pacer_late_us(loop, 0.999);
}
