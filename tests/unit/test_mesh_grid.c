/* SPDX-License-Identifier: MIT */
/* The grid of a mesh by the kind of head: do its rows and lines close into a turn, and which lines are poles? */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <cmocka.h>

#include "drivers/record/mesh_grid.h"

static struct mesh_grid begin(const struct scanhead_emitter *emitter, const struct scanhead_info *info)
{
    struct track *t = calloc(1, sizeof *t);
    struct mesh_grid g = {.n = 7};
    assert_non_null(t);
    t->emitter = *emitter;
    t->info = *info;
    t->sweep = 5;
    mesh_grid_begin(&g, t, 9);
    assert_true(g.first == 9 && g.n == 0 && g.n_columns == 0 && g.sweep == 5 && g.kind == emitter->kind);
    free(t);
    return g;
}

/* A turn closes where all of its steps are scanned. */
static void test_rows(void **state)
{
    (void)state;
    static const struct {
        int kind, first, last;
        uint32_t steps, rows;
    } rows[] = {
        {SCANHEAD_EMIT_PLANAR, 0, 99, 100, 100}, {SCANHEAD_EMIT_PLANAR, 1, 99, 100, 0},
        {SCANHEAD_EMIT_PLANAR, 0, 98, 100, 0},   {SCANHEAD_EMIT_SPHERE, 0, 0, 100, 100},
        {SCANHEAD_EMIT_LINE, 0, 99, 100, 0},
    };
    static const struct scanhead_info info = {.lines_hz = 100};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct scanhead_emitter e = {
            .kind = rows[i].kind, .first_step = rows[i].first, .last_step = rows[i].last, .steps = rows[i].steps};
        assert_int_equal(begin(&e, &info).rows_per_turn, rows[i].rows);
    }
}

/* At 100 lines a second a pan of 18 degrees a second has 2000 lines a turn, and one of half a degree 72000. */
static void test_lines(void **state)
{
    (void)state;
    static const struct {
        int kind, moving;
        double pan_deg_s, lines;
    } rows[] = {{SCANHEAD_EMIT_LINE, 0, 18, 2000},
                {SCANHEAD_EMIT_LINE, 0, 0.5, 72000},
                {SCANHEAD_EMIT_LINE, 0, 0, 0},
                {SCANHEAD_EMIT_LINE, 1, 18, 0},
                {SCANHEAD_EMIT_SPHERE, 0, 18, 0}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        const struct scanhead_emitter e = {.kind = rows[i].kind};
        const struct scanhead_info info = {.lines_hz = 100, .pan_deg_s = rows[i].pan_deg_s, .moving = rows[i].moving};
        assert_true(begin(&e, &info).lines_per_turn == rows[i].lines);
    }
}

/* Rings at -90 and 90 degrees, also where they are rounded to a micro-degree. A line's ring is its number modulo rings. */
static void test_poles(void **state)
{
    (void)state;
    static const struct scanhead_info info = {.lines_hz = 100};
    struct scanhead_emitter e = {.kind = SCANHEAD_EMIT_SPHERE, .rings = 181, .first_ring_deg = -90, .ring_step_deg = 1};
    struct mesh_grid g = begin(&e, &info);
    for (uint32_t line = 0; line < 362; line++)
        assert_int_equal(mesh_grid_is_pole(&g, line), line % 181 == 0 || line % 181 == 180);
    e.first_ring_deg = -90 + 1e-6;
    e.rings = 3;
    g = begin(&e, &info);
    for (uint32_t line = 0; line < 6; line++)
        assert_int_equal(mesh_grid_is_pole(&g, line), line % 3 == 0);
    e.first_ring_deg = -89.99;
    g = begin(&e, &info);
    assert_false(mesh_grid_is_pole(&g, 0));
    e.first_ring_deg = 90;
    e.rings = 1;
    g = begin(&e, &info);
    assert_false(mesh_grid_is_pole(&g, 0)); /* a circle is no sphere */
    e.kind = SCANHEAD_EMIT_PLANAR;
    e.rings = 181;
    g = begin(&e, &info);
    assert_false(mesh_grid_is_pole(&g, 0));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_rows), cmocka_unit_test(test_lines),
                                       cmocka_unit_test(test_poles)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
