/* SPDX-License-Identifier: MIT */
/* These tests run scanhead map, from above. Stations stand and look where the configuration says, and one is beside the
 * scene. A picture in perspective leaves out the same by --above and --below. */
#include "tests/wire/room.h"

/* Pixels of a centimetre. A station is east of the room, and the area then includes it. */
static const char CONFIG[] = "head: {profile: full-sweep, prr_hz: 5000, lines_hz: 100, pan_deg_s: 240, frames: 1}\n"
                             "scene:\n  meshes: [{file: room.obj, up: z, scale: 1}]\n"
                             "stations:\n  - {name: first, position_m: [0.5, -1, 1], heading_deg: 90}\n"
                             "  - {name: second, position_m: [-1, 1.25, 1], heading_deg: 180}\n"
                             "  - {name: beside, position_m: [20, 0, 1], heading_deg: 315}\n";

static char *draw(struct wire *wire, const char *const *more, const char *out, int status)
{
    char config[352], path[352];
    const char *args[WIRE_MAX_ARGS] = {"map", config, "--quiet", "-o", path};
    room_write(wire);
    snprintf(config, sizeof config, "%s", wire_write_text(wire, "config.yaml", CONFIG));
    snprintf(path, sizeof path, "%s", wire_path(wire, out));
    for (int n = 5; *more != NULL; n++)
        args[n] = *more++;
    wire_run(wire, args, status);
    return wire_read(status == 0 ? path : wire_path(wire, "err"), NULL);
}

struct mark {
    double x, y, to_x, to_y; /* where it is, and the end of its tick; pixels to the right and down */
};

static struct mark mark_of(const char *svg, const char *name)
{
    struct mark m = {.x = 0.0};
    char title[64];
    snprintf(title, sizeof title, "<title>%s, ", name);
    const char *at = strstr(svg, title);
    if (at == NULL || (at = strstr(at, "<line x1=")) == NULL) fail_msg("no mark of %s", name);
    assert_int_equal(sscanf(at, "<line x1=\"%lf\" y1=\"%lf\" x2=\"%lf\" y2=\"%lf\"", &m.x, &m.y, &m.to_x, &m.to_y), 4);
    return m;
}

/* Places are written in hundredths of a pixel, so the two that are compared may differ by one hundredth each. */
static void expect(const char *what, double got, double want)
{
    if (!(fabs(got - want) <= 0.02)) fail_msg("%s: %g, and it should be %g", what, got, want);
}

static void test_marks(void **state)
{
    struct wire *wire = *state;
    static const double heading_deg[] = {90, 180, 315};
    char *svg = draw(wire, (const char *const[]){"--pixel-m", "0.01", NULL}, "map.svg", 0);
    const struct mark m[] = {mark_of(svg, "first"), mark_of(svg, "second"), mark_of(svg, "beside")};
    double width = 0.0, height = 0.0;
    assert_int_equal(sscanf(strstr(svg, " width="), " width=\"%lf\" height=\"%lf\"", &width, &height), 2);
    expect("second is west of the first", m[0].x - m[1].x, 150.0);
    expect("second is north of the first", m[0].y - m[1].y, 225.0);
    expect("the third is east of it", m[2].x - m[0].x, 1950.0);
    for (int i = 0; i < 3; i++) {
        const double east = m[i].to_x - m[i].x, south = m[i].to_y - m[i].y, long_px = hypot(east, south);
        assert_true(long_px > 5.0);
        expect("tick east", east, long_px * sin(heading_deg[i] * M_PI / 180.0));
        expect("tick north", -south, long_px * cos(heading_deg[i] * M_PI / 180.0));
        assert_true(m[i].x > 0.0 && m[i].x < width && m[i].y > 0.0 && m[i].y < height);
    }
    free(svg);
}

/* A tripod stands on the room's floor, whichever scanner its station has. The plan does not mention another station's
 * scanner. */
static void test_heights(void **state)
{
    struct wire *wire = *state;
    for (int here = 1; here <= 2; here++) {
        char station[32], title[96], config[352];
        snprintf(station, sizeof station, "head.station=%d", here);
        const char *const sets[] = {"--set", "stations.0.tripod.leg_m=4",
                                    "--set", "stations.1.tripod.leg_m=4",
                                    "--set", "stations.1.position_m=-1,1.25,0.5",
                                    "--set", "stations.1.scanner.head.lines_hz=50",
                                    "--set", station,
                                    NULL};
        char *svg = draw(wire, sets, "map.svg", 0);
        for (int i = 0; i < 2; i++) {
            snprintf(title, sizeof title, "<title>%s, %.2f m above the ground<", i == 0 ? "first" : "second",
                     (i == 0 ? 1.0 : 0.5) - ROOM_MIN[2]);
            if (strstr(svg, title) == NULL) fail_msg("head of station %d: there is no %s", here, title);
        }
        free(svg);
        const char *plan[WIRE_MAX_ARGS] = {"plan", config};
        snprintf(config, sizeof config, "%s", wire_path(wire, "config.yaml"));
        memcpy(plan + 2, sets, sizeof sets);
        assert_int_equal(wire_wait(wire, wire_spawn(wire, plan, "out", "err", -1)), 0);
        char *says = wire_read(wire_path(wire, "out"), NULL);
        snprintf(title, sizeof title, "legs of 4 m, top %g m above the ground", (here == 1 ? 1.0 : 0.5) - ROOM_MIN[2]);
        if (strstr(says, title) == NULL || strstr(says, "top 0 m") != NULL) fail_msg("no %s: %s", title, says);
        free(says);
    }
}

/* The room ends between z = ROOM_MIN[2] and ROOM_MAX[2]. Above or below all of it no point is left. */
static void test_cuts(void **state)
{
    struct wire *wire = *state;
    char over[32], under[32];
    snprintf(over, sizeof over, "%g", ROOM_MAX[2] + 0.1);
    snprintf(under, sizeof under, "%g", ROOM_MIN[2] - 0.1);
    const char *const *const cut[] = {(const char *const[]){"--perspective", "--above", over, NULL},
                                      (const char *const[]){"--perspective", "--below", under, NULL}};
    for (int i = 0; i < 2; i++) {
        char *says = draw(wire, cut[i], "view.png", 2);
        assert_non_null(strstr(says, "no point is in the picture"));
        free(says);
    }
}

/* Each wall of the room is an object of its own, with four open edges. Without the option none is drawn. */
static void test_open_edges(void **state)
{
    struct wire *wire = *state;
    char *svg = draw(wire, (const char *const[]){"--pixel-m", "0.01", "--open-edges", NULL}, "map.svg", 0);
    const char *p = strstr(svg, "<title>open edges of the scene</title>");
    assert_non_null(p);
    const char *end = strstr(p, "</g>");
    double least = INFINITY, most = -INFINITY;
    int n = 0;
    for (; (p = strstr(p, "<line x1=")) != NULL && p < end; p++, n++) {
        double x[2], y[2];
        assert_int_equal(sscanf(p, "<line x1=\"%lf\" y1=\"%lf\" x2=\"%lf\" y2=\"%lf\"", &x[0], &y[0], &x[1], &y[1]), 4);
        least = fmin(least, fmin(x[0], x[1]));
        most = fmax(most, fmax(x[0], x[1]));
    }
    assert_int_equal(n, 24);
    expect("the room's width", most - least, 100.0 * (ROOM_MAX[0] - ROOM_MIN[0]));
    free(svg);
    svg = draw(wire, (const char *const[]){NULL}, "map.svg", 0);
    assert_null(strstr(svg, "open edges"));
    free(svg);
    char *err = draw(wire, (const char *const[]){"--open-edges", "--perspective", NULL}, "map.png", 2);
    assert_non_null(strstr(err, "--open-edges: allowed for a map from above"));
    free(err);
}

/* A rectangle of 1 m by 2 m, 1 m ahead. The first station looks east, so that right is south; a pixel is a
 * centimetre. */
static void test_fields(void **state)
{
    struct wire *wire = *state;
    static const double corner[5][2] = {{100, 0}, {100, 100}, {300, 100}, {300, 0}, {100, 0}};
    const char *const more[] = {"--pixel-m", "0.01", "--set",
                                "fields=[{number: 1, shape: rectangle, corner_m: [0, 1], size_m: [1, 2]}]", NULL};
    char *svg = draw(wire, more, "map.svg", 0);
    const struct mark first = mark_of(svg, "first");
    const char *p = strstr(svg, "<title>monitored fields</title>");
    assert_non_null(p);
    for (int i = 0; i < 4; i++, p++) {
        struct mark line;
        assert_non_null(p = strstr(p, "<line x1="));
        assert_int_equal(
            sscanf(p, "<line x1=\"%lf\" y1=\"%lf\" x2=\"%lf\" y2=\"%lf\"", &line.x, &line.y, &line.to_x, &line.to_y),
            4);
        expect("a corner's x", line.x - first.x, corner[i][0]);
        expect("a corner's y", line.y - first.y, corner[i][1]);
        expect("the next one's x", line.to_x - first.x, corner[i + 1][0]);
        expect("the next one's y", line.to_y - first.y, corner[i + 1][1]);
    }
    free(svg);
    svg = draw(wire, (const char *const[]){NULL}, "map.svg", 0);
    assert_null(strstr(svg, "monitored fields"));
    free(svg);
}

static double width_of(const char *svg)
{
    double width = 0.0;
    assert_int_equal(sscanf(strstr(svg, " width="), " width=\"%lf\"", &width), 1);
    return width;
}

/* Fields are those of head.station's scanner. A station with another one has none, nor room for them. */
static void test_fields_of_one_scanner(void **state)
{
    struct wire *wire = *state;
    const char *const more[] = {"--pixel-m", "0.01",
                                "--set",     "stations.2.scanner.head.lines_hz=50",
                                "--set",     "fields=[{number: 1, shape: rectangle, corner_m: [0, 1], size_m: [1, 2]}]",
                                NULL};
    char *svg = draw(wire, more, "map.svg", 0);
    const char *p = strstr(svg, "<title>monitored fields</title>");
    assert_non_null(p);
    const char *end = strstr(p, "</g>");
    int lines = 0;
    assert_non_null(end);
    while ((p = strstr(p + 1, "<line x1=")) != NULL && p < end)
        lines++;
    assert_int_equal(lines, 2 * 4); /* two stations, four sides */
    char *without = draw(wire, (const char *const[]){"--pixel-m", "0.01", NULL}, "map.svg", 0);
    assert_true(width_of(svg) == width_of(without));
    free(without);
    free(svg);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test_setup_teardown(test_marks, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_open_edges, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_fields, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_fields_of_one_scanner, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_heights, wire_setup, wire_teardown),
        cmocka_unit_test_setup_teardown(test_cuts, wire_setup, wire_teardown),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
