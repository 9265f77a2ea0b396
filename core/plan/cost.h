/* SPDX-License-Identifier: MIT */
/* Costs of methods, to compare them: rounded ns on one core. To get them again: `make bench-beam` measures
 * single rays, sub-rays and the adaptive beam (house, wires, foliage), `make bench` stages, `make chart`
 * ways to georeference. Sub-rays cost 65 ns in a house and 105 ns among leaves. A pulse whose
 * footprint is cut by an outline costs 0.2 to 2.2 us. */
#ifndef CORE_PLAN_COST_H
#define CORE_PLAN_COST_H

#include <stdint.h>

#define PLAN_COST_PULSE    40.0   /* all stages but the cast's (build/bench) */
#define PLAN_COST_SUB_RAY  70.0   /* a ray of a ring, or beyond glass */
#define PLAN_COST_OUTLINES 8.0    /* adaptive: asking whether an outline is near, for each pulse */
#define PLAN_COST_CUT      1000.0 /* adaptive: a pulse that an outline cuts */

/* ---- waveforms (make bench-waveform, build/tests/bench/waveform_detect): of pulses with one return */

#define PLAN_COST_WAVE        160.0 /* a window, without its samples */
#define PLAN_COST_WAVE_SAMPLE 2.5   /* a sample, with noise */
#define PLAN_COST_FLANK       300.0 /* finding an echo by a threshold or by a fraction of its peak */
#define PLAN_COST_GAUSSIANS   520.0 /* finding an echo by Gaussian decomposition */

/* ---- a ray's first hit, and the map of core/sight (build/bench --only-sight) */

/* Costs of the BVH for a ray, by how many rays Embree takes at once. `hit` and `miss` are the costs where few rays are
 * near a border. Rays beyond a border hit another triangle, so a packet with such rays goes to more leaves. For this,
 * `border` times the share of rays near a border is added. The costs come from the bench's column `without` (no map) of
 * house, garden and terrain, 1 to 22.5 million pulses. For packets of 8 and 4 all three follow the ratios of Embree's
 * packets in the chart. */
struct plan_ray_cost {
    uint32_t packet;
    double hit, miss, border;
};
static const struct plan_ray_cost plan_ray_costs[] = {
    {16, 12.0, 8.0, 35.0}, {8, 19.0, 13.0, 57.0}, {4, 34.0, 23.0, 100.0}};

#define PLAN_COST_SIGHT_ONE   2.0   /* a look-up where there is one triangle, or nothing */
#define PLAN_COST_SIGHT_FEW   35.0  /* a look-up among a few triangles */
#define PLAN_COST_SIGHT_ASK   150.0 /* the BVH is asked ray by ray, since such rays go to different leaves */
#define PLAN_COST_SIGHT_SMALL 12.0  /* the BVH is asked for small triangles, neighbours together */
/* Extra in a scene of a million triangles or more, whose planes fit into no cache. Up to there it grows with the root
 * of their number. */
#define PLAN_COST_MILLION 10.0
/* Costs of making the map: a fixed part, a part per triangle, more for a triangle that is examined by itself, and a
 * part per cell that shows more than one triangle. The last two figures are the memory of such cells. */
#define PLAN_COST_SIGHT          2.2e6
#define PLAN_COST_SIGHT_TRIANGLE 28.0
#define PLAN_COST_SIGHT_EXAMINED 440.0
#define PLAN_COST_SIGHT_CELL     60.0
#define PLAN_SIGHT_CELL_BYTES    25.0
#define PLAN_SIGHT_RECORD_BYTES  128.0 /* one struct sight_record, for a triangle in such cells */

#endif
