/* SPDX-License-Identifier: MIT */
/* What methods cost: rounded ns of one core, to compare methods by. To get them again: `make bench-beam`
 * measures single rays, sub-rays and the adaptive beam (house, wires, foliage), `make bench` stages, `make
 * chart` ways to georeference. Sub-rays cost 65 ns in a house and 105 ns among leaves, a pulse that outlines
 * cut 0.2 to 2.2 us. */
#ifndef CORE_PLAN_COST_H
#define CORE_PLAN_COST_H

#include <stdint.h>

#define PLAN_COST_PULSE    40.0   /* all stages but the cast's (build/bench) */
#define PLAN_COST_SUB_RAY  70.0   /* a ray of a ring, or beyond glass */
#define PLAN_COST_OUTLINES 8.0    /* adaptive: asking whether an outline is near, for each pulse */
#define PLAN_COST_CUT      1000.0 /* adaptive: a pulse that one cuts */

/* ---- a ray's first hit, and the map of core/sight (build/bench --only-sight) */

/* Costs of the BVH, by how many rays Embree takes at once: met something, met nothing, and more where a border is near,
 * since rays of a packet then go to more leaves. They are from `without` of house, garden and terrain, 1 to 22.5 million
 * pulses: met and out where borders are few, border from the growth with their share. Those for packets of 8 and 4 follow
 * the ratios of Embree's packets in the chart. */
struct plan_ray_cost {
    uint32_t packet;
    double met, out, border;
};
static const struct plan_ray_cost plan_ray_costs[] = {
    {16, 13.0, 9.0, 42.0}, {8, 21.0, 12.0, 65.0}, {4, 50.0, 30.0, 130.0}};

#define PLAN_COST_SIGHT_ONE 2.0   /* looked up: one triangle or nothing there, */
#define PLAN_COST_SIGHT_FEW 35.0  /* one of a few, */
#define PLAN_COST_SIGHT_ASK 150.0 /* the BVH is asked after all: such rays have nothing in common */
/* What is more in a scene of a million triangles, whose planes lie in no cache; by the root of their number. */
#define PLAN_COST_MILLION 10.0
/* To make it: in any case, by triangle, and by cell that shows more than one; such a cell's memory. */
#define PLAN_COST_SIGHT          3e6
#define PLAN_COST_SIGHT_TRIANGLE 330.0
#define PLAN_COST_SIGHT_CELL     110.0
#define PLAN_SIGHT_CELL_BYTES    25.0
#define PLAN_SIGHT_RECORD_BYTES  128.0 /* of a triangle that such cells show */

#endif
