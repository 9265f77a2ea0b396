/* SPDX-License-Identifier: MIT */
/* The memory of a cloud, its columns by number, and the choice of its reader. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/analysis/cloud_readers.h"
#include "core/grow.h"
#include "core/infile.h"
#include "core/text.h"

#define COLUMN(member) offsetof(struct cloud, member), sizeof *((struct cloud *)0)->member

/* Where the pointer of a column lies, and the bytes of a value. */
static const struct {
    size_t at, size;
} arrays[CLOUD_COLUMNS] = {
    [CLOUD_RANGE] = {COLUMN(range_m)},
    [CLOUD_REFLECTANCE] = {COLUMN(reflectance_db)},
    [CLOUD_AMPLITUDE] = {COLUMN(amplitude_db)},
    [CLOUD_TIME] = {COLUMN(time_s)},
    [CLOUD_LABEL] = {COLUMN(label)},
    [CLOUD_STATION] = {COLUMN(station)},
    [CLOUD_ECHO] = {COLUMN(echo)},
    [CLOUD_ECHO_COUNT] = {COLUMN(echo_count)},
    [CLOUD_RGB] = {COLUMN(rgb)},
};

void *cloud_array(const struct cloud *cloud, enum cloud_column column, size_t *size)
{
    void *array;
    *size = arrays[column].size;
    memcpy(&array, (const char *)cloud + arrays[column].at, sizeof array); /* a pointer of any type */
    return array;
}

int cloud_make_room(struct cloud *cloud, size_t n, unsigned has, struct sh_err *err)
{
    if (n == 0) return SH_OK; /* a file without points has no columns */
    bool ok = resize(&cloud->xyz_m, n, sizeof *cloud->xyz_m);
    for (int c = 0; c < CLOUD_COLUMNS && ok; c++)
        if ((has >> c & 1u) != 0) ok = resize((char *)cloud + arrays[c].at, n, arrays[c].size);
    return ok ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory for %zu points", n);
}

void cloud_note_single(struct cloud *cloud, const char *path, const struct sh_report *report)
{
    const double coarse_m = 1e-4;
    double largest = 0;
    for (size_t i = 0; i < cloud->n; i++)
        for (int k = 0; k < 3; k++)
            largest = fmax(largest, fabs(cloud->xyz_m[i][k]));
    if (cloud->epsg == 4979) largest *= 111320.0; /* degrees */
    cloud->count_m = fmax(cloud->count_m, cloud_single_unit(largest));
    cloud->is_single = 1;
    if (largest * 6e-8 > coarse_m)
        sh_warn(report, "%s: stored in single precision, with errors up to %.2g m", path, largest * 6e-8);
}

bool cloud_is_position(const double p[3])
{
    const int n_nan = isnan(p[0]) + isnan(p[1]) + isnan(p[2]);
    return n_nan == 3 || (isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2]));
}

int cloud_check_position(const struct text *t, uint64_t line, const double p[3], struct sh_err *err)
{
    if (cloud_is_position(p)) return SH_OK;
    return text_fail(t, line, SH_EINPUT, err,
                     "(%.9g %.9g %.9g) is not a position; a shot without echo has nan three times", p[0], p[1], p[2]);
}

int cloud_read_columns(const char *path, unsigned columns, const struct sh_report *report, struct cloud *out,
                       struct sh_err *err)
{
    *out = (struct cloud){.epsg = CLOUD_EPSG_UNKNOWN};
    if (infile_begins(path, "ply") == 0 && infile_begins(path, "LASF") == 0) /* -1: the reader says why */
        return sh_fail(err, SH_EINPUT,
                       "%s: not a PLY file and not a LAS file; allowed are point clouds of these two formats", path);
    int rc = infile_begins(path, "LASF") == 1 ? cloud_read_las(path, columns, report, out, err)
                                              : cloud_read_ply(path, columns, report, out, err);
    if (rc != SH_OK) cloud_free(out);
    return rc;
}

int cloud_read_positions(const char *path, const struct sh_report *report, struct cloud *out, struct sh_err *err)
{
    if (infile_begins(path, "ply") == 1 || infile_begins(path, "LASF") == 1)
        return cloud_read_columns(path, 0, report, out, err);
    const int is_pcd = infile_begins(path, "# .PCD") == 1 || infile_begins(path, "VERSION") == 1;
    *out = (struct cloud){.epsg = CLOUD_EPSG_UNKNOWN};
    const int rc = is_pcd ? cloud_read_pcd(path, report, out, err) : cloud_read_text(path, report, out, err);
    if (rc != SH_OK) cloud_free(out);
    return rc;
}

void cloud_free(struct cloud *cloud)
{
    size_t size;
    free(cloud->xyz_m);
    for (int c = 0; c < CLOUD_COLUMNS; c++)
        free(cloud_array(cloud, (enum cloud_column)c, &size));
    *cloud = (struct cloud){.epsg = CLOUD_EPSG_UNKNOWN};
}
