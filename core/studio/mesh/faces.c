/* SPDX-License-Identifier: MIT */
/* Computes from triangles: normals of points, which points are in use, and points spread evenly over the area. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/rng.h"
#include "core/studio/scan_mesh.h"
#include "core/vec3.h"

void scan_normals(const double (*xyz_m)[3], uint32_t n_points, const uint32_t (*face)[3], uint32_t n_faces,
                  float (*normal)[3])
{
    memset(normal, 0, (size_t)n_points * sizeof *normal);
    for (uint32_t i = 0; i < n_faces; i++) {
        double n[3];
        vec3_normal(xyz_m[face[i][0]], xyz_m[face[i][1]], xyz_m[face[i][2]], n);
        for (int corner = 0; corner < 3; corner++)
            for (int k = 0; k < 3; k++)
                normal[face[i][corner]][k] += (float)n[k];
    }
    for (uint32_t i = 0; i < n_points; i++) {
        const double x = (double)normal[i][0], y = (double)normal[i][1], z = (double)normal[i][2];
        const double len = sqrt(x * x + y * y + z * z);
        for (int k = 0; k < 3 && len > 0; k++)
            normal[i][k] = (float)((double)normal[i][k] / len);
    }
}

uint32_t scan_drop_loose(uint32_t n_points, uint32_t (*face)[3], uint32_t n_faces, uint32_t *to)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < n_points; i++)
        to[i] = SCAN_MESH_NONE;
    for (uint32_t i = 0; i < n_faces; i++)
        for (int k = 0; k < 3; k++)
            to[face[i][k]] = 0;
    for (uint32_t i = 0; i < n_points; i++)
        if (to[i] == 0) to[i] = n++;
    for (uint32_t i = 0; i < n_faces; i++)
        for (int k = 0; k < 3; k++)
            face[i][k] = to[face[i][k]];
    return n;
}

uint64_t scan_sampler_key(uint64_t seed, uint32_t station, uint32_t scan)
{
    return rng_key(seed, RNG_SPARSE) ^ rng_scan(station, scan);
}

int scan_sampler_start(struct scan_sampler *s, const double (*xyz_m)[3], const uint32_t (*face)[3], uint32_t n_faces,
                       uint64_t key, struct sh_err *err)
{
    *s = (struct scan_sampler){.xyz_m = xyz_m, .face = face, .n_faces = n_faces, .key = key};
    if (n_faces == 0) return SH_OK;
    s->sum_m2 = malloc(n_faces * sizeof *s->sum_m2);
    if (s->sum_m2 == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the areas of %u triangles", n_faces);
    for (uint32_t i = 0; i < n_faces; i++) {
        double n[3];
        vec3_normal(xyz_m[face[i][0]], xyz_m[face[i][1]], xyz_m[face[i][2]], n);
        s->area_m2 += 0.5 * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
        s->sum_m2[i] = s->area_m2;
    }
    return SH_OK;
}

void scan_sampler_free(struct scan_sampler *s)
{
    free(s->sum_m2);
    memset(s, 0, sizeof *s);
}

double scan_sampler_count(const struct scan_sampler *s, double per_m2)
{
    return round(s->area_m2 * per_m2);
}

/* Returns u, 0 <= u < 1, in steps of 2^-53. */
static double uniform(uint64_t bits)
{
    return (double)(bits >> 11) * 0x1p-53;
}

/* Returns the first face whose sum is above x. */
static uint32_t face_at(const struct scan_sampler *s, double x)
{
    uint32_t low = 0, high = s->n_faces - 1;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2;
        if (s->sum_m2[middle] > x)
            high = middle;
        else
            low = middle + 1;
    }
    return low;
}

/* The weights are 1 - sqrt(u), sqrt(u) (1 - v), sqrt(u) v: uniform within the triangle (Turk, Graphics Gems, 1990). */
void scan_sampler_point(const struct scan_sampler *s, uint64_t k, uint32_t *face, double weight[3])
{
    *face = face_at(s, uniform(rng_u64(s->key, rng_echo(k, 0))) * s->area_m2);
    const double root = sqrt(uniform(rng_u64(s->key, rng_echo(k, 1)))), v = uniform(rng_u64(s->key, rng_echo(k, 2)));
    weight[1] = root * (1 - v);
    weight[2] = root * v;
    weight[0] = 1 - weight[1] - weight[2];
}
