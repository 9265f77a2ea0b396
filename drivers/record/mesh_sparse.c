/* SPDX-License-Identifier: MIT */
#include "drivers/record/mesh_sparse.h"

#include <math.h>
#include <string.h>
#include <unistd.h>

#include "core/digits.h"
#include "core/studio/mesh.h"
#include "core/studio/scan_mesh.h"

enum { POINTS_BETWEEN_STOPS = 1 << 16 };
enum { BYTES_A_POINT = 110 }; /* of struct mesh_points, whose arrays grow by half */

static uint8_t mixed(const uint8_t (*rgb)[3], const uint32_t face[3], const double weight[3], int channel)
{
    double sum = 0;
    for (int k = 0; k < 3; k++)
        sum += weight[k] * rgb[face[k]][channel];
    return (uint8_t)lrint(fmin(255, fmax(0, sum)));
}

static void interpolate(const struct mesh_points *p, const uint32_t face[3], const double weight[3],
                        struct mesh_point *point)
{
    int near = 0;
    double reflectance = 0;
    for (int k = 1; k < 3; k++)
        if (weight[k] > weight[near]) near = k;
    memset(point, 0, sizeof *point);
    for (int k = 0; k < 3; k++) {
        const uint32_t i = face[k];
        for (int d = 0; d < 3; d++)
            point->xyz_m[d] += weight[k] * p->xyz_m[i][d];
        point->range_m += weight[k] * p->range_m[i];
        reflectance += weight[k] * (double)p->reflectance_db[i];
        if (p->has_frame) point->frame += weight[k] * p->frame[i];
        if (p->rgb != NULL) point->rgb[k] = mixed((const uint8_t(*)[3])p->rgb, face, weight, k);
    }
    point->reflectance_db = (float)reflectance;
    point->label = p->label[face[near]];
    point->station = p->station[face[near]];
}

/* Refuses more points than a file or the memory can hold, before they are made. With a broken stream the area may be
 * infinite. */
static int check_count(double n, double area_m2, double per_m2, struct sh_err *err)
{
    const double there = (double)sysconf(_SC_PHYS_PAGES) * (double)sysconf(_SC_PAGESIZE), held = there / BYTES_A_POINT;
    if (!isfinite(n)) return sh_fail(err, SH_EINPUT, "--sparse %g: the mesh has an area of %g m2", per_m2, area_m2);
    if (n > MESH_MAX_VERTICES)
        return sh_fail(err, SH_EINPUT,
                       "--sparse %g: %.4g m2 of mesh would get %.4g points; a file holds %d: give at most %.3g", per_m2,
                       area_m2, n, MESH_MAX_VERTICES, digits_down(MESH_MAX_VERTICES / area_m2, 3));
    if (there <= 0 || n <= held) return SH_OK;
    return sh_fail(err, SH_EINPUT,
                   "--sparse %g: %.4g m2 of mesh would get %.4g points; there is memory for %.3g: give at most %.3g",
                   per_m2, area_m2, n, held, digits_down(held / area_m2, 3));
}

static int add_points(const struct mesh_sparse *sparse, const struct scan_sampler *sampler,
                      const struct mesh_points *points, uint64_t n, struct mesh_points *out, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint64_t k = 0; rc == SH_OK && k < n; k++) {
        struct mesh_point point;
        uint32_t face;
        double weight[3];
        if (k % POINTS_BETWEEN_STOPS == POINTS_BETWEEN_STOPS - 1) {
            sh_progress(sparse->report, "spreading points over the mesh", (double)k / (double)n);
            if ((rc = sh_check_stop(sparse->report, err)) != SH_OK) break;
        }
        scan_sampler_point(sampler, k, &face, weight);
        interpolate(points, sampler->face[face], weight, &point);
        rc = mesh_points_add(out, &point, err);
    }
    return rc;
}

int mesh_sparse_add(const struct mesh_sparse *sparse, const struct mesh_points *points,
                    const struct mesh_sparse_part *part, struct mesh_points *out, double *area_m2, struct sh_err *err)
{
    struct scan_sampler sampler;
    int rc = scan_sampler_start(&sampler, (const double(*)[3])points->xyz_m, part->face, part->n_faces,
                                scan_sampler_key(sparse->seed, part->station, part->scan), err);
    if (rc == SH_OK) {
        const double n = scan_sampler_count(&sampler, sparse->per_m2);
        *area_m2 += sampler.area_m2;
        rc = check_count(n + out->n, *area_m2, sparse->per_m2, err);
        if (rc == SH_OK) rc = add_points(sparse, &sampler, points, (uint64_t)n, out, err);
    }
    scan_sampler_free(&sampler);
    return rc;
}
