/* SPDX-License-Identifier: MIT */
/* Reads cells by libtiff, block by block. Packed, predicted, striped and tiled cells all become plain numbers. */
#include "core/import/geotiff/geotiff_read.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <tiffio.h>
#include <unistd.h>

#include "core/bytes.h"
#include "core/geotiff.h"
#include "core/late.h"
#include "core/scene/build_surfaces.h"

#define TIFF_CALLS(CALL)                       \
    CALL(TIFFClose)                            \
    CALL(TIFFComputeStrip)                     \
    CALL(TIFFComputeTile)                      \
    CALL(TIFFGetField)                         \
    CALL(TIFFGetFieldDefaulted)                \
    CALL(TIFFGetStrileByteCount)               \
    CALL(TIFFIsTiled)                          \
    CALL(TIFFOpenExt)                          \
    CALL(TIFFOpenOptionsAlloc)                 \
    CALL(TIFFOpenOptionsFree)                  \
    CALL(TIFFOpenOptionsSetErrorHandlerExtR)   \
    CALL(TIFFOpenOptionsSetWarningHandlerExtR) \
    CALL(TIFFReadDirectory)                    \
    CALL(TIFFReadEncodedStrip)                 \
    CALL(TIFFReadEncodedTile)                  \
    CALL(TIFFSetDirectory)                     \
    CALL(TIFFStripSize)                        \
    CALL(TIFFTileSize)

LATE_LIBRARY(tiff, TIFF_CALLS)

#define NONE UINT32_MAX /* no vertex */

struct raster {
    struct scene_build *b;
    struct geotiff g;
    struct tiff_lib lib;
    TIFF *tif;
    char said[160]; /* libtiff's error */
    uint16_t bits, format;
    double no_data;                     /* rounded as a cell's type rounds it */
    uint32_t block_width, block_height; /* of a tile, or of a strip, which is as wide as the raster */
    size_t block_bytes;
    uint8_t *block;
    double *value;    /* [block_height][width] heights in metres; NaN: none */
    uint32_t *number; /* [2][width] vertices of the row before, and of this one */
    uint16_t label;
    uint64_t n_holes, n_alone; /* cells without a height; heights that touch no triangle */
    double lowest, highest;    /* values, m */
};

/* ---- the file */

static int keep_error(TIFF *tif, void *raster, const char *module, const char *fmt, va_list ap)
{
    struct raster *r = raster;
    (void)tif;
    (void)module;
    if (r->said[0] == '\0') vsnprintf(r->said, sizeof r->said, fmt, ap);
    return 1;
}

static int drop_warning(TIFF *tif, void *raster, const char *module, const char *fmt, va_list ap)
{
    (void)tif, (void)raster, (void)module, (void)fmt, (void)ap;
    return 1; /* the tags of GeoTIFF are unknown to libtiff */
}

static int fail_reading(struct raster *r, const char *what, struct sh_err *err)
{
    return build_fail(r->b, SH_EINPUT, err, "%s can't be read: %s", what,
                      r->said[0] != '\0' ? r->said : "libtiff gives no reason");
}

static int open_tiff(struct raster *r, struct sh_err *err)
{
    const int rc = tiff_lib_load(&r->lib, err);
    if (rc != SH_OK) return rc;
    TIFFOpenOptions *options = r->lib.TIFFOpenOptionsAlloc();
    if (options == NULL) return build_fail(r->b, SH_ENOMEM, err, "no memory");
    r->lib.TIFFOpenOptionsSetErrorHandlerExtR(options, keep_error, r);
    r->lib.TIFFOpenOptionsSetWarningHandlerExtR(options, drop_warning, r);
    r->tif = r->lib.TIFFOpenExt(r->b->spec->file, "r", options);
    r->lib.TIFFOpenOptionsFree(options);
    return r->tif != NULL ? SH_OK : fail_reading(r, "its directory", err);
}

static uint32_t kind_of(struct raster *r)
{
    uint32_t type = 0;
    r->lib.TIFFGetFieldDefaulted(r->tif, TIFFTAG_SUBFILETYPE, &type);
    return type;
}

/* GDAL may also write the mask into a file of its own. */
static int has_mask_beside(const struct raster *r)
{
    char *name = NULL;
    const int is_there = asprintf(&name, "%s.msk", r->b->spec->file) >= 0 && access(name, F_OK) == 0;
    free(name);
    return is_there;
}

/* Checks the other images of the file: smaller copies are ignored, a mask is refused, others give a warning. */
static int look_at_others(struct raster *r, struct sh_err *err)
{
    unsigned n = 0, n_masks = has_mask_beside(r) ? 1 : 0;
    if ((kind_of(r) & (FILETYPE_MASK | FILETYPE_REDUCEDIMAGE)) != 0)
        return build_fail(
            r->b, SH_EINPUT, err,
            "its first image is a mask or a smaller copy; allowed is a file whose first image has the heights");
    while (r->lib.TIFFReadDirectory(r->tif)) {
        const uint32_t type = kind_of(r);
        n_masks += (type & FILETYPE_MASK) != 0;
        n += (type & (FILETYPE_MASK | FILETYPE_REDUCEDIMAGE)) == 0;
    }
    if (n_masks > 0)
        return build_fail(
            r->b, SH_EINPUT, err,
            "a mask marks the cells without height; allowed is a value that marks them: gdalwarp -dstnodata -9999 "
            "makes one");
    if (n > 0) build_warn(r->b, "only its first image is read; there %s %u more", n > 1 ? "are" : "is", n);
    if (r->said[0] != '\0')
        build_warn(r->b, "only its first image is read; the data after it are broken: %.200s", r->said);
    r->said[0] = '\0';
    return r->lib.TIFFSetDirectory(r->tif, 0) ? SH_OK : fail_reading(r, "its directory", err);
}

/* Heights must be one band of numbers, and no picture. */
static int check_band(struct raster *r, struct sh_err *err)
{
    uint16_t bands = 1, photometric = PHOTOMETRIC_MINISBLACK;
    r->lib.TIFFGetFieldDefaulted(r->tif, TIFFTAG_SAMPLESPERPIXEL, &bands);
    r->lib.TIFFGetFieldDefaulted(r->tif, TIFFTAG_BITSPERSAMPLE, &r->bits);
    r->lib.TIFFGetFieldDefaulted(r->tif, TIFFTAG_SAMPLEFORMAT, &r->format);
    r->lib.TIFFGetField(r->tif, TIFFTAG_PHOTOMETRIC, &photometric);
    if (photometric != PHOTOMETRIC_MINISBLACK)
        return build_fail(
            r->b, SH_EINPUT, err,
            "a picture (%u band%s, PhotometricInterpretation %u), not heights; allowed is one band of heights", bands,
            bands > 1 ? "s" : "", photometric);
    if (bands != 1)
        return build_fail(r->b, SH_EINPUT, err,
                          "%u bands; allowed is one, of heights: gdal_translate -b 1 takes the first", bands);
    const int is_float = r->format == SAMPLEFORMAT_IEEEFP;
    if ((is_float || r->format == SAMPLEFORMAT_UINT || r->format == SAMPLEFORMAT_INT) &&
        (r->bits == 32 || r->bits == 64 || (!is_float && (r->bits == 8 || r->bits == 16))))
        return SH_OK;
    return build_fail(
        r->b, SH_EINPUT, err,
        "cells of %u bits, SampleFormat %u; allowed are whole numbers of 8, 16, 32, 64 bits and floats of 32, "
        "64: gdal_translate -ot Float32 makes these",
        r->bits, r->format);
}

/* Refuses a raster whose vertices, triangles and labels may take too much memory. This memory counts twice: the head's
 * process gets a copy of it. */
static int check_memory(struct raster *r, struct sh_err *err)
{
    const struct scene *s = NULL;
    const double cells = (double)r->g.width * r->g.height;
    const double mib = cells * 2.0 * (sizeof *s->vertex_m + 2.0 * (sizeof *s->triangle + sizeof *s->label)) / 1048576.0;
    const unsigned allowed = build_limits(r->b).memory_mib;
    if (mib <= allowed) return SH_OK;
    return build_fail(
        r->b, SH_EINPUT, err,
        "%u x %u cells are up to %.3g million triangles, and reading them takes up to %.0f MiB; allowed are %u "
        "(scene.import_memory_mib): cut a part out (gdal_translate -projwin), or make it coarser "
        "(gdal_translate -outsize 25%% 25%% -r average)",
        r->g.width, r->g.height, 2e-6 * cells, mib, allowed);
}

static int set_up_blocks(struct raster *r, struct sh_err *err)
{
    uint32_t width = 0, height = 0;
    r->lib.TIFFGetField(r->tif, TIFFTAG_IMAGEWIDTH, &width);
    r->lib.TIFFGetField(r->tif, TIFFTAG_IMAGELENGTH, &height);
    if (width != r->g.width || height != r->g.height)
        return build_fail(r->b, SH_EINPUT, err, "its size is %u x %u cells for libtiff, and %u x %u by its tags", width,
                          height, r->g.width, r->g.height);
    r->block_width = width;
    r->block_height = height;
    if (r->lib.TIFFIsTiled(r->tif)) {
        r->lib.TIFFGetField(r->tif, TIFFTAG_TILEWIDTH, &r->block_width);
        r->lib.TIFFGetField(r->tif, TIFFTAG_TILELENGTH, &r->block_height);
    } else {
        r->lib.TIFFGetFieldDefaulted(r->tif, TIFFTAG_ROWSPERSTRIP, &r->block_height);
    }
    if (r->block_height > height && !r->lib.TIFFIsTiled(r->tif)) r->block_height = height;
    const tmsize_t bytes = r->lib.TIFFIsTiled(r->tif) ? r->lib.TIFFTileSize(r->tif) : r->lib.TIFFStripSize(r->tif);
    if (bytes <= 0 || r->block_width == 0 || r->block_height == 0 ||
        (uint64_t)bytes != (uint64_t)r->block_width * r->block_height * (r->bits / 8u))
        return build_fail(r->b, SH_EINPUT, err,
                          "its tiles or strips of %u x %u cells don't hold the bytes that libtiff counts",
                          r->block_width, r->block_height);
    r->block_bytes = (size_t)bytes;
    r->block = malloc(r->block_bytes);
    r->value = calloc((size_t)r->block_height * width, sizeof *r->value);
    r->number = calloc(2 * (size_t)width, sizeof *r->number);
    if (r->block != NULL && r->value != NULL && r->number != NULL) return SH_OK;
    return build_fail(r->b, SH_ENOMEM, err, "no memory for its tiles or strips of %u x %u cells", r->block_width,
                      r->block_height);
}

/* ---- cells */

/* libtiff gives cells in the machine's own order, which is little-endian. */
static double geotiff_read_load(const struct raster *r, const uint8_t *p)
{
    const int is_signed = r->format == SAMPLEFORMAT_INT;
    if (r->format == SAMPLEFORMAT_IEEEFP) return le_get_number(p, r->bits == 32 ? NUMBER_FLOAT : NUMBER_DOUBLE);
    if (r->bits == 8) return le_get_number(p, is_signed ? NUMBER_I8 : NUMBER_U8);
    if (r->bits == 16) return le_get_number(p, is_signed ? NUMBER_I16 : NUMBER_U16);
    if (r->bits == 32) return le_get_number(p, is_signed ? NUMBER_I32 : NUMBER_U32);
    return is_signed ? (double)(int64_t)le_get64(p) : (double)le_get64(p);
}

static double height_of(const struct raster *r, const uint8_t *p)
{
    const double value = geotiff_read_load(r, p);
    return isfinite(value) && value != r->no_data ? r->g.height_m + r->g.height_scale_m * value : NAN;
}

/* Reads the cells of the block at a column and row. A block without bytes was left out by the writer of the file: it
 * has no heights. */
static int read_block(struct raster *r, uint32_t x, uint32_t y, struct sh_err *err)
{
    const int is_tiled = r->lib.TIFFIsTiled(r->tif);
    const uint32_t n = is_tiled ? r->lib.TIFFComputeTile(r->tif, x, y, 0, 0) : r->lib.TIFFComputeStrip(r->tif, y, 0);
    const uint32_t rows = r->g.height - y < r->block_height ? r->g.height - y : r->block_height;
    const uint32_t columns = r->g.width - x < r->block_width ? r->g.width - x : r->block_width;
    const size_t bytes = r->bits / 8u, need = bytes * r->block_width * (is_tiled ? r->block_height : rows);
    const int is_empty = r->lib.TIFFGetStrileByteCount(r->tif, n) == 0;
    tmsize_t got = (tmsize_t)need;
    if (!is_empty)
        got = is_tiled ? r->lib.TIFFReadEncodedTile(r->tif, n, r->block, (tmsize_t)r->block_bytes)
                       : r->lib.TIFFReadEncodedStrip(r->tif, n, r->block, (tmsize_t)r->block_bytes);
    if (got < (tmsize_t)need) {
        char what[64];
        snprintf(what, sizeof what, "the %s of cells at column %u, row %u", is_tiled ? "tile" : "strip", x, y);
        return fail_reading(r, what, err);
    }
    for (uint32_t i = 0; i < rows; i++)
        for (uint32_t k = 0; k < columns; k++)
            r->value[(size_t)i * r->g.width + x + k] =
                is_empty ? NAN : height_of(r, r->block + bytes * ((size_t)i * r->block_width + k));
    return SH_OK;
}

/* ---- triangles */

static int add_row(struct raster *r, uint32_t y, const double *height, uint32_t *number, struct sh_err *err)
{
    const double *e = r->g.easting_m, *n = r->g.northing_m;
    int rc = SH_OK;
    for (uint32_t x = 0; x < r->g.width && rc == SH_OK; x++) {
        number[x] = NONE;
        if (isnan(height[x])) {
            r->n_holes++;
            continue;
        }
        const double v[3] = {e[0] + e[1] * x + e[2] * y, n[0] + n[1] * x + n[2] * y, height[x]};
        r->lowest = fmin(r->lowest, height[x]);
        r->highest = fmax(r->highest, height[x]);
        number[x] = r->b->scene->n_vertices;
        rc = build_vertex(r->b, v, err);
    }
    return rc;
}

/* Adds the triangles between the middles of four cells, counter-clockwise seen from above: two triangles, or one where
 * only three of the cells have a height. */
static int add_quad(struct raster *r, const uint32_t *above, const uint32_t *below, int is_mirrored, struct sh_err *err)
{
    const uint32_t round[4] = {above[0], below[0], below[1], above[1]};
    uint32_t corner[4];
    size_t n = 0;
    for (size_t i = 0; i < 4; i++) {
        const uint32_t c = round[is_mirrored ? 3 - i : i];
        if (c != NONE) corner[n++] = c;
    }
    int rc = SH_OK;
    for (size_t i = 0; i + 2 < n && rc == SH_OK; i++) {
        const uint32_t three[3] = {corner[0], corner[i + 1], corner[i + 2]};
        memcpy(r->b->corner, three, sizeof three);
        rc = build_polygon(r->b, 3, r->label, err);
    }
    return rc;
}

static int add_all(struct raster *r, struct sh_err *err)
{
    const struct geotiff *g = &r->g;
    const int is_mirrored = g->easting_m[1] * g->northing_m[2] - g->easting_m[2] * g->northing_m[1] > 0.0;
    int rc = SH_OK;
    for (uint32_t y = 0; y < g->height && rc == SH_OK; y++) {
        const uint32_t in_block = y % r->block_height;
        uint32_t *number = r->number + (y % 2) * (size_t)g->width,
                 *above = r->number + ((y + 1) % 2) * (size_t)g->width;
        if (in_block == 0) rc = build_progress(r->b, (double)y / g->height, err);
        for (uint32_t x = 0; in_block == 0 && x < g->width && rc == SH_OK; x += r->block_width)
            rc = read_block(r, x, y, err);
        if (rc == SH_OK) rc = add_row(r, y, r->value + (size_t)in_block * g->width, number, err);
        for (uint32_t x = 0; y > 0 && x + 1 < g->width && rc == SH_OK; x++)
            rc = add_quad(r, above + x, number + x, is_mirrored, err);
    }
    return rc;
}

/* ---- warnings */

static int count_alone(struct raster *r, struct sh_err *err)
{
    const struct scene *s = r->b->scene;
    uint8_t *used = calloc(s->n_vertices + 1u, 1);
    if (used == NULL) return build_fail(r->b, SH_ENOMEM, err, "no memory");
    for (uint32_t i = 0; i < s->n_triangles; i++)
        for (int k = 0; k < 3; k++)
            used[s->triangle[i][k]] = 1;
    for (uint32_t i = 0; i < s->n_vertices; i++)
        r->n_alone += !used[i];
    free(used);
    return SH_OK;
}

/* Warns of heights that no place on the Earth has, and of -9999 m: such values usually mark cells without height. */
static void warn_of_odd_heights(const struct raster *r)
{
    const int is_low = r->lowest < -11500.0 || r->lowest == -9999.0;
    const double odd = is_low ? r->lowest : r->highest;
    if (!is_low && odd <= 9000.0) return;
    build_warn(r->b,
               "its heights go from %g to %g m; if %g marks cells without height, add that to the file with "
               "gdal_translate -a_nodata",
               r->lowest, r->highest, (odd - r->g.height_m) / r->g.height_scale_m);
}

static int geotiff_read_say(struct raster *r, struct sh_err *err)
{
    int rc = r->n_holes > 0 ? count_alone(r, err) : SH_OK;
    if (r->n_holes == (uint64_t)r->g.width * r->g.height)
        return build_fail(r->b, SH_EINPUT, err, "none of %u x %u cells has a height", r->g.width, r->g.height);
    if (r->n_holes > 0)
        build_warn(r->b, "%llu of %llu cells have no height, and are holes", (unsigned long long)r->n_holes,
                   (unsigned long long)r->g.width * r->g.height);
    if (r->n_alone > 0)
        build_warn(r->b, "%llu heights beside holes touch no triangle, and are left out",
                   (unsigned long long)r->n_alone);
    if (!r->g.unit_given) build_warn(r->b, "it names neither its system nor its unit: metres are assumed");
    if (!r->g.height_unit_given && r->g.unit_m != 1.0)
        build_warn(r->b, "its system is in feet, but its heights have no unit: metres are assumed");
    if (r->g.odd_no_data[0] != '\0')
        build_warn(r->b, "its no-data value is '%s', which is not one number: %s", r->g.odd_no_data,
                   isnan(r->g.no_data) ? "no height counts as missing" : "the first number is taken");
    if (r->g.maps_heights)
        build_warn(r->b,
                   "its ModelPixelScale or ModelTiepoint scales the heights; this is not used, since the file names no "
                   "system for heights");
    if (r->g.turns_heights) build_warn(r->b, "its ModelTransformation changes the heights; this is not used");
    warn_of_odd_heights(r);
    return rc;
}

static int read_raster(struct raster *r, struct sh_err *err)
{
    struct scene_build *b = r->b;
    const uint64_t cells = (uint64_t)r->g.width * r->g.height;
    int rc = check_band(r, err);
    if (rc == SH_OK) rc = look_at_others(r, err);
    if (rc == SH_OK) rc = check_memory(r, err);
    if (rc == SH_OK) rc = set_up_blocks(r, err);
    if (rc == SH_OK) rc = build_label(b, build_base_name(b), (struct text_span){"", 0}, &r->label, err);
    if (rc == SH_OK) rc = build_corners(b, 3, err);
    if (rc == SH_OK) rc = build_reserve(b, cells, 2 * cells, err);
    if (rc != SH_OK) return rc;
    r->no_data = r->format == SAMPLEFORMAT_IEEEFP && r->bits == 32 ? (double)(float)r->g.no_data : r->g.no_data;
    r->lowest = INFINITY;
    r->highest = -INFINITY;
    b->scene->n_meshes++;
    b->scene->says = (struct scene_says){.unit_m = 1.0, .up = 3};
    rc = add_all(r, err);
    return rc == SH_OK ? geotiff_read_say(r, err) : rc;
}

int import_geotiff(struct scene_build *b, struct sh_err *err)
{
    struct raster r = {.b = b};
    if (b->spec->up != SCENE_UP_Z || b->spec->scale != 1.0)
        return build_fail(b, SH_EINPUT, err, "a GeoTIFF has z up, and metres; allowed up: z, scale: 1");
    int rc = geotiff_read(b->spec->file, &r.g, err);
    if (rc == SH_OK) rc = open_tiff(&r, err);
    if (rc == SH_OK) rc = read_raster(&r, err);
    if (r.tif != NULL) r.lib.TIFFClose(r.tif);
    free(r.block);
    free(r.value);
    free(r.number);
    return rc;
}
