/* SPDX-License-Identifier: MIT */
#include "tests/unit/grid_rig.h"

const double grid_rig_head_m[3] = {10, 20, 30};
uint64_t grid_rig_first_pulse;

struct native_descriptor grid_rig_descriptor(uint32_t scan)
{
    return (struct native_descriptor){.idn = "Maker,Model,SN1,1.0",
                                      .profile = "model",
                                      .scan = scan,
                                      .layout = NATIVE_GEO,
                                      .prr_uhz = 1000000000,
                                      .lines_uhz = 1000000,
                                      .pan_udeg_s = 36000000,
                                      .pan_stop_udeg = 360000000,
                                      .sweep_udeg = 360000000,
                                      .line_stop_udeg = 36000000,
                                      .range_max_m = 100,
                                      .frames = 1,
                                      .mirror_counts_per_turn = 3600,
                                      .pan_counts_per_turn = 3600,
                                      .range_scale_m = 1e-3};
}

void grid_rig_put_descriptor(const struct native_descriptor *d)
{
    static uint8_t out[1024];
    rig_put(out, native_encode_descriptor(out, sizeof out, d, 0, 0));
}

struct native_anchor grid_rig_anchor(uint32_t station)
{
    struct native_anchor a = rig_anchor_of(NATIVE_CRS_LOCAL, 0, station);
    memcpy(a.anchor, grid_rig_head_m, sizeof grid_rig_head_m);
    memcpy(a.axes, (const double[9]){1, 0, 0, 0, 1, 0, 0, 0, 1}, sizeof a.axes);
    for (int k = 0; k < 3; k++)
        a.scale[k] = 1e-3;
    return a;
}

void grid_rig_begin_scan(uint32_t scan, uint32_t station)
{
    const struct native_descriptor d = grid_rig_descriptor(scan);
    const struct native_anchor a = grid_rig_anchor(station);
    grid_rig_put_descriptor(&d);
    rig_anchor(&a);
}

void grid_rig_put_line(uint32_t line, uint32_t row, const struct rig_point *p, uint32_t n)
{
    const uint64_t pulse = grid_rig_first_pulse + (uint64_t)line * PULSES;
    rig_points(line, pulse, pulse + row, p, n);
}

struct rig_point grid_rig_hit(double x, double y, double z, uint16_t label)
{
    return (struct rig_point){
        (int32_t)lrint(1000 * x), (int32_t)lrint(1000 * y), (int32_t)lrint(1000 * z), -500, label, 1, 1};
}

void grid_rig_put_step(uint32_t first_line)
{
    for (uint32_t line = 0; line < 4; line++) {
        struct rig_point p[3];
        for (uint32_t row = 0; row < 3; row++)
            p[row] = grid_rig_hit(line, line < 2 ? 10 : 11, row, (uint16_t)(line / 2));
        grid_rig_put_line(first_line + line, 20, p, 3);
    }
}
