/* SPDX-License-Identifier: MIT */
/* Surfaces of the scene that is being built: labels, names, textures. */
#include "core/scene/build_surfaces.h"

#include <inttypes.h>
#include <math.h>
#include <search.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/rng.h"
#include "core/scene/find_file.h"
#include "core/utf8.h"

static int compare_surfaces(const void *a, const void *b)
{
    const struct scene_surface *x = a, *y = b;
    int order = strcmp(x->object, y->object);
    return order != 0 ? order : strcmp(x->material, y->material);
}

/* A hash of all bytes of a name, so that names with the same beginning differ. */
static uint64_t number_of(const char *name, size_t n)
{
    uint64_t number = n;
    for (size_t i = 0; i < n; i++)
        number = rng_mix(number + (unsigned char)name[i]);
    return number;
}

int scene_copy_name(char *out, size_t room, const char *name, size_t n)
{
    char tail[24];
    size_t len = n;
    if (len < room) {
        memcpy(out, name, len);
        out[len] = '\0';
        return 0;
    }
    const size_t tail_len = (size_t)snprintf(tail, sizeof tail, "~%016" PRIx64, number_of(name, n));
    len = utf8_cut(name, room - 1 - tail_len);
    memcpy(out, name, len);
    memcpy(out + len, tail, tail_len + 1);
    return 1;
}

void build_rgb(struct scene_build *b, const double colour[3], double scale, uint8_t rgb[4])
{
    bool is_limited = false;
    for (int k = 0; k < 3; k++) {
        const double level = scale * colour[k];
        is_limited |= !(level >= 0.0 && level <= 255.0);
        rgb[k] = (uint8_t)lrint(fmin(255.0, fmax(0.0, level)));
    }
    rgb[3] = 255;
    b->n_rgb_limited += is_limited;
    if (is_limited) b->rgb_most = 255.0 / scale;
}

void build_rgb_look(struct build_rgb_range *range, double number)
{
    range->largest = fmax(range->largest, number);
    range->n_above += number > 1.0;
    range->n_between += number > 0.0 && number < 1.0;
}

double build_rgb_scale(const struct build_rgb_range *range)
{
    return range->largest >= 2.0 && range->n_above > range->n_between ? 1.0 : 255.0;
}

static void keep_surface(void *surface)
{
    (void)surface; /* the scene owns it */
}

void build_forget_surfaces(struct scene_build *b)
{
    if (b->surface_tree != NULL) tdestroy(b->surface_tree, keep_surface);
    b->surface_tree = NULL;
}

/* Makes room for one more surface. The tree points into the array, so it is made again where the array has moved. */
static bool has_room(struct scene_build *b)
{
    struct scene *s = b->scene;
    if (s->n_surfaces < b->cap_surfaces) return true;
    build_forget_surfaces(b);
    if (!grow(&s->surface, &b->cap_surfaces, s->n_surfaces + 1, sizeof *s->surface)) return false;
    for (uint32_t i = 0; i < s->n_surfaces; i++)
        if (tsearch(&s->surface[i], &b->surface_tree, compare_surfaces) == NULL) return false;
    return true;
}

int build_label(struct scene_build *b, struct text_span object, struct text_span material, uint16_t *label,
                struct sh_err *err)
{
    struct scene *s = b->scene;
    if (!has_room(b)) return build_fail(b, SH_ENOMEM, err, "no memory for the scene's surfaces");
    struct scene_surface *fresh = &s->surface[s->n_surfaces];
    fresh->has_colour = 0;
    fresh->texture = fresh->opacity = fresh->vertex_colours = 0;
    fresh->solid = 0.5f;
    fresh->clear = 0.0f;
    fresh->type[0] = fresh->guid[0] = '\0';
    int cut = scene_copy_name(fresh->object, sizeof fresh->object, object.p, object.n);
    cut += scene_copy_name(fresh->material, sizeof fresh->material, material.p, material.n);
    struct scene_surface **found = tsearch(fresh, &b->surface_tree, compare_surfaces);
    if (found == NULL) return build_fail(b, SH_ENOMEM, err, "no memory for the scene's surfaces");
    if (*found == fresh) {
        if (s->n_surfaces == SCENE_MAX_SURFACES)
            return build_fail(
                b, SH_EINPUT, err,
                "too many surfaces (an object with one material each): a scene holds up to %d, since labels "
                "have 16 bits; join objects in the file, or scan parts of it, each with a configuration",
                SCENE_MAX_SURFACES);
        s->n_surfaces++;
        b->counts.names_cut += (unsigned)cut;
    }
    *label = (uint16_t)(*found - s->surface);
    return SH_OK;
}

void build_note_colours(struct scene *s)
{
    for (uint32_t i = 0; s->rgb != NULL && i < s->n_triangles; i++) {
        const uint8_t(*at)[4] = (const uint8_t(*)[4])s->rgb[i];
        const int has = at[0][3] != 0 && at[1][3] != 0 && at[2][3] != 0;
        uint16_t *which = &s->surface[s->label[i]].vertex_colours, now = has ? 2 : 1; /* bit 0: some lack them */
        *which |= now;
    }
    for (uint32_t i = 0; i < s->n_surfaces; i++) {
        uint16_t *which = &s->surface[i].vertex_colours;
        *which = *which == 2 ? SCENE_COLOURS_ALL : *which == 3 ? SCENE_COLOURS_SOME : SCENE_COLOURS_NONE;
    }
}

/* Returns the path of the image; where there is no such file, the path that errors name. */
static char *find_image(const struct scene_build *b, const struct build_image *image)
{
    const struct text_span folder[2] = {image->folder, build_folder_of(b->spec->file)};
    const size_t first = image->folder.p == NULL;
    char *path = image->bytes == NULL ? build_find_file(folder + first, 2 - first, image->name, 1) : NULL;
    return path != NULL ? path : build_join(folder[1], image->name);
}

static bool build_surfaces_is_same(const struct scene_texture *t, const char *file, const struct build_image *image)
{
    return strcmp(t->file, file) == 0 && memcmp(t->wrap, image->wrap, sizeof t->wrap) == 0;
}

int build_texture(struct scene_build *b, const struct build_image *image, uint16_t *number, struct sh_err *err)
{
    struct scene *s = b->scene;
    char *file = find_image(b, image);
    for (uint32_t i = 0; file != NULL && i < s->n_textures; i++)
        if (build_surfaces_is_same(&s->texture[i], file, image)) {
            free(file);
            *number = (uint16_t)(i + 1);
            return SH_OK;
        }
    if (s->n_textures == UINT16_MAX) {
        free(file);
        return build_fail(b, SH_EINPUT, err, "too many textures: a scene holds up to %d", UINT16_MAX);
    }
    const bool room = file != NULL && resize(&s->texture, (size_t)s->n_textures + 1, sizeof *s->texture);
    uint8_t *copy = room && image->bytes != NULL ? malloc(image->n_bytes + 1) : NULL;
    if (!room || (image->bytes != NULL && copy == NULL)) {
        free(file);
        return build_fail(b, SH_ENOMEM, err, "no memory for a texture");
    }
    if (copy != NULL) memcpy(copy, image->bytes, image->n_bytes);
    s->texture[s->n_textures++] = (struct scene_texture){.file = file,
                                                         .bytes = copy,
                                                         .n_bytes = copy != NULL ? image->n_bytes : 0,
                                                         .raw_width = image->raw_width,
                                                         .raw_height = image->raw_height,
                                                         .wrap = {image->wrap[0], image->wrap[1]}};
    *number = (uint16_t)s->n_textures;
    return SH_OK;
}
