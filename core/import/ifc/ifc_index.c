/* SPDX-License-Identifier: MIT */
#include "core/import/ifc/ifc_index.h"

#include <stdlib.h>
#include <string.h>

#include "core/grow.h"

int ifc_compare(const void *a, const void *b)
{
    const uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

const struct step_record *ifc_index_find(const struct ifc_index *x, uint64_t id)
{
    return x->n > 0 ? bsearch(&id, x->record, x->n, sizeof *x->record, ifc_compare) : NULL;
}

const struct step_record *ifc_index_follow(const struct ifc_index *x, struct text_span ref, const char *type)
{
    uint64_t id;
    const struct step_record *to = step_reference(ref, &id) ? ifc_index_find(x, id) : NULL;
    return to != NULL && text_is(to->type, type) ? to : NULL;
}

int ifc_index_fail(const struct ifc_index *x, const struct step_record *at, struct sh_err *err, const char *what)
{
    return text_fail(&x->text, at->line, SH_EINPUT, err, "%.*s #%llu: %s", (int)at->type.n, at->type.p,
                     (unsigned long long)at->id, what);
}

size_t ifc_first(const void *list, size_t n, size_t size, uint64_t id)
{
    size_t low = 0, high = n;
    while (low < high) {
        const size_t middle = (low + high) / 2;
        uint64_t at;
        memcpy(&at, (const char *)list + middle * size, sizeof at);
        if (at < id)
            low = middle + 1;
        else
            high = middle;
    }
    return low;
}

int ifc_no_memory(const struct ifc_index *x, struct sh_err *err)
{
    return text_fail(&x->text, 0, SH_ENOMEM, err, "no memory for its records");
}

static int read_all(struct ifc_index *x, struct sh_err *err)
{
    struct step_record record;
    bool sorted = true;
    int rc;
    while ((rc = step_next(&x->text, &record, err)) == 1) {
        if (!grow(&x->record, &x->room, x->n + 1, sizeof *x->record)) return ifc_no_memory(x, err);
        sorted = sorted && (x->n == 0 || x->record[x->n - 1].id < record.id);
        x->record[x->n++] = record;
    }
    if (rc < 0) return rc;
    if (!sorted) qsort(x->record, x->n, sizeof *x->record, ifc_compare);
    for (size_t i = 1; i < x->n; i++)
        if (x->record[i].id == x->record[i - 1].id)
            return text_fail(&x->text, x->record[i].line, SH_EINPUT, err, "a second record #%llu; allowed one",
                             (unsigned long long)x->record[i].id);
    return SH_OK;
}

static int check_end(const struct ifc_index *x, struct sh_err *err)
{
    static const char last[] = "END-ISO-10303-21;";
    const size_t tail = x->text.size < 1024 ? x->text.size : 1024;
    if (memmem(x->text.data + x->text.size - tail, tail, last, sizeof last - 1) != NULL) return SH_OK;
    return text_fail(&x->text, 0, SH_EINPUT, err, "cut off: it doesn't end with %s", last);
}

bool ifc_next_reference(const char **p, const char *end, uint64_t *id)
{
    for (int quoted = 0; *p < end; (*p)++) {
        if (**p == '\'') quoted = !quoted;
        if (quoted || **p != '#') continue;
        *id = 0;
        while (++*p < end && **p >= '0' && **p <= '9' && *id < UINT64_MAX / 20)
            *id = 10 * *id + (uint64_t)(**p - '0');
        return true;
    }
    return false;
}

static int check_references(const struct ifc_index *x, struct sh_err *err)
{
    for (size_t i = 0; i < x->n; i++) {
        const struct step_record *from = &x->record[i];
        const char *p = from->args.p, *end = p + from->args.n;
        for (uint64_t id; ifc_next_reference(&p, end, &id);)
            if (ifc_index_find(x, id) == NULL)
                return text_fail(&x->text, from->line, SH_EINPUT, err,
                                 "%.*s #%llu refers to #%llu, but there is no such record", (int)from->type.n,
                                 from->type.p, (unsigned long long)from->id, (unsigned long long)id);
    }
    return SH_OK;
}

int ifc_index_open(struct ifc_index *x, const char *path, struct sh_err *err)
{
    *x = (struct ifc_index){0};
    int rc = step_open(&x->text, path, err);
    if (rc == SH_OK) rc = check_end(x, err);
    if (rc == SH_OK) rc = read_all(x, err);
    return rc == SH_OK ? check_references(x, err) : rc;
}

void ifc_index_close(struct ifc_index *x)
{
    free(x->record);
    text_close(&x->text);
}
