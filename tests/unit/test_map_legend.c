/* SPDX-License-Identifier: MIT */
/* The marks below and on a scan map, as its SVG has them: heights, scale, north, lines. */
#include <math.h>

#include "core/studio/map.h"
#include "tests/unit/scene_files.h"

static struct map *make(double side_m, double pixel_m)
{
    const struct map_spec spec = {{0, 0}, {side_m, side_m}, pixel_m};
    struct map *map = NULL;
    struct sh_err err = {0, ""};
    if (map_create(&spec, &map, &err) != SH_OK) fail_msg("%s", err.text);
    return map;
}

static void add(struct map *map, double x, double y, double z)
{
    map_add_points(map, 1, &x, &y, &z);
}

/* Writes the map, frees it, and returns the SVG's text. */
static char *svg_of(struct map *map)
{
    const char *file = path_in("map.svg");
    struct sh_err err = {0, ""};
    if (map_write_svg(map, file, &err) != SH_OK) fail_msg("%s", err.text);
    map_free(map);
    FILE *in = fopen(file, "rb");
    assert_non_null(in);
    char *text = calloc(1, 1 << 20);
    const size_t n = fread(text, 1, (1 << 20) - 1, in);
    fclose(in);
    unlink(file);
    assert_true(n > 0);
    return text;
}

/* The group of a class, up to its end. */
static char *group_of(const char *svg, const char *class_name)
{
    char begin[64];
    snprintf(begin, sizeof begin, "<g class=\"%s\">", class_name);
    const char *at = strstr(svg, begin);
    if (at == NULL) return NULL;
    return strndup(at, (size_t)(strstr(at, "</g>") - at));
}

/* The highest label of the legend, in metres; 0 where there is no legend. */
static double legend_m(struct map *map)
{
    char *svg = svg_of(map), *legend = group_of(svg, "legend");
    double height_m = 0.0;
    if (legend != NULL) assert_int_equal(sscanf(strstr(legend, ">+"), ">+%lf m</text>", &height_m), 1);
    free(legend);
    free(svg);
    return height_m;
}

/* The lowest point may be in the first pixel and the highest in the last one, and the other way round. */
static void heights_of_the_corners_count(void **state)
{
    (void)state;
    for (int turned = 0; turned < 2; turned++) {
        struct map *map = make(2, 0.1);
        add(map, 0.05, 0.05, turned ? 3.5 : 1.0);
        add(map, 1.95, 1.95, turned ? 1.0 : 3.5);
        assert_true(legend_m(map) == 2.5);
    }
    struct map *flat = make(2, 0.1);
    add(flat, 1.0, 1.0, 1.0);
    assert_true(legend_m(flat) == 0.0);
}

/* 1000 pixels have points. Heights from 0 m to 1024 m make 1024 bins of a metre. Most pixels are in the bins from 100 m
 * and 200 m. 4 strays at an end are less than half a percent, and are left out; 5 strays stay. */
static void few_strays_change_no_hues(void **state)
{
    (void)state;
    static const struct {
        int low, high; /* strays */
        double want_m;
    } row[] = {{4, 4, 201.0 - 100.0}, {5, 4, 201.0 - 0.0}, {4, 5, 1024.0 - 100.0}, {5, 5, 1024.0}};
    for (size_t k = 0; k < sizeof row / sizeof row[0]; k++) {
        struct map *map = make(50, 1);
        for (int i = 0; i < 1000; i++) {
            const double z = i < row[k].low ? 0.0 : i >= 1000 - row[k].high ? 1024.0 : i % 2 == 0 ? 100.5 : 200.5;
            add(map, i % 50 + 0.5, (double)(i / 50) + 0.5, z);
        }
        const double got_m = legend_m(map);
        if (got_m != row[k].want_m) fail_msg("%d and %d strays: %g m", row[k].low, row[k].high, got_m);
    }
}

/* The bar is the longest of 1, 2, 5 x 10^n metres in 240 pixels. The bar's label has the unit and the digits that it
 * needs. */
static void scale_says_its_length(void **state)
{
    (void)state;
    static const struct {
        double pixel_m;
        const char *label;
        int want_px;
    } row[] = {{0.01, "2 m", 200},     {0.1, "20 m", 200},      {0.005, "1 m", 200},
               {0.0025, "0.5 m", 200}, {10, "2 km", 200},       {5, "1 km", 200},
               {4.1, "500 m", 122},    {1.0 / 240, "1 m", 240}, {0.0001, "0.02 m", 200}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        char *svg = svg_of(make(20 * row[i].pixel_m, row[i].pixel_m)), *scale = group_of(svg, "scale"), title[48];
        long x[3], y[3], width[3], height[3];
        const char *p = scale;
        assert_non_null(scale);
        snprintf(title, sizeof title, "<title>%s</title>", row[i].label);
        if (strstr(scale, title) == NULL) fail_msg("no %s in %s", title, scale);
        snprintf(title, sizeof title, ">%s</text>", row[i].label);
        assert_non_null(strstr(scale, title));
        for (int k = 0; k < 3; k++, p++) {
            p = strstr(p, "<rect ");
            assert_non_null(p);
            assert_int_equal(sscanf(p, "<rect x=\"%ld\" y=\"%ld\" width=\"%ld\" height=\"%ld\"", &x[k], &y[k],
                                    &width[k], &height[k]),
                             4);
        }
        assert_int_equal(width[0], row[i].want_px);
        assert_int_equal(x[1], x[0]); /* a stroke at either end */
        assert_int_equal(x[2] + width[2], x[0] + width[0]);
        assert_true(y[1] == y[2] && height[1] == height[2] && y[1] < y[0] && y[1] + height[1] == y[0] + height[0]);
        free(scale);
        free(svg);
    }
}

/* The colours begin at the label 0, have no gap, and end where the label of the high end ends. */
static void colours_reach_from_label_to_label(void **state)
{
    (void)state;
    struct map *map = make(60, 0.1);
    double from = 0, to = 0;
    add(map, 1, 1, 0.0);
    add(map, 2, 2, 3.0);
    char *svg = svg_of(map), *legend = group_of(svg, "legend");
    assert_non_null(legend);
    const char *text = strstr(legend, "<text ");
    assert_non_null(text);
    assert_int_equal(sscanf(text, "<text x=\"%lf\"", &from), 1);
    text = strstr(text + 1, "<text ");
    assert_non_null(text);
    assert_int_equal(sscanf(text, "<text x=\"%lf\"", &to), 1);
    assert_true(to > from);
    for (const char *p = strstr(legend, "<rect "); p != NULL; p = strstr(p + 1, "<rect ")) {
        long x, y, width;
        assert_int_equal(sscanf(p, "<rect x=\"%ld\" y=\"%ld\" width=\"%ld\"", &x, &y, &width), 3);
        assert_true((double)x == from);
        from += (double)width;
    }
    assert_true(from == to);
    free(legend);
    free(svg);
}

/* The arrow's tip is above its feet, in the middle of them, and in the image. */
static void north_is_up(void **state)
{
    (void)state;
    char *svg = svg_of(make(60, 0.1)), *north = group_of(svg, "north");
    const char *p = north;
    unsigned width, height;
    assert_non_null(north);
    assert_int_equal(sscanf(strstr(svg, " width=\""), " width=\"%u\" height=\"%u\"", &width, &height), 2);
    double foot_x[2];
    for (int side = 0; side < 2; side++, p++) {
        double c[6];
        p = strstr(p, "<polygon ");
        assert_non_null(p);
        assert_int_equal(sscanf(p, "<polygon points=\"%lf,%lf %lf,%lf %lf,%lf", c, c + 1, c + 2, c + 3, c + 4, c + 5),
                         6);
        assert_true(c[0] == c[2] && c[1] < c[3] && c[3] < c[5]);
        assert_true(c[0] > 0 && c[0] < width && c[1] > 24 + 600 && c[5] < height); /* below the map */
        foot_x[side] = c[4] - c[0];
    }
    assert_true(foot_x[0] < 0 && foot_x[0] == -foot_x[1]);
    assert_non_null(strstr(north, ">N</text>"));
    free(north);
    free(svg);
}

/* An end beyond the area is moved to its border, each end and axis by itself. Kinds differ in class and colour. */
static void lines_end_at_the_border(void **state)
{
    (void)state;
    static const double ends[2][2][2] = {{{-1, 2}, {3, 9}}, {{1, -5}, {70, 61}}};
    /* 10 pixels a metre; 600 x 600 pixels; 24 from the left and the top; y up */
    static const double want[2][4] = {{0, 580, 30, 510}, {10, 600, 600, 0}};
    static const char *const kind_class[MAP_LINES] = {[MAP_OPEN_EDGE] = "edges", [MAP_FIELD] = "fields"};
    static const char *const colour[MAP_LINES] = {[MAP_OPEN_EDGE] = "#d62728", [MAP_FIELD] = "#1f77b4"};
    for (int kind = 0; kind < MAP_LINES; kind++) {
        struct map *map = make(60, 0.1);
        struct map_layout at;
        struct sh_err err;
        for (int i = 0; i < 2; i++)
            assert_int_equal(map_add_line(map, kind, ends[i][0], ends[i][1], &err), SH_OK);
        map_get_layout(map, &at);
        char *svg = svg_of(map), *group = group_of(svg, kind_class[kind]);
        const char *p = group;
        assert_null(strstr(svg, kind_class[1 - kind]));
        assert_non_null(group);
        for (int i = 0; i < 2; i++, p++) {
            double c[4];
            p = strstr(p, "<line ");
            assert_non_null(p);
            assert_int_equal(sscanf(p, "<line x1=\"%lf\" y1=\"%lf\" x2=\"%lf\" y2=\"%lf\"", c, c + 1, c + 2, c + 3), 4);
            for (int k = 0; k < 4; k++) /* written to 0.01 */
                if (!(fabs(c[k] - (k % 2 ? at.top : at.left) - want[i][k]) < 0.006))
                    fail_msg("line %d, %d: %g", i, k, c[k]);
            assert_non_null(strstr(p, colour[kind]));
        }
        assert_null(strstr(p, "<line "));
        free(group);
        free(svg);
    }
}

/* A tick leads from the station to where it looks, clockwise from north; it is 24 pixels long. */
static void ticks_point_where_stations_look(void **state)
{
    (void)state;
    for (int k = 0; k < 9; k++) {
        const double heading_rad = k < 8 ? k * M_PI / 4 : (double)NAN;
        struct map *map = make(60, 0.1);
        const struct map_station station = {.x_m = 20, .y_m = 50, .heading_rad = heading_rad, .name = "a"};
        struct sh_err err;
        struct map_layout at;
        assert_int_equal(map_add_station(map, &station, &err), SH_OK);
        map_get_layout(map, &at);
        char *svg = svg_of(map), *mark = group_of(svg, "station");
        double c[4] = {0};
        assert_non_null(mark);
        const char *line = strstr(mark, "<line ");
        assert_int_equal(line == NULL, k == 8);
        if (line != NULL) {
            assert_int_equal(sscanf(line, "<line x1=\"%lf\" y1=\"%lf\" x2=\"%lf\" y2=\"%lf\"", c, c + 1, c + 2, c + 3),
                             4);
            const double want[4] = {at.left + 200, at.top + 100, at.left + 200 + 24 * sin(heading_rad),
                                    at.top + 100 - 24 * cos(heading_rad)};
            for (int i = 0; i < 4; i++)
                assert_true(fabs(c[i] - want[i]) < 0.006); /* written to 0.01 */
        }
        free(mark);
        free(svg);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(heights_of_the_corners_count),    cmocka_unit_test(few_strays_change_no_hues),
        cmocka_unit_test(scale_says_its_length),           cmocka_unit_test(north_is_up),
        cmocka_unit_test(lines_end_at_the_border),         cmocka_unit_test(colours_reach_from_label_to_label),
        cmocka_unit_test(ticks_point_where_stations_look),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
