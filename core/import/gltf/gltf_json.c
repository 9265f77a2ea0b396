/* SPDX-License-Identifier: MIT */
#include "core/import/gltf/gltf_json.h"

#include <math.h>

#include "core/import/gltf/gltf.h"

#define MOST_WHOLE 0x1p53 /* JSON numbers are read as doubles, which hold whole numbers up to here exactly */

int gltf_list(struct gltf *g, const json_t *of, const char *key, const char *at, json_t **out)
{
    *out = json_object_get(of, key);
    if (*out == NULL || json_is_array(*out)) return SH_OK;
    return gltf_fail(g, "%s%s%s is not a list", at, *at != '\0' ? "." : "", key);
}

int gltf_object(struct gltf *g, const char *list, uint32_t i, json_t **out)
{
    json_t *all;
    int rc = gltf_list(g, g->root, list, "", &all);
    if (rc != SH_OK) return rc;
    if (i == GLTF_NONE) return gltf_fail(g, "an index into %s is missing", list);
    if (i >= json_array_size(all))
        return gltf_fail(g, "%s[%u] is missing: there are %zu", list, i, json_array_size(all));
    *out = json_array_get(all, i);
    return json_is_object(*out) ? SH_OK : gltf_fail(g, "%s[%u] is not an object", list, i);
}

int gltf_whole(struct gltf *g, const json_t *of, const char *key, const char *at, uint64_t *out)
{
    const json_t *value = json_object_get(of, key);
    const double number = json_number_value(value);
    if (value == NULL) return SH_OK;
    if (!json_is_number(value) || !(number >= 0.0 && number <= MOST_WHOLE) || floor(number) != number)
        return gltf_fail(g, "%s%s%s is not a whole number from 0 on", at, *at != '\0' ? "." : "", key);
    *out = (uint64_t)number;
    return SH_OK;
}

int gltf_index(struct gltf *g, const json_t *of, const char *key, const char *at, uint32_t *out)
{
    uint64_t whole = GLTF_NONE;
    int rc = gltf_whole(g, of, key, at, &whole);
    if (rc != SH_OK) return rc;
    if (whole >= GLTF_NONE && json_object_get(of, key) != NULL)
        return gltf_fail(g, "%s.%s is %llu; allowed are indices below %u", at, key, (unsigned long long)whole,
                         GLTF_NONE);
    *out = (uint32_t)whole;
    return SH_OK;
}

int gltf_numbers(struct gltf *g, const json_t *of, const char *key, const char *at, size_t n, double *out)
{
    json_t *list;
    int rc = gltf_list(g, of, key, at, &list);
    if (rc != SH_OK || list == NULL) return rc;
    for (size_t i = 0; i < n; i++)
        if (json_array_size(list) != n || !json_is_number(json_array_get(list, i)))
            return gltf_fail(g, "%s.%s is not %zu numbers", at, key, n);
    for (size_t i = 0; i < n; i++)
        out[i] = json_number_value(json_array_get(list, i));
    return SH_OK;
}

int gltf_child(struct gltf *g, const json_t *of, const char *key, const char *at, json_t **out)
{
    *out = json_object_get(of, key);
    if (*out == NULL || json_is_object(*out)) return SH_OK;
    return gltf_fail(g, "%s.%s is not an object", at, key);
}

const char *gltf_text(const json_t *of, const char *key)
{
    return json_string_value(json_object_get(of, key));
}
