/* SPDX-License-Identifier: MIT */
#include "tests/wire/emitter_rig.h"

/* A turn has steps from 0 to 1439, of which 0..1080 are seen and 540 is ahead, counter-clockwise. There are 40 turns a
 * second. */
void shot_utm(uint64_t k, struct shot *out)
{
    const int step = (int)(k % 1440);
    *out = (struct shot){(int64_t)(k * 1000000000 / 57600), 0, -(step - 540) * 0.25, step <= 1080};
}

/* A turn has 1024 steps, of which 44..725 are seen and 384 is ahead. There are 10 turns a second. */
void shot_urg(uint64_t k, struct shot *out)
{
    const int step = (int)(k % 1024);
    *out = (struct shot){(int64_t)(k * 1000000000 / 10240), 0, -(step - 384) * 360.0 / 1024, step >= 44 && step <= 725};
}

/* A turn has 1080 steps of a third of a degree, of which 811 are seen, from -45 deg on. 0 is right (x), 90 ahead,
 * counter-clockwise. There are 15 turns a second. */
void shot_tim(uint64_t k, struct shot *out)
{
    const int step = (int)(k % 1080);
    const double angle_deg = -45.0 + step / 3.0;
    *out = (struct shot){(int64_t)(k * 1000000000 / 16200), 0, 90.0 - angle_deg, step <= 810};
}

const int vlp_deg[VLP_BEAMS] = {-15, 1, -13, 3, -11, 5, -9, 7, -7, 9, -5, 11, -3, 13, -1, 15};

/* t = 55.296 us sequence + 2.304 us channel. There are ten turns a second, from azimuth 0 on. */
void shot_vlp(uint64_t k, struct shot *out)
{
    const int64_t t_ns = (int64_t)(k / VLP_BEAMS) * 55296 + (int64_t)(k % VLP_BEAMS) * 2304;
    *out = (struct shot){t_ns, vlp_deg[k % VLP_BEAMS], (double)(t_ns % 100000000) * 360.0 / 1e8, 1};
}

/* Rings are 10 deg apart and have 36 steps. There are 20 rings a second. */
void shot_sphere(uint64_t k, struct shot *out)
{
    const int ring = (int)(k / 36 % 19), step = (int)(k % 36);
    *out = (struct shot){(int64_t)(k * 1000000000 / 720), -90.0 + 10 * ring, 10.0 * step,
                         (ring != 0 && ring != 18) || step == 0};
}

const double list_deg[5][2] = {{0, 0}, {90, 0}, {-150, 12.5}, {300, -60}, {45, 89}};

void shot_list(uint64_t k, struct shot *out)
{
    *out = (struct shot){(int64_t)(k * 1000000000 / 50), list_deg[k % 5][1], list_deg[k % 5][0], 1};
}

/* The keys of our own profiles beside their emitter. */
static const char rest_of_profile[] = "maker: tests\nmodel: head\nlines_min_hz: {value: 1, from: assumed}\n"
                                      "lines_max_hz: {value: 40, from: assumed}\n"
                                      "range_min_m: {value: 0.01, from: assumed}\n"
                                      "range_max_m: {value: 50, from: assumed}\n"
                                      "range_sigma_m: {value: 0, from: assumed}\n"
                                      "range_sigma_ppm: {value: 0, from: assumed}\n"
                                      "mirror_counts: {value: 0, from: assumed}\n"
                                      "pan_counts: {value: 0, from: assumed}\n"
                                      "beam_exit_m: {value: 0, from: assumed}\n"
                                      "beam_divergence_rad: {value: 0, from: assumed}\n"
                                      "pulse_width_ns: {value: 4, from: assumed}\n"
                                      "max_echoes: {value: 1, from: assumed}\n"
                                      "boot_s: {value: 0.1, from: assumed}\n"
                                      "spin_up_s: {value: 0.01, from: assumed}\n"
                                      "spin_down_s: {value: 0.1, from: assumed}\n";

void emitter_write_profile(const struct wire *wire, const char *emitter)
{
    char text[2048];
    snprintf(text, sizeof text, "%s%s", emitter, rest_of_profile);
    wire_write_text(wire, "own.yaml", text);
}
