/* SPDX-License-Identifier: MIT */
/* /quality: the observer stores figures, and each request gets the latest ones. */
#include <math.h>

#include "firmware_sim/app/studio/page_json.h"
#include "firmware_sim/app/studio/watch/inside.h"
#include "firmware_sim/base/clock.h"
#include "firmware_sim/base/json.h"
#include "firmware_sim/config/places.h"

/* ---- the observer */

static void show(struct watch *w)
{
    const struct watch_seen *seen = &w->seen;
    pthread_mutex_lock(&w->lock);
    w->shown = w->at;
    if (w->at.station != 0) w->shown_station[w->at.station - 1] = w->at;
    w->shown_seen = seen->n_seen;
    w->shown_share = seen->coverage != NULL ? seen->seen_m2 / seen->area_m2 : (double)NAN;
    pthread_mutex_unlock(&w->lock);
}

void watch_publish(struct watch *w)
{
    const int64_t from_ns = clock_thread_ns();
    struct sh_err err;
    if (w->at.scan == 0) return;
    /* Where memory is short now, the earlier figures stay. */
    if (watch_sample_compare(w, &err) == SH_OK && watch_sample_figures(w, &err) == SH_OK) {
        w->at.seen_share = watch_seen_count(&w->seen, w->at.station, w->site->n_stations);
        show(w);
    }
    w->dirty = 0;
    w->published_ns = clock_now_ns();
    w->publish_ns = clock_thread_ns() - from_ns;
}

/* ---- JSON */

static void put_uint_or_null(struct json *json, const char *key, uint64_t value, int known)
{
    if (known)
        json_uint(json, key, value);
    else
        json_string(json, key, NULL);
}

static void put_counts(struct json *json, const struct watch_scan *s)
{
    const int known = s->scan != 0;
    put_uint_or_null(json, "scan", s->scan, known);
    put_uint_or_null(json, "station", s->station, known);
    json_bool(json, "over", s->over);
    json_uint(json, "points", s->points);
    json_uint(json, "sampled_points", s->sampled_points);
    put_uint_or_null(json, "every", s->every, known);
    json_uint(json, "left_out", s->left_out);
    json_uint(json, "shots", s->shots);
    json_double(json, "empty_share", s->shots > 0 ? (double)s->empty / (double)s->shots : (double)NAN);
}

static void put_pair(struct json *json, const char *key, const double v[2])
{
    json_open_array(json, key);
    json_double(json, NULL, v[0]);
    json_double(json, NULL, v[1]);
    json_close_array(json);
}

/* This writes the noise and the counts from which the error of a point follows. */
static void put_expected(struct json *json, const struct watch_scan *s)
{
    const struct deviation_terms *t = &s->expected;
    if (!s->expects) {
        json_string(json, "expected", NULL);
        return;
    }
    json_open_object(json, "expected");
    json_double(json, "range_sigma_m", t->range_sigma_m);
    json_double(json, "range_sigma_per_m", t->range_sigma_per_m);
    json_double(json, "range_floor_m", t->range_floor_m);
    json_double(json, "range_jitter_m", t->range_jitter_m);
    json_double(json, "range_step_m", t->range_step_m);
    json_double(json, "place_step_m", t->place_step_m);
    put_pair(json, "angle_sigma_rad", t->angle_sigma_rad);
    put_pair(json, "angle_step_rad", t->angle_step_rad);
    json_double(json, "ball_m", t->ball_m);
    json_double(json, "ball_per_m", t->ball_per_m);
    page_put_vector(json, "ball_factor", t->ball_factor);
    json_bool(json, "ball_local", t->ball_local);
    json_close_object(json);
}

/* Writes the members of a scan into the open object: counts, expected errors, figures. `all` and `verdict` are those of
 * `report --json`; `all` also has `max_at`. */
static void put_scan(struct json *json, const struct watch_scan *s)
{
    put_counts(json, s);
    put_expected(json, s);
    if (s->sampled_points == 0) {
        json_string(json, "all", NULL);
        json_string(json, "verdict", NULL);
        return;
    }
    json_open_object(json, "all");
    report_put_figures(json, &s->figures);
    page_put_vector(json, "max_at", s->max_at_m);
    report_put_density(json, &s->density);
    json_double(json, "density_cell_m", s->density_cell_m > 0.0 ? s->density_cell_m : (double)NAN);
    json_close_object(json);
    report_put_verdict(json, &s->verdict);
}

static void put_coverage(struct json *json, const struct watch *w)
{
    if (w->seen.coverage == NULL) {
        json_string(json, "coverage", NULL);
        return;
    }
    json_open_object(json, "coverage");
    json_double(json, "cell_m", w->seen.cell_m);
    json_uint(json, "cells", w->seen.n_cells);
    json_uint(json, "seen", w->shown_seen);
    json_double(json, "share", w->shown_share);
    json_close_object(json);
}

/* The last scan of each station that has one. */
static void put_stations(struct json *json, const struct watch *w)
{
    json_open_array(json, "stations");
    for (uint32_t i = 0; i < w->site->n_stations; i++) {
        const struct watch_scan *s = &w->shown_station[i];
        if (s->scan == 0) continue;
        json_open_object(json, NULL);
        json_uint(json, "number", i + 1);
        json_string(json, "name", w->site->station[i].station->name);
        put_scan(json, s);
        json_double(json, "seen_share", s->seen_share);
        json_close_object(json);
    }
    json_close_array(json);
}

/* The lock is held: nothing here waits. */
static void put_quality(struct json *json, const void *ctx)
{
    const struct watch *w = ctx;
    json_open_object(json, NULL);
    put_scan(json, &w->shown);
    report_put_histogram(json, w->shown.figures.along > 0 ? "along_beam" : "distances", &w->shown.histogram);
    put_coverage(json, w);
    json_uint(json, "lost_frames", w->lost_frames);
    put_stations(json, w);
    json_close_object(json);
}

int watch_get_quality(struct watch *w, struct web_body *out, struct sh_err *err)
{
    pthread_mutex_lock(&w->lock);
    const int rc = page_json(put_quality, w, out, err);
    pthread_mutex_unlock(&w->lock);
    return rc;
}
