/* SPDX-License-Identifier: MIT */
/* Whole commands in this process, on a closed room that a sphere of shots hits from two stations. All
 * counts are known by hand. */
#include "tests/unit/commands_rig.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "firmware_sim/app/run/page.h"
#include "firmware_sim/app/studio/watch/watch.h"

/* Steps of 10 degrees: 17 rings of 36 shots, and a shot at each pole, where 35 more are fired and not cast. */
enum { SHOTS = 17 * 36 + 2, FIRED = 19 * 36 };

/* A box of 10 x 10 x 4 m, whose lower corner has this x. */
static void write_box(const char *name, double x)
{
    FILE *out = fopen(name, "w");
    assert_non_null(out);
    fputs("o box\n", out);
    for (int i = 0; i < 8; i++)
        fprintf(out, "v %.3f %d %d\n", x + (i % 4 == 1 || i % 4 == 2 ? 10.0 : 0.0), i % 4 >= 2 ? 5 : -5, i < 4 ? 0 : 4);
    fputs("f 1 2 3 4\nf 5 8 7 6\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n", out);
    assert_int_equal(fclose(out), 0);
}

static int go_there(void **state)
{
    (void)state;
    if (commands_begin() != 0) return -1;
    write_box("room.obj", -5);
    write_text("c.yaml", "head: {profile: sphere, step_deg: 10}\nscene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
                         "stations: [{position_m: [0, 0, 2]}, {position_m: [4, 0, 2], heading_deg: 90}]\n"
                         "output: {crs: local}\n");
    return 0;
}

static void count_is(const char *key, unsigned long long want)
{
    char line[96];
    snprintf(line, sizeof line, "\"%s\": %llu,\n", key, want);
    has(on_out, line);
}

static void all_formats_are_recorded_at_once(void **state)
{
    (void)state;
    char said[256];
    does(&app_record,
         "c.yaml --station all -o a.ply -o a.las -o a.ptx -o a.e57 -o a.obj -o a.gltf -o a.shs -o a.pcapng --stats -",
         0);
    /* The grids of .ptx have a place for each shot that is fired. */
    snprintf(said, sizeof said,
             "scanhead: a.ptx: %d places of the grid without a shot, filled like shots without echo\n"
             "scanhead: %d points, 0 shots without echo, 2 scans\n",
             2 * (FIRED - SHOTS), 2 * SHOTS);
    assert_string_equal(on_err, said);
    count_is("points", 2 * SHOTS);
    count_is("pulses", 2 * SHOTS);
    count_is("cast_pulses", 2 * SHOTS);
    count_is("fired_pulses", 2 * FIRED);
    count_is("scans", 2);
    for (const char *const *zero = (const char *const[]){"empty_shots", "lost_pulses", "missing_pulses", "bad_bytes",
                                                         "seq_lost", "repeated", "late", "restarts", "dropped", NULL};
         *zero != NULL; zero++)
        count_is(*zero, 0);
    does(&app_record, "a.shs -o b.ply --quiet", 0);
    assert_string_equal(on_err, "");
    char *one = contents("a.ply"), *other = contents("b.ply");
    assert_string_equal(strstr(one, "element vertex"), strstr(other, "element vertex")); /* up to the first zero byte */
    free(one);
    free(other);
    does(&app_record, "--repair a.ply --repair a.las --stats -", 0);
    has(on_out, "\"file\": \"a.ply\",\n    \"unit\": \"points\",\n    \"kept\": 1228,\n");
    has(on_out, "\"cut_bytes\": 0,\n    \"was_whole\": true,\n");
    assert_int_equal(rename("b.ply", "b.ply.part"), 0);
    does(&app_record, "--repair b.ply.part --repair b.ply --repair b.ply", 0); /* one after the other */
    has(on_err, "b.ply: whole: 1228 points");
    does(&app_record, "--repair none.ply --stats -", 2);
    has(on_out, "\"file\": \"none.ply\",\n    \"error\": \"none.ply");
}

/* Without limits the nearest point is blue, and the farthest is red. The file is written once both are known. */
static void colours_have_limits_of_their_own(void **state)
{
    (void)state;
    double low = INFINITY, high = 0.0, range;
    int first[3] = {0}, last[3] = {0}, rgb[3], n = 0, used;
    char said[256];
    does(&app_record, "c.yaml -o r.ply --ascii --colour range --ply-columns range,colour --quiet", 0);
    char *text = contents("r.ply"), *at = strstr(text, "end_header\n") + 11;
    for (; sscanf(at, "%*f %*f %*f %lf %d %d %d%n", &range, &rgb[0], &rgb[1], &rgb[2], &used) == 4; at += used, n++) {
        if (range < low) low = range, memcpy(first, rgb, sizeof rgb);
        if (range > high) high = range, memcpy(last, rgb, sizeof rgb);
    }
    assert_int_equal(n, SHOTS);
    assert_true(fabs(low - 2.0) < 1e-5); /* straight up and down */
    assert_true(first[2] > 100 && first[0] < 50 && first[2] > first[1]);
    assert_true(last[0] > 100 && last[2] < 50 && last[0] > last[1]);
    free(text);
    assert_int_not_equal(access("r.ply.frames", F_OK), 0);
    /* Limits that are given count, in whatever order: up to 1000 m all that is in the room is blue. */
    for (int order = 0; order < 2; order++) {
        does(&app_record,
             order ? "c.yaml -o s.ply --ascii --ply-columns colour --colour-limits 0,1000 --colour range --quiet"
                   : "c.yaml -o s.ply --ascii --ply-columns colour --colour range --colour-limits 0,1000 --quiet",
             0);
        text = contents("s.ply");
        at = strstr(text, "end_header\n") + 11;
        for (n = 0; sscanf(at, "%*f %*f %*f %d %d %d%n", &rgb[0], &rgb[1], &rgb[2], &used) == 3; at += used, n++)
            assert_true(rgb[2] > 100 && rgb[0] < 60);
        assert_int_equal(n, SHOTS);
        free(text);
    }
    does(&app_record, "c.yaml -o s.ply --colour reflectance --quiet", 0);
    snprintf(
        said, sizeof said,
        "scanhead: warning: --colour reflectance: none of %d points has a reflectance, so all have the colour for a "
        "missing one; it needs the head's signal.model: on\n",
        SHOTS);
    assert_string_equal(on_err, said);
    does(&app_record, "c.yaml -o s.ply --colour reflectance --quiet --set signal.model=on", 0);
    assert_null(strstr(on_err, "--colour reflectance"));
    does(&app_record, "c.yaml -o s.ply --ascii --colour solid --colour-rgb 1,2,3 --ply-columns colour --quiet", 0);
    text = contents("s.ply");
    n = 0;
    for (at = text; (at = strstr(at, " 1 2 3\n")) != NULL; at++)
        n++;
    assert_int_equal(n, SHOTS);
    free(text);
}

static void a_report_of_a_good_scan(void **state)
{
    (void)state;
    char line[64];
    does(&app_report, "c.yaml a.ply --html a.html", 0);
    snprintf(line, sizeof line, "points     %d\nempty      0 ", 2 * SHOTS);
    assert_int_equal(strncmp(on_out, line, strlen(line)), 0);
    has(on_out, "\ncoverage   1 of 1 surfaces, 12 of 12 triangles\n");
    snprintf(line, sizeof line, "\nechoes     %d shots with 1\n", 2 * SHOTS);
    has(on_out, line);
    has(on_out, "\nWithin the expected error, at all 2 stations.\n");
    does(&app_report, "c.yaml a.las --json", 0);
    count_is("points", 2 * SHOTS);
    count_is("surfaces_hit", 1);
    does(&app_report, "c.yaml a.ply --set instrument.range_offset_m=0.001", 0);
    has(on_out, "\nNot judged: of 2 stations, 0 are within the expected error, 0 are not, 2 can't be judged.\n");
    has(on_out,
        "\nstation 1 station-1: Not judged: the configuration has errors of the instrument, which move points on "
        "purpose.\n");
}

static void maps(void **state)
{
    (void)state;
    char said[128];
    does(&app_map, "c.yaml -o m.svg --open-edges", 0);
    snprintf(said, sizeof said,
             "scanhead: 0 open edges drawn\nscanhead: m.svg: %d points drawn, 0 outside of the area\n", 2 * SHOTS);
    assert_string_equal(on_err, said);
    char *svg = contents("m.svg");
    has(svg, "<title>station-1, z 2.00 m</title>");
    has(svg, "<title>station-2, z 2.00 m</title>");
    free(svg);
    for (const char *const *colour = (const char *const[]){"height", "range", "label", "station", NULL};
         *colour != NULL; colour++) {
        char words[96];
        snprintf(words, sizeof words, "c.yaml -o p.png --perspective --size 90x60 --colour %s", *colour);
        does(&app_map, words, 0);
        snprintf(said, sizeof said, "scanhead: p.png: %d points in the picture, 0 outside of it\n", 2 * SHOTS);
        has(on_err, said);
        snprintf(words, sizeof words, "a.ply -o q.png --perspective --size 90x60 --colour %s --below 1.5", *colour);
        does(&app_map, words, 0);
        has(on_err, "scanhead: q.png: ");
        has(on_err, " left out by height\n");
    }
    /* All points are in the picture, wherever the first and the last one are. */
    write_text("far.ply", "ply\nformat ascii 1.0\nelement vertex 4\nproperty double x\nproperty double y\n"
                          "property double z\nend_header\n-100 0 0\n0 0 1\n1 0 0\n0 300 0\n");
    does(&app_map, "far.ply -o f.png --perspective --size 90x60", 0);
    has(on_err, "scanhead: f.png: 4 points in the picture, 0 outside of it\n");
    does(&app_map, "c.yaml -o p.png --perspective --colour reflectance", 2);
    has(on_err, "--colour reflectance: no point has one; --set signal.model=on gives them one in a scan");
    does(&app_map, "c.yaml -o p.png --perspective --size 90x60 --colour reflectance --set signal.model=on", 0);
}

/* In ECEF at latitude 0 and longitude 0 the x axis is up; 6378137 m is the ellipsoid's surface. */
static void a_map_in_ecef_is_level(void **state)
{
    (void)state;
    write_box("ecef.obj", 6378137);
    write_text("e.yaml", "head: {profile: sphere, step_deg: 10}\nstations: [{name: one, position_m: [6378142, 1, 2]}]\n"
                         "scene: {meshes: [{file: ecef.obj, up: z, scale: 1}], anchor: {source: ecef}}\n");
    does(&app_map, "e.yaml -o e.svg", 0);
    char *svg = contents("e.svg"), said[80];
    has(svg, "<title>one, height 5.00 m</title>");
    free(svg);
    snprintf(said, sizeof said, "scanhead: e.svg: %d points drawn, 0 outside of the area\n", SHOTS);
    assert_string_equal(on_err, said);
    does(&app_map, "e.yaml -o e.png --perspective", 2);
    assert_string_equal(on_err, "scanhead: e.yaml: scene.anchor: the z axis of a scene in ECEF is not up, but "
                                "--perspective needs that\n");
    does(&app_coverage, "e.yaml --grid 1", 2);
    has(on_err,
        "e.yaml: scene.anchor.source: ecef, where z is not up, so a grid has no floors; allowed is --candidates\n");
}

/* The room has 2 x 100 + 4 x 40 m2. A head needs 0.2 m above its origin. */
static void how_much_is_seen(void **state)
{
    (void)state;
    does(&app_coverage, "c.yaml --quiet -o cells.ply --by label", 0);
    assert_int_equal(strncmp(on_out, "surface         360.000 m2 in ", 30), 0);
    has(on_out, "          614          614\nstation-2 ");
    does(&app_coverage, "c.yaml --quiet --grid 3 --height 4.5 --at -4,-4,4,4,-1,1", 2);
    has(on_err,
        "--grid 3: no place to stand: no floor there has 4.7 m of room above it; allowed is another grid, --height "
        "or --at\n");
    /* Rays 30 degrees apart are 15, 43 and 69 degrees above the horizon. */
    write_text("l.yaml", "head: {profile: riegl-vz400i, line_start_deg: 46, line_stop_deg: 60}\n"
                         "scene: {meshes: [{file: room.obj, up: z, scale: 1}]}\nstations: [{position_m: [0, 0, 2]}]\n");
    does(&app_coverage, "l.yaml --quiet --grid 3 --step-deg 30", 2);
    has(on_err, "--step-deg 30: no ray lies within the head's field of view; allowed is a smaller step\n");
}

static void a_first_configuration(void **state)
{
    (void)state;
    does(&app_init, "room.obj -o new.yaml", 0);
    has(on_out, "scene     12 triangles, 1 surfaces, x -5.000..5.000  y -5.000..5.000  z 0.000..4.000 m\n"
                "size      10 x 10 x 4 m\nunit      1 m, assumed: the file doesn't say\naxes      z up, assumed: ");
    has(on_out, "written   new.yaml; next: scanhead record new.yaml -o scan.ply\n");
    does(&app_check, "new.yaml", 0);
    assert_int_equal(link("room.obj", "a\001b.obj"), 0);
    does(&app_init, "a\001b.obj -o second.yaml", 2);
    assert_string_equal(on_err, "scanhead: a?b.obj: its path has control characters, so no key can name it: rename "
                                "it\n");
    unlink("a\001b.obj");
    does(&app_init, "room.obj -o new.yaml", 2);
    assert_string_equal(on_err, "scanhead: new.yaml already exists; give another name with -o, or --force to replace "
                                "it\n");
    does(&app_init, "room.obj -o new.yaml --force --scale 0.001 --up y", 0);
    has(on_out, "size      0.01 x 0.004 x 0.01 m\nunit      0.001 m, ");
    assert_int_equal(link("room.obj", "a\x80.obj"), 0);
    does(&app_init, "a\x80.obj -o other.yaml", 2);
    has(on_err, "its path is not UTF-8, so YAML can't name it; allowed is UTF-8: rename it\n");
    unlink("a\x80.obj");
}

/* 50 ms of 36,000 pulses/s, all of which count while the page's observer reads, too. */
static void a_head_with_a_page(void **state)
{
    (void)state;
    run_take_page(&watch_page);
    does(&app_run, "c.yaml --pace fast --start --duration 0.05 --quiet --stats - --set links=[{type:_web}]", 2);
    write_text("w.yaml", "head: {profile: sphere, step_deg: 10}\nscene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
                         "stations: [{position_m: [0, 0, 2]}]\nlinks: [{type: web, waits: yes}]\n");
    does(&app_run, "w.yaml --pace fast --start --duration 0.05 --quiet --stats -", 0);
    count_is("fired_pulses", 1800);
    count_is("lines", 50);
    count_is("lost_pulses", 0);
    count_is("scans", 1);
    run_take_page(NULL);
}

/* `check` refuses a file of stored settings that `run` would refuse. */
static void stored_settings_are_looked_at(void **state)
{
    (void)state;
    write_text("s.txt", "scanhead settings 1\nprofile sphere\nend\n");
    does(&app_check, "c.yaml --set head.settings_file=s.txt", 0);
    write_text("s.txt", "scanhead settings 1\nprofile puck\nend\n");
    does(&app_check, "c.yaml --set head.settings_file=s.txt", 2);
    has(on_err, "s.txt: has the settings of a head of profile puck, this is sphere; name another file");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(all_formats_are_recorded_at_once),
        cmocka_unit_test(colours_have_limits_of_their_own),
        cmocka_unit_test(a_report_of_a_good_scan),
        cmocka_unit_test(maps),
        cmocka_unit_test(a_map_in_ecef_is_level),
        cmocka_unit_test(how_much_is_seen),
        cmocka_unit_test(a_first_configuration),
        cmocka_unit_test(a_head_with_a_page),
        cmocka_unit_test(stored_settings_are_looked_at),
    };
    return cmocka_run_group_tests_name("commands", tests, go_there, commands_end);
}
