/* The material library of an OBJ file: newmtl, Kd, the diffuse colour, and map_Kd, its texture; the rest is passed
 * over. */
#include <stdio.h>
#include <string.h>

#include "core/scene/scene_build.h"
#include "core/scene/text.h"

/* All surfaces from `first` on with that material; the first colour stays. */
static void set_colour(struct scene *scene, uint32_t first, const char *material, size_t len, const double rgb[3])
{
    if (len > SCENE_NAME_LEN - 1) len = SCENE_NAME_LEN - 1; /* as the names were cut */
    for (uint32_t i = first; i < scene->n_surfaces; i++) {
        struct scene_surface *s = &scene->surface[i];
        if (s->has_colour || strlen(s->material) != len || memcmp(s->material, material, len) != 0) continue;
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
static int set_texture(struct scene_build *b, uint32_t first, const char *material, size_t len, const char *name,
                       size_t name_len, struct sh_err *err)
{
    struct scene *scene = b->scene;
    int rc = SH_OK;
    if (name_len > 0 && name[0] == '-')
        for (size_t i = name_len; i > 0; i--)
            if (name[i - 1] == ' ' || name[i - 1] == '\t') {
                name += i;
                name_len -= i;
                break;
            }
    if (name_len == 0) return SH_OK;
    if (len > SCENE_NAME_LEN - 1) len = SCENE_NAME_LEN - 1;
    for (uint32_t i = first; i < scene->n_surfaces && rc == SH_OK; i++) {
        struct scene_surface *s = &scene->surface[i];
        if (s->texture == 0 && strlen(s->material) == len && memcmp(s->material, material, len) == 0)
            rc = build_texture(b, name, name_len, NULL, 0, &s->texture, err);
    }
    return rc;
}

static int read_materials(struct scene_build *b, struct text *t, uint32_t first, struct sh_err *err)
{
    struct scene *scene = b->scene;
    int rc = SH_OK;
    const char *material = "", *word;
    size_t material_len = 0;
    for (; t->p < t->end && rc == SH_OK; text_next_line(t)) {
        double rgb[3];
        size_t len = text_word(t, &word);
        if (len == 6 && memcmp(word, "newmtl", 6) == 0) material_len = text_rest(t, &material);
        if (len == 2 && memcmp(word, "Kd", 2) == 0 && read_colour(t, rgb))
            set_colour(scene, first, material, material_len, rgb);
        if (len == 6 && memcmp(word, "map_Kd", 6) == 0 && b->spec->textures) {
            const char *file;
            size_t file_len = text_rest(t, &file);
            rc = set_texture(b, first, material, material_len, file, file_len, err);
        }
    }
    return rc;
}

int read_mtl(struct scene_build *b, const char *name, size_t len, uint32_t first_surface, struct sh_err *err)
{
    int rc = SH_OK;
    char path[1024];
    struct text t;
    struct sh_err why;
    const char *slash = strrchr(b->spec->file, '/');
    int folder = name[0] != '/' && slash != NULL ? (int)(slash - b->spec->file) + 1 : 0;
    int n = snprintf(path, sizeof path, "%.*s%.*s", folder, b->spec->file, (int)len, name);
    if (n < 0 || n >= (int)sizeof path) return SH_OK;
    if (text_open(&t, path, NULL, NULL, &why) == SH_OK) rc = read_materials(b, &t, first_surface, err);
    text_close(&t);
    return rc;
}
