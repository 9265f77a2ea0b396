/* SPDX-License-Identifier: MIT */
/* Colours show heights in the scene, also for points in a CRS. Georeferencing takes points to the CRS, and the recorder
 * computes their heights in the scene again. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <cmocka.h>

#include "core/georef.h"
#include "drivers/protocol/native.h"
#include "drivers/record/colour.h"
#include "drivers/record/track.h"

static const double STATION_M[3] = {10, 20, 30};

static double height_seen(enum georef_crs crs, uint32_t native_crs, double lon_deg, const double d_scene[3])
{
    static struct track t;
    struct georef_spec spec = {.crs = crs, .lat_deg = 47, .lon_deg = lon_deg, .height_m = 100};
    struct georef *georef;
    struct sh_err err;
    double d[3];
    memcpy(spec.station_m, STATION_M, sizeof STATION_M);
    if (georef_create(&spec, &georef, &err) != SH_OK) fail_msg("%s", err.text);
    memset(&t, 0, sizeof t);
    t.info = (struct scanhead_info){.geo = 1, .crs = (int)native_crs};
    t.crs = (int)native_crs;
    memcpy(t.info.station_m, STATION_M, sizeof STATION_M);
    georef_anchor(georef, t.info.anchor);
    georef_axes(georef, t.info.axes);
    station_pose_of(&t.info, &t.pose);
    georef_forward(georef, 1, (struct vec3_in){&d_scene[0], &d_scene[1], &d_scene[2]},
                   (struct vec3_out){&d[0], &d[1], &d[2]});
    t.points.x[0] = t.info.anchor[0] + d[0];
    t.points.y[0] = t.info.anchor[1] + d[1];
    t.points.z[0] = t.info.anchor[2] + d[2];
    t.points.echo_count[0] = 1;
    if (crs == GEOREF_GEODETIC) t.points.y[0] = remainder(t.points.y[0], 360);
    georef_free(georef);
    return colour_figure(COLOUR_HEIGHT, &t, 0);
}

/* 2 km away the Earth's surface is 0.31 m below the level of the station. Radii of curvature differ by 0.6 % from the
 * mean one, so heights by 2 mm. Heights in ECEF need no radius. */
static void test_heights(void **state)
{
    (void)state;
    static const struct {
        enum georef_crs crs;
        uint32_t native;
    } in[] = {{GEOREF_UTM, NATIVE_CRS_UTM}, {GEOREF_GEODETIC, NATIVE_CRS_GEODETIC}, {GEOREF_ECEF, NATIVE_CRS_ECEF}};
    static const double lon_deg[] = {9, 179.9999};
    static const double at[][3] = {{0, 0, 5}, {2000, 0, 5}, {0, -2000, -3}, {-1400, 1400, 40}};
    for (int i = 0; i < 3 * 2 * 4; i++) {
        const double *d = at[i % 4];
        const double seen_m = height_seen(in[i / 8].crs, in[i / 8].native, lon_deg[i / 4 % 2], d);
        if (!(fabs(seen_m - (STATION_M[2] + d[2])) < 2e-3))
            fail_msg("CRS %d, longitude %g, %g %g %g: height %.4f, not %.4f", in[i / 8].crs, lon_deg[i / 4 % 2], d[0],
                     d[1], d[2], seen_m, STATION_M[2] + d[2]);
    }
}

/* A scene in coordinates of the grid has the grid's heights. 5 km away, the surface would be 1.96 m lower. */
static void test_scene_in_the_grid(void **state)
{
    (void)state;
    static struct track t;
    static const double anchor[3] = {500000, 5200000, 100}, axes[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    t.info = (struct scanhead_info){.geo = 1, .crs = NATIVE_CRS_UTM};
    t.crs = NATIVE_CRS_UTM;
    memcpy(t.info.anchor, anchor, sizeof anchor);
    memcpy(t.info.station_m, anchor, sizeof anchor);
    memcpy(t.info.axes, axes, sizeof axes);
    station_pose_of(&t.info, &t.pose);
    t.points.x[0] = anchor[0] + 3000;
    t.points.y[0] = anchor[1] - 4000;
    t.points.z[0] = anchor[2] + 7;
    t.points.echo_count[0] = 1;
    assert_true(fabs(colour_figure(COLOUR_HEIGHT, &t, 0) - 107) < 1e-9);
    /* Points of a moving head, and those in the scene's own frame, have their height as it is, whatever the axes. */
    memcpy(t.info.axes, (const double[9]){1, 0, 0, 0, 0, -1, 0, 1, 0}, sizeof axes);
    t.info.moving = 1;
    assert_true(fabs(colour_figure(COLOUR_HEIGHT, &t, 0) - 107) < 1e-9);
    t.info.moving = 0;
    t.info.crs = NATIVE_CRS_LOCAL;
    assert_true(fabs(colour_figure(COLOUR_HEIGHT, &t, 0) - 107) < 1e-9);
    t.points.echo_count[0] = 0; /* a shot without echo has none */
    assert_true(isnan(colour_figure(COLOUR_HEIGHT, &t, 0)));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_heights), cmocka_unit_test(test_scene_in_the_grid)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
