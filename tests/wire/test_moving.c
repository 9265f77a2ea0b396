/* SPDX-License-Identifier: MIT */
/* A head that moves: the stream has all that a client needs to take the polar points back to the scene. */
#include "tests/wire/room.h"

static const struct room_config RIDE = {.profile = NULL,
                                        .prr_hz = 123456.7,
                                        .lines_hz = 97.7,
                                        .pan_deg_s = 150,
                                        .pan_stop_deg = 150,
                                        .frames = 1,
                                        .links = LINK_YAML_TCP,
                                        .more = "platform: {kind: trajectory, file: ride.csv, mount_m: [0.1, 0.4, 0.3],"
                                                " mount_heading_deg: 20, mount_pitch_deg: 5}\n"
                                                "loop: {queue_ms: 10000, late_ms: 10000}\n"};

/* The platform goes round in a circle at constant rate, leaning. The circle is a closed form, whatever the
 * interpolation. */
static const double RADIUS_M = 1.7, RATE = 1.9, MIDDLE[3] = {0.6, -1.1, 0.1};

static void write_ride(const struct wire *wire)
{
    FILE *f = fopen(wire_path(wire, "ride.csv"), "w");
    assert_non_null(f);
    fprintf(f, "t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg\n");
    for (int i = 0; i <= 150; i++) {
        double t = 0.01 * i;
        fprintf(f, "%.17g,%.17g,%.17g,%.17g,0,0,%.17g\n", 100 + t, MIDDLE[0] + RADIUS_M * cos(RATE * t),
                MIDDLE[1] + RADIUS_M * sin(RATE * t), MIDDLE[2], -RATE * t * 180.0 / M_PI);
    }
    assert_int_equal(fclose(f), 0);
}

/* Writes the head's origin at t by hand: the platform's y axis points along the circle, x away from its middle. */
static void head_at(double t, double p[3])
{
    double c = cos(RATE * t), s = sin(RATE * t);
    p[0] = MIDDLE[0] + (RADIUS_M + 0.1) * c - 0.4 * s;
    p[1] = MIDDLE[1] + (RADIUS_M + 0.1) * s + 0.4 * c;
    p[2] = MIDDLE[2] + 0.3;
}

static double off_wall(const struct scanhead_point *p, int wall)
{
    const double at[3] = {p->x, p->y, p->z};
    return fabs(at[wall / 2] - (wall & 1 ? ROOM_MAX : ROOM_MIN)[wall / 2]);
}

struct ride {
    uint64_t points;
    /* worst_m and naive_m are distances from the walls, naive_m with the pose of the line's first pulse. pose_m is the
     * distance of poses from the circle. */
    double worst_m, naive_m, pose_m;
    char head[65], client[65];
};

/* Places points as a reader without poses in between would: with one pose per line. */
static void place_naively(const struct scanhead_pose *pose, struct scanhead_point *p)
{
    const double *q = pose->quat, v[3] = {p->x, p->y, p->z};
    double u[3] = {q[2] * v[2] - q[3] * v[1], q[3] * v[0] - q[1] * v[2], q[1] * v[1] - q[2] * v[0]};
    double w[3] = {q[2] * u[2] - q[3] * u[1], q[3] * u[0] - q[1] * u[2], q[1] * u[1] - q[2] * u[0]};
    p->x = pose->position_m[0] + v[0] + 2 * (q[0] * u[0] + w[0]);
    p->y = pose->position_m[1] + v[1] + 2 * (q[0] * u[1] + w[1]);
    p->z = pose->position_m[2] + v[2] + 2 * (q[0] * u[2] + w[2]);
}

static void take_points(struct scanhead *sh, const struct scanhead_frame *frame, int geo, struct ride *ride)
{
    struct scanhead_point point[256], plain[256];
    struct scanhead_pose pose, line;
    for (uint32_t first = 0; first < frame->n_points;) {
        int n = scanhead_points(sh, frame, first, point, 256);
        assert_true(n > 0);
        memcpy(plain, point, sizeof plain);
        if (!geo) assert_int_equal(scanhead_to_scene(sh, point, (uint32_t)n, NULL), 0);
        int have_line = scanhead_pose(sh, frame->line_t0_ns, &line) == SCANHEAD_OK;
        for (int i = 0; i < n; i++) {
            double want[3], d2 = 0;
            assert_int_equal(point[i].echo, 1); /* the room is closed */
            ride->worst_m = fmax(ride->worst_m, off_wall(&point[i], point[i].label));
            assert_int_equal(scanhead_pose(sh, point[i].t_ns, &pose), SCANHEAD_OK);
            head_at(1e-9 * (double)point[i].t_ns, want);
            for (int k = 0; k < 3; k++)
                d2 += (pose.position_m[k] - want[k]) * (pose.position_m[k] - want[k]);
            ride->pose_m = fmax(ride->pose_m, sqrt(d2));
            if (!have_line || geo) continue;
            place_naively(&line, &plain[i]);
            ride->naive_m = fmax(ride->naive_m, off_wall(&plain[i], point[i].label));
        }
        ride->points += (uint64_t)n;
        first += (uint32_t)n;
    }
}

static void ride_once(struct wire *wire, const char *pace, const char *threads, const char *set, struct ride *ride)
{
    const char *const more[] = {"--pace", pace, "--threads", threads, "--set", set, NULL};
    struct head head = head_start(wire, wire_path(wire, "config.yaml"), more);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    struct scanhead_frame frame;
    struct scanhead_info info;
    int geo = strstr(set, "geo") != NULL;
    memset(ride, 0, sizeof *ride);
    scanhead_hash_start(sh);
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    do {
        client_next(sh, &frame);
        if (frame.type == SCANHEAD_POINTS) take_points(sh, &frame, geo, ride);
    } while (!is_event(&frame, SCANHEAD_EV_SCAN_END));
    assert_int_equal(scanhead_get_info(sh, &info), SCANHEAD_OK);
    assert_true(info.moving);
    scanhead_hash_hex(sh, ride->client);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    stats_hash(wire, ride->head);
    assert_string_equal(ride->client, ride->head);
    assert_int_equal(ride->points, stats_uint(wire, "pulses"));
    assert_int_equal(stats_uint(wire, "late_poses"), 0);
}

/* The encoders read to half of 2^-20 turns in both axes, 3.0e-6 rad each, and the room's farthest corner is 15 m away:
 * 15 * 3.0e-6 * sqrt(2) = 6.4e-5 m. Ranges are rounded to 5e-7 m. Interpolation only adds rounding. In the geo layout
 * the head read the same encoders. Poses follow the circle to 1e-4 m (the head's own bound), and the cubic between
 * samples of 10 ms to R (rate dt)^3 / 62 = 2e-7 m. */
static void test_undistorted(void **state)
{
    struct wire *wire = *state;
    struct ride ride, other;
    room_write(wire);
    write_ride(wire);
    room_config_write(wire, &RIDE);
    ride_once(wire, "fast", "1", "noise.seed=1", &ride);
    print_message(
        "# %llu points of a ride: off the walls by %.4f mm, with one pose per line by %.0f mm; poses by %.4f mm\n",
        (unsigned long long)ride.points, 1e3 * ride.worst_m, 1e3 * ride.naive_m, 1e3 * ride.pose_m);
    assert_true(ride.worst_m < 6.5e-5);
    assert_true(ride.naive_m > 0.02); /* 3.4 m/s, 10 ms a line */
    assert_true(ride.pose_m < 1.0e-4 + 1e-6 && ride.pose_m > 1e-6);
    static const char *const runs[][2] = {{"fast", "2"}, {"realtime", "2"}, {"fast", "3"}};
    for (int i = 0; i < 3; i++) {
        ride_once(wire, runs[i][0], runs[i][1], "noise.seed=1", &other);
        assert_string_equal(other.head, ride.head);
    }
    ride_once(wire, "fast", "2", "output.layout=geo", &other);
    assert_true(other.worst_m < 6.5e-5);
    assert_string_not_equal(other.head, ride.head);
}

/* At the trajectory's end the scan is over: after 1.5 s, or less where it starts later. Or the platform holds its
 * place. */
static void test_end_of_the_path(void **state)
{
    struct wire *wire = *state;
    static const struct {
        const char *set, *more;
        double s;
        unsigned frames;
    } runs[] = {{"platform.start_s=0", "head.frames=0", 1.5, 0},
                {"platform.start_s=1.25", "head.frames=0", 0.25, 0},
                {"platform.at_end=hold", "head.frames=2", 2.0, 2}};
    room_write(wire);
    write_ride(wire);
    char config[352];
    snprintf(config, sizeof config, "%s", room_config_write(wire, &RIDE));
    for (int i = 0; i < 3; i++) {
        char stats[352], poses[352];
        snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
        snprintf(poses, sizeof poses, "%s", wire_path(wire, "ride.poses.csv"));
        const char *const args[] = {"record",  config,  "--stats",   stats,   "-o",         poses,
                                    "--quiet", "--set", runs[i].set, "--set", runs[i].more, NULL};
        assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "head.out", "head.err", -1)), 0);
        double pulses = (double)stats_uint(wire, "pulses");
        /* all of the sweep is cast; a frame ends with its last line, of 1/97.7 s */
        assert_true(fabs(pulses - runs[i].s * RIDE.prr_hz) < (runs[i].frames != 0 ? 2 * 1264 * 2 : 1.01));
        size_t len;
        char *text = wire_read(wire_path(wire, "ride.poses.csv"), &len), *last = text + len - 2;
        while (last[-1] != '\n')
            last--;
        unsigned scan;
        double t, p[3], want[3];
        assert_int_equal(sscanf(last, "%u,%lf,%lf,%lf,%lf", &scan, &t, &p[0], &p[1], &p[2]), 5);
        assert_true(t >= runs[i].s - 1e-6);
        head_at(1.5, want); /* where it ends in any case */
        for (int k = 0; k < 3; k++)
            assert_true(fabs(p[k] - want[k]) < 1e-6);
        free(text);
    }
}

/* The ride may begin at the end only where the platform waits there. From 5 to 6.2 s are 1.2 s, but not to the last
 * bit: the difference is larger. */
static void test_beginning_at_the_end(void **state)
{
    struct wire *wire = *state;
    room_write(wire);
    wire_write_text(wire, "ride.csv",
                    "t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg\n5,0,0,0,0,0,0\n6.2,0.5,0,0,0,0,0\n");
    char config[352];
    snprintf(config, sizeof config, "%s", room_config_write(wire, &RIDE));
    const char *const stop[] = {"check", config, "--set", "platform.start_s=1.2", NULL},
                      *const hold[] = {
                          "check", config, "--set", "platform.start_s=1.2", "--set", "platform.at_end=hold", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, stop, "out", "err", -1)), 2);
    char *text = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(text, "platform.start_s: 1.2 s is not before the trajectory's end; allowed 0 to below 1.2"));
    free(text);
    assert_int_equal(wire_wait(wire, wire_spawn(wire, hold, "out", "err", -1)), 0);
}

/* The house is scanned from a car, off line, and compared with its mesh by the distance code of `scanhead report`. */
static void test_house(void **state)
{
    static const char house[] = "/usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc";
    struct wire *wire = *state;
    if (access(house, R_OK) != 0) {
        print_message("# %s is missing (Debian: assimp-testmodels)\n", house);
        skip();
    }
    wire_write_text(wire, "way.csv",
                    "x_m,y_m,z_m,speed_m_s,pause_s\n-8,-5,0.2,8,0\n6,-5,0.2,8,0\n18,-4,0.2,6,0.1\n"
                    "19,5,0.2,8,0\n18,14,0.2,8,0\n6,15,0.2,8,0\n");
    char config[352], cloud[352], *text;
    snprintf(cloud, sizeof cloud, "%s", wire_path(wire, "car.ply"));
    snprintf(
        config, sizeof config, "%s",
        wire_write_text(
            wire, "car.yaml",
            "head: {profile: full-sweep, prr_hz: 50000, lines_hz: 100, pan_deg_s: 0, frames: 0}\n"
            "scene: {ifc_reader: assimp, meshes: [{file: /usr/share/assimp/models/IFC/AC14-FZK-Haus.ifc, up: y, scale: 1}]}\n"
            "stations: [{position_m: [0, 0, 0]}]\n"
            "platform: {kind: trajectory, waypoints: way.csv, mount_m: [0, 0.5, 1.5],"
            " mount_heading_deg: -90}\n"));
    const char *const record[] = {"record", config, "-o", cloud, "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, record, "head.out", "head.err", -1)), 0);
    const char *const report[] = {"report", config, cloud, "--json", "--tolerance-m", "0.001", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, report, "report.json", "head.err", -1)), 0);
    text = wire_read(wire_path(wire, "report.json"), NULL);
    const char *most = strstr(text, "\"max_m\":"), *points = strstr(text, "\"points\":");
    assert_true(most != NULL && points != NULL);
    print_message("# house from a car: %.0f points, at most %.4f mm off the mesh\n", atof(points + 9),
                  1e3 * atof(most + 8));
    assert_true(atof(points + 9) > 100000 && atof(most + 8) < 1e-3);
    free(text);
}

static void record_hash(struct wire *wire, const char *config, const char *threads, const char *set, char hash[65])
{
    char stats[352], cloud[352];
    snprintf(stats, sizeof stats, "%s", wire_path(wire, "stats.json"));
    snprintf(cloud, sizeof cloud, "%s", wire_path(wire, "long.ply"));
    const char *const args[] = {"record",  config,  "--stats", stats, "--threads", threads,
                                "--quiet", "--set", set,       "-o",  cloud,       NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "head.out", "head.err", -1)), 0);
    stats_hash(wire, hash);
}

static void write_long(struct wire *wire, const char *name, const char *gate, char config[352])
{
    char text[1024];
    snprintf(text, sizeof text,
             "head: {profile: full-sweep, prr_hz: 3000, lines_hz: 20, pan_deg_s: 0, frames: 0}\n"
             "scene:\n  meshes:\n    - {file: wall.obj, up: z, scale: 1}\n%s"
             "stations: [{position_m: [0, 0, 0]}]\n"
             "platform: {kind: trajectory, waypoints: way.csv, mount_heading_deg: -90}\n",
             gate);
    snprintf(config, 352, "%s", wire_write_text(wire, name, text));
}

/* 5 km at 100 m/s along a wall 12 m away, and past a gate that slides. There are several stretches, and any number of
 * threads gives the same. */
static void test_long_path(void **state)
{
    struct wire *wire = *state;
    char config[352], one[65], other[65], cloud[352];
    wire_write_text(wire, "wall.obj", "o wall\nv -100 12 -30\nv 6000 12 -30\nv 6000 12 30\nv -100 12 30\nf 1 2 3 4\n");
    wire_write_text(wire, "gate.obj", "o gate\nv 2000 12 -9\nv 3000 12 -9\nv 3000 12 9\nv 2000 12 9\nf 1 2 3 4\n");
    wire_write_text(wire, "way.csv", "x_m,y_m,z_m,speed_m_s\n0,0,0,100\n2500,0,0,100\n5000,1,0,100\n");
    write_long(wire, "long.yaml",
               "    - {file: gate.obj, up: z, scale: 1, offset_m: [0, -1, 0], move_m_s: [3, 0, 0]}\n", config);
    record_hash(wire, config, "1", "noise.seed=1", one);
    for (int i = 2; i <= 3; i++) {
        record_hash(wire, config, i == 2 ? "2" : "3", "noise.seed=1", other);
        assert_string_equal(other, one);
    }
    const char *const check[] = {"check", config, NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, check, "check.txt", "head.err", -1)), 0);
    char *text = wire_read(wire_path(wire, "check.txt"), NULL);
    assert_non_null(strstr(text, "; 3 stretches")); /* of 2 km each */
    free(text);
    /* The gate is left out, as `scanhead report` does not know it. The wall is 12 m away, and up to 30 m up; the bound
     * is the encoders'. */
    write_long(wire, "still.yaml", "", config);
    record_hash(wire, config, "2", "noise.seed=1", other);
    assert_string_not_equal(other, one);
    snprintf(cloud, sizeof cloud, "%s", wire_path(wire, "long.ply"));
    const char *const report[] = {"report", config, cloud, "--json", "--tolerance-m", "0.001", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, report, "report.json", "head.err", -1)), 0);
    text = wire_read(wire_path(wire, "report.json"), NULL);
    const char *most = strstr(text, "\"max_m\":");
    assert_true(most != NULL && atof(most + 8) < 2e-4);
    free(text);
}

/* ---- poses over UDP */

static int udp_to(const char *endpoint)
{
    struct sockaddr_in at = {.sin_family = AF_INET, .sin_port = htons((uint16_t)atoi(strrchr(endpoint, ':') + 1))};
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    int fd = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
    assert_true(fd >= 0);
    assert_int_equal(connect(fd, (struct sockaddr *)&at, sizeof at), 0);
    return fd;
}

/* A minute of a slow ride is sent ahead, so that it does not matter when the scan begins: x = 0.01 m/s t, heading 3
 * deg/s t. Four wrong lines are at the end: one of them beyond the zenith, one with a NUL. When the error is in the
 * queue, all lines before it have been taken. */
static void tell_ride(struct scanhead *sh, int fd)
{
    static const char wrong[] = "59 0 0 0 0 0 0\n61 0 0 0 0 91 0\n61 0 0 0 0 0 0\0\n61 0 0 0 0 nonsense\n";
    char text[8192];
    int n = 0;
    for (int t = 0; t <= 60; t++)
        n += snprintf(text + n, sizeof text - (size_t)n, "%d %.4f 0.2,-0.3 0 1.5 %d\n", t, 0.01 * t, 3 * t);
    memcpy(text + n, wrong, sizeof wrong); /* with its NUL at the end, as a program in C may send it */
    n += (int)sizeof wrong;
    assert_int_equal(send(fd, text, (size_t)n, 0), n);
    int64_t end_ms = wire_now_ms() + DEADLINE_MS;
    while (strcmp(client_ask(sh, "SYST:ERR:COUN?"), "0") == 0)
        assert_true(wire_now_ms() < end_ms);
}

static void test_poses_over_udp(void **state)
{
    static const struct room_config live = {.prr_hz = 50000,
                                            .lines_hz = 100,
                                            .pan_deg_s = 100,
                                            .pan_stop_deg = 40,
                                            .frames = 1,
                                            .links = LINK_YAML_TCP,
                                            .more = "platform: {kind: live, reach_m: 5, port: 0}\n"
                                                    "loop: {queue_ms: 10000, late_ms: 10000}\n"};
    struct wire *wire = *state;
    struct scanhead_frame frame;
    struct scanhead_point point[256];
    struct scanhead_pose pose;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &live), NULL);
    int fd = udp_to(head_endpoint(&head, "pose")), n;
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    uint64_t points = 0;
    int64_t t0_ns = 0;
    tell_ride(sh, fd);
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    do {
        client_next(sh, &frame);
        assert_false(is_event(&frame, SCANHEAD_EV_POSE_LATE));
        if (is_event(&frame, SCANHEAD_EV_SCAN_START)) t0_ns = (int64_t)frame.event_value[1];
        for (uint32_t first = 0;
             frame.type == SCANHEAD_POINTS && (n = scanhead_points(sh, &frame, first, point, 256)) > 0;
             first += (uint32_t)n) {
            assert_int_equal(scanhead_to_scene(sh, point, (uint32_t)n, NULL), 0);
            for (int i = 0; i < n; i++)
                assert_true(off_wall(&point[i], point[i].label) < 6.5e-5);
            assert_int_equal(scanhead_pose(sh, point[0].t_ns, &pose), SCANHEAD_OK);
            double t = 1e-9 * (double)(point[0].t_ns + t0_ns), half = 1.5 * t * M_PI / 180.0;
            double pitch = 0.75 * M_PI / 180.0;
            assert_int_equal(pose.flags, 0);
            assert_true(fabs(pose.position_m[0] - 0.01 * t) < 1e-9 && fabs(pose.position_m[2] + 0.3) < 1e-12);
            /* q = qz(-heading) qx(pitch): w = cos cos, z = -sin cos */
            assert_true(fabs(pose.quat[0] - cos(half) * cos(pitch)) < 1e-9);
            assert_true(fabs(pose.quat[3] + sin(half) * cos(pitch)) < 1e-9);
            points += (uint64_t)n;
        }
    } while (!is_event(&frame, SCANHEAD_EV_SCAN_END));
    assert_true(points > 10000);
    close(fd);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    assert_int_equal(stats_uint(wire, "bad_poses"), 4);
    assert_int_equal(stats_uint(wire, "late_poses"), 0);
}

/* Without any pose the head assumes that it is at the station, and says so. */
static void test_no_pose_at_all(void **state)
{
    static const struct room_config live = {.prr_hz = 50000,
                                            .lines_hz = 100,
                                            .pan_deg_s = 100,
                                            .pan_stop_deg = 20,
                                            .frames = 1,
                                            .links = LINK_YAML_TCP,
                                            .more =
                                                "platform: {kind: live}\nloop: {queue_ms: 10000, late_ms: 10000}\n"};
    struct wire *wire = *state;
    struct scanhead_frame frame;
    struct scanhead_pose pose;
    room_write(wire);
    struct head head = head_start(wire, room_config_write(wire, &live), NULL);
    struct scanhead *sh = client_open(head_endpoint(&head, "tcp"));
    int told = 0, poses = 0;
    client_wait_state(sh, "idle");
    client_tell(sh, "SCAN:STAR");
    do {
        client_next(sh, &frame);
        told += is_event(&frame, SCANHEAD_EV_POSE_LATE);
        if (frame.type != SCANHEAD_POSES) continue;
        assert_true(scanhead_poses(sh, &frame, 0, &pose, 1) == 1);
        assert_int_equal(pose.flags, SCANHEAD_POSE_NONE);
        for (int k = 0; k < 3; k++)
            assert_true(pose.position_m[k] == STATION[k]);
        poses++;
    } while (!is_event(&frame, SCANHEAD_EV_SCAN_END));
    assert_true(poses > 100);
    assert_int_equal(told, 1);
    scanhead_close(sh);
    head_end(&head, SIGTERM);
    assert_true(stats_uint(wire, "late_poses") > 100);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_undistorted, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_end_of_the_path, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_beginning_at_the_end, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_house, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_long_path, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_poses_over_udp, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_no_pose_at_all, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
