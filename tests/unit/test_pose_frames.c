/* SPDX-License-Identifier: MIT */
/* The poses of a moving head as they go out with its pulses: on a trajectory and before, between and after the poses of
 * a live platform. Points beside them show where moving meshes are. */
#include <math.h>

#include "core/pose.h"
#include "firmware_sim/device/device_state.h"
#include "tests/unit/device_rig.h"

#define MS INT64_C(1000000)

static struct native_pose sent[NATIVE_MAX_POSES];
static uint32_t n_sent;

/* Takes the poses of the last tick from its frames. There is one such frame in it. */
static void take_poses(struct rig *rig)
{
    const struct ring_tick *tick = rig_fill(rig);
    n_sent = 0;
    for (uint32_t at = 0; at < tick->len; at += (uint32_t)native_frame_len(tick->bytes + at)) {
        struct native_header h;
        const uint8_t *payload = tick->bytes + at + NATIVE_HEADER_LEN;
        native_read_header(tick->bytes + at, &h);
        if (h.type != NATIVE_POSES) continue;
        assert_int_equal(n_sent, 0);
        assert_int_equal(native_decode_poses(payload, h.length, &n_sent), SH_OK);
        assert_true(n_sent >= 2 && n_sent <= NATIVE_MAX_POSES);
        for (uint32_t i = 0; i < n_sent; i++)
            native_decode_pose(payload, i, &sent[i]);
    }
    /* They reach from before the first pulse to after the last one, and their times rise. */
    assert_true(sent[0].t_ns <= schedule_time_ns(&rig->work.segment, rig->work.pulse0));
    assert_true(sent[n_sent - 1].t_ns >= schedule_time_ns(&rig->work.segment, rig->work.pulse_end - 1));
    for (uint32_t i = 1; i < n_sent; i++)
        assert_true(sent[i].t_ns > sent[i - 1].t_ns);
}

/* ---- a live platform */

static int64_t t0_ns; /* of the scan, device time */

/* The head goes north at 2 m/s, and is at y = 1 m when the scan is 0.3 s old. */
static double way_m(int64_t scan_ns)
{
    return 1.0 + 2e-9 * (double)(scan_ns - 300 * MS);
}

static void expect_poses(double (*y_m)(int64_t scan_ns), uint32_t flags)
{
    for (uint32_t i = 0; i < n_sent; i++) {
        const double want_m = y_m != NULL ? y_m(sent[i].t_ns) : 0.0;
        assert_int_equal(sent[i].flags, flags);
        assert_int_equal(sent[i].t_ns % MS, 0); /* one a tick */
        assert_true(fabs(sent[i].position_m[1] - want_m) < 1e-9 && sent[i].position_m[0] == 0.0);
        assert_true(fabs(fabs(sent[i].quat[0]) - 1.0) < 1e-12); /* it does not turn */
    }
}

static double last_m(int64_t scan_ns)
{
    (void)scan_ns;
    return way_m(350 * MS); /* 330 ms, and extrapolate_ms */
}

static void live_poses_are_sent(void **state)
{
    (void)state;
    static const char *const sets[] = {"platform.kind=live", "platform.extrapolate_ms=20", "platform.reach_m=50",
                                       "head.frames=0"};
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 4);
    t0_ns = (int64_t)rig_wait(rig, NATIVE_EV_SCAN_START, 1000)->b;
    const uint64_t start = rig->next - 1;
    const struct native_event *event = rig_event(rig, NATIVE_EV_POSE_LATE);
    if (event == NULL) event = rig_wait(rig, NATIVE_EV_POSE_LATE, 3);
    assert_string_equal(event->text, "no pose yet: the head is assumed to be at the station");
    assert_true(event->a == 1 && event->c == 0);
    for (int i = 0; i < 20; i++) { /* one event an episode */
        assert_true(rig_claim(rig) && rig_event(rig, NATIVE_EV_POSE_LATE) == NULL);
        take_poses(rig);
        expect_poses(NULL, POSE_NONE);
    }
    const uint64_t n_none = atomic_load(&device_counters(rig->device)->late_poses);
    assert_true(n_none >= 21 && n_none <= 23); /* one a tick of 1 ms */

    rig_go_to(rig, start + 290);
    for (int i = 0; i < 4; i++) {
        const int64_t at_ns = (300 + 10 * i) * MS;
        assert_int_equal(device_pose(rig->device, t0_ns + at_ns, (double[]){0, way_m(at_ns), 0, 0, 0, 0}, NULL), 0);
    }
    rig_go_to(rig, start + 303);
    for (int ms = 303; ms < 329; ms++) {
        assert_true(rig_claim(rig));
        take_poses(rig);
        expect_poses(way_m, 0);
    }
    rig_go_to(rig, start + 333);
    for (int ms = 333; ms < 349; ms++) {
        assert_true(rig_claim(rig));
        take_poses(rig);
        expect_poses(way_m, POSE_EXTRAPOLATED);
    }
    const uint64_t before = atomic_load(&device_counters(rig->device)->late_poses);
    rig_go_to(rig, start + 349);
    while (rig_event(rig, NATIVE_EV_POSE_LATE) == NULL && rig->next < start + 400)
        assert_true(rig_claim(rig));
    assert_null(rig_event(rig, NATIVE_EV_POSE_LATE)); /* within a second of the last one that was late */
    assert_true(atomic_load(&device_counters(rig->device)->late_poses) > before);
    take_poses(rig);
    expect_poses(last_m, POSE_LATE);
    rig_close(rig);
}

/* A second without a late pose ends an episode. The next one is reported with the time since the last pose. */
static void an_episode_is_reported_once(void **state)
{
    (void)state;
    static const char *const sets[] = {"platform.kind=live", "platform.extrapolate_ms=20", "platform.reach_m=50",
                                       "head.frames=0"};
    struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 4);
    rig_go_to(rig, 10);
    for (int i = 0; i < 2; i++) /* it stands for 2 s */
        assert_int_equal(device_pose(rig->device, (100 + 1900 * i) * MS, (double[6]){0}, NULL), 0);
    t0_ns = (int64_t)rig_wait(rig, NATIVE_EV_SCAN_START, 1000)->b;
    const struct native_event *event = rig_wait(rig, NATIVE_EV_POSE_LATE, 2000);
    assert_string_equal(event->text, "no pose came in time: the platform is assumed to stand");
    assert_int_equal(event->a, 1);
    assert_true(event->c > 20 * (uint64_t)MS && event->c <= 22 * (uint64_t)MS);
    assert_true(rig->next >= 2020 && rig->next <= 2022);
    rig_close(rig);
}

/* From a single pose no motion follows. Before it the head is at its station; in lock-step the pose is that of the step
 * that leads to it. */
static void expect_single_pose(int steps)
{
    static const char *const sets[] = {"platform.kind=live", "platform.extrapolate_ms=20", "platform.reach_m=50",
                                       "loop.pace=step"};
    struct rig *rig = rig_open(NULL, sets, steps ? 4 : 3);
    struct pose pose;
    rig_go_to(rig, 10);
    assert_int_equal(device_pose(rig->device, 15 * MS, (double[]){1, 3, 0, 0, 0, 0}, NULL), 0);
    assert_int_equal(device_head_pose(rig->device, 10 * MS, &pose), steps);
    for (int ms = steps ? 10 : 15; ms < 60; ms += 5) {
        assert_int_equal(device_head_pose(rig->device, ms * MS, &pose), 1);
        assert_true(pose.position_m[0] == 1.0 && pose.position_m[1] == 3.0);
    }
    rig_close(rig);
}

static void a_single_pose_stands(void **state)
{
    (void)state;
    expect_single_pose(0);
    expect_single_pose(1);
}

/* ---- a trajectory */

/* Writes a path north at 1 m/s, with a knot each step_s, n of them. */
static void write_path(const char *path, int n, double step_s)
{
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fputs("t_s,x_m,y_m,z_m,heading_deg\n", f);
    for (int i = 0; i < n; i++)
        fprintf(f, "%.9f,0,%.9f,0,0\n", i * step_s, i * step_s);
    assert_int_equal(fclose(f), 0);
}

static double north_m(int64_t scan_ns)
{
    return 1e-9 * (double)scan_ns;
}

/* All knots that a tick's pulses need are sent, and none beside. After the last one the head stands. */
static void knots_of_a_path_are_sent(void **state)
{
    (void)state;
    char path[96], set[128];
    snprintf(path, sizeof path, "%s/knots.csv", folder);
    snprintf(set, sizeof set, "platform.file=%s", path);
    static const struct {
        int n;
        double step_s;
        const char *tick, *prr;
        uint32_t least, most;                                               /* poses of a tick in the middle */
    } rows[] = {{3, 0.02, "loop.tick_hz=1000", "head.prr_hz=300000", 2, 3}, /* few ticks have a knot */
                {81, 0.0005, "loop.tick_hz=1000", "head.prr_hz=300000", 3, 5},
                {10001, 0.0001, "loop.tick_hz=100", "head.prr_hz=20000", 100, 112}}; /* a packet takes 0.8 ms */
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        const char *const sets[] = {"platform.kind=trajectory", set,          "stations[1].name=b", "head.frames=0",
                                    "platform.at_end=hold",     rows[k].tick, rows[k].prr};
        const double end_m = (rows[k].n - 1) * rows[k].step_s;
        write_path(path, rows[k].n, rows[k].step_s);
        struct rig *rig = rig_open(&(struct device_options){.start = 1}, sets, 7);
        rig_wait(rig, NATIVE_EV_SCAN_START, 1000);
        rig_go_to(rig, rig->next + 5);
        for (int i = 0; i < 30; i++) {
            assert_true(rig_claim(rig));
            take_poses(rig);
            if (n_sent < rows[k].least || n_sent > rows[k].most) fail_msg("row %zu: %u poses", k, n_sent);
            for (uint32_t p = 0; p < n_sent; p++)
                assert_true(sent[p].flags == 0 && fabs(sent[p].position_m[1] - north_m(sent[p].t_ns)) < 1e-8);
        }
        rig_go_to(rig, rig->next + 80); /* the path is over */
        assert_true(rig_claim(rig));
        take_poses(rig);
        assert_int_equal(n_sent, 2);
        for (uint32_t p = 0; p < n_sent; p++)
            assert_true(fabs(sent[p].position_m[1] - end_m) < 1e-8);
        rig_close(rig);
    }
    unlink(path);
}

/* ---- moving meshes */

static const double RISE_M_S = 10.0;

/* Checks the points on the floor around the head, 2 m below it at first, in one frame. The encoders place a point to
 * 6e-6 rad at up to 7 m. Returns how many points there are. */
static uint32_t check_floor(const struct rig *rig, const uint8_t *payload, size_t len)
{
    struct native_points head;
    uint32_t n = 0;
    assert_int_equal(native_decode_points(payload, len, &head), SH_OK);
    for (uint32_t i = 0; i < head.n_points; i++) {
        struct native_point point;
        native_decode_point(payload, i, &point);
        const double x_m = (int32_t)point.a * rig->site->scale_m, y_m = (int32_t)point.b * rig->site->scale_m,
                     z_m = (int32_t)point.c * rig->site->scale_m;
        if (point.echo == 0 || fabs(x_m) > 3.99 || fabs(y_m) > 4.99) continue; /* a wall */
        const int64_t tick = native_after_ns(head.t0_ns, point.dt_ns) / MS;
        const double want_m = -2.0 + RISE_M_S * 1e-3 * (double)tick;
        if (fabs(z_m - want_m) > 1e-4) fail_msg("tick %lld: floor at %.4f m, not %.4f", (long long)tick, z_m, want_m);
        n++;
    }
    return n;
}

/* The boxes rise, and others of their kind stand far above them. */
static void write_rising(const char *path)
{
    FILE *f = fopen(path, "w");
    assert_non_null(f);
    fprintf(f,
            "head: {profile: %s/head.yaml, pan_deg_s: 180, pan_stop_deg: 90}\n"
            "scene:\n  meshes:\n    - {file: room.obj, up: z, scale: 1, move_m_s: [0, 0, 10]}\n"
            "    - {file: room.obj, up: z, scale: 1, offset_m: [0, 0, 500]}\n"
            "stations: [{position_m: [0, 0, 0]}]\n",
            folder);
    assert_int_equal(fclose(f), 0);
}

/* A pulse meets a moving mesh where that is at the start of the pulse's own tick, also where the pulse waited for its
 * packet: a packet of 16 pulses takes 1.6 to 16 ticks here. In lock-step no pulse waits, and the same holds. */
static void a_mesh_is_where_it_is_at_a_pulses_tick(void **state)
{
    (void)state;
    static const char *const rates[] = {"head.prr_hz=1000", "head.prr_hz=3700", "head.prr_hz=10000"};
    char path[96];
    snprintf(path, sizeof path, "%s/rise.yaml", folder);
    write_rising(path);
    for (int i = 0; i < 6; i++) {
        const char *const sets[] = {"output.layout=geo", "head.frames=0",      "head.lines_hz=20",
                                    rates[i % 3],        "platform.kind=live", "loop.pace=step"};
        struct rig *rig = rig_open_file("rise.yaml", &(struct device_options){.start = 1}, sets, i < 3 ? 4 : 6);
        uint32_t n = 0;
        rig_wait(rig, NATIVE_EV_SCAN_START, 1000);
        for (int k = 0; k < 120; k++) {
            const struct ring_tick *tick = rig_fill(rig);
            for (uint32_t at = 0; at < tick->len; at += (uint32_t)native_frame_len(tick->bytes + at)) {
                struct native_header h;
                native_read_header(tick->bytes + at, &h);
                if (h.type == NATIVE_POINTS) n += check_floor(rig, tick->bytes + at + NATIVE_HEADER_LEN, h.length);
            }
            assert_true(rig_claim(rig));
        }
        assert_true(n > 10);
        rig_close(rig);
    }
    unlink(path);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(live_poses_are_sent),
        cmocka_unit_test(an_episode_is_reported_once),
        cmocka_unit_test(a_single_pose_stands),
        cmocka_unit_test(knots_of_a_path_are_sent),
        cmocka_unit_test(a_mesh_is_where_it_is_at_a_pulses_tick),
    };
    return cmocka_run_group_tests_name("poses that are sent", tests, make_folder, remove_folder);
}
