/* SPDX-License-Identifier: MIT */
/* The repair of .ply (repair.h): points, binary or text, with any columns of one number each. The count in the header
 * is corrected without changing the header's length: lines of blank comment become longer or shorter.
 *
 * A mesh is written in one piece at the end. So a mesh is kept only if it is complete, as after a kill just before the
 * file got its name. */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "drivers/record/ply_columns.h"
#include "drivers/record/repair.h"
#include "drivers/record/scan_count.h"

enum { HEADER_BEGIN = 1 << 16, HEADER_MOST = 64 << 20, WORD = 32, NO_COLUMN = -1 };
enum { FACE_LEN = 13 }; /* of a mesh in binary: three corners: a count of 8 bits, three indices of 32 */

/* A header that was read. */
struct ply_header {
    char *text; /* NUL at its end */
    size_t len;
    uint64_t n_vertices, n_faces;
    int has_vertices, is_ascii, is_mesh, is_incomplete, is_ours;
    unsigned n_columns;
    size_t row_len;          /* binary */
    int station_at, time_at; /* byte in a binary row, or number of the column in text; NO_COLUMN: there is none */
};

/* ---- the header */

/* Reads all up to "end_header". */
static int read_header(const struct repair *r, struct ply_header *h, struct sh_err *err)
{
    static const char last[] = "\nend_header\n";
    for (size_t n = HEADER_BEGIN;; n *= 4) {
        if (n > r->len) n = (size_t)r->len;
        free(h->text);
        h->text = malloc(n + 1);
        if (h->text == NULL) return sh_fail(err, SH_ENOMEM, "%s: no memory for its header", r->path);
        const int rc = repair_read(r, 0, h->text, n, err);
        if (rc != SH_OK) return rc;
        h->text[n] = '\0';
        const char *end = memmem(h->text, n, last, sizeof last - 1);
        if (end != NULL) h->len = (size_t)(end - h->text) + sizeof last - 1;
        if (end != NULL) break;
        if (n < 4 || memcmp(h->text, "ply\n", 4) != 0 || n == r->len || n >= HEADER_MOST)
            return repair_fail_none(r, "PLY file of points", err);
    }
    h->text[h->len] = '\0';
    return strlen(h->text) == h->len ? SH_OK : repair_fail_none(r, "PLY file of points", err);
}

/* Returns the bytes of a number of this type; 0: it is no type of one number. */
static size_t size_of_type(const char *type)
{
    static const struct {
        const char *name, *name_too;
        size_t size;
    } types[] = {{"char", "int8", 1}, {"uchar", "uint8", 1}, {"short", "int16", 2},   {"ushort", "uint16", 2},
                 {"int", "int32", 4}, {"uint", "uint32", 4}, {"float", "float32", 4}, {"double", "float64", 8}};
    for (size_t i = 0; i < sizeof types / sizeof types[0]; i++)
        if (strcmp(type, types[i].name) == 0 || strcmp(type, types[i].name_too) == 0) return types[i].size;
    return 0;
}

/* Takes a line of a vertex's property. Returns 0 if such a column can't be repaired, else 1. */
static int take_property(struct ply_header *h, const char *line)
{
    char type[WORD], name[WORD];
    if (sscanf(line, "property %31s %31s", type, name) != 2 || size_of_type(type) == 0 || h->row_len > HEADER_BEGIN)
        return 0;
    const int at = h->is_ascii ? (int)h->n_columns : (int)h->row_len;
    const char *plain = strncmp(name, "scalar_", 7) == 0 ? name + 7 : name;
    if (strcmp(plain, "station") == 0 && size_of_type(type) == 2) h->station_at = at;
    if (strcmp(plain, "time") == 0 && strcmp(type, "double") == 0) h->time_at = at;
    h->n_columns++;
    h->row_len += size_of_type(type);
    return 1;
}

/* Returns 1 if the line is `head` ("element vertex "), then a count and nothing else. 0: another line. */
static int take_count(const char *line, const char *head, uint64_t *count)
{
    const size_t n = strlen(head), digits = strncmp(line, head, n) == 0 ? strspn(line + n, "0123456789") : 0;
    if (digits == 0 || digits > 20 || line[n + digits] != '\0') return 0;
    *count = strtoull(line + n, NULL, 10);
    return 1;
}

/* Takes one line; 0: such a file is not repaired. Comments may be anything: if the recorder was killed while it
 * overwrote the header, a line may be cut. */
static int take_header_line(struct ply_header *h, const char *line)
{
    if (strcmp(line, "format ascii 1.0") == 0) return h->is_ascii = 1;
    if (strncmp(line, "format ", 7) == 0) return strcmp(line, "format binary_little_endian 1.0") == 0;
    if (strncmp(line, "property ", 9) == 0)
        return h->is_mesh ? strcmp(line, "property list uchar int vertex_indices") == 0
                          : h->has_vertices && take_property(h, line);
    if (strncmp(line, "element ", 8) != 0) {
        if (strncmp(line, PLY_INCOMPLETE, sizeof PLY_INCOMPLETE - 2) == 0) h->is_incomplete = 1;
        if (strncmp(line, PLY_CRS, sizeof PLY_CRS - 1) == 0) h->is_ours = 1;
        return 1;
    }
    if (h->has_vertices) return h->is_mesh = !h->is_mesh && take_count(line, "element face ", &h->n_faces);
    return h->has_vertices = take_count(line, "element vertex ", &h->n_vertices);
}

static int parse_header(const struct repair *r, struct ply_header *h, struct sh_err *err)
{
    char line[512];
    int good = 1;
    h->station_at = h->time_at = NO_COLUMN;
    for (const char *at = h->text, *stop; good && (stop = strchr(at, '\n')) != NULL; at = stop + 1) {
        const size_t n = (size_t)(stop - at) < sizeof line ? (size_t)(stop - at) : sizeof line - 1;
        memcpy(line, at, n);
        line[n] = '\0';
        good = take_header_line(h, line);
    }
    if (good && h->has_vertices && h->n_columns > 0) return SH_OK;
    return repair_fail_none(r, h->is_mesh ? "PLY mesh" : "PLY file of points", err);
}

/* Returns whether the line is a blank comment, or a piece of a comment. Such pieces are left when the recorder was
 * killed while it overwrote the header. */
static int is_padding(const char *line, size_t n)
{
    static const char *const first[] = {"ply",      "format ",   "comment ",  "obj_info ",
                                        "element ", "property ", "end_header"};
    size_t i = 0;
    while (i < sizeof first / sizeof first[0] && strncmp(line, first[i], strlen(first[i])) != 0)
        i++;
    if (i == sizeof first / sizeof first[0]) return 1;
    return strncmp(line, "comment ", 8) == 0 && strspn(line + 7, " ") >= n - 7;
}

/* This goes into a renewed header. */
struct renewal {
    uint64_t n_vertices;
    int incomplete;
    size_t padding, blanks; /* bytes of blank comments before the count; spaces at the end of the first comment */
};

static void put_line(FILE *out, const struct ply_header *h, const char *line, int n, struct renewal *new)
{
    const int counts = strncmp(line, "element vertex ", 15) == 0;
    if (counts) ply_put_padding(out, new->padding);
    if (counts)
        fprintf(out, "element vertex %" PRIu64, new->n_vertices);
    else
        fprintf(out, "%.*s", n, line);
    if (strncmp(line, "comment ", 8) == 0) {
        fprintf(out, "%*s", (int)new->blanks, "");
        new->blanks = 0;
    }
    fputc('\n', out);
    if (new->incomplete && !h->is_incomplete && strncmp(line, "format ", 7) == 0) fputs(PLY_INCOMPLETE, out);
}

/* NULL: no memory. */
static char *put_lines(const struct ply_header *h, struct renewal new, size_t *len)
{
    char *text = NULL;
    FILE *out = open_memstream(&text, len);
    if (out == NULL) return NULL;
    for (const char *at = h->text, *stop; (stop = strchr(at, '\n')) != NULL; at = stop + 1)
        if (!is_padding(at, (size_t)(stop - at))) put_line(out, h, at, (int)(stop - at), &new);
    if (fclose(out) == 0) return text;
    free(text);
    return NULL;
}

/* Returns the same header with that count and, if incomplete, with the line PLY_INCOMPLETE, in the same length. NULL:
 * there is no room. */
static char *renew(const struct ply_header *h, uint64_t n_vertices, int incomplete)
{
    struct renewal new = {.n_vertices = n_vertices, .incomplete = incomplete};
    size_t len = 0;
    char *text = put_lines(h, new, &len);
    if (text != NULL && len < h->len) {
        const size_t left = h->len - len;
        *(left < PLY_PAD_MIN ? &new.blanks : &new.padding) = left;
        free(text);
        text = put_lines(h, new, &len);
    }
    if (text != NULL && len == h->len) return text;
    free(text);
    return NULL;
}

/* ---- the rows */

struct points {
    const struct ply_header *h;
    uint64_t n; /* rows */
    struct point_scans scans;
};

static void take_binary(void *ctx, const uint8_t *row)
{
    struct points *p = ctx;
    const struct ply_header *h = p->h;
    p->n++;
    if (repair_is_zero(row, h->row_len) || (h->station_at < 0 && h->time_at < 0)) return;
    point_scans_take(&p->scans, h->station_at >= 0 ? le_get16(row + h->station_at) : 0,
                     h->time_at >= 0 ? le_get_double(row + h->time_at) : 0);
}

static int take_text(void *ctx, const char *line, size_t len)
{
    struct points *p = ctx;
    (void)len;
    const struct ply_header *h = p->h;
    unsigned n = 0;
    long station = 0;
    double time_s = 0;
    for (const char *at = line + strspn(line, " "); *at != '\0'; n++) {
        const size_t word = strcspn(at, " ");
        if (strspn(at, "0123456789+-.einfa") < word) return 0;
        if ((int)n == h->station_at) station = strtol(at, NULL, 10);
        if ((int)n == h->time_at) time_s = strtod(at, NULL);
        at += word;
        at += strspn(at, " \r");
    }
    if (n != h->n_columns) return 0;
    p->n++;
    if (h->station_at >= 0 || h->time_at >= 0) point_scans_take(&p->scans, station, time_s);
    return 1;
}

/* Returns where binary rows end at the latest. Only a header that was completed counts all of them. */
static uint64_t limit_rows(const struct repair *r, const struct ply_header *h)
{
    const int is_counted = !h->is_incomplete && h->n_vertices > 0 && h->n_vertices < (r->len - h->len) / h->row_len;
    return is_counted ? h->len + h->n_vertices * h->row_len : r->len;
}

/* Sets *end to where the last whole row ends. */
static int read_points(const struct repair *r, const struct ply_header *h, struct points *p, uint64_t *end,
                       struct sh_err *err)
{
    if (h->is_ascii) {
        const int rc = repair_lines(r, h->len, take_text, p, end, err);
        return rc == SH_OK ? repair_check_rest(r, *end, HEADER_BEGIN, err) : rc;
    }
    const uint64_t limit = limit_rows(r, h);
    struct repair_rows rows = {h->len, (limit - h->len) / h->row_len, h->row_len};
    const int may_end_in_zeros = limit != r->len || rows.n != h->n_vertices; /* else all rows may be whole */
    int rc = may_end_in_zeros ? repair_leave_zeros(r, &rows, limit, 1, err) : SH_OK;
    if (rc == SH_OK) rc = repair_rows(r, &rows, take_binary, p, err);
    *end = h->len + p->n * h->row_len;
    return rc;
}

/* Cuts first; the header, which makes the file whole, is written last. A repair that is interrupted between the two
 * finds the same points again. */
static int make_whole(struct repair *r, const struct ply_header *h, const struct points *p, uint64_t end,
                      struct sh_err *err)
{
    r->was_whole = end == r->len && p->n == h->n_vertices;
    if (r->was_whole) return SH_OK;
    if (!h->is_ours) return repair_fail_foreign(r, err);
    char *text = renew(h, p->n, 1);
    if (text == NULL) text = renew(h, p->n, 0);
    if (text == NULL)
        return sh_fail(err, SH_EFORMAT, "%s: its header has no room for another number of points; it is unchanged",
                       r->path);
    int rc = repair_cut(r, end, err);
    if (rc == SH_OK) rc = repair_write(r, 0, text, h->len, err);
    free(text);
    return rc;
}

static int count_line(void *n_lines, const char *line, size_t len)
{
    (void)line;
    (void)len;
    ++*(uint64_t *)n_lines;
    return 1;
}

/* A mesh is only checked: its recorder writes it in one piece. */
static int check_mesh(struct repair *r, const struct ply_header *h, struct sh_err *err)
{
    uint64_t n_lines = 0, end = h->len;
    if (h->n_vertices > UINT32_MAX || h->n_faces > UINT32_MAX) return repair_fail_none(r, "PLY mesh", err);
    const int rc = h->is_ascii ? repair_lines(r, h->len, count_line, &n_lines, &end, err) : SH_OK;
    if (rc != SH_OK) return rc;
    const uint64_t len = h->len + h->n_vertices * h->row_len + h->n_faces * FACE_LEN;
    const int is_all = h->is_ascii ? end == r->len && n_lines == h->n_vertices + h->n_faces : r->len == len;
    if (!is_all)
        return sh_fail(err, SH_EFORMAT,
                       "%s: is a mesh of %" PRIu64 " points and %" PRIu64
                       " triangles, but some are missing; it is written in one piece, so nothing can be kept",
                       r->path, h->n_vertices, h->n_faces);
    repair_say_kept(r, "points", h->n_vertices, 0);
    r->was_whole = 1;
    return SH_OK;
}

int ply_repair(struct repair *r, struct sh_err *err)
{
    struct ply_header h = {0};
    struct points p = {.h = &h};
    uint64_t end = 0;
    int rc = read_header(r, &h, err);
    if (rc == SH_OK) rc = parse_header(r, &h, err);
    if (rc == SH_OK && h.is_mesh) {
        rc = check_mesh(r, &h, err);
    } else if (rc == SH_OK) {
        rc = read_points(r, &h, &p, &end, err);
        repair_say_kept(r, "points", p.n, p.scans.n);
        if (rc == SH_OK) rc = make_whole(r, &h, &p, end, err);
    }
    free(h.text);
    return rc;
}
