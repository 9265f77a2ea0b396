/* SPDX-License-Identifier: MIT */
/* Waveforms of a site's scans. Out: the digitiser of the configuration, made once, and the room that samples need. */
#ifndef FIRMWARE_SIM_SITE_WAVES_H
#define FIRMWARE_SIM_SITE_WAVES_H

#include <stdint.h>

#include "core/cast.h"
#include "core/plan.h"

struct line_block;
struct sh_err;
struct sh_report;
struct site;

struct site_wave_room {
    uint32_t windows, samples;
};

struct site_waves {
    struct waveform *waveform;
    struct beam beam; /* the head's beam; single rays need it, too */
    struct cast_waves cast;
    struct site_wave_room usual; /* of a usual pulse */
};

/* Makes site->waves; NULL where the configuration has no waveforms. Warns where a count of the digitiser is
 * too coarse for echoes that the head detects, and where many echoes are noise. SH_EINPUT also where the stream would
 * have more than 400 MB of waveforms per second (MOST_BYTES_S in waves.c). */
int site_set_up_waves(struct site *site, const struct sh_report *report, struct sh_err *err);
void site_free_waves(struct site *site);

/* Returns the windows and samples that a block of so many pulses has room for; 0 where no waveforms are sent. Samples
 * without room are counted (core/line.h). */
struct site_wave_room site_wave_room(const struct site *site, uint32_t n_pulses);
/* Returns the windows and samples of so many usual pulses. Each has a return of 20 dB from a surface that is hit at a
 * right angle. Where 20 dB do not reach waveform.keep_db, the return is stronger. */
struct site_wave_room site_usual_waves(const struct site *site, uint32_t n_pulses);
/* Bytes of waveforms per second that usual pulses make with the settings of power-up. */
double site_wave_bytes_s(const struct site *site);
/* Makes a block of so many pulses and points, with what the site's output has of attributes, colours, waveforms, and
 * deviations of the echoes found in waveforms. Prepares the caster for waveforms. */
int site_make_block(const struct site *site, uint32_t n_pulses, uint32_t n_points, struct caster *caster,
                    struct line_block *block, struct sh_err *err);

/* Returns the cost of a usual pulse's waveform, ns; 0: there are none. */
double site_wave_ns(const struct site *site);
/* Fills the plan's row. */
void site_wave_row(const struct site *site, struct plan_row *row);

#endif
