/* SPDX-License-Identifier: MIT */
/* Streams and names that can be no mesh are refused before the file is there. */
#include "tests/unit/grid_rig.h"

static struct sh_err err;

static void refused(const char *name, struct recorder_options options, int code, const char *expected)
{
    assert_int_equal(rig_record(rig_path(name), options, RIG_KEEP, &err), code);
    if (strstr(err.text, expected) == NULL || strchr(err.text, '\n') != NULL) fail_msg("%s", err.text);
    assert_int_equal(access(rig_path(name), F_OK), -1);
}

static void what_can_be_no_mesh(void **state)
{
    (void)state;
    const struct recorder_options mesh = {.mesh = 1};
    struct native_descriptor d = grid_rig_descriptor(1);
    struct native_anchor a = grid_rig_anchor(1);
    d.pan_udeg_s = 0;
    rig_begin();
    grid_rig_put_descriptor(&d);
    rig_anchor(&a);
    grid_rig_put_step(0);
    refused("a.ply", mesh, SH_EFORMAT, "it neither pans nor moves");

    a = rig_anchor_of(NATIVE_CRS_UTM, 32632, 1);
    d = grid_rig_descriptor(1);
    rig_begin();
    grid_rig_put_descriptor(&d);
    rig_anchor(&a);
    grid_rig_put_step(0);
    refused("a.glb", mesh, SH_EINPUT,
            ".glb holds coordinates as float, which moves coordinates of 5000100 m by up to 0.3 m");

    d.frames = 10000000; /* 10^7 turns of 11 lines of a tenth of 1001 pulses */
    a = grid_rig_anchor(1);
    rig_begin();
    grid_rig_put_descriptor(&d);
    rig_anchor(&a);
    grid_rig_put_step(0);
    refused("a.ply", mesh, SH_EINPUT, "up to 11011000000 points; a mesh holds up to 2147483647");

    d.frames = 100000;
    d.prr_uhz = 10000000000;
    rig_begin();
    grid_rig_put_descriptor(&d);
    rig_anchor(&a);
    grid_rig_put_step(0);
    if (sysconf(_SC_PHYS_PAGES) * (sysconf(_SC_PAGESIZE) >> 20) < 170000)
        refused("a.ply", mesh, SH_EINPUT, "takes 174.2 GiB of memory, and ");
    else
        rig_record(rig_path("a.ply"), mesh, 0, &err);

    rig_begin();
    grid_rig_begin_scan(1, 1);
    grid_rig_put_step(0);
    refused("a.ply", (struct recorder_options){.sparse_per_m2 = 1e9, .sparse_seed = 1}, SH_EINPUT,
            "6.828 m2 of mesh would get 6.828e+09 points; a file holds 2147483647: give at most 3.14e+08");
    if (sysconf(_SC_PHYS_PAGES) * (sysconf(_SC_PAGESIZE) >> 20) < 200000) {
        rig_begin();
        grid_rig_begin_scan(1, 1);
        grid_rig_put_step(0);
        refused("a.ply", (struct recorder_options){.sparse_per_m2 = 3e8, .sparse_seed = 1}, SH_EINPUT,
                "6.828 m2 of mesh would get 2.049e+09 points; there is memory for ");
    }

    a = grid_rig_anchor(1); /* of a broken stream: coordinates are numbers, and areas are none */
    a.scale[0] = a.scale[1] = a.scale[2] = 1e200;
    d = grid_rig_descriptor(1);
    rig_begin();
    grid_rig_put_descriptor(&d);
    rig_anchor(&a);
    grid_rig_put_step(0);
    refused("a.ply", (struct recorder_options){.sparse_per_m2 = 1, .sparse_seed = 1}, SH_EINPUT,
            "--sparse 1: the mesh has an area of ");

    assert_int_equal(symlink("nowhere", rig_path("a.mtl")), 0); /* said before the scan, not after it */
    rig_begin();
    refused("a.obj", mesh, SH_EINPUT, "a.mtl: is a symbolic link");
    assert_int_equal(unlink(rig_path("a.mtl")), 0);

    refused("a#b.gltf", mesh, SH_EINPUT, "by URIs, where # has a special meaning");
    refused("a%b.gltf", mesh, SH_EINPUT, "by URIs, where % has a special meaning");

    rig_begin();
    grid_rig_begin_scan(1, 1);
    grid_rig_put_step(0);
    refused("a.fbx", (struct recorder_options){.long_edge = 1}, SH_EINPUT, "this scan has no triangles");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_can_be_no_mesh),
    };
    return cmocka_run_group_tests(tests, rig_set_up, rig_tear_down);
}
