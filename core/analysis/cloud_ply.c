#include "core/cloud.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/analysis/cloud_las.h"
#include "core/ply.h"

struct reading {
    struct ply_rows r;
    struct cloud *cloud;
    const struct sh_report *report;
};

static const char *const READING = "reading the points";

static void tick(void *reading)
{
    sh_progress(((struct reading *)reading)->report, READING, -1);
}

/* The recorder tells the coordinate reference system in a comment; other files don't, which is no fault. */
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

static int reserve(struct reading *g, const struct ply_element *e, struct sh_err *err)
{
    struct cloud *c = g->cloud;
    size_t n = (size_t)e->count; /* checked against the file's size */
    bool station = ply_find(&g->r.h, e, PLY_STATION), label = ply_find(&g->r.h, e, PLY_LABEL),
         echo = ply_find(&g->r.h, e, PLY_ECHO);
    if (n == 0) return SH_OK;
    c->xyz_m = calloc(n, sizeof *c->xyz_m);
    if (station) c->station = calloc(n, sizeof *c->station);
    if (label) c->label = calloc(n, sizeof *c->label);
    if (echo) c->echo = calloc(n, sizeof *c->echo);
    if (c->xyz_m == NULL || (station && !c->station) || (label && !c->label) || (echo && !c->echo))
        return text_fail(&g->r.t, 0, SH_ENOMEM, err, "no memory for %zu points", n);
    c->n = n;
    return SH_OK;
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

static int keep_point(struct reading *g, struct sh_err *err)
{
    struct cloud *c = g->cloud;
    size_t i = (size_t)g->r.row;
    const double *p = &g->r.scalar[PLY_X];
    int n_nan = isnan(p[0]) + isnan(p[1]) + isnan(p[2]);
    if (n_nan != 3 && !(isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]))) {
        char what[112];
        snprintf(what, sizeof what, "(%.9g %.9g %.9g) is no position; a shot without echo has three times nan", p[0],
                 p[1], p[2]);
        return ply_fail(&g->r, err, what);
    }
    int rc = SH_OK, station = 0, label = 0, echo = 0;
    if (c->station != NULL) rc = whole(g, PLY_STATION, 1, UINT16_MAX, &station, err);
    if (c->label != NULL && rc == SH_OK) rc = whole(g, PLY_LABEL, 0, UINT16_MAX, &label, err);
    if (c->echo != NULL && rc == SH_OK) rc = whole(g, PLY_ECHO, 0, UINT8_MAX, &echo, err);
    if (rc != SH_OK) return rc;
    memcpy(c->xyz_m[i], p, sizeof c->xyz_m[i]);
    if (c->station != NULL) c->station[i] = (uint16_t)station;
    if (c->label != NULL) c->label[i] = (uint16_t)label;
    if (c->echo != NULL) c->echo[i] = (uint8_t)echo;
    return SH_OK;
}

/* Numbers kept as float are read as they stand, yet what they stood for was rounded: a quarter of a metre for
 * a northing. */
static void warn_if_coarse(const struct reading *g, const struct ply_element *e)
{
    const double worth_a_word_m = 1e-4;
    bool is_float = false;
    double largest = 0;
    for (int i = e->first; i < e->first + e->n_properties; i++) {
        const struct ply_property *p = &g->r.h.property[i];
        is_float |= p->use >= PLY_X && p->use <= PLY_Z && p->type == PLY_FLOAT;
    }
    if (!is_float || g->r.h.format == PLY_ASCII) return;
    for (size_t i = 0; i < g->cloud->n; i++)
        for (int k = 0; k < 3; k++)
            largest = fmax(largest, fabs(g->cloud->xyz_m[i][k]));
    if (g->cloud->epsg == 4979) largest *= 111320.0; /* degrees */
    if (largest * 6e-8 > worth_a_word_m)
        sh_warn(g->report, "%s: stored in single precision, so good to %.2g m only", g->r.t.path, largest * 6e-8);
}

static int read_element(struct reading *g, int i, struct sh_err *err)
{
    int rc = ply_begin(&g->r, i, err);
    const struct ply_element *e = g->r.element;
    bool points = e->kind == PLY_VERTEX;
    if (rc == SH_OK && points) rc = reserve(g, e, err);
    if (rc == SH_OK && !points && e->count > 0)
        sh_warn(g->report, "%s: element '%s' (%llu of it) passed over", g->r.t.path, e->name,
                (unsigned long long)e->count);
    for (; g->r.row < e->count && rc == SH_OK; g->r.row++) {
        rc = ply_read(&g->r, err);
        if (rc == SH_OK && points) rc = keep_point(g, err);
        if ((g->r.row & 0xffff) == 0) sh_progress(g->report, READING, ply_fraction(&g->r));
    }
    if (rc == SH_OK && points) warn_if_coarse(g, e);
    return rc;
}

static int read_body(struct reading *g, struct sh_err *err)
{
    const struct ply_header *h = &g->r.h;
    bool has_points = false;
    g->cloud->epsg = find_epsg(&g->r.t);
    for (int i = 0; i < h->n_elements; i++)
        has_points |= h->element[i].kind == PLY_VERTEX;
    if (!has_points) return text_fail(&g->r.t, 0, SH_EINPUT, err, "no element vertex: there are no points");
    for (int i = 0; i < h->n_elements; i++) {
        int rc = read_element(g, i, err);
        if (rc != SH_OK) return rc;
    }
    size_t left_over = ply_left_over(&g->r);
    if (left_over > 0) sh_warn(g->report, "%s: %zu bytes after the last element passed over", g->r.t.path, left_over);
    return SH_OK;
}

static int read_ply(const char *path, const struct sh_report *report, struct cloud *out, struct sh_err *err)
{
    struct reading *g = calloc(1, sizeof *g);
    if (g == NULL) return sh_fail(err, SH_ENOMEM, "no memory to read %s", path);
    g->cloud = out;
    g->report = report;
    int rc = ply_open(&g->r, path, tick, g, err);
    if (rc == SH_OK) rc = read_body(g, err);
    ply_close(&g->r);
    free(g);
    return rc;
}

int cloud_read(const char *path, const struct sh_report *report, struct cloud *out, struct sh_err *err)
{
    *out = (struct cloud){.epsg = CLOUD_EPSG_UNKNOWN};
    int rc = cloud_is_las(path) ? cloud_read_las(path, report, out, err) : read_ply(path, report, out, err);
    if (rc != SH_OK) cloud_free(out);
    return rc;
}

void cloud_free(struct cloud *cloud)
{
    free(cloud->xyz_m);
    free(cloud->station);
    free(cloud->label);
    free(cloud->echo);
    *cloud = (struct cloud){.epsg = CLOUD_EPSG_UNKNOWN};
}
