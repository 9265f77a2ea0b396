/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/view/spread.h"

#include <stdlib.h>
#include <string.h>

#include "core/studio/scan_mesh.h"
#include "drivers/record/mesh_sparse.h"
#include "firmware_sim/app/studio/view/encode.h"

/* Copies the triangles that the filter keeps, in the order of the grid, on which the random points depend. */
static uint32_t keep_faces(const struct viewed_mesh *m, double long_edge, uint32_t (*face)[3])
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < m->n_faces; i++)
        if (long_edge <= 0 || (double)m->ratio[i] <= long_edge) memcpy(face[n++], m->face[i], sizeof face[0]);
    return n;
}

static int append(struct cloud *out, const struct mesh_points *from, int coloured, struct sh_err *err)
{
    const unsigned has = 1u << CLOUD_RANGE | 1u << CLOUD_REFLECTANCE | 1u << CLOUD_LABEL | 1u << CLOUD_STATION |
                         (coloured ? 1u << CLOUD_RGB : 0);
    int rc = cloud_make_room(out, out->n + from->n, has, err);
    for (uint32_t i = 0; rc == SH_OK && i < from->n; i++) {
        const size_t n = out->n++;
        memcpy(out->xyz_m[n], from->xyz_m[i], sizeof out->xyz_m[n]);
        out->range_m[n] = (float)from->range_m[i];
        out->reflectance_db[n] = from->reflectance_db[i];
        out->label[n] = from->label[i];
        out->station[n] = from->station[i];
        if (coloured) memcpy(out->rgb[n], from->rgb[i], sizeof out->rgb[n]);
    }
    return rc;
}

/* Returns the recording's arrays from the mesh's first point on. range_m gets the ranges in double. */
static struct mesh_points points_of(const struct viewed *v, const struct viewed_mesh *m, double *range_m)
{
    const struct cloud *p = &v->points;
    for (uint32_t i = 0; i < m->n_points; i++)
        range_m[i] = (double)p->range_m[m->first_point + i];
    return (struct mesh_points){.n = m->n_points,
                                .xyz_m = p->xyz_m + m->first_point,
                                .rgb = p->rgb != NULL ? p->rgb + m->first_point : NULL,
                                .range_m = range_m,
                                .reflectance_db = p->reflectance_db + m->first_point,
                                .label = p->label + m->first_point,
                                .station = p->station + m->first_point};
}

/* Checks before points are made that there will not be more than VIEW_MAX_SPARSE in all. */
static int check_count(const struct mesh_points *points, const uint32_t (*face)[3], uint32_t n_faces,
                       const struct view_spread *wish, double *sum_m2, struct sh_err *err)
{
    struct scan_sampler sampler;
    int rc = scan_sampler_start(&sampler, (const double(*)[3])points->xyz_m, face, n_faces, 0, err);
    *sum_m2 += sampler.area_m2;
    scan_sampler_free(&sampler);
    if (rc != SH_OK || *sum_m2 * wish->per_m2 <= VIEW_MAX_SPARSE) return rc;
    return sh_fail(err, SH_EINPUT,
                   "per_m2=%.10g: more than %d points on at least %.4g m2; allowed for these are up to %.3g",
                   wish->per_m2, VIEW_MAX_SPARSE, *sum_m2, 0.99 * VIEW_MAX_SPARSE / *sum_m2);
}

/* Meshes that are spread, one after the other. */
struct spread {
    const struct viewed *viewed;
    const struct view_spread *wish;
    const struct sh_report *report;
    struct cloud *out;
    double sum_m2; /* of all so far */
};

static int spread_one(struct spread *s, const struct viewed_mesh *m, struct sh_err *err)
{
    const struct mesh_sparse sparse = {s->wish->per_m2, s->wish->seed, s->report};
    struct mesh_points made = {0};
    double area_m2 = 0;
    uint32_t(*face)[3] = malloc((size_t)m->n_faces * sizeof *face);
    double *range_m = malloc((size_t)m->n_points * sizeof *range_m);
    int rc = SH_ENOMEM;
    if (face == NULL || range_m == NULL) {
        sh_fail(err, rc, "no memory to spread points over %u triangles", m->n_faces);
    } else {
        const uint32_t n = keep_faces(m, s->wish->long_edge, face);
        const struct mesh_points points = points_of(s->viewed, m, range_m);
        const struct mesh_sparse_part part = {(const uint32_t(*)[3])face, n, m->station, m->scan << 16 | m->sweep};
        rc = check_count(&points, part.face, n, s->wish, &s->sum_m2, err);
        if (rc == SH_OK) rc = mesh_sparse_add(&sparse, &points, &part, &made, &area_m2, err);
        if (rc == SH_OK) rc = append(s->out, &made, s->viewed->points.rgb != NULL, err);
    }
    mesh_points_free(&made);
    free(face);
    free(range_m);
    return rc;
}

int view_spread(const struct viewed *v, const struct view_spread *wish, const struct sh_report *report,
                struct cloud *out, struct sh_err *err)
{
    struct spread s = {v, wish, report, out, 0};
    int rc = SH_OK;
    memset(out, 0, sizeof *out);
    for (size_t i = 0; rc == SH_OK && i < v->n_meshes; i++)
        if (wish->scan == 0 || wish->scan == i + 1) rc = spread_one(&s, &v->mesh[i], err);
    return rc;
}
