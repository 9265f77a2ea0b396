/* SPDX-License-Identifier: MIT */
#include "tests/accuracy/seen_room.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/mat3.h"
#include "tests/common/made.h"

enum { MOST_VERTICES = 8000, MOST_TRIANGLES = 8000, ROOM_LINES_AHEAD = 5 };

struct drawn {
    double vertex[MOST_VERTICES][3];
    uint32_t triangle[MOST_TRIANGLES][3];
    uint16_t label[MOST_TRIANGLES];
    uint32_t n_vertices, n_triangles;
};

static void draw_triangle(struct drawn *d, const double a[3], const double b[3], const double c[3], uint16_t label)
{
    const double *corner[3] = {a, b, c};
    assert_true(d->n_vertices + 3 <= MOST_VERTICES && d->n_triangles < MOST_TRIANGLES);
    for (int k = 0; k < 3; k++) {
        memcpy(d->vertex[d->n_vertices], corner[k], sizeof d->vertex[0]);
        d->triangle[d->n_triangles][k] = d->n_vertices++;
    }
    d->label[d->n_triangles++] = label;
}

/* Adds the parallelogram a, a + u, a + u + v, a + v. */
static void draw_quad(struct drawn *d, const double a[3], const double u[3], const double v[3], uint16_t label)
{
    double b[3], c[3], e[3];
    for (int i = 0; i < 3; i++) {
        b[i] = a[i] + u[i];
        c[i] = b[i] + v[i];
        e[i] = a[i] + v[i];
    }
    draw_triangle(d, a, b, c, label);
    draw_triangle(d, a, c, e, label);
}

/* A box with the edges x, y and z. */
static void draw_box(struct drawn *d, const double a[3], const double x[3], const double y[3], const double z[3],
                     uint16_t label)
{
    double far[3];
    for (int i = 0; i < 3; i++)
        far[i] = a[i] + x[i] + y[i] + z[i];
    const double minus[3][3] = {{-x[0], -x[1], -x[2]}, {-y[0], -y[1], -y[2]}, {-z[0], -z[1], -z[2]}};
    draw_quad(d, a, x, y, label);
    draw_quad(d, a, y, z, label);
    draw_quad(d, a, z, x, label);
    draw_quad(d, far, minus[0], minus[1], label);
    draw_quad(d, far, minus[1], minus[2], label);
    draw_quad(d, far, minus[2], minus[0], label);
}

static void any_vector(uint64_t *random, double most, double out[3])
{
    for (int i = 0; i < 3; i++)
        out[i] = most * (2.0 * case_unit(random) - 1.0);
}

/* Walls of squares of 1 m, 12 x 10 x 5 m around the middle. An open window takes 4 squares. */
static void draw_walls(struct drawn *d, const double at_m[3])
{
    static const double half[3] = {6.0, 5.0, 2.5};
    for (int axis = 0; axis < 3; axis++)
        for (int side = -1; side <= 1; side += 2) {
            const int u = (axis + 1) % 3, v = (axis + 2) % 3;
            const int n_u = (int)(2.0 * half[u]), n_v = (int)(2.0 * half[v]);
            for (int i = 0; i < n_u * n_v; i++) {
                double a[3], to_u[3] = {0, 0, 0}, to_v[3] = {0, 0, 0};
                if (axis == 1 && side == 1 && i / n_u / 2 == 1 && i % n_u / 2 == 1) continue;
                a[axis] = at_m[axis] + side * half[axis];
                a[u] = at_m[u] - half[u] + i % n_u;
                a[v] = at_m[v] - half[v] + i / n_u;
                to_u[u] = to_v[v] = 1.0;
                draw_quad(d, a, to_u, to_v, ROOM_WALL);
            }
        }
}

/* Chooses a random place from 1.5 to 4 m away from at_m. */
static void any_place(uint64_t *random, const double at_m[3], double out[3])
{
    double r;
    do {
        any_vector(random, 4.0, out);
        r = sqrt(out[0] * out[0] + out[1] * out[1] + out[2] * out[2]);
    } while (r < 1.5 || r > 4.0);
    for (int i = 0; i < 3; i++)
        out[i] += at_m[i];
}

static void draw_things(struct drawn *d, const double at_m[3], uint64_t *random)
{
    for (uint16_t k = 0; k < 240; k++) {
        const uint16_t label = ROOM_THING + k % (ROOM_LABELS - ROOM_THING);
        double a[3], x[3], y[3], z[3], b[3], c[3];
        any_place(random, at_m, a);
        any_vector(random, 0.4, x);
        any_vector(random, 0.4, y);
        any_vector(random, 0.4, z);
        for (int i = 0; i < 3; i++) {
            b[i] = a[i] + x[i];
            c[i] = a[i] + (k % 6 == 1 ? 0.5 * x[i] + 1e-4 * y[i] : y[i]); /* a needle */
        }
        switch (k % 6) {
        case 0:
            draw_box(d, a, x, y, z, label);
            break;
        case 1:
            draw_triangle(d, a, b, c, label);
            break;
        case 2:
            draw_quad(d, a, x, y, label);
            break;
        default: /* two or three on nearly the same plane, or on the same */
            draw_quad(d, a, x, y, label);
            for (int i = 0; i < 3; i++)
                a[i] += 0.3 * x[i] + (k % 6 == 3 ? 1e-7 : k % 6 == 4 ? 1e-5 : 0.0) * z[i];
            draw_quad(d, a, x, y, label - 1);
            if (k % 12 == 5) draw_triangle(d, b, a, c, label - 2);
        }
    }
}

static struct scene *scene_of(const struct drawn *d)
{
    struct scene_surface surface[ROOM_LABELS];
    memset(surface, 0, sizeof surface);
    for (int i = 0; i < ROOM_LABELS; i++)
        surface[i].object[0] = (char)('a' + i);
    const struct scene_arrays arrays = {(const double(*)[3])d->vertex,
                                        d->n_vertices,
                                        (const uint32_t(*)[3])d->triangle,
                                        d->n_triangles,
                                        d->label,
                                        surface,
                                        ROOM_LABELS};
    return made_scene(&arrays);
}

static void must(int rc, const struct sh_err *err)
{
    if (rc != 0) fail_msg("%s", err->text);
}

static void open_scene(struct seen_room *r, uint64_t seed, const double at_m[3])
{
    static const double pane_x[3] = {0.0, 2.0, 0.3}, up[3] = {0.1, 0.0, 2.0}, mirror_x[3] = {2.5, 0.4, 0.0};
    static const double body_x[3] = {0.8, 0.0, 0.1}, body_y[3] = {0.0, 0.5, 0.0}, body_z[3] = {-0.1, 0.0, 0.8};
    const double pane[3] = {at_m[0] + 3.5, at_m[1] - 1.0, at_m[2] - 1.0},
                 mirror[3] = {at_m[0] - 1.5, at_m[1] - 4.0, at_m[2] - 0.8};
    struct drawn *d = calloc(1, sizeof *d);
    struct sh_err err;
    assert_non_null(d);
    draw_walls(d, at_m);
    draw_things(d, at_m, &seed);
    draw_quad(d, pane, pane_x, up, ROOM_PANE);
    draw_quad(d, mirror, mirror_x, up, ROOM_MIRROR);
    r->scene = scene_of(d);
    d->n_vertices = d->n_triangles = 0;
    draw_box(d, at_m, body_x, body_y, body_z, ROOM_LABELS - 1);
    r->body_scene = scene_of(d);
    free(d);
    must(bvh_create(r->scene, 1, NULL, &r->bvh, &err), &err);
    must(bvh_create(r->body_scene, 1, NULL, &r->body, &err), &err);
}

static void open_sights(struct seen_room *r, const double at_m[3])
{
    struct sh_err err;
    struct sight_spec spec = {.bvh = r->bvh, .rays = 5e6, .memory_bytes = UINT64_C(64) << 20};
    memcpy(spec.station_m, at_m, sizeof spec.station_m);
    must(sight_create(&spec, 2, NULL, &r->sight, &err), &err);
}

static void open_surfaces(struct seen_room *r, const double at_m[3])
{
    struct sh_err err;
    must(surface_table_alloc(ROOM_LABELS, &r->table, &err), &err);
    for (int i = 0; i < ROOM_LABELS; i++)
        r->table.surface[i].reflectance = 0.05 + 0.06 * i;
    r->table.surface[ROOM_PANE] = (struct surface){.reflectance = 0.02, .glass = 0.9};
    r->table.surface[ROOM_MIRROR] = (struct surface){.mirror = 0.9};
    r->table.surface[ROOM_THING] = (struct surface){.reflectance = 0.2, .specular = 0.3, .gloss = 20.0};
    r->table.has_lobes = r->table.has_optics = r->table.has_mirror = 1;
    must(surface_kinds(&r->table, r->kind, &err), &err);
    beam_init(&r->beam.beam, 0.006, 0.5e-3, 2e-9);
    beam_rings(4, &r->beam.pattern);
    beam_rings(BEAM_FINE_RINGS, &r->beam.fine);
    r->beam.mode = BEAM_ADAPTIVE;
    r->beam.max_echoes = 5;
    const struct beam_outlines_spec spec = {r->scene, at_m, &r->beam.beam, r->setup.range_max_m, r->kind, NULL};
    must(cast_outlines(&spec, r->bvh, &r->outlines, &err), &err);
    r->beam.outlines = r->outlines;
}

void seen_room_open(struct seen_room *r, uint64_t seed, const double at_m[3])
{
    const int64_t mega = 1000000;
    const struct georef_spec place = {
        .crs = GEOREF_ECEF, .station_m = {at_m[0], at_m[1], at_m[2]}, .lat_deg = 52.5, .lon_deg = 13.4};
    const struct schedule_spec scan = {.prr_uhz = 100 * ROOM_PULSES * mega,
                                       .lines_uhz = 100 * mega,
                                       .pan_udeg_s = 100 * 360 * mega / ROOM_LINES,
                                       .fov_min_udeg = -80 * mega,
                                       .sweep_udeg = 160 * mega,
                                       .line_start_udeg = -80 * mega,
                                       .line_stop_udeg = 80 * mega,
                                       .pan_stop_udeg = 360 * mega};
    struct sh_err err;
    memset(r, 0, sizeof *r);
    r->setup = (struct cast_setup){.range_max_m = 500.0,
                                   .mirror_counts = 0x1p20,
                                   .pan_counts = 0x1p20,
                                   .layout = LINE_POLAR,
                                   .range_scale_m = 1e-6,
                                   .xyz_scale = {1e-5, 1e-5, 1e-5},
                                   .scan_key = 3};
    memcpy(r->setup.station_m, at_m, sizeof r->setup.station_m);
    pose_heading(0.7, r->setup.rotation);
    open_scene(r, seed, at_m);
    open_sights(r, at_m);
    open_surfaces(r, at_m);
    must(georef_create(&place, &r->georef, &err), &err);
    r->setup.bvh = r->bvh;
    r->setup.georef = r->georef;
    schedule_start(&r->segment, &scan);
    for (int i = 0; i < 2; i++) {
        must(caster_create(&r->caster[i], &err), &err);
        must(line_block_alloc(&r->block[i], ROOM_PULSES * LINE_MAX_ECHOES, &err), &err);
        must(line_block_alloc_attributes(&r->block[i], &err), &err);
    }
    must(caster_add_ahead(r->caster[1], ROOM_LINES_AHEAD * ROOM_PULSES, &err), &err);
}

void seen_room_close(struct seen_room *r)
{
    for (int i = 0; i < 2; i++) {
        line_block_free(&r->block[i]);
        caster_free(r->caster[i]);
    }
    georef_free(r->georef);
    beam_outlines_free(r->outlines);
    surface_table_free(&r->table);
    sight_free(r->sight);
    bvh_free(r->bvh);
    bvh_free(r->body);
    scene_free(r->scene);
    scene_free(r->body_scene);
}

static void same_blocks(const struct line_block *x, const struct line_block *y)
{
    const uint32_t n = x->n_points;
    assert_int_equal(n, y->n_points);
    for (uint32_t i = 0; i < n; i++)
        if (x->a[i] != y->a[i] || x->label[i] != y->label[i])
            fail_msg("line %u, entry %u: %u, label %u; in the other one %u, label %u", x->line, i, x->a[i], x->label[i],
                     y->a[i], y->label[i]);
    assert_memory_equal(x->b, y->b, n * sizeof *x->b);
    assert_memory_equal(x->c, y->c, n * sizeof *x->c);
    assert_memory_equal(x->dt_ns, y->dt_ns, n * sizeof *x->dt_ns);
    assert_memory_equal(x->echo, y->echo, n * sizeof *x->echo);
    assert_memory_equal(x->refl_cdb, y->refl_cdb, n * sizeof *x->refl_cdb);
    assert_memory_equal(x->amplitude_cdb, y->amplitude_cdb, n * sizeof *x->amplitude_cdb);
    assert_memory_equal(x->width_cns, y->width_cns, n * sizeof *x->width_cns);
}

/* Casts a run both ways, and compares. Returns the number of echoes. */
static uint32_t cast_both(struct seen_room *r, const struct cast_setup *without, const struct cast_setup *with,
                          const struct schedule_run *run)
{
    const uint32_t n[2] = {caster_cast(r->caster[0], without, run, &r->block[0]),
                           caster_cast(r->caster[1], with, run, &r->block[1])};
    assert_int_equal(n[0], n[1]);
    same_blocks(&r->block[0], &r->block[1]);
    return n[0];
}

/* Fills runs of pulses k .. end - 1, one for each line. Returns their number. */
static uint32_t runs_of(const struct seen_room *r, uint64_t k, uint64_t end, struct schedule_run *run)
{
    uint32_t n = 0;
    while (k < end) {
        struct schedule_line line;
        schedule_get_line(&r->segment, schedule_line_of(&r->segment, k), &line);
        const uint64_t stop = line.cast_end < end ? line.cast_end : end;
        schedule_get_run(&r->segment, &line, k, (uint32_t)(stop - k), &run[n++]);
        k = stop;
    }
    return n;
}

/* The pulses ahead are those of two to five lines. They are cast in pieces that need not begin or end with a line. */
int seen_room_compare_ahead(struct seen_room *r, const struct cast_setup *setup)
{
    struct schedule_run ahead[CAST_AHEAD_RUNS], piece[CAST_AHEAD_RUNS];
    const uint64_t all = (uint64_t)ROOM_LINES * ROOM_PULSES;
    uint64_t random = 5;
    if (caster_room_ahead(r->caster[1], setup, NULL) == 0) return 0;
    assert_int_equal(caster_room_ahead(r->caster[1], setup, NULL), ROOM_LINES_AHEAD * ROOM_PULSES);
    for (uint64_t k = 0, end; k < all; k = end) {
        end = k + 2 * ROOM_PULSES + (uint64_t)(case_unit(&random) * 3 * ROOM_PULSES);
        if (end > all) end = all;
        caster_look_ahead(r->caster[1], setup, ahead, runs_of(r, k, end, ahead));
        for (uint64_t at = k, stop; at < end; at = stop) {
            stop = at + 1 + (uint64_t)(case_unit(&random) * 2 * ROOM_PULSES);
            const uint32_t n = runs_of(r, at, stop = stop < end ? stop : end, piece);
            for (uint32_t i = 0; i < n; i++)
                cast_both(r, setup, setup, &piece[i]);
        }
    }
    caster_forget(r->caster[1]);
    return 1;
}

uint64_t seen_room_compare(struct seen_room *r, const struct cast_setup *without, const struct cast_setup *with)
{
    uint64_t echoes = 0;
    for (uint32_t l = 0; l < ROOM_LINES; l++) {
        struct schedule_line line;
        struct schedule_run run;
        schedule_get_line(&r->segment, l, &line);
        schedule_get_run(&r->segment, &line, line.cast0, (uint32_t)(line.cast_end - line.cast0), &run);
        echoes += cast_both(r, without, with, &run);
    }
    return echoes;
}
