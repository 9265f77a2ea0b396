/* SPDX-License-Identifier: MIT */
/* This writes a scene of the bench into a mesh file, and prints where its station stands:
 *   build/tests/bench/write_mesh NAME FILE */
#include <stdio.h>

#include "tests/bench/bench.h"
#include "tests/bench/options.h"

int main(int argc, char **argv)
{
    struct bench_target target = {0};
    struct sh_err err;
    if (argc != 3) {
        fprintf(stderr,
                "write_mesh NAME FILE: NAME as in bench --scenes; FILE ends in .obj, .ply, .glb, .gltf or .fbx\n");
        return BENCH_USAGE;
    }
    int rc = bench_target_load(argv[1], BENCH_HOUSE_FILE, NULL, &target, &err);
    if (rc == SH_OK) rc = bench_target_write(&target, argv[2], &err);
    if (rc == SH_OK)
        printf("%.9g %.9g %.9g\n", target.station_m[0], target.station_m[1], target.station_m[2]);
    else
        fprintf(stderr, "write_mesh: %s\n", err.text);
    bench_target_free(&target);
    return rc == SH_OK ? BENCH_OK : BENCH_FAILED;
}
