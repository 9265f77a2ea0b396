/* The material library of an OBJ file: newmtl; Kd, the diffuse colour; map_Kd, its texture; map_d, what cuts
 * holes. The rest is ignored. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
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

/* A map: where its image lies, and how. */
struct map {
    struct build_image image;
    double scale[2], shift[2];
};

static struct text_span next_word(const char **p, const char *end)
{
    const char *from = *p;
    while (*p < end && **p != ' ' && **p != '\t')
        (*p)++;
    struct text_span word = {from, (size_t)(*p - from)};
    while (*p < end && (**p == ' ' || **p == '\t'))
        (*p)++;
    return word;
}

static bool is_number(struct text_span word, double *value)
{
    char text[32], *end;
    if (word.n == 0 || word.n >= sizeof text) return false;
    memcpy(text, word.p, word.n);
    text[word.n] = '\0';
    *value = strtod(text, &end);
    return *end == '\0' && isfinite(*value);
}

/* Options before the file's name: -clamp on, -s u v w, -o u v w. Others take numbers and words of their
 * own; the name is then the last word. Without options it may have blanks. */
static void read_map(struct text_span text, struct map *map)
{
    struct text_span option = {"", 0};
    const char *p = text.p, *end = text.p + text.n;
    double value;
    *map = (struct map){.image.name = text, .scale = {1.0, 1.0}};
    if (text.n == 0 || text.p[0] != '-') return;
    for (int n = 0; p < end;) {
        struct text_span word = map->image.name = next_word(&p, end);
        if (word.p[0] == '-' && !is_number(word, &value)) {
            option = word;
            n = 0;
            continue;
        }
        if (text_is(option, "-clamp") && text_is(word, "on")) map->image.wrap[0] = map->image.wrap[1] = TEXTURE_CLAMP;
        if (n < 2 && text_is(option, "-s") && is_number(word, &value)) map->scale[n] = value;
        if (n < 2 && text_is(option, "-o") && is_number(word, &value)) map->shift[n] = value;
        n++;
    }
}

/* How an image lies on the triangles of a surface: their coordinates on it, from those of the file. */
static void move_uv(struct scene_build *b, uint32_t label, const struct map *map)
{
    struct scene *s = b->scene;
    if (s->uv == NULL || (map->scale[0] == 1.0 && map->scale[1] == 1.0 && map->shift[0] == 0.0 && map->shift[1] == 0.0))
        return;
    for (uint32_t i = b->triangle0; i < s->n_triangles; i++)
        for (int k = 0; k < 6 && s->label[i] == label; k++)
            s->uv[i][k / 2][k % 2] = (float)((double)s->uv[i][k / 2][k % 2] * map->scale[k % 2] + map->shift[k % 2]);
}

/* map_Kd or map_d. Of a surface with both, the first one says how they lie. */
static int set_texture(struct scene_build *b, uint32_t first, struct text_span material, struct text_span text,
                       bool is_opacity, struct sh_err *err)
{
    struct scene *scene = b->scene;
    struct map map;
    int rc = SH_OK;
    read_map(text, &map);
    for (uint32_t i = first; i < scene->n_surfaces && map.image.name.n > 0 && rc == SH_OK; i++) {
        struct scene_surface *s = &scene->surface[i];
        uint16_t *number = is_opacity ? &s->opacity : &s->texture;
        if (*number != 0 || !has_material(s, material)) continue;
        if (s->opacity == 0 && s->texture == 0) move_uv(b, i, &map);
        rc = build_texture(b, &map.image, number, err);
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
        bool is_opacity = text_is(word, "map_d");
        if ((is_opacity || text_is(word, "map_Kd")) && build_wants_textures(b))
            rc = set_texture(b, first, material, text_rest(t), is_opacity, err);
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
