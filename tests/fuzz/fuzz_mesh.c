/* SPDX-License-Identifier: MIT */
/* This fuzzes the program's own mesh readers: .obj with its library of materials, .ply, .stl, and the parts of .ifc and
 * .tif that it reads itself. The input is a byte (which, how), then the file. For an .obj the text after the line
 * `#mtl` is its library in.mtl. A scene that is made must be whole. A refusal must be one line that names the file. */
#include <math.h>
#include <string.h>

#include "core/geotiff.h"
#include "core/ifc_site.h"
#include "core/scene.h"
#include "core/import/ifc/ifc_records.h"
#include "tests/fuzz/rig.h"

static void check_scene(const struct scene *s)
{
    fuzz_must(s->n_triangles > 0 && s->n_surfaces > 0, "a scene has triangles and surfaces");
    for (uint32_t i = 0; i < s->n_triangles; i++) {
        fuzz_must(s->label[i] < s->n_surfaces, "labels are surfaces");
        for (int c = 0; c < 3; c++) {
            fuzz_must(s->triangle[i][c] < s->n_vertices, "corners are vertices");
            for (int k = 0; k < 3; k++)
                fuzz_must(isfinite(s->vertex_m[s->triangle[i][c]][k]), "vertices are finite");
        }
    }
    for (uint32_t i = 0; i < s->n_surfaces; i++) {
        fuzz_must(memchr(s->surface[i].object, '\0', SCENE_NAME_LEN) != NULL, "names end");
        fuzz_must(s->surface[i].texture <= s->n_textures && s->surface[i].opacity <= s->n_textures,
                  "textures are there");
    }
}

static void load(const char *path, unsigned how)
{
    struct scene_mesh_spec spec = {.file = path,
                                   .up = (how & 1) != 0 ? SCENE_UP_Y : SCENE_UP_Z,
                                   .scale = (how & 2) != 0 ? 0.001 : 1.0,
                                   .textures = how >> 2 & 1,
                                   .cutouts = how >> 3 & 1};
    struct scene *scene = NULL;
    struct sh_err err = {0};
    if (scene_load(&spec, 1, 1.0, &fuzz_report, &scene, &err) == SH_OK)
        check_scene(scene);
    else
        fuzz_must_be_line(&err);
    scene_free(scene);
}

static void load_ifc(const uint8_t *data, size_t size)
{
    const char *path = fuzz_file(".ifc", data, size);
    struct ifc_site site;
    struct sh_err err = {0};
    struct ifc_records records;
    if (ifc_records_open(&records, path, &err) != SH_OK) fuzz_must_be_line(&err);
    ifc_records_close(&records);
    if (ifc_site_read(path, &site, &err) == SH_OK)
        fuzz_must(fabs(site.lat_deg) <= 90 && fabs(site.lon_deg) <= 180 && isfinite(site.north_deg),
                  "a place on the Earth");
    else
        fuzz_must_be_line(&err);
}

static void load_tif(const uint8_t *data, size_t size)
{
    struct geotiff g;
    struct sh_err err = {0};
    if (geotiff_read(fuzz_file(".tif", data, size), &g, &err) != SH_OK) {
        fuzz_must_be_line(&err);
        return;
    }
    fuzz_must(g.width >= 2 && g.height >= 2, "a raster has cells");
}

static void load_obj(const uint8_t *data, size_t size, unsigned how)
{
    const uint8_t *at = size > 5 ? memmem(data, size, "\n#mtl\n", 6) : NULL;
    const size_t own = at != NULL ? (size_t)(at - data) : size;
    fuzz_file(".mtl", at != NULL ? at + 6 : data, at != NULL ? size - own - 6 : 0);
    load(fuzz_file(".obj", data, own), how);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    struct fuzz_bytes in = {data, size};
    const unsigned how = fuzz_u8(&in);
    if (in.n > 1 << 15) return 0;
    switch (how >> 6) {
    case 0:
        load_obj(in.p, in.n, how);
        break;
    case 1:
        load(fuzz_file(".ply", in.p, in.n), how);
        break;
    case 2:
        load(fuzz_file(".stl", in.p, in.n), how);
        break;
    default: /* their first bytes tell .tif and .ifc apart */
        if (in.n > 1 && in.p[0] == in.p[1])
            load_tif(in.p, in.n);
        else
            load_ifc(in.p, in.n);
        break;
    }
    return 0;
}
