/* SPDX-License-Identifier: MIT */
/* Named coordinate reference systems by PROJ, compared with GeographicLib's UTM and with published places. */
#include <math.h>
#include <string.h>

#include "core/angle.h"
#include "core/crs.h"
#include "core/vec3.h"
#include "tests/common/cases.h"

static struct sh_err err;

static void assert_near(double got, double want, double bound)
{
    if (!(fabs(got - want) <= bound)) fail_msg("%.12g instead of %.12g", got, want);
}

static struct crs_place located(const char *name, double easting_m, double northing_m)
{
    struct crs_place place;
    if (crs_locate(name, easting_m, northing_m, 7.5, &place, &err) != SH_OK) fail_msg("%s", err.text);
    assert_true(place.at.height_m == 7.5);
    return place;
}

/* PROJ and GeographicLib are two libraries of the same projection; places agree to 0.1 mm. WGS 84 / UTM and UPS involve
 * no other datum. EPSG:5041 and 5042 are UPS, GeographicLib's zone 0: there grid north turns by a degree with each
 * degree of longitude, however near to the pole. */
static void utm_is_that_of_geographiclib(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        int zone, north;
        double easting_m, northing_m;
    } at[] = {{"EPSG:32632", 32, 1, 691607.8, 5334760.1},
              {"EPSG:32733", 33, 0, 260000.0, 6250000.0},
              {"WGS 84 / UTM zone 33N", 33, 1, 500000.0, 5819711.0},
              {"EPSG:32660", 60, 1, 740000.0, 100000.0},
              {"EPSG:5041", 0, 1, 2000000.0, 2000000.0},
              {"EPSG:5041", 0, 1, 2000070.0, 2000070.0},
              {"EPSG:5041", 0, 1, 1999000.0, 2000000.0},
              {"EPSG:5042", 0, 0, 2000000.0, 2000000.0},
              {"EPSG:5042", 0, 0, 2000000.0, 2000100.0},
              {"EPSG:5042", 0, 0, 1999900.0, 1999990.0}};
    for (size_t i = 0; i < sizeof at / sizeof at[0]; i++) {
        const struct crs_place place = located(at[i].name, at[i].easting_m, at[i].northing_m);
        struct georef_place want, up;
        const double here[3] = {at[i].easting_m, at[i].northing_m, 0}, there[3] = {here[0], here[1] + 10.0, 0};
        assert_int_equal(georef_locate_utm(at[i].zone, at[i].north, here, &want, &err), SH_OK);
        assert_int_equal(georef_locate_utm(at[i].zone, at[i].north, there, &up, &err), SH_OK);
        /* Ten metres to grid north, in ECEF: their direction and length. At 10 m a chord's direction has turned by less
         * than 2e-6 rad from the tangent at its beginning. */
        double a[3], b[3], got[3], east_m, north_m;
        georef_geodetic_to_ecef(&(struct georef_place){place.at.lat_deg, place.at.lon_deg, 0.0}, got);
        georef_geodetic_to_ecef(&want, a);
        georef_geodetic_to_ecef(&up, b);
        assert_near(vec3_distance(a, got), 0.0, 1e-4);
        const double lat = angle_rad(place.at.lat_deg), lon = angle_rad(place.at.lon_deg); /* at a pole any is right */
        const double d[3] = {b[0] - a[0], b[1] - a[1], b[2] - a[2]};
        east_m = cos(lon) * d[1] - sin(lon) * d[0];
        north_m = cos(lat) * d[2] - sin(lat) * (cos(lon) * d[0] + sin(lon) * d[1]);
        assert_near(place.convergence_rad, atan2(east_m, north_m), 4e-6);
        assert_near(place.scale, 10.0 / hypot(east_m, north_m), 1e-8);
    }
}

/* The fundamental point of the Swiss grid, the old observatory of Bern, is at 2,600,000 1,200,000; swisstopo gives it
 * as 46 deg 57 min 3.9 s N, 7 deg 26 min 19.1 s E on WGS 84. Half a digit there is 1.6 m. The grid's north is true
 * there. */
static void the_swiss_grid(void **state)
{
    (void)state;
    const struct crs_place place = located("EPSG:2056", 2600000.0, 1200000.0);
    assert_near(place.at.lat_deg, 46.0 + 57.0 / 60 + 3.9 / 3600, 2e-5);
    assert_near(place.at.lon_deg, 7.0 + 26.0 / 60 + 19.1 / 3600, 3e-5);
    assert_near(place.convergence_rad, 0.0, 1e-4); /* the datums are turned and shifted a little */
    assert_near(place.scale, 1.0, 2e-4);           /* their ellipsoids differ */
    assert_true(place.accuracy_m > 0.0 && place.accuracy_m <= 5.0);
}

/* New York's grid of Long Island is in US survey feet. By NOAA's formula of that zone (a Lambert cone), 980,000 200,000
 * ft is in Battery Park, 40.7156 N, 74.0153 W. NAD83 and WGS 84 differ by a metre or two, 2e-5 degrees. */
static void a_grid_in_feet(void **state)
{
    (void)state;
    const double foot_m = 1200.0 / 3937.0;
    const struct crs_place place = located("EPSG:2263", 980000.0 * foot_m, 200000.0 * foot_m);
    assert_near(place.at.lat_deg, 40.7156, 1e-4);
    assert_near(place.at.lon_deg, -74.0153, 1e-4);
    assert_near(place.scale, 1.0, 1e-4);
}

static void what_is_none_is_refused(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        double easting_m;
        const char *part;
    } bad[] = {{"EPSG:1", 0, "EPSG:1: no such coordinate reference system; allowed is a projected"},
               {"", 0, "no such"},
               {"local site grid", 0, "local site grid: no such"},
               {"EPSG:4326", 10, "EPSG:4326: not a projected"},
               {"EPSG:4978", 10, "not a projected"},
               {"EPSG:32632", 1e12, "outside of the system"},
               {"EPSG:2056", 684500, "outside of the system"}, /* a digit is missing */
               {"EPSG:32632", NAN, "outside of the system"}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct crs_place place;
        const int code = crs_locate(bad[i].name, bad[i].easting_m, 0.0, 0.0, &place, &err);
        if (code != SH_EINPUT || strstr(err.text, bad[i].part) == NULL)
            fail_msg("case %zu: %d \"%s\"", i, code, err.text);
    }
}

/* Units by their definitions: the US survey foot is 1200 / 3937 m, the international one 0.3048 m. */
static void units_of_systems(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        int is_vertical;
        double unit_m; /* 0: refused */
    } at[] = {{"EPSG:2056", 0, 1.0}, {"EPSG:2263", 0, 1200.0 / 3937.0},   {"EPSG:2222", 0, 0.3048},
              {"EPSG:5773", 1, 1.0}, {"EPSG:6360", 1, 1200.0 / 3937.0},   {"EPSG:5773", 0, 0.0},
              {"EPSG:2056", 1, 0.0}, {"EPSG:5706", 1, 0.0} /* a depth */, {"EPSG:1", 1, 0.0}};
    for (size_t i = 0; i < sizeof at / sizeof at[0]; i++) {
        double unit_m = 0.0;
        const int code = crs_unit(at[i].name, at[i].is_vertical, &unit_m, &err);
        assert_int_equal(code, at[i].unit_m > 0.0 ? SH_OK : SH_EINPUT);
        if (code == SH_OK) assert_near(unit_m, at[i].unit_m, 1e-12);
        if (code != SH_OK && at[i].is_vertical && strstr(err.text, "not a vertical system with heights upward") == NULL)
            fail_msg("case %zu: \"%s\"", i, err.text);
    }
}

/* UTM's zone 32 is used from 6 to 12 deg E and from 0 to 84 deg N, and places up to 2 degrees beyond are taken. A
 * meridian is 110.57 km a degree at the equator and 10,001.97 km to the pole, where a degree has 111.69 km; its scale
 * is 0.9996. A degree of longitude on the equator is 111.32 km, and Mercator's projection lengthens 5 degrees of it by
 * 0.12 %. */
static void areas_of_use_have_a_margin(void **state)
{
    (void)state;
    static const double in_m[][2] = {{5e5, -220e3}, {5e5, 9550e3}, {5e5 - 556e3, 5e3}, {5e5 + 556e3, 5e3}};
    static const double out_m[][2] = {{5e5, -222e3}, {5e5, 9553e3}, {5e5 - 559e3, 5e3}, {5e5 + 559e3, 5e3}};
    struct crs_place place;
    for (int i = 0; i < 4; i++) {
        located("EPSG:32632", in_m[i][0], in_m[i][1]);
        assert_int_equal(crs_locate("EPSG:32632", out_m[i][0], out_m[i][1], 0.0, &place, &err), SH_EINPUT);
    }
    /* Fiji's grid has its origin at 17 deg S, 178.75 deg E, and is used on both sides of 180 deg. Datums there differ
     * by some hundreds of metres. */
    const struct crs_place fiji = located("EPSG:3460", 2000000.0, 4000000.0);
    assert_near(fiji.at.lat_deg, -17.0, 0.01);
    assert_near(fiji.at.lon_deg, 178.75, 0.01);
    located("EPSG:3460", 2300000.0, 4000000.0); /* 2.8 degrees farther east, 178.4 deg W */
    assert_int_equal(crs_locate("EPSG:3460", 1400000.0, 4000000.0, 0.0, &place, &err), SH_EINPUT); /* 173.1 deg E */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(utm_is_that_of_geographiclib),
        cmocka_unit_test(the_swiss_grid),
        cmocka_unit_test(a_grid_in_feet),
        cmocka_unit_test(what_is_none_is_refused),
        cmocka_unit_test(units_of_systems),
        cmocka_unit_test(areas_of_use_have_a_margin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
