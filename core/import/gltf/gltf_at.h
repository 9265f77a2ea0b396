/* SPDX-License-Identifier: MIT */
/* Says for messages where in the file something is: "meshes[2].primitives[0]". */
#ifndef CORE_IMPORT_GLTF_GLTF_AT_H
#define CORE_IMPORT_GLTF_GLTF_AT_H

struct gltf_at {
    char text[96];
};
/* As snprintf: longer text is cut. */
struct gltf_at gltf_at(const char *fmt, ...) __attribute__((format(printf, 1, 2)));

#endif
