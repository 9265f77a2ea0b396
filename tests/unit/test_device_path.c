/* SPDX-License-Identifier: MIT */
/* The place of the head: on a trajectory, after its end, and on a platform whose poses come live. */
#include <math.h>

#include "firmware_sim/config/config.h"
#include "firmware_sim/device/device_state.h"
#include "tests/unit/device_rig.h"

/* A pose for a time far ahead counts as a bad one, and others still come in. In step pace the peer grants time, so a
 * pose may be for any time. */
static void a_pose_far_ahead_keeps_no_other_out(void **state)
{
    (void)state;
    static const char *const live[] = {"platform.kind=live"}, *const steps[] = {"platform.kind=live", "loop.pace=step"};
    const double pose[6] = {1};
    struct rig *rig = rig_open(NULL, live, 1);
    rig_go_to(rig, 10); /* 10 ms */
    int64_t most_ns = (DEVICE_POSE_AHEAD_S * INT64_C(1000) + 10) * 1000000;
    assert_int_equal(device_pose(rig->device, INT64_C(900000000000000), pose, NULL), SH_EINPUT);
    assert_int_equal(device_pose(rig->device, most_ns + 1, pose, NULL), SH_EINPUT);
    assert_int_equal(device_pose(rig->device, 20000000, pose, NULL), 0);
    assert_int_equal(device_pose(rig->device, most_ns, pose, NULL), 0);
    assert_int_equal(atomic_load(&device_counters(rig->device)->bad_poses), 2);
    rig_close(rig);
    rig = rig_open(NULL, steps, 2);
    assert_int_equal(device_pose(rig->device, INT64_C(900000000000000), pose, NULL), 0);
    rig_close(rig);
}

/* The first pulse of a tick may be 15 periods old, and a tick has up to 256 poses. The rate that the error names as
 * allowed works. */
static void a_live_head_is_not_too_slow(void **state)
{
    (void)state;
    static const char *const live[] = {"platform.kind=live"};
    const struct device_options none = {0};
    struct rig *rig = rig_open(NULL, live, 1);
    struct device *device;
    struct sh_err err;
    rig->cfg->profile.prr_min_uhz = 63000000;
    assert_int_equal(device_create(rig->site, &none, &device, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "to be at least 64"));
    rig->cfg->profile.prr_min_uhz = 64000000;
    need(device_create(rig->site, &none, &device, &err), &err);
    device_free(device);
    rig_close(rig);
}

/* The platform goes north at 1 m/s. Where a scan ends, by a stop or with its frames, it stands until the next one. */
static void a_platform_stands_where_the_scan_ended(void **state)
{
    (void)state;
    char path[96], set[128];
    struct pose pose;
    snprintf(path, sizeof path, "%s/way.csv", folder);
    snprintf(set, sizeof set, "platform.waypoints=%s", path);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs("x_m,y_m,z_m,speed_m_s\n0,0,0,1\n0,2,0,1\n", f);
    assert_int_equal(fclose(f), 0);
    const char *const sets[] = {"platform.kind=trajectory", set, "stations[1].name=b", "head.frames=0"};
    struct rig *rig = rig_open(NULL, sets, 4);
    rig_go_to(rig, 210);
    rig_tell(rig, "SCAN:STAR", 209);
    const struct native_event *event = rig_wait(rig, NATIVE_EV_SCAN_START, 100);
    int64_t t0_ns = (int64_t)event->b;
    rig_go_to(rig, rig->next + 500);
    rig_tell(rig, "SCAN:STOP", rig->next - 1);
    rig_wait(rig, NATIVE_EV_SCAN_END, 10);
    double end_s = 1e-3 * (double)rig->next - 1e-9 * (double)t0_ns;
    assert_true(end_s > 0.5 && end_s < 0.52);
    for (int i = 0; i < 5; i++) {
        assert_int_equal(device_head_pose(rig->device, t0_ns + i * INT64_C(250000000), &pose), 1);
        assert_true(fabs(pose.position_m[1] - fmin(0.25 * i, end_s)) < 1.001e-3); /* in the tick that ended */
    }
    rig_go_to(rig, rig->next + 100); /* spin-down takes 50 */
    rig_tell(rig, "SCAN:STAR", rig->next - 1);
    rig_wait(rig, NATIVE_EV_SCAN_START, 1000);
    rig_go_to(rig, rig->next + 100);
    assert_int_equal(device_head_pose(rig->device, (int64_t)rig->next * 1000000, &pose), 1);
    assert_true(fabs(pose.position_m[1] - 0.1) < 2.001e-3);
    rig_close(rig);
    unlink(path);
}

/* A path of 2 s. With `hold` the scan goes on at its last pose; else it ends there, with the last pulse before. */
static void a_path_ends_with_its_last_pose(void **state)
{
    (void)state;
    char path[96], set[128];
    struct pose pose;
    snprintf(path, sizeof path, "%s/path.csv", folder);
    snprintf(set, sizeof set, "platform.file=%s", path);
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs("t_s,x_m,y_m,z_m,heading_deg\n5,0,0,0,0\n6,0,1,0,0\n7,0,2,0,90\n", f);
    assert_int_equal(fclose(f), 0);
    for (int holds = 0; holds < 2; holds++) {
        const char *const sets[] = {"platform.kind=trajectory", set, "stations[1].name=b", "head.frames=0",
                                    holds ? "platform.at_end=hold" : "platform.at_end=stop"};
        struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 5);
        const int64_t t0_ns = (int64_t)rig_wait(rig, NATIVE_EV_SCAN_START, 1000)->b;
        if (holds)
            rig_go_to(rig, rig->next + 2500);
        else
            assert_int_equal(rig_wait(rig, NATIVE_EV_SCAN_END, 2010)->b, 2 * 300000);
        static const int64_t at_ns[] = {-1, 0, 500000000, 1999000000, 2000000000, 2400000000};
        for (int i = 0; i < 6; i++) {
            assert_int_equal(device_head_pose(rig->device, t0_ns + at_ns[i], &pose), 1);
            const double want_m = fmin(1e-9 * (double)(at_ns[i] > 0 ? at_ns[i] : 0), 2.0);
            assert_true(fabs(pose.position_m[1] - want_m) < 1e-6); /* a straight way at a constant speed */
        }
        rig_close(rig);
    }
    unlink(path);
}

/* There is a pose each 10 ms, north at 2 m/s. Between two of them the head is on the straight way. After the last one
 * it goes on at that speed for extrapolate_ms, and then it stands. */
static void a_live_platform_goes_on_for_a_while(void **state)
{
    (void)state;
    static const char *const sets[] = {"platform.kind=live", "platform.extrapolate_ms=30", "platform.reach_m=50"};
    static const struct {
        int64_t t_ns;
        double y_m;
    } rows[] = {{50000000, 0.1},  {55000000, 0.11}, {69999999, 0.139999998}, {70000000, 0.14},
                {80000000, 0.16}, {85000000, 0.17}, {100000000, 0.2}, /* 30 ms after the last */
                {100000001, 0.2}, {500000000, 0.2}};
    struct rig *rig = rig_open(NULL, sets, 3);
    struct pose pose;
    rig_go_to(rig, 10);
    assert_int_equal(device_head_pose(rig->device, 50000000, &pose), 0); /* none has come */
    for (int i = 5; i <= 7; i++)
        assert_int_equal(device_pose(rig->device, i * INT64_C(10000000), (double[]){0, 0.02 * i, 0, 0, 0, 0}, NULL), 0);
    assert_int_equal(device_head_pose(rig->device, 49999999, &pose), 0); /* before the first */
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        assert_int_equal(device_head_pose(rig->device, rows[i].t_ns, &pose), 1);
        if (fabs(pose.position_m[1] - rows[i].y_m) > 1e-12)
            fail_msg("%lld ns: %.9f m, not %.9f", (long long)rows[i].t_ns, pose.position_m[1], rows[i].y_m);
    }
    rig_close(rig);
}

/* Two stations, 5 m apart, and a reach of 4 m: it counts from the station that the head is at, for poses and for those
 * of TIME:STEP. A pose that came at the other station and is out of reach of this one does not count. */
static void the_reach_is_that_of_the_heads_station(void **state)
{
    (void)state;
    static const char *const sets[] = {"platform.kind=live", "platform.reach_m=4",
                                       "stations[1].name=b", "stations[1].position_m=[5,0,0]",
                                       "head.station=2",     "loop.pace=step"};
    struct rig *rig = rig_open(NULL, sets, 6);
    struct command_result result;
    struct pose pose;
    rig_go_to(rig, 300);
    assert_int_equal(device_pose(rig->device, 10000000, (double[6]){8}, NULL), SH_OK);
    assert_int_equal(device_pose(rig->device, 20000000, (double[6]){0}, NULL), SH_EINPUT);
    rig_tell(rig, "TIME:STEP 1 MS, 5,0,0,0,0,0", rig->next - 1);
    device_command(rig->device, 1, "TIME:STEP 1 MS, 0,0,0,0,0,0", rig->next - 1, &result);
    assert_int_equal(result.error, CMD_E_RANGE);
    assert_int_equal(device_head_pose(rig->device, 15000000, &pose), 1);
    rig_tell(rig, "HEAD:STATION 1", rig->next - 1);
    assert_int_equal(device_head_pose(rig->device, 15000000, &pose), 0);
    rig_tell(rig, "TIME:STEP 1 MS, 0,0,0,0,0,0", rig->next - 1);
    assert_int_equal(device_pose(rig->device, 20000000, (double[6]){0}, NULL), SH_OK);
    assert_int_equal(device_pose(rig->device, 30000000, (double[6]){5}, NULL), SH_EINPUT);
    assert_int_equal(device_head_pose(rig->device, 15000000, &pose), 0); /* between the two */
    assert_int_equal(device_head_pose(rig->device, 20000000, &pose), 1);
    assert_int_equal(device_head_pose(rig->device, 24000000, &pose), 1);
    assert_true(pose.position_m[0] == 0.0); /* the motion from the pose out of reach does not go on */
    rig_close(rig);
}

/* Gives `n` poses, 1 ms apart, from `from_ms` on: north at 1 m/s. Returns how many were taken. */
static int ride(struct rig *rig, int from_ms, int n)
{
    int taken = 0;
    for (int i = from_ms; i < from_ms + n; i++)
        taken += device_pose(rig->device, i * INT64_C(1000000), (double[6]){0, 1e-3 * i}, NULL) == SH_OK;
    return taken;
}

/* A scan begins while as many poses are there as have room. After 3 s those that no pulse needs any more have made
 * room: as many as `room_ms` says. */
static void ride_with(const char *const *sets, int n_sets, int room_ms)
{
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, n_sets);
    struct sh_err err;
    struct pose pose;
    assert_int_equal(ride(rig, 1, 70000), DEVICE_POSES_KEPT);
    assert_int_equal(atomic_load(&device_counters(rig->device)->bad_poses), 70000 - DEVICE_POSES_KEPT);
    assert_int_equal(device_pose(rig->device, INT64_C(80000000000), (double[6]){0}, &err), SH_ESTATE);
    assert_string_equal(err.text, "a pose has no room: the 65536 that the head keeps are still needed; send it later");
    rig_wait(rig, NATIVE_EV_SCAN_START, 1000);
    for (int i = 0; i < 500; i++) {
        assert_true(rig_claim(rig));
        for (uint32_t k = 0; k < rig->work.n_poses; k++) {
            const struct pose_knot *knot = &rig->work.pose[k];
            assert_int_equal(knot->flags, 0);
            assert_true(fabs(knot->pose.position_m[1] - 1e-9 * (double)(rig->work.scan_t0_ns + knot->t_ns)) < 1e-12);
        }
    }
    rig_go_to(rig, 3001);
    const int taken = ride(rig, DEVICE_POSES_KEPT + 1, 4000);
    assert_true(taken >= room_ms - 5 && taken <= room_ms + 5);
    for (int ms = room_ms + 10; ms < DEVICE_POSES_KEPT; ms += 997) {
        assert_int_equal(device_head_pose(rig->device, ms * INT64_C(1000000), &pose), 1);
        assert_true(fabs(pose.position_m[1] - 1e-3 * ms) < 1e-9);
    }
    rig_close(rig);
}

/* A pose that pulses still need keeps its place, and the pose that would take the place is refused. Where there is a
 * receiver, its fixes need the poses of the last 2 s, too. */
static void no_pose_is_lost_before_its_time(void **state)
{
    (void)state;
    static const char *const sets[] = {"platform.kind=live",      "platform.reach_m=100",
                                       "head.frames=0",           "scene.anchor.source=explicit",
                                       "scene.anchor.lat_deg=0",  "scene.anchor.lon_deg=11",
                                       "scene.anchor.height_m=0", "links[0].type=null",
                                       "links[0].protocol=nmea",  "time.epoch=2026-01-01T00:00:00Z"};
    ride_with(sets, 3, 3000);
    ride_with(sets, sizeof sets / sizeof sets[0], 1000);
}

/* A single pose is far ahead. Until its time the head is at its station, which is flagged, counted and announced.
 * A pose before it is refused, and the reason names its time. */
static void no_pose_is_used_before_its_time(void **state)
{
    (void)state;
    static const char *const sets[] = {"platform.kind=live", "head.frames=0"};
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 2);
    struct sh_err err;
    assert_int_equal(device_pose(rig->device, INT64_C(1000000000000), (double[6]){3, 1, 0, 0, 0, 45}, &err), SH_OK);
    rig_wait(rig, NATIVE_EV_SCAN_START, 1000);
    const struct native_event *event = rig_event(rig, NATIVE_EV_POSE_LATE);
    if (event == NULL) event = rig_wait(rig, NATIVE_EV_POSE_LATE, 3);
    assert_string_equal(event->text, "no pose yet: the head is assumed to be at the station");
    assert_true(event->a == 1 && event->c == 0);
    rig_go_to(rig, rig->next + 20);
    assert_true(rig->work.n_poses >= 2);
    for (uint32_t k = 0; k < rig->work.n_poses; k++)
        assert_true(rig->work.pose[k].flags == POSE_NONE && rig->work.pose[k].pose.position_m[0] == 0.0);
    assert_true(atomic_load(&device_counters(rig->device)->late_poses) >= 20);
    assert_int_equal(device_pose(rig->device, INT64_C(999000000000), (double[6]){0}, &err), SH_EINPUT);
    assert_string_equal(err.text, "a pose is not after the last pose, of 1000 s");
    rig_close(rig);
}

enum { RIDE_TICKS = 500, RIDE_POSES = 4 }; /* poses of the head in a tick */

/* Makes a ride of RIDE_TICKS ticks with commands and, unless a journal has them, poses: some are given a moment ahead,
 * some are refused. Keeps the head's poses of each tick. */
static void make_ride(const struct device_options *options, int gives, struct pose_knot knot[][RIDE_POSES])
{
    static const char *const sets[] = {"platform.kind=live", "platform.reach_m=5", "head.frames=0", "loop.pace=step"};
    struct rig *rig = rig_open(options, sets, 4);
    memset(knot, 0, RIDE_TICKS * sizeof *knot);
    for (int i = 0; i < RIDE_TICKS; i++) {
        const double t = 1e-3 * i, v[6] = {t / 3.0, sin(t), i == 350 ? 9.0 : -0.0, 1e-17 * i, -50.0 * t, 100.0 * t};
        if (gives && i % 7 == 0) device_pose(rig->device, (i + i % 3) * INT64_C(1000000) + 123, v, NULL);
        if (gives && i == 300) rig_tell(rig, "HEAD:PRR 50000", rig->next - 1);
        assert_true(rig_claim(rig) && rig->work.n_poses <= RIDE_POSES);
        memcpy(knot[i], rig->work.pose, rig->work.n_poses * sizeof **knot);
    }
    struct sh_err err;
    need(device_close_journal(rig->device, &err), &err);
    rig_close(rig);
}

/* Poses are in the journal to the last bit, with the tick that they were there for. */
static void a_replay_has_the_poses(void **state)
{
    (void)state;
    static struct pose_knot once[RIDE_TICKS][RIDE_POSES], again[RIDE_TICKS][RIDE_POSES];
    make_ride(&(struct device_options){.start = 1, .journal = journal_path}, 1, once);
    make_ride(&(struct device_options){.start = 1, .replay = journal_path}, 0, again);
    assert_true(once[RIDE_TICKS - 1][0].pose.position_m[0] > 0.1);
    assert_memory_equal(again, once, sizeof once);
}

/* While a journal with poses is replayed, no others are taken. That lasts until its END; where it has none, until its
 * last line. A journal without poses, as earlier heads wrote it, leaves them to the peer. */
static void a_replay_takes_no_other_poses(void **state)
{
    (void)state;
    static const char *const sets[] = {"platform.kind=live", "loop.pace=step"};
    static const struct {
        const char *lines;
        int at_10_ms, at_30_ms; /* whether poses are taken */
    } rows[] = {{"0 1000000 0 POSE 1 0 0 0 0 0\n20 9000000 1 HEAD:LINES 50\n", 0, 1},
                {"0 1000000 0 POSE 1 0 0 0 0 0\n40 40000000 0 END\n", 0, 0},
                {"20 9000000 1 HEAD:LINES 50\n40 40000000 0 END\n", 1, 1},
                {"20 9000000 1 HEAD:LINES 50\n", 1, 1}};
    const double v[6] = {2};
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        struct command_result result;
        struct sh_err err;
        FILE *f = fopen(journal_path, "w");
        assert_non_null(f);
        fprintf(f, "# scanhead journal 1\n%s", rows[i].lines);
        assert_int_equal(fclose(f), 0);
        struct rig *rig = rig_open(&(struct device_options){.replay = journal_path}, sets, 2);
        rig_go_to(rig, 10);
        assert_int_equal(device_pose(rig->device, 5000000, v, &err), rows[i].at_10_ms ? SH_OK : SH_ESTATE);
        if (!rows[i].at_10_ms)
            assert_string_equal(err.text, "a pose came while a journal with poses is being replayed");
        device_command(rig->device, 1, "TIME:STEP 1 MS, 1,0,0,0,0,0", 9, &result);
        assert_int_equal(result.error, rows[i].at_10_ms ? 0 : CMD_E_SETTINGS);
        rig_tell(rig, "TIME:STEP 1 MS", 9);
        rig_go_to(rig, 30);
        assert_int_equal(device_pose(rig->device, 6000000, v, NULL), rows[i].at_30_ms ? SH_OK : SH_ESTATE);
        device_command(rig->device, 1, "TIME:STEP 1 MS, 1,0,0,0,0,0", 29, &result);
        assert_int_equal(result.error, rows[i].at_30_ms ? 0 : CMD_E_SETTINGS);
        rig_close(rig);
    }
}

/* There is one pose for a time. A pose is refused where it is older than the newest one, or beyond platform.reach_m. */
static void poses_come_in_order(void **state)
{
    (void)state;
    static const char *const sets[] = {"platform.kind=live", "platform.reach_m=50"};
    struct rig *rig = rig_open(NULL, sets, 2);
    rig_go_to(rig, 10);
    static const struct {
        int64_t t_ns;
        double y_m;
        int bad;
    } rows[] = {{50000000, 1, 0}, {50000000, 2, 1},      {49999999, 2, 1},
                {50000001, 3, 0}, {60000000, 50.001, 1}, {60000000, 50, 0}};
    uint64_t n_bad = 0;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        const double v[6] = {0, rows[i].y_m};
        assert_int_equal(device_pose(rig->device, rows[i].t_ns, v, NULL), rows[i].bad ? SH_EINPUT : SH_OK);
        n_bad += (uint64_t)rows[i].bad;
        assert_int_equal(atomic_load(&device_counters(rig->device)->bad_poses), n_bad);
    }
    rig_close(rig);
}

/* A head that isn't on a live platform has no room for poses. */
static void a_pose_needs_a_live_platform(void **state)
{
    (void)state;
    struct rig *rig = rig_open(NULL, NULL, 0);
    struct sh_err err;
    assert_int_equal(device_pose(rig->device, 5000000, (double[6]){0}, &err), SH_EINPUT);
    assert_string_equal(err.text, "a pose needs platform.kind: live");
    rig_close(rig);
}

/* In lock-step a tick has all pulses that fire within it: none waits for its packet to be whole. At other paces, and
 * without a live platform, some do, and the stream is the same at any pace. */
static void a_tick_of_lock_step_has_all_its_pulses(void **state)
{
    (void)state;
    static const char *const sets[] = {"head.prr_hz=123456.789", "head.frames=0", "platform.kind=live",
                                       "loop.pace=step"};
    for (int n_sets = 2; n_sets <= 4; n_sets++) {
        struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, n_sets);
        int left = 0;
        rig_go_to(rig, 300);
        for (int i = 0; i < 200; i++) {
            assert_true(rig_claim(rig) && rig->work.scanning);
            const int64_t end_ns = (int64_t)rig->next * 1000000 - rig->work.scan_t0_ns;
            const uint64_t due = schedule_pulse_at(&rig->work.segment, end_ns);
            assert_true(due - rig->work.pulse_end < SCHEDULE_PACKET);
            left += due != rig->work.pulse_end;
        }
        assert_true(n_sets == 4 ? left == 0 : left > 100);
        rig_close(rig);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_tick_of_lock_step_has_all_its_pulses),
        cmocka_unit_test(a_pose_far_ahead_keeps_no_other_out),
        cmocka_unit_test(a_live_head_is_not_too_slow),
        cmocka_unit_test(a_platform_stands_where_the_scan_ended),
        cmocka_unit_test(a_path_ends_with_its_last_pose),
        cmocka_unit_test(a_live_platform_goes_on_for_a_while),
        cmocka_unit_test(poses_come_in_order),
        cmocka_unit_test(a_replay_has_the_poses),
        cmocka_unit_test(a_replay_takes_no_other_poses),
        cmocka_unit_test(the_reach_is_that_of_the_heads_station),
        cmocka_unit_test(no_pose_is_lost_before_its_time),
        cmocka_unit_test(no_pose_is_used_before_its_time),
        cmocka_unit_test(a_pose_needs_a_live_platform),
    };
    return cmocka_run_group_tests_name("device path", tests, make_folder, remove_folder);
}
