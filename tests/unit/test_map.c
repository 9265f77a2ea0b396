/* SPDX-License-Identifier: MIT */
/* The scan map, read back through libpng's simplified interface. */
#include <fcntl.h>
#include <math.h>
#include <png.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include "core/studio/map.h"
#include "tests/unit/scene_files.h"

struct picture {
    uint32_t width, height;
    uint8_t *rgb;
};

static struct map *make(double x0, double y0, double x1, double y1, double pixel_m)
{
    const struct map_spec spec = {{x0, y0}, {x1, y1}, pixel_m};
    struct map *map = NULL;
    struct sh_err err = {0, ""};
    if (map_create(&spec, &map, &err) != SH_OK) fail_msg("%s", err.text);
    return map;
}

static struct picture draw(const struct map *map)
{
    const char *file = path_in("map.png");
    struct sh_err err = {0, ""};
    if (map_write_png(map, file, &err) != SH_OK) fail_msg("%s", err.text);
    png_image image = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_file(&image, file));
    image.format = PNG_FORMAT_RGB;
    struct picture picture = {image.width, image.height, malloc(PNG_IMAGE_SIZE(image))};
    assert_true(png_image_finish_read(&image, NULL, picture.rgb, 0, NULL));
    unlink(file);
    return picture;
}

static const uint8_t *at(const struct picture *picture, uint32_t column, uint32_t row)
{
    assert_true(column < picture->width && row < picture->height);
    return picture->rgb + ((size_t)row * picture->width + column) * 3;
}

static int is_white(const uint8_t *rgb)
{
    return rgb[0] == 255 && rgb[1] == 255 && rgb[2] == 255;
}

/* Rec. 709 weights on the encoded values are enough to tell dark from light. */
static double brightness(const uint8_t *rgb)
{
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
}

static void add(struct map *map, double x, double y, double z)
{
    map_add_points(map, 1, &x, &y, &z);
}

static void test_size(void **state)
{
    (void)state;
    struct map_layout layout;
    struct map *map = make(-3, 2, 9, 8, 0); /* 12 x 6 m */
    map_get_layout(map, &layout);
    assert_int_equal(layout.map_width, MAP_DEFAULT_PX);
    assert_int_equal(layout.map_height, MAP_DEFAULT_PX / 2);
    assert_true(fabs(layout.pixel_m - 0.01) < 1e-12);
    struct picture picture = draw(map);
    assert_int_equal(picture.width, layout.width);
    assert_int_equal(picture.height, layout.height);
    assert_true(layout.left + layout.map_width <= layout.width && layout.top + layout.map_height < layout.height);
    free(picture.rgb);
    map_free(map);
    map = make(0, 0, 10, 7.04, 0.5); /* 20 x 14.08 pixels: a part of a pixel counts as one */
    map_get_layout(map, &layout);
    assert_int_equal(layout.map_width, 20);
    assert_int_equal(layout.map_height, 15);
    assert_int_equal(layout.width, MAP_MIN_WIDTH_PX);
    map_free(map);
    map = make(0, 5, 10, 5, 0); /* a line is one pixel high */
    map_get_layout(map, &layout);
    assert_int_equal(layout.map_height, 1);
    add(map, 3, 5, 0);
    picture = draw(map);
    free(picture.rgb);
    map_free(map);
    map_free(NULL);
}

/* Each point sets its own pixel and the eight about it, and no other. */
static void test_place(void **state)
{
    (void)state;
    /* x, y -> column, row in the map: 0.1 m per pixel, 40 x 30 pixels, y up */
    const struct {
        double x, y;
        uint32_t column, row;
    } points[] = {{-1.95, 7.95, 0, 0}, {1.95, 5.05, 39, 29}, {0.05, 6.05, 20, 19}, {-2, 5, 0, 29}, {2, 8, 39, 0}};
    for (size_t i = 0; i < sizeof points / sizeof points[0]; i++) {
        struct map *map = make(-2, 5, 2, 8, 0.1);
        struct map_layout layout;
        map_get_layout(map, &layout);
        add(map, points[i].x, points[i].y, 1.5);
        struct picture picture = draw(map);
        for (uint32_t r = 0; r < layout.map_height; r++)
            for (uint32_t c = 0; c < layout.map_width; c++) {
                const int near = abs((int)r - (int)points[i].row) <= 1 && abs((int)c - (int)points[i].column) <= 1;
                assert_int_equal(is_white(at(&picture, layout.left + c, layout.top + r)), !near);
            }
        free(picture.rgb);
        map_free(map);
    }
}

static void test_structure(void **state)
{
    (void)state;
    struct map *map = make(0, 0, 12, 12, 0.01);
    struct map_layout layout;
    map_get_layout(map, &layout);
    for (int i = 0; i < 5000; i++)
        add(map, 2, 2, 0.001 * (i % 7)); /* a floor, however dense */
    add(map, 4, 4, 0);                   /* floor and ceiling */
    add(map, 4, 4, 2.5);
    for (int i = 0; i < 50; i++)
        add(map, 6, 6, 0.05 * i); /* a wall, thin */
    add(map, 8, 8, 0.9);          /* a table */
    add(map, 10, 10, -1e-3);
    struct picture picture = draw(map);
    double light[5];
    const uint8_t *rgb[5];
    for (int i = 0; i < 5; i++) {
        const uint32_t from_corner = (uint32_t)(200 + 200 * i); /* 2 m and on, at 0.01 m a pixel */
        rgb[i] = at(&picture, layout.left + from_corner, layout.top + layout.map_height - 1 - from_corner);
        light[i] = brightness(rgb[i]);
    }
    assert_true(light[0] > 200 && light[1] > 200 && light[3] > 200);
    assert_true(light[2] < 80);
    assert_memory_equal(rgb[0], rgb[1], 3);      /* a ceiling hides nothing */
    assert_true(memcmp(rgb[0], rgb[3], 3) != 0); /* heights differ in hue */
    assert_true(fabs(light[0] - light[3]) < 25); /* and little in lightness */
    free(picture.rgb);
    map_free(map);
}

static int count_red(const struct picture *picture, double *column, double *row)
{
    int n = 0;
    *column = *row = 0;
    for (uint32_t r = 0; r < picture->height; r++)
        for (uint32_t c = 0; c < picture->width; c++) {
            const uint8_t *rgb = at(picture, c, r);
            if (rgb[0] != 214 || rgb[1] != 39 || rgb[2] != 40) continue;
            *column += c + 0.5;
            *row += r + 0.5;
            n++;
        }
    if (n > 0) *column /= n, *row /= n;
    return n;
}

static int add_station(struct map *map, double x_m, double y_m, struct sh_err *err)
{
    const struct map_station station = {.x_m = x_m, .y_m = y_m, .heading_rad = NAN};
    return map_add_station(map, &station, err);
}

static void test_station(void **state)
{
    (void)state;
    struct map *map = make(-5, -5, 5, 5, 0.02);
    struct sh_err err = {0, ""};
    double column, row;
    struct picture picture = draw(map);
    assert_int_equal(count_red(&picture, &column, &row), 0);
    free(picture.rgb);
    assert_int_equal(add_station(map, 1.01, -2.01, &err), SH_OK);
    picture = draw(map);
    struct map_layout layout;
    map_get_layout(map, &layout);
    /* 6.01 m from the left and 2.99 m from the lower border, at 0.02 m a pixel */
    const uint32_t want_column = layout.left + 300, want_row = layout.top + layout.map_height - 1 - 149;
    assert_true(count_red(&picture, &column, &row) > 40);
    /* the mean of the full pixels of a triangle about a place is that place, to half a pixel */
    assert_true(fabs(column - (want_column + 0.5)) < 0.5 && fabs(row - (want_row + 0.5)) < 1);
    free(picture.rgb);
    assert_int_equal(add_station(map, 5.5, 0, &err), SH_EINPUT);
    assert_non_null(strstr(err.text, "x 5.5 m"));
    assert_int_equal(add_station(map, NAN, 0, &err), SH_EINPUT);
    for (int i = 1; i < MAP_MAX_STATIONS; i++)
        assert_int_equal(add_station(map, -5, 5, &err), SH_OK); /* marks at the corner stay in the image */
    assert_int_equal(add_station(map, 0, 0, &err), SH_EINPUT);
    picture = draw(map);
    free(picture.rgb);
    map_free(map);
}

/* The bar is as long as its label says: 2 m at 1 cm are 200 pixels, found as the longest dark run below the map. */
static void test_scale_bar(void **state)
{
    (void)state;
    const struct {
        double side_m;
        int want_px; /* the longest of 1, 2, 5 x 10^n metres in 240 pixels */
    } maps[] = {{12, 200}, {120, 200}, {6, 200}, {30, 200}, {3000, 200}, {0.5, 240}};
    for (size_t i = 0; i < sizeof maps / sizeof maps[0]; i++) {
        struct map *map = make(0, 0, maps[i].side_m, maps[i].side_m, 0);
        struct map_layout layout;
        map_get_layout(map, &layout);
        struct picture picture = draw(map);
        int longest = 0;
        for (uint32_t r = layout.top + layout.map_height; r < picture.height; r++) {
            int run = 0;
            for (uint32_t c = 0; c < picture.width; c++) {
                run = brightness(at(&picture, c, r)) < 60 ? run + 1 : 0;
                if (run > longest) longest = run;
            }
        }
        assert_int_equal(longest, maps[i].want_px);
        free(picture.rgb);
        map_free(map);
    }
}

static void test_counts(void **state)
{
    (void)state;
    struct map *map = make(0, 0, 1, 1, 0.1);
    const double x[] = {0.5, NAN, 0.5, 0.5, 2, 0.5, 0, 1, 0.5}, y[] = {0.5, 0.5, INFINITY, 0.5, 0.5, -1e-9, 0, 1, 0.5};
    const double z[] = {1e6, 0, 0, NAN, 0, 0, -1e6, 0, -1e300};
    struct map_counts counts;
    map_add_points(map, 9, x, y, z);
    map_get_counts(map, &counts);
    assert_int_equal(counts.drawn, 3);
    assert_int_equal(counts.empty, 3);
    assert_int_equal(counts.outside, 3);
    struct picture picture = draw(map);
    free(picture.rgb);
    map_free(map);
}

/* One line more than a map has of its kind is counted, and the other kind has its own limit. */
static void test_lines_left_out(void **state)
{
    (void)state;
    static const double a[2] = {0, 0}, b[2] = {1, 1};
    struct map *map = make(0, 0, 1, 1, 0.1);
    struct map_counts counts;
    struct sh_err err = {0, ""};
    for (int kind = 0; kind < MAP_LINES; kind++)
        for (int i = 0; i < MAP_MAX_LINES + 1 + kind; i++)
            assert_int_equal(map_add_line(map, kind, a, b, &err), SH_OK);
    map_get_counts(map, &counts);
    for (int kind = 0; kind < MAP_LINES; kind++) {
        assert_int_equal(counts.lines[kind], MAP_MAX_LINES);
        assert_int_equal(counts.lines_left_out[kind], 1 + kind);
    }
    map_free(map);
}

static void test_refusals(void **state)
{
    (void)state;
    const struct {
        struct map_spec spec;
        const char *part;
    } bad[] = {
        {{{0, 0}, {1e6, 1e6}, 0.01}, "pixels; use"},
        {{{0, 0}, {1e300, 1}, 1e-300}, "pixels; use"},
        {{{0, 0}, {20000, 1}, 1}, "20000 x 1 pixels; use"},
        {{{0, 0}, {1, -1}, 0}, "y from 0 m to -1 m"},
        {{{NAN, 0}, {1, 1}, 0}, "limits in x"},
        {{{0, -1e308}, {1, 1e308}, 0}, "limits in y"},
        {{{0, 0}, {1, 1}, -1}, "pixel size -1 m"},
        {{{0, 0}, {1, 1}, NAN}, "pixel size"},
        {{{2, 3}, {2, 3}, 0}, "the area is a point"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        struct map *map = NULL;
        struct sh_err err = {0, ""};
        assert_int_equal(map_create(&bad[i].spec, &map, &err), SH_EINPUT);
        assert_null(map);
        if (strstr(err.text, bad[i].part) == NULL) fail_msg("'%s' without '%s'", err.text, bad[i].part);
    }
    /* The proposed pixel size is allowed. */
    for (int i = 0; i < 3; i++) {
        struct map_spec spec = bad[i == 1 ? 0 : i].spec;
        struct map *map = NULL;
        struct sh_err err = {0, ""};
        assert_int_equal(map_create(&spec, &map, &err), SH_EINPUT);
        assert_int_equal(sscanf(strstr(err.text, "use"), "use %lf", &spec.pixel_m), 1);
        assert_int_equal(map_create(&spec, &map, &err), SH_OK);
        map_free(map);
    }
}

static void expect_no_write(const struct map *map, const char *file, int code)
{
    struct sh_err err = {0, ""};
    char part[160];
    assert_int_equal(map_write_png(map, file, &err), code);
    assert_non_null(strstr(err.text, file));
    assert_null(strchr(err.text, '\n'));
    snprintf(part, sizeof part, "%s.part", file);
    assert_int_equal(access(part, F_OK), -1); /* nothing lies about */
}

static void test_bad_path(void **state)
{
    (void)state;
    struct map *map = make(0, 0, 1, 1, 0.01);
    char text[8] = "";
    expect_no_write(map, path_in("no/such/map.png"), SH_EINPUT);
    assert_int_equal(mkdir(path_in("taken.png"), 0700), 0);
    expect_no_write(map, path_in("taken.png"), SH_EINPUT);
    assert_int_equal(rmdir(path_in("taken.png")), 0);
    /* On a full disk the earlier file stays whole. */
    int fd = open(path_in("old.png"), O_CREAT | O_WRONLY, 0600);
    assert_int_equal(write(fd, "old", 3), 3);
    close(fd);
    struct rlimit before, small;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    small = (struct rlimit){100, before.rlim_max};
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    expect_no_write(map, path_in("old.png"), SH_EIO);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    fd = open(path_in("old.png"), O_RDONLY);
    assert_int_equal(read(fd, text, sizeof text), 3);
    assert_string_equal(text, "old");
    close(fd);
    unlink(path_in("old.png"));
    map_free(map);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_size),     cmocka_unit_test(test_place),     cmocka_unit_test(test_structure),
        cmocka_unit_test(test_station),  cmocka_unit_test(test_scale_bar), cmocka_unit_test(test_counts),
        cmocka_unit_test(test_refusals), cmocka_unit_test(test_bad_path),  cmocka_unit_test(test_lines_left_out),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
