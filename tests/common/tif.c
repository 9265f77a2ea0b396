/* SPDX-License-Identifier: MIT */
#include "tests/common/tif.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>
#include <tiffio.h>

static const TIFFFieldInfo fields[] = {
    {33550, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, (char *)(uintptr_t) "ModelPixelScale"},
    {33922, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, (char *)(uintptr_t) "ModelTiepoint"},
    {34264, -1, -1, TIFF_DOUBLE, FIELD_CUSTOM, 1, 1, (char *)(uintptr_t) "ModelTransformation"},
    {34735, -1, -1, TIFF_SHORT, FIELD_CUSTOM, 1, 1, (char *)(uintptr_t) "GeoKeyDirectory"},
    {42112, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, (char *)(uintptr_t) "GDALMetadata"},
    {42113, -1, -1, TIFF_ASCII, FIELD_CUSTOM, 1, 0, (char *)(uintptr_t) "GDALNoDataValue"},
};

static void add_fields(TIFF *tif)
{
    TIFFMergeFieldInfo(tif, fields, sizeof fields / sizeof fields[0]);
}

struct tif tif_of(uint32_t width, uint32_t height, const double *value)
{
    return (struct tif){.width = width,
                        .height = height,
                        .value = value,
                        .bits = 32,
                        .format = SAMPLEFORMAT_IEEEFP,
                        .compression = COMPRESSION_NONE,
                        .photometric = PHOTOMETRIC_MINISBLACK,
                        .bands = 1,
                        .scale = {2.0, 3.0, 0.0},
                        .tie = {0, 0, 0, 690000.0, 5336000.0, 0},
                        .key = {{1024, 1}, {1025, 1}, {3072, 32632}},
                        .mode = "w"};
}

static void put(const struct tif *t, double v, uint8_t *p)
{
    const float f = (float)v;
    const int64_t i = t->format == SAMPLEFORMAT_IEEEFP ? 0 : (int64_t)v; /* the low bytes of both kinds are the same */
    if (t->format != SAMPLEFORMAT_IEEEFP)
        memcpy(p, &i, t->bits / 8u);
    else if (t->bits == 32)
        memcpy(p, &f, sizeof f);
    else
        memcpy(p, &v, sizeof v);
}

static double value_at(const struct tif *t, uint32_t x, uint32_t y)
{
    return x < t->width && y < t->height ? t->value[y * t->width + x] : 0.0;
}

static void write_blocks(TIFF *tif, const struct tif *t)
{
    const uint32_t w = t->tile > 0 ? t->tile : t->width, h = t->tile > 0 ? t->tile : 1;
    const size_t cell = (size_t)t->bands * t->bits / 8u;
    uint8_t *block = calloc((size_t)w * h, cell);
    assert_non_null(block);
    for (uint32_t y = 0; y < t->height; y += h)
        for (uint32_t x = 0; x < t->width; x += w) {
            for (uint32_t i = 0; i < w * h; i++)
                for (uint16_t b = 0; b < t->bands; b++)
                    put(t, value_at(t, x + i % w, y + i / w), block + i * cell + b * (size_t)t->bits / 8u);
            if (t->tile > 0)
                assert_true(TIFFWriteTile(tif, block, x, y, 0, 0) > 0);
            else
                assert_int_equal(TIFFWriteScanline(tif, block, y, 0), 1);
        }
    free(block);
}

static void set_place(TIFF *tif, const struct tif *t)
{
    uint16_t keys[36] = {1, 1, 0, 0};
    uint16_t n = 0;
    for (; n < 8 && t->key[n][0] != 0; n++) {
        const uint16_t key[4] = {t->key[n][0], 0, 1, t->key[n][1]};
        memcpy(keys + 4 * (n + 1), key, sizeof key);
    }
    keys[3] = n;
    if (n > 0) TIFFSetField(tif, 34735, 4 * (n + 1), keys);
    if (t->matrix[0] != 0.0 || t->matrix[1] != 0.0)
        TIFFSetField(tif, 34264, 16, t->matrix);
    else if (t->scale[0] != 0.0)
        TIFFSetField(tif, 33550, 3, t->scale);
    if (t->scale[0] != 0.0) TIFFSetField(tif, 33922, 6, t->tie);
    if (t->no_data != NULL) TIFFSetField(tif, 42113, t->no_data);
    if (t->metadata != NULL) TIFFSetField(tif, 42112, t->metadata);
}

static void set_raster(TIFF *tif, const struct tif *t)
{
    if (t->kind != 0) TIFFSetField(tif, TIFFTAG_SUBFILETYPE, t->kind);
    TIFFSetField(tif, TIFFTAG_IMAGEWIDTH, t->width);
    TIFFSetField(tif, TIFFTAG_IMAGELENGTH, t->height);
    TIFFSetField(tif, TIFFTAG_BITSPERSAMPLE, t->bits);
    TIFFSetField(tif, TIFFTAG_SAMPLEFORMAT, t->format);
    TIFFSetField(tif, TIFFTAG_SAMPLESPERPIXEL, t->bands);
    TIFFSetField(tif, TIFFTAG_PLANARCONFIG, PLANARCONFIG_CONTIG);
    TIFFSetField(tif, TIFFTAG_PHOTOMETRIC, t->photometric);
    TIFFSetField(tif, TIFFTAG_COMPRESSION, t->compression);
    if (t->predictor != 0) TIFFSetField(tif, TIFFTAG_PREDICTOR, t->predictor);
    if (t->tile > 0) {
        TIFFSetField(tif, TIFFTAG_TILEWIDTH, t->tile);
        TIFFSetField(tif, TIFFTAG_TILELENGTH, t->tile);
    } else {
        TIFFSetField(tif, TIFFTAG_ROWSPERSTRIP, 3);
    }
}

void tif_write(const char *path, const struct tif *t)
{
    TIFFSetTagExtender(add_fields);
    TIFF *tif = TIFFOpen(path, t->mode);
    assert_non_null(tif);
    set_raster(tif, t);
    set_place(tif, t);
    write_blocks(tif, t);
    if (t->with_mask) {
        assert_int_equal(TIFFWriteDirectory(tif), 1);
        set_raster(tif, t);
        TIFFSetField(tif, TIFFTAG_SUBFILETYPE, FILETYPE_MASK);
        write_blocks(tif, t);
    }
    TIFFClose(tif);
}
