/* SPDX-License-Identifier: MIT */
/* Private to `scanhead report`: the figures (work.c), what is expected of them (expect.c), and the forms in which they
 * are written (text.c, json.c, html.c). */
#ifndef FIRMWARE_SIM_APP_STUDIO_REPORT_REPORT_H
#define FIRMWARE_SIM_APP_STUDIO_REPORT_REPORT_H

#include <time.h>

#include "core/studio/cloud.h"
#include "core/studio/deviation.h"
#include "core/studio/figures.h"
#include "firmware_sim/app/sites.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/studio/report/verdict.h"
#include "firmware_sim/site/site.h"

enum { REPORT_INCIDENCES = 9, REPORT_MAX_RANGES = 13 }; /* bins of 10 degrees; of ranges */

struct report_station {
    struct figures figures;
    struct figures_density_row density;
    struct report_verdict verdict;
};

struct report_figures {
    size_t ghosts; /* points seen in mirrors: nothing is there, so they are left out */
    struct cloud_stats stats;
    double worst[3]; /* the worst point's place, as the file has it; the cloud is in the scene's frame by then */
    int64_t epsg;    /* of the file */
    struct cloud_coverage coverage;
    struct figures all;
    struct report_station *station; /* [site->n_stations], as are these: */
    struct deviation_head *head;
    struct figures_times *times; /* NULL: the file has no times */
    double *gap_s;               /* pauses longer than that are counted */
    struct figures *label;       /* [n_surfaces + 1]: the last is of points whose surface is not known */
    uint32_t *by_points;         /* [n_surfaces + 1]: numbers in `label`, the most points first */
    uint32_t n_with_points;      /* of these */
    double range_step_m;
    uint32_t n_ranges;
    struct figures range[REPORT_MAX_RANGES], incidence[REPORT_INCIDENCES];
    struct figures_density density;
    struct figures_density_row density_all, density_range[REPORT_MAX_RANGES];
    int has_echoes;
    uint64_t shots[FIGURES_MAX_ECHOES + 1];
    struct figures_histogram distances, along;
    struct report_verdict verdict;
};

struct report {
    struct app_input in;
    const char *cloud_path, *html_path;
    int json, quiet; /* app_parse hides progress */
    double tolerance_m, max_m, cell_m;
    struct timespec modified; /* of the cloud's file */
    struct config *cfg;
    struct sites sites;
    struct site *site;            /* of the scanner of head.station */
    const struct georef **georef; /* of each station */
    struct cloud cloud;
    struct cloud_site cloud_site;
    double *distance_m; /* per point */
    uint32_t *triangle;
    struct deviation_points points;
    struct report_figures f;
};

/* ---- work.c */

/* Reads cloud and scene, compares them, fills r->f. */
int report_work(struct report *r, struct sh_err *err);
void report_free(struct report *r);
/* The surface of the worst point; NULL: it isn't known. */
const struct scene_surface *report_worst_surface(const struct report *r);

/* ---- expect.c */

/* Fills r->f.head: the setup and the errors of the head at each station. */
void report_heads(struct report *r);
/* Makes the verdicts on the stations, and on all together. To be called once all figures are there. */
void report_judge(struct report *r);

/* ---- text.c, json.c, html.c */

void report_print_text(const struct report *r);
/* Object | material, or the object alone where there is no material. */
enum { REPORT_SURFACE_LEN = 2 * SCENE_NAME_LEN + 8 };
void report_name_surface(const struct scene_surface *surface, char name[REPORT_SURFACE_LEN]);
/* Three coordinates of the worst point, each after a space. */
void report_put_worst(FILE *out, const struct report *r);
void report_put_json(struct json *json, const void *report);
int report_write_html(const struct report *r, struct sh_err *err);
/* tables.c: names of bins, tables of the page. */
void report_name_ranges(const struct report *r, char (*name)[32]);
void report_name_incidences(char (*name)[32]);
void report_put_stations(FILE *out, const struct report *r);
void report_put_bins(FILE *out, const struct report *r);
void report_put_surfaces(FILE *out, const struct report *r);
void report_put_times(FILE *out, const struct report *r);
/* map.c: a figure of the page. */
int report_put_map(const struct report *r, FILE *out, struct sh_err *err);

#endif
