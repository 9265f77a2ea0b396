/* SPDX-License-Identifier: MIT */
/* Textures of grids: where each colour is drawn, and the coordinates of faces that close a turn or meet at a pole. What
 * is expected follows from the grid: a point is in the middle of its texel, and a face is nowhere wider than its own
 * cell. */
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <setjmp.h>
#include <cmocka.h>

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "drivers/host/scanhead.h"
#include "drivers/record/mesh_texture.h"

enum { OTHERS = 100, RINGS = 5, STEPS = 8, N = 2 + 3 * STEPS };

static struct mesh_grid grid;
static struct mesh_points points;
static struct picture image;
static uint32_t row[64], line[64], every;
static struct sh_err err;

/* Each point has a place and a colour of its own. */
static void add(uint32_t at_line, uint32_t at_row)
{
    const uint32_t i = grid.n++;
    const struct mesh_point p = {.xyz_m = {i, 0, 0}, .range_m = 1, .rgb = {(uint8_t)(i + 1), 2, 3}};
    line[i] = at_line;
    row[i] = at_row;
    assert_int_equal(mesh_points_add(&points, &p, &err), SH_OK);
}

/* Points of another station stand before those of the grid. */
static int set_up(void **state)
{
    (void)state;
    const struct mesh_point other = {.uv = {9, 9}};
    points = (struct mesh_points){0};
    grid = (struct mesh_grid){.row = row, .line = line, .first = OTHERS};
    for (int i = 0; i < OTHERS; i++)
        assert_int_equal(mesh_points_add(&points, &other, &err), SH_OK);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    mesh_points_free(&points);
    picture_free(&image);
    return 0;
}

static void draw(uint32_t width, uint32_t height)
{
    if (mesh_texture_draw(&grid, &points, &image, &every, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(every, 1);
    assert_int_equal(image.width, width);
    assert_int_equal(image.height, height);
}

/* Returns the label in the colour; rows go up. */
static int texel(uint32_t column, uint32_t at_row)
{
    return image.rgb[3 * ((image.height - 1 - at_row) * image.width + column)];
}

static void expect_uv(uint32_t point, double u, double v)
{
    const float *uv = points.uv[point];
    if (fabs((double)uv[0] - u) > 1e-6 || fabs((double)uv[1] - v) > 1e-6) /* floats of about 1 */
        fail_msg("point %u is at %g, %g, not at %g, %g", point, (double)uv[0], (double)uv[1], u, v);
}

/* Returns the point of a ring; the poles have one. Lines begin at 5 and rows at 0. */
static uint32_t at(uint32_t ring, uint32_t step)
{
    return OTHERS + (ring == 0 ? 0 : ring == RINGS - 1 ? N - 1 : 1 + (ring - 1) * STEPS + step % STEPS);
}

static void make_sphere(void)
{
    grid.kind = SCANHEAD_EMIT_SPHERE;
    grid.rings = RINGS;
    grid.first_ring_deg = 90;
    grid.ring_step_deg = -45;
    grid.rows_per_turn = STEPS;
    grid.line_min = RINGS;
    grid.line_max = 2 * RINGS - 1;
    grid.row_max = STEPS - 1;
    for (uint32_t ring = 0; ring < RINGS; ring++)
        for (uint32_t step = 0; step < (ring % (RINGS - 1) == 0 ? 1 : STEPS); step++)
            add(RINGS + ring, step);
    assert_int_equal(grid.n, N);
    draw(RINGS, STEPS);
}

static void colours_are_at_their_places(void **state)
{
    (void)state;
    make_sphere();
    for (uint32_t ring = 0; ring < RINGS; ring++)
        for (uint32_t step = 0; step < STEPS; step++) /* a pole fills its column */
            assert_int_equal(texel(ring, step), at(ring, step) - OTHERS + 1);
    for (uint32_t i = 0; i < OTHERS; i++)
        expect_uv(i, 9, 9);
    for (uint32_t i = 0; i < N; i++)
        expect_uv(OTHERS + i, (line[i] - RINGS + 0.5) / RINGS, (row[i] + 0.5) / STEPS);
}

/* At one pole the face that crosses the seam comes last, at the other one first. */
static uint32_t step_of(uint32_t pole, uint32_t i)
{
    return pole == 0 ? i : STEPS - 1 - i;
}

/* Faces at both poles; one of half a turn, which does not cross the seam; and one of a step more, which does. */
static void a_sphere_is_unwrapped(void **state)
{
    (void)state;
    uint32_t face[2 * STEPS + 2][3], n = 0;
    make_sphere();
    for (uint32_t pole = 0; pole < 2; pole++)
        for (uint32_t place = 0; place < STEPS; place++, n++) {
            const uint32_t k = step_of(pole, place);
            const uint32_t ring = pole == 0 ? 1 : RINGS - 2,
                           corner[3] = {at(pole * (RINGS - 1), 0), at(ring, k), at(ring, k + 1)};
            for (uint32_t i = 0; i < 3; i++) /* the pole is each corner in turn */
                face[n][(i + k) % 3] = corner[i];
        }
    const uint32_t far[2][3] = {{at(1, 0), at(1, STEPS / 2), at(2, 0)},
                                {at(1, 0), at(1, STEPS / 2 + 1), at(2, STEPS / 2 + 1)}};
    memcpy(face[n], far, sizeof far);
    if (mesh_texture_unwrap(&grid, &points, face, n + 2, &err) != SH_OK) fail_msg("%s", err.text);
    for (uint32_t i = 0; i < n; i++) {
        const uint32_t pole = i / STEPS, k = step_of(pole, i % STEPS), p = face[i][k % 3], a = face[i][(k + 1) % 3],
                       b = face[i][(k + 2) % 3];
        const double pole_u = pole == 0 ? 0.5 / RINGS : (RINGS - 0.5) / RINGS;
        const double ring_u = pole == 0 ? 1.5 / RINGS : (RINGS - 1.5) / RINGS;
        expect_uv(p, pole_u, (k + 1.0) / STEPS);
        expect_uv(a, ring_u, (k + 0.5) / STEPS);
        expect_uv(b, ring_u, (k + 1.5) / STEPS);
        assert_true(points.xyz_m[p][0] == points.xyz_m[at(pole * (RINGS - 1), 0)][0]);
        assert_true(points.xyz_m[b][0] == points.xyz_m[at(pole == 0 ? 1 : RINGS - 2, k + 1)][0]);
        assert_int_equal(points.rgb[p][0], points.rgb[at(pole * (RINGS - 1), 0)][0]);
    }
    assert_memory_equal(face[n], far[0], sizeof far[0]);
    expect_uv(face[n + 1][0], 1.5 / RINGS, 1 + 0.5 / STEPS); /* half a turn and one step: the other way is shorter */
    expect_uv(face[n + 1][1], 1.5 / RINGS, (STEPS / 2 + 1.5) / STEPS);
    expect_uv(face[n + 1][2], 2.5 / RINGS, (STEPS / 2 + 1.5) / STEPS);
    assert_int_equal(points.n,
                     OTHERS + N + 2 * (STEPS - 1) + 2); /* copies: 7 of each pole, 1 in the ring beside each */
}

/* A panorama closes after its last line. A point that is beyond the seam is doubled once, for all faces. */
static void a_turn_of_lines_is_unwrapped(void **state)
{
    (void)state;
    grid.line_max = STEPS - 1;
    grid.row_max = 2; /* the last row has no points */
    for (uint32_t i = 0; i < STEPS; i++)
        for (uint32_t k = 0; k < 2; k++)
            add(i, k);
    draw(STEPS, 3);
    for (uint32_t i = 0; i < 3 * STEPS; i++)
        assert_int_equal(image.rgb[i], 0);
    const uint32_t last = OTHERS + 2 * (STEPS - 1), copy = OTHERS + 2 * STEPS;
    uint32_t face[3][3] = {{last, OTHERS, last + 1}, {OTHERS, OTHERS + 1, last + 1}, {OTHERS, OTHERS + 2, OTHERS + 1}};
    if (mesh_texture_unwrap(&grid, &points, face, 3, &err) != SH_OK) fail_msg("%s", err.text);
    const uint32_t want[3][3] = {{last, copy, last + 1}, {copy, copy + 1, last + 1}, {OTHERS, OTHERS + 2, OTHERS + 1}};
    assert_memory_equal(face, want, sizeof want);
    assert_int_equal(points.n, copy + 2);
    expect_uv(copy, 1 + 0.5 / STEPS, 0.5 / 3);
    expect_uv(copy + 1, 1 + 0.5 / STEPS, 1.5 / 3);
    expect_uv(OTHERS, 0.5 / STEPS, 0.5 / 3);
    grid.n = 0;
    assert_int_equal(mesh_texture_unwrap(&grid, &points, NULL, 0, &err), SH_OK); /* a scan without points */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(colours_are_at_their_places, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_sphere_is_unwrapped, set_up, tear_down),
        cmocka_unit_test_setup_teardown(a_turn_of_lines_is_unwrapped, set_up, tear_down),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
