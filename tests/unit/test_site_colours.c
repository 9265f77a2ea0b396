/* SPDX-License-Identifier: MIT */
/* Colours of a site's points: the limits that a ramp has where none are given, and textures that are not used. */
#include "tests/unit/site_rig.h"

#include <math.h>

#include "core/colour.h"

static struct site *site;

static int load(const char *scene, const char *more, const char *output)
{
    char text[1024];
    site_free(site);
    site = NULL;
    snprintf(text, sizeof text,
             "head: {profile: full-sweep, range_min_m: 2, range_max_m: 300}\n"
             "scene: {meshes: [{file: %s, up: z, scale: 1}]}\ncast: {sight: off}\n"
             "stations: [{position_m: [0, 0, 2]}]\n%soutput: {%s}\n",
             scene, more, output);
    write_in("test.yaml", text);
    clear_warned();
    if (config_load(config_path, NULL, 0, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    return site_load(cfg, &report, &site, &err);
}

static void expect_scale(const char *more, const char *output, enum colour_mode mode, double low, double high)
{
    write_in("room.obj", "v -50 -50 -4\nv 50 -50 -4\nv 50 50 -4\nv -50 50 11\nf 1 2 3 4\n");
    write_in("path.csv", "t_s,x_m,y_m,z_m,heading_deg,frame\n0,0,0,2,0,-3\n2,1,0,2,0,40\n4,2,0,2,0,20\n");
    if (load("room.obj", more, output) != SH_OK) fail_msg("%s", err.text);
    const struct colour_scale *scale = &site->colours.scale;
    assert_int_equal(scale->mode, mode);
    if (!(fabs(scale->low - low) < 1e-9 && fabs(scale->high - high) < 1e-9))
        fail_msg("%s: %.12g to %.12g", output, scale->low, scale->high);
    for (uint32_t i = 0; i < site->n_stations; i++) {
        const struct cast_colour *c = &site->station[i].colour;
        assert_true(c->scale.mode == mode && c->scale.low == scale->low && c->scale.high == scale->high);
        assert_true(c->frame == site->station[i].frame && c->surfaces == &site->colours.surfaces);
    }
}

#define PATH "platform: {kind: trajectory, file: path.csv}\n"

/* Without limits a ramp covers the head's ranges, the scene's heights, or the frames that the path or the stops have.
 */
static void ramps_have_limits(void **state)
{
    (void)state;
    expect_scale("", "colour: range", COLOUR_RANGE, 2, 300);
    expect_scale("", "colour: range, colour_limits: [5, 7.5]", COLOUR_RANGE, 5, 7.5);
    expect_scale("", "colour: height", COLOUR_HEIGHT, -4, 11);
    expect_scale("", "colour: height, colour_limits: [-5, 7.5]", COLOUR_HEIGHT, -5, 7.5);
    expect_scale(PATH, "colour: frame", COLOUR_FRAME, -3, 40);
    expect_scale("platform: {kind: trajectory, file: path.csv, start_s: 3}\n", "colour: frame", COLOUR_FRAME, 20, 30);
    expect_scale("platform: {kind: stops, file: path.csv, start_s: 1, step_s: 2}\n", "colour: frame", COLOUR_FRAME,
                 18.5, 30);
    expect_scale("platform: {kind: stops, frames_per_s: 1, first_frame: 7, last_frame: 9}\n", "colour: frame",
                 COLOUR_FRAME, 7, 9);
    expect_scale("", "colour: solid, colour_rgb: [1, 0, 255]", COLOUR_SOLID, 0, 0);
    assert_memory_equal(site->colours.scale.rgb, ((const uint8_t[3]){1, 0, 255}), 3);
}

static void expect_warnings(const char *const *says)
{
    char want[1024] = "";
    for (int i = 0; says[i] != NULL; i++)
        snprintf(want + strlen(want), sizeof want - strlen(want), "%s: output.colour: %s\n", config_path, says[i]);
    assert_string_equal(warned, want);
}

/* Four surfaces: one has a colour, two have none, one has colours at some of its corners. */
static void surfaces_without_colours_are_counted(void **state)
{
    (void)state;
    write_in("some.mtl", "newmtl red\nKd 1 0 0\nnewmtl none\nnewmtl part\n");
    write_in("some.obj", "mtllib some.mtl\no a\nusemtl red\nv -50 -50 0\nv 50 -50 0\nv 50 50 0\nf 1 2 3\n"
                         "o b\nusemtl none\nv -50 50 0\nv -50 -50 0\nv 50 50 0\nf 4 5 6\n"
                         "o c\nusemtl none\nf 5 4 6\n"
                         "o d\nusemtl part\nv 9 9 1 1 0 0\nv 8 9 1 0 1 0\nv 9 8 1 0 0 1\nv 7 7 1\nf 7 8 9\nf 8 9 10\n");
    if (load("some.obj", "", "colour: texture") != SH_OK) fail_msg("%s", err.text);
    expect_warnings((const char *const[]){
        "texture, but 2 of 4 surfaces have neither texture nor colour: their points are grey",
        "texture, but 1 of 4 surfaces have colours at only some of their corners: points of triangles without colours "
        "are grey",
        NULL});
    if (load("some.obj", "", "colour: range") != SH_OK) fail_msg("%s", err.text);
    assert_string_equal(warned, "");
}

/* A picture that can't be read is reported when the scene is loaded. If the scene does not need the picture (cutouts:
 * off), output.colour reports it. */
static void a_picture_that_is_none(void **state)
{
    (void)state;
    static const char *const sets[] = {"scene.cutouts=off"};
    static const char *const signals[] = {"scene.cutouts=off", "output.colour=range", "signal.model=on"};
    char want[512];
    write_in("wall.mtl", "newmtl brick\nKd 1 0 0\nmap_Kd wall.png\nnewmtl tile\nKd 0 1 0\nmap_Kd wall.png\n");
    write_in("wall.png", "no picture");
    write_in("wall.obj", "mtllib wall.mtl\nusemtl brick\nv -50 -50 0\nv 50 -50 0\nv 50 50 0\nvt 0 0\nvt 1 0\nvt 1 1\n"
                         "f 1/1 2/2 3/3\nusemtl tile\nf 3/1 2/2 1/3\n");
    if (load("wall.obj", "", "colour: texture") != SH_OK) fail_msg("%s", err.text);
    assert_non_null(strstr(warned, "can't be read"));
    assert_null(strstr(warned, "output.colour"));
    clear_warned();
    site_free(site);
    site = NULL;
    if (config_load(config_path, sets, 1, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    if (site_load(cfg, &report, &site, &err) != SH_OK) fail_msg("%s", err.text);
    snprintf(want, sizeof want,
             "%s: output.colour: 2 of 2 surfaces have a texture that is not used: their colour is "
             "used, or grey; the first: ",
             config_path);
    if (strncmp(warned, want, strlen(want)) != 0) fail_msg("%s", warned);
    assert_non_null(strstr(warned, "/wall.png: "));
    /* The signal can do without the picture as well: it uses the colour, or signal.reflectance. */
    clear_warned();
    site_free(site);
    site = NULL;
    if (config_load(config_path, signals, 3, cfg, &err) != SH_OK) fail_msg("%s", err.text);
    if (site_load(cfg, &report, &site, &err) != SH_OK) fail_msg("%s", err.text);
    snprintf(want, sizeof want,
             "%s: 2 surfaces have a texture that is not used: their colour is used, or signal.reflectance; the first: ",
             config_path);
    if (strstr(warned, want) == NULL) fail_msg("%s", warned);
}

static int teardown(void **state)
{
    site_free(site);
    return site_rig_teardown(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ramps_have_limits),
        cmocka_unit_test(surfaces_without_colours_are_counted),
        cmocka_unit_test(a_picture_that_is_none),
    };
    return cmocka_run_group_tests_name("colours of a site", tests, site_rig_setup, teardown);
}
