/* SPDX-License-Identifier: MIT */
/* The first configuration of `scanhead init`: the scan that it chooses, worked out by hand here, and its text. */
#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>
#include <yaml.h>

#include "firmware_sim/app/studio/init/text.h"
#include "firmware_sim/config/escape.h"
#include "firmware_sim/config/profile.h"

#define DEG   (M_PI / 180.0)
#define MICRO INT64_C(1000000)

/* A line takes 2 x 360 / 7 = 102.857 degrees of the beam. The pan reaches 36 degrees, the lines 100. */
static struct config_profile a_profile(void)
{
    return (struct config_profile){.name = "some",
                                   .prr_min_uhz = 1000 * MICRO,
                                   .prr_max_uhz = 1000000 * MICRO,
                                   .lines_min_uhz = 10 * MICRO,
                                   .lines_max_uhz = 250 * MICRO,
                                   .pan_max_udeg_s = 40400000,
                                   .fov_min_udeg = -40 * MICRO,
                                   .fov_max_udeg = 60 * MICRO,
                                   .pan_min_udeg = 4 * MICRO,
                                   .pan_max_udeg = 40 * MICRO,
                                   .facets = 7,
                                   .optical_gain = 2.0,
                                   .range_min_m = 0.5,
                                   .range_max_m = 120.0};
}

static void near(const char *what, double found, double by_hand)
{
    if (fabs(found - by_hand) > 1e-9 * fabs(by_hand)) fail_msg("%s is %.12g, not %.12g", what, found, by_hand);
}

static void expect_rates(const struct config_profile *p, double prr_hz, double lines_hz, double pan_deg_s)
{
    const struct viewpoint at = {.kind = VIEWPOINT_INSIDE};
    struct init_scan scan;
    init_choose_scan(p, &at, &scan);
    near("step", scan.step_deg, 0.15); /* 36 x 100 / 0.15^2 = 160,000 pulses; at 0.1 they would be 360,000 */
    near("rate", scan.prr_hz, prr_hz);
    near("lines", scan.lines_hz, lines_hz);
    near("pan", scan.pan_deg_s, pan_deg_s);
    near("duration", scan.duration_s, 36.0 / pan_deg_s);
    assert_true(scan.pan_stop_deg == 40.0 && scan.line_start_deg == -40.0 && scan.line_stop_deg == 60.0);
}

/* Steps along and across the lines are alike, within each limit of the profile. */
static void rates(void **state)
{
    struct config_profile p = a_profile();
    (void)state;
    expect_rates(&p, 138000, 200, 30); /* 200 x 102.857 / 0.15 = 137,143, whole thousands up */
    p.pan_max_udeg_s = 20200000;       /* 20.2 / 0.15 = 134.67 */
    expect_rates(&p, 92000, 134, 20.1);
    p.lines_min_uhz = 150 * MICRO; /* the pan is at its limit then */
    expect_rates(&p, 103000, 150, 20.2);
    p = a_profile();
    p.lines_max_uhz = 100 * MICRO;
    expect_rates(&p, 69000, 100, 15);
    p = a_profile();
    p.prr_max_uhz = 80000 * MICRO;
    expect_rates(&p, 80000, 200, 30);
    p.prr_max_uhz = 1000000 * MICRO;
    p.prr_min_uhz = 500000 * MICRO;
    expect_rates(&p, 500000, 200, 30);
    /* With fixed rates it is the next one below, and 100,000 x 0.15 / 102.857 = 145.8 lines go with it. */
    p = a_profile();
    p.n_programs = 3;
    p.program[0].prr_uhz = 50000 * MICRO;
    p.program[1].prr_uhz = 100000 * MICRO;
    p.program[2].prr_uhz = 300000 * MICRO;
    expect_rates(&p, 100000, 145, 21.75);
}

/* A view of so many square degrees has at most 200,000 pulses with this step, and more with the one before. The limits
 * of 0.02 to 0.3 degrees are 80, 180, 500, 980, 2000, 4500, 8000 and 18000. */
static void steps(void **state)
{
    static const struct {
        int area_deg2;
        double step_deg;
    } row[] = {{79, 0.02},  {81, 0.03},  {179, 0.03},  {181, 0.05},  {499, 0.05},  {501, 0.07},
               {979, 0.07}, {981, 0.1},  {1999, 0.1},  {2001, 0.15}, {4499, 0.15}, {4501, 0.2},
               {7999, 0.2}, {8001, 0.3}, {17999, 0.3}, {18001, 0.5}, {99999, 0.5}};
    const struct viewpoint at = {.kind = VIEWPOINT_GROUND};
    struct init_scan scan;
    (void)state;
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct config_profile p = a_profile();
        p.fov_min_udeg = 0;
        p.fov_max_udeg = MICRO;
        p.pan_min_udeg = 0;
        p.pan_max_udeg = row[i].area_deg2 * MICRO;
        init_choose_scan(&p, &at, &scan);
        if (scan.step_deg != row[i].step_deg) fail_msg("%d deg2: a step of %g", row[i].area_deg2, scan.step_deg);
    }
}

/* From outside the windows hold the mesh, to a tenth of a degree outwards. */
static struct viewpoint outside(void)
{
    return (struct viewpoint){.kind = VIEWPOINT_OUTSIDE,
                              .position_m = {1.5, 2.5, 3.5},
                              .seen = 0.42,
                              .heading_rad = -33.33 * DEG,
                              .pan_rad = 12.34 * DEG,
                              .line0_rad = -20.26 * DEG,
                              .line1_rad = 30.11 * DEG};
}

static void windows(void **state)
{
    const struct config_profile p = a_profile();
    struct viewpoint at = outside();
    struct init_scan scan;
    (void)state;
    init_choose_scan(&p, &at, &scan);
    near("pan", scan.pan_stop_deg, 4 + 12.4);
    near("first line angle", scan.line_start_deg, -20.3);
    near("last line angle", scan.line_stop_deg, 30.2);
    near("step", scan.step_deg, 0.07); /* 12.4 x 50.5 = 626 square degrees */
    near("duration", scan.duration_s, 12.4 / (200 * 0.07));
    at.pan_rad = 100 * DEG;
    at.line0_rad = -55 * DEG;
    at.line1_rad = 77 * DEG;
    init_choose_scan(&p, &at, &scan);
    assert_true(scan.pan_stop_deg == 40.0 && scan.line_start_deg == -40.0 && scan.line_stop_deg == 60.0);
}

/* ---- text */

static void expect_text(struct init_text *t, const char *head_end, const char *crs, const char *where, const char *link)
{
    char expected[2048], *text;
    size_t len;
    FILE *out = open_memstream(&text, &len);
    init_choose_scan(t->profile, t->at, &t->scan);
    init_write_text(t, out);
    fclose(out);
    snprintf(expected, sizeof expected,
             "# shown.obj: 4 x 5 x 6 m, 7 triangles. Change what does not fit.\n"
             "head:\n  profile: some # sees from 0.5 to 120 m; `scanhead list` shows others\n"
             "  prr_hz: %s"
             "scene:\n  meshes:\n    - file: \"a\\\"b\\\\c\\x0a.obj\"\n      up: %s # as it is\n"
             "      scale: 0.001 # metres per unit; by its size\n%s"
             "stations:\n  # %s\nlinks: # for `scanhead run`; recording off line needs none\n  - {type: pty%s}\n",
             head_end, t->mesh->up == SCENE_UP_Y ? "y" : "z", crs, where, link);
    assert_string_equal(text, expected);
    free(text);
}

static void texts(void **state)
{
    const struct config_profile p = a_profile();
    struct scene scene = {.n_triangles = 7, .min_m = {1, 2, 3}, .max_m = {5, 7, 9}};
    struct init_mesh mesh = {.up = SCENE_UP_Y, .scale = 0.001, .up_from = "as it is", .scale_from = "by its size"};
    struct viewpoint at = outside();
    struct init_text t = {.mesh_name = "shown.obj",
                          .mesh_path = "a\"b\\c\n.obj",
                          .link_name = "port",
                          .scene = &scene,
                          .mesh = &mesh,
                          .profile = &p,
                          .at = &at};
    (void)state;
    expect_text(&t,
                "294000 # a coarse scan of 0.89 s, a line every 0.07 deg; higher rates and a slower pan make it finer\n"
                "  lines_hz: 200\n  pan_deg_s: 14\n  pan_stop_deg: 16.4 # only the part of the view that holds the "
                "mesh\n  line_start_deg: -20.3\n  line_stop_deg: 30.2\n",
                "",
                "outside, facing the mesh; 42 % of the view hits something\n"
                "  - {name: outside, position_m: [1.5000, 2.5000, 3.5000], heading_deg: 326.6}",
                ", path: \"port\"");
    mesh.up = SCENE_UP_Z;
    strcpy(mesh.crs, "EPSG:32633");
    t.link_name = NULL;
    at.floor_m = 1.75;
    at.heading_rad = 0.0;
    at.kind = VIEWPOINT_INSIDE;
    static const char whole[] = "138000 # a coarse scan of 1.2 s, a line every 0.15 deg; higher rates and a slower pan "
                                "make it finer\n  lines_hz: 200\n  pan_deg_s: 30\n";
    static const char anchor[] =
        "  anchor: {source: geotiff} # EPSG:32633; height_m: height of the raster's 0 above the ellipsoid\n";
    expect_text(&t, whole, anchor,
                "inside, 1.75 m above a floor; 42 % of the view hits something\n"
                "  - {name: inside, position_m: [1.5000, 2.5000, 3.5000], heading_deg: 0}",
                "");
    struct scene_surface surface[] = {{.material = "pane", .clear = 0.75f},
                                      {.object = "wall", .material = "stone"},
                                      {.object = "lamp", .clear = 0.5f}};
    scene.surface = surface;
    scene.n_surfaces = 3;
    mesh.crs[0] = '\0';
    at.kind = VIEWPOINT_GROUND;
    expect_text(&t, whole,
                "# The file calls these transparent. To make them glass, remove the # below:\n"
                "# surfaces: [{material: \"pane\", glass: 0.75}, {object: \"lamp\", glass: 0.5}]\n",
                "on open ground, 1.75 m above it; 42 % of the view hits something\n"
                "  - {name: ground, position_m: [1.5000, 2.5000, 3.5000], heading_deg: 0}",
                "");
}

static size_t put_utf8(uint32_t c, char *out)
{
    if (c < 0x80) return (size_t)sprintf(out, "%c", (int)c);
    if (c < 0x800) return (size_t)sprintf(out, "%c%c", (int)(0xc0 | c >> 6), (int)(0x80 | (c & 63)));
    return (size_t)sprintf(out, "%c%c%c", (int)(0xe0 | c >> 12), (int)(0x80 | (c >> 6 & 63)), (int)(0x80 | (c & 63)));
}

/* YAML reads each character of a name back, and the comment that begins the file ends at its own line's end. The
 * characters are those below U+3000 and those from U+F000 on, the byte order mark and two without a meaning among
 * them. */
static void names_are_read_back(void **state)
{
    (void)state;
    for (uint32_t c = 1; c <= 0xffff; c = c == 0x2fff ? 0xf000 : c + 1) {
        char name[16] = "a", text[64], *to = text;
        put_utf8(c, name + 1);
        strcat(name, "b");
        to += sprintf(to, "# ");
        for (int pass = 0; pass < 2; pass++) {
            for (const char *p = name; *p != '\0'; to += strlen(to))
                p += config_escape(p, to);
            to += sprintf(to, pass == 0 ? "\n\"" : "\"");
        }
        yaml_parser_t parser;
        yaml_document_t document;
        assert_int_equal(yaml_parser_initialize(&parser), 1);
        yaml_parser_set_input_string(&parser, (const unsigned char *)text, strlen(text));
        if (!yaml_parser_load(&parser, &document)) fail_msg("U+%04x: %s: %s", c, text, parser.problem);
        const yaml_node_t *node = yaml_document_get_root_node(&document);
        if (node == NULL || node->type != YAML_SCALAR_NODE || strcmp((char *)node->data.scalar.value, name) != 0)
            fail_msg("U+%04x: %s", c, text);
        yaml_document_delete(&document);
        yaml_parser_delete(&parser);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(rates), cmocka_unit_test(steps), cmocka_unit_test(windows),
                                       cmocka_unit_test(texts), cmocka_unit_test(names_are_read_back)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
