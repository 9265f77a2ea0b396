/* SPDX-License-Identifier: MIT */
/* Pictures of map --perspective: points on a wall before the eye have the colours of their figures; without shading
 * exactly these. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <png.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "core/colour.h"
#include "core/studio/cloud.h"
#include "core/studio/view.h"
#include "firmware_sim/app/studio/map/view_inside.h"
#include "firmware_sim/config/places.h"

enum { SIDE_PX = 200 };

static struct map_view_options options;
static struct map_view_plan plan;
static struct sh_err err;
static char path[] = "/tmp/scanhead-picture-XXXXXX";

static void plan_it(const char *colour, const char *limits)
{
    options = map_view_default;
    options.eye = "0,-10,0";
    options.look_at = "0,0,0";
    options.size = "200x200";
    options.colour = colour;
    options.limits = limits;
    options.point_px = 8;
    options.shade = 0;
    if (map_view_read(&options, &plan, &err) != SH_OK) fail_msg("%s", err.text);
    plan.output = path;
    plan.quiet = 1;
}

/* Draws a wall of 2 x 2 m in the plane y = 0, all of whose points have these figures. Returns the code. */
static int draw(const struct picturing_figures *f, double top_m, uint8_t middle[3])
{
    struct picturing *p;
    struct picturing_bounds b = {{-1, 0, -1}, {1, 0, top_m}};
    uint8_t *rgb = malloc(3 * SIDE_PX * SIDE_PX);
    assert_non_null(rgb);
    int rc = picturing_begin(&plan, &p, &err);
    assert_int_equal(rc, SH_OK);
    rc = picturing_look(p, &b, &err);
    for (int x = -40; x <= 40 && rc == SH_OK; x++)
        for (int z = -40; z <= 40; z++)
            picturing_add(p, (const double[3]){x / 40.0, 0, z / 40.0}, f);
    if (rc == SH_OK) rc = picturing_finish(p, &err);
    picturing_end(p);
    if (rc == SH_OK) {
        png_image image = {.version = PNG_IMAGE_VERSION};
        assert_true(png_image_begin_read_from_file(&image, path));
        image.format = PNG_FORMAT_RGB;
        assert_true(image.width == SIDE_PX && image.height == SIDE_PX);
        assert_true(png_image_finish_read(&image, NULL, rgb, 0, NULL));
        memcpy(middle, rgb + 3 * (SIDE_PX / 2 * SIDE_PX + SIDE_PX / 2), 3);
    }
    free(rgb);
    return rc;
}

static void expect(const struct picturing_figures *f, const uint8_t want[3])
{
    uint8_t got[3];
    if (draw(f, 1, got) != SH_OK) fail_msg("%s", err.text);
    for (int k = 0; k < 3; k++)
        if (abs(got[k] - want[k]) > 1)
            fail_msg("%d %d %d, not %d %d %d", got[0], got[1], got[2], want[0], want[1], want[2]);
}

/* A quarter of the way to white, so that shading shows on dark colours, too. */
static void paler(uint8_t rgb[3])
{
    for (int k = 0; k < 3; k++)
        rgb[k] = (uint8_t)(rgb[k] + (255 - rgb[k]) / 4);
}

static void figures_are_colours(void **state)
{
    static const uint8_t own[3] = {200, 100, 50};
    const struct picturing_figures f = {.range_m = 2.5, .refl_db = -12, .label = 3, .station = 2, .rgb = own};
    struct picturing_figures bare = f;
    uint8_t want[3];
    (void)state;
    plan_it("rgb", NULL);
    expect(&f, own);
    plan_it("label", NULL);
    colour_number(3, want);
    paler(want);
    expect(&f, want);
    bare.label = CLOUD_LABEL_NONE;
    memcpy(want, colour_grey, 3);
    paler(want);
    expect(&bare, want);
    plan_it("station", NULL);
    colour_number(2, want);
    paler(want);
    expect(&f, want);
    plan_it("reflectance", NULL);
    colour_reflectance(-12, want);
    expect(&f, want);
    plan_it("range", "0,10");
    colour_ramp(0.25, want);
    expect(&f, want);
    plan_it("range", NULL); /* all have one value: it is the middle */
    colour_ramp(0.5, want);
    expect(&f, want);
    plan_it("height", "-5,15");
    view_ramp(0.25, want);
    expect(&f, want);
}

static void what_is_not_known_is_an_error(void **state)
{
    const struct picturing_figures none = {.range_m = NAN, .refl_db = NAN};
    uint8_t middle[3];
    char want[256];
    (void)state;
    plan_it("range", NULL);
    assert_int_equal(draw(&none, 1, middle), SH_EINPUT);
    assert_string_equal(err.text, "--colour range: no point has a range, as with a head that moves");
    plan_it("reflectance", NULL);
    assert_int_equal(draw(&none, 1, middle), SH_EINPUT);
    assert_string_equal(err.text,
                        "--colour reflectance: no point has one; --set signal.model=on gives them one in a scan");
    plan_it("height", NULL);
    options.above_m = 3; /* above all points */
    assert_int_equal(draw(&none, 5, middle), SH_EINPUT);
    snprintf(
        want, sizeof want,
        "%s: no point is in the picture: 0 are outside of it or behind the eye, --below and --above leave out 6561, "
        "and 0 shots have no echo",
        path);
    assert_string_equal(err.text, want);
    plan_it("height", NULL);
    options.above_m = 0; /* half of them, and the row at 0 is kept */
    struct picturing *p;
    assert_int_equal(picturing_begin(&plan, &p, &err), SH_OK);
    assert_int_equal(picturing_look(p, &(struct picturing_bounds){{-1, 0, -1}, {1, 0, 1}}, &err), SH_OK);
    picturing_add(p, (const double[3]){0, 0, 0}, &none);
    picturing_add(p, (const double[3]){0, 0, -1e-9}, &none);
    assert_int_equal(p->cut, 1);
    picturing_end(p);
}

/* ---- whole pictures: marks, names and legends */

/* A row of points: its height, which is also their range; their surface and station; their number. */
struct row {
    double z_m;
    uint16_t label, station;
    int points;
};
static const struct row rows[] = {{-1, 0, 1, 20}, {-0.5, 3, 2, 40}, {0, CLOUD_LABEL_NONE, 2, 30}, {0.5, 1, 1, 40}};
enum { N_ROWS = sizeof rows / sizeof rows[0] };

static struct config_station named[2] = {{.name = "near"}, {.name = "far"}};
static struct site_station stations[2] = {{.station = &named[0], .at.position_m = {-1, 0, -1}},
                                          {.station = &named[1], .at.position_m = {1, 0, 1}}};
static struct scene_surface surfaces[2] = {{.object = "floor", .material = "stone"},
                                           {.object = "door", .material = "oak"}};
static struct scene scene = {.surface = surfaces, .n_surfaces = 2};
static const struct site known = {.station = stations, .n_stations = 2, .scene = &scene, .n_surfaces = 2};

static void row_place(const struct row *row, int i, double p_m[3])
{
    p_m[0] = -1 + 0.05 * i;
    p_m[1] = 0;
    p_m[2] = row->z_m;
}

/* Ends a picture, and returns its pixels; free them. */
static uint8_t *finished(struct picturing *p)
{
    png_image image = {.version = PNG_IMAGE_VERSION};
    uint8_t *rgb = malloc(3 * SIDE_PX * SIDE_PX);
    assert_non_null(rgb);
    if (picturing_finish(p, &err) != SH_OK) fail_msg("%s", err.text);
    picturing_end(p);
    assert_true(png_image_begin_read_from_file(&image, path));
    image.format = PNG_FORMAT_RGB;
    assert_true(png_image_finish_read(&image, NULL, rgb, 0, NULL));
    return rgb;
}

/* Draws the rows, with or without a configuration. Returns the picture's pixels; free it. */
static uint8_t *drawn_rows(const struct site *site)
{
    struct picturing *p;
    assert_int_equal(picturing_begin(&plan, &p, &err), SH_OK);
    p->site = site;
    assert_int_equal(picturing_look(p, &(struct picturing_bounds){{-1, 0, -1}, {1, 0, 1}}, &err), SH_OK);
    for (int r = 0; r < N_ROWS; r++)
        for (int i = 0; i < rows[r].points; i++) {
            double p_m[3];
            row_place(&rows[r], i, p_m);
            picturing_add(p, p_m, &(struct picturing_figures){rows[r].z_m, -12, rows[r].label, rows[r].station, NULL});
        }
    return finished(p);
}

/* A case: how the rows are coloured, and the legend. A legend without names is a scale. Limits that are not given are
 * those of what is seen. */
struct legend {
    const char *colour, *limits;
    int configured;
    const char *title, *name[5];
    double number[4], low, high;
};

static double row_value(const struct legend *l, const struct row *row)
{
    switch (l->colour[0]) {
    case 'l':
        return row->label;
    case 's':
        return row->station;
    default:
        return strcmp(l->colour, "reflectance") == 0 ? -12 : row->z_m;
    }
}

static void legend_colour(const void *legend, double value, uint8_t rgb[3])
{
    const struct legend *l = legend;
    const double part = (value - l->low) / (l->high - l->low);
    if (l->name[0] == NULL) {
        if (strcmp(l->colour, "height") == 0) view_ramp(part, rgb);
        if (strcmp(l->colour, "range") == 0) colour_ramp(part, rgb);
        if (strcmp(l->colour, "reflectance") == 0) colour_reflectance(value, rgb);
        return;
    }
    memcpy(rgb, colour_grey, 3);
    if (value != CLOUD_LABEL_NONE) colour_number((uint32_t)value, rgb);
    paler(rgb);
}

/* Makes the same picture by the parts of core alone, with this legend. The box is 2 m wide and high, and 700 points
 * along its longest side show no gaps. */
static struct picture expected_rows(struct legend *l)
{
    const struct view_spec spec = {plan.camera, 2.0 / 700, 8};
    const struct view_colours colours = {legend_colour, l, 0, {252, 252, 252}, NULL};
    const struct view_station at[2] = {{{-1, 0, -1}, "near"}, {{1, 0, 1}, "far"}};
    struct view_entry entry[4];
    struct picture picture;
    struct view *view;
    uint32_t n = 0;
    assert_int_equal(view_create(&spec, &view, &err), SH_OK);
    for (int r = 0; r < N_ROWS; r++)
        for (int i = 0; i < rows[r].points; i++) {
            const float value = (float)row_value(l, &rows[r]);
            double p_m[1][3];
            row_place(&rows[r], i, p_m[0]);
            view_add_points(view, 1, (const double(*)[3])p_m, &value, NULL);
        }
    if (isnan(l->low)) assert_true(view_range(view, &l->low, &l->high));
    assert_int_equal(view_draw(view, &colours, &picture, &err), SH_OK);
    if (l->configured) assert_int_equal(view_draw_stations(view, &picture, at, 2), 0);
    for (; l->name[n] != NULL; n++) {
        snprintf(entry[n].name, sizeof entry[n].name, "%s", l->name[n]);
        legend_colour(l, l->number[n], entry[n].rgb);
    }
    if (n > 0)
        view_draw_names(&picture, l->title, entry, n);
    else
        view_draw_scale(&picture, l->title, l->low, l->high, &colours);
    view_free(view);
    return picture;
}

/* Surfaces with more points come first; among equals the lower label does. Stations come by their number. */
static void a_picture_has_marks_and_a_legend(void **state)
{
    static const struct legend cases[] = {
        {"label",
         NULL,
         0,
         "Surfaces",
         {"label 1", "label 3", "no label", "label 0"},
         {1, 3, CLOUD_LABEL_NONE, 0},
         0,
         0},
        {"label",
         NULL,
         1,
         "Surfaces",
         {"door | oak", "label 3", "no label", "floor | stone"},
         {1, 3, CLOUD_LABEL_NONE, 0},
         0,
         0},
        {"station", NULL, 0, "Stations", {"station 1", "station 2"}, {1, 2}, 0, 0},
        {"station", NULL, 1, "Stations", {"near", "far"}, {1, 2}, 0, 0},
        {"height", "-1,0.75", 1, "Height z (m)", {NULL}, {0}, -1, 0.75},
        {"height", NULL, 0, "Height z (m)", {NULL}, {0}, NAN, NAN},
        {"range", NULL, 1, "Range (m)", {NULL}, {0}, NAN, NAN},
        {"reflectance", NULL, 0, "Reflectance (dB)", {NULL}, {0}, -30, 0},
    };
    (void)state;
    for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
        plan_it(cases[i].colour, cases[i].limits);
        uint8_t *got = drawn_rows(cases[i].configured ? &known : NULL);
        struct legend legend = cases[i];
        struct picture want = expected_rows(&legend);
        for (int k = 0; k < 3 * SIDE_PX * SIDE_PX; k++)
            if (got[k] != want.rgb[k])
                fail_msg("case %zu: pixel %d, %d is not the same", i, k / 3 % SIDE_PX, k / 3 / SIDE_PX);
        picture_free(&want);
        free(got);
    }
}

/* Each label of 16 bits has a point, all at one place in the upper right. The legend names those that it has room for,
 * and counts the others. */
static void every_label_may_have_points(void **state)
{
    enum { LABELS = 65536, HALF = SIDE_PX / 2 };
    struct view_entry entry[VIEW_MAX_NAMES];
    struct picturing *p;
    struct picture want;
    (void)state;
    plan_it("label", NULL);
    assert_int_equal(picturing_begin(&plan, &p, &err), SH_OK);
    assert_int_equal(picturing_look(p, &(struct picturing_bounds){{-1, 0, -1}, {1, 0, 1}}, &err), SH_OK);
    for (int i = 0; i < LABELS; i++)
        picturing_add(p, (const double[3]){0.9, 0, 0.9}, &(struct picturing_figures){.label = (uint16_t)i});
    uint8_t *got = finished(p);
    assert_int_equal(picture_make(&want, SIDE_PX, SIDE_PX, (const uint8_t[3]){252, 252, 252}, &err), SH_OK);
    for (uint32_t i = 0; i < VIEW_MAX_NAMES; i++) {
        snprintf(entry[i].name, sizeof entry[i].name, "label %u", i);
        colour_number(i, entry[i].rgb);
        paler(entry[i].rgb);
    }
    view_draw_names(&want, "Surfaces", entry, LABELS);
    assert_memory_equal(got + 3 * HALF * SIDE_PX, want.rgb + 3 * HALF * SIDE_PX, 3 * HALF * SIDE_PX);
    picture_free(&want);
    free(got);
}

static int make_path(void **state)
{
    (void)state;
    const int fd = mkstemp(path);
    if (fd < 0) return -1;
    close(fd);
    return unlink(path);
}

static int remove_path(void **state)
{
    (void)state;
    unlink(path);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(figures_are_colours), cmocka_unit_test(every_label_may_have_points),
        cmocka_unit_test(what_is_not_known_is_an_error), cmocka_unit_test(a_picture_has_marks_and_a_legend)};
    return cmocka_run_group_tests_name("map picture", tests, make_path, remove_path);
}
