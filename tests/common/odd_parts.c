/* SPDX-License-Identifier: MIT */
/* Parts of odd scenes. Coordinates are in units of a part's size, about the part's centre. */
#include "tests/common/odd_maker.h"

#include <math.h>
#include <string.h>

static void add_needles(struct odd_maker *m)
{
    for (int i = 1 + odd_pick(m, 5); i > 0; i--) {
        double a[3], b[3], c[3], half = 0.5 * m->size_m, high = m->size_m * odd_decades(m, -6.0, -1.0);
        odd_axes(m);
        odd_point(m, -half, 0.0, 0.0, a);
        odd_point(m, half, 0.0, 0.0, b);
        odd_point(m, half * (odd_pick(m, 3) ? odd_between(m, -1.0, 1.0) : -1.0), high, 0.0, c);
        odd_add(m, a, b, c);
    }
}

/* The third corner lies almost on the line of the others, or apart from it only by rounding. */
static void add_slivers(struct odd_maker *m)
{
    for (int i = 1 + odd_pick(m, 5); i > 0; i--) {
        double a[3], b[3], c[3], at = odd_between(m, -0.5, 1.5),
                                 off = odd_pick(m, 2) ? odd_decades(m, -13.0, -5.0) : 0.0;
        odd_axes(m);
        odd_point(m, -m->size_m, 0.0, 0.0, a);
        odd_point(m, m->size_m, 0.0, 0.0, b);
        odd_point(m, m->size_m * at, m->size_m * off, 0.0, c);
        odd_add(m, a, b, c);
    }
}

static void add_random(struct odd_maker *m)
{
    for (int i = 1 + odd_pick(m, 8); i > 0; i--) {
        double p[3][3];
        for (int k = 0; k < 3; k++)
            odd_point(m, m->size_m * odd_between(m, -1.0, 1.0), m->size_m * odd_between(m, -1.0, 1.0),
                      m->size_m * odd_between(m, -1.0, 1.0), p[k]);
        odd_add(m, p[0], p[1], p[2]);
    }
}

/* A face, and others above or below it by next to nothing or nothing at all. The others have the same corners, or are
 * shifted or scaled in the plane. */
static void add_stack(struct odd_maker *m)
{
    double x[3], y[3];
    for (int k = 0; k < 3; k++) {
        x[k] = m->size_m * odd_between(m, -1.0, 1.0);
        y[k] = m->size_m * odd_between(m, -1.0, 1.0);
    }
    for (int i = 2 + odd_pick(m, 6); i > 0; i--) {
        double p[3][3], off = odd_pick(m, 3) ? odd_sign(m) * odd_decades(m, -12.0, -3.0) : 0.0;
        double dx = odd_pick(m, 2) ? m->size_m * odd_between(m, -0.5, 0.5) : 0.0,
               scale = odd_pick(m, 2) ? odd_decades(m, -1.0, 0.3) : 1.0;
        for (int k = 0; k < 3; k++)
            odd_point(m, dx + scale * x[k], scale * y[k], off, p[k]);
        m->label = (uint16_t)odd_pick(m, ODD_LABELS);
        odd_add(m, p[0], p[1], p[2]);
    }
}

/* A square in cells of two triangles, and again in other cells, in the same plane or next to it. */
static void add_sheets(struct odd_maker *m)
{
    for (int sheet = 1 + odd_pick(m, 3); sheet > 0; sheet--) {
        int nx = 1 + odd_pick(m, 4), ny = 1 + odd_pick(m, 4);
        double off = odd_pick(m, 3) == 0 ? odd_sign(m) * odd_decades(m, -12.0, -3.0) : 0.0;
        m->label = (uint16_t)odd_pick(m, ODD_LABELS);
        for (int j = 0; j < ny; j++)
            for (int i = 0; i < nx; i++) {
                double p[4][3];
                for (int k = 0; k < 4; k++)
                    odd_point(m, m->size_m * (2.0 * (i + (k & 1)) / nx - 1.0),
                              m->size_m * (2.0 * (j + k / 2) / ny - 1.0), off, p[k]);
                odd_add(m, p[0], p[1], p[3]);
                odd_add(m, p[0], p[3], p[2]);
            }
    }
}

/* Blades about one corner, level or raised by a little or a lot. The fan is closed or open. */
static void add_fan(struct odd_maker *m)
{
    int n = 3 + odd_pick(m, 10);
    double middle[3], first[3], last[3], rim[3], raise = m->size_m * odd_decades(m, -6.0, 0.0);
    double turn = odd_pick(m, 2) ? 2.0 * ODD_PI : odd_between(m, 0.1, 7.0);
    odd_point(m, 0.0, 0.0, 0.0, middle);
    for (int i = 0; i <= n; i++) {
        double angle = turn * i / n, far = m->size_m * odd_between(m, 0.3, 1.0);
        odd_point(m, far * cos(angle), far * sin(angle), raise * odd_between(m, -1.0, 1.0), rim);
        if (i == 0) memcpy(first, rim, sizeof first);
        if (i == n && turn == 2.0 * ODD_PI) memcpy(rim, first, sizeof rim);
        if (i > 0) odd_add(m, middle, last, rim);
        memcpy(last, rim, sizeof last);
    }
}

/* Triangles side by side. All folds have one angle: nearly none, nearly half a turn, or between. */
static void add_strip(struct odd_maker *m)
{
    double p[3][3], along[2] = {1.0, 0.0}, at[2] = {0.0, 0.0}, step = 0.5 * m->size_m;
    double fold = odd_pick(m, 2) ? odd_decades(m, -6.0, 0.0) * ODD_PI : ODD_PI - odd_decades(m, -6.0, 0.0) * ODD_PI;
    for (int i = 0, n = 3 + odd_pick(m, 9); i < n; i++) {
        for (int k = 0; k < 2 && i > 2; k++)
            memcpy(p[k], p[k + 1], sizeof p[k]);
        odd_point(m, at[0], (i & 1 ? 0.5 : -0.5) * m->size_m, at[1], p[i < 2 ? i : 2]);
        if (i >= 2) odd_add(m, p[0], p[1], p[2]);
        at[0] += step * along[0];
        at[1] += step * along[1];
        double angle = odd_sign(m) * fold, c = cos(angle), s = sin(angle), x = along[0];
        along[0] = c * x - s * along[1];
        along[1] = s * x + c * along[1];
    }
}

static void add_box(struct odd_maker *m, double half_x, double half_y, double half_z)
{
    static const int side[6][4] = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
    double p[8][3];
    for (int i = 0; i < 8; i++)
        odd_point(m, i & 1 ? half_x : -half_x, i & 2 ? half_y : -half_y, i & 4 ? half_z : -half_z, p[i]);
    for (int i = 0; i < 6; i++) {
        odd_add(m, p[side[i][0]], p[side[i][1]], p[side[i][2]]);
        odd_add(m, p[side[i][0]], p[side[i][2]], p[side[i][3]]);
    }
}

static void add_boxes(struct odd_maker *m)
{
    double x = m->size_m, y = m->size_m * odd_between(m, 0.1, 1.0), z = m->size_m * odd_between(m, 0.1, 1.0);
    for (int i = 1 + odd_pick(m, 3); i > 0; i--) {
        m->label = (uint16_t)i;
        add_box(m, x, y, z);
        double gap = odd_pick(m, 4) ? odd_decades(m, -12.0, -0.5) : 0.0;
        x += gap;
        y += odd_pick(m, 4) ? gap : 0.0;
        z += odd_pick(m, 4) ? gap : 0.0;
    }
}

static void halve(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = 0.5 * a[k] + 0.5 * b[k];
}

/* An octahedron, each side cut in four. */
static void add_ball(struct odd_maker *m)
{
    double p[6][3], h[3][3];
    for (int i = 0; i < 6; i++) {
        double r = (i & 1 ? -1.0 : 1.0) * m->size_m * odd_between(m, 0.7, 1.0);
        odd_point(m, i / 2 == 0 ? r : 0.0, i / 2 == 1 ? r : 0.0, i / 2 == 2 ? r : 0.0, p[i]);
    }
    for (int i = 0; i < 8; i++) {
        const double *c[3] = {p[i & 1], p[2 + (i >> 1 & 1)], p[4 + (i >> 2)]};
        for (int k = 0; k < 3; k++)
            halve(c[k], c[(k + 1) % 3], h[k]);
        for (int k = 0; k < 3; k++)
            odd_add(m, c[k], h[k], h[(k + 2) % 3]);
        odd_add(m, h[0], h[1], h[2]);
    }
}

/* Triangles that cross each other, along one line or in one point. */
static void add_crossing(struct odd_maker *m)
{
    for (int i = 2 + odd_pick(m, 4), one_line = odd_pick(m, 2); i > 0; i--) {
        double p[3][3];
        if (!one_line) odd_axes(m);
        double turn = odd_between(m, 0.0, ODD_PI), c = cos(turn), s = sin(turn);
        for (int k = 0; k < 3; k++) {
            double angle = 2.0 / 3.0 * ODD_PI * k + odd_between(m, -0.5, 0.5), x = m->size_m * cos(angle);
            odd_point(m, c * x, s * x, m->size_m * sin(angle), p[k]);
        }
        m->label = (uint16_t)odd_pick(m, ODD_LABELS);
        odd_add(m, p[0], p[1], p[2]);
    }
}

static void add_layers(struct odd_maker *m)
{
    double gap = m->size_m * odd_decades(m, -3.0, 0.0);
    for (int i = 2 + odd_pick(m, 5); i > 0; i--) {
        double p[4][3];
        for (int k = 0; k < 4; k++)
            odd_point(m, k & 1 ? m->size_m : -m->size_m, k & 2 ? m->size_m : -m->size_m, gap * i, p[k]);
        m->label = (uint16_t)(i % ODD_LABELS);
        odd_add(m, p[0], p[1], p[3]);
        if (odd_pick(m, 2)) odd_add(m, p[0], p[3], p[2]);
    }
}

/* Pages of a book: triangles that share an edge, at angles from 1e-6 rad up. */
static void add_book(struct odd_maker *m)
{
    double a[3], b[3], c[3], turn = 0.0;
    odd_point(m, 0.0, 0.0, -m->size_m, a);
    odd_point(m, 0.0, 0.0, m->size_m, b);
    for (int i = 2 + odd_pick(m, 5); i > 0; i--) {
        double far = m->size_m * odd_between(m, 0.2, 1.0);
        odd_point(m, far * cos(turn), far * sin(turn), m->size_m * odd_between(m, -1.0, 1.0), c);
        m->label = (uint16_t)odd_pick(m, ODD_LABELS);
        odd_add(m, a, b, c);
        turn += odd_decades(m, -6.0, 0.5);
    }
}

/* Blades that share one corner and lie over each other at small angles. */
static void add_folded_corner(struct odd_maker *m)
{
    double a[3], b[3], c[3];
    odd_point(m, 0.0, 0.0, 0.0, a);
    for (int i = 2 + odd_pick(m, 4); i > 0; i--) {
        double raise = odd_sign(m) * odd_decades(m, -6.0, 0.3);
        for (int k = 0; k < 2; k++) {
            double angle = (k ? 1.0 : -1.0) * odd_between(m, 0.1, 1.0), far = m->size_m * odd_between(m, 0.3, 1.0);
            odd_point(m, far * cos(angle), far * sin(angle), raise * far * cos(angle), k ? c : b);
        }
        m->label = (uint16_t)odd_pick(m, ODD_LABELS);
        odd_add(m, a, b, c);
    }
}

/* Some of the triangles that are there stand twice. */
static void add_twins(struct odd_maker *m)
{
    const struct odd_scene *odd = m->odd;
    for (int i = 1 + odd_pick(m, 6); i > 0 && odd->n > 0; i--) {
        double p[3][3];
        memcpy(p, odd->corner[odd_pick(m, (int)odd->n)], sizeof p);
        m->label = (uint16_t)odd_pick(m, ODD_LABELS);
        odd_add(m, p[0], p[1], p[2]);
    }
}

/* A triangle of up to 1e6 m lies below, above or beside the station, with dwarfs of 1e-6 m and more upon it. */
static void add_giant(struct odd_maker *m)
{
    double p[3][3], size_m = odd_decades(m, 2.0, 6.0), to_m = odd_decades(m, -2.0, 2.0);
    for (int k = 0; k < 3; k++) {
        double angle = 2.0 / 3.0 * ODD_PI * k + odd_between(m, -0.5, 0.5);
        for (int j = 0; j < 3; j++)
            p[k][j] = to_m * m->axis[2][j] + size_m * (cos(angle) * m->axis[0][j] + sin(angle) * m->axis[1][j]);
    }
    odd_add(m, p[0], p[1], p[2]);
    for (int i = odd_pick(m, 4); i > 0; i--) {
        double r = odd_decades(m, -6.0, -2.0), x = to_m * odd_between(m, -1.0, 1.0),
               y = to_m * odd_between(m, -1.0, 1.0);
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < 3; j++)
                p[k][j] = (to_m - r * (k == 0)) * m->axis[2][j] + (x + r * (k == 1)) * m->axis[0][j] +
                          (y + r * (k == 2)) * m->axis[1][j];
        m->label = (uint16_t)odd_pick(m, ODD_LABELS);
        odd_add(m, p[0], p[1], p[2]);
    }
}

/* Small triangles near the station. */
static void add_near(struct odd_maker *m)
{
    for (int i = 1 + odd_pick(m, 4); i > 0; i--) {
        double far = odd_decades(m, -6.0, 0.0), p[3][3];
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < 3; j++)
                p[k][j] = far * (m->axis[2][j] + odd_between(m, -0.3, 0.3));
        m->label = (uint16_t)odd_pick(m, ODD_LABELS);
        odd_add(m, p[0], p[1], p[2]);
        odd_direction(m, m->axis[2]);
    }
}

/* Two halves meet along a line, in different cells: corners of one lie on edges of the other. */
static void add_junctions(struct odd_maker *m)
{
    for (int half = 0; half < 2; half++) {
        int n = 1 + odd_pick(m, 6);
        double far = half ? m->size_m : -m->size_m, raise = m->size_m * odd_sign(m) * odd_decades(m, -8.0, 0.0);
        for (int i = 0; i < n; i++) {
            double p[3][3];
            odd_point(m, 0.0, m->size_m * (2.0 * i / n - 1.0), 0.0, p[0]);
            odd_point(m, 0.0, m->size_m * (2.0 * (i + 1) / n - 1.0), 0.0, p[1]);
            odd_point(m, far, m->size_m * odd_between(m, -1.0, 1.0), raise, p[2]);
            odd_add(m, p[0], p[1], p[2]);
        }
    }
}

void odd_add_room(struct odd_maker *m)
{
    memset(m->centre, 0, sizeof m->centre);
    double half = odd_pick(m, 2) ? 128.0 : odd_decades(m, 1.0, 4.0);
    add_box(m, half, half, half);
}

void odd_add_behind(struct odd_maker *m)
{
    double p[3][3];
    m->label = 0;
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < 3; j++)
            p[k][j] = odd_between(m, -5.0, 5.0) + (j == k ? 150.0 : 0.0);
    odd_add(m, p[0], p[1], p[2]);
}

static const struct part {
    const char *name;
    void (*add)(struct odd_maker *m);
} PART[ODD_PARTS] = {
    {"needles", add_needles},
    {"slivers", add_slivers},
    {"random", add_random},
    {"stack", add_stack},
    {"sheets", add_sheets},
    {"fan", add_fan},
    {"strip", add_strip},
    {"boxes", add_boxes},
    {"ball", add_ball},
    {"crossing", add_crossing},
    {"layers", add_layers},
    {"book", add_book},
    {"corner", add_folded_corner},
    {"twins", add_twins},
    {"giant", add_giant},
    {"near", add_near},
    {"junctions", add_junctions},
    {"room", odd_add_room},
};

const char *odd_part_name(int part)
{
    return PART[part].name;
}

void odd_add_part(struct odd_maker *m)
{
    int kind = odd_pick(m, ODD_PARTS);
    double d[3], far_m = odd_pick(m, 6) == 0 ? 0.0 : odd_decades(m, -0.5, 2.0);
    odd_direction(m, d);
    for (int k = 0; k < 3; k++)
        m->centre[k] = far_m * d[k];
    m->size_m = (far_m > 0.0 ? far_m : 1.0) * odd_decades(m, -2.0, 0.5);
    m->label = (uint16_t)odd_pick(m, ODD_LABELS);
    odd_axes(m);
    PART[kind].add(m);
    m->odd->parts |= 1U << kind;
}
