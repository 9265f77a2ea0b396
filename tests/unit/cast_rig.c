/* SPDX-License-Identifier: MIT */
#include "tests/unit/cast_rig.h"

#include "tests/common/made.h"

struct scene *box_scene(const double lo[3], const double hi[3])
{
    static const uint32_t face[6][4] = {{0, 2, 6, 4}, {1, 5, 7, 3}, {0, 4, 5, 1},
                                        {2, 3, 7, 6}, {0, 1, 3, 2}, {4, 6, 7, 5}};
    double vertex[8][3];
    uint32_t triangle[12][3];
    uint16_t label[12];
    struct scene_surface surface[6] = {{.object = ""}};
    for (int v = 0; v < 8; v++)
        for (int i = 0; i < 3; i++)
            vertex[v][i] = v >> i & 1 ? hi[i] : lo[i];
    for (int f = 0; f < 6; f++) {
        for (int t = 0; t < 2; t++) {
            triangle[2 * f + t][0] = face[f][0];
            triangle[2 * f + t][1] = face[f][1 + t];
            triangle[2 * f + t][2] = face[f][2 + t];
            label[2 * f + t] = (uint16_t)f;
        }
        snprintf(surface[f].object, sizeof surface[f].object, "wall-%d", f);
        strcpy(surface[f].material, "plain");
    }
    return made_scene(
        &(struct scene_arrays){(const double(*)[3])vertex, 8, (const uint32_t(*)[3])triangle, 12, label, surface, 6});
}

long double box_range(const double lo[3], const double hi[3], const double o[3], const long double d[3], int *wall)
{
    long double best = INFINITY;
    for (int i = 0; i < 3; i++) {
        if (d[i] == 0.0L) continue;
        long double t = ((long double)(d[i] > 0 ? hi[i] : lo[i]) - (long double)o[i]) / d[i];
        if (t < best) {
            best = t;
            *wall = 2 * i + (d[i] > 0);
        }
    }
    return best;
}

struct cast_rig *cast_rig_open(struct scene *scene, const double station_m[3])
{
    struct cast_rig *rig = calloc(1, sizeof *rig);
    struct sh_err err;
    assert_non_null(rig);
    rig->scene = scene;
    struct georef_spec local = {.crs = GEOREF_LOCAL};
    memcpy(local.station_m, station_m, sizeof local.station_m);
    if (bvh_create(scene, 1, NULL, &rig->bvh, &err) != 0 || georef_create(&local, &rig->georef, &err) != 0 ||
        caster_create(&rig->caster, &err) != 0 || line_block_alloc(&rig->block, RIG_LINE, &err) != 0)
        fail_msg("%s", err.text);
    rig->setup = (struct cast_setup){.bvh = rig->bvh,
                                     .georef = rig->georef,
                                     .range_max_m = 1000.0,
                                     .mirror_counts = 0x1p32,
                                     .pan_counts = 0x1p32,
                                     .layout = LINE_POLAR,
                                     .range_scale_m = 1e-5,
                                     .xyz_scale = {1e-5, 1e-5, 1e-5}};
    memcpy(rig->setup.station_m, station_m, sizeof rig->setup.station_m);
    pose_heading(0.0, rig->setup.rotation);
    rig->spec = (struct schedule_spec){.prr_uhz = 300000 * HZ,
                                       .lines_uhz = 100 * HZ,
                                       .pan_udeg_s = 18 * DEG,
                                       .fov_min_udeg = -40 * DEG,
                                       .sweep_udeg = 240 * DEG,
                                       .line_start_udeg = -40 * DEG,
                                       .line_stop_udeg = 200 * DEG,
                                       .pan_stop_udeg = 360 * DEG};
    schedule_start(&rig->segment, &rig->spec);
    return rig;
}

void cast_rig_close(struct cast_rig *rig)
{
    line_block_free(&rig->block);
    caster_free(rig->caster);
    georef_free(rig->georef);
    bvh_free(rig->bvh);
    scene_free(rig->scene);
    free(rig);
}

uint32_t cast_some(struct cast_rig *rig, const struct schedule_line *line, uint64_t k, uint64_t n)
{
    struct schedule_run run;
    assert_true(n <= RIG_LINE);
    schedule_get_run(&rig->segment, line, k, (uint32_t)n, &run);
    return caster_cast(rig->caster, &rig->setup, &run, &rig->block);
}

uint32_t cast_line(struct cast_rig *rig, uint64_t n, struct schedule_line *line)
{
    schedule_get_line(&rig->segment, n, line);
    return cast_some(rig, line, line->cast0, line->cast_end - line->cast0);
}

void true_angles(const struct schedule_spec *spec, uint64_t k, long double *mirror, long double *pan)
{
    long double phase =
        fmodl((long double)k * (long double)spec->lines_uhz, (long double)spec->prr_uhz) / (long double)spec->prr_uhz;
    *mirror = ((long double)spec->fov_min_udeg + (long double)spec->sweep_udeg * phase) / 360e6L;
    *pan = ((long double)spec->pan_start_udeg +
            (long double)k * (long double)spec->pan_udeg_s * HZ / (long double)spec->prr_uhz) /
           360e6L;
}

void true_direction(long double mirror_turn, long double pan_turn, long double heading_rad, long double d[3])
{
    const long double two_pi = 6.283185307179586476925286766559L;
    long double azimuth = two_pi * pan_turn + heading_rad, elevation = two_pi * mirror_turn;
    d[0] = sinl(azimuth) * cosl(elevation);
    d[1] = cosl(azimuth) * cosl(elevation);
    d[2] = sinl(elevation);
}
