/* SPDX-License-Identifier: MIT */
/* A head profile: the figures of a kind of head from its file in config/heads, and values that follow from them. All
 * figures have the units that their names say, and are constant once the profile is loaded. */
#ifndef FIRMWARE_SIM_CONFIG_PROFILE_H
#define FIRMWARE_SIM_CONFIG_PROFILE_H

#include <math.h>

#include "core/detect.h"
#include "core/footprint.h"
#include "core/schedule.h"
#include "firmware_sim/command/head.h"
#include "firmware_sim/config/limits.h"

struct native_beam;
struct native_emitter;
struct sh_err;

/* Returns by how much the error of a rotor's motor makes a line rate higher, rounded to micro-hertz. */
static inline int64_t config_motor_uhz(double motor_ppm, int64_t lines_uhz)
{
    return llround(1e-6 * motor_ppm * (double)lines_uhz);
}

/* How sure a figure of a profile is; config/heads/README.md says what each word means. */
enum config_from { FROM_DATA_SHEET, FROM_QUOTED, FROM_ASSUMED };

struct config_reach {
    double reflectance, range_m;
    enum config_from from;
};

/* A program: the figures of a head at one of its pulse rates. */
struct config_program {
    int64_t prr_uhz;  /* 0: any rate of a head without programs */
    int64_t used_uhz; /* pulses within the field of view */
    uint32_t max_echoes;
    double range_min_m, range_max_m;
    double own_min_m, own_max_m;   /* the same without head.range_min_m and range_max_m */
    double reach_90_m, reach_20_m; /* as the file has them; 0: not given */
    struct config_reach reach[DETECT_MAX_REACHES];
    uint32_t n_reaches; /* at least 1 */
};

/* How a head's pulses are arranged (core/emitter.h): the figures of the file. */
struct config_emitter {
    enum emitter_kind kind;
    uint32_t steps_per_turn, first_step, last_step, front_step;
    enum config_turn { TURN_CLOCKWISE, TURN_COUNTER_CLOCKWISE } step_direction; /* seen from above */
    struct config_geometry { /* a line rate, and the steps that a turn has at it */
        int64_t lines_uhz;
        uint32_t steps_per_turn;
        enum config_from from;
    } geometry[HEAD_MAX_RATES]; /* the first is that of power-up */
    uint32_t n_geometries;      /* 0: any line rate, at steps_per_turn */
    int64_t firing_fs;          /* of a whole sequence */
    struct config_profile_beam {
        int64_t elevation_udeg, azimuth_udeg;
        uint32_t offset_ns;
        enum config_from from;
    } beam[EMITTER_MAX_BEAMS];
    uint32_t n_beams;
    int64_t step_udeg;
    char directions[CONFIG_PATH_LEN];
};

/* A head profile, config/heads/NAME.yaml: each figure is written `{ value: V, from: data sheet|quoted|assumed }`,
 * and may have a source and a note. */
struct config_profile {
    char name[32], maker[32], model[64], firmware[32];
    struct config_emitter arrangement; /* as it stands in the file ... */
    struct emitter emitter;            /* ... and as the schedule takes it */
    int64_t prr_min_uhz, prr_max_uhz, lines_min_uhz, lines_max_uhz, pan_max_udeg_s;
    int64_t fov_min_udeg, fov_max_udeg; /* line angle: 0 forward, 90 up, above 90 backward over the zenith */
    int64_t pan_min_udeg, pan_max_udeg;
    uint32_t facets;     /* lines per turn of the mirror */
    double optical_gain; /* beam degrees per mirror degree: 2 polygon, 1 45-degree mirror */
    double range_min_m, range_max_m;
    double range_sigma_m, range_sigma_ppm; /* one sigma of the range noise: fixed part, and part per distance */
    double range_sigma_at_m, range_sigma_reflectance, range_sigma_floor_m; /* where the fixed part holds; its floor */
    double mirror_sigma_deg, pan_sigma_deg;                                /* one sigma of the angle noise */
    /* These reaches are the head's as a whole; they limit each program. */
    struct config_reach reach[DETECT_MAX_REACHES];
    uint32_t n_reaches; /* at least 1: range_max_m on 90 % where the file has none */
    /* One for each pulse rate, the lowest rate first. n_programs 0: any rate from prr_min to prr_max; program[0] then
     * holds for all of them. */
    struct config_program program[HEAD_MAX_RATES];
    uint32_t n_programs;
    double accuracy_m, accuracy_ppm, angle_accuracy_deg; /* shown; noise is drawn from the sigmas alone. 0: not known */
    double threshold_snr, overlap_m, wavelength_nm, visibility_m, pulse_width_ns;
    double mirror_counts, pan_counts;        /* encoder counts per turn of the beam angle; 0: ideal (2^32 counts) */
    double beam_exit_m, beam_divergence_rad; /* full ones at 1/e2 (core/footprint.h) */
    double beam_exit_given_m, beam_divergence_given_rad;                   /* as the maker states them */
    enum beam_definition beam_exit_definition, beam_divergence_definition; /* the maker's definition of a width */
    uint32_t max_echoes;
    double boot_s, spin_up_s, spin_down_s;
};

/* Returns the index of the program with this pulse rate; 0 for a head without programs. */
uint32_t config_program_of(const struct config_profile *profile, int64_t prr_uhz);
/* Returns the head's largest pulse rate that is not above prr_uhz; its smallest one if all are above. */
int64_t config_rate_below(const struct config_profile *profile, int64_t prr_uhz);

/* Sets the signal of one of a profile's programs; members that no profile has (sharp, extinction, seed) become 0. */
void config_signal_spec(const struct config_profile *profile, const struct config_program *program,
                        struct detect_signal_spec *spec);

/* Sets the schedule of a head with these settings. A list of directions is left out; site_fill_spec adds it. */
void config_fill_spec(const struct config_profile *profile, const struct head_settings *settings,
                      struct schedule_spec *spec);

/* Sets the steps of a turn of a planar head, which are those of one of its geometries. */
void config_set_steps(struct config_profile *profile, uint32_t steps);

/* Describes an emitter as its native frame does, at the profile's rate. Members that only spheres have, and the choice
 * of echoes, become 0. beam: room for those of the emitter. */
void config_describe_emitter(const struct emitter *emitter, struct native_emitter *e, struct native_beam *beam);

/* Reads the profile NAME. The profile is looked for in $SCANHEAD_HEADS, in heads/ beside the configuration config_file,
 * beside the program (installed or in its build folder), and in config/heads of the working directory. */
int config_load_profile(const char *name, const char *config_file, struct config_profile *profile, struct sh_err *err);

#endif
