/* SPDX-License-Identifier: MIT */
/* Triangles of a scan's grid. First come all triangles; then the mean of their edges; then the filter.
 *
 * Each edge counts once. Diagonals belong to one cell. An edge along a column, or across two columns, borders on two
 * cells. The edge's mark is stored at one of its two points. Both cells set this same mark, and marks are counted
 * afterwards. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/grow.h"
#include "core/studio/scan_mesh.h"
#include "core/vec3.h"

/* Marks of a point: edges that triangles use. */
enum { TO_NEXT_ROW = 1, TO_NEXT_COLUMN = 2, TO_POLE_BEFORE = 4 };
enum { COLUMNS_BETWEEN_STOPS = 256 };

struct build {
    const struct scan_grid *grid;
    struct scan_faces *out;
    uint8_t *mark; /* [n_points] */
    double sum_m;
};

/* Points first..end-1 of a column. */
struct side {
    uint32_t first, end;
    int is_pole;
};

/* The cell between two rows of two columns: corners a, b of the first column, d, c of the next one. */
struct cell {
    uint32_t a, b, c, d;
};

static struct side side_of(const struct scan_grid *g, uint32_t column)
{
    const struct scan_column *c = &g->column[column];
    return (struct side){c->first, column + 1 < g->n_columns ? c[1].first : g->n_points, c->is_pole};
}

static double distance2(const struct scan_grid *g, uint32_t p, uint32_t q)
{
    const double *a = g->xyz_m[p], *b = g->xyz_m[q];
    return (a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) + (a[2] - b[2]) * (a[2] - b[2]);
}

/* Adds a triangle. A triangle without area or edge-on to the head is left out, but its edges count. */
static void add_triangle(struct build *b, uint32_t p, uint32_t q, uint32_t r)
{
    const struct scan_grid *g = b->grid;
    const double *a = g->xyz_m[p];
    double n[3], facing = 0;
    vec3_normal(a, g->xyz_m[q], g->xyz_m[r], n);
    for (int k = 0; k < 3; k++)
        facing += n[k] * (g->to_head_m != NULL ? (double)g->to_head_m[p][k] : g->head_m[k] - a[k]);
    if (facing == 0) {
        b->out->n_flat++;
        return;
    }
    uint32_t *face = b->out->face[b->out->n_faces++];
    face[0] = p;
    face[1] = facing > 0 ? q : r;
    face[2] = facing > 0 ? r : q;
}

static void count_edge(struct build *b, uint32_t p, uint32_t q)
{
    b->sum_m += sqrt(distance2(b->grid, p, q));
    b->out->n_edges++;
}

static void add_full_cell(struct build *b, const struct cell *c)
{
    b->mark[c->a] |= TO_NEXT_ROW | TO_NEXT_COLUMN;
    b->mark[c->b] |= TO_NEXT_COLUMN;
    b->mark[c->d] |= TO_NEXT_ROW;
    if (distance2(b->grid, c->a, c->c) <= distance2(b->grid, c->b, c->d)) {
        count_edge(b, c->a, c->c);
        add_triangle(b, c->a, c->b, c->c);
        add_triangle(b, c->a, c->c, c->d);
    } else {
        count_edge(b, c->b, c->d);
        add_triangle(b, c->a, c->b, c->d);
        add_triangle(b, c->b, c->c, c->d);
    }
}

static void add_cell(struct build *b, const struct cell *c)
{
    const int has_a = c->a != SCAN_MESH_NONE, has_b = c->b != SCAN_MESH_NONE, has_c = c->c != SCAN_MESH_NONE,
              has_d = c->d != SCAN_MESH_NONE;
    if (has_a + has_b + has_c + has_d < 3) return;
    if (has_a && has_b && has_c && has_d) {
        add_full_cell(b, c);
        return;
    }
    if (has_a && has_b) b->mark[c->a] |= TO_NEXT_ROW;
    if (has_d && has_c) b->mark[c->d] |= TO_NEXT_ROW;
    if (has_a && has_d) b->mark[c->a] |= TO_NEXT_COLUMN;
    if (has_b && has_c) b->mark[c->b] |= TO_NEXT_COLUMN;
    if (!has_a || !has_c)
        count_edge(b, c->b, c->d);
    else
        count_edge(b, c->a, c->c);
    if (!has_a) add_triangle(b, c->b, c->c, c->d);
    if (!has_b) add_triangle(b, c->a, c->c, c->d);
    if (!has_c) add_triangle(b, c->a, c->b, c->d);
    if (!has_d) add_triangle(b, c->a, c->b, c->c);
}

/* Returns the point of a column in the row after `row`, or SCAN_MESH_NONE. after: the first point beyond `row`. */
static uint32_t next_in(const struct scan_grid *g, const struct side *s, uint32_t row, uint32_t after)
{
    if (g->rows_per_turn >= 3 && row == g->rows_per_turn - 1)
        return s->first < s->end && g->row[s->first] == 0 ? s->first : SCAN_MESH_NONE;
    return after < s->end && g->row[after] == row + 1 ? after : SCAN_MESH_NONE;
}

/* Adds the cells of two columns, row by row. */
static void add_cells(struct build *b, const struct side *left, const struct side *right)
{
    const struct scan_grid *g = b->grid;
    uint32_t l = left->first, r = right->first;
    while (l < left->end || r < right->end) {
        const uint32_t row_l = l < left->end ? g->row[l] : SCAN_MESH_NONE,
                       row_r = r < right->end ? g->row[r] : SCAN_MESH_NONE;
        const uint32_t row = row_l < row_r ? row_l : row_r;
        struct cell cell = {SCAN_MESH_NONE, SCAN_MESH_NONE, SCAN_MESH_NONE, SCAN_MESH_NONE};
        if (row_l == row) cell.a = l++;
        if (row_r == row) cell.d = r++;
        cell.b = next_in(g, left, row, l);
        cell.c = next_in(g, right, row, r);
        add_cell(b, &cell);
    }
}

/* Adds triangles of a pole and each two neighbours in the column beside it. */
static void add_fan(struct build *b, const struct side *pole, const struct side *ring, int mark)
{
    for (uint32_t p = ring->first; p < ring->end; p++) {
        const uint32_t next = next_in(b->grid, ring, b->grid->row[p], p + 1);
        if (next == SCAN_MESH_NONE) continue;
        b->mark[p] |= (uint8_t)(TO_NEXT_ROW | mark);
        b->mark[next] |= (uint8_t)mark;
        add_triangle(b, pole->first, p, next);
    }
}

static void add_between(struct build *b, const struct side *left, const struct side *right)
{
    if (left->first == left->end || right->first == right->end || (left->is_pole && right->is_pole)) return;
    if (left->is_pole)
        add_fan(b, left, right, TO_POLE_BEFORE);
    else if (right->is_pole)
        add_fan(b, right, left, TO_NEXT_COLUMN);
    else
        add_cells(b, left, right);
}

/* Counts edges from a column's points to the next row, to the next column, and to a pole before it. */
static void sum_edges(struct build *b, const struct side *s, const struct side *next, const struct side *before)
{
    const struct scan_grid *g = b->grid;
    uint32_t r = next != NULL ? next->first : 0;
    for (uint32_t p = s->first; p < s->end; p++) {
        if (b->mark[p] & TO_NEXT_ROW) count_edge(b, p, next_in(g, s, g->row[p], p + 1));
        if ((b->mark[p] & TO_POLE_BEFORE) && before != NULL) count_edge(b, p, before->first);
        if (!(b->mark[p] & TO_NEXT_COLUMN) || next == NULL) continue;
        while (!next->is_pole && r < next->end && g->row[r] < g->row[p])
            r++;
        count_edge(b, p, r);
    }
}

/* Finds the neighbour after a column. Returns 0 where there is none. */
static int neighbour(const struct scan_grid *g, uint32_t column, uint32_t *other)
{
    const int is_last = column + 1 == g->n_columns;
    *other = is_last ? 0 : column + 1;
    if (is_last) return g->closes && g->n_columns >= 3;
    return g->column[*other].line - g->column[column].line == 1;
}

static int for_columns(struct build *b, int is_sum, const struct sh_report *report, struct sh_err *err)
{
    const struct scan_grid *g = b->grid;
    struct side before;
    int has_before = 0;
    for (uint32_t i = 0; i < g->n_columns; i++) {
        uint32_t other;
        if (i % COLUMNS_BETWEEN_STOPS == COLUMNS_BETWEEN_STOPS - 1 && sh_check_stop(report, err) != SH_OK)
            return SH_ESTOPPED;
        const int has_next = neighbour(g, i, &other);
        const struct side s = side_of(g, i), next = side_of(g, other);
        if (is_sum)
            sum_edges(b, &s, has_next ? &next : NULL, has_before ? &before : NULL);
        else if (has_next)
            add_between(b, &s, &next);
        before = s;
        has_before = has_next;
    }
    return SH_OK;
}

static void filter(const struct scan_grid *g, struct scan_faces *out)
{
    const double most_m = g->long_edge * out->mean_edge_m, most2 = most_m * most_m;
    uint32_t kept = 0;
    for (uint32_t i = 0; i < out->n_faces; i++) {
        const uint32_t *f = out->face[i];
        if (distance2(g, f[0], f[1]) > most2 || distance2(g, f[1], f[2]) > most2 || distance2(g, f[2], f[0]) > most2)
            out->n_long++;
        else
            memmove(out->face[kept++], f, sizeof out->face[0]);
    }
    out->n_faces = kept;
}

int scan_faces_make(const struct scan_grid *grid, struct scan_faces *faces, const struct sh_report *report,
                    struct sh_err *err)
{
    struct build b = {.grid = grid, .out = faces};
    memset(faces, 0, sizeof *faces);
    if (grid->n_points == 0) return SH_OK;
    /* Each triangle has one edge along a column, and such an edge has at most one triangle on each side. */
    faces->face = malloc(2 * (size_t)grid->n_points * sizeof *faces->face);
    b.mark = calloc(grid->n_points, 1);
    int rc = SH_OK;
    if (faces->face == NULL || b.mark == NULL)
        rc = sh_fail(err, SH_ENOMEM, "no memory for the mesh of %u points", grid->n_points);
    if (rc == SH_OK) rc = for_columns(&b, 0, report, err);
    if (rc == SH_OK) rc = for_columns(&b, 1, report, err);
    if (rc == SH_OK && faces->n_edges > 0) faces->mean_edge_m = b.sum_m / (double)faces->n_edges;
    if (rc == SH_OK && grid->long_edge > 0) filter(grid, faces);
    free(b.mark);
    if (faces->n_faces > 0) resize(&faces->face, faces->n_faces, sizeof *faces->face); /* frees the rest */
    return rc;
}

void scan_faces_free(struct scan_faces *faces)
{
    free(faces->face);
    memset(faces, 0, sizeof *faces);
}
