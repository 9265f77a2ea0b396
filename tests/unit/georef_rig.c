/* SPDX-License-Identifier: MIT */
#include "tests/unit/georef_rig.h"

struct georef *make(enum georef_crs crs, double lat_deg, double lon_deg, double height_m, int zone)
{
    struct georef_spec spec = {.crs = crs,
                               .station_m = {10, 20, 30},
                               .lat_deg = lat_deg,
                               .lon_deg = lon_deg,
                               .height_m = height_m,
                               .utm_zone = zone};
    struct georef *georef = NULL;
    struct sh_err err = {0, ""};
    if (georef_create(&spec, &georef, &err) != SH_OK) fail_msg("%s", err.text);
    return georef;
}

void expect_near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("%.12g instead of %.12g, off by %.3g", got, want, got - want);
}

void expect_point(const double got[3], double x, double y, double z, double tolerance)
{
    expect_near(got[0], x, tolerance);
    expect_near(got[1], y, tolerance);
    expect_near(got[2], z, tolerance);
}

void forward_one(const struct georef *georef, const double d[3], double out[3])
{
    georef_forward(georef, 1, (struct vec3_in){&d[0], &d[1], &d[2]}, (struct vec3_out){&out[0], &out[1], &out[2]});
}
