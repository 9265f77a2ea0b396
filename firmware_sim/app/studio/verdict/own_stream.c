/* SPDX-License-Identifier: MIT */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "core/grow.h"
#include "firmware_sim/app/studio/record/offline.h"
#include "firmware_sim/app/studio/verdict/own_stream.h"
#include "firmware_sim/command/head.h"

enum { NEXT_MS = 200, AT_ONCE = 512 };

static void fall_short(struct own_stream *s, const char *why)
{
    if (s->short_of[0] == '\0') snprintf(s->short_of, sizeof s->short_of, "%s", why);
}

static int keep_place(struct own_stream *s)
{
    struct scanhead_info info;
    if (scanhead_get_info(s->sh, &info) != SCANHEAD_OK) return 0;
    if (s->have_info && !info.moving)
        s->is_moved |= memcmp(info.station_m, s->info.station_m, sizeof info.station_m) != 0 ||
                       memcmp(info.rotation, s->info.rotation, sizeof info.rotation) != 0;
    if (!s->have_info) s->info = info;
    s->have_info = 1;
    return 1;
}

/* Shots without echo are no points. */
static void keep_some(struct own_stream *s, const struct scanhead_point *point, int n)
{
    if (!grow(&s->xyz_m, &s->room, s->n + (size_t)n, sizeof *s->xyz_m)) {
        fall_short(s, "no memory for the head's points; a shorter --duration needs less");
        return;
    }
    for (int i = 0; i < n; i++) {
        if (isnan(point[i].x)) continue;
        double *p = s->xyz_m[s->n++];
        p[0] = point[i].x;
        p[1] = point[i].y;
        p[2] = point[i].z;
    }
}

static void keep_points(struct own_stream *s, const struct scanhead_frame *frame)
{
    struct scanhead_point point[AT_ONCE];
    int n;
    if (!keep_place(s) || !grow(&s->frame, &s->room_frames, s->n_frames + 1, sizeof *s->frame)) {
        fall_short(s, "points came before their descriptor, or memory was short");
        return;
    }
    for (uint32_t at = 0; at < frame->n_points; at += (uint32_t)n) {
        n = scanhead_points(s->sh, frame, at, point, AT_ONCE);
        if (n <= 0) break;
        if (s->info.moving && !s->info.geo) scanhead_to_scene(s->sh, point, (uint32_t)n, NULL);
        keep_some(s, point, n);
    }
    s->frame[s->n_frames++] = (struct own_frame){frame->seq, frame->t_ns, s->n};
}

/* The head's state is in its events, and in its telemetry each second (EVENTS.md). */
static void see_state(struct own_stream *s, const struct scanhead_frame *frame)
{
    uint64_t state;
    if (frame->type == SCANHEAD_EVENT && frame->event == SCANHEAD_EV_STATE)
        state = frame->event_value[0];
    else if (frame->type == SCANHEAD_TELEMETRY && frame->payload_len >= 4)
        state = le_get32(frame->payload);
    else
        return;
    if (state != HEAD_OFF && state != HEAD_BOOT) atomic_store(&s->is_up, 1);
}

static void *own_stream_read(void *arg)
{
    struct own_stream *s = arg;
    struct scanhead_frame frame;
    struct scanhead_stats stats;
    int rc;
    while ((rc = scanhead_next(s->sh, &frame, NEXT_MS)) == SCANHEAD_OK || rc == SCANHEAD_ETIMEOUT) {
        if (rc == SCANHEAD_OK) see_state(s, &frame);
        if (rc != SCANHEAD_OK || frame.type != SCANHEAD_POINTS) continue;
        if (s->keeps) keep_points(s, &frame);
        atomic_store(&s->points_ns, frame.t_ns);
    }
    scanhead_get_stats(s->sh, &stats);
    if (stats.reader_lost != 0) fall_short(s, "this machine was too slow to keep the head's points");
    return NULL;
}

int own_stream_open(struct own_stream *s, struct sh_err *err)
{
    s->link.waits = LINK_WAITS_YES;
    const int fd = offline_connect("the head's own stream", &s->link, &s->sh, err);
    return fd < 0 ? fd : SH_OK;
}

int own_stream_start(struct own_stream *s, struct sh_err *err)
{
    s->running = pthread_create(&s->thread, NULL, own_stream_read, s) == 0;
    return s->running ? SH_OK : sh_fail(err, SH_EIO, "no thread for the head's own stream");
}

void own_stream_join(struct own_stream *s)
{
    if (s->running) pthread_join(s->thread, NULL);
}

void own_stream_close(struct own_stream *s)
{
    scanhead_close(s->sh);
    free(s->frame);
    free(s->xyz_m);
}
