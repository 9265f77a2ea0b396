/* SPDX-License-Identifier: MIT */
/* core/pose: the convention of attitudes, and poses between two others. */
#include "tests/unit/pose_rig.h"

/* This is the convention written out: R = Rz(-heading) Rx(pitch) Ry(roll) from three elementary matrices. */
static void matrix_by_hand(double heading, double pitch, double roll, double out[9])
{
    const double h = -heading;
    const double z[9] = {cos(h), -sin(h), 0, sin(h), cos(h), 0, 0, 0, 1};
    const double x[9] = {1, 0, 0, 0, cos(pitch), -sin(pitch), 0, sin(pitch), cos(pitch)};
    const double y[9] = {cos(roll), 0, sin(roll), 0, 1, 0, -sin(roll), 0, cos(roll)};
    double zx[9] = {0};
    memset(out, 0, 9 * sizeof *out);
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++)
                zx[3 * i + j] += z[3 * i + k] * x[3 * k + j];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++)
            for (int k = 0; k < 3; k++)
                out[3 * i + j] += zx[3 * i + k] * y[3 * k + j];
}

static void test_convention(void **state)
{
    (void)state;
    uint64_t random = 3;
    for (int n = 0; n < 1000; n++) {
        double heading = 2.0 * M_PI * case_unit(&random), pitch = (case_unit(&random) - 0.5) * 3.0,
               roll = (case_unit(&random) - 0.5) * 6.0, quat[4], got[9], want[9], back[3];
        pose_from_angles(heading, pitch, roll, quat);
        quat_matrix(quat, got);
        matrix_by_hand(heading, pitch, roll, want);
        for (int i = 0; i < 9; i++) /* products of a dozen roundings */
            assert_true(fabs(got[i] - want[i]) < 2e-15);
        pose_to_angles(quat, &back[0], &back[1], &back[2]);
        /* pitch stays 0.07 rad from the pole: errors grow by 1 / cos, 14 times */
        assert_true(fabs(back[0] - heading) < 1e-13 && fabs(back[1] - pitch) < 1e-13 && fabs(back[2] - roll) < 1e-13);
        pose_from_matrix(want, quat);
        quat_matrix(quat, got);
        for (int i = 0; i < 9; i++)
            assert_true(fabs(got[i] - want[i]) < 1e-13);
    }
    /* In words: heading 90 looks east, pitch lifts the nose, roll lowers the right side. */
    double quat[4], out[3];
    const double forward[3] = {0, 1, 0}, right[3] = {1, 0, 0};
    pose_from_angles(90 * DEG, 0, 0, quat);
    pose_rotate(quat, forward, out);
    assert_true(fabs(out[0] - 1.0) < 1e-15 && fabs(out[1]) < 1e-15);
    pose_from_angles(90 * DEG, 10 * DEG, 5 * DEG, quat);
    pose_rotate(quat, forward, out);
    assert_true(fabs(out[2] - sin(10 * DEG)) < 1e-15);
    pose_rotate(quat, right, out);
    assert_true(out[2] < -0.08);
}

/* A heading just below 0 is nearer to a whole turn than doubles can tell. Such a heading is reported as 0, not as a
 * whole turn. */
static void test_heading_stays_below_a_turn(void **state)
{
    (void)state;
    for (double below = 1e-300; below < 1e-12; below *= 10.0) {
        double quat[4], heading, pitch, roll;
        pose_from_angles(-below, 0.3, 0.2, quat);
        pose_to_angles(quat, &heading, &pitch, &roll);
        if (!(heading >= 0.0 && heading < 2.0 * M_PI)) fail_msg("-%g rad: a heading of %.17g", below, heading);
    }
}

/* With the nose straight up or down, heading and roll turn about one axis, and only their sum or difference counts. The
 * angles that come back give the same attitude, also just beside the pole. Nearer to it than 1e-9, roll is added to the
 * heading. */
static void test_pole(void **state)
{
    (void)state;
    static const double pitch_deg[] = {90, -90, 90 - 1e-5, -90 + 1e-5, 90 - 1e-7};
    for (size_t i = 0; i < sizeof pitch_deg / sizeof pitch_deg[0]; i++)
        for (int heading_deg = 0; heading_deg < 360; heading_deg += 45)
            for (int roll_deg = -150; roll_deg <= 180; roll_deg += 30) {
                double quat[4], again[4], matrix[9], h, p, r;
                matrix_by_hand(heading_deg * DEG, pitch_deg[i] * DEG, roll_deg * DEG, matrix);
                pose_from_angles(heading_deg * DEG, pitch_deg[i] * DEG, roll_deg * DEG, quat);
                pose_to_angles(quat, &h, &p, &r);
                assert_true(h >= 0 && h < 2 * M_PI + 1e-9 && fabs(p - pitch_deg[i] * DEG) < 1e-12);
                pose_from_angles(h, p, r, again);
                if (pose_angle_between(quat, again) > 2e-15) /* products of a dozen roundings */
                    fail_msg("%d %.9g %d: off by %g", heading_deg, pitch_deg[i], roll_deg,
                             pose_angle_between(quat, again));
                pose_from_matrix(matrix, again);
                assert_true(pose_angle_between(quat, again) < 2e-15);
            }
}

static void test_between(void **state)
{
    (void)state;
    struct pose a = {.position_m = {1, 2, 3}}, b = {.position_m = {3, 2, -1}}, mid;
    pose_from_angles(350 * DEG, 0, 0, a.quat);
    pose_from_angles(30 * DEG, 0, 0, b.quat);
    for (int i = 0; i < 4; i++)
        b.quat[i] = -b.quat[i]; /* the same attitude: the shorter way is found nevertheless */
    for (double f = 0; f <= 1.0; f += 0.125) {
        double h, p, r;
        pose_between(&a, &b, f, &mid);
        pose_to_angles(mid.quat, &h, &p, &r);
        double want = fmod(350 + 40 * f, 360.0) * DEG;
        assert_true(fabs(h - want) < 1e-14 || fabs(fabs(h - want) - 2 * M_PI) < 1e-14);
        assert_true(fabs(mid.position_m[0] - (1 + 2 * f)) < 1e-15 && fabs(mid.position_m[2] - (3 - 4 * f)) < 1e-15);
    }
    assert_true(fabs(pose_angle_between(a.quat, b.quat) - 40 * DEG) < 1e-14);
    struct pose mount = {.position_m = {0, 2, 0.5}}, head;
    pose_from_angles(90 * DEG, 0, 0, mount.quat);
    pose_from_angles(90 * DEG, 0, 0, a.quat);
    pose_mount(&a, &mount, &head); /* two metres ahead of a platform that looks east; the head looks south */
    assert_true(fabs(head.position_m[0] - 3) < 1e-15 && fabs(head.position_m[1] - 2) < 1e-15 &&
                fabs(head.position_m[2] - 3.5) < 1e-15);
    double out[3];
    pose_rotate(head.quat, (const double[3]){0, 1, 0}, out);
    assert_true(fabs(out[1] + 1) < 1e-15);
}

/* A quaternion and its negative are one attitude. The way between two is the short one, for any signs. */
static void test_short_way(void **state)
{
    (void)state;
    uint64_t random = 8;
    for (int n = 0; n < 100; n++) {
        struct pose a = {.position_m = {0}}, b = {.position_m = {0}}, mid, other;
        double axis[3], r[9], want[9];
        pose_from_angles(6.0 * case_unit(&random), case_unit(&random), case_unit(&random), a.quat);
        pose_from_angles(6.0 * case_unit(&random), case_unit(&random), case_unit(&random), b.quat);
        const double turn = pose_angle_between(a.quat, b.quat);
        pose_between(&a, &b, 0.25, &mid);
        for (int k = 0; k < 4; k++)
            b.quat[k] = -b.quat[k];
        pose_between(&a, &b, 0.25, &other);
        quat_matrix(mid.quat, want);
        quat_matrix(other.quat, r);
        assert_true(turn <= M_PI && fabs(pose_angle_between(a.quat, b.quat) - turn) < 1e-12);
        assert_true(fabs(pose_angle_between(a.quat, other.quat) - 0.25 * turn) < 1e-12);
        for (int i = 0; i < 9; i++)
            assert_true(fabs(r[i] - want[i]) < 1e-12);
        quat_turn(a.quat, b.quat, axis, r);
        assert_true(fabs(axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2] - 1.0) < 1e-12);
    }
}

/* With the nose straight up or down, heading and roll turn about one axis. Their difference, or sum, is reported as
 * heading. */
static void test_straight_up(void **state)
{
    (void)state;
    for (int up = 0; up < 2; up++)
        for (int n = 0; n < 12; n++) {
            const double heading = (25 + 30 * n) * DEG, roll = (n % 3) * 10 * DEG, pitch = (up ? 90 : -90) * DEG;
            double quat[4], said[3], r[9], want[9];
            pose_from_angles(heading, pitch, roll, quat);
            quat_matrix(quat, want);
            pose_to_angles(quat, &said[0], &said[1], &said[2]);
            /* The cosine of the pitch is a rounding error, and the pitch's error is its root: 2e-8. */
            assert_true(fabs(said[1] - pitch) < 5e-8 && said[2] == 0.0);
            const double off = said[0] - (up ? heading - roll : heading + roll);
            assert_true(fabs(remainder(off, 2.0 * M_PI)) < 1e-12);
            pose_from_matrix(want, quat);
            quat_matrix(quat, r);
            for (int i = 0; i < 9; i++)
                assert_true(fabs(r[i] - want[i]) < 5e-8);
        }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_convention), cmocka_unit_test(test_heading_stays_below_a_turn),
        cmocka_unit_test(test_pole),       cmocka_unit_test(test_between),
        cmocka_unit_test(test_short_way),  cmocka_unit_test(test_straight_up),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
