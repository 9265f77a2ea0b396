/* SPDX-License-Identifier: MIT */
/* These tests run scanhead coverage, through the real program: figures, the mesh of cells, the next station, and its
 * refusals. */
#include "tests/wire/room.h"
#include "tests/wire/usage_rig.h"

/* The L of tests/unit/coverage_rig.h, with its faces inward: 88.8 m2. */
static const char L_ROOM[] =
    "v 0 0 0\nv 6 0 0\nv 6 2 0\nv 2 2 0\nv 2 5 0\nv 0 5 0\nv 0 0 2.4\nv 6 0 2.4\nv 6 2 2.4\nv 2 2 2.4\nv 2 5 2.4\n"
    "v 0 5 2.4\n"
    "o walls\nusemtl paint\nf 2 1 7 8\nf 3 2 8 9\nf 4 3 9 10\nf 5 4 10 11\nf 6 5 11 12\nf 1 6 12 7\n"
    "o floor\nusemtl wood\nf 1 2 3 4\nf 1 4 5 6\no ceiling\nusemtl paint\nf 10 9 8 7\nf 12 11 10 7\n";
static const double L_M2 = 36.0 + 22.0 * 2.4;

/* A head of 100 by 360 degrees with steps of half a degree, in the right leg of the L. */
static const char *set_up(const struct wire *wire)
{
    static char path[256];
    wire_write_text(wire, "room.obj", L_ROOM);
    snprintf(path, sizeof path, "%s",
             wire_write_text(wire, "config.yaml",
                             "head: {profile: full-sweep, prr_hz: 20000, lines_hz: 100, pan_deg_s: 50}\n"
                             "scene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n"
                             "stations:\n  - {name: right, position_m: [5, 1, 1.2]}\n"));
    return path;
}

static char *run(struct wire *wire, const char *const *args, int status)
{
    wire_run(wire, args, status);
    return wire_read(wire_path(wire, status == 0 ? "out" : "err"), NULL);
}

static double number_of(const char *text, const char *key)
{
    char quoted[64];
    snprintf(quoted, sizeof quoted, "\"%s\": ", key);
    const char *at = strstr(text, quoted);
    if (at == NULL) fail_msg("no %s in %s", key, text);
    return strtod(at + strlen(quoted), NULL);
}

static void assert_near(const char *what, double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("%s: %.12g, and it should be %.12g", what, got, want);
}

/* ---- figures */

static void test_figures(void **state)
{
    struct wire *wire = *state;
    const char *config = set_up(wire);
    const char *const one[] = {"coverage", config, "--json", "--by", "label", "--threads", "1", NULL};
    const char *const sets[] = {"coverage", config, "--json", "--by", "label", "--set", "loop.threads=1", NULL};
    const char *const four[] = {"coverage", config, "--json", "--by", "label", "--set", "loop.threads=4", NULL};
    static const char *const keys[] = {
        "cell_m", "cells", "pieces", "triangles", "duplicate_m2", "several_m2", "none_percent", "mean",
        "p05",    "p50",   "p95",    "pulses",    "met",          "alone_m2",   "front_hits",   "seen_percent"};
    free(run(wire, one, 2)); /* no such option: it is a key */
    char *json = run(wire, sets, 0), *again = run(wire, four, 0);
    assert_string_equal(json, again);
    for (size_t i = 0; i < sizeof keys / sizeof keys[0]; i++)
        number_of(json, keys[i]);
    assert_near("area", number_of(json, "area_m2"), L_M2, 1e-9);
    assert_near("cell", number_of(json, "cell_m"), 0.25, 0.0);
    assert_near("sum", number_of(json, "none_m2") + number_of(json, "one_m2"), L_M2, 1e-9);
    /* 28.27 m2 lie behind the corner (tests/unit/test_coverage.c). The sweep of -40 to 60 deg leaves out the floor up
     * to 1.43 m from the station, the ceiling to 0.69 m: 6.1 m2 within the walls. */
    assert_true(number_of(json, "none_m2") > 28.26 - 6.6 * 0.6 &&
                number_of(json, "none_m2") < 28.27 + 2.0 * 3.2 + 6.6 * 0.6);
    assert_non_null(strstr(json, "\"name\": \"right\""));
    assert_non_null(strstr(json, "\"object\": \"ceiling\""));
    assert_non_null(strstr(json, "\"material\": \"wood\""));
    free(json);
    free(again);
    const char *const text[] = {"coverage", config, "--by", "label", NULL};
    char *shown = run(wire, text, 0);
    static const char *const words[] = {
        "surface          88.800 m2", "none ", "several", "density", "incidence", "\nright ", "walls | paint"};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        if (strstr(shown, words[i]) == NULL) fail_msg("no %s in %s", words[i], shown);
    free(shown);
}

/* A name from a mesh may have any bytes; none of them reaches a terminal as a command. */
static void test_names_are_text(void **state)
{
    struct wire *wire = *state;
    const char *config = set_up(wire);
    char room[sizeof L_ROOM + 8], *at;
    snprintf(room, sizeof room, "%s", L_ROOM);
    at = strstr(room, "walls");
    memcpy(at, "\033[2Jw", 5);
    wire_write_text(wire, "room.obj", room);
    const char *const args[] = {"coverage", config, "--by", "label", NULL};
    char *shown = run(wire, args, 0);
    assert_null(strchr(shown, '\033'));
    assert_non_null(strstr(shown, "[2Jw | paint"));
    free(shown);
}

/* ---- the mesh of cells, binary little-endian as its header says */

enum { VERTEX = 3 * 8 + 3 + 2 + 3 * 4 + 8, FACE = 1 + 3 * 4 };

static double area_of(const char *vertices, const uint32_t face[3])
{
    double p[3][3], n[3];
    for (int i = 0; i < 3; i++)
        memcpy(p[i], vertices + (size_t)face[i] * VERTEX, sizeof p[i]);
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;
        n[i] = (p[1][j] - p[0][j]) * (p[2][k] - p[0][k]) - (p[1][k] - p[0][k]) * (p[2][j] - p[0][j]);
    }
    return 0.5 * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
}

static void test_mesh(void **state)
{
    struct wire *wire = *state;
    const char *config = set_up(wire);
    char path[256];
    snprintf(path, sizeof path, "%s", wire_path(wire, "cover.ply"));
    const char *const args[] = {"coverage", config, "--json", "-o", path, NULL};
    static const char *const lines[] = {"property ushort stations", "property float density",
                                        "property float incidence_deg", "property float range_m",
                                        "property double cell"};
    char *json = run(wire, args, 0);
    size_t size;
    char *ply = wire_read(path, &size), *end = strstr(ply, "end_header\n");
    assert_non_null(end);
    for (size_t i = 0; i < sizeof lines / sizeof lines[0]; i++)
        if (strstr(ply, lines[i]) == NULL) fail_msg("no %s", lines[i]);
    const size_t n = strtoul(strstr(ply, "element vertex ") + 15, NULL, 10);
    const size_t faces = strtoul(strstr(ply, "element face ") + 13, NULL, 10);
    const char *vertices = end + strlen("end_header\n"), *at = vertices + n * VERTEX;
    assert_int_equal(ply + size - at, faces * FACE);
    double area_m2[2] = {0.0, 0.0};
    for (size_t i = 0; i < faces; i++, at += FACE) {
        uint32_t face[3];
        uint16_t stations;
        memcpy(face, at + 1, sizeof face);
        const char *v = vertices + (size_t)face[0] * VERTEX;
        memcpy(&stations, v + 27, sizeof stations);
        assert_true(stations <= 1);
        area_m2[stations] += area_of(vertices, face);
        /* red, or yellow */
        const unsigned char red = (unsigned char)v[24], green = (unsigned char)v[25], blue = (unsigned char)v[26];
        assert_true(red > 190 && blue < 70 && (stations == 1 ? green > 180 : green < 60));
    }
    assert_near("seen by none", area_m2[0], number_of(json, "none_m2"), 1e-9);
    assert_near("seen by one", area_m2[1], number_of(json, "one_m2"), 1e-9);
    free(ply);
    free(json);
    static const char *const colours[] = {"count", "density", "incidence"};
    for (size_t i = 0; i < 3; i++) {
        const char *const more[] = {"coverage", config, "-o", path, "--colour", colours[i], NULL};
        free(run(wire, more, 0));
    }
}

/* ---- the next station: its estimate holds once the station is there */

static void test_next(void **state)
{
    struct wire *wire = *state;
    const char *config = set_up(wire);
    const char *const args[] = {"coverage", config, "--json",       "--next",     "1", "--grid",  "1", "--height",
                                "1.2",      "--at", "0,0,6,5,-1,1", "--step-deg", "3", "--scans", "2", NULL};
    char *json = run(wire, args, 0), line[256], name[64];
    const double none_m2 = number_of(json, "none_m2");
    const char *next = strstr(json, "\"next\""), *at = next != NULL ? strstr(next, "\"station\": \"{name: ") : NULL;
    assert_non_null(at);
    double p[3];
    assert_int_equal(sscanf(at, "\"station\": \"{name: %63[^,], position_m: [%lf, %lf, %lf]}\"", name, p, p + 1, p + 2),
                     4);
    assert_string_equal(name, "next-1");
    assert_true(p[0] < 2.0 && p[2] == 1.2); /* in the other leg */
    const double gain_m2 = number_of(next, "gain_m2"), left_m2 = number_of(next, "none_m2");
    assert_near("gain", gain_m2, none_m2 - left_m2, 1e-9);
    /* Estimates are right but for the cells of 0.25 m at the outlines of the gain: the shadow's line, some 7 m, and the
     * sweep's ends on floor and ceiling, circles of 9.0 and 4.4 m that are partly beyond the walls: 12.6 m at most. */
    assert_near("estimate", number_of(next, "estimate_m2"), gain_m2, 0.25 * (7.0 + 2.0 * 6.3));
    snprintf(line, sizeof line, "stations.1.position_m=[%.17g, %.17g, %.17g]", p[0], p[1], p[2]);
    const char *const with[] = {"coverage", config, "--json", "--set", line, NULL};
    char *after = run(wire, with, 0);
    assert_near("with that station", number_of(after, "none_m2"), left_m2, 1e-9);
    free(after);
    free(json);
    const char *csv = wire_write_text(wire, "places.csv", "x_m,y_m,z_m,heading_deg\n5,1.2,1.2,0\n1,4,1.2,30\n");
    const char *const own[] = {"coverage", config, "--candidates", csv, NULL};
    char *text = run(wire, own, 0);
    if (strstr(text, "{name: next-1, position_m: [1.000, 4.000, 1.200], heading_deg: 30}") == NULL)
        fail_msg("%s", text);
    free(text);
}

/* Heads whose beams lie in planes or on cones, in the upper leg. All 682 pulses of the planar one are tried. A ray
 * lies on the border of a cell, so the estimate may miss the gain by two cells of 0.25 m. At 5 turns a second the other
 * head has 57 869 pulses, and one in 1.4 is tried. Rays of a beam then are at most 7 m * 0.3 deg = 37 mm apart. They
 * miss a cell only where the beam's way through it is shorter: 37 / 250 of the cells.
 */
static void test_next_of_pulses(void **state)
{
    static const struct {
        const char *head;
        double off_m2, off;
    } cases[] = {{"profile: hokuyo-urg-04lx", 2.0 * 0.25 * 0.25, 0.0},
                 {"profile: velodyne-vlp16, lines_hz: 5", 0.0, 0.15}};
    struct wire *wire = *state;
    char text[512], config[256], places[256];
    wire_write_text(wire, "room.obj", L_ROOM);
    snprintf(places, sizeof places, "%s",
             wire_write_text(wire, "places.csv", "x_m,y_m,z_m,heading_deg\n1,4,1.2,130\n"));
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        snprintf(text, sizeof text,
                 "head: {%s}\nscene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n"
                 "stations:\n  - {name: right, position_m: [5, 1, 1.2]}\n",
                 cases[i].head);
        snprintf(config, sizeof config, "%s", wire_write_text(wire, "pulses.yaml", text));
        const char *const args[] = {"coverage", config, "--json", "--candidates", places, NULL};
        char *json = run(wire, args, 0);
        const char *next = strstr(json, "\"next\"");
        assert_non_null(next);
        const double gain_m2 = number_of(next, "gain_m2");
        assert_near(cases[i].head, number_of(next, "estimate_m2"), gain_m2, cases[i].off_m2 + cases[i].off * gain_m2);
        assert_true(gain_m2 > 1.0);
        free(json);
    }
}

/* With stops, head.station counts these. Its second one is at station two, whose scanner and heading the scans have. So
 * the copied line needs this heading and the section scanner, and the other station has neither. */
static void test_next_of_stops(void **state)
{
    struct wire *wire = *state;
    char config[256];
    wire_write_text(wire, "room.obj", L_ROOM);
    snprintf(config, sizeof config, "%s",
             wire_write_text(wire, "stops.yaml",
                             "head: {profile: hokuyo-urg-04lx, station: 2}\n"
                             "scene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n"
                             "platform: {kind: stops, step_s: 10, end_s: 10}\n"
                             "stations:\n  - {name: one, position_m: [5, 1, 1.2]}\n"
                             "  - {name: two, position_m: [4, 1, 1.2], heading_deg: 30,\n"
                             "     scanner: {head: {profile: velodyne-vlp16}}}\n"));
    const char *const args[] = {"coverage", config, "--next",       "1",       "--grid", "2", "--height",
                                "1.2",      "--at", "0,0,6,5,-1,1", "--scans", "1",      NULL};
    char *text = run(wire, args, 0);
    if (strstr(text, ", heading_deg: 30}\n    the scans have the scanner and the tripod's cone of station two: add its "
                     "scanner\n") == NULL)
        fail_msg("%s", text);
    free(text);
}

/* A head near the floor looks up: it sees most of the walls and of the ceiling in the upper leg. Rays that went down
 * would meet the floor near it, and little else. Cells along outlines count as a whole in a scan: half of their 0.25 m
 * along some 20 m of outlines is 12 % of what it sees. */
static void test_next_looks_up(void **state)
{
    struct wire *wire = *state;
    char config[256], places[256];
    wire_write_text(wire, "room.obj", L_ROOM);
    snprintf(places, sizeof places, "%s",
             wire_write_text(wire, "places.csv", "x_m,y_m,z_m,heading_deg\n1,4,0.4,130\n"));
    snprintf(config, sizeof config, "%s",
             wire_write_text(wire, "up.yaml",
                             "head: {profile: full-sweep, prr_hz: 100000, line_start_deg: 10}\n"
                             "scene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n"
                             "stations:\n  - {name: right, position_m: [5, 1, 1.2]}\n"));
    const char *const args[] = {"coverage", config, "--json", "--candidates", places, NULL};
    char *json = run(wire, args, 0);
    const char *next = strstr(json, "\"next\"");
    assert_non_null(next);
    const double gain_m2 = number_of(next, "gain_m2");
    assert_near("up", number_of(next, "estimate_m2"), gain_m2, 0.15 * gain_m2);
    free(json);
}

/* ---- refusals, and a signal */

static void test_refused(void **state)
{
    struct wire *wire = *state;
    const char *config = set_up(wire);
    char csv[256], none[256];
    snprintf(csv, sizeof csv, "%s", wire_write_text(wire, "bad.csv", "x_m,y_m\n1,2\n"));
    snprintf(none, sizeof none, "%s", wire_path(wire, "none.csv"));
    const struct {
        const char *args[8], *says[4];
    } cases[] = {
        {{"--colour", "red", "-o", "x.ply"}, {"--colour red", "seen, count, density, incidence"}},
        {{"--colour", "count"}, {"--colour: allowed with -o FILE"}},
        {{"-o", "x.xyz"}, {"x.xyz", ".ply"}},
        {{"--by", "wall"}, {"--by wall", "label"}},
        {{"--next", "2"}, {"--grid STEP_M or --candidates"}},
        {{"--next", "0", "--grid", "1"}, {"--next 0", "1 to 100"}},
        {{"--grid", "0"}, {"--grid 0", "0.001 to"}},
        {{"--grid", "1", "--candidates", csv}, {"one of them"}},
        {{"--at", "0,0,1,1"}, {"--at: allowed only with --grid"}},
        {{"--height", "3"}, {"--height: allowed only with --grid"}},
        {{"--height", "3", "--candidates", csv}, {"--height: allowed only with --grid"}},
        {{"--step-deg", "2"}, {"--step-deg: allowed only with --grid or"}},
        {{"--step-deg", "2", "--grid", "1", "--set", "head={profile: hokuyo-urg-04lx}"},
         {"--step-deg: head profile hokuyo-urg-04lx", "leave --step-deg out"}},
        {{"--scans", "2"}, {"--scans: allowed only with --grid"}},
        {{"--grid", "1", "--at", "0,0,1"}, {"--at 0,0,1:", "X0,Y0,X1,Y1"}},
        {{"--grid", "1", "--at", "1,0,0,1"}, {"--at 1,0,0,1:", "the lower number"}},
        {{"--grid", "1", "--height", "3", "--at", "0,0,6,5,-1,1"}, {"no place to stand", "3.2 m of room"}},
        {{"--grid", "0.001"}, {"6000 by 5000 places", "step of at least"}},
        {{"--candidates", csv}, {"bad.csv", "x_m,y_m,z_m"}},
        {{"--candidates", none}, {"none.csv", "No such file"}},
        {{"--set", "coverage.cell_m=0"}, {"coverage.cell_m", "0.0001 to 10000 m"}},
        {{"--set", "coverage.cell_m=0.0002"}, {"coverage.cell_m", "MiB are allowed", "a cell of"}},
        {{"--set", "platform.kind=live"}, {"platform.kind: live", "static, stops"}},
        {{"-o", "/nowhere/x.ply"}, {"/nowhere"}},
    };
    usage_complaints = 0;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        const char *args[12] = {"coverage", config};
        for (size_t k = 0; k < 8 && cases[i].args[k] != NULL; k++)
            args[2 + k] = cases[i].args[k];
        usage_expect(wire, cases[i].args[0], args, 2, cases[i].says);
    }
    assert_int_equal(usage_complaints, 0);
}

/* The program prints the table of the stations, and then compares places for hours. */
static void test_interrupt(void **state)
{
    struct wire *wire = *state;
    const char *config = set_up(wire);
    const char *const args[] = {"coverage", config, "--next", "9", "--grid", "0.1", "--step-deg", "0.2", NULL};
    char got[8192] = "";
    size_t n = 0;
    assert_int_equal(mkfifo(wire_path(wire, "out"), 0600), 0);
    const int fd = open(wire_path(wire, "out"), O_RDONLY | O_NONBLOCK);
    assert_true(fd >= 0);
    const pid_t pid = wire_spawn(wire, args, "out", "err", -1);
    while (strstr(got, "\nright") == NULL) {
        struct pollfd on = {.fd = fd, .events = POLLIN};
        assert_int_equal(poll(&on, 1, DEADLINE_MS), 1);
        const ssize_t some = read(fd, got + n, sizeof got - 1 - n);
        if (some <= 0) continue; /* the other end is not open yet */
        n += (size_t)some;
        got[n] = '\0';
    }
    assert_int_equal(kill(pid, SIGINT), 0);
    assert_int_equal(wire_wait(wire, pid), 1);
    close(fd);
    char *says = wire_read(wire_path(wire, "err"), NULL);
    if (strstr(says, "scanhead: interrupted; no file is written\n") == NULL) fail_msg("%s", says);
    free(says);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_figures, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_names_are_text, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_mesh, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_next, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_next_of_pulses, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_next_of_stops, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_next_looks_up, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_refused, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_interrupt, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
