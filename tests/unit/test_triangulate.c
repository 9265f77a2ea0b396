/* SPDX-License-Identifier: MIT */
/* Polygons become triangles that cover them once. */
#include <math.h>

#include "tests/unit/scene_files.h"

/* Computes the area by the shoelace formula. The triangles' own areas only add up to it when none overlaps or sticks
 * out. */
static void check_polygon(const double (*uv)[2], int n, bool at_utm)
{
    char *text = malloc((size_t)n * 128 + 64), *p = text;
    double area = 0, c = cos(0.4), s = sin(0.4);
    for (int i = 0; i < n; i++) {
        const double *a = uv[i], *b = uv[(i + 1) % n];
        area += (a[0] * b[1] - a[1] * b[0]) / 2;
        double shift = at_utm ? 5800000 : 0;
        p += sprintf(p, "v %.17g %.17g %.17g\n", a[0] * c + shift, a[1] + shift, a[0] * s);
    }
    p += sprintf(p, "f");
    for (int i = 0; i < n; i++)
        p += sprintf(p, " %d", i + 1);
    struct scene *scene = load_text("polygon.obj", text);
    free(text);
    assert_int_equal(scene->n_triangles + scene->counts.zero_area, n - 2);
    assert_null(strstr(warnings, "cross"));
    /* Coordinates are rounded to ulp(5.8e6) / 2 = 4.7e-10, along a boundary shorter than 200. */
    double tolerance = at_utm ? 200 * 4.7e-10 * 2 : 1e-12 * fabs(area);
    if (fabs(total_area(scene) - fabs(area)) > tolerance)
        fail_msg("%d corners: area %.15g, not %.15g", n, total_area(scene), area);
    scene_free(scene);
}

static void polygons_keep_their_area(void **state)
{
    (void)state;
    static const double l_shape[][2] = {{0, 0}, {4, 0}, {4, 1}, {1, 1}, {1, 3}, {0, 3}};
    static const double dart[][2] = {{0, 0}, {3, -2}, {1, 0}, {3, 2}};
    static const double on_edges[][2] = {{0, 0}, {1, 0}, {2, 0}, {3, 0}, {3, 3}, {1.5, 3}, {0, 3}, {0, 1}};
    static const double comb[][2] = {{0, 0}, {9, 0}, {9, 5}, {8, 1}, {7, 5}, {6, 1},
                                     {5, 5}, {4, 1}, {3, 5}, {2, 1}, {1, 5}, {0.5, 1}};
    static const double keyhole[][2] = {{0, 0}, {1, 1}, {1, 2}, {2, 2}, {2, 1}, {1, 1}, {0, 0}, {3, 0}, {3, 3}, {0, 3}};
    static const double repeated[][2] = {{0, 0}, {2, 0}, {2, 0}, {2, 2}, {1, 1}, {0, 2}, {0, 2}};
    /* A triangle of 1 m2 with a spike at two corners, (0, 1) and (1, 3). Both have no area, and each blocks an ear. */
    static const double spikes[][2] = {{1, 1}, {0, 1}, {3, 1}, {1, 2}, {1, 3}};
    for (int at_utm = 0; at_utm < 2; at_utm++) {
        check_polygon(spikes, 5, at_utm);
        check_polygon(l_shape, 6, at_utm);
        check_polygon(dart, 4, at_utm);
        check_polygon(on_edges, 8, at_utm);
        check_polygon(comb, 12, at_utm);
        check_polygon(keyhole, 10, at_utm);
        check_polygon(repeated, 7, at_utm);
    }
    double star[500][2];
    srand(3);
    for (int turn = 0; turn < 20; turn++) {
        int n = 5 + rand() % 495;
        for (int i = 0; i < n; i++) { /* star-shaped about the origin, so it can't cross itself */
            double r = 0.05 + rand() / (double)RAND_MAX, angle = 2 * M_PI * i / n * (turn % 2 ? 1 : -1);
            star[i][0] = r * cos(angle);
            star[i][1] = r * sin(angle);
        }
        check_polygon((const double(*)[2])star, n, false);
    }
}

/* A square with a square hole that a slit joins to its corner: both ends of the slit are twice among the corners. It is
 * begun at each corner, and laid in each of eight ways. */
static void keyholes_keep_their_area(void **state)
{
    (void)state;
    static const double keyhole[10][2] = {{0, 0}, {1, 1}, {1, 2}, {2, 2}, {2, 1},
                                          {1, 1}, {0, 0}, {3, 0}, {3, 3}, {0, 3}};
    for (int first = 0; first < 10; first++)
        for (int way = 0; way < 8; way++) {
            double uv[10][2];
            for (int i = 0; i < 10; i++)
                for (int k = 0; k < 2; k++) {
                    const double at = keyhole[(first + i) % 10][way & 4 ? 1 - k : k];
                    uv[i][k] = way >> k & 1 ? 3 - at : at;
                }
            check_polygon((const double(*)[2])uv, 10, false);
        }
}

static void crossing_polygon_is_told(void **state)
{
    (void)state;
    struct scene *s = load_text("bow.obj", "v 0 0 0\nv 2 2 0\nv 2 0 0\nv 0 3 0\nf 1 2 3 4\n");
    assert_int_equal(s->n_triangles, 2);
    assert_int_equal(n_warnings, 1);
    assert_non_null(strstr(warnings, "bow.obj: the outlines of 1 polygons cross themselves"));
    scene_free(s);
    /* The first and the fourth edge cross at (1, 2). One corner that is cut off is no ear, and the last triangle turns
     * left. So this corner alone shows the crossing. */
    s = load_text("star.obj", "v 2 1 0\nv 0 3 0\nv 3 1 0\nv 0 1 0\nv 2 3 0\nv 2 0 0\nv 1 2 0\nv 1 1 0\n"
                              "f 1 2 3 4 5 6 7 8\n");
    assert_non_null(strstr(warnings, "star.obj: the outlines of 1 polygons cross themselves"));
    scene_free(s);
}

/* Twice a triangle of 1 m2, once turning left and once right: the normal adds up to 0, or to what rounding leaves of
 * it. Both triangles that are made of it lie in the plane of the corners. They have 2 m2 each, as any of three corners
 * of a square have. */
static void bow_ties_without_area_are_told(void **state)
{
    (void)state;
    static const double square[4][2] = {{0, 0}, {2, 0}, {0, 2}, {2, 2}};
    for (int axis = 0; axis < 3; axis++)
        for (int digits = 3; digits < 18; digits++) {
            char text[512], *p = text;
            for (int i = 0; i < 4; i++) {
                double at[3] = {0, 0, 0};
                at[axis] = square[i][0] * cos(0.4);
                at[(axis + 1) % 3] = square[i][1];
                at[(axis + 2) % 3] = square[i][0] * sin(0.4);
                p += sprintf(p, "v %.*f %.*f %.*f\n", digits, at[0], digits, at[1], digits, at[2]);
            }
            sprintf(p, "f 1 2 3 4\n");
            struct scene *s = load_text("bow.obj", text);
            assert_int_equal(s->n_triangles, 2);
            if (strstr(warnings, "bow.obj: the outlines of 1 polygons cross themselves") == NULL)
                fail_msg("axis %d, %d digits: %s", axis, digits, warnings);
            if (!(fabs(total_area(s) - 4) < 0.01)) fail_msg("axis %d, %d digits: %g", axis, digits, total_area(s));
            scene_free(s);
        }
}

/* Turns a vector about the unit axis of its three numbers (Rodrigues' formula). */
static void turn_about(const double axis[3], double angle, double at[3])
{
    const double along = axis[0] * at[0] + axis[1] * at[1] + axis[2] * at[2];
    double to[3];
    for (int k = 0; k < 3; k++) {
        const int l = (k + 1) % 3, m = (k + 2) % 3;
        to[k] = at[k] * cos(angle) + (axis[l] * at[m] - axis[m] * at[l]) * sin(angle) +
                axis[k] * along * (1.0 - cos(angle));
    }
    memcpy(at, to, sizeof to);
}

/* Corners of 0.3 m by 0.3 m lie in a floor that is level but for a few steps of the last decimal: the normal that is
 * left is rounding, and may point along the floor. Each of the two triangles has half the square. Each corner is off by
 * up to sqrt(3) / 2 of the last decimal, and a triangle's area by no more than that times half of its sides, 0.51 m: in
 * both, 0.9 mm x 1 m at 1 mm. */
static void bow_ties_of_a_few_decimals_are_told(void **state)
{
    (void)state;
    static const double square[4][2] = {{0, 0}, {0.3, 0}, {0, 0.3}, {0.3, 0.3}};
    srand(11);
    for (int turn = 0; turn < 200; turn++) {
        char text[512], *p = text;
        const int digits = turn % 2 == 0 ? 3 : 6;
        const double up = 2.0 * rand() / RAND_MAX - 1.0, east = 2.0 * M_PI * rand() / RAND_MAX;
        const double axis[3] = {sqrt(1.0 - up * up) * cos(east), sqrt(1.0 - up * up) * sin(east), up};
        const double angle = 2.0 * M_PI * rand() / RAND_MAX, off_m = pow(10.0, -digits);
        for (int i = 0; i < 4; i++) {
            double at[3] = {square[i][0], square[i][1], 0};
            turn_about((const double[3]){0, 0, 1}, angle, at);
            turn_about(axis, 20 * off_m, at);
            p += sprintf(p, "v %.*f %.*f %.*f\n", digits, at[0] + 1.234567, digits, at[1] + 1.234567, digits,
                         at[2] + 1.234567);
        }
        sprintf(p, "f 1 2 3 4\n");
        struct scene *s = load_text("bow.obj", text);
        if (strstr(warnings, "bow.obj: the outlines of 1 polygons cross themselves") == NULL)
            fail_msg("%d, %d digits: %s", turn, digits, warnings);
        if (!(fabs(total_area(s) - 0.09) < 0.9 * off_m)) fail_msg("%d, %d digits: %g", turn, digits, total_area(s));
        scene_free(s);
    }
}

static void corners_have_a_limit(void **state)
{
    (void)state;
    enum { CORNERS = 65537 };
    char *text = malloc(CORNERS * 48), *p = text;
    for (int i = 0; i < CORNERS; i++)
        p += sprintf(p, "v %d %d 0\n", i, i * (i % 7));
    p += sprintf(p, "f");
    for (int i = 0; i < CORNERS; i++)
        p += sprintf(p, " %d", i + 1);
    refuse("corners.obj", text, (size_t)(p - text), "a polygon has 65537 corners; allowed are up to 65536");
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(polygons_keep_their_area),
        cmocka_unit_test(keyholes_keep_their_area),
        cmocka_unit_test(crossing_polygon_is_told),
        cmocka_unit_test(bow_ties_without_area_are_told),
        cmocka_unit_test(bow_ties_of_a_few_decimals_are_told),
        cmocka_unit_test(corners_have_a_limit),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
