/* SPDX-License-Identifier: MIT */
#include "core/import/import_material.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <assimp/GltfMaterial.h>
#include <assimp/material.h>
#include <assimp/scene.h>

#include "core/assimp_lib.h"
#include "core/colour.h"
#include "core/import/gltf/gltf_read.h"
#include "core/scene/build_surfaces.h"

/* Materials that Assimp makes up where a file has none. */
static bool is_made_up(const char *material)
{
    return material[0] == '\0' || strcmp(material, AI_DEFAULT_MATERIAL_NAME) == 0 ||
           strcmp(material, "<IFCDefault>") == 0;
}

static bool is_share(float x)
{
    return x >= 0.0f && x <= 1.0f;
}

static bool is_colour(const struct aiColor4D *c)
{
    return is_share(c->r) && is_share(c->g) && is_share(c->b);
}

/* Keeps a surface's first colour. glTF has linear colours. */
static void keep_colour(const struct assimp_lib *lib, const struct scene_build *b, const struct aiMaterial *material,
                        struct scene_surface *surface)
{
    struct aiColor4D c;
    if (surface->has_colour || is_made_up(surface->material)) return;
    if (lib->aiGetMaterialColor(material, AI_MATKEY_COLOR_DIFFUSE, &c) != AI_SUCCESS || !is_colour(&c)) return;
    const float rgb[3] = {c.r, c.g, c.b};
    for (int i = 0; i < 3; i++)
        surface->colour[i] = gltf_is_name(b->spec->file) ? (float)colour_srgb_encode((double)rgb[i]) : rgb[i];
    surface->has_colour = 1;
}

void import_say_colours(const struct assimp_lib *lib, const struct scene_build *b, const struct aiScene *in)
{
    struct aiString first = {0}, name = {0};
    unsigned n = 0;
    for (unsigned i = 0; i < in->mNumMaterials; i++) {
        struct aiColor4D c;
        if (lib->aiGetMaterialString(in->mMaterials[i], AI_MATKEY_NAME, &name) != AI_SUCCESS || is_made_up(name.data) ||
            lib->aiGetMaterialColor(in->mMaterials[i], AI_MATKEY_COLOR_DIFFUSE, &c) != AI_SUCCESS || is_colour(&c))
            continue;
        if (n++ == 0) first = name;
    }
    if (n > 0)
        build_warn(b, "%u material%s with a colour beyond 0 to 1, which is left out; the first is '%.100s'", n,
                   n > 1 ? "s" : "", first.data);
}

/* Keeps transparency, also of glTF packed by Draco; for other glTF their own reader does it. */
static void keep_clear(const struct assimp_lib *lib, const struct aiMaterial *material, struct scene_surface *surface)
{
    ai_real opacity = 1.0f;
    if (surface->clear > 0.0f || is_made_up(surface->material)) return;
    if (lib->aiGetMaterialFloatArray(material, AI_MATKEY_OPACITY, &opacity, NULL) != AI_SUCCESS) return;
    if (opacity >= 0.0f && opacity < 1.0f) surface->clear = 1.0f - opacity;
}

void import_rgb(struct scene_build *b, const struct aiColor4D *colour, uint8_t rgb[4])
{
    double c[3] = {(double)colour->r, (double)colour->g, (double)colour->b};
    for (int k = 0; k < 3 && gltf_is_name(b->spec->file); k++)
        c[k] = colour_srgb_encode(c[k]);
    build_rgb(b, c, 255.0, rgb);
}

/* ---- textures */

/* A texture as the material names it. */
struct slot {
    struct aiString path;
    enum aiTextureMapMode wrap[2];
    unsigned uv_set, flags;
};

static bool find_slot(const struct assimp_lib *lib, const struct aiMaterial *material, enum aiTextureType type,
                      struct slot *slot)
{
    *slot = (struct slot){.wrap = {aiTextureMapMode_Wrap, aiTextureMapMode_Wrap}};
    return lib->aiGetMaterialTexture(material, type, 0, &slot->path, NULL, &slot->uv_set, NULL, NULL, slot->wrap,
                                     &slot->flags) == AI_SUCCESS &&
           slot->path.length > 0;
}

/* Physically based materials have a base colour, and not all of them a diffuse one. */
static bool find_diffuse(const struct assimp_lib *lib, const struct aiMaterial *material, struct slot *slot)
{
    return find_slot(lib, material, aiTextureType_DIFFUSE, slot) ||
           find_slot(lib, material, aiTextureType_BASE_COLOR, slot);
}

void import_uv(const struct assimp_lib *lib, const struct aiMaterial *material, struct import_uv *uv)
{
    struct slot slot;
    struct aiUVTransform lay;
    enum aiTextureType type = aiTextureType_DIFFUSE;
    *uv = (struct import_uv){.scale = {1.0, 1.0}};
    if (material == NULL) return;
    if (!find_slot(lib, material, type, &slot) && !find_slot(lib, material, type = aiTextureType_BASE_COLOR, &slot) &&
        !find_slot(lib, material, type = aiTextureType_OPACITY, &slot))
        return;
    uv->set = slot.uv_set;
    if (lib->aiGetMaterialUVTransform(material, AI_MATKEY_UVTRANSFORM(type, 0), &lay) != AI_SUCCESS) return;
    uv->scale[0] = (double)lay.mScaling.x;
    uv->scale[1] = (double)lay.mScaling.y;
    uv->shift[0] = (double)lay.mTranslation.x;
    uv->shift[1] = (double)lay.mTranslation.y;
    uv->is_turned = fabs((double)lay.mRotation) > 1e-6;
}

static enum texture_wrap wrap_of(enum aiTextureMapMode mode)
{
    return mode == aiTextureMapMode_Clamp    ? TEXTURE_CLAMP
           : mode == aiTextureMapMode_Mirror ? TEXTURE_MIRROR
           : mode == aiTextureMapMode_Decal  ? TEXTURE_DECAL
                                             : TEXTURE_REPEAT;
}

static const char *without_folder(const char *path)
{
    const char *slash = strrchr(path, '/'), *back = strrchr(path, '\\');
    const char *last = back != NULL && (slash == NULL || back > slash) ? back : slash;
    return last != NULL ? last + 1 : path;
}

/* Finds an image within the mesh's file, by "*3" or by the name that it once had as a file. *number is -1 for none. */
static const struct aiTexture *find_within(const struct aiScene *in, const char *path, long *number)
{
    *number = path[0] == '*' ? strtol(path + 1, NULL, 10) : -1;
    for (unsigned i = 0; i < in->mNumTextures && path[0] != '*'; i++)
        if (in->mTextures[i]->mFilename.length > 0 &&
            strcmp(without_folder(in->mTextures[i]->mFilename.data), without_folder(path)) == 0)
            *number = (long)i;
    return *number >= 0 && *number < (long)in->mNumTextures ? in->mTextures[*number] : NULL;
}

/* An image within the mesh's file gets that file's name and its own number. In Assimp, height 0 means that the image is
 * packed (PNG, JPEG), and its width counts bytes. */
static int add_image(struct scene_build *b, const struct aiScene *in, const struct slot *slot, uint16_t *number,
                     struct sh_err *err)
{
    char name[sizeof slot->path.data + 256];
    long at;
    const struct aiTexture *within = find_within(in, slot->path.data, &at);
    if (within == NULL && slot->path.data[0] == '*') return SH_OK;
    struct build_image image = {.name = {slot->path.data, strnlen(slot->path.data, slot->path.length)},
                                .wrap = {wrap_of(slot->wrap[0]), wrap_of(slot->wrap[1])}};
    if (within != NULL) {
        int len = snprintf(name, sizeof name, "%.255s*%ld", without_folder(b->spec->file), at);
        image.name = (struct text_span){name, (size_t)len};
        image.bytes = within->pcData;
        image.n_bytes = within->mHeight == 0 ? within->mWidth : 4 * (size_t)within->mWidth * within->mHeight;
        image.raw_width = within->mHeight == 0 ? 0 : within->mWidth;
        image.raw_height = within->mHeight;
    }
    return build_texture(b, &image, number, err);
}

/* Returns the opacity below which a texel is a hole. glTF says whether alpha counts; other formats may say that it
 * doesn't. */
static float solid_from(const struct assimp_lib *lib, const struct scene_build *b, const struct aiMaterial *material,
                        unsigned flags)
{
    struct aiString mode;
    ai_real cutoff = 0.5f;
    if ((flags & aiTextureFlags_IgnoreAlpha) != 0) return 0.0f;
    if (!gltf_is_name(b->spec->file) ||
        lib->aiGetMaterialString(material, AI_MATKEY_GLTF_ALPHAMODE, &mode) != AI_SUCCESS)
        return 0.5f;
    if (strcmp(mode.data, "OPAQUE") == 0) return 0.0f;
    if (strcmp(mode.data, "MASK") != 0) return 0.5f;
    lib->aiGetMaterialFloatArray(material, AI_MATKEY_GLTF_ALPHACUTOFF, &cutoff, NULL);
    return cutoff > 0.0f && cutoff <= 1.0f ? cutoff : cutoff > 1.0f ? 1.0f : 0.0f;
}

static int keep_textures(const struct assimp_lib *lib, struct scene_build *b, const struct aiScene *in,
                         const struct aiMaterial *material, struct scene_surface *surface, struct sh_err *err)
{
    struct slot slot;
    int rc = SH_OK;
    if (surface->texture == 0 && find_diffuse(lib, material, &slot)) {
        surface->solid = solid_from(lib, b, material, slot.flags);
        rc = add_image(b, in, &slot, &surface->texture, err);
    }
    if (rc == SH_OK && surface->opacity == 0 && find_slot(lib, material, aiTextureType_OPACITY, &slot)) {
        surface->solid = 0.5f;
        rc = add_image(b, in, &slot, &surface->opacity, err);
    }
    return rc;
}

int import_material(const struct assimp_lib *lib, struct scene_build *b, const struct aiScene *in,
                    const struct aiMaterial *material, struct scene_surface *surface, struct sh_err *err)
{
    keep_colour(lib, b, material, surface);
    keep_clear(lib, material, surface);
    return build_wants_textures(b) ? keep_textures(lib, b, in, material, surface, err) : SH_OK;
}
