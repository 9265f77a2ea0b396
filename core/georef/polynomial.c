/* SPDX-License-Identifier: MIT */
/* The map as a polynomial: fit and bound.
 *
 * Fit. GeographicLib computes the map at 7 x 7 x 7 Chebyshev nodes of a cube about the centre. The map is interpolated
 * by products of Lagrange polynomials, whose coefficients are made in long double. The nodes are kilometres apart: half
 * a side is 20 km, and less near a pole. So a coefficient of degree k has the nanometres of rounding in GeographicLib's
 * figures, divided by (half side)^k. The coefficient's term has (scene / half side)^k of these nanometres. Derivatives
 * by small differences would amplify the rounding. Terms up to degree 6 are kept, up to 3 or 5 are used. For the form
 * `meridian` all nodes lie in the meridian's plane.
 *
 * Bound. Points lie in a cylinder about the centre: up to radius_m from its axis, and up to height_m above and
 * below. The error of an order, at every point of the cylinder, is at most the sum of four parts: the absolute
 * values of the terms left out up to degree 6, each at its own worst place; the rest of the series,
 * taken as geometric with the ratio of degree 5 to degree 4; ten times the part of degree 7 that the fit may
 * have folded into lower terms; and FLOOR_M for rounding. The triangle inequality proves the first part, and
 * the others are small beside it. tests/accuracy/test_georef.c compares the whole with true errors at 200
 * places. */
#include "core/georef/polynomial.h"

#include <math.h>
#include <string.h>

#include "core/georef/polynomial_kernels.h"
#include "core/mat3.h"

enum { NODES = POLYNOMIAL_DEGREE + 1, CUBE = NODES * NODES * NODES };

/* Twice GeographicLib's error for transverse Mercator, 5 nm; the one for geocentric coordinates is 1 nm. */
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

/* On entry value[1] and value[2] hold n and u of the nodes in the meridian's plane. On return value[0] and value[2]
 * hold the map's latitude and height there; value[1], the longitude, is 0. Beyond the pole, latitude counts on beyond
 * 90 degrees, so that it stays smooth. */
static void sample_meridian(const struct shim_map *map, const struct polynomial *p, double value[3][CUBE])
{
    double place[3], pole;
    shim_map_place(map, place);
    pole = place[0] < 0.0 ? -90.0 : 90.0;
    for (int i = 0; i < CUBE; i++) {
        double d[3], enu[3] = {0.0, value[1][i], value[2][i]};
        mat3_apply_transposed(p->meridian.turn, enu, d);
        shim_map_forward(map, 1, (struct vec3_in){&d[0], &d[1], &d[2]},
                         (struct vec3_out){&value[0][i], &value[1][i], &value[2][i]});
        if (fabs(value[1][i]) > 90.0) value[0][i] = 2.0 * (pole - place[0]) - value[0][i];
        value[1][i] = 0.0;
    }
}

/* Copies the terms of two variables. Among the terms of degree d, x^a y^b has the place (d-a)(d-a+1)/2, and y^b z^c the
 * place d(d+1)/2 + c. */
static void set_up_plane(struct polynomial *p)
{
    int first = 0, at = 0, meridian = p->form == POLYNOMIAL_MERIDIAN;
    for (int d = 1; d <= 5; d++) {
        for (int j = 0; j <= d; j++, at++) {
            int term = first + (meridian ? d * (d + 1) / 2 + j : j * (j + 1) / 2);
            p->plane[0][at] = p->c[0][term];
            p->plane[1][at] = p->c[meridian ? 2 : 1][term];
        }
        first += (d + 1) * (d + 2) / 2;
    }
}

void polynomial_fit(const struct shim_map *map, enum polynomial_form form, double half_m, struct polynomial *out)
{
    double node[NODES], lagrange[NODES][NODES], value[3][CUBE];
    make_lagrange(node, lagrange);
    for (int i = 0; i < CUBE; i++) {
        value[0][i] = half_m * node[i / (NODES * NODES)];
        value[1][i] = half_m * node[i / NODES % NODES];
        value[2][i] = half_m * node[i % NODES];
    }
    out->form = form;
    out->half_m = half_m;
    if (form == POLYNOMIAL_MERIDIAN) {
        shim_map_meridian(map, &out->meridian);
        sample_meridian(map, out, value);
    } else {
        shim_map_forward(map, CUBE, (struct vec3_in){value[0], value[1], value[2]},
                         (struct vec3_out){value[0], value[1], value[2]});
    }
    int power[3] = {0, 0, 0};
    for (int t = 0; t < POLYNOMIAL_TERMS; t++) {
        next_power(power);
        double size = pow(half_m, power[0] + power[1] + power[2]);
        for (int k = 0; k < 3; k++)
            out->c[k][t] = coefficient(lagrange, value[k], power) / size;
    }
    set_up_plane(out);
}

int polynomial_has_order(const struct polynomial *p, int order)
{
    return p->half_m > 0.0 && ((order >= 1 && order <= 3) || (order == 5 && p->form == POLYNOMIAL_FLAT));
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

static double series_bound_m(const struct polynomial *p, int order, double radius_m, double height_m,
                             const double weight[3])
{
    double whole_m[POLYNOMIAL_DEGREE + 1], part_m[POLYNOMIAL_DEGREE + 1], bound_m = FLOOR_M;
    double reach_m = fmax(radius_m, height_m), whole_height_m = p->form == POLYNOMIAL_FLAT ? 0.0 : p->half_m;
    if (!(reach_m <= p->half_m)) return (double)INFINITY;
    degrees(p, p->half_m, whole_height_m, weight, whole_m);
    degrees(p, radius_m, height_m, weight, part_m);
    double ratio = whole_m[5] / whole_m[4], here = ratio * reach_m / p->half_m;
    if (!(here < 0.5)) return (double)INFINITY;
    for (int d = order + 1; d <= POLYNOMIAL_DEGREE; d++)
        bound_m += part_m[d];
    bound_m += part_m[POLYNOMIAL_DEGREE] * here / (1.0 - here);
    return bound_m + 10.0 * whole_m[POLYNOMIAL_DEGREE] * ratio * reach_m / p->half_m;
}

/* Where the z axis of prcs is not vertical at the centre, a point's height above the centre may equal its distance from
 * the centre. Turning a point into the meridian moves it by s - a (polynomial.h), which is at most radius^2 / 2a. */
static double meridian_bound_m(const struct polynomial *p, int order, double radius_m, double height_m,
                               const double weight[3])
{
    if (fabs(p->meridian.turn[8]) < 1.0 - 1e-12) radius_m = height_m = hypot(radius_m, height_m);
    double least_m = p->meridian.axis_m - radius_m * fabs(p->meridian.sin_lat) - height_m * p->meridian.cos_lat;
    if (!(least_m > 0.0)) return (double)INFINITY;
    double half = 0.5 * radius_m / least_m, moved_m = radius_m * half;
    double left_m = POLYNOMIAL_ATAN_LEFT * pow(half, 9) * (p->meridian.axis_m + radius_m + height_m);
    return left_m + series_bound_m(p, order, radius_m + moved_m, height_m + moved_m, weight);
}

double polynomial_bound_m(const struct polynomial *p, int order, double radius_m, double height_m,
                          const double weight[3])
{
    if (!polynomial_has_order(p, order)) return (double)INFINITY;
    if (p->form == POLYNOMIAL_MERIDIAN) return meridian_bound_m(p, order, radius_m, height_m, weight);
    return series_bound_m(p, order, radius_m, p->form == POLYNOMIAL_FLAT ? 0.0 : height_m, weight);
}
