/* SPDX-License-Identifier: MIT */
/* This reads the JSON of a file, alone or in a .glb, and finds the file's buffers. */
#ifndef CORE_IMPORT_GLTF_GLTF_FILE_H
#define CORE_IMPORT_GLTF_GLTF_FILE_H

#include "core/import/gltf/gltf_bytes.h"

struct gltf;

/* Reads the file: JSON, and the binary part of a .glb. gltf_close is due in any case. */
int gltf_open(struct gltf *g);
void gltf_close(struct gltf *g);
/* The bytes of a buffer, by its number. */
int gltf_buffer(struct gltf *g, uint32_t buffer, struct gltf_bytes *out);

#endif
