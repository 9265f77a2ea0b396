/* SPDX-License-Identifier: MIT */
/* Moving heads among moving bodies. Scenes are odd ones (odd_scenes.h), some of them at UTM. Up to three bodies turn
 * and shift, each an odd scene of its own, and a head moves through all of it. The caster's points are compared with
 * the reference in long double, which has the bodies' triangles where they are at the time.
 *
 * MOVING_SCENES: how many (default 200, THOROUGH=1: 1000). */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/cast.h"
#include "core/pose.h"
#include "core/rng.h"
#include "core/vec3.h"
#include "tests/common/cases.h"
#include "tests/common/odd_judge.h"
#include "tests/common/odd_scenes.h"
#include "tests/common/thorough.h"

enum { PULSES = 1024, RUNS = 8, BODIES = 3, KNOTS = 9, STILL = 40, OF_A_BODY = 30 };

/* A count of the range. Labels count on: those of body k follow the scene's. */
static const double COUNT_M = 1e-7;
_Static_assert(STILL + BODIES * OF_A_BODY <= ODD_MOST, "all of it in one scene");

/* A scene, its BVH, and a body's pose. */
struct part {
    struct odd_scene odd;
    struct scene *scene;
    struct bvh *bvh;
};

struct stage {
    struct part still, body[BODIES];
    uint32_t n_bodies;
    double at_m[3], size_m; /* bodies and head move around this place */
    struct pose_knot knot[KNOTS];
    struct cast_setup setup;
};

static int open_part(uint64_t number, uint32_t at_most, uint32_t label, const double shift_m[3], struct part *part)
{
    struct sh_err err;
    odd_scene_make(number, at_most, &part->odd);
    for (uint32_t i = 0; i < 3 * part->odd.n; i++)
        vec3_add(part->odd.corner[i / 3][i % 3], shift_m, part->odd.corner[i / 3][i % 3]);
    vec3_add(part->odd.station_m, shift_m, part->odd.station_m);
    if (odd_scene_build(&part->odd, number % 2 == 0, &part->scene, &err) != SH_OK) return 0; /* all without area */
    for (uint32_t i = 0; i < part->scene->n_triangles; i++)
        part->scene->label[i] = (uint16_t)(part->scene->label[i] + label);
    part->scene->label0 = label;
    assert_int_equal(bvh_create(part->scene, 1, NULL, &part->bvh, &err), SH_OK);
    return 1;
}

static void close_part(struct part *part)
{
    if (part->bvh != NULL) bvh_free(part->bvh);
    if (part->scene != NULL) scene_free(part->scene);
    memset(part, 0, sizeof *part);
}

/* The head moves about the station by up to a fifth of the scene, and turns. */
static void draw_path(struct stage *stage, uint64_t *random)
{
    for (int i = 0; i < KNOTS; i++) {
        struct pose *pose = &stage->knot[i].pose;
        stage->knot[i].t_ns = 1000000 * (int64_t)i;
        for (int k = 0; k < 3; k++)
            pose->position_m[k] = stage->at_m[k] + 0.2 * stage->size_m * (2.0 * case_unit(random) - 1.0);
        pose_from_angles(0.3 * i + 0.2 * case_unit(random), case_unit(random) - 0.5, case_unit(random) - 0.5,
                         pose->quat);
    }
}

static int open_stage(uint64_t number, struct stage *stage)
{
    static const double UTM_M[3] = {391431.9, 5819708.6, 110.3}, nowhere[3] = {0};
    uint64_t random = rng_mix(number + 0x30b) | 1;
    memset(stage, 0, sizeof *stage);
    if (!open_part(number, STILL, 0, number % 3 == 2 ? UTM_M : nowhere, &stage->still)) return 0;
    memcpy(stage->at_m, stage->still.odd.station_m, sizeof stage->at_m);
    stage->size_m = fmin(1e3, vec3_distance(stage->still.scene->max_m, stage->still.scene->min_m));
    for (int i = (int)case_between(&random, 0, BODIES); i > 0; i--)
        stage->n_bodies +=
            (uint32_t)open_part(number * BODIES + (uint64_t)i, OF_A_BODY, ODD_LABELS * (1 + stage->n_bodies), nowhere,
                                &stage->body[stage->n_bodies]);
    draw_path(stage, &random);
    stage->setup = (struct cast_setup){.bvh = stage->still.bvh,
                                       .range_max_m = 400.0, /* 32 bits of counts hold that range */
                                       .mirror_counts = 0x1p32,
                                       .pan_counts = 0x1p32,
                                       .layout = LINE_POLAR,
                                       .range_scale_m = COUNT_M,
                                       .n_movers = stage->n_bodies,
                                       .n_knots = KNOTS,
                                       .knot = stage->knot};
    return 1;
}

static void close_stage(struct stage *stage)
{
    close_part(&stage->still);
    for (int i = 0; i < BODIES; i++)
        close_part(&stage->body[i]);
}

/* Moves each body to another pose: it stands about the head's path, in a random attitude. */
static void move_bodies(struct stage *stage, uint64_t *random)
{
    for (uint32_t k = 0; k < stage->n_bodies; k++) {
        struct cast_mover *m = &stage->setup.mover[k];
        const struct scene *scene = stage->body[k].scene;
        struct pose pose;
        pose_from_angles(6.3 * case_unit(random), 3.0 * case_unit(random) - 1.5, 6.3 * case_unit(random), pose.quat);
        for (int i = 0; i < 3; i++) {
            double axis[3] = {0}, turned[3];
            axis[i] = 1.0;
            pose_rotate(pose.quat, axis, turned);
            for (int j = 0; j < 3; j++)
                m->rotation[3 * j + i] = turned[j];
            m->centre_m[i] = 0.5 * (scene->min_m[i] + scene->max_m[i]);
            m->shift_m[i] = stage->at_m[i] + 0.5 * stage->size_m * (2.0 * case_unit(random) - 1.0) - m->centre_m[i];
        }
        m->bvh = stage->body[k].bvh;
        m->radius_m = 0.5 * vec3_distance(scene->min_m, scene->max_m) * (1.0 + 1e-9) + 1e-6;
    }
}

/* Makes one scene of all triangles where they are. */
static struct scene *all_of(const struct stage *stage)
{
    static struct odd_scene all;
    struct scene *scene;
    struct sh_err err;
    all.n = 0;
    for (uint32_t k = 0; k <= stage->n_bodies; k++) {
        const struct scene *from = k == 0 ? stage->still.scene : stage->body[k - 1].scene;
        const struct cast_mover *m = k == 0 ? NULL : &stage->setup.mover[k - 1];
        for (uint32_t i = 0; i < from->n_triangles; i++, all.n++) {
            all.label[all.n] = (uint16_t)k;
            for (int c = 0; c < 3; c++)
                for (int j = 0; j < 3; j++) {
                    const double *p = from->vertex_m[from->triangle[i][c]];
                    long double sum = m == NULL ? (long double)p[j] : (long double)m->shift_m[j];
                    for (int a = 0; m != NULL && a < 3; a++)
                        sum += (long double)m->rotation[3 * j + a] * p[a];
                    all.corner[all.n][c][j] = (double)sum;
                }
        }
    }
    assert_int_equal(odd_scene_build(&all, 0, &scene, &err), SH_OK);
    return scene;
}

/* The bound is half a count, 16 roundings of the range over a cosine of incidence of 0.001, and the error of
 * coordinates at UTM, 1e-9 m, over a cosine of 0.05. */
static double bound_m(long double range_m)
{
    return 0.5 * COUNT_M + 16.0 * 0x1p-53 * 1e3 * (double)range_m + 20.0 * 1e-9;
}

/* Returns whether an echo has the label of a part that is as near as the nearest. */
static int is_of_a_nearest(const struct scene *scene, const struct reference *reference, const struct odd_shot *shot,
                           uint32_t part)
{
    const struct reference_hit truth = reference_brute(reference, shot->at_m, shot->dir);
    uint32_t first = 0, n = 0;
    if (truth.triangle != REFERENCE_NONE && scene->label[truth.triangle] == part) return 1;
    while (first < scene->n_triangles && scene->label[first] != part)
        first++;
    while (first + n < scene->n_triangles && scene->label[first + n] == part)
        n++;
    struct reference *of_part =
        reference_create((const double(*)[3])scene->vertex_m, (const uint32_t(*)[3])scene->triangle + first, n);
    assert_non_null(of_part);
    const struct reference_hit hit = reference_brute(of_part, shot->at_m, shot->dir);
    reference_free(of_part);
    return reference_error(&hit, (double)truth.range_m) <= bound_m(truth.range_m) - 0.5 * COUNT_M;
}

static void judge_run(const struct stage *stage, const struct schedule_segment *seg, const struct schedule_run *run,
                      const struct line_block *block, struct odd_tally *tally)
{
    uint64_t mislabelled = 0;
    struct scene *scene = all_of(stage);
    struct reference *reference = reference_create((const double(*)[3])scene->vertex_m,
                                                   (const uint32_t(*)[3])scene->triangle, scene->n_triangles);
    assert_non_null(reference);
    for (uint32_t j = 0; j < block->n_points; j++) {
        const uint64_t k = run->pulse0 + j;
        const double mirror = schedule_mirror_turn(seg, k) * 2 * M_PI, pan = schedule_pan_turn(seg, k) * 2 * M_PI;
        const double socs[3] = {sin(pan) * cos(mirror), cos(pan) * cos(mirror), sin(mirror)};
        const int64_t t_ns = schedule_time_ns(seg, k), step_ns = stage->knot[1].t_ns;
        const struct pose_knot *a = &stage->knot[t_ns / step_ns];
        struct pose pose;
        double dir[3];
        pose_between(&a->pose, &a[1].pose, (double)(t_ns - a->t_ns) / (double)step_ns, &pose);
        pose_rotate(pose.quat, socs, dir);
        const struct odd_shot shot = {.at_m = pose.position_m,
                                      .dir = dir,
                                      .range_m = block->echo[j] != 0 ? block->a[j] * COUNT_M : (double)NAN,
                                      .triangle = REFERENCE_NONE,
                                      .most_m = stage->setup.range_max_m};
        if (!odd_judge(scene, reference, &shot, bound_m, tally)) printf("# pulse %llu\n", (unsigned long long)k);
        if (block->echo[j] != 0 && !is_of_a_nearest(scene, reference, &shot, block->label[j] / ODD_LABELS))
            mislabelled++;
    }
    assert_int_equal(mislabelled, 0);
    reference_free(reference);
    scene_free(scene);
}

static void one_stage(uint64_t number, struct caster *caster, struct line_block *block, struct odd_tally *tally)
{
    /* A line of 1,024 pulses, 5 microseconds apart, all around. It is cast in 8 runs, each with other poses of the
     * bodies. */
    static const struct schedule_spec spec = {.prr_uhz = 200000000000,
                                              .lines_uhz = 195312500,
                                              .fov_min_udeg = -180000000,
                                              .sweep_udeg = 360000000,
                                              .line_start_udeg = -180000000,
                                              .line_stop_udeg = 180000000};
    static struct stage stage;
    uint64_t random = rng_mix(number + 0x5ca) | 1;
    struct schedule_segment seg;
    struct schedule_line line;
    if (open_stage(number, &stage)) {
        schedule_start(&seg, &spec);
        schedule_get_line(&seg, 0, &line);
        for (uint64_t at = line.cast0, run_n = 0; run_n < RUNS; run_n++) {
            struct schedule_run run;
            schedule_get_run(&seg, &line, at, PULSES / RUNS, &run);
            move_bodies(&stage, &random);
            caster_cast(caster, &stage.setup, &run, block);
            judge_run(&stage, &seg, &run, block, tally);
            at += run.n;
        }
    }
    close_stage(&stage);
}

static void test_moving_scenes(void **state)
{
    (void)state;
    static struct odd_tally tally;
    const char *asked = getenv("MOVING_SCENES");
    const long scenes = asked != NULL ? atol(asked) : thorough(1000, 200);
    struct caster *caster;
    struct line_block block;
    struct sh_err err;
    assert_int_equal(caster_create(&caster, &err), SH_OK);
    assert_int_equal(line_block_alloc(&block, PULSES, &err), SH_OK);
    for (long i = 0; i < scenes; i++)
        one_stage((uint64_t)i, caster, &block, &tally);
    line_block_free(&block);
    caster_free(caster);
    assert_int_equal(odd_print("moving", &tally), 0);
    assert_true(tally.hits > tally.rays / 8);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_moving_scenes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
