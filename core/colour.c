/* SPDX-License-Identifier: MIT */
#include "core/colour.h"

#include <math.h>
#include <string.h>

const uint8_t colour_unknown[3] = {96, 128, 255};
const uint8_t colour_grey[3] = {128, 128, 128};

const char *const colour_words[COLOUR_MODES] = {
    [COLOUR_NONE] = "none",     [COLOUR_SOLID] = "solid",     [COLOUR_RANGE] = "range",
    [COLOUR_HEIGHT] = "height", [COLOUR_LABEL] = "label",     [COLOUR_REFLECTANCE] = "reflectance",
    [COLOUR_FRAME] = "frame",   [COLOUR_TEXTURE] = "texture",
};

static const double BLACK_DB = -30;

void colour_ramp(double part, uint8_t rgb[3])
{
    static const double knot[4][3] = {{0, 0, 255}, {0, 255, 0}, {255, 255, 0}, {255, 0, 0}};
    if (isnan(part)) {
        memcpy(rgb, colour_unknown, 3);
        return;
    }
    const double at = 3.0 * fmin(1.0, fmax(0.0, part));
    const int from = at < 2.0 ? (int)at : 2;
    for (int i = 0; i < 3; i++)
        rgb[i] = (uint8_t)lrint(knot[from][i] + (at - from) * (knot[from + 1][i] - knot[from][i]));
}

double colour_srgb_encode(double linear)
{
    return linear <= 0.0031308 ? 12.92 * linear : 1.055 * pow(linear, 1.0 / 2.4) - 0.055;
}

double colour_srgb_decode(double srgb)
{
    return srgb <= 0.04045 ? srgb / 12.92 : pow((srgb + 0.055) / 1.055, 2.4);
}

void colour_between(double low, double high, double figure, uint8_t rgb[3])
{
    colour_ramp(high > low || isnan(figure) ? (figure - low) / (high - low) : 0.0, rgb);
}

void colour_reflectance(double db, uint8_t rgb[3])
{
    if (isnan(db))
        memcpy(rgb, colour_unknown, 3);
    else
        memset(rgb, (int)lrint(255 * (1 - fmin(1, fmax(0, db / BLACK_DB)))), 3);
}

void colour_number(uint32_t number, uint8_t rgb[3])
{
    const double golden = 0.6180339887498949, hue = 6 * fmod(number * golden, 1.0);
    for (int i = 0; i < 3; i++) { /* red is strongest at hue 0, green at 2, blue at 4 */
        double away = fabs(remainder(hue - 2 * i, 6));
        rgb[i] = (uint8_t)lrint(64 + 176 * fmin(1, fmax(0, 2 - away)));
    }
}
