/* SPDX-License-Identifier: MIT */
#include "tests/accuracy/stations.h"

#include <math.h>

#include "core/rng.h"

double station_unit(uint64_t stream, uint64_t i)
{
    return (double)(rng_u64(rng_key(stream, RNG_SCENE), i) >> 11) * 0x1p-53;
}

struct georef_spec station_spec(int i, enum georef_crs crs)
{
    uint64_t at = 3 * (uint64_t)i;
    double u = station_unit(1, at), v = station_unit(1, at + 1), w = station_unit(1, at + 2);
    int zone = i % 60;
    struct georef_spec s = {.crs = crs,
                            .station_m = {1e3 * u, -500.0 * v, 30.0 * w},
                            .lat_deg = -79.9 + 163.8 * u,
                            .lon_deg = -180.0 + 6.0 * zone + 6.0 * v,
                            .height_m = -400.0 + 9400.0 * w};
    switch (i % 8) {
    case 4:
        s.lat_deg = -75.0 + 150.0 * u;
        s.lon_deg = -180.0 + 6.0 * zone + 1.4 * v;
        s.utm_zone = zone == 0 ? 60 : zone;
        break;
    case 5:
        s.lat_deg = v < 0.5 ? 84.0 + 5.9 * u : -80.01 - 9.9 * u;
        break;
    case 6:
        s.lat_deg = 83.9;
        break;
    case 7:
        s.lon_deg = v < 0.5 ? 180.0 - 0.02 * v : -180.0 + 0.02 * (v - 0.5);
        break;
    default:
        break;
    }
    if (crs != GEOREF_UTM) s.utm_zone = 0;
    return s;
}

void station_scatter(struct station_points *p, uint64_t stream, double radius_m, double height_m)
{
    for (uint64_t i = 0; i < STATIONS_BATCH; i++) {
        double r = radius_m * (i % 8 == 0 ? 1.0 : sqrt(station_unit(stream, 3 * i)));
        double angle = 2.0 * M_PI * station_unit(stream, 3 * i + 1), up = 2.0 * station_unit(stream, 3 * i + 2) - 1.0;
        if (i % 16 == 0) up = up < 0.0 ? -1.0 : 1.0;
        p->in[0][i] = r * cos(angle);
        p->in[1][i] = r * sin(angle);
        p->in[2][i] = height_m * up;
    }
}

void station_forward(const struct georef *georef, struct station_points *p, double out[3][STATIONS_BATCH])
{
    georef_forward(georef, STATIONS_BATCH, (struct vec3_in){p->in[0], p->in[1], p->in[2]},
                   (struct vec3_out){out[0], out[1], out[2]});
}

/* A degree of latitude is at most pi/180 (a^2/b + height) long; one of longitude is that times the cosine of
 * latitude. */
double station_error_m(const struct georef *georef, const struct station_points *p)
{
    double anchor[3], worst = 0.0;
    georef_anchor(georef, anchor);
    for (int k = 0; k < STATIONS_BATCH; k++) {
        double off[3], lat_deg = anchor[0] + p->exact[0][k];
        for (int c = 0; c < 3; c++)
            off[c] = p->out[c][k] - p->exact[c][k];
        if (georef_crs(georef) == GEOREF_GEODETIC) {
            double degree_m = (6399593.626 + anchor[2] + p->exact[2][k]) * M_PI / 180.0;
            off[0] *= degree_m;
            off[1] = remainder(off[1], 360.0) * degree_m * cos(lat_deg * M_PI / 180.0);
        }
        double sum = off[0] * off[0] + off[1] * off[1] + off[2] * off[2];
        worst = sum == sum ? fmax(worst, sum) : (double)INFINITY;
    }
    return sqrt(worst);
}
