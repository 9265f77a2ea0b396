/* SPDX-License-Identifier: MIT */
/* The table of a head profile's keys. */
#include "firmware_sim/config/profile.h"
#include "firmware_sim/config/profile_keys.h"
#include "firmware_sim/config/profiles.h"
#include "firmware_sim/config/table/row.h"

/* The beginning of a row: path, offset and size. Where path and member have different names, the row writes the path
 * itself. */
#define IN_PROFILE(member) CFG_MEMBER(struct config_profile, member)
#define KEY(member)        #member, IN_PROFILE(member)
#define EMITTER(member)    #member, IN_PROFILE(arrangement.member)
#define BEAM(member)       CFG_MEMBER(struct config_profile_beam, member)
#define GEOMETRY(member)   CFG_MEMBER(struct config_geometry, member)
#define REACH(member)      "reaches[]." #member, CFG_MEMBER(struct config_reach, member)

#define PROGRAM(member) CFG_MEMBER(struct config_program, member)

const char *const cfg_from_names[] = {
    [FROM_DATA_SHEET] = "data sheet", [FROM_QUOTED] = "quoted", [FROM_ASSUMED] = "assumed", NULL};

static const char *const widths[] = {[BEAM_AT_1_E2] = "1/e2",
                                     [BEAM_AT_1_E] = "1/e",
                                     [BEAM_AT_HALF_MAXIMUM] = "FWHM",
                                     [BEAM_HALF_AT_1_E2] = "radius 1/e2",
                                     NULL},
                         *const angles[] = {[BEAM_AT_1_E2] = "1/e2",
                                            [BEAM_AT_1_E] = "1/e",
                                            [BEAM_AT_HALF_MAXIMUM] = "FWHM",
                                            [BEAM_HALF_AT_1_E2] = "half angle 1/e2",
                                            NULL};
static const char *const turn_names[] = {
    [TURN_CLOCKWISE] = "clockwise", [TURN_COUNTER_CLOCKWISE] = "counter-clockwise", NULL};

/* clang-format off */
#define FIGURE .flags = CFG_FIGURE
/* The default of a key that only some emitters have: no value. With NULL every head would need the key; NEEDED_BY names
 * the emitters that need it. */
#define OWNED ""
#define NEEDED_BY(emitter) .of = CFG_KIND(emitter), .needed = 1
static const struct cfg_key profile_keys[] = {
    {KEY(maker), CFG_TEXT, .flags = CFG_ASCII, .help = "Maker, as in *IDN?."},
    {KEY(model), CFG_TEXT, .flags = CFG_ASCII, .help = "Model, as in *IDN?."},
    {KEY(firmware), CFG_TEXT, .def = "1.0.0", .flags = CFG_ASCII,
     .help = "Version of the firmware, as the protocols of this head report it."},

    {"emitter", IN_PROFILE(arrangement.kind), CFG_ENUM, .def = "line", .names = emitter_names,
     .help = "How the pulses are arranged. line: a mirror sweeps lines, the pan turns. planar: one plane, in steps. "
             "beams: a firing sequence of several beams, which turns about the vertical. sphere: rings from pole to "
             "pole. directions: a list."},
    {EMITTER(steps_per_turn), CFG_COUNT, NULL, OWNED, 1, EMITTER_MAX_STEPS, FIGURE,
     NEEDED_BY(EMITTER_PLANAR),
     .help = "planar: steps of a turn, each a pulse. The pulse rate is that many times the line rate."},
    {EMITTER(first_step), CFG_COUNT, NULL, OWNED, 0, EMITTER_MAX_STEPS - 1, FIGURE,
     NEEDED_BY(EMITTER_PLANAR),
     .help = "planar: the first step that is cast; a turn begins with step 0."},
    {EMITTER(last_step), CFG_COUNT, NULL, OWNED, 0, EMITTER_MAX_STEPS - 1, FIGURE, NEEDED_BY(EMITTER_PLANAR),
     .help = "planar: the last one."},
    {EMITTER(front_step), CFG_COUNT, NULL, OWNED, 0, EMITTER_MAX_STEPS - 1, FIGURE, NEEDED_BY(EMITTER_PLANAR),
     .help = "planar: the step that points ahead, along y. Line angles count from it, in the direction of the steps."},
    {EMITTER(step_direction), CFG_ENUM, .def = OWNED, .names = turn_names, FIGURE,
     .of = CFG_KIND(EMITTER_PLANAR) | CFG_KIND(EMITTER_BEAMS),
     .help = "planar, beams: direction of the turn, seen from above; clockwise when not given."},
    {"geometries", .type = CFG_LIST, .min = 0, .max = HEAD_MAX_RATES,
     .offset = offsetof(struct config_profile, arrangement.geometry), .size = sizeof(struct config_geometry),
     .count_offset = offsetof(struct config_profile, arrangement.n_geometries), .of = CFG_KIND(EMITTER_PLANAR),
     .help = "planar: the line rates of a head with fixed line rates, with the steps of a turn at each. The first "
             "is that of power-up. Without geometries any line rate is allowed, at steps_per_turn."},
    {"geometries[]", .type = CFG_MAP, .help = "Written { lines_hz: F, steps_per_turn: N, from: GRADE }."},
    {"geometries[].lines_hz", GEOMETRY(lines_uhz), CFG_MICRO, "Hz", NULL, 0.01, 1e6, .help = "Line rate."},
    {"geometries[].steps_per_turn", GEOMETRY(steps_per_turn), CFG_COUNT, NULL, NULL, 4, 18000,
     .help = "Steps of a turn at this line rate. steps_per_turn of the head divided by it must be a whole number, "
             "which also divides first_step, last_step and front_step."},
    {"geometries[].from", GEOMETRY(from), CFG_ENUM, .names = cfg_from_names, .help = "Where the figures are from."},
    {"firing_ns", IN_PROFILE(arrangement.firing_fs), CFG_MICRO, "ns", OWNED, 0.001, 1e9, FIGURE,
     NEEDED_BY(EMITTER_BEAMS),
     .help = "beams: duration of a firing sequence with its pauses; a multiple of 0.001 ns."},
    {"beams", .type = CFG_LIST, .min = 0, .max = EMITTER_MAX_BEAMS,
     .offset = offsetof(struct config_profile, arrangement.beam), .size = sizeof(struct config_profile_beam),
     .count_offset = offsetof(struct config_profile, arrangement.n_beams), NEEDED_BY(EMITTER_BEAMS),
     .help = "beams: in the order in which they fire."},
    {"beams[]", .type = CFG_MAP,
     .help = "Written { elevation_deg: E, azimuth_deg: A, offset_ns: T, from: GRADE }."},
    {"beams[].elevation_deg", BEAM(elevation_udeg), CFG_MICRO, "deg", NULL, -90, 90,
     .help = "Elevation above the horizontal."},
    {"beams[].azimuth_deg", BEAM(azimuth_udeg), CFG_MICRO, "deg", "0", -360, 360,
     .help = "Azimuth, clockwise from the head's direction at that time."},
    {"beams[].offset_ns", BEAM(offset_ns), CFG_COUNT, "ns", NULL, 0, 1e9,
     .help = "Firing time after the sequence's first beam; the times rise from 0."},
    {"beams[].from", BEAM(from), CFG_ENUM, .names = cfg_from_names, .help = "Where the figures are from."},
    {"step_deg", IN_PROFILE(arrangement.step_udeg), CFG_MICRO, "deg", OWNED, 0.01, 90, FIGURE,
     NEEDED_BY(EMITTER_SPHERE),
     .help = "sphere: angle from pulse to pulse and from ring to ring. It is rounded to whole steps of a turn and "
             "of half a turn."},

    {EMITTER(directions), CFG_PATH, .def = OWNED, NEEDED_BY(EMITTER_DIRECTIONS),
     .help = "directions: a text file with a direction a row: x y z in the head's frame, or azimuth and elevation in "
             "degrees; # begins a comment."},

    {"prr_min_hz", IN_PROFILE(prr_min_uhz), CFG_MICRO, "Hz", OWNED, 1, 1e7, FIGURE, NEEDED_BY(EMITTER_LINE),
     .help = "line: lowest pulse rate."},
    {"prr_max_hz", IN_PROFILE(prr_max_uhz), CFG_MICRO, "Hz", OWNED, 1, 1e7, FIGURE, NEEDED_BY(EMITTER_LINE),
     .help = "line: highest pulse rate."},
    {"lines_min_hz", IN_PROFILE(lines_min_uhz), CFG_MICRO, "Hz", NULL, 0.25, 1e4, FIGURE,
     .help = "Slowest line rate; a line lasts 4 s at most."},
    {"lines_max_hz", IN_PROFILE(lines_max_uhz), CFG_MICRO, "Hz", NULL, 0.25, 1e4, FIGURE, .help = "Fastest line rate."},
    {"pan_max_deg_s", IN_PROFILE(pan_max_udeg_s), CFG_MICRO, "deg/s", OWNED, 0, 3600, FIGURE, NEEDED_BY(EMITTER_LINE),
     .help = "line: fastest pan."},
    {"fov_min_deg", IN_PROFILE(fov_min_udeg), CFG_MICRO, "deg", OWNED, -180, 360, FIGURE,
     NEEDED_BY(EMITTER_LINE),
     .help = "line: field of view of a line, 0 forward, 90 up, above 90 backward over the zenith."},
    {"fov_max_deg", IN_PROFILE(fov_max_udeg), CFG_MICRO, "deg", OWNED, -180, 360, FIGURE, NEEDED_BY(EMITTER_LINE),
     .help = "line: end of the field of view, which must fit into a sweep, 360 / facets * optical_gain."},
    {"pan_min_deg", IN_PROFILE(pan_min_udeg), CFG_MICRO, "deg", OWNED, -360, 360, FIGURE, NEEDED_BY(EMITTER_LINE),
     .help = "line: smallest pan angle."},
    {"pan_max_deg", IN_PROFILE(pan_max_udeg), CFG_MICRO, "deg", OWNED, -360, 360, FIGURE,
     NEEDED_BY(EMITTER_LINE),
     .help = "line: largest pan angle; at most a turn from pan_min_deg."},
    {KEY(facets), CFG_COUNT, NULL, OWNED, 1, 360, FIGURE, NEEDED_BY(EMITTER_LINE),
     .help = "line: lines per turn of the mirror."},
    {KEY(optical_gain), CFG_REAL, NULL, OWNED, 0.01, 100, FIGURE, NEEDED_BY(EMITTER_LINE),
     .help = "line: beam degrees per mirror degree, 2 for a polygon, 1 for a 45-degree mirror."},
    {KEY(range_min_m), CFG_REAL, "m", NULL, 0, 1e5, FIGURE, .help = "Shortest range."},
    {KEY(range_max_m), CFG_REAL, "m", NULL, 0.001, 1e5, FIGURE, .help = "Longest range."},
    {KEY(range_sigma_m), CFG_REAL, "m", NULL, 0, 10, FIGURE, .help = "One sigma of the range noise, fixed part."},
    {KEY(range_sigma_ppm), CFG_REAL, "ppm", NULL, 0, 1e4, FIGURE,
     .help = "One sigma of the range noise, part per distance."},
    {KEY(range_sigma_at_m), CFG_REAL, "m", "100", 0.1, 1e5, FIGURE,
     .help = "Range where range_sigma_m holds; for noise.range: signal."},
    {KEY(range_sigma_reflectance), CFG_REAL, NULL, "0.9", 0.001, 1, FIGURE,
     .help = "Reflectance of the target that range_sigma_m holds for."},
    {KEY(range_sigma_floor_m), CFG_REAL, "m", "0", 0, 10, FIGURE,
     .help = "Range noise that remains, however strong the signal is."},
    {KEY(mirror_sigma_deg), CFG_REAL, "deg", "0", 0, 1, FIGURE, .help = "One sigma of the noise of the line angle."},
    {KEY(pan_sigma_deg), CFG_REAL, "deg", "0", 0, 1, FIGURE, .help = "One sigma of the noise of the pan angle."},
    {"reaches", .type = CFG_LIST, .min = 0, .max = DETECT_MAX_REACHES, .offset = offsetof(struct config_profile, reach),
     .size = sizeof(struct config_reach), .count_offset = offsetof(struct config_profile, n_reaches),
     .help = "Ranges up to which targets are seen, by reflectance. Without reaches, a target of reflectance 0.9 is "
             "seen up to range_max_m. Programs with reach_90_m use that instead."},
    {"reaches[]", .type = CFG_MAP, .help = "Written { reflectance: R, range_m: V, from: data sheet|quoted|assumed }."},
    {REACH(reflectance), CFG_REAL, NULL, NULL, 0.001, 1, .help = "Reflectance of the target: Lambertian, head on."},
    {REACH(range_m), CFG_REAL, "m", NULL, 0.1, 1e5, .help = "Range where half of the pulses still detect it."},
    {REACH(from), CFG_ENUM, .names = cfg_from_names, .help = "Where the figures are from."},
    {"programs", .type = CFG_LIST, .min = 0, .max = HEAD_MAX_RATES,
     .offset = offsetof(struct config_profile, program), .size = sizeof(struct config_program),
     .count_offset = offsetof(struct config_profile, n_programs), .of = CFG_KIND(EMITTER_LINE),
     .help = "The pulse rates of a head with fixed rates, and the values that depend on them. The rates rise from "
             "prr_min_hz to prr_max_hz; no other rate is allowed. Without programs any rate between these two is "
             "allowed."},
    {"programs[]", .type = CFG_MAP, .help = "One pulse rate; each entry is a figure."},
    {"programs[].prr_hz", PROGRAM(prr_uhz), CFG_MICRO, "Hz", NULL, 1, 1e7, FIGURE, .help = "Its pulse rate."},
    {"programs[].max_echoes", PROGRAM(max_echoes), CFG_COUNT, NULL, "", 1, LINE_MAX_ECHOES, FIGURE,
     .help = "Echoes per pulse; max_echoes of the head when not given."},
    {"programs[].reach_90_m", PROGRAM(reach_90_m), CFG_REAL, "m", "", 0.1, 1e5, FIGURE,
     .help = "Range up to which a target of 90 % is detected; nothing is detected beyond it. When not given, reaches "
             "and range_max_m of the head hold."},
    {"programs[].reach_20_m", PROGRAM(reach_20_m), CFG_REAL, "m", "", 0.1, 1e5, FIGURE,
     .help = "The same for 20 %; needs reach_90_m."},
    {"programs[].range_min_m", PROGRAM(range_min_m), CFG_REAL, "m", "", 0, 1e5, FIGURE,
     .help = "Shortest range; range_min_m of the head when not given."},
    {"programs[].used_hz", PROGRAM(used_uhz), CFG_MICRO, "Hz", "", 1, 1e7, FIGURE,
     .help = "Pulses per second that fall into the field of view; within 2 % of prr_hz times that field's share of the "
             "sweep."},
    {KEY(accuracy_m), CFG_REAL, "m", "0", 0, 10, FIGURE,
     .help = "Accuracy of ranges, fixed part. It is only shown, and makes no noise. 0: not known."},
    {KEY(accuracy_ppm), CFG_REAL, "ppm", "0", 0, 1e4, FIGURE, .help = "Accuracy of ranges, part per distance."},
    {KEY(angle_accuracy_deg), CFG_REAL, "deg", "0", 0, 1, FIGURE,
     .help = "Accuracy of angles. It is only shown, and makes no noise. 0: not known."},
    {KEY(threshold_snr), CFG_REAL, NULL, "8", 1, 1000, FIGURE,
     .help = "Signal-to-noise ratio (amplitudes) at the detection threshold."},
    {KEY(overlap_m), CFG_REAL, "m", "0", 0, 1000, FIGURE,
     .help = "Range below which light misses the detector: it receives the share 1 - exp(-(R / overlap_m)^2); 0: all "
             "light."},
    {KEY(wavelength_nm), CFG_REAL, "nm", "1550", 400, 2000, FIGURE, .help = "Wavelength of the laser."},
    {KEY(visibility_m), CFG_REAL, "m", "23000", 100, 1e6, FIGURE,
     .help = "Visibility for which the reaches are given."},
    {KEY(mirror_counts), CFG_REAL, NULL, NULL, 0, 4294967296.0, FIGURE,
     .help = "Encoder counts per turn of the line angle; 0: ideal."},
    {KEY(pan_counts), CFG_REAL, NULL, NULL, 0, 4294967296.0, FIGURE,
     .help = "Encoder counts per turn of the pan; 0: ideal."},
    {"beam_exit_m", IN_PROFILE(beam_exit_given_m), CFG_REAL, "m", NULL, 0, 1, FIGURE, .definitions = widths,
     .definition_offset = offsetof(struct config_profile, beam_exit_definition),
     .help = "Diameter of the beam at the exit, as the maker gives it. definition names the kind: 1/e2 (the default), "
             "1/e, FWHM, radius 1/e2."},
    {"beam_divergence_rad", IN_PROFILE(beam_divergence_given_rad), CFG_REAL, "rad", NULL, 0, 0.01, FIGURE,
     .definitions = angles, .definition_offset = offsetof(struct config_profile, beam_divergence_definition),
     .help = "Divergence, as the maker gives it. definition names the kind: 1/e2 (full angle; the default), 1/e, "
             "FWHM, half angle 1/e2. The full angle at 1/e2 is the figure times 1.41 (1/e), 1.70 (FWHM) or 2 (half "
             "angle)."},
    {KEY(pulse_width_ns), CFG_REAL, "ns", NULL, 0, 1000, FIGURE,
     .help = "Width of the pulse in time. Echoes that are closer to each other than c / 2 times this width merge into "
             "one. A beam that has a width needs at least 0.1 ns in any beam.mode but single."},
    {KEY(max_echoes), CFG_COUNT, NULL, NULL, 1, LINE_MAX_ECHOES, FIGURE, .help = "Echoes per pulse."},
    {KEY(boot_s), CFG_REAL, "s", NULL, 0, 600, FIGURE, .help = "Power-on to ready."},
    {KEY(spin_up_s), CFG_REAL, "s", NULL, 0, 600, FIGURE, .help = "Start command to mirror at speed."},
    {KEY(spin_down_s), CFG_REAL, "s", NULL, 0, 600, FIGURE, .help = "Stop to mirror at rest."},
};
/* clang-format on */

_Static_assert(CFG_LEN(profile_keys) <= CFG_MAX_ROWS, "room for every row");

const struct cfg_table cfg_profile_table = {profile_keys, CFG_LEN(profile_keys)};
