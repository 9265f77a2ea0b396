/* Which triangles stand at a vertex: a counting sort of their corners. */
#include <stdlib.h>
#include <string.h>

#include "core/cast/bvh.h"
#include "core/huge.h"

int bvh_fill_fans(struct bvh *bvh, struct sh_err *err)
{
    const struct scene *scene = bvh->scene;
    size_t corners = 3 * (size_t)scene->n_triangles;
    bvh->fan_first = huge_alloc(((size_t)scene->n_vertices + 2) * sizeof *bvh->fan_first);
    bvh->fan = huge_alloc(corners * sizeof *bvh->fan);
    if (bvh->fan_first == NULL || bvh->fan == NULL)
        return sh_fail(err, SH_ENOMEM, "cast: no memory for the fans of %u vertices", scene->n_vertices);
    /* Counted two places ahead, so that filling moves each begin to where it belongs. */
    uint32_t *at = bvh->fan_first + 1;
    memset(bvh->fan_first, 0, ((size_t)scene->n_vertices + 2) * sizeof *bvh->fan_first);
    const uint32_t *vertex = &scene->triangle[0][0];
    for (size_t i = 0; i < corners; i++)
        at[vertex[i] + 1]++;
    for (uint32_t v = 0; v < scene->n_vertices; v++)
        at[v + 1] += at[v];
    for (size_t i = 0; i < corners; i++)
        bvh->fan[at[vertex[i]]++] = (uint32_t)(i / 3);
    return SH_OK;
}
