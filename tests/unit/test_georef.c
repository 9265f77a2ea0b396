/* SPDX-License-Identifier: MIT */
/* Georeferencing against analytic positions on the WGS 84 ellipsoid. */
#include "tests/unit/georef_rig.h"

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

/* Computes the meridian arc from the equator by Simpson's rule. The integrand is smooth, so 20000 steps have an error
 * below 1e-9 m. */
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
    /* the quarter meridian, 10 001 965.7293 m, is the published figure for WGS 84 */
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

/* Away from the meridian the projection is conformal. So a short step north and one east have the same length k and are
 * at right angles, and k = 0.9996 (1 + l^2 cos^2(lat) (1 + eta^2) / 2 + ...) (Snyder, Map Projections, 8-11). */
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

/* Cases where UTMUPS used per point fails: 10,000 km between neighbours across the equator, another zone across its
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
        if (at[i].zone != 0) { /* the farthest east of the central meridian that is allowed */
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

/* A NaN makes all of its point NaN, in the local frame only itself. Results may also replace the input. */
static void check_nan(const struct georef *georef, int is_local)
{
    enum { N = 300 };
    double in[3][N], out[3][N];
    for (int i = 0; i < N; i++)
        for (int c = 0; c < 3; c++)
            in[c][i] = i % 4 == c + 1 ? (double)NAN : (double)(i + c);
    georef_forward(georef, N, (struct vec3_in){in[0], in[1], in[2]}, (struct vec3_out){out[0], out[1], out[2]});
    georef_forward(georef, N, (struct vec3_in){in[0], in[1], in[2]}, (struct vec3_out){in[0], in[1], in[2]});
    for (int i = 0; i < N; i++) {
        int nans = isnan(out[0][i]) + isnan(out[1][i]) + isnan(out[2][i]);
        assert_int_equal(nans, i % 4 == 0 ? 0 : is_local ? 1 : 3);
        for (int c = 0; c < 3; c++)
            assert_true(in[c][i] == out[c][i] || (isnan(in[c][i]) && isnan(out[c][i])));
    }
    georef_forward(georef, 0, (struct vec3_in){in[0], in[1], in[2]}, (struct vec3_out){in[0], in[1], in[2]});
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
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
