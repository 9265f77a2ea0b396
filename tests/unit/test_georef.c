/* Georeferencing against analytic positions on the WGS 84 ellipsoid. */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/georef.h"

#define PI 3.14159265358979323846
/* WGS 84, NIMA TR8350.2: a and 1/f define, the rest follows. */
#define A_M 6378137.0
#define F   (1 / 298.257223563)
#define B_M (A_M * (1 - F))
#define E2  (F * (2 - F))
/* Positions are near 6.4e6 m, where doubles are 9.3e-10 m apart; a chain of some tens of operations stays
 * below ten such steps. GeographicLib states 5 nm for each direction of UTM. */
#define TOL_M 1e-8

static struct georef *make(enum georef_crs crs, double lat_deg, double lon_deg, double height_m, int zone)
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

static void expect_near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("%.12g instead of %.12g, off by %.3g", got, want, got - want);
}

static void expect_point(const double got[3], double x, double y, double z, double tolerance)
{
    expect_near(got[0], x, tolerance);
    expect_near(got[1], y, tolerance);
    expect_near(got[2], z, tolerance);
}

static void forward_one(const struct georef *georef, const double d[3], double out[3])
{
    georef_forward(georef, 1, &d[0], &d[1], &d[2], &out[0], &out[1], &out[2]);
}

static void test_ecef_analytic(void **state)
{
    (void)state;
    const double east[3] = {1, 0, 0}, north[3] = {0, 1, 0}, up[3] = {0, 0, 1};
    double anchor[3], d[3];
    struct georef *georef = make(GEOREF_ECEF, 0, 0, 0, 0);
    assert_int_equal(georef_epsg(georef), 4978);
    georef_anchor(georef, anchor);
    expect_point(anchor, A_M, 0, 0, 0);
    forward_one(georef, east, d);
    expect_point(d, 0, 1, 0, 1e-15);
    forward_one(georef, north, d);
    expect_point(d, 0, 0, 1, 1e-15);
    forward_one(georef, up, d);
    expect_point(d, 1, 0, 0, 1e-15);
    georef_free(georef);
    georef = make(GEOREF_ECEF, 90, 0, 100, 0);
    georef_anchor(georef, anchor);
    expect_point(anchor, 0, 0, B_M + 100, TOL_M);
    expect_near(B_M, 6356752.314245, 5e-7); /* as published, to its last digit */
    forward_one(georef, up, d);
    expect_point(d, 0, 0, 1, 1e-15);
    georef_free(georef);
    georef = make(GEOREF_ECEF, 0, 90, -10, 0);
    georef_anchor(georef, anchor);
    expect_point(anchor, 0, A_M - 10, 0, TOL_M);
    georef_free(georef);
}

/* The closed formula with the radius of curvature in the prime vertical, in long double. */
static void ecef_formula(double lat_deg, double lon_deg, double height_m, double p[3])
{
    const long double lat = lat_deg * PI / 180.0L, lon = lon_deg * PI / 180.0L, s = sinl(lat);
    const long double n = A_M / sqrtl(1 - E2 * s * s);
    p[0] = (double)((n + height_m) * cosl(lat) * cosl(lon));
    p[1] = (double)((n + height_m) * cosl(lat) * sinl(lon));
    p[2] = (double)((n * (1 - E2) + height_m) * s);
}

static void test_ecef_anywhere(void **state)
{
    (void)state;
    for (int i = 0; i < 200; i++) {
        const double lat_deg = -89 + 178 * fmod(i * 0.618, 1), lon_deg = -179 + 358 * fmod(i * 0.414, 1);
        double want[3], above[3], anchor[3], d[3];
        struct georef *georef = make(GEOREF_ECEF, lat_deg, lon_deg, 500, 0);
        georef_anchor(georef, anchor);
        ecef_formula(lat_deg, lon_deg, 500, want);
        expect_point(anchor, want[0], want[1], want[2], TOL_M);
        /* 70 m up is 70 m more height */
        ecef_formula(lat_deg, lon_deg, 570, above);
        forward_one(georef, (const double[3]){0, 0, 70}, d);
        expect_point(d, above[0] - want[0], above[1] - want[1], above[2] - want[2], TOL_M);
        /* a rotation keeps lengths: three products and two sums per component, 1e-15 relative */
        forward_one(georef, (const double[3]){120, -250, 35}, d);
        expect_near(hypot(hypot(d[0], d[1]), d[2]), hypot(hypot(120, 250), 35), 3e-13);
        georef_free(georef);
    }
}

static void test_local(void **state)
{
    (void)state;
    struct georef *georef = make(GEOREF_LOCAL, NAN, NAN, NAN, 0);
    const double in[3] = {1.25, -3.5, NAN};
    double anchor[3], d[3], p[3];
    georef_anchor(georef, anchor);
    expect_point(anchor, 10, 20, 30, 0);
    assert_int_equal(georef_epsg(georef), 0);
    forward_one(georef, in, d);
    assert_true(d[0] == 1.25 && d[1] == -3.5 && isnan(d[2]));
    georef_reverse(georef, (const double[3]){1, 2, 3}, p);
    expect_point(p, 11, 22, 33, 0);
    georef_free(georef);
}

/* Meridian arc from the equator by Simpson's rule; the integrand is smooth, 20000 steps leave less than 1e-9
 * m. */
static double meridian_arc_m(double lat_deg)
{
    enum { STEPS = 20000 };
    const long double h = lat_deg * PI / 180.0L / STEPS;
    long double sum = 0;
    for (int i = 0; i <= STEPS; i++) {
        const long double s = sinl(i * h), w = 1 - E2 * s * s;
        sum += (i == 0 || i == STEPS ? 1 : i % 2 == 1 ? 4 : 2) / (w * sqrtl(w));
    }
    return (double)(A_M * (1 - E2) * sum * h / 3);
}

/* On the central meridian the easting is 500 km and the northing 0.9996 of the arc, by definition. */
static void test_utm_central_meridian(void **state)
{
    (void)state;
    /* the quarter meridian, 10 001 965.7293 m,, is the published figure for WGS 84 */
    expect_near(meridian_arc_m(90), 10001965.7293, 5e-5);
    for (int lat_deg = -80; lat_deg < 84; lat_deg += 4) {
        double anchor[3];
        struct georef *georef = make(GEOREF_UTM, lat_deg, 9, 123.5, 32);
        georef_anchor(georef, anchor);
        expect_point(anchor, 500000, 0.9996 * meridian_arc_m(lat_deg) + (lat_deg < 0 ? 1e7 : 0), 123.5, TOL_M);
        assert_int_equal(georef_epsg(georef), lat_deg < 0 ? 32732 : 32632);
        georef_free(georef);
    }
}

/* Off the meridian: the projection is conformal, so a short step north and one east have the same length k
 * and stand at right angles, and k = 0.9996 (1 + l^2 cos^2(lat) (1 + eta^2) / 2 + ...) (Snyder, Map
 * Projections, 8-11). */
static void test_utm_scale(void **state)
{
    (void)state;
    const double lat = 48.2 * PI / 180, c = cos(lat), eta2 = E2 / (1 - E2) * c * c, t2 = tan(lat) * tan(lat);
    const double a = 2 * PI / 180 * c;
    const double k = 0.9996 * (1 + (1 + eta2) * a * a / 2 +
                               (5 - 4 * t2 + 42 * eta2 + 13 * eta2 * eta2 - 28 * E2 / (1 - E2)) * pow(a, 4) / 24);
    struct georef *georef = make(GEOREF_UTM, 48.2, 11, 0, 32);
    double e[3], n[3], w[3], s[3];
    forward_one(georef, (const double[3]){1, 0, 0}, e);
    forward_one(georef, (const double[3]){-1, 0, 0}, w);
    forward_one(georef, (const double[3]){0, 1, 0}, n);
    forward_one(georef, (const double[3]){0, -1, 0}, s);
    /* differences of two positions at TOL_M over 2 m; the series leaves a^6/720*61 = 1.3e-11 */
    expect_near(hypot(e[0] - w[0], e[1] - w[1]) / 2, k, TOL_M);
    expect_near(hypot(n[0] - s[0], n[1] - s[1]) / 2, k, TOL_M);
    expect_near((e[0] - w[0]) * (n[0] - s[0]) + (e[1] - w[1]) * (n[1] - s[1]), 0, 4 * TOL_M);
    georef_free(georef);
}

static void test_zones(void **state)
{
    (void)state;
    const struct {
        double lat_deg, lon_deg;
        int epsg;
    } at[] = {
        {33.3, 44.4, 32638},   {-33.9, 151.2, 32756}, {0, -180, 32601},   {10, 179.99, 32660}, {48.2, 16.37, 32633},
        {48.2, 196.37, 32603}, {60.39, 5.32, 32632},  {63.9, 3.1, 32632}, {64.1, 3.1, 32631}, /* Norway */
        {78.2, 15.6, 32633},   {78, 8.9, 32631},      {78, 9.1, 32633},   {78, 33.1, 32637},  /* Svalbard */
        {84.5, 20, 32661},     {-80.5, 20, 32761},    {90, 0, 32661},     {-90, 0, 32761},     {83.9, 20, 32633},
        {-79.9, 20, 32734},
    };
    for (size_t i = 0; i < sizeof at / sizeof at[0]; i++) {
        struct georef *georef = make(GEOREF_UTM, at[i].lat_deg, at[i].lon_deg, 0, 0);
        if (georef_epsg(georef) != at[i].epsg)
            fail_msg("%g %g: EPSG %d instead of %d", at[i].lat_deg, at[i].lon_deg, georef_epsg(georef), at[i].epsg);
        georef_free(georef);
    }
    double anchor[3]; /* the poles are at 2000 km, 2000 km by definition of UPS */
    struct georef *georef = make(GEOREF_UTM, 90, 0, 5, 0);
    georef_anchor(georef, anchor);
    expect_point(anchor, 2e6, 2e6, 5, TOL_M);
    georef_free(georef);
    georef = make(GEOREF_UTM, 48.2, 12.5, 0, 32); /* forced into the neighbour zone */
    assert_int_equal(georef_epsg(georef), 32632);
    georef_free(georef);
}

static void test_round_trip(void **state)
{
    (void)state;
    const struct {
        enum georef_crs crs;
        double lat_deg, lon_deg;
        int zone;
    } at[] = {
        {GEOREF_LOCAL, 0, 0, 0},       {GEOREF_ECEF, 48.2, 16.4, 0},
        {GEOREF_ECEF, -90, 0, 0},      {GEOREF_UTM, 48.2, 16.4, 0},
        {GEOREF_UTM, 48.2, 12.5, 32},  {GEOREF_UTM, -33.9, 151.2, 0},
        {GEOREF_UTM, 89.99, 77, 0},    {GEOREF_UTM, -90, 0, 0},
        {GEOREF_UTM, 0, 9, 0},         {GEOREF_UTM, 1e-6, 5.9999999, 0},
        {GEOREF_UTM, 10, 179.9999, 0}, {GEOREF_GEODETIC, 48, 179.9999, 0},
        {GEOREF_GEODETIC, 90, 10, 0},  {GEOREF_GEODETIC, -89.999, -180, 0},
    };
    for (size_t i = 0; i < sizeof at / sizeof at[0]; i++) {
        struct georef *georef = make(at[i].crs, at[i].lat_deg, at[i].lon_deg, 321, at[i].zone);
        for (int k = 0; k < 300; k++) {
            const double r_m = 1 + k, angle = k * 2.4;
            const double in[3] = {r_m * cos(angle), r_m * sin(angle), r_m * sin(k * 1.1)};
            double d[3], p[3];
            forward_one(georef, in, d);
            georef_reverse(georef, d, p);
            expect_point(p, in[0] + 10, in[1] + 20, in[2] + 30, TOL_M);
        }
        georef_free(georef);
    }
}

/* Where UTMUPS used per point fails: 10,000 km between neighbours across the equator, another zone across its
 * border, an exception beyond the edge of the table. */
static void test_borders(void **state)
{
    (void)state;
    const struct {
        double lat_deg, lon_deg;
        int zone;
    } at[] = {{0, 9, 0},       {1e-5, 9, 0}, {-1e-5, 9, 0}, {45, 12, 0},
              {83.9999, 9, 0}, {84, 9, 0},   {-80, 9, 0},   {0, 17.0, 31}};
    for (size_t i = 0; i < sizeof at / sizeof at[0]; i++) {
        struct sh_err err = {0, ""};
        struct georef_spec spec = {
            .crs = GEOREF_UTM, .lat_deg = at[i].lat_deg, .lon_deg = at[i].lon_deg, .utm_zone = at[i].zone};
        struct georef *georef = NULL;
        if (at[i].zone != 0) { /* as far east of the central meridian as is allowed */
            double low = 3, high = 17;
            while (high - low > 1e-9) {
                spec.lon_deg = (low + high) / 2;
                if (georef_create(&spec, &georef, &err) == SH_OK) {
                    georef_free(georef);
                    low = spec.lon_deg;
                } else {
                    high = spec.lon_deg;
                }
            }
            spec.lon_deg = low;
        }
        assert_int_equal(georef_create(&spec, &georef, &err), SH_OK);
        for (int k = 0; k < 8; k++) {
            const double in[3] = {800 * cos(k * PI / 4), 800 * sin(k * PI / 4), 0};
            double d[3];
            forward_one(georef, in, d);
            /* 0.9996 to 1.01 at the far edge of the table; UPS 0.994 to 1 */
            assert_true(hypot(d[0], d[1]) > 800 * 0.99 && hypot(d[0], d[1]) < 800 * 1.02);
        }
        georef_free(georef);
    }
}

/* Blocks of any length, and values not in place, too. */
static void check_nan(const struct georef *georef, int is_local)
{
    enum { N = 300 };
    double in[3][N], out[3][N];
    for (int i = 0; i < N; i++)
        for (int c = 0; c < 3; c++)
            in[c][i] = i % 4 == c + 1 ? (double)NAN : (double)(i + c);
    georef_forward(georef, N, in[0], in[1], in[2], out[0], out[1], out[2]);
    georef_forward(georef, N, in[0], in[1], in[2], in[0], in[1], in[2]);
    for (int i = 0; i < N; i++) {
        int nans = isnan(out[0][i]) + isnan(out[1][i]) + isnan(out[2][i]);
        assert_int_equal(nans, i % 4 == 0 ? 0 : is_local ? 1 : 3);
        for (int c = 0; c < 3; c++)
            assert_true(in[c][i] == out[c][i] || (isnan(in[c][i]) && isnan(out[c][i])));
    }
    georef_forward(georef, 0, in[0], in[1], in[2], in[0], in[1], in[2]);
}

static void test_nan_and_in_place(void **state)
{
    (void)state;
    const enum georef_crs crs[] = {GEOREF_LOCAL, GEOREF_UTM, GEOREF_GEODETIC};
    for (int c = 0; c < 3; c++)
        for (enum georef_method m = GEOREF_EXACT; m <= GEOREF_ORDER3; m++) {
            struct georef *georef = make(crs[c], 48.2, 16.4, 200, 0);
            struct sh_err err;
            assert_int_equal(georef_set_method(georef, m, &err), SH_OK);
            check_nan(georef, crs[c] == GEOREF_LOCAL);
            georef_free(georef);
        }
    struct georef *georef = make(GEOREF_ECEF, 48.2, 16.4, 200, 0);
    double p[3] = {1, NAN, 3}, out[3];
    forward_one(georef, p, out);
    assert_true(isnan(out[0]) && isnan(out[1]));
    georef_free(georef);
    georef_free(NULL);
}

/* There and back between systems; and where the ends of the ellipsoid's axes and the
 * false origins are. */
static void test_places(void **state)
{
    (void)state;
    struct georef_place place;
    struct sh_err err;
    double p[3], grid[3];
    int zone, north;
    assert_int_equal(georef_locate_ecef((const double[3]){0, 0, -B_M - 5}, &place, &err), SH_OK);
    expect_near(place.lat_deg, -90, 1e-12);
    expect_near(place.height_m, 5, TOL_M);
    assert_int_equal(georef_locate_ecef((const double[3]){0, A_M + 7, 0}, &place, &err), SH_OK);
    expect_point((const double[3]){place.lat_deg, place.lon_deg, place.height_m}, 0, 90, 7, TOL_M);
    assert_int_equal(georef_locate_ecef((const double[3]){NAN, 0, 0}, &place, &err), SH_EINPUT);
    assert_int_equal(georef_locate_utm(31, 1, 500000, 0, 12, &place, &err), SH_OK);
    expect_point((const double[3]){place.lat_deg, place.lon_deg, place.height_m}, 0, 3, 12, 1e-13);
    assert_int_equal(georef_locate_utm(0, 0, 2e6, 2e6, 0, &place, &err), SH_OK);
    expect_near(place.lat_deg, -90, 1e-12);
    assert_int_equal(georef_locate_utm(61, 1, 500000, 0, 0, &place, &err), SH_EINPUT);
    assert_int_equal(georef_locate_utm(31, 1, 9e6, 0, 0, &place, &err), SH_EINPUT);
    for (int i = 0; i < 50; i++) {
        const struct georef_place at = {-88 + 3.5 * i, -179 + 7.1 * i, 100.0 * i};
        georef_geodetic_to_ecef(&at, p);
        assert_int_equal(georef_locate_ecef(p, &place, &err), SH_OK);
        expect_point((const double[3]){place.lat_deg, remainder(place.lon_deg - at.lon_deg, 360), place.height_m},
                     at.lat_deg, 0, at.height_m, TOL_M);
        assert_int_equal(georef_geodetic_to_utm(&at, 0, &zone, &north, grid, &err), SH_OK);
        assert_int_equal(zone == 0, at.lat_deg >= 84 || at.lat_deg < -80);
        assert_int_equal(north, at.lat_deg >= 0);
        assert_int_equal(georef_locate_utm(zone, north, grid[0], grid[1], grid[2], &place, &err), SH_OK);
        expect_point((const double[3]){place.lat_deg, remainder(place.lon_deg - at.lon_deg, 360), place.height_m},
                     at.lat_deg, 0, at.height_m, TOL_M);
    }
}

/* Convergence east of the central meridian: atan(tan(dlon) sin(lat)) on the sphere, within e'^2 of it; scale
 * 0.9996 (1 + x^2/2R^2). */
static void test_convergence(void **state)
{
    (void)state;
    double convergence_rad, scale;
    struct georef *georef = make(GEOREF_UTM, 50, 11, 0, 32);
    georef_convergence(georef, &convergence_rad, &scale);
    double sphere = atan(tan(2 * PI / 180) * sin(50 * PI / 180));
    expect_near(convergence_rad, sphere, 0.01 * sphere);
    double x_m = 2 * PI / 180 * cos(50 * PI / 180) * 6.38e6;
    expect_near(scale, 0.9996 * (1 + x_m * x_m / 2 / 6.38e6 / 6.38e6), 1e-6);
    /* and it is that of the map: true north goes to the west of the grid's */
    double d[3];
    forward_one(georef, (const double[3]){0, 1, 0}, d);
    expect_near(atan2(d[0], d[1]), -convergence_rad, 1e-8);
    georef_free(georef);
    georef = make(GEOREF_ECEF, 50, 11, 0, 0);
    georef_convergence(georef, &convergence_rad, &scale);
    assert_true(convergence_rad == 0 && scale == 1);
    georef_free(georef);
}

/* Another centre: the same positions, also across the zone's border, the equator and the antimeridian. */
static void test_recentre(void **state)
{
    (void)state;
    const struct {
        enum georef_crs crs;
        double lat_deg, lon_deg;
    } at[] = {{GEOREF_LOCAL, 0, 0},           {GEOREF_ECEF, 50, 11}, {GEOREF_UTM, 50, 11.99},
              {GEOREF_UTM, -0.1, 9.5},        {GEOREF_UTM, 88, 100}, {GEOREF_GEODETIC, 50, 179.9},
              {GEOREF_GEODETIC, -60, -179.9}, {GEOREF_UTM, 83.9, 8}};
    for (size_t i = 0; i < sizeof at / sizeof at[0]; i++) {
        struct georef *georef = make(at[i].crs, at[i].lat_deg, at[i].lon_deg, 500, 0), *moved;
        struct sh_err err;
        const double centre_m[3] = {20010, 30020, 430}, off_m[3] = {20000, 30000, 400};
        double anchor[2][3], d[3], there[3], p[3];
        assert_int_equal(georef_recentre(georef, centre_m, &moved, &err), SH_OK);
        assert_int_equal(georef_epsg(moved), georef_epsg(georef));
        georef_anchor(georef, anchor[0]);
        georef_anchor(moved, anchor[1]);
        for (int k = 0; k < 20; k++) {
            const double local[3] = {50 * k, -30 * k, 10 * k};
            double far[3];
            for (int c = 0; c < 3; c++)
                far[c] = local[c] + off_m[c];
            forward_one(georef, far, d);
            forward_one(moved, local, there);
            for (int c = 0; c < 3; c++) {
                double off = anchor[0][c] + d[c] - anchor[1][c] - there[c];
                if (at[i].crs == GEOREF_GEODETIC && c == 1) off = remainder(off, 360);
                expect_near(off, 0, TOL_M);
            }
            georef_reverse(moved, there, p);
            expect_point(p, far[0] + 10, far[1] + 20, far[2] + 30, TOL_M);
        }
        georef_free(moved);
        georef_free(georef);
    }
    struct georef *georef = make(GEOREF_UTM, 50, 11, 0, 32), *moved = NULL;
    struct sh_err err;
    assert_int_equal(georef_recentre(georef, (const double[3]){3e6, 0, 0}, &moved, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "does not reach"));
    assert_null(moved);
    georef_free(georef);
}

/* A count is at most scale_m long on the ground and the furthest points fit; where they can't, it is said. */
static void test_scale(void **state)
{
    (void)state;
    struct sh_err err;
    for (int i = 0; i < 60; i++) {
        double lat_deg = i < 3 ? 90 - 0.001 * i : -88 + 3 * i, reach_m = i % 2 ? 2000 : 100, scale_m = 1e-6, scale[3];
        if (lat_deg > 90) break;
        struct georef *georef = make(GEOREF_GEODETIC, lat_deg, 179.999, 50 * i, 0);
        assert_int_equal(georef_scale(georef, scale_m, reach_m, scale, &err), SH_OK);
        /* a full turn of a circle of twice the reach in 2^32 counts, where that is longer */
        double longest_m = fmax(scale_m, 2 * PI * reach_m / 2147483647.0) * 1.000001;
        for (int k = 0; k < 64; k++) {
            double angle = k * PI / 32, d[3], p_ecef[3];
            const double in[3] = {reach_m * cos(angle), reach_m * sin(angle), 0};
            forward_one(georef, in, d);
            struct georef_place at = {lat_deg + d[0], 179.999 + d[1], 50 * i};
            georef_geodetic_to_ecef(&at, p_ecef);
            for (int c = 0; c < 3; c++)
                assert_true(fabs(d[c]) / scale[c] < 2147483647.0);
            assert_true(scale[0] * PI / 180 * A_M <= scale_m);
            assert_true(scale[1] * PI / 180 * hypot(p_ecef[0], p_ecef[1]) <= longest_m);
        }
        assert_true(scale[2] == scale_m &&
                    scale[0] * 110574 > 0.98 * scale_m); /* degrees of 110574 to 111694 m, 3 km up */
        assert_true(georef_count_m(georef, reach_m, scale) <= longest_m);
        if (fabs(lat_deg) < 80) assert_true(georef_count_m(georef, reach_m, scale) <= scale_m * 1.000001);
        georef_free(georef);
    }
    struct georef *georef = make(GEOREF_UTM, 50, 11, 0, 32);
    double scale[3];
    assert_int_equal(georef_scale(georef, 1e-6, 100e3, scale, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "do not fit into 31 bits"));
    assert_int_equal(georef_scale(georef, 1e-4, 100e3, scale, &err), SH_OK);
    assert_true(scale[0] == 1e-4 && scale[1] == 1e-4 && scale[2] == 1e-4);
    georef_free(georef);
}

static void test_refusals(void **state)
{
    (void)state;
    const struct {
        struct georef_spec spec;
        const char *part;
    } bad[] = {
        {{.crs = GEOREF_ECEF, .lat_deg = 90.001}, "latitude 90.001 deg; allowed -90 to 90"},
        {{.crs = GEOREF_ECEF, .lat_deg = NAN}, "latitude"},
        {{.crs = GEOREF_UTM, .lon_deg = 361}, "longitude 361 deg; allowed -180 to 360"},
        {{.crs = GEOREF_UTM, .lon_deg = -181}, "longitude"},
        {{.crs = GEOREF_ECEF, .height_m = 1e6}, "height"},
        {{.crs = GEOREF_ECEF, .height_m = INFINITY}, "height"},
        {{.crs = GEOREF_UTM, .utm_zone = 61}, "zone 61; allowed 1 to 60"},
        {{.crs = GEOREF_UTM, .utm_zone = -2}, "zone -2"},
        {{.crs = GEOREF_UTM, .lat_deg = 48, .lon_deg = 16, .utm_zone = 10}, "zone 10 does not reach"},
        {{.crs = GEOREF_UTM, .lat_deg = 89, .lon_deg = 16, .utm_zone = 33}, "zone 33 does not reach"},
        {{.crs = GEOREF_LOCAL, .station_m = {0, NAN, 0}}, "station position y"},
        {{.crs = (enum georef_crs)7}, "allowed local, ecef, utm, geodetic"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct georef *georef = NULL;
        struct sh_err err = {0, ""};
        assert_int_equal(georef_create(&bad[i].spec, &georef, &err), SH_EINPUT);
        assert_null(georef);
        if (strstr(err.text, bad[i].part) == NULL) fail_msg("'%s' without '%s'", err.text, bad[i].part);
        assert_null(strchr(err.text, '\n'));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_ecef_analytic),
        cmocka_unit_test(test_ecef_anywhere),
        cmocka_unit_test(test_local),
        cmocka_unit_test(test_utm_central_meridian),
        cmocka_unit_test(test_utm_scale),
        cmocka_unit_test(test_zones),
        cmocka_unit_test(test_round_trip),
        cmocka_unit_test(test_borders),
        cmocka_unit_test(test_nan_and_in_place),
        cmocka_unit_test(test_places),
        cmocka_unit_test(test_convergence),
        cmocka_unit_test(test_recentre),
        cmocka_unit_test(test_scale),
        cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
