/* SPDX-License-Identifier: MIT */
#include "drivers/record/mesh_texture.h"

#include <stdlib.h>
#include <string.h>

static uint32_t lines_of(const struct mesh_grid *g)
{
    return g->line_max - g->line_min + 1;
}

static uint32_t rows_of(const struct mesh_grid *g)
{
    return g->row_max - g->row_min + 1;
}

static uint32_t divided(uint32_t n, uint32_t by)
{
    return n / by + (n % by != 0);
}

static void set_texel(struct picture *image, uint32_t column, uint32_t row, const uint8_t rgb[3])
{
    const size_t at = (size_t)(image->height - 1 - row) * image->width + column;
    memcpy(image->rgb + 3 * at, rgb, 3);
}

/* A pole has one shot: its colour fills the column. */
static void draw_point(const struct mesh_grid *g, uint32_t i, const uint8_t rgb[3], uint32_t every,
                       struct picture *image)
{
    const uint32_t column = g->line[i] - g->line_min, row = g->row[i] - g->row_min;
    if (column % every != 0) return;
    if (mesh_grid_is_pole(g, g->line[i]))
        for (uint32_t k = 0; k < image->height; k++)
            set_texel(image, column / every, k, rgb);
    else if (row % every == 0)
        set_texel(image, column / every, row / every, rgb);
}

int mesh_texture_draw(const struct mesh_grid *g, struct mesh_points *points, struct picture *image, uint32_t *every,
                      struct sh_err *err)
{
    static const uint8_t black[3] = {0, 0, 0};
    const uint32_t lines = lines_of(g), rows = rows_of(g);
    *every = divided(lines > rows ? lines : rows, MESH_TEXTURE_SIDE);
    int rc = picture_make(image, divided(lines, *every), divided(rows, *every), black, err);
    if (rc != SH_OK) return rc;
    for (uint32_t i = 0; i < g->n; i++) {
        const uint32_t p = g->first + i;
        draw_point(g, i, points->rgb[p], *every, image);
        points->uv[p][0] = (float)((g->line[i] - g->line_min + 0.5) / ((double)*every * image->width));
        points->uv[p][1] = (float)((g->row[i] - g->row_min + 0.5) / ((double)*every * image->height));
    }
    return SH_OK;
}

/* These are needed to unwrap the faces of a grid that is closed along one of its sides. */
struct unwrap {
    const struct mesh_grid *grid;
    struct mesh_points *points;
    uint32_t *seam_copy; /* of each point of the grid: its copy beyond the seam, or SCAN_MESH_NONE */
};

static int add_seam_copy(struct unwrap *w, uint32_t point, float du, float dv, uint32_t *seam_copy, struct sh_err *err)
{
    struct mesh_point copy;
    mesh_points_get(w->points, point, &copy);
    copy.uv[0] += du;
    copy.uv[1] += dv;
    *seam_copy = w->points->n;
    return mesh_points_add(w->points, &copy, err);
}

/* Moves corners beyond the seam, if the other corners are more than half a turn away. place has line or row of each
 * corner, from 0 on. A corner that is moved gets uv coordinates that are larger by `by`. */
static int cross_seam(struct unwrap *w, uint32_t face[3], const uint32_t place[3], uint32_t turn, const float by[2],
                      struct sh_err *err)
{
    uint32_t most = place[0];
    for (int k = 1; k < 3; k++)
        if (place[k] > most) most = place[k];
    for (int k = 0; k < 3; k++) {
        if (most - place[k] <= turn / 2) continue;
        uint32_t *seam_copy = &w->seam_copy[face[k] - w->grid->first];
        int rc = *seam_copy == SCAN_MESH_NONE ? add_seam_copy(w, face[k], by[0], by[1], seam_copy, err) : SH_OK;
        if (rc != SH_OK) return rc;
        face[k] = *seam_copy;
    }
    return SH_OK;
}

/* Each face at a pole gets a pole point of its own, halfway between its other two corners in the image. The first face
 * takes the pole itself, each further face a copy. */
static int split_pole(struct unwrap *w, uint32_t face[3], int pole, struct sh_err *err)
{
    float(*uv)[2] = w->points->uv;
    const uint32_t p = face[pole];
    const float v = (uv[face[(pole + 1) % 3]][1] + uv[face[(pole + 2) % 3]][1]) / 2;
    if (w->seam_copy[p - w->grid->first] != SCAN_MESH_NONE)
        return add_seam_copy(w, p, 0, v - uv[p][1], &face[pole], err);
    w->seam_copy[p - w->grid->first] = p;
    uv[p][1] = v;
    return SH_OK;
}

static int unwrap_face(struct unwrap *w, uint32_t face[3], struct sh_err *err)
{
    const struct mesh_grid *g = w->grid;
    uint32_t line[3], row[3];
    int pole = -1;
    for (int k = 0; k < 3; k++) {
        const uint32_t i = face[k] - g->first;
        line[k] = g->line[i] - g->line_min;
        row[k] = g->row[i] - g->row_min;
        if (mesh_grid_is_pole(g, g->line[i])) pole = k;
    }
    if (pole >= 0) row[pole] = row[(pole + 1) % 3] > row[(pole + 2) % 3] ? row[(pole + 1) % 3] : row[(pole + 2) % 3];
    int rc = g->rows_per_turn > 0 ? cross_seam(w, face, row, rows_of(g), (const float[2]){0, 1}, err)
                                  : cross_seam(w, face, line, lines_of(g), (const float[2]){1, 0}, err);
    return rc == SH_OK && pole >= 0 ? split_pole(w, face, pole, err) : rc;
}

int mesh_texture_unwrap(const struct mesh_grid *g, struct mesh_points *points, uint32_t (*face)[3], uint32_t n_faces,
                        struct sh_err *err)
{
    struct unwrap w = {.grid = g, .points = points};
    if (g->n == 0) return SH_OK;
    w.seam_copy = malloc(g->n * sizeof *w.seam_copy);
    if (w.seam_copy == NULL) return sh_fail(err, SH_ENOMEM, "no memory for texture coordinates");
    for (uint32_t i = 0; i < g->n; i++)
        w.seam_copy[i] = SCAN_MESH_NONE;
    int rc = SH_OK;
    for (uint32_t i = 0; rc == SH_OK && i < n_faces; i++)
        rc = unwrap_face(&w, face[i], err);
    free(w.seam_copy);
    return rc;
}
