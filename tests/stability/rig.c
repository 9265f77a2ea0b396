/* SPDX-License-Identifier: MIT */
#include "tests/common/hits.h"
#include "tests/stability/rig.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/rng.h"
#include "tests/common/sight_beside.h"

static const double RANGE_MAX_M = 1e5;

void rig_rebuild(struct rig *rig, unsigned threads)
{
    struct sh_err err;
    bvh_free(rig->bvh);
    rig->bvh = NULL;
    if (bvh_create(rig->scene, threads, NULL, &rig->bvh, &err) != SH_OK) fail_msg("%s", err.text);
}

void rig_open(struct rig *rig, struct scene *scene, const double station_m[3])
{
    struct sh_err err;
    *rig = (struct rig){.scene = scene};
    memcpy(rig->station_m, station_m, sizeof rig->station_m);
    rig_rebuild(rig, 1);
    if (caster_create(&rig->caster, &err) != SH_OK) fail_msg("%s", err.text);
    rig->reference = reference_create((const double(*)[3])scene->vertex_m, (const uint32_t(*)[3])scene->triangle,
                                      scene->n_triangles);
    if (rig->reference == NULL) fail_msg("no memory for the reference");
}

void rig_close(struct rig *rig)
{
    bvh_free(rig->bvh);
    caster_free(rig->caster);
    reference_free(rig->reference);
    scene_free(rig->scene);
    free(rig->dx);
    free(rig->dy);
    free(rig->dz);
    free(rig->range_m);
    free(rig->triangle);
    free(rig->truth);
    *rig = (struct rig){0};
}

static void *more(void *array, uint32_t n, size_t size)
{
    array = realloc(array, n * size);
    if (array == NULL) fail_msg("no memory for rays");
    return array;
}

void rig_direct(struct rig *rig, double x, double y, double z)
{
    if (rig->n == rig->capacity) {
        uint32_t n = rig->capacity = 2 * rig->capacity + 1024;
        rig->dx = more(rig->dx, n, sizeof *rig->dx);
        rig->dy = more(rig->dy, n, sizeof *rig->dy);
        rig->dz = more(rig->dz, n, sizeof *rig->dz);
        rig->range_m = more(rig->range_m, n, sizeof *rig->range_m);
        rig->triangle = more(rig->triangle, n, sizeof *rig->triangle);
        rig->truth = more(rig->truth, n, sizeof *rig->truth);
    }
    double length = sqrt(x * x + y * y + z * z);
    rig->dx[rig->n] = x / length;
    rig->dy[rig->n] = y / length;
    rig->dz[rig->n++] = z / length;
}

void rig_aim(struct rig *rig, const double p[3])
{
    rig_direct(rig, p[0] - rig->station_m[0], p[1] - rig->station_m[1], p[2] - rig->station_m[2]);
}

void rig_line_ahead(struct schedule_segment *segment, struct schedule_line *line, struct schedule_run *run)
{
    const struct schedule_spec spec = {.prr_uhz = 288000000000,
                                       .lines_uhz = 3000000,
                                       .fov_min_udeg = -40000000,
                                       .sweep_udeg = 240000000,
                                       .line_start_udeg = -500000,
                                       .line_stop_udeg = 500000};
    schedule_start(segment, &spec);
    schedule_get_line(segment, 0, line);
    schedule_get_run(segment, line, line->cast0, RIG_LINE_PULSES, run);
}

double rig_unit(uint64_t seed, uint64_t i)
{
    return (double)(int64_t)(rng_u64(rng_mix(seed), i) >> 11) * 0x1p-53;
}

void rig_aim_at_sphere(struct rig *rig, uint32_t n, uint64_t seed)
{
    for (uint32_t i = 0; i < n; i++) {
        double z = 2.0 * rig_unit(seed, 2 * (uint64_t)i) - 1.0, turn = rig_unit(seed, 2 * (uint64_t)i + 1);
        double r = sqrt(1.0 - z * z);
        rig_direct(rig, r * cos(turn * VEC_TURN_RAD), r * sin(turn * VEC_TURN_RAD), z);
    }
}

void rig_clear(struct rig *rig)
{
    rig->n = 0;
}

void rig_look(struct rig *rig)
{
    for (uint32_t i = 0; i < rig->n; i++) {
        const double dir[3] = {rig->dx[i], rig->dy[i], rig->dz[i]};
        rig->truth[i] = reference_cast(rig->reference, rig->station_m, dir);
    }
}

/* The sight is made for 10^6 rays, as many as a quick scan has. */
static void check_sight(struct rig *rig)
{
    struct sight_beside beside;
    struct sh_err err;
    struct sight_spec spec = {.bvh = rig->bvh, .rays = 1e6, .memory_bytes = 64 << 20};
    const struct vec3_in dir = {rig->dx, rig->dy, rig->dz};
    memcpy(spec.station_m, rig->station_m, sizeof spec.station_m);
    if (sight_beside_create(&spec, &beside, &err) != SH_OK) fail_msg("%s", err.text);
    sight_beside_check(&beside, rig->n, &dir, RANGE_MAX_M, rig->range_m, rig->triangle);
    sight_beside_print(&beside);
    const uint64_t differ = beside.differ;
    sight_beside_free(&beside);
    if (differ != 0) fail_msg("%llu of %u rays differ by sight", (unsigned long long)differ, rig->n);
}

void rig_cast(struct rig *rig)
{
    hits_from(rig->caster, rig->bvh, rig->station_m, RANGE_MAX_M, rig->n, rig->dx, rig->dy, rig->dz, rig->range_m,
              rig->triangle);
    check_sight(rig);
}

void rig_cast_naive(struct rig *rig, const double origin_m[3], int robust, unsigned packet)
{
    struct naive *naive = naive_create(rig->scene, origin_m, robust, 1);
    if (naive == NULL) fail_msg("Embree can't build the naive mesh");
    naive_hits(naive, packet, rig->station_m, rig->n, rig->dx, rig->dy, rig->dz, rig->range_m, rig->triangle);
    naive_free(naive);
}

struct rig_errors rig_errors_of(const struct rig *rig, int judge)
{
    struct rig_errors errors = {0};
    for (uint32_t i = 0; i < rig->n; i++) {
        const double dir[3] = {rig->dx[i], rig->dy[i], rig->dz[i]};
        double error = reference_error(&rig->truth[i], rig->range_m[i]);
        if (error > RIG_MICROMETRE && judge &&
            reference_is_undecidable(rig->reference, rig->station_m, dir, &rig->truth[i], rig->range_m[i])) {
            errors.undecidable++;
            continue;
        }
        errors.wrong += error > RIG_MICROMETRE;
        errors.coarse += error > 1e-2;
        errors.missed += isinf(error) != 0;
        if (!isinf(error)) errors.max_m = fmax(errors.max_m, error);
    }
    return errors;
}

void rig_row_of_ranges(struct rig *rig, const char *regime, const double naive_origin_m[3], double bound_m)
{
    rig_look(rig);
    rig_cast_naive(rig, naive_origin_m, 1, 16);
    struct rig_errors naive = rig_errors_of(rig, 0);
    rig_cast(rig);
    struct rig_errors ours = rig_errors_of(rig, 1);
    table_row(regime, "float rays and vertices", naive.max_m, ours.missed != 0 ? (double)INFINITY : ours.max_m, bound_m,
              "m");
    if (ours.undecidable != 0)
        table_note("%llu of %u rays pass an edge too near for double precision", (unsigned long long)ours.undecidable,
                   rig->n);
}

void rig_row_of_rays(struct rig *rig, const char *regime, const double naive_origin_m[3])
{
    rig_look(rig);
    rig_cast_naive(rig, naive_origin_m, 1, 16);
    struct rig_errors naive = rig_errors_of(rig, 0);
    rig_cast(rig);
    struct rig_errors ours = rig_errors_of(rig, 1);
    table_row(regime, "float rays and vertices", (double)naive.coarse, (double)ours.wrong, 0.0, "rays");
    table_note("of %u rays; largest error naive %.3g m, ours %.3g m; %llu pass an edge too near for double "
               "precision",
               rig->n, naive.max_m, ours.max_m, (unsigned long long)ours.undecidable);
}
