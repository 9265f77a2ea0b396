/* SPDX-License-Identifier: MIT */
/* The file itself: JSON, alone or in a .glb, and its buffers.
 *
 *   .glb   "glTF" version length | length "JSON" ... | length "BIN\0" ... | others, which are skipped
 *          whole numbers of 32 bits, little-endian; chunks are padded to 4 bytes
 *   1.0    "glTF" 1 length length-of-JSON 0 | JSON | the buffer; Assimp reads it */
#include "core/import/gltf/gltf_file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/bytes.h"
#include "core/import/gltf/gltf.h"
#include "core/import/gltf/gltf_at.h"
#include "core/import/gltf/gltf_json.h"
#include "core/import/gltf/gltf_nodes.h"
#include "core/import/gltf/gltf_uri.h"

enum { GLB_HEAD = 12, GLB_1_HEAD = 20, CHUNK_HEAD = 8, MAX_ENTRIES = 1 << 26 };
#define CHUNK_JSON 0x4e4f534aU
#define CHUNK_BIN  0x004e4942U

static int find_chunks(struct gltf *g, struct gltf_bytes *json)
{
    const struct text *t = &g->file;
    const size_t length = le_get32(t->data + 8);
    if (length > t->size) return gltf_fail(g, "cut off: it has %zu bytes, but its header says %zu", t->size, length);
    if (length < t->size) build_warn(g->b, "%zu bytes after its end are not read", t->size - length);
    for (size_t at = GLB_HEAD; at < length;) {
        if (length - at < CHUNK_HEAD || le_get32(t->data + at) > length - at - CHUNK_HEAD)
            return gltf_fail(g, "the chunk at byte %zu goes beyond its end, byte %zu", at, length);
        const struct gltf_bytes chunk = {(const uint8_t *)t->data + at + CHUNK_HEAD, le_get32(t->data + at)};
        const uint32_t type = le_get32(t->data + at + 4);
        if (type == CHUNK_JSON && json->p == NULL) *json = chunk;
        if (type == CHUNK_BIN && g->bin.p == NULL) g->bin = chunk;
        at += CHUNK_HEAD + chunk.n;
    }
    return json->p != NULL ? SH_OK : gltf_fail(g, "it has no JSON in it");
}

/* Assimp reads glTF 1.0 without its skins, and says nothing of them. root: NULL where the JSON is broken. */
static void warn_skins(const struct gltf *g, const json_t *root)
{
    const size_t n = json_object_size(json_object_get(root, "skins"));
    if (n > 0)
        build_warn(g->b,
                   "it is glTF 1.0, so Assimp reads it, which ignores its %zu skin%s; write it as glTF 2.0 for these",
                   n, n > 1 ? "s" : "");
}

static void warn_skins_of_glb_1(const struct gltf *g)
{
    const struct text *t = &g->file;
    if (t->size < GLB_1_HEAD || le_get32(t->data + GLB_HEAD) > t->size - GLB_1_HEAD) return;
    json_t *root = json_loadb(t->data + GLB_1_HEAD, le_get32(t->data + GLB_HEAD), JSON_DECODE_INT_AS_REAL, NULL);
    warn_skins(g, root);
    json_decref(root);
}

static int find_json(struct gltf *g, struct gltf_bytes *json)
{
    const struct text *t = &g->file;
    if (t->size < GLB_HEAD || memcmp(t->data, "glTF", 4) != 0) {
        const size_t mark = t->size >= 3 && memcmp(t->data, "\xef\xbb\xbf", 3) == 0 ? 3 : 0;
        *json = (struct gltf_bytes){(const uint8_t *)t->data + mark, t->size - mark};
        return SH_OK;
    }
    const uint32_t version = le_get32(t->data + 4);
    g->by_assimp = version == 1;
    if (version == 1) warn_skins_of_glb_1(g);
    if (version == 1 || version == 2) return version == 1 ? SH_OK : find_chunks(g, json);
    return gltf_fail(g, "it is a .glb of version %u; allowed are 1 and 2", version);
}

/* glTF 1.0 has objects by name in place of lists, and need not state its version. */
static int check_version(struct gltf *g)
{
    const json_t *asset = json_object_get(g->root, "asset");
    const char *version = gltf_text(asset, "version"), *least = gltf_text(asset, "minVersion");
    g->by_assimp = (version != NULL && strncmp(version, "1.", 2) == 0) ||
                   (version == NULL && json_is_object(json_object_get(g->root, "meshes")));
    if (g->by_assimp) {
        warn_skins(g, g->root);
        return SH_OK;
    }
    if (version == NULL || strncmp(version, "2.", 2) != 0)
        return gltf_fail(g, "asset.version is %.20s; allowed are 1.0 and 2.x", version != NULL ? version : "not there");
    if (least != NULL && strcmp(least, "2.0") != 0)
        return gltf_fail(g, "asset.minVersion is %.20s; allowed is 2.0", least);
    return SH_OK;
}

/* Whole numbers are read as doubles, so they need not fit into 64 bits. */
static int parse(struct gltf *g, struct gltf_bytes json)
{
    json_error_t error;
    g->root = json_loadb((const char *)json.p, json.n, JSON_DECODE_INT_AS_REAL | JSON_ALLOW_NUL, &error);
    if (g->root == NULL) {
        sh_keep_line(error.text);
        return gltf_fail(g, "its JSON can't be read: line %d, column %d: %.120s", error.line, error.column, error.text);
    }
    return json_is_object(g->root) ? check_version(g) : gltf_fail(g, "its JSON is not an object");
}

static int count_entries(struct gltf *g, const char *list, uint32_t *n)
{
    json_t *all;
    int rc = gltf_list(g, g->root, list, "", &all);
    if (rc == SH_OK && json_array_size(all) > MAX_ENTRIES)
        rc = gltf_fail(g, "it has %zu %s; allowed are up to %d", json_array_size(all), list, MAX_ENTRIES);
    if (rc == SH_OK) *n = (uint32_t)json_array_size(all);
    return rc;
}

static int gltf_file_make_room(struct gltf *g)
{
    int rc = count_entries(g, "buffers", &g->n_buffers);
    if (rc == SH_OK) rc = count_entries(g, "bufferViews", &g->n_views);
    if (rc == SH_OK) rc = count_entries(g, "accessors", &g->n_accessors);
    if (rc == SH_OK) rc = count_entries(g, "nodes", &g->n_nodes);
    if (rc != SH_OK) return rc;
    g->buffer = calloc(g->n_buffers + 1u, sizeof *g->buffer);
    g->view = calloc(g->n_views + 1u, sizeof *g->view);
    g->accessor = calloc(g->n_accessors + 1u, sizeof *g->accessor);
    g->node = calloc(g->n_nodes + 1u, sizeof *g->node);
    g->stack = calloc(g->n_nodes + 1u, sizeof *g->stack);
    if (g->buffer != NULL && g->view != NULL && g->accessor != NULL && g->node != NULL && g->stack != NULL)
        return SH_OK;
    return build_fail(g->b, SH_ENOMEM, g->err, "no memory for its lists");
}

int gltf_open(struct gltf *g)
{
    struct gltf_bytes json = {0};
    int rc = text_open(&g->file, g->b->spec->file, NULL, NULL, g->err);
    if (rc == SH_OK) rc = find_json(g, &json);
    if (rc == SH_OK && !g->by_assimp) rc = parse(g, json);
    return rc == SH_OK && !g->by_assimp ? gltf_file_make_room(g) : rc;
}

static void free_all(struct gltf_kept *kept, uint32_t n)
{
    for (uint32_t i = 0; kept != NULL && i < n; i++)
        free(kept[i].own);
    free(kept);
}

void gltf_close(struct gltf *g)
{
    free_all(g->buffer, g->n_buffers);
    free_all(g->view, g->n_views);
    free_all(g->accessor, g->n_accessors);
    free(g->node);
    free(g->stack);
    json_decref(g->names);
    json_decref(g->root);
    text_close(&g->file);
}

/* ---- buffers */

/* The path of a file in the mesh's folder, or of one whose name begins with /. To be freed. NULL: no memory. */
static char *sibling_of(const struct gltf *g, const char *name)
{
    const char *mesh = g->b->spec->file;
    char *path = NULL;
    const int folder = name[0] != '/' ? (int)(basename(mesh) - mesh) : 0;
    return asprintf(&path, "%.*s%s", folder, mesh, name) >= 0 ? path : NULL;
}

/* Tries the URI as it is written, too, for writers that escape nothing. */
static int read_file(struct gltf *g, const char *uri, struct gltf_kept *out)
{
    struct text t = {0};
    struct sh_err why = {0};
    char *name = gltf_uri_name(uri), *path = name != NULL ? sibling_of(g, name) : NULL, *plain = sibling_of(g, uri);
    int rc = SH_OK;
    if (path == NULL || plain == NULL) rc = build_fail(g->b, SH_ENOMEM, g->err, "no memory for a name");
    const char *file = rc == SH_OK && access(path, F_OK) != 0 && access(plain, F_OK) == 0 ? plain : path;
    if (rc == SH_OK && access(file, F_OK) != 0)
        rc = gltf_fail(
            g, "there is no \"%.150s\"; its geometry is in that file, which belongs in the same folder: copy it there",
            file);
    else if (rc == SH_OK && text_open(&t, file, NULL, NULL, &why) != SH_OK)
        rc = build_fail(g->b, why.code, g->err, "%.250s; allowed are regular files", why.text);
    if (rc == SH_OK) {
        *out = (struct gltf_kept){.bytes = {(const uint8_t *)t.data, t.size}, .own = t.data};
        t.data = NULL;
    }
    text_close(&t);
    free(name);
    free(path);
    free(plain);
    return rc;
}

static int open_buffer(struct gltf *g, uint32_t buffer, struct gltf_kept *out)
{
    const struct gltf_at at = gltf_at("buffers[%u]", buffer);
    json_t *object;
    uint64_t length = 0;
    int rc = gltf_object(g, "buffers", buffer, &object);
    if (rc == SH_OK) rc = gltf_whole(g, object, "byteLength", at.text, &length);
    if (rc != SH_OK) return rc;
    const char *uri = gltf_text(object, "uri");
    if (uri == NULL && (buffer != 0 || g->bin.p == NULL)) return gltf_fail(g, "%s has no data", at.text);
    if (uri == NULL)
        out->bytes = g->bin;
    else if (gltf_uri_is_data(uri))
        rc = gltf_uri_data(g->b, uri, at.text, &out->own, &out->bytes, g->err);
    else
        rc = read_file(g, uri, out);
    if (rc == SH_OK && out->bytes.n < length)
        rc = gltf_fail(g, "%s is cut off: %zu bytes of %llu", at.text, out->bytes.n, (unsigned long long)length);
    out->is_open = rc == SH_OK;
    return rc;
}

/* Errors of a buffer don't name the mesh that happens to need it first. */
int gltf_buffer(struct gltf *g, uint32_t buffer, struct gltf_bytes *out)
{
    const char *mesh = g->b->mesh;
    if (buffer == GLTF_NONE) return gltf_fail(g, "a buffer view names no buffer");
    if (buffer >= g->n_buffers) return gltf_fail(g, "buffers[%u] is missing: there are %u", buffer, g->n_buffers);
    struct gltf_kept *kept = &g->buffer[buffer];
    g->b->mesh = NULL;
    int rc = kept->is_open ? SH_OK : open_buffer(g, buffer, kept);
    g->b->mesh = mesh;
    *out = kept->bytes;
    return rc;
}
