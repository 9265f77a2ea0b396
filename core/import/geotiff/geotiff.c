/* SPDX-License-Identifier: MIT */
#include "core/geotiff.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/crs.h"
#include "core/import/geotiff/tags.h"
#include "core/text.h"

/* Tags, and keys of the tag GEO_KEYS. */
enum { WIDTH = 256, HEIGHT = 257, PIXEL_SCALE = 33550, TIE_POINTS = 33922, TRANSFORMATION = 34264, GEO_KEYS = 34735 };
enum { GDAL_METADATA = 42112, GDAL_NO_DATA = 42113 };
enum { MODEL = 1024, RASTER = 1025, GEOGRAPHIC = 2048, PROJECTED = 3072, UNIT = 3076 };
enum { VERTICAL = 4096, VERTICAL_UNIT = 4099 };
enum { MODEL_PROJECTED = 1, MODEL_GEOGRAPHIC, MODEL_GEOCENTRIC, RASTER_IS_POINT = 2, USER_DEFINED = 32767 };
enum { MOST_KEYS = 512, FIRST_ELLIPSOID = 5001, LAST_ELLIPSOID = 5033, FIRST_VERTICAL_EPSG = 5100 };

#define FOOT_M    0.3048
#define US_FOOT_M (1200.0 / 3937.0)

struct reader {
    struct tags tags;
    struct geotiff *g;
    double key[4 * MOST_KEYS];
    size_t n_key;
    double map[16];           /* rows: easting, northing, height in the file's units; columns: column, row, value, 1 */
    double z_scale, z_offset; /* of heights, by scale and tie point */
    struct sh_err *err;
};

int geotiff_is_name(const char *file)
{
    return text_has_ending(file, ".tif") || text_has_ending(file, ".tiff");
}

/* Returns a key that is a number in the directory itself; 0: it isn't there. */
static unsigned key(const struct reader *r, unsigned id)
{
    for (size_t i = 4; i + 4 <= r->n_key; i += 4)
        if (r->key[i] == id && r->key[i + 1] == 0.0)
            return r->key[i + 3] >= 0.0 && r->key[i + 3] <= UINT16_MAX ? (unsigned)r->key[i + 3] : USER_DEFINED;
    return 0;
}

static int read_size(struct reader *r)
{
    double n[2] = {0.0, 0.0};
    size_t found;
    int rc = tags_numbers(&r->tags, WIDTH, &n[0], 1, &found, r->err);
    if (rc == SH_OK) rc = tags_numbers(&r->tags, HEIGHT, &n[1], 1, &found, r->err);
    if (rc != SH_OK) return rc;
    if (!(n[0] >= 2.0 && n[1] >= 2.0 && n[0] <= INT32_MAX && n[1] <= INT32_MAX))
        return sh_fail(r->err, SH_EINPUT,
                       "%s: %.0f x %.0f cells; allowed are at least 2 x 2, since their middles are the vertices",
                       r->tags.path, n[0], n[1]);
    r->g->width = (uint32_t)n[0];
    r->g->height = (uint32_t)n[1];
    return SH_OK;
}

/* ---- place */

/* A tie point places a raster only together with the size of its cells. */
static int fail_unplaced(const struct reader *r, size_t n_tie)
{
    if (n_tie > 6)
        return sh_fail(
            r->err, SH_EINPUT,
            "%s: its place is given by control points; allowed is a grid, which gdalwarp -t_srs EPSG:CODE -dstnodata "
            "-9999 makes",
            r->tags.path);
    return sh_fail(r->err, SH_EINPUT,
                   "%s: not a GeoTIFF: it doesn't say where its cells are (ModelTransformation, or ModelPixelScale and "
                   "ModelTiepoint); where a .tfw file is beside it, gdal_translate makes a GeoTIFF of both",
                   r->tags.path);
}

static int read_scale(struct reader *r)
{
    double scale[3] = {0.0}, tie[12] = {0.0};
    size_t n_scale, n_tie;
    int rc = tags_numbers(&r->tags, PIXEL_SCALE, scale, 3, &n_scale, r->err);
    if (rc == SH_OK) rc = tags_numbers(&r->tags, TIE_POINTS, tie, 12, &n_tie, r->err);
    if (rc != SH_OK) return rc;
    if (n_scale < 2 || n_tie < 6) return fail_unplaced(r, n_tie);
    r->z_scale = scale[2] != 0.0 ? scale[2] : 1.0;
    r->z_offset = scale[2] != 0.0 ? tie[5] - scale[2] * tie[2] : 0.0;
    const double map[8] = {scale[0], 0.0,       0.0, tie[3] - scale[0] * tie[0],
                           0.0,      -scale[1], 0.0, tie[4] + scale[1] * tie[1]};
    memcpy(r->map, map, sizeof map);
    return SH_OK;
}

static int read_map(struct reader *r)
{
    size_t n;
    int rc = tags_numbers(&r->tags, TRANSFORMATION, r->map, 16, &n, r->err);
    if (rc == SH_OK && n < 8) rc = read_scale(r);
    if (rc != SH_OK) return rc;
    const double *m = r->map, *z = r->map + 8;
    /* The third row is for heights. It is not applied, as in GDAL; a warning names it. Two rows change no height and
     * need no warning: 0 0 0 0 (there are no heights) and 0 0 1 0 (heights as they are). */
    r->g->turns_heights = n >= 12 && (z[0] != 0.0 || z[1] != 0.0 || z[3] != 0.0 || (z[2] != 0.0 && z[2] != 1.0));
    const double area = m[0] * m[5] - m[1] * m[4];
    if (isfinite(area) && area != 0.0 && isfinite(m[3]) && isfinite(m[7])) return SH_OK;
    return sh_fail(r->err, SH_EINPUT, "%s: its cells have no area, or their place is infinite or NaN", r->tags.path);
}

/* ---- systems and units */

static int fail_degrees(const struct reader *r)
{
    const double *m = r->map, *n = r->map + 4, w = 0.5 * r->g->width, h = 0.5 * r->g->height;
    const double lon = m[0] * w + m[1] * h + m[3], lat = n[0] * w + n[1] * h + n[3];
    const unsigned system = key(r, GEOGRAPHIC);
    char name[24] = "of its own";
    if (system != 0 && system != USER_DEFINED) snprintf(name, sizeof name, "EPSG:%u", system);
    return sh_fail(r->err, SH_EINPUT,
                   "%s: its cells are degrees (%s); allowed are systems in metres or feet: gdalwarp -t_srs EPSG:%d "
                   "-r bilinear -dstnodata -9999 makes one in metres",
                   r->tags.path, name, geotiff_utm_code(lat, lon));
}

/* The unit that a code names, in metres; 0: it is not known here. */
static double unit_of(unsigned code)
{
    return code == 9001 ? 1.0 : code == 9002 ? FOOT_M : code == 9003 ? US_FOOT_M : 0.0;
}

static int fail_unit(const struct reader *r, const char *what, unsigned code)
{
    return sh_fail(r->err, SH_EINPUT,
                   "%s: the unit of its %s is EPSG:%u; allowed are 9001 (metre), 9002 (foot), 9003 (US "
                   "survey foot)",
                   r->tags.path, what, code);
}

static int find_unit(const struct reader *r, const char *name, int of_heights, double *unit_m)
{
    struct sh_err why = {0};
    int rc = crs_unit(name, of_heights, unit_m, &why);
    return rc == SH_OK ? rc : sh_fail(r->err, rc, "%s: %s", r->tags.path, why.text);
}

static int read_system(struct reader *r, double *unit_m)
{
    const unsigned model = key(r, MODEL), code = key(r, PROJECTED), unit = key(r, UNIT);
    int rc = SH_OK;
    *unit_m = 1.0;
    if (model == MODEL_GEOGRAPHIC || (model == 0 && code == 0 && key(r, GEOGRAPHIC) != 0)) return fail_degrees(r);
    if (model == MODEL_GEOCENTRIC)
        return sh_fail(r->err, SH_EINPUT, "%s: its system is geocentric; allowed are projected ones", r->tags.path);
    if (code != 0 && code != USER_DEFINED) {
        snprintf(r->g->crs, sizeof r->g->crs, "EPSG:%u", code);
        rc = find_unit(r, r->g->crs, 0, unit_m);
    }
    r->g->unit_given = r->g->crs[0] != '\0' || unit != 0;
    if (rc != SH_OK || unit == 0) return rc;
    *unit_m = unit_of(unit);
    return *unit_m > 0.0 ? SH_OK : fail_unit(r, "cells", unit);
}

static int read_place(struct reader *r)
{
    int rc = read_map(r);
    if (rc == SH_OK) rc = tags_numbers(&r->tags, GEO_KEYS, r->key, 4 * MOST_KEYS, &r->n_key, r->err);
    if (rc == SH_OK) rc = read_system(r, &r->g->unit_m);
    if (rc != SH_OK) return rc;
    /* A cell is a point, or an area whose middle is half a cell from its corner. */
    const double middle = key(r, RASTER) == RASTER_IS_POINT ? 0.0 : 0.5;
    double *const axis[2] = {r->g->easting_m, r->g->northing_m};
    for (int k = 0; k < 2; k++) {
        const double *m = r->map + 4 * k;
        axis[k][0] = r->g->unit_m * (m[0] * middle + m[1] * middle + m[3]);
        axis[k][1] = r->g->unit_m * m[0];
        axis[k][2] = r->g->unit_m * m[1];
    }
    return SH_OK;
}

/* ---- heights */

/* Finds the value of an item of GDAL's metadata: <Item name="SCALE" sample="0" role="scale">0.1</Item>. The value is
 * empty where there is no such item. */
static struct text_span item(const char *metadata, const char *role)
{
    char mark[40];
    snprintf(mark, sizeof mark, " role=\"%s\">", role);
    const char *at = strstr(metadata, mark), *value = at != NULL ? at + strlen(mark) : "";
    return (struct text_span){value, strcspn(value, "<")};
}

static int read_item(const struct reader *r, const char *metadata, const char *role, double *value)
{
    const struct text_span text = item(metadata, role);
    char *end = NULL;
    if (text.n == 0) return SH_OK;
    *value = strtod(text.p, &end);
    end += end > text.p ? strspn(end, " \t\r\n") : 0;
    if (end == text.p + text.n && isfinite(*value) && (*value != 0.0 || strcmp(role, "scale") != 0)) return SH_OK;
    return sh_fail(r->err, SH_EINPUT, "%s: the %s of its heights is '%.*s'; allowed are numbers, and no scale of 0",
                   r->tags.path, role, text.n < 40 ? (int)text.n : 40, text.p);
}

/* Returns 1 where the metadata name the unit. */
static int named_unit(const struct reader *r, const char *metadata, double *unit_m)
{
    static const struct {
        const char *name;
        double unit_m;
    } known[] = {{"m", 1.0},           {"metre", 1.0},     {"meter", 1.0},
                 {"ft", FOOT_M},       {"foot", FOOT_M},   {"US survey foot", US_FOOT_M},
                 {"us-ft", US_FOOT_M}, {"ftUS", US_FOOT_M}};
    const struct text_span text = item(metadata, "unittype");
    if (text.n == 0) return 0;
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        if (!text_is_word(text, known[i].name)) continue;
        *unit_m = known[i].unit_m;
        return 1;
    }
    return sh_fail(r->err, SH_EINPUT, "%s: the unit of its heights is '%.*s'; allowed are m, ft, US survey foot",
                   r->tags.path, text.n < 40 ? (int)text.n : 40, text.p);
}

static int read_height_unit(const struct reader *r, const char *metadata, double *unit_m)
{
    const unsigned system = key(r, VERTICAL), unit = key(r, VERTICAL_UNIT);
    char name[16];
    int rc = SH_OK;
    *unit_m = 1.0;
    r->g->above_ellipsoid = system >= FIRST_ELLIPSOID && system <= LAST_ELLIPSOID;
    if (system >= FIRST_VERTICAL_EPSG && system != USER_DEFINED) {
        snprintf(name, sizeof name, "EPSG:%u", system);
        rc = find_unit(r, name, 1, unit_m);
        r->g->height_unit_given = 1;
    }
    if (rc == SH_OK && unit != 0) {
        *unit_m = unit_of(unit);
        r->g->height_unit_given = 1;
        if (*unit_m == 0.0) rc = fail_unit(r, "heights", unit);
    }
    const int is_named = rc == SH_OK ? named_unit(r, metadata, unit_m) : 0;
    if (is_named == 1) r->g->height_unit_given = 1;
    return is_named < 0 ? is_named : rc;
}

/* Takes the number at the text's begin, as GDAL does. */
static void read_no_data(const struct reader *r, const char *text)
{
    char *end;
    r->g->no_data = strtod(text, &end);
    if (end == text) r->g->no_data = NAN;
    if (end[strspn(end, " \t\r\n")] != '\0') snprintf(r->g->odd_no_data, sizeof r->g->odd_no_data, "%.23s", text);
}

static int read_heights(struct reader *r)
{
    char text[64], *metadata = malloc(1 << 16);
    double unit_m = 1.0;
    int rc = metadata != NULL ? SH_OK : sh_fail(r->err, SH_ENOMEM, "no memory");
    if (rc == SH_OK) rc = tags_text(&r->tags, GDAL_METADATA, metadata, 1 << 16, r->err);
    if (rc == SH_OK) rc = tags_text(&r->tags, GDAL_NO_DATA, text, sizeof text, r->err);
    if (rc == SH_OK) rc = read_height_unit(r, metadata, &unit_m);
    if (rc == SH_OK) {
        read_no_data(r, text);
        /* As in GDAL, scale and tie point change heights only where these have a system or a unit. */
        const int is_vertical = key(r, VERTICAL) != 0 || key(r, VERTICAL_UNIT) != 0;
        double offset = is_vertical ? r->z_offset : 0.0, scale = is_vertical ? r->z_scale : 1.0;
        rc = read_item(r, metadata, "offset", &offset);
        if (rc == SH_OK) rc = read_item(r, metadata, "scale", &scale);
        r->g->height_m = unit_m * offset;
        r->g->height_scale_m = unit_m * scale;
        r->g->maps_heights = !is_vertical && (r->z_scale != 1.0 || r->z_offset != 0.0);
    }
    free(metadata);
    return rc;
}

int geotiff_read(const char *path, struct geotiff *geotiff, struct sh_err *err)
{
    struct reader *r = malloc(sizeof *r);
    *geotiff = (struct geotiff){0};
    if (r == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the tags of a GeoTIFF");
    r->g = geotiff;
    r->z_scale = 1.0;
    r->z_offset = 0.0;
    r->err = err;
    int rc = tags_open(&r->tags, path, err);
    if (rc == SH_OK) rc = read_size(r);
    if (rc == SH_OK) rc = read_place(r);
    if (rc == SH_OK) rc = read_heights(r);
    tags_close(&r->tags);
    free(r);
    return rc;
}

int geotiff_utm_code(double lat_deg, double lon_deg)
{
    if (lat_deg > 84.0) return 32661;
    if (lat_deg < -80.0) return 32761;
    const double turn = lon_deg + 180.0, east_deg = turn - 360.0 * floor(turn / 360.0); /* a file may count 0 to 360 */
    const int zone = east_deg >= 0.0 && east_deg < 360.0 ? (int)floor(east_deg / 6.0) + 1 : 1;
    return (lat_deg < 0.0 ? 32700 : 32600) + zone;
}

void geotiff_bounds(const struct geotiff *geotiff, double bounds_m[4])
{
    const double *const axis[2] = {geotiff->easting_m, geotiff->northing_m};
    for (int k = 0; k < 2; k++) {
        const double columns = axis[k][1] * (geotiff->width - 1), rows = axis[k][2] * (geotiff->height - 1);
        bounds_m[k] = axis[k][0] + fmin(columns, 0.0) + fmin(rows, 0.0);
        bounds_m[k + 2] = axis[k][0] + fmax(columns, 0.0) + fmax(rows, 0.0);
    }
}
