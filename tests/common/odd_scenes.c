#include "tests/common/odd_scenes.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/rng.h"
#include "core/vec3.h"
#include "tests/common/cases.h"

#define PI 3.14159265358979323846

/* Where a part goes: a point, three axes, a size; and the numbers it is made of. */
struct maker {
    struct odd_scene *odd;
    uint32_t at_most;
    uint64_t random;
    double centre[3], axis[3][3], size_m;
    uint16_t label;
};

/* ---- numbers */

static double unit(struct maker *m)
{
    return case_unit(&m->random);
}

static double between(struct maker *m, double lo, double hi)
{
    return lo + (hi - lo) * unit(m);
}

/* Evenly among the powers of ten. */
static double decades(struct maker *m, double lo, double hi)
{
    return pow(10.0, between(m, lo, hi));
}

static int pick(struct maker *m, int n)
{
    return (int)case_between(&m->random, 0, n - 1);
}

static double sign(struct maker *m)
{
    return pick(m, 2) ? 1.0 : -1.0;
}

static void direction(struct maker *m, double d[3])
{
    double z = between(m, -1.0, 1.0), turn = between(m, 0.0, 2.0 * PI), r = sqrt(1.0 - z * z);
    d[0] = r * cos(turn);
    d[1] = r * sin(turn);
    d[2] = z;
}

/* Three axes at right angles: one time in three those of the frame, in any order. */
static void axes(struct maker *m)
{
    if (pick(m, 3) == 0) {
        int first = pick(m, 3);
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                m->axis[i][k] = (first + i) % 3 == k ? 1.0 : 0.0;
        return;
    }
    double other[3];
    direction(m, m->axis[0]);
    direction(m, other);
    vec3_cross(m->axis[0], other, m->axis[1]);
    double length = vec3_length(m->axis[1]);
    for (int k = 0; k < 3; k++)
        m->axis[1][k] /= length;
    vec3_cross(m->axis[0], m->axis[1], m->axis[2]);
}

static void point(const struct maker *m, double x, double y, double z, double p[3])
{
    for (int k = 0; k < 3; k++)
        p[k] = m->centre[k] + x * m->axis[0][k] + y * m->axis[1][k] + z * m->axis[2][k];
}

/* Its corners in any order. */
static void add(struct maker *m, const double a[3], const double b[3], const double c[3])
{
    struct odd_scene *odd = m->odd;
    const double *const corner[3] = {a, b, c};
    if (odd->n >= m->at_most) return;
    int first = pick(m, 3), step = 1 + pick(m, 2);
    for (int i = 0; i < 3; i++)
        memcpy(odd->corner[odd->n][i], corner[(first + i * step) % 3], sizeof odd->corner[0][0]);
    odd->label[odd->n++] = m->label;
}

/* ---- parts: in units of their size, about their centre */

static void add_needles(struct maker *m)
{
    for (int i = 1 + pick(m, 5); i > 0; i--) {
        double a[3], b[3], c[3], half = 0.5 * m->size_m, high = m->size_m * decades(m, -6.0, -1.0);
        axes(m);
        point(m, -half, 0.0, 0.0, a);
        point(m, half, 0.0, 0.0, b);
        point(m, half * (pick(m, 3) ? between(m, -1.0, 1.0) : -1.0), high, 0.0, c);
        add(m, a, b, c);
    }
}

/* The third corner almost, or but for rounding, on the line of the others. */
static void add_slivers(struct maker *m)
{
    for (int i = 1 + pick(m, 5); i > 0; i--) {
        double a[3], b[3], c[3], at = between(m, -0.5, 1.5), off = pick(m, 2) ? decades(m, -13.0, -5.0) : 0.0;
        axes(m);
        point(m, -m->size_m, 0.0, 0.0, a);
        point(m, m->size_m, 0.0, 0.0, b);
        point(m, m->size_m * at, m->size_m * off, 0.0, c);
        add(m, a, b, c);
    }
}

static void add_random(struct maker *m)
{
    for (int i = 1 + pick(m, 8); i > 0; i--) {
        double p[3][3];
        for (int k = 0; k < 3; k++)
            point(m, m->size_m * between(m, -1.0, 1.0), m->size_m * between(m, -1.0, 1.0),
                  m->size_m * between(m, -1.0, 1.0), p[k]);
        add(m, p[0], p[1], p[2]);
    }
}

/* One face and others above it, by next to nothing or nothing at all: the same corners, or shifted in the
 * plane. */
static void add_stack(struct maker *m)
{
    double x[3], y[3];
    for (int k = 0; k < 3; k++) {
        x[k] = m->size_m * between(m, -1.0, 1.0);
        y[k] = m->size_m * between(m, -1.0, 1.0);
    }
    for (int i = 2 + pick(m, 6); i > 0; i--) {
        double p[3][3], off = pick(m, 3) ? sign(m) * decades(m, -12.0, -3.0) : 0.0;
        double dx = pick(m, 2) ? m->size_m * between(m, -0.5, 0.5) : 0.0,
               scale = pick(m, 2) ? decades(m, -1.0, 0.3) : 1.0;
        for (int k = 0; k < 3; k++)
            point(m, dx + scale * x[k], scale * y[k], off, p[k]);
        m->label = (uint16_t)pick(m, ODD_LABELS);
        add(m, p[0], p[1], p[2]);
    }
}

/* A square in cells of two triangles, and again in other cells, in the same plane or next to it. */
static void add_sheets(struct maker *m)
{
    for (int sheet = 1 + pick(m, 3); sheet > 0; sheet--) {
        int nx = 1 + pick(m, 4), ny = 1 + pick(m, 4);
        double off = pick(m, 3) == 0 ? sign(m) * decades(m, -12.0, -3.0) : 0.0;
        m->label = (uint16_t)pick(m, ODD_LABELS);
        for (int j = 0; j < ny; j++)
            for (int i = 0; i < nx; i++) {
                double p[4][3];
                for (int k = 0; k < 4; k++)
                    point(m, m->size_m * (2.0 * (i + (k & 1)) / nx - 1.0), m->size_m * (2.0 * (j + k / 2) / ny - 1.0),
                          off, p[k]);
                add(m, p[0], p[1], p[3]);
                add(m, p[0], p[3], p[2]);
            }
    }
}

/* Blades about one corner, level or raised by a little or a lot; closed or open. */
static void add_fan(struct maker *m)
{
    int n = 3 + pick(m, 10);
    double middle[3], first[3], last[3], rim[3], raise = m->size_m * decades(m, -6.0, 0.0);
    double turn = pick(m, 2) ? 2.0 * PI : between(m, 0.1, 7.0);
    point(m, 0.0, 0.0, 0.0, middle);
    for (int i = 0; i <= n; i++) {
        double angle = turn * i / n, far = m->size_m * between(m, 0.3, 1.0);
        point(m, far * cos(angle), far * sin(angle), raise * between(m, -1.0, 1.0), rim);
        if (i == 0) memcpy(first, rim, sizeof first);
        if (i == n && turn == 2.0 * PI) memcpy(rim, first, sizeof rim);
        if (i > 0) add(m, middle, last, rim);
        memcpy(last, rim, sizeof last);
    }
}

/* Triangles side by side, folded each time by an angle between next to nothing and right back. */
static void add_strip(struct maker *m)
{
    double p[3][3], along[2] = {1.0, 0.0}, at[2] = {0.0, 0.0}, step = 0.5 * m->size_m;
    double fold = pick(m, 2) ? decades(m, -6.0, 0.0) * PI : PI - decades(m, -6.0, 0.0) * PI;
    for (int i = 0, n = 3 + pick(m, 9); i < n; i++) {
        for (int k = 0; k < 2 && i > 0; k++)
            memcpy(p[k], p[k + 1], sizeof p[k]);
        point(m, at[0], (i & 1 ? 0.5 : -0.5) * m->size_m, at[1], p[i < 2 ? i : 2]);
        if (i >= 2) add(m, p[0], p[1], p[2]);
        at[0] += step * along[0];
        at[1] += step * along[1];
        double angle = sign(m) * fold, c = cos(angle), s = sin(angle), x = along[0];
        along[0] = c * x - s * along[1];
        along[1] = s * x + c * along[1];
    }
}

static void add_box(struct maker *m, double half_x, double half_y, double half_z)
{
    static const int side[6][4] = {{0, 1, 3, 2}, {4, 6, 7, 5}, {0, 4, 5, 1}, {2, 3, 7, 6}, {0, 2, 6, 4}, {1, 5, 7, 3}};
    double p[8][3];
    for (int i = 0; i < 8; i++)
        point(m, i & 1 ? half_x : -half_x, i & 2 ? half_y : -half_y, i & 4 ? half_z : -half_z, p[i]);
    for (int i = 0; i < 6; i++) {
        add(m, p[side[i][0]], p[side[i][1]], p[side[i][2]]);
        add(m, p[side[i][0]], p[side[i][2]], p[side[i][3]]);
    }
}

static void add_boxes(struct maker *m)
{
    double x = m->size_m, y = m->size_m * between(m, 0.1, 1.0), z = m->size_m * between(m, 0.1, 1.0);
    for (int i = 1 + pick(m, 3); i > 0; i--) {
        m->label = (uint16_t)i;
        add_box(m, x, y, z);
        double gap = pick(m, 4) ? decades(m, -12.0, -0.5) : 0.0;
        x += gap;
        y += pick(m, 4) ? gap : 0.0;
        z += pick(m, 4) ? gap : 0.0;
    }
}

static void halve(const double a[3], const double b[3], double out[3])
{
    for (int k = 0; k < 3; k++)
        out[k] = 0.5 * a[k] + 0.5 * b[k];
}

/* An octahedron, each side cut in four. */
static void add_ball(struct maker *m)
{
    double p[6][3], h[3][3];
    for (int i = 0; i < 6; i++) {
        double r = (i & 1 ? -1.0 : 1.0) * m->size_m * between(m, 0.7, 1.0);
        point(m, i / 2 == 0 ? r : 0.0, i / 2 == 1 ? r : 0.0, i / 2 == 2 ? r : 0.0, p[i]);
    }
    for (int i = 0; i < 8; i++) {
        const double *c[3] = {p[i & 1], p[2 + (i >> 1 & 1)], p[4 + (i >> 2)]};
        for (int k = 0; k < 3; k++)
            halve(c[k], c[(k + 1) % 3], h[k]);
        for (int k = 0; k < 3; k++)
            add(m, c[k], h[k], h[(k + 2) % 3]);
        add(m, h[0], h[1], h[2]);
    }
}

/* Through each other, along one line or in one point. */
static void add_crossing(struct maker *m)
{
    for (int i = 2 + pick(m, 4), one_line = pick(m, 2); i > 0; i--) {
        double p[3][3];
        if (!one_line) axes(m);
        double turn = between(m, 0.0, PI), c = cos(turn), s = sin(turn);
        for (int k = 0; k < 3; k++) {
            double angle = 2.0 / 3.0 * PI * k + between(m, -0.5, 0.5), x = m->size_m * cos(angle);
            point(m, c * x, s * x, m->size_m * sin(angle), p[k]);
        }
        m->label = (uint16_t)pick(m, ODD_LABELS);
        add(m, p[0], p[1], p[2]);
    }
}

static void add_layers(struct maker *m)
{
    double gap = m->size_m * decades(m, -3.0, 0.0);
    for (int i = 2 + pick(m, 5); i > 0; i--) {
        double p[4][3];
        for (int k = 0; k < 4; k++)
            point(m, k & 1 ? m->size_m : -m->size_m, k & 2 ? m->size_m : -m->size_m, gap * i, p[k]);
        m->label = (uint16_t)(i % ODD_LABELS);
        add(m, p[0], p[1], p[3]);
        if (pick(m, 2)) add(m, p[0], p[3], p[2]);
    }
}

/* Pages of a book: triangles that share an edge, at angles from 1e-6 rad up. */
static void add_book(struct maker *m)
{
    double a[3], b[3], c[3], turn = 0.0;
    point(m, 0.0, 0.0, -m->size_m, a);
    point(m, 0.0, 0.0, m->size_m, b);
    for (int i = 2 + pick(m, 5); i > 0; i--) {
        double far = m->size_m * between(m, 0.2, 1.0);
        point(m, far * cos(turn), far * sin(turn), m->size_m * between(m, -1.0, 1.0), c);
        m->label = (uint16_t)pick(m, ODD_LABELS);
        add(m, a, b, c);
        turn += decades(m, -6.0, 0.5);
    }
}

/* Blades that share one corner and lie over each other at small angles. */
static void add_folded_corner(struct maker *m)
{
    double a[3], b[3], c[3];
    point(m, 0.0, 0.0, 0.0, a);
    for (int i = 2 + pick(m, 4); i > 0; i--) {
        double raise = sign(m) * decades(m, -6.0, 0.3);
        for (int k = 0; k < 2; k++) {
            double angle = (k ? 1.0 : -1.0) * between(m, 0.1, 1.0), far = m->size_m * between(m, 0.3, 1.0);
            point(m, far * cos(angle), far * sin(angle), raise * far * cos(angle), k ? c : b);
        }
        m->label = (uint16_t)pick(m, ODD_LABELS);
        add(m, a, b, c);
    }
}

/* Of those that are there, some once more. */
static void add_twins(struct maker *m)
{
    const struct odd_scene *odd = m->odd;
    for (int i = 1 + pick(m, 6); i > 0 && odd->n > 0; i--) {
        double p[3][3];
        memcpy(p, odd->corner[pick(m, (int)odd->n)], sizeof p);
        m->label = (uint16_t)pick(m, ODD_LABELS);
        add(m, p[0], p[1], p[2]);
    }
}

/* Up to 1e6 m, below, above or beside the station; with dwarfs of 1e-6 m and more upon it. */
static void add_giant(struct maker *m)
{
    double p[3][3], size_m = decades(m, 2.0, 6.0), to_m = decades(m, -2.0, 2.0);
    for (int k = 0; k < 3; k++) {
        double angle = 2.0 / 3.0 * PI * k + between(m, -0.5, 0.5);
        for (int j = 0; j < 3; j++)
            p[k][j] = to_m * m->axis[2][j] + size_m * (cos(angle) * m->axis[0][j] + sin(angle) * m->axis[1][j]);
    }
    add(m, p[0], p[1], p[2]);
    for (int i = pick(m, 4); i > 0; i--) {
        double r = decades(m, -6.0, -2.0), x = to_m * between(m, -1.0, 1.0), y = to_m * between(m, -1.0, 1.0);
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < 3; j++)
                p[k][j] = (to_m - r * (k == 0)) * m->axis[2][j] + (x + r * (k == 1)) * m->axis[0][j] +
                          (y + r * (k == 2)) * m->axis[1][j];
        m->label = (uint16_t)pick(m, ODD_LABELS);
        add(m, p[0], p[1], p[2]);
    }
}

/* Small ones, near the station. */
static void add_near(struct maker *m)
{
    for (int i = 1 + pick(m, 4); i > 0; i--) {
        double far = decades(m, -6.0, 0.0), p[3][3];
        for (int k = 0; k < 3; k++)
            for (int j = 0; j < 3; j++)
                p[k][j] = far * (m->axis[2][j] + between(m, -0.3, 0.3));
        m->label = (uint16_t)pick(m, ODD_LABELS);
        add(m, p[0], p[1], p[2]);
        direction(m, m->axis[2]);
    }
}

/* Halves that meet along a line, in other cells each: corners of one on edges of the other. */
static void add_junctions(struct maker *m)
{
    for (int half = 0; half < 2; half++) {
        int n = 1 + pick(m, 6);
        double far = half ? m->size_m : -m->size_m, raise = m->size_m * sign(m) * decades(m, -8.0, 0.0);
        for (int i = 0; i < n; i++) {
            double p[3][3];
            point(m, 0.0, m->size_m * (2.0 * i / n - 1.0), 0.0, p[0]);
            point(m, 0.0, m->size_m * (2.0 * (i + 1) / n - 1.0), 0.0, p[1]);
            point(m, far, m->size_m * between(m, -1.0, 1.0), raise, p[2]);
            add(m, p[0], p[1], p[2]);
        }
    }
}

/* Around everything. */
static void add_room(struct maker *m)
{
    memset(m->centre, 0, sizeof m->centre);
    double half = pick(m, 2) ? 128.0 : decades(m, 1.0, 4.0);
    add_box(m, half, half, half);
}

/* One without trouble, so that no scene is empty. */
static void add_behind(struct maker *m)
{
    double p[3][3];
    m->label = 0;
    for (int k = 0; k < 3; k++)
        for (int j = 0; j < 3; j++)
            p[k][j] = between(m, -5.0, 5.0) + (j == k ? 150.0 : 0.0);
    add(m, p[0], p[1], p[2]);
}

static const struct part {
    const char *name;
    void (*add)(struct maker *m);
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
    {"room", add_room},
};

const char *odd_part_name(int part)
{
    return PART[part].name;
}

static void add_part(struct maker *m)
{
    int kind = pick(m, ODD_PARTS);
    double d[3], far_m = pick(m, 6) == 0 ? 0.0 : decades(m, -0.5, 2.0);
    direction(m, d);
    for (int k = 0; k < 3; k++)
        m->centre[k] = far_m * d[k];
    m->size_m = (far_m > 0.0 ? far_m : 1.0) * decades(m, -2.0, 0.5);
    m->label = (uint16_t)pick(m, ODD_LABELS);
    axes(m);
    PART[kind].add(m);
    m->odd->parts |= 1U << kind;
}

/* ---- places */

/* Onto a grid of powers of two: much then lies in one plane, or on one line, exactly. */
static void snap(struct odd_scene *odd, double grid_m)
{
    double *x = odd->corner[0][0];
    for (uint32_t i = 0; i < 9 * odd->n; i++)
        x[i] = grid_m * floor(x[i] / grid_m + 0.5);
}

static void shift(struct odd_scene *odd, const double by_m[3])
{
    for (uint32_t i = 0; i < 3 * odd->n; i++)
        for (int k = 0; k < 3; k++)
            odd->corner[i / 3][i % 3][k] += by_m[k];
}

/* The station relative to a triangle: on it, beside its edge, in its plane, at a corner. */
static void stand(struct maker *m)
{
    struct odd_scene *odd = m->odd;
    const int t = pick(m, (int)odd->n);
    const double *a = odd->corner[t][0], *b = odd->corner[t][1], *c = odd->corner[t][2];
    double e[3], f[3], n[3], off_m = 0.0, x = between(m, 0.1, 0.5), y = between(m, 0.1, 0.5);
    const char *where = "on a face";
    switch (pick(m, 6)) {
    case 0:
        break;
    case 1:
        off_m = sign(m) * decades(m, -9.0, -6.3);
        where = "close to a face";
        break;
    case 2:
        x = pick(m, 2) ? -1.0 : 2.0;
        y = 0.0;
        where = "on an edge's line";
        break;
    case 3:
        x = between(m, -3.0, 3.0);
        y = pick(m, 2) ? 2.0 : -1.0;
        where = "in a plane";
        break;
    case 4:
        x = y = 0.0;
        where = "at a corner";
        break;
    default:
        off_m = sign(m) * decades(m, -6.3, -2.0);
        where = "near a face";
    }
    vec3_sub(b, a, e);
    vec3_sub(c, a, f);
    vec3_cross(e, f, n);
    double length = vec3_length(n);
    for (int k = 0; k < 3; k++)
        odd->station_m[k] = a[k] + x * e[k] + y * f[k] + (length > 0.0 ? off_m * n[k] / length : 0.0);
    snprintf(odd->stands, sizeof odd->stands, "%s", where);
}

void odd_scene_make(uint64_t number, uint32_t at_most, struct odd_scene *out)
{
    static const double UTM_M[3] = {500000.0, 5800000.0, 100.0};
    struct maker m = {.odd = out, .at_most = at_most < ODD_MOST ? at_most : ODD_MOST, .random = rng_mix(number + 1)};
    double by_m[3] = {0.0, 0.0, 0.0};
    out->n = out->parts = 0;
    add_behind(&m);
    if (pick(&m, 4) == 0) {
        add_room(&m);
        out->parts |= 1U << (ODD_PARTS - 1);
    }
    for (int i = 1 + pick(&m, 5); i > 0; i--)
        add_part(&m);
    if (pick(&m, 4) == 0) snap(out, pow(2.0, between(&m, -20.0, -3.0) > -10.0 ? -4.0 : -14.0));
    int place = pick(&m, 4);
    for (int k = 0; k < 3; k++)
        by_m[k] = place == 0 ? 0.0 : place == 1 ? between(&m, -1000.0, 1000.0) : UTM_M[k] + (place == 2) * unit(&m);
    shift(out, by_m);
    memcpy(out->station_m, by_m, sizeof by_m);
    snprintf(out->stands, sizeof out->stands, "in the middle");
    if (pick(&m, 4) == 0) stand(&m);
}

int odd_scene_build(const struct odd_scene *odd, int weld, struct scene **out, struct sh_err *err)
{
    static const struct scene_surface surface[ODD_LABELS] = {{.object = ""}};
    double vertex[3 * ODD_MOST][3];
    uint32_t triangle[ODD_MOST][3], n = 0;
    for (uint32_t i = 0; i < 3 * odd->n; i++) {
        const double *p = odd->corner[i / 3][i % 3];
        uint32_t at = weld ? 0 : n;
        while (at < n && memcmp(vertex[at], p, sizeof vertex[at]) != 0)
            at++;
        if (at == n) memcpy(vertex[n++], p, sizeof vertex[at]);
        triangle[i / 3][i % 3] = at;
    }
    return scene_from_arrays(&(struct scene_arrays){(const double(*)[3])vertex, n, (const uint32_t(*)[3])triangle,
                                                    odd->n, odd->label, surface, ODD_LABELS},
                             out, err);
}
