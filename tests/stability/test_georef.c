/* SPDX-License-Identifier: MIT */
/* Common shortcuts on the way to the Earth, and places where they fail: poles, the antimeridian, zones' borders and
 * exceptions, heights, distance from the anchor. The truth is tests/common/geodesy.h, which shares nothing with
 * GeographicLib. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/geoframe.h"
#include "core/locate.h"
#include "core/plan.h"
#include "tests/common/geodesy.h"
#include "tests/stability/rig.h"

enum { POINTS = 300 };
#define RADIUS_M    2000.0
#define TOLERANCE_M 1e-6

struct row {
    const char *regime, *naive_method;
    struct georef_spec spec;
    double height_m; /* of points, up and down */
    /* writes the difference from the anchor; if the method gives a position, the anchor is subtracted from it */
    void (*naive)(const struct georef_spec *spec, const struct georef *georef, const double d[3], double out[3]);
    int epsg; /* of the system that ours has to use */
};

/* ---- the shortcuts */

static void add_metres(const struct georef_spec *spec, const struct georef *georef, const double d[3], double out[3])
{
    (void)spec;
    (void)georef;
    memcpy(out, d, 3 * sizeof *d);
}

/* This shortcut uses convergence and scale as they are on the ellipsoid. */
static void turn_and_scale(const struct georef_spec *spec, const struct georef *georef, const double d[3],
                           double out[3])
{
    (void)spec;
    double angle, scale;
    georef_convergence(georef, &angle, &scale);
    out[0] = scale * (cos(angle) * d[0] - sin(angle) * d[1]);
    out[1] = scale * (sin(angle) * d[0] + cos(angle) * d[1]);
    out[2] = d[2];
}

static void order1(const struct georef_spec *spec, const struct georef *georef, const double d[3], double out[3])
{
    struct georef *own;
    if (georef_create(spec, &own, NULL) != SH_OK) fail_msg("no georef");
    assert_int_equal(georef_set_method(own, GEOREF_ORDER1, NULL), SH_OK);
    georef_forward(own, 1, (struct vec3_in){&d[0], &d[1], &d[2]}, (struct vec3_out){&out[0], &out[1], &out[2]});
    georef_free(own);
    (void)georef;
}

static void exactly(const struct georef *georef, const double d[3], double out[3])
{
    georef_forward(georef, 1, (struct vec3_in){&d[0], &d[1], &d[2]}, (struct vec3_out){&out[0], &out[1], &out[2]});
}

/* This shortcut has positions as floats. */
static void in_float(const struct georef_spec *spec, const struct georef *georef, const double d[3], double out[3])
{
    (void)spec;
    double anchor[3];
    georef_anchor(georef, anchor);
    exactly(georef, d, out);
    for (int k = 0; k < 3; k++)
        out[k] = (double)(float)(anchor[k] + out[k]) - anchor[k];
}

/* This shortcut has fixed degrees per metre at the station. */
static void degrees_per_metre(const struct georef_spec *spec, const struct georef *georef, const double d[3],
                              double out[3])
{
    (void)georef;
    const double degree_m = 6371008.8 * M_PI / 180.0;
    out[0] = d[1] / degree_m;
    out[1] = d[0] / (degree_m * cos(spec->lat_deg * M_PI / 180.0));
    out[2] = d[2];
}

/* This shortcut subtracts longitudes in -180..180 without wrapping them, in counts of 1e-6 m, which end at 2^31. */
static void subtract_longitude(const struct georef_spec *spec, const struct georef *georef, const double d[3],
                               double out[3])
{
    double anchor[3], count_deg = 1e-6 / (111319.5 * cos(spec->lat_deg * M_PI / 180.0));
    georef_anchor(georef, anchor);
    exactly(georef, d, out);
    double counts = (remainder(anchor[1] + out[1], 360.0) - anchor[1]) / count_deg;
    out[1] = count_deg * fmin(fmax(counts, -2147483647.0), 2147483647.0);
}

/* This shortcut puts each point into the zone where it lies. */
static void zone_by_point(const struct georef_spec *spec, const struct georef *georef, const double d[3], double out[3])
{
    double anchor[3];
    struct locate_grid grid;
    struct georef_spec geodetic = *spec;
    struct georef *other;
    geodetic.crs = GEOREF_GEODETIC;
    georef_anchor(georef, anchor);
    if (georef_create(&geodetic, &other, NULL) != SH_OK) fail_msg("no georef");
    exactly(other, d, out);
    georef_free(other);
    const struct georef_place at = {spec->lat_deg + out[0], spec->lon_deg + out[1], spec->height_m + out[2]};
    assert_int_equal(locate_in_grid(&at, 0, &grid, NULL), SH_OK);
    out[0] = grid.easting_m - anchor[0];
    out[1] = grid.northing_m - anchor[1];
    out[2] = at.height_m - anchor[2];
}

/* This shortcut gives each zone six degrees everywhere, without the exceptions. */
static void zone_by_longitude(const struct georef_spec *spec, const struct georef *georef, const double d[3],
                              double out[3])
{
    double anchor[3], own_anchor[3];
    struct georef_spec other = *spec;
    struct georef *own;
    other.utm_zone = (int)floor((spec->lon_deg + 180.0) / 6.0) + 1;
    if (georef_create(&other, &own, NULL) != SH_OK) fail_msg("no georef");
    georef_anchor(georef, anchor);
    georef_anchor(own, own_anchor);
    exactly(own, d, out);
    for (int k = 0; k < 3; k++)
        out[k] += own_anchor[k] - anchor[k];
    georef_free(own);
}

/* ---- ours */

static double spread(uint64_t i, int k)
{
    return rig_unit(271, 3 * i + (uint64_t)k);
}

static void point(const struct row *row, uint64_t i, double d[3])
{
    double r = RADIUS_M * (i % 4 == 0 ? 1.0 : sqrt(spread(i, 0))), angle = 2.0 * M_PI * spread(i, 1);
    d[0] = r * cos(angle);
    d[1] = r * sin(angle);
    d[2] = row->height_m * (2.0 * spread(i, 2) - 1.0);
}

/* Plans the default for the row's extent. */
static struct georef *plan(const struct row *row, struct plan_row *planned)
{
    const struct plan_georef_need need = {.radius_m = RADIUS_M, .height_m = row->height_m, .tolerance_m = TOLERANCE_M};
    struct georef *georef;
    enum georef_method method;
    struct sh_err err;
    if (georef_create(&row->spec, &georef, &err) != SH_OK) fail_msg("%s: %s", row->regime, err.text);
    assert_int_equal(plan_georef(georef, &need, &method, planned, &err), SH_OK);
    assert_int_equal(georef_set_method(georef, method, &err), SH_OK);
    return georef;
}

/* Prints the errors of ours and of the naive method, both against tests/common/geodesy.h. */
static void show(const struct row *row, double bound_m)
{
    struct plan_row planned;
    struct georef *ours = plan(row, &planned), *exact;
    double ours_m = 0.0, naive_m = 0.0, anchor[3];
    const struct georef_spec *s = &row->spec;
    assert_int_equal(georef_create(s, &exact, NULL), SH_OK);
    georef_anchor(ours, anchor);
    if (row->epsg != 0) assert_int_equal(georef_epsg(ours), row->epsg);
    for (uint64_t i = 0; i < POINTS; i++) {
        double d[3], out[3];
        long double p_ecef[3];
        point(row, i, d);
        geodesy_ecef(s->lat_deg, s->lon_deg, s->height_m, d, p_ecef);
        exactly(ours, d, out);
        double error_m = geodesy_error_m(georef_epsg(ours), anchor, out, p_ecef);
        ours_m = isnan(error_m) ? (double)INFINITY : fmax(ours_m, error_m);
        row->naive(s, exact, d, out);
        naive_m = fmax(naive_m, geodesy_error_m(georef_epsg(ours), anchor, out, p_ecef));
    }
    if (ours_m > fmax(planned.error_m, 2e-8)) fail_msg("%s: %g m, planned %g m", row->regime, ours_m, planned.error_m);
    char regime[80];
    snprintf(regime, sizeof regime, "%s: %s", row->regime, planned.method);
    table_row(regime, row->naive_method, naive_m, ours_m, bound_m, "m");
    georef_free(ours);
    georef_free(exact);
}

#define AT(lat, lon, height) .lat_deg = (lat), .lon_deg = (lon), .height_m = (height)
#define UTM(...)                       \
    {                                  \
        .crs = GEOREF_UTM, __VA_ARGS__ \
    }
#define GEODETIC(...)                       \
    {                                       \
        .crs = GEOREF_GEODETIC, __VA_ARGS__ \
    }

static const struct row POLES[] = {
    {"UPS, 1 km from the north pole", "metres added", UTM(AT(89.991, 77.0, 5.0)), 500.0, add_metres, 32661},
    {"UPS, at the north pole", "order 1 everywhere", UTM(AT(90.0, 0.0, 5.0)), 500.0, order1, 32661},
    {"UPS, at the south pole", "metres added", UTM(AT(-90.0, 30.0, 2835.0)), 500.0, add_metres, 32761},
    {"UPS, Neumayer station", "order 1 everywhere", UTM(AT(-80.6, -8.3, 40.0)), 500.0, order1, 32761},
    {"UTM, at its end, 83.9 N", "no height in scale", UTM(AT(83.9, -40.0, 900.0)), 500.0, turn_and_scale, 32624},
    {"geodetic, 60 km from the pole", "degrees per metre", GEODETIC(AT(89.46, 12.0, 0.0)), 500.0, degrees_per_metre,
     4979},
    {"geodetic, 15 km from the pole", "degrees per metre", GEODETIC(AT(-89.865, 12.0, 2800.0)), 500.0,
     degrees_per_metre, 4979},
    {"geodetic, 1.5 km from the pole", "order 1", GEODETIC(AT(89.9865, -100.0, 0.0)), 500.0, order1, 4979},
};

/* Returns the error by rounding to counts in latitude and height, on the ground. */
static double rounding_m(const struct georef *georef, const double scale[3], double reach_m)
{
    const double unit_m[3] = {111694.0, 0.0, 1.0}; /* of a degree of latitude, where it is longest */
    double most_m = 0.0;
    for (uint64_t i = 0; i < 1000; i++) {
        double angle = 2.0 * M_PI * spread(i, 0), out[3];
        const double d[3] = {reach_m * spread(i, 2) * cos(angle), reach_m * spread(i, 2) * sin(angle), spread(i, 1)};
        exactly(georef, d, out);
        for (int k = 0; k < 3; k++) {
            assert_true(fabs(out[k] / scale[k]) < 2147483647.0);
            most_m = fmax(most_m, unit_m[k] * fabs(round(out[k] / scale[k]) * scale[k] - out[k]));
        }
    }
    return most_m;
}

/* If all points are near the pole, only longitude needs longer counts. Latitude and height are rounded by half a
 * micrometre. */
static void test_counts_at_the_pole(void **state)
{
    (void)state;
    const struct georef_spec spec = {.crs = GEOREF_GEODETIC, AT(90.0, 0.0, 3.0)};
    const double reach_m = 2020.0;
    struct georef *georef;
    struct sh_err err;
    double scale[3], shared[3];
    assert_int_equal(georef_create(&spec, &georef, &err), SH_OK);
    if (georef_scale(georef, 1e-6, reach_m, scale, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(georef_scale(georef, 1e-5, reach_m, shared, &err), SH_OK); /* the next that holds all axes */
    /* 2 pi 2020 m / 2^31 are 5.9 um */
    assert_true(georef_count_m(georef, reach_m, scale) < 6e-6 && shared[1] > scale[1]);
    table_row("geodetic, at the pole: counts, 2 km", "one scale for all axes", rounding_m(georef, shared, reach_m),
              rounding_m(georef, scale, reach_m), 0.5001e-6, "m");
    georef_free(georef);
    table_check();
}

static void test_poles(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof POLES / sizeof POLES[0]; i++)
        show(&POLES[i], TOLERANCE_M);
    /* At the pole itself there is no polynomial. The exact way is used, and is good to 20 nm. */
    const struct row pole = {
        "geodetic, at the pole", "degrees per metre", GEODETIC(AT(90.0, 0.0, 3.0)), 500.0, degrees_per_metre, 4979};
    struct plan_row planned;
    georef_free(plan(&pole, &planned));
    assert_string_equal(planned.method, "exact");
    show(&pole, 2e-8);
    table_check();
}

static const struct row ZONES[] = {
    {"antimeridian, geodetic", "longitudes subtracted", GEODETIC(AT(-16.8, 179.995, 10.0)), 300.0, subtract_longitude,
     4979},
    {"antimeridian, from the west", "longitudes subtracted", GEODETIC(AT(65.0, -179.999, 10.0)), 300.0,
     subtract_longitude, 4979},
    {"antimeridian, UTM 60", "zone by each point", UTM(AT(-16.8, 179.995, 10.0)), 300.0, zone_by_point, 32760},
    {"equator, UTM 17", "each hemisphere its own northing", UTM(AT(0.004, -78.45, 2500.0)), 300.0, zone_by_point,
     32617},
    {"border of UTM 32 and 33", "zone by each point", UTM(AT(52.0, 11.995, 100.0)), 300.0, zone_by_point, 32632},
    {"border of UTM and UPS, 84 N", "zone by each point", UTM(AT(83.995, 3.0, 0.0)), 300.0, zone_by_point, 32631},
    {"Norway, Bergen", "zone by longitude", UTM(AT(60.39, 5.32, 40.0)), 300.0, zone_by_longitude, 32632},
    {"Svalbard, Longyearbyen", "zone by longitude", UTM(AT(78.22, 11.65, 20.0)), 300.0, zone_by_longitude, 32633},
    {"Svalbard, 33 and 35's border", "zone by each point", UTM(AT(78.5, 20.98, 20.0)), 300.0, zone_by_point, 32633},
    {"neighbouring zone forced", "metres added", UTM(AT(52.0, 13.3, 100.0), .utm_zone = 32), 300.0, add_metres, 32632},
    {"the same, on the equator", "order 1 everywhere", UTM(AT(0.5, 13.3, 100.0), .utm_zone = 32), 300.0, order1, 32632},
};

static void test_zones(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof ZONES / sizeof ZONES[0]; i++)
        show(&ZONES[i], TOLERANCE_M);
    table_check();
}

static const struct row HEIGHTS[] = {
    {"UTM, Dead Sea, -430 m", "no height in scale", UTM(AT(31.5, 35.48, -430.0)), 500.0, turn_and_scale, 32636},
    {"UTM, Everest, 8.8 km", "no height in scale", UTM(AT(27.99, 86.93, 8848.0)), 2000.0, turn_and_scale, 32645},
    {"UTM, drone 3 km up", "order 1 everywhere", UTM(AT(47.4, 8.55, 3400.0)), 3000.0, order1, 32632},
    {"geodetic, drone 3 km up", "degrees per metre", GEODETIC(AT(47.4, 8.55, 3400.0)), 3000.0, degrees_per_metre, 4979},
    {"UTM, ordinary place", "float coordinates", UTM(AT(52.5, 13.4, 34.0)), 500.0, in_float, 32633},
    {"geodetic, ordinary place", "float coordinates", GEODETIC(AT(52.5, 13.4, 34.0)), 500.0, in_float, 4979},
};

static void test_heights(void **state)
{
    (void)state;
    for (size_t i = 0; i < sizeof HEIGHTS / sizeof HEIGHTS[0]; i++)
        show(&HEIGHTS[i], TOLERANCE_M);
    table_check();
}

/* ---- 100 km from the anchor: p_prcs is in the anchor's tangent frame, which is 780 m above the ground there. */

static const struct georef_place ANCHOR = {48.0, 11.0, 500.0};
static const double FAR_M[3] = {90000.0, -45000.0, -300.0};

/* Returns the largest error of points about FAR_M; d counts from the georef's centre, which is centre_m. */
static double far_error_m(const struct georef *georef, const double centre_m[3], const struct row *row, int naive)
{
    double worst_m = 0.0, anchor[3];
    georef_anchor(georef, anchor);
    for (uint64_t i = 0; i < POINTS; i++) {
        double d[3], from[3], out[3];
        long double p_ecef[3];
        point(row, i, d);
        for (int k = 0; k < 3; k++) {
            from[k] = FAR_M[k] + d[k];
            d[k] = from[k] - centre_m[k];
        }
        geodesy_ecef(ANCHOR.lat_deg, ANCHOR.lon_deg, ANCHOR.height_m, from, p_ecef);
        if (naive)
            turn_and_scale(&row->spec, georef, d, out);
        else
            exactly(georef, d, out);
        worst_m = fmax(worst_m, geodesy_error_m(georef_epsg(georef), anchor, out, p_ecef));
    }
    return worst_m;
}

static void test_far_from_anchor(void **state)
{
    (void)state;
    static const double origin[3] = {0.0, 0.0, 0.0};
    const struct row row = {.spec = {.crs = GEOREF_UTM}, .height_m = 500.0};
    struct plan_georef_need need = {.radius_m = 103000.0, .height_m = 1000.0, .tolerance_m = TOLERANCE_M};
    struct geoframe frame;
    struct georef_spec spec = {.crs = GEOREF_UTM};
    struct georef *at_anchor, *moved;
    struct plan_row planned;
    struct sh_err err;
    enum georef_method method;
    double scale[3];
    assert_int_equal(geoframe_set_tangent(&frame, origin, &ANCHOR, 0.0, &err), SH_OK);
    assert_int_equal(geoframe_fill(&frame, origin, &spec, &err), SH_OK);
    assert_int_equal(georef_create(&spec, &at_anchor, &err), SH_OK);
    /* So far away no polynomial is planned. One that is asked for is refused, and so are counts of 1 um. */
    assert_int_equal(plan_georef(at_anchor, &need, &method, &planned, &err), SH_OK);
    assert_int_equal(method, GEOREF_EXACT);
    double naive_m = far_error_m(at_anchor, origin, &row, 1);
    table_row("100 km from the anchor: exact", "flat earth", naive_m, far_error_m(at_anchor, origin, &row, 0), 2e-8,
              "m");
    need.forced = GEOREF_ORDER3;
    assert_int_equal(plan_georef(at_anchor, &need, &method, &planned, &err), SH_EINPUT);
    table_note("order 3 asked for: %s", err.text);
    assert_int_equal(georef_scale(at_anchor, 1e-6, need.radius_m, scale, &err), SH_EINPUT);
    table_note("counts of 1 um: %s", err.text);
    /* With a new anchor order 3 and counts of 1e-6 m are enough, as anywhere. */
    need = (struct plan_georef_need){.radius_m = RADIUS_M, .height_m = 500.0, .tolerance_m = TOLERANCE_M};
    assert_int_equal(georef_recentre(at_anchor, FAR_M, &moved, &err), SH_OK);
    assert_int_equal(plan_georef(moved, &need, &method, &planned, &err), SH_OK);
    assert_int_equal(method, GEOREF_ORDER3);
    assert_int_equal(georef_set_method(moved, method, &err), SH_OK);
    assert_int_equal(georef_scale(moved, 1e-6, 2100.0, scale, &err), SH_OK);
    table_row("the same, re-anchored: order3", "flat earth", naive_m, far_error_m(moved, FAR_M, &row, 0), TOLERANCE_M,
              "m");
    georef_free(moved);
    georef_free(at_anchor);
    table_check();
}

int main(void)
{
    table_head("stability: georeferencing; the default within 2 km, by the method it takes");
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_poles),   cmocka_unit_test(test_counts_at_the_pole), cmocka_unit_test(test_zones),
        cmocka_unit_test(test_heights), cmocka_unit_test(test_far_from_anchor),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
