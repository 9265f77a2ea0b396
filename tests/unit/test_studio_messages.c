/* SPDX-License-Identifier: MIT */
/* Messages about figures that maps, views, meshes, viewpoints and scenes of arrays can't take: whole lines, with each
 * figure in its place. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/scene.h"
#include "core/studio/decimate.h"
#include "core/studio/map.h"
#include "core/studio/mesh.h"
#include "core/studio/view.h"
#include "core/studio/viewpoint.h"
#include "tests/common/cases.h"

static struct sh_err err;

static void said(int rc, const char *want)
{
    assert_int_equal(rc, SH_EINPUT);
    assert_string_equal(err.text, want);
}

static void of_maps(void **state)
{
    (void)state;
    static const struct {
        struct map_spec spec;
        const char *says;
    } rows[] = {
        {{{NAN, 0}, {1, 1}, 0}, "map: the limits in x are not finite numbers of metres"},
        {{{0, 0}, {1, INFINITY}, 0}, "map: the limits in y are not finite numbers of metres"},
        {{{3, 0}, {2, 1}, 0}, "map: x from 3 m to 2 m; the second must not be smaller"},
        {{{0, 5}, {2, 4.5}, 0}, "map: y from 5 m to 4.5 m; the second must not be smaller"},
        {{{0, 0}, {1, 1}, -2}, "map: pixel size -2 m; allowed are sizes above 0, or 0: by the area"},
        {{{2, 3}, {2, 3}, 0}, "map: the area is a point (x 2 m, y 3 m); it needs an extent"},
        {{{0, 0}, {30000, 2}, 0.5}, "map: 30000 x 2 m at 0.5 m per pixel are 60000 x 4 pixels; use 1.9 m or more"},
        {{{0, 0}, {2, 30000}, 0.5}, "map: 2 x 30000 m at 0.5 m per pixel are 4 x 60000 pixels; use 1.9 m or more"},
    };
    struct map *map;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++)
        said(map_create(&rows[i].spec, &map, &err), rows[i].says);
    const struct map_spec good = {{1, 2}, {5, 9}, 0.5};
    assert_int_equal(map_create(&good, &map, &err), SH_OK);
    static const double beside[4][2] = {{0.5, 4}, {5.5, 4}, {3, 1.5}, {3, 9.5}};
    for (int i = 0; i < 4; i++) {
        char want[160];
        const struct map_station station = {.x_m = beside[i][0], .y_m = beside[i][1]};
        snprintf(want, sizeof want, "map: station at x %g m, y %g m; allowed x 1 to 5, y 2 to 9", beside[i][0],
                 beside[i][1]);
        said(map_add_station(map, &station, &err), want);
    }
    static const struct map_station station = {.x_m = 1, .y_m = 9};
    for (int i = 0; i < 4096; i++)
        assert_int_equal(map_add_station(map, &station, &err), SH_OK);
    said(map_add_station(map, &station, &err), "map: more than 4096 stations");
    map_free(map);
}

static const struct view_spec good_view = {{{1, 2, 3}, {4, 5, 6}, 1, 640, 480}, 0.01, 1};

static void of_views(void **state)
{
    (void)state;
    struct view *view;
    for (int axis = 0; axis < 6; axis++) {
        struct view_spec spec = good_view;
        char want[80];
        *(axis < 3 ? &spec.camera.eye_m[axis] : &spec.camera.look_at_m[axis - 3]) =
            axis % 2 == 0 ? (double)NAN : (double)INFINITY;
        snprintf(want, sizeof want, "view: %c of the eye or of its target is not finite", "xyz"[axis % 3]);
        said(view_create(&spec, &view, &err), want);
    }
    struct view_spec spec = good_view;
    memcpy(spec.camera.look_at_m, spec.camera.eye_m, sizeof spec.camera.eye_m);
    said(view_create(&spec, &view, &err), "view: the eye is at its target");
}

static void of_points_in_views(void **state)
{
    (void)state;
    struct view_spec spec;
    struct view *view;
    static const double points[][2] = {{-1, 1}, {2e9, 1}, {0.5, 0}, {0.5, 33}};
    for (int i = 0; i < 4; i++) {
        char want[160];
        spec = good_view;
        spec.point_m = points[i][0];
        spec.point_px = points[i][1];
        snprintf(want, sizeof want,
                 "view: points of %g m, at least %g pixels; allowed are 0 to 1e9 m, above 0 to 32 pixels", points[i][0],
                 points[i][1]);
        said(view_create(&spec, &view, &err), want);
    }
    static const double ends[2][2] = {{0, 0.5}, {1e9, 32}}; /* these are allowed */
    for (int i = 0; i < 2; i++) {
        spec = good_view;
        spec.point_m = ends[i][0];
        spec.point_px = ends[i][1];
        assert_int_equal(view_create(&spec, &view, &err), SH_OK);
        view_free(view);
    }
}

static void of_sizes_of_views(void **state)
{
    (void)state;
    struct view_spec spec;
    struct view *view;
    static const uint32_t size[][2] = {{15, 480}, {640, 15}, {8193, 16}, {16, 8193}, {8192, 2049}};
    for (int i = 0; i < 5; i++) {
        char want[120];
        spec = good_view;
        spec.camera.width = size[i][0];
        spec.camera.height = size[i][1];
        snprintf(want, sizeof want, "view: %u x %u pixels; allowed are 16 to 8192 a side, and 16777216 in all",
                 size[i][0], size[i][1]);
        said(view_create(&spec, &view, &err), want);
    }
    static const double fov[2][2] = {{0.0099, 0.01}, {2.81, 2.8}};
    for (int i = 0; i < 2; i++) {
        char want[80];
        spec = good_view;
        spec.camera.fov_rad = fov[i][0];
        snprintf(want, sizeof want, "view: field of view %g rad; allowed are 0.01 to 2.8", fov[i][0]);
        said(view_create(&spec, &view, &err), want);
        spec.camera.fov_rad = fov[i][1];
        assert_int_equal(view_create(&spec, &view, &err), SH_OK);
        view_free(view);
    }
}

/* None of these meshes is written. */
static void of_meshes(void **state)
{
    (void)state;
    static const double xyz[5][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {1, 1, 0}, {2, 2, 0}};
    static const uint32_t face[3][3] = {{0, 1, 2}, {1, 3, 2}, {2, 3, 4}};
    static const float uv[5][2];
    struct mesh_part part[2] = {{.name = "a", .n_vertices = 3, .n_faces = 1},
                                {.name = "b", .n_vertices = 2, .n_faces = 1}};
    const struct mesh good = {.n_vertices = 5, .n_faces = 2, .xyz_m = xyz, .face = face};
    struct mesh m = good;
    said(mesh_write("/x/a.stl", &m, NULL, &err),
         "/x/a.stl: no mesh format has this ending; allowed are .ply .obj .gltf .glb .fbx");
    m.n_faces = 0;
    said(mesh_write("/x/a.glb", &m, NULL, &err),
         "/x/a.glb: .glb holds meshes, but there are no faces; allowed for points are .ply .obj");
    m = good;
    m.texture = "t.png";
    said(mesh_write("/x/a.ply", &m, NULL, &err), "/x/a.ply: it has a texture but no texture coordinates");
    m.uv = uv;
    m.n_faces = 3;
    m.n_vertices = 4;
    said(mesh_write("/x/a.ply", &m, NULL, &err), "/x/a.ply: face 3 uses vertex 4; allowed are 0 to 3");
    m = good;
    m.part = part;
    m.n_parts = 2;
    said(mesh_write("/x/a.obj", &m, NULL, &err), "/x/a.obj: face 2 uses vertex 1; allowed are 3 to 4");
    part[1].n_vertices = 1;
    part[0].n_faces = 2;
    said(mesh_write("/x/a.obj", &m, NULL, &err), "/x/a.obj: face 2 uses vertex 3; allowed are 0 to 2");
    part[0].n_vertices = 4;
    part[1].n_faces = 0;
    part[1].n_vertices = 2;
    said(mesh_write("/x/a.obj", &m, NULL, &err), "/x/a.obj: its parts do not add up to its 5 vertices and 2 faces");
    m.n_parts = 65536;
    said(mesh_write("/x/a.obj", &m, NULL, &err), "/x/a.obj: 65536 parts; allowed are up to 65535");
    static const double low[3] = {-10, 0, -5e6}, high[3] = {0, 20, -5e6 + 20}; /* 2^-24 of it are 0.3 m */
    assert_int_equal(mesh_check_box("/x/a.obj", low, high, &err), SH_OK);
    said(
        mesh_check_box("/x/a.glb", low, high, &err),
        "/x/a.glb: .glb holds coordinates as float, which moves coordinates of 5000000 m by up to 0.3 m; allowed for a "
        "mesh of 30 m are 3e-05 m: write .ply or .obj, or keep coordinates near 0 (output.crs: local)");
    struct decimated out;
    const struct decimate_mesh coarse = {xyz, 5, face, 3};
    said(decimate(&coarse, 99, NULL, &out, &err), "a mesh of 99 triangles: allowed are 100 or more");
}

static void of_scenes(void **state)
{
    (void)state;
    static const double xyz[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    static uint32_t triangle[2][3] = {{0, 1, 2}, {0, 2, 1}};
    static uint16_t label[2];
    static struct scene_surface surface[2] = {{.object = "a"}, {.object = "b"}};
    struct scene_arrays a = {xyz, 3, (const uint32_t(*)[3])triangle, 2, label, surface, 2};
    struct scene *scene;
    a.n_surfaces = 0;
    said(scene_from_arrays(&a, &scene, &err), "arrays: 0 surfaces; allowed are 1 to 65534");
    a.n_surfaces = 65535;
    said(scene_from_arrays(&a, &scene, &err), "arrays: 65535 surfaces; allowed are 1 to 65534");
    a.n_surfaces = 2;
    label[1] = 2;
    said(scene_from_arrays(&a, &scene, &err), "arrays: triangle 1: label 2 out of range; there are 2 surfaces");
    label[1] = 1;
    triangle[1][2] = 3;
    said(scene_from_arrays(&a, &scene, &err), "arrays: triangle 1: index 3 out of range; there are 3 vertices");
    triangle[1][2] = 1;
    for (int name = 0; name < 2; name++) {
        memset(name == 0 ? surface[1].object : surface[1].material, 'x', SCENE_NAME_LEN);
        said(scene_from_arrays(&a, &scene, &err), "arrays: surface 1: a name has no end");
        memset(name == 0 ? surface[1].object : surface[1].material, 0, SCENE_NAME_LEN);
    }
    assert_int_equal(scene_from_arrays(&a, &scene, &err), SH_OK);
    scene_free(scene);
}

static void of_viewpoints(void **state)
{
    (void)state;
    static const struct viewpoint_view none[] = {{5, 4, 0.25, 1}, {5, 5, 0.25, 1}, {4, 5, 1, 0.25}, {4, 5, 1, 1}};
    struct viewpoint at;
    for (int i = 0; i < 4; i++) {
        char want[160];
        const struct viewpoint_view *v = &none[i];
        snprintf(want, sizeof want,
                 "viewpoint: a view of %g to %g m, %g to %g rad; each second limit must be above the first",
                 v->range_min_m, v->range_max_m, v->line_min_rad, v->line_max_rad);
        said(viewpoint_find(NULL, v, NULL, &at, &err), want);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(of_maps),           cmocka_unit_test(of_views),  cmocka_unit_test(of_points_in_views),
        cmocka_unit_test(of_sizes_of_views), cmocka_unit_test(of_meshes), cmocka_unit_test(of_scenes),
        cmocka_unit_test(of_viewpoints)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
