/* SPDX-License-Identifier: MIT */
/* EXT_meshopt_compression and KHR_meshopt_compression: buffer views that meshoptimizer has packed. */
#include "core/import/gltf/gltf_meshopt.h"

#include <stdlib.h>
#include <string.h>

#include <meshoptimizer.h>

#include "core/scene/build_say.h"
#include "core/text.h"

/* meshoptimizer asserts the sizes that it gets, so they are checked before. */
static bool sizes_fit(const struct gltf_packed *p)
{
    const bool is_vertices = strcmp(p->mode, "ATTRIBUTES") == 0;
    if (is_vertices && (p->stride == 0 || p->stride % 4 != 0 || p->stride > 256)) return false;
    if (!is_vertices && p->stride != 2 && p->stride != 4) return false;
    if (strcmp(p->mode, "TRIANGLES") == 0 && p->count % 3 != 0) return false;
    if (!is_vertices) return strcmp(p->filter, "NONE") == 0;
    if (strcmp(p->filter, "OCTAHEDRAL") == 0) return p->stride == 4 || p->stride == 8;
    return strcmp(p->filter, "QUATERNION") != 0 || p->stride == 8;
}

/* 0, or the decoder's error code for damaged data. */
static int decode(const struct gltf_packed *p, void *out)
{
    const size_t n = (size_t)p->count, size = (size_t)p->stride;
    if (strcmp(p->mode, "TRIANGLES") == 0) return meshopt_decodeIndexBuffer(out, n, size, p->from.p, p->from.n);
    if (strcmp(p->mode, "INDICES") == 0) return meshopt_decodeIndexSequence(out, n, size, p->from.p, p->from.n);
    int rc = meshopt_decodeVertexBuffer(out, n, size, p->from.p, p->from.n);
    if (rc != 0) return rc;
    if (strcmp(p->filter, "OCTAHEDRAL") == 0) meshopt_decodeFilterOct(out, n, size);
    if (strcmp(p->filter, "QUATERNION") == 0) meshopt_decodeFilterQuat(out, n, size);
    if (strcmp(p->filter, "EXPONENTIAL") == 0) meshopt_decodeFilterExp(out, n, size);
    return 0;
}

static int check(struct scene_build *b, const struct gltf_packed *p, const char *at, struct sh_err *err)
{
    static const char *const modes[] = {"ATTRIBUTES", "TRIANGLES", "INDICES", NULL};
    static const char *const filters[] = {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL", NULL};
    if (!text_is_one_of(text_span_of(p->mode), modes))
        return build_fail(b, SH_EINPUT, err,
                          "%s: meshopt's mode %.40s is not known; known are ATTRIBUTES, TRIANGLES, INDICES", at,
                          p->mode);
    if (!text_is_one_of(text_span_of(p->filter), filters))
        return build_fail(b, SH_EINPUT, err,
                          "%s: meshopt's filter %.40s is not known; known are OCTAHEDRAL, QUATERNION, EXPONENTIAL", at,
                          p->filter);
    if (!sizes_fit(p) || p->count >= UINT32_MAX)
        return build_fail(b, SH_EINPUT, err, "%s: meshopt does not allow %s with %llu elements of %llu bytes", at,
                          p->mode, (unsigned long long)p->count, (unsigned long long)p->stride);
    return SH_OK;
}

int gltf_meshopt(struct scene_build *b, const struct gltf_packed *packed, const char *at, void **own,
                 struct gltf_bytes *out, struct sh_err *err)
{
    struct gltf_packed p = *packed;
    if (p.mode == NULL) p.mode = "(none)";
    if (p.filter == NULL) p.filter = "NONE";
    int rc = check(b, &p, at, err);
    if (rc != SH_OK) return rc;
    *own = malloc((size_t)(p.count * p.stride) + 1);
    if (*own == NULL) return build_fail(b, SH_ENOMEM, err, "no memory for %s", at);
    *out = (struct gltf_bytes){*own, (size_t)(p.count * p.stride)};
    rc = decode(&p, *own);
    if (rc == 0) return SH_OK;
    return build_fail(b, SH_EINPUT, err, "%s: meshoptimizer can't decode it (%d): it is damaged, or of a newer version",
                      at, rc);
}
