/* Which beam a pulse is, and how far pulses are followed through glass and mirrors: measured on the scene where the
 * configuration leaves it open. */
#ifndef FIRMWARE_SIM_SITE_BEAM_CHOICE_H
#define FIRMWARE_SIM_SITE_BEAM_CHOICE_H

#include "firmware_sim/site/site.h"

/* All else of the site is in place. Sets beam, rings and depth of site->plan.methods and the rows of beam and optics,
 * and makes the stations' beams. Warns where nothing holds the tolerances. For `plan` (site->measures) the error of
 * what is forced is measured, too. */
int site_choose_methods(struct site *site, const struct sh_report *report, struct sh_err *err);

#endif
