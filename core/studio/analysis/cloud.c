/* SPDX-License-Identifier: MIT */
/* The memory of a cloud, and the choice of its reader. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/analysis/cloud_readers.h"
#include "core/infile.h"
#include "core/text.h"

static int reserve_one(void *array, size_t n, size_t size)
{
    void *made = calloc(n, size);
    memcpy(array, &made, sizeof made); /* a pointer of any type */
    return made != NULL;
}

int cloud_reserve(struct cloud *cloud, size_t n, unsigned has, struct sh_err *err)
{
    if (n == 0) return SH_OK;
    const struct {
        unsigned bit;
        void *array;
        size_t size;
    } column[] = {
        {CLOUD_HAS_STATION, &cloud->station, sizeof *cloud->station},
        {CLOUD_HAS_LABEL, &cloud->label, sizeof *cloud->label},
        {CLOUD_HAS_ECHO, &cloud->echo, sizeof *cloud->echo},
        {CLOUD_TIME, &cloud->time_s, sizeof *cloud->time_s},
        {CLOUD_RANGE, &cloud->range_m, sizeof *cloud->range_m},
        {CLOUD_REFLECTANCE, &cloud->reflectance_db, sizeof *cloud->reflectance_db},
        {CLOUD_AMPLITUDE, &cloud->amplitude_db, sizeof *cloud->amplitude_db},
        {CLOUD_RGB, &cloud->rgb, sizeof *cloud->rgb},
        {CLOUD_ECHO_COUNT, &cloud->echo_count, sizeof *cloud->echo_count},
    };
    int ok = reserve_one(&cloud->xyz_m, n, sizeof *cloud->xyz_m);
    for (size_t i = 0; i < sizeof column / sizeof column[0] && ok; i++)
        if (has & column[i].bit) ok = reserve_one(column[i].array, n, column[i].size);
    if (!ok) return sh_fail(err, SH_ENOMEM, "no memory for %zu points", n);
    cloud->n = n;
    return SH_OK;
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
    if (infile_begins(path, "ply") == 0 && infile_begins(path, "LASF") == 0) /* else the reader says why */
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
    free(cloud->xyz_m);
    free(cloud->station);
    free(cloud->label);
    free(cloud->echo);
    free(cloud->time_s);
    free(cloud->range_m);
    free(cloud->reflectance_db);
    free(cloud->amplitude_db);
    free(cloud->echo_count);
    free(cloud->rgb);
    *cloud = (struct cloud){.epsg = CLOUD_EPSG_UNKNOWN};
}
