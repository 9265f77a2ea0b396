/* SPDX-License-Identifier: MIT */
/* Stop-and-go: the head stands at some poses of a trajectory, and scans. */
#include "tests/wire/room.h"

/* Five stops at 1, 1.25, ... 2 s of a path whose frames count by 10 a second, from 100 on. */
#define RIDE                                                 \
    "t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg,frame\n" \
    "50,0,0,0,0,0,0,100\n51,1.5,-2.25,0.5,0,0,30,110\n52,-2.25,1.75,0.75,0,0,90,120\n53,0,0,0,0,0,0,130\n"
#define STOPS "platform: {kind: stops, file: ride.csv, start_s: 1, end_s: 2, step_s: 0.25}\n"
enum { N_STOPS = 5 };

static struct room_config base(const char *more)
{
    return (struct room_config){.prr_hz = 20000,
                                .lines_hz = 50,
                                .pan_deg_s = 150,
                                .pan_stop_deg = 350,
                                .frames = 1,
                                .links = "links: [{type: \"null\"}]\n",
                                .more = more};
}

static void record(struct wire *wire, const char *config, const char *station, const char *out)
{
    char from[352], to[352];
    snprintf(from, sizeof from, "%s", wire_path(wire, config));
    snprintf(to, sizeof to, "%s", wire_path(wire, out));
    const char *const args[] = {"record", from, "--station", station, "-o", to, "--quiet", NULL};
    wire_run(wire, args, 0);
}

/* Returns the payloads of a scan's points. */
static uint8_t *points_of(struct wire *wire, const char *stream, size_t *len)
{
    struct scanhead_frame frame;
    uint8_t *all = NULL;
    struct scanhead *sh = client_open(wire_path(wire, stream));
    *len = 0;
    while (scanhead_next(sh, &frame, -1) == 0) {
        if (frame.type != SCANHEAD_POINTS) continue;
        all = realloc(all, *len + frame.payload_len);
        assert_non_null(all);
        memcpy(all + *len, frame.payload, frame.payload_len);
        *len += frame.payload_len;
    }
    scanhead_close(sh);
    assert_true(*len > 100000);
    return all;
}

/* The bytes are those of a station of the configuration at that pose. Stops 1 and 5 are the samples themselves, whose
 * numbers a station can have. */
static void test_as_a_station(void **state)
{
    struct wire *wire = *state;
    static const char *const stop[] = {"1", "5"};
    struct room_config plain = base(NULL), stops = base(STOPS);
    char path[352], text[4096], *at;
    room_write(wire);
    wire_write_text(wire, "ride.csv", RIDE);
    snprintf(path, sizeof path, "%s", room_config_write(wire, &plain));
    at = wire_read(path, NULL);
    char *list = strstr(at, "stations:\n"), *rest = strstr(at, "noise:");
    snprintf(text, sizeof text,
             "%.*sstations:\n  - {position_m: [1.5, -2.25, 0.5], heading_deg: 30}\n"
             "  - {position_m: [-2.25, 1.75, 0.75], heading_deg: 90}\n%s",
             (int)(list - at), at, rest);
    free(at);
    wire_write_text(wire, "plain.yaml", text);
    room_config_write(wire, &stops);
    for (int i = 0; i < 2; i++) {
        const char *const station[] = {"1", "2"};
        size_t n[2];
        record(wire, "plain.yaml", station[i], "plain.shs");
        record(wire, "config.yaml", stop[i], "stop.shs");
        uint8_t *a = points_of(wire, "plain.shs", &n[0]), *b = points_of(wire, "stop.shs", &n[1]);
        assert_int_equal(n[0], n[1]);
        assert_memory_equal(a, b, n[0]);
        free(a);
        free(b);
    }
}

/* The frame scalar is in the anchor, and so in the library's poses. The room's walls stay where they are. */
static void test_frame_scalar(void **state)
{
    struct wire *wire = *state;
    struct room_config stops = base(STOPS);
    struct scanhead_frame frame;
    struct scanhead_info info;
    static struct scanhead_point point[4096];
    double scalar[4096];
    unsigned seen = 0;
    room_write(wire);
    wire_write_text(wire, "ride.csv", RIDE);
    room_config_write(wire, &stops);
    record(wire, "config.yaml", "all", "stop.shs");
    struct scanhead *sh = client_open(wire_path(wire, "stop.shs"));
    while (scanhead_next(sh, &frame, -1) == 0) {
        if (frame.type != SCANHEAD_POINTS) continue;
        assert_int_equal(scanhead_get_info(sh, &info), 0);
        assert_true(info.station >= 1 && info.station <= N_STOPS && info.stop && !info.moving);
        assert_true(info.frame == 110 + 2.5 * (info.station - 1));
        seen |= 1u << info.station;
        int n = scanhead_points(sh, &frame, 0, point, 4096);
        assert_int_equal(scanhead_to_scene(sh, point, (uint32_t)n, scalar), 0);
        for (int i = 0; i < n; i++) {
            const double at[3] = {point[i].x, point[i].y, point[i].z};
            int wall = point[i].label;
            assert_true(scalar[i] == info.frame);
            /* as in test_moving.c: encoders' half steps at 15 m */
            assert_true(fabs(at[wall / 2] - (wall & 1 ? ROOM_MAX : ROOM_MIN)[wall / 2]) < 6.5e-5);
        }
    }
    scanhead_close(sh);
    assert_int_equal(seen, 0x3e);
}

/* `report` moves the points of bodies to where these stood at the stop: the error is 0.065 mm as above, and would be a
 * metre or two at the place at rest. For a scan during which a body moves, it says that it can't. */
static void check_report(struct wire *wire)
{
    char config[352], ply[352];
    snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "stop.ply"));
    record(wire, "config.yaml", "all", "stop.ply");
    const char *const args[] = {"report", config, ply, "--tolerance-m", "6.5e-5", NULL};
    int status = wire_wait(wire, wire_spawn(wire, args, "out", "err", -1));
    if (status != 0) wire_show(wire, "out");
    assert_int_equal(status, 0);
    char *text = wire_read(wire_path(wire, "out"), NULL);
    assert_non_null(strstr(text, " of 7 surfaces"));
    free(text);
    text = wire_read(config, NULL);
    *strstr(text, "platform:") = '#';
    wire_write_text(wire, "config.yaml", text);
    free(text);
    record(wire, "config.yaml", "1", "plain.ply");
    snprintf(ply, sizeof ply, "%s", wire_path(wire, "plain.ply"));
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 2);
    text = wire_read(wire_path(wire, "err"), NULL);
    assert_non_null(strstr(text, "is on body, which moved during the scan"));
    free(text);
}

/* A stop is a snapshot: a wall that goes north at 1 m/s stands where it is at the stop's time, for the whole scan. The
 * moving wall is in front of the room's north wall at first, and none of it is left when it has gone through. */
static void test_snapshot(void **state)
{
    struct wire *wire = *state;
    struct room_config stops = base(STOPS);
    static struct scanhead_point point[4096];
    struct scanhead_frame frame;
    struct scanhead_info info;
    uint64_t hits[N_STOPS] = {0};
    room_write(wire);
    wire_write_text(wire, "ride.csv", RIDE);
    wire_write_text(wire, "body.obj", "o body\nv -9 0 -9\nv 9 0 -9\nv 9 0 9\nv -9 0 9\nf 1 2 3 4\n");
    room_config_write(wire, &stops);
    char *text = wire_read(wire_path(wire, "config.yaml"), NULL), with[4096], *meshes = strstr(text, "meshes:\n");
    snprintf(with, sizeof with,
             "%.*smeshes:\n    - {file: body.obj, up: z, scale: 1, offset_m: [0, 2.25, 0], move_m_s: [0, 1, 0]}\n%s",
             (int)(meshes - text), text, meshes + 8);
    free(text);
    wire_write_text(wire, "config.yaml", with);
    record(wire, "config.yaml", "all", "stop.shs");
    struct scanhead *sh = client_open(wire_path(wire, "stop.shs"));
    while (scanhead_next(sh, &frame, -1) == 0) {
        if (frame.type != SCANHEAD_POINTS) continue;
        assert_int_equal(scanhead_get_info(sh, &info), 0);
        int n = scanhead_points(sh, &frame, 0, point, 4096);
        assert_int_equal(scanhead_to_scene(sh, point, (uint32_t)n, NULL), 0);
        for (int i = 0; i < n; i++) {
            if (point[i].label != 6) continue; /* behind the room's six */
            double y_m = 2.25 + 1 + 0.25 * (info.station - 1);
            hits[info.station - 1]++;
            if (!(fabs(point[i].y - y_m) < 6.5e-5))
                fail_msg("stop %u: %.6f m, not %.6f", info.station, point[i].y, y_m);
        }
    }
    scanhead_close(sh);
    assert_true(hits[0] > 500 && hits[1] > 500 && hits[2] > 500); /* at y of 3.25, 3.5, 3.75 m; the wall is at 3.94 */
    assert_true(hits[3] == 0 && hits[4] == 0);
    check_report(wire);
}

/* The files have `frame` in PLY, as for a moving head, and in .poses.csv. */
static void test_files(void **state)
{
    struct wire *wire = *state;
    struct room_config stops = base(STOPS);
    room_write(wire);
    wire_write_text(wire, "ride.csv", RIDE);
    room_config_write(wire, &stops);
    record(wire, "config.yaml", "all", "stop.poses.csv");
    char *text = wire_read(wire_path(wire, "stop.poses.csv"), NULL), *row = text;
    assert_non_null(strstr(text, ",height_m,frame\n"));
    for (int i = 0; i < N_STOPS; i++) {
        row = strchr(row, '\n') + 1;
        assert_true(atoi(row) == i + 1);
        char *end = strchr(row, '\n');
        while (end[-1] != ',')
            end--;
        assert_true(strtod(end, NULL) == 110 + 2.5 * i);
    }
    free(text);
    char from[352], to[352];
    snprintf(from, sizeof from, "%s", wire_path(wire, "config.yaml"));
    snprintf(to, sizeof to, "%s", wire_path(wire, "stop.ply"));
    const char *const args[] = {"record", from, "--station", "all", "--ascii", "-o", to, "--quiet", NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    text = wire_read(to, NULL);
    assert_non_null(strstr(text, "property ushort station\nproperty double frame\nend_header\n"));
    row = strstr(text, "end_header\n") + 11;
    size_t n = 0;
    for (char *end; *row != 0; row = end + 1, n++) {
        int used = 0;
        unsigned station;
        double scalar;
        end = strchr(row, '\n');
        *end = 0; /* sscanf measures all of its text first */
        assert_int_equal(sscanf(row, "%*f %*f %*f %*f %*s %*f %*u %*u %*u %u %lf%n", &station, &scalar, &used), 2);
        assert_true(row + used == end && scalar == 110 + 2.5 * (station - 1));
    }
    assert_true(n > 10000);
    free(text);
}

/* If the file contradicts the configuration there is one line with the allowed values, of the key that was given. */
static void check_wrong(struct wire *wire, const char *platform, const char *set, const char *says)
{
    struct room_config stops = base(platform);
    char path[352];
    snprintf(path, sizeof path, "%s", room_config_write(wire, &stops));
    const char *const args[] = {"check", path, "--set", set, NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 2);
    char *text = wire_read(wire_path(wire, "err"), NULL);
    if (strstr(text, says) == NULL || strchr(text, '\n')[1] != 0) fail_msg("%s", text);
    free(text);
}

static void test_wrong_parts(void **state)
{
    struct wire *wire = *state;
    static const char frames[] = "platform: {kind: stops, file: ride.csv, frames_per_s: 10, frame_step: 5}\n";
    static const struct {
        const char *platform, *set, *says;
    } wrong[] = {
        {STOPS, "platform.step_s=0.0001", "platform.step_s: 10001 stops in 1 s; allowed at most 4096"},
        {STOPS, "platform.end_s=3.5", "platform.end_s: 3.5 s is after the trajectory's end; allowed 1 to 3"},
        {STOPS, "head.station=6", "head.station: there is no stop 6; allowed 1 to 5"},
        {frames, "platform.last_frame=31",
         "platform.last_frame: 31 frames is after the trajectory's end; allowed 0 to 30"},
        {frames, "platform.first_frame=40",
         "platform.first_frame: 40 frames is after the trajectory's end; allowed 0 to 30"},
        {frames, "platform.frame_step=0.001",
         "platform.frame_step: 30001 stops in 30 frames; allowed at most 4096, steps"},
    };
    char path[352];
    room_write(wire);
    wire_write_text(wire, "ride.csv", RIDE);
    for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
        check_wrong(wire, wrong[i].platform, wrong[i].set, wrong[i].says);
    struct room_config stops = base(STOPS);
    snprintf(path, sizeof path, "%s", room_config_write(wire, &stops));
    const char *const args[] = {"check", path, NULL};
    assert_int_equal(wire_wait(wire, wire_spawn(wire, args, "out", "err", -1)), 0);
    char *text = wire_read(wire_path(wire, "out"), NULL);
    assert_non_null(
        strstr(text, "stops     5, from 1 s on, each 0.25 s\n  stop-1    1 s, frame 110, scene 1.5000 -2.25"));
    assert_non_null(strstr(text, "\n  stop-5    2 s, frame 120, scene -2.2500 1.7500 0.7500 m; heading 90,"));
    free(text);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_as_a_station, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_frame_scalar, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_snapshot, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_files, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_wrong_parts, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests_name("stops", tests, NULL, NULL);
}
