/* SPDX-License-Identifier: MIT */
/* Limits of places and of georeferencing: each limit itself is allowed, and what lies beyond is refused with its figure
 * and with what is allowed. */
#include "core/geoframe.h"
#include "core/locate.h"
#include "tests/unit/georef_rig.h"

static struct sh_err err;

static void refused(int rc, const char *says)
{
    assert_int_equal(rc, SH_EINPUT);
    assert_string_equal(err.text, says);
    err.text[0] = '\0';
}

static void places(void **state)
{
    (void)state;
    static const struct {
        struct georef_place at;
        const char *says; /* NULL: it is one */
    } is[] = {{{90.0, -180.0, -12000.0}, NULL},
              {{-90.0, 360.0, 100000.0}, NULL},
              {{90.5, 0.0, 0.0}, "latitude 90.5 deg; allowed -90 to 90 deg"},
              {{-90.5, 0.0, 0.0}, "latitude -90.5 deg; allowed -90 to 90 deg"},
              {{0.0, -180.5, 0.0}, "longitude -180.5 deg; allowed -180 to 360 deg"},
              {{0.0, 360.5, 0.0}, "longitude 360.5 deg; allowed -180 to 360 deg"},
              {{0.0, 0.0, -12001.0},
               "not near the Earth's surface: height -12001 m above the ellipsoid; allowed -12000 to 100000 m"},
              {{0.0, 0.0, 100001.0},
               "not near the Earth's surface: height 100001 m above the ellipsoid; allowed -12000 to 100000 m"}};
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++) {
        double p[3], rotation[9];
        const int rc = locate_check(&is[i].at, &err), code = is[i].says == NULL ? SH_OK : SH_EINPUT;
        assert_int_equal(rc, code);
        if (rc != SH_OK) refused(rc, is[i].says);
        assert_int_equal(locate_axes(&is[i].at, p, rotation, &err), code);
    }
}

static void specs(void **state)
{
    (void)state;
    static const struct {
        struct georef_spec spec;
        const char *says;
    } is[] = {
        {{.station_m = {INFINITY, 0, 0}}, "georef: station position x is not a finite number of metres"},
        {{.station_m = {0, -INFINITY, 0}}, "georef: station position y is not a finite number of metres"},
        {{.station_m = {0, 0, NAN}}, "georef: station position z is not a finite number of metres"},
        {{.crs = (enum georef_crs)4}, "georef: coordinate reference system 4; allowed local, ecef, utm, geodetic"},
        {{.crs = GEOREF_UTM, .utm_zone = 61}, "georef: UTM zone 61; allowed 1 to 60, or 0: by position"},
        {{.crs = GEOREF_UTM, .utm_zone = -2}, "georef: UTM zone -2; allowed 1 to 60, or 0: by position"},
        {{.crs = GEOREF_UTM, .prcs_is_grid = 1, .prcs_zone = 61},
         "georef: zone 61 of the scene frame; allowed 1 to 60, or 0: UPS"},
        {{.crs = GEOREF_UTM, .prcs_is_grid = 1, .prcs_zone = -1},
         "georef: zone -1 of the scene frame; allowed 1 to 60, or 0: UPS"},
        {{.crs = GEOREF_ECEF, .rotation = {1, 0, 0, 0, 1, 0, 0, 1e-8, 1}},
         "georef: the scene frame's matrix is not a rotation"},
        {{.crs = GEOREF_ECEF, .rotation = {1, 0, 0, 0, 1, 0, 0, 0, 1.00001}},
         "georef: the scene frame's matrix is not a rotation"}};
    struct georef *georef = NULL;
    for (size_t i = 0; i < sizeof is / sizeof is[0]; i++)
        refused(georef_create(&is[i].spec, &georef, &err), is[i].says);
    /* The highest zone is allowed. */
    const struct georef_spec last = {.crs = GEOREF_UTM, .lat_deg = 10, .lon_deg = 177, .utm_zone = 60};
    assert_int_equal(georef_create(&last, &georef, &err), SH_OK);
    assert_int_equal(georef_epsg(georef), 32660);
    georef_free(georef);
    const struct georef_spec rounded = {.crs = GEOREF_ECEF, .rotation = {1, 0, 0, 0, 1, 0, 0, 1e-10, 1}};
    assert_int_equal(georef_create(&rounded, &georef, &err), SH_OK);
    georef_free(georef);
}

static void expect_begin(int rc, const char *begin, const char *end)
{
    assert_int_equal(rc, SH_EINPUT);
    const size_t n = strlen(err.text), m = strlen(end);
    if (strncmp(err.text, begin, strlen(begin)) != 0 || n < m || strcmp(err.text + n - m, end) != 0)
        fail_msg("%s", err.text);
}

/* The reason in brackets is GeographicLib's. */
static void zones_that_do_not_reach(void **state)
{
    (void)state;
    struct georef *georef = NULL, *moved = NULL;
    struct georef_spec spec = {.crs = GEOREF_UTM, .lat_deg = 48, .lon_deg = 16, .utm_zone = 10};
    expect_begin(georef_create(&spec, &georef, &err), "georef: UTM zone 10 does not reach latitude 48, longitude 16 (",
                 "); zone 0: by position");
    spec.utm_zone = GEOREF_UPS;
    expect_begin(georef_create(&spec, &georef, &err), "georef: UPS does not reach latitude 48, longitude 16 (", ")");
    spec = (struct georef_spec){.crs = GEOREF_UTM, .station_m = {5e5, 5.3e6, 0}, .lat_deg = 48, .lon_deg = 9};
    spec.prcs_is_grid = spec.prcs_north = 1;
    spec.prcs_zone = 32;
    spec.utm_zone = 10;
    expect_begin(georef_create(&spec, &georef, &err),
                 "georef: the grid of the scene or of the output does not reach latitude 48, longitude 9 (", ")");
    georef = make(GEOREF_UTM, 48, 9, 0, 32);
    expect_begin(georef_recentre(georef, (const double[3]){9e6, 20, 30}, &moved, &err),
                 "georef: the zone (EPSG 32632) does not reach 9000000 20 30 m (", ")");
    for (int k = 0; k < 3; k++) {
        double centre_m[3] = {10, 20, 30};
        char says[64];
        centre_m[k] = (double)NAN;
        snprintf(says, sizeof says, "georef: centre %c is not a finite number", "xyz"[k]);
        refused(georef_recentre(georef, centre_m, &moved, &err), says);
    }
    georef_free(georef);
}

static void methods(void **state)
{
    (void)state;
    struct georef *utm = make(GEOREF_UTM, 48, 9, 0, 0), *ecef = make(GEOREF_ECEF, 48, 9, 0, 0);
    refused(georef_set_method(utm, GEOREF_AUTO, &err),
            "georef: method 0; allowed exact, order1, order2, order3, order5");
    refused(georef_set_method(utm, (enum georef_method)(GEOREF_ORDER5 + 1), &err),
            "georef: method 6; allowed exact, order1, order2, order3, order5");
    refused(georef_set_method(utm, GEOREF_ORDER5, &err),
            "georef: no polynomial of order 5 here; allowed exact, order1, order2, order3");
    assert_int_equal(georef_method(utm), GEOREF_EXACT);
    assert_int_equal(georef_set_method(utm, GEOREF_ORDER1, &err), SH_OK);
    assert_int_equal(georef_method(utm), GEOREF_ORDER1);
    assert_int_equal(georef_set_method(ecef, GEOREF_ORDER5, &err), SH_OK); /* a rotation is exact by any */
    georef_free(ecef);
    georef_free(utm);
}

/* Makes a scene in UPS, away_m from the pole. Metres of its grid are 0.994 of those on the ground. */
static struct georef *near_pole(double away_m)
{
    struct georef_place at;
    struct georef_spec spec = {.crs = GEOREF_GEODETIC, .station_m = {2e6 + 0.994 * away_m, 2e6, 10.0}};
    struct georef *georef = NULL;
    assert_int_equal(georef_locate_utm(0, 1, spec.station_m, &at, &err), SH_OK);
    spec.lat_deg = at.lat_deg;
    spec.lon_deg = at.lon_deg;
    spec.height_m = at.height_m;
    spec.prcs_is_grid = spec.prcs_north = 1;
    if (georef_create(&spec, &georef, &err) != SH_OK) fail_msg("%s", err.text);
    return georef;
}

/* A centre within a metre of the axis has no longitude, and no polynomial (core/georef/georef.c). */
static void polynomials_near_a_pole(void **state)
{
    (void)state;
    struct georef *far = near_pole(1.1), *near = near_pole(0.9), *moved;
    assert_int_equal(georef_set_method(far, GEOREF_ORDER1, &err), SH_OK);
    assert_true(isfinite(georef_bound_m(far, GEOREF_ORDER3, 0.01, 0.01)));
    refused(georef_set_method(near, GEOREF_ORDER1, &err),
            "georef: there is no polynomial about a place so close to a pole; allowed exact");
    assert_true(isinf(georef_bound_m(near, GEOREF_ORDER3, 0.01, 0.01)));
    refused(georef_recentre(far, (const double[3]){2000000, 2000000.25, 10}, &moved, &err),
            "georef: no polynomial about 2000000 2000000 10 m: the place is too close to a pole");
    georef_free(near);
    georef_free(far);
}

static void grids(void **state)
{
    (void)state;
    static const double here[3] = {5e5, 5.3e6, 0.0};
    struct georef_place at;
    refused(georef_locate_utm(61, 1, here, &at, &err), "UTM zone 61; allowed 1 to 60, or 0: UPS");
    refused(georef_locate_utm(-1, 1, here, &at, &err), "UTM zone -1; allowed 1 to 60, or 0: UPS");
    for (int k = 0; k < 3; k++) {
        double none[3] = {5e5, 5.3e6, 0.0};
        none[k] = (double)INFINITY;
        refused(georef_locate_utm(60, 1, none, &at, &err), "UTM coordinates are not finite numbers of metres");
        refused(georef_locate_utm(0, 1, none, &at, &err), "UPS coordinates are not finite numbers of metres");
        refused(georef_locate_ecef(none, &at, &err), "ECEF coordinates are not finite numbers of metres");
    }
    expect_begin(georef_locate_utm(60, 0, (const double[3]){9e6, 2e6, 0}, &at, &err),
                 "9000000.000 E 2000000.000 N is not in UTM zone 60S (", ")");
    expect_begin(georef_locate_utm(0, 1, (const double[3]){9e6, 2e6, 0}, &at, &err),
                 "9000000.000 E 2000000.000 N is not in UPS N (", ")");
    assert_int_equal(georef_locate_utm(60, 1, here, &at, &err), SH_OK);
    /* On a zone's central meridian; zone 60 has 177 degrees east. */
    assert_true(fabs(at.lon_deg - 177.0) < 1e-9 && at.height_m == 0.0);
}

static void frames(void **state)
{
    (void)state;
    static const double here[3] = {0.0, 0.0, 0.0};
    const struct georef_place munich = {48, 11, 500}, south = {-85, 30, 0};
    struct geoframe frame;
    struct georef_place at;
    double p[3];
    for (int k = 0; k < 3; k++) {
        double none[3] = {0.0, 0.0, 0.0};
        none[k] = (double)NAN;
        refused(geoframe_set_tangent(&frame, none, &munich, 0.0, &err),
                "the anchor's origin or direction is not a finite number");
    }
    refused(geoframe_set_tangent(&frame, here, &munich, INFINITY, &err),
            "the anchor's origin or direction is not a finite number");
    refused(geoframe_set_grid(&frame, 61, 1, &err), "UTM zone 61; allowed 1 to 60, or 0: UPS");
    refused(geoframe_set_grid(&frame, -1, 1, &err), "UTM zone -1; allowed 1 to 60, or 0: UPS");
    assert_int_equal(geoframe_set_grid(&frame, 60, 1, &err), SH_OK);
    assert_int_equal(geoframe_set_grid(&frame, 0, 1, &err), SH_OK);
    refused(geoframe_find(&frame, &south, p, &err), "latitude -85, longitude 30 is not in the scene's grid, UPS north");
    assert_int_equal(geoframe_set_grid(&frame, 0, 0, &err), SH_OK);
    assert_int_equal(geoframe_find(&frame, &south, p, &err), SH_OK);
    assert_int_equal(geoframe_set_tangent(&frame, here, &munich, 0.0, &err), SH_OK);
    refused(geoframe_locate(&frame, (const double[3]){1.0, 2.0, 200000.0}, &at, &err),
            "scene point 1 2 200000: not near the Earth's surface: height 200500 m above the ellipsoid; allowed -12000 "
            "to 100000 m");
}

/* A count has 31 bits and a sign; half a count stays free for rounding. */
static void counts(void **state)
{
    (void)state;
    struct georef *local = make(GEOREF_LOCAL, 0, 0, 0, 0);
    double scale[3];
    refused(georef_scale(local, 1e-6, 3000.0, scale, &err),
            "coordinates up to 3000 m from their anchor do not fit into 31 bits at 1e-06 m per count; at least 1.4e-06 "
            "m");
    assert_int_equal(georef_scale(local, 1e-6, 2147.483646, scale, &err), SH_OK);
    assert_true(scale[0] == 1e-6 && scale[1] == 1e-6 && scale[2] == 1e-6);
    assert_int_equal(georef_scale(local, 1e-6, 2147.483647, scale, &err), SH_EINPUT);
    assert_int_equal(georef_scale(local, NAN, 10.0, scale, &err), SH_EINPUT);
    assert_true(georef_count_m(local, 10.0, (const double[3]){1e-6, 3e-6, 2e-6}) == 3e-6);
    georef_free(local);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(places),
        cmocka_unit_test(specs),
        cmocka_unit_test(zones_that_do_not_reach),
        cmocka_unit_test(methods),
        cmocka_unit_test(polynomials_near_a_pole),
        cmocka_unit_test(grids),
        cmocka_unit_test(frames),
        cmocka_unit_test(counts),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
