/* The table of a head profile's keys. */
#include "firmware_sim/config/table.h"

#define IN_PROFILE(member) CFG_MEMBER(struct config_profile, member)
#define IN_REACH(member)   CFG_MEMBER(struct config_reach, member)

static const char *const from_names[] = {[FROM_DATA_SHEET] = "data sheet", [FROM_ASSUMED] = "assumed", NULL};

/* clang-format off */
#define FIGURE .flags = CFG_FIGURE
static const struct cfg_key profile_keys[] = {
    {"maker", CFG_TEXT, IN_PROFILE(maker), .flags = CFG_ASCII, .help = "Maker, as in *IDN?."},
    {"model", CFG_TEXT, IN_PROFILE(model), .flags = CFG_ASCII, .help = "Model, as in *IDN?."},
    {"prr_min_hz", CFG_MICRO, "Hz", NULL, 1, 1e7, IN_PROFILE(prr_min_uhz), FIGURE, .help = "Lowest pulse rate."},
    {"prr_max_hz", CFG_MICRO, "Hz", NULL, 1, 1e7, IN_PROFILE(prr_max_uhz), FIGURE, .help = "Highest pulse rate."},
    {"lines_min_hz", CFG_MICRO, "Hz", NULL, 0.25, 1e4, IN_PROFILE(lines_min_uhz), FIGURE,
     .help = "Slowest line rate; a line lasts 4 s at most."},
    {"lines_max_hz", CFG_MICRO, "Hz", NULL, 0.25, 1e4, IN_PROFILE(lines_max_uhz), FIGURE, .help = "Fastest line rate."},
    {"pan_max_deg_s", CFG_MICRO, "deg/s", NULL, 0, 3600, IN_PROFILE(pan_max_udeg_s), FIGURE, .help = "Fastest pan."},
    {"fov_min_deg", CFG_MICRO, "deg", NULL, -180, 360, IN_PROFILE(fov_min_udeg), FIGURE,
     .help = "Line field of view: 0 forward, 90 up, above 90 backward over the zenith."},
    {"fov_max_deg", CFG_MICRO, "deg", NULL, -180, 360, IN_PROFILE(fov_max_udeg), FIGURE,
     .help = "End of the line field of view; it fits into a sweep, 360 / facets * optical_gain."},
    {"pan_min_deg", CFG_MICRO, "deg", NULL, -360, 360, IN_PROFILE(pan_min_udeg), FIGURE, .help = "Smallest pan angle."},
    {"pan_max_deg", CFG_MICRO, "deg", NULL, -360, 360, IN_PROFILE(pan_max_udeg), FIGURE,
     .help = "Largest pan angle; at most a turn from pan_min_deg."},
    {"facets", CFG_COUNT, NULL, NULL, 1, 360, IN_PROFILE(facets), FIGURE, .help = "Lines per turn of the mirror."},
    {"optical_gain", CFG_REAL, NULL, NULL, 0.01, 100, IN_PROFILE(optical_gain), FIGURE,
     .help = "Beam degrees per mirror degree: 2 for a polygon, 1 for a 45-degree mirror."},
    {"range_min_m", CFG_REAL, "m", NULL, 0, 1e5, IN_PROFILE(range_min_m), FIGURE, .help = "Shortest range."},
    {"range_max_m", CFG_REAL, "m", NULL, 0.001, 1e5, IN_PROFILE(range_max_m), FIGURE, .help = "Longest range."},
    {"range_sigma_m", CFG_REAL, "m", NULL, 0, 10, IN_PROFILE(range_sigma_m), FIGURE,
     .help = "One sigma of the range noise, fixed part."},
    {"range_sigma_ppm", CFG_REAL, "ppm", NULL, 0, 1e4, IN_PROFILE(range_sigma_ppm), FIGURE,
     .help = "One sigma of the range noise, part per distance."},
    {"range_sigma_at_m", CFG_REAL, "m", "100", 0.1, 1e5, IN_PROFILE(range_sigma_at_m), FIGURE,
     .help = "Range where range_sigma_m holds; for noise.range: signal."},
    {"range_sigma_reflectance", CFG_REAL, NULL, "0.9", 0.001, 1, IN_PROFILE(range_sigma_reflectance), FIGURE,
     .help = "Reflectance of the target that range_sigma_m holds for."},
    {"range_sigma_floor_m", CFG_REAL, "m", "0", 0, 10, IN_PROFILE(range_sigma_floor_m), FIGURE,
     .help = "Range noise that is left, however strong the signal."},
    {"mirror_sigma_deg", CFG_REAL, "deg", "0", 0, 1, IN_PROFILE(mirror_sigma_deg), FIGURE,
     .help = "One sigma of the noise of the line angle."},
    {"pan_sigma_deg", CFG_REAL, "deg", "0", 0, 1, IN_PROFILE(pan_sigma_deg), FIGURE, .help = "One sigma of the noise of the pan angle."},
    {"reaches", CFG_LIST, .min = 0, .max = DETECT_MAX_REACHES, .offset = offsetof(struct config_profile, reach),
     .size = sizeof(struct config_reach), .count_offset = offsetof(struct config_profile, n_reaches),
     .help = "Ranges up to which targets are seen, by reflectance; range_max_m on 0.9 when there are none."},
    {"reaches[]", CFG_MAP, .help = "Written { reflectance: R, range_m: V, from: data sheet|assumed }."},
    {"reaches[].reflectance", CFG_REAL, NULL, NULL, 0.001, 1, IN_REACH(reflectance), .help = "Of the target, Lambertian, head on."},
    {"reaches[].range_m", CFG_REAL, "m", NULL, 0.1, 1e5, IN_REACH(range_m), .help = "Where half of the pulses still see it."},
    {"reaches[].from", CFG_ENUM, .names = from_names, IN_REACH(from), .help = "Where the figures are from."},
    {"threshold_snr", CFG_REAL, NULL, "8", 1, 1000, IN_PROFILE(threshold_snr), FIGURE,
     .help = "Signal-to-noise ratio (amplitudes) at the detection threshold."},
    {"overlap_m", CFG_REAL, "m", "0", 0, 1000, IN_PROFILE(overlap_m), FIGURE,
     .help = "Range below which light misses the detector: 1 - exp(-(R / overlap_m)^2) of it is caught; 0: all."},
    {"wavelength_nm", CFG_REAL, "nm", "1550", 400, 2000, IN_PROFILE(wavelength_nm), FIGURE, .help = "Wavelength of the laser."},
    {"visibility_m", CFG_REAL, "m", "23000", 100, 1e6, IN_PROFILE(visibility_m), FIGURE,
     .help = "Visibility that the reaches hold for."},
    {"mirror_counts", CFG_REAL, NULL, NULL, 0, 4294967296.0, IN_PROFILE(mirror_counts), FIGURE,
     .help = "Encoder counts per turn of the line angle; 0: ideal."},
    {"pan_counts", CFG_REAL, NULL, NULL, 0, 4294967296.0, IN_PROFILE(pan_counts), FIGURE,
     .help = "Encoder counts per turn of the pan; 0: ideal."},
    {"beam_exit_m", CFG_REAL, "m", NULL, 0, 1, IN_PROFILE(beam_exit_m), FIGURE,
     .help = "Diameter of the beam at the exit, at 1/e2 of its irradiance."},
    {"beam_divergence_rad", CFG_REAL, "rad", NULL, 0, 0.01, IN_PROFILE(beam_divergence_rad), FIGURE,
     .help = "Full divergence at 1/e2: 1.41 times one at 1/e, 1.70 times one at half maximum."},
    {"pulse_width_ns", CFG_REAL, "ns", NULL, 0, 1000, IN_PROFILE(pulse_width_ns), FIGURE,
     .help = "Width of the pulse: echoes nearer to each other than c / 2 of it are one. A beam that has a width needs at "
             "least 0.1 ns in any beam.mode but single."},
    {"max_echoes", CFG_COUNT, NULL, NULL, 1, LINE_MAX_ECHOES, IN_PROFILE(max_echoes), FIGURE, .help = "Echoes per pulse."},
    {"boot_s", CFG_REAL, "s", NULL, 0, 600, IN_PROFILE(boot_s), FIGURE, .help = "Power-on to ready."},
    {"spin_up_s", CFG_REAL, "s", NULL, 0, 600, IN_PROFILE(spin_up_s), FIGURE, .help = "Start command to mirror at speed."},
    {"spin_down_s", CFG_REAL, "s", NULL, 0, 600, IN_PROFILE(spin_down_s), FIGURE, .help = "Stop to mirror at rest."},
};
/* clang-format on */

_Static_assert(CFG_LEN(profile_keys) <= CFG_MAX_ROWS, "room for every row");

const struct cfg_table cfg_profile_table = {profile_keys, CFG_LEN(profile_keys)};
