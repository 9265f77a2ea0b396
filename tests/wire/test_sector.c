/* SPDX-License-Identifier: MIT */
/* Panoramas by angle through the real program: a sector of a sphere and a circle on the wire, in the client in Python,
 * and as rows and columns of files. A step that doesn't divide is reported. Tripods work with any number of threads. */
#include "tests/wire/room.h"

#include <math.h>

enum { MAX_POINTS = 4096 };
static const char PYTHON[] = "/usr/bin/python3";
static const double RAD = M_PI / 180;

/* The recorded part has `rings` rings from ring `first` on, 180 / gaps degrees apart. With gaps 0 it is a circle. A
 * ring has `count` steps from step `from` on, 360 / steps degrees apart. */
struct panorama {
    const char *head;
    int gaps, steps;
    int first, rings; /* first: of the whole sphere */
    double circle_deg;
    int from, count; /* steps that are cast */
};

static const struct panorama sector = {
    "step_deg: 2.2, ring_start_deg: -21, ring_stop_deg: 33.5, line_start_deg: 348, line_stop_deg: 20.3",
    82,
    164,
    32, /* -90 + 32 * 180 / 82 = -19.76; 31: -21.95 */
    25, /* up to 56: 32.93; 57: 35.12 */
    0,
    159, /* 349.02; 158: 346.83 */
    15,  /* five before 0, and 0 to 9: 19.76; 10: 21.95 */
};
static const struct panorama circle = {
    "step_deg: 4, ring_start_deg: 1.5, ring_stop_deg: 1.5, line_start_deg: 90, line_stop_deg: 180",
    0,
    90,
    0,
    1,
    1.5,
    23,
    23 /* 92 to 180 deg */
};

static const char *write_config(const struct wire *wire, const struct panorama *p)
{
    char text[1024];
    snprintf(text, sizeof text,
             "head: {profile: sphere, %s}\nscene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
             "stations: [{position_m: [%.17g, %.17g, %.17g], heading_deg: %.17g}]\noutput: {scale_m: 1e-6}\n",
             p->head, STATION[0], STATION[1], STATION[2], HEADING_DEG);
    room_write(wire);
    return wire_write_text(wire, "config.yaml", text);
}

/* Returns a path that stays good. */
static const char *path_of(const struct wire *wire, const char *name, char buf[128])
{
    snprintf(buf, 128, "%s", wire_path(wire, name));
    return buf;
}

static double ring_deg(const struct panorama *p, int ring)
{
    return p->gaps == 0 ? p->circle_deg : -90 + 180.0 * (p->first + ring) / p->gaps;
}

/* Angles are right to half a count of 2^-32 of a turn. At 11 m in the room that moves a range by less than 1e-6 m.
 * Walls that are met at a small angle are the exception, and there are none here. */
static void check_shot(const struct panorama *p, const struct scanhead_point *at, int ring, int step)
{
    struct room_ray ray;
    const double elevation = ring_deg(p, ring) * RAD, azimuth = 2 * M_PI * ((p->from + step) % p->steps) / p->steps;
    room_cast(elevation, azimuth, &ray);
    assert_true(fabs(at->mirror_rad - elevation) < 1e-9);
    assert_true(fabs(remainder(at->pan_rad - azimuth, 2 * M_PI)) < 1e-9);
    assert_int_equal(at->echo_count, 1);
    assert_true(fabs(at->range_m - ray.range_m) < 0.6e-6);
}

/* Checks the emitter's own account: steps, rings, and the elevation of each ring. */
static void check_emitter(const struct panorama *p, const struct scanhead_emitter *e)
{
    assert_int_equal(e->kind, SCANHEAD_EMIT_SPHERE);
    assert_int_equal(e->steps, p->steps);
    assert_int_equal(e->rings, p->rings);
    for (int i = 0; i < p->rings; i++)
        assert_true(fabs(e->first_ring_deg + i * e->ring_step_deg - ring_deg(p, i)) < 1e-12);
}

static void check_stream(const struct wire *wire, const struct panorama *p)
{
    static struct scanhead_point point[MAX_POINTS];
    static struct scanhead_emitter e;
    struct scanhead *sh = client_open(wire_path(wire, "a.shs"));
    struct scanhead_frame frame;
    int rings = 0, shots = 0;
    while (scanhead_next(sh, &frame, 0) == SCANHEAD_OK) {
        if (frame.type == SCANHEAD_EMITTER) {
            assert_int_equal(scanhead_get_emitter(sh, &e), SCANHEAD_OK);
            check_emitter(p, &e);
        }
        rings += frame.type == SCANHEAD_LINE_END;
        if (frame.type != SCANHEAD_POINTS) continue;
        const int n = scanhead_points(sh, &frame, 0, point, MAX_POINTS);
        const int begin = (int)(frame.pulse0 - (uint64_t)frame.scan_line * (uint64_t)p->steps);
        for (int i = 0; i < n; i++) {
            const int azimuth = (begin + i + p->steps - e.front_step) % p->steps; /* in steps */
            check_shot(p, &point[i], (int)frame.scan_line, (azimuth + p->steps - p->from) % p->steps);
        }
        shots += n;
    }
    assert_int_equal(rings, p->rings); /* the others are no lines */
    assert_int_equal(shots, p->rings * p->count);
    scanhead_close(sh);
}

static void assert_python_agrees(struct wire *wire, const struct panorama *p)
{
    static const char code[] = "import sys; sys.path.insert(0, 'drivers/host/python'); import scanhead\n"
                               "head = scanhead.open(sys.argv[1])\nfor frame in head.frames():\n"
                               "    if frame.type == scanhead.EMITTER: e = head.emitter\n"
                               "print(e['rings'], e['first_ring_deg'], e['ring_step_deg'], e['front_step'])\n";
    const char *const args[] = {"-c", code, wire_path(wire, "a.shs"), NULL};
    double first_deg, step_deg;
    int rings, front;
    if (access(PYTHON, X_OK) != 0) return;
    wire_run_program(wire, PYTHON, args, 0);
    char *text = wire_read(wire_path(wire, "out"), NULL);
    assert_int_equal(sscanf(text, "%d %lf %lf %d", &rings, &first_deg, &step_deg, &front), 4);
    assert_int_equal(rings, p->rings);
    assert_true(fabs(first_deg - ring_deg(p, 0)) < 1e-12);
    assert_true(fabs(step_deg - (p->gaps == 0 ? 0 : 180.0 / p->gaps)) < 1e-12);
    assert_int_equal(front, p->gaps == 0 ? 0 : p->steps - p->from);
    free(text);
}

/* E57 keeps its bytes in pages of 1020, each with a checksum after it. */
static char *e57_text(const char *path, size_t *n)
{
    size_t len;
    char *bytes = wire_read(path, &len);
    *n = 0;
    for (size_t i = 0; i < len; i++)
        if (i % 1024 < 1020) bytes[(*n)++] = bytes[i];
    return bytes;
}

static void assert_bound(const struct wire *wire, const char *name, int value)
{
    char wanted[64];
    size_t n;
    char *text = e57_text(wire_path(wire, "a.e57"), &n);
    snprintf(wanted, sizeof wanted, "<%s type=\"Integer\">%d<", name, value);
    if (memmem(text, n, wanted, strlen(wanted)) == NULL) fail_msg("%s is not there", wanted);
    free(text);
}

static void sectors_and_circles(void **state)
{
    struct wire *wire = *state;
    const struct panorama *const panoramas[] = {&sector, &circle};
    for (int i = 0; i < 2; i++) {
        const struct panorama *p = panoramas[i];
        char size[32], path[4][128];
        write_config(wire, p);
        const char *const args[] = {"record",  path_of(wire, "config.yaml", path[0]),
                                    "-o",      path_of(wire, "a.shs", path[1]),
                                    "-o",      path_of(wire, "a.ptx", path[2]),
                                    "-o",      path_of(wire, "a.e57", path[3]),
                                    "--quiet", NULL};
        wire_run(wire, args, 0);
        check_stream(wire, p);
        assert_python_agrees(wire, p);
        char *text = wire_read(wire_path(wire, "a.ptx"), NULL); /* columns, rows: nothing is filled up */
        snprintf(size, sizeof size, "%d\n%d\n", p->rings, p->count);
        assert_memory_equal(text, size, strlen(size));
        free(text);
        assert_bound(wire, "columnMaximum", p->rings - 1);
        assert_bound(wire, "rowMaximum", i == 0 ? p->count - 1 : p->from + p->count - 1);
        wire_empty(wire);
    }
}

static void assert_said(const struct wire *wire, const char *file, const char *words)
{
    char *text = wire_read(wire_path(wire, file), NULL);
    if (strstr(text, words) == NULL) fail_msg("%s has no \"%s\": %s", file, words, text);
    free(text);
}

/* Cells of a grid are two triangles, and a ring closes where it is whole. Only a ring at 90 deg is a pole, with a
 * fan. */
static void meshes_of_parts(void **state)
{
    static const struct {
        const char *head, *faces;
    } cases[] = {
        {"step_deg: 10", "element face 1224\n"},                                        /* 2 * 36 + 16 * 36 * 2 */
        {"step_deg: 10, ring_start_deg: 0", "element face 612\n"},                      /* 36 + 8 * 36 * 2 */
        {"step_deg: 10, ring_start_deg: -20, ring_stop_deg: 20", "element face 288\n"}, /* 4 * 36 * 2 */
        {"step_deg: 10, ring_start_deg: -20, ring_stop_deg: 20, line_start_deg: 345, line_stop_deg: 20",
         "element face 24\n"}, /* 4 * 3 * 2: 350, 0, 10, 20 deg */
    };
    struct wire *wire = *state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const struct panorama p = {.head = cases[i].head};
        char config[128], ply[128];
        write_config(wire, &p);
        const char *const args[] = {
            "record", path_of(wire, "config.yaml", config), "-o", path_of(wire, "a.ply", ply), "--mesh", "--quiet",
            NULL};
        wire_run(wire, args, 0);
        assert_said(wire, "a.ply", cases[i].faces);
        wire_empty(wire);
    }
}

static void rounding_is_said(void **state)
{
    static const char
        said[] = "warning: ",
        figures[] =
            "head.step_deg: 2.2 deg does not divide 180 and 360 deg: 82 steps of 2.19512195 deg are used from ring to "
            "ring, and 164 of 2.19512195 deg along a ring\n";
    struct wire *wire = *state;
    char config[128], ply[128];
    write_config(wire, &sector);
    path_of(wire, "config.yaml", config);
    const char *const check[] = {"check", config, NULL};
    const char *const record[] = {"record", config, "-o", path_of(wire, "a.ply", ply), "--quiet", NULL};
    const char *const head[] = {"run",    config, "--start", "--frames",          "1",
                                "--pace", "fast", "--set",   "links.0.type=null", NULL};
    const char *const exact[] = {"check", config, "--set", "head.step_deg=2.25", NULL};
    const char *const *const commands[] = {check, record, head};
    for (int i = 0; i < 3; i++) {
        wire_run(wire, commands[i], 0);
        assert_said(wire, "err", said);
        assert_said(wire, "err", figures);
    }
    wire_run(wire, exact, 0);
    assert_said(wire, "out",
                "emitter   sphere, 24 rings 2.25 deg apart, of 160 steps of 2.25 deg; elevations -20.25 to "
                "31.5 deg\n");
    char *text = wire_read(wire_path(wire, "err"), NULL);
    assert_string_equal(text, "");
    free(text);
}

/* The station is 1.7 m above the room's floor: 0.17 + 1.53. Legs of 2 m open to acos(1.5 / 2) = 41.4096 deg under a top
 * 0.2 m lower; 1.7 tan of that is 1.49926 m. */
static void heights_and_openings_are_said(void **state)
{
    static const char legs[] = "stations.0.tripod.leg_m=2", above[] = "stations.0.tripod.head_above_m=0.2",
                      said[] = "legs of 2 m, top 1.5 m above the ground; opening 41.4096 deg, which hides 1.49926 m "
                               "around on level ground\n";
    struct wire *wire = *state;
    const struct panorama whole = {.head = "step_deg: 5"};
    char config[128], ply[128];
    write_config(wire, &whole);
    path_of(wire, "config.yaml", config);
    const char *const check[] = {"check", config, "--set", legs, "--set", above, NULL};
    const char *const plan[] = {"plan", config, "--set", legs, "--set", above, NULL};
    const char *const record[] = {"record", config, "--set", legs, "--set", above, "-o", path_of(wire, "a.ply", ply),
                                  NULL};
    wire_run(wire, check, 0);
    assert_said(wire, "out", "  tripod    ");
    assert_said(wire, "out", said);
    wire_run(wire, plan, 0);
    assert_said(wire, "out", "tripod   cone ");
    assert_said(wire, "out", said);
    wire_run(wire, record, 0);
    assert_said(wire, "err", "scanhead: station 1 station-1: tripod: legs of 2 m");
    assert_said(wire, "err", said);
}

static void tripods_with_any_threads(void **state)
{
    static const char *const variants[] = {"cast.sight=off", "cast.sight=on"};
    struct wire *wire = *state;
    char hash[3][65], config[160];
    const struct panorama whole = {.head = "step_deg: 1, frames: 2, line_start_deg: 200, line_stop_deg: 190"};
    snprintf(config, sizeof config, "%s", write_config(wire, &whole));
    for (int v = 0; v < 2; v++) {
        for (int i = 0; i < 3; i++) {
            static const char *const threads[] = {"1", "2", "5"};
            const char *const args[] = {"record",    config,
                                        "--stats",   wire_path(wire, "stats.json"),
                                        "--threads", threads[i],
                                        "--set",     "stations.0.tripod.leg_m=2",
                                        "--set",     "stations.0.tripod.legs=on",
                                        "--set",     "stations.0.tripod.cone=on",
                                        "--set",     "stations.0.pitch_deg=9",
                                        "--set",     "stations.0.tripod.head_above_m=0.3",
                                        "--set",     variants[v],
                                        "--quiet",   NULL};
            wire_run(wire, args, 0);
            stats_hash(wire, hash[i]);
            assert_string_equal(hash[i], hash[0]);
        }
        if (v == 0) memcpy(hash[2], hash[0], sizeof hash[0]);
        if (v == 1) assert_string_equal(hash[2], hash[0]);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(sectors_and_circles, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(meshes_of_parts, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(rounding_is_said, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(heights_and_openings_are_said, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(tripods_with_any_threads, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
