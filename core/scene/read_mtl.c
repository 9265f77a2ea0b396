/* The material library of an OBJ file: newmtl, Kd, the diffuse colour, and map_Kd, its texture; the rest is
 * ignored. */
#include <stdio.h>
#include <string.h>

#include "core/scene/build.h"
#include "core/text.h"

static bool has_material(const struct scene_surface *s, struct text_span material)
{
    if (material.n > SCENE_NAME_LEN - 1) material.n = SCENE_NAME_LEN - 1; /* as the names were cut */
    return text_is(material, s->material);
}

/* All surfaces from `first` on with that material; the first colour stays. */
static void set_colour(struct scene *scene, uint32_t first, struct text_span material, const double rgb[3])
{
    for (uint32_t i = first; i < scene->n_surfaces; i++) {
        struct scene_surface *s = &scene->surface[i];
        if (s->has_colour || !has_material(s, material)) continue;
        for (int k = 0; k < 3; k++)
            s->colour[k] = (float)rgb[k];
        s->has_colour = 1;
    }
}

/* Kd r g b with r, g, b in 0..1. A spectrum or CIE colour is none that is known here. */
static bool read_colour(struct text *t, double rgb[3])
{
    for (int k = 0; k < 3; k++) {
        text_skip_blanks(t);
        if (!text_number(t, &rgb[k]) || !(rgb[k] >= 0.0 && rgb[k] <= 1.0)) return false;
    }
    return true;
}

/* map_Kd [options] FILE. A name with blanks may stand where there are no options. */
static int set_texture(struct scene_build *b, uint32_t first, struct text_span material, struct text_span name,
                       struct sh_err *err)
{
    struct scene *scene = b->scene;
    int rc = SH_OK;
    if (name.n > 0 && name.p[0] == '-')
        for (size_t i = name.n; i > 0; i--)
            if (name.p[i - 1] == ' ' || name.p[i - 1] == '\t') {
                name = (struct text_span){name.p + i, name.n - i};
                break;
            }
    if (name.n == 0) return SH_OK;
    const struct build_image image = {.name = name};
    for (uint32_t i = first; i < scene->n_surfaces && rc == SH_OK; i++) {
        struct scene_surface *s = &scene->surface[i];
        if (s->texture == 0 && has_material(s, material)) rc = build_texture(b, &image, &s->texture, err);
    }
    return rc;
}

static int read_materials(struct scene_build *b, struct text *t, uint32_t first, struct sh_err *err)
{
    int rc = SH_OK;
    struct text_span material = {"", 0};
    for (; t->p < t->end && rc == SH_OK; text_next_line(t)) {
        double rgb[3];
        struct text_span word = text_word(t);
        if (text_is(word, "newmtl")) material = text_rest(t);
        if (text_is(word, "Kd") && read_colour(t, rgb)) set_colour(b->scene, first, material, rgb);
        if (text_is(word, "map_Kd") && build_wants_textures(b)) rc = set_texture(b, first, material, text_rest(t), err);
    }
    return rc;
}

int read_mtl(struct scene_build *b, struct text_span name, uint32_t first_surface, struct sh_err *err)
{
    int rc = SH_OK;
    char path[1024];
    struct text t;
    struct sh_err why;
    const char *slash = strrchr(b->spec->file, '/');
    int folder = name.p[0] != '/' && slash != NULL ? (int)(slash - b->spec->file) + 1 : 0;
    int n = snprintf(path, sizeof path, "%.*s%.*s", folder, b->spec->file, (int)name.n, name.p);
    if (n < 0 || n >= (int)sizeof path) return SH_OK;
    if (text_open(&t, path, NULL, NULL, &why) == SH_OK) rc = read_materials(b, &t, first_surface, err);
    text_close(&t);
    return rc;
}
