/* SPDX-License-Identifier: MIT */
/* The anchor that GeoTIFF meshes give, compared with GeographicLib where the system is UTM, and with PROJ elsewhere. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/crs.h"
#include "firmware_sim/config/load.h"
#include "tests/common/tif.h"

static struct site *site;
static double flat[21 * 21];

/* A raster of 21 x 21 cells of `cell` units in the rig's folder. */
static void write_tif_of(const char *name, uint16_t epsg, uint16_t vertical, double cell, double easting,
                         double northing)
{
    char file[192];
    struct tif t = tif_of(21, 21, flat);
    for (int i = 0; i < 21 * 21; i++)
        flat[i] = 100.0;
    t.key[2][1] = epsg;
    t.key[3][0] = vertical != 0 ? 4096 : 0;
    t.key[3][1] = vertical;
    t.scale[0] = t.scale[1] = cell;
    t.tie[3] = easting;
    t.tie[4] = northing;
    snprintf(file, sizeof file, "%s", config_path);
    snprintf(strrchr(file, '/') + 1, 64, "%s", name);
    write_in(name, ""); /* the rig removes it */
    tif_write(file, &t);
}

static void write_tif(const char *name, uint16_t epsg, double cell, double easting, double northing)
{
    write_tif_of(name, epsg, 0, cell, easting, northing);
}

static int load(const char *meshes, const char *anchor, const char *position)
{
    char text[1024];
    snprintf(text, sizeof text,
             "head: {profile: riegl-vz400i}\nscene:\n  meshes: [%s]\n  anchor: {source: geotiff%s}\n"
             "stations: [%s]\noutput: {crs: geodetic, layout: geo}\n",
             meshes, anchor, position);
    write_in("test.yaml", text);
    site_free(site);
    site = NULL;
    clear_warned();
    memset(&err, 0, sizeof err);
    int rc = config_load(config_path, NULL, 0, cfg, &err);
    return rc == SH_OK ? site_load(cfg, &report, &site, &err) : rc;
}

#define MESH(name, more) "{file: " name ", up: z, scale: 1" more "}"

static void ok(int code)
{
    if (code != SH_OK) fail_msg("%s", err.text);
}

static double apart_m(const struct georef_place *a, const struct georef_place *b)
{
    double p[3], q[3];
    georef_geodetic_to_ecef(a, p);
    georef_geodetic_to_ecef(b, q);
    return hypot(hypot(p[0] - q[0], p[1] - q[1]), p[2] - q[2]);
}

static void a_raster_in_utm_makes_the_scene_that_grid(void **state)
{
    (void)state;
    static const double at_m[3] = {690020.0, 5335970.0, 102.0};
    static const uint16_t epsg[] = {32632, 25832}; /* WGS 84; ETRS89, which PROJ takes as the same */
    struct georef_place want;
    for (int i = 0; i < 2; i++) {
        write_tif("dtm.tif", epsg[i], 10.0, 690000.0, 5336000.0);
        ok(load(MESH("dtm.tif", ""), "", "{position_m: [690020, 5335970, 102]}"));
        assert_int_equal(site->anchor.frame.kind, GEOFRAME_GRID);
        assert_true(site->anchor.frame.zone == 32 && site->anchor.frame.north == 1);
        ok(georef_locate_utm(32, 1, at_m, &want, &err));
        assert_true(apart_m(&want, &site->station[0].at.place) < 1e-6); /* the same calls */
        assert_non_null(strstr(warned, "are taken as heights above the ellipsoid; scene.anchor.height_m"));
        assert_true((strstr(warned, "coordinates in EPSG:25832 have errors up to 1 m") != NULL) == (i == 1));
        assert_null(strstr(warned, "tangent"));
    }
    write_tif("dtm.tif", 32733, 10.0, 260000.0, 6250000.0);
    ok(load(MESH("dtm.tif", ""), ", height_m: 0", "{position_m: [260020, 6249970, 102]}"));
    assert_true(site->anchor.frame.zone == 33 && site->anchor.frame.north == 0);
    assert_null(strstr(warned, "ellipsoid"));
}

/* 5030 is WGS 84 among GeoTIFF's codes of ellipsoids, and 5703 counts from the sea. One raster whose heights do not
 * count from an ellipsoid is enough for a warning. */
static void heights_above_an_ellipsoid_are_not_doubted(void **state)
{
    (void)state;
    static const uint16_t code[] = {5030, 5703};
    write_tif_of("a.tif", 32632, 5030, 1.0, 690000.0, 5336000.0);
    for (int i = 0; i < 2; i++) {
        write_tif_of("b.tif", 32632, code[i], 1.0, 690021.0, 5336000.0);
        ok(load(MESH("a.tif", "") ", " MESH("b.tif", ""), "", "{position_m: [690020, 5335990, 102]}"));
        assert_int_equal(strstr(warned, "mostly count from sea level") != NULL, i);
    }
}

/* With height_m the frame is the grid itself if the mesh has an offset of the same height. Else it is tangent. */
static void height_m_is_that_of_the_raster_s_zero(void **state)
{
    (void)state;
    static const double at_m[3] = {690020.0, 5335970.0, 102.0 + 47.5};
    struct georef_place want;
    write_tif("dtm.tif", 32632, 1.0, 690000.0, 5336000.0);
    ok(georef_locate_utm(32, 1, at_m, &want, &err));
    ok(load(MESH("dtm.tif", ", offset_m: [0, 0, 47.5]"), ", height_m: 47.5", "{position_m: [690020, 5335970, 149.5]}"));
    assert_int_equal(site->anchor.frame.kind, GEOFRAME_GRID);
    assert_true(apart_m(&want, &site->station[0].at.place) < 1e-6);
    ok(load(MESH("dtm.tif", ""), ", height_m: 47.5", "{position_m: [690020, 5335970, 102]}"));
    assert_int_equal(site->anchor.frame.kind, GEOFRAME_TANGENT);
    /* 22 m from the middle: 22 m * 4e-4 of scale, at most, and 22^2 / (2 * 6.4e6) m */
    assert_true(apart_m(&want, &site->station[0].at.place) < 22.4 * 4.1e-4 + 1e-4);
}

/* The middle is placed by PROJ, and grid north is turned by the convergence. Corners are as wrong as the warning
 * says. */
static void another_grid_makes_it_tangent(void **state)
{
    (void)state;
    struct crs_place middle, corner;
    char words[96];
    write_tif("dtm.tif", 2056, 100.0, 2600000.0, 1202100.0); /* middle: 2601050, 1201050 */
    ok(load(MESH("dtm.tif", ", offset_m: [-2600000, -1200000, 0]"), ", height_m: 50", "{position_m: [1050, 1050, 0]}"));
    ok(crs_locate("EPSG:2056", 2601050.0, 1201050.0, 50.0, &middle, &err));
    assert_int_equal(site->anchor.frame.kind, GEOFRAME_TANGENT);
    assert_true(apart_m(&middle.at, &site->station[0].at.place) < 1e-6);
    assert_true(fabs(site->anchor.frame.north_deg + middle.convergence_rad * 180.0 / M_PI) < 1e-9);
    /* A corner is 1414.2 m away: 0.157 m below the tangent's ground, and 0.01 m within. */
    const double p[3] = {50.0, 50.0, 0.0};
    struct georef_place got;
    ok(geoframe_locate(&site->anchor.frame, p, &got, &err));
    ok(crs_locate("EPSG:2056", 2600050.0, 1200050.0, 50.0, &corner, &err));
    const double off_m = apart_m(&got, &corner.at);
    assert_true(off_m > 0.15 && off_m < 0.17);
    snprintf(words, sizeof words,
             "corners are wrong by up to %.2g m in EPSG:2056; for exact places use a raster in UTM", off_m);
    if (strstr(warned, words) == NULL || strstr(warned, "gdalwarp -t_srs EPSG:32632") == NULL)
        fail_msg("'%s' in %s", words, warned);
}

static void tiles_are_one_raster(void **state)
{
    (void)state;
    write_tif("a.tif", 32632, 1.0, 690000.0, 5336000.0);
    write_tif("b.tif", 32632, 1.0, 690021.0, 5336000.0);
    ok(load(MESH("a.tif", "") ", " MESH("b.tif", ""), "", "{position_m: [690020, 5335990, 102]}"));
    assert_int_equal(site->anchor.frame.kind, GEOFRAME_GRID);
    write_tif("b.tif", 32633, 1.0, 690021.0, 5336000.0);
    assert_int_equal(load(MESH("a.tif", "") ", " MESH("b.tif", ""), "", "{position_m: [690020, 5335990, 102]}"),
                     SH_EINPUT);
    assert_non_null(strstr(err.text, "is EPSG:32632, and that of "));
}

static void what_is_refused(void **state)
{
    (void)state;
    write_tif("dtm.tif", 32767, 1.0, 690000.0, 5336000.0);
    write_tif("far.tif", 32632, 1.0, 69000000.0, 5336000.0);
    write_in("floor.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    const struct {
        const char *meshes, *part;
    } bad[] = {{MESH("dtm.tif", ""), "its system has no EPSG code"},
               {MESH("floor.obj", ""), "source geotiff, but no mesh is a .tif file"},
               {"{file: far.tif, up: z, scale: 2}", "allowed up: z, scale: 1"},
               {"{file: far.tif, up: y, scale: 1}", "allowed up: z, scale: 1"},
               {MESH("far.tif", ""), "EPSG:32632: easting 69000010.5, northing 5335989.5 m are outside"}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        const int code = load(bad[i].meshes, "", "{position_m: [0, 0, 0]}");
        if (code != SH_EINPUT || strstr(err.text, bad[i].part) == NULL)
            fail_msg("case %zu: %d '%s' doesn't say '%s'", i, code, err.text, bad[i].part);
    }
}

static int teardown(void **state)
{
    site_free(site);
    return site_rig_teardown(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_raster_in_utm_makes_the_scene_that_grid),
        cmocka_unit_test(heights_above_an_ellipsoid_are_not_doubted),
        cmocka_unit_test(height_m_is_that_of_the_raster_s_zero),
        cmocka_unit_test(another_grid_makes_it_tangent),
        cmocka_unit_test(tiles_are_one_raster),
        cmocka_unit_test(what_is_refused),
    };
    return cmocka_run_group_tests_name("geotiff_anchor", tests, site_rig_setup, teardown);
}
