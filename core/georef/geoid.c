/* Geoid heights, through GeographicLib's data files. */
#include <stdlib.h>

#include "core/georef/state.h"

struct georef_geoid {
    struct shim_geoid *shim;
};

int georef_geoid_open(struct georef_geoid **out, struct sh_err *err)
{
    char why[256] = "";
    struct georef_geoid *geoid = malloc(sizeof *geoid);
    if (geoid == NULL) return sh_fail(err, SH_ENOMEM, "georef: no memory");
    geoid->shim = shim_geoid_open(why, sizeof why);
    if (geoid->shim == NULL) {
        free(geoid);
        return sh_fail(err, SH_EINPUT, "no geoid data (%s); geographiclib-get-geoids egm96-5 installs them", why);
    }
    *out = geoid;
    return SH_OK;
}

void georef_geoid_free(struct georef_geoid *geoid)
{
    if (geoid == NULL) return;
    shim_geoid_free(geoid->shim);
    free(geoid);
}

const struct shim_geoid *georef_geoid_shim(const struct georef_geoid *geoid)
{
    return geoid->shim;
}
