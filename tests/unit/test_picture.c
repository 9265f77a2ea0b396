/* SPDX-License-Identifier: MIT */
/* Pictures: colours of CIE L*a*b*, fills, triangles and lines by counted pixels, and the elements of an SVG. */
#include <math.h>
#include <signal.h>
#include <stdlib.h>
#include <sys/resource.h>

#include "core/studio/picture.h"
#include "tests/unit/scene_files.h"

static const uint8_t white[3] = {255, 255, 255}, black[3] = {0, 0, 0};
static struct sh_err err;

static struct picture blank(uint32_t width, uint32_t height)
{
    struct picture p;
    assert_int_equal(picture_make(&p, width, height, white, &err), SH_OK);
    return p;
}

/* How much of the pixel is black, 0 to 1. */
static double ink(const struct picture *p, uint32_t column, uint32_t row)
{
    const uint8_t *rgb = p->rgb + 3 * ((size_t)row * p->width + column);
    assert_true(rgb[0] == rgb[1] && rgb[1] == rgb[2]);
    return 1 - rgb[0] / 255.0;
}

static double all_ink(const struct picture *p)
{
    double sum = 0;
    for (uint32_t i = 0; i < p->width * p->height; i++)
        sum += ink(p, i % p->width, i / p->width);
    return sum;
}

/* The primary colours of sRGB in CIE L*a*b* for D65 (B. Lindbloom's tables), greys, and colours beyond the gamut. */
static void colours_of_lab(void **state)
{
    (void)state;
    static const struct {
        double lab[3];
        int rgb[3];
    } row[] = {{{100, 0, 0}, {255, 255, 255}},
               {{0, 0, 0}, {0, 0, 0}},
               {{53.585, 0, 0}, {128, 128, 128}},
               {{5.0, 0, 0}, {17, 17, 17}},
               {{53.2408, 80.0925, 67.2032}, {255, 0, 0}},
               {{87.7347, -86.1827, 83.1793}, {0, 255, 0}},
               {{32.2970, 79.1875, -107.8602}, {0, 0, 255}},
               {{97.1393, -21.5537, 94.4780}, {255, 255, 0}},
               {{100, 200, 0}, {255, -1, 255}}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        uint8_t rgb[3];
        picture_lab(row[i].lab[0], row[i].lab[1], row[i].lab[2], rgb);
        for (int k = 0; k < 3; k++)
            if (row[i].rgb[k] >= 0 && abs(rgb[k] - row[i].rgb[k]) > 1) fail_msg("%zu: %d is %d", i, k, rgb[k]);
    }
}

/* Fills have whole pixels, within the image alone. A blend is a share of both colours. */
static void fills_and_blends(void **state)
{
    (void)state;
    struct picture p = blank(10, 8);
    picture_fill(&p, 2, 3, 4, 2, black);
    for (uint32_t i = 0; i < 80; i++) {
        const uint32_t c = i % 10, r = i / 10;
        assert_true(ink(&p, c, r) == (c >= 2 && c < 6 && r >= 3 && r < 5));
    }
    picture_fill(&p, -3, -3, 4, 4, black);
    picture_fill(&p, 9, 7, 5, 5, black);
    assert_true(all_ink(&p) == 8 + 1 + 1 && ink(&p, 0, 0) == 1 && ink(&p, 9, 7) == 1);
    picture_blend(&p, 5, 0, black, 0.4);
    assert_true(fabs(ink(&p, 5, 0) - 0.4) < 0.003);
    picture_blend(&p, 10, 0, black, 1);
    picture_blend(&p, 0, 8, black, 1);
    picture_blend(&p, -1, 0, black, 1);
    assert_true(fabs(all_ink(&p) - 10.4) < 0.003);
    picture_free(&p);
}

/* A triangle's ink is its area, whichever way round, also where it leaves the image. */
static void triangles_have_their_area(void **state)
{
    (void)state;
    static const double corner[3][3][2] = {
        {{1, 1}, {9, 1}, {1, 9}}, {{2.25, 1.5}, {7.75, 3}, {4, 8.5}}, {{-4, 2}, {4, 2}, {-4, 10}}};
    static const double area[3] = {32, 0, 8}; /* the third is cut by the image; the second is computed below */
    for (int k = 0; k < 3; k++)
        for (int turn = 0; turn < 6; turn++) {
            const int o[3] = {turn % 3, (turn + (turn < 3 ? 1 : 2)) % 3, (turn + (turn < 3 ? 2 : 1)) % 3};
            struct picture p = blank(12, 12);
            double c[3][2];
            for (int i = 0; i < 3; i++)
                memcpy(c[i], corner[k][o[i]], sizeof c[i]);
            picture_triangle(&p, (const double(*)[2])c, black);
            const double(*t)[2] = corner[k];
            const double want =
                k == 1
                    ? 0.5 * fabs((t[1][0] - t[0][0]) * (t[2][1] - t[0][1]) - (t[1][1] - t[0][1]) * (t[2][0] - t[0][0]))
                    : area[k];
            /* 4 x 4 places a pixel; along each pixel of an edge up to one of them is in doubt */
            if (fabs(all_ink(&p) - want) > 30 * 0.0625) fail_msg("%d: %g, not %g", k, all_ink(&p), want);
            picture_free(&p);
        }
    struct picture p = blank(12, 12);
    picture_triangle(&p, (const double[3][2]){{2, 2}, {8, 2}, {2, 8}}, black);
    assert_true(ink(&p, 2, 2) == 1 && ink(&p, 2, 1) == 0 && ink(&p, 1, 2) == 0 && ink(&p, 7, 2) > 0 &&
                ink(&p, 2, 7) > 0);
    assert_true(ink(&p, 8, 2) == 0 && ink(&p, 7, 7) == 0);
    picture_free(&p);
}

/* A triangle within one pixel covers some of its 4 x 4 places. These are at 0.125, 0.375, 0.625 and 0.875. With legs of
 * 0.96 along two sides, the covered places are those whose coordinates add up to 0.96 at most: six. */
static void small_triangles_are_seen(void **state)
{
    (void)state;
    struct picture p = blank(12, 12);
    picture_triangle(&p, (const double[3][2]){{2, 3}, {2.96, 3}, {2, 3.96}}, black);
    assert_true(fabs(ink(&p, 2, 3) - 6 / 16.0) < 0.003 && fabs(all_ink(&p) - 6 / 16.0) < 0.003);
    picture_free(&p);
}

/* A line has round ends: length times width, and a disc. From and to the same place it is the disc alone. */
static void lines_have_their_width(void **state)
{
    (void)state;
    for (int width = 2; width <= 6; width += 2)
        for (int length = 0; length <= 20; length += 10) {
            struct picture p = blank(40, 40);
            picture_line(&p, (const double[2]){8, 20}, (const double[2]){8 + length, 20}, width, black);
            const double want = length * width + M_PI * width * width / 4.0;
            if (fabs(all_ink(&p) - want) > 0.06 * want)
                fail_msg("%d by %d: %g, not %g", length, width, all_ink(&p), want);
            assert_true(ink(&p, 8, 20 + (uint32_t)width / 2 + 1) == 0); /* half a pixel is soft */
            picture_free(&p);
        }
}

/* The ink's columns and rows: the first and the last one of each. */
struct extent {
    long left, right, top, bottom;
};

static struct extent extent_of(const struct picture *p)
{
    struct extent e = {p->width, -1, p->height, -1};
    for (uint32_t i = 0; i < p->width * p->height; i++) {
        const long c = i % p->width, r = i / p->width;
        if (ink(p, (uint32_t)c, (uint32_t)r) <= 0) continue;
        e = (struct extent){c < e.left ? c : e.left, c > e.right ? c : e.right, r < e.top ? r : e.top,
                            r > e.bottom ? r : e.bottom};
    }
    return e;
}

/* Capitals are 28 pixels high. Strokes are 0.11 of that height wide, 3.08, and their border is a pixel wide. Ink goes
 * 1.54 + 0.5 pixels beyond a stroke's end. */
static const struct picture_type TALL = {28, 0, 0};

static struct extent draw_word(const char *text, enum picture_anchor anchor, const struct picture_type *type,
                               double *sum)
{
    struct picture p = blank(240, 60);
    picture_text(&p, (const double[2]){120, 44}, anchor, type, black, text);
    const struct extent e = extent_of(&p);
    if (sum != NULL) *sum = all_ink(&p);
    picture_free(&p);
    return e;
}

/* Returns whether the last pixel with ink is 0.9 to 2.05 pixels beyond the end. Ink reaches 2.04; a round end may miss
 * the next pixel's centre. */
static int ends_at(long pixel, double end, int sign)
{
    const double beyond = sign * ((double)pixel + 0.5 - end);
    return beyond > 0.9 && beyond < 2.05;
}

static void assert_text_fills(const char *text)
{
    const double w = picture_text_width(&TALL, text);
    for (int anchor = PICTURE_LEFT; anchor <= PICTURE_RIGHT; anchor++) {
        const struct extent e = draw_word(text, (enum picture_anchor)anchor, &TALL, NULL);
        const double at = 120 - (anchor == PICTURE_MIDDLE ? w / 2 : anchor == PICTURE_RIGHT ? w : 0);
        if (!ends_at(e.left, at, -1) || !ends_at(e.right, at + w, 1))
            fail_msg("%s: from %ld to %ld, not from %g to %g", text, e.left, e.right, at, at + w);
        if (strspn(text, "ABCDEFGHIJKLMNOPRSTUVWXYZ") == strlen(text))
            assert_true(ends_at(e.top, 44 - 28, -1) && ends_at(e.bottom, 44, 1));
    }
}

/* A text reaches from its left end to its right end, where the anchor says, and capitals stand on its baseline. */
static void texts_have_their_place(void **state)
{
    (void)state;
    for (char c = '!'; c <= '~'; c++)
        assert_text_fills((const char[]){c, '\0'});
    static const char *const words[] = {
        "AB",           "1.5 m",       "LEFT", "\xc2\xb0", "\xc2\xb1\xc2\xb2\xc2\xb7", "\xc3\x97\xc3\x9f",
        "\xe2\x80\x93", "\xe4\xb8\xad"};
    for (size_t i = 0; i < sizeof words / sizeof words[0]; i++)
        assert_text_fills(words[i]);
    assert_true(picture_text_width(&TALL, "A A") > picture_text_width(&TALL, "AA") + 7);
    assert_true(picture_text_width(&TALL, "") <= 0.0);
}

/* A letter with an accent is as wide as without it, and more is drawn: over a capital above its top. */
static void accents_add_no_width(void **state)
{
    (void)state;
    static const char bases[] =
        "AAAAAA CEEEEIIII NOOOOO OUUUUY  aaaaaa ceeeeiiii nooooo ouuuuy y"; /* U+00C0 to U+00FF */
    for (int i = 0; i < 64; i++) {
        const char text[] = {(char)0xc3, (char)(0x80 + i), '\0'}, base[] = {bases[i], '\0'};
        double sum, base_sum;
        if (bases[i] == ' ') continue;
        assert_true(fabs(picture_text_width(&TALL, text) - picture_text_width(&TALL, base)) < 1e-9);
        const struct extent e = draw_word(text, PICTURE_LEFT, &TALL, &sum),
                            plain = draw_word(base, PICTURE_LEFT, &TALL, &base_sum);
        /* a cedilla is below, the stroke of O is within, and an i changes its dot */
        if (strchr("Ccio", bases[i]) == NULL && bases[i] != 'O' && !(e.top < plain.top))
            fail_msg("%d: no accent above", i);
        if (strchr("Cc", bases[i]) != NULL) assert_true(e.bottom > plain.bottom && e.top == plain.top);
        if (bases[i] != 'i' && !(sum > base_sum + 5)) fail_msg("%d: no accent", i);
    }
    /* Capitals' accents are above those of small letters. */
    assert_true(draw_word("\303\211", PICTURE_LEFT, &TALL, NULL).top <
                draw_word("\303\251", PICTURE_LEFT, &TALL, NULL).top);
}

/* A wrong byte is a character that no font has, and nothing is read behind the end. */
static void wrong_bytes_are_boxes(void **state)
{
    (void)state;
    static const struct {
        const char *text, *same;
    } row[] = {{"\377", "\344\270\255"}, {"\200", "\344\270\255"}, {"\360\237\230\200", "\344\270\255"},
               {"\303", "\377"},         {"\344\270", "\377"},     {"\360\237\230", "\377"},
               {"\303A", "\377A"},       {"\344\270A", "\377A"},   {"\360\237\230A", "\377A"},
               {"\300\200", "\377\377"}, {"\301\277", "\377\377"}, {"\303\211\303", "\303\211\377"}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        double sum, same;
        draw_word(row[i].text, PICTURE_LEFT, &TALL, &sum);
        draw_word(row[i].same, PICTURE_LEFT, &TALL, &same);
        if (fabs(sum - same) > 0.01) fail_msg("%zu: %g, not %g", i, sum, same);
    }
}

/* The strokes of I, of 28 units, have round ends. A small text's are 1.2 pixels wide; a bold text's are 0.16 of its
 * height. */
static void texts_have_their_strokes(void **state)
{
    (void)state;
    static const struct {
        struct picture_type type;
        double width;
    } row[] = {{{28, 0, 0}, 3.08}, {{28, 1, 0}, 4.48}, {{8, 0, 0}, 1.2}};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        double sum;
        const double width = row[i].width, want = row[i].type.size_px * width + M_PI * width * width / 4;
        draw_word("I", PICTURE_LEFT, &row[i].type, &sum);
        if (fabs(sum - want) > 0.06 * want) fail_msg("%g, not %g", sum, want);
    }
    struct picture p = blank(40, 60);
    picture_text(&p, (const double[2]){10, 44}, PICTURE_LEFT, &TALL, black, "U");
    for (uint32_t k = 0; k < 2; k++) /* its curve begins and ends at the top */
        assert_true(ink(&p, 9 + k * 18, 16) >= 1 && ink(&p, 10 + k * 18, 16) >= 1);
    for (uint32_t y = 14; y < 36; y++) /* and there is nothing between its sides */
        assert_true(ink(&p, 19, y) <= 0);
    picture_fill(&p, 0, 0, 40, 60, black);
    picture_text(&p, (const double[2]){20, 44}, PICTURE_LEFT, &(struct picture_type){28, 0, 2}, black, "I");
    /* black up to 1.04 and from 4.04 on, white from 2.04 to 3.04, on both sides */
    for (uint32_t k = 0; k < 2; k++)
        assert_true(ink(&p, k ? 19 : 20, 30) >= 1 && ink(&p, k ? 17 : 22, 30) <= 0 && ink(&p, k ? 15 : 24, 30) >= 1);
    picture_free(&p);
}

/* Returns the pixel at a place of a glyph's grid, where picture_text drew the glyph with its left end at (10, 44). */
static double ink_of_glyph(const struct picture *p, double x, double y)
{
    return ink(p, (uint32_t)floor(10 + x), (uint32_t)floor(44 - y));
}

/* The four arcs of O go from the middle of one side to the middle of the next, and the corner draws them. So the middle
 * of an arc is half way from the corner to the middle of the chord, which is 4.3 units from the arc and has no ink.
 * 4 has an upright at 14, and the bow of ( ends 7 to the right of its middle. */
static void glyphs_have_their_shape(void **state)
{
    (void)state;
    struct picture p = blank(60, 60);
    picture_text(&p, (const double[2]){10, 44}, PICTURE_LEFT, &TALL, black, "O");
    for (int k = 0; k < 4; k++) {
        const double to_x = k & 1 ? 1 : -1, to_y = k & 2 ? 1 : -1;
        assert_true(ink_of_glyph(&p, 11 + to_x * 0.75 * 11, 14 + to_y * 0.75 * 14) >= 1);
        assert_true(ink_of_glyph(&p, 11 + to_x * 0.5 * 11, 14 + to_y * 0.5 * 14) <= 0);
    }
    picture_fill(&p, 0, 0, 60, 60, white);
    picture_text(&p, (const double[2]){10, 44}, PICTURE_LEFT, &TALL, black, "4");
    for (double y = 0; y <= 28; y++)
        assert_true(ink_of_glyph(&p, 14, y) >= 1);
    assert_true(ink_of_glyph(&p, 4, 1) <= 0);
    picture_fill(&p, 0, 0, 60, 60, white);
    picture_text(&p, (const double[2]){10, 44}, PICTURE_LEFT, &TALL, black, "(");
    assert_true(ink_of_glyph(&p, 7, 32) >= 1 && ink_of_glyph(&p, 0, 12) >= 1 && ink_of_glyph(&p, 7, -8) >= 1);
    assert_true(ink_of_glyph(&p, 7, 12) <= 0);
    picture_free(&p);
}

static char *svg_text(void (*draw)(struct pen *pen))
{
    struct svg *svg;
    const char *file = path_in("a.svg");
    assert_int_equal(svg_begin(30, 20, "a<b", &svg, &err), SH_OK);
    struct pen pen = svg_pen(svg);
    draw(&pen);
    if (svg_write(svg, "picture", file, &err) != SH_OK) fail_msg("%s", err.text);
    svg_end(svg);
    FILE *in = fopen(file, "rb");
    assert_non_null(in);
    char *text = calloc(1, 8192);
    assert_true(fread(text, 1, 8191, in) > 0);
    fclose(in);
    unlink(file);
    return text;
}

static void draw_marks(struct pen *pen)
{
    static const uint8_t rgb[3] = {1, 171, 255};
    pen->begin(pen->on, "marks", "\"x\" & \xef\xbf\xbe\xef\xbf\xbf\xef\xbf\xbd");
    pen->fill(pen->on, -1, 2, 3, 4, rgb);
    pen->line(pen->on, (const double[2]){0.5, -0.25}, (const double[2]){1.006, 12}, 1.5, rgb);
    pen->triangle(pen->on, (const double[3][2]){{0, 1}, {2.1, -3}, {4.05, 1e12}}, rgb);
    pen->end(pen->on);
}

/* Numbers are in hundredths, without zeros at their ends, and up to 1e9. U+FFFE and U+FFFF are no characters of XML:
 * each of their bytes becomes U+FFFD. */
static void elements_of_an_svg(void **state)
{
    (void)state;
    char *text = svg_text(draw_marks);
    assert_string_equal(
        text,
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" "
        "xmlns:xlink=\"http://www.w3.org/1999/xlink\" version=\"1.1\" width=\"30\" height=\"20\" "
        "viewBox=\"0 0 30 20\">\n<title>a&lt;b</title>\n<rect width=\"30\" height=\"20\" fill=\"#ffffff\"/>\n"
        "<g class=\"marks\">\n<title>&quot;x&quot; &amp; \xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd\xef\xbf\xbd</title>\n"
        "<rect x=\"-1\" y=\"2\" width=\"3\" height=\"4\" fill=\"#01abff\"/>\n"
        "<line x1=\"0.5\" y1=\"-0.25\" x2=\"1.01\" y2=\"12\" stroke-width=\"1.5\" stroke=\"#01abff\" "
        "stroke-linecap=\"round\"/>\n<polygon points=\"0,1 2.1,-3 4.05,1000000000\" fill=\"#01abff\"/>\n"
        "</g>\n</svg>\n");
    free(text);
}

static void draw_texts(struct pen *pen)
{
    static const struct picture_type plain = {7.2, 0, 0}, strong = {14.4, 1, 2.5};
    pen->text(pen->on, (const double[2]){3, 4}, PICTURE_LEFT, &plain, black, "one");
    pen->text(pen->on, (const double[2]){5, 6}, PICTURE_MIDDLE, &strong, black, "two");
    pen->text(pen->on, (const double[2]){7, 8}, PICTURE_RIGHT, &plain, black, "<3");
    pen->text(pen->on, (const double[2]){9, 10}, PICTURE_RIGHT, &plain, black, "");
}

/* Capitals of a sans-serif font are 0.72 of its size. */
static void texts_of_an_svg(void **state)
{
    (void)state;
    static const char *const want[3] = {
        "<text x=\"3\" y=\"4\" font-size=\"10\" textLength=\"%s\" lengthAdjust=\"spacingAndGlyphs\" "
        "font-family=\"sans-serif\" text-anchor=\"start\" fill=\"#000000\">one</text>\n",
        "<text x=\"5\" y=\"6\" font-size=\"20\" textLength=\"%s\" lengthAdjust=\"spacingAndGlyphs\" "
        "font-family=\"sans-serif\" text-anchor=\"middle\" fill=\"#000000\" font-weight=\"bold\" stroke=\"#ffffff\" "
        "paint-order=\"stroke\" stroke-linejoin=\"round\" stroke-width=\"5\">two</text>\n",
        "<text x=\"7\" y=\"8\" font-size=\"10\" textLength=\"%s\" lengthAdjust=\"spacingAndGlyphs\" "
        "font-family=\"sans-serif\" text-anchor=\"end\" fill=\"#000000\">&lt;3</text>\n"};
    static const char *const words[3] = {"one", "two", "<3"};
    char *text = svg_text(draw_texts), *p = strstr(text, "<text ");
    assert_non_null(p);
    for (int i = 0; i < 3; i++) {
        const struct picture_type type = {i == 1 ? 14.4 : 7.2, 0, 0};
        char length[32], line[512];
        snprintf(length, sizeof length, "%.2f", picture_text_width(&type, words[i]));
        for (size_t n = strlen(length); length[n - 1] == '0' || length[n - 1] == '.'; n--) {
            const int is_point = length[n - 1] == '.';
            length[n - 1] = '\0';
            if (is_point) break;
        }
        snprintf(line, sizeof line, want[i], length);
        if (strncmp(p, line, strlen(line)) != 0) fail_msg("not %s in %s", line, p);
        p += strlen(line);
    }
    assert_string_equal(p, "</svg>\n"); /* an empty text is none */
    free(text);
}

/* A file of limited length stands for a full disk. Noise does not become shorter, so the limit is met amid the rows. */
static void the_reason_of_a_failed_write(void **state)
{
    (void)state;
    struct rlimit was, low;
    struct picture p = blank(200, 200);
    uint32_t seed = 1;
    for (size_t i = 0; i < (size_t)3 * 200 * 200; i++)
        p.rgb[i] = (uint8_t)((seed = seed * 1664525 + 1013904223) >> 24);
    signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &was), 0);
    low = (struct rlimit){20000, was.rlim_max};
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &low), 0);
    const int rc = picture_write_png(&p, "map", path_in("full.png"), &err);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &was), 0);
    signal(SIGXFSZ, SIG_DFL);
    assert_int_equal(rc, SH_EIO);
    assert_non_null(strstr(err.text, "full.png"));
    assert_non_null(strstr(err.text, ": File too large"));
    picture_free(&p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(colours_of_lab),
        cmocka_unit_test(fills_and_blends),
        cmocka_unit_test(triangles_have_their_area),
        cmocka_unit_test(small_triangles_are_seen),
        cmocka_unit_test(lines_have_their_width),
        cmocka_unit_test(texts_have_their_place),
        cmocka_unit_test(accents_add_no_width),
        cmocka_unit_test(wrong_bytes_are_boxes),
        cmocka_unit_test(texts_have_their_strokes),
        cmocka_unit_test(glyphs_have_their_shape),
        cmocka_unit_test(the_reason_of_a_failed_write),
        cmocka_unit_test(elements_of_an_svg),
        cmocka_unit_test(texts_of_an_svg),
    };
    return cmocka_run_group_tests(tests, make_folder, remove_folder);
}
