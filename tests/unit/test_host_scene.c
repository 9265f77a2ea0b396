/* SPDX-License-Identifier: MIT */
/* libscanhead: points of the head's coordinate frame are taken to that of the scene, by a station or by the poses of a
 * moving head. Expected places are computed here from angles. */
#include <math.h>

#include "tests/unit/host_rig.h"

static struct scanhead *sh;
static int head;

static void put(size_t len)
{
    struct scanhead_frame f;
    native_finish_frame(out, rig_next_seq());
    put_all(head, out, len);
    assert_int_equal(scanhead_next(sh, &f, WAIT_MS), 0);
}

static void put_poses(const struct native_pose *pose, uint32_t n)
{
    put(native_encode_poses(out, sizeof out, pose, n, 1, 0));
}

static void begin(int geo, const struct native_anchor *anchor)
{
    const struct native_descriptor d = make_descriptor(geo, 1);
    sh = open_pair(&head);
    put(native_encode_descriptor(out, sizeof out, &d, 1, 0));
    put(native_encode_anchor(out, sizeof out, anchor, 1, 0));
}

static void end(void)
{
    close(head);
    scanhead_close(sh);
}

/* A pose at (x, y, 0), turned about z, towards y at 90 degrees. */
static struct native_pose pose_at(int64_t t_ns, double x, double y, double turn_deg)
{
    const double half = 0.5 * turn_deg * M_PI / 180.0;
    return (struct native_pose){
        .t_ns = t_ns, .position_m = {x, y, 0}, .quat = {cos(half), 0, 0, sin(half)}, .frame = 10 + 1e-3 * (double)t_ns};
}

/* Where the head was between two poses: one frame of three poses, and one of two, with a loss between them. -1: the
 * head's place is not known. */
static const struct {
    int64_t t_ns;
    double x, y, turn_deg;
} places[] = {{-1, -1, 0, 0},      {0, 0, 0, 0},        {500, 5, 0, 45},  {999, 9.99, 0, 89.91}, {1000, 10, 0, 90},
              {2000, 10, 10, 90},  {3000, 10, 20, 90},  {3001, -1, 0, 0}, {4999, -1, 0, 0},      {5000, 30, 40, 180},
              {5250, 31, 40, 180}, {6000, 34, 40, 180}, {6001, -1, 0, 0}, {250, 2.5, 0, 22.5}};
enum { N = sizeof places / sizeof places[0], N_LOST = 4 };

static void begin_moving(void)
{
    struct native_anchor anchor = make_anchor();
    anchor.moving = NATIVE_MOVING;
    const struct native_pose first[] = {pose_at(0, 0, 0, 0), pose_at(1000, 10, 0, 90), pose_at(3000, 10, 20, 90)},
                             second[] = {pose_at(5000, 30, 40, 180), pose_at(6000, 34, 40, 180)};
    begin(0, &anchor);
    put_poses(first, 3);
    put_poses(second, 2);
}

static void test_moving(void **state)
{
    (void)state;
    struct scanhead_point points[N], bare[N];
    double frame[N];
    begin_moving();
    for (int i = 0; i < N; i++)
        points[i] = bare[i] = (struct scanhead_point){.t_ns = places[i].t_ns, .x = 1, .y = 2, .z = 3};
    assert_int_equal(scanhead_to_scene(sh, points, N, frame), N_LOST);
    assert_int_equal(scanhead_to_scene(sh, bare, N, NULL), N_LOST);
    for (int i = 0; i < N; i++) {
        const double turn = places[i].turn_deg * M_PI / 180.0, cosine = cos(turn), sine = sin(turn);
        if (places[i].x < 0) {
            assert_true(isnan(points[i].x) && isnan(points[i].y) && isnan(points[i].z) && isnan(frame[i]));
            continue;
        }
        /* some roundings of numbers below 64 */
        assert_true(fabs(points[i].x - (places[i].x + cosine - 2 * sine)) < 1e-13);
        assert_true(fabs(points[i].y - (places[i].y + sine + 2 * cosine)) < 1e-13);
        assert_true(fabs(points[i].z - 3) < 1e-13);
        assert_true(fabs(frame[i] - (10 + 1e-3 * (double)places[i].t_ns)) < 1e-13);
        assert_true(bare[i].x == points[i].x && bare[i].y == points[i].y && bare[i].z == points[i].z);
    }
    end();
}

static void test_pose(void **state)
{
    (void)state;
    begin_moving();
    for (int i = 0; i < N; i++) {
        struct scanhead_pose pose;
        char want[100];
        const double half = 0.5 * places[i].turn_deg * M_PI / 180.0;
        if (places[i].x < 0) {
            assert_int_equal(scanhead_pose(sh, places[i].t_ns, &pose), SCANHEAD_ESTATE);
            snprintf(want, sizeof want, "there is no pose of the head at %.9f s of the scan",
                     1e-9 * (double)places[i].t_ns);
            assert_non_null(strstr(scanhead_error(sh), want));
            continue;
        }
        assert_int_equal(scanhead_pose(sh, places[i].t_ns, &pose), 0);
        assert_int_equal(pose.t_ns, places[i].t_ns);
        assert_true(fabs(pose.position_m[0] - places[i].x) < 1e-13);
        assert_true(fabs(pose.position_m[1] - places[i].y) < 1e-13);
        assert_true(fabs(pose.quat[0] - cos(half)) < 1e-15 && fabs(pose.quat[3] - sin(half)) < 1e-15);
        assert_true(fabs(pose.frame - (10 + 1e-3 * (double)places[i].t_ns)) < 1e-13);
        assert_int_equal(pose.flags, 0);
    }
    end();
}

/* Between two poses the flags of both hold. */
static void test_flags(void **state)
{
    (void)state;
    struct native_anchor anchor = make_anchor();
    struct native_pose pose[] = {pose_at(0, 0, 0, 0), pose_at(1000, 1, 0, 0), pose_at(2000, 2, 0, 0)};
    struct scanhead_pose is;
    pose[0].flags = SCANHEAD_POSE_NONE;
    pose[1].flags = SCANHEAD_POSE_EXTRAPOLATED;
    pose[2].flags = SCANHEAD_POSE_LATE;
    anchor.moving = NATIVE_MOVING;
    begin(0, &anchor);
    put_poses(pose, 3);
    assert_int_equal(scanhead_pose(sh, 500, &is), 0);
    assert_int_equal(is.flags, SCANHEAD_POSE_NONE | SCANHEAD_POSE_EXTRAPOLATED);
    assert_int_equal(scanhead_pose(sh, 1500, &is), 0);
    assert_int_equal(is.flags, SCANHEAD_POSE_LATE | SCANHEAD_POSE_EXTRAPOLATED);
    end();
}

/* More poses than are kept: the last ones are known, and those of long ago are not. */
static void test_many(void **state)
{
    (void)state;
    enum { EACH = 800, FRAMES = 14, ALL = EACH * FRAMES };
    static struct native_pose pose[EACH];
    struct native_anchor anchor = make_anchor();
    struct scanhead_pose is;
    anchor.moving = NATIVE_MOVING;
    begin(0, &anchor);
    for (int i = 0; i < ALL; i++) {
        pose[i % EACH] = pose_at(1000 * i, i, 0, 0);
        if (i % EACH == EACH - 1) put_poses(pose, EACH);
    }
    for (int i = ALL - 2 * EACH; i < ALL - 1; i++) {
        const int known = i % EACH != EACH - 1; /* not between two frames */
        assert_int_equal(scanhead_pose(sh, 1000 * i + 500, &is), known ? 0 : SCANHEAD_ESTATE);
        if (known) assert_true(fabs(is.position_m[0] - (i + 0.5)) < 1e-9);
    }
    assert_int_equal(scanhead_pose(sh, 500, &is), SCANHEAD_ESTATE);
    end();
}

/* A head that stands: the station's rotation, in rows, and then its place. */
static void test_standing(void **state)
{
    (void)state;
    struct native_anchor anchor = make_anchor();
    struct scanhead_point p[2] = {{.x = 1, .y = 2, .z = 4}, {.x = 10, .y = 20, .z = 40}};
    double frame[2];
    anchor.frame = 7.5;
    begin(0, &anchor);
    assert_int_equal(scanhead_to_scene(sh, p, 2, frame), 0);
    assert_true(p[0].x == 1 + 2 && p[0].y == 2 - 1 && p[0].z == 3 + 4);
    assert_true(p[1].x == 1 + 20 && p[1].y == 2 - 10 && p[1].z == 3 + 40);
    assert_true(frame[0] == 7.5 && frame[1] == 7.5);
    assert_int_equal(scanhead_to_scene(sh, p, 1, NULL), 0);
    end();
    begin(1, &anchor);
    assert_int_equal(scanhead_to_scene(sh, p, 1, NULL), SCANHEAD_ESTATE);
    assert_non_null(strstr(scanhead_error(sh), "only points of the polar layout can be converted to the scene frame"));
    end();
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_moving), cmocka_unit_test(test_pose),     cmocka_unit_test(test_flags),
        cmocka_unit_test(test_many),   cmocka_unit_test(test_standing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
