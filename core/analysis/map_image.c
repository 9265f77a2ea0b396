/* Colours and the few marks a map needs. */
#include <math.h>
#include <string.h>

#include "core/analysis/map_inside.h"
#include "core/angle.h"

static double srgb_encode(double linear)
{
    /* IEC 61966-2-1 */
    const double v = fmin(1, fmax(0, linear));
    return v <= 0.0031308 ? 12.92 * v : 1.055 * pow(v, 1 / 2.4) - 0.055;
}

static double lab_inverse(double t)
{
    return t > 6.0 / 29 ? t * t * t : 3 * (6.0 / 29) * (6.0 / 29) * (t - 4.0 / 29);
}

/* CIE 1976 L*a*b* (white D65) to sRGB; what lies outside the gamut is moved to its border. */
static void lab_to_srgb(double l, double a, double b, uint8_t rgb[3])
{
    const double fy = (l + 16) / 116;
    const double x = 0.95047 * lab_inverse(fy + a / 500), y = lab_inverse(fy), z = 1.08883 * lab_inverse(fy - b / 200);
    const double linear[3] = {3.2404542 * x - 1.5371385 * y - 0.4985314 * z,
                              -0.9692660 * x + 1.8760108 * y + 0.0415560 * z,
                              0.0556434 * x - 0.2040259 * y + 1.0572252 * z};
    for (int i = 0; i < 3; i++)
        rgb[i] = (uint8_t)lrint(255 * srgb_encode(linear[i]));
}

void map_colour(double structure, double height, uint8_t rgb[3])
{
    /* From blue over green and yellow to red, away from the purple that would close the circle. */
    const double hue_rad = angle_rad(255 - 205 * height);
    const double lightness = 90 - 70 * structure;
    const double chroma = (12 + 20 * height) * (1 - 0.45 * structure);
    lab_to_srgb(lightness, chroma * cos(hue_rad), chroma * sin(hue_rad), rgb);
}

/* Fills a pixel, blended by coverage 0..1; outside the image nothing happens. */
static void blend(struct map_image *image, long column, long row, const uint8_t rgb[3], double coverage)
{
    if (column < 0 || row < 0 || column >= (long)image->width || row >= (long)image->height) return;
    uint8_t *at = image->rgb + ((size_t)row * image->width + (size_t)column) * 3;
    for (int i = 0; i < 3; i++)
        at[i] = (uint8_t)lrint(at[i] + (rgb[i] - at[i]) * coverage);
}

void map_image_fill(struct map_image *image, long column, long row, long width, long height, const uint8_t rgb[3])
{
    for (long r = row; r < row + height; r++)
        for (long c = column; c < column + width; c++)
            blend(image, c, r, rgb, 1);
}

/* 5 x 7 dots, a byte per row, the left dot is bit 4. */
static const char glyph_of[] = "0123456789+-.mkN";
static const uint8_t glyph[][7] = {
    {0x0e, 0x11, 0x11, 0x11, 0x11, 0x11, 0x0e}, {0x04, 0x0c, 0x04, 0x04, 0x04, 0x04, 0x0e},
    {0x0e, 0x11, 0x01, 0x02, 0x04, 0x08, 0x1f}, {0x1f, 0x02, 0x04, 0x02, 0x01, 0x11, 0x0e},
    {0x02, 0x06, 0x0a, 0x12, 0x1f, 0x02, 0x02}, {0x1f, 0x10, 0x1e, 0x01, 0x01, 0x11, 0x0e},
    {0x06, 0x08, 0x10, 0x1e, 0x11, 0x11, 0x0e}, {0x1f, 0x01, 0x02, 0x04, 0x04, 0x04, 0x04},
    {0x0e, 0x11, 0x11, 0x0e, 0x11, 0x11, 0x0e}, {0x0e, 0x11, 0x11, 0x0f, 0x01, 0x02, 0x0c},
    {0x00, 0x04, 0x04, 0x1f, 0x04, 0x04, 0x00}, {0x00, 0x00, 0x00, 0x1f, 0x00, 0x00, 0x00},
    {0x00, 0x00, 0x00, 0x00, 0x00, 0x0c, 0x0c}, {0x00, 0x00, 0x1a, 0x15, 0x15, 0x15, 0x15},
    {0x10, 0x10, 0x12, 0x14, 0x18, 0x14, 0x12}, {0x11, 0x19, 0x19, 0x15, 0x13, 0x13, 0x11},
};

void map_image_text(struct map_image *image, long column, long row, long dot, const uint8_t rgb[3], const char *text)
{
    for (; *text != '\0'; text++, column += 6 * dot) {
        const char *found = strchr(glyph_of, *text);
        if (found == NULL) continue; /* a space */
        const uint8_t *rows = glyph[found - glyph_of];
        for (long y = 0; y < 7; y++)
            for (long x = 0; x < 5; x++)
                if ((rows[y] >> (4 - x) & 1) != 0)
                    map_image_fill(image, column + x * dot, row + y * dot, dot, dot, rgb);
    }
}

static int inside(const double corner[3][2], double x, double y)
{
    int left = 0, right = 0;
    for (int i = 0; i < 3; i++) {
        const double *p = corner[i], *q = corner[(i + 1) % 3];
        const double side = (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]);
        left |= side > 0;
        right |= side < 0;
    }
    return !(left && right);
}

void map_image_triangle(struct map_image *image, const double corner[3][2], const uint8_t rgb[3])
{
    enum { SUB = 4 }; /* sub-pixels per side, for even edges */
    const double min_x = fmin(corner[0][0], fmin(corner[1][0], corner[2][0]));
    const double max_x = fmax(corner[0][0], fmax(corner[1][0], corner[2][0]));
    const double min_y = fmin(corner[0][1], fmin(corner[1][1], corner[2][1]));
    const double max_y = fmax(corner[0][1], fmax(corner[1][1], corner[2][1]));
    for (long row = (long)floor(min_y); row <= (long)max_y; row++)
        for (long column = (long)floor(min_x); column <= (long)max_x; column++) {
            int hits = 0;
            for (int s = 0; s < SUB * SUB; s++)
                hits += inside(corner, (double)column + (s % SUB + 0.5) / SUB, (double)row + (s / SUB + 0.5) / SUB);
            if (hits > 0) blend(image, column, row, rgb, (double)hits / (SUB * SUB));
        }
}
