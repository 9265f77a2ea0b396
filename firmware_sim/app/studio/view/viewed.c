/* SPDX-License-Identifier: MIT */
/* Loads a recording, by its ending and first bytes. This file has the steps that all formats share. */
#include "firmware_sim/app/studio/view/viewed.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/geoframe.h"
#include "core/georef.h"
#include "core/grow.h"
#include "core/infile.h"
#include "core/mat3.h"
#include "core/pose.h"
#include "core/vec3.h"
#include "firmware_sim/app/app.h"

enum { EPSG_ECEF = 4978, EPSG_GEODETIC = 4979 };

int viewed_check_ending(const char *path, struct sh_err *err)
{
    static const char allowed[] = "allowed FILE.shs, FILE.pcapng, FILE.ply, FILE.las";
    if (strcmp(path, "-") == 0)
        return sh_fail(err, SH_EINPUT, "-: a recording is shown from a file, not from standard input; %s", allowed);
    if (app_is_recording(path) || app_ends_in(path, ".ply") || app_ends_in(path, ".las")) return SH_OK;
    if (app_ends_in(path, ".e57") || app_ends_in(path, ".ptx"))
        return sh_fail(
            err, SH_EINPUT,
            "%s: this format is written, not read; %s: `scanhead record` can write a scan to several files at once "
            "(with another -o scan.ply), and CloudCompare saves such files as .ply",
            path, allowed);
    if (app_ends_in(path, ".yaml") || app_ends_in(path, ".yml"))
        return sh_fail(err, SH_EINPUT,
                       "%s: this is a configuration, not a recording: `scanhead run %s --view` shows its head; %s",
                       path, path, allowed);
    if (app_ends_in(path, ".laz"))
        return sh_fail(err, SH_EINPUT, "%s: compressed (LAZ), which is not read; %s", path, allowed);
    return sh_fail(err, SH_EINPUT, "%s: recordings with this ending are not shown; %s", path, allowed);
}

/* Checks that the path leads to a file that is not empty, and reads its first bytes. */
static int look_at(const char *path, char head[4], struct sh_err *err)
{
    const char *why;
    FILE *in = infile_open(path, &why);
    if (in == NULL) return sh_fail(err, SH_EINPUT, "%s: %s", path, why);
    memset(head, 0, 4);
    const size_t n = fread(head, 1, 4, in);
    const int failed = ferror(in);
    fclose(in);
    if (failed) return sh_fail(err, SH_EIO, "%s: reading failed", path);
    return n > 0 ? SH_OK : sh_fail(err, SH_EINPUT, "%s: the file is empty", path);
}

/* ---- places */

int viewed_can_show(int64_t epsg, const double p[3])
{
    static const double most = 1e12;
    return fabs(p[0]) <= (epsg == EPSG_GEODETIC ? 90.0 : most) && fabs(p[1]) <= most && fabs(p[2]) <= most;
}

static void to_enu(const struct geoframe *frame, int is_geodetic, double p[3])
{
    const struct georef_place at = {p[0], p[1], p[2]};
    if (is_geodetic) georef_geodetic_to_ecef(&at, p);
    const double d[3] = {p[0] - frame->ecef_m[0], p[1] - frame->ecef_m[1], p[2] - frame->ecef_m[2]};
    mat3_apply_transposed(frame->rotation, d, p);
}

/* Turns the angles of a head in ECEF to the new frame. Where points are in degrees, the angles of a head are relative
 * to east, north and up at its own place already. */
static void turn_station(const struct geoframe *frame, struct viewed_station *s)
{
    double quat[4], in_ecef[9], back[9], turned[9];
    pose_from_angles(s->heading_rad, s->pitch_rad, s->roll_rad, quat);
    quat_matrix(quat, in_ecef);
    mat3_transpose(frame->rotation, back);
    mat3_multiply(back, in_ecef, turned);
    pose_from_matrix(turned, quat);
    pose_to_angles(quat, &s->heading_rad, &s->pitch_rad, &s->roll_rad);
}

/* Takes points and stations in ECEF or in degrees to metres east, north, up of the first point. */
static int turn_to_enu(struct viewed *v, struct sh_err *err)
{
    static const double zero[3] = {0, 0, 0};
    const int is_geodetic = v->points.epsg == EPSG_GEODETIC;
    struct geoframe frame;
    struct georef_place at;
    if ((!is_geodetic && v->points.epsg != EPSG_ECEF) || v->points.n == 0) return SH_OK;
    const double *first = v->points.xyz_m[0];
    struct sh_err why = {0};
    int rc = SH_OK;
    at = (struct georef_place){first[0], first[1], first[2]};
    if (!is_geodetic) rc = georef_locate_ecef(first, &at, &why);
    if (rc == SH_OK) rc = geoframe_set_tangent(&frame, zero, &at, 0, &why);
    if (rc != SH_OK) return sh_fail(err, rc, "%s: its first point: %s", v->path, why.text);
    for (uint32_t i = 0; i < v->points.n; i++)
        to_enu(&frame, is_geodetic, v->points.xyz_m[i]);
    for (size_t i = 0; i < v->n_stations; i++) {
        if (!v->station[i].placed) continue;
        to_enu(&frame, is_geodetic, v->station[i].p_m);
        if (!is_geodetic) turn_station(&frame, &v->station[i]);
    }
    v->turned = 1;
    v->lat_deg = at.lat_deg;
    v->lon_deg = at.lon_deg;
    v->height_m = at.height_m;
    return SH_OK;
}

/* ---- figures */

/* Value i of a column that has one number a point. */
static double value_of(const struct cloud *p, enum cloud_column column, uint32_t i)
{
    switch (column) {
    case CLOUD_RANGE:
        return (double)p->range_m[i];
    case CLOUD_REFLECTANCE:
        return (double)p->reflectance_db[i];
    case CLOUD_AMPLITUDE:
        return (double)p->amplitude_db[i];
    case CLOUD_TIME:
        return p->time_s[i];
    case CLOUD_LABEL:
        return p->label[i] != CLOUD_LABEL_NONE ? p->label[i] : (double)NAN;
    case CLOUD_STATION:
        return p->station[i];
    case CLOUD_ECHO:
        return p->echo[i];
    case CLOUD_ECHO_COUNT:
        return p->echo_count[i];
    default:
        return (double)NAN;
    }
}

static void measure_column(struct viewed *v, enum cloud_column column)
{
    double low = INFINITY, high = -INFINITY;
    size_t size;
    const int there = cloud_array(&v->points, column, &size) != NULL;
    for (uint32_t i = 0; there && i < v->points.n; i++) {
        const double x = value_of(&v->points, column, i);
        if (!isfinite(x)) continue;
        low = fmin(low, x);
        high = fmax(high, x);
    }
    v->low[column] = low <= high ? low : (double)NAN;
    v->high[column] = low <= high ? high : (double)NAN;
}

void viewed_measure(struct viewed *v)
{
    vec3_bound_nothing(v->min_m, v->max_m);
    for (uint32_t i = 0; i < v->points.n; i++)
        vec3_bound(v->min_m, v->max_m, v->points.xyz_m[i]);
    for (int k = 0; k < 3; k++)
        v->origin_m[k] = round(0.5 * v->min_m[k] + 0.5 * v->max_m[k]);
    for (int c = 0; c < CLOUD_COLUMNS; c++)
        measure_column(v, (enum cloud_column)c);
    v->t0_s = v->low[CLOUD_TIME];
}

/* ---- names */

int viewed_add_surface(struct viewed *v, uint32_t label, const char *object, const char *material, struct sh_err *err)
{
    if (!grow(&v->surface, &v->room_surfaces, v->n_surfaces + 1, sizeof *v->surface))
        return sh_fail(err, SH_ENOMEM, "no memory for the surfaces' names");
    struct viewed_surface *s = &v->surface[v->n_surfaces++];
    *s = (struct viewed_surface){label, strdup(object), strdup(material)};
    return s->object != NULL && s->material != NULL ? SH_OK
                                                    : sh_fail(err, SH_ENOMEM, "no memory for the surfaces' names");
}

struct viewed_station *viewed_add_station(struct viewed *v, uint32_t number, struct sh_err *err)
{
    for (size_t i = 0; i < v->n_stations; i++)
        if (v->station[i].number == number) return &v->station[i];
    if (!grow(&v->station, &v->room_stations, v->n_stations + 1, sizeof *v->station)) {
        sh_fail(err, SH_ENOMEM, "no memory for the stations");
        return NULL;
    }
    v->station[v->n_stations] = (struct viewed_station){.number = number};
    return &v->station[v->n_stations++];
}

int viewed_load(struct viewed *v, const char *path, const struct sh_report *report, struct sh_err *err)
{
    char head[4];
    *v = (struct viewed){.path = path, .complete = 1, .points.epsg = CLOUD_EPSG_UNKNOWN};
    int rc = viewed_check_ending(path, err);
    if (rc == SH_OK) rc = look_at(path, head, err);
    if (rc != SH_OK) return rc;
    v->format = app_is_recording(path) ? "shs" : memcmp(head, "LASF", 4) == 0 ? "las" : "ply";
    rc = strcmp(v->format, "shs") == 0 ? viewed_load_stream(v, report, err) : viewed_load_cloud(v, report, err);
    if (rc != SH_OK) return rc;
    if (v->n_left_out > 0)
        sh_warn(
            report,
            "%s: %llu echoes left out, since their place is not known, or is beyond 1e12 m or a latitude of 90 degrees",
            path, (unsigned long long)v->n_left_out);
    if (v->points.n == 0)
        return sh_fail(err, SH_EINPUT, "%s: it has no points, but %llu shots without echo", path,
                       (unsigned long long)v->n_empty);
    rc = turn_to_enu(v, err);
    if (rc == SH_OK) viewed_measure(v);
    return rc;
}

void viewed_free(struct viewed *v)
{
    cloud_free(&v->points);
    for (size_t i = 0; i < v->n_meshes; i++) {
        free(v->mesh[i].face);
        free(v->mesh[i].ratio);
        free(v->mesh[i].order);
    }
    for (size_t i = 0; i < v->n_surfaces; i++) {
        free(v->surface[i].object);
        free(v->surface[i].material);
    }
    free(v->mesh);
    free(v->surface);
    free(v->station);
    memset(v, 0, sizeof *v);
}
