/* SPDX-License-Identifier: MIT */
/* /cells gives the pieces of the surface with their cells, to a page that paints them. */
#include <stdlib.h>
#include <string.h>

#include "core/bytes.h"
#include "firmware_sim/app/studio/preview/inside.h"

enum { CELLS_HEAD_BYTES = 48, CELLS_VERSION = 1, CELL_BYTES = 4, PIECE_BYTES = 4 + 4 * 12 };

struct pieces {
    uint64_t n;
    char *cell, *corner; /* NULL: they are only counted */
    double origin_m[3];
};

static void take_piece(void *ctx, uint32_t cell, int n, const double corner[4][3])
{
    struct pieces *p = ctx;
    p->n++;
    if (p->cell == NULL) return;
    le_put32(p->cell, cell);
    p->cell += 4;
    for (int k = 0; k < 4; k++)
        for (int i = 0; i < 3; i++, p->corner += 4)
            le_put_float(p->corner, (float)(corner[k < n ? k : n - 1][i] - p->origin_m[i]));
}

static void put_cells_head(const struct preview_work *work, const struct pieces *p, char *to)
{
    memcpy(to, "SHCE", 4);
    le_put32(to + 4, CELLS_VERSION);
    le_put32(to + 8, coverage_cells(work->coverage));
    le_put32(to + 12, (uint32_t)p->n);
    for (int i = 0; i < 3; i++)
        le_put_double(to + 16 + 8 * i, p->origin_m[i]);
    le_put_double(to + 40, work->options->cell_m);
}

int preview_cells(const struct preview_work *work, struct web_body *out, struct sh_err *err)
{
    const struct scene *scene = work->options->site->scene;
    const uint32_t n_cells = coverage_cells(work->coverage);
    struct pieces p = {.n = 0};
    if (n_cells == 0) return sh_fail(err, SH_ESTATE, "the scene has too many triangles for coverage");
    for (int i = 0; i < 3; i++)
        p.origin_m[i] = 0.5 * scene->min_m[i] + 0.5 * scene->max_m[i];
    coverage_pieces(work->coverage, take_piece, &p);
    if (p.n > PREVIEW_MOST_PIECES)
        return sh_fail(err, SH_ESTATE, "the surface has %llu pieces; %d at most can be painted",
                       (unsigned long long)p.n, PREVIEW_MOST_PIECES);
    out->type = "application/octet-stream";
    out->len = CELLS_HEAD_BYTES + (size_t)n_cells * CELL_BYTES + p.n * PIECE_BYTES;
    char *to = out->bytes = malloc(out->len);
    if (to == NULL) return sh_fail(err, SH_ENOMEM, "no memory for the cells of the surface");
    put_cells_head(work, &p, to);
    to += CELLS_HEAD_BYTES;
    for (uint32_t i = 0; i < n_cells; i++, to += CELL_BYTES) {
        struct coverage_cell cell;
        coverage_get(work->coverage, i, &cell);
        le_put_float(to, (float)cell.area_m2);
    }
    p.cell = to;
    p.corner = to + 4 * p.n;
    coverage_pieces(work->coverage, take_piece, &p);
    return SH_OK;
}
