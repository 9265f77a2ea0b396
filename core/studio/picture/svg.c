/* SPDX-License-Identifier: MIT */
/* SVG 1.1, and paint-order of SVG 2 where a text has a halo: a text that grows in memory, written at the end. Numbers
 * don't depend on the locale. */
#include <math.h>
#include <nettle/base64.h>
#include <stdlib.h>
#include <string.h>

#include "core/studio/picture/inside.h"
#include "core/utf8.h"

struct svg {
    FILE *out; /* into text */
    char *text;
    size_t size;
};

/* Puts hundredths of a pixel, without zeros at the end. */
static void put_number(FILE *out, double v)
{
    const long hundredths = lrint(fmin(1e9, fmax(-1e9, v)) * 100), a = labs(hundredths);
    fprintf(out, "%s%ld", hundredths < 0 ? "-" : "", a / 100);
    if (a % 100 != 0) fprintf(out, a % 10 == 0 ? ".%01ld" : ".%02ld", a % 10 == 0 ? a % 100 / 10 : a % 100);
}

static void put_attribute(FILE *out, const char *name, double v)
{
    fprintf(out, " %s=\"", name);
    put_number(out, v);
    fputc('"', out);
}

static void put_colour(FILE *out, const char *name, const uint8_t rgb[3])
{
    fprintf(out, " %s=\"#%02x%02x%02x\"", name, rgb[0], rgb[1], rgb[2]);
}

/* Returns the length of a whole UTF-8 character that XML allows; 0: it is none, or it is a control character. */
static int character(const char *p)
{
    const int is_control = (unsigned char)*p < 0x20 || *p == 0x7f;
    const int is_none = strncmp(p, "\xef\xbf\xbe", 3) == 0 || strncmp(p, "\xef\xbf\xbf", 3) == 0; /* U+FFFE, U+FFFF */
    return is_control || is_none ? 0 : utf8_len(p, 4);
}

/* Bytes that are no character of XML, and control characters, become U+FFFD, the sign for that. */
void picture_put_escaped(FILE *out, const char *text)
{
    for (const char *p = text; *p != '\0';) {
        const int n = character(p);
        if (*p == '&')
            fputs("&amp;", out);
        else if (*p == '<')
            fputs("&lt;", out);
        else if (*p == '>')
            fputs("&gt;", out);
        else if (*p == '"')
            fputs("&quot;", out);
        else if (n > 0)
            fwrite(p, 1, (size_t)n, out);
        else
            fputs("\xef\xbf\xbd", out);
        p += n > 0 ? n : 1;
    }
}

int svg_begin(uint32_t width, uint32_t height, const char *title, struct svg **out, struct sh_err *err)
{
    struct svg *svg = calloc(1, sizeof *svg);
    if (svg != NULL) svg->out = open_memstream(&svg->text, &svg->size);
    if (svg == NULL || svg->out == NULL) {
        free(svg);
        return sh_fail(err, SH_ENOMEM, "no memory for an SVG");
    }
    fprintf(svg->out,
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<svg xmlns=\"http://www.w3.org/2000/svg\" "
            "xmlns:xlink=\"http://www.w3.org/1999/xlink\" version=\"1.1\" width=\"%u\" height=\"%u\" "
            "viewBox=\"0 0 %u %u\">\n<title>",
            width, height, width, height);
    picture_put_escaped(svg->out, title);
    fprintf(svg->out, "</title>\n<rect width=\"%u\" height=\"%u\" fill=\"#ffffff\"/>\n", width, height);
    *out = svg;
    return SH_OK;
}

void svg_end(struct svg *svg)
{
    if (svg == NULL) return;
    if (svg->out != NULL) fclose(svg->out);
    free(svg->text);
    free(svg);
}

/* ---- the pen */

static void pen_fill(void *on, long column, long row, long width, long height, const uint8_t rgb[3])
{
    FILE *out = ((struct svg *)on)->out;
    fprintf(out, "<rect x=\"%ld\" y=\"%ld\" width=\"%ld\" height=\"%ld\"", column, row, width, height);
    put_colour(out, "fill", rgb);
    fputs("/>\n", out);
}

static void pen_line(void *on, const double from[2], const double to[2], double width, const uint8_t rgb[3])
{
    FILE *out = ((struct svg *)on)->out;
    fputs("<line", out);
    put_attribute(out, "x1", from[0]);
    put_attribute(out, "y1", from[1]);
    put_attribute(out, "x2", to[0]);
    put_attribute(out, "y2", to[1]);
    put_attribute(out, "stroke-width", width);
    put_colour(out, "stroke", rgb);
    fputs(" stroke-linecap=\"round\"/>\n", out);
}

static void pen_triangle(void *on, const double corner[3][2], const uint8_t rgb[3])
{
    FILE *out = ((struct svg *)on)->out;
    fputs("<polygon points=\"", out);
    for (int i = 0; i < 3; i++) {
        if (i > 0) fputc(' ', out);
        put_number(out, corner[i][0]);
        fputc(',', out);
        put_number(out, corner[i][1]);
    }
    fputc('"', out);
    put_colour(out, "fill", rgb);
    fputs("/>\n", out);
}

/* Capitals of the usual sans-serif fonts are 0.72 of the font's size. The width is that of our own font, so that texts
 * don't reach into each other in any font. */
static void pen_text(void *on, const double at[2], enum picture_anchor anchor, const struct picture_type *type,
                     const uint8_t rgb[3], const char *text)
{
    static const char *const names[] = {"start", "middle", "end"};
    FILE *out = ((struct svg *)on)->out;
    if (text[0] == '\0') return;
    fputs("<text", out);
    put_attribute(out, "x", at[0]);
    put_attribute(out, "y", at[1]);
    put_attribute(out, "font-size", type->size_px / 0.72);
    put_attribute(out, "textLength", picture_text_width(type, text));
    fprintf(out, " lengthAdjust=\"spacingAndGlyphs\" font-family=\"sans-serif\" text-anchor=\"%s\"", names[anchor]);
    put_colour(out, "fill", rgb);
    if (type->bold) fputs(" font-weight=\"bold\"", out);
    if (type->halo_px > 0) {
        fputs(" stroke=\"#ffffff\" paint-order=\"stroke\" stroke-linejoin=\"round\"", out);
        put_attribute(out, "stroke-width", 2 * type->halo_px);
    }
    fputc('>', out);
    picture_put_escaped(out, text);
    fputs("</text>\n", out);
}

static void pen_begin(void *on, const char *class_name, const char *title)
{
    FILE *out = ((struct svg *)on)->out;
    fprintf(out, "<g class=\"%s\">\n<title>", class_name);
    picture_put_escaped(out, title);
    fputs("</title>\n", out);
}

static void pen_end(void *on)
{
    fputs("</g>\n", ((struct svg *)on)->out);
}

struct pen svg_pen(struct svg *svg)
{
    return (struct pen){svg, pen_fill, pen_line, pen_triangle, pen_text, pen_begin, pen_end};
}

/* ---- images and the file */

static int put_uri(FILE *out, const struct picture_part *part, struct sh_err *err)
{
    char *bytes = NULL;
    size_t n = 0;
    FILE *file = open_memstream(&bytes, &n);
    if (file == NULL) return sh_fail(err, SH_ENOMEM, "no memory for an image");
    int rc = picture_encode_png(part, file, err);
    if (fclose(file) != 0 && rc == SH_OK) rc = sh_fail(err, SH_ENOMEM, "no memory for an image");
    const size_t len = BASE64_ENCODE_RAW_LENGTH(n);
    char *text = rc == SH_OK ? malloc(len) : NULL;
    if (rc == SH_OK && text == NULL) rc = sh_fail(err, SH_ENOMEM, "no memory for an image");
    if (rc == SH_OK) {
        base64_encode_raw(text, n, (const uint8_t *)bytes);
        fputs("data:image/png;base64,", out);
        fwrite(text, 1, len, out);
    }
    free(text);
    free(bytes);
    return rc;
}

int picture_put_uri(FILE *out, const struct picture *picture, const uint8_t *clear, struct sh_err *err)
{
    const struct picture_part whole = {picture, 0, 0, picture->width, picture->height, clear};
    return put_uri(out, &whole, err);
}

int svg_image(struct svg *svg, const struct picture_part *part, struct sh_err *err)
{
    fprintf(svg->out,
            "<image x=\"%u\" y=\"%u\" width=\"%u\" height=\"%u\" image-rendering=\"optimizeSpeed\" xlink:href=\"",
            part->column, part->row, part->width, part->height);
    int rc = put_uri(svg->out, part, err);
    fputs("\"/>\n", svg->out);
    return rc;
}

static int copy(const void *source, FILE *file, struct sh_err *why)
{
    const struct svg *svg = source;
    if (fwrite(svg->text, 1, svg->size, file) == svg->size && fflush(file) == 0) return SH_OK;
    return sh_fail(why, SH_EIO, "%m");
}

int svg_write(struct svg *svg, const char *what, const char *path, struct sh_err *err)
{
    fputs("</svg>\n", svg->out);
    const int whole = fclose(svg->out) == 0;
    svg->out = NULL;
    if (!whole) return sh_fail(err, SH_ENOMEM, "%s %s: no memory", what, path);
    return picture_write_file(copy, svg, what, path, err);
}
