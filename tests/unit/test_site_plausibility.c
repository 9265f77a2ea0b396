/* SPDX-License-Identifier: MIT */
/* Settings that are allowed and hardly meant give one warning, with figures; usual ones give none. Run from the top of
 * the source tree. */
#include "firmware_sim/config/load.h"
#include "tests/unit/site_rig.h"

#include <glob.h>

/* A closed box: 60 x 60 m about the origin, from z0 to z1. */
static void write_box(double z0, double z1)
{
    char text[1024];
    size_t used = 0;
    for (int i = 0; i < 8; i++)
        used += (size_t)snprintf(text + used, sizeof text - used, "v %d %d %g\n", i & 1 ? 30 : -30, i & 2 ? 30 : -30,
                                 i & 4 ? z1 : z0);
    snprintf(text + used, sizeof text - used, "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n");
    write_in("mesh.obj", text);
}

/* Two slow parts are left out, which do not matter here: the search for a beam, and IFC's other readers. */
static void load_file(const char *path)
{
    static const char *const sets[] = {"beam.mode=single", "scene.ifc_reader=assimp"};
    struct site *site = NULL;
    clear_warned();
    int rc = config_load(path, sets, 2, cfg, &err);
    if (rc == SH_OK) rc = site_load(cfg, &report, &site, &err);
    if (rc != SH_OK) fail_msg("%s", err.text);
    site_free(site);
}

/* more: further sections; head: further keys of the head. */
static void load(const char *position, double scale, const char *head, const char *more)
{
    char text[1024];
    snprintf(text, sizeof text,
             "head: {profile: any-rate, prr_hz: 600000, lines_hz: 100%s}\n"
             "scene:\n  meshes: [{file: mesh.obj, up: z, scale: %g}]\nstations:\n  - {position_m: [%s]}\n%s\n",
             head, scale, position, more);
    write_in("test.yaml", text);
    load_file(config_path);
}

static void says(const char *text)
{
    if (strstr(warned, text) == NULL) fail_msg("\"%s\" is missing in:\n%s", text, warned);
}

static void says_nothing(void)
{
    assert_string_equal(warned, "");
}

static void a_usual_scene_is_silent(void **state)
{
    (void)state;
    write_box(0, 10);
    load("0, 0, 1.7", 1, "", "");
    says_nothing();
}

static void out_of_reach(void **state)
{
    (void)state;
    write_box(-0.2, 0);
    load("0, 0, 790", 1, "", ""); /* the face is 790 m below, within the range of 800 m */
    assert_null(strstr(warned, "no surface within"));
    load("0, 0, 801", 1, "", "");
    says("station 1 station-1 at 0 0 801 m: no surface within range_max_m, 800 m");
    load("600, 600, 1", 1, "", ""); /* 570 m off in x and in y: 806 m */
    says("no surface within");
}

/* The second copy is 120 m wide: its edge is at x = -2940. */
static void copies_out_of_reach(void **state)
{
    (void)state;
    char text[512];
    write_box(-0.2, 0);
    for (int x = -2141; x <= -2139; x += 2) { /* 799 m and 801 m from that edge */
        snprintf(text, sizeof text,
                 "head: {profile: any-rate, prr_hz: 600000, lines_hz: 100}\n"
                 "scene:\n  meshes:\n    - {file: mesh.obj, up: z, scale: 1,\n"
                 "       copies: [{offset_m: [3000, 0, 0]}, {offset_m: [-3000, 0, 0], scale: 2}]}\n"
                 "stations:\n  - {position_m: [%d, 0, 0]}\n",
                 x);
        write_in("test.yaml", text);
        load_file(config_path);
        if ((strstr(warned, "no surface within") != NULL) != (x > -2140)) fail_msg("at %d m:\n%s", x, warned);
    }
}

static void under_the_floor(void **state)
{
    (void)state;
    write_box(0, 10);
    load("0, 0, -2", 1, "", "");
    says("no surface below it, but one 2 m above it: it may be under the floor");
}

/* Stations after the first one are checked, too. */
static void each_station_is_checked(void **state)
{
    (void)state;
    write_box(0, 10);
    load("0, 0, 1.7]}\n  - {position_m: [0, 0, -2]}\n  - {position_m: [0, 0, 900", 1, "", "");
    says("station 2 station-2 at 0 0 -2 m: no surface below it");
    says("station 3 station-3 at 0 0 900 m: no surface within range_max_m, 800 m");
    assert_null(strstr(warned, "station 1 "));
}

/* The head is in a slab of 20 cm. Except along the slab, all is nearer than the head's least range, 1.5 m. */
static void within_a_slab(void **state)
{
    (void)state;
    write_box(-0.2, 0);
    load("0, 0, -0.1", 1, "", "");
    says("hit something nearer than range_min_m, 1.5 m: the station may be inside an object");
}

/* The head is 0.1 m from two walls and 5 m below the roof. Three quarters of its directions go to a wall. */
static void in_a_corner(void **state)
{
    (void)state;
    write_box(0, 10);
    load("29.9, -29.9, 5", 1, "", "");
    says("hit something nearer than range_min_m, 1.5 m: the station may be inside an object");
    load("29.9, -5, 5", 1, "", ""); /* one wall is less than half of them */
    says_nothing();
}

/* A mesh that moves may fill the view and be the floor, so that only the reach is checked. */
static void beside_a_mesh_that_moves(void **state)
{
    (void)state;
    static const char *const roofs[] = {"", "    - {file: mesh.obj, up: z, scale: 0.1, move_m_s: [0, 0, 1]}\n"};
    write_box(0, 10);
    for (int moves = 0; moves < 2; moves++)
        for (int far = 0; far < 2; far++) {
            char text[512];
            snprintf(text, sizeof text,
                     "head: {profile: any-rate, prr_hz: 600000, lines_hz: 100}\n"
                     "scene:\n  meshes:\n    - {file: mesh.obj, up: z, scale: 1}\n%s"
                     "stations: [{position_m: [0, 0, %d]}]\n",
                     roofs[moves], far ? -900 : -2);
            write_in("test.yaml", text);
            load_file(config_path);
            assert_int_equal(strstr(warned, "it may be under the floor") != NULL, !moves);
            assert_int_equal(strstr(warned, "no surface within range_max_m, 800 m") != NULL, far);
        }
}

/* A planar head looks along its plane alone. Over a slab it sees nothing, where another head sees the slab. In a room
 * whose walls are 30 m away all that it sees is beyond its 20 m. */
static void a_planar_head_sees_only_its_plane(void **state)
{
    (void)state;
    static const double ROOF_M[] = {0.0, 10.0};
    for (int in_room = 0; in_room < 2; in_room++) {
        write_box(-0.2, ROOF_M[in_room]);
        load("0, 0, 1.7", 1, "", "");
        says_nothing();
        write_in("test.yaml", "head: {profile: sick-lms111}\nscene: {meshes: [{file: mesh.obj, up: z, scale: 1}]}\n"
                              "stations: [{position_m: [0, 0, 1.7]}]\n");
        load_file(config_path);
        says(
            in_room
                ? "of 1024 directions 0 hit something from 0.5 to 20 m away, 0 something nearer, 1024 something farther"
                : "of 1024 directions 0 hit something from 0.5 to 20 m away, 0 something nearer, 0 something farther");
    }
}

/* The head is 300 m beside a slab of 20 cm, which it sees under 0.04 degrees. */
static void a_scan_that_is_mostly_empty(void **state)
{
    (void)state;
    write_box(-0.2, 0);
    load("0, 330, 1.7", 1, "", "");
    says("the scan is mostly empty: of 1024 directions 0 hit something from 1.5 to 800 m away");
}

static void a_scale_that_is_a_thousand_times_off(void **state)
{
    (void)state;
    write_box(0, 10);
    load("0, 0, 5000", 1000, "", "");
    says("the scene is 6e+04 m large");
    says("check scene.meshes[].scale");
    write_box(0, 10);
    load("0, 0, 1", 0.0001, "", "");
    says("the scene is 0.006 m large");
}

/* Pulses are 240 deg * 100 / 600,000 = 0.04 deg apart. */
static void a_window_between_two_pulses(void **state)
{
    (void)state;
    write_box(0, 10);
    load("0, 0, 1.7", 1, ", pan_deg_s: 100, line_start_deg: 0.001, line_stop_deg: 0.03", "");
    says("360 of 360 lines cast no pulse: the window is 0.029 deg wide, and pulses are 0.04 deg apart (head.prr_hz, "
         "lines_hz)\n");
    load("0, 0, 1.7", 1, ", pan_deg_s: 100, line_start_deg: 0.001, line_stop_deg: 0.041", "");
    says_nothing();
    write_in("test.yaml",
             "head: {profile: sphere, step_deg: 1, line_start_deg: 0.2, line_stop_deg: 0.7}\n"
             "scene: {meshes: [{file: mesh.obj, up: z, scale: 1}]}\nstations: [{position_m: [0, 0, 1.7]}]\n");
    load_file(config_path);
    says("the window is 0.5 deg wide, and pulses are 1 deg apart (head.step_deg)\n");
    /* A planar head fires at angles of its own: no key changes them. */
    write_in("test.yaml",
             "head: {profile: sick-lms111, line_start_deg: 0.1, line_stop_deg: 0.2}\n"
             "scene: {meshes: [{file: mesh.obj, up: z, scale: 1}]}\nstations: [{position_m: [0, 0, 1.7]}]\n");
    load_file(config_path);
    says("lines cast no pulse: the window is 0.1 deg wide, and pulses are 0.5 deg apart\n");
}

static void attributes_that_nothing_fills(void **state)
{
    (void)state;
    write_box(0, 10);
    load("0, 0, 1.7", 1, "", "output: {attributes: on}");
    says("output.attributes: on, but signal.model is off: no echo has an amplitude");
    says("each has the pulse's width");
    load("0, 0, 1.7", 1, "", "output: {attributes: on}\nsignal: {model: on}\nsurfaces: [{reflectance: 0.3}]");
    says_nothing();
}

static void fields_that_no_link_speaks_of(void **state)
{
    (void)state;
#define FIELD "fields: [{number: 1, shape: segment, angles_deg: [0, 90], radii_m: [0, 1]}]"
    write_box(0, 10);
    load("0, 0, 1.7", 1, "", FIELD);
    says("fields: no link has protocol: cola, so nothing evaluates them");
    load("0, 0, 1.7", 1, "", "links: [{type: tcp}]\ninputs: [{input: 1}]");
    says("inputs: no link has protocol: cola, so nothing evaluates them");
    write_in("test.yaml",
             "head: {profile: sick-tim781}\nscene:\n  meshes: [{file: mesh.obj, up: z, scale: 1}]\n"
             "stations:\n  - {position_m: [0, 0, 1.7]}\nlinks: [{type: tcp, protocol: cola}]\n" FIELD "\n");
    load_file(config_path);
    assert_null(strstr(warned, "fields"));
}

#ifndef SH_SANITIZE /* the house is large, and loading it has a test of its own */
/* config/README.md calls these configurations ready to run. */
static void configurations_of_this_tree_are_silent(void **state)
{
    (void)state;
    glob_t found;
    assert_int_equal(glob("config/*.yaml", 0, NULL, &found), 0);
    for (size_t i = 0; i < found.gl_pathc; i++) {
        struct sh_err why;
        if (config_load(found.gl_pathv[i], NULL, 0, cfg, &why) != SH_OK) {
            print_message("%s is left out: %s\n", found.gl_pathv[i], why.text); /* the house is not installed */
            continue;
        }
        load_file(found.gl_pathv[i]);
        if (strstr(warned, "station ") != NULL || strstr(warned, "scale") != NULL ||
            strstr(warned, "lines cast") != NULL)
            fail_msg("%s: %s", found.gl_pathv[i], warned);
    }
    globfree(&found);
}
#endif

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_usual_scene_is_silent),
        cmocka_unit_test(out_of_reach),
        cmocka_unit_test(copies_out_of_reach),
        cmocka_unit_test(under_the_floor),
        cmocka_unit_test(each_station_is_checked),
        cmocka_unit_test(within_a_slab),
        cmocka_unit_test(in_a_corner),
        cmocka_unit_test(beside_a_mesh_that_moves),
        cmocka_unit_test(a_planar_head_sees_only_its_plane),
        cmocka_unit_test(a_scan_that_is_mostly_empty),
        cmocka_unit_test(a_scale_that_is_a_thousand_times_off),
        cmocka_unit_test(a_window_between_two_pulses),
        cmocka_unit_test(attributes_that_nothing_fills),
        cmocka_unit_test(fields_that_no_link_speaks_of),
#ifndef SH_SANITIZE
        cmocka_unit_test(configurations_of_this_tree_are_silent),
#endif
    };
    return cmocka_run_group_tests(tests, site_rig_setup, site_rig_teardown);
}
