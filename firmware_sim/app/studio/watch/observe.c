/* SPDX-License-Identifier: MIT */
/* The observer: reads the stream as any client does, and takes some of its points to the scene's frame. */
#include <math.h>
#include <string.h>
#include <sys/resource.h>
#include <unistd.h>

#include "drivers/protocol/native.h"
#include "firmware_sim/app/studio/watch/inside.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/command/head.h"

enum { NEXT_MS = 100, QUIET = 20 };
/* The stream comes tick by tick. When nothing is there, the observer sleeps for this time, since larger pieces cost
 * less to read. The socket and the link's queue hold what comes meanwhile. */
static const int64_t NAP_NS = 4000000;
static const int64_t PUBLISH_NS = 500000000;

/* ---- scans */

static int is_about(const struct georef *georef, const struct scanhead_info *info)
{
    double d[3];
    georef_difference(georef, info->anchor, d);
    return fabs(d[0]) <= info->scale[0] && fabs(d[1]) <= info->scale[1] && fabs(d[2]) <= info->scale[2];
}

/* Makes now_georef from `of`, the station's georeference, with its centre at the place in the stream: the station may
 * have moved since the scan began. Returns 0 if `of` is NULL, or if now_georef does not give the stream's anchor. */
static int follow_georef(struct watch *w, const struct georef *of, const struct scanhead_info *info)
{
    struct sh_err err;
    if (of == NULL || georef_recentre(of, info->station_m, &w->now_georef, &err) != SH_OK) return 0;
    return is_about(w->now_georef, info);
}

static void let_go(struct watch *w)
{
    device_give_back(w->held);
    w->held = NULL;
    georef_free(w->now_georef);
    w->now_georef = NULL;
}

/* Takes the settings and the place of the scan, and returns the site that has them. Where the scan is over already, the
 * function takes the configuration's settings, at the place that the stream says. */
static const struct site *find_head(struct watch *w, const struct scanhead_info *info)
{
    const uint32_t station = info->station - 1;
    const struct site *site = device_hold_scan(w->options.device, info->scan, &w->held);
    if (site != NULL) report_head_of(site, station, &w->now);
    if (!w->site->moving) memcpy(w->now.setup.station_m, info->station_m, sizeof w->now.setup.station_m);
    memcpy(w->now.setup.rotation, info->rotation, sizeof w->now.setup.rotation);
    if (site == NULL) site = w->site;
    site_set_program(site, llround(info->prr_hz * 1e6), &w->now.setup);
    return site;
}

/* Only the number and the station of this scan are known, so its points can't be taken. */
static void begin_unknown(struct watch *w, uint32_t scan, uint32_t station)
{
    let_go(w);
    w->begun = scan;
    w->at = (struct watch_scan){.scan = scan, .station = station};
    w->now = w->head[station - 1];
    watch_sample_begin(w);
    watch_seen_begin(&w->seen, station);
}

/* Sets up the head for this scan: as the device has it, with the place and the rate from the stream. */
static void begin_scan(struct watch *w, const struct scanhead_info *info)
{
    begin_unknown(w, info->scan, info->station);
    const struct site *site = find_head(w, info);
    w->at.in_scene = !info->geo || info->crs == 0 ||
                     (!info->moving && follow_georef(w, site->station[info->station - 1].georef, info));
    w->began_ns = clock_now_ns();
    w->began_thread_ns = clock_thread_ns();
}

/* The end of an earlier scan may be found after that of a later one, which had no points. */
static void note_end(struct watch *w, uint32_t scan)
{
    if (scan > atomic_load(&w->ended)) atomic_store(&w->ended, scan);
}

static void end_scan(struct watch *w)
{
    if (w->at.scan == 0 || w->at.over) return;
    w->at.over = 1;
    note_end(w, w->at.scan);
    watch_publish(w);
    w->at.in_scene = 0; /* no more points of this scan come, and its site is given back */
    let_go(w);
}

/* 0: points can't be taken yet. */
static int follow_scan(struct watch *w)
{
    struct scanhead_info info;
    if (scanhead_get_info(w->sh, &info) != SCANHEAD_OK) return 0;
    if (info.station < 1 || info.station > w->site->n_stations) return 0;
    if (info.scan != w->at.scan || info.station != w->at.station) {
        end_scan(w);
        begin_scan(w, &info);
    }
    return 1;
}

/* ---- points */

static int to_scene(struct watch *w, struct scanhead_point *point, double p_m[3])
{
    struct scanhead_info info;
    if (scanhead_get_info(w->sh, &info) != SCANHEAD_OK) return 0;
    if (!info.geo && scanhead_to_scene(w->sh, point, 1, NULL) != 0) return 0;
    const double p[3] = {point->x, point->y, point->z};
    memcpy(p_m, p, sizeof p);
    if (w->now_georef != NULL) {
        double d[3];
        georef_difference(w->now_georef, p, d);
        georef_reverse(w->now_georef, d, p_m);
    }
    return isfinite(p_m[0]) && isfinite(p_m[1]) && isfinite(p_m[2]);
}

static void take_point(struct watch *w, const struct scanhead_frame *frame, uint32_t i, uint32_t hash)
{
    struct scanhead_point point;
    double p_m[3];
    if (scanhead_points(w->sh, frame, i, &point, 1) != 1) return;
    if (to_scene(w, &point, p_m)) watch_sample_add(w, p_m, hash);
}

/* Fibonacci hashing gives unrelated hashes to neighbouring pulses, on one line and on neighbouring lines. */
static uint32_t hash_of(uint64_t pulse)
{
    const uint64_t h = pulse * 0x9e3779b97f4a7c15ULL;
    return (uint32_t)(h >> 32 ^ h >> 13);
}

/* Echoes of one pulse follow each other, with the same time. Only this loop runs for every point. */
static void observe_take_points(struct watch *w, const struct scanhead_frame *frame)
{
    const uint32_t keeps = w->at.in_scene ? w->sample.every - 1 : 0, n_surfaces = w->site->scene->n_surfaces;
    uint64_t pulse = frame->pulse0 - 1;
    if (w->at.over) return;
    uint32_t empty = 0, left_out = 0, hash = 0, last_dt = UINT32_MAX, last_echo = 0;
    for (uint32_t i = 0; i < frame->n_points; i++) {
        struct native_point p;
        native_decode_point(frame->payload, i, &p);
        if (p.dt_ns != last_dt || p.echo <= last_echo) hash = hash_of(++pulse);
        last_dt = p.dt_ns;
        last_echo = p.echo;
        if (p.echo_count == 0)
            empty++;
        else if (p.label >= n_surfaces && p.label != SCANHEAD_NO_LABEL)
            left_out++; /* on moving bodies, on legs, in mirrors */
        else if ((hash & keeps) == 0 && w->at.in_scene)
            take_point(w, frame, i, hash);
    }
    w->at.points += frame->n_points - empty;
    w->at.empty += empty;
    w->at.left_out += left_out;
    w->at.shots += frame->n_pulses;
    w->dirty = 1;
}

/* ---- the thread */

int watch_is_behind(void *watch)
{
    struct watch *w = watch;
    const uint32_t scan = device_last_scan(w->options.device, NULL);
    if (scan == 0 || scan == atomic_load(&w->ended) || atomic_load(&w->is_deaf)) return 0;
    return device_scan_ns(w->options.device) != 0;
}

/* The events of a scan's start and end, and all of its points, may be among the lost frames. */
static void take_telemetry(struct watch *w, const struct scanhead_frame *frame)
{
    struct native_telemetry t;
    if (native_decode_telemetry(frame->payload, frame->payload_len, &t) != SH_OK || t.scan == 0) return;
    if (t.state == HEAD_SCANNING || t.state == HEAD_SPIN_DOWN) return;
    note_end(w, t.scan);
    if (t.scan != w->at.scan && !follow_scan(w)) return;
    if (t.scan == w->at.scan) end_scan(w);
}

static void note_lost(struct watch *w, uint64_t in_all)
{
    w->missed = 1;
    pthread_mutex_lock(&w->lock);
    w->lost_frames = in_all;
    pthread_mutex_unlock(&w->lock);
}

static void observe_take_event(struct watch *w, const struct scanhead_frame *frame)
{
    const uint64_t a = frame->event_value[0];
    switch (frame->event) {
    case SCANHEAD_EV_READER_LOST:
        note_lost(w, frame->event_value[2]);
        break;
    case SCANHEAD_EV_SCAN_START:
        /* The event of the scan at hand can come after its first points. The head at hand numbers its scans on. */
        if ((uint32_t)a != w->at.scan) end_scan(w);
        w->begun = (uint32_t)a;
        break;
    case SCANHEAD_EV_SCAN_END:
        note_end(w, (uint32_t)a);
        end_scan(w);
        break;
    case SCANHEAD_EV_STATE: /* a scan that loses its power, also at a reboot, has no SCAN_END */
        if (a != HEAD_OFF && a != HEAD_BOOT) break;
        note_end(w, w->begun);
        end_scan(w);
        break;
    default:
        break;
    }
}

static void take_frame(struct watch *w, const struct scanhead_frame *frame)
{
    struct sh_err err;
    past_take(w->past, frame);
    if (frame->type == SCANHEAD_POINTS && follow_scan(w)) {
        observe_take_points(w, frame);
        if (w->sample.n - w->sample.done >= WATCH_BATCH && watch_sample_compare(w, &err) != SH_OK)
            w->sample.n = w->sample.done; /* no memory now: these are passed over */
    }
    if (frame->type == SCANHEAD_TELEMETRY) take_telemetry(w, frame);
    if (frame->type == SCANHEAD_EVENT) observe_take_event(w, frame);
}

/* Nothing has come for QUIET times NEXT_MS. At the pace `fast` no time passes for an idle head, so it sends no
 * telemetry: where the end of its scan was lost, nothing else says that it is over. The scan's descriptor may be lost,
 * too. */
static void rest(struct watch *w)
{
    uint32_t station;
    const uint32_t scan = device_last_scan(w->options.device, &station);
    if (!w->missed || scan == 0 || device_rests_from(w->options.device) == UINT64_MAX) return;
    if (w->at.scan != scan && !(follow_scan(w) && w->at.scan == scan)) begin_unknown(w, scan, station);
    end_scan(w);
}

/* Figures cost time, too: the more time they take, the less often they are worked out. */
static int is_due(const struct watch *w)
{
    const double share = w->options.cpu_share;
    const int64_t rest_ns = share > 0.0 ? (int64_t)((double)w->publish_ns / (0.25 * share)) : 0;
    return w->dirty && clock_now_ns() - w->published_ns >= (rest_ns > PUBLISH_NS ? rest_ns : PUBLISH_NS);
}

/* Takes the next frame. Where there is none yet the function sleeps first, unless the head waits for the observer. */
static int next_frame(const struct watch *w, struct scanhead_frame *frame)
{
    if (w->options.cpu_share > 0.0) {
        const int rc = scanhead_next(w->sh, frame, 0);
        if (rc != SCANHEAD_ETIMEOUT) return rc;
        clock_sleep_until_ns(clock_now_ns() + NAP_NS);
    }
    return scanhead_next(w->sh, frame, NEXT_MS);
}

void *watch_observe(void *watch)
{
    struct watch *w = watch;
    struct scanhead_frame frame;
    int quiet = 0;
    /* This lowers the processor priority of this thread alone; where that fails, the priority stays as it is. An
     * observer that the head waits for keeps the head's priority: else, on a busy machine, the whole head would be as
     * slow as the observer. */
    if (w->options.cpu_share > 0.0) setpriority(PRIO_PROCESS, (id_t)gettid(), WATCH_NICE);
    while (!atomic_load(&w->ending)) {
        const int rc = next_frame(w, &frame);
        quiet = rc == SCANHEAD_ETIMEOUT ? quiet + 1 : 0;
        if (rc == SCANHEAD_OK)
            take_frame(w, &frame);
        else if (rc != SCANHEAD_ETIMEOUT)
            break;
        else if (quiet % QUIET == 0)
            rest(w);
        if (is_due(w)) watch_publish(w);
    }
    atomic_store(&w->is_deaf, 1);
    if (w->dirty) watch_publish(w);
    let_go(w);
    return NULL;
}
