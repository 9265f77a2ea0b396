/* SPDX-License-Identifier: MIT */
/* Finds vertices at the same place. */
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/rng.h"
#include "core/scene.h"

enum { NONE = 0xffffffff };

int scene_find_same(const struct scene *scene, const struct sh_report *report, uint32_t **same, struct sh_err *err)
{
    const uint64_t size = grow_table(2 * (uint64_t)scene->n_vertices);
    uint32_t *table = malloc(size * sizeof *table);
    *same = malloc(((size_t)scene->n_vertices + 1) * sizeof **same);
    int rc = table != NULL && *same != NULL
                 ? SH_OK
                 : sh_fail(err, SH_ENOMEM, "no memory to compare %u vertices", scene->n_vertices);
    if (rc == SH_OK) memset(table, 0xff, size * sizeof *table);
    for (uint32_t i = 0; i < scene->n_vertices && rc == SH_OK; i++) {
        if ((i & 0xffff) == 0) rc = sh_check_stop(report, err);
        const double *p = scene->vertex_m[i];
        uint64_t at = rng_place(0, p) & (size - 1);
        for (; table[at] != NONE; at = (at + 1) & (size - 1)) {
            const double *q = scene->vertex_m[table[at]];
            if (p[0] == q[0] && p[1] == q[1] && p[2] == q[2]) break;
        }
        if (table[at] == NONE) table[at] = i;
        (*same)[i] = table[at];
    }
    free(table);
    if (rc == SH_OK) return SH_OK;
    free(*same);
    *same = NULL;
    return rc;
}
