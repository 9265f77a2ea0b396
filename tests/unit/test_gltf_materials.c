/* SPDX-License-Identifier: MIT */
/* Materials of glTF 2.0 and their defaults: colours, transparency, holes, and how images repeat. */
#include <math.h>

#include "core/studio/picture.h"
#include "tests/unit/gltf_files.h"

/* A quad with a material; `material` is what stands in its braces. */
static struct scene *load_material(const char *material, const char *more)
{
    char rest[4096];
    snprintf(rest, sizeof rest,
             "\"nodes\":[{\"mesh\":0}],\"materials\":[{%s}],\"meshes\":[" GLTF_QUAD_MESH
             "],%s\"accessors\":[" GLTF_QUAD_ACCESSORS "]",
             material, more);
    struct scene *s = gltf_load(rest);
    assert_int_equal(s->n_surfaces, 1);
    return s;
}

/* sRGB of a linear share (IEC 61966-2-1). */
static double srgb(double v)
{
    return v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055;
}

/* A factor that is not given is white and opaque. Alpha is transparency of blended materials alone. Of transparency and
 * transmission the larger counts. */
static void colours_and_transparency(void **state)
{
    (void)state;
    static const struct {
        const char *material;
        double rgb[3], clear;
    } row[] = {
        {"", {1, 1, 1}, 0},
        {"\"pbrMetallicRoughness\":{}", {1, 1, 1}, 0},
        {"\"pbrMetallicRoughness\":{\"baseColorFactor\":[0.25,0.5,0.75,0.125]}", {0.25, 0.5, 0.75}, 0},
        {"\"alphaMode\":\"MASK\",\"alphaCutoff\":0.25,\"pbrMetallicRoughness\":{\"baseColorFactor\":[0,0.001,1,0.25]}",
         {0, 0.001, 1},
         0},
        {"\"alphaMode\":\"BLEND\",\"pbrMetallicRoughness\":{\"baseColorFactor\":[1,0,0.5,0.25]}", {1, 0, 0.5}, 0.75},
        {"\"alphaMode\":\"BLEND\"", {1, 1, 1}, 0},
        {"\"alphaMode\":\"BLEND\",\"pbrMetallicRoughness\":{\"baseColorFactor\":[1,1,0.5,0.25]},\"extensions\":{"
         "\"KHR_materials_transmission\":{\"transmissionFactor\":0.5}}",
         {1, 1, 0.5},
         0.75},
        {"\"alphaMode\":\"BLEND\",\"pbrMetallicRoughness\":{\"baseColorFactor\":[0.5,1,1,0.75]},\"extensions\":{"
         "\"KHR_materials_transmission\":{\"transmissionFactor\":0.875}}",
         {0.5, 1, 1},
         0.875},
    };
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        gltf_quad();
        struct scene *s = load_material(row[i].material, "");
        assert_int_equal(s->surface[0].has_colour, 1);
        for (int k = 0; k < 3; k++)
            if (!(fabs((double)s->surface[0].colour[k] - srgb(row[i].rgb[k])) < 1e-6))
                fail_msg("%zu: channel %d", i, k);
        assert_true((double)s->surface[0].clear == row[i].clear && s->surface[0].texture == 0);
        scene_free(s);
    }
}

/* Masked materials have holes below alphaCutoff, by default 0.5, and blended ones below 0.5. Opaque ones have none, and
 * that is the default. */
static void opacities_of_holes(void **state)
{
    (void)state;
    static const struct {
        const char *material;
        float solid;
    } row[] = {{"", 0},
               {"\"alphaMode\":\"OPAQUE\",\"alphaCutoff\":0.25", 0},
               {"\"alphaMode\":\"MASK\"", 0.5f},
               {"\"alphaMode\":\"MASK\",\"alphaCutoff\":0.25", 0.25f},
               {"\"alphaMode\":\"MASK\",\"alphaCutoff\":1", 1},
               {"\"alphaMode\":\"MASK\",\"alphaCutoff\":-1", 0.5f},
               {"\"alphaMode\":\"MASK\",\"alphaCutoff\":\"0.25\"", 0.5f},
               {"\"alphaMode\":\"BLEND\",\"alphaCutoff\":0.25", 0.5f}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        char *png = NULL, material[256];
        size_t len = 0;
        struct picture picture;
        struct sh_err err;
        FILE *out = open_memstream(&png, &len);
        assert_int_equal(picture_make(&picture, 2, 2, (const uint8_t[3]){1, 2, 3}, &err), SH_OK);
        assert_int_equal(picture_put_png(out, &picture, &err), SH_OK);
        fclose(out);
        picture_free(&picture);
        gltf_quad();
        gltf_block(png, len, "");
        snprintf(material, sizeof material, "\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0}}%s%s",
                 row[i].material[0] != '\0' ? "," : "", row[i].material);
        struct scene *s = load_material(
            material, "\"textures\":[{\"source\":0}],\"images\":[{\"bufferView\":3,\"mimeType\":\"image/png\"}],");
        if (s->surface[0].solid != row[i].solid) fail_msg("%zu: %g", i, (double)s->surface[0].solid);
        assert_int_equal(s->n_textures, 1);
        assert_true(s->texture[0].n_bytes == len && memcmp(s->texture[0].bytes, png, len) == 0);
        assert_non_null(strstr(s->texture[0].file, "a.glb*0")); /* the file's name, and the image's number */
        assert_true(s->texture[0].wrap[0] == TEXTURE_REPEAT && s->texture[0].wrap[1] == TEXTURE_REPEAT);
        scene_free(s);
        free(png);
    }
}

/* glTF 2.0, 3.9.4: a point is a hole where factor * texture * COLOR_0 is below alphaCutoff. So a texel is one below
 * alphaCutoff / factor, and all are where factor * COLOR_0 is below alphaCutoff, whatever the texture has. */
static void opacities_are_multiplied(void **state)
{
    (void)state;
    static const struct {
        double factor;
        const char *cutoff;
        float alpha[4]; /* of the four corners */
        bool is_textured;
        float solid; /* below 0: not looked at */
        uint32_t n;  /* triangles of two that are left */
        const char *says;
    } row[] = {{0.8, "", {1, 1, 1, 1}, true, 0.625f, 2, ""},
               {0.5, "", {1, 1, 1, 1}, true, 1, 2, ""},
               {0.5, ",\"alphaCutoff\":0.125", {1, 1, 1, 1}, true, 0.25f, 2, ""},
               {0.4, "", {1, 1, 1, 1}, true, -1, 0, "2 triangles left out: they have less opacity"},
               {0.4, "", {1, 1, 1, 1}, false, -1, 0, "2 triangles left out: they have less opacity"},
               {0, "", {1, 1, 1, 1}, true, -1, 0, "2 triangles left out: they have less opacity"},
               {0, ",\"alphaCutoff\":0", {0, 0, 0, 0}, true, 0, 2, ""},
               {1, ",\"alphaCutoff\":1.5", {1, 1, 1, 1}, true, -1, 0, "2 triangles left out: they have less opacity"},
               {1, ",\"alphaCutoff\":1", {1, 1, 1, 1}, true, 1, 2, ""},
               {0.8, "", {0.5f, 0.5f, 0.25f, 0}, false, -1, 0, "2 triangles left out: they have less opacity"},
               {1, "", {0, 0, 0, 1}, false, -1, 1, "1 triangles left out: they have less opacity"},
               {1, "", {0, 0, 0, 1}, false, -1, 1, "1 triangles of masked materials have opacities at their corners"},
               {1, "", {0.75f, 0.75f, 0.75f, 0.75f}, false, -1, 2, ""},
               /* 0.9f is 0.89999998, and 0.7f times 0.9 a little below 0.63: equal numbers as a file has them */
               {1, ",\"alphaCutoff\":0.9", {0.9f, 0.9f, 0.9f, 0.9f}, false, -1, 2, ""},
               {0.9, ",\"alphaCutoff\":0.63", {0.7f, 0.7f, 0.7f, 0.7f}, false, -1, 2, ""},
               {1,
                ",\"alphaCutoff\":0.9",
                {0.8999999f, 0.8999999f, 0.8999999f, 0.8999999f},
                false,
                -1,
                0,
                "2 triangles left out: they have less opacity"},
               {1, "", {0.75f, 0.75f, 0.75f, 0.75f}, true, 0.5f, 2, "2 triangles of masked materials have opacities"}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        char rest[4096];
        float rgba[4][4] = {{0}};
        for (int k = 0; k < 4; k++)
            rgba[k][3] = row[i].alpha[k];
        gltf_quad();
        gltf_block(rgba, sizeof rgba, "");
        snprintf(
            rest, sizeof rest,
            "\"nodes\":[{\"mesh\":0},{\"mesh\":1}],\"materials\":[{\"alphaMode\":\"MASK\"%s,\"pbrMetallicRoughness\":{"
            "\"baseColorFactor\":[1,1,1,%g]%s}},{}],\"textures\":[{\"source\":0}],\"images\":[{\"uri\":\"no.png\"}],"
            "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1,\"COLOR_0\":3},\"indices\":2,"
            "\"material\":0}]},{\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":2,\"material\":1}]}],"
            "\"accessors\":[" GLTF_QUAD_ACCESSORS
            ",{\"bufferView\":3,\"componentType\":5126,\"count\":4,\"type\":\"VEC4\"}]",
            row[i].cutoff, row[i].factor, row[i].is_textured ? ",\"baseColorTexture\":{\"index\":0}" : "");
        struct scene *s = gltf_load(rest);
        if (s->n_triangles != 2 + row[i].n) fail_msg("%zu: %u triangles: %s", i, s->n_triangles, warnings);
        const float solid = s->surface[0].solid;
        if (row[i].solid >= 0.0f && solid != row[i].solid) fail_msg("%zu: %g", i, (double)solid);
        if (strstr(warnings, row[i].says) == NULL) fail_msg("%zu: %s", i, warnings);
        if (row[i].says[0] == '\0' && strstr(warnings, "triangles") != NULL) fail_msg("%zu: %s", i, warnings);
        scene_free(s);
    }
}

/* Colours of three numbers have no opacity. Where colours are not wanted, nothing of them is read, and so they may be
 * broken: here there are too few. */
static void colours_that_are_not_wanted(void **state)
{
    (void)state;
    char rest[2048];
    struct scene *s;
    struct sh_err err = {0};
    gltf_quad();
    snprintf(rest, sizeof rest,
             "\"nodes\":[{\"mesh\":0}],\"materials\":[{\"alphaMode\":\"MASK\"}],\"meshes\":[{\"primitives\":["
             "{\"attributes\":{\"POSITION\":0,\"COLOR_0\":3},\"indices\":2,\"material\":0}]}],"
             "\"accessors\":[" GLTF_QUAD_ACCESSORS
             ",{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}]");
    gltf_refuse(rest, "3 colours for 4 vertices");
    const struct scene_mesh_spec spec = {.file = gltf_write("a.glb", rest), .scale = 1, .cutouts = 1};
    if (load_spec(&spec, 1e-3, &s, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(s->n_triangles, 2);
    scene_free(s);
    unlink(path);
}

/* Each direction has its own way to repeat. A direction without a number repeats the image as it is. */
static void images_repeat(void **state)
{
    (void)state;
    static const int code[4] = {0, 10497, 33071, 33648};
    static const enum texture_wrap wrap[4] = {TEXTURE_REPEAT, TEXTURE_REPEAT, TEXTURE_CLAMP, TEXTURE_MIRROR};
    for (int i = 0; i < 16; i++) {
        char more[512], s_code[32] = "\"name\":\"s\"", t_code[32] = "";
        if (code[i / 4] > 0) snprintf(s_code, sizeof s_code, "\"wrapS\":%d", code[i / 4]);
        if (code[i % 4] > 0) snprintf(t_code, sizeof t_code, ",\"wrapT\":%d", code[i % 4]);
        snprintf(more, sizeof more,
                 "\"textures\":[{\"source\":0,\"sampler\":1}],\"samplers\":[{\"wrapS\":33071,\"wrapT\":33648},{%s%s}],"
                 "\"images\":[{\"uri\":\"a%%20b.png\"}],",
                 s_code, t_code);
        gltf_quad();
        struct scene *s = load_material("\"pbrMetallicRoughness\":{\"baseColorTexture\":{\"index\":0}}", more);
        assert_true(s->texture[0].wrap[0] == wrap[i / 4] && s->texture[0].wrap[1] == wrap[i % 4]);
        assert_non_null(strstr(s->texture[0].file, "a b.png"));
        scene_free(s);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(colours_and_transparency),
        cmocka_unit_test(opacities_of_holes),
        cmocka_unit_test(opacities_are_multiplied),
        cmocka_unit_test(colours_that_are_not_wanted),
        cmocka_unit_test(images_repeat),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
