/* SPDX-License-Identifier: MIT */
/* How a scene lies on the Earth. Stations of one scene agree, directions and scale are right, and traps give
 * warnings. */
#include <math.h>
#include <string.h>

#include "core/geoframe.h"
#include "core/locate.h"
#include "core/mat3.h"
#include "tests/common/cases.h"

/* WGS 84 (NIMA TR8350.2) */
#define A_M 6378137.0
#define F   (1 / 298.257223563)
#define B_M (A_M * (1 - F))
#define E2  (F * (2 - F))

static struct sh_err err;

static void ok(int code)
{
    if (code != SH_OK) fail_msg("%s", err.text);
}

static void assert_near(double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("%.15g instead of %.15g, off by %.3g", got, want, got - want);
}

static void tangent(struct geoframe *frame, double lat_deg, double lon_deg, double north_deg)
{
    const double origin_m[3] = {100, -50, 7};
    const struct georef_place at = {lat_deg, lon_deg, 110};
    ok(geoframe_set_tangent(frame, origin_m, &at, north_deg, &err));
}

/* Writes a point of the scene in the CRS, as the station sees it. */
static int see(const struct geoframe *frame, enum georef_crs crs, int zone, const double station_m[3],
               const double point_m[3], double p[3])
{
    struct georef_spec spec = {.crs = crs, .utm_zone = zone};
    struct georef *georef = NULL;
    double d[3], back[3];
    ok(geoframe_fill(frame, station_m, &spec, &err));
    ok(georef_create(&spec, &georef, &err));
    for (int i = 0; i < 3; i++)
        d[i] = point_m[i] - station_m[i];
    georef_forward(georef, 1, (struct vec3_in){&d[0], &d[1], &d[2]}, (struct vec3_out){&p[0], &p[1], &p[2]});
    double turn[9], linear[3];
    if (georef_rotation(georef, turn)) { /* the short way that casting takes */
        mat3_apply(turn, d, linear);
        for (int i = 0; i < 3; i++)
            assert_near(linear[i], p[i], 1e-12);
    } else {
        assert_int_equal(crs == GEOREF_UTM || frame->kind == GEOFRAME_GRID, 1);
    }
    georef_reverse(georef, p, back);
    for (int i = 0; i < 3; i++)
        assert_near(back[i], point_m[i], 3e-8); /* there and back with 5 nm each, and rounding at 5e6 m */
    double anchor[3];
    georef_anchor(georef, anchor);
    for (int i = 0; i < 3; i++)
        p[i] += anchor[i];
    int epsg = georef_epsg(georef);
    georef_free(georef);
    return epsg;
}

/* A point of the scene has the same place from each station: within 2e-8 m, where 1e-6 m is wanted. */
static void assert_agree(const struct geoframe *frame, int zone, const double first[3], const double second[3],
                         const double corner[3])
{
    static const enum georef_crs crs[] = {GEOREF_ECEF, GEOREF_UTM};
    for (int c = 0; c < 2; c++) {
        double a[3], b[3];
        assert_int_equal(see(frame, crs[c], zone, first, corner, a), see(frame, crs[c], zone, second, corner, b));
        for (int i = 0; i < 3; i++)
            assert_near(a[i], b[i], 2e-8);
    }
}

static void stations_agree(void **state)
{
    (void)state;
    static const struct {
        double lat_deg, lon_deg;
        int zone;
    } at[] = {{52.5, 13.4, 33}, {-33.9, 151.2, 56}, {0.0001, 9, 32}, {48, 180, 1}, {48, -180, 1},
              {89.9999, 30, 0}, {90, 0, 0},         {-90, 45, 0},    {60, 12, 33}, {60, 12, 32}};
    const double first[3] = {600, -50, 8}, second[3] = {-400, 900, 45}, corner[3] = {123.456, 78.9, 12.3};
    for (size_t i = 0; i < sizeof at / sizeof at[0]; i++) {
        struct geoframe frame;
        tangent(&frame, at[i].lat_deg, at[i].lon_deg, 17);
        assert_agree(&frame, at[i].zone, first, second, corner);
    }
    struct geoframe grid, ecef;
    const double a[3] = {391437, 5819711, 111}, b[3] = {392437, 5820011, 130}, c[3] = {391900.5, 5819999.25, 120.125};
    ok(geoframe_set_grid(&grid, 33, 1, &err));
    assert_agree(&grid, 33, a, b, c); /* its own zone */
    assert_agree(&grid, 32, a, b, c); /* and another */
    geoframe_set_ecef(&ecef);
    const double d[3] = {3783673, 901403, 5038083}, e[3] = {3783873, 902203, 5037793},
                 f[3] = {3783700, 901500, 5038050};
    assert_agree(&ecef, 33, d, e, f);
}

static void a_grid_scene_keeps_its_coordinates(void **state)
{
    (void)state;
    struct geoframe frame;
    ok(geoframe_set_grid(&frame, 33, 1, &err));
    const double station[3] = {391437.25, 5819711.5, 111}, corner[3] = {391900.5, 5819999.25, 120.125};
    double p[3];
    assert_int_equal(see(&frame, GEOREF_UTM, 0, station, corner, p), 32633);
    assert_memory_equal(p, corner, sizeof p);
    assert_int_equal(see(&frame, GEOREF_UTM, 33, station, corner, p), 32633);
    assert_memory_equal(p, corner, sizeof p);
}

/* The frame and the georeference give a point of the scene the same place, in different ways. */
static void frame_and_georeference_agree(void **state)
{
    (void)state;
    struct geoframe frame[3];
    const double station[3][3] = {{600, -50, 8}, {391437, 5819711, 111}, {3783673, 901403, 5038083}};
    tangent(&frame[0], 52.5, 13.4, -30);
    ok(geoframe_set_grid(&frame[1], 33, 1, &err));
    geoframe_set_ecef(&frame[2]);
    for (int k = 0; k < 3; k++) {
        struct georef_place at;
        const double corner[3] = {station[k][0] + 40, station[k][1] - 30, station[k][2] + 20};
        double p[3], q[3], back[3];
        ok(geoframe_locate(&frame[k], corner, &at, &err));
        georef_geodetic_to_ecef(&at, p);
        see(&frame[k], GEOREF_ECEF, 0, station[k], corner, q);
        ok(geoframe_find(&frame[k], &at, back, &err));
        for (int i = 0; i < 3; i++) {
            assert_near(q[i], p[i], 2e-8);
            assert_near(back[i], corner[i], 2e-8);
        }
    }
}

/* 500 m east of the anchor the plumb line leans by atan(500 / (N + h)), with N the radius in the prime vertical. */
static void a_far_station_leans(void **state)
{
    (void)state;
    struct geoframe frame;
    double turn[9], lat = 52.5 * M_PI / 180, n_m = A_M / sqrt(1 - E2 * sin(lat) * sin(lat));
    const double east[3] = {600, -50, 7};
    tangent(&frame, 52.5, 13.4, 0);
    ok(geoframe_to_enu(&frame, east, turn, &err));
    const double up[3] = {turn[2], turn[5], turn[8]};
    /* Seen from there the anchor's plumb line leans to the west; 1e-8 rad: the second order, (500/N)^2, is 6e-9 */
    assert_near(atan2(up[0], up[2]), -atan(500 / (n_m + 110)), 1e-8);
    assert_near(up[1], 0, 1e-8);
    assert_near(turn[0] * turn[0] + turn[3] * turn[3] + turn[6] * turn[6], 1, 1e-15);
}

/* True north is where north_deg says: there latitude grows and longitude stays. */
static void north_is_clockwise_from_y(void **state)
{
    (void)state;
    struct geoframe frame;
    struct georef_place at;
    tangent(&frame, 40, 20, 30);
    const double ahead[3] = {100 + 10 * sin(M_PI / 6), -50 + 10 * cos(M_PI / 6), 7};
    ok(geoframe_locate(&frame, ahead, &at, &err));
    double s = sin(40 * M_PI / 180), m_m = A_M * (1 - E2) / pow(1 - E2 * s * s, 1.5); /* radius in the meridian */
    assert_near(at.lon_deg, 20, 1e-13);
    assert_near(at.lat_deg, 40 + 10 / (m_m + 110) * 180 / M_PI, 1e-11);
}

/* The rotation of a grid is its convergence. The test takes it from a step to true north, by the projection. */
static void a_grid_is_turned_by_its_convergence(void **state)
{
    (void)state;
    struct geoframe frame;
    const double lat_deg[] = {52.5, -33, 70}, lon_deg[] = {13.4, 17.5, 16.9}, step_deg = 1e-4;
    for (int k = 0; k < 3; k++) {
        struct georef_place at = {lat_deg[k], lon_deg[k], 0}, north = {lat_deg[k] + step_deg, lon_deg[k], 0};
        struct georef_place south = {lat_deg[k] - step_deg, lon_deg[k], 0};
        double p[3], n[3], s[3], turn[9], enu[3];
        ok(geoframe_set_grid(&frame, 33, lat_deg[k] > 0, &err));
        ok(geoframe_find(&frame, &at, p, &err));
        ok(geoframe_find(&frame, &north, n, &err));
        ok(geoframe_find(&frame, &south, s, &err));
        const double d[3] = {n[0] - s[0], n[1] - s[1], 0};
        ok(geoframe_to_enu(&frame, p, turn, &err));
        mat3_apply(turn, d, enu);
        /* The projection is good to 10 nm in 22 m. The meridian's curvature cancels between the two steps. */
        assert_near(atan2(enu[0], enu[1]), 0, 3e-9);
    }
}

/* On the central meridian a grid metre is 1 / 0.9996 m, by definition. */
static void a_grid_metre_is_longer(void **state)
{
    (void)state;
    struct geoframe frame;
    double a[3], b[3];
    const double station[3] = {500000, 5800000, 0}, ahead[3] = {500000, 5800010, 0};
    ok(geoframe_set_grid(&frame, 33, 1, &err));
    see(&frame, GEOREF_ECEF, 0, station, station, a);
    see(&frame, GEOREF_ECEF, 0, station, ahead, b);
    double length_m = sqrt(pow(b[0] - a[0], 2) + pow(b[1] - a[1], 2) + pow(b[2] - a[2], 2));
    assert_near(length_m, 10 / 0.9996, 2e-8);
}

/* In a scene in ECEF a head stands upright at its place: at (a, 0, 0) up is X, north is Z, east is Y. */
static void a_head_in_ecef_stands_upright(void **state)
{
    (void)state;
    struct geoframe frame;
    const double at[3] = {A_M + 5, 0, 0}, want[9] = {0, 0, 1, 1, 0, 0, 0, 1, 0};
    double level[9];
    geoframe_set_ecef(&frame);
    ok(geoframe_level(&frame, at, level, &err));
    for (int i = 0; i < 9; i++)
        assert_near(level[i], want[i], 1e-15);
    tangent(&frame, 10, 20, 30);
    ok(geoframe_level(&frame, at, level, &err));
    assert_memory_equal(level, mat3_unit, sizeof level);
}

static void places_from_other_forms(void **state)
{
    (void)state;
    struct georef_place at;
    struct locate_grid utm;
    ok(georef_locate_ecef((const double[3]){0, 0, B_M + 12}, &at, &err));
    assert_near(at.lat_deg, 90, 0);
    assert_near(at.height_m, 12, 1e-8);
    ok(georef_locate_ecef((const double[3]){-A_M, 0, 0}, &at, &err));
    assert_near(fabs(at.lon_deg), 180, 0);
    assert_near(at.lat_deg, 0, 0);
    ok(georef_locate_utm(33, 1, (const double[3]){500000, 0, 5}, &at, &err)); /* zone 33: 12 to 18 deg */
    assert_near(at.lat_deg, 0, 1e-13);
    assert_near(at.lon_deg, 15, 1e-13);
    ok(georef_locate_utm(60, 0, (const double[3]){500000, 1e7, 5}, &at, &err));
    assert_near(at.lat_deg, 0, 1e-13);
    assert_near(at.lon_deg, 177, 1e-13);
    ok(georef_locate_utm(0, 0, (const double[3]){2e6, 2e6, 5}, &at, &err)); /* UPS has the pole at 2000 km, 2000 km */
    assert_near(at.lat_deg, -90, 1e-13);
    ok(locate_in_grid(&(struct georef_place){48, 180, 0}, 0, &utm, &err)); /* 180 E is 180 W, the first zone */
    assert_int_equal(utm.zone, 1);
    ok(locate_in_grid(&(struct georef_place){48, 12.1, 0}, 32, &utm, &err)); /* forced */
    assert_int_equal(utm.zone, 32);
    assert_true(utm.convergence_deg > 0 && utm.easting_m > 700000); /* east of the central meridian, 9 E */
}

static void what_is_nowhere_is_refused(void **state)
{
    (void)state;
    static const double inside[][3] = {{0, 0, 0}, {6e6, 0, 0}, {7e6, 0, 0}, {NAN, 0, 0}};
    struct geoframe frame;
    struct georef_place at;
    geoframe_set_ecef(&frame);
    for (int i = 0; i < 4; i++) {
        assert_int_equal(geoframe_locate(&frame, inside[i], &at, &err), SH_EINPUT);
        assert_non_null(strstr(err.text, i < 3 ? "not near the Earth's surface" : "not finite"));
    }
    assert_int_equal(georef_locate_utm(33, 1, (const double[3]){1.1e6, 5e6, 0}, &at, &err), SH_EINPUT);
    assert_int_equal(georef_locate_utm(33, 1, (const double[3]){-1e5, 5e6, 0}, &at, &err), SH_EINPUT);
    assert_int_equal(georef_locate_utm(33, 1, (const double[3]){5e5, 1e7, 0}, &at, &err), SH_EINPUT);
    assert_int_equal(georef_locate_utm(61, 1, (const double[3]){5e5, 5e6, 0}, &at, &err), SH_EINPUT);
    assert_int_equal(georef_locate_utm(33, 1, (const double[3]){NAN, 5e6, 0}, &at, &err), SH_EINPUT);
    struct locate_grid utm;
    assert_int_equal(locate_in_grid(&(struct georef_place){48, 100, 0}, 33, &utm, &err), SH_EINPUT);
    assert_int_equal(locate_in_grid(&(struct georef_place){91, 0, 0}, 0, &utm, &err), SH_EINPUT);
    assert_int_equal(locate_check(&(struct georef_place){48, 9, 2e5}, &err), SH_EINPUT);
    double p[3];
    const struct georef_place far_away = {48, 100, 0}, berlin = {52, 13, 0};
    assert_int_equal(geoframe_set_grid(&frame, 61, 1, &err), SH_EINPUT);
    ok(geoframe_set_grid(&frame, 33, 1, &err));
    assert_int_equal(geoframe_find(&frame, &far_away, p, &err), SH_EINPUT);
    ok(geoframe_set_grid(&frame, 0, 1, &err));
    assert_int_equal(geoframe_find(&frame, &berlin, p, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "UPS does not reach latitude 52"));
    for (int k = 0; k < 4; k++) {
        const double origin_m[3] = {k == 0 ? NAN : 1, k == 1 ? INFINITY : 2, k == 2 ? -INFINITY : 3};
        assert_int_equal(geoframe_set_tangent(&frame, origin_m, &berlin, k == 3 ? NAN : 0, &err), SH_EINPUT);
        assert_non_null(strstr(err.text, "origin or direction is not a finite number"));
    }
    assert_int_equal(geoframe_set_grid(&frame, -1, 1, &err), SH_EINPUT);
    assert_string_equal(err.text, "UTM zone -1; allowed 1 to 60, or 0: UPS");
    /* A frame that is no rotation. */
    struct georef_spec spec = {.crs = GEOREF_ECEF, .rotation = {1, 0, 0, 0, 2, 0, 0, 0, 1}};
    struct georef *georef = NULL;
    assert_int_equal(georef_create(&spec, &georef, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "rotation"));
}

/* Beyond the equator a grid goes on in its own northing. */
static void a_grid_reaches_beyond_the_equator(void **state)
{
    (void)state;
    struct geoframe frame;
    struct georef_place at = {-0.01, 15, 0}, back;
    double p[3];
    ok(geoframe_set_grid(&frame, 33, 1, &err));
    ok(geoframe_find(&frame, &at, p, &err));
    assert_true(p[1] < 0 && p[1] > -1200);
    ok(geoframe_locate(&frame, p, &back, &err));
    assert_near(back.lat_deg, -0.01, 1e-12);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stations_agree),
        cmocka_unit_test(a_grid_scene_keeps_its_coordinates),
        cmocka_unit_test(frame_and_georeference_agree),
        cmocka_unit_test(a_far_station_leans),
        cmocka_unit_test(north_is_clockwise_from_y),
        cmocka_unit_test(a_grid_is_turned_by_its_convergence),
        cmocka_unit_test(a_grid_metre_is_longer),
        cmocka_unit_test(a_head_in_ecef_stands_upright),
        cmocka_unit_test(places_from_other_forms),
        cmocka_unit_test(what_is_nowhere_is_refused),
        cmocka_unit_test(a_grid_reaches_beyond_the_equator),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
