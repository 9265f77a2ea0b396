/* SPDX-License-Identifier: MIT */
/* A cloud's memory, and which reader a file gets. */
#include <stdlib.h>
#include <string.h>

#include "core/studio/analysis/cloud_readers.h"
#include "core/infile.h"

static int reserve_one(void *array, size_t n, size_t size)
{
    void *made = calloc(n, size);
    memcpy(array, &made, sizeof made); /* whatever it points to */
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
