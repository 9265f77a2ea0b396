/* SPDX-License-Identifier: MIT */
/* This fuzzes recorded clouds and streams, as `report` and `view` read them. The input is a byte that says the ending
 * and the columns, then the file. A file that is read must have finite points or empty shots. A file that is refused
 * must be refused in one line. */
#include <math.h>
#include <string.h>

#include "core/studio/cloud.h"
#include "firmware_sim/app/studio/view/viewed.h"
#include "tests/fuzz/rig.h"
#include "tests/fuzz/seal.h"

enum { MAX_INPUT = 1 << 15 };

static void check_cloud(const struct cloud *cloud)
{
    for (size_t i = 0; i < cloud->n; i++) {
        const double *p = cloud->xyz_m[i];
        const int empty = isnan(p[0]) && isnan(p[1]) && isnan(p[2]);
        fuzz_must(empty || (isfinite(p[0]) && isfinite(p[1]) && isfinite(p[2])), "points are finite, or empty shots");
        fuzz_must(cloud->station == NULL || cloud->station[i] >= 1, "stations count from 1");
    }
}

static void check_viewed(const struct viewed *v)
{
    for (uint32_t i = 0; i < v->points.n; i++)
        for (int c = 0; c < 3; c++)
            fuzz_must(isfinite(v->points.xyz_m[i][c]), "what is shown is finite");
    for (size_t m = 0; m < v->n_meshes; m++)
        for (uint32_t f = 0; f < v->mesh[m].n_faces; f++)
            for (int c = 0; c < 3; c++)
                fuzz_must(v->mesh[m].face[f][c] < v->points.n, "corners of meshes are points");
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const char *const endings[] = {".ply", ".las", ".shs", ".pcapng"};
    static uint8_t bytes[MAX_INPUT];
    struct fuzz_bytes in = {data, size};
    const unsigned how = fuzz_u8(&in), kind = how >> 6;
    struct sh_err err = {0};
    if (in.n > sizeof bytes) return 0;
    memcpy(bytes, in.p, in.n);
    if (kind == 2) fuzz_seal(bytes, in.n);
    const char *path = fuzz_file(endings[kind], bytes, in.n);
    if (kind < 2) {
        struct cloud cloud;
        if (cloud_read_columns(path, (how & 15u) | (how >> 4 & 1u) << CLOUD_ECHO_COUNT | (how >> 5 & 1u) << CLOUD_RGB,
                               &fuzz_report, &cloud, &err) == SH_OK)
            check_cloud(&cloud);
        else
            fuzz_must_be_line(&err);
        cloud_free(&cloud);
        if (cloud_read_positions(path, &fuzz_report, &cloud, &err) == SH_OK)
            check_cloud(&cloud);
        else
            fuzz_must_be_line(&err);
        cloud_free(&cloud);
    }
    struct viewed viewed;
    if (viewed_load(&viewed, path, &fuzz_report, &err) == SH_OK)
        check_viewed(&viewed);
    else
        fuzz_must_be_line(&err);
    viewed_free(&viewed);
    return 0;
}
