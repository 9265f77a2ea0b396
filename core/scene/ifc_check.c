#include "core/scene/ifc_check.h"

#include <stdlib.h>

#include "core/grow.h"
#include "core/scene/step.h"

struct ids {
    uint64_t *id;
    size_t n, room;
};

static int compare(const void *a, const void *b)
{
    uint64_t x = *(const uint64_t *)a, y = *(const uint64_t *)b;
    return (x > y) - (x < y);
}

/* Checks the numbers after a '#', except in texts. */
static int check_record(const struct text *t, const struct ids *ids, const struct step_record *record,
                        struct sh_err *err)
{
    int quoted = 0;
    const char *end = record->args.p + record->args.n;
    for (const char *p = record->args.p; p < end; p++) {
        if (*p == '\'') quoted = !quoted;
        if (quoted || *p != '#') continue;
        uint64_t id = 0;
        while (p + 1 < end && p[1] >= '0' && p[1] <= '9' && id < UINT64_MAX / 20)
            id = 10 * id + (uint64_t)(*++p - '0');
        if (bsearch(&id, ids->id, ids->n, sizeof id, compare) == NULL)
            return text_fail(t, record->line, SH_EINPUT, err, "%.*s #%llu refers to #%llu, but there is no such record",
                             (int)record->type.n, record->type.p, (unsigned long long)record->id,
                             (unsigned long long)id);
    }
    return SH_OK;
}

static int check(struct text *t, struct ids *ids, struct sh_err *err)
{
    struct step_record record;
    int rc, sorted = 1;
    while ((rc = step_next(t, &record, err)) == 1) {
        sorted &= ids->n == 0 || ids->id[ids->n - 1] <= record.id;
        if (!grow(&ids->id, &ids->room, ids->n + 1, sizeof *ids->id))
            return text_fail(t, 0, SH_ENOMEM, err, "no memory for %zu record numbers", ids->n + 1);
        ids->id[ids->n++] = record.id;
    }
    if (rc < 0) return rc;
    if (!sorted) qsort(ids->id, ids->n, sizeof ids->id[0], compare);
    t->p = t->data;
    t->line = 1;
    while ((rc = step_next(t, &record, err)) == 1)
        if ((rc = check_record(t, ids, &record, err)) != SH_OK) return rc;
    return rc;
}

int ifc_check_references(const char *path, struct sh_err *err)
{
    struct text text;
    struct ids ids = {0};
    int rc = step_open(&text, path, err);
    if (rc == SH_OK) rc = check(&text, &ids, err);
    free(ids.id);
    text_close(&text);
    return rc;
}
