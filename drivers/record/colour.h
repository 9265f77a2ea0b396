/* A colour per point, for viewers: made of what the stream says of the point. In: a point. Out: sRGB. The head
 * has no camera; these are no colours of things. Pure; any thread. */
#ifndef DRIVERS_RECORD_COLOUR_H
#define DRIVERS_RECORD_COLOUR_H

#include <stdint.h>

#include "drivers/host/scanhead.h"

enum colour_kind {
    COLOUR_NONE,
    COLOUR_REFLECTANCE, /* grey: black at -30 dB and below, white at 0 dB and above, even steps of dB between;
                           blue where it is not modelled */
    COLOUR_LABEL,       /* a hue for each surface; grey without one */
};

void colour_of(enum colour_kind kind, const struct scanhead_point *point, uint8_t rgb[3]);

#endif
