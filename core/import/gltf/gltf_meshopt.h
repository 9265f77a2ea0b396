/* SPDX-License-Identifier: MIT */
/* Unpacks buffer views that meshoptimizer has packed. */
#ifndef CORE_IMPORT_GLTF_GLTF_MESHOPT_H
#define CORE_IMPORT_GLTF_GLTF_MESHOPT_H

#include "core/err.h"
#include "core/import/gltf/gltf_bytes.h"

struct scene_build;

/* The fields of EXT_meshopt_compression or KHR_meshopt_compression of a buffer view. */
struct gltf_packed {
    struct gltf_bytes from;
    uint64_t stride, count;
    const char *mode, *filter; /* NULL: the extension names none */
};
/* at: the buffer view, for messages. *own is NULL before; afterwards it is to be freed, even after an error. */
int gltf_meshopt(struct scene_build *b, const struct gltf_packed *packed, const char *at, void **own,
                 struct gltf_bytes *out, struct sh_err *err);

#endif
