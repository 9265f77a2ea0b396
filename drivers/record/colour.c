/* SPDX-License-Identifier: MIT */
#include "drivers/record/colour.h"

#include <math.h>
#include <string.h>

#include "core/mat3.h"
#include "drivers/protocol/native.h"
#include "drivers/record/track.h"

int colour_check(enum colour_mode mode, const struct track *t, struct sh_err *err)
{
    if (mode == COLOUR_FRAME && !t->info.moving && !t->info.stop)
        return sh_fail(err, SH_EFORMAT,
                       "%s: colour by frame, but the head is on no trajectory, so points have no frame scalar",
                       t->path);
    if (mode == COLOUR_RANGE && t->info.moving && t->info.geo)
        return sh_fail(err, SH_EFORMAT,
                       "%s: colour by range, but in the geo layout the ranges of a moving head are not known; allowed "
                       "output.colour: range, with limits, or output.layout: polar",
                       t->path);
    if (mode == COLOUR_HEIGHT && t->info.moving && t->crs == NATIVE_CRS_ECEF)
        return sh_fail(
            err, SH_EFORMAT,
            "%s: colour by height, but in ECEF the heights of a moving head are not known; allowed output.colour: "
            "height, with limits, or another output.crs",
            t->path);
    return 0;
}

/* Metres east and north of the anchor, and up from its level, where the CRS has such axes. */
static void from_anchor(const struct track *t, const double p[3], double d[3])
{
    const struct scanhead_info *info = &t->info;
    const double *a = info->anchor;
    for (int i = 0; i < 3; i++)
        d[i] = p[i] - a[i];
    if (info->crs == NATIVE_CRS_GEODETIC) station_pose_level(&t->pose, p[0], p[1], d);
    const int is_own = memcmp(info->station_m, a, sizeof info->station_m) == 0; /* the scene lies in the grid itself */
    if ((info->crs == NATIVE_CRS_UTM && !is_own) || info->crs == NATIVE_CRS_GEODETIC)
        d[2] -= (d[0] * d[0] + d[1] * d[1]) / (2 * EARTH_RADIUS_M); /* the surface falls away below the level */
}

static double height_of(const struct track *t, int i)
{
    double p[3] = {t->points.x[i], t->points.y[i], t->points.z[i]}, d[3], scene[3];
    if (!t->info.geo) {
        station_pose_forward(&t->pose, p);
        return p[2];
    }
    if (t->info.moving || t->info.crs == NATIVE_CRS_LOCAL) return p[2];
    from_anchor(t, p, d);
    mat3_apply_transposed(t->info.axes, d, scene);
    return t->info.station_m[2] + scene[2];
}

double colour_figure(enum colour_mode mode, const struct track *t, int i)
{
    if (t->points.echo_count[i] == 0) return (double)NAN;
    switch (mode) {
    case COLOUR_RANGE:
        return t->points.range_m[i];
    case COLOUR_HEIGHT:
        return height_of(t, i);
    case COLOUR_FRAME:
        return t->info.moving ? t->frame[i] : t->info.frame;
    default:
        return (double)NAN;
    }
}

void colour_of_point(const struct colour_scale *scale, const struct track *t, int i, uint8_t rgb[3])
{
    const struct track_points *p = &t->points;
    memcpy(rgb, colour_grey, 3);
    if (p->echo_count[i] == 0) return;
    if (scale->mode == COLOUR_SOLID) memcpy(rgb, scale->rgb, 3);
    if (scale->mode == COLOUR_REFLECTANCE) colour_reflectance(p->reflectance_db[i], rgb);
    if (scale->mode == COLOUR_LABEL && p->label[i] != SCANHEAD_NO_LABEL) colour_number(p->label[i], rgb);
    if (colour_has_limits(scale->mode)) colour_between(scale->low, scale->high, colour_figure(scale->mode, t, i), rgb);
}
