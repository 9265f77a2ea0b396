#include "drivers/record/colour.h"

#include <math.h>
#include <string.h>

static const double BLACK_DB = -30;

static void of_reflectance(double db, uint8_t rgb[3])
{
    static const uint8_t unknown[3] = {96, 128, 255};
    if (isnan(db)) {
        memcpy(rgb, unknown, 3);
        return;
    }
    memset(rgb, (int)lrint(255 * (1 - fmin(1, fmax(0, db / BLACK_DB)))), 3);
}

/* Hues a golden section of the circle apart: however many surfaces there are, neighbours in number differ. */
static void of_label(uint16_t label, uint8_t rgb[3])
{
    const double golden = 0.6180339887498949, hue = 6 * fmod(label * golden, 1.0);
    for (int i = 0; i < 3; i++) { /* red is strongest at hue 0, green at 2, blue at 4 */
        double away = fabs(remainder(hue - 2 * i, 6));
        rgb[i] = (uint8_t)lrint(64 + 176 * fmin(1, fmax(0, 2 - away)));
    }
}

void colour_of(enum colour_kind kind, const struct scanhead_point *point, uint8_t rgb[3])
{
    memset(rgb, 128, 3);
    if (kind == COLOUR_REFLECTANCE) of_reflectance(point->reflectance_db, rgb);
    if (kind == COLOUR_LABEL && point->label != SCANHEAD_NO_LABEL) of_label(point->label, rgb);
}
