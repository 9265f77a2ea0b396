/* SPDX-License-Identifier: MIT */
/* Points of a .ply or .las file. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/cloud.h"
#include "core/infile.h"
#include "firmware_sim/app/studio/view/viewed.h"

/* Removes shots without echo, and points that have no place; the others keep their order. */
static void leave_out_empty(struct viewed *v)
{
    struct cloud *p = &v->points;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < p->n; i++) {
        if (isnan(p->xyz_m[i][0])) continue;
        if (!viewed_can_show(v->points.epsg, p->xyz_m[i])) {
            v->n_left_out++;
            continue;
        }
        if (kept != i) {
            memcpy(p->xyz_m[kept], p->xyz_m[i], sizeof p->xyz_m[i]);
            for (int c = 0; c < CLOUD_COLUMNS; c++) {
                size_t size;
                char *array = cloud_array(p, (enum cloud_column)c, &size);
                if (array != NULL) memcpy(array + kept * size, array + i * size, size);
            }
        }
        kept++;
    }
    v->n_empty = p->n - kept - v->n_left_out;
    p->n = kept;
}

/* Our recorder writes these comments into the header: "label N OBJECT | MATERIAL", "idn ...", "profile ...". */
static int take_comment(struct viewed *v, char *line, struct sh_err *err)
{
    unsigned label;
    int used = 0;
    line[strcspn(line, "\r\n")] = '\0';
    if (sscanf(line, "label %u %n", &label, &used) == 1 && used > 0 && label < CLOUD_LABEL_NONE) {
        char *bar = strstr(line + used, " | ");
        if (bar != NULL) *bar = '\0';
        return viewed_add_surface(v, label, line + used, bar != NULL ? bar + 3 : "", err);
    }
    if (strncmp(line, "idn ", 4) == 0) snprintf(v->idn, sizeof v->idn, "%.*s", (int)sizeof v->idn - 1, line + 4);
    if (strncmp(line, "profile ", 8) == 0)
        snprintf(v->profile, sizeof v->profile, "%.*s", (int)sizeof v->profile - 1, line + 8);
    return SH_OK;
}

static int read_comments(struct viewed *v, struct sh_err *err)
{
    static const char mark[] = "comment ";
    char line[512];
    const char *why;
    FILE *in = infile_open(v->path, &why);
    int rc = SH_OK;
    if (in == NULL) return sh_fail(err, SH_EINPUT, "%s: %s", v->path, why);
    while (rc == SH_OK && fgets(line, sizeof line, in) != NULL && strncmp(line, "end_header", 10) != 0)
        if (strncmp(line, mark, sizeof mark - 1) == 0) rc = take_comment(v, line + sizeof mark - 1, err);
    fclose(in);
    return rc;
}

static int add_stations(struct viewed *v, struct sh_err *err)
{
    const struct cloud *p = &v->points;
    uint8_t *seen = p->station != NULL ? calloc(UINT16_MAX + 1, 1) : NULL;
    int rc = SH_OK;
    if (p->station == NULL) return SH_OK;
    if (seen == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the stations");
    for (uint32_t i = 0; i < p->n; i++)
        seen[p->station[i]] = 1;
    for (uint32_t s = 0; rc == SH_OK && s <= UINT16_MAX; s++)
        if (seen[s] && viewed_add_station(v, s, err) == NULL) rc = SH_ENOMEM;
    free(seen);
    return rc;
}

int viewed_load_cloud(struct viewed *v, const struct sh_report *report, struct sh_err *err)
{
    const unsigned all = (1u << CLOUD_COLUMNS) - 1;
    int rc = cloud_read_columns(v->path, all, report, &v->points, err);
    if (rc != SH_OK) return rc;
    if (v->points.n > UINT32_MAX)
        return sh_fail(err, SH_EINPUT, "%s: %zu points; at most %u can be shown", v->path, v->points.n, UINT32_MAX);
    leave_out_empty(v);
    if (strcmp(v->format, "ply") == 0) rc = read_comments(v, err);
    snprintf(v->why_no_mesh, sizeof v->why_no_mesh,
             "a .%s holds points without the scan's grid; meshes are shown of a .shs", v->format);
    return rc == SH_OK ? add_stations(v, err) : rc;
}
