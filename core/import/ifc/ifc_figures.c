/* Area, volume, box, and whether a body is closed.
 *
 * A body is closed where the edges of its triangles, each with its direction, cancel. By Stokes the sum of any field's
 * integrals along them is then 0, however the faces are divided: an edge whose other side has a corner in its middle
 * cancels, too, which a count of equal edges would miss. So fields are integrated that have nothing in common with the body:
 * w cos(k x + p), with directions, wave numbers and phases from a fixed table. Per area that lacks, the sum is some |k|. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "core/import/ifc/ifc_bodies.h"
#include "core/vec3.h"

enum { N_FIELDS = 8 };
#define CLOSED_SHARE 1e-5 /* of the area: rounding leaves 1e-7, and a face that lacks more than this shows */

/* Directions w and wave vectors k in periods over the body's size, and phases: numbers from a table of random ones. */
static const double field[N_FIELDS][7] = {
    {0.62, -0.31, 0.72, 1.37, -0.58, 0.91, 0.4},  {-0.45, 0.83, 0.33, -0.76, 1.12, 1.21, 2.9},
    {0.11, 0.54, -0.83, 0.93, 1.49, -0.37, 1.7},  {0.79, 0.42, 0.44, -1.26, 0.69, 1.03, 5.3},
    {-0.28, -0.66, 0.70, 1.08, 0.87, 1.16, 3.6},  {0.51, -0.75, -0.42, 0.57, -1.33, 1.27, 0.9},
    {-0.86, 0.19, -0.47, 1.31, 1.05, -0.72, 4.4}, {0.36, 0.61, 0.71, -0.98, -0.83, 1.41, 2.2},
};

static void box_of(const struct ifc_part *part, size_t n_parts, struct ifc_figures *f)
{
    for (int k = 0; k < 3; k++) {
        f->min_m[k] = DBL_MAX;
        f->max_m[k] = -DBL_MAX;
    }
    for (size_t i = 0; i < n_parts; i++)
        for (uint32_t t = 0; t < part[i].n_triangles; t++)
            for (int c = 0; c < 3; c++)
                for (int k = 0; k < 3; k++) {
                    const double x = part[i].vertex_m[part[i].triangle[t][c]][k];
                    f->min_m[k] = fmin(f->min_m[k], x);
                    f->max_m[k] = fmax(f->max_m[k], x);
                }
}

/* The integral of field j from a to b. */
static double along(int j, double wave, const double a[3], const double b[3])
{
    const double *w = field[j], *n = field[j] + 3;
    double d[3], middle[3];
    vec3_sub(b, a, d);
    for (int k = 0; k < 3; k++)
        middle[k] = 0.5 * (a[k] + b[k]);
    const double half = 0.5 * wave * vec3_dot(n, d);
    const double sinc = fabs(half) > 1e-4 ? sin(half) / half : 1.0 - half * half / 6.0;
    return vec3_dot(w, d) * cos(wave * vec3_dot(n, middle) + field[j][6]) * sinc;
}

static void add_triangle(const double corner[3][3], double wave, struct ifc_figures *f, double sum[N_FIELDS])
{
    double u[3], v[3], n[3];
    vec3_sub(corner[1], corner[0], u);
    vec3_sub(corner[2], corner[0], v);
    vec3_cross(u, v, n);
    f->area_m2 += 0.5 * sqrt(vec3_dot(n, n));
    f->volume_m3 += vec3_dot(corner[0], n) / 6.0;
    for (int j = 0; j < N_FIELDS; j++)
        for (int c = 0; c < 3; c++)
            sum[j] += along(j, wave, corner[c], corner[(c + 1) % 3]);
}

void ifc_figures(const struct ifc_part *part, size_t n_parts, struct ifc_figures *f)
{
    double sum[N_FIELDS] = {0}, size[3], centre[3], squares = 0.0;
    *f = (struct ifc_figures){0};
    box_of(part, n_parts, f);
    if (!(f->min_m[0] <= f->max_m[0])) {
        memset(f, 0, sizeof *f);
        return;
    }
    vec3_sub(f->max_m, f->min_m, size);
    for (int k = 0; k < 3; k++)
        centre[k] = f->min_m[k] + 0.5 * size[k];
    const double diagonal = sqrt(vec3_dot(size, size)), wave = diagonal > 0.0 ? 2.0 * M_PI / diagonal : 0.0;
    for (size_t i = 0; i < n_parts; i++)
        for (uint32_t t = 0; t < part[i].n_triangles; t++) {
            double corner[3][3];
            for (int c = 0; c < 3; c++)
                vec3_sub(part[i].vertex_m[part[i].triangle[t][c]], centre, corner[c]);
            add_triangle(corner, wave, f, sum);
        }
    for (int j = 0; j < N_FIELDS; j++)
        squares += sum[j] * sum[j];
    /* A field turns by about |k| a metre, a third of it about a face's normal. */
    f->open_m2 = wave > 0.0 ? sqrt(squares / N_FIELDS) * 1.7 / (1.8 * wave) : 0.0;
}

bool ifc_is_closed(const struct ifc_figures *f)
{
    return f->area_m2 > 0.0 && f->open_m2 <= CLOSED_SHARE * f->area_m2;
}
