/* SPDX-License-Identifier: MIT */
/* Extensions of glTF: known and required ones, packed buffers, images of other formats, turned textures, names of
 * materials. */
#include "tests/unit/gltf_files.h"

#include <math.h>
#include <meshoptimizer.h>
#include <webp/encode.h>

#include "core/texture.h"

#define ONE_NODE   "\"nodes\":[{\"mesh\":0,\"name\":\"wall\"}],"
#define PLAIN_MESH "\"meshes\":[" GLTF_QUAD_MESH "],\"accessors\":[" GLTF_QUAD_ACCESSORS "]"
#define A_MATERIAL "\"materials\":[{\"name\":\"q\",\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0}}}],"

static void required_and_unknown(void **state)
{
    (void)state;
    gltf_quad();
    gltf_refuse(
        "\"extensionsRequired\":[\"KHR_lights_punctual\",\"VENDOR_unknown_geometry\"]," ONE_NODE
        "\"materials\":[{}]," PLAIN_MESH,
        "it requires the extension VENDOR_unknown_geometry, which is not known; known are KHR_mesh_quantization");
    struct scene *s = gltf_load("\"extensionsUsed\":[\"VENDOR_a\",\"KHR_materials_ior\",\"VENDOR_b\"]," ONE_NODE
                                "\"materials\":[{}]," PLAIN_MESH);
    assert_int_equal(n_warnings, 1);
    assert_non_null(
        strstr(warnings, "2 extensions are unknown but not required; they are not read: VENDOR_a, VENDOR_b"));
    scene_free(s);
    s = gltf_load("\"extensionsUsed\":[\"VENDOR_c\"]," ONE_NODE "\"materials\":[{}]," PLAIN_MESH);
    assert_non_null(strstr(warnings, "1 extensions are unknown but not required; they are not read: VENDOR_c\n"));
    scene_free(s);
}

/* Lights, gloss and metadata do not change a laser's view. */
static void required_and_harmless(void **state)
{
    (void)state;
    gltf_quad();
    struct scene *s =
        gltf_load("\"extensionsRequired\":[\"KHR_materials_unlit\",\"KHR_lights_punctual\","
                  "\"KHR_xmp_json_ld\",\"EXT_structural_metadata\"]," ONE_NODE "\"materials\":[{}]," PLAIN_MESH);
    assert_int_equal(n_warnings, 0);
    scene_free(s);
}

/* The share of light that goes through is kept. A value that the format doesn't allow is left out, with a warning. */
static void transparency_is_kept(void **state)
{
    (void)state;
    static const struct {
        const char *material;
        float clear;
        const char *odd; /* the name in a warning; NULL: there is none */
    } as[] = {
        {"\"alphaMode\":\"BLEND\",\"pbrMetallicRoughness\":{\"baseColorFactor\":[1,1,1,0.25]}", 0.75f, NULL},
        {"\"pbrMetallicRoughness\":{\"baseColorFactor\":[1,1,1,0.25]}", 0.0f, NULL},
        {"\"alphaMode\":\"BLEND\"", 0.0f, NULL},
        {"\"extensions\":{\"KHR_materials_transmission\":{\"transmissionFactor\":0.5}}", 0.5f, NULL},
        {"\"alphaMode\":\"MASK\",\"alphaCutoff\":1", 0.0f, NULL},
        {"\"extensions\":{\"KHR_materials_transmission\":{\"transmissionFactor\":1.5}}", 0.0f,
         "1 value of materials left out, since the format doesn't allow them; the first: materials[0]: transmissionF"},
        {"\"alphaMode\":\"BLENDED\",\"pbrMetallicRoughness\":{\"baseColorFactor\":[1,1,1,0.25]}", 0.0f,
         "materials[0]: alphaMode"},
        {"\"alphaMode\":\"BLEND\",\"alphaCutoff\":-1,\"pbrMetallicRoughness\":{\"baseColorFactor\":[1,1,1,-1]}", 0.0f,
         "2 values of materials left out, since the format doesn't allow them; the first: materials[0]: alphaCut"}};
    for (size_t i = 0; i < sizeof as / sizeof as[0]; i++) {
        char rest[1024];
        gltf_quad();
        snprintf(rest, sizeof rest, ONE_NODE "\"materials\":[{%s}]," PLAIN_MESH, as[i].material);
        struct scene *s = gltf_load(rest);
        if (s->surface[0].clear != as[i].clear) fail_msg("%zu: %g", i, (double)s->surface[0].clear);
        assert_int_equal(n_warnings, as[i].odd != NULL);
        if (as[i].odd != NULL) assert_non_null(strstr(warnings, as[i].odd));
        scene_free(s);
    }
}

/* ---- images */

static int load_images(const char *required, const char *texture, int textures, struct scene **s, struct sh_err *err)
{
    char rest[2048];
    gltf_quad();
    snprintf(rest, sizeof rest,
             "%s" ONE_NODE A_MATERIAL
             "\"textures\":[%s],\"images\":[{\"uri\":\"q.ktx2\"},{\"uri\":\"q.png\"}]," PLAIN_MESH,
             required, texture);
    const struct scene_mesh_spec spec = {
        .file = gltf_write("a.glb", rest), .scale = 1, .textures = textures, .cutouts = 1};
    int rc = load_spec(&spec, 1, s, err);
    unlink(path);
    return rc;
}

/* KTX2 is refused where it is required and colours are wanted; else the other image is taken, or there is a warning. */
static void images_that_are_not_read(void **state)
{
    (void)state;
    static const char required[] = "\"extensionsRequired\":[\"KHR_texture_basisu\"],",
                      alone[] = "{\"extensions\":{\"KHR_texture_basisu\":{\"source\":0}}}",
                      beside[] = "{\"source\":1,\"extensions\":{\"KHR_texture_basisu\":{\"source\":0}}}",
                      says[] = "1 primitives have a texture of KHR_texture_basisu, which is not supported";
    struct scene *s;
    struct sh_err err = {0};
    assert_int_equal(load_images(required, alone, 1, &s, &err), SH_EINPUT);
    if (strstr(err.text, "textures[0] is an image of KHR_texture_basisu, which is not supported; allowed are PNG") ==
        NULL)
        fail_msg("%s", err.text);
    assert_int_equal(load_images(required, alone, 0, &s, &err), SH_OK);
    scene_free(s);
    assert_int_equal(load_images("", alone, 1, &s, &err), SH_OK);
    assert_non_null(strstr(warnings, says));
    assert_int_equal(s->surface[0].texture, 0);
    scene_free(s);
    assert_int_equal(load_images(required, beside, 1, &s, &err), SH_OK);
    assert_int_equal(s->n_textures, 1);
    assert_non_null(strstr(s->texture[0].file, "q.png"));
    assert_null(strstr(warnings, says));
    scene_free(s);
}

/* EXT_texture_webp, within the file, gives its texels, without loss. */
static void webp_is_decoded(void **state)
{
    (void)state;
    static const uint8_t rgba[4][4] = {{255, 0, 0, 255}, {0, 255, 0, 255}, {0, 0, 255, 255}, {200, 100, 50, 0}};
    uint8_t *webp = NULL;
    const size_t n = WebPEncodeLosslessRGBA(&rgba[0][0], 2, 2, 8, &webp);
    assert_true(n > 0);
    gltf_quad();
    gltf_block(webp, n, "");
    struct scene *s = gltf_load("\"extensionsRequired\":[\"EXT_texture_webp\"]," ONE_NODE A_MATERIAL
                                "\"textures\":[{\"extensions\":{\"EXT_texture_webp\":{\"source\":0}}}],"
                                "\"images\":[{\"bufferView\":3,\"mimeType\":\"image/webp\"}]," PLAIN_MESH);
    struct texture_image image;
    struct sh_err err;
    if (scene_read_texture(&s->texture[0], 0, &image, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(image.width, 2);
    assert_int_equal(image.height, 2);
    assert_true(image.has_alpha);
    assert_memory_equal(image.rgba, rgba, 12);
    assert_int_equal(image.rgba[15], 0);
    texture_image_free(&image);
    for (size_t k = 0; k < n; k++) { /* cut off anywhere: an error, if any, names the file */
        const struct texture_source cut = {.file = "cut.webp", .bytes = webp, .n_bytes = k};
        if (texture_read(&cut, &image, &err) != SH_OK) assert_int_equal(strncmp(err.text, "cut.webp: ", 10), 0);
        texture_image_free(&image);
    }
    scene_free(s);
    WebPFree(webp);
}

/* ---- packed buffers */

static size_t pack(uint8_t *packed, size_t room)
{
    static const float p[4][3] = {{-2, -1, -2}, {2, -1, -2}, {2, 1, -2}, {-2, 1, -2}};
    return meshopt_encodeVertexBuffer(packed, room, p, 4, sizeof p[0]);
}

static void try_strides(const char *mode, const char *more, size_t cut, int stride, const char *says)
{
    static const unsigned index[6] = {0, 1, 2, 0, 2, 3};
    uint8_t vertices[512], triangles[512];
    char view[3][256], rest[2048];
    const size_t n = pack(vertices, sizeof vertices),
                 m = meshopt_encodeIndexBuffer(triangles, sizeof triangles, index, 6);
    assert_true(n > 0 && m > 0);
    gltf_begin();
    gltf_block(vertices, n, "");
    gltf_block(triangles, m, "");
    const size_t second = (n + 3) & ~(size_t)3;
    snprintf(view[0], sizeof view[0],
             ",\"byteStride\":%d,\"extensions\":{\"EXT_meshopt_compression\":{\"buffer\":0,\"byteLength\":%zu,"
             "\"byteStride\":12,\"count\":4,\"mode\":\"%s\"%s}}",
             stride, n - cut, mode, more);
    snprintf(view[1], sizeof view[1],
             ",\"extensions\":{\"EXT_meshopt_compression\":{\"buffer\":0,\"byteOffset\":%zu,\"byteLength\":%zu,"
             "\"byteStride\":2,\"count\":6,\"mode\":\"TRIANGLES\"}}",
             second, m);
    gltf_block("", 0, view[0]);
    gltf_block("", 0, view[1]);
    snprintf(rest, sizeof rest,
             "\"extensionsRequired\":[\"EXT_meshopt_compression\"]," ONE_NODE
             "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1}]}],\"accessors\":["
             "{\"bufferView\":2,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"},"
             "{\"bufferView\":3,\"componentType\":5123,\"count\":6,\"type\":\"SCALAR\"}]");
    if (says != NULL) {
        gltf_refuse(rest, says);
        return;
    }
    struct scene *s = gltf_load(rest);
    gltf_check_box(s, (const double[3]){-2, -1, -2}, (const double[3]){2, 1, -2}, 0.0);
    assert_true(total_area(s) == 8.0);
    scene_free(s);
}

static void try_packed(const char *mode, const char *more, size_t cut, const char *says)
{
    try_strides(mode, more, cut, 12, says);
}

static void meshopt_is_unpacked(void **state)
{
    (void)state;
    try_packed("ATTRIBUTES", "", 0, NULL);
    try_packed("ATTRIBUTES", "", 7, "meshoptimizer can't decode it");
    try_packed("TRIANGLES", "", 0, "meshopt does not allow TRIANGLES with 4 elements of 12 bytes");
    try_packed("CURVES", "", 0, "meshopt's mode CURVES is not known");
    try_packed("ATTRIBUTES", ",\"filter\":\"OCTAHEDRAL\"", 0,
               "meshopt does not allow ATTRIBUTES with 4 elements of 12 bytes");
    try_strides("ATTRIBUTES", "", 0, 16,
                "bufferViews[2].byteStride is 16, but its packed elements have 12 bytes; both must be equal");
}

/* ---- placement of textures */

/* u' = offset + R * S * u, with v down. The transform's own texCoord counts; its set comes before TEXCOORD_0 in this
 * file. A quarter turn with the scale 1/2 and the offset (0, 1) is the example of the extension's text: the lower left
 * quarter of the image. */
static void turned_textures(void **state)
{
    (void)state;
    static const float zero[4][2] = {{0}};
    gltf_quad();
    gltf_block(zero, sizeof zero, "");
    struct scene *s = gltf_load(
        "\"extensionsRequired\":[\"KHR_texture_transform\"]," ONE_NODE
        "\"materials\":[{\"name\":\"q\",\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0,\"texCoord\":0,"
        "\"extensions\":{\"KHR_texture_transform\":{\"texCoord\":1,\"offset\":[0,1],\"rotation\":1.5707963267948966,"
        "\"scale\":[0.5,0.5]}}}}}],\"textures\":[{\"source\":0}],\"images\":[{\"uri\":\"q.png\"}],"
        "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"TEXCOORD_1\":1,\"TEXCOORD_0\":3},\"indices\":2,"
        "\"material\":0}]}],\"accessors\":[" GLTF_QUAD_ACCESSORS
        ",{\"bufferView\":3,\"componentType\":5126,\"count\":4,\"type\":\"VEC2\"}]");
    assert_int_equal(n_warnings, 0);
    for (uint32_t i = 0; i < s->n_triangles; i++)
        for (int c = 0; c < 3; c++) {
            const double *v = s->vertex_m[s->triangle[i][c]];
            const double u = (v[0] + 2) / 4, down = (1 - v[1]) / 2;
            const double want_u = 0.5 * down, want_up = 1.0 - (1.0 - 0.5 * u);
            assert_true(fabs((double)s->uv[i][c][0] - want_u) < 1e-7 && fabs((double)s->uv[i][c][1] - want_up) < 1e-7);
        }
    scene_free(s);
}

/* ---- materials */

/* A second material of one name, and one without a name, get other made-up names than materials have already. */
static void made_names_are_no_others(void **state)
{
    (void)state;
    gltf_quad();
    struct scene *s = gltf_load(
        ONE_NODE "\"materials\":[{\"name\":\"a[2]\"},{\"name\":\"a\"},{\"name\":\"a\"},{},"
                 "{\"name\":\"materials[3]\"}],"
                 "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"material\":0},"
                 "{\"attributes\":{\"POSITION\":0},\"material\":1},{\"attributes\":{\"POSITION\":0},\"material\":2},"
                 "{\"attributes\":{\"POSITION\":0},\"material\":3},{\"attributes\":{\"POSITION\":0},\"material\":4}]}],"
                 "\"accessors\":[" GLTF_QUAD_ACCESSORS "]");
    static const char *const name[5] = {"a[2]", "a", "a[2][2]", "materials[3][3]", "materials[3]"};
    assert_int_equal(s->n_surfaces, 5);
    for (int i = 0; i < 5; i++)
        assert_string_equal(s->surface[i].material, name[i]);
    scene_free(s);
}

/* Two materials have one name, and one has none: three surfaces with three colours. Specular-glossiness has names of
 * its own. */
static void each_material_is_a_surface(void **state)
{
    (void)state;
    gltf_quad();
    struct scene *s = gltf_load(
        ONE_NODE "\"materials\":[{\"name\":\"a\",\"pbrMetallicRoughness\":{\"baseColorFactor\":[1,0,0,1]}},"
                 "{\"name\":\"a\",\"pbrMetallicRoughness\":{\"baseColorFactor\":[0,1,0,1]}},"
                 "{\"extensions\":{\"KHR_materials_pbrSpecularGlossiness\":{\"diffuseFactor\":[0,0,1,1]}}}],"
                 "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"material\":0},"
                 "{\"attributes\":{\"POSITION\":0},\"material\":1},{\"attributes\":{\"POSITION\":0},\"material\":2}]}],"
                 "\"accessors\":[" GLTF_QUAD_ACCESSORS "]");
    static const char *const name[3] = {"a", "a[1]", "materials[2]"};
    assert_int_equal(s->n_surfaces, 3);
    for (int i = 0; i < 3; i++) {
        assert_string_equal(s->surface[i].material, name[i]);
        assert_int_equal(s->surface[i].has_colour, 1);
        for (int k = 0; k < 3; k++)
            assert_true(s->surface[i].colour[k] == (k == i ? 1.0f : 0.0f));
    }
    scene_free(s);
}

/* A name with an escaped blank is the file's. An image may be data of a URI. */
static void names_and_data_of_images(void **state)
{
    (void)state;
    gltf_quad();
    struct scene *s = gltf_load(ONE_NODE A_MATERIAL "\"textures\":[{\"source\":0}],\"images\":[{\"uri\":"
                                                    "\"my%20image.png\"}]," PLAIN_MESH);
    assert_non_null(strstr(s->texture[0].file, "/my image.png"));
    scene_free(s);
    s = gltf_load(ONE_NODE A_MATERIAL "\"textures\":[{\"source\":0}],\"images\":[{\"uri\":"
                                      "\"data:image/png;base64,AQID_w==\"}]," PLAIN_MESH);
    static const uint8_t bytes[4] = {1, 2, 3, 255};
    assert_int_equal(s->texture[0].n_bytes, 4);
    assert_memory_equal(s->texture[0].bytes, bytes, 4);
    scene_free(s);
    gltf_refuse(ONE_NODE A_MATERIAL "\"textures\":[{\"source\":0}],\"images\":[{\"uri\":\"data:,AQ!\"}]," PLAIN_MESH,
                "images[0].uri must have its data in base64");
}

/* ---- Draco */

#define DRACO "\"extensionsRequired\":[\"KHR_draco_mesh_compression\"%s],"
/* One primitive without numbers of its own. Its packed bytes are none, so that Assimp refuses the file; the checks come
 * before that. */
#define PACKED                                                                                                      \
    "\"meshes\":[{\"weights\":[%s],\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1,\"extensions\":{" \
    "\"KHR_draco_mesh_compression\":{\"bufferView\":0,\"attributes\":{\"POSITION\":0}}}}]}],\"accessors\":["        \
    "{\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"},{\"componentType\":5123,\"count\":6,\"type\":\"SCALAR\"}]"

/* Assimp unpacks Draco, and is not asked for more: what it ignores is named, or refused where the file requires it. */
static void what_assimp_ignores_is_named(void **state)
{
    (void)state;
    static const struct {
        const char *required, *more, *node, *weights, *says;
    } tries[] = {
        {"", "", "", "0, 0", NULL},
        {"", "\"skins\":[{\"joints\":[0]}],", "", "", "ignores: skins; unpack it"},
        {"", "", ",\"extensions\":{\"EXT_mesh_gpu_instancing\":{\"attributes\":{}}}", "",
         "ignores: instances (EXT_mesh_gpu_instancing); unpack"},
        {"", "", ",\"extensions\":{\"KHR_node_visibility\":{\"visible\":false}}", "",
         "ignores: that nodes are hidden (KHR_node_visibility); unpack"},
        {"", "", ",\"extensions\":{\"KHR_node_visibility\":{\"visible\":true}}", "", NULL},
        {"", "", "", "0, 2", "ignores: weights of morph targets; unpack"},
        {"", "", ",\"weights\":[1]", "2", "ignores: weights of morph targets; unpack"},
        {"", "\"textures\":[{\"extensions\":{\"EXT_texture_webp\":{\"source\":0}}}],", "", "",
         "ignores: WebP images; unpack"},
    };
    for (size_t i = 0; i < sizeof tries / sizeof tries[0]; i++) {
        char rest[2048];
        gltf_quad();
        snprintf(rest, sizeof rest, DRACO "%s\"nodes\":[{\"mesh\":0%s}]," PACKED, tries[i].required, tries[i].more,
                 tries[i].node, tries[i].weights);
        gltf_refuse(rest, "a.glb");
        const bool is_named =
            tries[i].says == NULL ? strstr(warnings, "ignores") == NULL : strstr(warnings, tries[i].says) != NULL;
        if (!is_named) fail_msg("%zu: %s", i, warnings);
    }
    static const char *const other[] = {"EXT_mesh_gpu_instancing", "KHR_node_visibility"};
    for (size_t i = 0; i < sizeof other / sizeof other[0]; i++) {
        char rest[2048], required[64], says[96];
        snprintf(required, sizeof required, ",\"%s\"", other[i]);
        snprintf(says, sizeof says, "it needs KHR_draco_mesh_compression and %s; allowed is one of them", other[i]);
        gltf_quad();
        snprintf(rest, sizeof rest, DRACO "\"nodes\":[{\"mesh\":0}]," PACKED, required, "0");
        gltf_refuse(rest, says);
    }
}

/* A file that requires Draco and uses it nowhere is read by the specification: the node's instances are there. */
static void nothing_packed_needs_no_assimp(void **state)
{
    (void)state;
    static const float shift[2][3] = {{0, 0, 0}, {9, 0, 0}};
    char rest[2048];
    gltf_quad();
    gltf_block(shift, sizeof shift, "");
    snprintf(rest, sizeof rest,
             DRACO
             "\"nodes\":[{\"mesh\":0,\"extensions\":{\"EXT_mesh_gpu_instancing\":{\"attributes\":{"
             "\"TRANSLATION\":3}}}}],\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":2}]}],"
             "\"accessors\":[" GLTF_QUAD_ACCESSORS
             ",{\"bufferView\":3,\"componentType\":5126,\"count\":2,\"type\":\"VEC3\"}]",
             "");
    struct scene *s = gltf_load(rest);
    assert_int_equal(s->n_triangles, 4);
    assert_int_equal(n_warnings, 0);
    scene_free(s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(required_and_unknown),
        cmocka_unit_test(required_and_harmless),
        cmocka_unit_test(transparency_is_kept),
        cmocka_unit_test(images_that_are_not_read),
        cmocka_unit_test(webp_is_decoded),
        cmocka_unit_test(meshopt_is_unpacked),
        cmocka_unit_test(turned_textures),
        cmocka_unit_test(each_material_is_a_surface),
        cmocka_unit_test(made_names_are_no_others),
        cmocka_unit_test(names_and_data_of_images),
        cmocka_unit_test(what_assimp_ignores_is_named),
        cmocka_unit_test(nothing_packed_needs_no_assimp),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
