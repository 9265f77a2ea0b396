/* SPDX-License-Identifier: MIT */
/* Accessors and buffer views give numbers of any type. None of them lies beyond its buffer. */
#ifndef CORE_IMPORT_GLTF_GLTF_ACCESSOR_H
#define CORE_IMPORT_GLTF_GLTF_ACCESSOR_H

#include <stdbool.h>

#include "core/import/gltf/gltf_bytes.h"

struct gltf;

enum gltf_component {
    GLTF_I8 = 5120,
    GLTF_U8 = 5121,
    GLTF_I16 = 5122,
    GLTF_U16 = 5123,
    GLTF_U32 = 5125,
    GLTF_F32 = 5126,
};

/* An accessor that is checked: elements 0 to count - 1 may be asked for. */
struct gltf_view {
    const uint8_t *data; /* NULL: all elements are zero */
    uint64_t stride;
    uint32_t count, n_components;
    enum gltf_component component;
    bool is_normalized;
};
/* The bytes of a buffer view; stride 0: elements without gaps. */
int gltf_buffer_view(struct gltf *g, uint32_t view, struct gltf_bytes *out, uint64_t *stride);
/* Checks an accessor of that type, for example "VEC3". accessor GLTF_NONE is an error. */
int gltf_view_open(struct gltf *g, uint32_t accessor, const char *type, struct gltf_view *out);
/* Component k of element i. Normalised numbers come out as -1 to 1, or 0 to 1 where they are unsigned. */
double gltf_value(const struct gltf_view *v, uint32_t i, uint32_t k);
/* Returns the step from one whole number to the next, in units of gltf_value. Whole numbers have an error of up to half
 * a step. 0: the accessor has floats. */
double gltf_step(const struct gltf_view *v);

#endif
