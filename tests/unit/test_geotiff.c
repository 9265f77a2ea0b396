/* SPDX-License-Identifier: MIT */
/* Terrain from GeoTIFF: places and heights against the written numbers, holes, refusals. */
#include <math.h>
#include <sys/stat.h>
#include <tiffio.h>

#include "core/geotiff.h"
#include "tests/common/tif.h"
#include "tests/unit/scene_files.h"

/* 5 x 4 cells; whole numbers, which all types hold. */
static const double heights[20] = {10, 11, 12, 13, 14, 20, 22, 24, 26, 28, 5, 6, 7, 8, 9, 100, 90, 80, 70, 60};

static const char *tif_path(const char *name)
{
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

static struct scene *read_tif(const struct tif *t)
{
    tif_write(tif_path("dtm.TIF"), t);
    struct scene *s = load(path);
    unlink(path);
    return s;
}

static void refuse_tif(const struct tif *t, const char *expected)
{
    struct scene *scene;
    struct sh_err err;
    tif_write(tif_path("dtm.tif"), t);
    const struct scene_mesh_spec spec = {.file = path, .scale = 1};
    const int rc = load_spec(&spec, 1e-3, &scene, &err);
    unlink(path);
    if (rc != SH_EINPUT || strstr(err.text, "dtm.tif: ") == NULL || strstr(err.text, expected) == NULL)
        fail_msg("%d '%s' doesn't say '%s'", rc, err.text, expected);
}

static void assert_vertex(const struct scene *s, uint32_t i, double x, double y, double z)
{
    const double *v = s->vertex_m[i];
    /* The test adds in another order: that may differ by some units of the last place of 5.3e6, 9e-10 each. */
    if (!(fabs(v[0] - x) <= 4e-9 && fabs(v[1] - y) <= 4e-9 && v[2] == z))
        fail_msg("vertex %u at %.10f %.10f %.10f instead of %.10f %.10f %.10f", i, v[0], v[1], v[2], x, y, z);
}

/* Checks all vertices of the 5 x 4 cells, from the middle of the first one. */
static void assert_grid(const struct scene *s, double x0, double y0, double dx, double dy, double unit, double z0)
{
    assert_int_equal(s->n_vertices, 20);
    assert_int_equal(s->n_triangles, 24);
    for (uint32_t i = 0; i < 20; i++)
        assert_vertex(s, i, x0 + dx * (i % 5), y0 + dy * (i / 5), z0 + unit * heights[i]);
}

static double up_of(const struct scene *s, uint32_t i)
{
    const double *a = s->vertex_m[s->triangle[i][0]], *b = s->vertex_m[s->triangle[i][1]],
                 *c = s->vertex_m[s->triangle[i][2]];
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
}

/* Returns twice the area from above, with its sign: each triangle faces up. */
static double assert_up(const struct scene *s)
{
    double sum = 0.0;
    for (uint32_t i = 0; i < s->n_triangles; i++) {
        assert_true(up_of(s, i) > 0.0);
        sum += up_of(s, i);
    }
    return sum;
}

static void each_cell_is_where_it_is(void **state)
{
    (void)state;
    struct tif t = tif_of(5, 4, heights);
    struct scene *s = read_tif(&t);
    assert_grid(s, 690001.0, 5335998.5, 2.0, -3.0, 1.0, 0.0);
    assert_true(assert_up(s) == 2.0 * 8.0 * 9.0);
    assert_string_equal(s->surface[0].object, "dtm");
    assert_true(s->error_m == 0.0 && s->says.unit_m == 1.0 && s->says.up == 3);
    if (n_warnings > 0) fail_msg("%s", warnings);
    scene_free(s);
    t.key[1][1] = 2; /* PixelIsPoint: the tie point is the middle itself */
    s = read_tif(&t);
    assert_grid(s, 690000.0, 5336000.0, 2.0, -3.0, 1.0, 0.0);
    scene_free(s);
    t.tie[0] = t.tie[1] = 2.0; /* a tie point at another cell */
    s = read_tif(&t);
    assert_grid(s, 689996.0, 5336006.0, 2.0, -3.0, 1.0, 0.0);
    scene_free(s);
}

/* These types and packings hold the numbers exactly. libtiff (4.5) writes no sound predictor 3 into the other byte
 * order. */
static void all_forms_give_the_same(void **state)
{
    (void)state;
    static const struct {
        uint16_t bits, format, compression, predictor;
        uint32_t tile;
        const char *mode;
    } form[] = {{8, 1, COMPRESSION_NONE, 0, 0, "w"},
                {8, 2, COMPRESSION_LZW, 0, 0, "w"},
                {16, 1, COMPRESSION_LZW, 2, 0, "w"},
                {16, 2, COMPRESSION_ADOBE_DEFLATE, 2, 16, "wb"},
                {32, 1, COMPRESSION_NONE, 0, 16, "wb"},
                {32, 2, COMPRESSION_ADOBE_DEFLATE, 2, 0, "w8"},
                {32, 3, COMPRESSION_ADOBE_DEFLATE, 3, 16, "w"},
                {32, 3, COMPRESSION_LZW, 3, 0, "w8"},
                {64, 3, COMPRESSION_ADOBE_DEFLATE, 3, 16, "w"},
                {64, 3, COMPRESSION_NONE, 0, 0, "wb"},
                {64, 1, COMPRESSION_NONE, 0, 0, "w"},
                {64, 2, COMPRESSION_NONE, 0, 16, "w8"},
                {32, 3, COMPRESSION_PACKBITS, 0, 0, "w"}};
    for (size_t i = 0; i < sizeof form / sizeof form[0]; i++) {
        struct tif t = tif_of(5, 4, heights);
        t.bits = form[i].bits;
        t.format = form[i].format;
        t.compression = form[i].compression;
        t.predictor = form[i].predictor;
        t.tile = form[i].tile;
        t.mode = form[i].mode;
        struct scene *s = read_tif(&t);
        assert_grid(s, 690001.0, 5335998.5, 2.0, -3.0, 1.0, 0.0);
        scene_free(s);
    }
}

static void negative_numbers_and_many_tiles(void **state)
{
    (void)state;
    double value[40 * 37];
    for (int i = 0; i < 40 * 37; i++)
        value[i] = (i * 7919) % 2003 - 1000;
    struct tif t = tif_of(40, 37, value);
    t.bits = 16;
    t.format = 2;
    t.tile = 16;
    t.compression = COMPRESSION_LZW;
    t.predictor = 2;
    struct scene *s = read_tif(&t);
    assert_int_equal(s->n_vertices, 40 * 37);
    for (uint32_t i = 0; i < 40 * 37; i++)
        assert_vertex(s, i, 690001.0 + 2.0 * (i % 40), 5335998.5 - 3.0 * (i / 40), value[i]);
    scene_free(s);
}

/* The raster is turned by the angle of 3, 4, 5 and, in the second case, mirrored. Faces still look up. */
static void a_transformation(void **state)
{
    (void)state;
    for (int mirrored = 0; mirrored < 2; mirrored++) {
        struct tif t = tif_of(5, 4, heights);
        const double m[16] = {1.6, 1.2, 0, 690000.0, 1.2, -1.6, 0, 5336000.0, 0, 0, 0, 0, 0, 0, 0, 1};
        memcpy(t.matrix, m, sizeof m);
        if (mirrored) t.matrix[1] = -1.2, t.matrix[5] = 1.6;
        t.scale[0] = 0.0;
        struct scene *s = read_tif(&t);
        for (uint32_t i = 0; i < 20; i++) {
            const double c = i % 5 + 0.5, r = i / 5 + 0.5;
            assert_vertex(s, i, 690000.0 + m[0] * c + t.matrix[1] * r, 5336000.0 + m[4] * c + t.matrix[5] * r,
                          heights[i]);
        }
        assert_true(fabs(assert_up(s) - 2.0 * 12.0 * 4.0) < 1e-6); /* products of 1e1 * rounding of 1e-9 */
        scene_free(s);
    }
}

/* Cell 1, 1 of 5 x 4 is a hole. Each of the four quads around it keeps the triangle of its other corners. */
static void holes(void **state)
{
    (void)state;
    double value[20];
    for (int kind = 0; kind < 3; kind++) {
        memcpy(value, heights, sizeof value);
        value[6] = kind == 0 ? -9999.0 : kind == 1 ? (double)NAN : -3.4028234663852886e38;
        struct tif t = tif_of(5, 4, value);
        t.no_data = kind == 0 ? "-9999" : kind == 1 ? "nan" : "-3.4028235e+38"; /* as a float it is the same */
        struct scene *s = read_tif(&t);
        assert_int_equal(s->n_vertices, 19);
        assert_int_equal(s->n_triangles, 24 - 4);
        assert_true(s->min_m[2] == 5.0);
        assert_true(assert_up(s) == 2.0 * (72.0 - 4.0 * 3.0));
        for (uint32_t i = 0; i < s->n_vertices; i++)
            assert_false(fabs(s->vertex_m[i][0] - 690003.0) < 0.5 && fabs(s->vertex_m[i][1] - 5335995.5) < 0.5);
        assert_non_null(strstr(warnings, "1 of 20 cells have no height, and are holes"));
        assert_int_equal(n_warnings, 1);
        scene_free(s);
    }
    /* The no-data value is a whole number; the cells that are left touch nothing. */
    for (int i = 0; i < 20; i++)
        value[i] = i == 0 || i / 5 >= 2 ? heights[i] : 255;
    struct tif t = tif_of(5, 4, value);
    t.bits = 8;
    t.format = 1;
    t.no_data = "255 ";
    struct scene *s = read_tif(&t);
    assert_int_equal(s->n_triangles, 8);
    assert_non_null(strstr(warnings, "9 of 20 cells have no height, and are holes"));
    assert_non_null(strstr(warnings, "1 heights beside holes touch no triangle"));
    scene_free(s);
    t.no_data = "none";
    scene_free(read_tif(&t));
    assert_non_null(strstr(warnings, "its no-data value is 'none', which is not one number: no height counts as"));
    t.no_data = "255";
    for (int i = 0; i < 20; i++)
        value[i] = 255;
    refuse_tif(&t, "none of 5 x 4 cells has a height");
}

/* Feet are given by the system, by keys, or by GDAL's metadata; scale and offset by GDAL's metadata alone. */
static void units(void **state)
{
    (void)state;
    const double us_foot = 1200.0 / 3937.0;
    static const struct {
        uint16_t key[4][2]; /* after the first two */
        const char *metadata;
        double unit, height, offset;
        const char *warning;
    } at[] = {
        {{{3072, 2263}}, NULL, 1, 1, 0, "in feet, but its heights have no unit"},
        {{{3072, 2263}, {4096, 6360}}, NULL, 1, 1, 0, NULL}, /* NAVD88 height (ftUS) */
        {{{3072, 32632}, {4099, 9002}}, NULL, 0, 0.3048, 0, NULL},
        {{{3072, 32632}, {4096, 5703}}, NULL, 0, 1, 0, NULL},
        {{{3072, 32632}, {4096, 5030}, {4099, 9001}}, NULL, 0, 1, 0, NULL},
        {{{3072, 32767}, {3076, 9002}, {4099, 9001}}, NULL, 0.3048, 1, 0, NULL},
        {{{3072, 32632}},
         "<GDALMetadata>\n<Item name=\"OFFSET\" sample=\"0\" role=\"offset\">100</Item>\n"
         "<Item name=\"SCALE\" sample=\"0\" role=\"scale\">0.5 </Item>\n"
         "<Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">ft</Item></GDALMetadata>",
         0,
         0.5 * 0.3048,
         30.48,
         NULL},
        {{{3072, 32767}}, NULL, 0, 1, 0, "it names neither its system nor its unit: metres are assumed"},
    };
    for (size_t i = 0; i < sizeof at / sizeof at[0]; i++) {
        struct tif t = tif_of(5, 4, heights);
        memcpy(t.key + 2, at[i].key, sizeof at[i].key);
        t.metadata = at[i].metadata;
        const double unit = at[i].unit == 1.0 ? us_foot : at[i].unit == 0.0 ? 1.0 : at[i].unit;
        const int ft_us = i == 1;
        struct scene *s = read_tif(&t);
        for (uint32_t k = 0; k < 20; k++) {
            const double *v = s->vertex_m[k], z = at[i].offset + (ft_us ? us_foot : at[i].height) * heights[k];
            assert_true(fabs(v[0] - unit * (690001.0 + 2.0 * (k % 5))) <= 4e-9);
            assert_true(fabs(v[1] - unit * (5335998.5 - 3.0 * (k / 5))) <= 4e-9);
            assert_true(fabs(v[2] - z) <= 1e-13);
        }
        if ((at[i].warning == NULL) != (n_warnings == 0) ||
            (at[i].warning != NULL && strstr(warnings, at[i].warning) == NULL))
            fail_msg("case %zu: %s", i, warnings);
        scene_free(s);
    }
}

/* The value is no height on the Earth, and the file doesn't mark it. */
static void odd_heights_are_doubted(void **state)
{
    (void)state;
    double value[20];
    memcpy(value, heights, sizeof value);
    value[7] = -9999;
    const struct tif t = tif_of(5, 4, value);
    struct scene *s = read_tif(&t);
    assert_non_null(strstr(warnings, "from -9999 to 100 m; if -9999 marks cells without height"));
    scene_free(s);
    static const struct {
        double value;
        int is_odd;
    } at[] = {{-11500, 0}, {-11501, 1}, {9000, 0}, {9001, 1}};
    for (size_t i = 0; i < sizeof at / sizeof at[0]; i++) {
        char want[64];
        value[7] = at[i].value;
        s = read_tif(&t);
        snprintf(want, sizeof want, " m; if %g marks cells without height", at[i].value);
        assert_int_equal(strstr(warnings, want) != NULL, at[i].is_odd);
        scene_free(s);
    }
    struct tif scaled = t; /* the file's own number is named: 100 m - 0.5 m 32768 */
    scaled.metadata = "<GDALMetadata><Item name=\"OFFSET\" sample=\"0\" role=\"offset\">100</Item>"
                      "<Item name=\"SCALE\" sample=\"0\" role=\"scale\">0.5</Item></GDALMetadata>";
    value[7] = -32768;
    s = read_tif(&scaled);
    assert_non_null(strstr(warnings, "its heights go from -16284 to "));
    assert_non_null(strstr(warnings, " m; if -32768 marks cells without height, add that to the file with "));
    scene_free(s);
    for (int i = 0; i < 20; i++)
        value[i] = 100.0; /* a plain */
    s = read_tif(&t);
    if (n_warnings > 0) fail_msg("%s", warnings);
    scene_free(s);
}

/* As in GDAL, the map's scale of heights is not used where the heights have no system. A system that the file defines
 * itself gives a warning. */
static void what_is_left_out_is_said(void **state)
{
    (void)state;
    struct tif t = tif_of(5, 4, heights);
    t.scale[2] = 0.5;
    struct scene *s = read_tif(&t);
    assert_grid(s, 690001.0, 5335998.5, 2.0, -3.0, 1.0, 0.0);
    assert_non_null(strstr(warnings, "scales the heights; this is not used"));
    scene_free(s);
    t.key[3][0] = 4096;
    t.key[3][1] = 5773; /* with a system of the heights it is used, here and in GDAL */
    t.tie[5] = 7.0;
    s = read_tif(&t);
    assert_grid(s, 690001.0, 5335998.5, 2.0, -3.0, 0.5, 7.0);
    assert_int_equal(n_warnings, 0);
    scene_free(s);
    t.key[3][0] = 0;
    t.scale[2] = 1.0;
    t.tie[5] = 0.0;
    t.key[0][1] = 32767;
    t.key[2][0] = 2048;
    t.key[2][1] = 32767;
    s = read_tif(&t);
    assert_non_null(strstr(warnings, "it names neither its system nor its unit"));
    assert_int_equal(n_warnings, 1);
    scene_free(s);
    const double matrix[16] = {2, 0, 0, 690000, 0, -3, 0, 5336000, 0, 0, 0.5, 7, 0, 0, 0, 1};
    t = tif_of(5, 4, heights);
    memcpy(t.matrix, matrix, sizeof matrix);
    s = read_tif(&t);
    assert_grid(s, 690001.0, 5335998.5, 2.0, -3.0, 1.0, 0.0);
    if (n_warnings != 1 || strstr(warnings, "its ModelTransformation changes the heights; this is not used") == NULL)
        fail_msg("%s", warnings);
    scene_free(s);
    t.matrix[10] = 0.0; /* an offset alone */
    s = read_tif(&t);
    assert_int_equal(n_warnings, 1);
    scene_free(s);
    t.matrix[11] = 0.0; /* a map of the plane alone */
    s = read_tif(&t);
    assert_int_equal(n_warnings, 0);
    scene_free(s);
}

#define WITH(expected, ...)                   \
    do {                                      \
        struct tif t = tif_of(5, 4, heights); \
        __VA_ARGS__;                          \
        refuse_tif(&t, expected);             \
    } while (0)

static void what_is_refused(void **state)
{
    (void)state;
    WITH("not a GeoTIFF: it doesn't say where its cells are", t.scale[0] = 0.0);
    WITH("no area", t.scale[1] = 0.0);
    WITH("1 x 1 cells; allowed are at least 2 x 2", t.width = t.height = 1);
    WITH("1 x 4 cells", t.width = 1);
    WITH("its cells are degrees (EPSG:4258); allowed are systems in metres or feet: gdalwarp -t_srs EPSG:32632",
         t.key[0][1] = 2;
         t.key[2][0] = 2048; t.key[2][1] = 4258; t.tie[3] = 11.5; t.tie[4] = 48.1; t.scale[0] = t.scale[1] = 1e-4);
    WITH("gdalwarp -t_srs EPSG:32756", t.key[0][1] = 2; t.tie[3] = 151.2; t.tie[4] = -33.8;
         t.scale[0] = t.scale[1] = 1e-4);
    WITH("gdalwarp -t_srs EPSG:32661", t.key[0][1] = 2; t.tie[3] = 15.0; t.tie[4] = 85.0;
         t.scale[0] = t.scale[1] = 1e-4);
    WITH("gdalwarp -t_srs EPSG:32761", t.key[0][1] = 2; t.tie[3] = 15.0; t.tie[4] = -80.1;
         t.scale[0] = t.scale[1] = 1e-4);
    WITH("its cells are degrees (of its own)", t.key[0][1] = 2; t.key[2][0] = 2048; t.key[2][1] = 32767);
    WITH("geocentric", t.key[0][1] = 3);
    WITH("EPSG:9999: no such coordinate reference system", t.key[2][1] = 9999);
    WITH("EPSG:4326: not a projected", t.key[2][1] = 4326);
    WITH("the unit of its cells is EPSG:9035", t.key[3][0] = 3076; t.key[3][1] = 9035);
    WITH("the unit of its heights is EPSG:9035", t.key[3][0] = 4099; t.key[3][1] = 9035);
    WITH("EPSG:5715: not a vertical system with heights upward", t.key[3][0] = 4096; t.key[3][1] = 5715);
    WITH("the unit of its heights is 'parsec'; allowed are m, ft, US survey foot",
         t.metadata = "<Item name=\"UNITTYPE\" sample=\"0\" role=\"unittype\">parsec</Item>");
    WITH("the scale of its heights is 'nan'; allowed are numbers, and no scale of 0",
         t.metadata = "<Item name=\"SCALE\" sample=\"0\" role=\"scale\">nan</Item>");
    WITH("the scale of its heights is '0'", t.metadata = "<Item name=\"SCALE\" sample=\"0\" role=\"scale\">0</Item>");
    WITH("the offset of its heights is '1e999'",
         t.metadata = "<Item name=\"OFFSET\" sample=\"0\" role=\"offset\">1e999</Item>");
    WITH("the offset of its heights is 'abc'",
         t.metadata = "<Item name=\"OFFSET\" sample=\"0\" role=\"offset\">abc</Item>");
    WITH("2 bands; allowed is one, of heights: gdal_translate -b 1", t.bands = 2);
    WITH("a picture (3 bands, PhotometricInterpretation 2), not heights", t.bands = 3; t.bits = 8; t.format = 1;
         t.photometric = PHOTOMETRIC_RGB);
    WITH("cells of 16 bits, SampleFormat 6", t.bits = 16; t.format = SAMPLEFORMAT_COMPLEXIEEEFP);
    WITH("a mask marks the cells without height", t.with_mask = 1);
    WITH("its first image is a mask or a smaller copy", t.kind = FILETYPE_REDUCEDIMAGE);
    static char many[1 << 16];
    memset(many, ' ', sizeof many - 1);
    WITH("its tag 42112 has 65536 bytes; allowed are up to 65535", t.metadata = many);
}

/* Another up would turn the terrain over, and another scale would shrink it. A mask file beside it would mark holes. */
static void refuse_spec(const struct scene_mesh_spec *spec, const char *expected)
{
    struct scene *scene;
    struct sh_err err;
    assert_int_equal(load_spec(spec, 1e-3, &scene, &err), SH_EINPUT);
    if (strstr(err.text, expected) == NULL) fail_msg("'%s' doesn't say '%s'", err.text, expected);
}

static void what_is_beside_it(void **state)
{
    (void)state;
    const struct tif t = tif_of(5, 4, heights);
    char mask[192];
    tif_write(tif_path("dtm.tif"), &t);
    refuse_spec(&(struct scene_mesh_spec){.file = path, .scale = 0.5}, "dtm.tif: a GeoTIFF has z up, and metres");
    refuse_spec(&(struct scene_mesh_spec){.file = path, .scale = 1, .up = SCENE_UP_Y}, "allowed up: z, scale: 1");
    snprintf(mask, sizeof mask, "%s.msk", path);
    tif_write(mask, &t);
    refuse_spec(&(struct scene_mesh_spec){.file = path, .scale = 1}, "a mask marks the cells without height");
    unlink(mask);
    unlink(path);
}

/* Zones are 6 degrees wide, the first from 180 degrees west on. Some files count longitude from 0 to 360. */
static void advice_names_the_zone(void **state)
{
    (void)state;
    assert_int_equal(geotiff_utm_code(48.0, 11.5), 32632);
    assert_int_equal(geotiff_utm_code(-33.0, 151.2), 32756);
    assert_int_equal(geotiff_utm_code(10.0, -180.0), 32601);
    assert_int_equal(geotiff_utm_code(10.0, 179.99), 32660);
    assert_int_equal(geotiff_utm_code(10.0, 180.0), 32601);
    assert_int_equal(geotiff_utm_code(21.3, 202.2), 32604); /* Honolulu, 157.8 west */
    assert_int_equal(geotiff_utm_code(10.0, 359.0), 32630);
    assert_int_equal(geotiff_utm_code(85.0, 0.0), 32661);
    assert_int_equal(geotiff_utm_code(-85.0, 0.0), 32761);
    assert_int_equal(geotiff_utm_code(0.0, (double)NAN), 32601); /* some zone */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(each_cell_is_where_it_is),
        cmocka_unit_test(all_forms_give_the_same),
        cmocka_unit_test(negative_numbers_and_many_tiles),
        cmocka_unit_test(a_transformation),
        cmocka_unit_test(holes),
        cmocka_unit_test(units),
        cmocka_unit_test(odd_heights_are_doubted),
        cmocka_unit_test(what_is_left_out_is_said),
        cmocka_unit_test(what_is_refused),
        cmocka_unit_test(what_is_beside_it),
        cmocka_unit_test(advice_names_the_zone),
    };
    return cmocka_run_group_tests_name("geotiff", tests, make_folder, remove_folder);
}
