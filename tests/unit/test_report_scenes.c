/* SPDX-License-Identifier: MIT */
/* Reports of scenes with many surfaces, with a mirror, and of clouds that are far or empty: which lines there are, and
 * what is left out. */
#include "tests/unit/commands_rig.h"

#include <fcntl.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "core/colour.h"

static int go_there(void **state)
{
    (void)state;
    return commands_begin();
}

static int times_in(const char *text, const char *what)
{
    int n = 0;
    for (; (text = strstr(text, what)) != NULL; text++)
        n++;
    return n;
}

/* Writes a row of n tiles, 1 m wide, and a cloud with i + 1 points in the middle of tile i. Nothing is recorded: the
 * points lie exactly on the floor. */
static void write_tiles(int n)
{
    int points = 0, vertex = 1;
    FILE *mesh = fopen("tiles.obj", "w"), *cloud = fopen("tiles.ply", "w");
    assert_true(mesh != NULL && cloud != NULL);
    for (int i = 0; i < n; i++, vertex += 4) {
        fprintf(mesh, "o tile%d\nv %d 0 0\nv %d 0 0\nv %d 1 0\nv %d 1 0\nf %d %d %d %d\n", i, i, i + 1, i + 1, i,
                vertex, vertex + 1, vertex + 2, vertex + 3);
        points += i + 1;
    }
    fprintf(cloud,
            "ply\nformat ascii 1.0\nelement vertex %d\nproperty double x\nproperty double y\nproperty double z\n"
            "property ushort label\nend_header\n",
            points);
    for (int i = 0; i < n; i++)
        for (int k = 0; k <= i; k++)
            fprintf(cloud, "%g %g 0 %d\n", i + 0.25 + 0.01 * (k % 50), 0.3 + 0.01 * (k / 50), i);
    assert_int_equal(fclose(mesh) | fclose(cloud), 0);
    write_text("tiles.yaml",
               "head: {profile: sphere, step_deg: 10}\noutput: {crs: local, layout: polar}\n"
               "scene: {meshes: [{file: tiles.obj, up: z, scale: 1}]}\nstations: [{position_m: [1, 0.5, 2]}]\n");
}

/* The text has the 20 surfaces with the most points, the page 200, and JSON all of them. */
static void so_many_surfaces_are_shown(void **state)
{
    static const int counts[] = {20, 21, 200, 201};
    (void)state;
    for (int c = 0; c < 4; c++) {
        const int n = counts[c], shown = n < 20 ? n : 20, on_page = n < 200 ? n : 200;
        char line[160];
        write_tiles(n);
        does(&app_report, "tiles.yaml tiles.ply --html tiles.html", 0);
        const char *at = strstr(on_out, "\nby surface");
        assert_non_null(at);
        assert_int_equal(times_in(at, "\nlabel "), shown);
        for (int i = 0; i < shown; i++) { /* in this order */
            snprintf(line, sizeof line, "\nlabel %-28d %10d ", n - 1 - i, n - i);
            at = strstr(at, line);
            if (at == NULL) fail_msg("no %s", line);
        }
        snprintf(line, sizeof line, "\nnot shown: %d more with points; --json has all of them\n", n - shown);
        assert_int_equal(strstr(on_out, line) != NULL, n > shown);
        assert_int_equal(times_in(on_out, "\nnot shown: "), n > shown);
        char *page = contents("tiles.html");
        assert_int_equal(times_in(page, "<tr><td>tile"), on_page);
        snprintf(line, sizeof line, "<p class=\"soft\">%d more surfaces have points; ", n - on_page);
        assert_int_equal(times_in(page, line), n > on_page);
        free(page);
        does(&app_report, "tiles.yaml tiles.ply --json", 0);
        assert_int_equal(times_in(on_out, "\"object\": \"tile"), n + 1); /* and that of the worst point */
    }
}

/* A floor that mirrors, under a ceiling: the ceiling is seen once more below the floor. The mirrored points are left
 * out. */
static void points_in_a_mirror_are_left_out(void **state)
{
    (void)state;
    unsigned long long points, ghosts;
    char card[128];
    write_text("m.obj", "o floor\nv -9 -9 0\nv 9 -9 0\nv 9 9 0\nv -9 9 0\nf 1 2 3 4\n"
                        "o roof\nv -9 -9 3\nv 9 -9 3\nv 9 9 3\nv -9 9 3\nf 8 7 6 5\n");
    write_text("m.yaml", "head: {profile: sphere, step_deg: 10}\noutput: {crs: local, layout: geo}\n"
                         "scene: {meshes: [{file: m.obj, up: z, scale: 1}]}\nstations: [{position_m: [0, 0, 2]}]\n"
                         "beam: {mode: single}\nsurfaces: [{object: floor, mirror: 0.9}]\n");
    does(&app_record, "m.yaml -o m.ply --quiet", 0);
    const struct timespec written[2] = {{.tv_sec = 1767323045}, {.tv_sec = 1767323045}};
    assert_int_equal(utimensat(AT_FDCWD, "m.ply", written, 0), 0);
    does(&app_report, "m.yaml m.ply --html m.html", 0);
    const char *at = strstr(on_out, "\nghosts ");
    assert_non_null(at);
    assert_int_equal(sscanf(on_out, "points %llu", &points), 1);
    assert_int_equal(sscanf(at, " ghosts %llu points seen in mirrors, left out", &ghosts), 1);
    assert_true(ghosts > 20 && points > 20);
    has(on_out, "\nempty      0 shots without echo\n");                                              /* they are none */
    has(on_out, "\nWithin the expected error: no point is farther from the scene than its bound, "); /* once */
    assert_int_equal(times_in(on_out, "Within the expected error"), 1);
    char *page = contents("m.html");
    snprintf(card, sizeof card, "<div><span>Seen in mirrors, left out</span><b>%llu</b></div>\n", ghosts);
    has(page, card);
    has(page, "<dt>Written</dt><dd>2026-01-02 03:04:05 UTC</dd>\n");
    has(page, "<div><span>Shots without echo in the file</span><b>0</b></div>\n");
    free(page);
    does(&app_report, "m.yaml m.ply --json", 0);
    snprintf(card, sizeof card, "\"empty\": 0,\n  \"ghosts\": %llu,\n", ghosts);
    has(on_out, card);
    /* Without the mirror in the configuration their labels are those of no surface. */
    does(&app_report, "m.yaml m.ply --set surfaces=[]", 2);
    has(on_err, "; the scene has 2 surfaces, from 0\n");
}

/* A page's map has seven colours of the ramp, from distance 0 on. */
static void has_ramp(const char *page)
{
    char want[800] = "<linearGradient id=\"ramp\">";
    for (int k = 0; k <= 6; k++) {
        uint8_t rgb[3];
        colour_ramp(k / 6.0, rgb);
        snprintf(want + strlen(want), sizeof want - strlen(want),
                 "<stop offset=\"%.4f\" stop-color=\"#%02x%02x%02x\"/>", k / 6.0, rgb[0], rgb[1], rgb[2]);
    }
    strcat(want, "</linearGradient>");
    has(page, want);
}

/* One point on the roof and one of its image: the third surface is the floor's image, and the fourth the roof's. Where
 * all points are images, there is no report. */
static void one_point_in_a_mirror(void **state)
{
    static const char head[] = "ply\nformat ascii 1.0\nelement vertex %d\nproperty double x\nproperty double y\n"
                               "property double z\nproperty ushort label\nend_header\n%s";
    char text[400];
    (void)state;
    snprintf(text, sizeof text, head, 2, "1 1 3 1\n1 1 -3 3\n");
    write_text("g.ply", text);
    does(&app_report, "m.yaml g.ply --html g.html", 0);
    assert_int_equal(strncmp(on_out, "points     1\nempty      0 shots without echo\nghosts     1 points seen in ", 66),
                     0);
    char *page = contents("g.html");
    has(page, "<div><span>Seen in mirrors, left out</span><b>1</b></div>\n");
    has_ramp(page);
    free(page);
    snprintf(text, sizeof text, head, 1, "1 1 -3 3\n");
    write_text("g.ply", text);
    does(&app_report, "m.yaml g.ply", 2);
    assert_string_equal(on_err, "scanhead: g.ply: it has no points (1 shots without echo)\n");
    snprintf(text, sizeof text, head, 2, "1 1 3 1\n1 1 -3 4\n"); /* two surfaces and their images have 0 to 3 */
    write_text("g.ply", text);
    does(&app_report, "m.yaml g.ply", 2);
    assert_string_equal(on_err, "scanhead: g.ply: point 2 has label 4; the scene has 4 surfaces, from 0\n");
}

/* Names of stations cover no other one. Of five stations in one place the first has its name on the right, the others
 * have theirs on the left, above and below, and there is no room for the fifth. */
static void names_on_a_map_are_apart(void **state)
{
    (void)state;
    write_tiles(3);
    write_text(
        "five.yaml",
        "head: {profile: sphere, step_deg: 10}\noutput: {crs: local, layout: polar}\n"
        "scene: {meshes: [{file: tiles.obj, up: z, scale: 1}]}\nstations: [{name: a, position_m: [1.5, 0.5, 2]}, "
        "{name: b, position_m: [1.5, 0.5, 2]}, {name: c, position_m: [1.5, 0.5, 2]}, "
        "{name: d, position_m: [1.5, 0.5, 2]}, {name: e, position_m: [1.5, 0.5, 2]}]\n");
    write_text("five.ply", "ply\nformat ascii 1.0\nelement vertex 2\nproperty double x\nproperty double y\n"
                           "property double z\nend_header\n0.5 0 0\n2.5 1 0\n");
    does(&app_report, "five.yaml five.ply --html five.html", 0);
    char *page = contents("five.html");
    static const char *const name[] = {"\"start\">1 a</text>", "\"end\">2 b</text>", "\"middle\">3 c</text>",
                                       "\"middle\">4 d</text>", ">5 e</title>"};
    for (int i = 0; i < 5; i++)
        has(page, name[i]);
    assert_null(strstr(page, ">5 e</text>"));
    has(page, "There is no room for the names of 1 of them");
    free(page);
}

/* The top of a page names the files, the scanner with its noise, and the frame of the coordinates. UTM 33 north is EPSG
 * 32633, ECEF 4978, and latitude, longitude and height 4979. */
static void the_top_of_a_page(void **state)
{
    static const struct {
        const char *set, *coordinates, *scanner;
    } rows[] = {
        {"output.crs=local", "the scene's own frame", "range noise off, angle noise off, ball noise off"},
        {"output.crs=utm --set output.layout=geo --set noise.range=on", "UTM or UPS; EPSG 32633",
         "range noise on, angle noise off, ball noise off"},
        {"output.crs=ecef --set output.layout=geo --set noise.angle=on", "ECEF; EPSG 4978",
         "range noise off, angle noise on, ball noise off"},
        {"output.crs=geodetic --set output.layout=geo --set noise.ball.radius_m=0.001",
         "latitude, longitude, height; EPSG 4979", "range noise off, angle noise off, ball noise on"},
    };
    (void)state;
    write_tiles(3);
    write_text("g.yaml",
               "head: {profile: sphere, step_deg: 10}\noutput: {crs: local}\n"
               "scene: {meshes: [{file: tiles.obj, up: z, scale: 1}], anchor: {source: explicit, origin_m: [0, 0, 0], "
               "lat_deg: 52, lon_deg: 15, height_m: 40}}\nstations: [{position_m: [1, 0.5, 2]}]\n");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char words[256], fact[256];
        snprintf(words, sizeof words, "g.yaml -o g.ply --quiet --set %s", rows[i].set);
        does(&app_record, words, 0);
        snprintf(words, sizeof words, "g.yaml g.ply --tolerance-m 1 --html g.html --set %s", rows[i].set);
        does(&app_report, words, 0);
        char *page = contents("g.html");
        snprintf(fact, sizeof fact, "<dt>Coordinates</dt><dd>%s</dd>\n", rows[i].coordinates);
        has(page, fact);
        snprintf(fact, sizeof fact, "<dt>Scanner</dt><dd>scanhead sphere, %s</dd>\n", rows[i].scanner);
        has(page, fact);
        has(page, "<dt>Recording</dt><dd>g.ply</dd>\n");
        has(page, "<h2>Pictures</h2>\n");
        has(page, "<dt>Configuration</dt><dd>g.yaml</dd>\n<dt>Scene</dt><dd>tiles.obj</dd>\n");
        for (int k = 0; k < 9; k++) { /* the chart of incidences has all groups */
            snprintf(fact, sizeof fact, ">%d\xe2\x80\x93%d\xc2\xb0</text>", 10 * k, 10 * k + 10);
            has(page, fact);
        }
        free(page);
    }
}

/* A mesh may have any bytes, also those with which a terminal clears its screen. Neither text nor page has them. */
static void names_are_one_line(void **state)
{
    (void)state;
    write_text("o.obj", "o a\033[2Jb\nusemtl c\033d\nv -9 -9 0\nv 9 -9 0\nv 9 9 0\nf 1 2 3\n");
    write_text("o.yaml", "head: {profile: sphere, step_deg: 10}\noutput: {crs: local, layout: polar}\n"
                         "scene: {meshes: [{file: o.obj, up: z, scale: 1}]}\nstations: [{position_m: [1, 0.5, 2]}]\n");
    write_text("o.ply", "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\n"
                        "property double z\nproperty ushort label\nend_header\n5 -5 0 0\n");
    does(&app_report, "o.yaml o.ply --html o.html", 0);
    has(on_out, " on a?[2Jb | c?d\n");
    has(on_out, "  a?[2Jb | c?d\n\nAll in mm.");
    assert_null(strchr(on_out, '\033'));
    char *page = contents("o.html");
    has(page, "a?[2Jb | c?d");
    assert_null(strchr(page, '\033'));
    free(page);
}

/* A coordinate of 10^12 m and more is not written with decimals. A cloud without points is refused. */
static void clouds_that_are_far_or_empty(void **state)
{
    static const char head[] = "ply\nformat ascii 1.0\nelement vertex %d\nproperty double x\nproperty double y\n"
                               "property double z\nend_header\n%s";
    char text[400];
    (void)state;
    write_tiles(3);
    snprintf(text, sizeof text, head, 2, "2e12 0.5 0\n0.5 0.5 0\n");
    write_text("far.ply", text);
    does(&app_report, "tiles.yaml far.ply", 1);
    has(on_out, "\nworst      point 1 at 2e+12 0.500000 0.000000\n");
    has(on_out, "\nfar        1 farther than 10 m from everything\n");
    has(on_err, "far.ply: 1 of 2 points are farther than 0.001 m from the scene\n");
    snprintf(text, sizeof text, head, 1, "2e12 0.5 0\n");
    write_text("far.ply", text);
    does(&app_report, "tiles.yaml far.ply", 1);
    has(on_out, "\nmean       -\nRMS        -\n50 %       -\n95 %       -\n99.9 %     -\nmax        -\n");
    has(on_out, "\nNot within the expected error: 1 of 1 points are farther from everything than --max-m.\n");
    snprintf(text, sizeof text, head, 2, "nan nan nan\nnan nan nan\n");
    write_text("none.ply", text);
    does(&app_report, "tiles.yaml none.ply", 2);
    assert_string_equal(on_err, "scanhead: none.ply: it has no points (2 shots without echo)\n");
}

/* The body goes north at 1 m/s, and the roof up at 0.25 m/s. At a stop both stand still for the scan. The stop is 2 s
 * after the ride began, so the body is 2 m north of its place at rest, and the roof 0.5 m higher. A point at the body's
 * place at rest is 2 m away from it. Without stops the body moves during the scan. */
static void points_on_bodies(void **state)
{
    static const char scene[] =
        "head: {profile: sphere, step_deg: 10}\noutput: {crs: local, layout: polar}\n"
        "scene: {meshes: [{file: floor.obj, up: z, scale: 1}, {file: roof.obj, up: z, scale: "
        "1, move_m_s: [0, 0, 0.25]}, {file: body.obj, up: z, scale: 1, move_m_s: [0, 1, 0]}]}\n";
    static const char cloud[] = "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\n"
                                "property double z\nproperty ushort label\nend_header\n-3 -3 0 0\n0.5 3 0.5 2\n"
                                "0.5 0.5 5.5 1\n0.5 %d 0.25 2\n";
    char text[800];
    (void)state;
    write_text("floor.obj", "o floor\nv -9 -9 0\nv 9 -9 0\nv 9 9 0\nv -9 9 0\nf 1 2 3 4\n");
    write_text("roof.obj", "o roof\nv 0 0 5\nv 1 0 5\nv 1 1 5\nv 0 1 5\nf 1 2 3 4\n");
    write_text("body.obj", "o body\nv 0 1 0\nv 1 1 0\nv 1 1 1\nv 0 1 1\nf 1 2 3 4\n");
    write_text("ride.csv", "t_s,x_m,y_m,z_m,roll_deg,pitch_deg,heading_deg\n0,2,-4,2,0,0,0\n4,2,-5,2,0,0,0\n");
    snprintf(text, sizeof text,
             "%sstations: [{position_m: [2, -4, 2]}]\n"
             "platform: {kind: stops, file: ride.csv, start_s: 2, end_s: 3, step_s: 1}\n",
             scene);
    write_text("stops.yaml", text);
    snprintf(text, sizeof text, "%sstations: [{position_m: [2, -4, 2]}]\n", scene);
    write_text("moves.yaml", text);
    snprintf(text, sizeof text, cloud, 3);
    write_text("bodies.ply", text);
    does(&app_report, "stops.yaml bodies.ply --tolerance-m 1e-9", 0);
    has(on_out, "\nmax        0.000000 mm\n");
    does(&app_report, "moves.yaml bodies.ply", 2);
    has(on_err,
        "bodies.ply: point 2 is on body, which moved during the scan; allowed are points on bodies that stand ");
    snprintf(text, sizeof text, cloud, 1);
    write_text("bodies.ply", text);
    does(&app_report, "stops.yaml bodies.ply --tolerance-m 1e-9", 1);
    has(on_out, "\nmax        2.000000 m\nworst      point 4 at 0.500000 1.000000 0.250000 on body\n");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(so_many_surfaces_are_shown), cmocka_unit_test(points_in_a_mirror_are_left_out),
        cmocka_unit_test(one_point_in_a_mirror),      cmocka_unit_test(the_top_of_a_page),
        cmocka_unit_test(names_are_one_line),         cmocka_unit_test(clouds_that_are_far_or_empty),
        cmocka_unit_test(points_on_bodies),           cmocka_unit_test(names_on_a_map_are_apart),
    };
    return cmocka_run_group_tests_name("report scenes", tests, go_there, commands_end);
}
