/* SPDX-License-Identifier: MIT */
/* Materials: the base colour, its texture, how texture coordinates are transformed, and the holes that the texture's
 * alpha cuts out. */
#include "core/import/gltf/gltf_material.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/colour.h"
#include "core/import/gltf/gltf.h"
#include "core/import/gltf/gltf_accessor.h"
#include "core/import/gltf/gltf_at.h"
#include "core/import/gltf/gltf_extensions.h"
#include "core/import/gltf/gltf_json.h"
#include "core/import/gltf/gltf_uri.h"
#include "core/scene/build_surfaces.h"

enum { CLAMP_TO_EDGE = 33071, MIRRORED_REPEAT = 33648 };

/* ---- values that the format allows */

/* glTF 2.0, material: base colour and transmission are 0..1, a cutoff is not negative, and there are three modes. Other
 * values are left out and counted; the first one is named. */
static void note(struct gltf *g, bool is_allowed, const char *key, uint32_t material)
{
    if (is_allowed || g->n_odd++ > 0) return;
    snprintf(g->odd, sizeof g->odd, "materials[%u]: %s", material, key);
}

static bool is_share(const json_t *value)
{
    const double share = json_number_value(value);
    return json_is_number(value) && share >= 0.0 && share <= 1.0;
}

static bool are_shares(const json_t *list)
{
    bool all = true;
    for (size_t i = 0; i < json_array_size(list); i++)
        all = all && is_share(json_array_get(list, i));
    return all;
}

static bool is_mode(const char *mode)
{
    return mode != NULL && (strcmp(mode, "OPAQUE") == 0 || strcmp(mode, "MASK") == 0 || strcmp(mode, "BLEND") == 0);
}

static const json_t *transmission(const json_t *material)
{
    return json_object_get(gltf_extension(material, "KHR_materials_transmission"), "transmissionFactor");
}

static void note_odd(struct gltf *g, const json_t *material, uint32_t number)
{
    const json_t *cutoff = json_object_get(material, "alphaCutoff"), *through = transmission(material);
    const json_t *rough = json_object_get(material, "pbrMetallicRoughness");
    const json_t *glossy = gltf_extension(material, "KHR_materials_pbrSpecularGlossiness");
    note(g, json_object_get(material, "alphaMode") == NULL || is_mode(gltf_text(material, "alphaMode")), "alphaMode",
         number);
    note(g, cutoff == NULL || (json_is_number(cutoff) && json_number_value(cutoff) >= 0.0), "alphaCutoff", number);
    note(g, through == NULL || is_share(through), "transmissionFactor", number);
    note(g, are_shares(json_object_get(rough, "baseColorFactor")), "baseColorFactor", number);
    note(g, are_shares(json_object_get(glossy, "diffuseFactor")), "diffuseFactor", number);
}

/* Returns base[number], or base[number][number] ... where another material has that name. NULL: no memory. */
static char *name_with(const char *base, uint32_t number, const json_t *in_file, const json_t *given)
{
    char *name = NULL;
    do {
        char *shorter = name;
        if (asprintf(&name, "%s[%u]", shorter != NULL ? shorter : base, number) < 0) name = NULL;
        free(shorter);
    } while (name != NULL && (json_object_get(in_file, name) != NULL || json_object_get(given, name) != NULL));
    return name;
}

/* Two materials of one name would be one surface, with the colour of the first. So the later one gets its number, and
 * so does one without a name. */
int gltf_name_materials(struct gltf *g)
{
    json_t *materials, *in_file = json_object(), *given = json_object();
    int rc = gltf_list(g, g->root, "materials", "", &materials);
    g->names = json_array();
    for (uint32_t i = 0; i < json_array_size(materials) && rc == SH_OK; i++) {
        const char *name = gltf_text(json_array_get(materials, i), "name");
        if (name != NULL) json_object_set_new_nocheck(in_file, name, json_true());
    }
    for (uint32_t i = 0; i < json_array_size(materials) && rc == SH_OK; i++) {
        const char *name = gltf_text(json_array_get(materials, i), "name");
        const int has_name = name != NULL && *name != '\0';
        note_odd(g, json_array_get(materials, i), i);
        char *own = has_name && json_object_get(given, name) == NULL
                        ? strdup(name)
                        : name_with(has_name ? name : "materials", i, in_file, given);
        if (own == NULL || json_object_set_new_nocheck(given, own, json_true()) != 0 ||
            json_array_append_new(g->names, json_string_nocheck(own)) != 0)
            rc = build_fail(g->b, SH_ENOMEM, g->err, "no memory for the names of materials");
        free(own);
    }
    json_decref(in_file);
    json_decref(given);
    return rc;
}

/* ---- images */

static enum texture_wrap wrap_of(uint64_t mode)
{
    return mode == CLAMP_TO_EDGE ? TEXTURE_CLAMP : mode == MIRRORED_REPEAT ? TEXTURE_MIRROR : TEXTURE_REPEAT;
}

static int read_wrap(struct gltf *g, const json_t *texture, const char *at, struct build_image *image)
{
    uint32_t number;
    uint64_t mode[2] = {0, 0};
    json_t *sampler = NULL;
    int rc = gltf_index(g, texture, "sampler", at, &number);
    if (rc == SH_OK && number != GLTF_NONE) rc = gltf_object(g, "samplers", number, &sampler);
    if (rc == SH_OK) rc = gltf_whole(g, sampler, "wrapS", "samplers", &mode[0]);
    if (rc == SH_OK) rc = gltf_whole(g, sampler, "wrapT", "samplers", &mode[1]);
    for (int k = 0; k < 2; k++)
        image->wrap[k] = wrap_of(mode[k]);
    return rc;
}

/* Adds an image that is a file of its own. Escaped characters of its name are decoded. */
static int add_file(struct gltf *g, const char *uri, struct build_image *image, uint16_t *number)
{
    char *name = gltf_uri_name(uri);
    if (name == NULL) return build_fail(g->b, SH_ENOMEM, g->err, "no memory for a name");
    image->name = text_span_of(name);
    int rc = *name != '\0' ? build_texture(g->b, image, number, g->err) : SH_OK;
    free(name);
    return rc;
}

/* An image within the file gets the file's name and its own number. */
static int add_image(struct gltf *g, uint32_t i, struct build_image *image, uint16_t *number)
{
    const struct gltf_at at = gltf_at("images[%u]", i);
    json_t *object;
    uint32_t view;
    uint64_t stride;
    struct gltf_bytes bytes = {0};
    void *own = NULL;
    char *name = NULL;
    int rc = gltf_object(g, "images", i, &object);
    const char *uri = rc == SH_OK ? gltf_text(object, "uri") : NULL;
    if (uri != NULL && !gltf_uri_is_data(uri)) return add_file(g, uri, image, number);
    if (rc == SH_OK && uri != NULL) rc = gltf_uri_data(g->b, uri, at.text, &own, &bytes, g->err);
    if (rc == SH_OK && uri == NULL) rc = gltf_index(g, object, "bufferView", at.text, &view);
    if (rc == SH_OK && uri == NULL) rc = gltf_buffer_view(g, view, &bytes, &stride);
    const int len = asprintf(&name, "%s*%u", basename(g->b->spec->file), i);
    if (rc == SH_OK && len < 0) rc = build_fail(g->b, SH_ENOMEM, g->err, "no memory for a name");
    if (rc == SH_OK) {
        image->name = (struct text_span){name, (size_t)len};
        image->bytes = bytes.p != NULL ? bytes.p : (const uint8_t *)"";
        image->n_bytes = bytes.n;
        rc = build_texture(g->b, image, number, g->err);
    }
    if (len >= 0) free(name);
    free(own);
    return rc;
}

/* ---- textures */

/* Reports a texture whose only image has a format that isn't read. Such a texture is an error where colours are wanted
 * and the file requires that format's extension. */
static int miss_image(struct gltf *g, const json_t *texture, const char *at)
{
    const char *name = json_object_iter_key(json_object_iter(json_object_get(texture, "extensions")));
    if (name == NULL) return SH_OK; /* a texture without an image is allowed */
    if (g->b->spec->textures && gltf_is_required(g->root, name))
        return gltf_fail(
            g,
            "%s is an image of %.60s, which is not supported; allowed are PNG, JPEG, TGA, BMP and WebP: convert it, "
            "or scan without colours",
            at, name);
    if (g->n_images++ == 0) snprintf(g->image, sizeof g->image, "%.60s", name);
    return SH_OK;
}

static int add_texture(struct gltf *g, uint32_t i, uint16_t *number)
{
    const struct gltf_at at = gltf_at("textures[%u]", i);
    struct build_image image = {0};
    json_t *texture;
    uint32_t source = GLTF_NONE;
    int rc = gltf_object(g, "textures", i, &texture);
    if (rc == SH_OK) rc = gltf_index(g, texture, "source", at.text, &source);
    if (rc == SH_OK && source == GLTF_NONE)
        rc = gltf_index(g, gltf_extension(texture, "EXT_texture_webp"), "source", at.text, &source);
    if (rc == SH_OK && source == GLTF_NONE) return miss_image(g, texture, at.text);
    if (rc == SH_OK) rc = read_wrap(g, texture, at.text, &image);
    return rc == SH_OK ? add_image(g, source, &image, number) : rc;
}

/* u' = offset + turn * scale * u, from the upper left corner, with v down. A turn is counter-clockwise as one looks at
 * the mesh. The matrix is that of Khronos' viewer. With it, the example in the text of KHR_texture_transform shows the
 * lower left quarter of the image, as that text says. */
static int read_lay(struct gltf *g, const json_t *info, const char *at, struct gltf_look *look)
{
    const json_t *lay = gltf_extension(info, "KHR_texture_transform");
    double offset[2] = {0, 0}, scale[2] = {1, 1}, turn = 0.0;
    uint32_t other = GLTF_NONE;
    int rc = gltf_index(g, info, "texCoord", at, &look->uv_set);
    if (rc == SH_OK) rc = gltf_index(g, lay, "texCoord", at, &other);
    if (rc == SH_OK) rc = gltf_numbers(g, lay, "offset", at, 2, offset);
    if (rc == SH_OK) rc = gltf_numbers(g, lay, "scale", at, 2, scale);
    if (rc != SH_OK) return rc;
    turn = json_number_value(json_object_get(lay, "rotation"));
    if (other != GLTF_NONE) look->uv_set = other;
    if (look->uv_set == GLTF_NONE) look->uv_set = 0;
    const double c = cos(turn), s = sin(turn);
    const double uv[2][3] = {{c * scale[0], s * scale[1], offset[0]}, {-s * scale[0], c * scale[1], offset[1]}};
    memcpy(look->uv, uv, sizeof uv);
    return SH_OK;
}

/* ---- materials */

/* The keys of the base colour. KHR_materials_pbrSpecularGlossiness has names of its own for them. */
struct base {
    json_t *of;
    const char *factor, *texture;
};

static int find_base(struct gltf *g, const json_t *material, const char *at, struct base *base)
{
    *base = (struct base){NULL, "baseColorFactor", "baseColorTexture"};
    json_t *glossy = gltf_extension(material, "KHR_materials_pbrSpecularGlossiness");
    if (glossy == NULL) return gltf_child(g, material, "pbrMetallicRoughness", at, &base->of);
    *base = (struct base){glossy, "diffuseFactor", "diffuseTexture"};
    return SH_OK;
}

/* Keeps the share of light that goes through: from the base colour's alpha where that is blended, or from
 * KHR_materials_transmission, if that is more. */
static int keep_clear(struct gltf *g, const struct base *base, const json_t *material, const char *at,
                      struct scene_surface *surface)
{
    const char *mode = gltf_text(material, "alphaMode");
    double rgba[4] = {1, 1, 1, 1}, clear = 0.0;
    int rc = gltf_numbers(g, base->of, base->factor, at, 4, rgba);
    if (mode != NULL && strcmp(mode, "BLEND") == 0 && rgba[3] >= 0.0 && rgba[3] <= 1.0) clear = 1.0 - rgba[3];
    if (is_share(transmission(material))) clear = fmax(clear, json_number_value(transmission(material)));
    surface->clear = (float)clear;
    return rc;
}

static int keep_colour(struct gltf *g, const struct base *base, const char *at, struct scene_surface *surface)
{
    double rgba[4] = {1, 1, 1, 1};
    if (surface->has_colour) return SH_OK;
    int rc = gltf_numbers(g, base->of, base->factor, at, 4, rgba);
    for (int k = 0; k < 3 && rc == SH_OK; k++) {
        if (!(rgba[k] >= 0.0 && rgba[k] <= 1.0)) return SH_OK; /* note_odd has counted it */
        surface->colour[k] = (float)colour_srgb_encode(rgba[k]);
    }
    surface->has_colour = rc == SH_OK;
    return rc;
}

/* ---- holes */

static bool is_masked(const json_t *material)
{
    const char *mode = gltf_text(material, "alphaMode");
    return mode != NULL && strcmp(mode, "MASK") == 0;
}

/* Returns alphaCutoff, by default 0.5. */
static double cutoff_of(const json_t *material)
{
    const json_t *cutoff = json_object_get(material, "alphaCutoff");
    return json_is_number(cutoff) && json_number_value(cutoff) >= 0.0 ? json_number_value(cutoff) : 0.5;
}

/* glTF 2.0, 3.9.4: a point of a masked material is a hole where the product of three opacities, those of the base
 * colour, the texture and COLOR_0, is below alphaCutoff. The base colour has one opacity for all points. */
static int read_mask(struct gltf *g, const struct base *base, const json_t *material, const char *at,
                     struct gltf_look *look)
{
    double rgba[4] = {1, 1, 1, 1};
    if (!is_masked(material)) return SH_OK;
    int rc = gltf_numbers(g, base->of, base->factor, at, 4, rgba);
    look->opacity = rgba[3] >= 0.0 && rgba[3] <= 1.0 ? rgba[3] : 1.0; /* note_odd has counted another one */
    look->cutoff = g->b->spec->cutouts ? cutoff_of(material) : 0.0;
    return rc;
}

/* Returns the opacity of a texture below which a material has holes. For OPAQUE and MASK the format gives the figure.
 * For BLEND the format gives none, so this reader takes 0.5. */
static float solid_of(const json_t *material, const struct gltf_look *look)
{
    const char *mode = gltf_text(material, "alphaMode");
    if (!is_mode(mode) || strcmp(mode, "OPAQUE") == 0) return 0.0f;
    if (!is_masked(material)) return 0.5f;
    const double cutoff = cutoff_of(material);
    return cutoff < look->opacity ? (float)(cutoff / look->opacity) : cutoff > 0.0 ? 1.0f : 0.0f;
}

static int keep_texture(struct gltf *g, const struct base *base, const json_t *material, const char *at,
                        struct gltf_look *look)
{
    json_t *info;
    struct scene_surface *surface = &g->b->scene->surface[look->label];
    uint32_t texture = GLTF_NONE;
    int rc = gltf_child(g, base->of, base->texture, at, &info);
    if (rc == SH_OK) rc = gltf_index(g, info, "index", at, &texture);
    if (rc != SH_OK || texture == GLTF_NONE) return rc;
    rc = read_lay(g, info, at, look);
    if (rc == SH_OK && surface->texture == 0) {
        surface->solid = solid_of(material, look);
        rc = add_texture(g, texture, &surface->texture);
    }
    look->has_texture = surface->texture != 0;
    return rc;
}

int gltf_look_open(struct gltf *g, const char *object, const json_t *primitive, const char *at, struct gltf_look *look)
{
    uint32_t number;
    json_t *material = NULL;
    *look = (struct gltf_look){.opacity = 1.0};
    int rc = gltf_index(g, primitive, "material", at, &number);
    if (rc == SH_OK && number != GLTF_NONE) rc = gltf_object(g, "materials", number, &material);
    if (rc != SH_OK) return rc;
    const char *name = material != NULL ? json_string_value(json_array_get(g->names, number)) : "";
    rc = build_label(g->b, text_span_of(object), text_span_of(name), &look->label, g->err);
    if (rc != SH_OK || material == NULL) return rc;
    const struct gltf_at own = gltf_at("materials[%u]", number);
    struct base base;
    if (gltf_is_by_shaders(material)) return SH_OK;
    rc = find_base(g, material, own.text, &base);
    if (rc == SH_OK) rc = read_mask(g, &base, material, own.text, look);
    if (rc == SH_OK) rc = keep_colour(g, &base, own.text, &g->b->scene->surface[look->label]);
    if (rc == SH_OK) rc = keep_clear(g, &base, material, own.text, &g->b->scene->surface[look->label]);
    return rc == SH_OK && build_wants_textures(g->b) ? keep_texture(g, &base, material, own.text, look) : rc;
}
