/* SPDX-License-Identifier: MIT */
/* A head that moves. The naive ways hold the pose for a line or a tick, or cut its path short. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/cast.h"
#include "core/pose.h"
#include "core/vec3.h"
#include "tests/stability/rig.h"

enum { LINES = 100, LINE_PULSES = 3000, KNOTS = 102 };

static const double RATE = 1.0, SPEED_M_S = 10.0; /* a car in a bend of 10 m */

/* Gives the pose on the circle at t, leaning with its road. */
static void car_at(double t, struct pose *pose)
{
    const double r = SPEED_M_S / RATE;
    *pose = (struct pose){.position_m = {r * cos(RATE * t), r * sin(RATE * t), 0.3 * sin(3.0 * t)}};
    pose_from_angles(-RATE * t, 0.05 * cos(3.0 * t), 0.08 * sin(2.0 * t), pose->quat);
}

static void place(const struct pose *pose, const double socs[3], double range_m, double out[3])
{
    pose_rotate(pose->quat, socs, out);
    for (int i = 0; i < 3; i++)
        out[i] = pose->position_m[i] + range_m * out[i];
}

struct ride {
    double ours_m, line_m, tick_m; /* farthest distance of a point from where the true ray meets the mesh */
    uint64_t pulses, leaks;
};

static void look_at_line(const struct cast_setup *setup, const struct schedule_segment *seg,
                         const struct schedule_line *line, const struct line_block *block,
                         const struct reference *reference, struct ride *ride)
{
    for (uint32_t j = 0; j < block->n_points; j++) {
        ride->pulses++;
        ride->leaks += block->echo[j] == 0; /* the ball is closed */
        if (j % 37 != 0 || block->echo[j] == 0) continue;
        uint64_t k = line->cast0 + j;
        double mirror = schedule_mirror_turn(seg, k) * 2 * M_PI, pan = schedule_pan_turn(seg, k) * 2 * M_PI;
        const double socs[3] = {sin(pan) * cos(mirror), cos(pan) * cos(mirror), sin(mirror)};
        int64_t t_ns = schedule_time_ns(seg, k), knot_ns = setup->knot[1].t_ns;
        const struct pose_knot *a = &setup->knot[t_ns / knot_ns];
        struct pose truth, of_line, of_tick;
        double dir[3], want[3], got[3], range_m = block->a[j] * setup->range_scale_m;
        pose_between(&a->pose, &a[1].pose, (double)(t_ns - a->t_ns) / (double)knot_ns, &truth);
        pose_rotate(truth.quat, socs, dir);
        struct reference_hit hit = reference_cast(reference, truth.position_m, dir);
        place(&truth, socs, (double)hit.range_m, want);
        place(&truth, socs, range_m, got);
        ride->ours_m = fmax(ride->ours_m, vec3_distance(want, got));
        int64_t line_ns = line->begin_ns, tick_ns = t_ns - t_ns % 1000000;
        const struct pose_knot *l = &setup->knot[line_ns / knot_ns], *t = &setup->knot[tick_ns / knot_ns];
        pose_between(&l->pose, &l[1].pose, (double)(line_ns - l->t_ns) / (double)knot_ns, &of_line);
        pose_between(&t->pose, &t[1].pose, (double)(tick_ns - t->t_ns) / (double)knot_ns, &of_tick);
        place(&of_line, socs, range_m, got);
        ride->line_m = fmax(ride->line_m, vec3_distance(want, got));
        place(&of_tick, socs, range_m, got);
        ride->tick_m = fmax(ride->tick_m, vec3_distance(want, got));
    }
}

static void drive(struct ride *ride)
{
    static struct pose_knot knot[KNOTS];
    static const double centre[3] = {0, 0, 0}, middle[3] = {8.5, 4.5, 0};
    struct mesh mesh = {0};
    struct rig rig;
    struct line_block block;
    struct sh_err err;
    mesh_sphere(&mesh, centre, 40.0, 0.02, 6, 1);
    rig_open(&rig, mesh_scene(&mesh), middle);
    assert_int_equal(line_block_alloc(&block, LINE_PULSES + 16, &err), SH_OK);
    for (int i = 0; i < KNOTS; i++) {
        knot[i].t_ns = 10000000 * (int64_t)i;
        car_at(0.01 * i, &knot[i].pose);
    }
    struct cast_setup setup = {.bvh = rig.bvh,
                               .range_max_m = 200.0,
                               .mirror_counts = 0x1p32,
                               .pan_counts = 0x1p32,
                               .layout = LINE_POLAR,
                               .range_scale_m = 1e-7,
                               .n_knots = KNOTS,
                               .knot = knot};
    struct schedule_spec spec = {.prr_uhz = 300000000000,
                                 .lines_uhz = 100000000,
                                 .fov_min_udeg = -180000000,
                                 .sweep_udeg = 360000000,
                                 .line_start_udeg = -180000000,
                                 .line_stop_udeg = 180000000};
    struct schedule_segment seg;
    schedule_start(&seg, &spec);
    for (uint64_t n = 0; n < LINES; n++) {
        struct schedule_line line;
        struct schedule_run run;
        schedule_get_line(&seg, n, &line);
        schedule_get_run(&seg, &line, line.cast0, (uint32_t)(line.cast_end - line.cast0), &run);
        caster_cast(rig.caster, &setup, &run, &block);
        look_at_line(&setup, &seg, &line, &block, rig.reference, ride);
    }
    line_block_free(&block);
    rig_close(&rig);
    mesh_free(&mesh);
}

/* A line head of 100 lines/s in a car. Ours: ranges are whole counts of 1e-7 m, and rounding is half of one. */
static void test_pose_of_each_pulse(void **state)
{
    (void)state;
    struct ride ride = {0};
    drive(&ride);
    table_row("car, 10 m/s in a bend of 10 m, 40 m away", "one pose per line of 10 ms", ride.line_m, ride.ours_m, 1e-6,
              "m");
    table_row("the same", "one pose per tick of 1 ms", ride.tick_m, ride.ours_m, 1e-6, "m");
    table_note("%llu pulses in a closed ball, %llu slipped through", (unsigned long long)ride.pulses,
               (unsigned long long)ride.leaks);
    assert_int_equal(ride.leaks, 0);
    table_check();
}

/* A trajectory of 10 Hz, as a navigation filter gives it. Between its samples the way goes by chords, or by the cubic.
 * The bound is that of tests/unit/test_pose.c, R (rate step)^3 / 62 horizontally, and as much again for the climb. */
static void test_between_samples(void **state)
{
    (void)state;
    enum { N = 101 };
    struct pose_sample s[N];
    struct trajectory *tr;
    struct sh_err err;
    double chord_m = 0, cubic_m = 0, frame;
    for (int i = 0; i < N; i++) {
        s[i] = (struct pose_sample){.t_s = 0.1 * i};
        car_at(s[i].t_s, &s[i].pose);
    }
    assert_int_equal(trajectory_from_samples(s, N, &tr, &err), SH_OK);
    for (double t = 0.1; t < 9.9; t += 0.0013) {
        struct pose want, got;
        int i = (int)(t / 0.1);
        car_at(t, &want);
        trajectory_at(tr, t, &got, &frame);
        cubic_m = fmax(cubic_m, vec3_distance(want.position_m, got.position_m));
        pose_between(&s[i].pose, &s[i + 1].pose, (t - s[i].t_s) / 0.1, &got);
        chord_m = fmax(chord_m, vec3_distance(want.position_m, got.position_m));
    }
    trajectory_free(tr);
    table_row("trajectory of 10 Hz, the same car", "straight between samples", chord_m, cubic_m,
              2.0 * 10.0 * 1e-3 / 62.0, "m");
    table_check();
}

int main(void)
{
    table_head("a head that moves: error of points and poses");
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_pose_of_each_pulse),
        cmocka_unit_test(test_between_samples),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
