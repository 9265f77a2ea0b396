/* SPDX-License-Identifier: MIT */
/* The list of known extensions, and checks of those that a file names. */
#include "core/import/gltf/gltf_extensions.h"

#include <stdio.h>
#include <string.h>

#include "core/import/gltf/gltf_draco.h"
#include "core/scene/build.h"

/* A name that ends in * stands for all that begin so. */
static const char *const known[] = {
    /* read */
    "KHR_mesh_quantization", "KHR_texture_transform", "KHR_node_visibility", "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression", "KHR_meshopt_compression", "EXT_texture_webp", "KHR_draco_mesh_compression",
    /* image formats that are not read, and colours by shaders: where such an image or colour is missing, a warning
     * says so */
    "KHR_techniques_webgl", "KHR_technique_webgl", "KHR_texture_basisu", "EXT_texture_avif", "MSFT_texture_dds",
    /* These extensions don't change what a laser sees: lights, gloss, movement, levels of detail, metadata. */
    "KHR_materials_*", "ADOBE_materials_*", "NV_materials_mdl", "KHR_lights_*", "EXT_lights_*", "KHR_animation_pointer",
    "KHR_xmp", "KHR_xmp_json_ld", "KHR_node_selectability", "KHR_node_hoverability", "KHR_interactivity", "KHR_audio*",
    "KHR_physics_*", "OMI_*", "MSFT_lod", "MSFT_packing_*", "MSFT_audio_emitter", "AGI_articulations",
    "AGI_stk_metadata", "CESIUM_primitive_outline", "EXT_mesh_features", "EXT_feature_metadata",
    "EXT_structural_metadata", "EXT_instance_features", "FB_geometry_metadata", "GRIFFEL_bim_data", "GODOT_single_root",
    "VRM", "VRMC_*"};

#define KNOWN_SAYS                                                                                        \
    "KHR_mesh_quantization, KHR_texture_transform, KHR_draco_mesh_compression, EXT_meshopt_compression, " \
    "EXT_mesh_gpu_instancing, EXT_texture_webp, and those of materials, lights and metadata"

static bool is_known(const char *name)
{
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        const size_t n = strlen(known[i]);
        const bool begins = known[i][n - 1] == '*';
        if (begins ? strncmp(name, known[i], n - 1) == 0 : strcmp(name, known[i]) == 0) return true;
    }
    return false;
}

static bool is_in(const json_t *list, const char *name)
{
    for (size_t i = 0; i < json_array_size(list); i++) {
        const char *text = json_string_value(json_array_get(list, i));
        if (text != NULL && strcmp(text, name) == 0) return true;
    }
    return false;
}

bool gltf_is_required(const json_t *root, const char *extension)
{
    return is_in(json_object_get(root, "extensionsRequired"), extension);
}

static void warn_unknown(const struct scene_build *b, const json_t *used)
{
    char names[256] = "";
    size_t at = 0;
    unsigned n = 0;
    for (size_t i = 0; i < json_array_size(used); i++) {
        const char *name = json_string_value(json_array_get(used, i));
        if (name == NULL || is_known(name)) continue;
        if (at < 200) at += (size_t)snprintf(names + at, sizeof names - at, "%s%.48s", n > 0 ? ", " : "", name);
        n++;
    }
    if (n > 0) build_warn(b, "%u extensions are unknown but not required; they are not read: %s", n, names);
}

json_t *gltf_extension(const json_t *of, const char *name)
{
    json_t *found = json_object_get(json_object_get(of, "extensions"), name);
    return json_is_object(found) ? found : NULL;
}

bool gltf_is_hidden(const json_t *node)
{
    return json_is_false(json_object_get(gltf_extension(node, "KHR_node_visibility"), "visible"));
}

bool gltf_is_by_shaders(const json_t *material)
{
    return gltf_extension(material, "KHR_techniques_webgl") != NULL ||
           gltf_extension(material, "KHR_technique_webgl") != NULL;
}

int gltf_check_extensions(struct scene_build *b, const json_t *root, bool *by_assimp, struct sh_err *err)
{
    const json_t *required = json_object_get(root, "extensionsRequired"),
                 *used = json_object_get(root, "extensionsUsed");
    for (size_t i = 0; i < json_array_size(required); i++) {
        const char *name = json_string_value(json_array_get(required, i));
        if (name == NULL) return build_fail(b, SH_EINPUT, err, "extensionsRequired[%zu] is not a text", i);
        if (!is_known(name))
            return build_fail(b, SH_EINPUT, err,
                              "it requires the extension %.60s, which is not known; known are " KNOWN_SAYS, name);
    }
    warn_unknown(b, used);
    if (is_in(used, "KHR_techniques_webgl") || is_in(used, "KHR_technique_webgl"))
        build_warn(b, "its colours come from shaders (KHR_techniques_webgl), which are not read");
    *by_assimp = gltf_has_packed(root);
    return *by_assimp ? gltf_check_for_assimp(b, root, err) : SH_OK;
}
