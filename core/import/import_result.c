/* SPDX-License-Identifier: MIT */
/* A scene as a file in memory, between two processes: head, textures, surfaces, vertices, triangles, labels,
 * texture coordinates, colours, one array after the other. The file is read by pread, not mapped: each value is checked
 * in memory of this process alone, and a file that has become shorter is an error of read. */
#include "core/import/import_result.h"

#include <errno.h>
#include <fcntl.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/scene/build_surfaces.h"

enum {
    AT_ONCE = 1 << 13,       /* elements between two checks of `stop` */
    MAX_TEXTURE_NAME = 8192, /* bytes */
};

static const char MAGIC[8] = "shscene";

struct result_head {
    char magic[8];
    uint32_t n_vertices, n_triangles, n_surfaces, n_meshes, n_textures, has_uv, has_rgb;
    struct scene_counts counts;
    double error_m;
    struct scene_says says;
};

/* Stands before a texture's name and bytes. */
struct result_texture {
    uint64_t name_len, n_bytes;
    uint32_t raw_width, raw_height, wrap[2];
};

/* ---- writing */

static int import_result_put(int fd, const void *data, size_t size, struct sh_err *err)
{
    const char *p = data;
    while (size > 0) {
        ssize_t done = write(fd, p, size);
        if (done < 0 && errno == EINTR) continue;
        if (done <= 0) return sh_fail(err, SH_ENOMEM, "no memory for the scene: %s", strerror(errno));
        p += done;
        size -= (size_t)done;
    }
    return SH_OK;
}

static int put_textures(const struct scene *s, int fd, struct sh_err *err)
{
    int rc = SH_OK;
    for (uint32_t i = 0; i < s->n_textures && rc == SH_OK; i++) {
        const struct scene_texture *texture = &s->texture[i];
        const struct result_texture size = {.name_len = strlen(texture->file),
                                            .n_bytes = texture->n_bytes,
                                            .raw_width = texture->raw_width,
                                            .raw_height = texture->raw_height,
                                            .wrap = {texture->wrap[0], texture->wrap[1]}};
        rc = import_result_put(fd, &size, sizeof size, err);
        if (rc == SH_OK) rc = import_result_put(fd, texture->file, size.name_len, err);
        if (rc == SH_OK) rc = import_result_put(fd, texture->bytes, size.n_bytes, err);
    }
    return rc;
}

static int put_array(int fd, void **array, size_t size, struct sh_err *err)
{
    int rc = import_result_put(fd, *array, size, err);
    free(*array);
    *array = NULL;
    return rc;
}

int import_result_write(struct scene *s, int fd, struct sh_err *err)
{
    struct result_head head = {.n_vertices = s->n_vertices,
                               .n_triangles = s->n_triangles,
                               .n_surfaces = s->n_surfaces,
                               .n_meshes = s->n_meshes,
                               .n_textures = s->n_textures,
                               .has_uv = s->uv != NULL,
                               .has_rgb = s->rgb != NULL,
                               .counts = s->counts,
                               .error_m = s->error_m,
                               .says = s->says};
    memcpy(head.magic, MAGIC, sizeof head.magic);
    int rc = import_result_put(fd, &head, sizeof head, err);
    if (rc == SH_OK) rc = put_textures(s, fd, err);
    if (rc == SH_OK) rc = import_result_put(fd, s->surface, s->n_surfaces * sizeof *s->surface, err);
    if (rc == SH_OK) rc = put_array(fd, (void **)&s->vertex_m, s->n_vertices * sizeof *s->vertex_m, err);
    if (rc == SH_OK) rc = put_array(fd, (void **)&s->triangle, s->n_triangles * sizeof *s->triangle, err);
    if (rc == SH_OK) rc = put_array(fd, (void **)&s->label, s->n_triangles * sizeof *s->label, err);
    if (rc == SH_OK && s->uv != NULL) rc = put_array(fd, (void **)&s->uv, s->n_triangles * sizeof *s->uv, err);
    if (rc == SH_OK && s->rgb != NULL) rc = put_array(fd, (void **)&s->rgb, s->n_triangles * sizeof *s->rgb, err);
    return rc;
}

/* ---- reading */

struct result {
    struct scene_build *b;
    struct sh_err *err;
    int fd;
    uint64_t at, size; /* of the file */
    struct result_head head;
    uint16_t *texture; /* [n_textures] their numbers in b's scene */
    uint16_t *label;   /* [n_surfaces] likewise */
};

static int wrong(const struct result *r, const char *what, uint64_t number)
{
    return build_fail(r->b, SH_EINPUT, r->err, "the reader's result is inconsistent: %s %llu; the file is broken", what,
                      (unsigned long long)number);
}

/* Reads from any place of the file. A part of AT_ONCE bytes and more is cut out of the file once
 * it is read, so that the scene is not in memory twice. */
static int take_at(struct result *r, uint64_t at, void *data, size_t size)
{
    if (at > r->size || size > r->size - at) return wrong(r, "it ends at byte", r->size);
    for (size_t done = 0; done < size;) {
        ssize_t got = pread(r->fd, (char *)data + done, size - done, (off_t)(at + done));
        if (got < 0 && errno == EINTR) continue;
        if (got <= 0) return wrong(r, "there are no data at byte", at + done);
        done += (size_t)got;
    }
    if (size >= AT_ONCE) fallocate(r->fd, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, (off_t)at, (off_t)size);
    return SH_OK;
}

static int import_result_take(struct result *r, void *data, size_t size)
{
    int rc = take_at(r, r->at, data, size);
    r->at += size;
    return rc;
}

/* The other process found the texture in the mesh's folder, so a relative path begins with that folder. build_texture
 * adds the folder again, so it is cut off here. An absolute path stays as it is. */
static int add_texture(struct result *r, const char *file, const void *bytes, const struct result_texture *size,
                       uint32_t i)
{
    const char *mesh = r->b->spec->file;
    size_t folder = file[0] != '/' ? (size_t)(basename(mesh) - mesh) : 0;
    if (size->name_len < folder || memcmp(file, mesh, folder) != 0) return wrong(r, "the path of texture", i);
    if (size->wrap[0] > TEXTURE_DECAL || size->wrap[1] > TEXTURE_DECAL) return wrong(r, "the repetition of texture", i);
    const struct build_image image = {.name = {file + folder, size->name_len - folder},
                                      .bytes = size->n_bytes > 0 ? bytes : NULL,
                                      .n_bytes = size->n_bytes,
                                      .raw_width = size->raw_width,
                                      .raw_height = size->raw_height,
                                      .wrap = {(enum texture_wrap)size->wrap[0], (enum texture_wrap)size->wrap[1]}};
    return build_texture(r->b, &image, &r->texture[i], r->err);
}

static int take_texture(struct result *r, uint32_t i)
{
    struct result_texture size;
    int rc = import_result_take(r, &size, sizeof size);
    if (rc != SH_OK) return rc;
    if (size.name_len == 0 || size.name_len > MAX_TEXTURE_NAME) return wrong(r, "the name of texture", i);
    if (size.n_bytes > r->size) return wrong(r, "the size of texture", i);
    char *file = malloc(size.name_len), *bytes = malloc(size.n_bytes + 1);
    if (file == NULL || bytes == NULL) rc = build_fail(r->b, SH_ENOMEM, r->err, "no memory for a texture");
    if (rc == SH_OK) rc = import_result_take(r, file, size.name_len);
    if (rc == SH_OK) rc = import_result_take(r, bytes, size.n_bytes);
    if (rc == SH_OK && memchr(file, '\0', size.name_len) != NULL) rc = wrong(r, "the name of texture", i);
    if (rc == SH_OK) rc = add_texture(r, file, bytes, &size, i);
    free(file);
    free(bytes);
    return rc;
}

static int take_textures(struct result *r)
{
    int rc = SH_OK;
    if (r->head.n_textures > 2 * (uint64_t)r->head.n_surfaces)
        return wrong(r, "number of textures:", r->head.n_textures);
    r->texture = calloc(r->head.n_textures + 1u, sizeof *r->texture);
    if (r->texture == NULL) return build_fail(r->b, SH_ENOMEM, r->err, "no memory for textures");
    for (uint32_t i = 0; i < r->head.n_textures && rc == SH_OK; i++)
        rc = take_texture(r, i);
    return rc;
}

static bool is_colour(const struct scene_surface *surface)
{
    for (int k = 0; k < 3; k++)
        if (!(surface->colour[k] >= 0.0f && surface->colour[k] <= 1.0f)) return false;
    return surface->has_colour == 1;
}

static int add_surface(struct result *r, const struct scene_surface *in, uint32_t i)
{
    size_t object = strnlen(in->object, SCENE_NAME_LEN), material = strnlen(in->material, SCENE_NAME_LEN);
    if (object == SCENE_NAME_LEN || material == SCENE_NAME_LEN) return wrong(r, "a name of surface", i);
    if (in->has_colour && !is_colour(in)) return wrong(r, "the colour of surface", i);
    if (in->texture > r->head.n_textures || in->opacity > r->head.n_textures)
        return wrong(r, "the texture of surface", i);
    if (!(in->clear >= 0.0f && in->clear <= 1.0f)) return wrong(r, "the transparency of surface", i);
    if (!(in->solid >= 0.0f && in->solid <= 1.0f)) return wrong(r, "the opacity of surface", i);
    int rc = build_label(r->b, (struct text_span){in->object, object}, (struct text_span){in->material, material},
                         &r->label[i], r->err);
    if (rc != SH_OK) return rc;
    struct scene_surface *out = &r->b->scene->surface[r->label[i]];
    if (!out->has_colour && in->has_colour) memcpy(out->colour, in->colour, sizeof out->colour);
    out->has_colour |= in->has_colour;
    if (out->clear == 0.0f) out->clear = in->clear;
    if (out->texture == 0 && out->opacity == 0) out->solid = in->solid;
    if (out->texture == 0 && in->texture != 0) out->texture = r->texture[in->texture - 1];
    if (out->opacity == 0 && in->opacity != 0) out->opacity = r->texture[in->opacity - 1];
    return SH_OK;
}

static int take_surfaces(struct result *r)
{
    uint32_t n = r->head.n_surfaces;
    if (n == 0 || n > SCENE_MAX_SURFACES) return wrong(r, "number of surfaces:", n);
    struct scene_surface *surface = malloc(n * sizeof *surface);
    r->label = malloc(n * sizeof *r->label);
    int rc = surface != NULL && r->label != NULL ? import_result_take(r, surface, n * sizeof *surface)
                                                 : build_fail(r->b, SH_ENOMEM, r->err, "no memory for surfaces");
    for (uint32_t i = 0; i < n && rc == SH_OK; i++)
        rc = add_surface(r, &surface[i], i);
    free(surface);
    return rc;
}

static int take_vertices(struct result *r)
{
    struct scene *s = r->b->scene;
    int rc = build_reserve(r->b, r->head.n_vertices, r->head.n_triangles, r->err);
    for (uint32_t left = r->head.n_vertices, n; left > 0 && rc == SH_OK; left -= n) {
        n = left < AT_ONCE ? left : AT_ONCE;
        rc = import_result_take(r, s->vertex_m[s->n_vertices], n * sizeof *s->vertex_m);
        for (uint32_t i = 0; i < n && rc == SH_OK; i++)
            for (int k = 0; k < 3; k++)
                if (!(fabs(s->vertex_m[s->n_vertices + i][k]) <= SCENE_MAX_COORDINATE_M))
                    return wrong(r, "the place of vertex", s->n_vertices + i - r->b->vertex0);
        if (rc == SH_OK) s->n_vertices += n;
        if (rc == SH_OK) rc = sh_check_stop(r->b->report, r->err);
    }
    return rc;
}

/* Holds the triangles that are read at a time, in the same arrays as the file. */
struct triangles {
    uint32_t corner[AT_ONCE][3];
    uint16_t label[AT_ONCE];
    float uv[AT_ONCE][3][2];
    uint8_t rgb[AT_ONCE][3][4];
};

/* A corner without coordinates has NaN; infinite ones are refused. */
static bool is_uv(const float uv[3][2])
{
    for (int c = 0; c < 3; c++)
        if (isinf(uv[c][0]) || isinf(uv[c][1])) return false;
    return true;
}

static int add_triangle(struct result *r, const struct triangles *t, uint32_t i, uint32_t number)
{
    struct scene_build *b = r->b;
    for (int c = 0; c < 3; c++) {
        if (t->corner[i][c] >= r->head.n_vertices) return wrong(r, "a corner of triangle", number);
        b->corner[c] = b->vertex0 + t->corner[i][c];
    }
    if (t->label[i] >= r->head.n_surfaces) return wrong(r, "the label of triangle", number);
    if (r->head.has_uv && !is_uv(t->uv[i])) return wrong(r, "the texture coordinates of triangle", number);
    b->has_uv = r->head.has_uv != 0;
    if (b->has_uv) memcpy(b->corner_uv, t->uv[i], sizeof t->uv[i]);
    b->has_rgb = r->head.has_rgb != 0; /* any byte is a colour */
    if (b->has_rgb) memcpy(b->corner_rgb, t->rgb[i], sizeof t->rgb[i]);
    return build_polygon(b, 3, r->label[t->label[i]], r->err);
}

static int take_triangles(struct result *r, struct triangles *t)
{
    const uint64_t n = r->head.n_triangles, labels_at = r->at + n * sizeof t->corner[0],
                   uv_at = labels_at + n * sizeof t->label[0],
                   rgb_at = uv_at + (r->head.has_uv ? n * sizeof t->uv[0] : 0);
    if (rgb_at + (r->head.has_rgb ? n * sizeof t->rgb[0] : 0) != r->size) return wrong(r, "its size is", r->size);
    int rc = build_corners(r->b, 3, r->err);
    for (uint64_t done = 0, some; done < n && rc == SH_OK; done += some) {
        some = n - done < AT_ONCE ? n - done : AT_ONCE;
        rc = take_at(r, r->at + done * sizeof t->corner[0], t->corner, some * sizeof t->corner[0]);
        if (rc == SH_OK) rc = take_at(r, labels_at + done * sizeof t->label[0], t->label, some * sizeof t->label[0]);
        if (rc == SH_OK && r->head.has_uv)
            rc = take_at(r, uv_at + done * sizeof t->uv[0], t->uv, some * sizeof t->uv[0]);
        if (rc == SH_OK && r->head.has_rgb)
            rc = take_at(r, rgb_at + done * sizeof t->rgb[0], t->rgb, some * sizeof t->rgb[0]);
        for (uint32_t i = 0; i < some && rc == SH_OK; i++)
            rc = add_triangle(r, t, i, (uint32_t)(done + i));
        if (rc == SH_OK) rc = sh_check_stop(r->b->report, r->err);
    }
    return rc;
}

/* The least size of a file with these counts: its textures have neither names nor bytes. This size is checked before
 * anything is allocated for these counts. */
static uint64_t least_size(const struct result_head *head)
{
    const struct scene *s = NULL;
    uint64_t triangle = sizeof *s->triangle + sizeof *s->label + (head->has_uv ? sizeof *s->uv : 0) +
                        (head->has_rgb ? sizeof *s->rgb : 0);
    return sizeof *head + head->n_textures * (uint64_t)sizeof(struct result_texture) +
           head->n_surfaces * (uint64_t)sizeof *s->surface + head->n_vertices * (uint64_t)sizeof *s->vertex_m +
           head->n_triangles * triangle;
}

static int take_head(struct result *r)
{
    struct stat st;
    if (fstat(r->fd, &st) != 0) return build_fail(r->b, SH_EIO, r->err, "%s", strerror(errno));
    r->size = (uint64_t)st.st_size;
    int rc = import_result_take(r, &r->head, sizeof r->head);
    if (rc == SH_OK && memcmp(r->head.magic, MAGIC, sizeof MAGIC) != 0) rc = wrong(r, "the header is wrong at byte", 0);
    if (rc == SH_OK && r->head.n_triangles == 0) rc = wrong(r, "number of triangles:", 0);
    if (rc == SH_OK && r->head.has_uv > 1) rc = wrong(r, "texture coordinates:", r->head.has_uv);
    if (rc == SH_OK && r->head.has_rgb > 1) rc = wrong(r, "colours:", r->head.has_rgb);
    if (rc == SH_OK && !(r->head.error_m >= 0.0 && r->head.error_m <= SCENE_MAX_COORDINATE_M))
        rc = wrong(r, "the error of its vertices is not from 0 m to", (uint64_t)SCENE_MAX_COORDINATE_M);
    if (rc == SH_OK && least_size(&r->head) > r->size) rc = wrong(r, "its size is", r->size);
    if (rc == SH_OK && !(r->head.says.unit_m >= 0.0 && r->head.says.unit_m <= SCENE_MAX_COORDINATE_M))
        rc = wrong(r, "its unit is not from 0 m to", (uint64_t)SCENE_MAX_COORDINATE_M);
    if (rc == SH_OK && (r->head.says.up < -3 || r->head.says.up > 3)) rc = wrong(r, "its axes are not from -3 to", 3);
    if (rc == SH_OK && (r->head.says.is_left_handed & ~1) != 0)
        rc = wrong(r, "the handedness of its axes is not 0 or", 1);
    return rc;
}

static void import_result_count(struct result *r)
{
    struct scene *s = r->b->scene;
    s->counts.zero_area += r->head.counts.zero_area;
    s->counts.not_triangles += r->head.counts.not_triangles;
    s->counts.names_cut += r->head.counts.names_cut;
    s->n_meshes += r->head.n_meshes;
    s->error_m = fmax(s->error_m, r->head.error_m);
    s->says = r->head.says;
}

int import_result_read(struct scene_build *b, int fd, struct sh_err *err)
{
    struct result r = {.b = b, .err = err, .fd = fd};
    struct triangles *some = malloc(sizeof *some);
    int rc = some != NULL ? take_head(&r) : build_fail(b, SH_ENOMEM, err, "no memory");
    if (rc == SH_OK) rc = take_textures(&r);
    if (rc == SH_OK) rc = take_surfaces(&r);
    if (rc == SH_OK) rc = take_vertices(&r);
    if (rc == SH_OK) rc = take_triangles(&r, some);
    if (rc == SH_OK) import_result_count(&r);
    free(some);
    free(r.texture);
    free(r.label);
    return rc;
}
