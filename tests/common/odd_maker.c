/* SPDX-License-Identifier: MIT */
#include "tests/common/odd_maker.h"

#include <math.h>
#include <string.h>

#include "core/vec3.h"
#include "tests/common/cases.h"

double odd_unit(struct odd_maker *m)
{
    return case_unit(&m->random);
}

double odd_between(struct odd_maker *m, double lo, double hi)
{
    return lo + (hi - lo) * odd_unit(m);
}

double odd_decades(struct odd_maker *m, double lo, double hi)
{
    return pow(10.0, odd_between(m, lo, hi));
}

int odd_pick(struct odd_maker *m, int n)
{
    return (int)case_between(&m->random, 0, n - 1);
}

double odd_sign(struct odd_maker *m)
{
    return odd_pick(m, 2) ? 1.0 : -1.0;
}

void odd_direction(struct odd_maker *m, double d[3])
{
    double z = odd_between(m, -1.0, 1.0), turn = odd_between(m, 0.0, 2.0 * ODD_PI), r = sqrt(1.0 - z * z);
    d[0] = r * cos(turn);
    d[1] = r * sin(turn);
    d[2] = z;
}

void odd_axes(struct odd_maker *m)
{
    if (odd_pick(m, 3) == 0) {
        int first = odd_pick(m, 3);
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                m->axis[i][k] = (first + i) % 3 == k ? 1.0 : 0.0;
        return;
    }
    double other[3];
    odd_direction(m, m->axis[0]);
    odd_direction(m, other);
    vec3_cross(m->axis[0], other, m->axis[1]);
    double length = vec3_length(m->axis[1]);
    for (int k = 0; k < 3; k++)
        m->axis[1][k] /= length;
    vec3_cross(m->axis[0], m->axis[1], m->axis[2]);
}

void odd_point(const struct odd_maker *m, double x, double y, double z, double p[3])
{
    for (int k = 0; k < 3; k++)
        p[k] = m->centre[k] + x * m->axis[0][k] + y * m->axis[1][k] + z * m->axis[2][k];
}

void odd_add(struct odd_maker *m, const double a[3], const double b[3], const double c[3])
{
    struct odd_scene *odd = m->odd;
    const double *const corner[3] = {a, b, c};
    if (odd->n >= m->at_most) return;
    int first = odd_pick(m, 3), step = 1 + odd_pick(m, 2);
    for (int i = 0; i < 3; i++)
        memcpy(odd->corner[odd->n][i], corner[(first + i * step) % 3], sizeof odd->corner[0][0]);
    odd->label[odd->n++] = m->label;
}
