/* SPDX-License-Identifier: MIT */
/* Colours that show figures: a figure in, red, green and blue out (sRGB, 8 bits a channel). One place for recordings,
 * maps, reports and the wire. Pure; any thread. */
#ifndef CORE_COLOUR_H
#define CORE_COLOUR_H

#include <stdint.h>

/* The figure that the colours of a cloud show. */
enum colour_mode {
    COLOUR_NONE,
    COLOUR_SOLID,       /* one colour for all */
    COLOUR_RANGE,       /* metres: the ramp between two limits; so are height and frame */
    COLOUR_HEIGHT,      /* metres, z of the scene's frame; in recordings of a moving head in a CRS, z of that CRS */
    COLOUR_REFLECTANCE, /* colour_reflectance */
    COLOUR_LABEL,       /* colour_number of the surface */
    COLOUR_FRAME,       /* frame scalar (core/cast.h) of a trajectory's point or stop */
    COLOUR_TEXTURE,     /* the texel at the hit; without one the surface's own colour; without that colour_grey */
    COLOUR_MODES
};
/* The words for them, as configuration and options have them. */
extern const char *const colour_words[COLOUR_MODES];

/* How figures become colours. A shot without echo is colour_grey. */
struct colour_scale {
    enum colour_mode mode;
    uint8_t rgb[3];   /* solid */
    double low, high; /* range, height, frame: blue at low, red at high; all blue where both are the same */
};
/* Whether the mode shows a figure between two limits. */
static inline int colour_has_limits(enum colour_mode mode)
{
    return mode == COLOUR_RANGE || mode == COLOUR_HEIGHT || mode == COLOUR_FRAME;
}
/* Gives a figure between two limits its colour on the ramp. NaN: colour_unknown. */
void colour_between(double low, double high, double figure, uint8_t rgb[3]);

/* Blue at 0, green at 1/3, yellow at 2/3, red at 1, with straight lines between; below 0 and above 1 as at the ends.
 * Low is blue and high is red in recordings, maps, views and reports. The page's scales go from blue or dark to red or
 * bright (view_ramps.js). NaN: colour_unknown. */
void colour_ramp(double part, uint8_t rgb[3]);
/* Grey: black at -30 dB and below, white at 0 dB and above, even steps of dB between. NaN: colour_unknown. */
void colour_reflectance(double db, uint8_t rgb[3]);
/* A hue for each number. Successive numbers are a golden section of the colour circle apart, so that they differ. */
void colour_number(uint32_t number, uint8_t rgb[3]);

/* As 0xrrggbb. */
static inline uint32_t colour_packed(const uint8_t rgb[3])
{
    return (uint32_t)rgb[0] << 16 | (uint32_t)rgb[1] << 8 | rgb[2];
}

/* Convert linear light, 0 to 1, to sRGB and back (IEC 61966-2-1). Values beyond that range stay beyond it. */
double colour_srgb_encode(double linear);
double colour_srgb_decode(double srgb);

extern const uint8_t colour_unknown[3]; /* a light blue: the figure is not modelled */
extern const uint8_t colour_grey[3];    /* no surface, no colour */

#endif
