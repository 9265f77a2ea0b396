/* SPDX-License-Identifier: MIT */
#include "core/import/geotiff/geotiff_beside.h"

#include <math.h>
#include <stdbool.h>
#include <stdlib.h>
#include <string.h>

#include "core/geotiff.h"

#define SAME_STEP 1e-6 /* share of a step by which steps of one grid may differ, as writers round them */
#define NEAR      0.1  /* share of a cell within which two rasters are side by side */

struct placed {
    const struct scene_mesh_spec *spec;
    struct geotiff g;
};

static bool is_one_grid(const struct geotiff *a, const struct geotiff *b)
{
    for (int k = 1; k < 3; k++) {
        const double length = hypot(a->easting_m[k], a->northing_m[k]);
        const double other = hypot(a->easting_m[k] - b->easting_m[k], a->northing_m[k] - b->northing_m[k]);
        if (!(other <= SAME_STEP * length)) return false;
    }
    return true;
}

/* Whether one of two rasters begins where the other one ends. The other raster begins `from` cells further on. */
static bool goes_on(double from, uint32_t n, uint32_t n_other)
{
    return fabs(from - n) <= NEAR || fabs(from + n_other) <= NEAR;
}

/* Whether two rasters lie beside each other in at least part of the rows, or of the columns. */
static bool overlaps(double from, uint32_t n, uint32_t n_other)
{
    return from < n - NEAR && from + n_other > NEAR;
}

/* Returns the width of the slit between two rasters, in metres; 0: there is none. */
static double slit_between(const struct placed *a, const struct placed *b)
{
    const double *e = a->g.easting_m, *n = a->g.northing_m;
    const double east = b->g.easting_m[0] + b->spec->offset_m[0] - e[0] - a->spec->offset_m[0];
    const double north = b->g.northing_m[0] + b->spec->offset_m[1] - n[0] - a->spec->offset_m[1];
    const double area = e[1] * n[2] - e[2] * n[1]; /* not 0: geotiff_read has checked it */
    if (!is_one_grid(&a->g, &b->g)) return 0.0;
    const double columns = (east * n[2] - north * e[2]) / area, rows = (e[1] * north - n[1] * east) / area;
    if (goes_on(columns, a->g.width, b->g.width) && overlaps(rows, a->g.height, b->g.height)) return hypot(e[1], n[1]);
    if (goes_on(rows, a->g.height, b->g.height) && overlaps(columns, a->g.width, b->g.width)) return hypot(e[2], n[2]);
    return 0.0;
}

static size_t read_places(const struct scene_mesh_spec *specs, size_t n_specs, struct placed *to)
{
    size_t n = 0;
    struct sh_err why;
    for (size_t i = 0; i < n_specs; i++) {
        if (specs[i].places.place != NULL || !geotiff_is_name(specs[i].file)) continue;
        to[n].spec = &specs[i];
        if (geotiff_read(specs[i].file, &to[n].g, &why) == SH_OK) n++;
    }
    return n;
}

static void warn_slits(const struct placed *placed, size_t n, const struct sh_report *report)
{
    const struct placed *first[2] = {NULL, NULL};
    double width_m = 0.0;
    unsigned n_slits = 0;
    for (size_t i = 0; i < n; i++)
        for (size_t k = i + 1; k < n; k++) {
            const double slit_m = slit_between(&placed[i], &placed[k]);
            if (!(slit_m > 0.0) || n_slits++ > 0) continue;
            first[0] = &placed[i];
            first[1] = &placed[k];
            width_m = slit_m;
        }
    if (n_slits == 0) return;
    sh_warn(report,
            "%s and %s lie side by side: terrain ends at the middles of their cells, so pulses pass a slit %.6g m wide "
            "between them (%u such pair%s): join the files first, with gdal_merge.py",
            basename(first[0]->spec->file), basename(first[1]->spec->file), width_m, n_slits, n_slits > 1 ? "s" : "");
}

void geotiff_warn_beside(const struct scene_mesh_spec *specs, size_t n_specs, const struct sh_report *report)
{
    size_t n = 0;
    for (size_t i = 0; i < n_specs; i++)
        n += specs[i].places.place == NULL && geotiff_is_name(specs[i].file);
    if (n < 2) return; /* most scenes */
    struct placed *placed = calloc(n, sizeof *placed);
    if (placed != NULL) warn_slits(placed, read_places(specs, n_specs, placed), report);
    free(placed);
}
