/* SPDX-License-Identifier: MIT */
/* Formats that come through Assimp: node tree, names, axes and units, single precision, broken files. */
#include <fcntl.h>
#include <math.h>
#include <sys/stat.h>

#include <assimp/cimport.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include "tests/common/collada.h"
#include "tests/unit/scene_files.h"

#define MODELS "/usr/share/assimp/models/"

/* Models of Debian's assimp-testmodels. */
static bool is_missing(const char *file)
{
    if (access(file, R_OK) == 0) return false;
    print_message("skipped: %s is missing (package assimp-testmodels)\n", file);
    return true;
}

#define SKIP_WITHOUT(file)            \
    do {                              \
        if (is_missing(file)) skip(); \
    } while (0)

static const char *stl_text(double x, double y, const char *z)
{
    static char text[512];
    snprintf(text, sizeof text,
             "solid hall\nfacet normal 0 0 1\nouter loop\nvertex %.1f %.1f 0\nvertex %.1f %.1f %s\n"
             "vertex %.1f %.1f 0\nendloop\nendfacet\nendsolid hall\n",
             x, y, x + 1, y, z, x, y + 1);
    return text;
}

static void stl_is_read(void **state)
{
    (void)state;
    struct scene *s = load_text("a.STL", stl_text(10, 15, "0.5"));
    static const double v[3][3] = {{10, 15, 0}, {11, 15, 0.5}, {10, 16, 0}};
    assert_int_equal(s->n_triangles, 1);
    assert_int_equal(s->n_meshes, 1);
    assert_memory_equal(s->vertex_m, v, sizeof v);
    assert_string_equal(s->surface[0].object, "hall");
    assert_int_equal(n_warnings, 0);
    scene_free(s);
}

/* 5.8e6 * 6e-8 = 0.35 m is refused where it is not allowed, with the figures. */
static void single_precision_is_refused(void **state)
{
    (void)state;
    static const char text[] = COLLADA_TRIANGLE("500000 5800000 0 500001 5800000 0 500000 5800001 0");
    refuse("utm.dae", text, strlen(text),
           "coordinates up to 5800001 are read in single precision, with errors up to 0.35 m; allowed are 0.001 m");
    struct scene *s;
    struct sh_err err;
    struct scene_mesh_spec spec = {.file = write_text("utm.dae", text), .scale = 1};
    assert_int_equal(load_spec(&spec, 0.36, &s, &err), SH_OK);
    scene_free(s);
    spec.scale = 1e-3; /* in millimetres it is good enough */
    assert_int_equal(load_spec(&spec, 1e-3, &s, &err), SH_OK);
    scene_free(s);
    unlink(path);
}

/* A large shift that a node below undoes has rounded the coordinates all the same. */
static void single_precision_within_the_tree(void **state)
{
    (void)state;
    static const char text[] =
        "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
        "<asset><unit meter=\"1\"/><up_axis>Y_UP</up_axis></asset><library_geometries><geometry id=\"g\"><mesh>"
        "<source id=\"p\"><float_array id=\"pa\" count=\"9\">0 0 0 1 0 0 0 1 0</float_array><technique_common>"
        "<accessor source=\"#pa\" count=\"3\" stride=\"3\"><param name=\"X\" type=\"float\"/>"
        "<param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/></accessor></technique_common></source>"
        "<vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices><triangles count=\"1\">"
        "<input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>0 1 2</p></triangles></mesh></geometry>"
        "</library_geometries><library_visual_scenes><visual_scene id=\"s\"><node id=\"o\" name=\"out\">"
        "<translate>-500000 0 0</translate><node id=\"n\" name=\"back\"><translate>500000 0 0</translate>"
        "<instance_geometry url=\"#g\"/></node></node></visual_scene></library_visual_scenes>"
        "<scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>";
    refuse("tree.dae", text, sizeof text - 1, "coordinates up to 500001 are read in single precision");
    struct scene *s;
    struct sh_err err;
    const struct scene_mesh_spec spec = {.file = write_text("tree.dae", text), .scale = 1};
    assert_int_equal(load_spec(&spec, 1, &s, &err), SH_OK);
    unlink(path);
    static const double v[3][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
    assert_memory_equal(s->vertex_m, v, sizeof v);
    assert_string_equal(s->surface[0].object, "back");
    scene_free(s);
}

/* glTF's colours are linear: 0.2140 of the light is 0.5 in sRGB. The colour that Assimp invents for STL does not
 * count. */
static void colours_come_with_materials(void **state)
{
    (void)state;
    static const char text[] =
        "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
        "\"materials\":[{\"name\":\"paint\",\"pbrMetallicRoughness\":{\"baseColorFactor\":[0.21404114,1,0,1]}}],"
        "\"meshes\":[{\"name\":\"m\",\"primitives\":[{\"attributes\":{\"POSITION\":0},\"material\":0}]}],"
        "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}],"
        "\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],"
        "\"buffers\":[{\"byteLength\":36,\"uri\":\"data:application/octet-stream;base64,"
        "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\"}]}";
    struct scene *s = load_text("paint.gltf", text);
    assert_string_equal(s->surface[0].material, "paint");
    assert_int_equal(s->surface[0].has_colour, 1);
    assert_true(fabs((double)s->surface[0].colour[0] - 0.5) < 1e-6 &&
                fabs((double)s->surface[0].colour[1] - 1.0) < 1e-6 && s->surface[0].colour[2] == 0.0f);
    scene_free(s);
    s = load_text("a.stl", stl_text(0, 0, "0"));
    assert_int_equal(s->surface[0].has_colour, 0);
    scene_free(s);
}

/* Loads a triangle of Collada, whose material `glow` has a colour and more, in XML. */
static struct scene *load_glow(const char *colour, const char *more)
{
    static const char whole[] = COLLADA_TRIANGLE("0 0 0 1 0 0 0 1 0");
    const char *geometry = strstr(whole, "<library_geometries>"), *count = strstr(whole, " count=\"1\"><input");
    const char *end = strstr(whole, "/></node>");
    char text[4096];
    snprintf(text, sizeof text,
             "%.*s<library_effects><effect id=\"e\"><profile_COMMON><technique sid=\"t\"><lambert><diffuse>"
             "<color>%s 1</color></diffuse>%s</lambert></technique></profile_COMMON></effect></library_effects>"
             "<library_materials><material id=\"m\" name=\"glow\"><instance_effect url=\"#e\"/></material>"
             "</library_materials>%.*s material=\"slot\"%.*s><bind_material><technique_common>"
             "<instance_material symbol=\"slot\" target=\"#m\"/></technique_common></bind_material>"
             "</instance_geometry>%s",
             (int)(geometry - whole), whole, colour, more, (int)(count - geometry), geometry, (int)(end - count), count,
             end + strlen("/>"));
    struct scene *s = load_text("a.dae", text);
    assert_string_equal(s->surface[0].material, "glow");
    return s;
}

/* A colour beyond 0 to 1 is one of light, not of a surface. */
static void colours_beyond_their_range_are_left_out(void **state)
{
    (void)state;
    static const char *const wrong[] = {"2 0.5 0.5", "0.5 1.5 0.5", "0.5 0.5 -0.5"};
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
        struct scene *s = load_glow(wrong[i], "");
        assert_int_equal(s->surface[0].has_colour, 0);
        assert_int_equal(n_warnings, 1);
        if (strstr(warnings, "1 material with a colour beyond 0 to 1, which is left out; the first is 'glow'") == NULL)
            fail_msg("%s", warnings);
        scene_free(s);
    }
}

/* Colours of Collada are as they are shown. With A_ONE an opacity of 1 is opaque. */
static void colours_and_transparency_of_collada(void **state)
{
    (void)state;
    static const struct {
        const char *opacity;
        float clear;
    } cases[] = {{"1", 0.0f}, {"0.25", 0.75f}, {"0", 1.0f}};
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        char more[200];
        snprintf(more, sizeof more,
                 "<transparent opaque=\"A_ONE\"><color>0 0 0 1</color></transparent>"
                 "<transparency><float>%s</float></transparency>",
                 cases[i].opacity);
        struct scene *s = load_glow("0 0.25 1", more);
        const struct scene_surface *surface = &s->surface[0];
        assert_int_equal(n_warnings, 0);
        assert_int_equal(surface->has_colour, 1);
        assert_true(surface->colour[0] == 0.0f && surface->colour[1] == 0.25f && surface->colour[2] == 1.0f);
        assert_true(surface->clear == cases[i].clear);
        scene_free(s);
    }
}

static void broken_files_are_refused(void **state)
{
    (void)state;
    static const char *const names[] = {"a.stl", "a.gltf", "a.glb", "a.fbx", "a.dae", "a.ifc"};
    for (size_t i = 0; i < 6; i++) {
        refuse(names[i], "", 0, ": ");
        refuse(names[i], "garbage\nin two lines\n", 21, ": ");
    }
    const char *text = stl_text(0, 0, "nan");
    refuse("nan.stl", text, strlen(text), "vertex 2 (1 0 nan) is not finite");
    text = stl_text(2e9, 0, "0");
    struct scene *s;
    struct sh_err err;
    struct scene_mesh_spec spec = {.file = write_text("far.stl", text), .scale = 1};
    assert_int_equal(load_spec(&spec, 1e6, &s, &err), SH_EINPUT);
    unlink(path);
    assert_non_null(strstr(err.text, "far.stl"));
    assert_non_null(strstr(err.text, "allowed are coordinates up to 1e+09 m"));
    refuse("cut.ifc", "ISO-10303-21;\nHEADER;\n", 22, "cut off: it doesn't end with END-ISO-10303-21;");
    spec.file = "/nowhere/a.stl";
    assert_int_equal(load_spec(&spec, 1, &s, &err), SH_EINPUT);
    assert_string_equal(err.text, "/nowhere/a.stl: No such file or directory");
}

/* Khronos' boxes: a cube of edge 1 about the origin. */
static void boxes(void **state)
{
    (void)state;
    static const char *const files[] = {MODELS "glTF2/BoxTextured-glTF-Binary/BoxTextured.glb",
                                        MODELS "glTF2/BoxTextured-glTF/BoxTextured.gltf",
                                        MODELS "Collada/cube_triangulate.dae", MODELS "FBX/phong_cube.fbx"};
    for (size_t i = 0; i < 4; i++) {
        SKIP_WITHOUT(files[i]);
        struct scene *s = load(files[i]);
        assert_int_equal(s->n_triangles, 12);
        assert_int_equal(s->n_surfaces, 1);
        for (int k = 0; k < 3; k++) /* floats: 2^-24 of the size */
            assert_true(fabs(s->min_m[k] + 0.5) < 1e-7 && fabs(s->max_m[k] - 0.5) < 1e-7);
        assert_true(fabs(total_area(s) - 6) < 1e-6);
        scene_free(s);
    }
}

/* Assimp applies Collada's unit (cube_triangulate.dae has centimetres and an edge of 100) and turns to y up. It does
 * not apply FBX's unit (global_settings.fbx has a factor of 500 and a cube from about -4 to 7). */
static void units(void **state)
{
    (void)state;
    const char *file = MODELS "FBX/global_settings.fbx";
    SKIP_WITHOUT(file);
    struct scene *s = load(file);
    assert_true(s->max_m[0] > 1 && s->max_m[0] < 50);
    assert_true(fabs(s->says.unit_m - 5.0) < 1e-6); /* its UnitScaleFactor is 500 cm */
    assert_int_equal(s->says.up, 2);
    scene_free(s);
    s = load_text("says.stl", stl_text(0, 0, "1"));
    assert_true(s->says.unit_m == 0);
    assert_int_equal(s->says.up, 0);
    scene_free(s);
    static const char z_up[] =
        "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" "
        "version=\"1.4.1\">"
        "<asset><unit meter=\"0.5\"/><up_axis>Z_UP</up_axis></asset><library_geometries><geometry "
        "id=\"g\"><mesh>"
        "<source id=\"p\"><float_array id=\"pa\" count=\"9\">0 0 8 2 0 8 0 4 "
        "8</float_array><technique_common>"
        "<accessor source=\"#pa\" count=\"3\" stride=\"3\"><param name=\"X\" type=\"float\"/>"
        "<param name=\"Y\" type=\"float\"/><param name=\"Z\" "
        "type=\"float\"/></accessor></technique_common></source>"
        "<vertices id=\"v\"><input semantic=\"POSITION\" source=\"#p\"/></vertices><triangles count=\"1\">"
        "<input semantic=\"VERTEX\" source=\"#v\" offset=\"0\"/><p>0 1 2</p></triangles></mesh></geometry>"
        "</library_geometries><library_visual_scenes><visual_scene id=\"s\"><node id=\"n\" name=\"wall\">"
        "<instance_geometry url=\"#g\"/></node></visual_scene></library_visual_scenes>"
        "<scene><instance_visual_scene url=\"#s\"/></scene></COLLADA>";
    struct sh_err err;
    struct scene_mesh_spec spec = {.file = write_text("z.dae", z_up), .up = SCENE_UP_Y, .scale = 1};
    assert_int_equal(load_spec(&spec, 1e-3, &s, &err), SH_OK);
    unlink(path);
    static const double v[3][3] = {{0, 0, 4}, {1, 0, 4}, {0, 2, 4}};
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            assert_true(s->vertex_m[i][k] == v[i][k]);
    assert_string_equal(s->surface[0].object, "wall");
    assert_true(s->says.unit_m == 1 && s->says.up == 2); /* as it comes out of Assimp */
    scene_free(s);
}

/* Measures a polygon's area and box. The area is half the length of the sum of its corners' cross products, from the
 * first corner. */
static double measure_polygon(const struct aiMesh *mesh, const struct aiFace *face, double low[3], double high[3])
{
    double p[2][3], base[3], sum[3] = {0};
    for (unsigned c = 0; c < face->mNumIndices; c++) {
        const struct aiVector3D *v = &mesh->mVertices[face->mIndices[c]];
        const double at[3] = {(double)v->x, (double)v->y, (double)v->z};
        if (c == 0) memcpy(base, at, sizeof base);
        for (int k = 0; k < 3; k++) {
            low[k] = fmin(low[k], at[k]);
            high[k] = fmax(high[k], at[k]);
            p[0][k] = p[1][k];
            p[1][k] = at[k] - base[k];
        }
        for (int k = 0; k < 3 && c > 1; k++)
            sum[k] += p[0][(k + 1) % 3] * p[1][(k + 2) % 3] - p[0][(k + 2) % 3] * p[1][(k + 1) % 3];
    }
    return 0.5 * sqrt(sum[0] * sum[0] + sum[1] * sum[1] + sum[2] * sum[2]);
}

/* Compares with Assimp's own flattening of the node tree, which the loader does itself. With `triangulate` it comes
 * after Assimp's triangulation. Without it the polygons stay, and the loader makes n - 2 triangles of the same area.
 * Warped quads need the first. Large polygons need the second: Assimp 5.4's triangulation leaves out a twentieth of
 * ConcavePolygon.dae. */
static void check_against_flattened(const char *file, unsigned triangulate)
{
    SKIP_WITHOUT(file);
    struct scene *s = load(file);
    const struct aiScene *flat = aiImportFile(file, aiProcess_PreTransformVertices | triangulate);
    assert_non_null(flat);
    uint64_t n_triangles = 0;
    double area = 0, low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
    for (unsigned m = 0; m < flat->mNumMeshes; m++) {
        const struct aiMesh *mesh = flat->mMeshes[m];
        for (unsigned f = 0; f < mesh->mNumFaces; f++) {
            if (mesh->mFaces[f].mNumIndices < 3) continue;
            n_triangles += mesh->mFaces[f].mNumIndices - 2;
            area += measure_polygon(mesh, &mesh->mFaces[f], low, high);
        }
    }
    aiReleaseImport(flat);
    assert_int_equal(s->n_triangles + s->counts.zero_area, n_triangles);
    double size = 0;
    for (int k = 0; k < 3; k++)
        size = fmax(size, fmax(fabs(low[k]), fabs(high[k])));
    /* Assimp multiplies the tree in float: some roundings of 6e-8 for each level. */
    for (int k = 0; k < 3; k++)
        assert_true(fabs(s->min_m[k] - low[k]) < 2e-6 * size && fabs(s->max_m[k] - high[k]) < 2e-6 * size);
    if (fabs(total_area(s) - area) > 1e-4 * area) fail_msg("%s: area %.9g, not %.9g", file, total_area(s), area);
    scene_free(s);
}

static void node_trees(void **state)
{
    (void)state;
    check_against_flattened(MODELS "glTF2/2CylinderEngine-glTF-Binary/2CylinderEngine.glb", aiProcess_Triangulate);
    check_against_flattened(MODELS "glTF2/textureTransform/TextureTransformTest.gltf", aiProcess_Triangulate);
    check_against_flattened(MODELS "Collada/teapot_instancenodes.DAE", aiProcess_Triangulate);
    check_against_flattened(MODELS "Collada/ConcavePolygon.dae", 0);
    check_against_flattened(MODELS "FBX/cubes_with_mirroring_and_pivot.fbx", aiProcess_Triangulate);
}

/* The house has lost its site, which other records refer to. Assimp crashes on it, and others leave out the records
 * that depend on it. */
static void ifc_with_a_record_missing(void **state)
{
    (void)state;
    const char *file = MODELS "IFC/AC14-FZK-Haus.ifc";
    SKIP_WITHOUT(file);
    char name[96];
    snprintf(name, sizeof name, "%s/cut.ifc", folder);
    FILE *from = fopen(file, "rb"), *to = fopen(name, "wb");
    static char line[1 << 16];
    assert_true(from != NULL && to != NULL);
    while (fgets(line, sizeof line, from) != NULL)
        if (strstr(line, "= IFCSITE(") == NULL) fputs(line, to);
    fclose(from);
    assert_int_equal(fclose(to), 0);
    struct sh_err err;
    struct scene *s;
    struct scene_mesh_spec spec = {.file = name, .up = SCENE_UP_Y, .scale = 1};
    assert_int_equal(load_spec(&spec, 1e-3, &s, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "IFCRELAGGREGATES #305266 refers to #567, but there is no such record"));
    unlink(name);
}

/* Nothing below main prints, not even Assimp's logger. */
static void nothing_is_printed(void **state)
{
    (void)state;
    static const char *const files[] = {MODELS "IFC/AC14-FZK-Haus.ifc",
                                        MODELS "FBX/spider.fbx",
                                        MODELS "STL/Spider_ascii.stl",
                                        MODELS "Collada/cube_emptyTags.dae",
                                        MODELS "glTF2/MissingBin/BoxTextured.gltf",
                                        MODELS "FBX/transparentTest.fbx"};
    SKIP_WITHOUT(files[0]);
    char name[96];
    snprintf(name, sizeof name, "%s/printed", folder);
    int sink = open(name, O_RDWR | O_CREAT | O_TRUNC, 0600);
    fflush(NULL);
    int out = dup(1), error = dup(2);
    dup2(sink, 1);
    dup2(sink, 2);
    for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
        struct scene *s;
        const struct scene_mesh_spec spec = {.file = files[i], .scale = 1};
        scene_load(&spec, 1, 1, NULL, &s, NULL);
        scene_free(s);
    }
    fflush(NULL);
    dup2(out, 1);
    dup2(error, 2);
    struct stat st;
    assert_int_equal(fstat(sink, &st), 0);
    close(sink);
    close(out);
    close(error);
    unlink(name);
    assert_int_equal(st.st_size, 0);
}

/* The files that a mesh names must be regular files, as the mesh itself. Opening a FIFO would wait; the limit of time
 * is there for a program that does so. */
static void a_buffer_must_be_a_file(void **state)
{
    (void)state;
    static const char *const kind[] = {"a FIFO, not a file", "a directory, not a file", "a device, not a file"};
    const struct scene_import_limits limits = {.memory_mib = 2048, .time_s = 20, .files = 64};
    for (int i = 0; i < 3; i++) {
        char buffer[96], says[160];
        struct scene *s = NULL;
        struct sh_err err = {0};
        snprintf(buffer, sizeof buffer, "%s/buffer.bin", folder);
        assert_int_equal(i == 0   ? mkfifo(buffer, 0600)
                         : i == 1 ? mkdir(buffer, 0700)
                                  : symlink("/dev/zero", buffer),
                         0);
        const struct scene_mesh_spec spec = {
            .file =
                write_text("a.gltf", "{\"asset\":{\"version\":\"2.0\"},\"scene\":0,\"scenes\":[{\"nodes\":[0]}],"
                                     "\"nodes\":[{\"mesh\":0}],\"meshes\":[{\"primitives\":[{\"attributes\":"
                                     "{\"POSITION\":0}}]}],\"accessors\":[{\"bufferView\":0,\"componentType\":5126,"
                                     "\"count\":3,\"type\":\"VEC3\"}],\"bufferViews\":[{\"buffer\":0,"
                                     "\"byteLength\":36}],\"buffers\":[{\"byteLength\":36,\"uri\":\"buffer.bin\"}]}"),
            .scale = 1,
            .limits = &limits};
        assert_int_equal(scene_load(&spec, 1, INFINITY, NULL, &s, &err), SH_EINPUT);
        snprintf(says, sizeof says, "a.gltf: %s: %s", buffer, kind[i]);
        remove(buffer);
        if (strstr(err.text, says) == NULL) fail_msg("%s", err.text);
    }
    unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stl_is_read),
        cmocka_unit_test(single_precision_is_refused),
        cmocka_unit_test(single_precision_within_the_tree),
        cmocka_unit_test(colours_come_with_materials),
        cmocka_unit_test(colours_beyond_their_range_are_left_out),
        cmocka_unit_test(colours_and_transparency_of_collada),
        cmocka_unit_test(broken_files_are_refused),
        cmocka_unit_test(boxes),
        cmocka_unit_test(units),
        cmocka_unit_test(node_trees),
        cmocka_unit_test(ifc_with_a_record_missing),
        cmocka_unit_test(a_buffer_must_be_a_file),
        cmocka_unit_test(nothing_is_printed),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
