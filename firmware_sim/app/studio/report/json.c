/* SPDX-License-Identifier: MIT */
/* The report as JSON. No key is ever renamed or removed, since scripts read them. */
#include <math.h>

#include "firmware_sim/app/studio/report/report.h"
#include "firmware_sim/config/places.h"

static void put_worst(struct json *json, const struct report *r)
{
    const struct cloud_stats *s = &r->f.stats;
    const struct scene_surface *surface = report_worst_surface(r);
    json_open_object(json, "worst");
    json_uint(json, "point", s->worst + 1);
    json_double(json, "x", r->f.worst[0]);
    json_double(json, "y", r->f.worst[1]);
    json_double(json, "z", r->f.worst[2]);
    json_string(json, "object", surface != NULL ? surface->object : NULL);
    json_string(json, "material", surface != NULL ? surface->material : NULL);
    json_close_object(json);
}

void report_put_figures(struct json *json, const struct figures *f)
{
    json_uint(json, "points", f->points);
    json_uint(json, "far", f->far);
    json_double(json, "mean_m", f->mean_m);
    json_double(json, "rms_m", f->rms_m);
    json_double(json, "p95_m", f->p95_m);
    json_double(json, "max_m", f->max_m);
    json_open_object(json, "along_beam");
    json_uint(json, "points", f->along);
    json_double(json, "mean_m", f->along_mean_m);
    json_double(json, "rms_m", f->along_rms_m);
    json_double(json, "max_m", f->along_max_m);
    json_uint(json, "judged", f->judged);
    json_double(json, "judged_mean_m", f->judged_mean_m);
    json_double(json, "judged_rms_m", f->judged_rms_m);
    json_double(json, "expected_rms_m", f->expected_rms_m);
    json_uint(json, "noisy", f->noisy);
    json_double(json, "mean_sigmas", f->z_mean);
    json_double(json, "rms_sigmas", f->z_rms);
    json_double(json, "counts_sigmas", f->z_counts);
    json_close_object(json);
}

void report_put_density(struct json *json, const struct figures_density_row *d)
{
    json_open_object(json, "density");
    json_uint(json, "cells", d->cells);
    json_double(json, "p5_m2", d->p5);
    json_double(json, "p50_m2", d->p50);
    json_double(json, "p95_m2", d->p95);
    json_close_object(json);
}

void report_put_verdict(struct json *json, const struct report_verdict *v)
{
    json_open_object(json, "verdict");
    json_string(json, "judgement", report_judgement_name(v->judgement));
    json_string(json, "text", v->text);
    json_uint(json, "judged", v->judged);
    json_uint(json, "beyond", v->beyond);
    json_double(json, "bound_m", v->bound_m);
    const int by_sigma = v->most_ratio > 0.0;
    json_double(json, "least_rms_sigmas", by_sigma ? v->least_ratio : (double)NAN);
    json_double(json, "most_rms_sigmas", by_sigma ? v->most_ratio : (double)NAN);
    json_close_object(json);
}

static void put_times(struct json *json, const struct figures_times *t, double gap_s)
{
    json_open_object(json, "time");
    json_double(json, "first_s", t->first_s);
    json_double(json, "last_s", t->last_s);
    json_double(json, "span_s", t->span_s);
    json_double(json, "points_s", t->span_s > 0.0 ? (double)t->points / t->span_s : (double)NAN);
    json_uint(json, "scans", t->scans);
    json_double(json, "gap_s", gap_s);
    json_uint(json, "gaps", t->gaps);
    json_double(json, "longest_gap_s", t->longest_s);
    json_close_object(json);
}

static void put_stations(struct json *json, const struct report *r)
{
    json_open_array(json, "stations");
    for (uint32_t s = 0; s < r->site->n_stations; s++) {
        const struct report_station *st = &r->f.station[s];
        json_open_object(json, NULL);
        json_uint(json, "station", s + 1);
        json_string(json, "name", r->site->station[s].station->name);
        report_put_figures(json, &st->figures);
        report_put_density(json, &st->density);
        if (r->f.times != NULL) put_times(json, &r->f.times[s], r->f.gap_s[s]);
        report_put_verdict(json, &st->verdict);
        json_close_object(json);
    }
    json_close_array(json);
}

static void put_bins(struct json *json, const struct report *r)
{
    const double most_deg = 90.0;
    json_open_array(json, "by_range");
    for (uint32_t k = 0; k < r->f.n_ranges; k++) {
        json_open_object(json, NULL);
        json_double(json, "from_m", k * r->f.range_step_m);
        json_double(json, "to_m", (k + 1) * r->f.range_step_m);
        report_put_figures(json, &r->f.range[k]);
        report_put_density(json, &r->f.density_range[k]);
        json_close_object(json);
    }
    json_close_array(json);
    json_open_array(json, "by_incidence");
    for (int k = 0; k < REPORT_INCIDENCES; k++) {
        json_open_object(json, NULL);
        json_double(json, "from_deg", most_deg / REPORT_INCIDENCES * k);
        json_double(json, "to_deg", most_deg / REPORT_INCIDENCES * (k + 1));
        report_put_figures(json, &r->f.incidence[k]);
        json_close_object(json);
    }
    json_close_array(json);
}

static void put_labels(struct json *json, const struct report *r)
{
    json_open_array(json, "by_surface");
    for (uint32_t i = 0; i <= r->site->n_surfaces; i++) {
        const struct scene_surface *s = i < r->site->n_surfaces ? site_surface(r->site, i) : NULL;
        if (r->f.label[i].points == 0) continue;
        json_open_object(json, NULL);
        json_string(json, "object", s != NULL ? s->object : NULL);
        json_string(json, "material", s != NULL ? s->material : NULL);
        report_put_figures(json, &r->f.label[i]);
        json_close_object(json);
    }
    json_close_array(json);
}

void report_put_histogram(struct json *json, const char *key, const struct figures_histogram *h)
{
    json_open_object(json, key);
    json_double(json, "from_m", h->from);
    json_double(json, "width_m", h->width);
    json_uint(json, "below", h->below);
    json_uint(json, "above", h->above);
    json_open_array(json, "counts");
    for (uint32_t k = 0; k < h->bins; k++)
        json_uint(json, NULL, h->count[k]);
    json_close_array(json);
    json_close_object(json);
}

static void put_totals(struct json *json, const struct report *r)
{
    const struct cloud_stats *s = &r->f.stats;
    json_uint(json, "points", s->points);
    json_uint(json, "empty", s->empty - r->f.ghosts);
    json_uint(json, "ghosts", r->f.ghosts);
    json_double(json, "mean_m", s->mean_m);
    json_double(json, "rms_m", s->rms_m);
    json_double(json, "p50_m", s->p50_m);
    json_double(json, "p95_m", s->p95_m);
    json_double(json, "p999_m", s->p999_m);
    json_double(json, "max_m", s->max_m);
    json_uint(json, "beyond", s->beyond);
    json_uint(json, "far", s->far);
    json_double(json, "tolerance_m", r->tolerance_m);
    json_uint(json, "surfaces_hit", r->f.coverage.surfaces_hit);
    json_uint(json, "surfaces", r->site->n_surfaces);
    json_uint(json, "triangles_hit", r->f.coverage.triangles_hit);
    json_uint(json, "triangles", r->site->scene->n_triangles);
}

void report_put_json(struct json *json, const void *report)
{
    const struct report *r = report;
    json_open_object(json, NULL);
    put_totals(json, r);
    put_worst(json, r);
    report_put_verdict(json, &r->f.verdict);
    json_open_object(json, "all");
    report_put_figures(json, &r->f.all);
    report_put_density(json, &r->f.density_all);
    json_double(json, "density_cell_m", r->f.density.cell_m);
    json_close_object(json);
    put_stations(json, r);
    put_bins(json, r);
    put_labels(json, r);
    report_put_histogram(json, "distances", &r->f.distances);
    report_put_histogram(json, "along_beam", &r->f.along);
    if (r->f.has_echoes) {
        json_open_array(json, "shots_by_echoes");
        for (int k = 0; k <= FIGURES_MAX_ECHOES; k++)
            json_uint(json, NULL, r->f.shots[k]);
        json_close_array(json);
    }
    json_close_object(json);
}
