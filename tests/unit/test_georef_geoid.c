/* SPDX-License-Identifier: MIT */
/* Heights above a geoid, by a file that the test makes. The geoid's surface rises by a metre a degree of latitude,
 * which the cubic interpolation of GeographicLib reproduces but for rounding. */
#include <stdlib.h>
#include <unistd.h>

#include "tests/unit/georef_rig.h"

enum { WIDTH = 360, HEIGHT = 181 };

static char folder[] = "/tmp/test_georef_geoid_XXXXXX";

/* The file is PGM with two bytes a pixel, from 90 degrees north on. Metres are -100 + 0.01 times the pixel. */
static int set_up(void **state)
{
    char path[64];
    (void)state;
    if (mkdtemp(folder) == NULL) return -1;
    snprintf(path, sizeof path, "%s/slope.pgm", folder);
    FILE *f = fopen(path, "wb");
    if (f == NULL) return -1;
    fprintf(f,
            "P5\n# Geoid file in PGM format for the GeographicLib::Geoid class\n# Description a slope\n"
            "# DateTime 2026-01-01 00:00:00\n# MaxBilinearError 0.01\n# RMSBilinearError 0.01\n# MaxCubicError 0.01\n"
            "# RMSCubicError 0.01\n# Offset -100\n# Scale 0.01\n# Origin 90N 0E\n# AREA_OR_POINT Point\n"
            "# Vertical_Datum WGS84\n%d %d\n65535\n",
            WIDTH, HEIGHT);
    for (int row = 0; row < HEIGHT; row++)
        for (int column = 0; column < WIDTH; column++) {
            const int pixel = 10000 + 100 * (90 - row);
            fputc(pixel >> 8, f);
            fputc(pixel & 255, f);
        }
    setenv("GEOGRAPHICLIB_GEOID_PATH", folder, 1);
    setenv("GEOGRAPHICLIB_GEOID_NAME", "slope", 1);
    return fclose(f);
}

static int tear_down(void **state)
{
    char path[64];
    (void)state;
    snprintf(path, sizeof path, "%s/slope.pgm", folder);
    unlink(path);
    return rmdir(folder);
}

static struct georef *make_on(const struct georef_geoid *geoid, enum georef_crs crs)
{
    struct georef_spec spec = {.crs = crs, .lat_deg = 40, .lon_deg = 9, .height_m = 500, .geoid = geoid};
    struct georef *georef = NULL;
    struct sh_err err = {0, ""};
    if (georef_create(&spec, &georef, &err) != SH_OK) fail_msg("%s", err.text);
    return georef;
}

/* The station is 500 m above the ellipsoid, and 460 m above the geoid. 20 km to the north the geoid is 0.18 m higher,
 * so heights above it are that much less. Interpolation rounds in 1e-12 of some hundred metres. */
static void test_heights(void **state)
{
    (void)state;
    static const enum georef_crs crs[] = {GEOREF_UTM, GEOREF_GEODETIC};
    struct georef_geoid *geoid;
    struct sh_err err;
    if (georef_geoid_open(&geoid, &err) != SH_OK) fail_msg("%s", err.text);
    for (int i = 0; i < 2; i++) {
        struct georef *above = make_on(geoid, crs[i]), *plain = make_on(NULL, crs[i]);
        struct georef *degrees = make_on(NULL, GEOREF_GEODETIC);
        double anchor[3];
        georef_anchor(above, anchor);
        expect_near(anchor[2], 460, TOL_M);
        assert_true(georef_has_geoid(above) && !georef_has_geoid(plain));
        for (int k = -4; k <= 4; k++) {
            const double d[3] = {1000, 5000.0 * k, 30};
            double got[3], want[3], place[3], back[3];
            forward_one(above, d, got);
            forward_one(plain, d, want);
            forward_one(degrees, d, place);
            expect_point(got, want[0], want[1], want[2] - place[0], TOL_M); /* a metre a degree */
            georef_reverse(above, got, back);
            expect_point(back, d[0], d[1], d[2], TOL_M);
        }
        /* The geoid is interpolated for each point, so there is no polynomial. */
        assert_int_equal(georef_set_method(above, GEOREF_ORDER2, &err), SH_EINPUT);
        assert_non_null(strstr(err.text, "geoid"));
        georef_free(above);
        georef_free(plain);
        georef_free(degrees);
    }
    georef_geoid_free(geoid);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_heights)};
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
