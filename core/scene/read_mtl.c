/* The material library of an OBJ file: newmtl; Kd, the diffuse colour; map_Kd, its texture; map_d, what cuts
 * holes. The rest is ignored. */
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

/* The options of a map, up to the file's name: of -clamp the value. Others take numbers and words of their own;
 * the name is then the last word. Without options it may have blanks. */
static struct text_span map_file(struct text_span map, enum texture_wrap wrap[2])
{
    struct text_span last = map, before = {"", 0};
    bool options = map.n > 0 && map.p[0] == '-';
    const char *end = map.p + map.n;
    wrap[0] = wrap[1] = TEXTURE_REPEAT;
    for (const char *p = map.p; options && p < end;) {
        const char *from = p;
        while (p < end && *p != ' ' && *p != '\t')
            p++;
        last = (struct text_span){from, (size_t)(p - from)};
        if (text_is(before, "-clamp") && text_is(last, "on")) wrap[0] = wrap[1] = TEXTURE_CLAMP;
        before = last;
        while (p < end && (*p == ' ' || *p == '\t'))
            p++;
    }
    return last;
}

/* map_Kd or map_d [options] FILE */
static int set_texture(struct scene_build *b, uint32_t first, struct text_span material, struct text_span map,
                       bool is_opacity, struct sh_err *err)
{
    struct scene *scene = b->scene;
    struct build_image image = {0};
    int rc = SH_OK;
    image.name = map_file(map, image.wrap);
    for (uint32_t i = first; i < scene->n_surfaces && image.name.n > 0 && rc == SH_OK; i++) {
        struct scene_surface *s = &scene->surface[i];
        uint16_t *number = is_opacity ? &s->opacity : &s->texture;
        if (*number == 0 && has_material(s, material)) rc = build_texture(b, &image, number, err);
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
