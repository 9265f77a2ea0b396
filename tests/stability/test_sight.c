/* SPDX-License-Identifier: MIT */
/* This is a visibility map of a station, as one would first write it. The faces of a cube are cut into cells. A cell
 * lists the triangles that may be seen in it, and the sides of their edges decide rays. It fails in three ways. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "core/vec3.h"
#include "tests/stability/rig.h"

static const double UTM_M[3] = {391431.25, 5819712.5, 34.0}, STATION_M[3] = {0.0, 0.0, 0.0};

#ifdef SH_SANITIZE
enum { RAYS = 2000 };
#else
enum { RAYS = 10000 };
#endif

/* ---- the naive map */

enum { CELLS = 64, MOST = 700, NONE = 0xffffffff };

struct naive_triangle {
    double edge[3][3]; /* edge . d is positive inside */
    double plane[3];   /* plane . d is 1 / range */
};

struct naive_map {
    struct naive_triangle triangle[MOST];
    uint32_t n;
};

/* With of_corners an edge is a x b, as in books; else a x (b - a). */
static void make_map(const struct rig *rig, int of_corners, struct naive_map *map)
{
    assert_true(rig->scene->n_triangles <= MOST);
    map->n = rig->scene->n_triangles;
    for (uint32_t t = 0; t < map->n; t++) {
        struct naive_triangle *it = &map->triangle[t];
        double v[3][3], e[3], f[3], n[3];
        for (int i = 0; i < 3; i++)
            vec3_sub(rig->scene->vertex_m[rig->scene->triangle[t][i]], rig->station_m, v[i]);
        vec3_sub(v[1], v[0], e);
        vec3_sub(v[2], v[0], f);
        vec3_cross(e, f, n);
        const double off = vec3_dot(n, v[0]);
        for (int i = 0; i < 3; i++) {
            const double *a = v[i], *b = v[(i + 1) % 3];
            vec3_sub(b, a, e);
            vec3_cross(a, of_corners ? b : e, it->edge[i]);
            it->plane[i] = n[i] / off;
            for (int k = 0; k < 3; k++)
                it->edge[i][k] *= off < 0.0 ? -1.0 : 1.0;
        }
    }
}

/* Four directions around a ray: the corners of its cell. The cell is looked up in float. */
static void cell_of(const double dir[3], double corner[4][3])
{
    const float f[3] = {(float)dir[0], (float)dir[1], (float)dir[2]};
    int axis = fabsf(f[0]) >= fabsf(f[1]) ? 0 : 1;
    if (fabsf(f[2]) > fabsf(f[axis])) axis = 2;
    for (int i = 0; i < 4; i++) {
        for (int k = 1; k < 3; k++) {
            const float at = f[(axis + k) % 3] / fabsf(f[axis]);
            const double cell = floor(fmin(0.5 * CELLS * ((double)at + 1.0), CELLS - 1));
            corner[i][(axis + k) % 3] = 2.0 * (cell + (i >> (k - 1) & 1)) / CELLS - 1.0;
        }
        corner[i][axis] = f[axis] < 0.0f ? -1.0 : 1.0;
    }
}

enum { OUTSIDE = 1, COVERS = 2 };

static int lies(const struct naive_triangle *it, double corner[4][3])
{
    int covers = COVERS;
    for (int i = 0; i < 3; i++) {
        int inside = 0;
        for (int k = 0; k < 4; k++)
            inside += vec3_dot(it->edge[i], corner[k]) >= 0.0;
        if (inside == 0) return OUTSIDE;
        if (inside < 4) covers = 0;
    }
    return covers;
}

static int is_behind(const struct naive_triangle *it, const struct naive_triangle *first, double corner[4][3])
{
    for (int k = 0; k < 4; k++)
        if (!(vec3_dot(it->plane, corner[k]) < vec3_dot(first->plane, corner[k]))) return 0;
    return 1;
}

static int is_inside(const struct naive_triangle *it, const double dir[3])
{
    return vec3_dot(it->edge[0], dir) >= 0.0 && vec3_dot(it->edge[1], dir) >= 0.0 && vec3_dot(it->edge[2], dir) >= 0.0;
}

/* Returns the map's answer for the cell: a triangle that covers it and hides all others, else the nearest one that may
 * be seen in it and is met. The cell is filled only when a ray asks, which changes no answer. */
static uint32_t naive_look(const struct naive_map *map, const double dir[3])
{
    double corner[4][3], best = 0.0;
    uint32_t seen[MOST], n = 0, cover = NONE, found = NONE, hidden = 0;
    cell_of(dir, corner);
    for (uint32_t t = 0; t < map->n; t++) {
        const struct naive_triangle *it = &map->triangle[t];
        const int how = lies(it, corner);
        if (how != OUTSIDE) seen[n++] = t;
        if (how == COVERS && (cover == NONE || is_behind(&map->triangle[cover], it, corner))) cover = t;
    }
    for (uint32_t i = 0; i < n && cover != NONE; i++)
        hidden += seen[i] != cover && is_behind(&map->triangle[seen[i]], &map->triangle[cover], corner);
    if (cover != NONE && hidden == n - 1) return cover;
    for (uint32_t i = 0; i < n; i++) {
        const struct naive_triangle *it = &map->triangle[seen[i]];
        const double q = vec3_dot(it->plane, dir);
        if (!is_inside(it, dir) || q <= best) continue;
        best = q;
        found = seen[i];
    }
    return found;
}

/* ---- rays */

/* Aims towards a place on an edge of triangle t, and past it by off_m. */
static void aim_beside_edge(struct rig *rig, uint32_t t, uint64_t seed, double off_m)
{
    const uint32_t *corner = rig->scene->triangle[t];
    const int i = (int)(3.0 * rig_unit(seed, 0));
    const double *from = rig->scene->vertex_m[corner[i]], *to = rig->scene->vertex_m[corner[(i + 1) % 3]];
    double p[3], edge[3], across[3];
    for (int k = 0; k < 3; k++)
        p[k] = from[k] + rig_unit(seed, 1) * (to[k] - from[k]) - rig->station_m[k];
    vec3_sub(to, from, edge);
    vec3_cross(edge, p, across);
    const double scale = off_m / vec3_length(across);
    rig_direct(rig, p[0] + scale * across[0], p[1] + scale * across[1], p[2] + scale * across[2]);
}

/* Counts wrong triangles, beyond the resolution of double precision. `slipped` counts rays that meet none. */
struct wrong {
    uint32_t triangles, slipped;
};

static struct wrong judge(const struct rig *rig)
{
    struct wrong wrong = {0, 0};
    for (uint32_t i = 0; i < rig->n; i++) {
        const double dir[3] = {rig->dx[i], rig->dy[i], rig->dz[i]};
        wrong.slipped += rig->triangle[i] == NONE;
        if (rig->triangle[i] != rig->truth[i].triangle)
            wrong.triangles +=
                !reference_is_undecidable(rig->reference, rig->station_m, dir, &rig->truth[i], rig->range_m[i]);
    }
    return wrong;
}

/* rig_cast asks the BVH and the sight of the rig's station, so `ours` judges both. */
static void look_both_ways(struct rig *rig, int of_corners, struct wrong *naive, struct wrong *ours)
{
    static struct naive_map map;
    make_map(rig, of_corners, &map);
    rig_look(rig);
    for (uint32_t i = 0; i < rig->n; i++) {
        rig->triangle[i] = naive_look(&map, (const double[3]){rig->dx[i], rig->dy[i], rig->dz[i]});
        rig->range_m[i] = (double)rig->truth[i].range_m;
    }
    *naive = judge(rig);
    rig_cast(rig);
    *ours = judge(rig);
}

static void open_at_utm(struct rig *rig, struct mesh *mesh)
{
    double rotation[9];
    mesh_any_rotation(rotation);
    mesh_move(mesh, 0, rotation, UTM_M);
    rig_open(rig, mesh_scene(mesh), UTM_M);
}

/* ---- where it breaks */

/* a x b loses |a| / |b - a| of its precision, at small triangles far away. Rays pass their edges by more than the doubt
 * of double precision, 16 x 2^-53 of the distance. */
static void test_edges_of_corners(void **state)
{
    (void)state;
    static const double SIZE_M[] = {1.0, 0.01};
    for (int i = 0; i < 2; i++) {
        struct mesh mesh = {0};
        struct rig rig;
        struct wrong naive, ours;
        char regime[96];
        const double size = SIZE_M[i];
        mesh_sheet(&mesh, (const double[3]){0.3, 1000.0, 0.2}, (const double[3]){8.0 * size, size, 0.0},
                   (const double[3]){0.0, -size, 8.0 * size}, 8, 8, 0);
        mesh_sheet(&mesh, (const double[3]){-100.0, 1500.0, -100.0}, (const double[3]){200.0, 0.0, 0.0},
                   (const double[3]){0.0, 0.0, 200.0}, 1, 1, 7);
        open_at_utm(&rig, &mesh);
        for (uint32_t k = 0; k < RAYS; k++)
            aim_beside_edge(&rig, k % 128, 100 + k, pow(10.0, -11.5 + 3.0 * rig_unit(5, k)) * (k & 1 ? 1.0 : -1.0));
        look_both_ways(&rig, 1, &naive, &ours);
        snprintf(regime, sizeof regime, "edges of triangles of %g m at 1 km", size);
        table_row(regime, "a map, edges as a x b", naive.triangles, ours.triangles, 0.0, "wrong triangles");
        rig_close(&rig);
        mesh_free(&mesh);
    }
    table_check();
}

/* Each triangle gets the side of a common edge from its own corners, and rounds it in its own way. If both say
 * outside, the ray slips out of a closed mesh. */
static void test_no_doubts(void **state)
{
    (void)state;
    struct mesh mesh = {0};
    struct rig rig;
    struct wrong naive, ours;
    mesh_sphere(&mesh, (const double[3]){0.1, 0.2, -0.1}, 20.0, 0.1, 2, 0);
    rig_open(&rig, mesh_scene(&mesh), STATION_M);
    for (uint32_t k = 0; k < RAYS; k++)
        aim_beside_edge(&rig, k % rig.scene->n_triangles, 100 + k, 0.0);
    look_both_ways(&rig, 0, &naive, &ours);
    table_row("rays at edges, from within a closed mesh", "a map without doubts", naive.slipped, ours.slipped, 0.0,
              "rays slip out");
    rig_close(&rig);
    mesh_free(&mesh);
    table_check();
}

/* A sheet whose edges lie a hair beside the borders of cells. A place that float puts into the next cell is still on
 * this side of the edge. */
static void test_no_pad(void **state)
{
    (void)state;
    static const double BESIDE[] = {1e-8, 1e-9, 1e-11};
    for (int i = 0; i < 3; i++) {
        struct mesh mesh = {0};
        struct rig rig;
        struct wrong naive, ours;
        char regime[96];
        const double from = -10.0 * (1.0 + BESIDE[i]);
        mesh_sheet(&mesh, (const double[3]){from, 10.0, from}, (const double[3]){20.0, 0.0, 0.0},
                   (const double[3]){0.0, 0.0, 20.0}, CELLS / 4, CELLS / 4, 0);
        rig_open(&rig, mesh_scene(&mesh), STATION_M);
        for (uint32_t k = 0; k < RAYS; k++) {
            const double border = floor(CELLS * rig_unit(7, 3 * (uint64_t)k)) / (CELLS / 2) - 1.0;
            const double u = 0.99 * border + 5e-8 * (2.0 * rig_unit(7, 3 * (uint64_t)k + 1) - 1.0) + 0.01 * border;
            const double v = 1.98 * rig_unit(7, 3 * (uint64_t)k + 2) - 0.99;
            rig_direct(&rig, k & 1 ? u : v, 1.0, k & 1 ? v : u);
        }
        look_both_ways(&rig, 0, &naive, &ours);
        snprintf(regime, sizeof regime, "edges %g beside the borders of cells", BESIDE[i]);
        table_row(regime, "a map without a pad", naive.triangles, ours.triangles, 0.0, "wrong triangles");
        rig_close(&rig);
        mesh_free(&mesh);
    }
    table_check();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_edges_of_corners),
        cmocka_unit_test(test_no_doubts),
        cmocka_unit_test(test_no_pad),
    };
    table_head("stability: what a standing station sees");
    return cmocka_run_group_tests(tests, NULL, NULL);
}
