/* SPDX-License-Identifier: MIT */
/* `scanhead map` in this process: what is refused, what --quiet leaves out, and one picture from a scan and from its
 * recording. */
#include "firmware_sim/app/studio/map/field_lines.h"
#include "firmware_sim/config/config.h"
#include "firmware_sim/site/placement.h"
#include "tests/unit/commands_rig.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

static int go_there(void **state)
{
    (void)state;
    if (commands_begin() != 0) return -1;
    write_text("floor.obj", "o floor\nv -9 -9 0\nv 9 -9 0\nv 9 9 0\nv -9 9 0\nf 1 2 3 4\n");
    write_text("c.yaml",
               "head: {profile: sphere, step_deg: 10}\nscene: {meshes: [{file: floor.obj, up: z, scale: 1}]}\n"
               "stations: [{position_m: [0, 0, 2]}, {position_m: [1, 3, 2]}]\noutput: {crs: local, layout: geo}\n");
    does(&app_record, "c.yaml --station all -o c.ply --quiet", 0);
    return 0;
}

/* Writes a cloud of one point, or of a shot without echo, in a frame; epsg 0: that of the scene. */
static void write_cloud(const char *name, int epsg, const char *row)
{
    char text[300];
    snprintf(text, sizeof text,
             "ply\nformat ascii 1.0\ncomment epsg %d\nelement vertex %d\nproperty double x\nproperty double y\n"
             "property double z\nend_header\n%s",
             epsg, row[0] != '\0', row);
    write_text(name, text);
}

static void what_is_refused(void **state)
{
    static const struct {
        const char *words, *said;
    } rows[] = {
        {"xyz.ply --colour range", "xyz.ply: its points have no range for --colour"},
        {"xyz.ply --colour reflectance", "xyz.ply: its points have no reflectance for --colour"},
        {"xyz.ply --colour label", "xyz.ply: its points have no label for --colour"},
        {"xyz.ply --colour station", "xyz.ply: its points have no station for --colour"},
        {"xyz.ply --colour rgb", "xyz.ply: its points have no red, green and blue for --colour"},
        {"empty.ply", "empty.ply: there are no points in it"},
        {"shot.ply", "shot.ply: it has no points, only 1 shots without echo"},
        {"ecef.ply", "ecef.ply: the z axis of points in ECEF is not up: use scanhead map CONFIG --perspective --cloud "
                     "ecef.ply"},
        {"degrees.ply", "degrees.ply: the z axis of points in degrees is not up: use scanhead map CONFIG --perspective "
                        "--cloud degrees.ply"},
        {"c.yaml --colour rgb", "--colour rgb: the scan has no colours; set output.colour, as with --set "
                                "output.colour=texture"},
        {"c.yaml --colour reflectance",
         "--colour reflectance: no point has one; --set signal.model=on gives them one in "
         "a scan"},
    };
    (void)state;
    write_cloud("xyz.ply", 0, "1 2 3\n");
    write_cloud("empty.ply", 0, "");
    write_cloud("shot.ply", 0, "nan nan nan\n");
    write_cloud("ecef.ply", 4978, "6378137 0 0\n");
    write_cloud("degrees.ply", 4979, "52 15 40\n");
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char words[200], want[256];
        snprintf(words, sizeof words, "%s --perspective -o m.png --size 60x40", rows[i].words);
        snprintf(want, sizeof want, "scanhead: %s\n", rows[i].said);
        does(&app_map, words, 2);
        assert_string_equal(on_err, want);
        assert_int_not_equal(access("m.png", F_OK), 0);
    }
}

/* All 614 shots of each station are behind an eye that looks up, or have no echo. */
static void nothing_is_seen(void **state)
{
    (void)state;
    static const char said[] = "scanhead: m.png: no point is in the picture: %u are outside of it or behind the eye, "
                               "--below and --above leave out %u, and %u shots have no echo\n";
    unsigned beyond, cut, empty;
    char want[256];
    for (int below = 0; below < 2; below++) {
        does(&app_map,
             below ? "c.yaml --perspective -o m.png --size 60x40 --below -1"
                   : "c.yaml --perspective -o m.png --size 60x40 --eye 0,0,50 --look-at 0,0,99",
             2);
        assert_int_equal(sscanf(on_err, said, &beyond, &cut, &empty), 3);
        snprintf(want, sizeof want, said, beyond, cut, empty);
        assert_string_equal(on_err, want);
        assert_int_equal(beyond + cut + empty, 2 * (17 * 36 + 2));
        assert_true(empty > 600 && (below ? beyond : cut) == 0);
    }
}

static void options_that_do_not_fit(void **state)
{
    static const struct {
        const char *words, *said;
    } rows[] = {
        {"c.yaml", "-o FILE.png or -o FILE.svg is needed"},
        {"c.yaml -o m.pdf", "-o m.pdf: allowed are names that end in .png or .svg"},
        {"c.ply -o m.png", "c.ply is a point cloud; a map from above scans a CONFIG: add --perspective"},
        {"c.yaml -o m.svg --shade 0.5", "options of the eye, sizes, colours and clouds need --perspective; "},
        {"c.yaml -o m.svg --perspective", "-o m.svg: with --perspective it is an image; allowed is a name that ends in "
                                          ".png"},
        {"c.yaml -o m.png --perspective --open-edges", "--open-edges: allowed for a map from above, not with "
                                                       "--perspective"},
        {"c.yaml -o m.png --perspective --pixel-m 1",
         "--pixel-m: allowed for a map from above, not with --perspective"},
        {"c.ply -o m.png --perspective --cloud c.ply", "c.ply and --cloud c.ply: one cloud is shown at a time"},
        {"c.ply -o m.png --perspective --set head.prr_hz=1", "--set: c.ply is not a configuration; allowed with a "
                                                             "CONFIG"},
        {"c.yaml -o m.png --perspective --colour none", "--colour none: allowed are height, range, "},
    };
    (void)state;
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        does(&app_map, rows[i].words, 2);
        has(on_err, rows[i].said);
        assert_ptr_equal(strchr(on_err, '\n'), on_err + strlen(on_err) - 1); /* one line */
    }
}

static size_t read_bytes(const char *name, char *to, size_t cap)
{
    FILE *in = fopen(name, "rb");
    assert_non_null(in);
    const size_t n = fread(to, 1, cap, in);
    fclose(in);
    assert_true(n > 100 && n < cap);
    return n;
}

/* A stream and a file of doubles have the same points here, so even the bytes of the pictures agree. */
static void a_scan_and_its_recording_are_one_picture(void **state)
{
    (void)state;
    static char one[1 << 16], other[1 << 16];
    static const char *const words[] = {"-o a.png", "--cloud c.ply -o b.png"};
    for (int i = 0; i < 2; i++) {
        char line[200];
        snprintf(
            line, sizeof line,
            "c.yaml --perspective --quiet --size 120x90 --eye 0,-20,15 --look-at 0,0,0 --point-m 0.3 --colour station "
            "%s",
            words[i]);
        does(&app_map, line, 0);
        assert_string_equal(on_err, "");
    }
    const size_t n = read_bytes("a.png", one, sizeof one);
    assert_int_equal(read_bytes("b.png", other, sizeof other), n);
    assert_memory_equal(one, other, n);
}

/* A ring of 288 shots is one stream frame, whose points are taken in parts of up to 256. In a closed room each shot of
 * the 143 rings and the two poles is a point. */
static void long_frames_are_drawn_whole(void **state)
{
    (void)state;
    write_text("room.obj", "v -5 -5 0\nv 5 -5 0\nv 5 5 0\nv -5 5 0\nv -5 -5 4\nv 5 -5 4\nv 5 5 4\nv -5 5 4\n"
                           "f 1 2 3 4\nf 5 8 7 6\nf 1 5 6 2\nf 2 6 7 3\nf 3 7 8 4\nf 4 8 5 1\n");
    write_text("r.yaml",
               "head: {profile: sphere, step_deg: 1.25}\nscene: {meshes: [{file: room.obj, up: z, scale: 1}]}\n"
               "stations: [{position_m: [0, 0, 2]}]\noutput: {crs: local}\n");
    does(&app_map, "r.yaml -o m.svg --pixel-m 0.1", 0);
    assert_string_equal(on_err, "scanhead: m.svg: 41186 points drawn, 0 outside of the area\n");
}

/* Finds where the mark of a station is: pixels to the right and down. */
static void mark_of(const char *svg, const char *name, double at[2])
{
    char title[64];
    snprintf(title, sizeof title, "<title>%s, ", name);
    const char *mark = strstr(svg, title);
    if (mark == NULL || (mark = strstr(mark, "<line x1=")) == NULL) fail_msg("no mark of %s", name);
    assert_int_equal(sscanf(mark, "<line x1=\"%lf\" y1=\"%lf\"", &at[0], &at[1]), 2);
}

/* In ECEF at latitude 0 and longitude 0 the y axis is east and the z axis is north. Pixels are 1 cm, and places are
 * written in hundredths of a pixel. In 3 m the Earth curves by less than that. */
static void a_scene_in_ecef_is_drawn_north_up(void **state)
{
    (void)state;
    double one[2], two[2];
    write_text("ecef.obj", "v 6378137 -9 -9\nv 6378137 9 -9\nv 6378137 9 9\nv 6378137 -9 9\nf 1 2 3 4\n");
    write_text("e.yaml", "head: {profile: sphere, step_deg: 10}\nstations: [{name: one, position_m: [6378139, 1, 2]}, "
                         "{name: two, position_m: [6378139, 2.5, 5]}]\n"
                         "scene: {meshes: [{file: ecef.obj, up: z, scale: 1}], anchor: {source: ecef}}\n");
    does(&app_map, "e.yaml -o e.svg --pixel-m 0.01 --quiet", 0);
    char *svg = contents("e.svg");
    mark_of(svg, "one", one);
    mark_of(svg, "two", two);
    if (fabs(two[0] - one[0] - 150) > 0.03 || fabs(one[1] - two[1] - 300) > 0.03)
        fail_msg("%g %g and %g %g", one[0], one[1], two[0], two[1]);
    free(svg);
}

static void quiet_is_quiet(void **state)
{
    (void)state;
    does(&app_map, "c.yaml --quiet --open-edges -o m.svg", 0);
    assert_string_equal(on_err, "");
    assert_string_equal(on_out, "");
    char *loud = contents("m.svg");
    does(&app_map, "c.yaml --open-edges -o m.svg", 0);
    char *again = contents("m.svg");
    assert_string_equal(loud, again);
    has(on_err, "scanhead: 4 open edges drawn\n");
    free(loud);
    free(again);
}

struct lines {
    double a[4][3], b[4][3];
    int n, stop_at;
};

static int keep_line(void *ctx, const double a[3], const double b[3], struct sh_err *error)
{
    struct lines *lines = ctx;
    assert_true(lines->n < 4);
    memcpy(lines->a[lines->n], a, sizeof lines->a[0]);
    memcpy(lines->b[lines->n], b, sizeof lines->b[0]);
    return ++lines->n == lines->stop_at ? sh_fail(error, SH_ENOMEM, "full") : SH_OK;
}

/* The head is at (10, 20, 3). Its x axis is the scene's y, and its y axis the scene's z. So a corner (x, y) is at
 * (10, 20 + x, 3 + y). A triangle has three lines, each from a corner to the next one, and the last one back. */
static void fields_are_lines_at_the_station(void **state)
{
    static const struct placement at = {.position_m = {10, 20, 3}, .rotation = {0, 0, 1, 1, 0, 0, 0, 1, 0}};
    static const double corner_m[3][2] = {{1, 0.5}, {4, 0.5}, {1, 2.5}};
    struct config *cfg = calloc(1, sizeof *cfg);
    struct lines lines = {0};
    struct sh_err err = {0};
    (void)state;
    assert_non_null(cfg);
    cfg->n_fields = 2; /* the second one has no corner */
    cfg->field[0].shape = cfg->field[1].shape = FIELD_POLYGON;
    cfg->field[0].points_m.n = 3;
    memcpy(cfg->field[0].points_m.at, corner_m, sizeof corner_m);
    assert_int_equal(field_lines_each(cfg, &at, keep_line, &lines, &err), SH_OK);
    assert_int_equal(lines.n, 3);
    for (int i = 0; i < 3; i++) {
        const double *a = corner_m[i], *b = corner_m[(i + 1) % 3];
        assert_true(lines.a[i][0] == 10 && lines.b[i][0] == 10);
        assert_true(fabs(lines.a[i][1] - 20 - a[0]) < 1e-9 && fabs(lines.a[i][2] - 3 - a[1]) < 1e-9);
        assert_true(fabs(lines.b[i][1] - 20 - b[0]) < 1e-9 && fabs(lines.b[i][2] - 3 - b[1]) < 1e-9);
    }
    cfg->field[1] = cfg->field[0];
    lines = (struct lines){.stop_at = 2};
    assert_int_equal(field_lines_each(cfg, &at, keep_line, &lines, &err), SH_ENOMEM);
    assert_int_equal(lines.n, 2);
    free(cfg);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(fields_are_lines_at_the_station),
        cmocka_unit_test(what_is_refused),
        cmocka_unit_test(nothing_is_seen),
        cmocka_unit_test(options_that_do_not_fit),
        cmocka_unit_test(a_scan_and_its_recording_are_one_picture),
        cmocka_unit_test(long_frames_are_drawn_whole),
        cmocka_unit_test(a_scene_in_ecef_is_drawn_north_up),
        cmocka_unit_test(quiet_is_quiet),
    };
    return cmocka_run_group_tests_name("map commands", tests, go_there, commands_end);
}
