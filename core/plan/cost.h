/* What methods cost: rounded ns of one core, to compare methods by. To get them again: `make bench-beam`
 * measures single rays, sub-rays and the adaptive beam (house, wires, foliage), `make bench` stages, `make
 * chart` ways to georeference. Sub-rays cost 65 ns in a house and 105 ns among leaves, a pulse that outlines
 * cut 0.2 to 2.2 us. */
#ifndef CORE_PLAN_COST_H
#define CORE_PLAN_COST_H

#define PLAN_COST_SUB_RAY  70.0   /* a ray of a ring, or beyond glass */
#define PLAN_COST_OUTLINES 8.0    /* adaptive: asking whether an outline is near, for each pulse */
#define PLAN_COST_CUT      1000.0 /* adaptive: a pulse that one cuts */

#endif
