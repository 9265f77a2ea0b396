/* SPDX-License-Identifier: MIT */
/* Private to core/cast: these loops over arrays turn ranges of echoes into entries of a block. */
#ifndef CORE_CAST_KERNELS_POINTS_H
#define CORE_CAST_KERNELS_POINTS_H

#include "core/cast.h"

struct kernel_turns;

/* Sets ranges outside of the head's limits to NaN. */
void kernel_limit(double *range_m, double min_m, double max_m, uint32_t n);
/* Returns whether a range is at or below a limit. */
int kernel_has_low(const double *range_m, double limit_m, uint32_t n);
/* Sets the keys of the echoes' random numbers: rng_echo. */
void kernel_keys(uint64_t pulse0, const uint8_t *number, uint32_t n, uint64_t *key);

/* Sets echo bytes and labels of pulses with one echo at most. Returns the number of echoes. */
uint32_t kernel_entries(const double *range_m, const uint32_t *label, uint32_t n, uint8_t *echo, uint16_t *out);
/* Returns how many ranges are not NaN. */
uint32_t kernel_count_echoes(const double *range_m, uint32_t n);
/* Copies the values of entries that are echoes; the others get `none`. */
void kernel_values(const int16_t *value, const uint8_t *echo, uint32_t n, int16_t none, int16_t *out);
/* Sets widths of echoes in 0.01 ns, LINE_WIDTH_NONE for entries without echo. */
void kernel_widths(const float *width_m, const uint8_t *echo, uint32_t n, uint16_t *out);

/* The three numbers of entries on the wire. */
struct kernel_wire {
    uint32_t *a, *b, *c;
};
/* Sets a: range in counts, 0 for none; b, c: encoder counts modulo a turn. */
void kernel_polar(const struct cast_setup *setup, const double *range_m, const struct kernel_turns *turns,
                  const struct kernel_wire *out);
/* Sets coordinates in counts of scale[], LINE_XYZ_NONE for NaN and for what doesn't fit. Returns how many
 * coordinates did not fit. */
uint32_t kernel_geo(const struct vec3_in *p, const double scale[3], uint32_t n, const struct kernel_wire *out);
/* Sets coordinates of direction * range in counts, for linear maps: directions are already those of the CRS. Returns 0
 * where all fit, else 1. */
uint32_t kernel_place(const struct vec3_in *direction, const double *range_m, const double scale[3], uint32_t n,
                      const struct kernel_wire *out);
/* Multiplies directions e by their ranges. */
void kernel_scale(const double *range_m, uint32_t n, const struct vec3_out *e);

#endif
