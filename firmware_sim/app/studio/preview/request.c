/* SPDX-License-Identifier: MIT */
/* This file reads the requests of a page, and checks their queries. */
#include <math.h>
#include <string.h>

#include "firmware_sim/app/studio/page_query.h"
#include "firmware_sim/app/studio/preview/inside.h"

static const double FAR_AWAY_M = 1e9, LEAST_STEP_DEG = 0.1, MOST_STEP_DEG = 30.0, STEP_DEG = 2.0, NEXT_STEP_DEG = 0.5;
static const double HEIGHT_M = 1.6;

static double n_stations(const struct preview_options *o)
{
    return (double)o->site->n_stations;
}

static int read_place(const struct preview_options *o, const char *query, struct preview_request *r, struct sh_err *err)
{
    enum { STATION, X, Y, Z, HEADING, PITCH, ROLL, STEP, FAR, LINE0, LINE1, PAN0, PAN1, POINTS };
    struct page_word w[] = {[STATION] = {"station", 1, n_stations(o), 1, (double)NAN},
                            [X] = {"x_m", -FAR_AWAY_M, FAR_AWAY_M, 0, (double)NAN},
                            [Y] = {"y_m", -FAR_AWAY_M, FAR_AWAY_M, 0, (double)NAN},
                            [Z] = {"z_m", -FAR_AWAY_M, FAR_AWAY_M, 0, (double)NAN},
                            [HEADING] = {"heading_deg", -360, 360, 0, (double)NAN},
                            [PITCH] = {"pitch_deg", -90, 90, 0, 0},
                            [ROLL] = {"roll_deg", -180, 180, 0, 0},
                            [STEP] = {"step_deg", LEAST_STEP_DEG, MOST_STEP_DEG, 0, STEP_DEG},
                            [FAR] = {"far_m", 0.01, FAR_AWAY_M, 0, (double)INFINITY},
                            [LINE0] = {"line0_deg", -360, 360, 0, (double)INFINITY},
                            [LINE1] = {"line1_deg", -360, 360, 0, (double)INFINITY},
                            [PAN0] = {"pan0_deg", -360, 360, 0, (double)INFINITY},
                            [PAN1] = {"pan1_deg", -360, 720, 0, (double)INFINITY},
                            [POINTS] = {"points", 0, 1, 1, 1},
                            {.name = NULL}};
    const int rc = page_read_query(w, query, err);
    if (rc != SH_OK) return rc;
    *r = (struct preview_request){
        .kind = PREVIEW_PLACE,
        .station = (uint32_t)w[STATION].value - 1,
        .place = {{w[X].value, w[Y].value, w[Z].value}, w[HEADING].value, w[PITCH].value, w[ROLL].value},
        .step_deg = w[STEP].value,
        .far_m = w[FAR].value,
        .line_deg = {w[LINE0].value, w[LINE1].value},
        .pan_deg = {w[PAN0].value, w[PAN1].value},
        .points = w[POINTS].value != 0.0};
    return SH_OK;
}

static int read_next(const struct preview_options *o, enum preview_kind kind, const char *query,
                     struct preview_request *r, struct sh_err *err)
{
    enum { STATION, HEIGHT, OF, MIDDLE = OF + PREVIEW_MOST_OF, HALF = MIDDLE + 3, TURN = HALF + 3, ALL };
    static const char *const of_section[] = {"middle_x_m", "middle_y_m", "middle_z_m",
                                             "half_x_m",   "half_y_m",   "half_z_m"};
    static const char *const names[PREVIEW_MOST_OF] = {"p1", "p2",  "p3",  "p4",  "p5",  "p6",  "p7",  "p8",
                                                       "p9", "p10", "p11", "p12", "p13", "p14", "p15", "p16"};
    struct page_word w[ALL + 1] = {
        [STATION] = {"station", 1, n_stations(o), 1, (double)NAN}, [HEIGHT] = {"height_m", 0, 1000, 0, HEIGHT_M}};
    for (uint32_t i = 0; i < PREVIEW_MOST_OF; i++)
        w[OF + i] = (struct page_word){names[i], 1, UINT32_MAX, 1, 0};
    for (int i = 0; i < 6 && kind == PREVIEW_NEXT; i++)
        w[MIDDLE + i] =
            (struct page_word){of_section[i], i < 3 ? -FAR_AWAY_M : 0, FAR_AWAY_M, 0, i < 3 ? 0 : (double)INFINITY};
    if (kind == PREVIEW_NEXT) w[TURN] = (struct page_word){"turn_deg", -360, 360, 0, 0};
    const int rc = page_read_query(w, query, err);
    if (rc != SH_OK) return rc;
    *r = (struct preview_request){.kind = kind,
                                  .station = (uint32_t)w[STATION].value - 1,
                                  .height_m = w[HEIGHT].value,
                                  .step_deg = NEXT_STEP_DEG,
                                  .far_m = (double)INFINITY,
                                  .line_deg = {(double)INFINITY, (double)INFINITY},
                                  .pan_deg = {(double)INFINITY, (double)INFINITY},
                                  .section.heading_deg = w[TURN].value};
    for (int i = 0; i < 3; i++) {
        r->section.middle_m[i] = w[MIDDLE + i].value;
        r->section.half_m[i] = kind == PREVIEW_NEXT ? w[HALF + i].value : (double)INFINITY;
    }
    for (uint32_t i = 0; i < PREVIEW_MOST_OF; i++)
        if (w[OF + i].value != 0.0) r->named[r->n_named++] = (uint32_t)w[OF + i].value;
    return SH_OK;
}

int preview_read_request(const struct preview_options *o, const char *path, const char *query,
                         struct preview_request *out, struct sh_err *err)
{
    struct page_word none[] = {{.name = NULL}};
    *out = (struct preview_request){.kind = PREVIEW_CELLS};
    if (strcmp(path, "/preview") == 0) return read_place(o, query, out, err);
    if (strcmp(path, "/next") == 0) return read_next(o, PREVIEW_NEXT, query, out, err);
    if (strcmp(path, "/reach") == 0) return read_next(o, PREVIEW_REACH, query, out, err);
    return strcmp(path, "/cells") == 0 ? page_read_query(none, query, err) : SH_EINPUT;
}
