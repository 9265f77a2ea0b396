/* SPDX-License-Identifier: MIT */
/* Material libraries of an OBJ file. These statements are read: newmtl; Kd, the diffuse colour; d or Tr, the opacity;
 * map_Kd, the texture; map_d, its holes. The rest is ignored. */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/import/readers.h"
#include "core/scene/build_surfaces.h"
#include "core/scene/find_file.h"
#include "core/text.h"

/* Values or files of one kind that are left out or missing. One warning counts them, and names the first. */
struct missing {
    uint64_t n, line;
    char first[96];
};

/* Notes about a surface's material, from all libraries read so far. */
struct known {
    bool is_there;       /* a library defines it */
    uint32_t opacity_by; /* number of the definition that gave its opacity; 0: none so far */
};

struct mtl {
    struct scene_build *b;
    struct text t; /* the library at hand */
    struct text_span folder;
    uint32_t first;            /* surface of the OBJ */
    struct known *known;       /* [surfaces from first on] */
    uint32_t definition;       /* number of the newmtl at hand, from 1 */
    char name[SCENE_NAME_LEN]; /* of newmtl, cut as the names of surfaces are */
    struct text_span material; /* all of name */
    bool has_opacity;          /* the material at hand has had d: a Tr is then ignored */
    struct missing colour, opacity, texture;
};

static void add_missing(struct missing *m, uint64_t line, struct text_span text)
{
    if (m->n++ > 0) return;
    m->line = line;
    snprintf(m->first, sizeof m->first, "%.*s", (int)(text.n < sizeof m->first ? text.n : sizeof m->first - 1), text.p);
}

/* ---- names */

static struct text_span without_quotes(struct text_span name)
{
    const bool quoted = name.n >= 2 && name.p[0] == '"' && name.p[name.n - 1] == '"';
    return quoted ? (struct text_span){name.p + 1, name.n - 2} : name;
}

/* Cuts a name off before " # ", where some writers add a comment. "Material #25" stays whole. */
static struct text_span without_comment(struct text_span name)
{
    for (size_t i = 1; i + 1 < name.n; i++) {
        if (name.p[i] != '#' || name.p[i - 1] != ' ' || name.p[i + 1] != ' ') continue;
        while (i > 0 && name.p[i - 1] == ' ')
            i--;
        return (struct text_span){name.p, i};
    }
    return name;
}

static bool read_mtl_is_same(struct text_span a, struct text_span b)
{
    return a.n == b.n && memcmp(a.p, b.p, a.n) == 0;
}

static bool has_material(const struct scene_surface *s, struct text_span material)
{
    const struct text_span used = text_span_of(s->material);
    return read_mtl_is_same(used, material) || read_mtl_is_same(without_quotes(used), without_quotes(material)) ||
           read_mtl_is_same(without_comment(used), material);
}

/* ---- colours */

static void set_material(struct mtl *m, struct text_span material)
{
    scene_copy_name(m->name, sizeof m->name, material.p, material.n);
    m->material = text_span_of(m->name);
    m->has_opacity = false;
    m->definition++;
    for (uint32_t i = m->first; i < m->b->scene->n_surfaces; i++)
        m->known[i - m->first].is_there |= has_material(&m->b->scene->surface[i], m->material);
}

/* Sets the colour of all surfaces with the current material; the first colour stays. */
static void set_colour(struct mtl *m, const double rgb[3])
{
    struct scene *scene = m->b->scene;
    for (uint32_t i = m->first; i < scene->n_surfaces; i++) {
        struct scene_surface *s = &scene->surface[i];
        if (s->has_colour || !has_material(s, m->material)) continue;
        for (int k = 0; k < 3; k++)
            s->colour[k] = (float)rgb[k];
        s->has_colour = 1;
    }
}

/* Kd r [g b] with r, g, b in 0..1; r alone is a grey. Spectra and CIE colours are not read. */
static bool read_colour(struct text *t, double rgb[3])
{
    int n = 0;
    for (; n < 3; n++) {
        text_skip_blanks(t);
        if (!text_number(t, &rgb[n]) || !(rgb[n] >= 0.0 && rgb[n] <= 1.0)) break;
    }
    text_skip_blanks(t);
    if (n == 1 && text_at_line_end(t)) rgb[1] = rgb[2] = rgb[0];
    return n == 3 || (n == 1 && text_at_line_end(t));
}

static void take_colour(struct mtl *m)
{
    struct text at = m->t;
    double rgb[3];
    if (read_colour(&m->t, rgb))
        set_colour(m, rgb);
    else
        add_missing(&m->colour, at.line, text_rest(&at));
}

/* d: opacity; Tr: 1 - opacity. d -halo depends on the direction: it is left out, with a warning. */
static void take_opacity(struct mtl *m, bool is_opacity)
{
    struct text at = m->t;
    double share;
    text_skip_blanks(&m->t);
    if (!text_number(&m->t, &share) || !(share >= 0.0 && share <= 1.0)) {
        add_missing(&m->opacity, at.line, text_rest(&at));
        return;
    }
    if (m->has_opacity && !is_opacity) return;
    m->has_opacity |= is_opacity;
    for (uint32_t i = m->first; i < m->b->scene->n_surfaces; i++) {
        uint32_t *by = &m->known[i - m->first].opacity_by;
        if ((*by != 0 && *by != m->definition) || !has_material(&m->b->scene->surface[i], m->material)) continue;
        *by = m->definition; /* as for colours, later definitions of the material do not count */
        m->b->scene->surface[i].clear = (float)(is_opacity ? 1.0 - share : share);
    }
}

/* ---- textures */

/* A map: its image file, and how the image lies. */
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

static bool is_number(struct text t, struct text_span word, double *value)
{
    t.p = word.p;
    return text_number(&t, value) && t.p == word.p + word.n && isfinite(*value);
}

/* Takes one value of an option; false: the word is no value, so the file's name begins there. */
static bool take_value(const struct text *t, struct map *map, struct text_span option, struct text_span word, int n)
{
    double value = 0.0;
    const bool number = is_number(*t, word, &value), scale = text_is(option, "-s"), shift = text_is(option, "-o");
    if (scale || shift || text_is(option, "-t")) {
        if (!number || n == 3) return false;
        if (n < 2 && (scale || shift)) (scale ? map->scale : map->shift)[n] = value;
        return true;
    }
    if (text_is(option, "-clamp") && text_is(word, "on")) map->image.wrap[0] = map->image.wrap[1] = TEXTURE_CLAMP;
    return n < (text_is(option, "-mm") ? 2 : 1);
}

/* Reads the options before the file's name: -clamp on; -s, -o and -t with up to three numbers; -mm with two values; all
 * others with one. The rest of the line, with its blanks, is the name. */
static void read_map(const struct text *t, struct text_span text, struct map *map)
{
    const char *p = text.p, *end = text.p + text.n;
    *map = (struct map){.scale = {1.0, 1.0}};
    while (p < end && *p == '-') {
        const struct text_span option = next_word(&p, end);
        for (int n = 0; p < end; n++) {
            const char *at = p;
            if (take_value(t, map, option, next_word(&p, end), n)) continue;
            p = at;
            break;
        }
    }
    map->image.name = without_quotes((struct text_span){p, (size_t)(end - p)});
}

/* Applies a map's scale and shift to the texture coordinates of a surface's triangles. */
static void move_uv(struct scene_build *b, uint32_t label, const struct map *map)
{
    struct scene *s = b->scene;
    if (s->uv == NULL || (map->scale[0] == 1.0 && map->scale[1] == 1.0 && map->shift[0] == 0.0 && map->shift[1] == 0.0))
        return;
    for (uint32_t i = b->triangle0; i < s->n_triangles; i++)
        for (int k = 0; k < 6 && s->label[i] == label; k++)
            s->uv[i][k / 2][k % 2] = (float)((double)s->uv[i][k / 2][k % 2] * map->scale[k % 2] + map->shift[k % 2]);
}

/* map_Kd or map_d. Where a surface has both, scale and shift of the first one hold for both. Warns of an image that is
 * missing. */
static int set_texture(struct mtl *m, struct text_span text, bool is_opacity, struct sh_err *err)
{
    struct scene *scene = m->b->scene;
    struct map map;
    int rc = SH_OK;
    bool is_missing = false;
    read_map(&m->t, text, &map);
    map.image.folder = m->folder;
    for (uint32_t i = m->first; i < scene->n_surfaces && map.image.name.n > 0 && rc == SH_OK; i++) {
        struct scene_surface *s = &scene->surface[i];
        uint16_t *number = is_opacity ? &s->opacity : &s->texture;
        if (*number != 0 || !has_material(s, m->material)) continue;
        if (s->opacity == 0 && s->texture == 0) move_uv(m->b, i, &map);
        rc = build_texture(m->b, &map.image, number, err);
        if (rc != SH_OK || access(scene->texture[*number - 1].file, F_OK) == 0) continue;
        scene->texture[*number - 1].unreadable = 1;
        is_missing = true;
    }
    if (is_missing) add_missing(&m->texture, m->t.line, map.image.name);
    return rc;
}

/* ---- libraries */

static int read_materials(struct mtl *m, struct sh_err *err)
{
    int rc = SH_OK;
    m->material = (struct text_span){"", 0};
    for (; m->t.p < m->t.end && rc == SH_OK; text_next_line(&m->t)) {
        struct text_span word = text_word(&m->t);
        if (text_is_word(word, "newmtl")) set_material(m, text_rest(&m->t));
        if (text_is_word(word, "Kd")) take_colour(m);
        if (text_is_word(word, "d") || text_is_word(word, "Tr")) take_opacity(m, text_is_word(word, "d"));
        bool is_opacity = text_is_word(word, "map_d");
        if ((is_opacity || text_is_word(word, "map_Kd")) && build_wants_textures(m->b))
            rc = set_texture(m, text_rest(&m->t), is_opacity, err);
    }
    return rc;
}

/* ", with 3 more", or nothing. */
static const char *others(const struct missing *m, char text[40])
{
    text[0] = '\0';
    if (m->n > 1) snprintf(text, 40, ", with %llu more", (unsigned long long)m->n - 1);
    return text;
}

static void warn_of_missing(const struct mtl *m, const char *path)
{
    char more[40];
    if (m->opacity.n > 0)
        sh_warn(m->b->report, "%s, line %llu: the opacity '%s' is left out%s; allowed are numbers from 0 to 1", path,
                (unsigned long long)m->opacity.line, m->opacity.first, others(&m->opacity, more));
    if (!build_wants_textures(m->b)) return;
    if (m->colour.n > 0)
        sh_warn(m->b->report, "%s, line %llu: Kd '%s' is left out%s; allowed are numbers from 0 to 1", path,
                (unsigned long long)m->colour.line, m->colour.first, others(&m->colour, more));
    if (m->texture.n > 0)
        sh_warn(m->b->report, "%s, line %llu: the texture '%s' is missing%s; put it beside the library or the mesh",
                path, (unsigned long long)m->texture.line, m->texture.first, others(&m->texture, more));
}

static int read_library(struct mtl *m, const char *path, uint64_t line, struct sh_err *err)
{
    struct sh_err why;
    int rc = SH_OK;
    m->folder = build_folder_of(path);
    m->colour = m->opacity = m->texture = (struct missing){0};
    if (text_open(&m->t, path, NULL, NULL, &why) == SH_OK) {
        rc = read_materials(m, err);
        if (rc == SH_OK) warn_of_missing(m, path);
    } else {
        sh_warn(m->b->report, "%s, line %llu: %s", m->b->name, (unsigned long long)line, why.text);
    }
    text_close(&m->t);
    return rc;
}

static int read_if_there(struct mtl *m, struct text_span name, uint64_t line, bool *found, struct sh_err *err)
{
    const struct text_span folder = build_folder_of(m->b->spec->file);
    char *path = build_find_file(&folder, 1, name, 1);
    *found = path != NULL;
    int rc = *found ? read_library(m, path, line, err) : SH_OK;
    free(path);
    return rc;
}

static void warn_of_library(const struct mtl *m, struct text_span name, uint64_t line)
{
    sh_warn(m->b->report, "%s, line %llu: the material library '%.*s' is missing; put it beside the mesh", m->b->name,
            (unsigned long long)line, (int)(name.n < 200 ? name.n : 200), name.p);
}

/* The next name: within quotes, or up to a blank. */
static struct text_span next_name(const char **p, const char *end)
{
    const char *quote = **p == '"' ? memchr(*p + 1, '"', (size_t)(end - *p - 1)) : NULL;
    if (quote == NULL) return next_word(p, end);
    const struct text_span name = {*p + 1, (size_t)(quote - *p - 1)};
    for (*p = quote + 1; *p < end && (**p == ' ' || **p == '\t');)
        (*p)++;
    return name;
}

/* A line holds several names, or one name with blanks, perhaps with a comment after it. The interpretation for which a
 * file exists is taken. */
static int read_line(struct mtl *m, const struct mtl_line *line, bool *all, struct sh_err *err)
{
    const struct text_span whole = without_quotes(line->names), bare = without_comment(line->names);
    bool found = false;
    int rc = read_if_there(m, whole, line->line, &found, err);
    if (!found && rc == SH_OK && bare.n < line->names.n)
        rc = read_if_there(m, without_quotes(bare), line->line, &found, err);
    if (found || rc != SH_OK) return rc;
    bool any = false;
    const char *end = bare.p + bare.n;
    for (const char *p = bare.p; p < end && rc == SH_OK;) {
        rc = read_if_there(m, next_name(&p, end), line->line, &found, err);
        any |= found;
    }
    for (const char *p = bare.p; p < end && any;) { /* some exist: each of the others gets a warning */
        const struct text_span folder = build_folder_of(m->b->spec->file), name = next_name(&p, end);
        char *path = build_find_file(&folder, 1, name, 1);
        if (path == NULL) warn_of_library(m, name, line->line);
        *all &= path != NULL;
        free(path);
    }
    if (!any) warn_of_library(m, whole, line->line);
    *all &= any;
    return rc;
}

/* Warns of materials that no library has, where textures are wanted. The caller has checked that no library is
 * missing. */
static void warn_of_materials(const struct mtl *m)
{
    const struct scene *scene = m->b->scene;
    const char *first = NULL;
    uint32_t n = 0;
    for (uint32_t i = m->first; i < scene->n_surfaces; i++) {
        if (m->known[i - m->first].is_there || scene->surface[i].material[0] == '\0') continue;
        if (n++ == 0) first = scene->surface[i].material;
    }
    if (n > 0 && build_wants_textures(m->b))
        build_warn(m->b, "%u of its surfaces have a material that no library defines; the first: '%.100s'", n, first);
}

int read_mtl(struct scene_build *b, const struct mtl_line *line, size_t n, uint32_t first_surface, struct sh_err *err)
{
    struct mtl m = {.b = b, .first = first_surface};
    bool all = true;
    int rc = SH_OK;
    if (n == 0) return SH_OK;
    m.known = calloc(b->scene->n_surfaces - first_surface + 1u, sizeof *m.known);
    if (m.known == NULL) return build_fail(b, SH_ENOMEM, err, "no memory for materials");
    for (size_t i = 0; i < n && rc == SH_OK; i++)
        rc = read_line(&m, &line[i], &all, err);
    if (rc == SH_OK && all) warn_of_materials(&m);
    free(m.known);
    return rc;
}
