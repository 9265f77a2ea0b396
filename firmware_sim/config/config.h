/* SPDX-License-Identifier: MIT */
/* The configuration. In: a YAML file and --set. Out: struct config, checked. One table (keys.c) of key, type,
 * unit, default, range and help gives parsing, defaults, errors and the reference.
 *
 * Units: as the key's name says (hz, deg, m). Everything is checked. All diagnostics are found at once; each is
 * one line:
 *   FILE:LINE: KEY: what is wrong; what is allowed
 * Unknown keys, duplicate keys, trailing text ("30 kHz"), NaN, wrong types and values out of range are
 * errors. Relative paths in a file are relative to that file; in --set, to the working directory.
 *
 * The struct is constant once it is loaded. Values that a run measures or chooses are in the site
 * (firmware_sim/site). */
#ifndef FIRMWARE_SIM_CONFIG_CONFIG_H
#define FIRMWARE_SIM_CONFIG_CONFIG_H

#include <stdint.h>
#include <stdio.h>

#include "core/colour.h"
#include "core/footprint.h"
#include "core/detect.h"
#include "core/err.h"
#include "core/georef.h"
#include "core/line.h"
#include "core/plan.h"
#include "core/scene.h"
#include "core/schedule.h"
#include "core/surface.h"
#include "drivers/link/link.h"
#include "drivers/protocol/protocol.h"
#include "firmware_sim/command/head.h"
#include "firmware_sim/config/profile.h"
#include "firmware_sim/fault/fault.h"

enum {
    CONFIG_MAX_MESHES = 64,
    CONFIG_MAX_COPIES = 256, /* copies listed in the configuration itself, of all meshes together */
    CONFIG_MAX_LINKS = 8,
    CONFIG_MAX_STATIONS = 64,
    CONFIG_MAX_SURFACES = 64,
    CONFIG_MAX_STOPS = 4096,
    CONFIG_MAX_THREADS = 64
};

enum config_heights { HEIGHTS_ELLIPSOID, HEIGHTS_GEOID, HEIGHTS_AUTO };
enum config_pace { PACE_REALTIME, PACE_FAST, PACE_STEP };

struct config_mesh {
    char file[CONFIG_PATH_LEN];
    enum scene_up up;
    double scale, offset_m[3];
    /* Motion, at time t of the scan: turned by turn_deg_s * t about the vertical through pivot_m, clockwise
     * seen from above, then shifted by move_m_s * t; with cycle_s, back and forth. All zero: the mesh stands
     * still. */
    double move_m_s[3], turn_deg_s, pivot_m[3], cycle_s;
    char copies[CONFIG_PATH_LEN]; /* CSV file of places; empty: they are in struct config_scene, or there are none */
    int copy_labels;              /* each copy has surfaces of its own */
};

static inline int config_mesh_moves(const struct config_mesh *mesh)
{
    return mesh->turn_deg_s != 0.0 || mesh->move_m_s[0] != 0.0 || mesh->move_m_s[1] != 0.0 || mesh->move_m_s[2] != 0.0;
}

/* A copy of a mesh that is listed in the configuration itself. */
struct config_copy {
    uint32_t mesh;
    struct scene_place place;
};
enum { CONFIG_COPY_SCALES = 1000 }; /* a copy's scale: from 1 / CONFIG_COPY_SCALES to CONFIG_COPY_SCALES */

/* How the scene lies on the Earth; core/geoframe.h. */
enum config_anchor_source { ANCHOR_NONE, ANCHOR_EXPLICIT, ANCHOR_IFC, ANCHOR_UTM, ANCHOR_ECEF, ANCHOR_GEOTIFF };
struct config_anchor {
    enum config_anchor_source source;
    double origin_m[3], lat_deg, lon_deg, height_m, north_deg;
    uint32_t utm_zone; /* 0: UPS */
    int north;         /* hemisphere */
    int height_given;  /* height_m is given: ifc uses it in place of RefElevation, geotiff in place of 0 */
};

/* The form in which a station's place on the Earth is given. */
enum config_place { PLACE_NONE, PLACE_GEODETIC, PLACE_UTM, PLACE_ECEF };

enum config_choice { CHOICE_AUTO, CHOICE_OFF, CHOICE_ON };

/* The tripod under a station's head (firmware_sim/site/tripod.c). */
struct config_tripod {
    int given; /* 0: no tripod, so nothing is hidden */
    double leg_m, opening_min_deg;
    double head_above_m;     /* the head's origin above the tripod's top */
    enum config_choice cone; /* hides what is below the head; auto: where there are no legs to hide it */
    int legs;                /* three prisms that the head can scan */
    double leg_diameter_m, legs_heading_deg;
};

struct config_station {
    char name[32];
    double position_m[3];                    /* of the head's origin in the scene frame */
    int has_position;                        /* 0: it follows from the place on the Earth, through the anchor */
    double heading_deg, pitch_deg, roll_deg; /* pose_attitude */
    double instrument_height_m;              /* of the head's origin above the floor below position_m */
    int has_instrument_height;
    enum config_place place;
    double lat_deg, lon_deg, height_m; /* of the head's origin; height_m also with PLACE_UTM */
    uint32_t utm_zone;                 /* 0: UPS */
    int north;                         /* hemisphere */
    double easting_m, northing_m;
    double ecef_m[3];
    struct config_tripod tripod;
    int has_scanner;  /* there is a section `scanner` */
    uint32_t scanner; /* the first station, from 1, of those with the same scanner */
};

enum config_platform_kind { PLATFORM_STATIC, PLATFORM_TRAJECTORY, PLATFORM_LIVE, PLATFORM_STOPS };
enum config_at_end { PLATFORM_STOP, PLATFORM_HOLD };

/* The platform under the head. Attitudes as core/pose.h defines them. */
struct config_platform {
    enum config_platform_kind kind;
    char file[CONFIG_PATH_LEN], waypoints[CONFIG_PATH_LEN];   /* trajectory, stops: one of them */
    double start_s, end_s;                                    /* part of the trajectory, after its first sample */
    int has_end;                                              /* 0: to its last sample */
    double step_s;                                            /* stops: from each to the next */
    double frames_per_s, first_frame, last_frame, frame_step; /* stops: the same in frames; frames_per_s 0: unused */
    enum config_at_end at_end;
    double mount_m[3], mount_heading_deg, mount_pitch_deg, mount_roll_deg; /* of the head on the platform */
    double reach_m, extrapolate_ms;                                        /* live */
    char address[64];
    uint32_t port; /* live, in real time: UDP; 0: the system chooses */
};

/* The head moves while it scans. */
static inline int config_head_moves(const struct config_platform *platform)
{
    return platform->kind == PLATFORM_TRAJECTORY || platform->kind == PLATFORM_LIVE;
}

/* Time of day (head_clock.h). */
struct config_time {
    char epoch[40]; /* of power-up: none, utc, tai, or a date as 2026-01-01T00:00:00Z */
    double offset_s, drift_ppm, jump_s, jump_at_s;
};

/* The GNSS receiver (gnss.h). */
struct config_gnss {
    uint32_t rate_hz; /* 1, 2, 4, 5, 10, 20 */
    enum config_talker { TALKER_GN, TALKER_GP } talker;
    uint32_t quality; /* as in GGA: 0, 1, 2, 4, 5 */
    uint32_t satellites;
    double hdop, accuracy_m, geoid_separation_m;
    double lever_arm_m[3]; /* of the antenna from the head's origin, in the head's frame */
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
    int has_extinction; /* 0: by visibility_m; where that is 0, too: the air of the data sheet */
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
    int start; /* scan when booted; only the command run uses it */
    enum detect_ambiguity ambiguity;
    uint32_t mta_zones;
    /* of a sphere (core/emitter.h); also copied into the profile's emitter */
    int64_t step_udeg, ring_start_udeg, ring_stop_udeg;
    double range_min_m,
        range_max_m; /* nothing nearer or farther is an echo; the profile in this struct has them, too */
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
    struct config_beam beam;
    struct config_cast cast;
    struct config_coverage coverage;
    struct plan_tolerance plan;
    struct config_noise noise;
    struct config_signal signal;
    struct surface_rule surface[CONFIG_MAX_SURFACES];
    uint32_t n_surfaces;
    struct config_optics optics;
    struct config_instrument instrument;
    struct config_loop loop;
    struct config_time time;
    struct config_gnss gnss;
    struct fault_list faults;
};

/* The diagnostics of a configuration, in the order of the file; then those of --set and of the head profile. */
enum { CONFIG_MAX_FAULTS = 20 };
struct config_faults {
    uint32_t n; /* all diagnostics that were found; fault[] has the first CONFIG_MAX_FAULTS */
    struct sh_err fault[CONFIG_MAX_FAULTS];
    uint64_t place[CONFIG_MAX_FAULTS]; /* what they are ordered by */
};

/* Reads path, its profile, then the `key=value` settings of --set, in order. These are checked in the same way, and
 * errors name them `--set KEY`. On failure cfg is unspecified, and err has the first diagnostic. cfg is large: allocate
 * it. */
int config_load(const char *path, const char *const *sets, int n_sets, struct config *cfg, struct sh_err *err);

/* The same, with all diagnostics. Returns SH_OK or the code of the first. */
int config_load_all(const char *path, const char *const *sets, int n_sets, struct config *cfg,
                    struct config_faults *faults);

/* The same for a text that has only links, loop and faults. Errors call it `name`. The rest of cfg is zero. */
int config_load_links(const char *text, const char *name, const char *const *sets, int n_sets, struct config *cfg,
                      struct config_faults *faults);

/* Adds the injected faults of a scenario, a file that has nothing but a list `faults`. name: a path, or the name of a
 * scenario that comes with the program. At most once. Diagnostics go to `faults`; then nothing is added, and the code
 * of the first is returned. */
int config_add_scenario(struct config *cfg, const char *name, struct config_faults *faults);
/* "a, b, c": the scenarios that come with the program, as many as buf holds. */
void config_name_scenarios(char *buf, size_t len);
/* Reads a fault from one line of YAML, "{kind: drop, every: 10}", for a head with this configuration. Takes 200 KiB of
 * stack. */
int config_read_fault(const struct config *cfg, const char *text, struct fault *out, struct sh_err *err);
/* Whether faults of the kind can strike on the link. */
int config_link_has_fault(const struct link_spec *link, enum fault_kind kind);

/* A configuration is loaded for the scanner of head.station. config_serves: whether station i, from 0, has this
 * scanner. config_is_alone: whether all have it. The stops of a platform have the scanner of the one station. */
int config_serves(const struct config *cfg, uint32_t i);
int config_is_alone(const struct config *cfg);
/* Loads the configuration of the scanner at a station, from 1, which becomes its head.station. It has no links. Output,
 * loop and scenario are those of cfg as it is now. The sets that cfg was loaded with must still be there. */
int config_load_scanner(const struct config *cfg, uint32_t station, struct config *out, struct sh_err *err);

/* The program of a pulse rate, as an index; 0 for a head without programs. */
uint32_t config_program_of(const struct config_profile *profile, int64_t prr_uhz);
/* The largest pulse rate that the head has up to prr_uhz; its smallest one where it has none. */
int64_t config_rate_below(const struct config_profile *profile, int64_t prr_uhz);

/* The signal of one of a profile's programs; members that no profile has (sharp, extinction, seed) are 0. */
void config_signal_spec(const struct config_profile *profile, const struct config_program *program,
                        struct detect_signal_spec *spec);

/* The schedule of a head with some settings. A list of directions is left out; site_fill_spec adds it. */
void config_fill_spec(const struct config_profile *profile, const struct head_settings *settings,
                      struct schedule_spec *spec);

/* Sets the steps of a turn of a planar head, which are those of one of its geometries. */
void config_set_steps(struct config_profile *profile, uint32_t steps);

/* Gives a configuration other ranges, noise and step, as if its keys had them. cfg is a copy of a loaded one; the
 * settings must be allowed for it (command.h). SH_EINPUT: no ring of the sphere is left. */
int config_apply_settings(struct config *cfg, const struct head_settings *settings, struct sh_err *err);

/* Whether head.range_min_m or range_max_m leaves less than the profile's range. */
static inline int config_limits_range(const struct config *cfg)
{
    return cfg->head.range_min_m > cfg->head.profile_min_m || cfg->head.range_max_m < cfg->head.profile_max_m;
}

/* Whether the scene needs texture coordinates and textures. */
static inline int config_wants_textures(const struct config *cfg)
{
    return cfg->signal.on || cfg->output.colour == COLOUR_TEXTURE || cfg->scene.shared_textures;
}

static inline int config_has_footprint(const struct config *cfg)
{
    return cfg->profile.beam_exit_m != 0.0 || cfg->profile.beam_divergence_rad != 0.0;
}

/* Threads that cast: loop.threads, or one per processor. */
uint32_t config_threads(const struct config *cfg);

/* Why the beams of a scan do not all begin at one place of a scene that stands still; NULL: they do. An adaptive beam
 * needs that. */
const char *config_beam_moves(const struct config *cfg);

/* Why rays do not all begin at the head's station; NULL: they do. A visibility map (core/sight.h) needs that. */
const char *config_rays_move(const struct config *cfg);

/* A key as the tables describe it. Strings are constant, except `what`. */
struct config_key_text {
    const char *path, *help;
    const char *const *words; /* the words that it takes, NULL at the end; NULL: its values are no words */
    int has_value;            /* 0: a section, or a list */
    char what[1024];          /* type, unit, allowed values, default, and whether it may be left out */
};
/* The keys of a configuration, or those of a head profile. */
enum config_keys { CONFIG_KEYS, CONFIG_PROFILE_KEYS };
/* The text above them in the reference. */
const char *config_keys_intro(enum config_keys keys);
/* Key i, in the order of the reference; 0 after the last one. */
int config_describe_key(enum config_keys keys, size_t i, struct config_key_text *out);

/* The reference: every key with type, unit, default, range and help. */
void config_print_reference(FILE *out);

/* The same for one section ("head", "scene.anchor"), for one key, or for "profile": the keys of head
 * profiles. SH_EINPUT: there is no such section or key; err names the sections. */
int config_print_section(const char *section, FILE *out, struct sh_err *err);

/* Prints a configuration that loads and has all keys, each with its help. Keys that need a value have one; the others
 * are commented out with their defaults. It names a profile and a mesh that come with the program. */
int config_print_example(FILE *out, struct sh_err *err);

/* Lists the profiles in a directory: name, programs, and how sure their figures are. Returns how many. dir NULL: the
 * first directory that exists of the lookup below, without a configuration. */
int config_list_profiles(const char *dir, FILE *out, struct sh_err *err);

/* Reads the profile NAME, looked up as for a configuration that lies at config_file. */
int config_load_profile(const char *name, const char *config_file, struct config_profile *profile, struct sh_err *err);

/* Finds the directory of profiles: $SCANHEAD_HEADS, heads/ beside the configuration, beside the program
 * (installed or in its build folder), or config/heads in the working directory. `head.profile` is a NAME that is
 * looked up there, or a path that ends in .yaml. */

#endif
