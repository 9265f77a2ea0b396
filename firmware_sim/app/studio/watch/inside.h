/* SPDX-License-Identifier: MIT */
/* Private to this folder: the watch and its parts, which README.md lists. */
#ifndef FIRMWARE_SIM_APP_STUDIO_WATCH_INSIDE_H
#define FIRMWARE_SIM_APP_STUDIO_WATCH_INSIDE_H

#include <pthread.h>
#include <stdatomic.h>

#include "core/studio/coverage.h"
#include "core/studio/deviation.h"
#include "core/studio/figures.h"
#include "drivers/host/scanhead.h"
#include "firmware_sim/app/studio/preview/preview.h"
#include "firmware_sim/app/studio/report/verdict.h"
#include "firmware_sim/app/studio/watch/past.h"
#include "firmware_sim/app/studio/watch/save.h"
#include "firmware_sim/app/studio/watch/watch.h"

/* The most points of a scan that are held; how many are compared at a time; the largest `every`. */
enum { WATCH_MOST_POINTS = 1 << 17, WATCH_BATCH = 1024, WATCH_LEAST_SHARE = 1 << 20 };

/* Points of the scan at hand that are looked at, in the scene's frame. */
struct watch_sample {
    uint32_t every; /* a power of two: one of so many pulses */
    size_t n, done; /* points, and how many of them were compared */
    double (*xyz_m)[3];
    uint32_t *hash; /* of the point's pulse; a point is in the sample where hash % every is 0 */
    double *distance_m;
    uint32_t *triangle;
    struct deviation_points points;
    double point_ns, spent_ns; /* to compare one point; to compare all of them in this scan */
    double cell_m;             /* of densities */
};

/* The figures of one scan. */
struct watch_scan {
    uint32_t scan, station; /* both from 1; 0: none */
    int over;
    uint64_t points, shots, empty; /* that came */
    uint64_t left_out;             /* of the points: on moving bodies, on legs, in mirrors */
    uint64_t sampled_points;       /* in the figures below: those of one in `every` pulses */
    uint32_t every;
    int in_scene; /* points could be taken to the scene's frame */
    struct figures figures;
    double max_at_m[3];                 /* place of the point with the distance figures.max_m; NaN: none */
    struct figures_density_row density; /* of the points looked at, times `every` */
    double density_cell_m;
    struct figures_histogram histogram; /* of deviations along the beam, or of distances where there are none */
    struct report_verdict verdict;
    struct deviation_terms expected;
    int expects; /* 0: expected is not known */
    double seen_share;
};

struct watch_seen {
    struct coverage *coverage; /* NULL: none */
    double cell_m, area_m2;
    uint32_t n_cells;
    size_t words;
    double *cell_m2; /* [n_cells] */
    uint64_t *bits;  /* [n_stations][words] cells that each has seen */
    uint64_t *all;   /* [words] while counting */
    uint32_t n_seen; /* cells that any station has seen */
    double seen_m2;
};

struct watch {
    const struct config *cfg;
    const struct site *site;
    struct watch_options options;
    struct link_spec link;
    struct web_source source;
    int link_given; /* the loop owns its descriptor */
    int fd;         /* the observer's end of the socket pair; `sh` owns it */
    struct scanhead *sh;
    pthread_t thread;
    int running;
    atomic_int ending;

    /* for the observer's thread alone, except for constants */
    struct deviation_head *head; /* [n_stations] */
    struct deviation_head now;   /* of the scan at hand */
    struct device_version *held; /* keeps the site of `now` */
    struct georef *now_georef;   /* of the scan at hand; NULL: its points are in the scene's frame, or nowhere */
    struct watch_sample sample;
    struct watch_seen seen;
    struct watch_scan at; /* the scan at hand; a head never gives a number to two scans */
    uint32_t begun;       /* the last scan that the stream has named; 0: none */
    int missed;           /* frames were lost on the way here: a scan's end may be among them */
    int dirty;            /* something came since the last figures */
    int64_t began_ns, began_thread_ns, published_ns, publish_ns;

    struct past *past; /* the observer fills it */
    struct save *save;
    struct preview *preview; /* has a thread of its own; NULL: there are none */

    /* made once */
    char *scene_bytes;
    size_t scene_len;

    /* for answers to other threads */
    pthread_mutex_t lock;
    struct watch_scan shown;
    struct watch_scan *shown_station; /* [n_stations] the last scan of each; scan 0: none */
    uint32_t shown_seen;
    double shown_share;
    uint64_t lost_frames; /* as the head said last */
    atomic_uint ended;    /* the last scan whose end the observer has read, by its number; 0: none */
    atomic_int is_deaf;   /* the observer reads no more */
};

/* ---- scene.c */
int watch_make_scene(struct watch *w, struct sh_err *err);
int watch_get_scene(const struct watch *w, struct web_body *out, struct sh_err *err);
/* For page_json; ctx is the struct watch. */
void watch_put_head(struct json *json, const void *ctx);
void watch_put_plan(struct json *json, const void *ctx);

/* ---- observe.c */
void *watch_observe(void *watch);
/* Whether the head's last scan is over, and the observer has not read its end yet. Any thread may ask. */
int watch_is_behind(void *watch);

/* ---- sample.c */
int watch_sample_open(struct watch *w, struct sh_err *err);
void watch_sample_close(struct watch *w);
void watch_sample_begin(struct watch *w);
/* Adds a point in the scene's frame, with its pulse's hash. */
void watch_sample_add(struct watch *w, const double p_m[3], uint32_t hash);
/* Compares the points that have not been compared yet. SH_E where that fails; then the sample is as it was. */
int watch_sample_compare(struct watch *w, struct sh_err *err);
/* Fills in the figures of w->at. */
int watch_sample_figures(struct watch *w, struct sh_err *err);

/* ---- seen.c */
int watch_seen_open(struct watch *w, struct sh_err *err);
void watch_seen_close(struct watch_seen *seen);
void watch_seen_begin(struct watch_seen *seen, uint32_t station);
void watch_seen_mark(struct watch_seen *seen, uint32_t station, uint32_t triangle, const double p_m[3]);
/* Counts the cells of all stations. Returns the share of the surface that this station has seen; NaN: not known. */
double watch_seen_count(struct watch_seen *seen, uint32_t station, uint32_t n_stations);

/* ---- quality.c */
/* Works out the figures, and shows them. Only the observer's thread calls this. */
void watch_publish(struct watch *w);
int watch_get_quality(struct watch *w, struct web_body *out, struct sh_err *err);

#endif
