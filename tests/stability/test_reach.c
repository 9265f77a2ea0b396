/* SPDX-License-Identifier: MIT */
/* The cost of a ray hardly depends on where it begins, or on how large the scene around a body is. Cost is counted in
 * leaves that a packet is tested against, and in triangles that are decided one by one. No clock is read.
 *
 * Some casts widen their float triangles for the head's place: by a margin over the cosine of incidence from there. At
 * a ball of 5,120 triangles such a cast took 2,000 times as long for a ray from 800 m away as from beside it. */
#include <math.h>
#include <string.h>

#include "core/bvh.h"
#include "core/vec3.h"
#include "tests/common/made.h"
#include "tests/stability/mesh.h"

enum { RAYS = BVH_CHUNK, PACKET = 16 };
static const double BALL_M = 1.5;

/* This is the cost of a packet. */
struct cost {
    double leaves, decided;
    uint32_t hits;
};

/* A ball on ground that reaches about so far, and further to one side. With 0 there is no ground. */
static struct bvh *ball_on_ground(double ground_m, struct scene **scene)
{
    static const double centre[3] = {0.0, 0.0, 0.0};
    struct mesh mesh = {0};
    mesh_sphere(&mesh, centre, BALL_M, 0.0, 4, 0);
    if (ground_m > 0.0)
        mesh_sheet(&mesh, (const double[3]){-0.7 * ground_m, -0.7 * ground_m, -2.0},
                   (const double[3]){2.0 * ground_m, 0.0, 0.0}, (const double[3]){0.0, 2.0 * ground_m, 0.0}, 1, 1, 1);
    *scene = mesh_scene(&mesh);
    mesh_free(&mesh);
    return made_bvh(*scene);
}

/* Casts lines across the ball, from so far away. With `moves` each ray begins a millimetre beside the one before. */
static struct cost cost_of(const struct bvh *bvh, double from_m, int moves)
{
    static double x[RAYS], y[RAYS], z[RAYS], px[RAYS], py[RAYS], pz[RAYS], range_m[RAYS];
    static uint32_t triangle[RAYS];
    struct cost cost = {.hits = 0};
    struct bvh_work *work = made_bvh_work();
    for (int i = 0; i < RAYS; i++) {
        const double aim[3] = {(i % 32 - 15.5) * 0.05, 0.0, (i / 32 - 15.5) * 0.05};
        const double at[3] = {moves ? 1e-3 * i : 0.0, -from_m, 0.4};
        const double d[3] = {aim[0] - at[0], aim[1] - at[1], aim[2] - at[2]}, length = vec3_length(d);
        px[i] = at[0], py[i] = at[1], pz[i] = at[2];
        x[i] = d[0] / length, y[i] = d[1] / length, z[i] = d[2] / length;
    }
    struct bvh_rays rays = {.n = RAYS,
                            .from.at_m = {px[0], py[0], pz[0]},
                            .dir = {x, y, z},
                            .range_max_m = 1e9,
                            .range_m = range_m,
                            .triangle = triangle};
    if (moves) rays.from.own = (struct vec3_in){px, py, pz};
    bvh_hits(work, bvh, &rays);
    for (int i = 0; i < RAYS; i++)
        cost.hits += fabs(range_m[i] - from_m) < 2.0 * BALL_M + 1e-3;
    cost.leaves = (double)bvh_work_counters(work)->leaves / (RAYS / PACKET);
    cost.decided = (double)bvh_work_counters(work)->decided / RAYS;
    bvh_work_free(work);
    return cost;
}

static struct cost in_scene(double ground_m, double from_m, int moves)
{
    struct scene *scene;
    struct bvh *bvh = ball_on_ground(ground_m, &scene);
    const struct cost cost = cost_of(bvh, from_m, moves);
    bvh_free(bvh);
    scene_free(scene);
    print_message("# ground %6.0f m, from %9.0f m, %s: %.2f leaves a packet, %.4f decided a ray\n", ground_m, from_m,
                  moves ? "moving  " : "standing", cost.leaves, cost.decided);
    assert_int_equal(cost.hits, RAYS);
    return cost;
}

/* The ball's leaves are 0.1 m large. Their boxes are larger by 2 micrometres, wherever rays begin: a ray from far away
 * starts anew near the ball (hits.c). A few rays in a thousand pass an edge there more closely than single precision
 * can tell. */
static void far_away_costs_as_near_by(void **state)
{
    (void)state;
    for (int moves = 0; moves < 2; moves++) {
        const struct cost near = in_scene(0.0, 10.0, moves);
        assert_true(near.leaves >= 1.0 && near.decided < 0.01);
        for (double from_m = 100.0; from_m < 1e7; from_m *= 10.0) {
            const struct cost far = in_scene(0.0, from_m, moves);
            assert_true(far.leaves < 3.0 * near.leaves && far.decided < 0.05);
        }
    }
}

/* On ground of up to 1,000 km boxes are larger by 4 mm, 9 x 2^-24 of the 8 km that a float ray is long. On 1 km they
 * are larger by 1.3 mm, 16 x 2^-24 of the scene's radius. The ball's leaves are 0.1 m large. */
static void ground_around_costs_little(void **state)
{
    (void)state;
    for (int moves = 0; moves < 2; moves++) {
        const struct cost alone = in_scene(0.0, 10.0, moves);
        for (double ground_m = 10.0; ground_m < 2e6; ground_m *= 10.0) {
            const struct cost around = in_scene(ground_m, 10.0, moves);
            assert_true(around.leaves < 1.5 * alone.leaves && around.decided < 0.01);
        }
    }
}

/* Ranges count from the BVH's origin. The origin is among the triangles, even where the file has other vertices. */
static void vertices_of_nothing_do_not_move_the_origin(void **state)
{
    (void)state;
    struct mesh mesh = {0};
    mesh_sphere(&mesh, (const double[3]){0.0, 0.0, 0.0}, BALL_M, 0.0, 2, 0);
    mesh_sheet(&mesh, (const double[3]){-1e5, -1e4, -2.0}, (const double[3]){2e4, 0.0, 0.0},
               (const double[3]){0.0, 2e4, 0.0}, 1, 1, 1);
    for (int i = 0; i < 1000; i++)
        mesh_vertex(&mesh, 1e9, 1e9, 1e9);
    struct scene *scene = mesh_scene(&mesh);
    mesh_free(&mesh);
    struct bvh *bvh = made_bvh(scene);
    const double *origin_m = bvh_origin(bvh);
    for (int i = 0; i < 3; i++)
        assert_true(fabs(origin_m[i]) < 1e3);
    bvh_free(bvh);
    scene_free(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(far_away_costs_as_near_by),
        cmocka_unit_test(ground_around_costs_little),
        cmocka_unit_test(vertices_of_nothing_do_not_move_the_origin),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
