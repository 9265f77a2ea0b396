/* SPDX-License-Identifier: MIT */
#include "core/import/ifc/ifc_bodies.h"

#include <errno.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/grow.h"
#include "core/import/ifc/ifc_index.h"

#define MOST_M 1e9

struct product_head {
    uint32_t id, n_parts, n_failures, n_text;
};

struct part_head {
    uint32_t n_vertices, n_triangles;
    float colour[4];
    double largest_m;
};

struct reading {
    struct ifc_bodies *b;
    size_t at;
    struct sh_err *err;
};

static int wrong(const struct reading *r, const char *what)
{
    return sh_fail(r->err, SH_EINPUT, "its result is inconsistent at byte %zu: %s", r->at, what);
}

/* Returns the next `size` bytes, and skips the zeros that fill them up to a multiple of 8. NULL: there are not as
 * many. */
static const void *ifc_bodies_take(struct reading *r, uint64_t size)
{
    const void *at = r->b->bytes + r->at;
    if (size > r->b->size - r->at) return NULL;
    size = (size + 7) / 8 * 8;
    r->at = size > r->b->size - r->at ? r->b->size : r->at + size;
    return at;
}

static bool is_right(const struct ifc_part *part)
{
    for (uint32_t i = 0; i < part->n_vertices; i++)
        for (int k = 0; k < 3; k++)
            if (!(fabs(part->vertex_m[i][k]) <= MOST_M)) return false;
    for (uint32_t i = 0; i < part->n_triangles; i++)
        for (int k = 0; k < 3; k++)
            if (part->triangle[i][k] >= part->n_vertices) return false;
    for (int k = 0; k < 4; k++)
        if (isnan(part->colour[k])) return false;
    return part->largest_m >= 0.0 && part->largest_m <= MOST_M;
}

static int read_part(struct reading *r)
{
    struct part_head head;
    const void *at = ifc_bodies_take(r, sizeof head);
    if (at == NULL) return wrong(r, "it is cut off");
    memcpy(&head, at, sizeof head);
    struct ifc_part part = {
        .n_vertices = head.n_vertices, .n_triangles = head.n_triangles, .largest_m = head.largest_m};
    /* A reader gives colours as the file has them. ifc_styles.c counts those that are beyond the range. */
    for (int k = 0; k < 4; k++)
        part.colour[k] = isnan(head.colour[k]) ? NAN : fminf(fmaxf(head.colour[k], 0.0f), 1.0f);
    part.vertex_m = ifc_bodies_take(r, head.n_vertices * (uint64_t)sizeof *part.vertex_m);
    part.triangle =
        part.vertex_m != NULL ? ifc_bodies_take(r, head.n_triangles * (uint64_t)sizeof *part.triangle) : NULL;
    if (part.triangle == NULL) return wrong(r, "it is cut off");
    if (!grow(&r->b->part, &r->b->room_parts, r->b->n_parts + 1, sizeof part))
        return sh_fail(r->err, SH_ENOMEM, "no memory for parts");
    r->b->part[r->b->n_parts++] = part;
    return SH_OK;
}

/* 1: a product, 0: the end. */
static int read_product(struct reading *r)
{
    struct product_head head;
    const void *at = ifc_bodies_take(r, sizeof head);
    if (at == NULL) return wrong(r, "it is cut off");
    memcpy(&head, at, sizeof head);
    if (head.id == 0) return head.n_parts == 0 && r->at == r->b->size ? 0 : wrong(r, "a product without a number");
    const char *text = ifc_bodies_take(r, head.n_text);
    if (text == NULL) return wrong(r, "it is cut off");
    const char *line = memchr(text, '\n', head.n_text);
    if (line == NULL) return wrong(r, "a text without a line end");
    if (!grow(&r->b->body, &r->b->room, r->b->n + 1, sizeof *r->b->body))
        return sh_fail(r->err, SH_ENOMEM, "no memory for products");
    struct ifc_body *body = &r->b->body[r->b->n++];
    *body = (struct ifc_body){.id = head.id,
                              .type = {text, (size_t)(line - text)},
                              .n_failures = head.n_failures,
                              .first = r->b->n_parts,
                              .n_parts = head.n_parts};
    int rc = SH_OK;
    for (uint32_t i = 0; i < head.n_parts && rc == SH_OK; i++)
        rc = read_part(r);
    bool is_usable = true;
    for (size_t i = body->first; i < r->b->n_parts; i++)
        is_usable = is_usable && is_right(&r->b->part[i]);
    if (rc == SH_OK && !is_usable) {
        body->n_parts = 0;
        r->b->n_wrong++;
    }
    return rc == SH_OK ? 1 : rc;
}

const struct ifc_body *ifc_bodies_find(const struct ifc_bodies *b, uint64_t id)
{
    return b->n > 0 ? bsearch(&id, b->body, b->n, sizeof *b->body, ifc_compare) : NULL;
}

static int read_file(struct ifc_bodies *b, int fd, struct sh_err *err)
{
    struct stat st;
    if (fstat(fd, &st) != 0) return sh_fail(err, SH_EIO, "its result: %s", strerror(errno));
    b->size = (size_t)st.st_size;
    b->bytes = malloc(b->size + 1);
    if (b->bytes == NULL) return sh_fail(err, SH_ENOMEM, "no memory for %zu bytes of bodies", b->size);
    for (size_t done = 0; done < b->size;) {
        const ssize_t got = pread(fd, b->bytes + done, b->size - done, (off_t)done);
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return sh_fail(err, SH_EIO, "its result can't be read");
        done += (size_t)got;
    }
    return SH_OK;
}

int ifc_bodies_read(struct ifc_bodies *b, int fd, struct sh_err *err)
{
    static const char magic[8] = "shifc01";
    struct reading r = {.b = b, .err = err};
    *b = (struct ifc_bodies){0};
    int rc = read_file(b, fd, err);
    if (rc != SH_OK) return rc;
    const void *head = ifc_bodies_take(&r, sizeof magic);
    if (head == NULL || memcmp(head, magic, sizeof magic) != 0) return wrong(&r, "no head");
    while ((rc = read_product(&r)) == 1)
        continue;
    if (rc != SH_OK) return rc;
    if (b->n > 0) qsort(b->body, b->n, sizeof *b->body, ifc_compare);
    for (size_t i = 0; i < b->n; i++) {
        if (i > 0 && b->body[i].id == b->body[i - 1].id) return wrong(&r, "a product twice");
        if (b->body[i].n_parts > 0) ifc_figures(&b->part[b->body[i].first], b->body[i].n_parts, &b->body[i].figures);
    }
    return SH_OK;
}

void ifc_bodies_free(struct ifc_bodies *b)
{
    free(b->bytes);
    free(b->part);
    free(b->body);
    *b = (struct ifc_bodies){0};
}
