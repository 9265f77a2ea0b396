/* SPDX-License-Identifier: MIT */
/* The URI of a buffer or an image contains its data, or names a file. */
#ifndef CORE_IMPORT_GLTF_GLTF_URI_H
#define CORE_IMPORT_GLTF_GLTF_URI_H

#include <stdbool.h>

#include "core/err.h"
#include "core/import/gltf/gltf_bytes.h"

struct scene_build;

/* Whether the URI contains its data. */
bool gltf_uri_is_data(const char *uri);
/* Decodes a URI that contains its data. at: the object with the URI, for messages. *own is to be freed, even after an
 * error. */
int gltf_uri_data(struct scene_build *b, const char *uri, const char *at, void **own, struct gltf_bytes *out,
                  struct sh_err *err);
/* The file name that a URI stands for, with %20 and the like decoded; to be freed. NULL: no memory. */
char *gltf_uri_name(const char *uri);

#endif
