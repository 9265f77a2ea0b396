/* SPDX-License-Identifier: MIT */
/* Bytes of a glTF file lie in its buffers, in parts of these, or within a URI. */
#ifndef CORE_IMPORT_GLTF_GLTF_BYTES_H
#define CORE_IMPORT_GLTF_GLTF_BYTES_H

#include <stddef.h>
#include <stdint.h>

struct gltf_bytes {
    const uint8_t *p;
    size_t n;
};

#endif
