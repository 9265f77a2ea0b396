/* A cloud's memory, and which reader a file gets. */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/analysis/cloud_readers.h"
#include "core/infile.h"

int cloud_reserve(struct cloud *cloud, size_t n, unsigned has, struct sh_err *err)
{
    if (n == 0) return SH_OK;
    cloud->xyz_m = calloc(n, sizeof *cloud->xyz_m);
    if (has & CLOUD_HAS_STATION) cloud->station = calloc(n, sizeof *cloud->station);
    if (has & CLOUD_HAS_LABEL) cloud->label = calloc(n, sizeof *cloud->label);
    if (has & CLOUD_HAS_ECHO) cloud->echo = calloc(n, sizeof *cloud->echo);
    if (cloud->xyz_m == NULL || (has & CLOUD_HAS_STATION && cloud->station == NULL) ||
        (has & CLOUD_HAS_LABEL && cloud->label == NULL) || (has & CLOUD_HAS_ECHO && cloud->echo == NULL))
        return sh_fail(err, SH_ENOMEM, "no memory for %zu points", n);
    cloud->n = n;
    return SH_OK;
}

/* No, where it can't be read: then the reader says why. */
static bool is_neither(const char *path)
{
    char magic[3] = "";
    const char *why;
    FILE *in = infile_open(path, &why);
    if (in == NULL) return false;
    size_t n = fread(magic, 1, sizeof magic, in);
    fclose(in);
    return (n != sizeof magic || memcmp(magic, "ply", sizeof magic) != 0) && !cloud_is_las(path);
}

int cloud_read(const char *path, const struct sh_report *report, struct cloud *out, struct sh_err *err)
{
    *out = (struct cloud){.epsg = CLOUD_EPSG_UNKNOWN};
    if (is_neither(path))
        return sh_fail(err, SH_EINPUT, "%s: not a PLY file and not a LAS file; a point cloud of one of these is needed",
                       path);
    int rc = cloud_is_las(path) ? cloud_read_las(path, report, out, err) : cloud_read_ply(path, report, out, err);
    if (rc != SH_OK) cloud_free(out);
    return rc;
}

void cloud_free(struct cloud *cloud)
{
    free(cloud->xyz_m);
    free(cloud->station);
    free(cloud->label);
    free(cloud->echo);
    *cloud = (struct cloud){.epsg = CLOUD_EPSG_UNKNOWN};
}
