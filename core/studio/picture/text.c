/* SPDX-License-Identifier: MIT */
/* Text: UTF-8 -> strokes -> pixels by their distance from the strokes. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/picture/inside.h"

enum { UNITS = 28, GAP = 8, SPACE = 14, MAX_SEGMENTS = 256, CURVE_STEPS = 6 };

struct strokes {
    double from[MAX_SEGMENTS][2], to[MAX_SEGMENTS][2];
    int n;
    double low, high; /* in x */
};

static void add_segment(struct strokes *s, const double from[2], const double to[2])
{
    if (s->n == MAX_SEGMENTS) return;
    memcpy(s->from[s->n], from, sizeof s->from[0]);
    memcpy(s->to[s->n], to, sizeof s->to[0]);
    s->n++;
    s->low = fmin(s->low, fmin(from[0], to[0]));
    s->high = fmax(s->high, fmax(from[0], to[0]));
}

static void add_arc(struct strokes *s, const double a[2], const double control[2], const double b[2])
{
    double last[2] = {a[0], a[1]};
    for (int i = 1; i <= CURVE_STEPS; i++) {
        const double t = (double)i / CURVE_STEPS, u = 1 - t;
        double p[2];
        for (int k = 0; k < 2; k++)
            p[k] = u * u * a[k] + 2 * u * t * control[k] + t * t * b[k];
        add_segment(s, last, p);
        memcpy(last, p, sizeof last);
    }
}

static void middle(const double a[2], const double b[2], double out[2])
{
    out[0] = 0.5 * (a[0] + b[0]);
    out[1] = 0.5 * (a[1] + b[1]);
}

static void add_stroke(struct strokes *s, char kind, double p[][2], int n)
{
    double from[2], to[2];
    if (kind == 'o') {
        for (int i = 0; i < n; i++) {
            middle(p[(i + n - 1) % n], p[i], from);
            middle(p[i], p[(i + 1) % n], to);
            add_arc(s, from, p[i], to);
        }
        return;
    }
    for (int i = 1; i < n && kind != '~'; i++)
        add_segment(s, p[i - 1], p[i]);
    for (int i = 1; i < n - 1 && kind == '~'; i++) {
        middle(p[i - 1], p[i], from);
        middle(p[i], p[i + 1], to);
        add_arc(s, i == 1 ? p[0] : from, p[i], i == n - 2 ? p[n - 1] : to);
    }
}

static void add_strokes(struct strokes *s, const char *text, double dx, double dy)
{
    while (*text != '\0') {
        double p[32][2];
        int n = 0;
        const char kind = *text == '~' || *text == 'o' ? *text++ : ' ';
        while (*text != '\0' && *text != '|' && n < 32) {
            char *end;
            p[n][0] = (double)strtol(text, &end, 10) + dx;
            p[n++][1] = (double)strtol(end + 1, &end, 10) + dy;
            text = *end == ' ' ? end + 1 : end;
        }
        add_stroke(s, kind, p, n);
        if (*text == '|') text++;
    }
}

/* Returns the next character. A wrong byte counts as a character that no font has. */
static uint32_t next_code(const char **text)
{
    const unsigned char *p = (const unsigned char *)*text;
    const int more = *p < 0x80 ? 0 : *p >= 0xc2 && *p < 0xe0 ? 1 : *p >= 0xe0 && *p < 0xf0 ? 2 : *p >= 0xf0 ? 3 : -1;
    uint32_t code = more == 0 ? *p : more > 0 ? *p & (0x3fu >> more) : 0xfffd;
    for (int i = 1; i <= more; i++) {
        if ((p[i] & 0xc0) != 0x80) {
            *text += i;
            return 0xfffd;
        }
        code = code << 6 | (p[i] & 0x3f);
    }
    *text += more > 0 ? more + 1 : 1;
    return code;
}

static void make_glyph(uint32_t code, struct strokes *s)
{
    const char *accent = NULL;
    const uint32_t base = glyph_base(code, &accent);
    const char *strokes = glyph_strokes(base != 0 ? base : code);
    s->n = 0;
    s->low = INFINITY;
    s->high = -INFINITY;
    if (strokes == NULL && code != ' ') strokes = "0,0 14,0 14,26 0,26 0,0";
    if (strokes == NULL) {
        s->low = 0;
        s->high = SPACE - GAP;
        return;
    }
    add_strokes(s, base == 'i' ? "0,20 0,0" : strokes, 0, 0);
    if (accent == NULL) return;
    const double low = s->low, high = s->high;
    const int stays = accent[0] == '_';
    add_strokes(s, accent + stays, 0.5 * (low + high), base < 'a' && !stays ? 8 : 0);
    s->low = low; /* accents add no width */
    s->high = high;
}

double picture_text_width(const struct picture_type *type, const char *text)
{
    struct strokes s;
    double units = 0;
    while (*text != '\0') {
        make_glyph(next_code(&text), &s);
        units += s.high - s.low + GAP;
    }
    return units > 0 ? (units - GAP) * type->size_px / UNITS : 0;
}

static double distance2(const double from[2], const double to[2], double x, double y)
{
    const double d[2] = {to[0] - from[0], to[1] - from[1]}, e[2] = {x - from[0], y - from[1]};
    const double length2 = d[0] * d[0] + d[1] * d[1];
    const double t = length2 > 0 ? fmin(1, fmax(0, (d[0] * e[0] + d[1] * e[1]) / length2)) : 0;
    const double r[2] = {e[0] - t * d[0], e[1] - t * d[1]};
    return r[0] * r[0] + r[1] * r[1];
}

/* Draws strokes, in pixels. Each pixel is blended once, by the nearest stroke. */
static void draw_strokes(struct picture *picture, const struct strokes *s, double width, const uint8_t rgb[3])
{
    if (s->n == 0) return;
    const double reach = 0.5 * width + 1;
    double box[4] = {INFINITY, INFINITY, -INFINITY, -INFINITY};
    for (int i = 0; i < s->n; i++)
        for (int k = 0; k < 2; k++) {
            box[k] = fmin(box[k], fmin(s->from[i][k], s->to[i][k]) - reach);
            box[2 + k] = fmax(box[2 + k], fmax(s->from[i][k], s->to[i][k]) + reach);
        }
    const long last_column = (long)fmin(box[2], (double)picture->width);
    const long last_row = (long)fmin(box[3], (double)picture->height);
    for (long row = (long)fmax(0, box[1]); row <= last_row; row++)
        for (long column = (long)fmax(0, box[0]); column <= last_column; column++) {
            double nearest = INFINITY;
            for (int i = 0; i < s->n; i++)
                nearest = fmin(nearest, distance2(s->from[i], s->to[i], (double)column + 0.5, (double)row + 0.5));
            const double coverage = 0.5 * width + 0.5 - sqrt(nearest);
            if (coverage > 0) picture_blend(picture, column, row, rgb, fmin(1, coverage));
        }
}

static void draw_text(struct picture *picture, const double at[2], const struct picture_type *type, double width,
                      const uint8_t rgb[3], const char *text)
{
    const double scale = type->size_px / UNITS, y = at[1];
    double x = at[0];
    struct strokes s;
    while (*text != '\0') {
        make_glyph(next_code(&text), &s);
        for (int i = 0; i < s.n; i++) {
            double *const end[2] = {s.from[i], s.to[i]};
            for (int k = 0; k < 2; k++) {
                end[k][0] = x + (end[k][0] - s.low) * scale;
                end[k][1] = y - end[k][1] * scale;
            }
        }
        draw_strokes(picture, &s, width, rgb);
        x += (s.high - s.low + GAP) * scale;
    }
}

void picture_text(struct picture *picture, const double at[2], enum picture_anchor anchor,
                  const struct picture_type *type, const uint8_t rgb[3], const char *text)
{
    static const uint8_t white[3] = {255, 255, 255};
    const double width = fmax(1.2, type->size_px * (type->bold ? 0.16 : 0.11));
    double from[2] = {at[0], at[1]};
    if (anchor != PICTURE_LEFT) from[0] -= picture_text_width(type, text) * (anchor == PICTURE_RIGHT ? 1 : 0.5);
    if (type->halo_px > 0) draw_text(picture, from, type, width + 2 * type->halo_px, white, text);
    draw_text(picture, from, type, width, rgb, text);
}

void picture_line(struct picture *picture, const double from[2], const double to[2], double width, const uint8_t rgb[3])
{
    struct strokes s = {.n = 0};
    add_segment(&s, from, to);
    draw_strokes(picture, &s, width, rgb);
}
