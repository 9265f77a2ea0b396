/* SPDX-License-Identifier: MIT */
/* Charts of the report's page: bars are as high as their counts, and figures of the axes are at their values. */
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "firmware_sim/app/studio/report/page.h"

/* The values of charts.c, in units of the picture. Places are written with one or two decimals. */
static const double LEFT = 70.0, RIGHT = 625.0, BOTTOM = 245.0, ROUNDED = 0.051;

static const struct figures_histogram DEVIATIONS = {.from = -0.002, .width = 0.001, .bins = 4, .count = {0, 10, 5, 1}};

static char *drawn(void (*draw)(FILE *out))
{
    char *text = NULL;
    size_t len;
    FILE *out = open_memstream(&text, &len);
    assert_non_null(out);
    draw(out);
    assert_int_equal(fclose(out), 0);
    return text;
}

static void draw_histogram(FILE *out)
{
    page_histogram(out, "deviations", &DEVIATIONS, NULL, NULL);
}

struct rect {
    double x, y, width, height;
};

/* Finds the next bar of a class after *at, and moves *at on. */
static int next_bar(const char **at, const char *class, struct rect *r)
{
    char begin[40];
    snprintf(begin, sizeof begin, "<rect class=\"%s\"", class);
    const char *found = strstr(*at, begin);
    if (found == NULL) return 0;
    assert_int_equal(sscanf(found + strlen(begin), " x=\"%lf\" y=\"%lf\" width=\"%lf\" height=\"%lf\"", &r->x, &r->y,
                            &r->width, &r->height),
                     4);
    *at = found + 1;
    return 1;
}

static void near(const char *what, double got, double want, double tolerance)
{
    if (!(fabs(got - want) <= tolerance)) fail_msg("%s: %g, and it should be %g", what, got, want);
}

static void test_bars_stand_on_the_axis(void **state)
{
    (void)state;
    char *svg = drawn(draw_histogram);
    assert_non_null(strstr(svg, " viewBox=\"0 0 640 272\" "));
    const char *at = svg;
    struct rect bar[5];
    int n = 0;
    while (n < 5 && next_bar(&at, "s0", &bar[n]))
        n++;
    assert_int_equal(n, 3); /* the first bin is empty */
    for (int i = 0; i < 3; i++) {
        near("foot", bar[i].y + bar[i].height, BOTTOM, ROUNDED);
        near("place", bar[i].x, LEFT + (i + 1) * (RIGHT - LEFT) / 4.0, ROUNDED);
        near("height", bar[i].height / bar[0].height, (double)DEVIATIONS.count[i + 1] / 10.0, 1e-3);
    }
    free(svg);
}

/* Figures are in mm, each in its place. The scale at the left side is of counts. */
static void test_axis_of_bins(void **state)
{
    (void)state;
    char *svg = drawn(draw_histogram);
    int n = 0;
    for (const char *at = svg; (at = strstr(at, "text-anchor=\"middle\">")) != NULL; n++) {
        const double mm = atof(at + strlen("text-anchor=\"middle\">"));
        const char *x = at;
        while (strncmp(x, "<text", 5) != 0)
            x--;
        near("figure", atof(strstr(x, "x=\"") + 3), LEFT + (mm + 2.0) / 4.0 * (RIGHT - LEFT), ROUNDED);
        near("below", atof(strstr(x, " y=\"") + 4), BOTTOM + 19.0, ROUNDED);
        /* Steps are of 0.5 mm; every second figure is left out where the page is narrow. */
        assert_int_equal(strncmp(x, "<text class=\"odd\"", 17) == 0, fmod(fabs(mm) / 0.5, 2.0) > 0.5);
        at++;
    }
    assert_true(n >= 5);
    assert_non_null(strstr(svg, "to the right: mm. A bar is 1 mm wide."));
    free(svg);
}

/* A line of the scale goes from side to side at its value. Its figure ends 6 units before the line. Digits of 12 units
 * are some 8.6 high, so their middle is on the line when they stand 4.3 below it. */
static void test_scale(void **state)
{
    static const char line[] = "<line class=\"axis\" x1=\"70\"";
    (void)state;
    char *svg = drawn(draw_histogram);
    const char *bars = svg;
    struct rect ten; /* the bar of 10 */
    int n = 0;
    assert_true(next_bar(&bars, "s0", &ten));
    for (const char *at = svg; (at = strstr(at, line)) != NULL; n++, at++) {
        double x2, y[2], text_x, text_y, value;
        assert_int_equal(sscanf(at + strlen(line),
                                " y1=\"%lf\" x2=\"%lf\" y2=\"%lf\"/><text x=\"%lf\" y=\"%lf\" "
                                "text-anchor=\"end\">%lf",
                                &y[0], &x2, &y[1], &text_x, &text_y, &value),
                         6);
        near("end", x2, RIGHT, 0.0);
        near("level", y[1], y[0], 0.0);
        near("value", (BOTTOM - y[0]) / ten.height, value / 10.0, 1e-3);
        near("figure's end", text_x, LEFT - 6.0, 0.0);
        near("figure's middle", text_y - 4.3, y[0], 0.5);
    }
    assert_true(n >= 3);
    free(svg);
}

static void draw_bars(FILE *out)
{
    static const char group[2][32] = {"0-10", "10-20"};
    static const double value_m[2][PAGE_SERIES] = {{0.001, 0.002, 0.004, 0.003}, {0.002, (double)NAN, 0.004, 0.003}};
    const struct page_bars bars = {.title = "by range",
                                   .axis = "range (m)",
                                   .series = {"mean", "RMS", "most", "expected"},
                                   .n_groups = 2,
                                   .group = group,
                                   .value_m = value_m};
    page_bars(out, &bars);
}

/* Bars are side by side in the group's part of the axis. An unknown value has no bar, and an expected one is a line. */
static void test_groups(void **state)
{
    (void)state;
    char *svg = drawn(draw_bars);
    const char *const class[3] = {"s0", "s1", "s2"};
    static const int in_group[3][2] = {{1, 1}, {1, 0}, {1, 1}};
    double height_of_mm = 0.0;
    for (int s = 0; s < 3; s++) {
        const char *at = svg;
        for (int g = 0; g < 2; g++) {
            struct rect bar;
            if (!in_group[s][g]) continue;
            assert_true(next_bar(&at, class[s], &bar));
            near("foot", bar.y + bar.height, BOTTOM, 2.0 * ROUNDED);
            assert_true(bar.x > LEFT + g * (RIGHT - LEFT) / 2.0);
            assert_true(bar.x + bar.width < LEFT + (g + 1) * (RIGHT - LEFT) / 2.0);
            const double mm = s == 0 ? 1.0 + g : s == 1 ? 2.0 : 4.0;
            if (height_of_mm == 0.0) height_of_mm = bar.height / mm;
            near("height", bar.height / mm, height_of_mm, 2.0 * ROUNDED);
        }
    }
    /* A step is 1, 2 or 5 times a power of ten. At most 6.5 steps fit, and at least 2.6. Zero has a line, too. */
    int lines = 0;
    for (const char *at = svg; (at = strstr(at, "<line class=\"axis\" x1=\"70\"")) != NULL; at++)
        lines++;
    assert_true(lines >= 3 && lines <= 7);
    const char *mark = strstr(svg, "<line class=\"mark\"");
    assert_non_null(mark);
    near("mark's begin", atof(strstr(mark, "x1=\"") + 4), LEFT + 0.05 * (RIGHT - LEFT) / 2.0, ROUNDED);
    near("mark's end", atof(strstr(mark, "x2=\"") + 4), LEFT + 0.95 * (RIGHT - LEFT) / 2.0, ROUNDED);
    near("expected", BOTTOM - atof(strstr(mark, "y1=\"") + 4), 3.0 * height_of_mm, 4.0 * ROUNDED);
    free(svg);
}

/* ---- edges: the first and the last bin, the curve, the scale */

static const struct figures_histogram ENDS = {.from = 0.0, .width = 0.5, .bins = 5, .count = {14, 0, 0, 0, 7}};

/* Expects 20 points in the second bin alone, more than any bin has. */
static double expected(const void *ctx, double from, double to)
{
    assert_ptr_equal(ctx, &ENDS);
    assert_true(fabs(to - from - 0.5) < 1e-12);
    return fabs(from - 0.5) < 1e-9 ? 20.0 : 0.0;
}

static void draw_ends(FILE *out)
{
    page_histogram(out, "a & b", &ENDS, expected, &ENDS);
}

/* The tallest figure takes 1 / 1.05 of the height, from 12 to 245. Bars, curve and scale share their unit. */
static void test_ends_and_curve(void **state)
{
    (void)state;
    char *svg = drawn(draw_ends);
    const char *at = svg;
    struct rect first, last, none;
    assert_true(next_bar(&at, "s0", &first) && next_bar(&at, "s0", &last));
    assert_false(next_bar(&at, "s0", &none));
    const double unit = first.height / 14.0, wide = (RIGHT - LEFT) / 5.0;
    near("first", first.x, LEFT, ROUNDED);
    near("last", last.x, LEFT + 4.0 * wide, ROUNDED);
    near("width", last.width, wide - 1.0, ROUNDED);
    near("height", last.height, 7.0 * unit, ROUNDED);
    double x, y;
    int used;
    const char *curve =
        strstr(svg, "<polyline class=\"mark\" points=\"") + strlen("<polyline class=\"mark\" points=\"");
    for (int k = 0; k < 5; k++, curve += used) {
        assert_int_equal(sscanf(curve, "%lf,%lf %n", &x, &y, &used), 2);
        near("curve", x, LEFT + (k + 0.5) * wide, ROUNDED);
        near("curve", BOTTOM - y, k == 1 ? 20.0 * unit : 0.0, 2.0 * ROUNDED);
    }
    assert_int_equal(*curve, '"');
    int n = 0;
    double most = 0.0;
    for (const char *p = svg; (p = strstr(p, "text-anchor=\"end\">")) != NULL; n++, p++) {
        const double v = atof(p + strlen("text-anchor=\"end\">"));
        const char *line = p;
        while (strncmp(line, "y1=\"", 4) != 0)
            line--;
        near("scale", BOTTOM - atof(line + 4), v * unit, 2.0 * ROUNDED);
        most = fmax(most, v);
    }
    assert_true(n >= 3 && most <= 21.0 && most > 14.0);
    assert_non_null(strstr(svg, "a &amp; b"));
    assert_non_null(strstr(svg, "Up: points; to the right: m. A bar is 0.5 m wide."));
    free(svg);
}

static void draw_one(FILE *out)
{
    page_histogram(out, "t", &(struct figures_histogram){.from = 0, .width = 1, .bins = 1, .count = {1}}, NULL, NULL);
}

/* A bar of one point is as high as any other tallest one: 1 / 1.05 of the height from 12 to 245. */
static void test_one_point(void **state)
{
    (void)state;
    char *svg = drawn(draw_one);
    const char *at = svg;
    struct rect bar;
    assert_true(next_bar(&at, "s0", &bar));
    near("height", bar.height, (BOTTOM - 12.0) / 1.05, ROUNDED);
    near("foot", bar.y + bar.height, BOTTOM, 2.0 * ROUNDED);
    free(svg);
}

static void draw_nothing(FILE *out)
{
    page_histogram(out, "t", &(struct figures_histogram){.bins = 0}, NULL, NULL);
    page_bars(out, &(struct page_bars){.title = "t", .axis = "a", .series = {"s"}});
}

static void test_without_values(void **state)
{
    (void)state;
    char *svg = drawn(draw_nothing);
    assert_string_equal(svg, "<p class=\"soft\">No value.</p>\n<p class=\"soft\">No value.</p>\n");
    free(svg);
}

/* Names of 23 letters take 7 units a letter and 8 more, 169 in all; three groups have 166.5. Each fourth name is there,
 * and where the picture is narrow, only each second one of these. */
static void draw_many(FILE *out)
{
    static char group[10][32];
    static double value_m[10][PAGE_SERIES];
    for (int g = 0; g < 10; g++) {
        snprintf(group[g], sizeof group[g], "group-number-%010d", g);
        value_m[g][0] = 1e-6 * (g + 1);
        value_m[g][1] = value_m[g][2] = value_m[g][3] = (double)NAN;
    }
    const struct page_bars bars = {.title = "t",
                                   .axis = "a",
                                   .series = {"mean", NULL, "x<y", "expected"},
                                   .n_groups = 10,
                                   .group = (const char(*)[32])group,
                                   .value_m = (const double(*)[PAGE_SERIES])value_m};
    page_bars(out, &bars);
}

static void test_names_of_groups(void **state)
{
    (void)state;
    char *svg = drawn(draw_many), text[128];
    for (int g = 0; g < 10; g++) {
        snprintf(text, sizeof text, "<text%s x=\"%.1f\" y=\"262\" text-anchor=\"middle\">group-number-%010d</text>\n",
                 g / 4 % 2 == 1 ? " class=\"odd\"" : "", LEFT + (g + 0.5) * (RIGHT - LEFT) / 10.0, g);
        assert_int_equal(strstr(svg, text) != NULL, g % 4 == 0);
    }
    const char *at = svg;
    struct rect bar;
    for (int g = 0; g < 10; g++) { /* a third of 0.8 of the group, less a gap of 1 */
        assert_true(next_bar(&at, "s0", &bar));
        near("left", bar.x, LEFT + (g + 0.1) * 55.5, ROUNDED);
        near("width", bar.width, 0.8 * 55.5 / 3.0 - 1.0, ROUNDED);
    }
    near("tallest", bar.height, (BOTTOM - 12.0) / 1.05, 2.0 * ROUNDED);
    int n = 0;
    for (const char *p = svg; (p = strstr(p, "text-anchor=\"end\">")) != NULL; n++, p++) { /* of 10 um in all */
        const char *line = p;
        while (strncmp(line, "y1=\"", 4) != 0)
            line--;
        near("scale", BOTTOM - atof(line + 4), atof(p + strlen("text-anchor=\"end\">")) * bar.height / 10.0,
             2.0 * ROUNDED);
    }
    assert_true(n >= 3);
    assert_non_null(strstr(svg,
                           "<p class=\"key\"><span><i class=\"s0\"></i>mean</span> <span><i class=\"s2\"></i>x&lt;y"
                           "</span> <span><i class=\"line\"></i>expected</span> </p>\n"));
    assert_non_null(strstr(svg, "Up: \xc2\xb5m; to the right: a."));
    free(svg);
}

/* ---- figures as text */

static void draw_figures(FILE *out)
{
    static const double lengths[] = {12345,      123.46, 12.346, 1.2346, 0.9995, 0.99949,  0.0123457,
                                     0.00099951, 2e-6,   3e-9,   0.0,    NAN,    INFINITY, -0.25};
    static const uint64_t counts[] = {0, 999, 1000, 1234567};
    static const double numbers[] = {NAN, 0.12346, 999.9, 1000.4, 12345.6, 1e15};
    for (size_t i = 0; i < sizeof lengths / sizeof lengths[0]; i++, fputc(';', out))
        page_length(out, lengths[i], 0);
    page_length(out, 0.25, 1);
    fputc(';', out);
    page_length(out, -2e-6, 1);
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; i++)
        fputc(';', out), page_count(out, counts[i]);
    for (size_t i = 0; i < sizeof numbers / sizeof numbers[0]; i++)
        fputc(';', out), page_number(out, numbers[i]);
}

/* Figures have four digits, with three decimals at most, in the largest unit that makes the rounded figure 1 or
 * more. */
static void test_figures_as_text(void **state)
{
    (void)state;
    char *text = drawn(draw_figures);
    assert_string_equal(text, "12345&nbsp;m;123.5&nbsp;m;12.35&nbsp;m;1.235&nbsp;m;1.000&nbsp;m;999.5&nbsp;mm;"
                              "12.35&nbsp;mm;1.000&nbsp;mm;2.000&nbsp;\xc2\xb5m;3.000&nbsp;nm;0&nbsp;mm;\xe2\x80\x93;"
                              "\xe2\x88\x9e;-250.0&nbsp;mm;+250.0&nbsp;mm;-2.000&nbsp;\xc2\xb5m;0;999;1,000;1,234,567;"
                              "\xe2\x80\x93;0.1235;999.9;1,000;12,346;1e+15");
    free(text);
    assert_int_equal(page_letters("a\xc2\xb5"
                                  "b"),
                     3);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bars_stand_on_the_axis),
        cmocka_unit_test(test_axis_of_bins),
        cmocka_unit_test(test_scale),
        cmocka_unit_test(test_groups),
        cmocka_unit_test(test_ends_and_curve),
        cmocka_unit_test(test_one_point),
        cmocka_unit_test(test_without_values),
        cmocka_unit_test(test_names_of_groups),
        cmocka_unit_test(test_figures_as_text),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
