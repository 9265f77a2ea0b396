/* SPDX-License-Identifier: MIT */
/* Points from a PLY file. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/analysis/cloud_readers.h"
#include "core/ply.h"

struct reading {
    struct ply_rows r;
    struct cloud *cloud;
    unsigned columns;
    const struct sh_report *report;
};

/* Our recorder writes the coordinate reference system as a comment. Other files may lack it. */
static int64_t find_epsg(const struct text *file)
{
    struct text t = *file;
    int64_t epsg = CLOUD_EPSG_UNKNOWN, number;
    t.end = file->p;
    for (t.p = t.data; t.p < t.end; text_next_line(&t)) {
        if (!text_is(text_word(&t), "comment") || !text_is(text_word(&t), "epsg")) continue;
        text_skip_blanks(&t);
        if (text_integer(&t, &number) && number >= 0 && text_at_word_end(&t)) epsg = number;
    }
    return epsg;
}

static int whole(struct reading *g, enum ply_use use, int min, int max, int *out, struct sh_err *err)
{
    double v = g->r.scalar[use];
    if (v >= min && v <= max && v == floor(v)) {
        *out = (int)v;
        return SH_OK;
    }
    char what[96];
    snprintf(what, sizeof what, "%s %.9g; allowed are whole numbers from %d to %d", ply_scalar_name[use], v, min, max);
    return ply_fail(&g->r, err, what);
}

/* Keeps the figures that may be NaN, and the number of echoes. */
static int keep_columns(struct reading *g, size_t i, struct sh_err *err)
{
    struct cloud *c = g->cloud;
    const double *v = g->r.scalar;
    int n_echoes = 0, rc = SH_OK;
    if (c->time_s != NULL) c->time_s[i] = v[PLY_TIME];
    if (c->range_m != NULL) c->range_m[i] = (float)v[PLY_RANGE];
    if (c->reflectance_db != NULL) c->reflectance_db[i] = (float)v[PLY_REFLECTANCE];
    if (c->amplitude_db != NULL) c->amplitude_db[i] = (float)v[PLY_AMPLITUDE];
    if (c->echo_count != NULL) {
        rc = whole(g, PLY_ECHO_COUNT, 0, UINT8_MAX, &n_echoes, err);
        c->echo_count[i] = (uint8_t)n_echoes;
    }
    return rc;
}

static int keep_point(void *reading, struct sh_err *err)
{
    struct reading *g = reading;
    if (g->r.element->kind != PLY_VERTEX) return SH_OK;
    struct cloud *c = g->cloud;
    size_t i = (size_t)g->r.row;
    const double *p = &g->r.scalar[PLY_X];
    if (!cloud_is_position(p)) {
        char what[112];
        snprintf(what, sizeof what, "(%.9g %.9g %.9g) is not a position; a shot without echo has nan three times", p[0],
                 p[1], p[2]);
        return ply_fail(&g->r, err, what);
    }
    int rc = SH_OK, station = 0, label = 0, echo = 0;
    if (c->station != NULL) rc = whole(g, PLY_STATION, 1, UINT16_MAX, &station, err);
    if (c->label != NULL && rc == SH_OK) rc = whole(g, PLY_LABEL, 0, UINT16_MAX, &label, err);
    if (c->echo != NULL && rc == SH_OK) rc = whole(g, PLY_ECHO, 0, UINT8_MAX, &echo, err);
    for (int k = 0; c->rgb != NULL && k < 3 && rc == SH_OK; k++) {
        int channel = 0;
        rc = whole(g, (enum ply_use)(PLY_RED + k), 0, UINT8_MAX, &channel, err);
        c->rgb[i][k] = (uint8_t)channel;
    }
    if (rc != SH_OK) return rc;
    memcpy(c->xyz_m[i], p, sizeof c->xyz_m[i]);
    if (c->station != NULL) c->station[i] = (uint16_t)station;
    if (c->label != NULL) c->label[i] = (uint16_t)label;
    if (c->echo != NULL) c->echo[i] = (uint8_t)echo;
    return keep_columns(g, i, err);
}

/* Colours count only where they are whole bytes, since programs disagree on the range of floats. */
static bool has_colours(const struct ply_header *h, const struct ply_element *e)
{
    for (int use = PLY_RED; use <= PLY_BLUE; use++) {
        const struct ply_property *p = ply_find(h, e, (enum ply_use)use);
        if (p == NULL || p->type != NUMBER_U8) return false;
    }
    return true;
}

static int begin_element(void *reading, struct sh_err *err)
{
    struct reading *g = reading;
    const struct ply_element *e = g->r.element;
    static const enum ply_use use_of[CLOUD_COLUMNS] = {[CLOUD_RANGE] = PLY_RANGE,
                                                       [CLOUD_REFLECTANCE] = PLY_REFLECTANCE,
                                                       [CLOUD_AMPLITUDE] = PLY_AMPLITUDE,
                                                       [CLOUD_TIME] = PLY_TIME,
                                                       [CLOUD_LABEL] = PLY_LABEL,
                                                       [CLOUD_STATION] = PLY_STATION,
                                                       [CLOUD_ECHO] = PLY_ECHO,
                                                       [CLOUD_ECHO_COUNT] = PLY_ECHO_COUNT,
                                                       [CLOUD_RGB] = PLY_RED};
    unsigned has = 0;
    if (e->kind != PLY_VERTEX) return SH_OK;
    for (int c = 0; c < CLOUD_COLUMNS; c++)
        if (c == CLOUD_RGB ? has_colours(&g->r.h, e) : ply_find(&g->r.h, e, use_of[c]) != NULL) has |= 1u << c;
    has &= g->columns | 1u << CLOUD_STATION | 1u << CLOUD_LABEL | 1u << CLOUD_ECHO;
    const int rc = cloud_make_room(g->cloud, (size_t)e->count, has, err); /* checked against the file's size */
    if (rc == SH_OK) g->cloud->n = (size_t)e->count;
    return rc;
}

static int progress(void *reading, double fraction, struct sh_err *err)
{
    const struct sh_report *report = ((struct reading *)reading)->report;
    sh_progress(report, "reading the points", fraction);
    return sh_check_stop(report, err);
}

static int read_body(struct reading *g, struct sh_err *err)
{
    const struct ply_user user = {g, begin_element, keep_point, g->report, .has_faces = false};
    const struct ply_header *h = &g->r.h;
    bool has_points = false;
    g->cloud->epsg = find_epsg(&g->r.t);
    for (int i = 0; i < h->n_elements; i++)
        has_points |= h->element[i].kind == PLY_VERTEX;
    if (!has_points) return text_fail(&g->r.t, 0, SH_EINPUT, err, "it has no element vertex, so no points");
    int rc = ply_walk(&g->r, &user, err);
    g->cloud->is_text = h->format == PLY_ASCII;
    if (g->cloud->is_text) g->cloud->count_m = 1e-6;
    if (rc == SH_OK && g->r.is_single) cloud_note_single(g->cloud, g->r.t.path, g->report);
    return rc;
}

int cloud_read_ply(const char *path, unsigned columns, const struct sh_report *report, struct cloud *out,
                   struct sh_err *err)
{
    struct reading *g = calloc(1, sizeof *g);
    if (g == NULL) return sh_fail(err, SH_ENOMEM, "no memory to read %s", path);
    g->cloud = out;
    g->columns = columns;
    g->report = report;
    int rc = ply_open(&g->r, path, progress, g, err);
    if (rc == SH_OK) rc = read_body(g, err);
    ply_close(&g->r);
    free(g);
    return rc;
}
