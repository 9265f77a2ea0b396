/* SPDX-License-Identifier: MIT */
/* Accessors and buffer views. Offsets in the file are up to 2^53, counts below 2^32 and strides up to 2^16. So sums and
 * products of them stay within 64 bits. */
#include "core/import/gltf/gltf_accessor.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "core/import/gltf/gltf.h"
#include "core/import/gltf/gltf_at.h"
#include "core/import/gltf/gltf_extensions.h"
#include "core/import/gltf/gltf_file.h"
#include "core/import/gltf/gltf_json.h"
#include "core/import/gltf/gltf_meshopt.h"

enum { MAX_STRIDE = 1 << 16, MAX_ZEROS = 1 << 24 };

static const struct {
    const char *name;
    uint32_t n;
} types[] = {{"SCALAR", 1}, {"VEC2", 2}, {"VEC3", 3}, {"VEC4", 4}, {"MAT2", 4}, {"MAT3", 9}, {"MAT4", 16}};

static uint32_t components_of(const char *type)
{
    for (size_t i = 0; type != NULL && i < sizeof types / sizeof types[0]; i++)
        if (strcmp(types[i].name, type) == 0) return types[i].n;
    return 0;
}

/* 0: there is no such component. */
static uint32_t size_of(uint64_t component)
{
    const uint64_t type = component - GLTF_I8;
    return type <= NUMBER_FLOAT && type != NUMBER_I32 ? number_size[type] : 0;
}

/* ---- buffer views */

static const json_t *meshopt_of(const json_t *object)
{
    const json_t *more = gltf_extension(object, "EXT_meshopt_compression");
    return more != NULL ? more : gltf_extension(object, "KHR_meshopt_compression");
}

/* Finds the bytes that a buffer view, or an extension of it, names. */
static int open_part(struct gltf *g, const json_t *object, const char *at, struct gltf_bytes *out)
{
    uint64_t offset = 0, length = 0;
    uint32_t buffer;
    struct gltf_bytes whole;
    int rc = gltf_index(g, object, "buffer", at, &buffer);
    if (rc == SH_OK) rc = gltf_whole(g, object, "byteOffset", at, &offset);
    if (rc == SH_OK) rc = gltf_whole(g, object, "byteLength", at, &length);
    if (rc == SH_OK) rc = gltf_buffer(g, buffer, &whole);
    if (rc != SH_OK) return rc;
    if (offset > whole.n || length > whole.n - offset)
        return gltf_fail(g, "%s: bytes %llu to %llu go beyond buffers[%u], which has %zu", at,
                         (unsigned long long)offset, (unsigned long long)(offset + length), buffer, whole.n);
    *out = (struct gltf_bytes){whole.p + offset, (size_t)length};
    return SH_OK;
}

/* stride: that of the buffer view; 0: it has none. */
static int open_packed(struct gltf *g, const json_t *more, const char *at, uint64_t stride, struct gltf_kept *out)
{
    struct gltf_packed p = {.mode = gltf_text(more, "mode"), .filter = gltf_text(more, "filter")};
    int rc = open_part(g, more, at, &p.from);
    if (rc == SH_OK) rc = gltf_whole(g, more, "byteStride", at, &p.stride);
    if (rc == SH_OK) rc = gltf_whole(g, more, "count", at, &p.count);
    if (rc == SH_OK && stride != 0 && stride != p.stride)
        return gltf_fail(g, "%s.byteStride is %llu, but its packed elements have %llu bytes; both must be equal", at,
                         (unsigned long long)stride, (unsigned long long)p.stride);
    return rc == SH_OK ? gltf_meshopt(g->b, &p, at, &out->own, &out->bytes, g->err) : rc;
}

int gltf_buffer_view(struct gltf *g, uint32_t view, struct gltf_bytes *out, uint64_t *stride)
{
    const struct gltf_at at = gltf_at("bufferViews[%u]", view);
    json_t *object;
    *stride = 0;
    int rc = gltf_object(g, "bufferViews", view, &object);
    if (rc == SH_OK) rc = gltf_whole(g, object, "byteStride", at.text, stride);
    if (rc != SH_OK) return rc;
    if (*stride > MAX_STRIDE)
        return gltf_fail(g, "%s.byteStride is %llu; allowed are up to %d", at.text, (unsigned long long)*stride,
                         MAX_STRIDE);
    struct gltf_kept *kept = &g->view[view];
    const json_t *more = meshopt_of(object);
    if (!kept->is_open)
        rc = more != NULL ? open_packed(g, more, at.text, *stride, kept) : open_part(g, object, at.text, &kept->bytes);
    kept->is_open = rc == SH_OK;
    *out = kept->bytes;
    return rc;
}

/* Finds v->count elements at an offset within a buffer view. */
static int open_elements(struct gltf *g, const json_t *of, const char *at, uint32_t size, struct gltf_view *v)
{
    struct gltf_bytes bytes;
    uint64_t offset = 0, stride;
    uint32_t view;
    int rc = gltf_index(g, of, "bufferView", at, &view);
    if (rc == SH_OK) rc = gltf_whole(g, of, "byteOffset", at, &offset);
    if (rc == SH_OK) rc = gltf_buffer_view(g, view, &bytes, &stride);
    if (rc != SH_OK) return rc;
    v->stride = stride != 0 ? stride : size;
    const uint64_t need = v->count > 0 ? (v->count - 1) * v->stride + size : 0;
    if (offset > bytes.n || need > bytes.n - offset)
        return gltf_fail(g, "%s: %u elements from byte %llu on go beyond bufferViews[%u], which has %zu bytes", at,
                         v->count, (unsigned long long)offset, view, bytes.n);
    v->data = bytes.p + offset;
    return SH_OK;
}

/* ---- sparse accessors: a copy in which some elements are replaced */

static int put_sparse(struct gltf *g, const json_t *sparse, const char *at, const struct gltf_view *v, uint32_t size,
                      uint8_t *to)
{
    const struct gltf_at at_index = gltf_at("%.70s.sparse.indices", at), at_value = gltf_at("%.70s.sparse.values", at);
    const json_t *indices = json_object_get(sparse, "indices");
    uint64_t component = 0;
    struct gltf_view index = {0}, value = {0};
    int rc = gltf_index(g, sparse, "count", at, &index.count);
    if (rc == SH_OK) rc = gltf_whole(g, indices, "componentType", at_index.text, &component);
    if (rc != SH_OK) return rc;
    if (index.count > v->count || (component != GLTF_U8 && component != GLTF_U16 && component != GLTF_U32))
        return gltf_fail(g, "%s.sparse has %u indices of type %llu for %u elements", at, index.count,
                         (unsigned long long)component, v->count);
    index.component = (enum gltf_component)component;
    value.count = index.count;
    rc = open_elements(g, indices, at_index.text, size_of(component), &index);
    if (rc == SH_OK) rc = open_elements(g, json_object_get(sparse, "values"), at_value.text, size, &value);
    for (uint32_t i = 0; i < index.count && rc == SH_OK; i++) {
        const double k = gltf_value(&index, i, 0);
        if (k >= (double)v->count) return gltf_fail(g, "%s is %.0f; there are %u elements", at_index.text, k, v->count);
        memcpy(to + (size_t)k * size, value.data + i * value.stride, size);
    }
    return rc;
}

static int open_sparse(struct gltf *g, const json_t *sparse, const char *at, uint32_t size, struct gltf_view *v,
                       struct gltf_kept *kept)
{
    int rc = SH_OK;
    if (!kept->is_open) {
        kept->own = calloc(v->count + (size_t)1, size);
        if (kept->own == NULL) return build_fail(g->b, SH_ENOMEM, g->err, "no memory for %s", at);
        for (uint32_t i = 0; i < v->count && v->data != NULL; i++)
            memcpy((uint8_t *)kept->own + (size_t)i * size, v->data + i * v->stride, size);
        rc = put_sparse(g, sparse, at, v, size, kept->own);
    }
    kept->is_open = rc == SH_OK;
    v->data = kept->own;
    v->stride = size;
    return rc;
}

/* ---- accessors */

/* An accessor without a buffer view holds zeros. No byte of the file stands for them, so a file of a few hundred bytes
 * could count billions, and keep the reader busy for minutes. */
static int check_zeros(struct gltf *g, const char *at, const struct gltf_view *v)
{
    if (v->count <= MAX_ZEROS) return SH_OK;
    return gltf_fail(g, "%s.count is %u, without a bufferView; allowed are up to %d zeros", at, v->count, MAX_ZEROS);
}

static int open_accessor(struct gltf *g, uint32_t accessor, const json_t *object, struct gltf_view *v)
{
    const struct gltf_at at = gltf_at("accessors[%u]", accessor);
    const uint32_t size = size_of(v->component) * v->n_components;
    const json_t *sparse = json_object_get(object, "sparse");
    int rc = json_object_get(object, "bufferView") != NULL ? open_elements(g, object, at.text, size, v)
                                                           : check_zeros(g, at.text, v);
    if (rc == SH_OK && sparse != NULL) rc = open_sparse(g, sparse, at.text, size, v, &g->accessor[accessor]);
    return rc;
}

int gltf_view_open(struct gltf *g, uint32_t accessor, const char *type, struct gltf_view *out)
{
    const struct gltf_at at = gltf_at("accessors[%u]", accessor);
    json_t *object;
    uint64_t component = 0;
    *out = (struct gltf_view){.n_components = components_of(type)};
    int rc = gltf_object(g, "accessors", accessor, &object);
    if (rc == SH_OK) rc = gltf_whole(g, object, "componentType", at.text, &component);
    if (rc == SH_OK) rc = gltf_index(g, object, "count", at.text, &out->count);
    if (rc != SH_OK) return rc;
    const char *is = gltf_text(object, "type");
    if (is == NULL || strcmp(is, type) != 0)
        return gltf_fail(g, "%s.type is %.20s; allowed here is %s", at.text, is != NULL ? is : "not there", type);
    if (size_of(component) == 0)
        return gltf_fail(g, "%s.componentType is %llu; allowed are 5120 to 5123, 5125 and 5126", at.text,
                         (unsigned long long)component);
    if (out->count == GLTF_NONE) return gltf_fail(g, "%s.count is missing", at.text);
    out->component = (enum gltf_component)component;
    out->is_normalized = json_is_true(json_object_get(object, "normalized"));
    return open_accessor(g, accessor, object, out);
}

/* Largest whole numbers, by number_type. */
static const double most[] = {127.0, 255.0, 32767.0, 65535.0, 0.0, 4294967295.0};

double gltf_value(const struct gltf_view *v, uint32_t i, uint32_t k)
{
    if (v->data == NULL) return 0.0;
    const enum number_type type = (enum number_type)(v->component - GLTF_I8);
    const double value = le_get_number(v->data + i * v->stride + (size_t)k * number_size[type], type);
    return v->is_normalized && type != NUMBER_FLOAT ? fmax(value / most[type], -1.0) : value;
}

double gltf_step(const struct gltf_view *v)
{
    if (v->component == GLTF_F32) return 0.0;
    return v->is_normalized ? 1.0 / most[v->component - GLTF_I8] : 1.0;
}
