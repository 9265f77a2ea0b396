/* SPDX-License-Identifier: MIT */
/* An animation: stops at stations while meshes move, and at way-points, counted in frames. There is a file for each
 * frame and one of all. Each point lies on its body where the body stands in the frame. */
#include <math.h>

#include "tests/wire/wire.h"

/* The scene has wide ground and two plates. The plate at x = 5 m goes east at 2 m/s, and the one at x = -4 m turns
 * about its own origin by 10 deg/s. Both plates are much larger than their visible part. */
#define SCENE                                                                              \
    "scene:\n  meshes:\n    - {file: ground.obj, up: z, scale: 1}\n"                       \
    "    - {file: plate.obj, up: z, scale: 1, offset_m: [5, 0, 0], move_m_s: [2, 0, 0]}\n" \
    "    - {file: plate.obj, up: z, scale: 1, offset_m: [-4, 0, 0], turn_deg_s: 10, pivot_m: [-4, 0, 0]}\n"
#define HEAD   "head: {profile: sphere, step_deg: 10, frames: 1, range_max_m: 60}\n"
#define OUTPUT "output: {layout: geo}\n"
#define TWO    "stations:\n  - {name: one, position_m: [0, 0, 0]}\n  - {name: two, position_m: [1, 2, 0.5]"
#define FRAMES "frames_per_s: 10, first_frame: 5, last_frame: 25, frame_step: 10"

static void write_scene(const struct wire *wire)
{
    wire_write_text(wire, "ground.obj",
                    "o ground\nv -200 -200 -2\nv 200 -200 -2\nv 200 200 -2\nv -200 200 -2\nf 1 2 3 4\n");
    wire_write_text(wire, "plate.obj", "o plate\nv 0 -200 -90\nv 0 200 -90\nv 0 200 90\nv 0 -200 90\nf 1 2 3 4\n");
    wire_write_text(wire, "way.csv", "x_m,y_m,z_m,speed_m_s\n0,-1,0,1\n0,9,0,1\n");
}

static void record(struct wire *wire, const char *config)
{
    char in[352], out[352];
    wire_write_text(wire, "config.yaml", config);
    snprintf(in, sizeof in, "%s", wire_path(wire, "config.yaml"));
    snprintf(out, sizeof out, "%s", wire_path(wire, "all.ply"));
    const char *const args[] = {"record",
                                in,
                                "--station",
                                "all",
                                "--each",
                                "-o",
                                out,
                                "--ascii",
                                "--quiet",
                                "--ply-columns",
                                "label,station,frame",
                                NULL};
    wire_run(wire, args, 0);
}

/* The expected contents of a file: the time of its frame, and the place of the head for each point. */
struct expected {
    double frame, t_s;
    unsigned station;
};

/* Checks each point of a file against its body, and counts the points of each label. */
static unsigned check_points(const char *text, const struct expected *e, unsigned of_label[3])
{
    unsigned n = 0;
    const char *line = strstr(text, "end_header\n");
    assert_non_null(line);
    for (line += strlen("end_header\n"); *line != '\0'; line = strchr(line, '\n') + 1, n++) {
        double p[3], frame;
        unsigned label, station;
        assert_int_equal(sscanf(line, "%lf %lf %lf %u %u %lf", p, p + 1, p + 2, &label, &station, &frame), 6);
        assert_true(frame == e->frame && station == e->station && label < 3);
        const double turn_rad = 10 * e->t_s * M_PI / 180; /* clockwise seen from above: y goes to (sin, cos) */
        const double off_m[3] = {p[2] + 2, p[0] - (5 + 2 * e->t_s), (p[0] + 4) * cos(turn_rad) - p[1] * sin(turn_rad)};
        /* counts of 1e-6 m in three axes, and of the encoders' 2^32 a turn at 60 m */
        if (!(fabs(off_m[label]) < 3e-6)) fail_msg("frame %g: %g m off label %u", frame, off_m[label], label);
        of_label[label]++;
    }
    return n;
}

/* Checks the files of all frames, in order. The combined one has their points one after the other, and there is
 * no further file. */
static void check_files(struct wire *wire, const struct expected *e, unsigned n_files)
{
    char *all = wire_read(wire_path(wire, "all.ply"), NULL), name[32];
    const char *rest = strstr(all, "end_header\n") + strlen("end_header\n");
    for (unsigned i = 0; i < n_files; i++) {
        unsigned of_label[3] = {0};
        snprintf(name, sizeof name, "all-%u.ply", i + 1);
        char *text = wire_read(wire_path(wire, name), NULL);
        const unsigned n = check_points(text, &e[i], of_label);
        assert_true(n > 50 && of_label[0] > 10 && of_label[1] > 10 && of_label[2] > 10);
        const char *points = strstr(text, "end_header\n") + strlen("end_header\n");
        assert_int_equal(strncmp(rest, points, strlen(points)), 0);
        rest += strlen(points);
        free(text);
    }
    assert_int_equal(*rest, '\0');
    free(all);
    snprintf(name, sizeof name, "all-%u.ply", n_files + 1);
    assert_int_equal(access(wire_path(wire, name), F_OK), -1);
}

/* There are two stations, the second with a scanner of its own. All stations scan the first frame, then all the
 * next. */
static void test_standing(void **state)
{
    struct wire *wire = *state;
    static const struct expected want[6] = {{5, 0.5, 1},  {5, 0.5, 2},  {15, 1.5, 3},
                                            {15, 1.5, 4}, {25, 2.5, 5}, {25, 2.5, 6}};
    write_scene(wire);
    record(wire, HEAD SCENE OUTPUT "platform: {kind: stops, " FRAMES "}\n" TWO ", scanner: {head: {step_deg: 12}}}\n");
    check_files(wire, want, 6);
    /* The scanners differ: 36 x 19 directions, and 30 x 16. */
    unsigned n[2], of_label[3] = {0};
    for (int i = 0; i < 2; i++) {
        char *text = wire_read(wire_path(wire, i == 0 ? "all-1.ply" : "all-2.ply"), NULL);
        n[i] = check_points(text, &want[i], of_label);
        free(text);
    }
    assert_true(n[0] <= 36 * 19 && n[1] <= 30 * 16 && n[0] > n[1]);
    /* The same times are given in seconds. Frames are then numbered from 1 on. */
    static const struct expected counted[6] = {{1, 0.5, 1}, {1, 0.5, 2}, {2, 1.5, 3},
                                               {2, 1.5, 4}, {3, 2.5, 5}, {3, 2.5, 6}};
    record(wire, HEAD SCENE OUTPUT "platform: {kind: stops, start_s: 0.5, end_s: 2.5, step_s: 1}\n" TWO "}\n");
    check_files(wire, counted, 6);
}

/* The head drives north at 1 m/s with a stop each second. The poses show it. */
static void test_driving(void **state)
{
    struct wire *wire = *state;
    static const struct expected want[3] = {{5, 0.5, 1}, {15, 1.5, 2}, {25, 2.5, 3}};
    write_scene(wire);
    record(wire, HEAD SCENE OUTPUT "platform: {kind: stops, waypoints: way.csv, " FRAMES "}\n"
                                   "stations: [{position_m: [0, 0, 0]}]\n");
    check_files(wire, want, 3);
    char in[352], out[352];
    snprintf(in, sizeof in, "%s", wire_path(wire, "config.yaml"));
    snprintf(out, sizeof out, "%s", wire_path(wire, "all.poses.csv"));
    const char *const args[] = {"record", in, "--station", "all", "-o", out, "--quiet", NULL};
    wire_run(wire, args, 0);
    char *text = wire_read(out, NULL), *line = strchr(text, '\n') + 1;
    for (unsigned i = 0; i < 3; i++, line = strchr(line, '\n') + 1) {
        unsigned scan, station;
        double p[3];
        assert_int_equal(sscanf(line, "%u,%u,0,%lf,%lf,%lf", &scan, &station, p, p + 1, p + 2), 5);
        assert_true(scan == i + 1 && station == i + 1);
        assert_true(fabs(p[0]) < 1e-6 && fabs(p[1] - (-1 + want[i].t_s)) < 1e-6 && fabs(p[2]) < 1e-6);
        assert_true(strtod(strrchr(strndupa(line, strcspn(line, "\n")), ',') + 1, NULL) == want[i].frame);
    }
    free(text);
}

static void test_faults(void **state)
{
    struct wire *wire = *state;
    static const struct {
        const char *platform, *says;
    } faults[] = {
        {"{kind: stops, step_s: 1}", "need an end"},
        {"{kind: stops, end_s: 1}", "platform.step_s"},
        {"{kind: stops, end_s: 1, step_s: 1, last_frame: 3}", "frames need platform.frames_per_s"},
        {"{kind: stops, frames_per_s: 10, last_frame: 3, step_s: 1}", "allowed is platform.frame_step"},
        {"{kind: stops, frames_per_s: 10, first_frame: 5, last_frame: 4}", "allowed at least 5"},
        {"{kind: stops, end_s: 1, step_s: 1, mount_m: [0, 0, 1]}", "the head is at its station"},
        {"{kind: stops, end_s: 1000, step_s: 0.01}", "stops at 2 stations"},
        {"{kind: static, frames_per_s: 10}", "platform.frames_per_s"},
    };
    char config[4096], in[352];
    write_scene(wire);
    snprintf(in, sizeof in, "%s", wire_path(wire, "config.yaml"));
    for (size_t i = 0; i < sizeof faults / sizeof faults[0]; i++) {
        snprintf(config, sizeof config, HEAD SCENE OUTPUT "platform: %s\n" TWO "}\n", faults[i].platform);
        wire_write_text(wire, "config.yaml", config);
        const char *const args[] = {"check", in, NULL};
        wire_run(wire, args, 2);
        char *text = wire_read(wire_path(wire, "err"), NULL);
        if (strstr(text, faults[i].says) == NULL)
            fail_msg("%s: '%s' without '%s'", faults[i].platform, text, faults[i].says);
        free(text);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_standing, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_driving, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_faults, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
