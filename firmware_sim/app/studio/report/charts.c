/* SPDX-License-Identifier: MIT */
/* Charts of a page, as SVG. All places are in units of a picture of 640 by 272. The names of axes and series are text
 * below, which wraps. On a narrow page letters are larger (page.c), so every second figure or name of the lower axis is
 * left out. */
#include <math.h>

#include "core/studio/picture.h"
#include "firmware_sim/app/studio/report/page.h"

enum { WIDTH = 640, HEIGHT = 272, LEFT = 70, RIGHT = 625, TOP = 12, BOTTOM = 245 };

static double y_of(double part)
{
    return BOTTOM - part * (BOTTOM - TOP);
}

static void charts_begin(FILE *out, const char *title)
{
    fprintf(out, "<svg class=\"chart\" viewBox=\"0 0 %d %d\" role=\"img\"><title>", WIDTH, HEIGHT);
    picture_put_escaped(out, title);
    fputs("</title>\n", out);
}

/* Draws the lines of the grid, with their figures in a unit. */
static void put_scale(FILE *out, double most, double per_unit)
{
    const double step = figures_nice(most / 6.5);
    for (double v = 0.0; v <= most * (1.0 + 1e-9); v += step) {
        const double y = y_of(v / most);
        fprintf(out,
                "<line class=\"axis\" x1=\"%d\" y1=\"%.1f\" x2=\"%d\" y2=\"%.1f\"/><text x=\"%d\" y=\"%.1f\" "
                "text-anchor=\"end\">%.6g</text>\n",
                LEFT, y, RIGHT, y, LEFT - 6, y + 4.0, v * per_unit);
    }
}

static void put_axis_name(FILE *out, const char *text)
{
    fputs("<p class=\"key\">", out);
    picture_put_escaped(out, text);
    fputs("</p>\n", out);
}

/* Writes figures below the bins, at multiples of a step. */
static void put_bin_axis(FILE *out, const struct figures_histogram *h, char *name, size_t n)
{
    const double span = h->bins * h->width, last = h->from + span;
    const double most = fmax(fabs(h->from), fabs(last)), step = figures_nice(span / 8.5);
    double per_m;
    const char *unit = page_unit(most, &per_m);
    for (double k = ceil(h->from / step - 1e-9); k * step <= last + 1e-9 * span; k++) {
        const int is_odd = fmod(fabs(k), 2.0) > 0.5;
        const double x = LEFT + (k * step - h->from) / span * (RIGHT - LEFT);
        fprintf(out,
                "<line class=\"axis\" x1=\"%.1f\" y1=\"%d\" x2=\"%.1f\" y2=\"%d\"/><text%s x=\"%.1f\" y=\"%d\" "
                "text-anchor=\"middle\">%.6g</text>\n",
                x, BOTTOM, x, BOTTOM + 5, is_odd ? " class=\"odd\"" : "", x, BOTTOM + 19,
                k == 0.0 ? 0.0 : k * step * per_m);
    }
    snprintf(name, n, "Up: points; to the right: %s. A bar is %.6g %s wide.", unit, h->width * per_m, unit);
}

static void put_curve(FILE *out, const struct figures_histogram *h, double most,
                      double (*curve)(const void *ctx, double from, double to), const void *ctx)
{
    fputs("<polyline class=\"mark\" points=\"", out);
    for (uint32_t k = 0; k < h->bins; k++) {
        const double from = h->from + k * h->width, n = curve(ctx, from, from + h->width);
        fprintf(out, "%.1f,%.1f ", LEFT + (k + 0.5) / h->bins * (RIGHT - LEFT), y_of(n / most));
    }
    fputs("\"/>\n", out);
}

void page_histogram(FILE *out, const char *title, const struct figures_histogram *h,
                    double (*curve)(const void *ctx, double from, double to), const void *ctx)
{
    double most = 1.0;
    char name[96];
    if (h->bins == 0) {
        fputs("<p class=\"soft\">No value.</p>\n", out);
        return;
    }
    for (uint32_t k = 0; k < h->bins; k++) {
        const double from = h->from + k * h->width;
        most = fmax(most, (double)h->count[k]);
        if (curve != NULL) most = fmax(most, curve(ctx, from, from + h->width));
    }
    most *= 1.05;
    charts_begin(out, title);
    put_scale(out, most, 1.0);
    for (uint32_t k = 0; k < h->bins; k++) {
        const double x = LEFT + (double)k / h->bins * (RIGHT - LEFT), wide = (double)(RIGHT - LEFT) / h->bins;
        const double y = y_of((double)h->count[k] / most);
        if (h->count[k] > 0)
            fprintf(out, "<rect class=\"s0\" x=\"%.2f\" y=\"%.2f\" width=\"%.2f\" height=\"%.2f\"/>\n", x, y,
                    fmax(wide - 1.0, 0.5), BOTTOM - y);
    }
    if (curve != NULL) put_curve(out, h, most, curve, ctx);
    put_bin_axis(out, h, name, sizeof name);
    fputs("</svg>\n", out);
    put_axis_name(out, name);
}

/* Names of the series, each after a sample of its colour. */
static void put_legend(FILE *out, const struct page_bars *b)
{
    fputs("<p class=\"key\">", out);
    for (int s = 0; s < PAGE_SERIES; s++) {
        if (b->series[s] == NULL) continue;
        if (s < PAGE_SERIES - 1)
            fprintf(out, "<span><i class=\"s%d\"></i>", s);
        else
            fputs("<span><i class=\"line\"></i>", out);
        picture_put_escaped(out, b->series[s]);
        fputs("</span> ", out);
    }
    fputs("</p>\n", out);
}

/* Returns n, where only each n-th group gets its name, so that the longest name has room. A letter is up to LETTER
 * wide. */
static uint32_t names_apart(const struct page_bars *b)
{
    enum { LETTER = 7, GAP = 8 };
    const double wide = (double)(RIGHT - LEFT) / b->n_groups;
    int longest = 0;
    for (uint32_t g = 0; g < b->n_groups; g++)
        if (page_letters(b->group[g]) > longest) longest = page_letters(b->group[g]);
    return (uint32_t)ceil((double)(longest * LETTER + GAP) / wide);
}

static void put_group(FILE *out, const struct page_bars *b, uint32_t g, uint32_t apart, double most)
{
    const double wide = (double)(RIGHT - LEFT) / b->n_groups, left = LEFT + g * wide,
                 bar = 0.8 * wide / (PAGE_SERIES - 1);
    for (int s = 0; s < PAGE_SERIES; s++) {
        const double v = b->value_m[g][s], y = y_of(v / most);
        if (!isfinite(v)) continue;
        if (s < PAGE_SERIES - 1)
            fprintf(out, "<rect class=\"s%d\" x=\"%.1f\" y=\"%.1f\" width=\"%.1f\" height=\"%.1f\"/>\n", s,
                    left + 0.1 * wide + s * bar, y, fmax(bar - 1.0, 0.5), BOTTOM - y);
        else
            fprintf(out, "<line class=\"mark\" x1=\"%.1f\" y1=\"%.1f\" x2=\"%.1f\" y2=\"%.1f\"/>\n", left + 0.05 * wide,
                    y, left + 0.95 * wide, y);
    }
    if (g % apart != 0) return;
    fprintf(out, "<text%s x=\"%.1f\" y=\"%d\" text-anchor=\"middle\">", g / apart % 2 == 1 ? " class=\"odd\"" : "",
            left + 0.5 * wide, BOTTOM + 17);
    picture_put_escaped(out, b->group[g]);
    fputs("</text>\n", out);
}

void page_bars(FILE *out, const struct page_bars *b)
{
    double most = 0.0, per_m;
    char label[160];
    for (uint32_t g = 0; g < b->n_groups; g++)
        for (int s = 0; s < PAGE_SERIES; s++)
            if (isfinite(b->value_m[g][s])) most = fmax(most, b->value_m[g][s]);
    if (b->n_groups == 0) {
        fputs("<p class=\"soft\">No value.</p>\n", out);
        return;
    }
    most = most > 0.0 ? 1.05 * most : 1e-3;
    const char *unit = page_unit(most, &per_m);
    const uint32_t apart = names_apart(b);
    charts_begin(out, b->title);
    put_scale(out, most, per_m);
    for (uint32_t g = 0; g < b->n_groups; g++)
        put_group(out, b, g, apart, most);
    snprintf(label, sizeof label, "Up: %s; to the right: %s.", unit, b->axis);
    fputs("</svg>\n", out);
    put_axis_name(out, label);
    put_legend(out, b);
}
