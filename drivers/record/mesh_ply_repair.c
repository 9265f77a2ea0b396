/* SPDX-License-Identifier: MIT */
#include "drivers/record/mesh_ply_repair.h"

#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "drivers/record/ply_repair.h"

enum { FACE_LEN = 13 };                  /* three corners: a count of 8 bits, three indices of 32 */
static const uint64_t MOST = UINT32_MAX; /* vertices, faces */

struct mesh_lines {
    uint64_t n[2], n_lines, header_len; /* vertices and faces; lines after the header */
    size_t row_len;                     /* of a vertex; binary */
    int n_elements, is_ascii, has_ended;
};

static size_t size_of(const char *type)
{
    if (strcmp(type, "double") == 0) return 8;
    if (strcmp(type, "float") == 0) return 4;
    if (strcmp(type, "ushort") == 0) return 2;
    return strcmp(type, "uchar") == 0;
}

/* Takes a line of a header as core/mesh writes it. 0: another header. */
static int take_header(struct mesh_lines *m, const char *line)
{
    char word[16];
    m->has_ended = strcmp(line, "end_header") == 0;
    if (strcmp(line, "format ascii 1.0") == 0) m->is_ascii = 1;
    if (strncmp(line, "element ", 8) == 0) {
        static const char *const head[2] = {"element vertex ", "element face "};
        return m->n_elements < 2 && ply_repair_count(line, head[m->n_elements], &m->n[m->n_elements]) &&
               m->n[m->n_elements++] <= MOST;
    }
    if (strncmp(line, "property ", 9) != 0) return 1;
    if (m->n_elements == 2) return strcmp(line, "property list uchar int vertex_indices") == 0;
    if (sscanf(line, "property %15s", word) != 1 || size_of(word) == 0) return 0;
    m->row_len += size_of(word);
    return 1;
}

/* Bytes of a binary mesh are no lines: they are only counted. */
static int mesh_ply_repair_take_line(void *ctx, const char *line, size_t len)
{
    struct mesh_lines *m = ctx;
    if (m->has_ended) {
        m->n_lines++;
        return 1;
    }
    m->header_len += len + 1;
    return strlen(line) == len && take_header(m, line);
}

int mesh_ply_repair(struct repair *r, struct sh_err *err)
{
    struct mesh_lines m = {0};
    uint64_t end;
    int rc = repair_lines(r, 0, mesh_ply_repair_take_line, &m, &end, err);
    if (rc != SH_OK) return rc;
    if (!m.has_ended || m.n_elements != 2) return repair_fail_none(r, "PLY mesh", err);
    const uint64_t len = m.header_len + m.n[0] * m.row_len + m.n[1] * FACE_LEN;
    const int is_all = m.is_ascii ? end == r->len && m.n_lines == m.n[0] + m.n[1] : r->len == len;
    if (!is_all)
        return sh_fail(err, SH_EFORMAT,
                       "%s: is a mesh of %" PRIu64 " points and %" PRIu64
                       " triangles, but some are missing; it is written in one piece, so nothing can be kept",
                       r->path, m.n[0], m.n[1]);
    r->unit = "points";
    r->n_kept = m.n[0];
    r->was_whole = 1;
    return SH_OK;
}
