/* SPDX-License-Identifier: MIT */
/* Georeferencing: places in each system, the map's convergence, another centre, the scale of counts, refusals. */
#include "core/locate.h"
#include "tests/unit/georef_rig.h"

/* Places go back and forth between systems. The ends of the ellipsoid's axes and the false origins are right. */
static void test_places(void **state)
{
    (void)state;
    struct georef_place place;
    struct sh_err err;
    struct locate_grid grid;
    double p[3];
    assert_int_equal(georef_locate_ecef((const double[3]){0, 0, -B_M - 5}, &place, &err), SH_OK);
    expect_near(place.lat_deg, -90, 1e-12);
    expect_near(place.height_m, 5, TOL_M);
    assert_int_equal(georef_locate_ecef((const double[3]){0, A_M + 7, 0}, &place, &err), SH_OK);
    expect_point((const double[3]){place.lat_deg, place.lon_deg, place.height_m}, 0, 90, 7, TOL_M);
    assert_int_equal(georef_locate_ecef((const double[3]){NAN, 0, 0}, &place, &err), SH_EINPUT);
    assert_int_equal(georef_locate_utm(31, 1, (const double[3]){500000, 0, 12}, &place, &err), SH_OK);
    expect_point((const double[3]){place.lat_deg, place.lon_deg, place.height_m}, 0, 3, 12, 1e-13);
    assert_int_equal(georef_locate_utm(0, 0, (const double[3]){2e6, 2e6, 0}, &place, &err), SH_OK);
    expect_near(place.lat_deg, -90, 1e-12);
    assert_int_equal(georef_locate_utm(61, 1, (const double[3]){500000, 0, 0}, &place, &err), SH_EINPUT);
    assert_int_equal(georef_locate_utm(31, 1, (const double[3]){9e6, 0, 0}, &place, &err), SH_EINPUT);
    for (int i = 0; i < 50; i++) {
        const struct georef_place at = {-88 + 3.5 * i, -179 + 7.1 * i, 100.0 * i};
        georef_geodetic_to_ecef(&at, p);
        assert_int_equal(georef_locate_ecef(p, &place, &err), SH_OK);
        expect_point((const double[3]){place.lat_deg, remainder(place.lon_deg - at.lon_deg, 360), place.height_m},
                     at.lat_deg, 0, at.height_m, TOL_M);
        assert_int_equal(locate_in_grid(&at, 0, &grid, &err), SH_OK);
        assert_int_equal(grid.zone == 0, at.lat_deg >= 84 || at.lat_deg < -80);
        assert_int_equal(grid.north, at.lat_deg >= 0);
        assert_int_equal(georef_locate_utm(grid.zone, grid.north,
                                           (const double[3]){grid.easting_m, grid.northing_m, at.height_m}, &place,
                                           &err),
                         SH_OK);
        expect_point((const double[3]){place.lat_deg, remainder(place.lon_deg - at.lon_deg, 360), place.height_m},
                     at.lat_deg, 0, at.height_m, TOL_M);
    }
}

/* Convergence east of the central meridian is atan(tan(dlon) sin(lat)) on the sphere, within e'^2 of it; scale is
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
    /* The convergence is that of the map: true north goes to the west of the grid's. */
    double d[3];
    forward_one(georef, (const double[3]){0, 1, 0}, d);
    expect_near(atan2(d[0], d[1]), -convergence_rad, 1e-8);
    georef_free(georef);
    georef = make(GEOREF_ECEF, 50, 11, 0, 0);
    georef_convergence(georef, &convergence_rad, &scale);
    assert_true(convergence_rad == 0 && scale == 1);
    georef_free(georef);
}

/* Another centre gives the same positions, also across the zone's border, the equator and the antimeridian. */
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

/* A count is at most scale_m long on the ground and the farthest points fit. If they can't, it is reported. */
static void test_scale(void **state)
{
    (void)state;
    struct sh_err err;
    for (int i = 0; i < 60; i++) {
        double lat_deg = i < 3 ? 90 - 0.001 * i : -88 + 3 * i, reach_m = i % 2 ? 2000 : 100, scale_m = 1e-6, scale[3];
        if (lat_deg > 90) break;
        struct georef *georef = make(GEOREF_GEODETIC, lat_deg, 179.999, 50 * i, 0);
        assert_int_equal(georef_scale(georef, scale_m, reach_m, scale, &err), SH_OK);
        /* near a pole counts may be longer: a full turn at up to twice the reach has 2^32 */
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
    for (int i = 0; i < 40; i++) { /* the scale that the error names is accepted */
        double reach_m = 3e3 * (1 + 0.137 * i), least_m = 0;
        assert_int_equal(georef_scale(georef, 1e-7, reach_m, scale, &err), SH_EINPUT);
        assert_int_equal(sscanf(strstr(err.text, "at least "), "at least %lg m", &least_m), 1);
        if (georef_scale(georef, least_m, reach_m, scale, &err) != SH_OK) fail_msg("%s", err.text);
        /* A geoid may change heights by 1 % of the distance. The scale is named to three digits. */
        assert_true(least_m * 2147483647.0 >= 1.01 * reach_m && least_m * 2147483647.0 < 1.04 * reach_m);
    }
    assert_int_equal(georef_scale(georef, 1e-4, 100e3, scale, &err), SH_OK);
    assert_true(scale[0] == 1e-4 && scale[1] == 1e-4 && scale[2] == 1e-4);
    georef_free(georef);
}

/* A place may use the other hemisphere's grid, its false northing and code. A scene in a southern grid keeps that. */
static void test_sides(void **state)
{
    (void)state;
    struct sh_err err = {0, ""};
    for (int side = -1; side <= 1; side += 2) {
        struct georef_spec spec = {.crs = GEOREF_UTM, .lat_deg = -0.1 * side, .lon_deg = 9, .side = side};
        struct georef *georef = NULL;
        double anchor[3];
        if (georef_create(&spec, &georef, &err) != SH_OK) fail_msg("%s", err.text);
        georef_anchor(georef, anchor);
        assert_int_equal(georef_epsg(georef), side > 0 ? 32632 : 32732);
        /* 0.1 degrees of 110,574 m, by 0.9996, beyond the equator */
        expect_near(anchor[1], side > 0 ? -11053 : 1e7 + 11053, 1);
        georef_free(georef);
    }
    struct georef_spec spec = {.crs = GEOREF_UTM,
                               .station_m = {500000, 6e6, 5},
                               .lat_deg = -36,
                               .lon_deg = 15,
                               .prcs_is_grid = 1,
                               .prcs_zone = 33};
    struct georef *georef = NULL;
    if (georef_create(&spec, &georef, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(georef_epsg(georef), 32733);
    georef_free(georef);
}

/* A difference in degrees is the short way round, and the axes are east, north, up. The axes are taken from steps over
 * which the map bends by less than 1e-9. The ellipsoid bends by 100 m / 6.4e6 m, but two opposite steps cancel that. */
static void test_degrees(void **state)
{
    (void)state;
    struct georef *georef = make(GEOREF_GEODETIC, 47, 179.999, 200, 0);
    double d[3], axes[9];
    georef_difference(georef, (const double[3]){47.001, -179.999, 205}, d);
    expect_point(d, 0.001, 0.002, 5, 1e-9);
    georef_axes(georef, axes);
    for (int i = 0; i < 9; i++)
        expect_near(axes[i], i % 4 == 0, 1e-8);
    georef_free(georef);
    /* also a rotation rounds: doubles of 6.4e6 m step by 1e-9 m */
    georef = make(GEOREF_ECEF, 47, 9, 200, 0);
    assert_true(georef_bound_m(georef, GEOREF_EXACT, 100, 10) >= 1e-9);
    georef_free(georef);
    /* a scene whose x axis points north */
    struct georef_spec spec = {
        .crs = GEOREF_GEODETIC, .lat_deg = 47, .lon_deg = 9, .rotation = {0, -1, 0, 1, 0, 0, 0, 0, 1}};
    struct sh_err err = {0, ""};
    if (georef_create(&spec, &georef, &err) != SH_OK) fail_msg("%s", err.text);
    georef_axes(georef, axes);
    for (int i = 0; i < 9; i++)
        expect_near(axes[i], spec.rotation[i], 1e-8);
    georef_free(georef);
    /* at a pole and 11 m from one, where degrees of longitude are short or nothing */
    static const double lat_deg[] = {89.9999, -89.9999, 90, -90};
    for (size_t k = 0; k < sizeof lat_deg / sizeof lat_deg[0]; k++) {
        spec.lat_deg = lat_deg[k];
        if (georef_create(&spec, &georef, &err) != SH_OK) fail_msg("%s", err.text);
        georef_axes(georef, axes);
        for (int i = 0; i < 9; i++)
            expect_near(axes[i], spec.rotation[i], 1e-8);
        georef_free(georef);
    }
}

/* Order 5 is for maps that do not change heights. */
static void test_orders(void **state)
{
    (void)state;
    struct sh_err err = {0, ""};
    static const enum georef_crs crs[] = {GEOREF_UTM, GEOREF_GEODETIC};
    for (int i = 0; i < 2; i++) {
        struct georef *georef = make(crs[i], 47, 9, 200, 0);
        assert_int_equal(georef_set_method(georef, GEOREF_ORDER5, &err), SH_EINPUT);
        assert_non_null(strstr(err.text, "allowed exact, order1, order2, order3"));
        assert_true(isinf(georef_bound_m(georef, GEOREF_ORDER5, 100, 10)));
        assert_int_equal(georef_set_method(georef, GEOREF_ORDER3, &err), SH_OK);
        assert_true(isinf(georef_bound_m(georef, GEOREF_ORDER3, 21000, 10))); /* fitted within 20 km */
        georef_free(georef);
    }
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
        {{.crs = GEOREF_UTM, .lat_deg = 50, .lon_deg = 16, .utm_zone = GEOREF_UPS}, "georef: UPS does not reach"},
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
    struct georef_place at = {.lat_deg = 48, .lon_deg = 16};
    struct locate_grid grid;
    struct sh_err err = {0, ""};
    /* GeographicLib's reason is in parentheses. Where it is not asked, there are none. */
    assert_int_equal(locate_in_grid(&at, 10, &grid, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "UTM zone 10 does not reach latitude 48, longitude 16 ("));
    assert_int_equal(err.text[strlen(err.text) - 1], ')');
    assert_int_equal(locate_in_grid(&at, 61, &grid, &err), SH_EINPUT);
    assert_string_equal(err.text, "UTM zone 61 does not reach latitude 48, longitude 16");
    at.lon_deg = 177; /* the last zone's middle */
    assert_int_equal(locate_in_grid(&at, 60, &grid, &err), SH_OK);
    assert_int_equal(georef_locate_utm(0, 1, (const double[3]){9e6, 2e6, 0}, &at, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "9000000.000 E 2000000.000 N is not in UPS N"));
    assert_int_equal(georef_locate_utm(33, 0, (const double[3]){9e6, 2e6, 0}, &at, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "is not in UTM zone 33S"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_places),  cmocka_unit_test(test_convergence), cmocka_unit_test(test_recentre),
        cmocka_unit_test(test_scale),   cmocka_unit_test(test_refusals),    cmocka_unit_test(test_sides),
        cmocka_unit_test(test_degrees), cmocka_unit_test(test_orders),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
