/* SPDX-License-Identifier: MIT */
/* A head that moves while it casts: each pulse has its own origin and direction. The truth is in long double. */
#include "tests/common/hits.h"
#include "tests/unit/cast_rig.h"

#include "core/pose.h"
#include "tests/common/made.h"

static const double LO[3] = {-4.0, -6.0, -1.5}, HI[3] = {5.0, 7.0, 2.5};
static const double CENTRE[3] = {0.0, 0.0, 0.0};

enum { KNOTS = 12 };

/* A jolting ride: 1 m in 81 ms, turning about all axes. */
static void make_knots(struct pose_knot knot[KNOTS])
{
    uint64_t random = 11;
    int64_t t_ns = 0;
    for (int i = 0; i < KNOTS; i++) {
        knot[i] = (struct pose_knot){.t_ns = t_ns};
        for (int k = 0; k < 3; k++)
            knot[i].pose.position_m[k] = 0.1 * i * (k == 0) + 0.2 * (case_unit(&random) - 0.5);
        pose_from_angles(0.3 * i + case_unit(&random), case_unit(&random) - 0.5, case_unit(&random) - 0.5,
                         knot[i].pose.quat);
        t_ns += case_between(&random, 2000000, 14000000);
    }
}

/* Computes the rule of core/pose.h in long double, by the classic formula (sin((1-f)a) qa + sin(fa) qb) / sin a. */
static void true_pose(const struct pose_knot *knot, int n, int64_t t_ns, long double p[3], long double r[9])
{
    int i = 0;
    while (i + 2 < n && knot[i + 1].t_ns <= t_ns)
        i++;
    const struct pose_knot *a = &knot[i], *b = &knot[i + 1];
    long double f = (long double)(t_ns - a->t_ns) / (long double)(b->t_ns - a->t_ns), dot = 0, q[4], norm = 0;
    if (f < 0) f = 0;
    if (f > 1) f = 1;
    for (int k = 0; k < 4; k++)
        dot += (long double)a->pose.quat[k] * (long double)b->pose.quat[k];
    long double sign = dot < 0 ? -1 : 1, angle = acosl(fminl(1, sign * dot));
    for (int k = 0; k < 4; k++) {
        q[k] = angle > 1e-9L ? (sinl((1 - f) * angle) * a->pose.quat[k] + sign * sinl(f * angle) * b->pose.quat[k])
                             : a->pose.quat[k];
        norm += q[k] * q[k];
    }
    norm = sqrtl(norm);
    long double w = q[0] / norm, x = q[1] / norm, y = q[2] / norm, z = q[3] / norm;
    const long double m[9] = {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
                              2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                              2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
    memcpy(r, m, sizeof m);
    for (int k = 0; k < 3; k++)
        p[k] = a->pose.position_m[k] + f * ((long double)b->pose.position_m[k] - a->pose.position_m[k]);
}

/* Writes pulse k's origin and direction in the scene. */
static void true_ray(const struct cast_rig *rig, uint64_t k, double o[3], long double d[3])
{
    long double mirror, pan, s[3], p[3], r[9];
    true_angles(&rig->spec, k, &mirror, &pan);
    true_direction(mirror, pan, 0.0L, s);
    true_pose(rig->setup.knot, (int)rig->setup.n_knots, schedule_time_ns(&rig->segment, k), p, r);
    for (int i = 0; i < 3; i++) {
        o[i] = (double)p[i];
        d[i] = r[3 * i] * s[0] + r[3 * i + 1] * s[1] + r[3 * i + 2] * s[2];
    }
}

static struct cast_rig *open_room(struct pose_knot knot[KNOTS])
{
    struct cast_rig *rig = cast_rig_open(box_scene(LO, HI), CENTRE);
    make_knots(knot);
    rig->setup.knot = knot;
    rig->setup.n_knots = KNOTS;
    return rig;
}

/* From here on the head keeps its attitude: some chunks have legs of both kinds. */
static void go_straight_from(struct pose_knot knot[KNOTS], int from)
{
    for (int i = from + 1; i < KNOTS; i++)
        memcpy(knot[i].pose.quat, knot[from].pose.quat, sizeof knot[i].pose.quat);
}

/* Six lines of 10 ms, which the knots cover. The range is exact to a rounding of 1e-5 m counts; 1e-9 m is for the
 * encoders' arithmetic. If a ray passes within 10 um of an edge of the room, the wall may be either. */
static void expect_room(struct cast_rig *rig, const struct pose_knot knot[KNOTS])
{
    double worst = 0, naive = 0;
    assert_true(knot[KNOTS - 1].t_ns > 60000000);
    for (uint64_t n = 0; n < 6; n++) {
        struct schedule_line line;
        uint32_t echoes = cast_line(rig, n, &line); /* a closed room: nothing slips through */
        assert_int_equal(echoes, rig->block.n_pulses);
        for (uint32_t j = 0; j < rig->block.n_points; j++) {
            double o[3];
            long double d[3], p[3], r[9], s[3], mirror, pan;
            int wall = -1, other = -1;
            true_ray(rig, line.cast0 + j, o, d);
            long double range = box_range(LO, HI, o, d, &wall);
            double got = rig->block.a[j] * 1e-5;
            worst = fmax(worst, fabs(got - (double)range));
            if (rig->block.label[j] != wall) {
                long double near = range + 1e-6L;
                int on_edge = 0;
                for (int i = 0; i < 3; i++)
                    on_edge += fabsl(o[i] + near * d[i] - LO[i]) < 1e-5L || fabsl(o[i] + near * d[i] - HI[i]) < 1e-5L;
                assert_true(on_edge >= 2);
            }
            /* The naive method has one pose per line. */
            true_pose(knot, KNOTS, line.begin_ns, p, r);
            true_angles(&rig->spec, line.cast0 + j, &mirror, &pan);
            true_direction(mirror, pan, 0.0L, s);
            for (int i = 0; i < 3; i++) {
                o[i] = (double)p[i];
                d[i] = r[3 * i] * s[0] + r[3 * i + 1] * s[1] + r[3 * i + 2] * s[2];
            }
            naive = fmax(naive, fabs(got - (double)box_range(LO, HI, o, d, &other)));
        }
    }
    print_message("# room from a jolting head: off by %.2g um of 5 um rounding; with one pose per line %.0f mm\n",
                  1e6 * (worst - 5e-6), 1e3 * naive);
    assert_true(worst < 5e-6 + 1e-9);
    assert_true(naive > 0.1);
}

static void test_room(void **state)
{
    (void)state;
    struct pose_knot knot[KNOTS];
    struct cast_rig *rig = open_room(knot);
    expect_room(rig, knot);
    go_straight_from(knot, 3);
    expect_room(rig, knot);
    cast_rig_close(rig);
}

static uint64_t sum_block(const struct line_block *b, uint32_t from, uint32_t n, uint64_t sum)
{
    for (uint32_t i = from; i < from + n; i++)
        sum = rng_mix(sum + b->a[i]) + rng_mix(b->b[i] ^ (uint64_t)b->c[i] << 32) + b->label[i];
    return sum;
}

/* A line has the same bytes with each width of packets and each cut into runs. */
static void expect_same_bytes(struct cast_rig *rig)
{
    static const uint32_t widths[] = {0, 16, 8, 4, 1}; /* 0: the native one */
    static const uint32_t cuts[] = {RIG_LINE, 16, 2048, 48};
    struct bvh_info info;
    info = *bvh_get_info(rig->bvh);
    uint64_t want = 0;
    for (int w = 0; w < 5; w++) {
        if (widths[w] > info.packet) continue;
        if (widths[w] != 0) bvh_set_packet(rig->bvh, widths[w]);
        for (int c = 0; c < 4; c++) {
            uint64_t sum = 1;
            struct schedule_line line;
            schedule_get_line(&rig->segment, 2, &line);
            for (uint64_t k = line.cast0; k < line.cast_end;) {
                uint64_t n = line.cast_end - k < cuts[c] ? line.cast_end - k : cuts[c];
                cast_some(rig, &line, k, n);
                sum = sum_block(&rig->block, 0, (uint32_t)n, sum);
                k += n;
            }
            if (want == 0) want = sum;
            assert_int_equal(sum, want);
            /* A static cast comes between, which sets the origins of the packets anew. */
            double d[3] = {0, 0, 1}, range;
            uint32_t hit;
            hits_from(rig->caster, rig->bvh, CENTRE, 100.0, 1, &d[0], &d[1], &d[2], &range, &hit);
            assert_true(fabs(range - HI[2]) < 1e-12);
        }
    }
}

/* The pose depends on the pulse's time alone, and not on how runs are cut, on ray packets, or on earlier
 * casts. */
static void test_same_bytes(void **state)
{
    (void)state;
    struct pose_knot knot[KNOTS];
    struct cast_rig *rig = open_room(knot);
    expect_same_bytes(rig);
    go_straight_from(knot, 3);
    expect_same_bytes(rig);
    rig->setup.layout = LINE_GEO;
    rig->setup.xyz_scale[0] = rig->setup.xyz_scale[1] = rig->setup.xyz_scale[2] = 1e-8;
    expect_same_bytes(rig);
    cast_rig_close(rig);
}

/* Positions of the geo layout lie on the walls: they include the head's place. */
static void test_geo(void **state)
{
    (void)state;
    struct pose_knot knot[KNOTS];
    struct cast_rig *rig = open_room(knot);
    struct schedule_line line;
    rig->setup.layout = LINE_GEO;
    rig->setup.xyz_scale[0] = rig->setup.xyz_scale[1] = rig->setup.xyz_scale[2] = 1e-6;
    for (uint64_t n = 0; n < 6; n++) {
        cast_line(rig, n, &line);
        for (uint32_t j = 0; j < rig->block.n_points; j++) {
            const int32_t at[3] = {(int32_t)rig->block.a[j], (int32_t)rig->block.b[j], (int32_t)rig->block.c[j]};
            uint16_t wall = rig->block.label[j];
            double plane = (wall & 1 ? HI : LO)[wall / 2];
            assert_true(fabs(at[wall / 2] * 1e-6 - plane) < 0.5e-6 + 1e-9);
        }
    }
    cast_rig_close(rig);
}

/* A body that was shifted by 2 m stands ahead of a head that moves towards it. Its range is worked out by hand. */
static void test_moving_body(void **state)
{
    (void)state;
    static const double lo[3] = {-0.5, 3.0, -1.0}, hi[3] = {0.5, 3.5, 1.0};
    struct pose_knot knot[2] = {{.t_ns = 0}, {.t_ns = 100000000}};
    struct cast_rig *rig = open_room((struct pose_knot[KNOTS]){{0}});
    struct scene *body = box_scene(lo, hi);
    struct bvh *bvh = made_bvh(body);
    for (int i = 0; i < 2; i++)
        knot[i].pose = (struct pose){.position_m = {0.0, 1.0 * i, 0.0}, .quat = {1, 0, 0, 0}};
    rig->setup.knot = knot;
    rig->setup.n_knots = 2;
    rig->setup.n_movers = 1;
    rig->setup.mover[0] = (struct cast_mover){.bvh = bvh, .centre_m = {0.0, 3.25, 0.0}, .radius_m = 1.2};
    pose_heading(0.0, rig->setup.mover[0].rotation);
    rig->setup.mover[0].shift_m[1] = 2.0; /* its face is at y = 5 */
    rig->spec.pan_udeg_s = 0;
    schedule_start(&rig->segment, &rig->spec);
    uint32_t hits = 0;
    for (uint64_t n = 0; n < 9; n++) {
        struct schedule_line line;
        cast_line(rig, n, &line);
        for (uint32_t j = 0; j < rig->block.n_points; j++) {
            long double mirror, pan, d[3];
            double o[3];
            int wall;
            true_angles(&rig->spec, line.cast0 + j, &mirror, &pan);
            true_direction(mirror, pan, 0.0L, d);
            true_ray(rig, line.cast0 + j, o, d);
            long double room = box_range(LO, HI, o, d, &wall), face = (5.0L - o[1]) / d[1];
            int meets = d[1] > 0 && fabsl(o[2] + face * d[2]) < 1.0L;
            long double want = meets ? face : room;
            if (d[1] > 0 && fabsl(fabsl(o[2] + face * d[2]) - 1.0L) < 1e-3L) continue; /* its edge */
            if (d[1] > 0 && d[2] < 0 && !meets && fabsl(d[2]) > 0 && o[2] + face * d[2] < -1.0L)
                continue;                     /* below it */
            if (d[1] > 0 && !meets) continue; /* may meet its top */
            hits += (uint32_t)meets;
            assert_true(fabs(rig->block.a[j] * 1e-5 - (double)want) < 5e-6 + 1e-9);
        }
    }
    assert_true(hits > 500);
    bvh_free(bvh);
    scene_free(body);
    cast_rig_close(rig);
}

/* A head is within the sphere around a body, whose middle lies ahead. Pulses that all look back meet the part of the
 * body behind it, 0.5 m from the head. The head stands, or moves. */
static void test_inside_a_body_s_sphere(void **state)
{
    (void)state;
    static const double lo[3] = {-0.5, -1.0, -1.0}, hi[3] = {0.5, 3.0, 1.0};
    const struct pose still = {.position_m = {0.0, 0.0, 0.0}, .quat = {1, 0, 0, 0}};
    const struct pose_knot knot[2] = {{.t_ns = 0, .pose = still}, {.t_ns = 100000000, .pose = still}};
    struct cast_rig *rig = open_room((struct pose_knot[KNOTS]){{0}});
    struct scene *body = box_scene(lo, hi);
    struct schedule_line line;
    struct bvh *bvh = made_bvh(body);
    rig->setup.n_movers = 1;
    rig->setup.mover[0] = (struct cast_mover){.bvh = bvh, .centre_m = {0.0, 1.0, 0.0}, .radius_m = 2.5};
    pose_heading(0.0, rig->setup.mover[0].rotation);
    rig->setup.mover[0].shift_m[1] = 0.5; /* its back is at y = -0.5 */
    rig->setup.knot = knot;
    rig->spec.pan_udeg_s = 0;
    schedule_start(&rig->segment, &rig->spec);
    schedule_get_line(&rig->segment, 0, &line);
    const uint64_t back = line.pulse0 + (uint64_t)(line.pulse_end - line.pulse0) * 220 / 240; /* 180 deg: level */
    for (int moves = 0; moves < 2; moves++) {
        rig->setup.n_knots = moves ? 2 : 0;
        assert_int_equal(cast_some(rig, &line, back - 100, 200), 200);
        for (uint32_t i = 0; i < 200; i++) {
            long double mirror, pan, d[3];
            true_angles(&rig->spec, back - 100 + i, &mirror, &pan);
            true_direction(mirror, pan, 0.0L, d);
            assert_true(d[1] < -0.9L);
            assert_int_equal(rig->block.label[i], 2);
            assert_true(fabs(rig->block.a[i] * 1e-5 - (double)(-0.5L / d[1])) < 5e-6 + 1e-9);
        }
    }
    bvh_free(bvh);
    scene_free(body);
    cast_rig_close(rig);
}

/* The nearer of a wall and a body is met. A body behind the wall is not met, and one before the open sky is, wherever
 * the head is by then. The head flies 40 m to the left within a chunk of pulses, and the body stands beside the end of
 * its way. */
static void test_nearer_of_wall_and_body(void **state)
{
    (void)state;
    static const double lo[3] = {-41.0, 3.0, -0.5}, hi[3] = {-39.0, 3.5, 0.5};
    static const double far_lo[3] = {-100.0, 90.0, -50.0}, far_hi[3] = {100.0, 91.0, -49.0};
    const struct pose_knot knot[2] = {{.t_ns = 0, .pose = {.position_m = {0, 0, 0}, .quat = {1, 0, 0, 0}}},
                                      {.t_ns = 3000000, .pose = {.position_m = {-40, 0, 0}, .quat = {1, 0, 0, 0}}}};
    static const double wall_lo[3] = {-90.0, 1.0, -9.0}, wall_hi[3] = {90.0, 2.0, 9.0};
    struct scene *body = box_scene(lo, hi);
    struct bvh *bvh = made_bvh(body);
    for (int walls = 0; walls < 2; walls++) {
        struct cast_rig *rig = walls ? cast_rig_open(box_scene(wall_lo, wall_hi), CENTRE)
                                     : cast_rig_open(box_scene(far_lo, far_hi), CENTRE);
        struct schedule_line line;
        rig->setup.knot = knot;
        rig->setup.n_knots = 2;
        rig->setup.n_movers = 1;
        rig->setup.mover[0] = (struct cast_mover){.bvh = bvh, .centre_m = {-40.0, 3.25, 0.0}, .radius_m = 1.2};
        pose_heading(0.0, rig->setup.mover[0].rotation);
        rig->spec.pan_udeg_s = 0;
        rig->spec.sweep_udeg = 40 * DEG; /* -11 to 29 degrees in 10 ms; level and ahead after 2.75 ms */
        rig->spec.fov_min_udeg = rig->spec.line_start_udeg = -11 * DEG;
        rig->spec.line_stop_udeg = 29 * DEG;
        schedule_start(&rig->segment, &rig->spec);
        schedule_get_line(&rig->segment, 0, &line);
        const uint32_t n = 1024, first = 100;
        cast_some(rig, &line, line.cast0 + first, n);
        uint32_t bodies = 0;
        for (uint32_t i = 0; i < n; i++) {
            double o[3];
            long double d[3];
            true_ray(rig, line.cast0 + first + i, o, d);
            const long double z = 3.0L / d[1] * d[2];
            const int met = fabs(o[0] + 40.0) < 0.99 && fabsl(z) < 0.49L;
            if (!met && !walls) continue; /* beside it, or its top */
            assert_true(rig->block.echo[i] == 0x11 && rig->block.label[i] == 2);
            assert_true(fabs(rig->block.a[i] * 1e-5 - (double)((walls ? 1.0L : 3.0L) / d[1])) < 5e-6 + 1e-9);
            bodies += (uint32_t)met;
        }
        assert_true(bodies > 20);
        cast_rig_close(rig);
    }
    bvh_free(bvh);
    scene_free(body);
}

/* The frame scalar changes evenly between two knots, and stays as at the first and the last beyond them. A channel of
 * the colour is rounded, so that it may differ by one. */
static void colours_follow_the_frame_scalar(void **state)
{
    (void)state;
    static const struct pose_knot knot[3] = {{.t_ns = 3000000, .pose.quat = {1, 0, 0, 0}, .frame = 2.0},
                                             {.t_ns = 4000000, .pose.quat = {1, 0, 0, 0}, .frame = 5.0},
                                             {.t_ns = 8000000, .pose.quat = {1, 0, 0, 0}, .frame = 3.0}};
    const struct cast_colour colour = {.scale = {.mode = COLOUR_FRAME, .low = 1.5, .high = 5.5}};
    struct cast_rig *rig = cast_rig_open(box_scene(LO, HI), CENTRE);
    struct schedule_line line;
    struct sh_err err;
    rig->setup.knot = knot;
    rig->setup.n_knots = 3;
    rig->setup.colour = &colour;
    assert_int_equal(line_block_alloc_colours(&rig->block, &err), SH_OK);
    cast_line(rig, 0, &line);
    assert_true(rig->block.n_points > 1900); /* 240 of 360 degrees of 3000 pulses, in 10 ms */
    for (uint32_t j = 0; j < rig->block.n_points; j++) {
        const double ms = 1e-6 * (double)schedule_time_ns(&rig->segment, line.cast0 + j);
        const double frame = ms < 3.0 ? 2.0 : ms < 4.0 ? 3.0 * ms - 7.0 : ms < 8.0 ? 7.0 - 0.5 * ms : 3.0;
        uint8_t rgb[3];
        colour_ramp((frame - 1.5) / 4.0, rgb);
        for (int k = 0; k < 3; k++)
            assert_true(abs(rgb[k] - rig->block.rgb[j][k]) <= 1);
    }
    cast_rig_close(rig);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_room),
        cmocka_unit_test(test_same_bytes),
        cmocka_unit_test(test_geo),
        cmocka_unit_test(test_moving_body),
        cmocka_unit_test(test_inside_a_body_s_sphere),
        cmocka_unit_test(test_nearer_of_wall_and_body),
        cmocka_unit_test(colours_follow_the_frame_scalar),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
