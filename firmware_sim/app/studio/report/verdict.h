/* SPDX-License-Identifier: MIT */
/* Judges whether deviations of points are those that follow from configuration and plan: at a station of a recording
 * (expect.c), and in a scan that still goes on (firmware_sim/app/studio/watch). In: the setup of the station's head,
 * and the figures of its points (core/studio/figures.h). Out: a judgement, its limits, and one sentence or two. Pure.
 * json.c writes figures and judgements as JSON, for `report --json` and for /quality. */
#ifndef FIRMWARE_SIM_APP_STUDIO_REPORT_VERDICT_H
#define FIRMWARE_SIM_APP_STUDIO_REPORT_VERDICT_H

#include "core/studio/deviation.h"
#include "core/studio/figures.h"
#include "firmware_sim/base/json.h"
#include "firmware_sim/site/site.h"

/* REPORT_CELL_M: the side of density cells with which the search for a fitting side begins. REPORT_SHOWN: the share of
 * the points that lies within a histogram's bins. */
#define REPORT_CELL_M 0.1
#define REPORT_SHOWN  0.995

enum report_judgement { REPORT_NONE, REPORT_WITHIN, REPORT_BEYOND };
struct report_verdict {
    enum report_judgement judgement;
    size_t judged, beyond;          /* points; of these, farther than their bound where there is one */
    double bound_m;                 /* the largest bound of its points; INFINITY: noise without a bound */
    double least_ratio, most_ratio; /* of the RMS deviation over sigma; 0 where something else decides */
    char text[400];                 /* one sentence or two, in plain words */
};

/* "within", "beyond", "not judged". */
const char *report_judgement_name(enum report_judgement judgement);

/* Sets *head to the setup and the errors of a site's head at a station. file_count_m becomes 0: the caller sets it. */
void report_head_of(const struct site *site, uint32_t station, struct deviation_head *head);

/* Counts one point, by its distance from the scene, its deviation along the beam and its range
 * (core/studio/deviation.h). */
void report_count(struct report_verdict *v, const struct deviation_head *head, double distance_m, double along_m,
                  double range_m);

struct report_subject {
    const struct figures *figures;
    const struct deviation_head *head;
    int moving;        /* the head moved while it scanned */
    const char *reach; /* how far the scene was looked for: "10 m" */
};
/* Judges the points, all of which were counted before. */
void report_judge_one(const struct report_subject *subject, struct report_verdict *v);

/* Writes members of an open object. */
void report_put_figures(struct json *json, const struct figures *f);
/* Each of these writes one member. */
void report_put_density(struct json *json, const struct figures_density_row *d);
void report_put_verdict(struct json *json, const struct report_verdict *v);
void report_put_histogram(struct json *json, const char *key, const struct figures_histogram *h);

#endif
