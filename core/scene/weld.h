/* SPDX-License-Identifier: MIT */
/* Vertices at the same place become one, for a reader whose file has a vertex for each corner of a triangle. */
#ifndef CORE_SCENE_WELD_H
#define CORE_SCENE_WELD_H

#include <stddef.h>
#include <stdint.h>

#include "core/err.h"

struct scene_build;

enum { BUILD_RECENT = 65536, BUILD_TOGETHER = 1024 };
/* Zero-initialise. */
struct build_weld {
    uint32_t *number; /* [n] the scene's number of each vertex of the file */
    uint32_t n;
    uint32_t waiting; /* vertices at the scene's end that have no number yet */
    uint32_t *slot;   /* [size] of a hash table: numbers in the scene */
    size_t size, used;
    /* By a part of the hash: the number + 1 of the last vertex. Most vertices come again soon, and are found here,
     * without a look at the table, which is larger than any cache. */
    uint32_t recent[BUILD_RECENT];
};
int build_weld_begin(struct scene_build *b, struct build_weld *w, uint64_t vertices, struct sh_err *err);
/* Adds the file's next vertex as build_vertex does, unless this weld had one at the same place before, bit for bit. */
int build_weld_vertex(struct scene_build *b, struct build_weld *w, const double v[3], struct sh_err *err);
/* The same, but numbers come later, many together, which is faster: build_weld_flush gives the last ones. */
int build_weld_later(struct scene_build *b, struct build_weld *w, const double v[3], struct sh_err *err);
int build_weld_flush(struct scene_build *b, struct build_weld *w, struct sh_err *err);
void build_weld_free(struct build_weld *w);

#endif
