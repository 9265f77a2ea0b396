/* SPDX-License-Identifier: MIT */
/* Binary FBX files of Assimp 5.2 lack the empty node that ends each list of nodes: neither Blender nor Assimp itself
 * reads them. This file copies the nodes, and gives each list its empty node. A node holds the offset of its end in the
 * file, which grows by all empty nodes that were added before that end.
 *
 * A node (version 7500 and up) begins with the offset of its end in the file, the number of its properties, and their
 * length in bytes: 64 bits each. The length of its name follows, 8 bits; then name, properties and nodes. The file's
 * end is laid out as Blender's exporter does it. The file's time of creation becomes 1970-01-01 10:00, which Assimp
 * writes elsewhere in the file, so that the same mesh gives the same bytes. */
#include <string.h>

#include "core/bytes.h"
#include "core/studio/mesh/inside.h"

enum {
    HEAD_LEN = 27, /* of the file */
    VERSION_LEAST = 7500,
    NODE_LEN = 25, /* without its name; an empty node ends a list */
    MAX_DEPTH = 16,
    TAIL_LEN = 4 + 120 + 16, /* version, zeros, mark */
    MARK_LEN = 16,
};

struct nodes {
    const uint8_t *raw;
    uint64_t n_raw, out; /* bytes that went to the file */
    struct mesh_file *to;
};

struct node {
    uint64_t at, end, inside; /* inside: where its nodes begin */
    const uint8_t *name;
    uint8_t name_len;
};

static int fbx_nodes_fail(const struct nodes *n, uint64_t at, struct sh_err *err)
{
    return sh_fail(err, SH_EIO, "%s: byte %llu of what Assimp exported is not FBX as known here (version 7500)",
                   n->to->path, (unsigned long long)at);
}

/* Returns 1 for a node, 0 for the end of a list. */
static int read_node(const struct nodes *n, uint64_t at, uint64_t end, struct node *node, struct sh_err *err)
{
    if (at > end || end - at < NODE_LEN) return fbx_nodes_fail(n, at, err);
    const uint8_t *p = n->raw + at;
    node->at = at;
    node->end = le_get64(p);
    const uint64_t bytes = le_get64(p + 16);
    node->name_len = p[24];
    node->name = p + NODE_LEN;
    if (node->end == 0) return 0;
    const uint64_t head = at + NODE_LEN + node->name_len;
    if (node->end > end || head > node->end || bytes > node->end - head) return fbx_nodes_fail(n, at, err);
    node->inside = head + bytes;
    return 1;
}

/* Returns the length of the node in bytes, with the empty nodes that end its lists. Negative: an error. */
static int64_t length_of(const struct nodes *n, const struct node *node, int depth, struct sh_err *err)
{
    int64_t sum = (int64_t)(node->inside - node->at);
    if (node->inside == node->end) return sum;
    if (depth == MAX_DEPTH) return fbx_nodes_fail(n, node->at, err);
    for (uint64_t at = node->inside; at < node->end;) {
        struct node child;
        int is = read_node(n, at, node->end, &child, err);
        if (is < 0) return is;
        if (is == 0) break;
        int64_t len = length_of(n, &child, depth + 1, err);
        if (len < 0) return len;
        sum += len;
        at = child.end;
    }
    return sum + NODE_LEN;
}

static int fbx_nodes_put(struct nodes *n, const void *data, size_t len, struct sh_err *err)
{
    n->out += len;
    return mesh_file_write(n->to, data, len, err);
}

static int put_zeros(struct nodes *n, size_t len, struct sh_err *err)
{
    static const uint8_t zero[120];
    return fbx_nodes_put(n, zero, len, err);
}

static int is_named(const struct node *node, const char *name)
{
    return node->name_len == strlen(name) && memcmp(node->name, name, node->name_len) == 0;
}

/* Puts the whole number of a node within CreationTimeStamp. */
static int put_time(struct nodes *n, const struct node *node, struct sh_err *err)
{
    const int value = is_named(node, "Version") ? 1000
                      : is_named(node, "Year")  ? 1970
                      : is_named(node, "Hour")  ? 10
                                                : is_named(node, "Month") || is_named(node, "Day");
    const uint8_t property[5] = {'I', (uint8_t)(value & 255), (uint8_t)(value >> 8)};
    return fbx_nodes_put(n, property, sizeof property, err);
}

static int put_node(struct nodes *n, const struct node *node, int is_time, int depth, struct sh_err *err)
{
    uint8_t head[NODE_LEN];
    const int64_t len = length_of(n, node, depth, err);
    if (len < 0) return (int)len;
    memcpy(head, n->raw + node->at, NODE_LEN);
    le_put64(head, n->out + (uint64_t)len);
    const uint64_t properties = node->inside - node->at - NODE_LEN - node->name_len;
    int rc = fbx_nodes_put(n, head, NODE_LEN, err);
    if (rc == SH_OK) rc = fbx_nodes_put(n, node->name, node->name_len, err);
    if (rc == SH_OK && is_time && properties == 5) return put_time(n, node, err);
    if (rc == SH_OK) rc = fbx_nodes_put(n, node->name + node->name_len, properties, err);
    if (node->inside == node->end) return rc;
    for (uint64_t at = node->inside; rc == SH_OK && at < node->end;) {
        struct node child;
        rc = read_node(n, at, node->end, &child, err);
        if (rc <= 0) break;
        rc = put_node(n, &child, is_named(node, "CreationTimeStamp"), depth + 1, err);
        at = child.end;
    }
    return rc == SH_OK ? put_zeros(n, NODE_LEN, err) : rc;
}

/* Puts a mark, 4 zeros, 1 to 16 zeros up to a multiple of 16, the version, zeros, and another mark. */
static int put_tail(struct nodes *n, uint64_t at, struct sh_err *err)
{
    if (n->n_raw < at || n->n_raw - at < MARK_LEN + TAIL_LEN) return fbx_nodes_fail(n, at, err);
    int rc = fbx_nodes_put(n, n->raw + at, MARK_LEN, err);
    if (rc == SH_OK) rc = put_zeros(n, 4, err);
    if (rc == SH_OK) rc = put_zeros(n, 16 - n->out % 16, err);
    return rc == SH_OK ? fbx_nodes_put(n, n->raw + n->n_raw - TAIL_LEN, TAIL_LEN, err) : rc;
}

int mesh_fbx_copy(const uint8_t *raw, size_t n_raw, struct mesh_file *to, struct sh_err *err)
{
    struct nodes n = {.raw = raw, .n_raw = n_raw, .to = to};
    uint64_t at = HEAD_LEN;
    if (n_raw < HEAD_LEN || memcmp(raw, "Kaydara FBX Binary  ", 21) != 0 ||
        (le_get64(raw + HEAD_LEN - 8) >> 32) < VERSION_LEAST)
        return fbx_nodes_fail(&n, 0, err);
    int rc = fbx_nodes_put(&n, raw, HEAD_LEN, err);
    while (rc == SH_OK) {
        struct node node;
        rc = read_node(&n, at, n_raw, &node, err);
        if (rc <= 0) break;
        rc = put_node(&n, &node, 0, 0, err);
        at = node.end;
    }
    if (rc == SH_OK) rc = put_zeros(&n, NODE_LEN, err);
    return rc == SH_OK ? put_tail(&n, at + NODE_LEN, err) : rc;
}
