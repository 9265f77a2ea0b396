/* SPDX-License-Identifier: MIT */
/* For tests of glTF: .glb files of a few bytes. Blocks of a buffer become buffer views, in their order. The test writes
 * the rest of the JSON. */
#ifndef TESTS_UNIT_GLTF_FILES_H
#define TESTS_UNIT_GLTF_FILES_H

#include "tests/unit/scene_files.h"

/* Empties the buffer. */
void gltf_begin(void);

/* Adds a block, the next buffer view. `more` is the rest of its JSON, from a comma on. */
void gltf_block(const void *data, size_t size, const char *more);

/* Blocks 0 and 1 are the quad's four corners, x -2 to 2, y -1 to 1, z -2, and its texture coordinates, as floats.
 * Accessors 0 to 2 are these, and the six indices of block 2. */
void gltf_quad(void);
#define GLTF_QUAD_ACCESSORS                                                    \
    "{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\"}," \
    "{\"bufferView\":1,\"componentType\":5126,\"count\":4,\"type\":\"VEC2\"}," \
    "{\"bufferView\":2,\"componentType\":5123,\"count\":6,\"type\":\"SCALAR\"}"
#define GLTF_QUAD_MESH \
    "{\"primitives\":[{\"attributes\":{\"POSITION\":0,\"TEXCOORD_0\":1},\"indices\":2,\"material\":0}]}"

/* Writes a .glb whose JSON is asset, buffer views, buffers and `rest`. The file's path is good until the next call. */
const char *gltf_write(const char *name, const char *rest);

/* Writes such a file and loads it with its textures, including their holes. */
struct scene *gltf_load(const char *rest);

/* Loading has to fail with a line that holds `expected`. */
void gltf_refuse(const char *rest, const char *expected);

/* The scene's bounds are these, to `within`. */
void gltf_check_box(const struct scene *s, const double low[3], const double high[3], double within);

#endif
