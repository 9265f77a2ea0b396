/* SPDX-License-Identifier: MIT */
#include "tests/common/geodesy.h"

void geodesy_ecef(double lat_deg, double lon_deg, double height_m, const double d[3], long double p[3])
{
    long double lat = (long double)lat_deg * GEODESY_PI / 180, lon = (long double)lon_deg * GEODESY_PI / 180;
    long double sa = sinl(lat), ca = cosl(lat), so = sinl(lon), co = cosl(lon);
    if (fabs(lat_deg) == 90.0) ca = 0;
    long double n = GEODESY_A / sqrtl(1 - GEODESY_E2 * sa * sa), e = d[0], north = d[1], u = d[2], h = height_m;
    p[0] = (n + h) * ca * co - so * e - sa * co * north + ca * co * u;
    p[1] = (n + h) * ca * so + co * e - sa * so * north + ca * so * u;
    p[2] = (n * (1 - GEODESY_E2) + h) * sa + ca * north + sa * u;
}

/* The fixed point gains a factor of e^2 a step. */
static struct geodesy geodesy_locate(const long double p[3])
{
    long double flat = hypotl(p[0], p[1]), lat = atan2l(p[2], flat * (1 - GEODESY_E2));
    for (int i = 0; i < 10; i++) {
        long double s = sinl(lat);
        lat = atan2l(p[2] + GEODESY_E2 * GEODESY_A / sqrtl(1 - GEODESY_E2 * s * s) * s, flat);
    }
    long double s = sinl(lat);
    return (struct geodesy){lat, atan2l(p[1], p[0]),
                            flat * cosl(lat) + p[2] * s - GEODESY_A * sqrtl(1 - GEODESY_E2 * s * s)};
}

static long double geodesy_isometric(long double lat)
{
    long double e = sqrtl(GEODESY_E2);
    return asinhl(tanl(lat)) - e * atanhl(e * sinl(lat));
}

static void geodesy_legendre(long double x[GEODESY_NODES], long double w[GEODESY_NODES])
{
    for (int i = 0; i < GEODESY_NODES; i++) {
        long double t = cosl(GEODESY_PI * (i + 0.75L) / (GEODESY_NODES + 0.5L)), slope = 1;
        for (int k = 0; k < 8; k++) {
            long double p = 1, before = 0;
            for (int j = 1; j <= GEODESY_NODES; j++) {
                long double next = ((2 * j - 1) * t * p - (j - 1) * before) / j;
                before = p;
                p = next;
            }
            slope = GEODESY_NODES * (t * p - before) / (t * t - 1);
            t -= p / slope;
        }
        x[i] = t;
        w[i] = 2 / ((1 - t * t) * slope * slope);
    }
}

void geodesy_utm(struct geodesy at, int zone, long double *x, long double *y)
{
    static long double node[GEODESY_NODES], weight[GEODESY_NODES];
    if (weight[0] == 0) geodesy_legendre(node, weight);
    long double e = sqrtl(GEODESY_E2), lon0 = (6.0L * zone - 183) * GEODESY_PI / 180;
    long double complex w = geodesy_isometric(at.lat_rad) + I * remainderl(at.lon_rad - lon0, 2 * GEODESY_PI);
    long double complex s = ctanhl(w);
    for (int i = 0; i < 10; i++)
        s = ctanhl(w + e * catanhl(e * s));
    long double complex lat = casinl(s), arc = 0;
    for (int i = 0; i < GEODESY_NODES; i++) {
        long double complex t = csinl(lat * (node[i] + 1) / 2), q = 1 - GEODESY_E2 * t * t;
        arc += weight[i] / (q * csqrtl(q));
    }
    arc *= 0.9996L * GEODESY_A * (1 - GEODESY_E2) * lat / 2;
    *x = cimagl(arc);
    *y = creall(arc);
}

/* Distances count from the pole, scaled by 0.994. */
static void geodesy_ups(struct geodesy at, int north, long double *x, long double *y)
{
    long double e = sqrtl(GEODESY_E2), sign = north ? 1 : -1;
    long double rho = 2 * 0.994L * GEODESY_A * expl(-sign * geodesy_isometric(at.lat_rad)) /
                      sqrtl(powl(1 + e, 1 + e) * powl(1 - e, 1 - e));
    *x = rho * sinl(at.lon_rad);
    *y = -sign * rho * cosl(at.lon_rad);
}

void geodesy_position(int epsg, const long double p_ecef[3], long double out[3])
{
    struct geodesy at = geodesy_locate(p_ecef);
    int zone = epsg % 100, north = epsg / 100 == 326;
    for (int i = 0; i < 3; i++)
        out[i] = p_ecef[i];
    if (epsg == 4978) return;
    out[2] = at.height_m;
    if (epsg == 4979) {
        out[0] = at.lat_rad * 180 / GEODESY_PI;
        out[1] = at.lon_rad * 180 / GEODESY_PI;
    } else if (zone == 61) {
        geodesy_ups(at, north, &out[0], &out[1]);
        out[0] += 2e6L;
        out[1] += 2e6L;
    } else {
        geodesy_utm(at, zone, &out[0], &out[1]);
        out[0] += 5e5L;
        if (!north) out[1] += 1e7L;
    }
}

double geodesy_error_m(int epsg, const double anchor[3], const double d[3], const long double p_ecef[3])
{
    long double truth[3], off[3];
    geodesy_position(epsg, p_ecef, truth);
    for (int i = 0; i < 3; i++)
        off[i] = (long double)anchor[i] + (long double)d[i] - truth[i];
    if (epsg == 4979) {
        off[0] *= 6399593.626L * GEODESY_PI / 180;
        off[1] = remainderl(off[1], 360) * hypotl(p_ecef[0], p_ecef[1]) * GEODESY_PI / 180;
    }
    return (double)sqrtl(off[0] * off[0] + off[1] * off[1] + off[2] * off[2]);
}
