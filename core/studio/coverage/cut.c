/* SPDX-License-Identifier: MIT */
#include "core/studio/coverage/cut.h"

#include <math.h>
#include <string.h>

#include "core/vec3.h"

static const double PIECE = 0.44721359549995794; /* 1 / sqrt(5) */

static int choose_base(const double corner[3][3], struct cut *cut)
{
    double longest2 = -1.0;
    int opposite = 0;
    for (int i = 0; i < 3; i++) {
        double d[3];
        vec3_sub(corner[(i + 2) % 3], corner[(i + 1) % 3], d);
        const double length2 = vec3_dot(d, d);
        if (length2 <= longest2) continue;
        longest2 = length2;
        opposite = i;
    }
    cut->apex = opposite;
    cut->base[0] = (opposite + 1) % 3;
    cut->base[1] = (opposite + 2) % 3;
    return longest2 > 0.0;
}

/* This has the columns of a part, and the rows of its last column (across), before they are rounded up. columns is 0
 * where the triangle has no such part. */
struct count {
    double base_m, columns, across;
    int from_apex;
};

static void count_part(double leg_m, double height_m, double size_m, struct count *count)
{
    const double wide_m = PIECE * size_m;
    count->from_apex = leg_m < height_m;
    count->columns = leg_m > 0.0 && height_m > 0.0 ? fmax(leg_m, height_m) / wide_m : 0.0;
    count->across = fmin(leg_m, height_m) / wide_m;
}

/* Returns 1 where the triangle is one piece. */
static int count_parts(const double corner[3][3], double size_m, struct cut *cut, struct count count[2])
{
    double base[3], side[3], across[3];
    memset(cut, 0, sizeof *cut);
    const int has_base = choose_base(corner, cut);
    vec3_sub(corner[cut->base[1]], corner[cut->base[0]], base);
    vec3_sub(corner[cut->apex], corner[cut->base[0]], side);
    count[0].base_m = vec3_length(base);
    if (!has_base || count[0].base_m <= size_m) return 1;
    vec3_cross(base, side, across);
    const double height_m = vec3_length(across) / count[0].base_m;
    cut->foot = fmin(fmax(vec3_dot(side, base) / vec3_dot(base, base), 0.0), 1.0);
    count_part(cut->foot * count[0].base_m, height_m, size_m, &count[0]);
    count_part((1.0 - cut->foot) * count[0].base_m, height_m, size_m, &count[1]);
    return count[0].columns == 0.0 && count[1].columns == 0.0;
}

void cut_set_up(const double corner[3][3], double size_m, struct cut *cut)
{
    struct count count[2];
    if (count_parts(corner, size_m, cut, count)) {
        cut->part[0] = (struct cut_part){.columns = 1, .across = 1.0, .share = 1.0};
        cut->foot = 1.0;
        return;
    }
    for (int i = 0; i < 2; i++)
        cut->part[i] = (struct cut_part){.from_apex = count[i].from_apex,
                                         .columns = (uint32_t)ceil(count[i].columns),
                                         .across = count[i].across,
                                         .share = i == 0 ? cut->foot : 1.0 - cut->foot};
    /* Where a leg is too short for a double, the other part has all of the area. */
    for (int i = 0; i < 2; i++)
        if (cut->part[i].columns == 0) {
            cut->part[i].share = 0.0;
            cut->part[1 - i].share = 1.0;
        }
}

/* Returns the sum of the rows of all columns, each rounded up. */
static double pieces_of(const struct count *count)
{
    const double n = ceil(count->columns);
    if (n == 0.0) return 0.0;
    if (n > 1e4) return n * (0.5 * count->across + 1.0); /* the sum is not more than this */
    double sum = 0.0;
    for (double k = 1.0; k <= n; k++)
        sum += fmax(ceil(count->across * k / n), 1.0);
    return sum;
}

double cut_count(const double corner[3][3], double size_m)
{
    struct cut cut;
    struct count count[2];
    return count_parts(corner, size_m, &cut, count) ? 1.0 : pieces_of(&count[0]) + pieces_of(&count[1]);
}

uint32_t cut_columns(const struct cut *cut)
{
    return cut->part[0].columns + cut->part[1].columns;
}

/* Returns the part of a column; *column becomes its number there. */
static int part_of(const struct cut *cut, uint32_t *column)
{
    if (*column < cut->part[0].columns) return 0;
    *column -= cut->part[0].columns;
    return 1;
}

uint32_t cut_rows(const struct cut *cut, uint32_t column)
{
    const struct cut_part *p = &cut->part[part_of(cut, &column)];
    return (uint32_t)fmax(ceil(p->across * (column + 1.0) / p->columns), 1.0);
}

double cut_share(const struct cut *cut, uint32_t column)
{
    const double rows = cut_rows(cut, column);
    const struct cut_part *p = &cut->part[part_of(cut, &column)];
    return p->share * (2.0 * column + 1.0) / ((double)p->columns * p->columns * rows);
}

static uint32_t step_of(double part, uint32_t n)
{
    const double at = floor(part * n);
    return at > 0.0 ? (at < n ? (uint32_t)at : n - 1) : 0; /* NaN: 0 */
}

/* Letters are those of cut.h; E is A in the first part, and B in the second. A point of a part is e E + g F + t T. u
 * and v count from the tip: u along the longer leg, v along the other one. */
void cut_find(const struct cut *cut, const double weight[3], uint32_t *column, uint32_t *row)
{
    const double sum = weight[0] + weight[1] + weight[2];
    const double a = weight[cut->base[0]] / sum, b = weight[cut->base[1]] / sum, t = weight[cut->apex] / sum;
    const double f = cut->foot;
    int i = b + t * f < f ? 0 : 1;
    if (cut->part[i].columns == 0) i = 1 - i;
    const struct cut_part *p = &cut->part[i];
    const double e = i == 0 ? a - b * (1.0 - f) / f : b - a * f / (1.0 - f);
    const double u = p->from_apex ? 1.0 - t : 1.0 - e, v = p->from_apex ? e : t;
    *column = step_of(u, p->columns) + (i == 0 ? 0 : cut->part[0].columns);
    *row = step_of(v / u, cut_rows(cut, *column));
}

int cut_corners(const struct cut *cut, const double corner[3][3], uint32_t column, uint32_t first, uint32_t end,
                double out[4][3])
{
    const uint32_t rows = cut_rows(cut, column);
    const int i = part_of(cut, &column);
    const struct cut_part *p = &cut->part[i];
    const double *base_end = corner[cut->base[i]], *apex = corner[cut->apex];
    const double *tip = p->from_apex ? apex : base_end, *third = p->from_apex ? base_end : apex;
    const double u0 = (double)column / p->columns, u1 = (column + 1.0) / p->columns;
    const double v0 = (double)first / rows, v1 = (double)end / rows;
    const double u[4] = {u0, u1, u1, u0}, v[4] = {u0 * v0, u1 * v0, u1 * v1, u0 * v1};
    const int n = column == 0 ? 3 : 4, turned = (i == 1) != p->from_apex;
    double foot[3];
    for (int k = 0; k < 3; k++)
        foot[k] = (1.0 - cut->foot) * corner[cut->base[0]][k] + cut->foot * corner[cut->base[1]][k];
    for (int c = 0; c < n; c++) {
        const int at = turned ? n - 1 - c : c;
        for (int k = 0; k < 3; k++)
            out[at][k] = (1.0 - u[c]) * tip[k] + (u[c] - v[c]) * foot[k] + v[c] * third[k];
    }
    return n;
}
