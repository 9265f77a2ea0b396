/* What methods cost: rounded ns of one core, to compare methods by. To get them again: `make bench-beam`
 * measures single rays, sub-rays and the adaptive beam (house, wires, foliage), `make bench` stages, `make
 * chart` ways to georeference. Sub-rays cost 65 ns in a house and 105 ns among leaves, a pulse that outlines
 * cut 0.2 to 2.2 us. */
#ifndef CORE_PLAN_COST_H
#define CORE_PLAN_COST_H

#define PLAN_COST_SUB_RAY  70.0   /* a ray of a ring, or beyond glass */
#define PLAN_COST_OUTLINES 8.0    /* adaptive: asking whether an outline is near, for each pulse */
#define PLAN_COST_CUT      1000.0 /* adaptive: a pulse that one cuts */

/* ---- a ray's first hit, and the map of core/sight */
#define PLAN_COST_RAY       50.0  /* met by the BVH, */
#define PLAN_COST_RAY_OUT   27.0  /* of one that meets nothing, */
#define PLAN_COST_BORDER    150.0 /* and more of one that passes near a border */
#define PLAN_COST_SIGHT_ONE 5.0   /* looked up: one triangle or nothing there, */
#define PLAN_COST_SIGHT_FEW 50.0  /* one of a few, */
#define PLAN_COST_SIGHT_ASK 220.0 /* the BVH is asked after all: such rays have nothing in common */
/* To make it: in any case, by triangle, and by cell that shows more than one. */
#define PLAN_COST_SIGHT          2e6
#define PLAN_COST_SIGHT_TRIANGLE 260.0
#define PLAN_COST_SIGHT_CELL     400.0
/* bvh_order_exactly: a triangle, and a ray's first hit in a scene of few overlaps. */
#define PLAN_COST_ORDER   6000.0
#define PLAN_COST_ORDERED 20.0

#endif
