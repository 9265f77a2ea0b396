/* SPDX-License-Identifier: MIT */
/* Whether a body is closed, by integrals along its edges.
 *
 * A body is closed where the edges of its triangles, each with its direction, cancel. By Stokes the sum of any field's
 * integrals along the edges is then 0, however the faces are divided. So a long edge cancels two short edges of the
 * faces on its other side, too. A search for pairs of equal edges would call such a body open.
 *
 * The fields are independent of the body: w cos(k x + p), with directions, wave numbers and phases from a fixed table.
 * Where a face is missing, each sum has the flux of the field's curl through that face, which grows with its area and
 * with |k|. */
#include "core/body.h"

#include <math.h>

#include "core/vec3.h"

/* Directions w, wave vectors k in periods over the body's size, and phases. All these figures were drawn at random. */
static const double field[BODY_FIELDS][7] = {
    {0.62, -0.31, 0.72, 1.37, -0.58, 0.91, 0.4},  {-0.45, 0.83, 0.33, -0.76, 1.12, 1.21, 2.9},
    {0.11, 0.54, -0.83, 0.93, 1.49, -0.37, 1.7},  {0.79, 0.42, 0.44, -1.26, 0.69, 1.03, 5.3},
    {-0.28, -0.66, 0.70, 1.08, 0.87, 1.16, 3.6},  {0.51, -0.75, -0.42, 0.57, -1.33, 1.27, 0.9},
    {-0.86, 0.19, -0.47, 1.31, 1.05, -0.72, 4.4}, {0.36, 0.61, 0.71, -0.98, -0.83, 1.41, 2.2},
};

void body_begin(struct body_sum *s, const double min_m[3], const double max_m[3])
{
    double size[3];
    vec3_sub(max_m, min_m, size);
    const double diagonal = sqrt(vec3_dot(size, size));
    *s = (struct body_sum){.wave = diagonal > 0.0 ? 2.0 * M_PI / diagonal : 0.0};
    for (int k = 0; k < 3; k++)
        s->centre_m[k] = min_m[k] + 0.5 * size[k];
}

void body_add_triangle(struct body_sum *s, const double corner[3][3])
{
    double p[3], n[3];
    vec3_sub(corner[0], s->centre_m, p);
    vec3_normal(corner[0], corner[1], corner[2], n);
    s->area_m2 += 0.5 * sqrt(vec3_dot(n, n));
    s->volume_m3 += vec3_dot(p, n) / 6.0;
}

/* Returns the integral of field j from a to b. */
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

void body_add_edge(struct body_sum *s, const double a[3], const double b[3])
{
    double p[3], q[3];
    vec3_sub(a, s->centre_m, p);
    vec3_sub(b, s->centre_m, q);
    for (int j = 0; j < BODY_FIELDS; j++)
        s->field[j] += along(j, s->wave, p, q);
}

double body_open_m2(const struct body_sum *s)
{
    double squares = 0.0;
    for (int j = 0; j < BODY_FIELDS; j++)
        squares += s->field[j] * s->field[j];
    /* The curl of a field is taken as |k|, and |k| as 1.8 times `wave`. A third of the curl's square is along a face's
     * normal, so its part through a missing face is |k| / 1.7 times the area. */
    return s->wave > 0.0 ? sqrt(squares / BODY_FIELDS) * 1.7 / (1.8 * s->wave) : 0.0;
}
