/* SPDX-License-Identifier: MIT */
/* /quality: the observer stores figures, and each request gets the latest ones. */
#include <math.h>
#include <string.h>

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
    w->shown_lost = w->lost_frames;
    pthread_mutex_unlock(&w->lock);
}

void watch_publish(struct watch *w)
{
    const int64_t from_ns = clock_thread_ns();
    struct scanhead_stats stats;
    struct sh_err err;
    if (w->at.scan == 0) return;
    /* Where memory is short now, the figures before stay. */
    if (watch_sample_compare(w, &err) == SH_OK && watch_sample_figures(w, &err) == SH_OK) {
        watch_seen_count(&w->seen, w->at.station, w->site->n_stations, &w->at.cells_seen, &w->at.seen_share);
        scanhead_get_stats(w->sh, &stats);
        w->lost_frames = stats.reader_lost;
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

static void put_histogram(struct json *json, const struct watch_histogram *h)
{
    if (h->bins == 0) {
        json_string(json, "histogram", NULL);
        return;
    }
    json_open_object(json, "histogram");
    json_string(json, "of", h->along ? "along_beam" : "distance");
    json_double(json, "from_m", h->from_m);
    json_double(json, "to_m", h->to_m);
    json_open_array(json, "counts");
    for (uint32_t k = 0; k < h->bins; k++)
        json_uint(json, NULL, h->count[k]);
    json_close_array(json);
    json_uint(json, "below", h->below);
    json_uint(json, "above", h->above);
    json_close_object(json);
}

static void put_deviation(struct json *json, const struct watch_scan *s)
{
    const struct figures *f = &s->figures;
    json_open_object(json, "deviation_m");
    json_double(json, "mean", f->mean_m);
    json_double(json, "rms", f->rms_m);
    json_double(json, "p95", f->p95_m);
    json_double(json, "max", f->max_m);
    json_double(json, "bound", s->verdict.judged > 0 && s->verdict.bound_m > 0.0 ? s->verdict.bound_m : (double)NAN);
    json_double(json, "sigma_expected", f->noisy > 0 ? f->expected_rms_m : (double)NAN);
    json_uint(json, "far", f->far);
    json_open_object(json, "along_beam");
    json_uint(json, "points", f->along);
    json_double(json, "mean", f->along_mean_m);
    json_double(json, "rms", f->along_rms_m);
    json_double(json, "max", f->along_max_m);
    json_uint(json, "judged", f->judged);
    json_double(json, "judged_rms", f->judged_rms_m);
    json_close_object(json);
    put_histogram(json, &s->histogram);
    json_close_object(json);
}

static void put_verdict(struct json *json, const struct watch_scan *s)
{
    json_open_object(json, "verdict");
    json_string(json, "judgement", report_judgement_name(s->verdict.judgement));
    json_string(json, "text", s->verdict.text);
    json_close_object(json);
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

static void put_scan(struct json *json, const struct watch_scan *s)
{
    put_counts(json, s);
    json_open_object(json, "density_per_m2");
    json_double(json, "p5", s->density.p5);
    json_double(json, "p50", s->density.p50);
    json_double(json, "p95", s->density.p95);
    json_double(json, "cell_m", s->density_cell_m > 0.0 ? s->density_cell_m : (double)NAN);
    json_close_object(json);
    if (s->sampled_points == 0) {
        json_string(json, "deviation_m", NULL);
        json_string(json, "verdict", NULL);
        return;
    }
    put_deviation(json, s);
    put_verdict(json, s);
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
        put_counts(json, s);
        json_double(json, "density_p50_per_m2", s->density.p50);
        json_double(json, "mean_m", s->sampled_points > 0 ? s->figures.mean_m : (double)NAN);
        json_double(json, "rms_m", s->sampled_points > 0 ? s->figures.rms_m : (double)NAN);
        json_double(json, "p95_m", s->sampled_points > 0 ? s->figures.p95_m : (double)NAN);
        json_double(json, "max_m", s->sampled_points > 0 ? s->figures.max_m : (double)NAN);
        json_string(json, "judgement", report_judgement_name(s->verdict.judgement));
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
    put_coverage(json, w);
    json_uint(json, "lost_frames", w->shown_lost);
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
