/* SPDX-License-Identifier: MIT */
#include "tests/unit/coverage_rig.h"

#include "core/pose.h"
#include "tests/common/thorough.h"

const struct cover_sweep cover_everywhere = {SANITIZED ? 3.0 : 0.5, -90.0, 90.0, 0.0, 360.0, 1000.0};

struct cover *cover_open(struct scene *scene, double cell_m, unsigned threads)
{
    struct cover *c = calloc(1, sizeof *c);
    struct sh_err err;
    assert_non_null(c);
    c->scene = scene;
    if (bvh_create(scene, 1, NULL, &c->bvh, &err) != 0 ||
        coverage_create(&(struct coverage_spec){c->bvh, NULL, cell_m, 100.0, threads}, NULL, &c->coverage, &err) != 0)
        fail_msg("%s", err.text);
    return c;
}

void cover_close(struct cover *c)
{
    coverage_free(c->coverage);
    bvh_free(c->bvh);
    scene_free(c->scene);
    free(c);
}

static struct scene *make(const double (*vertex)[3], uint32_t n_vertices, const uint32_t (*triangle)[3], uint32_t n)
{
    struct scene *scene;
    struct sh_err err;
    uint16_t *label = calloc(n, sizeof *label);
    struct scene_surface *surface = calloc(n, sizeof *surface);
    assert_true(label != NULL && surface != NULL);
    for (uint32_t i = 0; i < n; i++) {
        label[i] = (uint16_t)(i / 2);
        snprintf(surface[i].object, sizeof surface[i].object, "wall-%u", i);
    }
    const struct scene_arrays arrays = {vertex, n_vertices, triangle, n, label, surface, (n + 1) / 2};
    if (scene_from_arrays(&arrays, &scene, &err) != 0) fail_msg("%s", err.text);
    free(label);
    free(surface);
    return scene;
}

struct scene *cover_box(const double lo[3], const double hi[3])
{
    static const uint32_t face[12][3] = {{0, 2, 6}, {0, 6, 4}, {1, 5, 7}, {1, 7, 3}, {0, 4, 5}, {0, 5, 1},
                                         {2, 3, 7}, {2, 7, 6}, {0, 1, 3}, {0, 3, 2}, {4, 6, 7}, {4, 7, 5}};
    double vertex[8][3];
    for (int v = 0; v < 8; v++)
        for (int i = 0; i < 3; i++)
            vertex[v][i] = v >> i & 1 ? hi[i] : lo[i];
    return make((const double(*)[3])vertex, 8, face, 12);
}

struct scene *cover_l_room(void)
{
    static const double at[6][2] = {{0, 0}, {6, 0}, {6, 2}, {2, 2}, {2, 5}, {0, 5}};
    static const uint32_t flat[4][3] = {{0, 1, 2}, {0, 2, 3}, {0, 3, 5}, {3, 4, 5}};
    double vertex[12][3];
    uint32_t triangle[20][3], n = 0;
    for (uint32_t i = 0; i < 12; i++) {
        vertex[i][0] = at[i % 6][0];
        vertex[i][1] = at[i % 6][1];
        vertex[i][2] = i < 6 ? 0.0 : L_HEIGHT_M;
    }
    for (uint32_t i = 0; i < 6; i++) { /* seen from within, so in the other order */
        const uint32_t a = i, b = (i + 1) % 6, wall[2][3] = {{b, a, a + 6}, {b, a + 6, b + 6}};
        memcpy(triangle[n++], wall[0], sizeof wall[0]);
        memcpy(triangle[n++], wall[1], sizeof wall[1]);
    }
    for (int i = 0; i < 4; i++) {
        memcpy(triangle[n++], flat[i], sizeof flat[i]);
        for (int k = 0; k < 3; k++)
            triangle[n][k] = flat[i][2 - k] + 6;
        n++;
    }
    return make((const double(*)[3])vertex, 12, (const uint32_t(*)[3])triangle, n);
}

static int64_t micro(double value)
{
    return llround(1e6 * value);
}

/* Each step of the pan is a line, and each step of the line a pulse. */
void cover_scan(const struct cover *c, const double station_m[3], const struct cover_sweep *w,
                struct coverage_scan *scan)
{
    const double per_line = (w->high_deg - w->low_deg) / w->step_deg;
    const struct schedule_spec spec = {.prr_uhz = micro(100.0 * per_line),
                                       .lines_uhz = micro(100.0),
                                       .pan_udeg_s = micro(100.0 * w->step_deg),
                                       .fov_min_udeg = micro(w->low_deg),
                                       .sweep_udeg = micro(w->high_deg - w->low_deg),
                                       .line_start_udeg = micro(w->low_deg),
                                       .line_stop_udeg = micro(w->high_deg),
                                       .pan_start_udeg = micro(w->pan0_deg),
                                       .pan_stop_udeg = micro(w->pan1_deg),
                                       .frames = 1};
    *scan = (struct coverage_scan){.setup = {.bvh = c->bvh,
                                             .range_max_m = w->range_max_m,
                                             .mirror_counts = 0x1p32,
                                             .pan_counts = 0x1p32,
                                             .layout = LINE_POLAR}};
    memcpy(scan->setup.station_m, station_m, sizeof scan->setup.station_m);
    pose_heading(0.0, scan->setup.rotation);
    schedule_start(&scan->segment, &spec);
}

void cover_look(struct cover *c, const double station_m[3], const struct cover_sweep *sweep,
                struct coverage_pulses *pulses)
{
    struct coverage_scan scan;
    struct sh_err err;
    cover_scan(c, station_m, sweep, &scan);
    if (coverage_look(c->coverage, &scan, "scan", NULL, pulses, &err) != 0) fail_msg("%s", err.text);
    coverage_keep(c->coverage);
}

/* ---- cells */

struct filling {
    struct cover_cell *cell;
    const double *station_m;
    double step_rad;
    int (*sees)(const double p_m[3]);
};

static void add_corner(struct filling *f, struct cover_cell *c, const double p_m[3], const double n[3])
{
    double to[3];
    vec3_sub(p_m, f->station_m, to);
    const double range_m = vec3_length(to), away_m = fabs(vec3_dot(to, n)) / vec3_length(n);
    c->corners++;
    c->seen += f->sees != NULL && f->sees(p_m);
    c->farthest_m = fmax(c->farthest_m, range_m);
    c->nearest_m = fmin(c->nearest_m, range_m);
    c->spacing_m = fmax(c->spacing_m, range_m * range_m * f->step_rad / away_m);
    for (int i = 0; i < 3; i++) {
        c->low_m[i] = fmin(c->low_m[i], p_m[i]);
        c->high_m[i] = fmax(c->high_m[i], p_m[i]);
    }
}

static void add_piece(void *ctx, uint32_t cell, int n, const double corner[4][3])
{
    struct filling *f = ctx;
    struct cover_cell *c = &f->cell[cell];
    double normal[3] = {0.0, 0.0, 0.0}, round_m = 0.0;
    for (int i = 0; i < n; i++) {
        double a[3], b[3], across[3];
        vec3_sub(corner[i], corner[0], a);
        vec3_sub(corner[(i + 1) % n], corner[0], b);
        vec3_cross(a, b, across);
        vec3_add(normal, across, normal);
        round_m += vec3_distance(corner[i], corner[(i + 1) % n]);
    }
    const double area_m2 = 0.5 * vec3_length(normal);
    c->area_m2 += area_m2;
    c->least_m = fmax(c->least_m, area_m2 / round_m);
    for (int i = 0; i < n; i++)
        add_corner(f, c, corner[i], normal);
}

void cover_cells(const struct cover *cover, const double station_m[3], double step_deg,
                 int (*sees)(const double p_m[3]), struct cover_cell *cell)
{
    struct filling f = {cell, station_m, step_deg * M_PI / 180.0, sees};
    for (uint32_t i = 0; i < coverage_cells(cover->coverage); i++)
        cell[i] = (struct cover_cell){.low_m = {INFINITY, INFINITY, INFINITY},
                                      .high_m = {-INFINITY, -INFINITY, -INFINITY},
                                      .nearest_m = INFINITY};
    coverage_pieces(cover->coverage, add_piece, &f);
}

double cover_area(const struct scene *scene)
{
    double area_m2 = 0.0;
    for (uint32_t t = 0; t < scene->n_triangles; t++) {
        double a[3], b[3], n[3];
        vec3_sub(scene->vertex_m[scene->triangle[t][1]], scene->vertex_m[scene->triangle[t][0]], a);
        vec3_sub(scene->vertex_m[scene->triangle[t][2]], scene->vertex_m[scene->triangle[t][0]], b);
        vec3_cross(a, b, n);
        area_m2 += 0.5 * vec3_length(n);
    }
    return area_m2;
}
