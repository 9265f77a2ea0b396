/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/studio/map/field_lines.h"

#include "core/mat3.h"
#include "core/vec3.h"
#include "drivers/protocol/cola_field.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/placement.h"

static int outline(const struct cola_shape *shape, const struct placement *at, field_line *take, void *ctx,
                   struct sh_err *err)
{
    double corner_m[COLA_SHAPE_CORNERS][2], prcs[COLA_SHAPE_CORNERS][3];
    const uint32_t n = cola_shape_outline(shape, corner_m);
    int rc = SH_OK;
    for (uint32_t i = 0; i < n; i++) {
        mat3_apply(at->rotation, (const double[3]){corner_m[i][0], corner_m[i][1], 0.0}, prcs[i]);
        vec3_add(prcs[i], at->position_m, prcs[i]);
    }
    for (uint32_t i = 0; i < n && rc == SH_OK; i++)
        rc = take(ctx, prcs[i], prcs[i + 1 < n ? i + 1 : 0], err);
    return rc;
}

int field_lines_each(const struct config *cfg, const struct placement *at, field_line *take, void *ctx,
                     struct sh_err *err)
{
    struct cola_field field;
    int rc = SH_OK;
    for (uint32_t i = 0; i < cfg->n_fields && rc == SH_OK; i++) {
        config_make_field(&cfg->field[i], &field);
        rc = outline(&field.shape, at, take, ctx, err);
    }
    return rc;
}
