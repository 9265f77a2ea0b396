/* SPDX-License-Identifier: MIT */
/* core/pose: the course through way-points between its ends. Places, headings and frames are compared with formulas:
 * between two rests, to and from a rest, and on a parabola. */
#include <unistd.h>

#include "tests/unit/file_rig.h"
#include "tests/unit/pose_rig.h"

static struct trajectory *read_way(const char *text)
{
    struct trajectory *tr;
    struct sh_err err;
    FILE *f = fopen(file_path, "w");
    assert_non_null(f);
    fprintf(f, "x_m,y_m,z_m,speed_m_s,pause_s\n%s", text);
    assert_int_equal(fclose(f), 0);
    if (trajectory_read_waypoints(file_path, NULL, NULL, &tr, &err) != SH_OK) fail_msg("%s", err.text);
    return tr;
}

/* The share of a leg after the share f of its time. A cubic whose slope at either end is 0 (rest) or 1. */
static double share(double f, int from_rest, int to_rest)
{
    if (from_rest && to_rest) return f * f * (3 - 2 * f);
    if (from_rest) return f * f * (2 - f);
    if (to_rest) return f * (1 + f - f * f);
    return f;
}

/* Legs of 10 m at 2 m/s go along x; each point may have a pause of 1.5 s. Samples are every 0.02 s. Where two legs
 * meet, the acceleration jumps by up to 4 * 10 m / (5 s)^2. A quarter of this jump times 0.02 s is the velocity's error
 * there. That error times 0.02 s / 8 is the error halfway between two samples: 2e-5 m. */
static void test_rests(void **state)
{
    (void)state;
    for (int pauses = 0; pauses < 8; pauses++) {
        char text[128];
        const int rest[3] = {pauses & 1, pauses >> 1 & 1, pauses >> 2 & 1};
        snprintf(text, sizeof text, "-10,3,2,2,%g\n0,3,2,2,%g\n10,3,2,9,%g\n", 1.5 * rest[0], 1.5 * rest[1],
                 1.5 * rest[2]);
        struct trajectory *tr = read_way(text);
        double t_s = 0, first_s, last_s;
        for (int leg = 0; leg < 3; leg++) {
            for (double on = 0; on <= 1.5 * rest[leg]; on += 0.0625) {
                struct pose pose;
                double frame;
                trajectory_at(tr, t_s + on, &pose, &frame);
                assert_true(fabs(pose.position_m[0] - 10.0 * (leg - 1)) < 1e-12 && fabs(frame - leg) < 1e-12);
            }
            t_s += 1.5 * rest[leg];
            for (int i = 0; leg < 2 && i <= 500; i++) {
                struct pose pose;
                double frame, part = share(i / 500.0, rest[leg], rest[leg + 1]), h, pitch, roll;
                trajectory_at(tr, t_s + 0.01 * i, &pose, &frame);
                if (fabs(pose.position_m[0] - (10 * (leg - 1) + 10 * part)) > (i % 2 ? 2.1e-5 : 1e-11))
                    fail_msg("pauses %d, leg %d, %g s: %.9g m", pauses, leg, 0.01 * i, pose.position_m[0]);
                assert_true(pose.position_m[1] == 3 && pose.position_m[2] == 2);
                /* Frames go straight between samples: their second derivative, 6 / (5 s)^2, times 0.02^2 / 8. */
                assert_true(fabs(frame - (leg + part)) < (i % 2 ? 1.3e-5 : 1e-11));
                pose_to_angles(pose.quat, &h, &pitch, &roll);
                assert_true(fabs(h - 90 * DEG) < 1e-9 && fabs(pitch) < 1e-15 && fabs(roll) < 1e-15);
            }
            if (leg < 2) t_s += 5;
        }
        trajectory_span(tr, &first_s, &last_s);
        assert_true(first_s == 0 && fabs(last_s - t_s) < 1e-12);
        trajectory_free(tr);
    }
}

/* Three points define a parabola: y goes by 3 m/s, and x from -3 to 3 m/s within 4 s, so x is 0.75 (t - 2)^2. The
 * heading is that of the way at each time. At an end the heading is taken over 0.1 ms to one side. Half of that at a
 * turning rate of 0.25 rad/s is an error of 1.3e-5 rad. Between samples, every 0.02 s, the turn is even. Its error is
 * the second derivative, below 0.5 rad/s^2, times 0.02^2 / 8. */
static void test_heading(void **state)
{
    (void)state;
    struct trajectory *tr;
    char text[160];
    /* The chords of 3 m and 6 m take 2 s each. */
    const double v_m_s = hypot(3, 6) / 2;
    snprintf(text, sizeof text, "3,0,0,%.17g,0\n0,6,0,%.17g,0\n3,12,0,1,0\n", v_m_s, v_m_s);
    tr = read_way(text);
    for (int i = 0; i <= 400; i++) {
        const double t = 0.01 * i;
        struct pose pose;
        double frame, h, pitch, roll;
        trajectory_at(tr, t, &pose, &frame);
        pose_to_angles(pose.quat, &h, &pitch, &roll);
        const double want = atan2(1.5 * (t - 2), 3);
        if (fabs(remainder(h - want, 2 * M_PI)) > (i == 0 || i == 400 ? 3e-5 : 2e-5))
            fail_msg("%g s: heading %.9g instead of %.9g", t, h, want);
        assert_true(fabs(pose.position_m[0] - 0.75 * (t - 2) * (t - 2)) < 1e-9);
        assert_true(fabs(pose.position_m[1] - 3 * t) < 1e-9);
    }
    trajectory_free(tr);
}

/* config/moving.md explains the curve with these points and figures. Three points define a parabola: after 0, 2 and 3 s
 * x is -1, 1 and 1, and y is 0, 0 and 1. Rests change no place. Two more points about the turn keep the platform on the
 * lines. */
static void test_the_manual_s_turn(void **state)
{
    (void)state;
    struct pose pose;
    double frame;
    struct trajectory *tr = read_way("-1,0,0,1,0\n1,0,0,1,0\n1,1,0,1,0\n");
    for (double t = 0; t <= 3; t += 0.125) {
        trajectory_at(tr, t, &pose, &frame);
        assert_true(fabs(pose.position_m[0] - (-1 + 5 * t / 3 - t * t / 3)) < 1e-9);
        assert_true(fabs(pose.position_m[1] - (t * t - 2 * t) / 3) < 1e-9);
    }
    trajectory_at(tr, 1, &pose, &frame);
    assert_true(fabs(pose.position_m[0] - 0.333) < 5e-4 && fabs(pose.position_m[1] + 0.333) < 5e-4);
    trajectory_at(tr, 0.001, &pose, &frame);
    assert_true(fabs(hypot(pose.position_m[0] + 1, pose.position_m[1]) / 0.001 - 1.80) < 0.01);
    trajectory_free(tr);
    tr = read_way("-1,0,0,1,0.5\n1,0,0,1,0.5\n1,1,0,1,0\n"); /* halfway between two rests */
    trajectory_at(tr, 1.5, &pose, &frame);
    assert_true(fabs(pose.position_m[0] - 1 / 3.0) < 1e-4 && fabs(pose.position_m[1] + 1 / 3.0) < 1e-4);
    trajectory_free(tr);
    tr = read_way("-1,0,0,1,0\n0.9,0,0,1,0\n1,0,0,1,0\n1,0.1,0,1,0\n1,1,0,1,0\n");
    for (double t = 0; t <= 3; t += 0.125) {
        if (t > 1.9 && t < 2.1) continue; /* the bend */
        trajectory_at(tr, t, &pose, &frame);
        assert_true(fabs(pose.position_m[0] - fmin(-1 + t, 1)) < 1e-9);
        assert_true(fabs(pose.position_m[1] - fmax(0, t - 2)) < 1e-9);
    }
    trajectory_free(tr);
}

/* A lift goes up, where the way has no heading: it keeps the last one. The curve enters the lift in a bend, which goes
 * too far to the east and comes back to the west. */
static void test_straight_up(void **state)
{
    (void)state;
    struct trajectory *tr = read_way("0,0,0,2,0\n8,0,0,2,0\n8,0,8,2,0\n8,0,16,2,1\n8,0,24,2,0\n");
    struct pose pose;
    double frame, h, pitch, roll;
    for (double t = 0.5; t <= 17.0; t += 0.25) {
        if (t > 3.9 && t < 6.0) continue; /* the bend */
        trajectory_at(tr, t, &pose, &frame);
        pose_to_angles(pose.quat, &h, &pitch, &roll);
        if (fabs(h - (t < 4 ? 90 : 270) * DEG) > 1e-9) fail_msg("%g s: heading %g", t, h / DEG);
    }
    trajectory_free(tr);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_rests),
        cmocka_unit_test(test_heading),
        cmocka_unit_test(test_the_manual_s_turn),
        cmocka_unit_test(test_straight_up),
    };
    return cmocka_run_group_tests(tests, make_file, remove_file);
}
