/* SPDX-License-Identifier: MIT */
/* .obj, .mtl and .ply character by character, as the formats' rules give them. */
#include <math.h>

#include "tests/unit/mesh_rig.h"

static void expect_text(const char *name, const char *want)
{
    size_t len;
    char *text = rig_take(name, &len);
    assert_string_equal(text, want);
    free(text);
}

/* Normals, texture coordinates and both are named by the form of a face: v//n, v/t, v/t/n. */
static void obj_faces_name_what_there_is(void **state)
{
    (void)state;
    static const char *const comment[2] = {"first", "two\x7fin one"};
    struct mesh mesh = rig_mesh();
    mesh.comment = comment;
    mesh.n_comments = 2;
    rig_write("a.obj", &mesh);
    expect_text("a.obj", "# first\n# two?in one\no a\nv 1 2 3\nv 2.5 2.125 3.25\nv 2.75 4 3.5\nv -7 0.5 1.75\n"
                         "f 1 2 3\nf 4 3 1\n");
    mesh.n_comments = 0;
    mesh.normal = rig_normal;
    rig_write("b.c.obj", &mesh);
    expect_text("b.c.obj", "o b.c\nv 1 2 3\nvn 0.6 0 -0.8\nv 2.5 2.125 3.25\nvn 0 0.6 0.8\nv 2.75 4 3.5\nvn 1 0 0\n"
                           "v -7 0.5 1.75\nvn 0 0 -1\nf 1//1 2//2 3//3\nf 4//4 3//3 1//1\n");
    mesh.uv = rig_uv;
    rig_write("a.obj", &mesh);
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
    struct mesh mesh = rig_mesh();
    mesh.uv = rig_uv;
    mesh.texture = "pic\nture.png";
    rig_write("a.obj", &mesh);
    expect_text("a.obj",
                "mtllib a.mtl\no a\nv 1 2 3\nvt 0.125 0.25\nv 2.5 2.125 3.25\nvt 0.5 0\nv 2.75 4 3.5\nvt 1 -1\n"
                "v -7 0.5 1.75\nvt 0 0.75\nusemtl a\nf 1/1 2/2 3/3\nf 4/4 3/3 1/1\n");
    expect_text("a.mtl", "newmtl a\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\nmap_Kd pic?ture.png\n");
    mesh.texture = NULL;
    mesh.face = apart;
    mesh.part = part;
    mesh.n_parts = 2;
    rig_write("a.obj", &mesh);
    expect_text("a.obj", "mtllib a.mtl\no first one\nv 1 2 3\nvt 0.125 0.25\nv 2.5 2.125 3.25\nvt 0.5 0\nv 2.75 4 3.5\n"
                         "vt 1 -1\nusemtl first_one\nf 1/1 2/2 3/3\no second\nv -7 0.5 1.75\nvt 0 0.75\n"
                         "usemtl second\nf 4/4 4/4 4/4\n");
    expect_text("a.mtl", "newmtl first_one\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\n"
                         "newmtl second\nKa 0 0 0\nKd 1 1 1\nKs 0 0 0\nd 1\nillum 1\nmap_Kd b.png\n");
}

static void expect_name(const char *name, const char *why)
{
    rig_err.text[0] = '\0';
    assert_int_equal(mesh_check_name(name, &rig_err), why == NULL ? SH_OK : SH_EINPUT);
    assert_string_equal(rig_err.text, why != NULL ? why : "");
}

/* Only the name counts, not its folder. .glb and .fbx name no other file as text. */
static void names_that_no_mesh_can_refer_to(void **state)
{
    (void)state;
    expect_name("x\ny/a b.obj", NULL);
    expect_name("a\nb.obj", "a?b.obj: a line of .obj names its other files; allowed are names without control "
                            "characters");
    expect_name("x%y/a \xc3\xa9.gltf", NULL);
    expect_name("a\xc3.gltf", "a?.gltf: this name is not UTF-8, as .gltf has it; allowed is a name in UTF-8");
    expect_name("a?b.gltf", "a?b.gltf: .gltf refers to its other files by URIs, where ? has a special meaning; allowed "
                            "are names without % # ? : \\");
    expect_name("a\nb.OBJ", "a?b.OBJ: a line of .obj names its other files; allowed are names without control "
                            "characters");
    expect_name("a#b.GLTF", "a#b.GLTF: .gltf refers to its other files by URIs, where # has a special meaning; allowed "
                            "are names without % # ? : \\");
    expect_name("a%\xc3\n.glb", NULL);
}

/* Names of the files beside a .gltf are URIs, which have no blanks and braces. Letters of other languages stay. */
static void gltf_names_are_uris(void **state)
{
    (void)state;
    static const struct mesh_part one[1] = {{"station 1", 4, 2, "an {image}.png", NULL}};
    struct mesh mesh = rig_mesh();
    size_t len;
    mesh.uv = rig_uv;
    mesh.part = one;
    mesh.n_parts = 1;
    rig_write("a \xc3\xa9 b.gltf", &mesh);
    char *text = rig_take("a \xc3\xa9 b.gltf", &len);
    assert_non_null(strstr(text, "\"a%20\xc3\xa9%20b.bin\""));
    assert_non_null(strstr(text, "\"an%20%7Bimage%7D.png\""));
    free(text);
    free(rig_take("a \xc3\xa9 b.bin", &len));
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
                        .xyz_m = rig_xyz,
                        .normal = rig_normal,
                        .rgb = rig_rgb,
                        .uv = rig_uv,
                        .texture = "a.png",
                        .scalar = scalar,
                        .n_scalars = 3,
                        .ascii = 1};
    rig_write("a.ply", &mesh);
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
    struct mesh mesh = rig_mesh();
    mesh.normal = rig_normal;
    mesh.rgb = rig_rgb;
    mesh.uv = rig_uv;
    mesh.face_rgb = face_rgb;
    mesh.scalar = scalar;
    mesh.n_scalars = 1;
    rig_write("a.ply", &mesh);
    size_t len;
    char *file = rig_take("a.ply", &len);
    const char *p = memmem(file, len, "end_header\n", 11);
    assert_non_null(p);
    p += 11;
    assert_int_equal(file + len - p, 4 * (24 + 12 + 3 + 8 + 2) + 2 * (1 + 12 + 3));
    for (int i = 0; i < 4; i++) {
        assert_memory_equal(p, rig_xyz[i], 24);
        assert_memory_equal(p + 24, rig_normal[i], 12);
        assert_memory_equal(p + 36, rig_rgb[i], 3);
        assert_memory_equal(p + 39, rig_uv[i], 8);
        assert_memory_equal(p + 47, &label[i], 2);
        p += 49;
    }
    for (int i = 0; i < 2; i++) {
        assert_int_equal(*p, 3);
        assert_memory_equal(p + 1, rig_face[i], 12);
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
    struct mesh mesh = rig_mesh();
    size_t len;
    for (int k = 0; k < 9; k++)
        scalar[k] = (struct mesh_scalar){name[k], value, MESH_DOUBLE};
    mesh.scalar = scalar;
    mesh.n_scalars = 8;
    mesh.ascii = 1;
    rig_write("a.ply", &mesh);
    char *text = rig_take("a.ply", &len);
    assert_non_null(strstr(text, "\n-7 0.5 1.75 4 4 4 4 4 4 4 4\n"));
    free(text);
    mesh.n_scalars = 9;
    assert_int_equal(mesh_write(path_in("a.ply"), &mesh, NULL, &rig_err), SH_EINPUT);
    assert_non_null(strstr(rig_err.text, "9 figures per vertex; allowed are up to 8"));
    assert_int_equal(access(path_in("a.ply"), F_OK), -1);
}

/* Up to 9e6 m coordinates are rounded to the nanometre. Beyond, a double steps by more than that, and has 17 digits. */
static void coordinates_as_text(void **state)
{
    (void)state;
    const double far_m = 1e7 + 5.0 / (1 << 29), row[2][3] = {{9e6, -9e6, far_m}, {-far_m, 8999999.999999999, 5e-10}};
    char want[256], *text;
    const struct mesh mesh = {.n_vertices = 2, .xyz_m = row};
    snprintf(want, sizeof want, "\nv 9000000 -9000000 %.17g\nv %.17g %.9f 0", row[0][2], row[1][0], row[1][1]);
    size_t len;
    rig_write("a.obj", &mesh);
    text = rig_take("a.obj", &len);
    if (strstr(text, want) == NULL) fail_msg("no %s in %s", want, text);
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(obj_faces_name_what_there_is),    cmocka_unit_test(obj_materials),
        cmocka_unit_test(names_that_no_mesh_can_refer_to), cmocka_unit_test(gltf_names_are_uris),
        cmocka_unit_test(ply_text_of_all_columns),         cmocka_unit_test(ply_bytes_of_all_columns),
        cmocka_unit_test(ply_has_up_to_eight_figures),     cmocka_unit_test(coordinates_as_text),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
