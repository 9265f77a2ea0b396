/* Rays looked up in the map. */
#include <stdlib.h>
#include <string.h>

#include "core/sight/sight_inside.h"

struct sight_work {
    struct sight_counters counters;
};

int sight_work_create(struct sight_work **out, struct sh_err *err)
{
    *out = calloc(1, sizeof **out);
    return *out != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "sight: no memory");
}

void sight_work_free(struct sight_work *work)
{
    free(work);
}

const struct sight_counters *sight_work_counters(const struct sight_work *work)
{
    return &work->counters;
}

void sight_hits(struct sight_work *work, struct bvh_work *bvh_work, const struct sight *sight,
                const struct bvh_rays *rays)
{
    work->counters.asked += rays->n;
    bvh_hits(bvh_work, sight->bvh, rays);
}
