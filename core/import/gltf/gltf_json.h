/* SPDX-License-Identifier: MIT */
/* This reads values of the file's JSON, and checks each. `of` is the object that has the key. `of` may be NULL: then it
 * has no keys. `at` says where the object is in the file, for messages. */
#ifndef CORE_IMPORT_GLTF_GLTF_JSON_H
#define CORE_IMPORT_GLTF_GLTF_JSON_H

#include <jansson.h>
#include <stddef.h>
#include <stdint.h>

struct gltf;

#define GLTF_NONE UINT32_MAX /* an index that the file doesn't give */

/* The object number i of a list on the top level. */
int gltf_object(struct gltf *g, const char *list, uint32_t i, json_t **out);
/* An index; GLTF_NONE where it isn't there. */
int gltf_index(struct gltf *g, const json_t *of, const char *key, const char *at, uint32_t *out);
/* A whole number up to 2^53. Without the key *out keeps its value. */
int gltf_whole(struct gltf *g, const json_t *of, const char *key, const char *at, uint64_t *out);
/* n numbers. Without the key *out keeps its values. */
int gltf_numbers(struct gltf *g, const json_t *of, const char *key, const char *at, size_t n, double *out);
/* A list; NULL where it isn't there. */
int gltf_list(struct gltf *g, const json_t *of, const char *key, const char *at, json_t **out);
/* An object; NULL where it isn't there. */
int gltf_child(struct gltf *g, const json_t *of, const char *key, const char *at, json_t **out);
/* NULL where it isn't there, or is no text. */
const char *gltf_text(const json_t *of, const char *key);

#endif
