/* SPDX-License-Identifier: MIT */
/* Checks the indices of a file, also in parts that no scene draws. Animations, extras and extensions that are not read
 * are left out. Indices of elements that don't exist are counted, and the first one is named. In drawn parts such an
 * index is an error when it is read, so this warns of the other parts. */
#include "core/import/gltf/gltf_indices.h"

#include <math.h>
#include <string.h>

#include "core/import/gltf/gltf_at.h"
#include "core/scene/build.h"
#include "core/text.h"

enum { MAX_DEPTH = 12 };

/* Keys that hold an index, or a list of them. Where a key has another meaning elsewhere, `within` limits it to objects
 * under that key. */
static const struct {
    const char *key, *within, *list;
} indices[] = {{"mesh", NULL, "meshes"},
               {"skin", NULL, "skins"},
               {"camera", NULL, "cameras"},
               {"material", NULL, "materials"},
               {"children", NULL, "nodes"},
               {"joints", NULL, "nodes"},
               {"nodes", "scenes", "nodes"},
               {"skeleton", NULL, "nodes"},
               {"scene", "", "scenes"},
               {"index", NULL, "textures"},
               {"source", NULL, "images"},
               {"sampler", "textures", "samplers"},
               {"indices", "primitives", "accessors"},
               {"inverseBindMatrices", NULL, "accessors"},
               {"bufferView", NULL, "bufferViews"},
               {"buffer", NULL, "buffers"}};

/* Objects under these keys may have keys of any meaning, or are not read. */
static const char *const passed_over[] = {"extras",     "animations", "asset", "extensionsUsed",
                                          "attributes", "targets",    NULL};
static const char *const entered[] = {"EXT_mesh_gpu_instancing",
                                      "EXT_meshopt_compression",
                                      "KHR_meshopt_compression",
                                      "EXT_texture_webp",
                                      "KHR_texture_basisu",
                                      "KHR_draco_mesh_compression",
                                      NULL};

struct search {
    const json_t *root;
    uint64_t n;           /* indices that name no element */
    struct gltf_at first; /* place of the first index that names no element; `number`: its value; `list`: the list */
    double number;
    const char *list;
};

static void look_at(struct search *s, const json_t *value, const char *list, const char *at)
{
    const double number = json_number_value(value);
    const size_t n = json_array_size(json_object_get(s->root, list));
    if (json_is_number(value) && number >= 0.0 && number < (double)n && floor(number) == number) return;
    if (!json_is_number(value) || s->n++ > 0) return; /* a value that is no number is an error where it is read */
    s->first = gltf_at("%s", at);
    s->number = number;
    s->list = list;
}

static void look_at_all(struct search *s, const json_t *value, const char *list, const char *at)
{
    if (!json_is_array(value)) look_at(s, value, list, at);
    for (size_t i = 0; i < json_array_size(value); i++)
        look_at(s, json_array_get(value, i), list, gltf_at("%.80s[%zu]", at, i).text);
}

/* In attributes and targets every key holds an accessor. Attributes of Draco hold its own numbers, and are left out. */
static void look_at_attributes(struct search *s, const json_t *object, const char *at)
{
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)object, key, value)
        look_at(s, value, "accessors", gltf_at("%.60s.%.32s", at, key).text);
}

static const char *list_of(const char *key, const char *within)
{
    for (size_t i = 0; i < sizeof indices / sizeof indices[0]; i++)
        if (strcmp(indices[i].key, key) == 0 && (indices[i].within == NULL || strcmp(indices[i].within, within) == 0))
            return indices[i].list;
    return NULL;
}

static bool is_entered(const char *key, const char *within)
{
    if (strcmp(within, "extensions") != 0) return !text_is_one_of(text_span_of(key), passed_over);
    return text_is_one_of(text_span_of(key), entered) || strncmp(key, "KHR_materials_", 14) == 0;
}

static void walk(struct search *s, const json_t *value, const char *key, const char *at, int depth);

static void walk_object(struct search *s, const json_t *object, const char *within, const char *at, int depth)
{
    const char *key;
    json_t *value;
    json_object_foreach((json_t *)object, key, value)
    {
        const struct gltf_at place = gltf_at("%.60s%s%.32s", at, *at != '\0' ? "." : "", key);
        const char *list = list_of(key, within);
        const bool is_draco = strcmp(within, "KHR_draco_mesh_compression") == 0;
        if (strcmp(key, "attributes") == 0 && !is_draco) look_at_attributes(s, value, place.text);
        for (size_t i = 0; strcmp(key, "targets") == 0 && i < json_array_size(value); i++)
            look_at_attributes(s, json_array_get(value, i), gltf_at("%.80s[%zu]", place.text, i).text);
        if (list != NULL && !json_is_object(value) && !json_is_object(json_array_get(value, 0)))
            look_at_all(s, value, list, place.text);
        else if (is_entered(key, within))
            walk(s, value, key, place.text, depth + 1);
    }
}

/* key is the key under which the list or the object itself stands. */
static void walk(struct search *s, const json_t *value, const char *key, const char *at, int depth)
{
    if (depth > MAX_DEPTH) return;
    if (json_is_object(value)) walk_object(s, value, key, at, depth);
    for (size_t i = 0; i < json_array_size(value); i++)
        if (json_is_object(json_array_get(value, i)))
            walk_object(s, json_array_get(value, i), key, gltf_at("%.80s[%zu]", at, i).text, depth);
}

void gltf_say_indices(const struct scene_build *b, const json_t *root)
{
    struct search s = {.root = root};
    walk(&s, root, "", "", 0);
    if (s.n > 0)
        build_warn(b, "%llu ind%s missing elements; the first: %s is %g, but there are %zu %s", (unsigned long long)s.n,
                   s.n > 1 ? "ices name" : "ex names", s.first.text, s.number,
                   json_array_size(json_object_get(root, s.list)), s.list);
}
