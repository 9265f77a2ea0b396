/* SPDX-License-Identifier: MIT */
/* Finds the holes that textures cut out of surfaces, and texture coordinates and colours at a point. */
#include "core/scene/cutouts.h"

#include <math.h>
#include <stdlib.h>

#include "core/grow.h"
#include "core/vec3.h"

int scene_read_texture(const struct scene_texture *texture, int alpha_only, struct texture_image *image,
                       struct sh_err *err)
{
    const struct texture_source source = {.file = texture->file,
                                          .bytes = texture->bytes,
                                          .n_bytes = texture->n_bytes,
                                          .raw_width = texture->raw_width,
                                          .raw_height = texture->raw_height,
                                          .alpha_only = alpha_only};
    return texture_read(&source, image, err);
}

/* Sets w to the barycentric coordinates of p, which is on the triangle's plane: by the areas seen along the largest
 * axis of its normal. */
static void weights(const double *const corner[3], const double p[3], double w[3])
{
    double u[3], v[3], n[3];
    const double *a = corner[0];
    vec3_sub(corner[1], a, u);
    vec3_sub(corner[2], a, v);
    vec3_cross(u, v, n);
    int along = fabs(n[0]) > fabs(n[1]) ? 0 : 1;
    if (fabs(n[2]) > fabs(n[along])) along = 2;
    int x = (along + 1) % 3, y = (along + 2) % 3;
    double qx = p[x] - a[x], qy = p[y] - a[y];
    w[1] = (qx * v[y] - qy * v[x]) / n[along];
    w[2] = (u[x] * qy - u[y] * qx) / n[along];
    w[0] = 1.0 - w[1] - w[2];
}

void scene_uv_at(const struct scene *scene, uint32_t triangle, const double *const corner[3], const double p[3],
                 double uv[2])
{
    double w[3];
    weights(corner, p, w);
    uv[0] = uv[1] = 0.0;
    for (int c = 0; c < 3; c++)
        for (int k = 0; k < 2; k++)
            uv[k] += w[c] * (double)scene->uv[triangle][c][k];
}

int scene_rgb_at(const struct scene *scene, uint32_t triangle, const double *const corner[3], const double p[3],
                 uint8_t rgb[3])
{
    const uint8_t(*at)[4] = (const uint8_t(*)[4])scene->rgb[triangle];
    double w[3];
    if (at[0][3] == 0 || at[1][3] == 0 || at[2][3] == 0) return 0;
    weights(corner, p, w);
    for (int k = 0; k < 3; k++) {
        const double v = w[0] * at[0][k] + w[1] * at[1][k] + w[2] * at[2][k];
        rgb[k] = (uint8_t)lrint(fmin(255.0, fmax(0.0, v))); /* p may lie outside by rounding */
    }
    return 1;
}

/* Returns which image cuts holes into a surface, from 1; 0: none does. */
static uint32_t image_of(const struct scene_surface *s)
{
    return !(s->solid > 0.0f) ? 0 : s->opacity != 0 ? s->opacity : s->texture;
}

static int same_holes(const struct scene_surface *a, const struct scene_surface *b)
{
    return image_of(a) == image_of(b) && (a->opacity != 0) == (b->opacity != 0) && a->solid == b->solid;
}

/* Adds the mask of surface i, for it and all later surfaces of the same kind. */
static int add_mask(struct scene *s, uint32_t i, const struct texture_image *image, struct sh_err *err)
{
    const struct scene_surface *own = &s->surface[i];
    struct texture_mask *mask;
    int rc = texture_mask_create(image, s->texture[image_of(own) - 1].wrap, (double)own->solid, own->opacity != 0,
                                 &mask, err);
    if (rc != SH_OK || mask == NULL) return rc;
    if (s->cutout == NULL) s->cutout = calloc(s->n_surfaces, sizeof *s->cutout);
    if (s->cutout == NULL || !resize(&s->mask, (size_t)s->n_masks + 1, sizeof(struct texture_mask *))) {
        free(mask);
        return sh_fail(err, SH_ENOMEM, "no memory for a texture's holes");
    }
    s->mask[s->n_masks++] = mask;
    for (uint32_t k = i; k < s->n_surfaces; k++)
        if (same_holes(own, &s->surface[k])) s->cutout[k] = mask;
    return SH_OK;
}

/* Makes the masks of all surfaces that an image cuts holes into. */
static int cut_out(struct scene *s, uint32_t number, const struct texture_image *image, struct sh_err *err)
{
    const struct scene_surface *last = NULL;
    int rc = SH_OK;
    for (uint32_t i = 0; i < s->n_surfaces && rc == SH_OK; i++) {
        if (image_of(&s->surface[i]) != number || (s->cutout != NULL && s->cutout[i] != NULL)) continue;
        if (last == NULL || !same_holes(last, &s->surface[i])) rc = add_mask(s, i, image, err);
        last = &s->surface[i]; /* if it got no mask, surfaces of the same kind get none either */
    }
    return rc;
}

/* Returns how a texture's image cuts holes: bit 0: by alpha; bit 1: as an opacity map; 0: it cuts none. */
static int cuts_how(const struct scene *s, uint32_t number)
{
    int how = 0;
    for (uint32_t i = 0; i < s->n_surfaces; i++)
        if (image_of(&s->surface[i]) == number) how |= s->surface[i].opacity != 0 ? 2 : 1;
    return how;
}

int scene_find_cutouts(struct scene *s, const struct sh_report *report, struct sh_err *err)
{
    struct sh_err why, first = {0};
    uint32_t failed = 0;
    int rc = SH_OK;
    if (s->uv == NULL) return SH_OK; /* without texture coordinates no image is used */
    for (uint32_t number = 1; number <= s->n_textures && rc == SH_OK; number++) {
        struct texture_image image = {0};
        struct scene_texture *texture = &s->texture[number - 1];
        const int how = cuts_how(s, number);
        if (how == 0 || texture->unreadable) continue;
        rc = sh_check_stop(report, &why);
        if (rc == SH_OK) rc = scene_read_texture(texture, how == 1, &image, &why);
        if (rc == SH_OK) rc = cut_out(s, number, &image, &why);
        texture_image_free(&image);
        if (rc != SH_EINPUT) continue;
        if (failed++ == 0) first = why;
        texture->unreadable = 1;
        rc = SH_OK;
    }
    if (rc != SH_OK) return sh_fail(err, rc, "%s", why.text);
    if (failed > 0)
        sh_warn(
            report,
            "%u of %u textures can't be read: their surfaces get no holes, and keep the mesh's colours; the first: %s",
            failed, s->n_textures, first.text);
    return SH_OK;
}

void scene_drop_textures(struct scene *s)
{
    if (s->cutout == NULL) {
        free(s->uv);
        s->uv = NULL;
    }
    for (uint32_t i = 0; i < s->n_textures; i++) {
        free(s->texture[i].file);
        free(s->texture[i].bytes);
    }
    free(s->texture);
    s->texture = NULL;
    s->n_textures = 0;
    for (uint32_t i = 0; i < s->n_surfaces; i++)
        s->surface[i].texture = s->surface[i].opacity = 0;
}
