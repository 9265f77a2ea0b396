/* SPDX-License-Identifier: MIT */
#include "core/ply.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"

int ply_open(struct ply_rows *r, const char *path, text_progress *progress, void *ctx, struct sh_err *err)
{
    *r = (struct ply_rows){.progress = progress, .progress_ctx = ctx};
    int rc = text_open(&r->t, path, progress, ctx, err);
    return rc == SH_OK ? ply_read_header(&r->h, &r->t, err) : rc;
}

void ply_close(struct ply_rows *r)
{
    free(r->corners.value);
    free(r->texcoords.value);
    text_close(&r->t);
    *r = (struct ply_rows){0};
}

uint64_t ply_line(const struct ply_rows *r)
{
    return r->h.format == PLY_ASCII ? r->t.line : 0;
}

/* The place of an error is a line in a text, and a byte in a binary file. */
int ply_fail(const struct ply_rows *r, struct sh_err *err, const char *what)
{
    char place[64] = "";
    if (r->h.format != PLY_ASCII) snprintf(place, sizeof place, ", byte %zu", (size_t)(r->t.p - r->t.data));
    return text_fail(&r->t, ply_line(r), SH_EINPUT, err, "%s %llu of %llu%s: %s", r->element->name,
                     (unsigned long long)r->row + 1, (unsigned long long)r->element->count, place, what);
}

static double load_binary(const uint8_t *p, enum number_type type, bool big)
{
    uint8_t turned[8];
    for (unsigned i = 0, size = number_size[type]; big && i < size; i++)
        turned[i] = p[size - 1 - i];
    return le_get_number(big ? turned : p, type);
}

static int read_scalar(struct ply_rows *r, enum number_type type, double *value, struct sh_err *err)
{
    if (r->h.format == PLY_ASCII) {
        text_skip_blanks(&r->t);
        if (text_number(&r->t, value)) return SH_OK;
        return ply_fail(r, err, text_at_line_end(&r->t) ? "a value is missing" : "a value is not a number");
    }
    if ((size_t)(r->t.end - r->t.p) < number_size[type]) return ply_fail(r, err, "the file ends in it");
    *value = load_binary((const uint8_t *)r->t.p, type, r->h.format == PLY_BIG);
    r->t.p += number_size[type];
    return SH_OK;
}

static int keep_value(struct ply_rows *r, struct ply_list *list, double value, struct sh_err *err)
{
    if (!grow(&list->value, &list->cap, list->n + 1, sizeof *list->value))
        return text_fail(&r->t, ply_line(r), SH_ENOMEM, err, "no memory for a face");
    list->value[list->n++] = value;
    return SH_OK;
}

static int read_list(struct ply_rows *r, const struct ply_property *p, struct sh_err *err)
{
    double count;
    int rc = read_scalar(r, p->count_type, &count, err);
    if (rc != SH_OK) return rc;
    if (!(count >= 0 && count <= UINT32_MAX) || count != floor(count))
        return ply_fail(r, err, "a list's count is not a whole number from 0 on");
    for (uint64_t i = 0; i < (uint64_t)count && rc == SH_OK; i++) {
        double value;
        rc = read_scalar(r, p->type, &value, err);
        if (rc == SH_OK && p->use == PLY_CORNERS) rc = keep_value(r, &r->corners, value, err);
        if (rc == SH_OK && p->use == PLY_TEXCOORDS) rc = keep_value(r, &r->texcoords, value, err);
    }
    return rc;
}

static void skip_blank_lines(struct text *t)
{
    for (text_skip_blanks(t); t->p < t->end && text_at_line_end(t); text_skip_blanks(t))
        text_next_line(t);
}

static int read_row(struct ply_rows *r, struct sh_err *err)
{
    const struct ply_element *e = r->element;
    r->corners.n = r->texcoords.n = 0;
    if (r->h.format == PLY_ASCII) {
        skip_blank_lines(&r->t);
        if (r->t.p >= r->t.end) return ply_fail(r, err, "the file ends before it");
    }
    int rc = SH_OK;
    for (int i = e->first; i < e->first + e->n_properties && rc == SH_OK; i++) {
        const struct ply_property *p = &r->h.property[i];
        rc = p->is_list ? read_list(r, p, err) : read_scalar(r, p->type, &r->scalar[p->use], err);
    }
    if (rc != SH_OK || r->h.format != PLY_ASCII) return rc;
    text_skip_blanks(&r->t);
    if (text_at_line_end(&r->t)) return SH_OK;
    return ply_fail(r, err, "there are more values than the header says");
}

static int ply_read_rows_begin(struct ply_rows *r, int i, struct sh_err *err)
{
    const struct ply_element *e = r->element = &r->h.element[i];
    r->row = 0;
    bool ascii = r->h.format == PLY_ASCII;
    uint64_t least = 0; /* bytes of a row; in a text, a digit and a separator for each value */
    for (int k = e->first; k < e->first + e->n_properties; k++) {
        const struct ply_property *p = &r->h.property[k];
        least += ascii ? 2 : number_size[p->is_list ? p->count_type : p->type];
        r->is_single |= !ascii && p->use >= PLY_X && p->use <= PLY_Z && p->type == NUMBER_FLOAT;
    }
    uint64_t rest = (uint64_t)(r->t.end - r->t.p) + ascii; /* the last line may lack its end */
    if (e->count == 0 || e->count <= rest / least) return SH_OK;
    return text_fail(&r->t, 0, SH_EINPUT, err,
                     "%llu elements %s need at least %llu bytes each, but %llu bytes are left in the file",
                     (unsigned long long)e->count, e->name, (unsigned long long)least, (unsigned long long)rest);
}

/* Reports progress. Memory of rows that were read is given back, unless faces that came before their vertices are read
 * again. */
static int end_stretch(struct ply_rows *r, struct sh_err *err)
{
    if (!r->is_kept) text_drop_read(&r->t);
    return r->progress(r->progress_ctx, (double)(r->t.p - r->t.data) / (double)r->t.size, err);
}

/* user NULL: rows are passed over. */
static int walk_element(struct ply_rows *r, int i, const struct ply_user *user, struct sh_err *err)
{
    int rc = ply_read_rows_begin(r, i, err);
    if (rc == SH_OK && user != NULL) rc = user->begin(user->ctx, err);
    for (; r->row < r->element->count && rc == SH_OK; r->row++) {
        if ((r->row & 0xffff) == 0) rc = end_stretch(r, err);
        if (rc == SH_OK) rc = read_row(r, err);
        if (rc == SH_OK && user != NULL) rc = user->row(user->ctx, err);
    }
    return rc;
}

static bool has_corners(const struct ply_element *e)
{
    return e->kind == PLY_FACE || e->kind == PLY_STRIPS;
}

static bool vertices_follow(const struct ply_header *h, int i)
{
    while (++i < h->n_elements)
        if (h->element[i].kind == PLY_VERTEX) return true;
    return false;
}

/* Reads the faces that came before their vertices, each element from where it began. */
static int walk_again(struct ply_rows *r, const struct text at[], const bool is_early[], const struct ply_user *user,
                      struct sh_err *err)
{
    const char *end = r->t.p;
    const uint64_t line = r->t.line;
    int rc = SH_OK;
    for (int i = 0; i < r->h.n_elements && rc == SH_OK; i++) {
        if (!is_early[i]) continue;
        r->t.p = at[i].p;
        r->t.line = at[i].line;
        rc = walk_element(r, i, user, err);
    }
    r->t.p = end;
    r->t.line = line;
    return rc;
}

int ply_walk(struct ply_rows *r, const struct ply_user *user, struct sh_err *err)
{
    struct text at[PLY_MAX_ELEMENTS];
    bool is_early[PLY_MAX_ELEMENTS] = {false};
    int rc = SH_OK;
    for (int i = 0; i < r->h.n_elements && rc == SH_OK; i++) {
        const struct ply_element *e = &r->h.element[i];
        is_early[i] = has_corners(e) && user->has_faces && vertices_follow(&r->h, i);
        r->is_kept |= is_early[i];
        at[i] = r->t;
        rc = walk_element(r, i, is_early[i] ? NULL : user, err);
        if (rc == SH_OK && e->count > 0 && (e->kind == PLY_OTHER || (has_corners(e) && !user->has_faces)))
            sh_warn(user->report, "%s: element '%s' (%llu of them) is not used", r->t.path, e->name,
                    (unsigned long long)e->count);
    }
    if (rc == SH_OK) rc = walk_again(r, at, is_early, user, err);
    if (rc != SH_OK) return rc;
    if (r->h.format == PLY_ASCII) skip_blank_lines(&r->t);
    if (r->t.p < r->t.end)
        sh_warn(user->report, "%s: %zu bytes after the last element ignored", r->t.path, (size_t)(r->t.end - r->t.p));
    return SH_OK;
}
