/* SPDX-License-Identifier: MIT */
/* Files of meshes, character by character or number by number, as the formats' rules give them: Wavefront's .obj and
 * .mtl, .ply, glTF 2.0, and the axes and times of an FBX. */
#include <fcntl.h>
#include <jansson.h>
#include <math.h>

#include "core/bytes.h"
#include "core/studio/mesh.h"
#include "core/studio/picture.h"
#include "tests/unit/scene_files.h"

static const double xyz[4][3] = {{1, 2, 3}, {2.5, 2.125, 3.25}, {2.75, 4, 3.5}, {-7, 0.5, 1.75}};
static const uint32_t face[2][3] = {{0, 1, 2}, {3, 2, 0}};
static const float normal[4][3] = {{0.6f, 0, -0.8f}, {0, 0.6f, 0.8f}, {1, 0, 0}, {0, 0, -1}};
static const float uv[4][2] = {{0.125f, 0.25f}, {0.5f, 0}, {1, -1}, {0, 0.75f}};
static const uint8_t rgb[4][3] = {{255, 0, 0}, {0, 255, 0}, {0, 0, 255}, {255, 255, 0}};

static struct sh_err err;

static char *file_text(const char *name, size_t *len)
{
    FILE *in = fopen(path_in(name), "rb");
    if (in == NULL) fail_msg("no %s", name);
    char *text = calloc(1, 1 << 16);
    assert_non_null(text);
    *len = fread(text, 1, (1 << 16) - 1, in);
    fclose(in);
    assert_int_equal(unlink(path_in(name)), 0);
    return text;
}

static void write_ok(const char *name, const struct mesh *mesh)
{
    if (mesh_write(path_in(name), mesh, NULL, &err) != SH_OK) fail_msg("%s", err.text);
}

static void expect_text(const char *name, const char *want)
{
    size_t len;
    char *text = file_text(name, &len);
    assert_string_equal(text, want);
    free(text);
}

static struct mesh small_mesh(void)
{
    return (struct mesh){.n_vertices = 4, .n_faces = 2, .xyz_m = xyz, .face = face};
}

/* Normals, texture coordinates and both are named by the form of a face: v//n, v/t, v/t/n. */
static void obj_faces_name_what_there_is(void **state)
{
    (void)state;
    static const char *const comment[2] = {"first", "two\x7fin one"};
    struct mesh mesh = small_mesh();
    mesh.comment = comment;
    mesh.n_comments = 2;
    write_ok("a.obj", &mesh);
    expect_text("a.obj", "# first\n# two?in one\no a\nv 1 2 3\nv 2.5 2.125 3.25\nv 2.75 4 3.5\nv -7 0.5 1.75\n"
                         "f 1 2 3\nf 4 3 1\n");
    mesh.n_comments = 0;
    mesh.normal = normal;
    write_ok("b.c.obj", &mesh);
    expect_text("b.c.obj", "o b.c\nv 1 2 3\nvn 0.6 0 -0.8\nv 2.5 2.125 3.25\nvn 0 0.6 0.8\nv 2.75 4 3.5\nvn 1 0 0\n"
                           "v -7 0.5 1.75\nvn 0 0 -1\nf 1//1 2//2 3//3\nf 4//4 3//3 1//1\n");
    mesh.uv = uv;
    write_ok("a.obj", &mesh);
    expect_text("a.obj", "o a\nv 1 2 3\nvt 0.125 0.25\nvn 0.6 0 -0.8\nv 2.5 2.125 3.25\nvt 0.5 0\nvn 0 0.6 0.8\n"
                         "v 2.75 4 3.5\nvt 1 -1\nvn 1 0 0\nv -7 0.5 1.75\nvt 0 0.75\nvn 0 0 -1\n"
                         "f 1/1/1 2/2/2 3/3/3\nf 4/4/4 3/3/3 1/1/1\n");
}

/* A texture makes a library of materials. Each part has its own material, with a texture or without. White surfaces
 * without gloss show the texture as it is. */
static void obj_materials(void **state)
{
    (void)state;
    static const uint32_t apart[2][3] = {{0, 1, 2}, {3, 3, 3}};
    static const struct mesh_part part[2] = {{"first one", 3, 1, NULL, NULL}, {"second", 1, 1, "b.png", NULL}};
    struct mesh mesh = small_mesh();
    mesh.uv = uv;
    mesh.texture = "pic\nture.png";
    write_ok("a.obj", &mesh);
    expect_text("a.obj",
                "mtllib a.mtl\no a\nv 1 2 3\nvt 0.125 0.25\nv 2.5 2.125 3.25\nvt 0.5 0\nv 2.75 4 3.5\nvt 1 -1\n"
                "v -7 0.5 1.75\nvt 0 0.75\nusemtl a\nf 1/1 2/2 3/3\nf 4/4 3/3 1/1\n");
    expect_text("a.mtl", "newmtl a\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\nmap_Kd pic?ture.png\n");
    mesh.texture = NULL;
    mesh.face = apart;
    mesh.part = part;
    mesh.n_parts = 2;
    write_ok("a.obj", &mesh);
    expect_text("a.obj", "mtllib a.mtl\no first one\nv 1 2 3\nvt 0.125 0.25\nv 2.5 2.125 3.25\nvt 0.5 0\nv 2.75 4 3.5\n"
                         "vt 1 -1\nusemtl first one\nf 1/1 2/2 3/3\no second\nv -7 0.5 1.75\nvt 0 0.75\n"
                         "usemtl second\nf 4/4 4/4 4/4\n");
    expect_text("a.mtl", "newmtl first one\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\n"
                         "newmtl second\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\nmap_Kd b.png\n");
}

/* All that a vertex can have, as text. A float has up to nine digits, since that is enough to get it back. */
static void ply_text_of_all_columns(void **state)
{
    (void)state;
    static const double time[4] = {-INFINITY, -2.5, 0, 1e-9};
    static const float level[4] = {0.1f, NAN, -1.5f, 16777216.0f};
    static const uint16_t label[4] = {0, 1, 256, 65535};
    const struct mesh_scalar scalar[3] = {
        {"time", time, MESH_DOUBLE}, {"level", level, MESH_FLOAT}, {"label", label, MESH_UINT16}};
    struct mesh mesh = {.n_vertices = 4,
                        .xyz_m = xyz,
                        .normal = normal,
                        .rgb = rgb,
                        .uv = uv,
                        .texture = "a.png",
                        .scalar = scalar,
                        .n_scalars = 3,
                        .ascii = 1};
    write_ok("a.ply", &mesh);
    expect_text("a.ply", "ply\nformat ascii 1.0\ncomment TextureFile a.png\nelement vertex 4\nproperty double x\n"
                         "property double y\nproperty double z\nproperty float nx\nproperty float ny\n"
                         "property float nz\nproperty uchar red\nproperty uchar green\nproperty uchar blue\n"
                         "property float s\nproperty float t\nproperty double time\nproperty float level\n"
                         "property ushort label\nend_header\n"
                         "1 2 3 0.600000024 0 -0.800000012 255 0 0 0.125 0.25 -inf 0.100000001 0\n"
                         "2.5 2.125 3.25 0 0.600000024 0.800000012 0 255 0 0.5 0 -2.5 nan 1\n"
                         "2.75 4 3.5 1 0 0 0 0 255 1 -1 0 -1.5 256\n"
                         "-7 0.5 1.75 0 0 -1 255 255 0 0 0.75 0.000000001 16777216 65535\n");
}

/* The same in bytes: little-endian, in the order of the header, a face after its vertices. */
static void ply_bytes_of_all_columns(void **state)
{
    (void)state;
    static const uint8_t face_rgb[2][3] = {{10, 20, 30}, {40, 50, 60}};
    static const uint16_t label[4] = {0, 1, 256, 65535};
    const struct mesh_scalar scalar[1] = {{"label", label, MESH_UINT16}};
    struct mesh mesh = small_mesh();
    mesh.normal = normal;
    mesh.rgb = rgb;
    mesh.uv = uv;
    mesh.face_rgb = face_rgb;
    mesh.scalar = scalar;
    mesh.n_scalars = 1;
    write_ok("a.ply", &mesh);
    size_t len;
    char *file = file_text("a.ply", &len);
    const char *p = memmem(file, len, "end_header\n", 11);
    assert_non_null(p);
    p += 11;
    assert_int_equal(file + len - p, 4 * (24 + 12 + 3 + 8 + 2) + 2 * (1 + 12 + 3));
    for (int i = 0; i < 4; i++) {
        assert_memory_equal(p, xyz[i], 24);
        assert_memory_equal(p + 24, normal[i], 12);
        assert_memory_equal(p + 36, rgb[i], 3);
        assert_memory_equal(p + 39, uv[i], 8);
        assert_memory_equal(p + 47, &label[i], 2);
        p += 49;
    }
    for (int i = 0; i < 2; i++) {
        assert_int_equal(*p, 3);
        assert_memory_equal(p + 1, face[i], 12);
        assert_memory_equal(p + 13, face_rgb[i], 3);
        p += 16;
    }
    free(file);
}

/* Eight figures per vertex are allowed, and nine are not. */
static void ply_has_up_to_eight_figures(void **state)
{
    (void)state;
    static const double value[4] = {1, 2, 3, 4};
    static const char *const name[9] = {"a", "b", "c", "d", "e", "f", "g", "h", "i"};
    struct mesh_scalar scalar[9];
    struct mesh mesh = small_mesh();
    size_t len;
    for (int k = 0; k < 9; k++)
        scalar[k] = (struct mesh_scalar){name[k], value, MESH_DOUBLE};
    mesh.scalar = scalar;
    mesh.n_scalars = 8;
    mesh.ascii = 1;
    write_ok("a.ply", &mesh);
    char *text = file_text("a.ply", &len);
    assert_non_null(strstr(text, "\n-7 0.5 1.75 4 4 4 4 4 4 4 4\n"));
    free(text);
    mesh.n_scalars = 9;
    assert_int_equal(mesh_write(path_in("a.ply"), &mesh, NULL, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "9 figures per vertex; allowed are up to 8"));
    assert_int_equal(access(path_in("a.ply"), F_OK), -1);
}

/* ---- glTF */

static const json_t *item(const json_t *root, const char *list, size_t i)
{
    const json_t *found = json_array_get(json_object_get(root, list), i);
    if (found == NULL) fail_msg("no %s %zu", list, i);
    return found;
}

static double number(const json_t *object, const char *key)
{
    const json_t *value = json_object_get(object, key);
    if (!json_is_number(value)) fail_msg("no number %s", key);
    return json_number_value(value);
}

static const char *string(const json_t *object, const char *key)
{
    return json_string_value(json_object_get(object, key));
}

/* The bytes of an accessor of a mesh's attribute. */
static const char *attribute(const json_t *root, const char *bin, size_t mesh, const char *name, size_t *count)
{
    const json_t *primitive = item(item(root, "meshes", mesh), "primitives", 0);
    const json_t *accessor = item(root, "accessors", (size_t)number(json_object_get(primitive, "attributes"), name));
    const json_t *view = item(root, "bufferViews", (size_t)number(accessor, "bufferView"));
    const json_t *offset = json_object_get(accessor, "byteOffset"), *from = json_object_get(view, "byteOffset");
    *count = (size_t)number(accessor, "count");
    return bin + json_integer_value(offset) + json_integer_value(from);
}

/* Each vertex, whatever the order: readers of glTF may get them sorted by another rule. */
static void expect_vertex(const json_t *root, const char *bin, size_t mesh, uint32_t v)
{
    size_t n, n_normal, n_uv;
    const char *place = attribute(root, bin, mesh, "POSITION", &n);
    const char *normals = attribute(root, bin, mesh, "NORMAL", &n_normal);
    const char *uvs = attribute(root, bin, mesh, "TEXCOORD_0", &n_uv);
    /* y up: (x, y, z) is (x, z, -y) there; v counts from the image's upper edge */
    const double want[8] = {xyz[v][0],
                            xyz[v][2],
                            -xyz[v][1],
                            (double)normal[v][0],
                            (double)normal[v][2],
                            -(double)normal[v][1],
                            (double)uv[v][0],
                            1 - (double)uv[v][1]};
    assert_true(n == n_normal && n == n_uv);
    for (size_t i = 0; i < n; i++) {
        float got[8];
        int same = 1;
        memcpy(got, place + 12 * i, 12);
        memcpy(got + 3, normals + 12 * i, 12);
        memcpy(got + 6, uvs + 8 * i, 8);
        for (int k = 0; k < 8; k++) /* normals are made unit vectors again */
            same &= fabs((double)got[k] - want[k]) < 1e-6;
        if (same) return;
    }
    fail_msg("mesh %zu has no vertex %u", mesh, v);
}

static void gltf_as_json(void **state)
{
    (void)state;
    static const uint32_t apart[2][3] = {{0, 1, 2}, {3, 4, 5}};
    static const struct mesh_part part[3] = {
        {"first", 3, 1, NULL, NULL}, {"empty", 0, 0, NULL, NULL}, {"second", 1, 0, NULL, NULL}};
    struct mesh mesh = small_mesh();
    struct mesh_part textured[3];
    size_t len, bin_len;
    memcpy(textured, part, sizeof part);
    textured[0].texture = "one.png";
    mesh.face = apart;
    mesh.n_faces = 1;
    mesh.normal = normal;
    mesh.uv = uv;
    mesh.part = textured;
    mesh.n_parts = 3;
    write_ok("a.gltf", &mesh);
    char *text = file_text("a.gltf", &len), *bin = file_text("a.bin", &bin_len);
    json_error_t why;
    json_t *root = json_loadb(text, len, 0, &why);
    if (root == NULL) fail_msg("%s", why.text);
    assert_int_equal(json_array_size(json_object_get(root, "meshes")), 1); /* parts without a face are left out */
    assert_int_equal(json_array_size(json_object_get(root, "materials")), 1);
    assert_non_null(strstr(string(item(root, "meshes", 0), "name"), "first"));
    for (uint32_t v = 0; v < 3; v++)
        expect_vertex(root, bin, 0, v);
    int named = 0;
    for (size_t i = 0; i < json_array_size(json_object_get(root, "nodes")); i++)
        named += strcmp(string(item(root, "nodes", i), "name"), "first") == 0;
    assert_int_equal(named, 1);
    const json_t *material = item(root, "materials", 0), *pbr = json_object_get(material, "pbrMetallicRoughness");
    assert_string_equal(string(material, "name"), "first");
    /* glTF's default of metal and roughness is 1, and of the colour is white: they may be left out. */
    const json_t *rough = json_object_get(pbr, "roughnessFactor"), *colour = json_object_get(pbr, "baseColorFactor");
    assert_true(rough == NULL || json_number_value(rough) == 1.0);
    for (size_t k = 0; k < json_array_size(colour); k++)
        assert_true(json_number_value(json_array_get(colour, k)) == 1.0);
    const json_t *texture = item(root, "textures", (size_t)number(json_object_get(pbr, "baseColorTexture"), "index"));
    assert_string_equal(string(item(root, "images", (size_t)number(texture, "source")), "uri"), "one.png");
    json_decref(root);
    free(text);
    free(bin);
}

/* ---- FBX */

/* The whole number of a property of the settings: its name, "int", "Integer" and flags are strings before it. */
static int32_t setting(const char *fbx, size_t len, const char *name)
{
    char begin[64];
    const int n = snprintf(begin, sizeof begin, "S%c%c%c%c%s", (int)strlen(name), 0, 0, 0, name);
    const char *p = memmem(fbx, len, begin, (size_t)n);
    if (p == NULL) fail_msg("no %s", name);
    p += n;
    while (*p == 'S')
        p += 5 + le_get32((const uint8_t *)p + 1);
    assert_int_equal(*p, 'I');
    return (int32_t)le_get32((const uint8_t *)p + 1);
}

static int32_t time_of(const char *fbx, size_t len, const char *name)
{
    char node[32];
    const int n = snprintf(node, sizeof node, "%c%sI", (int)strlen(name), name);
    const char *at = memmem(fbx, len, "CreationTimeStamp", 17);
    assert_non_null(at);
    const char *p = memmem(at, len - (size_t)(at - fbx), node, (size_t)n);
    if (p == NULL) fail_msg("no %s", name);
    return (int32_t)le_get32((const uint8_t *)p + n);
}

/* z is up, the front is -y, x is to the right. The time is 1970-01-01 10:00:00.000. */
static void fbx_axes_and_time(void **state)
{
    (void)state;
    static const struct {
        const char *name;
        int32_t want;
    } axis[] = {{"UpAxis", 2},    {"UpAxisSign", 1},    {"FrontAxis", 1},      {"FrontAxisSign", -1},
                {"CoordAxis", 0}, {"CoordAxisSign", 1}, {"OriginalUpAxis", 2}, {"OriginalUpAxisSign", 1}},
      time[] = {{"Version", 1000}, {"Year", 1970}, {"Month", 1},  {"Day", 1},
                {"Hour", 10},      {"Minute", 0},  {"Second", 0}, {"Millisecond", 0}};
    const struct mesh mesh = small_mesh();
    size_t len;
    write_ok("a.fbx", &mesh);
    char *fbx = file_text("a.fbx", &len);
    for (size_t i = 0; i < sizeof axis / sizeof axis[0]; i++)
        if (setting(fbx, len, axis[i].name) != axis[i].want) fail_msg("%s", axis[i].name);
    for (size_t i = 0; i < sizeof time / sizeof time[0]; i++)
        if (time_of(fbx, len, time[i].name) != time[i].want) fail_msg("%s", time[i].name);
    free(fbx);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(obj_faces_name_what_there_is),
        cmocka_unit_test(obj_materials),
        cmocka_unit_test(ply_text_of_all_columns),
        cmocka_unit_test(ply_bytes_of_all_columns),
        cmocka_unit_test(ply_has_up_to_eight_figures),
        cmocka_unit_test(gltf_as_json),
        cmocka_unit_test(fbx_axes_and_time),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
