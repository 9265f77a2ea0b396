/* SPDX-License-Identifier: MIT */
#include "firmware_sim/app/check_scene.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/scene_objects.h"
#include "firmware_sim/app/app.h"
#include "firmware_sim/app/csv_file.h"
#include "firmware_sim/app/ranking.h"

enum { MAX_ROWS = 50 };

static const char *const state_words[] = {[SCENE_OBJECT_EMPTY] = "empty",
                                          [SCENE_OBJECT_CLOSED] = "closed",
                                          [SCENE_OBJECT_TURNED] = "turned",
                                          [SCENE_OBJECT_OPEN] = "open"};

/* The objects of the scene that stands still, or of a mesh that moves. */
struct part {
    const struct scene *scene;
    struct scene_objects objects;
    uint32_t mesh; /* that moves, by its number in the configuration; only where is_mover */
    int is_mover;
    uint32_t *order; /* [n] by area, the largest first */
};

struct parts {
    struct part part[1 + CAST_MAX_MOVERS];
    uint32_t n;
};

/* ---- cells */

static const char *name_of(const struct part *p, uint32_t object)
{
    return p->scene->surface[p->objects.object[object].surface].object;
}

/* The surfaces of an object need not follow each other. *left: how many of them come from *i on. Returns NULL once
 * *left is 0. */
static const struct scene_surface *next_surface(const struct part *p, uint32_t object, uint32_t *i, uint32_t *left)
{
    if (*left == 0) return NULL;
    while (p->objects.of[*i] != object)
        ++*i;
    --*left;
    return &p->scene->surface[(*i)++];
}

static const char *colour_of(const struct part *p, uint32_t object, char text[CSV_FILE_COLOUR_LEN])
{
    const struct scene_surface *first = NULL, *s;
    int differ = 0, textures = 0, vertices = 0;
    uint32_t i = p->objects.object[object].surface, left = p->objects.object[object].n_surfaces;
    while ((s = next_surface(p, object, &i, &left)) != NULL) {
        textures |= s->texture != 0;
        vertices |= s->vertex_colours != SCENE_COLOURS_NONE;
        if (!s->has_colour) continue;
        differ |= first != NULL && memcmp(first->colour, s->colour, sizeof s->colour) != 0;
        if (first == NULL) first = s;
    }
    if (textures) return "texture";
    if (vertices) return "vertices";
    if (differ) return "several";
    return first != NULL ? csv_file_colour(first, text) : "none";
}

/* An object is as transparent as the most transparent surface of its name. */
static float clear_of(const struct part *p, uint32_t object)
{
    const struct scene_surface *s;
    float clear = 0.0f;
    uint32_t i = p->objects.object[object].surface, left = p->objects.object[object].n_surfaces;
    while ((s = next_surface(p, object, &i, &left)) != NULL)
        clear = fmaxf(clear, s->clear);
    return clear;
}

/* ---- the table */

static double area_of(const void *objects, uint32_t i)
{
    return ((const struct scene_objects *)objects)->object[i].area_m2;
}

static void print_row(const struct part *p, uint32_t object, FILE *out)
{
    const struct scene_object *o = &p->objects.object[object];
    char colour[CSV_FILE_COLOUR_LEN], volume[24] = "-", name[SCENE_NAME_LEN];
    snprintf(name, sizeof name, "%s", name_of(p, object));
    sh_keep_line(name);
    if (o->state == SCENE_OBJECT_CLOSED) snprintf(volume, sizeof volume, "%.6g", o->volume_m3);
    fprintf(out, "  %10" PRIu64 " %10" PRIu64 " %12.6g %12s  %-7s%-8s %s\n", o->n_triangles, o->n_open, o->area_m2,
            volume, state_words[o->state], colour_of(p, object, colour), name);
}

static void print_sum(const struct part *p, FILE *out)
{
    struct scene_object sum = {0};
    uint32_t n[4] = {0};
    for (uint32_t i = 0; i < p->objects.n; i++) {
        const struct scene_object *o = &p->objects.object[i];
        sum.n_triangles += o->n_triangles;
        sum.n_open += o->n_open;
        sum.area_m2 += o->area_m2;
        if (o->state == SCENE_OBJECT_CLOSED) sum.volume_m3 += o->volume_m3;
        n[o->state]++;
    }
    fprintf(out, "  %10" PRIu64 " %10" PRIu64 " %12.6g %12.6g  sum: %u closed, %u open, %u turned, %u empty\n",
            sum.n_triangles, sum.n_open, sum.area_m2, sum.volume_m3, n[SCENE_OBJECT_CLOSED], n[SCENE_OBJECT_OPEN],
            n[SCENE_OBJECT_TURNED], n[SCENE_OBJECT_EMPTY]);
}

/* Prints a line for each object of that state, the largest area first. After MAX_ROWS lines it only counts the rest. */
static void print_state(const struct part *p, enum scene_object_state state, FILE *out)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < p->objects.n; i++) {
        const struct scene_object *o = &p->objects.object[p->order[i]];
        char name[SCENE_NAME_LEN];
        if (o->state != state || ++n > MAX_ROWS) continue;
        snprintf(name, sizeof name, "%s", name_of(p, p->order[i]));
        sh_keep_line(name);
        fprintf(out, "%-9s %s", state_words[state], name);
        if (state == SCENE_OBJECT_OPEN) fprintf(out, ", %" PRIu64 " open edges", o->n_open);
        if (state == SCENE_OBJECT_TURNED) fputs(", neighbouring faces point to opposite sides", out);
        putc('\n', out);
    }
    if (n > MAX_ROWS) fprintf(out, "%-9s and %u more; --scene-csv FILE has all\n", state_words[state], n - MAX_ROWS);
}

/* Prints a line for each surface that the file calls transparent. After MAX_ROWS lines it only counts the rest. */
static void print_clear(const struct part *p, FILE *out)
{
    uint32_t n = 0;
    for (uint32_t i = 0; i < p->scene->n_surfaces; i++) {
        const struct scene_surface *s = &p->scene->surface[i];
        char name[2 * SCENE_NAME_LEN + 16];
        if ((double)s->clear < SITE_CLEAR_LEAST || ++n > MAX_ROWS) continue;
        snprintf(name, sizeof name, "%s, material %s", s->object, s->material);
        sh_keep_line(name);
        fprintf(out, "clear     %.0f %%: %s\n", 100.0 * (double)s->clear, name);
    }
    if (n > MAX_ROWS) fprintf(out, "clear     and %u more; --scene-csv FILE has all\n", n - MAX_ROWS);
}

static void print_part(const struct part *p, FILE *out)
{
    const uint32_t n = p->objects.n, rows = n < MAX_ROWS ? n : MAX_ROWS;
    fprintf(out, "objects   %u", n);
    if (p->is_mover) fprintf(out, " of scene.meshes[%u], which moves", p->mesh);
    fputs(n > rows ? ", the largest first\n" : "\n", out);
    fprintf(out, "  %10s %10s %12s %12s  %-7s%-8s %s\n", "triangles", "open edges", "area m2", "volume m3", "body",
            "colour", "name");
    for (uint32_t i = 0; i < rows; i++)
        print_row(p, p->order[i], out);
    if (n > rows) fprintf(out, "  and %u more; --scene-csv FILE has all\n", n - rows);
    print_sum(p, out);
    print_state(p, SCENE_OBJECT_OPEN, out);
    print_state(p, SCENE_OBJECT_TURNED, out);
    print_clear(p, out);
}

static void print_left_out(const struct parts *parts, FILE *out)
{
    struct scene_counts all = {0};
    for (uint32_t i = 0; i < parts->n; i++) {
        const struct scene_counts *c = &parts->part[i].scene->counts;
        all.zero_area += c->zero_area;
        all.not_triangles += c->not_triangles;
        all.names_cut += c->names_cut;
    }
    fprintf(out,
            "left out  %" PRIu64 " triangles without area, %" PRIu64 " points and lines; %" PRIu64
            " names shortened to %d bytes\n",
            all.zero_area, all.not_triangles, all.names_cut, SCENE_NAME_LEN - 1);
}

/* ---- the file */

static void put_csv(FILE *out, const void *ctx)
{
    const struct parts *parts = ctx;
    fputs("object,type,guid,moves,triangles,open_edges,body,area_m2,volume_m3,surfaces,colour,clear\n", out);
    for (uint32_t i = 0; i < parts->n; i++) {
        const struct part *p = &parts->part[i];
        for (uint32_t k = 0; k < p->objects.n; k++) {
            const struct scene_object *o = &p->objects.object[k];
            const struct scene_surface *s = &p->scene->surface[o->surface];
            char colour[CSV_FILE_COLOUR_LEN];
            csv_file_put_text(out, s->object);
            putc(',', out);
            csv_file_put_text(out, s->type);
            putc(',', out);
            csv_file_put_text(out, s->guid);
            fprintf(out, ",%s,%" PRIu64 ",%" PRIu64 ",%s,%.12g,", p->is_mover ? "yes" : "no", o->n_triangles, o->n_open,
                    state_words[o->state], o->area_m2);
            if (o->state == SCENE_OBJECT_CLOSED) fprintf(out, "%.12g", o->volume_m3);
            fprintf(out, ",%u,%s,%.3g\n", o->n_surfaces, colour_of(p, k, colour), (double)clear_of(p, k));
        }
    }
}

/* ---- all of it */

static int check_scene_add_part(struct parts *parts, const struct scene *scene, const struct site_mover *mover,
                                struct sh_err *err)
{
    struct part *p = &parts->part[parts->n++];
    *p = (struct part){.scene = scene, .is_mover = mover != NULL, .mesh = mover != NULL ? mover->number : 0};
    int rc = scene_objects_find(scene, NULL, &app_report_seconds, &p->objects, err);
    if (rc != SH_OK) return rc;
    p->order = ranking_make(p->objects.n, area_of, &p->objects);
    return p->order != NULL ? SH_OK : sh_fail(err, SH_ENOMEM, "no memory to sort %u objects", p->objects.n);
}

int check_print_scene(const struct site *site, unsigned n_warnings, const char *csv, FILE *out, struct sh_err *err)
{
    struct parts parts = {.n = 0};
    int rc = check_scene_add_part(&parts, site->scene, NULL, err);
    for (uint32_t i = 0; i < site->n_movers && rc == SH_OK; i++)
        rc = check_scene_add_part(&parts, site->mover[i].scene, &site->mover[i], err);
    for (uint32_t i = 0; i < parts.n && rc == SH_OK && out != NULL; i++)
        print_part(&parts.part[i], out);
    if (rc == SH_OK && out != NULL) {
        print_left_out(&parts, out);
        fprintf(out, "warnings  %u%s\n", n_warnings, n_warnings > 0 ? ", on standard error" : "");
    }
    if (rc == SH_OK && csv != NULL) rc = app_write_file(csv, put_csv, &parts, err);
    for (uint32_t i = 0; i < parts.n; i++) {
        scene_objects_free(&parts.part[i].objects);
        free(parts.part[i].order);
    }
    return rc;
}
