/* SPDX-License-Identifier: MIT */
#include "core/import/ifc/ifc_edits.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"

bool ifc_edits_add(struct ifc_edits *e, const struct text *t, struct text_span part, char *text)
{
    if (text == NULL || !grow(&e->edit, &e->room, e->n + 1, sizeof *e->edit)) {
        free(text);
        return false;
    }
    /* A text from the file may go over several lines, a change may not. */
    for (char *p = text; (p = strpbrk(p, "\r\n")) != NULL;)
        *p = ' ';
    e->edit[e->n++] = (struct ifc_edit){.at = (size_t)(part.p - t->data), .n = part.n, .text = text};
    return true;
}

bool ifc_edits_keep(struct ifc_edits *e, struct text *t, struct text_span list, const struct text_span *kept, size_t n)
{
    /* The elements that stay take at most as many bytes as the list. */
    char *text = calloc(list.n + 1, 1);
    size_t len = 0;
    for (size_t i = 0; i < n && text != NULL; i++) {
        if (i > 0) text[len++] = ',';
        memcpy(text + len, kept[i].p, kept[i].n);
        len += kept[i].n;
    }
    if (!ifc_edits_add(e, t, list, text)) return false;
    char *at = t->data + (list.p - t->data);
    memset(at, ' ', list.n);
    memcpy(at, text, len);
    return true;
}

static int compare_edits(const void *a, const void *b)
{
    const struct ifc_edit *x = a, *y = b;
    return (x->at > y->at) - (x->at < y->at);
}

char *ifc_edits_write(struct ifc_edits *e, const struct text *t, size_t *len)
{
    char *list = NULL;
    FILE *out = open_memstream(&list, len);
    if (out == NULL) return NULL;
    if (e->n > 0) qsort(e->edit, e->n, sizeof *e->edit, compare_edits);
    fprintf(out, "%zu\n", t->size);
    for (size_t i = 0; i < e->n; i++)
        fprintf(out, "%zu %zu %s\n", e->edit[i].at, e->edit[i].n, e->edit[i].text);
    if (fclose(out) == 0) return list;
    free(list);
    return NULL;
}

void ifc_edits_free(struct ifc_edits *e)
{
    for (size_t i = 0; i < e->n; i++)
        free(e->edit[i].text);
    free(e->edit);
    *e = (struct ifc_edits){0};
}
