/* The material library of an OBJ file: newmtl and Kd, the diffuse colour; the rest is passed over. */
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

static void read_materials(struct text *t, struct scene *scene, uint32_t first)
{
    const char *material = "", *word;
    size_t material_len = 0;
    for (; t->p < t->end; text_next_line(t)) {
        double rgb[3];
        size_t len = text_word(t, &word);
        if (len == 6 && memcmp(word, "newmtl", 6) == 0) material_len = text_rest(t, &material);
        if (len == 2 && memcmp(word, "Kd", 2) == 0 && read_colour(t, rgb))
            set_colour(scene, first, material, material_len, rgb);
    }
}

void read_mtl(struct scene_build *b, const char *name, size_t len, uint32_t first_surface)
{
    char path[1024];
    struct text t;
    struct sh_err why;
    const char *slash = strrchr(b->spec->file, '/');
    int folder = name[0] != '/' && slash != NULL ? (int)(slash - b->spec->file) + 1 : 0;
    int n = snprintf(path, sizeof path, "%.*s%.*s", folder, b->spec->file, (int)len, name);
    if (n < 0 || n >= (int)sizeof path) return;
    if (text_open(&t, path, NULL, NULL, &why) == SH_OK) read_materials(&t, b->scene, first_surface);
    text_close(&t);
}
