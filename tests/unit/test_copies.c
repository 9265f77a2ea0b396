/* SPDX-License-Identifier: MIT */
/* Copies of meshes in a BVH against the same triangles written out. Hits, labels and incidences are the same. */
#include <math.h>

#include "core/bvh/bvh_inside.h"
#include "core/pose.h"
#include "core/scene_copies.h"
#include "core/vec3.h"
#include "tests/common/made.h"
#include "tests/unit/scene_files.h"

enum { RAYS = 4096, PLACES = 40 };

static uint64_t state_now;

static double next(double lo, double hi)
{
    state_now = state_now * UINT64_C(6364136223846793005) + UINT64_C(1442695040888963407);
    return lo + (hi - lo) * (double)(state_now >> 11) * 0x1p-53;
}

/* Two boxes, one on the other, closed. Many copies share their faces with the ground. */
static const char TREE[] = "o trunk\nv -0.1 -0.1 0\nv 0.1 -0.1 0\nv 0.1 0.1 0\nv -0.1 0.1 0\n"
                           "v -0.1 -0.1 2\nv 0.1 -0.1 2\nv 0.1 0.1 2\nv -0.1 0.1 2\n"
                           "f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf 2 3 7 6\nf 3 4 8 7\nf 4 1 5 8\n"
                           "o crown\nv -1 -0.5 2\nv 1 -0.5 2\nv 1 0.5 2\nv -1 0.5 2\n"
                           "v -0.4 -0.3 4\nv 0.4 -0.3 4\nv 0.4 0.3 4\nv -0.4 0.3 4\n"
                           "f 12 11 10 9\nf 13 14 15 16\nf 9 10 14 13\nf 10 11 15 14\nf 11 12 16 15\nf 12 9 13 16\n";
static const char GROUND[] = "o ground\nv -50 -50 0\nv 50 -50 0\nv 50 50 0\nv -50 50 0\nf 1 2 3 4\n";

struct pair {
    struct scene *scene[2]; /* with copies, and written out */
    struct bvh *bvh[2];
};

static void scatter(struct scene_place place[PLACES], const double middle_m[3])
{
    for (int i = 0; i < PLACES; i++)
        place[i] = (struct scene_place){.at_m = {middle_m[0] + next(-30, 30), middle_m[1] + next(-30, 30), middle_m[2]},
                                        .turn_deg = next(-360, 360),
                                        .scale = exp(next(-1, 1))};
}

static struct scene *load_one(struct scene_place *place, size_t n, int own_surfaces, const double middle_m[3])
{
    char tree[128], ground[128];
    struct scene *scene;
    struct sh_err err;
    snprintf(tree, sizeof tree, "%s", write_text("tree.obj", TREE));
    snprintf(ground, sizeof ground, "%s", write_text("ground.obj", GROUND));
    const struct scene_mesh_spec spec[2] = {
        {.file = tree, .scale = 1, .places = {.place = place, .n = n, .own_surfaces = own_surfaces, .says = "places"}},
        {.file = ground, .scale = 1, .offset_m = {middle_m[0], middle_m[1], middle_m[2]}}};
    const int rc = scene_load(spec, 2, 1e-3, NULL, &scene, &err);
    unlink(tree);
    unlink(ground);
    if (rc != SH_OK) fail_msg("%s", err.text);
    return scene;
}

static void open_pair(struct pair *p, struct scene_place *place, size_t n, int own_surfaces, const double middle_m[3])
{
    struct sh_err err;
    for (int k = 0; k < 2; k++)
        p->scene[k] = load_one(place, n, own_surfaces, middle_m);
    assert_int_equal(p->scene[0]->n_copies, n);
    if (scene_write_out_copies(p->scene[1], UINT32_MAX, NULL, &err) != SH_OK) fail_msg("%s", err.text);
    assert_int_equal(p->scene[1]->n_triangles, p->scene[0]->n_all);
    for (int k = 0; k < 2; k++)
        if (bvh_create(p->scene[k], 1, NULL, &p->bvh[k], &err) != SH_OK) fail_msg("%s", err.text);
}

static void close_pair(struct pair *p)
{
    for (int k = 0; k < 2; k++) {
        bvh_free(p->bvh[k]);
        scene_free(p->scene[k]);
    }
}

static double x[RAYS], y[RAYS], z[RAYS], dx[RAYS], dy[RAYS], dz[RAYS];
static double range_m[2][RAYS], cosine[2][RAYS];
static uint32_t triangle[2][RAYS], label[2][RAYS];
static float steep[2][RAYS];

/* With from_own each ray begins elsewhere, some of them within a copy. */
static void cast(const struct pair *p, const double middle_m[3], int from_own, uint32_t packet)
{
    const double at[3] = {middle_m[0] + next(-20, 20), middle_m[1] + next(-20, 20), middle_m[2] + next(0.5, 5)};
    for (int i = 0; i < RAYS; i++) {
        double d[3] = {next(-1, 1), next(-1, 1), next(-0.3, 0.3)};
        const double length = vec3_length(d);
        for (int k = 0; k < 3; k++)
            d[k] /= length;
        dx[i] = d[0], dy[i] = d[1], dz[i] = d[2];
        x[i] = middle_m[0] + next(-35, 35), y[i] = middle_m[1] + next(-35, 35), z[i] = middle_m[2] + next(0.1, 6);
    }
    struct bvh_work *work = made_bvh_work();
    for (int k = 0; k < 2; k++) {
        if (packet != 0) bvh_set_packet(p->bvh[k], packet);
        struct bvh_rays rays = {.n = RAYS,
                                .from.at_m = {at[0], at[1], at[2]},
                                .dir = {dx, dy, dz},
                                .range_max_m = 1000,
                                .range_m = range_m[k],
                                .triangle = triangle[k],
                                .label = label[k],
                                .steep = from_own ? NULL : steep[k]};
        if (from_own) rays.from.own = (struct vec3_in){x, y, z};
        bvh_hits(work, p->bvh[k], &rays);
        bvh_cosines(p->bvh[k], triangle[k], &rays.dir, RAYS, cosine[k]);
    }
    bvh_work_free(work);
}

/* Corners are written out with an error of 2^-53 of the coordinates. A plane tilts by that error over its least edge,
 * 0.07 m, and rays are up to 100 m long. A ray at a smaller sine than 0.01 is left out. */
static void compare(const double middle_m[3], uint32_t least_hits)
{
    const double rounding_m = 0x1p-53 * (fabs(middle_m[0]) + fabs(middle_m[1]) + fabs(middle_m[2]) + 200.0);
    const double most_m = 100.0 * 8.0 * rounding_m * 100.0 / 0.07;
    uint32_t hits = 0, elsewhere = 0;
    for (int i = 0; i < RAYS; i++) {
        assert_int_equal(isnan(range_m[0][i]), isnan(range_m[1][i]));
        if (isnan(range_m[0][i])) {
            assert_int_equal(triangle[0][i], BVH_NO_TRIANGLE);
            assert_int_equal(label[0][i], BVH_NO_LABEL);
            continue;
        }
        hits++;
        if (cosine[1][i] < 0.01) continue;
        assert_true(fabs(range_m[0][i] - range_m[1][i]) <= most_m);
        if (triangle[0][i] != triangle[1][i]) {
            elsewhere++;
            continue;
        }
        assert_int_equal(label[0][i], label[1][i]);
        assert_true(fabs(cosine[0][i] - cosine[1][i]) < 1e-6);
    }
    assert_true(hits >= least_hits);
    assert_true(elsewhere <= hits / 500); /* trunks end where crowns begin, and stand on the ground */
}

static void copies_are_what_they_are_written_out(void **state)
{
    (void)state;
    static const double middle[][3] = {{0, 0, 0}, {500000.0, 5400000.0, 300.0}, {-1e7, 1e7, 1000.0}};
    static const uint32_t packets[] = {0, 1, 4, 8};
    struct scene_place place[PLACES];
    for (size_t m = 0; m < sizeof middle / sizeof *middle; m++)
        for (int own = 0; own < 2; own++) {
            struct pair p;
            state_now = 17 * m + (uint64_t)own;
            scatter(place, middle[m]);
            open_pair(&p, place, PLACES, own, middle[m]);
            for (size_t k = 0; k < sizeof packets / sizeof *packets; k++)
                for (int from_own = 0; from_own < 2; from_own++) {
                    cast(&p, middle[m], from_own, packets[k]);
                    compare(middle[m], RAYS / 4);
                }
            close_pair(&p);
        }
}

/* Steepness is compared for rays from one point. If it is large, its rounding is large, too. */
static void incidence_is_the_same(void **state)
{
    (void)state;
    static const double here[3] = {0, 0, 0};
    struct scene_place place[PLACES];
    struct pair p;
    state_now = 5;
    scatter(place, here);
    open_pair(&p, place, PLACES, 0, here);
    cast(&p, here, 0, 0);
    for (int i = 0; i < RAYS; i++)
        if (triangle[0][i] == triangle[1][i] && !isnan(range_m[0][i]) && cosine[0][i] > 0.01)
            assert_true(fabs((double)steep[0][i] / (double)steep[1][i] - 1.0) < 1e-5);
    close_pair(&p);
}

/* Three copies are at one place. The first is the hit, in whatever order Embree finds them. */
static void the_first_of_equal_copies_is_hit(void **state)
{
    (void)state;
    static const double here[3] = {0, 0, 0};
    struct scene_place place[3];
    struct pair p;
    state_now = 3;
    for (int i = 0; i < 3; i++)
        place[i] = (struct scene_place){.at_m = {3, 4, 0}, .turn_deg = 33, .scale = 1.5};
    open_pair(&p, place, 3, 1, here);
    for (int from_own = 0; from_own < 2; from_own++) {
        uint32_t met = 0;
        cast(&p, here, from_own, 0);
        for (int i = 0; i < RAYS; i++) {
            if (triangle[0][i] < 2 || triangle[0][i] == BVH_NO_TRIANGLE) continue;
            assert_true(triangle[0][i] < 2 + 24);
            assert_true(label[0][i] == 1 || label[0][i] == 2);
            met++;
        }
        assert_true(met > 5);
    }
    close_pair(&p);
}

/* Rays in the plane of the crown's lower edge pass it without any rounding. Each such pair of ray and triangle is
 * counted, in a copy as in a mesh. */
static void pairs_at_edges_are_counted(void **state)
{
    (void)state;
    static const double here[3] = {0, 0, 0};
    struct scene_place place = {.at_m = {8, 4, 0}, .scale = 1};
    struct pair p;
    uint64_t decided[2];
    open_pair(&p, &place, 1, 0, here);
    for (int i = 0; i < 64; i++) {
        const double d[3] = {(i - 32) / 64.0, 3.5, 0}, length = vec3_length(d);
        dx[i] = d[0] / length, dy[i] = d[1] / length, dz[i] = 0;
    }
    for (int k = 0; k < 2; k++) {
        struct bvh_work *work = made_bvh_work();
        struct bvh_rays rays = {.n = 64,
                                .from.at_m = {8, 0, 2},
                                .dir = {dx, dy, dz},
                                .range_max_m = 1000,
                                .range_m = range_m[k],
                                .triangle = triangle[k]};
        bvh_hits(work, p.bvh[k], &rays);
        decided[k] = bvh_work_counters(work)->decided;
        assert_true(bvh_work_counters(work)->leaves >= 1 && bvh_work_counters(work)->leaves <= 64 * 26);
        for (int i = 0; i < 64; i++)
            assert_true(fabs(range_m[k][i] * dy[i] - 3.5) < 1e-12);
        bvh_work_free(work);
    }
    for (int k = 0; k < 2; k++) /* each ray with one triangle at least, and with all of both meshes at most */
        assert_true(decided[k] >= 64 && decided[k] <= 64 * 26);
    close_pair(&p);
}

/* A copy turns in the same sense as a body that turns. */
static void a_copy_turns_clockwise(void **state)
{
    (void)state;
    const double turn = 0.7, v[3] = {1, 2, 3};
    const struct scene_copy copy = {.cosine = cos(turn), .sine = sin(turn), .scale = 2, .shift_m = {10, 20, 30}};
    double rotation[9], p[3], back[3];
    pose_heading(turn, rotation);
    scene_copy_put(&copy, v, p);
    scene_copy_put_back(&copy, p, back);
    for (int k = 0; k < 3; k++) {
        assert_true(fabs(p[k] - (2 * vec3_dot(rotation + 3 * k, v) + copy.shift_m[k])) < 1e-14 * 40);
        assert_true(fabs(back[k] - v[k]) < 1e-14 * 40);
    }
}

static void bounds_are_exact(void **state)
{
    (void)state;
    static const double here[3] = {0, 0, 0};
    struct scene_place place[PLACES];
    struct pair p;
    state_now = 11;
    scatter(place, here);
    memcpy(place[0].at_m, ((const double[3]){-300, 200, 10}), sizeof place[0].at_m); /* the outermost two */
    memcpy(place[PLACES - 1].at_m, ((const double[3]){100, -400, 70}), sizeof place[0].at_m);
    double all_lo[3] = {-50, -50, 0}, all_hi[3] = {50, 50, 0}; /* the ground */
    open_pair(&p, place, PLACES, 0, here);
    for (uint32_t k = 0; k < PLACES; k++) {
        const struct scene_copy *copy = &p.scene[0]->copied[0].copy[k];
        double lo[3] = {INFINITY, INFINITY, INFINITY}, hi[3] = {-INFINITY, -INFINITY, -INFINITY};
        for (uint32_t t = 2 + 24 * k; t < 2 + 24 * (k + 1); t++)
            for (int c = 0; c < 9; c++) {
                const double at = p.scene[1]->vertex_m[p.scene[1]->triangle[t][c / 3]][c % 3];
                lo[c % 3] = fmin(lo[c % 3], at);
                hi[c % 3] = fmax(hi[c % 3], at);
            }
        for (int i = 0; i < 3; i++) {
            assert_true(copy->min_m[i] == lo[i] && copy->max_m[i] == hi[i]);
            all_lo[i] = fmin(all_lo[i], lo[i]);
            all_hi[i] = fmax(all_hi[i], hi[i]);
        }
    }
    assert_memory_equal(p.scene[0]->min_m, all_lo, sizeof all_lo);
    assert_memory_equal(p.scene[0]->max_m, all_hi, sizeof all_hi);
    close_pair(&p);
}

/* The plane of a triangle of a copy has the triangle's corners on it, and a normal of twice its area (core/bvh.h).
 * Rounding: corners of up to 100 m. */
static void planes_of_copies(void **state)
{
    (void)state;
    static const double here[3] = {0, 0, 0};
    struct scene_place place[PLACES];
    struct pair p;
    state_now = 12;
    scatter(place, here);
    open_pair(&p, place, PLACES, 0, here);
    const double *origin_m = bvh_origin(p.bvh[0]);
    assert_int_equal(scene_n_kept(p.scene[0]), 2 + 24); /* the ground, and one tree */
    for (uint32_t t = 0; t < p.scene[0]->n_all; t++) {
        struct bvh_plane plane;
        double corner[3][3], n[3];
        bvh_get_plane(p.bvh[0], t, &plane);
        for (int c = 0; c < 3; c++)
            vec3_sub(p.scene[1]->vertex_m[p.scene[1]->triangle[t][c]], origin_m, corner[c]);
        vec3_normal(corner[0], corner[1], corner[2], n);
        const double twice_area = vec3_length(n);
        assert_true(vec3_distance(plane.n, n) < 1e-11 * (1.0 + twice_area));
        for (int c = 0; c < 3; c++)
            assert_true(fabs(vec3_dot(plane.n, corner[c]) - plane.d) < 1e-11 * (1.0 + 100.0 * twice_area));
    }
    close_pair(&p);
}

static void names_say_which_copy(void **state)
{
    (void)state;
    static const double here[3] = {0, 0, 0};
    struct scene_place place[PLACES];
    state_now = 11;
    scatter(place, here);
    struct scene *scene = load_one(place, PLACES, 1, here);
    assert_int_equal(scene->n_surfaces, 1 + 2 * PLACES);
    assert_string_equal(scene->surface[0].object, "ground");
    assert_string_equal(scene->surface[1].object, "trunk 1");
    assert_string_equal(scene->surface[2 * PLACES].object, "crown 40");
    assert_int_equal(scene_label(scene, scene->n_all - 1), 2 * PLACES);
    scene_free(scene);
}

/* Parts left out of a mesh that has copies are counted once, and added to the others' counts. Each copy counts as a
 * mesh. */
static void counts_of_copied_meshes(void **state)
{
    (void)state;
    static const char part[] = "a_name_that_is_longer_than_it_may_be_"; /* eight times */
    static const char rest[] = "\nv 0 0 0\nv 1 0 0\nv 1 1 0\nf 1 2 3\nf 1 2 2\nl 1 2\nl 2 3\n";
    char text[1024], file[2][128], *p = text;
    struct scene *s;
    struct sh_err err;
    struct scene_place place[3] = {{.scale = 1}, {.at_m = {5, 0, 0}, .scale = 2}, {.at_m = {9, 0, 0}, .scale = 0.5}};
    p = stpcpy(p, "o ");
    for (int i = 0; i < 8; i++)
        p = stpcpy(p, part);
    stpcpy(p, rest);
    for (int i = 0; i < 2; i++)
        snprintf(file[i], sizeof file[i], "%s", write_text(i == 0 ? "tree.obj" : "ground.obj", text));
    const struct scene_mesh_spec spec[2] = {
        {.file = file[0], .scale = 1, .places = {.place = place, .n = 3, .says = "p"}}, {.file = file[1], .scale = 1}};
    if (scene_load(spec, 2, 1e-3, NULL, &s, &err) != SH_OK) fail_msg("%s", err.text);
    assert_true(s->counts.zero_area == 2 && s->counts.not_triangles == 4 && s->counts.names_cut == 2);
    assert_true(s->n_meshes == 4 && s->n_copies == 3 && s->n_copied == 1 && s->n_all == 4 && s->n_surfaces == 2);
    scene_free(s);
    for (int i = 0; i < 2; i++)
        unlink(file[i]);
}

/* The memory of a BVH is Embree's and its own. The own part grows by an element for each copy. */
static void copies_take_memory(void **state)
{
    (void)state;
    struct scene_place place[PLACES];
    struct bvh_info info;
    struct sh_err err;
    int64_t own[2];
    scatter(place, (const double[3]){0, 0, 0});
    for (int k = 0; k < 2; k++) {
        struct scene *scene = load_one(place, k == 0 ? 2 : PLACES, 0, (const double[3]){0, 0, 0});
        struct bvh *bvh;
        if (bvh_create(scene, 1, NULL, &bvh, &err) != SH_OK) fail_msg("%s", err.text);
        info = *bvh_get_info(bvh);
        own[k] = (int64_t)info.bytes - bvh->bytes;
        bvh_free(bvh);
        scene_free(scene);
    }
    assert_int_equal(own[1] - own[0], (PLACES - 2) * sizeof(struct bvh_copy));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(copies_are_what_they_are_written_out),
        cmocka_unit_test(incidence_is_the_same),
        cmocka_unit_test(the_first_of_equal_copies_is_hit),
        cmocka_unit_test(pairs_at_edges_are_counted),
        cmocka_unit_test(a_copy_turns_clockwise),
        cmocka_unit_test(bounds_are_exact),
        cmocka_unit_test(planes_of_copies),
        cmocka_unit_test(names_say_which_copy),
        cmocka_unit_test(counts_of_copied_meshes),
        cmocka_unit_test(copies_take_memory),
    };
    return cmocka_run_group_tests_name("copies", tests, make_folder, remove_folder);
}
