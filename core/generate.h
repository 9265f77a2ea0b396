/* Generated scenes for measuring and tests: bumpy ground in a closed box, a closed mesh of any size. */
#ifndef CORE_GENERATE_H
#define CORE_GENERATE_H

#include "core/scene.h"

/* About n_triangles: a height field on side_m x side_m about centre_m, rough by rough_m, a second one as ceiling at
 * 0.3 side_m, and walls between them; closed without a crack. Heights are hashed from seed, so the same call gives the
 * same scene. The ground stays within +/- 0.6 rough_m of 0. */
int generate_terrain(uint32_t n_triangles, double side_m, double rough_m, const double centre_m[2], uint64_t seed,
                     struct scene **out, struct sh_err *err);

#endif
