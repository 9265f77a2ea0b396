/* SPDX-License-Identifier: MIT */
/* The configuration as a struct, which load.h fills from a YAML file and --set. One table (keys.c) of key, type, unit,
 * default, range and help gives parsing, defaults, errors and the reference.
 *
 * Units: as the key's name says (hz, deg, m). Everything is checked. Unknown keys, duplicate keys, trailing text ("30
 * kHz"), NaN, wrong types and values out of range are errors. Relative paths in a file are relative to that file; in
 * --set, to the working directory.
 *
 * The struct is constant once it is loaded. Values that a run measures or chooses are in the site (firmware_sim/site).
 * A file that needs only places, a head profile, limits, loading or the reference includes those headers, not this
 * one. */
#ifndef FIRMWARE_SIM_CONFIG_CONFIG_H
#define FIRMWARE_SIM_CONFIG_CONFIG_H

#include <stdint.h>

#include "core/colour.h"
#include "core/detect.h"
#include "core/footprint.h"
#include "core/georef.h"
#include "core/line.h"
#include "core/plan.h"
#include "core/scene.h"
#include "core/surface.h"
#include "core/waveform.h"
#include "drivers/link/link.h"
#include "firmware_sim/command/head.h"
#include "firmware_sim/config/epoch.h"
#include "firmware_sim/config/fields.h"
#include "firmware_sim/config/limits.h"
#include "firmware_sim/config/places.h"
#include "firmware_sim/config/profile.h"
#include "firmware_sim/fault/fault.h"

enum config_heights { HEIGHTS_ELLIPSOID, HEIGHTS_GEOID, HEIGHTS_AUTO };
enum config_pace { PACE_REALTIME, PACE_FAST, PACE_STEP };

/* The GNSS receiver (gnss.h). */
struct config_gnss {
    uint32_t rate_hz; /* 1, 2, 4, 5, 10, 20 */
    enum config_talker { TALKER_GN, TALKER_GP } talker;
    uint32_t quality; /* as in GGA: 0, 1, 2, 4, 5 */
    uint32_t satellites;
    double hdop, accuracy_m, geoid_separation_m;
    double lever_arm_m[3]; /* of the antenna from the head's origin, in the head's frame */
    int pps, nmea;         /* its pulses and its sentences reach the head */
    double nmea_late_ms;
    int cold; /* 1: no pulse and no sentence reached the head before power-up */
};

/* The time server that a SICK scanner asks (scanner_clock.h). */
struct config_ntp {
    enum config_ntp_role { NTP_ROLE_NONE, NTP_ROLE_CLIENT, NTP_ROLE_SERVER } role;
    char address[16]; /* numeric, IPv4 */
    uint32_t port, update_s;
    double zone_h, max_offset_s;
    int anywhere; /* clients may choose a server outside of this machine */
};

enum config_range_noise { RANGE_NOISE_OFF, RANGE_NOISE_ON, RANGE_NOISE_SIGNAL };

/* Ball-shaped noise; detect_ball. */
struct config_ball {
    double radius_m, factor[3], distance_1_m;
    int local;
    uint64_t seed; /* noise.seed where it is not given */
};

struct config_signal {
    int on, sharp;
    double reflectance; /* of surfaces without one of their own */
    double visibility_m, extinction_1_km;
    int has_extinction; /* 0: visibility_m gives the extinction; if that is 0, too, the profile's visibility does */
};

/* Waveforms; core/waveform.h. Whether they are sent is a setting of the head. */
struct config_waveform {
    enum config_wave_echoes {
        WAVE_ECHOES_MODEL,
        WAVE_ECHOES_THRESHOLD,
        WAVE_ECHOES_FRACTION,
        WAVE_ECHOES_GAUSSIANS
    } echoes;
    enum waveform_shape pulse;
    char pulse_file[CONFIG_PATH_LEN];
    double skew, bandwidth_mhz, sample_ns;
    uint32_t bits;
    double baseline_counts, full_scale_db, saturation_db, dead_ns; /* both in dB: power above the threshold */
    double keep_db, before_ns, after_ns, near_m, far_m;
};

/* Instrument errors; core/instrument.h. */
struct config_instrument {
    double collimation_deg, trunnion_deg, transit_offset_m, mirror_offset_m;
    double mirror_index_deg, mirror_scale_ppm, mirror_eccentricity_deg, mirror_phase_deg;
    double pan_index_deg, pan_scale_ppm, pan_eccentricity_deg, pan_phase_deg;
    double range_offset_m, range_scale_ppm;
};

/* Settings at power-up, within the profile (checked). */
struct config_head {
    struct head_settings settings;
    char serial[32], name[32];
    char settings_file[CONFIG_PATH_LEN];
    int start;        /* scan when booted; run and soak use it, recordings do not */
    double motor_ppm; /* error of a rotor's speed (`emitter: beams`) where nothing holds the rotor's phase */
    enum detect_ambiguity ambiguity;
    uint32_t mta_zones;
    /* of a sphere (core/emitter.h); also copied into the profile's emitter */
    int64_t step_udeg, ring_start_udeg, ring_stop_udeg;
    double range_min_m, range_max_m;     /* nothing nearer or farther is an echo; cfg->profile gets the same limits */
    double profile_min_m, profile_max_m; /* the range limits in the head profile's file */
};

/* The objects of the meshes that are scanned; n_objects 0: all. */
enum { CONFIG_MAX_OBJECTS = 64 };
struct config_target {
    char object[CONFIG_MAX_OBJECTS][SCENE_NAME_LEN]; /* patterns */
    uint32_t n_objects;
    enum config_others { OTHERS_LEFT_OUT, OTHERS_HIDE } others;
};

struct config_scene {
    struct config_target target;
    struct config_mesh mesh[CONFIG_MAX_MESHES];
    uint32_t n_meshes;
    struct config_copy copy[CONFIG_MAX_COPIES];
    uint32_t n_copies;
    double tolerance_m;
    int cutouts; /* rays pass where a texture's alpha is below a half */
    struct scene_import_limits import;
    struct config_anchor anchor;
    int shared_textures; /* a scanner of the scene models the signal, so all of them have the textures */
};

struct config_output {
    enum georef_crs crs;
    int utm_zone;
    enum line_layout layout;
    int layout_given; /* 0: the default */
    enum config_heights heights;
    enum georef_method georef; /* GEOREF_AUTO: as the plan says */
    double tolerance_m;        /* largest error of a georeferenced position */
    int attributes;            /* amplitude and width of each echo follow the points */
    enum colour_mode colour;   /* a colour for each point follows, too */
    double colour_rgb[3];      /* solid: 0..255 each, whole */
    double colour_limits[2];   /* range, height, frame */
    int colour_limited;        /* 0: no limits are given */
    double scale_m;            /* 0: the finest of 1e-6 x 10^n m that holds range_max_m (polar: 32 bits, geo: 31) */
};

struct config_beam {
    enum beam_mode mode;
    uint32_t rings;
};

struct config_cast {
    enum config_choice sight; /* core/sight.h */
    double sight_mib;
};

struct config_coverage {
    double cell_m, memory_mib; /* core/studio/coverage.h */
};

struct config_noise {
    enum config_range_noise range;
    double sigma_m; /* the profile in this struct has it, too, as range_sigma_m */
    int angle;
    uint64_t seed;
    struct config_ball ball;
};

struct config_optics {
    uint32_t depth;
    int depth_given; /* 0: as the plan says, up to depth */
};

struct config_loop {
    double tick_hz; /* 100..10000, a divisor of 1e9 */
    double ahead_ms, queue_ms, late_ms;
    uint32_t threads; /* casters; 0: one per processor */
    enum config_pace pace;
};

/* One member per section of the file. A file may have several scanners: the keys in a station's section `scanner`
 * replace those of the file's own sections. A struct config is the configuration of one scanner. */
struct config {
    char file[CONFIG_PATH_LEN];
    const char *const *sets; /* the --set that it was loaded with; not copied */
    int n_sets;
    char scenario_file[CONFIG_PATH_LEN]; /* the scenario that was added; empty: none */
    int has_no_head;                     /* 1: a replay has these links; the replay itself refuses faults in the head */
    int links_are_not_here;              /* 1: this is not the scanner of head.station, which has the links */
    char profile_file[CONFIG_PATH_LEN];
    struct config_profile profile;
    struct config_head head;
    struct config_scene scene;
    struct config_station station[CONFIG_MAX_STATIONS];
    uint32_t n_stations;
    struct config_platform platform;
    struct config_output output;
    struct link_spec link[CONFIG_MAX_LINKS];
    uint32_t n_links;
    struct config_field field[CONFIG_MAX_FIELDS];
    uint32_t n_fields;
    struct config_input input[CONFIG_MAX_INPUTS];
    uint32_t n_inputs;
    struct config_beam beam;
    struct config_cast cast;
    struct config_coverage coverage;
    struct plan_tolerance plan;
    struct config_noise noise;
    struct config_signal signal;
    struct config_waveform waveform;
    struct surface_rule surface[CONFIG_MAX_SURFACES];
    uint32_t n_surfaces;
    struct config_optics optics;
    struct config_instrument instrument;
    struct config_loop loop;
    struct config_time time;
    struct config_gnss gnss;
    struct config_ntp ntp;
    struct fault_list faults;
};

/* A configuration is loaded for the scanner of head.station. config_serves returns whether station i, from 0, has this
 * scanner, and config_is_alone whether all stations have it. All stops of a trajectory have the scanner of the one
 * station. */
int config_serves(const struct config *cfg, uint32_t i);
int config_is_alone(const struct config *cfg);
/* Returns whether a link speaks that protocol, of enum protocol_id. */
int config_speaks(const struct config *cfg, int protocol);
/* Sets the head's settings of a configuration, and the ranges, noise and step that follow from them, as if its keys had
 * these values. cfg is a copy of a loaded one; the settings must be allowed for it (command.h). SH_EINPUT: no ring of
 * the sphere is left. */
int config_apply_settings(struct config *cfg, const struct head_settings *settings, struct sh_err *err);

/* Returns whether head.range_min_m or range_max_m leaves less than the profile's range. */
static inline int config_limits_range(const struct config *cfg)
{
    return cfg->head.range_min_m > cfg->head.profile_min_m || cfg->head.range_max_m < cfg->head.profile_max_m;
}

/* Returns whether the scene needs texture coordinates and textures. */
static inline int config_wants_textures(const struct config *cfg)
{
    return cfg->signal.on || cfg->output.colour == COLOUR_TEXTURE || cfg->scene.shared_textures;
}

static inline int config_has_footprint(const struct config *cfg)
{
    return cfg->profile.beam_exit_m != 0.0 || cfg->profile.beam_divergence_rad != 0.0;
}

/* Returns whether waveforms are made at all, to be sent or to find echoes in them. */
static inline int config_has_waves(const struct config *cfg)
{
    return cfg->head.settings.waves != 0 || cfg->waveform.echoes != WAVE_ECHOES_MODEL;
}
/* Returns the pulses per second that are cast with these settings: all but those in the blind part of a sweep. */
double config_cast_hz(const struct config *cfg);

/* Returns the number of threads that cast: loop.threads, or one per processor. */
uint32_t config_threads(const struct config *cfg);

/* Says why an adaptive beam is not possible: the beams of a scan do not all begin at one place of a scene that stands
 * still, or a tripod has legs, whose outlines are not looked for. NULL: it is possible. */
const char *config_beam_moves(const struct config *cfg);

/* Says why rays do not all begin at the head's station, as a visibility map (core/sight.h) needs; NULL: they do. */
const char *config_rays_move(const struct config *cfg);

#endif
