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

/* At 100 lines a second a pan of 18 degrees a second has 2000 lines a turn, and one of half a degree 72,000. */
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

/* Rings at -90 and 90 degrees, also where they are rounded to a micro-degree. A line's ring is its number modulo rings.
 */
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

/* The last line borders on the first one where they are a step and a half apart at most, and where they don't meet. */
static void test_closes(void **state)
{
    (void)state;
    static const struct {
        double lines_per_turn;
        uint32_t line_min, line_max;
        int closes;
    } rows[] = {{2000, 0, 1999, 1},    {2000, 5, 2004, 1},    {2000, 0, 1998, 0},
                {2000, 0, 2000, 0},    {2000, 0, 2001, 0},    {1999.5, 0, 1998, 1},
                {1999.25, 0, 1999, 1}, {1999.75, 0, 1998, 0}, {0, 0, 5, 0}};
    static const double xyz_m[3][3] = {{1, 2, 3}, {4, 5, 6}, {7, 8, 9}};
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct mesh_grid g = {.first = 1, .n = 2, .n_columns = 2, .rows_per_turn = 7, .head_m = {-1, -2, -3}};
        float to_head_m[2][3] = {{0}};
        g.lines_per_turn = rows[i].lines_per_turn;
        g.line_min = rows[i].line_min;
        g.line_max = rows[i].line_max;
        g.to_head_m = to_head_m;
        g.moving = i % 2 == 1;
        const struct scan_grid grid = mesh_grid_of(&g, xyz_m, 2.5);
        assert_int_equal(grid.closes, rows[i].closes);
        assert_true(grid.xyz_m == xyz_m + 1 && grid.long_edge == 2.5 && grid.rows_per_turn == 7);
        assert_true(grid.n_points == 2 && grid.n_columns == 2);
        assert_true(grid.head_m[0] == -1 && grid.head_m[1] == -2 && grid.head_m[2] == -3);
        assert_ptr_equal(grid.to_head_m, g.moving ? to_head_m : NULL);
    }
}

/* Points of a grid come line by line, and row by row. A sweep of several lines is a grid of its own. */
static void test_takes(void **state)
{
    (void)state;
    static const struct {
        int kind;
        uint32_t rings;
        double pan_deg_s;
        int has_sweeps;
    } kinds[] = {{SCANHEAD_EMIT_LINE, 0, 18, 1},  {SCANHEAD_EMIT_LINE, 0, 0.25, 1}, {SCANHEAD_EMIT_LINE, 0, 0, 0},
                 {SCANHEAD_EMIT_SPHERE, 2, 0, 1}, {SCANHEAD_EMIT_SPHERE, 1, 18, 0}, {SCANHEAD_EMIT_PLANAR, 0, 0, 0}};
    static const struct {
        uint32_t line, row;
        int takes;
    } next[] = {{4, 10, 1}, {4, 9, 0}, {4, 8, 0}, {5, 0, 1}, {3, 100, 0}};
    struct track *t = calloc(1, sizeof *t);
    assert_non_null(t);
    for (size_t i = 0; i < sizeof kinds / sizeof *kinds; i++) {
        t->emitter = (struct scanhead_emitter){.kind = kinds[i].kind, .rings = kinds[i].rings};
        t->info.pan_deg_s = kinds[i].pan_deg_s;
        t->sweep = 3;
        struct mesh_grid g = {0};
        struct sh_err err;
        mesh_grid_begin(&g, t, 0);
        t->line = 4;
        t->row[2] = 9;
        assert_int_equal(mesh_grid_takes(&g, t, 2), 1);
        assert_int_equal(mesh_grid_add(&g, t, 2, (double[3]){0}, &err), 1);
        assert_true(g.n == 1 && g.n_columns == 1 && g.row[0] == 9 && g.line[0] == 4 && g.column[0].line == 4);
        for (size_t k = 0; k < sizeof next / sizeof *next; k++) {
            t->line = next[k].line;
            t->row[2] = next[k].row;
            t->sweep = 3;
            assert_int_equal(mesh_grid_takes(&g, t, 2), next[k].takes);
            t->sweep = 4;
            assert_int_equal(mesh_grid_takes(&g, t, 2), next[k].takes && !kinds[i].has_sweeps);
        }
        t->line = 6;
        t->row[2] = 7;
        assert_int_equal(mesh_grid_add(&g, t, 2, (double[3]){0}, &err), 1);
        t->row[2] = 12;
        assert_int_equal(mesh_grid_add(&g, t, 2, (double[3]){0}, &err), 1);
        assert_true(g.n == 3 && g.n_columns == 2 && g.column[1].line == 6 && g.column[1].first == 1);
        assert_true(g.line_min == 4 && g.line_max == 6 && g.row_min == 7 && g.row_max == 12);
        mesh_grid_free(&g);
    }
    free(t);
}

/* Heads without rows and columns, single lines, and moving heads with points in another CRS are refused. */
static void test_check(void **state)
{
    (void)state;
    enum { LOCAL = 0, UTM = 2 };
    static const char BEAMS[] = "fires beams in turn", LIST[] = "fires along a list", LINE[] = "scans a single line",
                      CRS[] = "allowed output.crs: local";
    static const struct {
        int kind;
        uint32_t rings;
        double pan_deg_s;
        int moving, geo, crs;
        const char *why; /* NULL: a mesh */
    } rows[] = {
        {SCANHEAD_EMIT_BEAMS, 0, 0, 0, 0, LOCAL, BEAMS},   {SCANHEAD_EMIT_BEAMS, 0, 0, 1, 0, LOCAL, BEAMS},
        {SCANHEAD_EMIT_DIRECTIONS, 0, 0, 0, 1, UTM, LIST}, {SCANHEAD_EMIT_PLANAR, 0, 0, 0, 0, LOCAL, LINE},
        {SCANHEAD_EMIT_PLANAR, 0, 0, 1, 0, LOCAL, NULL},   {SCANHEAD_EMIT_LINE, 0, 0, 0, 0, LOCAL, LINE},
        {SCANHEAD_EMIT_LINE, 0, 0, 1, 0, LOCAL, NULL},     {SCANHEAD_EMIT_LINE, 0, 0.5, 0, 1, UTM, NULL},
        {SCANHEAD_EMIT_SPHERE, 1, 0, 0, 0, LOCAL, LINE},   {SCANHEAD_EMIT_SPHERE, 2, 0, 0, 0, LOCAL, NULL},
        {SCANHEAD_EMIT_SPHERE, 1, 0, 1, 0, LOCAL, NULL},   {SCANHEAD_EMIT_LINE, 0, 5, 1, 1, UTM, CRS},
        {SCANHEAD_EMIT_LINE, 0, 5, 1, 0, UTM, NULL},       {SCANHEAD_EMIT_LINE, 0, 5, 1, 1, LOCAL, NULL},
    };
    struct track *t = calloc(1, sizeof *t);
    assert_non_null(t);
    t->path = "a.obj";
    for (size_t i = 0; i < sizeof rows / sizeof *rows; i++) {
        struct sh_err err = {0};
        t->emitter = (struct scanhead_emitter){.kind = rows[i].kind, .rings = rows[i].rings};
        t->info = (struct scanhead_info){
            .pan_deg_s = rows[i].pan_deg_s, .moving = rows[i].moving, .geo = rows[i].geo, .crs = rows[i].crs};
        assert_int_equal(mesh_grid_check(t, &err), rows[i].why != NULL ? SH_EFORMAT : SH_OK);
        if (rows[i].why == NULL) continue;
        assert_memory_equal(err.text, "a.obj: a mesh ", 14);
        assert_non_null(strstr(err.text, rows[i].why));
    }
    free(t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_rows),  cmocka_unit_test(test_lines),
                                       cmocka_unit_test(test_poles), cmocka_unit_test(test_closes),
                                       cmocka_unit_test(test_takes), cmocka_unit_test(test_check)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
