/* SPDX-License-Identifier: MIT */
/* Where the copies of a mesh stand: from the configuration, or from a CSV file. */
#include <math.h>
#include <stdlib.h>

#include "core/csv.h"
#include "core/grow.h"
#include "core/scene.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/steps.h"

enum { X, Y, Z, TURN, SCALE };
static const char *const columns[] = {"x_m", "y_m", "z_m", "turn_deg", "scale", NULL};

static int take_row(const struct csv *csv, struct scene_place *place, struct sh_err *err)
{
    *place = (struct scene_place){.at_m = {csv->value[X], csv->value[Y], csv->value[Z]},
                                  .turn_deg = csv->value[TURN],
                                  .scale = csv->has & 1u << SCALE ? csv->value[SCALE] : 1.0};
    for (int k = X; k <= Z; k++)
        if (!(fabs(csv->value[k]) <= 1e9))
            return text_fail(&csv->text, csv->line, SH_EINPUT, err, "%s %.9g; allowed -1e9 to 1e9 m", columns[k],
                             csv->value[k]);
    if (!(fabs(place->turn_deg) <= 360.0))
        return text_fail(&csv->text, csv->line, SH_EINPUT, err, "turn_deg %.9g; allowed -360 to 360 deg",
                         place->turn_deg);
    if (!(place->scale >= 1.0 / CONFIG_COPY_SCALES && place->scale <= CONFIG_COPY_SCALES))
        return text_fail(&csv->text, csv->line, SH_EINPUT, err, "scale %.9g; allowed %g to %d", place->scale,
                         1.0 / CONFIG_COPY_SCALES, CONFIG_COPY_SCALES);
    return SH_OK;
}

static int read_rows(struct csv *csv, struct scene_place **place, size_t *n, struct sh_err *err)
{
    const uint32_t needed = 1u << X | 1u << Y | 1u << Z;
    size_t room = 0;
    if ((csv->has & needed) != needed)
        return text_fail(&csv->text, csv->line, SH_EINPUT, err,
                         "the first line needs x_m,y_m,z_m, and may have turn_deg,scale");
    for (;;) {
        const int got = csv_next(csv, err);
        if (got < 0) return got;
        if (got == 0) break;
        if (!grow(place, &room, *n + 1, sizeof **place))
            return text_fail(&csv->text, 0, SH_ENOMEM, err, "no memory for its copies");
        const int rc = take_row(csv, &(*place)[(*n)++], err);
        if (rc != SH_OK) return rc;
    }
    return *n > 0 ? SH_OK : text_fail(&csv->text, 0, SH_EINPUT, err, "no copies below the first line");
}

static int read_file(const char *path, const struct sh_report *report, struct scene_place **place, size_t *n,
                     struct sh_err *err)
{
    struct csv csv;
    int rc = csv_open(&csv, path, columns, report, err);
    if (rc == SH_OK) rc = read_rows(&csv, place, n, err);
    csv_close(&csv);
    return rc;
}

static int take_list(const struct config *cfg, uint32_t number, struct scene_place **place, size_t *n,
                     struct sh_err *err)
{
    size_t room = 0;
    for (uint32_t i = 0; i < cfg->scene.n_copies; i++) {
        if (cfg->scene.copy[i].mesh != number) continue;
        if (!grow(place, &room, *n + 1, sizeof **place))
            return sh_fail(err, SH_ENOMEM, "no memory for %zu copies", *n + 1);
        (*place)[(*n)++] = cfg->scene.copy[i].place;
    }
    return SH_OK;
}

int site_read_copies(const struct config *cfg, uint32_t number, const struct sh_report *report,
                     struct scene_places *places, struct sh_err *err)
{
    const struct config_mesh *mesh = &cfg->scene.mesh[number];
    struct scene_place *place = NULL;
    size_t n = 0;
    int rc = mesh->copies[0] != '\0' ? read_file(mesh->copies, report, &place, &n, err)
                                     : take_list(cfg, number, &place, &n, err);
    *places = (struct scene_places){.place = place,
                                    .n = n,
                                    .own_surfaces = mesh->copy_labels,
                                    .says = mesh->copies[0] != '\0' ? mesh->copies : mesh->file};
    if (rc == SH_OK && mesh->copy_labels && n > SCENE_MAX_SURFACES)
        rc = sh_fail(err, SH_EINPUT,
                     "%s: scene.meshes[%u].copy_labels: on, with %zu copies, but a scene holds up to %d surfaces; "
                     "allowed off, or fewer copies",
                     cfg->file, number, n, SCENE_MAX_SURFACES);
    return rc;
}
