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
        cmocka_unit_test(cut_off_anywhere),
        cmocka_unit_test(broken_bytes),
        cmocka_unit_test(what_follows_is_broken),
        cmocka_unit_test(too_many_triangles),
    };
    return cmocka_run_group_tests_name("geotiff_broken", tests, make_folder, remove_folder);
}
