/* SPDX-License-Identifier: MIT */
/* The size of a count on the wire, in units of the CRS. */
#include <math.h>

#include "core/angle.h"
#include "core/digits.h"
#include "core/georef/state.h"

/* Half a count less than the largest count, 2^31 - 1, so that rounding does not exceed it. -2^31 says that there is no
 * point. */
static const double MOST_COUNTS = 2147483646.5;

/* Finds for each coordinate its largest difference from the anchor (span) and the length of a metre (unit), both in
 * units of the CRS. */
static void spans(const struct georef *georef, double reach_m, double span[3], double unit[3])
{
    for (int i = 0; i < 3; i++) {
        span[i] = reach_m;
        unit[i] = 1.0;
    }
    if (!georef_has_map(georef)) return;
    if (georef->crs == GEOREF_ECEF) { /* prcs is a grid, whose lengths differ from true ones by less than 10 % */
        for (int i = 0; i < 3; i++)
            span[i] *= 1.1;
        return;
    }
    /* Heights differ from those of the tangent plane by reach^2 / 2R. A geoid's height changes by less than 1 % of the
     * distance. */
    span[2] = reach_m * 1.01 + reach_m * reach_m / (2 * 6.3e6);
    if (georef->crs == GEOREF_UTM) {
        double convergence_rad, scale;
        georef_convergence(georef, &convergence_rad, &scale);
        /* A grid's scale changes by less than 1e-6 per metre, and by 1 / R per metre of depth. */
        span[0] = span[1] = reach_m * scale * (1.002 + 1e-6 * reach_m);
        return;
    }
    double lat_m, lon_m, axis_m;
    georef_degrees(georef, reach_m, &lat_m, &lon_m, &axis_m);
    unit[0] = 1.0 / lat_m;
    unit[1] = angle_deg(1.0) / (axis_m + reach_m);
    /* A degree of latitude is at least 110,574 m long on the ellipsoid, and 1/57 of the depth shorter below it. 110,300
     * m is less than its length at a depth of 12 km, the lowest place of a station (locate.c). */
    span[0] = reach_m / (110300.0 - angle_rad(reach_m));
    span[1] = reach_m < axis_m ? angle_deg(asin(reach_m / axis_m)) * 1.0001 : 180.0;
    if (reach_m > 1e6) span[0] = 180.0;
}

static int is_longitude(const struct georef *georef, int i)
{
    return georef_has_map(georef) && georef->crs == GEOREF_GEODETIC && i == 1;
}

double georef_span_m(const struct georef *georef, double reach_m)
{
    double span[3], unit[3], most_m = 0.0;
    spans(georef, reach_m, span, unit);
    for (int i = 0; i < 3; i++)
        if (!is_longitude(georef, i)) most_m = fmax(most_m, span[i] / unit[i]);
    return most_m;
}

int georef_scale(const struct georef *georef, double scale_m, double reach_m, double scale[3], struct sh_err *err)
{
    double span[3], unit[3];
    const double least_m = georef_span_m(georef, reach_m) / MOST_COUNTS;
    spans(georef, reach_m, span, unit);
    for (int i = 0; i < 3; i++) {
        scale[i] = scale_m * unit[i];
        /* a full turn has to fit, however short that is on the ground */
        if (is_longitude(georef, i)) scale[i] = fmax(scale[i], span[i] / MOST_COUNTS);
    }
    if (least_m <= scale_m) return SH_OK; /* false for NaN */
    return sh_fail(
        err, SH_EINPUT,
        "coordinates up to %g m from their anchor do not fit into 31 bits at %g m per count; at least %.3g m", reach_m,
        scale_m, digits_up(least_m, 3));
}

double georef_count_m(const struct georef *georef, double reach_m, const double scale[3])
{
    double span[3], unit[3], most_m = 0.0;
    spans(georef, reach_m, span, unit);
    for (int i = 0; i < 3; i++)
        most_m = fmax(most_m, scale[i] / unit[i]);
    return most_m;
}
