/* SPDX-License-Identifier: MIT */
/* Broken GeoTIFFs, and ones that are too large: a line of text names the file, and no reader crashes. */
#include <tiffio.h>

#include "tests/common/thorough.h"
#include "tests/common/tif.h"
#include "tests/unit/scene_files.h"

static const double heights[20] = {10, 11, 12, 13, 14, 20, 22, 24, 26, 28, 5, 6, 7, 8, 9, 100, 90, 80, 70, 60};

static const char *tif_path(const char *name)
{
    snprintf(path, sizeof path, "%s/%s", folder, name);
    return path;
}

/* Packs a file of 5 x 4 cells, and returns its length. */
static size_t pack(uint8_t data[8192])
{
    struct tif t = tif_of(5, 4, heights);
    t.compression = COMPRESSION_LZW;
    t.predictor = 3;
    tif_write(tif_path("whole.tif"), &t);
    FILE *f = fopen(path, "rb");
    assert_non_null(f);
    const size_t n = fread(data, 1, 8192, f);
    fclose(f);
    unlink(path);
    assert_true(n > 100 && n < 8192);
    return n;
}

/* The file is cut anywhere. The directory is at the end, so each cut is an error with the file's name. */
static void cut_off_anywhere(void **state)
{
    (void)state;
    static uint8_t data[8192];
    const size_t n = pack(data);
    for (size_t cut = 0; cut < n; cut += cut < 16 ? 1 : (size_t)thorough(1, 11))
        refuse("cut.tif", data, cut, cut < 8 ? "not a TIFF" : "");
    refuse("text.tif", "solid hall, or any other text", 29, "not a TIFF: its first bytes");
}

/* One byte in a hundred is changed, with a fixed seed. The result is terrain, or one line that names the file, and no
 * reader crashes. */
static void broken_bytes(void **state)
{
    (void)state;
    static uint8_t whole[8192], data[8192];
    const size_t n = pack(whole);
    uint64_t seed = 34;
    for (int i = 0; i < thorough(600, 40); i++) {
        struct scene *s;
        struct sh_err err;
        memcpy(data, whole, n);
        for (size_t k = 0; k < n; k++) {
            seed = seed * 6364136223846793005u + 1442695040888963407u;
            if (seed >> 33 < (1u << 31) / 100) data[k] = (uint8_t)(seed >> 25);
        }
        const struct scene_mesh_spec spec = {.file = write_file("broken.tif", data, n), .scale = 1};
        const int rc = load_spec(&spec, 1e-3, &s, &err);
        unlink(path);
        if (rc != SH_OK && (strstr(err.text, "broken.tif: ") == NULL || strstr(err.text, "crashed") != NULL))
            fail_msg("case %d: %s", i, err.text);
        scene_free(s);
    }
}

/* The first image is whole, and the next one lies beyond the file. */
static void what_follows_is_broken(void **state)
{
    (void)state;
    static uint8_t data[8192];
    const size_t n = pack(data);
    uint32_t at;
    uint16_t tags;
    struct scene *s;
    struct sh_err err;
    memcpy(&at, data + 4, sizeof at); /* of the directory */
    memcpy(&tags, data + at, sizeof tags);
    memset(data + at + 2 + 12 * tags, 0x7f, 4);
    const struct scene_mesh_spec spec = {.file = write_file("next.tif", data, n), .scale = 1};
    assert_int_equal(load_spec(&spec, 1e-3, &s, &err), SH_OK);
    if (n_warnings != 1 ||
        strstr(warnings, "next.tif: only its first image is read; the data after it are broken: ") == NULL)
        fail_msg("%s", warnings);
    scene_free(s);
    unlink(path);
}

/* Adds an image of 5 x 4 cells to a file. */
static void append(const char *file, uint32_t kind)
{
    float row[5] = {0};
    TIFF *tif = TIFFOpen(file, "a");
    assert_non_null(tif);
    TIFFSetField(tif, TIFFTAG_SUBFILETYPE, kind);
    TIFFSetField(tif, TIFFTAG_IMAGEWIDTH, 5);
    TIFFSetField(tif, TIFFTAG_IMAGELENGTH, 4);
    TIFFSetField(tif, TIFFTAG_BITSPERSAMPLE, 32);
    TIFFSetField(tif, TIFFTAG_SAMPLEFORMAT, SAMPLEFORMAT_IEEEFP);
    TIFFSetField(tif, TIFFTAG_PHOTOMETRIC, PHOTOMETRIC_MINISBLACK);
    for (uint32_t y = 0; y < 4; y++)
        assert_int_equal(TIFFWriteScanline(tif, row, y, 0), 1);
    TIFFClose(tif);
}

/* Other images are counted, but smaller copies of the first are not. */
static void other_images_are_counted(void **state)
{
    (void)state;
    static const struct {
        uint32_t kind[3];
        int n;
        const char *warning; /* NULL: none */
    } row[] = {{{FILETYPE_REDUCEDIMAGE, FILETYPE_REDUCEDIMAGE}, 2, NULL},
               {{0}, 1, "only its first image is read; there is 1 more"},
               {{0, FILETYPE_REDUCEDIMAGE, FILETYPE_PAGE}, 3, "only its first image is read; there are 2 more"}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        const struct tif t = tif_of(5, 4, heights);
        struct scene *s;
        struct sh_err err;
        tif_write(tif_path("more.tif"), &t);
        for (int k = 0; k < row[i].n; k++)
            append(path, row[i].kind[k]);
        const struct scene_mesh_spec spec = {.file = path, .scale = 1};
        if (load_spec(&spec, 1e-3, &s, &err) != SH_OK) fail_msg("%s", err.text);
        assert_int_equal(n_warnings, row[i].warning != NULL);
        if (row[i].warning != NULL && strstr(warnings, row[i].warning) == NULL) fail_msg("%s", warnings);
        assert_true(s->max_m[2] == 100.0);
        scene_free(s);
        unlink(path);
    }
}

/* The packed cells of the last strip or tile are no LZW. The message says which one it is, and gives libtiff's
 * reason. */
static void the_broken_block_is_named(void **state)
{
    (void)state;
    for (uint32_t tile = 0; tile <= 16; tile += 16) {
        static uint8_t data[8192];
        static double wide[20 * 4];
        struct tif t = tif_of(20, 4, wide);
        t.compression = COMPRESSION_LZW;
        t.tile = tile;
        tif_write(tif_path("whole.tif"), &t);
        FILE *f = fopen(path, "rb");
        assert_non_null(f);
        const size_t n = fread(data, 1, sizeof data, f);
        fclose(f);
        TIFF *tif = TIFFOpen(path, "r");
        assert_non_null(tif);
        memset(data + TIFFGetStrileOffset(tif, 1), 0xff, 12);
        TIFFClose(tif);
        unlink(path);
        struct scene *scene;
        struct sh_err err;
        const struct scene_mesh_spec spec = {.file = write_file("block.tif", data, n), .scale = 1};
        assert_int_equal(load_spec(&spec, 1e-3, &scene, &err), SH_EINPUT);
        unlink(path);
        const char *what = tile ? "block.tif: the tile of cells at column 16, row 0 can't be read: "
                                : "block.tif: the strip of cells at column 0, row 3 can't be read: ";
        const char *says = strstr(err.text, what);
        if (says == NULL) fail_msg("'%s' doesn't say '%s'", err.text, what);
        const char *reason = says + strlen(what); /* libtiff's words differ from version to version */
        if (reason[0] == '\0' || strstr(reason, "no reason") != NULL) fail_msg("no reason in '%s'", err.text);
    }
}

/* Heights from -11500 to 9000 m may be of the Earth. But -9999 is what many files have where there is no height. */
static void heights_at_their_bounds(void **state)
{
    (void)state;
    static const struct {
        double odd;
        int is_odd;
    } row[] = {{9000, 0}, {9001, 1}, {-11500, 0}, {-11501, 1}, {-9999, 1}, {-9998, 0}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        double value[20];
        struct scene *s;
        struct sh_err err;
        memcpy(value, heights, sizeof value);
        value[7] = row[i].odd;
        const struct tif t = tif_of(5, 4, value);
        tif_write(tif_path("odd.tif"), &t);
        const struct scene_mesh_spec spec = {.file = path, .scale = 1};
        if (load_spec(&spec, 1e-3, &s, &err) != SH_OK) fail_msg("%s", err.text);
        if (n_warnings != row[i].is_odd) fail_msg("%g m: %s", row[i].odd, warnings);
        scene_free(s);
        unlink(path);
    }
}

/* A raster that is too large is refused by its figures, before its cells are read. */
static void too_many_triangles(void **state)
{
    (void)state;
    struct tif t = tif_of(5, 4, heights);
    struct scene_import_limits limits = scene_import_defaults;
    struct scene *s;
    struct sh_err err;
    double *value = calloc(1000 * 900, sizeof *value);
    t.width = 1000;
    t.height = 900;
    t.value = value;
    limits.memory_mib = 64; /* 1000 * 900 * 2 * (24 + 2 * 14) bytes are 89.3 MiB */
    tif_write(tif_path("large.tif"), &t);
    const struct scene_mesh_spec spec = {.file = path, .scale = 1, .limits = &limits};
    assert_int_equal(load_spec(&spec, 1e-3, &s, &err), SH_EINPUT);
    unlink(path);
    free(value);
    if (strstr(err.text,
               "1000 x 900 cells are up to 1.8 million triangles, and reading them takes up to 89 MiB; allowed "
               "are 64 (scene.import_memory_mib)") == NULL)
        fail_msg("%s", err.text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cut_off_anywhere),          cmocka_unit_test(broken_bytes),
        cmocka_unit_test(what_follows_is_broken),    cmocka_unit_test(other_images_are_counted),
        cmocka_unit_test(the_broken_block_is_named), cmocka_unit_test(heights_at_their_bounds),
        cmocka_unit_test(too_many_triangles),
    };
    return cmocka_run_group_tests_name("geotiff_broken", tests, make_folder, remove_folder);
}
