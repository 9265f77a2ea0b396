/* SPDX-License-Identifier: MIT */
/* Repair of .obj. A mesh is held in memory until all scans are over. So only a recorder that was killed while it wrote
 * the file leaves something: lines of text, in which a triangle follows its vertices. All whole lines are kept. The
 * file of materials of a mesh with textures is written after the lines, so it is missing. */
#include "drivers/record/repair.h"

#include <stdlib.h>
#include <string.h>

enum { LINE_MOST = 1024 }; /* a comment may name two names of 255 bytes */

struct obj_lines {
    uint64_t n_vertices, n_objects;
    int is_marked; /* the last line says that the file is incomplete */
    int is_ours;   /* the first comment of this program is there */
};

static int are_numbers(const char *text)
{
    return *text != '\0' && strspn(text, "0123456789+-.eE ") == strlen(text);
}

/* Returns whether each corner is a vertex that was read before. Only the vertex is checked: in our files the texture
 * coordinate and the normal of a corner have the vertex's number. */
static int is_face(const struct obj_lines *o, const char *text)
{
    if (*text == '\0' || strspn(text, "0123456789/ ") != strlen(text)) return 0;
    while (*text != '\0') {
        char *end;
        const unsigned long long v = strtoull(text, &end, 10);
        if (end == text || v == 0 || v > o->n_vertices) return 0;
        text = end + strcspn(end, " ");
        text += strspn(text, " ");
    }
    return 1;
}

static int begins(const char *line, const char *key)
{
    return strncmp(line, key, strlen(key)) == 0;
}

static int obj_repair_take_line(void *ctx, const char *line, size_t len)
{
    struct obj_lines *o = ctx;
    if (len >= LINE_MOST) return 0;
    o->is_marked = repair_is_mark(line, len);
    if (begins(line, "v ")) {
        if (!are_numbers(line + 2)) return 0;
        o->n_vertices++;
        return 1;
    }
    if (begins(line, "vn ") || begins(line, "vt ")) return are_numbers(line + 3);
    if (begins(line, "f ") || begins(line, "p ")) return is_face(o, line + 2);
    o->is_ours |= begins(line, "# crs ");
    o->n_objects += (uint64_t)begins(line, "o ");
    return begins(line, "o ") || begins(line, "#") || begins(line, "usemtl ") || begins(line, "mtllib ");
}

int obj_repair(struct repair *r, struct sh_err *err)
{
    struct obj_lines o = {0};
    uint64_t end;
    int rc = repair_lines(r, 0, obj_repair_take_line, &o, &end, err);
    if (rc == SH_OK && o.n_vertices == 0) rc = repair_fail_none(r, "mesh of the OBJ format", err);
    if (rc == SH_OK) rc = repair_check_rest(r, end, LINE_MOST, err);
    if (rc != SH_OK) return rc;
    repair_say_kept(r, "points", o.n_vertices, o.n_objects);
    return repair_end_text(r, end, o.is_marked, o.is_ours, err);
}
