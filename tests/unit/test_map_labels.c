/* SPDX-License-Identifier: MIT */
/* Names on the map, and the map as SVG. A small reader of XML reads it back, and libpng its image. */
#include <ctype.h>
#include <math.h>
#include <png.h>

#include "core/studio/map.h"
#include "core/studio/picture.h"
#include "tests/unit/scene_files.h"

static struct map *make(double side_m)
{
    const struct map_spec spec = {{0, 0}, {side_m, side_m}, side_m / 600};
    struct map *map = NULL;
    struct sh_err err = {0, ""};
    if (map_create(&spec, &map, &err) != SH_OK) fail_msg("%s", err.text);
    return map;
}

static void add(struct map *map, double x_m, double y_m, double heading_rad, const char *name, const char *height)
{
    struct map_station s = {.x_m = x_m, .y_m = y_m, .heading_rad = heading_rad};
    struct sh_err err = {0, ""};
    snprintf(s.name, sizeof s.name, "%s", name);
    snprintf(s.height, sizeof s.height, "%s", height);
    if (map_add_station(map, &s, &err) != SH_OK) fail_msg("%s", err.text);
}

/* Checks all labels that have places, against each other and the stations at place_px. Returns how many have one. */
static uint32_t check_labels(const struct map_label *label, uint32_t n, const double (*place_px)[2])
{
    uint32_t placed = 0;
    for (uint32_t i = 0; i < n; i++) {
        assert_int_equal(label[i].station, i);
        if (!label[i].placed) continue;
        placed++;
        for (uint32_t k = 0; k < n; k++) {
            const double *p = place_px[k];
            assert_false(p[0] > label[i].left && p[0] < label[i].right && p[1] > label[i].top &&
                         p[1] < label[i].bottom);
            if (k == i || !label[k].placed) continue;
            assert_false(label[i].left < label[k].right && label[k].left < label[i].right &&
                         label[i].top < label[k].bottom && label[k].top < label[i].bottom);
        }
    }
    return placed;
}

/* A thin line leads to each label that is more than 22.5 pixels away from its station. The line begins 14 pixels from
 * the station, beyond its mark, and ends where the label is nearest. */
static void check_lines(const struct map *map, const struct map_label *label, uint32_t n, const double (*place_px)[2])
{
    struct sh_err err = {0, ""};
    const char *file = path_in("lines.svg");
    static char text[1 << 20];
    uint32_t n_away = 0;
    if (map_write_svg(map, file, &err) != SH_OK) fail_msg("%s", err.text);
    FILE *in = fopen(file, "rb");
    assert_non_null(in);
    text[fread(text, 1, sizeof text - 1, in)] = '\0';
    fclose(in);
    unlink(file);
    for (uint32_t i = 0; i < n; i++) {
        const double *p = place_px[i];
        const double to[2] = {fmin(label[i].right, fmax(label[i].left, p[0])),
                              fmin(label[i].bottom, fmax(label[i].top, p[1]))};
        const double away = hypot(to[0] - p[0], to[1] - p[1]);
        if (!label[i].placed || away <= 22.5) continue;
        int found = 0;
        for (const char *at = text; !found && (at = strstr(at, "<line ")) != NULL; at++) {
            double from[2], end[2], width;
            if (sscanf(at, "<line x1=\"%lf\" y1=\"%lf\" x2=\"%lf\" y2=\"%lf\" stroke-width=\"%lf\"", &from[0], &from[1],
                       &end[0], &end[1], &width) != 5)
                continue;
            found = width <= 1 && hypot(end[0] - to[0], end[1] - to[1]) < 0.02; /* hundredths of a pixel */
            for (int k = 0; k < 2 && found; k++)
                assert_true(fabs(from[k] - p[k] - 14 * (to[k] - p[k]) / away) < 0.02);
        }
        if (!found) fail_msg("no line leads to label %u, which is %g pixels away", i, away);
        n_away++;
    }
    assert_true(n_away > 0);
}

/* 60 stations are at random places of 600 x 600 pixels. A label is about 110 x 35 pixels, so all of them would cover
 * two thirds of the map, and some find no room. On a grid of 150 x 200 pixels, all 12 labels find room. */
static void test_labels(void **state)
{
    (void)state;
    enum { N = 60 };
    struct map_label label[N];
    double place_px[N][2];
    struct map_layout at;
    struct map *map = make(60);
    map_get_layout(map, &at);
    for (uint32_t i = 0; i < 12; i++) {
        const double x_m = 7.5 + 15 * (i % 4), y_m = 10 + 20 * (double)(i / 4);
        add(map, x_m, y_m, 0.5 * i, "north-east", "z 12.25 m");
        place_px[i][0] = at.left + 10 * x_m;
        place_px[i][1] = at.top + 600 - 10 * y_m;
    }
    assert_int_equal(map_place_labels(map, label), 0);
    assert_int_equal(check_labels(label, 12, place_px), 12);
    for (int i = 0; i < 12; i++) { /* beside its station: on the first ring */
        const double dx = fmax(0, fmax(label[i].left - place_px[i][0], place_px[i][0] - label[i].right));
        const double dy = fmax(0, fmax(label[i].top - place_px[i][1], place_px[i][1] - label[i].bottom));
        assert_true(hypot(dx, dy) < 30);
    }
    map_free(map);
    map = make(60);
    for (uint32_t i = 0; i < N; i++) {
        uint64_t draw = i * UINT64_C(0x9e3779b97f4a7c15) + UINT64_C(0x1234567);
        const double x_m = 60 * (double)(draw >> 40) / 16777216.0, y_m = 60 * (double)(draw << 24 >> 40) / 16777216.0;
        add(map, x_m, y_m, NAN, "north-east", "z 12.25 m");
        place_px[i][0] = at.left + 10 * x_m;
        place_px[i][1] = at.top + 600 - 10 * y_m;
    }
    const uint32_t left_out = map_place_labels(map, label);
    assert_int_equal(check_labels(label, N, place_px), N - left_out);
    assert_true(left_out > 0 && left_out < N / 2);
    check_lines(map, label, N, (const double(*)[2])place_px);
    map_free(map);
}

/* With a wall to the right of a station, its name goes elsewhere. */
static void test_walls(void **state)
{
    (void)state;
    for (int wall = 0; wall < 2; wall++) {
        struct map *map = make(60);
        struct map_label label;
        for (int i = 0; wall && i < 20000; i++) { /* 4 x 4 m, 3 m high, to the right of the station */
            const double x = 31 + 0.04 * (i % 100), y = 28 + 0.02 * (double)(i / 100);
            for (double z = 0; z < 3; z += 0.1)
                map_add_points(map, 1, &x, &y, &z);
        }
        add(map, 30, 30, NAN, "gate", "");
        assert_int_equal(map_place_labels(map, &label), 0);
        struct map_layout at;
        map_get_layout(map, &at);
        assert_int_equal(label.left > at.left + 300, !wall);
        map_free(map);
    }
}

/* A name stays in the image, wherever its station is near the border. Columns and rows are tried one by one. */
static void test_borders(void **state)
{
    (void)state;
    enum { SIDE = 480, NEAR = 130 };
    const struct map_spec spec = {{0, 0}, {SIDE, SIDE}, 1};
    for (int k = 0; k < 4 * NEAR; k++) {
        const double from = k / 4 + 0.5, near = k % 2 ? SIDE - from : from;
        struct map *map = NULL;
        struct map_label label;
        struct map_layout at;
        struct sh_err err;
        assert_int_equal(map_create(&spec, &map, &err), SH_OK);
        add(map, k & 2 ? near : 100, k & 2 ? 100 : near, NAN, "north-east", "z 12.25 m");
        map_get_layout(map, &at);
        assert_int_equal(map_place_labels(map, &label), 0);
        assert_true(label.left >= 2 && label.top >= 2 && label.right <= at.width - 2);
        assert_true(label.bottom <= at.top + at.map_height); /* below the map is the scale */
        map_free(map);
    }
}

/* The first place is to the right. A name there would cover the tick of a station that looks east, so that name is to
 * the left. Without a tick, or with one that looks elsewhere, the name stays to the right. */
static void test_ticks(void **state)
{
    (void)state;
    static const double heading_deg[] = {0, 90, 180, 270, (double)NAN};
    for (int i = 0; i < 5; i++) {
        struct map *map = make(60);
        struct map_label label;
        struct map_layout at;
        add(map, 30, 30, heading_deg[i] * M_PI / 180, "gate", "");
        map_get_layout(map, &at);
        assert_int_equal(map_place_labels(map, &label), 0);
        assert_int_equal(label.left > at.left + 300, i != 1);
        map_free(map);
    }
}

/* ---- SVG */

struct element {
    char name[32];
    const char *attributes; /* up to > */
};

/* Walks well-formed XML. Each element that opens is given to `seen`, and closes in order; there is no & without its
 * entity. */
static void walk(const char *xml, void (*seen)(void *ctx, const struct element *e), void *ctx)
{
    char open[16][32];
    int depth = 0, roots = 0;
    const char *p = xml;
    if (strncmp(p, "<?xml ", 6) == 0) p = strstr(p, "?>") + 2;
    for (; *p != '\0'; p++) {
        assert_true(*p != '>' && *(const unsigned char *)p != 0x7f && (*(const unsigned char *)p >= 32 || *p == '\n'));
        if (*p == '&')
            assert_true(!strncmp(p, "&amp;", 5) || !strncmp(p, "&lt;", 4) || !strncmp(p, "&gt;", 4) ||
                        !strncmp(p, "&quot;", 6));
        if (*p != '<') {
            assert_true(depth > 0 || isspace((unsigned char)*p));
            continue;
        }
        const int closes = p[1] == '/';
        struct element e = {.attributes = p};
        assert_int_equal(sscanf(p + 1 + closes, "%31[a-z]", e.name), 1);
        int quoted = 0;
        for (; quoted || *p != '>'; p++) {
            assert_true(*p != '\0' && (*p != '<' || p == e.attributes));
            if (*p == '"') quoted = !quoted;
        }
        if (closes) {
            assert_true(depth > 0);
            assert_string_equal(open[--depth], e.name);
            continue;
        }
        roots += depth == 0;
        seen(ctx, &e);
        assert_true(depth < 16);
        if (p[-1] != '/') strcpy(open[depth++], e.name);
    }
    assert_int_equal(depth, 0);
    assert_int_equal(roots, 1);
}

static int attribute(const struct element *e, const char *name, char *out, size_t room)
{
    char wanted[40];
    snprintf(wanted, sizeof wanted, " %s=\"", name);
    const char *end = strchr(e->attributes, '>'), *at = strstr(e->attributes, wanted);
    if (at == NULL || at > end) return 0;
    at += strlen(wanted);
    const size_t n = strcspn(at, "\"");
    assert_true(n < room);
    memcpy(out, at, n);
    out[n] = '\0';
    return 1;
}

struct found {
    int images, stations, texts;
    double centre[2][2]; /* of red triangles: the mean of their corners */
    int n_red;
    char *png; /* base64 */
};

static void look(void *ctx, const struct element *e)
{
    struct found *f = ctx;
    char v[128];
    double c[6];
    f->stations += strcmp(e->name, "g") == 0 && attribute(e, "class", v, sizeof v) && strcmp(v, "station") == 0;
    f->texts += strcmp(e->name, "text") == 0;
    if (strcmp(e->name, "image") == 0) {
        f->images++;
        f->png = malloc(1 << 20);
        assert_true(attribute(e, "xlink:href", f->png, 1 << 20));
    }
    if (strcmp(e->name, "polygon") != 0 || !attribute(e, "fill", v, sizeof v) || strcmp(v, "#d62728") != 0) return;
    assert_true(attribute(e, "points", v, sizeof v) && f->n_red < 2);
    assert_int_equal(sscanf(v, "%lf,%lf %lf,%lf %lf,%lf", c, c + 1, c + 2, c + 3, c + 4, c + 5), 6);
    for (int k = 0; k < 2; k++)
        f->centre[f->n_red][k] = (c[k] + c[2 + k] + c[4 + k]) / 3;
    f->n_red++;
}

static char *read_text(const char *file)
{
    FILE *in = fopen(file, "rb");
    assert_non_null(in);
    char *text = calloc(1, 1 << 20);
    const size_t n = fread(text, 1, (1 << 20) - 1, in);
    fclose(in);
    unlink(file);
    assert_int_equal(strlen(text), n);
    return text;
}

static size_t decode(const char *text, uint8_t *out)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    uint32_t bits = 0;
    int n_bits = 0;
    size_t n = 0;
    for (; *text != '\0' && *text != '='; text++) {
        const char *at = strchr(digits, *text);
        assert_non_null(at);
        bits = bits << 6 | (uint32_t)(at - digits);
        if ((n_bits += 6) < 8) continue;
        n_bits -= 8;
        out[n++] = (uint8_t)(bits >> n_bits);
    }
    return n;
}

/* The image in the SVG shows the PNG's map: one point, and white. */
static void check_image(const char *href, const struct map_layout *at)
{
    static const char kind[] = "data:image/png;base64,";
    assert_memory_equal(href, kind, strlen(kind));
    uint8_t *bytes = malloc(strlen(href)), *rgb;
    const size_t n = decode(href + strlen(kind), bytes);
    png_image image = {.version = PNG_IMAGE_VERSION};
    assert_true(png_image_begin_read_from_memory(&image, bytes, n));
    assert_int_equal(image.width, at->map_width);
    assert_int_equal(image.height, at->map_height);
    image.format = PNG_FORMAT_RGB;
    rgb = malloc(PNG_IMAGE_SIZE(image));
    assert_true(png_image_finish_read(&image, NULL, rgb, 0, NULL));
    for (int row = 0; row < 600; row++)
        for (int column = 0; column < 600; column++) /* the point at 20.05, 40.05 m: 200 and 400 from below */
            assert_int_equal(rgb[3 * (row * 600 + column)] < 255, abs(column - 200) <= 1 && abs(row - 199) <= 1);
    free(rgb);
    free(bytes);
}

static void test_svg(void **state)
{
    (void)state;
    struct sh_err err = {0, ""};
    struct found found = {0};
    struct map_layout at;
    struct map *map = make(60);
    const double x = 20.05, y = 40.05, z = 1;
    map_add_points(map, 1, &x, &y, &z);
    add(map, 10, 50, NAN, "a<b>&\"c\" \xc3\xa4\xe2\x82\xac", "z 1.00 m");
    add(map, 30, 15, 1, "line\nend \xff\xed\xa0\x80", ""); /* a control, and bytes that are not UTF-8 */
    map_get_layout(map, &at);
    if (map_write_svg(map, path_in("map.svg"), &err) != SH_OK) fail_msg("%s", err.text);
    char *xml = read_text(path_in("map.svg"));
    walk(xml, look, &found);
    assert_int_equal(found.images, 1);
    assert_int_equal(found.stations, 2);
    assert_int_equal(found.texts, 2 + 3); /* scale and north, no legend; two names and a height */
    assert_int_equal(found.n_red, 2);
    /* 10 pixels a metre, y up; a triangle's corners lie about its place: the upper one at 9, the others 4.5 below */
    const double want[2][2] = {{at.left + 100, at.top + 100}, {at.left + 300, at.top + 450}};
    for (int i = 0; i < 2; i++)
        for (int k = 0; k < 2; k++)
            assert_true(fabs(found.centre[i][k] - want[i][k]) < 0.02); /* written to 0.01 */
    assert_non_null(strstr(xml, ">a&lt;b&gt;&amp;&quot;c&quot; \xc3\xa4\xe2\x82\xac</text>"));
    assert_non_null(strstr(xml, "line\xef\xbf\xbd"
                                "end \xef\xbf\xbd"));
    check_image(found.png, &at);
    free(found.png);
    free(xml);
    map_free(map);
}

/* A station is titled by its name and height, as far as it has them. */
static void test_titles(void **state)
{
    (void)state;
    struct sh_err err = {0, ""};
    struct map *map = make(60);
    add(map, 10, 50, NAN, "both", "z 1.00 m");
    add(map, 30, 15, 1, "name", "");
    add(map, 40, 25, 1, "", "z 2.00 m");
    if (map_write_svg(map, path_in("map.svg"), &err) != SH_OK) fail_msg("%s", err.text);
    char *xml = read_text(path_in("map.svg"));
    static const char *const title[] = {"<title>both, z 1.00 m</title>", "<title>name</title>",
                                        "<title>z 2.00 m</title>"};
    for (int i = 0; i < 3; i++)
        if (strstr(xml, title[i]) == NULL) fail_msg("no %s", title[i]);
    free(xml);
    map_free(map);
}

/* ---- the font */

static uint64_t ink_of(const char *text, double *width)
{
    static const uint8_t white[3] = {255, 255, 255}, black[3] = {0, 0, 0};
    const struct picture_type type = {28, 0, 0};
    struct picture p;
    struct sh_err err;
    uint64_t hash = 0;
    assert_int_equal(picture_make(&p, 80, 60, white, &err), SH_OK);
    picture_text(&p, (const double[2]){10, 45}, PICTURE_LEFT, &type, black, text);
    for (uint32_t i = 0; i < 80 * 60; i++)
        if (p.rgb[3 * i] < 128) hash = hash * 1099511628211u + i + 1;
    *width = picture_text_width(&type, text);
    picture_free(&p);
    return hash;
}

/* Each printable character of ASCII and each letter of Latin-1 looks different from all others. None is the box for
 * unknown characters, except the few that the font lacks. */
static void test_font(void **state)
{
    (void)state;
    uint64_t seen[256];
    int n = 0, boxes = 0;
    double width;
    const uint64_t box = ink_of("\xe2\x82\xac", &width); /* the sign of the euro */
    for (int code = 33; code < 256; code++) {
        if (code > 126 && code < 0xc0) continue;
        const char text[3] = {(char)(code < 128 ? code : 0xc0 | code >> 6), (char)(0x80 | (code & 0x3f)), 0};
        const char ascii[2] = {(char)code, 0};
        const uint64_t ink = ink_of(code < 128 ? ascii : text, &width);
        assert_true(ink != 0 && width >= 0);
        boxes += ink == box;
        for (int i = 0; i < n && ink != box; i++)
            if (seen[i] == ink) fail_msg("U+%04X looks as another character", (unsigned)code);
        seen[n++] = ink;
    }
    assert_int_equal(boxes, 7); /* Ae, eth and thorn, each twice, and the sign of division */
    ink_of("H", &width);
    const double one = width;
    ink_of("HH", &width);
    assert_true(fabs(width - (2 * one + 8)) < 1e-9);                             /* GAP of text.c, at a unit a pixel */
    assert_true(ink_of("\xc3", &width) == box && ink_of("\x80", &width) == box); /* broken UTF-8 */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_labels), cmocka_unit_test(test_walls), cmocka_unit_test(test_borders),
        cmocka_unit_test(test_ticks),  cmocka_unit_test(test_svg),   cmocka_unit_test(test_font),
        cmocka_unit_test(test_titles),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
