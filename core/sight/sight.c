/* A sight: made, asked about, given back. */
#include <stdlib.h>
#include <string.h>

#include "core/sight/sight_inside.h"

int sight_possible(const struct scene *scene)
{
    return scene->cutout == NULL && scene->n_triangles < SIGHT_NUMBER;
}

int sight_create(const struct sight_spec *spec, unsigned threads, const struct sh_report *report, struct sight **out,
                 struct sh_err *err)
{
    struct sight *s = *out = calloc(1, sizeof *s);
    if (s == NULL) return sh_fail(err, SH_ENOMEM, "sight: no memory");
    s->bvh = spec->bvh;
    memcpy(s->station_m, spec->station_m, sizeof s->station_m);
    s->exact = spec->exact;
    s->cells = SIGHT_MIN_CELLS;
    const size_t tiles = (size_t)SIGHT_FACES * (s->cells / SIGHT_TILE) * (s->cells / SIGHT_TILE);
    s->tile = malloc(tiles * sizeof *s->tile);
    if (s->tile == NULL) {
        sight_free(s);
        *out = NULL;
        return sh_fail(err, SH_ENOMEM, "sight: no memory");
    }
    for (size_t i = 0; i < tiles; i++)
        s->tile[i] = SIGHT_ASK;
    (void)threads;
    (void)report;
    return SH_OK;
}

void sight_free(struct sight *sight)
{
    if (sight == NULL) return;
    free(sight->tile);
    free(sight->leaf);
    free(sight->list);
    free(sight->record);
    free(sight);
}

void sight_get_info(const struct sight *sight, struct sight_info *info)
{
    *info = sight->info;
}
