/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/surfaces.h"

#include "firmware_sim/app/app.h"
#include "firmware_sim/app/csv_file.h"

static void surfaces_put(FILE *out, const void *ctx)
{
    const struct site *site = ctx;
    fputs("label,object,material,type,guid,colour\n", out);
    for (uint32_t i = 0; i < site->n_surfaces; i++) {
        const struct scene_surface *s = site_surface(site, i);
        char colour[CSV_FILE_COLOUR_LEN];
        const char *const text[] = {s->object, s->material, s->type, s->guid};
        fprintf(out, "%u,", i);
        for (int k = 0; k < 4; k++) {
            csv_file_put_text(out, text[k]);
            putc(',', out);
        }
        fprintf(out, "%s\n", csv_file_colour(s, colour));
    }
}

int surfaces_write(const char *path, const struct site *site, struct sh_err *err)
{
    return app_write_file(path, surfaces_put, site, err);
}
