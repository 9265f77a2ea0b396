/* SPDX-License-Identifier: MIT */
/* Textures of meshes: within the file, with wrap modes, with a second set of coordinates, and with the format's rules
 * of alpha. */
#include "tests/unit/scene_files.h"

#include <math.h>
#include <png.h>

#include "core/texture.h"

enum { WIDE = 4, HIGH = 2 };

/* Alpha of the texels, from the top left. */
static const uint8_t ALPHA[WIDE * HIGH] = {0, 60, 100, 140, 180, 220, 250, 255};

static int remove_files(void **state)
{
    static const char *const file[] = {"m.gltf", "m.bin", "m.dae", "m.png"};
    char name[160];
    for (size_t i = 0; i < sizeof file / sizeof *file; i++) {
        snprintf(name, sizeof name, "%s/%s", folder, file[i]);
        unlink(name);
    }
    return remove_folder(state);
}

static size_t make_png(uint8_t *png, size_t room)
{
    uint8_t rgba[WIDE * HIGH][4];
    png_image image = {.version = PNG_IMAGE_VERSION, .width = WIDE, .height = HIGH, .format = PNG_FORMAT_RGBA};
    for (int i = 0; i < WIDE * HIGH; i++)
        for (int c = 0; c < 4; c++)
            rgba[i][c] = c < 3 ? 200 : ALPHA[i];
    png_alloc_size_t size = room;
    if (!png_image_write_to_memory(&image, png, &size, 0, rgba, 0, NULL)) fail_msg("%s", image.message);
    return size;
}

/* Writes a square of two triangles. The image uses the second set of coordinates; those of the first set are all one
 * point. */
static void write_gltf(const char *material, const char *lay)
{
    static const float p[4][3] = {{-1, -1, 0}, {1, -1, 0}, {1, 1, 0}, {-1, 1, 0}}, zero[4][2];
    static const float uv[4][2] = {{0, 1}, {1, 1}, {1, 0}, {0, 0}};
    static const uint16_t index[6] = {0, 1, 2, 0, 2, 3};
    uint8_t bin[4096] = {0};
    char text[4096];
    memcpy(bin, p, sizeof p);
    memcpy(bin + 48, zero, sizeof zero);
    memcpy(bin + 80, uv, sizeof uv);
    memcpy(bin + 112, index, sizeof index);
    size_t n = make_png(bin + 124, sizeof bin - 124);
    write_file("m.bin", bin, 124 + n);
    snprintf(
        text, sizeof text,
        "{\"asset\":{\"version\":\"2.0\"},\"extensionsUsed\":[\"KHR_texture_transform\"],"
        "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1,\"TEXCOORD_1\":2},"
        "\"indices\":3,\"material\":0}]}],\"materials\":[{\"name\":\"leaf\",%s\"pbrMetallicRoughness\":{"
        "\"baseColorTexture\":{\"index\":0,\"texCoord\":1%s}}}],\"textures\":[{\"source\":0,\"sampler\":0}],"
        "\"samplers\":[{\"wrapS\":33071,\"wrapT\":33648}],\"images\":[{\"bufferView\":4,"
        "\"mimeType\":\"image/png\"}],\"accessors\":["
        "{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\",\"min\":[-1,-1,0],\"max\":[1,1,0]},"
        "{\"bufferView\":1,\"componentType\":5126,\"count\":4,\"type\":\"VEC2\"},"
        "{\"bufferView\":2,\"componentType\":5126,\"count\":4,\"type\":\"VEC2\"},"
        "{\"bufferView\":3,\"componentType\":5123,\"count\":6,\"type\":\"SCALAR\"}],\"bufferViews\":["
        "{\"buffer\":0,\"byteLength\":48},{\"buffer\":0,\"byteOffset\":48,\"byteLength\":32},"
        "{\"buffer\":0,\"byteOffset\":80,\"byteLength\":32},{\"buffer\":0,\"byteOffset\":112,\"byteLength\":12},"
        "{\"buffer\":0,\"byteOffset\":124,\"byteLength\":%zu}],"
        "\"buffers\":[{\"uri\":\"m.bin\",\"byteLength\":%zu}]}",
        material, lay, n, 124 + n);
    write_text("m.gltf", text);
}

static struct scene *load_mesh(const char *name, int textures)
{
    char file[160];
    snprintf(file, sizeof file, "%s/%s", folder, name);
    const struct scene_mesh_spec spec = {
        .file = file, .scale = 1.0, .up = SCENE_UP_Z, .textures = textures, .cutouts = 1};
    struct scene *scene;
    struct sh_err err;
    if (load_spec(&spec, 1.0, &scene, &err) != SH_OK) fail_msg("%s", err.text);
    return scene;
}

/* Holes are checked in the middles of the texels: alpha below the cutoff, in 255ths. */
static void check_holes(const struct scene *scene, int below)
{
    assert_int_equal(scene->n_triangles, 2);
    for (int i = 0; i < WIDE * HIGH; i++) {
        double x = -1.0 + 2.0 * (i % WIDE + 0.5) / WIDE, y = 1.0 - 2.0 * (i / WIDE + 0.5) / HIGH;
        const double p[3] = {x, y, 0.0};
        double uv[2];
        const uint32_t *c = scene->triangle[0];
        const double *const corner[3] = {scene->vertex_m[c[0]], scene->vertex_m[c[1]], scene->vertex_m[c[2]]};
        scene_uv_at(scene, 0, corner, p, uv); /* also beyond its edges: the same plane, the same image */
        assert_int_equal(texture_is_hole(scene_cutout(scene, 0), uv), ALPHA[i] < below);
    }
}

static void gltf_has_it_within(void **state)
{
    (void)state;
    write_gltf("\"alphaMode\":\"BLEND\",", "");
    struct scene *scene = load_mesh("m.gltf", 1);
    assert_int_equal(n_warnings, 0);
    assert_int_equal(scene->n_textures, 1);
    assert_non_null(scene->texture[0].bytes);
    assert_int_equal(scene->texture[0].wrap[0], TEXTURE_CLAMP);
    assert_int_equal(scene->texture[0].wrap[1], TEXTURE_MIRROR);
    check_holes(scene, 128);
    scene_free(scene);
    write_gltf("\"alphaMode\":\"MASK\",\"alphaCutoff\":0.25,", "");
    scene = load_mesh("m.gltf", 0);
    check_holes(scene, 64);
    scene_free(scene);
    write_gltf("", ""); /* opaque is the default: alpha says nothing */
    scene = load_mesh("m.gltf", 0);
    assert_true(scene->cutout == NULL && scene->uv == NULL);
    scene_free(scene);
}

/* KHR_texture_transform: a coordinate of the image, from its upper left, is offset + scale times the mesh's. */
static void gltf_scales_and_shifts(void **state)
{
    (void)state;
    static const char lay[] = ",\"extensions\":{\"KHR_texture_transform\":{\"offset\":[0.25,0.125],"
                              "\"scale\":[0.5,0.25]%s}}";
    char text[256];
    snprintf(text, sizeof text, lay, "");
    write_gltf("", text);
    struct scene *scene = load_mesh("m.gltf", 1);
    assert_int_equal(n_warnings, 0);
    for (uint32_t i = 0; i < scene->n_triangles; i++)
        for (int c = 0; c < 3; c++) {
            const double *v = scene->vertex_m[scene->triangle[i][c]];
            double u = 0.25 + 0.5 * (v[0] + 1.0) / 2.0, down = 0.125 + 0.25 * (1.0 - v[1]) / 2.0;
            assert_true(fabs((double)scene->uv[i][c][0] - u) < 1e-6);
            assert_true(fabs((double)scene->uv[i][c][1] - (1.0 - down)) < 1e-6);
        }
    scene_free(scene);
}

static void collada_has_an_opacity_map(void **state)
{
    (void)state;
    static const char dae[] =
        "<?xml version=\"1.0\"?><COLLADA xmlns=\"http://www.collada.org/2005/11/COLLADASchema\" version=\"1.4.1\">"
        "<asset><unit meter=\"1\"/><up_axis>Z_UP</up_axis></asset>"
        "<library_images><image id=\"i\"><init_from>m.png</init_from></image></library_images>"
        "<library_effects><effect id=\"e\"><profile_COMMON>"
        "<newparam sid=\"s\"><surface type=\"2D\"><init_from>i</init_from></surface></newparam>"
        "<newparam sid=\"p\"><sampler2D><source>s</source><wrap_s>CLAMP</wrap_s><wrap_t>WRAP</wrap_t></sampler2D>"
        "</newparam><technique sid=\"c\"><lambert><diffuse><color>1 1 1 1</color></diffuse>"
        "<transparent opaque=\"A_ONE\"><texture texture=\"p\" texcoord=\"UV\"/></transparent></lambert></technique>"
        "</profile_COMMON></effect></library_effects>"
        "<library_materials><material id=\"m\" name=\"m\"><instance_effect url=\"#e\"/></material></library_materials>"
        "<library_geometries><geometry id=\"g\"><mesh>"
        "<source id=\"gp\"><float_array id=\"gpa\" count=\"12\">-1 -1 0 1 -1 0 1 1 0 -1 1 0</float_array>"
        "<technique_common><accessor source=\"#gpa\" count=\"4\" stride=\"3\"><param name=\"X\" type=\"float\"/>"
        "<param name=\"Y\" type=\"float\"/><param name=\"Z\" type=\"float\"/></accessor></technique_common></source>"
        "<source id=\"gu\"><float_array id=\"gua\" count=\"8\">0 0 1 0 1 1 0 1</float_array>"
        "<technique_common><accessor source=\"#gua\" count=\"4\" stride=\"2\"><param name=\"S\" type=\"float\"/>"
        "<param name=\"T\" type=\"float\"/></accessor></technique_common></source>"
        "<vertices id=\"gv\"><input semantic=\"POSITION\" source=\"#gp\"/></vertices>"
        "<triangles count=\"2\" material=\"m\"><input semantic=\"VERTEX\" source=\"#gv\" offset=\"0\"/>"
        "<input semantic=\"TEXCOORD\" source=\"#gu\" offset=\"0\" set=\"0\"/><p>0 1 2 0 2 3</p></triangles>"
        "</mesh></geometry></library_geometries>"
        "<library_visual_scenes><visual_scene id=\"v\"><node id=\"n\"><instance_geometry url=\"#g\"><bind_material>"
        "<technique_common><instance_material symbol=\"m\" target=\"#m\"><bind_vertex_input semantic=\"UV\" "
        "input_semantic=\"TEXCOORD\" input_set=\"0\"/></instance_material></technique_common></bind_material>"
        "</instance_geometry></node></visual_scene></library_visual_scenes>"
        "<scene><instance_visual_scene url=\"#v\"/></scene></COLLADA>";
    uint8_t png[2048];
    write_file("m.png", png, make_png(png, sizeof png));
    write_text("m.dae", dae);
    struct scene *scene = load_mesh("m.dae", 1);
    assert_int_equal(scene->n_textures, 1);
    assert_int_equal(scene->surface[0].opacity, 1);
    double uv[2] = {0.125, 0.75};
    assert_true(texture_is_hole(scene_cutout(scene, 0), uv)); /* alpha 0, upper left */
    uv[0] = 0.875;
    assert_false(texture_is_hole(scene_cutout(scene, 0), uv));
    uv[0] = -0.375; /* Assimp reads no wrap modes of Collada: the third one again */
    assert_true(texture_is_hole(scene_cutout(scene, 0), uv));
    uv[0] = -0.125;
    assert_false(texture_is_hole(scene_cutout(scene, 0), uv));
    scene_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(gltf_has_it_within), cmocka_unit_test(gltf_scales_and_shifts),
                                       cmocka_unit_test(collada_has_an_opacity_map)};
    return cmocka_run_group_tests(tests, make_folder, remove_files);
}
