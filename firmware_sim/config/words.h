/* The words that keys of type CFG_ENUM take, by their value in struct config; NULL ends each list. */
#ifndef FIRMWARE_SIM_CONFIG_WORDS_H
#define FIRMWARE_SIM_CONFIG_WORDS_H

#include "drivers/usb/backend.h"
#include "firmware_sim/config/config.h"

extern const char *const cfg_up_words[];
extern const char *const cfg_crs_words[];
extern const char *const cfg_georef_words[];
extern const char *const cfg_heights_words[];
extern const char *const cfg_anchor_words[];
extern const char *const cfg_hemisphere_words[];
extern const char *const cfg_layout_words[];
extern const char *const cfg_link_words[];
extern const char *const cfg_protocol_words[];
extern const char *const cfg_talker_words[];
extern const char *const cfg_backend_words[];
extern const char *const cfg_speed_words[];
extern const char *const cfg_pace_words[];
extern const char *const cfg_platform_words[];
extern const char *const cfg_range_noise_words[];
extern const char *const cfg_choice_words[];
extern const char *const cfg_axes_words[];
extern const char *const cfg_detection_words[];
extern const char *const cfg_ambiguity_words[];
extern const char *const cfg_beam_words[];
extern const char *const cfg_echoes_words[];
extern const char *const cfg_at_end_words[];

#endif
