/* SPDX-License-Identifier: MIT */
/* Meshes of several files, and the numbers of glTF 2.0 and FBX. */
#include <jansson.h>
#include <math.h>
#include <sys/stat.h>

#include "core/bytes.h"
#include "core/studio/mesh/inside.h"
#include "core/studio/picture.h"
#include "tests/unit/mesh_rig.h"

/* ---- several files */

static struct picture image_of(uint8_t shade)
{
    const uint8_t rgb1[3] = {shade, 1, 2};
    struct picture image;
    assert_int_equal(picture_make(&image, 3, 2, rgb1, &rig_err), SH_OK);
    return image;
}

/* Images of parts are written beside the mesh, in its folder, under the names that its materials have. */
static void images_are_beside_the_mesh(void **state)
{
    (void)state;
    static const uint32_t apart[2][3] = {{0, 1, 2}, {3, 3, 3}};
    struct picture image[2] = {image_of(10), image_of(20)};
    const struct mesh_part part[2] = {{"first", 3, 1, "one.png", &image[0]}, {"second", 1, 1, "two.png", &image[1]}};
    struct mesh mesh = rig_mesh();
    char name[2][32] = {"sub/one.png", "sub/two.png"};
    size_t len;
    mesh.face = apart;
    mesh.uv = rig_uv;
    mesh.part = part;
    mesh.n_parts = 2;
    assert_int_equal(mkdir(path_in("sub"), 0700), 0);
    rig_write("sub/a.obj", &mesh);
    for (int i = 0; i < 2; i++) {
        char *want = NULL;
        size_t want_len = 0;
        FILE *out = open_memstream(&want, &want_len);
        assert_int_equal(picture_put_png(out, &image[i], &rig_err), SH_OK);
        fclose(out);
        char *png = rig_take(name[i], &len);
        assert_int_equal(len, want_len);
        assert_memory_equal(png, want, len);
        free(png);
        free(want);
        picture_free(&image[i]);
    }
    free(rig_take("sub/a.obj", &len));
    free(rig_take("sub/a.mtl", &len));
    assert_int_equal(rmdir(path_in("sub")), 0); /* nothing else is in it */
}

/* Someone makes a folder of the mesh's name while it is written. */
static int take_the_name(void *ctx)
{
    (void)ctx;
    mkdir(path_in("a.obj"), 0700);
    return 0;
}

/* Where the mesh can't get its name, its materials are removed again, although they have their names by then. */
static void no_file_stays_alone(void **state)
{
    (void)state;
    enum { MANY = 70000 }; /* it looks for a stop after each 2^16 rows */
    double(*many)[3] = calloc(MANY, sizeof *many);
    float(*many_uv)[2] = calloc(MANY, sizeof *many_uv);
    const struct sh_report report = {.stop = take_the_name};
    assert_true(many != NULL && many_uv != NULL);
    const struct mesh mesh = {.n_vertices = MANY,
                              .n_faces = 2,
                              .xyz_m = (const double(*)[3])many,
                              .face = rig_face,
                              .uv = (const float(*)[2])many_uv,
                              .texture = "a.png"};
    assert_true(mesh_write(path_in("a.obj"), &mesh, &report, &rig_err) < 0);
    assert_non_null(strstr(rig_err.text, "a.obj"));
    assert_int_equal(rmdir(path_in("a.obj")), 0);
    static const char *const name[] = {"a.obj", "a.obj.part", "a.mtl", "a.mtl.part"};
    for (int i = 0; i < 4; i++)
        if (access(path_in(name[i]), F_OK) == 0) fail_msg("%s is there", name[i]);
    free(many);
    free(many_uv);
}

static int stop_now(void *ctx)
{
    (void)ctx;
    return 1;
}

/* A stop among the vertices gives up the whole file, though its few faces would not ask for a stop. */
static void a_stop_among_vertices(void **state)
{
    (void)state;
    enum { MANY = 70000 };
    double(*many)[3] = calloc(MANY, sizeof *many);
    const struct sh_report report = {.stop = stop_now};
    assert_non_null(many);
    const struct mesh mesh = {.n_vertices = MANY, .n_faces = 2, .xyz_m = (const double(*)[3])many, .face = rig_face};
    static const char *const name[] = {"a.obj", "a.ply"};
    for (int i = 0; i < 2; i++) {
        assert_int_equal(mesh_write(path_in(name[i]), &mesh, &report, &rig_err), SH_ESTOPPED);
        assert_int_equal(access(path_in(name[i]), F_OK), -1);
    }
    free(many);
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

/* Finds the vertex, in whatever order the writer put them. */
static void expect_vertex(const json_t *root, const char *bin, size_t mesh, uint32_t v)
{
    size_t n, n_normal, n_uv;
    const char *place = attribute(root, bin, mesh, "POSITION", &n);
    const char *normals = attribute(root, bin, mesh, "NORMAL", &n_normal);
    const char *uvs = attribute(root, bin, mesh, "TEXCOORD_0", &n_uv);
    /* y up: (x, y, z) is (x, z, -y) there; v counts from the image's upper edge */
    const double want[8] = {rig_xyz[v][0],
                            rig_xyz[v][2],
                            -rig_xyz[v][1],
                            (double)rig_normal[v][0],
                            (double)rig_normal[v][2],
                            -(double)rig_normal[v][1],
                            (double)rig_uv[v][0],
                            1 - (double)rig_uv[v][1]};
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
    struct mesh mesh = rig_mesh();
    struct mesh_part textured[3];
    size_t len, bin_len;
    memcpy(textured, part, sizeof part);
    textured[0].texture = "one.png";
    mesh.face = apart;
    mesh.n_faces = 1;
    mesh.normal = rig_normal;
    mesh.uv = rig_uv;
    mesh.part = textured;
    mesh.n_parts = 3;
    rig_write("a.gltf", &mesh);
    char *text = rig_take("a.gltf", &len), *bin = rig_take("a.bin", &bin_len);
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
    const struct mesh mesh = rig_mesh();
    size_t len;
    rig_write("a.fbx", &mesh);
    char *fbx = rig_take("a.fbx", &len);
    for (size_t i = 0; i < sizeof axis / sizeof axis[0]; i++)
        if (setting(fbx, len, axis[i].name) != axis[i].want) fail_msg("%s", axis[i].name);
    for (size_t i = 0; i < sizeof time / sizeof time[0]; i++)
        if (time_of(fbx, len, time[i].name) != time[i].want) fail_msg("%s", time[i].name);
    free(fbx);
}

/* glTF has 12 bytes for a face, a position and a normal, 8 for texture coordinates and 16 for a colour, which an image
 * replaces. FBX has three normals of 24 bytes for a face, or three colours of 32. A refusal needs no vertex. */
static void files_of_four_gib_are_refused(void **state)
{
    (void)state;
    enum { N = 100000000 };
    static const struct mesh_format glb = {.ending = ".glb", .exporter = "glb2"},
                                    fbx = {.ending = ".fbx", .exporter = "fbx"};
    static const struct {
        const struct mesh_format *format;
        struct mesh mesh;
        const char *takes;
    } row[] = {
        {&glb, {.n_vertices = 4 * (N / 10) * 9, .n_faces = 0}, "0 faces and 360000000 vertices take 4.0 GiB; .glb"},
        {&glb,
         {.n_vertices = N, .n_faces = N, .normal = rig_normal, .uv = rig_uv},
         "100000000 faces and 100000000 vertices take 4.1 GiB; .glb"},
        {&glb,
         {.n_vertices = N, .n_faces = N, .normal = rig_normal, .uv = rig_uv, .rgb = rig_rgb, .texture = "a.png"},
         "vertices take 4.1 GiB; .glb"},
        {&glb, {.n_vertices = N, .n_faces = N, .normal = rig_normal, .rgb = rig_rgb}, "vertices take 4.8 GiB; .glb"},
        {&fbx, {.n_vertices = 4, .n_faces = N}, "and 4 vertices take 6.7 GiB in an array; .fbx"},
        {&fbx, {.n_vertices = 4, .n_faces = N, .rgb = rig_rgb}, "and 4 vertices take 8.9 GiB in an array; .fbx"}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct mesh_output out = {.path = "large"};
        struct mesh_work work = {0};
        struct sh_err err = {0};
        assert_int_equal(mesh_write_assimp(row[i].format, &out, &row[i].mesh, &work, &err), SH_EINPUT);
        if (strstr(err.text, row[i].takes) == NULL) fail_msg("'%s', not '%s'", err.text, row[i].takes);
        assert_non_null(strstr(err.text, " holds up to 4 GiB: write .ply or .obj, or scan more coarsely"));
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(images_are_beside_the_mesh), cmocka_unit_test(no_file_stays_alone),
        cmocka_unit_test(a_stop_among_vertices),      cmocka_unit_test(gltf_as_json),
        cmocka_unit_test(fbx_axes_and_time),          cmocka_unit_test(files_of_four_gib_are_refused),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
