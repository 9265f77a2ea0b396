/* The map as a polynomial: fit, bound, evaluation.
 *
 * Fit. The map is taken by GeographicLib at 7 x 7 x 7 Chebyshev nodes of a cube about the centre and interpolated
 * (products of Lagrange polynomials, whose coefficients are made in long double). The nodes are kilometres apart, so
 * that the nanometres of rounding in GeographicLib's figures are divided by (20 km)^k in a coefficient of degree k and
 * come back multiplied by (scene / 20 km)^k; derivatives by small differences would do the opposite. Terms up to
 * degree 6 are kept, up to 3 are used.
 *
 * Bound. What an order leaves out is, for every point of the cylinder, at most the sum of the absolute values of the
 * terms left out up to degree 6, each at its own worst place; plus the rest of the series, which is taken as geometric
 * with the ratio of degree 5 to degree 4; plus ten times what the fit can have folded into lower terms of degree 7;
 * plus FLOOR_M for rounding. The first part is proven by the triangle inequality, the others are small beside it;
 * tests/accuracy/test_georef.c holds the whole against true errors at 200 places. */
#include "core/georef/polynomial.h"

#include <math.h>
#include <string.h>

#include "core/vecmath.h"

enum { NODES = POLYNOMIAL_DEGREE + 1, CUBE = NODES * NODES * NODES, BLOCK = 128 };

/* GeographicLib's 5 nm for transverse Mercator, 1 nm for geocentric coordinates, and as much again. */
static const double FLOOR_M = 1e-8;

/* lagrange[i][a]: coefficient of t^a in the polynomial that is 1 at node i of -1..1 and 0 at the others. */
static void make_lagrange(double node[NODES], double lagrange[NODES][NODES])
{
    for (int i = 0; i < NODES; i++)
        node[i] = i == NODES / 2 ? 0.0 : cos((2 * i + 1) * M_PI / (2 * NODES));
    for (int i = 0; i < NODES; i++) {
        long double c[NODES + 1] = {1.0L}, scale = 1.0L;
        int degree = 0;
        for (int k = 0; k < NODES; k++) {
            if (k == i) continue;
            for (int a = ++degree; a >= 0; a--) /* times (t - node[k]) */
                c[a] = (a > 0 ? c[a - 1] : 0.0L) - (long double)node[k] * c[a];
            scale *= (long double)node[i] - (long double)node[k];
        }
        for (int a = 0; a < NODES; a++)
            lagrange[i][a] = (double)(c[a] / scale);
    }
}

/* The coefficient of x^a y^b z^c in units of the cube's half side. */
static double coefficient(double lagrange[NODES][NODES], const double *value, const int power[3])
{
    long double sum = 0.0L;
    for (int i = 0; i < NODES; i++)
        for (int j = 0; j < NODES; j++) {
            long double row = 0.0L;
            for (int k = 0; k < NODES; k++)
                row += (long double)lagrange[k][power[2]] * (long double)*value++;
            sum += (long double)lagrange[i][power[0]] * (long double)lagrange[j][power[1]] * row;
        }
    return (double)sum;
}

/* The next term in order; begin with {0, 0, 0}. */
static void next_power(int power[3])
{
    int *a = &power[0], *b = &power[1], *c = &power[2];
    if (*b > 0) {
        --*b;
        ++*c;
    } else if (*a > 0) {
        --*a;
        *b = *c + 1;
        *c = 0;
    } else {
        *a = *c + 1;
        *c = 0;
    }
}

void polynomial_fit(const struct shim_map *map, double half_m, struct polynomial *out)
{
    double node[NODES], lagrange[NODES][NODES], value[3][CUBE];
    make_lagrange(node, lagrange);
    for (int i = 0; i < CUBE; i++) {
        value[0][i] = half_m * node[i / (NODES * NODES)];
        value[1][i] = half_m * node[i / NODES % NODES];
        value[2][i] = half_m * node[i % NODES];
    }
    shim_map_forward(map, CUBE, value[0], value[1], value[2], value[0], value[1], value[2]);
    int power[3] = {0, 0, 0};
    for (int t = 0; t < POLYNOMIAL_TERMS; t++) {
        next_power(power);
        double size = pow(half_m, power[0] + power[1] + power[2]);
        for (int k = 0; k < 3; k++)
            out->c[k][t] = coefficient(lagrange, value[k], power) / size;
    }
    out->half_m = half_m;
}

/* Largest x^a y^b z^c within the cylinder. */
static double largest(const int power[3], double radius_m, double height_m)
{
    int a = power[0], b = power[1];
    double flat = pow(radius_m, a + b);
    if (a > 0 && b > 0) flat *= pow(a, 0.5 * a) * pow(b, 0.5 * b) / pow(a + b, 0.5 * (a + b));
    return flat * pow(height_m, power[2]);
}

/* Bound of each degree's part, in metres. */
static void degrees(const struct polynomial *p, double radius_m, double height_m, const double weight[3],
                    double part_m[POLYNOMIAL_DEGREE + 1])
{
    double sum[POLYNOMIAL_DEGREE + 1][3];
    int power[3] = {0, 0, 0};
    memset(sum, 0, sizeof sum);
    for (int t = 0; t < POLYNOMIAL_TERMS; t++) {
        next_power(power);
        double size = largest(power, radius_m, height_m);
        for (int k = 0; k < 3; k++)
            sum[power[0] + power[1] + power[2]][k] += fabs(p->c[k][t]) * weight[k] * size;
    }
    for (int d = 0; d <= POLYNOMIAL_DEGREE; d++)
        part_m[d] = sqrt(sum[d][0] * sum[d][0] + sum[d][1] * sum[d][1] + sum[d][2] * sum[d][2]);
}

double polynomial_bound_m(const struct polynomial *p, int order, double radius_m, double height_m,
                          const double weight[3])
{
    double whole_m[POLYNOMIAL_DEGREE + 1], part_m[POLYNOMIAL_DEGREE + 1], bound_m = FLOOR_M;
    double reach_m = fmax(radius_m, height_m);
    if (!(reach_m <= p->half_m) || p->half_m == 0.0) return (double)INFINITY;
    degrees(p, p->half_m, p->half_m, weight, whole_m);
    degrees(p, radius_m, height_m, weight, part_m);
    double ratio = whole_m[5] / whole_m[4], here = ratio * reach_m / p->half_m;
    if (!(here < 0.5)) return (double)INFINITY;
    for (int d = order + 1; d <= POLYNOMIAL_DEGREE; d++)
        bound_m += part_m[d];
    bound_m += part_m[POLYNOMIAL_DEGREE] * here / (1.0 - here);
    return bound_m + 10.0 * whole_m[POLYNOMIAL_DEGREE] * ratio * reach_m / p->half_m;
}

VEC_INLINE double order1(const double *c, double x, double y, double z)
{
    return x * c[0] + y * c[1] + z * c[2];
}

VEC_INLINE double order2(const double *c, double x, double y, double z)
{
    return x * (c[0] + x * c[3] + y * c[4] + z * c[5]) + y * (c[1] + y * c[6] + z * c[7]) + z * (c[2] + z * c[8]);
}

VEC_INLINE double order3(const double *c, double x, double y, double z)
{
    double in_x = c[0] + x * (c[3] + x * c[9] + y * c[10] + z * c[11]) + y * (c[4] + y * c[12] + z * c[13]) +
                  z * (c[5] + z * c[14]);
    double in_y = c[1] + y * (c[6] + y * c[15] + z * c[16]) + z * (c[7] + z * c[17]);
    return x * in_x + y * in_y + z * (c[2] + z * (c[8] + z * c[18]));
}

/* One output at a time: its coefficients stay in registers. */
#define APPLY(order)                                                                                    \
    VEC_CLONES                                                                                          \
    static void apply_##order(const double c[POLYNOMIAL_USED], size_t n, const double *restrict x,      \
                              const double *restrict y, const double *restrict z, double *restrict out) \
    {                                                                                                   \
        double k[POLYNOMIAL_USED];                                                                      \
        memcpy(k, c, sizeof k);                                                                         \
        for (size_t i = 0; i < n; i++)                                                                  \
            out[i] = order(k, x[i], y[i], z[i]);                                                        \
    }
APPLY(order1)
APPLY(order2)
APPLY(order3)

void polynomial_apply(const struct polynomial *p, int order, size_t n, const double *x, const double *y,
                      const double *z, double *out_x, double *out_y, double *out_z)
{
    double result[3][BLOCK];
    void (*apply)(const double *, size_t, const double *restrict, const double *restrict, const double *restrict,
                  double *restrict) = order == 1   ? apply_order1
                                      : order == 2 ? apply_order2
                                                   : apply_order3;
    for (size_t at = 0; at < n; at += BLOCK) {
        size_t m = n - at < BLOCK ? n - at : BLOCK;
        for (int k = 0; k < 3; k++)
            apply(p->c[k], m, x + at, y + at, z + at, result[k]);
        memcpy(out_x + at, result[0], m * sizeof *out_x);
        memcpy(out_y + at, result[1], m * sizeof *out_y);
        memcpy(out_z + at, result[2], m * sizeof *out_z);
    }
}
