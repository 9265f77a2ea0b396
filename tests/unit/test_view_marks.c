/* SPDX-License-Identifier: MIT */
/* Legends and marks on a view: where they are, what they say, and in which colours. Text is found by drawing it once
 * more. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/view.h"

enum { WIDTH = 420, HEIGHT = 300 };

static const uint8_t white[3] = {255, 255, 255};
static struct sh_err err;

static struct picture blank(uint32_t height)
{
    struct picture p;
    assert_int_equal(picture_make(&p, WIDTH, height, white, &err), SH_OK);
    return p;
}

static const uint8_t *at(const struct picture *p, long column, long row)
{
    return p->rgb + 3 * ((size_t)row * p->width + (size_t)column);
}

/* Whether a text stands at x, with its foot in the 40 rows from `top` on, in one of the two styles of views. */
static int has_text(const struct picture *p, const char *text, enum picture_anchor anchor, double x, long top)
{
    enum { FOOT = 20, ROWS = 30 }; /* it is drawn once in a strip, and looked for with its foot in each row */
    static const struct picture_type types[2] = {{11.5, 1, 2.5}, {10.5, 0, 2.5}};
    static const uint8_t ink[3] = {40, 44, 52};
    int found = 0;
    for (int k = 0; k < 2; k++) {
        struct picture one = blank(ROWS);
        picture_text(&one, (const double[2]){x, FOOT}, anchor, &types[k], ink, text);
        for (long y = top; y < top + 40 && !found; y++) {
            int n = 0, same = 1;
            for (long i = 0; i < WIDTH * ROWS && same; i++) {
                const long row = y - FOOT + i / WIDTH;
                if (one.rgb[3 * i] >= 128) continue; /* the strokes alone, without their soft borders */
                n++;
                same = row >= 0 && row < (long)p->height && memcmp(one.rgb + 3 * i, at(p, i % WIDTH, row), 3) == 0;
            }
            found = same && n > 0;
        }
        picture_free(&one);
    }
    return found;
}

/* Blue grows with the value from 0 to 20. No other thing has this red and green. */
static void blues(const void *ctx, double value, uint8_t rgb[3])
{
    (void)ctx;
    rgb[0] = 200;
    rgb[1] = 0;
    rgb[2] = (uint8_t)lrint(fmin(255, fmax(0, value * 10)));
}

static int is_of_bar(const uint8_t *rgb)
{
    return rgb[0] == 200 && rgb[1] == 0;
}

/* Finds the bar's box. Returns 0 where there is none. */
static int find_bar(const struct picture *p, long *left, long *right, long *top, long *bottom)
{
    int n = 0;
    *left = *top = WIDTH;
    *right = *bottom = 0;
    for (long r = 0; r < (long)p->height; r++)
        for (long c = 0; c < WIDTH; c++) {
            if (!is_of_bar(at(p, c, r))) continue;
            *left = c < *left ? c : *left;
            *right = c >= *right ? c + 1 : *right;
            *top = r < *top ? r : *top;
            *bottom = r >= *bottom ? r + 1 : *bottom;
            n++;
        }
    return n == (*right - *left) * (*bottom - *top) ? n : 0;
}

/* Colours go evenly from low to high. Round figures stand below, each with a stroke at its place of the bar. */
static void scale_has_round_figures(void **state)
{
    (void)state;
    static const struct {
        double low, high;
        int n;
        struct {
            double value;
            const char *text;
        } tick[6];
    } row[] = {
        {2, 12, 6, {{2, "2"}, {4, "4"}, {6, "6"}, {8, "8"}, {10, "10"}, {12, "12"}}},
        {1.5, 3.5, 5, {{1.5, "1.5"}, {2, "2.0"}, {2.5, "2.5"}, {3, "3.0"}, {3.5, "3.5"}}},
        {-0.9, 1.1, 4, {{-0.5, "-0.5"}, {0, "0.0"}, {0.5, "0.5"}, {1, "1.0"}}},
        {-13, -3, 5, {{-12, "-12"}, {-10, "-10"}, {-8, "-8"}, {-6, "-6"}, {-4, "-4"}}},
    };
    const struct view_colours colours = {.colour = blues};
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct picture p = blank(120);
        long left, right, top, bottom;
        view_draw_scale(&p, "Range, m", row[i].low, row[i].high, &colours);
        assert_true(find_bar(&p, &left, &right, &top, &bottom));
        for (long c = left; c < right; c++) {
            uint8_t rgb[3];
            const double share = ((double)(c - left) + 0.5) / (double)(right - left);
            blues(NULL, row[i].low + share * (row[i].high - row[i].low), rgb);
            assert_memory_equal(at(&p, c, top), rgb, 3);
        }
        int strokes = 0;
        for (long c = 0; c < WIDTH; c++)
            strokes += at(&p, c, bottom + 2)[0] == 40; /* without labels, which are lower */
        assert_int_equal(strokes, row[i].n);
        for (int k = 0; k < row[i].n; k++) {
            const double share = (row[i].tick[k].value - row[i].low) / (row[i].high - row[i].low);
            const double x = (double)left + share * (double)(right - left);
            assert_int_equal(at(&p, lrint(x - 0.5), bottom + 2)[0], 40);
            if (!has_text(&p, row[i].tick[k].text, PICTURE_MIDDLE, x, bottom)) fail_msg("no %s", row[i].tick[k].text);
        }
        assert_true(has_text(&p, "Range, m", PICTURE_LEFT, (double)left, top - 20));
        picture_free(&p);
    }
    struct picture p = blank(120); /* one value has no steps */
    long left, right, top, bottom;
    view_draw_scale(&p, "Range, m", 12.34567, 12.34567, &colours);
    assert_true(find_bar(&p, &left, &right, &top, &bottom));
    assert_true(has_text(&p, "12.35", PICTURE_LEFT, (double)left, bottom));
    picture_free(&p);
}

/* Counts squares of the entries' colours, and checks that they stand in order, one below the other. */
static uint32_t swatches(const struct picture *p, const struct view_entry *entry, uint32_t n, long *top)
{
    uint32_t found = 0;
    long last = -12, at_column = -1;
    for (uint32_t i = 0; i < n; i++) {
        long first_row = -1, first_column = -1;
        int pixels = 0;
        for (long r = 0; r < (long)p->height; r++)
            for (long c = 0; c < WIDTH; c++) {
                if (memcmp(at(p, c, r), entry[i].rgb, 3) != 0) continue;
                if (pixels++ == 0) first_row = r, first_column = c;
            }
        if (pixels == 0) continue;
        assert_int_equal(pixels, 12 * 12);
        if (first_row < last + 12 || found != i) fail_msg("%u of %u: row %ld after %ld", i, n, first_row, last);
        if (at_column >= 0) assert_int_equal(first_column, at_column);
        if (found == 0) *top = first_row;
        last = first_row;
        at_column = first_column;
        if (!has_text(p, entry[i].name, PICTURE_LEFT, (double)first_column + 20, first_row))
            fail_msg("no %s", entry[i].name);
        found++;
    }
    return found;
}

/* At most twelve lines are shown: twelve names, or eleven and the number of the others. Low pictures have fewer. */
static void names_and_the_number_of_others(void **state)
{
    (void)state;
    static const struct {
        uint32_t n, height, shown;
    } row[] = {{1, 340, 1}, {12, 340, 12}, {13, 340, 11}, {40, 340, 11}, {3, 150, 3}, {4, 150, 2}, {2, 60, 1}};
    struct view_entry entry[40];
    for (uint8_t i = 0; i < 40; i++) {
        entry[i] = (struct view_entry){.rgb = {(uint8_t)(100 + i), (uint8_t)(3 * i), 200}};
        snprintf(entry[i].name, sizeof entry[i].name, "n%u", i);
    }
    for (size_t i = 0; i < sizeof row / sizeof row[0]; i++) {
        struct picture p = blank(row[i].height);
        char more[32];
        long top = 0;
        view_draw_names(&p, "Things", entry, row[i].n);
        const uint32_t shown = swatches(&p, entry, row[i].n, &top);
        if (shown != row[i].shown) fail_msg("%u of %u, not %u", shown, row[i].n, row[i].shown);
        snprintf(more, sizeof more, "and %u more", row[i].n - shown);
        assert_int_equal(has_text(&p, more, PICTURE_LEFT, 24, (long)row[i].height - 50), shown < row[i].n);
        if (row[i].height > 100) assert_true(has_text(&p, "Things", PICTURE_LEFT, 24, top - 30));
        for (long r = (long)row[i].height - 16; r < (long)row[i].height; r++) /* a margin stays free */
            for (long c = 0; c < WIDTH; c++)
                assert_memory_equal(at(&p, c, r), white, 3);
        picture_free(&p);
    }
}

/* Stations beyond any border have neither mark nor name, and don't count. A station just within the left and the lower
 * border is drawn. */
static void stations_beyond_the_image(void **state)
{
    (void)state;
    /* f = 210 pixels; column 210 + 210 x / y, row 150 - 210 z / y */
    const struct view_spec spec = {{{0, 0, 0}, {0, 10, 0}, M_PI / 2, WIDTH, HEIGHT}, 0, 1};
    static const double place[5][2] = {{-11, 0}, {11, 0}, {0, -8}, {0, 8}, {-9.5, -6.7}};
    struct view *view;
    assert_int_equal(view_create(&spec, &view, &err), SH_OK);
    for (int i = 0; i < 5; i++) {
        struct picture p = blank(HEIGHT), none = blank(HEIGHT);
        const struct view_station station = {{place[i][0], 10, place[i][1]}, "gate"};
        assert_int_equal(view_draw_stations(view, &p, &station, 1), 0);
        assert_int_equal(memcmp(p.rgb, none.rgb, 3 * WIDTH * HEIGHT) != 0, i == 4);
        picture_free(&p);
        picture_free(&none);
    }
    view_free(view);
}

/* A name is to the right of its mark, or to the left where the image ends; it is written whole, on the mark's height.
 */
static void names_beside_their_marks(void **state)
{
    (void)state;
    const struct view_spec spec = {{{0, 0, 0}, {0, 10, 0}, M_PI / 2, WIDTH, HEIGHT}, 0, 1};
    struct view *view;
    assert_int_equal(view_create(&spec, &view, &err), SH_OK);
    for (int column = 10; column < WIDTH; column += 40) {
        struct picture p = blank(HEIGHT);
        const struct view_station station = {{10.0 * (column - 210) / 210, 10, 0}, "station"};
        assert_int_equal(view_draw_stations(view, &p, &station, 1), 0);
        long low = WIDTH, high = 0; /* of the name's ink, which is darker than a mark's red */
        for (long r = 0; r < HEIGHT; r++)
            for (long c = 0; c < WIDTH; c++)
                if (at(&p, c, r)[0] == 40) {
                    low = c < low ? c : low;
                    high = c > high ? c : high;
                    assert_true(labs(r - 150) <= 12);
                }
        const struct picture_type type = {11.5, 1, 2.5};
        const double width = picture_text_width(&type, "station");
        const int is_right = column + 14 + width <= WIDTH - 4;
        assert_true(is_right ? low > column + 8 : high < column - 8);
        assert_true(fabs((double)(high - low) - width) < 3); /* the strokes are 2 wide */
        picture_free(&p);
    }
    view_free(view);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scale_has_round_figures),
        cmocka_unit_test(names_and_the_number_of_others),
        cmocka_unit_test(stations_beyond_the_image),
        cmocka_unit_test(names_beside_their_marks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
