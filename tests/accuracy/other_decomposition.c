/* SPDX-License-Identifier: MIT */
#include "tests/accuracy/other_decomposition.h"

#include <math.h>
#include <string.h>

enum { PARAMETERS = 4, STEPS = 200 };

static double other_model(const double *q, double x)
{
    double u = (x - q[2]) / q[3];
    return q[0] + q[1] * exp(-u * u);
}

static double other_squares(const double *y, uint32_t lo, uint32_t hi, const double *q)
{
    double sum = 0.0;
    for (uint32_t i = lo; i <= hi; i++)
        sum += pow(y[i] - other_model(q, i), 2.0);
    return sum;
}

/* Solves by Gauss's elimination with the largest pivot. */
static int other_solve(double m[PARAMETERS][PARAMETERS + 1], double *p)
{
    for (int k = 0; k < PARAMETERS; k++) {
        int best = k;
        double row[PARAMETERS + 1];
        for (int i = k + 1; i < PARAMETERS; i++)
            if (fabs(m[i][k]) > fabs(m[best][k])) best = i;
        if (m[best][k] == 0.0) return 0;
        memcpy(row, m[k], sizeof row);
        memcpy(m[k], m[best], sizeof row);
        memcpy(m[best], row, sizeof row);
        for (int i = k + 1; i < PARAMETERS; i++)
            for (int j = PARAMETERS; j >= k; j--)
                m[i][j] -= m[i][k] / m[k][k] * m[k][j];
    }
    for (int k = PARAMETERS - 1; k >= 0; k--) {
        p[k] = m[k][PARAMETERS];
        for (int j = k + 1; j < PARAMETERS; j++)
            p[k] -= m[k][j] * p[j];
        p[k] /= m[k][k];
    }
    return 1;
}

static void other_normal(const double *y, uint32_t lo, uint32_t hi, const double *q, double damping,
                         double m[PARAMETERS][PARAMETERS + 1])
{
    memset(m, 0, sizeof(double[PARAMETERS][PARAMETERS + 1]));
    for (uint32_t i = lo; i <= hi; i++) {
        double slope[PARAMETERS], rest = y[i] - other_model(q, i);
        for (int k = 0; k < PARAMETERS; k++) {
            double more[PARAMETERS], less[PARAMETERS];
            memcpy(more, q, sizeof more);
            memcpy(less, q, sizeof less);
            more[k] += 1e-5;
            less[k] -= 1e-5;
            slope[k] = (other_model(more, i) - other_model(less, i)) / 2e-5;
        }
        for (int k = 0; k < PARAMETERS; k++) {
            for (int j = 0; j < PARAMETERS; j++)
                m[k][j] += slope[k] * slope[j];
            m[k][PARAMETERS] += slope[k] * rest;
        }
    }
    for (int k = 0; k < PARAMETERS; k++)
        m[k][k] *= 1.0 + damping;
}

static void other_fit(const double *y, uint32_t lo, uint32_t hi, double *q)
{
    double damping = 0.01, squares = other_squares(y, lo, hi, q);
    for (int step = 0; step < STEPS && damping < 1e9; step++) {
        double m[PARAMETERS][PARAMETERS + 1], p[PARAMETERS], next[PARAMETERS];
        other_normal(y, lo, hi, q, damping, m);
        if (!other_solve(m, p)) return;
        for (int k = 0; k < PARAMETERS; k++)
            next[k] = q[k] + p[k];
        double after = other_squares(y, lo, hi, next);
        damping *= after < squares ? 0.1 : 10.0;
        if (!(after < squares)) continue;
        int done = squares - after < 1e-12 * squares;
        memcpy(q, next, sizeof next);
        squares = after;
        if (done) return;
    }
}

static int other_is_maximum(const double *y, uint32_t n, uint32_t i, uint32_t side)
{
    uint32_t lo = i > side ? i - side : 0, hi = i + side < n ? i + side : n - 1;
    for (uint32_t k = lo; k <= hi; k++)
        if (y[k] > y[i] || (y[k] == y[i] && k < i)) return 0;
    return 1;
}

uint32_t other_decompose(const double *y, uint32_t n, double least, uint32_t side, uint32_t fit,
                         struct other_echo *echo, uint32_t most)
{
    uint32_t found = 0;
    for (uint32_t i = 0; i < n && found < most; i++) {
        if (y[i] < least || !other_is_maximum(y, n, i, side)) continue;
        double q[PARAMETERS] = {0.0, y[i], i, 1.0};
        other_fit(y, i > fit ? i - fit : 0, i + fit < n ? i + fit : n - 1, q);
        echo[found++] = (struct other_echo){i, q[0], q[1], q[2], fabs(q[3])};
    }
    return found;
}
