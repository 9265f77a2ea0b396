/* SPDX-License-Identifier: MIT */
#include "tests/unit/velodyne_head.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>

#include <cmocka.h>

#include "drivers/protocol/native_encode.h"

enum { MOST = 4096 };

struct protocol_rig rig;

int velodyne_head_setup(void **state)
{
    (void)state;
    protocol_rig_open(&rig, PROTOCOL_VELODYNE, "Velodyne", "VLP-16");
    protocol_rig_beams(&rig, 10);
    rig.emitter.echoes = NATIVE_ECHOES_STRONGEST;
    return 0;
}

int velodyne_head_teardown(void **state)
{
    (void)state;
    protocol_rig_close(&rig);
    return 0;
}

const uint8_t *velodyne_head_packet(uint32_t i)
{
    assert_true(i < rig.n_units);
    assert_int_equal(rig.end[i], 1206 * (i + 1));
    return rig.bytes + (size_t)1206 * i;
}

int64_t velodyne_head_ns(uint64_t pulse)
{
    return (int64_t)(pulse / 16) * SEQUENCE_NS + (int64_t)(pulse % 16) * FIRING_NS;
}

double velodyne_head_turns(uint64_t pulse, double rpm)
{
    return (double)velodyne_head_ns(pulse) * 1e-9 * rpm / 60.0;
}

int velodyne_head_elevation_deg(uint32_t beam)
{
    return beam % 2 == 0 ? -15 + (int)beam : (int)beam;
}

void velodyne_head_fire(uint64_t pulse0, uint32_t n, const struct protocol_rig_shot *shot, double rpm, double turn0)
{
    static int64_t dt_ns[MOST];
    static double mirror[MOST], pan[MOST];
    assert_true(n <= MOST);
    const struct protocol_rig_run run = {0,
                                         (uint32_t)floor(turn0 + velodyne_head_turns(pulse0, rpm)),
                                         pulse0,
                                         n,
                                         velodyne_head_ns(pulse0),
                                         0,
                                         dt_ns,
                                         mirror,
                                         pan,
                                         shot};
    for (uint32_t i = 0; i < n; i++) {
        dt_ns[i] = velodyne_head_ns(pulse0 + i) - run.t0_ns;
        mirror[i] = velodyne_head_elevation_deg((uint32_t)((pulse0 + i) % 16)) / 360.0;
        pan[i] = turn0 + velodyne_head_turns(pulse0 + i, rpm);
    }
    protocol_rig_points(&rig, &run);
}

void velodyne_head_fire_alike(uint64_t pulse0, uint32_t n, double range_m)
{
    static struct protocol_rig_shot shot[MOST];
    assert_true(n <= MOST);
    for (uint32_t i = 0; i < n; i++)
        shot[i] = (struct protocol_rig_shot){.n = 1, .range_m = {range_m}};
    velodyne_head_fire(pulse0, n, shot, 600.0, 0.0);
}

void velodyne_head_event(uint32_t code)
{
    uint8_t frame[256];
    const struct native_event e = {.code = code, .a = 1};
    size_t len = native_encode_event(frame, sizeof frame, &e, 0, 0);
    assert_true(len != 0);
    rig.ops->frame(rig.protocol, frame, len);
}
