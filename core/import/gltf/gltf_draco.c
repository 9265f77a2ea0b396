/* SPDX-License-Identifier: MIT */
#include "core/import/gltf/gltf_draco.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/import/gltf/gltf_extensions.h"
#include "core/scene/build.h"

/* ---- packed primitives */

static bool is_draco(const json_t *primitive)
{
    return gltf_extension(primitive, "KHR_draco_mesh_compression") != NULL;
}

/* Whether an accessor has no numbers of its own. */
static bool is_empty(const json_t *root, const json_t *number)
{
    const json_t *accessor =
        json_array_get(json_object_get(root, "accessors"), (size_t)fmin(fmax(json_number_value(number), 0.0), 0x1p32));
    return json_object_get(accessor, "bufferView") == NULL && json_object_get(accessor, "sparse") == NULL;
}

/* Whether a primitive has its positions or its indices only in Draco's form. */
static bool is_packed(const json_t *root, const json_t *primitive)
{
    const json_t *indices = json_object_get(primitive, "indices");
    return is_draco(primitive) &&
           (is_empty(root, json_object_get(json_object_get(primitive, "attributes"), "POSITION")) ||
            (indices != NULL && is_empty(root, indices)));
}

/* A file that doesn't require Draco should have plain accessors, too, but some writers leave them out. A file that
 * requires Draco may have no primitive that uses it: then nothing is packed. */
bool gltf_has_packed(const json_t *root)
{
    const json_t *meshes = json_object_get(root, "meshes");
    const bool is_required = gltf_is_required(root, "KHR_draco_mesh_compression");
    for (size_t i = 0; i < json_array_size(meshes); i++) {
        const json_t *primitives = json_object_get(json_array_get(meshes, i), "primitives");
        for (size_t k = 0; k < json_array_size(primitives); k++) {
            const json_t *primitive = json_array_get(primitives, k);
            if (is_required ? is_draco(primitive) : is_packed(root, primitive)) return true;
        }
    }
    return false;
}

/* ---- what Assimp ignores */

static bool has_instances(const json_t *node)
{
    return gltf_extension(node, "EXT_mesh_gpu_instancing") != NULL;
}

static bool has_weights(const json_t *node_or_mesh)
{
    const json_t *weights = json_object_get(node_or_mesh, "weights");
    for (size_t i = 0; i < json_array_size(weights); i++)
        if (json_number_value(json_array_get(weights, i)) != 0.0) return true;
    return false;
}

static bool has_webp(const json_t *texture)
{
    return json_object_get(texture, "source") == NULL && gltf_extension(texture, "EXT_texture_webp") != NULL;
}

static bool is_any(const json_t *unused)
{
    (void)unused;
    return true;
}

static const struct {
    const char *list, *says;
    bool (*is)(const json_t *element);
    bool is_texture;
} ignored[] = {{"skins", "skins", is_any, false},
               {"nodes", "instances (EXT_mesh_gpu_instancing)", has_instances, false},
               {"nodes", "that nodes are hidden (KHR_node_visibility)", gltf_is_hidden, false},
               {"nodes", "weights of morph targets", has_weights, false},
               {"meshes", "weights of morph targets", has_weights, false},
               {"textures", "WebP images", has_webp, true}};

static bool has(const json_t *root, size_t i)
{
    const json_t *list = json_object_get(root, ignored[i].list);
    for (size_t k = 0; k < json_array_size(list); k++)
        if (ignored[i].is(json_array_get(list, k))) return true;
    return false;
}

static void warn_ignored(const struct scene_build *b, const json_t *root)
{
    char text[256] = "";
    const char *last = NULL;
    size_t at = 0;
    for (size_t i = 0; i < sizeof ignored / sizeof ignored[0]; i++) {
        if (ignored[i].is_texture && !build_wants_textures(b)) continue;
        if ((last != NULL && strcmp(last, ignored[i].says) == 0) || !has(root, i)) continue;
        at += (size_t)snprintf(text + at, sizeof text - at, "%s%s", last != NULL ? ", " : "", ignored[i].says);
        last = ignored[i].says;
    }
    if (last != NULL)
        build_warn(b, "its meshes are packed by Draco, so Assimp reads it, which ignores: %s; unpack it for these",
                   text);
}

/* Assimp leaves these out, or misreads them. */
int gltf_check_for_assimp(struct scene_build *b, const json_t *root, struct sh_err *err)
{
    static const char *const other[] = {"EXT_mesh_gpu_instancing", "KHR_mesh_quantization", "EXT_meshopt_compression",
                                        "KHR_meshopt_compression", "KHR_node_visibility"};
    for (size_t i = 0; i < sizeof other / sizeof other[0]; i++)
        if (gltf_is_required(root, other[i]))
            return build_fail(b, SH_EINPUT, err, "it needs KHR_draco_mesh_compression and %s; allowed is one of them",
                              other[i]);
    warn_ignored(b, root);
    return SH_OK;
}
