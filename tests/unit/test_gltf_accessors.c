/* SPDX-License-Identifier: MIT */
/* Accessors of glTF: types of numbers, strides, sparse ones, bounds; and the modes of primitives. */
#include "tests/unit/gltf_files.h"

#include <math.h>

#define ONE_NODE "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0,\"name\":\"wall\"}],"
#define A_TEXTURE                                                                                     \
    "\"materials\":[{\"name\":\"q\",\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0}}}]," \
    "\"textures\":[{\"source\":0}],\"images\":[{\"uri\":\"q.png\"}],"

static const double QUAD_LOW[3] = {-2, -1, -2}, QUAD_HIGH[3] = {2, 1, -2};

/* The texture coordinates of the quad are the corners of the image, as they lie on it. */
static void check_uv(const struct scene *s)
{
    assert_non_null(s->uv);
    for (uint32_t i = 0; i < s->n_triangles; i++)
        for (int c = 0; c < 3; c++) {
            const double *v = s->vertex_m[s->triangle[i][c]];
            assert_true((double)s->uv[i][c][0] == (v[0] + 2) / 4 && (double)s->uv[i][c][1] == (v[1] + 1) / 2);
        }
}

/* Loads the quad with these normalized integers as its texture coordinates. */
static void check_normalized(const char *type, const void *data, size_t size, int stride)
{
    char rest[2048], more[64];
    snprintf(more, sizeof more, ",\"byteStride\":%d", stride);
    gltf_quad();
    gltf_block(data, size, more);
    snprintf(rest, sizeof rest,
             ONE_NODE A_TEXTURE "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":3},"
                                "\"indices\":2,\"material\":0}]}],\"accessors\":[" GLTF_QUAD_ACCESSORS
                                ",{\"bufferView\":3,\"componentType\":%s,\"normalized\":true,\"count\":4,"
                                "\"type\":\"VEC2\"}]",
             type);
    struct scene *s = gltf_load(rest);
    check_uv(s);
    assert_int_equal(s->n_textures, 1);
    scene_free(s);
}

static void normalized_texture_coordinates(void **state)
{
    (void)state;
    static const uint16_t u16[4][2] = {{0, 65535}, {65535, 65535}, {65535, 0}, {0, 0}};
    static const uint8_t u8[4][4] = {{0, 255}, {255, 255}, {255, 0}, {0, 0}};
    static const int16_t i16[4][2] = {{0, 32767}, {32767, 32767}, {32767, 0}, {0, 0}};
    check_normalized("5123", u16, sizeof u16, 4);
    check_normalized("5121", u8, sizeof u8, 4);
    check_normalized("5122", i16, sizeof i16, 4);
}

/* Corners are in the order of gltf_quad: red, green, half grey (128 of 255 in sRGB is 0.21586 of linear light),
 * blue. */
static void check_colours(const char *type, const char *kind, const void *data, size_t size, int stride)
{
    static const uint8_t want[4][4] = {{255, 0, 0, 255}, {0, 255, 0, 255}, {128, 128, 128, 255}, {0, 0, 255, 255}};
    char rest[2048], more[64];
    snprintf(more, sizeof more, ",\"byteStride\":%d", stride);
    gltf_quad();
    gltf_block(data, size, more);
    snprintf(rest, sizeof rest,
             ONE_NODE "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"COLOR_0\":3},\"indices\":2}]}],"
                      "\"accessors\":[" GLTF_QUAD_ACCESSORS
                      ",{\"bufferView\":3,\"componentType\":%s,\"normalized\":%s,\"count\":4,\"type\":\"%s\"}]",
             type, strcmp(type, "5126") == 0 ? "false" : "true", kind);
    struct scene *s = gltf_load(rest);
    assert_non_null(s->rgb);
    for (uint32_t i = 0; i < s->n_triangles; i++)
        for (int c = 0; c < 3; c++) {
            const double *v = s->vertex_m[s->triangle[i][c]];
            const int right = v[0] > 0, top = v[2] > s->min_m[2] + 1e-9 || v[1] > s->min_m[1] + 1e-9;
            assert_memory_equal(s->rgb[i][c], want[top ? right ? 2 : 3 : right], 4);
        }
    scene_free(s);
}

static void colours_of_vertices(void **state)
{
    (void)state;
    static const uint16_t u16[4][4] = {{65535}, {0, 65535}, {14147, 14147, 14147}, {0, 0, 65535}};
    static const float f32[4][4] = {{1, 0, 0, 1}, {0, 1, 0, 1}, {0.21586f, 0.21586f, 0.21586f, 1}, {0, 0, 2, 0.5f}};
    check_colours("5123", "VEC3", u16, sizeof u16, 8);
    check_colours("5126", "VEC4", f32, sizeof f32, 16);
}

/* KHR_mesh_quantization: half of a step of 1/32767, scaled by 2, is 31 um; half of a millimetre is 0.5 mm. */
static void quantized_positions(void **state)
{
    (void)state;
    static const int16_t unit[4][4] = {{-32767, -16384, -32767},
                                       {32767, -16384, -32767},
                                       {32767, 16384, -32767},
                                       {-32767, 16384, -32767}},
                         mm[4][4] = {
                             {-2000, -1000, -2000}, {2000, -1000, -2000}, {2000, 1000, -2000}, {-2000, 1000, -2000}};
    static const struct {
        const void *data;
        const char *scale, *normalized, *says;
        double within, error_m;
    } tries[] = {{unit, "2,2,2", "true", "errors up to 3.1e-05 m", 3.1e-5, 1.0 / 32767},
                 {mm, "0.001,0.001,0.001", "false", "errors up to 0.0005 m", 1e-15, 0.0005}};
    for (int i = 0; i < 2; i++) {
        char rest[2048];
        gltf_quad();
        gltf_block(tries[i].data, sizeof unit, ",\"byteStride\":8");
        snprintf(rest, sizeof rest,
                 "\"extensionsUsed\":[\"KHR_mesh_quantization\"],\"extensionsRequired\":[\"KHR_mesh_quantization\"],"
                 "\"scene\":0,\"scenes\":[{\"nodes\":[0]}],\"nodes\":[{\"mesh\":0,\"scale\":[%s]}],"
                 "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":3},\"indices\":2}]}],"
                 "\"accessors\":[" GLTF_QUAD_ACCESSORS
                 ",{\"bufferView\":3,\"componentType\":5122,\"normalized\":%s,\"count\":4,\"type\":\"VEC3\"}]",
                 tries[i].scale, tries[i].normalized);
        struct scene *s = gltf_load(rest);
        gltf_check_box(s, QUAD_LOW, QUAD_HIGH, tries[i].within);
        assert_true(fabs(s->error_m - tries[i].error_m) < 1e-12);
        if (strstr(warnings, tries[i].says) == NULL) fail_msg("%s", warnings);
        scene_free(s);
    }
}

/* Two of four values are replaced. One sparse accessor is over zeros, with a corner at the origin, one over a buffer
 * view. */
static void sparse_accessors(void **state)
{
    (void)state;
    static const uint8_t at[4] = {1, 3};
    static const float moved[2][3] = {{2, 0, 0}, {0, 2, 0}};
    static const struct {
        const char *base;
        double low[3], high[3], area;
    } tries[] = {{"", {0, 0, 0}, {2, 2, 0}, 2.0}, {"\"bufferView\":0,", {-2, -1, -2}, {2, 2, 0}, 0.0}};
    for (int i = 0; i < 2; i++) {
        char rest[2048];
        gltf_quad();
        gltf_block(at, sizeof at, "");
        gltf_block(moved, sizeof moved, "");
        snprintf(rest, sizeof rest,
                 ONE_NODE "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":3},\"mode\":5}]}],"
                          "\"accessors\":[" GLTF_QUAD_ACCESSORS
                          ",{%s\"componentType\":5126,\"count\":4,\"type\":\"VEC3\",\"sparse\":{\"count\":2,"
                          "\"indices\":{\"bufferView\":3,\"componentType\":5121},\"values\":{\"bufferView\":4}}}]",
                 tries[i].base);
        struct scene *s = gltf_load(rest);
        if (i == 0) assert_true(s->n_triangles == 1 && s->counts.zero_area == 1);
        if (i == 0) assert_true(total_area(s) == tries[i].area);
        gltf_check_box(s, i == 0 ? tries[i].low : (const double[3]){-2, -1, -2},
                       i == 0 ? tries[i].high : (const double[3]){2, 2, 0}, 0.0);
        scene_free(s);
    }
}

/* Each mode is tried with indices and without: triangles, and the counts of points and lines. */
static void modes_of_primitives(void **state)
{
    (void)state;
    static const struct {
        int mode;
        const char *index; /* accessor, or none */
        uint32_t triangles, left_out;
        double area;
    } tries[] = {{5, "", 2, 0, 8.0},
                 {5, "\"indices\":4,", 2, 0, 8.0},
                 {6, "\"indices\":5,", 2, 0, 8.0},
                 {4, "", 1, 1, 4.0},
                 {4, "\"indices\":2,", 2, 0, 8.0},
                 {0, "", 0, 4, 0.0},
                 {1, "", 0, 2, 0.0},
                 {2, "", 0, 4, 0.0},
                 {3, "", 0, 3, 0.0}};
    static const float strip[4][3] = {{-2, -1, -2}, {2, -1, -2}, {-2, 1, -2}, {2, 1, -2}};
    static const uint8_t strip_index[4] = {0, 1, 3, 2}, fan_index[4] = {0, 1, 2, 3};
    for (size_t i = 0; i < sizeof tries / sizeof tries[0]; i++) {
        char rest[2048];
        const bool is_fan = tries[i].mode == 6, is_plain = tries[i].index[0] == '\0';
        gltf_quad();
        gltf_block(strip, sizeof strip, "");
        gltf_block(strip_index, sizeof strip_index, "");
        gltf_block(fan_index, sizeof fan_index, "");
        /* A triangle is beside it, since a file must have one. */
        snprintf(rest, sizeof rest,
                 ONE_NODE "\"meshes\":[{\"primitives\":[{%s\"attributes\":{\"POSITION\":%d},\"mode\":%d},"
                          "{\"attributes\":{\"POSITION\":0},\"indices\":6}]}],\"accessors\":[" GLTF_QUAD_ACCESSORS
                          ",{\"bufferView\":3,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"},"
                          "{\"bufferView\":4,\"componentType\":5121,\"count\":4,\"type\":\"SCALAR\"},"
                          "{\"bufferView\":5,\"componentType\":5121,\"count\":4,\"type\":\"SCALAR\"},"
                          "{\"bufferView\":2,\"componentType\":5123,\"count\":3,\"type\":\"SCALAR\"}]",
                 tries[i].index, is_plain ? 3 : 0, tries[i].mode);
        struct scene *s = gltf_load(rest);
        if (s->n_triangles != tries[i].triangles + 1 || s->counts.not_triangles != tries[i].left_out ||
            fabs(total_area(s) - 4.0 - tries[i].area) > 1e-12)
            fail_msg("%zu: mode %d%s: %u triangles, %g m2, %llu left out", i, tries[i].mode, is_fan ? " (fan)" : "",
                     s->n_triangles - 1, total_area(s) - 4.0, (unsigned long long)s->counts.not_triangles);
        scene_free(s);
    }
}

/* Offsets, counts and indices lead out of the file, some so large that sums would wrap. */
static void nothing_is_read_beyond_the_file(void **state)
{
    (void)state;
    static const struct {
        const char *accessor, *says;
    } tries[] = {
        {"\"bufferView\":0,\"componentType\":5126,\"count\":5,\"type\":\"VEC3\"",
         "accessors[3]: 5 elements from byte 0 on go beyond bufferViews[0], which has 48 bytes"},
        {"\"bufferView\":0,\"byteOffset\":4,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"",
         "accessors[3]: 4 elements from byte 4 on go beyond bufferViews[0], which has 48 bytes"},
        {"\"bufferView\":0,\"byteOffset\":9007199254740992,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"",
         "accessors[3]: 4 elements from byte 9007199254740992 on go beyond bufferViews[0], which has 48 bytes"},
        {"\"bufferView\":0,\"byteOffset\":18446744073709551615,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"",
         "accessors[3].byteOffset is not a whole number from 0 on"},
        {"\"bufferView\":0,\"componentType\":5126,\"count\":4294967294,\"type\":\"VEC3\"",
         "accessors[3]: 4294967294 elements from byte 0 on go beyond bufferViews[0], which has 48 bytes"},
        {"\"bufferView\":0,\"componentType\":5126,\"count\":-4,\"type\":\"VEC3\"",
         "accessors[3].count is not a whole number from 0 on"},
        {"\"bufferView\":0,\"componentType\":5126,\"count\":3.5,\"type\":\"VEC3\"",
         "accessors[3].count is not a whole number from 0 on"},
        {"\"bufferView\":0,\"componentType\":5126,\"type\":\"VEC3\"", "accessors[3].count is missing"},
        {"\"bufferView\":9,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"",
         "bufferViews[9] is missing: there are 3"},
        {"\"bufferView\":0,\"componentType\":5124,\"count\":4,\"type\":\"VEC3\"",
         "accessors[3].componentType is 5124; allowed are 5120 to 5123, 5125 and 5126"},
        {"\"bufferView\":1,\"componentType\":5126,\"count\":4,\"type\":\"VEC2\"",
         "accessors[3].type is VEC2; allowed here is VEC3"},
        {"\"bufferView\":1,\"componentType\":5126,\"count\":4,\"type\":\"VEC5\"",
         "accessors[3].type is VEC5; allowed here is VEC3"},
        {"\"bufferView\":1,\"componentType\":5126,\"count\":4", "accessors[3].type is not there; allowed here is VEC3"},
        {"\"bufferView\":0,\"componentType\":5126,\"count\":2,\"type\":\"VEC3\"",
         "index 2 out of range; there are 2 vertices"},
        {"\"componentType\":5126,\"count\":4,\"type\":\"VEC3\",\"sparse\":{\"count\":9,\"indices\":{\"bufferView\":2,"
         "\"componentType\":5123},\"values\":{\"bufferView\":0}}",
         "accessors[3].sparse has 9 indices of type 5123 for 4 elements"},
        {"\"componentType\":5126,\"count\":2,\"type\":\"VEC3\",\"sparse\":{\"count\":1,\"indices\":{\"bufferView\":2,"
         "\"byteOffset\":4,\"componentType\":5123},\"values\":{\"bufferView\":0}}",
         "accessors[3].sparse.indices is 2; there are 2 elements"},
        {"\"componentType\":5126,\"count\":4,\"type\":\"VEC3\",\"sparse\":{\"count\":1,\"indices\":{\"bufferView\":2,"
         "\"componentType\":5126},\"values\":{\"bufferView\":0}}",
         "accessors[3].sparse has 1 indices of type 5126 for 4 elements"},
        {"\"componentType\":5126,\"count\":4,\"type\":\"VEC3\",\"sparse\":{\"count\":1,\"indices\":{\"bufferView\":2},"
         "\"values\":{\"bufferView\":0}}",
         "accessors[3].sparse has 1 indices of type 0 for 4 elements"},
    };
    for (size_t i = 0; i < sizeof tries / sizeof tries[0]; i++) {
        char rest[2048];
        gltf_quad();
        snprintf(rest, sizeof rest,
                 ONE_NODE "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":3},\"indices\":2}]}],"
                          "\"accessors\":[" GLTF_QUAD_ACCESSORS ",{%s}]",
                 tries[i].accessor);
        gltf_refuse(rest, tries[i].says);
    }
}

/* Four thousand million points, indices or instances have no buffer. They are refused at once, without memory for them,
 * and without a loop over them. */
static void absurd_counts_end(void **state)
{
    (void)state;
    const struct scene_import_limits limits = {.memory_mib = 256, .time_s = 20, .files = 64};
    static const struct {
        const char *attributes, *node, *component, *type;
    } tries[] = {
        {"\"POSITION\":3},\"indices\":2", "", "5126", "VEC3"},
        {"\"POSITION\":0},\"indices\":3", "", "5125", "SCALAR"},
        {"\"POSITION\":0},\"indices\":2",
         ",\"extensions\":{\"EXT_mesh_gpu_instancing\":{\"attributes\":{\"TRANSLATION\":3}}}", "5126", "VEC3"},
        {"\"POSITION\":0},\"indices\":3", "",
         "5121,\"sparse\":{\"count\":1,\"indices\":{\"bufferView\":2,\"componentType\":5121},"
         "\"values\":{\"bufferView\":2}}",
         "SCALAR"},
    };
    for (size_t i = 0; i < sizeof tries / sizeof tries[0]; i++) {
        char rest[2048];
        struct scene *s;
        struct sh_err err = {0};
        gltf_quad();
        snprintf(
            rest, sizeof rest,
            "\"nodes\":[{\"mesh\":0%s}],\"meshes\":[{\"primitives\":[{\"attributes\":{%s}]}],\"accessors\":[" GLTF_QUAD_ACCESSORS
            ",{\"componentType\":%s,\"count\":4294967294,\"type\":\"%s\"}]",
            tries[i].node, tries[i].attributes, tries[i].component, tries[i].type);
        const struct scene_mesh_spec spec = {.file = gltf_write("a.glb", rest), .scale = 1, .limits = &limits};
        assert_int_equal(load_spec(&spec, 1, &s, &err), SH_EINPUT);
        unlink(path);
        if (strstr(err.text, "a.glb") == NULL ||
            strstr(err.text, "accessors[3].count is 4294967294, without a bufferView; allowed are up to 16777216") ==
                NULL)
            fail_msg("%zu: %s", i, err.text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(normalized_texture_coordinates),
        cmocka_unit_test(colours_of_vertices),
        cmocka_unit_test(quantized_positions),
        cmocka_unit_test(sparse_accessors),
        cmocka_unit_test(modes_of_primitives),
        cmocka_unit_test(nothing_is_read_beyond_the_file),
        cmocka_unit_test(absurd_counts_end),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
